//! The right-hand side with angles as points of circles: the same numbers as without, compiled and interpreted.
//!
//! `circles/module.rs` is the module of `circles/model.hamel`. Write it again with
//! `UPDATE_EXPECT=1 cargo test -p hamel-codegen --test main circles`.

use std::ops::ControlFlow;

use expect_test::expect_file;
use hamel_codegen::scene::{self, BuiltScene, Writing};
use hamel_codegen::spec;
use hamel_program::program::{Circles as Found, Role};
use hamel_runtime::{Circles, DoubleDouble, Integrator, OnCircles, Options, Real, Scene, System, Vern9};

/// The module, as a crate has it.
mod module {
    include!("circles/module.rs");
}

fn built(text: &str, scene: &str) -> BuiltScene {
    let model = spec::parse("model.hamel", text).unwrap_or_else(|e| panic!("{e}"));
    scene::build(&model, scene).unwrap_or_else(|e| panic!("{e}"))
}

fn bodies() -> BuiltScene {
    built(include_str!("circles/model.hamel"), "default")
}

fn circles(text: &str) -> Option<Found> {
    Found::of(built(text, "default").program())
}

const STATES: [[f64; 4]; 4] =
    [[0.3, -1.2, 2.0, 0.7], [40.5, 3.0, -1.0, 5.0], [-7.0, 0.0, 0.0, 1.0], [0.0, 0.1, -0.2, 0.3]];

#[test]
fn the_module_is_the_one_that_was_compiled() {
    let command = "UPDATE_EXPECT=1 cargo test -p hamel-codegen --test main circles #".to_owned();
    let writing = Writing { command: Some(command), ..Writing::default() };
    expect_file!["circles/module.rs"].assert_eq(&bodies().emit_as(&writing).unwrap());
}

/// The components of the state have the bits that they have with the angles as numbers, and the points move with the
/// angles.
#[test]
fn derivatives_are_those_of_the_angles() {
    let scene = bodies();
    let found = Found::of(scene.program()).unwrap();
    assert_eq!((found.n_state, found.n_angles), (4, 2));
    let rate = &found.program.functions[Found::RATE];
    assert_eq!((rate.counts().transcendental, &rate.role), (0, &Role::Rate));
    let (interpreter, executable) = (scene.prepare(&[0.7, 0.4]).unwrap(), scene.executable());
    let compiled = <module::Prepared<f64> as Scene<f64>>::prepare(&[0.7, 0.4]).unwrap();
    assert_eq!(<module::Prepared as Scene<f64>>::N_CIRCLES, 2);
    assert_eq!(executable.circles(), Some(found.clone()));
    for y in STATES {
        let (mut dy, mut z, mut dz) = ([0.0; 4], [0.0; 8], [0.0; 8]);
        interpreter.rhs(0.3, &y, &mut dy);
        interpreter.on_circles(&found, &y, &mut z);
        interpreter.rhs_on_circles(&found, 0.3, &z, &mut dz);
        assert_eq!(dz[..4], dy);
        let [a, b, ..] = y;
        // A third of a turn's sixth beside twice the difference; the order of both angles is that of the program.
        let expected = [(a, dy[0]), (2.0 * (a - b) + 1.0 / 3.0, 2.0 * (dy[0] - dy[1]))];
        for (angle, rate) in expected {
            let near =
                |(found, due): (f64, f64)| (found - due).abs() < 1e-13 * (1.0 + due.abs() + angle.abs());
            let is_there = |k: usize| {
                let pairs = [
                    (z[4 + 2 * k], angle.cos()),
                    (z[5 + 2 * k], angle.sin()),
                    (dz[4 + 2 * k], -rate * angle.sin()),
                    (dz[5 + 2 * k], rate * angle.cos()),
                ];
                pairs.into_iter().all(near)
            };
            // The sign of an angle is the program's choice, too.
            let is_there_reversed = |k: usize| {
                let pairs = [
                    (z[4 + 2 * k], angle.cos()),
                    (z[5 + 2 * k], -angle.sin()),
                    (dz[4 + 2 * k], -rate * angle.sin()),
                    (dz[5 + 2 * k], -rate * angle.cos()),
                ];
                pairs.into_iter().all(near)
            };
            assert!((0..2).any(|k| is_there(k) || is_there_reversed(k)), "{angle} in {z:?}, {dz:?}");
        }
        assert_eq!(compiled.on_circles(&y), z);
        let mut compiled_dz = [0.0; 8];
        compiled.rhs_on_circles(0.3, &z, &mut compiled_dz);
        assert_eq!(compiled_dz, dz);
        let (mut of_scene, mut d_of_scene) = ([0.0; 8], [0.0; 8]);
        compiled.on_circles_of(&y, &mut of_scene);
        compiled.rhs_on_circles_of(0.3, &of_scene, &mut d_of_scene);
        assert_eq!((of_scene, d_of_scene), (z, dz));
        compiled.inside().rhs(0.3, &z, &mut compiled_dz);
        assert_eq!(compiled_dz, dz);
    }
}

#[test]
fn digits_are_those_of_the_scalar() {
    let wide = |y: [f64; 4]| y.map(DoubleDouble::from_f64);
    let prepared =
        <module::Prepared<DoubleDouble> as Scene<DoubleDouble>>::prepare(&[0.7, 0.4].map(Real::from_f64));
    let system = prepared.unwrap();
    for y in STATES {
        let (mut dy, mut dz) = (wide([0.0; 4]), [DoubleDouble::ZERO; 8]);
        system.rhs(DoubleDouble::ZERO, &wide(y), &mut dy);
        system.rhs_on_circles(DoubleDouble::ZERO, &system.on_circles(&wide(y)), &mut dz);
        assert_eq!(dz[..4], dy);
    }
}

/// Through stops that change the state, within few units of the last digit of a motion whose angles were numbers.
#[test]
fn a_motion_through_events_is_the_same() {
    let system = module::Prepared::<f64>::new(&module::Params::default()).unwrap();
    let options = Options::adaptive(1e-13, 1e-13);
    let start = [0.3, -1.2, 3.0, 0.7];
    let mut times = Vec::new();
    let mut number = Integrator::new(&system, Vern9, 0.0, start, options).unwrap();
    let _ = number
        .integrate_through_events(12.0, |event| {
            times.push(event.t);
            ControlFlow::Continue(())
        })
        .unwrap();
    let mut circle = Integrator::new(&system, OnCircles::new(Vern9), 0.0, start, options).unwrap();
    let mut left = times.iter();
    let _ = circle
        .integrate_through_events(12.0, |event| {
            assert!((left.next().unwrap() - event.t).abs() < 1e-10);
            ControlFlow::Continue(())
        })
        .unwrap();
    assert!(!times.is_empty() && left.next().is_none());
    for (a, b) in number.state().iter().zip(circle.state()) {
        assert!((a - b).abs() < 1e-9, "{a} and {b}");
    }
}

#[test]
fn scenes_without_angles_have_none() {
    assert_eq!(circles("model m { coordinate x in real; lagrangian = x_dot^2/2 - x^4; }"), None);
    // Neither the sine of a square nor that of the time is carried.
    assert_eq!(circles("model m { coordinate x in real; lagrangian = x_dot^2/2 - cos(x^2); }"), None);
    assert_eq!(circles("model m { coordinate x in real; lagrangian = x_dot^2/2 - x*cos(t); }"), None);
    let on_circle = built(
        "model m { coordinate x in angle; lagrangian = x_dot^2/2 - cos(x); scene round { circle x; } }",
        "round",
    );
    assert_eq!(Found::of(on_circle.program()), None);
    let emitted = on_circle.emit().unwrap();
    assert!(!emitted.contains("on_circles") && !emitted.contains("Inside"));
}

/// What else is done with an angle does not matter, and parameters may be factors of it.
#[test]
fn angles_may_be_read_as_numbers_too() {
    let text = "model m {
        param n = 3;
        coordinate x in real;
        lagrangian = x_dot^2/2 - cos(x) - x^2/2 - cos(n*x);
    }";
    let scene = built(text, "default");
    let found = Found::of(scene.program()).unwrap();
    assert_eq!(found.n_angles, 2);
    let interpreter = scene.prepare(&[2.5]).unwrap();
    let (y, mut dy, mut z, mut dz) = ([0.7, 1.3], [0.0; 2], [0.0; 6], [0.0; 6]);
    interpreter.rhs(0.0, &y, &mut dy);
    interpreter.on_circles(&found, &y, &mut z);
    interpreter.rhs_on_circles(&found, 0.0, &z, &mut dz);
    assert_eq!(dz[..2], dy);
    // `(c, s)` turns by `theta'`: `c s' - s c'`.
    let mut turns = [4, 6].map(|k| z[k - 2] * dz[k - 1] - z[k - 1] * dz[k - 2]);
    turns.sort_by(f64::total_cmp);
    for (turn, due) in turns.into_iter().zip([1.3, 2.5 * 1.3]) {
        assert!((turn - due).abs() < 1e-14, "{turns:?}");
    }
}
