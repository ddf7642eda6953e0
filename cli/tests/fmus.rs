//! FMUs where a motion cannot go on, or not begin, as they are told: an error, and no number.

use hamel_codegen::scene;

use crate::common::fmus::{By, Moved, numbers};

/// An importer looks for events at the ends of its steps alone.
#[test]
fn a_ball_does_not_fall_through_the_floor() {
    let ball = "model m { coordinate z in real; lagrangian = z_dot^2/2 - 10*z;
        event hit = z falling { then z_dot = -z_dot/2; } initial z = 5; initial z_dot = 0; }";
    let Some(fmu) = Moved::new("ball", ball, scene::DEFAULT, By::Importer) else { return };
    for step in [0.003, 0.03] {
        // It falls for a second, flies for one, then for half a second.
        let told = fmu.to(2.6, step, &[]);
        let (found, flown) = (numbers(&told), 0.1);
        assert!(told.starts_with("reached"), "{step}: {told}");
        assert!((found[1] - flown * (1.25 - 5.0 * flown)).abs() < 1e-9, "{step}: {told}");
        assert!((found[2] - (1.25 - 10.0 * flown)).abs() < 1e-9, "{step}: {told}");
        // It comes to rest after three seconds.
        let told = fmu.to(10.0, step, &[]);
        assert!(
            told.contains("failed: a step has passed an event") && told.contains("stopped"),
            "{step}: {told}"
        );
        assert!(numbers(&told)[1].abs() < 1e-2, "{step}: {told}");
    }
}

/// A body on the ground, which a force lifts when it is larger than the weight: of an input and of a parameter, at the
/// start, where `hamel simulate` does not begin either, and on the way.
#[test]
fn a_condition_that_inputs_make_true_happens() {
    let text = "model m { KIND F = 5; coordinate z in real; lagrangian = z_dot^2/2 - 10*z; force z_dot = F;
        mode ground { constraint n: z = 0; event lift when lambda_n < 0 { leave ground; } }
        initial z = 0; initial z_dot = 0; initial ground = 1; scene default { want rhs, events; SCENE } }";
    for (kind, scene) in [("param", ""), ("input", "input F;")] {
        let text = text.replace("KIND", kind).replace("SCENE", scene);
        let name = format!("lifted_{kind}");
        let Some(fmu) = Moved::new(&name, &text, scene::DEFAULT, By::Itself) else { return };
        let force = (2 * fmu.n_states + 1).to_string();
        let told = fmu.to(1.0, 0.25, &[]);
        assert!(told.starts_with("reached") && numbers(&told)[1..] == [0.0, 0.0, 1.0], "{kind}: {told}");
        let told = fmu.to(1.0, 0.25, &[&force, "16"]);
        assert!(told.contains("condition lift holds already") && told.contains("stopped"), "{kind}: {told}");
        // After a quarter of a second it is lifted by six.
        let told = fmu.to(1.25, 0.25, &["--", &force, "16"]);
        let found = numbers(&told);
        assert!(told.starts_with("reached"), "{kind}: {told}");
        assert!((found[1] - 3.0).abs() < 1e-9 && (found[2] - 6.0).abs() < 1e-9, "{kind}: {told}");
        assert!(found[3] == 0.0, "{kind}: {told}");
    }
}

/// A crank and a rod, whose other end slides on a line.
const SLIDER: &str = "model m { param r = 0.3; param l = 0.9; coordinate theta in angle; LOOP
    coordinate phi, x in real by [r*cos(theta) + l*cos(phi) - x, r*sin(theta) + l*sin(phi)] = [0, 0];
    lagrangian = theta_dot^2/2 + phi_dot^2/9 + x_dot^2/2; initial theta = 0; initial theta_dot = 3; initial x = 1.2; }";

/// The start is that of the default parameters.
#[test]
fn a_start_off_its_loop_is_none() {
    for (name, form) in [("solved", ""), ("kept", "multipliers;")] {
        let text = SLIDER.replace("LOOP", form);
        let Some(fmu) = Moved::new(name, &text, scene::DEFAULT, By::Itself) else { return };
        let r = (2 * fmu.n_states + 1).to_string();
        let closes = |told: &str, r: f64| {
            let found = numbers(told);
            told.starts_with("reached") && (r * found[1].sin() + 0.9 * found[2].sin()).abs() < 1e-7
        };
        let told = fmu.to(1.0, 0.1, &[]);
        assert!(closes(&told, 0.3), "{name}: {told}");
        // Another length at the start, which that does not meet, and on the way.
        for set in [&[&r, "0.4"][..], &["--", &r, "0.4"]] {
            let told = fmu.to(1.0, 0.1, set);
            assert!(
                told.contains("is not zero: start values and parameters have to satisfy"),
                "{name}: {told}"
            );
            assert!(told.contains("stopped"), "{name}: {told}");
        }
        // A start that meets it, with velocities where the state has all of them.
        let velocities = if name == "kept" { &["5", "-1.3333333333333333"][..] } else { &[] };
        let told = fmu.to(1.0, 0.1, &[&[&r, "0.4", "3", "1.3"], velocities].concat());
        assert!(closes(&told, 0.4), "{name}: {told}");
    }
}

/// Positions where equations depend on each other end the motion, whoever makes the steps: where one equation is lost,
/// solved and kept by multipliers, and where two are.
#[test]
fn a_fold_is_not_passed() {
    let arms = "model m { param a = 0.3; param b = 1.0; coordinate al in angle; LOOP
        coordinate be, ga in angle by a*[cos(al), sin(al)] + b*[cos(be), sin(be)] - a*[cos(ga), sin(ga)] = [b, 0];
        lagrangian = al_dot^2/2 + be_dot^2/2 + ga_dot^2; initial al = 1; initial ga = 1; initial al_dot = 1; }";
    let windows =
        include_str!("../../docs/book/four_bar_windows.hamel").replace("model four_bar_windows", "model m");
    for (name, text, fold) in [
        ("arms", arms.replace("LOOP", ""), std::f64::consts::PI - 1.0),
        ("arms_kept", arms.replace("LOOP", "multipliers;"), std::f64::consts::PI - 1.0),
        ("windows", windows, 0.714_356),
    ] {
        for by in [By::Itself, By::Importer] {
            let Some(fmu) = Moved::new(name, &text, scene::DEFAULT, by) else { return };
            for step in [0.01, 0.05] {
                let go = |t: f64| fmu.to(t, step, &[]);
                let (before, behind) = (go(fold - 0.06), go(fold + 1.0));
                assert!(before.starts_with("reached"), "{name} by {by:?} in {step}: {before}");
                let why = ["depend on each other", "vanishes", "too short"];
                assert!(why.iter().any(|why| behind.contains(why)), "{name} by {by:?} in {step}: {behind}");
                assert!(behind.contains("stopped"), "{name} by {by:?} in {step}: {behind}");
                let t = numbers(&behind)[0];
                assert!((t - fold).abs() < 1.01 * step, "{name} by {by:?} in {step}: {behind}");
            }
        }
    }
}

/// When an FMU that goes on to the time 6 has lost the rank.
fn lost(fmu: &Moved, size: f64) -> Option<f64> {
    let told = fmu.to(6.0, size, &[]);
    let is_lost = told.contains("depend on each other");
    assert!(told.contains(if is_lost { "stopped" } else { "reached" }), "{told}");
    is_lost.then(|| numbers(&told)[0])
}

/// A scene that wants nothing but rates has the rows as well, and so have momenta in the place of velocities.
#[test]
fn every_scene_has_its_rows() {
    let text =
        include_str!("../../docs/book/four_bar_windows.hamel").replace("model four_bar_windows", "model m");
    let text = text.replace("size n = 2", "size n = 1");
    let text = text.replace(
        "initial x =",
        "scene bare { want rhs; } scene momenta { carry p, q; want rhs; } initial x =",
    );
    let text = text.replace("multipliers;", "multipliers; momentum p of x1_dot; momentum q of y1_dot;");
    for scene in ["bare", "momenta"] {
        let Some(fmu) = Moved::new("window", &text, scene, By::Itself) else { return };
        // The crank lies flat at the time 0.708450, as `hamel simulate` tells.
        let found = lost(&fmu, 10.0).expect("a lost rank");
        assert!((found - 0.708_450).abs() < 0.12, "{scene}: {found}");
    }
}

/// One-forms of constraints on velocities, two of which are one where `x` is zero, at the time two.
#[test]
fn constraints_on_velocities_stop_where_they_fold_together() {
    for (name, constraints, is_lost) in [
        ("opposed", "constraint y_dot = x*z_dot; constraint y_dot = -x*z_dot;", true),
        ("factors", "constraint x*y_dot = x*sin(z)*z_dot;", false),
        ("constant", "constraint y_dot = 2*z_dot; constraint x_dot = -1/2 + z_dot;", false),
    ] {
        let text = format!(
            "model m {{
                coordinate x, y, z in real;
                lagrangian = (x_dot^2 + y_dot^2 + z_dot^2)/2;
                {constraints}
                multipliers;
                initial x = 1; initial x_dot = -0.5;
            }}"
        );
        for (by, size) in [(By::Itself, 0.1), (By::Itself, 10.0), (By::Importer, 0.03)] {
            let Some(fmu) = Moved::new(name, &text, scene::DEFAULT, by) else { return };
            let found = lost(&fmu, size);
            assert_eq!(found.is_some(), is_lost, "{name} {by:?} {size}: {found:?}");
            // Co-simulation stays where the step on whose way it is lost begins.
            let is_there = |t: f64| t < 2.04 && (t > 1.85 || size > 1.0);
            assert!(found.is_none_or(is_there), "{name} {by:?} {size}: {found:?}");
        }
    }
}

/// Gradients that turn all the way round keep their rank, also where bars come near to one line.
#[test]
fn what_turns_round_keeps_its_rank() {
    let pendulum = "model m {
        coordinate x in real;
        coordinate y in real by x^2 + y^2 = 1;
        lagrangian = x_dot^2/2 + y_dot^2/2;
        multipliers;
        initial x = 1; initial x_dot = 0; initial y = 0; initial y_dot = 9;
    }";
    // The bars lie in one line but for 0.002 of their lengths.
    let near = "model m {
        coordinate x, y: vector(2) in real;
        constraint left: x[1]^2 + y[1]^2 = 1;
        constraint right: (x[2] - 1.001)^2 + y[2]^2 = 1;
        constraint rod: (x[2] - x[1])^2 + (y[2] - y[1])^2 = 1.003^2;
        multipliers;
        lagrangian = (x_dot[1]^2 + y_dot[1]^2 + x_dot[2]^2 + y_dot[2]^2)/2;
        initial x = [0, 1]; initial y = [1, 1]; initial x_dot = [1, 1];
    }";
    for (name, text) in [("pendulum", pendulum), ("near", near)] {
        for (by, size) in [(By::Itself, 0.1), (By::Itself, 10.0), (By::Importer, 0.01)] {
            let Some(fmu) = Moved::new(name, text, scene::DEFAULT, by) else { return };
            assert_eq!(lost(&fmu, size), None, "{name} {by:?} {size}");
        }
    }
}
