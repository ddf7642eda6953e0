//! Generates the pendulum.

fn main() -> Result<(), hamel_codegen::config::Problems> {
    hamel_codegen::compile("models/pendulum.hamel")
}
