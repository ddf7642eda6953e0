//! Momenta that are parameters up to a function: the reduced system has the rates of the whole one at the value of the
//! parameter, and faults are found.

use hamel_codegen::scene::{self, BuiltScene, Made, build_tampered};
use hamel_codegen::spec::{self, Model};
use hamel_expr::{Rational, rational_to_f64};
use hamel_mechanics::reduction::ReducedSystem;

/// A charge in a uniform field, whose vector potential depends on the coordinate that is left out.
const CHARGE: &str = "param m = 0.5 where m > 0; param b = 1.5; param k = 2; coordinate y, x in real;
    lagrangian = m/2*(x_dot^2 + y_dot^2) + b/2*(x*y_dot - y*x_dot) - k/2*y^2;";
/// The same field as a force.
const FORCED: &str = "param m = 0.5 where m > 0; param b = 1.5; param k = 2; coordinate y, x in real;
    lagrangian = m/2*(x_dot^2 + y_dot^2) - k/2*y^2; force x_dot = b*y_dot; force y_dot = -b*x_dot;";
/// A gauge that is no polynomial, on a curved metric, with a second velocity that the state keeps.
const CURVED: &str = "coordinate s, u in real; velocity w in so(3);
    lagrangian = (s_dot^2 + (2 + cos(s))*u_dot^2)/2 + dot(w, w) + s*w1*u_dot + u*(1 + s*u/2)*s_dot
        + s^2/2*u*u_dot + sin(u)*cos(s)*s_dot + cos(u)*sin(s)*u_dot - s^2 + s^2*w3;";
/// A charged top in a field along the vertical: the force along its axis is the rate of an advected parameter.
const TOP: &str = "param I: vector(2) = [1.3, 0.6] where I1 > 0, I2 > 0; param c = 3.8; param h = 0.4;
    velocity Omega in so(3); advected Gamma in R^3 by cross(Omega, Gamma);
    lagrangian = (I1*(Omega1^2 + Omega2^2) + I2*Omega3^2)/2 - c*Gamma3;
    force Omega = [h*Gamma2*Omega3, -h*Gamma1*Omega3, h*(Gamma1*Omega2 - Gamma2*Omega1)];";

fn model(items: &str) -> Model {
    let text = format!("model m {{ {items} scene a {{ want rhs, energy; }} }}");
    spec::parse("m.hamel", &text).unwrap_or_else(|e| panic!("{e}"))
}

fn build(items: &str) -> BuiltScene {
    scene::build(&model(items), "a").unwrap_or_else(|e| panic!("{e}\n{items}"))
}

/// Rates and energy by the names of the state, at a state by names.
fn at(built: &BuiltScene, values: &[(&str, f64)]) -> Vec<(String, f64)> {
    let own = built.params().iter();
    let params: Vec<f64> = own.map(|p| value(values, &p.name, rational_to_f64(&p.default))).collect();
    let names = built.state_names();
    let y: Vec<f64> = names.iter().map(|name| value(values, name, f64::NAN)).collect();
    let prepared = built.prepare(&params).unwrap_or_else(|e| panic!("{e}"));
    let mut dy = vec![0.0; y.len()];
    prepared.rhs(0.0, &y, &mut dy);
    let energy = prepared.energy(0.0, &y).expect("an energy");
    names.iter().cloned().zip(dy).chain([("energy".to_owned(), energy)]).collect()
}

fn value(values: &[(&str, f64)], name: &str, otherwise: f64) -> f64 {
    values.iter().find(|(own, _)| *own == name).map_or(otherwise, |(_, x)| *x)
}

/// Items, the symmetry, the value of the parameter, the state of the whole, and how many variables are left.
type Case<'a> = (&'a str, &'a str, f64, &'a [(&'a str, f64)], usize);

#[test]
fn the_reduced_motion_is_that_of_the_whole_at_the_value_of_the_parameter() {
    let of_charge = [("x", 0.9), ("y", -0.4), ("x_dot", 0.7), ("y_dot", 1.1)];
    let of_curved =
        [("s", 0.6), ("u", -0.8), ("s_dot", 0.5), ("u_dot", 1.2), ("w1", 0.3), ("w2", -0.7), ("w3", 1.4)];
    let (s, u): (f64, f64) = (0.6, -0.8);
    let along_u = (2.0 + s.cos()) * 1.2 + s * 0.3 + s * s / 2.0 * u + u.cos() * s.sin();
    let of_top = [
        ("Omega1", 0.4),
        ("Omega2", -1.1),
        ("Omega3", 2.3),
        ("Gamma1", 0.48),
        ("Gamma2", -0.64),
        ("Gamma3", 0.6),
    ];
    let cases: [Case<'_>; 4] = [
        // m x'' = b y' in both forms of the field: p = m x_dot - b y.
        (CHARGE, "routh x = p up to b/2*y;", 0.5 * 0.7 + 1.5 * 0.4, &of_charge, 2),
        (FORCED, "routh x = p up to b*y;", 0.5 * 0.7 + 1.5 * 0.4, &of_charge, 2),
        (
            CURVED,
            "routh u = p up to s + s^2*u/2 + cos(u)*sin(s);",
            along_u - s - s * s * u / 2.0 - u.cos() * s.sin(),
            &of_curved,
            5,
        ),
        (TOP, "routh Omega3 = p up to h*Gamma3;", 0.6 * 2.3 - 0.4 * 0.6, &of_top, 5),
    ];
    for (items, routh, p, state, n) in cases {
        let whole = build(items);
        let reduced = build(&format!("param p = 1; {items} {routh}"));
        assert_eq!(reduced.state_names().len(), n, "{routh}");
        let expected = at(&whole, state);
        let level: Vec<(&str, f64)> = state.iter().copied().chain([("p", p)]).collect();
        for (name, found) in at(&reduced, &level) {
            let expected = expected.iter().find(|(own, _)| *own == name).expect("the same name").1;
            assert!(
                (found - expected).abs() < 1e-13 * expected.abs().max(1.0),
                "{name} by {routh}: {found}, {expected}"
            );
        }
    }
}

#[test]
fn momenta_of_the_model_stay_those_of_its_lagrangian() {
    let momenta = "param p = 0.7; momentum P of x_dot; output along = P; routh x = p up to b/2*y;";
    let text = format!("model m {{ {CHARGE} {momenta} scene a {{ want rhs, momentum, outputs; }} }}");
    let model = spec::parse("m.hamel", &text).unwrap_or_else(|e| panic!("{e}"));
    let built = scene::build(&model, "a").unwrap_or_else(|e| panic!("{e}"));
    let params: Vec<f64> = built.params().iter().map(|p| rational_to_f64(&p.default)).collect();
    let prepared = built.prepare(&params).unwrap();
    let y = [0.8, 0.3];
    // dL/dx_dot = p + b y/2; dL/dy_dot contains x, which the state does not have.
    let expected = 0.7 + 0.75 * 0.8;
    for output in ["momentum", "along"] {
        let found = prepared.output(output, 0.0, &y).unwrap();
        assert_eq!(found.len(), 1);
        assert!((found[0] - expected).abs() < 1e-15, "{output}: {found:?}");
    }
}

#[track_caller]
fn refused(items: &str, parts: &[&str]) {
    let message = scene::build(&model(items), "a").map(|_| ()).expect_err("refused").to_string();
    for part in parts {
        assert!(message.contains(part), "expected `{part}` in\n{message}");
    }
}

#[test]
fn what_a_momentum_is_constant_up_to_is_found_and_told() {
    let charge = |routh: &str| format!("param p = 1; {CHARGE} {routh}");
    let up_to = "write `routh x = p up to 1/2*b*y;`";
    refused(&charge("routh x = p;"), &["its rate is 1/2*b*y_dot", up_to]);
    refused(
        &charge("routh x = p up to b*y;"),
        &["the lagrangian changes along `x` by `1/2*b*y_dot`, which is not the rate of `b*y`", up_to],
    );
    refused(&format!("param p = 1; {FORCED} routh x = p up to b*y/2;"), &["write `routh x = p up to b*y;`"]);
    refused(&format!("param p = 1; {TOP} routh Omega3 = p;"), &["write `routh Omega3 = p up to h*Gamma3;`"]);
    // A magnetic field that is not the same everywhere along u keeps nothing.
    let curl =
        "param p = 1; coordinate s, u in real; lagrangian = s_dot^2 + u_dot^2 + u^2*s_dot; routh u = p;";
    refused(curl, &["its rate is 2*s_dot*u", "carry it as state"]);
    // The other translation does not commute with this one.
    refused(
        &charge("param q = 1; routh x = p up to b/2*y, y = q up to -b/2*x;"),
        &["`p` is up to a function of `y`, which the state does not have", "keep one of them"],
    );
}

#[test]
fn functions_and_momenta_without_meaning_are_refused() {
    let charge = |items: &str| format!("param p = 1; {CHARGE} {items}");
    refused(&charge("routh x = p up to b*t;"), &["up to a function that contains the time"]);
    refused(
        &charge("momentum P of y_dot; output along = 2*P + x_dot; routh x = p up to b/2*y; carry P;"),
        &["the momentum `P` depends on a coordinate that the state does not have"],
    );
    let hamiltonian = "param p = 1; coordinate x, y in real; momentum P of x_dot; momentum Q of y_dot;
        hamiltonian = P^2 + Q^2; routh x = p up to y;";
    refused(hamiltonian, &["up to a function beside a hamiltonian"]);
    let stray = |routh: &str| {
        let text = format!("model m {{ param p = 1; {CHARGE} {routh} }}");
        spec::parse("m.hamel", &text).map(|_| ()).expect_err("refused").to_string()
    };
    assert!(stray("routh x = p up to b*y_dot;").contains("contains the velocity `y_dot`"));
    assert!(stray("routh x = p up to [y, y];").contains("must be a number"));
    assert!(stray("routh x = p up b*y;").contains("`to`"));
    let twice = "routh x = p up to b/2*y; scene s { routh x = p up to b*y; }";
    assert!(stray(twice).contains("`p` is the momentum of `x` up to two functions"));
}

#[test]
fn wrong_functions_and_lagrangians_do_not_pass() {
    type Fault = fn(&mut ReducedSystem);
    let faults: [(&str, &str, Fault); 4] = [
        ("the sign of a function", FORCED, |s| {
            let p = s.params.iter().find(|p| p.name == "p").expect("a parameter").symbol;
            let p = s.graph.sym(p);
            let twice = s.graph.scale(p, &Rational::from_integer(2.into()));
            s.momenta[0].value = s.graph.sub(twice, s.momenta[0].value);
        }),
        ("a function that is dropped", TOP, |s| {
            let p = s.params.iter().find(|p| p.name == "p").expect("a parameter").symbol;
            s.momenta[0].value = s.graph.sym(p);
        }),
        ("a Lagrangian without the rate of its function", CHARGE, |s| {
            let x_dot = s.velocities[1];
            let [x_dot, y] = [x_dot, s.algebroid.base()[0]].map(|symbol| s.graph.sym(symbol));
            let more = s.graph.mul(x_dot, y);
            s.lagrangian = s.graph.add(s.lagrangian, more);
        }),
        ("momenta without what the function adds", CURVED, |s| s.gauge.clear()),
    ];
    let rouths = |items: &str| match items {
        FORCED => "routh x = p up to b*y;",
        CHARGE => "routh x = p up to b/2*y;",
        TOP => "routh Omega3 = p up to h*Gamma3;",
        _ => "routh u = p up to s + s^2*u/2 + cos(u)*sin(s);",
    };
    for (what, items, fault) in faults {
        let text = format!(
            "model m {{ param p = 0.6; {items} {} scene a {{ want rhs, energy, velocities, momentum; }} }}",
            rouths(items)
        );
        let model = spec::parse("m.hamel", &text).unwrap_or_else(|e| panic!("{e}"));
        assert!(build_tampered(&model, "a", &|_| {}).is_ok(), "{what}");
        let tampered = |made: Made<'_>| {
            if let Made::System(system) = made {
                fault(system);
            }
        };
        // The derivation itself sees a momentum that moves.
        let problem = build_tampered(&model, "a", &tampered).map(|_| ()).expect_err(what).to_string();
        assert!(problem.contains("disagrees") || problem.contains("is no parameter"), "{what}: {problem}");
    }
}
