//! Velocities without inertia of their own that multipliers tie to velocities that have some: the motion of the same
//! system in independent velocities, and everything that a scene may want of it.

use hamel_codegen::scene::{self, BuiltScene, Made, build_tampered};
use hamel_codegen::spec::{self, Model};
use hamel_program::program::Role;

/// A bead on a wire that turns with the time, the middle of a massless rod and its far end, which is pushed; the scene
/// `own` has the bead alone.
fn text(how: &str, wants: &str) -> String {
    format!(
        "model bead {{
            param m = 2 where m > 0;
            param g = 9.81;
            coordinate x, y in real;
            coordinate z, w, s in real;
            constraint wire: y = x^2/2 + sin(t)*x/5;
            constraint half: z = (x + sin(w))/2;
            constraint far: w^3 + w = x + y/3;
            constraint rolls: s_dot = cos(x)*x_dot + w_dot;
            {how}
            lagrangian = m/2*(x_dot^2 + y_dot^2) - m*g*y - 3*z;
            force w_dot = -w_dot/2; force s_dot = cos(s);
            initial x = 0.4; initial x_dot = 1;
            scene all {{ want {wants}; }}
        }}"
    )
}

fn model(text: &str) -> Model {
    spec::parse("bead.hamel", text).unwrap_or_else(|e| panic!("{e}"))
}

fn build(text: &str) -> BuiltScene {
    let built = scene::build(&model(text), "all").unwrap_or_else(|e| panic!("{e}\n{text}"));
    assert!(built.certificate().open.is_empty(), "{:?}\n{text}", built.certificate().open);
    built
}

#[test]
fn massless_velocities_move_as_the_independent_ones_say() {
    let [kept, own] =
        [("multipliers;", ""), ("independent x_dot;", "")].map(|(how, _)| build(&text(how, "rhs, energy")));
    let names = |built: &BuiltScene| built.state().iter().map(|s| s.name.clone()).collect::<Vec<_>>();
    let (all, few) = (names(&kept), names(&own));
    for (t, x, x_dot) in [(0.0_f64, 0.4_f64, 1.0_f64), (1.3, -0.7, 0.2), (2.9, 1.6, -2.0)] {
        // The place of the rod follows from that of the bead, and so do velocities.
        let y = x * x / 2.0 + t.sin() * x / 5.0;
        let y_dot = (x + t.sin() / 5.0) * x_dot + t.cos() * x / 5.0;
        let mut w = 0.0_f64;
        for _ in 0..60 {
            w -= (w.powi(3) + w - x - y / 3.0) / (3.0 * w * w + 1.0);
        }
        let w_dot = (x_dot + y_dot / 3.0) / (3.0 * w * w + 1.0);
        let (z, z_dot) = ((x + w.sin()) / 2.0, (x_dot + w.cos() * w_dot) / 2.0);
        let s_dot = x.cos() * x_dot + w_dot;
        let value = |name: &str| match name {
            "x" => x,
            "y" => y,
            "z" => z,
            "w" => w,
            "s" => 0.3,
            "x_dot" => x_dot,
            "y_dot" => y_dot,
            "z_dot" => z_dot,
            "w_dot" => w_dot,
            "s_dot" => s_dot,
            other => panic!("{other}"),
        };
        let rates = |built: &BuiltScene, names: &[String]| {
            let y: Vec<f64> = names.iter().map(|name| value(name)).collect();
            let prepared = built.prepare(&[2.0, 9.81]).unwrap_or_else(|e| panic!("{e:?}"));
            let mut dy = vec![0.0; y.len()];
            prepared.rhs(t, &y, &mut dy);
            dy
        };
        let (found, expected) = (rates(&kept, &all), rates(&own, &few));
        for (name, expected) in few.iter().zip(&expected) {
            let k = all.iter().position(|other| other == name).unwrap();
            assert!(
                (found[k] - expected).abs() < 1e-12 * (1.0 + expected.abs()),
                "{name}' {} {expected}",
                found[k]
            );
        }
    }
}

#[test]
fn what_a_scene_wants_of_massless_velocities_is_held_to_its_definition() {
    let wants = "rhs, energy, energy_rate, momentum, multipliers, constraint, jacobian, jvp, vjp, sensitivity, \
                 time_derivative, inverse_dynamics, bias, gravity, implicit";
    let built = build(&text("multipliers;", wants));
    for name in ["jacobian", "jvp", "vjp", "sensitivity", "inverse_dynamics", "multipliers", "implicit"] {
        assert!(built.certificate().held.keys().any(|held| held.contains(name)), "{name}");
    }
}

#[test]
fn faults_in_rates_without_inertia_and_multipliers_are_found() {
    let model = model(&text("multipliers;", "rhs, multipliers"));
    for (role, [i, j]) in [(Role::Rate, [7, 8]), (Role::Output("multipliers".into()), [1, 2])] {
        let exchanged = |made: Made<'_>| {
            let Made::Program(program) = made else { return };
            let function = program.functions.iter_mut().find(|f| f.role == role).expect("wanted");
            let [a, b] = [function.results[i].1, function.results[j].1];
            (function.results[i].1, function.results[j].1) = (b, a);
        };
        let told = build_tampered(&model, "all", &exchanged).expect_err("refused").to_string();
        assert!(told.contains("disagrees with its definition"), "{told}");
    }
    assert!(build_tampered(&model, "all", &|_| {}).is_ok());
}

#[test]
fn a_direction_that_constraints_allow_needs_inertia() {
    let free = text("multipliers;", "rhs").replace("constraint half: z = (x + sin(w))/2;", "");
    let told = scene::build(&model(&free), "all").expect_err("refused").to_string();
    assert!(told.contains("no inertia along z_dot"), "{told}");
}
