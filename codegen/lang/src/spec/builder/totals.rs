//! Models that the model says to be the quotient of.
//!
//! Deliberately does not know: these models, whether they are right.

use std::collections::{BTreeMap, BTreeSet};

use super::draft::{DeclaredAs, ModelBuilder};
use crate::spec::diagnostic::Span;
use crate::spec::names;
use crate::spec::total::{Image, Total};
use crate::spec::want::Want;
use hamel_expr::ExprId;

impl ModelBuilder {
    /// Says that the model is the quotient of the model of a file: each variable or parameter of this one as a function
    /// of that one, in its names, or the one of the same name.
    ///
    /// ```
    /// use hamel_lang::spec::{LieAlgebra, ModelBuilder};
    ///
    /// let mut b = ModelBuilder::new("free_body");
    /// let omega = b.velocities(LieAlgebra::so(3).unwrap(), &["Omega"]).remove(0);
    /// let square = omega.dot(b.graph(), &omega).unwrap();
    /// b.lagrangian(&square).reduces("attitude.hamel", &[("Omega", "Omega")]);
    /// assert_eq!(b.build().unwrap().totals[0].images[0].components, ["Omega1", "Omega2", "Omega3"]);
    /// ```
    pub fn reduces(&mut self, file: &str, images: &[(&str, &str)]) -> &mut Self {
        let image = |(name, text): &(&str, &str)| Image {
            name: (*name).to_owned(),
            components: Vec::new(),
            text: (*text).to_owned(),
            places: None,
        };
        let place = self.here;
        let images = images.iter().map(image).collect();
        let total = Total { file: file.to_owned(), place, origin: None, images };
        self.located_reduces(total);
        self
    }

    pub(in crate::spec) fn located_reduces(&mut self, total: Total) {
        self.totals.push(total);
    }

    /// Finds the components of the variables.
    pub(super) fn check_totals(&mut self) -> Vec<Total> {
        let mut totals = std::mem::take(&mut self.totals);
        if totals.is_empty() {
            return totals;
        }
        let mut known: BTreeMap<ExprId, String> = self.state_variables();
        let numbers: Vec<_> = self.params.iter().map(|p| (p.symbol, p.name.clone())).collect();
        known.extend(numbers.into_iter().map(|(s, name)| (self.graph.sym(s), name)));
        for total in &mut totals {
            let mut taken = BTreeSet::new();
            for image in &mut total.images {
                let name = &image.name;
                let span = image.places.map(|(name, _)| name).or(total.place);
                let is_definition = self.names.get(name).is_some_and(|d| d.what == DeclaredAs::Definition);
                let value = self.values.get(name).filter(|_| !is_definition);
                let components: Option<Vec<String>> =
                    value.and_then(|v| v.entries().iter().map(|e| known.get(e).cloned()).collect());
                let Some(components) = components else {
                    let help = names::suggest(name, known.values().map(String::as_str));
                    self.problem(
                        span,
                        format!("`{name}` is no variable and no parameter of this model"),
                        help,
                    );
                    continue;
                };
                if let Some(twice) = components.iter().find(|c| !taken.insert((*c).clone())) {
                    self.problem(span, format!("`{twice}` is given twice"), "keep one of them");
                }
                image.components = components;
            }
        }
        self.totals.clone_from(&totals);
        totals
    }

    /// Whether a scene wants the map of the model that this one is the quotient of, and there is not exactly one.
    pub(super) fn wants_of_totals(&mut self, scene: &str, want: &str, span: Option<Span>) -> bool {
        if want != Want::Quotient.name() || self.totals.len() == 1 || self.broken.contains("reduces") {
            return false;
        }
        let (message, help) = match self.totals.is_empty() {
            true => (
                format!("scene `{scene}` wants `quotient`, but the model is the quotient of no other"),
                "say of which by `reduces \"file.hamel\" { .. }`",
            ),
            false => (
                format!("scene `{scene}` wants `quotient`, but the model is the quotient of several"),
                "keep one `reduces`",
            ),
        };
        self.problem(span, message, help);
        true
    }
}
