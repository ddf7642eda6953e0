//! Measures the models for `cargo xtask stress`; started by it, not by hand.

use std::process::ExitCode;

use clap::Parser as _;
use hamel_measure::both::Both;
use hamel_models::generated;
use hamel_run::Error;
use hamel_run::dynamics::Factory;
use hamel_run::typed::Typed as Plain;
use hamel_runtime::{Dual, F64x4};
use hamel_stress::request::{Arguments, StressRequest};
use hamel_stress::run;
use hamel_stress::subject::{Subject, Typed};

/// Collects every scene that was generated.
macro_rules! subjects {
    ($(($module:ident, $model:literal, $scene:literal, $n:literal))*) => {
        vec![$(Box::new(Typed::<generated::$module::Prepared<Both>, $n>::new()) as Box<dyn Subject>),*]
    };
}

/// The scenes of the long runs: model module and dimension.
macro_rules! long {
    ($($module:ident $n:literal),* $(,)?) => {
        vec![$(Box::new(Plain::<
            generated::$module::Prepared<f64>, generated::$module::Prepared<F64x4>, generated::$module::Prepared<Dual>,
            $n,
        >::new()) as Box<dyn Factory + Sync>),*]
    };
}

fn stress() -> Result<(), Error> {
    let request = StressRequest::new(Arguments::parse())?;
    let subjects: Vec<Box<dyn Subject>> = hamel_models::for_each_scene!(subjects);
    let long = long! {
        free_rigid_body_invariants 7,
        heavy_top_invariants 6,
        kirchhoff_body_invariants 13,
        chaplygin_ball_invariants 6,
        chaplygin_sleigh_invariants 2,
        euler_disk_advected_invariants 6,
        snakeboard_invariants 5,
        suslov_invariants 2,
        veselova_invariants 6,
        two_arm_satellite_invariants 11,
    };
    run::run(&subjects, &long, request)
}

fn main() -> ExitCode {
    match stress() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("hamel-stress: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}
