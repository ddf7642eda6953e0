//! Special systems cost what their own equations need: scenes against counts by hand.
//!
//! A general system with parameters fixed to zero, or with coordinates left out, has to come down to the right-hand
//! side that one would write for the special system alone. The counts here are those of equations written by hand; more
//! is a missed simplification, and fewer means that the hand can learn something: the entry is then corrected.

use hamel_program::program::Role;
use hamel_tests::models::build;

/// Additions and subtractions, multiplications, divisions, roots and functions of a right-hand side. A fused pair
/// counts as its two operations, sine and cosine of one angle as one function, a change of sign as nothing: it is part
/// of a subtraction.
type Cost = [usize; 4];

fn cost(model: &str, scene: &str) -> Cost {
    let program = build(model, scene).into_program();
    let k = program.function_idx(&Role::Rate).unwrap_or_else(|| panic!("{model} {scene} has no rhs"));
    let c = program.functions[k].counts();
    assert_eq!(c.neg, 0, "{model} {scene} changes signs");
    [c.add, c.mul, c.div, c.sqrt + c.transcendental]
}

/// The cost of the general system exceeds that of the special one, which is exactly `by_hand`.
fn falls(model: &str, general: &str, special: &str, by_hand: Cost) {
    let (before, after) = (cost(model, general), cost(model, special));
    assert_eq!(after, by_hand, "{model} {special}: additions, multiplications, divisions, functions");
    assert!(
        before.iter().sum::<usize>() > after.iter().sum(),
        "{model}: {before:?} {general}, {after:?} {special}"
    );
}

/// A cross product.
const CROSS: [usize; 2] = [3, 6];
/// A symmetric or a general 3x3 matrix by a vector; as many as forward and back substitution through the factors
/// `L D L^T`.
const MATRIX: [usize; 2] = [6, 9];

fn sum(parts: &[(usize, [usize; 2])]) -> Cost {
    let [add, mul] = [0, 1].map(|k| parts.iter().map(|(n, part)| n * part[k]).sum());
    [add, mul, 0, 0]
}

/// With `s`, `c` sine and cosine of theta (one function), `p = s phi'`, `q = c phi'` and `k0, ..` from parameters
/// alone:
///
/// ```text
/// theta'' = k0 p (psi' + k1 q) + k2 c                2 additions, 4 multiplications, and 2 for p and q
/// phi''   = k3 (theta'/s) (psi' + k4 q)              1 addition, 3 multiplications, 1 division
/// psi''   = k5 theta' p - c phi''                    1 addition, 3 multiplications
/// ```
#[test]
fn a_flat_euler_disk_costs_four_additions_and_twelve_multiplications() {
    falls("euler_disk", "minimal", "flat", [4, 12, 1, 1]);
    assert_eq!(build("euler_disk", "flat").state().len(), 4, "phi is left out");
}

/// `Omega1' = (I2 - I3)/I1 Omega2 Omega3 + k1 Gamma2` and its neighbour take 1 addition and 3 multiplications each,
/// `Omega3' = (I1 - I2)/I3 Omega1 Omega2` takes 2, the advected vector a cross product.
#[test]
fn lagranges_top_with_three_moments_of_inertia_has_no_gravity_about_its_axis() {
    falls("heavy_top", "default", "lagrange", sum(&[(2, [1, 3]), (1, [0, 2]), (1, CROSS)]));
}

/// With `a = (I1 - I3)/I1 Omega3` (1 multiplication): `Omega1' = a Omega2 + k Gamma2`,
/// `Omega2' = -a Omega1 - k Gamma1`, `Omega3' = 0`, and a cross product.
#[test]
fn lagranges_top_keeps_its_spin() {
    falls("heavy_top", "lagrange", "symmetric", sum(&[(1, [0, 1]), (2, [1, 2]), (1, CROSS)]));
}

/// Without coupling, six equations of two products each with a coefficient each,
/// `Omega1' = (J2 - J3)/J1 Omega2 Omega3 + (M2 - M3)/J1 V2 V3`, `V1' = M2/M1 V2 Omega3 - M3/M1 V3 Omega2`.
#[test]
fn an_uncoupled_kirchhoff_body_needs_no_linear_system() {
    falls("kirchhoff_body", "default", "uncoupled", sum(&[(6, [1, 4])]));
}

/// Momenta and accelerations are three blocks each; the forces are `Pi x Omega + P x V + Q x U` (two sums of
/// three components), `P x Omega` and `Q x Omega`.
#[test]
fn a_block_diagonal_metric_keeps_its_blocks() {
    let by_hand = sum(&[(6, MATRIX), (5, CROSS), (2, [3, 0])]);
    falls("extended_pose", "default", "block_diagonal", by_hand);
}
