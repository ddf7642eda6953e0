//! The machine interface of the compiled models against reference values.
//!
//! Builds `hamel-compiled` in release, once; that is why it is a program of its own.

mod common;

use common::{check_motions, check_points, models};

#[test]
fn compiled_models_agree_with_the_reference() {
    // A body with a group of attitudes, constraints with a planar pose, and rates in given coordinates.
    for model in ["heavy_top", "mobile_robot", "euler_disk"] {
        assert!(models().iter().any(|m| m == model));
        assert!(check_points(model, "compiled") > 0);
        assert!(check_motions(model, "compiled").reconstructions > 0);
    }
}
