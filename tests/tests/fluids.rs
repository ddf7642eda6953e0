//! Truncated fluids: Casimirs by matrices, balances of energy, misprints of the source, almost algebras.

use hamel_codegen::expr::{ExprId, SymbolId};
use hamel_codegen::mechanics::{Equations, derive};
use hamel_codegen::program::Role;
use hamel_codegen::reduction::{Formulation, reduce};
use hamel_codegen::scene;
use hamel_codegen::spec;
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
    let values = hamel_codegen::expr::inlined(g, &definitions);
    g.subs(e.energy_rate, &values).expect("nothing is divided by zero")
}

#[test]
fn casimirs_are_traces_of_powers_of_matrices() {
    let mut compared = 0;
    for name in ["zeitlin_euler_3", "zeitlin_euler_5", "zeitlin_euler_7", "zeitlin_mhd_3", "zeitlin_mhd_5"] {
        let scene = models::build(name, scene::DEFAULT);
        let outputs: Vec<(String, Vec<String>)> = scene
            .outputs()
            .iter()
            .map(|o| (o.name.clone(), o.components.iter().map(|(n, _)| n.clone()).collect()))
            .collect();
        for point in &reference::read(name).points {
            let state = reference::in_order(&point.state, &scene.state_names());
            for (output, components) in &outputs {
                let known = |n: &String| n.starts_with(['C', 'D']) && point.extra.contains_key(n);
                if !components.iter().any(known) {
                    continue;
                }
                let values = tracked(&scene, &Role::Output(output.clone()), &[], &state);
                for (component, value) in components.iter().zip(values) {
                    let off = units_off(value, &point.extra[component]);
                    assert!(off <= 64.0, "{name}: {component} is {off} units off");
                    compared += 1;
                }
            }
        }
    }
    assert!(compared > 12 * 10, "{compared}");
}

#[test]
fn viscosity_alone_takes_energy_from_a_plane_fluid_of_second_grade() {
    let name = "second_grade_fluid";
    let mut e = equations(name, &models::text(name));
    assert!(e.system.algebroid.is_almost());
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
    assert!(e.facts.energy_is_conserved);
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
