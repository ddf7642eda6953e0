//! Whether each part of a release works where nothing else of hamel is: installed in an empty folder, it runs the lines
//! of the README.
//!
//! Does not know: how the parts were made.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use hamel_run::Error;
use hamel_run::repository::Repository;

use super::archive;
use super::tools::failed;

/// The parts of a release, as far as they could be made.
#[derive(Debug, Default)]
pub(super) struct Parts {
    pub(super) archive: PathBuf,
    pub(super) wheel: Option<PathBuf>,
    pub(super) debian: Option<PathBuf>,
    pub(super) npm: Option<PathBuf>,
    pub(super) left_out: Vec<String>,
}

/// Lines of the README that are left out, each with its reason.
const LEFT_OUT: [(&str, &str); 4] = [
    ("hamel lsp", "waits for an editor"),
    ("hamel ensemble", "a million trajectories"),
    ("hamel import", "the description of a robot is not part of a release"),
    ("hamel generate heavy_top --language c", "compared bit for bit by the tests"),
];

/// Checks every part; a line about each.
///
/// # Errors
/// [`Error::Failed`] with the part, the line and what it told.
pub(super) fn all(repository: &Repository, parts: &Parts) -> Result<Vec<String>, Error> {
    let empty = std::env::temp_dir().join(format!("hamel-dist-{}", std::process::id()));
    archive::clear(&empty)?;
    let result = every(repository, parts, &empty);
    archive::remove(&empty)?;
    result
}

fn every(repository: &Repository, parts: &Parts, empty: &Path) -> Result<Vec<String>, Error> {
    let readme = read(&repository.root().join("README.md"))?;
    let mut lines = Vec::new();
    let from_archive = empty.join("archive");
    archive::clear(&from_archive)?;
    let unpacked = run(
        "archive",
        Command::new("tar")
            .arg("-xzf")
            .arg(&parts.archive)
            .arg("--strip-components=1")
            .current_dir(&from_archive),
    );
    unpacked?;
    let n = program(repository, &readme, &from_archive.join("bin"), &empty.join("a"))?;
    lines.push(format!("archive: {n} lines of the README pass"));
    if let Some(debian) = &parts.debian {
        let root = empty.join("debian");
        run("Debian package", Command::new("dpkg-deb").arg("--extract").arg(debian).arg(&root))?;
        let n = program(repository, &readme, &root.join("usr/bin"), &empty.join("b"))?;
        lines.push(format!("Debian package: {n} lines of the README pass"));
    }
    if let Some(wheel) = &parts.wheel {
        python(&readme, wheel, &empty.join("python"))?;
        lines.push("wheel: the lines of the README pass".to_owned());
    }
    if let Some(npm) = &parts.npm {
        let folder = empty.join("npm");
        archive::clear(&folder)?;
        run(
            "npm",
            Command::new("npm").args(["install", "--silent", "--offline"]).arg(npm).current_dir(&folder),
        )?;
        let program = folder.join("node_modules/hamel/playground/hamel.wasm");
        let bytes = std::fs::read(&program).map_err(|e| Error::io(program.display().to_string(), e))?;
        if !bytes.starts_with(b"\0asm") {
            return Err(failed("npm", "hamel.wasm is no program for WebAssembly"));
        }
        lines.push("package for npm: has the program for WASI".to_owned());
    }
    Ok(lines)
}

fn read(path: &Path) -> Result<String, Error> {
    std::fs::read_to_string(path).map_err(|e| Error::io(path.display().to_string(), e))
}

/// Runs a command to its end; what it told is part of the error.
fn run(part: &str, command: &mut Command) -> Result<(), Error> {
    let output = command.stdin(Stdio::null()).output();
    let output = output.map_err(|e| failed(part, format!("could not be started: {e}")))?;
    if output.status.success() {
        return Ok(());
    }
    let told =
        format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    Err(failed(part, format!("{command:?}: {}\n{told}", output.status)))
}

/// Calls of the program in the blocks of shell of a page, without comments.
fn calls(page: &str) -> Vec<&str> {
    let blocks = page.split("```sh\n").skip(1).filter_map(|rest| rest.split("```").next());
    let lines = blocks.flat_map(str::lines).map(|line| line.split(" #").next().unwrap_or_default().trim());
    lines.filter(|line| line.starts_with("hamel ") || line.contains("| hamel ")).collect()
}

/// Runs every call of the README in an empty folder, with the program of a folder alone; how many there were.
fn program(repository: &Repository, readme: &str, bin: &Path, folder: &Path) -> Result<usize, Error> {
    archive::clear(&folder.join("docs/book"))?;
    // The one file of the repository that a line names.
    let named = "docs/book/top_in_space.hamel";
    let text = read(&repository.root().join(named))?;
    std::fs::write(folder.join(named), text).map_err(|e| Error::io(named, e))?;
    let path = std::env::join_paths([bin, Path::new("/usr/bin"), Path::new("/bin")]);
    let path = path.map_err(|e| failed("PATH", e.to_string()))?;
    let mut n = 0;
    for call in calls(readme) {
        if LEFT_OUT.iter().any(|(start, _)| call.starts_with(start)) {
            continue;
        }
        let mut shell = Command::new("sh");
        shell.args(["-c", call]).current_dir(folder).env_clear().env("PATH", &path).env("HOME", folder);
        run(call, &mut shell)?;
        n += 1;
    }
    Ok(n)
}

/// Installs a wheel in a new environment and runs the README's block of Python.
fn python(readme: &str, wheel: &PathBuf, folder: &Path) -> Result<(), Error> {
    let block = readme.split("```python\n").nth(1).and_then(|rest| rest.split("```").next());
    let block = block.ok_or_else(|| failed("README.md", "has no block of Python"))?;
    run("wheel", Command::new("python3").args(["-m", "venv"]).arg(folder))?;
    let python = folder.join("bin/python");
    run("wheel", Command::new(&python).args(["-m", "pip", "install", "--quiet"]).arg(wheel))?;
    run("wheel", Command::new(&python).arg("-c").arg(block).current_dir(folder).env("HOME", folder))
}

#[cfg(test)]
mod tests {
    use super::{LEFT_OUT, calls};

    #[test]
    fn calls_are_lines_of_shell() {
        let page = "text\n```sh\nhamel list   # all\ncargo xtask tidy\necho '{}' | hamel eval a\n```\n```text\nhamel no\n```\n";
        assert_eq!(calls(page), ["hamel list", "echo '{}' | hamel eval a"]);
    }

    #[test]
    fn what_is_left_out_is_in_the_readme() {
        let readme = include_str!("../../../README.md");
        let calls = calls(readme);
        assert!(calls.len() > 12, "{calls:?}");
        for (start, _) in LEFT_OUT {
            assert!(calls.iter().any(|call| call.starts_with(start)), "{start}");
        }
    }
}
