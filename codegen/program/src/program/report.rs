//! What became of the searches for the cheapest form of every function.
//!
//! Does not know: how anything is searched for, what is done about a search that stopped early.

use std::collections::BTreeSet;
use std::fmt;

use super::role::Role;

/// What became of the searches for the cheapest form, function by function.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Report {
    /// Every function that was rewritten, in the order of the program.
    pub searches: Vec<(Role, Search)>,
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
    /// A line for every function whose search stopped early or fell back; nothing where none did.
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
        Ok(())
    }
}
