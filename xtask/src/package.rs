//! `package`: whether the crates can be published as they are.
//!
//! Does not know: which crates there are. Those that cargo may publish are checked.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::{Command, Stdio};

use hamel_run::Error;
use hamel_run::repository::Repository;
use serde::Deserialize;

/// Files without which a crate is not published.
const REQUIRED: [&str; 5] = ["Cargo.toml", "LICENSE-APACHE", "LICENSE-MIT", "README.md", "src/lib.rs"];
/// Fewer and longer keywords are refused by the registry.
const MAX_KEYWORDS: usize = 5;

/// What `cargo metadata` says.
#[derive(Deserialize)]
struct Metadata {
    packages: Vec<Package>,
}

/// A crate as `cargo metadata` describes it.
#[derive(Debug, Default, Deserialize)]
struct Package {
    name: String,
    /// The registries it may go to; absent for all of them.
    publish: Option<Vec<String>>,
    description: Option<String>,
    license: Option<String>,
    documentation: Option<String>,
    readme: Option<String>,
    rust_version: Option<String>,
    #[serde(default)]
    keywords: Vec<String>,
    #[serde(default)]
    categories: Vec<String>,
    #[serde(default)]
    dependencies: Vec<Dependency>,
    /// What Cargo.toml says to other tools.
    #[serde(default)]
    metadata: serde_json::Value,
}

/// A dependency of a crate.
#[derive(Debug, Default, Deserialize)]
struct Dependency {
    name: String,
    req: String,
    kind: Option<String>,
}

/// Checks metadata and files of every crate that may be published, then packages all of them and, with `verify`, builds
/// what was packaged. Needs no network when the dependencies have been fetched.
///
/// # Errors
/// [`Error::Failed`] with everything that is wrong, or when cargo refuses.
pub(crate) fn package(repository: &Repository, verify: bool) -> Result<String, Error> {
    let metadata = cargo(repository, &["metadata", "--format-version=1", "--no-deps", "--offline"])?;
    let metadata: Metadata =
        serde_json::from_str(&metadata).map_err(|e| Error::io("cargo metadata", e.into()))?;
    let packages: Vec<Package> =
        metadata.packages.into_iter().filter(|p| p.publish.as_ref().is_none_or(|p| !p.is_empty())).collect();
    let mut problems = Vec::new();
    let mut lines = Vec::new();
    for package in &packages {
        // Work in progress may be looked at; cargo itself refuses to publish it.
        let list = ["package", "--list", "--offline", "--allow-dirty", "--package", &package.name];
        let list = cargo(repository, &list)?;
        let files: Vec<&str> = list.lines().collect();
        let found = metadata_problems(package).into_iter().chain(file_problems(&files));
        problems.extend(found.map(|problem| (package.name.clone(), problem)));
        lines.push(format!("{}: {} files", package.name, files.len()));
    }
    if !problems.is_empty() {
        let lines = problems.iter().map(|(name, reason)| format!("\n  {name} {reason}"));
        let status = format!("crates cannot be published as they are:{}", lines.collect::<String>());
        return Err(Error::Failed { step: "package".into(), status });
    }
    // Together, so that they find each other though no registry has them yet.
    let mut arguments = vec!["package", "--offline", "--allow-dirty"];
    arguments.extend(packages.iter().flat_map(|p| ["--package", p.name.as_str()]));
    if !verify {
        arguments.push("--no-verify");
    }
    cargo(repository, &arguments)?;
    lines.push(format!("packaged{}", if verify { ", and built from the packages" } else { "" }));
    Ok(lines.join("\n"))
}

/// Runs cargo in the repository; its messages go to the terminal, its output comes back.
fn cargo(repository: &Repository, arguments: &[&str]) -> Result<String, Error> {
    let output = Command::new(Repository::cargo())
        .args(arguments)
        .arg("--quiet")
        .current_dir(repository.root())
        .stderr(Stdio::inherit())
        .output()
        .map_err(|e| Error::io("cargo could not be started", e))?;
    if !output.status.success() {
        let step = format!("cargo {}", arguments.join(" "));
        return Err(Error::Failed { step, status: output.status.to_string() });
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

fn metadata_problems(package: &Package) -> Vec<String> {
    let texts = [
        ("description", &package.description),
        ("license", &package.license),
        ("documentation", &package.documentation),
        ("readme", &package.readme),
        ("rust-version", &package.rust_version),
    ];
    let is_empty = |text: &Option<String>| text.as_ref().is_none_or(|t| t.trim().is_empty());
    let missing = texts.into_iter().filter(|(_, text)| is_empty(text));
    let mut problems: Vec<String> = missing.map(|(name, _)| format!("has no {name} in Cargo.toml")).collect();
    if package.categories.is_empty() {
        problems.push("has no categories in Cargo.toml".into());
    }
    match package.keywords.len() {
        0 => problems.push("has no keywords in Cargo.toml".into()),
        n if n > MAX_KEYWORDS => problems.push(format!("has {n} keywords: keep {MAX_KEYWORDS}")),
        _ => {}
    }
    let documented = &package.metadata["docs"]["rs"];
    if documented["all-features"] != true && !documented["features"].is_array() {
        let what = "all-features = true, or the list of features that are documented";
        problems.push(format!("is documented in part: add [package.metadata.docs.rs] {what}"));
    }
    // The interfaces between them change without notice.
    let own = |d: &&Dependency| d.name.starts_with("hamel") && d.kind.as_deref() != Some("dev");
    let loose = package.dependencies.iter().filter(own).filter(|d| d.req != "*" && !d.req.starts_with('='));
    problems.extend(
        loose.map(|d| format!("asks for {} {}: crates of hamel ask for exact versions", d.name, d.req)),
    );
    // Cargo leaves the path out when it publishes, and what remains has to say which version is meant.
    let vague = package.dependencies.iter().filter(|d| d.req == "*" && d.kind.as_deref() != Some("dev"));
    problems.extend(vague.map(|d| format!("depends on {} without a version", d.name)));
    problems
}

fn file_problems(files: &[&str]) -> Vec<String> {
    let present: BTreeSet<&str> = files.iter().copied().collect();
    let missing = REQUIRED.iter().filter(|name| !present.contains(**name));
    let mut problems: Vec<String> = missing.map(|name| format!("is packaged without {name}")).collect();
    let strange = files.iter().filter(|file| {
        let path = Path::new(file);
        let hidden = |part: &std::ffi::OsStr| part.to_str().is_none_or(|p| p.starts_with('.'));
        path.starts_with("target") || path.iter().any(hidden) && **file != ".cargo_vcs_info.json"
    });
    problems.extend(strange.map(|file| format!("is packaged with {file}: exclude it")));
    problems
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everything_that_is_missing_is_told() {
        let bare = Package {
            keywords: vec!["k".into(); 6],
            dependencies: vec![
                Dependency { name: "near".into(), req: "*".into(), kind: None },
                Dependency { name: "hamel-near".into(), req: "^0.1.0".into(), kind: None },
            ],
            ..Package::default()
        };
        let problems = metadata_problems(&bare);
        for part in ["description", "license", "documentation", "readme", "rust-version", "categories"] {
            assert!(problems.iter().any(|p| p.contains(part)), "{part} in {problems:?}");
        }
        assert!(problems.contains(&"has 6 keywords: keep 5".to_owned()));
        assert!(problems.iter().any(|p| p.contains("docs.rs")), "{problems:?}");
        assert!(problems.contains(&"depends on near without a version".to_owned()));
        let loose = "asks for hamel-near ^0.1.0: crates of hamel ask for exact versions";
        assert!(problems.contains(&loose.to_owned()));
    }

    #[test]
    fn files_that_do_not_belong_there_are_told() {
        let complete = ["Cargo.toml", "LICENSE-APACHE", "LICENSE-MIT", "README.md", "src/lib.rs"];
        let with = |more: &'static str| file_problems(&[&complete[..], &[more]].concat());
        assert_eq!(with(".cargo_vcs_info.json"), Vec::<String>::new());
        assert_eq!(with("src/.swp"), ["is packaged with src/.swp: exclude it"]);
        assert_eq!(with("target/x"), ["is packaged with target/x: exclude it"]);
        assert_eq!(file_problems(&complete[1..]), ["is packaged without Cargo.toml"]);
    }
}
