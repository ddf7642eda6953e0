//! Ensembles against integrators of single trajectories.

use std::sync::atomic::{AtomicUsize, Ordering};

use hamel_ensemble::{
    Dop853, Ensemble, Error, F64x8, Family, Lanes, Members, Options, Rk4, Source, Stop, Trajectory, Tsit5,
    family,
};
use hamel_models::generated::heavy_top;
use hamel_runtime::{
    Error as IntegrationError, Failure, Integrator, Method, Real, Scene, StateVector, System,
};

family! { HeavyTop, 6 = hamel_models::generated::heavy_top::Prepared }

const TIMES: [f64; 3] = [0.0, 0.7, 1.5];

fn defaults<const P: usize>(info: &hamel_runtime::SceneInfo) -> [f64; P] {
    std::array::from_fn(|k| info.params[k].default)
}

/// Spins from slow to fast, so that neighbours differ; 4 and 8 do not divide their number.
fn spins() -> Vec<[f64; 6]> {
    (0..11).map(|k| [0.3, -0.2, 0.9 * f64::from(k * 7 % 11), 0.6, 0.0, 0.8]).collect()
}

fn alone<F: Family<N>, M: Method<f64, F::Of<f64>>, const N: usize>(
    method: M,
    options: Options<f64>,
    params: &[f64],
    initial: [f64; N],
) -> Trajectory<[f64; N]> {
    let scene = F::Of::<f64>::prepare(params).unwrap();
    let mut solver = Integrator::new(&scene, method, 0.0, initial, options).unwrap();
    let mut samples = Vec::new();
    solver.sample(1.5, TIMES, |_, y| samples.push(*y)).unwrap();
    Trajectory { t: solver.t(), state: *solver.state(), samples, stats: solver.stats(), stop: None }
}

fn with_fixed_steps<L: Lanes>()
where
    Rk4: Method<L, <HeavyTop as Family<6>>::Of<L>>,
{
    let params: [f64; 9] = defaults(&heavy_top::INFO);
    let options = Options::fixed(0.01);
    let together =
        Ensemble::new(Rk4, options).with_lanes::<L>().run::<HeavyTop, _>(&[params], &spins(), 1.5, &TIMES);
    let single: Vec<_> =
        spins().into_iter().map(|y| alone::<HeavyTop, _, 6>(Rk4, options, &params, y)).collect();
    assert_eq!(together.unwrap(), single);
}

#[test]
fn fixed_steps_give_the_bits_of_single_trajectories() {
    with_fixed_steps::<f64>();
    with_fixed_steps::<hamel_ensemble::F64x4>();
    with_fixed_steps::<F64x8>();
}

#[test]
fn one_lane_gives_the_bits_of_single_trajectories() {
    let params: [f64; 9] = defaults(&heavy_top::INFO);
    let options = Options::adaptive(1e-9, 1e-11);
    let ensemble = Ensemble::new(Dop853, options).with_lanes::<f64>();
    let together = ensemble.run::<HeavyTop, _>(&[params], &spins(), 1.5, &TIMES).unwrap();
    let single: Vec<_> =
        spins().into_iter().map(|y| alone::<HeavyTop, _, 6>(Dop853, options, &params, y)).collect();
    assert_eq!(together, single);
}

#[test]
fn equal_lanes_give_the_bits_of_a_single_trajectory() {
    let params: [f64; 9] = defaults(&heavy_top::INFO);
    let options = Options::adaptive(1e-9, 1e-11);
    let single = alone::<HeavyTop, _, 6>(Dop853, options, &params, spins()[4]);
    let together =
        Ensemble::new(Dop853, options).run::<HeavyTop, _>(&vec![params; 6], &[spins()[4]], 1.5, &TIMES);
    assert_eq!(together.unwrap(), vec![single; 6]);
}

/// The step of a group obeys its worst lane, so that each is at least as accurate as its tolerance asks for: the
/// difference is that of two integrations at 1e-9, far from the 1e-3 by which neighbours differ.
#[test]
fn lanes_that_differ_keep_the_tolerance() {
    let params: [f64; 9] = defaults(&heavy_top::INFO);
    let exact = Options::adaptive(1e-13, 1e-14);
    let ensemble = Ensemble::new(Tsit5, Options::adaptive(1e-9, 1e-9));
    let together = ensemble.run::<HeavyTop, _>(&[params], &spins(), 1.5, &TIMES).unwrap();
    for (trajectory, initial) in together.iter().zip(spins()) {
        let reference = alone::<HeavyTop, _, 6>(Dop853, exact, &params, initial);
        assert_eq!((trajectory.t, &trajectory.stop), (1.5, &None));
        for (states, exact) in trajectory.samples.iter().zip(&reference.samples) {
            for (x, exact) in states.iter().zip(exact) {
                assert!((x - exact).abs() < 1e-6 * (1.0 + exact.abs()), "{x} and {exact}");
            }
        }
    }
}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let params: [f64; 9] = defaults(&heavy_top::INFO);
    let ensemble = Ensemble::new(Dop853, Options::adaptive(1e-8, 1e-10));
    let initial: Vec<_> = spins().into_iter().cycle().take(50).collect();
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| ensemble.run::<HeavyTop, _>(&[params], &initial, 1.5, &TIMES)).unwrap()
    };
    let one = with(1);
    assert_eq!(one.len(), 50);
    assert_eq!(one, with(3));
}

#[test]
fn a_failure_spoils_no_other_trajectory() {
    let good: [f64; 9] = defaults(&heavy_top::INFO);
    let mut params = vec![good; 11];
    params[2][0] = -1.0;
    let mut initial = spins();
    initial[5][1] = f64::NAN;
    let options = Options::adaptive(1e-9, 1e-11);
    let ensemble = Ensemble::new(Dop853, options);
    let results = ensemble.run::<HeavyTop, _>(&params, &initial, 1.5, &TIMES).unwrap();
    let Some(Stop::Params(error)) = results[2].stop else { panic!("{:?}", results[2].stop) };
    assert_eq!(error.condition, "I1 > 0");
    assert_eq!((results[2].t, results[2].state, results[2].samples.len()), (0.0, initial[2], 0));
    let expected = IntegrationError::Failure(Failure::NonFinite { t: 0.0, index: 1 });
    assert_eq!(results[5].stop, Some(Stop::Integration(expected)));
    // Their groups were integrated one by one, the last one on lanes.
    for k in [0, 1, 3, 4, 6, 7] {
        assert_eq!(results[k], alone::<HeavyTop, _, 6>(Dop853, options, &good, initial[k]), "trajectory {k}");
    }
    assert!(results[8..].iter().all(|trajectory| trajectory.t == 1.5 && trajectory.stop.is_none()));
    let whole = ensemble.run::<HeavyTop, _>(&[good], &spins(), 1.5, &TIMES).unwrap();
    assert_eq!(results[8..], whole[8..]);
}

/// A fast top spends a limit on steps that is enough for a slow one beside it.
#[test]
fn a_trajectory_that_stops_keeps_its_state_and_samples() {
    let params: [f64; 9] = defaults(&heavy_top::INFO);
    let [slow, fast] = [0.0, 90.0].map(|spin| [0.3, -0.2, spin, 0.6, 0.0, 0.8]);
    let options = Options::adaptive(1e-9, 1e-11);
    let unlimited = alone::<HeavyTop, _, 6>(Dop853, options, &params, slow);
    let limit = unlimited.stats.steps + unlimited.stats.rejected;
    let times: Vec<f64> = (0..1500).map(|k| 0.001 * f64::from(k)).collect();
    let ensemble = Ensemble::new(Dop853, options.with_max_steps(limit));
    let results = ensemble.run::<HeavyTop, _>(&[params], &[slow, fast], 1.5, &times).unwrap();
    assert_eq!(
        (results[0].state, results[0].samples.len(), &results[0].stop),
        (unlimited.state, 1500, &None)
    );
    let stopped = &results[1];
    let expected = IntegrationError::TooManySteps { t: stopped.t, limit };
    assert_eq!(stopped.stop, Some(Stop::Integration(expected)));
    assert!(stopped.t > 0.0 && stopped.t < 1.5 && stopped.state.iter().all(|x| x.is_finite()));
    let reached = times.iter().filter(|&&t| t <= stopped.t).count();
    assert!(reached > 1);
    assert_eq!(stopped.samples.len(), reached);
}

#[test]
fn numbers_of_parameters_and_states_have_to_fit() {
    let params: [f64; 9] = defaults(&heavy_top::INFO);
    let ensemble = Ensemble::new(Dop853, Options::adaptive(1e-9, 1e-11));
    let run = |sets: usize, states: usize| {
        ensemble.run::<HeavyTop, _>(&vec![params; sets], &vec![spins()[0]; states], 0.1, &[])
    };
    assert_eq!(run(3, 2).unwrap_err(), Error::Lengths { params: 3, initial: 2 });
    assert_eq!(run(0, 2).unwrap_err(), Error::Lengths { params: 0, initial: 2 });
    assert_eq!(
        [run(0, 0), run(1, 0), run(0, 1), run(1, 3), run(3, 1)].map(|r| r.unwrap().len()),
        [0, 0, 0, 3, 3]
    );
    let short = ensemble.run::<HeavyTop, _>(&[[1.0]], &spins(), 0.1, &[]).unwrap();
    assert!(short.iter().all(|trajectory| matches!(trajectory.stop, Some(Stop::Params(_)))));
    let unordered = ensemble.run::<HeavyTop, _>(&[params], &spins(), 1.0, &[2.0]).unwrap();
    assert!(
        unordered
            .iter()
            .all(|t| matches!(t.stop, Some(Stop::Integration(IntegrationError::OutsideInterval { .. }))))
    );
}

/// Decay of as many numbers as there are rates, which are known at run time only.
struct Decay;

#[derive(Clone, Debug, PartialEq)]
struct Numbers<R>(Vec<R>);

impl<R: Real> StateVector<R> for Numbers<R> {
    fn as_slice(&self) -> &[R] {
        &self.0
    }
    fn as_mut_slice(&mut self) -> &mut [R] {
        &mut self.0
    }
}

impl<R: Real> System<R> for Numbers<R> {
    type State = Numbers<R>;
    fn rhs(&self, _t: R, y: &Numbers<R>, dy: &mut Numbers<R>) {
        for ((dy, y), rate) in dy.0.iter_mut().zip(&y.0).zip(&self.0) {
            *dy = -*rate * *y;
        }
    }
}

impl<R: Real> Source<R> for Decay {
    type State = Numbers<R>;
    type System = Numbers<R>;
    type Error = &'static str;

    fn prepare(&self, params: &[R]) -> Result<Numbers<R>, &'static str> {
        let rates = params.to_vec();
        if rates.iter().all(|rate| rate.all_gt(R::ZERO)) { Ok(Numbers(rates)) } else { Err("rate > 0") }
    }

    fn state(&self, components: &[R]) -> Numbers<R> {
        Numbers(components.to_vec())
    }
}

#[test]
fn systems_of_a_dimension_known_at_run_time_are_integrated_as_well() {
    let params: Vec<[f64; 2]> = (0..10).map(|k| [f64::from(k) - 1.0, 0.5]).collect();
    let done = AtomicUsize::new(0);
    let ensemble = Ensemble::new(Dop853, Options::adaptive(1e-10, 1e-12));
    let progress = |n: usize| {
        done.fetch_add(n, Ordering::Relaxed);
    };
    let start = [1.0, 2.0];
    let member = |k: usize| (params[k].as_slice(), start.as_slice());
    let members = Members { n: params.len(), n_state: 2, member: &member };
    let results = ensemble.run_from(&Decay, &members, 1.0, &[0.5], progress);
    assert_eq!((results.len(), done.into_inner()), (10, 10));
    let stopped: Vec<_> = results.stopped.iter().map(|stopped| (stopped.at, stopped.stop)).collect();
    assert_eq!(stopped, [(0, Stop::Params("rate > 0")), (1, Stop::Params("rate > 0"))]);
    for (k, rates) in params.iter().enumerate().skip(2) {
        let expected = |t: f64| [(-rates[0] * t).exp(), 2.0 * (-rates[1] * t).exp()];
        for (found, t) in [(results.state(k, 0), 0.5), (&results.ends[2 * k..2 * k + 2], 1.0)] {
            // Some steps at a tolerance of 1e-10.
            let near = found.iter().zip(expected(t)).all(|(x, y)| (x - y).abs() < 1e-9);
            assert!(near, "{found:?} for {:?}", expected(t));
        }
    }
}
