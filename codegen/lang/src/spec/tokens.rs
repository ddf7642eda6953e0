//! The tokens of any text, whether or not it is a model: what formatting and editors look at.
//!
//! Deliberately does not know: items, names, what a token means.

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// A name, a keyword, a number or a text.
    Word,
    /// Brackets, operators and the like.
    Mark,
    /// To the end of the line.
    LineComment,
    /// Between `/*` and `*/`.
    BlockComment,
}

/// A piece of text with what precedes it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Token<'t> {
    pub(super) kind: Kind,
    pub(super) text: &'t str,
    /// Where it begins.
    pub(super) start: usize,
    /// Line breaks before it.
    pub(super) n_breaks: usize,
    /// Whether there are blanks before it on its line.
    pub(super) has_blanks: bool,
    /// The blanks before it on its line.
    pub(super) blanks: &'t str,
}

impl Token<'_> {
    pub(super) fn is(&self, mark: &str) -> bool {
        self.kind == Kind::Mark && self.text == mark
    }

    pub(super) fn is_comment(&self) -> bool {
        matches!(self.kind, Kind::LineComment | Kind::BlockComment)
    }

    pub(super) fn opens(&self) -> bool {
        self.kind == Kind::Mark && matches!(self.text, "(" | "[" | "{")
    }

    pub(super) fn closes(&self) -> bool {
        self.kind == Kind::Mark && matches!(self.text, ")" | "]" | "}")
    }

    /// Whether an operand ends with it.
    pub(super) fn ends_operand(&self) -> bool {
        self.kind == Kind::Word || self.is(")") || self.is("]")
    }

    /// Whether an operand may begin with it.
    pub(super) fn begins_operand(&self) -> bool {
        self.kind == Kind::Word || self.is("(") || self.is("[") || self.is("-") || self.is("+")
    }
}

/// The length of the token at the beginning of a text that does not begin with a blank, and its kind.
fn measure(text: &str) -> (Kind, usize) {
    let bytes = text.as_bytes();
    let at = |k: usize| bytes.get(k).copied().unwrap_or(0);
    let is_word = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'_' || byte >= 0x80;
    match (at(0), at(1)) {
        (b'/', b'/') => (Kind::LineComment, text.find('\n').unwrap_or(text.len())),
        (b'/', b'*') => {
            let (mut depth, mut end) = (1_usize, 2);
            while depth > 0 && end < bytes.len() {
                let step = match (at(end), at(end + 1)) {
                    (b'/', b'*') => (depth + 1, 2),
                    (b'*', b'/') => (depth - 1, 2),
                    _ => (depth, 1),
                };
                (depth, end) = (step.0, end + step.1);
            }
            (Kind::BlockComment, end.min(text.len()))
        }
        (b'"', _) => {
            let mut end = 1;
            while end < bytes.len() && at(end) != b'"' {
                end += if at(end) == b'\\' { 2 } else { 1 };
            }
            (Kind::Word, (end + 1).min(text.len()))
        }
        (first, _) if first.is_ascii_digit() => {
            let mut end = 0;
            loop {
                let is_part = match at(end) {
                    b'.' => at(end + 1).is_ascii_digit(),
                    b'+' | b'-' => {
                        matches!(at(end.wrapping_sub(1)), b'e' | b'E') && at(end + 1).is_ascii_digit()
                    }
                    byte => is_word(byte),
                };
                if !is_part {
                    return (Kind::Word, end.max(1));
                }
                end += 1;
            }
        }
        (first, _) if is_word(first) => {
            let end = bytes.iter().position(|byte| !is_word(*byte)).unwrap_or(text.len());
            (Kind::Word, end)
        }
        (b'=' | b'!' | b'<' | b'>', b'=') | (b'.', b'.') | (b'-', b'>') | (b'&', b'&') | (b'|', b'|') => {
            (Kind::Mark, 2)
        }
        _ => (Kind::Mark, 1),
    }
}

/// The tokens of any text, comments among them; what belongs to no token stands alone as a mark.
pub(super) fn tokens(text: &str) -> Vec<Token<'_>> {
    let mut tokens = Vec::new();
    let mut rest = text;
    loop {
        let trimmed = rest.trim_start();
        let gap = &rest[..rest.len() - trimmed.len()];
        if trimmed.is_empty() {
            return tokens;
        }
        let (kind, length) = measure(trimmed);
        let (token, after) = trimmed.split_at(length);
        let blanks = gap.rsplit('\n').next().unwrap_or_default();
        tokens.push(Token {
            start: text.len() - trimmed.len(),
            kind,
            text: if kind == Kind::LineComment { token.trim_end() } else { token },
            n_breaks: gap.matches('\n').count(),
            has_blanks: !blanks.is_empty(),
            blanks,
        });
        rest = after;
    }
}
