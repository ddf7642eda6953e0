//! Momenta along the sections that a model names, and their rates.
//!
//! `d/dt <p, s> = s^a (rho^i_a dL/dx^i + F_a + (N^c_a - C^c_ab y^b) p_c) + <p, ds/dt> + lambda_A <form_A, s>`: along a
//! section of virtual displacements that is a symmetry, nothing is left (Noether's theorem with constraints).
//!
//! Does not know: which sections there are, and why.
//!
//! # Source
//! Cortes, de Leon, Marrero, Martinez 2009, equation (5.6); Bates and Sniatycki 1993; Bloch, Krishnaprasad, Marsden,
//! Murray 1996; Fasso, Ramos, Sansonetto 2007.

use crate::reduction::KinematicConstraint;
use hamel_expr::error::Error;
use hamel_expr::{ExprId, Vanishing, independent_rows};
use hamel_lang::spec::Want;

use super::chart::Chart;
use super::derive::{Derivation, Motion};
use super::equations::{Equations, Output, SectionMomentum};

impl Derivation<'_> {
    /// The momenta along the sections of the model, and their rates, with an output of each. The output of rates is
    /// without momenta that are proved to be conserved.
    pub(super) fn along_sections(
        &mut self,
        motion: &Motion,
    ) -> Result<(Vec<SectionMomentum>, Vec<Output>), Error> {
        let system = self.system;
        let raw: Vec<ExprId> = match &system.hamiltonian {
            Some(hamiltonian) => hamiltonian.momenta.iter().map(|s| self.g.sym(*s)).collect(),
            None if system.sections.is_empty() => Vec::new(),
            None => system.velocities.iter().map(|y| self.g.diff(system.lagrangian, *y)).collect(),
        };
        let (mut found, mut components, mut rates) = (Vec::new(), Vec::new(), Vec::new());
        for section in &system.sections {
            let value = self.g.dot(&section.coefficients, &self.momentum);
            components.push((section.name.clone(), self.g.cancel_zero(value)));
            let momentum = self.g.dot(&section.coefficients, &raw);
            let rate = self.rate_of(momentum, motion)?;
            let is_displacement = self.is_displacement(&section.coefficients)?;
            let verdict = self.g.vanishing(rate);
            let mut rate = rate;
            if verdict != Vanishing::Zero {
                rate = self.without_accelerations(&section.coefficients, is_displacement, motion, rate)?;
                rates.push((format!("dot_{}", section.name), rate));
            }
            found.push(SectionMomentum { name: section.name.clone(), rate, verdict, is_displacement });
        }
        let doc = "momenta `<p, s>` along the sections of the model";
        let doc_of_rates = "rates of momenta along sections by the momentum equation, without conserved ones";
        let outputs = [(Want::Sections, components, doc), (Want::SectionRates, rates, doc_of_rates)];
        let outputs = outputs.into_iter().filter(|(_, components, _)| !components.is_empty());
        let outputs = outputs.map(|(want, components, doc)| Output::group(want, components, doc)).collect();
        Ok((found, outputs))
    }

    /// The rate of the momentum along a section by the momentum equation, with the work of reactions where they act
    /// along the section; the rate `by_motion` where the equation is not proved to give the same.
    fn without_accelerations(
        &mut self,
        section: &[ExprId],
        is_displacement: Option<bool>,
        motion: &Motion,
        by_motion: ExprId,
    ) -> Result<ExprId, Error> {
        let system = self.system;
        if system.hamiltonian.is_some() || system.degeneracy.is_some() {
            return Ok(by_motion);
        }
        let (_, mut rate) = self.momentum_and_rate(section)?;
        if is_displacement != Some(true) {
            for (form, (_, lambda)) in motion.reactions.iter().zip(&motion.multipliers) {
                let work = self.g.dot(form, section);
                let work = self.replace(work)?;
                let work = self.g.cancel_zero(work);
                let term = self.g.mul(*lambda, work);
                rate = self.g.add(rate, term);
            }
        }
        let difference = self.g.sub(rate, by_motion);
        Ok(if self.g.is_zero(difference) { rate } else { by_motion })
    }

    /// Whether a section is one of virtual displacements.
    fn is_displacement(&mut self, section: &[ExprId]) -> Result<Option<bool>, Error> {
        let system = self.system;
        let (rows, n) = match &system.constraint {
            KinematicConstraint::Solved(solved) => {
                let n = solved.unknowns.len();
                let column = |b: usize| solved.virtual_displacements.iter().map(move |row| row[b]);
                let columns = (0..n).map(|b| column(b).collect::<Vec<_>>());
                (columns.chain([section.to_vec()]).collect::<Vec<_>>(), n)
            }
            KinematicConstraint::Multipliers { reactions, .. } => {
                let mut is_displacement = Some(true);
                for form in reactions {
                    let work = self.g.dot(form, section);
                    let work = self.replace(work)?;
                    match self.g.vanishing(work) {
                        Vanishing::Zero => {}
                        Vanishing::NonZero => return Ok(Some(false)),
                        Vanishing::Unknown => is_displacement = None,
                    }
                }
                return Ok(is_displacement);
            }
        };
        Ok(Some(independent_rows(&self.g, &rows).iter().all(|k| *k < n)))
    }
}

impl Equations {
    /// Whether a rate vanishes at every state that satisfies the constraints, which is a question where multipliers
    /// keep them; false where it is not known.
    pub fn vanishes_on_constraint(&self, rate: ExprId) -> bool {
        let mut g = self.system.graph.clone();
        let restricted = Chart::new(&mut g, self).and_then(|chart| chart.restricted(&mut g, &[], rate));
        restricted.is_ok_and(|rate| g.is_zero(rate))
    }
}
