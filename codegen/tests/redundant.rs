//! Equations between coordinates that follow from others: closed loops with more equations than they need.

use hamel_codegen::spec;

fn told(items: &str) -> Option<String> {
    spec::parse("m.hamel", &format!("model m {{\n{items}\n}}")).err().map(|problems| problems.to_string())
}

fn refused(items: &str, message: &str, help: &str) {
    let told = told(items).unwrap_or_else(|| panic!("accepted: {items}"));
    assert!(told.contains(message), "{told}");
    assert!(told.contains(help), "{told}");
}

/// A third crank beside the two of a parallelogram: its closure gives one equation that the others imply.
const CRANKS: &str = "param a = 0.3; param b = 1; coordinate al, be, ga in angle;
    lagrangian = al_dot^2/2 + be_dot^2/2 + ga_dot^2;
    initial al = 1; initial be = 0; initial ga = 1;";

#[test]
fn a_parallelogram_with_three_equations_says_which_is_too_many() {
    let closure = "constraint along: a*cos(al) + b*cos(be) - a*cos(ga) = b;
        constraint across: a*sin(al) + b*sin(be) - a*sin(ga) = 0;";
    assert_eq!(told(&format!("{CRANKS} {closure}")), None);
    refused(
        &format!("{CRANKS} {closure} constraint level: sin(be) = 0;"),
        "follows from the 2 other equations",
        "leave it out: a motion that keeps the others keeps it",
    );
    // Two platforms on three cranks of one length, the second one redundant.
    refused(
        &format!("{CRANKS} {closure} constraint same: al - ga = 0; multipliers;"),
        "follows from the 2 other equations",
        "leave it out",
    );
}

/// Lengths that are equal by their defaults alone.
#[test]
fn equal_lengths_by_several_parameters_are_told() {
    refused(
        &format!(
            "param c = 0.3; {CRANKS} constraint a*cos(al) + b*cos(be) - c*cos(ga) = b;
             constraint a*sin(al) + b*sin(be) - c*sin(ga) = 0; constraint sin(be) = 0;"
        ),
        "for the default values of the parameters",
        "one parameter in the place of several",
    );
}

/// A coordinate that is given by an equation of which nothing is left.
#[test]
fn a_coordinate_by_a_redundant_equation_is_free() {
    refused(
        "param a = 0.3; coordinate al in angle; coordinate x in real by x = a*cos(al);
         coordinate y in real by x^2 + y^2 = a^2; coordinate z in real by x*cos(al) + y*sin(al) = a;
         lagrangian = al_dot^2 + x_dot^2 + y_dot^2 + z_dot^2; initial al = 1; initial y = 0.25;",
        "follows from the 2 other equations",
        "without `by`",
    );
}

#[test]
fn squares_of_equations_have_no_gradients() {
    refused(
        "coordinate x, y, z in real; constraint (x - y)^2 = 0; constraint x^2 + z^2 = 1;
         lagrangian = x_dot^2 + y_dot^2 + z_dot^2; initial x = 0.6; initial y = 0.6; initial z = 0.8;",
        "depend on each other wherever they hold",
        "in the place of `f^2 = 0`",
    );
}

/// Bricard's linkage of six equal links with right angles between axes, `cos q + cos r + cos q cos r = 0`: six
/// equations in six angles, which move in one way.
#[test]
fn bricards_linkage_has_one_equation_too_many() {
    let joints = (1..=6).map(|k| {
        let side = if k % 2 == 1 { "pi/2" } else { "-pi/2" };
        format!("let R{k} = rot(e3, q[{k}])*rot(e1, {side});")
    });
    let joints: String = joints.collect();
    // After Hartenberg and Denavit: a link along the turned first axis after every joint.
    let items = format!(
        "coordinate q: vector(6) in angle; {joints}
         let A1 = R1; let A2 = A1*R2; let A3 = A2*R3; let A4 = A3*R4; let A5 = A4*R5; let A6 = A5*R6;
         let p = rot(e3, q[1])*[1, 0, 0] + A1*rot(e3, q[2])*[1, 0, 0] + A2*rot(e3, q[3])*[1, 0, 0]
             + A3*rot(e3, q[4])*[1, 0, 0] + A4*rot(e3, q[5])*[1, 0, 0] + A5*rot(e3, q[6])*[1, 0, 0];
         constraint p = [0, 0, 0];
         constraint [A6[2, 1], A6[3, 1], A6[3, 2]] = [0, 0, 0];
         lagrangian = dot(rate(q), rate(q)); multipliers;
         initial q = [{q}, {r}, {q}, {r}, {q}, {r}];",
        q = 1.369438406004566,
        r = 1.738244406014586,
    );
    let told = told(&items).unwrap_or_else(|| panic!("accepted"));
    assert!(told.contains("follows from the 5 other equations"), "{told}");
}

/// Linkages with as many equations as they need, also where they begin beside their loop.
#[test]
fn independent_equations_are_accepted() {
    let four_bar = "param a = 0.3; param b = 1; param c = 0.8; param d = 1.1; coordinate al in angle;
        coordinate be, ga in angle by a*[cos(al), sin(al)] + b*[cos(be), sin(be)] - c*[cos(ga), sin(ga)] = [d, 0];
        lagrangian = al_dot^2 + be_dot^2 + ga_dot^2;";
    assert_eq!(told(four_bar), None);
    assert_eq!(told(&format!("{four_bar} initial al = 1; initial be = 0.3; initial ga = 1.2;")), None);
}
