//! Small pieces of Rust: identifiers, numbers, documentation, statements.
//!
//! Does not know: items of a module.

use proc_macro2::{Ident, Literal, Span, TokenStream};
use quote::quote;

use super::super::body::Statement;
use super::super::expression::{Binding, Text};
use super::lines;

pub(super) fn ident(name: &str) -> Ident {
    Ident::new(name, Span::call_site())
}

pub(super) fn idents<S: AsRef<str>>(names: impl IntoIterator<Item = S>) -> Vec<Ident> {
    names.into_iter().map(|name| ident(name.as_ref())).collect()
}

/// The names of components in the pattern of an array, `_` without one.
pub(super) fn pattern<S: AsRef<str>>(names: impl IntoIterator<Item = Option<S>>) -> String {
    let names: Vec<String> =
        names.into_iter().map(|name| name.map_or("_".to_owned(), |name| name.as_ref().to_owned())).collect();
    lines::array(&names)
}

/// The statement that takes an array apart.
pub(super) fn taken_apart(pattern: &str, value: &str) -> TokenStream {
    lines::statements(&format!("let {pattern} = {value};"))
}

/// The length of an array, without a suffix.
pub(super) fn size(n: usize) -> Literal {
    Literal::usize_unsuffixed(n)
}

/// The double as a literal expression, shortest form that reads back the same.
pub(super) fn number(x: f64) -> TokenStream {
    let magnitude = Literal::f64_unsuffixed(x.abs());
    if x.is_sign_negative() && x != 0.0 {
        quote! { -#magnitude }
    } else {
        quote! { #magnitude }
    }
}

/// The field of structures without any, which need one that mentions their scalar.
pub(super) const MARKER: &str = "scalar";

/// Statements, each on lines of its own.
pub(super) fn statements(statements: &[Statement]) -> TokenStream {
    lines::statements(&text_of(statements))
}

/// The same as text.
pub(super) fn text_of(statements: &[Statement]) -> String {
    let lines: Vec<String> = statements.iter().map(written).collect();
    lines.join("\n")
}

fn written(statement: &Statement) -> String {
    match statement {
        Statement::Bind { name, value } => format!("let {name} = {value};"),
        Statement::BindPair { sine, cosine, angle } => {
            let angle = angle.clone().at_least(Binding::Atom).text;
            format!("let ({sine}, {cosine}) = {angle}.sin_cos();")
        }
        Statement::BindTwoPairs { sines: [sine, other_sine], cosines: [cosine, other_cosine], angles } => {
            let [angle, other] = angles;
            let angle = angle.clone().at_least(Binding::Atom).text;
            format!(
                "let ([{sine}, {other_sine}], [{cosine}, {other_cosine}]) = {angle}.sin_cos_of_two({});",
                other.text
            )
        }
        Statement::Title(title) => format!("// {}", title.replace('\n', " ")),
        Statement::Block { inner, names } => {
            let names = match names.as_slice() {
                [single] => single.clone(),
                several => lines::array(several),
            };
            let body = format!("{}\n{names}", text_of(inner));
            format!("let {names} = {{\n{}\n}};", lines::indented(&body))
        }
    }
}

/// The text of each.
pub(super) fn texts(texts: &[Text]) -> Vec<&str> {
    texts.iter().map(|text| text.text.as_str()).collect()
}

/// The array of some values, line by line where it is long.
pub(super) fn array<S: AsRef<str>>(items: &[S]) -> TokenStream {
    lines::expression(&lines::array(items))
}

/// A doc attribute for each line.
pub(super) fn doc_attributes<S: AsRef<str>>(lines: impl IntoIterator<Item = S>) -> TokenStream {
    let mut tokens = TokenStream::new();
    for line in lines.into_iter() {
        for line in line.as_ref().split('\n') {
            let line = if line.is_empty() { String::new() } else { format!(" {}", line.trim_end()) };
            tokens.extend(quote::quote! { #[doc = #line] });
        }
    }
    tokens
}

/// Text of a model inside rustdoc: units in brackets are no links and inequalities no tags, except between backticks.
pub(super) fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut code = false;
    for c in text.chars() {
        code ^= c == '`';
        if !code && matches!(c, '[' | ']' | '<' | '>') {
            out.push('\\');
        }
        out.push(c);
    }
    out
}

pub(super) fn sentence(text: &str) -> String {
    let text = escaped(&capitalised(text.trim()));
    if text.ends_with(['.', '!', '?', ')', '`']) { text } else { format!("{text}.") }
}

pub(super) fn capitalised(text: &str) -> String {
    let mut chars = text.chars();
    match chars.next() {
        Some(first) => first.to_uppercase().chain(chars).collect(),
        None => String::new(),
    }
}

/// A list broken into lines of bounded length.
pub(super) fn wrapped(open: &str, names: &[String], close: &str) -> Vec<String> {
    const WIDTH: usize = 90;
    let mut lines = vec![open.to_owned()];
    for (k, name) in names.iter().enumerate() {
        let separator = if k == 0 { "" } else { ", " };
        let line = lines.last_mut().expect("there is a first line");
        if line.len() + name.len() + 2 > WIDTH {
            line.push(',');
            lines.push(format!("     {name}"));
        } else {
            line.push_str(&format!("{separator}{name}"));
        }
    }
    lines.last_mut().expect("there is a first line").push_str(close);
    lines
}
