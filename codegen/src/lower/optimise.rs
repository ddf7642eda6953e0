//! Which definitions to keep and which to multiply out: the form of a function that costs least.
//!
//! Definitions as they were derived repeat work that only shows when several of them are multiplied out together
//! (`A udot = f` of a rolling body loses most of its terms that way), and multiplying out everything repeats what the
//! definitions share. So definitions are multiplied out one by one, into their users or down to the inputs, wherever the
//! function as a whole, with its common factors and subexpressions extracted, becomes cheaper.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use num_traits::{One, Signed, Zero};

use super::class::Class;
use super::extract::{Extractor, cost, needed};
use super::forms::Forms;
use super::polynomial::{Atom, Coefficient, Entry, Exponent, Monomial, Polynomial, Reader, System, times};
use super::units;
use super::{Request, Source};
use crate::error::Error;
use crate::expr::{Definition, ExprId, Graph, Node, Rational, Section, Sign, Style, SymbolId};
use crate::program::Role;

/// The search stops when this many divisors, or a tenth of it in terms, have been looked at.
const MAX_WORK: usize = 4_000_000;
/// Nothing is multiplied out any more after so many terms; the most that a scene of `models/specs` takes is 306 000.
const MAX_MULTIPLIED_OUT: usize = 4_000_000;
/// Rounds over all definitions.
const MAX_ROUNDS: usize = 3;
/// A result with errors above this multiple of what rounding the inputs does is written in another way ..
const WORTH_MENDING: f64 = 1024.0;
/// .. where that makes the multiple smaller by this ..
const GAIN: f64 = 16.0;
/// .. and costs at most this fraction more.
const MAX_EXTRA: (i64, i64) = (1, 2);
/// Definitions multiplied out one after the other in the search for one.
const MAX_STAGES: usize = 12;

/// A function's own sections and results.
#[derive(Clone)]
pub(super) struct Optimised {
    pub(super) sections: Vec<Section>,
    pub(super) request: Request,
    /// Units of definitions: the value that was asked for is the unit times the definition's. One where there is none.
    pub(super) units: BTreeMap<SymbolId, ExprId>,
}

/// Rewrites what one function needs; the result is equal as functions, or the function as it was.
pub(super) fn optimise(
    graph: &mut Graph,
    source: &Source<'_>,
    signs: &BTreeMap<ExprId, Sign>,
    forms: &mut Forms,
    request: &Request,
) -> Result<Optimised, Error> {
    let roots: Vec<ExprId> = request.results.iter().map(|(_, e)| *e).collect();
    let needed_symbols = source.needed_definitions(graph, &roots);
    let mut reader = Reader::new(graph, &source.classes, signs);
    for [cosine, sine] in source.circles_for(graph, &roots) {
        let [cosine, sine] = [cosine, sine].map(|s| graph.sym(s));
        reader.system.relate(cosine, sine);
    }
    for (section, s) in source.sections.iter().enumerate() {
        for definition in &s.definitions {
            if needed_symbols.contains(&definition.symbol)
                && source.classes.get(definition.expr) > Class::Param
            {
                reader.define(graph, definition.symbol, section, definition.expr)?;
            }
        }
    }
    let mut results: Vec<Option<usize>> = Vec::with_capacity(roots.len());
    for root in &roots {
        let changes = source.classes.get(*root) > Class::Param;
        results.push(if changes { Some(reader.read(graph, *root)?) } else { None });
    }
    let Reader { mut system, entries, .. } = reader;
    let kept: Vec<usize> = results.iter().flatten().copied().collect();
    let is_rhs = request.role == Role::Rate;
    let entries =
        Search { graph, system: &mut system, forms, roots: &kept, is_rhs, extractor: Extractor::default() }
            .run(entries);
    let (exprs, units) = (HashMap::new(), BTreeMap::new());
    let mut writer = Writer { graph, system: &system, entries: &entries, forms, exprs, units };
    let sections = writer.sections(source, &needed_symbols, &kept)?;
    let values = results.iter().zip(&roots).map(|(k, root)| k.map_or(*root, |k| writer.exprs[&k]));
    let values: Vec<ExprId> = values.collect();
    let units = writer.units;
    for (value, root) in values.iter().zip(&roots) {
        // Fingerprints see through definitions, so this compares functions of the inputs.
        if !graph.is_seen_to_be_equal(*value, *root) {
            let sections = source.sections.to_vec();
            return Ok(Optimised { sections, request: request.clone(), units: BTreeMap::new() });
        }
    }
    let names = request.results.iter().map(|(name, _)| name.clone());
    let request = Request { role: request.role.clone(), results: names.zip(values).collect() };
    Ok(Optimised { sections, request, units })
}

struct Search<'a> {
    graph: &'a mut Graph,
    system: &'a mut System,
    forms: &'a mut Forms,
    roots: &'a [usize],
    is_rhs: bool,
    extractor: Extractor,
}

impl Search<'_> {
    /// The cheapest form found, common divisors extracted, in the units with the fewest numbers.
    fn run(mut self, original: Vec<Entry>) -> Vec<Entry> {
        let found = self.cheapest(original);
        // Numbers, and signs that none of them takes.
        let price = |search: &Self, entries: &[Entry]| -> (i64, usize) {
            let alive = needed(search.system, entries, search.roots);
            let numbers = alive.iter().map(|k| {
                let value = &entries[*k].value;
                let n = value.iter().filter(|(_, c)| !c.is_unit()).count();
                n + usize::from(n == 0 && value.iter().all(|(_, c)| c.negative))
            });
            (cost(search.system, entries, search.roots), numbers.sum())
        };
        let mut best = (price(&self, &found), found);
        // What costs more at first may share more once common divisors are extracted again.
        if self.extractor.is_spent(self.graph) {
            return best.1;
        }
        for candidate in units::in_other_units(self.graph, self.system, &best.1, self.roots) {
            let (_, candidate) = self.extracted(&candidate);
            let trial = (price(&self, &candidate), candidate);
            if trial.0 < best.0 {
                best = trial;
            }
        }
        best.1
    }

    /// The cheapest form found, common divisors extracted.
    fn cheapest(&mut self, original: Vec<Entry>) -> Vec<Entry> {
        let mut current = original;
        let mut best = self.extracted(&current);
        let flat = self.all_flat(&current);
        // What could only be multiplied out in part because its numbers grew is not worth the trial.
        if self.system.numbers.are_too_long() {
            return best.1;
        }
        let tidy = self.all_gathered(&current);
        let tidy_and_flat = tidy.as_ref().map(|tidy| self.all_flat(tidy));
        let starts = [Some(flat), tidy, tidy_and_flat];
        for start in starts.into_iter().flatten() {
            let trial = self.extracted(&start);
            if trial.0 < best.0 {
                (best, current) = (trial, start);
            }
        }
        for _ in 0..MAX_ROUNDS {
            let before = best.0;
            let order = needed(self.system, &current, self.roots);
            for k in order {
                let too_much = self.extractor.work + 10 * self.system.work > MAX_WORK;
                if too_much || self.system.numbers.are_too_long() || self.extractor.is_spent(self.graph) {
                    return best.1;
                }
                let candidates = [
                    self.flat(&current, k),
                    self.inlined(&current, k),
                    self.gathered(&current, k),
                    self.gathered_as_it_is(&current, k),
                    self.scaled(&current, k),
                ];
                for candidate in candidates.into_iter().flatten() {
                    let trial = self.extracted(&candidate);
                    if trial.0 < best.0 {
                        (best, current) = (trial, candidate);
                    }
                }
            }
            if best.0 == before {
                break;
            }
        }
        self.without_cancellations(best, current)
    }

    /// The form found, rid of the cancellations in it that it costs nothing to be rid of.
    fn without_cancellations(&mut self, mut best: (i64, Vec<Entry>), mut current: Vec<Entry>) -> Vec<Entry> {
        for k in needed(self.system, &current, self.roots) {
            if self.extractor.is_spent(self.graph) {
                break;
            }
            let candidates = [self.gathered(&current, k), self.gathered_as_it_is(&current, k)];
            let trials = candidates.into_iter().flatten().map(|c| (self.extracted(&c), c));
            let Some((trial, candidate)) = trials.min_by_key(|(trial, _)| trial.0) else { continue };
            if trial.0 <= best.0 {
                (best, current) = (trial, candidate);
            }
        }
        // A result that is asked for now and then is not worth the search.
        if self.is_rhs { self.steadied(best, current).1 } else { best.1 }
    }

    /// The form found, rid of the cancellations in it that lose digits which the inputs have, if that costs no more than it may.
    ///
    /// Value by value, operands first: each that loses digits is put over the denominators in it, whichever way loses fewest.
    fn steadied(&mut self, best: (i64, Vec<Entry>), current: Vec<Entry>) -> (i64, Vec<Entry>) {
        let worst = |losses: &[f64]| losses.iter().fold(0.0, |max: f64, loss| max.max(*loss));
        let before = match self.losses(&best.1, self.roots) {
            Some(losses) if worst(&losses) > WORTH_MENDING => losses,
            _ => return best,
        };
        let mut entries = current;
        for k in needed(self.system, &entries, self.roots) {
            if self.extractor.work + 10 * self.system.work > MAX_WORK || self.system.numbers.are_too_long() {
                break;
            }
            let Some(mut loss) = self.losses(&entries, &[k]).map(|l| l[0]) else { continue };
            if loss <= WORTH_MENDING {
                continue;
            }
            for candidate in self.gathered_by_stages(&entries, k) {
                let Some(after) = self.losses(&candidate, &[k]).map(|l| l[0]) else { continue };
                if after * GAIN <= loss {
                    (loss, entries) = (after, candidate);
                }
            }
        }
        let trial = self.extracted(&entries);
        let Some(after) = self.losses(&trial.1, self.roots) else { return best };
        let is_dear = trial.0 - best.0 > best.0 * MAX_EXTRA.0 / MAX_EXTRA.1;
        if is_dear || worst(&after) * GAIN > worst(&before) { best } else { trial }
    }

    fn losses(&mut self, entries: &[Entry], of: &[usize]) -> Option<Vec<f64>> {
        self.forms.losses(self.graph, self.system, entries, of)
    }

    /// Polynomial `k` over the denominators in it, with none, one, two, .. of what it is made of multiplied out, the latest first.
    fn gathered_by_stages(&mut self, entries: &[Entry], k: usize) -> Vec<Vec<Entry>> {
        let mut value = entries[k].value.clone();
        let mut kept: Vec<u32> = Vec::new();
        let mut found = Vec::new();
        for _ in 0..MAX_STAGES {
            let gathered = self.over_common_denominator(entries, k, &value);
            found.extend(gathered.map(|gathered| self.with_numerator(gathered, k)));
            let open = value.iter().flat_map(|(m, _)| m).filter(|(_, q)| q.is_positive());
            let open = open.filter_map(|(atom, _)| match self.system.atom(*atom) {
                Atom::Poly(inner) if !kept.contains(&inner) => Some(inner),
                _ => None,
            });
            let Some(inner) = open.max() else { break };
            match self.system.substitute(self.graph, &value, inner as usize, &entries[inner as usize].value) {
                Some(expanded) => value = expanded,
                None => kept.push(inner),
            }
        }
        found
    }

    /// The numerator of polynomial `k` as one of its own: what is divided by `k` is multiplied by the denominator then.
    fn with_numerator(&mut self, mut entries: Vec<Entry>, k: usize) -> Vec<Entry> {
        let lowest = |atom: u32| {
            let power =
                |m: &Monomial| m.iter().find(|(a, _)| *a == atom).map_or(Exponent::zero(), |(_, q)| *q);
            entries[k].value.iter().map(|(m, _)| power(m)).max()
        };
        let atoms: BTreeSet<u32> = entries[k].value.iter().flat_map(|(m, _)| m).map(|(a, _)| *a).collect();
        let shared = atoms.into_iter().filter_map(|a| Some((a, lowest(a).filter(Signed::is_negative)?)));
        let shared: Monomial = shared.collect();
        if shared.is_empty() || entries[k].value.len() < 2 {
            return entries;
        }
        let inverse: Monomial = shared.iter().map(|(a, q)| (*a, -q)).collect();
        let terms: Vec<_> = entries[k].value.iter().map(|(m, c)| (times(m, &inverse), *c)).collect();
        let value = self.system.collect(self.graph, terms);
        let numerator = self.system.atom_of(Atom::Poly(entries.len() as u32));
        entries.push(Entry { value, definition: None, unit: Coefficient::ONE });
        entries[k].value = vec![(times(&shared, &vec![(numerator, Exponent::one())]), Coefficient::ONE)];
        entries
    }

    fn extracted(&mut self, entries: &[Entry]) -> (i64, Vec<Entry>) {
        let mut entries = entries.to_vec();
        self.extractor.extract(self.graph, self.system, &mut entries, self.roots);
        (cost(self.system, &entries, self.roots), entries)
    }

    /// Polynomial `k` multiplied out as far as it goes; none when nothing can be.
    fn flattened(&mut self, entries: &[Entry], k: usize) -> Option<Polynomial> {
        let mut value = entries[k].value.clone();
        let mut kept: Vec<u32> = Vec::new();
        let mut changed = false;
        while self.system.work < MAX_MULTIPLIED_OUT {
            // The latest polynomial first: earlier ones may come in with it.
            let open =
                value.iter().flat_map(|(m, _)| m).filter_map(|(atom, _)| match self.system.atom(*atom) {
                    Atom::Poly(inner) if !kept.contains(&inner) => Some(inner),
                    _ => None,
                });
            let Some(inner) = open.max() else { break };
            match self.system.substitute(self.graph, &value, inner as usize, &entries[inner as usize].value) {
                Some(expanded) => {
                    value = expanded;
                    changed = true;
                }
                None => kept.push(inner),
            }
        }
        changed.then_some(value)
    }

    fn flat(&mut self, entries: &[Entry], k: usize) -> Option<Vec<Entry>> {
        let value = self.flattened(entries, k)?;
        // Where hardly anything cancels the definitions say it shorter, and a trial would cost more than it can tell.
        let behind = needed(self.system, entries, &[k]);
        if value.len() > behind.iter().map(|j| entries[*j].value.len()).sum() {
            return None;
        }
        let mut candidate = entries.to_vec();
        candidate[k].value = value;
        Some(candidate)
    }

    /// Polynomial `k`, multiplied out as far as it goes, over the denominators in it.
    fn gathered(&mut self, entries: &[Entry], k: usize) -> Option<Vec<Entry>> {
        let value = self.flattened(entries, k).unwrap_or_else(|| entries[k].value.clone());
        self.over_common_denominator(entries, k, &value)
    }

    /// Polynomial `k` over the denominators in it, nothing else multiplied out.
    fn gathered_as_it_is(&mut self, entries: &[Entry], k: usize) -> Option<Vec<Entry>> {
        self.over_common_denominator(entries, k, &entries[k].value)
    }

    /// Every polynomial over the denominators in it, nothing else multiplied out; none if nothing cancels.
    fn all_gathered(&mut self, entries: &[Entry]) -> Option<Vec<Entry>> {
        (0..entries.len()).fold(None, |gathered: Option<Vec<Entry>>, k| {
            self.gathered_as_it_is(gathered.as_deref().unwrap_or(entries), k).or(gathered)
        })
    }

    fn over_common_denominator(
        &mut self,
        entries: &[Entry],
        k: usize,
        value: &Polynomial,
    ) -> Option<Vec<Entry>> {
        let denominators: BTreeMap<u32, Polynomial> = self
            .system
            .denominators(value)
            .into_iter()
            .map(|j| {
                let flat = self.flattened(entries, j as usize);
                (j, flat.unwrap_or_else(|| entries[j as usize].value.clone()))
            })
            .collect();
        let value = self.system.over_common_denominator(self.graph, value, &denominators)?;
        let mut candidate = entries.to_vec();
        candidate[k].value = value;
        Some(candidate)
    }

    /// `k = c k'` with the number `c` that leaves the most terms of `k'` and of its users without a number.
    fn scaled(&mut self, entries: &[Entry], k: usize) -> Option<Vec<Entry>> {
        if self.roots.contains(&k) {
            return None;
        }
        let users = needed(self.system, entries, self.roots);
        let atom = self.system.atom_of(Atom::Poly(k as u32));
        let mut scales: BTreeSet<Coefficient> = entries[k].value.iter().map(|(_, c)| *c).collect();
        for user in &users {
            for (m, c) in &entries[*user].value {
                scales.extend(m.iter().any(|(a, _)| *a == atom).then_some(*c));
                // The name of what a function is applied to stays.
                let is_argument = |(a, _): &(u32, Exponent)| match self.system.atom(*a) {
                    Atom::Function(..) | Atom::Atan2(..) => self.system.needs(*a).any(|j| j == k),
                    Atom::Input(_) | Atom::Poly(_) => false,
                };
                if m.iter().any(is_argument) {
                    return None;
                }
            }
        }
        let n_numbers = |value: &Polynomial| value.iter().filter(|(_, c)| !c.is_unit()).count();
        let mut best: Option<(usize, Vec<Entry>)> = None;
        for scale in scales.into_iter().filter(|c| !c.is_unit() && !c.negative) {
            let in_unit = units::in_unit(self.graph, self.system, entries, self.roots, k, scale);
            let Some(candidate) = in_unit else { continue };
            let n = |entries: &[Entry]| -> usize {
                users.iter().chain([&k]).map(|user| n_numbers(&entries[*user].value)).sum()
            };
            let (before, after) = (n(entries), n(&candidate));
            if after < best.as_ref().map_or(before, |(n, _)| *n) {
                best = Some((after, candidate));
            }
        }
        best.map(|(_, candidate)| candidate)
    }

    fn all_flat(&mut self, entries: &[Entry]) -> Vec<Entry> {
        let mut candidate = entries.to_vec();
        for k in 0..entries.len() {
            if let Some(value) = self.flattened(&candidate, k) {
                candidate[k].value = value;
            }
        }
        candidate
    }

    /// Polynomial `k` multiplied out in everything that uses it.
    fn inlined(&mut self, entries: &[Entry], k: usize) -> Option<Vec<Entry>> {
        let mut candidate: Option<Vec<Entry>> = None;
        let (mut before, mut after) = (entries[k].value.len(), 0);
        for user in needed(self.system, entries, self.roots) {
            let uses = |(atom, _): &(u32, Exponent)| self.system.atom(*atom) == Atom::Poly(k as u32);
            if !entries[user].value.iter().any(|(m, _)| m.iter().any(uses)) {
                continue;
            }
            let value = self.system.substitute(self.graph, &entries[user].value, k, &entries[k].value)?;
            before += entries[user].value.len();
            after += value.len();
            candidate.get_or_insert_with(|| entries.to_vec())[user].value = value;
        }
        candidate.filter(|_| after <= before)
    }
}

/// Turns polynomials back into definitions.
struct Writer<'a> {
    graph: &'a mut Graph,
    system: &'a System,
    entries: &'a [Entry],
    forms: &'a mut Forms,
    /// What stands for each polynomial: a symbol, or the expression itself where that is no sum.
    exprs: HashMap<usize, ExprId>,
    /// Units of the definitions that have one.
    units: BTreeMap<SymbolId, ExprId>,
}

impl Writer<'_> {
    fn sections(
        &mut self,
        source: &Source<'_>,
        needed_symbols: &BTreeSet<SymbolId>,
        roots: &[usize],
    ) -> Result<Vec<Section>, Error> {
        let mut sections: Vec<Section> = source
            .sections
            .iter()
            .map(|s| Section { title: s.title.clone(), definitions: Vec::new() })
            .collect();
        // Definitions in the parameters alone come first: a number may be written by any of them, a later one included.
        if let Some(first) = sections.first_mut() {
            let all = source.sections.iter().flat_map(|s| &s.definitions);
            let hoisted = all
                .filter(|d| needed_symbols.contains(&d.symbol) && source.classes.get(d.expr) <= Class::Param);
            for definition in hoisted {
                let expr = self.forms.best(self.graph, definition.expr);
                first.definitions.push(Definition { expr, ..*definition });
            }
        }
        let alive = needed(self.system, self.entries, roots);
        // Named values in their old order, each after what it needs.
        let mut named: Vec<usize> =
            alive.iter().copied().filter(|k| self.entries[*k].definition.is_some()).collect();
        named.sort_by_key(|k| self.entries[*k].definition.map(|(symbol, section)| (section, symbol)));
        // What no named value needs comes after all sections.
        sections.push(Section { title: String::new(), definitions: Vec::new() });
        let end = sections.len() - 1;
        let mut last_section = 0;
        for (k, is_root) in named.into_iter().map(|k| (k, false)).chain(roots.iter().map(|k| (*k, true))) {
            last_section = match self.entries[k].definition {
                Some((_, section)) if !is_root => section.max(last_section),
                _ => end,
            };
            for k in needed(self.system, self.entries, &[k]) {
                if self.exprs.contains_key(&k) {
                    continue;
                }
                let value = self.expression(k)?;
                let unit = self.entries[k].unit;
                let unit = (unit != Coefficient::ONE).then(|| self.system.numbers.expr(self.graph, unit));
                let name = self.entries[k].definition.map(|(symbol, _)| {
                    let name = self.graph.name(symbol);
                    unit.map_or(name.to_owned(), |unit| format!("{name}{}", suffix(self.graph, unit)))
                });
                let is_value = match self.graph.node(value) {
                    Node::Sum { .. } | Node::Product { .. } => true,
                    Node::Function(..) | Node::Atan2(..) => name.is_some(),
                    _ => false,
                };
                let stands = if is_value {
                    let symbol = self.graph.define(name.as_deref().unwrap_or(""), value);
                    sections[last_section].definitions.push(Definition { symbol, expr: value });
                    self.units.extend(unit.map(|unit| (symbol, unit)));
                    self.graph.sym(symbol)
                } else {
                    value
                };
                self.exprs.insert(k, stands);
            }
        }
        Ok(sections)
    }

    fn expression(&mut self, k: usize) -> Result<ExprId, Error> {
        let mut terms = Vec::with_capacity(self.entries[k].value.len());
        for (m, c) in &self.entries[k].value {
            let number = self.system.numbers.expr(self.graph, *c);
            let number = self.forms.best(self.graph, number);
            let mut factors = vec![(number, Rational::from_integer(1.into()))];
            for (atom, q) in m {
                let base = match self.system.atom(*atom) {
                    Atom::Input(e) => e,
                    Atom::Poly(k) => self.exprs[&(k as usize)],
                    Atom::Function(f, k) => self.graph.func(f, self.exprs[&(k as usize)]),
                    Atom::Atan2(y, x) => {
                        self.graph.atan2(self.exprs[&(y as usize)], self.exprs[&(x as usize)])
                    }
                };
                factors.push((base, Rational::new((*q.numer()).into(), (*q.denom()).into())));
            }
            let product = self.graph.power_product(&factors);
            terms.push(product.map_err(|_| Error::DivisionByZero { place: "a rewritten sum".into() })?);
        }
        Ok(self.graph.sum(&terms))
    }
}

/// What to append to the name of a value that is measured in a unit: `_over_m_r2`, or that it is scaled where that says too
/// much.
fn suffix(graph: &Graph, unit: ExprId) -> String {
    const MAX_SUFFIX: usize = 12;
    let text = graph.display(unit, Style::Plain).replace('*', "_").replace('^', "");
    let is_product = text.len() <= MAX_SUFFIX && text.chars().all(|c| c == '_' || c.is_ascii_alphanumeric());
    if is_product { format!("_over_{text}") } else { "_scaled".into() }
}
