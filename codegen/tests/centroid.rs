//! All bodies together and inertias at frames: against sums over the bodies, differences of motions and rates with
//! forces; what cannot be said is refused; planted faults.

use hamel_codegen::scene::{self, BuiltScene, Made, build_tampered};
use hamel_codegen::spec::{self, Model, Want};
use hamel_program::program::Role;

use crate::named_frames::{params, state, values};

/// An arm with skew axes, a point mass on its end, and a weight that slides by a function of time.
const ARM: &str = "model arm {
    param l1 = 0.7 where l1 > 0;
    param l2 = 0.5 where l2 > 0;
    param m1 = 2 where m1 > 0;
    param m2 = 1 where m2 > 0;
    coordinate q1, q2, q3 in angle;
    input fx = 0; input fy = 0; input fz = 0;
    let R1 = rot(e3, q1);
    let R2 = R1*rot(e1, q2);
    let R3 = R2*rot([0, 3/5, 4/5], q3);
    let p2 = R1*[l1, 0, 0.1];
    let p3 = p2 + R2*[0, l2, 0.2];
    body A { mass m1; place p2; inertia diag([0.1, 0.2, 0.3]); attitude R2; }
    body B { mass m2; place p3; inertia [[0.1, 0.01, 0], [0.01, 0.2, 0.02], [0, 0.02, 0.25]]; attitude R3; }
    body C { mass 0.3; place p3 + R3*[0.1, 0, 0.2]; }
    body D { mass 0.2; place [0.3*sin(t), 0, 0.1]; }
    lagrangian = A_energy + B_energy + C_energy - 9.81*(m1*p2[3] + m2*p3[3]);
    force q1_dot = -0.1*q1_dot;
    force at p3: [fx, fy, fz];
    frame elbow at p2 attitude R2;
    frame tip at p3 attitude R3;
    scene bodies { want rhs, center_of_mass, center_of_mass_jacobian, centroidal_momentum, centroidal_momentum_matrix; }
    scene wrench { want rhs, frames, operational_space; input fx, fy, fz; }
}";

/// A base that moves freely, with an arm on it.
const FLOATER: &str = "model floater {
    param m = 2 where m > 0;
    param n = 0.5 where n > 0;
    velocity Omega, V in se(3);
    coordinate phi in angle;
    let c = [cos(phi), sin(phi), 0.2];
    let w = Omega + [0, 0, phi_dot];
    let v = V + cross(Omega, c) + phi_dot*[-sin(phi), cos(phi), 0];
    lagrangian = dot(Omega, diag([0.2, 0.3, 0.4])*Omega)/2 + m/2*dot(V, V) + n/2*dot(v, v) + 0.05*dot(w, w)/2;
    reconstruct q, r in SE(3);
    frame base at r attitude q;
    frame hand on base at c attitude rot(e3, phi);
    body hull on base { mass m; place [0, 0, 0]; inertia diag([0.2, 0.3, 0.4]); }
    body arm on base { mass n; place c; inertia diag([0.05, 0.05, 0.05]); attitude rot(e3, phi); }
    scene bodies {
        want rhs, reconstruction, center_of_mass, center_of_mass_jacobian, centroidal_momentum,
            centroidal_momentum_matrix, momentum;
    }
    scene hands { want rhs, frame_jacobians, operational_space; }
}";

/// Rods in the plane.
const PLANAR: &str = "model rods {
    coordinate a, b in angle;
    let p = [sin(a), -cos(a)]/2;
    let r = 2*p + [sin(b), -cos(b)]/2;
    body one { mass 1.2; place p; inertia 0.1; attitude a; }
    body two { mass 0.7; place r; inertia 0.05; attitude b; }
    body wheel { inertia 0.02; attitude 3*a - b; }
    lagrangian = one_energy + two_energy + wheel_energy - 9.81*(1.2*p[2] + 0.7*r[2]);
    frame end at r attitude b;
    scene bodies {
        want rhs, center_of_mass, center_of_mass_jacobian, centroidal_momentum, centroidal_momentum_matrix,
            operational_space;
    }
}";

/// The same where a multiplier keeps the end on a line.
const KEPT: &str = "model kept {
    coordinate a, b in angle;
    let p = [sin(a), -cos(a)]/2;
    let r = 2*p + [sin(b), -cos(b)]/2;
    body one { mass 1.2; place p; inertia 0.1; attitude a; }
    body two { mass 0.7; place r; inertia 0.05; attitude b; }
    lagrangian = one_energy + two_energy;
    constraint line: cos(a) * a_dot + cos(b) * b_dot = 0;
    multipliers;
    frame end at r attitude b;
    frame middle at p attitude a;
    scene held { want rhs, frame_jacobians, operational_space; }
}";

fn parsed(text: &str) -> Model {
    spec::parse("centroid.hamel", text).unwrap_or_else(|problems| panic!("{problems}"))
}

fn built(text: &str, name: &str) -> BuiltScene {
    let scene = scene::build(&parsed(text), name).unwrap_or_else(|problems| panic!("{problems}"));
    assert!(scene.certificate().open.is_empty(), "{:?}", scene.certificate());
    scene
}

fn matrix(scene: &BuiltScene, want: Want, t: f64, y: &[f64]) -> Vec<Vec<f64>> {
    let executable = scene.executable();
    let prepared = executable.prepare(&params(scene)).expect("default parameters");
    prepared.matrix_of(want, t, y).unwrap_or_else(|| panic!("no {}", want.name()))
}

fn rates(scene: &BuiltScene, t: f64, y: &[f64]) -> Vec<f64> {
    let mut dy = vec![0.0; y.len()];
    scene.prepare(&params(scene)).expect("default parameters").rhs(t, y, &mut dy);
    dy
}

fn times(matrix: &[Vec<f64>], v: &[f64]) -> Vec<f64> {
    matrix.iter().map(|row| row.iter().zip(v).map(|(a, b)| a * b).sum()).collect()
}

fn close(found: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(found.len(), expected.len());
    for (k, (found, expected)) in found.iter().zip(expected).enumerate() {
        assert!((found - expected).abs() < tolerance, "component {k}: {found}, expected {expected}");
    }
}

/// The velocity is the rate of the place, and the linear momentum is that velocity times the mass.
#[test]
fn the_mass_centre_moves_with_its_velocity() {
    for (text, t, mass) in [(ARM, 0.3, 3.5), (FLOATER, 0.0, 2.5), (PLANAR, 0.0, 1.9)] {
        let scene = built(text, "bodies");
        let (y, h) = (state(&scene), 1e-6);
        let dy = rates(&scene, t, &y);
        let at = |s: f64| {
            let moved: Vec<f64> = y.iter().zip(&dy).map(|(y, dy)| y + s * dy).collect();
            values(&scene, "center_of_mass", t + s, &moved)
        };
        let centre = at(0.0);
        let rate: Vec<f64> = at(h).iter().zip(&at(-h)).map(|(a, b)| (a - b) / (2.0 * h)).collect();
        close(&centre[3..], &rate[..3], 1e-8);
        let momentum = values(&scene, "centroidal_momentum", t, &y);
        let linear: Vec<f64> = centre[3..].iter().map(|v| mass * v).collect();
        close(&momentum[3..], &linear, 1e-13);
    }
}

/// `c' = J u` and `h = A u` where nothing depends on time; what a velocity adds, where something does.
#[test]
fn jacobians_are_those_of_velocity_and_momentum() {
    for (text, t, n) in [(ARM, 0.3, 3), (FLOATER, 0.0, 7), (PLANAR, 0.0, 2)] {
        let scene = built(text, "bodies");
        let y = state(&scene);
        let names = scene.state_names();
        let velocities: Vec<usize> = (0..names.len())
            .filter(|k| {
                names[*k].ends_with("_dot") || names[*k].starts_with("Omega") || names[*k].starts_with('V')
            })
            .collect();
        assert_eq!(velocities.len(), n);
        let mut still = y.clone();
        velocities.iter().for_each(|k| still[*k] = 0.0);
        let u: Vec<f64> = velocities.iter().map(|k| y[*k]).collect();
        for (values_of, jacobian, from) in [
            ("center_of_mass", Want::CenterOfMassJacobian, 3),
            ("centroidal_momentum", Want::CentroidalMomentumMatrix, 0),
        ] {
            let [moving, resting] = [&y, &still].map(|y| values(&scene, values_of, t, y)[from..].to_vec());
            let added: Vec<f64> = moving.iter().zip(&resting).map(|(a, b)| a - b).collect();
            close(&times(&matrix(&scene, jacobian, t, &y), &u), &added, 1e-13);
            assert_eq!(resting.iter().any(|x| *x != 0.0), text == ARM);
        }
    }
}

/// Of a free system in space both momenta follow from the Lagrangian, turned and moved to the mass centre.
#[test]
fn momenta_of_a_free_system_follow_from_its_lagrangian() {
    let scene = built(FLOATER, "bodies");
    let y = state(&scene);
    let names = scene.state_names();
    let of = |name: &str| y[names.iter().position(|own| own == name).unwrap_or_else(|| panic!("no {name}"))];
    let [w, a, b, c] = ["qw", "qx", "qy", "qz"].map(of);
    let r = [
        [1.0 - 2.0 * (b * b + c * c), 2.0 * (a * b - c * w), 2.0 * (a * c + b * w)],
        [2.0 * (a * b + c * w), 1.0 - 2.0 * (a * a + c * c), 2.0 * (b * c - a * w)],
        [2.0 * (a * c - b * w), 2.0 * (b * c + a * w), 1.0 - 2.0 * (a * a + b * b)],
    ];
    let turned = |v: &[f64]| [0, 1, 2].map(|i: usize| (0..3).map(|j| r[i][j] * v[j]).sum::<f64>());
    let momentum = scene.outputs().iter().find(|o| o.name == "momentum").expect("wanted");
    let p = values(&scene, "momentum", 0.0, &y);
    let along = |stem: &str| -> Vec<f64> {
        let names: Vec<&str> = momentum.components.iter().map(|(name, _)| name.as_str()).collect();
        (1..=3).map(|k| p[names.iter().position(|n| *n == format!("p_{stem}{k}")).expect(stem)]).collect()
    };
    let (l, about_base) = (turned(&along("V")), turned(&along("Omega")));
    let centre = values(&scene, "center_of_mass", 0.0, &y);
    let arm: Vec<f64> = (0..3).map(|k| centre[k] - of(["r1", "r2", "r3"][k])).collect();
    let k = [0, 1, 2].map(|k: usize| {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        about_base[k] - (arm[i] * l[j] - arm[j] * l[i])
    });
    close(&values(&scene, "centroidal_momentum", 0.0, &y), &[k, l].concat(), 1e-13);
}

/// A force at the tip changes the rate of the tip's twist by the response, in the axes of the tip.
#[test]
fn a_wrench_is_answered_as_the_matrix_says() {
    let scene = built(ARM, "wrench");
    let y = state(&scene);
    let response = matrix(&scene, Want::OperationalSpace, 0.0, &y);
    assert_eq!((response.len(), response[0].len()), (12, 6));
    let jacobian = matrix(&scene, Want::FrameJacobians, 0.0, &y);
    let rotation = values(&scene, "frame_poses", 0.0, &y)[15..24].to_vec();
    let force = [0.3, -1.2, 0.7];
    let rates = |held: [f64; 3]| {
        let executable = scene.executable();
        let mut interpreter = executable.prepare(&params(&scene)).expect("default parameters");
        interpreter.set_inputs(&held);
        let mut dy = vec![0.0; y.len()];
        interpreter.rhs(0.0, &y, &mut dy);
        dy[3..].to_vec()
    };
    let added: Vec<f64> = rates(force).iter().zip(&rates([0.0; 3])).map(|(a, b)| a - b).collect();
    let own: Vec<f64> = (0..3).map(|j| (0..3).map(|i| rotation[3 * i + j] * force[i]).sum()).collect();
    let wrench = [vec![0.0; 3], own].concat();
    close(&times(&response[6..], &wrench), &times(&jacobian[6..], &added), 1e-12);
    for frame in response.chunks(6) {
        (0..6).for_each(|i| (0..6).for_each(|j| assert_eq!(frame[i][j], frame[j][i])));
    }
}

/// An answer to a wrench keeps the constraint, and no wrench along the line that is kept is answered.
#[test]
fn multipliers_answer_to_a_wrench() {
    let scene = built(KEPT, "held");
    let y = state(&scene);
    let response = matrix(&scene, Want::OperationalSpace, 0.0, &y);
    let jacobian = matrix(&scene, Want::FrameJacobians, 0.0, &y);
    // One freedom is left: rates along `(cos b, -cos a)`, which has to be in proportion to every column.
    let direction = times(&jacobian[..6], &[y[1].cos(), -y[0].cos()]);
    let largest = (0..6).max_by(|i, j| direction[*i].abs().total_cmp(&direction[*j].abs())).expect("six");
    for j in 0..6 {
        let column: Vec<f64> = (0..6).map(|i| response[i][j]).collect();
        let expected: Vec<f64> = direction.iter().map(|d| column[largest] * d / direction[largest]).collect();
        close(&column, &expected, 1e-13);
    }
    assert!(response[largest][largest] > 0.01);
}

/// Rows of the mass matrix and forces along quasi-velocities are along these, not along the rates of coordinates.
#[test]
fn forces_along_quasi_velocities_are_held_to_the_model() {
    let text = "model turned {
        coordinate r in (0, 100);
        coordinate phi in angle;
        frame { u = r_dot; v = r*phi_dot; }
        lagrangian = (u^2 + 2*v^2)/2 + 2/r;
        force phi_dot = -0.1*r^2*phi_dot;
        frame tip at [r*cos(phi), r*sin(phi)] attitude phi;
        scene s { want rhs, mass_matrix, inverse_dynamics, bias, operational_space; }
    }";
    let scene = built(text, "s");
    let y = [1.5, 0.3, 0.2, -0.7];
    assert_eq!(matrix(&scene, Want::MassMatrix, 0.0, &y), [[1.0, 0.0], [0.0, 2.0]]);
    // Along the tip's own axes: radial, and across.
    let response = matrix(&scene, Want::OperationalSpace, 0.0, &y);
    close(&[response[3][3], response[4][4], response[2][2]], &[1.0, 0.5, 0.5 / 2.25], 1e-14);
}

#[test]
fn faults_in_bodies_are_found() {
    for (text, scene, groups) in [
        (
            ARM,
            "bodies",
            &[
                "center_of_mass",
                "center_of_mass_jacobian",
                "centroidal_momentum",
                "centroidal_momentum_matrix",
            ][..],
        ),
        (ARM, "wrench", &["operational_space"]),
        (KEPT, "held", &["operational_space"]),
    ] {
        let model = parsed(text);
        assert!(build_tampered(&model, scene, &|_| {}).is_ok());
        for group in groups {
            let role = Role::Output((*group).into());
            let exchanged = |made: Made<'_>| {
                let Made::Program(program) = made else { return };
                let function = program.functions.iter_mut().find(|f| f.role == role).expect("wanted");
                let n = function.results.len();
                let a = (0..n).find(|k| function.results[*k].1 != function.results[n - 1].1).expect("others");
                let (one, other) = (function.results[a].1, function.results[n - 1].1);
                (function.results[a].1, function.results[n - 1].1) = (other, one);
            };
            let problems = build_tampered(&model, scene, &exchanged).expect_err(group).to_string();
            assert!(problems.contains(group), "{problems}");
        }
    }
    // A momentum that the model itself has wrong is not that of its bodies.
    let mut wrong = parsed(ARM);
    let momentum = wrong.outputs.iter_mut().find(|o| o.name == "centroidal_momentum").expect("bodies");
    momentum.components[0].1 = momentum.components[1].1;
    let problems = scene::build(&wrong, "bodies").expect_err("refused").to_string();
    assert!(problems.contains("centroidal_momentum") && problems.contains("of the bodies"), "{problems}");
    // As is its Jacobian alone, without the momentum.
    let text = ARM.replace("center_of_mass, center_of_mass_jacobian, centroidal_momentum, ", "");
    let mut wrong = parsed(&text);
    let momentum = wrong.outputs.iter_mut().find(|o| o.name == "centroidal_momentum").expect("bodies");
    momentum.components[0].1 = momentum.components[1].1;
    let problems = scene::build(&wrong, "bodies").expect_err("refused").to_string();
    assert!(problems.contains("centroidal_momentum_matrix"), "{problems}");
}

#[test]
fn wrong_bodies_are_told_with_the_fix() {
    let told = |items: &str, wants: &str| {
        let text = format!(
            "model m {{ param m = 1; coordinate x in real; velocity Omega, V in se(3); lagrangian = x_dot^2 + \
             dot(Omega, Omega) + dot(V, V); reconstruct q, r in SE(3); {items} scene s {{ want rhs, {wants}; }} }}"
        );
        match spec::parse("m.hamel", &text) {
            Err(problems) => problems.to_string(),
            Ok(model) => scene::build(&model, "s").expect_err(items).to_string(),
        }
    };
    let here = "frame base at r attitude q; body B on base { mass 2; place [x, 0, 0]; }";
    for (items, wants, expected) in [
        ("", "center_of_mass", "no body with a mass"),
        ("", "operational_space", "no named frame"),
        ("body B { inertia 1; attitude x; }", "centroidal_momentum", "no body with a mass"),
        ("body B { mass m; place [x, 0, 0]; }", "center_of_mass", "whose mass is not seen to be positive"),
        ("body B { mass 1; place x; }", "center_of_mass", "must be a place, vector(3) or vector(2)"),
        (
            "body B on c { mass 1; place [x, 0, 0]; }",
            "rhs",
            "body `B` is on `c`, which is no frame before it",
        ),
        ("body B on { mass 1; place [x, 0, 0]; }", "rhs", "the name of a frame"),
        ("frame c; body B on c { mass [1, 2]; place [x, 0, 0]; }", "rhs", "a mass is a number"),
        ("frame c; body B on c { inertia [1, 2]; }", "rhs", "the inertia has to be matrix(3, 3)"),
        ("frame c; body B on c { place [x, 0, 0]; }", "rhs", "a place and no mass"),
        (here, "center_of_mass", "add `want reconstruction;`"),
        (here, "center_of_mass_jacobian", "add `want reconstruction;`"),
        (here, "centroidal_momentum_matrix", "add `want reconstruction;`"),
        (
            "output center_of_mass_p1 = x; body B { mass 1; place [x, 0, 0]; }",
            "center_of_mass",
            "which is an output",
        ),
    ] {
        let problems = told(items, wants);
        assert!(problems.contains(expected), "{items}: {problems}");
    }
}
