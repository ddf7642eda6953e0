//! Models of `models/shelf` against the same systems in redundant coordinates: entries of rotation matrices, positions
//! and multipliers, and nothing of the reduced theory (`hamel_tests::unreduced`).

mod shelf_systems;

use hamel_codegen::scene;
use hamel_tests::models;
use hamel_tests::unreduced::{Unreduced, check};
use shelf_systems::{rolling, vehicles};

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
fn vehicles_on_wheels() {
    held::<vehicles::RollerRacer>("roller_racer", &[]);
    held::<vehicles::CarWithTrailers>("car_with_trailers", &[]);
}
