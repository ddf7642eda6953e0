//! Connections, displacements, accelerations, quasi-velocities, reconstruction and initial values.

use expect_test::{Expect, expect};

use super::bad::check;
use hamel_codegen::spec::{
    ConstraintKind, Group, Model, ModelBuilder, ReconstructionKind, Value, Wanted, parse,
};
use hamel_expr::{ExprId, Rational, Style};
use hamel_lang::algebra::LieAlgebra;

#[track_caller]
fn model(items: &str) -> Model {
    match parse("motion.hamel", &format!("model m {{ {items} }}")) {
        Ok(model) => model,
        Err(problems) => panic!("{problems}"),
    }
}

/// Asserts that the entries are those of the output `name`.
#[track_caller]
fn assert_entries(model: &mut Model, found: &[ExprId], name: &str) {
    let output = model.outputs.iter().find(|o| o.name == name).expect("an output of that name");
    let expected: Vec<ExprId> = output.components.iter().map(|(_, e)| *e).collect();
    assert_eq!(found.len(), expected.len(), "entries of {name}");
    for (k, (f, e)) in found.iter().zip(expected).enumerate() {
        assert!(model.graph.is_equal(*f, e), "entry {} of {name}", k + 1);
    }
}

#[test]
fn a_connection_is_a_matrix_over_algebra_and_base() {
    let mut m = model(
        "param rho = 0.5; coordinate x: vector(3) in real; velocity v in so(3); \
         connection v = cross(x_dot, x)/(dot(x, x) + rho^2); lagrangian = dot(v, v) + dot(x_dot, x_dot); \
         let d = dot(x, x) + rho^2; output A = [[0, x3/d, -x2/d], [-x3/d, 0, x1/d], [x2/d, -x1/d, 0]]; \
         reconstruct q in SO(3); output xi = v - cross(x_dot, x)/d;",
    );
    let a: Vec<ExprId> = m.connection.clone().unwrap().into_iter().flatten().collect();
    assert_entries(&mut m, &a, "A");
    // The group velocity is v - A xdot.
    let ReconstructionKind::Quaternion { omega } = m.reconstruction[0].kind.clone() else { panic!("SO(3)") };
    assert_entries(&mut m, &omega, "xi");
    assert_eq!(m.reconstruction[0].names, ["qw", "qx", "qy", "qz"]);
}

#[test]
fn a_connection_on_one_component_leaves_the_others_trivial() {
    let mut m = model(
        "param c = 2; coordinate a, b in real; velocity omega, v in se(2); connection v2 = c*sin(a)*b_dot; \
         connection omega = 0; lagrangian = omega^2; output A = [[0, 0], [0, 0], [0, c*sin(a)]];",
    );
    let a: Vec<ExprId> = m.connection.clone().unwrap().into_iter().flatten().collect();
    assert_entries(&mut m, &a, "A");
    assert_eq!(model("velocity Omega in so(3); lagrangian = Omega1^2;").connection, None);
}

#[test]
fn a_connection_may_depend_on_time() {
    let mut m = model(
        "coordinate q in real; velocity O in so(3); lagrangian = O1^2; connection O1 = t*q*q_dot; output A = [[t*q], [0], [0]];",
    );
    let a: Vec<ExprId> = m.connection.clone().unwrap().into_iter().flatten().collect();
    assert_entries(&mut m, &a, "A");
}

#[test]
fn bad_connections() {
    check(
        r#"model m { coordinate q in real; velocity O in so(3); lagrangian = O1^2; connection W = 0; }"#,
        expect![[r#"1:84 `W` is not a velocity of the algebra [legal here: `O`, `O1`, `O2`, `O3`]"#]],
    );
    check(
        r#"model m { coordinate q in real; velocity O in so(3); lagrangian = O1^2; connection q_dot = 0; }"#,
        expect![[r#"1:84 `q_dot` is not a velocity of the algebra [legal here: `O`, `O1`, `O2`, `O3`]"#]],
    );
    check(
        r#"model m { coordinate q in real; velocity O in so(3); lagrangian = O1^2; connection O = q_dot; }"#,
        expect![[r#"1:84 connection on `O` must be vector(3), found a number [it has the same components]"#]],
    );
    check(
        r#"model m { coordinate q in real; velocity O in so(3); lagrangian = O1^2; connection O1 = q_dot^2; }"#,
        expect![[
            r#"1:84 connection on `O1` is not linear in the base velocities [the base velocities are `q_dot`]"#
        ]],
    );
    check(
        r#"model m { coordinate q in real; velocity O in so(3); lagrangian = O1^2; connection O1 = q_dot + 1; }"#,
        expect![[
            r#"1:84 connection on `O1` is not linear in the base velocities [the base velocities are `q_dot`]"#
        ]],
    );
    check(
        r#"model m { coordinate q in real; velocity O in so(3); lagrangian = O1^2; connection O1 = O2; }"#,
        expect![[
            r#"1:84 connection on `O1` contains `O2` [it is made of base velocities, base coordinates, time and parameters]"#
        ]],
    );
    check(
        r#"model m { coordinate q in real; velocity O in so(3); advected G in R by O1; lagrangian = O1^2; connection O1 = G*q_dot; }"#,
        expect![[
            r#"1:107 connection on `O1` contains `G` [it is made of base velocities, base coordinates, time and parameters]"#
        ]],
    );
    check(
        r#"model m { coordinate q in real; velocity O in so(3); lagrangian = O1^2; connection O = 0; connection O1 = q_dot; }"#,
        expect![[r#"1:102 connection on `O1` is given twice [keep one of them]"#]],
    );
    check(
        r#"model m { velocity O in so(3); lagrangian = O1^2; connection O = 0; }"#,
        expect![[r#"1:62 connection on `O` without a base has no use [declare the base with `coordinate`]"#]],
    );
    check(
        r#"model m { velocity O in so(3); lagrangian = O1^2; connection O; }"#,
        expect![
            "1:63 expected `=`, found `;` [written as `connection Omega = A*x_dot;` or `connection mechanical;`]"
        ],
    );
}

#[test]
fn displacements_of_the_skew_sleigh() {
    let mut m = model(
        "param tau = 0.15; param mu = 0.25; velocity omega, v in se(2); lagrangian = omega^2 + dot(v, v); \
         constraint v2 = 0; virtual tau*delta(omega) + mu*delta(v1) + delta(v2) = 0; output f = [tau, mu, 1];",
    );
    let condition = m.virtual_constraints[0].clone();
    assert_eq!(condition.name, "d1");
    assert_eq!(condition.text, "tau*delta(omega) + mu*delta(v1) + delta(v2) = 0");
    assert_entries(&mut m, &condition.one_form, "f");
    assert_eq!(m.constraints[0].kind, ConstraintKind::Linear);
}

const SERVO: &str =
    "param kappa = 1.5; param c = 0.2; coordinate a: vector(2) in real; velocity xi in so(3); \
     action right; lagrangian = dot(a_dot, a_dot) + dot(xi, xi);
     constraint servo: ddt(a1_dot) + ddt(xi3) + kappa*a1 + c*a1_dot = 0; \
     virtual dot([1, xi3], delta(a_dot)) + dot([a2_dot, 0, 1 + a1^2], delta(xi)) = 0;";

#[test]
fn displacements_and_accelerations_of_the_servo_ball() {
    let mut m = model(&format!(
        "{SERVO} output f = [1, xi3, a2_dot, 0, 1 + a1^2]; output w = [1, 0, 0, 0, 1]; output w0 = kappa*a1 + c*a1_dot;"
    ));
    let one_form = m.virtual_constraints[0].one_form.clone();
    assert_entries(&mut m, &one_form, "f");
    let servo = m.constraints[0].clone();
    assert_eq!(servo.name, "servo");
    let ConstraintKind::SecondOrder { acceleration } = servo.kind else { panic!("{:?}", servo.kind) };
    assert_entries(&mut m, &acceleration, "w");
    assert_entries(&mut m, &[servo.residual], "w0");
}

#[test]
fn vector_equations_on_displacements_and_accelerations() {
    let m = model(
        "velocity O, V in se(3); lagrangian = dot(O, O); virtual slip: delta(V) = cross(delta(O), [0, 0, 1]); \
         constraint ddt(V) = 2*ddt(O) - O;",
    );
    let names: Vec<&str> = m.virtual_constraints.iter().map(|v| v.name.as_str()).collect();
    assert_eq!(names, ["slip1", "slip2", "slip3"]);
    let names: Vec<&str> = m.constraints.iter().map(|v| v.name.as_str()).collect();
    assert_eq!(names, ["c1", "c2", "c3"]);
    for (k, c) in m.constraints.iter().enumerate() {
        let ConstraintKind::SecondOrder { acceleration } = &c.kind else { panic!("{:?}", c.kind) };
        let numbers: Vec<i64> = acceleration
            .iter()
            .map(|e| m.graph.as_rational(*e).unwrap().to_integer().try_into().unwrap())
            .collect();
        let mut expected = [0; 6];
        (expected[k], expected[k + 3]) = (-2, 1);
        assert_eq!(numbers, expected);
    }
}

#[test]
fn bad_displacements() {
    check(
        r#"model m { velocity v in R^2; lagrangian = dot(v, v); virtual delta(v1)^2 = 0; }"#,
        expect![[
            r#"1:62 condition `delta(v1)^2 = 0` is not linear in the displacements [every term has one factor `delta(..)`]"#
        ]],
    );
    check(
        r#"model m { velocity v in R^2; lagrangian = dot(v, v); virtual delta(v1) = 1; }"#,
        expect![[
            r#"1:62 condition `delta(v1) = 1` is not linear in the displacements [every term has one factor `delta(..)`]"#
        ]],
    );
    check(
        r#"model m { velocity v in R^2; lagrangian = dot(v, v); virtual v1 = 0; }"#,
        expect![[
            r#"1:62 condition `v1 = 0` contains no displacement [write the displacement of a velocity `v` as `delta(v)`]"#
        ]],
    );
    check(
        r#"model m { velocity v in R^2; lagrangian = dot(v, v); virtual delta(v1) = delta(v1); }"#,
        expect![[r#"1:62 condition `delta(v1) = delta(v1)` always holds [remove it]"#]],
    );
    check(
        r#"model m { velocity v in R^2; lagrangian = dot(v, v); virtual delta(v) = [0, 0, 0]; }"#,
        expect![[r#"1:62 cannot equate vector(2) with vector(3) [both sides must have the same shape]"#]],
    );
    check(
        r#"model m { velocity v in R^2; lagrangian = dot(v, v); virtual delta(2*v1) = 0; }"#,
        expect![[
            r#"1:62 `delta` takes a velocity [name a velocity of the base or of the algebra: `delta(Omega)`, `delta(q_dot)`]"#
        ]],
    );
    check(
        r#"model m { velocity v in R^2; lagrangian = dot(v, v); virtual delta(v1, v2) = 0; }"#,
        expect!["1:62 `delta` takes 1 argument, found 2 [write `delta(x)`]"],
    );
    check(
        r#"model m { velocity v in R^2; lagrangian = dot(v, v); virtual delta = 0; }"#,
        expect![[r#"1:62 `delta` is a function [write `delta(..)`]"#]],
    );
    check(
        r#"model m { velocity v in R^2; lagrangian = dot(v, v); virtual delta(v1); }"#,
        expect![[
            r#"1:71 expected `=`, found `;` [a condition on displacements is an equation such as `delta(v1) + delta(v2) = 0`]"#
        ]],
    );
    check(
        r#"model m { velocity v in R^2; lagrangian = dot(v, v); virtual ddt(v1) + delta(v1) = 0; }"#,
        expect![[
            r#"1:62 condition `ddt(v1) + delta(v1) = 0` is not linear in the displacements [every term has one factor `delta(..)`]"#
        ]],
    );
    check(
        r#"model m { velocity v in R^2; lagrangian = dot(v, v); constraint delta(v1) = 0; }"#,
        expect![[
            r#"1:65 `delta` is not legal here [displacements belong in `virtual`, as in `virtual delta(v1) + delta(v2) = 0;`]"#
        ]],
    );
    check(
        r#"model m { velocity v in R^2; lagrangian = dot(v, v); let d = delta(v1); }"#,
        expect![[
            r#"1:62 `delta` is not legal here [displacements belong in `virtual`, as in `virtual delta(v1) + delta(v2) = 0;`]"#
        ]],
    );
    check(
        r#"model m { velocity v in R^2; quasi_velocity s; lagrangian = dot(v, v); virtual s*delta(v1) = 0; }"#,
        expect![[
            r#"1:80 condition `s*delta(v1) = 0` contains the quasi-velocity `s` [a quasi-velocity only parametrises linear constraints]"#
        ]],
    );
    check(
        r#"model m { velocity v in R^2; quasi_velocity s; lagrangian = dot(v, v); virtual delta(s) = 0; }"#,
        expect![[
            r#"1:80 `delta` takes a velocity [name a velocity of the base or of the algebra: `delta(Omega)`, `delta(q_dot)`]"#
        ]],
    );
    check(
        r#"model m { velocity v in R^2; lagrangian = dot(v, v); virtual c: delta(v1) = 0; virtual c: delta(v2) = 0; }"#,
        expect![[r#"1:91 condition `c` is declared twice [rename one of them]"#]],
    );
}

#[test]
fn nonlinear_constraints_are_chetaev_s() {
    let m = model(
        "param a = 2; coordinate z in real; velocity v in R^2; lagrangian = dot(v, v) + z_dot^2; \
         constraint z_dot^2 = a^2*dot(v, v); constraint v1 = z*v2 + t;",
    );
    assert_eq!(m.constraints[0].kind, ConstraintKind::Nonlinear);
    assert_eq!(m.constraints[1].kind, ConstraintKind::Linear);
}

#[test]
fn a_constraint_that_only_looks_nonlinear_is_linear() {
    let m = model("velocity v in R^2; lagrangian = dot(v, v); constraint (v1 + 1)^2 - v1^2 = v2;");
    assert_eq!(m.constraints[0].kind, ConstraintKind::Linear);
}

#[test]
fn bad_constraints() {
    check(
        r#"model m { param q = 1; coordinate x in real; lagrangian = x_dot^2; constraint q^2 = 1; }"#,
        expect![[
            r#"1:79 constraint `q^2 = 1` contains neither a velocity nor a coordinate [a condition on parameters is a `require`]"#
        ]],
    );
    check(
        r#"model m { velocity v in R^2; lagrangian = dot(v, v); constraint ddt(v1)^2 + v1 = 0; }"#,
        expect![[
            r#"1:65 constraint `ddt(v1)^2 + v1 = 0` is not affine in the accelerations [accelerations `ddt(v)` appear in the first power only]"#
        ]],
    );
    check(
        r#"model m { coordinate q in real; lagrangian = q_dot^2; constraint ddt(q) = 0; }"#,
        expect![[
            r#"1:66 `ddt` takes a velocity [name a velocity of the base or of the algebra: `ddt(Omega)`, `ddt(q_dot)`]"#
        ]],
    );
    check(
        r#"model m { velocity v in R^2; lagrangian = ddt(v1)^2; }"#,
        expect![[
            r#"1:43 `ddt` is not legal here [accelerations belong in `constraint`, as in `constraint ddt(v1) + v1 = 0;`]"#
        ]],
    );
    check(
        r#"model m { velocity v in R^2; lagrangian = dot(v, v); constraint v1^2 = 1; independent v2; }"#,
        expect![[
            r#"1:75 a nonlinear or higher-order constraint leaves all velocities in the state [remove `independent`]"#
        ]],
    );
    check(
        r#"model m { velocity v in R^2; quasi_velocity s; lagrangian = dot(v, v); constraint v1^2 = s; }"#,
        expect![[
            r#"1:83 nonlinear constraint `v1^2 = s` contains the quasi-velocity `s` [a quasi-velocity only parametrises linear constraints]"#
        ]],
    );
    check(
        r#"model m { velocity v in R^2; quasi_velocity s; lagrangian = dot(v, v); constraint ddt(v1) = s; }"#,
        expect![[
            r#"1:83 constraint `ddt(v1) = s` contains the quasi-velocity `s` [a quasi-velocity only parametrises linear constraints]"#
        ]],
    );
}

const SNAKEBOARD: &str = "param r = 0.6; coordinate psi, phi in angle; velocity omega, v in se(2); \
     /// Speed along the turn [-].
     quasi_velocity s; lagrangian = omega^2 + dot(v, v) + psi_dot^2 + phi_dot^2; \
     constraint omega = s*sin(phi); constraint v1 = -r*s*cos(phi); constraint v2 = 0;";

#[test]
fn a_quasi_velocity_parametrises_the_constraint() {
    let m = model(&format!(
        "{SNAKEBOARD} independent psi_dot, phi_dot, s; casimir c = s; output o = [s, omega];"
    ));
    assert_eq!(m.quasi_velocities[0].name, "s");
    assert_eq!(m.quasi_velocities[0].block, "s");
    assert_eq!(m.quasi_velocities[0].doc, "Speed along the turn [-].");
    assert_eq!(m.all_velocities().len(), 5);
    assert_eq!(m.independent, Some(vec![0, 1, 5]));
    assert!(m.constraints.iter().all(|c| c.kind == ConstraintKind::Linear));
}

#[test]
fn bad_quasi_velocities() {
    let check_with = |item: &str, expected: Expect| {
        check(&format!("model m {{ velocity v in R^2; quasi_velocity s;\n{item} }}"), expected);
    };
    check_with(
        "lagrangian = s^2 + v1^2;",
        expect![[
            r#"2:14 the lagrangian contains the quasi-velocity `s` [a quasi-velocity only parametrises linear constraints]"#
        ]],
    );
    check_with(
        "lagrangian = v1^2; force v1 = s;",
        expect![[
            r#"2:26 force on `v1` contains the quasi-velocity `s` [a quasi-velocity only parametrises linear constraints]"#
        ]],
    );
    check_with(
        "lagrangian = v1^2; force s = 1;",
        expect![[r#"2:26 `s` is not a velocity [legal here: `v`, `v1`, `v2`]"#]],
    );
    check_with(
        "lagrangian = v1^2; advected a in R by s*v1;",
        expect![[
            r#"2:39 action on `a` contains the quasi-velocity `s` [a quasi-velocity only parametrises linear constraints]"#
        ]],
    );
    check_with(
        "lagrangian = v1^2; coordinate q in real; connection v1 = s*q_dot;",
        expect![[
            r#"2:53 connection on `v1` contains `s` [it is made of base velocities, base coordinates, time and parameters]"#
        ]],
    );
    check_with(
        "lagrangian = v1^2; constraint v1 = s; independent v2;",
        expect![[
            r#"2:39 1 independent velocities, the constraints leave 2 [velocities: 3, scalar constraints: 1]"#
        ]],
    );
    check_with("lagrangian = v1^2; param s = 1;", expect!["2:26 `s` is declared twice [rename one of them]"]);
    check_with(
        "lagrangian = v1^2; stage a; stage b = ideal(s);",
        expect![[
            r#"2:29 ideal of stage `b` is not spanned by combinations of velocities in parameters [use `v1`, `v2`]"#
        ]],
    );
}

#[test]
fn every_group_reconstructs() {
    let mut m = model(
        "velocity O, V in se(3); lagrangian = dot(O, O); \
         /// Pose.
         reconstruct q, r in SE(3); reconstruct p in SO(3) from O; output O = O; output V = V;",
    );
    assert_eq!(m.reconstruction[0].names, ["qw", "qx", "qy", "qz", "r1", "r2", "r3"]);
    assert_eq!(m.reconstruction[0].doc, "Pose.");
    let ReconstructionKind::Pose { omega, v } = m.reconstruction[0].kind.clone() else { panic!("SE(3)") };
    assert_entries(&mut m, &omega, "O");
    assert_entries(&mut m, &v, "V");
    let ReconstructionKind::Quaternion { omega } = m.reconstruction[1].kind.clone() else { panic!("SO(3)") };
    assert_entries(&mut m, &omega, "O");

    let mut m = model(
        "velocity omega, v in se(2); lagrangian = omega^2; reconstruct theta, x, y in SE(2); \
         reconstruct alpha in SO(2) from omega; output z = [omega, v1, v2];",
    );
    assert_eq!(m.reconstruction[0].names, ["theta", "x", "y"]);
    let ReconstructionKind::PlanarPose { omega, v } = m.reconstruction[0].kind.clone() else {
        panic!("SE(2)")
    };
    assert_entries(&mut m, &[omega, v[0], v[1]], "z");
    assert_eq!(m.reconstruction[1].kind, ReconstructionKind::Angle { omega });

    let m = model(
        "velocity u, W, a in product(R^2, so(3), R); lagrangian = a^2; reconstruct x in R^2 from u; \
         reconstruct b, c in R^2 from u; reconstruct h in R from a; reconstruct k in SO(3) from W;",
    );
    let names: Vec<String> = m.reconstruction.iter().flat_map(|r| r.names.clone()).collect();
    assert_eq!(names, ["x1", "x2", "b", "c", "h", "kw", "kx", "ky", "kz"]);
    let ReconstructionKind::Translation { v } = &m.reconstruction[2].kind else { panic!("R") };
    assert_eq!(v.len(), 1);
}

#[test]
fn rates_see_coordinates_that_are_reconstructed_before() {
    let mut m = model(
        "param r = 0.5; coordinate phi in angle; velocity omega, v in se(2); quasi_velocity s; \
         lagrangian = omega^2 + phi_dot^2; constraint omega = s; \
         reconstruct psi by s; reconstruct x by -r*omega*[cos(psi), sin(phi)]; reconstruct y, z by [x1, psi];",
    );
    let names: Vec<String> = m.reconstruction.iter().flat_map(|r| r.names.clone()).collect();
    assert_eq!(names, ["psi", "x1", "x2", "y", "z"]);
    let ReconstructionKind::Rate { rate } = m.reconstruction[2].kind.clone() else { panic!("rates") };
    let (x1, psi) = (m.reconstruction[1].symbols[0], m.reconstruction[0].symbols[0]);
    assert_eq!(rate, [m.graph.sym(x1), m.graph.sym(psi)]);
}

#[test]
fn bad_reconstructions() {
    let check_with = |item: &str, expected: Expect| {
        check(&format!("model m {{ velocity O, V in se(3); lagrangian = O1^2;\n{item} }}"), expected);
    };
    check_with(
        "reconstruct q in SO(3);",
        expect![[r#"2:13 6 velocities for SO(3), which has dimension 3 [say which: `in SO(3) from O;`]"#]],
    );
    check_with(
        "reconstruct q in SO(3) from V;",
        expect![[
            r#"2:13 the velocities do not move SO(3) alone: [O1, V2] has component 1 along V3, not 0 [name the velocities of a whole factor of the group in its order, for example `in SE(3) from Omega, V`]"#
        ]],
    );
    check_with(
        "reconstruct x in R^3 from V;",
        expect![[
            r#"2:13 the velocities do not move R^3 alone: [O1, V2] has component 1 along V3, not 0 [name the velocities of a whole factor of the group in its order, for example `in SE(3) from Omega, V`]"#
        ]],
    );
    check_with(
        "reconstruct q, r in SE(3) from V, O;",
        expect![[
            r#"2:13 the velocities do not move SE(3) alone: [O1, O2] has component 1 along O3, not 0 [name the velocities of a whole factor of the group in its order, for example `in SE(3) from Omega, V`]"#
        ]],
    );
    check_with(
        "reconstruct q in SO(3) from O1, O2;",
        expect![[
            r#"2:13 2 velocities for SO(3), which has dimension 3 [name the velocities of the algebra that move it]"#
        ]],
    );
    check_with(
        "reconstruct q in SO(3) from O, O1;",
        expect![[r#"2:32 `O1` is named twice [name every velocity once]"#]],
    );
    check_with(
        "reconstruct q in SO(3) from W;",
        expect![[
            r#"2:29 `W` is not a velocity of the algebra [legal here: `O`, `O1`, `O2`, `O3`, `V`, `V1`, `V2`, `V3`]"#
        ]],
    );
    check_with(
        "reconstruct q, r, s in SE(3);",
        expect![[r#"2:13 3 names for the coordinates of SE(3) [for example `reconstruct q, r in SE(3);`]"#]],
    );
    check_with(
        "reconstruct q in so(3) from O;",
        expect![[r#"2:18 unknown group `so(3)` [did you mean `SO(3)`?]"#]],
    );
    check_with(
        "reconstruct q in SU(3) from O;",
        expect![
            "2:13 3 velocities for SU(3), which has dimension 8 [name the velocities of the algebra that move it]"
        ],
    );
    check_with(
        "reconstruct q from O;",
        expect![
            "2:15 expected `in` and a group, or `by` and the rate, found `from` [written as `reconstruct q in SO(3) from Omega;` or `reconstruct x by v;`]"
        ],
    );
    check_with(
        "reconstruct q in SO(3) from O; param qw = 1;",
        expect!["2:38 `qw` is declared twice [rename one of them]"],
    );
    check_with(
        "reconstruct a by b; reconstruct b by O1;",
        expect![[
            r#"2:18 `b` is a reconstructed coordinate [only later `reconstruct` items see it; use `coordinate` when the equations depend on it]"#
        ]],
    );
    check_with(
        "reconstruct a by O1; output h = a;",
        expect![[
            r#"2:33 `a` is a reconstructed coordinate [only later `reconstruct` items see it; use `coordinate` when the equations depend on it]"#
        ]],
    );
    check_with(
        "reconstruct q in SO(3) from O; force O1 = qw + q[1];",
        expect![[
            r#"2:43 `qw` is a reconstructed coordinate [only later `reconstruct` items see it; use `coordinate` when the equations depend on it]
2:48 `q` is a reconstructed coordinate [only later `reconstruct` items see it; use `coordinate` when the equations depend on it]"#
        ]],
    );
    check_with(
        "reconstruct a, b, c by V + t*[1, 2];",
        expect![[r#"2:28 cannot add vector(3) and vector(2) [both sides must have the same shape]"#]],
    );
    check_with(
        "reconstruct a, b by V;",
        expect![[
            r#"2:13 2 names for a rate that is vector(3) [give one name, or one per entry of the vector]"#
        ]],
    );
    check_with(
        "reconstruct a by diag(V);",
        expect![[
            r#"2:13 1 name for a rate that is matrix(3, 3) [give one name, or one per entry of the vector]"#
        ]],
    );
    check_with(
        "scene s { want reconstruction; }",
        expect![[
            r#"2:16 scene `s` wants `reconstruction`, but the model reconstructs nothing [add an item such as `reconstruct q in SO(3);`]"#
        ]],
    );
}

#[test]
fn initial_values() {
    let mut m = model(
        "param g = 2; let h = g/4; coordinate theta in (0, pi/2); coordinate x: vector(2) in real; velocity O in so(3); \
         advected G in R^3 by cross(O, G); quasi_velocity s; lagrangian = dot(O, O); constraint O3 = s; \
         reconstruct q in SO(3) from O; initial theta = h; initial x_dot = 0; initial x2 = 1; initial O = [1, 2, g^2]; \
         initial G1 = 0.6; initial s = 3; initial q = [1, 0, 0, 0]; output first = g/4;",
    );
    let names: Vec<&str> = m.initial.iter().map(|(n, _)| n.as_str()).collect();
    let expected = "theta x1_dot x2_dot x2 O1 O2 O3 G1 s qw qx qy qz";
    assert_eq!(names.join(" "), expected);
    let first = m.initial[0].1;
    assert_entries(&mut m, &[first], "first");
}

#[test]
fn bad_initial_values() {
    let check_with = |item: &str, expected: Expect| {
        let items = "param p = 0; coordinate q in (0, 1); velocity O in so(3); lagrangian = O1^2; let w = O;";
        check(&format!("model m {{ {items}\n{item} }}"), expected);
    };
    check_with(
        "initial W = 1;",
        expect![[r#"2:9 `W` is not a state variable [legal here: `O`, `O1`, `O2`, `O3`, `q`, `q_dot`]"#]],
    );
    check_with(
        "initial w = [1, 2, 3];",
        expect![[r#"2:9 `w` is not a state variable [legal here: `O`, `O1`, `O2`, `O3`, `q`, `q_dot`]"#]],
    );
    check_with(
        "initial p = 1;",
        expect![[r#"2:9 `p` is not a state variable [legal here: `O`, `O1`, `O2`, `O3`, `q`, `q_dot`]"#]],
    );
    check_with(
        "initial O = 1;",
        expect![[
            r#"2:9 initial value of `O` must be vector(3), found a number [it has the same components]"#
        ]],
    );
    check_with(
        "initial O1 = O2;",
        expect![[
            r#"2:9 initial value of `O1` contains `O2`, which is not a parameter [initial values are made of numbers and parameters]"#
        ]],
    );
    check_with(
        "initial O = 0; initial O2 = 1;",
        expect![[r#"2:24 initial value of `O2` is given twice [keep one of them]"#]],
    );
    check_with(
        "initial O1 = 1/p;",
        expect![[
            r#"2:9 initial value of `O1` has no value at the defaults [it divides by zero or leaves the domain of a function]"#
        ]],
    );
    check_with(
        "initial q = 1;",
        expect![[
            r#"2:9 initial value 1 of `q` is not between 0 and 1 [the domain of a coordinate is an open interval]"#
        ]],
    );
    check_with(
        "initial q;",
        expect!["2:10 expected `=`, found `;` [written as `initial Omega = [0, 0, 1];`]"],
    );
}

#[test]
fn actions_on_advected_parameters_may_be_nonlinear_and_affine() {
    let m = model(
        "velocity O in so(3); lagrangian = dot(O, O); advected z in R^2 by O1*[z1*z2, z2^2 - z1^2] + O3*[1, 0]; \
         advected h in R by O2*sin(h);",
    );
    assert_eq!(m.advected.len(), 2);
}

#[test]
fn scenes_drop_coordinates() {
    let m = model(
        "coordinate phi in angle; coordinate x: vector(2) in real; velocity O in so(3); \
         advected G in R^3 by cross(O, G); lagrangian = dot(O, O); reconstruct q in SO(3); \
         scene s { drop phi, x; drop G; want rhs, reconstruction; }",
    );
    assert_eq!(m.scenes[0].drops, ["phi", "x1", "x2", "G1", "G2", "G3"]);
    let wants: Vec<&str> = m.scenes[0].wants.iter().map(Wanted::name).collect();
    assert_eq!(wants, ["rhs", "reconstruction"]);
}

#[test]
fn bad_drops() {
    let check_with = |item: &str, expected: Expect| {
        let items = "coordinate phi in angle; velocity O in so(3); advected G in R^3 by cross(O, G);";
        check(&format!("model m {{ {items} lagrangian = O1^2;\n{item} }}"), expected);
    };
    check_with(
        "scene s { drop psi; }",
        expect![[
            r#"2:16 scene `s` drops `psi`, which is neither a base coordinate nor an advected parameter [did you mean `phi`?]"#
        ]],
    );
    check_with(
        "scene s { drop O; }",
        expect![[
            r#"2:16 scene `s` drops `O`, which is neither a base coordinate nor an advected parameter [legal here: `phi`, `G`]"#
        ]],
    );
    check_with(
        "scene s { drop phi_dot; }",
        expect![[
            r#"2:16 scene `s` drops `phi_dot`, which is neither a base coordinate nor an advected parameter [legal here: `phi`, `G`]"#
        ]],
    );
    check_with(
        "scene s { drop phi, phi; }",
        expect![[r#"2:21 scene `s` drops `phi` twice [keep one of them]"#]],
    );
    check_with(
        "scene s { drop G1; }",
        expect![[r#"2:16 scene `s` drops a part of `G` [drop `G` as a whole]"#]],
    );
    check_with(
        "scene s { drop; }",
        expect![
            "2:15 expected the name of a coordinate, found `;` [written as `scene name { fix m = 1; want energy; drop x; }`]"
        ],
    );
}

#[test]
fn limits() {
    let names: Vec<String> = (0..201).map(|k| format!("s{k}")).collect();
    check(
        &format!("model m {{ velocity x in R; lagrangian = x^2;\nquasi_velocity {}; }}", names.join(", ")),
        expect![[
            r#"2:1106 the model has more than 200 quasi-velocities [one per independent velocity is enough]"#
        ]],
    );
    check(
        &format!(
            "model m {{ velocity x in R; lagrangian = x^2;\nreconstruct {} by [x]; }}",
            names.join(", ")
        ),
        expect!["2:13 the model reconstructs more than 200 coordinates"],
    );
    check(
        "model m { velocity x in R; lagrangian = x^2; let v = x*diag(identity(150));\nreconstruct a by v; reconstruct b by v; }",
        expect![[r#"2:33 the model reconstructs more than 200 coordinates"#]],
    );
}

#[test]
fn the_builder_makes_the_same_servo_ball() {
    let mut b = ModelBuilder::new("m");
    let two = |n: i64| Rational::new(n.into(), 10.into());
    let kappa = b.param("kappa", two(15), "");
    let c = b.param("c", two(2), "");
    let (a, a_dot) = b.coordinate_vector("a", 2, hamel_codegen::spec::Domain::Real, "");
    let xi = b.velocities(LieAlgebra::so(3).unwrap(), &["xi"]).remove(0);
    let component = |v: &Value, k: usize| v.row(k).unwrap();
    let accelerations = [b.ddt(&component(&a_dot, 1)).unwrap(), b.ddt(&component(&xi, 3)).unwrap()];
    let g = b.graph();
    let spring = kappa.mul(g, &component(&a, 1)).unwrap();
    let damper = c.mul(g, &component(&a_dot, 1)).unwrap();
    let terms = [&accelerations[0], &accelerations[1], &spring, &damper].map(|v| (false, v));
    let servo = Value::sum_of(g, &terms).unwrap();
    let energy = a_dot.dot(g, &a_dot).unwrap();
    let zero = Value::Scalar(g.zero());
    b.lagrangian(&energy).constraint(Some("servo"), "servo", &servo, &zero);
    let delta = b.delta(&xi).unwrap();
    b.virtual_constraint(None, "delta(xi)", &component(&delta, 2), &zero);
    b.connection("xi", &zero);
    let q = b.reconstruct_group(&["q"], Group::Rotation, &[], "");
    assert_eq!(q[0].entries().len(), 4);
    let x = b.reconstruct_rate(&["x"], &component(&q[0], 1), "").remove(0);
    b.initial("x", &kappa).scene("s", &[], &["reconstruction"], "").scene_drops("s", &["a"]);
    let m = b.clone().build().unwrap();
    let from_text = model(SERVO);
    let ConstraintKind::SecondOrder { acceleration } = &from_text.constraints[0].kind else {
        panic!("servo")
    };
    let ConstraintKind::SecondOrder { acceleration: built } = &m.constraints[0].kind else { panic!("servo") };
    let ones = |m: &Model, list: &[ExprId]| list.iter().map(|e| *e == m.graph.one()).collect::<Vec<_>>();
    assert_eq!(ones(&m, built), ones(&from_text, acceleration));
    assert_eq!(m.virtual_constraints[0].one_form.len(), 5);
    assert_eq!(m.scenes[0].drops, ["a1", "a2"]);

    // What the text cannot say, the builder must refuse.
    let stray = b.ddt(&component(&xi, 1)).unwrap();
    b.force("xi1", &stray).force("xi2", &x).output("h", &delta, "").scene_drops("none", &["a"]);
    let problems = b.build().unwrap_err();
    let messages: Vec<&str> = problems.iter().map(|p| p.message.as_str()).collect();
    assert_eq!(
        messages,
        [
            "`none` is not a scene",
            "force on `xi1` contains the acceleration `ddt(xi1)`",
            "force on `xi2` contains the reconstructed coordinate `x`",
            "output `h` contains the displacement `delta(xi1)`",
            "output `h` contains the displacement `delta(xi2)`",
            "output `h` contains the displacement `delta(xi3)`",
        ]
    );
}

/// A mounting angle from a drawing, to three digits: a body turns with it, and the model is told how far it moved.
#[test]
fn measured_attitudes_are_taken_to_the_nearest_rotation() {
    let model = |attitude: &str| {
        format!(
            "model m {{ coordinate phi in angle; let M = {attitude};
                body B {{ inertia diag([1, 2, 3]); attitude rot(e3, phi)*M; }} lagrangian = B_energy; }}"
        )
    };
    let rows = "[[0.866, 0, 0.5], [0, 1, 0], [-0.5, 0, 0.866]]";
    let parsed = parse("m.hamel", &model(&format!("orthonormal({rows})"))).unwrap_or_else(|e| panic!("{e}"));
    let told: Vec<&str> = parsed.warnings.iter().map(|w| w.message.as_str()).collect();
    // By 0.866 (1/|(0.866, 0.5)| - 1).
    assert_eq!(told, ["the nearest rotation differs from the matrix by 1.9e-5"]);
    let energy = |text: &str| {
        let model = parse("m.hamel", text).unwrap_or_else(|e| panic!("{e}"));
        let g = &model.graph;
        let values = g.free_symbols(model.lagrangian).into_iter().map(|s| (s, 1.0)).collect();
        g.eval_f64(model.lagrangian, &values).unwrap()
    };
    // I_33 along the axis of the turn: sin^2 I_1 + cos^2 I_3 with the angle of 30 degrees.
    let (measured, exact) = (energy(&model(&format!("orthonormal({rows})"))), 0.5 * (0.25 + 0.75 * 3.0));
    assert!((measured - exact).abs() < 1e-4, "{measured} {exact}");
    // As many digits as doubles have say nothing.
    let digits = "[[0.8660254037844387, 0, 0.5], [0, 1, 0], [-0.5, 0, 0.8660254037844387]]";
    let parsed =
        parse("m.hamel", &model(&format!("orthonormal({digits})"))).unwrap_or_else(|e| panic!("{e}"));
    assert!(parsed.warnings.is_empty(), "{}", parsed.warnings);
    // Without the word the matrix is no rotation, and the word is proposed.
    let refused = parse("m.hamel", &model(rows)).unwrap_err();
    let help: Vec<String> = refused.iter().filter_map(|p| p.help.clone()).collect();
    assert!(refused.to_string().contains("the matrix is no rotation"), "{refused}");
    assert!(help.is_empty() || !help[0].contains("orthonormal"), "the product is no number: {help:?}");
    let plain = model(rows).replace("rot(e3, phi)*M", "M");
    let refused = parse("m.hamel", &plain).unwrap_err().to_string();
    assert!(refused.contains("write `orthonormal(A)` for the nearest rotation"), "{refused}");
}

#[test]
fn entries_of_a_matrix_are_indexed_in_one_bracket_or_in_two() {
    let text =
        "model m { param C: matrix(2, 3) = [[1, 2, 3], [4, 5, 6]]; coordinate x in real; let k = 1 + 1;
        lagrangian = 1/2*x_dot^2 - (C[2][3] + C[k, 3] + C[1][k] - identity(3)[1][1])*x; }";
    let same = text.replace("C[2][3]", "C[2, 3]").replace("C[1][k]", "C[1, k]").replace("[1][1]", "[1, 1]");
    let shown = |text: &str| {
        let model = parse("m.hamel", text).unwrap_or_else(|e| panic!("{e}"));
        model.graph.display(model.lagrangian, Style::Plain)
    };
    assert_eq!(shown(text), shown(&same));
    let wrong = text.replace("C[2][3]", "C[2][3][1]");
    assert!(parse("m.hamel", &wrong).unwrap_err().to_string().contains("3 indices for matrix(2, 3)"));
}
