//! Values that vary from trajectory to trajectory: grids and draws.
//!
//! Does not know: which names a scene has.

use std::fmt;

use hamel_expr::split_mix;

use crate::model::number;

/// An interval, along which a quantity or its logarithm is uniform.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Interval {
    from: f64,
    to: f64,
    is_logarithmic: bool,
}

impl Interval {
    /// Reads `a..b` or `log:a..b`; none when it is not of that form.
    fn parse(text: &str) -> Result<Option<Interval>, String> {
        let (is_logarithmic, text) = match text.trim().strip_prefix("log:") {
            Some(rest) => (true, rest),
            None => (false, text.trim()),
        };
        let Some((from, to)) = text.split_once("..") else {
            return if is_logarithmic { Err(format!("{text:?} is no interval a..b")) } else { Ok(None) };
        };
        let (from, to) = (number(from)?, number(to)?);
        if from > to {
            return Err(format!("{from:?} is above {to:?}: give the smaller bound first"));
        }
        if is_logarithmic && from <= 0.0 {
            return Err(format!("{from:?} has no logarithm: give positive bounds, or leave log: out"));
        }
        if !(to - from).is_finite() {
            return Err(format!("{from:?} and {to:?} are too far apart: give closer bounds"));
        }
        Ok(Some(Interval { from, to, is_logarithmic }))
    }

    /// The value at a fraction `x` of the way, both ends exact.
    fn at(self, x: f64) -> f64 {
        let Interval { from, to, is_logarithmic } = self;
        let value = if x == 0.0 {
            from
        } else if x == 1.0 {
            to
        } else if is_logarithmic {
            (from.ln() + x * (to.ln() - from.ln())).exp()
        } else {
            from + x * (to - from)
        };
        value.clamp(from, to)
    }
}

impl fmt::Display for Interval {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{:?}..{:?}", if self.is_logarithmic { "log:" } else { "" }, self.from, self.to)
    }
}

fn named(text: &str, usage: &str) -> Result<(String, String), String> {
    let (name, rest) = text.split_once('=').ok_or_else(|| usage.to_owned())?;
    Ok((name.trim().to_owned(), rest.trim().to_owned()))
}

/// A quantity that takes each of several values at equal distances.
#[derive(Clone, Debug, PartialEq)]
pub struct Sweep {
    /// Name of the quantity.
    pub name: String,
    /// Number of values.
    pub n: usize,
    interval: Interval,
}

impl Sweep {
    /// Reads `name=a..b:n` or `name=log:a..b:n`.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn parse(text: &str) -> Result<Sweep, String> {
        const USAGE: &str = "write it as name=a..b:n or name=log:a..b:n, such as m=0.5..2:16";
        let (name, rest) = named(text, USAGE)?;
        let (interval, n) = rest.rsplit_once(':').ok_or(USAGE)?;
        let n = match n.trim().parse::<usize>() {
            Ok(n) if n > 0 => n,
            _ => return Err(format!("{n:?} is no number of values: {USAGE}")),
        };
        let interval = Interval::parse(interval)?.ok_or(USAGE)?;
        if n == 1 && interval.from != interval.to {
            return Err(format!("one value cannot be both ends of {rest:?}: give 2 or more, or --set"));
        }
        Ok(Sweep { name, n, interval })
    }

    /// Value number `k`.
    pub fn value(&self, k: usize) -> f64 {
        if k == 0 { self.interval.from } else { self.interval.at(k as f64 / (self.n - 1) as f64) }
    }
}

impl fmt::Display for Sweep {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}:{}", self.name, self.interval, self.n)
    }
}

/// A quantity that is drawn for every trajectory.
#[derive(Clone, Debug, PartialEq)]
pub struct Spread {
    /// Name of the quantity.
    pub name: String,
    law: Law,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Law {
    /// Normal around the value that the quantity has otherwise.
    Normal {
        deviation: f64,
    },
    Uniform(Interval),
}

impl Spread {
    /// Reads `name=sigma`, `name=a..b` or `name=log:a..b`.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn parse(text: &str) -> Result<Spread, String> {
        let usage = "write it as name=sigma, name=a..b or name=log:a..b, such as m=0.05";
        let (name, rest) = named(text, usage)?;
        let law = match Interval::parse(&rest)? {
            Some(interval) => Law::Uniform(interval),
            None => Law::Normal { deviation: number(&rest)? },
        };
        if matches!(law, Law::Normal { deviation } if deviation < 0.0) {
            return Err(format!("{rest:?} is negative: give a standard deviation"));
        }
        Ok(Spread { name, law })
    }

    /// The value for a trajectory, a function of centre, seed, name and number alone.
    ///
    /// # Source
    /// Box and Muller, A note on the generation of random normal deviates (1958), for the normal distribution.
    pub fn draw(&self, center: f64, seed: u64, trajectory: usize) -> f64 {
        self.draw_by(self.key(seed), center, trajectory)
    }

    /// What draws depend on beside the centre and the number of the trajectory, for [`draw_by`](Self::draw_by).
    pub fn key(&self, seed: u64) -> u64 {
        self.name.bytes().fold(scramble(seed), |key, byte| scramble(key ^ u64::from(byte)))
    }

    /// [`draw`](Self::draw) by a key that is there.
    pub fn draw_by(&self, key: u64, center: f64, trajectory: usize) -> f64 {
        let key = scramble(key ^ scramble(trajectory as u64));
        // The middle of one of 2^52 equal parts of the unit interval.
        let unit = |bits: u64| ((bits >> 12) as f64 + 0.5) / (1_u64 << 52) as f64;
        let x = unit(key);
        match self.law {
            Law::Uniform(interval) => interval.at(x),
            Law::Normal { deviation } => {
                let angle = std::f64::consts::TAU * unit(scramble(key));
                center + deviation * (-2.0 * x.ln()).sqrt() * hamel_runtime::math::cos(angle)
            }
        }
    }
}

impl fmt::Display for Spread {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.law {
            Law::Normal { deviation } => write!(f, "{}={deviation:?}", self.name),
            Law::Uniform(interval) => write!(f, "{}={interval}", self.name),
        }
    }
}

/// A number from which neighbours of `x` have theirs far away.
fn scramble(mut x: u64) -> u64 {
    split_mix(&mut x)
}

#[cfg(test)]
mod tests {
    use super::{Spread, Sweep};

    fn draws(text: &str, center: f64, seed: u64) -> Vec<f64> {
        let spread = Spread::parse(text).unwrap();
        (0..4000).map(|k| spread.draw(center, seed, k)).collect()
    }

    #[test]
    fn draws_depend_on_seed_name_and_number_alone() {
        let mass = draws("m=0.1..10", 0.0, 1);
        assert_eq!(mass, draws("m = 0.1..10", 7.0, 1));
        assert_ne!(mass, draws("m=0.1..10", 0.0, 2));
        assert_ne!(mass, draws("l=0.1..10", 0.0, 1));
    }

    /// Five standard deviations of the statistics are allowed, and the draws are always the same.
    #[test]
    fn draws_have_their_distribution() {
        let n = 4000.0_f64;
        let below = |draws: &[f64], x: f64| draws.iter().filter(|y| **y < x).count() as f64 / n;
        for (text, share) in [("m=0.1..10", 1.0 / 11.0), ("m=log:0.1..10", 0.5)] {
            let drawn = draws(text, 0.0, 1);
            assert!(drawn.iter().all(|x| (0.1..=10.0).contains(x)));
            let allowed = 5.0 * (share * (1.0 - share) / n).sqrt();
            assert!((below(&drawn, 1.0) - share).abs() < allowed, "{text}");
        }
        let drawn = draws("m=0.5", 3.0, 1);
        let mean = drawn.iter().sum::<f64>() / n;
        let variance = drawn.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n;
        assert!((mean - 3.0).abs() < 5.0 * 0.5 / n.sqrt(), "{mean}");
        assert!((variance / 0.25 - 1.0).abs() < 5.0 * (2.0 / n).sqrt(), "{variance}");
        // Within one standard deviation are 68.27 %.
        let within = below(&drawn, 3.5) - below(&drawn, 2.5);
        assert!((within - 0.6827).abs() < 5.0 * (0.6827 * 0.3173 / n).sqrt(), "{within}");
    }

    #[test]
    fn sweeps_have_both_ends_and_equal_distances() {
        let values = |text: &str| {
            let sweep = Sweep::parse(text).unwrap();
            (0..sweep.n).map(|k| sweep.value(k)).collect::<Vec<f64>>()
        };
        assert_eq!(values("m=-1..1:5"), [-1.0, -0.5, 0.0, 0.5, 1.0]);
        let decades = values("m=log:0.001..1000:7");
        assert_eq!((decades[0], decades[6]), (0.001, 1000.0));
        assert!(decades.windows(2).all(|pair| (pair[1] / pair[0] - 10.0).abs() < 1e-12), "{decades:?}");
        assert_eq!(values("m=0.3..0.3:1"), [0.3]);
    }

    #[test]
    fn what_is_shown_reads_back() {
        for text in ["m=-1.0..1.0:5", "m=log:0.1..10.0:3"] {
            assert_eq!(Sweep::parse(text).unwrap().to_string(), text);
        }
        for text in ["m=0.05", "m=-1.0..1.0", "m=log:0.1..10.0"] {
            assert_eq!(Spread::parse(text).unwrap().to_string(), text);
        }
    }

    #[test]
    fn variations_that_make_no_sense_are_refused() {
        for text in ["m", "m=1", "m=1..2", "m=2..1:3", "m=0..1:0", "m=0..1:1", "m=0..1:x", "m=log:0..1:2"] {
            assert!(Sweep::parse(text).is_err(), "{text}");
        }
        for text in ["m", "m=-1", "m=2..1", "m=log:1", "m=log:0..1", "m=a..b", "m=0..inf", "m=-1e308..1e308"]
        {
            assert!(Spread::parse(text).is_err(), "{text}");
        }
        assert!(Spread::parse("m=-2..-1").is_ok());
    }
}
