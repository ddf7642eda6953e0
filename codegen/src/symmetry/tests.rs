//! Faults that are planted in a reduced model are found by the comparison of rates.

use hamel_lang::spec;

use super::{reduce, reduce_held};

const BODY: &str = "model body {
    param I: diagonal(3) = [1.3, 1.7, 0.6]; param m = 2; param g = 9.81; param s: vector(3) = [0.1, 0.2, 0.3];
    configuration R in SO(3) velocity Omega;
    coordinate r: vector(3) in real;
    let p = r + R*s;
    lagrangian = dot(Omega, I*Omega)/2 + m/2*dot(rate(p), rate(p)) - m*g*p[3];
    force Omega = -0.1*Omega;
}";

const SLEIGH: &str = "model sleigh {
    param J = 1.2; param m = 2; param a = 0.4;
    coordinate x, y in real; coordinate theta in angle;
    let u = rate([x + a*cos(theta), y + a*sin(theta)]);
    lagrangian = J/2*theta_dot^2 + m/2*dot(u, u);
    constraint cos(theta)*y_dot = sin(theta)*x_dot;
}";

const VESELOVA: &str = "model veselova {
    param I: diagonal(3) = [1.1, 1.4, 0.7]; param chi: vector(3) = [0.36, 0.48, 0.8];
    configuration R in SO(3) velocity Omega;
    lagrangian = dot(Omega, I*Omega)/2 - dot([0, 0, 1], R*chi);
    constraint dot([0, 0, 1], R*Omega) = 0;
}";

/// Reduced from the right.
const BALL: &str = "model ball {
    param m = 1.2; param I = 0.05; param r = 0.3;
    configuration R in SO(3) velocity Omega;
    coordinate x, y in real;
    let w = R*Omega;
    lagrangian = m/2*(x_dot^2 + y_dot^2) + I/2*dot(Omega, Omega) - x^2;
    constraint x_dot = r*w[2];
    constraint y_dot = -r*w[1];
}";

/// The group mixes the constraints.
const CHAPLYGIN: &str = "model chaplygin {
    param I: diagonal(3) = [1.0, 1.3, 1.6]; param m = 1.5; param r = 0.8;
    configuration R in SO(3) velocity Omega;
    coordinate x: vector(3) in real;
    lagrangian = dot(Omega, I*Omega)/2 + m/2*dot(x_dot, x_dot);
    constraint x_dot = cross(R*Omega, r*[0, 0, 1]);
}";

const SNAKEBOARD: &str = "model snakeboard {
    param m = 2.5; param r = 0.6; param J = 0.3;
    coordinate x, y in real; coordinate theta in angle; coordinate phi in (-1.5, 1.5);
    lagrangian = m/2*(x_dot^2 + y_dot^2) + J/2*theta_dot^2 + phi_dot^2/20 + theta_dot*phi_dot/30;
    constraint -sin(theta + phi)*x_dot + cos(theta + phi)*y_dot - r*cos(phi)*theta_dot = 0;
    constraint -sin(theta - phi)*x_dot + cos(theta - phi)*y_dot + r*cos(phi)*theta_dot = 0;
}";

/// Translations change the Lagrangian by the rate of a function.
const CHARGED: &str = "model charged {
    param m = 0.5; param b = 1.5;
    coordinate x, y in real;
    lagrangian = m/2*(x_dot^2 + y_dot^2) + b/2*(x*y_dot - y*x_dot);
}";

/// The force turns with what it points to.
const SUN: &str = "model sun {
    param I: diagonal(3) = [1.3, 1.7, 0.6]; param k = 0.3;
    configuration R in SO(3) velocity Omega;
    lagrangian = dot(Omega, I*Omega)/2;
    force Omega = k*cross(transpose(R)*[1, 0, 0], [0, 0, 1]);
}";

/// The kinetic energy depends on the vertical.
const ELLIPSOID: &str = "model ellipsoid {
    param I: diagonal(3) = [1.3, 1.7, 0.6]; param m = 1.2; param g = 9.81;
    configuration R in SO(3) velocity Omega;
    let h = sqrt(2*R31^2 + 3*R32^2 + R33^2);
    lagrangian = dot(Omega, I*Omega)/2 + m/2*rate(h)^2 - m*g*h;
}";

/// Rates of 1e4: the motions that are compared are short.
const FAST: &str = "model fast {
    param m = 1.2e-3; param b = 15; param k = 2e4; param s = 0.3;
    coordinate x, y, z in real; coordinate theta in angle;
    lagrangian = m/2*(x_dot^2 + y_dot^2 + z_dot^2) + b*(x*y_dot - y*x_dot)/2 - k*z^2/2 + m*s/2*theta_dot^2;
    force x_dot = -20*x_dot;
}";

/// The motion starts elsewhere than at the identity, where what advects has other values.
const STARTED: &str = "model started {
    param k = 0.7; param w = 0.3;
    coordinate x, y in real; coordinate theta in angle; coordinate l in (0.5, 4);
    lagrangian = (x_dot^2 + y_dot^2 + theta_dot^2)/2 + l_dot^2/2 - (l - 1)^2 - k*cos(theta) + k*l*theta_dot/5;
    constraint y_dot = w*theta_dot + l_dot;
    initial x = 2; initial y = 1; initial theta = 0.4; initial l = 1.5;
    initial x_dot = 1 + w; initial theta_dot = 0.3; initial y_dot = 0.3*w + 0.2;
}";

/// The answer to each fault: the first place of a text replaced. A fault that is not there is no test.
fn planted(model: &str, faults: &[(&str, &str)]) -> Vec<Option<String>> {
    let model = spec::parse("model", model).unwrap();
    let said = std::cell::RefCell::new(Vec::new());
    let held = reduce_held(&model, |text, compared| {
        for (from, to) in faults {
            assert!(text.contains(from), "`{from}` is not in:\n{text}");
            said.borrow_mut().push(compared(&text.replacen(from, to, 1)).err());
        }
    });
    held.unwrap();
    said.into_inner()
}

#[test]
fn planted_faults_are_found() {
    let faults = [
        (BODY, "Omega1*a4", "Omega1*a3"),
        (BODY, "v_r3*a4", "0*a4"),
        (BODY, "in se(3)", "in product(so(3), R^3)"),
        (BODY, "m*g*s3*a4", "m*g*s3*a1"),
        (BODY, "force Omega1 = -1/10", "force Omega1 = 1/10"),
        (BODY, "1/2*I2", "1/2*I1"),
        (SLEIGH, "a*v_theta", "2*a*v_theta"),
        (SLEIGH, "v_y = 0", "v_y - v_x/10 = 0"),
        (BODY, "by R*[v_r1, v_r2", "by R*[v_r2, v_r1"),
        (
            BODY,
            "reconstruct R in matrices(SO(3)) from Omega1, Omega2, Omega3",
            "reconstruct R in matrices(SO(3)) from Omega2, Omega3, Omega1",
        ),
        (SLEIGH, "[sin(theta), cos(theta)]", "[-sin(theta), cos(theta)]"),
        (VESELOVA, "chi3*a", "chi2*a"),
        (VESELOVA, "Omega3*a", "Omega2*a"),
        (BALL, "action right;", ""),
        (BALL, "r*Omega2", "r*Omega1"),
        (CHAPLYGIN, "v_x2 + ", "v_x1 + "),
        (CHAPLYGIN, "Omega1*a3 - ", "Omega1*a3 + "),
        (SNAKEBOARD, "sin(phi)*s", "cos(phi)*s"),
        (SNAKEBOARD, "v_y = 0", "v_y - s/10 = 0"),
        (CHARGED, "force v_x = b*", "force v_x = -b*"),
        (CHARGED, "force v_y = -b*v_x", "force v_y = -b*v_y"),
        (ANGLES, "v_phi*a2", "v_phi*a1"),
        (ANGLES, "by [cos(psi)*v_phi", "by [sin(psi)*v_phi"),
        (ANGLES, "1/2*I2*v_phi^2", "1/2*I3*v_phi^2"),
        (ELLIPSOID, "Omega2*Gamma3", "Omega1*Gamma3"),
        (ELLIPSOID, "Gamma3*", "Gamma2*"),
        (SUN, "force Omega1 = ", "force Omega1 = 1 + "),
        (FAST, "force v_y = -b*v_x", "force v_y = b*v_x"),
        (FAST, "reconstruct x by v_x", "reconstruct x by v_y"),
        (FAST, "reconstruct y by v_y", "reconstruct y by v_y*1.001"),
        (SUN, "Omega1*a1 + Omega3", "Omega1*a1 - Omega3"),
        (STARTED, "initial a1 = ", "initial a1 = 0.01 + "),
        (STARTED, "initial a2 = ", "initial a2 = -"),
        (STARTED, "initial v_x = w + 1;", "initial v_x = w;"),
        (STARTED, "initial v_theta = 3/10;", "initial v_theta = 1/10;"),
        (STARTED, "initial theta = 2/5;", "initial theta = 1/5;"),
        (STARTED, "initial y = 1;", ""),
        (STARTED, "initial l = 3/2;", "initial l = 3/2 + 1/1000;"),
        (STARTED, "initial l_dot = 1/5;", "initial l_dot = -1/5;"),
    ];
    let models: std::collections::BTreeSet<&str> = faults.iter().map(|(model, ..)| *model).collect();
    for model in models {
        let own: Vec<(&str, &str)> =
            faults.iter().filter(|(of, ..)| *of == model).map(|(_, from, to)| (*from, *to)).collect();
        for ((from, to), said) in own.iter().zip(planted(model, &own)) {
            assert!(said.is_some(), "`{from}` -> `{to}` was not found");
        }
    }
}

/// The map of one reduced model is none of another, which a fault in the map or in the model would make of it.
#[test]
fn a_map_is_held_to_both_models() {
    for (text, [first, last]) in [
        (BODY, [("v_r1", "r1_dot*R11 + r2_dot*R21 + r3_dot*R31"), ("a4", "R33")]),
        (SLEIGH, [("v_theta", "theta_dot"), ("v_y", "y_dot*cos(theta) - x_dot*sin(theta)")]),
        (CHARGED, [("v_x", "x_dot"), ("v_y", "y_dot")]),
        (BALL, [("Omega1", "Omega1*R11 + Omega2*R12 + Omega3*R13"), ("v_y", "y_dot")]),
    ] {
        let model = spec::parse("model.hamel", text).unwrap();
        let reduced = reduce(&model).unwrap();
        let map = reduced.map.as_ref().unwrap_or_else(|| panic!("{:?}", reduced.report));
        let of = |name: &str| {
            let image = map.images.iter().find(|(own, _)| own == name);
            image.unwrap_or_else(|| panic!("{name}: {:?}", map.images)).1.as_str()
        };
        assert_eq!((of(first.0), of(last.0)), (first.1, last.1));
        let item = reduced.text_of("model.hamel");
        let held = |text: &str| {
            let reduced = spec::parse("reduced.hamel", text).unwrap();
            crate::quotient::hold(&reduced, &mut |_, _| Ok(model.origin.clone().unwrap()))
        };
        let steps = held(&item).unwrap_or_else(|e| panic!("{}", e[0]));
        assert_eq!(steps[0].proved, map.proved);
        for (name, image) in &map.images {
            let (from, to) = (format!("{name} = {image};"), format!("{name} = -({image});"));
            assert!(item.contains(&from), "{item}");
            assert!(held(&item.replacen(&from, &to, 1)).is_err(), "{name} with another sign");
        }
    }
}

#[test]
fn a_field_that_makes_too_much_is_left_out() {
    // Powers of the height are more and more functions for translations, and turns mix them: turns alone have few.
    let text = "model m { configuration R in SO(3) velocity w; coordinate r: vector(3) in real; \
                lagrangian = dot(w, diag([1, 2, 3])*w) + dot(r_dot, r_dot) + dot(r_dot, R*w)/2 - r3^3 - R33; }";
    let reduced = reduce(&spec::parse("model", text).unwrap()).unwrap();
    assert!(reduced.report.iter().any(|line| line.starts_with("Left: ")), "{:?}", reduced.report);
    assert!(reduced.dim >= 2, "{}", reduced.text);
}

#[test]
fn what_is_not_there_is_told() {
    let refusals = [
        (
            "model m { coordinate x in real; lagrangian = x_dot^2 - x^4; }",
            "there is no group to reduce it by",
        ),
        (
            "model m { velocity w in so(3); lagrangian = dot(w, w); }",
            "velocities of an algebra that no configuration has",
        ),
        (
            "model m { coordinate x, y in real; lagrangian = x_dot^2 + y_dot^2; constraint x_dot^2 = y_dot^2 + 1; }",
            "not linear",
        ),
        (
            "model m { configuration R in SO(3) velocity w; action right; lagrangian = dot(w, w) - R11; }",
            "an action from the right",
        ),
        (
            "model m { configuration R in SO(4) velocity w; lagrangian = dot(w, w); }",
            "a configuration in SO(4)",
        ),
        (
            "model m { param p = 1; coordinate x, y in real; lagrangian = x_dot^2 + (1 + x^2)*y_dot^2; routh y = p; }",
            "momenta in the state",
        ),
        (
            "model m { coordinate x, y in real; momentum p of x_dot; carry p; lagrangian = x_dot^2 + y_dot^2; }",
            "momenta in the state",
        ),
        (
            "model m { coordinate x, y in real; lagrangian = x_dot^2 + y_dot^2; mode stuck { constraint x_dot = 0; } \
             event hit = x { enter stuck; } }",
            "a model with modes",
        ),
        (
            "model m { coordinate x, y in real; lagrangian = x_dot^2 + y_dot^2 - x^2; lyapunov V = x_dot^2 + x^2; \
             actuate u along x_dot; }",
            "an actuator",
        ),
    ];
    for (text, wanted) in refusals {
        let model = spec::parse("model", text).unwrap();
        let problems = reduce(&model).unwrap_err().to_string();
        assert!(problems.contains(wanted), "{text}: {problems}");
    }
}

/// Values of the reduced model are written where its motion is the one of the model, and not otherwise.
#[test]
fn a_motion_starts_where_the_model_starts() {
    let reduced = |text: &str| reduce(&spec::parse("model.hamel", text).unwrap()).unwrap();
    let started = reduced(STARTED);
    for item in [
        "initial a1 = -sin(2/5);",
        "initial a2 = cos(2/5);",
        "initial v_theta = 3/10;",
        // The constraint gives the velocity that the model does not.
        "initial l_dot = 1/5;",
        "initial theta = 2/5;",
    ] {
        assert!(started.text.contains(item), "{item}: {}", started.text);
    }
    // Without the map the function that advects is known at the section alone.
    let falling = "model m { coordinate x, z in real; lagrangian = (x_dot^2 + z_dot^2)/2 - 2*exp(-z); \
                   initial z = 1; initial x_dot = 1; initial x = 3; }";
    let line = "Initial values are left out: the model starts elsewhere than at the identity of the group.";
    let elsewhere = reduced(falling);
    assert!(elsewhere.text.contains(&format!("// {line}")), "{}", elsewhere.text);
    assert!(elsewhere.report.iter().any(|l| l == line), "{:?}", elsewhere.report);
    assert!(!elsewhere.text.contains("initial v_x"), "{}", elsewhere.text);
    let there = reduced(&falling.replace("initial z = 1;", ""));
    assert!(there.text.contains("initial a = 1;") && there.text.contains("initial x = 3;"), "{}", there.text);
    // The model gives velocities that its constraint does not have.
    let skate = "model m { coordinate x, y in real; coordinate a in angle; lagrangian = x_dot^2 + y_dot^2 + a_dot^2; \
                 constraint cos(a)*y_dot = sin(a)*x_dot; initial x_dot = 1; initial y_dot = 1; initial a = 0; }";
    let off = reduced(skate);
    assert!(
        off.text.contains("Initial values are left out: the velocities that the model gives do not keep"),
        "{}",
        off.text
    );
}

#[test]
fn everything_that_is_left_out_is_told() {
    let text = "model m { configuration R in SO(3) velocity w; coordinate x in real; momentum p of w; \
                lagrangian = dot(w, diag([1, 2, 3])*w) + x_dot^2 - R33; reconstruct s by x_dot*w1; \
                output h = 2*p; output body = w1; output space = R*w; frame hand at [x, 0, 0]; \
                event hit = R33 { then w = -w; } scene default { carry p; want rhs; } multipliers; }";
    let reduced = reduce(&spec::parse("model", text).unwrap()).unwrap();
    for line in [
        "Left out: output `h`, which contains `p1`.",
        "Left out: output `space`, which the group moves.",
        "Left out, with its number: event, 1.",
        "Left out, with its number: scene, 1.",
        "Left out, with its number: choice of multipliers, 1.",
        "Left out, with its number: coordinate that the model reconstructs itself, 1.",
        "Left out, with its number: set of named frames, 1.",
    ] {
        assert!(reduced.text.contains(&format!("// {line}")), "{line}: {}", reduced.text);
        assert!(reduced.report.iter().any(|l| l == line), "{line}: {:?}", reduced.report);
    }
    assert!(reduced.text.contains("output body = w1;"), "{}", reduced.text);
    // What an event sets is a part of the event.
    assert!(!reduced.text.contains("after_hit"), "{}", reduced.text);
}

#[test]
fn what_changes_by_a_rate_is_told_and_held_to_the_motion() {
    let report = |text: &str| reduce(&spec::parse("model", text).unwrap()).unwrap().report.join("\n");
    let charged = report(CHARGED);
    for line in [
        "Symmetry up to the rate of `1/2*b*y`: d/dx; it keeps `m*x_dot - b*y`.",
        "Symmetry up to the rate of `-1/2*b*x`: d/dy; it keeps `m*y_dot + b*x`.",
    ] {
        assert!(charged.contains(line), "{charged}");
    }
    let falling = report(
        "model falling { param m = 2; param g = 9.81; coordinate x, z in real; \
         lagrangian = m/2*(x_dot^2 + z_dot^2) - m*g*z; }",
    );
    for line in [
        "Symmetry: d/dx; it keeps `m*x_dot`.",
        "Symmetry up to the rate of `m*x`: t d/dx; not used, since it moves with the time; it keeps `t*m*x_dot - m*x`.",
        "Symmetry up to the rate of `-t*m*g`: d/dz; not used, since the potential energy depends on where it leads; it keeps",
        "t d/dz; not used, since it moves with the time; it keeps",
    ] {
        assert!(falling.contains(line), "{falling}");
    }
}

#[test]
fn a_momentum_that_is_not_kept_is_found() {
    let model = spec::parse("model", CHARGED).unwrap();
    let Ok(mut setting) = super::Setting::new(&model) else { panic!("the model is looked into") };
    let mut told = setting.told();
    assert!(setting.hold_to_motion(&mut told).is_ok());
    for one in &mut told {
        let Some(momentum) = one.momentum else { panic!("{} has no momentum", one.words) };
        let x = setting.graph.sym(model.base[0].symbol);
        one.momentum = Some(setting.graph.add(momentum, x));
        let problem = setting.hold_to_motion(std::slice::from_mut(one)).unwrap_err();
        assert!(problem.contains("is not constant"), "{problem}");
    }
}

const ANGLES: &str = "model angles {
    param I: diagonal(3) = [1.3, 1.7, 0.6]; param k = 3.8;
    coordinate phi, psi in angle; coordinate theta in (0, pi);
    let W = spin(rot(e3, phi)*rot(e1, theta)*rot(e3, psi));
    lagrangian = dot(W, I*W)/2 - k*cos(theta);
}";

#[test]
fn turns_of_a_body_in_angles_are_a_group() {
    let model = spec::parse("model", ANGLES).unwrap();
    let Ok(mut setting) = super::Setting::new(&model) else { panic!("the model is looked into") };
    let group = setting.angle_group().expect("turns about the vertical and two others");
    assert_eq!(group.coordinates.len(), 3);
    assert_eq!(group.body.len(), 3);
    // What reconstructs commutes with the group.
    let symbols: Vec<_> = group.coordinates.iter().map(|i| model.base[*i].symbol).collect();
    for w in &group.body {
        let field = symbols.iter().copied().zip(w.iter().copied()).collect();
        for z in &group.fields {
            for entry in setting.bracket(&z.images, &field) {
                assert!(setting.graph.is_zero(entry));
            }
        }
    }
    // With an angle that the kinetic energy depends on otherwise there is none.
    let other = ANGLES.replace("dot(W, I*W)/2", "dot(W, I*W)/2 + theta_dot^2*(1 + cos(theta))");
    let model = spec::parse("model", &other).unwrap();
    let Ok(mut setting) = super::Setting::new(&model) else { panic!("the model is looked into") };
    assert!(setting.angle_group().is_none());
}

#[test]
fn reversal_reflections_and_scalings_are_told() {
    let report = |text: &str| reduce(&spec::parse("model", text).unwrap()).unwrap().report;
    let kepler = "model kepler { param k = 2; coordinate x, y, z in real; \
                  lagrangian = (x_dot^2 + y_dot^2 + z_dot^2)/2 + k/sqrt(x^2 + y^2); }";
    let lines = report(kepler);
    for line in [
        "Symmetry: reversal of time.",
        "Symmetry: the sign of x.",
        "Symmetry: the sign of y.",
        "Symmetry: the sign of z.",
        // The third law: squares of periods are as cubes of distances.
        "Scaling: x by c^2, y by c^2, z by c^2, t by c^3; it multiplies the Lagrangian by c^-2.",
    ] {
        assert!(lines.iter().any(|l| l == line), "{line}: {lines:?}");
    }
    let other = kepler.replace("k/sqrt(x^2 + y^2)", "k*x/(x^2 + y^2) + x*y_dot");
    let lines = report(&other);
    assert!(!lines.iter().any(|l| l.contains("reversal") || l.contains("sign of x")), "{lines:?}");
    let damped = kepler.replace("y^2); }", "y^2); force z_dot = -z_dot; }");
    let lines = report(&damped);
    assert!(!lines.iter().any(|l| l.contains("reversal") || l.contains("Scaling")), "{lines:?}");
}
