//! The one value that the derivation consumes.
//!
//! Does not know: the models that it is made from by rewrites, equations of motion.

use std::collections::BTreeMap;

use hamel_expr::{ExprId, Graph, Sign, SymbolId};
use hamel_lang::algebra::Algebroid;
use hamel_lang::spec::{
    Condition, Event, Named, NamedVector, Param, ParamArray, Side, Units, VelocitySection,
};

use super::change::{Change, Frame};
use super::constraint::{HigherOrder, KinematicConstraint, Unknown};
use super::degenerate::Degeneracy;
use super::domain::DomainCondition;
use super::formulation::Formulation;
use super::lift::Lift;
use super::matrix_group::MomentumInSpace;
use super::momenta::{CarriedMomentum, Hamiltonian};
use super::part::Part;
use super::reconstruction::ReconstructedCoordinate;
use super::stages::Stages;

/// What a state variable is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StateKind {
    /// Base coordinate `x^i` of the algebroid (a shape coordinate or a component of an advected parameter).
    Base(usize),
    /// An unknown `u` of the equations of motion, by its place in [`ReducedSystem::unknowns`].
    Unknown(usize),
    /// A momentum.
    Momentum {
        /// Its place in [`ReducedSystem::momenta`].
        place: usize,
        /// Its symbol.
        symbol: SymbolId,
    },
}

/// Components of a state that belong together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Block {
    /// Its name in the model.
    pub name: String,
    /// Its components.
    pub components: Vec<SymbolId>,
    /// What it is.
    pub kind: BlockKind,
}

/// What a [`Block`] is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BlockKind {
    /// Velocities in the algebra.
    Velocity,
    /// Momenta along velocities.
    Momentum,
    /// An advected parameter.
    Advected,
    /// A state of first order.
    FirstOrder,
    /// A unit quaternion `(w, x, y, z)` that turns the body frame to space.
    Attitude,
    /// The angle from space to the body frame of a planar pose.
    Heading,
    /// The position of a pose, whose attitude or heading is another block; that of a planar pose has two blocks of one
    /// number.
    Position {
        /// Position of that block in [`ReducedSystem::blocks`].
        attitude: usize,
    },
    /// The entries of a square matrix with that many rows, row by row.
    Matrix(usize),
    /// Any other coordinates of the group, or those whose rate the model gives.
    Reconstructed,
}

/// A component of the state that the model gives a rate of: on the algebroid a base coordinate that no velocity moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OwnRate {
    /// Its symbol.
    pub symbol: SymbolId,
    /// `zdot`, a function of base coordinates, velocities, inputs and the time.
    pub rate: ExprId,
    /// Whether it is the entropy of something.
    pub is_entropy: bool,
    /// Whether it is a mode, which events alone change.
    pub is_mode: bool,
}

/// An equation between coordinates.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PositionResidual {
    /// Its name: `position_` and that of the coordinate or the constraint.
    pub name: String,
    /// `f(x, a, t)`, zero along the motion from initial values that satisfy the equation.
    pub residual: ExprId,
    /// The components of the base that the equation gives, with others of its item; none where it says nothing about
    /// that.
    pub determines: Vec<SymbolId>,
}

/// An angle that a base carries as the point `(cos, sin)` of the unit circle.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Circle {
    /// Name of the angle.
    pub angle: String,
    /// Base coordinate `c`; zero tests know that `c^2 + s^2 = 1`.
    pub cosine: SymbolId,
    /// Base coordinate `s`.
    pub sine: SymbolId,
}

/// A function that the force of an actuator gives its rate, in a row of the constraint of its own.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Feedback {
    /// Its name, which is that of the row.
    pub function: String,
    /// The name of the actuator.
    pub actuator: String,
    /// Stands for `d(dV/dt)/du` in the row and in outputs; after the derivation they have its value.
    pub response: SymbolId,
    /// `d(dV/dt)/du`: the symbol, and after the derivation its value.
    pub slope: ExprId,
    /// `dV/dt`.
    pub rate: ExprId,
}

/// A system on a Lie algebroid: everything the derivation needs and nothing about where it came from.
///
/// # Shapes
/// `n` base coordinates, `m` velocities; `forces`: `[m]`; `state`: order `[shape coordinates, velocities, advected]`.
#[derive(Clone, Debug)]
pub struct ReducedSystem {
    /// The choices that led here.
    pub formulation: Formulation,
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
    /// Units of the model, by names.
    pub units: Units,
    /// Which parameters of the model form vectors and matrices, those included of which some are fixed.
    pub param_arrays: Vec<ParamArray>,
    /// Inputs that are not held: arguments of every function, as time is, of which no rate is known.
    pub inputs: Vec<Param>,
    /// The inputs that are white noise.
    pub noises: Vec<SymbolId>,
    /// Conditions on the parameters.
    pub conditions: Vec<Condition>,
    /// Anchor and bracket in the frame of the velocities.
    pub algebroid: Algebroid,
    /// Symbols of the velocities `y^alpha`, in frame order.
    pub velocities: Vec<SymbolId>,
    /// Side of the group action.
    pub side: Side,
    /// `A^a_i(x)` by element of the algebra and shape coordinate, `v = xi + A(x) xdot`; absent where `v = xi`.
    pub connection: Option<Vec<Vec<ExprId>>>,
    /// `L(x, y, t)`; zero where the motion follows from a Hamiltonian or is given.
    pub lagrangian: ExprId,
    /// The Hamiltonian in the place of a Lagrangian.
    pub hamiltonian: Option<Hamiltonian>,
    /// The rates of [`ReducedSystem::unknowns`], where the model gives them in the place of a Lagrangian.
    pub accelerations: Option<Vec<ExprId>>,
    /// External force `F_alpha`.
    pub forces: Vec<ExprId>,
    /// `Psi`, `psi0`, `W`, or multipliers.
    pub constraint: KinematicConstraint,
    /// Accelerations along constraints of third order, which are base coordinates of the algebroid that no velocity
    /// moves.
    pub higher: HigherOrder,
    /// States of first order.
    pub own_rates: Vec<OwnRate>,
    /// What noises add to the rates of base coordinates beside the anchor.
    pub noise_rates: Vec<(SymbolId, ExprId)>,
    /// Equations between coordinates; the constraint contains their derivatives.
    pub positions: Vec<PositionResidual>,
    /// What equations without accelerations say, where the Lagrangian is degenerate; the constraint contains it.
    pub degeneracy: Option<Degeneracy>,
    /// The velocities that the state carries: independent ones and quasi-velocities, or all in the multiplier form.
    pub unknowns: Vec<Unknown>,
    /// Unknowns for which the state carries the momentum, or a parameter is the momentum.
    pub momenta: Vec<CarriedMomentum>,
    /// The difference of momenta of the model and of the Lagrangian, by their velocities: slopes of the rate of a
    /// function that was subtracted.
    pub gauge: Vec<(SymbolId, ExprId)>,
    /// State variables in order, with their documentation.
    pub state: Vec<(StateKind, String)>,
    /// Casimirs claimed by the model.
    pub casimirs: Vec<Named>,
    /// Outputs of the model.
    pub outputs: Vec<NamedVector>,
    /// Events; their functions and what they set are outputs.
    pub events: Vec<Event>,
    /// Symbols that stand for multipliers in outputs, by the names of constraints.
    pub multipliers: Vec<(String, SymbolId)>,
    /// A function with a rate that an actuator gives it.
    pub feedback: Option<Feedback>,
    /// Sections along which momenta are wanted, by the sections of the frame.
    pub sections: Vec<VelocitySection>,
    /// Coordinates of the group, which only scenes that ask for them carry.
    pub reconstruction: Vec<ReconstructedCoordinate>,
    /// Momenta in space, by the coordinates of the group.
    pub momenta_in_space: Vec<MomentumInSpace>,
    /// Functions of the coordinates of matrix groups that stay as they are because the motion stays in the group, with
    /// names.
    pub group_equations: Vec<(String, ExprId)>,
    /// Vectors of velocities, advected parameters and coordinates of the group.
    pub blocks: Vec<Block>,
    /// Stage decomposition of the symmetry algebra, when asked for.
    pub stages: Option<Stages>,
    /// Known signs of expressions, from the conditions and domains.
    pub signs: BTreeMap<ExprId, Sign>,
    /// What confines the base coordinates to their intervals.
    pub domains: Vec<DomainCondition>,
    /// Angles that the base carries as points of the circle.
    pub circles: Vec<Circle>,
    /// The frame of the velocities by that of the model; absent where they are the same.
    pub frame: Option<Frame>,
    /// The mechanical connection of the velocities in the state, where the equations are those without it: the frame
    /// is `w = v + A xdot`.
    pub lift: Option<Lift>,
    /// The frame of quasi-velocities that the model declares, by the one of its velocities before.
    pub quasi_frame: Option<Frame>,
    /// What is divided by in a change of frame and not known to be non-zero, with what to call it.
    pub pivots: Vec<(String, ExprId)>,
    /// Velocities along the levels of stages, which the state has, or the momenta of which it has, by the velocities of
    /// the model.
    pub changes: Vec<Change>,
}

impl ReducedSystem {
    /// The unknown that is the velocity of the frame at a place.
    pub(super) fn unknown_along(&self, alpha: usize) -> Option<usize> {
        self.unknowns.iter().position(|u| u.frame_idx == Some(alpha))
    }

    /// Advected parameters and quaternions. Whether the motion keeps their lengths depends on what moves them: their
    /// rates tell.
    pub fn carried_vectors(&self) -> impl Iterator<Item = &Block> {
        self.blocks.iter().filter(|b| matches!(b.kind, BlockKind::Advected | BlockKind::Attitude))
    }

    /// What `xdot = rho y + r` has beside the anchor, by the velocities of the system: the rates of base coordinates
    /// that no velocity moves, and what noises add.
    pub fn own_rates_of_base(&self) -> Vec<ExprId> {
        let own = self.own_rates.iter().map(|own| (own.symbol, own.rate));
        let own: Vec<(SymbolId, ExprId)> = own.chain(self.noise_rates.iter().copied()).collect();
        let rate = |x: &SymbolId| own.iter().find(|(symbol, _)| symbol == x).map(|(_, rate)| *rate);
        self.algebroid.base().iter().map(|x| rate(x).unwrap_or(self.graph.zero())).collect()
    }

    /// The symbol of a state variable.
    pub fn state_symbol(&self, kind: StateKind) -> SymbolId {
        match kind {
            StateKind::Base(i) => self.algebroid.base()[i],
            StateKind::Unknown(a) => self.unknowns[a].symbol,
            StateKind::Momentum { symbol, .. } => symbol,
        }
    }

    /// Every expression of the system and what it is, and the graph that owns them all.
    ///
    /// Only the keys of [`ReducedSystem::signs`] are no part of it: what is known about an expression that is rewritten
    /// says nothing about the new one, and a rewrite has to decide.
    pub fn expressions_mut(&mut self) -> (&mut Graph, Vec<(Part, &mut ExprId)>) {
        let ReducedSystem {
            formulation: _,
            graph,
            name: _,
            doc: _,
            sources: _,
            units: _,
            time: _,
            params: _,
            param_arrays: _,
            inputs: _,
            noises: _,
            conditions,
            algebroid,
            velocities: _,
            side: _,
            connection,
            lagrangian,
            hamiltonian,
            accelerations,
            forces,
            constraint,
            higher: HigherOrder { carried, accelerations: _ },
            own_rates,
            noise_rates,
            positions,
            degeneracy,
            unknowns: _,
            momenta,
            gauge,
            state: _,
            casimirs,
            outputs,
            events: _,
            multipliers: _,
            feedback,
            sections,
            reconstruction,
            momenta_in_space,
            group_equations,
            blocks: _,
            stages,
            signs: _,
            domains,
            circles: _,
            frame,
            lift,
            quasi_frame,
            pivots,
            changes,
        } = self;
        let mut list: Vec<(Part, &mut ExprId)> = vec![(Part::Lagrangian, lagrangian)];
        if let Some(Hamiltonian { h, momenta: _ }) = hamiltonian {
            list.push((Part::Hamiltonian, h));
        }
        let bounds = conditions.iter_mut().flat_map(|c| [&mut c.greater, &mut c.less]);
        list.extend(bounds.map(|e| (Part::Condition, e)));
        list.extend(connection.iter_mut().flatten().flatten().map(|e| (Part::Connection, e)));
        let given = accelerations.iter_mut().flatten().enumerate();
        list.extend(given.map(|(k, e)| (Part::Acceleration(k), e)));
        list.extend(forces.iter_mut().enumerate().map(|(k, e)| (Part::Force(k), e)));
        list.extend(constraint.expressions_mut());
        list.extend(carried.iter_mut().map(|c| (Part::CarriedRate, &mut c.rate)));
        list.extend(own_rates.iter_mut().map(|own| (Part::OwnRate, &mut own.rate)));
        list.extend(noise_rates.iter_mut().map(|(_, rate)| (Part::NoiseRate, rate)));
        list.extend(positions.iter_mut().map(|p| (Part::Position, &mut p.residual)));
        let conditions = degeneracy.iter_mut().flat_map(Degeneracy::expressions_mut);
        list.extend(conditions.map(|e| (Part::Degeneracy, e)));
        list.extend(casimirs.iter_mut().enumerate().map(|(k, c)| (Part::Casimir(k), &mut c.expr)));
        for (k, output) in outputs.iter_mut().enumerate() {
            list.extend(output.components.iter_mut().map(|(_, e)| (Part::Output(k), e)));
        }
        let feedback = feedback.iter_mut().flat_map(|own| [&mut own.rate, &mut own.slope]);
        list.extend(feedback.map(|e| (Part::Feedback, e)));
        for (k, section) in sections.iter_mut().enumerate() {
            list.extend(section.coefficients.iter_mut().map(|e| (Part::Section(k), e)));
        }
        let rates = reconstruction.iter_mut().map(|c| &mut c.rate);
        list.extend(rates.enumerate().map(|(k, e)| (Part::Rate(k), e)));
        let rows = momenta_in_space.iter_mut().flat_map(|m| m.rows.iter_mut().flatten());
        list.extend(rows.map(|e| (Part::MomentumInSpace, e)));
        list.extend(group_equations.iter_mut().map(|(_, e)| (Part::GroupEquation, e)));
        let stages = stages.iter_mut().flat_map(Stages::expressions_mut);
        list.extend(stages.map(|e| (Part::Stages, e)));
        let of_momenta = momenta.iter_mut().map(|m| &mut m.value).chain(gauge.iter_mut().map(|(_, e)| e));
        list.extend(of_momenta.map(|e| (Part::Momentum, e)));
        let domains = domains.iter_mut().map(|d| &mut d.positive);
        list.extend(domains.enumerate().map(|(k, e)| (Part::Domain(k), e)));
        let frame = frame.iter_mut().chain(quasi_frame).flat_map(Frame::expressions_mut);
        let lift = lift.iter_mut().flat_map(Lift::expressions_mut);
        list.extend(lift.map(|e| (Part::Connection, e)));
        let changes = changes.iter_mut().map(|change| &mut change.value);
        let pivots = pivots.iter_mut().map(|(_, e)| e);
        list.extend(frame.chain(changes).chain(pivots).map(|e| (Part::Frame, e)));
        list.extend(algebroid.coefficients_mut().into_iter().map(|e| (Part::Algebroid, e)));
        (graph, list)
    }

    /// The group velocity `xi^a = v^a - A^a_i xdot^i`, by the velocities of the system, `n_shape` of them along the
    /// shape.
    pub fn group_velocity(&self, g: &mut Graph, n_shape: usize) -> Vec<ExprId> {
        let own: Vec<ExprId> = self.velocities.iter().map(|s| g.sym(*s)).collect();
        let y = match self.frame.as_ref().or(self.quasi_frame.as_ref()) {
            Some(frame) => frame.velocities(g, &own),
            None => own,
        };
        let (shape, fibre) = y.split_at(n_shape);
        let Some(connection) = &self.connection else { return fibre.to_vec() };
        let components = fibre.iter().zip(connection).map(|(v, row)| {
            let along = g.dot(row, shape);
            g.sub(*v, along)
        });
        components.collect()
    }
}
