//! Reduction by stages: a chain of ideals and an inner product.
//!
//! Deliberately does not know: what equations the stages lead to.

use std::collections::{BTreeMap, BTreeSet};

use super::draft::{DeclaredAs, ModelBuilder, StageDraft};
use crate::algebra::{lies_in, next_ideal, whole_algebra};
use crate::spec::diagnostic::{Diagnostic, Span};
use crate::spec::layout::short_list;
use crate::spec::model::*;
use crate::spec::names;
use crate::spec::value::Value;
use hamel_expr::{ExprId, SymbolId, Vanishing};

/// What a state carries where it carries the velocities along the levels.
pub(super) const STAGES: &str = "stages";

impl ModelBuilder {
    /// The name of the first stage, the whole algebra.
    ///
    /// ```
    /// use hamel_lang::spec::{LieAlgebra, ModelBuilder};
    ///
    /// let mut b = ModelBuilder::new("stages");
    /// let [rotation, translation] = b.velocities(LieAlgebra::se(3).unwrap(), &["Omega", "V"]).try_into().unwrap();
    /// let energy = rotation.dot(b.graph(), &rotation).unwrap();
    /// b.stage("whole").stage_ideal("translations", &[translation]).lagrangian(&energy);
    /// assert!(b.clone().build().is_ok());
    /// b.stage_ideal("rotations", &[rotation]);
    /// let problems = b.build().unwrap_err();
    /// assert!(problems.to_string().contains("stage rotations is not contained in stage translations"));
    /// ```
    pub fn stage(&mut self, name: &str) -> &mut Self {
        let span = self.here;
        self.stages.push(StageDraft { name: name.to_owned(), ideal: None, span });
        self
    }

    /// The next stage: the ideal spanned by velocities or combinations of them with coefficients in parameters.
    pub fn stage_ideal(&mut self, name: &str, ideal: &[Value]) -> &mut Self {
        let span = self.here;
        self.stages.push(StageDraft { name: name.to_owned(), ideal: Some(ideal.to_vec()), span });
        self
    }

    /// The inner product for the stages: a symmetric matrix in the basis of the algebra.
    pub fn inner_product(&mut self, matrix: &Value) -> &mut Self {
        self.inner_product_by(Some(matrix.clone()))
    }

    /// The kinetic energy as the inner product for the stages: the Hessian of the Lagrangian in the velocities of the
    /// algebra, a function of shape and time.
    pub fn inner_product_of_lagrangian(&mut self) -> &mut Self {
        self.inner_product_by(None)
    }

    fn inner_product_by(&mut self, matrix: Option<Value>) -> &mut Self {
        let here = self.here;
        match &self.inner_product {
            Some((_, first)) => self.twice("inner_product", *first),
            None => self.inner_product = Some((matrix, here)),
        }
        self
    }

    /// A connection of a stage along a velocity (vector or component), with values in its ideal: `value` is
    /// `A(x, t) xdot`, and the velocities along the levels are those of the model and that.
    pub fn stage_connection(&mut self, stage: &str, velocity: &str, value: &Value) -> &mut Self {
        let here = self.here;
        self.stage_connections.push((stage.to_owned(), velocity.to_owned(), value.clone(), here));
        self
    }

    /// A name for the momenta along the levels of the stages, `<p, f>` for the elements `f` of the adapted basis:
    /// `name_stage_1`, `name_stage_2`, .., or `name_stage` for a level of dimension one. [`ModelBuilder::carry`] makes
    /// the momenta of all levels state variables by `name`, of one level by `name_stage`.
    ///
    /// ```
    /// use hamel_lang::spec::{CarriedBy, LieAlgebra, ModelBuilder};
    ///
    /// let mut b = ModelBuilder::new("stages");
    /// let [rotation, translation] = b.velocities(LieAlgebra::se(3).unwrap(), &["Omega", "V"]).try_into().unwrap();
    /// let energy = rotation.dot(b.graph(), &rotation).unwrap();
    /// b.stage("turn").stage_ideal("move", &[translation]).stage_momentum("B").lagrangian(&energy).carry(&["B_move"]);
    /// assert_eq!(b.build().unwrap().carries[0].by, CarriedBy::Levels(vec!["move".into()]));
    /// ```
    pub fn stage_momentum(&mut self, name: &str) -> &mut Self {
        let here = self.here;
        match self.level_momentum {
            Some((_, first)) => self.twice("momentum of stages", first),
            None => {
                self.declare(name, DeclaredAs::Levels);
                self.level_momentum = Some((name.to_owned(), here));
            }
        }
        self
    }

    /// Whether `momentum B of stages;` is meant, and not a velocity of that name.
    pub(in crate::spec) fn is_levels(&self, velocity: &str) -> bool {
        velocity == STAGES && self.velocity_indices(velocity).is_empty()
    }

    /// The levels whose momenta a name means: of all stages, of one, or of one element of one.
    pub(super) fn levels_of_momentum(&self, name: &str) -> Option<Vec<String>> {
        let (momentum, _) = self.level_momentum.as_ref()?;
        let rest = name.strip_prefix(momentum.as_str())?;
        if rest.is_empty() {
            let mut names: Vec<String> = self.stages.iter().map(|draft| draft.name.clone()).collect();
            names.sort();
            return Some(names);
        }
        let along = rest.strip_prefix('_')?;
        let is_of = |draft: &StageDraft| is_along(along, &draft.name);
        self.stages.iter().any(is_of).then(|| vec![along.to_owned()])
    }

    /// Velocities along the levels in the place of those of the algebra, for `carry stages;`, or momenta along some of
    /// them.
    pub(super) fn carried_levels(&mut self, momenta: &[String], span: Option<Span>) -> Vec<Carried> {
        let drafts: Vec<String> = self.stages.iter().map(|draft| draft.name.clone()).collect();
        if drafts.is_empty() {
            if !self.broken.contains("stage") {
                self.problem(
                    span,
                    "there are no stages to carry",
                    "declare them: `stage rotation; stage translation = ideal(V);`",
                );
            }
            return Vec::new();
        }
        let prefix = self.level_momentum.as_ref().filter(|_| !momenta.is_empty());
        let of_momenta =
            prefix.iter().flat_map(|(prefix, _)| drafts.iter().map(move |s| format!("{prefix}_{s}")));
        for stage in drafts.iter().cloned().chain(of_momenta).collect::<Vec<String>>() {
            let is_taken = |name: &&String| is_along(name, &stage);
            let taken = self.names.keys().chain(self.output_names.keys()).find(is_taken).cloned();
            if let Some(taken) = taken {
                let message =
                    format!("what is carried along a stage is called `{stage}`, and `{taken}` is taken");
                self.problem(span, message, "give the stage another name");
            }
        }
        let n_base = self.n_shape();
        let by = CarriedBy::Levels(momenta.to_vec());
        (0..self.velocities.len()).map(|a| Carried { velocity: n_base + a, by: by.clone() }).collect()
    }

    pub(super) fn check_stages(&mut self) -> Option<IdealChain> {
        let drafts = self.stages.clone();
        if drafts.is_empty() {
            if let Some((name, span)) = self.level_momentum.clone()
                && !self.broken.contains("stage")
            {
                let message = format!("`momentum {name} of stages` without stages has no use");
                self.problem(
                    span,
                    message,
                    "declare stages: `stage rotation; stage translation = ideal(V);`",
                );
            }
            if let Some((_, span)) = self.inner_product
                && !self.broken.contains("stage")
            {
                self.problem(
                    span,
                    "`inner_product` without stages has no use",
                    "declare stages: `stage rotation; stage translation = ideal(V);`",
                );
            }
            return None;
        }
        let algebra = self.algebra.as_ref().map(|(algebra, _)| algebra.clone())?;
        let n = algebra.dim();
        if self.velocities.len() != n {
            // The names of the velocities are already a problem.
            return None;
        }
        let mut seen: BTreeMap<String, Option<Span>> = BTreeMap::new();
        for (k, draft) in drafts.iter().enumerate() {
            if let Some(reason) = names::refusal(&draft.name) {
                self.problem(draft.span, format!("`{}` cannot be used as a name", draft.name), reason);
            }
            if let Some(first) = seen.insert(draft.name.clone(), draft.span) {
                let problem =
                    Diagnostic::new(draft.span, format!("stage `{}` is declared twice", draft.name))
                        .with_place(first, "first here")
                        .with_help("rename one of them");
                self.problems.push(problem);
            }
            if k == 0 && draft.ideal.is_some() {
                self.problem(
                    draft.span,
                    format!("the first stage `{}` is the whole algebra and has no ideal", draft.name),
                    "declare it as `stage name;` before the ideals",
                );
            } else if k > 0 && draft.ideal.is_none() && !self.broken.contains("stage") {
                self.problem(
                    draft.span,
                    format!("stage `{}` has no ideal", draft.name),
                    "only the first stage is the whole algebra; write `stage name = ideal(V);`",
                );
            }
        }
        let unknowns: Vec<SymbolId> = self.velocities.iter().map(|v| v.symbol).collect();
        let mut ideals = Vec::new();
        // The whole algebra.
        let mut above = whole_algebra(&self.graph, &algebra);
        let mut above_name = drafts[0].name.clone();
        for draft in drafts.iter().filter(|d| d.ideal.is_some()) {
            let entries: Vec<ExprId> =
                draft.ideal.iter().flatten().flat_map(|v| v.entries().iter().copied()).collect();
            let mut vectors = Vec::new();
            for e in entries {
                match self.direction(e, &unknowns) {
                    Some(v) if v.iter().any(|q| *q != self.graph.zero()) => vectors.push(v),
                    _ => {
                        let names: Vec<String> = self.velocities.iter().map(|v| v.name.clone()).collect();
                        self.problem(
                            draft.span,
                            format!(
                                "ideal of stage `{}` is not spanned by combinations of velocities in parameters",
                                draft.name
                            ),
                            short_list("use", &names),
                        );
                        return None;
                    }
                }
            }
            let basis: Vec<String> = self.velocities.iter().map(|v| v.name.clone()).collect();
            let steps = ((above_name.as_str(), above.as_slice()), (draft.name.as_str(), vectors.as_slice()));
            match next_ideal(&mut self.graph, &algebra, &basis, steps.0, steps.1) {
                Ok(ideal) => above = ideal,
                Err(error) => {
                    self.error(draft.span, &error);
                    return None;
                }
            }
            above_name = draft.name.clone();
            ideals.push(vectors);
        }
        let inner_product = self.check_inner_product(n);
        let whole = whole_algebra(&self.graph, &algebra);
        let spans: Vec<&[Vec<ExprId>]> =
            [whole.as_slice()].into_iter().chain(ideals.iter().map(Vec::as_slice)).collect();
        let connection = self.check_stage_connections(&drafts, &spans);
        Some(IdealChain {
            names: drafts.iter().map(|d| d.name.clone()).collect(),
            ideals,
            inner_product,
            connection,
            momentum: self.level_momentum.as_ref().map_or(names::LEVEL_MOMENTUM, |(name, _)| name).to_owned(),
            spans: drafts.iter().map(|d| d.span).collect(),
        })
    }

    /// A combination of velocities in parameters as a vector in the basis of the algebra.
    fn direction(&mut self, e: ExprId, unknowns: &[SymbolId]) -> Option<Vec<ExprId>> {
        let occurring = self.occurring(e, unknowns);
        let (slopes, offset) = self.graph.affine_parts(e, &occurring)?;
        if !self.graph.is_zero(offset) {
            return None;
        }
        let params: BTreeSet<SymbolId> = self.params.iter().map(|p| p.symbol).collect();
        let mut vector = vec![self.graph.zero(); unknowns.len()];
        for (s, slope) in occurring.iter().zip(slopes) {
            let at = unknowns.iter().position(|u| u == s)?;
            if !self.graph.free_symbols(slope).is_subset(&params) {
                return None;
            }
            vector[at] = slope;
        }
        Some(vector)
    }

    /// The sum of the connections of the stages, `A^a_i` by element of the algebra and base coordinate.
    fn check_stage_connections(
        &mut self,
        drafts: &[StageDraft],
        spans: &[&[Vec<ExprId>]],
    ) -> Option<Vec<Vec<ExprId>>> {
        let (n_base, dim) = (self.n_shape(), self.velocities.len());
        let items = std::mem::take(&mut self.stage_connections);
        if items.is_empty() {
            return None;
        }
        let mut total = vec![vec![self.graph.zero(); n_base]; dim];
        for (draft, ideal) in drafts.iter().zip(spans) {
            let mut rows = vec![vec![self.graph.zero(); n_base]; dim];
            let mut place = None;
            for (_, name, value, span) in items.iter().filter(|(stage, ..)| *stage == draft.name) {
                place = place.or(*span);
                let indices = self.velocity_indices(name);
                if indices.is_empty() || indices.iter().any(|k| *k < n_base) {
                    self.unknown_algebra_velocity(name, *span);
                    continue;
                }
                if n_base == 0 && !self.broken.contains("coordinate") {
                    let message = format!("connection on `{name}` without a base has no use");
                    self.problem(*span, message, "declare the base with `coordinate`");
                    continue;
                }
                let Some(value) = self.fitted("connection on", name, value, *span) else { continue };
                for (k, e) in indices.into_iter().zip(value.into_entries()) {
                    let Some(row) = self.connection_row(name, e, *span) else { break };
                    for (own, e) in rows[k - n_base].iter_mut().zip(row) {
                        *own = self.graph.add(*own, e);
                    }
                }
            }
            for i in 0..n_base {
                let column: Vec<ExprId> = rows.iter().map(|row| row[i]).collect();
                if lies_in(&mut self.graph, ideal, &column) != Vanishing::Zero {
                    let message =
                        format!("the connection of stage `{}` is not known to lie in its ideal", draft.name);
                    self.problem(place, message, "give it the components of the ideal alone");
                    break;
                }
            }
            for (sum, row) in total.iter_mut().flatten().zip(rows.into_iter().flatten()) {
                *sum = self.graph.add(*sum, row);
            }
        }
        Some(total)
    }

    fn check_inner_product(&mut self, n: usize) -> Option<InnerProduct> {
        let (value, span) = self.inner_product.clone()?;
        let Some(value) = value else { return Some(InnerProduct::Lagrangian) };
        let Value::Matrix { rows, columns, entries } = &value else {
            let message = format!("inner product must be matrix({n}, {n}), found {}", value.shape());
            self.problem(span, message, "write `diag([..])` or `[[..], ..]`");
            return None;
        };
        if (*rows, *columns) != (n, n) {
            let message = format!("inner product must be matrix({n}, {n}), found {}", value.shape());
            self.problem(span, message, "one row and column per basis element of the algebra");
            return None;
        }
        let params = self.params.iter().map(|p| p.symbol);
        let shape = self.base[..self.n_shape()].iter().map(|c| c.symbol);
        let allowed: BTreeSet<SymbolId> = params.chain(shape).chain([self.time]).collect();
        for e in entries {
            if let Some(wrong) = self.graph.free_symbols(*e).iter().find(|s| !allowed.contains(s)) {
                let wrong = self.graph.name(*wrong);
                let message = format!(
                    "inner product contains `{wrong}`, which is no parameter, shape coordinate or time"
                );
                self.problem(span, message, "the group leaves an inner product on its algebra as it is");
                return None;
            }
        }
        for i in 0..n {
            for j in i + 1..n {
                let difference = self.graph.sub(entries[i * n + j], entries[j * n + i]);
                let found = match self.graph.vanishing(difference) {
                    Vanishing::Zero => continue,
                    Vanishing::NonZero => ("is not symmetric", "differ"),
                    Vanishing::Unknown => ("could not be shown to be symmetric", "may differ"),
                };
                {
                    let message = format!(
                        "inner product {2}: entries ({0}, {1}) and ({1}, {0}) {3}",
                        i + 1,
                        j + 1,
                        found.0,
                        found.1
                    );
                    self.problem(span, message, "a `symmetric(n)` parameter is symmetric by construction");
                    return None;
                }
            }
        }
        Some(InnerProduct::Matrix(entries.chunks(n).map(<[ExprId]>::to_vec).collect()))
    }
}

/// Whether a name is that of a stage, or of one of its elements: with a number where there are several.
fn is_along(name: &str, stage: &str) -> bool {
    match name.strip_prefix(stage) {
        Some("") => true,
        Some(rest) => rest.strip_prefix('_').is_some_and(|k| k.parse::<usize>().is_ok()),
        None => false,
    }
}

impl IdealChain {
    /// The algebra as its one stage, `whole`.
    pub fn whole() -> IdealChain {
        IdealChain {
            names: vec!["whole".into()],
            ideals: Vec::new(),
            inner_product: None,
            connection: None,
            momentum: names::LEVEL_MOMENTUM.to_owned(),
            spans: vec![None],
        }
    }
}
