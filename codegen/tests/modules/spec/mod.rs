//! Tests of the model language.

mod bad;
mod docs;
mod expressions;
mod formulation;
mod fuzz;
mod good;
mod kind;
mod memory;
mod motion;
mod positions;

/// The specifications of the crate `hamel-models`.
pub(super) const SPECS: &[(&str, &str)] = &[
    ("free_rigid_body", include_str!("../../../../models/specs/free_rigid_body.hamel")),
    ("heavy_top", include_str!("../../../../models/specs/heavy_top.hamel")),
    ("kirchhoff_body", include_str!("../../../../models/specs/kirchhoff_body.hamel")),
    ("extended_pose", include_str!("../../../../models/specs/extended_pose.hamel")),
    ("suslov", include_str!("../../../../models/specs/suslov.hamel")),
    ("chaplygin_sleigh", include_str!("../../../../models/specs/chaplygin_sleigh.hamel")),
    ("chaplygin_ball", include_str!("../../../../models/specs/chaplygin_ball.hamel")),
    ("euler_disk_advected", include_str!("../../../../models/specs/euler_disk_advected.hamel")),
    ("veselova", include_str!("../../../../models/specs/veselova.hamel")),
];
