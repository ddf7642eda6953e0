//! Every file of `tests/bad` is wrong in one class of ways, or questionable; the rendered report stands beside it.
//!
//! A file goes through the whole pipeline, because some problems show only when equations are derived. Write the
//! reports anew with `UPDATE_EXPECT=1 cargo test -p hamel-codegen --test main bad` and read the diff as a user would.

use std::path::Path;

use hamel_codegen::scene::{self, Scenes};
use hamel_codegen::spec::{self, Diagnostics};

/// The report about a file, rendered without colour.
fn report(file: &str, text: &str) -> Option<String> {
    let fluid = spec::matrix_fluid(file, text);
    let outcome = fluid.and_then(|_| spec::parse(file, text)).and_then(|model| {
        let mut scenes = Scenes::new(&model);
        let names = scenes.names();
        let scenes = scenes.build_all(&names)?;
        let warnings = scene::warnings(&model, &scenes);
        Ok(Diagnostics::new(model.origin, model.warnings.iter().chain(&warnings).cloned().collect()))
    });
    let problems = outcome.unwrap_or_else(|problems| problems);
    (!problems.is_empty()).then(|| problems.to_string())
}

#[test]
fn every_report_is_the_one_beside_the_file() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/bad");
    let mut files: Vec<_> = std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    let models: Vec<_> = files.iter().filter(|f| f.extension().is_some_and(|e| e == "hamel")).collect();
    assert!(models.len() >= 60, "only {} files in {}", models.len(), folder.display());
    let mut accepted = Vec::new();
    for model in models {
        let name = model.file_name().unwrap().to_str().unwrap();
        let text = std::fs::read_to_string(model).unwrap();
        match report(name, &text) {
            Some(report) => expect_test::expect_file![model.with_extension("expected")].assert_eq(&report),
            None => accepted.push(name),
        }
    }
    assert!(accepted.is_empty(), "nothing is wrong with {accepted:?}");
    for expected in files.iter().filter(|f| f.extension().is_some_and(|e| e == "expected")) {
        assert!(expected.with_extension("hamel").exists(), "{} belongs to no model", expected.display());
    }
}
