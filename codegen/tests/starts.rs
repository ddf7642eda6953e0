//! Initial states of scenes: what is chosen, what is moved onto equations, and what a projection keeps.
//!
//! Deliberately does not know: how equations are derived, commands.

use hamel_codegen::scene::{self, Made, build_tampered};
use hamel_codegen::spec;

fn model(text: &str) -> spec::Model {
    spec::parse("start.hamel", text).unwrap_or_else(|p| panic!("{p}"))
}

/// A floor over a line that a body climbs: neither height nor way is the length of a vector that turns.
const FLOOR: &str = "model floor_of_heights {
    velocity w, v in product(R, R);
    advected z in R by -v;
    advected s in R by -w;
    lagrangian = (w^2 + v^2)/2;
    constraint floor: z = s^2/4 + 1;
    multipliers;
    initial z = 1; initial s = 0; initial w = 1; initial v = 0;
    scene closed { want rhs, positions; }
}";

#[test]
fn a_projection_keeps_no_length_that_the_motion_changes() {
    let built = scene::build(&model(FLOOR), "closed").unwrap_or_else(|p| panic!("{p}"));
    assert_eq!(built.executable().position_names(), ["position_floor"]);
    // The square of a vector that turns is kept, and of a vector that is stretched as well is not.
    let turned = |by: &str, kept: &[&str]| {
        let text = format!(
            "model turned {{
                velocity Omega in so(3);
                coordinate x in real;
                advected Gamma in R^3 by {by};
                lagrangian = dot(Omega, Omega)/2 + x_dot^2/2 - Gamma3;
                constraint level: x = Gamma3;
                multipliers;
                scene closed {{ want rhs, positions; }}
            }}"
        );
        let built = scene::build(&model(&text), "closed").unwrap_or_else(|p| panic!("{by}: {p}"));
        assert_eq!(built.executable().position_names(), kept, "{by}");
    };
    turned("cross(Omega, Gamma)", &["position_level", "Gamma_dot_Gamma"]);
}

/// A linkage whose rocker nobody turns.
const PARALLELOGRAM: &str = "model parallelogram {
    param a = 0.3; param b = 1.0;
    coordinate al in angle;
    coordinate be, ga in angle by a*[cos(al), sin(al)] + b*[cos(be), sin(be)] - a*[cos(ga), sin(ga)] = [b, 0];
    lagrangian = al_dot^2/2 + be_dot^2/2 + ga_dot^2;
    multipliers;
    initial al = 1; initial ga = 1; initial al_dot = 1;
}";

fn started(text: &str, scene: &str) -> (Vec<String>, scene::Start) {
    let model = model(text);
    let built = scene::build(&model, scene).unwrap_or_else(|p| panic!("{p}"));
    let start = scene::start(&model, &built).unwrap_or_else(|e| panic!("{e}")).expect("a start");
    (built.state_names(), start)
}

fn value((names, start): &(Vec<String>, scene::Start), name: &str) -> f64 {
    start.state[names.iter().position(|own| own == name).unwrap_or_else(|| panic!("{name}: {names:?}"))]
}

#[test]
fn what_nobody_gave_is_moved_first() {
    let found = started(PARALLELOGRAM, "default");
    for (name, expected) in
        [("al", 1.0), ("be", 0.0), ("ga", 1.0), ("al_dot", 1.0), ("be_dot", 0.0), ("ga_dot", 1.0)]
    {
        assert!((value(&found, name) - expected).abs() < 1e-14, "{name}: {found:?}");
    }
    let words = scene::told_in_words(&found.1.told).unwrap();
    assert!(words.starts_with("chosen: be = ") && !words.contains("moved"), "{words}");
    // What the model gives is moved where nothing else is left, and said to be.
    let full =
        PARALLELOGRAM.replace("initial al_dot", "initial be_dot = 0; initial ga_dot = 0; initial al_dot");
    let found = started(&full, "default");
    let words = scene::told_in_words(&found.1.told).unwrap();
    assert!(words.contains("moved onto the equations: ") && words.contains("al_dot from 1.0 to "), "{words}");
    assert!((value(&found, "al_dot") - value(&found, "ga_dot")).abs() < 1e-14, "{found:?}");
}

#[test]
fn what_a_model_does_not_give_is_zero_or_the_identity() {
    let text = "model sleigh {
        param h = 0.5;
        velocity omega, v in se(2);
        coordinate q in (1, 3);
        lagrangian = omega^2/2 + dot(v, v) + q_dot^2;
        constraint v2 = 0;
        reconstruct theta, x, y in SE(2);
        initial v1 = h;
    }";
    let found = started(text, "reconstruction");
    let expected = [("omega", 0.0), ("v1", 0.5), ("q", 2.0), ("q_dot", 0.0), ("theta", 0.0)];
    for (name, expected) in expected {
        assert_eq!(value(&found, name), expected, "{name}: {found:?}");
    }
    let lift = "model lift {
        velocity w in R^1;
        advected height in R by -w;
        lagrangian = w^2/2 - height;
        initial w = 1/2;
    }";
    let found = started(lift, "default");
    assert_eq!([value(&found, "w"), value(&found, "height")], [0.5, 0.0], "{found:?}");
    // A model that gives nothing does not begin at rest, and says so.
    let (_, start) = started(&text.replace("initial v1 = h;", ""), "default");
    let words = scene::told_in_words(&start.told).unwrap();
    assert!(words.contains("omega = -0.5, v1 = 1.1"), "{words}");
    // An angle that a scene carries as a point is at zero.
    let text = "model bead {
        coordinate theta in angle;
        lagrangian = theta_dot^2/2 + cos(theta);
        initial theta_dot = 1;
        scene turned { circle theta; want rhs; }
    }";
    let found = started(text, "turned");
    assert_eq!((value(&found, "theta_c"), value(&found, "theta_s")), (1.0, 0.0));
}

#[test]
fn momenta_begin_where_their_velocities_do() {
    let text = "model wheel {
        param J = 2;
        coordinate phi in angle;
        momentum p of phi_dot;
        lagrangian = J*phi_dot^2/2;
        initial phi_dot = 3;
        scene momenta { carry p; want rhs; }
    }";
    assert_eq!(value(&started(text, "momenta"), "p"), 6.0);
    // One is given by its momentum, the other by its velocity: p1 = 2 v1 + v2, p2 = v1 + 2 v2.
    let text = "model coupled {
        coordinate x1, x2 in real;
        momentum p1 of x1_dot;
        momentum p2 of x2_dot;
        lagrangian = x1_dot^2 + x1_dot*x2_dot + x2_dot^2;
        initial x1 = 0; initial x2 = 0; initial p1 = 1; initial x2_dot = 2;
        scene both { carry p1, p2; want rhs; }
    }";
    let found = started(text, "both");
    assert!(
        (value(&found, "p1") - 1.0).abs() < 1e-15 && (value(&found, "p2") - 3.5).abs() < 1e-14,
        "{found:?}"
    );
}

#[test]
fn modules_of_rust_say_where_a_scene_begins() {
    let model = model(FLOOR);
    let built = scene::build(&model, "default").unwrap_or_else(|p| panic!("{p}"));
    let start = scene::start(&model, &built).unwrap_or_else(|e| panic!("{e}"));
    let text = built.emit_from(&scene::Writing::default(), start).unwrap();
    assert!(text.contains("pub const INITIAL: [f64; 4] = ["), "{text}");
    assert!(!built.emit().unwrap().contains("INITIAL"));
}

/// An attitude in space, and one in the frame of a body that turns: its form is kept in its group alone.
const HELD: [&str; 2] = [
    "model held {
        configuration Q in SO(3) velocity omega;
        constraint held: dot(Q*[0, 0.6, 0.8], [0, 0, 1]) = 0.4;
        lagrangian = dot(omega, omega)/2 - Q33;
        scene closed { want rhs, positions; }
    }",
    "model held {
        velocity Omega in so(3);
        configuration Q in SO(3) velocity omega relative Omega;
        constraint held: dot(Q*[0.6, 0.8, 0], [0, 0, 1]) = 0.3;
        lagrangian = Omega1^2 + Omega2^2/2 + Omega3^2/3 + dot(omega, omega)/2;
        initial Omega = [0.3, 0.1, 0.2];
        scene closed { want rhs, positions; }
    }",
];

#[test]
fn attitudes_that_equations_move_stay_rotations() {
    for text in HELD {
        let found = started(text, "closed");
        let q = |i: usize, j: usize| value(&found, &format!("Q{i}{j}"));
        for (i, j) in [(1, 1), (1, 2), (1, 3), (2, 2), (2, 3), (3, 3)] {
            let product: f64 = (1..=3).map(|n| q(i, n) * q(j, n)).sum();
            assert!((product - f64::from(u8::from(i == j))).abs() < 1e-12, "rows {i}, {j}: {product}");
        }
        assert!(q(3, 2).abs() > 0.1, "{found:?}");
    }
}

/// Groups with other forms, with a determinant alone, and with vectors.
#[test]
fn matrices_of_all_groups_stay_in_them() {
    for (configuration, held) in [
        ("g in SU(2) velocity w", "g_re12 = 0.3"),
        ("g in U(2) velocity w", "g_re12 = 0.3"),
        ("g in SO(4) velocity w", "g12 = 0.3"),
        ("g in SL(2) velocity w", "g12 + g21^2 = 0.3"),
        ("g in Sp(4) velocity w", "g12 + g34 = 0.3"),
        ("g, b in SE(3) velocity w, v", "g12 + b1 = 0.3"),
    ] {
        let has_vectors = configuration.ends_with(", v");
        let lagrangian = if has_vectors { "dot(w, w) + dot(v, v)" } else { "dot(w, w)" };
        let text = format!(
            "model held {{ configuration {configuration}; constraint held: {held}; lagrangian = {lagrangian};
                 scene closed {{ want rhs, positions; }} }}"
        );
        // The certificate counts the directions that the functions leave.
        let built = scene::build(&model(&text), "closed").unwrap_or_else(|p| panic!("{configuration}: {p}"));
        assert!(built.certificate().open.is_empty(), "{configuration}: {:?}", built.certificate());
    }
}

/// Another function in the place of an entry of `Q Q^T` is found, in space and in a frame.
#[test]
fn functions_that_do_not_keep_a_group_are_found() {
    for text in HELD {
        let model = model(text);
        let fault = |made: Made<'_>| {
            if let Made::System(system) = made {
                let q11 = system.graph.sym(model.configurations[0].symbols[0]);
                for (_, e) in system.group_equations.iter_mut().filter(|(name, _)| name == "Q_form_1_2") {
                    *e = system.graph.add(*e, q11);
                }
            }
        };
        let left_out = |made: Made<'_>| {
            if let Made::System(system) = made {
                system.group_equations.retain(|(name, _)| name != "Q_form_1_1");
            }
        };
        let told = build_tampered(&model, "closed", &left_out).expect_err("found").to_string();
        assert!(told.contains("the dimension of what stays in the group of Q"), "{told}");
        assert!(build_tampered(&model, "closed", &|_| {}).is_ok());
        let told = build_tampered(&model, "closed", &fault).expect_err("found").to_string();
        assert!(told.contains("Q_form_1_2"), "{told}");
    }
}

/// The state has the velocities of two coordinates; the model gives one of them and the one that follows.
const SKATE: &str = "model skate {
    param w = 0.5;
    coordinate x, y in real;
    coordinate a in angle;
    lagrangian = (x_dot^2 + y_dot^2 + a_dot^2)/2;
    constraint cos(a)*y_dot = sin(a)*x_dot + w*a_dot;
    initial x = 0; initial y = 0; initial a = 0.3; initial x_dot = 1; initial a_dot = 0.7; initial y_dot = 0.2;
}";

#[test]
fn a_velocity_that_the_state_has_not_is_told_where_it_is_another_one() {
    let (names, start) = started(SKATE, "default");
    let of =
        |name: &str| start.state[names.iter().position(|n| n == name).unwrap_or_else(|| panic!("{name}"))];
    assert!(!names.iter().any(|n| n == "a_dot"), "{names:?}");
    let follows = (of("a").cos() * of("y_dot") - of("a").sin() * of("x_dot")) / 0.5;
    let [scene::Told::Moved { name, from, to }] = start.told.as_slice() else { panic!("{:?}", start.told) };
    assert_eq!((name.as_str(), *from), ("a_dot", 0.7));
    assert!((to - follows).abs() < 1e-12 && (to - from).abs() > 0.1, "{to} beside {follows}");
    // Nothing is told where the model gives the velocity that follows.
    let there = SKATE.replace("initial y_dot = 0.2;", "initial y_dot = (sin(0.3) + w*0.7)/cos(0.3);");
    assert_eq!(started(&there, "default").1.told, []);
    // On circles, too.
    let circle = SKATE.replace("initial a = 0.3;", "initial a = 0.3; scene round { circle a; want rhs; }");
    let told = started(&circle, "round").1.told;
    assert!(matches!(told.as_slice(), [scene::Told::Moved { name, .. }] if name == "a_dot"), "{told:?}");
}
