//! The C back end: a header and a source of C99 for one scene.
//!
//! `notation` spells expressions, `text` has small pieces, `kernel` what expressions call, `data` writes structures,
//! names and numbers, `functions` what is computed at a point, `loops` sums over tables, `guards` what says where the
//! equations end, `events` what events do, `cpp` the header for C++, `casadi` the source for CasADi,
//! `fmu` what an FMU has besides, with `trace` (derivatives along a direction) and `dependence` (which inputs a result
//! has). Deliberately does not know: which functions there are and why, the order of
//! their statements.

mod casadi;
mod cpp;
mod data;
mod dependence;
mod events;
mod fmu;
mod functions;
mod guards;
mod kernel;
mod loops;
mod notation;
mod text;
mod trace;

pub use fmu::Fmu;

use self::notation::C;
use super::module::Module;
use super::names::{Scope, legal};
use super::text::SceneText;
use crate::error::Error;
use crate::program::Program;

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

/// What a function takes besides what is prepared.
#[derive(Clone, Copy, Debug)]
enum Takes {
    /// Time and state.
    Point,
    /// Time, state and a vector of that length.
    PointAndVector(usize),
    /// Time and that many variables in the place of the state.
    Variables(usize),
    /// A time of its own and the state.
    Flow,
}

/// A function of the module as others call it.
#[derive(Clone, Debug)]
struct Call {
    title: String,
    name: String,
    takes: Takes,
    /// Length of the array that it writes; none where it returns a number.
    n_results: Option<usize>,
}

/// The C of a scene as text.
pub(super) fn emit(program: &Program, text: &SceneText) -> Result<CModule, Error> {
    let module = Module::new(&C, program, None, text)?;
    Ok(written(&module)?.finish())
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
    writer.pivots();
    writer.domain();
    writer.events()?;
    writer.messages();
    Ok(writer)
}

/// What all names of a scene begin with: the model's name, followed by the scene's unless it is the default.
pub(super) fn prefix(model: &str, scene: &str) -> String {
    let name = if scene == "default" { model.to_owned() } else { format!("{model}_{scene}") };
    legal(&[], &name)
}

/// Writes the header and the source side by side.
struct Writer<'a> {
    module: &'a Module<'a>,
    prefix: String,
    /// The same in capitals, for constants.
    upper: String,
    /// Names after the prefix: those of functions, and what is added.
    names: Scope,
    header: String,
    /// The source without what it calls.
    source: String,
    /// What each code of an error means, from 0 on.
    messages: Vec<String>,
    /// The functions of a point.
    calls: Vec<Call>,
}

impl<'a> Writer<'a> {
    fn new(module: &'a Module<'a>) -> Writer<'a> {
        use super::dialect::Dialect as _;
        let prefix = prefix(&module.text.model, &module.text.scene);
        let mut names = Scope::with(&C, C.functions().iter().copied());
        let outputs = module.outputs.iter().flat_map(|o| {
            let all = o.matrix.as_ref().map(|(_, all)| all.as_str());
            std::iter::once(o.name.as_str()).chain(all)
        });
        let implicit = module.implicit.iter().flat_map(|i| [&i.rhs, &i.all, &i.entries].map(String::as_str));
        let products = module.products.iter().map(|p| p.name.as_str());
        names.take(outputs.chain(implicit).chain(products).chain(module.flows.iter().map(|f| f.name.as_str())));
        Writer {
            upper: prefix.to_ascii_uppercase(),
            module,
            prefix,
            names,
            header: String::new(),
            source: String::new(),
            messages: vec!["no error".to_owned()],
            calls: Vec::new(),
        }
    }

    /// A name of the module.
    fn name(&self, suffix: &str) -> String {
        format!("{}_{suffix}", self.prefix)
    }

    /// A further name of the module, which nothing else has.
    fn new_name(&mut self, suffix: &str) -> String {
        let suffix = self.names.add(suffix);
        self.name(&suffix)
    }

    /// Declares and defines a function.
    fn function(&mut self, doc: &[String], signature: &str, body: &str) {
        self.header.push_str(&format!("{}{signature};\n\n", text::comment(doc)));
        self.source.push_str(&format!("{signature} {{\n{body}}}\n\n"));
    }

    /// Notes a function of a point for other interfaces.
    fn call(&mut self, title: &str, name: &str, takes: Takes, n_results: Option<usize>) {
        let (title, name) = (title.to_owned(), name.to_owned());
        self.calls.push(Call { title, name, takes, n_results });
    }

    /// Declares and defines a constant array.
    fn array(&mut self, doc: &str, declaration: &str, elements: &str) {
        self.header.push_str(&format!("{}extern const {declaration};\n\n", text::comment(&[doc.to_owned()])));
        self.source.push_str(&format!("const {declaration} = {elements};\n\n"));
    }

    /// Defines a constant.
    fn constant(&mut self, doc: &str, name: &str, value: usize) {
        let comment = text::comment(&[doc.to_owned()]);
        self.header.push_str(&format!("{comment}#define {}_{name} {value}\n\n", self.upper));
    }

    /// The code of a further error.
    fn code(&mut self, message: String) -> usize {
        self.messages.push(message);
        self.messages.len() - 1
    }

    /// What codes mean.
    fn messages(&mut self) {
        let name = self.name("message");
        let texts = text::strings(&self.messages);
        let n = self.messages.len();
        let body = format!(
            "    static const char *const messages[{n}] = {texts};\n    \
                 return code >= 0 && code < {n} ? messages[code] : \"no code of {}\";\n",
            self.prefix
        );
        let doc = ["What a code means that a function of this module has returned; 0 is no error.".to_owned()];
        self.function(&doc, &format!("const char *{name}(int code)"), &body);
    }

    /// The line that every generated file starts with.
    fn first_line(&self) -> String {
        let version = env!("CARGO_PKG_VERSION");
        format!("/* @generated by hamel {version}: {} */\n", text::plain(&self.module.text.command))
    }

    fn finish(self) -> CModule {
        let (first, cpp, casadi) = (self.first_line(), self.cpp(), self.casadi());
        let Writer { prefix, upper, header, source, .. } = self;
        let guard = format!("{upper}_H");
        let header = format!(
            "{first}#ifndef {guard}\n#define {guard}\n\n#ifdef __cplusplus\nextern \"C\" {{\n#endif\n\n\
             {header}#ifdef __cplusplus\n}}\n#endif\n\n#endif\n"
        );
        let needed = kernel::functions(&source);
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
