//! Definitions as sparse polynomials in what changes from call to call, with parameter-only coefficients.
//!
//! A [`System`] of polynomials is the form in which sums are rearranged: monomials are products of [`Atom`]s (inputs,
//! functions, other polynomials) with rational exponents, coefficients are expressions in the parameters alone,
//! identified by their fingerprints, so that equal numbers are one number however they were written. Deliberately does
//! not know which rearrangement is cheap, nor what a value is for.

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};

use num_rational::Ratio;
use num_traits::{One, Signed, ToPrimitive, Zero};
use rustc_hash::FxHashMap;

use super::class::{Class, Classes, post_order};
use crate::error::Error;
use crate::expr::{ExprId, Fingerprint, Func, Graph, Node, Rational, Sign, SymbolId, remembered_sign_of};

/// Exponent of an atom.
pub(super) type Exponent = Ratio<i32>;

/// Something that changes from call to call and is not taken apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(super) enum Atom {
    /// Time, or a component of the state.
    Input(ExprId),
    /// Another polynomial of the system.
    Poly(u32),
    /// An elementary function of a polynomial.
    Function(Func, u32),
    /// `atan2` of two polynomials.
    Atan2(u32, u32),
}

/// A parameter-only number up to its sign; zero is never one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(super) struct Coefficient {
    pub(super) negative: bool,
    /// Position in the table of numbers; 0 is one.
    pub(super) number: u32,
}

impl Coefficient {
    pub(super) const ONE: Coefficient = Coefficient { negative: false, number: 0 };

    pub(super) fn is_unit(self) -> bool {
        self.number == 0
    }

    pub(super) fn signed_by(self, negative: bool) -> Coefficient {
        Coefficient { negative: self.negative ^ negative, ..self }
    }
}

/// Atoms, by position, with their exponents: sorted, none zero.
pub(super) type Monomial = Vec<(u32, Exponent)>;

/// Monomials, sorted and distinct, with their coefficients.
pub(super) type Polynomial = Vec<(Monomial, Coefficient)>;

/// A polynomial and where it comes from.
#[derive(Clone, Debug)]
pub(super) struct Entry {
    pub(super) value: Polynomial,
    /// The definition that it is the value of, and its section.
    pub(super) definition: Option<(SymbolId, usize)>,
    /// The unit that it is measured in: the definition's value is this number times the polynomial's.
    pub(super) unit: Coefficient,
}

/// Parameter-only numbers: each function once, with remembered arithmetic.
#[derive(Debug, Default)]
pub(super) struct Numbers {
    exprs: Vec<ExprId>,
    by_fingerprint: HashMap<Fingerprint, u32>,
    by_expr: HashMap<ExprId, Option<Coefficient>>,
    products: FxHashMap<(u32, u32), Coefficient>,
    quotients: FxHashMap<(u32, u32), Option<Coefficient>>,
    /// Reciprocals; none of what is zero everywhere.
    reciprocals: FxHashMap<u32, Option<ExprId>>,
    sums: FxHashMap<(Coefficient, Coefficient), Option<Coefficient>>,
    /// Terms of the numbers computed so far: a measure of work that is the same on every machine.
    pub(super) work: usize,
    /// Signs of what may be divided by.
    signs: BTreeMap<ExprId, Sign>,
    /// Signs found from these.
    found_signs: FxHashMap<ExprId, Sign>,
}

impl Numbers {
    pub(super) fn new(graph: &Graph, signs: &BTreeMap<ExprId, Sign>) -> Numbers {
        let mut numbers = Numbers { signs: signs.clone(), ..Numbers::default() };
        numbers.exprs.push(graph.one());
        numbers.by_fingerprint.insert(*graph.fingerprint(graph.one()), 0);
        numbers
    }

    /// Whether so many terms were computed that nothing more is to be multiplied out.
    pub(super) fn are_too_long(&self) -> bool {
        self.work > MAX_NUMBER_WORK
    }

    /// The number that an expression is; none for zero.
    pub(super) fn of(&mut self, graph: &mut Graph, e: ExprId) -> Option<Coefficient> {
        if let Some(known) = self.by_expr.get(&e) {
            return *known;
        }
        let coefficient = self.find(graph, e);
        self.by_expr.insert(e, coefficient);
        coefficient
    }

    fn find(&mut self, graph: &mut Graph, e: ExprId) -> Option<Coefficient> {
        self.work += graph.node(e).n_operands();
        let zero = graph.zero();
        if graph.is_seen_to_be_equal(e, zero) {
            return None;
        }
        let negated = graph.neg(e);
        // A fingerprint with void points tells nothing: such a number is equal to itself alone.
        let telling = |graph: &Graph, e: ExprId| {
            let fingerprint = *graph.fingerprint(e);
            fingerprint.iter().all(Option::is_some).then_some(fingerprint)
        };
        let (plus, minus) = (telling(graph, e), telling(graph, negated));
        if let Some(known) = plus.and_then(|f| self.by_fingerprint.get(&f)) {
            return Some(Coefficient { negative: false, number: *known });
        }
        if let Some(known) = minus.and_then(|f| self.by_fingerprint.get(&f)) {
            return Some(Coefficient { negative: true, number: *known });
        }
        // Of a number and its opposite, the one with fewer minus signs is kept.
        let is_negative = match graph.node(e) {
            Node::Constant(c) => c.is_negative(),
            Node::Product { coefficient, .. } => coefficient.is_negative(),
            Node::Sum { terms, .. } => terms.iter().all(|(_, q)| q.is_negative()),
            _ => false,
        };
        let (kept, fingerprint) = if is_negative { (negated, minus) } else { (e, plus) };
        let number = u32::try_from(self.exprs.len()).expect("fewer than 2^32 numbers fit in memory");
        self.exprs.push(kept);
        if let Some(fingerprint) = fingerprint {
            self.by_fingerprint.insert(fingerprint, number);
        }
        self.by_expr.insert(kept, Some(Coefficient { negative: false, number }));
        Some(Coefficient { negative: is_negative, number })
    }

    pub(super) fn expr(&self, graph: &mut Graph, c: Coefficient) -> ExprId {
        let e = self.exprs[c.number as usize];
        if c.negative { graph.neg(e) } else { e }
    }

    pub(super) fn mul(&mut self, graph: &mut Graph, a: Coefficient, b: Coefficient) -> Coefficient {
        let negative = a.negative ^ b.negative;
        let key = (a.number.min(b.number), a.number.max(b.number));
        if key.0 == 0 {
            return Coefficient { negative, number: key.1 };
        }
        let product = match self.products.get(&key) {
            Some(known) => *known,
            None => {
                let e = graph.mul(self.exprs[key.0 as usize], self.exprs[key.1 as usize]);
                let product = self.of(graph, e).expect("a product of numbers that are not zero");
                self.products.insert(key, product);
                product
            }
        };
        product.signed_by(negative)
    }

    /// `a / b`; none where a value of the parameters could make a denominator vanish that is not there already.
    pub(super) fn div(&mut self, graph: &mut Graph, a: Coefficient, b: Coefficient) -> Option<Coefficient> {
        let negative = a.negative ^ b.negative;
        let key = (a.number, b.number);
        if b.number == 0 {
            return Some(Coefficient { negative, number: a.number });
        }
        if a.number == b.number {
            return Some(Coefficient::ONE.signed_by(negative));
        }
        let quotient = match self.quotients.get(&key) {
            Some(known) => *known,
            None => {
                let quotient = self.quotient(graph, key);
                self.quotients.insert(key, quotient);
                quotient
            }
        };
        quotient.map(|q| q.signed_by(negative))
    }

    /// `c / d^n` where the value is infinite for `d = 0` anyway.
    fn over(&mut self, graph: &mut Graph, c: Coefficient, d: Coefficient, n: u32) -> Option<Coefficient> {
        if d.number == 0 {
            return Some(c.signed_by(d.negative && n % 2 == 1));
        }
        let (c, d) = (self.expr(graph, c), self.expr(graph, d));
        let power = graph.power_product(&[(d, -Rational::from_integer(n.into()))]).ok()?;
        let e = graph.mul(c, power);
        self.of(graph, e)
    }

    fn quotient(&mut self, graph: &mut Graph, (a, b): (u32, u32)) -> Option<Coefficient> {
        let (a, divisor) = (self.exprs[a as usize], self.exprs[b as usize]);
        let reciprocal = self.reciprocals.entry(b);
        let reciprocal =
            reciprocal.or_insert_with(|| graph.power_product(&[(divisor, -Rational::one())]).ok());
        let e = graph.mul(a, (*reciprocal)?);
        let denominators = |e: ExprId| -> Vec<(ExprId, Rational)> {
            match graph.node(e) {
                Node::Product { factors, .. } => {
                    factors.iter().filter(|(_, q)| q.is_negative()).cloned().collect()
                }
                _ => Vec::new(),
            }
        };
        let there = denominators(a);
        let is_safe = denominators(e).iter().all(|(base, q)| {
            there.iter().any(|(other, p)| other == base && p <= q)
                || remembered_sign_of(graph, *base, &self.signs, &mut self.found_signs).is_definite()
        });
        if is_safe { self.of(graph, e) } else { None }
    }

    /// Whether a number is known to be positive.
    pub(super) fn is_positive(&mut self, graph: &mut Graph, c: Coefficient) -> bool {
        let e = self.expr(graph, c);
        remembered_sign_of(graph, e, &self.signs, &mut self.found_signs) == Sign::Positive
    }

    /// `a + b`; none for zero.
    pub(super) fn add(&mut self, graph: &mut Graph, a: Coefficient, b: Coefficient) -> Option<Coefficient> {
        let key = (a.min(b), a.max(b));
        if let Some(known) = self.sums.get(&key) {
            return *known;
        }
        let (x, y) = (self.expr(graph, a), self.expr(graph, b));
        let e = graph.add(x, y);
        let sum = self.of(graph, e);
        self.sums.insert(key, sum);
        sum
    }
}

/// Product of two monomials.
pub(super) fn times(a: &Monomial, b: &Monomial) -> Monomial {
    let mut product = Vec::with_capacity(a.len() + b.len());
    let (mut i, mut j) = (0, 0);
    while i < a.len() || j < b.len() {
        match (a.get(i), b.get(j)) {
            (Some(x), Some(y)) if x.0 == y.0 => {
                let q = x.1 + y.1;
                if !q.is_zero() {
                    product.push((x.0, q));
                }
                i += 1;
                j += 1;
            }
            (Some(x), y) if y.is_none_or(|y| x.0 < y.0) => {
                product.push(*x);
                i += 1;
            }
            (_, Some(y)) => {
                product.push(*y);
                j += 1;
            }
            (_, None) => unreachable!("one of the two has entries left"),
        }
    }
    product
}

/// `m^q` with an integer or fractional `q` other than zero.
fn raised(m: &Monomial, q: Exponent) -> Monomial {
    m.iter().map(|(atom, e)| (*atom, e * q)).collect()
}

/// Polynomials that build on one another, and the numbers and atoms in them.
#[derive(Debug)]
pub(super) struct System {
    pub(super) numbers: Numbers,
    atoms: Vec<Atom>,
    atom_index: HashMap<Atom, u32>,
    /// Pairs of atoms `sin a`, `cos a`, and of inputs that lie on a circle.
    circles: Vec<(u32, u32)>,
    /// Terms summed so far: a measure of work that is the same on every machine.
    pub(super) work: usize,
    /// Terms looked at for other units so far.
    pub(super) work_on_units: usize,
}

/// A larger polynomial is not made by multiplying out.
pub(super) const MAX_TERMS: usize = 120;
/// Nothing is multiplied out any more once this many terms of numbers were computed.
///
/// Numbers of a dense metric with parameters grow with every product; the most that was seen in a scene of `models/specs` is
/// 42 679 (`kirchhoff_body`, derivatives), and not every scene was looked at.
const MAX_NUMBER_WORK: usize = 100_000;
/// A higher power of a sum is not multiplied out.
const MAX_POWER: i32 = 4;

impl System {
    pub(super) fn new(graph: &Graph, signs: &BTreeMap<ExprId, Sign>) -> System {
        System {
            numbers: Numbers::new(graph, signs),
            atoms: Vec::new(),
            atom_index: HashMap::new(),
            circles: Vec::new(),
            work: 0,
            work_on_units: 0,
        }
    }

    pub(super) fn atom(&self, k: u32) -> Atom {
        self.atoms[k as usize]
    }

    pub(super) fn atom_of(&mut self, atom: Atom) -> u32 {
        if let Some(known) = self.atom_index.get(&atom) {
            return *known;
        }
        let k = u32::try_from(self.atoms.len()).expect("fewer than 2^32 atoms fit in memory");
        self.atoms.push(atom);
        self.atom_index.insert(atom, k);
        if let Atom::Function(f @ (Func::Sin | Func::Cos), a) = atom {
            let other = if f == Func::Sin { Func::Cos } else { Func::Sin };
            if let Some(partner) = self.atom_index.get(&Atom::Function(other, a)) {
                self.circles.push(if f == Func::Sin { (k, *partner) } else { (*partner, k) });
            }
        }
        k
    }

    /// Two inputs with `cosine^2 + sine^2 = 1`.
    pub(super) fn relate(&mut self, cosine: ExprId, sine: ExprId) {
        let pair = (self.atom_of(Atom::Input(sine)), self.atom_of(Atom::Input(cosine)));
        self.circles.push(pair);
    }

    /// The polynomials that an atom needs.
    pub(super) fn needs(&self, atom: u32) -> impl Iterator<Item = usize> + use<> {
        let needed = match self.atom(atom) {
            Atom::Input(_) => [None, None],
            Atom::Poly(k) | Atom::Function(_, k) => [Some(k), None],
            Atom::Atan2(y, x) => [Some(y), Some(x)],
        };
        needed.into_iter().flatten().map(|k| k as usize)
    }

    /// Whether `sin^2 a` and `cos^2 a` are the two monomials.
    pub(super) fn is_circle(&self, a: &Monomial, b: &Monomial) -> bool {
        let two = Exponent::from_integer(2);
        let ([(x, p)], [(y, q)]) = (a.as_slice(), b.as_slice()) else { return false };
        *p == two && *q == two && (self.circles.contains(&(*x, *y)) || self.circles.contains(&(*y, *x)))
    }

    /// Sums terms, and `sin^2 a + cos^2 a` where both have the same coefficient.
    pub(super) fn collect(
        &mut self,
        graph: &mut Graph,
        terms: impl IntoIterator<Item = (Monomial, Coefficient)>,
    ) -> Polynomial {
        let mut sum: BTreeMap<Monomial, Coefficient> = BTreeMap::new();
        for (m, c) in terms {
            self.work += 1;
            self.add_term(graph, &mut sum, m, c);
        }
        let two = Exponent::from_integer(2);
        // What is put in below has no powers that are not there by now.
        let is_square = |q: &Exponent| *q >= two && q.is_integer();
        let squares: BTreeSet<u32> =
            sum.keys().flatten().filter(|(_, q)| is_square(q)).map(|(atom, _)| *atom).collect();
        for (s, c) in self.circles.clone().into_iter().filter(|(s, _)| squares.contains(s)) {
            loop {
                let without = |m: &Monomial, atom: u32| -> Option<Monomial> {
                    let (_, q) = m.iter().find(|(a, _)| *a == atom)?;
                    (*q >= two && q.is_integer()).then(|| times(m, &vec![(atom, -two)]))
                };
                let found = sum.iter().find_map(|(m, coefficient)| {
                    let rest = without(m, s)?;
                    let partner = times(&rest, &vec![(c, two)]);
                    (sum.get(&partner) == Some(coefficient)).then(|| (m.clone(), partner, rest, *coefficient))
                });
                let Some((m, partner, rest, coefficient)) = found else { break };
                sum.remove(&m);
                sum.remove(&partner);
                self.add_term(graph, &mut sum, rest, coefficient);
            }
        }
        sum.into_iter().collect()
    }

    fn add_term(
        &mut self,
        graph: &mut Graph,
        sum: &mut BTreeMap<Monomial, Coefficient>,
        m: Monomial,
        c: Coefficient,
    ) {
        match sum.get(&m) {
            None => {
                sum.insert(m, c);
            }
            Some(there) => match self.numbers.add(graph, *there, c) {
                Some(total) => {
                    sum.insert(m, total);
                }
                None => {
                    sum.remove(&m);
                }
            },
        }
    }

    /// The polynomial with every power of polynomial `k` in it multiplied out by `value`; none when that is no
    /// polynomial or too large.
    pub(super) fn substitute(
        &mut self,
        graph: &mut Graph,
        target: &Polynomial,
        k: usize,
        value: &Polynomial,
    ) -> Option<Polynomial> {
        let Some(atom) = self.atom_index.get(&Atom::Poly(k as u32)).copied() else {
            return Some(target.clone());
        };
        if self.numbers.are_too_long() {
            return None;
        }
        let mut terms: Polynomial = Vec::new();
        for (m, c) in target {
            let Some(position) = m.iter().position(|(a, _)| *a == atom) else {
                terms.push((m.clone(), *c));
                continue;
            };
            let mut rest = m.clone();
            let (_, q) = rest.remove(position);
            match value.as_slice() {
                [] if q.is_positive() => {}
                [] => return None,
                [(inner, number)] if q.is_integer() => {
                    let n = q.to_integer().unsigned_abs();
                    let total = if q.is_positive() {
                        (0..n).fold(*c, |total, _| self.numbers.mul(graph, total, *number))
                    } else {
                        self.numbers.over(graph, *c, *number, n)?
                    };
                    terms.push((times(&rest, &raised(inner, q)), total));
                }
                several if q.is_integer() && q.is_positive() && q.to_integer() <= MAX_POWER => {
                    let mut product = vec![(rest, *c)];
                    for _ in 0..q.to_integer() {
                        if product.len() * several.len() > 2 * MAX_TERMS {
                            return None;
                        }
                        self.work += product.len() * several.len();
                        let mut next = Vec::with_capacity(product.len() * several.len());
                        for (x, p) in &product {
                            for (y, r) in several {
                                next.push((times(x, y), self.numbers.mul(graph, *p, *r)));
                            }
                        }
                        product = next;
                    }
                    terms.extend(product);
                }
                _ => return None,
            }
            if terms.len() > 2 * MAX_TERMS {
                return None;
            }
        }
        let sum = self.collect(graph, terms);
        (sum.len() <= MAX_TERMS).then_some(sum)
    }

    /// The polynomial divided by a number; none where that could make a denominator vanish.
    pub(super) fn over_number(
        &mut self,
        graph: &mut Graph,
        target: &Polynomial,
        c: Coefficient,
    ) -> Option<Polynomial> {
        target.iter().map(|(m, r)| Some((m.clone(), self.numbers.div(graph, *r, c)?))).collect()
    }

    /// The polynomial with `c` times the atom in its place.
    pub(super) fn times_number(
        &mut self,
        graph: &mut Graph,
        target: &Polynomial,
        atom: u32,
        c: Coefficient,
    ) -> Option<Polynomial> {
        let mut scaled = |(m, r): &(Monomial, Coefficient)| {
            let Some((_, q)) = m.iter().find(|(a, _)| *a == atom) else { return Some((m.clone(), *r)) };
            let n = q.is_integer().then(|| q.to_integer().unsigned_abs())?;
            let total = if q.is_positive() {
                (0..n).fold(*r, |total, _| self.numbers.mul(graph, total, c))
            } else {
                (0..n).try_fold(*r, |total, _| self.numbers.div(graph, total, c))?
            };
            Some((m.clone(), total))
        };
        target.iter().map(&mut scaled).collect()
    }

    /// The polynomials that a polynomial is divided by.
    pub(super) fn denominators(&self, value: &Polynomial) -> BTreeSet<u32> {
        let factors = value.iter().flat_map(|(m, _)| m).filter(|(_, q)| q.is_negative());
        let polynomial = |(atom, _): &(u32, Exponent)| match self.atom(*atom) {
            Atom::Poly(k) => Some(k),
            _ => None,
        };
        factors.filter_map(polynomial).collect()
    }

    /// `a + b/d^n = (a d^n + b)/d^n` with `d^n` multiplied out in `a d^n`, for every denominator for which terms cancel.
    ///
    /// What cancels here is what would have cancelled in digits: `x^2/d^2 - 1/d` with `d = c + x^2` is `-c/d^2`.
    pub(super) fn over_common_denominator(
        &mut self,
        graph: &mut Graph,
        target: &Polynomial,
        denominators: &BTreeMap<u32, Polynomial>,
    ) -> Option<Polynomial> {
        denominators.iter().fold(None, |best: Option<Polynomial>, (k, value)| {
            self.over_denominator(graph, best.as_ref().unwrap_or(target), *k, value).or(best)
        })
    }

    /// `target` over the highest power of polynomial `k` in its denominators, if terms cancel there.
    fn over_denominator(
        &mut self,
        graph: &mut Graph,
        target: &Polynomial,
        k: u32,
        denominator: &Polynomial,
    ) -> Option<Polynomial> {
        let atom = self.atom_of(Atom::Poly(k));
        let exponent =
            |m: &Monomial| m.iter().find(|(a, _)| *a == atom).map_or(Exponent::zero(), |(_, q)| *q);
        let lowest = target.iter().map(|(m, _)| exponent(m)).min()?;
        let mut terms: Polynomial = Vec::new();
        for (m, c) in target {
            let q = exponent(m);
            let n = q - lowest;
            if !n.is_integer() || n > Exponent::from_integer(MAX_POWER) {
                return None;
            }
            let rest: Monomial = m.iter().filter(|(a, _)| *a != atom).copied().collect();
            let mut product = vec![(rest, *c)];
            for _ in 0..n.to_integer() {
                let factors = product.iter().flat_map(|x| denominator.iter().map(move |y| (x, y)));
                let factors: Vec<_> = factors.collect();
                if terms.len() + factors.len() > 2 * MAX_TERMS {
                    return None;
                }
                self.work += factors.len();
                product = factors
                    .into_iter()
                    .map(|((x, p), (y, r))| (times(x, y), self.numbers.mul(graph, *p, *r)))
                    .collect();
            }
            terms.extend(product);
        }
        let n_monomials = terms.iter().map(|(m, _)| m).collect::<HashSet<_>>().len();
        let sum = self.collect(graph, terms);
        if sum.len() >= n_monomials {
            return None;
        }
        let over = sum.into_iter().map(|(m, c)| (times(&m, &vec![(atom, lowest)]), c));
        let mut over: Polynomial = over.collect();
        over.sort();
        Some(over)
    }
}

/// Turns expressions into polynomials; every sum inside a product or function becomes a polynomial of its own.
pub(super) struct Reader<'a> {
    pub(super) system: System,
    pub(super) entries: Vec<Entry>,
    classes: &'a Classes,
    symbols: HashMap<SymbolId, usize>,
    /// Polynomials of inner sums, and those that only name what a function is applied to.
    inner: HashMap<ExprId, usize>,
}

impl<'a> Reader<'a> {
    pub(super) fn new(graph: &Graph, classes: &'a Classes, signs: &BTreeMap<ExprId, Sign>) -> Reader<'a> {
        Reader {
            system: System::new(graph, signs),
            entries: Vec::new(),
            classes,
            symbols: HashMap::new(),
            inner: HashMap::new(),
        }
    }

    fn changes(&self, e: ExprId) -> bool {
        self.classes.get(e) > Class::Param
    }

    /// Reads the value of a definition that changes from call to call.
    pub(super) fn define(
        &mut self,
        graph: &mut Graph,
        symbol: SymbolId,
        section: usize,
        e: ExprId,
    ) -> Result<(), Error> {
        let k = self.read(graph, e)?;
        let entry = &mut self.entries[k];
        if entry.definition.is_none() {
            entry.definition = Some((symbol, section));
        }
        self.symbols.insert(symbol, k);
        Ok(())
    }

    /// The polynomial of an expression.
    pub(super) fn read(&mut self, graph: &mut Graph, root: ExprId) -> Result<usize, Error> {
        // Inner sums first: operands precede the nodes that use them.
        let order = post_order(graph, &[root], |e| self.inner.contains_key(&e) || !self.changes(e));
        let mut separate: HashSet<ExprId> = HashSet::from([root]);
        for e in &order {
            match graph.node(*e) {
                Node::Product { factors, .. } => {
                    let compound =
                        |b: &ExprId| matches!(graph.node(*b), Node::Sum { .. } | Node::Product { .. });
                    separate.extend(factors.iter().map(|(b, _)| *b).filter(compound));
                }
                Node::Function(_, a) => {
                    separate.insert(*a);
                }
                Node::Atan2(y, x) => separate.extend([*y, *x]),
                _ => {}
            }
        }
        // One argument of two may be a number.
        let mut numbers: Vec<ExprId> = Vec::new();
        for e in &order {
            if let Node::Atan2(y, x) = graph.node(*e) {
                numbers.extend([*y, *x].into_iter().filter(|a| !self.changes(*a)));
            }
        }
        for e in numbers.into_iter().chain(order) {
            if separate.contains(&e) && !self.inner.contains_key(&e) {
                let value = self.polynomial(graph, e)?;
                self.inner.insert(e, self.entries.len());
                self.entries.push(Entry { value, definition: None, unit: Coefficient::ONE });
            }
        }
        Ok(self.inner[&root])
    }

    fn polynomial(&mut self, graph: &mut Graph, e: ExprId) -> Result<Polynomial, Error> {
        let (constant, terms) = match graph.node(e).clone() {
            Node::Sum { constant, terms } => (constant, terms.to_vec()),
            _ => (Rational::zero(), vec![(e, Rational::one())]),
        };
        let mut list = Vec::with_capacity(terms.len() + 1);
        for (term, q) in terms {
            let (m, number) = self.monomial(graph, term)?;
            let number = graph.scale(number, &q);
            if let Some(c) = self.system.numbers.of(graph, number) {
                list.push((m, c));
            }
        }
        let constant = graph.rational(constant);
        list.extend(self.system.numbers.of(graph, constant).map(|c| (Vec::new(), c)));
        Ok(self.system.collect(graph, list))
    }

    /// A term as a monomial times a parameter-only expression.
    fn monomial(&mut self, graph: &mut Graph, e: ExprId) -> Result<(Monomial, ExprId), Error> {
        if !self.changes(e) {
            return Ok((Vec::new(), e));
        }
        let (coefficient, factors) = match graph.node(e).clone() {
            Node::Product { coefficient, factors } => (coefficient, factors.to_vec()),
            _ => (Rational::one(), vec![(e, Rational::one())]),
        };
        let mut numbers = Vec::new();
        let mut m = Monomial::new();
        for (base, q) in factors {
            if !self.changes(base) {
                numbers.push((base, q));
                continue;
            }
            let exponent = q.numer().to_i32().zip(q.denom().to_i32()).map(|(n, d)| Exponent::new(n, d));
            let exponent = exponent
                .ok_or_else(|| Error::Program { reason: format!("an exponent does not fit 32 bits: {q}") })?;
            let atom = match graph.node(base).clone() {
                Node::Symbol(s) => match self.symbols.get(&s) {
                    Some(k) => Atom::Poly(*k as u32),
                    None => Atom::Input(base),
                },
                Node::Function(f, a) => Atom::Function(f, self.inner[&a] as u32),
                Node::Atan2(y, x) => Atom::Atan2(self.inner[&y] as u32, self.inner[&x] as u32),
                _ => Atom::Poly(self.inner[&base] as u32),
            };
            let atom = self.system.atom_of(atom);
            m = times(&m, &vec![(atom, exponent)]);
        }
        let number = graph.power_product(&numbers);
        let number = number.map_err(|_| Error::DivisionByZero { place: "a coefficient".into() })?;
        Ok((m, graph.scale(number, &coefficient)))
    }
}
