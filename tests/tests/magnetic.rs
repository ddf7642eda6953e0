//! Fields that a flow of matrices carries: the equations of the same models, Casimirs, order, symmetry, the bracket,
//! and motions that are known.

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
            let size = traces[1].sqrt().max(crosses[0].abs().sqrt());
            let bound = 1e-12 * (1.0 + size).powi(n as i32 + 1);
            assert!((found - value).abs() < bound, "{n}: {name} is {found}, generated {value}");
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
    (rates, prepared.energy(0.0, state).expect("an energy"))
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

/// Largest change of a Casimir, each relative to the powers of the root mean squares of the spectra.
fn drift(before: &[f64], after: &[f64], vorticity: f64) -> f64 {
    let (most, field) = (before.len() / 2, before[1].sqrt());
    let size = |at: usize| {
        let (power, factor) = if at < most { (at + 1, 1.0) } else { (at - most + 1, vorticity) };
        factor * field.powi(power as i32)
    };
    (0..before.len()).map(|at| (after[at] - before[at]).abs() / size(at)).fold(0.0, f64::max)
}

/// Takes steps; the drift of the Casimirs, the largest change of the energy, relative, and how far the state has gone.
fn run<S: Modes>(surface: &S, h: f64, n_steps: usize, state: &[f64]) -> [f64; 3] {
    let mut fluid = magnetic(surface, h);
    set(surface, &mut fluid, state, 1);
    let (before, energy) = (casimirs(&mut fluid, 5), fluid.energy());
    let mut square = [0.0; 2];
    fluid.casimirs(&mut square);
    let mut change = 0.0_f64;
    for _ in 0..n_steps {
        fluid.step().unwrap_or_else(|e| panic!("{e}"));
        change = change.max((fluid.energy() / energy - 1.0).abs());
    }
    let after = casimirs(&mut fluid, 5);
    [drift(&before, &after, square[1].sqrt()), change, distance(&get(surface, &fluid, 1), state)]
}

#[test]
fn casimirs_are_kept_to_round_off_and_energy_nearly() {
    let surface = torus(7);
    let state: Vec<f64> = random_modes(96, 5).into_iter().map(|x| 0.5 * x).collect();
    let [drift, coarse, moved] = run(&surface, 0.01, 4_000, &state);
    // Rounding errors of 4000 steps add up as a random walk.
    assert!(drift < 2e-14 && moved > 0.5, "{drift:e}, {moved}");
    let [_, fine, _] = run(&surface, 0.005, 8_000, &state);
    assert!(coarse < 1e-2 && (2.5..6.0).contains(&(coarse / fine)), "{coarse:e}, {fine:e}");
    for n in [2, 8, 12, 17] {
        let surface = sphere(n);
        let of_degree = |k: usize| ((k + 1) as f64).sqrt().floor();
        let count = n * n - 1;
        let state: Vec<f64> = (random_modes(2 * count, 11).into_iter().enumerate())
            .map(|(at, x)| x / (1.0 + of_degree(at % count).powi(if at < count { 1 } else { 3 })))
            .collect();
        let [drift, energy, moved] = run(&surface, 0.01, 300, &state);
        assert!(drift < 5e-15 && energy < 1e-2 && moved > 0.1, "{n}: {drift:e}, {energy:e}, {moved}");
    }
}

#[test]
#[ignore = "a hundred thousand steps"]
fn casimirs_are_kept_over_a_hundred_thousand_steps() {
    let surface = torus(7);
    let state: Vec<f64> = random_modes(96, 5).into_iter().map(|x| 0.5 * x).collect();
    let [drift, energy, _] = run(&surface, 0.01, 100_000, &state);
    assert!(drift < 1e-13 && energy < 1e-2, "{drift:e}, {energy:e}");
}

#[test]
fn steps_forwards_and_backwards_meet() {
    let surface = sphere(9);
    let mut fluid = magnetic(&surface, 0.02);
    let state: Vec<f64> = random_modes(160, 7).into_iter().map(|x| 0.2 * x).collect();
    set(&surface, &mut fluid, &state, 1);
    // The last step is shortened.
    fluid.integrate_to(1.01).unwrap_or_else(|e| panic!("{e}"));
    assert!(distance(&get(&surface, &fluid, 1), &state) > 0.1);
    fluid.integrate_to(1.0).unwrap_or_else(|e| panic!("{e}"));
    fluid.integrate_to(0.0).unwrap_or_else(|e| panic!("{e}"));
    assert!(distance(&get(&surface, &fluid, 1), &state) < 1e-11);
}

/// A step is a map that keeps the Lie-Poisson bracket: `T B(z) T^t = B(z')` with its derivative `T`. The columns of `B`
/// are the rates of linear hamiltonians, which a constant stream function and a constant current add.
#[test]
fn steps_keep_the_bracket() {
    let (n, h) = (8, 0.3);
    let surface = torus(3);
    let step = |state: &[f64]| {
        let mut fluid = magnetic(&surface, h);
        set(&surface, &mut fluid, state, 1);
        fluid.step().unwrap_or_else(|e| panic!("{e}"));
        get(&surface, &fluid, 1)
    };
    let bracket = |state: &[f64]| -> Vec<Vec<f64>> {
        let with = |at: Option<usize>| {
            let mut fluid = solver(&surface, Options::fixed(h).with_carried(1).with_background());
            let mut modes = vec![0.0; 2 * n];
            if let Some(at) = at {
                modes[at] = 0.5;
            }
            surface.set_modes(&modes[..n], fluid.background_mut());
            surface.set_modes(&modes[n..], fluid.constant_current_mut(0));
            set(&surface, &mut fluid, state, 1);
            rates(&surface, &mut fluid, 1)
        };
        let nothing = with(None);
        (0..2 * n).map(|at| with(Some(at)).iter().zip(&nothing).map(|(x, y)| x - y).collect()).collect()
    };
    let start: Vec<f64> = random_modes(2 * n, 8);
    let end = step(&start);
    assert!(distance(&start, &end) > 0.1);
    // Columns of the derivative by central differences.
    let delta = 1e-5;
    let derivative: Vec<Vec<f64>> = (0..2 * n)
        .map(|at| {
            let moved = |by: f64| {
                let mut state = start.clone();
                state[at] += by;
                step(&state)
            };
            moved(delta).iter().zip(moved(-delta)).map(|(x, y)| (x - y) / (2.0 * delta)).collect()
        })
        .collect();
    let (before, after) = (bracket(&start), bracket(&end));
    for i in 0..2 * n {
        for j in 0..2 * n {
            let mut sum = 0.0;
            for k in 0..2 * n {
                for l in 0..2 * n {
                    sum += derivative[k][i] * before[l][k] * derivative[l][j];
                }
            }
            // Truncation and rounding errors of the differences.
            assert!((sum - after[j][i]).abs() < 1e-8, "{i}, {j}: {sum}, {}", after[j][i]);
        }
    }
    // The bracket has changed.
    assert!(distance(&before[0], &after[0]) > 0.01);
}

/// Flow along the field, with velocity and field alike: `omega = j` is steady, whatever the field is; steps leave it by
/// their order.
#[test]
fn aligned_states_are_steady() {
    fn off<S: Modes>(surface: &S, h: f64) -> f64 {
        let count = surface.n() * surface.n() - 1;
        let mut fluid = magnetic(surface, h);
        let potential: Vec<f64> = random_modes(count, 6).into_iter().map(|x| 0.05 * x).collect();
        surface.write(&potential, fluid.carried_mut(0));
        let current = surface.read(fluid.current(0));
        surface.write(&current, fluid.vorticity_mut());
        let rates = rates(surface, &mut fluid, 1);
        assert!(largest(&rates) < 1e-13 * largest(&current), "{}", largest(&rates));
        fluid.integrate_to(0.5).unwrap_or_else(|e| panic!("{e}"));
        distance(&get(surface, &fluid, 1), &[current.clone(), potential].concat()) / largest(&current)
    }
    for [coarse, fine] in
        [[0.01, 0.005].map(|h| off(&sphere(10), h)), [0.01, 0.005].map(|h| off(&torus(11), h))]
    {
        assert!(coarse < 0.05 && (3.5..4.5).contains(&(coarse / fine)), "{coarse:e}, {fine:e}");
    }
}

/// Waves of Alfven along a field with the potential `b Y_10`, which is `b c z`: where vorticity and potential of one
/// harmonic are in phase, nothing else moves, so that waves of any size are solutions, whatever `N` is. Their phases
/// move at the rates `s` of `s (s - 2 Omega m/(l (l + 1))) = (b c m)^2 (1 - 2/(l (l + 1)))` in a frame that turns.
#[test]
fn waves_of_alfven_have_their_frequencies() {
    // Y_10 is the coordinate times this.
    let c = (3.0 / (4.0 * std::f64::consts::PI)).sqrt();
    for (n, l, m, rotation) in [(6, 3, 2, 0.0), (16, 4, 3, 0.0), (16, 5, 1, 0.7), (33, 7, 4, 0.0)] {
        let eigenvalue = (l * (l + 1)) as f64;
        let (b, order) = (0.8, m as f64);
        let alfven = (b * c * order).powi(2) * (1.0 - 2.0 / eigenvalue);
        let half = rotation * order / eigenvalue;
        for sign in [1.0, -1.0] {
            let frequency = half + sign * (half * half + alfven).sqrt();
            let surface = sphere(n);
            let options = Options::fixed(2e-3).with_carried(1).with_background();
            let mut fluid = solver(&surface, options);
            fluid.set_current(0, Current::magnetic()).unwrap();
            surface.add_mode((1, 0), [b, 0.0], fluid.carried_mut(0));
            // Absolute vorticity of the frame, in which nothing moves.
            surface.add_mode((1, 0), [2.0 * rotation / c, 0.0], fluid.vorticity_mut());
            surface.add_mode((1, 0), [-rotation / c, 0.0], fluid.background_mut());
            // a' = {psi, b c z}, which is i m b c psi of a coefficient.
            let ratio = b * c * order / (eigenvalue * frequency);
            surface.add_mode((l, m), [0.3, 0.0], fluid.vorticity_mut());
            surface.add_mode((l, m), [0.3 * ratio, 0.0], fluid.carried_mut(0));
            let energy = fluid.energy();
            fluid.integrate_to(2.0).unwrap_or_else(|e| panic!("{e}"));
            for (matrix, size) in [(fluid.vorticity(), 0.3), (fluid.carried(0), 0.3 * ratio)] {
                let [re, im] = surface.mode((l, m), matrix);
                let turned = (2.0 * frequency).sin_cos();
                let (x, y) = (re / size - turned.1, im / size - turned.0);
                // Of second order in the step.
                assert!(x.hypot(y) < 1e-5, "{n}, {l}, {m}: {re}, {im}, {frequency}");
            }
            assert!((fluid.energy() / energy - 1.0).abs() < 1e-12);
        }
    }
}

/// A tracer that begins as the vorticity stays it, and one that is no field of energy changes nothing.
#[test]
fn tracers_are_carried() {
    let surface = torus(15);
    let modes: Vec<f64> = random_modes(224, 12).into_iter().map(|x| 0.2 * x).collect();
    let mut fluid = solver(&surface, Options::fixed(0.02).with_carried(2));
    let mut alone = solver(&surface, Options::fixed(0.02));
    let other = random_modes(224, 13);
    surface.set_modes(&modes, alone.vorticity_mut());
    set(&surface, &mut fluid, &[modes.clone(), modes.clone(), other.clone()].concat(), 2);
    let mut before = [0.0; 4];
    fluid.carried_casimirs(1, &mut before);
    fluid.integrate_to(1.0).unwrap_or_else(|e| panic!("{e}"));
    alone.integrate_to(1.0).unwrap_or_else(|e| panic!("{e}"));
    let vorticity = surface.read(fluid.vorticity());
    assert!(distance(&vorticity, &surface.read(alone.vorticity())) < 1e-13);
    assert!(distance(&vorticity, &surface.read(fluid.carried(0))) < 1e-13);
    assert!(distance(&vorticity, &modes) > 0.1 && distance(&other, &surface.read(fluid.carried(1))) > 0.1);
    let mut after = [0.0; 4];
    fluid.carried_casimirs(1, &mut after);
    assert!(
        before.iter().zip(after).all(|(x, y)| (x - y).abs() < 1e-12 * (1.0 + x.abs())),
        "{before:?} {after:?}"
    );
    assert!(alone.energy() - fluid.energy() == 0.0 || (alone.energy() / fluid.energy() - 1.0).abs() < 1e-13);
}

/// Friction acts on the vorticity alone: without a current a tracer keeps its Casimirs, and a mode of the vorticity
/// decays at its rate `nu l (l + 1)`.
#[test]
fn friction_is_on_the_vorticity() {
    let surface = sphere(12);
    let friction = Friction::none().with(1, 0.05);
    let fluid = solver(&surface, Options::fixed(0.1).with_carried(1));
    let room = vec![0.0; Damped::<OnSphere, Vec<f64>>::storage(12)];
    let mut damped = Damped::new(fluid, friction, room).unwrap_or_else(|e| panic!("{e}"));
    let tracer: Vec<f64> = random_modes(143, 3);
    surface.add_real_mode((4, 2), [0.6, 0.0], damped.fluid_mut().vorticity_mut());
    surface.set_modes(&tracer, damped.fluid_mut().carried_mut(0));
    let mut before = [0.0; 4];
    damped.fluid_mut().carried_casimirs(0, &mut before);
    damped.integrate_to(1.0).unwrap_or_else(|e| panic!("{e}"));
    let [x, _] = surface.real_mode((4, 2), damped.fluid().vorticity());
    assert!((x - 0.6 * (-1.0_f64).exp()).abs() < 1e-13, "{x}");
    let mut after = [0.0; 4];
    damped.fluid_mut().carried_casimirs(0, &mut after);
    assert!(
        before.iter().zip(after).all(|(x, y)| (x - y).abs() < 1e-12 * (1.0 + x.abs())),
        "{before:?} {after:?}"
    );
    assert!(distance(&tracer, &surface.read(damped.fluid().carried(0))) > 0.1);

    // A step whose end overflows changes nothing: the first half is finite.
    let surface = torus(9);
    let mut fluid = magnetic(&surface, 1.0);
    surface.add_mode((1, 0), [0.5, 0.0], fluid.vorticity_mut());
    surface.add_mode((0, 1), [1e-200, 0.0], fluid.carried_mut(0));
    let room = vec![0.0; Damped::<OnTorus, Vec<f64>>::storage(9)];
    let mut damped = Damped::new(fluid, Friction::none().with(0, -1400.0), room).unwrap();
    let before = surface.read(damped.fluid().carried(0));
    assert!(matches!(damped.step().unwrap_err(), Error::Failure(_) | Error::NotConverged { .. }));
    assert_eq!(before, surface.read(damped.fluid().carried(0)));
}

#[test]
fn what_cannot_be_carried_is_said() {
    let refused = Options::fixed(0.1).with_carried(5).validate().unwrap_err();
    assert!(matches!(refused, Error::Number { value: 5.0, .. }), "{refused}");
    let surface = sphere(8);
    let mut fluid = magnetic(&surface, 50.0);
    assert!(fluid.set_current(0, Current::none().with(3, f64::NAN)).is_err());
    // Steps far too long: the state before is kept, and shorter steps go on.
    let state = random_modes(126, 2);
    set(&surface, &mut fluid, &state, 1);
    let start = get(&surface, &fluid, 1);
    fluid.step().unwrap_err();
    assert_eq!((get(&surface, &fluid, 1), fluid.t()), (start, 0.0));
    fluid.integrate_to(0.001).unwrap_or_else(|e| panic!("{e}"));
    // Nothing that moves.
    set(&surface, &mut fluid, &[0.0; 126], 1);
    fluid.step().unwrap_or_else(|e| panic!("{e}"));
    fluid.carried_mut(0).set(2, 5, [f64::NAN, 0.0]);
    assert!(matches!(fluid.step(), Err(Error::Failure(_))));
}
