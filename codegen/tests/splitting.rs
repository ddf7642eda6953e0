//! Exact flows: each is the flow of its generator, the generators add up to the motion, and what cannot be split says
//! why.

use hamel_codegen::expr::rational_to_f64;
use hamel_codegen::program::{Point, Program, Role};
use hamel_codegen::scene::{self, BuiltScene};
use hamel_codegen::spec;
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
        let prepared = scene.program.prepare(&params).expect("defaults that are allowed");
        Functions { program: &scene.program, params, prepared }
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
    let y = state(scene.state.len());
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
