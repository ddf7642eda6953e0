//! Text among tokens: what is written line by line, where a formatter of tokens would take more lines or other ones.
//!
//! [`statements`] and [`expression`] put text among tokens. [`taken_out`] leaves a number in its place while the tokens
//! are formatted, and [`put_back`] writes the lines of the text with the indentation of that place.
//!
//! Does not know: what the text says.

use proc_macro2::{Group, Ident, Literal, Span, TokenStream, TokenTree};
use quote::quote;

/// The macro whose argument is text.
const MACRO: &str = "__verbatim";
/// The attribute that stands for [`ALLOW`].
const ATTRIBUTE: &str = "__allow";

/// Lints that any module of any model may break: each item that they look at has this line.
pub(super) const ALLOW: &str = "#[allow(dead_code, unreachable_pub, non_snake_case, clippy::approx_constant, \
                                reason = \"names and numbers of the model\")]";

/// Columns of a list, without the indentation of its place.
const WIDTH: usize = 110;
/// Items of a list that are no longer than this share lines.
const MAX_SHARED: usize = 40;

/// Text in the place of an expression.
pub(super) fn expression(text: &str) -> TokenStream {
    let name = Ident::new(MACRO, Span::call_site());
    quote! { #name!(#text) }
}

/// Text in the place of statements or of an item; nothing where it is empty.
pub(super) fn statements(text: &str) -> TokenStream {
    if text.is_empty() {
        return TokenStream::new();
    }
    let expression = expression(text);
    quote! { #expression; }
}

/// [`ALLOW`] among tokens.
pub(super) fn allow() -> TokenStream {
    let name = Ident::new(ATTRIBUTE, Span::call_site());
    quote! { #[#name] }
}

/// Items between brackets: in one line where they fit, otherwise in lines of bounded length, or each in a line of its
/// own where one is long.
pub(super) fn list<S: AsRef<str>>(open: &str, items: &[S], close: &str) -> String {
    let items: Vec<&str> = items.iter().map(AsRef::as_ref).collect();
    let line = items.join(", ");
    if items.is_empty() || open.len() + line.len() + close.len() <= WIDTH {
        return format!("{open}{line}{close}");
    }
    let lines = match items.iter().all(|item| item.len() <= MAX_SHARED) {
        true => filled(&items),
        false => items.iter().map(|item| format!("    {item},")).collect::<Vec<_>>().join("\n"),
    };
    format!("{}\n{lines}\n{}", open.trim_end(), close.trim_start())
}

/// Items in indented lines of bounded length, each with a comma behind.
pub(super) fn filled<S: AsRef<str>>(items: &[S]) -> String {
    let mut lines: Vec<String> = Vec::new();
    for item in items.iter().map(AsRef::as_ref) {
        match lines.last_mut().filter(|line| line.len() + item.len() + 2 <= WIDTH) {
            Some(line) => line.push_str(&format!(" {item},")),
            None => lines.push(format!("    {item},")),
        }
    }
    lines.join("\n")
}

/// The array of some values.
pub(super) fn array<S: AsRef<str>>(items: &[S]) -> String {
    list("[", items, "]")
}

/// The lines of a text, each behind four more spaces.
pub(super) fn indented(text: &str) -> String {
    let lines = text.lines().map(|line| if line.is_empty() { String::new() } else { format!("    {line}") });
    lines.collect::<Vec<_>>().join("\n")
}

/// Comments for documentation, a line each.
pub(super) fn documentation<S: AsRef<str>>(lines: impl IntoIterator<Item = S>) -> String {
    let mut text = String::new();
    for line in lines {
        for line in line.as_ref().split('\n') {
            text.push_str(format!("/// {line}").trim_end());
            text.push('\n');
        }
    }
    text
}

/// A text as a literal.
pub(super) fn literal(text: &str) -> String {
    Literal::string(text).to_string()
}

/// Tokens with numbers in the place of text, which comes behind `texts`.
pub(super) fn taken_out(tokens: TokenStream, texts: &mut Vec<String>) -> TokenStream {
    let mut trees: Vec<TokenTree> = Vec::new();
    for tree in tokens {
        let TokenTree::Group(group) = tree else {
            trees.push(tree);
            continue;
        };
        let is_text = matches!(
            trees.as_slice(),
            [.., TokenTree::Ident(name), TokenTree::Punct(mark)] if name == MACRO && mark.as_char() == '!'
        );
        let text = is_text.then(|| syn::parse2::<syn::LitStr>(group.stream()).ok()).flatten();
        let inner = match text {
            Some(text) => {
                texts.push(text.value());
                TokenTree::from(Literal::usize_unsuffixed(texts.len() - 1)).into()
            }
            None => taken_out(group.stream(), texts),
        };
        trees.push(Group::new(group.delimiter(), inner).into());
    }
    trees.into_iter().collect()
}

/// Whether a formatted line is text in the place of an item.
pub(super) fn is_item(line: &str) -> bool {
    line.starts_with(MACRO)
}

/// Formatted tokens with the text in the place of its numbers.
pub(super) fn put_back(formatted: &str, texts: &[String]) -> String {
    let attribute = format!("#[{ATTRIBUTE}]");
    let mut out = String::with_capacity(2 * formatted.len());
    for line in formatted.lines() {
        let indentation = &line[..line.len() - line.trim_start().len()];
        let mut rest = line;
        if line.trim() == attribute {
            out.push_str(indentation);
            out.push_str(ALLOW);
            rest = "";
        }
        while let Some((before, text, after)) = text_within(rest, texts) {
            out.push_str(before);
            out.push_str(&text.lines().collect::<Vec<_>>().join(&format!("\n{indentation}")));
            let is_statement = before == indentation && rest.len() == line.len() && after == ";";
            rest = if is_statement { "" } else { after };
        }
        out.push_str(rest);
        out.push('\n');
    }
    out
}

/// The first number of a text in a line: what stands before it, the text, and what stands behind.
fn text_within<'t>(line: &'t str, texts: &'t [String]) -> Option<(&'t str, &'t str, &'t str)> {
    let (before, behind) = line.split_once(&format!("{MACRO}!("))?;
    let (number, after) = behind.split_once(')')?;
    let text = texts.get(number.parse::<usize>().ok()?)?;
    Some((before, text, after))
}

#[cfg(test)]
mod tests {
    use quote::quote;

    use super::{WIDTH, expression, indented, list, put_back, statements, taken_out};

    #[test]
    fn text_has_the_indentation_of_its_place() {
        let (body, value) = (statements("let a = 1;\nlet b = \"(2)\";"), expression("[\n    a,\n    b,\n]"));
        let mut texts = Vec::new();
        let tokens = taken_out(quote! { fn f() { #body g(#value) } }, &mut texts);
        assert_eq!(tokens.to_string(), "fn f () { __verbatim ! (0) ; g (__verbatim ! (1)) }");
        let formatted = "fn f() {\n    __verbatim!(0);\n    g(__verbatim!(1))\n}\n";
        let expected =
            "fn f() {\n    let a = 1;\n    let b = \"(2)\";\n    g([\n        a,\n        b,\n    ])\n}\n";
        assert_eq!(put_back(formatted, &texts), expected);
        assert_eq!(
            put_back("__verbatim!(7);\n__verbatim!(x)\n", &texts),
            "__verbatim!(7);\n__verbatim!(x)\n"
        );
    }

    #[test]
    fn lists_have_lines_of_bounded_length() {
        assert_eq!(list("P { ", &["a", "b"], " }"), "P { a, b }");
        let names: Vec<String> = (0..40).map(|k| format!("name{k}")).collect();
        let text = list("P { ", &names, " }");
        assert!(text.starts_with("P {\n    name0, name1,") && text.ends_with("name39,\n}"), "{text}");
        assert!(text.lines().all(|line| line.len() <= WIDTH) && text.lines().count() < 8, "{text}");
        let long = ["x".repeat(60), "y".repeat(60)];
        assert_eq!(list("[", &long, "]"), format!("[\n    {},\n    {},\n]", long[0], long[1]));
        assert_eq!(indented("a\n\n  b"), "    a\n\n      b");
    }
}
