//! Explanations that name what they are made of: a mechanical connection and its curvature, the parts of equations by
//! stages, and the same in the notation of Cendra and Diaz. Names are told once, lines can be read, and a planted fault
//! is found.

use std::collections::BTreeSet;

use hamel_codegen::explain::{by_paper, explain};
use hamel_codegen::scene::{self, BuiltScene};
use hamel_codegen::spec::{self, ConnectionKind, IdealChain, Model};
use hamel_expr::Style;
use hamel_mechanics::mechanics::{
    Equations, NamedConnection, Unrelated, Variations, VerticalEquations, derive, same_motion,
};
use hamel_mechanics::reduction::{Formulation, ReducedSystem, Stages, reduce};
use hamel_tests::latex::problems;
use hamel_tests::models;

fn built(model: &Model) -> BuiltScene {
    scene::build(model, scene::DEFAULT).unwrap_or_else(|e| panic!("{}: {e}", model.name))
}

fn in_connection(name: &str, kind: ConnectionKind) -> Model {
    Model { derived_connection: Some(kind), ..models::model(name) }
}

fn reduced(model: &Model) -> ReducedSystem {
    reduce(model, &Formulation::of(model)).unwrap_or_else(|e| panic!("{}: {e}", model.name))
}

fn longest(text: &str) -> usize {
    text.lines().map(|line| line.chars().count()).max().unwrap_or(0)
}

/// The cost of the right-hand side.
fn cost(scene: &BuiltScene) -> usize {
    let columns = scene.operation_columns();
    let line = columns.lines().find(|line| line.trim_start().starts_with("rhs ")).expect("a right-hand side");
    line.split_whitespace().last().and_then(|word| word.parse().ok()).expect("its cost")
}

#[test]
fn a_mechanical_connection_is_told_by_names_and_costs_little() {
    let model = in_connection("two_arm_satellite", ConnectionKind::Mechanical);
    let scene = built(&model);
    let text = explain(&model, &scene, Style::Unicode);
    assert!(text.len() < 16_000, "{} bytes", text.len());
    assert!(longest(&text) <= 400, "{}", longest(&text));
    // 639 with everything multiplied out; 143 in the velocities without the connection.
    assert!(cost(&scene) <= 217, "{}", scene.operation_columns());
    let connection = text.split("\nConnection\n").nth(1).and_then(|rest| rest.split("\nKinematics").next());
    let connection = connection.expect("a section about the connection");
    let names: Vec<&str> =
        connection.lines().filter_map(|line| line.split_once(" = ").map(|(l, _)| l.trim())).collect();
    let once: BTreeSet<&str> = names.iter().copied().collect();
    assert_eq!(names.len(), once.len(), "{connection}");
    for name in ["K_2,3", "det_K", "A₁_α", "A₃_β", "B₂_α,β", "[D_α, D_β]"] {
        assert!(once.contains(name), "{name}: {connection}");
    }
    let latex = explain(&model, &scene, Style::Latex);
    for name in ["A^{(1)}_{\\alpha} &= ", "B^{(3)}_{\\alpha\\beta} &= "] {
        assert!(latex.contains(name), "{name}");
    }
    assert_eq!(problems(&latex), Vec::<String>::new());
}

/// With the same names, more elements than cofactors are written for, a connection of the model beside, right action.
#[test]
fn connections_of_other_systems_are_told_by_names() {
    let four = "model four {
        param m = 3;
        coordinate x, y in real;
        algebra g = product(so(3), R);
        velocity O, w in g;
        lagrangian = (x_dot^2 + y_dot^2)*4 + m*(O1^2 + (1 + x^2)*O2^2 + 2*O3^2 + w^2) + O1*O2/3 + w*O3/2 + x*w*y_dot
            + y*O1*x_dot + x_dot*O3/2 + y_dot*O2*x;
        connection mechanical;
    }";
    let beside = "model beside {
        coordinate x, y in real;
        velocity O in so(3);
        action right;
        connection O1 = y*x_dot;
        connection O3 = x*y_dot/2;
        lagrangian = (x_dot^2 + y_dot^2)*4 + O1^2 + (1 + x^2)*O2^2 + 2*O3^2 + O1*O2/3 + y*O1*x_dot + y_dot*O2*x;
    }";
    let mut beside = spec::parse("beside", beside).unwrap_or_else(|e| panic!("{e}"));
    beside.derived_connection = Some(ConnectionKind::Mechanical);
    let four = spec::parse("four", four).unwrap_or_else(|e| panic!("{e}"));
    for (model, has_conditions) in [(four, true), (beside, false)] {
        let scene = built(&model);
        let system = &scene.equations().system;
        assert!(system.lift.is_some(), "{}", model.name);
        let named = NamedConnection::new(system).unwrap_or_else(|| panic!("{}", model.name));
        assert_eq!(!named.conditions.is_empty(), has_conditions, "{}", model.name);
        assert!(!named.curvature.is_empty() && !named.brackets.is_empty(), "{}", model.name);
        let plain = Formulation { connection: None, ..Formulation::of(&model) };
        let plain = derive(&reduce(&model, &plain).unwrap()).unwrap();
        assert_eq!(same_motion(&plain, scene.equations()), Ok(()), "{}", model.name);
    }
}

#[test]
fn a_planted_fault_in_a_connection_is_found() {
    let model = in_connection("two_arm_satellite", ConnectionKind::Mechanical);
    let system = reduced(&model);
    assert!(NamedConnection::new(&system).is_some());
    let plain = derive(&reduced(&models::model("two_arm_satellite"))).unwrap();
    let planted = |plant: &dyn Fn(&mut ReducedSystem)| {
        let mut system = system.clone();
        plant(&mut system);
        system
    };
    // A sign of the coupling: the text is refused, and so is the motion.
    let of_coupling = planted(&|system| {
        let lift = system.lift.as_mut().unwrap();
        lift.coupling[2][0] = system.graph.neg(lift.coupling[2][0]);
    });
    assert!(NamedConnection::new(&of_coupling).is_none());
    let faulty = derive(&of_coupling).unwrap();
    assert!(matches!(same_motion(&plain, &faulty), Err(Unrelated::Differs { .. })));
    // An entry of the locked inertia.
    let of_inertia = planted(&|system| {
        let lift = system.lift.as_mut().unwrap();
        let (one, own) = (system.graph.one(), lift.inertia[1][1]);
        lift.inertia[1][1] = system.graph.add(own, one);
    });
    assert!(NamedConnection::new(&of_inertia).is_none());
    let faulty = derive(&of_inertia).unwrap();
    assert!(matches!(same_motion(&plain, &faulty), Err(Unrelated::Differs { .. })));
    // A coefficient that is told.
    let of_connection = planted(&|system| {
        let rows = system.connection.as_mut().unwrap();
        rows[0][1] = system.graph.neg(rows[0][1]);
    });
    assert!(NamedConnection::new(&of_connection).is_none());
}

fn staged() -> Vec<Model> {
    let all = models::names().into_iter().map(|name| models::model(&name));
    let found: Vec<Model> = all.filter(|model| model.stages.is_some()).collect();
    assert!(found.len() >= 5, "{}", found.len());
    found
}

fn refuses(equations: &Equations, plant: &dyn Fn(&mut Stages)) -> bool {
    let mut faulty = equations.clone();
    plant(faulty.system.stages.as_mut().unwrap());
    match VerticalEquations::new(&faulty) {
        None => true,
        Some(vertical) => Variations::new(&faulty, &vertical).is_none(),
    }
}

#[test]
fn a_planted_fault_in_a_form_is_found() {
    let mut model = models::model("kirchhoff_body");
    model.derived_connection = None;
    let equations = derive(&reduced(&model)).unwrap();
    assert!(!refuses(&equations, &|_| {}));
    let flipped = |stages: &mut Stages, k: usize| {
        let level = &mut stages.levels[0];
        let form = [&mut level.quotient_bracket, &mut level.curvature, &mut level.vertical_connection];
        let Some(form) = form.into_iter().nth(k) else { return };
        assert!(!form.is_empty());
        // Another component in the place of its own.
        form[0].2 = if k == 0 { 0 } else { 3 + (form[0].2 - 3 + 1) % 3 };
    };
    for k in 0..3 {
        assert!(refuses(&equations, &|stages| flipped(stages, k)), "form {k}");
    }
}

#[test]
fn staged_models_are_written_by_the_paper() {
    let with_base = ["wong_particle", "snakeboard"].map(|name| {
        let model = models::model(name);
        Model { stages: Some(IdealChain::whole()), ..model }
    });
    for model in staged().into_iter().chain(with_base) {
        let scene = built(&model);
        let text = by_paper(&model, &scene, Style::Unicode).unwrap_or_else(|e| panic!("{}: {e}", model.name));
        for word in ["Bracket by stages, (2)-(14)", "δ", "β̇₁", "compared, exactly"] {
            assert!(text.contains(word), "{}: {word}\n{text}", model.name);
        }
        let latex = by_paper(&model, &scene, Style::Latex).unwrap_or_else(|e| panic!("{}: {e}", model.name));
        let found = problems(&latex);
        assert!(found.is_empty(), "{}: {}", model.name, found.join("\n"));
        // The momenta of euler_disk have terms of 1,700 characters, the forms of triangular_body quotients of 3,300.
        assert!(longest(&latex) <= 4000, "{}: {}", model.name, longest(&latex));
        let explained = explain(&model, &scene, Style::Latex);
        assert_eq!(problems(&explained), Vec::<String>::new(), "{}", model.name);
    }
}

#[test]
fn what_the_paper_says_of_a_connection_is_there() {
    let model = Model { stages: Some(IdealChain::whole()), ..models::model("wong_particle") };
    let text = by_paper(&model, &built(&model), Style::Unicode).unwrap();
    for line in [
        "  δv = Dζ/Dt + [v, ζ] + B(δx, ẋ) + [A(δx), v]",
        "  δv^(0,1) = ζ̇^(0,1) + [η^(0,1), ζ^(0,1)] + B(δx, ẋ)^(0,1) + [A(δx), v]^(0,1)",
        "  Dβ₁/Dt - β̇₁ = β₂ (ẋ₁ A₃_x₁ + ẋ₂ A₃_x₂) - β₃ (ẋ₁ A₂_x₁ + ẋ₃ A₂_x₃)",
        "  β̇₁ = ⟨ad*(η^(0,1)) β^(0,1), f₁⟩",
        "  ṗ_ẋ₁ = ⟨β, B(∂_x₁, ẋ)⟩ + ⟨β, [A_x₁, v]⟩",
    ] {
        assert!(text.lines().any(|l| l == line), "{line}\n{text}");
    }
    let staged = models::model("kirchhoff_body");
    let text = by_paper(&staged, &built(&staged), Style::Unicode).unwrap();
    for line in [
        "  δη^(1,2) = ζ̇^(1,2) - a_01(η^(0,1), ζ^(0,1)) + b_01(η^(0,1), ζ^(1,2)) - b_01(ζ^(0,1), η^(1,2))",
        "  β̇₁ = ⟨ad*(η^(0,1)) β^(0,1), f₁⟩ - ⟨β, a_01(η^(0,1), f₁)⟩ - ⟨β, b_01(f₁, η^(1,2))⟩",
        "  ⟨β, b_01(η^(0,1), f₄)⟩     = η₃ β₅ - η₂ β₆",
    ] {
        assert!(text.lines().any(|l| l == line), "{line}\n{text}");
    }
    let without = models::model("point_vortices");
    assert!(by_paper(&without, &built(&without), Style::Unicode).is_err());
}
