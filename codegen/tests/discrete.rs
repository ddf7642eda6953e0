//! Discrete equations: certified on algebras, actions, connections and constraints of all kinds and on random systems;
//! deliberate faults; what does not fit is told.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use hamel_codegen::scene::{self, BuiltScene, Made, build_tampered};
use hamel_codegen::spec::{self, Model, Retraction};
use hamel_expr::{Rational, uniform};
use hamel_program::program::{Constant, Operand, Program, Role};

fn model(text: &str) -> Model {
    spec::parse("discrete.hamel", text).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

fn build(text: &str) -> BuiltScene {
    let built = scene::build(&model(text), "steps").unwrap_or_else(|e| panic!("{e}\n{text}"));
    let certificate = built.certificate();
    assert!(certificate.open.is_empty(), "{:?}\n{text}", certificate.open);
    for function in ["discrete_start", "discrete_residual", "discrete_jacobian"] {
        assert!(certificate.held.contains_key(function), "{function}: {}\n{text}", certificate.sentence());
    }
    built
}

fn retraction(text: &str) -> Retraction {
    build(text).discrete().unwrap().map.retraction
}

fn refused(text: &str, expected: &str) {
    let problem = scene::build(&model(text), "steps").expect_err(text).to_string();
    assert!(problem.contains("there are no discrete equations"), "{problem}");
    assert!(problem.contains(expected), "{problem}");
    assert!(problem.contains("discrete.hamel:"), "a place in the text: {problem}");
}

/// A heavy top with friction.
const TOP: &str = "model top {
    param I: diagonal(3) = [1.3, 1.7, 0.6] where I1 > 0, I2 > 0, I3 > 0;
    param k = 0.2;
    velocity Omega in so(3);
    advected Gamma in R^3 by cross(Omega, Gamma);
    lagrangian = 1/2*dot(Omega, I*Omega) - Gamma1 - 2*Gamma3^2;
    force Omega = -k*Omega;
    scene steps { discrete midpoint; }
}";
/// A charge in a field that changes: connection, drift, advection, shape forces, explicit time, an input.
const CHARGE: &str = "model charge {
    param m = 1.3 where m > 0;
    input u = 0.1;
    coordinate x: vector(2) in real;
    velocity v in so(3);
    advected G in R^3 by cross(v, G);
    connection v = [x2*x_dot[1], sin(t)*x1*x_dot[2], x1^2*x_dot[2] + t*x_dot[1]];
    lagrangian = m/2*dot(x_dot, x_dot) + v1^2 + 2*v2^2 + 3*v3^2 + v1*x_dot[2]/3 - x1^2*x2 + cos(t)*G1*x1 - G2^2*G3;
    force x_dot = [x2 + u, -x_dot[1]];
    force v = [G1, u*v1, x1];
    scene steps { input u; discrete midpoint; retraction cayley; }
}";
/// A ball on a table that turns: affine constraints, right action.
const BALL: &str = "model ball {
    param r = 0.3 where r > 0;
    param k2 = 0.036 where k2 > 0;
    param w = 1.4;
    coordinate x, y in real;
    velocity omega_x, omega_y, omega_z in so(3);
    action right;
    lagrangian = (x_dot^2 + y_dot^2)/2 + k2/2*(omega_x^2 + omega_y^2 + omega_z^2);
    constraint first: x_dot - r*omega_y = -w*y;
    constraint second: y_dot + r*omega_x = w*x;
    independent x_dot, y_dot, omega_z;
    scene steps { discrete midpoint; }
}";
/// A constraint in the body that advected parameters turn.
const VESELOVA: &str = "model veselova {
    param I: diagonal(3) = [1.3, 1.7, 0.6] where I1 > 0, I2 > 0, I3 > 0;
    velocity Omega in so(3);
    advected Gamma in R^3 by cross(Omega, Gamma);
    lagrangian = 1/2*dot(Omega, I*Omega) - Gamma1;
    constraint plane: dot(Gamma, Omega) = 0;
    independent Omega1, Omega2;
    initial Gamma = [0.2, 0.3, 0.9];
    scene steps { discrete midpoint; }
}";
const HEISENBERG: &str = "model heisenberg {
    velocity u, v, w in heisenberg(1);
    lagrangian = u^2/2 + v^2 + (w + u/2)^2*3/4;
    scene steps { discrete midpoint; retraction exp; }
}";

#[test]
fn equations_are_held_to_their_principle_on_systems_of_all_kinds() {
    for text in [TOP, CHARGE, BALL, VESELOVA, HEISENBERG] {
        build(text);
    }
    let of = |algebra: &str, names: &str, l: &str| {
        format!(
            "model m {{ velocity {names} in {algebra}; lagrangian = {l}; scene steps {{ discrete midpoint; }} }}"
        )
    };
    let sleigh = "omega^2/3 + (v1^2 + (v2 + omega/4)^2)/2";
    assert_eq!(retraction(&of("se(2)", "omega, v", sleigh)), Retraction::Cayley);
    let in_space = "W1^2 + W2^2*2 + W3^2*3/2 + V1^2/2 + V2^2 + V3^2*2/3 + W1*V2/5";
    assert_eq!(retraction(&of("se(3)", "W, V", in_space)), Retraction::Cayley);
    assert_eq!(retraction(&of("R^3", "w", "w1^2 + w2^2 + w3^2 + w1*w2/3")), Retraction::Cayley);
    assert_eq!(retraction(&of("heisenberg(1)", "u, v, w", "u^2 + v^2 + w^2 + u*w/3")), Retraction::Exp);
    let squares = |n: usize| (1..=n).map(|k| format!("{k}*W{k}^2/2")).collect::<Vec<_>>().join(" + ");
    for (algebra, dim) in [("so(4)", 6), ("so(5)", 10), ("gl(2)", 4), ("sl(2)", 3)] {
        assert_eq!(retraction(&of(algebra, "W", &squares(dim))), Retraction::Cayley, "{algebra}");
    }
    // The entries of a rotation as coordinates, two groups side by side, a product with translations.
    build(
        "model attitude { configuration R in SO(3) velocity Omega; lagrangian = dot(Omega, Omega)/2 + Omega1^2 - R31 - R33^2; \
         scene steps { discrete midpoint; } }",
    );
    build(
        "model two { velocity A, b, o, v in product(so(3), R^2, se(2)); coordinate q in real; \
         lagrangian = dot(A, A)/2 + A1^2 + dot(b, b) + o^2 + dot(v, v) + o*v1/3 + A1*o/5 + q_dot^2 + q*q_dot*b1/4 - q^2; \
         scene steps { discrete midpoint; } }",
    );
    // A point and a direction in space, affine and linear.
    build(
        "model pose { velocity W, V in se(3); advected G in R^3 by cross(W, G); \
         lagrangian = dot(W, W)/2 + W3^2 + dot(V, V)/2 + V1^2 + W1*V2/5 - G3; scene steps { discrete midpoint; } }",
    );
}

#[test]
fn random_systems_are_held() {
    let mut seed = 20_261_127;
    let kinds: [(&str, &str, &[&str]); 6] = [
        ("W in so(3)", "advected G in R^3 by cross(W, G);", &["W1", "W2", "W3"]),
        ("o, v in se(2)", "", &["o", "v1", "v2"]),
        ("b in R^2", "", &["b1", "b2"]),
        ("u, v, w in heisenberg(1)", "", &["u", "v", "w"]),
        ("W in sl(2)", "", &["W1", "W2", "W3"]),
        ("W, V in se(3)", "", &["W1", "W2", "W3", "V1", "V2", "V3"]),
    ];
    for turn in 0..24 {
        let (velocity, advected, names) = kinds[turn % kinds.len()];
        let mut digit = || (uniform(&mut seed) * 9.0).floor() + 1.0;
        let n_shape = turn % 3;
        let mut all: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
        all.extend((1..=n_shape).map(|k| format!("q{k}_dot")));
        let mut text = String::from("model random {\n");
        for k in 1..=n_shape {
            let _ = writeln!(text, "coordinate q{k} in real;");
        }
        let _ = writeln!(text, "velocity {velocity};\n{advected}");
        if turn % 2 == 1 {
            let _ = writeln!(text, "action right;");
        }
        let mut l: Vec<String> = all.iter().map(|y| format!("{}*{y}^2/2", digit() + 4.0)).collect();
        l.extend(all.windows(2).map(|pair| format!("{}*{}*{}/9", digit(), pair[0], pair[1])));
        if n_shape > 0 {
            l.push(format!("sin(q1)*{}^2/7 - q1^2*{} + t*q1*{}/5", all[0], digit(), all[1]));
            let _ = writeln!(text, "force q1_dot = {}*q1_dot*q1 + {};", digit(), names[0]);
        }
        l.push(format!("{}/3*{}", digit(), all[0]));
        if !advected.is_empty() {
            l.push(format!("{}*G1 - G2*G3^2 + G1*{}/3", digit(), all[1]));
        }
        let _ = writeln!(text, "lagrangian = {};", l.join(" + "));
        let _ = writeln!(text, "scene steps {{ discrete midpoint; }}\n}}");
        build(&text);
    }
}

fn residual() -> Role {
    Role::OfVariables("discrete_residual".to_owned())
}

fn jacobian() -> Role {
    Role::OfVariables("discrete_jacobian".to_owned())
}

/// Puts another number in the place of a result.
fn replaced(p: &mut Program, role: &Role, i: usize, value: i64) {
    let k = p.function_idx(role).unwrap();
    p.constants.push(Constant::Rational(Rational::from_integer(value.into())));
    p.functions[k].results[i].1 = Operand::Constant(p.constants.len() as u32 - 1);
}

#[test]
fn deliberate_faults_are_found() {
    type Fault = fn(Made<'_>);
    let faults: [(&str, &str, Fault); 13] = [
        ("the sign of the derivative of the retraction", TOP, |made| {
            if let Made::Equations(e) = made {
                let s = &mut e.system;
                for (a, b) in [(0, 1), (0, 2), (1, 2)] {
                    let mut value = s.algebroid.bracket(&mut s.graph, a, b);
                    value.iter_mut().for_each(|(_, e)| *e = s.graph.neg(*e));
                    s.algebroid.set_bracket(a, b, value);
                }
            }
        }),
        ("the same of a nilpotent algebra", HEISENBERG, |made| {
            if let Made::Equations(e) = made {
                let s = &mut e.system;
                let mut value = s.algebroid.bracket(&mut s.graph, 0, 1);
                value.iter_mut().for_each(|(_, e)| *e = s.graph.neg(*e));
                s.algebroid.set_bracket(0, 1, value);
            }
        }),
        ("the whole force at both ends", TOP, |made| {
            if let Made::Equations(e) = made {
                let two = Rational::from_integer(2.into());
                e.system.forces[1] = e.system.graph.scale(e.system.forces[1], &two);
            }
        }),
        ("a force that is dropped", CHARGE, |made| {
            if let Made::Equations(e) = made {
                e.system.forces[0] = e.system.graph.zero();
            }
        }),
        ("dL/dx that is dropped", CHARGE, |made| {
            if let Made::Equations(e) = made {
                let s = &mut e.system;
                let still: BTreeMap<_, _> = s.velocities.iter().map(|y| (*y, s.graph.zero())).collect();
                let potential = s.graph.subs(s.lagrangian, &still).unwrap();
                s.lagrangian = s.graph.sub(s.lagrangian, potential);
            }
        }),
        ("advection to the other side", TOP, |made| {
            if let Made::Equations(e) = made {
                let s = &mut e.system;
                for i in 0..3 {
                    for a in 0..3 {
                        let value = s.algebroid.anchor(i, a);
                        let value = s.graph.neg(value);
                        s.algebroid.set_anchor(i, a, value);
                    }
                }
            }
        }),
        ("no connection", CHARGE, |made| {
            if let Made::Equations(e) = made {
                e.system.connection = None;
            }
        }),
        ("a connection that does not change", CHARGE, |made| {
            if let Made::Equations(e) = made {
                let s = &mut e.system;
                let half = s.graph.rational(Rational::new(1.into(), 2.into()));
                let held = BTreeMap::from([(s.algebroid.base()[0], half)]);
                let rows = s.connection.iter_mut().flatten().flatten();
                rows.for_each(|entry| *entry = s.graph.subs(*entry, &held).unwrap());
            }
        }),
        ("velocities without their affine part", BALL, |made| {
            if let Made::Equations(e) = made {
                let s = &mut e.system;
                if let hamel_mechanics::reduction::KinematicConstraint::Solved(solved) = &mut s.constraint {
                    solved.psi0.iter_mut().for_each(|e| *e = s.graph.zero());
                }
            }
        }),
        ("displacements along other velocities", BALL, |made| {
            if let Made::Equations(e) = made {
                let s = &mut e.system;
                if let hamel_mechanics::reduction::KinematicConstraint::Solved(solved) = &mut s.constraint {
                    let row = &mut solved.virtual_displacements[solved.dependent[0]];
                    row.iter_mut().for_each(|e| *e = s.graph.neg(*e));
                }
            }
        }),
        ("an entry of the Jacobian of another step", TOP, |made| {
            if let Made::Program(p) = made {
                let last = p.functions[p.function_idx(&jacobian()).unwrap()].results.len() - 1;
                replaced(p, &jacobian(), last, 1);
            }
        }),
        ("a row that vanishes for all", VESELOVA, |made| {
            if let Made::Program(p) = made {
                replaced(p, &residual(), 5, 0);
            }
        }),
        ("first values of other components", BALL, |made| {
            if let Made::Program(p) = made {
                let k = p.function_idx(&Role::OfVariables("discrete_start".to_owned())).unwrap();
                let kept = p.functions[k].results[0].1;
                p.functions[k].results[0].1 = p.functions[k].results[1].1;
                p.functions[k].results[1].1 = kept;
            }
        }),
    ];
    for (name, text, fault) in faults {
        match build_tampered(&model(text), "steps", &fault) {
            Ok(built) => panic!("{name}: {}", built.certificate().sentence()),
            Err(problem) => {
                let text = problem.to_string();
                assert!(text.contains("disagrees with its definition"), "{name}: {text}");
                assert!(text.contains("discrete_"), "{name}: {text}");
            }
        }
    }
}

#[test]
fn what_does_not_fit_is_told() {
    let of = |items: &str| format!("model m {{ {items} scene steps {{ discrete midpoint; }} }}");
    let body = "velocity W in so(3); lagrangian = dot(W, W)/2 + W1^2;";
    refused(
        &format!("model m {{ {body} scene steps {{ discrete midpoint; retraction exp; }} }}"),
        "not nilpotent",
    );
    refused(
        &format!(
            "model m {{ {body} reconstruct q in SO(3); scene steps {{ discrete midpoint; want reconstruction; }} }}"
        ),
        "is reconstructed beside the motion",
    );
    refused(
        &format!("model m {{ {body} momentum P of W; carry P; scene steps {{ discrete midpoint; }} }}"),
        "carries momenta",
    );
    refused(&of("coordinate q in real; lagrangian = q_dot^2; event e = q;"), "events");
    refused(&of("coordinate q in real; state z in real by z_dot = q; lagrangian = q_dot^2;"), "first order");
    refused(
        &of(
            "coordinate q, s in real; lagrangian = q_dot^2 + s_dot^2; constraint c: q_dot = s*s_dot; multipliers;",
        ),
        "multipliers",
    );
    refused(&of("momentum P in so(3); hamiltonian = P1^2 + P2^2 + 2*P3^2;"), "no Lagrangian");
    refused(
        &of("coordinate theta in angle; lagrangian = theta_dot^2 + cos(theta);")
            .replace("discrete", "circle theta; discrete"),
        "points of the circle",
    );
    refused(
        "model m { velocity u, v, w in heisenberg(1); lagrangian = u^2 + v^2 + w^2; \
         scene steps { discrete midpoint; retraction cayley; } }",
        "no faithful representation",
    );
    // Two rotations of one plane add up, and their Cayley maps do not.
    refused(
        &of("velocity u, w in product(R, R); advected a in R^2 by [-(u + w)*a2, (u + w)*a1]; \
             lagrangian = u^2 + w^2 - a1;"),
        "representation of which the Cayley map",
    );
    refused(
        &of("velocity w in R; advected a in R^2 by [-w*a2, w*a1]; advected b in R^2 by [-2*w*b2, 2*w*b1]; \
             lagrangian = w^2 - a1 - b1;"),
        "leaves the group",
    );
    refused(
        &of("velocity W in su(3); lagrangian = W1^2+W2^2+W3^2+W4^2+W5^2+W6^2+W7^2+W8^2;"),
        "leaves the group",
    );
}
