//! Motion on bundles against closed forms, and one system written in two ways against itself.

use hamel_codegen::{scene, spec};
use hamel_tests::models::{
    self, build, close, conjugate, equations, follow, params, quaternion_product, rotated, rotation_by, times,
};

/// Euler angles `R = Rz(phi) Rx(theta) Rz(psi)` of the disk: the body axis E3 is the axis `z` of the disk and
/// `Gamma = R^T e3 = (sin theta sin psi, sin theta cos psi, cos theta)`. From the contact to the centre points
/// `R s = r Rz(phi) Rx(theta) e2 = r y`, so both models mean the same side of the disk.
fn body_of(theta: f64, psi: f64, rates: [f64; 3]) -> [f64; 6] {
    let [theta_dot, phi_dot, psi_dot] = rates;
    let ((st, ct), (sp, cp)) = (theta.sin_cos(), psi.sin_cos());
    [
        theta_dot * cp + phi_dot * st * sp,
        -theta_dot * sp + phi_dot * st * cp,
        psi_dot + phi_dot * ct,
        st * sp,
        st * cp,
        ct,
    ]
}

#[test]
fn the_flat_disk_in_euler_angles_is_the_disk_with_an_advected_parameter() {
    let angles = build("euler_disk", scene::RECONSTRUCTION);
    let advected = build("euler_disk_advected", scene::RECONSTRUCTION);
    let (theta, phi, psi) = (0.9_f64, 0.4_f64, -0.7_f64);
    let rates = [0.3, 1.5, -6.0];
    let (x, y, r) = (0.2, -0.1, 0.5);
    let on_the_way = times(1.5, 15);
    let body = body_of(theta, psi, rates);
    let attitude = |phi: f64, theta: f64, psi: f64| {
        let tilted = quaternion_product(rotation_by([0.0, 0.0, phi]), rotation_by([theta, 0.0, 0.0]));
        quaternion_product(tilted, rotation_by([0.0, 0.0, psi]))
    };
    // Centre of the disk: contact plus r y.
    let centre = |x: f64, y: f64, theta: f64, phi: f64| {
        [x - r * theta.cos() * phi.sin(), y + r * theta.cos() * phi.cos(), r * theta.sin()]
    };
    let mut expected = Vec::new();
    let initial = [
        ("theta", theta),
        ("phi", phi),
        ("theta_dot", rates[0]),
        ("phi_dot", rates[1]),
        ("psi_dot", rates[2]),
        ("psi", psi),
        ("x1", x),
        ("x2", y),
    ];
    let same = [("M", 1.3), ("r", r), ("e", 0.0), ("I1", 0.09), ("I3", 0.15), ("g", 9.81)];
    follow(&angles, &same, &initial, &on_the_way, |at| {
        let [theta, phi, psi] = ["theta", "phi", "psi"].map(|n| at.get(n));
        let body = body_of(theta, psi, ["theta_dot", "phi_dot", "psi_dot"].map(|n| at.get(n)));
        let q = attitude(phi, theta, psi);
        expected.push((body, q, centre(at.get("x1"), at.get("x2"), theta, phi)));
    });
    let [q, c] = [attitude(phi, theta, psi).to_vec(), centre(x, y, theta, phi).to_vec()];
    let names = [
        "Omega1", "Omega2", "Omega3", "Gamma1", "Gamma2", "Gamma3", "qw", "qx", "qy", "qz", "x1", "x2", "x3",
    ];
    let values = [body.to_vec(), q, c].concat();
    let initial: Vec<(&str, f64)> = names.into_iter().zip(values).collect();
    let same = [("m", 1.3), ("r", r), ("I1", 0.09), ("I3", 0.15), ("g", 9.81)];
    let mut next = expected.iter();
    let mut turned: f64 = 0.0;
    follow(&advected, &same, &initial, &on_the_way, |at| {
        let (body, q, centre) = next.next().expect("as many states as times");
        let found = [at.vector("Omega"), at.vector("Gamma")].concat();
        close(&format!("body variables at {}", at.t), &found, body, 1e-10);
        // Unit quaternions that differ by sign are the same attitude.
        let sign = at.quaternion().iter().zip(q).map(|(a, b)| a * b).sum::<f64>().signum();
        close("attitude", &at.quaternion().map(|a| sign * a), q, 1e-10);
        close("mass centre", &at.vector("x"), centre, 1e-10);
        turned = turned.max((found[3] - values_at_start(&initial, "Gamma1")).abs());
    });
    assert!(turned > 0.1, "the disk turns on the way");
}

fn values_at_start(initial: &[(&str, f64)], name: &str) -> f64 {
    initial.iter().find(|(n, _)| *n == name).map_or(0.0, |(_, value)| *value)
}

#[test]
fn the_two_disks_differ_on_the_other_side_of_the_contact() {
    // The comparison above can fail: the disk that leans the other way moves otherwise.
    let angles = build("euler_disk", scene::RECONSTRUCTION);
    let advected = build("euler_disk_advected", scene::DEFAULT);
    let rhs = |scene: &scene::BuiltScene, replaced: &[(&str, f64)], y: &[f64]| {
        let mut dy = vec![0.0; y.len()];
        scene.prepare(&params(scene, replaced)).unwrap_or_else(|e| panic!("{e}")).rhs(0.0, y, &mut dy);
        dy
    };
    let (theta, psi, rates) = (0.9, 0.3, [0.3, 1.5, -6.0]);
    let dy = rhs(&angles, &[("e", 0.0)], &[theta, 0.0, rates[0], rates[1], rates[2], psi, 0.0, 0.0]);
    let rate_of_inclination = |psi: f64| {
        let state = body_of(theta, psi, rates);
        // Gamma3 = cos theta: Gamma3'' = -cos theta theta_dot^2 - sin theta theta_ddot, Gamma' = Gamma x Omega.
        let d = rhs(&advected, &[], &state);
        let second = d[3] * state[1] + state[3] * d[1] - d[4] * state[0] - state[4] * d[0];
        (-second - f64::cos(theta) * rates[0] * rates[0]) / f64::sin(theta)
    };
    assert!((rate_of_inclination(psi) - dy[2]).abs() < 1e-12 * dy[2].abs().max(1.0));
    // The inclination does not see the spin angle, but it sees the side.
    assert!((rate_of_inclination(1.1) - dy[2]).abs() < 1e-11);
    let mirrored = rhs(&angles, &[("e", 0.0)], &[-theta, 0.0, rates[0], rates[1], rates[2], psi, 0.0, 0.0]);
    assert!((mirrored[2] - dy[2]).abs() > 1.0);
}

#[test]
fn a_ball_on_a_rotating_table_moves_on_a_circle() {
    // Newton: xdd = F, k2 omega' = (-r e3) x F, hence k2 omega_x' = r ydd and k2 omega_y' = -r xdd; the derivative of
    // the constraint, xdd = r omega_y' - Omega ydot, gives xdd = -w ydot, ydd = w xdot with w = Omega k2/(k2 + r^2).
    let scene = build("ball_on_rotating_table", scene::RECONSTRUCTION);
    let (r, k2, turning) = (0.3, 0.036, 1.4);
    let w = turning * k2 / (k2 + r * r);
    let (x, y, vx, vy, spin) = (0.4, -0.2, 0.1, 0.3, 0.5);
    let initial = [
        ("x", x),
        ("y", y),
        ("x_dot", vx),
        ("y_dot", vy),
        ("omega_z", spin),
        ("qw", 1.0),
        ("qx", 0.0),
        ("qy", 0.0),
        ("qz", 0.0),
    ];
    follow(&scene, &[("r", r), ("k2", k2), ("Omega", turning)], &initial, &times(20.0, 40), |at| {
        let (s, c) = (w * at.t).sin_cos();
        let place = [x + (s * vx - (1.0 - c) * vy) / w, y + ((1.0 - c) * vx + s * vy) / w];
        let velocity = [c * vx - s * vy, s * vx + c * vy];
        close("place", &["x", "y"].map(|n| at.get(n)), &place, 1e-11);
        close("velocity", &["x_dot", "y_dot"].map(|n| at.get(n)), &velocity, 1e-11);
        close("spin", &[at.get("omega_z")], &[spin], 0.0);
        let norm: f64 = at.quaternion().iter().map(|a| a * a).sum();
        close("norm of the quaternion", &[norm], &[1.0], 1e-11);
    });
    assert_eq!(equations("ball_on_rotating_table").facts.constants, ["omega_z"]);
}

#[test]
fn appells_machine_keeps_its_direction_and_loses_speed_at_a_constant_rate() {
    let scene = build("appell_machine", scene::DEFAULT);
    let outputs = scene.outputs();
    let names: Vec<&str> = outputs.iter().flat_map(|o| &o.components).map(|(n, _)| n.as_str()).collect();
    let residual = names.iter().position(|n| *n == "residual_winch").expect("the residual is an output");
    for (k, g) in [(0.5, 9.81), (1.3, 2.0)] {
        let rate = -g * k / (1.0 + k * k);
        let (vx, vy) = (3.0, -4.0);
        let speed = f64::hypot(vx, vy);
        let initial =
            [("x", 0.1), ("y", 0.2), ("z", 0.3), ("x_dot", vx), ("y_dot", vy), ("z_dot", k * speed)];
        follow(&scene, &[("k", k), ("g", g)], &initial, &times(1.2, 12), |at| {
            let now = speed + rate * at.t;
            let way = (speed + rate * at.t / 2.0) * at.t;
            let velocity = [now * vx / speed, now * vy / speed, k * now];
            close("velocity", &["x_dot", "y_dot", "z_dot"].map(|n| at.get(n)), &velocity, 1e-11);
            let place = [0.1 + way * vx / speed, 0.2 + way * vy / speed, 0.3 + k * way];
            close("place", &["x", "y", "z"].map(|n| at.get(n)), &place, 1e-11);
            close("constraint", &[at.outputs()[residual]], &[0.0], 1e-11);
        });
    }
}

#[test]
fn the_mass_centre_of_a_tethered_body_is_a_harmonic_oscillator() {
    let scene = build("tethered_body", scene::RECONSTRUCTION);
    let (m, k): (f64, f64) = (1.6, 2.5);
    let w = (k / m).sqrt();
    let q = rotation_by([0.4, -0.9, 0.3]);
    let (velocity, place, a) = ([0.5, -0.3, 0.2], [0.7, 0.1, -0.4], [1.0, 0.2, -0.4]);
    let sum = |u: [f64; 3], v: [f64; 3]| [0, 1, 2].map(|i| u[i] + v[i]);
    let fixed = sum(place, rotated(q, a));
    let start = rotated(q, velocity);
    let names = [
        "Omega1", "Omega2", "Omega3", "V1", "V2", "V3", "a1", "a2", "a3", "qw", "qx", "qy", "qz", "r1", "r2",
        "r3",
    ];
    let values = [[0.4, 1.2, -0.3].as_slice(), &velocity, &a, &q, &place].concat();
    let initial: Vec<(&str, f64)> = names.into_iter().zip(values).collect();
    follow(&scene, &[("m", m), ("k", k)], &initial, &times(8.0, 32), |at| {
        let (s, c) = (w * at.t).sin_cos();
        let expected = [0, 1, 2].map(|i| fixed[i] + (place[i] - fixed[i]) * c + start[i] * s / w);
        close("mass centre", &at.vector("r"), &expected, 1e-11);
        let tied = sum(at.vector("r"), rotated(at.quaternion(), at.vector("a")));
        close("fixed point", &tied, &fixed, 1e-11);
        let speed = [0, 1, 2].map(|i| (fixed[i] - place[i]) * w * s + start[i] * c);
        close("velocity", &rotated(at.quaternion(), at.vector("V")), &speed, 1e-11);
    });
}

#[test]
fn the_attitude_of_a_heavy_top_keeps_its_norm_and_its_vertical() {
    let scene = build("heavy_top", scene::RECONSTRUCTION);
    // R = Rx(alpha) with sin alpha = 0.6: R^T e3 = (0, 0.6, 0.8); then a turn about the vertical, which Gamma cannot
    // see.
    let q = quaternion_product(rotation_by([0.0, 0.0, 0.7]), rotation_by([0.6_f64.asin(), 0.0, 0.0]));
    let names = ["Omega1", "Omega2", "Omega3", "Gamma1", "Gamma2", "Gamma3", "qw", "qx", "qy", "qz"];
    let values = [[0.4, -0.3, 2.0].as_slice(), &[0.0, 0.6, 0.8], &q].concat();
    let initial: Vec<(&str, f64)> = names.into_iter().zip(values).collect();
    let mut least: f64 = 1.0;
    follow(&scene, &[], &initial, &times(10.0, 40), |at| {
        let norm: f64 = at.quaternion().iter().map(|a| a * a).sum();
        close("norm of the quaternion", &[norm.sqrt()], &[1.0], 1e-11);
        let vertical = rotated(conjugate(at.quaternion()), [0.0, 0.0, 1.0]);
        close("vertical in the body", &at.vector("Gamma"), &vertical, 1e-11);
        least = least.min(at.get("Gamma3"));
    });
    assert!(least < 0.5, "the top moves");
}

#[test]
fn the_attitude_of_a_rolling_ball_turns_about_a_fixed_axis_in_space() {
    let scene = build("rolling_ball", scene::RECONSTRUCTION);
    let (r, vx, vy, spin) = (0.3, 0.4, -0.3, 2.0);
    let xi = [-vy / r, vx / r, spin];
    let start = rotation_by([0.3, -0.5, 1.1]);
    let names = ["a1", "a2", "a1_dot", "a2_dot", "xi3", "qw", "qx", "qy", "qz"];
    let values = [[0.0, 0.1, vx, vy, spin].as_slice(), &start].concat();
    let initial: Vec<(&str, f64)> = names.into_iter().zip(values).collect();
    follow(&scene, &[("r", r)], &initial, &times(6.0, 24), |at| {
        // R(t) = exp(t xi) R(0): the turn stands left of the start.
        let turn = rotation_by(xi.map(|x| x * at.t));
        close("attitude", &at.quaternion(), &quaternion_product(turn, start), 1e-11);
        let norm: f64 = at.quaternion().iter().map(|a| a * a).sum();
        close("norm of the quaternion", &[norm.sqrt()], &[1.0], 1e-11);
        close("place", &[at.get("a1"), at.get("a2")], &[vx * at.t, 0.1 + vy * at.t], 1e-11);
        if at.t > 1.0 {
            let wrong = quaternion_product(start, turn);
            let distance: f64 = wrong.iter().zip(at.quaternion()).map(|(a, b)| (a - b).abs()).sum();
            assert!(distance > 1e-3, "the turn does not commute with the start");
        }
    });
}

#[test]
fn the_attitude_of_every_model_keeps_its_norm() {
    for (name, state) in [
        ("suslov", vec![("Omega1", 1.7), ("Omega2", -1.3)]),
        (
            "servo_ball",
            vec![
                ("a1", 0.5),
                ("a2", -0.2),
                ("a1_dot", 0.3),
                ("a2_dot", 0.4),
                ("xi1", 0.2),
                ("xi2", -0.5),
                ("xi3", 0.8),
            ],
        ),
    ] {
        let q = rotation_by([0.2, 0.1, -0.4]);
        let attitude = ["qw", "qx", "qy", "qz"].into_iter().zip(q);
        let initial: Vec<(&str, f64)> = state.into_iter().chain(attitude).collect();
        follow(&build(name, scene::RECONSTRUCTION), &[], &initial, &times(4.0, 16), |at| {
            let norm: f64 = at.quaternion().iter().map(|a| a * a).sum();
            close(name, &[norm.sqrt()], &[1.0], 1e-11);
        });
    }
}

#[test]
fn a_connection_does_not_change_the_reconstructed_motion() {
    // Wong's particle in xi = v - A xdot, with the trivial connection: the same places and the same attitudes.
    for side in ["left", "right"] {
        let connected = models::text("wong_particle").replace("action left;", &format!("action {side};"));
        let trivial = connected
            .replace("velocity v in so(3);", "velocity xi in so(3);")
            .replace("connection v = ", "let v = xi + ")
            .replace("initial v = [0.5, -0.6, 0.8];", "");
        assert!(connected.contains("connection v = ") && trivial.contains("let v = xi + cross(x_dot, x)"));
        let [connected, trivial] = [connected, trivial].map(|text| {
            let model = spec::parse("wong_particle", &text).unwrap_or_else(|e| panic!("{e}"));
            scene::build(&model, scene::RECONSTRUCTION).unwrap_or_else(|e| panic!("{e}"))
        });
        let (x, x_dot, v) = ([1.0, 0.2, -0.3], [0.1, 0.9, 0.4], [0.5, -0.6, 0.8]);
        let size = x.iter().map(|a| a * a).sum::<f64>() + 0.25;
        let lift = [(1, 2), (2, 0), (0, 1)].map(|(i, j)| (x_dot[i] * x[j] - x_dot[j] * x[i]) / size);
        let xi = [0, 1, 2].map(|k| v[k] - lift[k]);
        let q = rotation_by([0.3, 0.2, -0.6]);
        let initial = |group: &str, velocity: [f64; 3]| {
            let names = ["x", "x_dot", group].into_iter().flat_map(|n| {
                [1, 2, 3].map(|k| match n.strip_suffix("_dot") {
                    Some(base) => format!("{base}{k}_dot"),
                    None => format!("{n}{k}"),
                })
            });
            let names: Vec<String> = names.chain(["qw", "qx", "qy", "qz"].map(str::to_owned)).collect();
            let values = [x.as_slice(), &x_dot, &velocity, &q].concat();
            names.into_iter().zip(values).collect::<Vec<_>>()
        };
        let on_the_way = times(5.0, 20);
        let mut expected = Vec::new();
        let start = initial("xi", xi);
        let start: Vec<(&str, f64)> = start.iter().map(|(n, v)| (n.as_str(), *v)).collect();
        follow(&trivial, &[], &start, &on_the_way, |at| expected.push((at.vector("x"), at.quaternion())));
        let start = initial("v", v);
        let start: Vec<(&str, f64)> = start.iter().map(|(n, v)| (n.as_str(), *v)).collect();
        let mut next = expected.iter();
        follow(&connected, &[], &start, &on_the_way, |at| {
            let (place, attitude) = next.next().expect("as many states as times");
            close(side, &at.vector("x"), place, 1e-10);
            close(side, &at.quaternion(), attitude, 1e-10);
        });
    }
}
