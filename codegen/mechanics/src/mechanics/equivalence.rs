//! One motion in two formulations: the state of one as functions of that of the other, and whether these functions take
//! one vector field to the other.
//!
//! Does not know: how a formulation was chosen, what its equations cost.

use std::collections::{BTreeMap, BTreeSet};

use crate::reduction::{KinematicConstraint, ReducedSystem, momentum_of};
use hamel_expr::{DivisionByZero, ExprId, Func, Graph, Node, SymbolId, Vanishing, inlined, needed_sections};

use super::equations::{Equations, StateEquation};

/// State variables of one formulation as functions of time and the state of another one of the same model, with the
/// same parameters fixed.
///
/// Both carry the same base, group and advected parameters; velocities are `v = xi + A xdot` in each with its own
/// connection:
///
/// ```text
/// xdot' = xdot,   v' = v + (A' - A) xdot,   (c', s') = (cos theta, sin theta),   pi' = W^T dL/dy'
/// ```
///
/// in which the velocities that a constraint determines are `y = Psi u + psi0`, those in the place of which momenta are
/// carried follow from the Legendre transform, and those along the levels of stages from their frame.
#[derive(Clone, Debug)]
pub struct ChangeOfState {
    /// The graph of the formulation that the functions are written in, with the functions.
    graph: Graph,
    /// What stands for symbols of the other formulation: components of its state, and points of circles.
    values: BTreeMap<SymbolId, ExprId>,
}

/// Why two formulations are not known to be one motion.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Unrelated {
    /// A component of the state that is not written as a function of the other state.
    NoFunction {
        /// Its name.
        component: String,
    },
    /// A component whose rates in both formulations differ: proved.
    Differs {
        /// Its name.
        component: String,
    },
    /// A component for which neither was proved.
    Unknown {
        /// Its name.
        component: String,
    },
}

impl ChangeOfState {
    /// The state of `to`, as far as it is a function of that of `from` without angles of points.
    ///
    /// # Errors
    /// [`DivisionByZero`] where a connection has no value in the coordinates of `from`.
    pub fn between(from: &Equations, to: &ReducedSystem) -> Result<ChangeOfState, DivisionByZero> {
        let mut change = ChangeOfState { graph: from.system.graph.clone(), values: BTreeMap::new() };
        let unknowns = unknowns(&mut change.graph, from)?;
        let from = &from.system;
        change.base(from, to);
        let of_model = change.velocities(from, to, &unknowns)?;
        let velocities = change.in_frame(to, &of_model)?;
        let g = &mut change.graph;
        for unknown in &to.unknowns {
            let frame = to.frame.as_ref();
            let own = frame.and_then(|f| f.original.iter().position(|u| u.symbol == unknown.symbol));
            let value = match (own, unknown.frame_idx) {
                // A velocity of the model, whatever the frame.
                (Some(k), _) => of_model[k],
                (None, Some(k)) => velocities[k],
                (None, None) => {
                    let own = from.unknowns.iter().find(|u| u.symbol == unknown.symbol);
                    own.map(|u| unknowns.get(&u.symbol).copied().unwrap_or_else(|| g.sym(u.symbol)))
                }
            };
            change.values.extend(value.map(|value| (unknown.symbol, value)));
        }
        change.momenta(from, to, &velocities)?;
        let g = &mut change.graph;
        let group = to.reconstruction.iter().map(|c| c.symbol);
        let group = group.filter(|s| from.reconstruction.iter().any(|c| c.symbol == *s));
        change.values.extend(group.map(|s| (s, g.sym(s))));
        Ok(change)
    }

    /// The base coordinates of `to` that are coordinates of `from` or points of its angles.
    fn base(&mut self, from: &ReducedSystem, to: &ReducedSystem) {
        let g = &mut self.graph;
        let on_circles: BTreeSet<SymbolId> = to.circles.iter().flat_map(|c| [c.cosine, c.sine]).collect();
        for circle in &to.circles {
            let own = from.circles.iter().find(|own| own.angle == circle.angle);
            let angle = from.algebroid.base().iter().find(|x| g.name(**x) == circle.angle).copied();
            let point = match (own, angle) {
                (Some(own), _) => [g.sym(own.cosine), g.sym(own.sine)],
                (None, Some(angle)) => {
                    let angle = g.sym(angle);
                    [g.func(Func::Cos, angle), g.func(Func::Sin, angle)]
                }
                (None, None) => continue,
            };
            self.values.extend([circle.cosine, circle.sine].into_iter().zip(point));
        }
        for x in to.algebroid.base().iter().filter(|x| !on_circles.contains(x)) {
            if from.algebroid.base().contains(x)
                && !from.circles.iter().any(|c| [c.cosine, c.sine].contains(x))
            {
                self.values.insert(*x, g.sym(*x));
            }
        }
    }

    /// The velocities along the frame of `to`, by those of its model; none where a coefficient depends on a coordinate
    /// without a function.
    fn in_frame(
        &mut self,
        to: &ReducedSystem,
        of_model: &[Option<ExprId>],
    ) -> Result<Vec<Option<ExprId>>, DivisionByZero> {
        let Some(frame) = &to.frame else { return Ok(of_model.to_vec()) };
        let coordinates = to.algebroid.base();
        let mut along = Vec::new();
        for row in &frame.inverse {
            let mut terms = Some(Vec::new());
            for (e, y) in row.iter().zip(of_model).filter(|(e, _)| **e != to.graph.zero()) {
                let needed = to.graph.free_symbols(*e);
                let is_known =
                    !needed.iter().any(|s| coordinates.contains(s) && !self.values.contains_key(s));
                let e = self.graph.import_with(&to.graph, &[*e], &self.values)?[0];
                let term = y.filter(|_| is_known).map(|y| self.graph.mul(e, y));
                terms =
                    terms.zip(term).map(|(terms, term): (Vec<ExprId>, ExprId)| [terms, vec![term]].concat());
            }
            along.push(terms.map(|terms| self.graph.sum(&terms)));
        }
        Ok(along)
    }

    /// The velocities of the model with the connection of `to`; none where that depends on a coordinate without a
    /// function.
    fn velocities(
        &mut self,
        from: &ReducedSystem,
        to: &ReducedSystem,
        unknowns: &BTreeMap<SymbolId, ExprId>,
    ) -> Result<Vec<Option<ExprId>>, DivisionByZero> {
        let own = frame_velocities(&mut self.graph, from, unknowns)?;
        let y = match &from.frame {
            Some(frame) => frame.velocities(&mut self.graph, &own),
            None => own,
        };
        let Some(dim) = from.connection.as_ref().or(to.connection.as_ref()).map(Vec::len) else {
            return Ok(y.into_iter().map(Some).collect());
        };
        let n = y.len() - dim;
        let known: BTreeSet<SymbolId> = self.values.keys().copied().collect();
        let coordinates: BTreeSet<SymbolId> = to.algebroid.base().iter().copied().collect();
        let mut velocities: Vec<Option<ExprId>> = y.iter().copied().map(Some).collect();
        for a in 0..dim {
            let mut terms = vec![y[n + a]];
            let row = |connection: &Option<Vec<Vec<ExprId>>>| connection.as_ref().map(|rows| rows[a].clone());
            for (i, e) in row(&to.connection).into_iter().flatten().enumerate() {
                let needed = to.graph.free_symbols(e);
                if needed.iter().any(|s| coordinates.contains(s) && !known.contains(s)) {
                    velocities[n + a] = None;
                }
                let e = self.graph.import_with(&to.graph, &[e], &self.values)?[0];
                terms.push(self.graph.mul(e, y[i]));
            }
            for (i, e) in row(&from.connection).into_iter().flatten().enumerate() {
                let term = self.graph.mul(e, y[i]);
                terms.push(self.graph.neg(term));
            }
            let sum = self.graph.sum(&terms);
            // Equal connections cancel term by term, or in their values.
            let sum = if self.graph.fingerprints_agree(sum, y[n + a]) { y[n + a] } else { sum };
            velocities[n + a] = velocities[n + a].map(|_| sum);
        }
        Ok(velocities)
    }

    /// The momenta that `to` carries, by the velocities of its frame.
    fn momenta(
        &mut self,
        from: &ReducedSystem,
        to: &ReducedSystem,
        velocities: &[Option<ExprId>],
    ) -> Result<(), DivisionByZero> {
        if to.momenta.iter().all(|m| m.symbol.is_none()) {
            return Ok(());
        }
        if to.hamiltonian.is_some() {
            // Both have the momenta of the model, in its frame.
            for momentum in &to.momenta {
                let own =
                    from.momenta.iter().find(|own| own.name == momentum.name).and_then(|own| own.symbol);
                if let Some((symbol, own)) = momentum.symbol.zip(own) {
                    self.values.insert(symbol, self.graph.sym(own));
                }
            }
            return Ok(());
        }
        let Some(y) = velocities.iter().copied().collect::<Option<Vec<ExprId>>>() else { return Ok(()) };
        let mut values = self.values.clone();
        values.extend(to.velocities.iter().copied().zip(y));
        let mut written = to.graph.clone();
        for momentum in &to.momenta {
            let Some(symbol) = momentum.symbol else { continue };
            let e =
                momentum_of(&mut written, to.lagrangian, &to.velocities, &to.constraint, momentum.unknown);
            let value = self.graph.import_with(&written, &[e], &values)?[0];
            let own = from.momenta.iter().find(|own| own.name == momentum.name).and_then(|own| own.symbol);
            let own = own.map(|symbol| self.graph.sym(symbol));
            let own = own.filter(|own| self.graph.fingerprints_agree(value, *own));
            self.values.insert(symbol, own.unwrap_or(value));
        }
        Ok(())
    }

    /// The graph that the functions are in.
    pub fn graph(&self) -> &Graph {
        &self.graph
    }

    /// A component of the state as a function; none where there is none.
    pub fn value(&self, component: SymbolId) -> Option<ExprId> {
        self.values.get(&component).copied()
    }

    /// Whether a component of the state of `to` is one of the same name and meaning in the other formulation.
    pub fn keeps(&self, to: &ReducedSystem, component: SymbolId) -> bool {
        self.component(component).is_some_and(|s| self.graph.name(s) == to.graph.name(component))
    }

    /// The symbol that a component of the state is in the other formulation.
    fn component(&self, component: SymbolId) -> Option<SymbolId> {
        match self.graph.node(self.value(component)?) {
            Node::Symbol(s) => Some(*s),
            _ => None,
        }
    }

    /// Proves that the functions `phi` take the motion of `from` to that of `to`: `d phi/dt = f'(phi)` along the vector
    /// field of `from`, for every component of the state and of the group, by values in the prime field in which zeros
    /// are tested.
    ///
    /// # Errors
    /// The first component for which that is not proved.
    pub fn relates(&self, from: &Equations, to: &Equations) -> Result<(), Unrelated> {
        let mut g = self.graph.clone();
        let mut values = self.values.clone();
        let components: Vec<&StateEquation> = to.state.iter().chain(&to.reconstruction).collect();
        let name = |s: &StateEquation| s.name.clone();
        if let Some(s) = components.iter().find(|s| !values.contains_key(&s.symbol)) {
            return Err(Unrelated::NoFunction { component: name(s) });
        }
        let of_first = components.first().map(|s| name(s)).unwrap_or_default();
        let singular = |_: DivisionByZero| Unrelated::Unknown { component: of_first.clone() };
        let rates: Vec<ExprId> = components.iter().map(|s| s.derivative).collect();
        let written = &to.system.graph;
        for definition in needed_sections(written, &to.sections, &rates).iter().flat_map(|s| &s.definitions) {
            let e = g.import_with(written, &[definition.expr], &values).map_err(singular)?[0];
            let symbol = g.define(written.name(definition.symbol), e);
            values.insert(definition.symbol, g.sym(symbol));
        }
        let rates = g.import_with(written, &rates, &values).map_err(singular)?;
        let field: Vec<(SymbolId, ExprId)> =
            from.state.iter().chain(&from.reconstruction).map(|s| (s.symbol, s.derivative)).collect();
        for (s, rate) in components.into_iter().zip(rates) {
            let phi = values[&s.symbol];
            let mut terms = vec![g.diff(phi, from.system.time)];
            for (x, derivative) in &field {
                let slope = g.diff(phi, *x);
                terms.push(g.mul(slope, *derivative));
            }
            let along = g.sum(&terms);
            let difference = g.sub(along, rate);
            let verdict = g.vanishing(difference);
            match verdict {
                _ if g.within_budget().is_err() => return Err(Unrelated::Unknown { component: name(s) }),
                Vanishing::Zero => {}
                Vanishing::NonZero => return Err(Unrelated::Differs { component: name(s) }),
                Vanishing::Unknown => return Err(Unrelated::Unknown { component: name(s) }),
            }
        }
        Ok(())
    }
}

/// Unknowns that are no part of the state, as functions of it.
fn unknowns(g: &mut Graph, equations: &Equations) -> Result<BTreeMap<SymbolId, ExprId>, DivisionByZero> {
    let (symbols, roots): (Vec<SymbolId>, Vec<ExprId>) =
        equations.velocities_of_momenta().into_iter().unzip();
    let sections = needed_sections(g, &equations.sections, &roots);
    let definitions = inlined(g, sections.iter().flat_map(|s| &s.definitions));
    let values = g.subs_all(&roots, &definitions)?;
    Ok(symbols.into_iter().zip(values).collect())
}

/// All velocities of the frame, those that the constraint determines by the others, and those that are no part of the
/// state as `unknowns` says.
fn frame_velocities(
    g: &mut Graph,
    system: &ReducedSystem,
    unknowns: &BTreeMap<SymbolId, ExprId>,
) -> Result<Vec<ExprId>, DivisionByZero> {
    let raw = system.velocities.iter().map(|s| g.sym(*s)).collect::<Vec<_>>();
    let dependent = |k: &usize| match &system.constraint {
        KinematicConstraint::Solved(solved) if solved.dependent.contains(k) => Some(solved),
        _ => None,
    };
    let value = |(k, y)| dependent(&k).map_or(y, |solved| solved.velocity(g, k));
    let all: Vec<ExprId> = raw.into_iter().enumerate().map(value).collect();
    g.subs_all(&all, unknowns)
}

/// Proves that two formulations of one model are one motion: as [`ChangeOfState::relates`], with the functions found.
///
/// ```
/// use hamel_mechanics::mechanics::{derive, same_motion};
/// use hamel_mechanics::reduction::{Formulation, reduce};
/// use hamel_lang::spec::{self, ConnectionKind};
///
/// let text = "model cart {
///     coordinate x in real;
///     velocity v in R^1;
///     lagrangian = 1/2*x_dot^2*(2 + x^2) + v*x_dot*x + v^2;
/// }";
/// let model = spec::parse("cart.hamel", text)?;
/// let default = Formulation::of(&model);
/// let other = Formulation { connection: Some(ConnectionKind::Mechanical), ..default.clone() };
/// let [a, b] = [default, other].map(|f| derive(&reduce(&model, &f).unwrap()).unwrap());
/// assert_eq!(same_motion(&a, &b), Ok(()));
/// # Ok::<(), spec::Diagnostics>(())
/// ```
///
/// # Errors
/// The first component of the state for which that is not proved.
pub fn same_motion(from: &Equations, to: &Equations) -> Result<(), Unrelated> {
    let change = ChangeOfState::between(from, &to.system).map_err(|DivisionByZero| Unrelated::Unknown {
        component: to.state.first().map(|s| s.name.clone()).unwrap_or_default(),
    })?;
    change.relates(from, to)
}
