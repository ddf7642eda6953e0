//! Single passes over programs, as files: a program, the passes that run, and the program that they make.
//!
//! `UPDATE_EXPECT=1 cargo test -p hamel-program --test passes` writes the files anew. Every file is also run on
//! numbers, before and after, so that no pass that changes a value is blessed.

use std::path::{Path, PathBuf};

use hamel_program::lower::run_pass;
use hamel_program::program::{Point, Program, verify_rules};
use hamel_runtime::DoubleDouble;

/// What stands between the program and what becomes of it.
const BETWEEN: &str = "----\n";

fn files() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/passes");
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files
}

/// All results of all functions at a point without any pattern.
fn values(program: &Program) -> Vec<DoubleDouble> {
    let some = |n: usize, start: f64| -> Vec<DoubleDouble> {
        (0..n).map(|k| DoubleDouble::from(start + 0.37 * k as f64)).collect()
    };
    let params = some(program.params.len(), 1.3);
    let prepared = program.prepare(&params).unwrap();
    let state = some(program.state.len(), 0.4);
    let point = Point { t: DoubleDouble::from(0.7), state: &state, argument: &[] };
    let mut all = Vec::new();
    for (k, function) in program.functions.iter().enumerate() {
        let mut out = vec![DoubleDouble::from(0.0); function.results.len()];
        program.run_at(k, &params, &prepared, point, &mut out);
        all.extend(out);
    }
    all
}

#[test]
fn every_pass_makes_of_a_program_what_its_file_says() {
    let mut wrong = Vec::new();
    for path in files() {
        let text = std::fs::read_to_string(&path).unwrap();
        let (before, expected) = text.split_once(BETWEEN).unwrap();
        let head = before.lines().find_map(|line| line.strip_prefix("# passes: ")).unwrap();
        let mut program = Program::read(before).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        verify_rules(&program).unwrap();
        let expected_values = values(&program);
        for pass in head.split(", ") {
            run_pass(pass, &mut program).unwrap();
        }
        verify_rules(&program).unwrap();
        for (found, expected) in values(&program).iter().zip(expected_values) {
            let difference = (*found - expected).hi().abs();
            assert!(difference <= 1e-29 * (1.0 + expected.hi().abs()), "{}: {difference}", path.display());
        }
        if program.to_string() == expected {
            continue;
        }
        if std::env::var_os("UPDATE_EXPECT").is_some() {
            std::fs::write(&path, format!("{before}{BETWEEN}{program}")).unwrap();
        } else {
            wrong.push(format!("{}:\n{program}", path.display()));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
