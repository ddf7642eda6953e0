//! States that carry momenta: the motion of the original coordinates is that of the velocities, exactly, at random
//! rational points of random systems.
//!
//! A system is derived twice, with velocities and with momenta. At a state in velocities the Legendre transform gives
//! the momenta; their rates have to be what the chain rule makes of the rates in velocities, and everything else has to
//! have the same value.

use std::collections::BTreeMap;

use hamel_codegen::scene::{self, BuiltScene};
use hamel_codegen::spec;
use hamel_expr::{ExprId, Graph, Rational, SymbolId};
use hamel_lang::algebra::{LieAlgebra, Representation};
use hamel_mechanics::mechanics::Equations;
use hamel_mechanics::reduction::KinematicConstraint;
use hamel_tests::algebras::{FAMILIES, Transported};
use hamel_tests::bundle::{Bundle, BundleState};
use hamel_tests::draws::{Draws, for_all, one};
use hamel_tests::linear::{fraction, int};
use hamel_tests::models::{self, close, follow, text_with, times};
use hamel_tests::problem::{Evaluation, Problem, derived};
use hamel_tests::stages::with_items;
use proptest::test_runner::TestCaseError;

const NUMBERS: usize = 2400;

/// Numbers by name: velocities, coordinates, advected parameters, time.
type Values = BTreeMap<String, Rational>;

/// The momenta by velocities, as values and as rates along the motion in velocities; none where something has no value.
fn legendre(equations: &Equations, at: &Values, rates: &Values) -> Option<Vec<(String, Rational, Rational)>> {
    let system = &equations.system;
    let mut g = system.graph.clone();
    let mut symbols: Vec<(String, SymbolId)> = equations.legendre.velocities.clone();
    symbols.extend(equations.state.iter().map(|s| (s.name.clone(), s.symbol)));
    symbols.push(("t".to_owned(), system.time));
    symbols.retain(|(name, _)| at.contains_key(name));
    let mut values: BTreeMap<SymbolId, ExprId> = BTreeMap::new();
    for p in &system.params {
        values.insert(p.symbol, g.rational(at.get(&p.name).unwrap_or(&p.default).clone()));
    }
    for (name, symbol) in &symbols {
        values.insert(*symbol, g.rational(at[name].clone()));
    }
    let mut found = Vec::new();
    for (name, momentum) in &equations.legendre.momenta {
        let number = |g: &mut Graph, e: ExprId| {
            let value = g.subs(e, &values).ok()?;
            Some(g.as_rational(value).unwrap_or_else(|| panic!("{name} is no number")).clone())
        };
        let value = number(&mut g, *momentum)?;
        let mut rate = int(0);
        for (variable, symbol) in &symbols {
            let slope = g.diff(*momentum, *symbol);
            let along = if variable == "t" { int(1) } else { rates[variable].clone() };
            rate += number(&mut g, slope)? * along;
        }
        found.push((name.clone(), value, rate));
    }
    Some(found)
}

/// Holds a system with `items` (momenta) to the one without them at a state in velocities; how many components were
/// compared, none where a pivot vanishes.
fn compare(text: &str, items: &str, at: &Values) -> Option<usize> {
    let of_momenta = derived(&with_items(text, items));
    compare_equations(&derived(text), &of_momenta, at, &format!("{text}{items}"))
}

fn compare_equations(
    of_velocities: &Equations,
    of_momenta: &Equations,
    at: &Values,
    text: &str,
) -> Option<usize> {
    let mut evaluated = Evaluation::new(of_velocities, |name| at.get(name).cloned())?;
    let mut rates = Values::new();
    for variable in &of_velocities.state {
        rates.insert(variable.name.clone(), evaluated.value(variable.derivative)?);
    }
    let momenta = legendre(of_momenta, at, &rates)?;
    assert!(!momenta.is_empty(), "nothing is carried by\n{text}");
    let mut state = at.clone();
    state.extend(momenta.iter().map(|(name, value, _)| (name.clone(), value.clone())));
    let mut carried = Evaluation::new(of_momenta, |name| state.get(name).cloned())?;
    for variable in &of_momenta.state {
        let expected = match momenta.iter().find(|(name, ..)| *name == variable.name) {
            Some((_, _, rate)) => rate,
            None => &rates[&variable.name],
        };
        assert_eq!(carried.value(variable.derivative)?, *expected, "rate of {} in\n{text}", variable.name);
    }
    // Back again: the velocities by the momenta.
    let velocities = of_momenta.outputs.iter().find(|o| o.name == "velocities");
    for (name, e) in velocities.iter().flat_map(|o| &o.components) {
        assert_eq!(carried.value(*e)?, at[name], "{name} by momenta in\n{text}");
    }
    assert_eq!(
        carried.value(of_momenta.energy)?,
        evaluated.value(of_velocities.energy)?,
        "energy of\n{text}"
    );
    let power = carried.value(of_momenta.energy_rate)?;
    assert_eq!(power, evaluated.value(of_velocities.energy_rate)?, "power of\n{text}");
    for output in &of_velocities.outputs {
        let other = of_momenta.outputs.iter().find(|o| o.name == output.name);
        let other = other.unwrap_or_else(|| panic!("no output {} in\n{text}", output.name));
        for ((name, a), (_, b)) in output.components.iter().zip(&other.components) {
            assert_eq!(evaluated.value(*a)?, carried.value(*b)?, "{}.{name} of\n{text}", output.name);
        }
    }
    Some(of_momenta.state.len())
}

fn values_of(problem: &Problem, state: &hamel_tests::problem::State) -> Values {
    let mut values = Values::new();
    values.extend(state.y.iter().enumerate().map(|(k, q)| (format!("y{}", k + 1), q.clone())));
    let a = |k: usize| if problem.n_advected() == 1 { "a".to_owned() } else { format!("a{}", k + 1) };
    values.extend(state.a.iter().enumerate().map(|(k, q)| (a(k), q.clone())));
    values.insert("t".to_owned(), state.t.clone());
    values
}

/// `momentum p1 of y1; .. carry p1, ..;` for some of the names, at least one.
fn some_momenta(names: &[String], draws: &mut Draws) -> String {
    let chosen: Vec<&String> = names.iter().filter(|_| draws.integer() > -1).collect();
    let chosen = if chosen.is_empty() { vec![&names[0]] } else { chosen };
    let declared: Vec<String> = chosen.iter().map(|y| format!("momentum p_of_{y} of {y};")).collect();
    let carried: Vec<String> = chosen.iter().map(|y| format!("p_of_{y}")).collect();
    format!("{}\ncarry {};", declared.join("\n"), carried.join(", "))
}

/// Every family in a random basis with a random metric and side: all momenta, and some of them.
fn for_all_systems(what: &str, shape: impl Fn(&mut Problem, &Transported, &mut Draws)) {
    for make in FAMILIES {
        let probe = make(&mut one(1, 60));
        if probe.algebra.dim() > 7 {
            continue;
        }
        for_all(&format!("{what}, {}", probe.name), 1, NUMBERS, |mut draws| {
            let family = make(&mut draws);
            let (mut problem, transported) = Problem::random(&family, &mut draws);
            shape(&mut problem, &transported, &mut draws);
            let text = problem.text();
            let n = problem.algebra.dim();
            let of_velocities = derived(&text);
            let free: Vec<String> = match &of_velocities.system.constraint {
                KinematicConstraint::Solved(solved) => {
                    solved.independent().iter().map(|k| format!("y{}", k + 1)).collect()
                }
                KinematicConstraint::Multipliers { .. } => (1..=n).map(|k| format!("y{k}")).collect(),
            };
            let mut compared = 0;
            // A vector of momenta leaves out what the constraints determine.
            let all = if n > 1 { "momentum P of y; carry P;" } else { "momentum P of y1; carry P;" };
            for items in [all.to_owned(), some_momenta(&free, &mut draws)] {
                let of_momenta = derived(&with_items(&text, &items));
                for _ in 0..2 {
                    let at = values_of(&problem, &problem.state(&mut draws));
                    let label = format!("{text}{items}");
                    compared += compare_equations(&of_velocities, &of_momenta, &at, &label).unwrap_or(0);
                }
            }
            match compared {
                0 => Err(TestCaseError::reject("pivots vanish at every state drawn")),
                _ => Ok(()),
            }
        });
    }
}

#[test]
fn free_motion_in_momenta_is_lie_poisson() {
    for_all_systems("free", |_, _, _| {});
}

#[test]
fn constrained_motion_in_momenta_of_the_displacements_is_that_in_velocities() {
    for_all_systems("constrained", |problem, _, draws| {
        let k = 1 + draws.index(problem.algebra.dim().min(4) - 1);
        problem.constrain(k, draws);
        problem.rows[0].offset = draws.rational();
        problem.rows[0].rate = draws.rational();
        problem.push = draws.vector(problem.algebra.dim());
        problem.damping = draws.matrix(problem.algebra.dim(), problem.algebra.dim());
    });
}

#[test]
fn motion_with_multipliers_in_momenta_is_that_in_velocities() {
    for_all_systems("multipliers", |problem, _, draws| {
        problem.constrain(1, draws);
        problem.multipliers = true;
        problem.rows[0].offset = draws.rational();
        problem.push = draws.vector(problem.algebra.dim());
    });
}

#[test]
fn motion_with_advected_parameters_and_displacements_that_turn_with_them_is_that_in_velocities() {
    for_all_systems("advected", |problem, transported, draws| {
        let n = problem.algebra.dim();
        if n > 4 {
            // The dual pairing of a large algebra in a random basis takes minutes and shows nothing new.
            return;
        }
        problem.advect(&Representation::coadjoint(&transported.original), transported, draws);
        problem.constrain(1, draws);
        problem.rows[0].tilt = draws.matrix(n, problem.n_advected());
        problem.push = draws.vector(n);
    });
}

#[test]
fn motion_under_a_lagrangian_that_depends_on_time_in_momenta_is_that_in_velocities() {
    for_all_systems("time", |problem, _, draws| {
        problem.growth = draws.rational() * fraction(1, 4);
        problem.drift = draws.vector(problem.algebra.dim());
        if draws.integer() > 0 {
            problem.constrain(1, draws);
        }
    });
}

fn values_of_bundle(state: &BundleState, velocity: &str, group: &[Rational]) -> Values {
    let mut values = Values::new();
    let mut put = |stem: &str, numbers: &[Rational], end: &str| {
        let of = |k: usize| format!("{stem}{}{end}", k + 1);
        values.extend(numbers.iter().enumerate().map(|(k, q)| (of(k), q.clone())));
    };
    put("x", &state.x, "");
    put("x", &state.x_dot, "_dot");
    put(velocity, group, "");
    put("a", &state.a, "");
    values.insert("t".to_owned(), int(0));
    values
}

/// Bundles over a plane, with and without their connection: momenta of the base, of the group, and of both.
fn for_all_bundles(what: &str, shape: impl Fn(&mut Bundle, &mut Draws)) {
    let algebras =
        [LieAlgebra::so(3).unwrap(), LieAlgebra::se(2).unwrap(), LieAlgebra::heisenberg(1).unwrap()];
    for algebra in algebras {
        for right in [false, true] {
            for_all(what, 1, NUMBERS, |mut draws| {
                let mut bundle = Bundle::random(&algebra, right, &mut draws);
                shape(&mut bundle, &mut draws);
                let with_connection = draws.integer() > 0;
                let text = bundle.text(with_connection);
                let velocity = if with_connection { "v" } else { "xi" };
                let n = algebra.dim();
                let n_free = if bundle.tie.is_some() && !bundle.multipliers { n - 1 } else { n };
                let names: Vec<String> = ["x1_dot".to_owned(), "x2_dot".to_owned()]
                    .into_iter()
                    .chain((1..=n_free).map(|k| format!("{velocity}{k}")))
                    .collect();
                let of_group = format!("momentum Pi of {velocity}; carry Pi;");
                let of_base = "momentum p of x_dot; carry p;".to_owned();
                let mut compared = 0;
                for items in [of_group, of_base, some_momenta(&names, &mut draws)] {
                    let state = bundle.state(&mut draws);
                    let lift = bundle.lift(&state.x, &state.x_dot);
                    let group: Vec<Rational> = match with_connection {
                        true => state.xi.iter().zip(&lift).map(|(xi, l)| xi + l).collect(),
                        false => state.xi.clone(),
                    };
                    let at = values_of_bundle(&state, velocity, &group);
                    compared += compare(&text, &items, &at).unwrap_or(0);
                }
                match compared {
                    0 => Err(TestCaseError::reject("pivots vanish at every state drawn")),
                    _ => Ok(()),
                }
            });
        }
    }
}

#[test]
fn motion_on_bundles_in_momenta_is_that_in_velocities() {
    for_all_bundles("bundle", |_, _| {});
}

#[test]
fn constrained_motion_on_bundles_in_momenta_is_that_in_velocities() {
    for_all_bundles("bundle with a constraint", |bundle, draws| bundle.constrain(false, draws));
}

#[test]
fn motion_on_bundles_with_multipliers_and_advected_parameters_in_momenta_is_that_in_velocities() {
    for_all_bundles("bundle with multipliers", |bundle, draws| {
        bundle.constrain(true, draws);
        bundle.advect(draws);
    });
}

/// `(name, numerator, denominator)`.
fn at(values: &[(&str, i64, i64)]) -> Values {
    values.iter().map(|(name, n, d)| ((*name).to_owned(), fraction(*n, *d))).collect()
}

#[test]
fn nonlinear_constraints_in_momenta_are_those_in_velocities() {
    let text = "model appell {
        coordinate x: vector(2) in real;
        velocity w in R^2;
        lagrangian = x1_dot^2 + x2_dot^2*(2 + x1^2) + w1*x1_dot/2 + w1^2 + w2^2*(1 + x2^2)/2 - x1*x2 - x2^2;
        constraint x1_dot^2 + x2_dot^2 = w1^2;
        force w = [-w1/3, 1/2];
    }";
    let state = at(&[
        ("x1", 1, 3),
        ("x2", -1, 2),
        ("x1_dot", 3, 1),
        ("x2_dot", 4, 1),
        ("w1", 5, 1),
        ("w2", 2, 3),
        ("t", 0, 1),
    ]);
    for items in [
        "momentum p of x_dot; momentum P of w; carry p, P;",
        "momentum p of x_dot; carry p;",
        "momentum P of w1; carry P;",
    ] {
        assert!(compare(text, items, &state).is_some_and(|n| n == 6), "{items}");
    }
}

#[test]
fn quasi_velocities_have_momenta() {
    // Two wheels' worth of constraints, solved by one velocity s along a line that turns with phi.
    let text = "model board {
        param r = 3/5;
        coordinate phi in real;
        velocity v1, v2, omega in se(2);
        quasi_velocity s;
        lagrangian = phi_dot^2 + v1^2 + v2^2*(1 + phi^2) + omega^2 + phi_dot*omega/3 - phi^2;
        constraint v1 = -r*phi*s;
        constraint v2 = 0;
        constraint omega = (1 + phi^2)*s;
        independent phi_dot, s;
    }";
    // The names of se(2) come in the order of its basis.
    let text = text.replace("velocity v1, v2, omega in se(2)", "velocity omega, v1, v2 in se(2)");
    let state = at(&[("phi", 2, 3), ("phi_dot", -1, 2), ("s", 3, 4), ("t", 0, 1)]);
    for items in [
        "momentum S of s; carry S;",
        "momentum S of s; momentum p of phi_dot; carry S, p;",
        "momentum p of phi_dot; carry p;",
    ] {
        assert_eq!(compare(&text, items, &state), Some(3), "{items}");
    }
}

/// Routh: the momentum of the cyclic coordinate has the value of a parameter.
#[test]
fn routh_by_a_cyclic_coordinate_is_the_motion_at_its_momentum() {
    let text = "model routhian {
        param p = 1;
        coordinate x: vector(2) in real;
        coordinate phi in angle;
        velocity w in so(3);
        lagrangian = x1_dot^2 + x2_dot^2*(2 + x1^2) + phi_dot^2*(1 + x1^2 + x2^2) + phi_dot*(x1*x2_dot + w1*x2)
            + dot(w, w) + w1*w2*x1/3 + x1_dot*w3/5 + x1*phi_dot - x1^2*x2;
    }";
    let of_velocities = derived(text);
    let values = [("x1", 1, 3), ("x2", -1, 2), ("x1_dot", 3, 1), ("x2_dot", 4, 3)];
    let rest = [("w1", 5, 7), ("w2", 2, 3), ("w3", -1, 1), ("phi", 0, 1), ("phi_dot", 3, 8), ("t", 0, 1)];
    let mut state = at(&values);
    state.extend(at(&rest));
    // dL/dphi_dot at that state.
    let x = |name: &str| state[name].clone();
    let one = int(1);
    let inertia = one + x("x1") * x("x1") + x("x2") * x("x2");
    let p = int(2) * inertia * x("phi_dot") + x("x1") * x("x2_dot") + x("w1") * x("x2") + x("x1");
    let mut evaluated = Evaluation::new(&of_velocities, |name| state.get(name).cloned()).unwrap();
    let rates: Values = of_velocities
        .state
        .iter()
        .map(|s| (s.name.clone(), evaluated.value(s.derivative).unwrap()))
        .collect();
    let at_level = text.replace("param p = 1;", &format!("param p = {p};"));
    for (items, n) in [
        ("routh phi = p;", 7),
        ("momentum Pi of w; routh phi = p; carry Pi;", 7),
        ("momentum Pi of w; momentum P of x_dot; routh phi = p, w -> Pi, x_dot -> P;", 7),
    ] {
        let reduced = derived(&with_items(&at_level, items));
        assert_eq!(reduced.state.len(), n, "{items}");
        let mut known = state.clone();
        known.insert("p".to_owned(), p.clone());
        let momenta = legendre(&reduced, &known, &rates).unwrap();
        known.extend(momenta.iter().map(|(name, value, _)| (name.clone(), value.clone())));
        let mut carried = Evaluation::new(&reduced, |name| known.get(name).cloned()).unwrap();
        for variable in &reduced.state {
            let expected = match momenta.iter().find(|(name, ..)| *name == variable.name) {
                Some((_, _, rate)) => rate,
                None => &rates[&variable.name],
            };
            assert_eq!(
                carried.value(variable.derivative).unwrap(),
                *expected,
                "{} by {items}",
                variable.name
            );
        }
        let velocities = reduced.outputs.iter().find(|o| o.name == "velocities").unwrap();
        for (name, e) in &velocities.components {
            assert_eq!(carried.value(*e).unwrap(), state[name], "{name} by {items}");
        }
        // Only the reconstruction moves phi.
        let [phi] = &reduced.reconstruction[..] else { panic!("phi alone is reconstructed") };
        assert_eq!(
            (phi.name.as_str(), carried.value(phi.derivative).unwrap()),
            ("phi", state["phi_dot"].clone())
        );
        let energy = carried.value(reduced.energy).unwrap();
        assert_eq!(energy, evaluated.value(of_velocities.energy).unwrap(), "energy by {items}");
        assert!(reduced.facts.energy_is_conserved, "{items}");
    }
}

#[test]
fn an_abelian_velocity_at_a_level_is_a_cyclic_coordinate_without_its_angle() {
    let text = |items: &str| {
        format!(
            "model cart {{ param p = 2/3; coordinate x in real; velocity v in R;
            lagrangian = x_dot^2 + v^2*(1 + x^2)/2 + x*v*x_dot - x^2; {items} }}"
        )
    };
    let reduced = derived(&text("routh v = p;"));
    assert_eq!(reduced.state.len(), 2);
    let of_velocities = derived(&text(""));
    let (x, x_dot) = (fraction(1, 2), fraction(-3, 4));
    // p = (1 + x^2) v + x x_dot.
    let v = (fraction(2, 3) - &x * &x_dot) / (int(1) + &x * &x);
    let state: Values = [("x", x), ("x_dot", x_dot), ("v", v), ("t", int(0))]
        .into_iter()
        .map(|(name, q)| (name.to_owned(), q))
        .collect();
    let mut evaluated = Evaluation::new(&of_velocities, |name| state.get(name).cloned()).unwrap();
    let mut carried = Evaluation::new(&reduced, |name| state.get(name).cloned()).unwrap();
    for variable in &reduced.state {
        let other = of_velocities.state.iter().find(|s| s.name == variable.name).unwrap();
        assert_eq!(
            carried.value(variable.derivative),
            evaluated.value(other.derivative),
            "{}",
            variable.name
        );
    }
    assert!(reduced.reconstruction.is_empty());
}

fn scene_of(text: &str, name: &str) -> BuiltScene {
    let model = spec::parse("test.hamel", text).unwrap_or_else(|e| panic!("{e}"));
    scene::build(&model, name).unwrap_or_else(|e| panic!("{e}"))
}

/// A scene that carries momenta moves as the one that carries velocities, with the momenta of its start by the function
/// `legendre`, and has its derivatives, Taylor coefficients and invariants.
#[test]
fn a_scene_of_momenta_has_all_that_one_of_velocities_has() {
    let items =
        "scene all { carry Pi; want rhs, energy, velocities, casimirs, jacobian, invariants, taylor; }";
    let text = text_with("heavy_top", items);
    let (carried, own) = (scene_of(&text, "all"), models::build("heavy_top", scene::DEFAULT));
    assert_eq!(carried.state_names(), ["Pi1", "Pi2", "Pi3", "Gamma1", "Gamma2", "Gamma3"]);
    let prepared = carried.prepare(&models::params(&carried, &[])).unwrap();
    let omega = [1.0, -2.0, 3.0];
    let gamma = [0.6, 0.0, 0.8];
    let nothing = [0.0, 0.0, 0.0, 0.6, 0.0, 0.8];
    let pi = prepared.legendre(0.0, &nothing, &omega).unwrap();
    close("angular momentum", &pi, &[1.3, -3.4, 1.8], 1e-15);
    let y = [pi.clone(), gamma.to_vec()].concat();

    let from_velocities: Vec<(&str, f64)> =
        own_names().into_iter().zip([omega.to_vec(), gamma.to_vec()].concat()).collect();
    let from_momenta: Vec<(&str, f64)> = momentum_names().into_iter().zip(y.clone()).collect();
    let mut expected = Vec::new();
    follow(&own, &[], &from_velocities, &times(2.0, 8), |at| {
        expected.push([at.vector("Omega"), at.vector("Gamma")].concat());
    });
    let mut next = expected.iter();
    follow(&carried, &[], &from_momenta, &times(2.0, 8), |at| {
        let expected = next.next().unwrap();
        let outputs = at.outputs();
        let n = carried
            .outputs()
            .iter()
            .take_while(|o| o.name != "velocities")
            .map(|o| o.components.len())
            .sum::<usize>();
        close("velocities", &outputs[n..n + 3], &expected[..3], 2e-11);
        close("the vertical", &at.vector("Gamma"), &expected[3..], 2e-11);
    });

    // The Jacobian by central differences of a right-hand side that is quadratic in the state.
    let jacobian = prepared.matrix(scene::Derivative::Jacobian, 0.0, &y).unwrap();
    let (h, n) = (1.0 / 1024.0, y.len());
    for k in 0..n {
        let at = |h: f64| {
            let (mut moved, mut dy) = (y.clone(), vec![0.0; n]);
            moved[k] += h;
            prepared.rhs(0.0, &moved, &mut dy);
            dy
        };
        let (above, below) = (at(h), at(-h));
        for i in 0..n {
            let slope = (above[i] - below[i]) / (2.0 * h);
            assert!((jacobian[i][k] - slope).abs() < 1e-11, "d{i}/d{k}: {} and {slope}", jacobian[i][k]);
        }
    }
    // y'' = J y' is twice the second coefficient.
    let jet = carried.executable().jet().unwrap();
    let mut coefficients = vec![vec![0.0; n]; 4];
    let mut rows: Vec<&mut [f64]> = coefficients.iter_mut().map(Vec::as_mut_slice).collect();
    prepared.series(&jet, 0.0, &y, &mut rows);
    let mut dy = vec![0.0; n];
    prepared.rhs(0.0, &y, &mut dy);
    let first = if coefficients[0] == y { 1 } else { 0 };
    close("first coefficient", &coefficients[first], &dy, 1e-14);
    let second: Vec<f64> =
        jacobian.iter().map(|row| row.iter().zip(&dy).map(|(a, b)| a * b).sum::<f64>() / 2.0).collect();
    close("second coefficient", &coefficients[first + 1], &second, 1e-12);
    // Energy and both casimirs, orthogonal to the motion.
    let gradients = prepared.invariant_gradients(0.0, &y).unwrap();
    assert_eq!(gradients.len(), 3);
    for gradient in gradients {
        let along: f64 = gradient.iter().zip(&dy).map(|(a, b)| a * b).sum();
        assert!(along.abs() < 1e-12, "{along}");
    }
}

fn own_names() -> [&'static str; 6] {
    ["Omega1", "Omega2", "Omega3", "Gamma1", "Gamma2", "Gamma3"]
}

fn momentum_names() -> [&'static str; 6] {
    ["Pi1", "Pi2", "Pi3", "Gamma1", "Gamma2", "Gamma3"]
}

/// Shipped scenes with momenta: `legendre` and the output `velocities` are inverse, and the energies agree.
#[test]
fn velocities_and_momenta_of_shipped_scenes_are_inverse() {
    for name in models::names() {
        let model = models::model(&name);
        let own: Vec<&str> =
            model.scenes.iter().filter(|s| s.name == "momenta").map(|s| s.name.as_str()).collect();
        for scene_name in own {
            let slots: Vec<(String, String)> = {
                let built = scene::build(&model, scene_name).unwrap_or_else(|e| panic!("{e}"));
                let legendre = built.legendre();
                legendre
                    .velocities
                    .iter()
                    .zip(&legendre.momenta)
                    .map(|((v, _), (p, _))| (v.clone(), p.clone()))
                    .collect()
            };
            assert!(!slots.is_empty(), "{name}");
            let carried: Vec<&str> = slots.iter().map(|(_, p)| p.as_str()).collect();
            let items = format!("scene back {{ carry {}; want energy, velocities; }}", carried.join(", "));
            let back = scene_of(&text_with(&name, &items), "back");
            let prepared = back.prepare(&models::params(&back, &[])).unwrap();
            let own = models::build(&name, scene::DEFAULT);
            let of_velocities = own.prepare(&models::params(&own, &[])).unwrap();
            let mut random = hamel_tests::random::Random(11);
            for _ in 0..5 {
                let names = back.state_names();
                let mut y: Vec<f64> = names.iter().map(|_| 0.5 + 0.45 * random.number()).collect();
                let velocities: Vec<f64> = slots.iter().map(|_| random.number()).collect();
                let momenta = prepared.legendre(0.0, &y, &velocities).unwrap();
                for ((_, momentum), value) in slots.iter().zip(&momenta) {
                    y[names.iter().position(|n| n == momentum).unwrap()] = *value;
                }
                close(&format!("velocities of {name}"), &prepared.outputs(0.0, &y), &velocities, 1e-13);
                let known: BTreeMap<&str, f64> = names
                    .iter()
                    .map(String::as_str)
                    .zip(y.iter().copied())
                    .chain(slots.iter().map(|(v, _)| v.as_str()).zip(velocities.iter().copied()))
                    .collect();
                let state: Vec<f64> = own.state_names().iter().map(|n| known[n.as_str()]).collect();
                let (a, b) = (prepared.energy(0.0, &y), of_velocities.energy(0.0, &state));
                close(&format!("energy of {name}"), &[a.unwrap()], &[b.unwrap()], 1e-12);
            }
        }
    }
}

#[track_caller]
fn refused(items: &str, parts: &[&str]) {
    let text = format!("model wrong {{ {items} }}");
    let model = spec::parse("wrong.hamel", &text).unwrap_or_else(|e| panic!("{e}"));
    let names = scene::names(&model);
    let built = scene::Scenes::new(&model).build_all(&names);
    let message = built.expect_err("it cannot be carried").to_string();
    for part in parts {
        assert!(message.contains(part), "expected `{part}` in\n{message}");
    }
}

#[test]
fn momenta_that_do_not_exist_are_refused_where_they_are_asked_for() {
    // The constraints determine v.
    refused(
        "velocity u, v in R^2; momentum p of v; lagrangian = u^2 + v^2; constraint v = 2*u; independent u; carry p;",
        &["the constraints determine `v`", "carry p", "velocities in the state: u"],
    );
    // Nothing conserves the momentum of x.
    refused(
        "param p = 1; coordinate x in real; coordinate y in real; lagrangian = x_dot^2 + y_dot^2 - x^2*y; routh x = p;",
        &["the momentum along x_dot is no parameter: its rate is -2*x*y", "routh x = p", "carry it as state"],
    );
    // Quartic in the velocity.
    refused(
        "velocity w in R; momentum p of w; lagrangian = w^4 + w^2; carry p;",
        &["quadratic in the velocities", "without `carry`"],
    );
    // Nothing would say where the point is.
    refused(
        "param p = 1; coordinate x in angle; coordinate y in real; lagrangian = x_dot^2 + y_dot^2; routh x = p;
        scene s { circle x; want rhs; }",
        &["`x` is cyclic and no part of the state", "circle x"],
    );
}
