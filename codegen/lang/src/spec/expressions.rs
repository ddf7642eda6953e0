//! All expressions of a model, each with its role: the one list for whatever walks a model.
//!
//! Both lists take every struct apart field by field, so that a new field does not compile until it is listed or said
//! to hold no expression.
//!
//! Deliberately does not know: what is done with the expressions, the expressions of views, which have a graph of their
//! own.

use super::event::Event;
use super::mode::Impact;
use super::model::*;
use hamel_expr::{ExprId, Graph};

/// What an expression is in its [`Model`]; numbers are positions in the model's lists.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ExpressionRole {
    /// [`Model::lagrangian`].
    Lagrangian,
    /// [`Model::hamiltonian`].
    Hamiltonian,
    /// The function that a noise multiplies.
    Noise(usize),
    /// The external force on a velocity, in the order of [`Model::all_velocities`].
    Force(usize),
    /// An end of the interval of a base coordinate, or behind these of a state of first order.
    DomainEnd(usize),
    /// A side of a condition on the parameters.
    Condition(usize),
    /// A component of the infinitesimal action on an advected parameter.
    AdvectedAction(usize),
    /// A component of the rate of a state of first order.
    FirstOrderRate(usize),
    /// A component of [`Model::connection`].
    Connection,
    /// A coefficient of anchor or bracket of [`Model::algebroid`].
    Algebroid,
    /// A coefficient of [`Model::frame`].
    Frame,
    /// What gives the motion of a velocity, in the order of [`Model::all_velocities`].
    Given(usize),
    /// Left side minus right side of a constraint.
    ConstraintResidual(usize),
    /// Left side minus right side of an equation between positions.
    ConstraintPosition(usize),
    /// Left side minus right side of an equation between positions that was left out.
    Implied(usize),
    /// A coefficient of the highest derivatives in a constraint on accelerations or their rates, and what is added to
    /// the acceleration that the state carries for it.
    ConstraintAcceleration(usize),
    /// A coefficient of a condition on virtual displacements.
    VirtualConstraint(usize),
    /// A velocity or a rate of a reconstructed item.
    Reconstruction(usize),
    /// A Casimir.
    Casimir(usize),
    /// A function up to whose rate the Lagrangian is invariant.
    QuasiInvariance(usize),
    /// A component of an output.
    Output(usize),
    /// A Lyapunov function, and its rate.
    Lyapunov,
    /// What an impact has of a mode: whether its constraints are there, and how much of a velocity comes back.
    Impact(usize),
    /// A coefficient of a section along which a momentum is wanted.
    Section(usize),
    /// A coefficient of a vector that spans an ideal of the stages.
    Ideal,
    /// An entry of the inner product for the stages.
    InnerProduct,
    /// A coefficient of the connections of the stages.
    StageConnection,
    /// The default initial value of a variable.
    Initial(usize),
}

/// Gives every expression of `$model` to `$visit`; the model is borrowed, and the expressions with it, as `$model` is.
macro_rules! visit {
    ($model:expr, $graph:ident, $visit:ident) => {
        let Model {
            name: _,
            doc: _,
            sources: _,
            units: _,
            topic: _,
            totals: _,
            parts: _,
            sizes: _,
            graph: $graph,
            time: _,
            params,
            param_arrays,
            inputs,
            input_arrays,
            noises,
            conditions,
            base,
            algebra: _,
            velocities,
            quasi_velocities,
            momenta,
            carries: _,
            quasi_invariances,
            wants_digits: _,
            action: _,
            connection,
            algebroid,
            frame,
            given,
            stages,
            advected,
            first_order,
            lagrangian,
            hamiltonian,
            constraints,
            implied,
            derived_connection: _,
            accelerations: _,
            virtual_constraints,
            independent: _,
            force_multipliers: _,
            forces,
            casimirs,
            outputs,
            sections,
            modes,
            multipliers: _,
            lyapunov,
            events,
            configurations: _,
            reconstruction,
            initial,
            scenes,
            views: _,
            places: _,
            warnings: _,
            origin: _,
        } = $model;
        for Param { name: _, symbol: _, default: _, doc: _ } in params.iter().chain(&*inputs) {}
        for ParamArray { name: _, layout: _, symbols: _ } in param_arrays.iter().chain(&*input_arrays) {}
        for Velocity { name: _, symbol: _, block: _, doc: _ } in velocities.iter().chain(&*quasi_velocities) {
        }
        for Momentum { name: _, components: _, doc: _, span: _ } in &*momenta {}
        for Mode { name: _, symbol: _, doc: _, span: _ } in &*modes {}
        for Scene {
            name: _,
            fixed: _,
            inputs: _,
            wants: _,
            drops: _,
            circles: _,
            carries: _,
            formulation: _,
            discrete: _,
            doc: _,
            span: _,
            extent: _,
            places: _,
        } in &*scenes
        {}
        $visit(ExpressionRole::Lagrangian, lagrangian);
        if let Some(e) = hamiltonian {
            $visit(ExpressionRole::Hamiltonian, e);
        }
        for (k, Noise { name: _, symbol: _, hamiltonian, span: _ }) in noises.into_iter().enumerate() {
            if let Some((e, _)) = hamiltonian {
                $visit(ExpressionRole::Noise(k), e);
            }
        }
        for (k, force) in forces.into_iter().enumerate() {
            $visit(ExpressionRole::Force(k), force);
        }
        let n_base = base.len();
        for (k, coordinate) in base.into_iter().enumerate() {
            let Coordinate { name: _, symbol: _, velocity_name: _, velocity: _, domain, doc: _ } = coordinate;
            match domain {
                Domain::Interval(low, high) => {
                    $visit(ExpressionRole::DomainEnd(k), low);
                    $visit(ExpressionRole::DomainEnd(k), high);
                }
                Domain::Angle | Domain::Real => {}
            }
        }
        for (k, condition) in conditions.into_iter().enumerate() {
            let Condition { text: _, greater, less, relation: _, subject: _, span: _ } = condition;
            $visit(ExpressionRole::Condition(k), greater);
            $visit(ExpressionRole::Condition(k), less);
        }
        for (k, parameter) in advected.into_iter().enumerate() {
            let Advected { name: _, components: _, action, doc: _, span: _ } = parameter;
            for e in action {
                $visit(ExpressionRole::AdvectedAction(k), e);
            }
        }
        for (k, state) in first_order.into_iter().enumerate() {
            let FirstOrderState {
                name: _,
                components: _,
                domain,
                rates,
                is_entropy: _,
                is_mode: _,
                doc: _,
                span: _,
                of_rate: _,
            } = state;
            match domain {
                Domain::Interval(low, high) => {
                    $visit(ExpressionRole::DomainEnd(n_base + k), low);
                    $visit(ExpressionRole::DomainEnd(n_base + k), high);
                }
                Domain::Angle | Domain::Real => {}
            }
            for e in rates {
                $visit(ExpressionRole::FirstOrderRate(k), e);
            }
        }
        for e in connection.into_iter().flatten().flatten() {
            $visit(ExpressionRole::Connection, e);
        }
        if let Some(OwnAlgebroid { basis: _, is_almost: _, anchor, brackets, span: _ }) = algebroid {
            for e in anchor.into_iter().flatten() {
                $visit(ExpressionRole::Algebroid, e);
            }
            for OwnBracket { pair: _, value, span: _ } in brackets {
                for (_, e) in value {
                    $visit(ExpressionRole::Algebroid, e);
                }
            }
        }
        if let Some(QuasiFrame { original: _, matrix, inverse, docs: _, determinant, span: _ }) = frame {
            for e in matrix.into_iter().flatten().chain(inverse.into_iter().flatten()).chain(determinant) {
                $visit(ExpressionRole::Frame, e);
            }
        }
        for (k, rate) in given.into_iter().flatten().enumerate() {
            match rate {
                Given::Velocity(e) | Given::Acceleration(e) => $visit(ExpressionRole::Given(k), e),
                Given::Constrained => {}
            }
        }
        for (k, Implied { text: _, residual, at: _, span: _ }) in implied.into_iter().enumerate() {
            $visit(ExpressionRole::Implied(k), residual);
        }
        for (k, constraint) in constraints.into_iter().enumerate() {
            let Constraint { name: _, text: _, kind, residual, position, gives: _, mode: _, span: _ } =
                constraint;
            $visit(ExpressionRole::ConstraintResidual(k), residual);
            if let Some(PositionEquation { residual: position, determines: _ }) = position {
                $visit(ExpressionRole::ConstraintPosition(k), position);
            }
            match kind {
                ConstraintKind::Linear | ConstraintKind::Nonlinear => {}
                ConstraintKind::SecondOrder { acceleration } => {
                    for e in acceleration {
                        $visit(ExpressionRole::ConstraintAcceleration(k), e);
                    }
                }
                ConstraintKind::ThirdOrder { jerk, carried } => {
                    let CarriedAcceleration { name: _, symbol: _, offset, doc: _ } = carried;
                    for e in jerk {
                        $visit(ExpressionRole::ConstraintAcceleration(k), e);
                    }
                    $visit(ExpressionRole::ConstraintAcceleration(k), offset);
                }
            }
        }
        for (k, condition) in virtual_constraints.into_iter().enumerate() {
            let VirtualConstraint { name: _, text: _, one_form, power_of: _, mode: _, span: _ } = condition;
            for e in one_form {
                $visit(ExpressionRole::VirtualConstraint(k), e);
            }
        }
        for (k, item) in reconstruction.into_iter().enumerate() {
            let Reconstruction { blocks: _, names: _, symbols: _, kind, doc: _, span: _ } = item;
            let mut add = |e| $visit(ExpressionRole::Reconstruction(k), e);
            match kind {
                ReconstructionKind::Angle { omega } => add(omega),
                ReconstructionKind::Quaternion { omega } => omega.into_iter().for_each(add),
                ReconstructionKind::PlanarPose { omega, v } => {
                    add(omega);
                    v.into_iter().for_each(add);
                }
                ReconstructionKind::Pose { omega, v } => omega.into_iter().chain(v).for_each(add),
                ReconstructionKind::Translation { v: list }
                | ReconstructionKind::Matrix { group: _, elements: _, xi: list }
                | ReconstructionKind::Rate { rate: list } => {
                    list.into_iter().for_each(add);
                }
            }
        }
        for (k, own) in quasi_invariances.into_iter().enumerate() {
            let QuasiInvariance { velocity: _, parameter: _, function, span: _ } = own;
            $visit(ExpressionRole::QuasiInvariance(k), function);
        }
        for (k, casimir) in casimirs.into_iter().enumerate() {
            let Named { name: _, expr, doc: _ } = casimir;
            $visit(ExpressionRole::Casimir(k), expr);
        }
        for (k, output) in outputs.into_iter().enumerate() {
            let NamedVector { name: _, components, doc: _, part: _ } = output;
            for (_, e) in components {
                $visit(ExpressionRole::Output(k), e);
            }
        }
        if let Some(Lyapunov { name: _, value, rate, response: _, actuator: _, span: _ }) = lyapunov {
            $visit(ExpressionRole::Lyapunov, value);
            $visit(ExpressionRole::Lyapunov, rate);
        }
        for (k, event) in events.into_iter().enumerate() {
            let Event { name: _, direction: _, mode: _, sets: _, impact, stops: _, doc: _, span: _ } = event;
            let Some(Impact { modes, restitution, velocities: _ }) = impact else { continue };
            for (_, e) in modes {
                $visit(ExpressionRole::Impact(k), e);
            }
            for (_, e) in restitution {
                $visit(ExpressionRole::Impact(k), e);
            }
        }
        for (k, section) in sections.into_iter().enumerate() {
            let VelocitySection { name: _, coefficients, doc: _, span: _ } = section;
            for e in coefficients {
                $visit(ExpressionRole::Section(k), e);
            }
        }
        if let Some(IdealChain { names: _, ideals, inner_product, connection, momentum: _, spans: _ }) =
            stages
        {
            for e in ideals.into_iter().flatten().flatten() {
                $visit(ExpressionRole::Ideal, e);
            }
            if let Some(InnerProduct::Matrix(rows)) = inner_product {
                for e in rows.into_iter().flatten() {
                    $visit(ExpressionRole::InnerProduct, e);
                }
            }
            for e in connection.into_iter().flatten().flatten() {
                $visit(ExpressionRole::StageConnection, e);
            }
        }
        for (k, (_, e)) in initial.into_iter().enumerate() {
            $visit(ExpressionRole::Initial(k), e);
        }
    };
}

impl Model {
    /// Every expression with its role, in a fixed order.
    ///
    /// ```
    /// use hamel_lang::spec::{ExpressionRole, parse};
    ///
    /// let model = parse("m.hamel", "model m { velocity v in R; lagrangian = v^2; output twice = 2*v; }").unwrap();
    /// let roles: Vec<_> = model.expressions().into_iter().map(|(role, _)| role).collect();
    /// assert_eq!(roles, [ExpressionRole::Lagrangian, ExpressionRole::Force(0), ExpressionRole::Output(0)]);
    /// ```
    pub fn expressions(&self) -> Vec<(ExpressionRole, ExprId)> {
        let mut list = Vec::new();
        let mut visit = |role: ExpressionRole, e: &ExprId| list.push((role, *e));
        visit!(self, _graph, visit);
        list
    }

    /// The name of what the interval of [`ExpressionRole::DomainEnd`] belongs to.
    pub fn name_of_domain(&self, k: usize) -> &str {
        match self.base.get(k) {
            Some(coordinate) => &coordinate.name,
            None => self.first_order.get(k - self.base.len()).map_or("", |state| &state.name),
        }
    }

    /// The graph, and every expression with its role in the order of [`Model::expressions`], to be replaced.
    pub fn expressions_mut(&mut self) -> (&mut Graph, Vec<(ExpressionRole, &mut ExprId)>) {
        let mut list = Vec::new();
        let mut visit = |role: ExpressionRole, e| list.push((role, e));
        visit!(self, graph, visit);
        (graph, list)
    }
}
