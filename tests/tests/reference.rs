//! Right-hand sides, energies, multipliers and trajectories against values computed without any reduced theory.
//!
//! The bound on a component is 64 units in the last place of the larger of the reference component and the largest term
//! that enters it. The largest term is computed by running the very program on `Tracked` numbers, which propagate it
//! through every operation (its documentation says how); the distance to the 40-digit reference is taken exactly.

use hamel_codegen::scene;
use hamel_program::program::Role;
use hamel_runtime::{Dop853, Integrator, Options};
use hamel_tests::derived::Derived;
use hamel_tests::models::{self, Interpreted, State};
use hamel_tests::reference::{self, Numbers, Reference, WITHOUT_FILE};
use hamel_tests::tracked::{tracked, units_off};

/// Units in the last place that a component may be off.
const BOUND: f64 = 64.0;

fn build(model: &str) -> &'static Derived {
    models::derived(model, scene::DEFAULT)
}

fn params(scene: &Derived, numbers: &Numbers) -> Vec<f64> {
    let names: Vec<String> = scene.params().iter().map(|p| p.name.clone()).collect();
    assert_eq!(numbers.len(), names.len(), "parameters of the model and of the reference");
    reference::in_order(numbers, &names)
}

fn check_points(model: &str, Reference { points, .. }: &Reference) -> f64 {
    let scene = build(model);
    let names = scene.state_names();
    let mut worst: f64 = 0.0;
    assert!(!points.is_empty(), "{model} has reference points");
    for (k, point) in points.iter().enumerate() {
        assert_eq!(point.state.len(), names.len(), "{model}: state of the model and of the reference");
        let params = params(scene, &point.params);
        let state = reference::in_order(&point.state, names);
        for (name, value) in names.iter().zip(tracked(&scene.program, &Role::Rate, &params, &state)) {
            let off = units_off(value, &point.derivative[name]);
            worst = worst.max(off);
            assert!(off <= BOUND, "{model}, point {k}: d{name}/dt is {off} units off: {value:?}");
        }
        if let Some(energy) = &point.energy {
            let off = units_off(tracked(&scene.program, &Role::Energy, &params, &state)[0], energy);
            worst = worst.max(off);
            assert!(off <= BOUND, "{model}, point {k}: energy is {off} units off");
        }
        if let Some(lambda) = &point.lambda {
            let off = units_off(
                tracked(&scene.program, &Role::Output("multipliers".to_owned()), &params, &state)[0],
                lambda,
            );
            worst = worst.max(off);
            assert!(off <= BOUND, "{model}, point {k}: multiplier is {off} units off");
        }
    }
    worst
}

#[test]
fn every_reference_point_is_met_within_64_units_of_the_largest_term() {
    for model in reference::models() {
        let worst = check_points(&model, &reference::read(&model));
        println!("{model}: worst {worst:.2} units in the last place");
    }
}

#[test]
fn suslov_and_sleigh_points_carry_multipliers() {
    for model in ["suslov", "chaplygin_sleigh", "veselova"] {
        let file = reference::read(model);
        assert!(file.points.iter().all(|p| p.lambda.is_some()), "{model}");
    }
}

/// The velocities that momenta stand for, and that of the cyclic coordinate.
#[test]
fn velocities_that_follow_from_momenta_are_met_within_64_units_of_the_largest_term() {
    let mut compared = 0;
    for model in ["double_spherical_pendulum", "two_arm_satellite_routh"] {
        let scene = build(model);
        let outputs = scene.outputs();
        let velocities = outputs.iter().find(|o| o.name == "velocities").expect("momenta are carried");
        for (k, point) in reference::read(model).points.iter().enumerate() {
            let params = params(scene, &point.params);
            let state = reference::in_order(&point.state, scene.state_names());
            let found = tracked(&scene.program, &Role::Output("velocities".to_owned()), &params, &state);
            for (name, value) in velocities.components.iter().zip(found) {
                let off = units_off(value, &point.extra[name]);
                assert!(off <= BOUND, "{model}, point {k}: {name} is {off} units off: {value:?}");
                compared += 1;
            }
        }
    }
    assert_eq!(compared, 12 + 3 * 12);
}

/// The azimuth of the plane that turns, and the attitude of the satellite, which shows that its angular momentum in
/// space stays where it was.
#[test]
fn reconstructions_at_given_momenta_are_met_within_1e_9() {
    for model in ["double_spherical_pendulum", "two_arm_satellite_routh"] {
        let scene = models::derived(model, scene::RECONSTRUCTION);
        let names = scene.state_names();
        for t in &reference::read(model).trajectories {
            let with = |own: &Numbers, group: &Numbers| -> Numbers {
                own.iter().chain(group).map(|(name, x)| (name.clone(), x.clone())).collect()
            };
            let [at_start, at_end] = &t.reconstruction;
            assert!(!at_end.is_empty(), "{model}");
            let (start, end) = (with(&t.initial, at_start), with(&t.last, at_end));
            let prepared = scene.prepare(&params(scene, &t.params)).unwrap_or_else(|e| panic!("{e}"));
            let initial = State(reference::in_order(&start, names));
            let options = Options::adaptive(1e-12, 1e-12);
            let system = Interpreted(prepared);
            let mut integrator =
                Integrator::new(&system, Dop853, 0.0, initial, options).unwrap_or_else(|e| panic!("{e}"));
            integrator.integrate_to(t.t_final).unwrap_or_else(|e| panic!("{e}"));
            let last = &integrator.state().0;
            let error = relative_error(last, names, &end);
            assert!(error <= 1e-9, "{model}: relative error {error:e}");
            if names.contains(&"qw".to_owned()) {
                let at = |name: &str| last[names.iter().position(|n| n == name).unwrap()];
                let q = ["qw", "qx", "qy", "qz"].map(at);
                let in_space = models::rotated(q, ["Pi1", "Pi2", "Pi3"].map(at));
                let kept = ["L1", "L2", "L3"].map(|name| reference::number(&t.conserved[name]));
                models::close("angular momentum in space", &in_space, &kept, 1e-9);
            }
        }
    }
}

/// Largest distance of a component, relative to the norm of the reference state.
fn relative_error(state: &[f64], names: &[String], expected: &Numbers) -> f64 {
    let expected: Vec<f64> = reference::in_order(expected, names);
    let size = expected.iter().map(|x| x * x).sum::<f64>().sqrt();
    let error = state.iter().zip(&expected).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
    error / size
}

#[test]
fn every_reference_trajectory_is_met_within_1e_9_at_rtol_1e_12() {
    for model in reference::models() {
        let scene = build(&model);
        let names = scene.state_names();
        let file = reference::read(&model);
        assert!(!file.trajectories.is_empty(), "{model} has reference trajectories");
        for (k, t) in file.trajectories.iter().enumerate() {
            let interpreter = scene.prepare(&params(scene, &t.params)).unwrap_or_else(|e| panic!("{e}"));
            let system = Interpreted(interpreter);
            let initial = State(reference::in_order(&t.initial, names));
            let options = Options::adaptive(1e-12, 1e-12);
            let mut integrator = Integrator::new(&system, Dop853, 0.0, initial, options)
                .unwrap_or_else(|e| panic!("{model}, trajectory {k}: {e}"));
            for (at, expected) in &t.samples {
                integrator.integrate_to(*at).unwrap_or_else(|e| panic!("{model}, trajectory {k}: {e}"));
                let error = relative_error(&integrator.state().0, names, expected);
                assert!(error <= 1e-9, "{model}, trajectory {k}, t = {at}: relative error {error:e}");
            }
            integrator.integrate_to(t.t_final).unwrap_or_else(|e| panic!("{model}, trajectory {k}: {e}"));
            let error = relative_error(&integrator.state().0, names, &t.last);
            println!(
                "{model}, trajectory {k}: relative error {error:.1e} in {} steps",
                integrator.stats().steps
            );
            assert!(error <= 1e-9, "{model}, trajectory {k}: relative error {error:e}");
        }
    }
}

/// What is compared is what the folders have in common, and what they have not is said.
#[test]
fn files_without_a_model_and_models_without_a_file_are_listed_with_a_reason() {
    let (files, models) = (reference::files(), models::names());
    assert!(reference::models().len() == 29, "{:?}", reference::models());
    let apart = |of: &[String], other: &[String]| -> Vec<String> {
        of.iter().filter(|name| !other.contains(name)).cloned().collect()
    };
    assert_eq!(apart(&files, &models), Vec::<String>::new(), "every file has its model");
    assert_eq!(apart(&models, &files), WITHOUT_FILE.map(|(name, _)| name));
    assert!(WITHOUT_FILE.iter().all(|(_, reason)| reason.len() > 20));
}

/// Files keep their form: every state has its derivative, and every number can be read.
#[test]
fn every_file_can_be_read() {
    for name in reference::files() {
        let Reference { points, trajectories } = reference::read(&name);
        assert!(!points.is_empty() && !trajectories.is_empty(), "{name}");
        let finite = |numbers: &Numbers| numbers.values().all(|x| reference::number(x).is_finite());
        for point in &points {
            assert!(point.state.keys().eq(point.derivative.keys()), "{name}");
            assert!([&point.params, &point.state, &point.derivative].into_iter().all(finite), "{name}");
        }
        for t in &trajectories {
            assert!(t.initial.keys().eq(t.last.keys()) && finite(&t.initial) && finite(&t.last), "{name}");
            assert!(t.samples.iter().all(|(at, state)| at.is_finite() && finite(state)), "{name}");
        }
    }
}

/// The texts beside the numbers cite files that are there.
#[test]
fn files_that_the_folder_cites_are_there() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("reference");
    let mut n = 0;
    for entry in std::fs::read_dir(&folder).unwrap() {
        let path = entry.unwrap().path();
        let text = std::fs::read_to_string(&path).unwrap();
        let is_part = |c: char| c.is_alphanumeric() || "_./-".contains(c);
        for cited in text.split(|c| !is_part(c)).map(|word| word.trim_end_matches('.')) {
            if cited.ends_with(".md") || cited.ends_with(".rs") {
                n += 1;
                assert!(folder.join(cited).is_file(), "{} cites {cited}", path.display());
            }
        }
    }
    assert!(n > 0);
}
