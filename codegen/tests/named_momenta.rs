//! Momenta that a model names, in outputs: the same number whatever the state has, and held to their definition.

use hamel_codegen::scene::{self, BuiltScene, Made, build_tampered};
use hamel_codegen::spec::{self, Model};

fn model(text: &str) -> Model {
    spec::parse("momenta.hamel", text).unwrap_or_else(|e| panic!("{e}"))
}

fn build(text: &str, scene: &str) -> BuiltScene {
    let built = scene::build(&model(text), scene).unwrap_or_else(|e| panic!("{e}\n{text}"));
    assert!(built.certificate().open.is_empty(), "{:?}\n{text}", built.certificate().open);
    built
}

/// Velocities along a connection that a system of equations gives.
const CONNECTED: &str = "model connected {
    coordinate x in real;
    velocity u in R;
    lagrangian = x_dot^2/2 + u^2/2 + u*x_dot*sin(x)/3;
    connection mechanical;
    momentum p of x_dot; momentum P of u;
    output o = p + 2*P;
    noise W: p;
    scene plain { want rhs, energy, outputs, momentum, output_jacobian; }
    scene carried { carry p, P; want rhs, energy, outputs; }
    scene noisy { input W; want rhs, energy; }
    scene searched { formulation auto; want rhs, energy, outputs; }
    scene all { formulation auto(state); want rhs, energy, outputs; }
}";
/// Velocities along levels of which one is a combination.
const STAGED: &str = "model staged {
    velocity u, v in product(R, R);
    lagrangian = u^2/2 + v^2/2 + u*v/3;
    momentum P of u;
    output o = P;
    stage whole;
    stage line = ideal(v);
    inner_product = [[2, 0.3], [0.3, 1]];
    scene plain { want rhs, energy, outputs; }
    scene levels { carry stages; want rhs, energy, outputs, output_jacobian; }
}";

fn output(built: &BuiltScene, name: &str, y: &[f64]) -> Vec<f64> {
    built.prepare(&[]).unwrap_or_else(|e| panic!("{e:?}")).output(name, 0.0, y).unwrap()
}

#[test]
fn a_momentum_in_an_output_is_that_along_the_velocity_of_the_state() {
    // u is along the connection A = sin(x)/3: p = x_dot (1 - A^2), P = u.
    let (x, x_dot, u): (f64, f64, f64) = (1.0, 0.5, 0.7);
    let p = x_dot * (1.0 - (x.sin() / 3.0).powi(2));
    let plain = build(CONNECTED, "plain");
    assert!((output(&plain, "o", &[x, x_dot, u])[0] - (p + 2.0 * u)).abs() < 1e-15);
    let momenta = output(&plain, "momentum", &[x, x_dot, u]);
    assert!((momenta[0] - p).abs() < 1e-15 && (momenta[1] - u).abs() < 1e-15, "{momenta:?}");
    assert!((output(&build(CONNECTED, "carried"), "o", &[x, p, u])[0] - (p + 2.0 * u)).abs() < 1e-15);
    for scene in ["noisy", "searched", "all"] {
        build(CONNECTED, scene);
    }
    // One along the first level is u = 1, v = -0.3.
    assert!((output(&build(STAGED, "plain"), "o", &[1.0, 0.2])[0] - (1.0 + 0.2 / 3.0)).abs() < 1e-15);
    assert!((output(&build(STAGED, "levels"), "o", &[1.0, 0.5])[0] - (1.0 + 0.2 / 3.0)).abs() < 1e-15);
}

#[test]
fn a_momentum_along_something_else_is_found() {
    for (text, name) in [(CONNECTED, "plain"), (STAGED, "levels")] {
        let fault = |made: Made<'_>| {
            if let Made::System(s) = made {
                let velocity = s.graph.sym(s.unknowns[0].symbol);
                let part = s.graph.scale(velocity, &hamel_expr::Rational::new(1.into(), 9.into()));
                let e = s.outputs[0].components[0].1;
                s.outputs[0].components[0].1 = s.graph.add(e, part);
            }
        };
        match build_tampered(&model(text), name, &fault) {
            Ok(built) => panic!("{name}: {}", built.certificate().sentence()),
            Err(problem) => assert!(problem.to_string().contains("o of scene"), "{problem}"),
        }
    }
}
