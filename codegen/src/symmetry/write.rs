//! The reduced model as text.
//!
//! Does not know: how symmetries are found.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use hamel_expr::{ExprId, Rational, Relation, Style, SymbolId};
use hamel_lang::spec::{Domain, Layout, NamedVector, OutputPart, Param, ParamArray, Side};
use num_traits::{One, Zero};

use super::group::SymmetryGroup;
use super::modules::Module;
use super::names::{decimal, known_algebra, shortened, vectors_of};
use super::section::Section;
use super::setting::{FIRST_CONSTRAINT, Generator, Setting};

/// What a text is made of.
pub(super) struct Pieces {
    pub(super) group: SymmetryGroup,
    /// Which of [`Setting::brought`] the group moves.
    pub(super) moved: Vec<usize>,
    /// What it makes of them.
    pub(super) module: Option<Module>,
    /// The report.
    pub(super) report: Vec<String>,
    /// Whether symmetries were found, and nothing speaks against them but that they are no group to reduce by.
    pub(super) only_told: bool,
}

/// The text, and its functions as expressions at the section.
pub(super) struct Written {
    /// The model, without the values that it starts at.
    pub(super) text: String,
    /// Items of the model that the text has not.
    pub(super) left: Vec<String>,
    /// Residuals of constraints.
    pub(super) constraints: Vec<ExprId>,
    /// Velocities along solutions of constraints.
    pub(super) along: Vec<SymbolId>,
    /// What the group moves, with the functions and the symbols that advect.
    pub(super) module: Option<(Vec<ExprId>, Module, Vec<SymbolId>)>,
}

/// A variable of the reduced model as a function of the model; a variable that is the one of the same name has none.
pub(super) struct Image {
    pub(super) name: String,
    pub(super) value: ExprId,
    /// The function in the names of the model.
    pub(super) text: String,
}

/// Names of the variables that a map gives.
pub(super) fn named(map: Option<&[Image]>) -> BTreeSet<&str> {
    map.unwrap_or_default().iter().map(|image| image.name.as_str()).collect()
}

impl Setting<'_> {
    pub(super) fn spelled(&self, e: ExprId) -> String {
        self.graph.display(e, Style::Plain)
    }

    /// The text of the reduced model.
    pub(super) fn written(&mut self, pieces: &Pieces, section: &Section) -> Written {
        let model = self.model;
        let mut out = String::new();
        for line in head(&model.name, &model.doc, &pieces.report) {
            let _ = writeln!(out, "///{}{line}", if line.is_empty() { "" } else { " " });
        }
        let _ = writeln!(out, "model {}_reduced {{", model.name);
        for source in &model.sources {
            let _ = writeln!(out, "    source {source:?};");
        }
        if let Some(topic) = &model.topic {
            let _ = writeln!(out, "    topic {topic:?};");
        }
        numbers(&mut out, "param", &model.params, &model.param_arrays);
        numbers(&mut out, "input", &model.inputs, &model.input_arrays);
        for condition in &model.conditions {
            // The text of a condition may name definitions, which are not written.
            let sides = [condition.greater, condition.less].map(|e| self.spelled(e));
            let sign = match condition.relation {
                Relation::Greater => ">",
                Relation::GreaterEqual => ">=",
                Relation::NotEqual => "!=",
            };
            let _ = writeln!(out, "    require {} {sign} {};", sides[0], sides[1]);
        }
        self.write_velocities(&mut out, &pieces.group, section);
        for i in &section.shape {
            self.write_coordinate(&mut out, *i);
        }
        for (k, names) in &section.kept {
            let configuration = &model.configurations[*k];
            document(&mut out, &model.advected[configuration.advected].doc);
            let matrix = &configuration.name;
            let others: Vec<String> = vectors_of(configuration);
            let list = [vec![matrix.clone()], others].concat().join(", ");
            let group = configuration.group.of_configuration();
            let blocks: Vec<usize> = configuration.group.algebra().blocks().iter().map(|b| b.dim).collect();
            let names = shortened(names, &blocks).join(", ");
            let relative = self.frame_of(*k, &pieces.group, section);
            let relative = relative.map_or_else(String::new, |frame| format!(" relative {frame}"));
            let _ = writeln!(out, "    configuration {list} in {group} velocity {names}{relative};");
        }
        if let Some(item) = self.marked_item(&pieces.group, &section.symbols) {
            out.push_str(&item);
        }
        let (brought, advected) = self.write_advected(&mut out, pieces, section);
        let (potential, power, constraints) = (brought[0], brought[1], &brought[FIRST_CONSTRAINT..]);
        let kinetic = self.at_section(section, self.kinetic);
        let lagrangian = self.graph.sub(kinetic, potential);
        let mut named: Vec<(String, ExprId)> =
            model.constraints.iter().map(|c| c.name.clone()).zip(constraints.iter().copied()).collect();
        named.retain(|(_, residual)| *residual != self.graph.zero());
        for (_, residual) in &mut named {
            *residual = self.shortened_residual(*residual, section);
        }
        let along = self.along_solutions(&mut named, section);
        for symbol in &along {
            let _ = writeln!(out, "    /// Along what the constraints leave.");
            let _ = writeln!(out, "    quasi_velocity {};", self.graph.name(*symbol));
        }
        let _ = writeln!(out, "    lagrangian = {};", self.spelled(lagrangian));
        for (name, residual) in &named {
            let _ = writeln!(out, "    constraint {name}: {} = 0;", self.spelled(*residual));
        }
        for (name, pair) in section.reduced.clone().iter().zip(section.pairs.clone()) {
            let force = self.graph.diff(power, pair);
            if !self.graph.is_zero(force) {
                let _ = writeln!(out, "    force {name} = {};", self.spelled(force));
            }
        }
        let left = self.write_outputs(&mut out, &pieces.group, section);
        for line in &left {
            let _ = writeln!(out, "    // {line}");
        }
        self.write_reconstruction(&mut out, &pieces.group, section);
        out.push_str("}\n");
        let functions = pieces.moved.iter().map(|k| self.brought()[*k]).collect();
        let module = pieces.module.clone().map(|module| (functions, module, advected));
        let constraints = named.into_iter().map(|(_, residual)| residual).collect();
        Written { text: out, left, constraints, along, module }
    }

    /// Potential energy and constraints at the section; what advects them is declared.
    fn write_advected(
        &mut self,
        out: &mut String,
        pieces: &Pieces,
        section: &Section,
    ) -> (Vec<ExprId>, Vec<SymbolId>) {
        let mut all = self.brought();
        let Some(module) = &pieces.module else {
            return (all.into_iter().map(|e| self.at_section(section, e)).collect(), Vec::new());
        };
        let group = &pieces.group;
        let declared = &self.model.places.declared;
        let letters = ["a", "b", "c", "d", "advected"];
        let letter = letters.iter().find(|l| !declared.contains_key(**l)).unwrap_or(&"advected_").to_string();
        let n = module.basis.len();
        let names: Vec<String> = if n == 1 { vec![letter.clone()] } else { Layout::Vector(n).names(&letter) };
        let own: Vec<SymbolId> = names.iter().map(|name| self.graph.symbol(name)).collect();
        let symbols: Vec<ExprId> = own.iter().map(|symbol| self.graph.sym(*symbol)).collect();
        // adot = -xi . a, and adot = xi . a for an action from the right.
        let sign = group.constant(&Rational::one());
        let mut action = vec![Vec::new(); n];
        for (a, _) in group.fields.iter().enumerate() {
            let xi = self.graph.sym(section.symbols[a]);
            for (j, row) in module.matrices[a].iter().enumerate() {
                for (k, q) in row.iter().enumerate().filter(|(_, q)| !q.is_zero()) {
                    let term = self.graph.mul(xi, symbols[j]);
                    action[k].push((term, &sign * q));
                }
            }
        }
        let action: Vec<String> = action
            .into_iter()
            .map(|terms| {
                let sum = self.graph.linear_combination(&terms);
                self.spelled(sum)
            })
            .collect();
        let what = moved_in_words(&pieces.moved);
        let _ = writeln!(out, "    /// What the group makes of {what}.");
        if n == 1 {
            let _ = writeln!(out, "    advected {letter} in R by {};", action[0]);
        } else {
            let _ = writeln!(out, "    advected {letter} in R^{n} by [{}];", action.join(", "));
        }
        for (r, k) in pieces.moved.iter().enumerate() {
            let mut terms = vec![module.rest[r]];
            for (a, v) in symbols.iter().zip(&module.basis) {
                terms.push(self.graph.mul(*a, v[r]));
            }
            all[*k] = self.graph.sum(&terms);
        }
        (all.into_iter().map(|e| self.at_section(section, e)).collect(), own)
    }

    fn write_velocities(&mut self, out: &mut String, group: &SymmetryGroup, section: &Section) {
        let n = group.fields.len();
        if n == 0 {
            return;
        }
        let docs: BTreeSet<&str> = self.model.velocities.iter().map(|v| v.doc.as_str()).collect();
        let known = known_algebra(group);
        let list = match &known {
            Some((_, blocks)) => shortened(&section.names, blocks),
            None => section.names.clone(),
        };
        let name = match known {
            Some((name, _)) => name,
            None => {
                let mut name = "g".to_owned();
                while self.model.places.declared.contains_key(&name) {
                    name.push('_');
                }
                let basis: Vec<String> = section.names.iter().map(|v| format!("e_{v}")).collect();
                let _ = writeln!(out, "    algebra {name} {{");
                let _ = writeln!(out, "        basis {};", basis.join(", "));
                for (a, b, constants) in &group.brackets {
                    let terms: Vec<(ExprId, Rational)> = constants
                        .iter()
                        .enumerate()
                        .filter(|(_, q)| !q.is_zero())
                        .map(|(c, q)| {
                            let symbol = self.graph.symbol(&basis[c]);
                            (self.graph.sym(symbol), group.constant(q))
                        })
                        .collect();
                    let sum = self.graph.linear_combination(&terms);
                    let _ = writeln!(out, "        [{}, {}] = {};", basis[*a], basis[*b], self.spelled(sum));
                }
                let _ = writeln!(out, "    }}");
                name
            }
        };
        if let [doc] = docs.into_iter().collect::<Vec<_>>().as_slice() {
            let is_all_of_groups =
                group.side == Side::Left && group.fields.iter().all(|f| self.configuration_of(f).is_some());
            if is_all_of_groups {
                document(out, doc);
            }
        }
        let _ = writeln!(out, "    velocity {} in {name};", list.join(", "));
        if group.side == Side::Right {
            out.push_str("    action right;\n");
        }
    }

    /// The velocities of the configuration that a configuration turns with.
    fn frame_of(&self, k: usize, group: &SymmetryGroup, section: &Section) -> Option<String> {
        let at = self.position(Generator::Left(k, 0))?;
        let first = group.fields.iter().position(|f| !f.coefficients[at].is_zero())?;
        let n = self.model.configurations[k].velocities.len();
        let names = &section.names[first..first + n];
        Some(shortened(names, &[n]).join(", "))
    }

    fn write_coordinate(&mut self, out: &mut String, i: usize) {
        let coordinate = &self.model.base[i];
        document(out, &coordinate.doc);
        let domain = match coordinate.domain {
            Domain::Angle => "angle".to_owned(),
            Domain::Real => "real".to_owned(),
            Domain::Interval(low, high) => format!("({}, {})", self.spelled(low), self.spelled(high)),
        };
        let _ = writeln!(out, "    coordinate {} in {domain};", coordinate.name);
    }

    /// Casimirs and outputs that the group leaves alone; a line for each item that is left out.
    fn write_outputs(&mut self, out: &mut String, group: &SymmetryGroup, section: &Section) -> Vec<String> {
        let model = self.model;
        let mut left = Vec::new();
        let casimirs = model.casimirs.iter().map(|c| ("casimir", &c.name, &c.doc, vec![c.expr]));
        let own = model.outputs.iter().filter(|o| o.part == OutputPart::Own);
        let outputs = own.map(|o| {
            ("output", &o.name, &o.doc, o.components.iter().map(|(_, e)| *e).collect::<Vec<ExprId>>())
        });
        let known = self.variables();
        for (word, name, doc, entries) in casimirs.chain(outputs).collect::<Vec<_>>() {
            let other = entries.iter().flat_map(|e| self.graph.free_symbols(*e)).find(|s| !known.contains(s));
            if let Some(other) = other {
                let other = self.graph.name(other);
                left.push(format!("Left out: {word} `{name}`, which contains `{other}`."));
                continue;
            }
            let is_kept = entries.iter().all(|e| {
                group.fields.iter().all(|field| {
                    let slope = self.graph.derivative_along(*e, &field.images);
                    self.vanishes(slope)
                })
            });
            if !is_kept {
                left.push(format!("Left out: {word} `{name}`, which the group moves."));
                continue;
            }
            let texts: Vec<String> = entries
                .iter()
                .map(|e| {
                    let value = self.at_section(section, *e);
                    self.spelled(value)
                })
                .collect();
            document(out, doc);
            let value =
                if let [only] = texts.as_slice() { only.clone() } else { format!("[{}]", texts.join(", ")) };
            let _ = writeln!(out, "    {word} {name} = {value};");
        }
        let of_bodies = |o: &&NamedVector| {
            matches!(o.part, OutputPart::Bodies | OutputPart::CenterOfMass | OutputPart::CentroidalMomentum)
        };
        let has_frames = model.outputs.iter().any(|o| o.part == OutputPart::Poses);
        let counts = [
            ("event", model.events.len()),
            ("view", model.views.list.len()),
            ("scene", model.scenes.len()),
            ("section", model.sections.len()),
            ("name of momenta", model.momenta.len()),
            ("chain of stages", usize::from(model.stages.is_some())),
            ("velocity that the state does not carry itself", model.carries.len()),
            ("choice of independent velocities", model.independent.iter().len()),
            ("choice of multipliers", usize::from(model.force_multipliers)),
            ("kind of connection", usize::from(model.derived_connection.is_some())),
            ("coordinate that the model reconstructs itself", model.reconstruction.len()),
            ("set of named frames", usize::from(has_frames)),
            ("function of all bodies", model.outputs.iter().filter(of_bodies).count()),
        ];
        for (what, count) in counts {
            if count > 0 {
                left.push(format!("Left out, with its number: {what}, {count}."));
            }
        }
        left
    }

    /// Symbols that have a value in the reduced model.
    fn variables(&self) -> BTreeSet<SymbolId> {
        let model = self.model;
        let numbers = model.params.iter().chain(&model.inputs).map(|p| p.symbol);
        let base = model.base.iter().map(|c| c.symbol);
        let groups = model.configurations.iter().flat_map(|c| c.symbols.iter().copied());
        let velocities = self.velocities.iter().copied();
        numbers.chain(base).chain(groups).chain(velocities).chain([model.time]).collect()
    }
}

fn head(name: &str, doc: &[String], report: &[String]) -> Vec<String> {
    let title = doc.first().cloned().unwrap_or_else(|| name.to_owned());
    let mut lines = vec![format!("{title}, reduced"), String::new()];
    lines.extend(report.iter().cloned());
    lines
}

pub(super) fn document(out: &mut String, doc: &str) {
    for line in doc.lines() {
        let _ = writeln!(out, "    ///{}{line}", if line.is_empty() { "" } else { " " });
    }
}

/// Which of [`Setting::brought`] are moved.
pub(super) fn moved_in_words(moved: &[usize]) -> String {
    let parts: Vec<&str> = [
        ("potential energy", moved.contains(&0)),
        ("forces", moved.contains(&1)),
        ("constraints", moved.iter().any(|k| *k >= FIRST_CONSTRAINT)),
    ]
    .into_iter()
    .filter_map(|(what, is_there)| is_there.then_some(what))
    .collect();
    match parts.as_slice() {
        [rest @ .., last] if !rest.is_empty() => format!("{} and {last}", rest.join(", ")),
        all => all.concat(),
    }
}

/// Parameters or inputs as items.
fn numbers(out: &mut String, word: &str, all: &[Param], arrays: &[ParamArray]) {
    let mut k = 0;
    while let Some(param) = all.get(k) {
        let array = arrays.iter().find(|array| array.symbols.first() == Some(&param.symbol));
        document(out, &param.doc);
        match array {
            Some(array) => {
                let list: Vec<String> =
                    all[k..k + array.symbols.len()].iter().map(|p| decimal(&p.default)).collect();
                let shape = match array.layout {
                    Layout::Vector(n) => format!("vector({n})"),
                    Layout::Diagonal(n) => format!("diagonal({n})"),
                    Layout::Symmetric(n) => format!("symmetric({n})"),
                    Layout::Matrix(n, m) => format!("matrix({n}, {m})"),
                };
                let _ = writeln!(out, "    {word} {}: {shape} = [{}];", array.name, list.join(", "));
                k += array.symbols.len();
            }
            None => {
                let _ = writeln!(out, "    {word} {} = {};", param.name, decimal(&param.default));
                k += 1;
            }
        }
    }
}
