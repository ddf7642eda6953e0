//! Fluids on the sphere by their structure constants: against commutators of dense matrices made here, against products
//! of matrices, and what stays constant.

use hamel_codegen::scene::{self, BuiltScene};
use hamel_codegen::spec;
use hamel_expr::{Number, Scalar};
use hamel_lang::algebra::{Functions, LieAlgebra};
use hamel_mechanics::mechanics::derive;
use hamel_mechanics::reduction::{Formulation, reduce};
use hamel_program::lower::SearchBudget;
use hamel_runtime::matrices::{IsospectralMidpoint, Options, Sphere};
use hamel_tests::random::Random;

/// A complex matrix by rows.
type Dense = Vec<Vec<[f64; 2]>>;

fn zeros(n: usize) -> Dense {
    vec![vec![[0.0; 2]; n]; n]
}

fn times(a: &Dense, b: &Dense) -> Dense {
    let n = a.len();
    let mut product = zeros(n);
    for i in 0..n {
        for j in 0..n {
            for k in 0..n {
                let ([p, q], [r, s]) = (a[i][k], b[k][j]);
                product[i][j][0] += p * r - q * s;
                product[i][j][1] += p * s + q * r;
            }
        }
    }
    product
}

/// `a + z b`.
fn plus(a: &Dense, [x, y]: [f64; 2], b: &Dense) -> Dense {
    let mut sum = a.clone();
    for (row, other) in sum.iter_mut().zip(b) {
        for (entry, [p, q]) in row.iter_mut().zip(other) {
            *entry = [entry[0] + x * p - y * q, entry[1] + x * q + y * p];
        }
    }
    sum
}

fn commutator(a: &Dense, b: &Dense) -> Dense {
    plus(&times(a, b), [-1.0, 0.0], &times(b, a))
}

fn adjoint(a: &Dense) -> Dense {
    let n = a.len();
    (0..n).map(|i| (0..n).map(|j| [a[j][i][0], -a[j][i][1]]).collect()).collect()
}

fn norm(a: &Dense) -> f64 {
    a.iter().flatten().map(|[x, y]| x * x + y * y).sum::<f64>().sqrt()
}

/// The basis as matrices, from the spin matrices in their usual form: powers of the raising one, lowered again and
/// again, and made to have the mean square one. Nothing of it is in the generator.
fn basis(n: usize) -> Vec<Dense> {
    let mut raising = zeros(n);
    for i in 0..n - 1 {
        raising[i][i + 1] = [(((i + 1) * (n - 1 - i)) as f64).sqrt(), 0.0];
    }
    let lowering = adjoint(&raising);
    let mut list = Vec::new();
    let mut power = raising.clone();
    for l in 1..n {
        // Of the orders l, l - 1, .., 0.
        let mut of_degree = vec![power.clone()];
        for _ in 0..l {
            of_degree.push(commutator(of_degree.last().unwrap(), &lowering));
        }
        for (m, t) in of_degree.iter().rev().enumerate() {
            let (cosine, sine) = (plus(t, [1.0, 0.0], &adjoint(t)), plus(t, [-1.0, 0.0], &adjoint(t)));
            let scaled = |a: &Dense, [x, y]: [f64; 2]| {
                let size = (n as f64).sqrt() / norm(a);
                plus(&zeros(n), [x * size, y * size], a)
            };
            list.push(scaled(&cosine, [1.0, 0.0]));
            if m > 0 {
                list.push(scaled(&sine, [0.0, -1.0]));
            }
        }
        power = times(&power, &raising);
    }
    list
}

fn value(q: &Number) -> f64 {
    let [high, low] = q.parts();
    high + low
}

#[test]
fn structure_constants_are_those_of_dense_matrices() {
    for n in 2..=6 {
        let algebra = LieAlgebra::zeitlin_sphere(n).unwrap();
        let basis = basis(n);
        assert_eq!((algebra.dim(), basis.len()), (n * n - 1, n * n - 1));
        let rate = -0.5 * ((n * n) as f64 - 1.0).sqrt();
        let mut largest = 0.0_f64;
        for a in 0..algebra.dim() {
            for b in a + 1..algebra.dim() {
                // -i sqrt(N^2 - 1)/2 [R_a, R_b]
                let mut rest = plus(&zeros(n), [0.0, rate], &commutator(&basis[a], &basis[b]));
                largest = largest.max(norm(&rest));
                for (c, q) in algebra.bracket(a, b) {
                    rest = plus(&rest, [-value(&q), 0.0], &basis[c]);
                }
                let (x, y) = (&algebra.basis()[a], &algebra.basis()[b]);
                assert!(norm(&rest) < 1e-12, "[{x}, {y}] of {n} is {:e} off", norm(&rest));
            }
        }
        assert!(largest > 1.0);
    }
}

#[test]
fn coordinates_turn_as_on_the_unit_sphere() {
    // {sqrt(3) x, sqrt(3) y} = sqrt(3) sqrt(3) z, whatever N is: degree one is so(3).
    for n in 2..=5 {
        let algebra = LieAlgebra::zeitlin_sphere(n).unwrap();
        assert_eq!(algebra.basis()[..3], ["c_1_0", "c_1_1", "s_1_1"]);
        let root = Number::sqrt(&spec::Rational::from_integer(3.into())).unwrap();
        let scale = 3.0_f64.sqrt();
        for (a, b, c) in [(0, 1, 2), (1, 2, 0)] {
            let found = value(&algebra.structure_constant(c, a, b));
            assert!((found - scale).abs() < 1e-14, "{n}: {found}");
        }
        if n == 2 {
            assert_eq!(algebra.structure_constant(2, 0, 1), root);
        }
    }
    assert!(LieAlgebra::zeitlin_sphere(1).is_err() && LieAlgebra::zeitlin_sphere(13).is_err());
}

#[test]
fn vorticity_has_the_same_brackets_in_another_basis() {
    let algebra = LieAlgebra::zeitlin_sphere(4).unwrap();
    let vorticity = algebra.vorticity().unwrap();
    assert!(!vorticity.is_almost());
    let Some(Functions::Sphere(harmonics)) = algebra.functions() else { panic!("functions on the sphere") };
    let squares = harmonics.squares();
    for (a, b, list) in algebra.brackets() {
        for (c, q) in list {
            let scale = spec::Rational::new(squares[*c].into(), (squares[a] * squares[b]).into());
            assert_eq!(vorticity.structure_constant(*c, a, b), q.times(&scale.into()));
        }
    }
}

fn fluid(n: usize, items: &str, wants: &str) -> String {
    format!(
        "model fluid {{
            algebra g = zeitlin_sphere({n});
            momentum omega in g as *;
            action right;
            hamiltonian = -1/2*dot(omega, laplacian(g)^-1*omega);
            {items}
            scene default {{ want {wants}; }}
        }}"
    )
}

fn build(text: &str) -> BuiltScene {
    let model = spec::parse("fluid.hamel", text).unwrap_or_else(|e| panic!("{e}"));
    scene::build_within(&model, "default", SearchBudget::default()).unwrap_or_else(|e| panic!("{e}"))
}

fn random_modes(n: usize, seed: u64) -> Vec<f64> {
    let mut random = Random(seed);
    (0..n * n - 1).map(|_| random.number() - 0.5).collect()
}

#[test]
fn harmonics_move_as_matrices() {
    type Solver<'s> = IsospectralMidpoint<'s, Sphere<Vec<f64>>, Vec<f64>>;
    for n in [2, 3, 4, 7] {
        let casimirs = if n < 5 { 2..=n } else { 2..=2 };
        let items: String =
            casimirs.clone().map(|k| format!("casimir C{k} = trace_power(g, omega, {k});\n")).collect();
        let wants: String = casimirs.clone().map(|k| format!(", C{k}")).collect();
        let built = build(&fluid(n, &items, &format!("rhs, energy{wants}")));
        let interpreter = built.prepare(&[]).unwrap();
        let surface = Sphere::new(n, vec![0.0; Sphere::<Vec<f64>>::storage(n)]).unwrap();
        let options = Options::fixed(0.1);
        let mut solver =
            Solver::new(&surface, vec![0.0; Solver::storage(n, &options)], 0.0, options).unwrap();
        for seed in 0..5 {
            let modes = random_modes(n, seed);
            surface.set_modes(&modes, solver.vorticity_mut());
            let mut back = vec![0.0; modes.len()];
            surface.modes(solver.vorticity(), &mut back);
            assert!(modes.iter().zip(&back).all(|(x, y)| (x - y).abs() < 1e-14), "{n}: modes");

            let (mut found, mut expected) = (vec![0.0; modes.len()], vec![0.0; modes.len()]);
            interpreter.rhs(0.0, &modes, &mut found);
            surface.modes(solver.derivative(), &mut expected);
            let scale = expected.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
            assert!(n == 2 || scale > 0.01, "{n}: nothing moves");
            for (k, (found, expected)) in found.iter().zip(&expected).enumerate() {
                let off = (found - expected).abs();
                assert!(off < 1e-13 * scale.max(0.1), "{n}: rate {k} is {found}, of matrices {expected}");
            }
            let energy = interpreter.energy(0.0, &modes).unwrap() * 4.0 * std::f64::consts::PI;
            assert!((solver.energy() / energy - 1.0).abs() < 1e-13, "{n}: energy");
            let mut traces = vec![0.0; n];
            solver.casimirs(&mut traces);
            for (found, k) in interpreter.outputs(0.0, &modes).iter().zip(casimirs.clone()) {
                let expected = traces[k - 1];
                let scale = traces[1].powf(0.5 * k as f64);
                assert!((found - expected).abs() < 1e-13 * scale, "{n}: C{k} is {found}, {expected}");
            }
        }
    }
}

#[test]
fn energy_and_casimirs_are_proved() {
    let items = "casimir C2 = trace_power(g, omega, 2);
        casimir C3 = trace_power(g, omega, 3);
        casimir C4 = dot(omega, star_power(g, omega, 3));";
    let text = fluid(4, items, "rhs");
    let model = spec::parse("fluid.hamel", &text).unwrap_or_else(|e| panic!("{e}"));
    let equations = derive(&reduce(&model, &Formulation::of(&model)).unwrap()).unwrap();
    assert!(equations.facts.energy_is_conserved && !equations.facts.bracket_is_almost);
    assert_eq!(equations.facts.casimirs, ["C2", "C3", "C4"]);
    // A function of the coefficients that is none is found out.
    let wrong = fluid(3, "casimir C = c_1_0^2 + c_2_0^2;", "rhs");
    let model = spec::parse("fluid.hamel", &wrong).unwrap();
    assert!(derive(&reduce(&model, &Formulation::of(&model)).unwrap()).is_err());
}

/// Functions carried by the flow, by the algebra's own bracket and by that of functions.
#[test]
fn functions_are_carried_by_the_bracket() {
    let items = "advected a in g as a_* by functions;
        output ours = poisson(g, omega, a);
        output theirs = ad(g, omega, a);";
    let built = build(&fluid(3, items, "rhs, ours, theirs"));
    let interpreter = built.prepare(&[]).unwrap();
    let state: Vec<f64> = [random_modes(3, 1), random_modes(3, 2)].concat();
    let outputs = interpreter.outputs(0.0, &state);
    let (ours, theirs) = outputs.split_at(8);
    assert!(ours.iter().any(|x| x.abs() > 0.01));
    assert!(ours.iter().zip(theirs).all(|(x, y)| (x - y).abs() < 1e-15), "{outputs:?}");
    // a' = {psi, a}, psi_l = omega_l/(l (l + 1)), as vorticity itself is carried.
    let (mut rates, mut same) = (vec![0.0; 16], vec![0.0; 16]);
    let modes = random_modes(3, 3);
    interpreter.rhs(0.0, &[modes.clone(), modes.clone()].concat(), &mut same);
    assert!(same[..8].iter().zip(&same[8..]).all(|(x, y)| (x - y).abs() < 1e-15), "{same:?}");
    interpreter.rhs(0.0, &state, &mut rates);
    assert!(rates[8..].iter().any(|x| x.abs() > 0.01));
}
