//! `site`: the book, a page about each model, and a playground in which the program runs in the browser.
//!
//! Does not know: what the pages of models hold, how the playground works.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use clap::Args;
use hamel::commands::options::InputOptions;
use hamel::commands::report;
use hamel::output::terminal::bold;
use hamel_run::Error;
use hamel_run::model;
use hamel_run::repository::Repository;
use hamel_run::session::{ModelFile, Session};
use indicatif::{ProgressBar, ProgressStyle};

/// The program in a browser: files and a clock are there, processes and threads are not.
const TARGET: &str = "wasm32-wasip1";
/// System calls of such a program, by npm.
const SHIM: &str = "node_modules/@bjorn3/browser_wasi_shim/dist";
/// Where the list of models goes, with their kinds.
const PLACE_OF_MODELS: &str = "<!-- models -->";

/// Write the site: the book, a page about each model, and a playground
///
/// Every file is static, so that any web server shows it. The playground is the program itself, compiled for WASI; it
/// runs in a worker of the page and sends nothing anywhere.
#[derive(Clone, Debug, Args)]
#[command(after_help = "\
Needs: rustup target add wasm32-wasip1; npm; mdbook (cargo install mdbook), unless --no-book.

Examples:
  cargo xtask site
  cargo xtask site --no-book heavy_top euler_disk
  python3 -m http.server --directory target/site       then open what it says, and playground.html")]
pub(crate) struct Arguments {
    /// Models that get a page [default: all]
    models: Vec<String>,
    /// Folder to write [default: target/site]
    #[arg(short, long, value_name = "FOLDER")]
    output: Option<PathBuf>,
    /// Leave the book out
    #[arg(long)]
    no_book: bool,
    /// Leave the pages of models out
    #[arg(long)]
    no_pages: bool,
}

/// Writes the site and says where.
///
/// # Errors
/// [`Error::Failed`] with the tool that is missing or failed, and how it is installed; problems of models; files.
pub(crate) fn run(
    repository: &Repository,
    session: &Session,
    arguments: &Arguments,
) -> Result<String, Error> {
    let folder = arguments.output.clone().unwrap_or_else(|| repository.root().join("target/site"));
    let site = repository.root().join("site");
    let files = session.find_all(&arguments.models)?;
    let program = program(repository)?;
    if !site.join(SHIM).exists() {
        step(
            "npm",
            "npm comes with Node.js",
            Command::new("npm").args(["ci", "--no-audit", "--no-fund"]).current_dir(&site),
        )?;
    }
    make(&folder.join("models"))?;
    let statics = site.join("static");
    copy_all(&statics, &folder)?;
    copy_all(&site.join(SHIM), &folder.join("wasi"))?;
    copy(&program, &folder.join("hamel.wasm"))?;
    for file in &files {
        write(&folder.join(format!("models/{}.hamel", file.name())), file.text()?.as_bytes())?;
    }
    let names: Vec<&str> = files.iter().map(ModelFile::name).collect();
    write(&folder.join("models/index.json"), serde_json::Value::from(names).to_string().as_bytes())?;
    if !arguments.no_pages {
        pages(session, &files, &folder)?;
    }
    let front = read(&statics.join("index.html"))?;
    let front = front.replace(PLACE_OF_MODELS, &contents(&files, !arguments.no_pages)?);
    write(&folder.join("index.html"), front.as_bytes())?;
    if !arguments.no_book {
        let book =
            std::path::absolute(folder.join("book")).map_err(|e| Error::io("the folder of the site", e))?;
        let mut mdbook = Command::new("mdbook");
        mdbook.args(["build", "docs", "--dest-dir"]).arg(book).current_dir(repository.root());
        step("mdbook", "cargo install mdbook, or leave the book out with --no-book", &mut mdbook)?;
        bring_linked(repository.root(), &folder)?;
    }
    Ok(format!("wrote {}: {} models; any web server shows it", folder.display(), files.len()))
}

/// Compiles the program for the browser.
fn program(repository: &Repository) -> Result<PathBuf, Error> {
    let cargo = Repository::cargo();
    let fix = format!("rustup target add {TARGET}");
    let mut build = Command::new(cargo);
    // As small as the compiler makes it: it is loaded before anything is shown.
    build.args(["build", "--release", "--package", "hamel", "--bin", "hamel", "--target", TARGET]);
    step("cargo build", &fix, build.current_dir(repository.root()))?;
    let target =
        std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| repository.root().join("target"), PathBuf::from);
    Ok(target.join(TARGET).join("release/hamel.wasm"))
}

/// Runs a tool.
fn step(name: &str, fix: &str, command: &mut Command) -> Result<(), Error> {
    eprintln!("{}", bold(&format!("running {name}")));
    let failed =
        |status: String| Error::Failed { step: name.to_owned(), status: format!("{status}; needed: {fix}") };
    let status = command.status().map_err(|e| failed(format!("could not be started: {e}")))?;
    if status.success() { Ok(()) } else { Err(failed(status.to_string())) }
}

/// A page about each model, as `report` writes it.
fn pages(session: &Session, files: &[ModelFile<'_>], folder: &Path) -> Result<(), Error> {
    make(&folder.join("pages"))?;
    let bar = ProgressBar::new(files.len() as u64);
    // The template is a constant that indicatif accepts.
    let style = ProgressStyle::with_template("  {bar:40.cyan/blue} {pos} of {len} pages  {msg}");
    bar.set_style(style.expect("valid template"));
    let mut errors = Vec::new();
    for file in files {
        bar.set_message(file.name().to_owned());
        let arguments = report::Arguments {
            model: file.name().to_owned(),
            scene: model::DEFAULT_SCENE.to_owned(),
            output: Some(folder.join(format!("pages/{}.html", file.name()))),
            no_run: false,
            t_final: 10.0,
            step: None,
            inputs: InputOptions::default(),
        };
        errors.extend(report::run(session, &arguments).err());
        bar.inc(1);
    }
    bar.finish_and_clear();
    if errors.is_empty() { Ok(()) } else { Err(Error::Several { errors }) }
}

/// The models by topic, each with links to its page and to the playground.
fn contents(files: &[ModelFile<'_>], with_pages: bool) -> Result<String, Error> {
    let mut listed = Vec::new();
    for file in files {
        let model = file.model()?;
        let topic = model.topic.clone().unwrap_or_else(|| "Others".to_owned());
        listed.push((topic, file.name(), model::title(model)));
    }
    listed.sort();
    let mut text = String::new();
    for group in listed.chunk_by(|a, b| a.0 == b.0) {
        let _ = writeln!(text, "<h2>{}</h2>\n<ul class=\"models\">", escaped(&group[0].0));
        for (_, name, title) in group {
            let page = if with_pages { format!("pages/{name}.html") } else { format!("models/{name}.hamel") };
            let _ = writeln!(
                text,
                "<li><a href=\"{page}\">{name}</a> · <a href=\"playground.html#{name}\">try</a><span>{}</span></li>",
                escaped(title)
            );
        }
        text.push_str("</ul>\n");
    }
    Ok(text)
}

/// Brings the files of the repository that the book links to and that are no chapters: the root of the repository is
/// where the root of the site is, and the book is `docs`. mdbook calls every Markdown a page.
///
/// # Errors
/// [`Error::Failed`] for a link that leads nowhere; files.
fn bring_linked(root: &Path, site: &Path) -> Result<(), Error> {
    for page in pages_in(&site.join("book"))? {
        let text = read(&page)?;
        for link in text.split("href=\"").skip(1).filter_map(|rest| rest.split(['"', '#']).next()) {
            if link.is_empty() || link.contains(':') {
                continue;
            }
            let Some(target) = inside(site, &page, link).filter(|target| !site.join(target).exists()) else {
                continue;
            };
            let source = root
                .join(target.strip_prefix("book").map_or(target.clone(), |own| Path::new("docs").join(own)));
            let markdown = source.with_extension("md");
            let place = site.join(&target);
            make(place.parent().unwrap_or(site))?;
            if source.is_file() {
                copy(&source, &place)?;
            } else if markdown.is_file() {
                let text = escaped(&read(&markdown)?);
                let title = escaped(&markdown.file_name().unwrap_or_default().to_string_lossy());
                let page = format!(
                    "<!doctype html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n<title>{title}</title>\n\
                     <pre>{text}</pre>\n</html>\n"
                );
                write(&place, page.as_bytes())?;
            } else {
                let step = format!("the link {link} of {}", page.display());
                return Err(Error::Failed { step, status: "it leads to no file of the repository".into() });
            }
        }
    }
    Ok(())
}

/// Where a link of a page leads, from the root of the site; none where that is outside.
fn inside(site: &Path, page: &Path, link: &str) -> Option<PathBuf> {
    let mut parts: Vec<&str> =
        page.parent()?.strip_prefix(site).ok()?.iter().filter_map(|p| p.to_str()).collect();
    for part in link.split('/') {
        match part {
            "" | "." => {}
            ".." => _ = parts.pop()?,
            name => parts.push(name),
        }
    }
    Some(parts.iter().collect())
}

/// The pages of a folder and of those in it, but for the book in one piece, whose links are those of its root.
fn pages_in(folder: &Path) -> Result<Vec<PathBuf>, Error> {
    let failed = |e| Error::io(folder.display().to_string(), e);
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        if path.is_dir() {
            found.extend(pages_in(&path)?);
        } else if path.extension().is_some_and(|ending| ending == "html") {
            found.push(path);
        }
    }
    found.retain(|path| !["print.html", "404.html", "toc.html"].iter().any(|name| path.ends_with(name)));
    found.sort();
    Ok(found)
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

fn make(folder: &Path) -> Result<(), Error> {
    fs::create_dir_all(folder).map_err(|e| Error::io(folder.display().to_string(), e))
}

fn read(path: &Path) -> Result<String, Error> {
    fs::read_to_string(path).map_err(|e| Error::io(path.display().to_string(), e))
}

fn write(path: &Path, content: &[u8]) -> Result<(), Error> {
    fs::write(path, content).map_err(|e| Error::io(path.display().to_string(), e))
}

fn copy(from: &Path, to: &Path) -> Result<(), Error> {
    fs::copy(from, to).map(drop).map_err(|e| Error::io(from.display().to_string(), e))
}

/// Copies the files of a folder without its folders.
fn copy_all(from: &Path, to: &Path) -> Result<(), Error> {
    make(to)?;
    let entries = fs::read_dir(from).map_err(|e| Error::io(from.display().to_string(), e))?;
    for entry in entries {
        let entry = entry.map_err(|e| Error::io(from.display().to_string(), e))?;
        if entry.path().is_file() {
            copy(&entry.path(), &to.join(entry.file_name()))?;
        }
    }
    Ok(())
}
