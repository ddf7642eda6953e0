//! Numbers as groups of horizontal bars on a logarithmic axis, in an SVG figure.
//!
//! Does not know: what the numbers are.

use plotters::element::{PathElement, Rectangle, Text};
use plotters::style::text_anchor::{HPos, VPos};
use plotters::style::{Color, RGBColor, ShapeStyle};

use super::pen::{Area, COLOURS, DrawError, Drawn, FRAME, GRID, INK, QUIET, WIDTH, at, drawn, font, stroke};

/// A figure.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bars {
    /// Large line at the top.
    pub title: String,
    /// Small line below it.
    pub subtitle: String,
    /// Label of the axis.
    pub x_label: String,
    /// Names of the bars of a group.
    pub series: Vec<String>,
    /// Groups with a positive value for each of the series, or nothing.
    pub groups: Vec<(String, Vec<Option<f64>>)>,
}

const LEFT: f64 = 168.0;
const RIGHT: f64 = 64.0;
const TOP: f64 = 104.0;
const BOTTOM: f64 = 52.0;
const BAR: f64 = 11.0;
const GAP: f64 = 12.0;

/// Draws a figure as the text of an SVG file.
///
/// # Errors
/// What the drawing backend says; it writes to memory and has no reason to fail.
pub fn svg(bars: &Bars) -> Result<String, DrawError> {
    let n_bars: usize = bars.groups.iter().map(|(_, values)| values.iter().flatten().count()).sum();
    let height = TOP + n_bars as f64 * BAR + bars.groups.len() as f64 * GAP + BOTTOM;
    drawn(height, |area| draw(area, bars, height))
}

fn fill(colour: RGBColor) -> ShapeStyle {
    ShapeStyle { color: colour.to_rgba(), filled: true, stroke_width: 0 }
}

fn text<'a>(
    line: &str,
    x: f64,
    y: f64,
    size: f64,
    colour: RGBColor,
    h: HPos,
) -> Text<'a, (i32, i32), String> {
    Text::new(line.to_owned(), at(x, y), font(size, colour, false, h, VPos::Center))
}

fn draw<'a>(area: &Area<'a>, bars: &Bars, height: f64) -> Drawn<'a> {
    let values = || bars.groups.iter().flat_map(|(_, values)| values.iter().flatten());
    // From a power of ten to one of these numbers times a power of ten.
    let least = values().fold(f64::INFINITY, |a, b| a.min(*b)).min(10.0);
    let largest = values().fold(least, |a, b| a.max(*b));
    let start = 10_f64.powf(least.log10().floor());
    let x = |value: f64| {
        let share = (value / start).log10() / (1.05 * largest / start).log10();
        LEFT + share * (WIDTH - LEFT - RIGHT)
    };
    let title = font(20.0, INK, true, HPos::Left, VPos::Center);
    area.draw(&Text::new(bars.title.clone(), at(24.0, 30.0), title))?;
    area.draw(&text(&bars.subtitle, 24.0, 54.0, 12.0, QUIET, HPos::Left))?;
    let mut at_x = 24.0;
    for (name, colour) in bars.series.iter().zip(COLOURS) {
        area.draw(&Rectangle::new([at(at_x, 75.0), at(at_x + 12.0, 87.0)], fill(colour)))?;
        area.draw(&text(name, at_x + 18.0, 81.0, 12.0, INK, HPos::Left))?;
        // There is no font to measure with; letters of this size are this wide on average.
        at_x += 46.0 + 6.2 * name.chars().count() as f64;
    }
    let (top, bottom) = (TOP, height - BOTTOM);
    let mut decade = start;
    while decade <= largest {
        for tick in [1.0, 2.0, 5.0].map(|k| k * decade).into_iter().filter(|t| *t <= 1.05 * largest) {
            area.draw(&PathElement::new([at(x(tick), top), at(x(tick), bottom)], stroke(GRID, 1.0)))?;
            area.draw(&text(&tick.to_string(), x(tick), bottom + 12.0, 12.0, QUIET, HPos::Center))?;
        }
        decade *= 10.0;
    }
    area.draw(&text(&bars.x_label, (LEFT + WIDTH - RIGHT) / 2.0, bottom + 34.0, 12.0, INK, HPos::Center))?;
    let mut y = top;
    for (name, values) in &bars.groups {
        y += GAP / 2.0;
        let n = values.iter().flatten().count() as f64;
        area.draw(&text(name, LEFT - 10.0, y + n * BAR / 2.0, 12.0, INK, HPos::Right))?;
        for (value, colour) in values.iter().zip(COLOURS) {
            let Some(value) = value else { continue };
            area.draw(&Rectangle::new([at(LEFT, y + 1.0), at(x(*value), y + BAR)], fill(colour)))?;
            let label = if *value < 20.0 { format!("{value:.1}") } else { format!("{value:.0}") };
            area.draw(&text(&label, x(*value) + 4.0, y + BAR / 2.0, 10.0, QUIET, HPos::Left))?;
            y += BAR;
        }
        y += GAP / 2.0;
    }
    area.draw(&PathElement::new([at(LEFT, top), at(LEFT, bottom)], stroke(FRAME, 1.0)))
}

#[cfg(test)]
mod tests {
    use super::{Bars, svg};

    #[test]
    fn every_value_has_a_bar_and_a_label() {
        let bars = Bars {
            title: "A & B".into(),
            series: vec!["one".into(), "two".into()],
            groups: vec![("g".into(), vec![Some(12.5), Some(700.0)]), ("h".into(), vec![None, Some(40.0)])],
            ..Bars::default()
        };
        let text = svg(&bars).unwrap();
        assert!(text.contains("A &amp; B") && text.trim_end().ends_with("</svg>"));
        for label in ["12.5", "700", "40", "100"] {
            assert!(text.contains(&format!("\n{label}\n")), "{label} in {text}");
        }
        assert!(svg(&Bars::default()).is_ok(), "no groups are no error");
    }
}
