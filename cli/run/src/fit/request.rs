//! The question of a fit and its answer.
//!
//! Does not know: how the unknowns are searched.

use hamel_codegen::spec::Want;
use serde::{Deserialize, Serialize};

use super::verdict::Verdict;
use crate::direction::Direction;
use crate::error::Error;
use crate::info::Info;
use crate::method::{MethodName, Steps};

/// A number of a scene along its motion that can be measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Quantity {
    /// A component of the state, by its place.
    State(usize),
    /// The energy.
    Energy,
    /// A component of the outputs, by its place among all of them.
    Output(usize),
}

impl Quantity {
    /// What a scene has, by the names that its tables have: components of the state, `energy`, `group.component`.
    pub fn all(info: &Info) -> Vec<(String, Quantity)> {
        let mut all: Vec<(String, Quantity)> =
            info.state.iter().enumerate().map(|(k, name)| (name.clone(), Quantity::State(k))).collect();
        if info.has_energy {
            all.push((Want::Energy.name().to_owned(), Quantity::Energy));
        }
        let outputs = info.outputs.iter().flat_map(|group| {
            group.components.iter().map(move |component| format!("{}.{component}", group.name))
        });
        all.extend(outputs.enumerate().map(|(k, name)| (name, Quantity::Output(k))));
        all
    }

    /// The quantity of a name; outputs also by the name of the component, where no other one has it.
    pub fn named(info: &Info, name: &str) -> Option<Quantity> {
        let all = Quantity::all(info);
        place_of(all.iter().map(|(own, _)| own.as_str()), name).map(|k| all[k].1)
    }
}

/// The place of a name among columns: `group.component` also by the component alone, where no other one has it.
pub fn place_of<'a>(columns: impl Iterator<Item = &'a str> + Clone, name: &str) -> Option<usize> {
    let exact = columns.clone().position(|own| own == name);
    let is_alike = |own: &str| own.rsplit_once('.').is_some_and(|(_, component)| component == name);
    let mut alike = columns.enumerate().filter(|(_, own)| is_alike(own));
    exact.or_else(|| match (alike.next(), alike.next()) {
        (Some((k, _)), None) => Some(k),
        _ => None,
    })
}

/// A measured quantity, and how well it is measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Column {
    /// Its name.
    pub name: String,
    /// What it is.
    pub quantity: Quantity,
    /// Standard deviation of its errors; known for all columns or for none.
    pub sigma: Option<f64>,
}

/// Knowledge of an unknown beforehand.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Known {
    /// Its smallest value.
    pub least: f64,
    /// Its largest one.
    pub most: f64,
    /// A measurement of its own.
    pub prior: Option<Prior>,
}

impl Default for Known {
    fn default() -> Known {
        Known { least: f64::NEG_INFINITY, most: f64::INFINITY, prior: None }
    }
}

/// A normal distribution.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Prior {
    /// Its mean.
    pub mean: f64,
    /// Its standard deviation.
    pub deviation: f64,
}

/// What to fit to what, in the order of [`Info`]; the motion starts at time zero.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FitRequest {
    /// Parameters; of the free ones, where the search starts.
    pub params: Vec<f64>,
    /// The same of the initial state.
    pub initial: Vec<f64>,
    /// Parameters and components of the initial state to be found.
    pub free: Vec<Direction>,
    /// The knowledge of each of these.
    pub known: Vec<Known>,
    /// Further points from which the search starts.
    pub restarts: usize,
    /// Pieces of the motion that start on their own at first.
    pub segments: usize,
    /// The measured quantities.
    pub columns: Vec<Column>,
    /// Times from zero on, increasing.
    pub times: Vec<f64>,
    /// For each time a value of each column, where there is one.
    pub values: Vec<Vec<Option<f64>>>,
    /// The method of integration.
    pub method: MethodName,
    /// How it chooses steps.
    pub steps: Steps,
    /// Largest number of steps of one motion.
    pub max_steps: u64,
    /// Number of points of the fitted curves.
    pub n_curve: usize,
}

/// A number that was fitted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// What it is called.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// Its standard deviation to first order. A value at an end of its interval, which the data push beyond, has none.
    pub deviation: Option<f64>,
}

/// Where the search from one of several points ended.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Started {
    /// Values of the unknowns where it started.
    pub from: Vec<f64>,
    /// The sum of squares of the minimum, where one was found.
    pub sum_of_squares: Option<f64>,
    /// Whether the minimum is that of the answer.
    pub is_same: bool,
}

/// The answer of a fit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FitResponse {
    /// All parameters.
    pub params: Vec<f64>,
    /// The initial state.
    pub initial: Vec<f64>,
    /// The unknowns.
    pub estimates: Vec<Estimate>,
    /// Correlations of the estimates, row by row.
    pub correlation: Vec<Vec<f64>>,
    /// Root of the mean square of what is left of each column, in its own unit.
    pub rms: Vec<f64>,
    /// Number of values of each column.
    pub n_values: Vec<usize>,
    /// Number of unknowns that were measured on their own.
    pub n_priors: usize,
    /// Sum of squares of what is left, in units of the standard deviations where they are known.
    pub sum_of_squares: f64,
    /// The search from each point where it started.
    pub starts: Vec<Started>,
    /// Motions that were integrated.
    pub n_evaluations: usize,
    /// What the residuals say about the fit.
    pub verdict: Verdict,
    /// The residual of each value: the motion less the value, in the unit of the column; for each time one of each
    /// column, where there is a value.
    pub residuals: Vec<Vec<Option<f64>>>,
    /// Times of the curves.
    pub curve_times: Vec<f64>,
    /// The fitted motion at these times, a curve for each column.
    pub curves: Vec<Vec<f64>>,
}

impl FitResponse {
    /// Values and priors beyond those that determine the estimates.
    pub fn degrees_of_freedom(&self) -> usize {
        let n_known = self.n_values.iter().sum::<usize>() + self.n_priors;
        n_known.saturating_sub(self.estimates.iter().filter(|estimate| estimate.deviation.is_some()).count())
    }
}

/// How far a fit is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Progress {
    /// A step of a motion was made.
    Step,
    /// A motion was integrated.
    Motion {
        /// How many were until now.
        n: usize,
        /// The sum of squares of its residuals, where it has some.
        sum_of_squares: Option<f64>,
    },
}

/// How a start stays on its equations while parameters and components of it change.
pub trait Follows {
    /// Whether equations between coordinates, or constraints, restrict a start.
    fn is_on_equations(&self) -> bool;

    /// A state moved onto its equations, with the components that `given` names as they are.
    ///
    /// # Errors
    /// Which equation cannot be met.
    fn settled(&self, params: &[f64], y: &[f64], given: &[Direction]) -> Result<Vec<f64>, Error>;

    /// The derivatives of a start, by parameters and state, along directions, where the components that `given` names
    /// do not follow.
    ///
    /// # Errors
    /// Parameters that are not allowed; [`Error::Request`] where no component that may follow keeps an equation.
    fn tangents(
        &self,
        directions: &[Direction],
        at: (&[f64], &[f64]),
        given: &[Direction],
    ) -> Result<Vec<Vec<f64>>, Error>;
}
