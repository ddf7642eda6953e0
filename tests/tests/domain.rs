//! Domains of coordinates: leaving one is a typed error that names the coordinate, and the last state inside is kept.

use std::f64::consts::PI;

use hamel_codegen::{scene, spec};
use hamel_models::generated::{euler_disk, euler_disk_circle};
use hamel_runtime::{Dop853, Error, Failure, Integrator, Options, System};
use hamel_tests::models::{Interpreted, State, build};

fn condition(result: Result<(), Failure>) -> Option<&'static str> {
    match result {
        Ok(()) => None,
        Err(Failure::OutsideDomain { condition, .. }) => Some(condition),
        Err(other) => panic!("{other}"),
    }
}

#[test]
fn the_condition_that_does_not_hold_is_named() {
    let disk: euler_disk::Prepared = euler_disk::Prepared::new(&Default::default()).unwrap();
    let at = |theta| condition(disk.domain(0.0, &[theta, 0.0, 0.0, 1.5, -6.0]));
    assert_eq!([at(0.3), at(1.5)], [None; 2]);
    assert_eq!([at(-0.1), at(0.0), at(f64::NAN)], [Some("theta > 0"); 3]);
    assert_eq!([at(1.6), at(PI / 2.0)], [Some("theta < pi/2"); 2]);
    let failure = System::domain(&disk, 2.0, &[-0.1, 0.0, 0.0, 1.5, -6.0]).unwrap_err();
    assert!(matches!(failure, Failure::OutsideDomain { t: 2.0, .. }), "{failure:?}");
}

#[test]
fn an_angle_on_the_circle_has_the_same_domain() {
    let disk: euler_disk_circle::Prepared = euler_disk_circle::Prepared::new(&Default::default()).unwrap();
    for k in -62..63 {
        let theta = 0.05 * f64::from(k) + 0.01;
        let found = condition(disk.domain(0.0, &[theta.cos(), theta.sin(), 0.0, 1.5, -6.0]));
        let expected = match theta {
            _ if theta < 0.0 => Some("theta > 0"),
            _ if theta > PI / 2.0 => Some("theta < pi/2"),
            _ => None,
        };
        assert_eq!(found, expected, "theta = {theta}");
    }
}

#[test]
fn arcs_of_any_length_have_their_domain_on_the_circle() {
    let cases = [
        ("(0, pi)", 0.0, PI, ["0 < a < pi"; 2]),
        ("(-pi/4, 3*pi/4)", -PI / 4.0, 0.75 * PI, ["-pi/4 < a < 3*pi/4"; 2]),
        ("(-1, 1)", -1.0, 1.0, ["a > -1", "a < 1"]),
        ("(-pi/2, pi)", -PI / 2.0, PI, ["-pi/2 < a < pi"; 2]),
    ];
    for (domain, low, high, [below, above]) in cases {
        let text = format!(
            "model wheel {{ coordinate a in {domain}; lagrangian = a_dot^2/2 - cos(a);
            scene round {{ circle a; want rhs; }} }}"
        );
        let model = spec::parse("wheel.hamel", &text).unwrap_or_else(|e| panic!("{e}"));
        let built = scene::build(&model, "round").unwrap_or_else(|e| panic!("{e}"));
        let interpreter = built.prepare(&[]).unwrap();
        let at = |a: f64| interpreter.domain(0.0, &[a.cos(), a.sin(), 0.0]);
        for k in 1..20 {
            let inside = low + (high - low) * f64::from(k) / 20.0;
            assert_eq!(at(inside), Ok(()), "{domain}: {inside}");
        }
        assert_eq!([at(low - 0.1), at(high + 0.1)], [Err(below.into()), Err(above.into())], "{domain}");
    }
}

/// Equations with functions that have no value everywhere; `u` drives one of them.
const PARTIAL: &str = "model partial {
    param c = 2;
    param d = 1 where d > 0;
    input u = 1;
    coordinate x, y, z, w in real;
    let s = x*y - w^2;
    lagrangian = (x_dot^2 + y_dot^2 + z_dot^2 + w_dot^2)/2 - x*ln(s) + sqrt(1 + x^2) + sqrt(d)*y;
    force y_dot = -y_dot*sqrt(z);
    force z_dot = asin(x - y) - sqrt(c)*(3 + z)^(-3/2) + sqrt(u);
    scene moving { input u; want rhs; }
}";

/// What is seen to be inside has no condition: `1 + x^2`, and `d` by its own.
#[test]
fn arguments_of_logarithms_and_roots_have_a_domain() {
    let model = spec::parse("partial.hamel", PARTIAL).unwrap_or_else(|e| panic!("{e}"));
    let built = scene::build(&model, "moving").unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(built.state_names(), ["x", "y", "z", "w", "x_dot", "y_dot", "z_dot", "w_dot"]);
    let interpreter = built.prepare(&[2.0, 1.0]).unwrap();
    let at = |x: f64, y: f64, z: f64, w: f64| {
        let state = [x, y, z, w, 0.1, 0.2, 0.3, 0.4];
        let mut dy = [0.0; 8];
        interpreter.rhs_with(0.0, &state, &[1.0], &mut dy);
        let domain = interpreter.domain(0.0, &state);
        // A condition that holds has values, and one that does not has none.
        assert_eq!(dy.iter().all(|x| x.is_finite()), domain.is_ok(), "{domain:?}: {dy:?}");
        domain.err()
    };
    assert_eq!(at(1.0, 1.5, 0.2, 0.3), None);
    assert_eq!(at(1.0, 1.5, 0.0, 0.3), None);
    assert_eq!(at(1.0, 1.5, 0.2, 3.0).as_deref(), Some("x*y - w^2 > 0"));
    assert_eq!(at(1.0, 1.5, -0.2, 0.3).as_deref(), Some("z >= 0"));
    assert_eq!(at(1.0, 1.5, -4.0, 0.3).as_deref(), Some("z >= 0"));
    assert_eq!(at(1.0, 2.5, 0.2, 0.3).as_deref(), Some("-1 <= x - y <= 1"));
    let refused = built.prepare(&[-2.0, 1.0]).err().map(|e| e.to_string());
    assert!(refused.as_ref().is_some_and(|text| text.contains("c >= 0")), "{refused:?}");
}

/// A motion towards a logarithm of zero that has none behind it.
#[test]
fn a_motion_ends_where_a_logarithm_has_no_value() {
    let text = "model falling { coordinate x in real; lagrangian = x_dot^2/2; force x_dot = -1 + ln(x)/10; }";
    let model = spec::parse("falling.hamel", text).unwrap_or_else(|e| panic!("{e}"));
    let built = scene::build(&model, scene::DEFAULT).unwrap_or_else(|e| panic!("{e}"));
    let system = Interpreted(built.prepare(&[]).unwrap());
    let start = State(vec![1.0, 0.0]);
    let options = Options::adaptive(1e-9, 1e-11);
    let mut solver = Integrator::new(&system, Dop853, 0.0, start, options).unwrap();
    let error = solver.integrate_to(10.0).unwrap_err();
    assert!(matches!(error, Error::Failure(Failure::OutsideDomain { condition: "x > 0", .. })), "{error}");
    assert!(solver.state().0[0] > 0.0);
    let outside = Integrator::new(&system, Dop853, 0.0, State(vec![-1.0, 0.0]), options).map(|_| ());
    assert!(matches!(outside, Err(Error::Failure(Failure::OutsideDomain { .. }))), "{outside:?}");
}

#[test]
fn a_disk_that_falls_flat_stops_at_the_boundary() {
    let disk: euler_disk::Prepared = euler_disk::Prepared::new(&Default::default()).unwrap();
    // At rest it falls about its contact point.
    let start = [0.9, 0.0, 0.0, 0.0, 0.0];
    let options = Options::adaptive(1e-9, 1e-11);
    let mut solver = Integrator::new(&disk, Dop853, 0.0, start, options).unwrap();
    let error = solver.integrate_to(10.0).unwrap_err();
    assert!(
        matches!(error, Error::Failure(Failure::OutsideDomain { condition: "theta > 0", .. })),
        "{error:?}"
    );
    let theta = solver.state()[0];
    assert!(0.0 < theta && theta < 1e-10, "{theta}");
    assert!(solver.t() > 0.1 && solver.t() < 1.0, "{}", solver.t());
}

#[test]
fn a_scene_without_a_domain_has_no_code_for_it() {
    let has_domain = |model: &str, scene: &str| build(model, scene).emit().unwrap().contains("fn domain");
    assert!(has_domain("euler_disk", "minimal"));
    for (model, scene) in [("heavy_top", "default"), ("snakeboard", "default"), ("snakeboard", "minimal")] {
        assert!(!has_domain(model, scene), "{model} {scene}");
    }
}

#[test]
fn ends_may_contain_parameters_that_a_scene_fixes() {
    let text = "model bead {
        param L = 3 where L > 0;
        coordinate x in (-L, 2*L);
        lagrangian = x_dot^2/2 - x;
        scene short { fix L = 1; want rhs; }
    }";
    let model = spec::parse("bead.hamel", text).unwrap_or_else(|e| panic!("{e}"));
    for (name, params, conditions) in
        [("default", &[3.0][..], ["x > -L", "x < 2*L"]), ("short", &[], ["x > -1", "x < 2"])]
    {
        let built = scene::build(&model, name).unwrap_or_else(|e| panic!("{e}"));
        let interpreter = built.prepare(params).unwrap();
        let length = params.first().copied().unwrap_or(1.0);
        let at = |x: f64| interpreter.domain(0.0, &[x * length, 0.0]);
        assert_eq!([at(-0.9), at(1.9)], [Ok(()), Ok(())], "{name}");
        assert_eq!([at(-1.1), at(2.1)], conditions.map(|c| Err(c.to_owned())), "{name}");
    }
}
