//! Sparse polynomials in what changes from call to call, with coefficients that depend on parameters alone.
//!
//! A [`System`] of polynomials is the form in which sums are rearranged: monomials are products of [`Atom`]s (inputs,
//! functions, other polynomials) with rational exponents. Does not know: which rearrangement is cheap, what a value is
//! for, how expressions are read.

use std::cell::{OnceCell, RefCell};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Deref;
use std::rc::Rc;

use smallvec::SmallVec;

use rustc_hash::{FxHashMap, FxHashSet};

use super::effort::Effort;
use super::exponent::Exponent;
use super::facts::{Facts, Price};
use super::numbers::{Coefficient, Numbers};
use crate::lower::SearchBudget;
use hamel_expr::{ExprId, Func, Graph, Sign, SymbolId};

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

/// Atoms, by position, with their exponents: sorted, none zero.
pub(super) type Monomial = SmallVec<[(u32, Exponent); 4]>;

/// Monomials with their coefficients.
pub(super) type Terms = Vec<(Monomial, Coefficient)>;

/// Monomials, sorted and distinct, with their coefficients and facts about them. A copy shares all of it: a
/// search makes thousands of lists of polynomials that differ in one.
#[derive(Clone, Debug, Default)]
pub(super) struct Polynomial(Rc<Shared>);

#[derive(Debug, Default)]
struct Shared {
    terms: Terms,
    /// Polynomials that it is made of, in the order in which they are met.
    needs: OnceCell<Box<[u32]>>,
    price: OnceCell<Price>,
    /// Of the extractor that asked last.
    facts: RefCell<Option<Facts>>,
}

impl Deref for Polynomial {
    type Target = [(Monomial, Coefficient)];

    fn deref(&self) -> &Self::Target {
        &self.0.terms
    }
}

impl From<Terms> for Polynomial {
    fn from(terms: Terms) -> Polynomial {
        Polynomial(Rc::new(Shared { terms, ..Shared::default() }))
    }
}

impl FromIterator<(Monomial, Coefficient)> for Polynomial {
    fn from_iter<I: IntoIterator<Item = (Monomial, Coefficient)>>(terms: I) -> Polynomial {
        Polynomial::from(terms.into_iter().collect::<Terms>())
    }
}

impl PartialEq for Polynomial {
    fn eq(&self, other: &Polynomial) -> bool {
        Rc::ptr_eq(&self.0, &other.0) || self.0.terms == other.0.terms
    }
}

impl Polynomial {
    /// The polynomials that this one is made of, in view or not, in the order in which they are met.
    pub(super) fn needs(&self, system: &System) -> &[u32] {
        self.0.needs.get_or_init(|| {
            let mut found: Vec<u32> = Vec::new();
            let mut seen = BTreeSet::new();
            for (atom, _) in self.0.terms.iter().flat_map(|(m, _)| m) {
                found.extend(system.operands(*atom).filter(|k| seen.insert(*k)));
            }
            found.into()
        })
    }

    /// What the polynomial costs, found once.
    pub(super) fn price(&self, find: impl FnOnce() -> Price) -> &Price {
        self.0.price.get_or_init(find)
    }

    /// Facts that an extractor left here.
    pub(super) fn facts(&self) -> &RefCell<Option<Facts>> {
        &self.0.facts
    }
}

/// A power of an atom as a monomial.
pub(super) fn power(atom: u32, q: Exponent) -> Monomial {
    SmallVec::from_slice(&[(atom, q)])
}

/// A polynomial and where it comes from.
#[derive(Clone, Debug)]
pub(super) struct Entry {
    pub(super) value: Polynomial,
    /// The definition that it is the value of, and its section.
    pub(super) definition: Option<(SymbolId, usize)>,
    /// The unit that it is measured in: the definition's value is this number times the polynomial's.
    pub(super) unit: Coefficient,
}

/// The polynomials behind the roots, each after those that it needs.
pub(super) fn needed(system: &System, entries: &[Entry], roots: &[usize]) -> Vec<usize> {
    let mut order = Vec::new();
    let mut seen = vec![false; entries.len()];
    let mut pending: Vec<(usize, bool)> = roots.iter().rev().map(|k| (*k, false)).collect();
    while let Some((k, ready)) = pending.pop() {
        if ready {
            order.push(k);
            continue;
        }
        if std::mem::replace(&mut seen[k], true) {
            continue;
        }
        pending.push((k, true));
        let operands = entries[k].value.needs(system).iter().rev().filter(|k| system.is_in_view(**k));
        pending.extend(operands.map(|k| (*k as usize, false)).filter(|(k, _)| !seen[*k]));
    }
    order
}

/// Product of two monomials.
pub(super) fn times(a: &[(u32, Exponent)], b: &[(u32, Exponent)]) -> Monomial {
    let mut product = Monomial::with_capacity(a.len() + b.len());
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

/// The powers that two monomials share.
pub(super) fn common(a: &Monomial, b: &Monomial) -> Monomial {
    let mut shared = Monomial::new();
    let mut rest = b.iter().peekable();
    for (atom, p) in a {
        while rest.next_if(|(other, _)| other < atom).is_some() {}
        let Some((_, q)) = rest.next_if(|(other, _)| other == atom) else { continue };
        if p.is_positive() && q.is_positive() {
            shared.push((*atom, *p.min(q)));
        } else if p.is_negative() && q.is_negative() {
            shared.push((*atom, *p.max(q)));
        }
    }
    shared
}

/// `a / b`.
pub(super) fn quotient(a: &Monomial, b: &Monomial) -> Monomial {
    let inverse: Monomial = b.iter().map(|(atom, q)| (*atom, -*q)).collect();
    times(a, &inverse)
}

/// `m^q` with an integer or fractional `q` other than zero.
fn raised(m: &Monomial, q: Exponent) -> Monomial {
    m.iter().map(|(atom, e)| (*atom, *e * q)).collect()
}

/// Polynomials that build on one another, and the numbers and atoms in them.
#[derive(Debug)]
pub(super) struct System {
    pub(super) numbers: Numbers,
    atoms: Vec<Atom>,
    atom_index: FxHashMap<Atom, u32>,
    /// Pairs of atoms `sin a`, `cos a`, and of inputs that lie on a circle.
    circles: Vec<(u32, u32)>,
    pub(super) effort: Effort,
    /// Whether each polynomial is out of view, as an input is; empty where all are in view.
    hidden: Vec<bool>,
}

/// A larger polynomial is not made by multiplying out.
pub(super) const MAX_TERMS: usize = 120;
/// A higher power of a sum is not multiplied out.
const MAX_POWER: i32 = 4;

impl System {
    pub(super) fn new(graph: &Graph, signs: &BTreeMap<ExprId, Sign>, budget: &SearchBudget) -> System {
        System {
            numbers: Numbers::new(graph, signs),
            atoms: Vec::new(),
            atom_index: FxHashMap::default(),
            circles: Vec::new(),
            effort: Effort::new(budget),
            hidden: Vec::new(),
        }
    }

    /// Hides all but some of the first `n` polynomials, or none.
    pub(super) fn look_at(&mut self, view: Option<(&BTreeSet<usize>, usize)>) {
        self.hidden = match view {
            Some((seen, n)) => (0..n).map(|k| !seen.contains(&k)).collect(),
            None => Vec::new(),
        };
    }

    /// Whether a polynomial is not hidden.
    pub(super) fn is_in_view(&self, k: u32) -> bool {
        !self.hidden.get(k as usize).copied().unwrap_or(false)
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

    /// Whether numbers have become so long that nothing more is to be multiplied out.
    pub(super) fn numbers_are_too_long(&mut self) -> bool {
        self.effort.has_long_numbers(self.numbers.n_terms)
    }

    /// Two inputs with `cosine^2 + sine^2 = 1`.
    pub(super) fn relate(&mut self, cosine: ExprId, sine: ExprId) {
        let pair = (self.atom_of(Atom::Input(sine)), self.atom_of(Atom::Input(cosine)));
        self.circles.push(pair);
    }

    /// The polynomials that an atom is made of.
    fn operands(&self, atom: u32) -> impl Iterator<Item = u32> + use<> {
        let operands = match self.atom(atom) {
            Atom::Input(_) => [None, None],
            Atom::Poly(k) | Atom::Function(_, k) => [Some(k), None],
            Atom::Atan2(y, x) => [Some(y), Some(x)],
        };
        operands.into_iter().flatten()
    }

    /// The polynomials in view that an atom needs.
    pub(super) fn needs(&self, atom: u32) -> impl Iterator<Item = usize> + use<'_> {
        self.operands(atom).filter(|k| self.is_in_view(*k)).map(|k| k as usize)
    }

    /// Whether `sin^2 a` and `cos^2 a` are the two monomials.
    pub(super) fn is_circle(&self, a: &Monomial, b: &Monomial) -> bool {
        let two = Exponent::whole(2);
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
            self.effort.terms += 1;
            self.add_term(graph, &mut sum, m, c);
        }
        let two = Exponent::whole(2);
        // What is put in below has no powers that are not there by now.
        let is_square = |q: &Exponent| *q >= two && q.is_whole();
        let squares: BTreeSet<u32> =
            sum.keys().flatten().filter(|(_, q)| is_square(q)).map(|(atom, _)| *atom).collect();
        for (s, c) in self.circles.clone().into_iter().filter(|(s, _)| squares.contains(s)) {
            loop {
                let without = |m: &Monomial, atom: u32| -> Option<Monomial> {
                    let (_, q) = m.iter().find(|(a, _)| *a == atom)?;
                    (*q >= two && q.is_whole()).then(|| times(m, &power(atom, -two)))
                };
                let found = sum.iter().find_map(|(m, coefficient)| {
                    let rest = without(m, s)?;
                    let partner = times(&rest, &power(c, two));
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
        if self.numbers_are_too_long() {
            return None;
        }
        let mut terms = Terms::new();
        for (m, c) in target.iter() {
            let Some(position) = m.iter().position(|(a, _)| *a == atom) else {
                terms.push((m.clone(), *c));
                continue;
            };
            let mut rest = m.clone();
            let (_, q) = rest.remove(position);
            match &**value {
                [] if q.is_positive() => {}
                [] => return None,
                [(inner, number)] if q.is_whole() => {
                    let n = q.truncated().unsigned_abs();
                    let total = if q.is_positive() {
                        (0..n).fold(*c, |total, _| self.numbers.mul(graph, total, *number))
                    } else {
                        self.numbers.over(graph, *c, *number, n)?
                    };
                    terms.push((times(&rest, &raised(inner, q)), total));
                }
                several if q.is_whole() && q.is_positive() && q.truncated() <= MAX_POWER => {
                    let mut product = vec![(rest, *c)];
                    for _ in 0..q.truncated() {
                        if product.len() * several.len() > 2 * MAX_TERMS {
                            return None;
                        }
                        self.effort.terms += product.len() * several.len();
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
            let n = q.is_whole().then(|| q.truncated().unsigned_abs())?;
            let total = if q.is_positive() {
                (0..n).fold(*r, |total, _| self.numbers.mul(graph, total, c))
            } else {
                (0..n).try_fold(*r, |total, _| self.numbers.div(graph, total, c))?
            };
            Some((m.clone(), total))
        };
        target.iter().map(&mut scaled).collect()
    }

    /// The polynomials in view that a polynomial is divided by.
    pub(super) fn denominators(&self, value: &Polynomial) -> BTreeSet<u32> {
        let factors = value.iter().flat_map(|(m, _)| m).filter(|(_, q)| q.is_negative());
        let polynomial = |(atom, _): &(u32, Exponent)| match self.atom(*atom) {
            Atom::Poly(k) if self.is_in_view(k) => Some(k),
            _ => None,
        };
        factors.filter_map(polynomial).collect()
    }

    /// `a + b/d^n = (a d^n + b)/d^n` with `d^n` multiplied out in `a d^n`, for every denominator for which terms
    /// cancel.
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
        let exponent = |m: &Monomial| m.iter().find(|(a, _)| *a == atom).map_or(Exponent::ZERO, |(_, q)| *q);
        let lowest = target.iter().map(|(m, _)| exponent(m)).min()?;
        let mut terms = Terms::new();
        for (m, c) in target.iter() {
            let q = exponent(m);
            let n = q - lowest;
            if !n.is_whole() || n > Exponent::whole(MAX_POWER) {
                return None;
            }
            let rest: Monomial = m.iter().filter(|(a, _)| *a != atom).copied().collect();
            let mut product = vec![(rest, *c)];
            for _ in 0..n.truncated() {
                let factors = product.iter().flat_map(|x| denominator.iter().map(move |y| (x, y)));
                let factors: Vec<_> = factors.collect();
                if terms.len() + factors.len() > 2 * MAX_TERMS {
                    return None;
                }
                self.effort.terms += factors.len();
                product = factors
                    .into_iter()
                    .map(|((x, p), (y, r))| (times(x, y), self.numbers.mul(graph, *p, *r)))
                    .collect();
            }
            terms.extend(product);
        }
        let n_monomials = terms.iter().map(|(m, _)| m).collect::<FxHashSet<_>>().len();
        let sum = self.collect(graph, terms);
        if sum.len() >= n_monomials {
            return None;
        }
        let over = sum.iter().map(|(m, c)| (times(m, &power(atom, lowest)), *c));
        let mut over: Terms = over.collect();
        over.sort();
        Some(over.into())
    }
}
