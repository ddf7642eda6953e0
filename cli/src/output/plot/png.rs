//! Pictures with a palette as PNG files, and as text that an SVG file holds.
//!
//! Bytes are compressed by repetitions alone, of the pixel before and of the row above: what areas of one colour need.
//!
//! Does not know: what is shown.

/// Bits of a compressed stream, the lowest of a byte first.
#[derive(Default)]
struct Bits {
    bytes: Vec<u8>,
    open: u32,
    n_open: u32,
}

impl Bits {
    /// Adds the `n` lowest bits of a number, the lowest first.
    fn push(&mut self, bits: u32, n: u32) {
        self.open |= bits << self.n_open;
        self.n_open += n;
        while self.n_open >= 8 {
            self.bytes.push(self.open as u8);
            self.open >>= 8;
            self.n_open -= 8;
        }
    }

    /// Adds a code of `n` bits, which are written from the highest on.
    fn code(&mut self, code: u32, n: u32) {
        self.push(code.reverse_bits() >> (32 - n), n);
    }

    /// Adds a literal byte, or a symbol above them, by the code that RFC 1951 fixes.
    fn symbol(&mut self, symbol: u32) {
        match symbol {
            0..=143 => self.code(0x30 + symbol, 8),
            144..=255 => self.code(0x190 + symbol - 144, 9),
            256..=279 => self.code(symbol - 256, 7),
            _ => self.code(0xC0 + symbol - 280, 8),
        }
    }

    /// Adds a repetition of `length` bytes, from 3 to 258, that stand `distance` bytes before.
    fn repeat(&mut self, length: u32, distance: u32) {
        match length {
            258 => self.symbol(285),
            _ => {
                let (symbol, bits, n) = stepped(length - 3, 4);
                self.symbol(257 + symbol);
                self.push(bits, n);
            }
        }
        let (symbol, bits, n) = stepped(distance - 1, 2);
        self.code(symbol, 5);
        self.push(bits, n);
    }
}

/// The number of a class of sizes, and which of the class a size is, in so many bits: classes double after every
/// `per_doubling` of them, a power of two.
fn stepped(size: u32, per_doubling: u32) -> (u32, u32, u32) {
    if size < 2 * per_doubling {
        return (size, 0, 0);
    }
    let n = size.ilog2() - per_doubling.ilog2();
    (n * per_doubling + (size >> n), size & ((1 << n) - 1), n)
}

/// A zlib stream of rows of `stride` bytes.
fn compressed(bytes: &[u8], stride: usize) -> Vec<u8> {
    let mut bits = Bits { bytes: vec![0x78, 0x01], ..Bits::default() };
    // One block, the last, of fixed codes.
    bits.push(0b011, 3);
    let mut at = 0;
    while at < bytes.len() {
        let matching = |distance: usize| {
            let pairs = bytes[at..].iter().zip(&bytes[at - distance..]).take(258);
            pairs.take_while(|(a, b)| a == b).count()
        };
        let candidates = [1, stride - 1, stride, stride + 1].into_iter().filter(|d| *d > 0 && *d <= at);
        let best = candidates.map(|distance| (matching(distance), distance)).max_by_key(|(n, _)| *n);
        match best.filter(|(length, _)| *length >= 3) {
            Some((length, distance)) => {
                bits.repeat(length as u32, distance as u32);
                at += length;
            }
            None => {
                bits.symbol(u32::from(bytes[at]));
                at += 1;
            }
        }
    }
    bits.symbol(256);
    bits.push(0, (8 - bits.n_open) % 8);
    let (mut a, mut b) = (1_u32, 0_u32);
    for byte in bytes {
        a = (a + u32::from(*byte)) % 65521;
        b = (b + a) % 65521;
    }
    bits.bytes.extend((b << 16 | a).to_be_bytes());
    bits.bytes
}

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
    chunk(&mut file, b"IDAT", &compressed(&rows, width + 1));
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
    use super::{base64, chunk, compressed, png, stepped};

    /// Undoes [`compressed`] by what RFC 1951 says of fixed codes.
    fn inflated(stream: &[u8]) -> Vec<u8> {
        let mut at = 16;
        let mut bit = || {
            at += 1;
            u32::from(stream[(at - 1) / 8] >> ((at - 1) % 8) & 1)
        };
        let mut number = |n: u32| (0..n).fold(0, |sum, k| sum | bit() << k);
        assert_eq!(number(3), 0b011);
        let mut out = Vec::new();
        let of_class = |symbol: u32, per_doubling: u32, extra: &mut dyn FnMut(u32) -> u32| {
            if symbol < 2 * per_doubling {
                return symbol;
            }
            let n = symbol / per_doubling - 1;
            ((symbol % per_doubling + per_doubling) << n) + extra(n)
        };
        loop {
            let code = |more: u32, known: u32, number: &mut dyn FnMut(u32) -> u32| {
                (0..more).fold(known, |sum, _| 2 * sum + number(1))
            };
            let seven = code(7, 0, &mut number);
            let symbol = match seven {
                0..24 => 256 + seven,
                24..96 => code(1, seven, &mut number) - 0x30,
                96..100 => code(1, seven, &mut number) - 0xC0 + 280,
                _ => code(2, seven, &mut number) - 0x190 + 144,
            };
            match symbol {
                256 => return out,
                0..256 => out.push(symbol as u8),
                _ => {
                    let length = if symbol == 285 { 258 } else { 3 + of_class(symbol - 257, 4, &mut number) };
                    let distance = 1 + of_class(code(5, 0, &mut number), 2, &mut number) as usize;
                    (0..length).for_each(|_| out.push(out[out.len() - distance]));
                }
            }
        }
    }

    #[test]
    fn compression_can_be_undone() {
        // Lengths and distances of every class, literals of both lengths.
        let mut bytes: Vec<u8> = (0..=255).collect();
        for k in 0..300_usize {
            bytes.extend(std::iter::repeat_n((k * 37 % 251) as u8, k));
        }
        for stride in [1, 2, 7, 24, 301, 1025, 24_000] {
            let stream = compressed(&bytes, stride);
            assert!(stream.len() < bytes.len() / 8, "{stride}: {} of {}", stream.len(), bytes.len());
            assert_eq!(inflated(&stream), bytes, "{stride}");
        }
    }

    #[test]
    fn classes_are_those_of_the_standard() {
        // Lengths 11, 12, 35, 257 and distances 5, 6, 193, 24577 of RFC 1951, section 3.2.5.
        assert_eq!([8, 9, 32, 254].map(|n| stepped(n, 4)), [(8, 0, 1), (8, 1, 1), (16, 0, 3), (27, 30, 5)]);
        assert_eq!(
            [4, 5, 192, 24_576].map(|n| stepped(n, 2)),
            [(4, 0, 1), (4, 1, 1), (15, 0, 6), (29, 0, 13)]
        );
    }

    #[test]
    fn files_have_their_sums_and_text_its_padding() {
        // The end of every PNG file, as the standard prints it.
        let mut end = Vec::new();
        chunk(&mut end, b"IEND", &[]);
        assert_eq!(end, [0, 0, 0, 0, b'I', b'E', b'N', b'D', 0xAE, 0x42, 0x60, 0x82]);
        let file = png(2, &[[0, 0, 0, 255], [9, 9, 9, 0]], &[0, 1, 1, 0]);
        assert_eq!(file[16..24], [0, 0, 0, 2, 0, 0, 0, 2]);
        assert_eq!(
            ["", "f", "fo", "foo", "foob"].map(|t| base64(t.as_bytes())),
            ["", "Zg==", "Zm8=", "Zm9v", "Zm9vYg=="]
        );
    }
}
