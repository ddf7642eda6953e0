//! Reconstructed coordinates and initial values.
//!
//! Deliberately does not know: the equations of reconstruction.

use std::collections::{BTreeMap, BTreeSet};

use super::draft::{DeclaredAs, Located, ModelBuilder, ReconstructionDraft, Way};
use super::symbols::Special;
use crate::algebra::LieAlgebra;
use crate::spec::diagnostic::Span;
use crate::spec::group::Group;
use crate::spec::layout::GroupBlock;
use crate::spec::layout::Layout;
use crate::spec::limits::MAX_DIM;
use crate::spec::model::*;
use crate::spec::names;
use crate::spec::shape::Shape;
use crate::spec::value::Value;
use hamel_expr::{ExprId, Number, SymbolId};

impl Group {
    /// Groups by the way they are written, without R^n.
    pub(in crate::spec) const NAMED: &'static [(&'static str, Group)] = &[
        ("SO(2)", Group::PlanarRotation),
        ("SO(3)", Group::Rotation),
        ("SE(2)", Group::PlanarMotion),
        ("SE(3)", Group::Motion),
    ];

    /// Groups of matrices by their families, with the least number that makes one without `matrices(..)`.
    pub(in crate::spec) const OF_MATRICES: &'static [(&'static str, usize)] =
        &[("SO(n)", 4), ("SE(n)", 4), ("SU(n)", 2), ("U(n)", 1), ("GL(n)", 1), ("SL(n)", 2), ("Sp(n)", 2)];
}

impl ModelBuilder {
    /// Coordinates of a group that the velocities `from` of the algebra move; with none, all velocities of the algebra.
    ///
    /// SO(2) takes one name, an angle; SO(3) one name `q` and has coordinates `qw, qx, qy, qz`; SE(2) three names,
    /// angle and position; SE(3) two names `q, r` and has `qw, .., qz, r1, r2, r3`; R^n one name `x` for `x1, .., xn`,
    /// or `n` names. A matrix group takes one name `R` and has the entries of a matrix, `R11, R12, ..`, or of a real
    /// and an imaginary part, `R_re11, ..`; and one more name for each space of a semidirect product.
    pub fn reconstruct_group(
        &mut self,
        names: &[&str],
        group: Group,
        from: &[&str],
        doc: &str,
    ) -> Vec<Value> {
        let here = self.here;
        let names: Vec<(&str, Option<Span>)> = names.iter().map(|n| (*n, here)).collect();
        let from = from.iter().map(|n| ((*n).to_owned(), here)).collect();
        self.located_group(&names, group, from, doc)
    }

    pub(in crate::spec) fn located_group(
        &mut self,
        names: &[(&str, Option<Span>)],
        group: Group,
        from: Vec<Located>,
        doc: &str,
    ) -> Vec<Value> {
        let span = self.here;
        let plain: Vec<&str> = names.iter().map(|(n, _)| *n).collect();
        let Some(blocks) = group.coordinates(&plain) else {
            let message = format!("{} for the coordinates of {group}", counted(names.len(), "name", "names"));
            self.problem(span, message, group.example());
            self.broken.insert("reconstruct");
            return Vec::new();
        };
        if !self.has_room(blocks.iter().map(|block| block.components.len()).sum()) {
            return Vec::new();
        }
        let mut draft = self.new_reconstruction(Way::Group(group, from), doc);
        let values = blocks.iter().map(|block| self.declare_block(block, names[block.of].1, &mut draft));
        let values = values.collect();
        self.here = span;
        self.reconstructions.push(draft);
        values
    }

    /// Coordinates with given rates, which may contain coordinates that are reconstructed before: one name for a
    /// number, one name `x` for a vector with components `x1, x2, ..`, or as many names as the vector has entries.
    pub fn reconstruct_rate(&mut self, names: &[&str], rate: &Value, doc: &str) -> Vec<Value> {
        let here = self.here;
        let names: Vec<(&str, Option<Span>)> = names.iter().map(|n| (*n, here)).collect();
        self.located_rate(&names, rate, doc)
    }

    pub(in crate::spec) fn located_rate(
        &mut self,
        names: &[(&str, Option<Span>)],
        rate: &Value,
        doc: &str,
    ) -> Vec<Value> {
        let span = self.here;
        let single = |(name, _): &(&str, Option<Span>)| vec![(*name).to_owned()];
        let components: Vec<Vec<String>> = match (names, rate.shape()) {
            ([_], Shape::Scalar) => names.iter().map(single).collect(),
            (_, Shape::Vector(n)) if n == names.len() => names.iter().map(single).collect(),
            ([(name, _)], Shape::Vector(n)) => vec![Layout::Vector(n).names(name)],
            _ => {
                self.other_rate(names.len(), rate);
                return Vec::new();
            }
        };
        if !self.has_room(components.iter().map(Vec::len).sum()) {
            return Vec::new();
        }
        let mut draft = self.new_reconstruction(Way::Rate(rate.entries().to_vec()), doc);
        let mut values = Vec::new();
        for (of, ((name, span), components)) in names.iter().zip(components).enumerate() {
            let block = GroupBlock { of, name: (*name).to_owned(), components, n_columns: None };
            values.push(self.declare_block(&block, *span, &mut draft));
        }
        self.here = span;
        self.reconstructions.push(draft);
        values
    }

    fn other_rate(&mut self, n_names: usize, rate: &Value) {
        let message = format!("{} for a rate that is {}", counted(n_names, "name", "names"), rate.shape());
        self.problem(self.here, message, "give one name, or one per entry of the vector");
        self.broken.insert("reconstruct");
    }

    /// Numbers that are reconstructed together, before their rates are known.
    pub(in crate::spec) fn declared_rates(
        &mut self,
        names: &[(&str, Option<Span>)],
        doc: &str,
    ) -> Option<ReconstructionDraft> {
        if !self.has_room(names.len()) {
            return None;
        }
        let span = self.here;
        let mut draft = self.new_reconstruction(Way::Rate(Vec::new()), doc);
        for (of, (name, span)) in names.iter().enumerate() {
            let (name, components) = ((*name).to_owned(), vec![(*name).to_owned()]);
            let block = GroupBlock { of, name, components, n_columns: None };
            self.declare_block(&block, *span, &mut draft);
        }
        self.here = span;
        Some(draft)
    }

    /// Numbers that are reconstructed together, with their rates.
    pub(in crate::spec) fn with_rates(&mut self, mut draft: ReconstructionDraft, rate: &Value) {
        if rate.shape() != Shape::Vector(draft.symbols.len()) {
            self.other_rate(draft.symbols.len(), rate);
            return;
        }
        draft.way = Way::Rate(rate.entries().to_vec());
        self.reconstructions.push(draft);
    }

    fn has_room(&mut self, n: usize) -> bool {
        let taken: usize = self.reconstructions.iter().map(|r| r.symbols.len()).sum();
        if taken + n <= MAX_DIM {
            return true;
        }
        if self.broken.insert("reconstruct") {
            let message = format!("the model reconstructs more than {MAX_DIM} coordinates");
            self.problem(self.here, message, "");
        }
        false
    }

    fn new_reconstruction(&self, way: Way, doc: &str) -> ReconstructionDraft {
        let (blocks, names, symbols) = (Vec::new(), Vec::new(), Vec::new());
        ReconstructionDraft { blocks, names, symbols, way, doc: doc.to_owned(), span: self.here }
    }

    fn declare_block(
        &mut self,
        block: &GroupBlock,
        span: Option<Span>,
        draft: &mut ReconstructionDraft,
    ) -> Value {
        self.here = span;
        let GroupBlock { of: _, name, components, n_columns } = block;
        let is_vector = components.len() != 1 || components[0] != *name;
        if is_vector {
            self.declare(name, DeclaredAs::Reconstructed);
        }
        draft.blocks.push((name.clone(), components.len()));
        let mut entries = Vec::with_capacity(components.len());
        for component in components {
            let (symbol, expr) = self.new_symbol(component, DeclaredAs::Reconstructed);
            draft.names.push(component.clone());
            draft.symbols.push(symbol);
            entries.push(expr);
        }
        match (is_vector, entries.as_slice()) {
            (false, [only]) => Value::Scalar(*only),
            _ => {
                let value = match n_columns {
                    Some(columns) => {
                        Value::Matrix { rows: entries.len() / columns, columns: *columns, entries }
                    }
                    None => Value::Vector(entries),
                };
                self.bind(name, &value);
                value
            }
        }
    }

    /// The default initial value of a state variable or a reconstructed coordinate (a vector or a component); it
    /// contains parameters at most. Values of velocities that follow from the constraints are not used.
    pub fn initial(&mut self, name: &str, value: &Value) -> &mut Self {
        let here = self.here;
        self.initial.push((name.to_owned(), value.clone(), here));
        self
    }

    pub(super) fn check_reconstructions(
        &mut self,
        connection: Option<&[Vec<ExprId>]>,
    ) -> Vec<Reconstruction> {
        let mut result = Vec::new();
        for draft in self.reconstructions.clone() {
            let kind = match draft.way {
                Way::Rate(rate) => {
                    let allowed = [Special::QuasiVelocity, Special::Reconstructed];
                    let place = format!("rate of `{}`", draft.names.join(", "));
                    if rate.iter().any(|e| self.reports_stray(*e, draft.span, &place, &allowed)) {
                        continue;
                    }
                    Some(ReconstructionKind::Rate { rate })
                }
                Way::Group(group, from) => self.group_indices(&group, &from, draft.span).map(|elements| {
                    let xi: Vec<ExprId> =
                        elements.iter().map(|a| self.group_velocity(*a, connection)).collect();
                    match (group, xi.as_slice()) {
                        (Group::Matrices(group), _) => ReconstructionKind::Matrix { group, elements, xi },
                        (Group::PlanarRotation, &[omega]) => ReconstructionKind::Angle { omega },
                        (Group::Rotation, &[a, b, c]) => ReconstructionKind::Quaternion { omega: [a, b, c] },
                        (Group::PlanarMotion, &[omega, a, b]) => {
                            ReconstructionKind::PlanarPose { omega, v: [a, b] }
                        }
                        (Group::Motion, &[a, b, c, d, e, f]) => {
                            ReconstructionKind::Pose { omega: [a, b, c], v: [d, e, f] }
                        }
                        _ => ReconstructionKind::Translation { v: xi },
                    }
                }),
            };
            if let Some(kind) = kind {
                let ReconstructionDraft { blocks, names, symbols, doc, span, .. } = draft;
                result.push(Reconstruction { blocks, names, symbols, kind, doc, span });
            }
        }
        result
    }

    /// `xi^a = v^a - A^a_i xdot^i`.
    fn group_velocity(&mut self, a: usize, connection: Option<&[Vec<ExprId>]>) -> ExprId {
        let mut terms = vec![self.velocity_value(self.n_shape() + a)];
        for (i, coefficient) in connection.map_or(&[][..], |rows| &rows[a]).iter().enumerate() {
            let rate = self.velocity_value(i);
            let term = self.graph.mul(*coefficient, rate);
            terms.push(self.graph.neg(term));
        }
        self.graph.sum(&terms)
    }

    /// The basis elements whose velocities move the group. They have its brackets, and no bracket with another element
    /// has a component along them, so that `gdot = g xi` closes.
    pub(super) fn group_indices(
        &mut self,
        group: &Group,
        from: &[Located],
        span: Option<Span>,
    ) -> Option<Vec<usize>> {
        let expected = group.algebra()?;
        if self.broken.contains("velocity") {
            return None;
        }
        if self.has_algebroid() {
            let message = format!("an algebroid moves no {group}");
            self.problem(span, message, "give the rates: `reconstruct x by expression;`");
            return None;
        }
        let mut indices: Vec<usize> = Vec::new();
        for (name, span) in from {
            let found = self.original_indices(name);
            if found.is_empty() {
                self.unknown_algebra_velocity(name, *span);
                return None;
            }
            for k in found {
                if indices.contains(&k) {
                    self.problem(*span, format!("`{name}` is named twice"), "name every velocity once");
                    return None;
                }
                indices.push(k);
            }
        }
        let algebra = self.algebra.as_ref().map(|(algebra, _)| algebra.clone());
        let algebra = algebra.unwrap_or_else(|| LieAlgebra::abelian(0).into());
        if from.is_empty() {
            indices = (0..algebra.dim()).collect();
        }
        if indices.len() != group.dim() {
            let message = format!(
                "{} for {group}, which has dimension {}",
                counted(indices.len(), "velocity", "velocities"),
                group.dim()
            );
            // A block of the right dimension, or the first components.
            let mut blocks: BTreeMap<&str, usize> = BTreeMap::new();
            self.velocities.iter().for_each(|v| *blocks.entry(&v.block).or_default() += 1);
            let fitting = blocks.iter().find(|(_, size)| **size == group.dim()).map(|(block, _)| *block);
            let first: Vec<&str> =
                self.velocities.iter().take(group.dim()).map(|v| v.name.as_str()).collect();
            let help = match (from.first(), fitting) {
                (None, Some(block)) => format!("say which: `in {group} from {block};`"),
                (None, None) if first.len() == group.dim() => {
                    format!("say which, for example `in {group} from {};`", first.join(", "))
                }
                _ => "name the velocities of the algebra that move it".to_owned(),
            };
            self.problem(span, message, help);
            return None;
        }
        let mut place: Vec<Option<usize>> = vec![None; algebra.dim()];
        for (at, a) in indices.iter().enumerate() {
            place[*a] = Some(at);
        }
        for a in 0..algebra.dim() {
            for b in a + 1..algebra.dim() {
                let mut mismatch: BTreeMap<usize, (Number, Number)> = BTreeMap::new();
                for (c, q) in algebra.bracket(a, b) {
                    if let Some(at) = place[c] {
                        mismatch.insert(at, (q, Number::default()));
                    }
                }
                if let (Some(p), Some(r)) = (place[a], place[b]) {
                    for (at, q) in expected.bracket(p, r) {
                        mismatch.entry(at).or_default().1 = q.into();
                    }
                }
                let Some((at, (found, wanted))) = mismatch.into_iter().find(|(_, (x, y))| x != y) else {
                    continue;
                };
                let name = |k: usize| self.velocities.get(k).map_or("?", |v| v.name.as_str());
                let (a, b, c) = (name(a), name(b), name(indices[at]));
                let message = format!(
                    "the velocities do not move {group} alone: [{a}, {b}] has component {found} along {c}, not {wanted}"
                );
                let help = "name the velocities of a whole factor of the group in its order, for example `in SE(3) from \
                            Omega, V`";
                self.problem(span, message, help);
                return None;
            }
        }
        Some(indices)
    }

    pub(super) fn check_initial(&mut self) -> Vec<(String, ExprId)> {
        let params: BTreeSet<SymbolId> = self.params.iter().map(|p| p.symbol).collect();
        let defaults = self.default_values();
        let variables = self.state_variables();
        let mut result: Vec<(String, ExprId)> = Vec::new();
        let mut taken: BTreeSet<String> = BTreeSet::new();
        for (name, value, span) in self.initial.clone() {
            let is_definition = self.names.get(&name).is_some_and(|d| d.what == DeclaredAs::Definition);
            let target = self.values.get(&name).filter(|_| !is_definition);
            let components: Option<Vec<String>> =
                target.and_then(|v| v.entries().iter().map(|e| variables.get(e).cloned()).collect());
            let Some(components) = components else {
                match self.value_of_replaced(&name) {
                    Some(_) => self.replaced_at_the_start(&name, span),
                    None => self.unknown_variable(&name, span),
                }
                continue;
            };
            let Some(value) = self.fitted("initial value of", &name, &value, span) else { continue };
            for (component, e) in components.into_iter().zip(value.into_entries()) {
                if let Some(wrong) = self.graph.free_symbols(e).iter().find(|s| !params.contains(s)) {
                    let message = format!(
                        "initial value of `{name}` contains `{}`, which is not a parameter",
                        self.graph.name(*wrong)
                    );
                    self.problem(span, message, "initial values are made of numbers and parameters");
                    break;
                }
                if !taken.insert(component.clone()) {
                    let message = format!("initial value of `{component}` is given twice");
                    self.problem(span, message, "keep one of them");
                    break;
                }
                if let Some(other) = self.counterpart(&component).filter(|other| taken.contains(other)) {
                    let message = format!("`{component}` follows from the initial value of `{other}`");
                    self.problem(span, message, "keep one of them");
                    break;
                }
                let Some(number) = self.graph.eval_f64(e, &defaults).filter(|x| x.is_finite()) else {
                    let message = format!("initial value of `{component}` has no value at the defaults");
                    self.problem(span, message, "it divides by zero or leaves the domain of a function");
                    break;
                };
                let domain = self.base.iter().find(|c| c.name == component).map(|c| c.domain);
                if let Some(Domain::Interval(low, high)) = domain {
                    let ends = (self.graph.eval_f64(low, &defaults), self.graph.eval_f64(high, &defaults));
                    if let (Some(low), Some(high)) = ends
                        && !(low < number && number < high)
                    {
                        let message = format!(
                            "initial value {number} of `{component}` is not between {low} and {high}"
                        );
                        self.problem(span, message, "the domain of a coordinate is an open interval");
                        break;
                    }
                }
                result.push((component, e));
            }
        }
        self.start_configurations(&mut result);
        result
    }

    /// State variables and reconstructed coordinates: their names by expression.
    pub(super) fn state_variables(&mut self) -> BTreeMap<ExprId, String> {
        let mut symbols: Vec<(SymbolId, String)> = Vec::new();
        for c in &self.base {
            symbols.push((c.symbol, c.name.clone()));
        }
        let rates = self.base[..self.n_shape()].iter();
        symbols.extend(rates.map(|c| (c.velocity, c.velocity_name.clone())));
        symbols
            .extend(self.velocities.iter().chain(&self.quasi_velocities).map(|v| (v.symbol, v.name.clone())));
        symbols
            .extend(self.momenta.iter().flat_map(|m| m.components.iter().map(|(n, s, _)| (*s, n.clone()))));
        symbols.extend(self.advected.iter().flat_map(|a| a.components.iter().map(|(n, s)| (*s, n.clone()))));
        let first_order = self.first_order.iter().flat_map(|state| &state.components);
        symbols.extend(first_order.map(|(n, s)| (*s, n.clone())));
        let reconstructed = self.reconstructions.iter().flat_map(|r| r.symbols.iter().zip(&r.names));
        symbols.extend(reconstructed.map(|(s, n)| (*s, n.clone())));
        symbols.extend(self.carried_accelerations.iter().map(|(s, n)| (*s, n.clone())));
        symbols.into_iter().map(|(s, name)| (self.graph.sym(s), name)).collect()
    }

    fn unknown_variable(&mut self, name: &str, span: Option<Span>) {
        let declares = ["velocity", "coordinate", "advected", "state", "reconstruct", "quasi_velocity"];
        if declares.iter().any(|item| self.broken.contains(item)) {
            return;
        }
        let variables = self.state_variables();
        let mut known: BTreeSet<String> = variables.values().cloned().collect();
        for (block, value) in &self.values {
            let is_variable = value.entries().iter().all(|e| variables.contains_key(e));
            if is_variable && self.names.get(block).is_some_and(|d| d.what != DeclaredAs::Definition) {
                known.insert(block.clone());
            }
        }
        let help = names::suggest(name, known.iter().map(String::as_str));
        self.problem(span, format!("`{name}` is not a state variable"), help);
    }
}

pub(super) fn counted(n: usize, singular: &str, plural: &str) -> String {
    format!("{n} {}", if n == 1 { singular } else { plural })
}
