//! Reads the squares of velocities of linked bodies as parts, each by those before it.
//!
//! Velocities of linked bodies are sums over the bodies before them. What several of them share is one part, and a
//! constraint that has one velocity left which no other constraint determines is solved for it in its place of the
//! order, so that everything takes a number of operations for each body. Deliberately does not know: whether that is
//! cheaper than multiplying out, equations.
//!
//! # Source
//! Kane and Levinson 1985, Dynamics, section 2.13 (motion constraints).

use std::collections::{BTreeMap, BTreeSet, HashMap};

use num_traits::{One, Zero};

use crate::reduction::{KinematicConstraint, ReducedSystem, SolvedConstraint};
use hamel_expr::{ExprId, Graph, Node, Rational, SymbolId, Vanishing, sign_of};

use super::limits::{MAX_SUMS, MIN_DEPTH};
use super::squares::{Square, squared_velocities, take_squares};

/// What is computed in one place of a recursion.
#[derive(Clone, Debug)]
pub(super) enum Step {
    /// A part: its symbol and its value.
    Part(SymbolId, ExprId),
    /// The velocity of that position from `coefficient y + rest = 0`.
    Solved { alpha: usize, coefficient: ExprId, rest: ExprId },
}

impl Step {
    /// The symbol that is computed, `value`, and the `coefficient` where it is `-value/coefficient`.
    pub(super) fn value(&self, system: &ReducedSystem) -> (SymbolId, ExprId, Option<ExprId>) {
        match self {
            Step::Part(symbol, value) => (*symbol, *value, None),
            Step::Solved { alpha, coefficient, rest } => {
                (system.velocities[*alpha], *rest, Some(*coefficient))
            }
        }
    }
}

/// The squares of velocities of a Lagrangian by parts, each by those before it.
#[derive(Clone, Debug)]
pub(super) struct Recursion {
    pub(super) squares: Vec<Square>,
    /// The Lagrangian without them.
    pub(super) rest: ExprId,
    /// The components of the squares, by parts and velocities of the frame.
    pub(super) components: Vec<Vec<ExprId>>,
    /// The angular velocities of their frames, where components say these, by the same.
    pub(super) frames: Vec<Option<[ExprId; 3]>>,
    pub(super) steps: Vec<Step>,
    /// Parts that constraints keep at zero.
    pub(super) vanishing: BTreeSet<SymbolId>,
    /// Parts and dependent velocities by their values.
    pub(super) values: BTreeMap<SymbolId, ExprId>,
    /// Along which partial velocities are taken.
    pub(super) directions: Directions,
}

/// Whether the squares of velocities in the Lagrangian are written as sums of each other, over several bodies.
pub fn is_recursive(system: &ReducedSystem) -> bool {
    if eliminated(system).is_none() {
        return false;
    }
    let mut g = system.graph.clone();
    let velocities: BTreeSet<SymbolId> = velocities_of(system);
    let roots = squared_velocities(&mut g, system);
    let mut parts = Parts::new(&mut g, &velocities);
    parts.read(&roots);
    let list = parts.list;
    let mut depths: BTreeMap<SymbolId, usize> = BTreeMap::new();
    for (symbol, value) in list {
        let below = g.free_symbols(value).iter().filter_map(|s| depths.get(s)).max().copied();
        depths.insert(symbol, below.unwrap_or(0) + 1);
    }
    depths.values().any(|depth| *depth >= MIN_DEPTH)
}

/// The constraint of a system that recursion can carry: solved, with the displacements of the motion, its rows as
/// written.
fn eliminated(system: &ReducedSystem) -> Option<&SolvedConstraint> {
    let KinematicConstraint::Solved(solved) = &system.constraint else { return None };
    let has_rows = solved.rows.iter().all(|row| row.written.is_some());
    let is_own = solved.virtual_displacements == solved.psi;
    (has_rows && is_own && system.momenta.is_empty()).then_some(solved)
}

/// Velocities of the frame and quasi-velocities.
fn velocities_of(system: &ReducedSystem) -> BTreeSet<SymbolId> {
    system.velocities.iter().copied().chain(system.unknowns.iter().map(|u| u.symbol)).collect()
}

/// Sums that share terms, as sums of each other.
struct Parts<'a> {
    g: &'a mut Graph,
    velocities: &'a BTreeSet<SymbolId>,
    /// Terms that several sums have in common, from few to many.
    shared: Vec<BTreeMap<ExprId, Rational>>,
    /// Terms of sums and the symbols that stand for them.
    sums: Vec<(BTreeMap<ExprId, Rational>, SymbolId)>,
    list: Vec<(SymbolId, ExprId)>,
}

impl<'a> Parts<'a> {
    fn new(g: &'a mut Graph, velocities: &'a BTreeSet<SymbolId>) -> Parts<'a> {
        Parts { g, velocities, shared: Vec::new(), sums: Vec::new(), list: Vec::new() }
    }

    /// `e` with every sum of it that depends on velocities as a part.
    fn read(&mut self, roots: &[ExprId]) -> Vec<ExprId> {
        let velocities = self.velocities;
        let mut image: HashMap<ExprId, ExprId> = HashMap::new();
        let mut moving: BTreeSet<ExprId> = BTreeSet::new();
        for e in self.g.reachable(roots) {
            let node = self.g.node(e).clone();
            let mut moves = matches!(node, Node::Symbol(s) if velocities.contains(&s));
            node.for_each_operand(|operand| moves |= moving.contains(&operand));
            if moves {
                moving.insert(e);
            }
            let new = match node {
                _ if !moves => e,
                Node::Constant(_) | Node::Pi | Node::Symbol(_) => e,
                Node::Sum { constant, terms } => {
                    self.make_shared(&terms, &image);
                    self.sum(&constant, &terms, &image)
                }
                Node::Product { coefficient, factors } => {
                    let factors: Vec<_> = factors.iter().map(|(b, q)| (image[b], q.clone())).collect();
                    let product = self.g.power_product(&factors).unwrap_or(e);
                    self.g.scale(product, &coefficient)
                }
                Node::Function(f, a) => self.g.func(f, image[&a]),
                Node::Atan2(y, x) => self.g.atan2(image[&y], image[&x]),
            };
            image.insert(e, new);
        }
        roots.iter().map(|e| image[e]).collect()
    }

    /// Makes those shared sums parts that a further sum is the first to have.
    fn make_shared(&mut self, terms: &[(ExprId, Rational)], image: &HashMap<ExprId, ExprId>) {
        let all: BTreeMap<ExprId, Rational> = terms.iter().cloned().collect();
        self.g.charge(self.shared.len() * all.len());
        let is_here = |sum: &BTreeMap<ExprId, Rational>| ratio(&all, sum).is_some();
        let (here, others) = std::mem::take(&mut self.shared).into_iter().partition(is_here);
        self.shared = others;
        let here: Vec<BTreeMap<ExprId, Rational>> = here;
        for sum in here.into_iter().filter(|sum| sum.len() < all.len()) {
            let terms: Vec<(ExprId, Rational)> = sum.into_iter().collect();
            self.sum(&Rational::zero(), &terms, image);
        }
    }

    /// The terms along the velocity that was written last: those before them are the velocity of a joint.
    fn along_last(&self, terms: &BTreeMap<ExprId, Rational>) -> BTreeSet<ExprId> {
        let moving = |e: &ExprId| match self.g.node(*e) {
            Node::Product { factors, .. } => {
                factors.iter().map(|(base, _)| *base).find(|base| self.g.depends_on(*base, self.velocities))
            }
            _ => Some(*e),
        };
        let by_term: Vec<(ExprId, Option<ExprId>)> = terms.keys().map(|e| (*e, moving(e))).collect();
        let last = by_term.iter().filter_map(|(_, velocity)| *velocity).max();
        by_term.into_iter().filter(|(_, velocity)| *velocity == last).map(|(e, _)| e).collect()
    }

    /// A sum by the sums before it that leave the fewest of its terms.
    ///
    /// A sum before it may bring in terms, and leave parts of others. Where what is left is along several velocities,
    /// the sum is that of its terms before the last velocity, and the terms along the last velocity with their own
    /// coefficients.
    fn sum(
        &mut self,
        constant: &Rational,
        terms: &[(ExprId, Rational)],
        image: &HashMap<ExprId, ExprId>,
    ) -> ExprId {
        let all: BTreeMap<ExprId, Rational> = terms.iter().cloned().collect();
        let mut left = all.clone();
        let mut summands: Vec<(ExprId, Rational)> = Vec::new();
        loop {
            let mut best: Option<(usize, BTreeMap<ExprId, Rational>, SymbolId, Rational)> = None;
            self.g.charge(self.sums.len().min(MAX_SUMS) * left.len());
            for (other, symbol) in self.sums.iter().rev().take(MAX_SUMS) {
                // It takes away no more terms than it has.
                if best.as_ref().is_some_and(|(least, ..)| left.len() >= *least + other.len()) {
                    continue;
                }
                let ratios: BTreeSet<Rational> =
                    other.iter().filter_map(|(e, q)| Some(left.get(e)? / q)).collect();
                for ratio in ratios {
                    let remainder = without(&left, other, &ratio);
                    let n = remainder.len();
                    if n + 1 < left.len() && best.as_ref().is_none_or(|(least, ..)| n < *least) {
                        best = Some((n, remainder, *symbol, ratio));
                    }
                }
            }
            let Some((_, remainder, symbol, ratio)) = best else { break };
            summands.push((self.g.sym(symbol), ratio));
            left = remainder;
        }
        if !summands.is_empty() && constant.is_zero() && self.along_last(&left).len() < left.len() {
            let last = self.along_last(&all);
            if last.len() < all.len() {
                let before = terms.iter().filter(|(e, _)| !last.contains(e)).cloned();
                let part = self.sum(constant, &before.collect::<Vec<_>>(), image);
                summands = vec![(part, Rational::one())];
                left = all.iter().filter(|(e, _)| last.contains(*e)).map(|(e, q)| (*e, q.clone())).collect();
            }
        }
        summands.extend(left.into_iter().map(|(e, q)| (image[&e], q)));
        summands.push((self.g.one(), constant.clone()));
        let value = self.g.linear_combination(&summands);
        if self.g.is_trivial(value) {
            return value;
        }
        let symbol = self.g.define(&format!("part{}", self.list.len() + 1), value);
        self.list.push((symbol, value));
        if constant.is_zero() {
            self.sums.push((all, symbol));
        }
        self.g.sym(symbol)
    }
}

/// The factor by which the terms of a sum are among others, if they are.
fn ratio(all: &BTreeMap<ExprId, Rational>, sum: &BTreeMap<ExprId, Rational>) -> Option<Rational> {
    let (first, q) = sum.first_key_value()?;
    let ratio = all.get(first)? / q;
    sum.iter().all(|(e, q)| all.get(e).is_some_and(|own| *own == q * &ratio)).then_some(ratio)
}

/// What sums behind `roots` have in common, of two terms or more: velocities of joints, where the Lagrangian has those
/// of the centres of the bodies beside them.
fn shared_sums(
    g: &mut Graph,
    roots: &[ExprId],
    velocities: &BTreeSet<SymbolId>,
) -> Vec<BTreeMap<ExprId, Rational>> {
    let mut sums: Vec<BTreeMap<ExprId, Rational>> = Vec::new();
    for e in g.reachable(roots) {
        if let Node::Sum { terms, .. } = g.node(e)
            && terms.len() > 2
            && g.depends_on(e, velocities)
        {
            sums.push(terms.iter().cloned().collect());
        }
    }
    let mut found: BTreeSet<(usize, Vec<(ExprId, Rational)>)> = BTreeSet::new();
    for (n, one) in sums.iter().enumerate() {
        for other in sums[..n].iter().rev().take(MAX_SUMS) {
            g.charge(one.len());
            let mut by_ratio: BTreeMap<Rational, Vec<(ExprId, Rational)>> = BTreeMap::new();
            for (e, q) in one {
                if let Some(own) = other.get(e) {
                    by_ratio.entry(own / q).or_default().push((*e, q.clone()));
                }
            }
            let largest = by_ratio.into_iter().max_by_key(|(_, terms)| terms.len());
            // A sum that is another one and a single term needs nothing between them.
            let is_shared = |(ratio, terms): &(Rational, Vec<_>)| {
                terms.len() > 1
                    && terms.len() < one.len().min(other.len())
                    && without(other, one, ratio).len() > 1
            };
            found.extend(largest.filter(is_shared).map(|(_, terms)| (terms.len(), terms)));
        }
    }
    found.into_iter().map(|(_, terms)| terms.into_iter().collect()).collect()
}

/// `terms - ratio other`.
fn without(
    terms: &BTreeMap<ExprId, Rational>,
    other: &BTreeMap<ExprId, Rational>,
    ratio: &Rational,
) -> BTreeMap<ExprId, Rational> {
    let mut left = terms.clone();
    for (e, q) in other {
        let entry = left.entry(*e).or_insert_with(Rational::zero);
        *entry -= q * ratio;
        if entry.is_zero() {
            left.remove(e);
        }
    }
    left
}

impl Recursion {
    /// The recursion of a system; none where a constraint has to be solved together with others, where displacements
    /// are not those of the motion, where noise moves coordinates beside the velocities, or where a sum by parts is not
    /// seen to be the sum that was read.
    pub(super) fn new(g: &mut Graph, system: &ReducedSystem) -> Option<Recursion> {
        if !system.noise_rates.is_empty() {
            return None;
        }
        let solved = eliminated(system)?;
        let rows: Vec<ExprId> = solved.rows.iter().map(|row| row.written).collect::<Option<_>>()?;
        let (squares, rest) = take_squares(g, system, true);
        if squares.is_empty() {
            return None;
        }
        let velocities = velocities_of(system);
        let sizes: Vec<usize> = squares.iter().map(|s| s.components.len()).collect();
        let mut roots: Vec<ExprId> =
            squares.iter().flat_map(|s| s.components.iter().map(|c| c.value)).collect();
        let n_components = roots.len();
        roots.extend(&rows);
        roots.extend(squares.iter().filter_map(Square::frame).flatten());
        let shared = shared_sums(g, &roots, &velocities);
        let mut parts = Parts { shared, ..Parts::new(g, &velocities) };
        let written = roots;
        let roots = parts.read(&written);
        let list = parts.list;
        // Names of parts have the values of what they stand for.
        let mut are_equal = written.iter().zip(&roots);
        if !are_equal.all(|(a, b)| g.fingerprints_agree(*a, *b) || g.is_equal(*a, *b)) {
            return None;
        }
        let mut values = roots[..n_components].iter().copied();
        let components = sizes.iter().map(|n| values.by_ref().take(*n).collect()).collect();
        let (of_rows, of_frames) = roots[n_components..].split_at(rows.len());
        let mut of_frames = of_frames.chunks_exact(3);
        let frames = squares.iter().map(|square| {
            square.frame()?;
            let omega = of_frames.next()?;
            Some([omega[0], omega[1], omega[2]])
        });
        let frames = frames.collect();
        let (steps, vanishing) = steps(g, system, solved, list, of_rows)?;
        let directions = directions(g, solved, &steps);
        Some(Recursion {
            squares,
            rest,
            components,
            frames,
            steps,
            vanishing,
            values: BTreeMap::new(),
            directions,
        })
    }
}

/// Rates `w = T u` with `u = B w`, along which partial velocities are taken.
///
/// # Shapes
/// `[k][k]`, for `k` unknowns.
#[derive(Clone, Debug)]
pub(super) struct Directions {
    /// `T`.
    pub(super) rates: Vec<Vec<Rational>>,
    /// `B`.
    pub(super) inverse: Vec<Vec<Rational>>,
    /// The parts that the rates are; none for the unknown itself.
    pub(super) parts: Vec<Option<SymbolId>>,
}

/// Directions along which few bodies' frames turn: those of the rates `w` that parts without coordinates are, each in
/// the place of an unknown. Without such parts they are those of the unknowns.
///
/// # Source
/// Kane and Levinson 1985, Dynamics, section 2.12 (generalised speeds).
fn directions(g: &mut Graph, solved: &SolvedConstraint, steps: &[Step]) -> Directions {
    let k = solved.unknowns.len();
    let zeros = vec![Rational::zero(); k];
    let symbols: Vec<SymbolId> = solved.unknowns.iter().map(|u| u.symbol).collect();
    // Parts by the unknowns, and the unknowns by the rates.
    let mut parts: BTreeMap<SymbolId, Vec<Rational>> = BTreeMap::new();
    let mut by_rates: Vec<Option<Vec<Rational>>> = vec![None; k];
    let mut rates: Vec<Vec<Rational>> = (0..k).map(|a| unit(k, a)).collect();
    let mut chosen = vec![None; k];
    for step in steps {
        let Step::Part(symbol, value) = step else { continue };
        let mut row = zeros.clone();
        let mut is_rate = true;
        for (term, q) in g.summands(*value) {
            let (of_term, stem) = g.split_coefficient(term);
            let weight = of_term * q;
            match g.node(stem) {
                Node::Symbol(s) if parts.contains_key(s) => {
                    row.iter_mut().zip(&parts[s]).for_each(|(entry, own)| *entry += own * &weight);
                }
                Node::Symbol(s) => match symbols.iter().position(|own| own == s) {
                    Some(a) => row[a] += weight,
                    None => is_rate = false,
                },
                _ => is_rate = false,
            }
        }
        if !is_rate {
            continue;
        }
        // The rate in place of its last unknown, where all others are known by rates before.
        if let Some(last) = row.iter().rposition(|q| !q.is_zero())
            && by_rates[last].is_none()
        {
            let inverse = row[last].recip();
            let mut own = zeros.clone();
            own[last].clone_from(&inverse);
            for (a, q) in row.iter().enumerate().take(last).filter(|(_, q)| !q.is_zero()) {
                let earlier = by_rates[a].get_or_insert_with(|| unit(k, a));
                own.iter_mut().zip(&*earlier).for_each(|(entry, e)| *entry -= e * q * &inverse);
            }
            by_rates[last] = Some(own);
            rates[last].clone_from(&row);
            chosen[last] = Some(*symbol);
        }
        parts.insert(*symbol, row);
    }
    let inverse = by_rates.into_iter().enumerate().map(|(a, row)| row.unwrap_or_else(|| unit(k, a)));
    Directions { rates, inverse: inverse.collect(), parts: chosen }
}

fn unit(k: usize, a: usize) -> Vec<Rational> {
    (0..k).map(|b| if b == a { Rational::one() } else { Rational::zero() }).collect()
}

/// The parts and the solved constraints in an order in which each has what it needs, and the parts that vanish.
fn steps(
    g: &mut Graph,
    system: &ReducedSystem,
    solved: &SolvedConstraint,
    parts: Vec<(SymbolId, ExprId)>,
    rows: &[ExprId],
) -> Option<(Vec<Step>, BTreeSet<SymbolId>)> {
    let position: BTreeMap<SymbolId, usize> =
        solved.dependent.iter().map(|alpha| (system.velocities[*alpha], *alpha)).collect();
    let params: BTreeSet<SymbolId> = system.params.iter().map(|p| p.symbol).collect();
    // The dependent velocities behind every part.
    let mut behind: BTreeMap<SymbolId, BTreeSet<SymbolId>> = BTreeMap::new();
    let dependents = |g: &Graph, e: ExprId, behind: &BTreeMap<SymbolId, BTreeSet<SymbolId>>| {
        let mut all = BTreeSet::new();
        for s in g.free_symbols(e) {
            match behind.get(&s) {
                Some(of_part) => all.extend(of_part.iter().copied()),
                None => all.extend(position.contains_key(&s).then_some(s)),
            }
        }
        all
    };
    for (symbol, value) in &parts {
        let own = dependents(g, *value, &behind);
        behind.insert(*symbol, own);
    }
    let mut open: Vec<(ExprId, BTreeSet<SymbolId>)> =
        rows.iter().map(|row| (*row, dependents(g, *row, &behind))).collect();
    let mut known: BTreeSet<SymbolId> = BTreeSet::new();
    let mut vanishing: BTreeSet<SymbolId> = BTreeSet::new();
    let mut pending: Vec<Step> = Vec::new();
    while !open.is_empty() {
        let next = open.iter().position(|(_, of)| of.difference(&known).count() == 1)?;
        let (row, of) = open.remove(next);
        let velocity = *of.difference(&known).next()?;
        let mut inlined: BTreeMap<SymbolId, ExprId> = BTreeMap::new();
        for (symbol, value) in &parts {
            if behind[symbol].contains(&velocity) && !vanishing.contains(symbol) {
                let value = g.subs(*value, &inlined).ok()?;
                inlined.insert(*symbol, value);
            }
        }
        let equation = g.subs(row, &inlined).ok()?;
        let coefficient = g.diff(equation, velocity);
        let is_safe = g.free_symbols(coefficient).is_subset(&params)
            && g.vanishing(coefficient) == Vanishing::NonZero
            && sign_of(g, coefficient, &system.signs).is_definite();
        if !is_safe {
            return None;
        }
        let zero = g.zero();
        let rest = g.subs(equation, &BTreeMap::from([(velocity, zero)])).ok()?;
        pending.push(Step::Solved { alpha: position[&velocity], coefficient, rest });
        known.insert(velocity);
        let (_, stem) = g.split_coefficient(row);
        if let Node::Symbol(s) = g.node(stem)
            && behind.contains_key(s)
        {
            vanishing.insert(*s);
        }
    }
    if known.len() != position.len() {
        return None;
    }
    let is_kept = |(symbol, _): &(SymbolId, ExprId)| !vanishing.contains(symbol);
    pending.extend(parts.into_iter().filter(is_kept).map(|(symbol, value)| Step::Part(symbol, value)));
    let mut awaited: BTreeSet<SymbolId> = position.keys().copied().collect();
    awaited.extend(pending.iter().filter_map(|step| match step {
        Step::Part(symbol, _) => Some(*symbol),
        Step::Solved { .. } => None,
    }));
    let mut ordered = Vec::with_capacity(pending.len());
    while !pending.is_empty() {
        let mut later = Vec::new();
        let n = ordered.len();
        for step in pending {
            let (made, from) = match &step {
                Step::Part(symbol, value) => (*symbol, *value),
                Step::Solved { alpha, rest, .. } => (system.velocities[*alpha], *rest),
            };
            if g.depends_on(from, &awaited) {
                later.push(step);
            } else {
                awaited.remove(&made);
                ordered.push(step);
            }
        }
        if ordered.len() == n {
            return None;
        }
        pending = later;
    }
    Some((ordered, vanishing))
}
