//! A scene as `list` shows it.
//!
//! Does not know: where it comes from.

use hamel_run::info::{Info, ParamEntry};
use hamel_run::request::json::number;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// A scene as `list` shows it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Scene {
    pub(super) scene: String,
    pub(super) state: Vec<String>,
    pub(super) params: Values,
    pub(super) inputs: Values,
    pub(super) outputs: Map<String, Value>,
    pub(super) has_energy: bool,
}

/// Names and defaults, in order.
pub(super) type Values = Map<String, Value>;

impl Scene {
    pub(super) fn of(scene: &str, info: &Info) -> Scene {
        let values = |entries: &[ParamEntry]| -> Values {
            entries.iter().map(|p| (p.name.clone(), number(p.default))).collect()
        };
        let outputs = info.outputs.iter().map(|group| (group.name.clone(), group.components.clone().into()));
        Scene {
            scene: scene.to_owned(),
            state: info.state.clone(),
            params: values(&info.params),
            inputs: values(&info.inputs),
            outputs: outputs.collect(),
            has_energy: info.has_energy,
        }
    }
}
