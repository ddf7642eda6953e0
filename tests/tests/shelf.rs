//! Models of `models/shelf` against the same systems in redundant coordinates: entries of rotation matrices, positions
//! and multipliers, and nothing of the reduced theory (`hamel_tests::unreduced`).

#[path = "shelf_systems/mod.rs"]
mod shelf_systems;

use hamel_tests::models;
use hamel_tests::random::Random;
use hamel_tests::unreduced::{Parameters, Unreduced, check, random_motion};
use shelf_systems::{
    actuated, balls, bicycles, flying, linkages, matrices, particles, rolling, spinning, vehicles,
};

/// A model by its name against a system; `idle` are parameters that do nothing at their defaults.
fn held<S: Unreduced>(name: &str, idle: &[&str]) {
    held_member::<S>(name, &[], idle);
}

/// The member of a model with other sizes against a system.
fn held_member<S: Unreduced>(name: &str, sizes: &[(&str, i64)], idle: &[&str]) {
    let compared = check::<S>(&models::build_member_from_shelf(name, sizes), 7);
    println!("{name} {sizes:?}: {compared:?}");
    assert_eq!(compared.idle, idle, "{name} {sizes:?}: parameters that change nothing");
}

#[test]
fn bodies_on_a_plane() {
    held::<rolling::Rattleback>("rattleback", &["I13", "I23"]);
    held::<rolling::TippeTop>("tippe_top", &[]);
    held::<rolling::Ellipsoid>("ellipsoid_on_plane", &[]);
}

#[test]
fn balls_on_surfaces() {
    held::<balls::InCylinder>("ball_in_rotating_cylinder", &[]);
    held::<balls::InBowl>("ball_on_surface", &[]);
    held::<balls::Robot>("spherical_robot", &[]);
}

#[test]
fn vehicles_on_wheels_and_blades() {
    held::<vehicles::RollerRacer>("roller_racer", &[]);
    held::<vehicles::CarWithTrailers>("car_with_trailers", &[]);
    held::<vehicles::Skate>("skate_on_incline", &["a"]);
    held::<vehicles::SnakeWithFriction<4>>("snake_with_friction", &[]);
}

/// Shorter and longer than what the files give.
#[test]
fn other_members_of_families() {
    for n in [1, 5] {
        held_member::<vehicles::CarWithTrailers>("car_with_trailers", &[("n", n)], &[]);
    }
    held_member::<particles::Vortices>("vortices_on_sphere", &[("n", 2)], &[]);
    held_member::<vehicles::SnakeWithFriction<2>>("snake_with_friction", &[("n", 2)], &["beta"]);
    held_member::<vehicles::SnakeWithFriction<7>>("snake_with_friction", &[("n", 7)], &[]);
}

#[test]
fn bicycles_on_two_wheels() {
    held::<bicycles::Whipple>("whipple_bicycle", &[]);
    held::<bicycles::ByMultipliers>("whipple_bicycle_multipliers", &[]);
    held::<bicycles::Ridden>("bicycle_with_rider", &[]);
}

/// Values that a scene of a model has beside its rates, by name, at random states of a bicycle, with the forces of the
/// ground on its wheels, rear and front.
fn along_bicycles<const KIND: u8>(
    (model, scene): (&str, &str),
    compare: impl Fn(&Parameters, &dyn Fn(&str) -> f64, [[f64; 3]; 2]),
) {
    let scene = models::build_scene_from_shelf(model, scene);
    let names = scene.state_names();
    let outputs = scene.outputs();
    let components: Vec<&String> = outputs.iter().flat_map(|o| &o.components).map(|(name, _)| name).collect();
    let mut random = Random(11);
    for _ in 0..10 {
        let parameters = Parameters::near_defaults(&scene, &mut random);
        let system = bicycles::Bicycle::<KIND>::new(&parameters);
        let motion = random_motion(&system, &mut random);
        let state = system.state(&motion.q, &motion.v, motion.t).in_order(&names);
        let prepared = scene.prepare(parameters.values()).unwrap_or_else(|e| panic!("{e}"));
        let values = prepared.outputs(motion.t, &state);
        let variables = names.iter().zip(&state);
        let all: Vec<(&String, &f64)> = variables.chain(components.iter().copied().zip(&values)).collect();
        let value = |name: &str| {
            *all.iter().find(|(own, _)| *own == name).unwrap_or_else(|| panic!("no {name}: {all:?}")).1
        };
        compare(&parameters, &value, system.forces_of_ground(&motion));
    }
}

/// Forces of up to a thousand newtons, by elimination of some sixty unknowns on the one side.
fn same_forces(what: &str, found: [[f64; 3]; 2], expected: [[f64; 3]; 2]) {
    let largest = expected.iter().flatten().fold(1.0, |a: f64, x| a.max(x.abs()));
    for (found, expected) in found.iter().zip(&expected) {
        models::close(what, found, expected, 1e-11 * largest);
    }
}

/// Multipliers of `whipple_bicycle_multipliers` are forces as they stand.
#[test]
fn multipliers_are_the_forces_of_the_ground() {
    along_bicycles::<{ bicycles::WITH_VELOCITIES }>(
        ("whipple_bicycle_multipliers", "held"),
        |_, value, expected| {
            let force = |wheel: &str| [1, 2, 3].map(|k| value(&format!("lambda_{wheel}{k}")));
            same_forces("forces of the ground", [force("rear"), force("front")], expected);
        },
    );
}

/// Those of `whipple_bicycle` by the formulas of its file.
#[test]
fn the_forces_of_the_ground_follow_from_multipliers() {
    along_bicycles::<{ bicycles::RIGID }>(("whipple_bicycle", "held"), |p, value, expected| {
        let weight = p.get("g") * ["mR", "mB", "mH", "mF"].map(|name| p.get(name)).iter().sum::<f64>();
        let down = [1, 2, 3].map(|k| value(&format!("Gamma{k}")));
        let lambda = |name: &str| value(&format!("lambda_{name}"));
        let rear = [0, 1, 2].map(|k| lambda(&format!("rear{}", k + 1)) - weight * down[k]);
        let front = [("hub1", "rolling1"), ("hub2", "lateral"), ("hub3", "rolling2")];
        let found = [rear, front.map(|(hub, ground)| lambda(hub) + lambda(ground))];
        same_forces("forces of the ground", found, expected);
    });
}

#[test]
fn bodies_with_rotors_and_charges() {
    held::<spinning::Satellite>("satellite_with_wheels", &[]);
    held::<spinning::Gyrostat>("kovalevskaya_gyrostat", &[]);
    held::<spinning::MagneticPendulum>("magnetic_spherical_pendulum", &[]);
}

#[test]
fn bodies_in_air_and_water() {
    held::<flying::Clebsch>("clebsch_body", &[]);
    held::<flying::Steklov>("steklov_body", &[]);
    held::<flying::Underwater>("underwater_vehicle", &[]);
    held::<flying::Quadrotor>("quadrotor_with_load", &[]);
}

#[test]
fn mechanisms_with_motors() {
    held::<actuated::MotorArm>("motor_arm", &["i_max"]);
}

/// Of the joint, every body is a rotation matrix; of the platform, the plate and each leg. Where legs stand is in their
/// angles and lengths; about their own axes they turn too slowly for a hundredth of these moments of inertia to be
/// seen.
#[test]
fn closed_loops_in_space() {
    held::<linkages::DoubleCardan>("double_cardan_joint", &[]);
    held::<linkages::Stewart>("stewart_platform", &["radius1", "half1", "J3", "K3"]);
}

#[test]
fn groups_of_matrices() {
    held::<matrices::Manakov>("manakov_top", &[]);
    held::<matrices::PseudoRigid>("pseudo_rigid_body", &[]);
    held::<matrices::SuslovOnBianchi>("suslov_bianchi", &[]);
}

#[test]
fn particles_and_what_they_turn() {
    held::<particles::Toda>("toda_lattice", &[]);
    held::<particles::Flywheel>("heisenberg_flywheel", &[]);
    held::<particles::Vortices>("vortices_on_sphere", &[]);
}

/// Where a rattleback is told by its equations from a body that merely turns: one way it turns back, and soon.
#[test]
fn a_rattleback_turns_back() {
    let scene = models::build_from_shelf("rattleback");
    let tilt = 0.02_f64;
    let start = |spin: f64| {
        [
            ("Omega1", 0.1),
            ("Omega2", 0.0),
            ("Omega3", spin),
            ("Gamma1", 0.0),
            ("Gamma2", tilt),
            ("Gamma3", (1.0 - tilt * tilt).sqrt()),
        ]
    };
    let spin = |from: f64| {
        let mut last = from;
        models::follow(&scene, &[], &start(from), &[8.0], |at| last = at.get("Omega3"));
        last
    };
    let (back, on) = (spin(-5.0), spin(5.0));
    assert!(back > 3.0, "{back}");
    assert!(on > 3.0, "{on}");
}

/// Upside down after eight seconds, and without friction never.
#[test]
fn a_tippe_top_turns_over() {
    let scene = models::build_from_shelf("tippe_top");
    let start = [
        ("Omega1", 0.0),
        ("Omega2", 0.0),
        ("Omega3", 155.0),
        ("X1", 0.0),
        ("X2", 0.0),
        ("X3", 0.0),
        ("Gamma1", 0.1),
        ("Gamma2", 0.0),
        ("Gamma3", 0.99_f64.sqrt()),
    ];
    let cosine = |mu: f64| {
        let mut last = 1.0;
        models::follow(&scene, &[("mu", mu)], &start, &[8.0], |at| last = at.get("Gamma3"));
        last
    };
    assert!(cosine(0.3) < -0.99);
    assert!(cosine(0.0) > 0.99);
}

/// A model that nothing is held to is not on the shelf.
#[test]
fn every_model_of_the_shelf_is_checked() {
    let (own, published) = (include_str!("shelf.rs"), include_str!("published.rs"));
    let names = models::names_on_shelf();
    assert!(!names.is_empty());
    for name in names {
        let is_checked = own.contains(&format!("(\"{name}\", &["))
            || published.contains(&format!("reaches(\"{name}\", "))
            || published.contains(&format!("reached(\"{name}\", "));
        assert!(is_checked, "{name} has no check");
    }
}
