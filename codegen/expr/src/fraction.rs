//! Numbers as quotients of products of polynomials, in which everything that cancels exactly has cancelled.
//!
//! A difference of positive terms such as `a - b^2/c` with `b^2 = a c - d` is `d/c` here, found by exact arithmetic on
//! coefficients: sums are put over their common denominator, multiplied out and divided by what divides them. Products
//! stay products, so that nothing is multiplied out that no sum asks for. Deliberately does not know which form loses
//! fewer digits; see [`super::Samples`].

use std::cmp::Ordering;
use std::collections::BTreeMap;

use num_bigint::BigInt;
use num_integer::Integer;
use num_traits::{One, Signed, ToPrimitive, Zero};
use rustc_hash::{FxHashMap, FxHashSet};

use super::graph::Graph;
use super::node::{ExprId, Node};
use super::rational::Rational;

/// A sum with more terms than this, multiplied out, is kept as it is.
const MAX_TERMS: usize = 400;
/// Products of terms that are made for one number, and for all, before numbers are kept as they are, so that none takes
/// long.
const MAX_WORK: usize = 200_000;
const MAX_TOTAL_WORK: usize = 4_000_000;
/// A higher power is kept as it is.
const MAX_POWER: i64 = 16;

/// Atoms by position with positive exponents, in the order of atoms; compared lexicographically, as division needs it.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Default)]
struct Monomial(Vec<(u32, u32)>);

impl Ord for Monomial {
    fn cmp(&self, other: &Monomial) -> Ordering {
        for ((a, p), (b, q)) in self.0.iter().zip(&other.0) {
            // The smaller atom counts more: one has a power of it and the other has none.
            let order = b.cmp(a).then(p.cmp(q));
            if order != Ordering::Equal {
                return order;
            }
        }
        self.0.len().cmp(&other.0.len())
    }
}

impl PartialOrd for Monomial {
    fn partial_cmp(&self, other: &Monomial) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Monomial {
    fn times(&self, other: &Monomial) -> Monomial {
        let mut powers: BTreeMap<u32, u32> = self.0.iter().copied().collect();
        for (atom, q) in &other.0 {
            *powers.entry(*atom).or_default() += q;
        }
        Monomial(powers.into_iter().collect())
    }

    /// `self / other` where that has no negative power.
    fn over(&self, other: &Monomial) -> Option<Monomial> {
        let mut powers: BTreeMap<u32, u32> = self.0.iter().copied().collect();
        for (atom, q) in &other.0 {
            let there = powers.get_mut(atom)?;
            *there = there.checked_sub(*q)?;
        }
        Some(Monomial(powers.into_iter().filter(|(_, q)| *q > 0).collect()))
    }
}

/// Monomials with coefficients that are not zero.
type Polynomial = BTreeMap<Monomial, BigInt>;

/// `coefficient prod_k atom_k^n_k prod_j factor_j^m_j`; factors are primitive sums that no atom divides.
#[derive(Clone, Debug, Default)]
struct Fraction {
    coefficient: Rational,
    atoms: BTreeMap<u32, i32>,
    factors: BTreeMap<u32, i32>,
}

impl Fraction {
    fn number(coefficient: Rational) -> Fraction {
        Fraction { coefficient, ..Fraction::default() }
    }

    /// `self *= other^n`; none where the power is too high, or zero is divided by.
    fn multiply(&mut self, other: &Fraction, n: i64) -> Option<()> {
        if n.abs() > MAX_POWER || (n < 0 && other.coefficient.is_zero()) {
            return None;
        }
        let n = n.to_i32()?;
        self.coefficient *= num_traits::Pow::pow(&other.coefficient, n);
        for (mine, others) in [(&mut self.atoms, &other.atoms), (&mut self.factors, &other.factors)] {
            for (k, q) in others {
                *mine.entry(*k).or_default() += q * n;
            }
            mine.retain(|_, q| *q != 0);
        }
        Some(())
    }
}

/// Normal forms of numbers, remembered.
#[derive(Debug, Default)]
pub struct Fractions {
    /// What is not taken apart: symbols, functions, roots, and sums that are too long.
    atoms: Vec<ExprId>,
    atom_index: FxHashMap<ExprId, u32>,
    factors: Vec<Polynomial>,
    factor_index: FxHashMap<Polynomial, u32>,
    /// Factors as sums.
    written: FxHashMap<u32, ExprId>,
    read: FxHashMap<ExprId, Fraction>,
    /// Sums in which terms of opposite signs met, themselves or in what they are made of.
    cancelled: FxHashSet<ExprId>,
    /// Products of terms made for the number at hand, and for all before.
    work: usize,
    total_work: usize,
}

impl Fractions {
    /// The number as a quotient in which everything has cancelled that is seen to; the number itself where nothing
    /// does.
    pub fn normal(&mut self, g: &mut Graph, e: ExprId) -> ExprId {
        if self.total_work > MAX_TOTAL_WORK {
            return e;
        }
        self.work = 0;
        for node in g.reachable(&[e]) {
            if !self.read.contains_key(&node) {
                let fraction = self.of_node(g, node).unwrap_or_else(|| self.opaque(node));
                self.read.insert(node, fraction);
            }
        }
        self.total_work += self.work;
        if !self.cancelled.contains(&e) {
            return e;
        }
        let fraction = self.read[&e].clone();
        self.write(g, &fraction).unwrap_or(e)
    }

    /// The number as one quotient, whether anything cancels or not; the number itself where that is too long.
    pub fn quotient(&mut self, g: &mut Graph, e: ExprId) -> ExprId {
        let normal = self.normal(g, e);
        let fraction = self.read.get(&e).cloned();
        fraction.and_then(|fraction| self.write(g, &fraction)).unwrap_or(normal)
    }

    fn atom(&mut self, e: ExprId) -> u32 {
        let next = u32::try_from(self.atoms.len()).expect("fewer than 2^32 atoms fit in memory");
        *self.atom_index.entry(e).or_insert_with(|| {
            self.atoms.push(e);
            next
        })
    }

    fn opaque(&mut self, e: ExprId) -> Fraction {
        let atom = self.atom(e);
        Fraction { atoms: BTreeMap::from([(atom, 1)]), ..Fraction::number(Rational::one()) }
    }

    /// None for what is too long, or divides by zero.
    fn of_node(&mut self, g: &mut Graph, e: ExprId) -> Option<Fraction> {
        match g.node(e).clone() {
            Node::Constant(c) => Some(Fraction::number(c)),
            Node::Pi | Node::Symbol(_) | Node::Function(..) | Node::Atan2(..) => Some(self.opaque(e)),
            Node::Product { coefficient, factors } => {
                let mut product = Fraction::number(coefficient);
                for (base, q) in factors.iter() {
                    if self.cancelled.contains(base) {
                        self.cancelled.insert(e);
                    }
                    if q.is_integer() {
                        let base = self.read[base].clone();
                        product.multiply(&base, q.numer().to_i64()?)?;
                    } else {
                        // A root is an atom of which integer powers are taken.
                        let root = Rational::new(BigInt::one(), q.denom().clone());
                        let root = g.power_product(&[(*base, root)]).ok()?;
                        let root = self.opaque(root);
                        product.multiply(&root, q.numer().to_i64()?)?;
                    }
                }
                Some(product)
            }
            Node::Sum { constant, terms } => {
                let mut list = Vec::with_capacity(terms.len() + 1);
                for (term, q) in terms.iter() {
                    let mut term_read = self.read[term].clone();
                    term_read.coefficient *= q;
                    list.push(term_read);
                    if self.cancelled.contains(term) {
                        self.cancelled.insert(e);
                    }
                }
                list.push(Fraction::number(constant));
                list.retain(|term| !term.coefficient.is_zero());
                let (sum, has_cancelled) = self.sum(&list)?;
                if has_cancelled {
                    self.cancelled.insert(e);
                }
                Some(sum)
            }
        }
    }

    /// The sum over the common denominator, and whether terms cancelled in it.
    fn sum(&mut self, terms: &[Fraction]) -> Option<(Fraction, bool)> {
        let lowest = |of: fn(&Fraction) -> &BTreeMap<u32, i32>| -> BTreeMap<u32, i32> {
            let keys: FxHashSet<u32> = terms.iter().flat_map(|t| of(t).keys().copied()).collect();
            let least = |k: u32| terms.iter().map(|t| of(t).get(&k).copied().unwrap_or(0)).min();
            keys.into_iter().filter_map(|k| least(k).filter(|q| *q != 0).map(|q| (k, q))).collect()
        };
        let (atoms, factors) = (lowest(|t| &t.atoms), lowest(|t| &t.factors));
        let common = Fraction { coefficient: Rational::one(), atoms, factors };
        let denominator =
            terms.iter().fold(BigInt::one(), |lcm, t| Integer::lcm(&lcm, t.coefficient.denom()));
        let mut total = Polynomial::new();
        let mut n_products = 0;
        for term in terms {
            let mut rest = term.clone();
            rest.multiply(&common, -1)?;
            let scaled = &rest.coefficient * Rational::from_integer(denominator.clone());
            let product = self.expanded(&rest, scaled.to_integer())?;
            n_products += product.len();
            for (m, c) in product {
                *total.entry(m).or_default() += c;
            }
            if total.len() > MAX_TERMS {
                return None;
            }
        }
        let n_distinct = total.len();
        total.retain(|_, c| !c.is_zero());
        let mut sum = common;
        sum.coefficient /= Rational::from_integer(denominator);
        // Fewer terms are left than the products had monomials.
        let mut has_cancelled = total.len() < n_distinct;
        if total.is_empty() {
            return Some((Fraction::number(Rational::zero()), true));
        }
        let mut total = primitive(total, &mut sum);
        let mut denominators: Vec<u32> =
            sum.factors.iter().filter(|(_, q)| **q < 0).map(|(k, _)| *k).collect();
        denominators.sort_unstable();
        for k in denominators {
            while total.len() > 1 {
                self.work += total.len() * self.factors[k as usize].len();
                if self.work > MAX_WORK {
                    return None;
                }
                let Some(quotient) = divided(&total, &self.factors[k as usize]) else { break };
                has_cancelled = true;
                total = quotient;
                sum.multiply(&self.factor(k), 1)?;
                if !sum.factors.contains_key(&k) {
                    break;
                }
            }
        }
        if total.len() > 1 {
            let k = self.intern(total);
            sum.multiply(&self.factor(k), 1)?;
        }
        // Where several products had the same monomial, their coefficients were added exactly, too.
        Some((sum, has_cancelled || n_products > n_distinct))
    }

    fn factor(&self, k: u32) -> Fraction {
        Fraction { factors: BTreeMap::from([(k, 1)]), ..Fraction::number(Rational::one()) }
    }

    fn intern(&mut self, factor: Polynomial) -> u32 {
        if let Some(known) = self.factor_index.get(&factor) {
            return *known;
        }
        let k = u32::try_from(self.factors.len()).expect("fewer than 2^32 polynomials fit in memory");
        self.factor_index.insert(factor.clone(), k);
        self.factors.push(factor);
        k
    }

    /// A product without denominators multiplied out, with `coefficient` in the place of its own.
    fn expanded(&mut self, product: &Fraction, coefficient: BigInt) -> Option<Polynomial> {
        let powers = product.atoms.iter().map(|(k, q)| Some((*k, u32::try_from(*q).ok()?)));
        let start = Monomial(powers.collect::<Option<_>>()?);
        let mut total = Polynomial::from([(start, coefficient)]);
        for (k, q) in &product.factors {
            for _ in 0..u32::try_from(*q).ok()? {
                let factor = &self.factors[*k as usize];
                self.work += total.len() * factor.len();
                if self.work > MAX_WORK || total.len() * factor.len() > 16 * MAX_TERMS {
                    return None;
                }
                let mut next = Polynomial::new();
                for (m, c) in &total {
                    for (n, d) in factor {
                        *next.entry(m.times(n)).or_default() += c * d;
                    }
                }
                next.retain(|_, c| !c.is_zero());
                total = next;
            }
        }
        (total.len() <= MAX_TERMS).then_some(total)
    }

    fn write(&mut self, g: &mut Graph, fraction: &Fraction) -> Option<ExprId> {
        let power = |q: &i32| Rational::from_integer((*q).into());
        let mut factors: Vec<(ExprId, Rational)> =
            fraction.atoms.iter().map(|(k, q)| (self.atoms[*k as usize], power(q))).collect();
        for (k, q) in &fraction.factors {
            factors.push((self.written(g, *k), power(q)));
        }
        let product = g.power_product(&factors).ok()?;
        Some(g.scale(product, &fraction.coefficient))
    }

    fn written(&mut self, g: &mut Graph, k: u32) -> ExprId {
        if let Some(known) = self.written.get(&k) {
            return *known;
        }
        let mut terms = Vec::new();
        for (m, c) in &self.factors[k as usize] {
            let powers: Vec<_> =
                m.0.iter()
                    .map(|(k, q)| (self.atoms[*k as usize], Rational::from_integer((*q).into())))
                    .collect();
            let product = g.power_product(&powers).expect("exponents are positive");
            terms.push((product, Rational::from_integer(c.clone())));
        }
        let sum = g.linear_combination(&terms);
        self.written.insert(k, sum);
        sum
    }
}

/// The polynomial without the number and the atoms that divide all of its terms, which go to `outer`; its first term is
/// positive.
fn primitive(polynomial: Polynomial, outer: &mut Fraction) -> Polynomial {
    let mut content = BigInt::zero();
    let mut shared: Option<BTreeMap<u32, u32>> = None;
    for (m, c) in &polynomial {
        content = content.gcd(c);
        let own: BTreeMap<u32, u32> = m.0.iter().copied().collect();
        shared = Some(match shared {
            None => own,
            Some(shared) => {
                let common = |(k, q): (u32, u32)| Some((k, q.min(*own.get(&k)?)));
                shared.into_iter().filter_map(common).collect()
            }
        });
    }
    if polynomial.last_key_value().is_some_and(|(_, c)| c.is_negative()) {
        content = -content;
    }
    let shared = shared.unwrap_or_default();
    for (k, q) in &shared {
        let power = outer.atoms.entry(*k).or_default();
        *power += q.to_i32().unwrap_or(i32::MAX);
    }
    outer.atoms.retain(|_, q| *q != 0);
    outer.coefficient *= Rational::from_integer(content.clone());
    let shared = Monomial(shared.into_iter().collect());
    let over = |m: Monomial| m.over(&shared).expect("shared by all terms");
    polynomial.into_iter().map(|(m, c)| (over(m), c / &content)).collect()
}

/// `a / b` where `b` divides `a`; both are primitive.
fn divided(a: &Polynomial, b: &Polynomial) -> Option<Polynomial> {
    let (lead, c) = b.last_key_value()?;
    let mut rest = a.clone();
    let mut quotient = Polynomial::new();
    while let Some((m, d)) = rest.last_key_value() {
        let factor = m.over(lead)?;
        let (ratio, remainder) = d.div_rem(c);
        if !remainder.is_zero() || quotient.len() >= MAX_TERMS || rest.len() > 4 * MAX_TERMS {
            return None;
        }
        for (n, e) in b {
            let m = factor.times(n);
            let there = rest.entry(m.clone()).or_default();
            *there -= &ratio * e;
            if there.is_zero() {
                rest.remove(&m);
            }
        }
        quotient.insert(factor, ratio);
    }
    Some(quotient)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::Fractions;
    use crate::{ExprId, Graph, Samples, Sign, SymbolId, sign_of};

    type Signs = BTreeMap<ExprId, Sign>;

    /// A graph with positive symbols of these names.
    fn positive(names: &[&str]) -> (Graph, Vec<(SymbolId, Sign)>, Vec<ExprId>, Signs) {
        let mut g = Graph::new();
        let symbols: Vec<_> = names.iter().map(|n| (g.symbol(n), Sign::Positive)).collect();
        let exprs: Vec<ExprId> = symbols.iter().map(|(s, _)| g.sym(*s)).collect();
        let signs = exprs.iter().map(|e| (*e, Sign::Positive)).collect();
        (g, symbols, exprs, signs)
    }

    /// The largest relative error at random points, in units of the roundoff.
    fn loss(g: &Graph, symbols: &[(SymbolId, Sign)], e: ExprId) -> f64 {
        let mut samples = Samples::new(200, symbols);
        let measured = samples.measure(g, e).unwrap();
        measured.iter().map(|m| m.error / m.value.hi().abs()).fold(0.0, f64::max)
    }

    #[test]
    fn the_schur_complement_of_eulers_disk_is_a_quotient_of_positive_terms() {
        // 4 I1 + M r^2 e^2 - M^2 r^4 e^2/(I3 + M r^2) = 4 I1 + M r^2 e^2 I3/(I3 + M r^2)
        let (mut g, symbols, p, signs) = positive(&["I1", "I3", "M", "r", "e"]);
        let [i1, i3, m, r, e] = p[..] else { unreachable!("five symbols") };
        let (r2, e2) = (g.powi(r, 2), g.powi(e, 2));
        let m_r2 = g.mul(m, r2);
        let inertia = g.add(i3, m_r2);
        let four = g.int(4);
        let first = g.mul(four, i1);
        let second = g.mul(m_r2, e2);
        let square = g.powi(m_r2, 2);
        let inverse = g.powi(inertia, -1);
        let third = g.product(&[square, e2, inverse]);
        let third = g.neg(third);
        let difference = g.sum(&[first, second, third]);
        assert_eq!(sign_of(&g, difference, &signs), Sign::Unknown);
        assert!(loss(&g, &symbols, difference) > 1e6);
        let normal = Fractions::default().normal(&mut g, difference);
        assert!(g.is_equal(normal, difference));
        assert_eq!(sign_of(&g, normal, &signs), Sign::Positive);
        assert!(loss(&g, &symbols, normal) < 64.0);
    }

    #[test]
    fn what_has_nothing_to_cancel_stays_as_it_is() {
        let (mut g, _, p, _) = positive(&["a", "b", "c"]);
        let inverse = g.powi(p[1], -1);
        let quotient = g.mul(p[0], inverse);
        let difference = g.sub(quotient, p[2]);
        let mut fractions = Fractions::default();
        assert_eq!(fractions.normal(&mut g, difference), difference);
        let square = g.powi(difference, 2);
        assert_eq!(fractions.normal(&mut g, square), square);
    }

    #[test]
    fn a_difference_that_vanishes_is_zero() {
        // (a^2 - b^2)/(a + b) - a + b
        let (mut g, _, p, _) = positive(&["a", "b"]);
        let squares = [g.powi(p[0], 2), g.powi(p[1], 2)];
        let numerator = g.sub(squares[0], squares[1]);
        let sum = g.add(p[0], p[1]);
        let quotient = g.div(numerator, sum).unwrap();
        let difference = g.sub(p[0], p[1]);
        let e = g.sub(quotient, difference);
        assert_eq!(Fractions::default().normal(&mut g, e), g.zero());
    }

    /// `sum w u^2 - (sum w u v)^2/sum w v^2 = sum_{k<l} w_k w_l (u_k v_l - u_l v_k)^2/sum w v^2` (Lagrange's identity)
    /// for random monomials, where `u` and `v` have one direction in common: then nothing but positive terms is left.
    #[test]
    fn differences_of_positive_terms_that_cancel_become_quotients_of_positive_ones() {
        let mut seed = 7u64;
        let mut random = |n: u64| {
            seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (seed >> 33) % n
        };
        for _ in 0..200 {
            let (mut g, symbols, p, signs) = positive(&["a", "b", "c", "d", "e"]);
            let mut monomial = |g: &mut Graph| {
                let factors: Vec<ExprId> =
                    (0..1 + random(3)).map(|_| p[random(p.len() as u64) as usize]).collect();
                let product = g.product(&factors);
                let scale = g.int(1 + random(5) as i64);
                g.mul(scale, product)
            };
            let n_own = 1 + monomial(&mut g).index() % 2;
            let common = [monomial(&mut g), monomial(&mut g), monomial(&mut g)];
            let (mut uu, mut vv) = (Vec::new(), Vec::new());
            for list in [&mut uu, &mut vv] {
                for _ in 0..n_own {
                    let (w, x) = (monomial(&mut g), monomial(&mut g));
                    list.push(g.product(&[w, x, x]));
                }
            }
            let [w, u, v] = common;
            uu.push(g.product(&[w, u, u]));
            vv.push(g.product(&[w, v, v]));
            let uv = g.product(&[w, u, v]);
            let (uu, vv) = (g.sum(&uu), g.sum(&vv));
            let square = g.powi(uv, 2);
            let quotient = g.div(square, vv).unwrap();
            let difference = g.sub(uu, quotient);
            let normal = Fractions::default().normal(&mut g, difference);
            let shown = g.display(difference, crate::Style::Plain);
            assert!(g.is_equal(normal, difference), "{shown}");
            assert_eq!(sign_of(&g, normal, &signs), Sign::Positive, "{shown}");
            // Terms of one sign lose no more than their operations.
            assert!(loss(&g, &symbols, normal) < 200.0, "{shown}");
        }
    }

    #[test]
    fn a_sum_that_is_too_long_stays_as_it_is() {
        let names: Vec<String> = (0..40).map(|k| format!("x{k}")).collect();
        let (mut g, _, p, _) = positive(&names.iter().map(String::as_str).collect::<Vec<_>>());
        let sum = g.sum(&p);
        let power = g.powi(sum, 8);
        let start = g.sub(power, p[0]);
        let inverse = g.powi(p[1], -1);
        let other = g.mul(power, inverse);
        let e = g.sub(start, other);
        let normal = Fractions::default().normal(&mut g, e);
        assert!(g.is_equal(normal, e));
        assert!(g.n_nodes() < 10_000);
    }
}
