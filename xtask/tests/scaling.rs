//! A large generated function, compiled: it equals the interpreter bit for bit.

use xtask::bench::TargetCpu;
use xtask::bench::scaling::{Family, Toolchain};
use xtask::workspace::Workspace;

#[test]
fn the_compiled_free_body_in_thirteen_dimensions_equals_the_interpreter() {
    let workspace = Workspace::find().unwrap_or_else(|e| panic!("{e}"));
    // The comparison is part of the measurement where the target rounds like the interpreter does.
    let toolchain = Toolchain::new(&workspace, TargetCpu::Baseline).unwrap_or_else(|e| panic!("{e}"));
    let row = toolchain.measure(Family::Rotations, 13).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(row.dim, 78);
    // More than fit one block of bindings; see `MAX_BINDINGS` of the emitter.
    assert!(row.operations > 2000 && row.lines > 4000, "{row:?}");
}
