//! Rotations, bodies, and forces at places, against the same written out by hand.

use hamel_codegen::spec::{self, Model};
use hamel_expr::{ExprId, Style};

fn parsed(text: &str) -> Model {
    spec::parse("body.hamel", text).unwrap_or_else(|problems| panic!("{problems}"))
}

/// Whether two expressions of one model are the same function.
fn same(model: &mut Model, a: ExprId, b: ExprId) -> bool {
    let difference = model.graph.sub(a, b);
    model.graph.is_zero(difference)
}

/// Every output of a model beside the one of the same name with `_by_hand`.
fn outputs_agree(text: &str, least: usize) {
    let mut model = parsed(text);
    let outputs = model.outputs.clone();
    let mut n = 0;
    for by_hand in outputs.iter().filter(|o| o.name.ends_with("_by_hand")) {
        let name = by_hand.name.trim_end_matches("_by_hand");
        let found = outputs.iter().find(|o| o.name == name).unwrap_or_else(|| panic!("no output {name}"));
        assert_eq!(found.components.len(), by_hand.components.len(), "{name}");
        for ((_, a), (component, b)) in found.components.iter().zip(&by_hand.components) {
            assert!(same(&mut model, *a, *b), "{component} is another function");
            n += 1;
        }
    }
    assert!(n >= least, "only {n} components");
}

#[test]
fn a_rotation_turns_about_its_axis() {
    outputs_agree(
        "model m {
            coordinate x in angle;
            lagrangian = x_dot^2;
            output a = rot(e3, x)*[1, 0, 0];
            output a_by_hand = [cos(x), sin(x), 0];
            output b = rot(e1, x)*[0, 1, 0];
            output b_by_hand = [0, cos(x), sin(x)];
            output c = rot(e2, x)*[0, 0, 1];
            output c_by_hand = [sin(x), 0, cos(x)];
            output d = rot([2/3, 1/3, 2/3], x)*[2, 1, 2];
            output d_by_hand = [2, 1, 2];
            let R = rot([3/5, 0, 4/5], x);
            output e = [det(R), trace(R), sum(R*transpose(R)*[1, 1, 1])];
            output e_by_hand = [1, 1 + 2*cos(x), 3];
            output f = rot(x)*[0, 1];
            output f_by_hand = [-sin(x), cos(x)];
        }",
        17,
    );
}

/// Euler angles of the sequence 3-1-3.
///
/// # Source
/// Goldstein, Poole and Safko 2002, Classical Mechanics, (4.87).
#[test]
fn the_spin_of_euler_angles_is_the_printed_one() {
    outputs_agree(
        "model m {
            coordinate phi, theta, psi in angle;
            lagrangian = phi_dot^2 + theta_dot^2 + psi_dot^2;
            let R = rot(e3, phi)*rot(e1, theta)*rot(e3, psi);
            output w = spin(R);
            output w_by_hand = [
                phi_dot*sin(theta)*sin(psi) + theta_dot*cos(psi),
                phi_dot*sin(theta)*cos(psi) - theta_dot*sin(psi),
                phi_dot*cos(theta) + psi_dot
            ];
            // The same without knowing that the matrix is a product.
            output v = spin([R[1], R[2], R[3]]);
            output v_by_hand = w_again;
            let w_again = spin(R);
            // In space, and of the inverse: the axial vector of R' R^T.
            output s = -spin(transpose(R));
            output s_by_hand = R*spin(R);
            output hat_w = transpose(R)*rate(R)*[1, 2, 3];
            output hat_w_by_hand = cross(spin(R), [1, 2, 3]);
        }",
        12,
    );
}

#[test]
fn a_body_has_the_energy_of_its_parts() {
    outputs_agree(
        "model m {
            param m = 2;
            param I: diagonal(3) = [1, 2, 3];
            param l = 0.5;
            coordinate q: vector(2) in angle;
            coordinate z in real;
            let R = rot(e3, q1)*rot(e2, q2);
            let p = R*[0, 0, l] + [0, 0, z];
            body b { mass m; place p; inertia I; attitude R; }
            lagrangian = b_energy;
            output energy_of = [b_energy];
            output energy_of_by_hand = [m/2*dot(rate(p), rate(p)) + dot(w, I*w)/2];
            let w = [-sin(q2)*q1_dot, q2_dot, cos(q2)*q1_dot];
            output spin_of = b_spin;
            output spin_of_by_hand = w;
            output momenta_of = b_momentum + R*b_angular_momentum;
            output momenta_of_by_hand = m*rate(p) + R*(I*w);

            body flat { mass 1; place [z, 2*z]; inertia 3; attitude q1; }
            body point { mass 1; place z; }
            output flat_of = [flat_energy, flat_spin, point_energy];
            output flat_of_by_hand = [5*z_dot^2/2 + 3*q1_dot^2/2, q1_dot, z_dot^2/2];
        }",
        10,
    );
}

/// Forces of a model beside those of the same model with forces on its velocities: each less the other is zero.
fn forces_agree(text: &str, placed: &str, by_hand: &str) {
    let other = parsed(&format!("model m {{ {text} {by_hand} }}"));
    let velocities = other.all_velocities();
    let mut less = String::new();
    for (force, (velocity, _)) in other.forces.iter().zip(&velocities) {
        let opposite = format!("-({})", other.graph.display(*force, Style::Plain));
        less += &format!("force along {velocity}: {opposite}; ");
    }
    let found = parsed(&format!("model m {{ {text} {placed} }}"));
    assert_eq!(found.forces.len(), other.forces.len());
    assert!(
        found.forces.iter().any(|f| !found.graph.free_symbols(*f).is_empty()),
        "no force depends on anything"
    );
    let mut both = parsed(&format!("model m {{ {text} {placed} {less} }}"));
    for (k, force) in both.forces.clone().into_iter().enumerate() {
        let shown = both.graph.display(force, Style::Plain);
        assert!(both.graph.is_zero(force), "force on {} differs by {shown}", velocities[k].0);
    }
}

#[test]
fn a_force_at_a_place_is_projected_by_partial_velocities() {
    forces_agree(
        "param l = 0.7; coordinate q: vector(2) in angle; coordinate z in real;
         lagrangian = q1_dot^2 + q2_dot^2 + z_dot^2;
         let p = [l*cos(q1) + l*cos(q1 + q2), l*sin(q1) + l*sin(q1 + q2) + z + t^2];",
        "force at p: [3*z_dot, -2];",
        "force q1_dot = 3*z_dot*(-l*sin(q1) - l*sin(q1 + q2)) - 2*(l*cos(q1) + l*cos(q1 + q2));
         force q2_dot = -3*z_dot*l*sin(q1 + q2) - 2*l*cos(q1 + q2);
         force z_dot = -2;",
    );
}

/// Friction at a place of a body that its coordinates do not know: by velocities of the group.
#[test]
fn a_force_along_a_velocity_of_the_group_is_projected() {
    forces_agree(
        "param c = 0.3; param a = 0.4; velocity omega, v in se(2); lagrangian = omega^2 + dot(v, v);
         let u = v + omega*[0, a];",
        "force along u: -c*u; force along omega: -c*omega; force v1 = 2;",
        "force omega = -c*a*(v2 + a*omega) - c*omega; force v = [2 - c*v1, -c*(v2 + a*omega)];",
    );
}

/// In a frame, forces are those on its velocities.
#[test]
fn a_force_at_a_place_knows_the_frame() {
    forces_agree(
        "param r = 0.3; coordinate x, phi in real; frame { u = x_dot; s = x_dot - r*phi_dot; }
         lagrangian = x_dot^2 + phi_dot^2;",
        "force at x + phi^2: 5*x;",
        "force u = 5*x*(1 + 2*phi/r); force s = -5*x*2*phi/r;",
    );
}

#[test]
fn a_moment_on_a_body_turns_it() {
    forces_agree(
        "param I: diagonal(3) = [1, 2, 3]; coordinate a, b in angle;
         body top { inertia I; attitude rot(e3, a)*rot(e1, b); } lagrangian = top_energy;",
        "moment on top: [1, a_dot, 2];",
        "force a_dot = a_dot*sin(b) + 2*cos(b); force b_dot = 1;",
    );
}

/// A chain of bodies in a loop, each by the one before.
#[test]
fn bodies_of_a_loop_are_members_of_a_family() {
    let text = "model chain {
        size n = 3;
        param m: vector(n) = [k for k in 1..n];
        param J = 0.1;
        param l = 0.5;
        coordinate q: vector(n) in angle;
        let end[0] = [0, 0];
        for k in 1..n {
            let axis[k] = [cos(q[k]), sin(q[k])];
            let end[k] = end[k - 1] + l*axis[k];
            body rod[k] { mass m[k]; place end[k - 1] + l/2*axis[k]; inertia J; attitude q[k]; }
            moment on rod[k]: -0.1*rod_spin[k];
            force at end[k]: [0, -9.81*k];
        }
        lagrangian = sum(rod_energy[k] for k in 1..n);
        output total = [sum(rod_energy[k] for k in 1..n)];
        output total_by_hand = [sum(
            m[k]/2*((sum(-l*sin(q[i])*q_dot[i] for i in 1..k - 1) - l/2*sin(q[k])*q_dot[k])^2
                + (sum(l*cos(q[i])*q_dot[i] for i in 1..k - 1) + l/2*cos(q[k])*q_dot[k])^2)
            + J/2*q_dot[k]^2
            for k in 1..n
        )];
    }";
    outputs_agree(text, 1);
    assert_eq!(parsed(text).forces.len(), 3);
}

#[test]
fn lengths_are_smooth_with_a_second_argument() {
    outputs_agree(
        "model m {
            param eps = 0.1;
            coordinate x: vector(3) in real;
            lagrangian = dot(x_dot, x_dot);
            output a = [norm(x, eps)];
            output a_by_hand = [sqrt(x1^2 + x2^2 + x3^2 + eps^2)];
            output b = unit(x);
            output b_by_hand = x/norm(x);
            output c = unit(x, eps);
            output c_by_hand = x/sqrt(x1^2 + x2^2 + x3^2 + eps^2);
        }",
        7,
    );
}

#[test]
fn bodies_are_pictured_where_there_is_no_view() {
    let text = |more: &str| {
        format!(
            "model two {{
                param m = 2 where m > 0;
                coordinate phi, theta in angle;
                let R = rot(e3, phi)*rot(e1, theta);
                /// A solid body.
                body solid {{ mass m; place R*[0, 0, 1]; inertia diag([0.5, 1, 1.3]); attitude R; }}
                body tip {{ mass 1; place R*[0, 0, 2]; }}
                body wheel {{ inertia diag([1, 1, 2]); attitude R; }}
                lagrangian = solid_energy + tip_energy + wheel_energy;
                {more}
            }}"
        )
    };
    let parsed = |more: &str| spec::parse("two.hamel", &text(more)).unwrap_or_else(|e| panic!("{e}"));
    let views = parsed("").views;
    let names: Vec<(&str, &str)> = views.list.iter().map(|v| (v.name.as_str(), v.doc.as_str())).collect();
    assert_eq!(names, [("solid", "A solid body."), ("tip", "")]);
    let value = |name: &str| match name {
        "phi" => Some(0.0),
        "theta" => Some(std::f64::consts::FRAC_PI_2),
        "m" => Some(2.0),
        _ => None,
    };
    let numbers = views.numbers_at(&views.list[0], value).unwrap();
    // m/12 (b^2 + c^2) = 0.5 and so on: a^2 = 5.4, b^2 = 2.4, c^2 = 0.6; e3 has turned to -e2.
    for (found, expected) in
        numbers[..6].iter().zip([5.4_f64.sqrt(), 2.4_f64.sqrt(), 0.6_f64.sqrt(), 0.0, -1.0, 0.0])
    {
        assert!((found - expected).abs() < 1e-15, "{numbers:?}");
    }
    let tip = views.numbers_at(&views.list[1], value).unwrap();
    assert!((tip[1] + 2.0).abs() < 1e-15, "{tip:?}");
    // A view says what is to be seen.
    assert_eq!(parsed("view end = point(R*[0, 0, 2]);").views.list.len(), 1);
    let plane = "model rod {
        coordinate phi in angle;
        let p = [sin(phi), -cos(phi)];
        body rod { mass 4; place p; inertia 0.5; attitude phi; }
        lagrangian = rod_energy - 4*9.81*p[2];
    }";
    let views = spec::parse("rod.hamel", plane).unwrap().views;
    let numbers = views.numbers_at(&views.list[0], |_| Some(0.0)).unwrap();
    assert_eq!(numbers[0], 0.5);
}
