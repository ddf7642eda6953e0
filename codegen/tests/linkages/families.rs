//! Writes models of linkages as text, by the number of bodies.
//!
//! Deliberately does not know: equations, what is measured of the models.

use std::fmt::Write as _;

fn listed(n: usize, item: impl Fn(usize) -> String) -> String {
    (1..=n).map(item).collect()
}

fn model(name: &str, n: usize, items: &str, energies: &[String], constraints: &str) -> String {
    let lagrangian = energies.join(" + ");
    format!(
        "/// {name} of {n} bodies.\nmodel {name}_{n} {{\n{items}    lagrangian = {lagrangian};\n{constraints}    \
         scene bare {{ want rhs; }}\n}}\n"
    )
}

/// A snake in the plane, of links with wheels at their centres: velocities of each link in its own frame by those of
/// the link before.
///
/// # Source
/// Hirose 1993, Biologically Inspired Robots, chapter 2 (links with passive wheels).
pub(crate) fn wheeled_snake(n: usize) -> String {
    let mut items = String::from(
        "    param m = 1.1 where m > 0;\n    param J = 0.1 where J > 0;\n    param l = 0.4 where l > 0;\n",
    );
    items += &listed(n - 1, |k| format!("    coordinate a{k} in angle;\n"));
    items += "    velocity omega, v in se(2);\n    action left;\n";
    items += "    let x1 = v1;\n    let y1 = v2;\n    let w1 = omega;\n";
    for k in 1..n {
        let next = k + 1;
        let _ = writeln!(items, "    let w{next} = w{k} + a{k}_dot;");
        let _ = writeln!(items, "    let x{next} = cos(a{k})*x{k} + sin(a{k})*(y{k} - l*w{k});");
        let _ = writeln!(items, "    let y{next} = -sin(a{k})*x{k} + cos(a{k})*(y{k} - l*w{k}) - l*w{next};");
    }
    let energies: Vec<String> = (1..=n).map(|k| format!("m/2*(x{k}^2 + y{k}^2) + J/2*w{k}^2")).collect();
    let constraints = listed(n, |k| format!("    constraint wheel{k}: y{k} = 0;\n"));
    model("wheeled_snake", n, &items, &energies, &constraints)
}

/// An arm in the vertical plane by the angles between its links, each body with parameters of its own.
pub(crate) fn planar_arm(n: usize) -> String {
    let mut items = String::from("    param g = 9.81;\n");
    for k in 1..=n {
        let mass = 1.0 + 0.1 * k as f64;
        let _ =
            writeln!(items, "    param m{k} = {mass} where m{k} > 0;\n    param J{k} = 0.1 where J{k} > 0;");
        let _ = writeln!(items, "    param c{k} = 0.2;");
        if k < n {
            let _ = writeln!(items, "    param l{k} = 0.5 where l{k} > 0;");
        }
    }
    items += &listed(n, |k| format!("    coordinate q{k} in angle;\n"));
    items += "    let t1 = q1;\n    let w1 = q1_dot;\n    let u0 = 0;\n    let v0 = 0;\n    let h0 = 0;\n";
    for k in 1..=n {
        let before = k - 1;
        if k > 1 {
            let _ = writeln!(items, "    let t{k} = t{before} + q{k};\n    let w{k} = w{before} + q{k}_dot;");
        }
        let _ = writeln!(items, "    let ex{k} = -sin(t{k})*w{k};\n    let ey{k} = cos(t{k})*w{k};");
        if k < n {
            let _ = writeln!(items, "    let u{k} = u{before} + l{k}*ex{k};");
            let _ = writeln!(items, "    let v{k} = v{before} + l{k}*ey{k};");
            let _ = writeln!(items, "    let h{k} = h{before} + l{k}*sin(t{k});");
        }
    }
    let energy = |k: usize| {
        let before = k - 1;
        format!(
            "m{k}/2*((u{before} + c{k}*ex{k})^2 + (v{before} + c{k}*ey{k})^2) + J{k}/2*w{k}^2 \
             - m{k}*g*(h{before} + c{k}*sin(t{k}))"
        )
    };
    let energies: Vec<String> = (1..=n).map(energy).collect();
    model("planar_arm", n, &items, &energies, "")
}

/// Pendulums in the plane, each at the end of the one before, by their angles in space.
pub(crate) fn planar_pendulum(n: usize) -> String {
    let mut items = String::from("    param g = 9.81;\n");
    for k in 1..=n {
        let mass = 1.0 + 0.1 * k as f64;
        let _ =
            writeln!(items, "    param m{k} = {mass} where m{k} > 0;\n    param l{k} = 0.5 where l{k} > 0;");
    }
    items += &listed(n, |k| format!("    coordinate q{k} in angle;\n"));
    items += "    let u0 = 0;\n    let v0 = 0;\n    let h0 = 0;\n";
    for k in 1..=n {
        let before = k - 1;
        let _ = writeln!(items, "    let u{k} = u{before} - l{k}*sin(q{k})*q{k}_dot;");
        let _ = writeln!(items, "    let v{k} = v{before} + l{k}*cos(q{k})*q{k}_dot;");
        let _ = writeln!(items, "    let h{k} = h{before} + l{k}*sin(q{k});");
    }
    let energies: Vec<String> = (1..=n).map(|k| format!("m{k}/2*(u{k}^2 + v{k}^2) - m{k}*g*h{k}")).collect();
    model("planar_pendulum", n, &items, &energies, "")
}

/// Pendulums in space, each at the end of the one before, by the angles from the vertical and around it.
pub(crate) fn spherical_pendulum(n: usize) -> String {
    let mut items = String::from("    param g = 9.81;\n");
    for k in 1..=n {
        let mass = 1.0 + 0.1 * k as f64;
        let _ =
            writeln!(items, "    param m{k} = {mass} where m{k} > 0;\n    param l{k} = 0.5 where l{k} > 0;");
    }
    items += &listed(n, |k| format!("    coordinate q{k} in (0, pi);\n    coordinate s{k} in angle;\n"));
    items += "    let u0 = 0;\n    let v0 = 0;\n    let w0 = 0;\n    let h0 = 0;\n";
    for k in 1..=n {
        let before = k - 1;
        let _ = writeln!(
            items,
            "    let u{k} = u{before} + l{k}*(cos(q{k})*cos(s{k})*q{k}_dot - sin(q{k})*sin(s{k})*s{k}_dot);"
        );
        let _ = writeln!(
            items,
            "    let v{k} = v{before} + l{k}*(cos(q{k})*sin(s{k})*q{k}_dot + sin(q{k})*cos(s{k})*s{k}_dot);"
        );
        let _ = writeln!(items, "    let w{k} = w{before} - l{k}*sin(q{k})*q{k}_dot;");
        let _ = writeln!(items, "    let h{k} = h{before} + l{k}*cos(q{k});");
    }
    let energies: Vec<String> =
        (1..=n).map(|k| format!("m{k}/2*(u{k}^2 + v{k}^2 + w{k}^2) - m{k}*g*h{k}")).collect();
    model("spherical_pendulum", n, &items, &energies, "")
}
