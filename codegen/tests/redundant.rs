//! Equations between coordinates that follow from others: closed loops with more equations than they need.

use std::collections::BTreeMap;

use hamel_codegen::scene::{self, BuiltScene};
use hamel_codegen::spec::{self, Model, Rational, Severity, SymbolId};

fn told(items: &str) -> Option<String> {
    spec::parse("m.hamel", &format!("model m {{\n{items}\n}}")).err().map(|problems| problems.to_string())
}

/// A model that is accepted: all that is told beside it are warnings.
fn parsed(items: &str) -> Model {
    let model = spec::parse("m.hamel", &format!("model m {{\n{items}\n}}"))
        .unwrap_or_else(|problems| panic!("{problems}"));
    assert!(model.warnings.iter().all(|told| told.severity == Severity::Warning), "{}", model.warnings);
    model
}

fn built(model: &Model) -> BuiltScene {
    scene::build(model, "default").unwrap_or_else(|problems| panic!("{problems}"))
}

fn rates(scene: &BuiltScene, params: &[f64], y: &[f64]) -> Vec<f64> {
    let mut dy = vec![0.0; y.len()];
    scene.prepare(params).expect("parameters").rhs(0.0, y, &mut dy);
    dy
}

/// The equations that a model leaves out.
fn left_out(items: &str) -> Vec<String> {
    parsed(items).implied.into_iter().map(|implied| implied.text).collect()
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
fn a_parallelogram_with_three_equations_loses_the_one_too_many() {
    let closure = "constraint along: a*cos(al) + b*cos(be) - a*cos(ga) = b;
        constraint across: a*sin(al) + b*sin(be) - a*sin(ga) = 0;";
    assert_eq!(left_out(&format!("{CRANKS} {closure}")), Vec::<String>::new());
    // A level platform, or a crank beside the other.
    for (name, third) in
        [("sin(be) = 0", "constraint level: sin(be) = 0;"), ("al - ga = 0", "constraint same: al - ga = 0;")]
    {
        let items = format!("{CRANKS} {closure} {third} initial al_dot = 0.7; multipliers;");
        let model = parsed(&items);
        let told = model.warnings.to_string();
        assert!(
            told.contains(&format!("warning: `{name}` follows from the 2 other equations: it is left out")),
            "{told}"
        );
        assert!(told.contains("it has no multiplier"), "{told}");
        assert_eq!(
            model.constraints.iter().map(|c| c.name.as_str()).collect::<Vec<_>>(),
            ["along", "across"]
        );
        // The motion is that of two equations.
        let (found, expected) = (built(&model), built(&parsed(&items.replace(third, ""))));
        assert_eq!(found.certificate().open.len(), 0);
        let y = [1.1, 0.0, 1.1, 0.7, 0.0, 0.7];
        assert_eq!(rates(&found, &[0.3, 1.0], &y), rates(&expected, &[0.3, 1.0], &y));
        let multipliers = found.outputs().iter().find(|o| o.name == "multipliers").expect("two");
        assert_eq!(multipliers.components.len(), 2);
    }
}

/// Equations that were left out are held to 31 digits: one that does not follow is found.
#[test]
fn an_equation_that_does_not_follow_is_found_by_the_certificate() {
    let mut model = parsed(&format!(
        "{CRANKS} constraint along: a*cos(al) + b*cos(be) - a*cos(ga) = b;
         constraint across: a*sin(al) + b*sin(be) - a*sin(ga) = 0; constraint level: sin(be) = 0;"
    ));
    let graph = &mut model.graph;
    let (be, tiny) = (graph.sym(model.base[1].symbol), graph.rational(Rational::new(1.into(), 10.into())));
    let al = graph.sym(model.base[0].symbol);
    let product = graph.mul(al, tiny);
    model.implied[0].residual = graph.add(be, product);
    let problems = scene::build(&model, "default").expect_err("refused").to_string();
    assert!(problems.contains("the implied equation `sin(be) = 0`"), "{problems}");
}

/// A start on the other way of assembly, where the equation that was left out does not hold.
#[test]
fn a_start_where_an_equation_that_was_left_out_does_not_hold_is_refused() {
    let closure = "constraint along: a*cos(al) + b*cos(be) - a*cos(ga) = b;
        constraint across: a*sin(al) + b*sin(be) - a*sin(ga) = 0; constraint level: sin(be) = 0;";
    let mut model = parsed(&format!("{CRANKS} {closure} initial al_dot = 0.7; multipliers;"));
    let names: Vec<String> = ["al", "be", "ga"].map(str::to_owned).to_vec();
    let prior = scene::Prior::of(&model, "default", &BTreeMap::new());
    let crossed = [1.0, -0.585_252_585_713_477_2, -1.585_252_585_713_477_2];
    assert_eq!(prior.refusal(&names, &[0.3, 0.0, 0.3]), None);
    let told = prior.refusal(&names, &crossed).expect("refused");
    assert!(
        told.contains("`sin(be) = 0` was left out") && told.contains("another way of assembly"),
        "{told}"
    );
    // Code that begins there is not written.
    let found = built(&model);
    assert!(scene::start(&model, &found).is_ok_and(|start| start.is_some()));
    for (name, value) in names.iter().zip(crossed) {
        let value = Rational::new(((value * 1e15).round() as i64).into(), 1_000_000_000_000_000_i64.into());
        let value = model.graph.rational(value);
        model.initial.iter_mut().filter(|(own, _)| own == name).for_each(|(_, e)| *e = value);
    }
    let told = scene::start(&model, &found).expect_err("refused").to_string();
    assert!(told.contains("`sin(be) = 0` was left out"), "{told}");
}

/// Where no coordinate is given, the start is zero, and not beside it on another way of assembly: the half turn of a
/// rotation that has to be the identity, where two of three equations follow.
#[test]
fn equations_are_judged_where_a_motion_without_initial_values_begins() {
    let text = "coordinate a in angle; coordinate b in angle; coordinate c in angle; coordinate d in angle;
        let turn = rot(e3, a)*rot(e2, b + 0.1)*rot(e1, c)*rot(e3, d);
        constraint turned: [turn[3, 2] - turn[2, 3], turn[1, 3] - turn[3, 1], turn[2, 1] - turn[1, 2]] = [0, 0, 0];
        lagrangian = (a_dot^2 + b_dot^2 + c_dot^2 + d_dot^2)/2 - cos(a);";
    assert_eq!(left_out(text), Vec::<String>::new());
}

/// A four-bar linkage in the plane, written in space: the same rates, and what always holds is told.
#[test]
fn a_planar_loop_in_space_moves_as_in_the_plane() {
    let bodies = "coordinate a, b, c in angle;
        let R1 = rot(e3, a); let R2 = R1*rot(e3, b); let R3 = R2*rot(e3, c);
        let p1 = R1*[0.3, 0, 0]; let p2 = p1 + R2*[1, 0, 0]; let p3 = p2 + R3*[0.8, 0, 0];
        body A { mass 1; place R1*[0.15, 0, 0]; inertia diag([0.01, 0.02, 0.03]); attitude R1; }
        body B { mass 2; place p1 + R2*[0.5, 0, 0]; inertia diag([0.01, 0.02, 0.03]); attitude R2; }
        lagrangian = A_energy + B_energy + c_dot^2/2 - 9.81*p2[2]; multipliers;
        initial a = 1; initial b = -0.8; initial c = -1.2;";
    let space = parsed(&format!(
        "{bodies} constraint closed: p3 = [1.1, 0, 0]; constraint axis: R3*[0, 0, 1] = [0, 0, 1];"
    ));
    let told = space.warnings.to_string();
    for component in [
        "component 3 of constraint `p3 = [1.1, 0, 0]`",
        "component 1 of constraint `R3*[0, 0, 1] = [0, 0, 1]`",
    ] {
        assert!(told.contains(&format!("warning: {component} always holds: it is left out")), "{told}");
    }
    let plane = parsed(&format!("{bodies} constraint closed: [p3[1], p3[2]] = [1.1, 0];"));
    let y = [1.0, -0.8, -1.2, 0.3, -0.4, 0.9];
    for (found, expected) in rates(&built(&space), &[], &y).iter().zip(rates(&built(&plane), &[], &y)) {
        assert!((found - expected).abs() < 1e-11, "{found}, expected {expected}");
    }
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
/// equations in six angles, which move in one way. Rods of 1 m and 10 kg fall; the last one comes to be at rest.
fn bricard() -> String {
    let (mut text, mut place, mut turn) = (String::new(), "[0, 0, 0]".to_owned(), "rot(e1, 0)".to_owned());
    let mut energies = Vec::new();
    for k in 1..=6 {
        let side = if k % 2 == 1 { "pi/2" } else { "-pi/2" };
        // After Hartenberg and Denavit: a link along the turned first axis after every joint.
        text += &format!(
            "let L{k} = {turn}*rot(e3, q[{k}]); let p{k} = {place} + L{k}*[1, 0, 0]; let A{k} = L{k}*rot(e1, {side});\n"
        );
        text += &format!(
            "body B{k} {{ mass 10; place {place} + L{k}*[0.5, 0, 0]; inertia diag([0, 10/12, 10/12]); attitude L{k}; }}\n"
        );
        energies.push(format!("B{k}_energy - 10*9.81*({place}[2] + L{k}[2, 1]/2)"));
        (place, turn) = (format!("p{k}"), format!("A{k}"));
    }
    let start = [1.369438406004566, 1.738244406014586];
    let start: Vec<String> = (0..6).map(|k| start[k % 2].to_string()).collect();
    format!(
        "coordinate q: vector(6) in angle;\n{text} lagrangian = {};
         constraint place: p6 = [0, 0, 0];
         constraint turn: [A6[2, 1], A6[3, 1], A6[3, 2]] = [0, 0, 0];
         multipliers; initial q = [{}];",
        energies.join(" + ").replace("[0, 0, 0][2]", "0"),
        start.join(", ")
    )
}

/// One equation is left out. The linkage moves in one way, so that its energy and its equations tell the motion: both
/// stay, that which was left out as well.
#[test]
fn bricards_linkage_falls_with_its_energy() {
    let model = parsed(&bricard());
    let told = model.warnings.to_string();
    assert!(told.contains("follows from the 5 other equations: it is left out"), "{told}");
    assert_eq!((model.constraints.len(), model.implied.len()), (5, 1));
    let scene = built(&model);
    assert!(scene.certificate().open.is_empty(), "{:?}", scene.certificate());
    let prepared = scene.prepare(&[]).expect("no parameters");
    let mut y = vec![0.0; 12];
    for (k, y) in y.iter_mut().take(6).enumerate() {
        *y = if k % 2 == 0 { 1.369438406004566 } else { 1.738244406014586 };
    }
    let residual = |y: &[f64]| {
        let known: BTreeMap<SymbolId, f64> =
            model.base.iter().map(|c| c.symbol).zip(y.iter().copied()).collect();
        let positions = model.constraints.iter().filter_map(|c| Some(c.position?.residual));
        let all = positions.chain(model.implied.iter().map(|implied| implied.residual));
        all.map(|e| model.graph.eval_f64(e, &known).expect("a number").abs()).fold(0.0, f64::max)
    };
    let energy = |y: &[f64]| prepared.energy(0.0, y).expect("an energy");
    let (before, begun) = (energy(&y), y.clone());
    assert!(residual(&y) < 1e-14);
    let step = 1e-3;
    let rates = |y: &[f64]| rates(&scene, &[], y);
    let moved =
        |y: &[f64], k: &[f64], h: f64| -> Vec<f64> { y.iter().zip(k).map(|(y, k)| y + h * k).collect() };
    let mut fastest: f64 = 0.0;
    for _ in 0..1000 {
        let k1 = rates(&y);
        let k2 = rates(&moved(&y, &k1, step / 2.0));
        let k3 = rates(&moved(&y, &k2, step / 2.0));
        let k4 = rates(&moved(&y, &k3, step));
        let sum: Vec<f64> = (0..12).map(|i| (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]) / 6.0).collect();
        y = moved(&y, &sum, step);
        fastest = y[6..].iter().fold(fastest, |f, u| f.max(u.abs()));
    }
    assert!(fastest > 1.0 && (y[0] - begun[0]).abs() > 0.3, "{y:?}");
    assert!((energy(&y) - before).abs() < 1e-7, "{}", energy(&y) - before);
    assert!(residual(&y) < 1e-8, "{}", residual(&y));
}

/// Linkages with as many equations as they need, also where they begin beside their loop.
#[test]
fn independent_equations_are_accepted() {
    let four_bar = "param a = 0.3; param b = 1; param c = 0.8; param d = 1.1; coordinate al in angle;
        coordinate be, ga in angle by a*[cos(al), sin(al)] + b*[cos(be), sin(be)] - c*[cos(ga), sin(ga)] = [d, 0];
        lagrangian = al_dot^2 + be_dot^2 + ga_dot^2;";
    let none = Vec::<String>::new();
    assert_eq!(left_out(four_bar), none);
    assert_eq!(left_out(&format!("{four_bar} initial al = 1; initial be = 0.3; initial ga = 1.2;")), none);
    // A third equation that stops the linkage is no consequence of the two: not even nearly.
    for third in ["al - ga + (al - 1)*1e-6 = 0", "sin(be) = 1e-7*(al - 1)", "al = 1"] {
        let items = format!(
            "{CRANKS} constraint a*cos(al) + b*cos(be) - a*cos(ga) = b;
             constraint a*sin(al) + b*sin(be) - a*sin(ga) = 0; constraint {third};"
        );
        if told(&items).is_none() {
            assert_eq!(left_out(&items), none, "{third}");
        }
    }
}

/// A row may be paired with a velocity that is not in it; it is solved together with others then.
#[test]
fn rows_without_their_own_velocity_are_solved_with_others() {
    let model = parsed(
        "coordinate x, y, z in real;
        constraint sphere: x^2 + y^2 + z^2 = 1;
        constraint cone: z^2 - 2*x^2 = t;
        constraint x_dot - z_dot = 0;
        lagrangian = x_dot^2 + y_dot^2 + z_dot^2;
        initial x = 0.5; initial y = 0.5; initial z = sqrt(0.5);",
    );
    // 2 z z' - 4 x x' = 1, x' = z', x x' + y y' + z z' = 0.
    let found = rates(&built(&model), &[], &[0.3, 0.5, 0.7]);
    for (found, expected) in found.iter().zip([5.0, -10.0, 5.0]) {
        assert!((found - expected).abs() < 1e-12, "{found} {expected}");
    }
}

/// The end of a rod stays on a sphere, so that the gradients of its three components depend on each other everywhere.
/// Where all are met, the first two do, and the third does not: the others would touch without it.
const SPHERE: &str = "param L = 0.5 where L > 0; coordinate a, b, c in angle;
    let R = rot(e1, a)*rot(e2, b)*rot(e3, c);
    body rod { mass 1; place R*[L/2, 0, 0]; inertia diag([0.02, 0.05, 0.04]); attitude R; }
    lagrangian = rod_energy - 2*R[2, 2]; initial c = 0.4; initial a_dot = 1;";

#[test]
fn of_gradients_that_depend_everywhere_one_is_left_out_where_the_others_do_not_touch() {
    let model =
        parsed(&format!("{SPHERE} multipliers; constraint end: R*[L, 0, 0] = rot(e3, 0.4)*[L, 0, 0];"));
    let names: Vec<&str> = model.constraints.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["end1", "end3"], "{}", model.warnings);
    let found = built(&model);
    assert!(found.certificate().open.is_empty(), "{:?}", found.certificate());
    let two = "[(R*[L, 0, 0])[1], (R*[L, 0, 0])[3]] = [L*cos(0.4), 0]";
    let expected = built(&parsed(&format!("{SPHERE} multipliers; constraint end: {two};")));
    // A turn of the rod about itself.
    let y = [0.0, 0.0, 0.4, 1.0, 0.422_793_218_738_161_84, 0.0];
    assert_eq!(rates(&found, &[0.5], &y), rates(&expected, &[0.5], &y));
}

/// A body that moves freely and is held at two points of an axis: of six equations one follows. With a third point all
/// of its equations do.
fn hinge(points: &[&str]) -> Model {
    let pins = points.iter().enumerate().map(|(k, z)| {
        let point = format!("[0.1, 0, {z}]");
        format!("constraint pin{k}: r + R*{point} = rot(e1, pi/3)*{point};")
    });
    parsed(&format!(
        "configuration R, r in SE(3) velocity w, v; param m = 2 where m > 0; param J: diagonal(3) = [0.3, 0.2, 0.4];
         param a = 0.2;
         lagrangian = m/2*dot(v, v) + dot(w, J*w)/2 - m*9.81*r3; multipliers;
         initial R = rot(e1, pi/3); {}",
        pins.collect::<String>()
    ))
}

#[test]
fn a_free_body_on_two_points_of_an_axis_is_on_a_hinge() {
    for (points, n_implied) in [(&["a", "0.7"][..], 1), (&["a", "0.7", "-3*a"][..], 4)] {
        let model = hinge(points);
        assert_eq!(model.implied.len(), n_implied, "{}", model.warnings);
        assert_eq!(model.constraints.len(), 5);
        let scene = built(&model);
        // Turned by 0.4 about the axis along the third one of the body, at (0.1, 0, .) in it.
        let (s, c) = (0.4_f64.sin(), 0.4_f64.cos());
        let tilt = std::f64::consts::FRAC_PI_3;
        let of_space =
            |[x, y, z]: [f64; 3]| [x, tilt.cos() * y - tilt.sin() * z, tilt.sin() * y + tilt.cos() * z];
        let columns = [[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]].map(of_space);
        let place = of_space([0.1 - 0.1 * c, -0.1 * s, 0.0]);
        let rate = 1.3;
        // v = -w x (0.1, 0, .)
        let velocity = [0.0, -0.1 * rate, 0.0];
        let names = scene.state_names();
        let mut state = BTreeMap::new();
        for i in 0..3 {
            state.insert(format!("w{}", i + 1), [0.0, 0.0, rate][i]);
            state.insert(format!("v{}", i + 1), velocity[i]);
            state.insert(format!("r{}", i + 1), place[i]);
            (0..3).for_each(|j| _ = state.insert(format!("R{}{}", i + 1, j + 1), columns[j][i]));
        }
        let y: Vec<f64> = names.iter().map(|name| state[name]).collect();
        let m = 2.0;
        let params = [m, 0.3, 0.2, 0.4, 0.2];
        assert_eq!(scene.params().len(), params.len());
        let found = rates(&scene, &params, &y);
        // A pendulum whose mass centre is 0.1 from the axis.
        let height_slope = tilt.sin() * -0.1 * c;
        let expected = -m * 9.81 * height_slope / (0.4 + m * 0.01);
        let at = names.iter().position(|name| name == "w3").expect("a velocity");
        assert!((found[at] - expected).abs() < 1e-12, "{} {expected}", found[at]);
    }
}

/// The direction of an axis of a body has three components, of which one follows; a wrong one is found.
#[test]
fn equations_between_rotations_are_held_by_the_certificate() {
    let mut model = parsed(
        "configuration R in SO(3) velocity w; param J: diagonal(3) = [0.3, 0.2, 0.4];
         lagrangian = dot(w, J*w)/2 - R[3, 1]; multipliers; initial R = rot(e2, atan(3/4));
         constraint axis: R*[0, 0, 1] = rot(e2, atan(3/4))*[0, 0, 1];",
    );
    assert_eq!((model.constraints.len(), model.implied.len()), (2, 1), "{}", model.warnings);
    let scene = built(&model);
    assert!(scene.certificate().open.is_empty(), "{:?}", scene.certificate());
    let graph = &mut model.graph;
    let entry = graph.sym(model.configurations[0].symbols[1]);
    let tiny = graph.rational(Rational::new(1.into(), 1_000_000_000_000_i64.into()));
    let product = graph.mul(entry, tiny);
    model.implied[0].residual = graph.add(model.implied[0].residual, product);
    let told = scene::build(&model, "default").err().map(|problems| problems.to_string());
    assert!(told.is_some_and(|told| told.contains("the implied equation")));
}
