//! Exact flows: each is the flow of its generator, the generators add up to the motion, and what cannot be split says
//! why.

use hamel_codegen::scene::{self, BuiltScene};
use hamel_codegen::spec;
use hamel_expr::rational_to_f64;
use hamel_program::program::{Point, Program, Role};
use hamel_runtime::{Dual, ExactFlows, Gauss8, Integrator, Options, Real, Splitting6, StateVector, System};

/// A state of any dimension.
#[derive(Clone, Debug)]
struct State(Vec<f64>);

impl StateVector<f64> for State {
    fn as_slice(&self) -> &[f64] {
        &self.0
    }

    fn as_mut_slice(&mut self) -> &mut [f64] {
        &mut self.0
    }
}

/// The functions of a scene over a scalar.
struct Functions<'a, R> {
    program: &'a Program,
    params: Vec<R>,
    prepared: Vec<R>,
}

impl<'a, R: Real> Functions<'a, R> {
    fn of(scene: &'a BuiltScene) -> Functions<'a, R> {
        let values = scene.params().iter().map(|p| R::from_f64(rational_to_f64(&p.default)));
        let params: Vec<R> = values.collect();
        let prepared = scene.program().prepare(&params).expect("defaults that are allowed");
        Functions { program: scene.program(), params, prepared }
    }

    fn call(&self, role: &Role, y: &[R], argument: &[R]) -> Vec<R> {
        let k = self.program.function_idx(role).expect("the scene wants it");
        let mut out = vec![R::ZERO; self.program.functions[k].results.len()];
        let point = Point { t: R::ZERO, state: y, argument };
        self.program.run_at(k, &self.params, &self.prepared, point, &mut out);
        out
    }

    fn flow(&self, index: usize, tau: R, y: &[R]) -> Vec<R> {
        self.call(&Role::Flow(format!("flow{}", index + 1)), y, &[tau])
    }
}

/// The vector field behind one flow: its derivative by the time, at zero.
struct Generator<'a> {
    functions: Functions<'a, Dual>,
    index: usize,
}

impl System<f64> for Generator<'_> {
    type State = State;

    fn rhs(&self, _t: f64, y: &State, dy: &mut State) {
        let y: Vec<Dual> = y.0.iter().copied().map(Dual::constant).collect();
        let moved = self.functions.flow(self.index, Dual::variable(0.0), &y);
        dy.0 = moved.into_iter().map(|e| e.derivative).collect();
    }
}

/// The motion with all of its flows.
struct Split<'a> {
    functions: Functions<'a, f64>,
    n_flows: usize,
}

impl System<f64> for Split<'_> {
    type State = State;

    fn rhs(&self, _t: f64, y: &State, dy: &mut State) {
        dy.0 = self.functions.call(&Role::Rate, &y.0, &[]);
    }
}

impl ExactFlows<f64> for Split<'_> {
    fn n_flows(&self) -> usize {
        self.n_flows
    }

    fn flow(&self, index: usize, tau: f64, y: &State, increment: &mut State) {
        increment.0 = self.functions.flow(index, tau, &y.0);
    }
}

fn built(text: &str, scene: &str) -> Result<BuiltScene, String> {
    let model = spec::parse("m.hamel", text).map_err(|e| e.to_string())?;
    scene::build(&model, scene).map_err(|e| e.to_string())
}

fn shipped(name: &str, items: &str) -> Result<BuiltScene, String> {
    let path = format!("{}/../models/specs/{name}.hamel", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(path).map_err(|e| e.to_string())?;
    let end = text.trim_end().strip_suffix('}').ok_or("no end")?;
    built(&format!("{end} scene test_of_flows {{ want rhs, splitting; {items} }} }}"), "test_of_flows")
}

/// Components of either sign, none of them near zero.
fn state(n: usize) -> Vec<f64> {
    (0..n).map(|k| (0.4 + 0.13 * (k % 5) as f64) * if k % 3 == 1 { -1.0 } else { 1.0 }).collect()
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// Each flow against a general method for its generator, and the sum of the generators against the motion.
fn verify(what: &str, scene: &BuiltScene) {
    let y = state(scene.state().len());
    let rates = Functions::<f64>::of(scene).call(&Role::Rate, &y, &[]);
    assert!(rates.iter().any(|e| e.abs() > 1e-3), "{what}: nothing moves");
    let mut sum = vec![0.0; y.len()];
    let n_flows = scene.flows().len();
    for index in 0..n_flows {
        let generator = Generator { functions: Functions::of(scene), index };
        let mut slope = State(y.clone());
        generator.rhs(0.0, &State(y.clone()), &mut slope);
        sum.iter_mut().zip(&slope.0).for_each(|(sum, e)| *sum += e);
        let tau = 0.8;
        let options = Options::fixed(tau / 32.0);
        let mut solver =
            Integrator::new(&generator, Gauss8::fixed_point(), 0.0, State(y.clone()), options).unwrap();
        solver.integrate_to(tau).unwrap();
        let increment = Functions::<f64>::of(scene).flow(index, tau, &y);
        let moved: Vec<f64> = y.iter().zip(&increment).map(|(y, e)| y + e).collect();
        let error = distance(&moved, &solver.state().0);
        // Rounding of states of size one to ten over 32 steps; Gauss8 is exact to 1e-16 with these steps.
        assert!(error < 1e-13, "{what}, flow {}: {error:e}", index + 1);
    }
    // Rounding of a dozen terms of size one.
    assert!(distance(&sum, &rates) < 1e-13, "{what}: {sum:?} {rates:?}");
    // Composed, they follow the motion.
    let split = Split { functions: Functions::of(scene), n_flows };
    let end = |h: f64| {
        let start = State(y.clone());
        let mut solver = Integrator::new(&split, Splitting6::new(), 0.0, start, Options::fixed(h)).unwrap();
        solver.integrate_to(0.5).unwrap();
        solver.state().0.clone()
    };
    let mut solver =
        Integrator::new(&split, Gauss8::fixed_point(), 0.0, State(y.clone()), Options::fixed(1.0 / 128.0))
            .unwrap();
    solver.integrate_to(0.5).unwrap();
    let error = distance(&end(1.0 / 64.0), &solver.state().0);
    assert!(error < 1e-10, "{what}: {error:e}");
}

#[test]
fn flows_of_shipped_models_are_exact() {
    let cases = [
        ("free_rigid_body", "carry Pi;", 2),
        ("free_rigid_body", "", 2),
        ("heavy_top", "carry Pi;", 4),
        ("kirchhoff_body", "carry Pi, P;", 4),
    ];
    for (name, items, n_flows) in cases {
        let what = format!("{name} {items}");
        let scene = shipped(name, items).unwrap_or_else(|e| panic!("{what}: {e}"));
        assert_eq!(scene.flows().len(), n_flows, "{what}: {:?}", scene.flows());
        verify(&what, &scene);
    }
}

/// A Hamiltonian model with its flows.
fn hamiltonian(items: &str) -> Result<BuiltScene, String> {
    built(&format!("model m {{ {items} scene flows {{ want rhs, splitting; }} }}"), "flows")
}

#[test]
fn other_hamiltonians_are_split() {
    let body = "velocity w in so(3); momentum p of w;";
    let top = format!("{body} advected g in R^3 by cross(w, g);");
    let plane = "algebra sl2 { basis h, e, f; [h, e] = 2*e; [h, f] = -2*f; [e, f] = h; }
                 velocity w in sl2; momentum p of w;";
    let cases = [
        ("no squares", format!("{body} hamiltonian = p1*p2 + p3^2/2 + 0.3*p1;"), 4),
        ("all products", format!("{body} hamiltonian = p1^2 + p2^2 + 2*p3^2 + p1*p2/2 + p2*p3/3;"), 3),
        ("a linear part along a square", format!("{body} hamiltonian = p1^2/2 + p2^2/3 + 0.4*p2;"), 2),
        ("any function that commutes", format!("{top} hamiltonian = p1^2 + p2^2/3 + cos(g1)*g2 + g3^3;"), 3),
        ("a function of one momentum", format!("{body} hamiltonian = exp(p1/2) + p2^2/3;"), 2),
        ("one piece of two that commute", format!("{top} hamiltonian = p1^2 + p3^2/3 + g3;"), 2),
        ("the right action", format!("{body} action right; hamiltonian = p1^2 + p2^2/3;"), 2),
        ("hyperbolic", format!("{plane} hamiltonian = p1^2/3 + p2*p3;"), 3),
        (
            "nilpotent",
            "algebra heis { basis a, b, c; [a, b] = c; } velocity w in heis; momentum p of w;
             hamiltonian = p1^2/2 + p2^2/2 + p3^2;"
                .to_owned(),
            2,
        ),
        (
            "growing",
            "algebra aff { basis a, b; [a, b] = b; } velocity w in aff; momentum p of w;
             hamiltonian = p1^2/2 + p2^2/2;"
                .to_owned(),
            2,
        ),
        (
            "canonical",
            "coordinate x in real; momentum p of x_dot; hamiltonian = p^2/2 - cos(x);".to_owned(),
            2,
        ),
        (
            "two bodies side by side",
            "velocity w, v in product(so(3), so(3)); momentum p of w; momentum q of v;
             hamiltonian = p1^2/2 + p2^2/3 + q1^2 + q2^2/5;"
                .to_owned(),
            2,
        ),
    ];
    for (what, items, n_flows) in cases {
        let scene = hamiltonian(&items).unwrap_or_else(|e| panic!("{what}: {e}"));
        assert_eq!(scene.flows().len(), n_flows, "{what}: {:?}", scene.flows());
        verify(what, &scene);
    }
}

#[test]
fn what_is_not_split_says_why() {
    let body = "velocity w in so(3); momentum p of w;";
    let cases = [
        (
            format!("{body} hamiltonian = p1^3*p2 + p3^2;"),
            "the Hamiltonian is no polynomial of second degree in p1 and p2, which do not commute",
        ),
        (
            format!("{body} hamiltonian = p1^2 + p3^2; force w = -0.1*w;"),
            "an affine constraint, explicit time or a force acts",
        ),
        (
            // Numbers that grow at two rates in one block.
            "algebra grows { basis a, b, c; [a, b] = b; [a, c] = b + 2*c; } velocity w in grows; momentum p of w;
             hamiltonian = p1^2/2 + p2^2/2;"
                .to_owned(),
            "the flow of functions of p1 has no closed form",
        ),
        (format!("{body} casimir c = dot(p, p); hamiltonian = dot(p, p);"), "nothing moves"),
        (
            "coordinate x in real; coordinate y in real; param m = 2 where m > 0;
             lagrangian = m/2*(1 + x^2)*(x_dot^2 + y_dot^2);"
                .to_owned(),
            "is not affine in the state",
        ),
    ];
    for (items, expected) in cases {
        let error = hamiltonian(&items).err().unwrap_or_else(|| panic!("{expected}: it is split"));
        assert!(error.contains("there is no splitting into exact flows"), "{error}");
        assert!(error.contains(expected), "{error}");
        // At the scene's own word.
        assert!(error.contains("want rhs, splitting"), "{error}");
    }
}

#[test]
fn a_scene_with_coordinates_of_the_group_is_not_split() {
    let error = shipped("free_rigid_body", "want reconstruction;").expect_err("a refusal");
    assert!(error.contains("qw is reconstructed, and no part of the bracket"), "{error}");
}

#[test]
fn modes_of_a_fluid_turn_at_several_frequencies_and_are_not_split() {
    let error = shipped("zeitlin_euler_3", "").expect_err("a refusal");
    assert!(error.contains("the flow of functions of im_0_1 has no closed form"), "{error}");
}

#[test]
fn casimirs_stay_what_they_were() {
    for (name, items) in
        [("free_rigid_body", "carry Pi;"), ("heavy_top", "carry Pi;"), ("kirchhoff_body", "carry Pi, P;")]
    {
        let scene =
            shipped(name, &format!("{items} want casimirs;")).unwrap_or_else(|e| panic!("{name}: {e}"));
        let casimirs = |y: &[f64]| -> Vec<f64> {
            let outputs = scene.outputs().iter().map(|o| Role::Output(o.name.clone()));
            outputs.flat_map(|role| Functions::<f64>::of(&scene).call(&role, y, &[])).collect()
        };
        let start = state(scene.state().len());
        let split = Split { functions: Functions::of(&scene), n_flows: scene.flows().len() };
        let options = Options::fixed(0.05);
        let mut solver =
            Integrator::new(&split, hamel_runtime::Splitting4::new(), 0.0, State(start.clone()), options)
                .unwrap();
        solver.integrate_to(250.0).unwrap();
        let (before, after) = (casimirs(&start), casimirs(&solver.state().0));
        assert!(!before.is_empty(), "{name}");
        assert!(distance(&start, &solver.state().0) > 0.1, "{name}: nothing moves");
        // 5000 steps of some twenty flows; each adds rounding of second order in its angle, at random.
        assert!(distance(&before, &after) < 2e-14, "{name}: {before:?} {after:?}");
    }
}

#[test]
fn random_quadratic_forms_are_split_on_every_algebra() {
    let one = "momentum p of w";
    let two = "momentum p of w; momentum q of v";
    let algebras: [(&str, &str, &[&str]); 6] = [
        ("w in so(3)", one, &["p1", "p2", "p3"]),
        ("w in se2", one, &["p1", "p2", "p3"]),
        ("w, v in se(3)", two, &["p1", "p2", "p3", "q1", "q2", "q3"]),
        ("w, v in product(so(3), R^2)", two, &["p1", "p2", "p3", "q1", "q2"]),
        ("w in heis", one, &["p1", "p2", "p3"]),
        ("w in sl2", one, &["p1", "p2", "p3"]),
    ];
    // A generator of random numbers by a linear congruence, the high bits alone.
    let mut seed = 7_u64;
    let mut number = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        i64::try_from(seed >> 60).expect("four bits") - 7
    };
    for (algebra, momenta, names) in algebras {
        for side in ["left", "right"] {
            let mut terms = Vec::new();
            for (i, a) in names.iter().enumerate() {
                terms.push(format!("({})/8*{a}^2 + ({})/8*{a}", 2 + number().abs(), number()));
                terms.extend(names[..i].iter().map(|b| format!("({})/16*{a}*{b}", number())));
            }
            let items = format!(
                "algebra se2 {{ basis a, b, c; [a, b] = c; [a, c] = -b; }}
                 algebra heis {{ basis a, b, c; [a, b] = c; }}
                 algebra sl2 {{ basis h, e, f; [h, e] = e; [h, f] = -f; [e, f] = h; }}
                 velocity {algebra}; {momenta}; action {side}; hamiltonian = {};",
                terms.join(" + ")
            );
            let scene = hamiltonian(&items).unwrap_or_else(|e| panic!("{algebra}: {e}"));
            verify(&format!("{algebra} {side}: {}", terms.join(" + ")), &scene);
        }
    }
}
