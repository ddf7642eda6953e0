//! Functions on the torus and on the sphere as pictures, side by side at several times.
//!
//! Does not know: scenes, what the functions are, how their values are computed.

use std::f64::consts::PI;

use plotters::element::{PathElement, Rectangle, Text};
use plotters::style::text_anchor::{HPos, VPos};
use plotters::style::{Color, RGBColor};

use super::pen::{Area, Drawn, FRAME, INK, Image, LEFT, QUIET, Ticks, WIDTH, at, font, stroke};
use super::png::png;
use super::surface::{Grid, Surface, mollweide};

/// A function on a surface over time.
#[derive(Clone, Debug)]
pub struct Field {
    /// What is shown, with the unit.
    pub title: String,
    /// The unit alone; may be empty.
    pub unit: String,
    /// Where the function is.
    pub surface: Surface,
    /// Times, and the coefficients of the function.
    pub frames: Vec<(f64, Vec<f64>)>,
}

/// Pictures of a field in a figure.
pub const PICTURES: usize = 6;

/// Width of all pictures of a row, with what is between them.
const ROW: f64 = 748.0;
/// Room between pictures.
const BETWEEN: f64 = 14.0;
/// Room for a picture's time above it.
const CAPTION: f64 = 20.0;
/// Room for the title of the field.
const HEAD: f64 = 34.0;
/// Width of the scale of colours.
const SCALE_WIDTH: f64 = 12.0;
/// By so much a colour of the scale reaches into the next, drawn later, so that no white line is between them.
const OVERLAP: f64 = 0.6;
/// Colours on each side of zero: neighbours differ by less than an eye sees.
const LEVELS: i32 = 40;
/// Colours at zero, at six tenths of the largest value and at the largest, on both sides.
const LOW: [RGBColor; 3] = [WHITE, RGBColor(0, 114, 178), RGBColor(0, 36, 74)];
const HIGH: [RGBColor; 3] = [WHITE, RGBColor(213, 94, 0), RGBColor(94, 26, 0)];
const WHITE: RGBColor = RGBColor(255, 255, 255);
/// Where the middle one of these stands.
const BEND: f64 = 0.6;

/// A field as it stands in a figure.
pub(super) struct Pictures<'f> {
    field: &'f Field,
    top: f64,
    shown: Vec<(f64, Grid)>,
    /// The largest value of all pictures.
    limit: f64,
}

impl Field {
    /// The frames nearest to equal distances in time.
    fn shown(&self) -> Vec<&(f64, Vec<f64>)> {
        shown(self.frames.len()).map(|k| &self.frames[k]).collect()
    }
}

/// Which of so many samples a figure shows, in ascending order: both ends, and some between them.
pub fn shown(n_samples: usize) -> impl Iterator<Item = usize> {
    let (last, n) = (n_samples.saturating_sub(1), n_samples.min(PICTURES));
    (0..n).map(move |k| k * last / (n - 1).max(1))
}

impl<'f> Pictures<'f> {
    /// The pictures of a field below a height.
    pub(super) fn new(field: &'f Field, top: f64) -> Pictures<'f> {
        let grid = |(t, coefficients): &(f64, Vec<f64>)| (*t, field.surface.grid(coefficients));
        let shown: Vec<(f64, Grid)> = field.shown().into_iter().map(grid).collect();
        let values = shown.iter().flat_map(|(_, grid)| grid.values.iter().flatten());
        let limit = values.fold(0.0_f64, |max, x| max.max(x.abs()));
        let limit = if limit.is_finite() && limit > 0.0 { limit } else { 1.0 };
        Pictures { field, top, shown, limit }
    }

    /// Pictures of a row.
    fn n_columns(&self) -> usize {
        match self.field.surface {
            Surface::Torus { .. } => 3,
            Surface::Sphere { .. } => 2,
        }
    }

    /// Width and height of a picture.
    fn size(&self) -> [f64; 2] {
        let n = self.n_columns() as f64;
        let width = (ROW - (n - 1.0) * BETWEEN) / n;
        [width, width / self.field.surface.ratio()]
    }

    /// Height on paper.
    pub(super) fn height(&self) -> f64 {
        let rows = self.shown.len().div_ceil(self.n_columns()).max(1) as f64;
        HEAD + rows * (CAPTION + self.size()[1]) + (rows - 1.0) * BETWEEN
    }

    /// The corner of a picture at the top left.
    fn corner(&self, k: usize) -> [f64; 2] {
        let (row, column) = ((k / self.n_columns()) as f64, (k % self.n_columns()) as f64);
        let [width, height] = self.size();
        let y = self.top + HEAD + CAPTION + row * (CAPTION + height + BETWEEN);
        [LEFT + column * (width + BETWEEN), y]
    }

    /// The pictures themselves.
    pub(super) fn images(&self) -> impl Iterator<Item = Image> + '_ {
        let mut palette = vec![[255, 255, 255, 0]];
        palette.extend((-LEVELS..=LEVELS).map(|level| {
            let RGBColor(r, g, b) = colour(level);
            [r, g, b, 255]
        }));
        let number = |value: &Option<f64>| {
            let level = value.map(|value| (value / self.limit * f64::from(LEVELS)).round() as i32);
            level.map_or(0, |level| (level.clamp(-LEVELS, LEVELS) + LEVELS + 1) as u8)
        };
        self.shown.iter().enumerate().map(move |(k, (_, grid))| {
            let pixels: Vec<u8> = grid.values.iter().map(number).collect();
            Image { corner: self.corner(k), size: self.size(), file: png(grid.width, &palette, &pixels) }
        })
    }

    /// What is around the pictures.
    pub(super) fn draw<'a>(&self, area: &Area<'a>) -> Drawn<'a> {
        let label = |text: &str, x: f64, y: f64, size: f64, bold: bool| {
            area.draw(&Text::new(text.to_owned(), at(x, y), font(size, INK, bold, HPos::Left, VPos::Bottom)))
        };
        label(&self.field.title, LEFT, self.top + 14.0, 12.5, true)?;
        let times = self.shown.iter().map(|(t, _)| *t);
        let ticks = Ticks::new(0.0, times.fold(0.0_f64, |max, t| max.max(t.abs())).max(1e-300), 100);
        for (k, (t, _)) in self.shown.iter().enumerate() {
            let [x, y] = self.corner(k);
            let time = match ticks.power_label() {
                Some(power) => format!("t = {} {power} s", ticks.label(*t)),
                None => format!("t = {} s", ticks.label(*t)),
            };
            label(&time, x, y - 6.0, 11.0, false)?;
            self.frame(area, [x, y])?;
        }
        self.legend(area)
    }

    /// The outline of a picture, and on the sphere its meridians and parallels, every 60 and 30 degrees.
    fn frame<'a>(&self, area: &Area<'a>, [x, y]: [f64; 2]) -> Drawn<'a> {
        let [width, height] = self.size();
        if let Surface::Torus { .. } = self.field.surface {
            let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.0, 0.0]];
            let corners = corners.map(|[a, b]| at(x + a * width, y + b * height));
            return area.draw(&PathElement::new(corners.to_vec(), stroke(FRAME, 0.8)));
        }
        let point = |longitude: f64, latitude: f64| {
            let [a, b] = mollweide(longitude, latitude);
            at(x + width * (0.5 + 0.5 * a), y + height * (0.5 - 0.5 * b))
        };
        const STEPS: i32 = 60;
        let along = |from: f64, to: f64| {
            (0..=STEPS).map(move |k| from + (to - from) * f64::from(k) / f64::from(STEPS))
        };
        for k in -2..=2 {
            let longitude = f64::from(k) * PI / 3.0;
            let meridian =
                along(-PI / 2.0, PI / 2.0).map(|latitude| point(longitude, latitude)).collect::<Vec<_>>();
            area.draw(&PathElement::new(meridian, stroke(FRAME, 0.35)))?;
            let latitude = f64::from(k) * PI / 6.0;
            area.draw(&PathElement::new(
                vec![point(-PI, latitude), point(PI, latitude)],
                stroke(FRAME, 0.35),
            ))?;
        }
        let east = along(-PI / 2.0, PI / 2.0).map(|latitude| point(PI, latitude));
        let west = along(PI / 2.0, -PI / 2.0).map(|latitude| point(-PI, latitude));
        area.draw(&PathElement::new(east.chain(west).collect::<Vec<_>>(), stroke(FRAME, 1.0)))
    }

    /// The colours and what they mean.
    fn legend<'a>(&self, area: &Area<'a>) -> Drawn<'a> {
        let (limit, [_, length]) = (self.limit, self.size());
        let ticks = Ticks::new(-limit, limit, 4);
        let [_, top] = self.corner(0);
        let x = LEFT + ROW + 12.0;
        let n = 2 * LEVELS + 1;
        let y_of = |value: f64| top + length * (0.5 - 0.5 * value / limit);
        for k in 0..n {
            let y = |k: i32| top + length * f64::from(k) / f64::from(n);
            area.draw(&Rectangle::new(
                [at(x, y(k)), at(x + SCALE_WIDTH, (y(k + 1) + OVERLAP).min(top + length))],
                colour(LEVELS - k).filled(),
            ))?;
        }
        for value in &ticks.values {
            let style = font(11.0, INK, false, HPos::Left, VPos::Center);
            let end = x + SCALE_WIDTH;
            area.draw(&PathElement::new(
                vec![at(end, y_of(*value)), at(end + 4.0, y_of(*value))],
                stroke(FRAME, 0.8),
            ))?;
            debug_assert!(end + 7.0 < WIDTH, "the legend is on the page");
            area.draw(&Text::new(ticks.label(*value), at(end + 7.0, y_of(*value)), style))?;
        }
        let parts = [ticks.power_label().unwrap_or_default(), self.field.unit.clone()];
        let unit = parts.into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join(" ");
        let style = font(11.0, QUIET, false, HPos::Left, VPos::Bottom);
        area.draw(&Text::new(unit, at(x, top - 6.0), style))
    }
}

/// From blue by white to orange, darker towards the ends.
fn colour(level: i32) -> RGBColor {
    let part = (f64::from(level) / f64::from(LEVELS)).clamp(-1.0, 1.0);
    let [white, middle, end] = if part < 0.0 { LOW } else { HIGH };
    let size = part.abs();
    let (from, to, part) =
        if size < BEND { (white, middle, size / BEND) } else { (middle, end, (size - BEND) / (1.0 - BEND)) };
    let mixed = |from: u8, to: u8| (f64::from(from) + (f64::from(to) - f64::from(from)) * part).round() as u8;
    RGBColor(mixed(from.0, to.0), mixed(from.1, to.1), mixed(from.2, to.2))
}

#[cfg(test)]
mod tests {
    use super::{Field, HIGH, LEVELS, LOW, Pictures, Surface, colour};

    fn wave(frames: usize) -> Field {
        let frames = (0..frames).map(|k| (k as f64, vec![0.5, 0.0])).collect();
        let surface = Surface::Torus { waves: vec![(1, 0)] };
        Field { title: "Vorticity [1/s]".into(), unit: "1/s".into(), surface, frames }
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
    fn colours_meet_in_white_and_are_as_far_from_it_on_both_sides() {
        assert_eq!((colour(LEVELS), colour(-LEVELS)), (HIGH[2], LOW[2]));
        assert_eq!(colour(0), plotters::style::WHITE);
        let light = |level: i32| {
            let c = colour(level);
            0.2126 * f64::from(c.0) + 0.7152 * f64::from(c.1) + 0.0722 * f64::from(c.2)
        };
        for level in 1..=LEVELS {
            assert!(light(level) < light(level - 1) && light(-level) < light(1 - level), "{level}");
            // A tenth of the way from black to white, at most: neither side seems larger.
            assert!((light(level) - light(-level)).abs() < 25.5, "{level}");
        }
    }

    #[test]
    fn pictures_stand_in_rows_within_their_height() {
        let field = wave(11);
        let pictures = Pictures::new(&field, 100.0);
        let images: Vec<_> = pictures.images().collect();
        assert_eq!(images.len(), 6);
        let last = &images[5];
        assert!((last.corner[1] + last.size[1] - 100.0 - pictures.height()).abs() < 1e-9);
        assert!(images.iter().all(|image| image.size == [240.0, 240.0]));
        assert!((pictures.limit - 1.0).abs() < 1e-2, "{}", pictures.limit);
    }
}
