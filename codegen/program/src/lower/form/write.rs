//! Polynomials as definitions.
//!
//! Does not know: why polynomials have the form that they have.

use std::collections::{BTreeMap, BTreeSet};

use rustc_hash::FxHashMap;

use super::digits::Digits;
use super::numbers::Coefficient;
use super::polynomial::{Atom, Entry, System, needed};
use crate::lower::classes::Class;
use crate::lower::source::Source;
use hamel_expr::error::Error;
use hamel_expr::{Definition, ExprId, Graph, Node, Rational, Section, Style, SymbolId};

/// Turns polynomials back into definitions.
pub(super) struct Writer<'a> {
    pub(super) graph: &'a mut Graph,
    pub(super) system: &'a System,
    pub(super) entries: &'a [Entry],
    pub(super) digits: &'a mut Digits,
    /// What stands for each polynomial: a symbol, or the expression itself where that is no sum.
    pub(super) exprs: FxHashMap<usize, ExprId>,
    /// Units of the definitions that have one.
    pub(super) units: BTreeMap<SymbolId, ExprId>,
}

impl Writer<'_> {
    pub(super) fn sections(
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
                let expr = self.digits.best(self.graph, definition.expr);
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
        for (m, c) in self.entries[k].value.iter() {
            let number = self.system.numbers.expr(self.graph, *c);
            let number = self.digits.best(self.graph, number);
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
                factors.push((base, Rational::new(q.numerator().into(), q.denominator().into())));
            }
            let product = self.graph.power_product(&factors);
            terms.push(product.map_err(|_| Error::DivisionByZero { place: "a rewritten sum".into() })?);
        }
        Ok(self.graph.sum(&terms))
    }
}

/// What to append to the name of a value that is measured in a unit: `_over_m_r2`, or that it is scaled where that says
/// too much.
fn suffix(graph: &Graph, unit: ExprId) -> String {
    const MAX_SUFFIX: usize = 12;
    let text = graph.display(unit, Style::Plain).replace('*', "_").replace('^', "");
    let is_product = text.len() <= MAX_SUFFIX && text.chars().all(|c| c == '_' || c.is_ascii_alphanumeric());
    if is_product { format!("_over_{text}") } else { "_scaled".into() }
}
