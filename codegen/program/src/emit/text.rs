//! What the documentation of a scene says, as plain data.
//!
//! Does not know: programs beyond the roles of their functions, any language.

use std::collections::BTreeMap;

use crate::program::Role;
use hamel_expr::Rational;

/// What the documentation of a scene says.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneText {
    /// Name of the model.
    pub model: String,
    /// Name of the scene.
    pub scene: String,
    /// What the first line says after the version: the command that writes the file again, or what to edit instead.
    pub command: String,
    /// The formulation that was chosen, and why; where one was searched for, and where the state is along the levels of
    /// stages.
    pub formulation: Option<String>,
    /// Path of the runtime in the crate that the module is for; empty for `::hamel_runtime`.
    pub runtime: String,
    /// What the system is, a paragraph.
    pub doc: Vec<String>,
    /// Where the equations come from.
    pub sources: Vec<String>,
    /// Parameters in the order of the program.
    pub params: Vec<ParamText>,
    /// Inputs in the order of the program.
    pub inputs: Vec<ParamText>,
    /// Components of the state in the order of the program.
    pub state: Vec<StateText>,
    /// Outputs, the functions [`Role::Output`] of the program.
    pub outputs: Vec<OutputText>,
    /// Outputs that are the entries of a matrix.
    pub matrices: Vec<MatrixText>,
    /// Functions of a vector besides time and state.
    pub products: Vec<ProductText>,
    /// The implicit form, where the scene wants it.
    pub implicit: Option<ImplicitText>,
    /// The discrete equations, where the scene has them.
    pub discrete: Option<DiscreteText>,
    /// The map of the quotient, where the scene wants it.
    pub quotient: Option<QuotientText>,
    /// The equations between coordinates, where the scene wants them.
    pub positions: Option<PositionsText>,
    /// The rows whose rank a motion may lose, where the scene has them.
    pub ranks: Option<RanksText>,
    /// The exact flows, the functions [`Role::Flow`] of the program.
    pub flows: Vec<FlowText>,
    /// Units, as far as they are known.
    pub units: UnitTexts,
    /// Events; their functions are the output `events`, what each sets is an output.
    pub events: Vec<EventText>,
    /// Formula lines of functions, by role.
    pub formulas: BTreeMap<Role, Vec<String>>,
    /// The initial state for the parameters' defaults, where there is one.
    pub initial: Option<InitialText>,
    /// Whether the energy is proved to be constant along the motion.
    pub conserves_energy: bool,
    /// States whose rates a test within the module compares; none for a module without one.
    pub self_test: Vec<SelfTestText>,
    /// What parameters and components of the state form together, for a module that speaks in the types of
    /// `nalgebra`; none for a module that does without.
    pub groups: Option<GroupTexts>,
}

/// A state and its rates, as they were when the module was written.
#[derive(Clone, Debug, PartialEq)]
pub struct SelfTestText {
    /// Parameters in the order of the program.
    pub params: Vec<f64>,
    /// The time.
    pub t: f64,
    /// The state.
    pub state: Vec<f64>,
    /// Its rates.
    pub rates: Vec<f64>,
}

/// The initial state of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct InitialText {
    /// The values in the order of the state.
    pub values: Vec<f64>,
    /// What the model does not give, or gives otherwise; empty where it gives all.
    pub told: String,
}

impl InitialText {
    /// What the state is, a paragraph each.
    pub(super) fn doc(&self) -> Vec<String> {
        let first = "The initial state of the model, for the parameters as published.".to_owned();
        let told = Some(&self.told).filter(|told| !told.is_empty());
        let told = told.map(|told| format!("Beside the values of the model, {told}."));
        std::iter::once(first).chain(told).collect()
    }
}

/// The equations between coordinates of a scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PositionsText {
    /// The output with the residuals, and behind them what coordinates keep.
    pub values: String,
    /// The matrix whose rows are their gradients.
    pub gradients: String,
    /// How many of them have to vanish.
    pub n_equations: usize,
    /// Components of the state that are moved to solve the equations.
    pub moved: Vec<usize>,
}

/// Rows of a matrix that a motion keeps independent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RanksText {
    /// The matrix.
    pub matrix: String,
    /// Which of its rows they are.
    pub rows: Vec<usize>,
    /// Components of the state that they depend on.
    pub moving: Vec<usize>,
}

/// What the module of a fluid that is moved as products of matrices says.
#[derive(Clone, Debug, PartialEq)]
pub struct FluidText {
    /// Name of the model.
    pub model: String,
    /// What the first line says after the version.
    pub command: String,
    /// Path of the runtime in the crate that the module is for; empty for `::hamel_runtime`.
    pub runtime: String,
    /// What the system is, a paragraph.
    pub doc: Vec<String>,
    /// Where the equations come from.
    pub sources: Vec<String>,
    /// Where the fluid flows.
    pub surface: SurfaceText,
    /// Size of the matrices.
    pub n: usize,
    /// What the vorticity is.
    pub vorticity: String,
    /// Parameters by name, with the values that all numbers belong to.
    pub params: Vec<(String, f64)>,
    /// Factor and shift of the stream function, unless the fluid is an ideal one.
    pub stream: Option<[f64; 2]>,
    /// The constant stream function.
    pub background: Vec<FluidTermText>,
    /// Fields that the flow carries.
    pub carried: Vec<CarriedText>,
    /// Coefficients of powers of minus the Laplacian in the friction.
    pub friction: Vec<f64>,
    /// The constant force.
    pub force: Vec<FluidTermText>,
    /// Modes that begin with another value than zero, or are looked at: names, and values at time zero.
    pub modes: Vec<FluidModeText>,
    /// Casimirs by name.
    pub casimirs: Vec<(String, TraceText)>,
}

/// A field that the flow carries.
#[derive(Clone, Debug, PartialEq)]
pub struct CarriedText {
    /// Its name.
    pub name: String,
    /// Coefficients of powers of minus the Laplacian in its current, where the field has an energy.
    pub current: Option<Vec<f64>>,
    /// The constant part of its current.
    pub constant: Vec<FluidTermText>,
}

/// A mode of a fluid.
#[derive(Clone, Debug, PartialEq)]
pub struct FluidModeText {
    /// Its name.
    pub name: String,
    /// The number of the carried field, without one the vorticity.
    pub field: Option<usize>,
    /// Its coefficient, and its value at time zero.
    pub term: FluidTermText,
}

/// A number times a trace of a product of matrices, by their size.
#[derive(Clone, Debug, PartialEq)]
pub struct TraceText {
    /// The number.
    pub factor: f64,
    /// The power of the matrix, from 1 on.
    pub power: usize,
    /// The number of the carried field, without one the vorticity.
    pub field: Option<usize>,
    /// Whether the vorticity is a factor beside the power of a carried field.
    pub is_cross: bool,
}

/// Where a fluid flows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SurfaceText {
    /// The torus.
    Torus,
    /// The sphere.
    Sphere,
}

/// A coefficient of a function on a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct FluidTermText {
    /// Its wave vector, or degree and order.
    pub wave: (i64, i64),
    /// Whether it is the imaginary part, or the coefficient of the sine.
    pub is_second: bool,
    /// Its value.
    pub value: f64,
}

/// Parameters, and components of the state, that form something together.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GroupTexts {
    /// Among the parameters.
    pub params: Vec<GroupText>,
    /// Among the components of the state.
    pub state: Vec<GroupText>,
}

/// Numbers that form a vector, a matrix, an attitude or a place.
#[derive(Clone, Debug, PartialEq)]
pub struct GroupText {
    /// Its name in the model.
    pub name: String,
    /// What it is.
    pub kind: GroupKind,
    /// Positions of the numbers among the parameters or components, in the order that the kind says.
    pub components: Vec<usize>,
}

/// What a [`GroupText`] is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GroupKind {
    /// A vector.
    Vector,
    /// A diagonal matrix by its diagonal.
    Diagonal,
    /// A symmetric matrix of so many rows by its upper triangle, row by row.
    Symmetric(usize),
    /// A matrix of so many rows and columns, row by row.
    Matrix(usize, usize),
    /// The quaternion `w, x, y, z` of a rotation from body to space.
    Attitude,
    /// Attitude and position: the quaternion, then three coordinates.
    Place,
    /// A place in the plane: the angle from space to body, then two coordinates.
    PlanarPlace,
}

impl GroupKind {
    /// How many numbers it takes; any for vectors and diagonals.
    pub fn n_components(self) -> Option<usize> {
        match self {
            GroupKind::Vector | GroupKind::Diagonal => None,
            GroupKind::Symmetric(n) => Some(n * (n + 1) / 2),
            GroupKind::Matrix(n, m) => Some(n * m),
            GroupKind::Attitude => Some(4),
            GroupKind::Place => Some(7),
            GroupKind::PlanarPlace => Some(3),
        }
    }
}

/// Units of what a scene has, as far as they are known.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct UnitTexts {
    /// Of the time.
    pub time: Option<UnitText>,
    /// Of the energy.
    pub energy: Option<UnitText>,
    /// Of parameters, inputs and components of the state, by name.
    pub of_name: BTreeMap<String, UnitText>,
    /// Of the rates of components of the state, by the name of the component.
    pub of_rate: BTreeMap<String, UnitText>,
    /// Of components of outputs, by the name of the output and the position.
    pub of_output: BTreeMap<(String, usize), UnitText>,
}

/// A unit.
#[derive(Clone, Debug, PartialEq)]
pub struct UnitText {
    /// As it is written.
    pub name: String,
    /// Exponents of kg, m, s, A, K, mol, cd and rad.
    pub exponents: [i64; 8],
    /// How many of the product of base units it is.
    pub factor: f64,
}

/// A parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct ParamText {
    /// Name.
    pub name: String,
    /// Value of the scene as published.
    pub default: Rational,
    /// Meaning and unit.
    pub doc: String,
}

/// A component of the state.
#[derive(Clone, Debug, PartialEq)]
pub struct StateText {
    /// Name.
    pub name: String,
    /// Meaning and unit.
    pub doc: String,
}

/// An output.
#[derive(Clone, Debug, PartialEq)]
pub struct OutputText {
    /// Name of the output and of its function.
    pub name: String,
    /// Names of the components; a scalar has one.
    pub components: Vec<String>,
    /// Meaning and unit.
    pub doc: String,
}

/// A matrix, the output of the same name being its entries.
#[derive(Clone, Debug, PartialEq)]
pub struct MatrixText {
    /// Name of the matrix and of its output.
    pub name: String,
    /// Numbers of rows and columns.
    pub shape: (usize, usize),
    /// Row and column of each entry; the others are zero.
    pub pattern: Vec<(usize, usize)>,
    /// Whether the entries are those above the diagonal of a matrix `a_ji = -a_ij`.
    pub is_antisymmetric: bool,
    /// Meaning.
    pub doc: String,
}

/// An event.
#[derive(Clone, Debug, PartialEq)]
pub struct EventText {
    /// Name.
    pub name: String,
    /// Whether it is told where its function rises, and where it falls.
    pub directions: (bool, bool),
    /// Whether it happens as well where another event leaves its function negative.
    pub is_condition: bool,
    /// Whether it ends the motion.
    pub stops: bool,
    /// The output with what it sets, and the positions in the state of its components; none where it sets nothing.
    pub sets: Option<(String, Vec<usize>)>,
}

/// A function that takes a vector besides time and state.
#[derive(Clone, Debug, PartialEq)]
pub struct ProductText {
    /// Name of the product and of its function, [`Role::Product`].
    pub name: String,
    /// Name of the vector.
    pub vector: String,
    /// Names of the results.
    pub components: Vec<String>,
    /// Meaning.
    pub doc: String,
}

/// An exact flow of a part of the motion.
#[derive(Clone, Debug, PartialEq)]
pub struct FlowText {
    /// Name of the function, [`Role::Flow`].
    pub name: String,
    /// The linear forms of the state that the part of the Hamiltonian is a function of.
    pub forms: Vec<String>,
}

/// An implicit form `M z' = f(t, z)`.
#[derive(Clone, Debug, PartialEq)]
pub struct ImplicitText {
    /// The function `f`, [`Role::OfVariables`].
    pub right_side: String,
    /// The function of the entries of `df/dz`, and the name of that matrix.
    pub jacobian: String,
    /// The output with the variables at a state.
    pub values: String,
    /// The variables in order.
    pub variables: Vec<ImplicitVariableText>,
    /// The differential index.
    pub index: usize,
    /// Row and column of each entry of `df/dz`; the others are zero.
    pub pattern: Vec<(usize, usize)>,
    /// The place among the variables of each component of the state.
    pub state: Vec<usize>,
}

/// Discrete equations of motion: functions of time and of `(h, y, z)`, the step, the state and the unknowns.
#[derive(Clone, Debug, PartialEq)]
pub struct DiscreteText {
    /// The function of first values of the unknowns, [`Role::OfVariables`], and its title.
    pub start: (String, String),
    /// That of the rows.
    pub residual: (String, String),
    /// That of the entries of their derivatives by the unknowns.
    pub jacobian: (String, String),
    /// Names of the unknowns.
    pub unknowns: Vec<String>,
    /// Row and column of each entry.
    pub pattern: Vec<(usize, usize)>,
    /// The place among the unknowns of each component of the state at the end.
    pub state: Vec<usize>,
}

/// The map from the state and the parameters of the system that the model is the quotient of.
#[derive(Clone, Debug, PartialEq)]
pub struct QuotientText {
    /// The file of that system's model.
    pub file: String,
    /// Names of the components of its state, which come first among the variables of the functions.
    pub state: Vec<String>,
    /// Names of its parameters, which come after them.
    pub params: Vec<String>,
    /// The function of the state, [`Role::OfVariables`], and its title.
    pub of_state: (String, String),
    /// The function of the parameters, where the scene has some.
    pub of_params: Option<(String, String)>,
}

/// A variable of an implicit form.
#[derive(Clone, Debug, PartialEq)]
pub struct ImplicitVariableText {
    /// Name.
    pub name: String,
    /// Meaning and unit.
    pub doc: String,
    /// Whether its row is a differential equation.
    pub is_differential: bool,
}
