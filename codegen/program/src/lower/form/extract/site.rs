//! Single polynomials tried in a form whose divisors are extracted.
//!
//! Does not know: which polynomials are worth a trial.

use std::collections::BTreeSet;

use super::{Extractor, Known, Pass};
use crate::lower::form::polynomial::{Entry, System, needed};
use crate::lower::form::price::cost;
use hamel_expr::Graph;

/// A form with its divisors extracted, in which single polynomials are tried.
pub(in crate::lower::form) struct Site {
    entries: Vec<Entry>,
    landmarks: Vec<(u32, Known)>,
    /// Of the extractor whose divisors the landmarks are.
    generation: usize,
}

impl Site {
    /// The form, with every polynomial that is a divisor for a landmark.
    pub(in crate::lower::form) fn new(
        extractor: &mut Extractor,
        graph: &mut Graph,
        system: &mut System,
        entries: Vec<Entry>,
        roots: &[usize],
    ) -> Site {
        let active = needed(system, &entries, roots);
        let mut pass = Pass {
            graph,
            system,
            extractor,
            touched: Vec::new(),
            queue: Vec::new(),
            candidates: Vec::new(),
            active: Vec::new(),
        };
        for k in active {
            pass.remember(&entries, k);
        }
        let mut landmarks = Vec::new();
        for divisor in std::mem::take(&mut pass.touched) {
            if let Some(known) = extractor.known[divisor as usize].take() {
                landmarks.push((divisor, known));
            }
        }
        Site { entries, landmarks, generation: extractor.generation }
    }

    /// What the form costs with other polynomials in the place of some, common divisors extracted from these alone, and
    /// that form where it costs less than `least`.
    pub(in crate::lower::form) fn with(
        &mut self,
        extractor: &mut Extractor,
        graph: &mut Graph,
        system: &mut System,
        roots: &[usize],
        (others, least): (Vec<(usize, Entry)>, i64),
    ) -> (i64, Option<Vec<Entry>>) {
        extractor.forget_if_large();
        if self.generation != extractor.generation {
            let entries = std::mem::take(&mut self.entries);
            *self = Site::new(extractor, graph, system, entries, roots);
        }
        let n = self.entries.len();
        let changed: BTreeSet<usize> = others.iter().map(|(k, _)| *k).collect();
        let mut before = Vec::with_capacity(others.len());
        for (k, entry) in others {
            before.push((k, std::mem::replace(&mut self.entries[k], entry)));
        }
        let alive = needed(system, &self.entries, roots);
        let mut is_alive = vec![false; n];
        for k in &alive {
            is_alive[*k] = true;
        }
        let is_there = |(_, known): &&(u32, Known)| match known {
            Known::One => true,
            // What a changed polynomial was is nowhere any more.
            Known::Entry { k, .. } => is_alive[*k] && !changed.contains(k),
        };
        let landmarks: Vec<(u32, Known)> = self.landmarks.iter().filter(is_there).copied().collect();
        let active = alive.into_iter().filter(|k| changed.contains(k)).collect();
        extractor.extract_among(graph, system, &mut self.entries, active, &landmarks);
        let cost = cost(system, &self.entries, roots);
        let form = (cost < least).then(|| self.entries.clone());
        self.entries.truncate(n);
        for (k, entry) in before {
            self.entries[k] = entry;
        }
        (cost, form)
    }
}
