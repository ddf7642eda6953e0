//! Models of the shelf at the end of motions that were published, or that other programs computed.

use hamel_codegen::scene;
use hamel_codegen::spec;
use hamel_program::program::Role;
use hamel_tests::models::{self, At};

/// The state that a model reaches from its own initial state.
fn reached(name: &str, t: f64, visit: impl FnMut(&At<'_>)) {
    let built = models::build_from_shelf(name);
    let model = spec::parse(name, &models::text_from_shelf(name)).unwrap_or_else(|e| panic!("{e}"));
    let start = scene::initial_state(&model, &built).unwrap_or_else(|e| panic!("{e}")).expect("a start");
    let names = built.state_names();
    let start: Vec<(&str, f64)> = names.iter().map(String::as_str).zip(start).collect();
    models::follow(&built, &[], &start, &[t], visit);
}

/// Holds a model to values at a time: errors are relative to these, and to one where they are smaller.
fn reaches(name: &str, values: &[(&str, f64)], t: f64, bound: f64) {
    reached(name, t, |at| {
        for (variable, expected) in values {
            let found = at.get(variable);
            let error = (found - expected).abs() / expected.abs().max(1.0);
            assert!(error < bound, "{name}: {variable} is {found} for {expected}");
        }
    });
}

/// Values at the last time of the test set for solvers (Mazzia, Magherini 2008), computed there with tolerances of
/// `1e-14`: by 1112 steps of PSIDE. At its end the crank turns at 1140 rad/s: an error of `1e-12 s` is one of
/// `1e-9 rad`.
#[test]
fn andrews_squeezer_is_where_the_test_set_has_it() {
    let values = [
        ("beta", 15.81077119629904),
        ("Theta", -15.75637105984298),
        ("gamma", 0.04082224013073101),
        ("Phi", -0.5347301163226948),
        ("delta", 0.5244099658805304),
        ("Omega", 0.5347301163226948),
        ("epsilon", 1.048080741042263),
        ("beta_dot", 1139.920302151208),
    ];
    reaches("andrews_squeezer", &values, 0.03, 1e-9);
}

/// From the same test set.
#[test]
fn the_pleiades_are_where_the_test_set_has_them() {
    let x = [
        0.3706139143970502,
        3.237284092057233,
        -3.222559032418324,
        0.659709145577531,
        0.3425581707156584,
        1.562172101400631,
        -0.7003092922212495,
    ];
    let y = [
        -3.943437585517392,
        -3.27138097397255,
        5.225081843456543,
        -2.59061243497747,
        1.198213693392275,
        -0.2429682344935824,
        1.09144924042898,
    ];
    let names: Vec<[String; 2]> = (1..=7).map(|k| [format!("q{k}1"), format!("q{k}2")]).collect();
    let values: Vec<(&str, f64)> = names
        .iter()
        .zip(x.into_iter().zip(y))
        .flat_map(|([q, r], (x, y))| [(q.as_str(), x), (r.as_str(), y)])
        .collect();
    reaches("pleiades", &values, 3.0, 1e-9);
}

/// After a century, by heyoka 7.13.2 (`taylor_adaptive`, `tol = 1e-18`, `high_accuracy`).
#[test]
fn the_outer_planets_are_where_heyoka_has_them() {
    let values = [
        ("q11", 0.006804725407621707),
        ("q12", 0.0007182167308240956),
        ("q21", -5.222912633823977),
        ("q22", -1.5426142627036252),
        ("q23", -0.0338543571517944),
        ("q31", -9.253794371790518),
        ("q42", 15.275100173646008),
        ("q51", 24.78252476661159),
        ("q52", 16.574668026434278),
        ("q61", 32.00309758531965),
        ("q63", -6.235447094882232),
        ("q21_dot", 0.7462294426608361),
        ("q32_dot", -1.9575397140133493),
        ("q62_dot", 0.6652716877591753),
    ];
    reaches("outer_solar_system", &values, 100.0, 1e-10);
}

/// By hand each of 15 pairs takes three differences, three operations for their square, a root, a division, three
/// products for the strength and six fused additions, and each of 18 accelerations a product: 273. The search has
/// fewer.
#[test]
fn rates_of_the_outer_planets_take_no_more_than_by_hand() {
    let scene = models::build_from_shelf("outer_solar_system");
    let rates = scene.program().functions.iter().find(|function| function.role == Role::Rate);
    let counts = rates.expect("rates").counts();
    assert!(counts.total() - counts.fma <= 254, "{counts:?}");
}

/// After one second, by Exudyn 1.13.6 (generalized alpha, `rho = 0.95`): steps of 1, 1/2 and 1/4 ms extrapolated.
#[test]
fn mechanisms_are_where_exudyn_has_them() {
    reaches("flyball_governor", &[("s", 0.501420922391)], 1.0, 1e-9);
    reached("bricard_linkage", 1.0, |at| {
        let [(s1, c1), (s2, c2), (s3, c3)] = ["q1", "q2", "q3"].map(|q| at.get(q).sin_cos());
        // Rods along the axes 1, -2 and 3 of frames that turn about the axes 2, 3 and 1, seen from the first frame.
        let [x, y, z] = [1.0 + s2 + s2 * s3, -c2 - c2 * s3, c3];
        let hinge = [c1 * x + s1 * z, y, c1 * z - s1 * x];
        models::close("hinge", &hinge, &[0.510501462115, -1.649167599061, 0.140123115104], 2e-9);
    });
}

/// `tan d cos bend1 = tan a cos bend2` for aligned yokes (Seherr-Thoss, Schmelz, Aucktor 2006, section 1.2.2), and its
/// derivative: shafts turn alike where the bends are equal.
#[test]
fn a_double_cardan_joint_turns_as_its_bends_say() {
    let ratio = 0.5_f64.cos() / 0.4_f64.cos();
    for t in [0.1, 0.17, 1.0] {
        reached("double_cardan_joint", t, |at| {
            let (a, d) = (at.get("a"), at.get("d"));
            let expected = ratio / (a.cos().powi(2) + (ratio * a.sin()).powi(2));
            models::close("angles", &[d.sin() * a.cos()], &[ratio * a.sin() * d.cos()], 1e-9);
            models::close(
                "speeds",
                &[at.get("d_dot")],
                &[expected * at.get("a_dot")],
                1e-8 * at.get("a_dot"),
            );
        });
    }
}
