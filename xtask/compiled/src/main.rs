//! Answers `eval`, `simulate` and `ensemble` of `hamel` and `cargo xtask` with the compiled models; started by them,
//! not by hand.

use std::process::ExitCode;

use hamel::run::dynamics::Factory;
use hamel::run::typed::Typed;
use hamel_models::generated;
use hamel_runtime::{Dual, F64x4};

/// Collects a factory for every scene that was generated.
macro_rules! factories {
    ($(($module:ident, $model:literal, $scene:literal, $n:literal))*) => {
        vec![$(Box::new(Typed::<
            generated::$module::Prepared<f64>, generated::$module::Prepared<F64x4>, generated::$module::Prepared<Dual>,
            $n,
        >::new()) as Box<dyn Factory>),*]
    };
}

fn main() -> ExitCode {
    let factories: Vec<Box<dyn Factory>> = hamel_models::for_each_scene!(factories);
    match hamel::run::protocol::serve(&factories) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("hamel-compiled: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}
