//! Scenes of small models: what is solved, refused and watched.

use hamel_codegen::scene::*;
use hamel_codegen::spec;
use hamel_program::program::Role;

fn built(text: &str) -> BuiltScene {
    let model = spec::parse("m", text).expect("a valid model");
    build(&model, DEFAULT).expect("a scene")
}

#[test]
fn two_unknowns_with_a_constant_determinant_are_solved_without_a_division() {
    // The inertia is I, and I + q along u = (cos a, sin a): no pivot is a number, the determinant I (I + q) is.
    let scene = built(
        "model m {
            param I = 2 where I > 0;
            param q = 3 where q > 0;
            coordinate a in angle;
            coordinate x, y in real;
            lagrangian = 1/2*a_dot^2 + I/2*(x_dot^2 + y_dot^2) + q/2*(cos(a)*x_dot + sin(a)*y_dot)^2;
        }",
    );
    let rhs = scene.program().function(&Role::Rate).expect("a right-hand side");
    assert_eq!(rhs.counts().div, 0, "{rhs:?}");
    assert!(!scene.emit().expect("a module").contains("fn check"), "nothing can vanish");

    let interpreter = scene.prepare(&[2.0, 3.0]).expect("positive inertia");
    let values = [("a", 0.7), ("x", 0.1), ("y", -0.4), ("a_dot", 1.3), ("x_dot", 0.6), ("y_dot", -0.9)];
    let (names, values): (Vec<&str>, Vec<f64>) = values.into_iter().unzip();
    assert_eq!(scene.state_names(), names);
    let mut rate = [0.0; 6];
    interpreter.rhs(0.0, &values, &mut rate);
    let ([a, _, _, turn, vx, vy], [.., ax, ay]) = (<[f64; 6]>::try_from(values).expect("six"), rate);
    let (sine, cosine) = a.sin_cos();
    let along = cosine * vx + sine * vy;
    let along_rate = turn * (cosine * vy - sine * vx) + cosine * ax + sine * ay;
    // The momentum p = I v + q (u.v) u is conserved.
    let force = [
        2.0 * ax + 3.0 * (along_rate * cosine - along * turn * sine),
        2.0 * ay + 3.0 * (along_rate * sine + along * turn * cosine),
    ];
    // Terms of size one to four, some forty operations.
    assert!(ax.abs() > 0.1 && force.iter().all(|f| f.abs() < 1e-14), "{force:?}");
}

#[test]
fn a_pivot_that_is_rounding_error_alone_is_refused() {
    // The second pivot is y - x^2.
    let scene = built(
        "model m {
            coordinate x, y in real;
            coordinate a, b in real;
            lagrangian = 1/2*(x_dot^2 + y_dot^2 + a_dot^2) + x*a_dot*b_dot + y/2*b_dot^2;
        }",
    );
    let interpreter = scene.prepare(&[]).expect("no parameters");
    let at = |x: f64, y: f64| {
        let state = scene.state_names().into_iter().map(|name| match name.as_str() {
            "x" => x,
            "y" => y,
            _ => 0.5,
        });
        interpreter.check(0.0, &state.collect::<Vec<_>>())
    };
    // 0.1^2 is not exact: the difference is about 1e-18.
    assert_ne!(f64::mul_add(0.1, 0.1, -0.1 * 0.1), 0.0);
    assert!(at(0.1, 0.1 * 0.1).is_err());
    // What can be told from rounding errors is a value.
    assert_eq!(at(0.1, 0.1 * 0.1 * (1.0 + 8.0 * f64::EPSILON)), Ok(()));
    assert!(at(0.0, 0.0).is_err());
}

#[test]
fn a_pivot_that_is_lost_in_the_errors_of_the_one_before_it_is_refused() {
    // The inertia along b is p = y - x^2, that along c, which comes last, z - 2 - w^2/p.
    let scene = built(
        "model m {
            coordinate x, y, z, w in real;
            coordinate a, b, c, d, e in real;
            lagrangian = 1/2*(x_dot^2 + y_dot^2 + z_dot^2 + w_dot^2 + a_dot^2 + d_dot^2 + e_dot^2)
                + x*a_dot*b_dot + y/2*b_dot^2 + w*b_dot*c_dot + z/2*c_dot^2 + c_dot*d_dot + c_dot*e_dot;
        }",
    );
    let interpreter = scene.prepare(&[]).expect("no parameters");
    let at = |y: f64, relative: f64| {
        let (x, w) = (0.1, 1.0);
        let last = w * w / f64::mul_add(-x, x, y);
        let state = scene.state_names().into_iter().map(|name| match name.as_str() {
            "x" => x,
            "y" => y,
            "z" => 2.0 + last * (1.0 + relative),
            "w" => w,
            _ => 0.5,
        });
        interpreter.check(0.0, &state.collect::<Vec<_>>())
    };
    assert_eq!(at(0.02, 1e-6), Ok(()));
    // 1e-10 of y is left of the first, with an error of 1e-6 of it, and so is what the second is a difference of.
    let refused = at(0.01 * (1.0 + 1e-10), 1e-6).expect_err("the pivot of c");
    assert!(refused.contains("c_dot"), "{refused}");
    assert_eq!(at(0.01 * (1.0 + 1e-10), 1e-3), Ok(()));
}

#[test]
fn parameters_whose_pivot_is_rounding_error_alone_are_refused() {
    let scene = built(
        "model m {
            param p = 1;
            param q = 2;
            coordinate a, b in real;
            lagrangian = 1/2*a_dot^2 + p*a_dot*b_dot + q/2*b_dot^2;
        }",
    );
    let condition = |q: f64| scene.prepare(&[0.1, q]).err().map(|e| e.to_string());
    let refused = condition(0.1 * 0.1).expect("1e-18 is left of 0.01");
    assert!(refused.contains("inertia along b_dot > 0"), "{refused}");
    assert_eq!(condition(0.1 * 0.1 * (1.0 + 16.0 * f64::EPSILON)), None);
    // Overflow: no number is left to divide by.
    assert!(scene.prepare(&[1e200, 1.0]).is_err());
}

#[test]
fn pivots_that_are_sums_of_positive_terms_are_not_asked_for() {
    // The second pivot is c - c^2 d^2/(I + c d^2) = c I/(I + c d^2).
    let scene = built(
        "model m {
            param I = 1 where I > 0;
            param c = 2 where c > 0;
            param d = 3;
            coordinate a, b in real;
            lagrangian = 1/2*((I + c*d^2)*a_dot^2 + c*b_dot^2) + c*d*a_dot*b_dot;
        }",
    );
    let conditions: Vec<&str> = scene.program().prepare.conditions.iter().map(|c| c.text.as_str()).collect();
    assert_eq!(conditions, ["I > 0", "c > 0"]);
    // Eliminated as it stands, nothing would be left of c.
    let interpreter = scene.prepare(&[1.0, 1.0, 1e9]).expect("allowed parameters");
    assert_eq!(interpreter.check(0.0, &[0.0; 4]), Ok(()));
}

/// `A = [[e, 1], [1, q]]` with these defaults.
fn coupled(e: &str, q: &str) -> BuiltScene {
    built(&format!(
        "model m {{
            param e = {e};
            param q = {q};
            coordinate a, b in real;
            lagrangian = e/2*a_dot^2 + a_dot*b_dot + q/2*b_dot^2;
        }}"
    ))
}

#[test]
fn an_inertia_that_is_definite_by_default_has_to_be_so_for_all_parameters() {
    let scene = coupled("2", "3");
    let texts: Vec<&str> = scene.program().prepare.conditions.iter().map(|c| c.text.as_str()).collect();
    assert_eq!(texts, ["inertia along a_dot > 0", "inertia along b_dot > 0"]);
    let refused = scene.prepare(&[2.0, 0.4]).expect_err("det = -0.2");
    assert_eq!(refused.condition, "inertia along b_dot > 0");
    assert!(refused.meaning.contains("positive definite"), "{refused}");
    assert!(scene.prepare(&[-2.0, -3.0]).is_err(), "negative definite");
    assert!(scene.prepare(&[1e-9, 1.1e9]).is_ok(), "growth is no matter there");
}

#[test]
fn a_lagrangian_that_is_indefinite_by_default_is_refused_where_its_entries_are_lost() {
    let scene = coupled("1", "-1");
    // x = (e b2 - b1)/(e q - 1) and the like, of any sign.
    for (e, q) in [(1.0, -1.0), (1.0, 3.0), (-2.0, 0.25), (0.01, -0.02)] {
        assert!(scene.prepare(&[e, q]).is_ok(), "{e} {q}");
    }
    // The second pivot is q - 1/e: nothing is left of q.
    let lost = scene.prepare(&[1e-15, 0.3]).expect_err("growth of 1e15");
    assert_eq!(lost.condition, "terms of inertia along b_dot <= 1024 entries of its matrix");
    assert!(lost.meaning.contains("rounding errors"), "{lost}");
    assert!(scene.prepare(&[0.0, 1.0]).is_err() && scene.prepare(&[2.0, 0.5]).is_err());
}

#[test]
fn pivots_that_can_change_their_sign_are_watched_and_no_others() {
    let watches = |lagrangian: &str| {
        let text = format!("model m {{ param k = 2; coordinate x, w in real; lagrangian = {lagrangian}; }}");
        built(&text).program().function_idx(&Role::Signature).is_some()
    };
    assert!(watches("1/2*(1 - x^2)*x_dot^2 + 1/2*w_dot^2 - 1/2*w^2"));
    assert!(watches("1/2*x_dot^2 + x*x_dot*w_dot + 1/2*w_dot^2"));
    // The determinant x^2 keeps its sign, but rates divide by x, which does not.
    assert!(watches("1/2*x^2*x_dot^2 + 1/2*(w_dot + sin(x)*x_dot)^2"));
    // Proved positive; squares, whose sum has no negative eigenvalue; parameters.
    assert!(!watches("1/2*(1 + x^2)*x_dot^2 + 1/2*w_dot^2"));
    assert!(!watches("1/2*(w_dot + cos(x)*x_dot)^2 + 1/2*(w_dot - x*x_dot)^2 - x + w_dot"));
    assert!(!watches("k/2*x_dot^2 + x_dot*w_dot + 1/2*w_dot^2 - cos(x)"));
}

#[test]
fn the_signature_changes_where_a_matrix_becomes_singular() {
    // Two pivots, 1 - x^2 and then 4 - x^2 - w^2/(1 - x^2).
    let scene = built(
        "model m {
            coordinate x, w in real;
            lagrangian = 1/2*(1 - x^2)*x_dot^2 + w*x_dot*w_dot + 1/2*(4 - x^2)*w_dot^2;
        }",
    );
    let interpreter = scene.prepare(&[]).expect("no parameters");
    let at = |x: f64, w: f64| {
        assert_eq!(scene.state_names()[..2], ["x", "w"]);
        interpreter.signature(0.0, &[x, w, 0.3, 0.4])
    };
    // The number of negative eigenvalues: none, one, one, two.
    let count = |x: f64, w: f64| {
        let (a, d) = (1.0 - x * x, 4.0 - x * x);
        let determinant = a * d - w * w;
        if determinant < 0.0 { 0.0 } else { 2.0 * f64::signum(a + d) }
    };
    for (x, w) in [(0.0, 0.0), (0.5, 0.3), (0.0, 3.0), (1.5, 0.2), (1.5, -4.0), (3.0, 0.1), (-3.0, 0.5)] {
        assert_eq!(at(x, w), count(x, w), "{x} {w}");
    }
    // On the line x = 1 a pivot is zero.
    assert!(at(1.0, 0.5).is_nan());
    let text = scene.emit().expect("a module");
    assert!(text.contains("fn signature(&self, t: R, y: &[R; 4]) -> R"), "{text}");
}

#[test]
fn a_pivot_that_is_not_finite_is_refused_whatever_its_sign() {
    let scene = built("model m { coordinate x in real; lagrangian = 1/2*(1 + x^2)*x_dot^2; }");
    let interpreter = scene.prepare(&[]).expect("no parameters");
    let mut rate = [0.0; 2];
    interpreter.rhs(0.0, &[1e160, 1.0], &mut rate);
    assert_eq!(rate[1].abs(), 0.0, "x' = -x x'^2/(1 + x^2) is 1e-160");
    assert_eq!(interpreter.check(0.0, &[1e160, 1.0]), Err("inertia along x_dot".into()));
    assert_eq!(interpreter.check(0.0, &[1e150, 1.0]), Ok(()));
}

#[test]
fn divisors_of_the_model_are_checked_by_their_formula() {
    let scene = built(
        "model m {
            param k = 2;
            coordinate x, y in real;
            lagrangian = 1/2*(x_dot^2 + y_dot^2) + k/sqrt(x^2 + y^2) + cos(x)/(2 + sin(y)) + 1/(x - y)^2;
        }",
    );
    let interpreter = scene.prepare(&[2.0]).expect("a number");
    let names: Vec<&str> = interpreter.pivots(0.0, &[0.3, 0.4, 0.0, 0.0]).iter().map(|p| p.0).collect();
    assert!(names.contains(&"x^2 + y^2"), "{names:?}");
    assert!(names.iter().any(|n| ["x - y", "-x + y", "y - x"].contains(n)), "{names:?}");
    assert_eq!(interpreter.check(0.0, &[0.0; 4]), Err(names[0].into()));
    assert!(interpreter.check(0.0, &[0.5, 0.5, 0.0, 0.0]).is_err());
    assert_eq!(interpreter.check(0.0, &[0.5, 0.25, 0.0, 0.0]), Ok(()));
}
