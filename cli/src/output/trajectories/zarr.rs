//! Zarr version 3 on a file system: documents of groups and arrays, bytes of chunks.
//!
//! Does not know: what the arrays are.
//!
//! # Source
//! Zarr core specification, version 3.1, with its codec `crc32c`; the codec `vlen-utf8` of zarr-extensions for texts.

use hamel_run::bytes;
use serde_json::{Map, Value, json};

/// The document of a group or an array.
pub(crate) const DOCUMENT: &str = "zarr.json";

/// What the elements of an array are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Double precision; NaN where nothing was written.
    Float,
    /// 64 bits without sign; 0 where nothing was written.
    Count,
    /// 8 bits without sign; 255 where nothing was written.
    Code,
    /// Texts of any length, empty where nothing was written.
    Text,
}

/// An array: its name, its axes and what is said about it.
#[derive(Clone, Debug)]
pub(crate) struct Array<'a> {
    pub(crate) name: &'a str,
    pub(crate) kind: Kind,
    /// Name and length of each axis, and length of a chunk along it.
    pub(crate) axes: Vec<(&'a str, usize, usize)>,
    pub(crate) attributes: Map<String, Value>,
}

impl Array<'_> {
    /// The document of the array.
    pub(crate) fn document(&self) -> Value {
        let (data_type, fill, codec) = match self.kind {
            Kind::Float => {
                ("float64", json!("NaN"), json!({"name": "bytes", "configuration": {"endian": "little"}}))
            }
            Kind::Count => {
                ("uint64", json!(0), json!({"name": "bytes", "configuration": {"endian": "little"}}))
            }
            Kind::Code => ("uint8", json!(255), json!({"name": "bytes"})),
            Kind::Text => ("string", json!(""), json!({"name": "vlen-utf8", "configuration": {}})),
        };
        let each = |of: fn(&(&str, usize, usize)) -> Value| self.axes.iter().map(of).collect::<Vec<Value>>();
        json!({
            "zarr_format": 3,
            "node_type": "array",
            "shape": each(|axis| json!(axis.1)),
            "data_type": data_type,
            "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": each(|axis| json!(axis.2))}},
            "chunk_key_encoding": {"name": "default", "configuration": {"separator": "/"}},
            "fill_value": fill,
            "codecs": [codec, {"name": "crc32c"}],
            "attributes": self.attributes,
            "dimension_names": each(|axis| json!(axis.0)),
        })
    }

    /// Where a chunk is, by its number along the first axis; along the others there is one chunk.
    pub(crate) fn chunk(&self, at: usize) -> String {
        format!("{}/c/{at}{}", self.name, "/0".repeat(self.axes.len() - 1))
    }

    /// Number of elements of a chunk.
    pub(crate) fn n_chunk(&self) -> usize {
        self.axes.iter().map(|axis| axis.2).product()
    }

    /// Number of bytes of the file of a chunk; none for texts, which have any length.
    pub(crate) fn n_bytes(&self) -> Option<usize> {
        let each = match self.kind {
            Kind::Float | Kind::Count => 8,
            Kind::Code => 1,
            Kind::Text => return None,
        };
        Some(each * self.n_chunk() + CHECKSUM)
    }
}

/// Number of bytes of a checksum.
const CHECKSUM: usize = 4;

/// The polynomial of Castagnoli without its leading term, bits reversed: that of the constant term is the highest.
const POLYNOMIAL: u32 = 0x82F6_3B78;

/// Remainders of the cyclic redundancy check for each byte with up to seven bytes behind it.
static REMAINDERS: [[u32; 256]; 8] = {
    let mut remainders = [[0; 256]; 8];
    let mut byte = 0;
    while byte < 256 {
        let (mut remainder, mut bit) = (byte as u32, 0);
        while bit < 8 * 8 {
            remainder = if remainder & 1 == 1 { remainder >> 1 ^ POLYNOMIAL } else { remainder >> 1 };
            bit += 1;
            if bit % 8 == 0 {
                remainders[bit / 8 - 1][byte] = remainder;
            }
        }
        byte += 1;
    }
    remainders
};

/// The remainder of bytes with eight more behind them.
fn with_word(sum: u32, word: [u8; 8]) -> u32 {
    let [a, b, c, d, e, f, g, h] = (u64::from_le_bytes(word) ^ u64::from(sum)).to_le_bytes();
    let [t, u, v, w, x, y, z, last] = &REMAINDERS;
    (last[usize::from(a)] ^ z[usize::from(b)] ^ y[usize::from(c)] ^ x[usize::from(d)])
        ^ (w[usize::from(e)] ^ v[usize::from(f)] ^ u[usize::from(g)] ^ t[usize::from(h)])
}

/// The remainder of a product of two.
fn product(mut a: u32, mut b: u32) -> u32 {
    let mut sum = 0;
    while a != 0 {
        if a >> 31 == 1 {
            sum ^= b;
        }
        a <<= 1;
        b = if b & 1 == 1 { b >> 1 ^ POLYNOMIAL } else { b >> 1 };
    }
    sum
}

/// The remainder of `x^(64 n)`, by which that of bytes is multiplied where `n` words stand behind them.
fn power(mut n: usize) -> u32 {
    const ONE: u32 = 1 << 31;
    let (mut power, mut square) = (ONE, with_word(ONE, [0; 8]));
    while n != 0 {
        if n & 1 == 1 {
            power = product(power, square);
        }
        square = product(square, square);
        n >>= 1;
    }
    power
}

/// The checksum CRC32C, eight bytes at a time of each quarter: a remainder waits for the one before it.
///
/// # Source
/// RFC 3720, appendix B.4; Kounavis and Berry 2008, IEEE Transactions on Computers 57, section 3, for the tables.
fn crc32c(bytes: &[u8]) -> u32 {
    let (words, rest) = bytes.as_chunks::<8>();
    let n = words.len() / 4;
    let (quarters, others) = words.split_at(4 * n);
    let (half, other_half) = quarters.split_at(2 * n);
    let ((a, b), (c, d)) = (half.split_at(n), other_half.split_at(n));
    let mut sums = [!0, 0, 0, 0];
    for (((a, b), c), d) in a.iter().zip(b).zip(c).zip(d) {
        let [p, q, r, s] = sums;
        sums = [with_word(p, *a), with_word(q, *b), with_word(r, *c), with_word(s, *d)];
    }
    let behind = power(n);
    let [first, next @ ..] = sums;
    let sum = next.into_iter().fold(first, |sum, next| product(sum, behind) ^ next);
    let sum = others.iter().fold(sum, |sum, word| with_word(sum, *word));
    !rest.iter().fold(sum, |sum, byte| sum >> 8 ^ REMAINDERS[0][usize::from(sum as u8 ^ byte)])
}

/// The file of a chunk: its bytes and their checksum.
pub(crate) fn sealed(mut bytes: Vec<u8>) -> Vec<u8> {
    bytes.extend(crc32c(&bytes).to_le_bytes());
    bytes
}

/// The bytes of a chunk from its file; none where the checksum is of other bytes.
pub(crate) fn opened(file: &[u8]) -> Option<&[u8]> {
    let (bytes, checksum) = file.split_last_chunk::<CHECKSUM>()?;
    (crc32c(bytes).to_le_bytes() == *checksum).then_some(bytes)
}

/// The document of a group, with those of its arrays, so that one file is read to open it.
pub(crate) fn group(attributes: &Map<String, Value>, arrays: &Map<String, Value>) -> Value {
    json!({
        "zarr_format": 3,
        "node_type": "group",
        "attributes": attributes,
        "consolidated_metadata": {"kind": "inline", "must_understand": false, "metadata": arrays},
    })
}

/// The text of a document.
pub(crate) fn text(document: &Value) -> Vec<u8> {
    let mut text = format!("{document:#}").into_bytes();
    text.push(b'\n');
    text
}

/// The bytes of numbers, filled up to a whole chunk.
pub(crate) fn floats(values: &[f64], n_chunk: usize) -> Vec<u8> {
    bytes::of_floats(values, f64::NAN, n_chunk)
}

/// The bytes of counts, filled up to a whole chunk.
pub(crate) fn counts(values: &[u64], n_chunk: usize) -> Vec<u8> {
    bytes::of_counts(values, 0, n_chunk)
}

/// The bytes of codes, filled up to a whole chunk.
pub(crate) fn codes(values: &[u8], n_chunk: usize) -> Vec<u8> {
    values.iter().copied().chain(std::iter::repeat_n(u8::MAX, n_chunk - values.len())).collect()
}

/// The bytes of texts, filled up to a whole chunk: how many, then each behind its number of bytes.
pub(crate) fn texts<'t>(values: impl ExactSizeIterator<Item = &'t str>, n_chunk: usize) -> Vec<u8> {
    let rest = std::iter::repeat_n("", n_chunk - values.len());
    // Chunks have far fewer than 2^32 texts, and a reason far fewer bytes.
    let mut bytes = (n_chunk as u32).to_le_bytes().to_vec();
    for value in values.chain(rest) {
        bytes.extend((value.len() as u32).to_le_bytes());
        bytes.extend(value.as_bytes());
    }
    bytes
}

/// The text at a place of a chunk of texts; none when the bytes are no such chunk.
pub(crate) fn text_at(bytes: &[u8], at: usize) -> Option<String> {
    let number = |bytes: &[u8]| Some(u32::from_le_bytes(bytes.get(..4)?.try_into().ok()?) as usize);
    let mut rest = bytes.get(4..)?;
    for _ in 0..at {
        rest = rest.get(4 + number(rest)?..)?;
    }
    String::from_utf8(rest.get(4..4 + number(rest)?)?.to_vec()).ok()
}

/// What differs between two documents, as `path`, first and second value; the first few.
pub(crate) fn differences(first: &Value, second: &Value) -> Vec<(String, String, String)> {
    const MOST: usize = 5;
    fn walk(path: &str, first: &Value, second: &Value, found: &mut Vec<(String, String, String)>) {
        if first == second || found.len() == MOST {
            return;
        }
        if let (Value::Object(a), Value::Object(b)) = (first, second) {
            let keys = a.keys().chain(b.keys().filter(|key| !a.contains_key(*key)));
            for key in keys {
                let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
                let of = |map: &Map<String, Value>| map.get(key).cloned().unwrap_or_default();
                walk(&path, &of(a), &of(b), found);
            }
            return;
        }
        let short = |value: &Value| {
            let text = value.to_string();
            if text.chars().count() <= 60 {
                text
            } else {
                format!("{}..", text.chars().take(58).collect::<String>())
            }
        };
        found.push((path.to_owned(), short(first), short(second)));
    }
    let mut found = Vec::new();
    walk("", first, second, &mut found);
    found
}

#[cfg(test)]
mod tests {
    use serde_json::{Map, json};

    use super::{Array, Kind, crc32c, differences, floats, opened, sealed, text_at, texts};

    /// RFC 3720, appendix B.4: 32 zeros, 32 ones, ascending and descending bytes; the usual check value.
    #[test]
    fn checksums_are_those_of_the_standard() {
        let (up, down): (Vec<u8>, Vec<u8>) = ((0..32).collect(), (0..32).rev().collect());
        let of = |bytes: &[u8]| crc32c(bytes).to_le_bytes();
        assert_eq!(of(&[0; 32]), [0xaa, 0x36, 0x91, 0x8a]);
        assert_eq!(of(&[0xff; 32]), [0x43, 0xab, 0xa8, 0x62]);
        assert_eq!(of(&up), [0x4e, 0x79, 0xdd, 0x46]);
        assert_eq!(of(&down), [0x5c, 0xdb, 0x3f, 0x11]);
        assert_eq!(crc32c(b"123456789"), 0xe306_9283);
    }

    /// By the definition, a bit after the other, of all lengths that have a rest of another size.
    #[test]
    fn checksums_are_those_of_the_definition() {
        let by_bits = |bytes: &[u8]| {
            let bit = |sum: u32| if sum & 1 == 1 { sum >> 1 ^ super::POLYNOMIAL } else { sum >> 1 };
            !bytes.iter().fold(!0, |sum: u32, byte| (0..8).fold(sum ^ u32::from(*byte), |sum, _| bit(sum)))
        };
        let bytes: Vec<u8> = (0..1500_u32).map(|k| (k.wrapping_mul(2_654_435_761) >> 13) as u8).collect();
        for n in (0..200).chain([1023, 1024, 1500]) {
            assert_eq!(crc32c(&bytes[..n]), by_bits(&bytes[..n]), "{n}");
        }
    }

    #[test]
    fn a_chunk_that_was_cut_or_changed_is_not_opened() {
        let file = sealed(vec![1, 2, 3]);
        assert_eq!(opened(&file), Some(&[1, 2, 3][..]));
        for k in 0..file.len() {
            let mut changed = file.clone();
            changed[k] ^= 0x10;
            assert_eq!(opened(&changed), None, "{k}");
            assert_eq!(opened(&file[..k]), None, "{k}");
        }
    }

    #[test]
    fn texts_are_found_again() {
        let bytes = texts(["", "Ω", "m > 0"].into_iter(), 5);
        let all: Vec<Option<String>> = (0..6).map(|at| text_at(&bytes, at)).collect();
        assert_eq!(
            all,
            [Some(""), Some("Ω"), Some("m > 0"), Some(""), Some(""), None].map(|t| t.map(str::to_owned))
        );
        assert_eq!(text_at(&bytes[..12], 2), None);
    }

    #[test]
    fn the_last_chunk_is_filled_up() {
        let bytes = floats(&[1.0], 3);
        assert_eq!(bytes.len(), 24);
        assert!(f64::from_le_bytes(bytes[16..].try_into().unwrap()).is_nan());
    }

    #[test]
    fn chunks_have_a_number_for_each_axis() {
        let array = Array {
            name: "y",
            kind: Kind::Float,
            axes: vec![("trajectory", 10, 4), ("t", 3, 3), ("state", 6, 6)],
            attributes: Map::new(),
        };
        assert_eq!((array.chunk(2), array.n_chunk()), ("y/c/2/0/0".to_owned(), 72));
        assert_eq!(array.document()["chunk_grid"]["configuration"]["chunk_shape"], json!([4, 3, 6]));
    }

    #[test]
    fn what_differs_is_named() {
        let (a, b) = (json!({"x": {"y": 1, "z": 2}}), json!({"x": {"y": 1, "z": 3, "w": "new"}}));
        let found = differences(&a, &b);
        assert_eq!(found[0], ("x.z".into(), "2".into(), "3".into()));
        assert_eq!(found[1], ("x.w".into(), "null".into(), "\"new\"".into()));
        assert!(differences(&a, &a).is_empty());
    }
}
