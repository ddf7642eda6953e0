//! Every error of the crate. Variants carry data; the text says what is wrong and what to change.

use std::fmt;

use crate::{Exhausted, Scalar};

/// What can be wrong with a system, from its algebra to its emitted code.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Error {
    /// A bracket was given twice with different values, or `[e, e]` is not zero.
    NotAntisymmetric {
        /// First basis element.
        a: String,
        /// Second basis element.
        b: String,
    },
    /// The Jacobi identity fails for a triple of basis elements.
    JacobiViolated {
        /// The triple.
        triple: [String; 3],
        /// `[[a, b], c] + [[b, c], a] + [[c, a], b]`, spelled out.
        residual: String,
    },
    /// The anchor is not a homomorphism of brackets.
    AnchorViolated {
        /// The pair of sections.
        pair: [String; 2],
        /// Component of the base whose coefficient differs.
        component: String,
        /// `[rho(a), rho(b)] - rho([a, b])` in that component.
        residual: String,
    },
    /// Matrices do not represent the algebra.
    NotARepresentation {
        /// The pair of basis elements.
        pair: [String; 2],
        /// Row and column, from 1, where `rho([a, b]) - [rho(a), rho(b)]` does not vanish.
        entry: (usize, usize),
        /// Its value there.
        residual: String,
    },
    /// A construction that exists only for other algebras or sizes.
    Unsupported {
        /// What was asked for.
        what: String,
        /// What is possible.
        possible: String,
    },
    /// A function of a scene is not what it is said to be: a fault of the generator, found before anything is written.
    Disagrees {
        /// The scene.
        scene: String,
        /// The function.
        function: String,
        /// The row of its definition.
        what: String,
        /// The residual beside the terms of the row.
        residual: f64,
    },
    /// Sizes that have to agree do not.
    ShapeMismatch {
        /// The object.
        what: String,
        /// Its size.
        found: usize,
        /// The size it should have.
        expected: usize,
    },
    /// A name is not known where it stands.
    UnknownName {
        /// The name.
        name: String,
        /// What kind of thing it should name.
        kind: &'static str,
        /// The names that exist.
        known: Vec<String>,
    },
    /// A stage is not contained in the one above it.
    NotNested {
        /// Name of the stage.
        stage: String,
        /// Name of the stage above.
        above: String,
    },
    /// A stage is not an ideal of the one above it.
    NotAnIdeal {
        /// Name of the stage.
        stage: String,
        /// Name of the stage above.
        above: String,
        /// An element of the stage above and one of the stage whose bracket leaves the stage.
        pair: [String; 2],
        /// That bracket.
        bracket: String,
    },
    /// A stage has the dimension of the one above it, or is zero.
    EmptyStage {
        /// Name of the stage.
        stage: String,
    },
    /// An inner product is singular on a subspace that has to be split off.
    DegenerateInnerProduct {
        /// Name of the stage.
        stage: String,
    },
    /// The metric of the Lagrangian is no function of shape and time, so that it is no inner product for stages.
    InnerProductDependsOn {
        /// What sort of thing it depends on.
        kind: &'static str,
        /// The name of that.
        name: String,
    },
    /// The bracket rebuilt from the stage forms is not the bracket that was split.
    RebuiltBracketDiffers {
        /// The pair of adapted basis elements.
        pair: [String; 2],
    },
    /// A constraint follows from the others.
    DependentConstraint {
        /// The constraint as written.
        constraint: String,
    },
    /// The derivative of an equation between positions follows from the other constraints: the equation says the same
    /// as they do, or contradicts them.
    DependentPositions {
        /// The equation as written.
        constraint: String,
    },
    /// A constraint contradicts the others.
    InconsistentConstraint {
        /// The constraint as written.
        constraint: String,
    },
    /// The velocities asked to be independent do not determine the others.
    NotSolvable {
        /// The velocities that were to be dependent.
        dependent: Vec<String>,
        /// A choice that works.
        possible: Vec<String>,
    },
    /// A constraint that is said to give a velocity, and does not when those before it are solved.
    NotGiven {
        /// The constraint as written.
        constraint: String,
        /// The velocity.
        velocity: String,
    },
    /// Equations that coordinates are to be given by do not determine their rates anywhere.
    UndeterminedPositions {
        /// The equations, as written.
        equations: Vec<String>,
        /// Rates of the coordinates.
        names: Vec<String>,
    },
    /// The mass matrix is singular everywhere.
    SingularMassMatrix {
        /// A direction of the velocity space with zero inertia.
        direction: String,
    },
    /// The Lagrangian is degenerate, and one of its equations without accelerations does not become an equation of
    /// motion.
    EquationLeft {
        /// The velocities without inertia.
        direction: String,
        /// The equation.
        equation: String,
        /// Why it does not.
        reason: &'static str,
    },
    /// The Lagrangian is degenerate, and nothing determines a velocity.
    Undetermined {
        /// The combination of velocities.
        velocity: String,
    },
    /// A derived connection depends on something that it cannot be made of.
    ConnectionDependsOn {
        /// The kind of connection.
        connection: &'static str,
        /// What sort of thing it depends on.
        kind: &'static str,
        /// The name of that.
        name: String,
        /// What depends on it and is part of the connection.
        through: &'static str,
        /// A velocity of the algebra, for the text.
        velocity: String,
    },
    /// The kinetic energy does not determine the vertical part of a horizontal vector.
    NoHorizontalSpace {
        /// The kind of connection.
        connection: &'static str,
        /// A velocity of the algebra without inertia.
        direction: String,
    },
    /// Something claimed to be conserved is not.
    NotConserved {
        /// Its name.
        name: String,
        /// Its rate along the motion, cut where it is long.
        rate: String,
    },
    /// Momenta are to be carried that do not determine the velocities linearly.
    NotQuadratic {
        /// A velocity on which an entry of the Hessian `L_yy` depends.
        velocity: String,
    },
    /// A momentum that is to be a parameter moves.
    NotCyclic {
        /// The velocity whose momentum it is.
        velocity: String,
        /// The parameter.
        parameter: String,
        /// What contradicts that: the rate of the momentum, or a rate that depends on the coordinate.
        reason: String,
        /// The item with the function up to which it is a parameter, where one was found.
        up_to: Option<String>,
    },
    /// Something claimed to be conserved could not be shown to be, nor not to be.
    ConservationUnverified {
        /// Its name.
        name: String,
        /// Its rate along the motion, cut where it is long.
        rate: String,
    },
    /// Something that a model has to satisfy could not be shown to hold, nor not to hold.
    Unverified {
        /// What has to hold.
        claim: String,
        /// What would have to vanish.
        residual: String,
        /// Component of the base that it is about.
        component: Option<String>,
    },
    /// A scene wants its invariants and has none.
    NothingConserved {
        /// Name of the scene.
        scene: String,
    },
    /// A scene wants equations between coordinates that it does not have.
    NoPositions {
        /// Why not.
        reason: String,
    },
    /// A system has no nonholonomic bracket.
    NoBracket {
        /// Why not.
        reason: String,
    },
    /// A motion has no discrete equations.
    NoDiscrete {
        /// What stands in the way.
        reason: String,
    },
    /// A motion was not split into motions with flows in closed form.
    NoSplitting {
        /// What stands in the way.
        reason: String,
    },
    /// A scene wants phases that there are not.
    NoPhases {
        /// Why not.
        reason: String,
    },
    /// A scene wants a connection that there is not.
    NoConnection {
        /// Why not.
        reason: String,
    },
    /// A scene wants a Dirac structure that has no matrices.
    NoDirac {
        /// Why not.
        reason: String,
    },
    /// A scene wants the map of a quotient that does not lead to its state.
    NoQuotient {
        /// Why not.
        reason: String,
    },
    /// No time was found in which a motion is Hamiltonian.
    NoHamiltonianTime {
        /// Why not.
        reason: String,
    },
    /// There are more or fewer conditions on virtual displacements than constraints.
    WrongNumberOfDisplacements {
        /// How many conditions there are.
        found: usize,
        /// How many constraints there are.
        expected: usize,
        /// How many velocities there are, whose accelerations are to be determined.
        velocities: usize,
    },
    /// Reactions that change nothing of what the constraints restrict.
    NoResponse {
        /// A combination of multipliers.
        multipliers: String,
    },
    /// A function to which no force gives its rate at every velocity: the matching condition fails.
    NoMatching {
        /// The function.
        function: String,
        /// The force.
        force: String,
        /// What would have to be zero, or why nothing is divided.
        reason: String,
        /// What to change.
        help: &'static str,
    },
    /// Virtual displacements depend on an acceleration that the constraints do not determine.
    UndeterminedAcceleration {
        /// The condition on displacements.
        condition: String,
        /// The acceleration.
        acceleration: String,
    },
    /// An event sets what the state of a scene does not carry.
    EventSets {
        /// The event.
        event: String,
        /// What it sets.
        target: String,
        /// The scene.
        scene: String,
        /// What its state carries.
        state: Vec<String>,
    },
    /// An exact number that no `f64` comes near: too large, or not zero and too small.
    OutOfRange {
        /// What has that value.
        what: String,
    },
    /// A derivation or a program outgrows the budget.
    OverBudget(Exhausted),
    /// The number of independent velocities asked for is not the number there is.
    WrongNumberOfIndependent {
        /// How many were named.
        found: usize,
        /// How many there are.
        expected: usize,
    },
    /// A division by something that vanishes identically.
    DivisionByZero {
        /// Where it happened.
        place: String,
    },
    /// What should name the runtime in emitted code is no path.
    NotAPath {
        /// What was given.
        text: String,
    },
    /// An FMU, which has start values of its states, of a model that gives none.
    NoInitialState {
        /// The model.
        model: String,
    },
    /// No coordinates near a model's initial values satisfy the equations between them.
    NoStart {
        /// The model.
        model: String,
        /// Which equation is not met, and by how much.
        reason: String,
    },
    /// A number of a model that single precision does not have.
    NotSingle {
        /// The number.
        number: String,
        /// What it is in single precision.
        becomes: &'static str,
    },
    /// Emitted text does not parse as Rust; a bug of the emitter, never of the model.
    Emission {
        /// The model.
        model: String,
        /// What the parser said.
        reason: String,
    },
    /// A lowered program breaks a rule of the intermediate form; a bug of a pass.
    Program {
        /// What is wrong.
        reason: String,
    },
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (message, help) = self.message_and_help();
        f.write_str(&message)?;
        if help.is_empty() { Ok(()) } else { write!(f, "; {help}") }
    }
}

impl std::error::Error for Error {}

impl From<Exhausted> for Error {
    fn from(exhausted: Exhausted) -> Error {
        Error::OverBudget(exhausted)
    }
}

/// What a Lagrangian without enough inertia lacks.
const KINETIC: &str = "the lagrangian needs kinetic energy in every direction that the constraints allow";

impl Error {
    /// What is wrong, and what to change (may be empty).
    pub fn message_and_help(&self) -> (String, String) {
        match self {
            Error::NotAntisymmetric { a, b } => (
                format!("bracket [{a}, {b}] is not antisymmetric"),
                "give each pair once and leave [e, e] out".into(),
            ),
            Error::JacobiViolated { triple: [a, b, c], residual } => (
                format!("bracket [{a}, {b}] fails Jacobi with {c}: residual {residual}"),
                format!("[[{a}, {b}], {c}] + [[{b}, {c}], {a}] + [[{c}, {a}], {b}] has to vanish"),
            ),
            Error::AnchorViolated { pair: [a, b], component, residual } => (
                format!(
                    "action of [{a}, {b}] is not the commutator of their actions: residual {residual} in {component}"
                ),
                "an action satisfies [x, y] . a = x . (y . a) - y . (x . a): check its sign".into(),
            ),
            Error::NotARepresentation { pair: [a, b], entry: (row, column), residual } => (
                format!(
                    "matrices of {a} and {b} do not represent [{a}, {b}]: residual {residual} in row {row}, column {column}"
                ),
                format!("rho([{a}, {b}]) has to be rho({a}) rho({b}) - rho({b}) rho({a})"),
            ),
            Error::Unsupported { what, possible } => {
                (format!("{what} does not exist"), format!("possible: {possible}"))
            }
            Error::Disagrees { scene, function, what, residual } => (
                format!(
                    "internal: {function} of scene {scene} disagrees with its definition: {what} is off by {residual:.1e} \
                     of its terms"
                ),
                "nothing was written; please report this with the model".into(),
            ),
            Error::ShapeMismatch { what, found, expected } => {
                (format!("{what} has size {found}, expected {expected}"), String::new())
            }
            Error::UnknownName { name, kind, known } => {
                (format!("{name} is not a {kind}"), format!("known: {}", known.join(", ")))
            }
            Error::NotNested { stage, above } => (
                format!("stage {stage} is not contained in stage {above}"),
                "every ideal lies in the one above it".into(),
            ),
            Error::NotAnIdeal { stage, above, pair: [a, b], bracket } => (
                format!("stage {stage} is not an ideal of {above}: [{a}, {b}] = {bracket} leaves it"),
                "add the missing directions".into(),
            ),
            Error::EmptyStage { stage } => (
                format!("stage {stage} splits nothing off"),
                "it has to be smaller than the stage above and not zero".into(),
            ),
            Error::DegenerateInnerProduct { stage } => (
                format!(
                    "inner product is degenerate on stage {stage}, so the stage has no orthogonal complement"
                ),
                "use a definite one".into(),
            ),
            Error::InnerProductDependsOn { kind, name } => (
                format!("the metric of the lagrangian depends on {kind} {name}, and stages need one of the shape"),
                "write an inner product of parameters: `inner_product = [[..], ..];`".into(),
            ),
            Error::RebuiltBracketDiffers { pair: [a, b] } => (
                format!("bracket [{a}, {b}] rebuilt from the stage forms differs from the original"),
                String::new(),
            ),
            Error::DependentConstraint { constraint } => {
                (format!("constraint {constraint} follows from the others"), "remove it".into())
            }
            Error::DependentPositions { constraint } => (
                format!("the derivative of {constraint} follows from the other constraints"),
                "remove it: it says the same as they do, or no positions satisfy all of them".into(),
            ),
            Error::InconsistentConstraint { constraint } => (
                format!("constraint {constraint} contradicts the others"),
                "no velocity satisfies all of them".into(),
            ),
            Error::NotSolvable { dependent, possible } => (
                format!("constraints cannot be solved for {}", dependent.join(", ")),
                format!("they can be solved for {}", possible.join(", ")),
            ),
            Error::NotGiven { constraint, velocity } => (
                format!("constraint {constraint} does not give {velocity}"),
                "nothing is left of the coefficient of this velocity when constraints before it are solved: name \
                 another velocity, or another order"
                    .to_owned(),
            ),
            Error::UndeterminedPositions { equations, names } => (
                format!("{} cannot be solved for {} anywhere", equations.join(", "), names.join(", ")),
                "the derivatives of the equations by the coordinates that they give have a determinant that does not \
                 vanish identically"
                    .to_owned(),
            ),
            Error::EquationLeft { direction, equation, reason } => (
                format!(
                    "mass matrix is singular everywhere: no inertia along {direction}, and the equation of motion that is \
                     left there, {equation}, {reason}"
                ),
                format!("{KINETIC}, or else equations that are linear in the velocities and determine them"),
            ),
            Error::Undetermined { velocity } => (
                format!("mass matrix is singular everywhere, and no equation of motion determines {velocity}"),
                format!("{KINETIC}; a velocity that means nothing needs a constraint that fixes it"),
            ),
            Error::SingularMassMatrix { direction } => (
                format!("mass matrix is singular everywhere: no inertia along {direction}"),
                KINETIC.into(),
            ),
            Error::ConnectionDependsOn { connection, kind, name, through, velocity } => (
                format!("connection {connection} depends on the {kind} {name} through {through}"),
                format!(
                    "a connection is made of base coordinates, time and parameters: give one with `connection {velocity} = ..;` or write `connection trivial;`"
                ),
            ),
            Error::NoHorizontalSpace { connection, direction } => (
                format!("connection {connection} does not exist: no inertia along {direction}"),
                "it needs kinetic energy in every direction of the algebra that virtual displacements may have"
                    .into(),
            ),
            Error::NotConserved { name, rate } => (
                format!("casimir {name} is not conserved by these equations: its rate is {rate}"),
                format!("write `output {name} = ..;` instead"),
            ),
            Error::NotQuadratic { velocity } => (
                format!(
                    "momenta cannot be carried: the lagrangian is not quadratic in the velocities, its Hessian contains {velocity}"
                ),
                "carry velocities, without `carry` and `routh`; a `hamiltonian` in momenta may be of any kind".into(),
            ),
            Error::NotCyclic { velocity, parameter, reason, up_to } => (
                format!("the momentum along {velocity} is no parameter: {reason}"),
                match up_to {
                    Some(item) => format!("it is one up to a function: write `{item}`"),
                    None => format!("carry it as state: `momentum {parameter}_{velocity} of {velocity}; carry {parameter}_{velocity};`"),
                },
            ),
            Error::ConservationUnverified { name, rate } => (
                format!(
                    "casimir {name} could not be verified: its rate {rate} could not be shown to vanish, nor not to"
                ),
                format!("write `output {name} = ..;` instead, or {WRITE_WITH_KNOWN_FUNCTIONS}"),
            ),
            Error::Unverified { claim, residual, .. } => (
                format!("{claim} could not be verified: {residual} could not be shown to vanish, nor not to"),
                WRITE_WITH_KNOWN_FUNCTIONS.into(),
            ),
            Error::NothingConserved { scene } => (
                format!("scene {scene} has no invariant besides components of its state"),
                "claim one that you know with `casimir name = ..;`".into(),
            ),
            Error::NoPositions { reason } => (
                format!("there are no equations between coordinates: {reason}"),
                "remove `positions` from what the scene wants, or keep what they contain".into(),
            ),
            Error::NoBracket { reason } => (
                format!("there is no nonholonomic bracket: {reason}"),
                "remove `bracket` from what the scene wants".into(),
            ),
            Error::NoDiscrete { reason } => (
                format!("there are no discrete equations: {reason}"),
                "remove `discrete` and `retraction` from the scene".into(),
            ),
            Error::NoSplitting { reason } => (
                format!("there is no splitting into exact flows: {reason}"),
                "remove `splitting` from what the scene wants; `carry` momenta in the place of velocities, where the state \
                 has velocities"
                    .into(),
            ),
            Error::EventSets { event, target, scene, state } => (
                format!("event `{event}` sets `{target}`, which the state of scene {scene} does not carry"),
                format!("it carries {}", state.join(", ")),
            ),
            Error::NoQuotient { reason } => (
                format!("there is no function `quotient`: {reason}"),
                "want it in a scene whose state and free parameters the functions of `reduces` give".into(),
            ),
            Error::NoPhases { reason } => (
                format!("there are no phases: {reason}"),
                "give a `connection` along the velocity of the angle, or make the momentum of a cyclic coordinate a \
                 parameter with `routh`"
                    .into(),
            ),
            Error::NoConnection { reason } => (
                format!("there is no connection to tell: {reason}"),
                "write `connection mechanical;` or `connection nonholonomic;`, or one by its components; beside fields \
                 and constraints alone none is needed"
                    .into(),
            ),
            Error::NoDirac { reason } => (
                format!("the Dirac structure has no matrices: {reason}"),
                "leave `multipliers;` out, so that constraints are solved for velocities, or `dirac` out of what the scene \
                 wants; `hamel explain --dirac` writes the structure"
                    .into(),
            ),
            Error::NoHamiltonianTime { reason } => (
                format!("no time was found in which the motion is Hamiltonian: {reason}"),
                "remove `hamiltonian_time` from what the scene wants".into(),
            ),
            Error::WrongNumberOfDisplacements { found, expected, velocities } => (
                format!(
                    "{found} {} on virtual displacements, expected {expected}",
                    if *found == 1 { "condition" } else { "conditions" }
                ),
                unequal_ranks(*found, *expected, *velocities),
            ),
            Error::NoResponse { multipliers } => (
                format!("the constraints do not determine {multipliers}: that reaction changes nothing that they restrict"),
                "let the reaction act on what is restricted, with other `virtual` conditions; constraints must not depend on each other".into(),
            ),
            Error::NoMatching { function, force, reason, help } => (
                format!("no force `{force}` gives `{function}` its rate at every velocity: {reason}"),
                (*help).into(),
            ),
            Error::UndeterminedAcceleration { condition, acceleration } => (
                format!("condition `{condition}` depends on `{acceleration}`, which the constraints do not determine"),
                "virtual displacements depend on accelerations that follow from the constraints: add a constraint on it; one of third order makes it a part of the state".into(),
            ),
            Error::OutOfRange { what } => (
                format!("{what} is out of the range of f64, about 1e-308 to 1e308"),
                "choose units in which it is moderate".into(),
            ),
            Error::OverBudget(exhausted) => (exhausted.message(), exhausted.help().into()),
            Error::WrongNumberOfIndependent { found, expected } => (
                format!("independent names {found} velocities"),
                format!("the constraints leave {expected}"),
            ),
            Error::DivisionByZero { place } => {
                (format!("division by an expression that is identically zero in {place}"), String::new())
            }
            Error::NotAPath { text } => (
                format!("`{text}` is not a path of a module"),
                "write `::hamel_runtime` or `crate::runtime`".into(),
            ),
            Error::NoInitialState { model } => (
                format!("an FMU has start values of its states, and {model} does not give them all"),
                "give each component of the state a value, such as `initial x = 1;`".into(),
            ),
            Error::NoStart { model, reason } => (
                format!("the initial state of {model} violates an equation between coordinates: {reason}"),
                "give `initial` coordinates for which the equations can be met, or other defaults of the parameters"
                    .into(),
            ),
            Error::NotSingle { number, becomes } => (
                format!("the number {number} is {becomes} in single precision"),
                "choose other units, or generate it in double precision".into(),
            ),
            Error::Emission { model, reason } => {
                (format!("code emitted for {model} is not Rust: {reason}"), PLEASE_REPORT.into())
            }
            Error::Program { reason } => {
                (format!("lowered program is malformed: {reason}"), PLEASE_REPORT.into())
            }
        }
    }
}

const WRITE_WITH_KNOWN_FUNCTIONS: &str =
    "write it with functions whose identities are known, such as sin, exp and sqrt of sums of squares";

const PLEASE_REPORT: &str = "please report this";

/// Spells a vector in a basis: `2 e1 - 1/2 e3`, or `0`.
pub fn spell_vector<Q: Scalar>(basis: &[String], vector: &[Q]) -> String {
    let mut text = String::new();
    for (name, q) in basis.iter().zip(vector).filter(|(_, q)| !q.is_zero()) {
        let (negative, magnitude) = q.spelled();
        text.push_str(match (text.is_empty(), negative) {
            (true, false) => "",
            (true, true) => "-",
            (false, false) => " + ",
            (false, true) => " - ",
        });
        if magnitude != "1" {
            text.push_str(&format!("{magnitude} "));
        }
        text.push_str(name);
    }
    if text.is_empty() { "0".into() } else { text }
}

/// What is wrong with another number of conditions on displacements than of constraints, and what to do.
fn unequal_ranks(found: usize, expected: usize, velocities: usize) -> String {
    let along = velocities.saturating_sub(found);
    let total = format!(
        "unknown accelerations: {velocities}, equations along the displacements: {along}, constraints: {expected}"
    );
    match (expected.checked_sub(found), found.saturating_sub(expected)) {
        (Some(more), _) => format!("{total}; add {more} `virtual`"),
        (None, less) => format!("{total}; remove {less} `virtual`, or add as many constraints"),
    }
}
