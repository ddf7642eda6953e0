//! The module of a fluid that is moved as products of matrices: its initial state and what is asked of it, in terms of
//! the runtime's matrices. Its size does not depend on theirs.
//!
//! Does not know: programs, how matrices are multiplied.

use std::fmt::Write as _;

use super::format::{format_module, header, parse, runtime_path};
use crate::emit::text::{FluidTermText, FluidText, SurfaceText, TraceText};
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

/// A wave with the part that is meant of it.
fn wave(term: &FluidTermText) -> String {
    format!("(({}, {}), {})", term.wave.0, term.wave.1, usize::from(term.is_second))
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
                let values = terms.iter().map(|m| format!("({}, {:?})", wave(m), m.value));
                let _ = write!(
                    code,
                    "/// {doc}\npub const {name}: [(Wave, f64); {}] = [{}];\n",
                    terms.len(),
                    list(values)
                );
            }
        }
        code += &self.carried();
        if !text.friction.is_empty() {
            let terms = with(&text.friction);
            let _ = write!(
                code,
                "/// The friction.\npub const FRICTION: {matrices}::Friction = {matrices}::Friction::none(){terms};\n"
            );
        }
        let of_fields = if text.carried.is_empty() { "" } else { " and the fields that it carries" };
        let _ = write!(
            code,
            "/// Modes that the model gives, of {vorticity}{of_fields}.\n\
             pub const MODES: [&str; {n_modes}] = [{names}];\n\
             /// Their values at time zero; all others begin with zero.\n\
             pub const INITIAL: [f64; {n_modes}] = [{initial}];\n\
             /// Their waves.\n\
             pub const WAVES: [Wave; {n_modes}] = [{waves}];\n",
            vorticity = lower(&text.vorticity),
            names = list(text.modes.iter().map(|mode| format!("{:?}", mode.name))),
            initial = list(text.modes.iter().map(|mode| format!("{:?}", mode.term.value))),
            waves = list(text.modes.iter().map(|mode| wave(&mode.term))),
        );
        if !text.carried.is_empty() {
            let fields = list(text.modes.iter().map(|mode| option(mode.field)));
            let _ = write!(
                code,
                "/// The carried field of each, without one the vorticity.\n\
                 pub const FIELDS: [::core::option::Option<usize>; {n_modes}] = [{fields}];\n",
            );
        }
        code
    }

    /// Numbers of the fields that the flow carries.
    fn carried(&self) -> String {
        let Writer { text, matrices, .. } = self;
        let n_fields = text.carried.len();
        if n_fields == 0 {
            return String::new();
        }
        let names = list(text.carried.iter().map(|field| format!("{:?}", field.name)));
        let currents = list(text.carried.iter().map(|field| match &field.current {
            Some(c) => format!("::core::option::Option::Some({matrices}::Current::none(){})", with(c)),
            None => "::core::option::Option::None".to_owned(),
        }));
        let mut code = format!(
            "/// Fields that the flow carries.\n\
             pub const CARRIED: [&str; {n_fields}] = [{names}];\n\
             /// The currents of fields that have an energy.\n\
             pub const CURRENTS: [::core::option::Option<{matrices}::Current>; {n_fields}] = [{currents}];\n"
        );
        let of_fields = text.carried.iter().enumerate();
        let constants: Vec<String> = of_fields
            .flat_map(|(k, field)| {
                field.constant.iter().map(move |m| format!("({k}, {}, {:?})", wave(m), m.value))
            })
            .collect();
        if !constants.is_empty() {
            let _ = write!(
                code,
                "/// Constant parts of currents, by the number of the field.\n\
                 pub const CONSTANT_CURRENTS: [(usize, Wave, f64); {}] = [{}];\n",
                constants.len(),
                constants.join(", "),
            );
        }
        code
    }

    /// Calls that make room in the options.
    fn options(&self) -> String {
        let text = self.text;
        let has_constants = text.carried.iter().any(|field| !field.constant.is_empty());
        let mut options = "options".to_owned();
        if !text.carried.is_empty() {
            let _ = write!(options, ".with_carried({})", text.carried.len());
        }
        if !text.background.is_empty() || has_constants {
            options += ".with_background()";
        }
        options
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
        let options = self.options();
        let mut room = format!("[`storage`]({matrices}::IsospectralMidpoint::storage)");
        if options != "options" {
            let _ = write!(room, " of `{options}`");
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
        if !text.background.is_empty() {
            code += &each("BACKGROUND", "fluid.background_mut()");
        }
        if text.carried.iter().any(|field| field.current.is_some()) {
            code += "for (k, current) in CURRENTS.into_iter().enumerate() {\n\
                         if let ::core::option::Option::Some(current) = current {\n\
                             fluid.set_current(k, current)?;\n\
                         }\n\
                     }\n";
        }
        if text.carried.iter().any(|field| !field.constant.is_empty()) {
            let _ = write!(
                code,
                "for (k, (wave, part), value) in CONSTANT_CURRENTS {{\n\
                     let mut mode = [0.0; 2];\n\
                     mode[part] = value;\n\
                     surface.{add}(wave, mode, fluid.constant_current_mut(k));\n\
                 }}\n"
            );
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
        if text.carried.is_empty() {
            code += &each("WAVES.into_iter().zip(INITIAL)", &format!("fluid{inner_mut}.vorticity_mut()"));
        } else {
            let _ = write!(
                code,
                "for (((wave, part), field), value) in WAVES.into_iter().zip(FIELDS).zip(INITIAL) {{\n\
                     let mut mode = [0.0; 2];\n\
                     mode[part] = value;\n\
                     let matrix = match field {{\n\
                         ::core::option::Option::Some(k) => fluid{inner_mut}.carried_mut(k),\n\
                         ::core::option::Option::None => fluid{inner_mut}.vorticity_mut(),\n\
                     }};\n\
                     surface.{add}(wave, mode, matrix);\n\
                 }}\n"
            );
        }
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
        let modes = match text.carried.is_empty() {
            true => {
                format!(
                    "WAVES.map(|(wave, part)| fluid{inner}.surface().{read}(wave, fluid{inner}.vorticity())[part])"
                )
            }
            false => format!(
                "::core::array::from_fn(|k| {{\n\
                     let (wave, part) = WAVES[k];\n\
                     let matrix = match FIELDS[k] {{\n\
                         ::core::option::Option::Some(field) => fluid{inner}.carried(field),\n\
                         ::core::option::Option::None => fluid{inner}.vorticity(),\n\
                     }};\n\
                     fluid{inner}.surface().{read}(wave, matrix)[part]\n\
                 }})"
            ),
        };
        let mut code = format!(
            "/// The modes [`MODES`] of the fluid.\n\
             pub fn modes<T, S>(fluid: &{solver}) -> [f64; {n_modes}] where {ROOM} {{\n\
                 {modes}\n\
             }}\n\
             /// The energy, that of the model's hamiltonian.\n\
             pub fn energy<T, S>(fluid: &mut {solver}) -> f64 where {ROOM} {{ {energy} }}\n"
        );
        code += &self.casimirs();
        code
    }

    /// Casimirs, where there are any.
    fn casimirs(&self) -> String {
        let Writer { text, solver, inner_mut, .. } = self;
        let n_casimirs = text.casimirs.len();
        if n_casimirs == 0 {
            return String::new();
        }
        let names = list(text.casimirs.iter().map(|(name, _)| format!("{name:?}")));
        let (kept, of) = match (self.is_damped, text.carried.is_empty()) {
            (true, true) => ("friction and force alone change", "traces of powers of the vorticity by `N`"),
            (false, true) => ("steps keep to round-off", "traces of powers of the vorticity by `N`"),
            (true, false) => {
                ("the ideal fluid keeps if they are Casimirs", "traces of products of matrices by `N`")
            }
            (false, false) => {
                ("steps keep to round-off if they are Casimirs", "traces of products of matrices by `N`")
            }
        };
        // Traces of powers of one field, or of their products with the vorticity, are computed at once.
        let mut lines = String::new();
        let mut families: Vec<(Option<usize>, bool)> = Vec::new();
        for (_, trace) in &text.casimirs {
            let family = (trace.field, trace.is_cross);
            if families.contains(&family) {
                continue;
            }
            families.push(family);
            let all = text.casimirs.iter().map(|(_, trace)| trace);
            let of_family = all.filter(|trace| (trace.field, trace.is_cross) == family);
            let largest = of_family.map(|trace| trace.power).max().unwrap_or(0);
            let variable = variable(trace);
            let call = match family {
                (None, _) => "casimirs(".to_owned(),
                (Some(k), false) => format!("carried_casimirs({k}, "),
                (Some(k), true) => format!("cross_casimirs({k}, "),
            };
            let _ = write!(
                lines,
                "let mut {variable} = [0.0; {largest}];\nfluid{inner_mut}.{call}&mut {variable});\n"
            );
        }
        let traces = list(text.casimirs.iter().map(|(_, trace)| {
            let value = format!("{}[{}]", variable(trace), trace.power - 1);
            if trace.factor == 1.0 { value } else { format!("{:?} * {value}", trace.factor) }
        }));
        format!(
            "/// Casimirs of the model, {of}.\n\
             pub const CASIMIRS: [&str; {n_casimirs}] = [{names}];\n\
             /// The Casimirs [`CASIMIRS`] of the fluid, which {kept}.\n\
             pub fn casimirs<T, S>(fluid: &mut {solver}) -> [f64; {n_casimirs}] where {ROOM} {{\n\
                 {lines}[{traces}]\n\
             }}\n"
        )
    }
}

/// The variable of the traces of a family.
fn variable(trace: &TraceText) -> String {
    match (trace.field, trace.is_cross) {
        (None, _) => "traces".to_owned(),
        (Some(k), false) => format!("traces_{k}"),
        (Some(k), true) => format!("crosses_{k}"),
    }
}

/// Calls that set coefficients which do not vanish.
fn with(coefficients: &[f64]) -> String {
    let terms = coefficients.iter().enumerate().filter(|(_, c)| **c != 0.0);
    terms.fold(String::new(), |terms, (k, c)| terms + &format!(".with({k}, {c:?})"))
}

/// A number as an option.
fn option(number: Option<usize>) -> String {
    match number {
        Some(k) => format!("::core::option::Option::Some({k})"),
        None => "::core::option::Option::None".to_owned(),
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
