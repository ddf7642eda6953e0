//! Common subexpressions and factors of many polynomials at once, greedily by what they save.
//!
//! Two kinds of divisors are looked for in all polynomials together: sums of two monomials, up to a common factor, (`a
//! x + a r y = a (x + r y)`: Horner's rule and shared sums alike) and products of two literals. Longer ones grow out of
//! these step by step. This is fast extraction from logic synthesis (Rajski and Vasudevamurthi, 1990), with
//! coefficients (Hosangadi, Fallah and Kastner, 2006). Deliberately does not know which polynomials were multiplied
//! out.

mod site;

use std::cell::RefMut;
use std::rc::Rc;

use rustc_hash::FxHashMap;

use super::exponent::Exponent;
use super::facts::{Candidates, Facts, Occurrence};
use super::numbers::Coefficient;
use super::polynomial::{
    Atom, Entry, Monomial, Polynomial, System, Terms, common, needed, power, quotient, times,
};
use super::price::{Shape, n_literals, n_mul};
use crate::program::cost::thirds::{FLOP, INSTRUCTION};
use hamel_expr::Graph;

pub(super) use site::Site;

/// In longer polynomials only terms this close to one another are paired.
const WINDOW: usize = 48;

/// A factor of a monomial: a number, an atom or its reciprocal, or the root that is left of a power such as `a^(-3/2)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Literal {
    Number(u32),
    Atom(u32, Exponent),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Divisor {
    /// `p first + q second`, monomials by their numbers; `p` or `q` is one where that takes no unsafe division.
    Sum([u32; 2], [Coefficient; 2]),
    Product(Literal, Literal),
}

/// Monomials, each once, by the order in which they were met.
#[derive(Default)]
struct Monomials {
    index: FxHashMap<Monomial, u32>,
    list: Vec<Monomial>,
}

impl Monomials {
    fn number(&mut self, m: &Monomial) -> u32 {
        if let Some(known) = self.index.get(m) {
            return *known;
        }
        let number = u32::try_from(self.list.len()).expect("fewer than 2^32 monomials fit in memory");
        self.index.insert(m.clone(), number);
        self.list.push(m.clone());
        number
    }

    fn get(&self, number: u32) -> &Monomial {
        &self.list[number as usize]
    }
}

/// A divisor that is there already: `divisor = number * atom^1`, or plainly one.
#[derive(Clone, Copy, Debug)]
enum Known {
    One,
    Entry { k: usize, scale: Coefficient },
}

/// What is known of one term, whichever polynomials it stands in.
#[derive(Debug)]
struct Term {
    monomial: u32,
    n_mul: i64,
    /// Products of two of its literals; none before they are asked for.
    products: Option<Rc<[u32]>>,
}

/// What is known of the sum of two terms, whichever polynomials it stands in.
#[derive(Clone, Copy, Debug)]
struct Pair {
    divisor: u32,
    scale: Coefficient,
    /// As [`Occurrence::n_left`].
    n_left: u32,
}

/// Extracts divisors; remembers those of terms, pairs of terms and polynomials met before, as one search meets the same
/// ones again and again.
#[derive(Default)]
pub(super) struct Extractor {
    monomials: Monomials,
    index: FxHashMap<Divisor, u32>,
    divisors: Vec<Divisor>,
    own_cost: Vec<i64>,
    /// What replacing each divisor everywhere would save, its own cost apart; zero between extractions.
    totals: Vec<i64>,
    /// Divisors that are there already; none between extractions.
    known: Vec<Option<Known>>,
    term_index: FxHashMap<(Monomial, Coefficient), u32>,
    terms: Vec<Term>,
    /// By the numbers of both terms, that of the first in the upper half.
    pairs: FxHashMap<u64, Pair>,
    /// By the numbers of the terms.
    candidates: FxHashMap<Rc<[u32]>, Rc<Candidates>>,
    /// What the tables hold, about.
    bytes: usize,
    /// How often the tables were begun anew.
    generation: usize,
}

/// Tables larger than this are begun anew.
const MAX_BYTES: usize = 160 << 20;

impl Extractor {
    /// Extracts divisors from the polynomials behind `roots` while that saves anything; new ones are appended.
    pub(super) fn extract(
        &mut self,
        graph: &mut Graph,
        system: &mut System,
        entries: &mut Vec<Entry>,
        roots: &[usize],
    ) {
        self.forget_if_large();
        let active = needed(system, entries, roots);
        self.extract_among(graph, system, entries, active, &[]);
    }

    fn forget_if_large(&mut self) {
        if self.bytes > MAX_BYTES {
            *self = Extractor { generation: self.generation + 1, ..Extractor::default() };
        }
    }

    /// Extracts divisors from `active` polynomials alone, in whose place those of `landmarks` may stand.
    fn extract_among(
        &mut self,
        graph: &mut Graph,
        system: &mut System,
        entries: &mut Vec<Entry>,
        active: Vec<usize>,
        landmarks: &[(u32, Known)],
    ) {
        let before = system.effort.steps;
        let n_terms = active.iter().map(|k| entries[*k].value.len()).sum::<usize>();
        system.effort.steps += entries.len() + n_terms;
        let n_rounds = 4 * n_terms;
        let mut pass = Pass {
            graph,
            system,
            extractor: self,
            touched: Vec::new(),
            queue: Vec::new(),
            candidates: vec![None; entries.len()],
            active,
        };
        for (divisor, known) in landmarks {
            pass.extractor.known[*divisor as usize] = Some(*known);
            pass.touched.push(*divisor);
        }
        for position in 0..pass.active.len() {
            pass.enter(entries, pass.active[position]);
        }
        for _ in 0..n_rounds {
            if pass.system.effort.is_spent(pass.graph) {
                break;
            }
            let Some(best) = pass.best() else { break };
            pass.take(entries, best);
        }
        for divisor in std::mem::take(&mut pass.touched) {
            self.totals[divisor as usize] = 0;
            self.known[divisor as usize] = None;
        }
        system.effort.charge_steps(graph, before);
    }
}

struct Pass<'a> {
    graph: &'a mut Graph,
    system: &'a mut System,
    extractor: &'a mut Extractor,
    /// Divisors with an entry in `totals` or `known`, some of them several times.
    touched: Vec<u32>,
    /// Divisors by their gain; a gain that fell since is corrected when it is met.
    queue: Vec<Vec<u32>>,
    candidates: Vec<Option<Rc<Candidates>>>,
    active: Vec<usize>,
}

impl Pass<'_> {
    fn gain(&self, divisor: u32) -> i64 {
        let divisor = divisor as usize;
        let own = match self.extractor.known[divisor] {
            Some(_) => 0,
            None => self.extractor.own_cost[divisor],
        };
        self.extractor.totals[divisor] - own
    }

    /// The divisor that saves most.
    fn best(&mut self) -> Option<u32> {
        while let Some(bucket) = self.queue.last_mut() {
            let Some(divisor) = bucket.pop() else {
                self.queue.pop();
                continue;
            };
            let met = self.queue.len() - 1;
            match usize::try_from(self.gain(divisor)) {
                Ok(gain) if gain == met => return Some(divisor),
                Ok(gain) if gain > 0 && gain < met => self.queue[gain].push(divisor),
                _ => {}
            }
        }
        None
    }

    /// Queues a divisor whose gain has risen.
    fn queue(&mut self, divisor: u32) {
        let Ok(gain) = usize::try_from(self.gain(divisor)) else { return };
        if gain > 0 {
            if self.queue.len() <= gain {
                self.queue.resize_with(gain + 1, Vec::new);
            }
            self.queue[gain].push(divisor);
        }
    }

    /// Counts the savings in polynomial `k`, or stops counting them.
    fn count(&mut self, k: usize, sign: i64) {
        let Some(candidates) = self.candidates[k].clone() else { return };
        self.system.effort.steps += candidates.savings.len();
        for (divisor, saves) in &candidates.savings {
            if matches!(self.extractor.known[*divisor as usize], Some(Known::Entry { k: itself, .. }) if itself == k)
            {
                continue;
            }
            let total = &mut self.extractor.totals[*divisor as usize];
            if *total == 0 {
                self.touched.push(*divisor);
            }
            *total += sign * saves;
            if sign > 0 {
                self.queue(*divisor);
            }
        }
    }

    fn enter(&mut self, entries: &[Entry], k: usize) {
        let value = &entries[k].value;
        let known = self.facts(value).candidates.clone();
        let candidates = match known {
            Some(known) => {
                self.system.effort.divisors += known.savings.len();
                known
            }
            None => {
                let found = self.candidates_of(value);
                self.facts(value).candidates = Some(found.clone());
                found
            }
        };
        self.candidates[k] = Some(candidates);
        self.remember(entries, k);
        self.count(k, 1);
    }

    /// What this extractor knows about a polynomial.
    fn facts<'p>(&self, value: &'p Polynomial) -> RefMut<'p, Facts> {
        let generation = self.extractor.generation;
        let mut facts = value.facts().borrow_mut();
        if facts.as_ref().is_none_or(|facts| facts.generation != generation) {
            *facts = Some(Facts { generation, candidates: None, divisor: None });
        }
        RefMut::map(facts, |facts| facts.as_mut().expect("just put there"))
    }

    /// Puts a divisor in the place of all its occurrences.
    fn take(&mut self, entries: &mut Vec<Entry>, divisor: u32) {
        let known = match self.extractor.known[divisor as usize] {
            Some(known) => known,
            None if self.is_one(&self.extractor.divisors[divisor as usize]) => Known::One,
            None => {
                let value = self.value_of(divisor);
                let k = entries.len();
                entries.push(Entry { value, definition: None, unit: Coefficient::ONE });
                let known = Known::Entry { k, scale: Coefficient::ONE };
                self.extractor.known[divisor as usize] = Some(known);
                self.touched.push(divisor);
                self.candidates.push(None);
                self.active.push(k);
                self.enter(entries, k);
                known
            }
        };
        self.system.effort.steps += self.active.len();
        for position in 0..self.active.len() {
            let k = self.active[position];
            let Some(candidates) = self.candidates[k].clone() else { continue };
            let is_itself = matches!(known, Known::Entry { k: itself, .. } if itself == k);
            if is_itself || candidates.savings.binary_search_by_key(&divisor, |(d, _)| *d).is_err() {
                continue;
            }
            let value = self.replaced(&entries[k].value, &candidates.occurrences, divisor, known);
            if value != entries[k].value {
                self.count(k, -1);
                entries[k].value = value;
                self.enter(entries, k);
            }
        }
    }

    fn id(&mut self, divisor: Divisor) -> u32 {
        if let Some(known) = self.extractor.index.get(&divisor) {
            return *known;
        }
        let id =
            u32::try_from(self.extractor.divisors.len()).expect("fewer than 2^32 divisors fit in memory");
        let own_cost = match &divisor {
            Divisor::Sum(..) if self.is_one(&divisor) => 0,
            Divisor::Sum([a, b], [p, q]) => {
                let monomial = |number: u32| self.extractor.monomials.get(number);
                Shape::default().with(monomial(*a), *p).with(monomial(*b), *q).cost()
            }
            Divisor::Product(..) => INSTRUCTION + FLOP,
        };
        self.extractor.bytes += 360;
        self.extractor.index.insert(divisor, id);
        self.extractor.divisors.push(divisor);
        self.extractor.own_cost.push(own_cost);
        self.extractor.totals.push(0);
        self.extractor.known.push(None);
        id
    }

    /// Whether a divisor is `sin^2 a + cos^2 a`.
    fn is_one(&self, divisor: &Divisor) -> bool {
        match divisor {
            Divisor::Sum([a, b], numbers) => {
                let monomial = |number: u32| self.extractor.monomials.get(number);
                *numbers == [Coefficient::ONE; 2] && self.system.is_circle(monomial(*a), monomial(*b))
            }
            Divisor::Product(..) => false,
        }
    }

    /// Polynomials that are a divisor as they stand need not be computed again.
    fn remember(&mut self, entries: &[Entry], k: usize) {
        let value = &entries[k].value;
        let known = self.facts(value).divisor;
        let divisor = known.unwrap_or_else(|| {
            let found = self.divisor_of(value);
            self.facts(value).divisor = Some(found);
            found
        });
        let Some((id, scale)) = divisor else { return };
        if self.extractor.known[id as usize].is_none() {
            self.extractor.known[id as usize] = Some(Known::Entry { k, scale });
            self.touched.push(id);
            self.queue(id);
        }
    }

    /// The divisor that a polynomial is: `value = scale * divisor`.
    fn divisor_of(&mut self, value: &Polynomial) -> Option<(u32, Coefficient)> {
        let (divisor, scale) = match &**value {
            [(a, p), (b, q)] => {
                let monomials = [a, b].map(|m| self.extractor.monomials.number(m));
                self.sum_divisor(monomials, [*p, *q])
            }
            [(m, c)] => {
                if m.iter().any(|(_, q)| !q.is_whole() && q.truncated() == 0) {
                    return None;
                }
                let literals = literals(m, *c);
                let [(a, n), rest @ ..] = literals.as_slice() else { return None };
                let pair = match rest {
                    [] if *n == 2 => (*a, *a),
                    [(b, 1)] if *n == 1 => (*a, *b),
                    _ => return None,
                };
                (Divisor::Product(pair.0, pair.1), Coefficient::ONE.signed_by(c.negative))
            }
            _ => return None,
        };
        // What is computed there is used in place of the divisor: `divisor = value / scale`.
        self.system.numbers.div(self.graph, Coefficient::ONE, scale)?;
        Some((self.id(divisor), scale))
    }

    /// `p a + q b = scale * divisor`, the common factor of `a` and `b` left in both.
    fn sum_divisor(&mut self, [a, b]: [u32; 2], [p, q]: [Coefficient; 2]) -> (Divisor, Coefficient) {
        let are_sorted = self.extractor.monomials.get(a) <= self.extractor.monomials.get(b);
        let (monomials, p, q) = if are_sorted { ([a, b], p, q) } else { ([b, a], q, p) };
        let one = Coefficient::ONE;
        if let Some(ratio) = self.system.numbers.div(self.graph, q, p) {
            return (Divisor::Sum(monomials, [one, ratio]), p);
        }
        if let Some(ratio) = self.system.numbers.div(self.graph, p, q) {
            return (Divisor::Sum(monomials, [ratio, one]), q);
        }
        let sign = one.signed_by(p.negative);
        (Divisor::Sum(monomials, [p.signed_by(p.negative), q.signed_by(p.negative)]), sign)
    }

    fn candidates_of(&mut self, value: &Polynomial) -> Rc<Candidates> {
        let terms: Rc<[u32]> = value.iter().map(|term| self.term(term)).collect();
        if let Some(known) = self.extractor.candidates.get(&terms) {
            self.system.effort.divisors += known.savings.len();
            return known.clone();
        }
        let mut list: Vec<Occurrence> = Vec::new();
        for (i, term) in terms.iter().enumerate() {
            let (place, scale) = (i as u32, value[i].1);
            for divisor in self.products(*term, &value[i]).iter() {
                list.push(Occurrence { divisor: *divisor, first: place, second: place, scale, n_left: 0 });
            }
            let end = value.len().min(i + WINDOW);
            for j in i + 1..end {
                let Pair { divisor, scale, n_left } = self.pair((*term, &value[i]), (terms[j], &value[j]));
                list.push(Occurrence { divisor, first: place, second: j as u32, scale, n_left });
            }
        }
        self.system.effort.divisors += 4 * list.len();
        // Occurrences of one divisor that share a term exclude one another; the first ones count.
        let mut order: Vec<u64> =
            list.iter().enumerate().map(|(place, o)| (u64::from(o.divisor) << 32) | place as u64).collect();
        order.sort_unstable();
        let occurrences: Vec<Occurrence> =
            order.into_iter().map(|key| list[(key & u64::from(u32::MAX)) as usize]).collect();
        let shape = Shape::of(value);
        let before = shape.cost();
        let mut savings: Vec<(u32, i64)> = Vec::new();
        let mut used: Vec<u32> = Vec::new();
        for o in &occurrences {
            if savings.last().is_none_or(|(divisor, _)| *divisor != o.divisor) {
                savings.push((o.divisor, 0));
                used.clear();
            }
            if !used.contains(&o.first) && !used.contains(&o.second) {
                used.extend([o.first, o.second]);
                let saves = before - self.shape_without(shape, &terms, o).cost();
                savings.last_mut().expect("just pushed").1 += saves;
            }
        }
        self.system.effort.steps += 4 * list.len();
        self.extractor.bytes += 8 * value.len() + 24 * list.len() + 16 * savings.len();
        let candidates = Rc::new(Candidates { occurrences, savings });
        self.extractor.candidates.insert(terms, candidates.clone());
        candidates
    }

    /// The number of a term.
    fn term(&mut self, term: &(Monomial, Coefficient)) -> u32 {
        if let Some(known) = self.extractor.term_index.get(term) {
            return *known;
        }
        let id = u32::try_from(self.extractor.terms.len()).expect("fewer than 2^32 terms fit in memory");
        self.extractor.bytes += 96 + 12 * term.0.len();
        self.extractor.term_index.insert(term.clone(), id);
        let monomial = self.extractor.monomials.number(&term.0);
        self.extractor.terms.push(Term { monomial, n_mul: n_mul(&term.0, term.1), products: None });
        id
    }

    /// The products of two literals of a term.
    fn products(&mut self, id: u32, (m, c): &(Monomial, Coefficient)) -> Rc<[u32]> {
        if let Some(known) = &self.extractor.terms[id as usize].products {
            return known.clone();
        }
        let literals = literals(m, *c);
        let mut products = Vec::new();
        for (x, (a, n)) in literals.iter().enumerate() {
            if *n >= 2 {
                products.push(self.id(Divisor::Product(*a, *a)));
            }
            for (b, _) in &literals[x + 1..] {
                products.push(self.id(Divisor::Product(*a, *b)));
            }
        }
        let products: Rc<[u32]> = products.into();
        self.extractor.bytes += 4 * products.len();
        self.extractor.terms[id as usize].products = Some(products.clone());
        products
    }

    /// The sum of two terms as a divisor.
    fn pair(
        &mut self,
        (first, (a, p)): (u32, &(Monomial, Coefficient)),
        (second, (b, q)): (u32, &(Monomial, Coefficient)),
    ) -> Pair {
        let key = (u64::from(first) << 32) | u64::from(second);
        if let Some(known) = self.extractor.pairs.get(&key) {
            return *known;
        }
        let common = common(a, b);
        let monomials = if common.is_empty() {
            [first, second].map(|term| self.extractor.terms[term as usize].monomial)
        } else {
            [a, b].map(|m| self.extractor.monomials.number(&quotient(m, &common)))
        };
        let (divisor, scale) = self.sum_divisor(monomials, [*p, *q]);
        let literals: i64 = common.iter().map(|(_, q)| n_literals(*q)).sum();
        let n_left = u32::try_from(literals + i64::from(!scale.is_unit())).expect("few literals");
        let pair = Pair { divisor: self.id(divisor), scale, n_left };
        self.extractor.bytes += 40;
        self.extractor.pairs.insert(key, pair);
        pair
    }

    /// What is left of a polynomial where one occurrence is replaced.
    fn shape_without(&self, shape: Shape, terms: &[u32], o: &Occurrence) -> Shape {
        let n_mul = |place: u32| self.extractor.terms[terms[place as usize] as usize].n_mul;
        let mut after = shape;
        let before = n_mul(o.first);
        after.add(before, -1);
        let divisor = &self.extractor.divisors[o.divisor as usize];
        match divisor {
            Divisor::Product(..) => after.add(before - 1, 1),
            Divisor::Sum(..) => {
                after.add(n_mul(o.second), -1);
                let own = i64::from(!self.is_one(divisor));
                after.add((i64::from(o.n_left) + own - 1).max(0), 1);
            }
        }
        after
    }

    fn value_of(&self, id: u32) -> Polynomial {
        let terms = match &self.extractor.divisors[id as usize] {
            Divisor::Sum([a, b], [p, q]) => {
                let monomial = |number: u32| self.extractor.monomials.get(number).clone();
                vec![(monomial(*a), *p), (monomial(*b), *q)]
            }
            Divisor::Product(a, b) => {
                let mut c = Coefficient::ONE;
                let mut m = Monomial::new();
                for literal in [a, b] {
                    match literal {
                        Literal::Number(number) => c = Coefficient { negative: false, number: *number },
                        Literal::Atom(atom, q) => m = times(&m, &power(*atom, *q)),
                    }
                }
                vec![(m, c)]
            }
        };
        terms.into()
    }

    fn replaced(&mut self, value: &Polynomial, hits: &[Occurrence], id: u32, known: Known) -> Polynomial {
        let mut gone = vec![false; value.len()];
        let mut terms = Terms::with_capacity(value.len());
        let divisor = self.extractor.divisors[id as usize];
        let hits = &hits[hits.partition_point(|o| o.divisor < id)..];
        let hits = hits.iter().take_while(|o| o.divisor == id);
        let (inner, scale) = match known {
            Known::One => (Monomial::new(), Coefficient::ONE),
            Known::Entry { k, scale } => {
                let atom = self.system.atom_of(Atom::Poly(k as u32));
                (power(atom, Exponent::ONE), scale)
            }
        };
        for o in hits {
            let (i, j) = (o.first as usize, o.second as usize);
            if gone[i] || gone[j] {
                continue;
            }
            let (m, c) = &value[i];
            let (rest, c) = match &divisor {
                Divisor::Product(a, b) => {
                    let mut rest = m.clone();
                    let mut c = *c;
                    for literal in [a, b] {
                        match literal {
                            Literal::Number(_) => c = Coefficient::ONE.signed_by(c.negative),
                            Literal::Atom(atom, q) => rest = times(&rest, &power(*atom, -*q)),
                        }
                    }
                    (rest, c)
                }
                Divisor::Sum(..) => (common(m, &value[j].0), o.scale),
            };
            let Some(c) = self.system.numbers.div(self.graph, c, scale) else { continue };
            gone[i] = true;
            gone[j] = true;
            terms.push((times(&rest, &inner), c));
        }
        terms.extend(value.iter().zip(&gone).filter(|(_, gone)| !**gone).map(|(term, _)| term.clone()));
        self.system.collect(self.graph, terms)
    }
}

/// Literals of a term and how often each occurs.
fn literals(m: &Monomial, c: Coefficient) -> Vec<(Literal, i64)> {
    let number = (!c.is_unit()).then_some((Literal::Number(c.number), 1));
    let mut literals: Vec<(Literal, i64)> = number.into_iter().collect();
    for (atom, q) in m {
        let whole = Exponent::whole(q.truncated());
        if !whole.is_zero() {
            let one = Exponent::whole(if q.is_positive() { 1 } else { -1 });
            literals.push((Literal::Atom(*atom, one), i64::from(q.truncated().abs())));
        }
        // A root alone is computed once anyway; as a literal it takes large functions to the limits of the search.
        if !q.is_whole() && !whole.is_zero() {
            literals.push((Literal::Atom(*atom, *q - whole), 1));
        }
    }
    literals
}
