//! The generated right-hand sides, each as a function of its own in the object file.
//!
//! The test `assembly` finds the functions by their path, `hamel_bench::ours::<module>`.
//!
//! Deliberately does not know: what any of them computes.

use hamel_models::generated;

#[cfg(feature = "measure")]
pub use measured::kernels;

macro_rules! wrappers {
    ($(($module:ident, $model:literal, $scene:literal, $n:literal))*) => {
        $(
            #[doc = concat!("`rhs` of scene `", $scene, "` of `", $model, "`.")]
            #[inline(never)]
            pub fn $module(p: &generated::$module::Prepared, t: f64, y: &[f64; $n], dy: &mut [f64; $n]) {
                p.rhs(t, y, dy);
            }
        )*
    };
}

hamel_models::for_each_scene!(wrappers);

/// The functions as kernels, on one lane and on several.
#[cfg(feature = "measure")]
mod measured {
    use hamel_models::generated;
    use hamel_runtime::{F64x4, F64x8, Real, Scene, SceneInfo};

    use crate::kernel::Kernel;

    fn prepare<R: Real, S: Scene<R>>(params: &[f64]) -> S {
        let params: Vec<R> = params.iter().map(|x| R::from_f64(*x)).collect();
        S::prepare(&params).unwrap_or_else(|e| panic!("{} {}: {e}", S::INFO.model, S::INFO.scene))
    }

    /// `rhs` on several states side by side.
    #[inline(never)]
    fn side_by_side<R, S, const N: usize>(scene: &S, t: R, y: &[R; N], dy: &mut [R; N])
    where
        R: Real,
        S: Scene<R, State = [R; N]>,
    {
        scene.rhs(t, y, dy);
    }

    /// The kernel of a scene on a scalar with several lanes.
    fn lanes<R, S, const N: usize>(info: &'static SceneInfo, n: usize) -> Kernel
    where
        R: Real + 'static,
        S: Scene<R, State = [R; N]> + 'static,
    {
        Kernel::new(info, "hamel", n, prepare, side_by_side::<R, S, N>)
    }

    macro_rules! kernels {
        ($(($module:ident, $model:literal, $scene:literal, $n:literal))*) => {
            /// The generated right-hand sides of all scenes.
            pub fn kernels() -> Vec<Kernel> {
                let mut kernels = Vec::new();
                $({
                    use generated::$module::{INFO, Prepared};
                    // The function itself: inlined into another one it may come out longer.
                    kernels.push(Kernel::new(&INFO, "hamel", 1, prepare, Prepared::<f64>::rhs));
                    kernels.push(lanes::<F64x4, Prepared<F64x4>, $n>(&INFO, F64x4::LANES));
                    kernels.push(lanes::<F64x8, Prepared<F64x8>, $n>(&INFO, F64x8::LANES));
                })*
                kernels
            }
        };
    }

    hamel_models::for_each_scene!(kernels);
}
