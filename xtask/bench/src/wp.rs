//! Whole integrations by the methods of the runtime and by those of other crates, to be
//! timed against the error at the end.
//!
//! The others integrate the generated right-hand side, so that only the integrator differs, and in one more row the one
//! by vector algebra. Whoever integrates makes a new solver for each solution, as a user does, with `rtol = atol` and
//! no other setting than a limit on steps; right-hand sides are inlined wherever the compiler likes to.
//!
//! Deliberately does not know: where problems come from, how results are shown.

use std::collections::BTreeMap;
use std::hint::black_box;
use std::rc::Rc;
use std::time::{Duration, Instant};

use hamel_runtime::{
    Circles, Dop853, Dopri5, F64x4, F64x8, Gauss4, Gauss6, Gauss8, Gauss16, Gbs14, Integrator, Jet, Method,
    OnCircles, Options, OverScalar, Real, Scene, Stats, System, Taylor, Tsit5, Vern9,
};

use crate::kernel;

/// What to integrate.
#[derive(Clone, Debug)]
pub struct Problem {
    /// Name of the model.
    pub model: String,
    /// Parameters of its default scene.
    pub params: Numbers,
    /// Time to reach from zero.
    pub t_end: f64,
    /// State at time zero.
    pub initial: Numbers,
}

/// Numbers by name.
pub type Numbers = BTreeMap<String, f64>;

/// Values of `names` in order.
///
/// # Errors
/// The first name without a value.
fn in_order<'a>(numbers: &Numbers, names: impl IntoIterator<Item = &'a str>) -> Result<Vec<f64>, String> {
    let value = |name| numbers.get(name).copied().ok_or_else(|| format!("no value for {name}"));
    names.into_iter().map(value).collect()
}

/// What a solution took besides time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Work {
    /// Evaluations of the right-hand side, or expansions of the solution.
    pub evals: u64,
    /// Steps, rejected ones included.
    pub steps: u64,
}

/// Integrates with a tolerance or a number of steps and writes the last state.
type Solve = dyn Fn(f64, &mut [f64]) -> Option<Work>;

/// A way to integrate a problem.
pub struct Solver {
    /// By what: `hamel`, or another crate.
    pub by: &'static str,
    /// Name of the method.
    pub method: &'static str,
    /// Whether the knob is a number of steps instead of a tolerance.
    pub has_fixed_steps: bool,
    /// Equal trajectories that it integrates side by side; its time is one's share.
    lanes: u32,
    solve: Box<Solve>,
}

/// All ways to integrate a problem.
pub struct Solvers {
    /// Names of the components of the state in order.
    pub state: &'static [&'static str],
    /// The ways.
    pub all: Vec<Solver>,
}

/// A solution that was timed.
#[derive(Clone, Debug, PartialEq)]
pub struct Point {
    /// Position of the solver.
    pub solver: usize,
    /// Tolerance or number of steps.
    pub knob: f64,
    /// `max_i |dy_i| / (1 + |y_i|)` at the end.
    pub error: f64,
    /// The work.
    pub work: Work,
    /// Nanoseconds of the fastest solution, of a lane of several.
    pub ns: f64,
}

/// Most steps of one solution.
const MAX_STEPS: u64 = 100_000;

/// Where and when an integration starts and ends.
#[derive(Clone, Copy)]
struct Span<const N: usize> {
    initial: [f64; N],
    t_end: f64,
}

impl From<Stats> for Work {
    fn from(stats: Stats) -> Work {
        Work { evals: stats.rhs_evals, steps: stats.steps + stats.rejected }
    }
}

fn solver<const N: usize>(
    (by, method): (&'static str, &'static str),
    span: Span<N>,
    has_fixed_steps: bool,
    solve: impl Fn(Span<N>, f64) -> Option<([f64; N], Work)> + 'static,
) -> Solver {
    let solve = move |knob: f64, out: &mut [f64]| {
        let (last, work) = solve(black_box(span), knob)?;
        out.copy_from_slice(&last);
        Some(work)
    };
    Solver { by, method, has_fixed_steps, lanes: 1, solve: Box::new(solve) }
}

fn adaptive(tolerance: f64) -> Options<f64> {
    Options::adaptive(tolerance, tolerance).with_max_steps(MAX_STEPS)
}

/// A method of the runtime.
fn runge_kutta<S, M, const N: usize>(name: &'static str, scene: &Rc<S>, span: Span<N>, method: M) -> Solver
where
    S: System<f64, State = [f64; N]> + 'static,
    M: Method<f64, S> + 'static,
{
    let (scene, has_fixed_steps) = (Rc::clone(scene), M::TABLEAU.estimate_order().is_none());
    solver(("hamel", name), span, has_fixed_steps, move |span, knob| {
        let options = if has_fixed_steps { Options::fixed(span.t_end / knob) } else { adaptive(knob) };
        let mut solver = Integrator::new(&*scene, method, 0.0, span.initial, options).ok()?;
        solver.integrate_to(span.t_end).ok()?;
        Some((*solver.state(), solver.stats().into()))
    })
}

fn taylor<S: Jet<f64, State = [f64; N]> + 'static, const N: usize>(scene: S, span: Span<N>) -> Solver {
    solver(("hamel", "taylor"), span, false, move |span, knob| {
        let mut solver = Integrator::new(&scene, Taylor::new(), 0.0, span.initial, adaptive(knob)).ok()?;
        solver.integrate_to(span.t_end).ok()?;
        Some((*solver.state(), solver.stats().into()))
    })
}

fn of_runtime<S: OverScalar<F64x4, State = [f64; N]> + 'static, const N: usize>(
    scene: &Rc<S>,
    span: Span<N>,
) -> Vec<Solver> {
    vec![
        runge_kutta("tsit5", scene, span, Tsit5),
        runge_kutta("dopri5", scene, span, Dopri5),
        runge_kutta("dop853", scene, span, Dop853),
        runge_kutta("vern9", scene, span, Vern9),
        runge_kutta("gbs14", scene, span, Gbs14),
        runge_kutta("gauss4", scene, span, Gauss4::fixed_point()),
        runge_kutta("gauss6", scene, span, Gauss6::fixed_point()),
        runge_kutta("gauss8", scene, span, Gauss8::fixed_point()),
        runge_kutta("gauss16", scene, span, Gauss16),
    ]
}

/// The fastest of them with the angles of the scene as points of circles within the steps.
fn on_circles<S, const N: usize>(scene: &Rc<S>, span: Span<N>) -> Vec<Solver>
where
    S: Circles<f64, Inside: OverScalar<F64x4>> + OverScalar<F64x4, State = [f64; N]> + 'static,
{
    vec![
        runge_kutta("vern9 on circles", scene, span, OnCircles::new(Vern9)),
        runge_kutta("gbs14 on circles", scene, span, OnCircles::new(Gbs14)),
    ]
}

/// Scenes without angles in their right-hand sides have none of these.
fn as_numbers<S, const N: usize>(_scene: &Rc<S>, _span: Span<N>) -> Vec<Solver> {
    Vec::new()
}

/// Lanes of the rows `.. in 8 lanes`.
const LANES: u32 = 8;

/// What becomes of the angles of a scene whose lanes are trajectories.
mod lanes {
    use hamel_runtime::{Circles, F64x8, Gbs14, OnCircles, System, Vern9};

    use super::{Solver, Span, side_by_side};

    /// As points of circles within the steps.
    pub(super) fn on_circles<S, const N: usize>(scene: S, span: Span<N>) -> Vec<Solver>
    where
        S: Circles<F64x8> + System<F64x8, State = [F64x8; N]> + Clone + 'static,
    {
        vec![
            side_by_side("vern9 on circles in 8 lanes", scene.clone(), span, OnCircles::new(Vern9)),
            side_by_side("gbs14 on circles in 8 lanes", scene, span, OnCircles::new(Gbs14)),
        ]
    }

    /// As numbers, as ever.
    pub(super) fn as_numbers<S, const N: usize>(_scene: S, _span: Span<N>) -> Vec<Solver> {
        Vec::new()
    }
}

/// A method on eight lanes, all with the trajectory of the problem.
fn side_by_side<S, M, const N: usize>(name: &'static str, scene: S, span: Span<N>, method: M) -> Solver
where
    S: System<F64x8, State = [F64x8; N]> + 'static,
    M: Method<F64x8, S> + Copy + 'static,
{
    let solver = solver(("hamel", name), span, false, move |span, knob| {
        let (time, tolerance) = (F64x8::from_f64, F64x8::from_f64(knob));
        let options = Options::adaptive(tolerance, tolerance).with_max_steps(MAX_STEPS);
        let mut solver = Integrator::new(&scene, method, time(0.0), span.initial.map(time), options).ok()?;
        solver.integrate_to(time(span.t_end)).ok()?;
        Some((solver.state().map(|x| x.lane(0)), solver.stats().into()))
    });
    Solver { lanes: LANES, ..solver }
}

/// Integrators of other crates.
mod others {
    use differential_equations::ivp::IVP;
    use differential_equations::methods::ExplicitRungeKutta;
    use differential_equations::ode::ODE;
    use ode_solvers::{OutputType, SVector};

    use super::{MAX_STEPS, Solver, Span, Work, solver};

    /// A right-hand side as the crates want it.
    #[derive(Clone)]
    struct Rhs<F>(F);

    impl<F: Fn(f64, &[f64; N], &mut [f64; N]), const N: usize> ODE<f64, [f64; N]> for Rhs<F> {
        #[inline]
        fn diff(&self, t: f64, y: &[f64; N], dy: &mut [f64; N]) {
            (self.0)(t, y, dy);
        }
    }

    impl<F: Fn(f64, &[f64; N], &mut [f64; N]), const N: usize> ode_solvers::System<f64, SVector<f64, N>>
        for Rhs<F>
    {
        #[inline]
        fn system(&self, t: f64, y: &SVector<f64, N>, dy: &mut SVector<f64, N>) {
            (self.0)(t, &y.data.0[0], &mut dy.data.0[0]);
        }
    }

    /// `ode_solvers`, which keeps the states after all steps.
    macro_rules! ode_solvers {
        ($name:expr, $method:ident, $rhs:expr, $span:expr) => {{
            let rhs = Rhs($rhs);
            solver($name, $span, false, move |span: Span<N>, tolerance| {
                let start = SVector::from(span.initial);
                let mut solver = ode_solvers::$method::new(
                    rhs.clone(),
                    0.0,
                    span.t_end,
                    span.t_end,
                    start,
                    tolerance,
                    tolerance,
                );
                solver.set_output(OutputType::Sparse);
                let stats = solver.integrate().ok()?;
                let steps = stats.accepted_steps + stats.rejected_steps;
                let last = solver.y_out().last()?.data.0[0];
                Some((last, Work { evals: stats.num_eval.into(), steps: steps.into() }))
            })
        }};
    }

    /// `differential-equations`, which keeps them as well.
    macro_rules! differential_equations {
        ($method:ident, $rhs:expr, $span:expr) => {{
            let rhs = Rhs($rhs);
            solver(
                ("differential-equations", stringify!($method)),
                $span,
                false,
                move |span: Span<N>, tolerance| {
                    let method = ExplicitRungeKutta::$method()
                        .rtol(tolerance)
                        .atol(tolerance)
                        .max_steps(MAX_STEPS as usize);
                    let solution =
                        IVP::ode(&rhs, 0.0, span.t_end, span.initial).method(method).solve().ok()?;
                    let steps = solution.steps.total() as u64;
                    Some((*solution.y.last()?, Work { evals: solution.evals.function as u64, steps }))
                },
            )
        }};
    }

    /// All of them with a right-hand side.
    pub(super) fn solvers<const N: usize>(
        rhs: impl Fn(f64, &[f64; N], &mut [f64; N]) + Clone + 'static,
        span: Span<N>,
    ) -> Vec<Solver> {
        vec![
            ode_solvers!(("ode_solvers", "dop853"), Dop853, rhs.clone(), span),
            ode_solvers!(("ode_solvers", "dopri5"), Dopri5, rhs.clone(), span),
            differential_equations!(dop853, rhs.clone(), span),
            differential_equations!(rkv877e, rhs.clone(), span),
            differential_equations!(rkv988e, rhs, span),
        ]
    }

    /// The fastest of them for most problems with another right-hand side.
    pub(super) fn by_vector_algebra<const N: usize>(
        rhs: impl Fn(f64, &[f64; N], &mut [f64; N]) + Clone + 'static,
        span: Span<N>,
    ) -> Solver {
        ode_solvers!(("ode_solvers, vector algebra", "dop853"), Dop853, rhs, span)
    }
}

/// Calls the macro with the models that are measured, the module of their scene with Taylor series, their dimension,
/// and what becomes of their angles.
macro_rules! for_each_model {
    ($visit:ident) => {
        $visit! {
            heavy_top heavy_top_taylor 6 as_numbers,
            euler_disk euler_disk_taylor 5 on_circles,
            chaplygin_ball chaplygin_ball_taylor 6 as_numbers,
            two_arm_satellite two_arm_satellite_taylor 7 on_circles,
            snakeboard snakeboard_taylor 5 on_circles,
        }
    };
}

macro_rules! models {
    ($($model:ident $taylor:ident $n:literal $angles:ident,)*) => {
        /// Names of the models that can be measured.
        pub const MODELS: &[&str] = &[$(stringify!($model)),*];

        /// All ways to integrate a problem.
        ///
        /// # Errors
        /// An unknown model, numbers that it does not have or does not allow.
        pub fn solvers(problem: &Problem) -> Result<Solvers, String> {
            match problem.model.as_str() {
                $(stringify!($model) => {
                    use hamel_models::generated::{$model, $taylor};
                    let info = &$model::INFO;
                    let params = in_order(&problem.params, info.params.iter().map(|p| p.name))?;
                    let initial = in_order(&problem.initial, info.state.iter().copied())?;
                    let span = Span::<$n> { initial: kernel::params(&initial), t_end: problem.t_end };
                    let prepare = |e| format!("{}: {e}", problem.model);
                    let scene = <$model::Prepared<f64> as Scene<f64>>::prepare(&params).map_err(prepare)?;
                    let scene = Rc::new(scene);
                    let mut solvers = of_runtime(&scene, span);
                    solvers.extend($angles(&scene, span));
                    let series = <$taylor::Prepared<f64> as Scene<f64>>::prepare(&params);
                    solvers.push(taylor(series.map_err(prepare)?, span));
                    let params_in_lanes: Vec<F64x8> = params.iter().map(|x| F64x8::from_f64(*x)).collect();
                    let scenes = (
                        <$model::Prepared<F64x8> as Scene<F64x8>>::prepare(&params_in_lanes),
                        <$taylor::Prepared<F64x8> as Scene<F64x8>>::prepare(&params_in_lanes),
                    );
                    let in_lanes = scenes.0.map_err(prepare)?;
                    solvers.push(side_by_side("vern9 in 8 lanes", in_lanes.clone(), span, Vern9));
                    let taylor = scenes.1.map_err(prepare)?;
                    solvers.push(side_by_side("gbs14 in 8 lanes", in_lanes.clone(), span, Gbs14));
                    solvers.extend(lanes::$angles(in_lanes, span));
                    solvers.push(side_by_side("taylor in 8 lanes", taylor, span, Taylor::new()));
                    let rhs = move |t: f64, y: &[f64; $n], dy: &mut [f64; $n]| scene.rhs(t, y, dy);
                    solvers.extend(others::solvers(rhs, span));
                    let params = $model::Params::from_array(kernel::params(&params));
                    let naive = move |t: f64, y: &[f64; $n], dy: &mut [f64; $n]| {
                        crate::naive::$model::rhs(&params, t, y, dy);
                    };
                    solvers.push(others::by_vector_algebra(naive, span));
                    Ok(Solvers { state: info.state, all: solvers })
                })*
                other => Err(format!("{other} is not measured: choose of {}", MODELS.join(", "))),
            }
        }
    };
}

for_each_model!(models);

impl Solvers {
    /// Forgets who integrates one trajectory at a time.
    pub fn keep_lanes(&mut self) {
        self.all.retain(|solver| solver.lanes > 1);
    }
}

impl Solver {
    /// Integrates with a tolerance or a number of steps, writes the last state and says what it took; nothing when it
    /// did not reach the end.
    pub fn solve(&self, knob: f64, last: &mut [f64]) -> Option<Work> {
        (self.solve)(black_box(knob), last)
    }

    /// The sweep: tolerances by decades, or numbers of steps by factors of two.
    fn knobs(&self) -> Vec<f64> {
        if self.has_fixed_steps {
            (3..15).map(|k| 2_f64.powi(k)).collect()
        } else {
            // As they are written, not as powers computed.
            (3..16).filter_map(|k| format!("1e-{k}").parse().ok()).collect()
        }
    }
}

/// `max_i |dy_i| / (1 + |y_i|)`.
fn error(found: &[f64], last: &[f64]) -> f64 {
    let errors = found.iter().zip(last).map(|(x, y)| (x - y).abs() / (1.0 + y.abs()));
    errors.fold(0.0, |max, e| if e.is_nan() || e > max { e } else { max })
}

/// Solutions slower than this are repeated in the first rounds only: no fair comparison needs more of them.
const SLOW: Duration = Duration::from_millis(2);
const ROUNDS_OF_SLOW: usize = 3;

/// Times all solvers over their sweeps in rounds, each round all of them in turn, so that a change of the clock meets
/// them alike. One round of a solution takes about `length`, or one solution. After each round `done` is called.
///
/// # Errors
/// A component of the state that `last`, the state at the end from elsewhere, lacks.
pub fn time(
    solvers: &Solvers,
    last: &Numbers,
    rounds: usize,
    length: Duration,
    mut done: impl FnMut(),
) -> Result<Vec<Point>, String> {
    let last = in_order(last, solvers.state.iter().copied())?;
    let mut state = last.clone();
    let mut points = Vec::new();
    for (k, solver) in solvers.all.iter().enumerate() {
        for knob in solver.knobs() {
            let clock = Instant::now();
            let Some(work) = solver.solve(knob, &mut state) else { continue };
            let ns = clock.elapsed().as_secs_f64() * 1e9 / f64::from(solver.lanes);
            let error = error(&state, &last);
            if error.is_finite() {
                points.push(Point { solver: k, knob, error, work, ns });
            }
        }
    }
    for round in 0..rounds {
        for point in &mut points {
            let solver = &solvers.all[point.solver];
            let of_all = point.ns * f64::from(solver.lanes);
            if of_all > SLOW.as_secs_f64() * 1e9 && round >= ROUNDS_OF_SLOW {
                continue;
            }
            let n = ((length.as_secs_f64() * 1e9 / of_all) as u32).max(1);
            let clock = Instant::now();
            for _ in 0..n {
                black_box(solver.solve(point.knob, &mut state));
            }
            point.ns = point.ns.min(clock.elapsed().as_secs_f64() * 1e9 / f64::from(n * solver.lanes));
        }
        done();
    }
    Ok(points)
}
