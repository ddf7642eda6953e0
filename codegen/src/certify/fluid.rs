//! Fluids of matrices held to their text: at random vorticities, energy, stream function and forces of the solver
//! beside the hamiltonian and the forces of the model, evaluated by arithmetic alone ([`Meaning`]).
//!
//! The pairing makes the stream function: `dh(omega) . delta = sum of pairing psi_m delta_m`. Neither depends on the
//! size of the matrices but for the waves that there are: the check is done at the least size that has all waves of the
//! model, of very many waves on a sample beside the waves of the model. Tests show on models that have both that
//! commutators of matrices are the brackets of the algebra.
//!
//! Does not know: how expressions of a fluid are read, steps.

use hamel_expr::error::Error;
use hamel_lang::spec::{FluidSurface, FluidWave, MatrixFluid, Meaning};
use hamel_runtime::matrices::{MatrixRef, Options, Sphere, Torus};

use super::random::Random;
use crate::fluid::{Modes, Solver, stream};

/// Vorticities.
const N_POINTS: usize = 3;
/// Largest difference, relative to the sum of sizes: far above the rounding errors of matrices of such sizes, far below
/// any term.
const BOUND: f64 = 1e-10;
/// Sizes that matrices have at least, as far as the model has them.
const LEAST_N: usize = 7;
/// Size of the sample of waves, in which are all waves of matrices of the size 21.
const MOST_WAVES: usize = 440;

/// Holds a fluid to its text.
///
/// # Errors
/// [`Error::Disagrees`]: the generator is wrong.
pub fn fluid(fluid: &MatrixFluid) -> Result<(), Error> {
    match fluid.surface {
        FluidSurface::Torus => on::<Torus<Vec<f64>>>(fluid),
        FluidSurface::Sphere => on::<Sphere<Vec<f64>>>(fluid),
    }
}

/// A function and what of it is off by a part of its size.
type Fault = (&'static str, &'static str, f64);

fn on<S: Modes>(fluid: &MatrixFluid) -> Result<(), Error> {
    let terms = fluid.background.iter().chain(&fluid.force);
    let of_terms = terms.map(|term| fluid.surface.least_n(term.wave)).max().unwrap_or(0);
    let n = LEAST_N.max(of_terms).min(fluid.n);
    compared::<S>(fluid, &fluid.meaning(), n).map_err(|(function, what, residual)| Error::Disagrees {
        scene: "default".into(),
        function: function.into(),
        what: what.into(),
        residual,
    })
}

fn compared<S: Modes>(fluid: &MatrixFluid, meaning: &Meaning, n: usize) -> Result<(), Fault> {
    let unknown = |_| ("matrices", "the solver", f64::INFINITY);
    let surface = S::surface(n, stream(fluid)).map_err(unknown)?;
    let mut random = Random::new(41);
    let waves = fluid.surface.waves(n);
    let compared = chosen(fluid, &waves);
    for _ in 0..N_POINTS {
        let mut solver = Solver::new(fluid, &surface, Options::fixed(1.0)).map_err(unknown)?;
        let [mut omega, mut delta] = [(); 2].map(|()| vec![0.0; waves.len()]);
        for &k in &compared {
            (omega[k], delta[k]) = (random.signed(), random.signed());
            surface.add(waves[k], omega[k], solver.fluid_mut().vorticity_mut());
        }
        let Some([energy, slope]) = meaning.hamiltonian(n, &omega, &delta) else {
            return Err(("energy", "the hamiltonian", f64::INFINITY));
        };
        let found = solver.energy();
        within("energy", "the hamiltonian", energy - found, energy.abs() + found.abs())?;
        let values = |matrix: MatrixRef<'_>| -> Vec<f64> {
            compared.iter().map(|&k| surface.value(waves[k], matrix)).collect()
        };
        let psi = values(solver.fluid_mut().stream());
        let pairing = fluid.surface.pairing() as f64;
        let products = || psi.iter().zip(&compared).map(|(psi, &k)| pairing * psi * delta[k]);
        let size = products().map(f64::abs).sum::<f64>();
        within("rhs", "the stream function", slope - products().sum::<f64>(), size + slope.abs())?;

        let Some(force) = meaning.force(n, &omega) else { return Err(("rhs", "the force", f64::INFINITY)) };
        let all = values(solver.derivative());
        let ideal = values(solver.fluid_mut().derivative());
        let force: Vec<f64> = compared.iter().map(|&k| force[k]).collect();
        let size = all.iter().chain(&ideal).chain(&force).fold(0.0, |a: f64, x| a.max(x.abs()));
        for ((all, ideal), force) in all.iter().zip(&ideal).zip(&force) {
            within("rhs", "the force", all - ideal - force, size)?;
        }
    }
    Ok(())
}

/// Places of the waves that are compared.
fn chosen(fluid: &MatrixFluid, waves: &[FluidWave]) -> Vec<usize> {
    let is_of_model =
        |wave: &FluidWave| fluid.background.iter().chain(&fluid.force).any(|term| term.wave == *wave);
    let stride = waves.len().div_ceil(MOST_WAVES);
    (0..waves.len()).filter(|k| k.is_multiple_of(stride) || is_of_model(&waves[*k])).collect()
}

fn within(function: &'static str, what: &'static str, off: f64, size: f64) -> Result<(), Fault> {
    // A value that is no number is off, too.
    if off.abs() <= BOUND * size { Ok(()) } else { Err((function, what, off.abs() / size)) }
}
