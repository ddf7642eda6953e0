//! Derives, lowers and emits every scene of a small model.

#![no_main]

use hamel_codegen::{scene, spec};
use libfuzzer_sys::fuzz_target;

/// Larger models only cost time.
const MAX_NODES: usize = 1500;
const MAX_VELOCITIES: usize = 8;

fuzz_target!(|text: &str| {
    let Ok(model) = spec::parse("fuzz.hamel", text) else { return };
    if model.all_velocities().len() > MAX_VELOCITIES || model.graph.n_nodes() > MAX_NODES {
        return;
    }
    for name in scene::names(&model) {
        match scene::build(&model, &name) {
            Ok(built) => _ = built.emit().expect("emitted text is Rust"),
            Err(problems) => assert!(!problems.to_string().contains("please report this"), "{problems}"),
        }
    }
});
