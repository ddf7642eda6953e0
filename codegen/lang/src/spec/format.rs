//! Model files in one form: indentation, blanks and blank lines, and nothing else.
//!
//! Lines stay lines, comments stay where they are, and every token stays what it is: a formatted text has the tokens of
//! the text before. Deliberately does not know: items, names, what an expression means.

use super::diagnostic::{Diagnostics, Origin};
use super::parser;
use super::tokens::{Kind, Token, tokens};

/// Columns of a level of indentation.
const INDENT: usize = 4;

/// What stands between two tokens of a line; `before` is in front of the first.
fn between<'t>(
    before: Option<&Token<'_>>,
    a: &Token<'_>,
    b: &Token<'t>,
    after: Option<&Token<'_>>,
) -> &'t str {
    // What is kept as it is: none, or one blank.
    let kept = if b.has_blanks { " " } else { "" };
    let one_if = |condition: bool| if condition { " " } else { "" };
    if b.is_comment() {
        // Columns of comments stay columns.
        return if b.has_blanks { b.blanks } else { " " };
    }
    if a.kind == Kind::BlockComment {
        return " ";
    }
    if a.is("{") || b.is("}") {
        return one_if(!(a.is("{") && b.is("}")));
    }
    if b.is("{") {
        return " ";
    }
    if a.is("(") || a.is("[") || [")", "]", ",", ";", ":"].iter().any(|mark| b.is(mark)) {
        return "";
    }
    if [",", ";", ":", "}"].iter().any(|mark| a.is(mark)) {
        return " ";
    }
    let is_relation =
        |t: &Token<'_>| ["=", "==", "!=", "<", ">", "<=", ">=", "->", "&&", "||"].iter().any(|r| t.is(r));
    if is_relation(a) || is_relation(b) {
        return " ";
    }
    let is_sum = |t: &Token<'_>| t.is("+") || t.is("-");
    let is_product = |t: &Token<'_>| t.is("*") || t.is("/") || t.is("^");
    // With a blank behind it, it stands between two operands, and gets one in front as well; otherwise it may be a
    // sign.
    let is_apart = |left: Option<&Token<'_>>, right: Option<&Token<'_>>| {
        let is_binary = left.is_some_and(Token::ends_operand) && right.is_some_and(Token::begins_operand);
        is_binary && right.is_some_and(|r| r.has_blanks && r.n_breaks == 0)
    };
    if is_sum(b) {
        return if is_apart(Some(a), after) { " " } else { kept };
    }
    if is_sum(a) {
        return one_if(is_apart(before, Some(b)));
    }
    if is_product(a) || is_product(b) {
        return kept;
    }
    if (a.kind == Kind::Word || a.closes()) && b.kind == Kind::Word { " " } else { kept }
}

/// The text of a model file in its form; lines stay lines.
///
/// Indentation is four columns a level. A line has one blank where tokens are apart, none at its end; there is at most
/// one empty line, none after `{` and before `}`. The form of a form is itself.
///
/// ```
/// use hamel_lang::spec;
///
/// let text = "model rod{ param  l=2;\ncoordinate x in real;lagrangian = l*x_dot^2 /2; // free\n}";
/// let formatted = spec::format("rod.hamel", text)?;
/// assert_eq!(
///     formatted,
///     "model rod { param l = 2;\n    coordinate x in real; lagrangian = l*x_dot^2 /2; // free\n}\n"
/// );
/// # Ok::<(), spec::Diagnostics>(())
/// ```
///
/// # Errors
/// Every problem of a text that is no model by its syntax; what names mean is not looked at.
pub fn format(file: &str, text: &str) -> Result<String, Diagnostics> {
    let outcome = parser::parse_file(text);
    if !outcome.problems.is_empty() {
        let origin = Origin { file: file.to_owned(), text: text.to_owned() };
        return Err(Diagnostics::new(Some(origin), outcome.problems));
    }
    let tokens = tokens(text);
    let mut out = String::with_capacity(text.len() + text.len() / 8);
    // Lines of the brackets that are open.
    let mut open: Vec<usize> = Vec::new();
    // Whether an open bracket is not a brace, for each.
    let mut rounds: Vec<bool> = Vec::new();
    let mut line = 0;
    // The last token that is no comment.
    let mut last: Option<usize> = None;
    for (k, token) in tokens.iter().enumerate() {
        let previous = k.checked_sub(1).map(|k| &tokens[k]);
        let after_comment = previous.is_some_and(|p| p.kind == Kind::LineComment);
        match previous {
            Some(a) if token.n_breaks == 0 && !after_comment => {
                let before = k.checked_sub(2).map(|k| &tokens[k]);
                out.push_str(between(before, a, token, tokens.get(k + 1)));
            }
            Some(a) => {
                line += 1;
                let is_apart = token.n_breaks > 1 && !a.is("{") && !token.is("}");
                out.push_str(if is_apart { "\n\n" } else { "\n" });
                let on_line =
                    tokens[k..].iter().take(1).chain(tokens[k + 1..].iter().take_while(|t| t.n_breaks == 0));
                let n_closed = on_line.take_while(|t| t.closes()).count().min(open.len());
                let mut lines = open[..open.len() - n_closed].to_vec();
                lines.dedup();
                let is_finished = last.is_none_or(|k| [";", "{", "}"].iter().any(|mark| tokens[k].is(mark)));
                let continues = !is_finished && n_closed == 0 && !rounds.last().is_some_and(|round| *round);
                out.push_str(&" ".repeat(INDENT * (lines.len() + usize::from(continues))));
            }
            None => {}
        }
        out.push_str(token.text);
        line += token.text.matches('\n').count();
        if token.opens() {
            open.push(line);
            rounds.push(token.text != "{");
        } else if token.closes() {
            open.pop();
            rounds.pop();
        }
        if !token.is_comment() {
            last = Some(k);
        }
    }
    out.push('\n');
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::{format, tokens};

    fn words(text: &str) -> Vec<&str> {
        tokens(text).iter().map(|t| t.text).collect()
    }

    #[test]
    fn a_form_has_the_tokens_of_the_text_and_is_its_own_form() {
        let text = "/// Rod\n\n\n\nmodel rod{param l=2 where l>0,l<3;/* a\n   b */ param k:symmetric(2)=[\n1,- 2,\n\
                    3\n]; // end\n\n\nlet y=x^( -1)- 1e-3*l -(x)\n+2;coordinate x:vector(2)in(0,1);\n\nscene s{want rhs;\n\
                    fix l=1;}\nscene t {\n\twant rhs;\n\t}\nadvected a  in fluid as a_* by ad;\n\
                    view b=ball(l) around -l*x at [x , -1, 0];\n\n}\n\n";
        let once = format("rod.hamel", text).unwrap();
        assert_eq!(words(&once), words(text));
        assert_eq!(format("rod.hamel", &once).unwrap(), once);
        let lines = [
            "/// Rod",
            "",
            "model rod { param l = 2 where l > 0, l < 3; /* a",
            "   b */ param k: symmetric(2) = [",
            "        1, -2,",
            "        3",
            "    ]; // end",
            "",
            "    let y = x^(-1) - 1e-3*l -(x)",
            "        +2; coordinate x: vector(2) in(0, 1);",
            "",
            "    scene s { want rhs;",
            "        fix l = 1; }",
            "    scene t {",
            "        want rhs;",
            "    }",
            "    advected a in fluid as a_* by ad;",
            "    view b = ball(l) around -l*x at [x, -1, 0];",
            "}",
            "",
        ];
        assert_eq!(once, lines.join("\n"));
    }

    #[test]
    fn a_text_that_is_no_model_is_not_formatted() {
        let problems = format("rod.hamel", "model rod { param l = ; }").unwrap_err();
        assert!(problems.iter().count() == 1, "{problems}");
    }
}
