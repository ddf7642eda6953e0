//! Families of models: a file with sizes is what the text with its loops written out by hand is.

#[path = "linkages/families.rs"]
mod families;

use families::{planar_arm, planar_pendulum, wheeled_snake};
use hamel_codegen::program::Program;
use hamel_codegen::reduction::Formulation;
use hamel_codegen::scene;
use hamel_codegen::spec::{self, Model};

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
    scene::build_in(model, "bare", &formulation).unwrap_or_else(|problems| panic!("{problems}")).program
}

#[test]
fn members_have_the_equations_of_texts_written_out_by_hand() {
    let families = [
        (SNAKE, wheeled_snake as fn(usize) -> String, [3, 4]),
        (ARM, planar_arm, [3, 5]),
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
fn loops_are_kept_by_the_formatter() {
    for text in [SNAKE, ARM, PENDULUM] {
        assert_eq!(spec::format("family.hamel", text).unwrap(), text);
    }
}
