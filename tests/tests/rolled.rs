//! Fluids of many modes as loops over tables: against straight-line code, against products of matrices, and what stays
//! constant.

use hamel_codegen::lower::SearchBudget;
use hamel_codegen::program::Role;
use hamel_codegen::scene::{self, BuiltScene};
use hamel_codegen::spec;
use hamel_runtime::matrices::{IsospectralMidpoint, Options, Torus};
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
    let rate = built.program.function(&Role::Rate).unwrap();
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
        let function = rolled.program.function(&wanted).unwrap();
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

#[test]
fn a_scene_that_wants_taylor_coefficients_has_straight_lines() {
    let text = fluid(5, "", "rhs, taylor");
    let built = build(&text, 1);
    assert!(built.program.functions.iter().all(|f| f.contractions.is_empty()));
    assert!(built.jet().is_ok());
    let built = build(&fluid(5, "", "rhs"), 1);
    let refused = built.jet().unwrap_err().to_string();
    assert!(refused.contains("tables"), "{refused}");
}
