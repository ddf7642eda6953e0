//! Families of models: a file with sizes is what the text with its loops written out by hand is.

use crate::families::{planar_arm, planar_pendulum, wheeled_snake};
use hamel_codegen::Config;
use hamel_codegen::scene;
use hamel_codegen::spec::{self, DeclarationKind, Model, Outline};
use hamel_mechanics::reduction::Formulation;
use hamel_program::program::Program;

const SNAKE: &str = include_str!("sizes/snake.hamel");
const ARM: &str = include_str!("sizes/arm.hamel");
const PENDULUM: &str = include_str!("sizes/pendulum.hamel");

fn parsed(text: &str) -> Model {
    spec::parse("family.hamel", text).unwrap_or_else(|problems| panic!("{problems}"))
}

/// A member of a family, under the name that a text by hand has.
fn member(text: &str, n: usize, name: &str) -> Model {
    let sizes = [("n".to_owned(), i64::try_from(n).unwrap())];
    let mut model = parsed(&spec::with_sizes("family.hamel", text, &sizes).unwrap());
    assert_eq!(model.sizes[0].value, i64::try_from(n).unwrap());
    name.clone_into(&mut model.name);
    model
}

fn program(model: &Model) -> Program {
    let formulation = Formulation { recursive: Some(true), ..Formulation::of(model) };
    scene::build_in(model, "bare", &formulation)
        .unwrap_or_else(|problems| panic!("{problems}"))
        .into_program()
}

#[test]
fn members_have_the_equations_of_texts_written_out_by_hand() {
    let families = [
        (SNAKE, wheeled_snake as fn(usize) -> String, [3, 4]),
        (ARM, planar_arm, [3, 4]),
        (PENDULUM, planar_pendulum, [3, 4]),
    ];
    for (family, by_hand, members) in families {
        for n in members {
            let by_hand = parsed(&by_hand(n));
            let member = member(family, n, &by_hand.name);
            assert_eq!(member.params, by_hand.params, "{}", by_hand.name);
            assert!(program(&member) == program(&by_hand), "{}: another right-hand side", by_hand.name);
        }
    }
}

#[test]
fn a_constraint_of_a_loop_has_the_text_of_its_turn() {
    let model = member(SNAKE, 4, "snake");
    let texts: Vec<&str> = model.constraints.iter().map(|c| c.text.as_str()).collect();
    assert_eq!(texts, ["y1 = 0", "y2 = 0", "y3 = 0", "y4 = 0"]);
    let names: Vec<&str> = model.constraints.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["wheel1", "wheel2", "wheel3", "wheel4"]);
}

/// What a loop declares for the last time and nothing uses is no mistake.
#[test]
fn an_effect_in_one_turn_is_enough() {
    let text = "model m { size n = 3; coordinate x: vector(n) in real; let s[0] = 0;
        for k in 1..n { let s[k] = s[k - 1] + x_dot[k]; let idle[k] = k*x[k]; }
        lagrangian = sum(x_dot[k]^2 for k in 1..n) + s[2]^2; }";
    let model = parsed(text);
    let found: Vec<&str> = model.warnings.iter().map(|w| w.message.as_str()).collect();
    assert_eq!(found, ["definition `idle1` has no effect"]);
}

#[test]
fn sizes_are_dimensions_of_everything_that_has_one() {
    let text = "model m {
        size n = 3;
        size m = 2*n - 1;
        param C: matrix(n, m) = [[i + j for j in 1..m] for i in 1..n];
        param I: diagonal(n*(n - 1)/2) = [i for i in 1..3] where I1 > 0;
        velocity Omega in so(n);
        advected Gamma in R^n by cross(Omega, Gamma);
        let s = sum(C[i, m] for i in 1..n);
        lagrangian = dot(Omega, I*Omega)*s/2;
        casimir c = dot(Gamma, Gamma);
    }";
    let model = parsed(text);
    assert_eq!(model.params.len(), 15 + 3);
    assert_eq!(model.velocities.len(), 3);
    let four = spec::with_sizes("m", &text.replace("for i in 1..3", "for i in 1..6"), &[("n".to_owned(), 4)]);
    let problems = spec::parse("m", &four.unwrap()).unwrap_err();
    // `cross` is of three dimensions, and nothing else is wrong with n = 4.
    assert_eq!(problems.len(), 1, "{problems}");
    assert!(problems.to_string().contains("cross"), "{problems}");
}

#[test]
fn copies_of_an_algebra_are_their_product_with_names_for_each() {
    let family = "model spins { size n = 3; param k = 0.3; momentum S in so(3)^n;
        hamiltonian = k*sum(dot(S[i], S[i + 1]) for i in 1..n - 1); }";
    let by_hand = "model spins { param k = 0.3; momentum S1, S2 in product(so(3), so(3));
        hamiltonian = k*dot(S1, S2); }";
    let default = |model: &Model| scene::build(model, scene::DEFAULT).unwrap_or_else(|p| panic!("{p}"));
    let (own, expected) = (default(&member(family, 2, "spins")), default(&parsed(by_hand)));
    assert_eq!(own.state_names(), ["S11", "S12", "S13", "S21", "S22", "S23"]);
    assert!(own.program() == expected.program());
    let bodies = "model bodies { algebra A = se(2)^2; velocity omega, v in se(2)^2;
        lagrangian = sum(omega[k]^2 + dot(v[k], v[k]) for k in 1..2); }";
    let names = default(&parsed(bodies)).state_names();
    assert_eq!(names, ["omega1", "v11", "v12", "omega2", "v21", "v22"]);
    assert_eq!(spec::format("spins.hamel", family).unwrap().matches("so(3)^n").count(), 1);
}

#[test]
fn loops_are_kept_by_the_formatter() {
    for text in [SNAKE, ARM, PENDULUM] {
        assert_eq!(spec::format("family.hamel", text).unwrap(), text);
    }
}

/// What loops write out is limited before it is anything.
#[test]
fn loops_end() {
    let deep = "for i in 1..1000 { for j in 1..1000 { for k in 1..1000 { require 1 > 0; } } }";
    let wide = "let s = sum(sum(sum(1 for i in 1..1000) for j in 1..1000) for k in 1..1000);";
    for items in [deep, wide] {
        let text = format!("model m {{ {items} velocity v in R; lagrangian = v^2; }}");
        let problems = spec::parse("m", &text).unwrap_err();
        assert!(problems.to_string().contains("loops write out more than 8 MiB"), "{problems}");
    }
}

/// Editors see a loop once, and its index within it.
#[test]
fn an_outline_has_the_names_of_the_text() {
    let outline = Outline::new(PENDULUM);
    let found: Vec<(&str, DeclarationKind)> =
        outline.declarations.iter().map(|d| (d.name.as_str(), d.kind)).collect();
    let expected = [
        ("planar_pendulum", DeclarationKind::Model),
        ("n", DeclarationKind::Size),
        ("g", DeclarationKind::Parameter),
        ("k", DeclarationKind::Index),
        ("m", DeclarationKind::Parameter),
        ("l", DeclarationKind::Parameter),
        ("q", DeclarationKind::Coordinate),
        ("p", DeclarationKind::Definition),
        ("h", DeclarationKind::Definition),
        ("k", DeclarationKind::Index),
        ("p", DeclarationKind::Definition),
        ("h", DeclarationKind::Definition),
        ("k", DeclarationKind::Index),
        ("bare", DeclarationKind::Scene),
    ];
    assert_eq!(found, expected);
    let of = |k: usize| -> Vec<&str> {
        let mentions = outline.mentions.iter().filter(|m| m.declaration == k);
        mentions.map(|m| &PENDULUM[m.word.start..m.word.end]).collect()
    };
    assert_eq!(of(6), ["q", "q", "q", "q_dot", "q"]);
    // Each loop has an index of its own.
    assert_eq!([3, 9, 12].map(|k| of(k).len()), [6, 11, 6]);
}

/// Solves `a x = b` with pivots in columns; the right-hand side becomes the solution.
fn solve(a: &mut [Vec<f64>], b: &mut [f64]) {
    let n = b.len();
    for k in 0..n {
        let pivot = (k..n).max_by(|i, j| a[*i][k].abs().total_cmp(&a[*j][k].abs())).unwrap();
        a.swap(k, pivot);
        b.swap(k, pivot);
        for i in k + 1..n {
            let factor = a[i][k] / a[k][k];
            for j in k..n {
                a[i][j] -= factor * a[k][j];
            }
            b[i] -= factor * b[k];
        }
    }
    for k in (0..n).rev() {
        let known: f64 = (k + 1..n).map(|j| a[k][j] * b[j]).sum();
        b[k] = (b[k] - known) / a[k][k];
    }
}

/// Angular acceleration of the first link of a snake and acceleration of its centre along it: Newton's and Euler's
/// equations of every link by itself, with unknown forces in the joints and across the wheels. The first link lies
/// along the first axis; `w`, `p`, `v` are angular velocities, places and velocities of all links.
fn unreduced(theta: &[f64], w: &[f64], v: &[[f64; 2]], [m, j, l]: [f64; 3]) -> [f64; 2] {
    let n = theta.len();
    let size = 3 * n + 2 * (n - 1) + n;
    let (mut a, mut b) = (vec![vec![0.0; size]; size], vec![0.0; size]);
    for k in 0..n {
        (a[3 * k][3 * k], a[3 * k + 1][3 * k + 1], a[3 * k + 2][3 * k + 2]) = (m, m, j);
    }
    let mut row = 3 * n;
    let mut condition = |entries: &[(usize, f64)], right: f64, a: &mut Vec<Vec<f64>>, b: &mut Vec<f64>| {
        for (column, value) in entries {
            a[row][*column] = *value;
            a[*column][row] = *value;
        }
        b[row] = right;
        row += 1;
    };
    for k in 0..n - 1 {
        let (here, next) = ((theta[k].cos(), theta[k].sin()), (theta[k + 1].cos(), theta[k + 1].sin()));
        let (i, o) = (3 * k, 3 * (k + 1));
        let squares = [w[k] * w[k], w[k + 1] * w[k + 1]];
        // p - l e - (p' + l e') = 0, twice differentiated: e'' = theta'' e_normal - theta'^2 e.
        let x = [(i, 1.0), (o, -1.0), (i + 2, l * here.1), (o + 2, l * next.1)];
        condition(&x, -l * (squares[0] * here.0 + squares[1] * next.0), &mut a, &mut b);
        let y = [(i + 1, 1.0), (o + 1, -1.0), (i + 2, -l * here.0), (o + 2, -l * next.0)];
        condition(&y, -l * (squares[0] * here.1 + squares[1] * next.1), &mut a, &mut b);
    }
    for k in 0..n {
        let (c, s) = (theta[k].cos(), theta[k].sin());
        let along = c * v[k][0] + s * v[k][1];
        condition(&[(3 * k, -s), (3 * k + 1, c)], w[k] * along, &mut a, &mut b);
    }
    solve(&mut a, &mut b);
    [b[2], b[0]]
}

/// Rounding in the elimination of up to 33 unknowns.
const TOLERANCE: f64 = 1e-10;

#[test]
fn a_snake_of_any_length_moves_as_its_links_do() {
    const SHIPPED: &str = include_str!("../../models/specs/snake.hamel");
    let (items, _) = SHIPPED.rsplit_once('}').unwrap();
    let text = format!("{items}scene bare {{ want rhs; }}\n}}");
    for n in [2, 3, 4] {
        let model = member(&text, n, "snake");
        let scene = scene::build_in(&model, "bare", &Formulation::of(&model)).unwrap();
        let [m, j, l] = [1.3, 0.2, 0.45];
        let interpreter = scene.prepare(&[m, j, l]).unwrap();
        let mut state: Vec<f64> = (1..n).map(|k| 0.5 - 0.23 * k as f64).collect();
        state.extend([0.3, 0.8]);
        let mut rates = vec![0.0; state.len()];
        interpreter.rhs(0.0, &state, &mut rates);
        let (mut theta, mut w, mut v) = (vec![0.0], vec![state[n - 1]], vec![[state[n], 0.0]]);
        for k in 0..n - 1 {
            let (t, turn, [x, y]) = (theta[k], w[k], v[k]);
            let (next, faster) = (t + state[k], turn + rates[k]);
            let (e, o) = ([t.cos(), t.sin()], [next.cos(), next.sin()]);
            v.push([x + l * (turn * e[1] + faster * o[1]), y - l * (turn * e[0] + faster * o[0])]);
            theta.push(next);
            w.push(faster);
        }
        for k in 0..n {
            let slip = -theta[k].sin() * v[k][0] + theta[k].cos() * v[k][1];
            assert!(slip.abs() < TOLERANCE, "link {} of {n} slips by {slip}", k + 1);
        }
        let expected = unreduced(&theta, &w, &v, [m, j, l]);
        for (found, expected) in rates[n - 1..].iter().zip(expected) {
            let error = (found - expected).abs();
            assert!(error <= TOLERANCE * (1.0 + expected.abs()), "{n} links: {found} and {expected}");
            assert!(expected.abs() > 1e-3, "{n} links: nothing happens");
        }
    }
}

#[test]
fn blocks_of_scenes_and_frames_have_loops() {
    let text = |frame: &str, scene: &str| {
        format!(
            "model joints {{
                size n = 3;
                param m: vector(n) = [1, 2, 3] where m1 > 0, m2 > 0, m3 > 0;
                coordinate q: vector(n) in angle;
                frame {{ {frame} }}
                lagrangian = (m1*u1^2 + m2*u2^2 + m3*u3^2)/2 + sum(cos(q[k]) for k in 1..n);
                scene alike {{ {scene} want rhs, energy; }}
            }}"
        )
    };
    let looped = text(
        "for k in 1..n { /// Sum of rates.\n u[k] = sum(q_dot[j] for j in 1..k); }",
        "for k in 2..n { fix m[k] = k; for j in k..k { circle q[j]; } }",
    );
    let by_hand = text(
        "u1 = q1_dot; u2 = q1_dot + q2_dot; u3 = q1_dot + q2_dot + q3_dot;",
        "fix m2 = 2, m3 = 3; circle q2; circle q3;",
    );
    let [looped, by_hand] = [looped, by_hand].map(|text| scene::build(&parsed(&text), "alike").unwrap());
    assert_eq!(looped.state_names(), ["q1", "q2_c", "q2_s", "q3_c", "q3_s", "u1", "u2", "u3"]);
    assert!(looped.program() == by_hand.program());
    assert_eq!(looped.params().len(), 1);
    // What is wrong in a turn is told where it is written.
    let wrong = text("for k in 1..n { u[k] = q_dot[k]; }", "for k in 2..n { fixed m[k] = 1; }");
    let problems = spec::parse("family.hamel", &wrong).unwrap_err().to_string();
    assert!(
        problems.contains("expected `fix`, `input`, `want`") && problems.contains("or `for`"),
        "{problems}"
    );
}

#[test]
fn a_build_script_asks_for_sizes() {
    let folder = std::env::temp_dir().join(format!("hamel-sizes-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let [chain, spring] = ["chain.hamel", "spring.hamel"].map(|name| folder.join(name));
    let text = "model chain { size n = 2 where n >= 1; coordinate q: vector(n) in real; \
                lagrangian = sum(q_dot[k]^2 - q[k]^2 for k in 1..n); }";
    std::fs::write(&chain, text).unwrap();
    std::fs::write(&spring, "model spring { coordinate x in real; lagrangian = x_dot^2 - x^2; }").unwrap();
    let generated = |config: &mut Config| {
        let made = config.out_dir(&folder).compile(&[&chain, &spring]);
        made.map(|()| std::fs::read_to_string(folder.join("chain.rs")).unwrap()).map_err(|e| e.to_string())
    };
    let two = generated(&mut Config::new()).unwrap();
    let five = generated(Config::new().size("n", 5)).unwrap();
    assert!(two.contains("q2_dot") && !two.contains("q5_dot") && five.contains("q5_dot"), "{five}");
    let unknown = generated(Config::new().size("m", 5)).unwrap_err();
    assert!(unknown.contains("size `m` was asked for, which is none of the models' sizes: n"), "{unknown}");
    let refused = generated(Config::new().size("n", 0)).unwrap_err();
    assert!(refused.contains("size `n` is 0, against `n >= 1`"), "{refused}");
    std::fs::remove_dir_all(&folder).unwrap();
}
