//! Fields that a flow of matrices carries: the equations of the same models, Casimirs, order, symmetry, the bracket, and
//! motions that are known.

use hamel_codegen::{scene, spec};
use hamel_models::generated::{zeitlin_mhd_3, zeitlin_mhd_5};
use hamel_runtime::matrices::{
    Current, Damped, Friction, IsospectralMidpoint, Laplacian, Options, Sphere, Torus,
};
use hamel_runtime::{Error, Integrator, Scene, StateVector, Vern9};
use hamel_tests::random::Random;

type OnTorus = Torus<Vec<f64>>;
type OnSphere = Sphere<Vec<f64>>;
type Solver<'s, L> = IsospectralMidpoint<'s, L, Vec<f64>>;

fn torus(n: usize) -> OnTorus {
    Torus::new(n, vec![0.0; OnTorus::storage(n)]).unwrap_or_else(|e| panic!("{e}"))
}

fn sphere(n: usize) -> OnSphere {
    Sphere::new(n, vec![0.0; OnSphere::storage(n)]).unwrap_or_else(|e| panic!("{e}"))
}

fn solver<L: Laplacian>(surface: &L, options: Options) -> Solver<'_, L> {
    let room = vec![0.0; Solver::<L>::storage(surface.n(), &options)];
    IsospectralMidpoint::new(surface, room, 0.0, options).unwrap_or_else(|e| panic!("{e}"))
}

/// A solver with one magnetic field.
fn magnetic<L: Laplacian>(surface: &L, h: f64) -> Solver<'_, L> {
    let mut solver = solver(surface, Options::fixed(h).with_carried(1));
    solver.set_current(0, Current::magnetic()).unwrap_or_else(|e| panic!("{e}"));
    solver
}

fn random_modes(n: usize, seed: u64) -> Vec<f64> {
    let mut random = Random(seed);
    (0..n).map(|_| random.number() - 0.5).collect()
}

fn distance(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).map(|(x, y)| (x - y) * (x - y)).sum::<f64>().sqrt()
}

fn largest(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |m, x| x.abs().max(m))
}

/// A surface with the modes of the model language.
trait Modes: Laplacian {
    fn write(&self, modes: &[f64], matrix: hamel_runtime::matrices::MatrixMut<'_>);
    fn read(&self, matrix: hamel_runtime::matrices::MatrixRef<'_>) -> Vec<f64>;
}

impl Modes for OnTorus {
    fn write(&self, modes: &[f64], matrix: hamel_runtime::matrices::MatrixMut<'_>) {
        self.set_modes(modes, matrix);
    }

    fn read(&self, matrix: hamel_runtime::matrices::MatrixRef<'_>) -> Vec<f64> {
        let mut modes = vec![0.0; self.n_modes()];
        self.modes(matrix, &mut modes);
        modes
    }
}

impl Modes for OnSphere {
    fn write(&self, modes: &[f64], matrix: hamel_runtime::matrices::MatrixMut<'_>) {
        self.set_modes(modes, matrix);
    }

    fn read(&self, matrix: hamel_runtime::matrices::MatrixRef<'_>) -> Vec<f64> {
        let mut modes = vec![0.0; self.n_modes()];
        self.modes(matrix, &mut modes);
        modes
    }
}

/// Writes vorticity and carried fields, one after the other.
fn set<S: Modes>(surface: &S, solver: &mut Solver<'_, S>, state: &[f64], n_carried: usize) {
    let n = state.len() / (1 + n_carried);
    surface.write(&state[..n], solver.vorticity_mut());
    for k in 0..n_carried {
        surface.write(&state[(k + 1) * n..][..n], solver.carried_mut(k));
    }
}

fn get<S: Modes>(surface: &S, solver: &Solver<'_, S>, n_carried: usize) -> Vec<f64> {
    let carried = (0..n_carried).flat_map(|k| surface.read(solver.carried(k)));
    surface.read(solver.vorticity()).into_iter().chain(carried).collect()
}

fn rates<S: Modes>(surface: &S, solver: &mut Solver<'_, S>, n_carried: usize) -> Vec<f64> {
    let mut rates = surface.read(solver.derivative());
    for k in 0..n_carried {
        rates.extend(surface.read(solver.carried_derivative(k)));
    }
    rates
}

/// Rates, energy and Casimirs are those of the generated scene.
fn agrees<S: Scene<f64>>(n: usize, zeros: S::State) {
    let scene = S::prepare(&[]).unwrap_or_else(|e| panic!("{e}"));
    let surface = torus(n);
    let mut solver = magnetic(&surface, 0.1);
    for seed in 0..20 {
        let modes = random_modes(2 * (n * n - 1), seed);
        let (mut state, mut expected) = (zeros.clone(), zeros.clone());
        state.as_mut_slice().copy_from_slice(&modes);
        scene.rhs(0.0, &state, &mut expected);
        set(&surface, &mut solver, &modes, 1);
        let found = rates(&surface, &mut solver, 1);
        let size = largest(expected.as_slice());
        assert!(size > 0.01, "{n}: nothing moves");
        for (k, (x, y)) in found.iter().zip(expected.as_slice()).enumerate() {
            assert!((x - y).abs() < 1e-13 * size, "{n}: rate {k} is {x}, generated {y}");
        }
        let energy = scene.energy_of(0.0, &state).expect("an energy");
        assert!((solver.energy() / energy - 1.0).abs() < 1e-13, "{n}: energy");
        let mut outputs = vec![0.0; S::INFO.n_outputs()];
        scene.outputs_of(0.0, &state, &mut outputs);
        let names = S::INFO.outputs.iter().flat_map(|o| o.components.iter());
        let (mut traces, mut crosses) = (vec![0.0; n], vec![0.0; n]);
        solver.carried_casimirs(0, &mut traces);
        solver.cross_casimirs(0, &mut crosses);
        let mut compared = 0;
        for (name, value) in names.zip(&outputs) {
            let power = |prefix: char| name.strip_prefix(prefix)?.parse::<usize>().ok();
            let found = match (power('C'), power('D')) {
                (Some(k), _) => traces[k - 1],
                (_, Some(k)) => crosses[k - 1],
                _ => continue,
            };
            assert!((found - value).abs() < 1e-12, "{n}: {name} is {found}, generated {value}");
            compared += 1;
        }
        assert!(compared >= 2, "{compared}");
    }
}

#[test]
fn fields_move_as_the_generated_modes() {
    agrees::<zeitlin_mhd_3::Prepared<f64>>(3, [0.0; 16]);
    agrees::<zeitlin_mhd_5::Prepared<f64>>(5, [0.0; 48]);
}

/// The rates and the energy of a model that the command would elaborate.
fn of_equations(text: &str, params: &[f64], state: &[f64]) -> (Vec<f64>, f64) {
    let model = spec::parse("model", text).unwrap_or_else(|e| panic!("{e}"));
    let built = scene::build(&model, scene::DEFAULT).unwrap_or_else(|e| panic!("{e}"));
    let mut rates = vec![0.0; state.len()];
    let prepared = built.prepare(params).unwrap_or_else(|e| panic!("{e}"));
    prepared.rhs(0.0, state, &mut rates);
    (rates, prepared.energy_of(0.0, state).expect("an energy"))
}

/// On the sphere, with two fields, higher powers of the Laplacian, constant currents and a constant stream function.
#[test]
fn every_current_is_that_of_the_equations() {
    let hamiltonian = |factor: &str, wave: &str, second: &str| {
        format!(
            "action right; advected a in fluid as a_* by ad; advected b in fluid as b_* by ad; let L = laplacian(fluid);
             hamiltonian = {factor}*(-dot(w, L^-1*w) + 2*dot(a, a) - dot(a, L*a)/3 + dot(L*a, L*a)/20
                 - dot(b, (L - L^2/7)*b)/5) + 0.3*w_{wave} - 0.7*a_{second} + 0.2*b_{wave};"
        )
    };
    let current = |pairing: f64| {
        let a = Current::none().with(0, 2.0).with(1, 1.0 / 3.0).with(2, 0.05);
        let b = Current::none().with(1, 0.2).with(2, 1.0 / 35.0);
        (a, b, 1.0 / pairing)
    };
    let options = Options::fixed(0.1).with_carried(2).with_background();
    for n in [2, 3, 4] {
        let text = hamiltonian("1/2", "c_1_0", "s_1_1");
        let text =
            format!("model m {{ algebra fluid = zeitlin_sphere({n}); momentum w in fluid as w_*; {text} }}");
        let surface = sphere(n);
        let (a, b, by) = current(1.0);
        let mut solver = solver(&surface, options);
        solver.set_current(0, a).unwrap();
        solver.set_current(1, b).unwrap();
        surface.add_real_mode((1, 0), [0.3 * by, 0.0], solver.background_mut());
        surface.add_real_mode((1, 1), [0.0, -0.7 * by], solver.constant_current_mut(0));
        surface.add_real_mode((1, 0), [0.2 * by, 0.0], solver.constant_current_mut(1));
        compare(&surface, &mut solver, &text, 4.0 * std::f64::consts::PI);
    }
    for n in [3, 5] {
        let text = hamiltonian("1", "re_0_1", "im_1_m1");
        let text = format!("model m {{ algebra fluid = zeitlin({n}); momentum w in fluid as w_*; {text} }}");
        let surface = torus(n);
        let (a, b, by) = current(2.0);
        let mut solver = solver(&surface, options);
        solver.set_current(0, a).unwrap();
        solver.set_current(1, b).unwrap();
        surface.add_mode((0, 1), [0.3 * by, 0.0], solver.background_mut());
        surface.add_mode((1, -1), [0.0, -0.7 * by], solver.constant_current_mut(0));
        surface.add_mode((0, 1), [0.2 * by, 0.0], solver.constant_current_mut(1));
        compare(&surface, &mut solver, &text, 1.0);
    }
}

fn compare<S: Modes>(surface: &S, solver: &mut Solver<'_, S>, text: &str, by: f64) {
    let n = surface.n();
    let state = random_modes(3 * (n * n - 1), 4);
    let (expected, energy) = of_equations(text, &[], &state);
    set(surface, solver, &state, 2);
    let found = rates(surface, solver, 2);
    let size = largest(&expected);
    assert!(size > 0.1);
    for (k, (x, y)) in found.iter().zip(&expected).enumerate() {
        assert!((x - y).abs() < 1e-13 * size, "{n}: rate {k} is {x}, not {y}");
    }
    assert!((solver.energy() / by - energy).abs() < 1e-13 * energy.abs(), "{n}: {energy}");
}

/// The order is two, against the generated equations integrated by another method.
#[test]
fn the_order_is_two() {
    let scene = zeitlin_mhd_5::Prepared::<f64>::prepare(&[]).unwrap_or_else(|e| panic!("{e}"));
    let modes = random_modes(48, 3);
    let start: [f64; 48] = modes.clone().try_into().expect("48 modes");
    let end = 1.0;
    let options = hamel_runtime::Options::adaptive(1e-13, 1e-13);
    let mut other = Integrator::new(&scene, Vern9, 0.0, start, options).unwrap_or_else(|e| panic!("{e}"));
    other.integrate_to(end).unwrap_or_else(|e| panic!("{e}"));

    let surface = torus(5);
    let error = |n_steps: u32| {
        let mut solver = magnetic(&surface, end / f64::from(n_steps));
        set(&surface, &mut solver, &modes, 1);
        solver.integrate_to(end).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(solver.stats().steps, u64::from(n_steps));
        distance(&get(&surface, &solver, 1), other.state())
    };
    let errors = [100, 200, 400, 800].map(error);
    assert!(distance(&modes, other.state()) > 0.1, "nothing moves");
    for pair in errors.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!((order - 2.0).abs() < 0.02, "order {order}, errors {errors:?}");
    }
}

/// All Casimirs of one field.
fn casimirs<L: Laplacian>(solver: &mut Solver<'_, L>, most: usize) -> Vec<f64> {
    let (mut traces, mut crosses) = (vec![0.0; most], vec![0.0; most]);
    solver.carried_casimirs(0, &mut traces);
    solver.cross_casimirs(0, &mut crosses);
    traces.extend(crosses);
    traces
}

#[test]
fn casimirs_are_kept_to_round_off_and_energy_nearly() {
    let surface = torus(7);
    let mut fluid = magnetic(&surface, 0.01);
    let state: Vec<f64> = random_modes(96, 5).into_iter().map(|x| 0.5 * x).collect();
    set(&surface, &mut fluid, &state, 1);
    let (before, energy) = (casimirs(&mut fluid, 6), fluid.energy());
    for _ in 0..5_000 {
        fluid.step().unwrap_or_else(|e| panic!("{e}"));
    }
    let after = casimirs(&mut fluid, 6);
    println!("{before:?}\n{after:?} {energy} {} {:?}", fluid.energy(), fluid.stats());
    let moved = distance(&get(&surface, &fluid, 1), &state);
    assert!(moved > 0.5, "{moved}");
}
