//! Connections change coordinates, not motion; curvature and brackets have the signs of the theory.

use hamel_expr::{Graph, Rational, SymbolId};
use hamel_lang::algebra::LieAlgebra;
use hamel_mechanics::mechanics::Equations;
use hamel_tests::bundle::{Bundle, BundleState};
use hamel_tests::draws::{Draws, for_all, one};
use hamel_tests::linear::{Vector, add_scaled, dot, int, unit};
use hamel_tests::models::equations;
use hamel_tests::problem::{Evaluation, equations_of};
use num_traits::Zero;
use proptest::test_runner::TestCaseError;
use std::collections::BTreeMap;

fn groups() -> [LieAlgebra; 3] {
    [LieAlgebra::so(3), LieAlgebra::se(2), LieAlgebra::heisenberg(1)].map(|g| g.expect("it exists"))
}

/// `D_1, D_2` as components of the frame of a bundle over a plane.
const LIFTS: (usize, usize) = (0, 1);

/// The value of an expression of the base coordinates.
fn value_at(graph: &mut Graph, e: hamel_expr::ExprId, base: &[SymbolId], x: &[Rational]) -> Rational {
    let values: BTreeMap<SymbolId, _> =
        base.iter().zip(x).map(|(s, q)| (*s, graph.rational(q.clone()))).collect();
    let value = graph.subs(e, &values).expect("no denominator vanishes");
    graph.as_rational(value).expect("base coordinates are all there is").clone()
}

/// The group components of a bracket of two sections of the frame, at a point of the base.
fn bracket_at(e: &Equations, pair: (usize, usize), n_shape: usize, x: &[Rational]) -> Vector {
    let mut graph = e.system.graph.clone();
    let algebroid = &e.system.algebroid;
    let mut result = vec![int(0); algebroid.rank() - n_shape];
    for (gamma, c) in algebroid.bracket(&mut graph, pair.0, pair.1) {
        assert!(gamma >= n_shape, "brackets are vertical");
        result[gamma - n_shape] = value_at(&mut graph, c, &algebroid.base()[..n_shape], x);
    }
    result
}

/// Rates of the state at a state, by name; the group velocity is called `velocity`. `None` where a pivot vanishes.
fn rates(
    e: &Equations,
    velocity: &str,
    values: &Vector,
    state: &BundleState,
) -> Option<BTreeMap<String, Rational>> {
    let mut at = Evaluation::new(e, |name| {
        let component = |prefix: &str| name.strip_prefix(prefix)?.parse::<usize>().ok();
        match name {
            "x1_dot" => Some(state.x_dot[0].clone()),
            "x2_dot" => Some(state.x_dot[1].clone()),
            _ => component("x")
                .map(|k| state.x[k - 1].clone())
                .or_else(|| component(velocity).map(|k| values[k - 1].clone()))
                .or_else(|| component("a").map(|k| state.a[k - 1].clone())),
        }
    })?;
    e.state.iter().map(|s| Some((s.name.clone(), at.value(s.derivative)?))).collect()
}

fn compare(bundle: &Bundle, draws: &mut Draws) -> Result<(), TestCaseError> {
    let derived = |connected| {
        let text = bundle.text(connected);
        equations_of(&text).unwrap_or_else(|e| panic!("{e}\n{text}"))
    };
    let (trivial, connected) = (derived(false), derived(true));
    let mut verified = 0;
    for _ in 0..2 {
        let state = bundle.state(draws);
        let curvature = bundle.curvature(&state.x, false);
        assert!(curvature.iter().any(|q| !q.is_zero()), "the connection is flat");
        let opposite: Vector = bracket_at(&connected, LIFTS, 2, &state.x).iter().map(|q| -q).collect();
        assert_eq!(opposite, curvature, "[D_1, D_2] = -B for\n{}", bundle.text(true));
        let lift = bundle.lift(&state.x, &state.x_dot);
        let v = add_scaled(&state.xi, &int(1), &lift);
        let Some(plain) = rates(&trivial, "xi", &state.xi, &state) else { continue };
        let Some(lifted) = rates(&connected, "v", &v, &state) else { continue };
        verified += 1;
        let x_ddot = ["x1_dot", "x2_dot"].map(|n| plain[n].clone());
        let lift_rate = bundle.lift_rate(&state, &x_ddot);
        assert!(plain.len() == trivial.state.len() && lifted.len() == connected.state.len());
        let text = bundle.text(true);
        for (name, rate) in &plain {
            let (other, expected) = match name.strip_prefix("xi") {
                Some(k) => {
                    let k: usize = k.parse().expect("components are numbered");
                    (format!("v{k}"), rate + &lift_rate[k - 1])
                }
                None => (name.clone(), rate.clone()),
            };
            assert_eq!(lifted[&other], expected, "rate of {other} in\n{text}");
        }
        assert_eq!(plain.len(), lifted.len());
        for (k, rate) in bundle.advected_rate(&state).iter().enumerate() {
            assert_eq!(&plain[&format!("a{}", k + 1)], rate, "rate of a in\n{text}");
        }
        let n = bundle.algebra.dim();
        if bundle.tie.is_none() || bundle.multipliers {
            assert_eq!(plain.len(), 4 + n + state.a.len());
        } else {
            assert_eq!(plain.len(), 3 + n + state.a.len(), "one velocity is eliminated");
        }
    }
    if verified == 0 {
        return Err(TestCaseError::reject("pivots vanish at every state drawn"));
    }
    Ok(())
}

fn for_all_bundles(cases: u32, shape: impl Fn(&mut Bundle, &mut Draws)) {
    for algebra in groups() {
        for right in [false, true] {
            let what = format!("{}, {}", algebra.name(), if right { "right" } else { "left" });
            for_all(&what, cases, 700, |mut draws| {
                let mut bundle = Bundle::random(&algebra, right, &mut draws);
                shape(&mut bundle, &mut draws);
                compare(&bundle, &mut draws)
            });
        }
    }
}

#[test]
fn a_connection_changes_the_coordinates_and_not_the_motion() {
    for_all_bundles(2, |_, _| {});
}

#[test]
fn a_connection_does_not_change_constrained_motion() {
    for_all_bundles(1, |bundle, draws| bundle.constrain(false, draws));
}

#[test]
fn a_connection_does_not_change_motion_with_multipliers() {
    for_all_bundles(1, |bundle, draws| bundle.constrain(true, draws));
}

#[test]
fn a_connection_does_not_change_motion_with_advected_parameters() {
    for_all_bundles(1, |bundle, draws| bundle.advect(draws));
}

#[test]
fn a_connection_does_not_change_constrained_motion_with_advected_parameters() {
    for_all_bundles(1, |bundle, draws| {
        bundle.advect(draws);
        bundle.constrain(draws.integer() > 0, draws);
    });
}

#[test]
fn horizontal_lifts_act_on_the_fibre_by_the_bracket_with_the_connection() {
    for algebra in groups() {
        for right in [false, true] {
            let mut draws = one(3, 700);
            let bundle = Bundle::random(&algebra, right, &mut draws);
            let e = equations_of(&bundle.text(true)).unwrap();
            let x = draws.generic_vector(2);
            for i in 0..2 {
                let a = bundle.lift(&x, &unit(2, i));
                for b in 0..3 {
                    // [D_i, e_b] = -[A_i, e_b], with the sign of the action.
                    let sign = int(if right { 1 } else { -1 });
                    let expected: Vector =
                        algebra.bracket_of(&a, &unit(3, b)).iter().map(|q| q * &sign).collect();
                    assert_eq!(bracket_at(&e, (i, 2 + b), 2, &x), expected);
                }
            }
        }
    }
}

fn cross(u: &[Rational], v: &[Rational]) -> Vector {
    [(1, 2), (2, 0), (0, 1)].map(|(i, j)| &u[i] * &v[j] - &u[j] * &v[i]).to_vec()
}

#[test]
fn the_curvature_of_wongs_connection_has_the_sign_of_the_theory() {
    let e = equations("wong_particle");
    let rho = e.system.params.iter().find(|p| p.name == "rho").expect("it has a core").clone();
    // The brackets contain rho: put its number in.
    let square = &rho.default * &rho.default;
    for_all("curvature", 8, 40, |mut draws| {
        let x = draws.generic_vector(3);
        let d = dot(&x, &x) + &square;
        // A_i = (e_i x x)/d as a vector of so(3); d_k A_i = (e_i x e_k)/d - 2 x_k (e_i x x)/d^2.
        let a = |i: usize| -> Vector { cross(&unit(3, i), &x).iter().map(|q| q / &d).collect() };
        let slope = |k: usize, i: usize| -> Vector {
            let straight: Vector = cross(&unit(3, i), &unit(3, k)).iter().map(|q| q / &d).collect();
            add_scaled(&straight, &(int(-2) * &x[k] / &d), &a(i))
        };
        for (i, j) in [(0, 1), (0, 2), (1, 2)] {
            let exterior = add_scaled(&slope(i, j), &int(-1), &slope(j, i));
            let bracket = cross(&a(i), &a(j));
            let curvature = add_scaled(&exterior, &int(-1), &bracket);
            let wrong = add_scaled(&exterior, &int(1), &bracket);
            let found = wong_bracket(&e, (i, j), &rho, &x);
            let opposite: Vector = found.iter().map(|q| -q).collect();
            assert_eq!(opposite, curvature, "[D_{i}, D_{j}] = -(dA - [A, A]) at {x:?}");
            assert_ne!(opposite, wrong, "dA + [A, A] is the curvature for the other side");
        }
        Ok(())
    });
}

fn wong_bracket(
    e: &Equations,
    pair: (usize, usize),
    rho: &hamel_codegen::spec::Param,
    x: &[Rational],
) -> Vector {
    let mut graph = e.system.graph.clone();
    let algebroid = &e.system.algebroid;
    let base: Vec<SymbolId> = algebroid.base().iter().copied().chain([rho.symbol]).collect();
    let at: Vector = x.iter().cloned().chain([rho.default.clone()]).collect();
    let mut result = vec![int(0); 3];
    for (gamma, c) in algebroid.bracket(&mut graph, pair.0, pair.1) {
        result[gamma - 3] = value_at(&mut graph, c, &base, &at);
    }
    result
}

#[test]
fn constraints_are_holonomic_exactly_where_their_distribution_is_closed() {
    let holonomic = |items: &str| {
        let text = format!("model m {{ {items} }}");
        equations_of(&text).unwrap_or_else(|e| panic!("{e}\n{text}")).facts.holonomic
    };
    for name in
        ["suslov", "chaplygin_sleigh", "rolling_ball", "rolling_disk", "mobile_robot", "chaplygin_ball"]
    {
        assert_eq!(equations(name).facts.holonomic, Some(false), "{name}");
    }
    for name in ["free_rigid_body", "heavy_top", "wong_particle"] {
        assert_eq!(equations(name).facts.holonomic, None, "{name} has no constraint");
    }
    let plane = "velocity omega, v in se(2); lagrangian = omega^2 + dot(v, v);";
    assert_eq!(holonomic(&format!("{plane} constraint v1 = 0; constraint v2 = 0;")), Some(true));
    assert_eq!(holonomic(&format!("{plane} constraint omega = 0;")), Some(true));
    assert_eq!(holonomic(&format!("{plane} constraint v1 = 0;")), Some(false));
    let shaped =
        "coordinate q in real; velocity omega, v in se(2); lagrangian = omega^2 + dot(v, v) + q_dot^2;";
    // omega = q_dot, v = 0: theta - q is constant. v1 = q q_dot: the body moves along a line with q.
    let rigid = format!("{shaped} constraint omega = q_dot; constraint v = 0;");
    assert_eq!(holonomic(&rigid), Some(true));
    let sliding = format!("{shaped} constraint omega = 0; constraint v1 = q*q_dot;");
    assert_eq!(holonomic(&sliding), Some(true));
    let turning = format!("{shaped} constraint omega = q_dot; constraint v1 = q*q_dot;");
    assert_eq!(holonomic(&turning), Some(false));
    // d(x dy - y dx) = 2 dx dy, d(x dy + y dx) = 0.
    let base = "coordinate x, y, z in real; lagrangian = x_dot^2 + y_dot^2 + z_dot^2;";
    assert_eq!(holonomic(&format!("{base} constraint z_dot = x*y_dot - y*x_dot;")), Some(false));
    assert_eq!(holonomic(&format!("{base} constraint z_dot = x*y_dot + y*x_dot;")), Some(true));
    // With multipliers, and with an offset, which time is a coordinate of: d(dz - x dt) = -dx dt.
    assert_eq!(equations("veselova").facts.holonomic, Some(false));
    assert_eq!(equations("ball_on_rotating_table").facts.holonomic, Some(false));
    assert_eq!(equations("appell_machine").facts.holonomic, None, "not affine in the velocities");
    for (constraint, expected) in [
        ("x*x_dot + y*y_dot + z*z_dot = 0; multipliers", true),
        ("x*x_dot + y*y_dot + z*x_dot = 0; multipliers", false),
        ("z_dot = 3 + x*y_dot + y*x_dot", true),
        ("z_dot = t + x*y_dot + y*x_dot; multipliers", true),
        ("z_dot = x", false),
        ("z_dot = x + t*x_dot", true),
        ("x_dot = y; constraint y_dot = x", true),
    ] {
        assert_eq!(holonomic(&format!("{base} constraint {constraint};")), Some(expected), "{constraint}");
    }
    // A body that may turn about the vertical alone.
    let upright = "velocity w in so(3); advected g in R^3 by cross(w, g); lagrangian = dot(w, w) - g3;
        constraint w1*g2 = w2*g1; constraint w1*g3 = w3*g1; multipliers;";
    assert_eq!(holonomic(upright), Some(true));
    // A connection makes the same constraint v = 0 holonomic or not: that is its curvature.
    let connected = |a: &str| {
        format!(
            "coordinate x, y in real; velocity v in R; lagrangian = x_dot^2 + y_dot^2 + v^2; connection v = {a};
             constraint v = 0;"
        )
    };
    assert_eq!(holonomic(&connected("x*y_dot - y*x_dot")), Some(false));
    assert_eq!(holonomic(&connected("x*y_dot + y*x_dot")), Some(true));
    // y - t x is no function that is kept by dy = t dx: the slope turns under way. In a frame that moves with time the
    // same.
    assert_eq!(
        holonomic("coordinate x, y in real; lagrangian = x_dot^2 + y_dot^2; constraint y_dot = t*x_dot;"),
        Some(false)
    );
    let moving = |constraint: &str| {
        holonomic(&format!(
            "coordinate x in real; velocity v in R; lagrangian = x_dot^2 + v^2; connection v = t*x_dot; constraint {constraint};"
        ))
    };
    assert_eq!(moving("v = 0"), Some(false));
    assert_eq!(moving("v = t*x_dot"), Some(true));
    // Who walks to the left, and turns, comes everywhere; who turns at a given rate and does not walk stays.
    assert_eq!(holonomic(&format!("{plane} constraint v1 = 0; constraint v2 = 1;")), Some(false));
    assert_eq!(holonomic(&format!("{plane} constraint omega = 1; constraint v = 0;")), Some(true));
}
