//! What arguments of functions, bases of roots and of logarithms are made of, and proofs that nothing ties them.
//!
//! Proofs are by values at [`FURTHER`] points of the field. Terms of which a combination with rational coefficients
//! is constant have values with that relation at every point; bases of which a product is a square, or a constant
//! times one, have values whose quadratic characters have a product that is the same at every point. Where linear
//! algebra on the values sees no such relation, there is none. Where it sees one, terms are written by it; bases may
//! be tied, and are not relied on.
//!
//! Deliberately does not know: where the values come from, zero tests.

use num_bigint::BigInt;
use num_traits::{One, Signed, ToPrimitive, Zero};
use rustc_hash::FxHashMap;

use super::arena::Arena;
use super::field;
use super::fingerprint::{first_values, has_even_denominator, is_character, scale, steps};
use super::knowledge::{Base, Doubts, FURTHER, FreeBase, Generator, PI, POINTS, Parts, Term, Terms, UNIT};
use super::node::{ExprId, Func, Node, content};
use super::rational::Rational;

/// Values at the further points tell at most this many terms from each other, unless all terms are monomials.
const MAX_TERMS: usize = FURTHER - 8;

/// Values at the further points tell at most this many bases from each other.
const MAX_BASES: usize = FURTHER - 16;

/// Products and definitions through which the bases behind a base are followed.
const MAX_DEPTH: usize = 32;

/// An argument with more parts is not taken apart.
const MAX_PARTS: usize = 1000;

impl Arena {
    /// Learns what the values of a node need, before it gets any.
    pub(super) fn learn(&mut self, node: &Node) {
        match node {
            Node::Product { factors, .. } => self.learn_bases(factors),
            Node::Function(Func::Ln, a) => self.learn_logarithm(*a),
            Node::Function(f, a) if is_character(*f) => self.learn_argument(*a),
            Node::Function(Func::Stumpff(_), square) => self.learn_root(*square),
            _ => {}
        }
    }

    /// `c_k(x^2)` is made of sine and cosine of `x`, and is given their values, so that no relation between them is
    /// lost.
    fn learn_root(&mut self, square: ExprId) {
        if self.knowledge().roots.contains_key(&square) {
            return;
        }
        let terms = self.root_of(square).and_then(|(q, root)| {
            let terms = match &root {
                Term::Expr(base) => self.terms_of(*base)?,
                Term::Product(_) => self.combination_of(root)?,
            };
            Some(terms.into_iter().map(|(k, c)| (k, c * &q)).collect::<Terms>())
        });
        let terms = terms.filter(|terms| terms.iter().all(|(k, q)| *k == PI || steps(q).is_some()));
        self.knowledge_mut().roots.insert(square, terms);
    }

    /// The root of a product of even powers, with its coefficient before it.
    fn root_of(&self, square: ExprId) -> Option<(Rational, Term)> {
        let Node::Product { coefficient, factors } = self.node(self.named(square)) else { return None };
        let root = |n: &BigInt| (!n.is_negative()).then(|| n.sqrt()).filter(|root| root * root == *n);
        let coefficient = Rational::new(root(coefficient.numer())?, root(coefficient.denom())?);
        let two = Rational::from_integer(2.into());
        let halved = factors.iter().map(|(base, q)| Some((*base, q / &two)).filter(|(_, q)| q.is_integer()));
        let factors = halved.collect::<Option<Box<[_]>>>()?;
        Some(match &*factors {
            [(base, power)] if power.is_one() => (coefficient, Term::Expr(*base)),
            _ => (coefficient, Term::Product(factors)),
        })
    }

    fn learn_bases(&mut self, factors: &[(ExprId, Rational)]) {
        for (base, q) in factors {
            if has_even_denominator(q) {
                self.learn_base(*base);
            }
        }
    }

    fn learn_argument(&mut self, a: ExprId) {
        if self.knowledge().arguments.contains_key(&a) {
            return;
        }
        let terms = self.terms_of(a);
        self.knowledge_mut().arguments.insert(a, terms);
    }

    fn terms_of(&mut self, a: ExprId) -> Option<Terms> {
        let mut total: FxHashMap<u32, Rational> = FxHashMap::default();
        let mut pending = vec![(a, Rational::one())];
        let mut n_parts = 0;
        while let Some((e, q)) = pending.pop() {
            n_parts += 1;
            if n_parts > MAX_PARTS {
                return None;
            }
            let mut add = |k: u32, q: Rational| *total.entry(k).or_insert_with(Rational::zero) += q;
            let term = match self.node(e) {
                Node::Constant(c) => {
                    add(UNIT, c * q);
                    continue;
                }
                Node::Pi => {
                    add(PI, q);
                    continue;
                }
                Node::Sum { constant, terms } => {
                    add(UNIT, constant * &q);
                    pending.extend(terms.iter().map(|(t, c)| (*t, c * &q)));
                    continue;
                }
                Node::Symbol(s) => match self.definition(*s) {
                    Some(definition) => {
                        pending.push((definition, q));
                        continue;
                    }
                    None => (Term::Expr(e), q),
                },
                Node::Product { coefficient, factors } => match &**factors {
                    [(base, exponent)] if exponent.is_one() => {
                        pending.push((*base, coefficient * q));
                        continue;
                    }
                    _ => (Term::Product(factors.clone()), coefficient * q),
                },
                Node::Function(..) | Node::Atan2(..) => (Term::Expr(e), q),
            };
            let (term, q) = term;
            for (k, c) in self.combination_of(term)? {
                *total.entry(k).or_insert_with(Rational::zero) += c * &q;
            }
        }
        let mut terms: Terms = total.into_iter().filter(|(_, q)| !q.is_zero()).collect();
        terms.sort_unstable_by_key(|(k, _)| *k);
        terms.iter().all(|(k, q)| *k == PI || steps(q).is_some()).then_some(terms)
    }

    /// A term as a combination of those that are independent; none if it cannot be told.
    fn combination_of(&mut self, term: Term) -> Option<Terms> {
        if let Some(known) = self.knowledge().terms.get(&term) {
            return known.clone();
        }
        let found = self.new_combination(&term);
        self.knowledge_mut().terms.insert(term, found.clone());
        found
    }

    fn new_combination(&mut self, term: &Term) -> Option<Terms> {
        if self.knowledge().generators.is_empty() {
            let (unit, pi) = (Term::Expr(Arena::ONE), Term::Expr(Arena::ONE));
            for (term, value) in [(unit, Node::Constant(Rational::one())), (pi, Node::Pi)] {
                let scales = Some(Box::new(first_values(self, &value).map(|v| v.map(scale))));
                let behind = Vec::new();
                let generator = Generator {
                    term,
                    behind,
                    logarithm_of: None,
                    is_monomial: true,
                    is_proved: true,
                    scales,
                };
                self.knowledge_mut().generators.push(generator);
            }
        }
        let is_symbol = |e: ExprId| {
            matches!(self.node(e), Node::Symbol(s) if self.definition(*s).is_none())
                || *self.node(e) == Node::Pi
        };
        let is_monomial = match term {
            Term::Expr(e) => is_symbol(*e),
            Term::Product(factors) => factors.iter().all(|(e, q)| q.is_integer() && is_symbol(*e)),
        };
        if let Term::Product(factors) = term {
            let factors = factors.clone();
            self.learn_bases(&factors);
        }
        if !(is_monomial && self.knowledge().generators.iter().all(|g| g.is_monomial)) {
            let n = self.knowledge().generators.len();
            if n >= MAX_TERMS {
                return None;
            }
            let values = self.values_of_term(term)?;
            let mut known = Vec::new();
            for k in 0..n as u32 {
                known.push(match k {
                    UNIT => vec![Some(field::ONE); FURTHER],
                    PI => self.further_values_of_node(&Node::Pi),
                    _ => {
                        let term = self.knowledge().generators[k as usize].term.clone();
                        self.values_of_term(&term)?
                    }
                });
            }
            match dependence(&known, &values)? {
                Dependence::None => {}
                Dependence::On(coefficients) => {
                    let rational = |(k, c): (usize, u64)| Some((k as u32, field::as_small_rational(c)?));
                    return coefficients
                        .into_iter()
                        .enumerate()
                        .filter(|(_, c)| *c != 0)
                        .map(rational)
                        .collect();
                }
            }
        }
        let (logarithm_of, doubts) = match term {
            Term::Expr(e) => {
                let base = match self.node(*e) {
                    Node::Function(Func::Ln, base) => Some(*base),
                    _ => None,
                };
                (base, self.doubts(*e))
            }
            Term::Product(factors) => {
                let behind = factors.iter().fold(Doubts::default(), |all, (e, _)| all.and(self.doubts(*e)));
                (None, term.node().map_or(behind, |node| behind.and(self.own_doubts(&node))))
            }
        };
        if let Some(base) = logarithm_of {
            // Powers of even denominator are roots.
            self.learn_base(base);
        }
        let scales = (!doubts.signed).then(|| {
            let values = match term {
                Term::Expr(e) => *self.fingerprint(*e),
                Term::Product(_) => term.node().map_or([None; POINTS], |node| first_values(self, &node)),
            };
            Box::new(values.map(|v| v.map(scale)))
        });
        let k = u32::try_from(self.knowledge().generators.len()).ok()?;
        let is_proved = !doubts.signed;
        let mut behind = Vec::new();
        if let Some(node) = term.node() {
            self.behind(&node, |e| behind.push(e));
        }
        let generator =
            Generator { term: term.clone(), behind, logarithm_of, is_monomial, is_proved, scales };
        self.knowledge_mut().generators.push(generator);
        Some(vec![(k, Rational::one())])
    }

    fn values_of_term(&mut self, term: &Term) -> Option<Vec<Option<u64>>> {
        match term {
            Term::Expr(e) => self.further_values(*e),
            Term::Product(factors) => {
                let node = Node::Product { coefficient: Rational::one(), factors: factors.clone() };
                let mut behind = Vec::new();
                self.behind(&node, |e| behind.push(e));
                for e in behind {
                    self.further_values(e)?;
                }
                Some(self.further_values_of_node(&node))
            }
        }
    }

    fn learn_base(&mut self, base: ExprId) -> Base {
        self.base_behind(base, MAX_DEPTH)
    }

    /// As [`Arena::learn_base`], through so many products and definitions.
    fn base_behind(&mut self, base: ExprId, depth: usize) -> Base {
        if let Some(known) = self.knowledge().bases.get(&base) {
            return *known;
        }
        let found = if depth == 0 { self.tied_or_free(base) } else { self.new_base(base, depth - 1) };
        self.knowledge_mut().bases.insert(base, found);
        found
    }

    fn new_base(&mut self, base: ExprId, depth: usize) -> Base {
        match self.node(base).clone() {
            Node::Symbol(s) => match self.definition(s) {
                Some(definition) => self.base_behind(definition, depth),
                None => self.tied_or_free(base),
            },
            Node::Constant(c) if field::has_consistent_root(&c) => Base::Free,
            Node::Constant(_) => Base::Opaque,
            // sqrt(c prod_k b_k^n_k) = sqrt(c) prod_k sqrt(b_k)^n_k.
            Node::Product { coefficient, factors } => {
                if !field::has_consistent_root(&coefficient) {
                    return if coefficient.is_positive() { Base::Opaque } else { self.tied_or_free(base) };
                }
                let mut worst = Base::Free;
                for (factor, n) in &factors {
                    let is_positive = self.knowledge().bases.get(factor) == Some(&Base::Free);
                    let found = match (n.is_integer(), n.numer().bit(0)) {
                        // An even power of what is positive anyway.
                        (true, false) if is_positive => Base::Free,
                        (true, false) => Base::UpToSign,
                        // Factors are taken apart once.
                        _ if self.factors_of_base(*factor).is_some() => Base::UpToSign,
                        _ => self.base_behind(*factor, depth),
                    };
                    worst = match (worst, found) {
                        (Base::Opaque, _) | (_, Base::Opaque) => Base::Opaque,
                        (Base::UpToSign, _) | (_, Base::UpToSign) => Base::UpToSign,
                        _ => Base::Free,
                    };
                }
                worst
            }
            Node::Function(Func::Exp, a) => {
                let knowledge = self.knowledge();
                let is_square = knowledge
                    .argument(a)
                    .is_some_and(|terms| terms.iter().all(|(k, _)| knowledge.logarithm_term(*k).is_none()));
                if is_square { Base::Free } else { self.tied_or_free(base) }
            }
            _ => self.tied_or_free(base),
        }
    }

    fn tied_or_free(&mut self, base: ExprId) -> Base {
        let Some(values) = self.further_values(base) else { return Base::Opaque };
        let mut known = std::mem::take(&mut self.knowledge_mut().free_bases);
        let is_free = is_free(&mut known, values, field::has_consistent_root);
        self.knowledge_mut().free_bases = known;
        if is_free { Base::Free } else { Base::UpToSign }
    }

    fn learn_logarithm(&mut self, a: ExprId) {
        if self.knowledge().logarithms.contains_key(&a) {
            return;
        }
        let parts = self.parts_of(a);
        self.knowledge_mut().logarithms.insert(a, parts);
    }

    fn parts_of(&mut self, a: ExprId) -> Option<Parts> {
        let mut parts = Parts { are_free: true, ..Parts::default() };
        let mut pending = vec![(a, Rational::one())];
        let mut n_parts = 0;
        while let Some((e, q)) = pending.pop() {
            n_parts += 1;
            if n_parts > MAX_PARTS {
                return None;
            }
            match self.node(e).clone() {
                Node::Constant(c) => parts.add_constant(&c, &q)?,
                Node::Product { coefficient, factors } => {
                    parts.add_constant(&coefficient, &q)?;
                    pending.extend(factors.iter().map(|(base, n)| (*base, n * &q)));
                }
                Node::Function(Func::Exp, exponent) => parts.exponents.push((exponent, q)),
                Node::Symbol(s) if self.definition(s).is_some() => {
                    pending.extend(self.definition(s).map(|definition| (definition, q)));
                }
                node => {
                    let content = match &node {
                        Node::Sum { constant, terms } => content(constant, terms)?.abs(),
                        _ => Rational::one(),
                    };
                    parts.add_constant(&content, &q)?;
                    parts.are_free &= self.has_free_logarithm(e, &content);
                    parts.bases.push((e, q, content));
                }
            }
        }
        Some(parts)
    }

    fn has_free_logarithm(&mut self, base: ExprId, content: &Rational) -> bool {
        let Some(values) = self.further_values(base) else { return false };
        let Some(inverse) = field::rational(&content.recip()) else { return false };
        let values = values.into_iter().map(|v| v.map(|v| field::mul(v, inverse))).collect();
        let mut known = std::mem::take(&mut self.knowledge_mut().free_logarithms);
        let is_free = is_free(&mut known, values, Rational::is_one);
        self.knowledge_mut().free_logarithms = known;
        is_free
    }
}

impl Parts {
    /// `q ln c` for a positive number with small primes; none for others.
    fn add_constant(&mut self, c: &Rational, q: &Rational) -> Option<()> {
        if c.is_one() {
            return Some(());
        }
        let n = q.is_integer().then(|| q.numer().to_i64()).flatten().filter(|_| c.is_positive())?;
        for (number, sign) in [(c.numer(), n), (c.denom(), -n)] {
            let mut rest = number.clone();
            for prime in field::RATIONAL_SQUARES {
                let divisor = BigInt::from(prime);
                while num_integer::Integer::is_multiple_of(&rest, &divisor) {
                    rest /= &divisor;
                    self.primes.push((prime, sign));
                }
            }
            if !rest.is_one() {
                return None;
            }
        }
        Some(())
    }
}

/// Whether nothing ties a base to those known; it becomes one of them then. What is one of them, but for a number
/// that does not matter, is not tied by more.
fn is_free(
    known: &mut Vec<FreeBase>,
    values: Vec<Option<u64>>,
    does_not_matter: impl Fn(&Rational) -> bool,
) -> bool {
    let (mut is_no_square, mut is_valid) = (0_u64, 0_u64);
    for (k, value) in values.iter().enumerate() {
        if let Some(value) = value.filter(|v| *v != 0) {
            is_valid |= 1 << k;
            is_no_square |= u64::from(!field::is_square(value)) << k;
        }
    }
    let is_multiple = |base: &FreeBase| {
        let both: Vec<(u64, u64)> =
            base.values.iter().zip(&values).filter_map(|(a, b)| Some(((*a)?, (*b)?))).collect();
        let Some((a, b)) = both.first().filter(|(a, _)| *a != 0 && both.len() >= 8) else { return false };
        both.iter().all(|(c, d)| field::mul(*a, *d) == field::mul(*c, *b))
            && field::inverse(*a)
                .and_then(|a| field::as_small_rational(field::mul(*b, a)))
                .is_some_and(|q| does_not_matter(&q))
    };
    if known.iter().any(is_multiple) {
        return true;
    }
    if known.len() >= MAX_BASES {
        return false;
    }
    // A product that is a constant times a square has one character everywhere: the constant's.
    let valid = known.iter().fold(is_valid, |all, base| all & base.is_valid);
    let mut basis: Vec<u64> = Vec::new();
    let reduce = |basis: &[u64], vector: u64| basis.iter().fold(vector, |v, row| v.min(v ^ row));
    for vector in std::iter::once(u64::MAX).chain(known.iter().map(|base| base.is_no_square)) {
        let rest = reduce(&basis, vector & valid);
        if rest != 0 {
            basis.push(rest);
            basis.sort_unstable_by(|a, b| b.cmp(a));
        }
    }
    let is_free = reduce(&basis, is_no_square & valid) != 0;
    if is_free {
        known.push(FreeBase { values, is_no_square, is_valid });
    }
    is_free
}

enum Dependence {
    None,
    /// The coefficients.
    On(Vec<u64>),
}

/// Whether values are a combination of independent others, at the points where all have one; none if these are too few.
fn dependence(known: &[Vec<Option<u64>>], new: &[Option<u64>]) -> Option<Dependence> {
    let n = known.len();
    let mut rows: Vec<Vec<u64>> =
        (0..FURTHER).filter_map(|k| known.iter().map(|values| values[k]).chain([new[k]]).collect()).collect();
    if rows.len() < n + 2 {
        return None;
    }
    for column in 0..n {
        let found = (column..rows.len()).find(|k| rows[*k][column] != 0)?;
        rows.swap(found, column);
        let scale = field::inverse(rows[column][column])?;
        rows[column].iter_mut().for_each(|x| *x = field::mul(*x, scale));
        let pivot = rows[column].clone();
        for (k, row) in rows.iter_mut().enumerate() {
            let factor = field::negate(row[column]);
            if k != column && factor != 0 {
                row.iter_mut().zip(&pivot).for_each(|(x, y)| *x = field::add(*x, field::mul(factor, *y)));
            }
        }
    }
    let is_independent = rows[n..].iter().any(|row| row[n] != 0);
    Some(if is_independent {
        Dependence::None
    } else {
        Dependence::On(rows[..n].iter().map(|row| row[n]).collect())
    })
}
