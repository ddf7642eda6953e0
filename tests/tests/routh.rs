//! Routhians: effective potentials and curvature forces that are known in closed form, and that their equation is the
//! motion for both sides of the action, any connection and cyclic coordinates.

use std::collections::BTreeMap;

use hamel_codegen::spec::parse;
use hamel_expr::{ExprId, Graph};
use hamel_mechanics::mechanics::{Equations, Routhian, derive};
use hamel_mechanics::reduction::{Formulation, reduce};

fn derived(items: &str) -> Equations {
    let model = parse("m.hamel", &format!("model m {{ {items} }}")).unwrap_or_else(|e| panic!("{e}"));
    derive(&reduce(&model, &Formulation::of(&model)).unwrap_or_else(|e| panic!("{e}"))).expect("equations")
}

fn routhian(items: &str) -> Routhian {
    Routhian::new(&derived(items)).unwrap_or_else(|| panic!("no Routhian of {items}"))
}

/// Values of an expression at some numbers by name.
fn value(g: &Graph, e: ExprId, at: &[(&str, f64)]) -> f64 {
    let symbols: BTreeMap<_, _> = g
        .free_symbols(e)
        .into_iter()
        .map(|s| (s, at.iter().find(|(name, _)| *name == g.name(s)).expect("a value").1))
        .collect();
    g.eval_f64(e, &symbols).expect("a number")
}

#[test]
fn the_spherical_pendulum_has_its_effective_potential() {
    let r = routhian(
        "param p = 0.4; coordinate theta in (0, pi); coordinate phi in angle;
         lagrangian = (theta_dot^2 + sin(theta)^2*phi_dot^2)/2 + 9.81*cos(theta); routh phi = p;",
    );
    let names: BTreeMap<&str, ExprId> = r.names.iter().map(|(n, e)| (n.as_str(), *e)).collect();
    let at = [("theta", 0.8), ("p", 0.4), ("theta_dot", 0.3)];
    let w = value(&r.graph, names["w_phi_dot"], &at);
    let at = [at.as_slice(), &[("w_phi_dot", w)]].concat();
    let (sine, cosine) = 0.8_f64.sin_cos();
    let potential = 0.16 / (2.0 * sine * sine) - 9.81 * cosine;
    assert!((value(&r.graph, r.potential, &at) - potential).abs() < 1e-14);
    assert!((value(&r.graph, r.routhian, &at) - (0.045 - potential)).abs() < 1e-14);
    assert_eq!(r.forces.len(), 1);
    assert_eq!(r.forces[0].1, r.graph.zero());
}

#[test]
fn a_charge_in_a_magnetic_field_feels_its_curvature() {
    // Kaluza and Klein: the momentum of the circle is the charge, the curvature the field, here 1.
    let r = routhian(
        "param e = 1.5; coordinate x, y in real; coordinate s in angle;
         lagrangian = (x_dot^2 + y_dot^2 + (s_dot + x*y_dot)^2)/2; routh s = e;",
    );
    let at = [("e", 1.5), ("x_dot", 0.2), ("y_dot", -0.7), ("x", 0.9), ("y", 0.1)];
    let forces: Vec<f64> = r.forces.iter().map(|(_, f)| value(&r.graph, *f, &at)).collect();
    // e B_xy (ydot, -xdot) with B_xy = d_x A_y = 1.
    assert_eq!(forces, [1.5 * -0.7, -1.5 * 0.2]);
}

#[test]
fn its_equation_is_the_motion_for_groups_that_do_not_commute() {
    let body = "coordinate x, z in real; velocity Omega in so(3); routh Omega -> Pi;
        lagrangian = (2*Omega1^2 + (3 + x^2)*Omega2^2 + 4*Omega3^2)/2 + z*Omega1*x_dot + Omega3*(x*z_dot - z*x_dot)
            + (x_dot^2 + 2*z_dot^2)/2 - x*z^2 + Omega2/5;";
    let connections = ["", "connection Omega = [z*x_dot, x*z_dot, x_dot];", "connection mechanical;"];
    for side in ["left", "right"] {
        for connection in connections {
            let r = routhian(&format!("{body} action {side}; {connection}"));
            assert!(r.forces.iter().all(|(_, f)| *f != r.graph.zero()), "{side} {connection}");
        }
    }
}

#[test]
fn systems_of_other_kinds_have_none() {
    let body = "coordinate x in real; velocity Omega in so(3); momentum Pi of Omega; lagrangian = dot(Omega, Omega) + x_dot^2;";
    let all = format!("{body} momentum p of x_dot; carry Pi, p;");
    for items in [body.to_owned(), all, format!("{body} carry Pi; force x_dot = x;")] {
        assert!(Routhian::new(&derived(&items)).is_none(), "{items}");
    }
}
