//! Reference values made without any reduced theory: `tests/reference/*.json`.

use std::collections::BTreeMap;
use std::path::PathBuf;

use hamel_expr::{Rational, parse_decimal};
use serde_json::Value;

/// Models in `models/specs` without reference values, and why.
///
/// A test compares the list with the folders: a model that gets a file leaves it, and every file has a model.
pub const WITHOUT_FILE: [(&str, &str); 13] = [
    (
        "appell_machine",
        "its motion is known in closed form, which bundles_motion.rs and bundles_reactions.rs compare",
    ),
    (
        "body_in_fluid",
        "its quotient kirchhoff_body has reference values; the map is proved in codegen/tests/quotients.rs",
    ),
    (
        "body_in_fluid_by_translations",
        "its quotient kirchhoff_body has reference values; the map is proved in codegen/tests/quotients.rs",
    ),
    (
        "camassa_holm",
        "a truncation of a partial differential equation, held to it on a grid in tests/fluids.rs",
    ),
    ("charged_particle", "held to Newton's equations, and without mass to the drift, in tests/degenerate.rs"),
    (
        "guiding_centre",
        "a degenerate Lagrangian, held to its Euler-Lagrange equations and to print in tests/degenerate.rs",
    ),
    ("heisenberg_body", "held to products of matrices, in tests/stage_frames.rs"),
    (
        "lotka_volterra",
        "a degenerate Lagrangian, held to its Euler-Lagrange equations and to print in tests/degenerate.rs",
    ),
    (
        "point_vortices",
        "a degenerate Lagrangian, held to its Euler-Lagrange equations and to print in tests/degenerate.rs",
    ),
    ("purcell_swimmer", "held to drag that is summed over the links, in codegen/tests/kinematic.rs"),
    ("snake", "held to Newton's and Euler's equations of every link by itself, in codegen/tests/sizes.rs"),
    ("tethered_body", "its mass centre is a harmonic oscillator, which bundles_motion.rs compares"),
    ("triangular_body", "held to products of matrices, in tests/stage_frames.rs"),
];

fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("reference")
}

/// Names of all files of reference values, sorted: what the folder has.
///
/// # Panics
/// When the folder cannot be read.
pub fn files() -> Vec<String> {
    let folder = folder();
    let entries = std::fs::read_dir(&folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    let json = entries.filter_map(|entry| {
        let path = entry.ok()?.path();
        let name = path.file_stem()?.to_str()?.to_owned();
        (path.extension()? == "json").then_some(name)
    });
    let mut names: Vec<String> = json.collect();
    names.sort();
    names
}

/// The models with reference values, sorted.
///
/// # Panics
/// When a folder cannot be read.
pub fn models() -> Vec<String> {
    let models = crate::models::names();
    files().into_iter().filter(|name| models.contains(name)).collect()
}

/// Decimal strings by name.
pub type Numbers = BTreeMap<String, String>;

/// A state with its exact derivative.
pub struct Point {
    /// Parameters, exact doubles.
    pub params: Numbers,
    /// State, exact doubles.
    pub state: Numbers,
    /// Derivative, 40 digits.
    pub derivative: Numbers,
    /// Energy, 40 digits.
    pub energy: Option<String>,
    /// Multiplier of the single constraint, 40 digits, when the file has it.
    pub lambda: Option<String>,
    /// What else the file has there, 40 digits.
    pub extra: Numbers,
}

/// A trajectory.
pub struct Trajectory {
    /// Parameters, exact doubles.
    pub params: Numbers,
    /// Final time.
    pub t_final: f64,
    /// Initial state, exact doubles.
    pub initial: Numbers,
    /// Final state, 25 digits.
    pub last: Numbers,
    /// States on the way, 20 digits.
    pub samples: Vec<(f64, Numbers)>,
    /// Coordinates of the group at both ends, 25 digits at the last; empty where the file has none.
    pub reconstruction: [Numbers; 2],
    /// What the motion conserves, 25 digits.
    pub conserved: Numbers,
}

/// The file of a model.
pub struct Reference {
    /// All points of all cases.
    pub points: Vec<Point>,
    /// All trajectories.
    pub trajectories: Vec<Trajectory>,
}

fn text(value: &Value) -> String {
    match value {
        Value::String(s) => s.clone(),
        other => other.to_string(),
    }
}

fn numbers(value: &Value) -> Numbers {
    let object = value.as_object().unwrap_or_else(|| panic!("expected an object, found {value}"));
    object.iter().map(|(name, value)| (name.clone(), text(value))).collect()
}

/// The numbers among the values of an object, none where there is no object.
fn optional(value: &Value) -> Numbers {
    let entries = value.as_object().into_iter().flatten();
    entries.filter(|(_, v)| v.is_string() || v.is_number()).map(|(name, v)| (name.clone(), text(v))).collect()
}

/// Reads the reference values of a model, or of a system without one.
///
/// # Panics
/// When the file is missing or not what its README says.
pub fn read(model: &str) -> Reference {
    let path = folder().join(format!("{model}.json"));
    let content = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let file: Value = serde_json::from_str(&content).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let list = |value: &Value| value.as_array().cloned().unwrap_or_default();
    let mut points = Vec::new();
    for case in list(&file["cases"]) {
        for point in list(&case["points"]) {
            let lambda = &point["extra"]["lambda"];
            points.push(Point {
                params: numbers(&case["params"]),
                state: numbers(&point["state"]),
                derivative: numbers(&point["derivative"]),
                energy: (!point["energy"].is_null()).then(|| text(&point["energy"])),
                lambda: lambda.as_str().map(str::to_owned),
                extra: optional(&point["extra"]),
            });
        }
    }
    let trajectories = list(&file["trajectories"])
        .iter()
        .map(|t| Trajectory {
            params: numbers(&t["params"]),
            t_final: number(&text(&t["t_final"])),
            initial: numbers(&t["initial"]),
            last: numbers(&t["final"]),
            samples: list(&t["samples"]).iter().map(|s| (number(&text(&s[0])), numbers(&s[1]))).collect(),
            reconstruction: ["initial", "final"].map(|end| optional(&t["reconstruction"][end])),
            conserved: optional(&t["conserved"]),
        })
        .collect();
    Reference { points, trajectories }
}

/// The double nearest to a decimal string.
///
/// # Panics
/// When it is not a number.
pub fn number(decimal: &str) -> f64 {
    decimal.parse().unwrap_or_else(|_| panic!("{decimal} is not a number"))
}

/// The exact value of a decimal string.
///
/// # Panics
/// When it is not a decimal.
pub fn exact(decimal: &str) -> Rational {
    let (negative, digits) = match decimal.strip_prefix('-') {
        Some(digits) => (true, digits),
        None => (false, decimal),
    };
    let value = parse_decimal(digits).unwrap_or_else(|| panic!("{decimal} is not a decimal"));
    if negative { -value } else { value }
}

/// `|computed - reference|`, subtracted exactly and rounded once.
///
/// # Panics
/// When `computed` is not finite.
pub fn distance(computed: f64, reference: &str) -> f64 {
    let computed = Rational::from_float(computed).unwrap_or_else(|| panic!("{computed} is not finite"));
    hamel_expr::rational_to_f64(&(computed - exact(reference))).abs()
}

/// Values of `names` in order, as doubles.
///
/// # Panics
/// When a name is missing.
pub fn in_order(numbers: &Numbers, names: &[String]) -> Vec<f64> {
    names
        .iter()
        .map(|name| number(numbers.get(name).unwrap_or_else(|| panic!("the reference has no {name}"))))
        .collect()
}
