//! What the trajectories of an ensemble start from.
//!
//! Does not know: how trajectories are integrated, files.

use std::collections::BTreeMap;
use std::ops::Range;

use hamel_codegen::scene::told_in_words;
use rayon::iter::{IntoParallelIterator as _, ParallelIterator as _};

use super::arguments::Arguments;
use crate::commands::options::assignments;
use hamel_run::admissible;
use hamel_run::dynamics::Factory;
use hamel_run::error::{Error, Problem};
use hamel_run::evaluate::{Drawn, Judge, prepare};
use hamel_run::forms::Forms;
use hamel_run::hash::fnv1a;
use hamel_run::info::Info;
use hamel_run::interpreted::Built;
use hamel_run::members::Beginnings;
use hamel_run::request::variation::Spread;
use hamel_run::start::{Alike, Starts};

/// Most trajectories: each has a number that a double holds exactly.
const MAX_TRAJECTORIES: usize = usize::MAX >> 11;

/// Trajectories whose starts are drawn by one thread in the same storage; a multiple of the lanes.
const BLOCK: usize = 256;

/// What varies along the lines of a table: names, and for each line a number for each of them.
#[derive(Clone, Debug, PartialEq)]
pub struct Lines {
    names: Vec<String>,
    rows: Vec<Vec<f64>>,
}

impl Lines {
    /// Names, and as many numbers in each row.
    pub fn of((names, rows): (Vec<String>, Vec<Vec<f64>>)) -> Lines {
        Lines { names, rows }
    }

    /// One line of nothing.
    pub fn none() -> Lines {
        Lines { names: Vec::new(), rows: vec![Vec::new()] }
    }
}

/// What each trajectory starts from: every line of the table, with every point of the grid, as often as values are
/// drawn.
pub(super) struct Plan<'a> {
    arguments: &'a Arguments,
    info: &'a Info,
    /// Parameters of all.
    set: BTreeMap<String, f64>,
    /// Components of all initial states.
    given: BTreeMap<String, f64>,
    /// Names in the table, then those of the grid.
    names: Vec<String>,
    /// Values of the names in the table, a line after the other; one without values when there is no table.
    lines: Vec<Vec<f64>>,
    /// Number of points of the grid.
    n_grid: usize,
}

/// Parameters and initial state of a trajectory, or why there are none.
type Beginning = Result<(Vec<f64>, Vec<f64>), String>;

/// The starts of trajectories in a row.
pub(super) struct Row {
    /// The values that vary, a line for each trajectory; NaN for what was not drawn because nothing could be drawn
    /// around.
    pub(super) inputs: Vec<f64>,
    pub(super) members: Beginnings,
}

impl<'a> Plan<'a> {
    pub(super) fn new(
        info: &'a Info,
        forms: &Forms,
        arguments: &'a Arguments,
        lines: Lines,
    ) -> Result<Plan<'a>, Error> {
        if arguments.samples == 0 {
            return Err(Error::unusable("--samples", "is 0, but the end is a sample: give at least 1"));
        }
        let Lines { mut names, rows: lines } = lines;
        let zeros = |names: &mut dyn Iterator<Item = &String>| {
            names.map(|name| (name.clone(), 0.0)).collect::<Vec<(String, f64)>>()
        };
        let mut problems = Vec::new();
        let inputs = info.inputs.iter().map(|input| input.name.as_str());
        let inputs = inputs.filter(|name| info.noises.iter().all(|noise| noise != name));
        let known: Vec<&str> = info.param_names().into_iter().chain(forms.known()).chain(inputs).collect();
        let kind = "parameter, state variable or input";
        let set =
            assignments(&arguments.motion.set, "--set", "parameter", &info.param_names(), &mut problems);
        let given =
            assignments(&arguments.motion.initial, "--initial", "state", &forms.known(), &mut problems);
        let of_table = assignments(&zeros(&mut names.iter()), "--table", kind, &known, &mut problems);
        let swept = zeros(&mut arguments.sweep.iter().map(|s| &s.name));
        let swept = assignments(&swept, "--sweep", kind, &known, &mut problems);
        let spread = zeros(&mut arguments.spread.iter().map(|s| &s.name));
        let spread = assignments(&spread, "--spread", kind, &known, &mut problems);
        let all = given.keys().chain(of_table.keys()).chain(swept.keys()).chain(spread.keys());
        let is_input = |name: &&str| info.inputs.iter().any(|input| input.name == *name);
        if let Err(reason) = forms.form_of(all.map(String::as_str).filter(|name| !is_input(name))) {
            problems.push(Problem::Unusable { path: "the initial state".into(), reason });
        }
        let sources = [("--set", &set), ("--initial", &given), ("--table", &of_table), ("--sweep", &swept)];
        for (at, (path, values)) in sources.iter().enumerate() {
            for (other, earlier) in &sources[..at] {
                problems.extend(values.keys().filter(|name| earlier.contains_key(*name)).map(|name| {
                    let reason = format!("gives {name}, which {other} gives as well: leave one of them out");
                    Problem::Unusable { path: (*path).to_owned(), reason }
                }));
            }
        }
        if !problems.is_empty() {
            return Err(Error::Request { problems });
        }
        let count = arguments.count.unwrap_or(1);
        let n_lines = lines.len();
        let grid = arguments.sweep.iter().map(|s| s.n).try_fold(1_usize, usize::checked_mul);
        if count == 0 || n_lines == 0 {
            let path = if count == 0 { "--count" } else { "--table" };
            return Err(Error::unusable(path, "leaves no trajectory: give at least one"));
        }
        let all = grid.and_then(|n| n.checked_mul(n_lines)?.checked_mul(count));
        if all.is_none_or(|n| n > MAX_TRAJECTORIES) {
            // The factors, the largest of which is to blame.
            let factors = [
                (grid.unwrap_or(usize::MAX), "--sweep", "points of the grid"),
                (count, "--count", "draws"),
                (n_lines, "--table", "lines"),
            ];
            let told = factors.iter().filter(|(n, ..)| *n > 1).map(|(n, _, what)| match *n {
                usize::MAX => format!("too many {what}"),
                n => format!("{n} {what}"),
            });
            let told = told.collect::<Vec<_>>().join(" times ");
            let (_, path, _) = factors.into_iter().max_by_key(|(n, ..)| *n).unwrap_or(factors[0]);
            let reason = format!("makes more than {MAX_TRAJECTORIES} trajectories ({told}): take fewer");
            return Err(Error::unusable(path, reason));
        }
        names.extend(arguments.sweep.iter().map(|sweep| sweep.name.clone()));
        let n_grid = grid.unwrap_or(usize::MAX);
        Ok(Plan { arguments, info, set, given, names, lines, n_grid })
    }

    fn count(&self) -> usize {
        self.arguments.count.unwrap_or(1)
    }

    /// Number of trajectories.
    pub(super) fn len(&self) -> usize {
        self.lines.len() * self.n_grid * self.count()
    }

    /// Names of all that varies.
    pub(super) fn names(&self) -> Vec<String> {
        let drawn = self.arguments.spread.iter().map(|s| &s.name).filter(|name| !self.names.contains(name));
        self.names.iter().chain(drawn).cloned().collect()
    }

    /// Values of all names but those that are drawn: of a line of the table and a point of the grid, the last name of
    /// which runs fastest.
    fn point(&self, at: usize) -> Vec<f64> {
        let mut values = Vec::new();
        self.add_point(at, &mut values);
        values
    }

    /// [`point`](Self::point) behind other values.
    fn add_point(&self, at: usize, values: &mut Vec<f64>) {
        values.extend_from_slice(&self.lines[at / self.n_grid]);
        let first = values.len();
        let mut rest = at % self.n_grid;
        for sweep in self.arguments.sweep.iter().rev() {
            values.insert(first, sweep.value(rest % sweep.n));
            rest /= sweep.n;
        }
    }

    /// Whether trajectories differ in their inputs.
    pub(super) fn has_inputs(&self) -> bool {
        self.names().iter().any(|name| self.info.inputs.iter().any(|input| input.name == *name))
    }

    /// What became of the components of the first initial state that neither the options nor the plan give.
    ///
    /// # Errors
    /// As [`Starts::told`].
    pub(super) fn told(&self, starts: &Starts<'_>, found: (&[f64], &[f64])) -> Result<Option<String>, Error> {
        let names = self.names();
        let mut given = self.given.clone();
        // What varies is given; parameters among it are of no account here.
        given.extend(names.into_iter().map(|name| (name, f64::NAN)));
        let params = found.0.iter().copied().take(self.info.params.len()).collect::<Vec<f64>>();
        Ok(told_in_words(&starts.told([&self.set, &given], (&params, found.1))?))
    }

    /// The starts of some trajectories in a row, on the threads of the current pool; `fast` evaluates with the bits of
    /// the scene that chooses.
    ///
    /// Where starts are alike but for the values that vary, the rule of initial states is asked once for all of them,
    /// and a start at which something has no value is chosen by itself.
    pub(super) fn members(
        &self,
        range: Range<usize>,
        starts: &Starts<'_>,
        (scene, fast): (&Built, &dyn Factory),
    ) -> Row {
        let names = self.names();
        let alike = starts.alike(&self.set, &self.given, &names);
        let alike_at_points = starts.alike(&self.set, &self.given, &self.names);
        let place = |spread: &Spread| {
            let at = names.iter().position(|name| *name == spread.name)?;
            Some((at, spread.key(self.arguments.seed)))
        };
        let drawn_at: Vec<(usize, u64)> = self.arguments.spread.iter().filter_map(place).collect();
        let mut drawing = Drawing {
            plan: self,
            starts,
            scene,
            names,
            drawn_at,
            alike,
            first_point: 0,
            nominal: Vec::new(),
        };
        // What is drawn is drawn around these.
        let points = range.start / self.count()..range.end.div_ceil(self.count());
        let nominal = |at: usize| {
            let found = alike_at_points.as_ref().map(|alike| alike.with(&self.point(at)));
            let found = found.filter(|(params, y)| Judge::new(fast).have_values(&[params], &[y]));
            found.map_or_else(|| drawing.choose(&self.at_point(at)), Ok)
        };
        let nominal = points.clone().into_par_iter().map(nominal).collect();
        (drawing.first_point, drawing.nominal) = (points.start, nominal);
        let block = |first: usize| {
            let own = first..range.end.min(first + BLOCK);
            let mut row = self.room(own.len());
            drawing.add(&mut row, own, fast);
            row
        };
        let blocks = range.clone().step_by(BLOCK).collect::<Vec<usize>>();
        let blocks: Vec<Row> = blocks.into_par_iter().map(block).collect();
        let mut all = self.room(range.len());
        for Row { mut inputs, members } in blocks {
            all.inputs.append(&mut inputs);
            all.members.append(members);
        }
        all
    }

    /// Room for the starts of so many trajectories.
    fn room(&self, n: usize) -> Row {
        let n_inputs = if self.has_inputs() { self.info.inputs.len() } else { 0 };
        let mut members = Beginnings::none(self.info.params.len() + n_inputs, self.info.state.len());
        members.reserve(n);
        Row { inputs: Vec::with_capacity(n * self.names().len()), members }
    }

    /// The values that do not have to be drawn, by name.
    fn at_point(&self, at: usize) -> Vec<(&str, f64)> {
        self.names.iter().map(String::as_str).zip(self.point(at)).collect()
    }

    /// Names of what varies: of the table, of the grid, and what is drawn.
    pub(super) fn varied<'n>(arguments: &'n Arguments, lines: &'n Lines) -> impl Iterator<Item = &'n String> {
        let swept = arguments.sweep.iter().map(|sweep| &sweep.name);
        lines.names.iter().chain(swept).chain(arguments.spread.iter().map(|spread| &spread.name))
    }

    /// A hash of the table: FNV-1a of its names and of the bits of its numbers; none of no table.
    pub(super) fn table_hash(&self) -> Option<String> {
        let n = self.lines.first().map_or(0, Vec::len);
        if n == 0 {
            return None;
        }
        let names = self.names.iter().take(n).flat_map(|name| name.bytes().chain([b',']));
        Some(fnv1a(names.chain(self.lines.iter().flatten().flat_map(|x| x.to_le_bytes()))))
    }
}

/// Starts that are being drawn.
struct Drawing<'p, 'a> {
    plan: &'p Plan<'a>,
    starts: &'p Starts<'p>,
    scene: &'p Built,
    /// Names of all that varies.
    names: Vec<String>,
    /// Places among them of the drawn values, and the keys by which these are drawn.
    drawn_at: Vec<(usize, u64)>,
    /// Starts that are the same but for what varies, if they are.
    alike: Option<Alike>,
    first_point: usize,
    /// The starts around which values are drawn, from the first point on.
    nominal: Vec<Beginning>,
}

impl Drawing<'_, '_> {
    fn nominal(&self, k: usize) -> &Beginning {
        &self.nominal[k / self.plan.count() - self.first_point]
    }

    /// The start with these values, by the rule of initial states.
    fn choose(&self, values: &[(&str, f64)]) -> Beginning {
        let Plan { info, set, given, .. } = self.plan;
        let (mut set, mut given) = (set.clone(), given.clone());
        let mut inputs: Vec<f64> = info.inputs.iter().map(|input| input.default).collect();
        for (name, value) in values {
            if let Some(k) = info.inputs.iter().position(|input| input.name == *name) {
                inputs[k] = *value;
                continue;
            }
            let is_param = info.params.iter().any(|p| p.name == *name);
            if is_param { &mut set } else { &mut given }.insert((*name).to_owned(), *value);
        }
        let of_inputs = self.plan.has_inputs();
        let chosen = self.starts.choose(self.scene, &set, &given).and_then(|(mut params, y)| {
            params.extend(inputs.iter().filter(|_| of_inputs));
            admissible::check(&*prepare(self.scene, &params)?, &y, 0)?;
            Ok((params, y))
        });
        chosen.map_err(|e| e.to_string())
    }

    /// What varies and the start of a trajectory that is not like the others.
    fn start(&self, k: usize) -> (Vec<f64>, Beginning) {
        let plan = self.plan;
        let mut values = plan.at_point(k / plan.count());
        let around = match self.nominal(k) {
            Ok(around) if !plan.arguments.spread.is_empty() => around,
            chosen => {
                values.resize(self.names.len(), ("", f64::NAN));
                return (values.into_iter().map(|(_, x)| x).collect(), chosen.clone());
            }
        };
        let (params, state) = around;
        for spread in &plan.arguments.spread {
            let inputs = plan.info.inputs.iter().map(|input| input.name.as_str());
            let params_by_name = plan.info.param_names().into_iter().chain(inputs).zip(params);
            let center = match params_by_name.into_iter().find(|(name, _)| *name == spread.name) {
                Some((_, x)) => *x,
                None => match self.starts.value(params, state, &spread.name) {
                    Ok(x) => x.unwrap_or_default(),
                    Err(error) => {
                        values.resize(self.names.len(), ("", f64::NAN));
                        return (values.into_iter().map(|(_, x)| x).collect(), Err(error.to_string()));
                    }
                },
            };
            let value = spread.draw(center, plan.arguments.seed, k);
            match values.iter_mut().find(|(name, _)| *name == spread.name) {
                Some((_, x)) => *x = value,
                None => values.push((spread.name.as_str(), value)),
            }
        }
        (values.iter().map(|(_, x)| *x).collect(), self.choose(&values))
    }

    /// Writes what varies of a trajectory that is like the others, and its start; whether it is.
    fn draw(&self, k: usize, (values, params, state): &mut Drawn) -> bool {
        let (Some(alike), Ok(around), false) = (&self.alike, self.nominal(k), self.drawn_at.is_empty())
        else {
            return false;
        };
        values.clear();
        self.plan.add_point(k / self.plan.count(), values);
        values.resize(self.names.len(), f64::NAN);
        for (spread, (at, key)) in self.plan.arguments.spread.iter().zip(&self.drawn_at) {
            values[*at] = spread.draw_by(*key, alike.value(*at, around), k);
        }
        alike.write(values, params, state);
        true
    }

    /// Adds starts in a row; nothing is allocated for a single one where starts are alike and the scene is compiled.
    fn add(&self, row: &mut Row, range: Range<usize>, fast: &dyn Factory) {
        let mut draw = |k: usize, drawn: &mut Drawn| self.draw(k, drawn);
        Judge::new(fast).each(range, &mut draw, &mut |k, drawn| {
            if let Some((values, params, state)) = drawn {
                row.inputs.extend_from_slice(values);
                row.members.push(params, state);
                return;
            }
            let (own, start) = self.start(k);
            row.inputs.extend(own);
            match start {
                Ok((params, y)) => row.members.push(&params, &y),
                Err(reason) => row.members.push_failed(reason),
            }
        });
    }
}
