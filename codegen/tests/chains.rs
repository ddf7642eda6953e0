//! Chains of bodies, arms of industry and random ones, move as d'Alembert's principle says.
//!
//! Random axes, quarter turns and other twists, offsets by decimals and by parameters, equal and unequal lever arms,
//! trees, floating bases, revolute and prismatic joints, wheels, and points that stay in a plane: each chain is written
//! as text, with bodies in space and with velocities in moving frames, derived by recursion and multiplied out, some
//! lowered and run, and its rates and energy are held to those of `chains/redundant.rs`, which shares nothing with the
//! generator.
//!
//! `HAMEL_CHAINS=500 cargo test --release -p hamel-codegen --test main chains::random -- --nocapture` draws more and
//! longer ones, of up to nine joints; `HAMEL_CHAINS_SEED=1` others. A failure prints its seed and the text of the
//! model.

#[path = "chains/arms.rs"]
mod arms;
#[path = "chains/drawn.rs"]
mod drawn;
#[path = "chains/redundant.rs"]
mod redundant;
#[path = "chains/written.rs"]
mod written;

use std::collections::BTreeMap;
use std::time::Instant;

use drawn::{Base, Chain, Draw, Restriction, draw_chain};
use hamel_codegen::scene::{self, BuiltScene};
use hamel_codegen::spec::{self, Model};
use hamel_expr::{ExprId, SymbolId, needed_sections, rational_to_f64};
use hamel_mechanics::mechanics::{Equations, derive, is_recursive};
use hamel_mechanics::reduction::{Formulation, reduce};
use redundant::{Motion, State};
use written::{Written, text};

fn parsed(text: &str) -> Model {
    spec::parse("chain.hamel", text).unwrap_or_else(|problems| panic!("{problems}\n{text}"))
}

/// By recursion or multiplied out; derivatives are held to the rates where they are built.
fn built(model: &Model, recursive: bool, text: &str) -> Way {
    let formulation = Formulation { recursive: Some(recursive), ..Formulation::of(model) };
    let build = |name: &str| {
        scene::build_in(model, name, &formulation).unwrap_or_else(|problems| panic!("{problems}\n{text}"))
    };
    build("derivatives");
    Way::Lowered(Box::new(build("bare")))
}

fn derived(model: &Model, recursive: bool, text: &str) -> Way {
    let formulation = Formulation { recursive: Some(recursive), ..Formulation::of(model) };
    let system = reduce(model, &formulation).unwrap_or_else(|e| panic!("{e}\n{text}"));
    Way::Derived(Box::new(derive(&system).unwrap_or_else(|e| panic!("{e}\n{text}"))))
}

/// How far a chain goes through the generator: its equations alone, whose definitions are evaluated one after the
/// other, take a small part of the time of a program.
enum Way {
    Derived(Box<Equations>),
    Lowered(Box<BuiltScene>),
}

impl Way {
    fn state_names(&self) -> Vec<String> {
        match self {
            Way::Derived(equations) => equations.state.iter().map(|s| s.name.clone()).collect(),
            Way::Lowered(scene) => scene.state_names(),
        }
    }

    fn rates(&self, state: &[f64]) -> (Vec<f64>, Option<f64>) {
        match self {
            Way::Lowered(scene) => rates(scene, state),
            Way::Derived(equations) => {
                let graph = &equations.system.graph;
                let params = equations.system.params.iter().map(|p| (p.symbol, rational_to_f64(&p.default)));
                let variables = equations.state.iter().map(|s| s.symbol).zip(state.iter().copied());
                let mut values: BTreeMap<SymbolId, f64> = params.chain(variables).collect();
                let mut roots: Vec<ExprId> = equations.state.iter().map(|s| s.derivative).collect();
                roots.push(equations.energy);
                let sections = needed_sections(graph, &equations.sections, &roots);
                for definition in sections.iter().flat_map(|s| &s.definitions) {
                    let value = graph.eval_f64(definition.expr, &values).expect("in order");
                    values.insert(definition.symbol, value);
                }
                let value = |e: ExprId| graph.eval_f64(e, &values).expect("by definitions");
                let rates = equations.state.iter().map(|s| value(s.derivative)).collect();
                (rates, Some(value(equations.energy)))
            }
        }
    }
}

fn rates(scene: &BuiltScene, state: &[f64]) -> (Vec<f64>, Option<f64>) {
    let params: Vec<f64> = scene.params().iter().map(|p| rational_to_f64(&p.default)).collect();
    let interpreter = scene.prepare(&params).unwrap_or_else(|e| panic!("{e}"));
    let mut rates = vec![0.0; state.len()];
    interpreter.rhs(0.0, state, &mut rates);
    (rates, interpreter.energy(0.0, state))
}

/// Rates are held to this multiple of their largest and of the condition number of the equations: either side factors a
/// mass matrix and loses as many units of 2^-53 as that says, with a few dozen roundings behind its entries.
const UNITS: f64 = 100.0;

/// What either side is held to at least.
const TOLERANCE: f64 = 1e-11;

/// States of worse conditioned equations tell too little.
const MAX_CONDITION: f64 = 1e6;

/// The state of a scene by names, with the rates that are expected.
fn seen(chain: &Chain, names: &[String], at: &State, motion: &Motion) -> (Vec<f64>, Vec<f64>) {
    let n = redundant::n_base(chain);
    let of_name = |name: &String| {
        let number = |text: &str| text.parse::<usize>().expect("a number behind the name") - 1;
        if let Some(k) = name.strip_prefix("omega").map(number) {
            return (at.y[k], motion.accelerations[k]);
        }
        if let Some(k) = name.strip_prefix('v').map(number) {
            return (at.y[3 + k], motion.accelerations[3 + k]);
        }
        let name = name.strip_prefix('q').unwrap_or_else(|| panic!("no variable {name}"));
        match name.strip_suffix("_dot").map(number) {
            Some(k) => (at.y[n + k], motion.accelerations[n + k]),
            None => (at.q[number(name)], at.y[n + number(name)]),
        }
    };
    names.iter().map(of_name).unzip()
}

/// The largest difference of a rate, and of the energy's change between states, in units of what is allowed.
fn compare(chain: &Chain, way: &Way, points: &[(State, Motion)], text: &str) -> f64 {
    let names = way.state_names();
    let mut worst = 0.0_f64;
    let mut energies = Vec::new();
    for (at, motion) in points {
        let (state, expected) = seen(chain, &names, at, motion);
        let (found, energy) = way.rates(&state);
        let size = expected.iter().fold(0.0_f64, |size, rate| size.max(rate.abs()));
        let allowed = TOLERANCE.max(UNITS * f64::EPSILON * motion.condition) * size;
        for ((name, found), expected) in names.iter().zip(&found).zip(&expected) {
            let off = (found - expected).abs();
            // A NaN is no rate either.
            assert!(
                off <= allowed,
                "d{name}/dt is {found}, expected {expected}; at {names:?} = {state:?}\n{text}"
            );
            worst = worst.max(off / allowed);
        }
        energies.extend(energy.map(|energy| (energy - motion.energy, energy.abs() + motion.energy.abs())));
    }
    if let [(a, size), (b, other)] = energies[..] {
        let allowed = TOLERANCE * (size + other);
        assert!((a - b).abs() <= allowed, "the energy changes by {} more\n{text}", a - b);
    }
    worst
}

/// The coordinates of the first state, and all states with their motions.
type Points = (Vec<f64>, Vec<(State, Motion)>);

/// States that the restrictions of a chain allow, at the same angles where there are loops.
fn points(chain: &Chain, draw: &mut Draw) -> Option<Points> {
    let n = chain.bodies.len();
    let is_closed = chain.restrictions.iter().any(|r| matches!(r, Restriction::Loop { .. }));
    let mut points = Vec::new();
    let mut angles: Vec<f64> = Vec::new();
    for _ in 0..12 {
        if angles.is_empty() || !is_closed {
            angles = (0..n).map(|_| 1.5 * draw.number()).collect();
        }
        let y: Vec<f64> = (0..redundant::n_base(chain) + n).map(|_| draw.number()).collect();
        let Some(y) = redundant::allowed(chain, &angles, &y) else {
            angles.clear();
            continue;
        };
        let at = State { q: angles.clone(), y };
        match redundant::motion(chain, &at).filter(|motion| motion.condition < MAX_CONDITION) {
            Some(motion) => points.push((at, motion)),
            None => angles.clear(),
        }
        if points.len() == 2 {
            return Some((points[0].0.q.clone(), points));
        }
    }
    None
}

/// The four inputs of a report: an arm in moving frames, three links with equal lever arms, a planar arm whose lengths
/// are numbers, and three bodies. The first moved otherwise, the others ended the process.
#[test]
fn sums_of_velocities_are_the_sums_of_their_parts() {
    let same = |text: &str, scene: &str| {
        let model = parsed(text);
        let [recursive, expanded] = [true, false].map(|recursive| {
            let formulation = Formulation { recursive: Some(recursive), ..Formulation::of(&model) };
            scene::build_in(&model, scene, &formulation).unwrap_or_else(|problems| panic!("{problems}"))
        });
        let mut draw = Draw::new(1);
        for _ in 0..3 {
            let state: Vec<f64> = recursive.state_names().iter().map(|_| draw.number()).collect();
            let ((a, _), (b, _)) = (rates(&recursive, &state), rates(&expanded, &state));
            let size = b.iter().fold(0.0_f64, |size, rate| size.max(rate.abs()));
            assert!(size > 0.1, "nothing moves\n{text}");
            for (a, b) in a.iter().zip(&b) {
                assert!((a - b).abs() <= 1e-10 * size, "{a} by recursion, {b} multiplied out\n{text}");
            }
        }
    };
    same(include_str!("chains/cases/three_links.hamel"), "default");
    same(include_str!("chains/cases/planar_four.hamel"), "default");
    same(include_str!("chains/cases/three_bodies.hamel"), "bare");
}

/// Accelerations of six joints by Newton's and Euler's equations of each body with multipliers, in 30 digits, by a
/// program of its own in Python.
#[test]
fn an_arm_in_moving_frames_has_the_accelerations_of_newton_and_euler() {
    let text = include_str!("chains/cases/ur_recursion.hamel");
    let expected = [
        -0.042_765_579_391_155_21,
        -1.002_317_506_693_015_4,
        2.322_237_537_004_960_2,
        0.852_847_604_351_739_7,
        0.585_232_625_537_113_7,
        -1.955_438_142_031_628_8,
    ];
    let model = parsed(text);
    let scene = scene::build(&model, "default").unwrap_or_else(|problems| panic!("{problems}"));
    let values = [0.3, 0.7, -0.4, 1.1, 0.5, -0.8, 0.2, -0.5, 0.9, 0.4, -1.2, 0.6];
    let names: Vec<String> =
        (1..=6).map(|k| format!("q{k}")).chain((1..=6).map(|k| format!("q{k}_dot"))).collect();
    let known: BTreeMap<&String, f64> = names.iter().zip(values).collect();
    let state: Vec<f64> = scene.state_names().iter().map(|name| known[name]).collect();
    let (found, _) = rates(&scene, &state);
    for (found, expected) in found[found.len() - 6..].iter().zip(expected) {
        assert!((found - expected).abs() <= 1e-12, "{found}, expected {expected}");
    }
}

#[test]
fn arms_of_industry_move_as_dalembert_says() {
    for (name, chain) in arms::arms() {
        let (angles, points) = points(&chain, &mut Draw::new(1)).expect("states");
        for written in [Written::Bodies, Written::Frames] {
            let text = text(&chain, written, &angles);
            let model = parsed(&text);
            let is_linked = is_recursive(&reduce(&model, &Formulation::of(&model)).expect("reduces"));
            assert!(is_linked, "{name} has no recursion\n{text}");
            let start = Instant::now();
            let worst = compare(&chain, &derived(&model, true, &text), &points, &text);
            println!(
                "{name}, {written:?}: {worst:.1e} of what is allowed, {:.1} s",
                start.elapsed().as_secs_f64()
            );
        }
    }
}

/// Chains drawn unless asked for more.
const N_CHAINS: usize = 24;

/// Bodies that are multiplied out beside the recursion: the number of operations grows with the fourth power.
const MAX_EXPANDED: usize = 3;

/// Longer chains are derived alone.
const MAX_LOWERED: usize = 4;

fn from_environment(name: &str) -> Option<u64> {
    std::env::var(name).ok().and_then(|text| text.parse().ok())
}

/// One chain in all its forms; how many were compared.
fn run(seed: u64, most: usize) -> usize {
    let mut draw = Draw::new(seed);
    let n = 2 + draw.below(most - 1);
    let chain = draw_chain(&mut draw, n);
    let Some((angles, points)) = points(&chain, &mut draw) else { return 0 };
    let mut compared = 0;
    for written in [Written::Bodies, Written::Frames] {
        if written == Written::Bodies && matches!(chain.base, Base::Floating { .. }) {
            continue;
        }
        let text = format!("// seed {seed}\n{}", text(&chain, written, &angles));
        let model = parsed(&text);
        let system = reduce(&model, &Formulation::of(&model)).unwrap_or_else(|e| panic!("{e}\n{text}"));
        let forms: &[bool] = match (is_recursive(&system), n <= MAX_EXPANDED) {
            (true, true) => &[true, false],
            (true, false) => &[true],
            (false, _) => &[false],
        };
        for recursive in forms {
            let start = Instant::now();
            let way = match draw.below(4) {
                0 if n <= MAX_LOWERED => built(&model, *recursive, &text),
                _ => derived(&model, *recursive, &text),
            };
            let worst = compare(&chain, &way, &points, &text);
            let kind = match (recursive, &way) {
                (true, Way::Derived(_)) => "by recursion",
                (true, Way::Lowered(_)) => "by recursion, lowered",
                (false, Way::Derived(_)) => "multiplied out",
                (false, Way::Lowered(_)) => "multiplied out, lowered",
            };
            let (seconds, rows) = (start.elapsed().as_secs_f64(), chain.restrictions.len());
            println!("{seed}: {n} joints, {rows} rows, {written:?} {kind}: {worst:.1e}, {seconds:.1} s");
            compared += 1;
        }
    }
    compared
}

#[test]
fn random_chains_move_as_dalembert_says() {
    let asked_for = from_environment("HAMEL_CHAINS");
    let n = asked_for.unwrap_or(N_CHAINS as u64);
    let most = if asked_for.is_some() { 9 } else { 4 };
    let first = from_environment("HAMEL_CHAINS_SEED").unwrap_or(0);
    let (mut compared, mut failed) = (0, Vec::new());
    for seed in first..first + n {
        // Every failure prints its seed and its text; the others go on.
        match std::panic::catch_unwind(|| run(seed, most)) {
            Ok(n) => compared += n,
            Err(_) => failed.push(seed),
        }
    }
    assert_eq!(failed, [0_u64; 0], "seeds of chains that move otherwise");
    assert!(compared as u64 >= n, "only {compared} of {n} chains were compared");
}
