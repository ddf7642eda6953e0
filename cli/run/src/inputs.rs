//! Inputs of a scene from a table, or held: which columns it has, and the values at a time.
//!
//! Does not know: where the table was read, how a scene is evaluated.

use std::fmt;
use std::sync::Arc;

use hamel_runtime::{Interpolation, PolynomialSignal, Real, Signal, Table, TableError, Wiener};
use serde_json::{Value, json};

use super::info::{Info, ParamEntry};
use crate::error::Error;
use crate::hash::fnv1a;

/// What is between two rows of a table of inputs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum Between {
    /// Straight lines.
    #[default]
    Linear,
    /// Cubics whose slopes are continuous.
    Cubic,
    /// The value of the row before, with a jump at every row.
    Hold,
}

impl Between {
    /// What has a name.
    ///
    /// # Errors
    /// [`Error::Request`] for other names.
    pub fn named(name: &str) -> Result<Between, Error> {
        match name {
            "linear" => Ok(Between::Linear),
            "cubic" => Ok(Between::Cubic),
            "hold" => Ok(Between::Hold),
            _ => Err(Error::unusable(
                "interpolation",
                format!("is {name:?}, but has to be linear, cubic or hold"),
            )),
        }
    }
}

/// What an input is.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Column {
    /// One value for all times.
    Held(f64),
    /// Values at times.
    Rows(Table<'static, 1>),
    /// The rate of the Wiener process of that number.
    Noise(Wiener, u32),
}

/// Inputs at times, column by column; some may be held.
#[derive(Clone)]
pub struct InputTable {
    path: String,
    columns: Vec<(String, Column)>,
}

impl fmt::Debug for InputTable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("InputTable").field("path", &self.path).finish_non_exhaustive()
    }
}

impl InputTable {
    /// A table of the rows under a line of names, of which one is `t`; `path` is shown in messages.
    ///
    /// # Errors
    /// [`Error::Request`] without a column `t`, without another one, or where the rows are no table.
    pub fn new(
        path: &str,
        names: &[String],
        rows: &[Vec<f64>],
        between: Between,
    ) -> Result<InputTable, Error> {
        let refused = |reason: String| Error::unusable(path, reason);
        let Some(of_time) = names.iter().position(|name| name == "t") else {
            return Err(refused(format!("has no column `t`, but {}", names.join(", "))));
        };
        if names.len() == 1 {
            return Err(refused("has no column besides `t`: add one for each input".to_owned()));
        }
        // Rows live as long as the program, which reads few tables.
        let times: &'static [f64] = rows.iter().map(|row| row[of_time]).collect::<Vec<_>>().leak();
        let interpolation = match between {
            Between::Linear => Interpolation::Linear,
            Between::Cubic => Interpolation::Cubic,
            Between::Hold => Interpolation::Hold,
        };
        let mut columns = Vec::new();
        for (k, name) in names.iter().enumerate().filter(|(k, _)| *k != of_time) {
            let values: &'static [[f64; 1]] = rows.iter().map(|row| [row[k]]).collect::<Vec<_>>().leak();
            let table = Table::new(times, values, interpolation).map_err(|error| {
                refused(match error {
                    TableError::Empty => "has no row".to_owned(),
                    TableError::Time { row } => {
                        let times = &times[row.saturating_sub(1)..=row];
                        format!("has times that do not grow: {times:?}")
                    }
                    other => format!("is no table of inputs: {other}"),
                })
            })?;
            if columns.iter().any(|(known, _)| known == name) {
                return Err(refused(format!("has the column `{name}` twice")));
            }
            columns.push((name.clone(), Column::Rows(table)));
        }
        Ok(InputTable { path: path.to_owned(), columns })
    }

    /// Inputs that are held; `path` is shown in messages.
    pub fn held(path: &str, values: &[(String, f64)]) -> InputTable {
        let columns = values.iter().map(|(name, value)| (name.clone(), Column::Held(*value))).collect();
        InputTable { path: path.to_owned(), columns }
    }

    /// The inputs of both; those of the other one where both have one.
    #[must_use]
    pub fn overlaid(&self, other: &InputTable) -> InputTable {
        let is_kept = |name: &str| other.columns.iter().all(|(known, _)| known != name);
        let kept = self.columns.iter().filter(|(name, _)| is_kept(name));
        InputTable { path: other.path.clone(), columns: kept.chain(&other.columns).cloned().collect() }
    }

    /// Whether there is something for an input.
    pub fn has(&self, name: &str) -> bool {
        self.columns.iter().any(|(known, _)| known == name)
    }

    /// The value that an input is held at; none where the table has it at times, or not at all.
    pub fn held_value(&self, name: &str) -> Option<f64> {
        self.columns.iter().find_map(|(known, column)| match column {
            Column::Held(value) if known == name => Some(*value),
            _ => None,
        })
    }

    /// What the inputs are, for a document: the values of those that are held, and a hash of each column.
    pub fn described(&self) -> Value {
        let of_column = |(name, column): &(String, Column)| {
            let described = match column {
                Column::Held(value) => json!(value),
                Column::Noise(wiener, k) => json!({"noise": format!("{wiener:?} {k}")}),
                Column::Rows(table) => json!({"table_hash": fnv1a(format!("{table:?}").bytes())}),
            };
            (name.clone(), described)
        };
        Value::Object(self.columns.iter().map(of_column).collect())
    }

    /// Whether a scene takes every input that the table has.
    pub fn fits(&self, info: &Info) -> bool {
        self.columns.iter().all(|(name, _)| info.inputs.iter().any(|input| input.name == *name))
    }

    /// The inputs of a scene that the table drives: for each the column, or its held value.
    ///
    /// # Errors
    /// [`Error::Request`] with the column that is no input of the scene.
    pub fn of_scene(&self, info: &Info) -> Result<Driven, Error> {
        if let Some((name, _)) =
            self.columns.iter().find(|(name, _)| info.inputs.iter().all(|i| i.name != *name))
        {
            let known: Vec<&str> = info.inputs.iter().map(|i| i.name.as_str()).collect();
            let reason = match known.is_empty() {
                true => format!(
                    "has a column `{name}`, but scene {} of {} takes no input",
                    info.scene, info.model
                ),
                false => format!(
                    "has a column `{name}`, which is no input of scene {}: its inputs are {}",
                    info.scene,
                    known.join(", ")
                ),
            };
            return Err(Error::unusable(&self.path, reason));
        }
        let column = |name: &str| self.columns.iter().find(|(own, _)| own == name).map(|(_, column)| *column);
        let or_held = |input: &ParamEntry| column(&input.name).unwrap_or(Column::Held(input.default));
        Ok(Driven(info.inputs.iter().map(or_held).collect()))
    }
}

/// The inputs of a scene in its order: the values that they are held at, or what drives them.
#[derive(Clone, Debug, PartialEq)]
pub struct Driven(Vec<Column>);

impl Driven {
    /// The inputs of a scene with noise: a path gives the noises that no table has, and the others are driven as
    /// before, or held at values that stand in their place.
    pub(super) fn noisy(info: &Info, drive: Option<&Driven>, held: &[f64], wiener: Wiener) -> Driven {
        let mut n_noises = 0;
        let column = |(k, input): (usize, &ParamEntry)| {
            let noise = info.noises.contains(&input.name).then(|| {
                n_noises += 1;
                Column::Noise(wiener, n_noises - 1)
            });
            let own = drive.map(|drive| drive.0[k]).filter(|own| matches!(own, Column::Rows(_)));
            own.or(noise).unwrap_or_else(|| Column::Held(held.get(k).copied().unwrap_or(input.default)))
        };
        Driven(info.inputs.iter().enumerate().map(column).collect())
    }

    /// The inputs at a time.
    pub fn at<R: Real>(&self, t: R) -> Vec<R> {
        let value = |column: &Column| match column {
            Column::Rows(table) => Signal::<R, (), 1>::at(table, t, &())[0],
            Column::Held(value) => R::from_f64(*value),
            Column::Noise(wiener, k) => {
                let t = if R::ZERO.all_gt(t) { -t.magnitude() } else { t.magnitude() };
                R::from_f64(wiener.rate(*k, t))
            }
        };
        self.0.iter().map(value).collect()
    }

    /// The coefficients of the inputs at a time on the way to another one, each order by itself, and the time up to
    /// which they hold; see [`PolynomialSignal::piece`].
    pub fn piece(&self, (t, towards): (f64, f64)) -> (Vec<Vec<f64>>, f64) {
        let mut until = towards;
        let mut orders = vec![vec![0.0; self.0.len()]; Self::MAX_DEGREE + 1];
        for (i, column) in self.0.iter().enumerate() {
            let mut own = [[0.0]; Self::MAX_DEGREE + 1];
            match column {
                Column::Rows(table) => until = table.piece((t, until), &mut own),
                Column::Held(value) => own[0] = [*value],
                Column::Noise(wiener, k) => own[0] = [wiener.rate(*k, t)],
            }
            orders.iter_mut().zip(own).for_each(|(order, [coefficient])| order[i] = coefficient);
        }
        (orders, until)
    }

    /// Cubics are the pieces of the highest degree.
    const MAX_DEGREE: usize = 3;
}

/// What drives a scene, shared by all that evaluate it.
pub(super) type Drive = Option<Arc<Driven>>;
