//! Parameters of a scene near their defaults, by name.
//!
//! Deliberately does not know: what they are of.

use hamel_codegen::scene::BuiltScene;
use hamel_expr::rational_to_f64;

use crate::random::Random;

/// How far parameters are moved from their defaults, relative to them: little enough for every condition on them.
const SPREAD: f64 = 0.03;

/// Parameters of a scene by name.
#[derive(Clone, Debug)]
pub struct Parameters {
    names: Vec<String>,
    values: Vec<f64>,
}

impl Parameters {
    /// Random ones near the defaults; those that are zero stay so.
    pub fn near_defaults(scene: &BuiltScene, random: &mut Random) -> Parameters {
        let names = scene.params().iter().map(|p| p.name.clone()).collect();
        let values =
            scene.params().iter().map(|p| rational_to_f64(&p.default) * (1.0 + SPREAD * random.number()));
        Parameters { names, values: values.collect() }
    }

    /// In the order of the scene.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// A parameter.
    ///
    /// # Panics
    /// When there is none of this name.
    pub fn get(&self, name: &str) -> f64 {
        let at = self.names.iter().position(|n| n == name);
        self.values[at.unwrap_or_else(|| panic!("no parameter {name}: {:?}", self.names))]
    }

    /// `name1, name2, ..`.
    ///
    /// # Panics
    /// When there are none of these names.
    pub fn vector<const N: usize>(&self, name: &str) -> [f64; N] {
        std::array::from_fn(|k| self.get(&format!("{name}{}", k + 1)))
    }

    /// `name[first], name[first + 1], ..` up to the last that there is.
    ///
    /// # Panics
    /// When there is none with the index `first`.
    pub fn from_index(&self, name: &str, first: usize) -> Vec<f64> {
        let indexed = (first..).map(|k| format!("{name}{k}"));
        let values: Vec<f64> =
            indexed.take_while(|name| self.names.contains(name)).map(|name| self.get(&name)).collect();
        assert!(!values.is_empty(), "no parameter {name}{first}: {:?}", self.names);
        values
    }

    /// `name11, name12, name13, name22, name23, name33`.
    ///
    /// # Panics
    /// When there are none of these names.
    pub fn symmetric(&self, name: &str) -> [f64; 6] {
        ["11", "12", "13", "22", "23", "33"].map(|k| self.get(&format!("{name}{k}")))
    }
}
