//! What all figures are drawn with: sizes, colours, letters, lines, and where the numbers of an axis stand.
//!
//! Does not know: what is drawn.

use super::png::base64;
use plotters::backend::SVGBackend;
use plotters::drawing::{DrawingArea, IntoDrawingArea};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, FontStyle, IntoFont, RGBColor, ShapeStyle, TextStyle};

/// The backend draws on whole numbers only, so everything is drawn this much larger.
pub(super) const SCALE: f64 = 20.0;

pub(super) const WIDTH: f64 = 920.0;
pub(super) const LEFT: f64 = 76.0;

pub(super) const INK: RGBColor = RGBColor(34, 34, 34);
pub(super) const QUIET: RGBColor = RGBColor(102, 102, 102);
pub(super) const FRAME: RGBColor = RGBColor(150, 150, 150);
pub(super) const GRID: RGBColor = RGBColor(228, 228, 228);
/// Okabe and Ito's colours, which stay apart for colour-blind readers; the yellow is too light on white.
pub(super) const COLOURS: [RGBColor; 8] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(150, 105, 0),
    RGBColor(70, 70, 70),
    RGBColor(130, 60, 190),
];

pub(super) type Area<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;
/// What the drawing backend says.
pub type DrawError = Box<dyn std::error::Error + Send + Sync>;

/// A picture in a figure.
pub(super) struct Image {
    /// The corner at the top left.
    pub(super) corner: [f64; 2],
    /// Width and height.
    pub(super) size: [f64; 2],
    /// The picture as a PNG file.
    pub(super) file: Vec<u8>,
}

/// An SVG file of the figures' width, with what `draw` draws.
pub(super) fn drawn(height: f64, draw: impl for<'a> Fn(&Area<'a>) -> Drawn<'a>) -> Result<String, DrawError> {
    drawn_over(height, &[], draw)
}

/// The same, drawn over pictures.
pub(super) fn drawn_over(
    height: f64,
    images: &[Image],
    draw: impl for<'a> Fn(&Area<'a>) -> Drawn<'a>,
) -> Result<String, DrawError> {
    let mut text = String::new();
    {
        let size = (scaled(WIDTH) as u32, scaled(height) as u32);
        let area = SVGBackend::with_string(&mut text, size).into_drawing_area();
        area.fill(&plotters::style::WHITE).map_err(describe)?;
        draw(&area).map_err(describe)?;
        area.present().map_err(describe)?;
    }
    // Shown at the intended size; the view box keeps the fine coordinates.
    let big = format!("width=\"{}\" height=\"{}\"", scaled(WIDTH), scaled(height));
    let mut text = text.replacen(&big, &format!("width=\"{WIDTH}\" height=\"{height}\""), 1);
    // The backend knows no pictures. They stand after the first shape, the background.
    let place = text.find("/>").map_or(0, |at| at + 2);
    let images: String = images.iter().map(Image::element).collect();
    text.insert_str(place, &images);
    Ok(text)
}

impl Image {
    fn element(&self) -> String {
        let ([x, y], [width, height]) = (self.corner.map(scaled), self.size.map(scaled));
        let data = base64(&self.file);
        // Programs that draw SVG know the name of the link with its prefix, old ones alone.
        format!(
            "\n<image x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" preserveAspectRatio=\"none\" \
             xmlns:xlink=\"http://www.w3.org/1999/xlink\" xlink:href=\"data:image/png;base64,{data}\"/>"
        )
    }
}

pub(super) fn describe<E: std::error::Error + Send + Sync>(
    error: plotters::drawing::DrawingAreaErrorKind<E>,
) -> DrawError {
    error.to_string().into()
}

pub(super) fn scaled(x: f64) -> i32 {
    (x * SCALE).round() as i32
}

pub(super) fn at(x: f64, y: f64) -> (i32, i32) {
    (scaled(x), scaled(y))
}

pub(super) fn stroke(colour: RGBColor, width: f64) -> ShapeStyle {
    ShapeStyle { color: colour.to_rgba(), filled: false, stroke_width: scaled(width) as u32 }
}

pub(super) fn font(size: f64, colour: RGBColor, bold: bool, h: HPos, v: VPos) -> TextStyle<'static> {
    let style = if bold { FontStyle::Bold } else { FontStyle::Normal };
    let style = ("sans-serif", size * SCALE).into_font().style(style);
    TextStyle { font: style, color: colour.to_backend_color(), pos: Pos::new(h, v) }
}

pub(super) type Drawn<'a> = Result<
    (),
    plotters::drawing::DrawingAreaErrorKind<<SVGBackend<'a> as plotters::prelude::DrawingBackend>::ErrorType>,
>;

/// Round numbers within an interval and how they are written.
pub(super) struct Ticks {
    pub(super) values: Vec<f64>,
    /// Decimals after division by `10^power`.
    pub(super) decimals: usize,
    pub(super) power: i32,
    /// What numbers are told without, where they differ little.
    offset: f64,
    /// Whether numbers are logarithms to base ten.
    is_log: bool,
}

/// Part of the largest number below which differences are told without it.
const NARROW: f64 = 1e-5;

impl Ticks {
    pub(super) fn new(low: f64, high: f64, wanted: usize) -> Ticks {
        if high - low < NARROW * low.abs().max(high.abs()) {
            let unit = 10_f64.powf((high - low).log10().ceil() + 1.0);
            let offset = ((low + high) / 2.0 / unit).round() * unit;
            let ticks = Ticks::new(low - offset, high - offset, wanted);
            let values = ticks.values.iter().map(|x| x + offset).collect();
            return Ticks { values, offset, ..ticks };
        }
        let raw = (high - low) / wanted as f64;
        let decade = 10_f64.powf(raw.log10().floor());
        let step = [1.0, 2.0, 2.5, 5.0, 10.0].map(|m| m * decade).into_iter().find(|s| *s >= raw * 0.999);
        let step = step.unwrap_or(10.0 * decade);
        let (first, last) = ((low / step).ceil(), (high / step).floor());
        let n = (last - first).clamp(0.0, 50.0) as usize;
        let values: Vec<f64> = (0..=n).map(|k| (first + k as f64) * step).collect();
        let size = values.iter().fold(0.0_f64, |max, x| max.max(x.abs()));
        let magnitude = if size > 0.0 { size.log10().floor() as i32 } else { 0 };
        let power = if (-3..5).contains(&magnitude) { 0 } else { magnitude };
        let unit = step / 10_f64.powi(power);
        let decimals = (0..8).find(|&d| {
            let shifted = unit * 10_f64.powi(d);
            (shifted - shifted.round()).abs() < 1e-6 * shifted
        });
        Ticks { values, decimals: decimals.unwrap_or(8) as usize, power, offset: 0.0, is_log: false }
    }

    /// Logarithms of round numbers: of powers of ten, and where there are fewer than two of these, of 1, 2 and 5 times
    /// them, or of numbers at equal distances.
    pub(super) fn of_powers(low: f64, high: f64, wanted: usize) -> Ticks {
        let within = |values: Vec<f64>| -> Vec<f64> {
            values.into_iter().filter(|x| (low..=high).contains(x)).collect()
        };
        let step = ((high - low) / wanted as f64).ceil().max(1.0);
        let powers = || (0..=60).map(|k| ((low / step).floor() + f64::from(k)) * step);
        let whole = within(powers().collect());
        let parts = || within(powers().flat_map(|x| [1.0_f64, 2.0, 5.0].map(|m| x + m.log10())).collect());
        let even = || {
            let ticks = Ticks::new(10_f64.powf(low), 10_f64.powf(high), wanted);
            within(ticks.values.iter().map(|x| x.log10()).collect())
        };
        // As many digits as tell neighbours apart.
        let decimals = (1.0 - (high - low).log10()).ceil().clamp(3.0, 15.0) as usize;
        let mut values = whole;
        if values.len() < 2 {
            values = parts();
        }
        if values.len() < 2 {
            values = even();
        }
        Ticks { values, decimals, power: 0, offset: 0.0, is_log: true }
    }

    pub(super) fn label(&self, value: f64) -> String {
        if self.is_log {
            let is_power = (value - value.round()).abs() < 1e-9;
            return if is_power {
                format!("10{}", raised(value.round() as i32))
            } else {
                self.shortest(value)
            };
        }
        let text = format!("{:.*}", self.decimals, (value - self.offset) / 10_f64.powi(self.power));
        match text.strip_prefix('-') {
            Some(digits) if digits.chars().all(|c| c == '0' || c == '.') => digits.to_owned(),
            Some(digits) => format!("\u{2212}{digits}"),
            None => text,
        }
    }

    /// The common power of ten and the common part, such as `×10⁻¹²` or `×10⁻¹² + 5.1`.
    pub(super) fn power_label(&self) -> Option<String> {
        let power = (self.power != 0).then(|| format!("×10{}", raised(self.power)));
        if self.offset == 0.0 {
            return power;
        }
        let sign = if self.offset < 0.0 { '\u{2212}' } else { '+' };
        // Rounded to a unit above; its last digits are noise.
        let told = [power, Some(format!("{sign} {}", shortened(self.offset.abs())))];
        Some(told.into_iter().flatten().collect::<Vec<_>>().join(" "))
    }

    /// The number with a logarithm.
    fn shortest(&self, logarithm: f64) -> String {
        let power = logarithm.floor();
        let leading = 10_f64.powf(logarithm - power);
        let cut = |text: String| text.trim_end_matches('0').trim_end_matches('.').to_owned();
        match power as i32 {
            power @ -3..=4 => {
                let decimals = (self.decimals as i32 - power).max(0) as usize;
                cut(format!("{:.*}", decimals, 10_f64.powf(logarithm)))
            }
            power => format!("{}×10{}", cut(format!("{leading:.*}", self.decimals)), raised(power)),
        }
    }
}

/// A number in the fewest digits that are it to twelve.
fn shortened(number: f64) -> String {
    let text = (0..12).map(|digits| format!("{number:.digits$e}"));
    let near = |text: &String| text.parse::<f64>().is_ok_and(|x| (x - number).abs() <= 1e-12 * number.abs());
    let found = text.into_iter().find(near).and_then(|text| text.parse::<f64>().ok());
    format!("{}", found.unwrap_or(number))
}

/// A whole number as an exponent.
fn raised(number: i32) -> String {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let digit = |c: char| c.to_digit(10).map_or('⁻', |d| DIGITS[d as usize]);
    number.to_string().chars().map(digit).collect()
}

#[cfg(test)]
mod tests {
    use super::Ticks;

    fn labels(ticks: &Ticks) -> Vec<String> {
        ticks.values.iter().map(|x| ticks.label(*x)).collect()
    }

    #[test]
    fn logarithmic_axes_have_powers_or_round_numbers() {
        assert_eq!(labels(&Ticks::of_powers(-2.5, 1.2, 5)), ["10⁻²", "10⁻¹", "10⁰", "10¹"]);
        assert_eq!(labels(&Ticks::of_powers(-0.2, 0.9, 5)), ["10⁰", "2", "5"]);
        assert_eq!(labels(&Ticks::of_powers(-12.0, 3.0, 5)).len(), 6);
        let near = labels(&Ticks::of_powers(5.157_f64.log10(), 5.1572_f64.log10(), 5));
        assert!(near.len() > 2 && near.windows(2).all(|pair| pair[0] != pair[1]), "{near:?}");
    }

    #[test]
    fn numbers_that_differ_little_are_told_without_what_they_share() {
        let ticks = Ticks::new(5.157_35, 5.157_35 + 3e-11, 5);
        let told = labels(&ticks);
        assert!(told.len() > 2 && told.windows(2).all(|pair| pair[0] != pair[1]), "{told:?}");
        assert!(ticks.power_label().unwrap().ends_with(" + 5.15735"), "{:?}", ticks.power_label());
        assert_eq!(Ticks::new(1.0, 2.0, 5).power_label(), None);
    }
}
