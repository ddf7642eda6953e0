//! A derived scene as text for people (Unicode, LaTeX, HTML with MathML): algebra, stage forms, constraint, equations,
//! what was found, operation counts.
//!
//! Deliberately does not know: how any of it was computed.

mod bracket;
mod by_paper;
mod by_stages;
mod connection;
mod dirac;
mod displacements;
mod events;
mod frame;
mod implicit;
mod labels;
mod latex;
mod lyapunov;
mod noise;
mod rates;
mod sections;
mod splitting;
mod stages;
mod units;

pub use self::by_paper::by_paper;
pub use self::rates::{brackets, rates};
pub use self::stages::stages;

use std::collections::BTreeSet;
use std::fmt::Write as _;

use num_traits::One;

use crate::scene::BuiltScene;
use hamel_expr::error::spell_vector;
use hamel_expr::{Budget, ExprId, Graph, Number, Style, SymbolId, identifier, rational_to_f64};
use hamel_lang::spec::{Model, Param, Side};
use hamel_mechanics::mechanics::{Coefficients, Equations, Form, Routhian};
use hamel_mechanics::reduction::{
    AccelerationRow, AccelerationSource, DegenerateOutcome, KinematicConstraint, ReducedSystem,
    SolvedConstraint,
};

/// What a part of an explanation is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum SectionKind {
    /// The model and its documentation, without a title.
    Head,
    /// Parameters and state variables.
    Inputs,
    /// The algebra by its brackets.
    Algebra,
    /// The algebroid that the model declares.
    Algebroid,
    /// Quasi-velocities and Hamel's symbols.
    Frame,
    /// The bracket in the forms of its stages.
    Stages,
    /// The connection and its curvature.
    Connection,
    /// Rates of coordinates by velocities.
    Kinematics,
    /// The constraint, solved or with multipliers.
    Constraint,
    /// Virtual displacements that the model gives, and both forms of its equations.
    Displacements,
    /// The function that an actuator gives its rate, with the force.
    Lyapunov,
    /// What equations without accelerations say, where the Lagrangian is degenerate.
    Degeneracy,
    /// The equations of motion.
    Equations,
    /// The Routhian, where momenta are carried.
    Routhian,
    /// The equations with a mass matrix, where the scene wants them.
    Implicit,
    /// The reduced Dirac structure, where it is asked for.
    Dirac,
    /// What was found on the way, exactly.
    Findings,
    /// Momenta along the sections of the model, and what of that kind is conserved.
    Sections,
    /// Modes and events of the model: when events happen and what they do.
    Events,
    /// The nonholonomic bracket, what it is and what it says about the motion.
    Bracket,
    /// The motion as a sum of motions with flows in closed form, where the scene wants them.
    Splitting,
    /// Operations of every function.
    Counts,
    /// Coefficients of the connections of the kinetic energy; on request.
    Coefficients,
    /// The bracket by stages, (2)-(14) of Cendra and Diaz; on request, as all that follow.
    PaperForms,
    /// Variations, (17) and (24).
    PaperVariations,
    /// The constraint and its displacements, (22)-(32).
    PaperConstraint,
    /// Covariant derivatives, (33), (34) and appendix A.
    PaperDerivatives,
    /// Vertical equations, (18)-(21), (35)-(38), (40), (43).
    PaperVertical,
    /// Horizontal equations, (39), (41)-(43).
    PaperHorizontal,
}

impl SectionKind {
    /// The title for people; empty for the head.
    pub fn title(self) -> &'static str {
        match self {
            SectionKind::Head => "",
            SectionKind::Inputs => "Parameters and state",
            SectionKind::Algebra => "Lie algebra",
            SectionKind::Algebroid => "Lie algebroid",
            SectionKind::Frame => "Frame",
            SectionKind::Stages => "Reduction by stages",
            SectionKind::Connection => "Connection",
            SectionKind::Kinematics => "Kinematics (anchor)",
            SectionKind::Constraint => "Constraint",
            SectionKind::Displacements => "Virtual displacements",
            SectionKind::Lyapunov => "Lyapunov function",
            SectionKind::Degeneracy => "Degenerate Lagrangian",
            SectionKind::Equations => "Equations of motion",
            SectionKind::Routhian => "Routhian",
            SectionKind::Implicit => "Implicit form M z' = f(t, z)",
            SectionKind::Dirac => "Dirac structure D/G",
            SectionKind::Findings => "Found exactly",
            SectionKind::Sections => "Momenta along sections",
            SectionKind::Events => "Events",
            SectionKind::Bracket => "Nonholonomic bracket",
            SectionKind::Splitting => "Exact flows",
            SectionKind::Counts => "Operation counts",
            SectionKind::Coefficients => "Connection coefficients",
            SectionKind::PaperForms => "Bracket by stages, (2)-(14)",
            SectionKind::PaperVariations => "Variations by stages, (17), (24)",
            SectionKind::PaperConstraint => "Constraint and displacements, (22)-(32)",
            SectionKind::PaperDerivatives => "Covariant derivatives, (33), (34), appendix A",
            SectionKind::PaperVertical => {
                "Vertical equations by stages, (18)-(21), (25), (32), (35)-(38), (40), (43)"
            }
            SectionKind::PaperHorizontal => "Horizontal equations by stages, (39), (41)-(43)",
        }
    }
}

/// A part of an explanation.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Section {
    /// What it is about.
    pub kind: SectionKind,
    /// Its text in the style asked for; in [`Style::MathMl`] block elements of HTML, well-formed as XML.
    pub text: String,
}

/// Explains a scene in Unicode ([`Style::Unicode`]), LaTeX ([`Style::Latex`], a fragment that needs `amsmath`) or HTML
/// ([`Style::MathMl`]).
pub fn explain(model: &Model, scene: &BuiltScene, style: Style) -> String {
    written(sections(model, scene, style), style)
}

/// The reduced Dirac structure of a scene, in the styles of [`explain`].
pub fn dirac(model: &Model, scene: &BuiltScene, style: Style) -> String {
    let whole = scene.whole();
    let scene = whole.as_deref().unwrap_or(scene);
    let head = Section { kind: SectionKind::Head, text: String::new() };
    let mut page = Page { style, head, rest: Vec::new() };
    page.header(model, scene);
    page.dirac(&scene.equations);
    written(std::iter::once(page.head).chain(page.rest).collect(), style)
}

/// The coefficients of the Levi-Civita connection of the kinetic energy of a system, and of the constrained one where
/// it has a constraint, in the frame of its velocities; those that vanish are left out.
pub fn connection_coefficients(coefficients: &Coefficients, style: Style) -> String {
    let head = Section { kind: SectionKind::Head, text: String::new() };
    let mut page = Page { style, head, rest: Vec::new() };
    page.coefficients(coefficients);
    written(page.rest, style)
}

/// [`sections`] of a style under their titles, as [`explain`] has them.
pub fn written(sections: Vec<Section>, style: Style) -> String {
    let mut text = String::new();
    for Section { kind, text: body } in sections {
        let title = kind.title();
        let _ = match style {
            _ if title.is_empty() => Ok(()),
            Style::Latex => writeln!(text, "\n\\subsection*{{{title}}}"),
            Style::MathMl => writeln!(text, "<h3>{title}</h3>"),
            _ => writeln!(text, "\n{title}\n{}", "─".repeat(title.chars().count())),
        };
        text.push_str(&body);
    }
    text
}

/// The same by sections: the head first, then those that the scene has.
pub fn sections(model: &Model, scene: &BuiltScene, style: Style) -> Vec<Section> {
    let whole = scene.whole();
    let scene = whole.as_deref().unwrap_or(scene);
    let head = Section { kind: SectionKind::Head, text: String::new() };
    let mut page = Page { style, head, rest: Vec::new() };
    page.header(model, scene);
    page.parameters(model, scene);
    match &model.algebroid {
        Some(own) => page.own_algebroid(model, own),
        None => page.algebra(model, &scene.equations),
    }
    page.frame(model, &scene.equations);
    if let Some(stages) = &scene.equations.system.stages {
        page.stages(model, stages, &scene.equations);
    }
    page.connection(model, &scene.equations);
    page.kinematics(&scene.equations);
    page.constraint(&scene.equations);
    page.implied(model);
    page.displacements(model, &scene.equations);
    page.lyapunov(&scene.equations);
    page.degeneracy(&scene.equations);
    page.equations(&scene.equations);
    page.routhian(&scene.equations);
    page.implicit(scene);
    page.findings(&scene.equations);
    page.certificate(scene);
    page.along_sections(&scene.equations);
    page.events(model, &scene.equations);
    page.bracket_of(model, scene);
    page.splitting(scene);
    page.counts(scene);
    std::iter::once(page.head).chain(page.rest).collect()
}

/// Characters of a formula that somebody reads.
const MAX_FORMULA: usize = 2000;

struct Page {
    style: Style,
    head: Section,
    rest: Vec<Section>,
}

impl Page {
    fn latex(&self) -> bool {
        self.style == Style::Latex
    }

    fn html(&self) -> bool {
        self.style == Style::MathMl
    }

    fn raw(&mut self, text: &str) {
        self.rest.last_mut().unwrap_or(&mut self.head).text.push_str(text);
    }

    fn line(&mut self, text: &str) {
        match self.style {
            Style::MathMl => self.raw(&format!("<p>{}</p>\n", text.trim())),
            // A blank line ends a paragraph.
            Style::Latex => self.raw(&format!("{}\n\n", latex::line(text.trim()))),
            Style::Plain | Style::Unicode => self.raw(&format!("{text}\n")),
        }
    }

    fn begin(&mut self, kind: SectionKind) {
        self.rest.push(Section { kind, text: String::new() });
    }

    /// A list of formulas, aligned at the first equals sign in LaTeX.
    fn formulas(&mut self, rows: &[(String, String)]) {
        if rows.is_empty() {
            return;
        }
        if self.latex() {
            self.raw(&latex::aligned(rows));
            return;
        }
        if self.html() {
            let row = |(left, right): &(String, String)| {
                let right: Vec<String> = terms(right)
                    .iter()
                    // A sign that begins a line is still one between two terms.
                    .enumerate()
                    .map(|(k, t)| match k {
                        0 => format!("<math>{t}</math>"),
                        _ => format!("<math>{}</math>", t.replacen("<mo>", "<mo form=\"infix\">", 1)),
                    })
                    .collect();
                let right = right.join("<wbr/>");
                format!(
                    "<tr><td><math>{left}</math></td><td><math><mo>=</mo></math></td><td>{right}</td></tr>\n"
                )
            };
            let body: String = rows.iter().map(row).collect();
            self.raw(&format!("<div class=\"formulas\"><table>\n{body}</table></div>\n"));
            return;
        }
        let width = rows.iter().map(|(l, _)| visible_width(l)).max().unwrap_or(0);
        for (left, right) in rows {
            let pad = " ".repeat(width - visible_width(left));
            self.line(&format!("  {left}{pad} = {right}"));
        }
    }

    fn prose(&self, text: &str) -> String {
        match self.style {
            Style::Latex => latex::escape(text),
            Style::MathMl => escape_html(text),
            _ => text.to_owned(),
        }
    }

    fn bracket(&self, a: &str, b: &str) -> String {
        match self.html() {
            true => format!("<mo stretchy=\"false\">[</mo>{a}<mo>,</mo>{b}<mo stretchy=\"false\">]</mo>"),
            false => format!("[{a}, {b}]"),
        }
    }

    fn rate(&self, of: &str) -> String {
        match self.html() {
            true => format!("<mfrac><mi>d</mi><mrow><mi>d</mi><mi>t</mi></mrow></mfrac>{of}"),
            false => format!("d/dt {of}"),
        }
    }

    fn list(&self, formulas: &[String]) -> String {
        formulas.join(if self.html() { "<mo>,</mo><mspace width=\"0.3em\"/>" } else { ", " })
    }

    fn sum(&self, terms: &[String]) -> String {
        let mut text = String::new();
        for term in terms {
            if text.is_empty() { text.push_str(term) } else { self.style.append_term(&mut text, term) }
        }
        text
    }

    fn name(&self, name: &str) -> String {
        identifier(name, self.style)
    }

    fn inline(&self, formula: &str) -> String {
        match self.style {
            Style::Latex => format!("${formula}$"),
            Style::MathMl => format!("<math>{formula}</math>"),
            _ => formula.to_owned(),
        }
    }

    fn xi(&self) -> String {
        self.name("xi")
    }

    /// What the velocities in the algebra are.
    fn velocity(&self, equations: &Equations) -> String {
        let xi = self.xi();
        match (equations.system.connection.is_some(), self.style) {
            (false, _) => xi,
            (true, Style::Latex) => format!("{xi} + A(x)\\,\\dot{{x}}"),
            (true, Style::MathMl) => format!(
                "{xi}<mo>+</mo><mi>A</mi><mo stretchy=\"false\">(</mo><mi>x</mi><mo stretchy=\"false\">)</mo>{}",
                self.name("dot_x")
            ),
            (true, _) => format!("{xi} + A(x) {}", self.name("dot_x")),
        }
    }

    fn header(&mut self, model: &Model, scene: &BuiltScene) {
        let title = model.doc.first().map_or(model.name.as_str(), String::as_str);
        let title = format!("{} ({}, scene {})", title, model.name, scene.name);
        if self.latex() {
            self.raw(&format!("\\section*{{{}}}\n\\allowdisplaybreaks\n", latex::escape(&title)));
        } else if self.html() {
            self.raw(&format!("<h2>{}</h2>\n", escape_html(&title)));
        } else {
            self.line(&format!("{title}\n{}", "═".repeat(title.chars().count())));
        }
        for line in model.doc.iter().skip(1).filter(|l| !l.trim().is_empty()) {
            let line = self.prose(line);
            self.line(&line);
        }
        for source in &model.sources {
            let source = self.prose(source);
            self.line(&format!("Source: {source}."));
        }
        for total in &model.totals {
            let file = self.prose(&total.file);
            let images: Vec<String> =
                total.images.iter().map(|image| format!("{} = {}", image.name, image.text)).collect();
            let images = match images.is_empty() {
                true => "with variables of the same names".to_owned(),
                false => format!("by {}", self.prose(&images.join("; "))),
            };
            self.line(&format!("Quotient of {file}, {images} (proved by check and generate)."));
        }
    }

    fn parameters(&mut self, model: &Model, scene: &BuiltScene) {
        let system = &scene.equations.system;
        self.begin(SectionKind::Inputs);
        if system.params.is_empty() {
            self.line("No free parameters.");
        }
        let mut rows = Vec::new();
        for p in &system.params {
            rows.push((
                self.name(&p.name),
                format!("{}{}", self.number(rational_to_f64(&p.default)), self.remark(&p.doc)),
            ));
        }
        self.formulas(&rows);
        let is_noise = |input: &&Param| system.noises.contains(&input.symbol);
        if system.inputs.len() > system.noises.len() {
            self.line("Inputs, held at these values unless they are driven:");
            let mut rows = Vec::new();
            for input in system.inputs.iter().filter(|input| !is_noise(input)) {
                let held = self.number(rational_to_f64(&input.default));
                rows.push((self.name(&input.name), format!("{held}{}", self.remark(&input.doc))));
            }
            self.formulas(&rows);
        }
        self.noises(model, scene);
        if !system.conditions.is_empty() {
            let list: Vec<String> = system.conditions.iter().map(|c| self.prose(&c.text)).collect();
            self.line(&format!("Valid for {}.", list.join(", ")));
        }
        // That of the equations without what the scene leaves out.
        let left_out = scene.left_out();
        let state = scene.equations.state.iter().filter(|s| !left_out.contains(&s.symbol));
        let names: Vec<String> = state.map(|s| self.name(&s.name)).collect();
        let list = self.inline(&self.list(&names));
        self.line(&format!("State: {list}."));
        self.units(model, scene);
    }

    fn number(&self, x: f64) -> String {
        if self.html() { format!("<mn>{x}</mn>") } else { x.to_string() }
    }

    fn remark(&self, doc: &str) -> String {
        match (doc.is_empty(), self.latex()) {
            (true, _) => String::new(),
            (false, _) if self.html() => {
                format!("<mspace width=\"1em\"/><mtext>{}</mtext>", escape_html(doc))
            }
            (false, true) => format!(" \\quad\\text{{{}}}", latex::escape(doc)),
            (false, false) => format!("   {doc}"),
        }
    }

    fn algebra(&mut self, model: &Model, equations: &Equations) {
        let algebra = &model.algebra;
        if algebra.dim() == 0 {
            return;
        }
        let side = match model.action {
            Side::Left => "left action, ξ = g⁻¹ ġ (body frame), μ̇ = ad*_ξ μ",
            Side::Right => "right action, ξ = ġ g⁻¹ (space frame), μ̇ = -ad*_ξ μ",
        };
        let side = match (self.latex(), model.action) {
            (true, Side::Left) => {
                "left action, $\\xi = g^{-1}\\dot g$ (body frame), $\\dot\\mu = \\mathrm{ad}^*_\\xi\\mu$"
            }
            (true, Side::Right) => {
                "right action, $\\xi = \\dot g g^{-1}$ (space frame), $\\dot\\mu = -\\mathrm{ad}^*_\\xi\\mu$"
            }
            _ => side,
        };
        self.begin(SectionKind::Algebra);
        let name = self.prose(algebra.name());
        self.line(&format!("{name}, dimension {}, {side}.", algebra.dim()));
        let velocities: Vec<String> = model.velocities.iter().map(|v| self.name(&v.name)).collect();
        let basis: Vec<String> = algebra.basis().iter().map(|b| self.name(b)).collect();
        let pairs = velocities.iter().zip(&basis);
        let velocity = self.velocity(equations);
        let sum = match self.style {
            Style::MathMl => {
                let pairs: Vec<String> =
                    pairs.map(|(v, b)| self.style.product(&[v.clone(), b.clone()])).collect();
                format!("{velocity}<mo>=</mo>{}", self.sum(&pairs))
            }
            _ => {
                let pairs: Vec<String> = pairs.map(|(v, b)| format!("{v} {b}")).collect();
                format!("{velocity} = {}", pairs.join(" + "))
            }
        };
        let sum = self.inline(&sum);
        self.line(&sum);
        let mut g = model.graph.clone();
        g.set_budget(Budget::UNLIMITED);
        let rows: Vec<(String, String)> = algebra
            .brackets()
            .map(|(a, b, value)| {
                let right = if self.html() || self.latex() {
                    let terms: Vec<String> = value
                        .iter()
                        .map(|(c, q)| {
                            let q = g.number(q);
                            self.term(&g, q, &basis[*c])
                        })
                        .collect();
                    self.sum(&terms)
                } else {
                    let mut dense = vec![Number::default(); algebra.dim()];
                    value.iter().for_each(|(c, q)| dense[*c] = q.clone());
                    spell_vector(&basis, &dense)
                };
                (self.bracket(&basis[a], &basis[b]), right)
            })
            .collect();
        if rows.is_empty() {
            self.line("Abelian: all brackets vanish.");
        }
        if algebra.is_almost() {
            self.line("Almost algebra: Jacobi is not claimed. Energy follows from antisymmetry; Casimirs of the bracket need not exist.");
        }
        self.formulas(&rows);
    }

    fn term(&self, g: &Graph, value: ExprId, element: &str) -> String {
        match g.as_rational(value) {
            Some(q) if q.is_one() => element.to_owned(),
            Some(q) if (-q).is_one() && self.html() => format!("<mo>−</mo>{element}"),
            Some(q) if (-q).is_one() => format!("-{element}"),
            Some(_) if self.html() => self.style.product(&[g.display(value, self.style), element.to_owned()]),
            // A name, or minus one.
            None if g.is_trivial(value) => {
                self.style.product(&[g.display(value, self.style), element.to_owned()])
            }
            None if self.html() => {
                let factor = format!("<mrow><mo>(</mo>{}<mo>)</mo></mrow>", g.display(value, self.style));
                self.style.product(&[factor, element.to_owned()])
            }
            Some(_) => format!("{} {element}", g.display(value, self.style)),
            None => format!("({}) {element}", g.display(value, self.style)),
        }
    }

    fn kinematics(&mut self, equations: &Equations) {
        let system = &equations.system;
        let g = &system.graph;
        let mut shown = g.clone();
        let mut rows = Vec::new();
        let carried: Vec<SymbolId> = system.higher.carried.iter().map(|c| c.symbol).collect();
        let own = system.own_rates_of_base();
        // What constraints of third order give rates of is moved by no velocity.
        for i in (0..system.algebroid.n_base()).filter(|i| !carried.contains(&system.algebroid.base()[*i])) {
            let mut terms = Vec::new();
            for (alpha, y) in system.velocities.iter().enumerate() {
                let y = shown.sym(*y);
                terms.push(shown.mul(system.algebroid.anchor(i, alpha), y));
            }
            terms.push(own[i]);
            let sum = shown.sum(&terms);
            let name = g.name(system.algebroid.base()[i]);
            rows.push((self.name(&format!("dot_{name}")), shown.display(sum, self.style)));
        }
        if !rows.is_empty() {
            self.begin(SectionKind::Kinematics);
            self.formulas(&rows);
        }
    }

    fn constraint(&mut self, equations: &Equations) {
        let system = &equations.system;
        match &system.constraint {
            // What a degenerate Lagrangian adds has a section of its own.
            KinematicConstraint::Solved(s) if s.reactions.names.is_empty() => {}
            KinematicConstraint::Solved(s) => {
                self.begin(SectionKind::Constraint);
                for rows in s.rows[..s.reactions.names.len()].chunk_by(|a, b| a.text == b.text) {
                    let names: Vec<String> = rows.iter().map(|row| row.name.clone()).collect();
                    self.row(&rows[0].text, &names, "");
                }
                self.kept(system, s.rows.iter().map(|row| row.name.as_str()).collect());
                if system.degeneracy.is_none() {
                    self.solved(s, system, "Solved with");
                }
            }
            KinematicConstraint::Multipliers { rows, .. } => {
                self.begin(SectionKind::Constraint);
                if let Some(own) = &system.feedback {
                    let [force, function] =
                        [&own.actuator, &own.function].map(|name| self.inline(&self.name(name)));
                    let lambda = self.inline(&self.name(&format!("lambda_{}", own.function)));
                    self.line(&format!("The force {force} = {lambda} gives {function} its rate: see below."));
                    return;
                }
                for rows in rows.chunk_by(|a, b| a.text == b.text && a.mode == b.mode) {
                    let names: Vec<String> = rows.iter().map(|row| row.name.clone()).collect();
                    let mode = rows[0].mode.map(|mode| self.inline(&self.name(system.graph.name(mode))));
                    let mode = mode.map_or_else(String::new, |mode| format!(", while {mode} is 1"));
                    self.row(&rows[0].text, &names, &mode);
                }
                self.kept(system, rows.iter().map(|row| row.name.as_str()).collect());
                let is_servo = |row: &AccelerationRow| matches!(row.source, AccelerationSource::Servo(_));
                for carried in &system.higher.carried {
                    let name = self.inline(&self.name(system.graph.name(carried.symbol)));
                    let doc = self.prose(&carried.doc.replace('`', ""));
                    self.line(&format!("{name} is {doc}: the constraint gives its rate."));
                }
                if rows.iter().any(is_servo) {
                    self.line("Constraints on accelerations leave all velocities in the state, and multipliers keep them.");
                } else if rows.iter().any(|row| row.mode.is_some()) {
                    self.line("All velocities stay in the state. The multiplier of a mode that is off vanishes: its row is");
                    self.line("multiplied by the mode and has one minus the mode on the multiplier.");
                } else if system.hamiltonian.is_some() {
                    self.line("Multipliers keep the constraint on the velocities dh/dp.");
                } else {
                    self.line("No choice of independent velocities is good on the whole domain: all velocities stay in the");
                    self.line("state and multipliers keep the constraint.");
                }
            }
        }
    }

    /// Equations that follow from the others.
    fn implied(&mut self, model: &Model) {
        for implied in &model.implied {
            let text = self.prose(&implied.text);
            self.line(&format!("{text}   (follows from the others, and is left out)"));
        }
    }

    /// A constraint with its multipliers, by components where there are several.
    fn row(&mut self, text: &str, multipliers: &[String], mode: &str) {
        let text = self.prose(text);
        let names: Vec<String> =
            multipliers.iter().map(|m| self.inline(&self.name(&format!("lambda_{m}")))).collect();
        let s = if names.len() > 1 { "s" } else { "" };
        self.line(&format!("{text}   (multiplier{s} {}{mode})", names.join(", ")));
    }

    /// Equations between positions that have none of the `rows`.
    fn kept(&mut self, system: &ReducedSystem, rows: Vec<&str>) {
        for position in &system.positions {
            if rows.iter().all(|row| position.name.strip_prefix("position_") != Some(row)) {
                let name = self.inline(&self.name(&position.name));
                self.line(&format!("By these {name} stays zero, without a constraint of its own."));
            }
        }
    }

    /// `y = Psi u + psi0` of the velocities that are not independent.
    fn solved(&mut self, solved: &SolvedConstraint, system: &ReducedSystem, with: &str) {
        let list: Vec<String> = solved.unknowns.iter().map(|u| self.name(&u.name)).collect();
        match list.is_empty() {
            true => self.line("They determine every velocity:"),
            false => {
                let list = self.inline(&self.list(&list));
                self.line(&format!("{with} independent velocities {list}:"));
            }
        }
        let mut g = system.graph.clone();
        g.set_budget(Budget::UNLIMITED);
        let row = |page: &Page, g: &mut Graph, k: usize| {
            let sum = solved.velocity(g, k);
            (page.name(&system.algebroid.frame()[k]), g.display(sum, page.style))
        };
        let rows: Vec<(String, String)> = solved.dependent.iter().map(|&k| row(self, &mut g, k)).collect();
        self.formulas(&rows);
    }

    /// The conditions that equations without accelerations are, in the order in which they were found.
    fn degeneracy(&mut self, equations: &Equations) {
        let system = &equations.system;
        let (Some(found), KinematicConstraint::Solved(solved)) = (&system.degeneracy, &system.constraint)
        else {
            return;
        };
        self.begin(SectionKind::Degeneracy);
        self.line("The mass matrix is singular everywhere. These combinations of the equations of motion, E_v along a");
        self.line("velocity v, have no accelerations:");
        let mut g = system.graph.clone();
        g.set_budget(Budget::UNLIMITED);
        for (k, step) in found.steps.iter().enumerate() {
            let terms: Vec<ExprId> = (step.combination.iter())
                .map(|(name, weight)| {
                    let symbol = g.symbol(&format!("E_{name}"));
                    let equation = g.sym(symbol);
                    g.mul(*weight, equation)
                })
                .collect();
            let sum = g.sum(&terms);
            let what = match step.combination.is_empty() {
                true => "its derivative".to_owned(),
                false => self.inline(&g.display(sum, self.style)),
            };
            let condition = g.display(step.condition, self.style);
            let condition = self.inline(&match self.html() {
                true => format!("{condition}<mo>=</mo><mn>0</mn>"),
                false => format!("{condition} = 0"),
            });
            let outcome = match &step.outcome {
                DegenerateOutcome::Solved(velocity) => {
                    format!("solved for {}", self.inline(&self.name(velocity)))
                }
                DegenerateOutcome::Differentiated => "which restricts positions: differentiated".into(),
            };
            self.line(&format!("{}. {what}: {condition}, {outcome}", k + 1));
        }
        self.solved(solved, system, "With");
    }

    fn equations(&mut self, equations: &Equations) {
        self.begin(SectionKind::Equations);
        let g = &equations.labelled();
        let ignorable: Vec<String> = equations.facts.taken_at_origin.iter().map(|n| self.name(n)).collect();
        if !ignorable.is_empty() {
            let zeros: Vec<String> = ignorable.iter().map(|n| format!("{n} = 0")).collect();
            let [list, zeros] = [ignorable, zeros].map(|list| self.inline(&self.list(&list)));
            self.line(&format!(
                "No rate depends on {list}: the state equations and what they need are taken at {zeros}."
            ));
        }
        // Of definitions that are equal under one name, the one that the state equations need is shown.
        let mut shown = used_by_state_equations(equations);
        let mut names: BTreeSet<&str> = shown.iter().map(|symbol| g.name(*symbol)).collect();
        let of_motion = equations.of_motion();
        let definitions = equations.sections.iter().flat_map(|section| &section.definitions);
        for definition in definitions.filter(|definition| of_motion.contains(&definition.symbol)) {
            if names.insert(g.name(definition.symbol)) {
                shown.insert(definition.symbol);
            }
        }
        if let Some((symbol, place)) = equations.taken_at.iter().find(|(symbol, _)| shown.contains(symbol)) {
            let original = equations.system.graph.name(*symbol);
            let [value, original] = [g.name(*symbol), original].map(|name| self.inline(&self.name(name)));
            let place = self.prose(&place.replace('=', " = ").replace(',', ", "));
            self.line(&format!("{value} is the value of {original} at {place}, and so with the like."));
        }
        for section in &equations.sections {
            let definitions = section.definitions.iter().filter(|d| shown.contains(&d.symbol));
            let rows: Vec<(String, String)> =
                definitions.map(|d| (self.name(g.name(d.symbol)), g.display(d.expr, self.style))).collect();
            if !rows.is_empty() {
                let title = self.prose(&section.title);
                self.line(&title);
                self.formulas(&rows);
            }
        }
        self.line("state equations");
        let rows: Vec<(String, String)> = equations
            .state
            .iter()
            .map(|s| (self.rate(&self.name(&s.name)), g.display(s.derivative, self.style)))
            .collect();
        self.formulas(&rows);
        if !equations.has_energy() || !equations.is_whole() {
            return;
        }
        let is_hamiltonian = equations.system.hamiltonian.is_some();
        self.line(if is_hamiltonian { "energy E = h" } else { "energy E = p.y - L" });
        let energy = self.name("E");
        let mut rows = vec![(energy.clone(), g.display(equations.energy, self.style))];
        rows.push((self.rate(&energy), g.display(equations.energy_rate, self.style)));
        self.formulas(&rows);
    }

    fn routhian(&mut self, equations: &Equations) {
        let Some(routhian) = Routhian::new(equations) else { return };
        let g = &routhian.graph;
        self.begin(SectionKind::Routhian);
        self.line("Mechanical connection A = K^-1 L_vx and velocities w = K^-1 (Pi - b) = v + A xdot, with K = L_vv:");
        let rows = routhian.names.iter().map(|(name, e)| (self.name(name), g.display(*e, self.style)));
        let rows: Vec<(String, String)> = rows.collect();
        self.readable_formulas(rows);
        self.line("Routhian R = L - Pi.w, effective potential V = -R at xdot = 0:");
        let shown = |page: &Page, name: &str, e| (page.name(name), g.display(e, page.style));
        let rows = [shown(self, "R", routhian.routhian), shown(self, "V", routhian.potential)];
        self.formulas(&rows);
        self.line(
            "d/dt dR/dxdot - dR/dx is the force Pi_a B^a_ij xdot^j - <Pi, [w, A_i]> of the curvature B = dA - [A, A]:",
        );
        let rows = routhian.forces.iter().map(|(x, e)| shown(self, &format!("force_{x}"), *e));
        let rows: Vec<(String, String)> = rows.collect();
        self.readable_formulas(rows);
    }

    /// Formulas without those that nobody would read, which are counted.
    fn readable_formulas(&mut self, rows: Vec<(String, String)>) {
        let n = rows.len();
        let (short, _): (Vec<_>, Vec<_>) = rows.into_iter().partition(|(_, e)| e.len() <= MAX_FORMULA);
        self.formulas(&short);
        if short.len() < n {
            self.line(&format!("{} of more than {MAX_FORMULA} characters are left out.", n - short.len()));
        }
    }

    fn findings(&mut self, equations: &Equations) {
        let facts = &equations.facts;
        self.begin(SectionKind::Findings);
        let energy = if !equations.has_energy() {
            "The motion is given: it follows from no Lagrangian, and has no energy."
        } else if !equations.is_whole() {
            "The energy is not derived: it takes more than the budget."
        } else if facts.energy_is_conserved {
            "Energy is conserved: its rate vanishes identically."
        } else if facts.energy_is_conserved_on_constraint {
            "Energy is conserved on the constraint: its rate is the multipliers times the constraint residual."
        } else if facts.energy_is_unverified {
            "Whether energy is conserved could not be verified: its rate could not be shown to vanish, nor not to."
        } else {
            "Energy is not conserved."
        };
        self.line(energy);
        if !facts.constants.is_empty() {
            let list: Vec<String> = facts.constants.iter().map(|n| self.name(n)).collect();
            let list = self.inline(&self.list(&list));
            self.line(&format!("Constant along every motion: {list}."));
        }
        if !facts.casimirs.is_empty() {
            let list = self.prose(&facts.casimirs.join(", "));
            self.line(&format!("Conserved quantities of the model, verified: {list}."));
        }
        if !facts.casimirs_on_constraint.is_empty() {
            let list = self.prose(&facts.casimirs_on_constraint.join(", "));
            self.line(&format!("Conserved where the constraint holds, verified: {list}."));
        }
        for production in &facts.entropies {
            let names: Vec<String> = production.names.iter().map(|n| self.name(n)).collect();
            let sum = self.inline(&names.join(" + "));
            self.line(&match production.is_produced {
                true => format!("Entropy {sum} never decreases: its rate is not negative, proved."),
                false => format!("Entropy {sum}: its rate is not seen to have a sign."),
            });
        }
        match facts.holonomic {
            Some(true) => {
                self.line("The constraint is holonomic: brackets of allowed velocities stay in it.")
            }
            Some(false) => {
                self.line("The constraint is nonholonomic: brackets of allowed velocities leave it.")
            }
            None => {}
        }
        let is_empty = matches!(&equations.form, Form::Accelerations(linear) if linear.unknowns.is_empty());
        let is_derived = equations.system.hamiltonian.is_none() && equations.has_energy();
        if is_derived && !(is_empty && equations.system.degeneracy.is_some()) {
            let symmetric = if facts.mass_matrix_is_symmetric { "symmetric" } else { "not symmetric" };
            let constant = if facts.mass_matrix_is_constant {
                "depends on parameters alone and is factored once"
            } else {
                "depends on the state"
            };
            self.line(&format!("Mass matrix: {symmetric}, {constant}."));
        }
        if !equations.pivots.is_empty() {
            let g = equations.labelled();
            self.line("Has to stay different from zero (checked at run time, with these names):");
            let rows: Vec<(String, String)> = equations
                .pivots
                .iter()
                .map(|p| (self.prose_in_formula(&p.name), g.display(p.expr, self.style)))
                .collect();
            self.formulas(&rows);
        }
    }

    fn prose_in_formula(&self, text: &str) -> String {
        match self.style {
            Style::Latex => format!("\\text{{{}}}", latex::escape(text)),
            Style::MathMl => format!("<mtext>{}</mtext>", escape_html(text)),
            _ => text.to_owned(),
        }
    }

    fn certificate(&mut self, scene: &BuiltScene) {
        let certificate = scene.certificate();
        let sentence = self.prose(&certificate.sentence());
        self.line(&sentence);
        for (function, reason) in certificate.open.iter().filter(|_| certificate.n_points > 0) {
            let reason = self.prose(&format!("Not held to its definition: {function}, {reason}."));
            self.line(&reason);
        }
    }

    fn counts(&mut self, scene: &BuiltScene) {
        self.begin(SectionKind::Counts);
        let table = scene.operation_table();
        if self.latex() {
            self.raw(&format!("\\begin{{verbatim}}\n{table}\\end{{verbatim}}\n"));
        } else if self.html() {
            self.raw(&format!("<pre>{}</pre>\n", escape_html(&table)));
        } else {
            self.raw(&table);
        }
    }
}

/// Characters that take a column: combining dots do not.
fn visible_width(text: &str) -> usize {
    text.chars().filter(|c| !matches!(c, '\u{307}' | '\u{308}')).count()
}

/// A sum in MathML cut in front of its outermost signs, so that a browser can break the line there.
fn terms(formula: &str) -> Vec<&str> {
    let mut cuts = vec![0];
    let mut depth = 0_usize;
    for (at, _) in formula.match_indices('<') {
        let tag = &formula[at..];
        if tag.starts_with("</") {
            depth = depth.saturating_sub(1);
            continue;
        }
        if depth == 0 && at > 0 && (tag.starts_with("<mo>+</mo>") || tag.starts_with("<mo>−</mo>")) {
            cuts.push(at);
        }
        if !tag.split('>').next().is_some_and(|tag| tag.ends_with('/')) {
            depth += 1;
        }
    }
    cuts.push(formula.len());
    cuts.windows(2).map(|w| &formula[w[0]..w[1]]).collect()
}

/// Text as the content of an element.
fn escape_html(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

/// Definitions that the derivative of the state, the energy and the pivots need, one through another.
fn used_by_state_equations(equations: &Equations) -> BTreeSet<SymbolId> {
    let rates = equations.state.iter().map(|s| s.derivative);
    let pivots = equations.pivots.iter().map(|p| p.expr);
    equations.needed(rates.chain(pivots).chain([equations.energy, equations.energy_rate]))
}
