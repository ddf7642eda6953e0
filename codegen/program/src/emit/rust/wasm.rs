//! The root of a crate for WebAssembly: functions with numbers as arguments, over arrays in the module's own memory.
//!
//! Does not know: what the functions compute, how JavaScript reads memory (`wasm.mjs` does).

use proc_macro2::TokenStream;
use quote::quote;

use super::Writer;
use super::format::{format_file, header};
use super::lines::allow;
use super::tokens::{number, size, wrapped};
use crate::emit::text::ParamText;
use hamel_expr::error::Error;
use hamel_expr::rational_to_f64;

/// The functions of JavaScript that are the same for all scenes.
const SCRIPT: &str = include_str!("wasm.mjs");

impl Writer<'_> {
    /// The root of the crate; `file` is the name of the scene's module beside it.
    pub(super) fn wasm(&self, file: &str) -> Result<String, Error> {
        let (module, rt) = (self.module, &self.runtime);
        let text = module.text;
        let (n, n_params, m) = (size(module.state.len()), size(module.params.len()), size(text.inputs.len()));
        let of = |params: &[ParamText]| params.iter().map(|p| rational_to_f64(&p.default)).collect();
        let (params, inputs): (Vec<f64>, Vec<f64>) = (of(&text.params), of(&text.inputs));
        let initial = text.initial.as_ref().map(|initial| initial.values.clone());
        let initial = initial.unwrap_or_else(|| vec![0.0; module.state.len()]);
        let [params_at, inputs_at, state_at] = [&params, &inputs, &initial].map(|values| {
            let values = values.iter().copied().map(number);
            quote! { [#(AtomicU64::new(f64::to_bits(#values))),*] }
        });
        let allow = allow();
        let doc = self.wasm_documentation();
        // What moves through events that act is not the motion without them.
        let advance = match text.events.is_empty() {
            true => quote! { solver.integrate_to(t_end).map_err(|e| e.to_string()) },
            false => quote! {
                solver
                    .integrate_through_events(t_end, |_| core::ops::ControlFlow::Continue(()))
                    .map(|_| ())
                    .map_err(|e| e.to_string())
            },
        };
        let method = match self.module.positions() {
            None => quote! { Dop853 },
            Some((_, n_functions, ..)) => {
                let k = size(n_functions);
                quote! { #rt::Projected::<_, #k, #rt::OfPositions>::onto_positions(Dop853) }
            }
        };
        let consistent = self.wasm_consistent();
        // A function that is zero at the end of a motion has had its event when the motion goes on from there.
        let [last, is_told, note_end] = match text.events.is_empty() {
            true => [TokenStream::new(), TokenStream::new(), TokenStream::new()],
            false => [
                quote! {
                    /// State and time where `integrate` has ended last.
                    static LAST: [AtomicU64; #n + 1] = [const { AtomicU64::new(u64::MAX) }; #n + 1];
                },
                quote! {
                    let here = load(&STATE).into_iter().chain([t]).map(f64::to_bits);
                    if LAST.iter().map(|last| last.load(Relaxed)).eq(here) {
                        solver = solver.with_events_told();
                    }
                },
                quote! {
                    let end: Vec<f64> = solver.state().iter().copied().chain([solver.t()]).collect();
                    store(&LAST, &end);
                },
            ],
        };
        let energy_of = quote! { system.energy_of(t, &y).into_iter().collect::<Vec<f64>>() };
        let items = quote! {
            #doc

            #![allow(unsafe_code, reason = "a name that the host calls is an unsafe attribute")]

            #[path = #file]
            mod system;

            use std::cell::RefCell;
            use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

            use #rt::{Dop853, Integrator, Options, Scene, System};
            use system::{INFO, Prepared};

            #allow
            static PARAMS: [AtomicU64; #n_params] = #params_at;
            #allow
            static INPUTS: [AtomicU64; #m] = #inputs_at;
            #allow
            static STATE: [AtomicU64; #n] = #state_at;
            static RATES: [AtomicU64; #n] = [const { AtomicU64::new(0) }; #n];
            static ENERGY: [AtomicU64; 1] = [const { AtomicU64::new(0) }; 1];
            static OUTPUTS: [AtomicU64; INFO.n_outputs()] = [const { AtomicU64::new(0) }; INFO.n_outputs()];
            static TIME: [AtomicU64; 1] = [const { AtomicU64::new(0) }; 1];
            #last

            thread_local! {
                static SYSTEM: RefCell<Option<Prepared>> = const { RefCell::new(None) };
                static MESSAGE: RefCell<String> = const { RefCell::new(String::new()) };
            }

            fn load<const N: usize>(memory: &[AtomicU64; N]) -> [f64; N] {
                core::array::from_fn(|k| f64::from_bits(memory[k].load(Relaxed)))
            }

            fn store(memory: &[AtomicU64], values: &[f64]) {
                for (at, value) in memory.iter().zip(values) {
                    at.store(value.to_bits(), Relaxed);
                }
            }

            fn code(done: Result<(), String>) -> i32 {
                match done {
                    Ok(()) => 0,
                    Err(message) => {
                        MESSAGE.replace(message);
                        1
                    }
                }
            }

            fn with_system(run: impl FnOnce(&Prepared) -> Result<(), String>) -> i32 {
                code(SYSTEM.with_borrow_mut(|kept| {
                    let system = match kept {
                        Some(system) => system,
                        None => kept.insert(Prepared::prepare(&load(&PARAMS)).map_err(|e| e.to_string())?),
                    };
                    system.hold_inputs_of(&load(&INPUTS));
                    run(system)
                }))
            }

            /// Address of the parameters.
            #[unsafe(no_mangle)]
            pub extern "C" fn params() -> usize {
                PARAMS.as_ptr() as usize
            }

            /// Number of the parameters.
            #[unsafe(no_mangle)]
            pub extern "C" fn n_params() -> usize {
                PARAMS.len()
            }

            /// Address of the inputs, which every function reads where it is called.
            #[unsafe(no_mangle)]
            pub extern "C" fn inputs() -> usize {
                INPUTS.as_ptr() as usize
            }

            /// Number of the inputs.
            #[unsafe(no_mangle)]
            pub extern "C" fn n_inputs() -> usize {
                INPUTS.len()
            }

            /// Address of the state, which functions read and `integrate` writes.
            #[unsafe(no_mangle)]
            pub extern "C" fn state() -> usize {
                STATE.as_ptr() as usize
            }

            /// Number of the components of the state.
            #[unsafe(no_mangle)]
            pub extern "C" fn n_state() -> usize {
                STATE.len()
            }

            /// Address of the derivative of the state, which `rhs` writes: as many numbers as the state has.
            #[unsafe(no_mangle)]
            pub extern "C" fn rates() -> usize {
                RATES.as_ptr() as usize
            }

            /// Address of the energy, which `evaluate` writes.
            #[unsafe(no_mangle)]
            pub extern "C" fn energy() -> usize {
                ENERGY.as_ptr() as usize
            }

            /// 1 where the scene has an energy, otherwise 0.
            #[unsafe(no_mangle)]
            pub extern "C" fn n_energy() -> usize {
                usize::from(INFO.has_energy)
            }

            /// Address of the outputs, which `evaluate` writes.
            #[unsafe(no_mangle)]
            pub extern "C" fn outputs() -> usize {
                OUTPUTS.as_ptr() as usize
            }

            /// Number of the components of all outputs.
            #[unsafe(no_mangle)]
            pub extern "C" fn n_outputs() -> usize {
                OUTPUTS.len()
            }

            /// Address of the time that `integrate` has reached.
            #[unsafe(no_mangle)]
            pub extern "C" fn time() -> usize {
                TIME.as_ptr() as usize
            }

            /// Address of what went wrong where a function last gave 1: a text in UTF-8.
            #[unsafe(no_mangle)]
            pub extern "C" fn message() -> usize {
                MESSAGE.with_borrow(|message| message.as_ptr() as usize)
            }

            /// Number of bytes of that text.
            #[unsafe(no_mangle)]
            pub extern "C" fn n_message() -> usize {
                MESSAGE.with_borrow(String::len)
            }

            /// Checks the parameters and computes what depends on them alone: to be called after they have changed.
            #[unsafe(no_mangle)]
            pub extern "C" fn prepare() -> i32 {
                SYSTEM.set(None);
                with_system(|_| Ok(()))
            }

            /// Says whether the right-hand side can be evaluated at a time and the state.
            #[unsafe(no_mangle)]
            pub extern "C" fn check(t: f64) -> i32 {
                with_system(|system| {
                    let y = load(&STATE);
                    let domain = System::domain(system, t, &y);
                    domain.and_then(|()| System::check(system, t, &y)).map_err(|e| e.to_string())
                })
            }

            /// Writes the derivative of the state at a time to `rates`.
            #[unsafe(no_mangle)]
            pub extern "C" fn rhs(t: f64) -> i32 {
                with_system(|system| {
                    let mut dy = [0.0; #n];
                    System::rhs(system, t, &load(&STATE), &mut dy);
                    store(&RATES, &dy);
                    Ok(())
                })
            }

            /// Writes energy and outputs at a time and the state.
            #[unsafe(no_mangle)]
            pub extern "C" fn evaluate(t: f64) -> i32 {
                with_system(|system| {
                    let (y, mut out) = (load(&STATE), [0.0; INFO.n_outputs()]);
                    system.outputs_of(t, &y, &mut out);
                    store(&OUTPUTS, &out);
                    store(&ENERGY, &#energy_of);
                    Ok(())
                })
            }

            #consistent

            /// Moves the state from time `t` to `t_end` by the method of Dormand and Prince of order 8(5,3), with
            /// the inputs where they are held and through the events of the model; where it gives 1, `state` and
            /// `time` are where the motion has stopped.
            #[unsafe(no_mangle)]
            pub extern "C" fn integrate(t: f64, t_end: f64, rtol: f64, atol: f64) -> i32 {
                with_system(|system| {
                    store(&TIME, &[t]);
                    let options = Options::adaptive(rtol, atol);
                    let solver = Integrator::new(system, #method, t, load(&STATE), options);
                    let mut solver = solver.map_err(|e| e.to_string())?;
                    #is_told
                    let done = #advance;
                    #note_end
                    store(&STATE, solver.state());
                    store(&TIME, &[solver.t()]);
                    done
                })
            }
        };
        Ok(format!("{}{}", header(&text.command, None), format_file(items)?))
    }

    /// Solves the equations between coordinates, where the scene has them.
    fn wasm_consistent(&self) -> TokenStream {
        if self.module.positions().is_none() {
            return TokenStream::new();
        }
        let rt = &self.runtime;
        quote! {
            /// Moves the coordinates in the state that equations give until they satisfy these at a time; where it
            /// gives 1, the state is as it was.
            #[unsafe(no_mangle)]
            pub extern "C" fn consistent(t: f64) -> i32 {
                with_system(|system| {
                    let mut y = load(&STATE);
                    #rt::consistent(system, t, &mut y).map_err(|e| e.to_string())?;
                    store(&STATE, &y);
                    Ok(())
                })
            }
        }
    }

    /// What the file is, and which number is where.
    fn wasm_documentation(&self) -> TokenStream {
        let text = self.module.text;
        let mut lines = vec![
            format!("`{}`, scene `{}`, for WebAssembly.", text.model, text.scene),
            String::new(),
            "All numbers are doubles in arrays of the module's own memory: a function without arguments has the"
                .to_owned(),
            "address of each. What is called at a time `t` reads parameters, inputs and state there, gives 0, or 1"
                .to_owned(),
            "and a `message`, and then writes nothing but what is said.".to_owned(),
            String::new(),
            "```text".to_owned(),
        ];
        let names = |params: &[ParamText]| params.iter().map(|p| p.name.clone()).collect::<Vec<String>>();
        let state: Vec<String> = text.state.iter().map(|s| s.name.clone()).collect();
        let outputs: Vec<String> = self.output_components().map(str::to_owned).collect();
        let arrays = [
            ("params", names(&text.params)),
            ("inputs", names(&text.inputs)),
            ("state", state),
            ("outputs", outputs),
        ];
        for (array, names) in &arrays {
            lines.extend(wrapped(&format!("{array} = ["), names, "]"));
        }
        lines.push("```".to_owned());
        let lines = lines.iter().map(|line| if line.is_empty() { String::new() } else { format!(" {line}") });
        quote! { #(#![doc = #lines])* }
    }

    /// Names of the components of all outputs in their order.
    fn output_components(&self) -> impl Iterator<Item = &str> {
        self.module.outputs.iter().flat_map(|output| output.text.components.iter().map(String::as_str))
    }

    /// The module of JavaScript: names, then what is the same for all scenes.
    pub(super) fn wasm_script(&self) -> String {
        let text = self.module.text;
        let list = |names: &mut dyn Iterator<Item = &str>| {
            // Names of models are letters, digits and underscores, which Rust and JavaScript quote alike.
            let names: Vec<String> = names.map(|name| format!("{name:?}")).collect();
            format!("[{}]", names.join(", "))
        };
        let params = list(&mut text.params.iter().map(|p| p.name.as_str()));
        let inputs = list(&mut text.inputs.iter().map(|p| p.name.as_str()));
        let state = list(&mut text.state.iter().map(|s| s.name.as_str()));
        let outputs = list(&mut self.output_components());
        format!(
            "{}\n/** Names in the order of the arrays. */\nexport const names = {{\n  params: {params},\n  \
             inputs: {inputs},\n  state: {state},\n  outputs: {outputs},\n}};\n\n{SCRIPT}",
            header(&text.command, None).trim_end(),
        )
    }
}
