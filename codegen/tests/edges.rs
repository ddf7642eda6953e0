//! Places where a form of the equations has no value and the equations have one, or the other way round: ends of the
//! domains of functions, common factors, single divisors, rates in frames of stages, coordinates that are left out.

use std::collections::BTreeSet;

use hamel_codegen::explain::explain;
use hamel_codegen::scene::{self, BuiltScene};
use hamel_codegen::spec::{self, Model};
use hamel_expr::{Style, rational_to_f64};
use hamel_mechanics::mechanics::{BracketFacts, Density, derive, same_motion};
use hamel_mechanics::reduction::{Formulation, StageUse, reduce};
use hamel_program::program::Role;

fn parsed(text: &str) -> Model {
    spec::parse("edge.hamel", text).unwrap_or_else(|problems| panic!("{problems}\n{text}"))
}

/// The scene, or what is wrong with it.
fn built(text: &str, scene: &str) -> Result<BuiltScene, String> {
    let model = spec::parse("edge.hamel", text).map_err(|problems| problems.to_string())?;
    scene::build(&model, scene).map_err(|problems| problems.to_string())
}

fn rates(scene: &BuiltScene, t: f64, state: &[f64]) -> Vec<f64> {
    let params: Vec<f64> = scene.params().iter().map(|p| rational_to_f64(&p.default)).collect();
    let interpreter = scene.prepare(&params).unwrap_or_else(|e| panic!("{e}"));
    let mut rates = vec![0.0; state.len()];
    interpreter.check(t, state).unwrap_or_else(|e| panic!("{e}"));
    interpreter.rhs(t, state, &mut rates);
    rates
}

/// A function by its name.
type Named = (&'static str, fn(f64) -> f64);

const FUNCTIONS: [Named; 13] = [
    ("sin", f64::sin),
    ("cos", f64::cos),
    ("tan", f64::tan),
    ("asin", f64::asin),
    ("acos", f64::acos),
    ("atan", f64::atan),
    ("exp", f64::exp),
    ("ln", f64::ln),
    ("sinh", f64::sinh),
    ("cosh", f64::cosh),
    ("tanh", f64::tanh),
    ("abs", f64::abs),
    ("sqrt", f64::sqrt),
];

/// What a function makes of a number, as factor of an inertia and of a potential: the model is refused, or moves by
/// that number.
fn has_its_value(text: &str, value: f64, scene: &str) {
    match built(text, scene) {
        Ok(scene) => {
            // (F + 5) x'' = -F x, x = 1/2.
            let expected = -value * 0.5 / (value + 5.0);
            let found = rates(&scene, 0.0, &[0.5, 0.25]);
            assert!(
                (found[1] - expected).abs() <= 1e-14 * expected.abs().max(1.0),
                "{found:?}, {expected}\n{text}"
            );
        }
        Err(message) => {
            assert!(!value.is_finite() || value.abs() > 1e15, "{message}\n{text}");
            let is_told = message.contains("no real number") || message.contains("logarithm of zero");
            assert!(is_told, "{message}\n{text}");
        }
    }
}

#[test]
fn functions_have_their_values_at_the_ends_of_their_domains() {
    let numbers = [
        ("0", 0.0),
        ("1", 1.0),
        ("-1", -1.0),
        ("1/2", 0.5),
        ("2", 2.0),
        ("-2", -2.0),
        ("pi/2", std::f64::consts::FRAC_PI_2),
        ("-pi/4", -std::f64::consts::FRAC_PI_4),
        ("sqrt(1/2)^2", 0.5),
        ("2*sqrt(1/4)", 1.0),
        ("-cos(0)", -1.0),
    ];
    for (name, function) in FUNCTIONS {
        for (number, x) in numbers {
            let energy = format!("{name}({number})*(x_dot^2 - x^2)/2 + 5*x_dot^2/2");
            let text = format!("model m {{ coordinate x in real; lagrangian = {energy}; }}");
            has_its_value(&text, function(x), "default");
        }
        for (number, x) in [("0", 0.0), ("1", 1.0), ("-1", -1.0), ("2", 2.0), ("0.5", 0.5)] {
            let energy = format!("{name}(m)*(x_dot^2 - x^2)/2 + 5*x_dot^2/2");
            let text = format!(
                "model m {{ param m = 0.25; coordinate x in real; lagrangian = {energy};
                scene fixed {{ fix m = {number}; }} }}"
            );
            has_its_value(&text, function(x), "fixed");
        }
    }
}

/// `acos(-1) x'^2` alone, and the angle of the origin by parameters.
#[test]
fn numbers_without_derivatives_are_divided_by() {
    for energy in ["acos(-1)*x_dot^2", "asin(1)*x_dot^2 - x^2", "(2 - acos(1))*x_dot^2"] {
        let text = format!("model m {{ coordinate x in real; lagrangian = {energy}; }}");
        assert!(built(&text, "default").is_ok(), "{text}");
    }
    let text =
        "model m { param a = 1; param b = 1; coordinate x in real; lagrangian = x_dot^2*(4 + atan2(a, b));
        scene origin { fix a = 0; fix b = 0; } }";
    let message = built(text, "origin").map(|_| ()).expect_err("the origin has no angle");
    assert!(message.contains("no real number"), "{message}");
}

/// `q'' = -q - k q'` divides by nothing, also beside a second coordinate, and where the factor stands in a sum.
#[test]
fn a_factor_that_all_terms_share_is_not_divided_by() {
    let scene = built(include_str!("edges/lyapunov.hamel"), "default").unwrap_or_else(|e| panic!("{e}"));
    for (q, v) in [(1.0, 0.0), (0.3, -0.7)] {
        let found = rates(&scene, 0.0, &[q, v]);
        assert!((found[1] + q + 0.5 * v).abs() < 1e-15, "{found:?}");
    }
    let text = "model m { param k = 0.5; coordinate q, p in real;
        lagrangian = (q_dot^2 + p_dot^2 + q_dot*p_dot - q^2 - p^2)/2;
        constraint lyap: q_dot*ddt(q_dot) + q*q_dot = -k*q_dot^2 - 2*p*q_dot;
        virtual delta(q_dot) = 0; }";
    let scene = built(text, "default").unwrap_or_else(|e| panic!("{e}"));
    let place = |name: &str| scene.state_names().iter().position(|n| n == name).expect("in the state");
    let mut state = [0.0; 4];
    (state[place("q")], state[place("p")], state[place("p_dot")]) = (1.0, 0.25, 0.5);
    let found = rates(&scene, 0.0, &state);
    // q'' = -q - k q' - 2 p; along p the equation of motion p'' + q''/2 = -p.
    let acceleration = -1.0 - 0.5;
    assert!((found[place("q_dot")] - acceleration).abs() < 1e-15, "{found:?}");
    assert!((found[place("p_dot")] + 0.25 + acceleration / 2.0).abs() < 1e-15, "{found:?}");
}

/// Rows that leave no choice of velocities divide by their determinant alone: by that of a rotation, which is one, and
/// by `z^2 - y^2`, not by `y` or `z`.
#[test]
fn entries_that_cancel_from_the_solution_are_not_divided_by() {
    let rotation = ["cos(z)*x_dot + sin(z)*y_dot = z_dot", "cos(z)*y_dot - sin(z)*x_dot = 0"];
    let hyperbolic = ["z*x_dot + y*y_dot = z_dot", "y*x_dot + z*y_dot = 0"];
    let scenes = [rotation, hyperbolic].map(|[along, across]| {
        let text = format!(
            "model m {{
                coordinate x, y, z in real;
                lagrangian = (x_dot^2 + y_dot^2 + z_dot^2)/2;
                constraint along: {along};
                constraint across: {across};
                independent z_dot;
            }}"
        );
        built(&text, "default").unwrap_or_else(|e| panic!("{e}"))
    });
    let place = |name: &str| scenes[0].state_names().iter().position(|n| n == name).expect("in the state");
    for (y, z) in [(2.0, 0.0), (0.0, 0.5_f64)] {
        let mut state = [0.0; 4];
        (state[place("y")], state[place("z")], state[place("z_dot")]) = (y, z, 3.0);
        let determinant = z * z - y * y;
        for (scene, along) in scenes.iter().zip([[z.cos(), z.sin()], [z / determinant, -y / determinant]]) {
            let found = rates(scene, 0.0, &state);
            for (name, slope) in ["x", "y"].into_iter().zip(along) {
                assert!((found[place(name)] - 3.0 * slope).abs() < 1e-15, "{name} at {z}: {found:?}");
            }
            assert!(found.iter().all(|rate| rate.is_finite()), "{found:?}");
        }
    }
}

/// The signature has a fraction for a divisor that can be negative and positive, and nothing for one that cannot.
#[test]
fn single_divisors_that_change_their_sign_are_watched() {
    let scene = built(include_str!("edges/pole_in_force.hamel"), "default").unwrap_or_else(|e| panic!("{e}"));
    assert!(scene.program().function(&Role::Signature).is_some(), "1/(t - 0.5) is not watched");
    let interpreter = scene.prepare(&[]).unwrap_or_else(|e| panic!("{e}"));
    let [before, after] = [0.25, 0.75].map(|t| interpreter.signature(t, &[1.0, 0.0]));
    assert_eq!((before, after), (-0.25, 0.25));
    let text = "model m { coordinate x in real; lagrangian = x_dot^2/2;
        force x_dot = 1/(1 + x^2) + 1/(2 + sin(x)); }";
    let scene = built(text, "default").unwrap_or_else(|e| panic!("{e}"));
    assert!(scene.program().function(&Role::Signature).is_none(), "positive divisors are watched");
}

/// In the frame of stages the velocities of the model stay in expressions, and move.
#[test]
fn a_casimir_of_products_is_conserved_in_every_frame() {
    let model = parsed(include_str!("edges/casimir_of_products.hamel"));
    for stages in [StageUse::Unused, StageUse::Internal] {
        let formulation = Formulation { stages: stages.clone(), ..Formulation::of(&model) };
        let equations = derive(&reduce(&model, &formulation).expect("reduces"));
        let equations = equations.unwrap_or_else(|e| panic!("{stages:?}: {e}"));
        assert!(equations.facts.casimirs.contains(&"C2".to_owned()), "{stages:?}");
    }
}

/// `sqrt(1 + y^2) Pi` is a Poisson bracket on the state without `z`, on which nothing depends.
#[test]
fn facts_about_a_scene_are_about_its_own_state() {
    let text = include_str!("edges/dropped_particle.hamel");
    let model = parsed(text);
    let scene = scene::build(&model, "tau").unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(scene.state_names(), ["x", "y", "x_dot", "y_dot"]);
    let page = explain(&model, &scene, Style::Plain);
    assert!(page.contains("State: x, y, x_dot, y_dot."), "{page}");
    let dropped: BTreeSet<_> =
        scene.equations().state.iter().filter(|s| s.name == "z").map(|s| s.symbol).collect();
    let facts = BracketFacts::new(scene.equations(), &dropped).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(facts.coordinates, ["x", "y", "x_dot", "y_dot"]);
    assert!(matches!(facts.multiplier, Some(Density::Found { .. })), "{:?}", facts.multiplier);
    let interpreter = scene.prepare(&[]).unwrap_or_else(|e| panic!("{e}"));
    let factor = |y: f64| {
        let place =
            scene.outputs().iter().flat_map(|o| &o.components).position(|(n, _)| n == "hamiltonian_time");
        interpreter.outputs(0.0, &[0.1, y, 0.3, 0.2])[place.expect("wanted")]
    };
    let ratio = factor(2.0) / factor(0.5);
    assert!((ratio - (5.0_f64 / 1.25).sqrt()).abs() < 1e-14, "{ratio}");
}

/// Along the adapted frame the equations have the symmetric Hessian of the Lagrangian for their matrix.
#[test]
fn equations_in_the_frame_of_stages_have_a_symmetric_matrix() {
    let model = parsed(include_str!("edges/casimir_of_products.hamel"));
    let [internal, plain] = [StageUse::Internal, StageUse::Unused].map(|stages| {
        let formulation = Formulation { stages: stages.clone(), ..Formulation::of(&model) };
        derive(&reduce(&model, &formulation).expect("reduces")).unwrap_or_else(|e| panic!("{stages:?}: {e}"))
    });
    assert_ne!(internal.sections, plain.sections, "not derived in the frame");
    assert!(internal.facts.mass_matrix_is_symmetric);
    assert!(internal.pivots.iter().all(|p| p.matrix.is_symmetric));
    same_motion(&internal, &plain).expect("the same motion");
}
