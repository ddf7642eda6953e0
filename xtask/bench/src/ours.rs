//! The generated right-hand sides, each as a function of its own in the object file.
//!
//! The test `assembly` finds the functions by their path, `hamel_bench::ours::<module>`.
//!
//! Deliberately does not know: what any of them computes.

use hamel_models::generated;
use hamel_runtime::Scene;

use crate::kernel::Kernel;

fn prepare<S: Scene<f64>>(params: &[f64]) -> S {
    S::prepare(params).unwrap_or_else(|e| panic!("{} {}: {e}", S::INFO.model, S::INFO.scene))
}

macro_rules! wrappers {
    ($(($module:ident, $model:literal, $scene:literal, $n:literal))*) => {
        $(
            #[doc = concat!("`rhs` of scene `", $scene, "` of `", $model, "`.")]
            #[inline(never)]
            pub fn $module(p: &generated::$module::Prepared, t: f64, y: &[f64; $n], dy: &mut [f64; $n]) {
                p.rhs(t, y, dy);
            }
        )*

        /// The generated right-hand sides of all scenes.
        pub fn kernels() -> Vec<Kernel> {
            vec![$(Kernel::new(&generated::$module::INFO, "hamel", 1, prepare, $module)),*]
        }
    };
}

hamel_models::for_each_scene!(wrappers);
