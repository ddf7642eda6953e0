//! Small pieces of C: comments, strings, arrays, statements.
//!
//! Deliberately does not know: items of a module.

use std::fmt::Write as _;

use super::super::body::Statement;
use super::kernel;

/// Columns of lists.
const WIDTH: usize = 110;

/// A block comment for documentation tools, without anything that would end it.
pub(super) fn comment(lines: &[String]) -> String {
    let lines: Vec<String> = lines.iter().flat_map(|line| line.split('\n')).map(plain).collect();
    match lines.as_slice() {
        [line] => format!("/** {line} */\n"),
        lines => {
            let lines: String =
                lines.iter().map(|line| format!(" * {line}").trim_end().to_owned() + "\n").collect();
            format!("/**\n{lines} */\n")
        }
    }
}

/// Text that neither ends nor opens a comment.
pub(super) fn plain(text: &str) -> String {
    text.replace("*/", "* /").replace("/*", "/ *").trim_end().to_owned()
}

/// A string literal.
pub(super) fn string(text: &str) -> String {
    let mut literal = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' | '?' => literal.extend(['\\', c]),
            '\n' => literal.push_str("\\n"),
            c if c.is_control() => literal.push(' '),
            c => literal.push(c),
        }
    }
    literal.push('"');
    literal
}

/// Elements of an array, in lines of bounded length; one zero where the array has none, as C wants one.
pub(super) fn elements(elements: &[String]) -> String {
    if elements.is_empty() {
        return "{0}".to_owned();
    }
    let mut lines = vec![String::from("   ")];
    for element in elements {
        let line = lines.last_mut().filter(|line| line.len() + element.len() + 2 <= WIDTH || line.len() == 3);
        match line {
            Some(line) => {
                let _ = write!(line, " {element},");
            }
            None => lines.push(format!("    {element},")),
        }
    }
    format!("{{\n{}\n}}", lines.join("\n"))
}

/// Elements of an array of strings.
pub(super) fn strings<'s>(texts: impl IntoIterator<Item = &'s String>) -> String {
    let literals: Vec<String> = texts.into_iter().map(|text| string(text)).collect();
    elements(&literals)
}

/// The length of an array, of which C wants one element at least.
pub(super) fn length(n: usize) -> usize {
    n.max(1)
}

/// Statements, each on lines of its own.
pub(super) fn statements(statements: &[Statement]) -> String {
    let mut text = String::new();
    statements.iter().for_each(|statement| write_statement(statement, &[], "    ", &mut text));
    text
}

/// Writes a statement; variables that are `declared` before are assigned.
fn write_statement(statement: &Statement, declared: &[String], indent: &str, text: &mut String) {
    let declares = |names: &[&String]| {
        let new: Vec<&str> = names.iter().filter(|n| !declared.contains(n)).map(|n| n.as_str()).collect();
        if new.is_empty() { String::new() } else { format!("{indent}double {};\n", new.join(", ")) }
    };
    let pair = |angle: &str, sine: &str, cosine: &str| {
        format!("{indent}{}({angle}, &{sine}, &{cosine});\n", kernel::SIN_COS)
    };
    match statement {
        Statement::Bind { name, value } => {
            let declaration = if declared.contains(name) { "" } else { "const double " };
            let _ = writeln!(text, "{indent}{declaration}{name} = {value};");
        }
        Statement::BindPair { sine, cosine, angle } => {
            text.push_str(&declares(&[sine, cosine]));
            text.push_str(&pair(&angle.text, sine, cosine));
        }
        Statement::BindTwoPairs { sines, cosines, angles } => {
            text.push_str(&declares(&[&sines[0], &cosines[0], &sines[1], &cosines[1]]));
            for ((sine, cosine), angle) in sines.iter().zip(cosines).zip(angles) {
                text.push_str(&pair(&angle.text, sine, cosine));
            }
        }
        Statement::Title(title) => {
            let _ = writeln!(text, "{indent}/* {} */", plain(title));
        }
        Statement::Block { inner, names } => {
            if !names.is_empty() {
                let _ = writeln!(text, "{indent}double {};", names.join(", "));
            }
            let _ = writeln!(text, "{indent}{{");
            let deeper = format!("{indent}    ");
            inner.iter().for_each(|statement| write_statement(statement, names, &deeper, text));
            let _ = writeln!(text, "{indent}}}");
        }
    }
}
