//! Hamiltonian models: the motion of the Lagrangian that a Legendre transform relates them to.

use hamel_codegen::scene::build;
use hamel_codegen::spec::{Model, parse};
use hamel_mechanics::mechanics::{Equations, derive};
use hamel_mechanics::reduction::{Formulation, reduce};

fn model(text: &str) -> Model {
    parse("m.hamel", text).unwrap_or_else(|e| panic!("{e}"))
}

fn derived(text: &str) -> Equations {
    let model = model(text);
    derive(&reduce(&model, &Formulation::of(&model)).unwrap_or_else(|e| panic!("{e}"))).expect("equations")
}

/// Rates of a scene's state, which all `values` are of, one after the other.
fn rates(text: &str, values: &[f64]) -> Vec<f64> {
    let model = model(text);
    let scene = build(&model, "default").unwrap_or_else(|e| panic!("{e}"));
    let params: Vec<f64> = model.params.iter().map(|p| hamel_expr::rational_to_f64(&p.default)).collect();
    let interpreter = scene.prepare(&params).expect("parameters");
    let mut out = vec![0.0; values.len()];
    interpreter.rhs(0.3, values, &mut out);
    out
}

/// Two expressions of one rate, each a few tens of roundings of terms of order one to ten: 450 units of roundoff.
fn close(a: &[f64], b: &[f64]) {
    assert_eq!(a.len(), b.len());
    for (x, y) in a.iter().zip(b) {
        assert!((x - y).abs() <= 1e-13 * (1.0 + x.abs()), "{a:?} {b:?}");
    }
}

/// The same system from both sides: items that both have, the Lagrangian side, the Hamiltonian side.
fn both(common: &str, lagrangian: &str, hamiltonian: &str, state: &[f64]) {
    let text = |more: &str| format!("model m {{ {common} {more} }}");
    let (a, b) = (rates(&text(lagrangian), state), rates(&text(hamiltonian), state));
    close(&a, &b);
}

#[test]
fn lie_poisson_equations_are_those_of_the_lagrangian_in_momenta() {
    for action in ["left", "right"] {
        let common = format!(
            "param I: diagonal(3) = [1.3, 1.7, 0.6]; velocity Omega in so(3); momentum Pi of Omega; action {action};
             advected Gamma in R^3 by cross(Omega, Gamma); force Omega = -0.1*Omega + [t, 0, 0];"
        );
        both(
            &common,
            "lagrangian = dot(Omega, I*Omega)/2 + Omega1/3 - Gamma3^2 - t*Gamma1; carry Pi;",
            "hamiltonian = (Pi1 - 1/3)^2/(2*I1) + Pi2^2/(2*I2) + Pi3^2/(2*I3) + Gamma3^2 + t*Gamma1;",
            &[0.4, -0.3, 1.1, 0.2, 0.5, -0.7],
        );
    }
}

#[test]
fn a_bundle_with_a_connection_has_its_equations_on_the_dual() {
    let common = "coordinate x, z in real; velocity v, w in R^2; connection v = z*x_dot; connection w = x*z_dot - z*x_dot;
        momentum a of x_dot; momentum b of z_dot; momentum c of v; momentum d of w; force z_dot = x;";
    both(
        common,
        "lagrangian = (2*x_dot^2 + z_dot^2 + 3*v^2 + 4*w^2)/2 - x^2*z; carry a, b, c, d;",
        "hamiltonian = a^2/4 + b^2/2 + c^2/6 + d^2/8 + x^2*z;",
        &[0.3, -0.4, 0.7, 0.2, -0.6, 0.9],
    );
}

#[test]
fn constraints_on_the_dual_are_those_on_velocities() {
    // Suslov: the state of the Hamiltonian has all momenta, the Lagrangian's multiplier form as well.
    let common = "param k = 0.3; velocity Omega in so(3); momentum Pi of Omega; advected Gamma in R^3 by cross(Omega, Gamma);
        constraint Omega3 = k*Gamma1;";
    // On the constraint: Omega3 = Pi3/4 = k Gamma1.
    both(
        common,
        "lagrangian = (2*Omega1^2 + 3*Omega2^2 + 4*Omega3^2)/2 - Gamma2; multipliers; carry Pi;",
        "hamiltonian = Pi1^2/4 + Pi2^2/6 + Pi3^2/8 + Gamma2;",
        &[0.5, -0.4, 4.0 * 0.3 * 0.6, 0.6, 0.2, -0.1],
    );
}

#[test]
fn a_hamiltonian_need_not_be_quadratic_nor_regular() {
    // A relativistic particle, and one without mass.
    let fast = rates(
        "model m { coordinate x in real; momentum p of x_dot; hamiltonian = sqrt(1 + p^2) + x^2/2; }",
        &[0.5, 2.0],
    );
    close(&fast, &[2.0 / 5.0_f64.sqrt(), -0.5]);
    let light =
        rates("model m { coordinate x in real; momentum p of x_dot; hamiltonian = 3*p - x; }", &[0.5, 2.0]);
    close(&light, &[3.0, 1.0]);
}

#[test]
fn energy_casimirs_and_cyclic_momenta_are_proved() {
    let top = derived(
        "model m { momentum Pi in so(3); advected Gamma in R^3 by cross(dh_dPi, Gamma);
         hamiltonian = Pi1^2/2 + Pi2^2/3 + Pi3^2 + Pi1^4 + Gamma1*Gamma2; casimir C = dot(Pi, Gamma); casimir D = dot(Gamma, Gamma); }",
    );
    assert!(top.facts.energy_is_conserved);
    assert_eq!(top.facts.casimirs, ["C", "D"]);
    let pendulum =
        "param J = 0.7; coordinate theta in (0, pi); coordinate phi in angle; momentum p of theta_dot;
        momentum q of phi_dot; hamiltonian = p^2/2 + q^2/(2*sin(theta)^2) - cos(theta)";
    let reduced = derived(&format!("model m {{ {pendulum}; routh phi = J; }}"));
    let names: Vec<&str> = reduced.state.iter().map(|s| s.name.as_str()).collect();
    assert_eq!(names, ["theta", "p"]);
    assert_eq!(reduced.reconstruction[0].name, "phi");
    let whole = rates(&format!("model m {{ {pendulum}; }}"), &[1.1, 0.4, 0.2, 0.7]);
    let part = rates(&format!("model m {{ {pendulum}; routh phi = J; }}"), &[1.1, 0.2]);
    close(&[whole[0], whole[2]], &part);
    let broken = model(&format!("model m {{ {pendulum} + sin(phi); routh phi = J; }}"));
    let system = reduce(&broken, &Formulation::of(&broken)).unwrap();
    let error = derive(&system).unwrap_err().to_string();
    assert!(error.contains("the momentum along phi_dot is no parameter: its rate is -cos(phi)"), "{error}");
}
