//! The builder: what is declared so far, its names, graph and problems.
//!
//! Deliberately does not know: items, checks.

use std::collections::{BTreeMap, BTreeSet};

use super::event_drafts::EventDraft;
pub(super) use super::event_drafts::Located;
use super::feedback_drafts::FeedbackDraft;
use crate::algebra::LieAlgebra;
use crate::spec::diagnostic::{Diagnostic, Help, Span};
use crate::spec::group::Group;
use crate::spec::matrix_group::MatrixGroup;
use crate::spec::model::*;
use crate::spec::names;
use crate::spec::shape::ValueError;
use crate::spec::size::FamilySize;
use crate::spec::total::Total;
use crate::spec::value::Value;
use crate::spec::view::View;
use hamel_expr::error::Error;
use hamel_expr::{Budget, ExprId, Graph, Number, Rational, SymbolId};

/// What a name is declared as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::spec) enum DeclaredAs {
    Parameter,
    ParameterComponent,
    Input,
    InputComponent,
    Velocity,
    VelocityComponent,
    Coordinate,
    CoordinateVelocity,
    Advected,
    AdvectedComponent,
    FirstOrder,
    FirstOrderComponent,
    QuasiVelocity,
    Momentum,
    MomentumComponent,
    Reconstructed,
    Definition,
    FrameVelocity,
    Section,
    CarriedAcceleration,
    Levels,
    Size,
    Mode,
    Multiplier,
    Actuator,
    Response,
}

impl DeclaredAs {
    pub(super) fn words(self) -> &'static str {
        match self {
            DeclaredAs::Parameter => "a parameter",
            DeclaredAs::ParameterComponent => "a component of a parameter",
            DeclaredAs::Input => "an input",
            DeclaredAs::InputComponent => "a component of an input",
            DeclaredAs::Velocity => "a velocity",
            DeclaredAs::VelocityComponent => "a component of a velocity",
            DeclaredAs::Coordinate => "a coordinate",
            DeclaredAs::CoordinateVelocity => "the velocity of a coordinate",
            DeclaredAs::Advected => "an advected parameter",
            DeclaredAs::AdvectedComponent => "a component of an advected parameter",
            DeclaredAs::FirstOrder => "a state of first order",
            DeclaredAs::FirstOrderComponent => "a component of a state of first order",
            DeclaredAs::QuasiVelocity => "a quasi-velocity",
            DeclaredAs::Momentum => "a momentum",
            DeclaredAs::MomentumComponent => "a component of a momentum",
            DeclaredAs::Reconstructed => "a reconstructed coordinate",
            DeclaredAs::Definition => "a definition",
            DeclaredAs::FrameVelocity => "a quasi-velocity of the frame",
            DeclaredAs::Levels => "the momenta along the levels of stages",
            DeclaredAs::Size => "a size",
            DeclaredAs::Mode => "a mode",
            DeclaredAs::Multiplier => "the multiplier of a constraint",
            DeclaredAs::Actuator => "the force of an actuator",
            DeclaredAs::Response => "what a function has from the force of an actuator",
            DeclaredAs::Section => "a basis element of the algebroid",
            DeclaredAs::CarriedAcceleration => "the acceleration along a constraint of third order",
        }
    }

    /// What to change where a name is declared twice, once so and once as `other`.
    fn help_against(self, other: DeclaredAs) -> &'static str {
        use DeclaredAs::{
            AdvectedComponent, CoordinateVelocity, FirstOrderComponent, InputComponent, MomentumComponent,
            ParameterComponent, VelocityComponent,
        };
        match (self, other) {
            (CoordinateVelocity, _) | (_, CoordinateVelocity) => {
                "rename one of them; a coordinate `q` declares `q_dot` too"
            }
            (
                ParameterComponent | InputComponent | VelocityComponent | AdvectedComponent
                | FirstOrderComponent | MomentumComponent,
                _,
            )
            | (
                _,
                ParameterComponent | InputComponent | VelocityComponent | AdvectedComponent
                | FirstOrderComponent | MomentumComponent,
            ) => "rename one of them; a vector `v` declares `v1`, `v2`, .. too",
            _ => "rename one of them",
        }
    }
}

#[derive(Clone, Debug)]
pub(super) struct Declared {
    pub(super) span: Option<Span>,
    pub(super) what: DeclaredAs,
}

#[derive(Clone, Debug)]
pub(super) struct StageDraft {
    pub(super) name: String,
    pub(super) ideal: Option<Vec<Value>>,
    pub(super) span: Option<Span>,
}

#[derive(Clone, Debug)]
pub(super) struct AdvectedDraft {
    pub(super) name: String,
    pub(super) value: Value,
    pub(super) components: Vec<(String, SymbolId)>,
    pub(super) action: Option<(Value, Option<Span>)>,
    pub(super) doc: String,
    pub(super) span: Option<Span>,
}

/// A group whose elements are coordinates.
#[derive(Clone, Debug)]
pub(super) struct ConfigurationDraft {
    pub(super) group: Box<MatrixGroup>,
    /// The advected parameter that its coordinates are.
    pub(super) advected: usize,
    /// The elements of the algebra of the model for each element of the group's.
    pub(super) velocities: Vec<usize>,
    /// Elements that move the frame it is told in; empty for space.
    pub(super) relative: Vec<usize>,
    /// The matrices and vectors.
    pub(super) values: Vec<Value>,
}

/// White noise, and the Hamiltonian that it multiplies.
#[derive(Clone, Debug)]
pub(super) struct NoiseDraft {
    pub(super) name: String,
    pub(super) hamiltonian: Option<(Value, Option<Span>)>,
    pub(super) span: Option<Span>,
}

/// A state of first order.
#[derive(Clone, Debug)]
pub(super) struct FirstOrderDraft {
    pub(super) name: String,
    pub(super) components: Vec<(String, SymbolId)>,
    pub(super) domain: Domain,
    pub(super) rate: Option<(Value, Option<Span>)>,
    pub(super) doc: String,
    pub(super) span: Option<Span>,
}

/// A force with what it acts on.
#[derive(Clone, Debug)]
pub(super) struct AppliedForce {
    /// The velocity that it is paired with, by the velocities of the model.
    pub(super) velocity: Value,
    pub(super) force: Value,
    pub(super) span: Option<Span>,
}

#[derive(Clone, Debug)]
pub(super) struct ConstraintDraft {
    pub(super) name: Option<String>,
    /// The velocities that the components are solved for, one after the other.
    pub(super) gives: Vec<Located>,
    pub(super) text: String,
    pub(super) left: Value,
    pub(super) right: Value,
    /// The mode that it belongs to.
    pub(super) mode: Option<usize>,
    pub(super) span: Option<Span>,
}

#[derive(Clone, Debug)]
pub(super) struct SceneDraft {
    pub(super) scene: Scene,
    pub(super) fixed: Vec<(String, Vec<Rational>, Option<Span>)>,
    pub(super) inputs: Vec<Located>,
    pub(super) wants: Vec<Located>,
    pub(super) drops: Vec<Located>,
    pub(super) circles: Vec<Located>,
    pub(super) carries: Vec<CarryDraft>,
}

/// A frame beside the frame that it is on: place and rotation in the axes of that, and its motion against it.
#[derive(Clone, Debug)]
pub(in crate::spec) struct NamedFrameDraft {
    /// `frame`, or `body` for the frame of one.
    pub(in crate::spec) what: &'static str,
    pub(in crate::spec) name: String,
    pub(in crate::spec) on: Option<(String, Option<Span>)>,
    pub(in crate::spec) motion: FrameMotion,
    pub(in crate::spec) doc: String,
    pub(in crate::spec) span: Option<Span>,
}

/// A body, for what all bodies are together.
#[derive(Clone, Debug)]
pub(in crate::spec) struct BodyDraft {
    /// Its own frame, with the mass centre as origin.
    pub(in crate::spec) frame: NamedFrameDraft,
    /// The rate of its place, where that is shorter than the velocity in its own axes.
    pub(in crate::spec) rate: Option<[ExprId; 3]>,
    /// Zero for a body without one.
    pub(in crate::spec) mass: ExprId,
    /// About the mass centre, in the body's axes.
    pub(in crate::spec) inertia: [[ExprId; 3]; 3],
}

/// How a frame moves against the frame that it is on.
#[derive(Clone, Debug)]
pub(in crate::spec) enum FrameMotion {
    /// `p`, `R`, and in the axes of the frame `R^T p'` and `w` with `hat(w) = R^T R'`.
    Given { place: [ExprId; 3], rotation: [[ExprId; 3]; 3], velocity: [ExprId; 3], spin: [ExprId; 3] },
    /// The frame of the group, whose coordinates are reconstructed: their symbols.
    OfGroup { place: [ExprId; 3], rotation: [[ExprId; 3]; 3], symbols: Vec<SymbolId> },
}

/// A quasi-velocity of the frame.
#[derive(Clone, Debug)]
pub(super) struct FrameDraft {
    pub(super) name: String,
    pub(super) symbol: SymbolId,
    pub(super) value: ExprId,
    pub(super) doc: String,
    pub(super) span: Option<Span>,
}

/// The algebroid of the model.
#[derive(Clone, Debug)]
pub(super) struct AlgebroidDraft {
    pub(super) basis: Vec<String>,
    pub(super) is_almost: bool,
    pub(super) span: Option<Span>,
    /// Rates of coordinates, by the name of the rate.
    pub(super) rates: Vec<(String, Value, Option<Span>)>,
    /// `[n_base][m]`, once it is known.
    pub(super) anchor: Option<Vec<Vec<ExprId>>>,
    pub(super) brackets: Vec<OwnBracket>,
}

/// A section along which the model wants the momentum.
#[derive(Clone, Debug)]
pub(super) struct SectionDraft {
    pub(super) name: String,
    /// The algebra that it has values in; none for coefficients of all velocities.
    pub(super) algebra: Option<LieAlgebra<Number>>,
    pub(super) value: Value,
    pub(super) doc: String,
    /// Where its name stands.
    pub(super) span: Option<Span>,
    /// Where its value stands.
    pub(super) of_value: Option<Span>,
}

/// What the model gives of the motion of a velocity.
#[derive(Clone, Debug)]
pub(super) struct GivenDraft {
    pub(super) is_acceleration: bool,
    pub(super) name: String,
    pub(super) value: Value,
    pub(super) span: Option<Span>,
}

impl GivenDraft {
    /// Where it stands, by the name of its velocity.
    pub(super) fn place(&self) -> Option<(String, Span)> {
        Some((self.name.clone(), self.span?))
    }

    pub(super) fn item(&self) -> &'static str {
        if self.is_acceleration { "acceleration" } else { "field" }
    }
}

/// What a state carries, in the names of the text.
#[derive(Clone, Debug)]
pub(in crate::spec) enum CarryDraft {
    /// The momenta or the velocities of that name.
    Named(Located),
    /// The momentum of a cyclic coordinate or velocity, less a function, is a parameter.
    Level { cyclic: Located, parameter: Located, up_to: Option<(Value, Option<Span>)> },
    /// The momenta of a velocity.
    Momenta { velocity: Located, momentum: Located },
}

#[derive(Clone, Debug)]
pub(super) enum Way {
    /// Names of velocities; none for all of the algebra.
    Group(Group, Vec<Located>),
    Rate(Vec<ExprId>),
}

#[derive(Clone, Debug)]
pub(in crate::spec) struct ReconstructionDraft {
    pub(super) blocks: Vec<(String, usize)>,
    pub(super) names: Vec<String>,
    pub(super) symbols: Vec<SymbolId>,
    pub(super) way: Way,
    pub(super) doc: String,
    pub(super) span: Option<Span>,
}

/// Builds a [`Model`] from Rust; [`parse`](crate::spec::parse) uses it too, so both report the same errors.
///
/// Declarations return the [`Value`] of what they declare. Problems are collected and reported by
/// [`ModelBuilder::build`], all at once.
///
/// What a text says by loops, `let`, `rot`, `spin` and `body`, Rust says by loops, variables and functions: such a
/// model is made of [`ModelBuilder::rate`], products and sums.
///
/// ```
/// use hamel_lang::spec::{Domain, Func, Graph, ModelBuilder, Rational, Value};
///
/// /// `rot(phi)` of the text.
/// fn rot(g: &mut Graph, phi: &Value) -> Value {
///     let (c, s) = (phi.func(g, Func::Cos).unwrap(), phi.func(g, Func::Sin).unwrap());
///     let minus_s = s.neg(g);
///     let rows = [[c.clone(), minus_s], [s, c]].map(|row| Value::list(row.to_vec()).unwrap());
///     Value::list(rows.to_vec()).unwrap()
/// }
///
/// /// `B_energy` of a point with a mass in the text.
/// fn energy(b: &mut ModelBuilder, mass: i64, place: &Value) -> Value {
///     let u = b.rate(place).unwrap();
///     let g = b.graph();
///     let half = Value::number(g, Rational::new(mass.into(), 2.into()));
///     u.dot(g, &u).unwrap().mul(g, &half).unwrap()
/// }
///
/// let mut b = ModelBuilder::new("pendulums");
/// let (mut place, mut lagrangian) = (None, None);
/// for k in 1..=3 {
///     let (phi, _) = b.coordinate(&format!("phi{k}"), Domain::Angle, "");
///     let g = b.graph();
///     let rod = Value::list([0, -1].map(|n| Value::number(g, Rational::from_integer(n.into()))).to_vec()).unwrap();
///     let rod = rot(g, &phi).mul(g, &rod).unwrap();
///     let end = place.map_or(Ok(rod.clone()), |p: Value| p.add(g, &rod)).unwrap();
///     let own = energy(&mut b, 2, &end);
///     lagrangian = Some(lagrangian.map_or(Ok(own.clone()), |sum: Value| sum.add(b.graph(), &own)).unwrap());
///     place = Some(end);
/// }
/// b.lagrangian(&lagrangian.unwrap());
/// assert_eq!(b.build().unwrap().base.len(), 3);
/// ```
///
/// ```
/// use hamel_lang::spec::{Layout, LieAlgebra, ModelBuilder, Rational, Value};
///
/// let mut b = ModelBuilder::new("free_rigid_body");
/// let [i1, i2, i3] = [2, 3, 4].map(|n| Rational::from_integer(n.into()));
/// let inertia = b.param_array("I", Layout::Diagonal(3), &[i1, i2, i3], "moments of inertia [kg m^2]");
/// let omega = b.velocities(LieAlgebra::so(3).unwrap(), &["Omega"]).remove(0);
/// let g = b.graph();
/// let momentum = inertia.mul(g, &omega).unwrap();
/// let half = Value::number(g, Rational::new(1.into(), 2.into()));
/// let energy = omega.dot(g, &momentum).unwrap().mul(g, &half).unwrap();
/// b.lagrangian(&energy);
/// let model = b.build().unwrap();
/// assert_eq!(model.velocities[2].name, "Omega3");
/// ```
#[derive(Clone, Debug)]
pub struct ModelBuilder {
    pub(in crate::spec) graph: Graph,
    pub(in crate::spec) values: BTreeMap<String, Value>,
    pub(in crate::spec) problems: Vec<Diagnostic>,
    pub(super) here: Option<Span>,
    pub(super) names: BTreeMap<String, Declared>,
    /// Whether other models will give it the inertia that it may lack.
    pub(in crate::spec) is_part: bool,
    /// Items that were written but are broken: nothing is said about them being absent.
    pub(in crate::spec) broken: BTreeSet<&'static str>,
    /// Where the model is named; what is missing is reported there.
    pub(in crate::spec) place: Option<Span>,
    pub(super) name: String,
    pub(super) doc: Vec<String>,
    pub(super) sources: Vec<String>,
    pub(super) totals: Vec<Total>,
    pub(super) topic: Option<(String, Option<Span>)>,
    pub(super) sizes: Vec<FamilySize>,
    pub(super) time: SymbolId,
    pub(super) params: Vec<Param>,
    pub(super) param_arrays: Vec<ParamArray>,
    pub(super) blocks: BTreeMap<String, Vec<usize>>,
    pub(super) inputs: Vec<Param>,
    pub(super) input_arrays: Vec<ParamArray>,
    /// Values of inputs in the place of arguments: the name and where it stands, the value and where.
    pub(super) drives: Vec<(Located, Value, Option<Span>)>,
    /// Positions of inputs, by the name of a component or of a vector.
    pub(super) input_blocks: BTreeMap<String, Vec<usize>>,
    pub(super) noises: Vec<NoiseDraft>,
    pub(super) conditions: Vec<Condition>,
    pub(super) base: Vec<Coordinate>,
    pub(in crate::spec) algebra: Option<(LieAlgebra<Number>, Option<Span>)>,
    pub(in crate::spec) velocities: Vec<Velocity>,
    pub(super) action: Option<(Side, Option<Span>)>,
    pub(super) quasi_velocities: Vec<Velocity>,
    pub(super) frame_velocities: Vec<FrameDraft>,
    /// The frame, and the velocities of the algebra before it.
    pub(super) frame: Option<(QuasiFrame, Vec<Velocity>)>,
    /// Values of velocities that the frame replaces or an anchor gives.
    pub(super) images: Vec<ExprId>,
    pub(super) algebroid: Option<AlgebroidDraft>,
    /// Rates in the place of a Lagrangian.
    pub(super) given: Vec<GivenDraft>,
    pub(super) momenta: Vec<Momentum>,
    pub(super) wants_digits: bool,
    pub(super) carries: Vec<CarryDraft>,
    pub(super) connection: Vec<(String, Value, Option<Span>)>,
    pub(super) derived_connection: Option<(ConnectionKind, Option<Span>)>,
    /// Displacements and accelerations by their velocity, made when they are used.
    pub(super) displacements: BTreeMap<SymbolId, SymbolId>,
    pub(super) accelerations: BTreeMap<SymbolId, SymbolId>,
    /// Rates of accelerations, by the velocity.
    pub(super) jerks: BTreeMap<SymbolId, SymbolId>,
    /// Symbols and names of the accelerations that the state has for constraints of third order.
    pub(super) carried_accelerations: Vec<(SymbolId, String)>,
    pub(super) stages: Vec<StageDraft>,
    /// What momenta along levels are called.
    pub(super) level_momentum: Option<(String, Option<Span>)>,
    /// A matrix, or none for the metric of the Lagrangian.
    pub(super) inner_product: Option<(Option<Value>, Option<Span>)>,
    /// Connections of stages: by stage and velocity.
    pub(super) stage_connections: Vec<(String, String, Value, Option<Span>)>,
    pub(super) advected: Vec<AdvectedDraft>,
    pub(super) configurations: Vec<ConfigurationDraft>,
    pub(super) first_order: Vec<FirstOrderDraft>,
    pub(super) lagrangian: Option<(Value, Option<Span>)>,
    pub(super) hamiltonian: Option<(Value, Option<Span>)>,
    pub(super) constraints: Vec<ConstraintDraft>,
    pub(super) virtual_constraints: Vec<ConstraintDraft>,
    /// Where `virtual thermo` stands.
    pub(super) thermo: Option<Option<Span>>,
    /// Equations that coordinates are given by, with these.
    pub(super) determined: Vec<(Vec<String>, ConstraintDraft)>,
    pub(super) independent: Option<(Vec<Located>, Option<Span>)>,
    pub(super) multipliers: Option<Option<Span>>,
    pub(super) forces: Vec<(String, Value, Option<Span>)>,
    pub(super) applied: Vec<AppliedForce>,
    pub(super) casimirs: Vec<Named>,
    pub(super) outputs: Vec<NamedVector>,
    pub(super) output_names: BTreeMap<String, Option<Span>>,
    /// Outputs that components belong to, by the names of these.
    pub(super) output_components: BTreeMap<String, (String, Option<Span>)>,
    pub(super) sections: Vec<SectionDraft>,
    pub(super) modes: Vec<Mode>,
    /// The mode that constraints, conditions, forces and events belong to that are declared now.
    pub(super) current_mode: Option<usize>,
    /// Symbols of multipliers, by the names of constraints.
    pub(super) multiplier_symbols: Vec<(String, SymbolId)>,
    pub(super) feedback: FeedbackDraft,
    pub(super) events: Vec<EventDraft>,
    pub(super) reconstructions: Vec<ReconstructionDraft>,
    pub(super) initial: Vec<(String, Value, Option<Span>)>,
    pub(super) scenes: Vec<SceneDraft>,
    pub(super) views: Vec<View>,
    /// The graph without the views while they are declared, the one with them afterwards.
    pub(super) views_graph: Option<Graph>,
    pub(super) named_frames: Vec<NamedFrameDraft>,
    pub(in crate::spec) bodies: Vec<BodyDraft>,
    /// Equations that always hold, which are told.
    pub(super) left_out: Vec<Diagnostic>,
}

impl ModelBuilder {
    /// An empty model.
    pub fn new(name: &str) -> ModelBuilder {
        let mut graph = Graph::new();
        graph.set_budget(Budget::default());
        let time = graph.symbol("t");
        let mut values = BTreeMap::new();
        let (t, pi) = (graph.sym(time), graph.pi());
        values.insert("t".to_owned(), Value::Scalar(t));
        values.insert("pi".to_owned(), Value::Scalar(pi));
        ModelBuilder {
            graph,
            values,
            problems: Vec::new(),
            here: None,
            names: BTreeMap::new(),
            is_part: false,
            broken: BTreeSet::new(),
            place: None,
            name: name.to_owned(),
            doc: Vec::new(),
            sources: Vec::new(),
            totals: Vec::new(),
            topic: None,
            sizes: Vec::new(),
            time,
            params: Vec::new(),
            param_arrays: Vec::new(),
            blocks: BTreeMap::new(),
            inputs: Vec::new(),
            input_arrays: Vec::new(),
            drives: Vec::new(),
            input_blocks: BTreeMap::new(),
            noises: Vec::new(),
            conditions: Vec::new(),
            base: Vec::new(),
            algebra: None,
            velocities: Vec::new(),
            action: None,
            quasi_velocities: Vec::new(),
            frame_velocities: Vec::new(),
            frame: None,
            images: Vec::new(),
            algebroid: None,
            given: Vec::new(),
            momenta: Vec::new(),
            wants_digits: false,
            carries: Vec::new(),
            connection: Vec::new(),
            derived_connection: None,
            displacements: BTreeMap::new(),
            accelerations: BTreeMap::new(),
            jerks: BTreeMap::new(),
            carried_accelerations: Vec::new(),
            stages: Vec::new(),
            level_momentum: None,
            inner_product: None,
            stage_connections: Vec::new(),
            advected: Vec::new(),
            configurations: Vec::new(),
            first_order: Vec::new(),
            lagrangian: None,
            hamiltonian: None,
            constraints: Vec::new(),
            virtual_constraints: Vec::new(),
            thermo: None,
            determined: Vec::new(),
            independent: None,
            multipliers: None,
            forces: Vec::new(),
            applied: Vec::new(),
            casimirs: Vec::new(),
            outputs: Vec::new(),
            output_names: BTreeMap::new(),
            output_components: BTreeMap::new(),
            sections: Vec::new(),
            modes: Vec::new(),
            current_mode: None,
            multiplier_symbols: Vec::new(),
            feedback: FeedbackDraft::default(),
            events: Vec::new(),
            reconstructions: Vec::new(),
            initial: Vec::new(),
            scenes: Vec::new(),
            views: Vec::new(),
            views_graph: None,
            named_frames: Vec::new(),
            bodies: Vec::new(),
            left_out: Vec::new(),
        }
    }

    /// Sets what the model may take, from here to the programs of its scenes; [`Budget::default`] unless it is set.
    pub fn budget(&mut self, budget: Budget) -> &mut ModelBuilder {
        self.graph.set_budget(budget);
        self
    }

    /// From here on expressions go to a copy of the graph.
    pub(in crate::spec) fn begin_views(&mut self) {
        self.views_graph = Some(self.graph.clone());
    }

    /// The graph is the one without the copy's new expressions again.
    pub(in crate::spec) fn end_views(&mut self) {
        if let Some(graph) = &mut self.views_graph {
            std::mem::swap(graph, &mut self.graph);
        }
    }

    /// The graph that owns all expressions of the model.
    pub fn graph(&mut self) -> &mut Graph {
        &mut self.graph
    }

    /// The time.
    pub fn time(&mut self) -> Value {
        Value::Scalar(self.graph.sym(self.time))
    }

    pub(in crate::spec) fn rename(&mut self, name: &str) {
        self.name = name.to_owned();
    }

    /// The value declared under a name.
    pub fn value(&self, name: &str) -> Option<&Value> {
        self.values.get(name)
    }

    /// Sets the place that problems of the next declarations are reported at.
    pub fn at(&mut self, span: Option<Span>) -> &mut Self {
        self.here = span;
        self
    }

    pub(super) fn problem(&mut self, span: Option<Span>, message: impl Into<String>, help: impl Into<Help>) {
        self.problems.push(Diagnostic::new(span, message).with_help(help));
    }

    pub(in crate::spec) fn error(&mut self, span: Option<Span>, error: &Error) {
        let (message, help) = error.message_and_help();
        self.problem(span, message, help);
    }

    pub(super) fn value_error(&mut self, span: Option<Span>, error: &ValueError) {
        self.problem(span, error.to_string(), error.help());
    }

    /// Documentation lines, the first being the title.
    pub fn doc(&mut self, line: &str) -> &mut Self {
        self.doc.push(line.to_owned());
        self
    }

    /// Adds a source.
    pub fn source(&mut self, text: &str) -> &mut Self {
        self.sources.push(text.to_owned());
        self
    }

    /// What a list of models shows the model under; a second one is a problem.
    pub fn topic(&mut self, text: &str) -> &mut Self {
        let here = self.here;
        match &self.topic {
            Some((_, first)) => self.twice("topic", *first),
            None => self.topic = Some((text.to_owned(), here)),
        }
        self
    }

    /// Claims a name; a name that is taken, reserved or malformed is a problem.
    pub(in crate::spec) fn declare(&mut self, name: &str, what: DeclaredAs) -> bool {
        let here = self.here;
        if let Some(reason) = names::refusal(name) {
            let shown: String = name.chars().take(80).collect();
            self.problem(here, format!("`{shown}` cannot be used as a name"), reason);
            return false;
        }
        let declared = Declared { span: here, what };
        match self.names.get(name) {
            Some(before) => {
                // Declarations are visited by kind; the later one in the text is the duplicate.
                let (first, second) =
                    if before.span <= here { (before.clone(), declared) } else { (declared, before.clone()) };
                let help = first.what.help_against(second.what);
                let problem = Diagnostic::new(second.span, format!("`{name}` is declared twice"))
                    .with_label(format!("again as {}", second.what.words()))
                    .with_place(first.span, format!("first as {}", first.what.words()))
                    .with_help(help);
                self.problems.push(problem);
                false
            }
            None => {
                self.names.insert(name.to_owned(), declared);
                true
            }
        }
    }

    pub(in crate::spec) fn bind(&mut self, name: &str, value: &Value) {
        self.values.entry(name.to_owned()).or_insert_with(|| value.clone());
    }

    pub(super) fn new_symbol(&mut self, name: &str, what: DeclaredAs) -> (SymbolId, ExprId) {
        self.declare(name, what);
        let symbol = self.graph.symbol(name);
        let expr = self.graph.sym(symbol);
        self.bind(name, &Value::Scalar(expr));
        (symbol, expr)
    }

    pub(super) fn twice(&mut self, item: &str, first: Option<Span>) {
        let problem = Diagnostic::new(self.here, format!("`{item}` is given twice"))
            .with_place(first, "first here")
            .with_help("keep one of them");
        self.problems.push(problem);
    }
}
