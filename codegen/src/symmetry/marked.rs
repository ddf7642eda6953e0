//! Lagrangians in which the attitude `R` of a body stands by one of its rows, `R^T e_i`, the direction of an axis of
//! space in the body: the row is `R^T n` with a vector `n` that turns with the group, so that turns about all axes keep
//! everything, and `R^T n` advects.
//!
//! The kinetic energy may depend on the row in any way; a polynomial in the potential energy alone has a module
//! without it. Source: Cendra, Holm, Marsden and Ratiu 1998.
//!
//! Does not know: how a model is written.

use hamel_expr::{ExprId, Rational, SymbolId};
use hamel_lang::spec::Side;

use super::group::{SymmetryGroup, Way};
use super::setting::{Generator, Images, Setting};

/// The row that is marked.
#[derive(Clone)]
pub(super) struct Marked {
    /// The configuration, and the axis of space.
    pub(super) configuration: usize,
    pub(super) axis: usize,
    /// `n`.
    pub(super) normal: [SymbolId; 3],
    /// What advects, `R^T n`.
    pub(super) advected: [SymbolId; 3],
    /// The name of it.
    pub(super) name: String,
}

impl Setting<'_> {
    /// Configurations and axes whose rows the model contains.
    pub(super) fn rows(&self) -> Vec<(usize, usize)> {
        let lagrangian = [self.kinetic, self.potential];
        let there: Vec<SymbolId> = lagrangian.iter().flat_map(|e| self.graph.free_symbols(*e)).collect();
        let mut list = Vec::new();
        for (k, configuration) in self.model.configurations.iter().enumerate() {
            let group = &configuration.group;
            if !group.is_of_rotations() || group.n() != 3 || !group.spaces().is_empty() {
                continue;
            }
            list.extend(
                (0..3)
                    .filter(|i| configuration.symbols[3 * i..3 * i + 3].iter().any(|s| there.contains(s)))
                    .map(|i| (k, i)),
            );
        }
        list
    }

    /// Marks a row, and the way to the group that keeps everything then, if it does.
    pub(super) fn mark(&mut self, (k, axis): (usize, usize)) -> Option<Way> {
        let configuration = &self.model.configurations[k];
        let name =
            self.free_name(if self.model.places.declared.contains_key("Gamma") { "a" } else { "Gamma" });
        let normal = [0, 1, 2].map(|l| self.graph.symbol(&format!("'normal{l}")));
        let advected = [0, 1, 2].map(|l| self.graph.symbol(&format!("{name}{}", l + 1)));
        let n = normal.map(|s| self.graph.sym(s));
        let mut images = Images::new();
        for j in 0..3 {
            let terms: Vec<ExprId> = (0..3)
                .map(|l| {
                    let entry = self.graph.sym(configuration.symbols[3 * l + j]);
                    self.graph.mul(n[l], entry)
                })
                .collect();
            images.insert(configuration.symbols[3 * axis + j], self.graph.sum(&terms));
        }
        self.kinetic = self.graph.subs(self.kinetic, &images).ok()?;
        self.potential = self.graph.subs(self.potential, &images).ok()?;
        self.power = self.graph.subs(self.power, &images).ok()?;
        self.constraints = self.graph.subs_all(&self.constraints, &images).ok()?;
        // `n' = e_a n`.
        for (a, matrix) in configuration.group.matrices().iter().enumerate() {
            let at = self.position(Generator::Left(k, a))?;
            for l in 0..3 {
                let terms: Vec<(ExprId, Rational)> =
                    (0..3).map(|m| (n[m], matrix.get(l, m).clone())).collect();
                let rate = self.graph.linear_combination(&terms);
                self.add_image(at, normal[l], rate);
            }
        }
        self.marked = Some(Marked { configuration: k, axis, normal, advected, name });
        let way = Way { side: Side::Left, is_broken: false, angles: None };
        let group = self.group(&way);
        let own: Vec<_> = group
            .fields
            .iter()
            .filter(|f| self.configuration_of(f).is_some_and(|(of, _)| of == k))
            .map(|f| f.images.clone())
            .collect();
        let everything = self.everything();
        (!own.is_empty() && own.iter().all(|images| self.keeps(images, &everything))).then_some(way)
    }

    /// The item of what advects: `a' = -xi x a` where the body turns with `xi`.
    pub(super) fn marked_item(&mut self, group: &SymmetryGroup, symbols: &[SymbolId]) -> Option<String> {
        let marked = self.marked.clone()?;
        let matrices = self.model.configurations[marked.configuration].group.matrices().to_vec();
        let mut action = Vec::new();
        for l in 0..3 {
            let mut terms = Vec::new();
            for (field, symbol) in group.fields.iter().zip(symbols) {
                let Some((k, a)) = self.configuration_of(field) else { continue };
                if k != marked.configuration {
                    continue;
                }
                let xi = self.graph.sym(*symbol);
                for m in 0..3 {
                    let entry = self.graph.sym(marked.advected[m]);
                    terms.push((self.graph.mul(xi, entry), matrices[a].get(l, m).clone()));
                }
            }
            let sum = self.graph.linear_combination(&terms);
            action.push(self.spelled(sum));
        }
        Some(format!(
            "    /// Axis {} of space in the body.\n    advected {} in R^3 by [{}];\n",
            marked.axis + 1,
            marked.name,
            action.join(", "),
        ))
    }
}
