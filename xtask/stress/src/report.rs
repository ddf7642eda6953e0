//! Results as text, Markdown and CSV.
//!
//! Deliberately does not know: how they were measured.

use std::fmt::Write as _;

use crate::accuracy::{Accuracy, Multiples};
use crate::run::{Results, SceneResult, SweepResult};
use crate::sweeps::DISTANCES;

/// What is said before the tables.
const INTRODUCTION: &str = "\
# Stress tests

Written by `cargo xtask stress`; `stress.csv` and `stress_runs.csv` have the same numbers. `cargo xtask stress --short` repeats the first part with
fewer states and fails above pinned bounds.

Every generated function is evaluated in `f64` and, by the same operations, in double-double numbers (31 digits). Errors are
multiples of the machine epsilon 2.2e-16 times a scale:

- by *terms*: the largest term that entered the result. More than a few is a fault of the arithmetic.
- by *inputs*: `|f| + sum_i |df/dx_i| |x_i|` over parameters, state and time: what rounding the inputs would do to the exact
  function. A large multiple means that another way of writing the same function would have more digits.
";

const ACCURACY: &str = "
## Right-hand sides

Parameters within a factor 2 of the defaults. States: near the initial one, of order one, velocities from 1e-8 to 1e8,
coordinates and advected vectors closer than 1e-12 to the ends of their intervals and to axes, the same with velocities from
1e-8 to 1e8, velocities zero. Each cell: median, 99.9 % of the states, largest.
";

const OUTPUTS: &str = "
## Outputs and energy

The same at one state in eight.
";

const BUILT: &str = "
## Parameters 10^+-3

A machine that one builds is seldom the one of the defaults: every parameter times a factor from 1e-3 to 1e3 of its own, log-uniformly,
such that the conditions of the model hold; states as above. Each cell: median, 99.9 %, 99.99 % of the states, largest.
";

const EXTREME: &str = "
## Extreme parameters

Every parameter times a factor from 1e-8 to 1e8 of its own. *Rejected*: the parameters are refused with a reason. *Refused*: the
state is, by `check`. *Beyond*: next to underflow or beyond the range in which double-double numbers have digits. *Silent*: a result
that is not finite although `check` names no reason; the integrators stop there with `NonFinite`.
";

const SWEEPS: &str = "
## Ways towards singular places

States and parameters of order one, moved to the distance `d`. Each cell: largest error by inputs, and in parentheses the decimal
digits lost relative to the largest component of the derivative.
";

const RUNS: &str = "
## Long runs

Default parameters, from the model's initial state, in the scenes that want `invariants`: energy, Casimirs, momenta of the frame (`p_`) and in
space (`space_p_`), residuals of constraints, squares of unit vectors and of quaternions (`q_dot_q`), as far as they are proved to be
constant and are no functions of those before them. Slopes are those of least squares against time.
";

/// What the tables mean for the models.
const FINDINGS: &str = include_str!("findings.md");

/// A multiple in at most five characters.
fn short(x: f64) -> String {
    if x < 100.0 { format!("{x:.1}") } else { format!("{x:.0e}") }
}

fn cell(m: &Multiples) -> String {
    format!("{}, {}, {}", short(m.median()), short(m.most()), short(m.max()))
}

fn long_cell(m: &Multiples) -> String {
    format!("{}, {}, {}, {}", short(m.median()), short(m.most()), short(m.nearly_all()), short(m.max()))
}

fn title(scene: &SceneResult) -> String {
    format!("{} {}", scene.info.model, scene.info.scene)
}

/// Where the largest errors by inputs above [`LARGE`] are, and the first places without a result.
fn places(scenes: &[SceneResult], of: impl Fn(&SceneResult) -> &Accuracy) -> String {
    let mut text = String::new();
    for scene in scenes {
        let inputs = &of(scene).inputs;
        if let Some(worst) = inputs.worst.as_ref().filter(|_| inputs.max() > LARGE) {
            let _ = writeln!(
                text,
                "- {}, {} = {:e} instead of {}: `{}`",
                title(scene),
                worst.component,
                worst.value,
                worst.exact,
                worst.sample.request(&scene.info)
            );
        }
        if let Some((component, sample)) = &of(scene).first_silent {
            let request = sample.request(&scene.info);
            let _ = writeln!(text, "- {}, {component} is not finite: `{request}`", title(scene));
        }
    }
    text
}

const PLACES: &str = "\nWhere the largest errors by inputs above 64 are, as `cargo xtask eval` reads it:\n\n";
/// Errors are shown with their places from so many multiples on.
const LARGE: f64 = 64.0;

fn digits(accuracy: &Accuracy) -> String {
    if accuracy.measured() == 0 {
        return "refused".into();
    }
    format!("{} ({:.1})", short(accuracy.inputs.max()), accuracy.norm.max(1.0).log10())
}

fn sweep_rows(text: &mut String, sweeps: &[SweepResult]) {
    let shown: Vec<usize> = (0..DISTANCES.len()).filter(|k| k % 2 == 1 || *k == 0).collect();
    let heads: String = shown.iter().map(|k| format!(" {:e} |", DISTANCES[*k])).collect();
    let _ = writeln!(text, "\n| scene | way |{heads}\n|---|---|{}", "---|".repeat(shown.len()));
    for result in sweeps {
        let (model, scene) = result.sweep.scene;
        let cells: String = shown.iter().map(|k| format!(" {} |", digits(&result.at[*k]))).collect();
        let _ = writeln!(text, "| {model} {scene} | {} |{cells}", result.sweep.what);
    }
}

/// Right-hand sides, and outputs with energy, where parameters are moved by three decades.
fn built_rows(text: &mut String, results: &Results) {
    let parts = [
        (BUILT, (|s| &s.built) as fn(&SceneResult) -> &Accuracy),
        ("\nOutputs and energy, at one state in eight:\n", |s| &s.built_outputs),
    ];
    for (head, of) in parts {
        text.push_str(head);
        text.push_str(
            "\n| scene | by terms | by inputs | measured | rejected | refused | beyond |\n|---|---|---|---|---|---|---|\n",
        );
        for scene in &results.scenes {
            let a = of(scene);
            let _ = writeln!(
                text,
                "| {} | {} | {} | {} | {} | {} | {} |",
                title(scene),
                long_cell(&a.terms),
                long_cell(&a.inputs),
                a.measured(),
                a.rejected,
                a.refused,
                a.unmeasured
            );
        }
        text.push_str(PLACES);
        text.push_str(&places(&results.scenes, of));
    }
}

/// Everything as a page.
pub fn markdown(results: &Results, samples: u64) -> String {
    let n = samples * results.scenes.len() as u64;
    let mut text = format!("{INTRODUCTION}\n{samples} random states for each scene, {n} together.\n");
    for (head, of) in [(ACCURACY, (|s| &s.rhs) as fn(&SceneResult) -> &Accuracy), (OUTPUTS, |s| &s.outputs)] {
        text.push_str(head);
        text.push_str(
            "\n| scene | by terms | by inputs | measured | refused | beyond |\n|---|---|---|---|---|---|\n",
        );
        for scene in &results.scenes {
            let a = of(scene);
            let _ = writeln!(
                text,
                "| {} | {} | {} | {} | {} | {} |",
                title(scene),
                cell(&a.terms),
                cell(&a.inputs),
                a.measured(),
                a.refused,
                a.unmeasured
            );
        }
        text.push_str(PLACES);
        text.push_str(&places(&results.scenes, of));
    }
    built_rows(&mut text, results);
    text.push_str(EXTREME);
    text.push_str("\n| scene | by inputs | measured | rejected | refused | beyond | silent |\n|---|---|---|---|---|---|---|\n");
    for scene in &results.scenes {
        let a = &scene.extreme;
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {} | {} | {} |",
            title(scene),
            cell(&a.inputs),
            a.measured(),
            a.rejected,
            a.refused,
            a.unmeasured,
            a.silent
        );
    }
    text.push_str(PLACES);
    text.push_str(&places(&results.scenes, |s| &s.extreme));
    text.push_str(SWEEPS);
    sweep_rows(&mut text, &results.sweeps);
    text.push_str(RUNS);
    text.push_str("\n| scene | method | steps | t | quantity | at the start | largest drift | slope |\n|---|---|---|---|---|---|---|---|\n");
    for run in &results.runs {
        for drift in &run.drifts {
            let _ = writeln!(
                text,
                "| {} {} | {}, {} | {} | {:.3e} | {} | {:.3e} | {:.1e} | {:.1e} |",
                run.name.0,
                run.name.1,
                run.runner.name,
                run.runner.stepping,
                run.steps,
                run.t,
                drift.quantity,
                drift.start,
                drift.max,
                drift.slope
            );
        }
        if let Some(why) = &run.stopped {
            let _ = writeln!(
                text,
                "| {} {} | {}, {} | {} | {:.3e} | stopped: {why} | | | |",
                run.name.0, run.name.1, run.runner.name, run.runner.stepping, run.steps, run.t
            );
        }
    }
    text.push_str(FINDINGS);
    text
}

/// Errors as a table: one line per scene and function, or distance of a sweep.
pub fn csv(results: &Results) -> String {
    let mut text = String::from(
        "part,model,scene,what,measured,rejected,refused,beyond,silent,terms_median,terms_999,terms_max,\
         inputs_median,inputs_999,inputs_9999,inputs_max,norm_max\n",
    );
    let mut line = |part: &str, model: &str, scene: &str, what: &str, a: &Accuracy| {
        let _ = write!(
            text,
            "{part},{model},{scene},\"{what}\",{},{},{},{},{}",
            a.measured(),
            a.rejected,
            a.refused,
            a.unmeasured,
            a.silent
        );
        let (t, i) = (&a.terms, &a.inputs);
        let _ = write!(text, ",{:.4e},{:.4e},{:.4e}", t.median(), t.most(), t.max());
        let _ = write!(text, ",{:.4e},{:.4e},{:.4e},{:.4e}", i.median(), i.most(), i.nearly_all(), i.max());
        let _ = writeln!(text, ",{:.4e}", a.norm);
    };
    for scene in &results.scenes {
        let parts = [
            ("rhs", &scene.rhs),
            ("outputs", &scene.outputs),
            ("10^+-3", &scene.built),
            ("outputs 10^+-3", &scene.built_outputs),
            ("extreme", &scene.extreme),
        ];
        for (part, a) in parts {
            line(part, &scene.info.model, &scene.info.scene, "", a);
        }
    }
    for result in &results.sweeps {
        let (model, scene) = result.sweep.scene;
        for (distance, a) in DISTANCES.iter().zip(&result.at) {
            line("sweep", model, scene, &format!("{}; d = {distance:e}", result.sweep.what), a);
        }
    }
    text
}

/// The long runs as a table: one line per run and quantity.
pub fn runs_csv(results: &Results) -> String {
    let mut text = String::from("model,scene,method,steps,t,quantity,start,max,slope\n");
    for run in &results.runs {
        let (model, scene) = &run.name;
        for drift in &run.drifts {
            let _ = writeln!(
                text,
                "{model},{scene},\"{}; {}\",{},{:.6e},{},{:.6e},{:.4e},{:.4e}",
                run.runner.name,
                run.runner.stepping,
                run.steps,
                run.t,
                drift.quantity,
                drift.start,
                drift.max,
                drift.slope
            );
        }
    }
    text
}

/// The largest errors, one line per scene, and where they are.
pub fn detailed_summary(results: &Results) -> String {
    let mut text = summary(results);
    for (what, of) in [
        ("right-hand side", (|s| &s.rhs) as fn(&SceneResult) -> &Accuracy),
        ("outputs", |s| &s.outputs),
        ("parameters 10^+-3", |s| &s.built),
        ("outputs at parameters 10^+-3", |s| &s.built_outputs),
        ("extreme parameters", |s| &s.extreme),
    ] {
        let _ = write!(text, "\n{what}:\n{}", places(&results.scenes, of));
    }
    text
}

/// The errors, one line per scene.
pub fn summary(results: &Results) -> String {
    let heads = [
        ["", "largest by terms", "99.9 % / largest by inputs", "", "parameters 10^+-3", "", "extreme"],
        ["", "rhs, outputs", "rhs", "outputs", "rhs", "outputs", "inputs / silent"],
    ];
    let line = |cells: [&str; 7]| {
        let [title, cells @ ..] = cells;
        format!("{title:40}{}", cells.map(|cell| format!(" {cell:>17}")).concat())
    };
    let mut text = format!("multiples of epsilon\n{}\n{}", line(heads[0]), line(heads[1]));
    for scene in &results.scenes {
        let inputs = |a: &Accuracy| format!("{} / {}", short(a.inputs.most()), short(a.inputs.max()));
        let terms = format!("{} / {}", short(scene.rhs.terms.max()), short(scene.outputs.terms.max()));
        let [rhs, outputs, built, built_outputs] =
            [&scene.rhs, &scene.outputs, &scene.built, &scene.built_outputs].map(inputs);
        let extreme = format!("{} / {}", short(scene.extreme.inputs.max()), scene.extreme.silent);
        let title = title(scene);
        let _ =
            write!(text, "\n{}", line([&title, &terms, &rhs, &outputs, &built, &built_outputs, &extreme]));
    }
    for result in &results.sweeps {
        let (model, scene) = result.sweep.scene;
        let largest = result.at.iter().map(|a| a.inputs.max()).fold(0.0, f64::max);
        let _ = write!(text, "\n{model} {scene}, {}: {}", result.sweep.what, short(largest));
    }
    for run in &results.runs {
        let _ = write!(text, "\n{} {}, {} {}:", run.name.0, run.name.1, run.runner.name, run.runner.stepping);
        for drift in &run.drifts {
            let _ = write!(text, " {} {:.1e} ({:+.1e}/s)", drift.quantity, drift.max, drift.slope);
        }
        if let Some(why) = &run.stopped {
            let _ = write!(text, " stopped at t = {}: {why}", run.t);
        }
    }
    text
}
