//! Errors of the energy over many steps, for the methods of the runtime on systems that conserve it.
//!
//! Every method takes steps at which round-off is all that is left of its error: half the longest power of two with
//! which it meets the end of a short motion; the method for long runs also an eighth, which leaves less of it. Runs
//! start at several points of one motion, so that their round-off has nothing in common. The energy is that of the
//! state as it is stored, with 31 digits.
//!
//! Does not know: where motions come from, how results are shown.

use std::time::Instant;

use hamel_runtime::{
    DoubleDouble, Gauss8, Gauss16, Gbs14, Integrator, Method, Options, Projected, Real, Scene, System,
    Taylor, Vern9,
};

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

/// Numbers by name.
pub type Numbers = std::collections::BTreeMap<String, f64>;

/// Errors after some steps.
#[derive(Clone, Debug, PartialEq)]
pub struct Error {
    /// Steps.
    pub steps: u64,
    /// Root of the mean square of the relative errors of the energy, over all runs.
    pub rms: f64,
    /// Their mean.
    pub mean: f64,
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

/// A scene over two scalars, with the energy of a state.
struct Body<S, W> {
    scene: S,
    wide: W,
}

impl<S, W, const N: usize> Body<S, W>
where
    S: Scene<f64> + System<f64, State = [f64; N]>,
    W: Scene<DoubleDouble> + System<DoubleDouble, State = [DoubleDouble; N]>,
{
    fn new(params: &Numbers) -> Result<Self, String> {
        let of = |name: &str| params.get(name).copied().ok_or_else(|| format!("no value for {name}"));
        let values = S::INFO.params.iter().map(|p| of(p.name)).collect::<Result<Vec<f64>, _>>()?;
        let wide: Vec<DoubleDouble> = values.iter().copied().map(DoubleDouble::from).collect();
        let scene = S::prepare(&values).map_err(|e| e.to_string())?;
        Ok(Body { scene, wide: W::prepare(&wide).map_err(|e| e.to_string())? })
    }

    /// The state of a motion; an attitude that it does not have is none.
    fn state(&self, initial: &Numbers) -> [f64; N] {
        let value =
            |name: &&str| initial.get(*name).copied().unwrap_or(if *name == "qw" { 1.0 } else { 0.0 });
        let values: Vec<f64> = S::INFO.state.iter().map(value).collect();
        std::array::from_fn(|k| values[k])
    }

    fn energy(&self, y: &[f64; N]) -> DoubleDouble {
        // The scenes have an energy that does not depend on time.
        self.wide.energy_of(DoubleDouble::ZERO, &y.map(DoubleDouble::from)).unwrap_or(DoubleDouble::ZERO)
    }

    fn advanced<M: Method<f64, S>>(
        &self,
        method: M,
        start: [f64; N],
        t: f64,
        options: Options<f64>,
    ) -> Option<[f64; N]> {
        let mut solver = Integrator::new(&self.scene, method, 0.0, start, options).ok()?;
        solver.integrate_to(t).ok()?;
        Some(*solver.state())
    }

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
        let mut errors: Vec<Error> = Vec::new();
        let mut clock = 0.0;
        let mut time = 0.0;
        for run in 0..RUNS {
            let t = motion.t_end * f64::from(run) / f64::from(RUNS);
            let start = self.advanced(Gauss16, start, t, Options::fixed(0.5_f64.powi(9)))?;
            let energy = self.energy(&start);
            let mut solver = Integrator::new(&self.scene, method, 0.0, start, options).ok()?;
            let (mut next, mut place, begin) = (FIRST, 0, Instant::now());
            for step in 1..=steps {
                // Far enough that the end is never met.
                let _ = solver.step_towards(1e12).ok()?;
                if step == next {
                    let error = (self.energy(solver.state()) - energy) / energy;
                    let error = if DoubleDouble::ZERO.all_gt(error) { -error.hi().abs() } else { error.hi() };
                    if run == 0 {
                        errors.push(Error { steps: step, rms: 0.0, mean: 0.0 });
                    }
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
/// dimension and the number of these; and with the one that has series.
macro_rules! for_each_model {
    ($visit:ident) => {
        $visit! {
            free_rigid_body 3 (free_rigid_body_invariants 7 5);
            heavy_top 6 (heavy_top_invariants 6 3) [heavy_top_taylor];
            kirchhoff_body 6 (kirchhoff_body_invariants 13 6);
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
    ($($model:ident $n:literal $(($kept:ident $m:literal $k:literal))? $([$series:ident])?;)*) => {
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
                    Ok(())
                })*
                other => {
                    let known = [$(stringify!($model)),*].join(", ");
                    Err(format!("{other} is not measured: choose of {known}"))
                }
            }
        }
    };
}

for_each_model!(models);
