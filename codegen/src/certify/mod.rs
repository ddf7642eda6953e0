//! Holds a finished program to the model that it was made from: every function at random points, against its
//! definition.
//!
//! `certify` evaluates the checked `Model` and the `Program` in numbers of 31 digits that carry bounds of their
//! errors, and demands the identity that defines each function: equations of motion along virtual displacements, with
//! derivatives by dual numbers; energy, outputs, momenta by their definitions; derivatives, brackets, flows, series and
//! implicit forms by the rates. A residual above the rounding errors of its own evaluation is a fault of the generator,
//! and the scene is refused.
//!
//! Uses nothing that rewrites: of `Equations` it takes velocities by the state and the names of things, which the
//! identities check as well. Does not know: how anything was derived, searched, lowered or emitted.
//!
//! # Why three points
//! The residual is an analytic function of the point. Unless it vanishes on an open set, it does so on a set of measure
//! zero, which no drawn point meets; a fault is seen at the first point. The second and the third are for conditions
//! and branches (`abs`, `atan2`, intervals) that hold on a part of the domain.

mod centroid;
mod claim;
mod connection;
mod definition;
mod derived;
mod dirac;
mod discrete;
mod fluid;
mod frames;
mod group;
mod impacts;
mod implied;
mod linear;
mod lyapunov;
mod modes;
mod motion;
mod noise;
mod point;
mod quotient;
mod random;
mod results;
mod runner;
mod sheet;
mod tape;
mod wide;

use hamel_expr::error::Error;

pub use claim::Certificate;
pub(crate) use claim::{Claim, DiscreteClaim, MatrixClaim};
pub use fluid::fluid;
use motion::Motion;
use point::{Point, Setting};
pub(crate) use quotient::certify_quotient;
use random::Random;
use results::{Open, Results};
use sheet::Sheet;

/// Points at which a scene is held to its definition.
pub(crate) const N_POINTS: usize = 3;
/// Points that are drawn until one is good enough.
const MAX_DRAWS: usize = 50;

/// Compares a program with the definitions of its functions.
///
/// # Errors
/// [`Error::Disagrees`] for the first function that is not what it is said to be.
pub(crate) fn certify(claim: &Claim<'_>) -> Result<Certificate, Error> {
    let setting = Setting::new(claim);
    let mut random = Random::new(seed(claim));
    let mut certificate = Certificate::default();
    let has_modes = setting.modes.len() > 1;
    for turn in 0..claim.n_points.max(setting.modes.len()) {
        let mut blunt = None;
        for attempt in 0..MAX_DRAWS {
            let Some(point) = setting.draw(&mut random, attempt, turn) else { continue };
            let (sheet, open) = compared(&setting, &point, &mut random);
            let scale = point.scale(&setting);
            if let Some(row) = sheet.rows.iter().find(|row| !row.is_sharp(scale)) {
                let reason = format!("at no point enough digits are left of {}", row.what);
                certificate.open.insert(row.function.clone(), reason);
                blunt.get_or_insert((row.function.clone(), row.what.clone(), row.relative(scale)));
                continue;
            }
            blunt = None;
            settle(claim, (&sheet, scale), &mut certificate)?;
            certificate.n_points += 1;
            certificate.open.retain(|function, _| !certificate.held.contains_key(function));
            certificate.open.extend(open);
            break;
        }
        // Points of other modes say nothing about these.
        if let Some((function, what, residual)) = blunt.filter(|_| has_modes) {
            let scene = claim.scene.to_owned();
            let what = format!("at no state with {}: {what}", setting.names_of_modes(turn));
            return Err(Error::Disagrees { scene, function, what, residual });
        }
    }
    if certificate.n_points == 0 && certificate.open.is_empty() {
        certificate.open.insert(motion::RATES.to_owned(), "no point found to check at".to_owned());
    }
    Ok(certificate)
}

/// A point in doubles, as tests of emitted code take it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Sample {
    pub(crate) params: Vec<f64>,
    pub(crate) t: f64,
    pub(crate) state: Vec<f64>,
}

/// Points at which the scene has values, drawn as those at which it is held to its definition.
pub(crate) fn samples(claim: &Claim<'_>) -> Vec<Sample> {
    let setting = Setting::new(claim);
    let mut random = Random::new(seed(claim));
    let sample = |point: Point| Sample {
        params: point.params.iter().map(|x| x.to_f64()).collect(),
        t: point.t.to_f64(),
        state: point.state(&setting).iter().map(|x| x.to_f64()).collect(),
    };
    let drawn = (0..MAX_DRAWS).filter_map(|attempt| setting.draw(&mut random, attempt, attempt));
    drawn.map(sample).take(claim.n_points).collect()
}

/// Functions that were not compared, with the reason.
type Left = Vec<(String, String)>;

/// All residuals at a point.
fn compared(setting: &Setting<'_>, point: &Point, random: &mut Random) -> (Sheet, Left) {
    let (mut sheet, mut left) = (Sheet::default(), Left::new());
    let mut open = |function: &str, why: Open| {
        let reason = match why {
            Open::Missing(symbol) => {
                let name = setting.claim.equations.system.graph.name(symbol);
                format!("its definition needs {name}, which has no value there")
            }
            Open::Because(reason) => reason.to_owned(),
        };
        left.push((function.to_owned(), reason));
    };
    match Motion::new(setting, point) {
        Err(missing) => open(motion::RATES, missing.into()),
        Ok(motion) => {
            let checked = motion.check(setting, &mut sheet, random);
            if let Err(missing) = checked.and_then(|()| lyapunov::check(&motion, setting, &mut sheet)) {
                open(motion::RATES, missing.into());
            }
            if let Some(reason) = implied::check(setting, &mut sheet, random) {
                open(motion::RATES, Open::Because(reason));
            }
            let results = Results { setting, point, motion: &motion };
            results.check(&mut sheet, random, &mut open);
            results.check_derived(&mut sheet, random, &mut open);
            if let Some(discrete) = &setting.claim.discrete
                && let Err(missing) = setting.check_discrete(point, discrete, &mut sheet, random)
            {
                open("discrete_residual", missing.into());
            }
        }
    }
    (sheet, left)
}

/// Takes over the residuals of a point.
fn settle(
    claim: &Claim<'_>,
    (sheet, scale): (&Sheet, f64),
    certificate: &mut Certificate,
) -> Result<(), Error> {
    for row in &sheet.rows {
        if !row.is_zero() {
            return Err(Error::Disagrees {
                scene: claim.scene.to_owned(),
                function: row.function.clone(),
                what: row.what.clone(),
                residual: row.relative(scale),
            });
        }
        let largest = certificate.held.entry(row.function.clone()).or_insert(0.0);
        *largest = largest.max(row.relative(scale));
    }
    Ok(())
}

/// The same for the same model and scene everywhere: a hash of their names (FNV-1a).
fn seed(claim: &Claim<'_>) -> u64 {
    let names = [claim.model.name.as_str(), claim.scene]
        .into_iter()
        .chain(claim.program.state.iter().map(String::as_str));
    names.flat_map(str::bytes).fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}
