//! Systems that do not exist are refused, and the message names what is wrong.

use hamel_codegen::error::Error;
use hamel_codegen::spec;
use hamel_expr::{Graph, Rational};
use hamel_lang::algebra::{LieAlgebra, Matrix, Representation};
use hamel_mechanics::mechanics;
use hamel_mechanics::reduction::{Formulation, Stages, reduce};
use hamel_tests::algebras::{FAMILIES, Transported};
use hamel_tests::draws::{for_all, one};
use hamel_tests::linear::{Rows, Vector, add_scaled, fraction, int, product, spans, times, transposed, unit};
use hamel_tests::problem::{Evaluation, Problem, algebra_text, equations_of};
use hamel_tests::stages::chain_exprs;
use num_traits::Zero;

const NUMBERS: usize = 1200;

#[track_caller]
fn refused(items: &str, part: &str) {
    let message = equations_of(&format!("model wrong {{ {items} }}")).expect_err("the system does not exist");
    assert!(message.contains(part), "expected `{part}` in\n{message}");
}

/// Triples for which `[[a, b], c] + [[b, c], a] + [[c, a], b]` of a bracket table is not zero, with the sum.
fn jacobi_failures(table: &dyn Fn(usize, usize) -> Vector, n: usize) -> Vec<([usize; 3], Vector)> {
    let outer = |x: &[Rational], c: usize| {
        let start = vec![int(0); n];
        x.iter().enumerate().fold(start, |sum, (k, q)| add_scaled(&sum, q, &table(k, c)))
    };
    let mut failures = Vec::new();
    for a in 0..n {
        for b in a + 1..n {
            for c in b + 1..n {
                let terms = [(a, b, c), (b, c, a), (c, a, b)].map(|(x, y, z)| outer(&table(x, y), z));
                let sum = terms.iter().fold(vec![int(0); n], |sum, term| add_scaled(&sum, &int(1), term));
                if sum.iter().any(|q| !q.is_zero()) {
                    failures.push(([a, b, c], sum));
                }
            }
        }
    }
    failures
}

#[test]
fn a_bracket_that_fails_jacobi_is_refused_with_every_failing_triple() {
    let mut failing = 0;
    for make in FAMILIES {
        for_all("broken bracket", 3, NUMBERS, |mut draws| {
            let family = make(&mut draws);
            let algebra = Transported::new(&family, &mut draws).algebra;
            let n = algebra.dim();
            let (a, b, c) = (draws.index(n), draws.index(n), draws.index(n));
            let extra = draws.non_zero();
            let (a, b) = (a.min(b), if a == b { (a + 1) % n } else { a.max(b) });
            let table = |x: usize, y: usize| {
                let mut value = vec![int(0); n];
                for (k, q) in algebra.bracket(x, y) {
                    value[k] = q;
                }
                let sign = i64::from((x, y) == (a, b)) - i64::from((y, x) == (a, b));
                value[c] += int(sign) * &extra;
                value
            };
            let expected = jacobi_failures(&table, n);
            let brackets: Vec<_> = (0..n)
                .flat_map(|x| (x + 1..n).map(move |y| (x, y)))
                .map(|(x, y)| (x, y, table(x, y).into_iter().enumerate().collect::<Vec<_>>()))
                .collect();
            let names: Vec<String> = (1..=n).map(|k| format!("e{k}")).collect();
            match LieAlgebra::from_brackets("broken", names.clone(), &brackets) {
                Ok(_) => assert!(expected.is_empty(), "{}: failures {expected:?} were not seen", family.name),
                Err(errors) => {
                    let triples: Vec<[String; 3]> = errors
                        .iter()
                        .map(|e| match e {
                            Error::JacobiViolated { triple, residual } => {
                                assert_ne!(residual, "0");
                                triple.clone()
                            }
                            other => panic!("{other}"),
                        })
                        .collect();
                    let own: Vec<[String; 3]> =
                        expected.iter().map(|(t, _)| t.map(|k| names[k].clone())).collect();
                    assert_eq!(triples, own, "{}", family.name);
                }
            }
            Ok(())
        });
        let mut draws = one(3, NUMBERS);
        let family = make(&mut draws);
        failing += usize::from(family.algebra.dim() >= 3);
    }
    assert!(failing > 0);
}

#[test]
fn jacobi_failure_names_the_triple_in_the_model_language() {
    let motion = "velocity y in h; lagrangian = dot(y, y);";
    refused(
        &format!("algebra h {{ basis a, b, c; [a, b] = c; [a, c] = a; }} {motion}"),
        "bracket [a, b] fails Jacobi with c: residual -c",
    );
    refused(
        &format!(
            "algebra h {{ basis e, f, g, h; [f, g] = h; [g, h] = f; [h, f] = g; [e, f] = f; }} {motion}"
        ),
        "bracket [e, f] fails Jacobi with g",
    );
}

#[test]
fn a_bracket_that_is_not_antisymmetric_is_refused() {
    let motion = "velocity y in h; lagrangian = dot(y, y);";
    refused(&format!("algebra h {{ basis a, b; [a, b] = a; [b, a] = a; }} {motion}"), "is not antisymmetric");
    refused(&format!("algebra h {{ basis a, b; [a, a] = b; }} {motion}"), "is not antisymmetric");
}

#[test]
fn an_algebra_written_out_in_a_random_basis_is_accepted() {
    for make in FAMILIES {
        let mut draws = one(17, NUMBERS);
        let family = make(&mut draws);
        let algebra = Transported::new(&family, &mut draws).algebra;
        let text =
            format!("model m {{ {} velocity y in h; lagrangian = dot(y, y); }}", algebra_text("h", &algebra));
        let model = spec::parse("m.hamel", &text).unwrap_or_else(|e| panic!("{e}"));
        for a in 0..algebra.dim() {
            for b in 0..algebra.dim() {
                let found = model.algebra.rational().expect("its constants are rational").bracket(a, b);
                assert_eq!(found, algebra.bracket(a, b), "{}", family.name);
            }
        }
    }
}

#[test]
fn a_random_line_that_is_no_ideal_is_refused_with_the_pair_that_leaves_it() {
    let mut refused = 0;
    for make in FAMILIES {
        let mut draws = one(29, NUMBERS);
        let family = make(&mut draws);
        let transported = Transported::new(&family, &mut draws);
        let n = transported.algebra.dim();
        let line = vec![draws.generic_vector(n)];
        let leaves = (0..n).any(|k| !spans(&line, &transported.bracket(&unit(n, k), &line[0])));
        let mut g = Graph::new();
        let chain: [Rows; 1] = [line];
        let names = Transported::stage_names(&chain);
        let ideals = chain_exprs(&mut g, &chain);
        match Stages::split(&mut g, &transported.algebra.clone().into(), &names, &ideals, None) {
            Ok(_) => assert!(!leaves, "{}", family.name),
            Err(errors) => {
                assert!(leaves, "{}", family.name);
                let [Error::NotAnIdeal { stage, above, bracket, .. }] = errors.as_slice() else {
                    panic!("{errors:?}")
                };
                assert_eq!((stage.as_str(), above.as_str()), ("n_1", "n_0"));
                assert_ne!(bracket, "0");
                refused += 1;
            }
        }
    }
    assert!(refused > FAMILIES.len() / 2);
}

#[test]
fn a_chain_of_ideals_in_the_wrong_order_is_refused() {
    let se_2_3 =
        "algebra h = semidirect(so(3), standard, standard); velocity O, V, U in h; lagrangian = dot(O, O);";
    refused(
        &format!("{se_2_3} stage a; stage b = ideal(U); stage c = ideal(V);"),
        "stage c is not contained in stage b",
    );
    refused(
        &format!("{se_2_3} stage a; stage b = ideal(V); stage c = ideal(V);"),
        "stage c splits nothing off",
    );
    refused(&format!("{se_2_3} stage a; stage b = ideal(O);"), "stage b is not an ideal of a");
    refused(&format!("{se_2_3} stage a; stage b = ideal(V1, V2);"), "stage b is not an ideal of a");
}

#[test]
fn an_inner_product_that_is_degenerate_on_an_ideal_is_refused() {
    let mut g = Graph::new();
    let se2 = LieAlgebra::se(2).unwrap();
    let chain = [vec![unit(3, 1), unit(3, 2)]];
    let rows = [[1, 0, 0], [0, 1, 1], [0, 1, 1]].map(|row| row.map(|n| g.int(n)).to_vec());
    let ideals = chain_exprs(&mut g, &chain);
    let outcome = Stages::split(&mut g, &se2.into(), &Transported::stage_names(&chain), &ideals, Some(&rows));
    assert_eq!(outcome.unwrap_err(), [Error::DegenerateInnerProduct { stage: "n_0".into() }]);
}

#[test]
fn a_constraint_that_follows_from_the_others_is_refused() {
    for_all("dependent", 12, NUMBERS, |mut draws| {
        let make = FAMILIES[draws.index(FAMILIES.len())];
        let family = make(&mut draws);
        let (mut problem, _) = Problem::random(&family, &mut draws);
        problem.constrain(2, &mut draws);
        for row in &mut problem.rows {
            row.offset = draws.rational();
        }
        let weights = [draws.non_zero(), draws.non_zero()];
        let mut last = problem.rows[0].clone();
        last.form = last.form.iter().map(|q| q * &weights[0]).collect();
        last.form = add_scaled(&last.form, &weights[1], &problem.rows[1].form);
        last.offset = &weights[0] * &problem.rows[0].offset + &weights[1] * &problem.rows[1].offset;
        problem.rows.push(last);
        let message = problem.equations().expect_err("three rows of rank two");
        assert!(message.contains("follows from the others"), "{message}");
        problem.rows[2].offset += draws.non_zero();
        let message = problem.equations().expect_err("three rows of rank two");
        assert!(message.contains("contradicts the others"), "{message}");
        Ok(())
    });
    let so3 = "velocity y in so(3); lagrangian = dot(y, y);";
    refused(
        &format!("{so3} constraint y1 = y2; constraint 2*y2 = 2*y1;"),
        "constraint 2*y2 = 2*y1 follows from",
    );
    refused(&format!("{so3} constraint y1 = y2; constraint y1 - y2 = 1;"), "contradicts the others");
}

#[test]
fn more_constraints_than_velocities_are_refused() {
    let so3 = "velocity y in so(3); lagrangian = dot(y, y);";
    refused(&format!("{so3} constraint y = 0; constraint y1 + y2 = 0;"), "follows from the others");
    refused(&format!("{so3} constraint y = 0; constraint y1 + y2 = 1;"), "contradicts the others");
}

#[test]
fn a_choice_of_independent_velocities_that_determines_nothing_is_refused() {
    let so3 = "velocity y in so(3); lagrangian = dot(y, y); constraint y1 + y2 = 0;";
    refused(&format!("{so3} independent y1, y2;"), "cannot be solved for y3");
    refused(&format!("{so3} independent y1;"), "1 independent velocities, the constraints leave 2");
}

#[test]
fn independent_velocities_beside_a_nonlinear_constraint_are_refused() {
    let so3 = "velocity y in so(3); lagrangian = dot(y, y); constraint y1*y2 = 1;";
    refused(&format!("{so3} independent y1, y2;"), "independent");
    refused(
        "velocity y in so(3); lagrangian = dot(y, y); quasi_velocity s; constraint y1*y2 = s;",
        "nonlinear",
    );
}

fn singular_direction(text: &str) -> String {
    let model = spec::parse("m.hamel", text).unwrap_or_else(|e| panic!("{e}"));
    let system = match reduce(&model, &Formulation::of(&model)) {
        Ok(system) => system,
        // Its equation without accelerations is of no use: the direction is told with it.
        Err(problems) => {
            let message = problems.iter().next().expect("a problem").message.clone();
            let rest = message.split_once("no inertia along ").unwrap_or_else(|| panic!("{message}")).1;
            let (direction, _) = rest.split_once(", and the equation").expect("the equation that is left");
            return direction.to_owned();
        }
    };
    match mechanics::derive(&system) {
        Err(Error::SingularMassMatrix { direction }) => direction,
        Err(other) => panic!("{other}"),
        Ok(_) => panic!("a singular mass matrix was inverted in\n{text}"),
    }
}

/// Components of a direction spelled in velocities: the slope of the momenta of `|y|^2/2 + t direction` in time.
fn components(direction: &str, n: usize) -> Vector {
    let text = format!("model m {{ velocity y in R^{n}; lagrangian = 1/2*dot(y, y) + t*({direction}); }}");
    let equations = equations_of(&text).unwrap_or_else(|e| panic!("{direction}: {e}"));
    let mut at =
        Evaluation::new(&equations, |name| Some(int(i64::from(name == "t")))).expect("no denominators");
    let momentum = equations.outputs.iter().find(|o| o.name == "momentum").expect("momenta");
    momentum.components.iter().map(|(_, e)| at.value(*e).expect("no denominators")).collect()
}

#[test]
fn a_singular_mass_matrix_names_a_direction_without_inertia() {
    for make in FAMILIES {
        for_all("singular", 2, NUMBERS, |mut draws| {
            let family = make(&mut draws);
            let (mut problem, _) = Problem::random(&family, &mut draws);
            let n = problem.algebra.dim();
            // G = P^T diag(positive, .., 0) P has one null direction.
            let p = draws.invertible(n);
            let mut scaled = p.clone();
            let kernel = draws.index(n);
            scaled[kernel] = vec![int(0); n];
            problem.metric = product(&transposed(&scaled), &scaled);
            let direction = components(&singular_direction(&problem.text()), n);
            assert!(direction.iter().any(|q| !q.is_zero()), "{}", problem.text());
            assert!(times(&problem.metric, &direction).iter().all(Zero::is_zero), "{}", problem.text());
            Ok(())
        });
    }
}

#[test]
fn a_mass_matrix_that_is_singular_on_the_constraint_is_refused() {
    let text = |constraint: &str| {
        format!("model m {{ velocity y in so(3); lagrangian = 1/2*(y1 + 2*y2)^2 + y3^2/2; {constraint} }}")
    };
    let direction = components(&singular_direction(&text("")), 3);
    assert_eq!(direction[0], &direction[1] * int(-2));
    assert!(direction[2].is_zero());
    // A constraint across the null direction repairs it, one along it does not, solved or kept by multipliers.
    for form in ["", "multipliers; "] {
        assert!(equations_of(&text(&format!("{form}constraint y1 = 0;"))).is_ok(), "{form}");
        singular_direction(&text(&format!("{form}constraint y3 = 0;")));
    }
}

#[test]
fn an_indefinite_mass_matrix_without_diagonal_is_solved() {
    // Not singular: elimination must look off the diagonal.
    let mut draws = one(33, NUMBERS);
    let (mut problem, _) = Problem::random(&FAMILIES[7](&mut draws), &mut draws);
    problem.metric = [[0, 1, 2], [1, 0, 3], [2, 3, 0]].map(|row| row.map(int).to_vec()).to_vec();
    let equations = problem.equations().unwrap_or_else(|e| panic!("{e}"));
    let state = problem.state(&mut draws);
    assert!(problem.verify(&equations, &state).is_some());
}

#[test]
fn matrices_that_represent_nothing_are_refused_with_the_pair_and_the_entry() {
    let so3 = LieAlgebra::so(3).unwrap();
    let standard = Representation::standard(&so3).unwrap();
    let mut matrices: Vec<Matrix> = (0..3).map(|a| standard.matrix(a).clone()).collect();
    matrices[2].set(0, 0, fraction(1, 2));
    let error = Representation::from_matrices("bent", &so3, matrices).unwrap_err();
    let Error::NotARepresentation { pair, entry, residual } = error else { panic!("{error}") };
    assert_eq!((pair, entry, residual.as_str()), (["e1".into(), "e2".into()], (1, 1), "1/2"));
    refused(
        "representation r of so(3) on R^2 { e1 = [[0, 1], [0, 0]]; e2 = [[0, 0], [1, 0]]; e3 = [[1, 0], [0, 1]]; }
         velocity y, v in semidirect(so(3), r); lagrangian = dot(y, y);",
        "matrices of e1 and e2 do not represent [e1, e2]",
    );
}

#[test]
fn an_action_that_is_none_is_refused_with_the_pair() {
    // The wrong side of the cross product is an action of the opposite algebra.
    let body = |action: &str| {
        format!("velocity y in so(3); advected a in R^3 by {action}; lagrangian = dot(y, y)/2 - a3;")
    };
    refused(&body("cross(a, y)"), "action of [y1, y2] is not the commutator of their actions");
    refused(&body("[y1*a1, 0, 0]"), "action of [y2, y3] is not the commutator");
    refused(&body("2*cross(y, a)"), "action of [y1, y2] is not the commutator");
    // A translation that does not commute with the rest.
    refused(&body("cross(y, a) + [y1, 0, 0]"), "action of");
    let fine = format!("model m {{ {} }}", body("cross(y, a)"));
    assert!(equations_of(&fine).is_ok());
    // Affine actions are actions: the cocycle of a translation by y x c.
    let affine = format!("model m {{ {} }}", body("cross(y, a) + cross(y, [1, 2, 3])"));
    assert!(equations_of(&affine).is_ok());
}

#[test]
fn a_random_change_of_one_generator_of_an_action_is_refused() {
    for_all("bent action", 12, NUMBERS, |mut draws| {
        let (mut problem, transported) = Problem::random(&FAMILIES[0](&mut draws), &mut draws);
        let adjoint = Representation::adjoint(&transported.original);
        problem.advect(&adjoint, &transported, &mut draws);
        let bend = draws.non_zero();
        if let Some(advection) = &mut problem.advection {
            // Adding the identity to one generator of a perfect algebra is never a representation.
            for (i, row) in advection.generators[draws.index(6)].iter_mut().enumerate() {
                row[i] += &bend;
            }
        }
        let message = problem.equations().expect_err("se(3) is perfect");
        assert!(message.contains("is not the commutator of their actions"), "{message}");
        Ok(())
    });
}
