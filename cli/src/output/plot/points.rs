//! Points in a plane, such as those where a motion crosses a section, in an SVG figure.
//!
//! Does not know: what the numbers are.

use plotters::element::{Circle, PathElement, Rectangle, Text};
use plotters::style::TextStyle;
use plotters::style::text_anchor::{HPos, VPos};

use super::pen::{
    Area, COLOURS, DrawError, Drawn, FRAME, GRID, INK, LEFT, QUIET, Ticks, WIDTH, at, drawn, font, scaled,
    stroke,
};

/// A figure.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Points {
    /// Large line at the top.
    pub title: String,
    /// Small line below it.
    pub subtitle: String,
    /// Labels of the axes.
    pub labels: [String; 2],
    /// Names and points, each cloud in a colour of its own; beyond the number of colours they repeat.
    pub clouds: Vec<(String, Vec<[f64; 2]>)>,
}

const RIGHT: f64 = 150.0;
const TOP: f64 = 78.0;
const FRAME_HEIGHT: f64 = 560.0;
const BOTTOM: f64 = 58.0;
const LEGEND_LINE: f64 = 21.0;
/// Radius of a point.
const RADIUS: f64 = 1.6;

/// Draws a figure as the text of an SVG file.
///
/// # Errors
/// What the drawing backend says; it writes to memory and has no reason to fail.
pub fn svg(figure: &Points) -> Result<String, DrawError> {
    drawn(TOP + FRAME_HEIGHT + BOTTOM, |area| draw(area, figure))
}

/// The range of an axis, a little wider than its values.
fn range(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let (low, high) = values
        .filter(|x| x.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
    if low > high {
        return [-1.0, 1.0];
    }
    let size = high.abs().max(low.abs());
    // Points that differ by rounding alone are one.
    let margin = if high - low > 1e-9 * size { 0.04 * (high - low) } else { (0.1 * size).max(1e-3) };
    [low - margin, high + margin]
}

fn draw<'a>(area: &Area<'a>, figure: &Points) -> Drawn<'a> {
    let label = |text: &str, x: f64, y: f64, style: TextStyle<'static>| {
        area.draw(&Text::new(text.to_owned(), at(x, y), style))
    };
    label(&figure.title, LEFT, 20.0, font(19.0, INK, true, HPos::Left, VPos::Top))?;
    label(&figure.subtitle, LEFT, 46.0, font(12.0, QUIET, false, HPos::Left, VPos::Top))?;
    let (right, bottom) = (WIDTH - RIGHT, TOP + FRAME_HEIGHT);
    let values = |axis: usize| figure.clouds.iter().flat_map(move |(_, p)| p.iter().map(move |p| p[axis]));
    let ([x0, x1], [y0, y1]) = (range(values(0)), range(values(1)));
    let x_of = |x: f64| LEFT + (x - x0) / (x1 - x0) * (right - LEFT);
    let y_of = |y: f64| bottom - (y - y0) / (y1 - y0) * FRAME_HEIGHT;
    let (x_ticks, y_ticks) = (Ticks::new(x0, x1, 7), Ticks::new(y0, y1, 7));
    for x in &x_ticks.values {
        area.draw(&PathElement::new(vec![at(x_of(*x), TOP), at(x_of(*x), bottom)], stroke(GRID, 0.7)))?;
        let style = font(11.0, INK, false, HPos::Center, VPos::Top);
        label(&x_ticks.label(*x), x_of(*x), bottom + 7.0, style)?;
    }
    for y in &y_ticks.values {
        area.draw(&PathElement::new(vec![at(LEFT, y_of(*y)), at(right, y_of(*y))], stroke(GRID, 0.7)))?;
        let style = font(11.0, INK, false, HPos::Right, VPos::Center);
        label(&y_ticks.label(*y), LEFT - 8.0, y_of(*y), style)?;
    }
    area.draw(&Rectangle::new([at(LEFT, TOP), at(right, bottom)], stroke(FRAME, 0.9)))?;
    // The power of ten that the labels of an axis leave out.
    let of_axis = |k: usize, ticks: &Ticks| match ticks.power_label() {
        Some(power) => format!("{} ({power})", figure.labels[k]),
        None => figure.labels[k].clone(),
    };
    let middle = 0.5 * (LEFT + right);
    let style = || font(12.0, INK, false, HPos::Center, VPos::Top);
    label(&of_axis(0, &x_ticks), middle, bottom + 28.0, style())?;
    label(&of_axis(1, &y_ticks), LEFT, TOP - 16.0, font(12.0, INK, false, HPos::Left, VPos::Top))?;
    for (k, (name, points)) in figure.clouds.iter().enumerate() {
        let colour = COLOURS[k % COLOURS.len()];
        let filled = plotters::style::ShapeStyle::from(&colour).filled();
        for [x, y] in points.iter().filter(|p| p.iter().all(|x| x.is_finite())) {
            area.draw(&Circle::new(at(x_of(*x), y_of(*y)), scaled(RADIUS), filled))?;
        }
        let line = TOP + 10.0 + LEGEND_LINE * k as f64;
        area.draw(&Circle::new(at(right + 18.0, line), scaled(3.0), filled))?;
        label(name, right + 30.0, line, font(12.0, INK, false, HPos::Left, VPos::Center))?;
    }
    Ok(())
}
