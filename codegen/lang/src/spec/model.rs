//! The checked model.

use std::collections::BTreeMap;

pub(super) use super::configuration::Configuration;
pub(super) use super::constraint::{
    CarriedAcceleration, Constraint, ConstraintKind, Implied, Lyapunov, PositionEquation, VirtualConstraint,
};
use super::diagnostic::{Diagnostic, Diagnostics, Help, Origin, Span};
use super::event::{Event, OutputPart};
pub(super) use super::first_order::FirstOrderState;
use super::layout::Layout;
use super::matrix_group::MatrixGroup;
pub(super) use super::mode::Mode;
pub(super) use super::noise::Noise;
pub(super) use super::quasi_invariance::QuasiInvariance;
use super::size::FamilySize;
use super::total::Total;
use super::unit::Units;
use super::view::Views;
use super::want::Wanted;
use crate::algebra::LieAlgebra;
use hamel_expr::error::Error;
use hamel_expr::{ExprId, Graph, Number, Rational, Relation, SymbolId};

/// Which side the group acts from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// `xi = g^-1 gdot`, the body frame.
    Left,
    /// `xi = gdot g^-1`, the space frame.
    Right,
}

/// A scalar parameter; vectors and matrices are one entry per component.
#[derive(Clone, Debug, PartialEq)]
pub struct Param {
    /// Name, such as `m` or `I1`.
    pub name: String,
    /// Its symbol in [`Model::graph`].
    pub symbol: SymbolId,
    /// Exact value of the default.
    pub default: Rational,
    /// Documentation of the item that declared it.
    pub doc: String,
}

/// Parameters that form a vector or a matrix.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ParamArray {
    /// Name, such as `I` of `I1, I2, I3`.
    pub name: String,
    /// What they form, and in which order.
    pub layout: Layout,
    /// Their symbols.
    pub symbols: Vec<SymbolId>,
}

/// A validity condition on the parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Condition {
    /// As written.
    pub text: String,
    /// The side that has to be larger.
    pub greater: ExprId,
    /// The side that has to be smaller.
    pub less: ExprId,
    /// How they compare.
    pub relation: Relation,
    /// The only parameter in it, if there is only one.
    pub subject: Option<String>,
    /// Where it stands.
    pub span: Option<Span>,
}

/// Where a base coordinate lives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Domain {
    /// An open interval; the ends contain parameters at most.
    Interval(ExprId, ExprId),
    /// The circle, in radians.
    Angle,
    /// The real line.
    Real,
}

/// A base coordinate.
#[derive(Clone, Debug, PartialEq)]
pub struct Coordinate {
    /// Name, such as `theta`.
    pub name: String,
    /// Its symbol.
    pub symbol: SymbolId,
    /// Name of its velocity, such as `theta_dot`.
    pub velocity_name: String,
    /// Symbol of its velocity.
    pub velocity: SymbolId,
    /// Where it lives.
    pub domain: Domain,
    /// Documentation.
    pub doc: String,
}

/// A component of the velocity in the algebra.
#[derive(Clone, Debug, PartialEq)]
pub struct Velocity {
    /// Name, such as `Omega1`.
    pub name: String,
    /// Its symbol.
    pub symbol: SymbolId,
    /// Name of the vector it belongs to, such as `Omega`; its own name when it stands alone.
    pub block: String,
    /// Documentation.
    pub doc: String,
}

/// What decides which complement of an ideal is its level.
#[derive(Clone, Debug, PartialEq)]
pub enum InnerProduct {
    /// A symmetric matrix in the basis of the algebra.
    Matrix(Vec<Vec<ExprId>>),
    /// The kinetic energy: the Hessian of the Lagrangian in the velocities of the algebra.
    Lagrangian,
}

/// A name for the momenta `W^T dL/dy` along a velocity: of an unconstrained velocity, its momentum `dL/dy`.
#[derive(Clone, Debug, PartialEq)]
pub struct Momentum {
    /// Name, such as `Pi`.
    pub name: String,
    /// Name, symbol and velocity of its components; the velocity by index into base velocities, velocities in the
    /// algebra and quasi-velocities.
    pub components: Vec<(String, SymbolId, usize)>,
    /// Documentation.
    pub doc: String,
    /// Where it stands.
    pub span: Option<Span>,
}

/// What the state carries for a velocity.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Carried {
    /// The velocity, by index into base velocities, velocities in the algebra and quasi-velocities.
    pub velocity: usize,
    /// What stands for it.
    pub by: CarriedBy,
}

/// What stands for a velocity in the state.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CarriedBy {
    /// Itself.
    Velocity,
    /// With all others of the algebra, the variables along the levels of the stages: momenta along these stages, or
    /// elements `stage_1`, `stage_2`, .. of them, in ascending order, and velocities along the others.
    Levels(Vec<String>),
    /// Its momentum, under this name.
    Momentum(String),
    /// Nothing: its momentum is conserved, and the parameter of this name (Routh).
    Parameter(String),
}

/// A chain of ideals `g = n_0 > n_1 > ..` and the inner product that splits it.
#[derive(Clone, Debug, PartialEq)]
pub struct IdealChain {
    /// Names of `n_0, n_1, ..`.
    pub names: Vec<String>,
    /// Spanning vectors of `n_1, n_2, ..` in the basis of the algebra, in parameters only.
    pub ideals: Vec<Vec<Vec<ExprId>>>,
    /// The inner product; absent for the one in which the basis of the algebra is orthonormal.
    pub inner_product: Option<InnerProduct>,
    /// The sum of the connections of the stages, `A^a_i` by element and base coordinate, where there are any.
    pub connection: Option<Vec<Vec<ExprId>>>,
    /// What momenta along the levels are called, before the names of the stages.
    pub momentum: String,
    /// Where each stage stands.
    pub spans: Vec<Option<Span>>,
}

/// A parameter that the group moves: `adot = -xi . a` (left action).
#[derive(Clone, Debug, PartialEq)]
pub struct Advected {
    /// Name, such as `Gamma`.
    pub name: String,
    /// Names and symbols of its components.
    pub components: Vec<(String, SymbolId)>,
    /// The infinitesimal action `xi . a`, linear in the velocities.
    pub action: Vec<ExprId>,
    /// Documentation.
    pub doc: String,
    /// Where it stands.
    pub span: Option<Span>,
}

/// A connection that the generator can derive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ConnectionKind {
    /// `A = 0`: the velocity is the group velocity.
    Trivial,
    /// Horizontal means orthogonal to the group orbits in the kinetic energy.
    Mechanical,
    /// Horizontal means a virtual displacement, orthogonal in the kinetic energy to the vertical virtual displacements.
    Nonholonomic,
}

impl ConnectionKind {
    /// The kind of that name: `trivial`, `mechanical` or `nonholonomic`.
    pub fn from_name(name: &str) -> Option<ConnectionKind> {
        match name {
            "trivial" => Some(ConnectionKind::Trivial),
            "mechanical" => Some(ConnectionKind::Mechanical),
            "nonholonomic" => Some(ConnectionKind::Nonholonomic),
            _ => None,
        }
    }

    /// Its name in a model.
    pub fn name(self) -> &'static str {
        match self {
            ConnectionKind::Trivial => "trivial",
            ConnectionKind::Mechanical => "mechanical",
            ConnectionKind::Nonholonomic => "nonholonomic",
        }
    }
}

/// Quasi-velocities in the place of velocities: `y = T eta` for the velocities `y` before and `eta` of the model.
#[derive(Clone, Debug, PartialEq)]
pub struct QuasiFrame {
    /// Names and symbols of the velocities `y`, in the order of [`Model::all_velocities`].
    pub original: Vec<(String, SymbolId)>,
    /// `T`, the identity in the rows of velocities that stay.
    pub matrix: Vec<Vec<ExprId>>,
    /// The inverse of `T`: what the model declares.
    pub inverse: Vec<Vec<ExprId>>,
    /// Documentation of the quasi-velocities, in the order of [`Model::all_velocities`]; absent where a velocity stays.
    pub docs: Vec<Option<String>>,
    /// The determinant of the inverse, which vanishes nowhere; absent where it is too large to be written down.
    pub determinant: Option<ExprId>,
    /// Where the first quasi-velocity stands.
    pub span: Option<Span>,
}

/// A bracket of an algebroid, `[e_a, e_b] = value` for `a < b`.
#[derive(Clone, Debug, PartialEq)]
pub struct OwnBracket {
    /// `a`, `b`.
    pub pair: [usize; 2],
    /// Its components that do not vanish.
    pub value: Vec<(usize, ExprId)>,
    /// Where it stands.
    pub span: Option<Span>,
}

/// A Lie algebroid that the model declares over its base coordinates.
#[derive(Clone, Debug, PartialEq)]
pub struct OwnAlgebroid {
    /// Names of the sections `e_a` of its frame.
    pub basis: Vec<String>,
    /// Whether the bracket is not claimed to be that of a Lie algebroid.
    pub is_almost: bool,
    /// `rho^i_a`, `[n_base][m]`.
    pub anchor: Vec<Vec<ExprId>>,
    /// Brackets that do not vanish.
    pub brackets: Vec<OwnBracket>,
    /// Where it stands.
    pub span: Option<Span>,
}

/// What a model gives of the motion of a velocity in the place of a Lagrangian.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Given {
    /// The velocity as a function of the base and the time.
    Velocity(ExprId),
    /// Its rate.
    Acceleration(ExprId),
    /// Nothing: the constraints give it by the velocities that the model gives.
    Constrained,
}

/// How the rates of reconstructed coordinates follow from the motion.
///
/// `omega` and `v` are components of the group velocity `xi`, also where the velocities of the model are
/// `xi + A(x) xdot`.
#[derive(Clone, Debug, PartialEq)]
pub enum ReconstructionKind {
    /// SO(2): an angle.
    Angle {
        /// Its rate.
        omega: ExprId,
    },
    /// SO(3): a unit quaternion `w, x, y, z` that turns body vectors to space.
    Quaternion {
        /// Angular velocity.
        omega: [ExprId; 3],
    },
    /// SE(2): an angle and a position, `theta, x, y`.
    PlanarPose {
        /// Turning rate.
        omega: ExprId,
        /// Linear velocity.
        v: [ExprId; 2],
    },
    /// SE(3): a unit quaternion and a position, `qw, qx, qy, qz, r1, r2, r3`.
    Pose {
        /// Angular velocity.
        omega: [ExprId; 3],
        /// Linear velocity.
        v: [ExprId; 3],
    },
    /// R^n.
    Translation {
        /// Velocity.
        v: Vec<ExprId>,
    },
    /// A matrix group: the entries of the matrix, and vectors of the spaces of a semidirect product.
    Matrix {
        /// The group.
        group: Box<MatrixGroup>,
        /// The elements of the algebra of the model that are those of the group's, in its order.
        elements: Vec<usize>,
        /// The group velocity along them.
        xi: Vec<ExprId>,
    },
    /// Coordinates with given rates, which may contain coordinates that are reconstructed before, and several of
    /// them themselves.
    Rate {
        /// One per coordinate.
        rate: Vec<ExprId>,
    },
}

/// Coordinates of the group motion, computed where a scene asks for them.
#[derive(Clone, Debug, PartialEq)]
pub struct Reconstruction {
    /// Names in the text and how many coordinates each stands for: `q` for a quaternion's four, `x` for the one of that
    /// name.
    pub blocks: Vec<(String, usize)>,
    /// Names of the coordinates.
    pub names: Vec<String>,
    /// Their symbols.
    pub symbols: Vec<SymbolId>,
    /// How they move.
    pub kind: ReconstructionKind,
    /// Documentation.
    pub doc: String,
    /// Where it stands.
    pub span: Option<Span>,
}

/// A named number.
#[derive(Clone, Debug, PartialEq)]
pub struct Named {
    /// Name.
    pub name: String,
    /// Value.
    pub expr: ExprId,
    /// Documentation.
    pub doc: String,
}

/// A section of the velocities along which the model wants the momentum `<p, s> = s^a dL/dy^a`.
#[derive(Clone, Debug, PartialEq)]
pub struct VelocitySection {
    /// Name.
    pub name: String,
    /// `s^a`, one per velocity in the order of [`Model::all_velocities`]; functions on the base.
    pub coefficients: Vec<ExprId>,
    /// Documentation.
    pub doc: String,
    /// Where its name stands.
    pub span: Option<Span>,
}

/// A named number, vector or matrix.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedVector {
    /// Name.
    pub name: String,
    /// Names and values of the components.
    pub components: Vec<(String, ExprId)>,
    /// Documentation.
    pub doc: String,
    /// What it is in the model.
    pub part: OutputPart,
}

/// Which formulations a scene is searched for one that costs less.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FormulationSearch {
    /// Those whose state is the one that the scene writes down: `formulation auto;`.
    KeepingState,
    /// Also others: `formulation auto(state);`.
    AnyState,
}

/// A model with some parameters fixed and some outputs wanted.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// Name.
    pub name: String,
    /// Fixed parameters, by component.
    pub fixed: Vec<(String, Rational)>,
    /// Inputs that the scene takes, by component in the order of the model; the others are held at their defaults.
    pub inputs: Vec<String>,
    /// Wanted outputs.
    pub wants: Vec<Wanted>,
    /// Base coordinates and advected parameters that are left out, by component.
    pub drops: Vec<String>,
    /// Base coordinates, by component, that are carried as points of the circle.
    pub circles: Vec<String>,
    /// What the state carries, where that is not what the model says.
    pub carries: Vec<Carried>,
    /// Which formulations are searched for one that costs less; none for the one that the scene writes down.
    pub formulation: Option<FormulationSearch>,
    /// The discrete equations of motion, where the scene has them.
    pub discrete: Option<super::discrete::Discrete>,
    /// Documentation.
    pub doc: String,
    /// Where its name stands.
    pub span: Option<Span>,
    /// Where the whole of it stands, with its documentation.
    pub extent: Option<Span>,
    /// Where the names in it stand: fixed parameters, outputs, coordinates.
    pub places: BTreeMap<String, Span>,
}

/// Where items of a model stand in its text, for problems that show only when equations are derived.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Places {
    /// The Lagrangian or the Hamiltonian.
    pub lagrangian: Option<Span>,
    /// The inner product for the stages.
    pub inner_product: Option<Span>,
    /// The choice of independent velocities.
    pub independent: Option<Span>,
    /// The kind of a derived connection, or the first component of a given one.
    pub connection: Option<Span>,
    /// Casimirs and outputs by name.
    pub outputs: BTreeMap<String, Span>,
    /// Parameters, coordinates and everything else that declares a name, by that name.
    pub declared: BTreeMap<String, Span>,
    /// External forces by the velocity, vector or component, that they are written for.
    pub forces: BTreeMap<String, Span>,
    /// Accelerations and fields by the velocity, vector or component, that they are written for.
    pub given: BTreeMap<String, Span>,
    /// What stands for velocities in the state, by the velocity's name.
    pub carries: BTreeMap<String, Span>,
    /// Initial values by the variable, vector or component, that they are written for.
    pub initial: BTreeMap<String, Span>,
}

/// A checked model; every expression lives in [`Model::graph`].
#[derive(Clone, Debug)]
pub struct Model {
    /// Name, `snake_case`.
    pub name: String,
    /// Documentation, title first.
    pub doc: Vec<String>,
    /// Where the model comes from.
    pub sources: Vec<String>,
    /// What a list of models shows the model under.
    pub topic: Option<String>,
    /// Models that this one is the quotient of, as it says.
    pub totals: Vec<Total>,
    /// Files of the models that are parts of this one.
    pub parts: Vec<String>,
    /// Sizes of the text, for the values that it was read with.
    pub sizes: Vec<FamilySize>,
    /// Owner of all expressions.
    pub graph: Graph,
    /// The time `t`.
    pub time: SymbolId,
    /// Scalar parameters in the order of declaration.
    pub params: Vec<Param>,
    /// Which of them form vectors and matrices.
    pub param_arrays: Vec<ParamArray>,
    /// What moves the system from outside: numbers with the values that they are held at where none are given.
    pub inputs: Vec<Param>,
    /// Which of them form vectors and matrices.
    pub input_arrays: Vec<ParamArray>,
    /// Inputs that are white noise.
    pub noises: Vec<Noise>,
    /// Validity conditions on the parameters.
    pub conditions: Vec<Condition>,
    /// Base coordinates.
    pub base: Vec<Coordinate>,
    /// The symmetry algebra; of dimension zero when there is none.
    pub algebra: LieAlgebra<Number>,
    /// Velocities in the algebra, one per basis element.
    pub velocities: Vec<Velocity>,
    /// Velocities that only parametrise the constraints; they are not among [`Model::all_velocities`].
    pub quasi_velocities: Vec<Velocity>,
    /// Names of momenta.
    pub momenta: Vec<Momentum>,
    /// What the state carries, where that is not the velocity.
    pub carries: Vec<Carried>,
    /// Symmetries up to the rate of a function, whose momenta are parameters.
    pub quasi_invariances: Vec<QuasiInvariance>,
    /// Whether all functions of all scenes keep their digits: they carry rounding errors where they lose some.
    pub wants_digits: bool,
    /// Side of the group action.
    pub action: Side,
    /// Components `A^a_i(x, t)` of the principal connection: the velocities in the algebra are `xi + A(x, t) xdot`.
    pub connection: Option<Vec<Vec<ExprId>>>,
    /// A Lie algebroid over the base coordinates, which have no velocities beside [`Model::velocities`] then.
    pub algebroid: Option<OwnAlgebroid>,
    /// Quasi-velocities in the place of velocities. Infinitesimal actions on advected parameters and the connection are
    /// written in the velocities before, everything else in those of the model.
    pub frame: Option<QuasiFrame>,
    /// What gives the motion of every velocity, in the place of a Lagrangian.
    pub given: Option<Vec<Given>>,
    /// Reduction by stages.
    pub stages: Option<IdealChain>,
    /// Advected parameters.
    pub advected: Vec<Advected>,
    /// States of first order.
    pub first_order: Vec<FirstOrderState>,
    /// The reduced Lagrangian; zero where the model has a Hamiltonian.
    pub lagrangian: ExprId,
    /// The Hamiltonian `h(x, p, t)` in the place of a Lagrangian; every velocity has a momentum then.
    pub hamiltonian: Option<ExprId>,
    /// Constraints.
    pub constraints: Vec<Constraint>,
    /// A connection to be derived; the model is then written with the group velocity `xi` and the state holds
    /// `v = xi + A(x) xdot`.
    pub derived_connection: Option<ConnectionKind>,
    /// Accelerations that constraints of third order and conditions on displacements mention, by velocity, or none.
    pub accelerations: Vec<SymbolId>,
    /// Conditions on virtual displacements; when there are none, the constraints give them.
    pub virtual_constraints: Vec<VirtualConstraint>,
    /// Chosen independent velocities: indices into base velocities, velocities in the algebra, quasi-velocities.
    pub independent: Option<Vec<usize>>,
    /// Whether the multiplier form was asked for.
    pub force_multipliers: bool,
    /// External forces: one per base velocity, then one per velocity in the algebra.
    pub forces: Vec<ExprId>,
    /// Casimirs and other named numbers that should be conserved.
    pub casimirs: Vec<Named>,
    /// Named outputs, those of events after the model's own.
    pub outputs: Vec<NamedVector>,
    /// Modes, whose symbols are [`Model::first_order`].
    pub modes: Vec<Mode>,
    /// Symbols that stand for multipliers in functions of events, by the names of constraints.
    pub multipliers: Vec<(String, SymbolId)>,
    /// A function with the rate that an actuator gives it.
    pub lyapunov: Option<Lyapunov>,
    /// Events.
    pub events: Vec<Event>,
    /// Sections along which momenta are wanted.
    pub sections: Vec<VelocitySection>,
    /// Coordinates in groups, which expressions of the model may contain.
    pub configurations: Vec<Configuration>,
    /// Coordinates of the group motion.
    pub reconstruction: Vec<Reconstruction>,
    /// Default initial values of state variables and reconstructed coordinates, by component; in parameters only.
    pub initial: Vec<(String, ExprId)>,
    /// Scenes.
    pub scenes: Vec<Scene>,
    /// What figures show.
    pub views: Views,
    /// Where its items stand.
    pub places: Places,
    /// Units that doc comments say, and that follow from them; none for a model built in Rust.
    pub units: Units,
    /// Equations between coordinates that follow from [`Model::constraints`] and are left out.
    pub implied: Vec<Implied>,
    /// Equations that are left out, and declarations of a text without effect; rustc finds unused values of Rust.
    pub warnings: Diagnostics,
    /// The text, when the model was read from one.
    pub origin: Option<Origin>,
}

impl Model {
    /// Inputs that are no white noise: something drives them.
    pub fn controls(&self) -> impl Iterator<Item = &Param> {
        let is_noise = |input: &&Param| self.noises.iter().any(|noise| noise.symbol == input.symbol);
        self.inputs.iter().filter(move |input| !is_noise(input))
    }

    /// All velocities with their names: base velocities first, then those in the algebra.
    pub fn all_velocities(&self) -> Vec<(&str, SymbolId)> {
        let base = self.base[..self.n_shape()].iter().map(|c| (c.velocity_name.as_str(), c.velocity));
        base.chain(self.velocities.iter().map(|v| (v.name.as_str(), v.symbol))).collect()
    }

    /// How many base coordinates have a velocity of their own: all, or none where an algebroid moves them.
    pub fn n_shape(&self) -> usize {
        if self.algebroid.is_some() { 0 } else { self.base.len() }
    }

    /// An error of a later phase as a problem at the item of the text that causes it.
    pub fn diagnose(&self, error: &Error) -> Diagnostic {
        let (message, help) = error.message_and_help();
        diagnose(self, self.place_of(error), message, help)
    }

    fn place_of(&self, error: &Error) -> Option<Span> {
        let constraints = self.constraints.iter().map(|c| (&c.text, c.span));
        let conditions = self.virtual_constraints.iter().map(|v| (&v.text, v.span));
        match error {
            Error::SingularMassMatrix { .. }
            | Error::EquationLeft { .. }
            | Error::Undetermined { .. }
            | Error::OverBudget(_)
            | Error::OutOfRange { .. }
            | Error::DivisionByZero { .. } => self.places.lagrangian,
            Error::EventSets { event, .. } => self.places.outputs.get(event).copied(),
            Error::NotConserved { name, .. } | Error::ConservationUnverified { name, .. } => {
                self.places.outputs.get(name).copied()
            }
            Error::NotQuadratic { .. } => self.places.lagrangian,
            Error::NotCyclic { parameter, .. } => self.places.carries.get(parameter).copied(),
            Error::DependentConstraint { constraint }
            | Error::DependentPositions { constraint }
            | Error::NotGiven { constraint, .. }
            | Error::InconsistentConstraint { constraint } => {
                constraints.chain(conditions).find(|(text, _)| *text == constraint).and_then(|(_, span)| span)
            }
            Error::UndeterminedPositions { equations, .. } => constraints
                .chain(conditions)
                .find(|(text, _)| equations.contains(text))
                .and_then(|(_, span)| span),
            Error::NoResponse { .. } => self.constraints.first().and_then(|c| c.span),
            Error::NotSolvable { .. } | Error::WrongNumberOfIndependent { .. } | Error::NoMatching { .. } => {
                self.places.independent.or(self.constraints.first().and_then(|c| c.span))
            }
            Error::UndeterminedAcceleration { condition, .. } => {
                conditions.into_iter().find(|(text, _)| *text == condition).and_then(|(_, span)| span)
            }
            Error::WrongNumberOfDisplacements { .. } => self.virtual_constraints.first().and_then(|v| v.span),
            Error::InnerProductDependsOn { .. } => self.places.inner_product,
            Error::DegenerateInnerProduct { stage } => {
                self.places.inner_product.or_else(|| self.place_of_stage(stage))
            }
            Error::NotNested { stage, .. }
            | Error::NotAnIdeal { stage, .. }
            | Error::EmptyStage { stage } => self.place_of_stage(stage),
            Error::AnchorViolated { pair, .. } if self.algebroid.is_some() => self.place_of_bracket(pair),
            Error::JacobiViolated { triple, .. } if self.algebroid.is_some() => self.place_of_bracket(triple),
            Error::AnchorViolated { component, .. }
            | Error::Unverified { component: Some(component), .. } => {
                let moved = |a: &&Advected| a.components.iter().any(|(name, _)| name == component);
                self.advected.iter().find(moved).and_then(|a| a.span)
            }
            _ => None,
        }
    }

    fn place_of_stage(&self, stage: &str) -> Option<Span> {
        let stages = self.stages.as_ref()?;
        let at = stages.names.iter().position(|name| name == stage)?;
        stages.spans.get(at).copied().flatten()
    }

    /// The first bracket between some sections of the algebroid, or the algebroid.
    fn place_of_bracket(&self, sections: &[String]) -> Option<Span> {
        let own = self.algebroid.as_ref()?;
        let is_of = |k: &usize| own.basis.get(*k).is_some_and(|name| sections.contains(name));
        let found = own.brackets.iter().find(|bracket| bracket.pair.iter().all(is_of));
        found.and_then(|bracket| bracket.span).or(own.span)
    }

    /// Problems of a later phase, ready to be shown with the model's text.
    pub fn diagnostics(&self, problems: Vec<Diagnostic>) -> Diagnostics {
        Diagnostics::new(self.origin.clone(), problems)
    }
}

/// Names of the cosine and the sine that carry an angle as a point of the circle: `theta_c`, `theta_s`.
pub fn circle_names(angle: &str) -> [String; 2] {
    [format!("{angle}_c"), format!("{angle}_s")]
}

/// A problem that a later phase found, at a span of the model's text, which is dropped when the model has none. Show it
/// with [`Model::diagnostics`].
pub fn diagnose(
    model: &Model,
    span: Option<Span>,
    message: impl Into<String>,
    help: impl Into<Help>,
) -> Diagnostic {
    let span = span.filter(|_| model.origin.is_some());
    Diagnostic::new(span, message).with_help(help)
}
