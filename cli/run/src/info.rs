//! What a scene and its parts are called.
//!
//! Does not know: where a scene comes from, how it is evaluated.

use serde::{Deserialize, Serialize};

/// Names and meanings of all that a scene has.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Info {
    /// Name of the model.
    pub model: String,
    /// Name of the scene within the model.
    pub scene: String,
    /// Names of the state's components in order.
    pub state: Vec<String>,
    /// Components of the state in the place of velocities, such as momenta.
    #[serde(default)]
    pub momenta: Vec<String>,
    /// Free parameters in order.
    pub params: Vec<ParamEntry>,
    /// Inputs that the scene takes, with the values that they are held at.
    #[serde(default)]
    pub inputs: Vec<ParamEntry>,
    /// Names of the inputs that are white noise.
    #[serde(default)]
    pub noises: Vec<String>,
    /// Velocities of the state that have a rate of their own, in the order of inverse dynamics and mass matrix; empty
    /// where the state has momenta in their place.
    #[serde(default)]
    pub velocities: Vec<String>,
    /// Names of the frames of the model.
    #[serde(default)]
    pub frames: Vec<String>,
    /// Groups of outputs in the order of [`Dynamics::outputs`](super::dynamics::Dynamics::outputs).
    pub outputs: Vec<OutputEntry>,
    /// Whether [`Dynamics::energy`](super::dynamics::Dynamics::energy) has a value.
    pub has_energy: bool,
    /// Whether it has one and is proved to be constant along the motion.
    pub conserves_energy: bool,
}

/// A free parameter of a scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ParamEntry {
    /// Name, as the model spells it.
    pub name: String,
    /// Value of the scene as published.
    pub default: f64,
    /// Meaning and unit.
    pub doc: String,
}

/// A group of outputs of a scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OutputEntry {
    /// Name of the group.
    pub name: String,
    /// Names of the components in order.
    pub components: Vec<String>,
    /// Meaning and unit.
    pub doc: String,
}

impl Info {
    /// Number of components of all outputs.
    pub fn n_outputs(&self) -> usize {
        self.outputs.iter().map(|group| group.components.len()).sum()
    }

    /// Names of the parameters in order.
    pub fn param_names(&self) -> Vec<&str> {
        self.params.iter().map(|p| p.name.as_str()).collect()
    }

    /// Names of the state's components in order.
    pub fn state_names(&self) -> Vec<&str> {
        self.state.iter().map(String::as_str).collect()
    }

    /// Defaults of the parameters in order.
    pub fn defaults(&self) -> Vec<f64> {
        self.params.iter().map(|p| p.default).collect()
    }

    /// Positions of a group's components among all outputs; none when the scene has no such group.
    pub fn output_range(&self, group: &str) -> Option<std::ops::Range<usize>> {
        let mut start = 0;
        for entry in &self.outputs {
            let end = start + entry.components.len();
            if entry.name == group {
                return Some(start..end);
            }
            start = end;
        }
        None
    }
}
