//! Coordinates of an initial state, moved until the equations between them hold.
//!
//! Deliberately does not know: where the state comes from, which of its coordinates somebody meant.

use hamel_runtime::{Positions, StateVector, System, consistent};

use super::built::BuiltScene;
use super::interpreter::Interpreter;
use super::positions::PositionLayout;
use crate::error::Error;

/// Most equations, and functions that coordinates in them keep.
const MAX_FUNCTIONS: usize = 64;

/// The state with coordinates that satisfy the equations between them, as [`consistent`] finds them; the same state
/// where nothing restricts it, and none where the scene leaves out a coordinate that it takes to tell.
///
/// # Errors
/// [`Error::NoStart`]; what lowering the equations can find.
pub(super) fn met(scene: &BuiltScene, params: &[f64], state: Vec<f64>) -> Result<Option<Vec<f64>>, Error> {
    if !scene.is_restricted() {
        return Ok(Some(state));
    }
    let of_equations;
    let scene = match scene.positions() {
        Some(_) => scene,
        None => {
            of_equations = match scene.with_positions() {
                Err(Error::NoPositions { .. }) => return Ok(None),
                found => found?,
            };
            &of_equations
        }
    };
    let (Some(layout), Ok(interpreter)) = (scene.positions(), scene.prepare(params)) else {
        return Ok(None);
    };
    let names = scene.executable().position_names();
    let system = &scene.equations.system;
    let no_start = |reason| Error::NoStart { model: system.name.clone(), reason };
    if names.len() > MAX_FUNCTIONS {
        return Err(no_start(format!("more than {MAX_FUNCTIONS} equations between coordinates")));
    }
    let closed = Closed { interpreter, layout };
    let mut y = Numbers(state);
    let Err(error) = consistent(&closed, 0.0, &mut y) else { return Ok(Some(y.0)) };
    let name = |index: usize| names.get(index).map_or("an equation", String::as_str);
    Err(no_start(match error {
        hamel_runtime::Error::PositionMissed { index, residual, .. } => {
            format!("{} is {residual:e} at the nearest coordinates", name(index))
        }
        hamel_runtime::Error::PositionSingular { index, residual, .. } => {
            format!(
                "{} is {residual:e} at a dead centre, where the coordinates do not change it",
                name(index)
            )
        }
        other => other.to_string(),
    }))
}

/// As many numbers as the scene carries.
#[derive(Clone, Debug)]
struct Numbers(Vec<f64>);

impl StateVector<f64> for Numbers {
    fn as_slice(&self) -> &[f64] {
        &self.0
    }

    fn as_mut_slice(&mut self) -> &mut [f64] {
        &mut self.0
    }
}

/// A scene that has its equations between coordinates.
struct Closed<'a> {
    interpreter: Interpreter<'a>,
    layout: &'a PositionLayout,
}

impl System<f64> for Closed<'_> {
    type State = Numbers;

    fn rhs(&self, t: f64, y: &Numbers, dy: &mut Numbers) {
        self.interpreter.rhs(t, &y.0, &mut dy.0);
    }
}

/// Functions beyond their number are zero wherever the state goes.
impl Positions<f64, MAX_FUNCTIONS> for Closed<'_> {
    fn n_equations(&self) -> usize {
        self.layout.n_equations
    }

    fn moved(&self) -> &[usize] {
        &self.layout.moved
    }

    fn residuals(&self, t: f64, y: &Numbers) -> [f64; MAX_FUNCTIONS] {
        let values = self.interpreter.positions(t, &y.0).unwrap_or_default();
        std::array::from_fn(|k| values.get(k).copied().unwrap_or(0.0))
    }

    fn residual_gradients(&self, t: f64, y: &Numbers, gradients: &mut [Numbers; MAX_FUNCTIONS]) {
        gradients.iter_mut().for_each(|gradient| gradient.0.fill(0.0));
        let rows = self.interpreter.position_gradients(t, &y.0).unwrap_or_default();
        gradients.iter_mut().zip(rows).for_each(|(gradient, row)| gradient.0 = row);
    }
}
