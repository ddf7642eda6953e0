//! Units of the quantities of a model, as far as they are known: those that doc comments say, and those that follow.
//!
//! Deliberately does not know: how dimensions are solved for, warnings.

mod dimension;

use std::collections::BTreeMap;

use num_traits::{ToPrimitive as _, Zero as _};

use self::dimension::Measure;

pub(in crate::spec) use self::dimension::{Dimension, Exponent, add_product};

/// The unit of a quantity.
#[derive(Clone, Debug, PartialEq)]
pub struct Unit {
    /// As a doc comment says it; where it follows from others, a product of base units.
    text: String,
    measure: Measure,
    is_inferred: bool,
}

impl Unit {
    /// One as it stands in a doc comment, or in a table; nothing where it is no product of powers of units.
    pub fn declared(text: &str) -> Option<Unit> {
        let measure = Measure::parse(text)?;
        let text = if text == "-" { "1" } else { text };
        Some(Unit { text: text.to_owned(), measure, is_inferred: false })
    }

    /// One that follows from others.
    pub(in crate::spec) fn inferred(dimension: Dimension) -> Unit {
        Unit { text: dimension.in_base_units(), measure: Measure::of(dimension), is_inferred: true }
    }

    pub(in crate::spec) fn dimension(&self) -> Dimension {
        self.measure.dimension
    }

    /// Its text, such as `kg m^2` or `rad/s`.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Whether no doc comment says it, and it follows from others.
    pub fn is_inferred(&self) -> bool {
        self.is_inferred
    }

    /// Exponents of kg, m, s, A, K, mol, cd and rad; nothing where one of them is no integer.
    pub fn exponents(&self) -> Option<[i64; 8]> {
        let [kg, m, s, a, k, mol, cd] = self.measure.dimension.exponents()?;
        let rad = self.measure.angle.is_integer().then(|| self.measure.angle.to_i64())??;
        Some([kg, m, s, a, k, mol, cd, rad])
    }

    /// How many of the product of base units it is: a millimetre is 0.001.
    pub fn factor(&self) -> f64 {
        self.measure.factor
    }

    /// How many of another one it is: a millimetre is 0.001 m; nothing where the dimensions differ. A radian counts as
    /// one, but hertz are not compared with angular velocities: they count turns.
    pub fn in_units_of(&self, other: &Unit) -> Option<f64> {
        let counts_turns = |unit: &Unit| unit.text.contains("Hz") && unit.measure.angle.is_zero();
        let mixes = [(self, other), (other, self)]
            .iter()
            .any(|(one, other)| counts_turns(one) && !other.measure.angle.is_zero());
        let is_same = self.dimension() == other.dimension() && !mixes;
        is_same.then(|| self.factor() / other.factor())
    }

    /// That of the rate, in seconds.
    pub fn rate(&self) -> Option<Unit> {
        let text = match self.text.as_str() {
            "s" => "1".to_owned(),
            text => match text.strip_suffix("/s^2") {
                Some(text) => format!("{text}/s^3"),
                None => match text.strip_suffix("/s") {
                    Some(text) => format!("{text}/s^2"),
                    None => format!("{text}/s"),
                },
            },
        };
        Some(Unit { is_inferred: self.is_inferred, ..Unit::declared(&text)? })
    }
}

/// Units of a model by names, as far as they are known.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Units {
    pub(in crate::spec) time: Option<Unit>,
    pub(in crate::spec) energy: Option<Unit>,
    /// Of parameters, inputs, state variables and reconstructed coordinates.
    pub(in crate::spec) of_name: BTreeMap<String, Unit>,
    /// Of outputs and Casimirs, component by component.
    pub(in crate::spec) of_output: BTreeMap<String, Vec<Option<Unit>>>,
}

impl Units {
    /// Of the time: the second, where units of the model have one.
    pub fn time(&self) -> Option<&Unit> {
        self.time.as_ref()
    }

    /// Of the energy.
    pub fn energy(&self) -> Option<&Unit> {
        self.energy.as_ref()
    }

    /// Of a parameter, an input, a state variable or a reconstructed coordinate.
    pub fn of(&self, name: &str) -> Option<&Unit> {
        self.of_name.get(name)
    }

    /// Of a component of an output.
    pub fn of_output(&self, name: &str, component: usize) -> Option<&Unit> {
        self.of_output.get(name)?.get(component)?.as_ref()
    }
}
