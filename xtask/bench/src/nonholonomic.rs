//! Nonholonomic systems by all methods: the errors of energy and constraint over many steps against the cost.
//!
//! Every method is run with several sizes of steps, or tolerances. A system is moved as hamel writes it, with its
//! velocities solved for where the constraint allows that, and, for the leapfrogs of the discrete Lagrange-d'Alembert
//! principle and two others beside them, with all velocities in the state.
//!
//! Deliberately does not know: where motions come from, how results are shown.

use std::time::Instant;

use hamel_runtime::{
    Dla, Dop853, DoubleDouble, Gauss4, Gauss6, Gauss8, Gauss16, Gbs14, Integrator, Method, Options,
    Projected, Rk4, Scene, System, Taylor, Tsit5, Vern9,
};

use crate::body::{Body, Numbers};

/// What to measure.
#[derive(Clone, Debug)]
pub struct Case {
    /// Name of the model.
    pub model: String,
    /// Values of the parameters by name.
    pub params: Numbers,
    /// State at time zero by name; also of velocities that are solved for.
    pub initial: Numbers,
    /// Steps of each run.
    pub steps: u64,
    /// Names of methods; all when empty.
    pub methods: Vec<String>,
}

/// What was measured of a method with one size of steps.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// Name of the method.
    pub method: &'static str,
    /// Size of the steps, or tolerance.
    pub knob: Knob,
    /// Error of the state at the end of the short motion.
    pub error: f64,
    /// Evaluations of the right-hand side in a unit of time; of methods by series, expansions.
    pub evals: f64,
    /// Nanoseconds of a unit of time.
    pub ns: f64,
    /// The long run; nothing where it did not reach its end.
    pub run: Option<Run>,
}

/// What a method was told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Knob {
    /// The size of its steps.
    Step(f64),
    /// Its tolerance, relative and absolute.
    Tolerance(f64),
}

/// Errors along a long run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Run {
    /// Length of the run.
    pub t: f64,
    /// Largest relative error of the energy.
    pub energy: f64,
    /// What the line that fits the relative errors of the energy best rises by over the run.
    pub trend: f64,
    /// Largest residual of the constraint; nothing where velocities were solved for.
    pub constraint: Option<f64>,
}

/// Length of the short motion.
const SHORT: f64 = 8.0;
/// Largest error at its end of what is worth a long run.
const RESOLVED: f64 = 0.1;
/// Errors of the energy below which shorter steps show nothing but rounding.
const ROUND_OFF: f64 = 1e-13;
/// Sizes of steps that are tried, and tolerances.
const STEPS: [f64; 5] = [1.0, 0.25, 0.0625, 0.015_625, 0.003_906_25];
const TOLERANCES: [f64; 4] = [1e-5, 1e-8, 1e-11, 1e-14];
/// States of a run whose errors are taken.
const SAMPLES: u64 = 20_000;

/// A motion to be measured: where each of its scenes starts, and where the short motion ends.
struct Motion<'c> {
    case: &'c Case,
    end: Numbers,
}

impl<S, W, const N: usize> Body<S, W>
where
    S: Scene<f64> + System<f64, State = [f64; N]>,
    W: Scene<DoubleDouble> + System<DoubleDouble, State = [DoubleDouble; N]>,
{
    /// The state at the end of the short motion by name, to all digits of `f64`.
    fn end(&self, initial: &Numbers) -> Result<Numbers, String> {
        let start = self.state(initial).map(DoubleDouble::from);
        let tolerance = DoubleDouble::from(1e-24);
        let options = Options::adaptive(tolerance, tolerance);
        let failed = |e| format!("{}: the short motion: {e}", S::INFO.model);
        let mut solver =
            Integrator::new(&self.wide, Vern9, DoubleDouble::from(0.0), start, options).map_err(failed)?;
        solver.integrate_to(DoubleDouble::from(SHORT)).map_err(failed)?;
        Ok(S::INFO.state.iter().zip(solver.state()).map(|(name, x)| ((*name).to_owned(), x.hi())).collect())
    }

    /// `max_i |dy_i| / (1 + |y_i|)` over the components that the end has.
    fn error(state: &[f64; N], end: &Numbers) -> f64 {
        let pairs = S::INFO.state.iter().zip(state).filter_map(|(name, x)| Some((x, end.get(*name)?)));
        let errors = pairs.map(|(x, y)| (x - y).abs() / (1.0 + y.abs()));
        errors.fold(0.0, |max, e| if e.is_nan() || e > max { e } else { max })
    }

    /// Position and number of the residuals among the outputs.
    fn residuals() -> Option<(usize, usize)> {
        let before = S::INFO.outputs.iter().take_while(|o| o.name != "constraint");
        let at = before.map(|o| o.components.len()).sum();
        let residuals = S::INFO.outputs.iter().find(|o| o.name == "constraint")?;
        Some((at, residuals.components.len()))
    }

    /// A run of many steps.
    fn run<M: Method<f64, S>>(
        &self,
        method: M,
        options: Options<f64>,
        case: &Case,
    ) -> (f64, f64, Option<Run>) {
        let start = self.state(&case.initial);
        let energy = self.energy(&start);
        let every = (case.steps / SAMPLES).max(1);
        let residuals = Self::residuals();
        let mut outputs = vec![0.0; S::INFO.n_outputs()];
        let mut fit = Line::default();
        let (mut largest, mut constraint) = (0.0_f64, 0.0_f64);
        let clock = Instant::now();
        let Ok(mut solver) = Integrator::new(&self.scene, method, 0.0, start, options) else {
            return (0.0, 0.0, None);
        };
        let mut reached = true;
        for step in 1..=case.steps {
            // Far enough that the end is never met.
            if solver.step_towards(1e12).is_err() {
                reached = false;
                break;
            }
            if step % every == 0 {
                let error = ((self.energy(solver.state()) - energy) / energy).hi();
                largest = largest.max(error.abs());
                fit.add(solver.t(), error);
                if let Some((at, n)) = residuals {
                    self.scene.outputs_of(solver.t(), solver.state(), &mut outputs);
                    constraint = outputs[at..at + n].iter().fold(constraint, |max, c| max.max(c.abs()));
                }
            }
        }
        let t = solver.t();
        let (ns, evals) = (clock.elapsed().as_secs_f64() * 1e9 / t, solver.stats().rhs_evals as f64 / t);
        let is_known = reached && largest.is_finite() && constraint.is_finite();
        let constraint = residuals.map(|_| constraint);
        let run = Run { t, energy: largest, trend: fit.slope() * t, constraint };
        (evals, ns, is_known.then_some(run))
    }

    /// A method over its sweep.
    fn sweep<M: Method<f64, S>>(
        &self,
        name: &'static str,
        method: M,
        is_adaptive: bool,
        motion: &Motion<'_>,
        say: &mut impl FnMut(Measured),
    ) {
        let case = motion.case;
        if !(case.methods.is_empty() || case.methods.iter().any(|chosen| chosen == name)) {
            return;
        }
        let knobs: Vec<Knob> = if is_adaptive {
            TOLERANCES.map(Knob::Tolerance).to_vec()
        } else {
            STEPS.map(Knob::Step).to_vec()
        };
        for knob in knobs {
            let options = match knob {
                Knob::Step(h) => Options::fixed(h),
                Knob::Tolerance(tolerance) => Options::adaptive(tolerance, tolerance),
            };
            let Some(state) = self.advanced(method, self.state(&case.initial), SHORT, options) else {
                continue;
            };
            let error = Self::error(&state, &motion.end);
            let is_resolved = error < RESOLVED;
            if !is_resolved {
                continue;
            }
            let (evals, ns, run) = self.run(method, options, case);
            say(Measured { method: name, knob, error, evals, ns, run });
            if run.is_some_and(|run| run.energy < ROUND_OFF) {
                break;
            }
        }
    }
}

/// A line through points by least squares.
#[derive(Default)]
struct Line {
    n: f64,
    mean: [f64; 2],
    products: f64,
    squares: f64,
}

impl Line {
    fn add(&mut self, x: f64, y: f64) {
        self.n += 1.0;
        let dx = x - self.mean[0];
        self.mean[0] += dx / self.n;
        self.mean[1] += (y - self.mean[1]) / self.n;
        self.products += dx * (y - self.mean[1]);
        self.squares += dx * (x - self.mean[0]);
    }

    /// Its slope; zero for fewer than two points.
    fn slope(&self) -> f64 {
        if self.squares > 0.0 { self.products / self.squares } else { 0.0 }
    }
}

/// Names of all methods in the order in which they are run.
pub const METHODS: &[&str] = &[
    "rk4",
    "tsit5",
    "dop853",
    "vern9",
    "gbs14",
    "gbs14, fixed",
    "gauss4",
    "gauss6",
    "gauss8",
    "gauss16",
    "gauss16, projected",
    "taylor",
    "rk4, all velocities",
    "gauss4, all velocities",
    "dla",
    "dla, reflecting",
];

macro_rules! body {
    ($($path:ident)::+, $case:ident) => {
        Body::<$($path)::+::Prepared<f64>, $($path)::+::Prepared<DoubleDouble>>::new(&$case.params)?
    };
}

macro_rules! systems {
    (
        @of $home:ident $model:ident, $invariants:ident, $taylor:ident $(, $unreduced:ident)?;
        $case:ident $say:ident
    ) => {{
        use $home::generated;
        let body = body!(generated::$model, $case);
        let motion = Motion { case: $case, end: body.end(&$case.initial)? };
        let (m, say) = (&motion, &mut $say);
        body.sweep("rk4", Rk4, false, m, say);
        body.sweep("tsit5", Tsit5, true, m, say);
        body.sweep("dop853", Dop853, true, m, say);
        body.sweep("vern9", Vern9, true, m, say);
        body.sweep("gbs14", Gbs14, true, m, say);
        body.sweep("gbs14, fixed", Gbs14, false, m, say);
        body.sweep("gauss4", Gauss4::fixed_point(), false, m, say);
        body.sweep("gauss6", Gauss6::fixed_point(), false, m, say);
        body.sweep("gauss8", Gauss8::fixed_point(), false, m, say);
        body.sweep("gauss16", Gauss16, false, m, say);
        body!(generated::$invariants, $case).sweep(
            "gauss16, projected", Projected::<_, _>::new(Gauss16), false, m, say,
        );
        body!(generated::$taylor, $case).sweep("taylor", Taylor::new(), true, m, say);
        $({
            let body = body!(generated::$unreduced, $case);
            body.sweep("rk4, all velocities", Rk4, false, m, say);
            body.sweep("gauss4, all velocities", Gauss4::fixed_point(), false, m, say);
            body.sweep("dla", Dla::new(), false, m, say);
            body.sweep("dla, reflecting", Dla::reflecting(), false, m, say);
        })?
    }};
    ($($model:ident $n:literal, $invariants:ident $k:literal, $taylor:ident, $unreduced:ident $m:literal;)*) => {
        /// Names of the models: those of the benchmark, then bodies of the repository.
        pub const MODELS: &[&str] =
            &[$(stringify!($model),)* "chaplygin_ball", "snakeboard"];

        /// Measures every method on a case.
        ///
        /// # Errors
        /// An unknown model or method, numbers that the model does not have or does not allow, a motion that does not
        /// reach the end of the short time.
        pub fn measure(case: &Case, mut say: impl FnMut(Measured)) -> Result<(), String> {
            if let Some(name) = case.methods.iter().find(|name| !METHODS.contains(&name.as_str())) {
                return Err(format!("{name} is no method: choose of {}", METHODS.join("; ")));
            }
            match case.model.as_str() {
                $(stringify!($model) => {
                    systems!(@of crate $model, $invariants, $taylor, $unreduced; case say);
                })*
                "chaplygin_ball" => {
                    systems!(
                        @of hamel_models chaplygin_ball, chaplygin_ball_invariants, chaplygin_ball_taylor;
                        case say
                    );
                }
                "snakeboard" => {
                    systems!(@of hamel_models snakeboard, snakeboard_invariants, snakeboard_taylor; case say);
                }
                other => return Err(format!("{other} is not measured: choose of {}", MODELS.join(", "))),
            }
            Ok(())
        }
    };
}

for_each_system!(systems);

#[cfg(test)]
mod tests {
    use super::Line;

    #[test]
    fn a_line_has_the_slope_of_its_points() {
        let mut line = Line::default();
        assert_eq!(line.slope(), 0.0);
        for k in 0..10 {
            let x = f64::from(k);
            // Alternating errors that are orthogonal to the line but for the last digits.
            line.add(x, 3.0 * x - 2.0 + if k % 4 == 1 || k % 4 == 2 { 0.5 } else { -0.5 });
        }
        assert!((line.slope() - 3.0).abs() < 0.05, "{}", line.slope());
    }
}
