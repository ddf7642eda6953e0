//! Sizes of families of models, as words of the command line and in requests.
//!
//! Does not know: which sizes a model has.

use super::json::Json;
use crate::error::Error;

/// Where a request has them.
pub const FIELD: &str = "sizes";

/// `n=10`.
///
/// # Errors
/// What to write instead.
pub fn assignment(text: &str) -> Result<(String, i64), String> {
    let wrong = || format!("{text:?} is no size: write name=number, such as n=10");
    let (name, value) = text.split_once('=').ok_or_else(wrong)?;
    Ok((name.trim().to_owned(), value.trim().parse().map_err(|_| wrong())?))
}

/// The sizes of a request, `{"sizes": {"n": 10}, ..}`; none where it has none.
///
/// # Errors
/// [`Error::NotJson`]; [`Error::Request`] for what is no object of whole numbers.
pub fn of_request(text: &str) -> Result<Vec<(String, i64)>, Error> {
    let Json::Object(entries) = Json::parse(text)? else { return Ok(Vec::new()) };
    let mut sizes = Vec::new();
    for (_, value) in entries.into_iter().filter(|(field, _)| field == FIELD) {
        let Json::Object(given) = value else {
            let reason = format!("is {}: write an object of whole numbers by name", value.describe());
            return Err(Error::unusable(FIELD, reason));
        };
        for (name, value) in given {
            match value {
                Json::Number(x) if x.fract() == 0.0 && x.abs() < 1e15 => sizes.push((name, x as i64)),
                other => {
                    let reason = format!("is {}: give a whole number", other.describe());
                    return Err(Error::unusable(format!("{FIELD}.{name}"), reason));
                }
            }
        }
    }
    Ok(sizes)
}

#[cfg(test)]
mod tests {
    use super::{assignment, of_request};

    #[test]
    fn sizes_are_whole_numbers_by_name() {
        assert_eq!(assignment(" n = 10").unwrap(), ("n".to_owned(), 10));
        assert!(assignment("n").unwrap_err().contains("n=10"));
        assert!(assignment("n=1.5").unwrap_err().contains("1.5"));
        let sizes = of_request("{\"sizes\": {\"n\": 4, \"m\": 2.0}, \"states\": []}").unwrap();
        assert_eq!(sizes, [("n".to_owned(), 4), ("m".to_owned(), 2)]);
        assert_eq!(of_request("{\"states\": []}").unwrap(), []);
        for wrong in ["{\"sizes\": [4]}", "{\"sizes\": {\"n\": 0.5}}", "{\"sizes\": {\"n\": null}}"] {
            assert!(of_request(wrong).unwrap_err().to_string().contains("sizes"), "{wrong}");
        }
    }
}
