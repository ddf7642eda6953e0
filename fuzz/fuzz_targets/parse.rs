//! Reads and checks a text; problems render inside the text.

#![no_main]

use hamel_codegen::spec;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    let Err(problems) = spec::parse("fuzz.hamel", text) else { return };
    assert!(!problems.is_empty(), "failed without a problem");
    for problem in &problems {
        if let Some(span) = problem.span {
            assert!(span.start <= text.len() && span.end <= text.len() + 1, "{problem:?}");
        }
    }
    assert!(problems.render(true).len() >= problems.render(false).len());
});
