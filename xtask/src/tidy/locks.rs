//! Lock files of packages beside the workspace agree with the manifests: those packages are compiled with `--locked`.
//!
//! Does not know: whether versions are the latest.

use std::path::Path;
use std::process::Command;

use hamel_run::Error;

use super::source::Problem;

/// Folders of packages that have a lock file of their own.
const FOLDERS: [&str; 2] = ["tests/downstream", "fuzz"];

/// Lock files that cargo would change.
///
/// # Errors
/// [`Error::Io`] where cargo cannot be started.
pub(super) fn problems(root: &Path) -> Result<Vec<Problem>, Error> {
    let mut problems = Vec::new();
    for folder in FOLDERS {
        if let Some(message) = stale(&root.join(folder))? {
            let fix = format!("{message}: run `cargo update --workspace` in {folder}");
            problems.push(Problem::new(&Path::new(folder).join("Cargo.lock"), 1, fix));
        }
    }
    Ok(problems)
}

/// What cargo says about the lock file of a folder, where it would change it.
fn stale(folder: &Path) -> Result<Option<String>, Error> {
    // The variable is set within `cargo xtask`; its own cargo finds the toolchain of the folder.
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let output = Command::new(cargo)
        .args(["update", "--workspace", "--locked", "--quiet"])
        .current_dir(folder)
        .output()
        .map_err(|e| Error::io("cargo update", e))?;
    if output.status.success() {
        return Ok(None);
    }
    let said = String::from_utf8_lossy(&output.stderr);
    Ok(Some(said.lines().next().unwrap_or("cargo refuses it").trim_start_matches("error: ").to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lock_file_without_a_dependency_is_found() {
        let folder = std::env::temp_dir().join(format!("hamel_tidy_locks_{}", std::process::id()));
        let write = |path: &str, text: &str| {
            let path = folder.join(path);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        };
        let package = |name: &str, rest: &str| {
            format!("[package]\nname = \"{name}\"\nversion = \"0.1.0\"\nedition = \"2024\"\n{rest}")
        };
        write("src/lib.rs", "");
        write("Cargo.toml", &package("outer", "[workspace]\n"));
        write("Cargo.lock", "version = 4\n\n[[package]]\nname = \"outer\"\nversion = \"0.1.0\"\n");
        assert_eq!(stale(&folder).unwrap(), None);

        write("inner/src/lib.rs", "");
        write("inner/Cargo.toml", &package("inner", ""));
        write("Cargo.toml", &package("outer", "[workspace]\n[dependencies]\ninner = { path = \"inner\" }\n"));
        let said = stale(&folder).unwrap().unwrap();
        std::fs::remove_dir_all(&folder).unwrap();
        assert!(said.contains("cannot update the lock file"), "{said}");
    }
}
