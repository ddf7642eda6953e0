//! What explanations say: group velocity, vertical equations by stages, definitions at the origin of ignorable
//! coordinates.

use hamel_codegen::{explain, scene, spec};
use hamel_expr::Style;
use hamel_mechanics::mechanics::VerticalEquations;

fn built(items: &str) -> (spec::Model, scene::BuiltScene) {
    let model = spec::parse("m.hamel", &format!("model m {{ {items} }}")).unwrap_or_else(|e| panic!("{e}"));
    let built = scene::build(&model, scene::DEFAULT).unwrap_or_else(|e| panic!("{e}"));
    (model, built)
}

fn explained(items: &str, style: Style) -> String {
    let (model, built) = built(items);
    explain::explain(&model, &built, style)
}

/// The lines of a text that contain one of the words.
fn lines<'a>(text: &'a str, words: &[&str]) -> Vec<&'a str> {
    text.lines().map(str::trim).filter(|line| words.iter().any(|word| line.contains(word))).collect()
}

const CHARGE: &str = "velocity u, z in semidirect(R^2, trivial(1));";

#[test]
fn vertical_equations_of_a_right_action_have_the_other_sign() {
    let body = "velocity Omega in so(3); stage whole; lagrangian = dot(Omega, diag([1, 2, 3])*Omega)/2;";
    let left = explained(&format!("{body} action left;"), Style::Unicode);
    let right = explained(&format!("{body} action right;"), Style::Unicode);
    assert_eq!(lines(&left, &["β̇₁ "]), ["β̇₁ = ⟨ad*(η^(0,1)) β^(0,1), f₁⟩"]);
    assert_eq!(lines(&right, &["β̇₁ "]), ["β̇₁ = -⟨ad*(η^(0,1)) β^(0,1), f₁⟩"]);
    for text in [left, right] {
        assert!(text.contains("⟨ad*(η^(0,1)) β^(0,1), f₁⟩ = η₃ β₂ - η₂ β₃"), "{text}");
    }
}

#[test]
fn a_connection_stands_in_the_velocity_and_the_stages() {
    let items = "coordinate x in real; velocity omega, v in se(2); stage turn; stage shift = ideal(v);
        connection omega = x*x_dot; lagrangian = x_dot^2 + omega^2 + dot(v, v);";
    let text = explained(items, Style::Unicode);
    assert_eq!(lines(&text, &["ξ + A(x) x\u{307} = "]), ["ξ + A(x) x\u{307} = ω e₁ + v₁ e₂ + v₂ e₃"]);
    assert_eq!(lines(&text, &["ξ_e₁", "η₁ = "]), ["η₁ = ω - x x\u{307}", "ξ_e₁ = ω - x x\u{307}"]);
    assert!(!text.contains("ξ = ω"), "{text}");
    let latex = explained(items, Style::Latex);
    assert!(latex.contains("\\eta_{1} &= \\omega - x\\, \\dot{x}"), "{latex}");
    // An abelian group: the lifts commute, and the velocities are not those of the group all the same.
    let flat = "coordinate x in real; velocity w in R; connection w = x_dot; lagrangian = x_dot^2 + w^2;";
    assert_eq!(lines(&explained(flat, Style::Unicode), &["ξ_e₁"]), ["ξ_e₁ = w - x\u{307}"]);
}

#[test]
fn constrained_stages_are_summed_over_their_slots() {
    // Euler's disk: both stage forms vanish, and the constraint alone couples the levels.
    let items = "param r = 0.5; coordinate phi in angle; velocity psi_dot, X in product(R^1, R^2);
        stage spin; stage translation = ideal(X); let u = [-cos(phi), -sin(phi)];
        lagrangian = (phi_dot^2 + psi_dot^2 + dot(X, X))/2; constraint X = r*psi_dot*u;";
    let (_, scene) = built(items);
    let vertical = VerticalEquations::new(scene.equations()).expect("a system with stages");
    assert_eq!(vertical.rows.len(), 1);
    let text = explained(items, Style::Unicode);
    assert_eq!(lines(&text, &["β̇₁"]), ["β̇₁ - r cos(φ) β̇₂ - r sin(φ) β̇₃ = 0"]);
    // All vertical velocities follow from those of the base.
    let items = "coordinate x: vector(2) in real; velocity w in R; stage whole;
        lagrangian = (dot(x_dot, x_dot) + w^2)/2; constraint w = x1*x2_dot;";
    let text = explained(items, Style::Unicode);
    assert!(text.contains("The constraint allows no displacement along the group"), "{text}");
}

#[test]
fn what_acts_on_the_group_is_in_its_vertical_equations() {
    let items = "velocity Omega in so(3); stage whole; advected Gamma in R^3 by cross(Omega, Gamma);
        lagrangian = dot(Omega, Omega)/2 - 3*Gamma3; force Omega1 = -Omega1;";
    let text = explained(items, Style::Unicode);
    let expected = [
        "τ₁ = 3 Γ₂ - Ω₁",
        "β̇₁ = ⟨ad*(η^(0,1)) β^(0,1), f₁⟩ + τ₁",
        "β̇₂ = ⟨ad*(η^(0,1)) β^(0,1), f₂⟩ + τ₂",
        "⟨ad*(η^(0,1)) β^(0,1), f₁⟩ = η₃ β₂ - η₂ β₃",
        "⟨ad*(η^(0,1)) β^(0,1), f₂⟩ = η₁ β₃ - η₃ β₁",
    ];
    for line in expected {
        assert!(text.lines().any(|l| l.trim() == line), "no {line} in\n{text}");
    }
    assert!(!text.contains("τ₃"), "{text}");
    // Reactions, where multipliers keep the constraint.
    let items = format!(
        "{CHARGE} stage g; stage centre = ideal(z); lagrangian = (dot(u, u) + z^2)/2; constraint z = u1*u2;"
    );
    let text = explained(&items, Style::Unicode);
    assert!(text.contains("with the reactions of the constraint"), "{text}");
    assert_eq!(lines(&text, &["β̇₃"]), ["β̇₃ = λ_c₁"]);
}

#[test]
fn names_of_a_model_are_not_taken_by_the_stages() {
    let items = "param beta1 = 2; param f1 = 3; coordinate eta1 in real; velocity w in R^2;
        stage whole; stage part = ideal(w2);
        lagrangian = (eta1_dot^2 + beta1*w1^2 + f1*w2^2)/2;";
    let text = explained(items, Style::Unicode);
    assert_eq!(
        lines(&text, &["β_stage₁ ", "β̇_stage₁", "η_stage₁ "]),
        ["η^(0,1) = η_stage₁ f_stage₁", "η_stage₁ = w₁", "β_stage₁ = p_w₁", "β\u{307}_stage₁ = 0"]
    );
}

#[test]
fn definitions_at_the_origin_of_an_ignorable_coordinate_are_called_so() {
    // The momenta along space turn with phi, the motion does not.
    let items = "coordinate phi in angle; coordinate r in (0, 10); velocity X in R^2;
        let u = [cos(phi), sin(phi)];
        lagrangian = (r_dot^2 + r^2*phi_dot^2)/2 + dot(X, X)/2 + r*phi_dot*dot(X, u) + dot(X, u)^2;
        constraint X = r_dot*u;";
    let (_, scene) = built(items);
    let equations = scene.equations();
    assert_eq!(equations.facts.taken_at_origin, ["phi"]);
    let g = &mut equations.system.graph.clone();
    let definitions: Vec<_> = equations.sections.iter().flat_map(|s| &s.definitions).collect();
    let mut n_moved = 0;
    for (k, d) in definitions.iter().enumerate() {
        for other in &definitions[k + 1..] {
            let [(one, a), (two, b)] = [d, other].map(|d| (g.name(d.symbol).to_owned(), g.sym(d.symbol)));
            if one != two {
                continue;
            }
            let [first, second] = [d, other].map(|d| equations.taken_at.contains_key(&d.symbol));
            assert_eq!(g.is_equal(a, b), first == second, "{one}");
            n_moved += usize::from(first != second);
        }
    }
    assert!(n_moved > 0, "the model shows nothing");
    let text = explained(items, Style::Unicode);
    assert!(text.contains("(φ=0)"), "{text}");
    assert!(text.contains("is the value of"), "{text}");
    for (style, word) in [(Style::Latex, "\\right|_{\\phi=0}"), (Style::MathMl, "<mo>=</mo><mn>0</mn>")] {
        assert!(explained(items, style).contains(word));
    }
    // No line gives a name to what it is not: formulas under one name are equal.
    let mut seen = std::collections::BTreeMap::new();
    for line in text.lines().skip_while(|l| *l != "Equations of motion") {
        if let Some((name, value)) = line.split_once(" = ").filter(|(name, _)| name.starts_with("  ")) {
            let known = seen.entry(name.trim().to_owned()).or_insert_with(|| value.to_owned());
            assert_eq!(known, value, "{name} twice in\n{text}");
        }
    }
}

/// The search for moving energies makes numbers that the equations do not have, such as `-nu`.
#[test]
fn phases_behind_and_before_the_time_are_explained() {
    let text = explained(
        "param nu = 2; param beta = 1; coordinate x in real; lagrangian = x_dot^2/2;
         force x_dot = sin(beta - nu*t) + cos(nu*t - 2*beta);",
        Style::Unicode,
    );
    assert!(text.contains("ν = 2") && text.contains("β = 1"), "{text}");
}

#[test]
fn equations_without_constraints_of_their_own_are_told() {
    let items = |slide: &str| {
        let rod = "coordinate x, z in real; constraint rod: x^2 + z^2 = 1; initial x = 1;";
        format!("{rod} lagrangian = x_dot^2 + z_dot^2; {slide}")
    };
    let said = |slide: &str| {
        let text = explained(&items(slide), Style::Unicode);
        lines(&text, &["stays zero"]).into_iter().map(str::to_owned).collect::<Vec<_>>()
    };
    let expected = ["By these position_rod stays zero, without a constraint of its own."];
    assert_eq!(said("constraint for z_dot: x*x_dot + z*z_dot = 0;"), expected);
    assert_eq!(said("constraint x*x_dot + z*z_dot = 0; multipliers;"), expected);
    assert!(said("").is_empty());
}

/// The velocity of a motion is in the Dirac structure where it is a displacement, and nowhere else.
#[test]
fn the_motion_is_in_its_dirac_structure_only_as_a_displacement() {
    let told = |constraint: &str| {
        let (model, built) = built(&format!(
            "coordinate x, y, z in real; lagrangian = (x_dot^2 + y_dot^2 + z_dot^2)/2; constraint {constraint};"
        ));
        explain::dirac(&model, &built, Style::Unicode)
    };
    for own in [
        "z_dot = y*x_dot",
        "z_dot = y*x_dot; multipliers",
        // Homogeneous of degree two, one and zero.
        "x_dot^2 + y_dot^2 = 3*z_dot^2",
        "sqrt(x_dot^2 + y_dot^2) = 3*z_dot",
        "x_dot/y_dot = 2",
    ] {
        let text = told(own);
        assert!(text.contains("The motion is the velocity y that is in it"), "{own}:\n{text}");
        assert!(text.contains("the velocity satisfies the constraint"), "{own}:\n{text}");
    }
    for other in [
        "z_dot = y*x_dot + 1",
        "z_dot = y*x_dot + 1; multipliers",
        "x_dot^2 + y_dot^2 = 4",
        "x_dot^2 + y_dot^2 + z_dot = 1",
        "z_dot = x*y_dot; virtual delta(z_dot) - y*delta(x_dot) = 0",
    ] {
        let text = told(other);
        assert!(!text.contains("The motion is the velocity"), "{other}:\n{text}");
        assert!(text.contains("satisfies the constraint and is no displacement"), "{other}:\n{text}");
        assert!(text.contains("the velocity is a virtual displacement"), "{other}:\n{text}");
    }
}

#[test]
fn a_number_that_vanishes_nowhere_is_no_condition() {
    let told = |product: &str| {
        explained(
            &format!(
                "param a = 0.5; velocity w in so(3); constraint w3 = 0;
                 lagrangian = (w1^2 + 2*w2^2 + 3*w3^2)/2 + {product}*w1*w3;"
            ),
            Style::Unicode,
        )
    };
    let (number, parameter) = (told("0.5"), told("a"));
    for text in [&number, &parameter] {
        assert!(text.contains("No smooth invariant measure"), "{text}");
    }
    assert!(parameter.contains("There is one where all of these vanish:"), "{parameter}");
    assert!(!number.contains("There is one where"), "{number}");
}

#[test]
fn events_say_when_they_happen_and_what_they_do() {
    let items = "param e = 0.5 where e > 0; coordinate x, z in real; lagrangian = (x_dot^2 + z_dot^2)/2 - z;
        /// It rests.
        mode ground { constraint n: z = 0; event lift when lambda_n < x { leave ground; } }
        event touch = z falling { impact ground with e; }
        event rest = z + z_dot^2 - 1/100 falling { enter ground; }
        event far = x - 3 rising { then x = 0; stop; }
        initial z = 1;";
    let text = explained(items, Style::Unicode);
    assert_eq!(
        lines(&text, &["Mode ", "Event "]),
        [
            "Mode ground, 1 while it is on and 0 otherwise: It rests.",
            "Event lift, where λ_n - x becomes negative, by the motion or by another event, while ground is 1: ground becomes 0.",
            "Event touch, where z falls through zero, while ground is 0: velocities change by impulses in the kinetic metric with ground as it sets them, and with restitution along the constraints of ground.",
            "Event rest, where z + z\u{307}² - 1/100 falls through zero, while ground is 0: ground becomes 1; velocities change by impulses in the kinetic metric with ground as it sets them.",
            "Event far, where x - 3 rises through zero: x becomes 0; the motion ends.",
        ]
    );
    for style in [Style::Latex, Style::MathMl] {
        assert!(explained(items, style).contains("falls through zero"));
    }
}

#[test]
fn equations_left_out_and_quotients_are_told() {
    let cranks = "param a = 0.3; param b = 1; coordinate al, be, ga in angle;
        lagrangian = al_dot^2/2 + be_dot^2/2 + ga_dot^2;
        constraint along: a*cos(al) + b*cos(be) - a*cos(ga) = b;
        constraint across: a*sin(al) + b*sin(be) - a*sin(ga) = 0; constraint same: al - ga = 0;
        initial al = 1; initial be = 0; initial ga = 1; initial al_dot = 0.7; multipliers;";
    let text = explained(cranks, Style::Unicode);
    assert!(text.contains("al - ga = 0   (follows from the others, and is left out)"), "{text}");
    let text =
        explained("velocity v in R; lagrangian = v^2; reduces \"m.hamel\" { v = x_dot; }", Style::Unicode);
    assert!(text.contains("Quotient of m.hamel, by v = x_dot (proved by check and generate)."), "{text}");
}
