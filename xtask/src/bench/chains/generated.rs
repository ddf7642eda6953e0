//! The generated right-hand side of the module `scene.rs`.

#[path = "scene.rs"]
pub mod scene;

use crate::kernel::{Kernel, params};
use scene::{INFO, Params, Prepared};

/// The kernel.
pub fn kernels() -> Vec<Kernel> {
    let prepare = |values: &[f64]| {
        Prepared::<f64>::new(&Params::from_array(params(values))).expect("defaults keep the conditions")
    };
    vec![Kernel::new(&INFO, "hamel", 1, prepare, Prepared::<f64>::rhs)]
}
