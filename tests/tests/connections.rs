//! Derived connections: other coordinates, the same motion.

use std::collections::BTreeMap;

use hamel_codegen::expr::{Graph, SymbolId, rational_to_f64};
use hamel_codegen::mechanics::derive;
use hamel_codegen::reduction::{KinematicConstraint, reduce, with_connection};
use hamel_codegen::scene;
use hamel_codegen::spec::{self, ConnectionKind, Model};
use hamel_runtime::{Dop853, Integrator, Options};
use hamel_tests::models::{Interpreted, State, model};

fn rewritten(model: &Model, kind: ConnectionKind) -> Model {
    with_connection(model, kind).unwrap_or_else(|e| panic!("{e}"))
}

fn flow(model: &Model, initial: &[f64], t_final: f64) -> Vec<f64> {
    let built = scene::build(model, scene::DEFAULT).unwrap_or_else(|e| panic!("{e}"));
    let params: Vec<f64> = built.params().iter().map(|p| rational_to_f64(&p.default)).collect();
    let system = Interpreted(built.prepare(&params).unwrap_or_else(|e| panic!("{e}")));
    let options = Options::adaptive(1e-13, 1e-13);
    let mut integrator = Integrator::new(&system, Dop853, 0.0, State(initial.to_vec()), options).unwrap();
    integrator.integrate_to(t_final).unwrap();
    integrator.state().0.clone()
}

/// `v + A(x) xdot` at a state `[x, xdot, v]`, parameters at their defaults.
fn shifted(model: &Model, state: &[f64]) -> Vec<f64> {
    let n = model.base.len();
    let mut values: BTreeMap<SymbolId, f64> =
        model.params.iter().map(|p| (p.symbol, rational_to_f64(&p.default))).collect();
    values.extend(model.base.iter().zip(state).map(|(c, x)| (c.symbol, *x)));
    let connection = model.connection.as_ref().expect("the model has a connection");
    let mut result = state.to_vec();
    for (a, row) in connection.iter().enumerate() {
        for (i, e) in row.iter().enumerate() {
            let coefficient = model.graph.eval_f64(*e, &values).expect("A depends on x and parameters");
            result[2 * n + a] += coefficient * state[n + i];
        }
    }
    result
}

/// Both runs are accurate to about 1e-12; the shape motion must agree to that, with room for the conversion.
const CLOSE: f64 = 1e-10;

/// A rigid body with one hinged arm: three unequal moments of inertia, so its momentum map is not abelian.
const ONE_ARM: &str = "model one_arm {
    param m = 0.4;
    coordinate alpha in angle;
    velocity Omega in so(3);
    let r = [3/5 + cos(alpha)/2, sin(alpha)/2, 0];
    let v = cross(Omega, r) + alpha_dot*[-sin(alpha)/2, cos(alpha)/2, 0];
    lagrangian = (1.2*Omega1^2 + 1.5*Omega2^2 + 1.8*Omega3^2)/2 + m/2*dot(v, v) - alpha^2/5;
}";

#[test]
fn the_mechanical_connection_of_a_satellite_decouples_the_metric_and_keeps_the_motion() {
    let trivial = spec::parse("one_arm.hamel", ONE_ARM).unwrap_or_else(|e| panic!("{e}"));
    let mechanical = rewritten(&trivial, ConnectionKind::Mechanical);
    let mut g: Graph = mechanical.graph.clone();
    let mut coupled_before = false;
    for c in &mechanical.base {
        for v in &mechanical.velocities {
            let mixed = |g: &mut Graph, l| {
                let p = g.diff(l, c.velocity);
                g.diff(p, v.symbol)
            };
            let after = mixed(&mut g, mechanical.lagrangian);
            assert!(g.is_zero(after), "{} and {} are coupled", c.velocity_name, v.name);
            let before = mixed(&mut g, trivial.lagrangian);
            coupled_before |= !g.is_zero(before);
        }
    }
    assert!(coupled_before, "the trivial connection couples shape and group");
    let initial = [0.3, 0.5, 0.6, -0.8, 1.1];
    let converted = shifted(&mechanical, &initial);
    assert!(converted.iter().zip(&initial).any(|(a, b)| (a - b).abs() > 1e-2), "the coordinates differ");
    let (one, other) = (flow(&trivial, &initial, 3.0), flow(&mechanical, &converted, 3.0));
    let one = shifted(&mechanical, &one);
    for (a, b) in one.iter().zip(&other) {
        assert!((a - b).abs() < CLOSE, "{one:?} {other:?}");
    }
}

#[test]
fn a_given_connection_can_be_made_trivial() {
    let given = model("wong_particle");
    let trivial = rewritten(&given, ConnectionKind::Trivial);
    assert!(given.connection.is_some() && trivial.connection.is_none());
    let xi = [1.0, 0.2, -0.3, 0.1, 0.9, 0.4, 0.5, -0.6, 0.8];
    let v = shifted(&given, &xi);
    let (one, other) = (flow(&trivial, &xi, 2.0), flow(&given, &v, 2.0));
    for (a, b) in shifted(&given, &one).iter().zip(&other) {
        assert!((a - b).abs() < CLOSE, "{one:?} {other:?}");
    }
    let mechanical = rewritten(&trivial, ConnectionKind::Mechanical);
    let mut g = mechanical.graph.clone();
    let given = given.connection.unwrap();
    let again = mechanical.connection.expect("the metric couples them");
    for (row, expected) in again.iter().zip(&given) {
        for (e, f) in row.iter().zip(expected) {
            assert!(g.is_equal(*e, *f), "the connection of Wong's Lagrangian is its mechanical one");
        }
    }
}

#[test]
fn the_nonholonomic_connection_of_the_rolling_ball_leaves_only_spin_vertical() {
    let ball = rewritten(&model("rolling_ball"), ConnectionKind::Nonholonomic);
    let system = reduce(&ball, &[]).unwrap_or_else(|e| panic!("{e}"));
    let KinematicConstraint::Solved(solved) = &system.constraint else {
        panic!("linear constraints are solved")
    };
    // v1 = v2 = 0: the constraint has become v in span(E3), whatever the base velocities are.
    for k in [2, 3] {
        assert!(solved.dependent.contains(&k));
        assert!(solved.psi[k].iter().all(|e| *e == system.graph.zero()), "v{} vanishes", k - 1);
    }
    let connection = ball.connection.as_ref().expect("rolling is a connection");
    assert!(connection.iter().flatten().any(|e| *e != ball.graph.zero()));
    let equations = derive(&system).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(equations.facts.constants, ["a1_dot", "a2_dot", "xi3"]);
}

#[test]
fn a_model_can_ask_for_its_mechanical_connection() {
    let text = "model bead {
        coordinate x in real;
        velocity omega in R;
        lagrangian = x_dot^2/2 + (2 + x^2)*omega^2/2 + x*omega*x_dot/2;
        connection mechanical;
    }";
    let model = spec::parse("bead.hamel", text).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(model.derived_connection, Some(ConnectionKind::Mechanical));
    let system = reduce(&model, &[]).unwrap_or_else(|e| panic!("{e}"));
    let mut g = system.graph.clone();
    let p = g.diff(system.lagrangian, system.velocities[0]);
    let mixed = g.diff(p, system.velocities[1]);
    assert!(g.is_zero(mixed));
    assert!(derive(&system).unwrap_or_else(|e| panic!("{e}")).facts.energy_is_conserved);
}

#[test]
fn connections_that_do_not_exist_are_refused_with_the_reason() {
    let servo = with_connection(&model("servo_ball"), ConnectionKind::Nonholonomic).unwrap_err();
    assert!(servo.to_string().contains("linear constraints"), "{servo}");
    let text = "model free { coordinate x in real; velocity w in R; lagrangian = x_dot^2/2; connection mechanical; }";
    let massless = spec::parse("free.hamel", text).unwrap_or_else(|e| panic!("{e}"));
    let refused = reduce(&massless, &[]).unwrap_err();
    assert!(refused.to_string().contains("no inertia along w"), "{refused}");
}
