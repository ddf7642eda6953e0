//! Models of `models/shelf` against the same systems in redundant coordinates: entries of rotation matrices, positions
//! and multipliers, and nothing of the reduced theory (`hamel_tests::unreduced`).

mod shelf_systems;

use hamel_codegen::scene;
use hamel_tests::models;
use hamel_tests::unreduced::{Unreduced, check};
use shelf_systems::{balls, flying, matrices, particles, rolling, spinning, vehicles};

/// A model by its name against a system; `idle` are parameters that do nothing at their defaults.
fn held<S: Unreduced>(name: &str, idle: &[&str]) {
    let compared = check::<S>(&models::build_from_shelf(name, scene::DEFAULT), 7);
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
