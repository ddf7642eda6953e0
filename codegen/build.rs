//! Tells the crate which sources it was built from, and how: results of other sources are never reused, and a build
//! script that runs it without optimisation is told what to do about it.
//!
//! In the repository the sources are those of this crate and of the crates in its folder. A published crate has its own
//! alone: its version asks for exactly one version of each of the others.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

fn main() -> io::Result<()> {
    let mut files = Vec::new();
    let folders = ["src", "expr/src", "lang/src", "mechanics/src", "program/src"];
    for folder in folders.map(Path::new).into_iter().filter(|folder| folder.is_dir()) {
        println!("cargo::rerun-if-changed={}", folder.display());
        list(folder, &mut files)?;
    }
    files.sort();
    let mut hash: u64 = 0xcbf2_9ce4_8422_2325;
    for file in files {
        let name = file.to_string_lossy().replace('\\', "/");
        for byte in name.bytes().chain(fs::read(&file)?) {
            // Fowler, Noll and Vo: nobody attacks it.
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
    println!("cargo::rustc-env=HAMEL_CODEGEN_SOURCES={hash:016x}");
    let level = std::env::var("OPT_LEVEL").unwrap_or_default();
    println!("cargo::rustc-env=HAMEL_CODEGEN_OPT_LEVEL={level}");
    Ok(())
}

fn list(folder: &Path, files: &mut Vec<PathBuf>) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            list(&path, files)?;
        } else {
            files.push(path);
        }
    }
    Ok(())
}
