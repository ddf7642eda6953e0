//! A figure as a PDF file of one page.
//!
//! Does not know: scenes, motions.

use miniz_oxide::deflate::compress_to_vec_zlib;
use pdf_writer::types::{LineCapStyle, LineJoinStyle};
use pdf_writer::{Content, Filter, Finish as _, Name, Pdf, Rect, Ref};
use tiny_skia::Pixmap;

use super::segment::Segment;
use super::shapes::{Page, Shape};

/// How much is tried to make a file small, from 0 to 10.
const LEVEL: u8 = 6;
/// A unit of length of figures, a ninety-sixth of an inch, in points.
const POINTS: f32 = 0.75;

/// The file; letters are outlines.
///
/// # Errors
/// A picture that is none.
pub(super) fn pdf(page: &Page) -> Result<Vec<u8>, String> {
    let mut file = Pdf::new();
    let mut next = Ref::new(1);
    let (catalog, pages, own, contents) = (next.bump(), next.bump(), next.bump(), next.bump());
    file.catalog(catalog).pages(pages);
    file.pages(pages).kids([own]).count(1);
    let [width, height] = page.size.map(|length| length * POINTS);
    let mut parts = Parts { names: Vec::new(), opacities: Vec::new() };
    let drawn = parts.draw(page, height)?;
    let images: Vec<(String, Ref)> =
        parts.names.iter().map(|(name, _)| (name.clone(), next.bump())).collect();
    let states: Vec<Ref> = parts.opacities.iter().map(|_| next.bump()).collect();
    {
        let mut leaf = file.page(own);
        leaf.media_box(Rect::new(0.0, 0.0, width, height)).parent(pages).contents(contents);
        let mut resources = leaf.resources();
        let mut of_images = resources.x_objects();
        for (name, id) in &images {
            of_images.pair(Name(name.as_bytes()), id);
        }
        of_images.finish();
        let mut of_states = resources.ext_g_states();
        for (k, id) in states.iter().enumerate() {
            of_states.pair(Name(format!("O{k}").as_bytes()), id);
        }
    }
    file.stream(contents, &compress_to_vec_zlib(&drawn, LEVEL)).filter(Filter::FlateDecode);
    for ((_, image), (_, id)) in parts.names.iter().zip(&images) {
        write_image(&mut file, image, *id, next.bump());
    }
    for (opacity, id) in parts.opacities.iter().zip(&states) {
        file.ext_graphics(*id).non_stroking_alpha(*opacity).stroking_alpha(*opacity);
    }
    Ok(file.finish())
}

/// What the page mentions by name.
struct Parts {
    names: Vec<(String, Pixmap)>,
    opacities: Vec<f32>,
}

impl Parts {
    /// What draws the page.
    fn draw(&mut self, page: &Page, height: f32) -> Result<Vec<u8>, String> {
        let mut content = Content::new();
        let scale = page.scale * POINTS;
        // From the top down, in the coordinates of shapes.
        content.transform([scale, 0.0, 0.0, -scale, 0.0, height]);
        content.set_line_join(LineJoinStyle::RoundJoin).set_line_cap(LineCapStyle::ButtCap);
        let mut last = 1.0;
        for shape in &page.shapes {
            match shape {
                Shape::Outline { path, colour, opacity, width } => {
                    if *opacity != last {
                        let known = self.opacities.iter().position(|own| own == opacity);
                        let k = known.unwrap_or_else(|| {
                            self.opacities.push(*opacity);
                            self.opacities.len() - 1
                        });
                        content.set_parameters(Name(format!("O{k}").as_bytes()));
                        last = *opacity;
                    }
                    let [r, g, b] = colour.map(|part| f32::from(part) / 255.0);
                    match width {
                        None => content.set_fill_rgb(r, g, b),
                        Some(width) => content.set_stroke_rgb(r, g, b).set_line_width(*width),
                    };
                    trace(&mut content, path);
                    if width.is_some() {
                        content.stroke()
                    } else {
                        content.fill_nonzero()
                    };
                }
                Shape::Image { corner: [x, y], size: [w, h], file } => {
                    let image = Pixmap::decode_png(file).map_err(|e| e.to_string())?;
                    let name = format!("I{}", self.names.len());
                    content.save_state().transform([*w, 0.0, 0.0, -h, *x, y + h]);
                    content.x_object(Name(name.as_bytes())).restore_state();
                    self.names.push((name, image));
                }
            }
        }
        Ok(content.finish().to_vec())
    }
}

fn trace(content: &mut Content, path: &[Segment]) {
    for segment in path {
        match *segment {
            Segment::Move([x, y]) => content.move_to(x, y),
            Segment::Line([x, y]) => content.line_to(x, y),
            Segment::Cubic([a, b], [c, d], [x, y]) => content.cubic_to(a, b, c, d, x, y),
            Segment::Close => content.close_path(),
        };
    }
}

/// A picture with its opacity as a mask.
fn write_image(file: &mut Pdf, image: &Pixmap, id: Ref, mask: Ref) {
    let pixels: Vec<tiny_skia::ColorU8> = image.pixels().iter().map(|pixel| pixel.demultiply()).collect();
    let colours: Vec<u8> = pixels.iter().flat_map(|p| [p.red(), p.green(), p.blue()]).collect();
    let opacities: Vec<u8> = pixels.iter().map(|p| p.alpha()).collect();
    let (width, height) = (image.width() as i32, image.height() as i32);
    let data = compress_to_vec_zlib(&colours, LEVEL);
    let mut object = file.image_xobject(id, &data);
    object.filter(Filter::FlateDecode);
    object.width(width).height(height).bits_per_component(8).interpolate(true);
    object.color_space().device_rgb();
    object.s_mask(mask);
    object.finish();
    let data = compress_to_vec_zlib(&opacities, LEVEL);
    let mut object = file.image_xobject(mask, &data);
    object.filter(Filter::FlateDecode);
    object.width(width).height(height).bits_per_component(8);
    object.color_space().device_gray();
}
