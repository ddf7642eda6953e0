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
use super::forms::{Form, Forms};
use super::info::Info;
use super::interpreted::Built;
use super::start::{OfScene, origins};
use crate::error::Error;
use crate::model::Checked;

/// Part of a residual's derivative that is rounding, relative to its terms: what is left after it was solved for.
const ROUNDING: f64 = 1e-9;

/// The starts of a scene near one of them.
///
/// A start is a state in the variables that it is asked for in, and the scene's own state follows from it: momenta from
/// velocities, or the other way round. A start `y(p)` with `f(y; p) = 0` has the derivative
///
/// ```text
/// y' = s + d,    f_y d = -(f_p + f_y s),    d = 0 but for what follows
/// ```
///
/// along a direction that moves the state by `s`, with the least `d` where more components follow than equations hold.
/// What follows is what the rule of initial states moves; the component that a direction moves is given.
#[derive(Debug)]
pub struct Follower<'a> {
    model: &'a Checked,
    scene: &'a Built,
    /// The scene with the residuals of the constraints that a state can violate.
    residuals: Option<Built>,
    forms: Forms,
    /// The variables in which the model gives its initial values, or the user a whole start.
    first: Form,
    prior: Prior,
    /// What the user gave.
    given: BTreeMap<String, f64>,
    is_whole: bool,
    /// Places of the velocities and momenta.
    velocities: Vec<usize>,
    /// Parameters and start from which others are found.
    base: Option<(Vec<f64>, Vec<f64>)>,
}

/// A start in the variables that it is asked for in.
struct Asked<'y> {
    form: Form,
    y: &'y [f64],
    origins: Vec<Origin>,
}

impl<'a> Follower<'a> {
    /// For a scene whose start has the components in `given`; none where nothing restricts a start.
    ///
    /// # Errors
    /// What [`Forms`] finds.
    pub fn new(
        model: &'a Checked,
        (scene, forms): (&'a Built, Forms),
        [set, given]: [&BTreeMap<String, f64>; 2],
    ) -> Result<Follower<'a>, Error> {
        let prior = Prior::of(model, &scene.info().scene, set);
        let given = forms.with_points(given).map_err(|reason| Error::unusable("initial", reason))?;
        let first = forms.with_momenta_of(prior.initial());
        forms
            .form_among(std::slice::from_ref(&first), given.keys().map(String::as_str))
            .map_err(|reason| Error::unusable("initial", reason))?;
        Ok(Follower::in_form(model, (scene, forms, prior), first, given))
    }

    /// For a scene whose whole start is given by these names, of which only what equations determine follows.
    ///
    /// # Errors
    /// What [`Forms`] finds.
    pub fn of_whole(
        model: &'a Checked,
        (scene, forms): (&'a Built, Forms),
        given: &BTreeMap<String, f64>,
    ) -> Result<Follower<'a>, Error> {
        let prior = Prior::of(model, &scene.info().scene, &BTreeMap::new());
        let given = forms.with_points(given).map_err(|reason| Error::unusable("initial", reason))?;
        let first = forms.form_of(given.keys().map(String::as_str));
        let first = first.map_err(|reason| Error::unusable("initial", reason))?;
        let follower = Follower::in_form(model, (scene, forms, prior), first, given);
        Ok(Follower { is_whole: true, ..follower })
    }

    fn in_form(
        model: &'a Checked,
        (scene, forms, prior): (&'a Built, Forms, Prior),
        first: Form,
        given: BTreeMap<String, f64>,
    ) -> Follower<'a> {
        let of_velocities = forms.names(&forms.velocities());
        let velocities = (0..of_velocities.len()).filter(|k| prior.is_velocity(&of_velocities[*k])).collect();
        let residuals = scene.with_residuals();
        let (is_whole, base) = (false, None);
        Follower { model, scene, residuals, forms, first, prior, given, is_whole, velocities, base }
    }

    /// The same from a start, by its parameters and its state: values that the model gives by parameters move with
    /// them.
    #[must_use]
    pub fn from(mut self, params: Vec<f64>, initial: Vec<f64>) -> Follower<'a> {
        self.base = Some((params, initial));
        self
    }

    /// Whether a start depends on anything but the component that a direction names.
    pub fn is_restricted(&self) -> bool {
        self.is_on_equations()
            || self.asked(&[]) != self.forms.own_form()
            || !Prior::reads(self.model).is_empty()
    }

    /// The variables in which a start is asked for where directions name components of it.
    fn asked(&self, directions: &[Direction]) -> Form {
        let info = self.scene.info();
        let named = directions.iter().filter(|d| matches!(d, Direction::Initial(_))).map(|d| d.name(info));
        let names = self.given.keys().map(String::as_str).chain(named);
        let asked = self.forms.form_among(std::slice::from_ref(&self.first), names);
        // A velocity that is given beside a momentum that a direction names.
        asked.unwrap_or_else(|_| self.forms.own_form())
    }

    /// Where values come from when the components at which directions start are given.
    fn origins(&self, asked: &Form, given: &[Direction]) -> Vec<Origin> {
        let names = self.forms.names(asked);
        let mut origins = match self.is_whole {
            true => vec![Origin::Model; names.len()],
            false => origins(&self.prior, &self.forms.names(&self.first), &names, &self.given),
        };
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
        (params, start): (&[f64], &[f64]),
        given: &[Direction],
    ) -> Result<Vec<f64>, Error> {
        let given = [given, &[direction]].concat();
        let (form, own) = (self.asked(&given), self.forms.own_form());
        let y = self.forms.convert(params, 0.0, start, [&own, &form])?;
        let along = direction.params(params);
        let mut s = match direction {
            Direction::Param(_) => self.slopes(&along, &form, direction, &self.all_given(start, &given))?,
            Direction::Initial(k) => (0..y.len()).map(|j| f64::from(u8::from(j == k))).collect(),
        };
        let asked = Asked { origins: self.origins(&form, &given), form, y: &y };
        self.follow_positions(&mut s, (params, &along), &asked, direction)?;
        self.follow_constraint(&mut s, (params, &along), &asked, direction)?;
        self.own(&along, &asked, &s).map(|y| y.iter().map(|y| y.derivative).collect())
    }

    /// The scene's own state of a start that moves by `s`.
    fn own(&self, along: &[Dual], asked: &Asked<'_>, s: &[f64]) -> Result<Vec<Dual>, Error> {
        let y: Vec<Dual> = asked.y.iter().zip(s).map(|(y, s)| Dual::new(*y, *s)).collect();
        self.forms.slope(along, &y, [&asked.form, &self.forms.own_form()])
    }

    /// What the user gave, and the components of a start that directions name.
    fn all_given(&self, y: &[f64], directions: &[Direction]) -> BTreeMap<String, f64> {
        let info = self.scene.info();
        let named = directions.iter().filter_map(|direction| match direction {
            Direction::Initial(k) => Some((info.state[*k].clone(), y[*k])),
            Direction::Param(_) => None,
        });
        self.given.clone().into_iter().chain(named).collect()
    }

    /// Derivatives by a parameter of what the model says of a start, in a form.
    fn slopes(
        &self,
        along: &[Dual],
        asked: &Form,
        by: Direction,
        given: &BTreeMap<String, f64>,
    ) -> Result<Vec<f64>, Error> {
        let info = self.scene.info();
        let names = self.forms.names(&self.first);
        if self.is_whole {
            return Ok(vec![0.0; names.len()]);
        }
        let values: Vec<f64> = along.iter().map(|x| x.value).collect();
        let set = by_name(info, &values);
        let slopes = initial_slopes(self.model, &info.scene, &set, by.name(info));
        let slope = |name: &String| match given.contains_key(name) {
            true => 0.0,
            false => slopes.get(name).copied().unwrap_or_default(),
        };
        if self.first == *asked {
            return Ok(names.iter().map(slope).collect());
        }
        let y = Prior::of(self.model, &info.scene, &set).guess(&names, given, 0);
        let y: Vec<Dual> = names.iter().zip(y).map(|(name, y)| Dual::new(y, slope(name))).collect();
        let y = self.forms.slope(along, &y, [&self.first, asked])?;
        let asked_names = self.forms.names(asked);
        let moved = asked_names.iter().zip(y).map(|(name, y)| (given.contains_key(name), y.derivative));
        Ok(moved.map(|(is_given, slope)| if is_given { 0.0 } else { slope }).collect())
    }

    fn follow_positions(
        &self,
        s: &mut [f64],
        (params, along): (&[f64], &[Dual]),
        asked: &Asked<'_>,
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
        // Equations between coordinates, which all forms have.
        let rows = still.position_gradients(0.0, asked.y).unwrap_or_default();
        let duals: Vec<Dual> = asked.y.iter().zip(s.iter()).map(|(y, s)| Dual::new(*y, *s)).collect();
        let values = moved.positions(Dual::constant(0.0), &duals).unwrap_or_default();
        // Behind the equations is what coordinates keep, whatever its value is.
        let rates = values.iter().enumerate().map(|(k, value)| match k < layout.n_equations {
            true => value.derivative,
            false => 0.0,
        });
        let all = executable.components_in_positions();
        let names = executable.position_names();
        let sets = free_coordinates(&asked.origins, &layout.moved, &all);
        self.follow(s, (&rows, &rates.collect::<Vec<f64>>()), &sets, &names, direction)
    }

    fn follow_constraint(
        &self,
        s: &mut [f64],
        (params, along): (&[f64], &[Dual]),
        asked: &Asked<'_>,
        direction: Direction,
    ) -> Result<(), Error> {
        let scene = self.residuals.as_ref().unwrap_or(self.scene);
        let info = scene.info();
        let Some(range) = info.output_range(Want::Constraint.name()) else { return Ok(()) };
        let bad = |bad| refused(info, params, bad);
        let constants: Vec<Dual> = params.iter().copied().map(Dual::constant).collect();
        let (still, moved) =
            (scene.prepare_duals(&constants).map_err(bad)?, scene.prepare_duals(along).map_err(bad)?);
        let derivatives =
            |(scene, along): (&PreparedDuals<'_>, &[Dual]), s: &[f64]| -> Result<Vec<f64>, Error> {
                let outputs = scene.outputs(Dual::constant(0.0), &self.own(along, asked, s)?);
                Ok(outputs[range.clone()].iter().map(|value| value.derivative).collect())
            };
        let mut rows = vec![vec![0.0; s.len()]; range.len()];
        for k in &self.velocities {
            let mut unit = vec![0.0; s.len()];
            unit[*k] = 1.0;
            let slopes = derivatives((&still, &constants), &unit)?;
            rows.iter_mut().zip(slopes).for_each(|(row, slope)| row[*k] = slope);
        }
        let rates = derivatives((&moved, along), s)?;
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
        let sets = free_velocities(&asked.origins, &self.velocities);
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

impl Follower<'_> {
    /// A start of the scene's own in the form in which it is asked for, with the values that the model gives by other
    /// parameters, and what `given` names as it is.
    fn moved(
        &self,
        params: &[f64],
        y: &[f64],
        (asked, given): (&Form, &[Direction]),
    ) -> Result<Vec<f64>, Error> {
        let own = self.forms.own_form();
        let Some((before, start)) = &self.base else {
            return self.forms.convert(params, 0.0, y, [&own, asked]);
        };
        let info = self.scene.info();
        let [was, is] = [before.as_slice(), params]
            .map(|params| Prior::of(self.model, &info.scene, &by_name(info, params)));
        let given = self.all_given(y, given);
        let first_names = self.forms.names(&self.first);
        let mut found = self.forms.convert(before, 0.0, start, [&own, &self.first])?;
        let guesses = [was, is].map(|prior| prior.guess(&first_names, &given, 0));
        for (k, value) in found.iter_mut().enumerate() {
            // What a parameter does not move stays where it was settled.
            if guesses[0][k] != guesses[1][k] || given.contains_key(&first_names[k]) {
                *value = guesses[1][k];
            }
        }
        let mut found = self.forms.convert(params, 0.0, &found, [&self.first, asked])?;
        for (value, name) in found.iter_mut().zip(self.forms.names(asked)) {
            *value = given.get(&name).copied().unwrap_or(*value);
        }
        Ok(found)
    }
}

/// Parameters by name.
fn by_name(info: &Info, params: &[f64]) -> BTreeMap<String, f64> {
    info.params.iter().zip(params).map(|(p, x)| (p.name.clone(), *x)).collect()
}

impl Follows for Follower<'_> {
    fn is_on_equations(&self) -> bool {
        self.scene.is_restricted()
            || self.residuals.is_some()
            || self.scene.info().output_range(Want::Constraint.name()).is_some()
    }

    fn settled(&self, params: &[f64], y: &[f64], given: &[Direction]) -> Result<Vec<f64>, Error> {
        let prepared = prepare(self.scene, params)?;
        let (form, own) = (self.asked(given), self.forms.own_form());
        let mut y = self.moved(params, y, (&form, given))?;
        let own_state = |y: &[f64]| self.forms.convert(params, 0.0, y, [&form, &own]);
        let mut conditions = OfScene {
            positions: Some((self.scene, &prepared)),
            judge: self.residuals.as_ref().unwrap_or(self.scene),
            params,
            own_state: &own_state,
            velocities: &self.velocities,
        };
        settle(&mut conditions, &mut y, &self.origins(&form, given), &self.velocities)?;
        own_state(&y)
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
