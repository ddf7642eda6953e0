//! Angles as points of the circle within every step, for any explicit method.
//!
//! The module deliberately does not know which components of a state are angles.

use super::{Method, Point, Start, Step, Tableau};
use crate::error::Error;
use crate::options::Options;
use crate::real::Real;
use crate::system::{Circles, StateVector, System};

/// A method whose every step carries angles of the system as points of the circle: no sine and no cosine is called in
/// its stages.
///
/// ```text
/// z = (y, cos x_1, sin x_1, ..),    (cos x)' = -x' sin x,    (sin x)' = x' cos x
/// ```
///
/// The angles `x_k` are those of [`Circles`]; the state `y` keeps them as numbers, which are integrated as ever and
/// count their turns. A step starts from the points of its own `y`, one sine and cosine an angle, so that the points
/// stay on the circle and belong to the angles, however many steps are taken. The error is that of `y` alone, in the
/// tolerances of `y`; states within a step, events and the end are those of `y`.
///
/// The truncation error is another one than that of the method on `y`, of the same order. What a method keeps of a
/// Hamiltonian system in `y`, it does not keep this way: symplectic methods are to be used without.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct OnCircles<M> {
    method: M,
}

impl<M> OnCircles<M> {
    /// The method on circles.
    #[must_use]
    pub const fn new(method: M) -> Self {
        Self { method }
    }
}

/// What a method on circles keeps: its storage for either state, and the ends of the last step with their points.
#[derive(Clone, Debug)]
pub struct Turning<R, I: System<R>, O, T>
where
    R: Real,
{
    inside: I,
    /// Storage for the state of the system: what is told of a step.
    own: O,
    /// Storage for the state with points: what a step is computed with.
    extended: T,
    ends: [End<R, I::State>; 2],
    /// Which of `ends` the last step led to.
    current: bool,
    work: I::State,
}

/// A state with its points and its derivative.
#[derive(Clone, Debug)]
struct End<R, Z> {
    /// Its time; none where the point is not complete.
    t: Option<R>,
    point: Point<Z>,
}

impl<R: Real, Z: StateVector<R>> End<R, Z> {
    fn is_at<V: StateVector<R>>(&self, t: R, y: &V) -> bool {
        self.t == Some(t) && self.point.state.as_slice().starts_with(y.as_slice())
    }
}

/// Copies the components of the system's state.
#[inline(always)]
fn copy_start<R: Real>(extended: &impl StateVector<R>, own: &mut impl StateVector<R>) {
    let pairs = own.as_mut_slice().iter_mut().zip(extended.as_slice());
    pairs.for_each(|(own, extended)| *own = *extended);
}

impl<R, S, M> Method<R, S> for OnCircles<M>
where
    R: Real,
    S: Circles<R>,
    M: Method<R, S> + Method<R, S::Inside>,
{
    const TABLEAU: &'static Tableau = <M as Method<R, S>>::TABLEAU;

    const DENSE_BY_STEPS: bool = <M as Method<R, S>>::DENSE_BY_STEPS;

    #[inline(always)]
    fn tableau(&self) -> &'static Tableau {
        Method::<R, S>::tableau(&self.method)
    }

    #[inline(always)]
    fn dense_by_steps(&self) -> bool {
        Method::<R, S>::dense_by_steps(&self.method)
    }

    type Storage = Turning<R, S::Inside, <M as Method<R, S>>::Storage, <M as Method<R, S::Inside>>::Storage>;

    fn validate(&self, options: &Options<R>) -> Result<(), Error> {
        <M as Method<R, S>>::validate(&self.method, options)
    }

    fn storage(&self, system: &S, t0: R, y0: &S::State, options: &Options<R>) -> Self::Storage {
        let (inside, state) = (system.inside(), system.on_circles(y0));
        let work = state.zeros_like();
        let point = Point { state, residue: work.clone(), slope: work.clone() };
        Turning {
            own: self.method.storage(system, t0, y0, options),
            extended: self.method.storage(&inside, t0, &point.state, options),
            inside,
            ends: [End { t: None, point: point.clone() }, End { t: None, point }],
            current: false,
            work,
        }
    }

    #[inline]
    fn stages(storage: &Self::Storage) -> &[S::State] {
        <M as Method<R, S>>::stages(&storage.own)
    }

    #[inline]
    fn stages_mut(storage: &mut Self::Storage) -> &mut [S::State] {
        <M as Method<R, S>>::stages_mut(&mut storage.own)
    }

    #[inline]
    fn last_time(&self, storage: &mut Self::Storage, start: Start<'_, R, S>, t_end: R) -> R {
        self.method.last_time(&mut storage.own, start, t_end)
    }

    #[inline]
    fn longest_step(&self, storage: &mut Self::Storage, start: Start<'_, R, S>) -> f64 {
        self.method.longest_step(&mut storage.own, start)
    }

    fn restart(&self, storage: &mut Self::Storage, system: &S, t: R, y: &S::State) {
        self.method.restart(&mut storage.own, system, t, y);
        self.method.restart(&mut storage.extended, &storage.inside, t, &system.on_circles(y));
    }

    #[inline]
    fn first_step(&self, storage: &mut Self::Storage, start: Start<'_, R, S>, trial: R) -> Option<f64> {
        self.method.first_step(&mut storage.own, start, trial)
    }

    #[inline]
    fn advance(&self, storage: &mut Self::Storage, step: &mut Step<'_, R, S>) -> Result<(), Error> {
        let Turning { inside, own, extended, ends, current, work } = storage;
        let mut last_h = step.last_h;
        if !ends[usize::from(!*current)].is_at(step.t, &step.from.state) {
            // Past the trials of the last step.
            *current = !*current;
        }
        let [one, two] = ends;
        let (from, to) = if *current { (one, two) } else { (two, one) };
        if !from.is_at(step.t, &step.from.state) {
            from.t = Some(step.t);
            from.point.state = step.system.on_circles(&step.from.state);
            inside.rhs(step.t, &from.point.state, &mut from.point.slope);
            *step.rhs_evals += 1;
            last_h = None;
        }
        from.point.residue.as_mut_slice().fill(R::ZERO);
        let residues = from.point.residue.as_mut_slice().iter_mut().zip(step.from.residue.as_slice());
        residues.for_each(|(residue, own)| *residue = *own);
        let mut within = None;
        let to = if step.is_inside {
            within.insert(to.point.clone())
        } else {
            to.t = None;
            &mut to.point
        };
        self.method.advance(
            extended,
            &mut Step {
                system: &*inside,
                t: step.t,
                h: step.h,
                from: &from.point,
                to,
                work,
                last_h,
                is_inside: step.is_inside,
                rhs_evals: step.rhs_evals,
                jacobian_evals: step.jacobian_evals,
            },
        )?;
        copy_start(&to.state, &mut step.to.state);
        copy_start(&to.residue, &mut step.to.residue);
        if !step.is_inside {
            let stages = <M as Method<R, S>>::stages_mut(own).iter_mut();
            let known = <M as Method<R, S::Inside>>::stages(extended);
            stages.zip(known).for_each(|(own, known)| copy_start(known, own));
        }
        Ok(())
    }

    /// By the points of the state, so that the next step has them.
    #[inline]
    fn slope(&self, storage: &mut Self::Storage, system: &S, t: R, end: &mut Point<S::State>) {
        let Turning { inside, extended, ends, current, .. } = storage;
        let to = &mut ends[usize::from(*current)];
        to.t = Some(t);
        to.point.state = system.on_circles(&end.state);
        self.method.slope(extended, &*inside, t, &mut to.point);
        copy_start(&to.point.slope, &mut end.slope);
    }

    #[inline]
    fn mean_square_error(
        storage: &Self::Storage,
        h: R,
        rtol: &S::State,
        atol: &S::State,
        ends: [&S::State; 2],
    ) -> Option<f64> {
        <M as Method<R, S>>::mean_square_error(&storage.own, h, rtol, atol, ends)
    }
}
