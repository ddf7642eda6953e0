//! Fluids as matrices: the isospectral midpoint rule of the runtime on flows that other programs are given, too.
//!
//! A flow has the spherical harmonics up to the degree 10, or the waves up to the length 10, with random coefficients,
//! and the step that quflow estimates for it: a tenth of pi over the norm of the stream matrix, in its units of time.
//!
//! Does not know: other programs, how results are shown.

use std::fmt::Write as _;
use std::path::Path;
use std::time::{Duration, Instant};

use hamel_runtime::matrices::{IsospectralMidpoint, Laplacian, Options, Sphere, Torus};

/// Sizes on the sphere.
pub const SPHERE: [usize; 8] = [5, 7, 9, 16, 32, 64, 128, 256];
/// Sizes on the torus.
pub const TORUS: [usize; 8] = [5, 7, 9, 15, 33, 65, 129, 255];
/// Tolerances of the iteration: to round-off, about that which quflow takes unless it is told, and one that leaves
/// errors of the size of its own.
const TOLERANCES: [f64; 3] = [0.0, 1e-8, 1e-7];
/// Steps after which errors are told.
const STEPS_OF_ERROR: u32 = 16;
/// Steps of the reference for each of them.
const FINER: u32 = 16;
/// Steps of the long run, at `N = 7`.
const LONG: u32 = 1_000_000;
const ROUND: Duration = Duration::from_millis(2);
/// Least number of steps of a round.
const STEPS_OF_ROUND: u32 = 16;

type Solver<'s, L> = IsospectralMidpoint<'s, L, Vec<f64>>;

/// A flow, as a matrix with its step.
struct Flow<'s, L> {
    surface: &'s L,
    /// Sets the vorticity.
    start: &'s dyn Fn(&mut Solver<'_, L>),
    h: f64,
}

/// What was measured of one size and tolerance.
pub struct Measured {
    /// `sphere` or `torus`.
    pub surface: &'static str,
    /// Size of the matrices.
    pub n: usize,
    /// Tolerance of the iteration.
    pub tolerance: f64,
    /// Nanoseconds of a step, in the fastest round.
    pub ns: f64,
    /// Iterations of a step.
    pub iterations: f64,
    /// Distance from the reference after 16 steps, relative.
    pub error: f64,
    /// Largest drift of a Casimir.
    pub drift: f64,
}

/// A number between -1/2 and 1/2, the next of a fixed sequence.
fn random(seed: &mut u64) -> f64 {
    *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*seed >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
}

fn stir_sphere(sphere: &Sphere<Vec<f64>>, solver: &mut Solver<'_, Sphere<Vec<f64>>>) {
    let mut seed = 7;
    for l in 1..sphere.n().min(11) {
        for m in 0..=l {
            let omega = [random(&mut seed), random(&mut seed)];
            sphere.add_mode((l, m), omega, solver.vorticity_mut());
        }
    }
}

fn stir_torus(torus: &Torus<Vec<f64>>, solver: &mut Solver<'_, Torus<Vec<f64>>>) {
    let half = (torus.n() / 2) as i64;
    let (mut seed, mut modes) = (7, Vec::new());
    for m1 in 0..=half {
        for m2 in (if m1 == 0 { 1 } else { -half })..=half {
            let is_long = m1 * m1 + m2 * m2 <= 100;
            modes.extend([0; 2].map(|_| if is_long { random(&mut seed) } else { 0.0 }));
        }
    }
    torus.set_modes(&modes, solver.vorticity_mut());
}

fn solver<'s, L: Laplacian>(flow: &Flow<'s, L>, options: Options) -> Result<Solver<'s, L>, String> {
    let room = vec![0.0; Solver::<L>::storage(flow.surface.n(), &options)];
    let mut solver = IsospectralMidpoint::new(flow.surface, room, 0.0, options).map_err(|e| e.to_string())?;
    (flow.start)(&mut solver);
    Ok(solver)
}

impl<'s, L: Laplacian> Flow<'s, L> {
    fn new(surface: &'s L, start: &'s dyn Fn(&mut Solver<'_, L>)) -> Result<Self, String> {
        let mut flow = Flow { surface, start, h: 1.0 };
        let mut probe = solver(&flow, Options::fixed(1.0))?;
        let (n, stream) = (surface.n(), probe.stream());
        let row = |i: usize| -> f64 { (0..n).map(|j| stream.get(i, j)).map(|[re, im]| re.hypot(im)).sum() };
        let norm = (0..n).map(row).fold(0.0, f64::max);
        flow.h = 0.1 * std::f64::consts::PI / (norm * surface.rate().abs());
        Ok(flow)
    }

    /// Elements after [`STEPS_OF_ERROR`] steps, each divided into some.
    fn end(&self, divided: u32, tolerance: f64) -> Result<Vec<f64>, String> {
        let options = Options::fixed(self.h / f64::from(divided)).with_tolerance(tolerance);
        let mut solver = solver(self, options)?;
        for _ in 0..STEPS_OF_ERROR * divided {
            solver.step().map_err(|e| e.to_string())?;
        }
        Ok(elements(&solver))
    }

    fn drift(&self, steps: u32, tolerance: f64, most: usize) -> Result<f64, String> {
        let mut solver = solver(self, Options::fixed(self.h).with_tolerance(tolerance))?;
        let (mut before, mut after) = (vec![0.0; most], vec![0.0; most]);
        solver.casimirs(&mut before);
        for _ in 0..steps {
            solver.step().map_err(|e| e.to_string())?;
        }
        solver.casimirs(&mut after);
        let of = |k: usize| (after[k] - before[k]).abs() / before[1].powf(0.5 * (k + 1) as f64);
        Ok((1..most).map(of).fold(0.0, f64::max))
    }

    /// Nanoseconds and iterations of a step.
    fn time(&self, rounds: u32, tolerance: f64) -> Result<(f64, f64), String> {
        let mut solver = solver(self, Options::fixed(self.h).with_tolerance(tolerance))?;
        let mut fastest = f64::INFINITY;
        for round in 0..=rounds {
            let (clock, mut steps) = (Instant::now(), 0);
            while steps == 0 || clock.elapsed() < ROUND {
                // So many that reading the clock does not count, and that steps of more and of fewer iterations do.
                for _ in 0..STEPS_OF_ROUND {
                    solver.step().map_err(|e| e.to_string())?;
                    steps += 1;
                }
            }
            // The first one fills caches and the history.
            if round > 0 {
                fastest = fastest.min(clock.elapsed().as_nanos() as f64 / f64::from(steps));
            }
        }
        let stats = solver.stats();
        Ok((fastest, stats.iterations as f64 / stats.steps as f64))
    }

    fn measure(
        &self,
        surface: &'static str,
        rounds: u32,
        reference: &[f64],
        mut take: impl FnMut(Measured),
    ) -> Result<(), String> {
        let n = self.surface.n();
        for tolerance in TOLERANCES {
            let (ns, iterations) = self.time(rounds, tolerance)?;
            let error = distance(&self.end(1, tolerance)?, reference);
            let drift = self.drift(steps_of_drift(n), tolerance, 5)?;
            take(Measured { surface, n, tolerance, ns, iterations, error, drift });
        }
        Ok(())
    }
}

/// Steps after which the drift of Casimirs is told.
pub const fn steps_of_drift(n: usize) -> u32 {
    if n <= 64 { 1000 } else { 100 }
}

fn elements<L: Laplacian>(solver: &Solver<'_, L>) -> Vec<f64> {
    let (n, vorticity) = (solver.surface().n(), solver.vorticity());
    (0..n * n).flat_map(|at| vorticity.get(at / n, at % n)).collect()
}

fn distance(x: &[f64], y: &[f64]) -> f64 {
    let difference: f64 = x.iter().zip(y).map(|(x, y)| (x - y).powi(2)).sum();
    (difference / y.iter().map(|y| y * y).sum::<f64>()).sqrt()
}

/// Measures all sizes, and writes the flows on the sphere into files `<n>.txt` for other programs: size, step and rate
/// on the first line, then real and imaginary part of each element at the start, then at the end of the reference.
///
/// # Errors
/// What a solver says, or that a file cannot be written.
pub fn measure(rounds: u32, folder: &Path, mut take: impl FnMut(Measured)) -> Result<(), String> {
    for n in SPHERE {
        let surface = Sphere::new(n, vec![0.0; Sphere::<Vec<f64>>::storage(n)]).map_err(|e| e.to_string())?;
        let start = |solver: &mut Solver<'_, Sphere<Vec<f64>>>| stir_sphere(&surface, solver);
        let flow = Flow::new(&surface, &start)?;
        let reference = flow.end(FINER, 0.0)?;
        let mut text = format!("{n} {:e} {:e} {}\n", flow.h, surface.rate(), steps_of_drift(n));
        for numbers in elements(&solver(&flow, Options::fixed(flow.h))?).chunks(2).chain(reference.chunks(2))
        {
            let _ = writeln!(text, "{:e} {:e}", numbers[0], numbers[1]);
        }
        let path = folder.join(format!("{n}.txt"));
        std::fs::write(&path, text).map_err(|e| format!("{}: {e}", path.display()))?;
        flow.measure("sphere", rounds, &reference, &mut take)?;
    }
    for n in TORUS {
        let surface = Torus::new(n, vec![0.0; Torus::<Vec<f64>>::storage(n)]).map_err(|e| e.to_string())?;
        let start = |solver: &mut Solver<'_, Torus<Vec<f64>>>| stir_torus(&surface, solver);
        let flow = Flow::new(&surface, &start)?;
        flow.measure("torus", rounds, &flow.end(FINER, 0.0)?, &mut take)?;
    }
    Ok(())
}

/// Drift of the Casimirs `C_2` to `C_5` over a million steps on the torus with `N = 7`, of the size of the other
/// measurements and of a fifth of it: the numbers of steps, the step and the drift.
///
/// # Errors
/// What a solver says.
pub fn long_runs() -> Result<Vec<(u32, f64, f64)>, String> {
    let surface = Torus::new(7, vec![0.0; Torus::<Vec<f64>>::storage(7)]).map_err(|e| e.to_string())?;
    let start = |solver: &mut Solver<'_, Torus<Vec<f64>>>| stir_torus(&surface, solver);
    let mut flow = Flow::new(&surface, &start)?;
    let mut runs = Vec::new();
    for _ in 0..2 {
        runs.push((LONG, flow.h, flow.drift(LONG, 0.0, 5)?));
        flow.h /= 5.0;
    }
    Ok(runs)
}
