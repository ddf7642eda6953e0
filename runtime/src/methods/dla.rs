//! The leapfrog of the discrete Lagrange-d'Alembert principle, for velocities that constraints restrict.
//!
//! Deliberately does not know: where equations come from, how steps are chosen.

use super::elimination::solve;
use super::iteration::{Change, iterate, not_converged};
use super::{Estimate, Method, Step, Tableau, c, two_sum};
use crate::error::Error;
use crate::implicit::{Implicit, ImplicitInfo};
use crate::options::Options;
use crate::real::Real;
use crate::system::{SquareStorage, StateVector};

/// The leapfrog of the discrete Lagrange-d'Alembert principle (DLA), for fixed steps: of order 2, implicit, symmetric,
/// and reversible where the motion is.
///
/// ```text
/// L = 1/2 v.M v - V(q),   A(q) v = 0,   v = q'
///
/// q_h = q_0 + h/2 v_0
/// M (v_1 - v_0) = h (-V'(q_h) + A(q_h)^T lambda)
/// q_1 = q_h + h/2 v_1
/// A(q_1) v_1 = 0                         Dla::new
/// A(q_h) (v_0 + v_1) = 0                 Dla::reflecting
/// ```
///
/// The systems are those whose velocities are all in the state, held by multipliers, and that have their implicit form
/// (in a model: `multipliers;`, and `want implicit`). Of that form with variables `(q, v, a, lambda)`,
///
/// ```text
/// q' = rho(q) v,   v' = a,   0 = r(q, v) + lambda.Lambda(q) - M(q) a,   0 = w(q).a + w_0(q, v),
/// ```
///
/// the method takes `r`, `Lambda` and `M` at `q_h` and `(v_0 + v_1)/2`, and `w` at `q_1` or `q_h`. Where `M` depends
/// on the place, or velocities are no derivatives of coordinates, these are the symmetric steps of order 2 that agree
/// with the ones above wherever the ones above are defined; no discrete variational principle stands behind them.
///
/// With [`Dla::new`] every state obeys the constraint to round-off. With [`Dla::reflecting`] its residual stays of the
/// order `h^2`, velocities are reflected by the constraint between two steps, and free motion with a constant `M` keeps
/// its energy. The unknowns `a` and `lambda` are iterated, with one matrix a step, until round-off stops the progress.
/// Dense output is the cubic Hermite interpolant; for its derivatives the explicit right-hand side is evaluated once a
/// step.
///
/// # Errors
///
/// [`Error::Form`] where the implicit form is another one, or where `w(q) v` is not zero at the initial state: the
/// constraint is not linear in the velocities, or the state violates it. [`Error::NotConverged`]. A system whose
/// velocities were solved for does not compile with the method.
///
/// # Source
///
/// Cortes and Martinez, Non-holonomic integrators (2001), for the principle; McLachlan and Perlmutter, Integrators for
/// nonholonomic mechanical systems (2006), for the first of the two; Ferraro, Iglesias and Martin de Diego, Momentum
/// and energy preserving integrators for nonholonomic dynamics (2008), for the second.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Dla {
    restriction: Restriction,
}

/// Which velocity of a step obeys the constraint, and where.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Restriction {
    /// That at the end, at the end.
    #[default]
    End,
    /// The mean of both ends, at the place between them.
    Mean,
}

impl Dla {
    /// The velocities at the ends of steps obey the constraint there.
    #[must_use]
    pub const fn new() -> Self {
        Self { restriction: Restriction::End }
    }

    /// The mean of the velocities at both ends of a step obeys the constraint at the place between them.
    #[must_use]
    pub const fn reflecting() -> Self {
        Self { restriction: Restriction::Mean }
    }
}

/// A part of the variables, by their places.
#[derive(Clone, Debug)]
struct Part<P> {
    places: P,
    n: usize,
}

impl<P: AsRef<[usize]> + AsMut<[usize]>> Part<P> {
    fn push(&mut self, place: usize) {
        self.places.as_mut()[self.n] = place;
        self.n += 1;
    }

    fn get(&self) -> &[usize] {
        &self.places.as_ref()[..self.n]
    }
}

/// What the method keeps: which variable is what, the variables in the middle and at the end of a step, and a matrix.
#[derive(Clone, Debug)]
pub struct DlaStorage<R: Real, Z: SquareStorage<R>> {
    /// Components of the state that are coordinates, and those that are velocities.
    coordinates: Part<Z::Positions>,
    velocities: Part<Z::Positions>,
    /// Places of the accelerations, as many as velocities, then of the multipliers.
    unknowns: Part<Z::Positions>,
    /// What the system lacks of the form that the method integrates.
    lacks: Option<&'static str>,
    /// The variables in the middle of a step with its accelerations and multipliers, and at its end.
    middle: Z,
    end: Z,
    rates: Z,
    jacobian: Z::Rows,
    at_end: Z::Rows,
    matrix: Z::Rows,
    residuals: Z,
}

/// Whether the state has coordinates and velocities whose rates are known, and nothing of it is solved for.
const fn is_explicit(info: &ImplicitInfo) -> bool {
    let mut component = 0;
    while component < info.state.len() {
        if !info.variables[info.state[component]].is_differential {
            return false;
        }
        component += 1;
    }
    info.variables.len() > info.state.len()
}

/// The constraint at the initial state is zero to this part of its terms, or it is not of the form.
const SATISFIED: f64 = 1e-8;

impl<R: Real, Z: SquareStorage<R>> DlaStorage<R, Z> {
    fn new<S: Implicit<R, Variables = Z>>(system: &S, t: R, y: &S::State) -> Self {
        let start = system.consistent(t, y);
        let part = || Part { places: start.positions_like(), n: 0 };
        let mut storage = Self {
            coordinates: part(),
            velocities: part(),
            unknowns: part(),
            lacks: None,
            middle: start.clone(),
            end: start.clone(),
            rates: start.zeros_like(),
            jacobian: start.rows_like(),
            at_end: start.rows_like(),
            matrix: start.rows_like(),
            residuals: start.zeros_like(),
        };
        let is_algebraic = |place: usize| !S::IMPLICIT.variables[place].is_differential;
        let n = S::IMPLICIT.variables.len();
        system.implicit_jacobian(t, &start, storage.jacobian.as_mut());
        system.implicit_rhs(t, &start, &mut storage.rates);
        for (component, &place) in S::IMPLICIT.state.iter().enumerate() {
            let row = storage.jacobian.as_ref()[place].as_slice();
            match (0..n).find(|&k| is_algebraic(k) && row[k].all_ne(R::ZERO)) {
                Some(acceleration) => {
                    // The rate of a momentum has the multipliers in it.
                    if storage.rates.as_slice()[place] != start.as_slice()[acceleration]
                        || storage.unknowns.get().contains(&acceleration)
                    {
                        storage.lacks = Some(
                            "accelerations among the variables, as a Lagrangian with `multipliers;` has",
                        );
                    }
                    storage.velocities.push(component);
                    storage.unknowns.push(acceleration);
                }
                None => storage.coordinates.push(component),
            }
            if storage.lacks.is_some() {
                return storage;
            }
        }
        for place in 0..n {
            if is_algebraic(place) && !storage.unknowns.get().contains(&place) {
                storage.unknowns.push(place);
            }
        }
        let n_velocities = storage.velocities.n;
        for &row in &storage.unknowns.get()[n_velocities..] {
            let row = storage.jacobian.as_ref()[row].as_slice();
            let pairs = storage.velocities.get().iter().zip(storage.unknowns.get());
            let (mut sum, mut size) = (R::ZERO, 0.0);
            for (&velocity, &acceleration) in pairs {
                let term = row[acceleration] * y.as_slice()[velocity];
                sum += term;
                size += term.magnitude();
            }
            let is_satisfied = sum.magnitude() <= SATISFIED * size;
            if !is_satisfied {
                storage.lacks =
                    Some("constraints linear in the velocities, and an initial state that obeys them");
            }
        }
        storage
    }

    /// `sum_j w_j v_j` of the constraint in `row` for velocities of `variables`.
    fn constraint<S: Implicit<R, Variables = Z>>(&self, row: &Z, variables: &Z) -> R {
        let pairs = self.velocities.get().iter().zip(self.unknowns.get());
        let value = |velocity: usize| variables.as_slice()[S::IMPLICIT.state[velocity]];
        pairs.fold(R::ZERO, |sum, (&v, &a)| sum + row.as_slice()[a] * value(v))
    }
}

impl<R: Real, S: Implicit<R>> Method<R, S> for Dla
where
    S::Variables: SquareStorage<R>,
{
    const TABLEAU: &'static Tableau = &TABLEAU;

    type Storage = DlaStorage<R, S::Variables>;

    fn storage(&self, system: &S, t0: R, y0: &S::State, _options: &Options<R>) -> Self::Storage {
        const {
            assert!(
                is_explicit(&S::IMPLICIT),
                "the method needs all velocities in the state: a model with `multipliers;`"
            );
        }
        DlaStorage::new(system, t0, y0)
    }

    fn stages(_storage: &Self::Storage) -> &[S::State] {
        &[]
    }

    fn stages_mut(_storage: &mut Self::Storage) -> &mut [S::State] {
        &mut []
    }

    fn restart(&self, storage: &mut Self::Storage, system: &S, t: R, y: &S::State) {
        *storage = DlaStorage::new(system, t, y);
    }

    fn advance(&self, storage: &mut Self::Storage, step: &mut Step<'_, R, S>) -> Result<(), Error> {
        if let Some(needs) = storage.lacks {
            return Err(Error::Form { method: TABLEAU.name, needs });
        }
        let place = |component: usize| S::IMPLICIT.state[component];
        let half = R::from_f64(0.5) * step.h;
        let from = step.from;
        let (y, slope) = (from.state.as_slice(), from.slope.as_slice());
        for &k in storage.coordinates.get() {
            storage.middle.as_mut_slice()[place(k)] = half.mul_add(slope[k], y[k]);
            storage.end.as_mut_slice()[place(k)] = step.h.mul_add(slope[k], y[k]);
        }
        let (t_middle, t_end) = (step.t + half, step.t + step.h);
        let (n_velocities, n) = (storage.velocities.n, storage.unknowns.n);
        let (mut is_first, mut is_singular) = (true, false);
        let h_size = step.h.magnitude();
        iterate(TABLEAU.name, step, |step| {
            let mut change = Change::default();
            for (&k, &a) in storage.velocities.get().iter().zip(storage.unknowns.get()) {
                let a = storage.middle.as_slice()[a];
                storage.middle.as_mut_slice()[place(k)] = half.mul_add(a, y[k]);
                storage.end.as_mut_slice()[place(k)] = step.h.mul_add(a, y[k]);
            }
            // The end: coordinates by the velocities there, and the constraint.
            step.system.implicit_rhs(t_end, &storage.end, &mut storage.rates);
            for &k in storage.coordinates.get() {
                let (middle, rate) =
                    (storage.middle.as_slice()[place(k)], storage.rates.as_slice()[place(k)]);
                let end = half.mul_add(rate, middle);
                let before = core::mem::replace(&mut storage.end.as_mut_slice()[place(k)], end);
                change.add(1.0, y[k], R::ZERO, end - before);
            }
            if is_first {
                step.system.implicit_jacobian(t_middle, &storage.middle, storage.jacobian.as_mut());
                *step.jacobian_evals += 1;
                is_first = false;
            }
            if self.restriction == Restriction::End {
                step.system.implicit_jacobian(t_end, &storage.end, storage.at_end.as_mut());
                *step.jacobian_evals += 1;
            }
            // The middle: forces against accelerations.
            step.system.implicit_rhs(t_middle, &storage.middle, &mut storage.rates);
            *step.rhs_evals += 2;
            let unknowns = storage.unknowns.get();
            for (i, &row) in unknowns.iter().enumerate() {
                let middle = storage.jacobian.as_ref()[row].as_slice();
                let is_equation = i < n_velocities;
                let residual = if is_equation {
                    storage.rates.as_slice()[row]
                } else {
                    match self.restriction {
                        Restriction::End => {
                            storage.constraint::<S>(&storage.at_end.as_ref()[row], &storage.end)
                        }
                        Restriction::Mean => {
                            let sum =
                                storage.constraint::<S>(&storage.jacobian.as_ref()[row], &storage.middle);
                            sum + sum
                        }
                    }
                };
                storage.residuals.as_mut_slice()[i] = residual;
                for (j, &column) in unknowns.iter().enumerate() {
                    let entry = if !is_equation && j >= n_velocities {
                        R::ZERO
                    } else if is_equation && j < n_velocities {
                        half.mul_add(middle[place(storage.velocities.get()[j])], middle[column])
                    } else if is_equation {
                        middle[column]
                    } else {
                        let row = match self.restriction {
                            Restriction::End => storage.at_end.as_ref()[row].as_slice(),
                            Restriction::Mean => middle,
                        };
                        step.h * row[column]
                    };
                    storage.matrix.as_mut()[i].as_mut_slice()[j] = entry;
                }
            }
            if !solve(storage.matrix.as_mut(), storage.residuals.as_mut_slice(), n) {
                is_singular = true;
                return Change::default();
            }
            for j in 0..n {
                let correction = storage.residuals.as_slice()[j];
                let unknown = &mut storage.middle.as_mut_slice()[storage.unknowns.get()[j]];
                *unknown -= correction;
                if j < n_velocities {
                    change.add(h_size, y[storage.velocities.get()[j]], *unknown, correction);
                }
            }
            // Corrections without a digit can go on in one direction for long.
            if change.is_rounding::<R>() { Change::default() } else { change }
        })?;
        if is_singular {
            return Err(not_converged(TABLEAU.name, step, 0));
        }
        let to = &mut *step.to;
        let mut put = |k: usize, increment: R| {
            let (sum, residue) = two_sum(y[k], increment + from.residue.as_slice()[k]);
            to.state.as_mut_slice()[k] = sum;
            to.residue.as_mut_slice()[k] = residue;
        };
        for (&k, &a) in storage.velocities.get().iter().zip(storage.unknowns.get()) {
            let a = storage.middle.as_slice()[a];
            storage.end.as_mut_slice()[place(k)] = step.h.mul_add(a, y[k]);
            put(k, step.h * a);
        }
        step.system.implicit_rhs(t_end, &storage.end, &mut storage.rates);
        *step.rhs_evals += 1;
        for &k in storage.coordinates.get() {
            put(k, half * (slope[k] + storage.rates.as_slice()[place(k)]));
        }
        Ok(())
    }
}

/// What the integrator asks of a method with stages; the one derivative is that at the start.
const TABLEAU: Tableau = Tableau {
    name: "dla",
    order: 2,
    nodes: &[c(0.0, 0.0)],
    stages: &[&[]],
    weights: &[(0, c(1.0, 0.0))],
    estimate: Estimate::None,
    dense_nodes: &[],
    dense_stages: &[],
    dense: &[],
};
