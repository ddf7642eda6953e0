//! Curves through marked points on two logarithmic axes, in an SVG figure.
//!
//! Does not know: what the numbers are.

use plotters::element::{Circle, PathElement, Polygon, Rectangle, Text};
use plotters::style::text_anchor::{HPos, VPos};
use plotters::style::{RGBColor, ShapeStyle};

use super::pen::{
    Area, COLOURS, DrawError, Drawn, FRAME, GRID, INK, QUIET, WIDTH, at, drawn, font, scaled, stroke,
};

/// A figure.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LogLog {
    /// Large line at the top.
    pub title: String,
    /// Small line below it.
    pub subtitle: String,
    /// Labels of the axes.
    pub labels: [String; 2],
    /// The curves in the order of the legend.
    pub curves: Vec<Curve>,
}

/// A curve.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Curve {
    /// Name in the legend.
    pub name: String,
    /// Whether it is drawn with broken lines and open marks, apart from the others of its colour.
    pub broken: bool,
    /// Points in order; those with a coordinate that is not positive and finite are left out.
    pub points: Vec<[f64; 2]>,
}

const LEFT: f64 = 76.0;
const RIGHT: f64 = 264.0;
const TOP: f64 = 78.0;
const FRAME_HEIGHT: f64 = 460.0;
const BOTTOM: f64 = 58.0;
const LEGEND_LINE: f64 = 21.0;
/// Further colours than those of lines over time: more methods are compared than lines are drawn in one panel.
const MORE_COLOURS: [RGBColor; 5] = [
    RGBColor(170, 15, 60),
    RGBColor(110, 150, 0),
    RGBColor(0, 80, 90),
    RGBColor(235, 140, 130),
    RGBColor(230, 180, 0),
];
/// Number of the colours of curves.
const N_COLOURS: usize = COLOURS.len() + MORE_COLOURS.len();

/// The form of the points of a curve.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Mark {
    Circle,
    Square,
    Triangle,
}

/// Colour and mark of the curve of a number: no two of the first `3 N_COLOURS` look alike.
fn appearance(number: usize) -> (RGBColor, Mark) {
    let place = number % N_COLOURS;
    let colour = COLOURS.get(place).unwrap_or_else(|| &MORE_COLOURS[place - COLOURS.len()]);
    let marks = [Mark::Circle, Mark::Square, Mark::Triangle];
    (*colour, marks[number / N_COLOURS % marks.len()])
}

/// Length and distance of the strokes of a broken line.
const STROKE: [f64; 2] = [5.0, 4.0];

/// Draws a figure as the text of an SVG file.
///
/// # Errors
/// What the drawing backend says; it writes to memory and has no reason to fail.
pub fn svg(figure: &LogLog) -> Result<String, DrawError> {
    drawn(TOP + FRAME_HEIGHT + BOTTOM, |area| draw(area, figure))
}

fn usable(point: &[f64; 2]) -> bool {
    point.iter().all(|x| x.is_finite() && *x > 0.0)
}

/// Whole decades around the values of an axis.
fn decades(values: impl Iterator<Item = f64>) -> (i32, i32) {
    let (low, high) =
        values.map(f64::log10).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
    if low > high {
        return (0, 1);
    }
    let low = low.floor() as i32;
    (low, (high.ceil() as i32).max(low + 1))
}

/// A power of ten as people write it.
fn power(exponent: i32) -> String {
    match exponent {
        -2..=4 => format!("{}", 10_f64.powi(exponent)),
        _ => format!("1e{exponent}").replace('-', "\u{2212}"),
    }
}

fn line<'a>(area: &Area<'a>, points: &[(f64, f64)], broken: bool, style: ShapeStyle) -> Drawn<'a> {
    let segment =
        |a: (f64, f64), b: (f64, f64)| area.draw(&PathElement::new([at(a.0, a.1), at(b.0, b.1)], style));
    // Where the pattern stands: whole periods are passed over.
    let mut phase = 0.0;
    for pair in points.windows(2) {
        let ((x0, y0), (x1, y1)) = (pair[0], pair[1]);
        if !broken {
            segment(pair[0], pair[1])?;
            continue;
        }
        let length = (x1 - x0).hypot(y1 - y0);
        let on = |s: f64| (x0 + s / length * (x1 - x0), y0 + s / length * (y1 - y0));
        let mut from = 0.0;
        while from < length {
            let rest = if phase < STROKE[0] { STROKE[0] - phase } else { STROKE[0] + STROKE[1] - phase };
            let to = (from + rest).min(length);
            if phase < STROKE[0] {
                segment(on(from), on(to))?;
            }
            phase = if to < length { (phase + rest) % (STROKE[0] + STROKE[1]) } else { phase + to - from };
            from = to;
        }
    }
    Ok(())
}

fn draw<'a>(area: &Area<'a>, figure: &LogLog) -> Drawn<'a> {
    let label = |text: &str, x: f64, y: f64, size: f64, colour: RGBColor, h: HPos, v: VPos| {
        area.draw(&Text::new(text.to_owned(), at(x, y), font(size, colour, false, h, v)))
    };
    let points = || figure.curves.iter().flat_map(|c| c.points.iter().filter(|p| usable(p)));
    let ((x0, x1), (y0, y1)) = (decades(points().map(|p| p[0])), decades(points().map(|p| p[1])));
    let (right, bottom) = (WIDTH - RIGHT, TOP + FRAME_HEIGHT);
    let x = |value: f64| LEFT + (value.log10() - f64::from(x0)) / f64::from(x1 - x0) * (right - LEFT);
    let y = |value: f64| bottom - (value.log10() - f64::from(y0)) / f64::from(y1 - y0) * FRAME_HEIGHT;
    area.draw(&Text::new(
        figure.title.clone(),
        at(LEFT, 18.0),
        font(19.0, INK, true, HPos::Left, VPos::Top),
    ))?;
    label(&figure.subtitle, LEFT, 44.0, 12.0, QUIET, HPos::Left, VPos::Top)?;
    for exponent in x0..=x1 {
        let x = x(10_f64.powi(exponent));
        area.draw(&PathElement::new([at(x, TOP), at(x, bottom)], stroke(GRID, 0.8)))?;
        label(&power(exponent), x, bottom + 8.0, 11.0, INK, HPos::Center, VPos::Top)?;
    }
    for exponent in y0..=y1 {
        for factor in 1..10 {
            let value = f64::from(factor) * 10_f64.powi(exponent);
            if factor > 1 && exponent == y1 {
                break;
            }
            let style = stroke(GRID, if factor == 1 { 1.0 } else { 0.4 });
            area.draw(&PathElement::new([at(LEFT, y(value)), at(right, y(value))], style))?;
        }
        label(&power(exponent), LEFT - 7.0, y(10_f64.powi(exponent)), 11.0, INK, HPos::Right, VPos::Center)?;
    }
    let frame = [(LEFT, TOP), (LEFT, bottom), (right, bottom)];
    area.draw(&PathElement::new(frame.map(|(x, y)| at(x, y)), stroke(FRAME, 1.0)))?;
    label(&figure.labels[0], (LEFT + right) / 2.0, bottom + 30.0, 12.5, INK, HPos::Center, VPos::Top)?;
    let style = font(12.5, INK, false, HPos::Center, VPos::Bottom);
    let style = style.transform(plotters::style::FontTransform::Rotate270);
    area.draw(&Text::new(figure.labels[1].clone(), at(LEFT - 46.0, TOP + FRAME_HEIGHT / 2.0), style))?;
    // Colours and marks begin anew with the broken curves.
    let mut used = [0, 0];
    let mut legend_y = TOP + 10.0;
    for curve in &figure.curves {
        let (colour, mark) = appearance(used[usize::from(curve.broken)]);
        used[usize::from(curve.broken)] += 1;
        let marked: Vec<(f64, f64)> =
            curve.points.iter().filter(|p| usable(p)).map(|p| (x(p[0]), y(p[1]))).collect();
        line(area, &marked, curve.broken, stroke(colour, 1.5))?;
        line(area, &[(right + 14.0, legend_y), (right + 42.0, legend_y)], curve.broken, stroke(colour, 1.5))?;
        for (x, y) in marked.into_iter().chain([(right + 28.0, legend_y)]) {
            let style = ShapeStyle { filled: !curve.broken, ..stroke(colour, 1.2) };
            match mark {
                Mark::Circle => area.draw(&Circle::new(at(x, y), scaled(2.6), style))?,
                Mark::Square => {
                    area.draw(&Rectangle::new([at(x - 2.4, y - 2.4), at(x + 2.4, y + 2.4)], style))?
                }
                Mark::Triangle => {
                    let corners = [at(x, y - 3.2), at(x + 3.0, y + 2.2), at(x - 3.0, y + 2.2)];
                    if style.filled {
                        area.draw(&Polygon::new(corners, style))?;
                    } else {
                        area.draw(&PathElement::new(
                            [corners[0], corners[1], corners[2], corners[0]],
                            style,
                        ))?;
                    }
                }
            }
        }
        label(&curve.name, right + 50.0, legend_y, 12.0, INK, HPos::Left, VPos::Center)?;
        legend_y += LEGEND_LINE;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::{Curve, LogLog, Mark, N_COLOURS, appearance, decades, power, svg};
    use hamel_run::method::MethodName;

    #[test]
    fn no_two_curves_look_alike() {
        let looks: Vec<_> = (0..3 * N_COLOURS).map(appearance).collect();
        for (k, look) in looks.iter().enumerate() {
            assert!(!looks[..k].contains(look), "{k}: {look:?}");
        }
        // One colour for each method of a report, so that `tsit5` and `projected` do not share theirs.
        for k in 0..MethodName::all().filter(|method| method.evaluates_rates_alone()).count() {
            assert!(looks[..k].iter().all(|look| look.0 != looks[k].0), "{k}");
            assert_eq!(looks[k].1, Mark::Circle);
        }
        let points = vec![[1e-6, 3.0]];
        let curve = |k: usize| Curve { name: format!("{k}"), broken: k % 2 == 1, points: points.clone() };
        let text =
            svg(&LogLog { curves: (0..6 * N_COLOURS).map(curve).collect(), ..LogLog::default() }).unwrap();
        // A circle of each colour, filled and open, and its double in the legend; squares of both kinds.
        assert_eq!(text.matches("<circle").count(), 2 * 2 * N_COLOURS);
        let (squares, triangles) = (text.matches("<rect").count(), text.matches("<polygon").count());
        assert!(squares >= 2 * 2 * N_COLOURS && triangles >= 2 * N_COLOURS);
    }

    #[test]
    fn all_usable_points_are_marked_within_whole_decades() {
        assert_eq!(decades([3e-13, 0.02].into_iter()), (-13, -1));
        assert_eq!(decades([1.0].into_iter()), (0, 1));
        assert_eq!([power(-12), power(-1), power(3)], ["1e\u{2212}12", "0.1", "1000"]);
        let points = vec![[1e-6, 3.0], [1e-9, 30.0], [0.0, 40.0]];
        let curves =
            [false, true].map(|broken| Curve { name: "A & B".into(), broken, points: points.clone() });
        let text = svg(&LogLog { curves: curves.into(), ..LogLog::default() }).unwrap();
        assert_eq!(text.matches("<circle").count(), 6, "two points of each curve and a mark in the legend");
        assert!(text.contains("A &amp; B") && text.trim_end().ends_with("</svg>"));
        assert!(svg(&LogLog::default()).is_ok(), "no curves are no error");
    }
}
