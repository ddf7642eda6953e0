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

/// A body of an arm in space, in its own frame at its joint, whose axis is the third.
pub(crate) struct Link {
    /// The joint in the frame of the body before.
    pub(crate) joint: [f64; 3],
    /// Whether the frame is that of the body before by a quarter turn about its first axis, or by that and half a turn
    /// about its third one.
    pub(crate) is_quarter: bool,
    pub(crate) mass: f64,
    /// The centre of mass.
    pub(crate) centre: [f64; 3],
    /// Principal moments of inertia about it.
    pub(crate) moments: [f64; 3],
}

/// The arm of seven joints LBR iiwa 14 R820; the first frame is that of the base.
///
/// # Source
/// Its description for ROS, package `iiwa_description` of <https://github.com/IFL-CAMP/iiwa_stack>.
pub(crate) const IIWA: [Link; 7] = {
    const fn link(joint: [f64; 3], is_quarter: bool, mass: f64, centre: [f64; 3], moments: [f64; 3]) -> Link {
        Link { joint, is_quarter, mass, centre, moments }
    }
    [
        link([0.0, 0.0, 0.1575], false, 4.0, [0.0, -0.03, 0.12], [0.1, 0.09, 0.02]),
        link([0.0, 0.0, 0.2025], false, 4.0, [0.0003, 0.059, 0.042], [0.05, 0.018, 0.044]),
        link([0.0, 0.2045, 0.0], false, 3.0, [0.0, 0.03, 0.13], [0.08, 0.075, 0.01]),
        link([0.0, 0.0, 0.2155], true, 2.7, [0.0, 0.067, 0.034], [0.03, 0.01, 0.029]),
        link([0.0, 0.1845, 0.0], false, 1.7, [0.0001, 0.021, 0.076], [0.02, 0.018, 0.005]),
        link([0.0, 0.0, 0.2155], true, 1.8, [0.0, 0.0006, 0.0004], [0.005, 0.0036, 0.0047]),
        link([0.0, 0.081, 0.0], false, 0.3, [0.0, 0.0, 0.02], [0.001, 0.001, 0.001]),
    ]
};

/// An arm in space of the first bodies of [`IIWA`], with all lengths, masses and moments that are not zero as
/// parameters: velocities and the direction of gravity of each body in its own frame by those of the body before.
pub(crate) fn spatial_arm(n: usize) -> String {
    let mut items = String::from("    param g = 9.81;\n");
    let (mut lets, mut energies) = (String::new(), Vec::new());
    items += &listed(n, |k| format!("    coordinate q{k} in angle;\n"));
    lets += "    let w0x = 0;\n    let w0y = 0;\n    let w0z = 0;\n    let v0x = 0;\n    let v0y = 0;\n    \
             let v0z = 0;\n    let u0x = 0;\n    let u0y = 0;\n    let u0z = 1;\n    let h0 = 0;\n";
    for (k, link) in (1..=n).zip(&IIWA) {
        let b = k - 1;
        // Components of a vector that are not zero, as parameters.
        let mut named = |what: &str, values: [f64; 3]| {
            ["x", "y", "z"]
                .into_iter()
                .zip(values)
                .map(|(axis, value)| {
                    if value == 0.0 {
                        return "0".to_owned();
                    }
                    let name = format!("{what}{k}{axis}");
                    let condition = if what == "J" { format!(" where {name} > 0") } else { String::new() };
                    let _ = writeln!(items, "    param {name} = {value}{condition};");
                    name
                })
                .collect::<Vec<String>>()
        };
        let (r, c, j) = (named("r", link.joint), named("c", link.centre), named("J", link.moments));
        let _ = writeln!(items, "    param m{k} = {} where m{k} > 0;", link.mass);
        // a = P^T w, with w of the body before.
        let turned = |v: &str| {
            if k == 1 {
                return [format!("{v}{b}x"), format!("{v}{b}y"), format!("{v}{b}z")];
            }
            if link.is_quarter {
                [format!("{v}{b}x"), format!("{v}{b}z"), format!("-{v}{b}y")]
            } else {
                [format!("-{v}{b}x"), format!("{v}{b}z"), format!("{v}{b}y")]
            }
        };
        for (axis, (p, q)) in [("x", ("y", "z")), ("y", ("z", "x")), ("z", ("x", "y"))] {
            let at = |axis: &str| ["x", "y", "z"].iter().position(|a| *a == axis).unwrap_or(0);
            let _ = writeln!(
                lets,
                "    let s{b}{axis} = v{b}{axis} + w{b}{p}*{} - w{b}{q}*{};",
                r[at(q)],
                r[at(p)]
            );
        }
        for (vector, from, extra) in
            [("w", "w", format!(" + q{k}_dot")), ("v", "s", String::new()), ("u", "u", String::new())]
        {
            let [x, y, z] = turned(from);
            let _ = writeln!(lets, "    let {vector}{k}x = cos(q{k})*({x}) + sin(q{k})*({y});");
            let _ = writeln!(lets, "    let {vector}{k}y = cos(q{k})*({y}) - sin(q{k})*({x});");
            let _ = writeln!(lets, "    let {vector}{k}z = {z}{extra};");
        }
        let _ = writeln!(lets, "    let h{k} = h{b} + u{b}x*{} + u{b}y*{} + u{b}z*{};", r[0], r[1], r[2]);
        let _ = writeln!(
            lets,
            "    let c{k} = [v{k}x + w{k}y*{2} - w{k}z*{1}, v{k}y + w{k}z*{0} - w{k}x*{2}, v{k}z + w{k}x*{1} - w{k}y*{0}];",
            c[0], c[1], c[2]
        );
        energies.push(format!(
            "m{k}/2*dot(c{k}, c{k}) + ({0}*w{k}x^2 + {1}*w{k}y^2 + {2}*w{k}z^2)/2 - m{k}*g*(h{k} + u{k}x*{3} + u{k}y*{4} + u{k}z*{5})",
            j[0], j[1], j[2], c[0], c[1], c[2]
        ));
    }
    model("spatial_arm", n, &(items + &lets), &energies, "")
}
