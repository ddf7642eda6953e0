//! Random systems on random algebras: the derived equations are the equations of the theory, exactly.

use hamel_lang::algebra::{LieAlgebra, Representation};
use hamel_mechanics::mechanics::Equations;
use hamel_mechanics::reduction::KinematicConstraint;
use hamel_tests::algebras::{FAMILIES, Family, Transported};
use hamel_tests::draws::{Draws, for_all, one};
use hamel_tests::linear::{Vector, dot, int, times};
use hamel_tests::problem::{Problem, equations_of};
use num_traits::Zero;
use proptest::test_runner::TestCaseError;

const CASES: u32 = 2;
const NUMBERS: usize = 1600;

/// Every family in a random basis with a random metric and side, made into a problem by `make`, derived, and held to
/// every formula at two random states.
fn for_all_systems(
    shape: impl Fn(&mut Problem, &Transported, &mut Draws),
    check: impl Fn(&Problem, &Equations, Draws),
) {
    for make in FAMILIES {
        let name = make(&mut one(1, 60)).name;
        for_all(name, CASES, NUMBERS, |mut draws| {
            let family = make(&mut draws);
            let (mut problem, transported) = Problem::random(&family, &mut draws);
            shape(&mut problem, &transported, &mut draws);
            let equations = derived(&problem);
            let mut verified = 0;
            for _ in 0..2 {
                let state = problem.state(&mut draws);
                verified += usize::from(problem.verify(&equations, &state).is_some());
            }
            if verified == 0 {
                return Err(TestCaseError::reject("pivots vanish at every state drawn"));
            }
            check(&problem, &equations, draws);
            Ok(())
        });
    }
}

fn derived(problem: &Problem) -> Equations {
    problem.equations().unwrap_or_else(|e| panic!("{e}\n{}", problem.text()))
}

fn n_constraints(problem: &Problem, draws: &mut Draws) -> usize {
    1 + draws.index(problem.algebra.dim().min(4) - 1)
}

fn assert_conserved(equations: &Equations, text: &str) {
    assert_eq!(
        equations.energy_rate,
        equations.system.graph.zero(),
        "energy rate is the literal zero for\n{text}"
    );
    assert!(equations.facts.energy_is_conserved, "{text}");
}

fn representation_of(algebra: &LieAlgebra, draws: &mut Draws) -> Representation {
    let own = Representation::standard(algebra);
    match (draws.index(4), own) {
        (0, Some(standard)) => standard,
        (1, Some(standard)) => standard.dual(),
        (2, _) => Representation::coadjoint(algebra),
        _ => Representation::adjoint(algebra),
    }
}

#[test]
fn free_motion_is_euler_poincare() {
    for_all_systems(|_, _, _| {}, |problem, equations, _| assert_conserved(equations, &problem.text()));
}

#[test]
fn free_motion_with_parameters_in_the_metric_is_euler_poincare() {
    // Small algebras only: elimination of a generic symbolic metric grows fast and is the subject of no test here.
    for make in FAMILIES {
        let probe = make(&mut one(1, 60));
        if probe.algebra.dim() > 4 {
            continue;
        }
        for_all(probe.name, CASES, NUMBERS, |mut draws| {
            let family = make(&mut draws);
            let (mut problem, _) = Problem::random(&family, &mut draws);
            problem.symbolic_metric = true;
            if draws.integer() > 0 {
                problem.constrain(1, &mut draws);
            }
            let equations = derived(&problem);
            assert_conserved(&equations, &problem.text());
            let state = problem.state(&mut draws);
            assert!(
                problem.verify(&equations, &state).is_some(),
                "a leading minor of a positive matrix vanishes"
            );
            Ok(())
        });
    }
}

#[test]
fn suslov_constraints_are_kept_and_conserve_energy() {
    for_all_systems(
        |problem, _, draws| {
            let k = n_constraints(problem, draws);
            problem.constrain(k, draws);
        },
        |problem, equations, _| {
            assert_conserved(equations, &problem.text());
            let KinematicConstraint::Solved(solved) = &equations.system.constraint else {
                panic!("constant constraints are solved");
            };
            assert_eq!(solved.dependent.len(), problem.rows.len());
            let g = &equations.system.graph;
            let number = |e| g.as_rational(e).expect("constant constraints").clone();
            for row in &problem.rows {
                for a in 0..solved.unknowns.len() {
                    let column: Vector = solved.psi.iter().map(|r| number(r[a])).collect();
                    assert!(
                        dot(&row.form, &column).is_zero(),
                        "Psi leaves the constraint of\n{}",
                        problem.text()
                    );
                }
            }
        },
    );
}

#[test]
fn suslov_motion_does_not_depend_on_the_independent_velocities_nor_on_the_multiplier_form() {
    for_all_systems(
        |problem, _, draws| {
            let k = n_constraints(problem, draws);
            problem.constrain(k, draws);
        },
        |problem, equations, mut draws| {
            let solvable: Vec<_> = problem.choices().into_iter().filter(|c| c.1).map(|c| c.0).collect();
            assert!(!solvable.is_empty());
            let mut others = Vec::new();
            for _ in 0..2 {
                let chosen = solvable[draws.index(solvable.len())].clone();
                let other = Problem { independent: Some(chosen.clone()), ..problem.clone() };
                let derived = derived(&other);
                assert_conserved(&derived, &other.text());
                let KinematicConstraint::Solved(solved) = &derived.system.constraint else {
                    panic!("solved")
                };
                assert_eq!(solved.independent(), chosen);
                others.push((other, derived));
            }
            let with_multipliers = Problem { multipliers: true, ..problem.clone() };
            let kept = derived(&with_multipliers);
            assert!(matches!(kept.system.constraint, KinematicConstraint::Multipliers { .. }));
            assert!(kept.facts.energy_is_conserved_on_constraint);
            assert_eq!(kept.state.len(), problem.algebra.dim());
            others.push((with_multipliers.clone(), kept.clone()));
            let state = problem.state(&mut draws);
            let reference =
                problem.verify(equations, &state).expect("a positive metric has no vanishing pivot");
            for (other, equations) in &others {
                let motion =
                    other.verify(equations, &state).expect("a positive metric has no vanishing pivot");
                assert_eq!(motion, reference, "{}\nagainst\n{}", other.text(), problem.text());
            }
            // Off the constraint the multiplier form keeps the residual, and loses energy at the rate lambda a.y.
            let mut off = state;
            off.y = draws.generic_vector(problem.algebra.dim());
            let motion =
                with_multipliers.motion(&kept, &off).expect("a positive metric has no vanishing pivot");
            assert!(problem.constraint_rates(&off, &motion.ydot).iter().all(Zero::is_zero));
            let residuals = times(&problem.forms(&off.a), &off.y);
            assert_eq!(motion.energy_rate, dot(&motion.lambda, &residuals), "{}", with_multipliers.text());
        },
    );
}

#[test]
fn unsolvable_choices_of_independent_velocities_are_refused() {
    let mut refused = 0;
    for make in FAMILIES {
        let mut draws = one(5, NUMBERS);
        let family = make(&mut draws);
        let (mut problem, _) = Problem::random(&family, &mut draws);
        problem.constrain(2, &mut draws);
        // A constraint that does not see the first velocity.
        problem.rows[0].form[0] = int(0);
        problem.rows[1].form[0] = int(0);
        for (chosen, solvable) in problem.choices() {
            let other = Problem { independent: Some(chosen), ..problem.clone() };
            if other.rows.is_empty() || problem.algebra.dim() > 5 && refused > 10 {
                continue;
            }
            match (solvable, other.equations()) {
                (true, Ok(_)) => {}
                (false, Err(message)) => {
                    assert!(message.contains("cannot be solved for"), "{message}");
                    refused += 1;
                }
                (_, outcome) => panic!("solvable: {solvable}, {:?}\n{}", outcome.err(), other.text()),
            }
        }
    }
    assert!(refused > 0);
}

#[test]
fn affine_constraints_change_energy_at_the_rate_of_their_multipliers() {
    for_all_systems(
        |problem, _, draws| {
            let k = n_constraints(problem, draws);
            problem.constrain(k, draws);
            problem.rows[0].offset = draws.non_zero();
            for row in &mut problem.rows[1..] {
                row.offset = draws.rational();
            }
            problem.multipliers = draws.integer() < 0;
        },
        |problem, equations, _| {
            // Every offset is constant: nothing but its power keeps energy from being conserved.
            let g = &equations.system.graph;
            let conserved = equations.energy_rate == g.zero();
            assert_eq!(equations.facts.energy_is_conserved, conserved, "{}", problem.text());
        },
    );
}

#[test]
fn affine_constraints_that_move_are_kept() {
    for_all_systems(
        |problem, _, draws| {
            let k = n_constraints(problem, draws);
            problem.constrain(k, draws);
            for row in &mut problem.rows {
                row.offset = draws.rational();
                row.rate = draws.non_zero();
            }
            problem.multipliers = draws.integer() < 0;
        },
        |_, _, _| {},
    );
}

#[test]
fn offset_across_the_motion_does_work() {
    // A body whose third velocity is driven at a constant rate: the motor's power is not zero.
    let mut draws = one(9, NUMBERS);
    let (mut problem, _) = Problem::random(&FAMILIES[0](&mut draws), &mut draws);
    problem.constrain(2, &mut draws);
    problem.rows[0].offset = int(3);
    let equations = derived(&problem);
    let state = problem.state(&mut draws);
    let motion = problem.verify(&equations, &state).unwrap();
    assert!(!motion.energy_rate.is_zero());
    assert!(!equations.facts.energy_is_conserved);
    assert_eq!(motion.energy_rate, &motion.lambda[0] * int(3));
}

#[test]
fn forces_change_energy_at_the_rate_of_their_power() {
    for_all_systems(
        |problem, _, draws| {
            let n = problem.algebra.dim();
            problem.damping = draws.matrix(n, n);
            problem.push = draws.generic_vector(n);
            if draws.integer() > 0 {
                problem.constrain(1, draws);
                problem.multipliers = draws.integer() > 0;
            }
        },
        |problem, equations, _| assert!(!equations.facts.energy_is_conserved, "{}", problem.text()),
    );
}

#[test]
fn explicit_time_changes_energy_at_the_rate_of_the_lagrangian() {
    for_all_systems(
        |problem, _, draws| {
            problem.growth = int(1 + draws.integer().abs());
            problem.drift = draws.generic_vector(problem.algebra.dim());
            if draws.integer() > 0 {
                problem.constrain(1, draws);
                problem.multipliers = draws.integer() > 0;
            }
        },
        |problem, equations, _| assert!(!equations.facts.energy_is_conserved, "{}", problem.text()),
    );
}

#[test]
fn advected_parameters_move_by_the_action_and_conserve_energy() {
    for_all_systems(
        |problem, transported, draws| {
            let representation = representation_of(&transported.original, draws);
            problem.advect(&representation, transported, draws);
        },
        |problem, equations, _| {
            assert_conserved(equations, &problem.text());
            let n = problem.algebra.dim() + problem.n_advected();
            assert_eq!(equations.state.len(), n);
        },
    );
}

#[test]
fn constraints_that_turn_with_advected_parameters_are_kept() {
    // Veselova systems: some coefficients vanish on the way, so multipliers keep the constraint.
    for_all_systems(
        |problem, transported, draws| {
            let representation = representation_of(&transported.original, draws);
            problem.advect(&representation, transported, draws);
            problem.constrain(1, draws);
            let (n, k) = (problem.algebra.dim(), problem.n_advected());
            let mut tilt = draws.matrix(n, k);
            tilt[0][0] = draws.non_zero();
            problem.rows[0].tilt = tilt;
            if draws.integer() > 0 {
                // Ask for the solved form: every velocity but the first.
                problem.independent = Some((1..n).collect());
            }
        },
        |problem, equations, _| match &equations.system.constraint {
            KinematicConstraint::Solved(_) => assert_conserved(equations, &problem.text()),
            KinematicConstraint::Multipliers { .. } => {
                assert!(equations.facts.energy_is_conserved_on_constraint, "{}", problem.text());
            }
        },
    );
}

#[test]
fn everything_together_obeys_the_master_equation() {
    for_all_systems(
        |problem, transported, draws| {
            let n = problem.algebra.dim();
            let representation = representation_of(&transported.original, draws);
            problem.advect(&representation, transported, draws);
            problem.constrain(2, draws);
            let k = problem.n_advected();
            problem.rows[0].tilt = draws.matrix(n, k);
            problem.rows[0].offset = draws.non_zero();
            problem.rows[1].rate = draws.non_zero();
            problem.growth = int(1 + draws.integer().abs());
            problem.drift = draws.vector(n);
            problem.damping = draws.matrix(n, n);
            problem.push = draws.vector(n);
            problem.multipliers = draws.integer() > 0;
        },
        |_, _, _| {},
    );
}

fn orthogonal() -> Vec<(LieAlgebra, Representation)> {
    let so3 = LieAlgebra::so(3).unwrap();
    let so4 = LieAlgebra::so(4).unwrap();
    let pairs = [&so3, &so4].map(|g| (g.clone(), Representation::standard(g).unwrap()));
    let mut pairs = pairs.to_vec();
    pairs.push((so3.clone(), Representation::adjoint(&so3)));
    pairs.push((so4.clone(), Representation::coadjoint(&so4)));
    pairs
}

#[test]
fn the_norm_of_an_advected_vector_is_a_casimir_of_an_orthogonal_representation() {
    for (algebra, representation) in orthogonal() {
        for_all(algebra.name(), CASES, NUMBERS, |mut draws| {
            let family = Family { name: "orthogonal", algebra: algebra.clone(), chains: Vec::new() };
            let (mut problem, transported) = Problem::random(&family, &mut draws);
            problem.advect(&representation, &transported, &mut draws);
            let invariant = problem.invariant();
            if let Some(advection) = &mut problem.advection {
                advection.casimirs.extend(invariant);
            }
            let equations = derived(&problem);
            assert_eq!(equations.facts.casimirs, ["C1"]);
            assert_conserved(&equations, &problem.text());
            let state = problem.state(&mut draws);
            assert!(problem.verify(&equations, &state).is_some());
            Ok(())
        });
    }
}

#[test]
fn a_claimed_casimir_that_moves_is_refused() {
    // SL(2) preserves areas, not lengths.
    let model = |casimir: &str| {
        format!(
            "model shear {{ velocity y in sl(2); advected a in R^2 by [y1*a2 + y3*a1, y2*a1 - y3*a2];
             lagrangian = 1/2*dot(y, y) - a1; casimir C = {casimir}; }}"
        )
    };
    let message = equations_of(&model("dot(a, a)")).unwrap_err();
    assert!(message.contains("casimir C is not conserved"), "{message}");
    let plane =
        "model plane { velocity y in so(3); advected a in R^3 by cross(y, a); lagrangian = dot(y, y) - a1;
                 casimir C = dot(a, a); }";
    assert_eq!(equations_of(plane).unwrap().facts.casimirs, ["C"]);
}

#[test]
fn left_and_right_actions_differ_by_the_sign_of_the_bracket() {
    let mut draws = one(21, NUMBERS);
    let (mut problem, _) = Problem::random(&FAMILIES[0](&mut draws), &mut draws);
    let state = problem.state(&mut draws);
    problem.right = false;
    let left = problem.verify(&derived(&problem), &state).unwrap();
    problem.right = true;
    let right = problem.verify(&derived(&problem), &state).unwrap();
    assert!(left.ydot.iter().any(|q| !q.is_zero()), "the motion is not steady");
    let opposite: Vector = right.ydot.iter().map(|q| -q).collect();
    assert_eq!(left.ydot, opposite);
}
