//! The module of a fluid that is moved as products of matrices: its initial state and what is asked of it, in terms of
//! the runtime's matrices. Its size does not depend on theirs.
//!
//! Does not know: programs, how matrices are multiplied.

use std::fmt::Write as _;

use super::format::{format_module, header, parse, runtime_path};
use crate::emit::text::{FluidTermText, FluidText, SurfaceText};
use hamel_expr::error::Error;

/// The text of the module.
pub(in crate::emit) fn emit(text: &FluidText) -> Result<String, Error> {
    let runtime = runtime_path(&text.runtime)?.to_string().replace(' ', "");
    let code = Writer::new(text, &runtime).code();
    Ok(header(&text.command, None) + &format_module(parse(&code)?)?)
}

/// What the items of a module are made of.
struct Writer<'a> {
    text: &'a FluidText,
    runtime: &'a str,
    matrices: String,
    /// Name of the surface, and the type of the numbers of its waves.
    surface: &'static str,
    index: &'static str,
    /// Functions of the surface that add to a mode and read it.
    add: &'static str,
    read: &'static str,
    /// The type of the solver, and how its fluid is reached from it.
    solver: String,
    inner: &'static str,
    inner_mut: &'static str,
    is_damped: bool,
}

/// What the types of a solver have to be.
const ROOM: &str = "T: AsRef<[f64]> + AsMut<[f64]>, S: AsRef<[f64]> + AsMut<[f64]>";

fn list(items: impl Iterator<Item = String>) -> String {
    items.collect::<Vec<_>>().join(", ")
}

/// Waves with the parts that are meant of them.
fn waves<'a>(terms: impl Iterator<Item = &'a FluidTermText>) -> String {
    list(terms.map(|m| format!("(({}, {}), {})", m.wave.0, m.wave.1, usize::from(m.is_second))))
}

impl<'a> Writer<'a> {
    fn new(text: &'a FluidText, runtime: &'a str) -> Writer<'a> {
        let matrices = format!("{runtime}::matrices");
        let (surface, index, add, read) = match text.surface {
            SurfaceText::Torus => ("Torus", "isize", "add_mode", "mode"),
            SurfaceText::Sphere => ("Sphere", "usize", "add_real_mode", "real_mode"),
        };
        let is_damped = !text.friction.is_empty() || !text.force.is_empty();
        let name = if is_damped { "Damped" } else { "IsospectralMidpoint" };
        let solver = format!("{matrices}::{name}<'_, {matrices}::{surface}<T>, S>");
        let (inner, inner_mut) = if is_damped { (".fluid()", ".fluid_mut()") } else { ("", "") };
        Writer { text, runtime, matrices, surface, index, add, read, solver, inner, inner_mut, is_damped }
    }

    fn code(&self) -> String {
        let mut code = self.constants();
        code += &self.surface_fn();
        code += &self.fluid_fn();
        code += &self.questions();
        code
    }

    /// Numbers of the model.
    fn constants(&self) -> String {
        let Writer { text, matrices, index, .. } = self;
        let n_modes = text.modes.len();
        let wave_doc = match text.surface {
            SurfaceText::Torus => {
                "A wave vector, and whether its real (0) or its imaginary part (1) is meant."
            }
            SurfaceText::Sphere => {
                "Degree and order of a mode, and whether that of the cosine (0) or the sine (1) is meant."
            }
        };
        let mut code = format!(
            "/// Size of the matrices.\n\
             pub const N: usize = {};\n\
             /// {wave_doc}\n\
             pub type Wave = (({index}, {index}), usize);\n",
            text.n
        );
        if !text.params.is_empty() {
            let _ = write!(
                code,
                "/// Parameters of the model, with the values that the numbers of this module belong to.\n\
                 pub const PARAMS: [(&str, f64); {}] = [{}];\n",
                text.params.len(),
                list(text.params.iter().map(|(name, value)| format!("({name:?}, {value:?})"))),
            );
        }
        if let Some([scale, shift]) = text.stream {
            let _ = write!(
                code,
                "/// The stream function of the vorticity.\n\
                 pub const STREAM: {matrices}::Stream = \
                 {matrices}::Stream::ideal().with_scale({scale:?}).with_shift({shift:?});\n"
            );
        }
        for (name, doc, terms) in [
            ("BACKGROUND", "The constant part of the stream function.", &text.background),
            ("FORCE", "Rates of the vorticity by the force.", &text.force),
        ] {
            if !terms.is_empty() {
                let values = terms.iter().map(|m| {
                    let (a, b) = m.wave;
                    format!("((({a}, {b}), {}), {:?})", usize::from(m.is_second), m.value)
                });
                let _ = write!(
                    code,
                    "/// {doc}\npub const {name}: [(Wave, f64); {}] = [{}];\n",
                    terms.len(),
                    list(values)
                );
            }
        }
        if !text.friction.is_empty() {
            let terms = text.friction.iter().enumerate().filter(|(_, c)| **c != 0.0);
            let terms = terms.fold(String::new(), |terms, (k, c)| terms + &format!(".with({k}, {c:?})"));
            let _ = write!(
                code,
                "/// The friction.\npub const FRICTION: {matrices}::Friction = {matrices}::Friction::none(){terms};\n"
            );
        }
        let _ = write!(
            code,
            "/// Modes that the model gives, of {vorticity}.\n\
             pub const MODES: [&str; {n_modes}] = [{names}];\n\
             /// Their values at time zero; all others begin with zero.\n\
             pub const INITIAL: [f64; {n_modes}] = [{initial}];\n\
             /// Their waves.\n\
             pub const WAVES: [Wave; {n_modes}] = [{waves}];\n",
            vorticity = lower(&text.vorticity),
            names = list(text.modes.iter().map(|(name, _)| format!("{name:?}"))),
            initial = list(text.modes.iter().map(|(_, mode)| format!("{:?}", mode.value))),
            waves = waves(text.modes.iter().map(|(_, mode)| mode)),
        );
        code
    }

    fn surface_fn(&self) -> String {
        let Writer { text, runtime, matrices, surface, .. } = self;
        let call = if text.stream.is_some() { "with_stream(N, STREAM, tables)" } else { "new(N, tables)" };
        format!(
            "/// What the fluid flows on; `tables` have room for [`storage`]({matrices}::{surface}::storage) of [`N`].\n\
             ///\n\
             /// # Errors\n\
             ///\n\
             /// Tables without that room.\n\
             pub fn surface<T: AsRef<[f64]> + AsMut<[f64]>>(tables: T) -> \
             ::core::result::Result<{matrices}::{surface}<T>, {runtime}::Error> {{\n\
                 {matrices}::{surface}::{call}\n\
             }}\n"
        )
    }

    /// The fluid at time zero.
    fn fluid_fn(&self) -> String {
        let Writer { text, runtime, matrices, surface, solver, inner_mut, add, .. } = self;
        let mut code = String::new();
        for line in documentation(text) {
            let _ = writeln!(code, "/// {line}");
        }
        let has_background = !text.background.is_empty();
        let mut room = format!("[`storage`]({matrices}::IsospectralMidpoint::storage)");
        if has_background {
            room += " of `options.with_background()`";
        }
        let of_friction = match self.is_damped {
            true => format!(", `room` for [`storage`]({matrices}::Damped::storage)"),
            false => String::new(),
        };
        let argument = if self.is_damped { "room: S, " } else { "" };
        let _ = write!(
            code,
            "///\n\
             /// The fluid at time zero; `storage` has room for {room}{of_friction}.\n\
             ///\n\
             /// # Errors\n\
             ///\n\
             /// Storage without that room, and options that are none.\n\
             pub fn fluid<T, S>(surface: &{matrices}::{surface}<T>, storage: S, {argument}options: {matrices}::Options) -> \
             ::core::result::Result<{solver}, {runtime}::Error> where {ROOM} {{\n"
        );
        let options = if has_background { "options.with_background()" } else { "options" };
        let _ = writeln!(
            code,
            "let mut fluid = {matrices}::IsospectralMidpoint::new(surface, storage, 0.0, {options})?;"
        );
        let each = |constant: &str, matrix: &str| {
            format!(
                "for ((wave, part), value) in {constant} {{\n\
                     let mut mode = [0.0; 2];\n\
                     mode[part] = value;\n\
                     surface.{add}(wave, mode, {matrix});\n\
                 }}\n"
            )
        };
        if has_background {
            code += &each("BACKGROUND", "fluid.background_mut()");
        }
        if self.is_damped {
            let friction = match text.friction.is_empty() {
                true => format!("{matrices}::Friction::none()"),
                false => "FRICTION".to_owned(),
            };
            let _ = writeln!(code, "let mut fluid = {matrices}::Damped::new(fluid, {friction}, room)?;");
        }
        if !text.force.is_empty() {
            code += &each("FORCE", "fluid.force_mut()");
        }
        code += &each("WAVES.into_iter().zip(INITIAL)", &format!("fluid{inner_mut}.vorticity_mut()"));
        code += "::core::result::Result::Ok(fluid)\n}\n";
        code
    }

    /// Functions of the fluid.
    fn questions(&self) -> String {
        let Writer { text, solver, inner, inner_mut, read, .. } = self;
        let n_modes = text.modes.len();
        let energy = match text.surface {
            SurfaceText::Torus => format!("fluid{inner_mut}.energy()"),
            // The mean over the sphere of what the runtime integrates.
            SurfaceText::Sphere => format!("fluid{inner_mut}.energy() / (4.0 * ::core::f64::consts::PI)"),
        };
        let mut code = format!(
            "/// The modes [`MODES`] of the fluid.\n\
             pub fn modes<T, S>(fluid: &{solver}) -> [f64; {n_modes}] where {ROOM} {{\n\
                 WAVES.map(|(wave, part)| fluid{inner}.surface().{read}(wave, fluid{inner}.vorticity())[part])\n\
             }}\n\
             /// The energy, that of the model's hamiltonian.\n\
             pub fn energy<T, S>(fluid: &mut {solver}) -> f64 where {ROOM} {{ {energy} }}\n"
        );
        let n_casimirs = text.casimirs.len();
        if let Some(largest) = text.casimirs.iter().map(|(_, power)| *power).max() {
            let names = list(text.casimirs.iter().map(|(name, _)| format!("{name:?}")));
            let traces = list(text.casimirs.iter().map(|(_, power)| format!("traces[{}]", power - 1)));
            let kept =
                if self.is_damped { "friction and force alone change" } else { "steps keep to round-off" };
            let _ = write!(
                code,
                "/// Casimirs of the model, traces of powers of the vorticity by `N`.\n\
                 pub const CASIMIRS: [&str; {n_casimirs}] = [{names}];\n\
                 /// The Casimirs [`CASIMIRS`] of the fluid, which {kept}.\n\
                 pub fn casimirs<T, S>(fluid: &mut {solver}) -> [f64; {n_casimirs}] where {ROOM} {{\n\
                     let mut traces = [0.0; {largest}];\n\
                     fluid{inner_mut}.casimirs(&mut traces);\n\
                     [{traces}]\n\
                 }}\n"
            );
        }
        code
    }
}

/// The documentation of the model as lines of text.
fn documentation(text: &FluidText) -> Vec<String> {
    let mut lines: Vec<String> =
        text.doc.iter().flat_map(|d| d.lines()).map(|l| l.trim().to_owned()).collect();
    if lines.is_empty() {
        lines.push(format!("The model `{}`.", text.model));
    }
    if !text.sources.is_empty() {
        lines.extend([String::new(), "# Source".to_owned(), String::new()]);
        lines.extend(text.sources.iter().cloned());
    }
    lines
}

/// What the vorticity is, within a sentence.
fn lower(doc: &str) -> String {
    let line = doc.lines().next().unwrap_or_default().trim().trim_end_matches('.');
    let mut chars = line.chars();
    match chars.next() {
        Some(first) => first.to_lowercase().chain(chars).collect(),
        None => "the vorticity".to_owned(),
    }
}
