//! Generates the crate's models into `OUT_DIR`.

fn main() -> Result<(), hamel_codegen::config::Problems> {
    hamel_codegen::Config::new().include_file("models.rs").emit_rerun_if_changed(true).compile(&[
        "models/suslov_gyrostat.hamel",
        "models/thinning.hamel",
        "models/loop.hamel",
        "models/windows.hamel",
    ])?;
    hamel_codegen::Config::new()
        .scenes("kite", ["flight"])
        .nalgebra(true)
        .emit_rerun_if_changed(true)
        .compile(&["models/kite.hamel"])
}
