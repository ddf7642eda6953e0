//! The order of the modules of the generator, and circles of files within the folders of all crates.
//!
//! The order is read from ARCHITECTURE.md: a module uses only modules of its crate that stand above it in the list
//! under `## codegen`. The order of crates is in the dependencies, which cargo checks.
//!
//! Does not know: how uses are found.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use super::imports::{Imports, Module, imports};
use super::known;
use super::source::{Problem, Source};

/// The document with the order.
const ARCHITECTURE: &str = "ARCHITECTURE.md";
/// Folders of sources whose modules stand in the document.
const ORDERED: [&str; 4] =
    ["codegen/lang/src", "codegen/mechanics/src", "codegen/program/src", "codegen/src"];

pub(super) fn problems(sources: &[Source]) -> Vec<Problem> {
    let mut problems = Vec::new();
    let mut circles = Vec::new();
    let text = sources.iter().find(|s| s.path == Path::new(ARCHITECTURE)).map_or("", |s| &s.text);
    let order = order(text);
    let mut known_modules = BTreeSet::new();
    for src in crates(sources) {
        let imports = imports(sources, &src);
        if ORDERED.contains(&src.as_str()) {
            problems.extend(steps_back(&imports, &order));
            known_modules.extend(imports.files.keys().filter_map(|module| module.first().cloned()));
        }
        circles.extend(circles_of(&imports, &src));
    }
    for name in order.iter().filter(|name| !known_modules.contains(*name)) {
        let message = format!("`{name}` is no module of the generator; remove it from the list");
        problems.push(Problem::new(Path::new(ARCHITECTURE), 1, message));
    }
    for circle in &circles {
        if !known::CIRCLES.iter().any(|(folder, files, _)| circle.is(folder, files)) {
            let message = format!(
                "{} use each other; move what both need to a file below them, or write a reason into xtask/src/tidy/known.rs",
                circle.files.join(", ")
            );
            problems.push(Problem::new(Path::new(&circle.folder), circle.line, message));
        }
    }
    for (folder, files, _) in known::CIRCLES {
        if !circles.iter().any(|circle| circle.is(folder, files)) {
            let message = format!("the circle of {} is gone; remove it from known.rs", files.join(", "));
            problems.push(Problem::new(Path::new(folder), 1, message));
        }
    }
    problems
}

/// The folders of sources of all crates.
fn crates(sources: &[Source]) -> BTreeSet<String> {
    let is_root = |s: &&Source| s.path.ends_with("src/lib.rs") || s.path.ends_with("src/main.rs");
    let folder = |s: &Source| Some(s.path.parent()?.to_string_lossy().into_owned());
    sources.iter().filter(is_root).filter_map(folder).collect()
}

/// The modules in the order of the document: rows of its tables that begin with **`name`**.
fn order(architecture: &str) -> Vec<String> {
    let name = |line: &str| Some(line.strip_prefix("| **`")?.split_once("`**")?.0.to_owned());
    architecture.lines().filter_map(name).collect()
}

fn steps_back(imports: &Imports, order: &[String]) -> Vec<Problem> {
    let mut problems = Vec::new();
    let place = |module: &str| order.iter().position(|name| name == module);
    for (module, uses) in &imports.uses {
        let Some(from) = module.first() else { continue };
        let file = &imports.files[module];
        let Some(at) = place(from) else {
            let message = format!("`{from}` is not in the list of modules; add it to {ARCHITECTURE}");
            problems.push(Problem::new(file, 1, message));
            continue;
        };
        for used in uses {
            let to = used.module.first().filter(|to| *to != from);
            if let Some(to) = to
                && place(to).is_none_or(|below| below > at)
            {
                let message = format!(
                    "`{from}` uses `{to}`, which stands below it in {ARCHITECTURE}; move what it needs up, or pass it in"
                );
                problems.push(Problem::new(file, used.line, message));
            }
        }
    }
    problems
}

/// Files (or folders) of one folder that use each other.
#[derive(Debug)]
struct Circle {
    folder: String,
    files: Vec<String>,
    line: usize,
}

impl Circle {
    fn is(&self, folder: &str, files: &[&str]) -> bool {
        self.folder == folder && self.files == files
    }
}

fn circles_of(imports: &Imports, src: &str) -> Vec<Circle> {
    let folders: BTreeSet<&[String]> =
        imports.files.keys().flat_map(|module| (0..module.len()).map(move |n| &module[..n])).collect();
    let mut circles = Vec::new();
    for folder in folders {
        // The file that a module is in, as seen from the folder: one of its files or folders, or its `mod.rs`.
        let seen = |module: &Module| -> Option<String> {
            let rest = module.strip_prefix(folder)?;
            Some(rest.first().cloned().unwrap_or_else(|| "mod".to_owned()))
        };
        let mut edges: BTreeMap<String, BTreeMap<String, usize>> = BTreeMap::new();
        for (module, uses) in &imports.uses {
            let Some(from) = seen(module) else { continue };
            for used in uses {
                if let Some(to) = seen(&used.module).filter(|to| *to != from) {
                    edges.entry(from.clone()).or_default().entry(to).or_insert(used.line);
                }
            }
        }
        let path =
            std::iter::once(src).chain(folder.iter().map(String::as_str)).collect::<Vec<_>>().join("/");
        for files in strongly_connected(&edges) {
            let line = edges[&files[0]].values().copied().min().unwrap_or(1);
            circles.push(Circle { folder: path.clone(), files, line });
        }
    }
    circles
}

/// Sets of more than one node in which each can be reached from each.
fn strongly_connected(edges: &BTreeMap<String, BTreeMap<String, usize>>) -> Vec<Vec<String>> {
    let reachable = |start: &String| -> BTreeSet<&String> {
        let mut seen = BTreeSet::new();
        let mut pending = vec![start];
        while let Some(node) = pending.pop() {
            for next in edges.get(node).into_iter().flat_map(BTreeMap::keys) {
                if seen.insert(next) {
                    pending.push(next);
                }
            }
        }
        seen
    };
    let from: BTreeMap<&String, BTreeSet<&String>> =
        edges.keys().map(|node| (node, reachable(node))).collect();
    let mut done: BTreeSet<&String> = BTreeSet::new();
    let mut circles = Vec::new();
    for (node, reached) in &from {
        let circle: Vec<String> = reached
            .iter()
            .filter(|other| from.get(*other).is_some_and(|back| back.contains(node)))
            .map(|other| (*other).clone())
            .collect();
        if !done.contains(node) && circle.len() > 1 {
            done.extend(reached.iter().filter(|other| circle.contains(other)));
            circles.push(circle);
        }
    }
    circles
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sources(files: &[(&str, &str)]) -> Vec<Source> {
        files.iter().map(|(path, text)| Source { path: path.into(), text: (*text).into() }).collect()
    }

    #[test]
    fn a_step_back_is_found() {
        let files = sources(&[
            ("codegen/src/lib.rs", "mod a; mod b;"),
            ("codegen/src/a.rs", "use crate::b::B;"),
            ("codegen/src/b.rs", "use crate::a::A;"),
        ]);
        let imports = imports(&files, "codegen/src");
        let order =
            order("# x\n\n| module | does |\n|---|---|\n| **`a`** | x |\n| **`b`** | y |\n| `c` | z |\n");
        assert_eq!(order, ["a", "b"]);
        let found: Vec<String> = steps_back(&imports, &order).iter().map(Problem::to_string).collect();
        let shown = "codegen/src/a.rs:1: `a` uses `b`, which stands below it in ARCHITECTURE.md; move what it needs \
                     up, or pass it in";
        assert_eq!(found, [shown]);
    }

    #[test]
    fn circles_are_found_in_each_folder() {
        let files = sources(&[
            ("codegen/src/lib.rs", "mod a;"),
            ("codegen/src/a/mod.rs", "mod x; mod y; mod z; pub use x::X;"),
            ("codegen/src/a/x.rs", "use super::y::Y;"),
            ("codegen/src/a/y.rs", "use super::z::Z;"),
            ("codegen/src/a/z.rs", "use super::X;"),
        ]);
        let circles = circles_of(&imports(&files, "codegen/src"), "codegen/src");
        assert_eq!(circles.len(), 1);
        assert!(circles[0].is("codegen/src/a", &["x", "y", "z"]), "{circles:?}");
    }
}
