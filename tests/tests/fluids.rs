//! Truncated fluids: Casimirs by matrices, balances of energy, misprints of the source, almost algebras.

use hamel_codegen::scene;
use hamel_codegen::spec;
use hamel_expr::{ExprId, SymbolId};
use hamel_mechanics::mechanics::{Equations, derive};
use hamel_mechanics::reduction::{Formulation, reduce};
use hamel_program::program::Role;
use hamel_tests::models;
use hamel_tests::reference;
use hamel_tests::tracked::{tracked, units_off};

fn equations(name: &str, text: &str) -> Equations {
    let model = spec::parse(name, text).unwrap_or_else(|e| panic!("{e}"));
    derive(&reduce(&model, &Formulation::of(&model)).unwrap_or_else(|e| panic!("{e}")))
        .unwrap_or_else(|e| panic!("{e}"))
}

/// The energy rate in the variables of the state, definitions being replaced by what they say.
fn energy_rate(e: &mut Equations) -> ExprId {
    let definitions: Vec<_> = e.sections.iter().flat_map(|s| s.definitions.clone()).collect();
    let g = &mut e.system.graph;
    let values = hamel_expr::inlined(g, &definitions);
    g.subs(e.energy_rate, &values).expect("nothing is divided by zero")
}

#[test]
fn casimirs_are_traces_of_powers_of_matrices() {
    let mut compared = 0;
    for name in ["zeitlin_euler_3", "zeitlin_euler_5", "zeitlin_euler_7", "zeitlin_mhd_3", "zeitlin_mhd_5"] {
        let points = reference::read(name).points;
        let mut scenes = vec![models::build(name, scene::DEFAULT)];
        // Those that are known and that the model's scene does not want.
        let has = |component: &str| {
            scenes[0].outputs().iter().any(|o| o.components.iter().any(|(n, _)| n == component))
        };
        let others: Vec<&str> =
            points[0].extra.keys().map(String::as_str).filter(|n| is_casimir(n) && !has(n)).collect();
        if !others.is_empty() {
            let text = models::text_with(name, &format!("scene casimirs {{ want {}; }}", others.join(", ")));
            let model = spec::parse(name, &text).unwrap_or_else(|e| panic!("{e}"));
            scenes.push(scene::build(&model, "casimirs").unwrap_or_else(|e| panic!("{e}")));
        }
        for (scene, point) in scenes.iter().flat_map(|scene| points.iter().map(move |point| (scene, point))) {
            let state = reference::in_order(&point.state, &scene.state_names());
            for output in scene.outputs() {
                let components: Vec<&str> = output.components.iter().map(|(n, _)| n.as_str()).collect();
                if !components.iter().any(|n| is_casimir(n) && point.extra.contains_key(*n)) {
                    continue;
                }
                let values = tracked(scene.program(), &Role::Output(output.name.clone()), &[], &state);
                for (component, value) in components.into_iter().zip(values) {
                    let off = units_off(value, &point.extra[component]);
                    assert!(off <= 64.0, "{name}: {component} is {off} units off");
                    compared += 1;
                }
            }
        }
    }
    // At twelve points: of the sizes 3, 5 and 7, and of potentials and vorticities of the sizes 3 and 5.
    assert_eq!(compared, 12 * ((2 + 4 + 6) + (4 + 8)));
}

fn is_casimir(name: &str) -> bool {
    name.starts_with(['C', 'D'])
}

#[test]
fn viscosity_alone_takes_energy_from_a_plane_fluid_of_second_grade() {
    let name = "second_grade_fluid";
    let mut e = equations(name, &models::text(name));
    assert!(e.facts.bracket_is_almost);
    assert!(!e.facts.energy_is_conserved);
    let rate = energy_rate(&mut e);
    // E' = -mu sum over all modes of |omega|^2, twice the sum over half of them, whatever alpha1 and alpha2 are.
    let state: Vec<SymbolId> = e.state.iter().map(|s| s.symbol).collect();
    let mu = e.system.params.iter().find(|p| p.name == "mu").expect("a viscosity").symbol;
    let g = &mut e.system.graph;
    let squares: Vec<ExprId> = state
        .iter()
        .map(|s| {
            let x = g.sym(*s);
            g.powi(x, 2)
        })
        .collect();
    let (mu, sum) = (g.sym(mu), g.sum(&squares));
    let power = g.mul(mu, sum);
    let loss = g.add(power, power);
    let balance = g.add(rate, loss);
    assert!(!g.is_zero(rate) && g.is_zero(balance));
}

/// Errata, section 7.6: the force has the factor `alpha1 + alpha2`, and the printed `alpha2 - alpha1` gives energy
/// where there is no viscosity and both moduli cancel.
#[test]
fn without_force_a_fluid_with_three_components_conserves_energy() {
    let name = "second_grade_fluid_3c";
    let text = models::text(name);
    let fixed = |text: &str| {
        text.replace("param mu = 0.05;", "let mu = 0;")
            .replace("param alpha2 = -0.2;", "let alpha2 = -alpha1;")
    };
    let right = equations(name, &fixed(&text));
    assert!(right.facts.energy_is_conserved);
    let printed = fixed(&text.replace("(alpha1 + alpha2)", "(alpha2 - alpha1)"));
    assert!(!equations(name, &printed).facts.energy_is_conserved);
    // With equal moduli the printed force vanishes, and is not the one of the catalogue.
    let mu = text.replace("param mu = 0.05;", "let mu = 0;");
    assert!(!equations(name, &mu).facts.energy_is_conserved);
}

/// Casimirs of the brackets with Jacobi are none of a Galerkin truncation: enstrophy is conserved there, too, the sum
/// of the cubes of vorticity is not.
#[test]
fn casimirs_are_not_assumed_of_almost_algebras() {
    let text = "model truncated {
        algebra plane = torus(1);
        momentum omega in plane as *;
        action right;
        hamiltonian = -dot(omega, laplacian(plane)^-1*omega);
        casimir C2 = dot(omega, omega);
    }";
    let e = equations("truncated", text);
    assert!(e.facts.bracket_is_almost && e.facts.energy_is_conserved);
    assert!(!equations("lie", &text.replace("torus(1)", "zeitlin(3)")).facts.bracket_is_almost);
    assert_eq!(e.facts.casimirs, ["C2"]);
    let cubes = text.replace("dot(omega, omega)", "re_0_1*re_1_0*re_1_1");
    let model = spec::parse("truncated", &cubes).unwrap();
    assert!(derive(&reduce(&model, &Formulation::of(&model)).unwrap()).is_err());
}

/// `ad` and `poisson` agree, and a semidirect product by the functions moves them by the bracket.
#[test]
fn a_potential_is_carried_by_the_bracket() {
    for space in ["advected a in fluid as a_* by ad;", "advected a in fluid as a_* by functions;"] {
        let text = format!(
            "model carried {{
                algebra fluid = zeitlin(3);
                momentum w in fluid as w_*;
                action right;
                {space}
                let D = -laplacian(fluid);
                hamiltonian = dot(w, D^-1*w) + dot(a, D*a);
                casimir cross_helicity = dot(w, a);
            }}"
        );
        assert_eq!(equations("carried", &text).facts.casimirs, ["cross_helicity"]);
    }
}

/// A function on the circle by its coefficients, at a place: its value and its slope.
fn on_circle(f: &[f64], x: f64) -> (f64, f64) {
    let (mut value, mut slope) = (f[0], 0.0);
    for (k, part) in f[1..].chunks_exact(2).enumerate() {
        let k = (k + 1) as f64;
        let (sin, cos) = (k * x).sin_cos();
        value += part[0] * cos + part[1] * sin;
        slope += k * (part[1] * cos - part[0] * sin);
    }
    (value, slope)
}

/// Coefficients of a function on the circle, by a sum over places that is exact for waves up to half of their number.
fn coefficients(n: usize, f: impl Fn(f64) -> f64) -> Vec<f64> {
    const PLACES: usize = 64;
    let mut list = vec![0.0; n];
    for j in 0..PLACES {
        let x = std::f64::consts::TAU * j as f64 / PLACES as f64;
        let value = f(x) / PLACES as f64;
        list[0] += value;
        for (k, part) in list[1..].chunks_exact_mut(2).enumerate() {
            let (sin, cos) = ((k + 1) as f64 * x).sin_cos();
            part[0] += 2.0 * value * cos;
            part[1] += 2.0 * value * sin;
        }
    }
    list
}

fn rates(name: &str, text: &str, state: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let model = spec::parse(name, text).unwrap_or_else(|e| panic!("{e}"));
    let built = scene::build(&model, scene::DEFAULT).unwrap_or_else(|e| panic!("{e}"));
    let params: Vec<f64> = built.params().iter().map(|p| hamel_expr::rational_to_f64(&p.default)).collect();
    let mut rates = vec![0.0; state.len()];
    built.prepare(&params).unwrap().rhs(0.0, state, &mut rates);
    (rates, params)
}

/// Places where nothing vanishes, the same in every run.
fn scattered(n: usize, seed: f64) -> Vec<f64> {
    (0..n).map(|k| (seed + 2.3 * k as f64).sin() * 0.3).collect()
}

fn assert_near(found: &[f64], expected: &[f64], what: &str) {
    let size = expected.iter().fold(0.0_f64, |max, x| max.max(x.abs()));
    assert!(size > 0.1, "{what}: {expected:?}");
    for (a, b) in found.iter().zip(expected) {
        // Sums over 64 places lose a few units of the largest term.
        assert!((a - b).abs() < 1e-13 * size, "{what}: {a} {b}");
    }
}

/// `m_t + u m_x + 2 u_x m = 0` on a grid, without structure constants.
#[test]
fn camassa_holm_is_the_partial_differential_equation_on_a_grid() {
    for seed in [0.1, 1.7] {
        let u = scattered(13, seed);
        let (rates, params) = rates("camassa_holm", &models::text("camassa_holm"), &u);
        let weight = |k: usize| 1.0 + params[0].powi(2) * (k.div_ceil(2) as f64).powi(2);
        let m: Vec<f64> = u.iter().enumerate().map(|(k, u)| weight(k) * u).collect();
        let expected = coefficients(13, |x| {
            let ((u, slope), (m, m_slope)) = (on_circle(&u, x), on_circle(&m, x));
            -u * m_slope - 2.0 * slope * m
        });
        let found: Vec<f64> = rates.iter().enumerate().map(|(k, rate)| weight(k) * rate).collect();
        assert_near(&found, &expected, "momentum");
    }
}

const GAS: &str = include_str!("../../docs/book/barotropic_flow.hamel");

/// `rho_t + (rho u)_x = 0` and the balance of momentum of a gas with the pressure `k rho^2/2`, on a grid: the momentum
/// is `m = rho u` as far as it is within the truncation, and its rate `-u m_x - 2 u_x m + rho (u^2/2 - k rho)_x`.
#[test]
fn barotropic_flow_is_the_partial_differential_equation_on_a_grid() {
    for seed in [0.4, 2.9] {
        let (u, mut rho) = (scattered(7, seed), scattered(7, seed + 0.5));
        rho[0] = 1.5;
        let (rates, params) = rates("gas", GAS, &[u.clone(), rho.clone()].concat());
        let (u_rate, rho_rate) = rates.split_at(7);
        let value = |f: &[f64], x: f64| on_circle(f, x).0;
        let expected = coefficients(7, |x| {
            let ((u, du), (rho, drho)) = (on_circle(&u, x), on_circle(&rho, x));
            -drho * u - rho * du
        });
        assert_near(rho_rate, &expected, "mass");
        let m = coefficients(7, |x| value(&rho, x) * value(&u, x));
        let head = coefficients(7, |x| value(&u, x).powi(2) / 2.0 - params[0] * value(&rho, x));
        let expected = coefficients(7, |x| {
            let ((u, du), (m, dm)) = (on_circle(&u, x), on_circle(&m, x));
            -u * dm - 2.0 * du * m + value(&rho, x) * on_circle(&head, x).1
        });
        let found =
            coefficients(7, |x| value(rho_rate, x) * value(&u, x) + value(&rho, x) * value(u_rate, x));
        assert_near(&found, &expected, "momentum");
    }
}
