//! Figures as files: SVG as it is drawn, and PNG and PDF made of it.
//!
//! Does not know: scenes, motions.

#[cfg(feature = "pictures")]
mod letters;
#[cfg(feature = "pictures")]
mod pdf;
#[cfg(feature = "pictures")]
mod raster;
#[cfg(feature = "pictures")]
mod segment;
#[cfg(feature = "pictures")]
mod shapes;

use std::path::Path;

use super::opened::Opened;
use super::plot::DrawError;
use hamel_run::error::Error;

/// The format of a figure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Picture {
    /// Lines and letters of the viewer.
    Svg,
    /// Pixels, two for each unit of length of the figure.
    Png,
    /// Lines and outlines of letters, on one page.
    Pdf,
}

/// What messages call the endings of figures.
pub(crate) const ENDINGS: &str = ".svg, .png or .pdf";

impl Picture {
    /// The one that the ending of a file's name says.
    pub(crate) fn of(path: &Path) -> Option<Picture> {
        match path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase().as_str() {
            "svg" => Some(Picture::Svg),
            "png" => Some(Picture::Png),
            "pdf" => Some(Picture::Pdf),
            _ => None,
        }
    }

    /// The format of a figure, and of nothing else.
    ///
    /// # Errors
    /// [`Error::Request`] for other endings.
    pub(crate) fn only(path: &Path) -> Result<Picture, Error> {
        let reason = || format!("is no figure: let the name end in {ENDINGS}");
        Picture::of(path).ok_or_else(|| Error::unusable(path.display().to_string(), reason()))
    }

    /// Writes a figure that was drawn as SVG.
    ///
    /// # Errors
    /// [`Error::Io`], also where a figure is larger than the format takes.
    pub(crate) fn write(self, file: Opened, drawn: Result<String, DrawError>) -> Result<(), Error> {
        let fail = |e: &dyn std::fmt::Display| {
            Error::io(file.path().display().to_string(), std::io::Error::other(e.to_string()))
        };
        let bytes = self.bytes(drawn.map_err(|e| fail(&e))?).map_err(|e| fail(&e))?;
        file.write(&bytes)
    }

    fn bytes(self, svg: String) -> Result<Vec<u8>, String> {
        match self {
            Picture::Svg => Ok(svg.into_bytes()),
            #[cfg(feature = "pictures")]
            Picture::Png => shapes::Page::of(&svg).and_then(|page| raster::png(&page)),
            #[cfg(feature = "pictures")]
            Picture::Pdf => shapes::Page::of(&svg).and_then(|page| pdf::pdf(&page)),
            #[cfg(not(feature = "pictures"))]
            Picture::Png | Picture::Pdf => {
                Err("this program was built without the feature `pictures`: let the name end in .svg"
                    .to_owned())
            }
        }
    }
}

#[cfg(all(test, feature = "pictures"))]
mod tests {
    use super::super::plot::{Figure, Panel, svg};
    use super::Picture;

    fn figure() -> String {
        let lines = vec![("x".to_owned(), vec![0.0, 1.0, 0.0])];
        let panels = vec![Panel { title: "x [m]".into(), lines, ..Panel::default() }];
        let times = vec![0.0, 1.0, 2.0];
        svg(&Figure { title: "T".into(), times, panels, ..Figure::default() }).unwrap()
    }

    /// White but for lines of their colours, twice as large as the figure.
    #[test]
    fn pixels_show_the_figure() {
        let text = figure();
        let file = Picture::Png.bytes(text.clone()).unwrap();
        let pixels = tiny_skia::Pixmap::decode_png(&file).unwrap();
        assert!(text.contains(&format!("width=\"{}\"", pixels.width() / 2)), "{}", pixels.width());
        let n = |colour: [u8; 3]| {
            let is_it = |p: &&tiny_skia::PremultipliedColorU8| [p.red(), p.green(), p.blue()] == colour;
            pixels.pixels().iter().filter(is_it).count()
        };
        let all = pixels.pixels().len();
        assert!(
            n([255; 3]) > all * 9 / 10 && n([0, 114, 178]) > 1000,
            "{} {}",
            n([255; 3]),
            n([0, 114, 178])
        );
    }

    /// The table at the end of a page has the place of each object.
    #[test]
    fn pages_find_their_objects() {
        let file = Picture::Pdf.bytes(figure()).unwrap();
        let text = String::from_utf8_lossy(&file);
        assert!(text.starts_with("%PDF-1.") && text.trim_end().ends_with("%%EOF"));
        let at = |from: usize, words: &[u8]| {
            from + file[from..].windows(words.len()).position(|window| window == words).unwrap()
        };
        let table: usize = text.rsplit("startxref").next().unwrap().lines().nth(1).unwrap().parse().unwrap();
        assert_eq!(&file[table..table + 4], b"xref");
        let rows: Vec<&str> = std::str::from_utf8(&file[table..]).unwrap().lines().skip(3).collect();
        for (k, row) in rows.iter().take_while(|row| row.ends_with("n ") || row.ends_with("n")).enumerate() {
            let place: usize = row[..10].parse().unwrap();
            let head = format!("{} 0 obj", k + 1);
            assert_eq!(&file[place..place + head.len()], head.as_bytes(), "{row}");
        }
        // What draws is packed.
        let start = at(at(0, b"FlateDecode"), b"stream\n") + 7;
        let drawn = miniz_oxide::inflate::decompress_to_vec_zlib(&file[start..]).unwrap();
        let drawn = String::from_utf8(drawn).unwrap();
        assert!(drawn.contains(" l\n") && drawn.contains("0 0.44705883 0.69803923 RG"), "{}", &drawn[..400]);
    }
}
