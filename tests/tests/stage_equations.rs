//! The vertical equations by stages that explanations show are equations of motion: on shipped models, and on random
//! algebras, chains, inner products, sides, connections and constraints.

use std::collections::BTreeMap;

use hamel_codegen::spec;
use hamel_expr::{ExprId, Graph, Rational};
use hamel_lang::algebra::Representation;
use hamel_mechanics::mechanics::{Equations, VerticalEquations, derive};
use hamel_mechanics::reduction::{Formulation, KinematicConstraint, StageUse, Stages, reduce};
use hamel_tests::algebras::{FAMILIES, Transported};
use hamel_tests::bundle::Bundle;
use hamel_tests::draws::{Draws, for_all, one};
use hamel_tests::linear::{Rows, Vector, add_scaled, dot, int, rank, times, transposed};
use hamel_tests::models;
use hamel_tests::problem::{Problem, State, equations_of};
use hamel_tests::stages::{chain_text, with_items};
use num_traits::Zero;

const NUMBERS: usize = 3000;

fn vertical(equations: &Equations, what: &str) -> VerticalEquations {
    VerticalEquations::new(equations).unwrap_or_else(|| panic!("{what}: not the equations of motion"))
}

#[test]
fn of_shipped_models_they_are_equations_of_motion() {
    // Models without stages get the chain of one stage.
    let mut n_rows = BTreeMap::new();
    for name in models::names() {
        let model = models::model(&name);
        // A Hamiltonian has no equations in velocities, and fields have none at all.
        if model.algebra.dim() == 0 || model.hamiltonian.is_some() || model.given.is_some() {
            continue;
        }
        let text = if model.stages.is_some() {
            models::text(&name)
        } else {
            models::text_with(&name, "stage whole;")
        };
        let model = spec::parse(&name, &text).unwrap_or_else(|e| panic!("{name}: {e}"));
        // They are written in velocities.
        let mut in_velocities = Formulation { momenta: Vec::new(), ..Formulation::of(&model) };
        if in_velocities.stages.is_carried() {
            in_velocities.stages = StageUse::Carried(Vec::new());
        }
        let equations = derive(&reduce(&model, &in_velocities).unwrap()).unwrap();
        let found = vertical(&equations, &name);
        // Along all of the algebra with multipliers, otherwise along as many displacements as there are unknowns
        // besides those of the base.
        n_rows.insert(name, (found.rows.len(), found.has_multipliers));
        for row in &found.rows {
            assert_ne!(row.left, equations.system.graph.zero());
        }
    }
    let expected = [
        ("chaplygin_ball", (3, false)),
        ("chaplygin_gyro", (3, false)),
        ("euler_disk", (1, false)),
        ("extended_pose", (9, false)),
        ("heavy_top", (3, false)),
        ("kirchhoff_body", (6, false)),
        ("camassa_holm", (13, false)),
        ("second_grade_fluid", (24, false)),
        ("second_grade_fluid_3c", (16, false)),
        ("snakeboard", (1, false)),
        ("two_arm_satellite", (3, false)),
        ("two_arm_satellite_routh", (3, false)),
        ("veselova", (3, true)),
        ("wong_particle", (3, false)),
    ];
    for (name, rows) in expected {
        assert_eq!(n_rows.get(name), Some(&rows), "{name}");
    }
    assert!(n_rows.len() >= 15, "{n_rows:?}");
}

#[test]
fn in_a_derived_connection_they_are_equations_of_motion() {
    for (name, kind) in [("two_arm_satellite", "mechanical"), ("mobile_robot", "nonholonomic")] {
        let text = models::text_with(name, &format!("stage whole; connection {kind};"));
        let equations = equations_of(&text).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert!(equations.system.connection.is_some(), "{name}: v is xi");
        let found = vertical(&equations, name);
        // What the connection takes away from the velocities is in eta.
        let rates = &equations.system.velocities[..2];
        let g = &found.graph;
        assert!(found.velocities.iter().any(|d| rates.iter().any(|r| g.free_symbols(d.expr).contains(r))));
    }
}

#[test]
fn with_any_connection_side_and_constraint_they_are_equations_of_motion() {
    for make in FAMILIES {
        let family = make(&mut one(3, NUMBERS));
        if family.algebra.dim() > 4 {
            continue;
        }
        for_all(family.name, 1, NUMBERS, |mut draws| {
            let transported = Transported::new(&family, &mut draws);
            let n = family.algebra.dim();
            let whole: Vec<Rows> = Vec::new();
            let chains = transported.chains.iter().chain(transported.chains.is_empty().then_some(&whole));
            for (k, chain) in chains.enumerate() {
                for kind in 0..3 {
                    // Both sides with every kind of constraint, in turns with and without advected parameters.
                    let mut bundle = Bundle::random(&transported.algebra, (k + kind) % 2 == 0, &mut draws);
                    if kind > 0 {
                        bundle.constrain(kind == 2, &mut draws);
                    }
                    if k == 0 && n <= 3 {
                        bundle.advect(&mut draws);
                    }
                    for with_connection in [true, false] {
                        let velocity = if with_connection { "v" } else { "xi" };
                        let items = chain_text(velocity, chain, &transported.metric);
                        let text = with_items(&bundle.text(with_connection), &items);
                        let equations = equations_of(&text).unwrap_or_else(|e| panic!("{e}\n{text}"));
                        let found = vertical(&equations, &text);
                        assert_eq!(found.rows.len(), if kind == 1 { n - 1 } else { n }, "{text}");
                        assert_eq!(found.horizontal.len(), 2, "{text}");
                        assert_eq!(found.has_multipliers, kind == 2);
                    }
                }
            }
            Ok(())
        });
    }
}

/// The value of an expression, every symbol by its name.
fn value(g: &mut Graph, e: ExprId, of: &dyn Fn(&str) -> Option<Rational>) -> Rational {
    let symbols = g.free_symbols(e);
    let values = symbols.into_iter().map(|s| {
        let name = g.name(s).to_owned();
        let value = of(&name).unwrap_or_else(|| panic!("no value for {name}"));
        (s, g.rational(value))
    });
    let values = values.collect();
    let value = g.subs(e, &values).expect("no denominator vanishes at a generic point");
    g.as_rational(value).expect("all symbols have values").clone()
}

fn numbers(g: &Graph, rows: &[Vec<ExprId>]) -> Rows {
    let number = |e: &ExprId| g.as_rational(*e).expect("rational data give rational results").clone();
    rows.iter().map(|row| row.iter().map(number).collect()).collect()
}

/// Compares `left - right` with the residual of the motion, contracted with the displacement, for accelerations that
/// are none of the motion: an identity off the motion too.
fn assert_contracted(problem: &Problem, equations: &Equations, state: &State, draws: &mut Draws) {
    let text = problem.text();
    let found = vertical(equations, &text);
    let Stages { basis, inverse, .. } = equations.system.stages.as_ref().expect("stages");
    let (basis, inverse) =
        (numbers(&equations.system.graph, basis), numbers(&equations.system.graph, inverse));
    let ydot = draws.generic_vector(state.y.len());
    let scale = int(1) + &problem.growth * &state.t * &state.t;
    let mut p_dot: Vector = times(&problem.metric, &ydot).iter().map(|x| x * &scale).collect();
    p_dot = add_scaled(&p_dot, &(int(2) * &problem.growth * &state.t), &times(&problem.metric, &state.y));
    p_dot = add_scaled(&p_dot, &int(1), &problem.drift);
    let along = |covector: &[Rational]| times(&basis, covector);
    let (eta, beta) = (times(&transposed(&inverse), &state.y), along(&problem.momentum(state)));
    let (beta_dot, residual) = (along(&p_dot), along(&problem.residual(state, &ydot)));
    let forms = problem.forms(&state.a);
    let lambda = draws.generic_vector(forms.len());
    let index = |name: &str, stem: &str| name.strip_prefix(stem)?.parse::<usize>().ok().map(|k| k - 1);
    let mut g = found.graph.clone();
    let state_value = |name: &str| match (index(name, "y"), index(name, "a")) {
        (Some(k), _) => Some(state.y[k].clone()),
        (_, Some(k)) => Some(state.a[k].clone()),
        _ if name == "a" => Some(state.a[0].clone()),
        _ => (name == "t").then(|| state.t.clone()),
    };
    let tau: BTreeMap<String, Rational> = (found.applied.iter())
        .map(|d| (g.name(d.symbol).to_owned(), d.expr))
        .collect::<Vec<_>>()
        .into_iter()
        .map(|(name, e)| (name, value(&mut g, e, &state_value)))
        .collect();
    let all = |name: &str| {
        let lists = [("eta", &eta), ("beta", &beta), ("dot_beta", &beta_dot), ("lambda_c", &lambda)];
        let listed = lists.iter().find_map(|(stem, list)| index(name, stem).map(|k| list[k].clone()));
        listed.or_else(|| tau.get(name).cloned()).or_else(|| state_value(name))
    };
    let parts = found.pairings.iter().map(|p| (p.definition.symbol, p.definition.expr)).collect();
    let mut displacements = Vec::new();
    for row in &found.rows {
        let right = g.subs(row.right, &parts).expect("parts divide by nothing");
        let s: Vector = row.displacement.iter().map(|e| value(&mut g, *e, &state_value)).collect();
        let difference = value(&mut g, row.left, &all) - value(&mut g, right, &all);
        let vector = times(&transposed(&basis), &s);
        let reaction = if found.has_multipliers {
            forms.iter().zip(&lambda).map(|(form, l)| l * dot(form, &vector)).sum()
        } else {
            assert!(forms.iter().all(|form| dot(form, &vector).is_zero()), "leaves the constraint: {text}");
            int(0)
        };
        assert_eq!(difference, dot(&s, &residual) - reaction, "{text}");
        displacements.push(vector);
    }
    let expected = state.y.len() - if found.has_multipliers { 0 } else { forms.len() };
    assert_eq!(rank(&displacements), expected, "{text}");
    assert_eq!(found.rows.len(), expected, "{text}");
}

#[test]
fn they_are_the_residual_contracted_with_the_frame_of_allowed_displacements() {
    for make in FAMILIES {
        let name = make(&mut one(1, 60)).name;
        for_all(name, 1, NUMBERS, |mut draws| {
            let family = make(&mut draws);
            let n = family.algebra.dim();
            let (mut problem, transported) = Problem::random(&family, &mut draws);
            for (k, chain) in transported.chains.iter().enumerate().take(2) {
                problem.right = k % 2 == 0;
                problem.rows.clear();
                problem.multipliers = false;
                problem.advection = None;
                problem.growth = draws.non_zero() * draws.non_zero();
                problem.drift = draws.vector(n);
                problem.push = draws.vector(n);
                problem.damping = draws.matrix(n, n);
                if n <= 6 {
                    problem.advect(&Representation::coadjoint(&family.algebra), &transported, &mut draws);
                }
                for n_constraints in 0..3.min(n) {
                    problem.rows.clear();
                    problem.constrain(n_constraints, &mut draws);
                    for multipliers in [false, true] {
                        problem.multipliers = multipliers;
                        let items = chain_text("y", chain, &transported.metric);
                        let text = with_items(&problem.text(), &items);
                        let equations = equations_of(&text).unwrap_or_else(|e| panic!("{e}\n{text}"));
                        let keeps =
                            matches!(equations.system.constraint, KinematicConstraint::Multipliers { .. });
                        assert_eq!(keeps, multipliers && n_constraints > 0);
                        let state = problem.state(&mut draws);
                        assert_contracted(&problem, &equations, &state, &mut draws);
                    }
                }
            }
            Ok(())
        });
    }
}
