//! The functions of a module, before any language lays them out.
//!
//! Deliberately does not know: any language.

use super::super::module::{IMPLICIT_JACOBIAN, Module, OutputRoutine, Routine};
use super::super::text::{MatrixText, UnitText};
use crate::program::Role;

/// What a function takes beside parameters and inputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Takes {
    /// Time and state.
    Point,
    /// Time, state and a vector.
    Vector,
    /// Time and variables in the place of the state.
    Variables,
    /// A time of its own and the state.
    Flow,
}

/// A matrix by its entries: shape, places, and whether those below the diagonal are minus those above.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pattern<'a> {
    pub(super) shape: (usize, usize),
    pub(super) places: &'a [(usize, usize)],
    pub(super) is_antisymmetric: bool,
}

/// What a function gives.
#[derive(Clone, Copy, Debug)]
pub(super) enum Gives<'a> {
    Scalar,
    Vector,
    Matrix(Pattern<'a>),
}

/// A function of the module.
pub(super) struct Item<'a> {
    pub(super) name: String,
    /// Lines of its documentation.
    pub(super) doc: Vec<String>,
    pub(super) takes: Takes,
    pub(super) gives: Gives<'a>,
    pub(super) routine: &'a Routine<'a>,
}

/// Components that a list in a comment has at most.
const MAX_LISTED: usize = 40;

/// All functions in the order of the file.
pub(super) fn items<'a>(module: &'a Module<'a>) -> Vec<Item<'a>> {
    let units = &module.text.units;
    let rate = Item::new("rhs", "The rates of the state.", None, Gives::Vector, &module.rate);
    let mut items = vec![rate.of(&module.program.state).with_formulas(module, &Role::Rate)];
    if let Some(energy) = &module.energy {
        let item = Item::new("energy", "Energy.", units.energy.as_ref(), Gives::Scalar, energy);
        items.push(item.with_formulas(module, &Role::Energy));
    }
    items.extend(module.outputs.iter().map(|output| of_output(module, output)));
    for product in &module.products {
        let item = Item::new(&product.name, &product.text.doc, None, Gives::Vector, &product.routine);
        let item = item.of(&product.text.components).taking(Takes::Vector);
        items.push(item);
    }
    for flow in &module.flows {
        let doc = format!(
            "What the flow of the part of the Hamiltonian that is a function of {} adds to the state in the time `value`.",
            flow.text.forms.join(", ")
        );
        items.push(Item::new(&flow.name, &doc, None, Gives::Vector, &flow.routine).taking(Takes::Flow));
    }
    if let Some(implicit) = &module.implicit {
        let n = implicit.text.variables.len();
        let doc = "Right-hand side f(t, z) of the implicit form M z' = f(t, z); z is `vector`.";
        let right = Item::new(&implicit.rhs, doc, None, Gives::Vector, &implicit.right);
        items.push(right.taking(Takes::Variables));
        let pattern = Pattern { shape: (n, n), places: &implicit.text.pattern, is_antisymmetric: false };
        let doc = format!("Matrix df_i/dz_j of the implicit form, {IMPLICIT_JACOBIAN}; z is `vector`.");
        let all = Item::new(&implicit.all, &doc, None, Gives::Matrix(pattern), &implicit.jacobian);
        items.push(all.taking(Takes::Variables));
    }
    let discrete = module.discrete.iter().flat_map(|discrete| discrete.all());
    for function in discrete.chain(&module.quotient) {
        let routine = &function.routine;
        let names: Vec<String> = routine.function.results.iter().map(|(name, _)| name.clone()).collect();
        let item = Item::new(&function.name, function.title, None, Gives::Vector, routine);
        items.push(item.of(&names).taking(Takes::Variables));
    }
    if let Some(pivots) = &module.pivots {
        let doc =
            "What the rates are divided by and may vanish, then the scale of the rounding errors of each.";
        items.push(Item::new("pivots", doc, None, Gives::Vector, pivots));
    }
    if let Some(signature) = &module.signature {
        let doc = "A number that stays the same along a motion while no matrix that is solved with becomes singular.";
        items.push(Item::new("signature", doc, None, Gives::Scalar, signature));
    }
    if let Some(domain) = &module.domain {
        let doc = "Numbers that are positive where the equations are defined.";
        items.push(Item::new("domain", doc, None, Gives::Vector, domain));
    }
    items
}

fn of_output<'a>(module: &'a Module<'a>, output: &'a OutputRoutine<'a>) -> Item<'a> {
    let OutputRoutine { text, matrix, name, routine } = output;
    let unit = module.text.units.of_output.get(&(text.name.clone(), 0)).filter(|_| output.is_scalar());
    if let Some((matrix, all)) = matrix {
        let MatrixText { shape, pattern, is_antisymmetric, doc, .. } = *matrix;
        let is_antisymmetric = *is_antisymmetric;
        let pattern = Pattern { shape: *shape, places: pattern, is_antisymmetric };
        return Item::new(all, doc, None, Gives::Matrix(pattern), routine);
    }
    let doc = match text.doc.trim() {
        "" => format!("Output {}.", text.name),
        doc => doc.to_owned(),
    };
    match output.is_scalar() {
        true => Item::new(name, &doc, unit, Gives::Scalar, routine),
        false => Item::new(name, &doc, None, Gives::Vector, routine).of(&text.components),
    }
}

impl<'a> Item<'a> {
    fn new(
        name: &str,
        title: &str,
        unit: Option<&UnitText>,
        gives: Gives<'a>,
        routine: &'a Routine<'a>,
    ) -> Item<'a> {
        let mut doc = vec![title.trim().to_owned(), String::new()];
        if let Some(unit) = unit.filter(|unit| !title.contains(&format!("[{}]", unit.name))) {
            doc.push(format!("Unit: {}.", unit.name));
        }
        if let Gives::Matrix(Pattern { shape: (rows, columns), .. }) = gives {
            doc.push(format!("{rows} rows of {columns}."));
        }
        doc.push(format!("Operations: {}.", routine.function.counts()));
        Item { name: name.to_owned(), doc, takes: Takes::Point, gives, routine }
    }

    /// With the names of the components.
    fn of(mut self, components: &[String]) -> Item<'a> {
        if !components.is_empty() && components.len() <= MAX_LISTED {
            self.doc.insert(2, format!("Components: {}.", components.join(", ")));
        }
        self
    }

    fn taking(mut self, takes: Takes) -> Item<'a> {
        self.takes = takes;
        self
    }

    /// With the lines of its formulas.
    fn with_formulas(mut self, module: &Module<'_>, role: &Role) -> Item<'a> {
        if let Some(lines) = module.text.formulas.get(role) {
            self.doc.push(String::new());
            self.doc.extend(lines.iter().map(|line| format!("    {line}")));
        }
        self
    }

    /// The arguments besides the array of the results, in the order of Python and MATLAB.
    pub(super) fn arguments(&self, has_inputs: bool) -> Vec<&'static str> {
        let mut names = match self.takes {
            Takes::Point => vec!["t", "y", "p"],
            Takes::Vector => vec!["t", "y", "p", "vector"],
            Takes::Variables => vec!["t", "vector", "p"],
            Takes::Flow => vec!["value", "y", "p"],
        };
        names.extend(has_inputs.then_some("u"));
        names
    }
}
