//! Derivatives of the right-hand side that a scene can want, as functions beside it.
//!
//! Deliberately does not know: how anything is differentiated, lowered or emitted.

use std::collections::{BTreeMap, BTreeSet};

use hamel_expr::differentiate::{Linear, Linearisation, Solved};
use hamel_expr::error::Error;
use hamel_expr::{ExprId, Graph, Section, SectionWriter, SymbolId, Trials, Workspace, needed_sections};
use hamel_lang::spec::Want;
use hamel_mechanics::mechanics::{Equations, Output, StateEquation};
use hamel_program::lower::{Inputs, Request};
use hamel_program::program::Role;

/// A derivative of `dy/dt = f(t, y; p)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Derivative {
    /// The matrix `df_i/dy_j`.
    Jacobian,
    /// Its product `J v` with a direction of the state.
    Jvp,
    /// The product `J^T w` of its transpose with a covector.
    Vjp,
    /// `df/dt` at a fixed state.
    TimeDerivative,
    /// The matrix `df_i/dp_j` for the parameters that the scene leaves free.
    Sensitivity,
    /// Its product with a direction of the parameters.
    SensitivityJvp,
    /// The product of its transpose with a covector.
    SensitivityVjp,
    /// The matrix `df_i/du_j` for the inputs that the scene takes.
    InputJacobian,
    /// The matrix `dh_i/dy_j` of the outputs `h(t, y; u)` of the model.
    OutputJacobian,
    /// The matrix `dh_i/du_j`.
    Feedthrough,
}

impl Derivative {
    /// All of them, in the order in which they are emitted.
    pub const ALL: [Derivative; 10] = [
        Derivative::Jacobian,
        Derivative::Jvp,
        Derivative::Vjp,
        Derivative::TimeDerivative,
        Derivative::Sensitivity,
        Derivative::SensitivityJvp,
        Derivative::SensitivityVjp,
        Derivative::InputJacobian,
        Derivative::OutputJacobian,
        Derivative::Feedthrough,
    ];

    /// Those of the right-hand side that a scene without inputs can have.
    pub const OF_MOTION: [Derivative; 7] = [
        Derivative::Jacobian,
        Derivative::Jvp,
        Derivative::Vjp,
        Derivative::TimeDerivative,
        Derivative::Sensitivity,
        Derivative::SensitivityJvp,
        Derivative::SensitivityVjp,
    ];

    /// The matrices `A, B, C, D` of `delta y' = A delta y + B delta u`, `delta h = C delta y + D delta u`.
    pub const LINEARIZATION: [Derivative; 4] = [
        Derivative::Jacobian,
        Derivative::InputJacobian,
        Derivative::OutputJacobian,
        Derivative::Feedthrough,
    ];

    /// What a scene wants that has it.
    pub fn want(self) -> Want {
        match self {
            Derivative::Jacobian => Want::Jacobian,
            Derivative::Jvp => Want::Jvp,
            Derivative::Vjp => Want::Vjp,
            Derivative::TimeDerivative => Want::TimeDerivative,
            Derivative::Sensitivity => Want::Sensitivity,
            Derivative::SensitivityJvp => Want::SensitivityJvp,
            Derivative::SensitivityVjp => Want::SensitivityVjp,
            Derivative::InputJacobian => Want::InputJacobian,
            Derivative::OutputJacobian => Want::OutputJacobian,
            Derivative::Feedthrough => Want::Feedthrough,
        }
    }

    /// What a scene says, and the name of the function.
    pub fn name(self) -> &'static str {
        self.want().name()
    }

    /// What a scene that wants this has.
    pub fn of(want: Want) -> Option<Derivative> {
        Derivative::ALL.into_iter().find(|d| d.want() == want)
    }

    /// The derivative of that name.
    pub fn from_name(name: &str) -> Option<Derivative> {
        Derivative::ALL.into_iter().find(|d| d.name() == name)
    }

    /// The role of the function.
    pub fn role(self) -> Role {
        let name = self.name().to_owned();
        match self {
            Derivative::Jacobian
            | Derivative::Sensitivity
            | Derivative::TimeDerivative
            | Derivative::InputJacobian
            | Derivative::OutputJacobian
            | Derivative::Feedthrough => Role::Output(name),
            Derivative::Jvp | Derivative::Vjp | Derivative::SensitivityJvp | Derivative::SensitivityVjp => {
                Role::Product(name)
            }
        }
    }

    fn doc(self) -> &'static str {
        match self {
            Derivative::Jacobian => {
                "entries `df_i/dy_j` of the Jacobian that do not vanish identically, row by row"
            }
            Derivative::Jvp => {
                "product `J v` of the Jacobian `J_ij = df_i/dy_j` and a direction `v` of the state, the derivative along it"
            }
            Derivative::Vjp => {
                "product `J^T w` of the transposed Jacobian `J_ij = df_i/dy_j` and a covector `w`, a weight for each rate"
            }
            Derivative::TimeDerivative => {
                "derivative `df/dt` of the right-hand side by time at a fixed state"
            }
            Derivative::Sensitivity => {
                "derivatives `df_i/dp_j` by the parameters that do not vanish identically, row by row"
            }
            Derivative::SensitivityJvp => {
                "product of the derivatives `df_i/dp_j` by the parameters and a direction `v` of the parameters, in their order"
            }
            Derivative::SensitivityVjp => {
                "product of the transposed derivatives `df_i/dp_j` by the parameters and a covector `w`, a weight for each rate"
            }
            Derivative::InputJacobian => {
                "derivatives `df_i/du_j` by the inputs that do not vanish identically, row by row"
            }
            Derivative::OutputJacobian => {
                "derivatives `dh_i/dy_j` of the outputs of the model by the state that do not vanish identically, row by row"
            }
            Derivative::Feedthrough => {
                "derivatives `dh_i/du_j` of the outputs of the model by the inputs that do not vanish identically, row by row"
            }
        }
    }

    /// What a matrix is, all of it.
    fn doc_of_matrix(self) -> &'static str {
        match self {
            Derivative::Sensitivity => {
                "matrix `df_i/dp_j` of the derivatives of the right-hand side by the parameters in the order of \
                 `INFO.params`, a row for each rate"
            }
            Derivative::InputJacobian => {
                "matrix `df_i/du_j` of the derivatives of the right-hand side by the inputs, a row for each rate"
            }
            Derivative::OutputJacobian => {
                "matrix `dh_i/dy_j` of the derivatives of the outputs of the model by the state, a row for each output"
            }
            Derivative::Feedthrough => {
                "matrix `dh_i/du_j` of the derivatives of the outputs of the model by the inputs, a row for each output"
            }
            _ => {
                "matrix `df_i/dy_j` of the derivatives of the right-hand side by the state, a row for each rate"
            }
        }
    }
}

/// A matrix, of which the entries that do not vanish identically are computed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Matrix {
    /// Its name; its entries are the output of that name.
    pub name: &'static str,
    /// Numbers of rows and columns.
    pub shape: (usize, usize),
    /// Row and column of each entry, in the order of the output's components.
    pub pattern: Vec<(usize, usize)>,
    /// Whether the entries are those above the diagonal of a matrix `a_ji = -a_ij`.
    pub is_antisymmetric: bool,
    /// What it is.
    pub doc: &'static str,
}

/// A function of a vector besides time and state, such as a product with it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Product {
    /// Its name.
    pub name: &'static str,
    /// What is multiplied with, `v` or `w`; `a` where it is accelerations.
    pub vector: &'static str,
    /// Dimension of that vector.
    pub n_vector: usize,
    /// Names of the results.
    pub components: Vec<String>,
    /// What it is.
    pub doc: String,
}

/// Wanted derivatives, and what has to be lowered for them.
#[derive(Clone, Default)]
pub(super) struct Derivatives {
    /// Matrices by their entries, and the derivative by time.
    pub(super) outputs: Vec<Output>,
    pub(super) matrices: Vec<Matrix>,
    pub(super) products: Vec<Product>,
    /// The functions of products.
    pub(super) requests: Vec<Request>,
    pub(super) arguments: BTreeMap<Role, Vec<SymbolId>>,
    /// To come after the sections that were differentiated.
    pub(super) sections: Vec<Section>,
}

/// Unknowns from which on accelerations are differentiated by their balance without a look at the other way: arms of
/// seven and eight joints, a humanoid of 18 degrees of freedom and five spherical pendulums took a quarter to two
/// thirds fewer operations by it.
const MAX_BOTH_WAYS: usize = 6;

/// The part of the operations that the balance has to save before common parts are looked for: less of it is lost in
/// that search (`snakeboard` with inputs: 2 of 92 before, 2 of 52 more afterwards; an arm of six joints: 71 of 4937
/// before, 59 of 2572 more afterwards).
const MARGIN: u64 = 32;

/// Differentiates the rates of `state` and `outputs`, written in terms of `inputs` and the definitions of `equations`.
///
/// # Errors
/// As [`Equations::solved`].
pub(super) fn differentiate(
    g: &mut Graph,
    equations: &Equations,
    (state, outputs): (&[StateEquation], &[(String, ExprId)]),
    inputs: &Inputs,
    wanted: &BTreeSet<Derivative>,
) -> Result<Derivatives, Error> {
    if wanted.is_empty() {
        return Ok(Derivatives::default());
    }
    let solved = equations.solved(g)?;
    let of_rates = Differentiated {
        names: state.iter().map(|s| format!("dot_{}", s.name)).collect(),
        values: state.iter().map(|s| s.derivative).collect(),
    };
    let (names, values) = outputs.iter().cloned().unzip();
    let of_outputs = Differentiated { names, values };
    let mut before = Vec::new();
    if let Some((solved, _, factors)) = &solved {
        before = [factors.as_slice(), std::slice::from_ref(&solved.held), &solved.sections].concat();
    }
    let held: Vec<SymbolId> = inputs.held.iter().map(|(symbol, _)| *symbol).collect();
    let writer = SectionWriter::new(g, BTreeSet::new(), &[]);
    let mut pass = Pass { g, equations, before, solved: None, writer, result: Derivatives::default() };
    let by_balance = solved.as_ref().map(|(solved, factors, _)| (solved, factors as &dyn Linear));
    let n_unknowns = equations.linear_system().map_or(0, |system| system.unknowns.len());
    let ways = match by_balance {
        None => vec![None],
        Some(balance) if n_unknowns > MAX_BOTH_WAYS => vec![Some(balance)],
        Some(balance) => vec![None, Some(balance)],
    };
    for derivative in wanted {
        let mut trials = Trials::new(&pass);
        for way in &ways {
            let margin = trials.cost().map_or(0, |n| n / MARGIN);
            trials.attempt(&mut pass, margin, |pass| {
                pass.solved = *way;
                match derivative {
                    Derivative::Jacobian => pass.matrix(*derivative, &of_rates, &inputs.state),
                    Derivative::Sensitivity => pass.matrix(*derivative, &of_rates, &inputs.params),
                    Derivative::Jvp => pass.forward(*derivative, &of_rates, &inputs.state),
                    Derivative::SensitivityJvp => pass.forward(*derivative, &of_rates, &inputs.params),
                    Derivative::Vjp => pass.reverse(*derivative, &of_rates, &inputs.state),
                    Derivative::SensitivityVjp => pass.reverse(*derivative, &of_rates, &inputs.params),
                    Derivative::InputJacobian => pass.matrix(*derivative, &of_rates, &held),
                    Derivative::OutputJacobian => pass.matrix(*derivative, &of_outputs, &inputs.state),
                    Derivative::Feedthrough => pass.matrix(*derivative, &of_outputs, &held),
                    Derivative::TimeDerivative => {
                        let (names, column) = pass.entries(&of_rates, &[inputs.time]);
                        let named = names.into_iter().zip(column);
                        let components = named.map(|((_, _, name), e)| (name, e)).collect();
                        pass.output(*derivative, components);
                    }
                }
                Some((pass.n_operations(), ()))
            });
            pass.g.within_budget()?;
        }
        trials.finish(&mut pass);
    }
    let Pass { before, writer, mut result, .. } = pass;
    result.sections = [before, writer.finish().0].concat();
    Ok(result)
}

/// Functions that are differentiated.
struct Differentiated {
    names: Vec<String>,
    values: Vec<ExprId>,
}

struct Pass<'a> {
    g: &'a mut Graph,
    equations: &'a Equations,
    /// Definitions of the balance of the accelerations that the equations do not have.
    before: Vec<Section>,
    /// Accelerations that are the solution of a linear system, which is differentiated in their place.
    solved: Option<(&'a Solved, &'a dyn Linear)>,
    writer: SectionWriter,
    result: Derivatives,
}

/// Ways of differentiating are told apart by the definitions that they write.
impl Workspace for Pass<'_> {
    type State = (SectionWriter, Derivatives);

    fn state(&self) -> (SectionWriter, Derivatives) {
        (self.writer.clone(), self.result.clone())
    }

    fn put_back(&mut self, (writer, result): (SectionWriter, Derivatives)) {
        (self.writer, self.result) = (writer, result);
    }
}

impl<'a> Pass<'a> {
    /// Operations behind everything so far.
    fn n_operations(&self) -> u64 {
        let outputs = self.result.outputs.iter().flat_map(|output| &output.components);
        let products = self.result.requests.iter().flat_map(|request| &request.results);
        let roots: Vec<ExprId> = outputs.chain(products).map(|(_, e)| *e).collect();
        let further = [self.before.as_slice(), &self.writer.clone().finish().0].concat();
        self.equations.n_operations_with(self.g, &further, &roots)
    }

    fn linearise(&mut self, of: &Differentiated, by: &[SymbolId]) -> Linearisation<'a> {
        let balance = self.solved.iter().flat_map(|(solved, _)| solved.expressions());
        let roots: Vec<ExprId> = of.values.iter().copied().chain(balance).collect();
        let sections = needed_sections(self.g, &self.equations.sections, &roots);
        Linearisation::with_solved(self.g, &sections, &of.values, by, self.solved)
    }

    /// Positions, names and values of all entries `df_i/dx_j`, row by row.
    fn entries(
        &mut self,
        of: &Differentiated,
        by: &[SymbolId],
    ) -> (Vec<(usize, usize, String)>, Vec<ExprId>) {
        let linear = self.linearise(of, by);
        let name = |value: &str, input: &str| format!("d_{value}_d_{input}");
        let title = |section: &str| format!("derivatives of: {section}");
        let rows = linear.jacobian(self.g, &mut self.writer, name, title);
        let mut places = Vec::new();
        for (i, rate) in of.names.iter().enumerate() {
            for (j, x) in by.iter().enumerate() {
                places.push((i, j, name(rate, self.g.name(*x))));
            }
        }
        (places, rows.into_iter().flatten().collect())
    }

    fn output(&mut self, derivative: Derivative, components: Vec<(String, ExprId)>) {
        self.result.outputs.push(Output::group(derivative.want(), components, derivative.doc()));
    }

    fn matrix(&mut self, derivative: Derivative, of: &Differentiated, by: &[SymbolId]) {
        let (places, values) = self.entries(of, by);
        let (mut pattern, mut components) = (Vec::new(), Vec::new());
        for ((i, j, name), e) in places.into_iter().zip(values) {
            if e != self.g.zero() {
                pattern.push((i, j));
                components.push((name, e));
            }
        }
        self.output(derivative, components);
        let doc = derivative.doc_of_matrix();
        let shape = (of.values.len(), by.len());
        let (name, is_antisymmetric) = (derivative.name(), false);
        self.result.matrices.push(Matrix { name, shape, pattern, is_antisymmetric, doc });
    }

    /// New symbols `v_x` for the components of a vector.
    fn vector(&mut self, letter: &str, names: &[String]) -> (Vec<SymbolId>, Vec<ExprId>) {
        let symbols: Vec<SymbolId> =
            names.iter().map(|name| self.g.symbol(&format!("{letter}_{name}"))).collect();
        let values = symbols.iter().map(|s| self.g.sym(*s)).collect();
        (symbols, values)
    }

    fn forward(&mut self, derivative: Derivative, of: &Differentiated, by: &[SymbolId]) {
        let linear = self.linearise(of, by);
        let names: Vec<String> = by.iter().map(|s| self.g.name(*s).to_owned()).collect();
        let (symbols, direction) = self.vector("v", &names);
        let name = |value: &str, _| format!("v_{value}");
        let title = |section: &str| format!("tangents of: {section}");
        let rows = linear.forward(self.g, &mut self.writer, &[direction], name, title);
        let components = of.names.iter().map(|rate| format!("v_{rate}")).collect();
        self.product(derivative, "v", symbols, components, rows.into_iter().flatten().collect());
    }

    fn reverse(&mut self, derivative: Derivative, of: &Differentiated, by: &[SymbolId]) {
        let linear = self.linearise(of, by);
        let (symbols, covector) = self.vector("w", &of.names);
        let name = |value: &str| format!("w_{value}");
        let title = |section: &str| format!("adjoints of: {section}");
        let results = linear.reverse(self.g, &mut self.writer, &covector, name, title);
        let components = by.iter().map(|s| format!("w_{}", self.g.name(*s))).collect();
        self.product(derivative, "w", symbols, components, results);
    }

    fn product(
        &mut self,
        derivative: Derivative,
        vector: &'static str,
        symbols: Vec<SymbolId>,
        components: Vec<String>,
        values: Vec<ExprId>,
    ) {
        let role = derivative.role();
        let (name, n_vector, doc) = (derivative.name(), symbols.len(), derivative.doc().to_owned());
        let results = components.iter().cloned().zip(values).collect();
        self.result.requests.push(Request { role: role.clone(), results });
        self.result.arguments.insert(role, symbols);
        self.result.products.push(Product { name, vector, n_vector, components, doc });
    }
}
