//! Every scene on SIMD lanes against the same scene on `f64`, bit for bit.

use std::array;

use hamel_runtime::{F64x4, F64x8, Real, Scene, StateVector};
use hamel_tests::random::Random;

/// Right-hand side, energy and outputs, one after the other.
fn values<R: Real, S: Scene<R>>(params: &[R], t: R, state: &[R], zeros: &S::State) -> Vec<R>
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
fn compare<const N: usize, R, V, S>(zeros: S::State, lane_zeros: V::State) -> usize
where
    R: Real + From<[f64; N]> + Into<[f64; N]>,
    V: Scene<R>,
    S: Scene<f64>,
{
    let info = S::INFO;
    let mut random = Random(20_261_122);
    let mut compared = 0;
    for _ in 0..5 {
        let mut lanes = |f: &dyn Fn(f64) -> f64| -> [f64; N] { array::from_fn(|_| f(random.number())) };
        let params: Vec<[f64; N]> =
            info.params.iter().map(|p| lanes(&|x| p.default * (1.0 + 0.05 * x))).collect();
        // Inside (0, 1): every coordinate is in its domain there.
        let state: Vec<[f64; N]> = info.state.iter().map(|_| lanes(&|x| 0.5 + 0.45 * x)).collect();
        let t = lanes(&|x| x);
        let wide = |rows: &[[f64; N]]| rows.iter().map(|&row| R::from(row)).collect::<Vec<R>>();
        let together = values::<R, V>(&wide(&params), t.into(), &wide(&state), &lane_zeros);
        let together: Vec<[f64; N]> = together.into_iter().map(Into::into).collect();
        for k in 0..N {
            let one = |rows: &[[f64; N]]| rows.iter().map(|row| row[k]).collect::<Vec<f64>>();
            let alone = values::<f64, S>(&one(&params), t[k], &one(&state), &zeros);
            assert_eq!(alone.len(), together.len());
            for (i, (value, lanes)) in alone.iter().zip(&together).enumerate() {
                let label = format!("{} {}, number {i}, lane {k}", info.model, info.scene);
                assert!(value.is_finite(), "{label} is {value}");
                assert_eq!(value.to_bits(), lanes[k].to_bits(), "{label}: {value} and {}", lanes[k]);
            }
            compared += alone.len();
        }
    }
    compared
}

macro_rules! compare_all {
    ($(($module:ident, $model:literal, $scene:literal, $n:literal))*) => {
        /// How many numbers were compared for every scene on four lanes.
        fn compare_every_scene() -> Vec<usize> {
            vec![$({
                use hamel_models::generated::$module::Prepared;
                compare::<4, F64x4, Prepared<F64x4>, Prepared<f64>>([0.0; $n], [F64x4::ZERO; $n])
            }),*]
        }
    };
}

hamel_models::for_each_scene!(compare_all);

#[test]
fn every_scene_on_four_lanes_has_the_bits_of_scalars() {
    let compared = compare_every_scene();
    assert!(compared.len() > 20 && compared.iter().all(|n| *n > 0));
    println!("{} scenes, {} numbers", compared.len(), compared.iter().sum::<usize>());
}

/// One scene with sines, one without, one with constraint multipliers: eight lanes are the code of four.
#[test]
fn scenes_on_eight_lanes_have_the_bits_of_scalars() {
    macro_rules! eight {
        ($($module:ident $n:literal)*) => {$({
            use hamel_models::generated::$module::Prepared;
            let compared = compare::<8, F64x8, Prepared<F64x8>, Prepared<f64>>([0.0; $n], [F64x8::ZERO; $n]);
            assert!(compared > 0);
        })*};
    }
    eight! { euler_disk 5 heavy_top 6 suslov 2 }
}
