//! Where a motion starts, on the command line: what is chosen, what is moved, what follows a parameter, and what is
//! told of it.

use std::path::Path;

use hamel_codegen::scene::{self, Writing};
use hamel_codegen::spec;
use serde_json::{Value, json};

use crate::common::program;

/// A floor over a line that a body climbs.
const FLOOR: &str = "model floor_of_heights {
    velocity w, v in product(R, R);
    advected z in R by -v;
    advected s in R by -w;
    lagrangian = (w^2 + v^2)/2;
    constraint floor: z = s^2/4 + 1;
    multipliers;
    initial z = 1; initial s = 0; initial w = 1; initial v = 0;
}";

/// A linkage of which the model gives one velocity.
const PARALLELOGRAM: &str = "model parallelogram {
    param a = 0.3; param b = 1.0;
    coordinate al in angle;
    coordinate be, ga in angle by a*[cos(al), sin(al)] + b*[cos(be), sin(be)] - a*[cos(ga), sin(ga)] = [b, 0];
    lagrangian = al_dot^2/2 + be_dot^2/2 + ga_dot^2;
    multipliers;
    initial al = 1; initial ga = 1; initial al_dot = 1;
}";

/// A rod on a ball joint whose end stays on a circle: its attitude is moved there, and stays a rotation.
const HELD: &str = "model held {
    configuration R in SO(3) velocity w;
    param c = 0.4;
    constraint held: dot(R*[0, 0.6, 0.8], [0, 0, 1]) = c;
    lagrangian = w1^2/2 + w2^2 + w3^2 - dot(R*[1, 0, 2], [0, 0, 1]);
    initial w = [0.3, 0.2, 0.5];
}";

/// A slider that the rod of a crank pushes.
const CRANK: &str = "model slider_crank {
    param r = 0.3 where r > 0;
    param l = 0.9 where l > 0;
    coordinate theta in angle;
    coordinate phi in angle by r*sin(theta) + l*sin(phi) = 0;
    coordinate x in real by x = r*cos(theta) + l*cos(phi);
    lagrangian = theta_dot^2*(1 + sin(theta)^2) + phi_dot^2/3 + x_dot^2 - 2*x;
    initial theta = 0.4; initial phi = 0; initial x = 1; initial theta_dot = 3;
}";

/// A pushed bead on a ring.
const BEAD: &str = "model bead {
    param k = 2;
    input u = 0;
    coordinate theta in angle;
    lagrangian = theta_dot^2/2 + k*cos(theta);
    force theta_dot = u;
    initial theta_dot = 1;
    scene turned { circle theta; want rhs, energy; }
}";

fn file(name: &str, text: &str) -> String {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("starts_{name}"));
    std::fs::write(&path, text).unwrap();
    path.to_str().unwrap().to_owned()
}

/// Exit status, standard output and standard error.
fn hamel(arguments: &[&str], input: &str) -> (Option<i32>, String, String) {
    let out = program::output(&mut program::command(arguments), input);
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (out.status.code(), text(&out.stdout), text(&out.stderr))
}

/// The summary of a motion.
fn simulated(arguments: &[&str]) -> String {
    let (code, text, message) = hamel(&[&["simulate"], arguments].concat(), "");
    assert_eq!(code, Some(0), "{arguments:?}: {message}");
    text
}

/// Numbers of the lines of a summary that begin with a name: of the state, then of derivatives.
fn numbers(text: &str, name: &str) -> Vec<f64> {
    let rows = text.lines().map(str::split_whitespace).filter_map(|mut words| {
        (words.next() == Some(name))
            .then(|| words.filter_map(|x| x.parse::<f64>().ok()).collect::<Vec<f64>>())
    });
    rows.flatten().collect()
}

#[test]
fn a_height_over_a_floor_moves_along_it() {
    let model = file("floor.hamel", FLOOR);
    let text = simulated(&[&model, "--t-final", "1"]);
    // Free of forces, the body has gone the length 1 along the parabola.
    let (z, s) = (numbers(&text, "z")[1], numbers(&text, "s")[1]);
    let length = s / 2.0 * (1.0 + s * s / 4.0).sqrt() + (s / 2.0).asinh();
    assert!((length - 1.0).abs() < 1e-9 && (z - s * s / 4.0 - 1.0).abs() < 1e-12, "{text}");
    // A height that nobody gave is at the floor.
    let text = simulated(&[&model, "--t-final", "0", "--initial", "s=1"]);
    assert_eq!(numbers(&text, "z")[0], 1.25, "{text}");
    assert!(text.contains("moved onto the equations: ") && text.contains("z from 1.0 to 1.25"), "{text}");
}

/// Where nothing is given and the motion has no value at zero, other values are tried; modes stay off.
#[test]
fn modes_are_off_where_a_start_is_chosen() {
    let model = file(
        "wheel.hamel",
        "model wheel { coordinate r, x in real; lagrangian = (r_dot^2 + r^2*x_dot^2)/2 - 1/r;
            mode held { constraint hold: r_dot = 0; }
            event far = r - 5 rising { enter held; } }",
    );
    let text = simulated(&[&model, "--t-final", "0"]);
    assert_eq!(numbers(&text, "held")[0], 0.0, "{text}");
    assert!(numbers(&text, "r")[0] > 0.0, "{text}");
    assert!(text.contains("  start      chosen: r = ") && !text.contains("held = "), "{text}");
}

#[test]
fn a_velocity_that_is_given_stays_and_one_that_is_not_follows() {
    let model = file("parallelogram.hamel", PARALLELOGRAM);
    for arguments in
        [&[&*model, "--t-final", "0"][..], &[&*model, "--t-final", "0", "--initial", "al_dot=2"][..]]
    {
        let text = simulated(arguments);
        let first = if arguments.len() > 3 { 2.0 } else { 1.0 };
        assert_eq!(numbers(&text, "al_dot")[0], first, "{text}");
        assert!((numbers(&text, "ga_dot")[0] - first).abs() < 1e-14, "{text}");
        assert!(text.contains("  start      chosen: "), "{text}");
    }
    // On the other way of assembly an equation that was left out does not hold.
    let level = PARALLELOGRAM.replace("multipliers;", "multipliers; constraint level: sin(be) = 0;");
    let level = file("level_parallelogram.hamel", &level);
    assert!(simulated(&[&level, "--t-final", "0"]).contains("  start      chosen: "));
    let crossed =
        ["al=1", "be=-0.5852525857134772", "ga=-1.5852525857134772", "al_dot=0", "be_dot=0", "ga_dot=0"];
    let request = ["simulate", &*level, "--t-final", "0", "--initial"];
    let (code, _, message) = hamel(&[&request[..], &crossed[..]].concat(), "");
    assert_eq!(code, Some(2), "{message}");
    assert!(message.contains("`sin(be) = 0` was left out"), "{message}");
    // What contradicts the equations by itself is told with their names.
    let all = ["--initial", "al_dot=1", "be_dot=0", "ga_dot=0"];
    let (code, _, message) = hamel(&[&["simulate", &*model, "--t-final", "0"][..], &all[..]].concat(), "");
    assert_eq!(code, Some(2), "{message}");
    assert!(message.contains("does not keep the constraints: "), "{message}");
}

#[test]
fn a_model_without_initial_values_says_what_was_chosen() {
    let model =
        file("silent.hamel", "model silent { coordinate x in real; lagrangian = x_dot^2/2 - x^2/2; }");
    let text = simulated(&[&model, "--t-final", "0"]);
    assert!(text.contains("  start      chosen: x = 0.0, x_dot = 0.8"), "{text}");
    // One that gives some begins at rest otherwise, also where it is linearised.
    let text = "model some { coordinate x in real; lagrangian = x_dot^2/2 - x^4/4; initial x = 1; }";
    let model = file("some.hamel", text);
    let text = simulated(&[&model, "--t-final", "0"]);
    assert!(text.contains("  start      chosen: x_dot = 0.0") && numbers(&text, "x_dot")[0] == 0.0, "{text}");
    let (_, text, _) = hamel(&["linearize", &model, "--json"], "");
    let linear: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(linear["at"], json!({"x": 1.0, "x_dot": 0.0}));
    assert_eq!(linear["start"], "chosen: x_dot = 0.0");
}

#[test]
fn a_request_may_leave_out_what_the_model_gives() {
    let model = file("bead.hamel", BEAD);
    let ask = |initial: &Value| {
        hamel(&["simulate", &model, "--json"], &json!({"initial": initial, "t_final": 0}).to_string())
    };
    let (code, answer, message) = ask(&json!({"theta": 0.5}));
    assert_eq!(code, Some(0), "{message}");
    let answer: Value = serde_json::from_str(&answer).unwrap();
    assert_eq!(answer["final"], json!({"theta": 0.5, "theta_dot": 1.0}));
    assert_eq!(answer["initial"], answer["final"]);
    // What nobody gives has to be there.
    let (code, _, message) = ask(&json!({"theta_dot": 0.5}));
    assert_eq!(code, Some(2), "{message}");
    assert!(message.contains("theta"), "{message}");
    // And a complete one is answered as before.
    let (_, answer, _) = ask(&json!({"theta": 0.5, "theta_dot": 0}));
    assert!(serde_json::from_str::<Value>(&answer).unwrap().get("initial").is_none(), "{answer}");
}

#[test]
fn an_angle_on_a_circle_is_given_as_an_angle() {
    let model = file("turned.hamel", BEAD);
    let of = |initial: &[&str]| {
        simulated(&[&[&*model, "--scene", "turned", "--t-final", "1", "--initial"], initial].concat())
    };
    let (by_angle, by_point) =
        (of(&["theta=0.5"]), of(&["theta_c=0.8775825618903728", "theta_s=0.479425538604203"]));
    for name in ["theta_c", "theta_s", "theta_dot"] {
        assert_eq!(numbers(&by_angle, name), numbers(&by_point, name), "{by_angle}");
    }
    let both = ["simulate", &model, "--scene", "turned", "--initial", "theta=0", "theta_s=0"];
    let (code, _, message) = hamel(&both, "");
    assert_eq!(code, Some(2), "{message}");
    assert!(message.contains("gives the angle theta and theta_s: give one of them"), "{message}");
}

#[test]
fn the_scene_with_inputs_is_there_when_expressions_drive_all_of_them() {
    let model = file("driven.hamel", BEAD);
    let rest = ["--input", "u=sin(t)", "--t-final", "1", "--initial", "theta=0.1"];
    let by_name = simulated(&[&[&*model, "--scene", "controlled"][..], &rest[..]].concat());
    let default = simulated(&[&[&*model][..], &rest[..]].concat());
    assert_eq!(numbers(&by_name, "theta"), numbers(&default, "theta"));
}

#[test]
fn a_start_on_a_loop_follows_what_the_motion_is_differentiated_by() {
    let model = file("crank.hamel", CRANK);
    let exact = ["--rtol", "1e-12", "--atol", "1e-13", "--t-final", "0.5"];
    let of = |more: &[&str]| simulated(&[&[&*model][..], &exact[..], more].concat());
    let ends = |text: &str| ["theta", "phi", "x", "theta_dot"].map(|name| numbers(text, name)[1]);
    for (by, option, at) in [("r", "--set", 0.3), ("l", "--set", 0.9), ("theta", "--initial", 0.4)] {
        let text = of(&["--sensitivity", by]);
        let found = ["theta", "phi", "x", "theta_dot"].map(|name| numbers(&text, name)[2]);
        let h = 1e-4;
        let [above, below] = [at + h, at - h].map(|x| ends(&of(&[option, &format!("{by}={x:?}")])));
        for ((found, above), below) in found.iter().zip(above).zip(below) {
            let expected = (above - below) / (2.0 * h);
            // The error of the difference, h^2 times a third derivative.
            assert!((found - expected).abs() < 1e-5, "{by}: {found} instead of {expected}\n{text}");
        }
    }
}

#[test]
fn constrained_velocities_follow_as_well() {
    let text = "model pair {
        param r = 2;
        coordinate x in real;
        coordinate y in real;
        constraint x_dot = r*y_dot;
        lagrangian = (x_dot^2 + y_dot^2 - x^2 - y^2)/2;
        multipliers;
        initial x = r; initial y = 0; initial y_dot = 1;
    }";
    let model = file("pair.hamel", text);
    let exact = ["--rtol", "1e-12", "--atol", "1e-13", "--t-final", "1"];
    let of = |more: &[&str]| simulated(&[&[&*model][..], &exact[..], more].concat());
    let text = of(&["--sensitivity", "r"]);
    let [above, below] = ["r=2.0001", "r=1.9999"].map(|set| of(&["--set", set]));
    for name in ["x", "y", "x_dot", "y_dot"] {
        let expected = (numbers(&above, name)[1] - numbers(&below, name)[1]) / 2e-4;
        let found = numbers(&text, name)[2];
        assert!((found - expected).abs() < 1e-6, "{name}: {found} instead of {expected}\n{text}");
    }
}

#[test]
fn lengths_of_a_loop_are_fitted() {
    let model = file("fitted.hamel", CRANK);
    let data = Path::new(env!("CARGO_TARGET_TMPDIR")).join("starts_crank.csv");
    let data = data.to_str().unwrap();
    simulated(&[&model, "--set", "r=0.35", "--t-final", "1", "--samples", "41", "-o", data]);
    let (code, text, message) =
        hamel(&["fit", &model, "--data", data, "--free", "r", "--columns", "x,theta", "--json"], "");
    assert_eq!(code, Some(0), "{message}");
    let answer: Value = serde_json::from_str(&text).unwrap();
    let r = answer["estimates"]["r"]["value"].as_f64().unwrap();
    assert!((r - 0.35).abs() < 1e-7, "{answer}");
    // The start that is told is that of the fitted loop.
    let [theta, phi] = ["theta", "phi"].map(|name| answer["initial"][name].as_f64().unwrap());
    assert!((r * theta.sin() + 0.9 * phi.sin()).abs() < 1e-14, "{answer}");
}

/// Numbers between two marks of a text, after the first mark of a place.
fn numbers_between(text: &str, place: &str, [from, to]: [&str; 2]) -> Vec<f64> {
    let (_, rest) = text.split_once(place).unwrap_or_else(|| panic!("no {place}: {text}"));
    let (_, rest) = rest.split_once(from).unwrap_or_else(|| panic!("no {from}: {rest}"));
    let (inside, _) = rest.split_once(to).unwrap_or_else(|| panic!("no {to}: {rest}"));
    let is_of_number = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '-' | '+');
    // Indices are no numbers with a point or an exponent.
    let words = inside.split(|c: char| !is_of_number(c)).filter(|word| word.contains(['.', 'e']));
    words.filter_map(|word| word.parse().ok()).collect()
}

/// Scenes of every kind begin at one state in every language: on the command line, in Rust, C, WebAssembly and FMUs.
#[test]
fn one_state_in_every_language() {
    let cart = "model cart { param m = 2; input u = 0; coordinate x, y in real; velocity w in R;
        lagrangian = m*(x_dot^2 + y_dot^2)/2 + w^2; force x_dot = u; force w = -w;
        initial x = 1/3; initial x_dot = -4; initial y_dot = 1e-3; initial w = 0.7; }";
    let turned = "model turned { param I: diagonal(3) = [1, 2, 3]; velocity Omega in so(3);
        momentum Pi of Omega; lagrangian = dot(Omega, I*Omega)/2; reconstruct q in SO(3);
        initial Omega = [0.1, 1.3, -0.2]; initial q = [3/5, 0, 4/5, 0];
        scene split { carry Pi; want splitting, energy; } }";
    let carried = "model carried { param c = 2; coordinate q in real; momentum p of q_dot; carry p;
        lagrangian = (1 + q^2)*q_dot^2/2 - c*q^2; initial q = 0.3; initial q_dot = 0.4; }";
    let attitude = "model attitude { param k = 1.5; configuration R in SO(3) velocity Omega;
        lagrangian = dot(Omega, Omega)/2 - k*dot(log(R), log(R))/2;
        initial R = rot(e3, 0.4); initial Omega = [0, 0.5, 1]; }";
    let scenes = [
        ("cart", cart, "controlled"),
        ("cart", cart, "minimal"),
        ("turned", turned, "reconstruction"),
        ("turned", turned, "split"),
        ("carried", carried, "default"),
        ("attitude", attitude, "default"),
        ("bead", BEAD, "turned"),
        ("crank", CRANK, "default"),
        ("parallelogram", PARALLELOGRAM, "default"),
        ("floor", FLOOR, "default"),
    ];
    for (name, text, scene) in scenes {
        let what = format!("{name}, {scene}");
        let path = file(&format!("{name}_everywhere.hamel"), text);
        let model = spec::parse(&path, text).unwrap_or_else(|e| panic!("{what}: {e}"));
        let built = scene::build(&model, scene).unwrap_or_else(|e| panic!("{what}: {e}"));
        let start = scene::start(&model, &built).unwrap_or_else(|e| panic!("{what}: {e}"));
        let start = start.unwrap_or_else(|| panic!("{what} begins nowhere"));
        assert!(start.state.iter().any(|x| *x != 0.0), "{what}");
        let same = |how: &str, found: Vec<f64>| assert_eq!(found, start.state, "{what} in {how}");
        let (writing, state) = (Writing::default(), || Some(start.clone()));
        let rust = built.emit_from(&writing, state()).unwrap_or_else(|e| panic!("{what}: {e}"));
        same("Rust", numbers_between(&rust, "pub const INITIAL", ["= [", "];"]));
        let c = built.emit_c(&writing, state()).unwrap_or_else(|e| panic!("{what}: {e}"));
        same("C", numbers_between(&c.source, "_initial(double y[", ["{", "}"]));
        assert!(c.cpp.contains("_initial(y.data());"), "{what} in C++");
        let wasm = built.emit_wasm(&writing, state()).unwrap_or_else(|e| panic!("{what}: {e}"));
        same("WebAssembly", numbers_between(&wasm.root, "static STATE:", ["= [", "];"]));
        let (_, fmu) = built.emit_fmu(&writing, state()).unwrap_or_else(|e| panic!("{what}: {e}"));
        let starts = fmu.description.lines().filter(|line| line.contains("causality=\"output\""));
        let values =
            starts.filter_map(|line| line.split_once("initial=\"exact\" start=\"")?.1.split('"').next());
        same("an FMU", values.map(|x| x.parse().unwrap()).collect());
        let names = built.state_names();
        let told = simulated(&[&path, "--scene", scene, "--t-final", "0"]);
        for (name, x) in names.iter().zip(&start.state) {
            assert_eq!(numbers(&told, name).first(), Some(x), "{what}: {name} in {told}");
        }
        if name != "parallelogram" && name != "floor" {
            let (code, out, message) = hamel(&["linearize", &path, "--scene", scene, "--json"], "");
            assert_eq!(code, Some(0), "{what}: {message}");
            let at = serde_json::from_str::<Value>(&out).unwrap()["at"].clone();
            same("linearize", names.iter().map(|name| at[name].as_f64().unwrap()).collect());
        }
    }
}

/// What the model gives may be left out, in the variables in which it gives it, and modes are off then.
#[test]
fn requests_leave_out_what_the_model_gives_and_modes() {
    let text = "model held {
        param m = 2;
        coordinate x, y in real;
        lagrangian = m*(x_dot^2 + y_dot^2)/2;
        mode line { constraint y = 0; }
        event touch = y falling { enter line; }
        initial x = 1; initial x_dot = 3; initial y = 2;
    }";
    let model = file("held.hamel", text);
    let ask = |initial: &str| {
        let request = format!("{{\"initial\": {initial}, \"t_final\": 1}}");
        let (code, answer, message) = hamel(&["simulate", &model, "--json"], &request);
        (code == Some(0), answer + &message)
    };
    let (is_fine, answer) = ask("{\"y_dot\": -1}");
    assert!(is_fine && answer.contains("\"line\":0.0"), "{answer}");
    let (is_fine, message) = ask("{}");
    assert!(!is_fine && message.contains("initial lacks y_dot\n"), "{message}");
}

/// Levels of stages have one velocity more than the constraint leaves: a value for it beside velocities of the model is
/// another state, and no value of the user's is changed without a word.
#[test]
fn a_component_that_others_determine_is_held_to_its_value() {
    let path = file(
        "levels.hamel",
        "model levels { coordinate x in real; velocity u, v, w in product(R, R, R); \
         lagrangian = (x_dot^2 + u^2 + v^2 + w^2)/2 + u*v/3; \
         constraint cos(x)*u + sin(x)*v = w*(1 + x^2)/3; independent x_dot, u, v; \
         stage s0; stage s1 = ideal(v + u, w + 2*v); inner_product = lagrangian; \
         initial x = 0.3; initial u = 0.4; initial v = 0.2; scene st { carry stages; want rhs, energy; } }",
    );
    let options = [path.as_str(), "--scene", "st", "--t-final", "0.1"];
    let out = simulated(&options);
    let own = numbers(&out, "s1_2")[0];
    for (value, is_kept) in [(own, true), (3.0, false)] {
        let given = format!("s1_2={value:?}");
        let (status, _, told) = hamel(&[&["simulate"], &options[..], &["--initial", &given]].concat(), "");
        assert_eq!(status == Some(0), is_kept, "{told}");
        assert!(is_kept || told.contains("the other components make it"), "{told}");
        let initial = json!({"x": 0.3, "x_dot": 0.0, "u": 0.4, "v": 0.2, "s1_2": value});
        let request = json!({"initial": initial, "t_final": 0.1}).to_string();
        let (status, _, told) = hamel(&["simulate", &path, "--scene", "st", "--json"], &request);
        assert_eq!(status == Some(0), is_kept, "{told}");
        assert!(is_kept || told.contains("the other components make it"), "{told}");
    }
}

#[test]
fn attitudes_are_moved_onto_equations_in_their_group() {
    let text = simulated(&[&file("held.hamel", HELD), "--t-final", "5"]);
    for k in 0..2 {
        let r = |i: usize, j: usize| numbers(&text, &format!("R{i}{j}"))[k];
        for i in 1..=3 {
            for j in 1..=i {
                let product: f64 = (1..=3).map(|n| r(i, n) * r(j, n)).sum();
                let expected = f64::from(u8::from(i == j));
                assert!((product - expected).abs() < 1e-9, "rows {i}, {j}: {product}");
            }
        }
        assert!((0.6 * r(3, 2) + 0.8 * r(3, 3) - 0.4).abs() < 1e-9);
    }
}
