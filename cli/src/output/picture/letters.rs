//! Outlines of letters, in units of the size of the letters, above the line from left to right.
//!
//! Does not know: figures.

use std::sync::LazyLock;

use epaint_default_fonts::{HACK_REGULAR, UBUNTU_LIGHT};
use ttf_parser::{Face, GlyphId, OutlineBuilder};

use super::segment::Segment;

/// Height of a small x.
pub(super) const X_HEIGHT: f32 = 0.52;

/// The letters, and those for what they lack.
static FACES: LazyLock<Vec<Face<'static>>> = LazyLock::new(|| {
    [UBUNTU_LIGHT, HACK_REGULAR].iter().filter_map(|font| Face::parse(font, 0).ok()).collect()
});

/// A character in the first face that has it, else the mark for an unknown one.
fn glyph(c: char) -> Option<(&'static Face<'static>, GlyphId)> {
    let found = FACES.iter().find_map(|face| Some((face, face.glyph_index(c)?)));
    found.or_else(|| FACES.first().map(|face| (face, GlyphId(0))))
}

/// What a character moves the next one by. Marks that stand above a letter move nothing.
fn advance(c: char) -> f32 {
    let is_above = ('\u{300}'..='\u{36f}').contains(&c);
    let of_glyph = glyph(c)
        .and_then(|(face, id)| Some(f32::from(face.glyph_hor_advance(id)?) / f32::from(face.units_per_em())));
    if is_above { 0.0 } else { of_glyph.unwrap_or(0.5) }
}

/// The width of a text.
pub(super) fn width(text: &str) -> f32 {
    text.chars().map(advance).sum()
}

/// The outlines of a text that begins at the origin.
pub(super) fn outlines(text: &str) -> Vec<Segment> {
    let (mut x, mut last) = (0.0, 0.0);
    let mut segments = Vec::new();
    for c in text.chars() {
        let step = advance(c);
        if let Some((face, id)) = glyph(c) {
            let scale = 1.0 / f32::from(face.units_per_em());
            let mut path = Outline { segments: Vec::new(), scale, x, at: [0.0; 2] };
            face.outline_glyph(id, &mut path);
            if step == 0.0 {
                path.above(x - last, last);
            }
            segments.extend(path.segments);
        }
        if step > 0.0 {
            last = step;
        }
        x += step;
    }
    segments
}

/// Collects the curves of a letter that stands at `x`.
struct Outline {
    segments: Vec<Segment>,
    scale: f32,
    x: f32,
    /// Where the curve is.
    at: [f32; 2],
}

impl Outline {
    fn place(&mut self, x: f32, y: f32) -> [f32; 2] {
        self.at = [self.x + x * self.scale, y * self.scale];
        self.at
    }

    /// Moves a mark into the middle above the letter before, which begins at `start` and is `width` wide.
    fn above(&mut self, start: f32, width: f32) {
        let ends = self.segments.iter().filter_map(|segment| match segment {
            Segment::Move([x, _]) | Segment::Line([x, _]) | Segment::Cubic(.., [x, _]) => Some(*x),
            Segment::Close => None,
        });
        let (low, high) = ends.fold((f32::MAX, f32::MIN), |(low, high), x| (low.min(x), high.max(x)));
        let by = start + width / 2.0 - (low + high) / 2.0;
        let shift = |p: &mut [f32; 2]| p[0] += by;
        for segment in &mut self.segments {
            match segment {
                Segment::Move(p) | Segment::Line(p) => shift(p),
                Segment::Cubic(a, b, p) => [a, b, p].into_iter().for_each(shift),
                Segment::Close => {}
            }
        }
    }
}

impl OutlineBuilder for Outline {
    fn move_to(&mut self, x: f32, y: f32) {
        let p = self.place(x, y);
        self.segments.push(Segment::Move(p));
    }

    fn line_to(&mut self, x: f32, y: f32) {
        let p = self.place(x, y);
        self.segments.push(Segment::Line(p));
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        let start = self.at;
        let control = self.place(x1, y1);
        let end = self.place(x, y);
        let part = |p: [f32; 2]| [0, 1].map(|k| p[k] + (control[k] - p[k]) * 2.0 / 3.0);
        self.segments.push(Segment::Cubic(part(start), part(end), end));
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        let (a, b) = (self.place(x1, y1), self.place(x2, y2));
        let end = self.place(x, y);
        self.segments.push(Segment::Cubic(a, b, end));
    }

    fn close(&mut self) {
        self.segments.push(Segment::Close);
    }
}

#[cfg(test)]
mod tests {
    use super::{glyph, outlines, width};

    /// Names of variables and numbers of axes in figures.
    #[test]
    fn letters_of_figures_are_there() {
        let text = "\u{393}\u{3a9}\u{3b1}\u{3b8}\u{3bb}\u{3bc}\u{3c9}\u{2080}\u{2081}\u{2089}\u{2070}\u{b9}\u{b2}\u{207b}\u{2212}\u{d7}\u{b7}\u{b1}\u{2026}";
        for c in text.chars().chain(' '..='~') {
            assert!(glyph(c).is_some_and(|(_, id)| id.0 != 0), "{c}");
        }
        assert!(width("mm") > width("ii") && (width("ab") - width("a") - width("b")).abs() < 1e-6);
        assert!(outlines(" ").is_empty() && !outlines("x\u{307}").is_empty());
        assert_eq!(width("x\u{307}"), width("x"));
    }
}
