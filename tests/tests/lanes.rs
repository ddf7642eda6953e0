//! Scenes on SIMD lanes against the same scenes on `f64`, bit for bit.

use std::array;

use hamel_runtime::{F64x4, F64x8, Real, Scene, StateVector};
use hamel_tests::derived::Derived;
use hamel_tests::models::{derived, generated};
use hamel_tests::random::Random;

/// Right-hand side, energy and outputs of a program, one after the other.
fn interpreted<R: Real>(scene: &Derived, params: &[R], t: R, state: &[R]) -> Vec<R> {
    let prepared =
        scene.prepare_over(params).unwrap_or_else(|e| panic!("{} {}: {e}", scene.model, scene.scene));
    let mut dy = vec![R::ZERO; state.len()];
    prepared.rhs(t, state, &mut dy);
    dy.into_iter().chain(prepared.energy(t, state)).chain(prepared.outputs(t, state)).collect()
}

/// The same of a generated module.
fn compiled<R: Real, S: Scene<R>>(params: &[R], t: R, state: &[R], zeros: &S::State) -> Vec<R>
where
    S::State: StateVector<R>,
{
    let info = S::INFO;
    let label = format!("{} {}", info.model, info.scene);
    let scene = S::prepare(params).unwrap_or_else(|e| panic!("{label}: {e}"));
    let (mut y, mut dy) = (zeros.clone(), zeros.clone());
    y.as_mut_slice().copy_from_slice(state);
    scene.rhs(t, &y, &mut dy);
    let mut outputs = vec![R::ZERO; info.n_outputs()];
    scene.outputs_of(t, &y, &mut outputs);
    dy.as_slice().iter().copied().chain(scene.energy_of(t, &y)).chain(outputs).collect()
}

/// Random parameters near the defaults and random states, other ones on every lane; how many numbers were compared.
fn compare<const N: usize, R>(
    scene: &Derived,
    on_lanes: impl Fn(&[R], R, &[R]) -> Vec<R>,
    alone: impl Fn(&[f64], f64, &[f64]) -> Vec<f64>,
) -> usize
where
    R: Real + From<[f64; N]> + Into<[f64; N]>,
{
    let mut random = Random(20_261_122);
    let mut compared = 0;
    for _ in 0..5 {
        let mut lanes = |f: &dyn Fn(f64) -> f64| -> [f64; N] { array::from_fn(|_| f(random.number())) };
        let params: Vec<[f64; N]> =
            scene.params().iter().map(|p| lanes(&|x| p.default * (1.0 + 0.05 * x))).collect();
        // Inside (0, 1): every coordinate is in its domain there.
        let state: Vec<[f64; N]> = scene.state_names().iter().map(|_| lanes(&|x| 0.5 + 0.45 * x)).collect();
        let t = lanes(&|x| x);
        let wide = |rows: &[[f64; N]]| rows.iter().map(|&row| R::from(row)).collect::<Vec<R>>();
        let together = on_lanes(&wide(&params), t.into(), &wide(&state));
        let together: Vec<[f64; N]> = together.into_iter().map(Into::into).collect();
        for k in 0..N {
            let one = |rows: &[[f64; N]]| rows.iter().map(|row| row[k]).collect::<Vec<f64>>();
            let alone = alone(&one(&params), t[k], &one(&state));
            assert_eq!(alone.len(), together.len());
            for (i, (value, lanes)) in alone.iter().zip(&together).enumerate() {
                let label = format!("{} {}, number {i}, lane {k}", scene.model, scene.scene);
                assert!(value.is_finite(), "{label} is {value}");
                assert_eq!(value.to_bits(), lanes[k].to_bits(), "{label}: {value} and {}", lanes[k]);
            }
            compared += alone.len();
        }
    }
    compared
}

/// Programs do on lanes what generated modules do.
#[test]
fn every_scene_on_four_lanes_has_the_bits_of_scalars() {
    let mut total = 0;
    for (name, scene) in generated() {
        let scene = derived(name, scene);
        let on_lanes = |params: &[F64x4], t, y: &[F64x4]| interpreted(scene, params, t, y);
        let compared = compare(scene, on_lanes, |params, t, y| interpreted(scene, params, t, y));
        assert!(compared > 0, "{} {}", scene.model, scene.scene);
        total += compared;
    }
    println!("{total} numbers");
}

/// One scene with sines, one without, one with constraint multipliers, one that is a loop over a table: of these the
/// compiler makes code for lanes.
#[test]
fn generated_modules_on_lanes_have_the_bits_of_scalars() {
    macro_rules! on_lanes {
        ($($module:ident $n:literal)*) => {$({
            use hamel_models::generated::$module::Prepared;
            let scene = derived(stringify!($module), "default");
            let alone = |params: &[f64], t, y: &[f64]| compiled::<f64, Prepared<f64>>(params, t, y, &[0.0; $n]);
            let four = |params: &[F64x4], t, y: &[F64x4]| {
                compiled::<F64x4, Prepared<F64x4>>(params, t, y, &[F64x4::ZERO; $n])
            };
            let eight = |params: &[F64x8], t, y: &[F64x8]| {
                compiled::<F64x8, Prepared<F64x8>>(params, t, y, &[F64x8::ZERO; $n])
            };
            assert!(compare(scene, four, alone) > 0 && compare(scene, eight, alone) > 0);
        })*};
    }
    on_lanes! { euler_disk 5 heavy_top 6 suslov 2 zeitlin_euler_5 24 }
}
