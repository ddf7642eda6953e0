//! Evaluation and simulation of one scene, here or in another process.
//!
//! Deliberately does not know: how a request was written or where an answer goes.

use std::io::IsTerminal as _;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use crate::dynamics::{Factory, Info};
use crate::ensemble::{EnsembleRequest, Member, integrate};
use crate::error::Error;
use crate::eval::{EvalRequest, EvalResponse, eval};
use crate::simulate::{SimulateRequest, SimulateResponse, simulate};

/// A scene that answers requests.
pub trait Backend {
    /// Names and meanings.
    fn info(&self) -> &Info;

    /// Values at given states.
    ///
    /// # Errors
    /// As [`eval`].
    fn eval(&mut self, request: &EvalRequest) -> Result<EvalResponse, Error>;

    /// A solution from an initial state.
    ///
    /// # Errors
    /// As [`simulate`].
    fn simulate(&mut self, request: &SimulateRequest) -> Result<SimulateResponse, Error>;

    /// Solutions from many initial states, in their order.
    ///
    /// # Errors
    /// As [`integrate`].
    fn ensemble(&mut self, request: &EnsembleRequest) -> Result<Vec<Member>, Error>;
}

/// A scene of this process.
#[derive(Debug)]
pub struct Local<F> {
    factory: F,
}

impl<F: Factory> Local<F> {
    /// Answers with a factory's scene.
    pub fn new(factory: F) -> Local<F> {
        Local { factory }
    }
}

impl<F: Factory> Backend for Local<F> {
    fn info(&self) -> &Info {
        self.factory.info()
    }

    fn eval(&mut self, request: &EvalRequest) -> Result<EvalResponse, Error> {
        eval(&self.factory, request)
    }

    fn simulate(&mut self, request: &SimulateRequest) -> Result<SimulateResponse, Error> {
        simulate_with_bar(&self.factory, request)
    }

    fn ensemble(&mut self, request: &EnsembleRequest) -> Result<Vec<Member>, Error> {
        integrate(&self.factory, request)
    }
}

/// Integrates a scene under a progress bar, which appears on a terminal only, and only when it takes long.
///
/// # Errors
/// As [`simulate`].
pub fn simulate_with_bar(
    factory: &dyn Factory,
    request: &SimulateRequest,
) -> Result<SimulateResponse, Error> {
    if !std::io::stderr().is_terminal() {
        return simulate(factory, request, &mut |_| {});
    }
    let start = Instant::now();
    let mut bar: Option<ProgressBar> = None;
    let mut steps = 0_u64;
    let mut next_look = 64;
    let result = simulate(factory, request, &mut |t| {
        steps += 1;
        if steps < next_look {
            return;
        }
        next_look = steps + 64;
        if start.elapsed() < Duration::from_millis(400) {
            return;
        }
        let bar = bar.get_or_insert_with(|| {
            let bar = ProgressBar::new(1000);
            let template = "  {bar:40.cyan/blue} {percent:>3}%  {msg}  {eta} left";
            // The template is a constant that indicatif accepts.
            bar.set_style(ProgressStyle::with_template(template).expect("valid template"));
            bar
        });
        bar.set_position((1000.0 * t / request.t_final) as u64);
        bar.set_message(format!("t = {t:.4}, {steps} steps"));
    });
    if let Some(bar) = bar {
        bar.finish_and_clear();
    }
    result
}
