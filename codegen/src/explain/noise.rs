//! White noise that the scene takes: along which vector fields.
//!
//! Does not know: how a noise moves the state.

use super::Page;
use crate::scene::BuiltScene;
use hamel_lang::spec::Model;

impl Page {
    /// The noises of the scene, each with its Hamiltonian.
    pub(super) fn noises(&mut self, model: &Model, scene: &BuiltScene) {
        let system = &scene.equations().system;
        if system.noises.is_empty() {
            return;
        }
        let (mut rows, mut mentioned) = (Vec::new(), Vec::new());
        for name in scene.noise_names() {
            let Some(noise) = model.noises.iter().find(|noise| noise.name == name) else { continue };
            let doc = model.inputs.iter().find(|input| input.name == name).map_or("", |input| &input.doc);
            match noise.hamiltonian {
                Some((h, _)) => {
                    let h = model.graph.display(h, self.style);
                    rows.push((self.name(&name), format!("{h}{}", self.remark(doc))));
                }
                None => mentioned.push(self.inline(&self.name(&name))),
            }
        }
        if !rows.is_empty() {
            let s = "Noise that moves the state along the Hamiltonian vector field of a function, in the sense of \
                     Stratonovich:";
            self.line(s);
            self.formulas(&rows);
        }
        if !mentioned.is_empty() {
            self.line(&format!("Noise that the model mentions: {}.", mentioned.join(", ")));
        }
    }
}
