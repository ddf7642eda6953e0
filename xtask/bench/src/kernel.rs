//! A right-hand side behind a pointer, and how it is timed.
//!
//! Deliberately does not know: which right-hand sides there are.

use std::fmt;
use std::hint::black_box;
use std::time::{Duration, Instant};

use hamel_runtime::{Real, SceneInfo};

/// A right-hand side with what was prepared for it: `f(prepared, t, y, dy)`.
pub type Rhs<R, P, const N: usize> = fn(&P, R, &[R; N], &mut [R; N]);

/// Numbers of one lane that the inputs of a sweep hold at most, so that inputs and outputs stay in the first cache.
const SWEEP: usize = 64;

/// A right-hand side ready to be called.
pub struct Kernel {
    /// Name of the model.
    pub model: &'static str,
    /// Name of the scene.
    pub scene: &'static str,
    /// By what means it is written: `hamel`, `expert`, `naive`, `multipliers`, or `copy`.
    pub kind: &'static str,
    /// How many states one call evaluates side by side.
    pub lanes: usize,
    info: Option<&'static SceneInfo>,
    run: Box<dyn Run>,
}

/// Nanoseconds of one call.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timing {
    /// In the fastest round.
    pub min: f64,
    /// In the median round.
    pub median: f64,
    /// In the fastest round of calls each of which waits for the one before.
    pub chain: f64,
}

trait Run {
    /// Calls with every input once, `n` times over.
    fn sweep(&mut self, n: u64);
    /// As many calls as a sweep makes, each at the state to which the derivative before it led.
    fn chain(&mut self, n: u64);
    /// Inputs of a sweep.
    fn n_inputs(&self) -> u64;
    /// The derivative on the first lane for given parameters.
    fn evaluate(&self, params: &[f64], t: f64, y: &[f64]) -> Vec<f64>;
}

struct Typed<R, P, const N: usize> {
    make: fn(&[f64]) -> P,
    call: Rhs<R, P, N>,
    prepared: P,
    inputs: Vec<[R; N]>,
    outputs: Vec<[R; N]>,
}

impl Kernel {
    /// A kernel of a scene with the scene's default parameters, which the compiler is kept from knowing.
    ///
    /// `make` prepares `call` from parameters in the order of the scene; it may panic when they are not allowed.
    pub fn new<R: Real + 'static, P: 'static, const N: usize>(
        info: &'static SceneInfo,
        kind: &'static str,
        lanes: usize,
        make: fn(&[f64]) -> P,
        call: Rhs<R, P, N>,
    ) -> Kernel {
        let defaults: Vec<f64> = info.params.iter().map(|p| p.default).collect();
        let prepared = make(&black_box(defaults));
        let mut random = Random(20_261_121);
        // Inside (0, 1): every coordinate is in its domain there. Lanes see the same state, so none of them diverges.
        let state = |_| [(); N].map(|()| R::from_f64(random.between(0.05, 0.95)));
        let inputs: Vec<[R; N]> = (0..SWEEP / lanes).map(state).collect();
        let outputs = vec![[R::ZERO; N]; inputs.len()];
        let run = Box::new(Typed { make, call, prepared, inputs, outputs });
        Kernel { model: info.model, scene: info.scene, kind, lanes, info: Some(info), run }
    }

    /// Names of state and parameters; the copy kernel has none.
    pub fn info(&self) -> Option<&'static SceneInfo> {
        self.info
    }

    /// The derivative at a state for given parameters, in the orders of [`Kernel::info`].
    ///
    /// # Panics
    /// When the parameters are not allowed, or are not as many as the scene has, or the state has another dimension.
    pub fn evaluate(&self, params: &[f64], t: f64, y: &[f64]) -> Vec<f64> {
        self.run.evaluate(params, t, y)
    }

    /// Calls with every input once, `n` times over, and says how many calls that were.
    pub fn sweep(&mut self, n: u64) -> u64 {
        self.run.sweep(n);
        n * self.run.n_inputs()
    }
}

impl fmt::Display for Kernel {
    /// `model/scene/kind`, with the number of lanes where there are several.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}/{}", self.model, self.scene, self.kind)?;
        if self.lanes > 1 { write!(f, "-{}", self.lanes) } else { Ok(()) }
    }
}

impl<R: Real, P, const N: usize> Run for Typed<R, P, N> {
    fn sweep(&mut self, n: u64) {
        let call = black_box(self.call);
        let prepared = black_box(&self.prepared);
        let t = black_box(R::ZERO);
        for _ in 0..n {
            for (y, dy) in self.inputs.iter().zip(&mut self.outputs) {
                call(prepared, t, y, dy);
            }
            black_box(&mut self.outputs);
        }
    }

    fn chain(&mut self, n: u64) {
        let call = black_box(self.call);
        let prepared = black_box(&self.prepared);
        let (t, h) = (black_box(R::ZERO), black_box(R::from_f64(1e-9)));
        for _ in 0..n {
            // From the start again, so that the state stays where it is.
            let (mut y, mut dy) = (self.inputs[0], [R::ZERO; N]);
            for _ in 0..self.inputs.len() {
                call(prepared, t, &y, &mut dy);
                for (y, dy) in y.iter_mut().zip(dy) {
                    *y = dy.mul_add(h, *y);
                }
            }
            black_box(y);
        }
    }

    fn n_inputs(&self) -> u64 {
        self.inputs.len() as u64
    }

    fn evaluate(&self, params: &[f64], t: f64, y: &[f64]) -> Vec<f64> {
        let prepared = (self.make)(params);
        let y: [f64; N] = y.try_into().expect("the state has the dimension of the scene");
        let mut dy = [R::ZERO; N];
        (self.call)(&prepared, R::from_f64(t), &y.map(R::from_f64), &mut dy);
        dy.map(number).to_vec()
    }
}

/// Parameters as the array that the generated `Params::from_array` takes.
///
/// # Panics
/// When there are not `N`.
pub fn params<const N: usize>(values: &[f64]) -> [f64; N] {
    values.try_into().expect("one value for each parameter")
}

/// The value of a number whose lanes are all the same.
fn number<R: Real>(x: R) -> f64 {
    if R::ZERO.all_gt(x) { -x.magnitude() } else { x.magnitude() }
}

/// Copies six numbers through the same call: what a measurement costs besides the right-hand side.
pub fn copy() -> Kernel {
    #[inline(never)]
    fn call(_: &(), _: f64, y: &[f64; 6], dy: &mut [f64; 6]) {
        *dy = *y;
    }
    const NONE: SceneInfo = SceneInfo::new("-", "-", &[]);
    Kernel { info: None, ..Kernel::new(&NONE, "copy", 1, |_| (), call) }
}

/// Times kernels in rounds, each round all of them in turn, so that a change of the clock meets them alike.
///
/// One round of a kernel takes about `length`, and its chain of calls as often as it is called there. After each round
/// `done` is called.
pub fn time(kernels: &mut [Kernel], rounds: usize, length: Duration, mut done: impl FnMut()) -> Vec<Timing> {
    let n_sweeps: Vec<u64> = kernels.iter_mut().map(|k| sweeps_in(k, length)).collect();
    let mut times = vec![Vec::with_capacity(rounds); kernels.len()];
    let mut chains = vec![f64::INFINITY; kernels.len()];
    for _ in 0..rounds {
        let rest = times.iter_mut().zip(&mut chains);
        for ((kernel, n), (times, chain)) in kernels.iter_mut().zip(&n_sweeps).zip(rest) {
            let clock = Instant::now();
            let n_calls = kernel.sweep(*n);
            times.push(clock.elapsed().as_secs_f64() * 1e9 / n_calls as f64);
            let clock = Instant::now();
            kernel.run.chain(*n);
            *chain = chain.min(clock.elapsed().as_secs_f64() * 1e9 / n_calls as f64);
        }
        done();
    }
    times.iter_mut().zip(chains).map(|(times, chain)| Timing::of(times, chain)).collect()
}

fn sweeps_in(kernel: &mut Kernel, length: Duration) -> u64 {
    let mut n = 1;
    loop {
        // The fastest of several: one that was interrupted would make all rounds too short to be timed.
        let mut elapsed = Duration::MAX;
        for _ in 0..5 {
            let clock = Instant::now();
            kernel.sweep(n);
            elapsed = elapsed.min(clock.elapsed());
        }
        if 8 * elapsed > length {
            let wanted = n as f64 * length.as_secs_f64() / elapsed.as_secs_f64();
            return (wanted.round() as u64).max(1);
        }
        n *= 2;
    }
}

impl Timing {
    fn of(times: &mut [f64], chain: f64) -> Timing {
        times.sort_by(f64::total_cmp);
        let at = |k: usize| times.get(k).copied().unwrap_or(f64::NAN);
        Timing { min: at(0), median: at(times.len() / 2), chain }
    }
}

/// SplitMix64 (Steele, Lea, Flood 2014).
struct Random(u64);

impl Random {
    fn between(&mut self, from: f64, to: f64) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        from + (to - from) * ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }
}
