//! Models of `models/shelf` against the same systems in redundant coordinates: entries of rotation matrices, positions
//! and multipliers, and nothing of the reduced theory (`hamel_tests::unreduced`).

mod shelf_systems;

use hamel_tests::models;
use hamel_tests::unreduced::{Unreduced, check};
use shelf_systems::{balls, bicycles, flying, matrices, particles, rolling, spinning, vehicles};

/// A model by its name against a system; `idle` are parameters that do nothing at their defaults.
fn held<S: Unreduced>(name: &str, idle: &[&str]) {
    let compared = check::<S>(&models::build_from_shelf(name), 7);
    println!("{name}: {compared:?}");
    assert_eq!(compared.idle, idle, "{name}: parameters that change nothing");
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
    held::<vehicles::SnakeWithFriction>("snake_with_friction", &[]);
}

#[test]
fn bicycles_on_two_wheels() {
    held::<bicycles::Whipple>("whipple_bicycle", &[]);
    held::<bicycles::ByMultipliers>("whipple_bicycle_multipliers", &[]);
    held::<bicycles::Ridden>("bicycle_with_rider", &[]);
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
fn groups_of_matrices() {
    held::<matrices::Manakov>("manakov_top", &[]);
    held::<matrices::PseudoRigid>("pseudo_rigid_body", &[]);
    held::<matrices::SuslovOnBianchi>("suslov_bianchi", &[]);
}

#[test]
fn particles_and_what_they_turn() {
    held::<particles::Toda>("toda_lattice", &[]);
    held::<particles::Flywheel>("heisenberg_flywheel", &[]);
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
    let checks = include_str!("shelf.rs");
    let names = models::names_on_shelf();
    assert!(!names.is_empty());
    for name in names {
        assert!(checks.contains(&format!("(\"{name}\", &[")), "{name} has no check");
    }
}
