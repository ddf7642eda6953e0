//! Models that are put together from other models.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use hamel_codegen::scene::{self, BuiltScene};
use hamel_codegen::spec::{self, Model, Origin, compose};

const MOTOR: &str = "model motor {
    param J = 0.002 where J > 0;
    param k = 0.1;
    param R = 0.8 where R > 0;
    param L = 0.005 where L > 0;
    /// Voltage [V].
    input V = 0;
    coordinate shaft in angle;
    state i in real by i_dot = (V - R*i - k*shaft_dot)/L;
    lagrangian = J*shaft_dot^2/2;
    force shaft_dot = k*i;
    output torque = k*i;
}";

const ARM: &str = "model arm {
    param m = 1.5 where m > 0;
    param r = 0.4 where 0 < r < 10;
    param I = 0.05 where I > 0;
    param g = 9.81;
    coordinate q in angle;
    let J = I + m*r^2;
    lagrangian = J*q_dot^2/2 + m*g*r*cos(q);
    initial q = 0.3;
    scene short { fix r = 0.1; want energy; }
}";

fn files(list: &[(&str, &str)]) -> impl FnMut(&str, &str) -> Result<Origin, String> {
    let list: Vec<(String, String)> = list.iter().map(|(n, t)| ((*n).to_owned(), (*t).to_owned())).collect();
    move |_: &str, file: &str| {
        let found = list.iter().find(|(name, _)| name == file).ok_or("there is no such file")?;
        Ok(Origin { file: found.0.clone(), text: found.1.clone() })
    }
}

fn origin(text: &str) -> Origin {
    Origin { file: "whole.hamel".into(), text: text.into() }
}

fn whole(text: &str, list: &[(&str, &str)]) -> Result<Model, spec::Diagnostics> {
    let whole = compose(origin(text), &mut files(list))?;
    spec::parse("whole.hamel", &whole.text)
}

fn refusal(text: &str, list: &[(&str, &str)]) -> String {
    whole(text, list).unwrap_err().to_string()
}

/// Rates of a scene at values of its state and parameters by their names.
fn rates(scene: &BuiltScene, value: &dyn Fn(&str) -> f64) -> BTreeMap<String, f64> {
    let params: Vec<f64> = scene.params().iter().map(|p| value(&p.name)).collect();
    let names = scene.state_names();
    let y: Vec<f64> = names.iter().map(|name| value(name)).collect();
    let interpreter = scene.prepare(&params).unwrap();
    let mut dy = vec![0.0; y.len()];
    interpreter.rhs(0.4, &y, &mut dy);
    names.into_iter().zip(dy).collect()
}

/// Components of an output at values of the scene's state and parameters by their names.
fn outputs(scene: &BuiltScene, output: &str, value: &dyn Fn(&str) -> f64) -> BTreeMap<String, f64> {
    let params: Vec<f64> = scene.params().iter().map(|p| value(&p.name)).collect();
    let y: Vec<f64> = scene.state_names().iter().map(|name| value(name)).collect();
    let interpreter = scene.prepare(&params).unwrap();
    let group = scene.outputs().iter().find(|group| group.name == output).unwrap();
    let names = group.components.iter().map(|(name, _)| name.clone());
    names.zip(interpreter.output(output, 0.4, &y).unwrap()).collect()
}

/// A number of a name: the same for the same name.
fn number(name: &str) -> f64 {
    let hash = name.bytes().fold(17_u64, |h, b| h.wrapping_mul(131).wrapping_add(u64::from(b)));
    0.3 + (hash % 1009) as f64 / 1009.0
}

fn close(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-13 * (1.0 + a.abs().max(b.abs()))
}

#[test]
fn a_motor_with_an_arm_moves_as_the_closed_model() {
    let text = "model driven {
        param n = 20 where n > 0;
        use \"motor.hamel\" as motor { J = 1e-3*n; V = 6*sin(t) - arm_q; }
        use \"arm.hamel\" as arm;
        constraint gear: motor_shaft_dot = n*arm_q_dot;
        independent arm_q_dot;
    }";
    let model = whole(text, &[("motor.hamel", MOTOR), ("arm.hamel", ARM)]).unwrap();
    // The scenes of a part are its own.
    assert!(model.scenes.is_empty());
    assert_eq!(model.parts, ["arm.hamel", "motor.hamel"]);
    let closed = "model closed {
        param n = 20 where n > 0;
        param motor_k = 0.1;
        param motor_R = 0.8 where motor_R > 0;
        param motor_L = 0.005 where motor_L > 0;
        param arm_m = 1.5 where arm_m > 0;
        param arm_r = 0.4 where arm_r > 0;
        param arm_I = 0.05 where arm_I > 0;
        param arm_g = 9.81;
        coordinate motor_shaft, arm_q in angle;
        state motor_i in real
            by motor_i_dot = (6*sin(t) - arm_q - motor_R*motor_i - motor_k*n*arm_q_dot)/motor_L;
        lagrangian = (arm_I + arm_m*arm_r^2 + 1e-3*n^3)*arm_q_dot^2/2 + arm_m*arm_g*arm_r*cos(arm_q);
        constraint motor_shaft_dot = n*arm_q_dot;
        independent arm_q_dot;
        force arm_q_dot = n*motor_k*motor_i;
    }";
    let closed = spec::parse("closed.hamel", closed).unwrap();
    let [ours, theirs] = [&model, &closed].map(|m| rates(&scene::build(m, "default").unwrap(), &number));
    assert_eq!(ours.len(), 4);
    for (name, rate) in &ours {
        assert!(close(*rate, theirs[name]), "{name}: {rate} and {}", theirs[name]);
    }
    // The energy is the sum of the energies of the parts.
    let energy = |m: &Model| {
        let scene = scene::build(m, "default").unwrap();
        let params: Vec<f64> = scene.params().iter().map(|p| number(&p.name)).collect();
        let y: Vec<f64> = scene.state_names().iter().map(|name| number(name)).collect();
        scene.prepare(&params).unwrap().energy(0.4, &y).unwrap()
    };
    assert!(close(energy(&model), energy(&closed)));
}

/// Capacitor and inductor are systems of one charge each, which Kirchhoff's law couples: the capacitor has no inertia.
#[test]
fn a_circuit_from_parts_is_the_circuit() {
    let capacitor =
        "model capacitor { param C = 2 where C > 0; coordinate q in real; lagrangian = -q^2/(2*C); }";
    let coil = "model coil { param L = 3 where L > 0; coordinate q in real; lagrangian = L*q_dot^2/2; }";
    let text = "model circuit {
        use \"capacitor.hamel\" as c;
        use \"coil.hamel\" as l;
        use \"coil.hamel\" as m { L = 2*l_L; }
        constraint c_q_dot = l_q_dot - m_q_dot;
        independent l_q_dot, m_q_dot;
    }";
    let model = whole(text, &[("capacitor.hamel", capacitor), ("coil.hamel", coil)]).unwrap();
    let ours = rates(&scene::build(&model, "default").unwrap(), &number);
    let (charge, c, l) = (number("c_q"), number("c_C"), number("l_L"));
    assert!(close(ours["l_q_dot"], -charge / (c * l)));
    assert!(close(ours["m_q_dot"], charge / (2.0 * c * l)));
    assert!(close(ours["c_q"], number("l_q_dot") - number("m_q_dot")));
}

/// A vector is given with its components, initial values of the whole stand for the part's own, and forces of the
/// whole are added to the part's; bodies and words that a model has once come along.
#[test]
fn what_a_model_says_of_its_parts() {
    let link = "model link {
        param m = 1 where m > 0;
        param p: vector(2) = [1, 2] where p1 > 0;
        coordinate q in angle;
        coordinate s in real;
        body B { mass m; inertia diag([0.1, 0.2, 0.3]); place [sin(q), -cos(q), s]; attitude rot([0, 0, 1], q); }
        lagrangian = B_energy*p1 - m*dot(p, [s, -cos(q)]);
        force q_dot = -p2*q_dot;
        constraint slide: s_dot = 2*q_dot;
        multipliers;
        initial q = 0.3;
    }";
    let text = "model two {
        param k = 3;
        use \"link.hamel\" as a { p = [k, 4]; }
        use \"link.hamel\" as b;
        initial b_q = 0.7;
        force along a_q_dot: -k*a_q_dot;
    }";
    let list = [("link.hamel", link)];
    let model = whole(text, &list).unwrap();
    assert!(model.force_multipliers);
    let given = scene::initial_values(&model, &BTreeMap::new());
    assert_eq!((given["a_q"], given["b_q"]), (0.3, 0.7));
    let [two, one] = [model, whole(link, &list).unwrap()].map(|m| scene::build(&m, "default").unwrap());
    let all = rates(&two, &number);
    let of = |part: &str, name: &str| match (part, name) {
        ("a", "p1") => number("k"),
        ("a", "p2") => 4.0,
        _ => number(&format!("{part}_{name}")),
    };
    for (name, rate) in rates(&one, &|name| of("b", name)) {
        assert!(close(all[&format!("b_{name}")], rate), "{name}");
    }
    // The force of the whole is one more damping.
    let mut alone = rates(&one, &|name| of("a", name));
    let more = whole(&link.replace("-p2*q_dot", "-p2*q_dot - p1*q_dot"), &list).unwrap();
    let more = rates(&scene::build(&more, "default").unwrap(), &|name| of("a", name));
    assert!(!close(alone.remove("q_dot").unwrap(), more["q_dot"]));
    for (name, rate) in more {
        assert!(close(all[&format!("a_{name}")], rate), "{name}");
    }
}

/// A part may have parts; values that are given go through.
#[test]
fn parts_have_parts() {
    let pair = "model pair {
        param n = 3 where n > 0;
        use \"motor.hamel\" as motor;
        use \"arm.hamel\" as arm { g = 0; }
        constraint gear: motor_shaft_dot = n*arm_q_dot;
        independent arm_q_dot;
        event slack when lambda_gear < -1000;
    }";
    let text = "model two {
        use \"pair.hamel\" as a { n = 5; }
        use \"pair.hamel\" as b;
        use \"arm.hamel\" as arm;
        independent a_arm_q_dot, b_arm_q_dot, arm_q_dot;
    }";
    let list = [("pair.hamel", pair), ("motor.hamel", MOTOR), ("arm.hamel", ARM)];
    let model = whole(text, &list).unwrap();
    let names: Vec<&str> = model.base.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["a_motor_shaft", "a_arm_q", "b_motor_shaft", "b_arm_q", "arm_q"]);
    assert_eq!(model.events.iter().filter(|event| event.name.ends_with("_slack")).count(), 2);
    let one = whole(pair, &list).unwrap();
    let [two, one] = [&model, &one].map(|m| scene::build(m, "default").unwrap());
    let all = rates(&two, &number);
    for (part, n) in [("a", 5.0), ("b", number("b_n"))] {
        let of_part = |name: &str| if name == "n" { n } else { number(&format!("{part}_{name}")) };
        for (name, rate) in rates(&one, &of_part) {
            assert!(close(all[&format!("{part}_{name}")], rate), "{part} {name}");
        }
    }
}

/// An impact in a part, a parameter that is called like a multiplier, and an index that is a coordinate of the whole.
#[test]
fn impacts_and_loops_of_parts_are_their_own() {
    let slider = "model slider {
        param lambda_g = 2;
        param e = 0.4;
        coordinate x: vector(2) in real;
        lagrangian = sum(k*x_dot[k]^2 for k in 1..2) + x1_dot*x2_dot - lambda_g*x1*x2;
        mode wall {
            constraint h: x1 + x2/2 = 0;
            event off when lambda_h < -lambda_g { leave wall; }
        }
        event touch = x1 + x2/2 falling { impact wall with e; }
        event stick = x2 - 1 rising { enter wall; }
    }";
    let text = "model two {
        coordinate k in real;
        use \"slider.hamel\" as a { lambda_g = 3; }
        use \"slider.hamel\" as b;
        lagrangian = k_dot^2;
    }";
    let two = whole(text, &[("slider.hamel", slider)]).unwrap();
    let one = spec::parse("slider.hamel", slider).unwrap();
    let [two, one] = [&two, &one].map(|m| scene::build(m, "default").unwrap());
    for (part, g) in [("a", 3.0), ("b", number("b_lambda_g"))] {
        let of_part = |name: &str| if name == "lambda_g" { g } else { number(&format!("{part}_{name}")) };
        for event in ["touch", "stick", "off"] {
            let own = outputs(&one, &format!("after_{event}"), &of_part);
            let all = outputs(&two, &format!("after_{part}_{event}"), &number);
            assert!(!own.is_empty());
            for (name, value) in own {
                let name = name.replace(&format!("after_{event}_"), &format!("after_{part}_{event}_{part}_"));
                assert!(close(all[&name], value), "{name}: {all:?} {value}");
            }
        }
    }
}

/// Shipped models as two parts of one: nothing of one moves the other. Their own files hold them to that, and a few are
/// derived.
#[test]
fn shipped_models_are_parts() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../models/specs");
    let mut all: Vec<PathBuf> =
        std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    all.sort();
    let derived =
        ["heavy_top", "chaplygin_sleigh", "chaplygin_ball", "snakeboard", "veselova", "wong_particle"];
    let (mut accepted, mut n_derived, mut refused) = (0, 0, Vec::new());
    for path in all {
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        let text = std::fs::read_to_string(&path).unwrap();
        let pair = "model pair { use \"one.hamel\" as a; use \"one.hamel\" as b; }";
        match whole(pair, &[("one.hamel", &text)]) {
            Err(problems) => {
                let message = problems.iter().next().unwrap().message.clone();
                assert!(!message.contains("internal"), "{name}: {message}");
                refused.push(format!("{name}: {message}"));
            }
            Ok(model) => {
                accepted += 1;
                if !derived.contains(&name.as_str()) {
                    continue;
                }
                n_derived += 1;
                let one = spec::parse("one.hamel", &text).unwrap();
                let [two, one] = [&model, &one].map(|m| scene::build(m, "default").unwrap());
                let all = rates(&two, &number);
                for part in ["a", "b"] {
                    for (own, rate) in rates(&one, &|own| number(&format!("{part}_{own}"))) {
                        let ours = all[&format!("{part}_{own}")];
                        assert!(close(ours, rate), "{name}, {own}: {ours} and {rate}");
                    }
                }
            }
        }
    }
    assert!(
        accepted >= 32 && n_derived == derived.len(),
        "{accepted} accepted, {n_derived} derived; {refused:#?}"
    );
}

#[test]
fn parts_that_cannot_be_are_refused() {
    let list = [("motor.hamel", MOTOR), ("arm.hamel", ARM)];
    let of = |items: &str| refusal(&format!("model whole {{ {items} }}"), &list);
    let cases = [
        ("use \"mtor.hamel\" as m;", "`mtor.hamel` cannot be read: there is no such file"),
        ("use \"motor.hamel\" as m { K = 2; }", "motor has no parameter or input `K`"),
        ("use \"motor.hamel\" as m { k = 2; k = 3; }", "`k` is given twice"),
        ("use \"motor.hamel\" as m { k = kk; }", "unknown name `kk`"),
        ("use \"motor.hamel\" m;", "expected `as`"),
        ("use \"motor.hamel\" as m; param m_k = 1;", "`m_k` is declared twice"),
        ("use \"arm.hamel\" as a { r = -1; }", "a_r"),
    ];
    for (items, message) in cases {
        let told = of(items);
        assert!(told.contains(message), "{items}\n{told}");
    }
    let hamiltonian = "model body { momentum Pi in so(3); hamiltonian = dot(Pi, Pi)/2; }";
    let told = refusal("model whole { use \"b\" as b; }", &[("b", hamiltonian)]);
    assert!(told.contains("`b` cannot be a part: it has a Hamiltonian in line 1"), "{told}");
    let driven = "model d { coordinate q in real; lagrangian = q_dot^2; actuate u along q_dot; lyapunov V = q_dot^2; }";
    let told = refusal("model whole { use \"d\" as d; }", &[("d", driven)]);
    assert!(told.contains("`d` cannot be a part: it has a force that follows from a function"), "{told}");
    let left = "model l { velocity w in so(3); lagrangian = dot(w, w); }";
    let right = "model r { velocity w in so(3); action right; lagrangian = dot(w, w); }";
    let told = refusal("model whole { use \"l\" as l; use \"r\" as r; }", &[("l", left), ("r", right)]);
    assert!(told.contains("the group of `r` acts from the right, others from the other side"), "{told}");
    let wrong = "model l { velocity w in so(3); lagrangian = dot(w, v); }";
    let told = refusal("model whole { use \"l.hamel\" as l; }", &[("l.hamel", wrong)]);
    assert!(told.contains("l.hamel:1") && told.contains("`v`"), "{told}");
    let round = refusal("model whole { use \"x\" as x; }", &[("x", "model x { use \"x\" as y; }")]);
    assert!(round.contains("more than 16 models are parts of each other"), "{round}");
    // Whoever reads a text alone is told.
    let told =
        spec::parse("whole.hamel", "model whole { use \"motor.hamel\" as m; }").unwrap_err().to_string();
    assert!(told.contains("the part `m` has not been read"), "{told}");
}
