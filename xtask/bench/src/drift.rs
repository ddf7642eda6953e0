//! Errors of the energy over many steps, for the methods of the runtime on systems that conserve it.
//!
//! Every method takes steps at which round-off is all that is left of its error: half the longest power of two with
//! which it meets the end of a short motion; the method for long runs also an eighth, which leaves less of it. Runs
//! start at several points of one motion, so that their round-off has nothing in common. The energy is that of the
//! state as it is stored, with 31 digits. Compositions of exact flows, of low order, take steps of one length: their
//! error is what is compared, and what becomes of the Casimirs.
//!
//! Does not know: where motions come from, how results are shown.

use std::time::Instant;

use hamel_runtime::{
    DoubleDouble, Gauss8, Gauss16, Gbs14, Integrator, Method, Options, Projected, Scene, Splitting4,
    Splitting6, System, Taylor, Vern9,
};

use crate::body::{Body, Numbers};

/// Runs of each method.
const RUNS: u32 = 4;
/// Steps after which errors are told first.
const FIRST: u64 = 1_000;
/// Error at the end of the short motion, above which steps are too long; what the sum of its steps is rounded by.
const MET: f64 = 3e-14;
/// Steps that are tried: `2^-k`.
const POWERS: std::ops::RangeInclusive<i32> = 1..=12;
/// The part of the longest step that methods take, and the shorter one of the method for long runs.
const PARTS: [f64; 2] = [0.5, 0.125];
/// All but the longest runs take this part of the steps.
const OTHERS: u64 = 10;
/// Steps of the compositions of exact flows.
const SPLIT: f64 = 0.0625;

/// A motion to start from.
#[derive(Clone, Debug)]
pub struct Motion {
    /// Name of the model.
    pub model: String,
    /// Values of the parameters by name.
    pub params: Numbers,
    /// State at time zero by name.
    pub initial: Numbers,
    /// Length of the short motion.
    pub t_end: f64,
}

/// Errors after some steps.
#[derive(Clone, Debug, PartialEq)]
pub struct Error {
    /// Steps.
    pub steps: u64,
    /// Root of the mean square of the relative errors of the energy, over all runs.
    pub rms: f64,
    /// Their mean.
    pub mean: f64,
    /// The largest change of another invariant, relative to one and its value; nothing of a scene that has none.
    pub invariants: Option<f64>,
}

/// What was measured of a method.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// Name of the method.
    pub method: &'static str,
    /// Size of the steps; their mean where the method chooses them.
    pub h: f64,
    /// Nanoseconds of a unit of time.
    pub ns: f64,
    /// Errors after 1000 steps, ten times as many, and so on.
    pub errors: Vec<Error>,
}

impl<S, W, const N: usize> Body<S, W>
where
    S: Scene<f64> + System<f64, State = [f64; N]>,
    W: Scene<DoubleDouble> + System<DoubleDouble, State = [DoubleDouble; N]>,
{
    /// The longest power of two with which the end of the short motion is met.
    fn step<M: Method<f64, S>>(&self, method: M, start: [f64; N], t: f64, end: &[f64; N]) -> Option<f64> {
        let is_met = |h: f64| {
            let found = self.advanced(method, start, t, Options::fixed(h))?;
            let errors = found.iter().zip(end).map(|(x, y)| (x - y).abs() / (1.0 + y.abs()));
            errors.fold(0.0, |max: f64, e| if e <= max { max } else { e }).le(&MET).then_some(h)
        };
        POWERS.map(|k| 0.5_f64.powi(k)).find_map(is_met)
    }

    fn measure<M: Method<f64, S> + 'static>(
        &self,
        (name, part): (&'static str, f64),
        method: M,
        motion: &Motion,
        steps: u64,
    ) -> Option<Measured>
    where
        S: hamel_runtime::OverScalar<hamel_runtime::F64x4>,
    {
        let start = self.state(&motion.initial);
        let options = match M::TABLEAU.estimate_order() {
            Some(_) if name == "taylor" => Options::adaptive(0.0, f64::EPSILON),
            _ => {
                let end = self.advanced(Gauss16, start, motion.t_end, Options::fixed(0.5_f64.powi(10)))?;
                Options::fixed(part * self.step(method, start, motion.t_end, &end)?)
            }
        };
        self.runs(name, method, options, (start, motion.t_end), steps)
    }

    /// Invariants other than the energy.
    fn invariants(&self, y: &[f64; N]) -> Vec<f64> {
        let mut values = vec![0.0; S::N_INVARIANTS];
        self.scene.invariants_of(0.0, y, &mut values);
        let named = S::INFO.outputs.iter().find(|o| o.name == "invariants").map_or(&[][..], |o| o.components);
        named.iter().zip(values).filter(|(name, _)| **name != "energy").map(|(_, value)| value).collect()
    }

    /// A method with steps that are given, from points of a motion that starts at a state and has a length.
    fn runs<M: Method<f64, S>>(
        &self,
        name: &'static str,
        method: M,
        options: Options<f64>,
        (start, length): ([f64; N], f64),
        steps: u64,
    ) -> Option<Measured>
    where
        S: hamel_runtime::OverScalar<hamel_runtime::F64x4>,
    {
        let mut errors: Vec<Error> = Vec::new();
        let mut clock = 0.0;
        let mut time = 0.0;
        for run in 0..RUNS {
            let t = length * f64::from(run) / f64::from(RUNS);
            let start = self.advanced(Gauss16, start, t, Options::fixed(0.5_f64.powi(9)))?;
            let (energy, invariants) = (self.energy(&start), self.invariants(&start));
            let mut solver = Integrator::new(&self.scene, method, 0.0, start, options).ok()?;
            let (mut next, mut place, begin) = (FIRST, 0, Instant::now());
            for step in 1..=steps {
                // Far enough that the end is never met.
                let _ = solver.step_towards(1e12).ok()?;
                if step == next {
                    let error = ((self.energy(solver.state()) - energy) / energy).hi();
                    let changes = invariants.iter().zip(self.invariants(solver.state()));
                    let changed = changes.map(|(from, to)| (to - from).abs() / (1.0 + from.abs()));
                    let changed = changed.reduce(f64::max);
                    if run == 0 {
                        errors.push(Error { steps: step, rms: 0.0, mean: 0.0, invariants: changed });
                    }
                    errors[place].invariants = errors[place].invariants.zip(changed).map(|(a, b)| a.max(b));
                    errors[place].rms += error * error / f64::from(RUNS);
                    errors[place].mean += error / f64::from(RUNS);
                    (next, place) = (10 * next, place + 1);
                }
            }
            clock += begin.elapsed().as_secs_f64();
            time += solver.t();
        }
        for error in &mut errors {
            error.rms = error.rms.sqrt();
        }
        let h = time / (steps as f64 * f64::from(RUNS));
        Some(Measured { method: name, h, ns: 1e9 * clock / time, errors })
    }
}

/// Calls the macro with the models that are measured and their dimension; with their scene that has invariants, its
/// dimension and the number of these; with the one that has series; and with the one in momenta that has exact flows,
/// the number of its invariants, and a state to start from.
macro_rules! for_each_model {
    ($visit:ident) => {
        $visit! {
            free_rigid_body 3 (free_rigid_body_invariants 7 5) <free_rigid_body_splitting 2 [0.7, 2.1, 0.9]>;
            heavy_top 6 (heavy_top_invariants 6 3) [heavy_top_taylor]
                <heavy_top_splitting 3 [0.52, -0.51, 1.2, 0.0, 0.6, 0.8]>;
            kirchhoff_body 6 (kirchhoff_body_invariants 13 6)
                <kirchhoff_body_splitting 3 [1.04, -0.66, 0.21, 1.85, 0.46, -0.95]>;
            two_arm_satellite 7 (two_arm_satellite_invariants 11 5) [two_arm_satellite_taylor];
            zeitlin_euler_3 8;
            euler_disk 5 [euler_disk_taylor];
            euler_disk_advected 6 (euler_disk_advected_invariants 6 2);
            chaplygin_ball 6 (chaplygin_ball_invariants 6 2) [chaplygin_ball_taylor];
            veselova 6 (veselova_invariants 6 2);
            snakeboard 5 (snakeboard_invariants 5 2) [snakeboard_taylor];
        }
    };
}

macro_rules! models {
    (@kept $module:ident $n:literal $k:literal $motion:ident $steps:ident $say:ident) => {{
        use hamel_models::generated::$module::Prepared;
        let body = Body::<Prepared<f64>, Prepared<DoubleDouble>>::new(&$motion.params)?;
        let (gauss, verner) = (Projected::<_, $k>::new(Gauss16), Projected::<_, $k>::new(Vern9));
        $say(body.measure(("gauss16, projected", PARTS[0]), gauss, $motion, $steps / OTHERS));
        $say(body.measure(("vern9, projected", PARTS[0]), verner, $motion, $steps / OTHERS));
    }};
    (@series $module:ident $motion:ident $steps:ident $say:ident) => {{
        use hamel_models::generated::$module::Prepared;
        let body = Body::<Prepared<f64>, Prepared<DoubleDouble>>::new(&$motion.params)?;
        $say(body.measure(("taylor", PARTS[0]), Taylor::new(), $motion, $steps / OTHERS));
    }};
    (@split $module:ident $k:literal [$($x:literal),*] $motion:ident $steps:ident $say:ident) => {{
        use hamel_models::generated::$module::Prepared;
        let body = Body::<Prepared<f64>, Prepared<DoubleDouble>>::new(&$motion.params)?;
        let (options, start) = (Options::fixed(SPLIT), ([$($x),*], $motion.t_end));
        // The energy, which the steps have one near to of their own, is the last of the invariants.
        let onto_casimirs = Projected::<_, $k>::onto_first(Splitting6::new(), $k - 1);
        $say(body.runs("splitting4", Splitting4::new(), options, start, $steps));
        $say(body.runs("splitting6", Splitting6::new(), options, start, $steps));
        $say(body.runs("splitting6, projected", onto_casimirs, options, start, $steps));
        $say(body.runs("gauss16, momenta", Gauss16, options, start, $steps));
    }};
    ($(
        $model:ident $n:literal $(($kept:ident $m:literal $k:literal))? $([$series:ident])?
        $(<$split:ident $c:literal $start:tt>)?;
    )*) => {
        /// Errors of the energy of states, relative to that of the first one.
        ///
        /// # Errors
        /// An unknown model, numbers that it does not have or does not allow.
        pub fn errors(model: &str, params: &Numbers, states: &[Numbers]) -> Result<Vec<f64>, String> {
            match model {
                $(stringify!($model) => {
                    use hamel_models::generated::$model::Prepared;
                    let body = Body::<Prepared<f64>, Prepared<DoubleDouble>>::new(params)?;
                    let energies: Vec<DoubleDouble> =
                        states.iter().map(|state| body.energy(&body.state(state))).collect();
                    Ok(energies.iter().map(|&e| ((e - energies[0]) / energies[0]).hi()).collect())
                })*
                other => Err(unknown(other)),
            }
        }

        fn unknown(model: &str) -> String {
            let known = [$(stringify!($model)),*].join(", ");
            format!("{model} is not measured: choose of {known}")
        }

        /// Measures every method on a motion; the longest runs have `steps` steps, those of the other methods fewer.
        ///
        /// # Errors
        /// An unknown model, numbers that it does not have or does not allow.
        pub fn measure(motion: &Motion, steps: u64, mut say: impl FnMut(Measured)) -> Result<(), String> {
            let mut say = |measured: Option<Measured>| measured.into_iter().for_each(&mut say);
            match motion.model.as_str() {
                $(stringify!($model) => {
                    use hamel_models::generated::$model::Prepared;
                    let body = Body::<Prepared<f64>, Prepared<DoubleDouble>>::new(&motion.params)?;
                    say(body.measure(("gauss16, short steps", PARTS[1]), Gauss16, motion, steps));
                    say(body.measure(("gauss16", PARTS[0]), Gauss16, motion, steps / OTHERS));
                    $(models!(@kept $kept $m $k motion steps say);)?
                    say(body.measure(("vern9", PARTS[0]), Vern9, motion, steps / OTHERS));
                    say(body.measure(("gauss8", PARTS[0]), Gauss8::fixed_point(), motion, steps / OTHERS));
                    say(body.measure(("gbs14", PARTS[0]), Gbs14, motion, steps / OTHERS));
                    $(models!(@series $series motion steps say);)?
                    $(models!(@split $split $c $start motion steps say);)?
                    Ok(())
                })*
                other => Err(unknown(other)),
            }
        }
    };
}

for_each_model!(models);
