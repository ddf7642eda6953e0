//! Fluids of matrices held to their text: at random states, energy, stream function, currents and forces of the solver
//! beside the hamiltonian and the forces of the model, evaluated by arithmetic alone ([`Meaning`]), and rates beside
//! the Lie-Poisson equations, by structure constants.
//!
//! The pairing makes the stream function and the current of a carried field: `dh(omega) . delta = sum of pairing psi_m
//! delta_m`. Neither depends on the size of the matrices but for the waves that there are: the check is done at the least
//! size that has all waves of the model, of very many waves on a sample beside the waves of the model. Rates are those
//! of
//!
//! ```text
//! <omega', eta> = -<omega, [xi, eta]> - sum of <dh/da, [eta, a]>,   a' = [xi, a],   xi = dh/domega
//! ```
//!
//! for the action from the right, at a size that has few constants, with the terms of the model that it has.
//!
//! Does not know: how expressions of a fluid are read, steps.

use hamel_expr::error::Error;
use hamel_lang::algebra::LieAlgebra;
use hamel_lang::spec::{FluidField, FluidSurface, FluidTerm, FluidWave, MatrixFluid, Meaning};
use hamel_runtime::matrices::{MatrixRef, Options, Sphere, Torus};

use super::random::Random;
use crate::fluid::{Modes, Solver, stream};

/// States.
const N_POINTS: usize = 3;
/// Largest difference, relative to the sum of sizes: far above the rounding errors of matrices of such sizes, far below
/// any term.
const BOUND: f64 = 1e-10;
/// Sizes that matrices have at least, as far as the model has them.
const LEAST_N: usize = 7;
/// Sizes of the structure constants.
const TORUS_N: usize = 5;
const SPHERE_N: usize = 4;
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
type Fault = (&'static str, String, f64);

fn on<S: Modes>(fluid: &MatrixFluid) -> Result<(), Error> {
    let of_terms = terms(fluid).map(|term| fluid.surface.least_n(term.wave)).max().unwrap_or(0);
    let n = LEAST_N.max(of_terms).min(fluid.n);
    let outcome = compared::<S>(fluid, &fluid.meaning(), n).and_then(|()| moved::<S>(fluid));
    outcome.map_err(|(function, what, residual)| Error::Disagrees {
        scene: "default".into(),
        function: function.into(),
        what,
        residual,
    })
}

/// All terms of one wave that the model has.
fn terms(fluid: &MatrixFluid) -> impl Iterator<Item = &FluidTerm> {
    let of_fields = fluid.carried.iter().flat_map(|field| &field.constant);
    fluid.background.iter().chain(&fluid.force).chain(of_fields)
}

/// Vorticity and carried fields.
fn fields(fluid: &MatrixFluid) -> Vec<FluidField> {
    std::iter::once(FluidField::Vorticity).chain((0..fluid.carried.len()).map(FluidField::Carried)).collect()
}

/// What a solver that cannot be made is off by.
fn unknown(_: hamel_runtime::Error) -> Fault {
    ("matrices", "the solver".into(), f64::INFINITY)
}

fn compared<S: Modes>(fluid: &MatrixFluid, meaning: &Meaning, n: usize) -> Result<(), Fault> {
    let surface = S::surface(n, stream(fluid)).map_err(unknown)?;
    let mut random = Random::new(41);
    let waves = fluid.surface.waves(n);
    let compared = chosen(fluid, &waves);
    let fields = fields(fluid);
    for _ in 0..N_POINTS {
        let mut solver = Solver::new(fluid, &surface, Options::fixed(1.0)).map_err(unknown)?;
        let [mut state, mut change] = [(); 2].map(|()| vec![0.0; waves.len() * fields.len()]);
        for (field, (state, change)) in
            fields.iter().zip(state.chunks_mut(waves.len()).zip(change.chunks_mut(waves.len())))
        {
            for &k in &compared {
                (state[k], change[k]) = (random.signed(), random.signed());
                surface.add(waves[k], state[k], solver.field_mut(*field));
            }
        }
        let values = |matrix: MatrixRef<'_>| -> Vec<f64> {
            compared.iter().map(|&k| surface.value(waves[k], matrix)).collect()
        };
        let found = solver.energy();
        let pairing = fluid.surface.pairing() as f64;
        for (at, field) in fields.iter().enumerate() {
            // Along a change of this field alone.
            let (from, to) = (at * waves.len(), (at + 1) * waves.len());
            let mut along = vec![0.0; change.len()];
            along[from..to].copy_from_slice(&change[from..to]);
            let Some([energy, slope]) = meaning.hamiltonian(n, &state, &along) else {
                return Err(("energy", "the hamiltonian".into(), f64::INFINITY));
            };
            within("energy", "the hamiltonian", energy - found, energy.abs() + found.abs())?;
            let (derivative, what) = match field {
                FluidField::Vorticity => {
                    (values(solver.fluid_mut().stream()), "the stream function".to_owned())
                }
                FluidField::Carried(k) => (
                    values(solver.fluid_mut().current(*k)),
                    format!("the current of {}", fluid.carried[*k].name),
                ),
            };
            let products = || derivative.iter().zip(&compared).map(|(x, &k)| pairing * x * along[from + k]);
            let size = products().map(f64::abs).sum::<f64>();
            within("rhs", &what, slope - products().sum::<f64>(), size + slope.abs())?;
        }

        let Some(force) = meaning.force(n, &state) else {
            return Err(("rhs", "the force".into(), f64::INFINITY));
        };
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

/// Rates without friction and forces beside the Lie-Poisson equations with the solver's stream function and currents.
fn moved<S: Modes>(fluid: &MatrixFluid) -> Result<(), Fault> {
    let small = |least: usize| least.min(fluid.n);
    let (n, algebra) = match fluid.surface {
        FluidSurface::Torus => (small(TORUS_N), LieAlgebra::zeitlin(small(TORUS_N))),
        FluidSurface::Sphere => (small(SPHERE_N), LieAlgebra::zeitlin_sphere(small(SPHERE_N))),
    };
    let algebra = algebra.map_err(|_| ("rhs", "the algebra".into(), f64::INFINITY))?;
    let mut constants = Vec::new();
    for (a, b, bracket) in algebra.brackets() {
        for (c, q) in bracket {
            let [value, _] = q.parts();
            constants.extend([(a, b, *c, value), (b, a, *c, -value)]);
        }
    }
    let mut fluid = fluid.clone();
    let surface_of = fluid.surface;
    let lists = fluid.carried.iter_mut().map(|field| &mut field.constant);
    for list in lists.chain([&mut fluid.background, &mut fluid.force]) {
        list.retain(|term| surface_of.least_n(term.wave) <= n);
    }
    let surface = S::surface(n, stream(&fluid)).map_err(unknown)?;
    let mut solver = Solver::new(&fluid, &surface, Options::fixed(1.0)).map_err(unknown)?;
    let (waves, pairing) = (surface_of.waves(n), surface_of.pairing() as f64);
    let mut random = Random::new(43);
    let fields = fields(&fluid);
    let mut state: Vec<Vec<f64>> = Vec::new();
    for field in &fields {
        let modes: Vec<f64> = waves.iter().map(|_| random.signed()).collect();
        for (wave, value) in waves.iter().zip(&modes) {
            surface.add(*wave, *value, solver.field_mut(*field));
        }
        state.push(modes);
    }
    let values = |matrix: MatrixRef<'_>| -> Vec<f64> {
        waves.iter().map(|wave| surface.value(*wave, matrix)).collect()
    };
    let by_pairing = |list: Vec<f64>| -> Vec<f64> { list.into_iter().map(|x| pairing * x).collect() };
    let velocity = by_pairing(values(solver.fluid_mut().stream()));
    let omega = &state[0];
    // Rates, and the sums of sizes of their terms.
    let mut expected = vec![vec![[0.0; 2]; waves.len()]; fields.len()];
    let mut add = |field: usize, at: usize, term: f64| {
        let [sum, size] = &mut expected[field][at];
        (*sum, *size) = (*sum + term, *size + term.abs());
    };
    for &(a, b, c, q) in &constants {
        // [xi, e_b] with xi_a, of which the component c is paired.
        add(0, b, -omega[c] * q * velocity[a]);
    }
    for (k, field) in fluid.carried.iter().enumerate() {
        let of_field = &state[1 + k];
        let current = match field.is_active() {
            true => by_pairing(values(solver.fluid_mut().current(k))),
            false => vec![0.0; waves.len()],
        };
        for &(a, b, c, q) in &constants {
            add(0, a, -current[c] * q * of_field[b]);
            add(1 + k, c, q * velocity[a] * of_field[b]);
        }
    }
    for (at, field) in fields.iter().enumerate() {
        let (found, what) = match field {
            FluidField::Vorticity => (values(solver.fluid_mut().derivative()), "the bracket".to_owned()),
            FluidField::Carried(k) => {
                (values(solver.carried_derivative(*k)), format!("the motion of {}", fluid.carried[*k].name))
            }
        };
        let largest = expected[at].iter().fold(0.0, |a: f64, [_, size]| a.max(*size));
        for (found, [rate, _]) in found.iter().zip(&expected[at]) {
            within("rhs", &what, found - rate, largest)?;
        }
    }
    Ok(())
}

/// Places of the waves that are compared.
fn chosen(fluid: &MatrixFluid, waves: &[FluidWave]) -> Vec<usize> {
    let is_of_model = |wave: &FluidWave| terms(fluid).any(|term| term.wave == *wave);
    let stride = waves.len().div_ceil(MOST_WAVES);
    (0..waves.len()).filter(|k| k.is_multiple_of(stride) || is_of_model(&waves[*k])).collect()
}

fn within(function: &'static str, what: &str, off: f64, size: f64) -> Result<(), Fault> {
    // A value that is no number is off, too.
    if off.abs() <= BOUND * size { Ok(()) } else { Err((function, what.to_owned(), off.abs() / size)) }
}
