//! `trim`: relative equilibria, alone or in families, with their stability.
//!
//! Does not know: how an equilibrium is found.

use std::fmt::Write as _;
use std::path::PathBuf;

use clap::Args;
use hamel_codegen::scene::told_in_words;

use super::linearize::shown;
use super::options::{assignment, duration, finite};
use crate::output::families::{self, Target};
use hamel_run::equilibria::{Along, Answer, Asked, End, EnergyTest, Equilibrium, Verdict, find};
use hamel_run::error::Error;
use hamel_run::model;
use hamel_run::session::Session;

/// Find a relative equilibrium near a guess, a family of them, or a periodic orbit, with its stability
///
/// The equations are reduced: a body that turns and moves steadily is at rest in them. Beside states at rest, `trim`
/// finds states that drift along a symmetry that is left: a cyclic coordinate, a heading, the axis of a symmetric body.
/// Norms of advected vectors and equations between coordinates stay as they are at the guess; --keep adds others.
/// Eigenvalues are those on the reduced space, without invariants and symmetries; where they do not decide, the second
/// variation of the energy may.
#[derive(Clone, Debug, Args)]
#[command(
    arg_required_else_help = true,
    after_help = "\
Examples:
  hamel trim heavy_top --at Omega1=0 Omega2=0 Omega3=1 Gamma1=0 Gamma2=0.6 Gamma3=0.8
  hamel trim heavy_top --scene symmetric --at Omega1=0 Omega2=0 Gamma1=0 Gamma2=0 Gamma3=1 --along Omega3=20..1
  hamel trim double_spherical_pendulum --period 2 --keep energy"
)]
pub struct Arguments {
    /// Name of a model, or a path that ends in .hamel
    pub model: String,
    /// Name of the scene [default: controlled where the model has inputs, otherwise default]
    #[arg(long)]
    pub scene: Option<String>,
    /// Parameters that differ from the model's defaults
    #[arg(long, value_name = "NAME=VALUE", num_args = 1.., value_parser = assignment)]
    pub set: Vec<(String, f64)>,
    /// Components of the guess; the initial state has the others
    #[arg(long, value_name = "NAME=VALUE", num_args = 1.., value_parser = assignment)]
    pub at: Vec<(String, f64)>,
    /// Inputs that differ from the values that the model holds them at
    #[arg(long, value_name = "NAME=VALUE", num_args = 1.., value_parser = assignment)]
    pub hold: Vec<(String, f64)>,
    /// Components of the state, invariants and outputs that keep the value of the guess, or have another one
    #[arg(long, value_name = "NAME[=VALUE]", num_args = 1.., value_parser = kept)]
    pub keep: Vec<(String, Option<f64>)>,
    /// Inputs and parameters that are solved for
    #[arg(long, value_name = "NAME", num_args = 1..)]
    pub free: Vec<String>,
    /// Nothing drifts: all rates vanish
    #[arg(long)]
    pub at_rest: bool,
    /// Freeze equations that contain the time at a time
    #[arg(long, value_name = "T", allow_negative_numbers = true, value_parser = finite)]
    pub t: Option<f64>,
    /// A periodic orbit instead, about so long: a motion that comes back, up to drifts along symmetries and full turns
    /// of angles, with Floquet's multipliers; events happen on the way
    #[arg(
        long,
        value_name = "T",
        allow_negative_numbers = true,
        value_parser = duration,
        conflicts_with_all = ["free", "t"],
    )]
    pub period: Option<f64>,
    /// A family: a parameter, an input, a component, an invariant or an output, from one value to another
    #[arg(long, value_name = "NAME=FROM..TO", value_parser = way)]
    pub along: Option<Way>,
    /// Points of the family
    #[arg(long, value_name = "N", default_value_t = 50, value_parser = clap::value_parser!(u16).range(2..))]
    pub points: u16,
    /// File of the family: .csv, or a figure, .svg
    #[arg(short, long, value_name = "FILE", requires = "along")]
    pub output: Option<PathBuf>,
    /// Print the answer as JSON
    #[arg(long)]
    pub json: bool,
}

/// The way of a family.
#[derive(Clone, Debug, PartialEq)]
pub struct Way {
    name: String,
    from: f64,
    to: f64,
}

fn kept(text: &str) -> Result<(String, Option<f64>), String> {
    match text.contains('=') {
        true => assignment(text).map(|(name, value)| (name, Some(value))),
        false => Ok((text.trim().to_owned(), None)),
    }
}

fn way(text: &str) -> Result<Way, String> {
    let parts = text.split_once('=').and_then(|(name, values)| Some((name, values.split_once("..")?)));
    let Some((name, (from, to))) = parts else {
        return Err("write it as name=from..to, such as v=1..5".into());
    };
    let way = Way { name: name.trim().to_owned(), from: finite(from)?, to: finite(to)? };
    if way.from == way.to { Err("goes nowhere: give two values".into()) } else { Ok(way) }
}

/// The equilibria for people, or as JSON.
///
/// # Errors
/// Unknown names, problems of the model, and guesses that no equilibrium is near.
pub fn run(session: &Session, arguments: &Arguments) -> Result<String, Error> {
    let file = session.find(&arguments.model)?;
    let model = file.model()?;
    let scene = arguments.scene.as_deref().unwrap_or(model::scene_with_inputs(model));
    model.known_scene(scene)?;
    let target = arguments.output.as_deref().map(Target::new).transpose()?;
    let open = target.as_ref().map(Target::open).transpose()?;
    let n_points = usize::from(arguments.points);
    let along = arguments.along.as_ref().map(|way| Along {
        name: way.name.clone(),
        from: way.from,
        to: way.to,
        n_points,
    });
    let asked = Asked {
        set: arguments.set.iter().cloned().collect(),
        at: arguments.at.iter().cloned().collect(),
        hold: arguments.hold.iter().cloned().collect(),
        keep: arguments.keep.clone(),
        free: arguments.free.clone(),
        at_rest: arguments.at_rest,
        t: arguments.t,
        along,
        period: arguments.period,
        dashes: "--",
    };
    let answer = find(model, scene, &asked)?;
    let name = arguments.along.as_ref().map(|way| way.name.as_str());
    if let (Some(open), Some(name)) = (open, name) {
        families::write(open, &model::title(model), &answer, name)?;
    }
    if arguments.json {
        return Ok(answer.to_json().to_string());
    }
    let mut text = match name {
        Some(name) => family(&answer, name),
        None => answer.equilibria.first().map_or_else(String::new, |found| one(&answer, found)),
    };
    if let Some(target) = &target {
        let _ = write!(text, "\nwritten: {}", target.path().display());
    }
    Ok(text)
}

fn row(text: &mut String, name: &str, value: f64) {
    let _ = writeln!(text, "  {name:<24} {:>14}", shown(value));
}

/// Numbers for people: rounding beside the largest of them is zero.
fn rounded(values: &[f64]) -> Vec<f64> {
    let largest = values.iter().fold(1e-300, |max: f64, x| max.max(x.abs()));
    values.iter().map(|x| if x.abs() <= 1e-13 * largest { 0.0 } else { *x }).collect()
}

/// One equilibrium for people.
fn one(answer: &Answer, found: &Equilibrium) -> String {
    let mut text = String::new();
    let info = &answer.info;
    let drifts: Vec<(&String, f64)> =
        answer.symmetries.iter().zip(found.drifts.iter().copied()).filter(|(_, c)| c.abs() > 1e-12).collect();
    let what = match (drifts.is_empty(), found.period) {
        (true, None) => "equilibrium".to_owned(),
        (false, None) => "relative equilibrium".to_owned(),
        (true, Some(period)) => format!("orbit of period {period:.12}"),
        (false, Some(period)) => format!("relative orbit of period {period:.12}"),
    };
    let met = if found.period.is_some() { "it closes" } else { "rates are met" };
    let _ = writeln!(text, "{}, scene {}: {what}, {met} to {:.1e}", info.model, info.scene, found.residual);
    let state = rounded(&found.state);
    info.state.iter().zip(&state).for_each(|(name, x)| row(&mut text, name, *x));
    if let Some(told) = told_in_words(&answer.told) {
        let _ = writeln!(text, "  guess: {told}");
    }
    if !info.inputs.is_empty() {
        text.push_str("inputs\n");
        info.inputs.iter().zip(&found.inputs).for_each(|(input, x)| row(&mut text, &input.name, *x));
    }
    let changed = info.params.iter().zip(&found.params).filter(|(param, x)| param.default != **x);
    for (k, (param, x)) in changed.enumerate() {
        text.push_str(if k == 0 { "parameters that differ\n" } else { "" });
        row(&mut text, &param.name, *x);
    }
    for (k, (symmetry, drift)) in drifts.iter().enumerate() {
        text.push_str(if k == 0 { "drifts along symmetries\n" } else { "" });
        let _ = writeln!(text, "  {:>14} along {symmetry}", shown(*drift));
    }
    let stability = &found.stability;
    let (name, shown_ones) = match found.period {
        None => ("eigenvalues", &stability.eigenvalues),
        Some(_) => ("multipliers", &stability.multipliers),
    };
    let _ = writeln!(
        text,
        "{name} on the reduced space ({} taken out by invariants, {} by {})",
        stability.n_invariants,
        stability.n_symmetries,
        if found.period.is_some() { "the orbit and symmetries" } else { "symmetries" }
    );
    let parts: Vec<f64> = shown_ones.iter().flatten().copied().collect();
    for z in rounded(&parts).chunks(2) {
        let (re, im) = (z[0], z[1]);
        let _ = match im {
            0.0 => writeln!(text, "  {}", shown(re)),
            im => {
                writeln!(text, "  {} {} {} i", shown(re), if im < 0.0 { '-' } else { '+' }, shown(im.abs()))
            }
        };
    }
    text.push_str(&verdict(found));
    text
}

/// The verdict with its reason.
fn verdict(found: &Equilibrium) -> String {
    let stability = &found.stability;
    let energy = stability.energy.map_or_else(String::new, |e| {
        let EnergyTest { n_positive, n_negative, n_zero } = e;
        format!("{n_positive} positive, {n_negative} negative, {n_zero} zero")
    });
    match stability.verdict {
        Verdict::Unstable { rate } => {
            format!("unstable: a deviation doubles in {}", shown(std::f64::consts::LN_2 / rate))
        }
        Verdict::Asymptotic { rate } => {
            format!(
                "asymptotically stable: deviations halve in {} at the latest",
                shown(std::f64::consts::LN_2 / rate)
            )
        }
        Verdict::Stable => format!("stable: the second variation of the energy is definite ({energy})"),
        Verdict::Spectral => {
            let neutral = match stability.n_neutral {
                0 => String::new(),
                n => {
                    let (of, all) = match found.period {
                        None => ("zero", "equilibria"),
                        Some(_) => ("one", "orbits"),
                    };
                    let more = if n == 1 { "one more is".to_owned() } else { format!("{n} more are") };
                    format!("; {more} {of}: {all} in families")
                }
            };
            let energy = match stability.energy {
                Some(_) => format!(
                    "; the second variation of the energy is not definite ({energy}) and does not decide"
                ),
                None => String::new(),
            };
            match found.period {
                None => format!("spectrally stable: no eigenvalue has a positive real part{neutral}{energy}"),
                Some(_) => format!("spectrally stable: no multiplier lies outside the unit circle{neutral}"),
            }
        }
        Verdict::Rigid => "rigid: invariants and symmetries leave no deviation".to_owned(),
    }
}

/// A family for people: its ends and its changes.
fn family(answer: &Answer, name: &str) -> String {
    let mut text = String::new();
    let (Some(first), Some(last)) = (answer.equilibria.first(), answer.equilibria.last()) else {
        return text;
    };
    let ended = match answer.end {
        Some(End::Reached) | None => "to the last value",
        Some(End::Returned) => "back to the first value",
        Some(End::Stuck) => "to where the equations have no value further on",
        Some(End::Long) => "and stopped after many points",
    };
    let _ = writeln!(
        text,
        "{}, scene {}: {} {} along {name}, {ended}",
        answer.info.model,
        answer.info.scene,
        answer.equilibria.len(),
        if first.period.is_some() { "orbits" } else { "equilibria" }
    );
    let mut point = |what: &str, at: &Equilibrium| {
        let value = shown(at.along.unwrap_or(f64::NAN));
        let state = answer.info.state.iter().zip(rounded(&at.state));
        let state = state.map(|(name, x)| format!("{name}={}", shown(x)));
        let period = at.period.map(|period| format!("period={}", shown(period)));
        let state: Vec<String> = period.into_iter().chain(state).collect();
        let _ = writeln!(text, "  {name} = {value:<12} {what:<22} {}", state.join(" "));
    };
    point(first.stability.verdict.name(), first);
    for (_, change, at) in &answer.changes {
        point(change.name(), at);
    }
    point(last.stability.verdict.name(), last);
    text.trim_end().to_owned()
}
