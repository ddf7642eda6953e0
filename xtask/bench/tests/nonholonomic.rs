//! The systems of the benchmark of nonholonomic integration against Newton's equations with multipliers, written here
//! for coordinates, and the leapfrogs of the discrete Lagrange-d'Alembert principle on them.
//!
//! Deliberately does not know: hamel's derivation.

use std::collections::BTreeMap;

use hamel_bench::generated;
use hamel_runtime::{Dla, Implicit, Integrator, Method, Options, Scene, SquareStorage, System, Vern9};

/// A system by hand: `M a = f + A^T lambda`, `A a + A' v = 0`, with a diagonal `M`.
struct ByHand {
    coordinates: &'static [&'static str],
    mass: Vec<f64>,
    force: fn(q: &[f64], v: &[f64]) -> Vec<f64>,
    rows: fn(q: &[f64]) -> Vec<Vec<f64>>,
    /// `A' v`.
    bias: fn(q: &[f64], v: &[f64]) -> Vec<f64>,
}

/// Solves one equation, or two.
fn solved(matrix: &[Vec<f64>], right: &[f64]) -> Vec<f64> {
    match right {
        [x] => vec![x / matrix[0][0]],
        [x, y] => {
            let [a, b, c, d] = [matrix[0][0], matrix[0][1], matrix[1][0], matrix[1][1]];
            let determinant = a * d - b * c;
            vec![(d * x - b * y) / determinant, (a * y - c * x) / determinant]
        }
        _ => unreachable!("no system has more constraints"),
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

impl ByHand {
    /// `A^T (A M^-1 A^T)^-1 x`, divided by `M`.
    fn response(&self, rows: &[Vec<f64>], x: &[f64]) -> Vec<f64> {
        let over_mass = |row: &[f64]| row.iter().zip(&self.mass).map(|(a, m)| a / m).collect::<Vec<_>>();
        let matrix: Vec<Vec<f64>> =
            rows.iter().map(|a| rows.iter().map(|b| dot(&over_mass(a), b)).collect()).collect();
        let lambda = solved(&matrix, x);
        let sum = |k: usize| rows.iter().zip(&lambda).map(|(row, l)| row[k] * l).sum::<f64>() / self.mass[k];
        (0..self.mass.len()).map(sum).collect()
    }

    /// The velocity next to `v` that obeys the constraint.
    fn allowed(&self, q: &[f64], v: &[f64]) -> Vec<f64> {
        let rows = (self.rows)(q);
        let violated: Vec<f64> = rows.iter().map(|row| dot(row, v)).collect();
        v.iter().zip(self.response(&rows, &violated)).map(|(v, correction)| v - correction).collect()
    }

    /// Derivatives by name.
    fn derivative(&self, q: &[f64], v: &[f64]) -> BTreeMap<String, f64> {
        let free: Vec<f64> = (self.force)(q, v).iter().zip(&self.mass).map(|(f, m)| f / m).collect();
        let rows = (self.rows)(q);
        let lacking: Vec<f64> =
            rows.iter().zip((self.bias)(q, v)).map(|(row, bias)| dot(row, &free) + bias).collect();
        let reaction = self.response(&rows, &lacking);
        let mut derivative = BTreeMap::new();
        for (k, name) in self.coordinates.iter().enumerate() {
            derivative.insert((*name).to_owned(), v[k]);
            derivative.insert(format!("{name}_dot"), free[k] - reaction[k]);
        }
        derivative
    }
}

/// Numbers between -1 and 1 that look like no others.
fn draws(seed: usize, n: usize) -> Vec<f64> {
    (0..n).map(|k| (12.9898 * (seed * 7 + k + 1) as f64).sin()).collect()
}

/// Compares the derivatives of a scene at several states with those by hand.
fn compare<S: Scene<f64, State = [f64; N]>, const N: usize>(by_hand: &ByHand, params: &[f64]) {
    let scene = S::prepare(params).unwrap();
    let n = by_hand.coordinates.len();
    for seed in 0..20 {
        let (q, v) = (draws(2 * seed, n), draws(2 * seed + 1, n));
        let v = by_hand.allowed(&q, &v);
        let mut values: BTreeMap<String, f64> = BTreeMap::new();
        for (k, name) in by_hand.coordinates.iter().enumerate() {
            values.insert((*name).to_owned(), q[k]);
            values.insert(format!("{name}_dot"), v[k]);
        }
        let state: [f64; N] = std::array::from_fn(|k| values[S::INFO.state[k]]);
        let mut found = [0.0; N];
        scene.rhs(0.0, &state, &mut found);
        let expected = by_hand.derivative(&q, &v);
        for (name, found) in S::INFO.state.iter().zip(found) {
            // Some twenty operations on numbers of size one, whose sums may be ten.
            let error = (found - expected[*name]).abs();
            assert!(
                error < 1e-13,
                "{} {}: {name}: {found} {}",
                S::INFO.model,
                S::INFO.scene,
                expected[*name]
            );
        }
    }
}

const CONTACT: [f64; 3] = [0.3, 0.4, 0.2];

fn contact() -> ByHand {
    ByHand {
        coordinates: &["x", "y", "z"],
        mass: vec![1.0; 3],
        force: |q, v| {
            let [epsilon, beta, gamma] = CONTACT;
            let [x, y, z] = [q[0], q[1], q[2]];
            vec![
                -x - epsilon * x * z * z - gamma * x * x,
                -y + beta * v[2] - gamma * y * y,
                -z - epsilon * x * x * z - beta * v[1] - gamma * z * z,
            ]
        },
        rows: |q| vec![vec![1.0, 0.0, q[1]]],
        bias: |_, v| vec![v[1] * v[2]],
    }
}

fn heisenberg() -> ByHand {
    ByHand {
        coordinates: &["x", "y", "z"],
        mass: vec![1.0; 3],
        force: |q, _| vec![-q[0], -2.0 * q[1], -q[2]],
        rows: |q| vec![vec![-q[1], q[0], 1.0]],
        bias: |_, _| vec![0.0],
    }
}

fn skate() -> ByHand {
    ByHand {
        coordinates: &["x", "y", "phi"],
        mass: vec![1.0, 1.0, 0.5],
        force: |_, _| vec![1.0, 0.0, 0.0],
        rows: |q| vec![vec![q[2].sin(), -q[2].cos(), 0.0]],
        bias: |q, v| vec![v[2] * (q[2].cos() * v[0] + q[2].sin() * v[1])],
    }
}

fn coin() -> ByHand {
    ByHand {
        coordinates: &["x", "y", "phi", "theta"],
        mass: vec![1.0, 1.0, 0.25, 0.5],
        force: |_, _| vec![1.0, 0.0, 0.0, 0.0],
        rows: |q| vec![vec![1.0, 0.0, 0.0, -q[2].cos()], vec![0.0, 1.0, 0.0, -q[2].sin()]],
        bias: |q, v| vec![q[2].sin() * v[2] * v[3], -q[2].cos() * v[2] * v[3]],
    }
}

fn defaults<S: Scene<f64>>() -> Vec<f64> {
    S::INFO.params.iter().map(|p| p.default).collect()
}

#[test]
fn every_system_moves_by_newtons_equations_with_multipliers() {
    use generated::{
        coin_on_incline, coin_on_incline_unreduced, contact_oscillator, contact_oscillator_unreduced,
        heisenberg_particle, heisenberg_particle_unreduced, skate_on_incline, skate_on_incline_unreduced,
    };
    compare::<contact_oscillator::Prepared, _>(&contact(), &CONTACT);
    compare::<contact_oscillator_unreduced::Prepared, _>(&contact(), &CONTACT);
    let params = defaults::<heisenberg_particle::Prepared>();
    compare::<heisenberg_particle::Prepared, _>(&heisenberg(), &params);
    compare::<heisenberg_particle_unreduced::Prepared, _>(&heisenberg(), &params);
    let params = defaults::<skate_on_incline::Prepared>();
    compare::<skate_on_incline::Prepared, _>(&skate(), &params);
    compare::<skate_on_incline_unreduced::Prepared, _>(&skate(), &params);
    let params = defaults::<coin_on_incline::Prepared>();
    compare::<coin_on_incline::Prepared, _>(&coin(), &params);
    compare::<coin_on_incline_unreduced::Prepared, _>(&coin(), &params);
}

/// The state at time two.
fn moved<S, M, const N: usize>(scene: &S, method: M, y: [f64; N], options: Options<f64>) -> [f64; N]
where
    S: System<f64, State = [f64; N]>,
    M: Method<f64, S>,
{
    let mut solver = Integrator::new(scene, method, 0.0, y, options).unwrap();
    solver.integrate_to(2.0).unwrap();
    *solver.state()
}

/// Order, way back and constraint of the leapfrogs on a scene with all velocities; which derivatives reverse.
fn check_leapfrogs<S, const N: usize>(by_hand: &ByHand)
where
    S: Scene<f64, State = [f64; N]> + Implicit<f64>,
    S::Variables: SquareStorage<f64>,
{
    let scene = S::prepare(&defaults::<S>()).unwrap();
    let n = by_hand.coordinates.len();
    let q = draws(5, n);
    let v = by_hand.allowed(&q, &draws(6, n));
    let start: [f64; N] = std::array::from_fn(|k| if k < n { q[k] } else { v[k - n] });
    let distance =
        |a: [f64; N], b: [f64; N]| a.iter().zip(b).fold(0.0, |max: f64, (a, b)| max.max((a - b).abs()));
    let end = moved(&scene, Vern9, start, Options::adaptive(1e-13, 1e-13));
    for method in [Dla::new(), Dla::reflecting()] {
        let error = |h: f64| distance(moved(&scene, method, start, Options::fixed(h)), end);
        let ratio = error(1.0 / 64.0) / error(1.0 / 128.0);
        assert!((ratio - 4.0).abs() < 0.1, "{} {method:?}: {ratio}", S::INFO.model);
    }
    let reversed = |y: [f64; N]| -> [f64; N] { std::array::from_fn(|k| if k < n { y[k] } else { -y[k] }) };
    let there = moved(&scene, Dla::new(), start, Options::fixed(0.125));
    let back = reversed(moved(&scene, Dla::new(), reversed(there), Options::fixed(0.125)));
    assert!(distance(back, start) < 1e-13, "{}: {:e}", S::INFO.model, distance(back, start));
    for row in (by_hand.rows)(&there) {
        assert!(dot(&row, &there[n..]).abs() < 1e-14, "{}: {:e}", S::INFO.model, dot(&row, &there[n..]));
    }
}

#[test]
fn leapfrogs_are_of_order_two_and_find_back() {
    // The contact oscillator by its default parameters has no gyroscopic force.
    check_leapfrogs::<generated::contact_oscillator_unreduced::Prepared, _>(&contact());
    check_leapfrogs::<generated::heisenberg_particle_unreduced::Prepared, _>(&heisenberg());
    check_leapfrogs::<generated::skate_on_incline_unreduced::Prepared, _>(&skate());
    check_leapfrogs::<generated::coin_on_incline_unreduced::Prepared, _>(&coin());
}
