//! Mass times acceleration of squares of velocities, against momenta: the same forces.

use hamel_codegen::spec;
use hamel_expr::{ExprId, inlined};
use hamel_mechanics::mechanics::{Equations, derive};
use hamel_mechanics::reduction::{Formulation, ReducedSystem, reduce};
use hamel_tests::models::{model, text};

/// `rho^i_alpha dL/dx^i + F_alpha - C^gamma_{alpha beta} y^beta p_gamma - dp_alpha/dx^i xdot^i`, as it is written.
fn plain_forces(system: &ReducedSystem, e: &mut Equations) -> Vec<ExprId> {
    let g = &mut e.system.graph;
    let algebroid = &system.algebroid;
    let y: Vec<ExprId> = system.velocities.iter().map(|s| g.sym(*s)).collect();
    let p: Vec<ExprId> = system.velocities.iter().map(|s| g.diff(system.lagrangian, *s)).collect();
    let mut forces = Vec::new();
    for alpha in 0..algebroid.rank() {
        let mut terms = vec![system.forces[alpha], algebroid.derivative_along(g, alpha, system.lagrangian)];
        for beta in 0..algebroid.rank() {
            for (gamma, c) in algebroid.bracket(g, alpha, beta) {
                let product = g.product(&[c, y[beta], p[gamma]]);
                terms.push(g.neg(product));
            }
            let rate = algebroid.derivative_along(g, beta, p[alpha]);
            let drift = g.mul(rate, y[beta]);
            terms.push(g.neg(drift));
        }
        forces.push(g.sum(&terms));
    }
    forces
}

/// How many components of accelerations the equations name; their forces are those of the momenta.
fn n_accelerations(model: &spec::Model) -> usize {
    let system = reduce(model, &Formulation::of(model)).unwrap_or_else(|e| panic!("{e}"));
    let mut equations = derive(&system).unwrap_or_else(|e| panic!("{e}"));
    let plain = plain_forces(&system, &mut equations);
    let sections = equations.sections.clone();
    let linear = equations.linear_system().expect("solved for accelerations").clone();
    let g = &mut equations.system.graph;
    let values = inlined(g, sections.iter().flat_map(|s| &s.definitions));
    for (name, (force, plain)) in linear.unknowns.iter().zip(linear.force.iter().zip(plain)) {
        let force = g.subs(*force, &values).expect("no denominator vanishes");
        assert!(g.is_equal(force, plain), "force on {name} of {}", model.name);
    }
    let accelerations = sections.iter().filter(|s| s.title.starts_with("accelerations of the velocities"));
    accelerations.flat_map(|s| &s.definitions).count()
}

fn parsed(text: &str) -> spec::Model {
    spec::parse("test.hamel", text).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn velocities_of_points_in_a_turning_body_are_accelerated_there() {
    assert_eq!(n_accelerations(&model("two_arm_satellite")), 6);
    // Both masses the same number: the components are sorted out again.
    let replaced = |text: &str, from: &str, to: &str| {
        assert!(text.contains(from), "{from} is in the model");
        text.replace(from, to)
    };
    let original = text("two_arm_satellite");
    let numbers = replaced(&original, "param ma = 0.4 where ma > 0;", "let ma = 2/5;");
    let numbers = replaced(&numbers, "param mb = 0.3 where mb > 0;", "let mb = 2/5;");
    assert_eq!(n_accelerations(&parsed(&numbers)), 6);
    // One mass for both in one sum.
    let sum = replaced(&original, "ma/2*dot(va, va) + mb/2*dot(vb, vb)", "ma/2*(dot(va, va) + dot(vb, vb))");
    let sum = replaced(&sum, "param mb = 0.3 where mb > 0;", "let mb = ma;");
    assert_eq!(n_accelerations(&parsed(&sum)), 6);
}

#[test]
fn a_plane_turns_with_an_angle() {
    let polar = "model polar {
        param m = 2 where m > 0;
        coordinate r in real;
        coordinate theta in angle;
        let v = [r_dot - 2*theta_dot, (r + 1)*theta_dot];
        lagrangian = m/2*dot(v, v) - r^2*cos(theta);
    }";
    assert_eq!(n_accelerations(&parsed(polar)), 1);
    // Units of components that are no squares of rationals leave it to the momenta.
    let scaled = polar.replace("dot(v, v)", "(v[1]^2 + 3*v[2]^2)");
    assert_eq!(n_accelerations(&parsed(&scaled)), 0);
    // A mass that is a number, and units of components that make it several.
    assert_eq!(n_accelerations(&parsed(&polar.replace("m/2*", "3/2*"))), 1);
    assert_eq!(n_accelerations(&parsed(&polar.replace("m/2*", "").replace("[r_dot", "2*[r_dot"))), 1);
    // The first component backwards: the frame turns the other way.
    assert_eq!(n_accelerations(&parsed(&polar.replace("[r_dot - 2*theta_dot,", "[2*theta_dot - r_dot,"))), 1);
}

#[test]
fn a_velocity_with_a_part_of_its_own_has_a_frame_that_does_not_turn() {
    let wind = "model wind {
        param m = 2 where m > 0;
        param w = 3;
        coordinate x in real;
        coordinate y in real;
        let v = [x_dot*(x^2 + x) + WIND, y_dot - 2*x_dot];
        lagrangian = m/2*dot(v, v) - x^2;
    }";
    assert_eq!(n_accelerations(&parsed(&wind.replace("WIND", "w"))), 1);
    assert_eq!(n_accelerations(&parsed(&wind.replace("WIND", "w*y"))), 0);
    assert_eq!(
        n_accelerations(&parsed(
            &wind.replace("x_dot*(x^2 + x) + WIND", "y_dot").replace("y_dot - 2*x_dot", "y*x_dot + w")
        )),
        0
    );
}

#[test]
fn a_curved_surface_has_no_frame_that_turns_with_its_coordinates() {
    let sphere = "model sphere {
        param m = 2 where m > 0;
        coordinate theta in (0, pi);
        coordinate phi in angle;
        let v = [theta_dot, sin(theta)*phi_dot];
        lagrangian = m/2*dot(v, v) - cos(theta);
    }";
    assert_eq!(n_accelerations(&parsed(sphere)), 0);
}
