//! Velocities and coordinates, with the side of the action.
//!
//! Deliberately does not know: the Lagrangian, constraints.

use std::collections::BTreeSet;

use super::draft::{DeclaredAs, ModelBuilder};
use crate::algebra::LieAlgebra;
use crate::spec::diagnostic::{Diagnostic, Span};
use crate::spec::layout::Layout;
use crate::spec::model::*;
use crate::spec::names;
use crate::spec::value::Value;
use hamel_expr::{ExprId, Number, SymbolId};

impl ModelBuilder {
    /// The algebra and names for its velocities: one for each block, or one per basis element.
    ///
    /// ```
    /// use hamel_lang::spec::{Domain, LieAlgebra, ModelBuilder};
    ///
    /// let mut b = ModelBuilder::new("bundle");
    /// let (theta, theta_dot) = b.coordinate("theta", Domain::Angle, "tilt [rad]");
    /// let blocks = b.velocities(LieAlgebra::se(2).unwrap(), &["omega", "v"]);
    /// assert_eq!(blocks[1].entries().len(), 2);
    /// // The group turns the vertical: `adot = -xi . a`.
    /// let gamma = b.advected("Gamma", Some(2), "");
    /// let turned = blocks[0].mul(b.graph(), &gamma).unwrap();
    /// b.advected_action("Gamma", &turned).lagrangian(&theta_dot);
    /// assert!(b.build().is_ok());
    /// ```
    pub fn velocities(&mut self, algebra: impl Into<LieAlgebra<Number>>, names: &[&str]) -> Vec<Value> {
        let located: Vec<(&str, Option<Span>)> = names.iter().map(|n| (*n, self.here)).collect();
        self.located_velocities(algebra.into(), &located, &[], "")
    }

    pub(in crate::spec) fn located_velocities(
        &mut self,
        algebra: LieAlgebra<Number>,
        names: &[(&str, Option<Span>)],
        prefixes: &[&str],
        doc: &str,
    ) -> Vec<Value> {
        let here = self.here;
        if let Some((_, first)) = &self.algebra {
            let problem = Diagnostic::new(here, "velocities are declared twice")
                .with_place(*first, "first here")
                .with_help("name all blocks in one item: `velocity Omega, V in se(3);`");
            self.problems.push(problem);
        }
        let sizes = self.velocity_sizes(&algebra, names.len());
        self.sized_velocities(algebra, names, &sizes, prefixes, doc)
    }

    /// Dimensions of the vectors that so many names for velocities in an algebra stand for: its blocks, or elements.
    /// Another number of names is a problem.
    pub(in crate::spec) fn velocity_sizes(
        &mut self,
        algebra: &LieAlgebra<Number>,
        n_names: usize,
    ) -> Vec<usize> {
        let here = self.here;
        let blocks: Vec<usize> = algebra.blocks().iter().map(|s| s.dim).collect();
        if n_names == blocks.len() {
            blocks
        } else {
            if n_names != algebra.dim() {
                let spelled: Vec<String> =
                    algebra.blocks().iter().map(|s| format!("{} (dimension {})", s.name, s.dim)).collect();
                let plural = if n_names == 1 { "name" } else { "names" };
                let message = format!("{n_names} {plural} for the velocity in {}", algebra.name());
                let mut help = match spelled.as_slice() {
                    [only] => format!("give one name for {only}"),
                    several => format!("give {} names, for {}", several.len(), several.join(", ")),
                };
                if algebra.dim() != blocks.len() {
                    help.push_str(&format!(", or {} names, one per basis element", algebra.dim()));
                }
                self.problem(here, message, help);
            }
            vec![1; n_names]
        }
    }

    /// The algebra and names for its velocities, of these dimensions.
    pub(in crate::spec) fn sized_velocities(
        &mut self,
        algebra: LieAlgebra<Number>,
        names: &[(&str, Option<Span>)],
        sizes: &[usize],
        prefixes: &[&str],
        doc: &str,
    ) -> Vec<Value> {
        let here = self.here;
        let mut values = Vec::with_capacity(names.len());
        let (labels, mut start) = (algebra.labels(), 0);
        for (k, ((name, span), size)) in names.iter().zip(sizes.iter().copied()).enumerate() {
            self.here = *span;
            let velocity = |b: &mut ModelBuilder, component: &str, what| {
                let (symbol, expr) = b.new_symbol(component, what);
                let block = (*name).to_owned();
                b.velocities.push(Velocity {
                    name: component.to_owned(),
                    symbol,
                    block,
                    doc: doc.to_owned(),
                });
                expr
            };
            if size == 1 {
                values.push(Value::Scalar(velocity(self, name, DeclaredAs::Velocity)));
            } else {
                self.declare(name, DeclaredAs::Velocity);
                let own = labels.get(start..start + size).unwrap_or_default();
                let components = match prefixes.get(k) {
                    Some(prefix) => own.iter().map(|label| format!("{prefix}{label}")).collect(),
                    None => Layout::Vector(size).names(name),
                };
                let entries =
                    components.iter().map(|c| velocity(self, c, DeclaredAs::VelocityComponent)).collect();
                let value = Value::Vector(entries);
                self.bind(name, &value);
                values.push(value);
            }
            start += size;
        }
        self.here = here;
        // The first declaration counts; a second one is already a problem.
        self.algebra.get_or_insert((algebra, here));
        values
    }

    /// Another documentation for a velocity, vector or component.
    pub(in crate::spec) fn document_velocity(&mut self, name: &str, doc: &str) {
        for velocity in self.velocities.iter_mut().filter(|v| v.block == name || v.name == name) {
            doc.clone_into(&mut velocity.doc);
        }
    }

    /// The names of the components of a velocity, with another prefix.
    pub(in crate::spec) fn labelled(&self, velocity: &str, prefix: &str, other: &str) -> Vec<String> {
        let own = self.velocities.iter().filter(|v| v.block == velocity);
        own.filter_map(|v| Some(format!("{other}{}", v.name.strip_prefix(prefix)?))).collect()
    }

    /// The side of the group action; left when not called.
    pub fn action(&mut self, side: Side) -> &mut Self {
        let here = self.here;
        match &self.action {
            Some((_, first)) => self.twice("action", *first),
            None => self.action = Some((side, here)),
        }
        self
    }

    /// A base coordinate and its velocity `name_dot`.
    pub fn coordinate(&mut self, name: &str, domain: Domain, doc: &str) -> (Value, Value) {
        let velocity_name = format!("{name}_dot");
        let (symbol, expr) = self.new_symbol(name, DeclaredAs::Coordinate);
        let (velocity, rate) = self.new_symbol(&velocity_name, DeclaredAs::CoordinateVelocity);
        if let Domain::Interval(low, high) = domain {
            self.check_interval(low, high);
        }
        let doc = doc.to_owned();
        self.base.push(Coordinate { name: name.to_owned(), symbol, velocity_name, velocity, domain, doc });
        (Value::Scalar(expr), Value::Scalar(rate))
    }

    /// A vector of coordinates `name1, name2, ..` with velocities `name1_dot, ..`; the vectors are `name`, `name_dot`.
    pub fn coordinate_vector(&mut self, name: &str, n: usize, domain: Domain, doc: &str) -> (Value, Value) {
        let rate_name = format!("{name}_dot");
        self.declare(name, DeclaredAs::Coordinate);
        self.declare(&rate_name, DeclaredAs::CoordinateVelocity);
        let (mut place, mut rate) = (Vec::new(), Vec::new());
        for component in Layout::Vector(n).names(name) {
            let (q, v) = self.coordinate(&component, domain, doc);
            place.extend(q.into_entries());
            rate.extend(v.into_entries());
        }
        let (place, rate) = (Value::Vector(place), Value::Vector(rate));
        self.bind(name, &place);
        self.bind(&rate_name, &rate);
        (place, rate)
    }

    pub(super) fn check_interval(&mut self, low: ExprId, high: ExprId) {
        let here = self.here;
        let params: BTreeSet<SymbolId> = self.params.iter().map(|p| p.symbol).collect();
        let mut free = self.graph.free_symbols(low);
        free.extend(self.graph.free_symbols(high));
        if let Some(wrong) = free.iter().find(|s| !params.contains(s)) {
            let message =
                format!("interval contains `{}`, which is not a parameter", self.graph.name(*wrong));
            self.problem(here, message, "the ends of an interval contain parameters and numbers only");
            return;
        }
        let values = self.default_values();
        let (a, b) = (self.graph.eval_f64(low, &values), self.graph.eval_f64(high, &values));
        match (a, b) {
            (Some(a), Some(b)) if a < b => {}
            (Some(a), Some(b)) => {
                let message = format!("interval from {a} to {b} is empty");
                self.problem(here, message, "write the lower end first: `(0, pi/2)`");
            }
            _ => self.problem(here, "interval has no ends at the defaults", "its ends are finite numbers"),
        }
    }

    /// Symbols of the velocities: base first, then algebra.
    pub(super) fn velocity_symbols(&self) -> Vec<SymbolId> {
        let base = self.base[..self.n_shape()].iter().map(|c| c.velocity);
        base.chain(self.velocities.iter().map(|v| v.symbol)).collect()
    }

    pub(super) fn velocity_names(&self) -> Vec<String> {
        let base = self.base[..self.n_shape()].iter().map(|c| c.velocity_name.clone());
        base.chain(self.velocities.iter().map(|v| v.name.clone())).collect()
    }

    /// The velocities among `unknowns` that `e` mentions; the others have zero slope.
    pub(super) fn occurring(&self, e: ExprId, unknowns: &[SymbolId]) -> Vec<SymbolId> {
        let free = self.graph.free_symbols(e);
        unknowns.iter().copied().filter(|s| free.contains(s)).collect()
    }

    /// Positions of a velocity vector or component among all velocities.
    pub(super) fn velocity_indices(&self, name: &str) -> Vec<usize> {
        let n_base = self.n_shape();
        let mut found: Vec<usize> = (0..n_base).filter(|k| self.base[*k].velocity_name == name).collect();
        found.extend(
            (0..self.velocities.len()).filter(|k| self.velocities[*k].name == name).map(|k| k + n_base),
        );
        if found.is_empty() {
            let of_block = |list: &[Velocity]| list.iter().filter(|v| v.block == name).count();
            // A block of which a frame replaces a part is none of the model's any more.
            if of_block(&self.velocities) == of_block(self.original_velocities()) {
                found = (0..self.velocities.len())
                    .filter(|k| self.velocities[*k].block == name)
                    .map(|k| k + n_base)
                    .collect();
            }
        }
        if found.is_empty()
            && let Some(Value::Vector(entries)) = self.values.get(name)
        {
            // A vector of base velocities such as `x_dot`.
            let place = |e: &ExprId| (0..n_base).find(|k| self.is_symbol(*e, self.base[*k].velocity));
            found = entries.iter().map(place).collect::<Option<Vec<usize>>>().unwrap_or_default();
        }
        found
    }

    pub(super) fn unknown_velocity(&mut self, name: &str, span: Option<Span>) {
        if self.broken.contains("velocity") {
            return;
        }
        let mut known = self.velocity_names();
        known.extend(self.velocities.iter().map(|v| v.block.clone()));
        known.sort();
        known.dedup();
        let help = names::suggest(name, known.iter().map(String::as_str));
        self.problem(span, format!("`{name}` is not a velocity"), help);
    }
}
