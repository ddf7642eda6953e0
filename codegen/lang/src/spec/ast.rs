//! Syntax tree of a model file. Every node knows its bytes.

use std::collections::BTreeSet;

use super::diagnostic::Span;
use super::event::EventDirection;
use super::names::ALGEBRA_FUNCTIONS;
use hamel_expr::Rational;

/// A name and where it stands.
#[derive(Clone, Debug)]
pub(super) struct Name {
    pub(super) text: String,
    pub(super) span: Span,
}

/// An expression. Chains of `+` and of `*` are flat lists, so the depth of the tree is bounded by the parser's limit.
#[derive(Clone, Debug)]
pub(super) struct Expr {
    pub(super) node: Node,
    pub(super) span: Span,
}

#[derive(Clone, Debug)]
pub(super) enum Node {
    Number(Rational),
    Name(String),
    /// `(negative, operand)`; the first is never negative.
    Sum(Vec<(bool, Expr)>),
    /// `(divide, operand)`; the first never divides.
    Product(Vec<(bool, Expr)>),
    Neg(Box<Expr>),
    Power(Box<Expr>, Box<Expr>),
    Call(Name, Vec<Expr>),
    Index(Box<Expr>, Vec<Expr>),
    List(Vec<Expr>),
}

/// How the two sides of a condition compare.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Compare {
    /// `left < right`.
    Less,
    /// `left <= right`.
    LessEqual,
    /// `left > right`.
    Greater,
    /// `left >= right`.
    GreaterEqual,
    /// `left != right`.
    NotEqual,
}

/// `a < b < c`.
#[derive(Clone, Debug)]
pub(super) struct Comparison {
    pub(super) first: Expr,
    pub(super) rest: Vec<(Compare, Expr)>,
}

#[derive(Clone, Debug)]
pub(super) enum Shape {
    Scalar,
    Vector(Size),
    Diagonal(Size),
    Symmetric(Size),
    Matrix(Size, Size),
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Size {
    pub(super) value: usize,
    pub(super) span: Span,
}

/// An expression for an algebra or a representation: `so(3)`, `R^3`, `semidirect(so(3), standard)`.
#[derive(Clone, Debug)]
pub(super) struct AlgebraExpr {
    pub(super) node: AlgebraNode,
    pub(super) span: Span,
}

#[derive(Clone, Debug)]
pub(super) enum AlgebraNode {
    Name(String),
    Number(usize),
    Power(usize),
    Call(Name, Vec<AlgebraExpr>),
}

#[derive(Clone, Debug)]
pub(super) enum DomainExpr {
    Interval(Expr, Expr),
    Angle,
    Real,
}

#[derive(Clone, Debug)]
pub(super) struct Item {
    pub(super) doc: Vec<String>,
    /// With its documentation.
    pub(super) extent: Span,
    pub(super) span: Span,
    pub(super) kind: ItemKind,
    /// The mode that it stands in.
    pub(super) mode: Option<Name>,
}

#[derive(Clone, Debug)]
pub(super) struct BracketRule {
    pub(super) left: Name,
    pub(super) right: Name,
    pub(super) value: Expr,
    pub(super) span: Span,
}

/// A model that this one is the quotient of, with functions of it for variables of this one.
#[derive(Clone, Debug)]
pub(super) struct ReducesItem {
    pub(super) file: Name,
    pub(super) images: Vec<(Name, Expr)>,
}

/// A model that is a part of this one, with values for parameters and inputs of it.
#[derive(Clone, Debug)]
pub(super) struct UseItem {
    pub(super) file: Name,
    pub(super) name: Name,
    pub(super) given: Vec<(Name, Expr)>,
}

/// A quasi-velocity of a frame, with its documentation.
#[derive(Clone, Debug)]
pub(super) struct FrameVelocity {
    pub(super) doc: Vec<String>,
    pub(super) name: Name,
    pub(super) value: Expr,
}

/// A Lie algebroid over the base coordinates, as it is written.
#[derive(Clone, Debug)]
pub(super) struct AlgebroidBlock {
    /// Where the word `algebroid` stands.
    pub(super) span: Span,
    pub(super) is_almost: bool,
    pub(super) basis: Vec<Name>,
    pub(super) velocities: Vec<Name>,
    /// Rates of coordinates.
    pub(super) anchors: Vec<(Name, Expr)>,
    pub(super) rules: Vec<BracketRule>,
}

/// An event, as it is written.
#[derive(Clone, Debug)]
pub(super) struct EventItem {
    pub(super) name: Name,
    /// The function whose changes of sign it is.
    pub(super) value: Expr,
    pub(super) direction: EventDirection,
    /// What it sets, and to what.
    pub(super) sets: Vec<(Name, Expr)>,
    /// What it does to modes.
    pub(super) acts: Vec<Act>,
    /// Where it says that it ends the motion.
    pub(super) stop: Option<Span>,
}

/// What an event does to a mode, as it is written.
#[derive(Clone, Debug)]
pub(super) enum Act {
    Enter(Name),
    Leave(Name),
    /// `impact foot with e;`
    Impact(Name, Option<Expr>),
}

/// A body, as it is written.
#[derive(Clone, Debug)]
pub(super) struct BodyItem {
    pub(super) name: Name,
    /// The frame in the axes of which place and attitude are.
    pub(super) on: Option<Name>,
    pub(super) mass: Option<Expr>,
    pub(super) inertia: Option<Expr>,
    /// The place of its mass centre.
    pub(super) place: Option<Expr>,
    /// The attitude of the frame in which the inertia is.
    pub(super) attitude: Option<Expr>,
    /// What a loop calls it, with the indices; the name for a body outside of loops.
    pub(super) parts: Vec<(BodyPart, Name)>,
}

/// What a body declares.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum BodyPart {
    /// `p'`, of the mass centre.
    Velocity,
    /// Angular velocity in the body's frame.
    Spin,
    /// `m p'`.
    Momentum,
    /// `I w` in the body's frame.
    AngularMomentum,
    /// Kinetic energy.
    Energy,
}

impl BodyPart {
    /// All of them, longer endings before those that they end with.
    pub(super) const ALL: [BodyPart; 5] =
        [BodyPart::Velocity, BodyPart::Spin, BodyPart::AngularMomentum, BodyPart::Momentum, BodyPart::Energy];

    /// What follows the name of the body.
    pub(super) const fn ending(self) -> &'static str {
        match self {
            BodyPart::Velocity => "_velocity",
            BodyPart::Spin => "_spin",
            BodyPart::Momentum => "_momentum",
            BodyPart::AngularMomentum => "_angular_momentum",
            BodyPart::Energy => "_energy",
        }
    }
}

impl BodyItem {
    /// The expressions of the item.
    pub(super) fn expressions(&self) -> impl Iterator<Item = &Expr> {
        [&self.mass, &self.inertia, &self.place, &self.attitude].into_iter().flatten()
    }
}

#[derive(Clone, Debug)]
pub(super) enum ItemKind {
    Source(String),
    Topic(String),
    Reduces(ReducesItem),
    /// `use "motor.hamel" as motor { k = 2; }`
    Use(UseItem),
    /// `part motor "motor.hamel" { .. }`; its items follow.
    Part {
        name: Name,
        file: Name,
    },
    /// `size n = 5;`
    Size {
        name: Name,
        value: i64,
        /// Where the value stands.
        place: Span,
    },
    Param {
        name: Name,
        shape: Shape,
        default: Option<Expr>,
        conditions: Vec<Comparison>,
    },
    /// `input tau: vector(2) = [0, 0];`
    Input {
        name: Name,
        shape: Shape,
        default: Option<Expr>,
    },
    /// `noise W: h;`, or `noise W;` for one that the model mentions.
    Noise {
        name: Name,
        value: Option<Expr>,
    },
    /// `drive tau = [sin(t), 0];`
    Drive {
        name: Name,
        value: Expr,
    },
    Require(Vec<Comparison>),
    Let {
        name: Name,
        value: Expr,
    },
    AlgebraName {
        name: Name,
        value: AlgebraExpr,
    },
    /// `algebra g { .. }`, or `almost algebra g { .. }` without the Jacobi identity.
    AlgebraBrackets {
        name: Name,
        is_almost: bool,
        basis: Vec<Name>,
        rules: Vec<BracketRule>,
    },
    Representation {
        name: Name,
        algebra: AlgebraExpr,
        dim: Size,
        matrices: Vec<(Name, Expr)>,
    },
    QuasiVelocity(Vec<Name>),
    /// `frame { u = r*phi_dot; }`
    Frame(Vec<FrameVelocity>),
    /// `algebroid { basis ..; velocities ..; anchor ..; [a, b] = ..; }`
    Algebroid(AlgebroidBlock),
    /// `acceleration v = -k*x;`
    Acceleration {
        name: Name,
        value: Expr,
    },
    /// `field x_dot = -x;`
    Field {
        name: Name,
        value: Expr,
    },
    Connection {
        name: Name,
        value: Expr,
    },
    /// `connection mechanical;`
    DerivedConnection(Name),
    Velocity {
        names: Vec<Name>,
        algebra: AlgebraExpr,
        labels: Vec<Name>,
    },
    /// `momentum Pi of Omega;`
    Momentum {
        name: Name,
        velocity: Name,
    },
    /// `momentum Pi in so(3);`
    MomentumIn {
        names: Vec<Name>,
        algebra: AlgebraExpr,
        labels: Vec<Name>,
    },
    Carry(Vec<Carry>),
    /// `want digits;` of all scenes.
    Want(Vec<Name>),
    Action(Name),
    Stage {
        name: Name,
        ideal: Option<Vec<Expr>>,
        connections: Vec<(Name, Expr)>,
    },
    InnerProduct(Expr),
    /// `inner_product = lagrangian;`
    LagrangianInnerProduct,
    /// `coordinate a in angle;`, or `coordinate a in angle by f(a, b) = 0;`.
    Coordinate {
        names: Vec<Name>,
        shape: Shape,
        domain: DomainExpr,
        by: Option<(Expr, Expr)>,
    },
    /// `advected a in space as a_* by action;`, the space being `R^n`, an algebra or `dual(algebra)`.
    Advected {
        name: Name,
        space: AlgebraExpr,
        labels: Vec<Name>,
        action: Expr,
    },
    /// `state i in real by i_dot = rate;`
    State {
        name: Name,
        shape: Shape,
        domain: DomainExpr,
        /// The name of the rate, and its value.
        rate: (Name, Expr),
    },
    Lagrangian(Expr),
    Hamiltonian(Expr),
    /// `constraint name for v, w: left = right;`
    Constraint {
        name: Option<Name>,
        gives: Vec<Name>,
        left: Expr,
        right: Expr,
    },
    Virtual {
        name: Option<Name>,
        left: Expr,
        right: Expr,
    },
    VirtualThermo,
    Independent(Vec<Name>),
    Multipliers,
    Force {
        name: Name,
        value: Expr,
    },
    /// `body B { mass m; inertia I; place p; attitude R; }`
    Body(BodyItem),
    /// `frame tool on wrist at p attitude R`
    NamedFrame {
        name: Name,
        on: Option<Name>,
        at: Option<Expr>,
        attitude: Option<Expr>,
    },
    /// `force at p: F;`, `force along u: F;`
    AppliedForce {
        /// Whether it is a place that stands behind the word, and no velocity.
        is_place: bool,
        on: Expr,
        value: Expr,
    },
    /// `actuate u along x_dot;`
    Actuate {
        name: Name,
        along: Expr,
    },
    /// `lyapunov V = function rate -k*dV_du^2;`
    Lyapunov {
        name: Name,
        function: Expr,
        rate: Option<Expr>,
    },
    Casimir {
        name: Name,
        value: Expr,
    },
    Output {
        name: Name,
        value: Expr,
    },
    /// `section s = [1, 0, x];`, `section s in so(3) = Gamma;`
    Section {
        name: Name,
        algebra: Option<AlgebraExpr>,
        value: Expr,
    },
    /// `mode stance { .. }`; its items follow.
    Mode(Name),
    /// `event impact = z falling { then v = -e*v; }`
    Event(EventItem),
    /// `configuration R, r in SE(3) velocity Omega, V;`, `configuration R in SO(3) from Omega;`
    Configuration {
        names: Vec<Name>,
        group: AlgebraExpr,
        by: MovedBy,
        /// `relative Omega`: the velocities that move it from the other side.
        relative: Vec<Name>,
    },
    Reconstruct {
        names: Vec<Name>,
        way: ReconstructWay,
    },
    Initial {
        name: Name,
        value: Expr,
    },
    View {
        name: Name,
        shape: Name,
        arguments: Vec<Expr>,
        around: Option<Expr>,
        at: Option<Expr>,
        attitude: Option<Expr>,
    },
    Scene {
        name: Name,
        fixed: Vec<(Name, Expr)>,
        inputs: Vec<Name>,
        wants: Vec<Name>,
        drops: Vec<Name>,
        circles: Vec<Name>,
        /// `formulation auto;`, `formulation auto(state);`: the word and what stands in parentheses.
        formulation: Vec<(Name, Option<Name>)>,
        carries: Vec<Carry>,
        /// `discrete midpoint;` and `retraction cayley;`: the names behind both words.
        discrete: Vec<Name>,
        retraction: Vec<Name>,
    },
}

/// What a state carries: `carry Pi;`, `routh phi = p;`, `routh phi = p up to f;`, `routh Omega -> Pi;`.
#[derive(Clone, Debug)]
pub(super) enum Carry {
    /// The momenta or the velocities of that name.
    Named(Name),
    /// The momentum of a cyclic coordinate or velocity, less a function, is a parameter.
    Level { cyclic: Name, parameter: Name, up_to: Option<Expr> },
    /// The momenta of a velocity.
    Momenta { velocity: Name, momentum: Name },
}

/// The velocities that move a configuration.
#[derive(Clone, Debug)]
pub(super) enum MovedBy {
    /// The item declares them.
    Own(Vec<Name>),
    /// Declared ones; an empty list stands for all velocities of the algebra.
    Declared(Vec<Name>),
}

#[derive(Clone, Debug)]
pub(super) enum ReconstructWay {
    /// `in SE(2) from omega, v`; no names for all velocities of the algebra.
    Group { group: AlgebraExpr, from: Vec<Name> },
    /// `by psi_dot`.
    Rate(Expr),
}

#[derive(Clone, Debug)]
pub(super) struct File {
    pub(super) doc: Vec<String>,
    pub(super) name: Name,
    /// With loops written out, unless they were read once.
    pub(super) items: Vec<Item>,
    /// Indices of loops, each with where it is known.
    pub(super) indices: Vec<(Name, Span)>,
    /// Names that are declared with an index.
    pub(super) families: BTreeSet<String>,
}

impl AlgebraExpr {
    /// Names in the expression. Its depth is bounded by the parser.
    pub(super) fn names(&self) -> Vec<String> {
        match &self.node {
            AlgebraNode::Name(name) => vec![name.clone()],
            AlgebraNode::Number(_) | AlgebraNode::Power(_) => Vec::new(),
            AlgebraNode::Call(_, arguments) => arguments.iter().flat_map(AlgebraExpr::names).collect(),
        }
    }
}

impl Expr {
    /// Names in the expression, without function names.
    pub(super) fn names(&self) -> Vec<&str> {
        let mut names = Vec::new();
        self.for_each_node(|node| {
            if let Node::Name(name) = node {
                names.push(name.as_str());
            }
        });
        names
    }

    /// Names of algebras in the expression: what functions of an algebra have for their first argument.
    pub(super) fn algebra_names(&self) -> Vec<&str> {
        let mut names = Vec::new();
        self.for_each_node(|node| {
            if let Node::Call(function, arguments) = node
                && ALGEBRA_FUNCTIONS.contains(&function.text.as_str())
                && let Some(Expr { node: Node::Name(name), .. }) = arguments.first()
            {
                names.push(name.as_str());
            }
        });
        names
    }

    /// Whether the expression calls a function by name.
    pub(super) fn calls(&self, function: &str) -> bool {
        let mut found = false;
        self.for_each_node(|node| found |= matches!(node, Node::Call(name, _) if name.text == function));
        found
    }

    /// Whether an argument of a function, by name, calls it once more.
    pub(super) fn nests(&self, function: &str) -> bool {
        let mut found = false;
        self.for_each_node(|node| {
            let Node::Call(name, arguments) = node else { return };
            found |= name.text == function && arguments.iter().any(|a| a.calls(function));
        });
        found
    }

    fn for_each_node<'a>(&'a self, mut visit: impl FnMut(&'a Node)) {
        let mut pending = vec![self];
        while let Some(expr) = pending.pop() {
            visit(&expr.node);
            match &expr.node {
                Node::Number(_) | Node::Name(_) => {}
                Node::Sum(list) | Node::Product(list) => pending.extend(list.iter().map(|(_, e)| e)),
                Node::Neg(inside) => pending.push(inside),
                Node::Power(a, b) => pending.extend([a.as_ref(), b.as_ref()]),
                Node::Call(_, arguments) => pending.extend(arguments),
                Node::Index(base, indices) => {
                    pending.push(base);
                    pending.extend(indices);
                }
                Node::List(list) => pending.extend(list),
            }
        }
    }
}
