//! The nonholonomic momentum equation against the motion, symbolically.

use std::collections::BTreeMap;

use hamel_expr::{ExprId, SymbolId};
use hamel_mechanics::mechanics::Equations;
use hamel_tests::models::equations;

/// An expression with every definition replaced by its value: a function of parameters, time and state.
fn inlined(e: &mut Equations, roots: &[ExprId]) -> Vec<ExprId> {
    let mut values: BTreeMap<SymbolId, ExprId> = BTreeMap::new();
    let g = &mut e.system.graph;
    for definition in e.sections.iter().flat_map(|s| &s.definitions) {
        let value = g.subs(definition.expr, &values).expect("no definition divides by zero");
        values.insert(definition.symbol, value);
    }
    g.subs_all(roots, &values).expect("no result divides by zero")
}

fn group(e: &Equations, name: &str) -> Vec<ExprId> {
    let output = e.outputs.iter().find(|o| o.name == name);
    output.map(|o| o.components.iter().map(|(_, e)| *e).collect()).unwrap_or_default()
}

/// `dJ/dt = sum_k dJ/dy_k ydot_k` along the motion equals what the momentum equation says; returns how many were not
/// identically zero.
fn check(name: &str) -> usize {
    let mut e = equations(name);
    let (momenta, rates) = (group(&e, "nonholonomic_momentum"), group(&e, "momentum_equation"));
    assert!(!momenta.is_empty() && momenta.len() == rates.len(), "{name} has a momentum equation");
    let (momenta, rates) = (inlined(&mut e, &momenta), inlined(&mut e, &rates));
    let derivatives: Vec<ExprId> = e.state.iter().map(|s| s.derivative).collect();
    let derivatives = inlined(&mut e, &derivatives);
    let symbols: Vec<SymbolId> = e.state.iter().map(|s| s.symbol).collect();
    let g = &mut e.system.graph;
    let mut alive = 0;
    for (momentum, rate) in momenta.into_iter().zip(rates) {
        let mut terms = Vec::new();
        for (symbol, derivative) in symbols.iter().zip(&derivatives) {
            let slope = g.diff(momentum, *symbol);
            terms.push(g.mul(slope, *derivative));
        }
        let along_the_motion = g.sum(&terms);
        assert!(g.is_equal(along_the_motion, rate), "{name}");
        alive += usize::from(!g.is_zero(rate));
    }
    alive
}

#[test]
fn the_momentum_equation_of_the_snakeboard_is_the_rate_of_its_momentum() {
    assert!(check("snakeboard") >= 1, "the momentum along s changes");
    let mut e = equations("snakeboard");
    let along_s = group(&e, "nonholonomic_momentum").pop().expect("s is the last unknown");
    let printed = group(&e, "p")[0];
    let both = inlined(&mut e, &[along_s, printed]);
    assert!(e.system.graph.is_equal(both[0], both[1]), "<p, (-r cos phi, 0, sin phi)>");
}

#[test]
fn the_momentum_equation_holds_for_every_kind_of_linear_constraint() {
    for name in
        ["suslov", "chaplygin_sleigh", "chaplygin_ball", "euler_disk", "mobile_robot", "chaplygin_gyro"]
    {
        assert!(check(name) >= 1, "{name}: some momentum changes");
    }
    for name in ["rolling_disk", "rolling_ball"] {
        assert_eq!(check(name), 0, "{name}: every momentum is conserved");
    }
}

#[test]
fn the_momentum_equation_holds_with_displacements_of_their_own_and_affine_constraints() {
    assert!(check("skew_sleigh") >= 1, "a force along the displacements changes momenta");
    // Cortes, de Leon, Marrero, Martinez 2009, section 7.4: pi_i' = 0.
    assert_eq!(check("ball_on_rotating_table"), 0);
}
