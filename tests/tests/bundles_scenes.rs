//! What the generator finds out by itself: constant velocities, coordinates that nothing depends on.

use hamel_codegen::explain::explain;
use hamel_codegen::scene::{self, BuiltScene};
use hamel_codegen::spec;
use hamel_expr::Style;
use hamel_program::program::{Constant, Operand, Role};
use hamel_tests::draws::{Draws, for_all};
use hamel_tests::models::{self, build, equations, params};
use num_traits::{ToPrimitive, Zero};

/// Operations of the right-hand side.
fn operations(scene: &BuiltScene) -> usize {
    let k = scene.program().function_idx(&Role::Rate).expect("every scene has a right-hand side");
    scene.program().functions[k].counts().total()
}

#[test]
fn velocities_that_cannot_change_are_found_constant() {
    for (name, constants) in [
        ("rolling_disk", ["theta_dot", "phi_dot"].as_slice()),
        ("rolling_ball", &["a1_dot", "a2_dot", "xi3"]),
    ] {
        let e = equations(name);
        assert_eq!(e.facts.constants, constants, "{name}");
        for s in e.state.iter().filter(|s| constants.contains(&s.name.as_str())) {
            assert_eq!(s.derivative, e.system.graph.zero(), "{name}: derivative of {}", s.name);
        }
        let built = build(name, scene::DEFAULT);
        let text = explain(&models::model(name), &built, Style::Unicode);
        let line =
            text.lines().find(|l| l.starts_with("Constant along every motion:")).expect("explain says so");
        // Names are spelled with subscripts and dots: as many as there are constants.
        assert_eq!(line.split(':').nth(1).map(|l| l.split(',').count()), Some(constants.len()), "{line}");
        let latex = explain(&models::model(name), &built, Style::Latex);
        assert!(latex.contains("Constant along every motion"), "{name}");

        let rhs = &built.program().functions[built.program().function_idx(&Role::Rate).expect("it has one")];
        assert_eq!(rhs.counts().total(), 0, "{name}: the right-hand side computes nothing");
        assert!(rhs.instructions.is_empty(), "{name}");
        for (variable, operand) in &rhs.results {
            let zero = matches!(operand, Operand::Constant(k)
                if matches!(&built.program().constants[*k as usize], Constant::Rational(q) if q.is_zero()));
            assert_eq!(
                zero,
                constants.contains(&variable.as_str()),
                "{name}: result {variable} is {operand:?}"
            );
        }
        let emitted = built.emit().unwrap_or_else(|e| panic!("{e}"));
        let body = emitted.split("pub fn rhs").nth(1).expect("it has a right-hand side");
        let body = body.split("pub fn energy").next().expect("the energy follows");
        assert_eq!(body.matches("R::ZERO").count(), constants.len(), "{name}:\n{body}");
        assert!(!body.contains("self."), "{name}: parameters are not looked at\n{body}");
    }
}

#[test]
fn a_mass_that_depends_on_the_state_keeps_velocities_from_being_constant() {
    assert!(equations("chaplygin_ball").facts.constants.is_empty());
    assert_eq!(equations("snakeboard").facts.constants, ["phi_dot"]);
    assert_eq!(equations("servo_ball").facts.constants, ["xi2"]);
}

/// The state of a scene from that of the whole model, by names.
fn part(whole: &BuiltScene, scene: &BuiltScene, y: &[f64]) -> Vec<f64> {
    let names = whole.state_names();
    let place = |n: &String| names.iter().position(|m| m == n).expect("a scene keeps variables of the model");
    scene.state_names().iter().map(|n| y[place(n)]).collect()
}

/// A number in `(0, 1)`, inside the domain of every coordinate.
fn inside(draws: &mut Draws) -> f64 {
    let digits = draws.index(49) * 49 + draws.index(49);
    0.05 + 0.9 * digits.to_f64().expect("small") / 2401.0
}

fn compare(whole: &BuiltScene, scene: &BuiltScene) {
    let label = format!("{} {}", whole.equations().system.name, scene.name());
    assert!(operations(scene) <= operations(whole), "{label} computes more than the whole model");
    let p = params(whole, &[]);
    let (all, some) = (whole.prepare(&p), scene.prepare(&p));
    let (all, some) = (all.unwrap_or_else(|e| panic!("{e}")), some.unwrap_or_else(|e| panic!("{e}")));
    for_all(&label, 30, 100, |mut draws| {
        let y: Vec<f64> = whole.state().iter().map(|_| inside(&mut draws)).collect();
        let kept = part(whole, scene, &y);
        let mut dy = vec![0.0; y.len()];
        all.rhs(0.0, &y, &mut dy);
        let expected = part(whole, scene, &dy);
        let mut found = vec![0.0; kept.len()];
        some.rhs(0.0, &kept, &mut found);
        let largest = dy.iter().fold(1.0_f64, |m, x| m.max(x.abs()));
        models::close(&label, &found, &expected, 64.0 * f64::EPSILON * largest);
        if let (Some(a), Some(b)) = (all.energy(0.0, &y), some.energy(0.0, &kept)) {
            models::close(&label, &[b], &[a], 64.0 * f64::EPSILON * a.abs().max(1.0));
        }
        Ok(())
    });
}

/// Models with coordinates that nothing depends on.
const MINIMAL: [(&str, &[&str]); 7] = [
    ("appell_machine", &["x", "y"]),
    ("body_in_fluid", &["r1", "r2", "r3"]),
    ("euler_disk", &["phi"]),
    ("mobile_robot", &["psi1", "psi2"]),
    ("rolling_ball", &["a1", "a2"]),
    ("servo_ball", &["a2"]),
    ("snakeboard", &["psi"]),
];

#[test]
fn minimal_scenes_leave_out_what_nothing_depends_on() {
    for (name, dropped) in MINIMAL {
        let (whole, minimal) = (build(name, scene::DEFAULT), build(name, scene::MINIMAL));
        let kept: Vec<String> =
            whole.state_names().into_iter().filter(|n| !dropped.contains(&n.as_str())).collect();
        assert_eq!(minimal.state_names(), kept, "{name}");
        assert_eq!(kept.len() + dropped.len(), whole.state().len(), "{name}");
        compare(&whole, &minimal);
    }
    for name in models::names() {
        let known = scene::names(&models::model(&name));
        let expected = MINIMAL.iter().any(|(m, _)| *m == name);
        assert_eq!(known.iter().any(|s| s == scene::MINIMAL), expected, "{name}");
    }
}

fn with_scene(name: &str, items: &str) -> Result<BuiltScene, String> {
    let text = models::text_with(name, &format!("scene part {{ {items} }}"));
    let model = spec::parse(name, &text).map_err(|e| e.to_string())?;
    scene::build(&model, "part").map_err(|e| e.to_string())
}

#[test]
fn a_scene_may_drop_one_of_the_coordinates_by_name() {
    for (name, items, dropped) in [
        ("mobile_robot", "drop psi1;", ["psi1"].as_slice()),
        ("rolling_ball", "drop a;", &["a1", "a2"]),
        ("rolling_ball", "drop a2;", &["a2"]),
        ("euler_disk", "drop phi; want rhs, energy;", &["phi"]),
        ("snakeboard", "drop psi; want rhs, energy, p;", &["psi"]),
    ] {
        let whole = build(name, scene::DEFAULT);
        let part = with_scene(name, items).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(part.state().len() + dropped.len(), whole.state().len(), "{name}");
        assert!(part.state_names().iter().all(|n| !dropped.contains(&n.as_str())), "{name}");
        compare(&whole, &part);
    }
}

#[test]
fn a_coordinate_that_is_needed_cannot_be_dropped() {
    for (name, items, needed) in [
        ("euler_disk", "drop theta;", "theta"),
        ("euler_disk", "drop phi, theta;", "theta"),
        ("snakeboard", "drop phi;", "phi"),
        ("wong_particle", "drop x;", "x1"),
        ("two_arm_satellite", "drop beta;", "beta"),
        ("heavy_top", "drop Gamma;", "Gamma1"),
        ("tethered_body", "drop a;", "a1"),
        ("ball_on_rotating_table", "want rhs, momentum; drop x;", "x"),
    ] {
        let message = match with_scene(name, items) {
            Ok(_) => panic!("{name}: {items} is accepted"),
            Err(message) => message,
        };
        assert!(message.contains(&format!("{needed} cannot be left out of scene part")), "{name}: {message}");
    }
    // The rates do not depend on the azimuth of the disk, the place of its contact does.
    let text = "drop phi; want rhs, reconstruction;";
    let message = with_scene("euler_disk", text).map(|_| ()).unwrap_err();
    assert!(message.contains("phi cannot be left out"), "{message}");
    let message = with_scene("tethered_body", "drop a2;").map(|_| ()).unwrap_err();
    assert!(message.contains("drops a part of `a`"), "{message}");
    let message = with_scene("euler_disk", "drop chi;").map(|_| ()).unwrap_err();
    assert!(message.contains("drops `chi`"), "{message}");
}
