//! Models as quotients of others: every shipped model of which there is an unreduced twin, chains of stages, and
//! planted faults.

use hamel_codegen::quotient::{Step, hold, hold_file, read_totals, read_totals_of_file};
use hamel_codegen::scene::{self, Role};
use hamel_codegen::spec::{self, Model, Origin};

fn folder() -> std::path::PathBuf {
    std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../models")
}

/// Shipped models and functions of their unreduced twins for variables and parameters with other names.
const TWINS: &[(&str, &str)] = &[
    ("ball_on_rotating_table", "Omega = nu; omega_x = w[1]; omega_y = w[2]; omega_z = w[3];"),
    (
        "car_with_trailers",
        "m0 = m1; m1 = m2; m2 = m3; J0 = J1; J1 = J2; J2 = J3; d0 = d1; d1 = d2; d2 = d3; omega = theta_dot;
         v = [v, -sin(theta)*x_dot + cos(theta)*y_dot];",
    ),
    ("chaplygin_ball", "Gamma = transpose(R)*[0, 0, 1]; X = transpose(R)*x_dot;"),
    ("chaplygin_gyro", "Gamma = transpose(R)*[0, 0, 1]; X = transpose(R)*x_dot;"),
    ("chaplygin_sleigh", "omega = theta_dot; v = [dot(c, [x_dot, y_dot]), dot(n, [x_dot, y_dot])];"),
    ("double_spherical_pendulum", "phi = phi2 - phi1; phi_dot = phi2_dot - phi1_dot;"),
    ("euler_disk", "X = [x_dot, y_dot];"),
    ("extended_pose", "V = V; U = U;"),
    ("free_rigid_body", ""),
    ("heavy_top", "Gamma = transpose(R)*[0, 0, 1];"),
    ("kirchhoff_body", "V = V;"),
    ("mobile_robot", "omega = theta_dot; v = [ahead, aside];"),
    (
        "roller_racer",
        "omega = theta_dot; v = [cos(theta)*x_dot + sin(theta)*y_dot, -sin(theta)*x_dot + cos(theta)*y_dot];",
    ),
    ("rolling_ball", "xi = w;"),
    ("rolling_disk", "v = [cos(phi)*x_dot + sin(phi)*y_dot, -sin(phi)*x_dot + cos(phi)*y_dot];"),
    ("satellite_with_wheels", "w = phi_dot; S = S;"),
    (
        "skate_on_incline",
        "omega = theta_dot; v = [cos(theta)*x_dot + sin(theta)*y_dot, -sin(theta)*x_dot + cos(theta)*y_dot];
         d = [cos(theta), -sin(theta)]; descent = x;",
    ),
    (
        "snake",
        "omega = theta_dot; v = [cos(theta)*x_dot + sin(theta)*y_dot, -sin(theta)*x_dot + cos(theta)*y_dot];",
    ),
    (
        "snakeboard",
        "omega = theta_dot; v = [cos(theta)*x_dot + sin(theta)*y_dot, -sin(theta)*x_dot + cos(theta)*y_dot];",
    ),
    ("suslov", ""),
    ("tethered_body", "V = transpose(R)*r_dot; a = transpose(R)*(a - r);"),
    ("two_arm_satellite", ""),
    ("underwater_vehicle", "V = V; Gamma = transpose(R)*[0, 0, 1];"),
    ("veselova", "gamma = transpose(R)*[0, 0, 1];"),
];

/// A shipped model that says to be the quotient of its twin.
fn as_quotient(name: &str, images: &str) -> (String, Model) {
    let of = |folder_of_it: &str| {
        std::fs::read_to_string(folder().join(folder_of_it).join(format!("{name}.hamel")))
    };
    let text = of("specs").or_else(|_| of("shelf")).unwrap_or_else(|e| panic!("{name}: {e}"));
    let text = spec::with_items(&text, &format!("reduces \"{name}.hamel\" {{ {images} }}\n"));
    let model = spec::parse(&format!("{name}.hamel"), &text).unwrap_or_else(|e| panic!("{e}"));
    (text, model)
}

fn held(model: &Model) -> Result<Vec<Step>, String> {
    let problems = hold_file(model, &folder().join("unreduced/quotient.hamel"));
    problems.map_err(|list| list.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))
}

#[test]
fn shipped_models_are_quotients_of_their_twins() {
    for (name, images) in TWINS {
        let (_, model) = as_quotient(name, images);
        let steps = held(&model).unwrap_or_else(|problems| panic!("{name}: {problems}"));
        let [step] = steps.as_slice() else { panic!("{name}: {steps:?}") };
        println!("{name}: {:?}", step.proved);
        // Symmetry takes coordinates away and keeps all velocities.
        assert_eq!(step.proved.velocities.0, step.proved.velocities.1, "{name}");
        assert_eq!(step.proved.displacements.0, step.proved.displacements.1, "{name}");
        assert!(step.proved.n_conditions > 0, "{name}");
    }
}

/// The problems of a model that says to be the quotient of another, both as texts.
fn related(total: &str, quotient: &str) -> Result<Step, String> {
    let model = spec::parse("quotient.hamel", quotient).unwrap_or_else(|e| panic!("{e}"));
    let mut read = |_: &str, file: &str| match file {
        "total.hamel" => Ok(Origin { file: file.to_owned(), text: total.to_owned() }),
        _ => Err("there is no such file".to_owned()),
    };
    let steps = hold(&model, &mut read);
    let steps = steps.map_err(|list| list.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))?;
    Ok(steps.into_iter().next().expect("one step"))
}

/// A word of a shipped model or of its functions, another in its place, and the message.
const FAULTS: &[(&str, &str, &str, &str)] = &[
    // The map.
    ("heavy_top", "Gamma = transpose(R)*[0, 0, 1]", "Gamma = R*[0, 0, 1]", "the rate of `Gamma1` along"),
    (
        "heavy_top",
        "Gamma = transpose(R)*[0, 0, 1]",
        "Gamma = -transpose(R)*[0, 0, 1]",
        "the Lagrangian differs by",
    ),
    ("kirchhoff_body", "V = V", "V = r_dot", "of the bracket ["),
    ("kirchhoff_body", "V = V", "V = 2*V", "the Lagrangian differs by"),
    ("chaplygin_sleigh", "omega = theta_dot", "omega = -theta_dot", "of the bracket ["),
    ("rolling_ball", "xi = w", "xi = Omega", "of the bracket ["),
    ("mobile_robot", "v = [ahead, aside]", "v = [aside, ahead]", "of the bracket ["),
    ("tethered_body", "(a - r)", "(a + r)", "the rate of `a1` along"),
    ("ball_on_rotating_table", "Omega = nu", "Omega = -nu", "the constraint `x_dot - r*omega_y = -Omega*y`"),
    // The model.
    ("heavy_top", "- m*g*l*dot(Gamma, chi)", "+ m*g*l*dot(Gamma, chi)", "the Lagrangian differs by"),
    ("tethered_body", "by cross(Omega, a) + V", "by cross(Omega, a) - V", "the rate of `a1` along"),
    ("rolling_ball", "action right", "action left", "of the bracket ["),
    ("suslov", "constraint Omega3 = 0", "constraint Omega2 = 0", "the constraint `Omega2 = 0`"),
    ("snakeboard", "omega = sin(phi)*s", "omega = -sin(phi)*s", "the constraints `"),
    ("roller_racer", "- c*phi_dot", "+ c*phi_dot", "the power of the forces"),
    ("satellite_with_wheels", "+ c*Omega", "+ 2*c*Omega", "the power of the forces"),
];

#[test]
fn planted_faults_are_found() {
    for (name, right, wrong, said) in FAULTS {
        let images =
            TWINS.iter().find(|(model, _)| model == name).map(|(_, images)| *images).expect("a twin");
        let (text, _) = as_quotient(name, images);
        assert!(text.contains(right), "{name} has no {right}");
        let text = text.replacen(right, wrong, 1);
        let model = spec::parse(&format!("{name}.hamel"), &text).unwrap_or_else(|e| panic!("{e}"));
        let problems = held(&model).map(|steps| format!("{steps:?}")).expect_err(wrong);
        assert!(problems.contains(said), "{name}, {wrong}: {problems}");
    }
}

const SKATE: &str = "model skate {
    param m = 1 where m > 0;
    param J = 0.2 where J > 0;
    coordinate x, y in real;
    coordinate theta in angle;
    lagrangian = m/2*(x_dot^2 + y_dot^2) + J/2*theta_dot^2;
    constraint cos(theta)*y_dot = sin(theta)*x_dot;
    force theta_dot = -theta_dot;
}";

const TURNING: &str = "model turning {
    param m = 1 where m > 0;
    param J = 0.2 where J > 0;
    param w = 3;
    coordinate u, v in real;
    coordinate psi in angle;
    let a = u_dot - w*v;
    let b = v_dot + w*u;
    lagrangian = m/2*(a^2 + b^2) + J/2*(psi_dot + w)^2;
    constraint cos(psi)*b = sin(psi)*a;
    force psi_dot = -(psi_dot + w);
    reduces \"total.hamel\" {
        w = 3*m/m;
        u = cos(3*t)*x + sin(3*t)*y;
        v = -sin(3*t)*x + cos(3*t)*y;
        psi = theta - 3*t;
        u_dot = cos(3*t)*x_dot + sin(3*t)*y_dot + 3*(-sin(3*t)*x + cos(3*t)*y);
        v_dot = -sin(3*t)*x_dot + cos(3*t)*y_dot - 3*(cos(3*t)*x + sin(3*t)*y);
        psi_dot = theta_dot - 3;
    }
}";

#[test]
fn a_map_may_move_with_time() {
    let step = related(SKATE, TURNING).unwrap_or_else(|problems| panic!("{problems}"));
    assert_eq!((step.proved.base, step.proved.displacements), ((3, 3), (2, 2)));
    let wrong = TURNING.replace("psi_dot = theta_dot - 3", "psi_dot = theta_dot");
    let problems = related(SKATE, &wrong).expect_err("a wrong velocity");
    assert!(problems.contains("the rate of `psi` along d/dt differs by `-3`"), "{problems}");
}

/// Examples of the documentation are quotients of the files that they name.
#[test]
fn examples_hold() {
    let docs = folder().join("../docs");
    let mut n_held = 0;
    for page in ["model-language.md", "book/stages.md"] {
        let text = std::fs::read_to_string(docs.join(page)).unwrap_or_else(|e| panic!("{page}: {e}"));
        let blocks = text.split("```hamel\n").skip(1).filter_map(|rest| rest.split("```").next());
        for block in blocks.filter(|block| block.contains("reduces \"")) {
            let model = spec::parse(page, &format!("model example {{ {block} }}"));
            let model = model.unwrap_or_else(|e| panic!("{e}"));
            if let Err(problems) = hold_file(&model, &docs.join("book/example.hamel")) {
                panic!("{page}: {}", problems[0]);
            }
            n_held += 1;
        }
    }
    assert_eq!(n_held, 3);
}

#[test]
fn other_displacements_are_found() {
    let quotient = |more: &str| {
        let text = spec::with_items(SKATE, &format!("{more} reduces \"total.hamel\" {{}}"));
        related(SKATE, &text)
    };
    assert_eq!(quotient("").map(|step| step.proved.displacements), Ok((2, 2)));
    let problems = quotient("virtual delta(theta_dot) = 0;").expect_err("other displacements");
    assert!(problems.contains("the condition on displacements of the quotient does not hold"), "{problems}");
}

/// A body in an ideal fluid by translations first, then by turns: `Q -> Q/N -> Q/G`.
const STAGES: [&str; 3] = [
    "model body { param J: diagonal(3) = [3, 2, 1]; param M: diagonal(3) = [2, 3, 4];
        configuration R in SO(3) velocity Omega; coordinate r: vector(3) in real;
        let V = transpose(R)*r_dot;
        lagrangian = dot(Omega, J*Omega)/2 + dot(V, M*V)/2; }",
    "model by_translations { param J: diagonal(3) = [3, 2, 1]; param M: diagonal(3) = [2, 3, 4];
        velocity v in R^3; configuration R in SO(3) velocity Omega;
        let V = transpose(R)*v;
        lagrangian = dot(Omega, J*Omega)/2 + dot(V, M*V)/2;
        reduces \"body.hamel\" { v = r_dot; } }",
    "model by_all { param J: diagonal(3) = [3, 2, 1]; param M: diagonal(3) = [2, 3, 4];
        velocity Omega, V in se(3);
        lagrangian = dot(Omega, J*Omega)/2 + dot(V, M*V)/2;
        reduces \"by_translations.hamel\" { V = transpose(R)*v; }
        reduces \"body.hamel\" { V = transpose(R)*r_dot; } }",
];

#[test]
fn stages_are_a_chain() {
    let [body, by_translations, by_all] = STAGES;
    let model = spec::parse("by_all.hamel", by_all).unwrap_or_else(|e| panic!("{e}"));
    let mut read = |_: &str, file: &str| {
        let text = if file == "body.hamel" { body } else { by_translations };
        Ok(Origin { file: file.to_owned(), text: text.to_owned() })
    };
    let steps = hold(&model, &mut read).unwrap_or_else(|e| panic!("{}", e[0]));
    let told: Vec<_> = steps.iter().map(|s| (s.quotient.as_str(), s.total.as_str(), s.proved.base)).collect();
    let wanted = [
        ("by_all.hamel", "by_translations.hamel", (9, 0)),
        ("by_translations.hamel", "body.hamel", (12, 9)),
        ("by_all.hamel", "body.hamel", (12, 0)),
    ];
    assert_eq!(told, wanted);
}

#[test]
fn problems_are_told_at_their_places() {
    let cases = [
        ("psi = theta - 3*t;", "psi = thet - 3*t;", "did you mean `theta`?"),
        ("psi = theta - 3*t;", "psi = [theta, 3*t];", "`psi` has 1 number, found 2 numbers"),
        (
            "psi = theta - 3*t;",
            "psi = theta_dot;",
            "depends on more than coordinates and time of `total.hamel`",
        ),
        (
            "psi_dot = theta_dot - 3;",
            "psi_dot = theta_dot^2;",
            "is not affine in the velocities of `total.hamel`",
        ),
        ("psi = theta - 3*t;", "", "`psi` is no function of `total.hamel`, which has no `psi`"),
        ("w = 3*m/m;", "w = x;", "the function for `w` depends on more"),
        ("psi = theta - 3*t;", "spi = theta - 3*t;", "did you mean `psi`?"),
        ("psi = theta - 3*t;", "psi = theta - 3*t; psi = theta;", "`psi` is given twice"),
        ("total.hamel", "other.hamel", "`other.hamel` cannot be read: there is no such file"),
    ];
    for (right, wrong, said) in cases {
        let text = TURNING.replacen(right, wrong, 1);
        let problems = match spec::parse("quotient.hamel", &text) {
            Err(problems) => problems.to_string(),
            Ok(_) => related(SKATE, &text).expect_err(wrong),
        };
        assert!(problems.contains(said), "{wrong}: {problems}");
        assert!(problems.contains("--> quotient.hamel:"), "{wrong}: {problems}");
    }
    let problems = related("model m { lagrangian = x^2; }", TURNING).expect_err("a wrong model");
    assert!(problems.contains("--> total.hamel:1:24"), "{problems}");
    let spring = "model s { coordinate x in real; lagrangian = x_dot^2 - x^2; }";
    let given = "model q { coordinate x in real; acceleration x_dot = -x; reduces \"total.hamel\" {} }";
    let problems = related(spring, given).expect_err("no Lagrangian");
    assert!(problems.contains("this model has a motion that is given"), "{problems}");
}

/// Terms of a Lagrangian that are linear in velocities are forces without power: the model has one, its quotient the
/// other. Models, what the quotient has beside the kinetic energy, and a wrong sign in it.
const GYROSCOPIC: [(&str, &str, &str, &str); 5] = [
    (
        "coordinate x, y in real; lagrangian = (x_dot^2 + y_dot^2)/2 + 3*(x*y_dot - y*x_dot);",
        "velocity u, v in R^2; lagrangian = (u^2 + v^2)/2; force u = 6*v; force v = -6*u;",
        "force v = -6*u",
        "u = x_dot; v = y_dot;",
    ),
    // The same field by another potential: both differ by a rate.
    (
        "coordinate x, y in real; lagrangian = (x_dot^2 + y_dot^2)/2 + 6*x*y_dot;",
        "velocity u, v in R^2; lagrangian = (u^2 + v^2)/2; force u = 6*v; force v = -6*u;",
        "force u = 6*v",
        "u = x_dot; v = y_dot;",
    ),
    // A potential that moves with time has a part that is no magnetic field.
    (
        "coordinate x, y in real; lagrangian = (x_dot^2 + y_dot^2)/2 + t*x*y_dot;",
        "coordinate x, y in real; lagrangian = (x_dot^2 + y_dot^2)/2; force x_dot = t*y_dot; force y_dot = -x - t*x_dot;",
        "force y_dot = -x",
        "",
    ),
    // A wheel in a body, velocities of the body and velocities in space.
    (
        "velocity w in so(3); lagrangian = dot(w, [1, 2, 3]*w)/2 + dot([4, 5, 6], w);",
        "velocity w in so(3); lagrangian = dot(w, [1, 2, 3]*w)/2; force w = 1*cross([4, 5, 6], w);",
        "force w = 1",
        "",
    ),
    (
        "velocity w in so(3); action right; lagrangian = dot(w, [1, 2, 3]*w)/2 + dot([4, 5, 6], w);",
        "velocity w in so(3); action right; lagrangian = dot(w, [1, 2, 3]*w)/2; force w = -1*cross([4, 5, 6], w);",
        "force w = -1",
        "",
    ),
];

#[test]
fn forces_without_power_may_stand_in_the_lagrangian() {
    for (total, quotient, term, images) in GYROSCOPIC {
        let total = format!("model total {{ {} }}", total.replace("[1, 2, 3]*w", "diag([1, 2, 3])*w"));
        let text = |quotient: &str| {
            let quotient = quotient.replace("[1, 2, 3]*w", "diag([1, 2, 3])*w");
            format!("model quotient {{ {quotient} reduces \"total.hamel\" {{ {images} }} }}")
        };
        related(&total, &text(quotient)).unwrap_or_else(|problems| panic!("{quotient}: {problems}"));
        let (name, value) = term.split_once(" = ").expect("a force");
        let other = match value.strip_prefix('-') {
            Some(value) => format!("{name} = {value}"),
            None => format!("{name} = -{value}"),
        };
        assert!(quotient.contains(term), "{quotient} has no {term}");
        let problems = related(&total, &text(&quotient.replace(term, &other))).expect_err("another sign");
        assert!(problems.contains("the power of the forces"), "{problems}");
        // A difference at rest is one of the energy.
        let problems = related(&total, &text(&quotient.replace("/2; force", "/2 + 7; force")));
        let problems = problems.expect_err("another energy");
        assert!(problems.contains("the Lagrangian differs by `"), "{problems}");
    }
}

/// The model of a text with the text of the model that it is the quotient of.
fn with_total(total: &str, quotient: &str) -> Result<Model, spec::Diagnostics> {
    let model = spec::parse("quotient.hamel", quotient)?;
    read_totals(model, &mut |_, file| Ok(Origin { file: file.to_owned(), text: total.to_owned() }))
}

const TOP_IN_SPACE: &str = "model top_in_space {
    param I: diagonal(3) = [1.3, 1.7, 0.6]; param chi: vector(3) = [0, 0.6, 0.8];
    param m = 2; param g = 9; param l = 0.25;
    configuration R in SO(3) velocity Omega;
    lagrangian = dot(Omega, I*Omega)/2 - m*g*l*dot(transpose(R)*[0, 0, 1], chi); }";

const TOP: &str = "model top {
    param I: diagonal(3) = [1.3, 1.7, 0.6] where I1 > 0, I2 > 0, I3 > 0;
    param chi: vector(3) = [0, 0.6, 0.8]; param k = 2;
    velocity Omega in so(3);
    momentum Pi of Omega;
    advected Gamma in R^3 by cross(Omega, Gamma);
    lagrangian = dot(Omega, I*Omega)/2 - k*dot(Gamma, chi);
    reduces \"total.hamel\" { k = m*g*l; Gamma = transpose(R)*[0, 0, 1]; }
    scene mapped { want rhs, quotient; }
    scene by_momenta { carry Pi; want rhs, quotient; }
    scene still { fix k = 2; want rhs, quotient; }
}";

/// Components of a matrix that turns by `1` about `[0, 0.6, 0.8]`.
const TURNED: [f64; 9] = {
    let (c, s) = (0.540_302_305_868_139_8, 0.841_470_984_807_896_5);
    let d = 1.0 - c;
    [c, -0.8 * s, 0.6 * s, 0.8 * s, c + 0.36 * d, 0.48 * d, -0.6 * s, 0.48 * d, c + 0.64 * d]
};

#[test]
fn the_map_is_a_function_of_the_total_state() {
    let model = with_total(TOP_IN_SPACE, TOP).unwrap_or_else(|e| panic!("{e}"));
    let built = scene::build(&model, "mapped").unwrap_or_else(|e| panic!("{e}"));
    let certificate = built.certificate();
    assert!(certificate.held.contains_key("quotient"), "{certificate:?}");
    assert!(certificate.held.contains_key("quotient_parameters"), "{certificate:?}");
    assert!(certificate.open.is_empty(), "{certificate:?}");
    let function = built.program().function(&Role::OfVariables("quotient".to_owned())).expect("the map");
    let is_params = |name: &String| name == "m" || name == "g" || name == "l";
    assert_eq!(function.argument.iter().filter(|name| is_params(name)).count(), 3);
    let total: Vec<f64> = function
        .argument
        .iter()
        .map(|name| match name.strip_prefix('R') {
            Some(place) => {
                let (i, j) = place.split_at(1);
                let [i, j] = [i, j].map(|k| k.parse::<usize>().expect("a number") - 1);
                TURNED[3 * i + j]
            }
            None => match name.as_str() {
                "Omega1" => 0.1,
                "Omega2" => 0.2,
                "Omega3" => 0.3,
                "I1" => 1.5,
                "I2" => 1.7,
                "I3" => 0.6,
                "m" => 3.0,
                "g" => 8.0,
                "l" => 0.5,
                "chi1" => 0.0,
                "chi2" => 0.6,
                _ => 0.8,
            },
        })
        .collect();
    for name in ["mapped", "by_momenta"] {
        let built = scene::build(&model, name).unwrap_or_else(|e| panic!("{e}"));
        let executable = built.executable();
        let own = vec![1.0; executable.program.params.len()];
        let interpreter = executable.prepare(&own).unwrap_or_else(|e| panic!("{e:?}"));
        let state = interpreter.quotient(0.0, &total).expect("the map");
        let params = interpreter.quotient_parameters(0.0, &total).expect("the parameters");
        for (name, x) in executable.program.state.iter().zip(state) {
            let wanted = match name.as_str() {
                "Gamma1" => TURNED[6],
                "Gamma2" => TURNED[7],
                "Gamma3" => TURNED[8],
                "Omega1" => 0.1,
                "Omega2" => 0.2,
                "Omega3" => 0.3,
                "Pi1" => 1.5 * 0.1,
                "Pi2" => 1.7 * 0.2,
                "Pi3" => 0.6 * 0.3,
                name => panic!("{name}"),
            };
            assert!((x - wanted).abs() < 1e-15, "{name}: {x}, {wanted}");
        }
        let k = executable.program.params.iter().position(|name| name == "k").expect("k");
        assert!((params[k] - 12.0).abs() < 1e-14, "{params:?}");
    }
}

#[test]
fn scenes_without_a_map_say_why() {
    let cases = [(TOP, "still", "the scene fixes k, and the map gives it as"), (TOP, "mapped", "")];
    for (text, name, said) in cases {
        let model = with_total(TOP_IN_SPACE, text).unwrap_or_else(|e| panic!("{e}"));
        let built = scene::build(&model, name).map(|_| ()).map_err(|e| e.to_string());
        match said.is_empty() {
            true => assert_eq!(built, Ok(())),
            false => {
                let problem = built.expect_err(said);
                assert!(problem.contains(said) && problem.contains("--> quotient.hamel:"), "{problem}");
            }
        }
    }
    // The group has no image.
    let text = TOP.replace(
        "    scene mapped { want rhs, quotient; }",
        "    reconstruct q in SO(3);\n    scene mapped { want rhs, reconstruction, quotient; }",
    );
    let model = with_total(TOP_IN_SPACE, &text).unwrap_or_else(|e| panic!("{e}"));
    let problem = scene::build(&model, "mapped").expect_err("a coordinate of the group").to_string();
    assert!(problem.contains("the map gives no q"), "{problem}");
    // A map that is wrong makes no function.
    let text = TOP.replace("Gamma = transpose(R)", "Gamma = -1*transpose(R)");
    let model = with_total(TOP_IN_SPACE, &text).unwrap_or_else(|e| panic!("{e}"));
    let problem = scene::build(&model, "mapped").expect_err("a wrong map").to_string();
    assert!(problem.contains("the Lagrangian differs by"), "{problem}");
    // Nobody has read the other text.
    let model = spec::parse("quotient.hamel", TOP).unwrap_or_else(|e| panic!("{e}"));
    let problem = scene::build(&model, "mapped").expect_err("no text").to_string();
    assert!(problem.contains("the text of `total.hamel` is not known"), "{problem}");
    let problem = read_totals(model, &mut |_, _| Err("gone".to_owned())).expect_err("no file").to_string();
    assert!(problem.contains("`total.hamel` cannot be read: gone"), "{problem}");
    let none = "model m { velocity v in R; lagrangian = v^2; scene s { want quotient; } }";
    let problem = spec::parse("m.hamel", none).expect_err("no item").to_string();
    assert!(problem.contains("the model is the quotient of no other"), "{problem}");
    let twice = TOP.replace("scene mapped", "reduces \"other.hamel\" {}\n    scene mapped");
    let problem = spec::parse("m.hamel", &twice).expect_err("two items").to_string();
    assert!(problem.contains("the model is the quotient of several"), "{problem}");
}

/// Maps that move with time, to scenes with points of circles, behind constraints.
#[test]
fn maps_of_every_kind_are_held() {
    let scenes = "scene mapped { want rhs, quotient; } scene turning { circle psi; want rhs, quotient; }";
    let text = spec::with_items(TURNING, scenes);
    let model = with_total(SKATE, &text).unwrap_or_else(|e| panic!("{e}"));
    for name in ["mapped", "turning"] {
        let built = scene::build(&model, name).unwrap_or_else(|e| panic!("{e}"));
        assert!(built.certificate().held.contains_key("quotient"), "{:?}", built.certificate());
    }
    let shared = folder().join("unreduced");
    for (name, images) in TWINS {
        let (text, _) = as_quotient(name, images);
        let text = spec::with_items(&text, "scene mapped { want rhs, quotient; }\n");
        let model = spec::parse(&format!("{name}.hamel"), &text).unwrap_or_else(|e| panic!("{e}"));
        let model = read_totals_of_file(model, &shared.join("quotient.hamel"));
        let model = model.unwrap_or_else(|e| panic!("{name}: {e}"));
        let built = scene::build(&model, "mapped");
        if *name == "roller_racer" {
            // Where both wheels stand in line with the joint, the section of its constraint vanishes for `L1 = L2`.
            let problem = built.expect_err("a section that may vanish").to_string();
            let said = "s does not follow from velocities where (L2 + L1*cos(phi))^2 + sin(phi)^2 vanishes";
            assert!(problem.contains(said), "{problem}");
            continue;
        }
        let built = built.unwrap_or_else(|e| panic!("{name}: {e}"));
        let certificate = built.certificate();
        println!("{name}: {:?} {:?}", certificate.held.get("quotient"), certificate.open);
        assert!(certificate.held.contains_key("quotient"), "{name}: {certificate:?}");
    }
}

/// Shipped models that are a chain: `Q -> Q/N` by the item of the model, `Q/N -> Q/G` to one that reduces all at once.
#[test]
fn shipped_stages_are_a_chain() {
    let specs = folder().join("specs");
    let text = |name: &str| {
        let text = std::fs::read_to_string(specs.join(format!("{name}.hamel")));
        text.unwrap_or_else(|e| panic!("{name}: {e}"))
    };
    let item = "reduces \"body_in_fluid_by_translations.hamel\" { V = transpose(R)*v; }\n";
    let last = spec::with_items(&text("kirchhoff_body"), item);
    let model = spec::parse("kirchhoff_body.hamel", &last).unwrap_or_else(|e| panic!("{e}"));
    let steps = hold_file(&model, &specs.join("kirchhoff_body.hamel")).unwrap_or_else(|e| panic!("{}", e[0]));
    let told: Vec<_> = steps.iter().map(|step| (step.proved.base, step.proved.velocities)).collect();
    assert_eq!(told, [((9, 0), (6, 6)), ((12, 9), (6, 6))]);
    let wrong = last.replace("V = transpose(R)*v", "V = R*v");
    let model = spec::parse("kirchhoff_body.hamel", &wrong).unwrap_or_else(|e| panic!("{e}"));
    let problems = hold_file(&model, &specs.join("kirchhoff_body.hamel")).expect_err("a wrong map");
    assert!(problems[0].to_string().contains("of the bracket ["), "{}", problems[0]);
}
