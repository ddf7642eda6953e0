//! Momenta along sections that a model names, conserved ones that are found, and moving energies.

use std::collections::BTreeMap;

use hamel_codegen::scene::{self, BuiltScene};
use hamel_codegen::spec;
use hamel_expr::{ExprId, Style, SymbolId, Vanishing};
use hamel_mechanics::mechanics::{ConservedMomenta, Equations};
use hamel_tests::models::{follow, text_with, times};
use hamel_tests::problem::equations_of;

fn derived(text: &str) -> Equations {
    equations_of(text).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

fn built(text: &str, name: &str) -> BuiltScene {
    let model = spec::parse("test.hamel", text).unwrap_or_else(|e| panic!("{e}"));
    scene::build(&model, name).unwrap_or_else(|e| panic!("{e}"))
}

/// Expressions with every definition replaced by its value.
fn inlined(e: &mut Equations, roots: &[ExprId]) -> Vec<ExprId> {
    let mut values: BTreeMap<SymbolId, ExprId> = BTreeMap::new();
    let g = &mut e.system.graph;
    for definition in e.sections.iter().flat_map(|s| &s.definitions) {
        let value = g.subs(definition.expr, &values).expect("no definition divides by zero");
        values.insert(definition.symbol, value);
    }
    g.subs_all(roots, &values).expect("no result divides by zero")
}

/// The momenta along the sections, in the state alone.
fn momenta(e: &mut Equations) -> Vec<ExprId> {
    let output = e.outputs.iter().find(|o| o.name == "sections").expect("sections");
    let values: Vec<ExprId> = output.components.iter().map(|(_, e)| *e).collect();
    inlined(e, &values)
}

/// `f' = df/dt + sum_k df/dy_k y_k'` along the motion.
fn along_the_motion(e: &mut Equations, f: ExprId) -> ExprId {
    let rates: Vec<ExprId> = e.state.iter().map(|s| s.derivative).collect();
    let rates = inlined(e, &rates);
    let time = e.system.time;
    let symbols: Vec<SymbolId> = e.state.iter().map(|s| s.symbol).collect();
    let g = &mut e.system.graph;
    let mut terms = vec![g.diff(f, time)];
    for (symbol, rate) in symbols.iter().zip(rates) {
        let slope = g.diff(f, *symbol);
        terms.push(g.mul(slope, rate));
    }
    g.sum(&terms)
}

fn verdicts(e: &Equations) -> Vec<(&str, Vanishing)> {
    e.along_sections.iter().map(|s| (s.name.as_str(), s.verdict)).collect()
}

/// A mass matrix, a group, a potential, an affine constraint that drifts, and sections of every kind.
const MIXED: &str = "coordinate x in real;
    velocity omega, v in se(2);
    lagrangian = (2 + x^2)*x_dot^2/2 + 3*omega^2/2 + 2*v1^2 + v2^2 + x*omega*v2 + x_dot*v1/2 - x^3 + x_dot*t;
    section one = [1, 0, 0, 0];
    section mixed = [x, t, x^2, 1];
    section group in se(2) = [1, x, 0];";

/// The rate that is said of each section is that of its momentum; returns how many rates are not zero.
fn check_rates(items: &str) -> usize {
    let mut e = derived(&format!("model mixed {{ {items} }}"));
    let values = momenta(&mut e);
    assert_eq!(values.len(), e.along_sections.len());
    let rates: Vec<ExprId> = e.along_sections.iter().map(|s| s.rate).collect();
    let rates = inlined(&mut e, &rates);
    let mut alive = 0;
    for (value, rate) in values.into_iter().zip(rates) {
        let found = along_the_motion(&mut e, value);
        let g = &mut e.system.graph;
        assert!(g.is_equal(found, rate), "{items}\n{}", g.display(rate, Style::Plain));
        alive += usize::from(!g.is_zero(rate));
    }
    alive
}

#[test]
fn the_rate_of_a_momentum_along_a_section_is_its_rate_along_the_motion() {
    for side in ["left", "right"] {
        for beside in [
            "",
            "constraint v2 = x*omega + t;",
            "constraint x_dot = v1;",
            "constraint v1 = x*v2 + t; multipliers;",
            "connection mechanical;",
            "connection omega = x*x_dot; force x_dot = -x_dot; force omega = x;",
            "momentum p of x_dot; carry p;",
            "frame { a = x_dot + omega; b = omega; c = v1 + x*v2; d = v2; }",
            "stage whole; stage plane = ideal(v1, v2); inner_product = diag([1, 2, 3]); carry stages;",
        ] {
            // Coefficients in an algebra are those of its own velocities.
            let items = match beside.starts_with("frame") {
                true => MIXED.replace("section group in se(2) = [1, x, 0];", ""),
                false => MIXED.to_owned(),
            };
            let alive = check_rates(&format!("{items} action {side}; {beside}"));
            assert!(alive >= 2, "{side}, {beside}: {alive} rates");
        }
    }
}

#[test]
fn the_momentum_along_a_section_does_not_depend_on_the_connection() {
    let items = "coordinate x in real; velocity w in R;
        lagrangian = x_dot^2/2 + (2 + x^2)*w^2/2 + x*w*x_dot/2 + x_dot;
        section s = [x, 1 + x^2]; scene seen { want rhs, sections; }";
    let [plain, derived] = ["", "connection mechanical;"]
        .map(|connection| built(&format!("model m {{ {items} {connection} }}"), "seen"));
    let (x, x_dot, w) = (0.7_f64, -0.4, 1.3);
    // v = w + A(x) xdot with the mechanical connection A = L_wx/L_ww.
    let v = w + x / 2.0 / (2.0 + x * x) * x_dot;
    let value = |scene: &BuiltScene, velocity: f64| {
        let interpreter = scene.prepare(&[]).expect("valid parameters");
        interpreter.outputs(0.0, &[x, x_dot, velocity])[0]
    };
    let expected = x * (x_dot + x * w / 2.0 + 1.0) + (1.0 + x * x) * ((2.0 + x * x) * w + x * x_dot / 2.0);
    for found in [value(&plain, w), value(&derived, v)] {
        assert!((found - expected).abs() < 1e-14, "{found}, {expected}");
    }
}

#[test]
fn symmetry_and_displacement_make_a_momentum_conserved() {
    let top = "param I: diagonal(3) = [1, 2, 3] where I1 > 0, I2 > 0, I3 > 0; velocity Omega in so(3);
        advected Gamma in R^3 by cross(Omega, Gamma); lagrangian = dot(Omega, I*Omega)/2 - Gamma3;
        section vertical in so(3) = Gamma; section own = [0, 0, 1];";
    let e = derived(&format!("model top {{ {top} }}"));
    assert_eq!(verdicts(&e), [("vertical", Vanishing::Zero), ("own", Vanishing::NonZero)]);
    // Without constraints every section is one of displacements; with one about the vertical it is not.
    assert!(e.along_sections.iter().all(|s| s.is_displacement == Some(true)));
    let e = derived(&format!("model top {{ {top} constraint dot(Omega, Gamma) = 0; multipliers; }}"));
    assert_eq!(verdicts(&e)[0], ("vertical", Vanishing::NonZero));
    assert_eq!(e.along_sections[0].is_displacement, Some(false));
    let board = text_with(
        "snakeboard",
        "section along = [0, 0, sin(phi), -r*cos(phi), 0]; section rotor = [1, 0, 0, 0, 0];
         section wheels = [0, 1, 0, 0, 0]; section turning in se(2) = [1, 0, 0];",
    );
    let e = derived(&board);
    use Vanishing::{NonZero, Zero};
    assert_eq!(verdicts(&e), [("along", NonZero), ("rotor", Zero), ("wheels", Zero), ("turning", NonZero)]);
    let displacements: Vec<_> = e.along_sections.iter().map(|s| s.is_displacement).collect();
    assert_eq!(displacements, [Some(true), Some(true), Some(true), Some(false)]);
}

#[test]
fn a_momentum_may_be_conserved_only_where_the_constraint_holds() {
    let sleigh = "velocity omega, v in se(2); lagrangian = omega^2 + v1^2/2 + v2^2;
        constraint v2 = 0; multipliers; section turning = [1, 0, 0]; section ahead = [0, 1, 0];";
    let e = derived(&format!("model sleigh {{ {sleigh} }}"));
    assert_eq!(verdicts(&e)[0], ("turning", Vanishing::NonZero));
    let [turning, ahead] = [0, 1].map(|k| e.vanishes_on_constraint(e.along_sections[k].rate));
    assert!(turning && ahead);
    let found = ConservedMomenta::new(&e).expect("within the budget");
    assert!(found.is_on_constraint && found.momenta.len() == 2, "{:?}", found.momenta);
    let pushed = derived(&format!("model sleigh {{ {sleigh} force omega = 1; }}"));
    assert!(!pushed.vanishes_on_constraint(pushed.along_sections[0].rate));
    // So may what a model claims.
    let claimed = derived(&format!("model sleigh {{ {sleigh} casimir C = omega; casimir D = 3; }}"));
    assert_eq!(claimed.facts.casimirs_on_constraint, ["C"]);
    assert_eq!(claimed.facts.casimirs, ["D"]);
    let refused = equations_of(&format!("model sleigh {{ {sleigh} force omega = 1; casimir C = omega; }}"));
    let refused = refused.map(|_| ()).unwrap_err().to_string();
    assert!(refused.contains("C is not conserved"), "{refused}");
}

/// The sections that were found, as text.
fn found(e: &Equations) -> (Vec<String>, Option<String>) {
    let found = ConservedMomenta::new(e).expect("within the budget");
    let spelled = |section: &[(String, ExprId)]| {
        let parts = section.iter().map(|(v, e)| format!("{v}: {}", found.graph.display(*e, Style::Plain)));
        parts.collect::<Vec<_>>().join(", ")
    };
    let momenta = found.momenta.iter().map(|m| spelled(&m.section)).collect();
    (momenta, found.moving_energy.as_ref().map(|m| spelled(&m.section)))
}

#[test]
fn the_ball_on_a_turning_table_has_a_moving_energy() {
    let mut e = derived(&hamel_tests::models::text("ball_on_rotating_table"));
    let (momenta, energy) = found(&e);
    assert_eq!(momenta.len(), 3, "{momenta:?}");
    assert_eq!(energy.as_deref(), Some("y_dot: Omega*x, x_dot: -Omega*y"));
    // Fasso, Sansonetto 2016: E - <p, Y> with Y the rotation about the axis of the table.
    let names = ["x", "y", "x_dot", "y_dot", "Omega"];
    let raw = e.energy;
    let whole = inlined(&mut e, &[raw])[0];
    let g = &mut e.system.graph;
    let [x, y, u, v, rate] = names.map(|name| {
        let symbol = g.free_symbols(whole).into_iter().find(|s| g.name(*s) == name).expect("a symbol");
        g.sym(symbol)
    });
    let (xv, yu) = (g.mul(x, v), g.mul(y, u));
    let turning = g.sub(xv, yu);
    let turning = g.mul(rate, turning);
    let moving = g.sub(whole, turning);
    let (still, turned) = (along_the_motion(&mut e, whole), along_the_motion(&mut e, moving));
    assert!(!e.system.graph.is_zero(still) && e.system.graph.is_zero(turned));
}

#[test]
fn scenes_have_moving_energies_and_momenta_among_their_invariants() {
    let text = text_with("ball_on_rotating_table", "scene kept { want rhs, energy, invariants; }");
    let scene = built(&text, "kept");
    let names = scene.invariant_names().expect("the scene wants them");
    let momenta = ["J_x_dot", "J_y_dot"];
    assert_eq!(names, [momenta.as_slice(), &["moving_energy"]].concat());
    let initial = [("x", 0.4), ("y", 0.1), ("x_dot", 0.1), ("y_dot", 0.3), ("omega_z", 0.5)];
    let prepared = scene.prepare(&hamel_tests::models::params(&scene, &[])).expect("valid");
    let mut seen: Vec<(Vec<f64>, f64)> = Vec::new();
    follow(&scene, &[], &initial, &times(20.0, 40), |at| {
        let y: Vec<f64> = initial.iter().map(|(name, _)| at.get(name)).collect();
        let values = prepared.invariants(at.t, &y).expect("invariants");
        seen.push((values, prepared.energy(at.t, &y).expect("an energy")));
    });
    let (first, energy) = seen[0].clone();
    // The tolerance of the integration, and some hundred steps.
    let drift = seen.iter().flat_map(|(values, _)| values.iter().zip(&first));
    assert!(drift.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) < 1e-11, "{first:?}");
    assert!(seen.iter().any(|(_, e)| (e - energy).abs() > 1e-3), "the energy changes");
}

#[test]
fn jacobis_integral_is_a_moving_energy() {
    let bowl = "param w = 0.7; param k = 2; coordinate x, y in real;
        lagrangian = (x_dot^2 + y_dot^2)/2 - k*((x*cos(w*t) + y*sin(w*t))^2 + (x^2 + y^2)^2);";
    let (momenta, energy) = found(&derived(&format!("model bowl {{ {bowl} }}")));
    assert!(momenta.is_empty());
    assert_eq!(energy.as_deref(), Some("y_dot: w*x, x_dot: -w*y"));
    // Nothing of the kind where the axes do not turn as they are looked at, or where something rubs.
    let squeezed = bowl.replace("sin(w*t)", "sin(2*w*t)");
    for other in [squeezed, format!("{bowl} force x_dot = -x_dot;")] {
        assert_eq!(found(&derived(&format!("model bowl {{ {other} }}"))), (vec![], None));
    }
}

#[test]
fn a_section_of_a_moving_energy_may_be_divided_by_a_length() {
    let body = "param I: diagonal(3) = [1, 2, 3] where I1 > 0, I2 > 0, I3 > 0; param a = 0.3;
        velocity Omega in so(3); advected gamma in R^3 by cross(Omega, gamma);
        lagrangian = dot(Omega, I*Omega)/2 - gamma1*gamma2; constraint dot(Omega, gamma) = a;";
    let (_, energy) = found(&derived(&format!("model body {{ {body} }}")));
    let energy = energy.expect("the rotation about the vertical, a gamma/|gamma|^2");
    assert!(energy.contains("Omega1: a*gamma1/(gamma1^2 + gamma2^2 + gamma3^2)"), "{energy}");
}

#[test]
fn momenta_along_sections_that_nobody_named_are_found() {
    let plane = "coordinate x, y in real; lagrangian = (x_dot^2 + y_dot^2)/2 - sqrt(1 + x^2 + y^2);";
    let (momenta, energy) = found(&derived(&format!("model plane {{ {plane} }}")));
    assert_eq!((momenta.as_slice(), energy), (["y_dot: -x, x_dot: y".to_owned()].as_slice(), None));
    // The nonholonomic particle: no symmetry has the section, which is the generator of one times a function.
    let particle = "coordinate x, y, z in real; lagrangian = (x_dot^2 + y_dot^2 + z_dot^2)/2;
        constraint z_dot = y*x_dot; section across = [1, 0, y]; section scaled = [1, 0, y]/sqrt(1 + y^2);";
    let e = derived(&format!("model particle {{ {particle} }}"));
    assert_eq!(verdicts(&e), [("across", Vanishing::NonZero), ("scaled", Vanishing::Zero)]);
    let (momenta, _) = found(&e);
    let gauge = momenta.iter().find(|s| s.contains("z_dot: y/sqrt")).unwrap_or_else(|| panic!("{momenta:?}"));
    assert!(gauge.starts_with("x_dot: "), "{gauge}");
    let scene = built(&format!("model particle {{ {particle} scene kept {{ want invariants; }} }}"), "kept");
    // Where the constant speed along y is a number, the momentum and the energy are functions of each other.
    assert_eq!(scene.invariant_names().expect("invariants"), ["energy", "gauge_momentum2"]);
    // A potential that takes the symmetry away takes the momentum, but not that along y, which nothing pushes.
    let tilted = particle.replace(";\n", " - x^2 - z;\n");
    let (momenta, _) = found(&derived(&format!("model particle {{ {tilted} }}")));
    assert_eq!(momenta, ["y_dot: 1"]);
}

#[test]
fn a_scene_wants_sections_by_their_names() {
    let items = "coordinate x, y in real; lagrangian = (x_dot^2 + y_dot^2)/2;
        section turning = [-y, x]; section ahead = [1, 0];
        scene one { want rhs, turning; } scene both { want rhs, sections; }";
    let outputs = |scene: &str| {
        let scene = built(&format!("model plane {{ {items} }}"), scene);
        let prepared = scene.prepare(&[]).expect("no parameters");
        prepared.outputs(0.0, &[1.5, 2.0, -0.5, 3.0])
    };
    assert_eq!(outputs("one"), [5.5]);
    assert_eq!(outputs("both"), [5.5, -0.5]);
}
