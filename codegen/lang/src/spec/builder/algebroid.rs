//! A Lie algebroid of the user's own over the base coordinates: velocities, anchor, brackets.
//!
//! Deliberately does not know: whether the brackets are those of a Lie algebroid, how text is read.

use std::collections::{BTreeMap, BTreeSet};

use super::draft::{AlgebroidDraft, Located, ModelBuilder};
use crate::algebra::LieAlgebra;
use crate::spec::diagnostic::Span;
use crate::spec::layout::short_list;
use crate::spec::model::*;
use crate::spec::names;
use crate::spec::value::Value;
use hamel_expr::{ExprId, SymbolId};

/// A bracket of two elements of the basis, by name.
#[derive(Clone, Debug)]
pub(in crate::spec) struct SectionBracket {
    pub(in crate::spec) pair: [Located; 2],
    pub(in crate::spec) value: Value,
    pub(in crate::spec) span: Option<Span>,
}

impl ModelBuilder {
    /// Base velocities: none where an algebroid moves the coordinates.
    pub(super) fn n_shape(&self) -> usize {
        if self.algebroid.is_some() { 0 } else { self.base.len() }
    }

    /// Whether the velocities are those of an algebroid, and in no algebra.
    pub(in crate::spec) fn has_algebroid(&self) -> bool {
        self.algebroid.is_some()
    }

    pub(in crate::spec) fn located_algebroid(
        &mut self,
        basis: &[Located],
        velocities: &[Located],
        is_almost: bool,
        doc: &str,
    ) {
        let span = self.here;
        if let Some(first) = self.algebroid.as_ref().map(|a| a.span) {
            self.twice("algebroid", first);
            return;
        }
        if basis.len() != velocities.len() {
            let at = velocities.first().and_then(|(_, span)| *span);
            let counted =
                |n: usize, one: &str, several: &str| format!("{n} {}", if n == 1 { one } else { several });
            let velocities = counted(velocities.len(), "velocity", "velocities");
            let elements = counted(basis.len(), "element", "elements");
            let message = format!("{velocities} for {elements} of the basis");
            self.problem(at, message, "each element of the basis has one velocity");
            self.broken.extend(["algebroid", "velocity"]);
        }
        let named: Vec<(&str, Option<Span>)> = velocities.iter().map(|(n, s)| (n.as_str(), *s)).collect();
        self.located_velocities(LieAlgebra::abelian(velocities.len()).into(), &named, &[], doc);
        self.here = span;
        let basis = basis.iter().map(|(name, _)| name.clone()).collect();
        let (rates, brackets) = (Vec::new(), Vec::new());
        self.algebroid = Some(AlgebroidDraft { basis, is_almost, span, rates, anchor: None, brackets });
    }

    /// The rate of a coordinate (a vector or a component) by the velocities of the algebroid.
    pub(in crate::spec) fn anchor(&mut self, rate: &str, value: &Value) {
        let here = self.here;
        if let Some(draft) = &mut self.algebroid {
            draft.rates.push((rate.to_owned(), value.clone(), here));
        }
    }

    /// Takes the anchor as it is declared: names of rates of coordinates stand for their values from here on.
    pub(in crate::spec) fn settle_anchor(&mut self) {
        let Some(draft) = self.algebroid.clone() else { return };
        let n = self.base.len();
        let mut rows: Vec<Option<ExprId>> = vec![None; n];
        let is_fine = draft.rates.iter().all(|(name, value, span)| {
            let Some(value) = self.fitted("anchor on", name, value, *span) else {
                if !self.values.contains_key(name) {
                    let known: Vec<&str> = self.base.iter().map(|c| c.velocity_name.as_str()).collect();
                    let help = names::suggest(name, known);
                    self.problem(*span, format!("`{name}` is not the rate of a coordinate"), help);
                }
                return false;
            };
            let target = self.values[name].clone();
            for (rate, e) in target.into_entries().into_iter().zip(value.into_entries()) {
                let at = (0..n).find(|i| self.is_symbol(rate, self.base[*i].velocity));
                let Some(i) = at else {
                    let known: Vec<&str> = self.base.iter().map(|c| c.velocity_name.as_str()).collect();
                    let help = names::suggest(name, known);
                    self.problem(*span, format!("`{name}` is not the rate of a coordinate"), help);
                    return false;
                };
                if rows[i].replace(e).is_some() {
                    let name = self.base[i].velocity_name.clone();
                    self.problem(*span, format!("anchor on `{name}` is given twice"), "keep one of them");
                    return false;
                }
                if !self.is_anchor(e, name, *span) {
                    return false;
                }
            }
            true
        });
        if !is_fine {
            self.broken.extend(["algebroid", "velocity"]);
            return;
        }
        let zero = self.graph.zero();
        let velocities: Vec<SymbolId> = self.velocities.iter().map(|v| v.symbol).collect();
        let (mut values, mut anchor) = (BTreeMap::new(), Vec::new());
        for (i, row) in rows.into_iter().enumerate() {
            let e = row.unwrap_or(zero);
            values.insert(self.base[i].velocity, e);
            anchor.push(velocities.iter().map(|v| self.graph.diff(e, *v)).collect());
        }
        if let Some(draft) = &mut self.algebroid {
            draft.anchor = Some(anchor);
        }
        self.rewrite(&values);
    }

    /// Whether the rate of a coordinate is linear in the velocities, with coefficients on the base.
    fn is_anchor(&mut self, e: ExprId, name: &str, span: Option<Span>) -> bool {
        let velocities: Vec<SymbolId> = self.velocities.iter().map(|v| v.symbol).collect();
        let params = self.params.iter().map(|p| p.symbol).chain(self.base.iter().map(|c| c.symbol));
        let allowed: BTreeSet<SymbolId> = params.chain(velocities.iter().copied()).collect();
        let free = self.graph.free_symbols(e);
        if let Some(wrong) = free.iter().find(|s| !allowed.contains(s)) {
            let message = format!("anchor on `{name}` contains `{}`", self.graph.name(*wrong));
            self.problem(span, message, "it is made of velocities, base coordinates and parameters");
            return false;
        }
        let occurring = self.occurring(e, &velocities);
        let parts = self.graph.affine_parts(e, &occurring);
        if parts.is_some_and(|(_, rest)| rest == self.graph.zero()) {
            return true;
        }
        let known: Vec<String> = self.velocities.iter().map(|v| v.name.clone()).collect();
        let message = format!("anchor on `{name}` is not linear in the velocities");
        self.problem(span, message, short_list("the velocities are", &known));
        false
    }

    /// A bracket, whose value is a combination of `sections` with coefficients on the base.
    pub(in crate::spec) fn section_bracket(&mut self, rule: SectionBracket, sections: &[SymbolId]) {
        let Some(draft) = self.algebroid.clone() else { return };
        let mut pair = Vec::new();
        for (name, span) in &rule.pair {
            match draft.basis.iter().position(|b| b == name) {
                Some(k) => pair.push(k),
                None => {
                    let help = names::suggest(name, draft.basis.iter().map(String::as_str));
                    self.problem(*span, format!("`{name}` is not a basis element"), help);
                }
            }
        }
        let &[a, b] = pair.as_slice() else { return };
        let names = [&draft.basis[a], &draft.basis[b]];
        if a == b {
            let message = format!("bracket [{}, {}] vanishes", names[0], names[1]);
            self.problem(rule.span, message, "remove it");
            return;
        }
        if draft.brackets.iter().any(|own| own.pair == [a.min(b), a.max(b)]) {
            let message = format!("bracket [{}, {}] is given twice", names[0], names[1]);
            self.problem(rule.span, message, "antisymmetry need not be written");
            return;
        }
        let params = self.params.iter().map(|p| p.symbol).chain(self.base.iter().map(|c| c.symbol));
        let allowed: BTreeSet<SymbolId> = params.chain(sections.iter().copied()).collect();
        let combination = rule.value.scalar("bracket").ok().and_then(|e| {
            let free = self.graph.free_symbols(e);
            let zero = self.graph.zero();
            let parts = self.graph.affine_parts(e, sections).filter(|(_, rest)| *rest == zero);
            parts.filter(|_| free.iter().all(|s| allowed.contains(s)))
        });
        let Some((slopes, _)) = combination else {
            let message = "expected a combination of basis elements with coefficients on the base";
            let help = "coefficients are made of base coordinates and parameters: `[e1, e2] = x*e2;`";
            self.problem(rule.span, message, help);
            return;
        };
        let mut value = Vec::new();
        for (c, e) in slopes.into_iter().enumerate() {
            let e = if a < b { e } else { self.graph.neg(e) };
            if e != self.graph.zero() {
                value.push((c, e));
            }
        }
        let own = OwnBracket { pair: [a.min(b), a.max(b)], value, span: rule.span };
        if let Some(draft) = &mut self.algebroid {
            draft.brackets.push(own);
        }
    }

    /// The algebroid, without what has no meaning beside one.
    pub(super) fn check_algebroid(&mut self) -> Option<OwnAlgebroid> {
        let draft = self.algebroid.clone()?;
        let action = self.action.as_ref().map(|(_, span)| ("action", *span));
        let connection = self.connection.first().map(|(_, _, span)| ("connection", *span));
        let derived = self.derived_connection.map(|(_, span)| ("connection", span));
        let stage = self.stages.first().map(|stage| ("stage", stage.span));
        for (item, span) in [action, connection.or(derived), stage].into_iter().flatten() {
            let message = format!("`{item}` beside an algebroid has no use");
            self.problem(span, message, "anchor and brackets say everything about the frame");
        }
        let AlgebroidDraft { basis, is_almost, span, anchor, brackets, .. } = draft;
        Some(OwnAlgebroid { basis, is_almost, anchor: anchor?, brackets, span })
    }
}
