//! Functions on the torus as pictures, side by side at several times.
//!
//! Does not know: scenes, what the functions are.

use std::f64::consts::TAU;

use plotters::element::{PathElement, Rectangle, Text};
use plotters::style::text_anchor::{HPos, VPos};
use plotters::style::{Color, RGBColor};

use super::pen::{Area, Drawn, FRAME, INK, LEFT, QUIET, Ticks, WIDTH, at, font, stroke};

/// A function on the torus `[0, 2 pi)^2` over time, `f(x) = 2 sum (re_m cos(m.x) - im_m sin(m.x))`.
#[derive(Clone, Debug, Default)]
pub struct Field {
    /// What is shown, with the unit.
    pub title: String,
    /// The waves `m`.
    pub waves: Vec<(i64, i64)>,
    /// Times, and `re_m` and `im_m` for each wave.
    pub frames: Vec<(f64, Vec<f64>)>,
}

/// Pictures of a field in a figure.
pub const PICTURES: usize = 6;

const COLUMNS: usize = 3;
/// Cells along each side of a picture.
const CELLS: usize = 48;
/// Length of a cell.
const CELL: f64 = 5.0;
const SIDE: f64 = CELLS as f64 * CELL;
/// By so much a cell reaches into the next, drawn later, so that no white line is between them on any screen.
const OVERLAP: f64 = 0.6;
/// Room between pictures.
const BETWEEN: f64 = 14.0;
/// Room for a picture's time above it.
const CAPTION: f64 = 20.0;
/// Room for the title of the field.
const HEAD: f64 = 34.0;
/// Colours on each side of zero.
const LEVELS: i32 = 12;
const LOW: RGBColor = RGBColor(0, 114, 178);
const HIGH: RGBColor = RGBColor(213, 94, 0);

impl Field {
    /// Height on paper.
    pub(super) fn height(&self) -> f64 {
        let rows = self.frames.len().min(PICTURES).div_ceil(COLUMNS).max(1) as f64;
        HEAD + rows * (CAPTION + SIDE) + (rows - 1.0) * BETWEEN
    }

    /// Values at the centres of `n` by `n` cells; rows have one `x2`, the first row the smallest.
    fn values(&self, coefficients: &[f64], n: usize) -> Vec<f64> {
        let angle = |k: usize| TAU * (k as f64 + 0.5) / n as f64;
        let mut values = vec![0.0; n * n];
        for ((m1, m2), part) in self.waves.iter().zip(coefficients.chunks_exact(2)) {
            for (j, row) in values.chunks_exact_mut(n).enumerate() {
                for (i, value) in row.iter_mut().enumerate() {
                    let (sin, cos) = (*m1 as f64 * angle(i) + *m2 as f64 * angle(j)).sin_cos();
                    *value += 2.0 * (part[0] * cos - part[1] * sin);
                }
            }
        }
        values
    }

    /// The frames nearest to equal distances in time.
    fn shown(&self) -> Vec<&(f64, Vec<f64>)> {
        let last = self.frames.len().saturating_sub(1);
        let n = self.frames.len().min(PICTURES);
        (0..n).map(|k| &self.frames[k * last / (n - 1).max(1)]).collect()
    }

    pub(super) fn draw<'a>(&self, area: &Area<'a>, top: f64) -> Drawn<'a> {
        let label = |text: &str, x: f64, y: f64, size: f64, h: HPos, v: VPos, bold: bool| {
            area.draw(&Text::new(text.to_owned(), at(x, y), font(size, INK, bold, h, v)))
        };
        label(&self.title, LEFT, top + 14.0, 12.5, HPos::Left, VPos::Bottom, true)?;
        let shown = self.shown();
        let pictures: Vec<Vec<f64>> = shown.iter().map(|(_, c)| self.values(c, CELLS)).collect();
        let limit = pictures.iter().flatten().fold(0.0_f64, |max, x| max.max(x.abs()));
        let limit = if limit.is_finite() && limit > 0.0 { limit } else { 1.0 };
        let times = shown.iter().map(|(t, _)| *t);
        let ticks = Ticks::new(0.0, times.fold(0.0_f64, |max, t| max.max(t.abs())).max(1e-300), 100);
        for (k, (picture, (t, _))) in pictures.iter().zip(&shown).enumerate() {
            let (row, column) = ((k / COLUMNS) as f64, (k % COLUMNS) as f64);
            let x0 = LEFT + column * (SIDE + BETWEEN);
            let y0 = top + HEAD + CAPTION + row * (CAPTION + SIDE + BETWEEN);
            let time = match ticks.power_label() {
                Some(power) => format!("t = {} {power} s", ticks.label(*t)),
                None => format!("t = {} s", ticks.label(*t)),
            };
            label(&time, x0, y0 - 6.0, 11.0, HPos::Left, VPos::Bottom, false)?;
            for (j, cells) in picture.chunks_exact(CELLS).enumerate() {
                // The second coordinate goes up.
                let y = y0 + (CELLS - 1 - j) as f64 * CELL;
                let level = |i: usize| (cells[i] / limit * f64::from(LEVELS)).round() as i32;
                let mut from = 0;
                for i in 1..=CELLS {
                    if i < CELLS && level(i) == level(from) {
                        continue;
                    }
                    let (left, right) = (x0 + from as f64 * CELL, x0 + i as f64 * CELL + OVERLAP);
                    area.draw(&Rectangle::new(
                        [at(left, y), at(right.min(x0 + SIDE), (y + CELL + OVERLAP).min(y0 + SIDE))],
                        colour(level(from)).filled(),
                    ))?;
                    from = i;
                }
            }
            let (x1, y1) = (x0 + SIDE, y0 + SIDE);
            let corners = vec![at(x0, y0), at(x1, y0), at(x1, y1), at(x0, y1), at(x0, y0)];
            area.draw(&PathElement::new(corners, stroke(FRAME, 0.8)))?;
        }
        self.legend(area, top + HEAD + CAPTION, limit)
    }

    /// The colours and what they mean.
    fn legend<'a>(&self, area: &Area<'a>, top: f64, limit: f64) -> Drawn<'a> {
        let ticks = Ticks::new(-limit, limit, 4);
        let x = LEFT + COLUMNS as f64 * SIDE + (COLUMNS - 1) as f64 * BETWEEN + 12.0;
        let n = 2 * LEVELS + 1;
        let y_of = |value: f64| top + SIDE * (0.5 - 0.5 * value / limit);
        for k in 0..n {
            let y = |k: i32| top + SIDE * f64::from(k) / f64::from(n);
            area.draw(&Rectangle::new(
                [at(x, y(k)), at(x + 12.0, (y(k + 1) + OVERLAP).min(top + SIDE))],
                colour(LEVELS - k).filled(),
            ))?;
        }
        for value in &ticks.values {
            let style = font(11.0, INK, false, HPos::Left, VPos::Center);
            area.draw(&PathElement::new(
                vec![at(x + 12.0, y_of(*value)), at(x + 16.0, y_of(*value))],
                stroke(FRAME, 0.8),
            ))?;
            let room = WIDTH - (x + 19.0);
            debug_assert!(room > 0.0, "the legend is on the page");
            area.draw(&Text::new(ticks.label(*value), at(x + 19.0, y_of(*value)), style))?;
        }
        if let Some(power) = ticks.power_label() {
            let style = font(11.0, QUIET, false, HPos::Left, VPos::Bottom);
            area.draw(&Text::new(power, at(x, top - 5.0), style))?;
        }
        Ok(())
    }
}

/// From blue by white to orange.
fn colour(level: i32) -> RGBColor {
    let part = (f64::from(level) / f64::from(LEVELS)).clamp(-1.0, 1.0);
    let RGBColor(r, g, b) = if part < 0.0 { LOW } else { HIGH };
    let mixed = |c: u8| (255.0 + (f64::from(c) - 255.0) * part.abs()).round() as u8;
    RGBColor(mixed(r), mixed(g), mixed(b))
}

#[cfg(test)]
mod tests {
    use super::{Field, HIGH, LEVELS, LOW, colour};

    fn wave(frames: usize) -> Field {
        let frames = (0..frames).map(|k| (k as f64, vec![0.5, 0.0])).collect();
        Field { title: "Vorticity".into(), waves: vec![(1, 0)], frames }
    }

    #[test]
    fn a_single_wave_is_a_cosine() {
        let values = wave(1).values(&[0.5, 0.0], 8);
        for (k, value) in values.iter().enumerate() {
            let x = std::f64::consts::TAU * ((k % 8) as f64 + 0.5) / 8.0;
            assert!((value - x.cos()).abs() < 1e-14);
        }
        let sine = wave(1).values(&[0.0, -0.5], 8);
        assert!(sine[1] > 0.9 && sine[5] < -0.9, "{sine:?}");
    }

    #[test]
    fn both_ends_are_shown() {
        let field = wave(11);
        let times: Vec<f64> = field.shown().iter().map(|(t, _)| *t).collect();
        assert_eq!(times, [0.0, 2.0, 4.0, 6.0, 8.0, 10.0]);
        assert_eq!(wave(1).shown().len(), 1);
        assert!(wave(0).shown().is_empty());
    }

    #[test]
    fn colours_meet_in_white() {
        assert_eq!(colour(LEVELS), HIGH);
        assert_eq!(colour(-LEVELS), LOW);
        assert_eq!(colour(0), plotters::style::WHITE);
    }
}
