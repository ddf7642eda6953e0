//! What all items of a C module share: names, the texts that grow side by side, codes of errors.
//!
//! Deliberately does not know: which items there are.

use super::notation::C;
use super::single::Precision;
use super::text;
use crate::emit::dialect::Dialect as _;
use crate::emit::module::Module;
use crate::emit::names::{Scope, legal};

/// What a function takes besides what is prepared.
#[derive(Clone, Copy, Debug)]
pub(super) enum Takes {
    /// Time and state.
    Point,
    /// Time, state and that many inputs.
    PointAndInputs(usize),
    /// Time, state and a vector of that length.
    PointAndVector(usize),
    /// Time and that many variables in the place of the state.
    Variables(usize),
    /// A time of its own and the state.
    Flow,
}

/// A function of the module as others call it.
#[derive(Clone, Debug)]
pub(super) struct Call {
    pub(super) title: String,
    pub(super) name: String,
    pub(super) takes: Takes,
    /// Length of the array that it writes; none where it returns a number.
    pub(super) n_results: Option<usize>,
}

/// What all names of a scene begin with: the model's name, followed by the scene's unless it is the default.
fn prefix(model: &str, scene: &str) -> String {
    let name = if scene == "default" { model.to_owned() } else { format!("{model}_{scene}") };
    legal(&[], &name)
}

/// Writes the header and the source side by side.
pub(super) struct Writer<'a> {
    pub(super) module: &'a Module<'a>,
    pub(super) prefix: String,
    /// The same in capitals, for constants.
    pub(super) upper: String,
    /// Names after the prefix: those of functions, and what is added.
    pub(super) names: Scope,
    pub(super) header: String,
    /// The source without what it calls.
    pub(super) source: String,
    /// What each code of an error means, from 0 on.
    pub(super) messages: Vec<String>,
    /// The functions of a point.
    pub(super) calls: Vec<Call>,
    pub(super) precision: Precision,
}

impl<'a> Writer<'a> {
    pub(super) fn new(module: &'a Module<'a>) -> Writer<'a> {
        let prefix = prefix(&module.text.model, &module.text.scene);
        let mut names = Scope::with(&C, C.functions().iter().copied());
        let outputs = module.outputs.iter().flat_map(|o| {
            let all = o.matrix.as_ref().map(|(_, all)| all.as_str());
            std::iter::once(o.name.as_str()).chain(all)
        });
        let implicit = module.implicit.iter().flat_map(|i| [&i.rhs, &i.all, &i.entries].map(String::as_str));
        let discrete = module.discrete.iter().flat_map(|d| d.all()).map(|f| f.name.as_str());
        let products = module.products.iter().map(|p| p.name.as_str());
        let quotient = module.quotient.iter().map(|q| q.name.as_str());
        names.take(
            outputs
                .chain(implicit)
                .chain(discrete)
                .chain(quotient)
                .chain(products)
                .chain(module.flows.iter().map(|f| f.name.as_str())),
        );
        Writer {
            upper: prefix.to_ascii_uppercase(),
            module,
            prefix,
            names,
            header: String::new(),
            source: String::new(),
            messages: vec!["no error".to_owned()],
            calls: Vec::new(),
            precision: Precision::Double,
        }
    }

    /// A name of the module.
    pub(super) fn name(&self, suffix: &str) -> String {
        format!("{}_{suffix}", self.prefix)
    }

    /// A further name of the module, which nothing else has.
    pub(super) fn new_name(&mut self, suffix: &str) -> String {
        let suffix = self.names.add(suffix);
        self.name(&suffix)
    }

    /// Declares and defines a function.
    pub(super) fn function(&mut self, doc: &[String], signature: &str, body: &str) {
        self.header.push_str(&format!("{}{signature};\n\n", text::comment(doc)));
        self.source.push_str(&format!("{signature} {{\n{body}}}\n\n"));
    }

    /// Notes a function of a point for other interfaces.
    pub(super) fn call(&mut self, title: &str, name: &str, takes: Takes, n_results: Option<usize>) {
        let (title, name) = (title.to_owned(), name.to_owned());
        self.calls.push(Call { title, name, takes, n_results });
    }

    /// Declares and defines a constant array.
    pub(super) fn array(&mut self, doc: &str, declaration: &str, elements: &str) {
        self.header.push_str(&format!("{}extern const {declaration};\n\n", text::comment(&[doc.to_owned()])));
        self.source.push_str(&format!("const {declaration} = {elements};\n\n"));
    }

    /// Defines a constant.
    pub(super) fn constant(&mut self, doc: &str, name: &str, value: usize) {
        let comment = text::comment(&[doc.to_owned()]);
        self.header.push_str(&format!("{comment}#define {}_{name} {value}\n\n", self.upper));
    }

    /// The code of a further error.
    pub(super) fn code(&mut self, message: String) -> usize {
        self.messages.push(message);
        self.messages.len() - 1
    }

    /// What codes mean.
    pub(super) fn messages(&mut self) {
        let name = self.name("message");
        let texts = text::strings(&self.messages);
        let n = self.messages.len();
        let body = format!(
            "    static const char *const messages[{n}] = {texts};\n    \
                 return code >= 0 && code < {n} ? messages[code] : \"no code of {}\";\n",
            self.prefix
        );
        let doc =
            ["What a code means that a function of this module has returned; 0 is no error.".to_owned()];
        self.function(&doc, &format!("const char *{name}(int code)"), &body);
    }

    /// The line that every generated file starts with.
    pub(super) fn first_line(&self) -> String {
        let version = env!("CARGO_PKG_VERSION");
        format!("/* @generated by hamel {version}: {} */\n", text::plain(&self.module.text.command))
    }
}
