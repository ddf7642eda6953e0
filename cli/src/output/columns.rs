//! The columns of a motion: time, state, energy, outputs and derivatives by name, and panels of some of them.
//!
//! Does not know: formats of files.

use super::plot::{MAX_LINES, Panel};
use hamel_run::error::{Error, Problem};
use hamel_run::fit::{Quantity, place_of};
use hamel_run::info::Info;
use hamel_run::model::blocks::Block;
use hamel_run::simulation::Sample;

/// Names of the columns behind the time; outputs as `group.component`, derivatives by what `along` names.
pub(super) fn names<'a>(
    info: &Info,
    with_outputs: bool,
    along: impl Iterator<Item = &'a String> + Clone,
) -> Vec<String> {
    let own = Quantity::all(info).into_iter();
    let own =
        own.filter(|(_, own)| with_outputs || !matches!(own, Quantity::Output(_))).map(|(name, _)| name);
    let derivatives = along.flat_map(|by| info.state.iter().map(move |name| format!("d_{name}_d_{by}")));
    own.chain(derivatives).collect()
}

/// Values of these columns.
pub(super) fn values(sample: &Sample) -> impl Iterator<Item = f64> + '_ {
    sample.state.iter().chain(&sample.energy).chain(&sample.outputs).chain(&sample.along).copied()
}

/// Columns that share a panel, by their places and names.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Chosen {
    panels: Vec<Vec<(usize, String)>>,
    is_log: bool,
}

impl Chosen {
    /// Panels of columns by name, `a,b` for each; outputs also by the name of the component, where no other one has
    /// it.
    ///
    /// # Errors
    /// [`Error::Request`] for names of no column, and for more than a panel has colours for.
    pub fn new(info: &Info, along: &[String], plots: &[String], is_log: bool) -> Result<Chosen, Error> {
        let known = names(info, true, along.iter());
        let mut problems = Vec::new();
        let mut place = |name: &str| {
            let found = place_of(known.iter().map(String::as_str), name);
            if found.is_none() {
                problems.push(Problem::UnknownName {
                    path: "--plot".into(),
                    kind: "column",
                    name: name.to_owned(),
                    known: known.clone(),
                });
            }
            found.map(|k| (k, known[k].clone()))
        };
        let panels: Vec<Vec<(usize, String)>> = plots
            .iter()
            .map(|names| names.split(',').filter_map(|name| place(name.trim())).collect())
            .collect();
        if let Some(panel) = panels.iter().find(|panel| panel.len() > MAX_LINES) {
            let reason = format!(
                "has {} names for one panel, which has {MAX_LINES} colours: repeat --plot for another panel",
                panel.len()
            );
            problems.push(Problem::Unusable { path: "--plot".into(), reason });
        }
        if problems.is_empty() { Ok(Chosen { panels, is_log }) } else { Err(Error::Request { problems }) }
    }

    /// Whether nothing was chosen.
    pub(super) fn is_all(&self) -> bool {
        self.panels.is_empty()
    }

    /// The panels.
    ///
    /// # Errors
    /// [`Error::Request`] for a value that has no logarithm.
    pub(super) fn drawn(&self, blocks: &[Block], samples: &[Sample]) -> Result<Vec<Panel>, Error> {
        let panel = |places: &Vec<(usize, String)>| {
            let told: Vec<(String, String)> = places.iter().map(|(_, name)| spelled(name, blocks)).collect();
            let lines = places.iter().zip(&told).map(|((k, _), (name, _))| {
                let value = |sample: &Sample| {
                    let value = values(sample).nth(*k).unwrap_or(f64::NAN);
                    match self.is_log {
                        false => Ok(value),
                        true if value > 0.0 => Ok(value.log10()),
                        true => {
                            let reason = format!(
                                "is not possible: {name} is {value:?} at t = {:?}, which has no logarithm",
                                sample.t
                            );
                            Err(Error::unusable("--log", reason))
                        }
                    }
                };
                let values: Result<Vec<f64>, Error> = samples.iter().map(value).collect();
                Ok((name.clone(), values?))
            });
            let title = title(&told);
            Ok(Panel {
                title,
                lines: lines.collect::<Result<_, Error>>()?,
                is_log: self.is_log,
                ..Panel::default()
            })
        };
        self.panels.iter().map(panel).collect()
    }
}

/// How a column is spelled for people, and its unit.
fn spelled(name: &str, blocks: &[Block]) -> (String, String) {
    let members = blocks.iter().flat_map(|block| block.members.iter().map(move |member| (block, member)));
    let found = members.into_iter().find(|(_, (own, _))| own == name);
    found.map_or((name.to_owned(), String::new()), |(block, (_, spelled))| {
        (spelled.clone(), block.unit.clone())
    })
}

/// Names with their units, which are told once where all have the same.
fn title(told: &[(String, String)]) -> String {
    let with_unit =
        |name: String, unit: &str| if unit.is_empty() { name } else { format!("{name} [{unit}]") };
    let unit = told.first().map(|(_, unit)| unit.as_str()).unwrap_or_default();
    if told.iter().all(|(_, own)| own == unit) {
        let names: Vec<&str> = told.iter().map(|(name, _)| name.as_str()).collect();
        return with_unit(names.join(", "), unit);
    }
    told.iter().map(|(name, unit)| with_unit(name.clone(), unit)).collect::<Vec<_>>().join(", ")
}
