//! Places of a text as editors count them: lines from zero, columns in UTF-16 code units.
//!
//! Does not know: models, messages.

use hamel_codegen::spec::Span;
use lsp_types::{Position, Range};

/// Where the lines of a text begin.
#[derive(Clone, Debug)]
pub(crate) struct Lines<'t> {
    text: &'t str,
    starts: Vec<usize>,
}

impl<'t> Lines<'t> {
    pub(crate) fn new(text: &'t str) -> Lines<'t> {
        let after = text.match_indices('\n').map(|(at, _)| at + 1);
        Lines { text, starts: std::iter::once(0).chain(after).collect() }
    }

    /// The position of a byte; one within a character is that of the character, one behind the text that of its end.
    pub(crate) fn position(&self, offset: usize) -> Position {
        let mut offset = offset.min(self.text.len());
        while !self.text.is_char_boundary(offset) {
            offset -= 1;
        }
        let line = self.starts.partition_point(|start| *start <= offset) - 1;
        let character = self.text[self.starts[line]..offset].encode_utf16().count();
        Position::new(u32::try_from(line).unwrap_or(u32::MAX), u32::try_from(character).unwrap_or(u32::MAX))
    }

    /// The byte at a position; columns behind the end of a line are its end, as are lines behind the text.
    pub(crate) fn offset(&self, position: Position) -> usize {
        let line = usize::try_from(position.line).unwrap_or(usize::MAX);
        let Some(start) = self.starts.get(line).copied() else { return self.text.len() };
        let end = self.starts.get(line + 1).map_or(self.text.len(), |next| next - 1);
        let mut units = 0;
        for (at, c) in self.text[start..end].char_indices() {
            if units >= position.character as usize {
                return start + at;
            }
            units += c.len_utf16();
        }
        end
    }

    pub(crate) fn range(&self, span: Span) -> Range {
        Range::new(self.position(span.start), self.position(span.end))
    }

    /// The whole text.
    pub(crate) fn whole(&self) -> Range {
        Range::new(Position::new(0, 0), self.position(self.text.len()))
    }
}

#[cfg(test)]
mod tests {
    use lsp_types::Position;

    use super::Lines;

    #[test]
    fn columns_are_counted_in_utf_16() {
        // `Ω` is one unit and two bytes, the emoji two units and four bytes.
        let text = "a\n// Ω 🌀 b\r\nc";
        let lines = Lines::new(text);
        let b = text.find('b').unwrap();
        assert_eq!(lines.position(b), Position::new(1, 8));
        assert_eq!(lines.offset(Position::new(1, 8)), b);
        assert_eq!(lines.position(text.len()), Position::new(2, 1));
        assert_eq!(lines.offset(Position::new(2, 99)), text.len());
        assert_eq!(lines.offset(Position::new(9, 0)), text.len());
        assert_eq!(lines.offset(Position::new(0, 7)), 1);
        // Between the two units of the emoji, and between the bytes of the letter.
        assert_eq!(lines.offset(Position::new(1, 6)), text.find('🌀').unwrap() + 4);
        assert_eq!(lines.position(text.find('Ω').unwrap() + 1), Position::new(1, 3));
        for offset in (0..=text.len()).filter(|at| text.is_char_boundary(*at)) {
            if text.as_bytes().get(offset) != Some(&b'\n') {
                assert_eq!(lines.offset(lines.position(offset)), offset, "{offset}");
            }
        }
    }
}
