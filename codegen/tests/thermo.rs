//! Systems with entropies (Gay-Balmaz, Yoshimura 2017, A Lagrangian variational formulation for nonequilibrium
//! thermodynamics I) against equations by hand; refusals of `virtual thermo`, and faults that are planted in it.

use hamel_codegen::scene::{self, BuiltScene, Made, build_tampered};
use hamel_codegen::spec::{self, Model};

fn model(items: &str) -> Model {
    spec::parse("m.hamel", &format!("model m {{ {items} }}")).unwrap_or_else(|e| panic!("{e}"))
}

fn build(items: &str) -> BuiltScene {
    scene::build(&model(items), "a").unwrap_or_else(|e| panic!("{e}"))
}

fn rates(built: &BuiltScene, params: &[f64], y: &[f64]) -> Vec<f64> {
    let mut dy = vec![0.0; y.len()];
    built.prepare(params).unwrap_or_else(|e| panic!("{e}")).rhs(0.0, y, &mut dy);
    dy
}

fn close(what: &str, found: f64, expected: f64) {
    assert!(
        (found - expected).abs() < 1e-13 * expected.abs().max(1.0),
        "{what}: {found}, by hand {expected}"
    );
}

/// Names of entropies, joined, and whether they are produced.
fn productions(built: &BuiltScene) -> Vec<(String, bool)> {
    let all = &built.equations().facts.entropies;
    all.iter().map(|p| (p.names.join(" + "), p.is_produced)).collect()
}

/// A mass on a spring with dry, viscous and quadratic friction (section 3.1).
const SPRING: &str = "param lam = 0.3 where lam >= 0; param mu = 0.2 where mu >= 0; param d = 0.5 where d >= 0;
    coordinate x, S in real; let T = exp(S/2); lagrangian = x_dot^2/2 - x^2 - 2*exp(S/2);
    constraint heat: T*S_dot = lam*x_dot^2 + mu*abs(x_dot) + d*abs(x_dot)*x_dot^2; virtual thermo; scene a { want energy; }";

#[test]
fn friction_of_several_degrees_heats() {
    let built = build(SPRING);
    let (x, v, s) = (0.7, -1.2_f64, 0.4_f64);
    let friction = -0.3 * v - 0.2 * v.signum() - 0.5 * v.abs() * v;
    let dy = rates(&built, &[0.3, 0.2, 0.5], &[x, v, s]);
    close("x''", dy[1], -2.0 * x + friction);
    close("S'", dy[2], -friction * v * (-s / 2.0).exp());
    assert!(built.equations().facts.energy_is_conserved);
    assert_eq!(productions(&built), [("S".to_owned(), true)]);
    // Nothing is said of the sign of the coefficient.
    let built = build(&SPRING.replace("lam = 0.3 where lam >= 0", "lam = 0.3"));
    assert_eq!(productions(&built), [("S".to_owned(), false)]);
}

/// A piston between two gases, with friction on both sides and heat through it (section 3.3).
const PISTONS: &str =
    "param lam: vector(2) = [0.3, 0.2] where lam1 >= 0, lam2 >= 0; param kappa = 0.7 where kappa >= 0;
    coordinate x in (0, 2); coordinate S: vector(2) in real;
    let T = [exp(S[1])*x^(-2/3), exp(S[2])*(2 - x)^(-2/3)];
    lagrangian = x_dot^2/2 - T[1] - T[2];
    constraint first: T[1]*S1_dot = lam1*x_dot^2 + kappa*(T[2] - T[1]);
    constraint second: T[2]*S2_dot = lam2*x_dot^2 + kappa*(T[1] - T[2]);
    virtual thermo; scene a { want energy; }";

#[test]
fn two_gases_exchange_heat_and_work() {
    let built = build(PISTONS);
    assert_eq!(built.state_names(), ["x", "x_dot", "S1", "S2"]);
    let (x, v, s): (f64, f64, [f64; 2]) = (0.8, 0.6, [0.3, -0.4]);
    let t = [s[0].exp() * x.powf(-2.0 / 3.0), s[1].exp() * (2.0 - x).powf(-2.0 / 3.0)];
    let dy = rates(&built, &[0.3, 0.2, 0.7], &[x, v, s[0], s[1]]);
    // U = T here, -dU/dx = 2/3 U/V.
    close("x''", dy[1], 2.0 / 3.0 * (t[0] / x - t[1] / (2.0 - x)) - 0.5 * v);
    close("S1'", dy[2], (0.3 * v * v + 0.7 * (t[1] - t[0])) / t[0]);
    close("S2'", dy[3], (0.2 * v * v + 0.7 * (t[0] - t[1])) / t[1]);
    assert!(built.equations().facts.energy_is_conserved);
    let of = |names: &str, is_produced| (names.to_owned(), is_produced);
    assert_eq!(productions(&built), [of("S1", false), of("S2", false), of("S1 + S2", true)]);
    // A part of the heat gets lost.
    let built = build(&PISTONS.replace("kappa*(T[1] - T[2])", "0.9*kappa*(T[1] - T[2])"));
    assert!(!built.equations().facts.energy_is_conserved);
    assert_eq!(productions(&built)[2], of("S1 + S2", false));
    // Heat that flows to the warmer side.
    let built = build(&PISTONS.replace("kappa >= 0", "kappa < 0").replace("kappa = 0.7", "kappa = -0.7"));
    assert_eq!(productions(&built)[2], of("S1 + S2", false));
}

/// A coil and a capacitor beside a resistor that heats: Kirchhoff's law is a linear constraint (section 3.2).
#[test]
fn a_circuit_with_a_node_heats() {
    let built = build(
        "param R = 0.4 where R > 0; coordinate q: vector(3) in real; coordinate S in real;
         lagrangian = q1_dot^2/2 - q2^2 - exp(S); constraint node: q1_dot = q2_dot + q3_dot;
         constraint heat: exp(S)*S_dot = R*q3_dot^2; virtual thermo; scene a { want energy; }",
    );
    // The voltage of the capacitor is 2 q2 = R q3'.
    assert!(built.equations().facts.energy_is_conserved);
    let names = built.state_names();
    let at = |name: &str| names.iter().position(|n| n == name).unwrap_or_else(|| panic!("{names:?}"));
    let mut y = vec![0.0; names.len()];
    (y[at("q1_dot")], y[at("q2")], y[at("S")]) = (0.9, 0.35, 0.2);
    let dy = rates(&built, &[0.4], &y);
    let current = 2.0 * 0.35 / 0.4;
    close("q1''", dy[at("q1_dot")], -2.0 * 0.35);
    close("q2'", dy[at("q2")], 0.9 - current);
    close("S'", dy[at("S")], 0.4 * current * current * (-0.2_f64).exp());
}

/// Diffusion through a membrane: amounts follow their potentials, and nothing moves (section 4.1).
#[test]
fn diffusion_through_a_membrane_heats() {
    let built = build(
        "param G = 0.6 where G >= 0; coordinate S in real; let u = [N1, N2];
         let T = exp(S)*(N1^2 + N2^2); let mu = 2*exp(S)*u;
         state N1 in real by N1_dot = -G*(mu[1] - mu[2]); state N2 in real by N2_dot = G*(mu[1] - mu[2]);
         lagrangian = -exp(S)*(N1^2 + N2^2); constraint heat: T*S_dot = G*(mu[1] - mu[2])^2; virtual thermo;
         initial N1 = 1; scene a { want energy; }",
    );
    let names = built.state_names();
    let (n, s): ([f64; 2], f64) = ([1.2, 0.5], 0.1);
    let value = |name: &String| match name.as_str() {
        "N1" => n[0],
        "N2" => n[1],
        _ => s,
    };
    let dy = rates(&built, &[0.6], &names.iter().map(value).collect::<Vec<_>>());
    let rate = |name: &str| dy[names.iter().position(|n| n == name).unwrap_or_else(|| panic!("{names:?}"))];
    let flow = 0.6 * 2.0 * s.exp() * (n[0] - n[1]);
    close("N1'", rate("N1"), -flow);
    close("S'", rate("S"), flow * flow / 0.6 / (s.exp() * (n[0] * n[0] + n[1] * n[1])));
    assert!(built.equations().facts.energy_is_conserved);
    assert_eq!(productions(&built).len(), 1);
}

/// The entropy of one gas decreases where heat leaves it: to say that it is produced is found at the points of the
/// check.
#[test]
fn a_wrong_claim_of_production_is_found() {
    let claim = |made: Made<'_>| {
        if let Made::Equations(equations) = made {
            equations.facts.entropies.iter_mut().for_each(|entropy| entropy.is_produced = true);
        }
    };
    let problem = build_tampered(&model(PISTONS), "a", &claim).expect_err("a wrong claim").to_string();
    assert!(problem.contains("the production of entropy S"), "{problem}");
}

#[test]
fn what_has_no_displacement_is_told() {
    let cases = [
        (
            "coordinate x, S in real; lagrangian = x_dot^2 - S^2; constraint S_dot = exp(x_dot) - 1; virtual thermo;",
            "`exp(x_dot)` has no degree above zero in the velocities",
        ),
        (
            "coordinate x, S in real; lagrangian = x_dot^2 - S^2; constraint S_dot = x_dot/abs(x_dot); virtual thermo;",
            "has no degree above zero in the velocities",
        ),
        (
            "coordinate x, y in real; lagrangian = x_dot^2 + y_dot^2; constraint ddt(x_dot) = y; virtual thermo;",
            "on accelerations is no power",
        ),
        (
            "coordinate x, S in real; lagrangian = x_dot^2 - S^2; constraint S*S_dot = x_dot^2;
          virtual S*delta(S_dot) = x_dot*delta(x_dot); virtual thermo;",
            "`virtual thermo` has displacements beside these",
        ),
        (
            "coordinate x, S in real; lagrangian = x_dot^2 - S^2; constraint S*S_dot = x_dot^2; virtual thermo; virtual thermo;",
            "`virtual thermo` is given twice",
        ),
        (
            "coordinate x, S in real; quasi_velocity u; lagrangian = x_dot^2 - S^2; constraint x_dot = 2*u;
             constraint S*S_dot = x_dot*u; virtual thermo;",
            "`virtual thermo` does not know the power of quasi-velocities",
        ),
    ];
    for (items, expected) in cases {
        let text = format!("model m {{ {items} }}");
        let found = spec::parse("m.hamel", &text).expect_err(items).to_string();
        assert!(found.contains(expected), "{items}: {found}");
    }
    // A parameter of that name is one.
    let model = model(
        "param thermo = 2; coordinate x, y in real; lagrangian = x_dot^2 + y_dot^2; constraint ddt(x_dot) = y; \
         virtual thermo: thermo*delta(y_dot) + delta(x_dot) = 0;",
    );
    assert_eq!(model.virtual_constraints[0].name, "thermo");
}

/// Displacements that are no powers of the constraints are found by the check of the scene.
#[test]
fn planted_faults_are_found() {
    for items in [SPRING, PISTONS] {
        let sound = model(items);
        let n = sound.all_velocities().len();
        for v in 0..sound.virtual_constraints.len() {
            for k in 0..n {
                let mut broken = sound.clone();
                let form = &mut broken.virtual_constraints[v].one_form;
                if form[k] == broken.graph.zero() {
                    continue;
                }
                form[k] = broken.graph.add(form[k], form[k]);
                let problem = scene::build(&broken, "a").expect_err("a fault").to_string();
                assert!(problem.contains("the power of the constraint"), "{v}, {k}: {problem}");
            }
        }
    }
}
