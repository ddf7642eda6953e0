//! Units in which the fewest numbers are left: every value may be measured in a unit of its own.
//!
//! With `k = lambda_k k'` for every polynomial but those that are results or arguments of functions, a term `c a b` of
//! `k` becomes `(c lambda_a lambda_b / lambda_k) a' b'`. That its number is one is a linear equation for the logarithms
//! of the units `lambda`. As many of these equations as can hold at once are taken greedily, first those of terms where
//! a number costs an operation; only integer powers of numbers that are known to be positive occur. A mass matrix and
//! its right side, for example, are divided by the mass, and lengths are measured in radii. Deliberately does not know
//! what a value is for.

use std::collections::{BTreeMap, BTreeSet};

use num_integer::Integer;

use super::exponent::Exponent;
use super::numbers::Coefficient;
use super::polynomial::{Atom, Entry, Monomial, System, needed};
use super::price::price_of_number;
use hamel_expr::Graph;

/// A higher power of a number is not looked for.
const MAX_EXPONENT: i32 = 4;

/// Integer powers of units.
type Powers = BTreeMap<usize, i32>;

/// `number prod lambda^powers = 1`, where it is wanted.
#[derive(Clone, Debug)]
struct Equation {
    powers: Powers,
    number: Coefficient,
    /// What a number costs in the term that the equation is about.
    price: i64,
}

/// The units found so far, each a number times powers of those that are still free.
#[derive(Clone, Debug, Default)]
struct Units {
    solved: BTreeMap<usize, (Powers, Coefficient)>,
    /// What mentions a unit that is free.
    mentions: BTreeMap<usize, BTreeSet<usize>>,
}

/// The entries in other units, in every order of preference that is tried; values that became equal are one.
pub(super) fn in_other_units(
    graph: &mut Graph,
    system: &mut System,
    entries: &[Entry],
    roots: &[usize],
) -> Vec<Vec<Entry>> {
    let equations = equations(system, entries, roots);
    let (there, wanted): (Vec<_>, Vec<_>) = equations.into_iter().partition(|e| e.number.is_unit());
    let costly = |list: &[Equation], is_costly: bool| -> Vec<Equation> {
        let mut list: Vec<Equation> = list.iter().filter(|e| (e.price > 0) == is_costly).cloned().collect();
        list.sort_by_key(|e| std::cmp::Reverse(e.price));
        list
    };
    let (keep, gain, rest) = (costly(&there, true), costly(&wanted, true), costly(&wanted, false));
    let orders = [[&keep, &gain, &rest], [&gain, &keep, &rest]];
    let (mut found, mut tried) = (Vec::new(), Vec::new());
    for order in orders {
        let mut units = Units::default();
        for equation in order.into_iter().flatten() {
            // One that cannot hold besides the others is passed over.
            _ = units.take(graph, system, entries, equation);
        }
        if !tried.contains(&units.solved) {
            found.extend(units.applied(graph, system, entries, roots));
            tried.push(units.solved);
        }
    }
    found
}

/// The equation of every term that units other than one could change.
fn equations(system: &System, entries: &[Entry], roots: &[usize]) -> Vec<Equation> {
    let alive = needed(system, entries, roots);
    let mut fixed: BTreeSet<usize> = roots.iter().copied().collect();
    let factors = || alive.iter().flat_map(|k| entries[*k].value.iter()).flat_map(|(m, _)| m);
    for (atom, q) in factors() {
        match system.atom(*atom) {
            Atom::Function(..) | Atom::Atan2(..) => fixed.extend(system.needs(*atom)),
            Atom::Poly(k) if !q.is_whole() => _ = fixed.insert(k as usize),
            Atom::Poly(_) | Atom::Input(_) => {}
        }
    }
    let powers_of = |k: usize, m: &Monomial| {
        let mut powers = Powers::new();
        if !fixed.contains(&k) {
            powers.insert(k, -1);
        }
        for (atom, q) in m {
            if let Atom::Poly(j) = system.atom(*atom)
                && !fixed.contains(&(j as usize))
            {
                *powers.entry(j as usize).or_insert(0) += q.truncated();
            }
        }
        powers.retain(|_, n| *n != 0);
        powers
    };
    let mut equations = Vec::new();
    for k in &alive {
        for (position, (m, c)) in entries[*k].value.iter().enumerate() {
            let powers = powers_of(*k, m);
            if !powers.is_empty() {
                let price = price_of_number(&entries[*k].value, position);
                equations.push(Equation { powers, number: *c, price });
            }
        }
    }
    equations
}

impl Units {
    /// Takes one more equation; none, and nothing is changed, if that cannot hold besides the others.
    fn take(
        &mut self,
        graph: &mut Graph,
        system: &mut System,
        entries: &[Entry],
        wanted: &Equation,
    ) -> Option<()> {
        if system.effort.has_measured_enough_units() {
            return None;
        }
        system.effort.units += 1 + self.mentions.len();
        let (mut powers, number) = self.reduced(graph, system, &wanted.powers, wanted.number)?;
        if number.is_unit() {
            // Units are positive: x^2 = y^2 is x = y.
            let common = powers.values().fold(0, |gcd, n| gcd.gcd(n));
            powers.values_mut().for_each(|n| *n /= common);
        }
        // A value with a name keeps its unit where another one can change.
        let pivot = powers
            .iter()
            .filter(|(_, n)| n.abs() == 1)
            .min_by_key(|(k, _)| (entries[**k].definition.is_some(), std::cmp::Reverse(**k)));
        let (&pivot, &n) = pivot?;
        let others: Powers = powers.iter().filter(|(k, _)| **k != pivot).map(|(k, m)| (*k, -n * m)).collect();
        let number = if n > 0 { system.numbers.div(graph, Coefficient::ONE, number)? } else { number };
        let number = Coefficient { negative: false, ..number };
        if !system.numbers.is_positive(graph, number) {
            return None;
        }
        let one = Units { solved: BTreeMap::from([(pivot, (others.clone(), number))]), ..Units::default() };
        let mut solved = vec![(pivot, (others, number))];
        for k in self.mentions.get(&pivot).into_iter().flatten() {
            let (powers, number) = &self.solved[k];
            solved.push((*k, one.reduced(graph, system, powers, *number)?));
        }
        self.mentions.remove(&pivot);
        for (k, value) in solved {
            for free in value.0.keys() {
                self.mentions.entry(*free).or_default().insert(k);
            }
            self.solved.insert(k, value);
        }
        Some(())
    }

    /// `number prod lambda^powers` in terms of the units that are free.
    fn reduced(
        &self,
        graph: &mut Graph,
        system: &mut System,
        powers: &Powers,
        number: Coefficient,
    ) -> Option<(Powers, Coefficient)> {
        let (mut free, mut total) = (Powers::new(), number);
        for (k, n) in powers {
            let Some((inner, factor)) = self.solved.get(k) else {
                *free.entry(*k).or_insert(0) += n;
                continue;
            };
            for (j, m) in inner {
                *free.entry(*j).or_insert(0) += n * m;
            }
            if n.abs() > MAX_EXPONENT {
                return None;
            }
            for _ in 0..n.abs() {
                total = if *n > 0 {
                    system.numbers.mul(graph, total, *factor)
                } else {
                    system.numbers.div(graph, total, *factor)?
                };
            }
        }
        free.retain(|_, n| *n != 0);
        Some((free, Coefficient { negative: false, ..total }))
    }

    /// The entries in these units; none where nothing changes, or where a division would not be safe.
    fn applied(
        &self,
        graph: &mut Graph,
        system: &mut System,
        entries: &[Entry],
        roots: &[usize],
    ) -> Option<Vec<Entry>> {
        let mut scaled = entries.to_vec();
        let mut changed = false;
        let users = users(system, entries, roots);
        for (k, (_, unit)) in &self.solved {
            if !unit.is_unit() {
                let is_used_by = users.get(k).map_or(&[][..], Vec::as_slice);
                let touched = is_used_by.iter().chain([k]).map(|k| 1 + scaled[*k].value.len());
                system.effort.units += touched.sum::<usize>();
                if system.effort.has_measured_enough_units() {
                    return None;
                }
                in_unit(graph, system, &mut scaled, is_used_by, (*k, *unit))?;
                changed = true;
            }
        }
        if !changed {
            return None;
        }
        // What is another value by now is replaced by it.
        for k in needed(system, &scaled, roots) {
            let [(m, c)] = &*scaled[k].value else { continue };
            let is_other = c.is_unit() && matches!(m.as_slice(), [(_, q)] if *q == Exponent::ONE);
            if roots.contains(&k) || !is_other {
                continue;
            }
            for user in needed(system, &scaled, roots) {
                let value = scaled[k].value.clone();
                if let Some(replaced) = system.substitute(graph, &scaled[user].value, k, &value) {
                    scaled[user].value = replaced;
                }
            }
        }
        Some(scaled)
    }
}

/// The polynomials that use each, in the order in which the roots need them.
pub(super) fn users(system: &System, entries: &[Entry], roots: &[usize]) -> BTreeMap<usize, Vec<usize>> {
    let mut users: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for user in needed(system, entries, roots) {
        for k in entries[user].value.needs(system) {
            users.entry(*k as usize).or_default().push(user);
        }
    }
    users
}

/// Measures polynomial `k` in a unit, which its `users` make up for. Nothing, with some of the entries changed, where a
/// division would not be safe.
pub(super) fn in_unit(
    graph: &mut Graph,
    system: &mut System,
    entries: &mut [Entry],
    users: &[usize],
    (k, unit): (usize, Coefficient),
) -> Option<()> {
    entries[k].value = system.over_number(graph, &entries[k].value, unit)?;
    entries[k].unit = system.numbers.mul(graph, entries[k].unit, unit);
    let atom = system.atom_of(Atom::Poly(k as u32));
    for user in users {
        entries[*user].value = system.times_number(graph, &entries[*user].value, atom, unit)?;
    }
    Some(())
}
