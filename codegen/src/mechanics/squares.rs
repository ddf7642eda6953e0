//! Kinetic energy that is written as squares of velocities of points.
//!
//! Deliberately does not know: constraints, which way of writing the forces is shorter.

use std::collections::BTreeSet;

use num_traits::{One, Signed};

use crate::algebra::Algebroid;
use crate::expr::{ExprId, Graph, Node, Rational, SymbolId};
use crate::reduction::ReducedSystem;

/// A term `weight/2 |v|^2` of the Lagrangian with `v = v_beta y^beta` in a frame that turns with the angular velocity
/// `omega = K_beta y^beta`, i.e. one with vanishing torsion, or with `v = v_beta y^beta + v_0` and constant `v_0` in one that does
/// not turn:
///
/// ```text
/// dv_alpha/dx . rho_beta - dv_beta/dx . rho_alpha + C^gamma_{alpha beta} v_gamma = v_alpha x K_beta - v_beta x K_alpha
/// ```
///
/// Then the term's part of `E_alpha` is `weight v_alpha . (vdot + omega x v)`: mass times acceleration, along `v_alpha`.
///
/// # Source
/// Kane and Levinson 1985, Dynamics, section 4.11 (generalised inertia forces); the condition is Cartan's first structure
/// equation.
#[derive(Clone, Debug)]
pub(super) struct Square {
    /// Depends on parameters alone.
    pub(super) weight: ExprId,
    /// `v`, in the raw velocities.
    pub(super) velocity: Vec<ExprId>,
    /// `v_alpha`, by the velocity and the component.
    pub(super) slopes: Vec<Vec<ExprId>>,
    /// `K_beta`, by the velocity.
    turning: Vec<Turn>,
}

/// Most frames that are tried for one square.
const MAX_TRIALS: usize = 500;
/// Components of one weight that are tried together.
const MAX_COMPONENTS: usize = 8;
/// Vectors with more components are no velocities of points: their frame does not turn.
const MAX_DIMENSION: usize = 3;

/// A rotation about an axis of the frame with rate one, or none: in the plane of the components `from` and `to`,
/// `v_from` becomes part of the rate of `v_to`, and the other way round with the opposite sign.
type Turn = Option<(usize, usize)>;

impl Square {
    /// `omega x v` for the velocities `y` and the components `v`.
    pub(super) fn turned(&self, g: &mut Graph, y: &[ExprId], v: &[ExprId]) -> Vec<ExprId> {
        let mut terms = vec![Vec::new(); v.len()];
        for (turn, y) in self.turning.iter().zip(y) {
            if let Some((from, to)) = *turn {
                terms[to].push(g.mul(*y, v[from]));
                let back = g.mul(*y, v[to]);
                terms[from].push(g.neg(back));
            }
        }
        terms.iter().map(|list| g.sum(list)).collect()
    }
}

/// A term of the Lagrangian that is the square of one component.
#[derive(Clone, Debug)]
struct Component {
    term: (ExprId, Rational),
    weight: ExprId,
    velocity: ExprId,
}

/// Takes the squares of velocities out of the Lagrangian: these, and the rest.
pub(super) fn take_squares(g: &mut Graph, system: &ReducedSystem) -> (Vec<Square>, ExprId) {
    let velocities: BTreeSet<SymbolId> = system.velocities.iter().copied().collect();
    let varying: BTreeSet<SymbolId> =
        velocities.iter().chain(system.algebroid.base()).chain([&system.time]).copied().collect();
    let mut squares = Vec::new();
    let mut rest = Vec::new();
    // The sum of a vector with a number for its mass is part of the Lagrangian's own sum.
    let mut components: Vec<Component> = Vec::new();
    for (term, q) in g.summands(system.lagrangian) {
        let found = squared(g, term, &q, &varying);
        let found = found.filter(|(_, v)| v.iter().any(|v| g.depends_on(*v, &velocities)));
        match found {
            Some((weight, velocity)) => match velocity.as_slice() {
                [velocity] => components.push(Component { term: (term, q), weight, velocity: *velocity }),
                _ => match square(g, system, weight, velocity) {
                    Some(square) => squares.push(square),
                    None => rest.push((term, q)),
                },
            },
            None => rest.push((term, q)),
        }
    }
    while let Some(first) = components.first().cloned() {
        let taken = match vector(g, system, &components) {
            Some((square, taken)) => {
                squares.push(square);
                taken
            }
            None => {
                rest.push(first.term);
                vec![0]
            }
        };
        let mut position = 0;
        components.retain(|_| {
            position += 1;
            !taken.contains(&(position - 1))
        });
    }
    let rest = g.linear_combination(&rest);
    (squares, rest)
}

/// The square that the first component is part of, with the positions of its components: of three, of two, or alone.
fn vector(g: &mut Graph, system: &ReducedSystem, components: &[Component]) -> Option<(Square, Vec<usize>)> {
    let first = components.first()?;
    // In the unit of the first weight, where that is a rational one.
    let mut scaled = vec![(0, first.velocity)];
    for (k, other) in components.iter().enumerate().skip(1) {
        let Ok(ratio) = g.div(other.weight, first.weight) else { continue };
        let ratio = g.as_rational(ratio).cloned();
        if let Some(root) = ratio.and_then(|ratio| rational_root(g, &ratio)) {
            scaled.push((k, g.mul(root, other.velocity)));
        }
    }
    scaled.truncate(MAX_COMPONENTS);
    let n = scaled.len();
    let triples = (1..n).flat_map(|a| (a + 1..n).map(move |b| vec![0, a, b]));
    let choices: Vec<Vec<usize>> = triples.chain((1..n).map(|a| vec![0, a])).chain([vec![0]]).collect();
    choices.into_iter().find_map(|choice| {
        let velocity = choice.iter().map(|k| scaled[*k].1).collect();
        let square = square(g, system, first.weight, velocity)?;
        Some((square, choice.iter().map(|k| scaled[*k].0).collect()))
    })
}

/// `q term = weight/2 sum_i v_i^2`: the weight, and the `v_i`.
fn squared(
    g: &mut Graph,
    term: ExprId,
    q: &Rational,
    varying: &BTreeSet<SymbolId>,
) -> Option<(ExprId, Vec<ExprId>)> {
    let Node::Product { coefficient, factors } = g.node(term).clone() else { return None };
    let (own, fixed): (Vec<_>, Vec<_>) =
        factors.iter().cloned().partition(|(b, _)| g.depends_on(*b, varying));
    let two = Rational::from_integer(2.into());
    let twice = g.rational(coefficient * q * &two);
    let weight = g.power_product(&fixed).ok()?;
    let weight = g.mul(weight, twice);
    if let Some(velocity) = root(g, &own) {
        return Some((weight, vec![velocity]));
    }
    let [(base, exponent)] = own.as_slice() else { return None };
    let Node::Sum { constant, terms } = g.node(*base).clone() else { return None };
    if !exponent.is_one() || constant != Rational::from_integer(0.into()) {
        return None;
    }
    let mut components = Vec::with_capacity(terms.len());
    for (term, q) in terms.iter() {
        let Node::Product { coefficient, factors } = g.node(*term).clone() else { return None };
        let coefficient = rational_root(g, &(coefficient * q))?;
        let component = root(g, &factors)?;
        components.push(g.mul(coefficient, component));
    }
    Some((weight, components))
}

/// The square root of a product of even powers, up to signs.
fn root(g: &mut Graph, factors: &[(ExprId, Rational)]) -> Option<ExprId> {
    let two = Rational::from_integer(2.into());
    let halves: Vec<_> = factors.iter().map(|(base, q)| (*base, q / &two)).collect();
    let are_even = halves.iter().all(|(_, q)| q.is_integer() && q.is_positive());
    if are_even { g.power_product(&halves).ok() } else { None }
}

/// The root of a number that is a square of a rational one: others have no fingerprints where they are no squares in the field.
fn rational_root(g: &mut Graph, q: &Rational) -> Option<ExprId> {
    if !q.is_positive() {
        return None;
    }
    let q = g.rational(q.clone());
    let root = g.sqrt(q);
    g.as_rational(root)?;
    Some(root)
}

/// The square with the frame of its components, if they have one.
fn square(g: &mut Graph, system: &ReducedSystem, weight: ExprId, velocity: Vec<ExprId>) -> Option<Square> {
    // Symbols alone gain nothing.
    if velocity.iter().all(|v| matches!(g.node(*v), Node::Symbol(_))) {
        return None;
    }
    let algebroid = &system.algebroid;
    let m = algebroid.rank();
    let mut slopes = vec![Vec::with_capacity(velocity.len()); m];
    let mut offsets = Vec::with_capacity(velocity.len());
    for v in &velocity {
        let (parts, offset) = g.affine_parts(*v, &system.velocities)?;
        slopes.iter_mut().zip(parts).for_each(|(row, part)| row.push(part));
        offsets.push(offset);
    }
    // Nothing of it changes but along the motion.
    for part in slopes.iter().flatten().chain(&offsets) {
        let explicit = g.diff(*part, system.time);
        if !g.is_zero(explicit) {
            return None;
        }
    }
    for offset in &offsets {
        for alpha in 0..m {
            let along = algebroid.derivative_along(g, alpha, *offset);
            if !g.is_zero(along) {
                return None;
            }
        }
    }
    let torsion = torsion(g, algebroid, &slopes);
    let turning = turning(g, &slopes, &torsion)?;
    if turning.iter().any(Option::is_some) && offsets.iter().any(|e| *e != g.zero()) {
        return None;
    }
    Some(Square { weight, velocity, slopes, turning })
}

/// `rho_beta(v_alpha) - rho_alpha(v_beta) + C^gamma_{alpha beta} v_gamma`, by `alpha`, `beta` and the component.
fn torsion(g: &mut Graph, algebroid: &Algebroid, slopes: &[Vec<ExprId>]) -> Vec<Vec<Vec<ExprId>>> {
    let m = algebroid.rank();
    let n = slopes.first().map_or(0, Vec::len);
    let mut rows = Vec::with_capacity(m);
    for alpha in 0..m {
        let mut row = Vec::with_capacity(m);
        for beta in 0..m {
            let bracket = algebroid.bracket(g, alpha, beta);
            let mut entry = Vec::with_capacity(n);
            for i in 0..n {
                let forward = algebroid.derivative_along(g, beta, slopes[alpha][i]);
                let backward = algebroid.derivative_along(g, alpha, slopes[beta][i]);
                let mut terms = vec![forward, g.neg(backward)];
                for (gamma, c) in &bracket {
                    terms.push(g.mul(*c, slopes[*gamma][i]));
                }
                let sum = g.sum(&terms);
                entry.push(g.cancel_zero(sum));
            }
            row.push(entry);
        }
        rows.push(row);
    }
    rows
}

/// The `K_beta`, if there are any: tried one velocity after the other, each against those before it.
fn turning(g: &mut Graph, slopes: &[Vec<ExprId>], torsion: &[Vec<Vec<ExprId>>]) -> Option<Vec<Turn>> {
    let n = slopes.first().map_or(0, Vec::len);
    let planes = (0..n).flat_map(|i| (0..n).filter(move |j| *j != i).map(move |j| Some((i, j))));
    let planes = planes.filter(|_| n <= MAX_DIMENSION);
    let candidates: Vec<Turn> = [None].into_iter().chain(planes).collect();
    // Position of the candidate of each velocity so far.
    let mut chosen = vec![0];
    for _ in 0..MAX_TRIALS {
        let beta = chosen.len() - 1;
        let turn = candidates[chosen[beta]];
        let fits = (0..beta).all(|alpha| {
            let other = candidates[chosen[alpha]];
            (0..n).all(|i| {
                // v_alpha x K_beta - v_beta x K_alpha = K_alpha x v_beta - K_beta x v_alpha
                let forward = turned_component(g, other, &slopes[beta], i);
                let backward = turned_component(g, turn, &slopes[alpha], i);
                let expected = g.sub(forward, backward);
                g.is_equal(torsion[alpha][beta][i], expected)
            })
        });
        if fits && chosen.len() == slopes.len() {
            return Some(chosen.into_iter().map(|k| candidates[k]).collect());
        }
        if fits {
            chosen.push(0);
            continue;
        }
        while let Some(last) = chosen.last_mut() {
            *last += 1;
            if *last < candidates.len() {
                break;
            }
            chosen.pop();
        }
        if chosen.is_empty() {
            return None;
        }
    }
    None
}

/// `(K x v)_i`.
fn turned_component(g: &mut Graph, turn: Turn, v: &[ExprId], i: usize) -> ExprId {
    match turn {
        Some((from, to)) if i == to => v[from],
        Some((from, to)) if i == from => g.neg(v[to]),
        _ => g.zero(),
    }
}
