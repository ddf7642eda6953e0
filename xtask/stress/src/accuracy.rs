//! Rounding errors of a generated function, in multiples of what its operations and its inputs make unavoidable.
//!
//! Two measures of what is unavoidable. Of the *terms*: the largest term that entered a result times the machine
//! epsilon; more than a few of these is a fault of the arithmetic. Of the *inputs*: `|f| + sum_i |df/dx_i| |x_i|` times
//! the machine epsilon, what rounding of states and parameters would do to the exact function. The first forgives an
//! expression that cancels, the second does not: it is large exactly where another way of writing the same function
//! would be better.
//!
//! Deliberately does not know: how states are chosen, and models.

use hamel_run::info::Info;
use hamel_runtime::Real;
use serde_json::{Map, Value, json};

use crate::subject::{Prepared, Subject};
use hamel_measure::both::Both;

/// Below this multiple of `eps |f|` the derivatives of the function are not asked for: they can only lower it.
const CLEAR: f64 = 16.0;
/// Results whose terms are smaller are next to underflow, where double-double numbers have lost digits, too.
const TINY: f64 = 1e-250;
/// A result is known to double-double numbers, whose roundoff is 2^-105, up to so much of the largest term that entered
/// it, with digits enough to hold one of `f64` to: smaller results are zero for all that they tell.
const UNKNOWN: f64 = 1.0 / (1u64 << 46) as f64;
/// Relative change of inputs for difference quotients in double-double numbers.
const SHIFT: f64 = 1.0 / (1u128 << 64) as f64;

/// A place at which a scene is evaluated.
#[derive(Clone, Debug)]
pub struct Sample {
    /// Parameters in order.
    pub params: Vec<f64>,
    /// State.
    pub y: Vec<f64>,
    /// Time.
    pub t: f64,
    /// Where it came from.
    pub origin: String,
}

impl Sample {
    /// The place as `cargo xtask eval` reads it.
    pub fn request(&self, info: &Info) -> String {
        let params = info.params.iter().zip(&self.params).map(|(p, x)| (p.name.clone(), json!(x)));
        let state = info.state.iter().zip(&self.y).map(|(name, x)| (name.clone(), json!(x)));
        let (params, state): (Map<String, Value>, Map<String, Value>) = (params.collect(), state.collect());
        json!({ "params": params, "states": [state], "t": self.t }).to_string()
    }
}

/// Which of a scene's functions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Function {
    /// The right-hand side.
    Rhs,
    /// Outputs and energy.
    Outputs,
}

/// The largest multiple, and where.
#[derive(Clone, Debug)]
pub struct Worst {
    /// Which component of the function.
    pub component: String,
    /// Its value in `f64`.
    pub value: f64,
    /// Its value in double-double numbers.
    pub exact: String,
    /// The place.
    pub sample: Sample,
}

/// Multiples of all samples.
#[derive(Clone, Debug, Default)]
pub struct Multiples {
    all: Vec<f32>,
    max: f64,
    /// The largest one's place.
    pub worst: Option<Worst>,
}

impl Multiples {
    /// The multiple below which the fraction `q` of the samples lie, of sorted multiples.
    fn quantile(&self, q: f64) -> f64 {
        let at = (q * self.all.len() as f64) as usize;
        self.all.get(at.min(self.all.len().saturating_sub(1))).map_or(0.0, |x| f64::from(*x))
    }

    /// The median.
    pub fn median(&self) -> f64 {
        self.quantile(0.5)
    }

    /// What 999 of 1000 samples stay below.
    pub fn most(&self) -> f64 {
        self.quantile(0.999)
    }

    /// What 9999 of 10000 samples stay below.
    pub fn nearly_all(&self) -> f64 {
        self.quantile(0.9999)
    }

    /// The largest.
    pub fn max(&self) -> f64 {
        self.max
    }

    fn add(&mut self, multiple: f64, worst: impl FnOnce() -> Worst) {
        self.all.push(multiple as f32);
        if multiple > self.max {
            self.max = multiple;
            self.worst = Some(worst());
        }
    }
}

/// What became of the samples of one function of a scene.
#[derive(Clone, Debug, Default)]
pub struct Accuracy {
    /// Parameters that the scene does not allow.
    pub rejected: u64,
    /// States at which the scene says that it has no value.
    pub refused: u64,
    /// Results beyond the range in which double-double numbers have their digits.
    pub unmeasured: u64,
    /// Results that are not finite, although the scene says that all is well.
    pub silent: u64,
    /// The first of those.
    pub first_silent: Option<(String, Sample)>,
    /// Errors over those of the terms.
    pub terms: Multiples,
    /// Errors over those of the inputs.
    pub inputs: Multiples,
    /// Largest error of a component relative to the largest component of the function, in multiples of epsilon.
    pub norm: f64,
}

impl Accuracy {
    /// Number of samples whose errors were measured.
    pub fn measured(&self) -> usize {
        self.terms.all.len()
    }

    /// Sorts the multiples; no sample may be added afterwards.
    pub fn finish(&mut self) {
        self.terms.all.sort_by(f32::total_cmp);
        self.inputs.all.sort_by(f32::total_cmp);
    }

    /// Evaluates a function at a sample and adds what came of it.
    pub fn add(&mut self, subject: &Subject, function: Function, sample: &Sample) {
        let info = subject.info();
        let lift = |x: &[f64]| x.iter().map(|x| Both::input(*x)).collect::<Vec<_>>();
        let Some(prepared) = subject.prepare(&lift(&sample.params)) else {
            self.rejected += 1;
            return;
        };
        let (t, y) = (Both::input(sample.t), lift(&sample.y));
        if prepared.is_refused(t, &y) {
            self.refused += 1;
            return;
        }
        let results = evaluate(&prepared, function, t, &y);
        if let Some(at) = results.iter().position(|r| !r.all_finite()) {
            if prepared.is_outside(t, &y) {
                self.refused += 1;
                return;
            }
            self.silent += 1;
            self.first_silent.get_or_insert_with(|| (component(info, function, at), sample.clone()));
            return;
        }
        let measurable = |r: &Both| {
            r.exact.all_finite() && (r.error() == 0.0 || r.tracked.term > TINY) && !r.error().is_nan()
        };
        if !results.iter().all(measurable) {
            self.unmeasured += 1;
            return;
        }
        let worst = |at: usize| Worst {
            component: component(info, function, at),
            value: results[at].value(),
            exact: results[at].exact.to_string(),
            sample: sample.clone(),
        };
        let (at, multiple) = largest(results.iter().map(|r| over(r.error(), r.tracked.term)));
        self.terms.add(multiple, || worst(at));

        let unknown = |r: &Both| UNKNOWN * r.tracked.term;
        let bound = largest(results.iter().map(|r| over(r.error(), r.exact.hi().abs().max(unknown(r)))));
        let (at, multiple) = if bound.1 <= CLEAR {
            bound
        } else {
            let conditions = conditions(subject, function, sample, &results);
            let scales = conditions.into_iter().zip(&results).map(|(c, r)| c.max(unknown(r)));
            largest(results.iter().zip(scales).map(|(r, scale)| over(r.error(), scale)))
        };
        self.inputs.add(multiple, || worst(at));
        let largest_result = results.iter().fold(0.0, |max: f64, r| max.max(r.exact.hi().abs()));
        self.norm = results.iter().fold(self.norm, |max, r| max.max(over(r.error(), largest_result)));
    }
}

/// `error` in multiples of `epsilon scale`.
fn over(error: f64, scale: f64) -> f64 {
    if error == 0.0 { 0.0 } else { error / (f64::EPSILON * scale) }
}

/// The largest number and its position.
fn largest(numbers: impl Iterator<Item = f64>) -> (usize, f64) {
    numbers.enumerate().fold((0, 0.0), |max, (k, x)| if x > max.1 { (k, x) } else { max })
}

fn evaluate(prepared: &Prepared<'_>, function: Function, t: Both, y: &[Both]) -> Vec<Both> {
    match function {
        Function::Rhs => prepared.rhs(t, y),
        Function::Outputs => prepared.outputs(t, y),
    }
}

/// Name of a component of a function.
fn component(info: &Info, function: Function, at: usize) -> String {
    let output = |at: usize| {
        let names = info.outputs.iter().flat_map(|o| o.components.iter().map(|c| format!("{}.{c}", o.name)));
        names.chain(["energy".to_owned()]).nth(at).unwrap_or_default()
    };
    match function {
        Function::Rhs => format!("d{}/dt", info.state[at]),
        Function::Outputs => output(at),
    }
}

/// `|f| + sum_i |df/dx_i| |x_i|` for every component of `f`, over parameters, state and time.
fn conditions(subject: &Subject, function: Function, sample: &Sample, at: &[Both]) -> Vec<f64> {
    let mut sums: Vec<f64> = at.iter().map(|r| r.exact.hi().abs()).collect();
    let inputs: Vec<f64> = [&sample.params[..], &sample.y, &[sample.t]].concat();
    for i in (0..inputs.len()).filter(|i| inputs[*i] != 0.0) {
        let shifted: Vec<Both> = inputs
            .iter()
            .enumerate()
            .map(|(k, x)| if k == i { Both::shifted(*x, SHIFT) } else { Both::input(*x) })
            .collect();
        let (params, rest) = shifted.split_at(sample.params.len());
        let (y, t) = rest.split_at(sample.y.len());
        // The values in f64 are unchanged, and so are the conditions on them.
        let Some(prepared) = subject.prepare(params) else { continue };
        let moved = evaluate(&prepared, function, t[0], y);
        for ((sum, to), from) in sums.iter_mut().zip(&moved).zip(at) {
            let change = (to.exact - from.exact).hi().abs() / SHIFT;
            if change.is_finite() {
                *sum += change;
            }
        }
    }
    sums
}
