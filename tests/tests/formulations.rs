//! Every formulation of a scene is one motion: exactly, by `same_motion`, and by integration of the original
//! coordinates. What is chosen never costs more than what the scene says.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use hamel_codegen::scene::{self, BuiltScene, Formulations};
use hamel_codegen::spec::{self, ConnectionKind, Model};
use hamel_expr::SymbolId;
use hamel_mechanics::mechanics::{ChangeOfState, Unrelated, derive, same_motion};
use hamel_mechanics::reduction::{Formulation, reduce};
use hamel_program::program::Role;
use hamel_tests::algebras::{FAMILIES, Transported};
use hamel_tests::at_length;
use hamel_tests::bundle::Bundle;
use hamel_tests::draws::{for_all, one};
use hamel_tests::models::{derived, generated, names};
use hamel_tests::problem::Problem;
use hamel_tests::stages::{chain_text, with_items};

const NUMBERS: usize = 3000;

fn parsed(text: &str) -> Model {
    spec::parse("test.hamel", text).unwrap_or_else(|problems| panic!("{}", problems.render(false)))
}

fn shipped(name: &str) -> Model {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../models/specs/{name}.hamel"));
    let text = std::fs::read_to_string(&path).unwrap();
    spec::parse(&path.display().to_string(), &text).unwrap()
}

fn found(model: &Model, scene: &str) -> Formulations {
    scene::formulations(model, scene, &|_, _| {})
        .unwrap_or_else(|problems| panic!("{}", problems.render(false)))
}

/// A pendulum on a vehicle in the plane: a base with an angle, an algebra with a constraint that is affine in the
/// velocities, a force, explicit time and coordinates of the group.
const VEHICLE: &str = "model vehicle {
    param k = 0.4;
    coordinate phi in angle;
    velocity omega, v in se(2);
    let w = [v1 + (omega + phi_dot)*cos(phi), v2 + (omega + phi_dot)*sin(phi)];
    lagrangian = 1/2*dot(w, w) + omega^2 + v1^2/2 + v2^2 + 9*cos(phi) - k/2*sin(phi)^2;
    constraint v2 = omega/3 + k*phi_dot*cos(phi) + 1/5;
    force phi_dot = -k*phi_dot + sin(t);
    reconstruct psi, x, y in SE(2);
    scene bare { want rhs; }
}";

/// States, times and parameters as the integrator of a formulation sees them.
struct Start {
    params: Vec<f64>,
    values: BTreeMap<SymbolId, f64>,
}

/// A start at the defaults with state variables of order one, the same for all formulations.
fn start(scene: &BuiltScene) -> Start {
    let params: Vec<f64> = scene.params().iter().map(|p| hamel_expr::rational_to_f64(&p.default)).collect();
    let mut values: BTreeMap<SymbolId, f64> =
        scene.params().iter().map(|p| p.symbol).zip(params.clone()).collect();
    let numbers = (0..).map(|k| 0.9 - 0.37 * f64::from(k % 5) + 0.01 * f64::from(k));
    values.extend(scene.state().iter().map(|s| s.symbol).zip(numbers));
    Start { params, values }
}

/// The state of `to` at values of that of `from`.
fn mapped(from: &BuiltScene, to: &BuiltScene, values: &BTreeMap<SymbolId, f64>) -> Vec<f64> {
    let change = ChangeOfState::between(from.equations(), &to.equations().system).unwrap();
    let component = |s: SymbolId| change.graph().eval_f64(change.value(s).unwrap(), values).unwrap();
    to.state().iter().map(|s| component(s.symbol)).collect()
}

/// Where motions end: before small differences grow.
const END: f64 = 0.25;

/// Where those of random systems do, whose velocities may grow by orders of magnitude in a unit of time.
const SOON: f64 = 0.02;

/// Classical Runge-Kutta steps from `t = 0` to `end`.
fn integrated(scene: &BuiltScene, params: &[f64], start: &[f64], end: f64) -> Vec<f64> {
    const STEPS: usize = 400;
    let interpreter = scene.prepare(params).unwrap();
    let (n, h) = (start.len(), end / STEPS as f64);
    let mut y = start.to_vec();
    let rate = |t: f64, y: &[f64]| {
        let mut dy = vec![0.0; n];
        interpreter.rhs(t, y, &mut dy);
        dy
    };
    let moved =
        |y: &[f64], dy: &[f64], h: f64| y.iter().zip(dy).map(|(y, dy)| y + h * dy).collect::<Vec<f64>>();
    for step in 0..STEPS {
        let t = step as f64 * h;
        let k1 = rate(t, &y);
        let k2 = rate(t + h / 2.0, &moved(&y, &k1, h / 2.0));
        let k3 = rate(t + h / 2.0, &moved(&y, &k2, h / 2.0));
        let k4 = rate(t + h, &moved(&y, &k3, h));
        for i in 0..n {
            y[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
        }
    }
    y
}

/// Holds every formulation of a scene to the scene's own, by integration; the titles of all.
fn hold_to_one_motion(model: &Model, scene: &str, end: f64) -> Vec<String> {
    let own = scene::build(model, scene).unwrap();
    let Start { params, mut values } = start(&own);
    values.insert(own.equations().system.time, 0.0);
    let first: Vec<f64> = own.state().iter().map(|s| values[&s.symbol]).collect();
    let last = integrated(&own, &params, &first, end);
    let mut reached = values.clone();
    reached.extend(own.state().iter().map(|s| s.symbol).zip(last));
    reached.insert(own.equations().system.time, end);
    let all = found(model, scene);
    for candidate in &all.candidates {
        let built = scene::build_in(model, scene, &candidate.formulation).unwrap();
        let last = integrated(&built, &params, &mapped(&own, &built, &values), end);
        for ((name, x), y) in built.state_names().iter().zip(&last).zip(mapped(&own, &built, &reached)) {
            let title = candidate.title();
            assert!((x - y).abs() <= 1e-7 * (1.0 + y.abs()), "{title}: {name} is {x}, not {y}");
        }
    }
    all.candidates.iter().map(scene::Candidate::title).collect()
}

#[test]
fn all_formulations_are_one_motion() {
    let titles = hold_to_one_motion(&parsed(VEHICLE), "bare", END);
    for choice in [
        "connection mechanical",
        "connection nonholonomic",
        "independent",
        "stages",
        "momenta of omega",
        "circle phi",
        "no squares",
    ] {
        assert!(titles.iter().any(|title| title.contains(choice)), "{choice} in {titles:?}");
    }
    assert!(titles.iter().any(|title| title.matches(';').count() > 1), "{titles:?}");
}

#[test]
fn all_formulations_of_shipped_models_are_one_motion() {
    for (name, wanted) in
        [("mobile_robot", "rhs"), ("chaplygin_sleigh", "rhs, reconstruction"), ("kirchhoff_body", "rhs")]
    {
        let model = with_scene(name, &format!("scene bare {{ want {wanted}; }}"));
        let titles = hold_to_one_motion(&model, "bare", END);
        assert!(titles.len() > 1, "{name}: {titles:?}");
    }
}

/// Random metrics, sides, constraints and chains of ideals on every algebra of few dimensions.
#[test]
fn all_formulations_of_random_systems_are_one_motion() {
    for make in FAMILIES {
        if make(&mut one(1, 60)).algebra.dim() > 4 {
            continue;
        }
        for_all(make(&mut one(1, 60)).name, 1, NUMBERS, |mut draws| {
            let family = make(&mut draws);
            let (mut problem, transported) = Problem::random(&family, &mut draws);
            for (k, chain) in transported.chains.iter().enumerate() {
                problem.right = k % 2 == 0;
                problem.rows.clear();
                problem.constrain(k % 2, &mut draws);
                let text = with_items(&problem.text(), &chain_text("y", chain, &transported.metric));
                let titles = hold_to_one_motion(&parsed(&text), "default", SOON);
                assert!(titles.iter().any(|title| title.contains("momenta of y")), "{titles:?}\n{text}");
            }
            Ok(())
        });
    }
}

/// Random metrics, connections, sides, constraints and advected parameters over the smallest algebras.
#[test]
fn all_formulations_of_random_bundles_are_one_motion() {
    let small = FAMILIES.into_iter().filter(|make| make(&mut one(3, NUMBERS)).algebra.dim() == 3);
    for (kind, make) in small.enumerate() {
        let family = make(&mut one(3, NUMBERS));
        for_all(family.name, 1, NUMBERS, |mut draws| {
            let transported = Transported::new(&family, &mut draws);
            let mut bundle = Bundle::random(&transported.algebra, kind % 2 == 0, &mut draws);
            // A metric that varies over the base takes most candidates beyond their budget.
            bundle.flatten();
            match kind % 3 {
                0 => {}
                1 => bundle.advect(&mut draws),
                _ => bundle.constrain(false, &mut draws),
            }
            let text = with_items(&bundle.text(kind % 2 == 1), "scene bare { want rhs; }");
            let titles = hold_to_one_motion(&parsed(&text), "bare", SOON);
            assert!(titles.iter().any(|title| title.contains("momenta")), "{titles:?}\n{text}");
            Ok(())
        });
    }
}

#[test]
fn another_motion_is_told() {
    let equations = |stiffness: &str| {
        let text = VEHICLE.replace("k/2*sin(phi)^2", stiffness);
        let model = parsed(&text);
        let formulation =
            Formulation { connection: Some(ConnectionKind::Mechanical), ..Formulation::of(&model) };
        [Formulation::of(&model), formulation].map(|f| derive(&reduce(&model, &f).unwrap()).unwrap())
    };
    let ([own, other], [_, stiff]) = (equations("k/2*sin(phi)^2"), equations("k*sin(phi)^2"));
    assert_eq!(same_motion(&own, &other), Ok(()));
    assert!(matches!(same_motion(&own, &stiff), Err(Unrelated::Differs { .. })));
}

#[test]
fn an_angle_is_no_function_of_its_point_here() {
    let model = parsed("model p { coordinate a in angle; lagrangian = a_dot^2/2 + cos(a); }");
    let line = Formulation::of(&model);
    let circle = Formulation { circles: vec!["a".into()], ..line.clone() };
    let [line, circle] = [line, circle].map(|f| derive(&reduce(&model, &f).unwrap()).unwrap());
    assert_eq!(same_motion(&line, &circle), Ok(()));
    assert_eq!(same_motion(&circle, &line), Err(Unrelated::NoFunction { component: "a".into() }));
    assert_eq!(same_motion(&circle, &circle), Ok(()));
}

#[test]
fn the_search_is_the_same_every_time() {
    let model = parsed(VEHICLE);
    let [first, second] = [(); 2].map(|()| found(&model, scene::DEFAULT));
    let table = |all: &Formulations| {
        all.candidates
            .iter()
            .map(|c| (c.title(), c.counts, c.n_prepared, c.rounding.to_bits()))
            .collect::<Vec<_>>()
    };
    assert_eq!(table(&first), table(&second));
    assert_eq!(first.left_out, second.left_out);
}

#[test]
fn the_best_is_no_worse_than_the_scenes_own() {
    for name in ["snakeboard", "mobile_robot", "euler_disk", "skew_sleigh"] {
        let all = found(&shipped(name), scene::DEFAULT);
        let own = all.own();
        for keeps_state in [true, false] {
            let best = all.best(keeps_state);
            assert!(best.counts.cost() <= own.counts.cost(), "{name}: {}", best.title());
            assert!(best.rounding <= own.rounding.max(16.0) * 1.5, "{name}: {}", best.title());
            assert!(best.keeps_state() || !keeps_state, "{name}");
        }
    }
    let all = found(&shipped("snakeboard"), scene::DEFAULT);
    assert_eq!(all.best(false).title(), "circle phi");
}

/// A shipped model with one more scene.
fn with_scene(name: &str, scene: &str) -> Model {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../models/specs/{name}.hamel"));
    let text = std::fs::read_to_string(&path).unwrap();
    let items = text.trim_end().strip_suffix('}').unwrap();
    parsed(&format!("{items} {scene} }}"))
}

fn cost(scene: &BuiltScene) -> u64 {
    scene.program().function(&Role::Rate).unwrap().counts().cost()
}

#[test]
fn a_scene_takes_the_formulation_that_costs_least() {
    const SCENES: &str = "scene quick { formulation auto(state); } scene same { formulation auto; }";
    for (name, momentum, state, title) in [
        ("chaplygin_sleigh", "momentum p of v;", ["omega", "p1"], "momenta of v"),
        // Without a name of the model the momentum is called by its velocity.
        ("chaplygin_sleigh", "", ["omega", "p_v1"], "momenta of v"),
        ("suslov", "momentum Pi of Omega;", ["Omega1", "Omega2"], "as the scene says"),
    ] {
        let model = with_scene(name, &format!("{momentum} {SCENES}"));
        let [own, fast, same] =
            [scene::DEFAULT, "quick", "same"].map(|scene| scene::build(&model, scene).unwrap());
        assert_eq!(same.state_names(), own.state_names(), "{name}");
        assert_eq!(fast.state_names(), state, "{name}");
        assert!(cost(&fast) <= cost(&same) && cost(&same) <= cost(&own), "{name}");
        let text = fast.emit().unwrap();
        let lines: Vec<&str> = text.lines().take(2).collect();
        assert!(lines[0].starts_with("// @generated by hamel"), "{name}: {lines:?}");
        let chosen = format!("{title}, by `auto(state)`; its right-hand side costs {}", cost(&fast));
        assert!(lines[1].starts_with("// formulation: ") && lines[1].contains(&chosen), "{name}: {lines:?}");
        // The same bytes every time: what is written stays what it is until the model changes.
        assert_eq!(scene::build(&model, "quick").unwrap().emit().unwrap(), text, "{name}");
        assert!(!own.emit().unwrap().contains("// formulation"), "{name}");
    }
}

#[test]
fn conversions_come_with_another_state() {
    let model = with_scene(
        "chaplygin_sleigh",
        "momentum p of v; scene quick { formulation auto(state); want energy; }",
    );
    let fast = scene::build(&model, "quick").unwrap();
    let names: Vec<&str> = fast.outputs().iter().map(|output| output.name.as_str()).collect();
    assert_eq!(names, ["velocities"]);
    assert_eq!(fast.legendre().momenta.len(), 1);
    let model = with_scene(
        "euler_disk",
        "scene quick { fix e = 0; drop phi; formulation auto(state); want energy; }",
    );
    let fast = scene::build(&model, "quick").unwrap();
    let names: Vec<&str> = fast.outputs().iter().map(|output| output.name.as_str()).collect();
    assert!(names.contains(&"theta"), "{names:?} {:?}", fast.state_names());
}

#[test]
fn models_with_a_hamiltonian_and_at_levels_of_momenta_have_formulations() {
    let body = "param I: diagonal(3) = [1, 2, 3] where I1 > 0, I2 > 0, I3 > 0;
        velocity Omega in so(3); momentum Pi of Omega; advected Gamma in R^3 by cross(Omega, Gamma);";
    let top =
        parsed(&format!("model top {{ {body} lagrangian = dot(Omega, I*Omega)/2 - Gamma3; carry Pi; }}"));
    let titles = hold_to_one_motion(&top, scene::DEFAULT, END);
    assert!(titles.contains(&"velocities Omega".to_owned()), "{titles:?}");
    let pendulum = parsed(
        "model pendulum {
            param p = 0.4;
            coordinate theta in (0, pi);
            coordinate phi in angle;
            lagrangian = (theta_dot^2 + sin(theta)^2*phi_dot^2)/2 + 9.81*cos(theta);
            routh phi = p;
        }",
    );
    let titles = hold_to_one_motion(&pendulum, scene::DEFAULT, END);
    assert!(titles.contains(&"circle theta".to_owned()), "{titles:?}");
}

/// Every shipped model has a scene with all variables and parameters whose right-hand side costs at most a tenth more
/// than the form that `auto(state)` takes. Of the models that are looked at with `--all` alone the search takes
/// seconds.
#[test]
fn what_ships_is_as_cheap_as_what_the_search_finds() {
    let few = ["chaplygin_sleigh", "servo_ball", "skew_sleigh", "snakeboard", "suslov"];
    let names = if at_length() { names() } else { few.map(str::to_owned).to_vec() };
    let mut dearer = String::new();
    for name in names {
        let model = shipped(&name);
        let is_whole = |scene: &str| {
            let said = model.scenes.iter().find(|s| s.name == scene);
            scene == scene::DEFAULT
                || said.is_some_and(|s| s.fixed.is_empty() && s.drops.is_empty() && s.inputs.is_empty())
        };
        let scenes = generated().into_iter().filter(|(of, scene)| *of == name && is_whole(scene));
        let costs = scenes.map(|(_, scene)| {
            let program = &derived(&name, scene).program;
            program.function(&Role::Rate).unwrap().counts().cost()
        });
        let (least, best) = (costs.min().unwrap(), found(&model, scene::DEFAULT).best(false).counts.cost());
        if 10 * least > 11 * best {
            let _ = writeln!(dearer, "{name}: shipped {least}, found {best}");
        }
    }
    assert!(dearer.is_empty(), "{dearer}add `scene fast {{ formulation auto(state); }}`\n");
}

/// Algebras with a metric that couples everything, and the most operations of the right-hand side that
/// `formulation auto(state)` takes: cost of the best, and of the momenta along all levels.
const LEVELS: [(&str, &str, &str, u64, u64); 6] = [
    ("heisenberg(1)", "q, p, z", "stage s0; stage s1 = ideal(z);", 3, 7),
    ("heisenberg(2)", "q1, q2, p1, p2, z", "stage s0; stage s1 = ideal(z);", 12, 22),
    ("se(2)", "w, a, b", "stage s0; stage s1 = ideal(a, b);", 8, 9),
    ("se(3)", "w1, w2, w3, v1, v2, v3", "stage s0; stage s1 = ideal(v1, v2, v3);", 45, 45),
    (
        "algebra n4 { basis e12, e23, e34, e13, e24, e14; [e12, e23] = e13; [e23, e34] = e24; [e12, e24] = e14; [e13, e34] = e14; }",
        "v12, v23, v34, v13, v24, v14",
        "stage s0; stage s1 = ideal(v13, v24, v14); stage s2 = ideal(v14);",
        26,
        26,
    ),
    (
        "algebra engel { basis e1, e2, e3, e4; [e1, e2] = e3; [e1, e3] = e4; }",
        "v1, v2, v3, v4",
        "stage s0; stage s1 = ideal(v3, v4); stage s2 = ideal(v4);",
        7,
        10,
    ),
];

#[test]
fn momenta_along_levels_are_found_and_cost_least() {
    for (algebra, velocities, stages, best, along_all) in LEVELS {
        let n = velocities.split(", ").count();
        let (items, name) = match algebra.strip_prefix("algebra ") {
            Some(rest) => (algebra, rest.split(' ').next().unwrap()),
            None => ("", algebra),
        };
        // Diagonally dominant, and full.
        let rows = (0..n).flat_map(|i| (i..n).map(move |j| (i, j)));
        let entries: Vec<String> =
            rows.map(|(i, j)| {
                if i == j { format!("{}", 2 + i) } else { format!("0.{}", 11 + 2 * ((3 * i + 5 * j) % 7)) }
            })
            .collect();
        let text = format!(
            "model full {{ param G: symmetric({n}) = [{}]; {items} velocity {velocities} in {name};
                let y = [{velocities}]; lagrangian = dot(y, G*y)/2; {stages} inner_product = lagrangian;
                momentum beta of stages; scene levels {{ carry beta; want rhs; }} scene bare {{ want rhs; }} }}",
            entries.join(", ")
        );
        let model = parsed(&text);
        assert_eq!(cost(&scene::build(&model, "levels").unwrap()), along_all, "{name}");
        let all = found(&model, "bare");
        let chosen = all.best(false);
        assert!(chosen.counts.cost() <= best, "{name}: {} costs {}", chosen.title(), chosen.counts.cost());
    }
}
