//! Modules of fluids that are moved as products of matrices: the ones of `tests/fluids`, compiled and run, and that
//! their size does not depend on that of the matrices.
//!
//! Write them again with `UPDATE_EXPECT=1 cargo test -p hamel-codegen --test main fluids`.

use expect_test::expect_file;
use hamel_codegen::config::Bundle;
use hamel_codegen::error::Error;
use hamel_codegen::spec::{self, FluidField, FluidTrace, MatrixFluid};
use hamel_codegen::{Config, certify};
use hamel_runtime::matrices::{Damped, IsospectralMidpoint, Options, Sphere, Torus};
use num_rational::BigRational;

/// The module on the torus, as a crate has it.
mod torus {
    include!("fluids/torus.rs");
}

/// The module on the sphere.
mod sphere {
    include!("fluids/sphere.rs");
}

/// A sphere that turns, with a radius of deformation, friction and a force.
mod turning {
    include!("fluids/turning.rs");
}

/// A fluid that carries a magnetic field, a buoyancy and a tracer.
mod magnetic {
    include!("fluids/magnetic.rs");
}

const TORUS: &str = include_str!("fluids/torus.hamel");
const SPHERE: &str = include_str!("fluids/sphere.hamel");
const TURNING: &str = include_str!("fluids/turning.hamel");
const MAGNETIC: &str = include_str!("fluids/magnetic.hamel");

fn read(name: &str, text: &str) -> MatrixFluid {
    spec::matrix_fluid(name, text).unwrap_or_else(|e| panic!("{e}")).expect("a fluid of matrices")
}

fn module(name: &str, text: &str) -> String {
    let fluid = read(name, text);
    let mut bundle = Bundle::default();
    Config::new().add_fluids(&[fluid], &mut bundle).unwrap();
    bundle.files.remove(&format!("{name}.rs")).expect("a file")
}

#[test]
fn the_modules_are_the_ones_that_were_compiled() {
    expect_file!["fluids/torus.rs"].assert_eq(&module("torus", TORUS));
    expect_file!["fluids/sphere.rs"].assert_eq(&module("sphere", SPHERE));
    expect_file!["fluids/turning.rs"].assert_eq(&module("turning", TURNING));
    expect_file!["fluids/magnetic.rs"].assert_eq(&module("magnetic", MAGNETIC));
}

#[test]
fn modules_of_any_size_differ_in_a_number() {
    let sizes = [("torus", TORUS, "63", "1023"), ("sphere", SPHERE, "32", "1024")];
    for (name, text, size, largest) in sizes {
        let other = module(name, &text.replace(&format!("({size})"), &format!("({largest})")));
        let number = |n: &str| format!("pub const N: usize = {n};");
        assert_eq!(module(name, text).replace(&number(size), &number(largest)), other);
    }
}

#[test]
fn a_fluid_on_the_torus_begins_and_goes_on_as_the_model_says() {
    // Half of the waves, by |m|^2.
    let energy = 0.25 + 0.0625 / 5.0 + 0.015_625 / 13.0;
    let drift = |step: f64| {
        let surface = torus::surface(vec![0.0; Torus::<Vec<f64>>::storage(torus::N)]).unwrap();
        let options = Options::fixed(step);
        let room = vec![0.0; IsospectralMidpoint::<Torus<Vec<f64>>, Vec<f64>>::storage(torus::N, &options)];
        let mut fluid = torus::fluid(&surface, room, options).unwrap();
        assert_eq!(torus::MODES, ["w_re_1_0", "w_im_1_2", "w_re_3_m2", "w_re_0_1"]);
        let modes = torus::modes(&fluid);
        assert!(modes.iter().zip(torus::INITIAL).all(|(x, y)| (x - y).abs() < 1e-15), "{modes:?}");
        assert!((torus::energy(&mut fluid) - energy).abs() < 1e-15);
        let before = torus::casimirs(&mut fluid);
        assert!((before[0] - 2.0 * (0.25 + 0.0625 + 0.015_625)).abs() < 1e-14, "{before:?}");
        fluid.integrate_to(1.0).unwrap();
        let after = torus::casimirs(&mut fluid);
        assert!(before.iter().zip(after).all(|(x, y)| (x - y).abs() < 1e-14), "{before:?} {after:?}");
        assert!((torus::modes(&fluid)[1] - modes[1]).abs() > 1e-3);
        (torus::energy(&mut fluid) - energy).abs()
    };
    // Steps are of second order.
    let (coarse, fine) = (drift(0.05), drift(0.025));
    assert!(fine < 5e-6 && (3.0..5.0).contains(&(coarse / fine)), "{coarse:e} {fine:e}");
}

#[test]
fn a_fluid_on_the_sphere_begins_and_goes_on_as_the_model_says() {
    let surface = sphere::surface(vec![0.0; Sphere::<Vec<f64>>::storage(sphere::N)]).unwrap();
    let options = Options::fixed(0.05);
    let room = vec![0.0; IsospectralMidpoint::<Sphere<Vec<f64>>, Vec<f64>>::storage(sphere::N, &options)];
    let mut fluid = sphere::fluid(&surface, room, options).unwrap();
    let modes = sphere::modes(&fluid);
    assert!(modes.iter().zip(sphere::INITIAL).all(|(x, y)| (x - y).abs() < 1e-14), "{modes:?}");
    // Half the sum of squares by l (l + 1).
    let energy = 0.5 * (1.0 / 2.0 + 0.0625 / 30.0 + 0.25 / 12.0);
    assert!((sphere::energy(&mut fluid) - energy).abs() < 1e-14);
    let [before] = sphere::casimirs(&mut fluid);
    assert!((before - 1.3125).abs() < 1e-13, "{before}");
    fluid.integrate_to(1.0).unwrap();
    let [after] = sphere::casimirs(&mut fluid);
    assert!((before - after).abs() < 1e-13, "{before} {after}");
    // Solid rotation stays, and turns the other harmonics.
    let moved = sphere::modes(&fluid);
    assert!((moved[0] - 1.0).abs() < 1e-12 && (moved[1] - 0.25).abs() > 1e-3, "{moved:?}");
}

#[test]
fn a_fluid_with_friction_begins_and_goes_on_as_the_model_says() {
    let surface = turning::surface(vec![0.0; Sphere::<Vec<f64>>::storage(turning::N)]).unwrap();
    let options = Options::fixed(0.05).with_background();
    let room = vec![0.0; IsospectralMidpoint::<Sphere<Vec<f64>>, Vec<f64>>::storage(turning::N, &options)];
    let more = vec![0.0; Damped::<Sphere<Vec<f64>>, Vec<f64>>::storage(turning::N)];
    let mut fluid = turning::fluid(&surface, room, more, options).unwrap();
    let modes = turning::modes(&fluid);
    assert!(modes.iter().zip(turning::INITIAL).all(|(x, y)| (x - y).abs() < 1e-14), "{modes:?}");
    // Half the sum of squares by F + l (l + 1), and the linear terms.
    let [_, (_, rotation), (_, radius), _] = turning::PARAMS;
    let of = |x: f64, l: f64| 0.5 * x * x / (radius + l * (l + 1.0));
    let energy = of(2.0 * rotation, 1.0) + of(0.25, 5.0) + of(-0.5, 3.0) - 2.0 * rotation * rotation - 0.05;
    assert!((turning::energy(&mut fluid) - energy).abs() < 1e-14);
    let [before] = turning::casimirs(&mut fluid);
    fluid.integrate_to(1.0).unwrap();
    let [after] = turning::casimirs(&mut fluid);
    assert!((before - after).abs() > 1e-3, "{before} {after}");
}

#[test]
fn a_fluid_with_fields_begins_and_goes_on_as_the_model_says() {
    let surface = magnetic::surface(vec![0.0; Torus::<Vec<f64>>::storage(magnetic::N)]).unwrap();
    let options = Options::fixed(0.01).with_carried(3).with_background();
    let room = vec![0.0; IsospectralMidpoint::<Torus<Vec<f64>>, Vec<f64>>::storage(magnetic::N, &options)];
    let mut fluid = magnetic::fluid(&surface, room, options).unwrap();
    assert_eq!(magnetic::CARRIED, ["a", "b", "c"]);
    let modes = magnetic::modes(&fluid);
    assert!(modes.iter().zip(magnetic::INITIAL).all(|(x, y)| (x - y).abs() < 1e-14), "{modes:?}");
    // Half of the waves: squares by |m|^2, and times it, and the buoyancy that there is none of at the height.
    let energy = 0.09 / 5.0 + 1.5 * (0.25 + 0.0225 * 5.0) + (0.25 + 0.0225) / 10.0;
    assert!((magnetic::energy(&mut fluid) - energy).abs() < 1e-14);
    let before = magnetic::casimirs(&mut fluid);
    assert!((before[0] - 2.0 * (0.25 + 0.0225)).abs() < 1e-14, "{before:?}");
    fluid.integrate_to(1.0).unwrap();
    let after = magnetic::casimirs(&mut fluid);
    let change = |k: usize| (after[k] - before[k]).abs();
    // Casimirs of single fields are kept; the buoyancy changes traces of the vorticity with the other field.
    assert!(change(0) < 1e-14 && change(1) < 1e-14, "{before:?} {after:?}");
    assert!(change(5) > 1e-3, "{before:?} {after:?}");
    // The cross helicity, in two ways.
    assert!((after[2] - after[4]).abs() < 1e-15 && change(2) > 1e-6, "{before:?} {after:?}");
    let moved = magnetic::modes(&fluid);
    assert!(modes.iter().zip(moved).all(|(x, y)| (x - y).abs() > 1e-6), "{moved:?}");
    assert!((magnetic::energy(&mut fluid) - energy).abs() < 1e-4);
}

/// The certificate finds each number of carried fields that the text does not say; traces are as the text says.
#[test]
fn currents_that_the_text_does_not_say_are_found() {
    let right = read("magnetic", MAGNETIC);
    certify::fluid(&right).unwrap();
    let traces: Vec<(&FluidTrace, f64)> =
        right.casimirs.iter().map(|c| (&c.trace, hamel_expr::rational_to_f64(&c.factor))).collect();
    let of = |k: usize, power: usize| FluidTrace::Power(FluidField::Carried(k), power);
    let expected = [
        (of(0, 2), 1.0),
        (of(1, 3), 1.0),
        (FluidTrace::Cross(0, 1), 1.0),
        (FluidTrace::Cross(0, 2), 1.0),
        (FluidTrace::Cross(0, 1), 1.0),
        (FluidTrace::Power(FluidField::Vorticity, 2), 1.0),
    ];
    assert!(traces.iter().zip(&expected).all(|((a, x), (b, y))| *a == b && x == y), "{traces:?}");
    let half = BigRational::new(1.into(), 2.into());
    type Fault = fn(&mut MatrixFluid, &BigRational);
    let faults: [(&str, Fault); 9] = [
        ("sign of the magnetic force", |f, _| f.carried[0].current[1] = -f.carried[0].current[1].clone()),
        ("half of the magnetic force", |f, half| {
            f.carried[0].current[1] = f.carried[0].current[1].clone() * half
        }),
        ("no summand without the Laplacian", |f, _| {
            f.carried[0].current[0] = BigRational::from_integer(0.into());
        }),
        ("no magnetic force", |f, _| f.carried[0].current.clear()),
        ("swapped fields", |f, _| f.carried.swap(0, 1)),
        ("a tracer with energy", |f, half| f.carried[2].current = vec![half.clone()]),
        ("sign of the buoyancy", |f, _| {
            f.carried[1].constant[0].value = -f.carried[1].constant[0].value.clone()
        }),
        ("no buoyancy", |f, _| f.carried[1].constant.clear()),
        ("buoyancy of another wave", |f, _| f.carried[1].constant[0].wave.wave = (1, 1)),
    ];
    for (name, fault) in faults {
        let mut wrong = right.clone();
        fault(&mut wrong, &half);
        assert!(matches!(certify::fluid(&wrong), Err(Error::Disagrees { .. })), "{name}");
    }
}

/// The certificate finds each number that the text does not say.
#[test]
fn numbers_that_the_text_does_not_say_are_found() {
    let right = read("turning", TURNING);
    certify::fluid(&right).unwrap();
    let half = BigRational::new(1.into(), 2.into());
    type Fault = fn(&mut MatrixFluid, &BigRational);
    let faults: [(&str, Fault); 9] = [
        ("scale", |f, half| f.scale = -f.scale.clone() * half),
        ("shift", |f, half| f.shift = f.shift.clone() + half),
        ("sign of the background", |f, _| f.background[0].value = -f.background[0].value.clone()),
        ("no background", |f, _| f.background.clear()),
        ("cosine for sine", |f, _| f.background[1].wave.is_second = false),
        ("friction of another power", |f, _| f.friction.insert(0, BigRational::from_integer(0.into()))),
        ("sign of the friction", |f, _| f.friction[1] = -f.friction[1].clone()),
        ("no force", |f, _| f.force.clear()),
        ("another wave of the force", |f, _| f.force[0].wave.wave.1 += 1),
    ];
    for (name, fault) in faults {
        let mut wrong = right.clone();
        fault(&mut wrong, &half);
        assert!(matches!(certify::fluid(&wrong), Err(Error::Disagrees { .. })), "{name}");
    }
}

/// Items may stand in any order; forces on short waves are checked as fast as others.
#[test]
fn definitions_are_made_of_parameters_that_follow() {
    let text = "model flow { algebra fluid = zeitlin(201); momentum q in fluid as *; action right;
        param b = 1 where b < c; let c = 2*d; param d = 3;
        hamiltonian = -dot(q, laplacian(fluid)^-1*q)*c/6 + re_100_m99; force along dh_dim_0_100: c;
        initial re_1_0 = d; }";
    let fluid = read("flow", text);
    assert!(fluid.scale == BigRational::from_integer(1.into()) && fluid.force.len() == 1);
    certify::fluid(&fluid).unwrap();
    let mut wrong = fluid;
    wrong.force[0].value = -wrong.force[0].value.clone();
    assert!(matches!(certify::fluid(&wrong), Err(Error::Disagrees { .. })));
}

/// Equations by `ad` need the adjoint representation, which is there up to `N = 7`; those by `functions` do not.
#[test]
fn fields_without_equations_are_carried_by_matrices() {
    let text = |algebra: &str, by: &str, n: usize| {
        let (mode, factor) = if algebra == "zeitlin" { ("re_1_0", "") } else { ("c_1_0", "1/2*") };
        format!(
            "model flow {{ algebra fluid = {algebra}({n}); momentum w in fluid as w_*; action right;
             advected a in fluid as a_* by {by}; hamiltonian = -{factor}dot(w, laplacian(fluid)^-1*w);
             initial w_{mode} = 1; }}"
        )
    };
    for (algebra, by, n, is_of_matrices) in [
        ("zeitlin", "ad", 7, false),
        ("zeitlin", "ad", 9, true),
        ("zeitlin", "functions", 9, false),
        ("zeitlin", "functions", 17, true),
        ("zeitlin_sphere", "ad", 7, false),
        ("zeitlin_sphere", "ad", 8, true),
    ] {
        let found = spec::matrix_fluid("flow", &text(algebra, by, n)).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(found.is_some(), is_of_matrices, "{algebra}({n}) by {by}");
    }
}

#[test]
fn parameters_have_other_values() {
    let fluid = read("turning", TURNING);
    let mut values: Vec<BigRational> = fluid.params.iter().map(|p| p.value.clone()).collect();
    values[2] = BigRational::from_integer(2.into());
    let other = fluid.at(&values).unwrap();
    assert_eq!((&other.shift, other.shift == fluid.shift), (&values[2], false));
    certify::fluid(&other).unwrap();
    values[2] = BigRational::from_integer((-1).into());
    let refused = fluid.at(&values).unwrap_err().to_string();
    assert!(refused.contains("the parameters violate `F >= 0`"), "{refused}");
}
