//! Builds of single packages turn on the features of the whole workspace: everything is compiled once.
//!
//! Does not know: what a feature does, and which profile a build has.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

use hamel_run::Error;

use super::source::Problem;

/// Packages that `.ci/run` and people build alone: the chores, and the Python package.
const ALONE: [(&str, &str); 2] = [("xtask", "xtask/Cargo.toml"), ("hamel-python", "python/Cargo.toml")];

/// Packages with features that differ between a build of one member, or of the workspace without its tests, and the
/// tests of the workspace.
///
/// # Errors
/// [`Error::Io`] where cargo cannot be started, [`Error::Failed`] with its message where it refuses.
pub(super) fn problems(root: &Path) -> Result<Vec<Problem>, Error> {
    let of_tests = tree(root, &["--workspace", "--edges", "normal,dev,no-proc-macro"])?;
    let without = tree(root, &["--workspace", "--edges", "normal,no-proc-macro"])?;
    let mut builds = vec![("Cargo.toml", without)];
    for (package, manifest) in ALONE {
        builds.push((manifest, tree(root, &["--package", package, "--edges", "normal,no-proc-macro"])?));
    }
    Ok(builds.iter().flat_map(|(manifest, built)| different(manifest, built, &of_tests)).collect())
}

/// Packages of a build that the tests have with other features.
fn different(manifest: &str, built: &BTreeSet<String>, of_tests: &BTreeSet<String>) -> Vec<Problem> {
    let others = |line: &str| -> Vec<&str> {
        let name = line.split(" [").next();
        of_tests.iter().map(String::as_str).filter(|other| other.split(" [").next() == name).collect()
    };
    let problem = |line: &String| {
        let message = format!(
            "{line} is compiled again for the tests of the workspace, which have {}: turn on the same features here, or \
             in a member that is in both builds",
            others(line).join(", ")
        );
        Problem::new(Path::new(manifest), 1, message)
    };
    built.difference(of_tests).map(problem).collect()
}

/// `name version [features]` of every package of a build.
fn tree(root: &Path, chosen: &[&str]) -> Result<BTreeSet<String>, Error> {
    // The variable is set within `cargo xtask`; its own cargo finds the toolchain of the folder.
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let output = Command::new(cargo)
        .args(["tree", "--locked", "--prefix", "none", "--format", "{p} [{f}]"])
        .args(chosen)
        .current_dir(root)
        .output()
        .map_err(|e| Error::io("cargo tree", e))?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr).trim().to_owned();
        return Err(Error::Failed { step: "cargo tree".into(), status: said });
    }
    // A star in parentheses marks a package that was shown before.
    let lines = String::from_utf8_lossy(&output.stdout).into_owned();
    Ok(lines.lines().filter_map(|line| Some(line.rsplit_once(']')?.0.to_owned() + "]")).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_feature_that_one_build_lacks_is_found() {
        let folder = std::env::temp_dir().join(format!("hamel_tidy_features_{}", std::process::id()));
        let package = |name: &str, rest: &str| {
            let path = folder.join(name);
            std::fs::create_dir_all(path.join("src")).unwrap();
            std::fs::write(path.join("src/lib.rs"), "").unwrap();
            let head = format!("[package]\nname = \"{name}\"\nversion = \"0.1.0\"\nedition = \"2024\"\n");
            std::fs::write(path.join("Cargo.toml"), head + rest).unwrap();
        };
        package("shared", "[features]\nfast = []\n");
        package("other", "[dependencies]\nshared = { path = \"../shared\", features = [\"fast\"] }\n");
        let members =
            "[workspace]\nresolver = \"3\"\nmembers = [\"shared\", \"other\", \"xtask\", \"hamel-python\"]\n";
        std::fs::write(folder.join("Cargo.toml"), members).unwrap();
        let with = |features: &str| {
            package("xtask", &format!("[dependencies]\nshared = {{ path = \"../shared\"{features} }}\n"));
            package("hamel-python", "");
            let lock =
                Command::new("cargo").args(["generate-lockfile", "--offline"]).current_dir(&folder).output();
            assert!(lock.unwrap().status.success());
            problems(&folder).unwrap().iter().map(Problem::to_string).collect::<Vec<_>>()
        };
        assert_eq!(with(", features = [\"fast\"]"), Vec::<String>::new());
        let found = with("");
        std::fs::remove_dir_all(&folder).unwrap();
        assert_eq!(found.len(), 1, "{found:?}");
        assert!(found[0].starts_with("xtask/Cargo.toml:1: shared v0.1.0"), "{found:?}");
        assert!(found[0].contains("[] is compiled again") && found[0].contains("[fast]"), "{found:?}");
    }
}
