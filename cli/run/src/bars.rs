//! Integrations and fits under a progress bar.
//!
//! Does not know: how a request was written or where an answer goes.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use super::dynamics::Factory;
use super::fit::{Progress, Watch};
use super::integrate::simulate;
use super::simulation::{SimulateRequest, SimulateResponse};
use crate::error::Error;
use crate::signs::{self, Instead};

/// A fit under a line that tells how far the search is, on a terminal only.
///
/// # Errors
/// As the fit.
pub fn with_fit_bar<T>(fit: impl FnOnce(&mut Watch<'_>) -> Result<T, Error>) -> Result<T, Error> {
    let _instead = Instead::of_line();
    if !signs::are_shown() {
        return fit(&mut |_| ControlFlow::Continue(()));
    }
    let bar = ProgressBar::new_spinner();
    let template = "  {spinner} motion {pos}, sum of squares {msg}  {elapsed}";
    // The template is a constant that indicatif accepts.
    bar.set_style(ProgressStyle::with_template(template).expect("valid template"));
    let result = fit(&mut |progress| {
        if let Progress::Motion { n, sum_of_squares } = progress {
            bar.set_position(n as u64);
            if let Some(sum) = sum_of_squares.filter(|sum| sum.is_finite()) {
                bar.set_message(format!("{sum:.6e}"));
            }
        }
        ControlFlow::Continue(())
    });
    bar.finish_and_clear();
    result
}

/// Integrates a scene under a progress bar, which appears on a terminal only, and only when it takes long.
///
/// # Errors
/// As [`simulate`].
pub fn simulate_with_bar(
    factory: &dyn Factory,
    request: &SimulateRequest,
) -> Result<SimulateResponse, Error> {
    let _instead = Instead::of_line();
    if !signs::are_shown() {
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
        let elapsed = start.elapsed();
        if elapsed < Duration::from_millis(400) {
            return;
        }
        let bar = bar.get_or_insert_with(|| {
            let bar = ProgressBar::new(1000);
            let template = "  {bar:40} {percent:>3}%  {msg}";
            // The template is a constant that indicatif accepts.
            bar.set_style(ProgressStyle::with_template(template).expect("valid template"));
            bar
        });
        bar.set_position((1000.0 * t / request.t_final) as u64);
        bar.set_message(status(request, t, steps, elapsed));
    });
    if let Some(bar) = bar {
        bar.finish_and_clear();
    }
    result
}

/// Time and steps reached of all, and the time left if both go on as they did: until the end, or until the largest
/// number of steps where that comes first.
fn status(request: &SimulateRequest, t: f64, steps: u64, elapsed: Duration) -> String {
    let seconds = elapsed.as_secs_f64();
    let left = |done: f64| seconds * (1.0 / done - 1.0);
    let to_end = left(t / request.t_final);
    let to_limit = left(steps as f64 / request.max_steps as f64);
    let text = format!("t = {t:.4} of {:?}, {steps} steps", request.t_final);
    if to_end <= to_limit {
        return format!("{text}, {} left", duration(to_end));
    }
    format!("{text}, {} to the limit of {} steps", duration(to_limit), request.max_steps)
}

/// A time for people, in one unit.
fn duration(seconds: f64) -> String {
    const UNITS: [(f64, &str); 5] =
        [(365.25 * 86400.0, "years"), (86400.0, "days"), (3600.0, "h"), (60.0, "min"), (1.0, "s")];
    let (size, unit) = UNITS.into_iter().find(|(size, _)| seconds >= 2.0 * size).unwrap_or(UNITS[4]);
    // Never so many years, but a number that is not finite is no time.
    format!("{:.0} {unit}", (seconds / size).min(1e9))
}

#[cfg(test)]
mod tests {
    use crate::noise::Noise;
    use std::time::Duration;

    use super::status;
    use crate::method::{MethodName, Steps};
    use crate::simulation::{MAX_EVENTS, SimulateRequest};

    #[test]
    fn a_bar_says_what_is_left_of_time_or_of_steps() {
        let steps = Steps::Adaptive { rtol: 1e-10, atol: 1e-12, max: None };
        let request = |t_final, max_steps| SimulateRequest {
            params: Vec::new(),
            initial: vec![1.0],
            t_final,
            method: MethodName::Dop853,
            steps,
            samples: 0,
            with_outputs: false,
            n_group: 0,
            max_steps,
            max_events: MAX_EVENTS,
            watched: None,
            noise: Noise::default(),
            along: Vec::new(),
            tangents: Vec::new(),
        };
        let told =
            |t_final, max_steps, t| status(&request(t_final, max_steps), t, 1000, Duration::from_secs(10));
        assert_eq!(told(100.0, 50_000_000, 25.0), "t = 25.0000 of 100.0, 1000 steps, 30 s left");
        assert_eq!(told(-100.0, 50_000_000, -1.0), "t = -1.0000 of -100.0, 1000 steps, 16 min left");
        // At this speed the end would take a million years.
        let far = told(1e15, 1_000_000, 300.0);
        assert_eq!(far, "t = 300.0000 of 1000000000000000.0, 1000 steps, 3 h to the limit of 1000000 steps");
        assert!(
            told(1e15, u64::MAX, 300.0).ends_with("1056270 years left"),
            "{}",
            told(1e15, u64::MAX, 300.0)
        );
    }
}
