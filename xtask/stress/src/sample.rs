//! States and parameters at which scenes are evaluated: ordinary, extreme, and next to where something vanishes.
//!
//! Deliberately does not know: what is evaluated there.

use std::f64::consts::{FRAC_PI_2, PI};

use hamel_measure::random::Random;
use hamel_run::model::roles::Role;

use crate::request::SceneRequest;

/// Where in the space of states.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Region {
    /// About the initial state of the model.
    Initial,
    /// Anywhere, velocities of order one.
    Ordinary,
    /// Velocities of magnitudes from 1e-8 to 1e8, each its own.
    Magnitudes,
    /// Velocities of one common magnitude from 1e-8 to 1e8.
    Scaled,
    /// Coordinates near the ends of their intervals, angles near multiples of pi/2, advected vectors near an axis:
    /// closer by up to 1e-12.
    Edge,
    /// As [`Region::Edge`] with velocities as in [`Region::Magnitudes`]: how close a state is to a singular one and how
    /// fast it moves, together.
    FastEdge,
    /// Some velocities zero or nearly so.
    Still,
}

impl Region {
    /// All of them; samples go round.
    pub const ALL: [Region; 7] = [
        Region::Initial,
        Region::Ordinary,
        Region::Magnitudes,
        Region::Scaled,
        Region::Edge,
        Region::FastEdge,
        Region::Still,
    ];
}

/// A number in `[0, 1)`.
fn unit(random: &mut Random) -> f64 {
    0.5 * (1.0 + random.number())
}

/// A number of either sign with a magnitude from `10^from` to `10^to`, log-uniformly.
pub fn magnitude(random: &mut Random, from: f64, to: f64) -> f64 {
    let sign = if random.number() < 0.0 { -1.0 } else { 1.0 };
    sign * 10f64.powf(from + (to - from) * unit(random))
}

/// A unit vector; near an axis with `edge`.
fn unit_vector(random: &mut Random, n: usize, edge: bool) -> Vec<f64> {
    let spread = if edge { magnitude(random, -12.0, -1.0) } else { 1.0 };
    let mut x: Vec<f64> = (0..n).map(|_| spread * random.number()).collect();
    if edge {
        let axis = (n as f64 * unit(random)) as usize;
        x[axis] = if random.number() < 0.0 { -1.0 } else { 1.0 };
    }
    let length = x.iter().map(|x| x * x).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
    x.iter().map(|x| x / length).collect()
}

/// A state of a scene in a region.
pub fn state(scene: &SceneRequest, region: Region, random: &mut Random) -> Vec<f64> {
    let edge = matches!(region, Region::Edge | Region::FastEdge);
    let common = magnitude(random, -8.0, 8.0);
    let mut advected = Vec::new();
    let mut component = |role: &Role, initial: f64| match *role {
        Role::Mode if region == Region::Initial => initial,
        _ if region == Region::Initial => initial * (1.0 + 0.2 * random.number()) + 0.2 * random.number(),
        Role::Bounded { from, to } if edge => {
            let distance = (to - from) * magnitude(random, -12.0, -1.0);
            if distance > 0.0 { from + distance } else { to + distance }
        }
        Role::Bounded { from, to } => from + (to - from) * unit(random),
        Role::Unbounded if edge => {
            FRAC_PI_2 * (4.0 * random.number()).round() + magnitude(random, -12.0, -1.0)
        }
        Role::Unbounded => PI * random.number(),
        Role::Group { .. } => random.number(),
        Role::Mode => f64::from(u8::from(random.number() > 0.0)),
        Role::Advected { index, n } => {
            if index == 0 {
                advected = unit_vector(random, n, edge);
            }
            advected.get(index).copied().unwrap_or_default()
        }
        Role::Velocity => match region {
            Region::Magnitudes | Region::FastEdge => magnitude(random, -8.0, 8.0),
            Region::Scaled => common * random.number(),
            Region::Still if random.number() < 0.0 => 0.0,
            Region::Still => magnitude(random, -8.0, 0.0),
            _ => 3.0 * random.number(),
        },
    };
    let mut state: Vec<f64> =
        scene.roles.iter().zip(&scene.initial).map(|(role, initial)| component(role, *initial)).collect();
    for places in &scene.rotations {
        rotate(&mut state, places, random);
    }
    state
}

/// Makes a matrix a rotation: its rows are made orthonormal one after the other, and rows without a direction are drawn
/// anew. Sums of products of a rotation's entries are one or zero, so that a metric in them is regular. A metric in the
/// entries of any other matrix may be singular.
fn rotate(state: &mut [f64], places: &[usize], random: &mut Random) {
    let n = places.len().isqrt();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let mut rows: Vec<Vec<f64>> = Vec::new();
    for chunk in places.chunks(n) {
        let mut row: Vec<f64> = chunk.iter().map(|place| state[*place]).collect();
        loop {
            let size = dot(&row, &row).sqrt();
            // Twice, as the first time leaves rounding errors behind.
            for before in rows.iter().chain(&rows) {
                let along = dot(&row, before);
                row.iter_mut().zip(before).for_each(|(x, y)| *x -= along * y);
            }
            let length = dot(&row, &row).sqrt();
            if length > 1e-3 * size {
                row.iter_mut().for_each(|x| *x /= length);
                break;
            }
            row = (0..n).map(|_| random.number()).collect();
        }
        rows.push(row);
    }
    if determinant(&rows) < 0.0
        && let Some(last) = rows.last_mut()
    {
        last.iter_mut().for_each(|x| *x = -*x);
    }
    places.iter().zip(rows.iter().flatten()).for_each(|(place, x)| state[*place] = *x);
}

/// The determinant of rows that are orthonormal.
fn determinant(rows: &[Vec<f64>]) -> f64 {
    let Some((first, others)) = rows.split_first() else { return 1.0 };
    let minor = |k: usize| {
        let without = |row: &Vec<f64>| [&row[..k], &row[k + 1..]].concat();
        determinant(&others.iter().map(without).collect::<Vec<_>>())
    };
    let sign = |k: usize| if k.is_multiple_of(2) { 1.0 } else { -1.0 };
    first.iter().enumerate().map(|(k, x)| sign(k) * x * minor(k)).sum()
}

/// Parameters within a factor two of the defaults, exact defaults one time in four.
pub fn ordinary_params(defaults: &[f64], random: &mut Random) -> Vec<f64> {
    if random.number() < -0.5 {
        return defaults.to_vec();
    }
    defaults.iter().map(|p| p * 2f64.powf(random.number())).collect()
}

/// Parameters within factors `10^-decades` to `10^decades` of the defaults, each its own, log-uniformly.
pub fn scaled_params(defaults: &[f64], decades: f64, random: &mut Random) -> Vec<f64> {
    defaults.iter().map(|p| p * magnitude(random, -decades, decades).abs()).collect()
}
