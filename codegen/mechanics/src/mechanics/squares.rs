//! Kinetic energy that is written as squares of velocities of points.
//!
//! Deliberately does not know: constraints, which way of writing the forces is shorter.

use std::collections::BTreeSet;
use std::rc::Rc;

use num_traits::{One, Signed};

use crate::reduction::ReducedSystem;
use hamel_expr::{ExprId, Graph, Node, Rational, SymbolId};

use super::components::{Component, Components};
use super::limits::{MAX_RANK, MAX_SINGLES, MAX_TRIALS};
use super::sizes::scale;

/// A term `weight/2 |v|^2` of the Lagrangian with `v = v_beta y^beta` in a frame that turns with the angular velocity
/// `omega = K_beta y^beta`, i.e. one with vanishing torsion, or with `v = v_beta y^beta + v_0` and constant `v_0` in
/// one that does not turn:
///
/// ```text
/// dv_alpha/dx . rho_beta - dv_beta/dx . rho_alpha + C^gamma_{alpha beta} v_gamma = v_alpha x K_beta - v_beta x K_alpha
/// ```
///
/// Then the term's part of `E_alpha` is `weight v_alpha . (vdot + omega x v)`: mass times acceleration, along
/// `v_alpha`.
///
/// # Source
/// Or a term `1/2 J_ij omega_i omega_j` with constant `J` and the components of an angular velocity in its own frame,
///
/// ```text
/// domega_alpha/dx . rho_beta - domega_beta/dx . rho_alpha + C^gamma_{alpha beta} omega_gamma = omega_alpha x omega_beta
/// ```
///
/// whose part of `E_alpha` is `omega_alpha . (J omegadot + omega x J omega)`: the equation of Euler, along
/// `omega_alpha`.
///
/// # Source
/// Kane and Levinson 1985, Dynamics, section 4.11 (generalised inertia forces); the conditions are Cartan's first
/// structure equation, and that of Maurer and Cartan.
#[derive(Clone, Debug)]
pub(super) struct Square {
    /// Masses and moments of inertia of pairs of components, first of each with itself; they depend on parameters
    /// alone.
    pub(super) masses: Vec<(usize, usize, ExprId)>,
    /// The components of `v`.
    pub(super) components: Vec<Rc<Component>>,
    turning: Turning,
}

/// The frame of a square.
#[derive(Clone, Debug)]
enum Turning {
    /// It turns with `K_beta`, by the velocity.
    Axes(Vec<Turn>),
    /// It turns with the angular velocity of those components.
    With([ExprId; 3]),
    /// The square is that of the angular velocity itself.
    Own,
}

/// Components of the velocity of a point.
const MAX_DIMENSION: usize = 3;

/// A rotation about an axis of the frame with rate one, or none: in the plane of the components `from` and `to`,
/// `v_from` becomes part of the rate of `v_to`, and the other way round with the opposite sign.
type Turn = Option<(usize, usize)>;

impl Square {
    /// The angular velocity of the frame, where the square says so by its components.
    pub(super) fn frame(&self) -> Option<[ExprId; 3]> {
        match self.turning {
            Turning::With(omega) => Some(omega),
            Turning::Axes(_) | Turning::Own => None,
        }
    }

    /// Whether what is squared is an angular velocity.
    pub(super) fn is_spin(&self) -> bool {
        matches!(self.turning, Turning::Own)
    }

    /// `J v`.
    pub(super) fn momentum(&self, g: &mut Graph, v: &[ExprId]) -> Vec<ExprId> {
        let mut terms = vec![Vec::new(); v.len()];
        for (i, j, weight) in &self.masses {
            terms[*i].push(g.mul(*weight, v[*j]));
        }
        terms.iter().map(|list| g.sum(list)).collect()
    }

    /// `omega x v` for the velocities `y` and the components `v`, with the angular velocity of the frame where the
    /// square has one by its components; zero for an angular velocity.
    pub(super) fn turned(
        &self,
        g: &mut Graph,
        y: &[ExprId],
        v: &[ExprId],
        frame: Option<[ExprId; 3]>,
    ) -> Vec<ExprId> {
        let turns = match (&self.turning, frame, v) {
            (Turning::With(_), Some(omega), [v1, v2, v3]) => {
                return cross(g, omega, [*v1, *v2, *v3]).to_vec();
            }
            (Turning::Axes(turns), ..) => turns,
            _ => return vec![g.zero(); v.len()],
        };
        let mut terms = vec![Vec::new(); v.len()];
        for (turn, y) in turns.iter().zip(y) {
            if let Some((from, to)) = *turn {
                terms[to].push(g.mul(*y, v[from]));
                let back = g.mul(*y, v[to]);
                terms[from].push(g.neg(back));
            }
        }
        terms.iter().map(|list| g.sum(list)).collect()
    }
}

/// `a x b`.
pub(super) fn cross(g: &mut Graph, a: [ExprId; 3], b: [ExprId; 3]) -> [ExprId; 3] {
    [0, 1, 2].map(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        let forward = g.mul(a[j], b[k]);
        let backward = g.mul(a[k], b[j]);
        g.sub(forward, backward)
    })
}

/// A part `weight/2 component^2` of the Lagrangian.
#[derive(Clone, Debug)]
struct Single {
    weight: ExprId,
    component: Rc<Component>,
    /// The product of velocities that it was distributed from.
    origin: Option<usize>,
}

/// A part of the Lagrangian that belongs to no square.
#[derive(Clone, Debug)]
struct Other {
    term: ExprId,
    factor: Rational,
    /// As that of a [`Single`].
    origin: Option<usize>,
}

/// Takes the squares of velocities out of the Lagrangian: these, and the rest; those of angular velocities as well, and
/// of systems of any size, `with_spins`, for a recursion.
pub(super) fn take_squares(g: &mut Graph, system: &ReducedSystem, with_spins: bool) -> (Vec<Square>, ExprId) {
    if !with_spins && system.algebroid.rank() > MAX_RANK {
        return (Vec::new(), system.lagrangian);
    }
    let velocities: BTreeSet<SymbolId> = system.velocities.iter().copied().collect();
    let varying: BTreeSet<SymbolId> =
        velocities.iter().chain(system.algebroid.base()).chain([&system.time]).copied().collect();
    let mut squares = Vec::new();
    let mut components_of = Components::new(g, system);
    let mut rest: Vec<Other> = Vec::new();
    let (summands, products) = summands(g, system, &velocities, &varying);
    // A vector with a number for its mass is part of the Lagrangian's own sum, and several of one mass may be one sum.
    let mut singles: Vec<Single> = Vec::new();
    let mut vectors: Vec<(ExprId, Vec<Rc<Component>>, Other)> = Vec::new();
    for summand in summands {
        let Other { term, factor: ref q, origin } = summand;
        let found = squared(g, term, q, &varying);
        let found = found.filter(|(_, v)| v.iter().any(|v| g.depends_on(*v, &velocities)));
        let found = found.and_then(|(weight, v)| {
            let components = v.into_iter().map(|v| components_of.find(g, v).map(Rc::new));
            let components = components.collect::<Option<Vec<_>>>();
            Some((weight, components?))
        });
        match found {
            Some((weight, components)) if (2..=MAX_DIMENSION).contains(&components.len()) => {
                match square(g, weight, &components) {
                    Some(square) => squares.push(square),
                    None if with_spins => vectors.push((weight, components, summand)),
                    None => rest.push(summand),
                }
            }
            Some((weight, components)) => {
                let of_components = components.into_iter();
                singles.extend(of_components.map(|component| Single { weight, component, origin }));
            }
            None => rest.push(summand),
        }
    }
    let half = Rational::new(1.into(), 2.into());
    let mut spins: Vec<[Rc<Component>; 3]> = Vec::new();
    if with_spins {
        let mut first = 0;
        while first + 2 < singles.len() {
            match spin(g, &singles, first) {
                Some(mut places) => {
                    let components = places.map(|k| singles[k].component.clone());
                    let weights = places.map(|k| singles[k].weight);
                    let own = spinning(g, &components, weights, &varying, &mut rest);
                    let (square, components) = of_size_one(g, own, components);
                    squares.push(square);
                    spins.push(components);
                    places.sort_unstable();
                    places.into_iter().rev().for_each(|k| drop(singles.remove(k)));
                }
                None => first += 1,
            }
        }
    }
    for (weight, components, term) in vectors {
        match turned_with(g, weight, components, &spins) {
            Some(square) => squares.push(square),
            None => rest.push(term),
        }
    }
    while !singles.is_empty() {
        let (square, mut taken) = vector(g, &singles).map_or((None, vec![0]), |(s, taken)| (Some(s), taken));
        taken.sort_unstable();
        let taken: Vec<Single> = taken.into_iter().rev().map(|k| singles.remove(k)).collect();
        match square {
            Some(square) => squares.push(square),
            None => rest.extend(taken.into_iter().map(|Single { weight, component, origin }| {
                let term = g.product(&[weight, component.value, component.value]);
                Other { term, factor: half.clone(), origin }
            })),
        }
    }
    // A product of which no term is in a square stays as it was written.
    let mut n_left = vec![0; products.len()];
    rest.iter().filter_map(|other| other.origin).for_each(|origin| n_left[origin] += 1);
    let is_whole = |origin: usize| n_left[origin] == products[origin].2;
    rest.retain(|other| !other.origin.is_some_and(is_whole));
    let whole = products.iter().enumerate().filter(|(origin, _)| is_whole(*origin));
    let whole = whole.map(|(_, (term, q, _))| (*term, q.clone()));
    let rest: Vec<(ExprId, Rational)> =
        rest.iter().map(|o| (o.term, o.factor.clone())).chain(whole).collect();
    let rest = g.linear_combination(&rest);
    (squares, rest)
}

/// The terms of the Lagrangian, and its products `v_i (J_i1 v_1 + J_i2 v_2 + ..)`, as `v . J v` has them, with the
/// number of terms that each makes.
fn summands(
    g: &mut Graph,
    system: &ReducedSystem,
    velocities: &BTreeSet<SymbolId>,
    varying: &BTreeSet<SymbolId>,
) -> (Vec<Other>, Vec<(ExprId, Rational, usize)>) {
    let (mut summands, mut products) = (Vec::new(), Vec::new());
    for (term, factor) in g.summands(system.lagrangian) {
        let Some(terms) = distributed(g, term, velocities, varying) else {
            summands.push(Other { term, factor, origin: None });
            continue;
        };
        let origin = Some(products.len());
        products.push((term, factor.clone(), terms.len()));
        summands.extend(terms.into_iter().map(|term| Other { term, factor: factor.clone(), origin }));
    }
    (summands, products)
}

/// The terms of a product of a velocity and a sum of multiples of velocities, the velocities as they are written.
fn distributed(
    g: &mut Graph,
    term: ExprId,
    velocities: &BTreeSet<SymbolId>,
    varying: &BTreeSet<SymbolId>,
) -> Option<Vec<ExprId>> {
    let Node::Product { coefficient, factors } = g.node(term).clone() else { return None };
    let (moving, fixed): (Vec<_>, Vec<_>) =
        factors.iter().cloned().partition(|(b, _)| g.depends_on(*b, varying));
    let [(a, one), (b, other)] = moving.as_slice() else { return None };
    if !one.is_one() || !other.is_one() {
        return None;
    }
    let (velocity, multiples) = [(*a, *b), (*b, *a)].into_iter().find_map(|(velocity, sum)| {
        let Node::Sum { constant, terms } = g.node(sum) else { return None };
        if *constant != Rational::from_integer(0.into()) || !g.depends_on(velocity, velocities) {
            return None;
        }
        // Multiples by parameters: a sum of plain velocities is a velocity itself.
        let is_multiple = |e: ExprId| match g.node(e) {
            Node::Product { factors, .. } => {
                let (moving, fixed): (Vec<_>, Vec<_>) =
                    factors.iter().partition(|(b, _)| g.depends_on(*b, varying));
                !fixed.is_empty()
                    && matches!(moving.as_slice(), [(v, q)] if q.is_one() && g.depends_on(*v, velocities))
            }
            _ => false,
        };
        terms.iter().all(|(e, _)| is_multiple(*e)).then(|| (velocity, terms.to_vec()))
    })?;
    let weight = g.power_product(&fixed).ok()?;
    let weight = g.scale(weight, &coefficient);
    Some(
        multiples
            .into_iter()
            .map(|(e, q)| {
                let product = g.product(&[weight, velocity, e]);
                g.scale(product, &q)
            })
            .collect(),
    )
}

/// The velocities whose squares the Lagrangian is written in, whatever frames they belong to.
pub(super) fn squared_velocities(g: &mut Graph, system: &ReducedSystem) -> Vec<ExprId> {
    let velocities: BTreeSet<SymbolId> = system.velocities.iter().copied().collect();
    let varying: BTreeSet<SymbolId> =
        velocities.iter().chain(system.algebroid.base()).chain([&system.time]).copied().collect();
    let mut found = Vec::new();
    for Other { term, factor, .. } in summands(g, system, &velocities, &varying).0 {
        let components = squared(g, term, &factor, &varying).map(|(_, v)| v);
        found.extend(components.into_iter().flatten().filter(|v| g.depends_on(*v, &velocities)));
    }
    found
}

/// The square that the first of these is part of, with their positions: of three, of two, or alone.
fn vector(g: &mut Graph, singles: &[Single]) -> Option<(Square, Vec<usize>)> {
    let first = singles.first()?;
    // In the unit of the first weight, where that is a rational one.
    let mut scaled = vec![(0, first.component.clone())];
    for (k, other) in singles.iter().enumerate().skip(1) {
        if scaled.len() == MAX_SINGLES {
            break;
        }
        let Ok(ratio) = g.div(other.weight, first.weight) else { continue };
        let ratio = g.as_rational(ratio).cloned();
        if let Some(root) = ratio.and_then(|ratio| rational_root(g, &ratio)) {
            let is_one = root == g.one();
            let own = Rc::clone(&other.component);
            scaled.push((k, if is_one { own } else { Rc::new(own.times(g, root)) }));
        }
    }
    let n = scaled.len();
    let triples = (1..n).flat_map(|a| (a + 1..n).map(move |b| vec![0, a, b]));
    let choices: Vec<Vec<usize>> = triples.chain((1..n).map(|a| vec![0, a])).chain([vec![0]]).collect();
    choices.into_iter().find_map(|choice| {
        let components: Vec<Rc<Component>> = choice.iter().map(|k| scaled[*k].1.clone()).collect();
        let square = square(g, first.weight, &components)?;
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

/// The root of a number that is a square of a rational one: others have no fingerprints where they are no squares in
/// the field.
fn rational_root(g: &mut Graph, q: &Rational) -> Option<ExprId> {
    if !q.is_positive() {
        return None;
    }
    let q = g.rational(q.clone());
    let root = g.sqrt(q);
    g.as_rational(root)?;
    Some(root)
}

/// The square with the frame of its components, if they have one; symbols alone gain nothing.
fn square(g: &mut Graph, weight: ExprId, components: &[Rc<Component>]) -> Option<Square> {
    if components.iter().all(|c| matches!(g.node(c.value), Node::Symbol(_))) {
        return None;
    }
    let turning = turning(g, components)?;
    if turning.iter().any(Option::is_some) && components.iter().any(|c| c.has_offset) {
        return None;
    }
    let masses = (0..components.len()).map(|i| (i, i, weight)).collect();
    Some(Square { masses, components: components.to_vec(), turning: Turning::Axes(turning) })
}

/// The square in the frame of one of the angular velocities, if it is in one of them.
fn turned_with(
    g: &mut Graph,
    weight: ExprId,
    components: Vec<Rc<Component>>,
    spins: &[[Rc<Component>; 3]],
) -> Option<Square> {
    let v: &[Rc<Component>; 3] = components.as_slice().try_into().ok()?;
    if v.iter().any(|c| c.has_offset) {
        return None;
    }
    // Components are known up to their order and signs. The angular velocity of a body is near its velocity in the
    // text.
    let n = v[0].slopes.len();
    let choices = spins.iter().rev().flat_map(|omega| ORDERS.map(|order| order.map(|i| &omega[i])));
    for omega in choices {
        for signs in 0..8_u8 {
            let sign = |i: usize| signs >> i & 1 == 1;
            let fits = (0..n).all(|beta| {
                (0..beta).all(|alpha| {
                    (0..3).all(|i| {
                        // (v_alpha x K_beta - v_beta x K_alpha)_i
                        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
                        let product = |is_negative: bool, (a, p): (usize, usize), (b, q): (usize, usize)| {
                            (is_negative ^ sign(q), v[p].slopes[a], omega[q].slopes[b])
                        };
                        let products = [
                            product(false, (alpha, j), (beta, k)),
                            product(true, (alpha, k), (beta, j)),
                            product(true, (beta, j), (alpha, k)),
                            product(false, (beta, k), (alpha, j)),
                        ];
                        g.is_sum_of_products(v[i].torsion[beta][alpha], &products)
                    })
                })
            });
            if fits {
                let signed = |i: usize| if sign(i) { g.neg(omega[i].value) } else { omega[i].value };
                let turning = Turning::With([0, 1, 2].map(signed));
                return Some(Square {
                    masses: (0..3).map(|i| (i, i, weight)).collect(),
                    components,
                    turning,
                });
            }
        }
    }
    None
}

/// All orders of three components.
const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]];

/// Places of the components of an angular velocity that begins with that at `first`.
fn spin(g: &mut Graph, singles: &[Single], first: usize) -> Option<[usize; 3]> {
    let near = |k: usize| k != first && k.abs_diff(first) <= MAX_SINGLES;
    let places: Vec<usize> = (0..singles.len()).filter(|k| near(*k)).collect();
    let pairs = places.iter().flat_map(|a| places.iter().filter(move |b| *b != a).map(move |b| (*a, *b)));
    for (second, third) in pairs {
        let omega = [first, second, third].map(|k| &singles[k].component);
        let may_turn = omega.iter().any(|c| c.has_torsion) && omega.iter().all(|c| !c.has_offset);
        if may_turn && are_spin(g, omega) {
            return Some([first, second, third]);
        }
    }
    None
}

/// Whether components turn as an angular velocity does: `domega(alpha, beta) = omega_alpha x omega_beta`.
fn are_spin(g: &mut Graph, omega: [&Rc<Component>; 3]) -> bool {
    (0..omega[0].slopes.len()).all(|beta| {
        (0..beta).all(|alpha| {
            (0..3).all(|i| {
                let (j, k) = ((i + 1) % 3, (i + 2) % 3);
                let forward = (false, omega[j].slopes[alpha], omega[k].slopes[beta]);
                let backward = (true, omega[k].slopes[alpha], omega[j].slopes[beta]);
                g.is_sum_of_products(omega[i].torsion[beta][alpha], &[forward, backward])
            })
        })
    })
}

/// The square with components of size one, where an angular velocity has these as well.
///
/// Where one velocity alone turns two of the components, these are known up to a common factor, such as the denominator
/// of decimals. What it multiplies cancels, with its square as a loss of digits.
fn of_size_one(g: &mut Graph, square: Square, omega: [Rc<Component>; 3]) -> (Square, [Rc<Component>; 3]) {
    let scales = omega.each_ref().map(|c| scale(g, c.value));
    if scales.iter().all(Rational::is_one) {
        return (square, omega);
    }
    let factors = scales.each_ref().map(|q| g.rational(q.clone()));
    let scaled = [0, 1, 2].map(|i| Rc::new(omega[i].times(g, factors[i])));
    if !are_spin(g, scaled.each_ref()) {
        return (square, omega);
    }
    let by = |i: usize, j: usize| (&scales[i] * &scales[j]).recip();
    let masses = square.masses.into_iter().map(|(i, j, mass)| (i, j, g.scale(mass, &by(i, j)))).collect();
    (Square { masses, components: scaled.to_vec(), turning: square.turning }, scaled)
}

/// The square of an angular velocity, with the products of its components that `rest` has.
fn spinning(
    g: &mut Graph,
    components: &[Rc<Component>; 3],
    weights: [ExprId; 3],
    varying: &BTreeSet<SymbolId>,
    rest: &mut Vec<Other>,
) -> Square {
    let mut masses: Vec<(usize, usize, ExprId)> =
        weights.into_iter().enumerate().map(|(i, weight)| (i, i, weight)).collect();
    let mut products: [Vec<ExprId>; 3] = Default::default();
    rest.retain(|Other { term, factor, .. }| {
        let Node::Product { coefficient, factors } = g.node(*term).clone() else { return true };
        let place = |i: usize| factors.iter().position(|(e, q)| *e == components[i].value && q.is_one());
        let pair = PAIRS.iter().enumerate().find_map(|(pair, [i, j])| Some((pair, place(*i)?, place(*j)?)));
        let Some((pair, a, b)) = pair else { return true };
        let fixed: Vec<_> =
            factors.iter().enumerate().filter(|(k, _)| *k != a && *k != b).map(|(_, f)| f.clone()).collect();
        let Ok(weight) = g.power_product(&fixed) else { return true };
        if g.depends_on(weight, varying) {
            return true;
        }
        products[pair].push(g.scale(weight, &(coefficient * factor)));
        false
    });
    for ([i, j], weights) in PAIRS.into_iter().zip(products) {
        if !weights.is_empty() {
            let weight = g.sum(&weights);
            masses.extend([(i, j, weight), (j, i, weight)]);
        }
    }
    Square { masses, components: components.to_vec(), turning: Turning::Own }
}

/// Pairs of three components.
const PAIRS: [[usize; 2]; 3] = [[0, 1], [0, 2], [1, 2]];

/// The `K_beta`, if there are any: tried one velocity after the other, each against those before it.
fn turning(g: &mut Graph, components: &[Rc<Component>]) -> Option<Vec<Turn>> {
    let n = components.len();
    let m = components.first()?.slopes.len();
    let planes = (0..n).flat_map(|i| (0..n).filter(move |j| *j != i).map(move |j| Some((i, j))));
    let candidates: Vec<Turn> = [None].into_iter().chain(planes).collect();
    // Position of the candidate of each velocity so far.
    let mut chosen = vec![0];
    let mut n_left = MAX_TRIALS;
    while n_left > 0 {
        let beta = chosen.len() - 1;
        let turn = candidates[chosen[beta]];
        let fits = (0..beta).all(|alpha| {
            let other = candidates[chosen[alpha]];
            (0..n).all(|i| {
                // v_alpha x K_beta - v_beta x K_alpha = K_alpha x v_beta - K_beta x v_alpha
                let forward = turned_component(g, other, components, beta, i);
                let backward = turned_component(g, turn, components, alpha, i);
                let expected = g.sub(forward, backward);
                g.is_equal(components[i].torsion[beta][alpha], expected)
            })
        });
        if fits && chosen.len() == m {
            return Some(chosen.into_iter().map(|k| candidates[k]).collect());
        }
        if fits {
            chosen.push(0);
            continue;
        }
        n_left -= 1;
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

/// `(K x v_alpha)_i`.
fn turned_component(g: &mut Graph, turn: Turn, v: &[Rc<Component>], alpha: usize, i: usize) -> ExprId {
    match turn {
        Some((from, to)) if i == to => v[from].slopes[alpha],
        Some((from, to)) if i == from => g.neg(v[to].slopes[alpha]),
        _ => g.zero(),
    }
}
