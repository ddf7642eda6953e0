//! Texts that are no models yet: nothing fails on them, and what they already say is understood.

use std::path::Path;
use std::sync::Arc;

use hamel_codegen::spec::{Context, DeclarationKind};
use lsp_types::Uri;

use super::document::{Checked, Document, check};
use super::hover::{self, Wish};
use super::{completion, navigation, structure};

const TOP: &str = "/// Top
model top {
    /// Moments of inertia [kg m^2].
    param I: diagonal(3) = [1, 2, 3] where I1 > 0;
    /// Angle [rad].
    coordinate theta in angle;
    /// Angular velocity [rad/s].
    velocity Omega in so(3);
    /// The vertical.
    advected Gamma in R^3 by cross(Omega, Gamma);
    let spin = Omega3;
    lagrangian = dot(Omega, I*Omega)/2 + theta_dot^2/2 - Gamma3*cos(theta) + spin - spin;
    /// Its square.
    casimir C = dot(Gamma, Gamma);
    scene s { fix I1 = 2; want rhs, C; }
}
";

fn uri() -> Uri {
    "file:///top.hamel".parse().unwrap()
}

fn checked(text: &str) -> (Document, Checked) {
    (Document::new(text.to_owned(), 1), check("top.hamel", text.into()))
}

/// Everything that can be asked about a place.
fn ask_everything(document: &Document, offset: usize, checked: Option<&Checked>) {
    let model = checked.and_then(|checked| checked.model.as_deref());
    let uri = uri();
    let _ = hover::answer(document, offset, model);
    let _ = completion::proposals(document, offset, model);
    let _ = navigation::definition(document, &uri, offset);
    let _ = navigation::references(document, &uri, offset, true);
    let _ = navigation::renamed(document, offset);
    let _ = navigation::symbols(document);
    let _ = navigation::tokens(document);
    let _ = structure::signature(document, offset);
    let _ = structure::folds(document);
    let _ = structure::lenses(document, &uri);
}

/// The models of the repository.
fn texts() -> Vec<String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("specs");
    let mut paths: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    let texts: Vec<String> = paths.iter().map(|path| std::fs::read_to_string(path).unwrap()).collect();
    assert!(texts.len() > 30);
    texts
}

#[test]
fn no_beginning_of_a_model_is_too_much() {
    let (_, known) = checked(TOP);
    // Of the small model every beginning, of the others one in so many; the strides have no common factors.
    for (k, text) in std::iter::once(TOP.to_owned()).chain(texts()).enumerate() {
        let stride = if k == 0 { 1 } else { 97 + 2 * k };
        for end in (0..=text.len()).filter(|end| text.is_char_boundary(*end)).step_by(stride) {
            let document = Document::new(text[..end].to_owned(), 1);
            ask_everything(&document, end, Some(&known));
        }
    }
}

#[test]
fn no_edit_of_a_model_is_too_much() {
    let pieces = ["{", "}", "(", "]", "\"", "/*", "//", ";", "Ω🌀", "param", "in", "_dot", "=", "\u{feff}"];
    // A linear congruential generator: the edits are the same everywhere.
    let mut state = 1_u64;
    let mut below = |n: usize| {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        usize::try_from(state >> 33).unwrap() % n.max(1)
    };
    for _ in 0..400 {
        let mut text = TOP.to_owned();
        for _ in 0..1 + below(4) {
            let at = below(text.len() + 1);
            let at = (0..=at).rev().find(|at| text.is_char_boundary(*at)).unwrap();
            let to = (at + below(6)).min(text.len());
            let to = (to..=text.len()).find(|to| text.is_char_boundary(*to)).unwrap();
            text.replace_range(at..to, pieces[below(pieces.len())]);
        }
        let document = Document::new(text, 1);
        let offset = below(document.text.len() + 2);
        ask_everything(&document, offset, None);
        let _ = navigation::rename(&document, &uri(), offset, "other");
    }
}

#[test]
fn every_word_of_the_shipped_models_is_known() {
    for text in texts() {
        let document = Document::new(text, 1);
        let outline = &document.outline;
        let mut known: Vec<_> = outline.mentions.iter().map(|m| m.word).collect();
        known.extend(outline.words.iter().map(|(span, _)| *span));
        // Comments and texts in quotes have other words.
        let code: String =
            document.text.lines().map(|line| line.split("//").next().unwrap()).collect::<Vec<_>>().join("\n");
        let code: Vec<&str> = code.split('"').step_by(2).collect();
        let n_words: usize = code
            .iter()
            .flat_map(|part| part.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_')))
            .filter(|word| word.starts_with(|c: char| c.is_ascii_alphabetic()))
            .count();
        // What scenes want and what components are called by elements of a basis are words of neither kind.
        assert!(known.len() * 10 >= n_words * 7, "{} of {n_words} in {}", known.len(), &document.text[..60]);
    }
}

#[test]
fn components_and_rates_stand_for_their_declaration() {
    let (document, known) = checked(TOP);
    let at = |word: &str| TOP.find(word).unwrap();
    let named =
        |offset: usize| document.outline.mention_at(offset).map(|(m, d)| (m.name, d.name.as_str(), d.kind));
    let (name, declared, kind) = named(at("I1 > 0")).unwrap();
    assert_eq!((declared, kind, name.end - name.start), ("I", DeclarationKind::Parameter, 1));
    let (name, declared, _) = named(at("theta_dot")).unwrap();
    assert_eq!((declared, name.end - name.start), ("theta", 5));
    assert_eq!(named(at("C; }")).unwrap().2, DeclarationKind::Casimir);
    assert!(named(at("so(3)")).is_none());
    let model = known.model.as_deref();
    let rate = hover::answer(&document, at("theta_dot"), model).unwrap();
    assert!(rate.text.contains("rate of the coordinate `theta_dot` [rad/s]"), "{}", rate.text);
    assert_eq!(rate.wish, Wish::Rates(vec!["theta_dot".to_owned()]));
    let velocity = hover::answer(&document, at("Omega in"), model).unwrap();
    for part in
        ["velocity Omega in so(3)", "[rad/s]", "Omega1, Omega2, Omega3", "[e₁, e₂] = e₃", "body frame"]
    {
        assert!(velocity.text.contains(part), "{part}: {}", velocity.text);
    }
    assert_eq!(velocity.wish, Wish::Rates(["Omega1", "Omega2", "Omega3"].map(str::to_owned).to_vec()));
}

/// A model that is not the quotient of the file beside it, at its place in the text.
#[test]
fn a_false_quotient_is_marked() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/book");
    let name = "body_by_displacements.hamel";
    let text = std::fs::read_to_string(root.join(name)).unwrap();
    let uri = format!("file://{}", root.canonicalize().unwrap().join(name).display());
    assert!(super::document::check(&uri, text.clone().into()).found.is_empty());
    let found = super::document::check(&uri, text.replace("transpose(R)*v", "R*v").into()).found;
    let problem = found.iter().next().unwrap();
    assert!(problem.message.contains("of the bracket ["), "{}", problem.message);
    assert_eq!(problem.span.unwrap().start, text.find("\"body_by_translations").unwrap());
}

#[test]
fn a_rename_takes_components_and_rates_along_and_keeps_a_model() {
    let (document, _) = checked(TOP);
    let offset = TOP.find("theta in").unwrap();
    let apply = |edit: lsp_types::WorkspaceEdit| {
        let mut text = TOP.to_owned();
        let mut edits = edit.changes.unwrap().into_values().next().unwrap();
        edits.reverse();
        let lines = document.lines();
        for edit in edits {
            text.replace_range(lines.offset(edit.range.start)..lines.offset(edit.range.end), &edit.new_text);
        }
        text
    };
    let renamed = apply(navigation::rename(&document, &uri(), offset, "phi").unwrap());
    assert_eq!(renamed, TOP.replace("theta", "phi"));
    let offset = TOP.find("Omega in").unwrap();
    let renamed = apply(navigation::rename(&document, &uri(), offset, "w").unwrap());
    assert_eq!(renamed, TOP.replace("Omega", "w"));
    for (name, reason) in [("pi", "cannot be used"), ("Gamma", "would be wrong"), ("a b", "ASCII letters")] {
        let refusal = navigation::rename(&document, &uri(), offset, name).unwrap_err();
        assert!(refusal.contains(reason), "{refusal}");
    }
}

#[test]
fn proposals_are_those_of_the_place() {
    let (_, known) = checked(TOP);
    let labels = |text: &str| {
        let document = Document::new(text.to_owned(), 1);
        let found = completion::proposals(&document, text.len(), known.model.as_deref());
        found.into_iter().map(|item| item.label).collect::<Vec<_>>()
    };
    let until = |mark: &str| TOP[..TOP.find(mark).unwrap()].to_owned();
    let has = |found: &[String], label: &str| found.iter().any(|l| l == label);
    let items = labels(&until("velocity Omega"));
    assert!(has(&items, "velocity") && has(&items, "scene") && !has(&items, "theta"));
    let values = labels(&until("Gamma3*"));
    for label in ["Omega", "Omega2", "theta_dot", "I3", "spin", "dot", "Gamma1"] {
        assert!(has(&values, label), "{label} in {values:?}");
    }
    assert!(!has(&values, "lagrangian") && !has(&values, "C"));
    let wanted = labels(&until("rhs"));
    assert_eq!(wanted[..2], ["C", "rhs"]);
    assert_eq!(labels(&until("angle;")), ["angle", "real"]);
    assert!(has(&labels(&until("so(3)")), "so"));
    assert!(labels("// com").is_empty());
    assert_eq!(Context::at(TOP, TOP.find("1 = 2").unwrap()), Context::FixedParameter);
}

#[test]
fn equations_follow_the_words_about_a_name() {
    let (document, known) = checked(TOP);
    let model = known.model.as_deref().unwrap();
    let equations = Arc::new(super::document::derive(model).unwrap());
    let answer = hover::answer(&document, TOP.find("Omega in").unwrap(), Some(model)).unwrap();
    let text = hover::with_equations(&answer, &equations);
    assert!(text.contains("d/dt Ω₁ = ") && text.contains("d/dt Ω₃ = "), "{text}");
    let answer = hover::answer(&document, TOP.find("lagrangian").unwrap(), Some(model)).unwrap();
    let text = hover::with_equations(&answer, &equations);
    assert!(
        text.contains("The reduced Lagrangian") && text.contains("8 equations of motion, for "),
        "{text}"
    );
}
