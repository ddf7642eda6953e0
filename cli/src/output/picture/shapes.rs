//! The shapes of a figure that was drawn as SVG: lines, areas, letters as outlines, pictures.
//!
//! Knows the elements that figures of this program have. Does not know: pixels, pages.

use roxmltree::{Document, Node};

use super::letters;
use super::segment::Segment;

/// A figure.
#[derive(Debug)]
pub(super) struct Page {
    /// Width and height at which it is shown.
    pub(super) size: [f32; 2],
    /// What coordinates of shapes are multiplied by.
    pub(super) scale: f32,
    pub(super) shapes: Vec<Shape>,
}

/// A part of a figure, in the order in which they are drawn.
#[derive(Debug)]
pub(super) enum Shape {
    /// Curves with a colour, and with a width where they are not filled.
    Outline { path: Vec<Segment>, colour: [u8; 3], opacity: f32, width: Option<f32> },
    /// A picture as a PNG file, stretched over an area.
    Image { corner: [f32; 2], size: [f32; 2], file: Vec<u8> },
}

impl Page {
    /// # Errors
    /// An element that figures do not have: a fault of the program.
    pub(super) fn of(svg: &str) -> Result<Page, String> {
        let document = Document::parse(svg).map_err(|e| e.to_string())?;
        let root = document.root_element();
        let size = [number(root, "width")?, number(root, "height")?];
        let view: Vec<f32> = root
            .attribute("viewBox")
            .unwrap_or_default()
            .split_whitespace()
            .filter_map(|text| text.parse().ok())
            .collect();
        let scale = view.get(2).map_or(1.0, |width| size[0] / width);
        let mut page = Page { size, scale, shapes: Vec::new() };
        for node in root.children().filter(Node::is_element) {
            page.add(node)?;
        }
        Ok(page)
    }

    fn add(&mut self, node: Node<'_, '_>) -> Result<(), String> {
        match node.tag_name().name() {
            "text" => self.text(node),
            "image" => {
                let (_, data) =
                    link(node).and_then(|link| link.split_once("base64,")).ok_or("a picture without data")?;
                let file = decoded(data);
                let corner = [number(node, "x")?, number(node, "y")?];
                let size = [number(node, "width")?, number(node, "height")?];
                self.shapes.push(Shape::Image { corner, size, file });
                Ok(())
            }
            "rect" => {
                let [x, y, w, h] =
                    [number(node, "x")?, number(node, "y")?, number(node, "width")?, number(node, "height")?];
                self.outline(node, polygon(&[[x, y], [x + w, y], [x + w, y + h], [x, y + h]], true))
            }
            "circle" => {
                let [x, y, r] = [number(node, "cx")?, number(node, "cy")?, number(node, "r")?];
                self.outline(node, circle([x, y], r))
            }
            "line" => {
                let ends =
                    [[number(node, "x1")?, number(node, "y1")?], [number(node, "x2")?, number(node, "y2")?]];
                self.outline(node, polygon(&ends, false))
            }
            "polyline" => self.outline(node, polygon(&points(node), false)),
            "polygon" => self.outline(node, polygon(&points(node), true)),
            other => Err(format!("no element `{other}` is known of figures")),
        }
    }

    /// Fills and strokes what an element says.
    fn outline(&mut self, node: Node<'_, '_>, path: Vec<Segment>) -> Result<(), String> {
        let opacity = number(node, "opacity").unwrap_or(1.0);
        if let Some(colour) = colour(node, "fill")? {
            self.shapes.push(Shape::Outline { path: path.clone(), colour, opacity, width: None });
        }
        if let Some(colour) = colour(node, "stroke")? {
            let width = Some(number(node, "stroke-width").unwrap_or(1.0));
            self.shapes.push(Shape::Outline { path, colour, opacity, width });
        }
        Ok(())
    }

    fn text(&mut self, node: Node<'_, '_>) -> Result<(), String> {
        let (text, size) = (node.text().unwrap_or_default().trim(), number(node, "font-size")?);
        let is_bold = node.attribute("font-weight") == Some("bold");
        let shift = node.attribute("dy").unwrap_or("0em");
        let by = |unit: &str| shift.strip_suffix(unit).and_then(|text| text.parse::<f32>().ok());
        let down = match (by("em"), by("ex")) {
            (Some(x), _) => x * size,
            (None, Some(x)) => x * size * letters::X_HEIGHT,
            (None, None) => return Err(format!("no shift {shift:?} is known of texts")),
        };
        let width = letters::width(text) * size;
        let back = match node.attribute("text-anchor") {
            Some("middle") => width / 2.0,
            Some("end") => width,
            _ => 0.0,
        };
        let [x, y] = [number(node, "x")?, number(node, "y")?];
        let turn = Turn::of(node);
        let place = |[u, v]: [f32; 2]| turn.of_point([x - back + u * size, y + down - v * size]);
        let path: Vec<Segment> =
            letters::outlines(text).into_iter().map(|segment| moved(segment, &place)).collect();
        let opacity = number(node, "opacity").unwrap_or(1.0);
        let Some(colour) = colour(node, "fill")? else { return Ok(()) };
        // The letters are light: a line around them makes them regular, a wider one bold.
        let width = Some(size * if is_bold { 0.045 } else { 0.012 });
        self.shapes.push(Shape::Outline { path: path.clone(), colour, opacity, width: None });
        self.shapes.push(Shape::Outline { path, colour, opacity, width });
        Ok(())
    }
}

/// A turn about a point.
struct Turn {
    cos: f32,
    sin: f32,
    about: [f32; 2],
}

impl Turn {
    /// That of `transform="rotate(angle, x, y)"`, in degrees.
    fn of(node: Node<'_, '_>) -> Turn {
        let inner = node.attribute("transform").and_then(|text| text.strip_prefix("rotate("));
        let numbers: Vec<f32> = inner
            .map(|text| text.trim_end_matches(')').split(',').filter_map(|x| x.trim().parse().ok()).collect())
            .unwrap_or_default();
        match numbers.as_slice() {
            [angle, x, y] => {
                let (sin, cos) = angle.to_radians().sin_cos();
                Turn { cos, sin, about: [*x, *y] }
            }
            _ => Turn { cos: 1.0, sin: 0.0, about: [0.0, 0.0] },
        }
    }

    fn of_point(&self, [x, y]: [f32; 2]) -> [f32; 2] {
        let [u, v] = [x - self.about[0], y - self.about[1]];
        [self.about[0] + self.cos * u - self.sin * v, self.about[1] + self.sin * u + self.cos * v]
    }
}

fn moved(segment: Segment, place: &impl Fn([f32; 2]) -> [f32; 2]) -> Segment {
    match segment {
        Segment::Move(p) => Segment::Move(place(p)),
        Segment::Line(p) => Segment::Line(place(p)),
        Segment::Cubic(a, b, p) => Segment::Cubic(place(a), place(b), place(p)),
        Segment::Close => Segment::Close,
    }
}

fn polygon(points: &[[f32; 2]], is_closed: bool) -> Vec<Segment> {
    let mut path: Vec<Segment> = points.iter().map(|point| Segment::Line(*point)).collect();
    if let (Some(first), Some(point)) = (path.first_mut(), points.first()) {
        *first = Segment::Move(*point);
    }
    if is_closed {
        path.push(Segment::Close);
    }
    path
}

/// Four cubics, to 3 parts in 10,000 of the radius.
fn circle([x, y]: [f32; 2], r: f32) -> Vec<Segment> {
    const K: f32 = 0.552_284_8;
    let at = |u: f32, v: f32| [x + r * u, y + r * v];
    vec![
        Segment::Move(at(1.0, 0.0)),
        Segment::Cubic(at(1.0, K), at(K, 1.0), at(0.0, 1.0)),
        Segment::Cubic(at(-K, 1.0), at(-1.0, K), at(-1.0, 0.0)),
        Segment::Cubic(at(-1.0, -K), at(-K, -1.0), at(0.0, -1.0)),
        Segment::Cubic(at(K, -1.0), at(1.0, -K), at(1.0, 0.0)),
        Segment::Close,
    ]
}

fn points(node: Node<'_, '_>) -> Vec<[f32; 2]> {
    let pairs = node.attribute("points").unwrap_or_default().split_whitespace();
    let pair = |text: &str| -> Option<[f32; 2]> {
        let (x, y) = text.split_once(',')?;
        Some([x.parse().ok()?, y.parse().ok()?])
    };
    pairs.filter_map(pair).collect()
}

fn number(node: Node<'_, '_>, name: &str) -> Result<f32, String> {
    let text = node.attribute(name).unwrap_or_default();
    text.parse().map_err(|_| format!("{} has no number `{name}`", node.tag_name().name()))
}

/// The colour of an attribute, `#rrggbb`, unless it is absent or `none`.
fn colour(node: Node<'_, '_>, name: &str) -> Result<Option<[u8; 3]>, String> {
    match node.attribute(name) {
        None | Some("none") => Ok(None),
        Some(text) => {
            let digits = text.strip_prefix('#').filter(|digits| digits.len() == 6);
            let value = digits.and_then(|digits| u32::from_str_radix(digits, 16).ok());
            let [_, r, g, b] = value.ok_or_else(|| format!("{text:?} is no colour"))?.to_be_bytes();
            Ok(Some([r, g, b]))
        }
    }
}

fn link<'a>(node: Node<'a, '_>) -> Option<&'a str> {
    node.attributes().find(|attribute| attribute.name() == "href").map(|attribute| attribute.value())
}

/// The bytes of a text in base 64.
fn decoded(text: &str) -> Vec<u8> {
    let digit = |c: u8| match c {
        b'A'..=b'Z' => Some(c - b'A'),
        b'a'..=b'z' => Some(c - b'a' + 26),
        b'0'..=b'9' => Some(c - b'0' + 52),
        b'+' => Some(62),
        b'/' => Some(63),
        _ => None,
    };
    let digits: Vec<u32> = text.bytes().filter_map(digit).map(u32::from).collect();
    let mut bytes = Vec::with_capacity(digits.len() * 3 / 4);
    for group in digits.chunks(4) {
        let number = (0..4).fold(0, |n, k| n << 6 | group.get(k).copied().unwrap_or(0));
        bytes.extend(&number.to_be_bytes()[1..group.len().max(1)]);
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::super::super::plot::{Figure, Panel, svg};
    use super::{Page, Segment, Shape, decoded};

    #[test]
    fn base_64_comes_back() {
        for (text, bytes) in
            [("", &b""[..]), ("Zg==", b"f"), ("Zm8=", b"fo"), ("Zm9v", b"foo"), ("Zm9vYg==", b"foob")]
        {
            assert_eq!(decoded(text), bytes);
        }
    }

    #[test]
    fn every_element_of_a_figure_becomes_shapes_within_its_page() {
        let figure = Figure {
            title: "\u{393}\u{2081} & \u{3a9}\u{307}".into(),
            subtitle: "a, b".into(),
            x_label: "t [s]".into(),
            times: vec![0.0, 1.0, 2.0],
            panels: vec![Panel {
                title: "x [m]".into(),
                lines: vec![("x".into(), vec![0.0, 1e-5, -2e-5])],
                points: vec![vec![[0.5, 1e-5]]],
                points_name: "measured".into(),
                ..Panel::default()
            }],
            ..Figure::default()
        };
        let page = Page::of(&svg(&figure).unwrap()).unwrap();
        let edge = [page.size[0] / page.scale, page.size[1] / page.scale];
        let mut n_letters = 0;
        for shape in &page.shapes {
            let Shape::Outline { path, .. } = shape else { continue };
            n_letters += usize::from(path.len() > 20);
            for segment in path {
                if let Segment::Move([x, y]) | Segment::Line([x, y]) = segment {
                    assert!((0.0..=edge[0]).contains(x) && (0.0..=edge[1]).contains(y), "{x} {y} {edge:?}");
                }
            }
        }
        assert!(n_letters > 10, "{n_letters}");
    }
}
