//! What models claim to be conserved is differentiated along all of the motion, quasi-velocities included.

use hamel_codegen::{scene, spec};
use hamel_expr::Rational;
use hamel_tests::algebras::{FAMILIES, Family};
use hamel_tests::draws::{for_all, one};
use hamel_tests::linear::{Vector, dot, inverse, times, unit};
use hamel_tests::models;
use hamel_tests::problem::{Problem, equations_of};
use num_traits::Zero;

const NUMBERS: usize = 2000;

fn list(v: &[Rational]) -> String {
    format!("[{}]", v.iter().map(Rational::to_string).collect::<Vec<_>>().join(", "))
}

fn table(rows: &[Vector]) -> String {
    format!("[{}]", rows.iter().map(|row| list(row)).collect::<Vec<_>>().join(", "))
}

#[test]
fn a_quasi_velocity_that_moves_is_no_casimir() {
    let text = models::text_with("snakeboard", "casimir Cs = s;");
    let message = equations_of(&text).expect_err("s moves");
    assert!(message.contains("casimir Cs is not conserved by these equations: its rate is"), "{message}");
    // The rate in the state, not the name of a definition.
    assert!(message.contains("phi_dot"), "{message}");
}

/// The heavy top in terms of its body angular momentum.
const TOP: &str = "model top {
    param I: diagonal(3) = [1.3, 1.7, 0.6] where I1 > 0, I2 > 0, I3 > 0;
    param chi: vector(3) = [0, 0.6, 0.8];
    velocity Omega in so(3);
    quasi_velocity Pi1, Pi2, Pi3;
    advected Gamma in R^3 by cross(Omega, Gamma);
    let Pi = [Pi1, Pi2, Pi3];
    lagrangian = 1/2*dot(Omega, I*Omega) - dot(Gamma, chi);
    constraint Omega = [Pi1/I1, Pi2/I2, Pi3/I3];
    independent Pi1, Pi2, Pi3;
    CASIMIRS
    scene kept { want rhs, invariants; }
}";

#[test]
fn casimirs_of_quasi_velocities_are_found_true() {
    let text = TOP.replace("CASIMIRS", "casimir C1 = dot(Gamma, Gamma); casimir C2 = dot(Pi, Gamma);");
    let model = spec::parse("top", &text).unwrap_or_else(|e| panic!("{e}"));
    let built = scene::build(&model, "kept").unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(built.equations().facts.casimirs, ["C1", "C2"]);
    // What a scene finds by itself agrees.
    assert_eq!(built.invariant_names().unwrap(), ["C1", "C2", "energy"]);
    for wrong in ["dot(Pi, Pi)", "Pi1", "dot(Pi, chi)"] {
        let text = TOP.replace("CASIMIRS", &format!("casimir C = {wrong};"));
        let message = equations_of(&text).expect_err("it moves");
        assert!(message.contains("casimir C is not conserved"), "{message}");
    }
}

/// A free system whose state is `q = M y`, with items that may use `q` and `u = y` written in it.
fn in_quasi_velocities(problem: &Problem, back: &[Vector], items: &str) -> String {
    let n = back.len();
    let q: Vec<String> = (1..=n).map(|k| format!("q{k}")).collect();
    let text = problem.text();
    let text = text.trim_end().strip_suffix('}').expect("a model ends with a brace");
    let q = q.join(", ");
    format!(
        "{text}quasi_velocity {q};\nlet q = [{q}];\nlet u = {}*q;\nconstraint y = u;\nindependent {q};\n{items}}}\n",
        table(back)
    )
}

#[test]
fn a_function_of_quasi_velocities_is_a_casimir_if_and_only_if_it_is_conserved() {
    let mut n_refused = 0;
    for make in FAMILIES {
        let family: Family = make(&mut one(1, 60));
        let n = family.algebra.dim();
        if n > 6 {
            continue;
        }
        let refused = std::cell::Cell::new(0);
        for_all(family.name, 2, NUMBERS, |mut draws| {
            let (problem, transported) = Problem::random(&family, &mut draws);
            let change = draws.invertible(n);
            let back = inverse(&change).expect("L D U is invertible");
            let energy = in_quasi_velocities(&problem, &back, "casimir E = dot(u, G*u);");
            let equations = equations_of(&energy).unwrap_or_else(|e| panic!("{e}\n{energy}"));
            assert_eq!(equations.facts.casimirs, ["E"]);
            // The momentum along the centre.
            if family.name.starts_with("heisenberg") {
                let centre = times(&transported.back, &unit(n, n - 1));
                let items = format!("casimir Z = dot({}, G*u);", list(&centre));
                let text = in_quasi_velocities(&problem, &back, &items);
                let equations = equations_of(&text).unwrap_or_else(|e| panic!("{e}\n{text}"));
                assert_eq!(equations.facts.casimirs, ["Z"]);
            }
            // A linear function, beside its rate at a random state by the equations without quasi-velocities.
            let slope = draws.generic_vector(n);
            let state = problem.state(&mut draws);
            let motion =
                problem.verify(&problem.equations().expect("a free system"), &state).expect("pivots");
            let rate = dot(&slope, &times(&change, &motion.ydot));
            let text =
                in_quasi_velocities(&problem, &back, &format!("casimir C = dot({}, q);", list(&slope)));
            match equations_of(&text) {
                Ok(_) => assert!(rate.is_zero(), "its rate is {rate} somewhere:\n{text}"),
                Err(message) => {
                    assert!(message.contains("casimir C is not conserved"), "{message}");
                    refused.set(refused.get() + 1);
                }
            }
            Ok(())
        });
        n_refused += refused.get();
    }
    assert!(n_refused > 10, "only {n_refused} functions were refused");
}
