//! Quasi-velocities of a frame, `u = S(x, t) y`, in the place of the velocities that they are made of.
//!
//! Once a frame is settled, every name that stood for a replaced velocity stands for its value `T u`, `T = S^-1`, so
//! that whatever is written afterwards is written in the velocities of the frame.
//!
//! Deliberately does not know: anchors and brackets, what the velocities are used for.

use std::collections::{BTreeMap, BTreeSet};

use super::draft::{DeclaredAs, FrameDraft, ModelBuilder};
use crate::algebra::tableau::{MAX_COFACTORS, MAX_DETERMINANT, adjugate, determinant, solve_symbolic};
use crate::spec::diagnostic::Span;
use crate::spec::layout::short_list;
use crate::spec::model::*;
use crate::spec::value::Value;
use hamel_expr::{ExprId, Node, Rational, SymbolId};

impl ModelBuilder {
    /// A quasi-velocity of the frame, a combination of velocities with coefficients on the base; the frame is complete
    /// with [`ModelBuilder::settle_frame`].
    ///
    /// ```
    /// use hamel_lang::spec::{Domain, ModelBuilder};
    ///
    /// let mut b = ModelBuilder::new("plane");
    /// let (r, r_dot) = b.coordinate("r", Domain::Real, "");
    /// let (_, phi_dot) = b.coordinate("phi", Domain::Angle, "");
    /// let turned = r.mul(b.graph(), &phi_dot).unwrap();
    /// b.frame_velocity("u", &r_dot, "").frame_velocity("v", &turned, "").settle_frame();
    /// let v = b.value("v").unwrap().clone();
    /// let energy = v.mul(b.graph(), &v).unwrap();
    /// let model = b.lagrangian(&energy).clone().build().unwrap();
    /// assert_eq!(model.all_velocities()[1].0, "v");
    /// ```
    pub fn frame_velocity(&mut self, name: &str, value: &Value, doc: &str) -> &mut Self {
        let span = self.here;
        let before = self.problems.len();
        let (symbol, _) = self.new_symbol(name, DeclaredAs::FrameVelocity);
        if self.problems.len() > before {
            self.broken.insert("frame");
            return self;
        }
        let Ok(value) = value.scalar("frame") else {
            let message = format!("quasi-velocity `{name}` must be a number, found {}", value.shape());
            self.problem(span, message, "name the components one by one");
            self.broken.insert("frame");
            return self;
        };
        let (name, doc) = (name.to_owned(), doc.to_owned());
        self.frame_velocities.push(FrameDraft { name, symbol, value, doc, span });
        self
    }

    /// Puts the quasi-velocities that are declared in the place of the velocities that they are made of.
    pub fn settle_frame(&mut self) -> &mut Self {
        let drafts = std::mem::take(&mut self.frame_velocities);
        let settled = !drafts.is_empty() && !self.broken.contains("frame") && self.settle(&drafts).is_some();
        if !settled {
            self.broken.extend(["frame", "velocity"]);
        }
        self
    }

    fn settle(&mut self, drafts: &[FrameDraft]) -> Option<()> {
        let (rows, used) = self.rows_of_frame(drafts)?;
        let square: Vec<Vec<ExprId>> =
            rows.iter().map(|row| used.iter().map(|k| row[*k]).collect()).collect();
        let (zero, one) = (self.graph.zero(), self.graph.one());
        let unit = |n: usize| -> Vec<Vec<ExprId>> {
            (0..n).map(|i| (0..n).map(|j| if i == j { one } else { zero }).collect()).collect()
        };
        let Some((solved, determinant)) = self.inverse(&square) else {
            let names: Vec<String> = drafts.iter().map(|d| d.name.clone()).collect();
            let message = format!("the quasi-velocities {} depend on each other", names.join(", "));
            self.problem(drafts[0].span, message, "no combination of them may vanish");
            return None;
        };
        let m = self.velocity_symbols().len();
        let (mut matrix, mut inverse) = (unit(m), unit(m));
        for (i, a) in used.iter().enumerate() {
            for (j, b) in used.iter().enumerate() {
                matrix[*a][*b] = solved[i][j];
                inverse[*a][*b] = square[i][j];
            }
        }
        let original: Vec<(String, SymbolId)> =
            self.velocity_names().into_iter().zip(self.velocity_symbols()).collect();
        let mut docs = vec![None; m];
        used.iter().zip(drafts).for_each(|(k, draft)| docs[*k] = Some(draft.doc.clone()));
        let before = self.velocities.clone();
        let n_shape = self.n_shape();
        for (k, draft) in used.iter().zip(drafts) {
            match self.base.get_mut(*k).filter(|_| *k < n_shape) {
                Some(coordinate) => {
                    (coordinate.velocity_name, coordinate.velocity) = (draft.name.clone(), draft.symbol);
                }
                None => {
                    let FrameDraft { name, symbol, doc, .. } = draft.clone();
                    self.velocities[*k - n_shape] = Velocity { block: name.clone(), name, symbol, doc };
                }
            }
        }
        let span = drafts[0].span;
        let frame = QuasiFrame { original, matrix, inverse, docs, determinant, span };
        let values = self.values_in(&frame);
        self.frame = Some((frame, before));
        self.rewrite(&values)
    }

    /// The inverse of a matrix and its determinant, where that is not too large to be written out; none where the
    /// matrix is singular identically.
    fn inverse(&mut self, square: &[Vec<ExprId>]) -> Option<(Vec<Vec<ExprId>>, Option<ExprId>)> {
        let n = square.len();
        let (zero, one) = (self.graph.zero(), self.graph.one());
        let whole = (n <= MAX_DETERMINANT).then(|| determinant(&mut self.graph, square));
        let whole = whole.map(|e| self.flat(e));
        if whole.is_some_and(|e| self.graph.is_zero(e)) {
            return None;
        }
        let mut rows = match whole.filter(|_| n <= MAX_COFACTORS) {
            Some(divisor) => {
                let inverse = self.graph.powi(divisor, -1);
                let mut rows = adjugate(&mut self.graph, square);
                rows.iter_mut().flatten().for_each(|e| *e = self.graph.mul(*e, inverse));
                rows
            }
            None => {
                let unit = |i: usize| (0..n).map(|j| if i == j { one } else { zero }).collect();
                let unit: Vec<Vec<ExprId>> = (0..n).map(unit).collect();
                solve_symbolic(&mut self.graph, square, &unit).ok()?
            }
        };
        for e in rows.iter_mut().flatten() {
            *e = self.flat(*e);
        }
        Some((rows, whole))
    }

    /// The same value, without coordinates and time that it does not depend on: `cos(x)^2 + sin(x)^2` is one.
    fn flat(&mut self, e: ExprId) -> ExprId {
        let variables: Vec<SymbolId> = self.base.iter().map(|c| c.symbol).chain([self.time]).collect();
        self.graph.without_idle_symbols(e, Some(&variables))
    }

    /// The same function of the velocities, if it is a polynomial of degree two in them: with coefficients that are as
    /// simple in the frame as they can be seen to be. Velocities before the frame stand there as what they are in it.
    pub(super) fn simple_in_frame(&mut self, e: ExprId) -> ExprId {
        if self.frame.is_none() {
            return e;
        }
        let velocities = self.velocity_symbols();
        let moving: BTreeSet<SymbolId> = velocities.iter().copied().collect();
        let zero = self.graph.zero();
        let at_rest: BTreeMap<SymbolId, ExprId> = velocities.iter().map(|y| (*y, zero)).collect();
        let slopes: Vec<ExprId> = velocities.iter().map(|y| self.graph.diff(e, *y)).collect();
        let (Ok(constant), Ok(linear)) =
            (self.graph.subs(e, &at_rest), self.graph.subs_all(&slopes, &at_rest))
        else {
            return e;
        };
        let (mut terms, mut is_simpler) = (vec![constant], false);
        let half = Rational::new(1.into(), 2.into());
        for (a, (y, slope)) in velocities.iter().zip(&slopes).enumerate() {
            let simple = self.flat(linear[a]);
            is_simpler |= simple != linear[a];
            let velocity = self.graph.sym(*y);
            terms.push(self.graph.mul(simple, velocity));
            for (b, z) in velocities.iter().enumerate().skip(a) {
                let second = self.graph.diff(*slope, *z);
                let simple = self.flat(second);
                if self.graph.depends_on(simple, &moving) {
                    return e;
                }
                is_simpler |= simple != second;
                let other = self.graph.sym(*z);
                let product = self.graph.product(&[simple, velocity, other]);
                terms.push(if a == b { self.graph.scale(product, &half) } else { product });
            }
        }
        if is_simpler { self.graph.sum(&terms) } else { e }
    }

    /// The coefficients of each quasi-velocity, and which velocities these are made of.
    fn rows_of_frame(&mut self, drafts: &[FrameDraft]) -> Option<(Vec<Vec<ExprId>>, Vec<usize>)> {
        let velocities = self.velocity_symbols();
        let params = self.params.iter().map(|p| p.symbol);
        let coordinates = self.base.iter().map(|c| c.symbol);
        let allowed: BTreeSet<SymbolId> =
            velocities.iter().copied().chain(params).chain(coordinates).chain([self.time]).collect();
        let mut rows = Vec::new();
        for draft in drafts {
            let name = &draft.name;
            let free = self.graph.free_symbols(draft.value);
            if let Some(wrong) = free.iter().find(|s| !allowed.contains(s)) {
                let message = format!("quasi-velocity `{name}` contains `{}`", self.graph.name(*wrong));
                let help = "it is made of velocities, base coordinates, time and parameters";
                self.problem(draft.span, message, help);
                return None;
            }
            let occurring = self.occurring(draft.value, &velocities);
            let parts = self.graph.affine_parts(draft.value, &occurring);
            let zero = self.graph.zero();
            let Some((slopes, _)) = parts.filter(|(_, rest)| *rest == zero) else {
                let message = format!("quasi-velocity `{name}` is not linear in the velocities");
                let help = short_list("the velocities are", &self.velocity_names());
                self.problem(draft.span, message, help);
                return None;
            };
            rows.push(self.spread(&occurring, slopes, &velocities));
        }
        let zero = self.graph.zero();
        let is_used = |k: &usize| rows.iter().any(|row| row[*k] != zero);
        let used: Vec<usize> = (0..velocities.len()).filter(is_used).collect();
        if used.len() != drafts.len() {
            let names = self.velocity_names();
            let names: Vec<&str> = used.iter().map(|k| names[*k].as_str()).collect();
            let plural = if drafts.len() == 1 { "quasi-velocity" } else { "quasi-velocities" };
            let message = format!("{} {plural} in the place of {}", drafts.len(), names.join(", "));
            let help =
                "a frame has as many quasi-velocities as velocities that they are made of; others stay";
            self.problem(drafts[0].span, message, help);
            return None;
        }
        let has_momentum = |k: &usize| {
            let components = self.momenta.iter().flat_map(|m| m.components.iter());
            components.into_iter().any(|(.., velocity)| velocity == k)
        };
        if let Some(k) = used.iter().find(|k| has_momentum(k)) {
            let message =
                format!("the frame replaces `{}`, which its momentum declares", self.velocity_names()[*k]);
            self.problem(drafts[0].span, message, "declare it with `velocity`, and `momentum p of u;`");
            return None;
        }
        Some((rows, used))
    }

    /// Values of the replaced velocities, `T u`.
    fn values_in(&mut self, frame: &QuasiFrame) -> BTreeMap<SymbolId, ExprId> {
        let own = self.velocity_symbols();
        let mut values = BTreeMap::new();
        for (k, (_, symbol)) in frame.original.iter().enumerate() {
            if own[k] == *symbol {
                continue;
            }
            let mut terms = Vec::new();
            for (entry, y) in frame.matrix[k].iter().zip(&own) {
                let y = self.graph.sym(*y);
                terms.push(self.graph.mul(*entry, y));
            }
            values.insert(*symbol, self.graph.sum(&terms));
        }
        values
    }

    /// Puts the values of replaced velocities into everything that is known by a name.
    pub(super) fn rewrite(&mut self, values: &BTreeMap<SymbolId, ExprId>) -> Option<()> {
        let replaced: BTreeSet<SymbolId> = values.keys().copied().collect();
        let mut known = std::mem::take(&mut self.values);
        let mut is_fine = true;
        for value in known.values_mut() {
            if value.entries().iter().all(|e| !self.graph.depends_on(*e, &replaced)) {
                continue;
            }
            *value = value.map(|e| {
                self.graph.subs(e, values).unwrap_or_else(|_| {
                    is_fine = false;
                    e
                })
            });
        }
        self.values = known;
        for e in &mut self.images {
            *e = self.graph.subs(*e, values).unwrap_or(*e);
        }
        self.images.extend(values.values());
        if !is_fine {
            let message = "a definition divides by zero in the velocities of the frame";
            self.problem(self.here, message, "write it behind the frame in the quasi-velocities");
        }
        is_fine.then_some(())
    }

    /// An expression in the velocities that the frame replaces.
    pub(super) fn in_original(&mut self, e: ExprId) -> ExprId {
        let Some((frame, _)) = self.frame.clone() else { return e };
        let mut values = BTreeMap::new();
        for (k, y) in self.velocity_symbols().into_iter().enumerate() {
            if frame.original[k].1 == y {
                continue;
            }
            let mut terms = Vec::new();
            for (entry, (_, symbol)) in frame.inverse[k].iter().zip(&frame.original) {
                let old = self.graph.sym(*symbol);
                terms.push(self.graph.mul(*entry, old));
            }
            values.insert(y, self.graph.sum(&terms));
        }
        // What is linear in velocities divides by none of them.
        let rewritten = self.graph.subs(e, &values).unwrap_or(e);
        let original: Vec<SymbolId> = frame.original.iter().map(|(_, symbol)| *symbol).collect();
        let occurring = self.occurring(rewritten, &original);
        let Some((slopes, rest)) = self.graph.affine_parts(rewritten, &occurring) else { return rewritten };
        // What came with the frame and went with its inverse leaves no trace.
        let mut terms = vec![rest];
        for (slope, symbol) in slopes.into_iter().zip(occurring) {
            let (slope, velocity) = (self.flat(slope), self.graph.sym(symbol));
            terms.push(self.graph.mul(slope, velocity));
        }
        self.graph.sum(&terms)
    }

    /// An initial value of a velocity that is none of the model's.
    pub(super) fn replaced_at_the_start(&mut self, name: &str, span: Option<Span>) {
        let by = if self.frame.is_some() { "which the frame replaces" } else { "which the anchor gives" };
        let message = format!("initial value of `{name}` is that of a velocity {by}");
        let help = short_list("the state has", &self.velocity_names());
        self.problem(span, message, help);
    }

    /// What has no meaning beside a frame.
    pub(super) fn check_beside_frame(&mut self) {
        if self.frame.is_none() {
            return;
        }
        let derived = self.derived_connection.map(|(_, span)| ("a derived connection", span));
        let stage = self.stages.first().map(|stage| ("`stage`", stage.span));
        for (item, span) in [derived, stage].into_iter().flatten() {
            let message = format!("{item} beside a frame is not supported");
            self.problem(span, message, "write the model in its own velocities; remove `frame`");
        }
    }

    /// Symbols of the velocities that the frame replaces, and of the others: base first, then algebra.
    pub(super) fn original_symbols(&self) -> Vec<SymbolId> {
        match &self.frame {
            Some((frame, _)) => frame.original.iter().map(|(_, symbol)| *symbol).collect(),
            None => self.velocity_symbols(),
        }
    }

    /// The velocities of the algebra that the frame replaces, and the others.
    pub(super) fn original_velocities(&self) -> &[Velocity] {
        self.frame.as_ref().map_or(&self.velocities, |(_, before)| before)
    }

    /// The velocities of a vector or component in the algebra before the frame, by element of the algebra.
    pub(super) fn original_indices(&self, name: &str) -> Vec<usize> {
        let velocities = self.original_velocities();
        let alone = velocities.iter().position(|v| v.name == name);
        let of_block = || (0..velocities.len()).filter(|k| velocities[*k].block == name).collect();
        alone.map_or_else(of_block, |k| vec![k])
    }

    /// The velocity `k`, of those before the frame, by the velocities of the model.
    pub(super) fn velocity_value(&mut self, k: usize) -> ExprId {
        let Some((frame, _)) = self.frame.clone() else {
            let symbol = self.velocity_symbols()[k];
            return self.graph.sym(symbol);
        };
        let values = self.values_in(&frame);
        let symbol = frame.original[k].1;
        values.get(&symbol).copied().unwrap_or_else(|| self.graph.sym(symbol))
    }

    /// Rates of the base coordinates by the velocities of the model.
    pub(super) fn coordinate_rates(&mut self) -> Vec<ExprId> {
        if let Some(rows) = self.algebroid.as_ref().and_then(|a| a.anchor.clone()) {
            let mut rates = Vec::new();
            for row in rows {
                let mut terms = Vec::new();
                for (k, entry) in row.into_iter().enumerate() {
                    let y = self.velocity_value(k);
                    terms.push(self.graph.mul(entry, y));
                }
                rates.push(self.graph.sum(&terms));
            }
            return rates;
        }
        (0..self.n_shape()).map(|k| self.velocity_value(k)).collect()
    }

    /// The value of a name that stands for velocities that are none of the model's: replaced by the frame, or rates of
    /// coordinates that an anchor gives.
    pub(super) fn value_of_replaced(&self, name: &str) -> Option<Vec<ExprId>> {
        let what = self.names.get(name)?.what;
        let is_velocity = matches!(
            what,
            DeclaredAs::Velocity | DeclaredAs::VelocityComponent | DeclaredAs::CoordinateVelocity
        );
        (is_velocity && (self.frame.is_some() || self.algebroid.is_some()))
            .then(|| self.values.get(name).map(|value| value.entries().to_vec()))?
    }

    /// Whether an expression is one symbol.
    pub(super) fn is_symbol(&self, e: ExprId, symbol: SymbolId) -> bool {
        *self.graph.node(e) == Node::Symbol(symbol)
    }
}
