//! One compiled function in executable memory.
//!
//! One of four files with unsafe code: a function of machine code is called through a pointer, which no type can vouch
//! for. What makes it sound: [`Code`] is made by [`Code::compile`] alone, from a function whose places the program's
//! verifier has checked; the sizes of all vectors are kept beside the code and compared in every call; code reads and
//! writes nothing but those vectors and its own constants; it lives as long as its memory.
//!
//! Deliberately does not know: which operations a function is made of.

use std::fmt;
use std::mem::ManuallyDrop;

use cranelift_codegen::ir::{self, AbiParam, types};
use cranelift_codegen::isa::OwnedTargetIsa;
use cranelift_codegen::settings::{self, Configurable as _};
use cranelift_frontend::FunctionBuilderContext;
use cranelift_jit::{JITBuilder, JITModule};
use cranelift_module::{FuncId, Linkage, Module, default_libcall_names};
use hamel_program::program::{Function, Point, Program};

use crate::avx::{self, Spread};
use crate::calls::Call;
use crate::error::Error;
use crate::lanes::{Form, Wide};
use crate::translate::{Imports, N_POINTERS, Twice, Width, translate};

/// Pointers in the order of [`Pointer`](crate::translate::Pointer).
type Entry =
    extern "C" fn(*const f64, *mut f64, *const f64, *const f64, *const f64, *const f64, *const f64, *mut f64);

const _: () = assert!(N_POINTERS == 8, "as many as `Entry` takes");

/// The same for code on lanes, which returns another number than zero where it has given up.
type WideEntry = extern "C" fn(
    *const f64,
    *mut f64,
    *const f64,
    *const f64,
    *const f64,
    *const f64,
    *const f64,
    *mut f64,
) -> u32;

/// What a function reads and writes.
#[derive(Debug)]
pub(crate) struct Vectors<'a, R> {
    pub(crate) params: &'a [R],
    pub(crate) prepared: &'a [R],
    pub(crate) t: R,
    pub(crate) state: &'a [R],
    pub(crate) argument: &'a [R],
    pub(crate) out: &'a mut [R],
    pub(crate) scalars: &'a mut [R],
}

/// Numbers of components.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Sizes {
    params: usize,
    prepared: usize,
    state: usize,
    argument: usize,
    out: usize,
    scalars: usize,
}

impl Sizes {
    fn of(program: &Program, function: &Function) -> Sizes {
        Sizes {
            params: program.params.len(),
            prepared: program.n_prepared(),
            state: program.state.len(),
            argument: function.argument.len(),
            out: function.results.len(),
            scalars: function.scalars.len(),
        }
    }

    /// Whether vectors have these sizes.
    #[inline]
    fn are_of<R>(&self, vectors: &Vectors<'_, R>) -> bool {
        let Vectors { params, prepared, t: _, state, argument, out, scalars } = vectors;
        self.params == params.len()
            && self.prepared == prepared.len()
            && self.state == state.len()
            && self.argument == argument.len()
            && self.out == out.len()
            && self.scalars == scalars.len()
    }
}

/// A function as machine code.
pub(crate) struct Code {
    entry: Entry,
    constants: Vec<Twice>,
    sizes: Sizes,
    width: Width,
    has_tables: bool,
    _memory: Memory,
}

/// Owns the memory of code; nothing else uses it once the code is there.
struct Memory(ManuallyDrop<JITModule>);

impl fmt::Debug for Code {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Code").field("sizes", &self.sizes).field("width", &self.width).finish_non_exhaustive()
    }
}

// SAFETY: once code is compiled the module is neither read nor written until `drop`, which has it alone.
#[allow(unsafe_code)]
unsafe impl Send for Memory {}
// SAFETY: as above.
#[allow(unsafe_code)]
unsafe impl Sync for Memory {}

impl Drop for Memory {
    fn drop(&mut self) {
        // SAFETY: the module is taken once, here, and no call is under way, since calls borrow what owns the memory.
        #[allow(unsafe_code)]
        unsafe {
            ManuallyDrop::take(&mut self.0).free_memory();
        }
    }
}

/// The machine that this program runs on.
pub(crate) fn host() -> Result<OwnedTargetIsa, Error> {
    let mut flags = settings::builder();
    for (name, value) in [
        // Programs come from a search for few operations in a good order. What Cranelift could do to them takes ten
        // times as long as to write them down, and makes nothing shorter.
        ("opt_level", "none"),
        ("is_pic", "false"),
        ("unwind_info", "false"),
        ("enable_verifier", if cfg!(debug_assertions) { "true" } else { "false" }),
    ] {
        flags.set(name, value).map_err(Error::cranelift)?;
    }
    let machine = cranelift_native::builder().map_err(|reason| Error::UnknownMachine { reason })?;
    machine.finish(settings::Flags::new(flags)).map_err(Error::cranelift)
}

struct Imported<'a> {
    module: &'a mut JITModule,
    ids: Vec<(Call, FuncId)>,
    known: Vec<(Call, ir::FuncRef)>,
}

impl Imports for Imported<'_> {
    fn import(&mut self, call: Call, function: &mut ir::Function) -> ir::FuncRef {
        if let Some((_, found)) = self.known.iter().find(|(known, _)| *known == call) {
            return *found;
        }
        // All were declared before.
        let (_, id) = self.ids.iter().find(|(known, _)| *known == call).expect("a declared function");
        let found = self.module.declare_func_in_func(*id, function);
        self.known.push((call, found));
        found
    }
}

impl Code {
    /// Compiles a function of a verified program.
    pub(crate) fn compile(
        isa: &OwnedTargetIsa,
        program: &Program,
        function: &Function,
        width: Width,
    ) -> Result<Code, Error> {
        let mut builder = JITBuilder::with_isa(isa.clone(), default_libcall_names());
        for call in Call::ALL {
            builder.symbol(call.symbol(), call.address());
        }
        let mut module = JITModule::new(builder);
        let mut ids = Vec::new();
        for call in Call::ALL {
            let mut signature = module.make_signature();
            signature.params.extend(vec![AbiParam::new(types::F64); call.n_arguments()]);
            signature.returns.push(AbiParam::new(types::F64));
            let declared = module.declare_function(&call.symbol(), Linkage::Import, &signature);
            ids.push((call, declared.map_err(Error::cranelift)?));
        }
        let mut context = module.make_context();
        let pointer = module.target_config().pointer_type();
        let mut builders = FunctionBuilderContext::new();
        let mut imports = Imported { module: &mut module, ids, known: Vec::new() };
        let into = (&mut context.func, &mut builders);
        let constants = translate(function, program, width, into, pointer, &mut imports);
        let name = function.role.name();
        let declared = module.declare_function(name, Linkage::Local, &context.func.signature);
        let id = declared.map_err(Error::cranelift)?;
        module.define_function(id, &mut context).map_err(Error::cranelift)?;
        module.finalize_definitions().map_err(Error::cranelift)?;
        let address = module.get_finalized_function(id);
        // SAFETY: the code at this address is of a function with the eight pointers that `translate` gives it, in the
        // calling convention of the machine, which is that of `extern "C"`.
        #[allow(unsafe_code)]
        let entry = unsafe { std::mem::transmute::<*const u8, Entry>(address) };
        Ok(Code {
            entry,
            constants: constants.values,
            sizes: Sizes::of(program, function),
            width,
            has_tables: !function.contractions.is_empty(),
            _memory: Memory(ManuallyDrop::new(module)),
        })
    }

    /// Whether tables are to be run through after the code.
    #[inline]
    pub(crate) fn has_tables(&self) -> bool {
        self.has_tables
    }

    #[inline]
    fn check<R>(&self, width: Width, vectors: &Vectors<'_, R>) {
        assert!(
            self.width == width && self.sizes.are_of(vectors),
            "numbers of components, or the width of the code"
        );
    }

    /// Calls the function on numbers.
    ///
    /// # Panics
    /// When a size is wrong, or the code is for pairs.
    #[inline]
    pub(crate) fn call(&self, vectors: &mut Vectors<'_, f64>) {
        self.check(Width::One, vectors);
        let Vectors { params, prepared, t, state, argument, out, scalars } = vectors;
        (self.entry)(
            state.as_ptr(),
            out.as_mut_ptr(),
            prepared.as_ptr(),
            self.constants.as_ptr().cast(),
            params.as_ptr(),
            &raw const *t,
            argument.as_ptr(),
            scalars.as_mut_ptr(),
        );
    }

    /// Calls the function on lanes, two and two.
    ///
    /// # Panics
    /// When a size is wrong, or the code is for single numbers or other lanes.
    #[inline]
    pub(crate) fn call_on_lanes<L: Wide>(&self, vectors: &mut Vectors<'_, L>) {
        self.check(Width::PairOf(L::WIDTH), vectors);
        let Vectors { params, prepared, t, state, argument, out, scalars } = vectors;
        for lane in (0..L::WIDTH).step_by(2) {
            // Vectors without components have no lanes to go to; nothing is read there or written.
            let at = |vector: *const L| vector.cast::<f64>().wrapping_add(lane);
            let at_mut = |vector: *mut L| vector.cast::<f64>().wrapping_add(lane);
            (self.entry)(
                at(state.as_ptr()),
                at_mut(out.as_mut_ptr()),
                at(prepared.as_ptr()),
                self.constants.as_ptr().cast(),
                at(params.as_ptr()),
                at(&raw const *t),
                at(argument.as_ptr()),
                at_mut(scalars.as_mut_ptr()),
            );
        }
    }
}

/// A function as machine code on lanes at once, a register after the other.
pub(crate) struct WideCode {
    entry: WideEntry,
    constants: Vec<Spread>,
    sizes: Sizes,
    form: Form,
    has_tables: bool,
    _memory: Memory,
}

impl fmt::Debug for WideCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("WideCode")
            .field("sizes", &self.sizes)
            .field("form", &self.form)
            .finish_non_exhaustive()
    }
}

/// Bytes as code that can be called, as long as its memory is there.
fn runnable(isa: &OwnedTargetIsa, function: &Function, code: &[u8]) -> Result<(*const u8, Memory), Error> {
    let mut module = JITModule::new(JITBuilder::with_isa(isa.clone(), default_libcall_names()));
    let signature = module.make_signature();
    let declared = module.declare_function(function.role.name(), Linkage::Local, &signature);
    let id = declared.map_err(Error::cranelift)?;
    module.define_function_bytes(id, 16, code, &[]).map_err(Error::cranelift)?;
    module.finalize_definitions().map_err(Error::cranelift)?;
    Ok((module.get_finalized_function(id), Memory(ManuallyDrop::new(module))))
}

impl WideCode {
    /// Compiles a function of a verified program for registers that the processor has, unless the function has
    /// operations that there is no such code for.
    pub(crate) fn compile(
        isa: &OwnedTargetIsa,
        program: &Program,
        function: &Function,
        form: Form,
    ) -> Result<Option<WideCode>, Error> {
        let Some(avx::Emitted { code, constants }) = avx::emit(function, program, form) else {
            return Ok(None);
        };
        let (address, memory) = runnable(isa, function, &code)?;
        // SAFETY: the code at this address takes eight pointers and returns a number in the calling convention of
        // x86-64 but on Windows, where there is no form; it is `extern "C"` there.
        #[allow(unsafe_code)]
        let entry = unsafe { std::mem::transmute::<*const u8, WideEntry>(address) };
        let sizes = Sizes::of(program, function);
        let has_tables = !function.contractions.is_empty();
        Ok(Some(WideCode { entry, constants, sizes, form, has_tables, _memory: memory }))
    }

    /// Whether tables are to be run through after the code.
    #[inline]
    pub(crate) fn has_tables(&self) -> bool {
        self.has_tables
    }

    /// Calls the function on lanes, with its results and its scalars behind the point; false where it has given up, and
    /// what it has written is of no account.
    ///
    /// # Panics
    /// When a size is wrong, or the code is for other lanes.
    #[inline]
    pub(crate) fn call<L: Wide>(
        &self,
        params: &[L],
        prepared: &[L],
        point: &Point<'_, L>,
        (out, scalars): (&mut [L], &mut [L]),
    ) -> bool {
        let Point { t, state, argument } = point;
        let sizes = Sizes {
            params: params.len(),
            prepared: prepared.len(),
            state: state.len(),
            argument: argument.len(),
            out: out.len(),
            scalars: scalars.len(),
        };
        assert!(self.sizes == sizes && self.form.lanes == L::WIDTH, "numbers of components, or of lanes");
        self.form.starts().all(|lane| {
            // Vectors without components have no lanes to go to; nothing is read there or written.
            let at = |vector: *const L| vector.cast::<f64>().wrapping_add(lane);
            let at_mut = |vector: *mut L| vector.cast::<f64>().wrapping_add(lane);
            let given_up = (self.entry)(
                at(state.as_ptr()),
                at_mut(out.as_mut_ptr()),
                at(prepared.as_ptr()),
                self.constants.as_ptr().cast(),
                at(params.as_ptr()),
                at(&raw const *t),
                at(argument.as_ptr()),
                at_mut(scalars.as_mut_ptr()),
            );
            given_up == 0
        })
    }
}

/// The same for a row of the midpoint rule around a function, whose last argument is a number.
type RowEntry = extern "C" fn(
    *const f64,
    *mut f64,
    *const f64,
    *const f64,
    *const f64,
    *mut f64,
    *const f64,
    usize,
) -> u32;

/// Rows of the midpoint rule around a right-hand side as machine code on lanes at once, a register after the other.
pub(crate) struct RowsCode {
    one: Loop,
    /// Two rows at once, where that takes less time.
    two: Option<Loop>,
    sizes: Sizes,
    form: Form,
}

/// A loop around one or two rows.
struct Loop {
    entry: RowEntry,
    constants: Vec<Spread>,
    _memory: Memory,
}

impl fmt::Debug for RowsCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RowsCode")
            .field("sizes", &self.sizes)
            .field("form", &self.form)
            .finish_non_exhaustive()
    }
}

/// What rows read: parameters, prepared numbers, the state and its derivative; times, which the code moves on, and
/// sizes of substeps.
struct Reading<'a, L> {
    params: &'a [L],
    prepared: &'a [L],
    start: (&'a [L], &'a [L]),
    times: [L; 3 * avx::MOST_ROWS],
}

impl Loop {
    fn compile(
        isa: &OwnedTargetIsa,
        program: &Program,
        function: &Function,
        form: Form,
        n_rows: usize,
    ) -> Result<Option<Loop>, Error> {
        let Some(avx::Emitted { code, constants }) = avx::emit_rows(function, program, form, n_rows) else {
            return Ok(None);
        };
        let (address, memory) = runnable(isa, function, &code)?;
        // SAFETY: as in `WideCode::compile`; the last argument is a number in the place of a pointer, and the code
        // writes the time.
        #[allow(unsafe_code)]
        let entry = unsafe { std::mem::transmute::<*const u8, RowEntry>(address) };
        Ok(Some(Loop { entry, constants, _memory: memory }))
    }

    /// Runs the loop `n` times on increments whose number has been compared; whether it has not given up.
    #[inline]
    fn run<L: Wide>(&self, form: Form, reading: &mut Reading<'_, L>, n: usize, increments: &mut [L]) -> bool {
        form.starts().all(|lane| {
            let at = |vector: *const L| vector.cast::<f64>().wrapping_add(lane);
            let at_mut = |vector: *mut L| vector.cast::<f64>().wrapping_add(lane);
            let given_up = (self.entry)(
                at(reading.start.0.as_ptr()),
                at_mut(increments.as_mut_ptr()),
                at(reading.prepared.as_ptr()),
                self.constants.as_ptr().cast(),
                at(reading.params.as_ptr()),
                at_mut(reading.times.as_mut_ptr()),
                at(reading.start.1.as_ptr()),
                n,
            );
            given_up == 0
        })
    }
}

impl RowsCode {
    /// Compiles rows around a function of a verified program for registers that the processor has, unless
    /// [`avx::emit_rows`] has none.
    pub(crate) fn compile(
        isa: &OwnedTargetIsa,
        program: &Program,
        function: &Function,
        form: Form,
    ) -> Result<Option<RowsCode>, Error> {
        let Some(one) = Loop::compile(isa, program, function, form, 1)? else { return Ok(None) };
        let two = Loop::compile(isa, program, function, form, 2)?;
        Ok(Some(RowsCode { one, two, sizes: Sizes::of(program, function), form }))
    }

    /// Runs rows, the longest first; false where one has given up, and the increments are of no account.
    ///
    /// # Panics
    /// When a size is wrong, or the code is for other lanes.
    #[inline]
    pub(crate) fn run<L: Wide>(
        &self,
        (params, prepared): (&[L], &[L]),
        (t, h): (L, L),
        (start, slope): (&[L], &[L]),
        increments: &mut [L],
    ) -> bool {
        let Sizes { params: n_params, prepared: n_prepared, state: n, argument: _, out, scalars: _ } =
            self.sizes;
        assert!(
            n_params == params.len()
                && n_prepared == prepared.len()
                && n == start.len()
                && n == slope.len()
                && n == out
                && n > 0
                && increments.len().is_multiple_of(2 * n)
                && self.form.lanes == L::WIDTH,
            "numbers of components, or of lanes"
        );
        let mut reading =
            Reading { params, prepared, start: (start, slope), times: [L::ZERO; 3 * avx::MOST_ROWS] };
        let mut left = increments.len() / (2 * n);
        let mut rest = increments;
        while left > 0 {
            let (code, n_rows) = match &self.two {
                Some(two) if left > 1 => (two, 2),
                _ => (&self.one, 1),
            };
            let (rows, others) = rest.split_at_mut(2 * n * n_rows);
            rest = others;
            for row in 0..n_rows {
                let eta = h * L::from_f64(1.0 / (2 * (left - row)) as f64);
                let size = avx::size_of_row(row);
                (reading.times[row], reading.times[size], reading.times[size + 1]) =
                    (t + eta, eta, eta + eta);
            }
            left -= n_rows;
            // As many as the shorter row has pairs of substeps.
            if !code.run(self.form, &mut reading, left + 1, rows) {
                return false;
            }
        }
        true
    }
}
