//! What lexing leaves behind in a thread: nothing.

use hamel_codegen::spec::{self, Outline};
use hamel_program::emit::{SceneEntry, emit_index, method_text};
use hamel_program::program::Role;

/// Bytes of all texts that `proc_macro2` has kept in this thread: where the next one begins.
fn kept() -> usize {
    let tokens: proc_macro2::TokenStream = "x".parse().unwrap();
    let span = tokens.into_iter().next().unwrap().span();
    // Outside of macros a span is shown as `bytes(3..4)`, counted through all texts.
    let shown = format!("{span:?}");
    let start = shown.trim_start_matches("bytes(").split("..").next().unwrap();
    start.parse().unwrap_or_else(|_| panic!("{shown}"))
}

/// An editor has its text parsed after every key, and a notebook in every turn of a loop.
#[test]
fn texts_that_were_parsed_are_not_kept() {
    let comments = "// a line of a comment\n".repeat(40);
    let text = format!("{comments}model m {{ coordinate x in real; lagrangian = 1/2*x_dot^2 - 2*x^2; }}");
    let broken = format!("{comments}model m {{ param ? = ; param ! = 1");
    let own: proc_macro2::TokenStream = "mine".parse().unwrap();
    let before = kept();
    for k in 0..10_000 {
        match k % 4 {
            0 => drop(spec::parse("m.hamel", &text).unwrap()),
            1 => drop(spec::parse("m.hamel", &broken).unwrap_err()),
            2 => drop(Outline::new(&broken)),
            _ => drop(spec::format("m.hamel", &text).unwrap()),
        }
    }
    let module = "impl A { pub fn rhs(&self) {} }";
    assert!(method_text(module, &Role::Rate).is_some());
    let entry = SceneEntry {
        module: "m".into(),
        model: "m".into(),
        scene: "default".into(),
        n_state: 2,
        doc: String::new(),
    };
    assert!(emit_index(&[entry], "x").is_ok());
    // The probe itself is kept, with a byte after it.
    assert!(kept() - before <= 4, "{before} {}", kept());
    // Spans of whoever uses the crate stay what they are.
    assert_eq!(own.into_iter().next().unwrap().span().source_text().as_deref(), Some("mine"));
}
