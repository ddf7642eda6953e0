//! What a cache keeps of a scene: its program and its names, and whether they belong together.
//!
//! Does not know: how a scene is derived or evaluated, caches.

use hamel_codegen::scene::{BuiltScene, Executable};
use hamel_codegen::spec;
use hamel_expr::rational_to_f64;
use hamel_program::program::Role;
use serde::{Deserialize, Serialize};

use super::info::{Info, OutputEntry, ParamEntry};

/// What is kept of a scene.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Stored {
    pub(super) executable: Executable,
    pub(super) info: Info,
}

impl Stored {
    pub(super) fn of(model: &str, scene: &BuiltScene) -> Stored {
        let param = |p: &spec::Param| ParamEntry {
            name: p.name.clone(),
            default: rational_to_f64(&p.default),
            doc: p.doc.clone(),
        };
        let info = Info {
            model: model.to_owned(),
            scene: scene.name().to_owned(),
            state: scene.state_names(),
            momenta: momenta(scene),
            params: scene.params().iter().map(param).collect(),
            inputs: scene.equations().system.inputs.iter().map(param).collect(),
            noises: scene.noise_names(),
            velocities: scene.equations().names_of_velocities().to_vec(),
            frames: scene.frame_names(),
            outputs: scene.outputs().iter().map(output_entry).collect(),
            has_energy: scene.has_energy(),
            conserves_energy: scene.has_energy() && scene.equations().facts.conserves_energy(),
        };
        Stored { executable: scene.executable(), info }
    }

    /// Whether the program keeps its rules and has what the names say.
    pub(super) fn is_sound(&self, model: &str, scene: &str) -> bool {
        let Stored { executable, info } = self;
        let program = &executable.program;
        let groups = program.functions.iter().filter_map(|function| match &function.role {
            Role::Output(name) => Some((name, function.results.len())),
            _ => None,
        });
        let told = info.outputs.iter().map(|group| (&group.name, group.components.len()));
        fits(executable, info)
            && (info.model.as_str(), info.scene.as_str()) == (model, scene)
            && groups.eq(told.filter(|(_, n)| *n > 0))
            && info.has_energy == program.function(&Role::Energy).is_some()
    }
}

/// Whether a program keeps its rules and takes the parameters, the inputs and the state of a scene.
pub(super) fn fits(executable: &Executable, info: &Info) -> bool {
    let program = &executable.program;
    let inputs = program.inputs.iter().map(|(name, _)| name);
    program.state == info.state
        && program.params == info.param_names()
        && inputs.eq(info.inputs.iter().map(|input| &input.name))
        && executable.verify().is_ok()
}

/// Components of a state in the place of velocities of the model.
fn momenta(scene: &BuiltScene) -> Vec<String> {
    let carried = scene.equations().system.momenta.iter().filter(|m| m.symbol.is_some()).map(|m| &m.name);
    let others = scene.legendre().momenta.iter().map(|(name, _)| name);
    let mut names: Vec<String> = carried.chain(others).cloned().collect();
    names.sort();
    names.dedup();
    names
}

pub(super) fn output_entry(output: &hamel_mechanics::mechanics::Output) -> OutputEntry {
    OutputEntry {
        name: output.name.clone(),
        components: output.components.iter().map(|(name, _)| name.clone()).collect(),
        doc: output.doc.clone(),
    }
}
