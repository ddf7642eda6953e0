//! FMUs where a motion cannot go on, or not begin, as they are told: an error, and no number.

use std::path::PathBuf;
use std::process::{Command, Stdio};

use hamel_codegen::scene::{self, Scenes, Writing};
use hamel_codegen::spec;

/// An FMU beside a program that moves it.
struct Moved {
    program: PathBuf,
    token: String,
    n_states: usize,
    n_events: usize,
}

impl Moved {
    /// Of the default scene, by `cosimulation` or `model_exchange`; nothing without a C compiler.
    fn new(name: &str, text: &str, driver: &str) -> Option<Moved> {
        let is_there =
            Command::new("cc").arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
        if !is_there.is_ok_and(|status| status.success()) {
            println!("no C compiler: FMUs are not tried");
            return None;
        }
        let model = spec::parse("m", text).unwrap_or_else(|e| panic!("{e}"));
        let mut scenes = Scenes::new(&model).with_positions(true);
        let built = scenes.build(scene::DEFAULT).unwrap_or_else(|e| panic!("{e}"));
        let initial = scene::start(&model, &built).unwrap_or_else(|e| panic!("{e}"));
        let (c, fmu) = built.emit_fmu(&Writing::default(), initial).unwrap_or_else(|e| panic!("{e}"));
        let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("fmu_{name}_{driver}"));
        std::fs::create_dir_all(&folder).unwrap();
        for (file, text) in [("m.h", &c.header), ("m.c", &c.source), ("m_fmu.c", &fmu.source)] {
            std::fs::write(folder.join(file), text).unwrap();
        }
        let path = format!("{}/tests/events/{driver}.c", env!("CARGO_MANIFEST_DIR"));
        let mut compiler = Command::new("cc");
        compiler.args(["-std=c99", "-O1", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror", "-o", "run"]);
        let out = compiler.args(["m.c", "m_fmu.c", &path, "-lm"]).current_dir(&folder).output().unwrap();
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        let token = fmu.source.split("FMU_TOKEN \"").nth(1).and_then(|rest| rest.split('"').next()).unwrap();
        let n_events =
            fmu.source.split("FMU_EVENTS = ").nth(1).and_then(|rest| rest.split(' ').next()).unwrap();
        Some(Moved {
            program: folder.join("run"),
            token: token.to_owned(),
            n_states: built.state_names().len(),
            n_events: n_events.parse().unwrap(),
        })
    }

    /// What it tells of a motion.
    fn to(&self, t_final: f64, step: f64, further: &[&str]) -> String {
        let numbers = [t_final.to_string(), step.to_string(), self.n_states.to_string()];
        let out = Command::new(&self.program).arg(&self.token).args(numbers).args(further).output().unwrap();
        assert!(out.status.success(), "{out:?}");
        String::from_utf8(out.stdout).unwrap()
    }

    /// The same where an importer makes the steps.
    fn exchanged(&self, t_final: f64, step: f64) -> String {
        self.to(t_final, step, &[&self.n_events.to_string()])
    }
}

/// The time and the state.
fn numbers(told: &str) -> Vec<f64> {
    told.lines().filter_map(|line| line.parse().ok()).collect()
}

/// An importer looks for events at the ends of its steps alone.
#[test]
fn a_ball_does_not_fall_through_the_floor() {
    let ball = "model m { coordinate z in real; lagrangian = z_dot^2/2 - 10*z;
        event hit = z falling { then z_dot = -z_dot/2; } initial z = 5; initial z_dot = 0; }";
    let Some(fmu) = Moved::new("ball", ball, "model_exchange") else { return };
    for step in [0.003, 0.03] {
        // It falls for a second, flies for one, then for half a second.
        let told = fmu.exchanged(2.6, step);
        let (found, flown) = (numbers(&told), 0.1);
        assert!(told.starts_with("reached"), "{step}: {told}");
        assert!((found[1] - flown * (1.25 - 5.0 * flown)).abs() < 1e-9, "{step}: {told}");
        assert!((found[2] - (1.25 - 10.0 * flown)).abs() < 1e-9, "{step}: {told}");
        // It comes to rest after three seconds.
        let told = fmu.exchanged(10.0, step);
        assert!(
            told.contains("failed: a step has passed an event") && told.contains("stopped"),
            "{step}: {told}"
        );
        assert!(numbers(&told)[1].abs() < 1e-2, "{step}: {told}");
    }
}

/// A body on the ground, which a force lifts when it is larger than the weight: of an input and of a parameter, at the
/// start, where `hamel simulate` does not begin either, and on the way.
#[test]
fn a_condition_that_inputs_make_true_happens() {
    let text = "model m { KIND F = 5; coordinate z in real; lagrangian = z_dot^2/2 - 10*z; force z_dot = F;
        mode ground { constraint n: z = 0; event lift when lambda_n < 0 { leave ground; } }
        initial z = 0; initial z_dot = 0; initial ground = 1; scene default { want rhs, events; SCENE } }";
    for (kind, scene) in [("param", ""), ("input", "input F;")] {
        let text = text.replace("KIND", kind).replace("SCENE", scene);
        let Some(fmu) = Moved::new(&format!("lifted_{kind}"), &text, "cosimulation") else { return };
        let force = (2 * fmu.n_states + 1).to_string();
        let told = fmu.to(1.0, 0.25, &[]);
        assert!(told.starts_with("reached") && numbers(&told)[1..] == [0.0, 0.0, 1.0], "{kind}: {told}");
        let told = fmu.to(1.0, 0.25, &[&force, "16"]);
        assert!(told.contains("condition lift holds already") && told.contains("stopped"), "{kind}: {told}");
        // After a quarter of a second it is lifted by six.
        let told = fmu.to(1.25, 0.25, &["--", &force, "16"]);
        let found = numbers(&told);
        assert!(told.starts_with("reached"), "{kind}: {told}");
        assert!((found[1] - 3.0).abs() < 1e-9 && (found[2] - 6.0).abs() < 1e-9, "{kind}: {told}");
        assert!(found[3] == 0.0, "{kind}: {told}");
    }
}

/// A crank and a rod, whose other end slides on a line.
const SLIDER: &str = "model m { param r = 0.3; param l = 0.9; coordinate theta in angle; LOOP
    coordinate phi, x in real by [r*cos(theta) + l*cos(phi) - x, r*sin(theta) + l*sin(phi)] = [0, 0];
    lagrangian = theta_dot^2/2 + phi_dot^2/9 + x_dot^2/2; initial theta = 0; initial theta_dot = 3; initial x = 1.2; }";

/// The start is that of the default parameters.
#[test]
fn a_start_off_its_loop_is_none() {
    for (name, form) in [("solved", ""), ("kept", "multipliers;")] {
        let Some(fmu) = Moved::new(name, &SLIDER.replace("LOOP", form), "cosimulation") else { return };
        let r = (2 * fmu.n_states + 1).to_string();
        let closes = |told: &str, r: f64| {
            let found = numbers(told);
            told.starts_with("reached") && (r * found[1].sin() + 0.9 * found[2].sin()).abs() < 1e-7
        };
        let told = fmu.to(1.0, 0.1, &[]);
        assert!(closes(&told, 0.3), "{name}: {told}");
        // Another length at the start, which that does not meet, and on the way.
        for set in [&[&r, "0.4"][..], &["--", &r, "0.4"]] {
            let told = fmu.to(1.0, 0.1, set);
            assert!(
                told.contains("is not zero: start values and parameters have to satisfy"),
                "{name}: {told}"
            );
            assert!(told.contains("stopped"), "{name}: {told}");
        }
        // A start that meets it, with velocities where the state has all of them.
        let velocities = if name == "kept" { &["5", "-1.3333333333333333"][..] } else { &[] };
        let told = fmu.to(1.0, 0.1, &[&[&r, "0.4", "3", "1.3"], velocities].concat());
        assert!(closes(&told, 0.4), "{name}: {told}");
    }
}

/// Positions where equations depend on each other end the motion, whoever makes the steps: where one equation is lost,
/// solved and kept by multipliers, and where two are.
#[test]
fn a_fold_is_not_passed() {
    let arms = "model m { param a = 0.3; param b = 1.0; coordinate al in angle; LOOP
        coordinate be, ga in angle by a*[cos(al), sin(al)] + b*[cos(be), sin(be)] - a*[cos(ga), sin(ga)] = [b, 0];
        lagrangian = al_dot^2/2 + be_dot^2/2 + ga_dot^2; initial al = 1; initial ga = 1; initial al_dot = 1; }";
    let windows =
        include_str!("../../docs/book/four_bar_windows.hamel").replace("model four_bar_windows", "model m");
    for (name, text, fold) in [
        ("arms", arms.replace("LOOP", ""), std::f64::consts::PI - 1.0),
        ("arms_kept", arms.replace("LOOP", "multipliers;"), std::f64::consts::PI - 1.0),
        ("windows", windows, 0.714_356),
    ] {
        for driver in ["cosimulation", "model_exchange"] {
            let Some(fmu) = Moved::new(name, &text, driver) else { return };
            for step in [0.01, 0.05] {
                let go = |t: f64| {
                    if driver == "cosimulation" { fmu.to(t, step, &[]) } else { fmu.exchanged(t, step) }
                };
                let (before, behind) = (go(fold - 0.06), go(fold + 1.0));
                assert!(before.starts_with("reached"), "{name} by {driver} in {step}: {before}");
                let why = ["depend on each other", "vanishes", "too short"];
                assert!(why.iter().any(|why| behind.contains(why)), "{name} by {driver} in {step}: {behind}");
                assert!(behind.contains("stopped"), "{name} by {driver} in {step}: {behind}");
                let t = numbers(&behind)[0];
                assert!((t - fold).abs() < 1.01 * step, "{name} by {driver} in {step}: {behind}");
            }
        }
    }
}
