//! The reduced model as text.
//!
//! Does not know: how symmetries are found.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use hamel_expr::{ExprId, Rational, Relation, Style, SymbolId};
use hamel_lang::algebra::LieAlgebra;
use hamel_lang::spec::{Domain, Layout, Param, ParamArray};
use num_traits::{One, Signed, Zero};

use super::group::SymmetryGroup;
use super::modules::Module;
use super::section::Section;
use super::setting::{Generator, Images, Setting};

/// What a text is made of.
pub(super) struct Pieces {
    pub(super) group: SymmetryGroup,
    /// Which of [`Setting::brought`] the group moves.
    pub(super) moved: Vec<usize>,
    /// What it makes of them.
    pub(super) module: Option<Module>,
    /// The report.
    pub(super) report: Vec<String>,
}

/// The text, and its functions as expressions at the section.
pub(super) struct Written<'a> {
    pub(super) text: String,
    /// Residuals of constraints.
    pub(super) constraints: Vec<ExprId>,
    /// What the group moves, with the functions and the symbols that advect.
    pub(super) module: Option<(Vec<ExprId>, &'a Module, Vec<SymbolId>)>,
}

impl Setting<'_> {
    fn spelled(&self, e: ExprId) -> String {
        self.graph.display(e, Style::Plain)
    }

    /// The text of the reduced model.
    pub(super) fn written<'p>(&mut self, pieces: &'p Pieces, section: &Section) -> Written<'p> {
        let model = self.model;
        let mut out = String::new();
        for line in head(&model.name, &model.doc, &pieces.report) {
            let _ = writeln!(out, "///{}{line}", if line.is_empty() { "" } else { " " });
        }
        let _ = writeln!(out, "model {}_reduced {{", model.name);
        for source in &model.sources {
            let _ = writeln!(out, "    source {source:?};");
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
        let (brought, advected) = self.write_advected(&mut out, pieces, section);
        let (potential, constraints) = (brought[0], &brought[1..]);
        let kinetic = self.at_section(section, self.kinetic);
        let lagrangian = self.graph.sub(kinetic, potential);
        let _ = writeln!(out, "    lagrangian = {};", self.spelled(lagrangian));
        for (residual, constraint) in constraints.iter().zip(&model.constraints) {
            if *residual != self.graph.zero() {
                let _ = writeln!(out, "    constraint {}: {} = 0;", constraint.name, self.spelled(*residual));
            }
        }
        let power = self.at_section(section, self.power);
        for (name, pair) in section.reduced.clone().iter().zip(section.pairs.clone()) {
            let force = self.graph.diff(power, pair);
            if !self.graph.is_zero(force) {
                let _ = writeln!(out, "    force {name} = {};", self.spelled(force));
            }
        }
        self.write_outputs(&mut out, &pieces.group, section);
        self.write_reconstruction(&mut out, &pieces.group, section);
        self.write_initial(&mut out, &pieces.group, section);
        out.push_str("}\n");
        let functions = pieces.moved.iter().map(|k| self.brought()[*k]).collect();
        let module = pieces.module.as_ref().map(|module| (functions, module, advected));
        Written { text: out, constraints: constraints.to_vec(), module }
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
        // adot = -xi . a.
        let mut action = vec![Vec::new(); n];
        for (a, _) in group.fields.iter().enumerate() {
            let xi = self.graph.sym(section.symbols[a]);
            for (j, row) in module.matrices[a].iter().enumerate() {
                for (k, q) in row.iter().enumerate().filter(|(_, q)| !q.is_zero()) {
                    let term = self.graph.mul(xi, symbols[j]);
                    action[k].push((term, -q.clone()));
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
        let what = match (pieces.moved.contains(&0), pieces.moved.len()) {
            (true, 1) => "potential energy",
            (true, _) => "potential energy and constraints",
            (false, _) => "constraints",
        };
        let _ = writeln!(out, "    /// What the group makes of the {what}.");
        let start: Vec<String> = module.start.iter().map(decimal).collect();
        if n == 1 {
            let _ = writeln!(out, "    advected {letter} in R by {};", action[0]);
            let _ = writeln!(out, "    initial {letter} = {};", start[0]);
        } else {
            let _ = writeln!(out, "    advected {letter} in R^{n} by [{}];", action.join(", "));
            let _ = writeln!(out, "    initial {letter} = [{}];", start.join(", "));
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
                            (self.graph.sym(symbol), -q.clone())
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
                group.fields.iter().all(|f| matches!(self.generators[f.pivot], Generator::Left(..)));
            if is_all_of_groups {
                document(out, doc);
            }
        }
        let _ = writeln!(out, "    velocity {} in {name};", list.join(", "));
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

    /// Casimirs and outputs that the group leaves alone.
    fn write_outputs(&mut self, out: &mut String, group: &SymmetryGroup, section: &Section) {
        let model = self.model;
        let casimirs = model.casimirs.iter().map(|c| ("casimir", &c.name, &c.doc, vec![c.expr]));
        let outputs = model.outputs.iter().map(|o| {
            ("output", &o.name, &o.doc, o.components.iter().map(|(_, e)| *e).collect::<Vec<ExprId>>())
        });
        for (word, name, doc, entries) in casimirs.chain(outputs).collect::<Vec<_>>() {
            let is_kept = entries.iter().all(|e| {
                group.fields.iter().all(|field| {
                    let slope = self.graph.derivative_along(*e, &field.images);
                    self.vanishes(slope)
                })
            });
            if !is_kept {
                let _ = writeln!(out, "    // Left out: {word} `{name}`, which the group moves.");
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
        let left = [
            ("event", model.events.len()),
            ("view", model.views.list.len()),
            ("scene", model.scenes.len()),
            ("section", model.sections.len()),
            ("name of momenta", model.momenta.len()),
            ("chain of stages", usize::from(model.stages.is_some())),
            ("velocity that the state does not carry itself", model.carries.len()),
            ("choice of independent velocities", model.independent.iter().len()),
            ("kind of connection", usize::from(model.derived_connection.is_some())),
        ];
        for (what, count) in left {
            if count > 0 {
                let _ = writeln!(out, "    // Left out, with its number: {what}, {count}.");
            }
        }
    }

    /// The coordinates of the group from its velocity, where the model can name the group.
    fn write_reconstruction(&mut self, out: &mut String, group: &SymmetryGroup, section: &Section) {
        let model = self.model;
        for (k, configuration) in model.configurations.iter().enumerate() {
            let own: Vec<usize> = (0..group.fields.len())
                .filter(
                    |a| matches!(self.generators[group.fields[*a].pivot], Generator::Left(of, _) if of == k),
                )
                .collect();
            if own.is_empty() {
                continue;
            }
            let list = [vec![configuration.name.clone()], vectors_of(configuration)].concat().join(", ");
            let from: Vec<&str> = own.iter().map(|a| section.names[*a].as_str()).collect();
            document(out, &model.advected[configuration.advected].doc);
            let _ =
                writeln!(out, "    reconstruct {list} in {} from {};", configuration.group, from.join(", "));
        }
        let mut done: BTreeSet<usize> = BTreeSet::new();
        // Angles come before what they turn.
        let mut order: Vec<usize> = (0..model.base.len()).filter(|i| !section.shape.contains(i)).collect();
        order.sort_by_key(|i| !self.is_angle(*i));
        for i in order {
            if !done.insert(i) {
                continue;
            }
            let turning: Vec<usize> = (0..group.fields.len())
                .filter(|a| {
                    let c = &group.fields[*a].coefficients;
                    self.generators
                        .iter()
                        .zip(c)
                        .any(|(g, q)| matches!(g, Generator::Linear(_, j) if *j == i) && !q.is_zero())
                })
                .collect();
            let along = |s: &mut Setting<'_>, i: usize| -> String {
                let Some(at) = s.position(Generator::Translation(i)) else { return "0".into() };
                let terms: Vec<(ExprId, Rational)> = (group.fields.iter().zip(&section.symbols))
                    .map(|(f, symbol)| (s.graph.sym(*symbol), f.coefficients[at].clone()))
                    .collect();
                let sum = s.graph.linear_combination(&terms);
                s.spelled(sum)
            };
            let name = |i: usize| model.base[i].name.clone();
            let of_space = match turning.first().map(|a| self.generators[group.fields[*a].pivot]) {
                Some(Generator::Left(k, _)) if i + 2 < model.base.len() => {
                    Some(&model.configurations[k].name)
                }
                _ => None,
            };
            let angle = match turning.as_slice() {
                [a] if i + 1 < model.base.len()
                    && self.is_quarter_turn(&group.fields[*a].coefficients, i) =>
                {
                    match self.generators[group.fields[*a].pivot] {
                        Generator::Translation(angle) => Some(name(angle)),
                        _ => None,
                    }
                }
                _ => None,
            };
            if turning.is_empty() {
                let rate = along(self, i);
                document(out, &model.base[i].doc);
                let _ = writeln!(out, "    reconstruct {} by {rate};", name(i));
            } else if let Some(theta) = angle {
                done.insert(i + 1);
                let (x, y) = (along(self, i), along(self, i + 1));
                let turn = format!("[[cos({theta}), -sin({theta})], [sin({theta}), cos({theta})]]");
                let _ = writeln!(out, "    reconstruct {}, {} by {turn}*[{x}, {y}];", name(i), name(i + 1));
            } else if let Some(matrix) = of_space {
                done.extend([i + 1, i + 2]);
                let rates = [0, 1, 2].map(|d| along(self, i + d)).join(", ");
                let names = [0, 1, 2].map(|d| name(i + d)).join(", ");
                let _ = writeln!(out, "    reconstruct {names} by {matrix}*[{rates}];");
            } else {
                let _ = writeln!(out, "    // Not reconstructed: `{}`.", name(i));
            }
        }
    }

    /// Whether a field turns `q_i`, `q_i+1` counter-clockwise and moves no other coordinate linearly along them.
    fn is_quarter_turn(&self, coefficients: &[Rational], i: usize) -> bool {
        let of = |from: usize, to: usize| {
            self.position(Generator::Linear(from, to))
                .map_or_else(Rational::zero, |at| coefficients[at].clone())
        };
        of(i, i + 1).is_one() && (-of(i + 1, i)).is_one() && of(i, i).is_zero() && of(i + 1, i + 1).is_zero()
    }

    /// Initial values, where the model starts at the cross-section.
    fn write_initial(&mut self, out: &mut String, group: &SymmetryGroup, section: &Section) {
        let model = self.model;
        let given: BTreeMap<&str, ExprId> = model.initial.iter().map(|(n, e)| (n.as_str(), *e)).collect();
        let zero = self.graph.zero();
        let symbols = model.base.iter().map(|c| (c.name.as_str(), c.symbol));
        let of_groups = model
            .configurations
            .iter()
            .flat_map(|c| c.names.iter().map(String::as_str).zip(c.symbols.iter().copied()));
        let starts_there = symbols.chain(of_groups).all(|(name, symbol)| {
            let wanted = section.at.get(&symbol);
            let is_alone = group.fields.iter().all(|f| {
                let pivot = self.generators[f.pivot];
                let is_own = matches!(pivot, Generator::Translation(i) if model.base[i].symbol == symbol);
                // A coordinate of a line that nothing depends on starts where it does.
                !is_own || f.coefficients.iter().filter(|q| !q.is_zero()).count() == 1
            });
            let is_line = model.base.iter().any(|c| c.symbol == symbol) && is_alone && {
                let moved = group.fields.iter().any(|f| {
                    let image = f.images.get(&symbol).copied().unwrap_or(zero);
                    self.graph.as_rational(image).is_none()
                });
                !moved
            };
            match (wanted, given.get(name)) {
                (None, _) | (Some(_), None) => true,
                (Some(value), Some(start)) => value == start || is_line,
            }
        });
        if model.initial.is_empty() {
            return;
        }
        if !starts_there {
            out.push_str("    // Initial values are left out: the model starts elsewhere than at the identity of the group.\n");
            return;
        }
        let speed = |k: usize| {
            let all = model.all_velocities();
            given.get(all[k].0).copied().unwrap_or(zero)
        };
        let mut xi = Vec::new();
        for (field, name) in group.fields.iter().zip(&section.names) {
            let k = match self.generators[field.pivot] {
                Generator::Left(k, a) => model.base.len() + model.configurations[k].velocities[a],
                Generator::Translation(i) | Generator::Linear(i, _) | Generator::Right(i, _) => i,
            };
            xi.push(speed(k));
            let _ = writeln!(out, "    initial {name} = {};", self.spelled(speed(k)));
        }
        let start: Images = model
            .base
            .iter()
            .map(|c| (c.symbol, given.get(c.name.as_str()).copied().unwrap_or(zero)))
            .chain(model.configurations.iter().flat_map(|c| {
                c.names
                    .iter()
                    .zip(&c.symbols)
                    .map(|(n, s)| (*s, given.get(n.as_str()).copied().unwrap_or(zero)))
            }))
            .collect();
        let mut rest: Vec<(usize, String)> =
            section.shape.iter().map(|i| (*i, model.base[*i].velocity_name.clone())).collect();
        for (k, names) in &section.kept {
            let places = model.configurations[*k].velocities.iter().map(|b| model.base.len() + b);
            rest.extend(places.zip(names.iter().cloned()));
        }
        for (k, name) in rest {
            let mut terms = vec![(speed(k), Rational::one())];
            for (xi, tangent) in xi.iter().zip(&section.tangents) {
                let tangent = self.graph.subs(tangent[k], &start).unwrap_or(tangent[k]);
                terms.push((self.graph.mul(*xi, tangent), -Rational::one()));
            }
            let value = self.graph.linear_combination(&terms);
            let _ = writeln!(out, "    initial {name} = {};", self.spelled(value));
        }
        // Coordinates that leave are known where they are reconstructed, and there alone.
        for (i, coordinate) in model.base.iter().enumerate().filter(|(i, _)| !section.shape.contains(i)) {
            let start = given.get(coordinate.name.as_str()).filter(|e| **e != zero);
            if let Some(e) = start.filter(|_| out.contains(&format!("reconstruct {} by", model.base[i].name)))
            {
                let _ = writeln!(out, "    initial {} = {};", coordinate.name, self.spelled(*e));
            }
        }
        for i in &section.shape {
            if let Some(e) = given.get(model.base[*i].name.as_str()) {
                let _ = writeln!(out, "    initial {} = {};", model.base[*i].name, self.spelled(*e));
            }
        }
        for (k, _) in &section.kept {
            for name in &model.configurations[*k].names {
                if let Some(e) = given.get(name.as_str()) {
                    let _ = writeln!(out, "    initial {name} = {};", self.spelled(*e));
                }
            }
        }
    }
}

/// One name for each block, where the components of all blocks are numbered from one; the names otherwise.
fn shortened(names: &[String], blocks: &[usize]) -> Vec<String> {
    let mut rest = names;
    let mut shorter = Vec::new();
    for size in blocks {
        let (own, after) = rest.split_at(*size);
        rest = after;
        let stem = own[0].strip_suffix('1').filter(|stem| Layout::Vector(*size).names(stem) == own);
        match (stem, size) {
            (_, 1) => shorter.push(own[0].clone()),
            (Some(stem), _) => shorter.push(stem.to_owned()),
            (None, _) => return names.to_vec(),
        }
    }
    shorter
}

/// Names of the vectors of a configuration.
fn vectors_of(configuration: &hamel_lang::spec::Configuration) -> Vec<String> {
    let n_entries = configuration.group.n_blocks() * configuration.group.n() * configuration.group.n();
    let mut start = n_entries;
    let mut list = Vec::new();
    for (_, dim) in configuration.group.spaces() {
        let first = &configuration.names[start];
        list.push(if dim == 1 { first.clone() } else { first.trim_end_matches('1').to_owned() });
        start += dim;
    }
    list
}

fn head(name: &str, doc: &[String], report: &[String]) -> Vec<String> {
    let title = doc.first().cloned().unwrap_or_else(|| name.to_owned());
    let mut lines = vec![format!("{title}, reduced"), String::new()];
    lines.extend(report.iter().cloned());
    lines
}

fn document(out: &mut String, doc: &str) {
    for line in doc.lines() {
        let _ = writeln!(out, "    ///{}{line}", if line.is_empty() { "" } else { " " });
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

/// A rational number as the language reads it: in decimals where these end soon.
fn decimal(q: &Rational) -> String {
    let ten = Rational::from_integer(10.into());
    let mut scaled = q.abs();
    for digits in 0..=17usize {
        if scaled.is_integer() {
            let text = scaled.to_integer().to_string();
            let padded = format!("{text:0>width$}", width = digits + 1);
            let (whole, part) = padded.split_at(padded.len() - digits);
            let sign = if q.is_negative() { "-" } else { "" };
            return if digits == 0 { format!("{sign}{whole}") } else { format!("{sign}{whole}.{part}") };
        }
        scaled *= &ten;
    }
    format!("{}/{}", q.numer(), q.denom())
}

/// The algebra by its name, with the sizes of its blocks, where its constants are the group's.
fn known_algebra(group: &SymmetryGroup) -> Option<(String, Vec<usize>)> {
    let n = group.fields.len();
    let own = |a: usize, b: usize| -> Vec<Rational> {
        let found = group.brackets.iter().find(|(x, y, _)| (*x, *y) == (a, b));
        found.map_or_else(|| vec![Rational::zero(); n], |(_, _, c)| c.iter().map(|q| -q.clone()).collect())
    };
    let mut candidates: Vec<LieAlgebra> = Vec::new();
    let bases = [LieAlgebra::so(3), LieAlgebra::se(2), LieAlgebra::se(3), LieAlgebra::su(2)];
    let bases: Vec<LieAlgebra> = bases.into_iter().filter_map(Result::ok).collect();
    candidates.push(LieAlgebra::abelian(n));
    for base in bases {
        for copies in 1..=n / base.dim() {
            let rest = n - copies * base.dim();
            let mut factors = vec![base.clone(); copies];
            if rest > 0 {
                factors.push(LieAlgebra::abelian(rest));
            }
            candidates.push(if factors.len() == 1 { base.clone() } else { LieAlgebra::product(&factors) });
        }
    }
    let fits = |algebra: &&LieAlgebra| {
        algebra.dim() == n
            && (0..n).all(|a| {
                (a + 1..n).all(|b| {
                    let mut constants = vec![Rational::zero(); n];
                    for (c, q) in algebra.bracket(a, b) {
                        constants[c] = q;
                    }
                    constants == own(a, b)
                })
            })
    };
    let found = candidates.iter().find(fits)?;
    let name = if n > 0 && found.name() == format!("R^{n}") && n == 1 {
        "R".to_owned()
    } else {
        found.name().to_owned()
    };
    Some((name, found.blocks().iter().map(|b| b.dim).collect()))
}
