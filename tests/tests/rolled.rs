//! Fluids of many modes as loops over tables: against straight-line code, against products of matrices, and what stays
//! constant. Taylor coefficients through them.

use hamel_codegen::scene::{self, BuiltScene, Interpreter};
use hamel_codegen::spec;
use hamel_program::lower::SearchBudget;
use hamel_program::program::{self, Role};
use hamel_runtime::matrices::{IsospectralMidpoint, Options, Torus};
use hamel_runtime::{Integrator, Jet, System, Taylor, Vern9};
use hamel_tests::models::{model, params};
use hamel_tests::random::Random;

/// The Euler equations of so many modes, with Casimirs where they are asked for.
fn fluid(n: usize, items: &str, wants: &str) -> String {
    format!(
        "model fluid {{
            algebra g = zeitlin({n});
            momentum omega in g as *;
            action right;
            hamiltonian = -dot(omega, laplacian(g)^-1*omega);
            {items}
            scene default {{ want {wants}; }}
        }}"
    )
}

fn build(text: &str, products: usize) -> BuiltScene {
    let model = spec::parse("fluid.hamel", text).unwrap_or_else(|e| panic!("{e}"));
    let search = SearchBudget { products, ..SearchBudget::default() };
    scene::build_within(&model, "default", search).unwrap_or_else(|e| panic!("{e}"))
}

fn random_modes(n: usize, seed: u64) -> Vec<f64> {
    let mut random = Random(seed);
    (0..n * n - 1).map(|_| random.number() - 0.5).collect()
}

/// `dy/dt` by the interpreter.
fn rates(built: &BuiltScene, modes: &[f64]) -> Vec<f64> {
    let mut rates = vec![0.0; modes.len()];
    built.prepare(&[]).unwrap_or_else(|e| panic!("{e}")).rhs(0.0, modes, &mut rates);
    rates
}

fn largest(x: &[f64]) -> f64 {
    x.iter().fold(0.0_f64, |m, x| m.max(x.abs()))
}

/// `-[psi, omega]` as a commutator of matrices.
fn rates_of_matrices(n: usize, modes: &[f64]) -> Vec<f64> {
    let surface = Torus::new(n, vec![0.0; Torus::<Vec<f64>>::storage(n)]).unwrap_or_else(|e| panic!("{e}"));
    type Solver<'s> = IsospectralMidpoint<'s, Torus<Vec<f64>>, Vec<f64>>;
    let options = Options::fixed(0.1);
    let room = vec![0.0; Solver::storage(n, &options)];
    let mut solver = Solver::new(&surface, room, 0.0, options).unwrap_or_else(|e| panic!("{e}"));
    surface.set_modes(modes, solver.vorticity_mut());
    let mut rates = vec![0.0; modes.len()];
    surface.modes(solver.derivative(), &mut rates);
    rates
}

#[test]
fn eleven_squared_modes_move_as_matrices_and_keep_what_they_keep() {
    let n = 11;
    let casimirs = "casimir C2 = trace_power(g, omega, 2);";
    let built = build(&fluid(n, casimirs, "rhs, energy, C2"), SearchBudget::default().products);
    let rate = built.program().function(&Role::Rate).unwrap();
    // No instruction, one table, and nothing but the state in it.
    assert!(rate.instructions.is_empty() && rate.scalars.is_empty(), "{:?}", rate.scalars);
    assert_eq!((rate.contractions.len(), rate.contractions[0].terms.len()), (1, 1));
    assert_eq!(rate.contractions[0].n_results, n * n - 1);
    assert!(
        (10_000..15_000).contains(&rate.contractions[0].n_products),
        "{}",
        rate.contractions[0].n_products
    );
    let interpreter = built.prepare(&[]).unwrap();
    for seed in 0..5 {
        let modes = random_modes(n, seed);
        let found = rates(&built, &modes);
        let expected = rates_of_matrices(n, &modes);
        let scale = largest(&expected);
        for (k, (found, expected)) in found.iter().zip(&expected).enumerate() {
            assert!((found - expected).abs() < 2e-14 * scale, "rate {k} is {found}, of matrices {expected}");
        }
        // dE/dt and dC2/dt along the motion, by central differences of quadratic functions, which are exact.
        let moved = |h: f64| -> Vec<f64> { modes.iter().zip(&found).map(|(y, dy)| y + h * dy).collect() };
        let h = 0.5 / scale;
        let (ahead, back) = (moved(h), moved(-h));
        let energy = |y: &[f64]| interpreter.energy(0.0, y).unwrap();
        let rate = (energy(&ahead) - energy(&back)) / (2.0 * h);
        assert!(rate.abs() < 1e-13 * energy(&ahead) / h, "dE/dt = {rate:e}");
        let casimir = |y: &[f64]| interpreter.outputs(0.0, y)[0];
        let rate = (casimir(&ahead) - casimir(&back)) / (2.0 * h);
        assert!(rate.abs() < 1e-13 * casimir(&ahead) / h, "dC2/dt = {rate:e}");
    }
}

/// Loops and straight-line code of one fluid, with viscosity and a wave that stirs it.
#[test]
fn loops_agree_with_straight_lines() {
    let items = "param mu = 0.05; force dh_domega = -2*mu*omega + cos(t)*omega;";
    let text = fluid(5, items, "rhs, energy, jacobian, jvp");
    let (rolled, straight) = (build(&text, 100), build(&text, usize::MAX));
    let role = |name: &str| Role::Output(name.to_owned());
    for (wanted, is_rolled) in [(Role::Rate, true), (role("jacobian"), true), (Role::Energy, false)] {
        let function = rolled.program().function(&wanted).unwrap();
        assert_eq!(!function.contractions.is_empty(), is_rolled, "{wanted}");
    }
    let both = [&rolled, &straight].map(|built| built.prepare(&[0.07]).unwrap());
    for seed in 0..5 {
        let modes = random_modes(5, seed);
        let [a, b] = both.each_ref().map(|i| {
            let mut rates = vec![0.0; modes.len()];
            i.rhs(0.7, &modes, &mut rates);
            rates.extend(i.outputs(0.7, &modes));
            rates
        });
        let scale = largest(&b);
        for (k, (a, b)) in a.iter().zip(&b).enumerate() {
            assert!((a - b).abs() < 1e-14 * scale, "{k}: {a} {b}");
        }
    }
}

/// Orders of the coefficients that are compared.
const ORDER: usize = 20;

/// Taylor coefficients of the solution through a state, order by order.
fn series(built: &BuiltScene, params: &[f64], t: f64, y: &[f64]) -> Vec<Vec<f64>> {
    let mut out = vec![vec![0.0; y.len()]; ORDER + 1];
    let mut rows: Vec<&mut [f64]> = out.iter_mut().map(Vec::as_mut_slice).collect();
    let jet = built.jet().unwrap_or_else(|e| panic!("{e}"));
    built.prepare(params).unwrap_or_else(|e| panic!("{e}")).series(&jet, t, y, &mut rows);
    out
}

/// Differences of two lists of coefficients, each order by its own largest one.
fn compare(what: &str, rolled: &[Vec<f64>], straight: &[Vec<f64>]) {
    for (order, (a, b)) in rolled.iter().zip(straight).enumerate() {
        let scale = largest(b);
        assert!(scale > 0.0, "{what}: coefficients of order {order} vanish");
        for (k, (a, b)) in a.iter().zip(b).enumerate() {
            // Sums of some hundred terms, whose errors pass through the orders before.
            assert!((a - b).abs() < 1e-13 * scale, "{what}, order {order}, {k}: {a} {b}");
        }
    }
}

#[test]
fn taylor_coefficients_through_tables_are_those_of_straight_lines() {
    // Scalars that change with time, and some that do not.
    let items = "param mu = 0.05; force dh_domega = -2*mu*omega + cos(t)*omega;";
    let text = fluid(5, items, "rhs, taylor");
    let (rolled, straight) = (build(&text, 100), build(&text, usize::MAX));
    assert!(!rolled.program().function(&Role::Rate).unwrap().contractions.is_empty());
    let modes = random_modes(5, 3);
    compare("stirred", &series(&rolled, &[0.07], 0.7, &modes), &series(&straight, &[0.07], 0.7, &modes));
    for name in ["zeitlin_euler_3", "zeitlin_euler_5", "zeitlin_mhd_3", "second_grade_fluid", "camassa_holm"]
    {
        let model = model(name);
        let [rolled, straight] = [1, usize::MAX].map(|products| {
            let search = SearchBudget { products, ..SearchBudget::default() };
            scene::build_within(&model, "default", search).unwrap_or_else(|e| panic!("{e}"))
        });
        assert!(!rolled.program().function(&Role::Rate).unwrap().contractions.is_empty(), "{name}");
        let mut random = Random(7);
        let y: Vec<f64> = rolled.state().iter().map(|_| random.number() - 0.5).collect();
        let params = params(&rolled, &[]);
        compare(name, &series(&rolled, &params, 0.0, &y), &series(&straight, &params, 0.0, &y));
    }
}

/// The Euler equations of 80 modes, interpreted.
struct Interpreted<'a> {
    interpreter: Interpreter<'a>,
    jet: program::Jet,
}

impl System<f64> for Interpreted<'_> {
    type State = [f64; 80];

    fn rhs(&self, t: f64, y: &[f64; 80], dy: &mut [f64; 80]) {
        self.interpreter.rhs(t, y, dy);
    }
}

impl Jet<f64> for Interpreted<'_> {
    type Workspace = ();

    fn workspace(&self) {}

    fn series(&self, t: f64, y: &[f64; 80], (): &mut (), out: &mut [[f64; 80]]) {
        let mut rows: Vec<&mut [f64]> = out.iter_mut().map(<[f64; 80]>::as_mut_slice).collect();
        self.interpreter.series(&self.jet, t, y, &mut rows);
    }
}

#[test]
fn taylor_steps_through_tables_have_their_order_and_agree_with_another_method() {
    let built = build(&fluid(9, "", "rhs, taylor"), SearchBudget::default().products);
    let n_products = built.program().function(&Role::Rate).unwrap().contractions[0].n_products;
    assert!(n_products > 5000, "{n_products}");
    let system = Interpreted { interpreter: built.prepare(&[]).unwrap(), jet: built.jet().unwrap() };
    let start: [f64; 80] = random_modes(9, 11).try_into().unwrap();
    let distance =
        |a: &[f64; 80], b: &[f64; 80]| a.iter().zip(b).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));

    let options = hamel_runtime::Options::adaptive(1e-14, 1e-14);
    let mut exact = Integrator::new(&system, Vern9, 0.0, start, options).unwrap();
    exact.integrate_to(1.0).unwrap();
    let mut solver = Integrator::new(&system, Taylor::new(), 0.0, start, options).unwrap();
    solver.integrate_to(1.0).unwrap();
    let error = distance(solver.state(), exact.state());
    assert!(error < 1e-12, "{error:e}");
    assert!(distance(solver.state(), &start) > 0.1, "the fluid moves");

    for order in [3, 6] {
        let at = |h: f64| {
            let options = hamel_runtime::Options::fixed(h);
            let mut solver = Integrator::new(&system, Taylor::of_order(order), 0.0, start, options).unwrap();
            solver.integrate_to(1.0).unwrap();
            distance(solver.state(), exact.state())
        };
        let slope = (at(1.0 / 16.0) / at(1.0 / 32.0)).log2();
        assert!((slope - order as f64).abs() < 0.7, "order {order}: {slope}");
    }
}
