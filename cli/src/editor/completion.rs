//! What may be written at a place.
//!
//! Does not know: messages of the protocol but the form of a proposal.

use std::collections::BTreeSet;

use hamel_codegen::spec::{Context, DeclarationKind, Domain, Model, Want, WordKind, vocabulary};
use lsp_types::{CompletionItem, CompletionItemKind, Documentation, MarkupContent, MarkupKind};

use super::document::Document;

/// Most proposals.
const MAX_PROPOSALS: usize = 1000;

/// Proposals in their order, each label once.
#[derive(Default)]
struct Proposals {
    list: Vec<CompletionItem>,
    labels: BTreeSet<String>,
}

impl Proposals {
    fn add(&mut self, label: &str, kind: CompletionItemKind, detail: &str, text: &str) {
        if self.list.len() >= MAX_PROPOSALS || !self.labels.insert(label.to_owned()) {
            return;
        }
        let value = text.to_owned();
        self.list.push(CompletionItem {
            label: label.to_owned(),
            kind: Some(kind),
            detail: (!detail.is_empty()).then(|| detail.to_owned()),
            documentation: (!text.is_empty())
                .then_some(Documentation::MarkupContent(MarkupContent { kind: MarkupKind::Markdown, value })),
            // Editors would sort by the alphabet.
            sort_text: Some(format!("{:04}", self.list.len())),
            ..CompletionItem::default()
        });
    }

    fn words(&mut self, words: &[&str]) {
        words.iter().for_each(|word| self.add(word, CompletionItemKind::KEYWORD, "", ""));
    }

    /// Words of the language of a kind.
    fn language(&mut self, kind: WordKind, keep: impl Fn(&str) -> bool) {
        let shown = match kind {
            WordKind::Function => CompletionItemKind::FUNCTION,
            WordKind::Constant => CompletionItemKind::CONSTANT,
            WordKind::Item | WordKind::Part | WordKind::Setting => CompletionItemKind::KEYWORD,
        };
        for word in vocabulary().iter().filter(|word| word.kind == kind && keep(word.word)) {
            self.add(word.word, shown, word.form.split("` or `").next().unwrap_or_default(), word.sentence);
        }
    }

    /// Names that the text declares.
    fn declared(&mut self, document: &Document, keep: impl Fn(DeclarationKind) -> bool) {
        for d in document.outline.declarations.iter().filter(|d| keep(d.kind)) {
            self.add(&d.name, shown(d.kind), d.kind.title(), &d.doc);
        }
    }

    fn velocities(&mut self, document: &Document, model: Option<&Model>) {
        use DeclarationKind::{Coordinate, QuasiVelocity, Velocity};
        self.declared(document, |kind| matches!(kind, Velocity | QuasiVelocity));
        for d in document.outline.declarations.iter().filter(|d| d.kind == Coordinate) {
            let detail = format!("rate of `{}`", d.name);
            self.add(&format!("{}_dot", d.name), CompletionItemKind::VARIABLE, &detail, &d.doc);
        }
        for velocity in model.iter().flat_map(|model| model.velocities.iter().chain(&model.quasi_velocities))
        {
            self.add(&velocity.name, CompletionItemKind::VARIABLE, "velocity", &velocity.doc);
        }
    }

    fn coordinates(&mut self, document: &Document, model: Option<&Model>, keep: impl Fn(&Domain) -> bool) {
        match model {
            // Which of them are angles is known of a model alone.
            Some(model) => {
                for c in model.base.iter().filter(|c| keep(&c.domain)) {
                    self.add(&c.name, CompletionItemKind::VARIABLE, "coordinate", &c.doc);
                }
            }
            None => self.declared(document, |kind| kind == DeclarationKind::Coordinate),
        }
    }

    fn parameters(&mut self, document: &Document, model: Option<&Model>) {
        self.declared(document, |kind| kind == DeclarationKind::Parameter);
        for param in model.iter().flat_map(|model| &model.params) {
            self.add(&param.name, CompletionItemKind::CONSTANT, "parameter", &param.doc);
        }
    }

    fn inputs(&mut self, document: &Document, model: Option<&Model>) {
        self.declared(document, |kind| kind == DeclarationKind::Input);
        for input in model.iter().flat_map(|model| &model.inputs) {
            self.add(&input.name, CompletionItemKind::VARIABLE, "input", &input.doc);
        }
    }

    fn values(&mut self, document: &Document, model: Option<&Model>) {
        self.declared(document, DeclarationKind::is_value);
        self.velocities(document, model);
        self.parameters(document, model);
        self.inputs(document, model);
        if let Some(model) = model {
            self.coordinates(document, Some(model), |_| true);
            for (name, _) in model.first_order.iter().flat_map(|state| &state.components) {
                self.add(name, CompletionItemKind::VARIABLE, "state of first order", "");
            }
            for (name, _) in model.advected.iter().flat_map(|a| &a.components) {
                self.add(name, CompletionItemKind::VARIABLE, "advected parameter", "");
            }
        }
        self.language(WordKind::Function, |_| true);
        self.language(WordKind::Constant, |_| true);
        // Some functions take an algebra before their other arguments.
        self.declared(document, |kind| kind == DeclarationKind::Algebra);
    }
}

fn shown(kind: DeclarationKind) -> CompletionItemKind {
    match kind {
        DeclarationKind::Parameter => CompletionItemKind::CONSTANT,
        DeclarationKind::Algebra | DeclarationKind::Representation => CompletionItemKind::CLASS,
        DeclarationKind::Scene | DeclarationKind::Model | DeclarationKind::Stage => {
            CompletionItemKind::MODULE
        }
        DeclarationKind::Event => CompletionItemKind::EVENT,
        DeclarationKind::Casimir | DeclarationKind::Output | DeclarationKind::Section => {
            CompletionItemKind::PROPERTY
        }
        _ => CompletionItemKind::VARIABLE,
    }
}

/// Algebras of the language, spaces among them, without representations and groups.
const ALGEBRAS: [&str; 18] = [
    "R",
    "so",
    "se",
    "su",
    "u",
    "gl",
    "sl",
    "sp",
    "sim",
    "galilei",
    "heisenberg",
    "zeitlin",
    "zeitlin_sphere",
    "torus",
    "witt",
    "product",
    "semidirect",
    "vorticity",
];

/// What may be written at a byte of a text.
pub(crate) fn proposals(document: &Document, offset: usize, model: Option<&Model>) -> Vec<CompletionItem> {
    use DeclarationKind as Kind;
    let mut found = Proposals::default();
    match Context::at(&document.text, offset) {
        Context::File => found.language(WordKind::Part, |word| word == "model"),
        Context::Item => found.language(WordKind::Item, |_| true),
        Context::SceneStatement => {
            let words = ["fix", "want", "drop", "circle", "formulation", "discrete", "retraction"];
            found.language(WordKind::Part, |word| words.contains(&word));
            found.language(WordKind::Item, |word| matches!(word, "carry" | "routh" | "input" | "for"));
        }
        Context::EventStatement => found
            .language(WordKind::Part, |word| matches!(word, "then" | "enter" | "leave" | "impact" | "stop")),
        Context::Mode => found.declared(document, |kind| kind == Kind::Mode),
        Context::BlockStatement => {
            found.language(WordKind::Part, |word| {
                matches!(word, "basis" | "velocities" | "anchor" | "mass" | "place" | "inertia" | "attitude")
            });
            found.language(WordKind::Item, |word| word == "connection");
        }
        Context::WantOfAll => found.add(Want::Digits.name(), CompletionItemKind::KEYWORD, "", ""),
        Context::Want => {
            let of_scenes = [Kind::Casimir, Kind::Output, Kind::Section, Kind::Actuator, Kind::Lyapunov];
            found.declared(document, |kind| of_scenes.contains(&kind));
            Want::ALL.iter().for_each(|want| found.add(want.name(), CompletionItemKind::KEYWORD, "", ""));
        }
        Context::FixedParameter => {
            found.parameters(document, model);
            found.inputs(document, model);
        }
        Context::Input => found.inputs(document, model),
        Context::Dropped => {
            found.coordinates(document, model, |_| true);
            found.declared(document, |kind| kind == Kind::Advected);
        }
        Context::Angle => found.coordinates(document, model, |domain| *domain == Domain::Angle),
        Context::Velocity => found.velocities(document, model),
        Context::Connection => {
            found.words(&["mechanical", "nonholonomic", "trivial"]);
            found.velocities(document, model);
        }
        Context::Carried => {
            found.declared(document, |kind| kind == Kind::Momentum);
            found.velocities(document, model);
            found.declared(document, |kind| matches!(kind, Kind::Coordinate | Kind::Parameter));
        }
        Context::StateVariable => {
            found.velocities(document, model);
            found.declared(document, |kind| kind.is_of_state() || kind == Kind::Reconstructed);
        }
        Context::Algebra => {
            found.declared(document, |kind| matches!(kind, Kind::Algebra | Kind::Representation));
            found.words(&ALGEBRAS);
            found.words(&[
                "standard",
                "adjoint",
                "coadjoint",
                "functions",
                "densities",
                "dual",
                "trivial",
                "as",
            ]);
        }
        Context::Group => {
            found.words(&["SO", "SE", "SU", "U", "GL", "SL", "Sp", "R", "matrices", "semidirect", "from"]);
        }
        Context::Action => {
            found.values(document, model);
            found.declared(document, |kind| kind == Kind::Representation);
        }
        Context::Domain => found.words(&["angle", "real"]),
        Context::Shape => found.words(&["scalar", "vector", "diagonal", "symmetric", "matrix"]),
        Context::Side => found.words(&["left", "right"]),
        Context::Solid => found.words(&["box", "disk", "ball", "segment", "point", "path"]),
        Context::Formulation => found.words(&["auto"]),
        Context::Quadrature => found.words(&["midpoint"]),
        Context::Retraction => found.words(&["cayley", "exp"]),
        Context::Expression => {
            found.values(document, model);
            let words = ["where", "when", "rising", "falling", "with", "around", "at", "attitude"];
            found.language(WordKind::Part, |word| words.contains(&word));
        }
        _ => {}
    }
    found.list
}
