//! Which definitions to keep and which to multiply out: the form of a function that costs least.
//!
//! Definitions as they were derived repeat work that only shows when several of them are multiplied out together (`A
//! udot = f` of a rolling body loses most of its terms that way), and multiplying out everything repeats what the
//! definitions share. So definitions are multiplied out one by one, into their users or down to the inputs, wherever
//! the function as a whole, with its common factors and subexpressions extracted, becomes cheaper. Does not know:
//! expressions other than numbers, whether the result is equal to what was asked for.

use std::collections::{BTreeMap, BTreeSet};

use super::digits::Digits;
use super::exponent::Exponent;
use super::extract::{Extractor, Site};
use super::numbers::Coefficient;
use super::polynomial::{Atom, Entry, Monomial, Polynomial, System, needed, power, times};
use super::price::cost;
use super::units;
use hamel_expr::Graph;

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

/// Rates of more definitions and terms than both of these are searched by windows: trials of all of them would meet
/// their limit before every definition has been looked at once. Rates of a bicycle have 456 terms, of ten pendulums in
/// space 1356, of twenty 2886 ..
const LARGE: Size = Size { definitions: 150, terms: 400 };
/// .. and two or three terms a definition. Those of more than this, such as the dense sums of a truncated fluid (six),
/// share most of what they share far apart, where no window sees it.
const MAX_TERMS_EACH: usize = 4;
/// Other functions than rates of more definitions and terms than both of these, and few terms each, stay as they were
/// derived, with common divisors extracted: the budget allows trials of a small part of their definitions. The
/// derivatives of an arm of seven joints have 3630 definitions and 10,280 terms.
const LONG: Size = Size { definitions: 2000, terms: 6000 };
/// Functions other than rates begin with no form that has so many times their terms: it takes the budget of the search,
/// and costs more. Of the 1845 forms that searches of the shipped scenes began with 593 cost less than the function as
/// it was derived, and had at most 2.3 times its terms. The 134 of more than four times took 269 of 283 s.
///
/// Searches of rates begin with these forms as well. The rest of their budget decides where they end: with more of it
/// most rates take fewer operations, but rates of the satellite with two arms take one more.
const MUCH_LONGER: usize = 4;
/// What the cost of a candidate that is tried as a whole may be above that of the best form, by what can be seen near
/// its definition, in one search after the other: two operations, eight, thirty-two.
const SLACKS: [i64; 3] = [6, 24, 96];
/// Terms of a window.
const WINDOW: usize = 300;

/// The cheapest form so far, common divisors extracted, and the form that it was extracted from.
struct Found {
    best: (i64, Vec<Entry>),
    current: Vec<Entry>,
}

struct Size {
    definitions: usize,
    terms: usize,
}

fn n_terms(entries: &[Entry], of: &[usize]) -> usize {
    of.iter().map(|k| entries[*k].value.len()).sum()
}

/// Whether the roots need more definitions and terms than `size`, with few terms each.
fn is_chain(system: &System, entries: &[Entry], roots: &[usize], size: &Size) -> bool {
    let alive = needed(system, entries, roots);
    let n_terms = n_terms(entries, &alive);
    let are_short = n_terms <= MAX_TERMS_EACH * alive.len();
    alive.len() > size.definitions && n_terms > size.terms && are_short
}

/// What the roots need in pieces, each after what it needs.
fn windows(system: &System, entries: &[Entry], roots: &[usize]) -> Vec<Vec<usize>> {
    let mut windows: Vec<Vec<usize>> = vec![Vec::new()];
    let mut n_terms = 0;
    for k in needed(system, entries, roots) {
        if n_terms > WINDOW {
            windows.push(Vec::new());
            n_terms = 0;
        }
        n_terms += entries[k].value.len();
        windows.last_mut().expect("begun with one").push(k);
    }
    windows
}

/// The search for the cheapest form of the polynomials behind `roots`.
pub(super) struct Search<'a> {
    pub(super) graph: &'a mut Graph,
    pub(super) system: &'a mut System,
    pub(super) digits: &'a mut Digits,
    pub(super) roots: &'a [usize],
    /// Whether the form may cost more where that keeps digits which the inputs have; worth the search for rates alone.
    pub(super) keeps_digits: bool,
    pub(super) extractor: Extractor,
}

impl Search<'_> {
    /// The cheapest form found, common divisors extracted, in the units with the fewest numbers.
    pub(super) fn run(mut self, original: Vec<Entry>) -> Vec<Entry> {
        if !self.keeps_digits && is_chain(self.system, &original, self.roots, &LONG) {
            return self.extracted(&original).1;
        }
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
        if self.system.effort.is_spent(self.graph) {
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
        // Derivatives and outputs have to do with less.
        let is_chain = self.keeps_digits && is_chain(self.system, &original, self.roots, &LARGE);
        let (Found { best, current }, is_done) =
            if is_chain { self.by_windows(original) } else { self.by_rounds_from(original) };
        if is_done { self.without_cancellations(best, current) } else { best.1 }
    }

    /// Rounds over all definitions, from the best of some forms to begin with.
    fn by_rounds_from(&mut self, original: Vec<Entry>) -> (Found, bool) {
        let start = self.start(original);
        self.by_rounds(start, None)
    }

    /// Whether the form found so far has to do.
    fn is_over(&mut self) -> bool {
        self.system.effort.has_seen_enough()
            || self.system.numbers_are_too_long()
            || self.system.effort.is_spent(self.graph)
    }

    /// The form to begin with: as it was, multiplied out, over denominators, or both, unless that is [`MUCH_LONGER`].
    fn start(&mut self, original: Vec<Entry>) -> Found {
        let mut current = original;
        let most = match self.keeps_digits {
            true => usize::MAX,
            false => MUCH_LONGER * n_terms(&current, &needed(self.system, &current, self.roots)),
        };
        let mut best = self.extracted(&current);
        let flat = self.all_flat(&current, most);
        // What could only be multiplied out in part because its numbers grew is not worth the trial.
        if self.system.numbers_are_too_long() {
            return Found { best, current };
        }
        let tidy = self.all_gathered(&current);
        let tidy_and_flat = tidy.as_ref().and_then(|tidy| self.all_flat(tidy, most));
        let starts = [flat, tidy, tidy_and_flat];
        for start in starts.into_iter().flatten() {
            if n_terms(&start, &needed(self.system, &start, self.roots)) > most {
                continue;
            }
            let trial = self.extracted(&start);
            if trial.0 < best.0 {
                (best, current) = (trial, start);
            }
        }
        Found { best, current }
    }

    /// Rounds over all definitions, each of which is multiplied out where that pays.
    ///
    /// With `slack`, a candidate is extracted as a whole only where it comes that near the best form by what can be
    /// seen in its changed polynomials alone. Tells whether all were looked at.
    fn by_rounds(&mut self, start: Found, slack: Option<i64>) -> (Found, bool) {
        let Found { mut best, mut current } = start;
        let mut site = slack.map(|_| self.site(&best.1));
        for _ in 0..MAX_ROUNDS {
            let before = best.0;
            let order = needed(self.system, &current, self.roots);
            for k in order {
                if self.is_over() {
                    return (Found { best, current }, false);
                }
                let candidates = [
                    self.flat(&current, k),
                    self.inlined(&current, k),
                    self.gathered(&current, k),
                    self.gathered_as_it_is(&current, k),
                    self.scaled(&current, k),
                ];
                for candidate in candidates.into_iter().flatten() {
                    let (seen, near) = match &mut site {
                        Some(site) => self.seen_near(site, (&candidate, &current), best.0),
                        None => (best.0, None),
                    };
                    if slack.is_some_and(|slack| seen >= best.0 + slack) {
                        continue;
                    }
                    let mut trial = self.extracted(&candidate);
                    if let Some(near) = near.filter(|_| seen < trial.0) {
                        trial = (seen, near);
                    }
                    if trial.0 < best.0 {
                        (best, current) = (trial, candidate);
                        site = site.map(|_| self.site(&best.1));
                    }
                }
            }
            if best.0 == before {
                break;
            }
        }
        (Found { best, current }, true)
    }

    fn site(&mut self, entries: &[Entry]) -> Site {
        Site::new(&mut self.extractor, self.graph, self.system, entries.to_vec(), self.roots)
    }

    /// What a candidate costs at a site that has the form found so far, by its changed polynomials alone, and the form
    /// that it has there, if that costs less than `least`. What is measured in another unit is another value to
    /// whatever else uses it there, and has none.
    fn seen_near(
        &mut self,
        site: &mut Site,
        (candidate, current): (&[Entry], &[Entry]),
        least: i64,
    ) -> (i64, Option<Vec<Entry>>) {
        let is_other =
            |(k, new): &(usize, &Entry)| new.value != current[*k].value || new.unit != current[*k].unit;
        let others: Vec<(usize, Entry)> =
            candidate.iter().enumerate().filter(is_other).map(|(k, new)| (k, new.clone())).collect();
        let has_its_units = others.iter().all(|(k, new)| new.unit == current[*k].unit);
        let (cost, form) =
            site.with(&mut self.extractor, self.graph, self.system, self.roots, (others, least));
        (cost, form.filter(|_| has_its_units))
    }

    /// The definitions, each window of them in the form that is cheapest by itself, and then all of them, by what can
    /// be seen near each, as long as limits allow that anew. Tells whether all were looked at.
    ///
    /// A trial looks at everything that the roots need, so that a search over all definitions of a large function takes
    /// the square of its length. Windows take its length, and hide nothing but what is shared far apart, which is
    /// extracted from all of them in the end.
    fn by_windows(&mut self, original: Vec<Entry>) -> (Found, bool) {
        let mut current = original;
        let windows = windows(self.system, &current, self.roots);
        let n = windows.len();
        for (w, window) in windows.into_iter().enumerate() {
            self.system.effort.allow(w + 1, n);
            let inside: BTreeSet<usize> = window.iter().copied().collect();
            let mut roots: BTreeSet<usize> =
                window.iter().copied().filter(|k| self.roots.contains(k)).collect();
            for user in needed(self.system, &current, self.roots).into_iter().filter(|k| !inside.contains(k))
            {
                let atoms = current[user].value.iter().flat_map(|(m, _)| m).map(|(atom, _)| *atom);
                roots.extend(atoms.flat_map(|atom| self.system.needs(atom)).filter(|k| inside.contains(k)));
            }
            let roots: Vec<usize> = roots.into_iter().collect();
            self.system.look_at(Some((&inside, current.len())));
            let mut search = Search {
                graph: &mut *self.graph,
                system: &mut *self.system,
                digits: &mut *self.digits,
                roots: &roots,
                keeps_digits: false,
                extractor: std::mem::take(&mut self.extractor),
            };
            let extracted = search.extracted(&current);
            (Found { current, .. }, _) =
                search.by_rounds(Found { best: extracted, current }, Some(SLACKS[0]));
            self.extractor = search.extractor;
            self.system.look_at(None);
        }
        let n_numbers = self.system.numbers.n_terms;
        self.system.effort.go_on(n_numbers);
        let mut found = (Found { best: self.extracted(&current), current }, true);
        for slack in SLACKS {
            if found.1 {
                found = self.by_rounds(found.0, Some(slack));
            }
        }
        found
    }

    /// The form found without those of its cancellations that can be avoided at no cost.
    fn without_cancellations(&mut self, mut best: (i64, Vec<Entry>), mut current: Vec<Entry>) -> Vec<Entry> {
        for k in needed(self.system, &current, self.roots) {
            if self.system.effort.is_spent(self.graph) {
                break;
            }
            let candidates = [self.gathered(&current, k), self.gathered_as_it_is(&current, k)];
            let trials = candidates.into_iter().flatten().map(|c| (self.extracted(&c), c));
            let Some((trial, candidate)) = trials.min_by_key(|(trial, _)| trial.0) else { continue };
            if trial.0 <= best.0 {
                (best, current) = (trial, candidate);
            }
        }
        if self.keeps_digits { self.steadied(best, current).1 } else { best.1 }
    }

    /// The form found without those of its cancellations that lose digits which the inputs have, where avoiding them
    /// costs no more than it may.
    ///
    /// Value by value, operands first: each that loses digits is put over the denominators in it, whichever way loses
    /// fewest.
    fn steadied(&mut self, best: (i64, Vec<Entry>), current: Vec<Entry>) -> (i64, Vec<Entry>) {
        let worst = |losses: &[f64]| losses.iter().fold(0.0, |max: f64, loss| max.max(*loss));
        let before = match self.losses(&best.1, self.roots) {
            Some(losses) if worst(&losses) > WORTH_MENDING => losses,
            _ => return best,
        };
        let mut entries = current;
        for k in needed(self.system, &entries, self.roots) {
            if self.system.effort.has_seen_enough() || self.system.numbers_are_too_long() {
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
        let is_too_costly = trial.0 - best.0 > best.0 * MAX_EXTRA.0 / MAX_EXTRA.1;
        if is_too_costly || worst(&after) * GAIN > worst(&before) { best } else { trial }
    }

    fn losses(&mut self, entries: &[Entry], of: &[usize]) -> Option<Vec<f64>> {
        self.digits.losses(self.graph, self.system, entries, of)
    }

    /// Polynomial `k` over the denominators in it, with none, one, two, .. of what it is made of multiplied out, the
    /// latest first.
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
            let power = |m: &Monomial| m.iter().find(|(a, _)| *a == atom).map_or(Exponent::ZERO, |(_, q)| *q);
            entries[k].value.iter().map(|(m, _)| power(m)).max()
        };
        let atoms: BTreeSet<u32> = entries[k].value.iter().flat_map(|(m, _)| m).map(|(a, _)| *a).collect();
        let shared = atoms.into_iter().filter_map(|a| Some((a, lowest(a).filter(|q| q.is_negative())?)));
        let shared: Monomial = shared.collect();
        if shared.is_empty() || entries[k].value.len() < 2 {
            return entries;
        }
        let inverse: Monomial = shared.iter().map(|(a, q)| (*a, -*q)).collect();
        let terms: Vec<_> = entries[k].value.iter().map(|(m, c)| (times(m, &inverse), *c)).collect();
        let value = self.system.collect(self.graph, terms);
        let numerator = self.system.atom_of(Atom::Poly(entries.len() as u32));
        entries.push(Entry { value, definition: None, unit: Coefficient::ONE });
        entries[k].value = vec![(times(&shared, &power(numerator, Exponent::ONE)), Coefficient::ONE)].into();
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
        while !self.system.effort.has_multiplied_enough() {
            // The latest polynomial first: earlier ones may come in with it.
            let open =
                value.iter().flat_map(|(m, _)| m).filter_map(|(atom, _)| match self.system.atom(*atom) {
                    Atom::Poly(inner) if !kept.contains(&inner) && self.system.is_in_view(inner) => {
                        Some(inner)
                    }
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
        let atom = self.system.atom_of(Atom::Poly(k as u32));
        let uses = |user: &usize| *user != k && entries[*user].value.needs(self.system).contains(&(k as u32));
        let users: Vec<usize> = needed(self.system, entries, self.roots).into_iter().filter(uses).collect();
        let mut scales: BTreeSet<Coefficient> = entries[k].value.iter().map(|(_, c)| *c).collect();
        for user in &users {
            for (m, c) in entries[*user].value.iter() {
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
            let mut candidate = entries.to_vec();
            let made = units::in_unit(self.graph, self.system, &mut candidate, &users, (k, scale));
            if made.is_none() {
                continue;
            }
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

    /// Every polynomial multiplied out, unless the roots have more than `most` terms then.
    fn all_flat(&mut self, entries: &[Entry], most: usize) -> Option<Vec<Entry>> {
        let mut candidate = entries.to_vec();
        let mut n_terms = 0;
        for k in 0..entries.len() {
            if let Some(value) = self.flattened(&candidate, k) {
                candidate[k].value = value;
            }
            if self.roots.contains(&k) {
                n_terms += candidate[k].value.len();
            }
            if n_terms > most {
                return None;
            }
        }
        Some(candidate)
    }

    /// Polynomial `k` multiplied out in everything that uses it.
    fn inlined(&mut self, entries: &[Entry], k: usize) -> Option<Vec<Entry>> {
        let mut candidate: Option<Vec<Entry>> = None;
        let (mut before, mut after) = (entries[k].value.len(), 0);
        for user in needed(self.system, entries, self.roots) {
            let uses = |(atom, _): &(u32, Exponent)| self.system.atom(*atom) == Atom::Poly(k as u32);
            let is_user = entries[user].value.needs(self.system).contains(&(k as u32));
            if !is_user || !entries[user].value.iter().any(|(m, _)| m.iter().any(uses)) {
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
