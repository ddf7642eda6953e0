//! Faults that are planted in a reduced model are found by the comparison of rates.

use hamel_lang::spec;

use super::{reduce, reduce_altered};

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

/// Replaces the first place of a text; a fault that is not there is no test.
fn planted(model: &str, from: &str, to: &str) -> String {
    let model = spec::parse("model", model).unwrap();
    let alter = |text: String| {
        assert!(text.contains(from), "`{from}` is not in:\n{text}");
        text.replacen(from, to, 1)
    };
    match reduce_altered(&model, alter) {
        Ok(_) => panic!("`{from}` -> `{to}` was not found"),
        Err(problems) => problems.to_string(),
    }
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
    ];
    for (model, from, to) in faults {
        let found = planted(model, from, to);
        assert!(found.contains("internal: the reduced model disagrees"), "{from}: {found}");
    }
}

#[test]
fn a_field_that_makes_too_much_is_left_out() {
    // Powers of the height are more and more functions for translations, and turns mix them: turns alone have few.
    let text = "model m { configuration R in SO(3) velocity w; coordinate r: vector(3) in real; \
                lagrangian = dot(w, w) + dot(r_dot, r_dot) + dot(r_dot, R*w) - r3^3 - R33; }";
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
    ];
    for (text, wanted) in refusals {
        let model = spec::parse("model", text).unwrap();
        let problems = reduce(&model).unwrap_err().to_string();
        assert!(problems.contains(wanted), "{text}: {problems}");
    }
}
