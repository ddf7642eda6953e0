//! What kind of system a model is, by the names that the literature has for its equations.
//!
//! Deliberately does not know: the equations.

use std::fmt;

use super::model::{ConstraintKind, Given, Model};
use hamel_expr::SymbolId;

/// What moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum Setting {
    /// A group alone: `Q = G`.
    Group,
    /// A group and a shape space: `Q = M x G`, or a bundle over `M`.
    Bundle,
    /// A configuration space without symmetry.
    Base,
    /// A Lie algebroid that the model declares.
    Algebroid,
}

/// The least special class that contains all constraints of a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum Restriction {
    /// No constraints.
    None,
    /// Linear in the velocities.
    Linear,
    /// Affine in the velocities: something drives the constraint.
    Affine,
    /// Nonlinear in the velocities.
    Nonlinear,
    /// On accelerations.
    SecondOrder,
    /// On rates of accelerations.
    ThirdOrder,
}

/// Kind of a system; the order is the one in which to list them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub struct Kind {
    /// What moves.
    pub setting: Setting,
    /// Whether a Hamiltonian on the dual says how, and no Lagrangian.
    pub is_hamiltonian: bool,
    /// Whether the motion is given: a vector field that follows from no Lagrangian.
    pub is_given: bool,
    /// Its constraints.
    pub restriction: Restriction,
    /// Whether virtual displacements are not those of the constraints: servo constraints.
    pub is_servo: bool,
    /// Whether the group moves parameters.
    pub has_advected: bool,
    /// Whether the algebra is reduced by stages.
    pub by_stages: bool,
}

impl Model {
    /// Whether the model has a Hamiltonian, or a Lagrangian that contains a velocity.
    pub fn is_energetic(&self) -> bool {
        let free = self.graph.free_symbols(self.lagrangian);
        self.hamiltonian.is_some() || self.all_velocities().iter().any(|(_, s)| free.contains(s))
    }

    /// Whether constraints give velocities by others that the model gives, so that nothing is derived from an energy.
    pub fn is_kinematic(&self) -> bool {
        self.given.as_ref().is_some_and(|given| given.contains(&Given::Constrained))
    }

    /// The kind of system that the model describes.
    pub fn kind(&self) -> Kind {
        let setting = match (self.velocities.is_empty(), self.base.is_empty()) {
            (false, true) => Setting::Group,
            (false, false) => Setting::Bundle,
            (true, _) => Setting::Base,
        };
        let setting = if self.algebroid.is_some() { Setting::Algebroid } else { setting };
        let mut graph = self.graph.clone();
        let own = self.quasi_velocities.iter().map(|v| v.symbol);
        let velocities: Vec<SymbolId> =
            self.all_velocities().into_iter().map(|(_, s)| s).chain(own).collect();
        let restrictions = self.constraints.iter().map(|c| match c.kind {
            ConstraintKind::Nonlinear => Restriction::Nonlinear,
            ConstraintKind::SecondOrder { .. } => Restriction::SecondOrder,
            ConstraintKind::ThirdOrder { .. } => Restriction::ThirdOrder,
            ConstraintKind::Linear => match graph.affine_parts(c.residual, &velocities) {
                Some((_, rest)) if graph.is_zero(rest) => Restriction::Linear,
                _ => Restriction::Affine,
            },
        });
        Kind {
            setting,
            is_hamiltonian: self.hamiltonian.is_some(),
            is_given: self.given.is_some(),
            restriction: restrictions.max().unwrap_or(Restriction::None),
            is_servo: !self.virtual_constraints.is_empty(),
            has_advected: !self.advected.is_empty(),
            by_stages: self.stages.is_some(),
        }
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let is_free = self.restriction == Restriction::None && !self.is_servo;
        f.write_str(match (self.setting, is_free) {
            (Setting::Base, _) if self.is_given => "vector field",
            (Setting::Group | Setting::Bundle, _) if self.is_given => "invariant vector field",
            (Setting::Algebroid, _) if self.is_given => "vector field on a Lie algebroid",
            (Setting::Algebroid, true) if self.is_hamiltonian => "Hamilton on a Lie algebroid",
            (Setting::Algebroid, false) if self.is_hamiltonian => "Hamilton-d'Alembert on a Lie algebroid",
            (Setting::Algebroid, true) => "Lagrange on a Lie algebroid",
            (Setting::Algebroid, false) => "Lagrange-d'Alembert on a Lie algebroid",
            (Setting::Group, true) if self.is_hamiltonian => "Lie-Poisson",
            (Setting::Group, false) if self.is_hamiltonian => "Lie-Poisson-Suslov",
            (Setting::Bundle, true) if self.is_hamiltonian => "Hamilton-Poincaré",
            (Setting::Bundle, false) if self.is_hamiltonian => "Hamilton-d'Alembert-Poincaré",
            (Setting::Base, true) if self.is_hamiltonian => "Hamilton",
            (Setting::Base, false) if self.is_hamiltonian => "Hamilton-d'Alembert",
            (Setting::Group, true) => "Euler-Poincaré",
            (Setting::Group, false) => "Euler-Poincaré-Suslov",
            (Setting::Bundle, true) => "Lagrange-Poincaré",
            (Setting::Bundle, false) => "Lagrange-d'Alembert-Poincaré",
            (Setting::Base, true) => "Lagrange",
            (Setting::Base, false) => "Lagrange-d'Alembert",
        })?;
        let qualifiers = [
            (self.restriction == Restriction::Affine, "affine constraints"),
            (self.restriction == Restriction::Nonlinear, "nonlinear constraints"),
            (self.restriction == Restriction::SecondOrder, "second-order constraints"),
            (self.restriction == Restriction::ThirdOrder, "third-order constraints"),
            (self.is_servo, "servo constraints"),
            (self.has_advected, "advected parameters"),
            (self.by_stages, "by stages"),
        ];
        for (_, words) in qualifiers.iter().filter(|(holds, _)| *holds) {
            write!(f, ", {words}")?;
        }
        Ok(())
    }
}
