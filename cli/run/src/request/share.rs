//! Shares of an ensemble: part I of N.
//!
//! Does not know: what is shared.

/// The chunks whose number, counted from zero, leaves the remainder `part - 1` when it is divided by `of`: parts of
/// equal size that are spread over the whole ensemble, so that a region of long motions is everybody's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Share {
    part: usize,
    of: usize,
}

impl Share {
    /// Reads `I/N`, such as `3/16`.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn parse(text: &str) -> Result<Share, String> {
        const USAGE: &str = "write it as I/N with I from 1 to N, such as 3/16";
        let (part, of) = text.split_once('/').ok_or(USAGE)?;
        let number = |text: &str| text.trim().parse::<usize>().map_err(|_| USAGE.to_owned());
        let (part, of) = (number(part)?, number(of)?);
        if part == 0 || part > of {
            return Err(format!("there is no part {part} of {of}: {USAGE}"));
        }
        Ok(Share { part, of })
    }

    /// Whether a chunk, counted from zero, belongs to the share.
    pub fn has(&self, chunk: usize) -> bool {
        chunk % self.of == self.part - 1
    }
}

#[cfg(test)]
mod tests {
    use super::Share;

    #[test]
    fn every_chunk_belongs_to_one_share() {
        let shares: Vec<Share> = (1..=5).map(|part| Share::parse(&format!("{part}/5")).unwrap()).collect();
        for chunk in 0..23 {
            assert_eq!(shares.iter().filter(|share| share.has(chunk)).count(), 1, "{chunk}");
        }
        assert!(Share::parse("1/1").unwrap().has(7));
    }

    #[test]
    fn shares_that_make_no_sense_are_refused() {
        for text in ["", "3", "0/4", "5/4", "0/0", "a/4", "1/b", "-1/4"] {
            assert!(Share::parse(text).is_err(), "{text}");
        }
    }
}
