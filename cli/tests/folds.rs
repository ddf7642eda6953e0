//! Positions where equations between coordinates depend on each other, on the command line: the motion goes on along
//! the branch on which it is smooth, or says why not.

use std::f64::consts::PI;
use std::io::Write as _;
use std::path::PathBuf;
use std::process::{Command, Stdio};

/// Runs a command on a model: whether it succeeded, its output and its messages.
fn run(command: &str, name: &str, text: &str, arguments: &[&str]) -> (bool, String, String) {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("fold_{name}.hamel"));
    std::fs::write(&path, text).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_hamel"))
        .env("HAMEL_CACHE_DIR", concat!(env!("CARGO_TARGET_TMPDIR"), "/cache"))
        .args([command, path.to_str().unwrap()])
        .args(arguments)
        .output()
        .unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.success(), text(output.stdout), text(output.stderr))
}

/// What a simulation that has to succeed tells.
fn motion(name: &str, text: &str, arguments: &[&str]) -> String {
    let (succeeds, output, message) = run("simulate", name, text, arguments);
    assert!(succeeds, "{name} {arguments:?}: {output}{message}");
    assert!(!message.contains("warning"), "{name} {arguments:?}: {message}");
    output
}

/// The last value of a component.
fn end(output: &str, component: &str) -> f64 {
    let line = output.lines().find(|line| line.split_whitespace().next() == Some(component));
    let value = line.and_then(|line| line.split_whitespace().last());
    value.and_then(|value| value.parse().ok()).unwrap_or_else(|| panic!("{component}: {output}"))
}

/// How many singular positions the summary tells.
fn n_passed(output: &str) -> usize {
    let line = output.lines().find_map(|line| line.trim_start().strip_prefix("singular "));
    line.map_or(0, |line| line.split_whitespace().next().unwrap().parse().unwrap())
}

/// The drift of the energy that the summary tells, or its largest change.
fn drift(output: &str) -> f64 {
    let found = output.split_once("drift ").or(output.split_once("largest change "));
    let (_, after) = found.unwrap_or_else(|| panic!("{output}"));
    after.split_whitespace().next().unwrap().parse().unwrap()
}

/// Both arms fold onto the base twice in a turn. No force, or a weight; a motor and friction.
const PARALLELOGRAM: &str = "model parallelogram {
    param a = 0.3; param b = 1.0; param g = 0; param motor = 0;
    coordinate al in angle;
    coordinate be, ga in angle by a*[cos(al), sin(al)] + b*[cos(be), sin(be)] - a*[cos(ga), sin(ga)] = [b, 0];
    lagrangian = al_dot^2/2 + be_dot^2/2 + ga_dot^2 - g*sin(al);
    force al_dot = motor*(cos(t) - al_dot/10);
    initial al = 1; initial ga = 1; initial al_dot = 1;
}";

/// The same in one angle.
const CRANK: &str = "model crank {
    param g = 0; param motor = 0;
    coordinate al in angle;
    lagrangian = 3*al_dot^2/2 - g*sin(al);
    force al_dot = motor*(cos(t) - al_dot/10);
    initial al = 1; initial al_dot = 1;
}";

fn by_multipliers(text: &str) -> String {
    text.replacen("lagrangian", "multipliers; lagrangian", 1)
}

#[test]
fn a_parallelogram_goes_on_through_its_folds() {
    let kept = by_multipliers(PARALLELOGRAM);
    // Neither component of the equation is singular alone.
    let turned = PARALLELOGRAM.replace("[b, 0]", "b*[0.6, 0.8]").replace(
        "initial al = 1; initial ga = 1;",
        "initial al = 1 + asin(0.8); initial be = asin(0.8); initial ga = 1 + asin(0.8);",
    );
    for (form, text) in [("solved", PARALLELOGRAM), ("multipliers", &kept), ("turned", &turned)] {
        for method in [
            &["--method", "dop853"][..],
            &["--method", "vern9"],
            &["--method", "gbs14"],
            &["--method", "tsit5", "--rtol", "1e-9"],
            &["--method", "rk4", "--step", "0.05"],
            &["--method", "gauss8", "--step", "0.05"],
        ] {
            let start = if form == "turned" { 1.0 + 0.8_f64.asin() } else { 1.0 };
            for t_final in [20.0_f64, -20.0] {
                let until = format!("{t_final}");
                let arguments = [&["--t-final", &until], method].concat();
                let output = motion(&format!("parallelogram_{form}"), text, &arguments);
                let what = format!("{form} {method:?} {t_final}: {output}");
                let folds = (0..8).filter(|k| {
                    let angle = f64::from(*k) * PI * t_final.signum();
                    let from = if t_final > 0.0 { angle - 1.0 } else { 1.0 - angle };
                    from > 0.0 && from < 20.0
                });
                assert_eq!(n_passed(&output), folds.count(), "{what}");
                assert!((end(&output, "al") - start - t_final).abs() < 1e-6, "{what}");
                assert!((end(&output, "ga") - start - t_final).abs() < 1e-6, "{what}");
                assert!(drift(&output) < 1e-7, "{what}");
            }
        }
    }
}

/// Many turns under a weight, and with a motor and friction, are the turns of one angle.
#[test]
fn a_parallelogram_with_forces_is_that_of_one_angle() {
    let kept = by_multipliers(PARALLELOGRAM);
    for forces in [&["--set", "g=1"][..], &["--set", "g=1", "motor=0.4"]] {
        let exact = ["--t-final", "50", "--rtol", "1e-13", "--atol", "1e-13", "--method", "vern9"];
        let wanted = motion("crank", CRANK, &[&exact[..], forces].concat());
        for (form, text) in [("solved", PARALLELOGRAM), ("multipliers", &kept)] {
            let arguments = [&["--t-final", "50", "--rtol", "1e-12", "--atol", "1e-12"], forces].concat();
            let output = motion(&format!("forced_{form}"), text, &arguments);
            assert!(n_passed(&output) >= 5, "{output}");
            for component in ["al", "al_dot"] {
                let error = (end(&output, component) - end(&wanted, component)).abs();
                assert!(error < 2e-8, "{form} {forces:?} {component} {error:e}: {output}");
            }
        }
    }
}

/// Along the crossed branch `tan(ga/2) = -3 tan(al/2)` for these lengths, not `ga = al`.
#[test]
fn an_antiparallelogram_stays_crossed() {
    let text = PARALLELOGRAM.replace("a = 0.3", "a = 0.5").replace(
        "initial al = 1; initial ga = 1; initial al_dot = 1",
        "initial al = 1; initial ga = -2.045875672358665; initial be = -1.0458756723586644; initial al_dot = 3",
    );
    let kept = by_multipliers(&text);
    for (form, text) in [("solved", &text), ("multipliers", &kept)] {
        let output = motion(&format!("crossed_{form}"), text, &["--t-final", "10", "--set", "g=1"]);
        assert_eq!(n_passed(&output), 9, "{output}");
        let [al, ga] = ["al", "ga"].map(|name| end(&output, name));
        assert!(((ga / 2.0).tan() / (al / 2.0).tan() + 3.0).abs() < 1e-6, "{form}: {output}");
        assert!(al > 25.0 && ga < -25.0 && drift(&output) < 1e-8, "{form}: {output}");
    }
}

/// A02 of the library of benchmark problems for multibody systems: so many windows of rods of one metre and one
/// kilogramme, in places of their joints.
fn windows(n: usize) -> String {
    let (mut items, mut kinetic, mut potential) = (Vec::new(), Vec::new(), Vec::new());
    for k in 0..=n {
        items.push(format!(
            "coordinate x{k}, y{k} in real; constraint crank{k}: (x{k} - {k})^2 + y{k}^2 = 1;"
        ));
        items.push(format!("initial x{k} = {k}; initial y{k} = 1; initial x{k}_dot = 1;"));
        kinetic.push(format!("(x{k}_dot^2 + y{k}_dot^2)/6"));
        potential.push(format!("y{k}/2"));
    }
    for k in 1..=n {
        let j = k - 1;
        items.push(format!("constraint coupler{k}: (x{k} - x{j})^2 + (y{k} - y{j})^2 = 1;"));
        kinetic.push(format!(
            "(x{j}_dot^2 + y{j}_dot^2 + x{k}_dot^2 + y{k}_dot^2 + x{j}_dot*x{k}_dot + y{j}_dot*y{k}_dot)/6"
        ));
        potential.push(format!("(y{j} + y{k})/2"));
    }
    let (kinetic, potential) = (kinetic.join(" + "), potential.join(" + "));
    let items = items.join("\n    ");
    format!(
        "model windows {{\n    {items}\n    multipliers;\n    lagrangian = {kinetic} - 9.81*({potential});\n}}"
    )
}

/// One equation of each window is lost at once: an odd number, and an even one, whose determinants keep their sign. All
/// cranks turn as one does that carries the others.
#[test]
fn windows_of_a_four_bar_linkage_fold_together() {
    for (n, angle, rate) in
        [(1, -30.34394497094289_f64, -1.9669347194396072), (2, -30.17980086019098, -1.5066421808412074)]
    {
        let arguments = ["--t-final", "10", "--rtol", "1e-11", "--atol", "1e-12"];
        let output = motion(&format!("windows_{n}"), &windows(n), &arguments);
        assert_eq!(n_passed(&output), 10, "{output}");
        assert!(drift(&output) < 1e-9, "{output}");
        for k in 0..=n {
            let (x, y) = (end(&output, &format!("x{k}")) - k as f64, end(&output, &format!("y{k}")));
            assert!((x - angle.cos()).abs() < 1e-7 && (y - angle.sin()).abs() < 1e-7, "{output}");
            let speed = end(&output, &format!("x{k}_dot"));
            assert!((speed + rate * angle.sin()).abs() < 1e-7, "{output}");
        }
    }
}

/// A bead on a curve that crosses itself, in two directions; it comes back.
#[test]
fn a_bead_goes_straight_on_where_its_curve_crosses_itself() {
    let text = "model lemniscate {
        coordinate x, y in real;
        constraint curve: (x^2 + y^2)^2 = x^2 - y^2;
        lagrangian = x_dot^2/2 + y_dot^2/2;
        multipliers;
        initial x = 1; initial y = 0; initial y_dot = 1;
    }";
    // Its length is four times that of a quarter, Gauss' constant times a quarter of a turn.
    let length = 5.244_115_108_584_24;
    let output = motion("lemniscate", text, &["--t-final", &format!("{length}"), "--rtol", "1e-12"]);
    assert_eq!(n_passed(&output), 2, "{output}");
    assert!((end(&output, "x") - 1.0).abs() < 1e-9 && end(&output, "y").abs() < 1e-8, "{output}");
    assert!((end(&output, "y_dot") - 1.0).abs() < 1e-8, "{output}");
}

/// Where two branches touch, and where the only branch ends in a cusp.
#[test]
fn branches_that_touch_and_cusps_are_refused() {
    let curve = |equation: &str, rate: &str| {
        format!(
            "model bead {{ coordinate x, y in real; constraint curve: {equation};
            lagrangian = x_dot^2/2 + y_dot^2/2; multipliers;
            initial x = -1; initial y = 1; initial x_dot = 1; initial y_dot = {rate}; }}"
        )
    };
    for (name, text, reason) in [
        ("touch", curve("y^2 = x^4", "-2"), "branches touch there"),
        ("cusp", curve("y^2 = -x^3", "-1.5"), "the singular position is not passed"),
    ] {
        for method in [&["--method", "dop853"][..], &["--method", "vern9"]] {
            let arguments = [&["--t-final", "2"], method].concat();
            let (succeeds, output, message) = run("simulate", name, &text, &arguments);
            assert!(!succeeds, "{name}: {output}{message}");
            assert!(message.contains(reason), "{name}: {message}");
        }
    }
}

/// A weight turns the arms round soon behind a fold: they move as a pendulum of one angle.
#[test]
fn arms_that_turn_round_behind_a_fold_come_back() {
    // 4 al'' = -20 cos(al); the speed in the fold is one.
    let rate = 11.0_f64.sqrt();
    let text = PARALLELOGRAM.replace("al_dot^2/2 + be_dot^2/2 + ga_dot^2", "al_dot^2 + ga_dot^2").replace(
        "initial al = 1; initial ga = 1; initial al_dot = 1;",
        "initial al = -pi/2; initial ga = -pi/2; initial al_dot = sqrt(11);",
    );
    let output = motion("turns_round", &text, &["--t-final", "5", "--set", "g=20"]);
    assert!(n_passed(&output) > 4, "{output}");
    let (n, mut x, mut v) = (500_000, -PI / 2.0, rate);
    let h = 5.0 / f64::from(n);
    v += h / 2.0 * -5.0 * x.cos();
    for _ in 0..n {
        x += h * v;
        v -= h * 5.0 * x.cos();
    }
    v += h / 2.0 * 5.0 * x.cos();
    for (name, value) in [("al", x), ("ga", x), ("al_dot", v)] {
        assert!((end(&output, name) - value).abs() < 1e-7, "{name} {value}: {output}");
    }
}

/// A motion with noise stops at a fold, also where one interval of the noise has the whole passage in it.
#[test]
fn a_motion_with_noise_does_not_pass_a_fold() {
    let text = PARALLELOGRAM.replace("force al_dot =", "noise W; force al_dot = 0.1*W +");
    for method in [&["--method", "gauss8", "--step", "0.1"][..], &["--step", "0.01"]] {
        let arguments = [&["--t-final", "4", "--noise-seed", "1"], method].concat();
        let (succeeds, output, message) = run("simulate", "noisy", &text, &arguments);
        assert!(!succeeds, "{method:?}: {output}{message}");
        assert!(message.contains("noise moves the motion"), "{method:?}: {message}");
    }
    // Without its noise the same model goes on.
    assert_eq!(n_passed(&motion("noiseless", &text, &["--t-final", "4", "--scene", "default"])), 1);
}

/// Derivatives end where the motion passes a fold, and are there before it.
#[test]
fn derivatives_do_not_go_on_through_a_fold() {
    let kept = by_multipliers(PARALLELOGRAM);
    for (form, text) in [("solved", PARALLELOGRAM), ("multipliers", &kept)] {
        let arguments = |t_final| ["--sensitivity", "al_dot", "--t-final", t_final];
        let (succeeds, output, message) = run("simulate", &format!("along_{form}"), text, &arguments("5"));
        assert!(!succeeds, "{form}: {output}{message}");
        assert!(message.contains("derivatives do not go on through such a position"), "{form}: {message}");
        assert!(message.contains("stopped at t = 2.14159"), "{form}: {message}");
        let output = motion(&format!("along_{form}"), text, &arguments("2"));
        let (_, derivatives) = output.split_once("derivative of the final state").unwrap();
        let al = derivatives.lines().find(|line| line.trim_start().starts_with("al ")).unwrap();
        let value: f64 = al.split_whitespace().last().unwrap().parse().unwrap();
        assert!(form == "multipliers" || (value - 2.0).abs() < 1e-8, "{form}: {output}");
    }
}

/// Samples next to the fold and events on both sides of it, one in it, one that sets something beside it.
#[test]
fn samples_and_events_in_a_fold_are_not_lost() {
    let watched = PARALLELOGRAM.replace(
        "initial al = 1;",
        "event before = al - 3.1 rising; event flat = sin(al); event behind = al - 3.2 rising; initial al = 1;",
    );
    let table = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("fold_samples.csv");
    let arguments = ["--t-final", "4", "--samples", "401", "-o", table.to_str().unwrap()];
    let output = motion("watched", &watched, &arguments);
    let told: Vec<f64> = ["before", "behind", "flat"]
        .iter()
        .map(|name| {
            let line = output.lines().find(|line| line.contains(&format!(" {name} 1 times")));
            line.unwrap_or_else(|| panic!("{name}: {output}")).rsplit(' ').next().unwrap().parse().unwrap()
        })
        .collect();
    for (told, wanted) in told.iter().zip([2.1, 2.2, PI - 1.0]) {
        assert!((told - wanted).abs() < 1e-11, "{output}");
    }
    let table = std::fs::read_to_string(table).unwrap();
    let mut lines = table.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let at = |name: &str| names.iter().position(|own| *own == name).unwrap();
    let mut n = 0;
    for (k, line) in lines.enumerate() {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        let t = k as f64 / 100.0;
        assert!((cells[at("t")] - t).abs() < 1e-12 && (cells[at("al")] - 1.0 - t).abs() < 1e-11, "{line}");
        assert!((cells[at("energy")] - 1.5).abs() < 1e-11 && cells[at("be")].abs() < 1e-11, "{line}");
        n += 1;
    }
    assert_eq!(n, 401);

    let bounced = PARALLELOGRAM.replace(
        "initial al = 1;",
        "event wall = al - 3.2 rising { then al_dot = -al_dot; } initial al = 1;",
    );
    // Through the fold to 3.2, and back through it.
    let output = motion("bounced", &bounced, &["--t-final", "4"]);
    assert!(output.contains("wall 1 times"), "{output}");
    assert_eq!(n_passed(&output), 2, "{output}");
    assert!((end(&output, "al") - 1.4).abs() < 1e-8, "{output}");
}

/// A description of a robot whose arms are equal.
#[test]
fn an_imported_linkage_folds() {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
    let [robot, model] = ["xml", "hamel"].map(|end| folder.join(format!("fold_bars.{end}")));
    let arm = |name: &str, x: &str, inside: &str| {
        format!(
            "<body name='{name}' pos='{x} 0 0'><joint name='{name}' type='hinge' axis='0 1 0'/>
            <geom type='capsule' fromto='0 0 0 0 0 0.3' size='0.01' mass='1'/>{inside}</body>"
        )
    };
    let rod = "<body name='rod' pos='0 0 0.3'><joint name='rod' type='hinge' axis='0 1 0'/>
        <geom type='capsule' fromto='0 0 0 1 0 0' size='0.01' mass='1'/></body>";
    let text = format!(
        "<mujoco model='bars'><compiler angle='radian'/><worldbody>{}{}</worldbody>
        <equality><connect body1='rod' body2='rocker' anchor='1 0 0'/></equality></mujoco>",
        arm("crank", "0", rod),
        arm("rocker", "1", "")
    );
    std::fs::write(&robot, text).unwrap();
    let imported = Command::new(env!("CARGO_BIN_EXE_hamel"))
        .args(["import", robot.to_str().unwrap(), "-o", model.to_str().unwrap(), "--force"])
        .output()
        .unwrap();
    assert!(imported.status.success(), "{}", String::from_utf8_lossy(&imported.stderr));
    let text = std::fs::read_to_string(&model).unwrap();
    let output = motion("imported", &text, &["--t-final", "5", "--initial", "crank_dot=1"]);
    assert!(n_passed(&output) >= 4, "{output}");
    let [crank, rod, rocker] = ["crank", "rod", "rocker"].map(|name| end(&output, name));
    assert!((crank + rod).abs() < 1e-9 && (crank - rocker).abs() < 1e-9, "{output}");
    assert!(drift(&output) < 1e-8, "{output}");
}

/// Trajectories of an ensemble that come to the fold pass it as well.
#[test]
fn trajectories_of_an_ensemble_pass_a_fold() {
    let kept = by_multipliers(PARALLELOGRAM);
    for (form, text) in [("solved", PARALLELOGRAM), ("multipliers", &kept)] {
        let table = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("fold_{form}.csv"));
        let arguments = ["--t-final", "6", "--sweep", "al_dot=0.3..1.1:9", "-o", table.to_str().unwrap()];
        let (succeeds, _, message) = run("ensemble", &format!("ensemble_{form}"), text, &arguments);
        assert!(succeeds, "{form}: {message}");
        let table = std::fs::read_to_string(table).unwrap();
        let mut lines = table.lines();
        let names: Vec<&str> = lines.next().unwrap().split(',').collect();
        let at = |name: &str| names.iter().position(|own| *own == name).unwrap();
        let mut n = 0;
        for line in lines {
            let cells: Vec<&str> = line.split(',').collect();
            let [rate, al, ga, energy] =
                ["al_dot(0)", "al", "ga", "energy"].map(|name| cells[at(name)].parse::<f64>().unwrap());
            assert!(cells[at("error")].is_empty(), "{form}: {line}");
            assert!((al - 1.0 - 6.0 * rate).abs() < 1e-8 && (al - ga).abs() < 1e-8, "{form}: {line}");
            assert!((energy - 1.5 * rate * rate).abs() < 1e-8, "{form}: {line}");
            n += 1;
        }
        assert_eq!(n, 9);
    }
}

/// The answer to a request tells when, and how many equations were lost; of a motion that passes none it says nothing.
#[test]
fn an_answer_has_the_positions_that_were_passed() {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("fold_asked.hamel");
    std::fs::write(&path, PARALLELOGRAM).unwrap();
    let ask = |t_final: f64| {
        let initial = serde_json::json!({"al": 1, "be": 0, "ga": 1, "al_dot": 1});
        let request = serde_json::json!({"initial": initial, "t_final": t_final});
        let mut child = Command::new(env!("CARGO_BIN_EXE_hamel"))
            .args(["simulate", path.to_str().unwrap(), "--json"])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        child.stdin.take().unwrap().write_all(request.to_string().as_bytes()).unwrap();
        let output = child.wait_with_output().unwrap();
        serde_json::from_slice::<serde_json::Value>(&output.stdout).unwrap()
    };
    assert!(ask(1.0).get("singular_positions").is_none());
    let passed = ask(4.0)["singular_positions"].clone();
    assert_eq!((passed.as_array().unwrap().len(), passed[0]["lost"].as_u64()), (1, Some(1)));
    assert!((passed[0]["t"].as_f64().unwrap() - (PI - 1.0)).abs() < 1e-6, "{passed}");
}
