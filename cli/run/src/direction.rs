//! What a motion is differentiated by, by name.
//!
//! Does not know: how derivatives are computed.

use hamel_runtime::Dual;
use serde::{Deserialize, Serialize};

use super::info::Info;
use crate::error::Problem;

/// What a motion is differentiated by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Direction {
    /// A parameter, by its place.
    Param(usize),
    /// A component of the initial state, by its place.
    Initial(usize),
}

impl Direction {
    /// Directions by name, in their order; `path` says where they were given.
    ///
    /// # Errors
    /// Names that are neither of a parameter nor of a component of the state, and repeated ones.
    pub fn named(info: &Info, given: &[String], path: &str) -> Result<Vec<Direction>, Vec<Problem>> {
        let known: Vec<&str> = info.param_names().into_iter().chain(info.state_names()).collect();
        let (mut directions, mut problems) = (Vec::new(), Vec::new());
        for name in given {
            match known.iter().position(|own| own == name) {
                None => problems.push(Problem::UnknownName {
                    path: path.to_owned(),
                    kind: "parameter or component of the state",
                    name: name.clone(),
                    known: known.iter().map(|name| (*name).to_owned()).collect(),
                }),
                Some(k) => {
                    let direction = match k.checked_sub(info.params.len()) {
                        None => Direction::Param(k),
                        Some(at) => Direction::Initial(at),
                    };
                    if directions.contains(&direction) {
                        problems.push(Problem::Repeated { path: path.to_owned(), name: name.clone() });
                    }
                    directions.push(direction);
                }
            }
        }
        if problems.is_empty() { Ok(directions) } else { Err(problems) }
    }

    /// Parameters with their derivatives along the direction.
    pub(super) fn params(self, values: &[f64]) -> Vec<Dual> {
        let mut duals: Vec<Dual> = values.iter().copied().map(Dual::constant).collect();
        if let Direction::Param(k) = self {
            duals[k] = Dual::variable(values[k]);
        }
        duals
    }

    /// The name that it has in a scene.
    pub fn name(self, info: &Info) -> &str {
        match self {
            Direction::Param(k) => &info.params[k].name,
            Direction::Initial(k) => &info.state[k],
        }
    }
}
