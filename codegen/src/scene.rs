//! Scenes: what is wanted of a model, what is fixed, and what is left out.
//!
//! [`build`] runs the whole pipeline for one scene. The default scene fixes nothing and wants every output; a `scene`
//! block of the model fixes parameters (folded exactly before the derivation) and names the outputs it wants.
//!
//! Deliberately does not know: how equations are derived, how programs are lowered, how text is emitted.

use crate::error::Error;
use crate::expr::{ExprId, Rational};
use crate::lower::{self, Counts, Inputs, ParamCondition, Program, Relation, Request, ViolatedCondition};
use crate::mechanics::{Equations, Output, derive};
use crate::reduction::{reduce, sign_of};
use crate::spec::{self, Diagnostics, Model, Param};

/// Name of the scene that every model has.
pub const DEFAULT: &str = "default";

/// A scene after the whole pipeline: its equations and its program.
#[derive(Clone, Debug)]
pub struct BuiltScene {
    /// Name of the scene.
    pub name: String,
    /// What was derived.
    pub equations: Equations,
    /// What was lowered: functions `rhs`, `energy` (when wanted), `check`, then one per output.
    pub program: Program,
    outputs: Vec<Output>,
    doc: String,
}

/// Names of a model's scenes, the default first.
pub fn names(model: &Model) -> Vec<String> {
    std::iter::once(DEFAULT.to_owned()).chain(model.scenes.iter().map(|s| s.name.clone())).collect()
}

/// Builds one scene of a model.
///
/// # Errors
/// Unknown scene or output, and everything that reduction, derivation and lowering can find.
pub fn build(model: &Model, scene: &str) -> Result<BuiltScene, Diagnostics> {
    let fail =
        |message: String, help: String| model.diagnostics(vec![spec::diagnose(model, None, message, help)]);
    let chosen = model.scenes.iter().find(|s| s.name == scene);
    if chosen.is_none() && scene != DEFAULT {
        let known = names(model).join(", ");
        return Err(fail(format!("{} has no scene {scene}", model.name), format!("scenes: {known}")));
    }
    let fixed: &[(String, Rational)] = chosen.map_or(&[], |s| &s.fixed);
    let system = reduce(model, fixed)?;
    let equations = derive(&system).map_err(|e| fail(e.to_string(), String::new()))?;
    let available = available_outputs(&equations);
    let mut wants_energy = true;
    let outputs = match chosen {
        None => available,
        Some(chosen) => {
            wants_energy = chosen.wants.iter().any(|w| w == "energy");
            let mut selected = Vec::new();
            for want in chosen.wants.iter().filter(|w| *w != "energy" && *w != "rhs") {
                let found = wanted_outputs(&equations, &available, want);
                if found.is_empty() {
                    let known: Vec<&str> = available.iter().map(|o| o.name.as_str()).collect();
                    return Err(fail(
                        format!("scene {scene} wants {want}, which {} does not have", model.name),
                        format!("outputs: rhs, energy, {}", known.join(", ")),
                    ));
                }
                selected.extend(found);
            }
            selected
        }
    };
    let doc = chosen.map(|s| s.doc.clone()).unwrap_or_default();
    let scene = lower_scene(equations, scene, outputs, wants_energy, doc);
    scene.map_err(|e| fail(e.to_string(), String::new()))
}

/// A group by its name, every output of the model (`outputs`), or a single component of a group.
fn wanted_outputs(equations: &Equations, available: &[Output], want: &str) -> Vec<Output> {
    if want == "outputs" {
        let of_model = &equations.system.outputs;
        return available.iter().filter(|o| of_model.iter().any(|m| m.name == o.name)).cloned().collect();
    }
    if let Some(group) = available.iter().find(|o| o.name == want) {
        return vec![group.clone()];
    }
    let single = available.iter().find_map(|o| {
        let component = o.components.iter().find(|(name, _)| name == want)?.clone();
        Some(Output { name: want.to_owned(), components: vec![component], doc: o.doc.clone() })
    });
    single.into_iter().collect()
}

fn available_outputs(equations: &Equations) -> Vec<Output> {
    let mut outputs = equations.outputs.clone();
    if !equations.facts.energy_is_conserved {
        outputs.insert(
            0,
            Output {
                name: "energy_rate".into(),
                components: vec![("energy_rate".into(), equations.energy_rate)],
                doc: "rate of energy dE/dt along the motion".into(),
            },
        );
    }
    outputs
}

fn lower_scene(
    equations: Equations,
    name: &str,
    outputs: Vec<Output>,
    wants_energy: bool,
    doc: String,
) -> Result<BuiltScene, Error> {
    let system = &equations.system;
    let mut graph = system.graph.clone();
    let inputs = Inputs {
        params: system.params.iter().map(|p| p.symbol).collect(),
        time: system.time,
        state: equations.state.iter().map(|s| s.symbol).collect(),
    };
    let mut conditions: Vec<ParamCondition> = system
        .conditions
        .iter()
        .map(|c| ParamCondition {
            text: c.text.clone(),
            greater: c.greater,
            less: c.less,
            relation: match c.relation {
                spec::Relation::Greater => Relation::Greater,
                spec::Relation::GreaterEqual => Relation::GreaterEqual,
                spec::Relation::NotEqual => Relation::NotEqual,
            },
        })
        .collect();
    let mut moving_pivots = Vec::new();
    for pivot in &equations.pivots {
        if sign_of(&graph, pivot.expr, &system.signs).is_definite() {
            continue;
        }
        if equations.is_parameter_only(pivot.expr) {
            conditions.push(ParamCondition {
                text: format!("{} != 0", pivot.name),
                greater: pivot.expr,
                less: graph.zero(),
                relation: Relation::NotEqual,
            });
        } else {
            moving_pivots.push((pivot.name.clone(), pivot.expr));
        }
    }
    let rhs: Vec<(String, ExprId)> = equations.state.iter().map(|s| (s.name.clone(), s.derivative)).collect();
    let mut requests = vec![Request { name: "rhs".into(), results: rhs }];
    if wants_energy {
        let results = vec![("energy".to_owned(), equations.energy)];
        requests.push(Request { name: "energy".into(), results });
    }
    requests.push(Request { name: "check".into(), results: moving_pivots });
    for output in &outputs {
        requests.push(Request { name: output.name.clone(), results: output.components.clone() });
    }
    let program = lower::lower(&mut graph, &inputs, &equations.sections, &conditions, &requests)?;
    Ok(BuiltScene { name: name.to_owned(), equations, program, outputs, doc })
}

impl BuiltScene {
    /// Names of the state variables in order.
    pub fn state_names(&self) -> Vec<String> {
        self.equations.state.iter().map(|s| s.name.clone()).collect()
    }

    /// Parameters that the scene leaves free.
    pub fn params(&self) -> &[Param] {
        &self.equations.system.params
    }

    /// Outputs of the scene, besides the right-hand side and the energy.
    pub fn outputs(&self) -> &[Output] {
        &self.outputs
    }

    /// Whether the scene computes the energy.
    pub fn has_energy(&self) -> bool {
        self.program.function_idx("energy").is_some()
    }

    /// Documentation of the scene.
    pub fn doc(&self) -> &str {
        &self.doc
    }

    /// Name of the emitted module: the model's, followed by the scene's unless it is the default.
    pub fn module_name(&self) -> String {
        let model = &self.equations.system.name;
        if self.name == DEFAULT { model.clone() } else { format!("{model}_{}", self.name) }
    }

    /// Checks parameters and prepares an interpreter for them.
    ///
    /// # Errors
    /// The condition that the parameters violate.
    ///
    /// # Panics
    /// When the number of parameters is wrong.
    pub fn prepare(&self, params: &[f64]) -> Result<Interpreter<'_>, ViolatedCondition> {
        let prepared = self.program.prepare(params)?;
        Ok(Interpreter { scene: self, params: params.to_vec(), prepared })
    }

    /// Operations of every function, per section of the right-hand side, and of the part that runs once.
    pub fn operation_table(&self) -> String {
        let mut rows: Vec<(String, Counts)> =
            vec![("prepare (once per parameter set)".into(), self.program.prepare.counts())];
        for function in &self.program.functions {
            if function.results.is_empty() {
                continue;
            }
            rows.push((function.name.clone(), function.counts()));
            if function.name == "rhs" {
                for (k, title) in self.program.sections.iter().enumerate() {
                    let counts = function.counts_of_section(k);
                    if counts.total() > 0 {
                        rows.push((format!("  {title}"), counts));
                    }
                }
            }
        }
        let width = rows.iter().map(|(name, _)| name.chars().count()).max().unwrap_or(0);
        let mut table = String::new();
        for (name, counts) in rows {
            let pad = " ".repeat(width - name.chars().count());
            table.push_str(&format!("  {name}{pad}  {counts}\n"));
        }
        table
    }
}

/// A scene's program with prepared parameters, run operation by operation.
#[derive(Clone, Debug)]
pub struct Interpreter<'a> {
    scene: &'a BuiltScene,
    params: Vec<f64>,
    prepared: Vec<f64>,
}

impl Interpreter<'_> {
    /// The scene.
    pub fn scene(&self) -> &BuiltScene {
        self.scene
    }

    fn call(&self, name: &str, t: f64, y: &[f64], out: &mut [f64]) -> bool {
        let Some(k) = self.scene.program.function_idx(name) else { return false };
        self.scene.program.run(k, &self.params, &self.prepared, t, y, out);
        true
    }

    /// Time derivative of the state.
    ///
    /// # Panics
    /// When a size is wrong.
    pub fn rhs(&self, t: f64, y: &[f64], dy: &mut [f64]) {
        self.call("rhs", t, y, dy);
    }

    /// Energy, when the scene wants it.
    pub fn energy(&self, t: f64, y: &[f64]) -> Option<f64> {
        let mut out = [0.0];
        self.call("energy", t, y, &mut out).then_some(out[0])
    }

    /// All outputs, concatenated.
    pub fn outputs(&self, t: f64, y: &[f64]) -> Vec<f64> {
        let mut all = Vec::new();
        for output in &self.scene.outputs {
            let mut out = vec![0.0; output.components.len()];
            self.call(&output.name, t, y, &mut out);
            all.extend(out);
        }
        all
    }

    /// Why the right-hand side cannot be evaluated here.
    ///
    /// # Errors
    /// The name of the pivot that vanishes.
    pub fn check(&self, t: f64, y: &[f64]) -> Result<(), String> {
        let Some(k) = self.scene.program.function_idx("check") else { return Ok(()) };
        let function = &self.scene.program.functions[k];
        let mut out = vec![0.0; function.results.len()];
        self.scene.program.run(k, &self.params, &self.prepared, t, y, &mut out);
        match function.results.iter().zip(&out).find(|(_, value)| **value == 0.0) {
            Some(((name, _), _)) => Err(name.clone()),
            None => Ok(()),
        }
    }
}
