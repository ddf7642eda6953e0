use super::super::ast::ItemKind;
use super::super::diagnostic::Origin;
use super::super::images::with_items;
use super::super::parser;
use super::super::parts::uses;
use super::held;
use super::taken::Part;

const PART: &str = "model arm {
    param m = 1.5 where m > 0;
    param r = 0.4;
    param I: diagonal(3) = [1, 2, 3];
    input tau = 0;
    velocity w in so(3);
    coordinate q in real;
    coordinate p in real;
    advected e in R^3 by cross(w, e);
    let v = q_dot + r*w1;
    lagrangian = m*v^2/2 + dot(w, I*w)/2 + I2*p_dot^2 - m*r*e3 - q^2*p^2;
    force w = tau*e;
    force q_dot = -r*q_dot;
    constraint rolls: p_dot = r*w2;
    output height = r*e3 + q;
}";

/// Its names stand for other things, so that a name which is forgotten has a meaning.
const WHOLE: &str = "model whole {
    use \"arm.hamel\" as a;
    param m = 2;
    param r = 3;
    param I: diagonal(3) = [3, 4, 5];
    input tau = 0;
    coordinate q in real;
    coordinate p in real;
    coordinate z: vector(3) in real;
    let v = 3*q_dot;
    let w = z_dot;
    let w1 = z2_dot;
    let w2 = z1_dot;
    let e = z;
    let e3 = z1;
    lagrangian = q_dot^2 + p_dot^2 + z1_dot^2 + z2_dot^2 + z3_dot^2;
    constraint rolls: p_dot = m*r*q_dot;
    output height = v;
}";

fn part() -> Part {
    let file = parser::parse_leniently(WHOLE).file.unwrap();
    let (item, used) = uses(&file.items).next().unwrap();
    let origin = Origin { file: "arm.hamel".into(), text: PART.into() };
    let model = super::super::parse("arm.hamel", PART).unwrap();
    Part::new((item, used), &file.items, origin, model).unwrap()
}

/// Whether the whole is a model, and whether it is held to the part.
fn held_to(part: Part) -> (bool, bool) {
    let file = parser::parse_leniently(WHOLE).file.unwrap();
    let text = with_items(WHOLE, &part.block(WHOLE));
    let is_model = super::super::parse("whole.hamel", &text).is_ok();
    let whole = Origin { file: "whole.hamel".into(), text };
    (is_model, held::hold(&whole, &file, &[part]).is_ok())
}

#[test]
fn what_is_taken_is_what_the_part_has() {
    assert_eq!(held_to(part()), (true, true));
}

/// Every name that stays as it is in the part stands for something of the whole: this is found.
#[test]
fn a_name_that_is_forgotten_is_found() {
    let n = part().edits.len();
    assert!(n > 30, "{n} names");
    let mut n_models = 0;
    for k in 0..n {
        let mut wrong = part();
        let (range, _) = wrong.edits.remove(k);
        let (is_model, is_held) = held_to(wrong);
        let line = &PART[..range.start];
        let line = &PART[line.rfind('\n').unwrap_or(0)..range.start];
        assert!(!is_model || !is_held, "a name behind `{line}` was forgotten, and nobody tells");
        n_models += usize::from(is_model);
    }
    // Most of them make another model, which nothing else would tell.
    assert!(n_models > 10, "{n_models} models");
}

/// A term with another sign, a constraint that is lost, a factor.
#[test]
fn another_text_is_found() {
    let changes = [
        (" - m*r*e3", " + m*r*e3"),
        ("constraint rolls: p_dot = r*w2;", ""),
        ("force q_dot = -r*q_dot;", "force q_dot = -2*r*q_dot;"),
        ("output height = r*e3 + q;", "output height = r*e2 + q;"),
        ("in so(3)", "in R^3"),
    ];
    for (from, to) in changes {
        let text = PART.replace(from, to);
        assert_ne!(text, PART);
        let origin = Origin { file: "arm.hamel".into(), text };
        let file = parser::parse_leniently(WHOLE).file.unwrap();
        let (item, used) = uses(&file.items).next().unwrap();
        // The model is that of the file, the text another one.
        let model = super::super::parse("arm.hamel", PART).unwrap();
        let wrong = Part::new((item, used), &file.items, origin, model).unwrap();
        assert_eq!(held_to(wrong), (true, false), "{from}");
    }
    assert!(matches!(parser::parse_leniently(WHOLE).file.unwrap().items[0].kind, ItemKind::Use(_)));
}
