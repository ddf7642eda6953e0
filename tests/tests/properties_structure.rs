//! Sizes of the derived equations, bounded from above: a rewrite that bloats a model fails here.

use hamel_expr::ExprId;
use hamel_mechanics::mechanics::Equations;
use hamel_mechanics::reduction::KinematicConstraint;
use hamel_tests::models::{self, equations};

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
const BOUNDS: [(&str, usize, usize); 42] = [
    ("appell_machine", 7, 40),
    ("ball_on_rotating_table", 13, 59),
    ("body_in_fluid", 97, 570),
    ("body_in_fluid_by_translations", 97, 570),
    ("camassa_holm", 60, 500),
    ("chaplygin_ball", 76, 295),
    ("chaplygin_gyro", 148, 745),
    ("chaplygin_sleigh", 9, 42),
    ("charged_particle", 6, 40),
    ("double_spherical_pendulum", 55, 255),
    ("euler_disk", 59, 294),
    ("euler_disk_advected", 48, 201),
    ("extended_pose", 211, 834),
    ("free_rigid_body", 7, 32),
    ("guiding_centre", 4, 36),
    ("heavy_top", 10, 68),
    ("heisenberg_body", 17, 60),
    ("kirchhoff_body", 58, 256),
    ("lotka_volterra", 3, 20),
    ("mobile_robot", 16, 65),
    ("point_vortices", 9, 123),
    ("purcell_swimmer", 35, 175),
    ("rolling_ball", 4, 26),
    ("rolling_disk", 2, 15),
    ("second_grade_fluid", 85, 750),
    ("second_grade_fluid_3c", 56, 406),
    ("servo_ball", 9, 54),
    ("skew_sleigh", 14, 69),
    ("snake", 39, 336),
    ("snakeboard", 19, 71),
    ("suslov", 10, 46),
    ("tethered_body", 17, 88),
    ("triangular_body", 60, 400),
    ("two_arm_satellite", 45, 245),
    ("two_arm_satellite_routh", 61, 299),
    ("veselova", 20, 100),
    ("wong_particle", 14, 100),
    ("zeitlin_euler_3", 9, 57),
    ("zeitlin_euler_5", 26, 342),
    ("zeitlin_euler_7", 53, 1224),
    ("zeitlin_mhd_3", 18, 198),
    ("zeitlin_mhd_5", 53, 1821),
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
    assert_eq!(models::names(), BOUNDS.map(|(name, ..)| name));
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
                e.system.params.iter().any(|p| p.name == e.display(pivot.expr, hamel_expr::Style::Plain))
            );
        }
    }
}

/// Models whose multipliers are kept: no single choice of independent velocities is good everywhere, or the constraint
/// is not linear in the velocities.
const WITH_MULTIPLIERS: [&str; 3] = ["appell_machine", "servo_ball", "veselova"];

#[test]
fn only_constraints_that_cannot_be_solved_keep_their_multipliers() {
    let kept =
        |name: &String| matches!(equations(name).system.constraint, KinematicConstraint::Multipliers { .. });
    let names: Vec<String> = models::names().into_iter().filter(kept).collect();
    assert_eq!(names, WITH_MULTIPLIERS);
}

/// Models in which something does work.
const BESIDE_THE_THEORY: [&str; 5] =
    ["ball_on_rotating_table", "second_grade_fluid", "second_grade_fluid_3c", "servo_ball", "skew_sleigh"];

/// Models whose state can leave the constraint, and whose energy is conserved on it.
const ON_CONSTRAINT: [&str; 2] = ["appell_machine", "veselova"];

#[test]
fn energy_is_conserved_where_the_theory_says_so() {
    // The rate is zero iff the constraint is linear and homogeneous, displacements are those that it allows, and there
    // is neither force nor explicit time. A moving table, viscosity, a reaction beside the constraint and a servo do
    // work.
    for name in models::names() {
        let e = equations(&name);
        if !e.has_energy() {
            assert_eq!(name, "purcell_swimmer", "a motion that follows from no Lagrangian");
            continue;
        }
        let conserved =
            !BESIDE_THE_THEORY.contains(&name.as_str()) && !ON_CONSTRAINT.contains(&name.as_str());
        assert_eq!(e.facts.energy_is_conserved, conserved, "{name}");
        assert_eq!(e.energy_rate == e.system.graph.zero(), conserved, "{name}");
        if !ON_CONSTRAINT.contains(&name.as_str()) {
            assert!(!e.facts.energy_is_conserved_on_constraint, "{name}");
        }
        assert_eq!(e.facts.casimirs.len(), e.system.casimirs.len(), "{name}");
    }
}

#[test]
fn off_the_constraint_energy_changes_with_the_residual() {
    // A constraint phi that is homogeneous of degree k in the velocities has dphi/dy . y = k phi, so E' = k lambda phi.
    for (name, degree) in [("veselova", 1), ("appell_machine", 2)] {
        let mut e = equations(name);
        let single = |group: &str| {
            let output = e.outputs.iter().find(|o| o.name == group).expect("the model has multipliers");
            output.components[0].1
        };
        let (lambda, residual) = (single("multipliers"), single("constraint"));
        let (rate, g) = (e.energy_rate, &mut e.system.graph);
        let degree = g.int(degree);
        let expected = g.product(&[degree, lambda, residual]);
        assert!(g.is_equal(rate, expected), "{name}");
        assert!(!g.is_zero(rate), "{name}");
    }
    for name in ["veselova", "appell_machine"] {
        assert!(equations(name).facts.energy_is_conserved_on_constraint, "{name}");
    }
}

#[test]
fn the_constraint_of_the_suslov_problem_leaves_two_velocities() {
    let e = equations("suslov");
    assert_eq!(e.state.len(), 2);
    assert_eq!(e.linear_system().unwrap().unknowns, ["Omega1", "Omega2"]);
    let parts = defined(&e);
    assert!(!parts.contains(&"Omega3"), "a velocity that is zero needs no name");
}
