//! The module of a fluid that is moved as products of matrices: its initial state and what is asked of it, in terms of
//! the runtime's matrices. Its size does not depend on theirs.
//!
//! Does not know: programs, how matrices are multiplied.

use std::fmt::Write as _;

use super::format::{format_module, header, parse, runtime_path};
use crate::emit::text::{FluidText, SurfaceText};
use hamel_expr::error::Error;

/// The text of the module.
pub(in crate::emit) fn emit(text: &FluidText) -> Result<String, Error> {
    let runtime = runtime_path(&text.runtime)?.to_string().replace(' ', "");
    let (surface, index, energy, wave_doc) = match text.surface {
        SurfaceText::Torus => (
            "Torus",
            "isize",
            "fluid.energy()",
            "Wave vector of each mode, and whether it is the real (0) or the imaginary part (1).",
        ),
        SurfaceText::Sphere => (
            "Sphere",
            "usize",
            // The mean over the sphere of what the runtime integrates.
            "fluid.energy() / (4.0 * ::core::f64::consts::PI)",
            "Degree and order of each mode, and whether it is that of the cosine (0) or the sine (1).",
        ),
    };
    let (add, read) = match text.surface {
        SurfaceText::Torus => ("add_mode", "mode"),
        SurfaceText::Sphere => ("add_real_mode", "real_mode"),
    };
    let (n, n_modes) = (text.n, text.modes.len());
    let matrices = format!("{runtime}::matrices");
    let fluid = format!("{matrices}::IsospectralMidpoint<'_, {matrices}::{surface}<T>, S>");
    let room = "T: AsRef<[f64]> + AsMut<[f64]>, S: AsRef<[f64]> + AsMut<[f64]>";
    let list = |items: Vec<String>| items.join(", ");
    let names = list(text.modes.iter().map(|m| format!("{:?}", m.name)).collect());
    let initial = list(text.modes.iter().map(|m| format!("{:?}", m.initial)).collect());
    let waves =
        text.modes.iter().map(|m| format!("(({}, {}), {})", m.wave.0, m.wave.1, usize::from(m.is_second)));
    let waves = list(waves.collect());
    let mut code = format!(
        "/// Size of the matrices.\n\
         pub const N: usize = {n};\n\
         /// Modes that the model gives, of {vorticity}.\n\
         pub const MODES: [&str; {n_modes}] = [{names}];\n\
         /// Their values at time zero; all others begin with zero.\n\
         pub const INITIAL: [f64; {n_modes}] = [{initial}];\n\
         /// {wave_doc}\n\
         pub const WAVES: [(({index}, {index}), usize); {n_modes}] = [{waves}];\n\
         /// What the fluid flows on; `tables` have room for [`storage`]({matrices}::{surface}::storage) of [`N`].\n\
         ///\n\
         /// # Errors\n\
         ///\n\
         /// Tables without that room.\n\
         pub fn surface<T: AsRef<[f64]> + AsMut<[f64]>>(tables: T) -> \
         ::core::result::Result<{matrices}::{surface}<T>, {runtime}::Error> {{\n\
             {matrices}::{surface}::new(N, tables)\n\
         }}\n",
        vorticity = lower(&text.vorticity),
    );
    for line in documentation(text) {
        let _ = writeln!(code, "/// {line}");
    }
    let _ = write!(
        code,
        "///\n\
         /// The fluid at time zero; `storage` has room for [`storage`]({matrices}::IsospectralMidpoint::storage).\n\
         ///\n\
         /// # Errors\n\
         ///\n\
         /// Storage without that room, and options that are none.\n\
         pub fn fluid<T, S>(surface: &{matrices}::{surface}<T>, storage: S, options: {matrices}::Options) -> \
         ::core::result::Result<{fluid}, {runtime}::Error> where {room} {{\n\
             let mut fluid = {matrices}::IsospectralMidpoint::new(surface, storage, 0.0, options)?;\n\
             for ((wave, part), value) in WAVES.into_iter().zip(INITIAL) {{\n\
                 let mut mode = [0.0; 2];\n\
                 mode[part] = value;\n\
                 surface.{add}(wave, mode, fluid.vorticity_mut());\n\
             }}\n\
             ::core::result::Result::Ok(fluid)\n\
         }}\n\
         /// The modes [`MODES`] of the fluid.\n\
         pub fn modes<T, S>(fluid: &{fluid}) -> [f64; {n_modes}] where {room} {{\n\
             WAVES.map(|(wave, part)| fluid.surface().{read}(wave, fluid.vorticity())[part])\n\
         }}\n\
         /// The energy, that of the model's hamiltonian.\n\
         pub fn energy<T, S>(fluid: &mut {fluid}) -> f64 where {room} {{ {energy} }}\n"
    );
    let n_casimirs = text.casimirs.len();
    if let Some(largest) = text.casimirs.iter().map(|(_, power)| *power).max() {
        let names = list(text.casimirs.iter().map(|(name, _)| format!("{name:?}")).collect());
        let traces = list(text.casimirs.iter().map(|(_, power)| format!("traces[{}]", power - 1)).collect());
        let _ = write!(
            code,
            "/// Casimirs of the model, traces of powers of the vorticity by `N`.\n\
             pub const CASIMIRS: [&str; {n_casimirs}] = [{names}];\n\
             /// The Casimirs [`CASIMIRS`] of the fluid, which steps keep to round-off.\n\
             pub fn casimirs<T, S>(fluid: &mut {fluid}) -> [f64; {n_casimirs}] where {room} {{\n\
                 let mut traces = [0.0; {largest}];\n\
                 fluid.casimirs(&mut traces);\n\
                 [{traces}]\n\
             }}\n"
        );
    }
    Ok(header(&text.command, None) + &format_module(parse(&code)?)?)
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
