//! Notices of others' parts of the program: each crate with its licence, and every text of a licence once.
//!
//! Does not know: which licences are taken; `deny.toml` lists them.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Command;

use hamel_run::Error;
use hamel_run::repository::Repository;
use serde::Deserialize;

use super::tools::{failed, host};

#[derive(Deserialize)]
struct Metadata {
    packages: Vec<Package>,
    resolve: Resolve,
}

#[derive(Deserialize)]
struct Resolve {
    nodes: Vec<Node>,
}

#[derive(Deserialize)]
struct Node {
    id: String,
    deps: Vec<Dependency>,
}

#[derive(Deserialize)]
struct Dependency {
    pkg: String,
    dep_kinds: Vec<Kind>,
}

#[derive(Deserialize)]
struct Kind {
    kind: Option<String>,
}

#[derive(Deserialize)]
struct Package {
    id: String,
    name: String,
    version: String,
    license: Option<String>,
    repository: Option<String>,
    /// None for crates of the workspace.
    source: Option<String>,
    manifest_path: String,
}

/// The notices of everything that the program is linked with.
///
/// # Errors
/// [`Error::Failed`] for a crate without a licence that `deny.toml` takes; [`Error::Io`].
pub(super) fn text(repository: &Repository) -> Result<String, Error> {
    let allowed = allowed(&repository.root().join("deny.toml"))?;
    let mut command = Command::new(Repository::cargo());
    command.args(["metadata", "--format-version=1", "--locked", "--filter-platform", &host()?]);
    let output =
        command.current_dir(repository.root()).output().map_err(|e| Error::io("cargo metadata", e))?;
    if !output.status.success() {
        return Err(failed("cargo metadata", String::from_utf8_lossy(&output.stderr)));
    }
    let metadata: Metadata =
        serde_json::from_slice(&output.stdout).map_err(|e| Error::io("cargo metadata", e.into()))?;
    let packages = linked(&metadata)?;
    let refused: Vec<String> = packages
        .iter()
        .filter(|package| !is_taken(package.license.as_deref().unwrap_or_default(), &allowed))
        .map(|p| format!("{} {} ({})", p.name, p.version, p.license.as_deref().unwrap_or("no licence")))
        .collect();
    if !refused.is_empty() {
        return Err(failed("notices", format!("deny.toml takes no licence of {}", refused.join(", "))));
    }
    let mut text = String::from(
        "The program hamel has parts that others wrote. Their licences follow the list of crates.\n\n",
    );
    let mut texts: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for package in &packages {
        let Package { name, version, license, repository, manifest_path, .. } = package;
        let license = license.as_deref().unwrap_or_default();
        let _ =
            writeln!(text, "{name} {version}, {license}, {}", repository.as_deref().unwrap_or("no address"));
        for notice in notices(Path::new(manifest_path))? {
            texts.entry(notice).or_default().insert(format!("{name} {version}"));
        }
    }
    for (notice, of) in texts {
        let of: Vec<String> = of.into_iter().collect();
        let _ = write!(text, "\n{}\n{}\n\n{}\n", "-".repeat(80), of.join(", "), notice.trim_end());
    }
    Ok(text)
}

/// The crates of others that the program is linked with, by name.
fn linked(metadata: &Metadata) -> Result<Vec<&Package>, Error> {
    let nodes: BTreeMap<&str, &Node> = metadata.resolve.nodes.iter().map(|n| (n.id.as_str(), n)).collect();
    let packages: BTreeMap<&str, &Package> = metadata.packages.iter().map(|p| (p.id.as_str(), p)).collect();
    let root = metadata.packages.iter().find(|p| p.name == "hamel" && p.source.is_none());
    let root = root.ok_or_else(|| failed("cargo metadata", "has no package hamel"))?;
    let (mut seen, mut open) = (BTreeSet::from([root.id.as_str()]), vec![root.id.as_str()]);
    while let Some(id) = open.pop() {
        for dependency in nodes.get(id).iter().flat_map(|node| &node.deps) {
            // What builds or tests a crate is no part of it.
            if dependency.dep_kinds.iter().any(|kind| kind.kind.is_none()) && seen.insert(&dependency.pkg) {
                open.push(&dependency.pkg);
            }
        }
    }
    let mut found: Vec<&Package> = seen.iter().filter_map(|id| packages.get(id).copied()).collect();
    found.retain(|package| package.source.is_some());
    found.sort_by(|a, b| (&a.name, &a.version).cmp(&(&b.name, &b.version)));
    Ok(found)
}

/// Texts of licences and notices beside a manifest, and all texts beside fonts.
fn notices(manifest: &Path) -> Result<Vec<String>, Error> {
    let Some(folder) = manifest.parent() else { return Ok(Vec::new()) };
    let fail = |e| Error::io(folder.display().to_string(), e);
    let fonts = folder.join("fonts");
    let mut paths = Vec::new();
    for folder in [Some(folder), fonts.is_dir().then_some(fonts.as_path())].into_iter().flatten() {
        for entry in fs::read_dir(folder).map_err(fail)? {
            paths.push(entry.map_err(fail)?.path());
        }
    }
    let mut texts = Vec::new();
    for path in paths {
        let name = path.file_name().unwrap_or_default().to_string_lossy().to_uppercase();
        let is_notice =
            ["LICENSE", "LICENCE", "COPYING", "COPYRIGHT", "NOTICE"].iter().any(|n| name.starts_with(n))
                || path.parent() == Some(fonts.as_path()) && name.ends_with(".TXT");
        if is_notice && path.is_file() {
            texts.push(String::from_utf8_lossy(&fs::read(&path).map_err(fail)?).replace("\r\n", "\n"));
        }
    }
    texts.sort();
    Ok(texts)
}

/// The list `allow` of the licences in `deny.toml`.
fn allowed(path: &Path) -> Result<BTreeSet<String>, Error> {
    let text = fs::read_to_string(path).map_err(|e| Error::io(path.display().to_string(), e))?;
    let list = text.split_once("allow = [").and_then(|(_, rest)| rest.split_once(']'));
    let (list, _) = list.ok_or_else(|| failed("deny.toml", "has no list of licences, `allow = [..]`"))?;
    Ok(list.split('"').skip(1).step_by(2).map(str::to_owned).collect())
}

/// Whether the licences that are taken satisfy an expression: `or` needs one side, `and` both.
fn is_taken(expression: &str, allowed: &BTreeSet<String>) -> bool {
    let expression = expression.trim();
    // The old form of `or`.
    if expression.contains('/') && !expression.contains(' ') {
        return expression.split('/').any(|part| is_taken(part, allowed));
    }
    // `and` binds tighter.
    for (operator, all) in [(" OR ", false), (" AND ", true)] {
        let parts = parts(expression, operator);
        if parts.len() > 1 {
            return match all {
                true => parts.iter().all(|part| is_taken(part, allowed)),
                false => parts.iter().any(|part| is_taken(part, allowed)),
            };
        }
    }
    match expression.strip_prefix('(').and_then(|inner| inner.strip_suffix(')')) {
        Some(inner) => is_taken(inner, allowed),
        None => allowed.contains(expression),
    }
}

/// The parts of an expression between operators outside of brackets.
fn parts<'e>(expression: &'e str, operator: &str) -> Vec<&'e str> {
    let (mut parts, mut depth, mut start) = (Vec::new(), 0_i32, 0);
    for (at, c) in expression.char_indices() {
        match c {
            '(' => depth += 1,
            ')' => depth -= 1,
            ' ' if depth == 0 && expression[at..].starts_with(operator) => {
                parts.push(&expression[start..at]);
                start = at + operator.len();
            }
            _ => {}
        }
    }
    parts.push(&expression[start..]);
    parts
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::is_taken;

    #[test]
    fn a_licence_is_taken_if_its_expression_can_be_satisfied() {
        let allowed = BTreeSet::from(["MIT".to_owned(), "Unicode-3.0".to_owned()]);
        for (expression, taken) in [
            ("MIT", true),
            ("MIT OR Apache-2.0", true),
            ("MIT/Apache-2.0", true),
            ("GPL-3.0", false),
            ("", false),
            ("(MIT OR Apache-2.0) AND Unicode-3.0", true),
            ("(GPL-3.0 OR Apache-2.0) AND Unicode-3.0", false),
            ("MIT AND GPL-3.0", false),
            ("GPL-3.0 OR MIT AND Unicode-3.0", true),
            ("MIT OR GPL-3.0 AND LGPL-3.0", true),
            ("GPL-3.0 OR MIT AND LGPL-3.0", false),
        ] {
            assert_eq!(is_taken(expression, &allowed), taken, "{expression}");
        }
    }
}
