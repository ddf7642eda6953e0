//! Sizes of the derived equations, bounded from above: a rewrite that bloats a model fails here.

use std::path::Path;

use hamel_codegen::expr::ExprId;
use hamel_codegen::mechanics::{Equations, derive};
use hamel_codegen::reduction::{KinematicConstraint, reduce};
use hamel_codegen::spec;

fn equations(name: &str) -> Equations {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../models/specs").join(format!("{name}.hamel"));
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let model = spec::parse(name, &text).unwrap_or_else(|e| panic!("{e}"));
    let system = reduce(&model, &[]).unwrap_or_else(|e| panic!("{e}"));
    derive(&system).unwrap_or_else(|e| panic!("{name}: {e}"))
}

/// Definitions, and nodes that definitions, state equations, energy and its rate need together.
fn size(e: &Equations) -> (usize, usize) {
    let definitions: Vec<ExprId> = e.sections.iter().flat_map(|s| &s.definitions).map(|d| d.expr).collect();
    let mut roots = definitions.clone();
    roots.extend(e.state.iter().map(|s| s.derivative));
    roots.extend([e.energy, e.energy_rate]);
    (definitions.len(), e.system.graph.reachable(&roots).len())
}

fn defined(e: &Equations) -> Vec<&str> {
    e.sections.iter().flat_map(|s| &s.definitions).map(|d| e.system.graph.name(d.symbol)).collect()
}

/// Name, definitions, nodes: measured, plus about a tenth.
const BOUNDS: [(&str, usize, usize); 9] = [
    ("chaplygin_ball", 46, 205),
    ("chaplygin_sleigh", 9, 42),
    ("euler_disk_advected", 39, 175),
    ("extended_pose", 210, 835),
    ("free_rigid_body", 7, 32),
    ("heavy_top", 10, 67),
    ("kirchhoff_body", 57, 255),
    ("suslov", 10, 45),
    ("veselova", 20, 99),
];

#[test]
fn derived_equations_do_not_grow() {
    let mut grown = Vec::new();
    for (name, most_definitions, most_nodes) in BOUNDS {
        let (definitions, nodes) = size(&equations(name));
        assert!(definitions > 0, "{name} defines nothing");
        if definitions > most_definitions || nodes > most_nodes {
            grown.push(format!("(\"{name}\", {definitions}, {nodes})"));
        }
    }
    assert!(grown.is_empty(), "larger than bounded: {}", grown.join(", "));
}

#[test]
fn every_model_file_is_bounded() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../models/specs");
    let entries = std::fs::read_dir(&folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    for entry in entries {
        let path = entry.expect("the folder can be read").path();
        let stem = path.file_stem().and_then(|s| s.to_str()).unwrap_or_default();
        let is_model = path.extension().is_some_and(|e| e == "hamel");
        assert!(!is_model || BOUNDS.iter().any(|(name, ..)| *name == stem), "{stem} has no bound");
    }
}

#[test]
fn a_diagonal_mass_matrix_is_neither_named_nor_factored() {
    for name in ["heavy_top", "free_rigid_body"] {
        let e = equations(name);
        for defined in defined(&e) {
            assert!(!defined.starts_with("A_"), "{name} defines {defined}");
        }
        assert!(e.facts.mass_matrix_is_constant && e.facts.mass_matrix_is_symmetric);
        assert_eq!(e.pivots.len(), 3);
        for (k, pivot) in e.pivots.iter().enumerate() {
            assert_eq!(pivot.name, format!("inertia along Omega{}", k + 1));
            assert!(
                e.system
                    .params
                    .iter()
                    .any(|p| p.name == e.display(pivot.expr, hamel_codegen::expr::Style::Plain))
            );
        }
    }
}

#[test]
fn the_energy_of_every_model_is_conserved() {
    // No model has a force, explicit time or an affine constraint.
    for (name, ..) in BOUNDS {
        let e = equations(name);
        match &e.system.constraint {
            KinematicConstraint::Solved(_) => {
                assert!(e.facts.energy_is_conserved, "{name}");
                assert_eq!(e.energy_rate, e.system.graph.zero(), "{name}");
            }
            KinematicConstraint::Multipliers { .. } => {
                assert!(e.facts.energy_is_conserved_on_constraint, "{name}");
            }
        }
        assert_eq!(e.facts.casimirs.len(), e.system.casimirs.len(), "{name}");
    }
}

#[test]
fn only_a_constraint_that_can_turn_anywhere_keeps_its_multipliers() {
    for (name, ..) in BOUNDS {
        let kept = matches!(equations(name).system.constraint, KinematicConstraint::Multipliers { .. });
        assert_eq!(kept, name == "veselova", "{name}");
    }
}

#[test]
fn the_constraint_of_the_suslov_problem_leaves_two_velocities() {
    let e = equations("suslov");
    assert_eq!(e.state.len(), 2);
    assert_eq!(e.unknowns, ["Omega1", "Omega2"]);
    let parts = defined(&e);
    assert!(!parts.contains(&"Omega3"), "a velocity that is zero needs no name");
}
