//! Messages about names that do not exist: the nearest one that does, and all of them.
//!
//! Does not know: what the names are names of.

/// Longest list of names that a message spells out.
const MAX_LISTED: usize = 60;

/// The known name that was probably meant.
pub fn closest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let lower = name.to_lowercase();
    let distance = |candidate: &str| strsim::osa_distance(&lower, &candidate.to_lowercase());
    let (best, distance) = known.into_iter().map(|k| (k, distance(k))).min_by_key(|(_, d)| *d)?;
    // One slip in short names, about one in three letters in long ones.
    (distance <= (name.chars().count().max(best.chars().count()) / 3).max(1)).then_some(best)
}

/// The names, separated by commas, cut off when there are very many.
pub fn list<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    let names: Vec<&str> = names.into_iter().collect();
    match names.len() {
        0 => "none".to_owned(),
        n if n > MAX_LISTED => format!("{}, and {} more", names[..MAX_LISTED].join(", "), n - MAX_LISTED),
        _ => names.join(", "),
    }
}

/// `; did you mean X?`, or nothing.
pub fn hint<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    closest(name, known).map(|k| format!("; did you mean `{k}`?")).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::{closest, hint, list};

    #[test]
    fn near_names_are_found_and_far_ones_are_not() {
        let known = ["heavy_top", "suslov", "chaplygin_sleigh"];
        assert_eq!(closest("havy_top", known), Some("heavy_top"));
        assert_eq!(closest("Suslow", known), Some("suslov"));
        assert_eq!(closest("pendulum", known), None);
        assert_eq!(closest("I1", ["I", "m"]), Some("I"));
        assert_eq!(hint("x", []), "");
        assert_eq!(list(["a", "b"]), "a, b");
    }
}
