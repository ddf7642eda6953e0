//! Methods whose types are known at run time only, so that everything around a step is compiled once: [`AnyMethod`].
//!
//! Does not know: names of methods, requests.

use std::marker::PhantomData;

use hamel_runtime::{
    Error, F64x4, F64x8, Method, OfPositions, Options, Point, Projected, Real, Start, Step, System, Tableau,
};

use super::dynamics::{PreparedLanes, PreparedScene, Several, VecState};

/// Most invariants that are projected onto.
pub(crate) const MAX_INVARIANTS: usize = 64;

/// A method beside its storage.
struct With<M, T> {
    method: M,
    storage: T,
}

/// A method that has its storage, whatever types they have.
pub(crate) trait Kept<R: Real, S: System<R>>: Send {
    /// As [`Method::renew`].
    fn renew(&mut self, system: &S, t0: R, y0: &S::State, options: &Options<R>);

    /// As [`Method::stages`].
    fn stages(&self) -> &[S::State];

    /// As [`Method::stages_mut`].
    fn stages_mut(&mut self) -> &mut [S::State];

    /// As [`Method::last_time`].
    fn last_time(&mut self, start: Start<'_, R, S>, t_end: R) -> R;

    /// As [`Method::longest_step`].
    fn longest_step(&mut self, start: Start<'_, R, S>) -> f64;

    /// As [`Method::restart`].
    fn restart(&mut self, system: &S, t: R, y: &S::State);

    /// As [`Method::first_step`].
    fn first_step(&mut self, start: Start<'_, R, S>, trial: R) -> Option<f64>;

    /// As [`Method::advance`].
    ///
    /// # Errors
    /// As [`Method::advance`].
    fn advance(&mut self, step: &mut Step<'_, R, S>) -> Result<(), Error>;

    /// As [`Method::slope`].
    fn slope(&mut self, system: &S, t: R, end: &mut Point<S::State>);

    /// As [`Method::mean_square_error`].
    fn mean_square_error(&self, h: R, rtol: &S::State, atol: &S::State, ends: [&S::State; 2]) -> Option<f64>;
}

impl<R, S, M> Kept<R, S> for With<M, M::Storage>
where
    R: Real,
    S: System<R>,
    M: Method<R, S> + Send,
    M::Storage: Send,
{
    fn renew(&mut self, system: &S, t0: R, y0: &S::State, options: &Options<R>) {
        self.method.renew(&mut self.storage, system, t0, y0, options);
    }

    fn stages(&self) -> &[S::State] {
        M::stages(&self.storage)
    }

    fn stages_mut(&mut self) -> &mut [S::State] {
        M::stages_mut(&mut self.storage)
    }

    fn last_time(&mut self, start: Start<'_, R, S>, t_end: R) -> R {
        self.method.last_time(&mut self.storage, start, t_end)
    }

    fn longest_step(&mut self, start: Start<'_, R, S>) -> f64 {
        self.method.longest_step(&mut self.storage, start)
    }

    fn restart(&mut self, system: &S, t: R, y: &S::State) {
        self.method.restart(&mut self.storage, system, t, y);
    }

    fn first_step(&mut self, start: Start<'_, R, S>, trial: R) -> Option<f64> {
        self.method.first_step(&mut self.storage, start, trial)
    }

    fn advance(&mut self, step: &mut Step<'_, R, S>) -> Result<(), Error> {
        self.method.advance(&mut self.storage, step)
    }

    fn slope(&mut self, system: &S, t: R, end: &mut Point<S::State>) {
        self.method.slope(&mut self.storage, system, t, end);
    }

    fn mean_square_error(&self, h: R, rtol: &S::State, atol: &S::State, ends: [&S::State; 2]) -> Option<f64> {
        M::mean_square_error(&self.storage, h, rtol, atol, ends)
    }
}

/// A method of any type, before there is storage.
pub(crate) trait Erased<'a, R: Real, S: System<R>>: Sync {
    /// As [`Method::tableau`].
    fn coefficients(&self) -> &'static Tableau;

    /// As [`Method::dense_by_steps`].
    fn has_steps_inside(&self) -> bool;

    /// As [`Method::validate`].
    ///
    /// # Errors
    /// As [`Method::validate`].
    fn accepts(&self, options: &Options<R>) -> Result<(), Error>;

    /// The method with what [`Method::storage`] makes.
    fn keep(&self, system: &S, t0: R, y0: &S::State, options: &Options<R>) -> Box<dyn Kept<R, S> + 'a>;
}

impl<'a, R, S, M> Erased<'a, R, S> for M
where
    R: Real,
    S: System<R>,
    M: Method<R, S> + Send + Sync + 'a,
    M::Storage: Send + 'a,
{
    fn coefficients(&self) -> &'static Tableau {
        self.tableau()
    }

    fn has_steps_inside(&self) -> bool {
        self.dense_by_steps()
    }

    fn accepts(&self, options: &Options<R>) -> Result<(), Error> {
        self.validate(options)
    }

    fn keep(&self, system: &S, t0: R, y0: &S::State, options: &Options<R>) -> Box<dyn Kept<R, S> + 'a> {
        let storage = self.storage(system, t0, y0, options);
        Box::new(With { method: *self, storage })
    }
}

/// A choice of a method.
pub(crate) trait Choice<'a, R: Real + 'a, S: System<R> + 'a>: Copy {
    /// The method.
    fn method(self) -> &'a dyn Erased<'a, R, S>;

    /// As [`Erased::keep`].
    fn keep(self, system: &S, t0: R, y0: &S::State, options: &Options<R>) -> Box<dyn Kept<R, S> + 'a> {
        self.method().keep(system, t0, y0, options)
    }
}

impl<'a, R: Real + 'a, S: System<R> + 'a> Choice<'a, R, S> for &'a dyn Erased<'a, R, S> {
    fn method(self) -> &'a dyn Erased<'a, R, S> {
        self
    }
}

/// A chosen method as a method.
#[derive(Clone, Copy)]
pub(crate) struct Chosen<'a, C> {
    choice: C,
    life: PhantomData<&'a ()>,
}

impl<C> Chosen<'_, C> {
    fn new(choice: C) -> Self {
        Chosen { choice, life: PhantomData }
    }
}

impl<'a, R: Real + 'a, S: System<R> + 'a, C: Choice<'a, R, S>> Method<R, S> for Chosen<'a, C> {
    const TABLEAU: &'static Tableau = Tableau::CHOSEN;

    type Storage = Box<dyn Kept<R, S> + 'a>;

    fn tableau(&self) -> &'static Tableau {
        self.choice.method().coefficients()
    }

    fn dense_by_steps(&self) -> bool {
        self.choice.method().has_steps_inside()
    }

    fn validate(&self, options: &Options<R>) -> Result<(), Error> {
        self.choice.method().accepts(options)
    }

    fn storage(&self, system: &S, t0: R, y0: &S::State, options: &Options<R>) -> Self::Storage {
        self.choice.keep(system, t0, y0, options)
    }

    fn renew(&self, kept: &mut Self::Storage, system: &S, t0: R, y0: &S::State, options: &Options<R>) {
        kept.renew(system, t0, y0, options);
    }

    fn stages(kept: &Self::Storage) -> &[S::State] {
        kept.stages()
    }

    fn stages_mut(kept: &mut Self::Storage) -> &mut [S::State] {
        kept.stages_mut()
    }

    fn last_time(&self, kept: &mut Self::Storage, start: Start<'_, R, S>, t_end: R) -> R {
        kept.last_time(start, t_end)
    }

    fn longest_step(&self, kept: &mut Self::Storage, start: Start<'_, R, S>) -> f64 {
        kept.longest_step(start)
    }

    fn restart(&self, kept: &mut Self::Storage, system: &S, t: R, y: &S::State) {
        kept.restart(system, t, y);
    }

    fn first_step(&self, kept: &mut Self::Storage, start: Start<'_, R, S>, trial: R) -> Option<f64> {
        kept.first_step(start, trial)
    }

    fn advance(&self, kept: &mut Self::Storage, step: &mut Step<'_, R, S>) -> Result<(), Error> {
        kept.advance(step)
    }

    fn slope(&self, kept: &mut Self::Storage, system: &S, t: R, end: &mut Point<S::State>) {
        kept.slope(system, t, end);
    }

    fn mean_square_error(
        kept: &Self::Storage,
        h: R,
        rtol: &S::State,
        atol: &S::State,
        ends: [&S::State; 2],
    ) -> Option<f64> {
        kept.mean_square_error(h, rtol, atol, ends)
    }
}

/// A method of scenes.
pub(crate) type OfScenes<'a> = &'a dyn Erased<'a, f64, PreparedScene<'a>>;

/// A method of scenes on lanes.
pub(crate) type OfLanes<'a, L = F64x4> = &'a dyn Erased<'a, L, PreparedLanes<'a, L>>;

/// One on four lanes and on eight.
pub(crate) type OfBoth<'a> = (OfLanes<'a>, OfLanes<'a, F64x8>);

/// A method that integrates scenes, projected or not, and perhaps lanes of them.
#[derive(Clone, Copy)]
pub(crate) struct AnyMethod<'a> {
    method: OfScenes<'a>,
    lanes: Option<OfBoth<'a>>,
    onto: Onto,
}

/// What every step is projected onto. Storage has a size known to the compiler: rounded up, with invariants that are
/// always met.
#[derive(Clone, Copy)]
enum Onto {
    Nothing,
    Positions,
    FourInvariants,
    SixteenInvariants,
    Invariants,
}

impl<'a> AnyMethod<'a> {
    /// A method that integrates one trajectory at a time.
    pub(crate) fn single(method: OfScenes<'a>) -> Self {
        AnyMethod { method, lanes: None, onto: Onto::Nothing }
    }

    /// The same beside a method that integrates trajectories side by side.
    pub(crate) fn with_lanes(self, lanes: OfBoth<'a>) -> Self {
        AnyMethod { lanes: Some(lanes), ..self }
    }

    /// The method with a projection onto the equations between coordinates after each step.
    pub(crate) fn onto_positions(self) -> Self {
        AnyMethod { lanes: None, onto: Onto::Positions, ..self }
    }

    /// The method with a projection of each step onto the invariants of a scene, from one to [`MAX_INVARIANTS`].
    pub(crate) fn onto_invariants(self, n_invariants: usize) -> Option<Self> {
        let onto = match n_invariants {
            1..=4 => Onto::FourInvariants,
            5..=16 => Onto::SixteenInvariants,
            17..=MAX_INVARIANTS => Onto::Invariants,
            _ => return None,
        };
        Some(AnyMethod { lanes: None, onto, ..self })
    }

    /// For one trajectory at a time.
    pub(crate) fn of_scenes(self) -> Chosen<'a, Self> {
        Chosen::new(self)
    }

    /// For four trajectories side by side, if the method has lanes.
    pub(crate) fn of_lanes(self) -> Option<Chosen<'a, SideBySide<'a>>> {
        self.lanes.map(|(four, _)| SideBySide::chosen(self.method, four))
    }

    /// The same for eight.
    pub(crate) fn of_eight_lanes(self) -> Option<Chosen<'a, SideBySide<'a, F64x8>>> {
        self.lanes.map(|(_, eight)| SideBySide::chosen(self.method, eight))
    }
}

impl<'a> Choice<'a, f64, PreparedScene<'a>> for AnyMethod<'a> {
    fn method(self) -> OfScenes<'a> {
        self.method
    }

    fn keep(
        self,
        system: &PreparedScene<'a>,
        t0: f64,
        y0: &VecState,
        options: &Options<f64>,
    ) -> Box<dyn Kept<f64, PreparedScene<'a>> + 'a> {
        let method = Chosen::new(self.method);
        match self.onto {
            Onto::Nothing => self.method.keep(system, t0, y0, options),
            Onto::Positions => Projected::<_, MAX_INVARIANTS, OfPositions>::onto_positions(method)
                .keep(system, t0, y0, options),
            Onto::FourInvariants => Projected::<_, 4>::new(method).keep(system, t0, y0, options),
            Onto::SixteenInvariants => Projected::<_, 16>::new(method).keep(system, t0, y0, options),
            Onto::Invariants => Projected::<_, MAX_INVARIANTS>::new(method).keep(system, t0, y0, options),
        }
    }
}

/// A method for one trajectory and for several side by side.
#[derive(Clone, Copy)]
pub(crate) struct SideBySide<'a, L: Several = F64x4>(OfScenes<'a>, OfLanes<'a, L>);

impl<'a, L: Several> SideBySide<'a, L> {
    /// As a method.
    pub(crate) fn chosen(single: OfScenes<'a>, lanes: OfLanes<'a, L>) -> Chosen<'a, Self> {
        Chosen::new(SideBySide(single, lanes))
    }
}

impl<'a, L: Several> Choice<'a, f64, PreparedScene<'a>> for SideBySide<'a, L> {
    fn method(self) -> OfScenes<'a> {
        self.0
    }
}

impl<'a, L: Several + 'a> Choice<'a, L, PreparedLanes<'a, L>> for SideBySide<'a, L> {
    fn method(self) -> OfLanes<'a, L> {
        self.1
    }
}
