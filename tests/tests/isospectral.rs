//! Fluids as matrices: the generated models of the same fluid, Casimirs, order, symmetry, and motions of the sphere
//! that are known.

use hamel_models::generated::{zeitlin_euler_3, zeitlin_euler_5, zeitlin_euler_7};
use hamel_runtime::matrices::{IsospectralMidpoint, Laplacian, Options, Sphere, Torus};
use hamel_runtime::{Error, Failure, Integrator, Scene, StateVector, Vern9};
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

fn random_modes(n: usize, seed: u64) -> Vec<f64> {
    let mut random = Random(seed);
    (0..n * n - 1).map(|_| random.number() - 0.5).collect()
}

/// A flow of random spherical harmonics up to the degree `most`.
fn stir(sphere: &OnSphere, solver: &mut Solver<'_, OnSphere>, most: usize, seed: u64) {
    let mut random = Random(seed);
    for l in 1..=most.min(sphere.n() - 1) {
        for m in 0..=l {
            let omega = [random.number() - 0.5, random.number() - 0.5];
            sphere.add_mode((l, m), omega, solver.vorticity_mut());
        }
    }
}

fn elements<L: Laplacian>(solver: &Solver<'_, L>) -> Vec<f64> {
    let (n, w) = (solver.surface().n(), solver.vorticity());
    (0..n * n).flat_map(|at| w.get(at / n, at % n)).collect()
}

fn distance(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).map(|(x, y)| (x - y) * (x - y)).sum::<f64>().sqrt()
}

fn norm(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Largest change of a Casimir, each relative to the power of the root mean square of the spectrum.
fn drift(before: &[f64], after: &[f64]) -> f64 {
    let scale = before[1].sqrt();
    let of = |k: usize| (after[k] - before[k]).abs() / scale.powi(k as i32 + 1);
    (0..before.len()).map(of).fold(0.0, f64::max)
}

/// Derivative, energy and Casimirs of the matrix are those of the generated scene.
fn agrees<S: Scene<f64>>(n: usize, zeros: S::State) {
    let scene = S::prepare(&[]).unwrap_or_else(|e| panic!("{e}"));
    let surface = torus(n);
    let mut solver = solver(&surface, Options::fixed(0.1));
    let has_casimirs = |o: &&hamel_runtime::OutputInfo| o.name == "casimirs";
    let casimirs = S::INFO.outputs.iter().find(has_casimirs).map_or(0, |o| o.components.len());
    assert!(casimirs == n - 1 || n > 5, "{n}: {casimirs} Casimirs");
    for seed in 0..20 {
        let modes = random_modes(n, seed);
        let mut state = zeros.clone();
        state.as_mut_slice().copy_from_slice(&modes);
        let mut rates = zeros.clone();
        scene.rhs(0.0, &state, &mut rates);
        surface.set_modes(&modes, solver.vorticity_mut());

        let mut back = vec![0.0; modes.len()];
        surface.modes(solver.vorticity(), &mut back);
        assert!(distance(&back, &modes) < 1e-14 * norm(&modes), "{n}: modes");

        let mut found = vec![0.0; modes.len()];
        surface.modes(solver.derivative(), &mut found);
        let largest = rates.as_slice().iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        assert!(largest > 0.01, "{n}: nothing moves");
        for (k, (found, rate)) in found.iter().zip(rates.as_slice()).enumerate() {
            assert!((found - rate).abs() < 1e-13 * largest, "{n}: rate {k} is {found}, generated {rate}");
        }

        let energy = scene.energy_of(0.0, &state).expect("an energy");
        assert!((solver.energy() / energy - 1.0).abs() < 1e-13, "{n}: energy");
        let mut outputs = vec![0.0; S::INFO.n_outputs()];
        scene.outputs_of(0.0, &state, &mut outputs);
        let at: usize =
            S::INFO.outputs.iter().take_while(|o| o.name != "casimirs").map(|o| o.components.len()).sum();
        let mut traces = vec![0.0; casimirs + 1];
        solver.casimirs(&mut traces);
        // C_1 = 0 is none of the scene's.
        assert!(traces[0].abs() < 1e-14, "{n}: trace");
        for (k, (found, output)) in traces[1..].iter().zip(&outputs[at..]).enumerate() {
            let scale = traces[1].powf(0.5 * (k + 2) as f64);
            assert!((found - output).abs() < 1e-13 * scale, "{n}: C{} is {found}, generated {output}", k + 2);
        }
    }
}

#[test]
fn matrices_move_as_the_generated_modes() {
    agrees::<zeitlin_euler_3::Prepared<f64>>(3, [0.0; 8]);
    agrees::<zeitlin_euler_5::Prepared<f64>>(5, [0.0; 24]);
    agrees::<zeitlin_euler_7::Prepared<f64>>(7, [0.0; 48]);
}

/// The order is two, against the generated equations integrated by another method.
#[test]
fn the_order_is_two() {
    let scene = zeitlin_euler_5::Prepared::<f64>::prepare(&[]).unwrap_or_else(|e| panic!("{e}"));
    let modes = random_modes(5, 3);
    let start: [f64; 24] = modes.clone().try_into().expect("24 modes");
    let end = 2.0;
    let options = hamel_runtime::Options::adaptive(1e-13, 1e-13);
    let mut other = Integrator::new(&scene, Vern9, 0.0, start, options).unwrap_or_else(|e| panic!("{e}"));
    other.integrate_to(end).unwrap_or_else(|e| panic!("{e}"));

    let surface = torus(5);
    let error = |n_steps: u32| {
        let mut solver = solver(&surface, Options::fixed(end / f64::from(n_steps)));
        surface.set_modes(&modes, solver.vorticity_mut());
        solver.integrate_to(end).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!((solver.t(), solver.stats().steps), (end, u64::from(n_steps)));
        let mut found = vec![0.0; modes.len()];
        surface.modes(solver.vorticity(), &mut found);
        distance(&found, other.state())
    };
    let errors = [100, 200, 400, 800].map(error);
    assert!(distance(&modes, other.state()) > 0.1, "nothing moves");
    for pair in errors.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!((order - 2.0).abs() < 0.02, "order {order}, errors {errors:?}");
    }
    assert!(errors[3] < 1e-4, "{errors:?}");
}

#[test]
fn casimirs_are_kept_to_round_off() {
    let surface = torus(7);
    let mut on_torus = solver(&surface, Options::fixed(0.05));
    surface.set_modes(&random_modes(7, 5), on_torus.vorticity_mut());
    let (mut before, mut after) = ([0.0; 7], [0.0; 7]);
    on_torus.casimirs(&mut before);
    let energy = on_torus.energy();
    for _ in 0..20_000 {
        on_torus.step().unwrap_or_else(|e| panic!("{e}"));
    }
    on_torus.casimirs(&mut after);
    // Rounding errors of 20 000 steps add up as a random walk: 140 units in the last place of the spectrum at most, a
    // few of the size of a step in fact; of the seventh power seven times as many.
    assert!(drift(&before, &after) < 5e-14, "{before:?}, {after:?}");
    assert!((on_torus.energy() / energy - 1.0).abs() < 1e-3, "energy {energy}, {}", on_torus.energy());

    for n in [2, 8, 12, 33] {
        let surface = sphere(n);
        let mut on_sphere = solver(&surface, Options::fixed(0.02));
        stir(&surface, &mut on_sphere, 6, 11);
        on_sphere.casimirs(&mut before);
        for _ in 0..500 {
            on_sphere.step().unwrap_or_else(|e| panic!("{e}"));
        }
        on_sphere.casimirs(&mut after);
        assert!(drift(&before, &after) < 1e-14, "{n}: {before:?}, {after:?}");
    }
}

/// The error of the energy is one of the order of the method, and does not grow.
#[test]
fn energy_is_nearly_kept() {
    let surface = sphere(16);
    let worst = |h: f64| {
        let mut solver = solver(&surface, Options::fixed(h));
        stir(&surface, &mut solver, 5, 2);
        let energy = solver.energy();
        let mut worst = 0.0_f64;
        while solver.t() < 40.0 {
            solver.step().unwrap_or_else(|e| panic!("{e}"));
            worst = worst.max((solver.energy() / energy - 1.0).abs());
        }
        worst
    };
    let (coarse, fine) = (worst(0.04), worst(0.02));
    assert!(coarse < 1e-3 && (3.0..5.0).contains(&(coarse / fine)), "{coarse:e}, {fine:e}");
}

#[test]
fn steps_forwards_and_backwards_meet() {
    let surface = sphere(11);
    let mut solver = solver(&surface, Options::fixed(0.05));
    stir(&surface, &mut solver, 10, 7);
    let start = elements(&solver);
    // The last step is shortened.
    solver.integrate_to(3.01).unwrap_or_else(|e| panic!("{e}"));
    assert!(distance(&elements(&solver), &start) > 0.1 * norm(&start));
    solver.integrate_to(3.0).unwrap_or_else(|e| panic!("{e}"));
    solver.integrate_to(0.0).unwrap_or_else(|e| panic!("{e}"));
    assert!(distance(&elements(&solver), &start) < 1e-12 * norm(&start));
}

/// A tolerance costs Casimirs what it saves iterations.
#[test]
fn a_tolerance_ends_the_iteration() {
    let surface = sphere(24);
    let run = |options: Options| {
        let mut solver = solver(&surface, options);
        stir(&surface, &mut solver, 8, 3);
        let (mut before, mut after) = ([0.0; 4], [0.0; 4]);
        solver.casimirs(&mut before);
        solver.integrate_to(2.0).unwrap_or_else(|e| panic!("{e}"));
        solver.casimirs(&mut after);
        (solver.stats().iterations, drift(&before, &after))
    };
    let options = Options::fixed(0.02);
    let (exact, loose) = (run(options), run(options.with_tolerance(1e-8)));
    assert!(2 * loose.0 < exact.0, "{exact:?}, {loose:?}");
    assert!(exact.1 < 1e-14 && loose.1 > exact.1 && loose.1 < 1e-7, "{exact:?}, {loose:?}");
    // What is extrapolated is where the iteration begins, not where it ends.
    let without = run(options.with_history(0));
    assert!(without.0 > exact.0 && without.1 < 1e-14, "{exact:?}, {without:?}");
}

#[test]
fn harmonics_are_orthonormal_eigenvectors() {
    for n in [2, 3, 8, 17, 64] {
        let surface = sphere(n);
        let mut solver = solver(&surface, Options::fixed(0.1));
        let m_of = |l: usize| if l < 5 { (0..=l).collect() } else { vec![0, 1, l / 2, l - 1, l] };
        for l in [1, 2, 3, n / 2, n - 2, n - 1].into_iter().filter(|l| (1..n).contains(l)) {
            for m in m_of(l) {
                solver.vorticity_mut();
                let old = elements(&solver);
                assert!(norm(&old) == 0.0);
                surface.add_mode((l, m), [0.6, 0.8], solver.vorticity_mut());
                let im = if m == 0 { 0.0 } else { 0.8 };
                let [x, y] = surface.mode((l, m), solver.vorticity());
                assert!((x - 0.6).abs() < 1e-12 && (y - im).abs() < 1e-12, "{n}: {l}, {m}: {x}, {y}");
                // The stream function is the vorticity over l (l + 1).
                let eigenvalue = (l * (l + 1)) as f64;
                let [x, y] = surface.mode((l, m), solver.stream());
                let off = (x * eigenvalue - 0.6).abs() + (y * eigenvalue - im).abs();
                assert!(off < 1e-11, "{n}: {l}, {m}: {x}, {y}");
                for other in [l - 1, l + 1, l + 2].into_iter().filter(|k| (m..n).contains(k)) {
                    let [x, y] = surface.mode((other, m), solver.vorticity());
                    assert!(x.abs() + y.abs() < 1e-12, "{n}: {l}, {other}, {m}: {x}, {y}");
                }
                surface.add_mode((l, m), [-0.6, -0.8], solver.vorticity_mut());
            }
        }
    }
}

/// Flows along the circles of latitude are steady.
#[test]
fn zonal_flows_stay() {
    let surface = sphere(20);
    let mut solver = solver(&surface, Options::fixed(0.05));
    for l in 1..20 {
        surface.add_mode((l, 0), [1.0 / l as f64, 0.0], solver.vorticity_mut());
    }
    let start = elements(&solver);
    for _ in 0..200 {
        solver.step().unwrap_or_else(|e| panic!("{e}"));
    }
    assert!(distance(&elements(&solver), &start) < 1e-13 * norm(&start));
}

/// A wave of Rossby and Haurwitz turns about the axis: with `psi = a Y_10/2 + b Y_lm/(l (l + 1))` the phase of
/// `omega_lm` moves by `omega_t = {psi, omega}` at the rate `-m a sqrt(3/(4 pi)) (1/2 - 1/(l (l + 1)))`, as on the
/// sphere, for `Y_10` is a coordinate, and the bracket with it a turn whatever `N` is.
#[test]
fn waves_of_rossby_and_haurwitz_turn() {
    let (a, l, m) = (1.5, 4, 3);
    for n in [6, 16] {
        let surface = sphere(n);
        let mut solver = solver(&surface, Options::fixed(5e-4));
        surface.add_mode((1, 0), [a, 0.0], solver.vorticity_mut());
        surface.add_mode((l, m), [0.2, 0.0], solver.vorticity_mut());
        solver.integrate_to(1.0).unwrap_or_else(|e| panic!("{e}"));
        let coordinate = (3.0 / (4.0 * std::f64::consts::PI)).sqrt();
        let rate = -(m as f64) * a * coordinate * (0.5 - 1.0 / (l * (l + 1)) as f64);
        let [re, im] = surface.mode((l, m), solver.vorticity());
        assert!((re.hypot(im) - 0.2).abs() < 1e-12, "{n}");
        assert!((im.atan2(re) - rate).abs() < 1e-6, "{n}: {}, {rate}", im.atan2(re));
        assert!((surface.mode((1, 0), solver.vorticity())[0] - a).abs() < 1e-13, "{n}");
    }
}

/// Of lengths with one prime factor, with several, and with a large one.
#[test]
fn every_odd_size_has_the_same_flow_of_two_waves() {
    // omega = cos x and a weak wave beside it: the bracket of waves of small numbers is nearly that of functions.
    for n in [9, 15, 45, 53, 63] {
        let surface = torus(n);
        let mut solver = solver(&surface, Options::fixed(0.01));
        let mut modes = vec![0.0; n * n - 1];
        let half = n / 2;
        let place = |m1: usize, m2: isize| {
            let before = if m1 == 0 { 0 } else { half + (m1 - 1) * n + half };
            2 * (before as isize + if m1 == 0 { m2 - 1 } else { m2 }) as usize
        };
        (modes[place(1, 0)], modes[place(1, 1)]) = (0.5, 0.25);
        surface.set_modes(&modes, solver.vorticity_mut());
        let mut rates = vec![0.0; n * n - 1];
        surface.modes(solver.derivative(), &mut rates);
        // omega_(2, 1)' = S((1, 0), (1, 1)) (1/1 - 1/2) omega_(1, 0) omega_(1, 1), and the same for the difference.
        let constant = n as f64 / std::f64::consts::TAU * (std::f64::consts::TAU / n as f64).sin();
        let found = rates[place(2, 1)];
        assert!((found - constant * 0.5 * 0.125).abs() < 1e-13, "{n}: {found}");
        let n_moving = rates.iter().filter(|x| x.abs() > 1e-12).count();
        assert_eq!(n_moving, 2, "{n}");
    }
}

#[test]
fn what_cannot_be_done_is_said() {
    let error = |n: usize| Torus::new(n, vec![0.0; 1000]).map(|_| ()).unwrap_err();
    assert!(
        matches!(error(8), Error::MatrixSize { n: 8, .. }) && matches!(error(1), Error::MatrixSize { .. })
    );
    assert!(matches!(
        Sphere::new(1, vec![0.0; 1000]).map(|_| ()).unwrap_err(),
        Error::MatrixSize { n: 1, .. }
    ));
    assert!(matches!(error(63), Error::Storage { given: 1000, .. }));
    let surface = sphere(8);
    let small = IsospectralMidpoint::new(&surface, vec![0.0; 10], 0.0, Options::fixed(0.1)).map(|_| ());
    assert!(matches!(small.unwrap_err(), Error::Storage { given: 10, .. }));
    assert!(matches!(Options::fixed(-1.0).validate(), Err(Error::StepSize { .. })));
    assert!(Options::fixed(1.0).with_tolerance(f64::NAN).validate().is_err());

    // Steps far too long: the state before is kept, and shorter steps go on.
    let mut solver = solver(&surface, Options::fixed(50.0));
    stir(&surface, &mut solver, 5, 1);
    let start = elements(&solver);
    let failed = solver.step().unwrap_err();
    assert!(
        matches!(failed, Error::NotConverged { .. } | Error::Failure(Failure::NonFinite { .. })),
        "{failed}"
    );
    assert!(elements(&solver) == start && solver.t() == 0.0 && solver.stats().steps == 0);
    solver.integrate_to(0.01).unwrap_or_else(|e| panic!("{e}"));

    solver.vorticity_mut().set(2, 5, [f64::NAN, 0.0]);
    assert!(matches!(solver.step(), Err(Error::Failure(Failure::NonFinite { .. }))));
    assert!(matches!(solver.integrate_to(f64::INFINITY), Err(Error::TimeNotFinite { .. })));
}
