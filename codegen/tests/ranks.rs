//! Which constraints a module follows, so that a motion ends where they lose their rank: each that is not proved
//! to keep it.

use hamel_codegen::Config;
use hamel_codegen::spec;

/// The rows that the module of a scene in Rust follows, and the number of entries of each, if it follows any.
fn followed(items: &str) -> Option<(usize, usize)> {
    let text = format!("model m {{ {items} }}");
    let model = spec::parse("m.hamel", &text).unwrap_or_else(|e| panic!("{e}"));
    let bundle = Config::new().generate(&[model]).unwrap_or_else(|e| panic!("{text}: {e}"));
    let (_, rows) = bundle.files["m.rs"].split_once("type Rows = [[R; ")?;
    let (n, rest) = rows.split_once("]; ").expect("two sizes");
    let (k, _) = rest.split_once(']').expect("the end of a type");
    Some((k.parse().expect("a number"), n.parse().expect("a number")))
}

const PLACES: &str = "coordinate x, y, z in real; lagrangian = (x_dot^2 + y_dot^2 + z_dot^2)/2; multipliers;";

#[test]
fn constraints_that_keep_their_rank_are_not_followed() {
    for constraints in [
        // A number in a column of its own, for one row and after another one.
        "constraint y_dot = x*z_dot;",
        "constraint y_dot = x*z_dot; constraint x_dot = y*y_dot;",
        // Lengths that the motion keeps: of a direction, and of an area.
        "constraint cos(z)*x_dot + sin(z)*y_dot = 0;",
        "constraint cos(x)*y_dot + sin(x)*z_dot = 0; constraint cos(x)*z_dot - sin(x)*y_dot = 0;",
    ] {
        assert_eq!(followed(&format!("{PLACES} {constraints}")), None, "{constraints}");
    }
    // The length of an advected vector.
    let veselova = "param A = 1 where A > 0; param B = 2 where B > 0; velocity Omega in so(3); action left;
        advected gamma in R^3 by cross(Omega, gamma); constraint dot(Omega, gamma) = 0;
        lagrangian = (A*Omega1^2 + B*Omega2^2 + (A + B)*Omega3^2)/2;";
    assert_eq!(followed(veselova), None);
}

#[test]
fn constraints_that_may_lose_their_rank_are_followed() {
    for (constraints, rows) in [
        // One where `x` is zero, in spite of the numbers, which share a column.
        ("constraint y_dot = x*z_dot; constraint y_dot = -x*z_dot;", (2, 2)),
        // A length that the motion changes.
        ("constraint x*y_dot = sin(z)*z_dot;", (1, 2)),
        // A parameter may be zero, and the row with it.
        ("param p = 1; constraint p*y_dot = x*z_dot;", (1, 2)),
        // The first row leaves the others alone, which share their columns.
        ("constraint x_dot = z*y_dot; constraint y*y_dot = x*z_dot;", (1, 2)),
    ] {
        assert_eq!(followed(&format!("{PLACES} {constraints}")), Some(rows), "{constraints}");
    }
}

/// Gradients of equations between coordinates, where no multiplier keeps these.
#[test]
fn equations_between_coordinates_are_followed() {
    let arms = "param a = 0.3; param b = 1; coordinate al in angle;
        coordinate be, ga in angle by a*[cos(al), sin(al)] + b*[cos(be), sin(be)] - a*[cos(ga), sin(ga)] = [b, 0];
        lagrangian = al_dot^2/2 + be_dot^2/2 + ga_dot^2; initial al = 1; initial ga = 1;";
    assert_eq!(followed(arms), Some((2, 3)));
}
