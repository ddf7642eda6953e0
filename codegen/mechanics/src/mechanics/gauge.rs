//! Momenta that are conserved along sections with coefficients on the base, and moving energies: found by linear
//! algebra over values, and proved.
//!
//! `I = <p, s>` and `I = E - <p, Y>` are linear in the section, so that `dI/dt = 0` is a linear relation between the
//! rates of `f <p, e>` for functions `f` of an ansatz and sections `e` of the frame and of virtual displacements. A
//! moving energy has `Y` proportional to what makes the energy change: to the part of an affine constraint without
//! velocities, or to a frequency of explicit time (then it is Jacobi's integral).
//!
//! Does not know: which scene wants them.
//!
//! # Source
//! Bates, Graumann, MacDonnell 1996 (gauge momenta); Fasso, Sansonetto 2016 (moving energies).

use std::collections::{BTreeMap, BTreeSet};

use num_traits::{One, Signed, Zero};

use crate::reduction::{AccelerationSource, BlockKind, KinematicConstraint};
use hamel_expr::differentiate::Linearisation;
use hamel_expr::error::Error;
use hamel_expr::{
    ExprId, Func, Graph, Node, Rational, SectionWriter, Stage, SymbolId, Vanishing, independent_rows,
    needed_sections, rational_relations,
};
use hamel_lang::spec::Want;

use super::chart::Chart;
use super::equations::{Equations, OutputKind};
use super::measure::{Motion, candidates, powers};

/// A function of the state that is constant along the motion: `<p, s>`, or `E - <p, s>`.
#[derive(Clone, Debug)]
pub struct ConservedMomentum {
    /// `s`: names of velocities of the model and coefficients along them, none zero; functions on the base.
    pub section: Vec<(String, ExprId)>,
    /// The function, in terms of the state and the definitions of the equations.
    pub value: ExprId,
}

/// What was found of this kind.
#[derive(Clone, Debug)]
pub struct ConservedMomenta {
    /// Owner of the expressions.
    pub graph: Graph,
    /// Functionally independent ones.
    pub momenta: Vec<ConservedMomentum>,
    /// The moving energy, looked for where the energy is not conserved.
    pub moving_energy: Option<ConservedMomentum>,
    /// Whether they are conserved at the states that satisfy the constraints only, which multipliers keep.
    pub is_on_constraint: bool,
}

/// More products of functions and sections are not tried.
const MAX_COLUMNS: usize = 240;
/// States of more components are not looked into for powers of functions.
const MAX_STATE: usize = 14;
/// More sines and cosines are no functions of the ansatz.
const MAX_WAVES: usize = 8;

/// A product `f <p, e>`, with its rate.
#[derive(Clone, Debug)]
struct Term {
    value: ExprId,
    rate: ExprId,
    section: Vec<(String, ExprId)>,
    /// Whether `f` is one.
    is_plain: bool,
}

impl ConservedMomenta {
    /// Finds them.
    ///
    /// # Errors
    /// [`Error::OverBudget`]; what is wrong with coordinates of the states that satisfy the constraints.
    pub fn new(equations: &Equations) -> Result<ConservedMomenta, Error> {
        let mut g = equations.system.graph.clone();
        g.enter(Stage::Results);
        let is_on_constraint = matches!(equations.system.constraint, KinematicConstraint::Multipliers { .. });
        let mut found = ConservedMomenta {
            graph: Graph::new(),
            momenta: Vec::new(),
            moving_energy: None,
            is_on_constraint,
        };
        if equations.has_energy() {
            let chart = match is_on_constraint {
                true => Some(Chart::new(&mut g, equations)?),
                false => None,
            };
            let mut search = Search { g: &mut g, equations, chart };
            let terms = search.terms()?;
            found.momenta = search.momenta(&terms)?;
            let facts = &equations.facts;
            if !facts.energy_is_conserved && !facts.energy_is_conserved_on_constraint {
                found.moving_energy = search.moving_energy(&terms)?;
            }
        }
        g.within_budget()?;
        found.graph = g;
        Ok(found)
    }
}

struct Search<'a> {
    g: &'a mut Graph,
    equations: &'a Equations,
    chart: Option<Chart>,
}

impl Search<'_> {
    fn group(&self, want: Want) -> Vec<(String, ExprId)> {
        let found = self.equations.outputs.iter().filter(|o| o.kind == OutputKind::Group(want));
        found.flat_map(|o| o.components.iter().cloned()).collect()
    }

    /// Rates along the motion, at states that satisfy the constraints.
    fn rates(&mut self, values: &[ExprId]) -> Result<Vec<ExprId>, Error> {
        let (g, equations) = (&mut *self.g, self.equations);
        let sections = needed_sections(g, &equations.sections, values);
        let time = equations.system.time;
        let by: Vec<SymbolId> = equations.state.iter().map(|s| s.symbol).chain([time]).collect();
        let motion: Vec<ExprId> = equations.state.iter().map(|s| s.derivative).chain([g.one()]).collect();
        let linear = Linearisation::new(g, &sections, values, &by);
        // Nobody computes these rates.
        let mut scratch = SectionWriter::new(g, BTreeSet::new(), &[]);
        let name = |value: &str, _: usize| format!("rate_{value}");
        let rates = linear.forward(g, &mut scratch, &[motion], name, str::to_owned);
        let (own, _) = scratch.finish();
        let rates: Vec<ExprId> = rates.into_iter().map(|rate| rate[0]).collect();
        match &self.chart {
            Some(chart) => chart.whole(self.g, &own, &rates),
            None => Ok(rates),
        }
    }

    /// Momenta along the sections of the frame and of virtual displacements, by the velocities of the model.
    fn sections(&mut self) -> Vec<(ExprId, Vec<(String, ExprId)>)> {
        let one = self.g.one();
        let frame = self.group(Want::Momentum);
        let mut sections: Vec<(ExprId, Vec<(String, ExprId)>)> = Vec::new();
        for (name, value) in frame {
            let velocity = name.strip_prefix("p_").unwrap_or(&name).to_owned();
            sections.push((value, vec![(velocity, one)]));
        }
        let system = &self.equations.system;
        // Displacements of another frame are not told by the velocities of the model.
        if let (KinematicConstraint::Solved(solved), None) = (&system.constraint, &system.frame) {
            for (b, (_, value)) in self.group(Want::NonholonomicMomentum).into_iter().enumerate() {
                let column = system.algebroid.frame().iter().zip(&solved.virtual_displacements);
                let column = column.filter(|(_, row)| row[b] != self.g.zero());
                let section: Vec<(String, ExprId)> =
                    column.map(|(velocity, row)| (velocity.clone(), row[b])).collect();
                if section.len() > 1 {
                    sections.push((value, section));
                }
            }
        }
        sections
    }

    /// Functions of the base that coefficients are made of: one, the coordinates, sines and cosines of the equations.
    fn functions(&mut self) -> Vec<ExprId> {
        let equations = self.equations;
        let base: BTreeSet<SymbolId> = equations.system.algebroid.base().iter().copied().collect();
        let symbols = equations.system.algebroid.base().iter();
        let mut functions = vec![self.g.one()];
        functions.extend(symbols.map(|x| self.g.sym(*x)));
        let definitions = equations.sections.iter().flat_map(|s| &s.definitions).map(|d| d.expr);
        let rates = equations.state.iter().map(|s| s.derivative);
        let all: Vec<ExprId> = definitions.chain(rates).collect();
        let mut waves = Vec::new();
        for e in self.g.reachable(&all) {
            let Node::Function(Func::Sin | Func::Cos, inside) = *self.g.node(e) else { continue };
            if self.g.free_symbols(inside).iter().any(|s| base.contains(s)) && waves.len() < MAX_WAVES {
                waves.push(e);
            }
        }
        functions.extend(waves);
        functions
    }

    /// Products of functions and momenta, those with constant coefficients first.
    fn terms(&mut self) -> Result<Vec<Term>, Error> {
        let (sections, mut functions) = (self.sections(), self.functions());
        if sections.len() * functions.len() > MAX_COLUMNS {
            functions.truncate(1);
        }
        let momenta: Vec<ExprId> = sections.iter().map(|(value, _)| *value).collect();
        let all: Vec<ExprId> = momenta.iter().chain(&functions).copied().collect();
        let rates = self.rates(&all)?;
        let (of_momenta, of_functions) = rates.split_at(momenta.len());
        let values = match &self.chart {
            Some(chart) => chart.whole(self.g, &[], &momenta)?,
            None => momenta.clone(),
        };
        let g = &mut *self.g;
        let mut terms = Vec::new();
        for (f, f_rate) in functions.iter().zip(of_functions) {
            for (k, (momentum, section)) in sections.iter().enumerate() {
                let (turning, moving) = (g.mul(*f_rate, values[k]), g.mul(*f, of_momenta[k]));
                let rate = g.add(turning, moving);
                let section = section.iter().map(|(name, e)| (name.clone(), g.mul(*f, *e))).collect();
                let is_plain = *f == g.one();
                terms.push(Term { value: g.mul(*f, *momentum), rate, section, is_plain });
            }
        }
        Ok(terms)
    }

    /// A combination of terms; none where its section vanishes.
    fn combined(&mut self, terms: &[Term], weights: &[(usize, ExprId)]) -> Option<ConservedMomentum> {
        let g = &mut *self.g;
        let mut section: Vec<(String, Vec<ExprId>)> = Vec::new();
        let mut value = Vec::new();
        for (k, weight) in weights {
            value.push(g.mul(*weight, terms[*k].value));
            for (name, e) in &terms[*k].section {
                let part = g.mul(*weight, *e);
                match section.iter_mut().find(|(own, _)| own == name) {
                    Some((_, parts)) => parts.push(part),
                    None => section.push((name.clone(), vec![part])),
                }
            }
        }
        let summed = section.into_iter().map(|(name, parts)| {
            let sum = g.sum(&parts);
            (name, g.cancel_zero(sum))
        });
        let section: Vec<(String, ExprId)> = summed.collect();
        let zero = g.zero();
        let section: Vec<(String, ExprId)> = section.into_iter().filter(|(_, e)| *e != zero).collect();
        (!section.is_empty()).then(|| ConservedMomentum { section, value: g.sum(&value) })
    }

    /// Momenta whose rate vanishes, independent of each other.
    fn momenta(&mut self, terms: &[Term]) -> Result<Vec<ConservedMomentum>, Error> {
        let columns: Vec<Vec<ExprId>> = terms.iter().map(|term| vec![term.rate]).collect();
        let mut found = Vec::new();
        for relation in rational_relations(self.g, &columns) {
            let used: Vec<usize> = (0..terms.len()).filter(|k| !relation[*k].is_zero()).collect();
            let parts: Vec<ExprId> =
                used.iter().map(|k| self.g.scale(terms[*k].rate, &relation[*k])).collect();
            let rate = self.g.sum(&parts);
            if self.g.vanishing(rate) != Vanishing::Zero {
                continue;
            }
            let weights: Vec<(usize, ExprId)> =
                used.iter().map(|k| (*k, self.g.rational(relation[*k].clone()))).collect();
            found.extend(self.combined(terms, &weights));
        }
        found.extend(self.scaled(terms)?);
        let mut values: Vec<ExprId> = found.iter().map(|m| m.value).collect();
        if let Some(chart) = &self.chart {
            values = chart.whole(self.g, &[], &values)?;
        }
        let gradients = self.gradients(&values)?;
        let kept = independent_rows(self.g, &gradients);
        Ok(kept.into_iter().map(|k| found[k].clone()).collect())
    }

    /// Momenta multiplied by powers of what the equations divide by, `f' J + f J' = 0`; along displacements first.
    fn scaled(&mut self, terms: &[Term]) -> Result<Vec<ConservedMomentum>, Error> {
        let equations = self.equations;
        let KinematicConstraint::Solved(solved) = &equations.system.constraint else { return Ok(Vec::new()) };
        if solved.reactions.names.is_empty() || equations.state.len() > MAX_STATE {
            return Ok(Vec::new());
        }
        let chart = Chart::new(self.g, equations)?;
        let rates: Vec<ExprId> = equations.state.iter().map(|s| s.derivative).collect();
        let rates = chart.whole(self.g, &[], &rates)?;
        let base: BTreeSet<SymbolId> = equations.system.algebroid.base().iter().copied().collect();
        let moving = equations.state.iter().map(|s| s.symbol).zip(rates.iter().copied());
        let (base, fibre): (Vec<_>, Vec<_>) = moving.partition(|(symbol, _)| base.contains(symbol));
        let motion = Motion { base: &base, fibre: &fibre };
        let pivots: Vec<ExprId> = equations.pivots.iter().map(|p| p.expr).collect();
        let pivots = chart.whole(self.g, &[], &pivots)?;
        let functions = candidates(self.g, &motion, &pivots, &rates);
        let by: BTreeMap<SymbolId, ExprId> =
            base.iter().chain(&fibre).copied().chain([(equations.system.time, self.g.one())]).collect();
        let mut found = Vec::new();
        for term in terms.iter().filter(|term| term.is_plain).rev() {
            let value = chart.whole(self.g, &[], &[term.value])?[0];
            let g = &mut *self.g;
            let rate = g.derivative_along(value, &by);
            let rate = g.cancel_zero(rate);
            if rate == g.zero() {
                continue;
            }
            let mut columns = Vec::new();
            for f in &functions {
                let along = g.derivative_along(*f, &by);
                let inverse = g.powi(*f, -1);
                columns.push(vec![g.product(&[along, inverse, value])]);
            }
            let Some(factors) = powers(g, &functions, &columns, &[rate]) else { continue };
            let factors: Vec<(ExprId, Rational)> =
                factors.into_iter().map(|f| (f.base, f.exponent)).collect();
            let Ok(factor) = g.power_product(&factors) else { continue };
            let section = term.section.iter().map(|(name, e)| (name.clone(), g.mul(factor, *e))).collect();
            found.push(ConservedMomentum { section, value: g.mul(factor, term.value) });
        }
        Ok(found)
    }

    fn gradients(&mut self, values: &[ExprId]) -> Result<Vec<Vec<ExprId>>, Error> {
        let g = &mut *self.g;
        let sections = needed_sections(g, &self.equations.sections, values);
        let by: Vec<SymbolId> = self.equations.state.iter().map(|s| s.symbol).collect();
        let linear = Linearisation::new(g, &sections, values, &by);
        let mut writer = SectionWriter::new(g, BTreeSet::new(), &[]);
        let name = |value: &str, input: &str| format!("d_{value}_d_{input}");
        Ok(linear.jacobian(g, &mut writer, name, str::to_owned))
    }

    /// `E - <p, Y>` that is conserved, `Y` being a combination with rational coefficients of the products with numbers
    /// that the change of the energy is proportional to, divided by lengths that are kept.
    fn moving_energy(&mut self, terms: &[Term]) -> Result<Option<ConservedMomentum>, Error> {
        let energy = self.equations.energy;
        let energy_rate = self.rates(&[energy])?[0];
        let lengths = self.lengths()?;
        let speeds = self.speeds();
        let mut factors = speeds.clone();
        for (length, speed) in lengths.iter().flat_map(|length| speeds.iter().map(move |s| (*length, *s))) {
            let inverse = self.g.powi(length, -1);
            factors.push(self.g.mul(speed, inverse));
        }
        let moving: Vec<usize> = (0..terms.len()).filter(|k| !self.g.is_zero(terms[*k].rate)).collect();
        // One after the other, then all together.
        let mut sets: Vec<Vec<ExprId>> = factors.iter().map(|factor| vec![*factor]).collect();
        if factors.len() > 1 && factors.len() * moving.len() <= MAX_COLUMNS {
            sets.push(factors);
        }
        for set in sets {
            let products: Vec<(ExprId, usize)> =
                set.iter().flat_map(|factor| moving.iter().map(|k| (*factor, *k))).collect();
            let mut columns: Vec<Vec<ExprId>> =
                products.iter().map(|(factor, k)| vec![self.g.mul(*factor, terms[*k].rate)]).collect();
            columns.push(vec![energy_rate]);
            let relations = rational_relations(self.g, &columns);
            let Some(relation) = relations.into_iter().find(|c| c.last().is_some_and(One::is_one)) else {
                continue;
            };
            let parts: Vec<ExprId> =
                columns.iter().zip(&relation).map(|(column, c)| self.g.scale(column[0], c)).collect();
            let rate = self.g.sum(&parts);
            if self.g.vanishing(rate) != Vanishing::Zero {
                continue;
            }
            let weights: Vec<(usize, ExprId)> = (products.iter().zip(&relation))
                .filter(|(_, c)| !c.is_zero())
                .map(|((factor, k), c)| (*k, self.g.scale(*factor, &-c.clone())))
                .collect();
            let Some(found) = self.combined(terms, &weights) else { continue };
            let value = self.g.sub(energy, found.value);
            return Ok(Some(ConservedMomentum { value, ..found }));
        }
        Ok(None)
    }

    /// Squares of advected vectors that the motion keeps: sections may be divided by them.
    fn lengths(&mut self) -> Result<Vec<ExprId>, Error> {
        let advected = self.equations.system.blocks.iter().filter(|b| b.kind == BlockKind::Advected);
        let mut lengths = Vec::new();
        for block in advected {
            let squares: Vec<ExprId> = (block.components.iter())
                .map(|s| {
                    let x = self.g.sym(*s);
                    self.g.powi(x, 2)
                })
                .collect();
            lengths.push(self.g.sum(&squares));
        }
        let rates = self.rates(&lengths)?;
        let kept = lengths.into_iter().zip(rates);
        Ok(kept.filter(|(_, rate)| self.g.is_zero(*rate)).map(|(length, _)| length).collect())
    }

    /// Numbers that the change of the energy may be proportional to: one, the slopes of the parts of constraints
    /// without velocities and their factors, frequencies of explicit time.
    fn speeds(&mut self) -> Vec<ExprId> {
        let equations = self.equations;
        let system = &equations.system;
        let velocities: BTreeMap<SymbolId, ExprId> =
            system.velocities.iter().map(|y| (*y, self.g.zero())).collect();
        let residuals: Vec<ExprId> = match &system.constraint {
            KinematicConstraint::Solved(solved) => solved.rows.iter().map(|row| row.offset).collect(),
            KinematicConstraint::Multipliers { rows, .. } => (rows.iter())
                .filter_map(|row| match row.source {
                    AccelerationSource::Differentiated(residual) => Some(residual),
                    AccelerationSource::Servo(_) => None,
                })
                .collect(),
        };
        let mut numbers = Vec::new();
        for residual in residuals {
            let Ok(offset) = self.g.subs(residual, &velocities) else { continue };
            numbers.push(offset);
            let base = system.algebroid.base();
            let slopes: Vec<ExprId> = base.iter().map(|x| self.g.diff(offset, *x)).collect();
            numbers.extend(slopes);
        }
        let definitions = equations.sections.iter().flat_map(|s| &s.definitions).map(|d| d.expr);
        let rates = equations.state.iter().map(|s| s.derivative);
        let all: Vec<ExprId> = definitions.chain(rates).collect();
        for e in self.g.reachable(&all) {
            if let Node::Function(Func::Sin | Func::Cos, inside) = *self.g.node(e) {
                numbers.push(self.g.diff(inside, system.time));
            }
        }
        let mut speeds = vec![self.g.one()];
        let zero = self.g.zero();
        for number in numbers {
            if number == zero || !equations.is_parameter_only_in(self.g, number) {
                continue;
            }
            let factors: Vec<ExprId> = match self.g.node(number) {
                Node::Product { factors, .. } => {
                    let positive = factors.iter().filter(|(_, q)| q.is_positive());
                    positive.map(|(base, _)| *base).collect()
                }
                _ => Vec::new(),
            };
            // Up to a rational factor, which a relation finds.
            let scale = self.coefficient(number);
            let number = self.g.scale(number, &scale.recip());
            for speed in factors.into_iter().chain([number]) {
                if !speeds.contains(&speed) {
                    speeds.push(speed);
                }
            }
        }
        speeds
    }

    /// The rational factor of a product.
    fn coefficient(&self, e: ExprId) -> Rational {
        match self.g.node(e) {
            Node::Product { coefficient, .. } => coefficient.clone(),
            Node::Constant(q) if !q.is_zero() => q.clone(),
            _ => Rational::one(),
        }
    }
}
