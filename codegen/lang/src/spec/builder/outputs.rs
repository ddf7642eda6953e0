//! Casimirs and outputs.
//!
//! Deliberately does not know: whether a Casimir is conserved, which scene wants an output.

use super::draft::ModelBuilder;
use crate::spec::diagnostic::Diagnostic;
use crate::spec::event::OutputPart;
use crate::spec::layout::Layout;
use crate::spec::model::*;
use crate::spec::names;
use crate::spec::shape::Shape;
use crate::spec::value::Value;
use crate::spec::want::Want;

impl ModelBuilder {
    pub(super) fn output_name(&mut self, name: &str) {
        let here = self.here;
        let is_taken = Want::from_name(name).is_some();
        if is_taken || names::refusal(name).is_some() {
            let reason = names::refusal(name).unwrap_or("every scene has an output of that name");
            self.problem(here, format!("`{name}` cannot be used as a name"), reason);
        }
        if let Some(first) = self.output_names.insert(name.to_owned(), here) {
            let problem = Diagnostic::new(here, format!("output `{name}` is declared twice"))
                .with_place(first, "first here")
                .with_help("rename one of them");
            self.problems.push(problem);
        }
    }

    /// Scenes want components by their names, so that no two outputs have one of the same name.
    fn output_component(&mut self, output: &str, component: &str) {
        let own = (output.to_owned(), self.here);
        let Some((first, place)) = self.output_components.insert(component.to_owned(), own) else { return };
        if first != output {
            let message = format!("`{component}` is a component of two outputs, `{first}` and `{output}`");
            let problem = Diagnostic::new(self.here, message).with_help("rename one of them");
            self.problems.push(problem.with_place(place, "first here"));
        }
    }

    /// A named number that the motion should conserve.
    ///
    /// ```
    /// use hamel_lang::spec::{LieAlgebra, ModelBuilder, Rational};
    ///
    /// let one = Rational::from_integer(1.into());
    /// let mut b = ModelBuilder::new("sphere");
    /// let inertia = b.param("I", one.clone(), "");
    /// let omega = b.velocities(LieAlgebra::so(3).unwrap(), &["Omega"]).remove(0);
    /// let square = omega.dot(b.graph(), &omega).unwrap();
    /// let energy = square.mul(b.graph(), &inertia).unwrap();
    /// b.lagrangian(&energy).casimir("C", &square, "").output("turning", &omega, "");
    /// b.scene("unit", &[("I", &[one])], &["energy", "turning"], "a scene");
    /// assert!(b.clone().build().is_ok());
    /// b.scene("other", &[], &["turnign"], "");
    /// assert!(b.build().unwrap_err().to_string().contains("did you mean `turning`?"));
    /// ```
    pub fn casimir(&mut self, name: &str, value: &Value, doc: &str) -> &mut Self {
        self.output_name(name);
        match value.scalar("casimir") {
            Ok(expr) => self.casimirs.push(Named { name: name.to_owned(), expr, doc: doc.to_owned() }),
            Err(error) => self.value_error(self.here, &error),
        }
        self
    }

    /// A named output.
    pub fn output(&mut self, name: &str, value: &Value, doc: &str) -> &mut Self {
        self.output_name(name);
        let names = match value.shape() {
            Shape::Scalar => vec![name.to_owned()],
            Shape::Vector(n) => Layout::Vector(n).names(name),
            Shape::Matrix(n, m) => Layout::Matrix(n, m).names(name),
        };
        for component in &names {
            self.output_component(name, component);
        }
        let components = names.into_iter().zip(value.entries().iter().copied()).collect();
        let (name, doc, part) = (name.to_owned(), doc.to_owned(), OutputPart::Own);
        self.outputs.push(NamedVector { name, components, doc, part });
        self
    }
}
