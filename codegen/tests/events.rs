//! Events of a model: emitted code against the interpreter bit for bit, and against the closed form of their motion.
//!
//! `events/module.rs` is the module. Write it again with
//! `UPDATE_EXPECT=1 cargo test -p hamel-codegen --test main events`.

use std::ops::ControlFlow;

use expect_test::expect_file;
use hamel_codegen::scene::{self, BuiltScene, Writing};
use hamel_codegen::spec::{self, EventDirection};
use hamel_runtime::{Action, Direction, Events, Integrator, Options, Progress, Scene, Vern9};

/// The module, as a crate has it.
mod module {
    include!("events/module.rs");
}

/// A wheel of spokes without a rim that rolls down a slope: an inverted pendulum about the spoke on the ground, until
/// the next one hits it.
const TEXT: &str = "model rimless_wheel {
    source \"McGeer 1990\";
    /// Gravity by length of a spoke.
    param k = 9.81 where k > 0;
    /// Half the angle between spokes.
    param alpha = 0.4 where alpha > 0, alpha < 0.7;
    /// Slope of the ground.
    param gamma = 0.1;
    /// Angle of the spoke on the ground to the vertical.
    coordinate theta in real;
    lagrangian = theta_dot^2/2 - k*cos(theta);
    let speed = theta_dot;
    /// The next spoke is on the ground; the angular momentum about its end is kept.
    event impact = theta - gamma - alpha rising {
        then theta = theta - 2*alpha;
        then theta_dot = cos(2*alpha)*speed;
    }
    /// Told only.
    event upright = theta;
    /// It does not get over the next spoke.
    event fallen = theta_dot falling { stop; }
    /// A kick at a time, of which nothing is known beforehand.
    event kicked = t - 1000 rising { then theta_dot = theta_dot + 1; stop; }
    scene still { want rhs; }
}";

fn build(scene: &str) -> BuiltScene {
    let model = spec::parse("rimless_wheel.hamel", TEXT).unwrap_or_else(|e| panic!("{e}"));
    scene::build(&model, scene).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn the_module_is_the_one_that_was_compiled() {
    let command = "UPDATE_EXPECT=1 cargo test -p hamel-codegen --test main events #".to_owned();
    let writing = Writing { command: Some(command), ..Writing::default() };
    expect_file!["events/module.rs"].assert_eq(&build("default").emit_as(&writing).unwrap());
}

#[test]
fn a_scene_that_does_not_want_events_has_none() {
    let still = build("still");
    assert!(still.events().is_empty());
    let text = still.emit().unwrap();
    assert!(!text.contains("Event") && !text.contains("Action") && !text.contains("impact"), "{text}");
    // The right-hand side is the same with events and without.
    let both = [&still, &build("default")].map(|scene| {
        let interpreter = scene.prepare(&[9.0, 0.3, 0.1]).unwrap();
        let mut dy = [0.0; 2];
        interpreter.rhs(0.1, &[0.3, -1.7], &mut dy);
        dy.map(f64::to_bits)
    });
    assert_eq!(both[0], both[1]);
}

#[test]
fn emitted_events_have_the_bits_of_the_interpreter() {
    let built = build("default");
    let names: Vec<&str> = built.events().iter().map(|e| e.name.as_str()).collect();
    assert_eq!(names, ["impact", "upright", "fallen", "kicked"]);
    let directions = built.events().iter().map(|e| e.direction);
    assert_eq!(
        directions.collect::<Vec<_>>(),
        [EventDirection::Rising, EventDirection::Either, EventDirection::Falling, EventDirection::Rising]
    );
    assert_eq!(
        <module::Prepared as Events<f64, 4>>::DIRECTIONS,
        [Direction::Rising, Direction::Either, Direction::Falling, Direction::Rising]
    );
    let params = [9.7, 0.37, 0.11];
    let interpreter = built.prepare(&params).unwrap();
    let compiled = module::Prepared::prepare(&params).unwrap();
    for seed in 0..50 {
        let x = f64::from(seed);
        let (t, y) = (0.3 * x, [(0.7 * x).sin(), 3.0 * (1.3 * x).cos()]);
        let values = interpreter.events(t, &y).unwrap();
        assert_eq!(
            compiled.event_values(t, &y).map(f64::to_bits).to_vec(),
            values.iter().map(|v| v.to_bits()).collect::<Vec<_>>()
        );
        let expected = [Action::Restart, Action::Continue, Action::Stop, Action::ChangeAndStop];
        let events = built.events();
        for (k, event) in events.iter().enumerate() {
            let (mut own, mut other) = (y, y);
            assert_eq!(compiled.event_apply(k, t, &mut own), expected[k]);
            assert_eq!(interpreter.apply(events, k, t, &mut other), [k]);
            assert_eq!(own.map(f64::to_bits), other.map(f64::to_bits), "{}", event.name);
            assert_eq!(own != y, !event.sets.is_empty());
        }
        // Both values are those at the state before.
        let mut after = y;
        let _ = compiled.event_apply(0, t, &mut after);
        assert_eq!(after[0], y[0] - 2.0 * params[1]);
        assert!((after[1] - (2.0 * params[1]).cos() * y[1]).abs() < 1e-15);
    }
}

#[test]
fn a_wheel_without_a_rim_rolls_as_its_closed_form() {
    let (k, alpha, gamma) = (9.81_f64, 0.4_f64, 0.1_f64);
    let wheel = module::Prepared::prepare(&[k, alpha, gamma]).unwrap();
    let start = [gamma - alpha, 2.0];
    let mut solver = Integrator::new(&wheel, Vern9, 0.0, start, Options::adaptive(1e-13, 1e-13)).unwrap();
    // Squares of the speeds just before impacts: a loss at each, a gain in between.
    let (gain, kept) = (4.0 * k * gamma.sin() * alpha.sin(), (2.0 * alpha).cos().powi(2));
    let (mut square, mut n) = (start[1] * start[1] + gain, 0);
    let progress = solver.integrate_through_events(100.0, |event| {
        if event.index == 0 {
            let found = event.state[1] * event.state[1];
            assert!((found - square).abs() < 1e-10, "impact {n}: {found} instead of {square}");
            square = kept * square + gain;
            n += 1;
        }
        ControlFlow::Continue(())
    });
    assert_eq!(progress, Ok(Progress::Reached));
    assert!(n > 80, "{n}");
    // The limit cycle, to rounding.
    assert!((square - gain / (1.0 - kept)).abs() < 1e-12);
    // Too slow to get over the first spoke: it stops where it turns back.
    let slow = [gamma - alpha, 0.5];
    let mut solver = Integrator::new(&wheel, Vern9, 0.0, slow, Options::adaptive(1e-13, 1e-13)).unwrap();
    let mut told = vec![];
    let progress = solver.integrate_through_events(100.0, |event| {
        told.push(event.index);
        ControlFlow::Continue(())
    });
    assert_eq!((progress, told), (Ok(Progress::Running), vec![2]));
    let height = slow[0].cos() + slow[1] * slow[1] / (2.0 * k);
    assert!((solver.state()[0].cos() - height).abs() < 1e-12 && solver.state()[1].abs() < 1e-12);
}
