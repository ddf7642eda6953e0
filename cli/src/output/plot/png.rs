//! Pictures with a palette as PNG files, and as text that an SVG file holds.
//!
//! Does not know: what is shown.

use miniz_oxide::deflate::compress_to_vec_zlib;

/// How much is tried to make a file small, from 0 to 10.
const LEVEL: u8 = 6;

fn chunk(file: &mut Vec<u8>, kind: &[u8; 4], data: &[u8]) {
    file.extend((data.len() as u32).to_be_bytes());
    let start = file.len();
    file.extend(kind);
    file.extend(data);
    let mut sum = !0_u32;
    for byte in &file[start..] {
        sum ^= u32::from(*byte);
        for _ in 0..8 {
            sum = if sum & 1 == 1 { sum >> 1 ^ 0xEDB8_8320 } else { sum >> 1 };
        }
    }
    file.extend((!sum).to_be_bytes());
}

/// A picture as a PNG file.
///
/// `pixels` are rows of numbers of the palette, whose colours are red, green, blue and opacity.
pub(super) fn png(width: usize, palette: &[[u8; 4]], pixels: &[u8]) -> Vec<u8> {
    let height = pixels.len() / width.max(1);
    let mut file = b"\x89PNG\r\n\x1a\n".to_vec();
    let mut head = Vec::new();
    head.extend((width as u32).to_be_bytes());
    head.extend((height as u32).to_be_bytes());
    // Eight bits that are numbers of a palette.
    head.extend([8, 3, 0, 0, 0]);
    chunk(&mut file, b"IHDR", &head);
    chunk(&mut file, b"PLTE", &palette.iter().flat_map(|[r, g, b, _]| [*r, *g, *b]).collect::<Vec<u8>>());
    chunk(&mut file, b"tRNS", &palette.iter().map(|[.., opacity]| *opacity).collect::<Vec<u8>>());
    let mut rows = Vec::with_capacity(pixels.len() + height);
    for row in pixels.chunks_exact(width.max(1)) {
        rows.push(0);
        rows.extend(row);
    }
    chunk(&mut file, b"IDAT", &compress_to_vec_zlib(&rows, LEVEL));
    chunk(&mut file, b"IEND", &[]);
    file
}

/// Bytes in base 64.
pub(super) fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for group in bytes.chunks(3) {
        let byte = |k: usize| group.get(k).copied().map_or(0, u32::from);
        let number = byte(0) << 16 | byte(1) << 8 | byte(2);
        for k in 0..4 {
            let digit = DIGITS[(number >> (18 - 6 * k) & 63) as usize];
            text.push(if k <= group.len() { char::from(digit) } else { '=' });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::{base64, chunk, png};

    #[test]
    fn files_have_their_sums_and_text_its_padding() {
        // The end of every PNG file, as the standard prints it.
        let mut end = Vec::new();
        chunk(&mut end, b"IEND", &[]);
        assert_eq!(end, [0, 0, 0, 0, b'I', b'E', b'N', b'D', 0xAE, 0x42, 0x60, 0x82]);
        let file = png(2, &[[0, 0, 0, 255], [9, 9, 9, 0]], &[0, 1, 1, 0]);
        assert_eq!(file[16..24], [0, 0, 0, 2, 0, 0, 0, 2]);
        let data = file.windows(4).position(|w| w == b"IDAT").unwrap() + 4;
        let rows = miniz_oxide::inflate::decompress_to_vec_zlib(&file[data..]);
        assert_eq!(rows.unwrap(), [0, 0, 1, 0, 1, 0]);
        assert_eq!(
            ["", "f", "fo", "foo", "foob"].map(|t| base64(t.as_bytes())),
            ["", "Zg==", "Zm8=", "Zm9v", "Zm9vYg=="]
        );
    }
}
