//! `dist`: the parts of a release for this machine, and whether each works where nothing else of hamel is.
//!
//! `tools` starts other programs, `archive` packs files, `notices` lists crates of others, `check` installs. Does not
//! know: how anything is compiled.

mod archive;
mod check;
mod notices;
mod tools;

use std::path::{Path, PathBuf};
use std::process::Command;

use clap::Args;
use hamel_run::Error;
use hamel_run::repository::Repository;

use self::archive::Entry;
use self::check::Parts;
use self::tools::{failed, host, step, tool};

/// Build a release for this machine: an archive, a wheel, a Debian package, a package for npm
///
/// The archive has the program, completions, manual pages, licences and notices of what others wrote. Each part is made
/// where its tool is there (maturin; dpkg-deb; the target wasm32-wasip1 with npm), and is named where it is left out.
#[derive(Clone, Debug, Args)]
#[command(after_help = "\
Examples:
  cargo xtask dist
  cargo xtask dist --check                   installs each part in an empty place and runs the lines of the README
  cargo xtask dist --profile dev --check     the same without optimisation across crates, in less time")]
pub(crate) struct Arguments {
    /// Folder to write [default: target/dist]
    #[arg(short, long, value_name = "FOLDER")]
    output: Option<PathBuf>,
    /// Profile of cargo
    #[arg(long, value_name = "NAME", default_value = "release")]
    profile: String,
    /// Install every part, and run the lines of the README
    #[arg(long)]
    check: bool,
}

/// Shells with completions, and where their files are below `share`.
const SHELLS: [(&str, &str); 5] = [
    ("bash", "bash-completion/completions/hamel"),
    ("zsh", "zsh/site-functions/_hamel"),
    ("fish", "fish/vendor_completions.d/hamel.fish"),
    ("elvish", "elvish/lib/hamel.elv"),
    ("powershell", "powershell/hamel.ps1"),
];

/// Builds all parts and, where asked, installs them.
///
/// # Errors
/// [`Error::Failed`] with the step and its message.
pub(crate) fn run(repository: &Repository, arguments: &Arguments) -> Result<String, Error> {
    let folder = arguments.output.clone().unwrap_or_else(|| repository.root().join("target/dist"));
    std::fs::create_dir_all(&folder).map_err(|e| Error::io(folder.display().to_string(), e))?;
    let program = program(repository, &arguments.profile)?;
    let version = env!("CARGO_PKG_VERSION");
    let host = host()?;
    let entries = entries(repository, &program)?;
    let name = format!("hamel-{version}-{host}");
    let mut parts = Parts { archive: folder.join(format!("{name}.tar.gz")), ..Parts::default() };
    archive::write(&parts.archive, &name, &entries)?;
    match tool("maturin", &["--version"]) {
        Some(_) => parts.wheel = Some(wheel(repository, &folder, &arguments.profile)?),
        None => parts.left_out.push("wheel: maturin is not installed (pip install 'maturin>=1.9,<2')".into()),
    }
    match tool("dpkg-deb", &["--version"]) {
        Some(_) => parts.debian = Some(debian(&folder, version, &entries)?),
        None => parts.left_out.push("Debian package: dpkg-deb is not installed".into()),
    }
    match wasm_is_there() && tool("npm", &["--version"]).is_some() {
        true => parts.npm = Some(npm(repository, &folder, version)?),
        false => parts.left_out.push(
            "package for npm: npm, or the target is not installed (rustup target add wasm32-wasip1)".into(),
        ),
    }
    let made = [Some(&parts.archive), parts.wheel.as_ref(), parts.debian.as_ref(), parts.npm.as_ref()];
    let mut lines: Vec<String> = Vec::new();
    for path in made.into_iter().flatten() {
        let size = std::fs::metadata(path).map_err(|e| Error::io(path.display().to_string(), e))?.len();
        lines.push(format!("{} ({:.1} MB)", path.display(), size as f64 / 1e6));
    }
    lines.extend(parts.left_out.iter().map(|reason| format!("left out, {reason}")));
    if arguments.check {
        lines.extend(check::all(repository, &parts)?);
    }
    Ok(lines.join("\n"))
}

fn wasm_is_there() -> bool {
    tool("rustc", &["--print", "target-libdir", "--target", "wasm32-wasip1"])
        .is_some_and(|path| Path::new(path.trim()).is_dir())
}

/// The folder of what a profile compiles.
fn compiled(repository: &Repository, profile: &str) -> PathBuf {
    let target =
        std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| repository.root().join("target"), PathBuf::from);
    target.join(if profile == "dev" { "debug" } else { profile })
}

/// The program, compiled.
fn program(repository: &Repository, profile: &str) -> Result<PathBuf, Error> {
    let mut build = Command::new(Repository::cargo());
    build.args(["build", "--locked", "--package", "hamel", "--bin", "hamel", "--profile", profile]);
    step(build.current_dir(repository.root()))?;
    Ok(compiled(repository, profile).join("hamel"))
}

/// The files of the program as an installation has them, below a prefix.
fn entries(repository: &Repository, program: &Path) -> Result<Vec<Entry>, Error> {
    let print = |arguments: &[&str]| -> Result<Vec<u8>, Error> {
        let output = Command::new(program).args(arguments).output();
        let output = output.map_err(|e| failed("hamel", format!("could not be started: {e}")))?;
        let step = || format!("hamel {}", arguments.join(" "));
        if output.status.success() {
            Ok(output.stdout)
        } else {
            Err(failed(&step(), output.status.to_string()))
        }
    };
    let mut entries = vec![Entry::program("bin/hamel", stripped(program)?)];
    for (shell, path) in SHELLS {
        entries.push(Entry::file(&format!("share/{path}"), print(&["completions", shell])?));
    }
    entries.push(Entry::file("share/man/man1/hamel.1", print(&["man"])?));
    for command in commands(&print(&["--help"])?) {
        let page = print(&["man", &command])?;
        entries.push(Entry::file(&format!("share/man/man1/hamel-{command}.1"), page));
    }
    for name in ["README.md", "LICENSE-MIT", "LICENSE-APACHE", "CHANGELOG.md"] {
        let path = repository.root().join(name);
        let bytes = std::fs::read(&path).map_err(|e| Error::io(path.display().to_string(), e))?;
        entries.push(Entry::file(&format!("share/doc/hamel/{name}"), bytes));
    }
    let notices = notices::text(repository)?;
    entries.push(Entry::file("share/doc/hamel/THIRD-PARTY.txt", notices.into_bytes()));
    Ok(entries)
}

/// The commands that the help of the program lists.
fn commands(help: &[u8]) -> Vec<String> {
    let help = String::from_utf8_lossy(help).into_owned();
    let lines = help.lines().skip_while(|line| *line != "Commands:").skip(1);
    let lines = lines.take_while(|line| line.starts_with("  "));
    let words = lines.filter_map(|line| line.split_whitespace().next());
    words.filter(|word| *word != "help").map(str::to_owned).collect()
}

/// The program without names of its functions.
fn stripped(program: &Path) -> Result<Vec<u8>, Error> {
    let copy = program.with_extension("stripped");
    let fail = |e| Error::io(copy.display().to_string(), e);
    std::fs::copy(program, &copy).map_err(fail)?;
    // Where there is no strip, the program is larger.
    if tool("strip", &["--version"]).is_some() {
        step(Command::new("strip").arg(&copy))?;
    }
    let bytes = std::fs::read(&copy).map_err(fail)?;
    std::fs::remove_file(&copy).map_err(fail)?;
    Ok(bytes)
}

/// The wheel for every Python from 3.10 on.
fn wheel(repository: &Repository, folder: &Path, profile: &str) -> Result<PathBuf, Error> {
    let wheels = folder.join("wheels");
    archive::clear(&wheels)?;
    let mut build = Command::new("maturin");
    build.args(["build", "--locked", "--strip", "--profile", profile]);
    build.args(["--manifest-path", "python/Cargo.toml", "--out"]).arg(&wheels);
    step(build.current_dir(repository.root()))?;
    only_file(&wheels)
}

/// The one file of a folder.
fn only_file(folder: &Path) -> Result<PathBuf, Error> {
    let fail = |e| Error::io(folder.display().to_string(), e);
    let entries = std::fs::read_dir(folder).map_err(fail)?;
    let paths: Vec<PathBuf> = entries.map(|e| Ok(e?.path())).collect::<Result<_, _>>().map_err(fail)?;
    match paths.as_slice() {
        [path] => Ok(path.clone()),
        _ => Err(failed("dist", format!("{} has {} files, not one", folder.display(), paths.len()))),
    }
}

/// The Debian package.
fn debian(folder: &Path, version: &str, entries: &[Entry]) -> Result<PathBuf, Error> {
    let architecture = tool("dpkg-deb", &["--version"]).and(tool("dpkg", &["--print-architecture"]));
    let architecture = architecture.ok_or_else(|| failed("dpkg --print-architecture", "is not there"))?;
    let architecture = architecture.trim();
    let tree = folder.join("debian");
    archive::clear(&tree)?;
    let size: usize = entries.iter().map(Entry::size).sum();
    archive::lay_out(&tree.join("usr"), entries)?;
    let control = format!(
        "Package: hamel\nVersion: {version}\nArchitecture: {architecture}\nMaintainer: the authors of hamel\n\
         Installed-Size: {}\nDepends: libc6, libgcc-s1\nSection: science\nPriority: optional\n\
         Description: generator of reduced equations of motion\n \
         hamel reads a mechanical system with symmetry as a paper states it, derives the\n \
         reduced equations of motion, and emits, evaluates and integrates them.\n",
        size.div_ceil(1024)
    );
    archive::lay_out(&tree, &[Entry::file("DEBIAN/control", control.into_bytes())])?;
    let path = folder.join(format!("hamel_{version}_{architecture}.deb"));
    step(Command::new("dpkg-deb").args(["--build", "--root-owner-group"]).arg(&tree).arg(&path))?;
    archive::remove(&tree)?;
    Ok(path)
}

/// The playground as a package for npm: the pages and the program for WASI, without the book.
fn npm(repository: &Repository, folder: &Path, version: &str) -> Result<PathBuf, Error> {
    let tree = folder.join("npm");
    archive::clear(&tree)?;
    let mut site = Command::new(std::env::current_exe().map_err(|e| Error::io("xtask", e))?);
    site.args(["site", "--no-book", "--no-pages", "--output"]).arg(tree.join("playground"));
    step(site.current_dir(repository.root()))?;
    let package = serde_json::json!({
        "name": "hamel",
        "version": version,
        "description": "hamel in the browser: a playground of static files",
        "license": "MIT OR Apache-2.0",
        "type": "module",
        "files": ["playground"],
        "exports": { "./*": "./playground/*" },
    });
    let package = Entry::file("package.json", package.to_string().into_bytes());
    archive::lay_out(&tree, &[package])?;
    step(Command::new("npm").args(["pack", "--silent", "--pack-destination", ".."]).current_dir(&tree))?;
    archive::remove(&tree)?;
    Ok(folder.join(format!("hamel-{version}.tgz")))
}

#[cfg(test)]
mod tests {
    use super::commands;

    #[test]
    fn commands_are_read_from_the_help() {
        let help = "Lists models\n\nUsage: hamel\n\nCommands:\n  new       Write\n  list      List\n  help      Print\n\nOptions:\n  -h\n";
        assert_eq!(commands(help.as_bytes()), ["new", "list"]);
    }
}
