//! A path through a singular position is held to the equations: deliberate faults in it are refused.

use std::sync::Arc;

use hamel_runtime::{Dop853, Integrator, Options};

use super::legendre::Series;
use super::{Attempt, NOT_KEPT, NOT_SMOOTH, Point, Refusal, Way, find};
use crate::cache::Cache;
use crate::dynamics::{Factory as _, VecState};
use crate::interpreted;
use crate::model::Checked;
use crate::session::Session;

/// A slider-crank of equal bars: where the crank stands upright, the slider may go on or stay at the hinge.
const CRANK: &str = "model crank {
    coordinate x, y, s in real;
    constraint crank: x^2 + y^2 = 1;
    constraint rod: (s - x)^2 + y^2 = 1;
    multipliers;
    lagrangian = (x_dot^2 + y_dot^2 + s_dot^2)/2 - y;
    initial x = 1; initial s = 2; initial y_dot = 2; initial x_dot = 0; initial s_dot = 0;
}";

/// States and rates of a path, changed at every place.
fn changed(series: &Series, attempt: &Attempt, change: impl Fn(f64, &mut Vec<f64>)) -> Series {
    let nodes = &attempt.solved.nodes;
    let rows = nodes.places.iter().map(|x| {
        let mut row = series.at(*x);
        change(*x, &mut row);
        row
    });
    nodes.interpolated(&rows.collect::<Vec<_>>())
}

#[test]
fn deliberate_faults_in_a_path_are_refused() {
    let model = Session::of_shipped(&[]).parse("crank", CRANK).unwrap_or_else(|e| panic!("{e}"));
    let model = Arc::new(Checked::new(model, Cache::none()));
    let built = interpreted::build(&model, "default").unwrap_or_else(|e| panic!("{e}"));
    let scene = built.prepare(&[]).unwrap_or_else(|e| panic!("{e:?}"));
    let options = Options::adaptive(1e-11, 1e-12);
    let start = vec![1.0, 0.0, 2.0, 0.0, 2.0, 0.0];
    let mut solver = Integrator::new(&scene, Dop853, 0.0, VecState(start.clone()), options).unwrap();
    let mut marks: Vec<Point> = vec![(0.0, start)];
    // The crank stands upright at the time 1.67.
    for k in 1..17 {
        let t = 0.1 * f64::from(k);
        solver.integrate_to(t).unwrap();
        marks.push((t, solver.state().0.clone()));
    }
    let (rtol, lengths) = (Some(1e-11), Vec::new());
    let mut way = Way { scene: &scene, method: Dop853, options, rtol, step: None, evaluations: 0, lengths };
    let found = find(&mut way, &marks, 1.7, false).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(found.n_lost, 1);
    let half = (found.ends[1] - found.ends[0]) / 2.0;
    let mut held = |fault: &dyn Fn(&mut Attempt)| -> Result<(), Refusal> {
        let mut attempt = way.attempt(&marks, (found.t, half), false)?;
        fault(&mut attempt);
        way.hold(attempt, 1e-10).map(|_| ())
    };
    assert_eq!(held(&|_| {}), Ok(()));
    // The slider, off the equations by a part of its way; the other branch, on which it stays.
    let off = held(&|a| a.solved.motion = changed(&a.solved.motion, a, |x, y| y[2] += 1e-6 * x));
    assert_eq!(off, Err(NOT_SMOOTH));
    let other = held(&|a| {
        let stays = |x: f64, y: &mut Vec<f64>| {
            if x > 0.0 {
                (y[2], y[5]) = (0.0, 0.0);
            }
        };
        a.solved.motion = changed(&a.solved.motion, a, stays);
    });
    assert_eq!(other, Err(NOT_SMOOTH));
    // Rates that the motion does not have; a motion on the equations that is too slow, as all of it is.
    let rates = held(&|a| a.solved.rates = changed(&a.solved.rates, a, |x, y| y[4] += 1e-6 * x));
    assert_eq!(rates, Err(NOT_SMOOTH));
    let slow = held(&|a| {
        let slow = |_: f64, y: &mut Vec<f64>| y[3..].iter_mut().for_each(|v| *v *= 0.999);
        a.solved.motion = changed(&a.solved.motion, a, slow);
    });
    assert_eq!(slow, Err(NOT_SMOOTH));
    // The energy of another motion before.
    let faster = held(&|a| a.start[3..].iter_mut().for_each(|v| *v *= 1.001));
    assert_eq!(faster, Err(NOT_KEPT));
}
