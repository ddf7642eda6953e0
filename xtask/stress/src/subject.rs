//! Scenes evaluated operation by operation with numbers that know their error.
//!
//! Deliberately does not know: how states are chosen.

use hamel_codegen::scene::Interpreter;
use hamel_measure::both::Both;
use hamel_program::program::Role;
use hamel_run::info::{Info, OutputEntry, ParamEntry};
use hamel_tests::derived::{Derived, scene_of_text};

/// A scene.
#[derive(Debug)]
pub struct Subject {
    info: Info,
    scene: &'static Derived,
}

impl Subject {
    /// The scene of a model with a text. Its program has the bits of the generated module (`tests/tests/compiled.rs`).
    ///
    /// # Panics
    /// When it cannot be built.
    pub fn new(model: &str, text: &str, scene: &str) -> Subject {
        let scene = scene_of_text(model, text, scene);
        let params = scene.params().iter().map(|p| ParamEntry {
            name: p.name.clone(),
            default: p.default,
            doc: String::new(),
        });
        let outputs = scene.outputs().iter().map(|o| OutputEntry {
            name: o.name.clone(),
            components: o.components.clone(),
            doc: String::new(),
        });
        let info = Info {
            model: scene.model.clone(),
            scene: scene.scene.clone(),
            state: scene.state_names().to_vec(),
            momenta: Vec::new(),
            params: params.collect(),
            inputs: Vec::new(),
            noises: Vec::new(),
            velocities: Vec::new(),
            frames: Vec::new(),
            outputs: outputs.collect(),
            has_energy: scene.program.function(&Role::Energy).is_some(),
            conserves_energy: false,
        };
        Subject { info, scene }
    }

    /// Names and defaults.
    pub fn info(&self) -> &Info {
        &self.info
    }

    /// Fixes the parameters; none where a condition on them does not hold.
    pub fn prepare(&self, params: &[Both]) -> Option<Prepared<'_>> {
        self.scene.prepare_over(params).ok().map(Prepared)
    }
}

/// A scene with parameters.
#[derive(Debug)]
pub struct Prepared<'a>(Interpreter<'a, Both>);

impl Prepared<'_> {
    /// The derivative of the state at `y`.
    pub fn rhs(&self, t: Both, y: &[Both]) -> Vec<Both> {
        let mut dy = vec![Both::default(); y.len()];
        self.0.rhs(t, y, &mut dy);
        dy
    }

    /// All outputs, one after the other, and the energy at the end where the scene has one.
    pub fn outputs(&self, t: Both, y: &[Both]) -> Vec<Both> {
        let mut out = self.0.outputs(t, y);
        out.extend(self.0.energy(t, y));
        out
    }

    /// Whether the scene knows a reason why the right-hand side has no value at a point.
    pub fn is_refused(&self, t: Both, y: &[Both]) -> bool {
        self.0.check(t, y).is_err()
    }

    /// Whether a point is outside of the domain of the equations, where they may have no value.
    pub fn is_outside(&self, t: Both, y: &[Both]) -> bool {
        self.0.domain(t, y).is_err()
    }
}
