//! From the checked model to the one value that the derivation consumes.

use std::collections::{BTreeMap, BTreeSet};

use crate::algebra::Algebroid;
use crate::error::Error;
use crate::expr::{ExprId, Func, Graph, Rational, Sign, Stage, Style, SymbolId};
use crate::spec::{
    self, Condition, ConstraintKind, Diagnostics, Model, Named, NamedVector, Param, ReconstructionKind,
    Relation, Side,
};

use super::circle::Circle;
use super::connection::with_connection;
use super::constraint::{
    AccelerationRow, AccelerationSource, ConstraintRow, KinematicConstraint, Reactions, SolvedConstraint,
    Solver, Unknown,
};
use super::reconstruction::{self, MomentumInSpace, ReconstructedCoordinate};
use super::stages::Stages;

/// What a state variable is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StateKind {
    /// Base coordinate `x^i` of the algebroid (a shape coordinate or a component of an advected parameter).
    Base(usize),
    /// An unknown `u` of the equations of motion, by its place in [`ReducedSystem::unknowns`].
    Unknown(usize),
}

/// A condition that a base coordinate satisfies where the equations hold.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DomainCondition {
    /// As people write it, such as `theta < pi/2`.
    pub text: String,
    /// Positive inside of the domain, and only there.
    pub positive: ExprId,
}

/// The end of an interval as people write it: `3*pi/2`, not `3/2*pi`.
pub(super) fn spell_end(g: &mut Graph, end: ExprId) -> String {
    let (q, _) = g.split_coefficient(end);
    let whole = g.scale(end, &Rational::from(q.denom().clone()));
    let text = g.display(whole, Style::Plain);
    if q.is_integer() || text.contains(' ') {
        g.display(end, Style::Plain)
    } else {
        format!("{text}/{}", q.denom())
    }
}

/// Advected parameters, then quaternions under what their components' names have in common.
fn vectors(model: &Model) -> Vec<(String, Vec<SymbolId>)> {
    let advected =
        model.advected.iter().map(|a| (a.name.clone(), a.components.iter().map(|(_, s)| *s).collect()));
    let quaternions = model.reconstruction.iter().filter(|item| {
        matches!(item.kind, ReconstructionKind::Quaternion { .. } | ReconstructionKind::Pose { .. })
    });
    advected
        .chain(quaternions.map(|item| {
            let first = item.names.first().map_or("q", String::as_str);
            let shared = |n: &usize| item.names[..4].iter().all(|name| name.starts_with(&first[..*n]));
            let n = (1..=first.len()).rev().find(shared).unwrap_or(first.len());
            (first[..n].to_owned(), item.symbols[..4].to_vec())
        }))
        .collect()
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
    /// Side of the group action.
    pub side: Side,
    /// `A^a_i(x)` by element of the algebra and shape coordinate, `v = xi + A(x) xdot`; absent where `v = xi`.
    pub connection: Option<Vec<Vec<ExprId>>>,
    /// `L(x, y, t)`.
    pub lagrangian: ExprId,
    /// External force `F_alpha`.
    pub forces: Vec<ExprId>,
    /// `Psi`, `psi0`, `W`, or multipliers.
    pub constraint: KinematicConstraint,
    /// The velocities that the state carries: independent ones and quasi-velocities, or all in the multiplier form.
    pub unknowns: Vec<Unknown>,
    /// State variables in order, with their documentation.
    pub state: Vec<(StateKind, String)>,
    /// Casimirs claimed by the model.
    pub casimirs: Vec<Named>,
    /// Outputs of the model.
    pub outputs: Vec<NamedVector>,
    /// Coordinates of the group, which only scenes that ask for them carry.
    pub reconstruction: Vec<ReconstructedCoordinate>,
    /// Momenta in space, by the coordinates of the group.
    pub momenta_in_space: Vec<MomentumInSpace>,
    /// Names and components of advected parameters and quaternions.
    pub vectors: Vec<(String, Vec<SymbolId>)>,
    /// Stage decomposition of the symmetry algebra, when asked for.
    pub stages: Option<Stages>,
    /// Known signs of expressions, from the conditions and domains.
    pub signs: BTreeMap<ExprId, Sign>,
    /// What confines the base coordinates to their intervals.
    pub domains: Vec<DomainCondition>,
    /// Angles that the base carries as points of the circle.
    pub circles: Vec<Circle>,
}

impl ReducedSystem {
    /// The group velocity `xi^a = v^a - A^a_i xdot^i`, by the velocities of the system, `n_shape` of them along the shape.
    pub(crate) fn group_velocity(&self, g: &mut Graph, n_shape: usize) -> Vec<ExprId> {
        let y: Vec<ExprId> = self.velocities.iter().map(|s| g.sym(*s)).collect();
        let (shape, fibre) = y.split_at(n_shape);
        let Some(connection) = &self.connection else { return fibre.to_vec() };
        let components = fibre.iter().zip(connection).map(|(v, row)| {
            let along: Vec<ExprId> = row.iter().zip(shape).map(|(a, rate)| g.mul(*a, *rate)).collect();
            let along = g.sum(&along);
            g.sub(*v, along)
        });
        components.collect()
    }
}

/// Reduces a model, with some parameters fixed to numbers.
///
/// Left action: `C` are the structure constants and advected parameters obey `adot = -xi . a`. Right action: the sign of
/// every structure constant changes and `adot = xi . a`.
///
/// # Errors
/// Everything inconsistent that is found, at the spans of the model's text.
pub fn reduce(model: &Model, fixed: &[(String, Rational)]) -> Result<ReducedSystem, Diagnostics> {
    if let Some(kind) = model.derived_connection {
        let written_with_xi = Model { derived_connection: None, ..model.clone() };
        return reduce(&with_connection(&written_with_xi, kind)?, fixed);
    }
    let mut front_end = FrontEnd { model: model.clone(), problems: Vec::new() };
    front_end.model.graph.enter(Stage::Reduction);
    let reduced = front_end.run(fixed);
    if let Err(exhausted) = front_end.model.graph.within_budget() {
        return Err(model.diagnostics(vec![model.diagnose(&exhausted.into())]));
    }
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
    fn report(&mut self, error: &Error) {
        self.problems.push(self.model.diagnose(error));
    }

    fn run(&mut self, fixed: &[(String, Rational)]) -> Option<ReducedSystem> {
        self.fix_parameters(fixed)?;
        let algebroid = self.algebroid();
        let stages = self.stages();
        let signs = signs(&mut self.model);
        let domains = self.domains();
        let constraint = self.constraint(&signs)?;
        let model = &self.model;
        let velocities: Vec<SymbolId> = model.all_velocities().into_iter().map(|(_, s)| s).collect();
        let unknowns = match &constraint {
            KinematicConstraint::Solved(solved) => solved.unknowns.clone(),
            KinematicConstraint::Multipliers { .. } => frame_unknowns(model),
        };
        let state = state_order(model, &unknowns);
        let model = &mut self.model;
        let (graph, side) = (&mut model.graph, model.action);
        let reconstruction =
            model.reconstruction.iter().flat_map(|item| reconstruction::rates(graph, item, side)).collect();
        let algebra = model.base.len()..velocities.len();
        let turned = |item| reconstruction::momenta_in_space(graph, item, side, algebra.clone());
        let momenta_in_space = model.reconstruction.iter().flat_map(turned).collect();
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
            side,
            connection: model.connection.clone(),
            lagrangian: model.lagrangian,
            forces: model.forces.clone(),
            constraint,
            unknowns,
            state,
            casimirs: model.casimirs.clone(),
            outputs: model.outputs.clone(),
            reconstruction,
            momenta_in_space,
            vectors: vectors(model),
            stages: stages?,
            signs,
            domains,
            circles: Vec::new(),
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
            self.report(&Error::UnknownName { name, kind: "parameter", known: known.clone() });
        }
        if !self.problems.is_empty() {
            return None;
        }
        if !values.is_empty() && self.substitute(&values).is_none() {
            let (message, _) =
                Error::DivisionByZero { place: "the fixed parameters".into() }.message_and_help();
            let help = "a denominator of the model vanishes at these values";
            self.problems.push(spec::diagnose(&self.model, None, message, help));
            return None;
        }
        self.settle_conditions()
    }

    fn substitute(&mut self, values: &BTreeMap<SymbolId, ExprId>) -> Option<()> {
        let Model {
            graph,
            base,
            lagrangian,
            conditions,
            stages,
            advected,
            connection,
            constraints,
            virtual_constraints,
            forces,
            casimirs,
            outputs,
            reconstruction: group_items,
            ..
        } = &mut self.model;
        let mut places: Vec<&mut ExprId> = vec![lagrangian];
        places.extend(forces.iter_mut());
        places.extend(base.iter_mut().flat_map(|c| c.domain.ends_mut()));
        places.extend(conditions.iter_mut().flat_map(|c| [&mut c.greater, &mut c.less]));
        places.extend(advected.iter_mut().flat_map(|a| a.action.iter_mut()));
        places.extend(connection.iter_mut().flatten().flatten());
        for c in constraints {
            places.push(&mut c.residual);
            if let ConstraintKind::SecondOrder { acceleration } = &mut c.kind {
                places.extend(acceleration);
            }
        }
        places.extend(virtual_constraints.iter_mut().flat_map(|v| v.one_form.iter_mut()));
        places.extend(group_items.iter_mut().flat_map(|r| reconstruction::expressions_mut(&mut r.kind)));
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

    /// Frame `(D_i, e_a)` over the coordinates `(x^i, advected)`, `D_i` the horizontal lift of `d/dx^i` for the connection
    /// `A` (zero unless given): `[D_i, D_j] = -B^a_ij e_a`, `[D_i, e_b] = -[A_i, e_b]`, `[e_a, e_b] = C^c_ab e_c`,
    /// `B^a_ij = d_i A^a_j - d_j A^a_i - C^a_bc A^b_i A^c_j`; every `C` changes sign for a right action. A connection that
    /// depends on time has `[d/dt, D_i] = -dA^a_i/dt e_a`. The algebra is anchored by its action on the advected parameters
    /// and `D_i = d_i - A^a_i e_a` there.
    ///
    /// # Source
    /// Cendra, Marsden, Ratiu 2001, section 3; Cortes, de Leon, Marrero, Martinez 2009, section 2.
    fn algebroid(&mut self) -> Option<Algebroid> {
        let model = &mut self.model;
        let n_shape = model.base.len();
        let shape: Vec<SymbolId> = model.base.iter().map(|c| c.symbol).collect();
        let advected = model.advected.iter().flat_map(|a| a.components.iter().map(|(_, s)| *s));
        let base: Vec<SymbolId> = shape.iter().copied().chain(advected).collect();
        let frame: Vec<String> = model.all_velocities().into_iter().map(|(n, _)| n.to_owned()).collect();
        let g = &mut model.graph;
        let mut algebroid = Algebroid::new(g, model.time, base, frame);
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
        if let Some(connection) = &model.connection {
            set_connection_brackets(g, &mut algebroid, &shape, connection);
            set_connection_drift(g, &mut algebroid, model.time, connection);
        }
        let mut component = n_shape;
        for advected in &model.advected {
            for &action in &advected.action {
                for (a, velocity) in model.velocities.iter().enumerate() {
                    let slope = g.diff(action, velocity.symbol);
                    let value = g.scale(slope, &-side.clone());
                    algebroid.set_anchor(component, n_shape + a, value);
                }
                for i in 0..n_shape {
                    let Some(connection) = &model.connection else { break };
                    let terms: Vec<ExprId> = (0..model.velocities.len())
                        .map(|a| g.mul(connection[a][i], algebroid.anchor(component, n_shape + a)))
                        .collect();
                    let sum = g.sum(&terms);
                    let value = g.neg(sum);
                    algebroid.set_anchor(component, i, value);
                }
                component += 1;
            }
        }
        if let Err(errors) = algebroid.verify(g) {
            for error in errors {
                self.report(&error);
            }
            // One wrong sign breaks most pairs: the first says it all.
            let mut seen = BTreeSet::new();
            self.problems.retain(|problem| problem.span.is_none() || seen.insert(problem.span));
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
                errors.iter().for_each(|error| self.report(error));
                None
            }
        }
    }

    /// `low < x` and `x < high` for the coordinates that live in intervals.
    fn domains(&mut self) -> Vec<DomainCondition> {
        let Model { graph: g, base, .. } = &mut self.model;
        let mut conditions = Vec::new();
        for coordinate in base {
            let spec::Domain::Interval(low, high) = coordinate.domain else { continue };
            let (x, name) = (g.sym(coordinate.symbol), &coordinate.name);
            for (relation, end, sign) in [(">", low, 1), ("<", high, -1)] {
                // A fraction of pi would be computed at run time.
                let times = Rational::from(g.split_coefficient(end).0.denom().clone())
                    * Rational::from_integer(sign.into());
                let positive = g.linear_combination(&[(x, times.clone()), (end, -times)]);
                conditions.push(DomainCondition {
                    text: format!("{name} {relation} {}", spell_end(g, end)),
                    positive,
                });
            }
        }
        conditions
    }

    fn constraint(&mut self, signs: &BTreeMap<ExprId, Sign>) -> Option<KinematicConstraint> {
        let model = &mut self.model;
        let frame = frame_unknowns(model);
        let quasi = quasi_unknowns(model);
        let names: Vec<String> = frame.iter().map(|u| u.name.clone()).collect();
        let params: BTreeSet<SymbolId> = model.params.iter().map(|p| p.symbol).collect();
        let (linear, general) = constraint_rows(model);
        let displacements = displacement_rows(model);
        let all_linear = linear.len() == general.len();
        let keep_all = (model.force_multipliers && !general.is_empty()) || !all_linear;
        let wanted = model.independent.clone().filter(|_| !keep_all);
        let g = &mut model.graph;
        let mut solver = Solver { graph: g, names: &names, quasi: &quasi, params: &params, facts: signs };
        // Solving also detects dependent and inconsistent rows, so it runs even when multipliers are asked for.
        let solved = match solver.solve(&linear, wanted.as_deref()) {
            Ok(solved) => solved.filter(|_| !keep_all),
            Err(error) => return self.refuse(&error),
        };
        solver.quasi = &[];
        let allowed = match solver.solve(&displacements, None) {
            Ok(allowed) => allowed,
            Err(error) => return self.refuse(&error),
        };
        if !displacements.is_empty() {
            // As many as the motion has constraints; quasi-velocities may be more than those leave.
            let n_unknowns = solved.as_ref().map(|s| s.psi.first().map_or(0, Vec::len));
            let expected = n_unknowns.map_or(general.len(), |n| names.len().saturating_sub(n));
            if displacements.len() != expected {
                let found = displacements.len();
                return self.refuse(&Error::WrongNumberOfDisplacements { found, expected });
            }
        }
        let (Some(solved), Some(allowed)) = (solved, allowed) else {
            return self.multiplier_form(general, &displacements, !quasi.is_empty());
        };
        let unknowns: Vec<Unknown> = frame
            .iter()
            .enumerate()
            .filter(|(k, _)| !solved.dependent.contains(k))
            .map(|(_, u)| u)
            .chain(&quasi)
            .cloned()
            .collect();
        let mut pivots = solved.pivots;
        let (virtual_displacements, reactions) = if displacements.is_empty() {
            let reactions = Reactions {
                names: linear.iter().map(|r| r.name.clone()).collect(),
                one_forms: linear.iter().map(|r| r.one_form[..names.len()].to_vec()).collect(),
                on: solved.dependent.clone(),
            };
            (solved.psi.clone(), reactions)
        } else {
            pivots.extend(allowed.pivots);
            let reactions = Reactions {
                names: displacements.iter().map(|r| r.name.clone()).collect(),
                one_forms: displacements.into_iter().map(|r| r.one_form).collect(),
                on: allowed.dependent,
            };
            (allowed.psi, reactions)
        };
        Some(KinematicConstraint::Solved(SolvedConstraint {
            unknowns,
            dependent: solved.dependent,
            psi: solved.psi,
            psi0: solved.psi0,
            virtual_displacements,
            reactions,
            rows: linear,
            pivots,
        }))
    }

    fn multiplier_form(
        &mut self,
        rows: Vec<AccelerationRow>,
        displacements: &[ConstraintRow],
        has_quasi_velocities: bool,
    ) -> Option<KinematicConstraint> {
        if has_quasi_velocities {
            return self.refuse(&Error::Unsupported {
                what: "a quasi-velocity beside constraints that need multipliers".into(),
                possible: "constraints linear in the velocities that can be solved for the others".into(),
            });
        }
        // Chetaev's rule: without a space of displacements of their own, they are the kernel of the one-forms.
        let reactions = if displacements.is_empty() {
            rows.iter().map(|r| r.one_form.clone()).collect()
        } else {
            displacements.iter().map(|r| r.one_form.clone()).collect()
        };
        Some(KinematicConstraint::Multipliers { rows, reactions })
    }

    /// Reports a problem of the constraints.
    fn refuse(&mut self, error: &Error) -> Option<KinematicConstraint> {
        let first = self.model.constraints.first().and_then(|c| c.span);
        let mut problem = self.model.diagnose(error);
        problem.span = problem.span.or(first);
        self.problems.push(problem);
        None
    }
}

/// The constraints as affine forms on frame velocities and quasi-velocities, where they are, and all of them as conditions on
/// accelerations.
fn constraint_rows(model: &mut Model) -> (Vec<ConstraintRow>, Vec<AccelerationRow>) {
    let frame = frame_unknowns(model);
    let columns: Vec<SymbolId> = frame.iter().chain(&quasi_unknowns(model)).map(|u| u.symbol).collect();
    let mut linear = Vec::new();
    let mut general = Vec::new();
    for c in &model.constraints {
        let g = &mut model.graph;
        let parts = match c.kind {
            ConstraintKind::Linear => g.affine_parts(c.residual, &columns),
            ConstraintKind::Nonlinear | ConstraintKind::SecondOrder { .. } => None,
        };
        let (name, text) = (c.name.clone(), c.text.clone());
        let (one_form, source) = match (&c.kind, parts) {
            (_, Some((one_form, offset))) => {
                let row = ConstraintRow { name: name.clone(), text: text.clone(), one_form, offset };
                let on_frame = row.one_form[..frame.len()].to_vec();
                linear.push(row);
                (on_frame, AccelerationSource::Differentiated(c.residual))
            }
            (ConstraintKind::SecondOrder { acceleration }, _) => {
                (acceleration.clone(), AccelerationSource::Servo(c.residual))
            }
            _ => {
                let slopes = frame.iter().map(|u| g.diff(c.residual, u.symbol)).collect();
                (slopes, AccelerationSource::Differentiated(c.residual))
            }
        };
        general.push(AccelerationRow { name, text, one_form, source });
    }
    (linear, general)
}

/// The conditions on virtual displacements that the model gives, as forms on frame velocities.
fn displacement_rows(model: &Model) -> Vec<ConstraintRow> {
    let offset = model.graph.zero();
    let conditions = model.virtual_constraints.iter();
    conditions
        .map(|v| ConstraintRow {
            name: v.name.clone(),
            text: v.text.clone(),
            one_form: v.one_form.clone(),
            offset,
        })
        .collect()
}

/// Forms on frame velocities and quasi-velocities that vanish on virtual displacements: the conditions on these where the
/// model gives any, else the constraints by Chetaev's rule.
pub(super) fn annihilator(model: &mut Model) -> Vec<ConstraintRow> {
    let mut rows = displacement_rows(model);
    if rows.is_empty() {
        let (linear, general) = constraint_rows(model);
        let offset = model.graph.zero();
        rows = match linear.len() == general.len() {
            true => linear.into_iter().map(|row| ConstraintRow { offset, ..row }).collect(),
            false => general
                .into_iter()
                .map(|AccelerationRow { name, text, one_form, .. }| ConstraintRow {
                    name,
                    text,
                    one_form,
                    offset,
                })
                .collect(),
        };
    }
    let width = model.all_velocities().len() + model.quasi_velocities.len();
    let zero = model.graph.zero();
    rows.iter_mut().for_each(|row| row.one_form.resize(width, zero));
    rows
}

/// `[D_i, D_j] = -B^a_ij e_a` and `[D_i, e_b] = -[A_i, e_b]`, with the bracket of the `e_a` already in place.
fn set_connection_brackets(
    g: &mut Graph,
    algebroid: &mut Algebroid,
    shape: &[SymbolId],
    connection: &[Vec<ExprId>],
) {
    let n = shape.len();
    let dim = connection.len();
    // [A_i, e_b] as a vector
    let bracket_with = |g: &mut Graph, algebroid: &Algebroid, i: usize, b: usize| -> Vec<ExprId> {
        let mut terms: Vec<Vec<ExprId>> = vec![Vec::new(); dim];
        for (a, row) in connection.iter().enumerate() {
            for (c, value) in algebroid.bracket(g, n + a, n + b) {
                terms[c - n].push(g.mul(row[i], value));
            }
        }
        terms.iter().map(|list| g.sum(list)).collect()
    };
    let sparse = |g: &mut Graph, vector: Vec<ExprId>| -> Vec<(usize, ExprId)> {
        let reduced: Vec<ExprId> = vector.into_iter().map(|e| g.cancel_zero(e)).collect();
        reduced.into_iter().enumerate().filter(|(_, e)| *e != g.zero()).map(|(a, e)| (n + a, e)).collect()
    };
    for i in 0..n {
        for j in i + 1..n {
            // -B = -(d_i A_j - d_j A_i) + [A_i, A_j]
            let mut value = Vec::new();
            for row in connection {
                let (forward, backward) = (g.diff(row[j], shape[i]), g.diff(row[i], shape[j]));
                value.push(g.sub(backward, forward));
            }
            for (b, row) in connection.iter().enumerate() {
                for (a, e) in bracket_with(g, algebroid, i, b).into_iter().enumerate() {
                    let term = g.mul(e, row[j]);
                    value[a] = g.add(value[a], term);
                }
            }
            let value = sparse(g, value);
            algebroid.set_bracket(i, j, value);
        }
        for b in 0..dim {
            let bracket = bracket_with(g, algebroid, i, b);
            let minus = bracket.into_iter().map(|e| g.neg(e)).collect();
            let value = sparse(g, minus);
            algebroid.set_bracket(i, n + b, value);
        }
    }
}

/// `[d/dt, D_i] = -dA^a_i/dt e_a`.
fn set_connection_drift(
    g: &mut Graph,
    algebroid: &mut Algebroid,
    time: SymbolId,
    connection: &[Vec<ExprId>],
) {
    let n = connection.first().map_or(0, Vec::len);
    for i in 0..n {
        let mut drift = Vec::new();
        for (a, row) in connection.iter().enumerate() {
            let rate = g.diff(row[i], time);
            let rate = g.cancel_zero(rate);
            if rate != g.zero() {
                drift.push((n + a, g.neg(rate)));
            }
        }
        if !drift.is_empty() {
            algebroid.set_drift(i, drift);
        }
    }
}

/// Signs of sine and cosine on an open interval, where they have one.
fn turning_signs(low: f64, high: f64) -> Vec<(Func, Sign)> {
    use std::f64::consts::{FRAC_PI_2, PI};
    let mut signs = Vec::new();
    if low >= 0.0 && high <= PI {
        signs.push((Func::Sin, Sign::Positive));
    } else if low >= -PI && high <= 0.0 {
        signs.push((Func::Sin, Sign::Negative));
    }
    if low >= -FRAC_PI_2 && high <= FRAC_PI_2 {
        signs.push((Func::Cos, Sign::Positive));
    }
    signs
}

/// What the conditions on parameters and the domains of coordinates say about signs.
pub(super) fn signs(model: &mut Model) -> BTreeMap<ExprId, Sign> {
    let g = &mut model.graph;
    let mut signs = BTreeMap::new();
    for c in &model.conditions {
        let sign = match c.relation {
            Relation::Greater => Sign::Positive,
            Relation::GreaterEqual => Sign::NonNegative,
            Relation::NotEqual => Sign::NonZero,
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
            let none = BTreeMap::new();
            if let (Some(low), Some(high)) = (g.eval_f64(low, &none), g.eval_f64(high, &none)) {
                for (f, sign) in turning_signs(low, high) {
                    let value = g.func(f, x);
                    signs.insert(value, sign);
                }
                if low >= 0.0 {
                    signs.insert(x, Sign::Positive);
                }
            }
        }
    }
    signs
}

fn quasi_unknowns(model: &Model) -> Vec<Unknown> {
    let quasi = model.quasi_velocities.iter();
    quasi.map(|v| Unknown { name: v.name.clone(), symbol: v.symbol, frame_idx: None }).collect()
}

fn frame_unknowns(model: &Model) -> Vec<Unknown> {
    let velocities = model.all_velocities().into_iter().enumerate();
    velocities
        .map(|(k, (name, symbol))| Unknown { name: name.to_owned(), symbol, frame_idx: Some(k) })
        .collect()
}

fn state_order(model: &Model, unknowns: &[Unknown]) -> Vec<(StateKind, String)> {
    let n_shape = model.base.len();
    let velocity_doc = |u: &Unknown| match u.frame_idx {
        Some(k) if k < n_shape => format!("velocity of {}", model.base[k].name),
        Some(k) => model.velocities[k - n_shape].doc.clone(),
        None => {
            let own = model.quasi_velocities.iter().find(|v| v.symbol == u.symbol);
            own.map(|v| v.doc.clone()).unwrap_or_default()
        }
    };
    let shape = model.base.iter().enumerate().map(|(i, c)| (StateKind::Base(i), c.doc.clone()));
    let velocities = unknowns.iter().enumerate().map(|(a, u)| (StateKind::Unknown(a), velocity_doc(u)));
    let advected = model
        .advected
        .iter()
        .flat_map(|a| std::iter::repeat_n(a.doc.clone(), a.components.len()))
        .enumerate()
        .map(|(i, doc)| (StateKind::Base(n_shape + i), doc));
    shape.chain(velocities).chain(advected).collect()
}
