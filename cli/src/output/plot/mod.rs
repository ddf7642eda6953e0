//! Curves over time as small multiples in an SVG figure.
//!
//! Does not know: scenes, integrators.

pub mod bars;
pub mod field;
pub mod loglog;
mod pen;
mod png;
pub mod points;
mod surface;

use plotters::element::{Circle, PathElement, Polygon, Text};
use plotters::style::text_anchor::{HPos, VPos};
use plotters::style::{Color as _, ShapeStyle, TextStyle};

use field::Pictures;
pub use pen::DrawError;
use pen::{
    Area, COLOURS, Drawn, FRAME, GRID, INK, LEFT, QUIET, Ticks, WIDTH, at, drawn_over, font, scaled, stroke,
};
pub use surface::Surface;

/// A figure: panels one below the other over a common time axis.
#[derive(Clone, Debug, Default)]
pub struct Figure {
    /// Large line at the top.
    pub title: String,
    /// Small line below it.
    pub subtitle: String,
    /// Label of the time axis.
    pub x_label: String,
    /// Times of all samples.
    pub times: Vec<f64>,
    /// The panels.
    pub panels: Vec<Panel>,
    /// A path in a plane below the panels.
    pub path: Option<Path>,
    /// Functions over time, below everything else.
    pub fields: Vec<field::Field>,
}

/// A curve in a plane, drawn with the same scale along both axes.
#[derive(Clone, Debug, Default)]
pub struct Path {
    /// What is shown.
    pub title: String,
    /// Labels of the axes, with units.
    pub labels: [String; 2],
    /// Points in the order of time.
    pub points: Vec<[f64; 2]>,
}

/// Curves that share an axis.
#[derive(Clone, Debug, Default)]
pub struct Panel {
    /// What is shown, with the unit.
    pub title: String,
    /// Names and values.
    pub lines: Vec<(String, Vec<f64>)>,
    /// Times of the values when they are others than the figure's.
    pub times: Option<Vec<f64>>,
    /// Points beside the lines, each in the colour of the line at its place: times and values.
    pub points: Vec<Vec<[f64; 2]>>,
    /// Name of the points in the legend, where they have one.
    pub points_name: String,
    /// Whether values are logarithms to base ten.
    pub is_log: bool,
    /// Areas behind the lines, the widest first; what two of them share is darker.
    pub bands: Vec<Band>,
}

/// An area between two curves over the times of a figure.
#[derive(Clone, Debug, Default)]
pub struct Band {
    /// Lower values.
    pub low: Vec<f64>,
    /// Upper values.
    pub high: Vec<f64>,
}

const RIGHT: f64 = 96.0;
const TOP: f64 = 92.0;
const BOTTOM: f64 = 58.0;
const PANEL: f64 = 150.0;
const GAP: f64 = 44.0;
const LINE_HEIGHT: f64 = 17.0;
/// Height of the path's frame; wide and flat paths are lower.
const PATH: f64 = 330.0;
/// Room between the label of the time axis and the path's frame.
const PATH_GAP: f64 = 34.0;
/// Least distance of the path's ticks, the same for both axes.
const PATH_TICKS: f64 = 47.0;

/// Lines of at most so many points show each of them.
const MARKED: usize = 16;

/// Most curves of one panel.
pub const MAX_LINES: usize = COLOURS.len();

/// Draws a figure as the text of an SVG file.
///
/// # Errors
/// What the drawing backend says; it writes to memory and has no reason to fail.
pub fn svg(figure: &Figure) -> Result<String, DrawError> {
    let n_panels = figure.panels.len().max(1) as f64;
    let mut height = TOP + n_panels * PANEL + (n_panels - 1.0) * GAP + BOTTOM;
    if let Some(path) = &figure.path {
        height += PATH_GAP + Frame::of(path).height + BOTTOM;
    }
    let mut pictures = Vec::with_capacity(figure.fields.len());
    for field in &figure.fields {
        let shown = Pictures::new(field, height);
        height += shown.height() + PATH_GAP;
        pictures.push(shown);
    }
    let images: Vec<_> = pictures.iter().flat_map(Pictures::images).collect();
    drawn_over(height, &images, |area| draw(area, figure, &pictures))
}

fn draw<'a>(area: &Area<'a>, figure: &Figure, pictures: &[Pictures<'_>]) -> Drawn<'a> {
    let label = |text: &str, x: f64, y: f64, style: TextStyle<'static>| {
        area.draw(&Text::new(text.to_owned(), at(x, y), style))
    };
    let path = |points: Vec<(i32, i32)>, style: ShapeStyle| area.draw(&PathElement::new(points, style));
    label(&figure.title, LEFT, 20.0, font(19.0, INK, true, HPos::Left, VPos::Top))?;
    label(&figure.subtitle, LEFT, 46.0, font(12.0, QUIET, false, HPos::Left, VPos::Top))?;

    let (right, n_panels) = (WIDTH - RIGHT, figure.panels.len());
    let (t0, t1) = range_of(figure.times.iter().copied(), 0.0);
    let x_of = |t: f64| LEFT + (t - t0) / (t1 - t0) * (right - LEFT);
    let x_ticks = Ticks::new(t0, t1, 8);
    for (k, panel) in figure.panels.iter().enumerate() {
        let top = TOP + k as f64 * (PANEL + GAP);
        let bottom = top + PANEL;
        let of_points = panel.points.iter().flatten().map(|point| point[1]);
        let of_bands = panel.bands.iter().flat_map(|band| band.low.iter().chain(&band.high).copied());
        // What has no value is not drawn.
        let of_bands = of_bands.filter(|y| y.is_finite());
        let of_lines = panel.lines.iter().flat_map(|(_, y)| y.iter().copied());
        let all = of_lines.chain(of_points).chain(of_bands);
        let (low, high) = range_of(all, 0.06);
        let y_of = |y: f64| bottom - (y - low) / (high - low) * PANEL;
        let y_ticks = if panel.is_log { Ticks::of_powers(low, high, 5) } else { Ticks::new(low, high, 5) };

        for t in &x_ticks.values {
            path(vec![at(x_of(*t), top), at(x_of(*t), bottom)], stroke(GRID, 0.7))?;
        }
        for y in &y_ticks.values {
            let is_zero = *y == 0.0 && y_ticks.values.len() > 1 && !panel.is_log;
            let style = if is_zero { stroke(FRAME, 0.7) } else { stroke(GRID, 0.7) };
            path(vec![at(LEFT, y_of(*y)), at(right, y_of(*y))], style)?;
            path(vec![at(LEFT - 4.0, y_of(*y)), at(LEFT, y_of(*y))], stroke(FRAME, 0.8))?;
            let style = font(11.0, INK, false, HPos::Right, VPos::Center);
            label(&y_ticks.label(*y), LEFT - 7.0, y_of(*y), style)?;
        }
        label(&panel.title, LEFT, top - 7.0, font(12.5, INK, true, HPos::Left, VPos::Bottom))?;
        if let Some(power) = y_ticks.power_label() {
            label(&power, LEFT - 7.0, top - 7.0, font(11.0, INK, false, HPos::Right, VPos::Bottom))?;
        }

        for band in &panel.bands {
            let edge = |values: &[f64]| -> Vec<(i32, i32)> {
                let known = figure.times.iter().zip(values).filter(|(_, y)| y.is_finite());
                known.map(|(t, y)| at(x_of(*t), y_of(*y))).collect()
            };
            let (mut around, mut upper) = (edge(&band.low), edge(&band.high));
            upper.reverse();
            around.extend(upper);
            area.draw(&Polygon::new(around, COLOURS[0].mix(0.22).filled()))?;
        }
        for (points, colour) in panel.points.iter().zip(COLOURS.into_iter().cycle()) {
            let style = ShapeStyle { filled: false, ..stroke(colour, 0.9) };
            for [t, y] in points {
                area.draw(&Circle::new(at(x_of(*t), y_of(*y)), scaled(2.2), style))?;
            }
        }

        let n_names = panel.lines.len() + usize::from(!panel.points_name.is_empty());
        let mut legend_y = (top + bottom - n_names as f64 * LINE_HEIGHT) / 2.0 + LINE_HEIGHT / 2.0;
        if !panel.points_name.is_empty() {
            let style = ShapeStyle { filled: false, ..stroke(COLOURS[0], 0.9) };
            area.draw(&Circle::new(at(right + 22.0, legend_y), scaled(2.2), style))?;
            let style = font(12.5, INK, false, HPos::Left, VPos::Center);
            label(&panel.points_name, right + 38.0, legend_y, style)?;
            legend_y += LINE_HEIGHT;
        }
        for ((name, values), colour) in panel.lines.iter().zip(COLOURS.into_iter().cycle()) {
            let points: Vec<(i32, i32)> = panel
                .times
                .as_ref()
                .unwrap_or(&figure.times)
                .iter()
                .zip(values)
                // A line may lack values at times that another one has.
                .filter(|(_, y)| y.is_finite())
                .map(|(t, y)| at(x_of(*t), y_of(*y)))
                .collect();
            if points.len() <= MARKED {
                for point in &points {
                    area.draw(&Circle::new(
                        *point,
                        scaled(3.0),
                        ShapeStyle { filled: true, ..stroke(colour, 1.0) },
                    ))?;
                }
            }
            path(points, stroke(colour, 1.5))?;
            if !name.is_empty() {
                path(vec![at(right + 12.0, legend_y), at(right + 32.0, legend_y)], stroke(colour, 2.2))?;
                label(name, right + 38.0, legend_y, font(12.5, INK, false, HPos::Left, VPos::Center))?;
                legend_y += LINE_HEIGHT;
            }
        }
        if k + 1 == n_panels {
            for t in &x_ticks.values {
                path(vec![at(x_of(*t), bottom), at(x_of(*t), bottom + 4.0)], stroke(FRAME, 0.8))?;
                let style = font(11.0, INK, false, HPos::Center, VPos::Top);
                label(&x_ticks.label(*t), x_of(*t), bottom + 8.0, style)?;
            }
            let style = font(12.5, INK, false, HPos::Center, VPos::Top);
            label(&figure.x_label, (LEFT + right) / 2.0, bottom + 28.0, style)?;
        }
    }
    let n_panels = n_panels.max(1) as f64;
    let top = TOP + n_panels * PANEL + (n_panels - 1.0) * GAP + BOTTOM;
    if let Some(path) = &figure.path {
        draw_path(area, path, top + PATH_GAP)?;
    }
    pictures.iter().try_for_each(|pictures| pictures.draw(area))
}

/// Size of a path's frame on paper and the ranges it shows, with one scale for both axes.
struct Frame {
    width: f64,
    height: f64,
    x: (f64, f64),
    y: (f64, f64),
}

impl Frame {
    fn of(path: &Path) -> Frame {
        let widest = WIDTH - LEFT - RIGHT;
        let (x, y) = (
            range_of(path.points.iter().map(|p| p[0]), 0.06),
            range_of(path.points.iter().map(|p| p[1]), 0.06),
        );
        let ratio = (x.1 - x.0) / (y.1 - y.0);
        let width = (ratio * PATH).clamp(PATH, widest);
        let height = (width / ratio).clamp(PANEL, PATH);
        let unit = ((x.1 - x.0) / width).max((y.1 - y.0) / height);
        let around = |(low, high): (f64, f64), size: f64| {
            let middle = low + (high - low) / 2.0;
            (middle - size * unit / 2.0, middle + size * unit / 2.0)
        };
        Frame { width, height, x: around(x, width), y: around(y, height) }
    }
}

fn draw_path<'a>(area: &Area<'a>, path: &Path, top: f64) -> Drawn<'a> {
    let label = |text: &str, x: f64, y: f64, style: TextStyle<'static>| {
        area.draw(&Text::new(text.to_owned(), at(x, y), style))
    };
    let line = |points: Vec<(i32, i32)>, style: ShapeStyle| area.draw(&PathElement::new(points, style));
    let Frame { width, height, x: (x0, x1), y: (y0, y1) } = Frame::of(path);
    let (right, bottom) = (LEFT + width, top + height);
    let x_of = |x: f64| LEFT + (x - x0) / (x1 - x0) * width;
    let y_of = |y: f64| bottom - (y - y0) / (y1 - y0) * height;
    let x_ticks = Ticks::new(x0, x1, (width / PATH_TICKS) as usize);
    let y_ticks = Ticks::new(y0, y1, (height / PATH_TICKS) as usize);
    for x in &x_ticks.values {
        let style = if *x == 0.0 { stroke(FRAME, 0.7) } else { stroke(GRID, 0.7) };
        line(vec![at(x_of(*x), top), at(x_of(*x), bottom)], style)?;
        line(vec![at(x_of(*x), bottom), at(x_of(*x), bottom + 4.0)], stroke(FRAME, 0.8))?;
        let style = font(11.0, INK, false, HPos::Center, VPos::Top);
        label(&x_ticks.label(*x), x_of(*x), bottom + 8.0, style)?;
    }
    for y in &y_ticks.values {
        let style = if *y == 0.0 { stroke(FRAME, 0.7) } else { stroke(GRID, 0.7) };
        line(vec![at(LEFT, y_of(*y)), at(right, y_of(*y))], style)?;
        line(vec![at(LEFT - 4.0, y_of(*y)), at(LEFT, y_of(*y))], stroke(FRAME, 0.8))?;
        let style = font(11.0, INK, false, HPos::Right, VPos::Center);
        label(&y_ticks.label(*y), LEFT - 7.0, y_of(*y), style)?;
    }
    let with_power = |text: &str, ticks: &Ticks| match ticks.power_label() {
        Some(power) => format!("{text} {power}"),
        None => text.to_owned(),
    };
    label(&path.title, LEFT, top - 7.0, font(12.5, INK, true, HPos::Left, VPos::Bottom))?;
    let style = font(12.5, INK, false, HPos::Center, VPos::Top);
    label(&with_power(&path.labels[0], &x_ticks), LEFT + width / 2.0, bottom + 28.0, style)?;
    let style = font(12.5, INK, false, HPos::Center, VPos::Bottom);
    let style = style.transform(plotters::style::FontTransform::Rotate270);
    label(&with_power(&path.labels[1], &y_ticks), LEFT - 44.0, top + height / 2.0, style)?;

    let points: Vec<(i32, i32)> = path.points.iter().map(|p| at(x_of(p[0]), y_of(p[1]))).collect();
    let ends = [("start", points.first().copied()), ("end", points.last().copied())];
    line(points, stroke(COLOURS[0], 1.5))?;
    let mut legend_y = top + height / 2.0 - LINE_HEIGHT / 2.0;
    for (name, point) in ends {
        let style = ShapeStyle { filled: name == "end", ..stroke(COLOURS[1], 1.6) };
        let marks = point.into_iter().chain([at(right + 22.0, legend_y)]);
        for mark in marks {
            area.draw(&Circle::new(mark, scaled(4.0), style))?;
        }
        label(name, right + 38.0, legend_y, font(12.5, INK, false, HPos::Left, VPos::Center))?;
        legend_y += LINE_HEIGHT;
    }
    Ok(())
}

/// The interval of values with a margin; never empty.
fn range_of(values: impl Iterator<Item = f64>, margin: f64) -> (f64, f64) {
    let (low, high) = values
        .filter(|x| x.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
    if low > high {
        return (0.0, 1.0);
    }
    let size = low.abs().max(high.abs());
    // Round-off of a constant is no structure worth magnifying.
    if high - low <= 1e-12 * size || high == low {
        let half = if size == 0.0 { 1.0 } else { 0.1 * size };
        return (low - half, high + half);
    }
    (low - margin * (high - low), high + margin * (high - low))
}

#[cfg(test)]
mod tests {
    use super::field::Field;
    use super::pen::Ticks;
    use super::{Figure, Frame, Panel, Path, Surface, range_of, svg};

    #[test]
    fn ticks_are_round() {
        let ticks = Ticks::new(-1.07, 1.03, 4);
        assert_eq!(ticks.values.iter().map(|x| ticks.label(*x)).collect::<Vec<_>>(), ["−1", "0", "1"]);
        let ticks = Ticks::new(0.0, 10.0, 8);
        assert_eq!(ticks.values.len(), 6);
        let ticks = Ticks::new(-3.2e-12, 4.1e-12, 4);
        assert_eq!(ticks.power_label().as_deref(), Some("×10⁻¹²"));
        assert_eq!(ticks.label(2e-12), "2");
        assert_eq!(ticks.label(-0.0), "0");
    }

    #[test]
    fn ranges_are_never_empty() {
        assert_eq!(range_of([].into_iter(), 0.1), (0.0, 1.0));
        assert_eq!(range_of([0.0, 0.0].into_iter(), 0.1), (-1.0, 1.0));
        let (low, high) = range_of([2.0, 2.0 + 1e-15].into_iter(), 0.1);
        assert!(low < 1.9 && high > 2.1);
    }

    #[test]
    fn paths_have_one_scale() {
        for points in [[[0.0, 0.0], [1.0, 3.0]], [[-2.0, 1.0], [7.0, 1.5]], [[0.0, 0.0], [5.0, 0.0]]] {
            let frame = Frame::of(&Path { points: points.to_vec(), ..Path::default() });
            let (x, y) = ((frame.x.1 - frame.x.0) / frame.width, (frame.y.1 - frame.y.0) / frame.height);
            assert!((x / y - 1.0).abs() < 1e-12, "{x} {y}");
            for [x, y] in points {
                assert!(frame.x.0 < x && x < frame.x.1 && frame.y.0 < y && y < frame.y.1);
            }
        }
    }

    #[test]
    fn figures_have_their_size_and_all_curves() {
        let figure = Figure {
            title: "A & B".into(),
            times: vec![0.0, 1.0],
            panels: vec![Panel {
                title: "p".into(),
                lines: vec![("x".into(), vec![0.0, 1.0]), ("y".into(), vec![1.0, f64::MAX])],
                ..Panel::default()
            }],
            ..Figure::default()
        };
        let text = svg(&figure).unwrap();
        assert!(text.contains("width=\"920\""), "{}", &text[..200]);
        assert!(text.contains("A &amp; B"));
        assert!(text.trim_end().ends_with("</svg>"));
    }

    #[test]
    fn a_figure_has_a_picture_for_every_time_over_the_background() {
        let field = |surface: Surface, n: usize| {
            let frames = vec![(0.0, vec![0.5; n]), (1.0, vec![0.25; n])];
            Field { title: "Vorticity [1/s]".into(), unit: "1/s".into(), surface, frames }
        };
        let fields =
            vec![field(Surface::Torus { waves: vec![(1, 0)] }, 2), field(Surface::Sphere { n: 2 }, 3)];
        let text = svg(&Figure { fields, ..Figure::default() }).unwrap();
        assert_eq!(text.matches("Vorticity [1/s]").count(), 2);
        assert_eq!(text.matches("<image").count(), 4);
        let first = |shape: &str| text.find(shape).unwrap();
        assert!(first("<rect") < first("<image") && text.rfind("<image").unwrap() < first("<text"));
        // Pictures and lines are some ten thousand bytes each.
        assert!(text.len() < 200_000, "{}", text.len());
    }
}
