//! The balance of the equations of motion at given accelerations: what differentiates accelerations without
//! differentiating how they were solved for.
//!
//! `r(q, u, udot) = A udot - f` vanishes along the motion, so that `A d(udot) = -dr` at fixed `udot`. Of linked bodies
//! `r` is made by their recursion, forces from the last body to the first, and no entry of `A` is differentiated.
//! Deliberately does not know: by what anything is differentiated, how `A` is factored.
//!
//! # Source
//! Luh, Walker, Paul 1980, On-line computational scheme for mechanical manipulators; Carpentier, Mansard 2018,
//! Analytical derivatives of rigid body dynamics algorithms, section IV.

use std::collections::{BTreeMap, BTreeSet};

use num_traits::Zero;

use crate::reduction::SolvedConstraint;
use hamel_expr::differentiate::{Linear, Solved};
use hamel_expr::error::Error;
use hamel_expr::{Definition, ExprId, Graph, Node, Section, SectionWriter, Sign, SymbolId, needed_sections};

use super::balance::{Balance, Border, Factors, Kept};
use super::derive::Derivation;
use super::equations::Equations;
use super::recursion::Recursion;
use super::solve::{Factorisation, is_symmetric};

impl Equations {
    /// What tells derivatives of the accelerations: their balance at the motion, its factors, and the definitions of
    /// these that the equations do not have. None where the state has momenta, or no acceleration is solved for.
    ///
    /// # Errors
    /// [`Error::SingularMassMatrix`], [`Error::DivisionByZero`].
    pub fn solved(&self, g: &mut Graph) -> Result<Option<(Solved, Factors, Vec<Section>)>, Error> {
        let Some(balance) = self.linear_system().and_then(|system| system.balance.as_ref()) else {
            return Ok(None);
        };
        let symbols: Vec<(SymbolId, usize)> = (balance.solution.iter().enumerate())
            .filter_map(|(k, e)| match g.node(*e) {
                Node::Symbol(symbol) => Some((*symbol, k)),
                _ => None,
            })
            .collect();
        if symbols.is_empty() {
            return Ok(None);
        }
        // Symbols that nothing differentiates: what an acceleration is equal to changes with the state.
        let mut image = BTreeMap::new();
        let mut held = Section { title: "accelerations of the motion".into(), definitions: Vec::new() };
        for (given, value) in &balance.accelerations {
            let is_named = symbols.iter().any(|(own, _)| *g.node(*value) == Node::Symbol(*own));
            if is_named || matches!(g.node(*value), Node::Constant(_)) {
                image.insert(*given, *value);
                continue;
            }
            let name = g.name(*given).to_owned();
            let symbol = g.define(&name, *value);
            image.insert(*given, g.sym(symbol));
            held.definitions.push(Definition { symbol, expr: *value });
        }
        let mut renewed = Vec::new();
        let before = self.before(&symbols);
        for section in needed_sections(g, &self.sections, &balance.residual) {
            let mut definitions = Vec::new();
            for definition in section.definitions {
                let value = at_motion(g, definition.expr, &image)?;
                if value == definition.expr && before.contains(&definition.symbol) {
                    continue;
                }
                let name = g.name(definition.symbol).to_owned();
                let symbol = g.define(&name, value);
                image.insert(definition.symbol, g.sym(symbol));
                definitions.push(Definition { symbol, expr: value });
            }
            if !definitions.is_empty() {
                renewed.push(Section { title: section.title, definitions });
            }
        }
        let mut residual = Vec::with_capacity(balance.residual.len());
        for e in &balance.residual {
            residual.push(at_motion(g, *e, &image)?);
        }
        let mut writer = SectionWriter::after(g, self.varying.clone(), &self.sections);
        let factors = balance.factors(g, &mut writer, &self.system.signs)?;
        let labels = balance.names.iter().map(|name| format!("dot_{name}"));
        let n_multipliers = residual.len() - balance.names.len();
        let labels = labels.chain((0..n_multipliers).map(|k| format!("multiplier{}", k + 1))).collect();
        let solved = Solved { symbols, residual, held, sections: renewed, labels };
        Ok(Some((solved, factors, writer.finish().0)))
    }
}

/// Rates of the velocities of the state for each of some forces, and definitions that the equations do not have.
pub type Responses = (Vec<Vec<ExprId>>, Vec<Section>);

impl Equations {
    /// What forces along the velocities of the state add to the rates of these, `A^-1 b` for each `b` of `forces`;
    /// where multipliers keep a constraint, with their answer. `named` has the names of the forces, `before` the
    /// definitions that they are written in beside the equations.
    ///
    /// None where [`Equations::balanced_system`] has none, and where reactions do work along virtual displacements: `A`
    /// is not symmetric, or the one-forms of reactions differ from the rows of the constraint.
    ///
    /// # Errors
    /// [`Error::SingularMassMatrix`].
    pub fn responses(
        &self,
        g: &mut Graph,
        (named, before): (&[String], &[Section]),
        forces: &[Vec<ExprId>],
    ) -> Result<Option<Responses>, Error> {
        let Some((system, balance)) = self.balanced_system() else { return Ok(None) };
        let is_same = |g: &mut Graph, Kept { rows, forms, slack: _ }: &Kept| {
            rows.iter().flatten().zip(forms.iter().flatten()).all(|(a, b)| g.is_equal(*a, *b))
        };
        let kept = balance.kept.clone();
        if !is_symmetric(g, &system.mass_matrix) || kept.as_ref().is_some_and(|kept| !is_same(g, kept)) {
            return Ok(None);
        }
        // Where multipliers keep a constraint, its inertia may be part of the matrix.
        let matrix = if kept.is_some() { &balance.matrix } else { &system.mass_matrix };
        let balance = Balance { matrix: matrix.clone(), names: system.unknowns.clone(), ..balance.clone() };
        let mut writer = SectionWriter::after(g, self.varying.clone(), &self.sections);
        let beside: Vec<SymbolId> =
            before.iter().flat_map(|section| &section.definitions).map(|d| d.symbol).collect();
        writer.vary(g, &beside);
        let factors = balance.factors(g, &mut writer, &self.system.signs)?;
        let n_multipliers = kept.map_or(0, |kept| kept.forms.len());
        writer.begin("responses to forces");
        let mut responses = Vec::with_capacity(forces.len());
        for (name, force) in named.iter().zip(forces) {
            let labels = balance.names.iter().map(|unknown| format!("response_{unknown}_to_{name}"));
            let reactions = (0..n_multipliers).map(|k| format!("reaction{}_to_{name}", k + 1));
            let labels: Vec<String> = labels.chain(reactions).collect();
            let right: Vec<ExprId> =
                force.iter().copied().chain((0..n_multipliers).map(|_| g.zero())).collect();
            let mut found = factors.solve(g, &mut writer, &labels, &right);
            found.truncate(force.len());
            responses.push(found);
        }
        g.within_budget()?;
        Ok(Some((responses, writer.finish().0)))
    }
}

/// Forces along the velocities of the state, and definitions that the equations do not have.
pub type Forces = (Vec<ExprId>, Vec<Section>);

/// Where forces are asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AtRest {
    /// Rates of velocities: the forces that velocities, inputs and positions need.
    Accelerations,
    /// These and the velocities themselves: the forces that hold the system where it is.
    Velocities,
}

impl Equations {
    /// The forces of [`Balance::forces`] where accelerations vanish, or velocities as well, along the velocities of the
    /// state. None where [`Equations::balanced_system`] has none.
    ///
    /// # Errors
    /// [`Error::DivisionByZero`] where the forces have no value there.
    pub fn forces_at(&self, g: &mut Graph, at: AtRest) -> Result<Option<Forces>, Error> {
        let Some((_, balance)) = self.balanced_system() else { return Ok(None) };
        let zero = g.zero();
        let mut image: BTreeMap<SymbolId, ExprId> =
            balance.accelerations.iter().map(|(symbol, _)| (*symbol, zero)).collect();
        if at == AtRest::Velocities {
            image.extend(self.system.unknowns.iter().map(|unknown| (unknown.symbol, zero)));
        }
        let mut renewed = Vec::new();
        for section in needed_sections(g, &self.sections, &balance.forces) {
            let mut definitions = Vec::new();
            for definition in section.definitions {
                let value = at_motion(g, definition.expr, &image)?;
                if value == definition.expr {
                    continue;
                }
                if matches!(g.node(value), Node::Constant(_) | Node::Symbol(_)) {
                    image.insert(definition.symbol, value);
                    continue;
                }
                let name = g.name(definition.symbol).to_owned();
                let symbol = g.define(&name, value);
                image.insert(definition.symbol, g.sym(symbol));
                definitions.push(Definition { symbol, expr: value });
            }
            if !definitions.is_empty() {
                renewed.push(Section { title: section.title, definitions });
            }
        }
        let forces = balance.forces.clone().into_iter().map(|e| at_motion(g, e, &image));
        let forces = forces.collect::<Result<Vec<ExprId>, Error>>()?;
        Ok(Some((forces, renewed)))
    }
}

impl Balance {
    /// The factors, as the equations have them where they have any.
    fn factors(
        &self,
        g: &mut Graph,
        writer: &mut SectionWriter,
        signs: &BTreeMap<ExprId, Sign>,
    ) -> Result<Factors, Error> {
        writer.begin("factors of A");
        let inertia = Factorisation::new(g, writer, "A", &self.matrix, &self.names, signs, &[])?;
        let Some(kept) = self.kept.clone() else { return Ok(Factors { inertia, border: None }) };
        writer.begin("factors of S");
        let (mut response, mut multipliers) = (Vec::new(), Vec::new());
        for (c, form) in kept.forms.iter().enumerate() {
            let labels: Vec<String> = self.names.iter().map(|name| format!("Z{}_{name}", c + 1)).collect();
            response.push(inertia.solve(g, writer, &labels, form));
            multipliers.push(format!("multiplier {}", c + 1));
        }
        let mut matrix = Vec::new();
        for (c, row) in kept.rows.iter().enumerate() {
            let mut entries = Vec::new();
            for (other, z) in response.iter().enumerate() {
                let mut entry = g.dot(row, z);
                if other == c {
                    entry = g.add(entry, kept.slack[c]);
                }
                entries.push(writer.define(g, &format!("S_{}_{}", c + 1, other + 1), entry));
            }
            matrix.push(entries);
        }
        let schur = Factorisation::new(g, writer, "S", &matrix, &multipliers, signs, &[])?;
        Ok(Factors { inertia, border: Some(Border { kept, response, schur }) })
    }
}

impl Equations {
    /// Definitions that come before the first component of a solution.
    fn before(&self, solution: &[(SymbolId, usize)]) -> BTreeSet<SymbolId> {
        let definitions = self.sections.iter().flat_map(|section| &section.definitions).map(|d| d.symbol);
        definitions.take_while(|symbol| solution.iter().all(|(own, _)| own != symbol)).collect()
    }
}

/// An expression at the accelerations of the motion.
fn at_motion(g: &mut Graph, e: ExprId, image: &BTreeMap<SymbolId, ExprId>) -> Result<ExprId, Error> {
    g.subs(e, image)
        .map_err(|_| Error::DivisionByZero { place: "the balance of the equations of motion".into() })
}

impl Derivation<'_> {
    /// Accelerations by symbols of their own.
    fn given_accelerations(&mut self, names: &[String]) -> Vec<SymbolId> {
        let given = names.iter().map(|name| self.g.symbol(&format!("given_dot_{name}")));
        let given: Vec<SymbolId> = given.collect();
        self.writer.vary(&self.g, &given);
        given
    }

    /// The balance `A wdot - f` of a system that was assembled.
    pub(super) fn balance_of(
        &mut self,
        matrix: &[Vec<ExprId>],
        force: &[ExprId],
        names: &[String],
        solution: &[ExprId],
    ) -> Balance {
        let given = self.given_accelerations(names);
        let values: Vec<ExprId> = given.iter().map(|s| self.g.sym(*s)).collect();
        let mut residual = Vec::with_capacity(force.len());
        for (row, force) in matrix.iter().zip(force) {
            let inertial = self.g.dot(row, &values);
            residual.push(self.g.sub(inertial, *force));
        }
        Balance {
            accelerations: given.into_iter().zip(solution.iter().copied()).collect(),
            forces: residual.clone(),
            residual,
            matrix: matrix.to_vec(),
            kept: None,
            solution: solution.to_vec(),
            names: names.to_vec(),
        }
    }

    /// The balance `L_yy ydot - Lambda^T lambda - r`, `w ydot + w0 + slack lambda` of a system that keeps its
    /// constraint by multipliers: `kept` beside `w0`, `solution` has `ydot` and `lambda`.
    pub(super) fn balance_with_multipliers(
        &mut self,
        (hessian, drive): (&[Vec<ExprId>], &[ExprId]),
        (kept, offsets): (Kept, &[ExprId]),
        solution: [&[ExprId]; 2],
    ) -> Balance {
        let names = self.names.clone();
        let mut balance = self.balance_of(hessian, drive, &names, solution[0]);
        let labels: Vec<String> = (1..=offsets.len()).map(|k| format!("multiplier{k}")).collect();
        let given = self.given_accelerations(&labels);
        for (symbol, form) in given.iter().zip(&kept.forms) {
            let multiplier = self.g.sym(*symbol);
            for (residual, e) in balance.residual.iter_mut().zip(form) {
                let reaction = self.g.mul(*e, multiplier);
                *residual = self.g.sub(*residual, reaction);
            }
        }
        let ydot: Vec<ExprId> = balance.accelerations.iter().map(|(symbol, _)| self.g.sym(*symbol)).collect();
        for (c, (row, offset)) in kept.rows.iter().zip(offsets).enumerate() {
            let (along, multiplier) = (self.g.dot(row, &ydot), self.g.sym(given[c]));
            let off = self.g.mul(kept.slack[c], multiplier);
            balance.residual.push(self.g.sum(&[along, *offset, off]));
        }
        balance.accelerations.extend(given.into_iter().zip(solution[1].iter().copied()));
        balance.solution.extend(solution[1]);
        balance.kept = Some(kept);
        balance
    }

    /// The balance of linked bodies along their rates `w`, `u = B w`, of which `matrix` is the mass matrix: rates of
    /// change from the first part to the last, forces from the last to the first.
    pub(super) fn balance_of_linked(
        &mut self,
        recursion: &Recursion,
        solved: &SolvedConstraint,
        matrix: &[Vec<ExprId>],
        solution: &[ExprId],
    ) -> Result<Balance, Error> {
        let names: Vec<String> = solved.unknowns.iter().map(|u| u.name.clone()).collect();
        let given = self.given_accelerations(&names);
        let by_rates = recursion.directions.inverse.clone();
        let mut accelerations = Vec::with_capacity(given.len());
        let mut changes = BTreeMap::new();
        for ((symbol, unknown), row) in given.iter().zip(&solved.unknowns).zip(&by_rates) {
            let terms: Vec<_> = solution.iter().copied().zip(row.iter().cloned()).collect();
            accelerations.push((*symbol, self.g.linear_combination(&terms)));
            changes.insert(unknown.symbol, self.g.sym(*symbol));
        }
        let motion = self.along_recursion(recursion, ("acc_", "inverse dynamics: accelerations"), changes)?;
        self.writer.begin("inverse dynamics: forces from the last part to the first");
        let mut forces: BTreeMap<SymbolId, Vec<ExprId>> = BTreeMap::new();
        for (k, square) in recursion.components.iter().enumerate() {
            for (i, e) in square.iter().enumerate() {
                let force = self.define(&format!("ma{}_{}", k + 1, i + 1), motion.forces[k][i]);
                self.pass_on(recursion, (*e, None), force, &mut forces)?;
            }
        }
        let rest_hessian = self.hessian_of(recursion.rest)?;
        let net = self.net_of_rest(&rest_hessian, &motion);
        for (velocity, net) in self.system.velocities.clone().into_iter().zip(net) {
            let left = self.g.neg(net);
            forces.entry(velocity).or_default().push(left);
        }
        for step in recursion.steps.iter().rev() {
            let (symbol, value, coefficient) = step.value(self.system);
            let Some(terms) = forces.remove(&symbol) else { continue };
            let sum = self.g.sum(&terms);
            let force = self.define(&format!("force_{}", self.g.name(symbol).to_owned()), sum);
            self.pass_on(recursion, (value, coefficient), force, &mut forces)?;
        }
        let mut along_unknowns = Vec::with_capacity(names.len());
        for unknown in &solved.unknowns {
            let terms = forces.remove(&unknown.symbol).unwrap_or_default();
            along_unknowns.push(self.g.sum(&terms));
        }
        let mut residual = Vec::with_capacity(names.len());
        for b in 0..names.len() {
            let along = along_unknowns.iter().copied().zip(by_rates.iter().map(|row| row[b].clone()));
            let terms: Vec<_> = along.filter(|(_, weight)| !weight.is_zero()).collect();
            residual.push(self.g.linear_combination(&terms));
        }
        let (matrix, solution) = (matrix.to_vec(), solution.to_vec());
        let forces = along_unknowns;
        Ok(Balance { accelerations, residual, forces, matrix, kept: None, solution, names })
    }

    /// A force on a value, on everything that the value is computed from: `value`, or `-value/coefficient`.
    fn pass_on(
        &mut self,
        recursion: &Recursion,
        (value, coefficient): (ExprId, Option<ExprId>),
        force: ExprId,
        forces: &mut BTreeMap<SymbolId, Vec<ExprId>>,
    ) -> Result<(), Error> {
        if force == self.g.zero() {
            return Ok(());
        }
        for symbol in self.g.free_symbols(value) {
            if recursion.vanishing.contains(&symbol) || !self.is_moved_by_velocities(recursion, symbol) {
                continue;
            }
            let slope = self.g.diff(value, symbol);
            let mut slope = self.in_recursion(recursion, slope)?;
            if let Some(coefficient) = coefficient {
                slope = self.solved_for(slope, coefficient);
            }
            if slope != self.g.zero() {
                let along = self.g.mul(slope, force);
                forces.entry(symbol).or_default().push(along);
            }
        }
        Ok(())
    }

    /// Whether a symbol is a velocity, a quasi-velocity or a part.
    fn is_moved_by_velocities(&self, recursion: &Recursion, symbol: SymbolId) -> bool {
        recursion.values.contains_key(&symbol)
            || self.system.velocities.contains(&symbol)
            || self.system.unknowns.iter().any(|u| u.symbol == symbol)
    }
}
