//! Reactions that are not along the constraint, servo constraints and affine actions, exactly.

use hamel_codegen::spec;
use hamel_expr::{ExprId, Graph, Rational, SymbolId};
use hamel_mechanics::mechanics::Equations;
use hamel_mechanics::reduction::{Formulation, reduce};
use hamel_tests::draws::{Draws, for_all};
use hamel_tests::linear::int;
use hamel_tests::models::{self, equations};
use hamel_tests::problem::{Evaluation, equations_of};
use std::collections::BTreeMap;

/// The expression of a parameter or state variable.
fn symbol(e: &mut Equations, name: &str) -> ExprId {
    let param = e.system.params.iter().find(|p| p.name == name).map(|p| p.symbol);
    let state = e.state.iter().find(|s| s.name == name).map(|s| s.symbol);
    let found = param.or(state).unwrap_or_else(|| panic!("no parameter or state variable {name}"));
    e.system.graph.sym(found)
}

fn output(e: &Equations, group: &str, component: usize) -> ExprId {
    e.outputs.iter().find(|o| o.name == group).unwrap_or_else(|| panic!("no {group}")).components[component].1
}

#[test]
fn the_reaction_of_the_skew_sleigh_works_at_the_rate_of_its_components_along_the_motion() {
    let mut e = equations("skew_sleigh");
    let [tau, mu, omega, v1] = ["tau", "mu", "omega", "v1"].map(|n| symbol(&mut e, n));
    let lambda = output(&e, "multipliers", 0);
    let rate = e.energy_rate;
    let g = &mut e.system.graph;
    // The reaction is lambda (tau, mu, 1) and the velocity (omega, v1, 0).
    let (turning, forward) = (g.mul(tau, omega), g.mul(mu, v1));
    let along = g.add(turning, forward);
    let power = g.mul(lambda, along);
    assert!(g.is_equal(rate, power));
    assert!(!g.is_zero(rate));
    let opposite = g.neg(power);
    assert!(!g.is_equal(rate, opposite));
    let partial = g.mul(lambda, turning);
    assert!(!g.is_equal(rate, partial));
}

#[test]
fn without_its_skew_part_the_skew_sleigh_is_the_chaplygin_sleigh() {
    let (skew, plain) = (equations("skew_sleigh"), equations("chaplygin_sleigh"));
    for_all("sleigh", 8, 20, |mut draws| {
        let state: BTreeMap<&str, Rational> = [("omega", draws.non_zero()), ("v1", draws.non_zero())].into();
        let mut at = Evaluation::new(&plain, |name| state.get(name).cloned()).expect("no pivot vanishes");
        let expected: Vec<_> = plain.state.iter().map(|s| at.value(s.derivative)).collect();
        let mut straight = skew.clone();
        for p in straight.system.params.iter_mut().filter(|p| p.name == "tau" || p.name == "mu") {
            p.default = int(0);
        }
        let mut at = Evaluation::new(&straight, |name| state.get(name).cloned()).expect("no pivot vanishes");
        let found: Vec<_> = straight.state.iter().map(|s| at.value(s.derivative)).collect();
        assert_eq!(found, expected);
        let mut at = Evaluation::new(&skew, |name| state.get(name).cloned()).expect("no pivot vanishes");
        let skewed: Vec<_> = skew.state.iter().map(|s| at.value(s.derivative)).collect();
        assert_ne!(skewed, expected, "the skew part matters");
        Ok(())
    });
}

#[test]
fn the_servo_ball_keeps_its_servo_law_and_is_pushed_along_the_prescribed_direction() {
    let e = equations("servo_ball");
    let default = |name: &str| {
        e.system.params.iter().find(|p| p.name == name).expect("it is a parameter").default.clone()
    };
    let [m, inertia, kappa, c] = ["m", "I", "kappa", "c"].map(default);
    let names: Vec<String> = e.state.iter().map(|s| s.name.clone()).collect();
    assert_eq!(names, ["a1", "a2", "a1_dot", "a2_dot", "xi1", "xi2", "xi3"]);
    for_all("servo ball", 24, 60, |mut draws: Draws| {
        let y: BTreeMap<String, Rational> = names.iter().cloned().zip(draws.generic_vector(7)).collect();
        let mut at = Evaluation::new(&e, |name| y.get(name).cloned()).expect("no pivot vanishes");
        let rate: BTreeMap<&str, Rational> =
            e.state.iter().map(|s| (s.name.as_str(), at.value(s.derivative).expect("finite"))).collect();
        let lambda = at.value(output(&e, "multipliers", 0)).expect("finite");
        let servo = &rate["a1_dot"] + &rate["xi3"] + &kappa * &y["a1"] + &c * &y["a1_dot"];
        assert_eq!(servo, int(0), "the servo law holds at {y:?}");
        // A homogeneous ball turns freely: E = (m addot, I xidot) = lambda (f1, f2).
        let force = [
            &m * &rate["a1_dot"],
            &m * &rate["a2_dot"],
            &inertia * &rate["xi1"],
            &inertia * &rate["xi2"],
            &inertia * &rate["xi3"],
        ];
        let direction = [int(1), y["xi3"].clone(), y["a2_dot"].clone(), int(0), int(1) + &y["a1"] * &y["a1"]];
        for (f, d) in force.iter().zip(&direction) {
            assert_eq!(*f, &lambda * d, "the reaction is along (f1, f2) at {y:?}");
        }
        // Its power is the energy rate.
        let velocity = ["a1_dot", "a2_dot", "xi1", "xi2", "xi3"].map(|n| y[n].clone());
        let power: Rational = direction.iter().zip(&velocity).map(|(d, v)| d * v).sum();
        assert_eq!(at.value(e.energy_rate).expect("finite"), &lambda * power);
        for (k, n) in ["a1", "a2"].into_iter().enumerate() {
            assert_eq!(rate[n], velocity[k], "kinematics");
        }
        Ok(())
    });
}

#[test]
fn appells_machine_has_the_accelerations_of_its_closed_form() {
    // On the constraint the speed s obeys s' = -g k/(1 + k^2), exactly: a Pythagorean direction keeps everything
    // rational.
    let e = equations("appell_machine");
    let default = |name: &str| {
        e.system.params.iter().find(|p| p.name == name).expect("it is a parameter").default.clone()
    };
    let (g, k) = (default("g"), default("k"));
    for_all("winch", 12, 20, |mut draws| {
        let speed = draws.non_zero();
        let direction = [Rational::new(3.into(), 5.into()), Rational::new((-4).into(), 5.into())];
        // The root of x_dot^2 + y_dot^2 is |speed|; z_dot = k speed is on the constraint for either sign.
        let state: BTreeMap<&str, Rational> = [
            ("x", draws.rational()),
            ("y", draws.rational()),
            ("z", draws.rational()),
            ("x_dot", &direction[0] * &speed),
            ("y_dot", &direction[1] * &speed),
            ("z_dot", &k * &speed),
        ]
        .into();
        let mut at = Evaluation::new(&e, |name| state.get(name).cloned()).expect("no pivot vanishes");
        let rate = -(&g * &k) / (int(1) + &k * &k);
        for s in &e.state {
            let expected = match s.name.as_str() {
                "x_dot" => &direction[0] * &rate,
                "y_dot" => &direction[1] * &rate,
                "z_dot" => &k * &rate,
                base => state[format!("{base}_dot").as_str()].clone(),
            };
            assert_eq!(at.value(s.derivative), Some(expected), "rate of {}", s.name);
        }
        assert_eq!(at.value(output(&e, "constraint", 0)), Some(int(0)));
        assert_eq!(at.value(e.energy_rate), Some(int(0)), "energy is conserved on the constraint");
        Ok(())
    });
}

fn anchor(g: &Graph, e: &Equations, component: usize, velocity: usize) -> String {
    g.display(e.system.algebroid.anchor(component, velocity), hamel_expr::Style::Plain)
}

#[test]
fn the_cocycle_of_an_affine_action_enters_the_anchor() {
    let e = equations("tethered_body");
    let g = &e.system.graph;
    let base: Vec<&str> = e.system.algebroid.base().iter().map(|s: &SymbolId| g.name(*s)).collect();
    assert_eq!(base, ["a1", "a2", "a3"]);
    // adot = -Omega x a - V.
    for i in 0..3 {
        for k in 0..3 {
            let expected = if i == k { "-1" } else { "0" };
            assert_eq!(anchor(g, &e, i, 3 + k), expected, "V{} moves a{}", k + 1, i + 1);
        }
    }
    assert_eq!([anchor(g, &e, 0, 1), anchor(g, &e, 0, 2)], ["-a3", "a2"]);
}

#[test]
fn affine_actions_are_verified_as_actions() {
    let with_action = |action: &str| {
        let text = models::text("tethered_body");
        assert!(text.contains("by cross(Omega, a) + V;"), "the model has the action");
        let text = text.replace("by cross(Omega, a) + V;", &format!("by {action};"));
        let model = spec::parse("tethered_body", &text).unwrap_or_else(|e| panic!("{e}"));
        reduce(&model, &Formulation::of(&model)).map(|_| ()).map_err(|e| e.to_string())
    };
    for good in [
        "cross(Omega, a) + V",
        "cross(Omega, a) - 2*V",
        "cross(Omega, a)",
        // The coboundary of a fixed vector: the action about another point.
        "cross(Omega, a + [1, 2, 3]) + V",
    ] {
        assert_eq!(with_action(good), Ok(()), "{good}");
    }
    for wrong in [
        "cross(Omega, a) + [V1, V2, 2*V3]",
        "cross(Omega, a) + Omega + V",
        "cross(a, Omega) + V",
        "cross(Omega, a) + [V2, V1, V3]",
    ] {
        let message = with_action(wrong).unwrap_err();
        assert!(message.contains("is not the commutator of their actions"), "{wrong}: {message}");
    }
    // A number that the group translates: a linear form that vanishes on the commutators.
    let line = |velocity: &str, action: &str| {
        let text = format!(
            "model m {{ velocity {velocity}; advected b in R by {action}; lagrangian = q^2 + p^2 + z^2 - b; }}"
        );
        equations_of(&text).map(|_| ())
    };
    assert_eq!(line("q, p, z in product(R^1, R^1, R^1)", "q + 2*p + 3*z"), Ok(()));
    assert_eq!(line("q, p, z in heisenberg(1)", "q + 2*p"), Ok(()));
    let message = line("q, p, z in heisenberg(1)", "z").unwrap_err();
    assert!(message.contains("is not the commutator of their actions"), "{message}");
}
