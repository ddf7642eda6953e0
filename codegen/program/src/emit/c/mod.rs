//! The C back end: a header and a source of C99 for one scene, and what others want besides.
//!
//! `notation` spells expressions, `text` has small pieces, `kernel` what expressions call, `writer`
//! what all items share. `data` writes structures, names and numbers, `functions` what is computed at a point, `step` a
//! step in time, `single` all of it in single precision, `loops`
//! sums over tables, `inputs` what moves a system from outside, `guards` what says where the equations end, `events`
//! what events do; `cpp` the header for C++, `casadi` the source for CasADi, `fmu` what an FMU has besides, with
//! `trace` (derivatives along a direction) and `dependence` (what a result is computed from). Deliberately does not
//! know: which functions there are and why, the order of their statements.

mod casadi;
mod cpp;
mod data;
mod dependence;
mod events;
mod fmu;
mod functions;
mod guards;
mod inputs;
mod kernel;

mod loops;
mod notation;
mod single;
mod step;
mod text;
mod trace;
mod writer;

pub use fmu::Fmu;
pub use single::Precision;

use self::notation::C;
use self::writer::Writer;
use super::module::Module;
use super::text::SceneText;
use crate::program::Program;
use hamel_expr::error::Error;

/// The C of a scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CModule {
    /// What all names begin with, such as `heavy_top_lagrange`; also the name of the files.
    pub prefix: String,
    /// The text of the header.
    pub header: String,
    /// The text of the source.
    pub source: String,
    /// The text of a header for C++ over that of C.
    pub cpp: String,
    /// The text of a further source with the right-hand side for CasADi.
    pub casadi: String,
}

/// The C of a scene as text.
pub(super) fn emit(program: &Program, text: &SceneText, precision: Precision) -> Result<CModule, Error> {
    let module = Module::new(&C, program, None, text)?;
    let mut writer = written(&module)?;
    writer.precision = precision;
    let made = writer.finish();
    Ok(match precision {
        Precision::Double => made,
        Precision::Single => CModule {
            header: single::text(&made.header)?,
            source: single::text(&made.source)?,
            cpp: single::text(&made.cpp)?,
            ..made
        },
    })
}

/// The C of a scene, and what an FMU has besides.
pub(super) fn emit_fmu(program: &Program, text: &SceneText) -> Result<(CModule, Fmu), Error> {
    let module = Module::new(&C, program, None, text)?;
    let writer = written(&module)?;
    let fmu = writer.fmu()?;
    Ok((writer.finish(), fmu))
}

/// Everything that a module has, written.
fn written<'a>(module: &'a Module<'a>) -> Result<Writer<'a>, Error> {
    let mut writer = Writer::new(module);
    writer.structures();
    writer.names();
    writer.prepare();
    writer.tables();
    writer.functions();
    writer.matrices()?;
    writer.implicit()?;
    writer.discrete();
    writer.quotient();
    writer.pivots();
    writer.domain();
    writer.step();
    writer.events()?;
    writer.messages();
    Ok(writer)
}

impl Writer<'_> {
    /// The texts.
    fn finish(self) -> CModule {
        let (first, cpp, casadi) = (self.first_line(), self.cpp(), self.casadi());
        let Writer { prefix, upper, header, source, precision, .. } = self;
        let guard = format!("{upper}_H");
        let header = format!(
            "{first}#ifndef {guard}\n#define {guard}\n\n#ifdef __cplusplus\nextern \"C\" {{\n#endif\n\n\
             {header}#ifdef __cplusplus\n}}\n#endif\n\n#endif\n"
        );
        let needed = kernel::functions(&source, precision);
        let space = if needed.is_empty() { "" } else { "\n" };
        let source = format!(
            "{first}#include \"{prefix}.h\"\n\n#include <math.h>\n#include <stdint.h>\n#include <string.h>\n\n\
             /* Every operation is rounded as it stands. GCC does so with -std=c99 or -ffp-contract=off. */\n\
             #if !defined(__GNUC__) || defined(__clang__)\n#pragma STDC FP_CONTRACT OFF\n#endif\n\n\
             {needed}{space}{}\n",
            source.trim_end()
        );
        CModule { prefix, header, source, cpp, casadi }
    }
}
