//! Fluids of matrices with a radius of deformation, a background that turns, friction and forces: against exact
//! solutions.

use hamel_runtime::Error;
use hamel_runtime::matrices::{
    Damped, Friction, IsospectralMidpoint, Laplacian, Options, Sphere, Stream, Torus,
};
use hamel_tests::random::Random;

type OnTorus = Torus<Vec<f64>>;
type OnSphere = Sphere<Vec<f64>>;
type Solver<'s, L> = IsospectralMidpoint<'s, L, Vec<f64>>;

fn torus(n: usize, stream: Stream) -> OnTorus {
    Torus::with_stream(n, stream, vec![0.0; OnTorus::storage(n)]).unwrap_or_else(|e| panic!("{e}"))
}

fn sphere(n: usize, stream: Stream) -> OnSphere {
    Sphere::with_stream(n, stream, vec![0.0; OnSphere::storage(n)]).unwrap_or_else(|e| panic!("{e}"))
}

fn solver<L: Laplacian>(surface: &L, options: Options) -> Solver<'_, L> {
    let room = vec![0.0; Solver::<L>::storage(surface.n(), &options)];
    IsospectralMidpoint::new(surface, room, 0.0, options).unwrap_or_else(|e| panic!("{e}"))
}

fn damped<L: Laplacian>(surface: &L, options: Options, friction: Friction) -> Damped<'_, L, Vec<f64>> {
    let room = vec![0.0; Damped::<L, Vec<f64>>::storage(surface.n())];
    Damped::new(solver(surface, options), friction, room).unwrap_or_else(|e| panic!("{e}"))
}

fn random(n: usize, seed: u64) -> Vec<f64> {
    let mut random = Random(seed);
    (0..n * n - 1).map(|_| random.number() - 0.5).collect()
}

fn off(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max)
}

/// `|m|^2` of each number of the state on the torus.
fn squares(n: usize) -> Vec<f64> {
    let largest = (n / 2) as i64;
    let waves = (0..=largest).flat_map(|m1| {
        (if m1 == 0 { 1 } else { -largest }..=largest).map(move |m2| (m1 * m1 + m2 * m2) as f64)
    });
    waves.flat_map(|square| [square, square]).collect()
}

/// `l (l + 1)` of each number of the state on the sphere.
fn degrees(n: usize) -> Vec<f64> {
    (1..n).flat_map(|l| std::iter::repeat_n((l * (l + 1)) as f64, 2 * l + 1)).collect()
}

#[test]
fn the_stream_function_has_a_factor_and_a_radius_of_deformation() {
    let stream = Stream::ideal().with_scale(-1.5).with_shift(0.7);
    for n in [3, 9, 15] {
        let (surface, omega) = (torus(n, stream), random(n, 3));
        let mut solver = solver(&surface, Options::fixed(0.1));
        surface.set_modes(&omega, solver.vorticity_mut());
        let mut psi = vec![0.0; omega.len()];
        surface.modes(solver.stream(), &mut psi);
        let expected: Vec<f64> = omega.iter().zip(squares(n)).map(|(w, s)| -1.5 * w / (0.7 + s)).collect();
        assert!(off(&psi, &expected) < 1e-14, "{n}: {psi:?}");
    }
    for n in [2, 8, 17] {
        let (surface, omega) = (sphere(n, stream), random(n, 4));
        let mut solver = solver(&surface, Options::fixed(0.1));
        surface.set_modes(&omega, solver.vorticity_mut());
        let mut psi = vec![0.0; omega.len()];
        surface.modes(solver.stream(), &mut psi);
        let expected: Vec<f64> = omega.iter().zip(degrees(n)).map(|(w, s)| -1.5 * w / (0.7 + s)).collect();
        assert!(off(&psi, &expected) < 1e-13, "{n}: {psi:?}");
    }
    for bad in [
        Stream::ideal().with_scale(0.0),
        Stream::ideal().with_shift(-1.0),
        Stream::ideal().with_shift(f64::NAN),
    ] {
        let refused = Torus::with_stream(9, bad, vec![0.0; OnTorus::storage(9)]).map(|_| ()).unwrap_err();
        assert!(matches!(refused, Error::Number { .. }), "{refused}");
        assert!(Sphere::with_stream(9, bad, vec![0.0; OnSphere::storage(9)]).is_err());
    }
}

/// Elements of eigenvectors grow by `2^N` and more from the end of a diagonal to its middle.
#[test]
fn harmonics_of_large_matrices_are_finite() {
    for (n, l, m) in [(1024, 1023, 0), (1024, 1022, 3), (1500, 1499, 0)] {
        let surface = sphere(n, Stream::ideal());
        let mut solver = solver(&surface, Options::fixed(0.1).with_history(0));
        surface.add_mode((l, m), [0.6, 0.0], solver.vorticity_mut());
        let [x, y] = surface.mode((l, m), solver.vorticity());
        assert!((x - 0.6).abs() < 1e-11 && y == 0.0, "{n}: {l}, {m}: {x}, {y}");
        let [x, _] = surface.mode((l, m), solver.stream());
        assert!((x * (l * (l + 1)) as f64 - 0.6).abs() < 1e-10, "{n}: {l}, {m}: {x}");
    }
}

/// In a frame that turns with the sphere one wave of Rossby and Haurwitz moves by `-2 Omega m/(l (l + 1))`, whatever
/// its size; with a radius of deformation by `-2 Omega m/(F + l (l + 1))`. The vorticity is the absolute one.
#[test]
fn waves_move_by_the_frequency_of_rossby_and_haurwitz() {
    let (rotation, l, m) = (1.3, 4, 3);
    // z is Y_10 over this.
    let coordinate = (3.0 / (4.0 * std::f64::consts::PI)).sqrt();
    for (n, shift) in [(6, 0.0), (16, 0.0), (16, 2.5)] {
        let surface = sphere(n, Stream::ideal().with_shift(shift));
        let mut solver = solver(&surface, Options::fixed(1e-3).with_background());
        // Absolute vorticity 2 Omega z, whose stream function is 2 Omega z/(2 + F); in the frame there is none.
        surface.add_mode((1, 0), [2.0 * rotation / coordinate, 0.0], solver.vorticity_mut());
        let psi = -2.0 * rotation / ((2.0 + shift) * coordinate);
        surface.add_mode((1, 0), [psi, 0.0], solver.background_mut());
        surface.add_mode((l, m), [0.2, 0.0], solver.vorticity_mut());
        let energy = solver.energy();
        solver.integrate_to(1.0).unwrap_or_else(|e| panic!("{e}"));
        let rate = 2.0 * rotation * m as f64 / (shift + (l * (l + 1)) as f64);
        let [re, im] = surface.mode((l, m), solver.vorticity());
        assert!((re.hypot(im) - 0.2).abs() < 1e-12, "{n}");
        assert!((im.atan2(re) - rate).abs() < 1e-6, "{n}: {}, {rate}", im.atan2(re));
        assert!((solver.energy() / energy - 1.0).abs() < 1e-12);
    }
}

/// Without motion, friction and force are solved exactly, whatever the step: here a mode alone, which is steady.
#[test]
fn modes_decay_at_their_rates_towards_what_the_force_sustains() {
    let friction = Friction::none().with(0, -0.02).with(1, 0.01).with(2, 1e-4);
    let expected = |eigenvalue: f64, t: f64| {
        let d = -0.02 + 0.01 * eigenvalue + 1e-4 * eigenvalue * eigenvalue;
        (-d * t).exp() * 0.6 + 0.3 * (1.0 - (-d * t).exp()) / d
    };
    for (n, (l, m)) in [(5, (2, 1)), (16, (7, 0)), (33, (30, 12)), (64, (63, 0)), (64, (40, 40))] {
        let surface = sphere(n, Stream::ideal());
        let mut fluid = damped(&surface, Options::fixed(0.7), friction);
        surface.add_real_mode((l, m), [0.6, 0.0], fluid.fluid_mut().vorticity_mut());
        surface.add_real_mode((l, m), [0.3, 0.0], fluid.force_mut());
        fluid.integrate_to(2.0).unwrap_or_else(|e| panic!("{e}"));
        let [x, _] = surface.real_mode((l, m), fluid.fluid().vorticity());
        let right = expected((l * (l + 1)) as f64, 2.0);
        assert!((x - right).abs() < 1e-11 * (1.0 + right.abs()), "{n}: {l}, {m}: {x}, {right}");
    }
    for (n, wave) in [(5, (1, 2)), (15, (0, 7)), (33, (16, -9))] {
        let surface = torus(n, Stream::ideal());
        let mut fluid = damped(&surface, Options::fixed(0.7), friction);
        surface.add_mode(wave, [0.6, 0.0], fluid.fluid_mut().vorticity_mut());
        surface.add_mode(wave, [0.3, 0.0], fluid.force_mut());
        fluid.integrate_to(2.0).unwrap_or_else(|e| panic!("{e}"));
        let [x, _] = surface.mode(wave, fluid.fluid().vorticity());
        let right = expected((wave.0 * wave.0 + wave.1 * wave.1) as f64, 2.0);
        assert!((x - right).abs() < 1e-11 * (1.0 + right.abs()), "{n}: {wave:?}: {x}, {right}");
    }
}

/// The derivative has friction and force mode by mode, beside what the ideal fluid has.
#[test]
fn the_derivative_has_friction_and_force() {
    let friction = Friction::none().with(0, 0.3).with(1, 0.2).with(3, 1e-3);
    let d = |eigenvalue: f64| 0.3 + 0.2 * eigenvalue + 1e-3 * eigenvalue.powi(3);
    for n in [2, 7, 20] {
        let (surface, omega, force) = (sphere(n, Stream::ideal()), random(n, 5), random(n, 6));
        let mut fluid = damped(&surface, Options::fixed(0.1), friction);
        surface.set_modes(&omega, fluid.fluid_mut().vorticity_mut());
        surface.set_modes(&force, fluid.force_mut());
        let (mut ideal, mut all) = (vec![0.0; omega.len()], vec![0.0; omega.len()]);
        surface.modes(fluid.derivative(), &mut all);
        surface.modes(fluid.fluid_mut().derivative(), &mut ideal);
        let rest: Vec<f64> = all.iter().zip(&ideal).map(|(x, y)| x - y).collect();
        let expected: Vec<f64> =
            (omega.iter().zip(&force).zip(degrees(n))).map(|((w, f), s)| f - d(s) * w).collect();
        let largest = expected.iter().fold(0.0_f64, |a, x| a.max(x.abs()));
        assert!(off(&rest, &expected) < 1e-12 * largest, "{n}: {}", off(&rest, &expected));
    }
}

/// Order two with everything; Casimirs change by friction and force alone; steps forwards and backwards meet.
#[test]
fn steps_with_friction_are_of_second_order_and_symmetric() {
    let run = |step: f64, back: bool| {
        let surface = torus(15, Stream::ideal().with_shift(1.0));
        let friction = Friction::none().with(1, 0.02);
        let mut fluid = damped(&surface, Options::fixed(step).with_background(), friction);
        let start: Vec<f64> = random(15, 9).iter().zip(squares(15)).map(|(x, s)| x / (1.0 + s)).collect();
        surface.set_modes(&start, fluid.fluid_mut().vorticity_mut());
        surface.add_mode((0, 1), [0.4, 0.1], fluid.fluid_mut().background_mut());
        surface.add_mode((2, -1), [0.3, 0.0], fluid.force_mut());
        fluid.integrate_to(1.0).unwrap_or_else(|e| panic!("{e}"));
        if back {
            fluid.integrate_to(0.0).unwrap_or_else(|e| panic!("{e}"));
        }
        let mut modes = vec![0.0; start.len()];
        surface.modes(fluid.fluid().vorticity(), &mut modes);
        if back { off(&modes, &start) } else { modes.iter().map(|x| x * x).sum() }
    };
    let [a, b, c] = [0.1, 0.05, 0.025].map(|step| run(step, false));
    let ratio = (a - b) / (b - c);
    assert!((3.7..4.3).contains(&ratio), "{ratio}");
    assert!(run(0.05, true) < 1e-12);
}

/// A step may be as long as it likes for friction, and growth that overflows is an error.
#[test]
fn viscosity_may_be_stiff_and_growth_ends_with_an_error() {
    let surface = torus(31, Stream::ideal());
    let mut fluid = damped(&surface, Options::fixed(1.0), Friction::none().with(1, 1e4));
    surface.add_mode((7, -3), [0.6, 0.0], fluid.fluid_mut().vorticity_mut());
    surface.add_mode((7, -3), [0.3, 0.0], fluid.force_mut());
    fluid.integrate_to(2.0).unwrap_or_else(|e| panic!("{e}"));
    let [x, _] = surface.mode((7, -3), fluid.fluid().vorticity());
    assert!((x / (0.3 / 58e4) - 1.0).abs() < 1e-9, "{x:e}");

    // The first half of the step is finite.
    let mut fluid = damped(&surface, Options::fixed(1.0), Friction::none().with(0, -1000.0));
    surface.add_mode((1, 0), [0.5, 0.0], fluid.fluid_mut().vorticity_mut());
    assert!(matches!(fluid.step().unwrap_err(), Error::Failure(_)));
    assert_eq!(fluid.fluid().t(), 0.0);
    let [x, _] = surface.mode((1, 0), fluid.fluid().vorticity());
    assert!((x - 0.5).abs() < 1e-15);
}

#[test]
fn a_step_that_fails_keeps_the_vorticity_before() {
    let surface = sphere(8, Stream::ideal());
    let mut fluid = damped(&surface, Options::fixed(50.0), Friction::none().with(1, 0.01));
    surface.set_modes(&random(8, 2), fluid.fluid_mut().vorticity_mut());
    let (mut before, mut after) = (vec![0.0; 63], vec![0.0; 63]);
    surface.modes(fluid.fluid().vorticity(), &mut before);
    fluid.step().unwrap_err();
    surface.modes(fluid.fluid().vorticity(), &mut after);
    assert_eq!(before, after);
    let bad = Friction::none().with(2, f64::INFINITY);
    let room = vec![0.0; Damped::<OnSphere, Vec<f64>>::storage(8)];
    let refused = Damped::new(solver(&surface, Options::fixed(0.1)), bad, room).map(|_| ()).unwrap_err();
    assert!(matches!(refused, Error::Number { .. }), "{refused}");
}
