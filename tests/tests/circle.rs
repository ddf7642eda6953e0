//! Angles carried as points of the circle: the same motion, without sine and cosine.
//!
//! Bounds on rates are those of `reference.rs`: 64 units in the last place of the largest term that enters.

use hamel_codegen::scene::{self, BuiltScene};
use hamel_codegen::spec;
use hamel_program::program::Role;
use hamel_runtime::{Dop853, Integrator, Options};
use hamel_tests::models::{self, Interpreted, State, params, text_with};
use hamel_tests::random::Random;
use hamel_tests::tracked::{Tracked, unit_in_the_last_place};

/// Units in the last place that a rate may be off.
const BOUND: f64 = 64.0;

/// Models, angles and what else a scene may say: parity with parameters that are fixed and coordinates that are
/// dropped.
const CASES: &[(&str, &str, &str)] = &[
    ("euler_disk", "theta", ""),
    ("euler_disk", "theta", "drop phi;"),
    ("euler_disk", "theta", "fix e = 0, g = 9; drop phi;"),
    ("euler_disk", "phi", ""),
    ("euler_disk", "theta, phi", "want reconstruction;"),
    ("snakeboard", "phi", "drop psi;"),
    ("snakeboard", "psi, phi", "fix J1 = 0.25; want p;"),
    ("chaplygin_gyro", "alpha, beta", "want energy;"),
    ("two_arm_satellite", "alpha, beta", "fix ka = 0, kb = 0;"),
];

/// A scene with angles, and the same one on circles.
fn pair(model: &str, angles: &str, items: &str) -> [BuiltScene; 2] {
    let both = format!("scene straight {{ {items} }} scene round {{ circle {angles}; {items} }}");
    let model = spec::parse(model, &text_with(model, &both)).unwrap_or_else(|e| panic!("{e}"));
    ["straight", "round"].map(|name| scene::build(&model, name).unwrap_or_else(|e| panic!("{e}")))
}

/// Values of the second scene's state variables, given those of the first: its own, or `point(x, is_sine)` of an angle.
fn carried(scenes: &[BuiltScene; 2], point: impl Fn(usize, bool) -> f64, own: &[f64]) -> Vec<f64> {
    let straight = scenes[0].state_names();
    let place = |name: &str| straight.iter().position(|n| n == name);
    let value = |name: &String| match (place(name), name.rsplit_once('_')) {
        (Some(k), _) => own[k],
        (None, Some((angle, part))) => point(place(angle).expect("an angle of the first scene"), part == "s"),
        (None, None) => panic!("{name} belongs to no angle"),
    };
    scenes[1].state_names().iter().map(value).collect()
}

fn on_circles(scenes: &[BuiltScene; 2], y: &[f64]) -> Vec<f64> {
    carried(scenes, |k, is_sine| if is_sine { y[k].sin() } else { y[k].cos() }, y)
}

fn tracked_rates(scene: &BuiltScene, y: &[f64]) -> Vec<Tracked> {
    let lift = |values: &[f64]| values.iter().map(|x| Tracked::input(*x)).collect::<Vec<_>>();
    let (p, y) = (lift(&params(scene, &[])), lift(y));
    let prepared = scene.program().prepare(&p).unwrap_or_else(|e| panic!("{e}"));
    let mut out = vec![Tracked::default(); y.len()];
    let k = scene.program().function_idx(&Role::Rate).expect("every scene has its rates");
    scene.program().run(k, &p, &prepared, Tracked::input(0.0), &y, &mut out);
    out
}

#[test]
fn rates_are_those_of_the_angle_by_the_chain_rule() {
    for (model, angles, items) in CASES {
        let scenes = pair(model, angles, items);
        assert_ne!(scenes[0].state_names(), scenes[1].state_names(), "{model}");
        let mut random = Random(20_261_121);
        for round in 0..200 {
            // Inside (0, 1): every coordinate is in its domain there.
            let y: Vec<f64> = scenes[0].state().iter().map(|_| 0.5 + 0.45 * random.number()).collect();
            let straight = tracked_rates(&scenes[0], &y);
            let rate =
                |k: usize, is_sine: bool| straight[k].value * if is_sine { y[k].cos() } else { -y[k].sin() };
            let own: Vec<f64> = straight.iter().map(|x| x.value).collect();
            let terms: Vec<f64> = straight.iter().map(|x| x.term).collect();
            let (expected, terms) = (carried(&scenes, rate, &own), carried(&scenes, |k, _| terms[k], &terms));
            for (k, value) in tracked_rates(&scenes[1], &on_circles(&scenes, &y)).iter().enumerate() {
                let scale = value.term.max(terms[k]).max(expected[k].abs());
                let off = (value.value - expected[k]).abs() / unit_in_the_last_place(scale);
                let name = &scenes[1].state()[k].name;
                assert!(
                    off <= BOUND,
                    "{model} {angles} {items} {round}: {name} is {off} units off: {value:?}"
                );
            }
        }
    }
}

#[test]
fn no_sine_is_computed_and_the_pivots_stay_definite() {
    for (model, angles, items) in CASES {
        let scenes = pair(model, angles, items);
        let calls = scenes.each_ref().map(|scene| {
            let k = scene.program().function_idx(&Role::Rate).expect("every scene has its rates");
            scene.program().functions[k].counts().transcendental
        });
        // Rates do not depend on the azimuth of the disk; its inclination stays an angle there.
        let left = usize::from(*angles == "phi" && *model == "euler_disk");
        assert_eq!(calls[1], left, "{model} {angles} {items}");
        assert!(calls[0] > 0, "{model}");
        let checked = scenes.each_ref().map(|scene| {
            let k = scene.program().function_idx(&Role::Pivots).expect("every scene has its check");
            scene.program().functions[k].results.len()
        });
        // A pivot may become definite, none may cease to be.
        assert!(checked[1] <= checked[0], "{model} {angles} {items}: {checked:?}");
    }
}

fn integrated(scene: &BuiltScene, y: Vec<f64>, t: f64) -> Vec<f64> {
    let system = Interpreted(scene.prepare(&params(scene, &[])).unwrap_or_else(|e| panic!("{e}")));
    let options = Options::adaptive(1e-12, 1e-12);
    let mut integrator =
        Integrator::new(&system, Dop853, 0.0, State(y), options).unwrap_or_else(|e| panic!("{e}"));
    integrator.integrate_to(t).unwrap_or_else(|e| panic!("{e}"));
    integrator.state().0.clone()
}

#[test]
fn trajectories_agree_and_stay_on_the_circle() {
    let starts: [(&str, &str, &[f64]); 2] = [
        // theta, theta_dot, phi_dot, psi_dot
        ("euler_disk", "theta", &[0.9, 0.0, 1.5, -6.0]),
        // phi, psi_dot, phi_dot, s: through several turns of the steering angle
        ("snakeboard", "phi", &[0.4, 1.5, 3.0, -1.0]),
    ];
    for (name, angle, start) in starts {
        let model = models::model(name);
        let scenes =
            ["minimal", "circle"].map(|scene| scene::build(&model, scene).unwrap_or_else(|e| panic!("{e}")));
        assert_eq!(scenes[0].state().len(), start.len(), "{name}: {:?}", scenes[0].state_names());
        let expected = on_circles(&scenes, &integrated(&scenes[0], start.to_vec(), 5.0));
        let last = integrated(&scenes[1], on_circles(&scenes, start), 5.0);
        let size = expected.iter().fold(1.0, |m: f64, x| m.max(x.abs()));
        // The bound of the reference trajectories.
        models::close(name, &last, &expected, 1e-9 * size);
        let interpreter = scenes[1].prepare(&params(&scenes[1], &[])).unwrap_or_else(|e| panic!("{e}"));
        let names: Vec<&String> =
            scenes[1].outputs().iter().flat_map(|o| o.components.iter().map(|(n, _)| n)).collect();
        let circle =
            names.iter().position(|n| **n == format!("{angle}_circle")).expect("the circle's output");
        let radius = interpreter.outputs(0.0, &last)[circle];
        // A thousand steps at tolerance 1e-12 leave some 1e-12 each at most.
        assert!((radius - 1.0).abs() < 1e-9, "{name}: {radius}");
        // Off the circle it is seen, and kept.
        let off: Vec<f64> = last.iter().map(|x| 1.5 * x).collect();
        assert!((interpreter.outputs(0.0, &off)[circle] - 2.25 * radius).abs() < 1e-12, "{name}");
    }
}

#[test]
fn the_angle_is_an_output_where_its_domain_is_an_interval() {
    for (domain, samples) in [
        ("(0, pi/2)", [0.01, 0.7, 1.56]),
        ("(0, pi)", [0.01, 1.6, 3.13]),
        ("(-pi/2, pi/2)", [-1.57, 0.0, 1.57]),
        ("(2, 5)", [2.01, 3.3, 4.99]),
        ("(pi, 2*pi)", [3.15, 4.0, 6.25]),
    ] {
        let text = format!(
            "model m {{ coordinate x in {domain}; lagrangian = x_dot^2/2 - cos(3*x) - sin(x)*cos(x + 2); output h = x^2; \
             scene round {{ circle x; want x, h, circles; }} }}"
        );
        let model = spec::parse("m", &text).unwrap_or_else(|e| panic!("{e}"));
        let scene = scene::build(&model, "round").unwrap_or_else(|e| panic!("{e}"));
        let interpreter = scene.prepare(&[]).unwrap_or_else(|e| panic!("{e}"));
        for x in samples {
            let y = [f64::cos(x), f64::sin(x), 0.3];
            let out = interpreter.outputs(0.0, &y);
            // Outputs may use the angle as a number; 3e-15 is some ten roundings at values up to 40.
            models::close(domain, &out, &[x, x * x, 1.0], 3e-15 * (1.0 + x * x));
            let mut dy = [0.0; 3];
            interpreter.rhs(0.0, &y, &mut dy);
            let slope = 3.0 * (3.0 * x).sin() - x.cos() * (x + 2.0).cos() + x.sin() * (x + 2.0).sin();
            models::close(domain, &dy, &[-0.3 * y[1], 0.3 * y[0], slope], 1e-14);
        }
    }
}

#[test]
fn an_angle_outside_sine_and_cosine_stays_an_angle() {
    let text = text_with("two_arm_satellite", "scene round { circle alpha; }");
    let model = spec::parse("satellite", &text).unwrap_or_else(|e| panic!("{e}"));
    let message = scene::build(&model, "round").unwrap_err().to_string();
    assert!(
        message.contains("the lagrangian contains `alpha` other than in its sine and cosine"),
        "{message}"
    );
    assert!(message.contains("lagrangian = 1/2*dot(Omega"), "{message}");
}
