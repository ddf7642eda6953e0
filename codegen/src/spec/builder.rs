//! Models from Rust, and every check that does not concern text.

use std::collections::{BTreeMap, BTreeSet};

use num_traits::{Signed, Zero};

mod motion;
mod reconstruct;
mod view;

pub use reconstruct::Group;
pub use view::Placement;

pub(super) use self::motion::look_up;
use self::reconstruct::ReconstructionDraft;
use super::ast::Compare;
use super::diagnostic::{Diagnostic, Diagnostics, Origin, Span};
use super::model::*;
use super::names;
use super::value::{Shape, Value, ValueError};
use super::want::{Want, Wanted};
use crate::algebra::{LieAlgebra, Subspace};
use crate::error::Error;
use crate::expr::{Budget, ExprId, Graph, Rational, SymbolId, Vanishing};

/// How the components of a parameter are arranged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// `chi1, chi2, ..`, a vector.
    Vector(usize),
    /// `I1, I2, ..`, a diagonal matrix.
    Diagonal(usize),
    /// `G11, G12, .., G22, ..`, a symmetric matrix by its upper triangle.
    Symmetric(usize),
    /// `C11, C12, ..`, a matrix row by row.
    Matrix(usize, usize),
}

impl Layout {
    /// Names of the components; row and column are parted by `_` when one of them can have two digits.
    pub fn names(self, name: &str) -> Vec<String> {
        let pair = |i: usize, j: usize, n: usize, m: usize| {
            let parted = if n.max(m) > 9 { "_" } else { "" };
            format!("{name}{}{parted}{}", i + 1, j + 1)
        };
        match self {
            Layout::Vector(n) | Layout::Diagonal(n) => (1..=n).map(|i| format!("{name}{i}")).collect(),
            Layout::Symmetric(n) => (0..n).flat_map(|i| (i..n).map(move |j| pair(i, j, n, n))).collect(),
            Layout::Matrix(n, m) => (0..n).flat_map(|i| (0..m).map(move |j| pair(i, j, n, m))).collect(),
        }
    }

    fn assemble(self, g: &mut Graph, c: &[ExprId]) -> Value {
        match self {
            Layout::Vector(_) => Value::Vector(c.to_vec()),
            Layout::Diagonal(n) => {
                let entries = (0..n * n).map(|k| if k / n == k % n { c[k / n] } else { g.zero() }).collect();
                Value::Matrix { rows: n, columns: n, entries }
            }
            Layout::Symmetric(n) => {
                // Position of (i, j), i <= j, in the upper triangle.
                let at = |i: usize, j: usize| i * n - i * (i + 1) / 2 + j;
                let entries = (0..n * n).map(|k| c[at((k / n).min(k % n), (k / n).max(k % n))]).collect();
                Value::Matrix { rows: n, columns: n, entries }
            }
            Layout::Matrix(n, m) => Value::Matrix { rows: n, columns: m, entries: c.to_vec() },
        }
    }
}

#[derive(Clone, Debug)]
struct Declared {
    span: Option<Span>,
    what: &'static str,
}

/// A name and where it was used.
type Located = (String, Option<Span>);

#[derive(Clone, Debug)]
struct StageDraft {
    name: String,
    ideal: Option<Vec<Value>>,
    span: Option<Span>,
}

#[derive(Clone, Debug)]
struct AdvectedDraft {
    name: String,
    value: Value,
    components: Vec<(String, SymbolId)>,
    action: Option<(Value, Option<Span>)>,
    doc: String,
    span: Option<Span>,
}

#[derive(Clone, Debug)]
struct ConstraintDraft {
    name: Option<String>,
    text: String,
    left: Value,
    right: Value,
    span: Option<Span>,
}

#[derive(Clone, Debug)]
struct SceneDraft {
    scene: Scene,
    fixed: Vec<(String, Vec<Rational>, Option<Span>)>,
    wants: Vec<Located>,
    drops: Vec<Located>,
    circles: Vec<Located>,
}

/// Builds a [`Model`] from Rust; [`parse`](super::parse) uses it too, so both report the same errors.
///
/// Declarations return the [`Value`] of what they declare. Problems are collected and reported by
/// [`ModelBuilder::build`], all at once.
///
/// ```
/// use hamel_codegen::algebra::LieAlgebra;
/// use hamel_codegen::expr::Rational;
/// use hamel_codegen::spec::{Layout, ModelBuilder, Value};
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
    pub(super) graph: Graph,
    pub(super) values: BTreeMap<String, Value>,
    pub(super) problems: Vec<Diagnostic>,
    here: Option<Span>,
    names: BTreeMap<String, Declared>,
    /// Items that were written but are broken: nothing is said about them being absent.
    pub(super) broken: BTreeSet<&'static str>,
    /// Where the model is named; what is missing is reported there.
    pub(super) place: Option<Span>,
    name: String,
    doc: Vec<String>,
    sources: Vec<String>,
    time: SymbolId,
    params: Vec<Param>,
    blocks: BTreeMap<String, Vec<usize>>,
    conditions: Vec<Condition>,
    base: Vec<Coordinate>,
    algebra: Option<(LieAlgebra, Option<Span>)>,
    velocities: Vec<Velocity>,
    action: Option<(Side, Option<Span>)>,
    quasi_velocities: Vec<Velocity>,
    connection: Vec<(String, Value, Option<Span>)>,
    derived_connection: Option<(ConnectionKind, Option<Span>)>,
    /// Displacements and accelerations by their velocity, made when they are used.
    displacements: BTreeMap<SymbolId, SymbolId>,
    accelerations: BTreeMap<SymbolId, SymbolId>,
    stages: Vec<StageDraft>,
    inner_product: Option<(Value, Option<Span>)>,
    advected: Vec<AdvectedDraft>,
    lagrangian: Option<(Value, Option<Span>)>,
    constraints: Vec<ConstraintDraft>,
    virtual_constraints: Vec<ConstraintDraft>,
    independent: Option<(Vec<Located>, Option<Span>)>,
    multipliers: Option<Option<Span>>,
    forces: Vec<(String, Value, Option<Span>)>,
    casimirs: Vec<Named>,
    outputs: Vec<NamedVector>,
    output_names: BTreeMap<String, Option<Span>>,
    reconstructions: Vec<ReconstructionDraft>,
    initial: Vec<(String, Value, Option<Span>)>,
    scenes: Vec<SceneDraft>,
    views: Vec<View>,
    /// The graph without the views while they are declared, the one with them afterwards.
    views_graph: Option<Graph>,
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
            broken: BTreeSet::new(),
            place: None,
            name: name.to_owned(),
            doc: Vec::new(),
            sources: Vec::new(),
            time,
            params: Vec::new(),
            blocks: BTreeMap::new(),
            conditions: Vec::new(),
            base: Vec::new(),
            algebra: None,
            velocities: Vec::new(),
            action: None,
            quasi_velocities: Vec::new(),
            connection: Vec::new(),
            derived_connection: None,
            displacements: BTreeMap::new(),
            accelerations: BTreeMap::new(),
            stages: Vec::new(),
            inner_product: None,
            advected: Vec::new(),
            lagrangian: None,
            constraints: Vec::new(),
            virtual_constraints: Vec::new(),
            independent: None,
            multipliers: None,
            forces: Vec::new(),
            casimirs: Vec::new(),
            outputs: Vec::new(),
            output_names: BTreeMap::new(),
            reconstructions: Vec::new(),
            initial: Vec::new(),
            scenes: Vec::new(),
            views: Vec::new(),
            views_graph: None,
        }
    }

    /// Sets what the model may take, from here to the programs of its scenes; [`Budget::default`] unless it is set.
    pub fn budget(&mut self, budget: Budget) -> &mut ModelBuilder {
        self.graph.set_budget(budget);
        self
    }

    /// From here on expressions go to a copy of the graph.
    pub(super) fn begin_views(&mut self) {
        self.views_graph = Some(self.graph.clone());
    }

    /// The graph is the one without the copy's new expressions again.
    pub(super) fn end_views(&mut self) {
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

    pub(super) fn rename(&mut self, name: &str) {
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

    fn problem(&mut self, span: Option<Span>, message: impl Into<String>, help: impl Into<String>) {
        self.problems.push(Diagnostic::new(span, message).with_help(help));
    }

    pub(super) fn error(&mut self, span: Option<Span>, error: &Error) {
        let (message, help) = error.message_and_help();
        self.problem(span, message, help);
    }

    fn value_error(&mut self, span: Option<Span>, error: &ValueError) {
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

    // Names.

    /// Claims a name; a name that is taken, reserved or malformed is a problem.
    pub(super) fn declare(&mut self, name: &str, what: &'static str) -> bool {
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
                let help = match (first.what, second.what) {
                    pair if pair.0.contains("velocity of a") || pair.1.contains("velocity of a") => {
                        "rename one of them; a coordinate `q` declares `q_dot` too"
                    }
                    pair if pair.0.contains("component") || pair.1.contains("component") => {
                        "rename one of them; a vector `v` declares `v1`, `v2`, .. too"
                    }
                    _ => "rename one of them",
                };
                let problem = Diagnostic::new(second.span, format!("`{name}` is declared twice"))
                    .with_label(format!("again as {}", second.what))
                    .with_place(first.span, format!("first as {}", first.what))
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

    pub(super) fn bind(&mut self, name: &str, value: &Value) {
        self.values.entry(name.to_owned()).or_insert_with(|| value.clone());
    }

    fn new_symbol(&mut self, name: &str, what: &'static str) -> (SymbolId, ExprId) {
        self.declare(name, what);
        let symbol = self.graph.symbol(name);
        let expr = self.graph.sym(symbol);
        self.bind(name, &Value::Scalar(expr));
        (symbol, expr)
    }

    // Parameters.

    /// A number.
    ///
    /// Parameters, their conditions and definitions are values; a condition names them in its text only.
    ///
    /// ```
    /// use hamel_codegen::expr::Rational;
    /// use hamel_codegen::spec::{Compare, Layout, ModelBuilder, Value};
    ///
    /// let number = |n: i64| Rational::from_integer(n.into());
    /// let mut b = ModelBuilder::new("m");
    /// let mass = b.param("m", number(-1), "mass [kg]");
    /// let direction = b.param_array("chi", Layout::Vector(2), &[number(1)], "");
    /// assert_eq!(direction.entries().len(), 2);
    /// let zero = Value::number(b.graph(), number(0));
    /// b.condition("m > 0", &mass, Compare::Greater, &zero);
    /// let problems = b.build().unwrap_err().to_string();
    /// assert!(problems.contains("`chi` has 2 components, its default 1"));
    /// assert!(problems.contains("the default violates `m > 0`"));
    /// ```
    pub fn param(&mut self, name: &str, default: Rational, doc: &str) -> Value {
        self.check_range(name, &default);
        let (symbol, expr) = self.new_symbol(name, "a parameter");
        self.blocks.insert(name.to_owned(), vec![self.params.len()]);
        self.params.push(Param { name: name.to_owned(), symbol, default, doc: doc.to_owned() });
        Value::Scalar(expr)
    }

    /// Generated code holds the value as an `f64`.
    fn check_range(&mut self, name: &str, value: &Rational) {
        let number = crate::expr::rational_to_f64(value);
        if !number.is_finite() || (number == 0.0 && !value.is_zero()) {
            self.error(self.here, &Error::OutOfRange { what: format!("the value of `{name}`") });
        }
    }

    /// A vector or a matrix; the defaults are in the order of the components.
    pub fn param_array(&mut self, name: &str, layout: Layout, defaults: &[Rational], doc: &str) -> Value {
        self.declare(name, "a parameter");
        let names = layout.names(name);
        if names.len() != defaults.len() {
            let message = format!("`{name}` has {} components, its default {}", names.len(), defaults.len());
            self.problem(self.here, message, component_help(&names));
        }
        let mut components = Vec::with_capacity(names.len());
        let mut positions = Vec::with_capacity(names.len());
        for (k, component) in names.iter().enumerate() {
            let (symbol, expr) = self.new_symbol(component, "a component of a parameter");
            positions.push(self.params.len());
            self.blocks.insert(component.clone(), vec![self.params.len()]);
            let default = defaults.get(k).cloned().unwrap_or_else(Rational::zero);
            self.check_range(component, &default);
            self.params.push(Param { name: component.clone(), symbol, default, doc: doc.to_owned() });
            components.push(expr);
        }
        self.blocks.insert(name.to_owned(), positions);
        let value = layout.assemble(&mut self.graph, &components);
        self.bind(name, &value);
        value
    }

    /// A validity condition on the parameters.
    pub fn condition(&mut self, text: &str, left: &Value, compare: Compare, right: &Value) -> &mut Self {
        let here = self.here;
        let sides = left.scalar("a condition").and_then(|l| Ok((l, right.scalar("a condition")?)));
        let (left, right) = match sides {
            Ok(sides) => sides,
            Err(error) => {
                self.problem(
                    here,
                    format!("condition `{text}` compares {}", shape_of(&error)),
                    "conditions compare numbers",
                );
                return self;
            }
        };
        let (greater, less, relation) = match compare {
            Compare::Greater => (left, right, Relation::Greater),
            Compare::GreaterEqual => (left, right, Relation::GreaterEqual),
            Compare::Less => (right, left, Relation::Greater),
            Compare::LessEqual => (right, left, Relation::GreaterEqual),
            Compare::NotEqual => (left, right, Relation::NotEqual),
        };
        self.conditions.push(Condition {
            text: text.to_owned(),
            greater,
            less,
            relation,
            subject: None,
            span: here,
        });
        self
    }

    // Velocities, coordinates, advected parameters.

    /// The algebra and names for its velocities: one per slot, or one per basis element.
    ///
    /// ```
    /// use hamel_codegen::algebra::LieAlgebra;
    /// use hamel_codegen::spec::{Domain, ModelBuilder};
    ///
    /// let mut b = ModelBuilder::new("bundle");
    /// let (theta, theta_dot) = b.coordinate("theta", Domain::Angle, "tilt [rad]");
    /// let slots = b.velocities(LieAlgebra::se(2).unwrap(), &["omega", "v"]);
    /// assert_eq!(slots[1].entries().len(), 2);
    /// // The group turns the vertical: `adot = -xi . a`.
    /// let gamma = b.advected("Gamma", Some(2), "");
    /// let turned = slots[0].mul(b.graph(), &gamma).unwrap();
    /// b.advected_action("Gamma", &turned).lagrangian(&theta_dot);
    /// assert!(b.build().is_ok());
    /// ```
    pub fn velocities(&mut self, algebra: LieAlgebra, names: &[&str]) -> Vec<Value> {
        let located: Vec<(&str, Option<Span>)> = names.iter().map(|n| (*n, self.here)).collect();
        self.located_velocities(algebra, &located, "")
    }

    pub(super) fn located_velocities(
        &mut self,
        algebra: LieAlgebra,
        names: &[(&str, Option<Span>)],
        doc: &str,
    ) -> Vec<Value> {
        let here = self.here;
        if let Some((_, first)) = &self.algebra {
            let problem = Diagnostic::new(here, "velocities are declared twice")
                .with_place(*first, "first here")
                .with_help("name all slots in one item: `velocity Omega, V in se(3);`");
            self.problems.push(problem);
        }
        let slots: Vec<usize> = algebra.slots().iter().map(|s| s.dim).collect();
        let sizes = if names.len() == slots.len() {
            slots
        } else {
            if names.len() != algebra.dim() {
                let spelled: Vec<String> =
                    algebra.slots().iter().map(|s| format!("{} (dimension {})", s.name, s.dim)).collect();
                let plural = if names.len() == 1 { "name" } else { "names" };
                let message = format!("{} {plural} for the velocity in {}", names.len(), algebra.name());
                let mut help = match spelled.as_slice() {
                    [only] => format!("give one name for {only}"),
                    several => format!("give {} names, for {}", several.len(), several.join(", ")),
                };
                if algebra.dim() != slots.len() {
                    help.push_str(&format!(", or {} names, one per basis element", algebra.dim()));
                }
                self.problem(here, message, help);
            }
            vec![1; names.len()]
        };
        let mut values = Vec::with_capacity(names.len());
        for ((name, span), size) in names.iter().zip(sizes) {
            self.here = *span;
            let velocity = |b: &mut ModelBuilder, component: &str, what| {
                let (symbol, expr) = b.new_symbol(component, what);
                let block = (*name).to_owned();
                b.velocities.push(Velocity {
                    name: component.to_owned(),
                    symbol,
                    block,
                    doc: doc.to_owned(),
                });
                expr
            };
            if size == 1 {
                values.push(Value::Scalar(velocity(self, name, "a velocity")));
            } else {
                self.declare(name, "a velocity");
                let components = Layout::Vector(size).names(name);
                let entries =
                    components.iter().map(|c| velocity(self, c, "a component of a velocity")).collect();
                let value = Value::Vector(entries);
                self.bind(name, &value);
                values.push(value);
            }
        }
        self.here = here;
        // The first declaration counts; a second one is already a problem.
        self.algebra.get_or_insert((algebra, here));
        values
    }

    /// The side of the group action; left when not called.
    pub fn action(&mut self, side: Side) -> &mut Self {
        let here = self.here;
        match &self.action {
            Some((_, first)) => self.twice("action", *first),
            None => self.action = Some((side, here)),
        }
        self
    }

    fn twice(&mut self, item: &str, first: Option<Span>) {
        let problem = Diagnostic::new(self.here, format!("`{item}` is given twice"))
            .with_place(first, "first here")
            .with_help("keep one of them");
        self.problems.push(problem);
    }

    /// A base coordinate and its velocity `name_dot`.
    pub fn coordinate(&mut self, name: &str, domain: Domain, doc: &str) -> (Value, Value) {
        let velocity_name = format!("{name}_dot");
        let (symbol, expr) = self.new_symbol(name, "a coordinate");
        let (velocity, rate) = self.new_symbol(&velocity_name, "the velocity of a coordinate");
        if let Domain::Interval(low, high) = domain {
            self.check_interval(low, high);
        }
        let doc = doc.to_owned();
        self.base.push(Coordinate { name: name.to_owned(), symbol, velocity_name, velocity, domain, doc });
        (Value::Scalar(expr), Value::Scalar(rate))
    }

    /// A vector of coordinates `name1, name2, ..` with velocities `name1_dot, ..`; the vectors are `name`, `name_dot`.
    pub fn coordinate_vector(&mut self, name: &str, n: usize, domain: Domain, doc: &str) -> (Value, Value) {
        let rate_name = format!("{name}_dot");
        self.declare(name, "a coordinate");
        self.declare(&rate_name, "the velocity of a coordinate");
        let (mut place, mut rate) = (Vec::new(), Vec::new());
        for component in Layout::Vector(n).names(name) {
            let (q, v) = self.coordinate(&component, domain, doc);
            place.extend(q.into_entries());
            rate.extend(v.into_entries());
        }
        let (place, rate) = (Value::Vector(place), Value::Vector(rate));
        self.bind(name, &place);
        self.bind(&rate_name, &rate);
        (place, rate)
    }

    fn check_interval(&mut self, low: ExprId, high: ExprId) {
        let here = self.here;
        let params: BTreeSet<SymbolId> = self.params.iter().map(|p| p.symbol).collect();
        let mut free = self.graph.free_symbols(low);
        free.extend(self.graph.free_symbols(high));
        if let Some(wrong) = free.iter().find(|s| !params.contains(s)) {
            let message =
                format!("interval contains `{}`, which is not a parameter", self.graph.name(*wrong));
            self.problem(here, message, "the ends of an interval contain parameters and numbers only");
            return;
        }
        let values = self.default_values();
        let (a, b) = (self.graph.eval_f64(low, &values), self.graph.eval_f64(high, &values));
        match (a, b) {
            (Some(a), Some(b)) if a < b => {}
            (Some(a), Some(b)) => {
                let message = format!("interval from {a} to {b} is empty");
                self.problem(here, message, "write the lower end first: `(0, pi/2)`");
            }
            _ => self.problem(here, "interval has no ends at the defaults", "its ends are finite numbers"),
        }
    }

    fn default_values(&self) -> BTreeMap<SymbolId, f64> {
        self.params.iter().map(|p| (p.symbol, crate::expr::rational_to_f64(&p.default))).collect()
    }

    /// An advected parameter: a vector of dimension `n`, or a number for `None`.
    pub fn advected(&mut self, name: &str, n: Option<usize>, doc: &str) -> Value {
        let span = self.here;
        let (value, components) = match n {
            None => {
                let (symbol, expr) = self.new_symbol(name, "an advected parameter");
                (Value::Scalar(expr), vec![(name.to_owned(), symbol)])
            }
            Some(n) => {
                self.declare(name, "an advected parameter");
                let (mut components, mut entries) = (Vec::new(), Vec::new());
                for component in Layout::Vector(n).names(name) {
                    let (symbol, expr) = self.new_symbol(&component, "a component of an advected parameter");
                    components.push((component, symbol));
                    entries.push(expr);
                }
                let value = Value::Vector(entries);
                self.bind(name, &value);
                (value, components)
            }
        };
        let draft = AdvectedDraft {
            name: name.to_owned(),
            value: value.clone(),
            components,
            action: None,
            doc: doc.to_owned(),
            span,
        };
        self.advected.push(draft);
        value
    }

    /// The infinitesimal action `xi . a` of the velocity on an advected parameter; `adot = -xi . a`.
    pub fn advected_action(&mut self, name: &str, action: &Value) -> &mut Self {
        let here = self.here;
        match self.advected.iter_mut().find(|a| a.name == name) {
            Some(draft) => draft.action = Some((action.clone(), here)),
            None => self.problem(here, format!("`{name}` is not an advected parameter"), "declare it first"),
        }
        self
    }

    // Stages.

    /// The name of the first stage, the whole algebra.
    ///
    /// ```
    /// use hamel_codegen::algebra::LieAlgebra;
    /// use hamel_codegen::spec::ModelBuilder;
    ///
    /// let mut b = ModelBuilder::new("stages");
    /// let [rotation, translation] = b.velocities(LieAlgebra::se(3).unwrap(), &["Omega", "V"]).try_into().unwrap();
    /// let energy = rotation.dot(b.graph(), &rotation).unwrap();
    /// b.stage("whole").stage_ideal("translations", &[translation]).lagrangian(&energy);
    /// assert!(b.clone().build().is_ok());
    /// b.stage_ideal("rotations", &[rotation]);
    /// let problems = b.build().unwrap_err();
    /// assert!(problems.to_string().contains("stage rotations is not contained in stage translations"));
    /// ```
    pub fn stage(&mut self, name: &str) -> &mut Self {
        let span = self.here;
        self.stages.push(StageDraft { name: name.to_owned(), ideal: None, span });
        self
    }

    /// The next stage: the ideal spanned by velocities or rational combinations of them.
    pub fn stage_ideal(&mut self, name: &str, ideal: &[Value]) -> &mut Self {
        let span = self.here;
        self.stages.push(StageDraft { name: name.to_owned(), ideal: Some(ideal.to_vec()), span });
        self
    }

    /// The inner product for the stages: a symmetric matrix in the basis of the algebra.
    pub fn inner_product(&mut self, matrix: &Value) -> &mut Self {
        let here = self.here;
        match &self.inner_product {
            Some((_, first)) => self.twice("inner_product", *first),
            None => self.inner_product = Some((matrix.clone(), here)),
        }
        self
    }

    // Dynamics.

    /// The reduced Lagrangian.
    pub fn lagrangian(&mut self, value: &Value) -> &mut Self {
        let here = self.here;
        match &self.lagrangian {
            Some((_, first)) => self.twice("lagrangian", *first),
            None => self.lagrangian = Some((value.clone(), here)),
        }
        self
    }

    /// A constraint `left = right` on velocities, or on accelerations made by [`ModelBuilder::ddt`]; a vector equation gives
    /// one constraint per component, and the number 0 on one side stands for a zero of any shape.
    ///
    /// ```
    /// use hamel_codegen::algebra::LieAlgebra;
    /// use hamel_codegen::spec::{ModelBuilder, Value};
    ///
    /// let mut b = ModelBuilder::new("sleigh");
    /// let [omega, v] = b.velocities(LieAlgebra::se(2).unwrap(), &["omega", "v"]).try_into().unwrap();
    /// let square = omega.mul(b.graph(), &omega).unwrap();
    /// let energy = v.dot(b.graph(), &v).unwrap().add(b.graph(), &square).unwrap();
    /// let zero = Value::Scalar(b.graph().zero());
    /// b.lagrangian(&energy).constraint(Some("skate"), "v2 = 0", &v.row(2).unwrap(), &zero);
    /// b.independent(&["omega", "v1"]).force("v1", &zero);
    /// assert_eq!(b.build().unwrap().constraints[0].name, "skate");
    /// ```
    pub fn constraint(&mut self, name: Option<&str>, text: &str, left: &Value, right: &Value) -> &mut Self {
        let span = self.here;
        self.constraints.push(ConstraintDraft {
            name: name.map(str::to_owned),
            text: text.to_owned(),
            left: left.clone(),
            right: right.clone(),
            span,
        });
        self
    }

    /// The velocities (vectors or components) to be kept as independent.
    pub fn independent(&mut self, names: &[&str]) -> &mut Self {
        let located: Vec<(String, Option<Span>)> =
            names.iter().map(|n| ((*n).to_owned(), self.here)).collect();
        self.located_independent(located)
    }

    pub(super) fn located_independent(&mut self, names: Vec<(String, Option<Span>)>) -> &mut Self {
        let here = self.here;
        match &self.independent {
            Some((_, first)) => self.twice("independent", *first),
            None => self.independent = Some((names, here)),
        }
        self
    }

    /// Keeps all velocities and computes multipliers.
    pub fn multipliers(&mut self) -> &mut Self {
        let here = self.here;
        match self.multipliers {
            Some(first) => self.twice("multipliers", first),
            None => self.multipliers = Some(here),
        }
        self
    }

    /// An external force paired with a velocity (a vector or a component).
    pub fn force(&mut self, velocity: &str, value: &Value) -> &mut Self {
        let here = self.here;
        self.forces.push((velocity.to_owned(), value.clone(), here));
        self
    }

    // Outputs and scenes.

    fn output_name(&mut self, name: &str) {
        let here = self.here;
        let is_taken = Want::from_name(name).is_some() || names::OTHER_FUNCTIONS.contains(&name);
        if is_taken || names::refusal(name).is_some() {
            let reason = names::refusal(name).unwrap_or("every scene has an output of that name");
            self.problem(here, format!("`{name}` cannot be used as a name"), reason);
        }
        if let Some(first) = self.output_names.insert(name.to_owned(), here) {
            let problem = Diagnostic::new(here, format!("output `{name}` is declared twice"))
                .with_place(first, "first here")
                .with_help("rename one of them");
            self.problems.push(problem);
        }
    }

    /// A named number that the motion should conserve.
    ///
    /// ```
    /// use hamel_codegen::algebra::LieAlgebra;
    /// use hamel_codegen::expr::Rational;
    /// use hamel_codegen::spec::ModelBuilder;
    ///
    /// let one = Rational::from_integer(1.into());
    /// let mut b = ModelBuilder::new("sphere");
    /// let inertia = b.param("I", one.clone(), "");
    /// let omega = b.velocities(LieAlgebra::so(3).unwrap(), &["Omega"]).remove(0);
    /// let square = omega.dot(b.graph(), &omega).unwrap();
    /// let energy = square.mul(b.graph(), &inertia).unwrap();
    /// b.lagrangian(&energy).casimir("C", &square, "").output("turning", &omega, "");
    /// b.scene("unit", &[("I", &[one])], &["energy", "turning"], "a scene");
    /// assert!(b.clone().build().is_ok());
    /// b.scene("other", &[], &["turnign"], "");
    /// assert!(b.build().unwrap_err().to_string().contains("did you mean `turning`?"));
    /// ```
    pub fn casimir(&mut self, name: &str, value: &Value, doc: &str) -> &mut Self {
        self.output_name(name);
        match value.scalar("casimir") {
            Ok(expr) => self.casimirs.push(Named { name: name.to_owned(), expr, doc: doc.to_owned() }),
            Err(error) => self.value_error(self.here, &error),
        }
        self
    }

    /// A named output.
    pub fn output(&mut self, name: &str, value: &Value, doc: &str) -> &mut Self {
        self.output_name(name);
        let names = match value.shape() {
            Shape::Scalar => vec![name.to_owned()],
            Shape::Vector(n) => Layout::Vector(n).names(name),
            Shape::Matrix(n, m) => Layout::Matrix(n, m).names(name),
        };
        let components = names.into_iter().zip(value.entries().iter().copied()).collect();
        self.outputs.push(NamedVector { name: name.to_owned(), components, doc: doc.to_owned() });
        self
    }

    /// A scene: parameters fixed to numbers (in the order of their components) and what is wanted: names of outputs, or
    /// derivatives of the right-hand side such as `jacobian`.
    pub fn scene(
        &mut self,
        name: &str,
        fixed: &[(&str, &[Rational])],
        wants: &[&str],
        doc: &str,
    ) -> &mut Self {
        let here = self.here;
        let fixed = fixed.iter().map(|(n, v)| ((*n).to_owned(), v.to_vec(), here)).collect();
        let wants = wants.iter().map(|n| ((*n).to_owned(), here)).collect();
        self.located_scene(name, fixed, [wants, Vec::new(), Vec::new()], doc)
    }

    pub(super) fn located_scene(
        &mut self,
        name: &str,
        fixed: Vec<(String, Vec<Rational>, Option<Span>)>,
        [wants, drops, circles]: [Vec<Located>; 3],
        doc: &str,
    ) -> &mut Self {
        let here = self.here;
        if let Some(reason) = names::refusal(name) {
            self.problem(here, format!("`{name}` cannot be used as a name"), reason);
        }
        if let Some(first) = self.scenes.iter().find(|s| s.scene.name == name) {
            let problem = Diagnostic::new(here, format!("scene `{name}` is declared twice"))
                .with_place(first.scene.span, "first here")
                .with_help("rename one of them");
            self.problems.push(problem);
        }
        let scene = Scene {
            name: name.to_owned(),
            fixed: Vec::new(),
            wants: Vec::new(),
            drops: Vec::new(),
            circles: Vec::new(),
            doc: doc.to_owned(),
            span: here,
            places: BTreeMap::new(),
        };
        self.scenes.push(SceneDraft { scene, fixed, wants, drops, circles });
        self
    }

    // Checks.

    /// Checks everything and returns the model.
    ///
    /// # Errors
    /// All problems found, in the order of the text.
    pub fn build(self) -> Result<Model, Diagnostics> {
        self.build_with(None)
    }

    pub(super) fn build_with(mut self, origin: Option<Origin>) -> Result<Model, Diagnostics> {
        if let Some(reason) = names::refusal(&self.name) {
            self.problem(None, format!("`{}` cannot be used as the name of a model", self.name), reason);
        }
        self.check_conditions();
        let lagrangian = self.check_lagrangian();
        let stages = self.check_stages();
        let advected = self.check_advected();
        let connection = self.check_connection();
        let constraints = self.check_constraints();
        let virtual_constraints = self.check_virtual_constraints();
        let independent = self.check_independent(&constraints);
        let forces = self.check_forces();
        self.check_named_values();
        let reconstruction = self.check_reconstructions(connection.as_deref());
        let initial = self.check_initial();
        let scenes = self.check_scenes();
        self.check_budget();
        if !self.problems.is_empty() {
            return Err(Diagnostics::new(origin, self.problems));
        }
        let by_name = |list: Vec<(String, Value, Option<Span>)>| {
            list.into_iter().filter_map(|(name, _, span)| Some((name, span?))).collect()
        };
        let first_component = self.connection.first().and_then(|(_, _, span)| *span);
        let places = Places {
            lagrangian: self.lagrangian.and_then(|(_, span)| span),
            inner_product: self.inner_product.and_then(|(_, span)| span),
            independent: self.independent.and_then(|(_, span)| span),
            connection: self.derived_connection.and_then(|(_, span)| span).or(first_component),
            outputs: self.output_names.into_iter().filter_map(|(name, span)| Some((name, span?))).collect(),
            declared: self.names.into_iter().filter_map(|(name, of)| Some((name, of.span?))).collect(),
            forces: by_name(self.forces),
            initial: by_name(self.initial),
        };
        let views_graph = self.views_graph.unwrap_or_else(|| match self.views.is_empty() {
            true => Graph::new(),
            false => self.graph.clone(),
        });
        Ok(Model {
            views: Views { graph: views_graph, list: self.views },
            name: self.name,
            doc: self.doc,
            sources: self.sources,
            graph: self.graph,
            time: self.time,
            params: self.params,
            conditions: self.conditions,
            base: self.base,
            algebra: self.algebra.map_or_else(|| LieAlgebra::abelian(0), |(algebra, _)| algebra),
            velocities: self.velocities,
            quasi_velocities: self.quasi_velocities,
            connection,
            derived_connection: self.derived_connection.map(|(kind, _)| kind),
            action: self.action.map_or(Side::Left, |(side, _)| side),
            stages,
            advected,
            lagrangian,
            constraints,
            virtual_constraints,
            independent,
            force_multipliers: self.multipliers.is_some(),
            forces,
            casimirs: self.casimirs,
            outputs: self.outputs,
            reconstruction,
            initial,
            scenes,
            places,
            warnings: Diagnostics::new(None, Vec::new()),
            origin,
        })
    }

    /// What is wrong with expressions that were not made says nothing.
    fn check_budget(&mut self) {
        let views = self.views_graph.as_ref().map_or(Ok(()), Graph::within_budget);
        let Err(exhausted) = self.graph.within_budget().and(views) else { return };
        let message = exhausted.message();
        self.problems.retain(|problem| problem.message == message);
        if self.problems.is_empty() {
            let span = self.lagrangian.as_ref().and_then(|(_, span)| *span);
            self.problem(span, message, exhausted.help());
        }
    }

    /// Symbols of the velocities: base first, then algebra.
    fn velocity_symbols(&self) -> Vec<SymbolId> {
        self.base.iter().map(|c| c.velocity).chain(self.velocities.iter().map(|v| v.symbol)).collect()
    }

    fn velocity_names(&self) -> Vec<String> {
        self.base
            .iter()
            .map(|c| c.velocity_name.clone())
            .chain(self.velocities.iter().map(|v| v.name.clone()))
            .collect()
    }

    /// The velocities among `unknowns` that `e` mentions; the others have zero slope.
    fn occurring(&self, e: ExprId, unknowns: &[SymbolId]) -> Vec<SymbolId> {
        let free = self.graph.free_symbols(e);
        unknowns.iter().copied().filter(|s| free.contains(s)).collect()
    }

    fn check_conditions(&mut self) {
        let params: BTreeMap<SymbolId, String> =
            self.params.iter().map(|p| (p.symbol, p.name.clone())).collect();
        let defaults: BTreeMap<SymbolId, Rational> =
            self.params.iter().map(|p| (p.symbol, p.default.clone())).collect();
        for k in 0..self.conditions.len() {
            let condition = self.conditions[k].clone();
            let mut free = self.graph.free_symbols(condition.greater);
            free.extend(self.graph.free_symbols(condition.less));
            if let Some(wrong) = free.iter().find(|s| !params.contains_key(s)) {
                let message = format!(
                    "condition `{}` contains `{}`, which is not a parameter",
                    condition.text,
                    self.graph.name(*wrong)
                );
                self.problem(condition.span, message, "conditions restrict parameters only");
                continue;
            }
            if free.len() == 1 {
                self.conditions[k].subject = free.first().and_then(|s| params.get(s)).cloned();
            }
            match self.holds(&condition, &defaults) {
                Some(true) => {}
                Some(false) => {
                    let spelled: Vec<String> = free
                        .iter()
                        .take(8)
                        .map(|s| format!("{} = {}", params[s], crate::expr::rational_to_f64(&defaults[s])))
                        .collect();
                    let what = if free.len() == 1 { "the default violates" } else { "the defaults violate" };
                    let message = format!("{what} `{}`", condition.text);
                    let help = if spelled.is_empty() {
                        "the condition never holds".to_owned()
                    } else {
                        format!("here {}", spelled.join(", "))
                    };
                    self.problem(condition.span, message, help);
                }
                None => {
                    let message = format!("condition `{}` has no value at the defaults", condition.text);
                    self.problem(
                        condition.span,
                        message,
                        "it divides by zero or leaves the domain of a function",
                    );
                }
            }
        }
    }

    /// Whether a condition holds, exactly where its value is rational; `None` when it has no value.
    fn holds(&mut self, condition: &Condition, values: &BTreeMap<SymbolId, Rational>) -> Option<bool> {
        let difference = self.graph.sub(condition.greater, condition.less);
        let numbers: BTreeMap<SymbolId, ExprId> =
            values.iter().map(|(s, q)| (*s, self.graph.rational(q.clone()))).collect();
        let reduced = self.graph.subs(difference, &numbers).ok()?;
        if let Some(q) = self.graph.as_rational(reduced) {
            return Some(match condition.relation {
                Relation::Greater => q.is_positive(),
                Relation::GreaterEqual => !q.is_negative(),
                Relation::NotEqual => !q.is_zero(),
            });
        }
        // A number that could not be shown to vanish is what it is to sixteen digits.
        if self.graph.is_zero(reduced) {
            return Some(condition.relation == Relation::GreaterEqual);
        }
        let value = self.graph.eval_f64(reduced, &BTreeMap::new()).filter(|x| !x.is_nan())?;
        Some(match condition.relation {
            Relation::Greater => value > 0.0,
            Relation::GreaterEqual => value >= 0.0,
            Relation::NotEqual => value != 0.0,
        })
    }

    fn check_lagrangian(&mut self) -> ExprId {
        let zero = self.graph.zero();
        let broken = ["velocity", "coordinate"].iter().any(|item| self.broken.contains(item));
        if self.algebra.is_none() && self.base.is_empty() && !broken {
            self.problem(
                self.place,
                format!("model `{}` has no velocity", self.name),
                "declare `velocity Omega in so(3);` or a `coordinate`",
            );
        }
        let Some((value, span)) = self.lagrangian.clone() else {
            if !self.broken.contains("lagrangian") {
                self.problem(
                    self.place,
                    format!("model `{}` has no lagrangian", self.name),
                    "add `lagrangian = ..;`",
                );
            }
            return zero;
        };
        let e = match value.scalar("lagrangian") {
            Ok(e) => e,
            Err(_) => {
                let message = format!("the lagrangian must be a number, found {}", value.shape());
                self.problem(span, message, "use `dot(a, b)` for the pairing of vectors");
                return zero;
            }
        };
        self.reports_stray(e, span, "the lagrangian", &[]);
        let velocities = self.velocity_symbols();
        if !velocities.is_empty()
            && self.occurring(e, &velocities).is_empty()
            && !self.broken.contains("velocity")
        {
            let names = self.velocity_names();
            self.problem(
                span,
                "the lagrangian contains no velocity",
                short_list("the velocities are", &names),
            );
        }
        e
    }

    fn check_stages(&mut self) -> Option<Stages> {
        let drafts = self.stages.clone();
        if drafts.is_empty() {
            if let Some((_, span)) = self.inner_product
                && !self.broken.contains("stage")
            {
                self.problem(
                    span,
                    "`inner_product` without stages has no use",
                    "declare stages: `stage rotation; stage translation = ideal(V);`",
                );
            }
            return None;
        }
        let algebra = self.algebra.as_ref().map(|(algebra, _)| algebra.clone())?;
        let n = algebra.dim();
        if self.velocities.len() != n {
            // The names of the velocities are already a problem.
            return None;
        }
        let mut seen: BTreeMap<String, Option<Span>> = BTreeMap::new();
        for (k, draft) in drafts.iter().enumerate() {
            if let Some(reason) = names::refusal(&draft.name) {
                self.problem(draft.span, format!("`{}` cannot be used as a name", draft.name), reason);
            }
            if let Some(first) = seen.insert(draft.name.clone(), draft.span) {
                let problem =
                    Diagnostic::new(draft.span, format!("stage `{}` is declared twice", draft.name))
                        .with_place(first, "first here")
                        .with_help("rename one of them");
                self.problems.push(problem);
            }
            if k == 0 && draft.ideal.is_some() {
                self.problem(
                    draft.span,
                    format!("the first stage `{}` is the whole algebra and has no ideal", draft.name),
                    "declare it as `stage name;` before the ideals",
                );
            } else if k > 0 && draft.ideal.is_none() && !self.broken.contains("stage") {
                self.problem(
                    draft.span,
                    format!("stage `{}` has no ideal", draft.name),
                    "only the first stage is the whole algebra; write `stage name = ideal(V);`",
                );
            }
        }
        let unknowns: Vec<SymbolId> = self.velocities.iter().map(|v| v.symbol).collect();
        let mut ideals = Vec::new();
        // The whole algebra.
        let mut above: Vec<Vec<Rational>> = (0..n).map(|k| unit(n, k)).collect();
        let mut above_name = drafts[0].name.clone();
        for draft in drafts.iter().filter(|d| d.ideal.is_some()) {
            let entries: Vec<ExprId> =
                draft.ideal.iter().flatten().flat_map(|v| v.entries().iter().copied()).collect();
            let mut vectors = Vec::new();
            for e in entries {
                match self.direction(e, &unknowns) {
                    Some(v) if v.iter().any(|q| !q.is_zero()) => vectors.push(v),
                    _ => {
                        let names: Vec<String> = self.velocities.iter().map(|v| v.name.clone()).collect();
                        self.problem(
                            draft.span,
                            format!(
                                "ideal of stage `{}` is not spanned by rational combinations of velocities",
                                draft.name
                            ),
                            short_list("use", &names),
                        );
                        return None;
                    }
                }
            }
            let basis: Vec<String> = self.velocities.iter().map(|v| v.name.clone()).collect();
            let checked = check_ideal(&algebra, &basis, (&above_name, &above), (&draft.name, &vectors));
            if let Err(error) = checked {
                self.error(draft.span, &error);
                return None;
            }
            above = vectors.clone();
            above_name = draft.name.clone();
            ideals.push(vectors);
        }
        let inner_product = self.check_inner_product(n);
        Some(Stages {
            names: drafts.iter().map(|d| d.name.clone()).collect(),
            ideals,
            inner_product,
            spans: drafts.iter().map(|d| d.span).collect(),
        })
    }

    /// A rational combination of velocities as a vector in the basis of the algebra.
    fn direction(&mut self, e: ExprId, unknowns: &[SymbolId]) -> Option<Vec<Rational>> {
        let occurring = self.occurring(e, unknowns);
        let (slopes, offset) = self.graph.affine_parts(e, &occurring)?;
        if !self.graph.is_zero(offset) {
            return None;
        }
        let mut vector = vec![Rational::zero(); unknowns.len()];
        for (s, slope) in occurring.iter().zip(slopes) {
            let at = unknowns.iter().position(|u| u == s)?;
            vector[at] = self.graph.as_rational(slope)?.clone();
        }
        Some(vector)
    }

    fn check_inner_product(&mut self, n: usize) -> Option<Vec<Vec<ExprId>>> {
        let (value, span) = self.inner_product.clone()?;
        let Value::Matrix { rows, columns, entries } = &value else {
            let message = format!("inner product must be matrix({n}, {n}), found {}", value.shape());
            self.problem(span, message, "write `diag([..])` or `[[..], ..]`");
            return None;
        };
        if (*rows, *columns) != (n, n) {
            let message = format!("inner product must be matrix({n}, {n}), found {}", value.shape());
            self.problem(span, message, "one row and column per basis element of the algebra");
            return None;
        }
        let params: BTreeSet<SymbolId> = self.params.iter().map(|p| p.symbol).collect();
        for e in entries {
            if let Some(wrong) = self.graph.free_symbols(*e).iter().find(|s| !params.contains(s)) {
                let message =
                    format!("inner product contains `{}`, which is not a parameter", self.graph.name(*wrong));
                self.problem(span, message, "it is constant on the algebra");
                return None;
            }
        }
        for i in 0..n {
            for j in i + 1..n {
                let difference = self.graph.sub(entries[i * n + j], entries[j * n + i]);
                let found = match self.graph.vanishing(difference) {
                    Vanishing::Zero => continue,
                    Vanishing::NonZero => ("is not symmetric", "differ"),
                    Vanishing::Unknown => ("could not be shown to be symmetric", "may differ"),
                };
                {
                    let message = format!(
                        "inner product {2}: entries ({0}, {1}) and ({1}, {0}) {3}",
                        i + 1,
                        j + 1,
                        found.0,
                        found.1
                    );
                    self.problem(span, message, "a `symmetric(n)` parameter is symmetric by construction");
                    return None;
                }
            }
        }
        Some(entries.chunks(n).map(<[ExprId]>::to_vec).collect())
    }

    fn check_advected(&mut self) -> Vec<Advected> {
        let fibre: Vec<SymbolId> = self.velocities.iter().map(|v| v.symbol).collect();
        let rates: BTreeSet<SymbolId> = self.base.iter().map(|c| c.velocity).collect();
        let mut result = Vec::new();
        for draft in self.advected.clone() {
            let Some((action, span)) = draft.action else {
                if !self.broken.contains("advected") {
                    let message = format!("advected parameter `{}` has no action", draft.name);
                    self.problem(draft.span, message, "give `xi . a`, for example `cross(Omega, Gamma)`");
                }
                continue;
            };
            if action.shape() != draft.value.shape() {
                let message = format!(
                    "action on `{}` must be {}, found {}",
                    draft.name,
                    draft.value.shape(),
                    action.shape()
                );
                self.problem(span, message, "it is the rate of change of the parameter, up to the sign");
                continue;
            }
            let mut fine = true;
            for e in action.entries() {
                if self.reports_stray(*e, span, &format!("action on `{}`", draft.name), &[]) {
                    fine = false;
                    break;
                }
                let occurring = self.occurring(*e, &fibre);
                let linear = match self.graph.affine_parts(*e, &occurring) {
                    Some((_, offset)) => self.graph.is_zero(offset),
                    None => false,
                };
                if !linear || self.graph.depends_on(*e, &rates) {
                    let message =
                        format!("action on `{}` is not linear in the velocities of the algebra", draft.name);
                    let names: Vec<String> = self.velocities.iter().map(|v| v.name.clone()).collect();
                    self.problem(span, message, short_list("the velocities are", &names));
                    fine = false;
                    break;
                }
            }
            if fine {
                result.push(Advected {
                    name: draft.name,
                    components: draft.components,
                    action: action.into_entries(),
                    doc: draft.doc,
                    span: draft.span,
                });
            }
        }
        result
    }

    /// Positions of a velocity vector or component among all velocities.
    fn velocity_indices(&self, name: &str) -> Vec<usize> {
        let n_base = self.base.len();
        let mut found: Vec<usize> = (0..n_base).filter(|k| self.base[*k].velocity_name == name).collect();
        found.extend(
            (0..self.velocities.len()).filter(|k| self.velocities[*k].name == name).map(|k| k + n_base),
        );
        if found.is_empty() {
            found = (0..self.velocities.len())
                .filter(|k| self.velocities[*k].block == name)
                .map(|k| k + n_base)
                .collect();
        }
        if found.is_empty()
            && let Some(Value::Vector(entries)) = self.values.get(name)
        {
            // A vector of base velocities such as `x_dot`.
            let rates: Vec<SymbolId> = self.base.iter().map(|c| c.velocity).collect();
            for e in entries {
                let at = self.graph.free_symbols(*e).first().and_then(|s| rates.iter().position(|r| r == s));
                found.extend(at);
            }
        }
        found
    }

    fn unknown_velocity(&mut self, name: &str, span: Option<Span>) {
        if self.broken.contains("velocity") {
            return;
        }
        let mut known = self.velocity_names();
        known.extend(self.velocities.iter().map(|v| v.block.clone()));
        known.sort();
        known.dedup();
        let help = names::suggest(name, known.iter().map(String::as_str));
        self.problem(span, format!("`{name}` is not a velocity"), help);
    }

    fn check_forces(&mut self) -> Vec<ExprId> {
        let n = self.base.len() + self.velocities.len();
        let mut forces: Vec<Option<ExprId>> = vec![None; n];
        for (name, value, span) in self.forces.clone() {
            let indices = self.velocity_indices(&name);
            if indices.is_empty() {
                self.unknown_velocity(&name, span);
                continue;
            }
            let wanted = self.values.get(&name).map_or(Shape::Scalar, Value::shape);
            if value.shape() != wanted {
                let message = format!("force on `{name}` must be {wanted}, found {}", value.shape());
                self.problem(span, message, "a force pairs with its velocity component by component");
                continue;
            }
            for (k, e) in indices.into_iter().zip(value.into_entries()) {
                if self.reports_stray(e, span, &format!("force on `{name}`"), &[]) {
                    break;
                }
                if forces[k].is_some() {
                    let taken = self.velocity_names()[k].clone();
                    self.problem(span, format!("force on `{taken}` is given twice"), "add them in one item");
                    break;
                }
                forces[k] = Some(e);
            }
        }
        let zero = self.graph.zero();
        forces.into_iter().map(|f| f.unwrap_or(zero)).collect()
    }

    fn check_scenes(&mut self) -> Vec<Scene> {
        let defaults: BTreeMap<SymbolId, Rational> =
            self.params.iter().map(|p| (p.symbol, p.default.clone())).collect();
        let mut result = Vec::new();
        for draft in self.scenes.clone() {
            let drops = self.check_drops(&draft);
            let circles = self.check_circles(&draft);
            let fixes = draft.fixed.iter().map(|(name, _, span)| (name, span));
            let named = draft.wants.iter().chain(&draft.drops).chain(&drops).chain(&circles);
            let named = named.map(|(name, span)| (name, span));
            let places =
                fixes.chain(named).filter_map(|(name, span)| Some((name.clone(), (*span)?))).collect();
            let [drops, circles] =
                [drops, circles].map(|list| list.into_iter().map(|(name, _)| name).collect());
            let mut scene = Scene { drops, circles, places, ..draft.scene };
            let mut values = defaults.clone();
            let mut places: BTreeMap<SymbolId, Option<Span>> = BTreeMap::new();
            for (name, numbers, span) in draft.fixed {
                let Some(positions) = self.blocks.get(&name).cloned() else {
                    let known: Vec<&str> = self.blocks.keys().map(String::as_str).collect();
                    let help = names::suggest(&name, known);
                    self.problem(
                        span,
                        format!("scene `{}` fixes `{name}`, which is not a parameter", scene.name),
                        help,
                    );
                    continue;
                };
                if positions.len() != numbers.len() {
                    let message =
                        format!("`{name}` has {} components, found {}", positions.len(), numbers.len());
                    let names: Vec<String> = positions.iter().map(|k| self.params[*k].name.clone()).collect();
                    self.problem(span, message, component_help(&names));
                    continue;
                }
                for (k, q) in positions.into_iter().zip(numbers) {
                    let param = &self.params[k];
                    let (component, symbol) = (param.name.clone(), param.symbol);
                    if !places.contains_key(&symbol) {
                        self.here = span;
                        self.check_range(&component, &q);
                    }
                    if places.insert(symbol, span).is_some() {
                        let message = format!("scene `{}` fixes `{component}` twice", scene.name);
                        self.problem(span, message, "keep one of them");
                    }
                    values.insert(symbol, q.clone());
                    scene.fixed.push((component, q));
                }
            }
            for (name, span) in draft.wants {
                let named = |n: &String| *n == name;
                let known = Want::from_name(&name).is_some()
                    || self.casimirs.iter().map(|c| &c.name).any(named)
                    || self.outputs.iter().map(|o| &o.name).chain(&scene.circles).any(named);
                if !(known || self.broken.contains("output") || self.broken.contains("casimir")) {
                    let mut names: Vec<&str> = Want::ALL.map(Want::name).to_vec();
                    names.extend(self.casimirs.iter().map(|c| c.name.as_str()));
                    names.extend(self.outputs.iter().map(|o| o.name.as_str()));
                    names.extend(scene.circles.iter().map(String::as_str));
                    let help = names::suggest(&name, names);
                    self.problem(span, format!("`{name}` is not an output"), help);
                } else if name == Want::Reconstruction.name()
                    && self.reconstructions.is_empty()
                    && !self.broken.contains("reconstruct")
                {
                    let message = format!(
                        "scene `{}` wants `reconstruction`, but the model reconstructs nothing",
                        scene.name
                    );
                    self.problem(span, message, "add an item such as `reconstruct q in SO(3);`");
                } else if scene.wants.iter().any(|wanted| wanted.name() == name) {
                    self.problem(
                        span,
                        format!("scene `{}` wants `{name}` twice", scene.name),
                        "keep one of them",
                    );
                } else {
                    scene.wants.push(Wanted::from_name(&name));
                }
            }
            self.check_scene_conditions(&scene, &places, &values);
            result.push(scene);
        }
        result
    }

    /// The conditions on fixed parameters alone must hold; the others depend on what the user of the scene gives.
    fn check_scene_conditions(
        &mut self,
        scene: &Scene,
        places: &BTreeMap<SymbolId, Option<Span>>,
        values: &BTreeMap<SymbolId, Rational>,
    ) {
        for condition in self.conditions.clone() {
            let mut free = self.graph.free_symbols(condition.greater);
            free.extend(self.graph.free_symbols(condition.less));
            let Some(first) = free.iter().next() else { continue };
            if !free.iter().all(|s| places.contains_key(s)) {
                continue;
            }
            if self.holds(&condition, values) != Some(true) {
                let span = places.get(first).copied().flatten();
                let problem =
                    Diagnostic::new(span, format!("scene `{}` violates `{}`", scene.name, condition.text))
                        .with_place(condition.span, "required here")
                        .with_help("fix the parameters to valid values");
                self.problems.push(problem);
            }
        }
    }
}

fn unit(n: usize, k: usize) -> Vec<Rational> {
    (0..n).map(|i| Rational::from_integer(i64::from(i == k).into())).collect()
}

fn short_list(intro: &str, names: &[String]) -> String {
    let shown: Vec<&str> = names.iter().take(12).map(String::as_str).collect();
    let more = if names.len() > 12 { ", .." } else { "" };
    if shown.is_empty() { String::new() } else { format!("{intro} {}{more}", names::list(&shown)) }
}

pub(super) fn component_help(names: &[String]) -> String {
    short_list("the components are", names)
}

fn shape_of(error: &ValueError) -> String {
    match error {
        ValueError::Argument { found, .. } => found.to_string(),
        other => other.to_string(),
    }
}

/// `v = 0` for a vector `v`.
fn broadcast_zero(g: &mut Graph, left: &Value, right: &Value) -> (Value, Value) {
    let zero = g.zero();
    match (left, right) {
        (Value::Scalar(e), other) if *e == zero => (other.map(|_| zero), other.clone()),
        (other, Value::Scalar(e)) if *e == zero => (other.clone(), other.map(|_| zero)),
        _ => (left.clone(), right.clone()),
    }
}

/// `n_k` lies in `n_{k-1}`, is smaller, not zero, and `[n_{k-1}, n_k]` lies in `n_k`.
fn check_ideal(
    algebra: &LieAlgebra,
    basis: &[String],
    (above_name, above): (&str, &[Vec<Rational>]),
    (name, ideal): (&str, &[Vec<Rational>]),
) -> Result<(), Error> {
    let empty = || Error::EmptyStage { stage: name.to_owned() };
    let outer = Subspace::new(above).ok_or_else(empty)?;
    let inner = Subspace::new(ideal).ok_or_else(empty)?;
    if ideal.iter().any(|v| !outer.contains(v)) {
        return Err(Error::NotNested { stage: name.to_owned(), above: above_name.to_owned() });
    }
    if inner.dim() == 0 || inner.dim() == outer.dim() {
        return Err(empty());
    }
    for x in above {
        for y in ideal {
            let bracket = algebra.bracket_of(x, y);
            if !inner.contains(&bracket) {
                let spell = |v: &[Rational]| crate::error::spell_vector(basis, v);
                return Err(Error::NotAnIdeal {
                    stage: name.to_owned(),
                    above: above_name.to_owned(),
                    pair: [spell(x), spell(y)],
                    bracket: spell(&bracket),
                });
            }
        }
    }
    Ok(())
}
