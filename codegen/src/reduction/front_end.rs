//! From the checked model to the one value that the derivation consumes.

use std::collections::{BTreeMap, BTreeSet};

use crate::algebra::Algebroid;
use crate::error::Error;
use crate::expr::{ExprId, Graph, Rational, SymbolId};
use crate::spec::{self, Condition, Diagnostics, Model, Named, NamedVector, Param, Relation, Side};

use super::constraint::{ConstraintRow, KinematicConstraint, Sign, Solver};
use super::stages::Stages;

/// What a state variable is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StateKind {
    /// Base coordinate `x^i` of the algebroid (a shape coordinate or a component of an advected parameter).
    Base(usize),
    /// Velocity `y^alpha` that is independent, or all of them in the multiplier form.
    Velocity(usize),
}

/// A system on a Lie algebroid: everything the derivation needs and nothing about where it came from.
///
/// # Shapes
/// `n` base coordinates, `m` velocities; `forces`: `[m]`; `state`: order `[shape coordinates, velocities, advected]`.
#[derive(Clone, Debug)]
pub struct ReducedSystem {
    /// Owner of all expressions.
    pub graph: Graph,
    /// Name of the model.
    pub name: String,
    /// Title first.
    pub doc: Vec<String>,
    /// Where the model comes from.
    pub sources: Vec<String>,
    /// Explicit time.
    pub time: SymbolId,
    /// Parameters that are not fixed.
    pub params: Vec<Param>,
    /// Conditions on them.
    pub conditions: Vec<Condition>,
    /// Anchor and bracket in the frame of the velocities.
    pub algebroid: Algebroid,
    /// Symbols of the velocities `y^alpha`, in frame order.
    pub velocities: Vec<SymbolId>,
    /// `L(x, y, t)`.
    pub lagrangian: ExprId,
    /// External force `F_alpha`.
    pub forces: Vec<ExprId>,
    /// `Psi`, `psi0`, `W`, or multipliers.
    pub constraint: KinematicConstraint,
    /// State variables in order, with their documentation.
    pub state: Vec<(StateKind, String)>,
    /// Casimirs claimed by the model.
    pub casimirs: Vec<Named>,
    /// Outputs of the model.
    pub outputs: Vec<NamedVector>,
    /// Stage decomposition of the symmetry algebra, when asked for.
    pub stages: Option<Stages>,
    /// Known signs of expressions, from the conditions and domains.
    pub signs: BTreeMap<ExprId, Sign>,
}

/// Reduces a model, with some parameters fixed to numbers.
///
/// Left action: `C` are the structure constants and advected parameters obey `adot = -xi . a`. Right action: the sign of
/// every structure constant changes and `adot = xi . a`.
///
/// # Errors
/// Everything inconsistent that is found, at the spans of the model's text.
pub fn reduce(model: &Model, fixed: &[(String, Rational)]) -> Result<ReducedSystem, Diagnostics> {
    let mut front_end = FrontEnd { model: model.clone(), problems: Vec::new() };
    let reduced = front_end.run(fixed);
    match reduced {
        Some(system) if front_end.problems.is_empty() => Ok(system),
        _ => Err(model.diagnostics(front_end.problems)),
    }
}

struct FrontEnd {
    model: Model,
    problems: Vec<spec::Diagnostic>,
}

impl FrontEnd {
    fn report(&mut self, error: &Error, span: Option<spec::Span>) {
        let help = match error {
            Error::NotAffine { .. } => "write the constraint linear in the velocities",
            Error::AnchorViolated { .. } => "the action has to be an infinitesimal action of the algebra",
            _ => "",
        };
        self.problems.push(spec::diagnose(&self.model, span, error.to_string(), help));
    }

    fn run(&mut self, fixed: &[(String, Rational)]) -> Option<ReducedSystem> {
        self.fix_parameters(fixed)?;
        let algebroid = self.algebroid();
        let stages = self.stages();
        let signs = self.signs();
        let constraint = self.constraint(&signs)?;
        let model = &self.model;
        let velocities: Vec<SymbolId> = model.all_velocities().into_iter().map(|(_, s)| s).collect();
        let state = state_order(model, &constraint);
        Some(ReducedSystem {
            graph: model.graph.clone(),
            name: model.name.clone(),
            doc: model.doc.clone(),
            sources: model.sources.clone(),
            time: model.time,
            params: model.params.clone(),
            conditions: model.conditions.clone(),
            algebroid: algebroid?,
            velocities,
            lagrangian: model.lagrangian,
            forces: model.forces.clone(),
            constraint,
            state,
            casimirs: model.casimirs.clone(),
            outputs: model.outputs.clone(),
            stages: stages?,
            signs,
        })
    }

    /// Replaces fixed parameters by their values everywhere and drops conditions that have become true.
    fn fix_parameters(&mut self, fixed: &[(String, Rational)]) -> Option<()> {
        let model = &mut self.model;
        let mut values = BTreeMap::new();
        let mut unknown = Vec::new();
        for (name, value) in fixed {
            match model.params.iter().position(|p| p.name == *name) {
                Some(k) => {
                    let symbol = model.params.remove(k).symbol;
                    values.insert(symbol, model.graph.rational(value.clone()));
                }
                None => unknown.push(name.clone()),
            }
        }
        let known: Vec<String> = model.params.iter().map(|p| p.name.clone()).collect();
        for name in unknown {
            self.report(&Error::UnknownName { name, kind: "parameter", known: known.clone() }, None);
        }
        if !self.problems.is_empty() {
            return None;
        }
        if !values.is_empty() && self.substitute(&values).is_none() {
            self.report(&Error::DivisionByZero { place: "the fixed parameters".into() }, None);
            return None;
        }
        self.settle_conditions()
    }

    fn substitute(&mut self, values: &BTreeMap<SymbolId, ExprId>) -> Option<()> {
        let Model {
            graph,
            lagrangian,
            conditions,
            stages,
            advected,
            constraints,
            forces,
            casimirs,
            outputs,
            ..
        } = &mut self.model;
        let mut places: Vec<&mut ExprId> = vec![lagrangian];
        places.extend(forces.iter_mut());
        places.extend(conditions.iter_mut().flat_map(|c| [&mut c.greater, &mut c.less]));
        places.extend(advected.iter_mut().flat_map(|a| a.action.iter_mut()));
        places.extend(constraints.iter_mut().map(|c| &mut c.residual));
        places.extend(casimirs.iter_mut().map(|c| &mut c.expr));
        places.extend(outputs.iter_mut().flat_map(|o| o.components.iter_mut().map(|(_, e)| e)));
        let metric = stages.iter_mut().filter_map(|s| s.inner_product.as_mut());
        places.extend(metric.flat_map(|rows| rows.iter_mut().flatten()));
        for place in places {
            *place = graph.subs(*place, values).ok()?;
        }
        Some(())
    }

    fn settle_conditions(&mut self) -> Option<()> {
        let model = &mut self.model;
        let mut broken = Vec::new();
        let graph = &mut model.graph;
        model.conditions.retain(|c| {
            let difference = graph.sub(c.greater, c.less);
            let Some(value) = graph.as_rational(difference) else { return true };
            let zero = Rational::from_integer(0.into());
            let holds = match c.relation {
                Relation::Greater => *value > zero,
                Relation::GreaterEqual => *value >= zero,
                Relation::NotEqual => *value != zero,
            };
            if !holds {
                broken.push(c.clone());
            }
            false
        });
        let fine = broken.is_empty();
        for c in broken {
            let message = format!("fixed parameters violate the condition {}", c.text);
            self.problems.push(spec::diagnose(&self.model, c.span, message, "fix them to other values"));
        }
        fine.then_some(())
    }

    /// Frame `(d/dx^i, e_a)` over the coordinates `(x^i, advected)`: trivial connection on the shape space, anchor of the
    /// algebra from its action on the advected parameters.
    fn algebroid(&mut self) -> Option<Algebroid> {
        let model = &mut self.model;
        let n_shape = model.base.len();
        let shape = model.base.iter().map(|c| c.symbol);
        let advected = model.advected.iter().flat_map(|a| a.components.iter().map(|(_, s)| *s));
        let base: Vec<SymbolId> = shape.chain(advected).collect();
        let frame: Vec<String> = model.all_velocities().into_iter().map(|(n, _)| n.to_owned()).collect();
        let g = &mut model.graph;
        let mut algebroid = Algebroid::new(g, base, frame);
        for i in 0..n_shape {
            algebroid.set_anchor(i, i, g.one());
        }
        let side = match model.action {
            Side::Left => Rational::from_integer(1.into()),
            Side::Right => Rational::from_integer((-1).into()),
        };
        for (a, b, value) in model.algebra.brackets() {
            let value = value.iter().map(|(c, q)| (n_shape + c, g.rational(q * &side))).collect();
            algebroid.set_bracket(n_shape + a, n_shape + b, value);
        }
        let mut component = n_shape;
        let mut problems = Vec::new();
        for advected in &model.advected {
            let first = component;
            for &action in &advected.action {
                for (a, velocity) in model.velocities.iter().enumerate() {
                    let slope = g.diff(action, velocity.symbol);
                    let value = g.scale(slope, &-side.clone());
                    algebroid.set_anchor(component, n_shape + a, value);
                }
                component += 1;
            }
            problems.push((first..component, advected.span));
        }
        if let Err(errors) = algebroid.verify(g) {
            for error in errors {
                let span = match &error {
                    Error::AnchorViolated { component, .. } => {
                        let at = algebroid.base().iter().position(|s| self.model.graph.name(*s) == component);
                        problems.iter().find(|(r, _)| at.is_some_and(|k| r.contains(&k))).and_then(|p| p.1)
                    }
                    _ => None,
                };
                self.report(&error, span);
            }
            return None;
        }
        Some(algebroid)
    }

    fn stages(&mut self) -> Option<Option<Stages>> {
        let Some(chain) = self.model.stages.clone() else { return Some(None) };
        let model = &mut self.model;
        let inner = chain.inner_product.as_deref();
        match Stages::split(&mut model.graph, &model.algebra, &chain.names, &chain.ideals, inner) {
            Ok(stages) => Some(Some(stages)),
            Err(errors) => {
                for error in errors {
                    let stage = match &error {
                        Error::NotNested { stage, .. }
                        | Error::NotAnIdeal { stage, .. }
                        | Error::EmptyStage { stage }
                        | Error::DegenerateInnerProduct { stage } => {
                            chain.names.iter().position(|n| n == stage)
                        }
                        _ => None,
                    };
                    let span = stage.and_then(|k| chain.spans.get(k).copied().flatten());
                    self.report(&error, span);
                }
                None
            }
        }
    }

    /// What the conditions on parameters and the domains of coordinates say about signs.
    fn signs(&mut self) -> BTreeMap<ExprId, Sign> {
        let model = &mut self.model;
        let g = &mut model.graph;
        let mut signs = BTreeMap::new();
        for c in &model.conditions {
            let sign = match c.relation {
                Relation::Greater => Sign::Positive,
                Relation::GreaterEqual => Sign::NonNegative,
                Relation::NotEqual => continue,
            };
            let difference = g.sub(c.greater, c.less);
            signs.insert(difference, sign);
            // x > q with q >= 0 bounds x itself as well.
            let bound = g.as_rational(c.less).is_some_and(|q| *q >= Rational::from_integer(0.into()));
            if bound {
                signs.insert(c.greater, sign);
            }
        }
        for coordinate in &model.base {
            if let spec::Domain::Interval(low, high) = coordinate.domain {
                let x = g.sym(coordinate.symbol);
                let (above, below) = (g.sub(x, low), g.sub(high, x));
                signs.insert(above, Sign::Positive);
                signs.insert(below, Sign::Positive);
            }
        }
        signs
    }

    fn constraint(&mut self, signs: &BTreeMap<ExprId, Sign>) -> Option<KinematicConstraint> {
        let mut rows = Vec::new();
        let names: Vec<String> = self.model.all_velocities().into_iter().map(|(n, _)| n.to_owned()).collect();
        let symbols: Vec<SymbolId> = self.model.all_velocities().into_iter().map(|(_, s)| s).collect();
        for c in self.model.constraints.clone() {
            match self.model.graph.affine_parts(c.residual, &symbols) {
                Some((one_form, offset)) => {
                    rows.push(ConstraintRow { name: c.name, text: c.text, one_form, offset });
                }
                None => self.report(&Error::NotAffine { constraint: c.text }, c.span),
            }
        }
        if !self.problems.is_empty() {
            return None;
        }
        let params: BTreeSet<SymbolId> = self.model.params.iter().map(|p| p.symbol).collect();
        let keep_all = self.model.force_multipliers && !rows.is_empty();
        let wanted = self.model.independent.clone().filter(|_| !keep_all);
        let mut solver =
            Solver { graph: &mut self.model.graph, names: &names, params: &params, facts: signs };
        // Solving also detects dependent and inconsistent rows, so it runs even when multipliers are asked for.
        match solver.solve(rows.clone(), wanted.as_deref()) {
            Ok(_) if keep_all => Some(KinematicConstraint::Multipliers(rows)),
            Ok(constraint) => Some(constraint),
            Err(error) => {
                let span = match &error {
                    Error::DependentConstraint { constraint }
                    | Error::InconsistentConstraint { constraint } => {
                        self.model.constraints.iter().find(|c| c.text == *constraint).and_then(|c| c.span)
                    }
                    _ => self.model.constraints.first().and_then(|c| c.span),
                };
                self.report(&error, span);
                None
            }
        }
    }
}

fn state_order(model: &Model, constraint: &KinematicConstraint) -> Vec<(StateKind, String)> {
    let n_shape = model.base.len();
    let velocity_doc = |k: usize| {
        if k < n_shape {
            format!("velocity of {}", model.base[k].name)
        } else {
            model.velocities[k - n_shape].doc.clone()
        }
    };
    let kept: Vec<usize> = match constraint {
        KinematicConstraint::Solved(s) => s.independent.clone(),
        KinematicConstraint::Multipliers(_) => (0..n_shape + model.velocities.len()).collect(),
    };
    let shape = model.base.iter().enumerate().map(|(i, c)| (StateKind::Base(i), c.doc.clone()));
    let velocities = kept.into_iter().map(|k| (StateKind::Velocity(k), velocity_doc(k)));
    let advected = model
        .advected
        .iter()
        .flat_map(|a| std::iter::repeat_n(a.doc.clone(), a.components.len()))
        .enumerate()
        .map(|(i, doc)| (StateKind::Base(n_shape + i), doc));
    shape.chain(velocities).chain(advected).collect()
}
