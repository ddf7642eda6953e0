//! Units in documentation: `Angular velocity [rad/s].`; units of the names of a model.
//!
//! Does not know: what a unit means.

use std::sync::LazyLock;

use hamel_codegen::spec::Unit;

use super::Model;
use super::spelling::upper_first;

/// The unit of the time: that of the model, else the second.
pub fn of_time(model: &Model) -> Option<&Unit> {
    static SECOND: LazyLock<Option<Unit>> = LazyLock::new(|| Unit::declared("s"));
    model.units.time().or(SECOND.as_ref())
}

/// The unit of a column of a table: of `t`, or of a parameter, an input or a state variable.
pub fn of_column<'m>(model: &'m Model, name: &str) -> Option<&'m Unit> {
    if name == "t" { of_time(model) } else { model.units.of(name) }
}

/// Splits `Angular velocity [rad/s].` into text and the unit at a position, the last unit when there are fewer.
///
/// Of `Turning rate [rad/s] and velocity [m/s].`, each position has its own text.
pub fn split_unit(doc: &str, position: usize) -> (String, String) {
    let mut text = String::new();
    let mut texts: Vec<&str> = Vec::new();
    let mut units: Vec<&str> = Vec::new();
    let mut rest = doc;
    while let Some((before, after)) = rest.split_once('[')
        && let Some((unit, after)) = after.split_once(']')
    {
        text.push_str(before.trim_end());
        texts.push(before);
        units.push(unit.trim());
        rest = after;
    }
    text.push_str(rest);
    if let (true, Some(part)) = (texts.len() > 1, texts.get(position)) {
        let part = part.trim_start_matches([',', ';', ' ']);
        text = upper_first(part.strip_prefix("and ").unwrap_or(part).trim_end());
        if position + 1 == texts.len() {
            text.push_str(rest);
        }
    }
    let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
    let unit = units.get(position).or(units.last()).copied().unwrap_or_default();
    (text.trim_end_matches('.').to_owned(), shown(unit))
}

/// A unit as pages and figures show it; empty for that of a number.
pub fn shown(unit: &str) -> String {
    let unit = if unit == "-" || unit == "1" { "" } else { unit };
    unit.replace("^2", "²").replace("^3", "³").replace(' ', "·")
}

#[cfg(test)]
mod tests {
    use super::split_unit;

    #[test]
    fn units_are_read_from_documentation() {
        assert_eq!(split_unit("Mass [kg].", 0), ("Mass".into(), "kg".into()));
        assert_eq!(split_unit("Inertia [kg m^2].", 0).1, "kg·m²");
        assert_eq!(split_unit("Direction [-].", 0), ("Direction".into(), String::new()));
        let both = "Turning rate [rad/s] and velocity [m/s].";
        assert_eq!(split_unit(both, 0).1, "rad/s");
        assert_eq!(split_unit(both, 0).0, "Turning rate");
        assert_eq!(split_unit(both, 1), ("Velocity".into(), "m/s".into()));
        let both = "Angular velocity [rad/s] and velocity [m/s] in the body frame.";
        assert_eq!(split_unit(both, 1).0, "Velocity in the body frame");
        assert_eq!(split_unit("Anything", 0), ("Anything".into(), String::new()));
    }
}
