//! Tells the crate by which sources of the generator it is built: a hash of them.

use std::collections::hash_map::DefaultHasher;
use std::fs;
use std::hash::{Hash as _, Hasher as _};
use std::path::{Path, PathBuf};

/// What a derived scene depends on beside the text of its model. Tests of the generator are no part of it.
const SOURCES: [&str; 3] = ["../codegen", "../runtime/src", "../Cargo.lock"];

fn main() {
    let mut files = Vec::new();
    for source in SOURCES {
        add(Path::new(source), &mut files);
    }
    files.sort();
    let mut hasher = DefaultHasher::new();
    for file in &files {
        println!("cargo::rerun-if-changed={}", file.display());
        let bytes = fs::read(file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
        (file, bytes).hash(&mut hasher);
    }
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rustc-env=HAMEL_SOURCES={:016x}", hasher.finish());
}

fn add(path: &Path, files: &mut Vec<PathBuf>) {
    let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    if path.is_dir() && !["tests", "examples", "target"].contains(&name) {
        // A new file, too, makes another generator; cargo looks at everything below a folder.
        if name == "src" {
            println!("cargo::rerun-if-changed={}", path.display());
        }
        let entries = fs::read_dir(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        entries.for_each(|entry| add(&entry.expect("an entry of a folder").path(), files));
    } else if path.is_file() && (name.ends_with(".rs") || name.ends_with(".toml") || name.ends_with(".lock"))
    {
        files.push(path.to_owned());
    }
}
