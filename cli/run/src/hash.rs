//! A hash that is the same on every machine, for documents.
//!
//! Does not know: what is hashed.

/// The hash FNV-1a of 64 bits, in hexadecimal digits.
///
/// # Source
/// Fowler, Noll and Vo, The FNV non-cryptographic hash algorithm (RFC 9923).
pub fn fnv1a(bytes: impl Iterator<Item = u8>) -> String {
    let step = |hash: u64, byte: u8| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
    format!("{:016x}", bytes.fold(0xcbf2_9ce4_8422_2325, step))
}

#[cfg(test)]
mod tests {
    use super::fnv1a;

    #[test]
    fn hashes_are_those_of_the_source() {
        assert_eq!(fnv1a("".bytes()), "cbf29ce484222325");
        assert_eq!(fnv1a("foobar".bytes()), "85944171f73967e8");
    }
}
