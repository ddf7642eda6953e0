//! Constraints of third order and virtual displacements that depend on accelerations: laws hold along the motion,
//! reactions act where the displacements say, hand-derived equations in other variables are the same motion, and so is
//! every formulation.

use std::collections::BTreeMap;

use hamel_codegen::scene::{self, BuiltScene};
use hamel_codegen::spec::{self, ConnectionKind, LieAlgebra, ModelBuilder, Value, ValueError};
use hamel_expr::{ExprId, Graph, Rational, Style};
use hamel_mechanics::mechanics::{DisplacementForms, Equations, derive, same_motion};
use hamel_mechanics::reduction::{Formulation, StageUse, reduce};
use hamel_tests::draws::{Draws, for_all};
use hamel_tests::linear::int;
use hamel_tests::models::{close, equations, follow, params, text, times};
use hamel_tests::problem::{Evaluation, equations_of};

fn build(text: &str, scene: &str) -> BuiltScene {
    let model = spec::parse("higher.hamel", text).unwrap_or_else(|e| panic!("{e}\n{text}"));
    scene::build(&model, scene).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

fn derived(text: &str) -> Equations {
    equations_of(text).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

/// Whatever a scene's state is called, with its first two derivatives along the motion.
struct Jet {
    t: f64,
    values: [BTreeMap<String, f64>; 3],
}

impl Jet {
    fn get(&self, order: usize, name: &str) -> f64 {
        *self.values[order].get(name).unwrap_or_else(|| panic!("no state variable {name}"))
    }

    fn vector(&self, order: usize, name: &str) -> [f64; 3] {
        [1, 2, 3].map(|k| self.get(order, &format!("{name}{k}")))
    }
}

/// The second derivative is the central difference of the first one along it.
fn jet(scene: &BuiltScene, t: f64, y: &[f64]) -> Jet {
    const H: f64 = 1e-5;
    let prepared = scene.prepare(&params(scene, &[])).unwrap_or_else(|e| panic!("{e}"));
    let rhs = |t: f64, y: &[f64]| {
        let mut dy = vec![0.0; y.len()];
        prepared.rhs(t, y, &mut dy);
        dy
    };
    let rate = rhs(t, y);
    let moved = |h: f64| rhs(t + h, &y.iter().zip(&rate).map(|(y, r)| y + h * r).collect::<Vec<f64>>());
    let (after, before) = (moved(H), moved(-H));
    let second: Vec<f64> = after.iter().zip(&before).map(|(a, b)| (a - b) / (2.0 * H)).collect();
    let named = |list: &[f64]| scene.state_names().into_iter().zip(list.iter().copied()).collect();
    Jet { t, values: [named(y), named(&rate), named(&second)] }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// States that belong to nothing special, and times.
fn states(n: usize) -> Vec<(f64, Vec<f64>)> {
    let at = |k: usize| {
        let y = (0..n).map(|i| ((1 + i + 3 * k) as f64 * 1.7).sin() * (0.4 + 0.1 * k as f64));
        (0.3 * k as f64, y.collect())
    };
    (0..4).map(at).collect()
}

/// A law, left side less right side.
type Law = fn(&Jet) -> f64;

#[test]
fn laws_of_third_order_hold_along_the_motion() {
    let factors = "model factors {
        param m = 1.5 where m > 0;
        coordinate x, y in real;
        lagrangian = m*x_dot^2/2 + (1 + x^2)*y_dot^2 - cos(x - y);
        constraint law: (2 + x^2)*ddt(ddt(x_dot)) + sin(t)*y_dot*ddt(ddt(y_dot))
            + ddt(x_dot)*ddt(y_dot) + exp(x)*ddt(x_dot) = t;
        virtual (3 + y_dot^2)*delta(x_dot) + x*delta(y_dot) = 0;
    }";
    let of_factors: Law = |at| {
        let [x, v] = ["x", "y_dot"].map(|n| at.get(0, n));
        let [a, b] = ["x_dot", "y_dot"].map(|n| at.get(1, n));
        let [j, k] = ["x_dot", "y_dot"].map(|n| at.get(2, n));
        (2.0 + x * x) * j + at.t.sin() * v * k + a * b + x.exp() * a - at.t
    };
    let advected = "model advected {
        param I: diagonal(3) = [1.3, 1.7, 0.6] where I1 > 0, I2 > 0, I3 > 0;
        velocity Omega in so(3);
        SIDE
        lagrangian = dot(Omega, I*Omega)/2 - G3;
        constraint law: dot(G, ddt(ddt(Omega))) + G1*dot(Omega, ddt(Omega)) + 2*dot(G, Omega) = 0;
    }";
    let (left, right) = (
        advected.replace("SIDE", "advected G in R^3 by cross(Omega, G);"),
        advected.replace("SIDE", "advected G in R^3 by cross(Omega, G); action right;"),
    );
    let of_advected: Law = |at| {
        let [g, w] = ["G", "Omega"].map(|n| at.vector(0, n));
        let [a, j] = [1, 2].map(|order| at.vector(order, "Omega"));
        dot(g, j) + g[0] * dot(w, a) + 2.0 * dot(g, w)
    };
    let bundle = "model bundle {
        coordinate s in real;
        velocity omega, v in se(2);
        connection omega = cos(s)*s_dot;
        lagrangian = s_dot^2 + omega^2 + dot(v, v) + s_dot*v1*sin(s)/2;
        constraint law: ddt(ddt(omega)) + s*ddt(ddt(v1)) + v2*ddt(s_dot) = 0;
        constraint keep: ddt(v2) + s_dot = 0;
        virtual delta(omega) + s*delta(v1) = 0;
        virtual delta(v2) + omega*delta(s_dot)/4 = 0;
    }";
    let of_bundle: Law = |at| {
        let [s, v2] = ["s", "v2"].map(|n| at.get(0, n));
        at.get(2, "omega") + s * at.get(2, "v1") + v2 * at.get(1, "s_dot")
    };
    let kept: Law = |at| at.get(1, "v2") + at.get(0, "s_dot");
    let frame = "model polar {
        coordinate r in (0, 100); coordinate phi in angle;
        frame { u = r_dot; w = r*phi_dot; }
        lagrangian = (u^2 + w^2)/2 + 1/(2 + r);
        constraint law: ddt(ddt(w)) + r*ddt(ddt(phi_dot)) + u = 0;
    }";
    // phi_dot = w/r, differentiated twice.
    let of_frame: Law = |at| {
        let [r, u, w] = ["r", "u", "w"].map(|n| at.get(0, n));
        let ([du, dw], ddw) = (["u", "w"].map(|n| at.get(1, n)), at.get(2, "w"));
        let phi = ddw / r - 2.0 * dw * u / (r * r) - w * du / (r * r) + 2.0 * w * u * u / (r * r * r);
        ddw + r * phi + u
    };
    let cases: [(&str, &[Law]); 5] = [
        (factors, &[of_factors]),
        (&left, &[of_advected]),
        (&right, &[of_advected]),
        (bundle, &[of_bundle, kept]),
        (frame, &[of_frame]),
    ];
    for (text, laws) in cases {
        let scene = build(text, scene::DEFAULT);
        let names = scene.state_names();
        assert_eq!(names.last().map(String::as_str), Some("acceleration_law"), "{names:?}");
        for (t, mut y) in states(names.len()) {
            // The polar radius is positive.
            y[0] = 1.0 + y[0].abs();
            let at = jet(&scene, t, &y);
            for law in laws {
                let residual = law(&at);
                assert!(residual.abs() < 2e-7, "{residual} at {t}, {y:?} of\n{text}");
            }
        }
    }
}

#[test]
fn the_state_has_the_combination_of_accelerations_of_the_third_order() {
    let text = "model m {
        coordinate x, y in real;
        lagrangian = x_dot^2 + x_dot*y_dot/2 + y_dot^2 - x^2*y;
        constraint law: (1 + y^2)*ddt(ddt(x_dot)) - 2*ddt(ddt(y_dot)) + x = 0;
        virtual delta(x_dot) = x*delta(y_dot);
    }";
    let e = derived(text);
    let carried = e.state.iter().find(|s| s.name == "acceleration_law").expect("it is carried");
    assert!(carried.doc.contains("acceleration along constraint `law`"), "{}", carried.doc);
    for_all("carried acceleration", 24, 40, |mut draws: Draws| {
        let names: Vec<String> = e.state.iter().map(|s| s.name.clone()).collect();
        let y: BTreeMap<String, Rational> = names.into_iter().zip(draws.generic_vector(5)).collect();
        let Some(mut at) = Evaluation::new(&e, |name| y.get(name).cloned()) else { return Ok(()) };
        let mut rate = |name: &str| {
            let own = e.state.iter().find(|s| s.name == name).expect("a component of the state");
            at.value(own.derivative).expect("finite")
        };
        let along = (int(1) + &y["y"] * &y["y"]) * rate("x_dot") - int(2) * rate("y_dot");
        assert_eq!(along, y["acceleration_law"]);
        Ok(())
    });
}

/// The servo ball with the derivative of its law.
fn ball_of_third_order() -> String {
    let own = "constraint servo: ddt(a1_dot) + ddt(xi3) + kappa*a1 + c*a1_dot = 0;";
    let derivative = "constraint servo: ddt(ddt(a1_dot)) + ddt(ddt(xi3)) + kappa*a1_dot + c*ddt(a1_dot) = 0;";
    let text = text("servo_ball");
    assert!(text.contains(own));
    text.replace(own, derivative)
}

#[test]
fn constraints_of_third_order_can_be_built_in_rust() {
    let text = "model m {
        velocity v in R^2;
        lagrangian = dot(v, v);
        constraint law: ddt(ddt(v1)) + v2*ddt(v2) = 0;
        virtual free: delta(v1) + ddt(v1)*delta(v2) = 0;
    }";
    let mut b = ModelBuilder::new("m");
    let v = b.velocities(LieAlgebra::abelian(2), &["v"]).remove(0);
    let energy = v.dot(b.graph(), &v).unwrap();
    let (first, second) = (v.row(1).unwrap(), v.row(2).unwrap());
    let [a1, a2] = [&first, &second].map(|v| b.ddt(v).unwrap());
    let jerk = b.ddt(&a1).unwrap();
    assert!(matches!(b.ddt(&jerk), Err(ValueError::OrderTooHigh { function: "ddt" })));
    let zero = Value::Scalar(b.graph().zero());
    let product = second.mul(b.graph(), &a2).unwrap();
    let law = jerk.add(b.graph(), &product).unwrap();
    let [d1, d2] = [&first, &second].map(|v| b.delta(v).unwrap());
    let turned = a1.mul(b.graph(), &d2).unwrap();
    let condition = d1.add(b.graph(), &turned).unwrap();
    b.lagrangian(&energy).constraint(Some("law"), "law", &law, &zero);
    b.virtual_constraint(Some("free"), "free", &condition, &zero);
    let built = b.build().unwrap_or_else(|e| panic!("{e}"));
    let system = reduce(&built, &Formulation::of(&built)).unwrap_or_else(|e| panic!("{e}"));
    let (built, read) = (derive(&system).unwrap_or_else(|e| panic!("{e}")), derived(text));
    let names = |e: &Equations| e.state.iter().map(|s| s.name.clone()).collect::<Vec<_>>();
    assert_eq!(names(&built), ["v1", "v2", "acceleration_law"]);
    assert_eq!(names(&read), names(&built));
    for_all("built in Rust", 8, 20, |mut draws: Draws| {
        let y: BTreeMap<String, Rational> = names(&read).into_iter().zip(draws.generic_vector(3)).collect();
        let rates = |e: &Equations| -> Option<Vec<Option<Rational>>> {
            let mut at = Evaluation::new(e, |name| y.get(name).cloned())?;
            Some(e.state.iter().map(|s| at.value(s.derivative)).collect())
        };
        assert_eq!(rates(&built), rates(&read));
        Ok(())
    });
}

#[test]
fn the_derivative_of_a_servo_law_has_its_motion_among_others() {
    // With the second-order law s = -(kappa a1 + c a1_dot), and s' is the derivative of that.
    let (third, second) = (derived(&ball_of_third_order()), equations("servo_ball"));
    let default = |name: &str| {
        second.system.params.iter().find(|p| p.name == name).expect("it is a parameter").default.clone()
    };
    let [kappa, c] = ["kappa", "c"].map(default);
    let names: Vec<String> = second.state.iter().map(|s| s.name.clone()).collect();
    for_all("ball", 24, 60, |mut draws: Draws| {
        let mut y: BTreeMap<String, Rational> = names.iter().cloned().zip(draws.generic_vector(7)).collect();
        let law = -(&kappa * &y["a1"] + &c * &y["a1_dot"]);
        y.insert("acceleration_servo".to_owned(), law);
        let rates = |e: &Equations| -> BTreeMap<String, Rational> {
            let mut at = Evaluation::new(e, |name| y.get(name).cloned()).expect("no pivot vanishes");
            e.state.iter().map(|s| (s.name.clone(), at.value(s.derivative).expect("finite"))).collect()
        };
        let (expected, found) = (rates(&second), rates(&third));
        for name in &names {
            assert_eq!(found[name], expected[name], "rate of {name} at {y:?}");
        }
        let along = -(&kappa * &y["a1_dot"] + &c * &expected["a1_dot"]);
        assert_eq!(found["acceleration_servo"], along);
        Ok(())
    });
}

#[test]
fn the_multiplier_as_a_variable_gives_the_same_trajectory() {
    // By hand, with the multiplier in the state: m a'' = lambda f1, I xi' = lambda f2; the law of third order, in which
    // a1''' = lambda'/m and xi3'' = (lambda' (1 + a1^2) + 2 lambda a1 a1')/I, gives lambda'.
    let by_hand = "model ball {
        param m = 1.2; param I = 0.4; param kappa = 1.5; param c = 0.2;
        coordinate a: vector(2) in real;
        coordinate power in real;
        velocity xi in so(3);
        let lambda = power_dot;
        acceleration a_dot = lambda/m*[1, xi3];
        acceleration xi = lambda/I*[a2_dot, 0, 1 + a1^2];
        acceleration power_dot = -(2*lambda*a1*a1_dot/I + kappa*a1_dot + c*lambda/m)/(1/m + (1 + a1^2)/I);
    }";
    let (own, other) = (build(&ball_of_third_order(), scene::DEFAULT), build(by_hand, scene::DEFAULT));
    let lambda = 0.35;
    let (m, inertia, a1) = (1.2, 0.4, 0.5);
    let start = [
        ("a1", a1),
        ("a2", -0.2),
        ("a1_dot", 0.3),
        ("a2_dot", 0.4),
        ("xi1", 0.2),
        ("xi2", -0.5),
        ("xi3", 0.8),
    ];
    let carried = [("acceleration_servo", lambda * (1.0 / m + (1.0 + a1 * a1) / inertia))];
    let held = [("power", 0.0), ("power_dot", lambda)];
    let on_the_way = times(4.0, 8);
    let mut expected: Vec<Vec<f64>> = Vec::new();
    let all = [start.as_slice(), &held].concat();
    follow(&other, &[], &all, &on_the_way, |at| {
        expected.push(start.iter().map(|(n, _)| at.get(n)).collect());
    });
    let mut next = expected.iter();
    let all = [start.as_slice(), &carried].concat();
    follow(&own, &[], &all, &on_the_way, |at| {
        let found: Vec<f64> = start.iter().map(|(n, _)| at.get(n)).collect();
        close("ball", &found, next.next().expect("as many states as times"), 1e-9);
    });
}

#[test]
fn a_law_with_constant_coefficients_has_its_closed_form() {
    // (d/dt + 1)(d/dt + 2)(d/dt + 3) q1 = 0 with a reaction on both masses.
    let text = "model masses {
        param m = 1.5 where m > 0; param M = 2.5 where M > 0; param k = 3; param beta = 0.7;
        coordinate q1, q2 in real;
        lagrangian = (m*q1_dot^2 + M*q2_dot^2 - k*q1^2)/2;
        constraint law: ddt(ddt(q1_dot)) + 6*ddt(q1_dot) + 11*q1_dot + 6*q1 = 0;
        virtual delta(q1_dot) + beta*delta(q2_dot) = 0;
    }";
    let scene = build(text, scene::DEFAULT);
    let weights: [(f64, f64); 3] = [(0.5, -1.0), (-0.8, -2.0), (1.1, -3.0)];
    let q =
        |order: i32, t: f64| -> f64 { weights.iter().map(|(w, r)| w * r.powi(order) * (r * t).exp()).sum() };
    // m q1'' + k q1 = lambda, M q2'' = beta lambda.
    let reaction = |order: i32, t: f64| 1.5 * q(order + 2, t) + 3.0 * q(order, t);
    let q2 = |t: f64| 0.7 / 2.5 * reaction(-2, t);
    let v2 = |t: f64| 0.7 / 2.5 * reaction(-1, t);
    let start = [
        ("q1", q(0, 0.0)),
        ("q2", q2(0.0)),
        ("q1_dot", q(1, 0.0)),
        ("q2_dot", v2(0.0)),
        ("acceleration_law", q(2, 0.0)),
    ];
    follow(&scene, &[], &start, &times(3.0, 6), |at| {
        let found = ["q1", "q2", "q1_dot", "q2_dot", "acceleration_law"].map(|n| at.get(n));
        let t = at.t;
        close("masses", &found, &[q(0, t), q2(t), q(1, t), v2(t), q(2, t)], 1e-11);
    });
}

#[test]
fn displacements_may_depend_on_accelerations_that_constraints_give() {
    // Of second order: ddt(q_dot) = -kappa q - c q_dot. Linear: ddt(v2) = cos(t). Of third order: the state has it.
    let model = |constraint: &str, of: &str| {
        format!(
            "model m {{
            param kappa = 1.5; param c = 0.2;
            coordinate q in real; velocity v in R^2;
            lagrangian = q_dot^2 + dot(v, v)/2 + q_dot*v1/2 - q^4;
            {constraint}
            virtual (2 + ({of})^2)*delta(q_dot) + delta(v1) + q*({of})*delta(v2) = 0; }}"
        )
    };
    let servo = "constraint law: ddt(q_dot) + kappa*q + c*q_dot = 0;";
    let linear = "constraint law: v2 = sin(t);";
    let nonlinear = "constraint law: v2 + q_dot^3/3 + q_dot = 1;";
    let third = "constraint law: ddt(ddt(q_dot)) + kappa*ddt(v1) + q = 0;";
    let pairs = [
        (servo, "ddt(q_dot)", servo, "-kappa*q - c*q_dot"),
        (linear, "ddt(v2)", linear, "cos(t)"),
        (nonlinear, "ddt(v2) + (1 + q_dot^2)*ddt(q_dot) + q", nonlinear, "q"),
    ];
    for (constraint, of, plain, value) in pairs {
        let [one, other] = [model(constraint, of), model(plain, value)].map(|text| derived(&text));
        assert_eq!(same_motion(&one, &other), Ok(()), "{of} with {constraint}");
        assert_eq!(one.state.len(), other.state.len());
    }
    // The reaction is along the form with the acceleration that there is: E = lambda (2 + a^2, 1, q a).
    let scene = build(&model(third, "ddt(q_dot)"), scene::DEFAULT);
    for (t, y) in states(scene.state_names().len()) {
        let at = jet(&scene, t, &y);
        let (q, a) = (at.get(0, "q"), at.get(1, "q_dot"));
        let [v1, v2] = ["v1", "v2"].map(|n| at.get(1, n));
        assert!((a - at.get(0, "acceleration_law")).abs() < 1e-12);
        let residual = [2.0 * a + v1 / 2.0 + 4.0 * q * q * q, v1 + a / 2.0, v2];
        let lambda = residual[1];
        close("reaction", &residual, &[lambda * (2.0 + a * a), lambda, lambda * q * a], 1e-11);
    }
}

#[test]
fn every_formulation_is_one_motion() {
    let text = "model bundle {
        coordinate s in angle; coordinate z in real;
        velocity omega, v in se(2);
        lagrangian = s_dot^2 + z_dot^2/2 + omega^2 + dot(v, v) + s_dot*(omega*sin(s) + v1)/2 + z*omega;
        constraint law: ddt(ddt(omega)) + (2 + cos(s))*ddt(ddt(v1)) + v2*ddt(s_dot) + ddt(v2)^2 = z;
        virtual delta(omega) + cos(s)*delta(v1)/3 + ddt(z_dot)*delta(s_dot)/5 = 0;
        constraint held: ddt(z_dot) + z + v2 = 0;
        virtual delta(z_dot) = s_dot*delta(v2)/7;
        momentum p of z_dot;
        stage turn;
        stage shift = ideal(v);
        inner_product = diag([1, 2, 3]);
    }";
    let model = spec::parse("bundle.hamel", text).unwrap_or_else(|e| panic!("{e}"));
    let own = Formulation { stages: StageUse::Unused, ..Formulation::of(&model) };
    let equations = |formulation: &Formulation| {
        let system = reduce(&model, formulation).unwrap_or_else(|e| panic!("{e}"));
        derive(&system).unwrap_or_else(|e| panic!("{e}"))
    };
    let default = equations(&own);
    let others = [
        Formulation { connection: Some(ConnectionKind::Mechanical), ..own.clone() },
        Formulation { stages: StageUse::Carried(Vec::new()), ..own.clone() },
        Formulation { circles: vec!["s".to_owned()], ..own.clone() },
        Formulation {
            connection: Some(ConnectionKind::Mechanical),
            stages: StageUse::Carried(Vec::new()),
            circles: vec!["s".to_owned()],
            ..own.clone()
        },
    ];
    for other in &others {
        assert_eq!(same_motion(&default, &equations(other)), Ok(()), "{other:?}");
    }
}

#[test]
fn momenta_and_implicit_equations_carry_the_acceleration_too() {
    let text = "model m {
        coordinate x, y in real;
        momentum p of x_dot;
        lagrangian = (1 + y^2)*x_dot^2/2 + y_dot^2 - x*y;
        constraint law: ddt(ddt(x_dot)) + y*ddt(ddt(y_dot)) + x_dot*ddt(y_dot) + y = 0;
        scene carried { carry p; want rhs; }
        scene dae { want rhs, implicit; }
    }";
    let plain = build(text, "dae");
    let start = [("x", 0.3), ("y", -0.4), ("x_dot", 0.2), ("y_dot", 0.5), ("acceleration_law", -0.6)];
    let on_momenta: Vec<(&str, f64)> =
        start.iter().map(|(n, v)| if *n == "x_dot" { ("p", (1.0 + 0.16) * v) } else { (*n, *v) }).collect();
    let names = ["x", "y", "y_dot", "acceleration_law"];
    let mut expected: Vec<Vec<f64>> = Vec::new();
    let prepared = plain.prepare(&[]).expect("there are no parameters");
    follow(&plain, &[], &start, &times(1.0, 4), |at| {
        expected.push(names.iter().map(|n| at.get(n)).collect());
        // Every algebraic equation holds, and differential ones give the rates of the state.
        let y: Vec<f64> = plain.state_names().iter().map(|n| at.get(n)).collect();
        let mut dy = vec![0.0; y.len()];
        prepared.rhs(at.t, &y, &mut dy);
        let implicit = plain.implicit().expect("it is wanted");
        let z = at.outputs();
        let right = prepared.implicit(at.t, &z).expect("it is wanted");
        for (variable, f) in implicit.variables.iter().zip(right) {
            let rate = plain.state_names().iter().position(|n| *n == variable.name).map(|k| dy[k]);
            let wanted = rate.filter(|_| variable.is_differential).unwrap_or(0.0);
            assert!((f - wanted).abs() < 1e-9, "{}: {f} and {wanted}", variable.name);
        }
    });
    let mut next = expected.iter();
    follow(&build(text, "carried"), &[], &on_momenta, &times(1.0, 4), |at| {
        let found: Vec<f64> = names.iter().map(|n| at.get(n)).collect();
        close("momenta", &found, next.next().expect("as many states as times"), 1e-9);
    });
}

#[test]
fn a_hamiltonian_has_constraints_of_third_order_on_its_velocities() {
    let lagrangian = "model m {
        param I: diagonal(3) = [1.3, 1.7, 0.6] where I1 > 0, I2 > 0, I3 > 0;
        velocity w in so(3);
        lagrangian = dot(w, I*w)/2;
        constraint law: ddt(ddt(w3)) + w1*ddt(ddt(w2)) + 2*w3 = 0;
    }";
    let hamiltonian = "model m {
        param I: diagonal(3) = [1.3, 1.7, 0.6] where I1 > 0, I2 > 0, I3 > 0;
        momentum p in so(3);
        hamiltonian = p1^2/(2*I1) + p2^2/(2*I2) + p3^2/(2*I3);
        constraint law: ddt(ddt(dh_dp3)) + dh_dp1*ddt(ddt(dh_dp2)) + 2*dh_dp3 = 0;
    }";
    let (one, other) = (build(lagrangian, scene::DEFAULT), build(hamiltonian, scene::DEFAULT));
    let w = [0.3, -0.7, 0.5];
    let own = [("w1", w[0]), ("w2", w[1]), ("w3", w[2]), ("acceleration_law", 0.2)];
    let on_dual = [("p1", 1.3 * w[0]), ("p2", 1.7 * w[1]), ("p3", 0.6 * w[2]), ("acceleration_law", 0.2)];
    let mut expected: Vec<Vec<f64>> = Vec::new();
    follow(&one, &[], &own, &times(2.0, 4), |at| {
        let w = at.vector("w");
        expected.push(vec![1.3 * w[0], 1.7 * w[1], 0.6 * w[2], at.get("acceleration_law")]);
    });
    let mut next = expected.iter();
    follow(&other, &[], &on_dual, &times(2.0, 4), |at| {
        let found = ["p1", "p2", "p3", "acceleration_law"].map(|n| at.get(n));
        close("dual", &found, next.next().expect("as many states as times"), 1e-9);
    });
}

#[test]
fn displacements_are_the_horizontal_space_of_a_connection_with_curvature() {
    // A = delta_v2 + tau delta_omega + mu delta_v1; [e_omega - tau e_v2, e_v1 - mu e_v2] = e_v2 + mu e_v1.
    let e = equations("skew_sleigh");
    let forms = DisplacementForms::new(&e, 0).expect("it has conditions on displacements");
    let mut g = forms.graph.clone();
    assert_eq!(forms.complement, [2]);
    let [tau, mu] = ["tau", "mu"].map(|name| {
        let own = e.system.params.iter().find(|p| p.name == name).expect("a parameter");
        g.sym(own.symbol)
    });
    let delta: Vec<ExprId> = forms.displacement.iter().map(|s| g.sym(*s)).collect();
    let products = [g.mul(tau, delta[0]), g.mul(mu, delta[1]), delta[2]];
    let expected = g.sum(&products);
    assert!(g.is_equal(forms.connection[0], expected), "{}", g.display(forms.connection[0], Style::Plain));
    let curvature = forms.curvature.as_ref().expect("the displacements depend on no velocity");
    let [(a, b, c, value)] = curvature.as_slice() else { panic!("{curvature:?}") };
    assert_eq!((*a, *b, *c), (0, 1, 2));
    let (one, square) = (g.one(), g.mul(mu, mu));
    let sum = g.add(one, square);
    let expected = g.neg(sum);
    assert!(g.is_equal(*value, expected), "{}", g.display(*value, Style::Plain));
    let both = forms.equations.expect("the motion satisfies both forms");
    assert_eq!((both.with_multipliers.len(), both.projected.len()), (3, 2));
    let names = ["E_omega", "E_v1", "E_v2"];
    for ((left, _), name) in both.with_multipliers.iter().zip(names) {
        assert_eq!(g.display(*left, Style::Plain), name);
    }
    // E_omega - tau E_v2 and E_v1 - mu E_v2.
    let along = both.with_multipliers.iter().map(|(left, _)| *left).collect::<Vec<_>>();
    for (k, weight) in [(0, tau), (1, mu)] {
        let product = g.mul(weight, along[2]);
        let expected = g.sub(along[k], product);
        assert_eq!(g.display(both.projected[k], Style::Plain), g.display(expected, Style::Plain));
    }
}

#[test]
fn displacements_that_depend_on_velocities_have_no_curvature() {
    let e = equations("servo_ball");
    let forms = DisplacementForms::new(&e, 2).expect("it has conditions on displacements");
    // 1 + a1^2 along xi3 vanishes nowhere, and lies along the algebra.
    assert_eq!(forms.complement, [4]);
    assert!(forms.curvature.is_none());
    assert_eq!(forms.equations.expect("the motion satisfies both forms").projected.len(), 4);
}

#[test]
fn the_equations_of_a_right_action_have_the_sign_of_the_coadjoint_term_that_holds() {
    // -d/dt dl/dxi - dl/dxi x xi for a ball that is not homogeneous (B17 and B18 of the errata), of second and of third
    // order.
    let ball = |order: &str| {
        format!(
            "model ball {{
            param K: diagonal(3) = [0.4, 0.7, 1.1] where K1 > 0, K2 > 0, K3 > 0;
            coordinate a: vector(2) in real;
            velocity xi in so(3);
            action right;
            lagrangian = dot(a_dot, a_dot)/2 + dot(xi, K*xi)/2;
            constraint servo: {order};
            virtual dot([1, xi3], delta(a_dot)) + dot([a2_dot, 0, 1 + a1^2], delta(xi)) = 0; }}"
        )
    };
    for order in ["ddt(a1_dot) + ddt(xi3) + a1 = 0", "ddt(ddt(a1_dot)) + xi2*ddt(ddt(xi3)) + ddt(a2_dot) = 0"]
    {
        let e = derived(&ball(order));
        let forms = DisplacementForms::new(&e, 2).expect("it has conditions on displacements");
        let mut g = forms.graph.clone();
        let both = forms.equations.expect("the motion satisfies both forms");
        let p = [1, 2, 3].map(|k| format!("p_xi{k}"));
        for (k, residual) in both.residuals[2..].iter().enumerate() {
            let [next, last] = [(k + 1) % 3, (k + 2) % 3];
            let text = g.display(residual.expr, Style::Plain);
            let expected = [
                format!("dot_{} + {}*xi{} - xi{}*{}", p[k], p[next], last + 1, next + 1, p[last]),
                format!("dot_{} + xi{}*{} - xi{}*{}", p[k], last + 1, p[next], next + 1, p[last]),
                format!("dot_{} - xi{}*{} + xi{}*{}", p[k], next + 1, p[last], last + 1, p[next]),
            ];
            assert!(expected.contains(&text), "{text}, expected {expected:?}");
        }
        assert_eq!(both.projected.len(), 4);
        // With the printed sign, twice the term p2 xi3 - p3 xi2 less, they do not hold.
        let velocity = |g: &mut Graph, name: &str| {
            let own = e.system.velocities.iter().find(|s| g.name(**s) == name);
            g.sym(*own.expect("a velocity"))
        };
        let momentum = |g: &mut Graph, name: &str| {
            let own = both.residuals.iter().flat_map(|d| g.free_symbols(d.expr)).find(|s| g.name(*s) == name);
            g.sym(own.expect("a momentum"))
        };
        let [p2, p3] = ["p_xi2", "p_xi3"].map(|name| momentum(&mut g, name));
        let [xi2, xi3] = ["xi2", "xi3"].map(|name| velocity(&mut g, name));
        let [one, other] = [g.mul(p2, xi3), g.mul(p3, xi2)];
        let term = g.sub(one, other);
        let twice = g.scale(term, &int(2));
        let (left, right) = both.with_multipliers[2];
        let wrong = g.sub(left, twice);
        assert!(!g.is_equal(wrong, right), "the printed sign leaves a residual");
    }
}
