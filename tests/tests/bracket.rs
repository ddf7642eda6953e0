//! Nonholonomic brackets: `y' = Pi dE + R` at random states of printed and random systems, what is found out about
//! them.

use std::collections::BTreeSet;

use hamel_codegen::explain::explain;
use hamel_codegen::scene::{self, BuiltScene, Interpreter};
use hamel_codegen::spec;
use hamel_expr::{Rational, Style};
use hamel_mechanics::mechanics::{BracketFacts, Density, Jacobi};
use hamel_tests::models::text_with;
use hamel_tests::random::Random;

fn built(text: &str) -> Result<BuiltScene, String> {
    let model = spec::parse("test.hamel", text).map_err(|e| e.to_string())?;
    scene::build(&model, "brackets").map_err(|e| e.to_string())
}

/// A shipped model with a scene `brackets` that wants its bracket.
fn of_model(name: &str, items: &str) -> Result<BuiltScene, String> {
    built(&text_with(name, &format!("scene brackets {{ want rhs, energy, bracket; {items} }}")))
}

/// Central differences of the energy.
fn slopes(of: &Interpreter<'_>, t: f64, y: &[f64]) -> Vec<f64> {
    let h = 1e-5;
    let at = |k: usize, shift: f64| {
        let mut z = y.to_vec();
        z[k] += shift;
        of.energy(t, &z).expect("the scene wants it")
    };
    (0..y.len())
        .map(|k| (8.0 * (at(k, h) - at(k, -h)) - (at(k, 2.0 * h) - at(k, -2.0 * h))) / (12.0 * h))
        .collect()
}

/// The largest `|y' - Pi dE - R|` at random states, each moved by `onto` to where the constraints hold; relative to the
/// size of the terms.
fn worst(scene: &BuiltScene, onto: impl Fn(&mut [f64])) -> f64 {
    let defaults: Vec<f64> = scene.params().iter().map(|p| hamel_expr::rational_to_f64(&p.default)).collect();
    let interpreter = scene.prepare(&defaults).unwrap();
    let n = scene.state().len();
    let mut random = Random(15);
    let (mut worst, mut moved) = (0.0_f64, 0.0_f64);
    for _ in 0..20 {
        let t = random.number();
        let mut y: Vec<f64> = (0..n).map(|_| 0.75 + 0.45 * random.number()).collect();
        onto(&mut y);
        let mut rates = vec![0.0; n];
        interpreter.rhs(t, &y, &mut rates);
        let matrix = interpreter.bracket(t, &y).unwrap();
        let remainder = interpreter.bracket_remainder(t, &y).unwrap_or_else(|| vec![0.0; n]);
        let slopes = slopes(&interpreter, t, &y);
        for (i, row) in matrix.iter().enumerate() {
            let terms: Vec<f64> = row.iter().zip(&slopes).map(|(e, slope)| e * slope).collect();
            let size = terms.iter().map(|x| x.abs()).sum::<f64>() + remainder[i].abs() + rates[i].abs() + 1.0;
            worst = worst.max((rates[i] - terms.iter().sum::<f64>() - remainder[i]).abs() / size);
            moved = moved.max(rates[i].abs());
            for (j, other) in matrix.iter().enumerate() {
                assert_eq!(row[j], -other[i], "antisymmetric");
            }
        }
    }
    assert!(moved > 1e-3, "nothing moves");
    worst
}

#[test]
fn models_move_by_their_brackets() {
    for name in [
        "free_rigid_body",
        "heavy_top",
        "kirchhoff_body",
        "suslov",
        "chaplygin_sleigh",
        "mobile_robot",
        "chaplygin_ball",
        "euler_disk",
        "euler_disk_advected",
        "ball_on_rotating_table",
        "rolling_ball",
        "snakeboard",
        "wong_particle",
        "two_arm_satellite",
        "chaplygin_gyro",
    ] {
        let scene = of_model(name, "").unwrap_or_else(|e| panic!("{name}: {e}"));
        let worst = worst(&scene, |_| ());
        assert!(worst < 1e-8, "{name}: {worst:e}");
    }
}

#[test]
fn with_multipliers_the_bracket_is_one_of_states_on_the_constraint() {
    let scene = of_model("veselova", "").unwrap();
    let worst = worst(&scene, |y| {
        let along = y[0] * y[3] + y[1] * y[4];
        y[2] = -along / y[5];
    });
    assert!(worst < 1e-8, "{worst:e}");
}

/// Models with the same constraint on velocities and on momenta as state.
#[test]
fn states_of_momenta_move_by_their_brackets() {
    for (name, items) in
        [("chaplygin_ball", "carry M;"), ("heavy_top", "carry Pi;"), ("kirchhoff_body", "carry Pi;")]
    {
        let scene = of_model(name, items).unwrap_or_else(|e| panic!("{name}: {e}"));
        let worst = worst(&scene, |_| ());
        assert!(worst < 1e-8, "{name}: {worst:e}");
    }
}

/// A random constrained system on an algebra of three dimensions, with a coordinate, a potential and a metric that
/// depends on it.
fn random_text(random: &mut Random, velocity: &str, extra: &str, offset: &str) -> String {
    let mut number = || (random.number() * 2.0).round();
    let mut metric = String::new();
    for (i, a) in ["w1", "w2", "w3"].into_iter().enumerate() {
        metric += &format!(" + {}*{a}^2 + x_dot*{a}*({})/4", 5 + i, number());
        for b in &["w1", "w2", "w3"][i + 1..] {
            metric += &format!(" + ({})/3*{a}*{b}*(1 + x^2/5)", number());
        }
    }
    let [a, b, c, d] = [(); 4].map(|()| number());
    let slope = number() + 0.5;
    format!(
        "model random {{ coordinate x in real; {velocity}
        lagrangian = (4 + x^2)*x_dot^2 + w1*x/3{metric} - x^2 - x;
        constraint w3 = ({a} + ({b})*x/4)*w1 + ({c} + ({d})*x/4)*w2 + ({slope})*x_dot{offset}; {extra}
        scene brackets {{ want rhs, energy, bracket; }} }}"
    )
}

#[test]
fn random_systems_move_by_their_brackets() {
    let mut random = Random(20_261_122);
    let mut n_remainders = 0;
    let plane = "algebra plane { basis a, b, c; [a, b] = c; [a, c] = -b; } velocity w1, w2, w3 in plane;";
    for velocity in ["velocity w in so(3);", "velocity w in so(3); momentum P of w; carry P;", plane] {
        for (extra, offset) in [
            ("", ""),
            ("", " + 0.3 + x/2"),
            ("", " + t/2 + t*x"),
            ("force w1 = -w1 + x; force x_dot = -x_dot;", ""),
            ("force x_dot = sin(t);", " + sin(t)"),
        ] {
            let text = random_text(&mut random, velocity, extra, offset);
            let scene = built(&text).unwrap_or_else(|e| panic!("{e}\n{text}"));
            let has_remainder = scene.outputs().iter().any(|o| o.name == "bracket_remainder");
            assert_eq!(has_remainder, !extra.is_empty() || !offset.is_empty(), "{text}");
            n_remainders += usize::from(has_remainder);
            let worst = worst(&scene, |_| ());
            assert!(worst < 1e-8, "{worst:e}\n{text}");
        }
    }
    assert_eq!(n_remainders, 12);
}

/// A body whose angular velocity is kept by multipliers, with an offset, a force and time.
#[test]
fn affine_constraints_with_multipliers_have_a_remainder() {
    let body = |constraint: &str, items: &str| {
        format!(
            "model body {{ velocity w in so(3); coordinate x in real; advected g in R^3 by cross(w, g);
            lagrangian = (2 + x^2/3)*w1^2 + 2*w2^2 + 3/2*w3^2 + w1*w2/2 + x_dot^2 + x_dot*w1/3 + w2*x/4 - g1 - x^2;
            constraint {constraint}; {items} scene brackets {{ want rhs, energy, bracket; }} }}"
        )
    };
    for (items, offset) in [("", 0.0), ("", 0.4), ("force w2 = -w2;", 0.4)] {
        let text = body(&format!("dot(w, g) = {offset}"), items);
        let scene = built(&text).unwrap_or_else(|e| panic!("{e}\n{text}"));
        assert_eq!(scene.state_names()[..5], ["x", "x_dot", "w1", "w2", "w3"], "all velocities are state");
        let worst = worst(&scene, |y| y[4] = (offset - y[2] * y[5] - y[3] * y[6]) / y[7]);
        assert!(worst < 1e-8, "{worst:e}\n{text}");
    }
    let text = body("dot(w, g) = sin(t)*g2 + x/3", "");
    let model = built(&text);
    assert!(model.is_ok(), "time and coordinates in the offset: {:?}", model.err());
}

/// Cortes, de Leon, Marrero, Martinez 2009, section 7.2: nonlinear constraints with displacements of Chetaev.
/// Homogeneous ones have no remainder.
#[test]
fn nonlinear_constraints_have_a_bracket() {
    let scene = of_model("appell_machine", "").unwrap();
    assert!(scene.outputs().iter().all(|o| o.name != "bracket_remainder"));
    assert!(facts("appell_machine", "").is_of_one_root);
    let rising = worst(&scene, |y| y[5] = 0.5 * y[3].hypot(y[4]));
    assert!(rising < 1e-8, "{rising:e}");
    // (velocities, constraint, its solution for a component of the state, whether it is homogeneous)
    type Solved = fn(&mut [f64]);
    let cases: [(&str, &str, Solved, bool); 5] = [
        ("velocity w in so(3);", "w1^2 + w2^2 = w3^2", |y| y[4] = y[2].hypot(y[3]), true),
        (
            "velocity w in so(3); action right;",
            "w1*w2 + x*w2*w3 = 2 + x_dot",
            |y| y[2] = (2.0 + y[1]) / y[3] - y[0] * y[4],
            false,
        ),
        (
            "velocity w in so(3);",
            "dot(w, w) + x_dot^2 = 9 + x^2",
            |y| y[4] = (9.0 + y[0] * y[0] - y[1] * y[1] - y[2] * y[2] - y[3] * y[3]).sqrt(),
            false,
        ),
        (
            "velocity w in so(3); force w1 = x - w2;",
            "x*w1 + w2^2*(1 + x^2)/w3 = x_dot",
            |y| y[1] = y[0] * y[2] + y[3] * y[3] * (1.0 + y[0] * y[0]) / y[4],
            true,
        ),
        ("velocity w in so(3);", "w1^2 = x_dot*w2 + w3", |y| y[4] = y[2] * y[2] - y[1] * y[3], false),
    ];
    for (velocities, constraint, solve, is_homogeneous) in cases {
        let text = format!(
            "model body {{ {velocities} coordinate x in real;
            lagrangian = (2 + x^2/3)*w1^2 + 2*w2^2 + 3/2*w3^2 + w1*w2/2 + x_dot^2 + x_dot*w1/3 + w2*x/4 - x^2;
            constraint {constraint}; scene brackets {{ want rhs, energy, bracket; }} }}"
        );
        let scene = built(&text).unwrap_or_else(|e| panic!("{e}\n{text}"));
        assert_eq!(scene.state_names(), ["x", "x_dot", "w1", "w2", "w3"]);
        let has_remainder = scene.outputs().iter().any(|o| o.name == "bracket_remainder");
        assert_eq!(has_remainder, !is_homogeneous || text.contains("force"), "{text}");
        let worst = worst(&scene, solve);
        assert!(worst < 1e-8, "{worst:e}\n{text}");
    }
}

#[test]
fn what_has_no_bracket_is_refused_with_the_reason() {
    let problem = |name: &str| of_model(name, "").unwrap_err();
    assert!(
        problem("skew_sleigh").contains("virtual displacements are not the velocities"),
        "{}",
        problem("skew_sleigh")
    );
    assert!(problem("servo_ball").contains("there is no nonholonomic bracket"), "{}", problem("servo_ball"));
    // A cubic, products, two squares.
    let unsolved = [
        "constraint w1^3 + w2^3 = w3^3;",
        "constraint w3*(w1 - 2*w2) = 0;",
        "constraint w1*w2*(w1 + w3) = 0;",
        "constraint w1^2 + w2^2 = w3^2; constraint w1^2 - w2^2 = 4*w3^2;",
    ];
    for constraint in unsolved {
        let text = format!(
            "model body {{ velocity w in so(3); lagrangian = dot(w, w)/2; {constraint}
            scene brackets {{ want bracket; }} }}"
        );
        let problem = built(&text).map(drop).unwrap_err();
        assert!(problem.contains("not solved for one velocity after the other"), "{problem}\n{text}");
    }
    // A slope that is a velocity is no factor where the rest differs from zero without it.
    let scene = built(
        "model body { velocity w in so(3); coordinate x in real; lagrangian = w1^2 + 2*w2^2 + w3^2*3 + x_dot^2 - x^2;
        constraint w1*x_dot = w2*w3; scene brackets { want rhs, energy, bracket; } }",
    )
    .unwrap();
    let worst = worst(&scene, |y| y[4] = y[2] * y[1] / y[3]);
    assert!(worst < 1e-8, "{worst:e}");
    let given = "model oscillator { param mu = 1; coordinate x in real;
        acceleration x_dot = mu*(1 - x^2)*x_dot - x; scene brackets { want bracket; } }";
    let problem = built(given).unwrap_err();
    assert!(problem.contains("the motion is given, and has no energy"), "{problem}");
}

#[test]
fn a_dropped_coordinate_is_in_no_entry() {
    let scene = of_model("euler_disk", "drop phi;").unwrap();
    assert_eq!(scene.state_names(), ["theta", "theta_dot", "phi_dot", "psi_dot"]);
    let worst = worst(&scene, |_| ());
    assert!(worst < 1e-8, "{worst:e}");
}

fn facts(name: &str, items: &str) -> BracketFacts {
    let scene = of_model(name, items).unwrap_or_else(|e| panic!("{name}: {e}"));
    BracketFacts::new(scene.equations(), &BTreeSet::new()).unwrap_or_else(|e| panic!("{name}: {e}"))
}

fn shown(facts: &BracketFacts, density: &Density) -> String {
    match density {
        Density::Found { factors, exponent } => {
            let factors = factors.iter();
            let powers = factors.map(|f| {
                let base = facts.graph.display(f.base, Style::Plain);
                format!("({base})^{}", f.exponent)
            });
            let exponent = exponent.map(|e| format!("exp({})", facts.graph.display(e, Style::Plain)));
            powers.chain(exponent).collect::<Vec<_>>().join("*")
        }
        Density::Impossible { reason, .. } => format!("impossible: {reason}"),
        Density::NotFound { reason } => format!("not found: {reason}"),
    }
}

/// Unconstrained systems on a dual are Lie-Poisson: Jacobi holds, the Casimirs are those of the bracket.
#[test]
fn without_constraints_brackets_are_those_of_lie_and_poisson() {
    for (name, rank, casimirs) in [
        ("free_rigid_body", 2, ["p_Omega1^2 + p_Omega2^2 + p_Omega3^2"].as_slice()),
        (
            "heavy_top",
            4,
            &["Gamma1^2 + Gamma2^2 + Gamma3^2", "Gamma1*p_Omega1 + Gamma2*p_Omega2 + Gamma3*p_Omega3"],
        ),
        ("two_arm_satellite", 6, &["p_Omega1^2 + p_Omega2^2 + p_Omega3^2"]),
    ] {
        let facts = facts(name, "");
        assert_eq!((&facts.jacobi, facts.rank), (&Jacobi::Holds, rank), "{name}");
        let found: Vec<String> =
            facts.casimirs.iter().map(|e| facts.graph.display(*e, Style::Plain)).collect();
        assert_eq!(found, casimirs, "{name}");
        assert_eq!(facts.multiplier, None, "{name}");
    }
}

/// Kozlov 1988: an Euler-Poincare-Suslov system on a compact algebra has an invariant measure only where the covector
/// of the constraint is an eigenvector of the inertia: here `I13 = I23 = 0`.
#[test]
fn suslov_keeps_a_measure_only_about_a_principal_axis() {
    let general = facts("suslov", "");
    let Density::Impossible { conditions, .. } = &general.measure else { panic!("{:?}", general.measure) };
    assert_eq!(conditions.len(), 2);
    let g = &general.graph;
    for name in ["I13", "I23"] {
        assert!(conditions.iter().any(|e| g.free_symbols(*e).iter().any(|s| g.name(*s) == name)));
    }
    assert_eq!(shown(&general, &facts("suslov", "fix I = [2, 0.1, 0, 1.5, 0, 1];").measure), "");
    let shifted = facts("suslov", "fix I = [2, 0.1, 0.2, 1.5, 0, 1];").measure;
    assert!(matches!(shifted, Density::Impossible { .. }), "{shifted:?}");
}

/// The sleigh comes to a straight course, which a smooth measure forbids (Zenkov, Bloch 2003); the bracket of two
/// velocities is one of Poisson all the same. With the mass centre above the edge there is a measure.
#[test]
fn the_sleigh_keeps_no_measure_unless_it_is_balanced() {
    let general = facts("chaplygin_sleigh", "");
    assert_eq!((&general.jacobi, general.rank), (&Jacobi::Holds, 2));
    assert!(matches!(general.measure, Density::Impossible { .. }));
    let balanced = facts("chaplygin_sleigh", "fix a = 0;");
    assert_eq!(shown(&balanced, &balanced.measure), "");
}

/// The density `sqrt(gamma . I^-1 gamma)` of Veselov and Veselova 1988, in any dimension that of Fedorov and Jovanovic
/// 2004; it is the multiplier, too: Fedorov, Jovanovic 2004, Garcia-Naranjo 2007.
#[test]
fn veselova_is_hamiltonian_in_another_time() {
    let facts = facts("veselova", "");
    assert_eq!(facts.dependent.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>(), ["Omega3"]);
    assert!(!facts.is_of_one_root);
    assert!(matches!(facts.jacobi, Jacobi::Fails(_)));
    let root = "(gamma1^2/I1 + gamma2^2/I2 + gamma3^2/I3)^1/2";
    assert_eq!(shown(&facts, &facts.measure), root);
    assert_eq!(shown(&facts, facts.multiplier.as_ref().unwrap()), root);
    assert_eq!(facts.casimirs.len(), 1);
}

/// The balanced ball keeps the measure of Chaplygin 1903 (Duistermaat 2004), here by velocities: the root of the
/// determinant of the inertia about the contact. Its bracket along the constraint does not become one of Poisson by a
/// multiplier: that of Borisov and Mamaev 2001 has a further term, which the energy does not see (Garcia-Naranjo 2010).
#[test]
fn the_balanced_ball_keeps_a_measure_and_an_eccentric_one_does_not() {
    let balanced = facts("chaplygin_ball", "fix l = 0;");
    let Density::Found { factors, exponent: None } = &balanced.measure else {
        panic!("{:?}", balanced.measure)
    };
    assert_eq!(factors.len(), 1);
    assert_eq!(factors[0].exponent, Rational::new(1.into(), 2.into()));
    // det(I + m r^2 (|Gamma|^2 - Gamma Gamma^T)) at I = (1, 2, 3), m = r = 1, Gamma = (1, 2, 3).
    let g = &balanced.graph;
    let values = [
        ("I1", 1.0),
        ("I2", 2.0),
        ("I3", 3.0),
        ("m", 1.0),
        ("r", 1.0),
        ("Gamma1", 1.0),
        ("Gamma2", 2.0),
        ("Gamma3", 3.0),
    ];
    let at = g.free_symbols(factors[0].base).into_iter().map(|s| {
        let (_, x) = values.iter().find(|(name, _)| *name == g.name(s)).expect("a name of the model");
        (s, *x)
    });
    let value = g.eval_f64(factors[0].base, &at.collect()).unwrap();
    let a = [[14.0, -2.0, -3.0], [-2.0, 12.0, -6.0], [-3.0, -6.0, 8.0_f64]];
    let determinant = a[0][0] * (a[1][1] * a[2][2] - a[1][2] * a[2][1])
        - a[0][1] * (a[1][0] * a[2][2] - a[1][2] * a[2][0])
        + a[0][2] * (a[1][0] * a[2][1] - a[1][1] * a[2][0]);
    let ratio = value / determinant;
    assert!((ratio - 1.0).abs() < 1e-12, "{ratio}");
    assert!(!matches!(balanced.multiplier, Some(Density::Found { .. })));
    let eccentric = facts("chaplygin_ball", "");
    assert!(matches!(eccentric.measure, Density::Impossible { .. }), "{:?}", eccentric.measure);
}

/// Two wheels whose platform's mass centre is off the axle: the divergence is constant along the wheels, so that the
/// measure is an exponential of their angles, of many values on the circles. With the centre on the axle the motion is
/// Hamiltonian as it is.
#[test]
fn the_robot_keeps_a_measure_on_the_covering() {
    let general = facts("mobile_robot", "");
    assert!(matches!(&general.measure, Density::Found { factors, exponent: Some(_) } if factors.is_empty()));
    let balanced = facts("mobile_robot", "fix l = 0;");
    assert_eq!((&balanced.jacobi, shown(&balanced, &balanced.measure).as_str()), (&Jacobi::Holds, ""));
}

/// In the time of the multiplier the bracket is one of Poisson, and the motion is `dy/dtau = f dy/dt`.
#[test]
fn scenes_move_in_the_time_in_which_they_are_hamiltonian() {
    let plain = of_model("veselova", "").unwrap();
    let timed = of_model("veselova", "want hamiltonian_time, jacobian;").unwrap();
    let params: Vec<f64> = plain.params().iter().map(|p| hamel_expr::rational_to_f64(&p.default)).collect();
    let (slow, fast) = (plain.prepare(&params).unwrap(), timed.prepare(&params).unwrap());
    let y = [0.3, -0.7, 0.2, 0.5, 0.1, -0.4];
    let y = [y[0], y[1], -(y[0] * y[3] + y[1] * y[4]) / y[5], y[3], y[4], y[5]];
    let f = (y[3] * y[3] / params[0] + y[4] * y[4] / params[1] + y[5] * y[5] / params[2]).sqrt();
    let (mut by_t, mut by_tau) = ([0.0; 6], [0.0; 6]);
    slow.rhs(0.0, &y, &mut by_t);
    fast.rhs(0.0, &y, &mut by_tau);
    for (a, b) in by_t.iter().zip(&by_tau) {
        assert!((f * a - b).abs() < 1e-13, "{f} {a} {b}");
    }
    let bound = worst(&timed, |y| y[2] = -(y[0] * y[3] + y[1] * y[4]) / y[5]);
    assert!(bound < 1e-8, "{bound:e}");
    // The derivatives of the entries satisfy Jacobi along the surface: bracket of coordinates by differences.
    let coordinates = [0, 1, 3, 4, 5];
    let onto = |z: &[f64; 5]| [z[0], z[1], -(z[0] * z[2] + z[1] * z[3]) / z[4], z[2], z[3], z[4]];
    let jacobi = |of: &Interpreter<'_>, i: usize, j: usize, k: usize| {
        let z = [y[0], y[1], y[3], y[4], y[5]];
        let pi = |z: &[f64; 5]| of.bracket(0.0, &onto(z)).unwrap();
        let here = pi(&z);
        let slope = |l: usize, j: usize, k: usize| {
            let h = 1e-4;
            let at = |shift: f64| {
                let mut moved = z;
                moved[l] += shift;
                pi(&moved)[coordinates[j]][coordinates[k]]
            };
            (8.0 * (at(h) - at(-h)) - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h)
        };
        let cyclic = [(i, j, k), (j, k, i), (k, i, j)];
        let terms = cyclic.iter().flat_map(|&(i, j, k)| (0..5).map(move |l| (i, j, k, l)));
        terms.map(|(i, j, k, l)| here[coordinates[i]][coordinates[l]] * slope(l, j, k)).sum::<f64>()
    };
    let largest = |of: &Interpreter<'_>| {
        let triples = (0..5).flat_map(|i| (i + 1..5).flat_map(move |j| (j + 1..5).map(move |k| (i, j, k))));
        triples.map(|(i, j, k)| jacobi(of, i, j, k).abs()).fold(0.0, f64::max)
    };
    assert!(largest(&slow) > 1e-2, "{}", largest(&slow));
    assert!(largest(&fast) < 1e-9, "{}", largest(&fast));
    // Nothing is Hamiltonian by itself where a table turns, or a force acts.
    let problem = of_model("ball_on_rotating_table", "want hamiltonian_time;").unwrap_err();
    assert!(problem.contains("an affine constraint, explicit time or a force acts"), "{problem}");
}

#[test]
fn explanations_say_what_was_found() {
    let text = |name: &str| {
        let model = spec::parse("m.hamel", &text_with(name, "")).unwrap();
        explain(&model, &scene::build(&model, "default").unwrap(), Style::Unicode)
    };
    assert!(
        text("chaplygin_sleigh").contains("No smooth invariant measure with a positive density N(x), proved")
    );
    let veselova = text("veselova");
    assert!(veselova.contains("Hamiltonian after a change of time"), "{veselova}");
    assert!(text("skew_sleigh").contains("There is none: virtual displacements"));
    assert!(!text("heavy_top").contains("Nonholonomic bracket"));
}
