//! Coordinates in a group that everything may depend on: the trivial algebroid `G x g`.
//!
//! Deliberately does not know: the equations of motion, how a group is written.

use std::collections::{BTreeMap, BTreeSet};

use super::draft::{AdvectedDraft, ConfigurationDraft, DeclaredAs, Located, ModelBuilder};
use super::reconstruct::counted;
use crate::spec::diagnostic::Span;
use crate::spec::group::Group;
use crate::spec::group_motion::{group_rates, rational_element};
use crate::spec::matrix_group::{KeptForm, MatrixGroup};
use crate::spec::model::*;
use crate::spec::rates::Rates;
use crate::spec::value::Value;
use hamel_expr::{ExprId, Rational, SymbolId};
use num_traits::One;

/// An initial matrix that its group form misses by more is none of the group: digits were written, and no error was
/// made, below it.
const MAX_MISS: f64 = 1e-6;

impl ModelBuilder {
    /// Coordinates in a group of matrices that velocities of the algebra move, `g' = g xi` (left) or `g' = xi g`
    /// (right); everything of the model may contain them. One name for the matrix, two for a complex one are made of it
    /// (`g_re`, `g_im`), and one name for each space of a semidirect product. They start at the identity unless
    /// [`ModelBuilder::initial`] says otherwise.
    ///
    /// `by`: the velocities that move them, vectors or components, in the order of the group's algebra; an empty list
    /// stands for all.
    ///
    /// ```
    /// use hamel_lang::spec::{LieAlgebra, MatrixFamily, MatrixGroup, ModelBuilder, Value};
    ///
    /// let mut b = ModelBuilder::new("tilted");
    /// let omega = b.velocities(LieAlgebra::so(3).unwrap(), &["Omega"]).remove(0);
    /// let rotations = MatrixGroup::new(MatrixFamily::SpecialOrthogonal, 3, &[]).unwrap();
    /// let attitude = b.configuration(&["R"], &rotations, &["Omega"], "attitude, body to space").remove(0);
    /// let g = b.graph();
    /// let energy = omega.dot(g, &omega).unwrap();
    /// let height = Value::Scalar(attitude.entries()[8]);
    /// let lagrangian = energy.sub(g, &height).unwrap();
    /// b.lagrangian(&lagrangian);
    /// assert_eq!(b.build().unwrap().configurations[0].names.len(), 9);
    /// ```
    pub fn configuration(
        &mut self,
        names: &[&str],
        group: &MatrixGroup,
        by: &[&str],
        doc: &str,
    ) -> Vec<Value> {
        let here = self.here;
        let names: Vec<(&str, Option<Span>)> = names.iter().map(|n| (*n, here)).collect();
        let by = by.iter().map(|n| ((*n).to_owned(), here)).collect();
        self.located_configuration(&names, group, (by, Vec::new()), doc)
    }

    /// As [`ModelBuilder::configuration`], beside velocities that move the frame that it is told in:
    /// `g' = g xi - eta g` for a left action, with `eta` the velocities `relative` of a copy of the group's algebra;
    /// `g' = xi g - g eta` for a right one. Such is the attitude of one body in the frame of another, by the angular
    /// velocities of both.
    pub fn relative_configuration(
        &mut self,
        names: &[&str],
        group: &MatrixGroup,
        (by, relative): (&[&str], &[&str]),
        doc: &str,
    ) -> Vec<Value> {
        let here = self.here;
        let names: Vec<(&str, Option<Span>)> = names.iter().map(|n| (*n, here)).collect();
        let [by, relative] =
            [by, relative].map(|list| list.iter().map(|n| ((*n).to_owned(), here)).collect());
        self.located_configuration(&names, group, (by, relative), doc)
    }

    pub(in crate::spec) fn located_configuration(
        &mut self,
        names: &[(&str, Option<Span>)],
        group: &MatrixGroup,
        (by, relative): (Vec<Located>, Vec<Located>),
        doc: &str,
    ) -> Vec<Value> {
        let span = self.here;
        let plain: Vec<&str> = names.iter().map(|(n, _)| *n).collect();
        let Some(blocks) = group.coordinates(&plain) else {
            let counted = counted(names.len(), "name", "names");
            let message = format!("{counted} for a configuration in {}", group.of_configuration());
            let help = format!("one for the matrix and {} for vectors", group.spaces().len());
            self.problem(span, message, help);
            self.broken.insert("configuration");
            return Vec::new();
        };
        let of_group = Group::Matrices(Box::new(group.clone()));
        let Some(velocities) = self.group_indices(&of_group, &by, span) else {
            self.broken.insert("configuration");
            return Vec::new();
        };
        let relative = match relative.is_empty() {
            true => Vec::new(),
            false => match self.group_indices(&of_group, &relative, span) {
                Some(found) if found.iter().all(|a| !velocities.contains(a)) => found,
                Some(_) => {
                    let message = "a configuration relative to the velocities that move it";
                    self.problem(span, message, "name the velocities of another factor of the algebra");
                    self.broken.insert("configuration");
                    return Vec::new();
                }
                None => {
                    self.broken.insert("configuration");
                    return Vec::new();
                }
            },
        };
        let (mut components, mut values, mut all) = (Vec::new(), Vec::new(), Vec::new());
        for block in &blocks {
            self.here = names[block.of].1;
            let is_number = block.components.len() == 1 && block.components[0] == block.name;
            if !is_number {
                self.declare(&block.name, DeclaredAs::Advected);
            }
            let mut entries = Vec::with_capacity(block.components.len());
            for component in &block.components {
                let (symbol, expr) = self.new_symbol(component, DeclaredAs::AdvectedComponent);
                components.push((component.clone(), symbol));
                entries.push(expr);
            }
            all.extend(entries.iter().copied());
            let value = match (block.n_columns, entries.as_slice()) {
                (Some(columns), _) => Value::Matrix { rows: entries.len() / columns, columns, entries },
                (None, [only]) if is_number => Value::Scalar(*only),
                (None, _) => Value::Vector(entries),
            };
            if !is_number {
                self.bind(&block.name, &value);
            }
            values.push(value);
        }
        self.here = span;
        let name = plain.first().map_or("", |name| *name).to_owned();
        self.advected.push(AdvectedDraft {
            name: name.clone(),
            value: Value::Vector(all),
            components,
            // It follows from the group when the side of the action is known.
            action: None,
            doc: doc.to_owned(),
            span,
        });
        let advected = self.advected.len() - 1;
        let group = Box::new(group.clone());
        self.configurations.push(ConfigurationDraft {
            group,
            advected,
            velocities,
            relative,
            values: values.clone(),
        });
        values
    }

    /// The side of the action as far as it is known: where the text says it, before anything is used.
    fn side(&self) -> Side {
        self.action.as_ref().map_or(Side::Left, |(side, _)| *side)
    }

    /// The rates of a configuration by the velocities of the algebra.
    fn rates_of_configuration(
        &mut self,
        draft: &ConfigurationDraft,
        velocity: impl Fn(&mut ModelBuilder, usize) -> ExprId,
    ) -> Vec<ExprId> {
        let [xi, eta] = [&draft.velocities, &draft.relative]
            .map(|list| list.iter().map(|a| velocity(self, *a)).collect::<Vec<ExprId>>());
        let symbols: Vec<_> = self.advected[draft.advected].components.iter().map(|(_, s)| *s).collect();
        let coordinates: Vec<ExprId> = symbols.iter().map(|s| self.graph.sym(*s)).collect();
        let side = self.side();
        let rates = group_rates(&mut self.graph, &draft.group, &coordinates, &xi, side);
        if eta.is_empty() {
            return rates;
        }
        let other = if side == Side::Left { Side::Right } else { Side::Left };
        let back = group_rates(&mut self.graph, &draft.group, &coordinates, &eta, other);
        rates.into_iter().zip(back).map(|(rate, back)| self.graph.sub(rate, back)).collect()
    }

    /// Rates of the coordinates of configurations, by the velocities of the model.
    pub(super) fn add_configuration_rates(&mut self, rates: &mut Rates) {
        for draft in self.configurations.clone() {
            let values = self.rates_of_configuration(&draft, |b, a| b.velocity_value(b.n_shape() + a));
            let symbols = self.advected[draft.advected].components.iter().map(|(_, s)| *s);
            rates.extend(symbols.zip(values));
        }
    }

    /// Attitudes with their angular velocities in the turned frame: `Omega`, less `R^T` times that of the frame they
    /// are told in, for a left action; `R^T omega`, less that one, for a right one.
    pub(in crate::spec) fn configuration_spins(&mut self) -> Vec<(Vec<ExprId>, Vec<ExprId>)> {
        let mut list = Vec::new();
        for draft in self.configurations.clone() {
            let n = draft.group.n();
            let n_turning = draft.group.matrices().len();
            let is_rotation = draft.group.is_of_rotations() && matches!((n, n_turning), (2, 1) | (3, 3));
            let Some(matrix) = draft.values.first().filter(|_| is_rotation).cloned() else { continue };
            let values = |b: &mut ModelBuilder, list: &[usize]| -> Vec<ExprId> {
                list.iter().take(n_turning).map(|a| b.velocity_value(b.n_shape() + a)).collect()
            };
            let (of_body, of_space) = match self.side() {
                Side::Left => (values(self, &draft.velocities), values(self, &draft.relative)),
                Side::Right => (values(self, &draft.relative), values(self, &draft.velocities)),
            };
            // `w = w_body + R^T w_space`, each where it is there, what the frame has counted negative.
            let sign = if self.side() == Side::Left { -Rational::one() } else { Rational::one() };
            let turned = match (of_space.is_empty(), n) {
                (true, _) => vec![self.graph.zero(); n_turning],
                (false, 2) => of_space,
                (false, _) => {
                    let back = matrix.transpose();
                    let Ok(turned) = back.and_then(|b| b.mul(&mut self.graph, &Value::Vector(of_space)))
                    else {
                        continue;
                    };
                    turned.into_entries()
                }
            };
            let mut spin = Vec::with_capacity(n_turning);
            for (k, turned) in turned.into_iter().enumerate() {
                let own = of_body.get(k).copied().unwrap_or_else(|| self.graph.zero());
                let terms = [(own, -&sign), (turned, sign.clone())];
                spin.push(self.graph.linear_combination(&terms));
            }
            list.push((matrix.into_entries(), spin));
        }
        list
    }

    /// Gives the coordinates their infinitesimal action, `xi . g = -g xi` (left) or `xi g` (right).
    pub(super) fn move_configurations(&mut self) {
        if let (false, Some((name, _, span))) =
            (self.configurations.is_empty(), self.connection.first().cloned())
        {
            let message = format!("a connection on `{name}` beside a configuration");
            let help = "the configuration moves with the group velocity: write the Lagrangian by that velocity, and \
                        let `connection mechanical;` find a connection";
            self.problem(span, message, help);
            self.broken.insert("advected");
            return;
        }
        let original = self.original_symbols();
        for draft in self.configurations.clone() {
            let mut rates =
                self.rates_of_configuration(&draft, |b, a| b.graph.sym(original[b.n_shape() + a]));
            let side = self.side();
            if side == Side::Left {
                rates = rates.into_iter().map(|e| self.graph.neg(e)).collect();
            }
            let advected = &mut self.advected[draft.advected];
            advected.action = Some((Value::Vector(rates), advected.span));
        }
    }

    /// A Lagrangian that is quadratic in the velocities with coefficients that are constant on the groups, as `R^T R`
    /// is, with their values at the identity; the same where a coefficient is not, for then the way it is written tells
    /// more. A mass matrix has zeros that elimination can see then.
    pub(super) fn simple_on_groups(&mut self, e: ExprId) -> ExprId {
        if self.configurations.is_empty() {
            return e;
        }
        let velocities = self.velocity_symbols();
        let own: BTreeSet<SymbolId> = velocities.iter().copied().collect();
        let rest: BTreeMap<SymbolId, ExprId> = own.iter().map(|y| (*y, self.graph.zero())).collect();
        let groups: BTreeSet<SymbolId> = (self.configurations.iter())
            .flat_map(|draft| self.advected[draft.advected].components.iter().map(|(_, s)| *s))
            .collect();
        let mut is_constant = true;
        let mut terms = Vec::new();
        let mut term = |b: &mut ModelBuilder, coefficient: ExprId, factors: &[ExprId], weight: Rational| {
            let simple = b.constant_on_groups(coefficient);
            is_constant &= factors.is_empty() || !b.graph.depends_on(simple, &groups);
            let product = factors.iter().fold(simple, |p, y| b.graph.mul(p, *y));
            terms.push((product, weight));
        };
        let one = || Rational::from_integer(1.into());
        let occurring = self.occurring(e, &velocities);
        for (k, a) in occurring.iter().enumerate() {
            let slope = self.graph.diff(e, *a);
            let y = self.graph.sym(*a);
            let Ok(linear) = self.graph.subs(slope, &rest) else { return e };
            term(self, linear, &[y], one());
            for b in &occurring[k..] {
                let curvature = self.graph.diff(slope, *b);
                if self.graph.depends_on(curvature, &own) {
                    return e;
                }
                let z = self.graph.sym(*b);
                let weight = if a == b { Rational::new(1.into(), 2.into()) } else { one() };
                term(self, curvature, &[y, z], weight);
            }
        }
        let Ok(potential) = self.graph.subs(e, &rest) else { return e };
        term(self, potential, &[], one());
        if is_constant { self.graph.linear_combination(&terms) } else { e }
    }

    /// The value at the identity of an expression that does not change on groups, one group after the other; proved by
    /// elements with free symbols.
    fn constant_on_groups(&mut self, e: ExprId) -> ExprId {
        let mut value = e;
        for draft in self.configurations.clone() {
            let components = self.advected[draft.advected].components.clone();
            let own: BTreeSet<SymbolId> = components.iter().map(|(_, s)| *s).collect();
            if !self.graph.depends_on(value, &own) {
                continue;
            }
            let dim = draft.group.algebra().dim();
            let free: Vec<ExprId> = (0..dim)
                .map(|k| {
                    let symbol = self.graph.symbol(&format!("{}_{k}", draft.group));
                    self.graph.sym(symbol)
                })
                .collect();
            let Some(element) = rational_element(&mut self.graph, &draft.group, &free) else { continue };
            let at = |b: &mut ModelBuilder, entries: Vec<ExprId>| {
                let map = components.iter().map(|(_, s)| *s).zip(entries).collect();
                b.graph.subs(value, &map)
            };
            let n = draft.group.n();
            let identity = (0..components.len()).map(|k| {
                let is_one = k < n * n && k / n == k % n;
                if is_one { self.graph.one() } else { self.graph.zero() }
            });
            let identity = identity.collect();
            if let (Ok(general), Ok(special)) = (at(self, element), at(self, identity))
                && self.graph.is_equal(general, special)
            {
                value = special;
            }
        }
        value
    }

    /// Adds the identity where a configuration has no initial value, and checks that an element of the group is where
    /// it has one.
    pub(super) fn start_configurations(&mut self, initial: &mut Vec<(String, ExprId)>) {
        let defaults = self.default_values();
        for draft in self.configurations.clone() {
            let (n, n_entries) = (draft.group.n(), draft.group.n() * draft.group.n());
            let components = self.advected[draft.advected].components.clone();
            let mut numbers = Vec::new();
            let mut is_given = None;
            for (k, (name, symbol)) in components.iter().enumerate() {
                let known = initial.iter().find(|(given, _)| given == name).map(|(_, e)| *e);
                let is_one = k < n_entries && k / n == k % n;
                let identity = if is_one { self.graph.one() } else { self.graph.zero() };
                if known.is_some() && k < n_entries * draft.group.n_blocks() {
                    is_given.get_or_insert(*symbol);
                }
                let value = known.unwrap_or(identity);
                numbers.push(self.graph.eval_f64(value, &defaults).unwrap_or(f64::NAN));
                if known.is_none() {
                    initial.push((name.clone(), value));
                }
            }
            let Some(symbol) = is_given else { continue };
            let miss = miss_of(&draft.group, &numbers);
            if miss.is_nan() || miss > MAX_MISS {
                let block = self.advected[draft.advected].name.clone();
                let starts_with = |given: &str| {
                    given == block || components.iter().any(|(name, s)| name == given && *s == symbol)
                };
                let span =
                    self.initial.iter().find(|(given, _, _)| starts_with(given)).and_then(|(_, _, s)| *s);
                let message =
                    format!("initial value of `{block}` is no element of {}", draft.group.of_configuration());
                let help = format!(
                    "its entries miss what the group keeps by {miss:.1e}; `rot(axis, angle)` makes a rotation"
                );
                self.problem(span, message, help);
            }
        }
    }
}

/// By how much the numbers of a matrix miss the form that its group keeps, `max |g M g^T - M|`.
fn miss_of(group: &MatrixGroup, coordinates: &[f64]) -> f64 {
    let Some(KeptForm::Bilinear(form)) = group.kept_form() else { return 0.0 };
    let (n, size) = (group.n(), form.n_rows());
    let entry = |i: usize, j: usize| -> f64 {
        match group.family().is_complex() {
            false => coordinates[i * n + j],
            true => {
                let at = (i / 2) * n + j / 2;
                match (i % 2, j % 2) {
                    (0, 0) | (1, 1) => coordinates[at],
                    (1, _) => coordinates[n * n + at],
                    _ => -coordinates[n * n + at],
                }
            }
        }
    };
    let number = |q: &Rational| num_traits::ToPrimitive::to_f64(q).unwrap_or(f64::NAN);
    let mut worst = 0.0_f64;
    for i in 0..size {
        for j in 0..size {
            let mut sum = -number(form.get(i, j));
            for k in 0..size {
                for l in 0..size {
                    sum += entry(i, k) * number(form.get(k, l)) * entry(j, l);
                }
            }
            if sum.is_nan() {
                return f64::NAN;
            }
            worst = worst.max(sum.abs());
        }
    }
    worst
}
