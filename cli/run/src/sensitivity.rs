//! A scene with the derivatives of its motion by parameters and components of the initial state, as a scene of its own.
//!
//! Does not know: how anything is integrated, how a request was written.

use hamel_program::program::SeriesRoom;
use hamel_runtime::{Dual, Failure, Pivot, Real, System, Variational, Wiener};

use super::direction::Direction;
use super::dynamics::{
    BadParams, Dynamics, Factory, PositionEquations, PreparedDuals, PreparedScene, VecState,
};
use super::info::Info;
use super::method::MethodName;
use super::simulation::SimulateResponse;
use crate::error::Error;
use crate::names;

/// A scene whose state has the derivatives behind it, one direction after the other.
pub(super) struct Along<'f> {
    factory: &'f dyn Factory,
    directions: &'f [Direction],
    info: Info,
}

impl<'f> Along<'f> {
    /// The scene with the derivatives of its motion along directions.
    ///
    /// # Errors
    /// [`Error::Options`] for methods that need more than the right-hand side; `asked_by` names what wants derivatives.
    pub(super) fn new(
        factory: &'f dyn Factory,
        directions: &'f [Direction],
        method: MethodName,
        asked_by: &str,
    ) -> Result<Along<'f>, Error> {
        if !method.carries_derivatives() {
            let fit = MethodName::all().filter(|method| method.carries_derivatives());
            let fit: Vec<&str> = fit.map(MethodName::name).collect();
            let reason = format!(
                "{asked_by}: method {} needs more of a scene than its right-hand side, which is all that has \
                 derivatives; choose one of {}",
                method.name(),
                names::list(fit)
            );
            return Err(Error::Options { reason });
        }
        let base = factory.info();
        let mut state = base.state.clone();
        for direction in directions {
            let by = direction.name(base);
            state.extend(base.state.iter().map(|name| format!("d_{name}_d_{by}")));
        }
        let info = Info { state, ..base.clone() };
        Ok(Along { factory, directions, info })
    }

    /// An initial state with its derivatives, or those with everything else fixed where there are none.
    pub(super) fn initial(&self, initial: &[f64], tangents: &[Vec<f64>]) -> Vec<f64> {
        let mut extended = initial.to_vec();
        if tangents.is_empty() {
            for direction in self.directions {
                let is_moved = |k| f64::from(u8::from(*direction == Direction::Initial(k)));
                extended.extend((0..initial.len()).map(is_moved));
            }
        }
        extended.extend(tangents.iter().flatten());
        extended
    }

    /// Takes the derivatives apart from the state in what came out.
    pub(super) fn separate(&self, response: &mut SimulateResponse) {
        let n = self.factory.info().state.len();
        let derivatives = response.last.split_off(n);
        let names = self.directions.iter().map(|direction| direction.name(&self.info).to_owned());
        response.along = names.zip(derivatives.chunks(n).map(<[f64]>::to_vec)).collect();
        for sample in &mut response.samples {
            sample.along = sample.state.split_off(n);
        }
    }
}

impl Factory for Along<'_> {
    fn info(&self) -> &Info {
        &self.info
    }

    fn prepare(&self, values: &[f64]) -> Result<PreparedScene<'_>, BadParams> {
        let base = self.factory.prepare(values)?;
        let rates = self
            .directions
            .iter()
            .map(|direction| self.prepare_duals(&direction.params(values)).map(OnDuals));
        let rates = rates.collect::<Result<_, _>>()?;
        Ok(PreparedScene::new(PreparedAlong { info: &self.info, base, rates }))
    }

    fn prepare_noisy(&self, _values: &[f64], _noise: Wiener) -> Result<PreparedScene<'_>, BadParams> {
        let (condition, meaning) = ("a motion without noise".into(), "derivatives have none".into());
        Err(BadParams { condition, meaning })
    }

    fn prepare_duals(&self, values: &[Dual]) -> Result<PreparedDuals<'_>, BadParams> {
        self.factory.prepare_duals(values)
    }
}

/// The right-hand side over dual numbers as a system.
struct OnDuals<'a>(PreparedDuals<'a>);

impl System<Dual> for OnDuals<'_> {
    type State = VecState<Dual>;

    fn rhs(&self, t: Dual, y: &VecState<Dual>, dy: &mut VecState<Dual>) {
        self.0.rhs(t, &y.0, &mut dy.0);
    }
}

struct PreparedAlong<'a> {
    info: &'a Info,
    base: PreparedScene<'a>,
    /// One for each direction.
    rates: Vec<OnDuals<'a>>,
}

impl PreparedAlong<'_> {
    /// The state without derivatives.
    fn own<'y>(&self, y: &'y [f64]) -> &'y [f64] {
        &y[..self.base.info().state.len()]
    }
}

impl Dynamics for PreparedAlong<'_> {
    fn info(&self) -> &Info {
        self.info
    }

    fn rhs(&self, t: f64, y: &[f64], dy: &mut [f64]) {
        let zeros = VecState(vec![Dual::ZERO; self.own(y).len()]);
        let mut rates = VecState(vec![0.0; y.len()]);
        Variational::<f64, _, VecState>::new(&self.rates, zeros).rhs(t, &VecState(y.to_vec()), &mut rates);
        dy.copy_from_slice(&rates.0);
    }

    fn energy(&self, t: f64, y: &[f64]) -> Option<f64> {
        self.base.energy(t, self.own(y))
    }

    fn outputs(&self, t: f64, y: &[f64]) -> Vec<f64> {
        self.base.outputs(t, self.own(y))
    }

    fn series(&self, _: (f64, f64), _: &[f64], _: &mut SeriesRoom, _: &mut [VecState]) -> Option<f64> {
        None
    }

    fn jacobian(&self, _t: f64, _y: &[f64], rows: &mut [VecState]) {
        // No method that asks for it gets here; a matrix that is not finite is reported.
        rows.iter_mut().for_each(|row| row.0.fill(f64::NAN));
    }

    fn rhs_cost(&self) -> u64 {
        // A product of dual numbers is three of numbers.
        3 * self.base.rhs_cost() * self.rates.len() as u64
    }

    fn n_invariants(&self) -> usize {
        0
    }

    fn invariants(&self, _t: f64, _y: &[f64], _values: &mut [f64]) {}

    fn invariant_gradients(&self, _t: f64, _y: &[f64], _gradients: &mut [VecState]) {}

    fn watched_positions(&self) -> Option<PositionEquations<'_>> {
        self.base.positions()
    }

    /// Derivatives behind the state do not enter the equations.
    fn position_gradients(&self, t: f64, y: &[f64], gradients: &mut [VecState]) {
        let mut own = vec![VecState(vec![0.0; self.own(y).len()]); gradients.len()];
        self.base.position_gradients(t, self.own(y), &mut own);
        for (row, own) in gradients.iter_mut().zip(own) {
            row.0.fill(0.0);
            row.0[..own.0.len()].copy_from_slice(&own.0);
        }
    }

    fn constraint_rows(&self, t: f64, y: &[f64]) -> Vec<VecState> {
        let mut rows = self.base.constraint_rows(t, self.own(y));
        rows.iter_mut().for_each(|row| row.0.resize(y.len(), 0.0));
        rows
    }

    fn flows(&self) -> Result<usize, String> {
        Err("has derivatives behind its state, which have no exact flows: choose another method".to_owned())
    }

    fn flow(&self, _index: usize, _tau: f64, _y: &[f64], _increment: &mut [f64]) {}

    fn check(&self, t: f64, y: &[f64]) -> Result<(), Failure> {
        Dynamics::check(&*self.base, t, self.own(y))
    }

    fn domain(&self, t: f64, y: &[f64]) -> Result<(), Failure> {
        Dynamics::domain(&*self.base, t, self.own(y))
    }

    fn signature(&self, t: f64, y: &[f64]) -> f64 {
        Dynamics::signature(&*self.base, t, self.own(y))
    }

    fn pivots(&self, t: f64, y: &[f64], visit: &mut dyn FnMut(Pivot<f64>)) {
        Dynamics::pivots(&*self.base, t, self.own(y), visit);
    }
}
