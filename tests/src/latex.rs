//! What pdflatex would refuse of a fragment that needs `amsmath`, or set as what it is not: found by reading it.
//!
//! Deliberately does not know: what the fragment says.

/// Commands that stand for a sign or a letter, and those that take groups.
const COMMANDS: &str = "alpha beta gamma delta varepsilon epsilon zeta eta theta iota kappa lambda mu nu xi pi rho sigma tau \
    upsilon phi varphi chi psi omega Gamma Delta Theta Lambda Xi Pi Sigma Upsilon Phi Psi Omega \
    dot ddot dddot frac tfrac sqrt mathrm mathbf text left right sin cos tan arcsin arccos arctan exp ln log sinh cosh tanh \
    operatorname cdot times div pm quad qquad ldots dots langle rangle supset subset to mapsto le ge ne approx equiv in \
    infty partial nabla int sum bar surd circ oplus otimes \
    section subsection allowdisplaybreaks begin end textstyle textbackslash ae S";

/// What is read as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    Text,
    /// Between dollars.
    Inline,
    /// In `align*`, where `&` and line ends separate cells.
    Display,
}

/// What is wrong with a fragment, with the line.
pub fn problems(text: &str) -> Vec<String> {
    let mut reader = Reader { chars: text.chars().collect(), at: 0, line: 1, problems: Vec::new() };
    reader.read(Mode::Text, None);
    if reader.at < reader.chars.len() {
        reader.problem("a brace closes nothing");
    }
    reader.problems
}

struct Reader {
    chars: Vec<char>,
    at: usize,
    line: usize,
    problems: Vec<String>,
}

/// Scripts that the last thing in a formula has.
#[derive(Default)]
struct Scripts {
    has_lower: bool,
    has_upper: bool,
}

impl Reader {
    fn problem(&mut self, what: &str) {
        let start = self.at.saturating_sub(40);
        let around: String = self.chars[start..(self.at + 40).min(self.chars.len())].iter().collect();
        self.problems.push(format!("line {}: {what} in {around:?}", self.line));
    }

    fn peek(&self) -> Option<char> {
        self.chars.get(self.at).copied()
    }

    fn next(&mut self) -> Option<char> {
        let c = self.peek()?;
        self.at += 1;
        self.line += usize::from(c == '\n');
        Some(c)
    }

    /// Reads a group after its brace, a formula after its dollar, or an environment after its beginning, up to and with
    /// its end; without an end all of it.
    fn read(&mut self, mode: Mode, end: Option<&str>) {
        let mut scripts = Scripts::default();
        let (mut n_open, mut letters) = (0_usize, 0_usize);
        while let Some(c) = self.peek() {
            if c == '}' && end != Some("}") {
                if end.is_some() {
                    self.problem("a brace closes nothing");
                }
                return;
            }
            self.next();
            letters = if c.is_ascii_alphabetic() && mode != Mode::Text { letters + 1 } else { 0 };
            if letters == 3 {
                self.problem("a word in a formula");
            }
            match c {
                '}' => return self.closed(n_open),
                '$' if end == Some("$") => return self.closed(n_open),
                '$' if mode == Mode::Text => self.read(Mode::Inline, Some("$")),
                '$' => self.problem("a dollar in a formula"),
                '{' => self.read(mode, Some("}")),
                '\\' => {
                    if let Some(ended) = self.command(mode, end, &mut n_open) {
                        if ended {
                            return self.closed(n_open);
                        }
                    } else {
                        continue;
                    }
                }
                '_' | '^' | '\'' if mode != Mode::Text => {
                    let has = if c == '_' { &mut scripts.has_lower } else { &mut scripts.has_upper };
                    if std::mem::replace(has, true) {
                        self.problem("two scripts at one place");
                    }
                    if c != '\'' {
                        self.script(mode);
                    }
                    continue;
                }
                '_' | '^' | '<' | '>' | '|' if mode == Mode::Text => {
                    self.problem("a sign of formulas in a text")
                }
                '&' if mode == Mode::Display && end != Some("}") => self.closed(std::mem::take(&mut n_open)),
                '&' | '#' | '%' | '~' => self.problem("a sign that is a command"),
                '\n' if mode == Mode::Inline => self.problem("a formula over two lines"),
                c if c.is_ascii() => {}
                c if mode == Mode::Text && is_latin(c) => {}
                _ => self.problem("a character that pdflatex lacks"),
            }
            if c != ' ' {
                scripts = Scripts::default();
            }
        }
        if end.is_some() {
            self.problem("the end is missing");
        }
    }

    fn closed(&mut self, n_open: usize) {
        if n_open > 0 {
            self.problem("`\\left` without its `\\right`");
        }
    }

    /// The argument of a script.
    fn script(&mut self, mode: Mode) {
        match self.next() {
            Some('{') => self.read(mode, Some("}")),
            Some('\\') => _ = self.command(mode, None, &mut 0),
            Some(c) if c.is_ascii_alphanumeric() || c == '-' || c == '*' || c == '\'' => {}
            _ => self.problem("a script of nothing"),
        }
    }

    /// Reads a command after its backslash; whether it has ended what is read, none where it changes nothing.
    fn command(&mut self, mode: Mode, end: Option<&str>, n_open: &mut usize) -> Option<bool> {
        let mut name = String::new();
        while let Some(c) = self.peek().filter(char::is_ascii_alphabetic) {
            name.push(c);
            self.next();
        }
        if name.is_empty() {
            return match self.next() {
                Some('\\') if mode == Mode::Display && end != Some("}") => {
                    self.closed(std::mem::take(n_open));
                    Some(false)
                }
                Some('_' | '&' | '%' | '#' | '{' | '}' | '$') => Some(false),
                Some('^' | '~') if mode == Mode::Text => Some(false),
                Some(',' | ';' | ' ' | '!') if mode != Mode::Text => None,
                _ => {
                    self.problem("an unknown command");
                    None
                }
            };
        }
        if !COMMANDS.split_whitespace().any(|known| known == name) {
            self.problem(&format!("the unknown command \\{name}"));
        }
        match name.as_str() {
            "left" | "right" => {
                *n_open = if name == "left" { *n_open + 1 } else { n_open.saturating_sub(1) };
                match self.next() {
                    Some('(' | ')' | '[' | ']' | '|' | '.') => {}
                    Some('\\') if matches!(self.next(), Some('{' | '}')) => {}
                    _ => self.problem("a bracket of no kind"),
                }
            }
            "text" | "operatorname" | "mathrm" => match self.next() {
                Some('{') => self.read(Mode::Text, Some("}")),
                _ => self.problem("a command without its group"),
            },
            "section" | "subsection" => {
                let star = self.next();
                match (star, self.next()) {
                    (Some('*'), Some('{')) => self.read(Mode::Text, Some("}")),
                    _ => self.problem("a title without its group"),
                }
            }
            "begin" | "end" => {
                let environment = self.word();
                match (name.as_str(), environment.as_str()) {
                    ("begin", "align*") if mode == Mode::Text => self.read(Mode::Display, Some("align*")),
                    ("begin", "verbatim") if mode == Mode::Text => self.verbatim(),
                    ("end", ended) if end == Some(ended) => return Some(true),
                    _ => self.problem("an environment at a wrong place"),
                }
            }
            _ if mode == Mode::Text
                && !["textbackslash", "ldots", "ae", "S", "allowdisplaybreaks"].contains(&name.as_str()) =>
            {
                self.problem("a command of formulas in a text");
            }
            _ => {}
        }
        Some(false)
    }

    /// The name in braces that follows.
    fn word(&mut self) -> String {
        let mut name = String::new();
        if self.next() == Some('{') {
            while let Some(c) = self.next().filter(|c| *c != '}') {
                name.push(c);
            }
        }
        name
    }

    fn verbatim(&mut self) {
        let end: Vec<char> = "\\end{verbatim}".chars().collect();
        while !self.chars[self.at..].starts_with(&end) {
            match self.next() {
                Some(c) if c.is_ascii() || is_latin(c) => {}
                Some(_) => self.problem("a character that pdflatex lacks"),
                None => return self.problem("the end is missing"),
            }
        }
        self.at += end.len();
    }
}

/// Letters with accents that every font of pdflatex has.
fn is_latin(c: char) -> bool {
    matches!(c, 'À'..='Å' | 'Ç'..='Ï' | 'Ñ'..='Ö' | 'Ø'..='Ý' | 'ß'..='å' | 'ç'..='ï' | 'ñ'..='ö' | 'ø'..='ý' | 'ÿ')
        || "ĆćČčěŁłńőřŚśŠšűůźŽž".contains(c)
}

#[cfg(test)]
mod tests {
    use super::problems;

    #[test]
    fn what_compiles_has_no_problem() {
        let text = "\\section*{A\\_b: 5\\% \\& $x$}\n\\allowdisplaybreaks\nPoincaré, $\\xi_{1}^{2}$ $<$ 3.\n\
            \\begin{align*}\n  \\dot{x} &= \\left(a_{1} + \\frac{b}{c}\\right)^{2} \\quad\\text{a word [m/s$^2$]} \\\\\n  \
            y &= \\sin\\left(\\phi\\right)\n\\end{align*}\n\\begin{verbatim}\n_ & {\n\\end{verbatim}\n";
        assert_eq!(problems(text), [""; 0]);
    }

    #[test]
    fn what_does_not_compile_has_one() {
        let cases = [
            ("a_b", "a sign of formulas in a text"),
            ("$a", "the end is missing"),
            ("$a_1_2$", "two scripts"),
            ("$a_{1}^2^3$", "two scripts"),
            ("$power of x$", "a word in a formula"),
            ("$\\left(a$", "`\\left` without"),
            ("\\begin{align*}\n a &= \\left(b \\\\\n c &= d\\right)\n\\end{align*}", "`\\left` without"),
            ("\\begin{align*}\n a &= $b$\n\\end{align*}", "a dollar in a formula"),
            ("\\begin{align*}\n a", "the end is missing"),
            ("\\end{align*}", "an environment at a wrong place"),
            ("ω", "a character that pdflatex lacks"),
            ("$ω$", "a character that pdflatex lacks"),
            ("a & b", "a sign that is a command"),
            ("{a", "the end is missing"),
            ("a}", "a brace closes nothing"),
            ("$\\foo$", "the unknown command"),
            ("\\alpha", "a command of formulas in a text"),
            ("$a_$", "a script of nothing"),
        ];
        for (text, problem) in cases {
            let found = problems(text);
            assert!(found.iter().any(|p| p.contains(problem)), "{text}: {found:?}");
        }
    }
}
