//! Kane's form of the equations along the recursions that a model is written in: `A = sum m V^T V`,
//! `f = .. - sum m V^T a`, with partial velocities `V` and accelerations `a` pushed forward part by part.
//!
//! Velocities of linked bodies are sums over the bodies before them. What several of them share is one part, and a
//! constraint that has one velocity left which no other constraint determines is solved for it in its place of the
//! order, so that everything takes a number of operations for each body. Deliberately does not know: whether that is
//! cheaper than multiplying out, what the squares belong to.
//!
//! # Source
//! Kane and Levinson 1985, Dynamics, sections 2.14 and 4.11; forward mode as Griewank and Walther 2008, section 3.1.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use num_traits::{One, Zero};

use crate::error::Error;
use crate::expr::{ExprId, Graph, Node, Rational, SymbolId, Vanishing, sign_of};
use crate::reduction::{KinematicConstraint, ReducedSystem, SolvedConstraint};

use super::derive::Derivation;
use super::squares::{Square, squared_velocities, take_squares};

/// What is computed in one place of a recursion.
#[derive(Clone, Debug)]
enum Step {
    /// A part: its symbol and its value.
    Part(SymbolId, ExprId),
    /// The velocity of that position from `coefficient y + rest = 0`.
    Solved { alpha: usize, coefficient: ExprId, rest: ExprId },
}

/// The squares of velocities of a Lagrangian by parts, each by those before it.
#[derive(Clone, Debug)]
pub(super) struct Recursion {
    pub(super) squares: Vec<Square>,
    /// The Lagrangian without them.
    pub(super) rest: ExprId,
    /// The components of the squares, by parts and velocities of the frame.
    components: Vec<Vec<ExprId>>,
    steps: Vec<Step>,
    /// Parts that constraints keep at zero.
    vanishing: BTreeSet<SymbolId>,
    /// Parts and dependent velocities by their values.
    values: BTreeMap<SymbolId, ExprId>,
    /// Along which partial velocities are taken.
    directions: Directions,
}

/// Parts on parts from which on recursion is tried: three bodies. With fewer there is nothing to share that a
/// search for common sums does not find.
const MIN_DEPTH: usize = 3;

/// Sums that are tried as parts of a further one, the latest first.
const MAX_SUMS: usize = 100;

/// Whether the squares of velocities in the Lagrangian are written as sums of each other, over several bodies.
pub fn is_recursive(system: &ReducedSystem) -> bool {
    if eliminated(system).is_none() {
        return false;
    }
    let mut g = system.graph.clone();
    let velocities: BTreeSet<SymbolId> = velocities_of(system);
    let roots = squared_velocities(&mut g, system);
    let mut parts = Parts { g: &mut g, sums: Vec::new(), list: Vec::new() };
    parts.read(&roots, &velocities);
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

/// Rates of change along one direction, or along the motion at `udot = 0`.
pub(super) struct Tangent {
    /// Of the velocities of the frame.
    pub(super) velocities: Vec<ExprId>,
    /// Of the components of the squares.
    pub(super) components: Vec<Vec<ExprId>>,
}

/// Sums that share terms, as sums of each other.
struct Parts<'a> {
    g: &'a mut Graph,
    /// Terms of sums and the symbols that stand for them.
    sums: Vec<(BTreeMap<ExprId, Rational>, SymbolId)>,
    list: Vec<(SymbolId, ExprId)>,
}

impl Parts<'_> {
    /// `e` with every sum of it that depends on `velocities` as a part.
    fn read(&mut self, roots: &[ExprId], velocities: &BTreeSet<SymbolId>) -> Vec<ExprId> {
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
                Node::Sum { constant, terms } => self.sum(&constant, &terms, &image),
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

    /// A sum by the sums before it that leave the fewest of its terms.
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
    /// The recursion of a system; none where a constraint has to be solved together with others, or displacements are not
    /// those of the motion.
    fn new(g: &mut Graph, system: &ReducedSystem) -> Option<Recursion> {
        let solved = eliminated(system)?;
        let rows: Vec<ExprId> = solved.rows.iter().map(|row| row.written).collect::<Option<_>>()?;
        let (squares, rest) = take_squares(g, system);
        if squares.is_empty() {
            return None;
        }
        let velocities = velocities_of(system);
        let sizes: Vec<usize> = squares.iter().map(|s| s.components.len()).collect();
        let mut roots: Vec<ExprId> =
            squares.iter().flat_map(|s| s.components.iter().map(|c| c.value)).collect();
        let n_components = roots.len();
        roots.extend(&rows);
        let mut parts = Parts { g, sums: Vec::new(), list: Vec::new() };
        let roots = parts.read(&roots, &velocities);
        let list = parts.list;
        let mut values = roots[..n_components].iter().copied();
        let components = sizes.iter().map(|n| values.by_ref().take(*n).collect()).collect();
        let (steps, vanishing) = steps(g, system, solved, list, &roots[n_components..])?;
        let directions = directions(g, solved, &steps);
        Some(Recursion { squares, rest, components, steps, vanishing, values: BTreeMap::new(), directions })
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
        }
        parts.insert(*symbol, row);
    }
    let inverse = by_rates.into_iter().enumerate().map(|(a, row)| row.unwrap_or_else(|| unit(k, a)));
    Directions { rates, inverse: inverse.collect() }
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

impl Derivation<'_> {
    /// The dependent velocities by recursion, if the system is to be derived along one.
    pub(super) fn velocities_by_recursion(&mut self) -> Result<(), Error> {
        if self.system.formulation.recursive != Some(true) {
            return Ok(());
        }
        let Some(mut recursion) = Recursion::new(&mut self.g, self.system) else { return Ok(()) };
        self.writer.begin("velocities by recursion");
        let zero = self.g.zero();
        recursion.values = recursion.vanishing.iter().map(|s| (*s, zero)).collect();
        for step in recursion.steps.clone() {
            match step {
                Step::Part(symbol, value) => {
                    let value = self.in_recursion(&recursion, value)?;
                    let name = self.g.name(symbol).to_owned();
                    let named = self.define(&name, value);
                    recursion.values.insert(symbol, named);
                }
                Step::Solved { alpha, coefficient, rest } => {
                    let rest = self.in_recursion(&recursion, rest)?;
                    let value = self.solved_for(rest, coefficient);
                    let name = self.names[alpha].clone();
                    let named = self.define(&name, value);
                    let velocity = self.system.velocities[alpha];
                    recursion.values.insert(velocity, named);
                    self.replacement.insert(velocity, named);
                    self.y[alpha] = named;
                }
            }
        }
        self.recursion = Some(recursion);
        Ok(())
    }

    /// An expression in parts and raw velocities by their values.
    fn in_recursion(&mut self, recursion: &Recursion, e: ExprId) -> Result<ExprId, Error> {
        let value = self.g.subs(e, &recursion.values);
        value.map_err(|_| Error::DivisionByZero { place: "the velocities of linked bodies".into() })
    }

    /// `-rest / coefficient`.
    fn solved_for(&mut self, rest: ExprId, coefficient: ExprId) -> ExprId {
        let inverse = self.g.powi(coefficient, -1);
        let quotient = self.g.mul(rest, inverse);
        self.g.neg(quotient)
    }

    /// Pushes rates of change of the inputs forward; values get names that begin with `prefix`.
    pub(super) fn by_recursion(
        &mut self,
        recursion: &Recursion,
        prefix: &str,
        inputs: BTreeMap<SymbolId, ExprId>,
    ) -> Result<Tangent, Error> {
        let mut rates = inputs;
        for step in &recursion.steps {
            let (symbol, name, value, coefficient) = match step {
                Step::Part(symbol, value) => (*symbol, self.g.name(*symbol).to_owned(), *value, None),
                Step::Solved { alpha, coefficient, rest } => {
                    (self.system.velocities[*alpha], self.names[*alpha].clone(), *rest, Some(*coefficient))
                }
            };
            let rate = self.g.derivative_along(value, &rates);
            let mut rate = self.in_recursion(recursion, rate)?;
            if let Some(coefficient) = coefficient {
                rate = self.solved_for(rate, coefficient);
            }
            let named = self.define(&format!("{prefix}{name}"), rate);
            if named != self.g.zero() {
                rates.insert(symbol, named);
            }
        }
        let zero = self.g.zero();
        // Independent velocities of the frame are among the inputs.
        let velocities = self.system.velocities.iter();
        let velocities = velocities.map(|s| rates.get(s).copied().unwrap_or(zero)).collect();
        let mut components = Vec::with_capacity(recursion.components.len());
        for (k, square) in recursion.components.iter().enumerate() {
            let mut of_square = Vec::with_capacity(square.len());
            for (i, e) in square.iter().enumerate() {
                let rate = self.g.derivative_along(*e, &rates);
                let rate = self.in_recursion(recursion, rate)?;
                of_square.push(self.define(&format!("{prefix}v{}_{}", k + 1, i + 1), rate));
            }
            components.push(of_square);
        }
        Ok(Tangent { velocities, components })
    }

    /// Partial velocities along the unknowns, and the accelerations at `udot = 0`, relative to the frames of the
    /// squares in `components`.
    fn tangents(
        &mut self,
        recursion: &Recursion,
        solved: &SolvedConstraint,
    ) -> Result<(Vec<Tangent>, Tangent), Error> {
        self.writer.begin("partial velocities by recursion");
        let one = self.g.one();
        let mut partial = Vec::with_capacity(solved.unknowns.len());
        for (b, along) in solved.unknowns.iter().enumerate() {
            let mut direction = BTreeMap::new();
            for (unknown, row) in solved.unknowns.iter().zip(&recursion.directions.inverse) {
                if !row[b].is_zero() {
                    direction.insert(unknown.symbol, self.g.rational(row[b].clone()));
                }
            }
            partial.push(self.by_recursion(recursion, &format!("d_{}_", along.name), direction)?);
        }
        self.writer.begin("accelerations of the recursion at udot = 0");
        let base = self.system.algebroid.base().iter().copied().zip(self.rates.iter().copied());
        let moving = base.chain([(self.system.time, one)]).filter(|(_, rate)| *rate != self.g.zero());
        let moving: BTreeMap<SymbolId, ExprId> = moving.collect();
        let mut drift = self.by_recursion(recursion, "lag_", moving)?;
        for (k, square) in recursion.squares.iter().enumerate() {
            let mut v = Vec::new();
            for e in &recursion.components[k] {
                let value = self.in_recursion(recursion, *e)?;
                v.push(self.g.cancel_zero(value));
            }
            let turned = square.turned(&mut self.g, &self.y, &v);
            for (i, turned) in turned.into_iter().enumerate() {
                let value = self.g.add(drift.components[k][i], turned);
                drift.components[k][i] = self.define(&format!("a{}_{}", k + 1, i + 1), value);
            }
        }
        Ok((partial, drift))
    }

    /// The equations along the directions of the recursion.
    pub(super) fn kane(&mut self, recursion: &Recursion, solved: &SolvedConstraint) -> Result<Kane, Error> {
        let (partial, drift) = self.tangents(recursion, solved)?;
        let m = self.y.len();
        let mut rest_hessian = Vec::with_capacity(m);
        for y in &self.system.velocities {
            let p = self.g.diff(recursion.rest, *y);
            let row: Vec<ExprId> = self.system.velocities.iter().map(|s| self.g.diff(p, *s)).collect();
            let row = row.into_iter().map(|e| self.replace(e)).collect::<Result<Vec<_>, _>>()?;
            rest_hessian.push(row);
        }
        let k = solved.unknowns.len();
        self.writer.begin("mass matrix A = sum m V^T V");
        let mut mass_matrix = vec![vec![self.g.zero(); k]; k];
        for b in 0..k {
            for a in 0..=b {
                let mut terms = self.weighed(recursion, &partial[a].components, &partial[b].components);
                for (alpha, row) in rest_hessian.iter().enumerate() {
                    for (beta, h) in row.iter().enumerate() {
                        if *h != self.g.zero() {
                            let (u, v) = (partial[b].velocities[alpha], partial[a].velocities[beta]);
                            terms.push(self.g.product(&[u, *h, v]));
                        }
                    }
                }
                let sum = self.g.sum(&terms);
                let name = format!("A_{}_{}", solved.unknowns[b].name, solved.unknowns[a].name);
                mass_matrix[b][a] = self.define(&name, sum);
                mass_matrix[a][b] = mass_matrix[b][a];
            }
        }
        self.writer.begin("right side f = V^T (r - m a)");
        let mut net = Vec::with_capacity(m);
        for (alpha, row) in rest_hessian.iter().enumerate() {
            let mut terms = vec![self.rest_drive[alpha]];
            for (h, lag) in row.iter().zip(&drift.velocities) {
                let product = self.g.mul(*h, *lag);
                terms.push(self.g.neg(product));
            }
            let sum = self.g.sum(&terms);
            net.push(self.define(&format!("n_{}", self.names[alpha]), sum));
        }
        let mut force = vec![self.g.zero(); k];
        let mut known: Vec<(BTreeMap<ExprId, Rational>, ExprId)> = Vec::new();
        for b in (0..k).rev() {
            let mut terms =
                self.inertia_along(recursion, &partial[b].components, &drift.components, &mut known);
            terms.extend((partial[b].velocities.iter().zip(&net)).map(|(w, n)| self.g.mul(*w, *n)));
            let sum = self.g.sum(&terms);
            force[b] = self.define(&format!("f_{}", solved.unknowns[b].name), sum);
        }
        Ok(Kane {
            mass_matrix,
            force,
            directions: recursion.directions.clone(),
            partial,
            lag: drift.velocities,
        })
    }

    /// Sums over the squares of `weight u . v`, one for each weight.
    fn weighed(&mut self, recursion: &Recursion, u: &[Vec<ExprId>], v: &[Vec<ExprId>]) -> Vec<ExprId> {
        let mut by_weight: BTreeMap<ExprId, Vec<ExprId>> = BTreeMap::new();
        for ((square, u), v) in recursion.squares.iter().zip(u).zip(v) {
            let products = u.iter().zip(v).map(|(u, v)| self.g.mul(*u, *v));
            by_weight.entry(square.weight).or_default().extend(products);
        }
        let sums = by_weight.into_iter().map(|(weight, products)| {
            let sum = self.g.sum(&products);
            self.g.mul(weight, sum)
        });
        sums.collect()
    }

    /// `-weight u . a` of all squares, gathered by the partial velocities, which many bodies have in common; sums of
    /// `weight a` that are `known` from other directions are used in further ones.
    fn inertia_along(
        &mut self,
        recursion: &Recursion,
        u: &[Vec<ExprId>],
        a: &[Vec<ExprId>],
        known: &mut Vec<(BTreeMap<ExprId, Rational>, ExprId)>,
    ) -> Vec<ExprId> {
        let mut by_velocity: BTreeMap<ExprId, BTreeMap<ExprId, Rational>> = BTreeMap::new();
        for ((square, u), a) in recursion.squares.iter().zip(u).zip(a) {
            for (u, a) in u.iter().zip(a) {
                let force = self.g.mul(square.weight, *a);
                if *u != self.g.zero() && force != self.g.zero() {
                    let forces = by_velocity.entry(*u).or_default();
                    *forces.entry(force).or_insert_with(Rational::zero) += Rational::one();
                }
            }
        }
        let mut terms = Vec::with_capacity(by_velocity.len());
        for (velocity, forces) in by_velocity {
            let mut left = forces.clone();
            let mut summands = Vec::new();
            let is_part = |inner: &BTreeMap<ExprId, Rational>, left: &BTreeMap<ExprId, Rational>| {
                inner.iter().all(|(force, n)| left.get(force) == Some(n))
            };
            while let Some((inner, sum)) =
                known.iter().filter(|(inner, _)| is_part(inner, &left)).max_by_key(|(inner, _)| inner.len())
            {
                summands.push((*sum, Rational::one()));
                left.retain(|force, _| !inner.contains_key(force));
            }
            summands.extend(left);
            let sum = self.g.linear_combination(&summands);
            let sum = self.define(&format!("ma{}", known.len() + 1), sum);
            if forces.len() > 1 {
                known.push((forces, sum));
            }
            let product = self.g.mul(velocity, sum);
            terms.push(self.g.neg(product));
        }
        terms
    }
}

/// The equations `A wdot = f` along directions, `u = B w`.
pub(super) struct Kane {
    pub(super) mass_matrix: Vec<Vec<ExprId>>,
    pub(super) force: Vec<ExprId>,
    pub(super) directions: Directions,
    /// Partial velocities along the rates, `[k]`.
    pub(super) partial: Vec<Tangent>,
    /// `ydot` at `udot = 0`.
    pub(super) lag: Vec<ExprId>,
}
