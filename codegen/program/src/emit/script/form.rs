//! What a language answers so that a module can be laid out in it.
//!
//! Deliberately does not know: any language.

use super::super::body::Statement;
use super::super::dialect::Dialect as _;
use super::super::module::Routine;
use super::item::{Item, Takes};
use super::spelling::{PRODUCTS, Spelling};
use crate::program::Factors;

/// A scene in a language of formulas.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Script {
    /// Name of the file.
    pub file: String,
    /// Its text.
    pub text: String,
}

/// A list with names: each name, its identifier, its value where it has one, and what it is.
pub(super) struct Entry {
    pub(super) name: String,
    pub(super) field: String,
    pub(super) value: Option<String>,
    pub(super) doc: String,
}

/// The code that runs once for a set of parameters.
pub(super) struct Preparation {
    /// Names of the parameters in the model, their identifiers in lists, and their variables.
    pub(super) params: Vec<[String; 3]>,
    pub(super) lines: Vec<String>,
    /// Comparisons with what they mean.
    pub(super) conditions: Vec<(String, String)>,
    /// Fields and their values.
    pub(super) fields: Vec<(String, String)>,
}

/// A table of products in numbers from zero: places of the factors, numbers, results.
pub(super) struct Rows {
    pub(super) lefts: Vec<usize>,
    pub(super) rights: Vec<usize>,
    pub(super) numbers: Vec<String>,
    pub(super) results: Vec<usize>,
}

/// What a language answers. Lines come without indentation.
pub(super) trait Form {
    fn spelling(&self) -> Spelling;

    /// What comments begin with.
    fn comment(&self) -> &'static str;

    /// The sign of an inequality.
    fn unequal(&self) -> &'static str {
        "!="
    }

    /// What a module begins with, below its first line.
    fn head(&self, name: &str, doc: &[String]) -> String;

    /// The first function, where the language has one that gives all others.
    fn first(&self, name: &str, module: &Summary) -> String {
        let _ = (name, module);
        String::new()
    }

    /// Functions that the others call, as far as they do.
    fn helpers(&self, calls: &dyn Fn(&str) -> bool) -> String;

    /// What a module ends with.
    fn tail(&self, name: &str, module: &Summary) -> String;

    /// A constant: names with values, or names alone.
    fn list(&self, name: &str, doc: &str, entries: &[Entry]) -> String;

    /// A constant: numbers, or other values of the language.
    fn values(&self, name: &str, doc: &str, values: &[String]) -> String;

    /// A constant: a table of products.
    fn rows(&self, name: &str, rows: &Rows) -> String;

    /// The function that checks parameters and computes what depends on them alone.
    fn prepare(&self, preparation: &Preparation) -> String;

    /// A line that binds a variable.
    fn bind(&self, name: &str, value: &str) -> String;

    /// A line that binds sine and cosine of an angle.
    fn pair(&self, sine: &str, cosine: &str, angle: &str) -> String;

    /// Values side by side, to be read by their places.
    fn vector(&self, values: &[String]) -> String;

    /// A function of the module.
    fn function(&self, item: &Item<'_>, has_inputs: bool) -> String;
}

/// What a module has, for what comes after its functions.
pub(super) struct Summary {
    /// Names of constants and of functions.
    pub(super) constants: Vec<String>,
    pub(super) functions: Vec<String>,
    pub(super) n_state: usize,
    pub(super) has_inputs: bool,
}

/// A text in one line.
pub(super) fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Lines of statements.
pub(super) fn lines(form: &dyn Form, statements: &[Statement]) -> Vec<String> {
    let mut lines = Vec::new();
    for statement in statements {
        match statement {
            Statement::Bind { name, value } => lines.push(form.bind(name, value)),
            Statement::BindPair { sine, cosine, angle } => lines.push(form.pair(sine, cosine, &angle.text)),
            Statement::BindTwoPairs { sines, cosines, angles } => {
                for ((sine, cosine), angle) in sines.iter().zip(cosines).zip(angles) {
                    lines.push(form.pair(sine, cosine, &angle.text));
                }
            }
            Statement::Title(title) => lines.push(format!("{} {}", form.comment(), one_line(title))),
            // All names are of one scope.
            Statement::Block { inner, .. } => lines.extend(self::lines(form, inner)),
        }
    }
    lines
}

/// The lines of a function before its results.
pub(super) fn body(form: &dyn Form, item: &Item<'_>) -> Vec<String> {
    let (routine, spelling) = (item.routine, form.spelling());
    let mut text = Vec::new();
    let mut named = |names: &[Option<String>], of: &dyn Fn(usize) -> String| {
        let names = names.iter().enumerate().filter_map(|(k, name)| Some((k, name.as_ref()?)));
        // A variable with the name of the argument that it reads needs no line.
        let names = names.filter(|(k, name)| of(*k) != **name);
        text.extend(names.map(|(k, name)| form.bind(name, &of(k))));
    };
    let is_flow = item.takes == Takes::Flow;
    named(&routine.state, &|k| spelling.element("y", k));
    named(&routine.argument, &|k| if is_flow { "value".to_owned() } else { spelling.element("vector", k) });
    named(&routine.inputs, &|k| spelling.element("u", k));
    text.extend(lines(form, &routine.code.statements));
    text.extend(sums(form, routine));
    text
}

/// The lines of sums over tables, after straight-line code.
fn sums(form: &dyn Form, routine: &Routine<'_>) -> Vec<String> {
    let Some(loops) = &routine.loops else { return Vec::new() };
    let spelling = form.spelling();
    let mut text = Vec::new();
    if !loops.values.is_empty() {
        let values: Vec<String> = loops.values.iter().map(|value| value.text.clone()).collect();
        text.push(form.bind(&loops.scalars, &form.vector(&values)));
    }
    let of = |factors: Factors| match factors {
        Factors::State => "y",
        Factors::Argument => "vector",
        Factors::Scalars => &loops.scalars,
        Factors::Contraction(k) => &loops.sums[k as usize],
    };
    for (contraction, sums) in routine.function.contractions.iter().zip(&loops.sums) {
        let terms: Vec<String> = contraction
            .terms
            .iter()
            .map(|products| {
                let table = spelling.table(products.table as usize);
                let (left, right) = (of(products.left), of(products.right));
                format!("{}({}, {left}, {right}, {table})", spelling.own(PRODUCTS), contraction.n_results)
            })
            .collect();
        text.push(form.bind(sums, &terms.join(" + ")));
    }
    text
}

/// The texts of the results of a function.
pub(super) fn results(item: &Item<'_>) -> Vec<String> {
    item.routine.code.results.iter().map(|result| result.text.clone()).collect()
}

/// Lines with an indentation; empty ones stay empty.
pub(super) fn indented(lines: &[String], indent: &str) -> String {
    let line = |line: &String| match line.is_empty() {
        true => "\n".to_owned(),
        false => format!("{indent}{line}\n"),
    };
    lines.iter().map(line).collect()
}

/// Columns of lists.
const WIDTH: usize = 110;

/// Values of a list, in lines of bounded length without indentation.
pub(super) fn wrapped(values: &[String], separator: &str) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for value in values {
        match lines.last_mut().filter(|line| line.len() + value.len() + 2 <= WIDTH) {
            Some(line) => line.push_str(&format!(" {value}{separator}")),
            None => lines.push(format!("{value}{separator}")),
        }
    }
    lines
}
