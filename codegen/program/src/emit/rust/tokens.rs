//! Small pieces of Rust: identifiers, numbers, documentation, lints, statements.
//!
//! Does not know: items of a module.

use proc_macro2::{Ident, Literal, Span, TokenStream};
use quote::quote;

use super::super::body::Statement;
use super::super::expression::Binding;
use super::format::parse;
use super::notation::is_unusual;
use hamel_expr::error::Error;

pub(super) fn ident(name: &str) -> Ident {
    Ident::new(name, Span::call_site())
}

pub(super) fn idents<S: AsRef<str>>(names: impl IntoIterator<Item = S>) -> Vec<Ident> {
    names.into_iter().map(|name| ident(name.as_ref())).collect()
}

/// The pattern of an array whose components have these names, and `_` without one.
pub(super) fn pattern<S: AsRef<str>>(names: impl IntoIterator<Item = Option<S>>) -> TokenStream {
    let names = names.into_iter().map(|name| match name {
        Some(name) => {
            let name = ident(name.as_ref());
            quote! { #name }
        }
        None => quote! { _ },
    });
    quote! { [#(#names),*] }
}

/// `field: value`, or shorter where both are the same name.
pub(super) fn field(field: &Ident, value: &TokenStream) -> TokenStream {
    if *field == value.to_string() {
        quote! { #field }
    } else {
        quote! { #field: #value }
    }
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

/// A field for structures without any, and its value: a structure needs a field that mentions its scalar.
pub(super) fn phantom() -> (TokenStream, TokenStream) {
    (quote! { scalar: ::core::marker::PhantomData<R>, }, quote! { scalar: ::core::marker::PhantomData, })
}

/// `#[allow(..)]` for what the names and numbers of the model need.
pub(super) fn allow(lint: &str, reason: &str) -> TokenStream {
    // `clippy::approx_constant` is a path.
    let path: syn::Path = syn::parse_str(lint).expect("lints are constants of this module");
    quote! { #[allow(#path, reason = #reason)] }
}

pub(super) fn allow_names<S: AsRef<str>>(identifiers: impl IntoIterator<Item = S>) -> TokenStream {
    if identifiers.into_iter().any(|name| is_unusual(name.as_ref())) {
        allow("non_snake_case", "names are those of the model")
    } else {
        TokenStream::new()
    }
}

pub(super) fn allow_comments() -> TokenStream {
    allow("unused_doc_comments", "comments on statements say which formula they are")
}

/// Whether clippy takes one of the numbers for a rounded mathematical constant.
pub(super) fn allow_numbers(numbers: impl IntoIterator<Item = f64>) -> TokenStream {
    use std::f64::consts as c;
    let known = [
        c::E,
        c::FRAC_1_PI,
        c::FRAC_1_SQRT_2,
        c::FRAC_2_PI,
        c::FRAC_2_SQRT_PI,
        c::FRAC_PI_2,
        c::FRAC_PI_3,
        c::FRAC_PI_4,
        c::FRAC_PI_6,
        c::FRAC_PI_8,
        c::LN_2,
        c::LN_10,
        c::LOG10_2,
        c::LOG10_E,
        c::LOG2_10,
        c::LOG2_E,
        c::PI,
        c::SQRT_2,
        c::TAU,
        1.618_033_988_749_895,
        0.577_215_664_901_532_9,
    ];
    if numbers.into_iter().any(|x| known.iter().any(|k| (x.abs() - k).abs() < 2e-3 * k)) {
        allow("clippy::approx_constant", "values are those of the model")
    } else {
        TokenStream::new()
    }
}

/// Statements as tokens.
///
/// # Errors
/// [`Error::Emission`] never in practice: the text is made of identifiers and operators.
pub(super) fn statements(statements: &[Statement]) -> Result<TokenStream, Error> {
    let mut text = String::new();
    statements.iter().for_each(|statement| write_statement(statement, &mut text));
    parse(&text)
}

fn write_statement(statement: &Statement, text: &mut String) {
    let line = match statement {
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
        Statement::Block { title, inner, names, values } => {
            let list = |several: &[String]| match several {
                [single] => single.clone(),
                several => format!("[{}]", several.join(", ")),
            };
            let (names, values) = (list(names), list(values));
            let doc = title.as_ref().map(|title| format!("#[doc = {:?}]\n", format!(" {title}")));
            let mut block = String::new();
            inner.iter().for_each(|statement| write_statement(statement, &mut block));
            let value = if block.is_empty() { values } else { format!("{{ {block}{values} }}") };
            format!("{}let {names} = {value};", doc.unwrap_or_default())
        }
    };
    text.push_str(&line);
    text.push('\n');
}

/// Several texts as tokens.
pub(super) fn parse_all<'t>(
    texts: impl IntoIterator<Item = &'t super::super::expression::Text>,
) -> Result<Vec<TokenStream>, Error> {
    texts.into_iter().map(|text| parse(&text.text)).collect()
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
