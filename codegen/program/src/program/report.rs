//! What became of the searches for the cheapest form of every function, and the digits that functions lose.
//!
//! Does not know: how anything is searched for or measured, what follows from a search that stopped early.

use std::collections::BTreeSet;
use std::fmt;

use super::role::Role;

/// What became of the searches for the cheapest form, and digits lost to rounding, function by function.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Report {
    /// Every function that was rewritten, in the order of the program.
    pub searches: Vec<(Role, Search)>,
    /// Functions that lose digits which their inputs have, in the order of the program.
    pub losses: Vec<Loss>,
}

/// The digits that a function loses which its inputs have.
///
/// The error of a result in units of the machine epsilon times `|f| + sum_i |df/dx_i| |x_i|`, what rounding parameters,
/// time and state does to it (Higham, 2002, section 1.6); the size that 999 of 1000 of the states drawn do not exceed,
/// and all but one of fewer states.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Loss {
    /// The function.
    pub role: Role,
    /// With parameters within a factor of two of their defaults, where digits are lost there.
    pub near: Option<u64>,
    /// With each parameter moved by up to three decades, where digits are lost there.
    pub moved: Option<u64>,
    /// Whether carrying rounding errors along was tried, as scenes that want `digits` do.
    pub was_tried: bool,
}

impl fmt::Display for Loss {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let size = |x: u64| if x < 1000 { x.to_string() } else { format!("{:.0e}", x as f64) };
        let near = self.near.map(|x| format!("{} times what rounding the inputs does", size(x)));
        let moved = self.moved.map(|x| match self.near {
            Some(_) => format!(", {} times with parameters moved by three decades", size(x)),
            None => {
                format!(
                    "{} times what rounding the inputs does with parameters moved by three decades",
                    size(x)
                )
            }
        });
        let remedy = match self.was_tried {
            true => "also with errors carried along",
            false => "a scene that wants `digits` keeps them",
        };
        let [near, moved] = [near, moved].map(Option::unwrap_or_default);
        write!(f, "rounding errors of up to {near}{moved}; {remedy}")
    }
}

/// What became of the search for the cheapest form of one function.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Search {
    /// The limits that the search met: it kept the best form that it had found.
    pub limits: BTreeSet<Limit>,
    /// Why the function is computed as it was derived and not in the form found.
    pub fall_back: Option<FallBack>,
}

/// A limit that a search met.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Limit {
    /// Divisors looked at.
    Divisors,
    /// Steps of the search for common divisors.
    Steps,
    /// Terms multiplied out.
    Terms,
    /// Terms of numbers that depend on parameters alone.
    Numbers,
    /// Terms looked at for other units.
    Units,
    /// Measured rounding errors.
    Measurements,
    /// Half of the steps of the scene's budget.
    Scene,
}

impl fmt::Display for Limit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Limit::Divisors => "common divisors looked at",
            Limit::Steps => "steps of the search for common divisors",
            Limit::Terms => "terms multiplied out",
            Limit::Numbers => "terms of numbers in the parameters",
            Limit::Units => "terms looked at for other units",
            Limit::Measurements => "measured rounding errors",
            Limit::Scene => "half of the work that the scene may take",
        })
    }
}

/// Why a function is computed as it was derived.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum FallBack {
    /// Whether the form found is equal could not be found out.
    Unknown,
    /// The form found is another function: a bug of the search.
    Differs,
}

impl fmt::Display for FallBack {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            FallBack::Unknown => "as it was derived: that the cheaper form is equal could not be shown",
            FallBack::Differs => "as it was derived: the cheaper form differs, a bug of hamel",
        })
    }
}

impl Report {
    /// The searches that stopped early or fell back.
    pub fn incomplete(&self) -> impl Iterator<Item = &(Role, Search)> {
        self.searches.iter().filter(|(_, search)| *search != Search::default())
    }
}

impl fmt::Display for Report {
    /// A line for every function whose search stopped early or fell back, and for each that loses digits; nothing where
    /// none did.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (role, search) in self.incomplete() {
            for limit in &search.limits {
                writeln!(
                    f,
                    "  {role}: the search for a cheaper form stopped early, at its limit of {limit}"
                )?;
            }
            if let Some(fall_back) = search.fall_back {
                writeln!(f, "  {role}: computed {fall_back}")?;
            }
        }
        for loss in &self.losses {
            writeln!(f, "  {}: {loss}", loss.role)?;
        }
        Ok(())
    }
}
