//! How the start of a motion follows what the motion is differentiated by, or what is fitted: coordinates and
//! velocities that nobody gave stay on the equations between coordinates and the constraints.
//!
//! Does not know: how a motion is integrated, how anything was asked for.

use std::collections::BTreeMap;

use hamel_codegen::scene::{
    Interpreter, Origin, Prior, free_coordinates, free_velocities, initial_slopes, settle,
};
use hamel_codegen::spec::Want;
use hamel_program::program::ViolatedCondition;
use hamel_runtime::Dual;
use nalgebra::{DMatrix, DVector};

use super::direction::Direction;
use super::dynamics::{BadParams, Factory as _, PreparedDuals};
use super::evaluate::{prepare, refused};
use super::fit::Follows;
use super::forms::Forms;
use super::interpreted::Built;
use super::start::{OfScene, origins};
use crate::error::Error;
use crate::model::Checked;

/// Part of a residual's derivative that is rounding, relative to its terms: what is left after it was solved for.
const ROUNDING: f64 = 1e-9;

/// The starts of a scene near one of them.
///
/// A start `y(p)` with `f(y; p) = 0` has the derivative
///
/// ```text
/// y' = s + d,    f_y d = -(f_p + f_y s),    d = 0 but for what follows
/// ```
///
/// along a direction that moves the state by `s`, with the least `d` where more components follow than equations hold.
/// What follows is what the rule of initial states moves; the component that a direction moves is given.
#[derive(Debug)]
pub struct Follower<'a> {
    scene: &'a Built,
    /// The scene with the residuals of the constraints that a state can violate.
    residuals: Option<Built>,
    origins: Vec<Origin>,
    /// Places of the velocities and momenta.
    velocities: Vec<usize>,
    /// Slopes of the components that the model gives, by each parameter.
    slopes: Vec<Vec<f64>>,
}

impl<'a> Follower<'a> {
    /// For a scene whose start has the components in `given`; none where nothing restricts a start.
    ///
    /// # Errors
    /// What [`Forms`] finds.
    pub fn new(
        model: &Checked,
        (scene, forms): (&'a Built, &Forms),
        [set, given]: [&BTreeMap<String, f64>; 2],
    ) -> Result<Follower<'a>, Error> {
        let info = scene.info();
        let prior = Prior::of(model, &info.scene, set);
        let given = forms.with_points(given).map_err(|reason| Error::unusable("initial", reason))?;
        let first = forms.with_momenta_of(prior.initial());
        let asked = forms
            .form_among(std::slice::from_ref(&first), given.keys().map(String::as_str))
            .map_err(|reason| Error::unusable("initial", reason))?;
        let origins = origins(&prior, &forms.names(&first), &forms.names(&asked), &given);
        let of_velocities = forms.names(&forms.velocities());
        let velocities = (0..of_velocities.len()).filter(|k| prior.is_velocity(&of_velocities[*k])).collect();
        let slope_of = |by: &str| {
            let slopes = initial_slopes(model, &info.scene, set, by);
            let own = info.state.iter().zip(&origins);
            own.map(|(name, origin)| match origin {
                Origin::Model => slopes.get(name).copied().unwrap_or_default(),
                Origin::Given | Origin::Chosen => 0.0,
            })
            .collect()
        };
        let slopes = info.params.iter().map(|p| slope_of(&p.name)).collect();
        Ok(Follower { scene, residuals: scene.with_residuals(), origins, velocities, slopes })
    }

    /// For a scene whose whole start is given, of which only what equations determine follows.
    pub fn of_whole(model: &Checked, scene: &'a Built) -> Follower<'a> {
        let info = scene.info();
        let prior = Prior::of(model, &info.scene, &BTreeMap::new());
        let velocities = (0..info.state.len()).filter(|k| prior.is_velocity(&info.state[*k])).collect();
        let slopes = vec![vec![0.0; info.state.len()]; info.params.len()];
        let origins = vec![Origin::Model; info.state.len()];
        Follower { scene, residuals: scene.with_residuals(), origins, velocities, slopes }
    }

    /// The same where values that the model gives by parameters stay as they are.
    #[must_use]
    pub fn without_slopes(mut self) -> Follower<'a> {
        self.slopes.iter_mut().flatten().for_each(|slope| *slope = 0.0);
        self
    }

    /// Whether equations restrict a start.
    pub fn is_restricted(&self) -> bool {
        self.scene.is_restricted()
            || self.residuals.is_some()
            || self.scene.info().output_range(Want::Constraint.name()).is_some()
    }

    /// Where values come from when the components at which directions start are given.
    fn origins_with(&self, given: &[Direction]) -> Vec<Origin> {
        let mut origins = self.origins.clone();
        for direction in given {
            if let Direction::Initial(k) = direction {
                origins[*k] = Origin::Given;
            }
        }
        origins
    }

    /// The derivative of a start by a direction, where the components that `given` names do not follow.
    ///
    /// # Errors
    /// Parameters that are not allowed; [`Error::Request`] where no component that may follow keeps an equation.
    fn tangent(
        &self,
        direction: Direction,
        (params, y): (&[f64], &[f64]),
        given: &[Direction],
    ) -> Result<Vec<f64>, Error> {
        let mut s = match direction {
            Direction::Param(k) => self.slopes[k].clone(),
            Direction::Initial(k) => (0..y.len()).map(|j| f64::from(u8::from(j == k))).collect(),
        };
        let origins = self.origins_with(&[given, &[direction]].concat());
        let along = direction.params(params);
        self.follow_positions(&mut s, (params, &along), y, &origins, direction)?;
        self.follow_constraint(&mut s, (params, &along), y, &origins, direction)?;
        Ok(s)
    }

    fn follow_positions(
        &self,
        s: &mut [f64],
        (params, along): (&[f64], &[Dual]),
        y: &[f64],
        origins: &[Origin],
        direction: Direction,
    ) -> Result<(), Error> {
        let Some(executable) = self.scene.equations_between_coordinates() else { return Ok(()) };
        let Some(layout) = &executable.positions else { return Ok(()) };
        let bad = |bad: ViolatedCondition| {
            let bad = BadParams { condition: bad.condition, meaning: bad.meaning };
            refused(self.scene.info(), params, bad)
        };
        let still = executable.prepare(params).map_err(bad)?;
        let moved: Interpreter<'_, Dual> = executable.prepare_over(along).map_err(bad)?;
        let rows = still.position_gradients(0.0, y).unwrap_or_default();
        let duals: Vec<Dual> = y.iter().zip(s.iter()).map(|(y, s)| Dual::new(*y, *s)).collect();
        let values = moved.positions(Dual::constant(0.0), &duals).unwrap_or_default();
        // Behind the equations is what coordinates keep, whatever its value is.
        let rates = values.iter().enumerate().map(|(k, value)| match k < layout.n_equations {
            true => value.derivative,
            false => 0.0,
        });
        let all = executable.components_in_positions();
        let names = executable.position_names();
        let sets = free_coordinates(origins, &layout.moved, &all);
        self.follow(s, (&rows, &rates.collect::<Vec<f64>>()), &sets, &names, direction)
    }

    fn follow_constraint(
        &self,
        s: &mut [f64],
        (params, along): (&[f64], &[Dual]),
        y: &[f64],
        origins: &[Origin],
        direction: Direction,
    ) -> Result<(), Error> {
        let scene = self.residuals.as_ref().unwrap_or(self.scene);
        let info = scene.info();
        let Some(range) = info.output_range(Want::Constraint.name()) else { return Ok(()) };
        let bad = |bad| refused(info, params, bad);
        let constants: Vec<Dual> = params.iter().copied().map(Dual::constant).collect();
        let (still, moved) =
            (scene.prepare_duals(&constants).map_err(bad)?, scene.prepare_duals(along).map_err(bad)?);
        let derivatives = |scene: &PreparedDuals<'_>, s: &[f64]| -> Vec<f64> {
            let duals: Vec<Dual> = y.iter().zip(s).map(|(y, s)| Dual::new(*y, *s)).collect();
            let outputs = scene.outputs(Dual::constant(0.0), &duals);
            outputs[range.clone()].iter().map(|value| value.derivative).collect()
        };
        let mut rows = vec![vec![0.0; y.len()]; range.len()];
        for k in &self.velocities {
            let mut unit = vec![0.0; y.len()];
            unit[*k] = 1.0;
            rows.iter_mut().zip(derivatives(&still, &unit)).for_each(|(row, slope)| row[*k] = slope);
        }
        let rates = derivatives(&moved, s);
        // Residuals of equations between coordinates have no velocity in them.
        let with_velocities: Vec<usize> =
            (0..rows.len()).filter(|k| rows[*k].iter().any(|slope| *slope != 0.0)).collect();
        let names = info.outputs.iter().find(|group| group.name == Want::Constraint.name());
        let names = names.map(|group| group.components.clone()).unwrap_or_default();
        let pick = |k: &usize| (rows[*k].clone(), rates[*k], names.get(*k).cloned().unwrap_or_default());
        let mut picked = (Vec::new(), Vec::new(), Vec::new());
        for (row, rate, name) in with_velocities.iter().map(pick) {
            picked.0.push(row);
            picked.1.push(rate);
            picked.2.push(name);
        }
        let sets = free_velocities(origins, &self.velocities);
        self.follow(s, (&picked.0, &picked.1), &sets, &picked.2, direction)
    }

    /// Adds the least change of the first set of free components that keeps every residual, whose slopes by the
    /// components and rates along `s` are given.
    fn follow(
        &self,
        s: &mut [f64],
        (rows, rates): (&[Vec<f64>], &[f64]),
        sets: &[Vec<usize>],
        names: &[String],
        direction: Direction,
    ) -> Result<(), Error> {
        let size = |k: usize| -> f64 { rows[k].iter().zip(&*s).map(|(slope, s)| (slope * s).abs()).sum() };
        let terms: Vec<f64> = (0..rows.len()).map(|k| size(k) + rates[k].abs()).collect();
        let kept =
            |left: &[f64]| left.iter().zip(&terms).position(|(left, terms)| left.abs() > ROUNDING * terms);
        let Some(mut broken) = kept(rates) else { return Ok(()) };
        let right = DVector::from_iterator(rates.len(), rates.iter().map(|rate| -rate));
        for free in sets {
            let slopes = DMatrix::from_fn(rows.len(), free.len(), |i, j| rows[i][free[j]]);
            let largest = slopes.amax();
            let Ok(change) = slopes.clone().svd(true, true).solve(&right, f64::EPSILON * 1e3 * largest)
            else {
                continue;
            };
            let left = &slopes * &change - &right;
            match kept(left.as_slice()) {
                Some(at) => broken = at,
                None => {
                    free.iter().zip(change.iter()).for_each(|(k, change)| s[*k] += change);
                    return Ok(());
                }
            }
        }
        let name = direction.name(self.scene.info());
        let reason = format!(
            "moves the start off {}, and no component that was not given keeps it: leave out some of the initial \
             values that were given",
            names.get(broken).map_or("an equation", String::as_str)
        );
        Err(Error::unusable(name, reason))
    }
}

impl Follows for Follower<'_> {
    fn settled(&self, params: &[f64], y: &[f64], given: &[Direction]) -> Result<Vec<f64>, Error> {
        let prepared = prepare(self.scene, params)?;
        let own_state = |y: &[f64]| -> Result<Vec<f64>, Error> { Ok(y.to_vec()) };
        let mut conditions = OfScene {
            positions: Some((self.scene, &prepared)),
            judge: self.residuals.as_ref().unwrap_or(self.scene),
            params,
            own_state: &own_state,
            velocities: &self.velocities,
        };
        let mut y = y.to_vec();
        settle(&mut conditions, &mut y, &self.origins_with(given), &self.velocities)?;
        Ok(y)
    }

    fn tangents(
        &self,
        directions: &[Direction],
        at: (&[f64], &[f64]),
        given: &[Direction],
    ) -> Result<Vec<Vec<f64>>, Error> {
        directions.iter().map(|direction| self.tangent(*direction, at, given)).collect()
    }
}
