//! A figure as a PNG file.
//!
//! Does not know: scenes, motions.

use tiny_skia::{
    FillRule, FilterQuality, LineCap, LineJoin, Paint, Path, PathBuilder, Pixmap, PixmapPaint, Stroke,
    Transform,
};

use super::segment::Segment;
use super::shapes::{Page, Shape};

/// Pixels for each unit of length.
const SHARPNESS: f32 = 2.0;

/// The file.
///
/// # Errors
/// A figure too large for pixels.
pub(super) fn png(page: &Page) -> Result<Vec<u8>, String> {
    let [width, height] = page.size.map(|length| (length * SHARPNESS).ceil() as u32);
    let mut pixels = Pixmap::new(width, height).ok_or("the figure is too large for pixels")?;
    let scale = page.scale * SHARPNESS;
    let large = Transform::from_scale(scale, scale);
    for shape in &page.shapes {
        match shape {
            Shape::Outline { path, colour: [r, g, b], opacity, width } => {
                let Some(path) = path_of(path) else { continue };
                let mut paint = Paint { anti_alias: true, ..Paint::default() };
                paint.set_color_rgba8(*r, *g, *b, (opacity * 255.0).round() as u8);
                match width {
                    None => pixels.fill_path(&path, &paint, FillRule::Winding, large, None),
                    Some(width) => {
                        let stroke = Stroke {
                            width: *width,
                            line_cap: LineCap::Butt,
                            line_join: LineJoin::Round,
                            ..Stroke::default()
                        };
                        pixels.stroke_path(&path, &paint, &stroke, large, None);
                    }
                }
            }
            Shape::Image { corner, size, file } => {
                let image = Pixmap::decode_png(file).map_err(|e| e.to_string())?;
                let [x, y] = corner.map(|x| x * scale);
                let (across, down) =
                    (size[0] * scale / image.width() as f32, size[1] * scale / image.height() as f32);
                let place = Transform::from_row(across, 0.0, 0.0, down, x, y);
                let paint = PixmapPaint { quality: FilterQuality::Bilinear, ..PixmapPaint::default() };
                pixels.draw_pixmap(0, 0, image.as_ref(), &paint, place, None);
            }
        }
    }
    pixels.encode_png().map_err(|e| e.to_string())
}

fn path_of(segments: &[Segment]) -> Option<Path> {
    let mut path = PathBuilder::new();
    for segment in segments {
        match *segment {
            Segment::Move([x, y]) => path.move_to(x, y),
            Segment::Line([x, y]) => path.line_to(x, y),
            Segment::Cubic([a, b], [c, d], [x, y]) => path.cubic_to(a, b, c, d, x, y),
            Segment::Close => path.close(),
        }
    }
    path.finish()
}
