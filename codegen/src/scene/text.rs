//! What the emitted module of a scene says, as plain data for the back end.
//!
//! Does not know: how any of it is written down.

use std::collections::BTreeMap;

use crate::certify::{N_POINTS, Sample, samples};
use hamel_expr::error::Error;
use hamel_expr::{Exhausted, Resource, Stage, Style};
use hamel_lang::spec::{EventDirection, Unit, Want};
use hamel_mechanics::reduction::StageUse;
use hamel_program::emit::{
    self, CModule, DiscreteText, EventText, FlowText, Fmu, ImplicitText, ImplicitVariableText, InitialText,
    MatrixText, OutputText, ParamText, PositionsText, Precision, ProductText, QuotientText, RanksText,
    SceneEntry, SceneText, Script, ScriptLanguage, SelfTestText, StateText, UnitText, UnitTexts, WasmModule,
};
use hamel_program::program::{Jet, Program, Role};

use super::built::{BuiltScene, TotalSystem, legendre_role};
use super::derivatives::{Derivative, Matrix, Product};
use super::discrete::{self, Discrete};
use super::events::SceneEvent;
use super::groups::groups;
use super::implicit::{self, Implicit};
use super::interpreter;
use super::positions::{self, PositionLayout};
use super::prior::told_in_words;
use super::quotient;
use super::ranks::RankLayout;
use super::splitting::flow_role;
use super::start::Start;

/// How a scene's module is written down.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct Writing {
    /// Command that writes the module again when the model's name follows, such as `cargo xtask generate`; without one,
    /// the first line says to change the model.
    pub command: Option<String>,
    /// Path of the runtime in the crate that the module is for; `::hamel_runtime` unless given.
    pub runtime: Option<String>,
    /// Whether the module has vectors, matrices, attitudes and places in the types of `nalgebra`.
    pub nalgebra: bool,
    /// Whether the module has a test of its own: three states and their rates.
    pub self_test: bool,
    /// The language.
    pub language: Language,
    /// The numbers of C and C++.
    pub precision: Precision,
}

/// The languages in which a scene is written down.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Language {
    /// A module for the crate `hamel-runtime`: `<module>.rs`. Scenes whose constraints may lose their rank have the
    /// gradients of these, whether they want them or not, which integrators ask for.
    #[default]
    Rust,
    /// A header and a source of C99, which need nothing but a few functions of `math.h`: `<module>.h`, `<module>.c`.
    C,
    /// The same with a header for C++17, `<module>.hpp`.
    Cpp,
    /// The same as C with `<module>_casadi.c`, which has the right-hand side and its Jacobian as CasADi calls functions
    /// of other sources; scenes have the derivatives that this takes, whether they want them or not.
    Casadi,
    /// The module in Rust with `<module>_wasm.rs`, the root of a crate for WebAssembly, and `<module>.mjs`, which calls
    /// that from JavaScript; scenes have the equations between their coordinates, whether they want them or not.
    Wasm,
    /// Expressions of CasADi, which differentiates them as often as it is asked to: `<module>_casadi.py`.
    CasadiExpr,
    /// Functions of JAX: `<module>_jax.py`.
    Jax,
    /// Expressions of SymPy with exact numbers: `<module>_sympy.py`.
    Sympy,
    /// A module of Julia: `<module>.jl`.
    Julia,
    /// A function file of MATLAB and Octave: `<module>.m`.
    Matlab,
}

impl Language {
    /// Derivatives of the right-hand side that every scene has in that language; those by inputs where it takes any.
    pub(super) fn derivatives(self) -> &'static [Derivative] {
        match self {
            Language::Rust
            | Language::C
            | Language::Cpp
            | Language::Wasm
            | Language::CasadiExpr
            | Language::Jax
            | Language::Sympy
            | Language::Julia
            | Language::Matlab => &[],
            Language::Casadi => &[
                Derivative::Jacobian,
                Derivative::TimeDerivative,
                Derivative::Sensitivity,
                Derivative::InputJacobian,
            ],
        }
    }

    /// Whether every scene has the equations between coordinates in that language, where it carries these.
    pub(super) fn positions(self) -> bool {
        self == Language::Wasm
    }

    /// Whether every scene has the rows whose rank a motion may lose in that language: where the integrators of the
    /// runtime ask for them.
    pub(super) fn ranks(self) -> bool {
        matches!(self, Language::Rust | Language::Wasm)
    }
}

impl BuiltScene {
    /// What the state has along the levels of stages, where the model or the scene says so.
    fn along_levels(&self) -> Option<String> {
        let system = &self.equations.system;
        let StageUse::Carried(momenta) = &system.formulation.stages else { return None };
        let levels = system.stages.iter().flat_map(|stages| &stages.levels);
        let chain: Vec<&str> = levels.map(|level| level.name.as_str()).collect();
        let carried = match momenta.is_empty() {
            true => "velocities along the levels".to_owned(),
            false => format!("momenta along {}", momenta.join(", ")),
        };
        Some(format!("stages {}, {carried}", chain.join(" > ")))
    }

    /// Name of the emitted module: the model's, followed by the scene's unless it is the default.
    pub fn module_name(&self) -> String {
        SceneEntry::module_name(&self.equations.system.name, &self.name)
    }

    /// The text of the scene's Rust module.
    ///
    /// # Errors
    /// [`Error::OverBudget`]; [`Error::Emission`], a bug of the emitter.
    pub fn emit(&self) -> Result<String, Error> {
        self.emit_as(&Writing::default())
    }

    /// The text of the scene's Rust module, written down in a given way.
    ///
    /// # Errors
    /// [`Error::NotAPath`] for the runtime; [`Error::OverBudget`]; [`Error::Emission`], a bug of the emitter.
    pub fn emit_as(&self, writing: &Writing) -> Result<String, Error> {
        self.emit_from(writing, None)
    }

    /// The same with the constant `INITIAL`, the initial state, see [`start`](super::start()).
    ///
    /// # Errors
    /// As [`emit_as`](Self::emit_as).
    pub fn emit_from(&self, writing: &Writing, initial: Option<Start>) -> Result<String, Error> {
        self.within_bytes()?;
        let jet = if self.wants_taylor { Some(self.jet()?) } else { None };
        emit::emit_scene(&self.program, jet.as_ref(), &self.text_from(writing, initial))
    }

    /// The scene as C99; `initial` is the state that the function of that name gives, see [`start`](super::start()).
    ///
    /// # Errors
    /// [`Error::OverBudget`].
    pub fn emit_c(&self, writing: &Writing, initial: Option<Start>) -> Result<CModule, Error> {
        self.within_bytes()?;
        let text = self.text_from(writing, initial);
        emit::emit_c(&self.program, &text, writing.precision)
    }

    /// The scene as C99, with what an FMU of FMI 3.0 has besides, which begins at `initial`.
    ///
    /// # Errors
    /// [`Error::OverBudget`]; [`Error::NoInitialState`].
    pub fn emit_fmu(&self, writing: &Writing, initial: Option<Start>) -> Result<(CModule, Fmu), Error> {
        self.within_bytes()?;
        let text = self.text_from(writing, initial);
        emit::emit_fmu(&self.program, &text)
    }

    /// What calls the scene's Rust module, which is in `<module>.rs`, from outside of WebAssembly; its state begins at
    /// `initial`, and at zero without.
    ///
    /// # Errors
    /// As [`emit_as`](Self::emit_as).
    pub fn emit_wasm(&self, writing: &Writing, initial: Option<Start>) -> Result<WasmModule, Error> {
        self.within_bytes()?;
        let text = self.text_from(writing, initial);
        emit::emit_wasm(&self.program, &text, &format!("{}.rs", self.module_name()))
    }

    /// The scene in a language of formulas; `initial` is the state that it begins at, see [`start`](super::start()).
    ///
    /// # Errors
    /// [`Error::OverBudget`].
    pub fn emit_script(
        &self,
        language: ScriptLanguage,
        writing: &Writing,
        initial: Option<Start>,
    ) -> Result<Script, Error> {
        self.within_bytes()?;
        emit::emit_script(&self.program, &self.text_from(writing, initial), language)
    }

    /// The texts of the scene, which begins at a state.
    fn text_from(&self, writing: &Writing, initial: Option<Start>) -> SceneText {
        let initial = initial.map(|Start { state, told }| InitialText {
            values: state,
            told: told_in_words(&told).unwrap_or_default(),
        });
        SceneText { initial, ..self.text(writing) }
    }

    /// Refuses to write down what would take more memory than the budget has.
    fn within_bytes(&self) -> Result<(), Error> {
        let budget = self.equations.system.graph.budget();
        let functions = self.program.functions.iter().map(|f| f.instructions.len()).sum::<usize>();
        let n_instructions = (functions + self.program.prepare.instructions.len()) as u64;
        // What lowering has made is gone by now, the equations are not.
        let held = self.equations.system.graph.spent().bytes;
        if held.saturating_add(BYTES_OF_AN_INSTRUCTION * n_instructions) > budget.bytes {
            let exhausted =
                Exhausted { stage: Stage::Emission, resource: Resource::Bytes, limit: budget.bytes };
            return Err(exhausted.into());
        }
        Ok(())
    }

    /// The recurrence of the Taylor coefficients of solutions, whether or not the scene wants it in its module.
    ///
    /// # Errors
    /// [`Error::UnknownName`], a bug: every scene has a right-hand side.
    pub fn jet(&self) -> Result<Jet, Error> {
        interpreter::jet_of(&self.program)
    }

    /// The entry of the scene in the index of modules.
    pub fn entry(&self) -> SceneEntry {
        SceneEntry {
            module: self.module_name(),
            model: self.equations.system.name.clone(),
            scene: self.name.clone(),
            n_state: self.program.state.len(),
            doc: self.equations.system.doc.first().cloned().unwrap_or_default(),
        }
    }

    fn text(&self, writing: &Writing) -> SceneText {
        let system = &self.equations.system;
        let command = match &writing.command {
            Some(command) => format!("{command} {}", system.name),
            None => format!("do not edit, change the model {}", system.name),
        };
        let mut doc = system.doc.clone();
        if !self.doc.is_empty() {
            doc.push(String::new());
            doc.push(format!("Scene `{}`: {}", self.name, self.doc));
        }
        doc.push(String::new());
        doc.push(self.certificate.sentence());
        for loss in &self.program.report.losses {
            doc.push(String::new());
            doc.push(format!("Function `{}` has {loss}.", loss.role));
        }
        let energy = "E = p.y - L".to_owned();
        let motion = self.motion_in_lines().unwrap_or_else(|| {
            let form = match self.equations.has_energy() {
                true => vec![
                    "Lagrange-d'Alembert equations W^a_b E_a = 0, solved for the accelerations:",
                    "E_a = d/dt p_a + C^c_ab y^b p_c - rho^i_a dL/dx^i - F_a",
                ],
                false => vec!["the accelerations and fields that the model gives, xdot = rho y"],
            };
            let whole = format!("written out by: hamel explain {}", system.name);
            form.into_iter().map(str::to_owned).chain([whole]).collect()
        });
        let formulas = [(Role::Energy, vec![energy]), (Role::Rate, motion)];
        SceneText {
            model: system.name.clone(),
            scene: self.name.clone(),
            command,
            formulation: self.chosen.clone().or_else(|| self.along_levels()),
            runtime: writing.runtime.clone().unwrap_or_default(),
            doc,
            sources: system.sources.clone(),
            params: system
                .params
                .iter()
                .map(|p| ParamText { name: p.name.clone(), default: p.default.clone(), doc: p.doc.clone() })
                .collect(),
            inputs: system
                .inputs
                .iter()
                .map(|i| ParamText { name: i.name.clone(), default: i.default.clone(), doc: i.doc.clone() })
                .collect(),
            state: self
                .state
                .iter()
                .map(|s| StateText { name: s.name.clone(), doc: s.doc.clone() })
                .collect(),
            outputs: self
                .outputs
                .iter()
                .map(|o| OutputText {
                    name: o.name.clone(),
                    components: o.components.iter().map(|(name, _)| name.clone()).collect(),
                    doc: o.doc.clone(),
                })
                .collect(),
            matrices: self.matrices.iter().map(matrix_text).collect(),
            products: self.products.iter().map(product_text).chain(self.legendre_text()).collect(),
            implicit: self.implicit().map(implicit_text),
            discrete: self.discrete().map(discrete_text),
            quotient: self.total.as_deref().map(|total| quotient_text(total, &self.program)),
            positions: self.positions().map(positions_text),
            ranks: self.ranks.as_ref().map(ranks_text),
            flows: self.flows().iter().enumerate().map(flow_text).collect(),
            units: self.unit_texts(),
            events: self.events().iter().map(event_text).collect(),
            formulas: BTreeMap::from(formulas),
            initial: None,
            self_test: if writing.self_test { self.self_test() } else { Vec::new() },
            conserves_energy: self.equations.facts.conserves_energy(),
            groups: writing.nalgebra.then(|| groups(self)),
        }
    }
}

/// Lines of equations in the documentation of the right-hand side.
const MAX_LINES: usize = 25;
/// Characters in one of them.
const MAX_COLUMNS: usize = 110;

impl BuiltScene {
    /// The equations of motion of the scene, each with what it needs before it; none where they are long.
    fn motion_in_lines(&self) -> Option<Vec<String>> {
        let needed = self.equations.needed(self.state.iter().map(|s| s.derivative));
        if needed.len() > MAX_LINES {
            return None;
        }
        let g = &self.equations.labelled();
        let sections = self.equations.sections.iter();
        let definitions = sections.flat_map(|s| &s.definitions).filter(|d| needed.contains(&d.symbol));
        let mut lines: Vec<String> = definitions
            .map(|d| format!("{} = {}", g.name(d.symbol), g.display(d.expr, Style::Plain)))
            .collect();
        for state in &self.state {
            let (rate, name) = (g.display(state.derivative, Style::Plain), format!("dot_{}", state.name));
            // What is called so is a rate, and has a line.
            if rate != name {
                lines.push(format!("{name} = {rate}"));
            }
        }
        let lines: Vec<String> = lines.iter().flat_map(|line| broken(line)).collect();
        let is_short = lines.len() <= MAX_LINES && lines.iter().all(|line| line.len() <= MAX_COLUMNS);
        is_short.then_some(lines)
    }

    /// States at which the scene was held to its definition, with the rates that the interpreter computes.
    fn self_test(&self) -> Vec<SelfTestText> {
        let Some(model) = &self.model else { return Vec::new() };
        let case = |sample: Sample| {
            let Sample { params, t, state } = sample;
            let mut rates = vec![0.0; state.len()];
            self.prepare(&params).ok()?.rhs(t, &state, &mut rates);
            let is_finite = rates.iter().all(|rate| rate.is_finite());
            is_finite.then_some(SelfTestText { params, t, state, rates })
        };
        samples(&self.claim(model, N_POINTS)).into_iter().filter_map(case).collect()
    }
}

/// A formula in lines of bounded length, broken before terms of its outermost sum where it has one.
fn broken(formula: &str) -> Vec<String> {
    let mut lines = vec![String::new()];
    let (mut depth, mut term) = (0usize, String::new());
    let mut end = |term: &mut String| {
        let line = lines.last().map_or(0, String::len);
        if line > 0 && line + term.len() > MAX_COLUMNS {
            lines.push("   ".to_owned());
        }
        if let Some(line) = lines.last_mut() {
            line.push_str(term);
        }
        term.clear();
    };
    for (at, c) in formula.char_indices() {
        if depth == 0 && (formula[at..].starts_with(" + ") || formula[at..].starts_with(" - ")) {
            end(&mut term);
        }
        match c {
            '(' => depth += 1,
            ')' => depth = depth.saturating_sub(1),
            _ => {}
        }
        term.push(c);
    }
    end(&mut term);
    lines
}

/// A unit whose exponents are integers.
fn unit_text(unit: &Unit) -> Option<UnitText> {
    Some(UnitText { name: unit.text().to_owned(), exponents: unit.exponents()?, factor: unit.factor() })
}

/// What an instruction takes as a syntax tree and as text, about.
const BYTES_OF_AN_INSTRUCTION: u64 = 4096;

fn matrix_text(matrix: &Matrix) -> MatrixText {
    MatrixText {
        name: matrix.name.to_owned(),
        shape: matrix.shape,
        pattern: matrix.pattern.clone(),
        is_antisymmetric: matrix.is_antisymmetric,
        doc: matrix.doc.to_owned(),
    }
}

fn implicit_text(implicit: &Implicit) -> ImplicitText {
    let variables = implicit.variables.iter().map(|v| ImplicitVariableText {
        name: v.name.clone(),
        doc: v.doc.clone(),
        is_differential: v.is_differential,
    });
    ImplicitText {
        right_side: implicit::RIGHT_SIDE.to_owned(),
        jacobian: implicit::JACOBIAN.to_owned(),
        values: Want::Implicit.name().to_owned(),
        variables: variables.collect(),
        index: implicit.index,
        pattern: implicit.pattern.clone(),
        state: implicit.state.clone(),
    }
}

fn discrete_text(discrete: &Discrete) -> DiscreteText {
    let retraction = discrete.map.retraction.name();
    let named = |name: &str, what: &str| {
        (name.to_owned(), format!("{what} `(h, y, z)`: the step, the state at its start, the unknowns."))
    };
    DiscreteText {
        start: named(discrete::START, "First values of the unknowns, those of a step of no length, by"),
        residual: named(
            discrete::RESIDUAL,
            &format!(
                "Rows of the discrete equations of a step, which vanish, by the midpoint quadrature and the retraction `{retraction}`; of"
            ),
        ),
        jacobian: named(discrete::JACOBIAN, "Derivatives of the rows by the unknowns, row by row, at"),
        unknowns: discrete.unknowns.clone(),
        pattern: discrete.pattern.clone(),
        state: discrete.state.clone(),
    }
}

fn positions_text(layout: &PositionLayout) -> PositionsText {
    PositionsText {
        values: Want::Positions.name().to_owned(),
        gradients: positions::GRADIENTS.to_owned(),
        n_equations: layout.n_equations,
        moved: layout.moved.clone(),
    }
}

fn ranks_text(layout: &RankLayout) -> RanksText {
    RanksText { matrix: layout.matrix.to_owned(), rows: layout.rows.clone(), moving: layout.moving.clone() }
}

impl BuiltScene {
    fn unit_texts(&self) -> UnitTexts {
        let system = &self.equations.system;
        let units = &system.units;
        let params = system.params.iter().chain(&system.inputs).map(|p| &p.name);
        let state = || self.state.iter().map(|s| &s.name);
        let named = |name: &String, unit: &Unit| Some((name.clone(), unit_text(unit)?));
        let outputs = self.outputs.iter().flat_map(|o| (0..o.components.len()).map(move |k| (&o.name, k)));
        UnitTexts {
            time: units.time().and_then(unit_text),
            energy: units.energy().and_then(unit_text),
            of_name: params.chain(state()).filter_map(|name| named(name, units.of(name)?)).collect(),
            of_rate: state()
                .filter(|_| units.time().is_some())
                .filter_map(|name| named(name, &units.of(name)?.rate()?))
                .collect(),
            of_output: outputs
                .filter_map(|(name, k)| Some(((name.clone(), k), unit_text(units.of_output(name, k)?)?)))
                .collect(),
        }
    }

    fn legendre_text(&self) -> Option<ProductText> {
        let legendre = self.legendre();
        if legendre.momenta.is_empty() {
            return None;
        }
        let has_levels = !self.equations.system.changes.is_empty();
        let velocities: Vec<&str> = legendre.velocities.iter().map(|(name, _)| name.as_str()).collect();
        Some(ProductText {
            name: legendre_role().name().to_owned(),
            vector: "velocities".into(),
            components: legendre.momenta.iter().map(|(name, _)| name.clone()).collect(),
            doc: format!(
                "{} of the state by the velocities that they stand for, `{}`; {}",
                if has_levels { "velocities along the levels of stages" } else { "momenta `W^T dL/dy`" },
                velocities.join(", "),
                if has_levels { "those in `y` mean nothing" } else { "the momenta in `y` mean nothing" },
            ),
        })
    }
}

fn quotient_text(total: &TotalSystem, program: &Program) -> QuotientText {
    let ([state, params], file) = (total.variables().map(<[String]>::to_vec), total.file.clone());
    let title = |what: &str| {
        format!(
            "{what} by the state and the parameters of `{file}`, one after the other in `z`: the map of `reduces`."
        )
    };
    let of = |role: Role, what: &str| {
        let name = role.name().to_owned();
        program.function(&role).is_some().then(|| (name, title(what)))
    };
    QuotientText {
        of_state: (quotient::state_role().name().to_owned(), title("The state")),
        of_params: of(quotient::params_role(), "The parameters"),
        state,
        params,
        file,
    }
}

fn event_text(event: &SceneEvent) -> EventText {
    let directions = match event.direction {
        EventDirection::Rising => (true, false),
        EventDirection::Falling | EventDirection::Below => (false, true),
        EventDirection::Either => (true, true),
    };
    let sets = (!event.sets.is_empty()).then(|| (event.after(), event.sets.clone()));
    let is_condition = event.direction == EventDirection::Below;
    EventText { name: event.name.clone(), directions, is_condition, stops: event.stops, sets }
}

fn flow_text((index, forms): (usize, &Vec<String>)) -> FlowText {
    FlowText { name: flow_role(index).name().to_owned(), forms: forms.clone() }
}

fn product_text(product: &Product) -> ProductText {
    ProductText {
        name: product.name.to_owned(),
        vector: product.vector.to_owned(),
        components: product.components.clone(),
        doc: product.doc.clone(),
    }
}

#[cfg(test)]
mod tests {
    use super::{MAX_COLUMNS, broken};

    #[test]
    fn formulas_are_broken_between_terms() {
        assert_eq!(broken("a = b + c"), ["a = b + c"]);
        let term = "x".repeat(50);
        let (product, formula) = (format!("k*({term} - {term})"), format!("a = {term} + {term} - {term}"));
        assert_eq!(broken(&formula), [format!("a = {term} + {term}"), format!("    - {term}")]);
        let long = format!("a = {product}");
        assert_eq!(broken(&long), [long.as_str()]);
        assert!(broken(&formula).iter().all(|line| line.len() <= MAX_COLUMNS));
    }
}
