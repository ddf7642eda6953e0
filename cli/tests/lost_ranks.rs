//! FMUs where gradients of constraints become dependent on the way: they fail, whoever integrates, and do not where
//! nothing is lost.

use hamel_codegen::scene;

use crate::common::fmus::{By, Fmu, has_compiler};

const WINDOWS: &str = include_str!("../../docs/book/four_bar_windows.hamel");

/// When the cranks of one window and of two lie flat first, as `hamel simulate` tells.
const FLAT: [(usize, f64); 2] = [(1, 0.708450), (2, 0.714356)];

/// What an FMU says until it has lost the rank.
fn lost(name: &str, text: &str, scene: &str, by: By, size: f64) -> Option<f64> {
    let fmu = Fmu::of(name, text, scene);
    let (failures, end, numbers) = fmu.moved(by, 6.0, size);
    match end.as_str() {
        "stopped" => {
            let is_named = failures.iter().any(|told| told.contains("the constraints depend on each other"));
            assert!(is_named, "{name} {by:?}: {failures:?}");
            Some(numbers[0])
        }
        end => {
            assert_eq!(end, "reached", "{name} {by:?}: {failures:?}");
            None
        }
    }
}

/// As many directions are lost at once as there are windows.
#[test]
fn windows_stop_where_they_fold_flat() {
    if !has_compiler() {
        println!("no C compiler: FMUs are not tried");
        return;
    }
    for (n, flat) in FLAT {
        let text = WINDOWS.replace("size n = 2", &format!("size n = {n}"));
        let text = text.replace("model four_bar_windows", "model m");
        for (by, size) in [(By::Itself, 0.01), (By::Itself, 10.0), (By::Importer, 0.01)] {
            let name = format!("windows_{n}");
            let found = lost(&name, &text, scene::DEFAULT, by, size).expect("a lost rank");
            assert!((found - flat).abs() < 0.12, "{n} {by:?} {size}: {found}");
        }
    }
}

/// A scene that wants nothing but rates has the rows as well, and so have momenta in the place of velocities.
#[test]
fn every_scene_has_its_rows() {
    if !has_compiler() {
        println!("no C compiler: FMUs are not tried");
        return;
    }
    let text = WINDOWS.replace("size n = 2", "size n = 1").replace("model four_bar_windows", "model m");
    let text = text.replace(
        "initial x =",
        "scene bare { want rhs; } scene momenta { carry p, q; want rhs; } initial x =",
    );
    let text = text.replace("multipliers;", "multipliers; momentum p of x1_dot; momentum q of y1_dot;");
    for scene in ["bare", "momenta"] {
        let found = lost("bare_windows", &text, scene, By::Itself, 10.0).expect("a lost rank");
        assert!((found - FLAT[0].1).abs() < 0.12, "{scene}: {found}");
    }
}

/// One-forms of constraints on velocities, two of which are one where `x` is zero, at the time two.
#[test]
fn constraints_on_velocities_stop_where_they_fold_together() {
    if !has_compiler() {
        println!("no C compiler: FMUs are not tried");
        return;
    }
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
            let found = lost(name, &text, scene::DEFAULT, by, size);
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
    if !has_compiler() {
        println!("no C compiler: FMUs are not tried");
        return;
    }
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
            assert_eq!(lost(name, text, scene::DEFAULT, by, size), None, "{name} {by:?} {size}");
        }
    }
}
