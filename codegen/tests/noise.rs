//! White noise: certified on algebras of all kinds, beside the nonholonomic bracket, and deliberate faults.

use hamel_codegen::scene::{self, BuiltScene, Made, build_tampered};
use hamel_codegen::spec::{self, Model};
use hamel_runtime::Dual;

fn model(text: &str) -> Model {
    spec::parse("noise.hamel", text).unwrap_or_else(|e| panic!("{e}"))
}

fn build(text: &str, scene: &str) -> BuiltScene {
    let built = scene::build(&model(text), scene).unwrap_or_else(|e| panic!("{e}\n{text}"));
    assert!(built.certificate().open.is_empty(), "{:?}\n{text}", built.certificate().open);
    built
}

/// A top with an advected direction, by its Hamiltonian.
const TOP: &str = "model top {
    param I: diagonal(3) = [1.3, 1.7, 0.6] where I1 > 0, I2 > 0, I3 > 0;
    param xi: vector(3) = [0.3, 0.2, 0.1];
    momentum Pi in so(3);
    advected Gamma in R^3 by cross(dh_dPi, Gamma);
    hamiltonian = Pi1^2/(2*I1) + Pi2^2/(2*I2) + Pi3^2/(2*I3) + 3*Gamma3;
    noise W1: dot(xi, Pi);
    noise W2: Gamma1*Pi2 + Gamma3^2;
    output h1 = dot(xi, Pi);
    output h2 = Gamma1*Pi2 + Gamma3^2;
    casimir vertical = dot(Pi, Gamma);
    reconstruct q in SO(3) from dh_dPi;
    scene s { input W1, W2; want rhs, energy, outputs, bracket; }
    scene group { input W1, W2; want rhs, energy, reconstruction; }
}";
/// The same by a Lagrangian, in velocities and in momenta.
const BODY: &str = "model body {
    param I: diagonal(3) = [1.3, 1.7, 0.6] where I1 > 0, I2 > 0, I3 > 0;
    velocity Omega in so(3);
    momentum Pi of Omega;
    advected Gamma in R^3 by cross(Omega, Gamma);
    lagrangian = dot(Omega, I*Omega)/2 + Omega1*Omega2/5 - 3*Gamma3;
    noise W1: Pi1*Pi3/2;
    noise W2: Gamma1*Pi2;
    output h1 = Pi1*Pi3/2;
    output h2 = Gamma1*Pi2;
    scene s { input W1, W2; want rhs, energy, outputs, bracket; }
    scene carried { input W1, W2; carry Pi; want rhs, energy, energy_rate, outputs, bracket; }
}";
/// A sleigh whose blade does not slip, with a shape: the constraint is solved.
const SLEIGH: &str = "model sleigh {
    param m = 1.2 where m > 0; param J = 0.3 where J > 0; param a = 0.2;
    coordinate x in real;
    velocity omega, v in se(2);
    momentum p of x_dot; momentum L of omega; momentum P of v;
    lagrangian = m*(v1^2 + (v2 + a*omega)^2)/2 + J*omega^2/2 + (x_dot + omega*cos(x))^2/3 + v1*x_dot/4 + cos(x);
    constraint v2 = omega*sin(x);
    noise W1: p*L/3 + x*P1;
    noise W2: L^2/2 + sin(x);
    output h1 = p*L/3 + x*P1;
    output h2 = L^2/2 + sin(x);
    reconstruct phi, X, Y in SE(2) from omega, v;
    scene s { input W1, W2; want rhs, energy, outputs, bracket; }
    scene group { input W1, W2; want rhs, energy, reconstruction; }
}";
/// A cart with a pendulum: noise of positions beside multipliers, and noise that the model mentions.
const CART: &str = "model cart {
    param m = 0.7 where m > 0;
    coordinate x, y in real;
    coordinate theta in angle;
    momentum p of theta_dot;
    state i in real by i_dot = W3 - i;
    lagrangian = x_dot^2 + y_dot^2/2 + m*theta_dot*x_dot*cos(theta) + theta_dot^2/2 + cos(theta);
    force x_dot = i + x*W3;
    noise W1: sin(theta) + x^2;
    noise W2: p*cos(theta);
    noise W3;
    scene s { input W1, W2, W3; want rhs, energy, energy_rate, jacobian, jvp, linearization; }
    scene points { input W1, W2; circle theta; want rhs, energy; }
}";
/// Squares of velocities whose directions turn with coordinates that noise moves.
const PENDULUM: &str = "model pendulum {
    coordinate a, b in angle;
    momentum p of a_dot; momentum q of b_dot;
    let v = a_dot*[cos(a), sin(a)] + b_dot*[cos(b), sin(b)];
    lagrangian = (a_dot^2 + dot(v, v))/2 + cos(a) + cos(b);
    noise W1: p*cos(a);
    noise W2: p*q;
    output h1 = p*cos(a);
    output h2 = p*q;
    scene s { input W1, W2; want rhs, energy, outputs, bracket; }
    scene derivatives_of_it { input W1, W2; want rhs, jacobian, jvp, vjp, linearization, inverse_dynamics, mass_matrix; }
}";
/// Links, each written by the one before it, of which noise moves some.
const CHAIN: &str = "model chain {
    size n = 4;
    coordinate q: vector(n) in angle;
    momentum p of q_dot;
    let u[0] = [0, 0];
    for k in 1..n { let u[k] = u[k - 1] + rot(q[k])*[0, q_dot[k]]; }
    lagrangian = sum(dot(u[k], u[k])/2 + cos(q[k]) for k in 1..n);
    noise W1: p1*q2 + p3^2/2;
    noise W2: sin(q4);
    scene s { input W1, W2; want rhs, energy, jacobian; }
    scene still { input W2; want rhs, energy, jacobian; }
}";
/// A body in space by angles.
const ANGLES: &str = "model angles {
    coordinate phi, theta, psi in angle;
    momentum p of phi_dot; momentum q of theta_dot;
    let R = rot(e3, phi)*rot(e1, theta)*rot(e3, psi);
    body top { mass 1; place R*[0, 0, 0.5]; inertia diag([1, 2, 3]); attitude R; }
    lagrangian = top_energy - R[3, 3];
    noise W1: q + p*psi;
    noise W2: p^2/2;
    scene s { input W1, W2; want rhs, energy; }
}";
/// A plane pendulum whose rod is kept by a multiplier.
const ROD: &str = "model rod {
    coordinate x, y in real;
    lagrangian = x_dot^2 + y_dot^2/2 + y;
    constraint x*x_dot + y*y_dot = 0;
    multipliers;
    initial x = 0.6; initial y = 0.8;
    noise W: x*y;
    scene s { input W; want rhs, energy, energy_rate, multipliers; }
}";

/// Velocities and momenta along stages, in a frame that turns with a coordinate that the noise moves.
const STAGED: &str = "model staged {
    coordinate x, y in real;
    velocity u, v, z in heisenberg(1);
    connection u = x*y_dot;
    lagrangian = (1 + x^2)*x_dot^2/2 + y_dot^2/2 + u^2/2 + v^2/2 + z^2 + u*z/5 + x_dot*v/4 - x^2;
    constraint y_dot = x*x_dot + u/3;
    independent x_dot, u, v, z;
    momentum p of x_dot; momentum P of u; momentum Q of v; momentum R of z;
    noise W1: p*R/3 + p^2 + x*P;
    noise W2: p*P/4 + Q*R;
    output h1 = p*R/3 + p^2 + x*P;
    output h2 = p*P/4 + Q*R;
    stage plane;
    stage line = ideal(v, z) { connection z = x^2*x_dot; }
    stage centre = ideal(z);
    momentum B of stages;
    scene s { input W1, W2; want rhs, energy, outputs, bracket; }
    scene levels { input W1, W2; carry stages; want rhs, energy, outputs, bracket; }
    scene momenta { input W1, W2; carry B; want rhs, energy, outputs, bracket; }
    scene mixed { input W1, W2; carry stages, B_centre; want rhs, energy, outputs, bracket; }
}";

/// The same with an inner product that depends on the coordinate: the frame turns with the levels as well.
fn turning() -> String {
    STAGED
        .replace(", bracket;", ";")
        .replace("stage plane;", "inner_product = [[2 + x^2, 0, x], [0, 1, x], [x, x, 3]]; stage plane;")
}

#[test]
fn noise_is_held_to_its_definition() {
    for (text, scenes) in [
        (TOP, &["s", "group", "stochastic", "default"][..]),
        (BODY, &["s", "carried", "stochastic"]),
        (SLEIGH, &["s", "group", "stochastic"]),
        (CART, &["s", "points", "stochastic"]),
        (ROD, &["s", "stochastic"]),
        (STAGED, &["s", "levels", "momenta", "mixed", "stochastic"]),
        (PENDULUM, &["s", "derivatives_of_it"]),
        (CHAIN, &["s", "still"]),
        (ANGLES, &["s"]),
        (&turning(), &["levels", "momenta", "mixed"]),
    ] {
        scenes.iter().for_each(|scene| _ = build(text, scene));
    }
}

/// Rates by a unit of one noise, beside those without.
fn by_noise(built: &BuiltScene, (k, n): (usize, usize), t: f64, y: &[f64]) -> Vec<f64> {
    let params: Vec<f64> = built.params().iter().map(|p| hamel_expr::rational_to_f64(&p.default)).collect();
    let scene = built.prepare(&params).unwrap_or_else(|e| panic!("{e:?}"));
    let (mut still, mut moved) = (vec![0.0; y.len()], vec![0.0; y.len()]);
    let unit: Vec<f64> = (0..n).map(|j| f64::from(u8::from(j == k))).collect();
    scene.rhs_with(t, y, &vec![0.0; n], &mut still);
    scene.rhs_with(t, y, &unit, &mut moved);
    moved.iter().zip(still).map(|(a, b)| a - b).collect()
}

/// The fields of noises are `Pi dh` with the bracket of the scene's state, which another derivation makes.
#[test]
fn noise_moves_along_the_bracket() {
    let staged = ["s", "levels", "momenta", "mixed"].map(|name| (STAGED, name));
    for (text, name) in
        [(TOP, "s"), (BODY, "s"), (BODY, "carried"), (SLEIGH, "s"), (PENDULUM, "s")].into_iter().chain(staged)
    {
        let built = build(text, name);
        let params: Vec<f64> =
            built.params().iter().map(|p| hamel_expr::rational_to_f64(&p.default)).collect();
        let names = built.state_names();
        let y: Vec<f64> = (0..names.len()).map(|k| (1.3 * k as f64 + 0.4).sin()).collect();
        let scene = built.prepare(&params).unwrap_or_else(|e| panic!("{e:?}"));
        let outputs = built.outputs().iter().find(|o| o.name == "bracket").unwrap();
        let brackets: Vec<&String> = outputs.components.iter().map(|(name, _)| name).collect();
        let values = scene.output("bracket", 0.3, &y).unwrap();
        let executable = built.executable();
        let duals: Vec<Dual> = params.iter().map(|p| Dual::constant(*p)).collect();
        let over = executable.prepare_over(&duals).unwrap_or_else(|e| panic!("{e:?}"));
        for (k, h) in ["h1", "h2"].iter().enumerate() {
            let slope = |i: usize| {
                let at: Vec<Dual> =
                    y.iter().enumerate().map(|(j, y)| Dual::new(*y, f64::from(u8::from(i == j)))).collect();
                over.output(h, Dual::constant(0.3), &at).unwrap()[0].derivative
            };
            let slopes: Vec<f64> = (0..y.len()).map(slope).collect();
            let entry = |a: &str, b: &str| {
                let of = |a: &str, b: &str| {
                    let name = format!("bracket_{a}_{b}");
                    brackets.iter().position(|own| **own == name).map(|place| values[place])
                };
                of(a, b).or_else(|| of(b, a).map(|e| -e)).unwrap_or(0.0)
            };
            let along = by_noise(&built, (k, 2), 0.3, &y);
            assert!(along.iter().any(|rate| rate.abs() > 1e-3), "{name}: {along:?}");
            for (i, a) in names.iter().enumerate() {
                let defined: f64 = names.iter().zip(&slopes).map(|(b, slope)| entry(a, b) * slope).sum();
                assert!((along[i] - defined).abs() < 1e-12, "{name} {h} {a}: {} and {defined}", along[i]);
            }
        }
    }
}

/// Algebras with full quadratic energies, both sides of the action: the certificate holds for each.
#[test]
fn noise_on_algebras_of_all_kinds() {
    for (algebra, n) in [("so(3)", 3), ("se(2)", 3), ("sl(2)", 3), ("heisenberg(1)", 3), ("so(4)", 6)] {
        for side in ["left", "right"] {
            let p = |k: usize| format!("p{}", k + 1);
            let square: Vec<String> = (0..n).map(|k| format!("{}*{}^2/2", k + 2, p(k))).collect();
            let mixed: Vec<String> = (1..n).map(|k| format!("{}*{}/{}", p(k - 1), p(k), k + 3)).collect();
            let cubic: Vec<String> = (1..n).map(|k| format!("{}^2*{}/{}", p(k - 1), p(k), k + 1)).collect();
            let text = format!(
                "model m {{
                    momentum {} in {algebra};
                    action {side};
                    hamiltonian = {} + {};
                    noise V: {};
                    noise W: sin({})*{};
                }}",
                (0..n).map(p).collect::<Vec<String>>().join(", "),
                square.join(" + "),
                mixed.join(" + "),
                cubic.join(" - "),
                p(0),
                p(n - 1),
            );
            build(&text, "stochastic");
        }
    }
}

#[test]
fn deliberate_faults_are_found() {
    type Fault = fn(Made<'_>);
    let faults: [(&str, &str, &str, Fault); 7] = [
        ("half a force of noise along a level", STAGED, "levels", |made| {
            if let Made::System(s) = made {
                let w = s.graph.sym(s.noises[0]);
                let half = s.graph.scale(w, &hamel_expr::Rational::new(1.into(), 2.into()));
                let along = std::collections::BTreeMap::from([(s.noises[0], half)]);
                s.forces[0] = s.graph.subs(s.forces[0], &along).unwrap();
            }
        }),
        ("the sign of a transport", BODY, "s", |made| {
            if let Made::System(s) = made {
                let (_, rate) = &mut s.noise_rates[0];
                *rate = s.graph.neg(*rate);
            }
        }),
        ("a transport that is dropped", SLEIGH, "s", |made| {
            if let Made::System(s) = made {
                s.noise_rates.clear();
            }
        }),
        ("half a force of noise", BODY, "carried", |made| {
            if let Made::System(s) = made {
                let w = s.graph.sym(s.noises[0]);
                let half = s.graph.scale(w, &hamel_expr::Rational::new(1.into(), 2.into()));
                let along = std::collections::BTreeMap::from([(s.noises[0], half)]);
                s.forces[1] = s.graph.subs(s.forces[1], &along).unwrap();
            }
        }),
        ("noise that does not move the group", TOP, "group", |made| {
            if let Made::System(s) = made {
                let still = s.noises.iter().map(|w| (*w, s.graph.zero())).collect();
                for coordinate in &mut s.reconstruction {
                    coordinate.rate = s.graph.subs(coordinate.rate, &still).unwrap();
                }
            }
        }),
        ("the force of a position without its sign", CART, "s", |made| {
            if let Made::System(s) = made {
                let w = s.graph.sym(s.noises[0]);
                let along = std::collections::BTreeMap::from([(s.noises[0], s.graph.neg(w))]);
                s.forces[0] = s.graph.subs(s.forces[0], &along).unwrap();
            }
        }),
        ("a power of noise that is left out", CART, "s", |made| {
            if let Made::Equations(e) = made {
                e.energy_rate = e.system.graph.zero();
            }
        }),
    ];
    for (name, text, scene, fault) in faults {
        match build_tampered(&model(text), scene, &fault) {
            Ok(built) => panic!("{name}: {}", built.certificate().sentence()),
            Err(problem) => {
                let text = problem.to_string();
                assert!(text.contains("disagrees with its definition"), "{name}: {text}");
            }
        }
    }
}

#[test]
fn what_is_no_noise_is_refused() {
    let refused = |text: &str, scene: &str, expected: &str| {
        let text = format!("model m {{ {text} }}");
        let found = spec::parse("m.hamel", &text).and_then(|model| scene::build(&model, scene).map(|_| ()));
        let problems = found.unwrap_err().to_string();
        assert!(problems.contains(expected), "{problems}");
    };
    let x = "coordinate x in real; momentum p of x_dot; lagrangian = x_dot^2/2;";
    refused(
        &format!("{x} noise W; noise V: p; force x_dot = W*V;"),
        "stochastic",
        "is not linear in the noise `W`",
    );
    refused(
        &format!("{x} noise W; force x_dot = W^2;"),
        "stochastic",
        "the force on `x_dot` is not linear in the noise",
    );
    refused(&format!("{x} noise W: x_dot;"), "stochastic", "contains the velocity `x_dot`");
    refused(&format!("{x} noise W: p; output o = W;"), "stochastic", "`o` contains the noise `W`");
    refused(&format!("{x} noise W: p; drive W = 1;"), "stochastic", "`W` is driven, which is a noise");
    refused(&format!("{x} noise W: p; scene s {{ fix W = 1; }}"), "s", "fixes `W`, which is a noise");
    refused(
        "coordinate x in real; field x_dot = -x; noise W: x;",
        "stochastic",
        "moves nothing: the model gives its motion",
    );
    refused(
        "coordinate x, y in real; momentum p of x_dot; lagrangian = x_dot^2 + y_dot^2; constraint x_dot = y*y_dot; \
         multipliers; noise W: p;",
        "stochastic",
        "multipliers keep a constraint",
    );
    refused(
        "coordinate x, y in real; momentum p of x_dot; lagrangian = x_dot^2 + y_dot^2; constraint x_dot = y*y_dot; \
         independent y_dot; noise W: p;",
        "stochastic",
        "which the constraints determine",
    );
    refused(
        "coordinate x, y in real; momentum p of y_dot; lagrangian = x_dot^2 + y_dot^2; constraint x_dot = y*y_dot; \
         virtual delta(x_dot) = 2*y*delta(y_dot); noise W: p;",
        "stochastic",
        "no velocities that the constraints allow",
    );
}

#[test]
fn explanations_tell_noises() {
    let scene = build(CART, "s");
    let text = hamel_codegen::explain::explain(&model(CART), &scene, hamel_expr::Style::Plain);
    assert!(text.contains("along the Hamiltonian vector field of a function"), "{text}");
    assert!(text.contains("Noise that the model mentions: W3."), "{text}");
}
