//! FMUs as files: sources compiled by the C compiler that is there, and the archive.
//!
//! Deliberately does not know: what the sources compute.

use std::io::{Cursor, Write as _};
use std::path::Path;
use std::process::{Command, Stdio};

use hamel_codegen::scene::{self, BuiltScene, CModule, Fmu, Writing};
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

use super::opened::Opened;
use hamel_run::error::Error;
use hamel_run::model::Model;
use hamel_run::temporary::Temporary;

/// Writes the FMU of a scene to a file, in a folder that is made. An archive at its place is replaced; another file, by
/// force alone.
///
/// # Errors
/// [`Error::Request`] for scenes that are no FMU, without a C compiler, where it refuses the sources, on a platform
/// without a name here, for a file that is there and no FMU, and for a name that does not end in .fmu; [`Error::Io`].
/// On an error nothing has been written.
pub fn write(path: &Path, by_force: bool, model: &Model, scene: &BuiltScene) -> Result<(), Error> {
    let file = open(path, by_force)?;
    let (_, bytes) = archive(model, scene)?;
    file.write(&bytes)
}

/// The file of an FMU as [`write`] takes it, opened before there is something to write.
///
/// # Errors
/// As [`write`], about the file.
pub(crate) fn open(path: &Path, by_force: bool) -> Result<Opened, Error> {
    let shown = path.display().to_string();
    if path.extension().is_none_or(|extension| !extension.eq_ignore_ascii_case("fmu")) {
        return Err(Error::unusable(shown, "is no FMU: let the name end in .fmu"));
    }
    if !by_force && std::fs::read(path).is_ok_and(|there| !there.is_empty() && !there.starts_with(b"PK")) {
        return Err(Error::unusable(shown, "is there and no FMU: give another name, or add --force"));
    }
    if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder).map_err(|e| Error::io(folder.display().to_string(), e))?;
    }
    Opened::new(path)
}

/// Name and bytes of the FMU of a scene, which begins at the initial state: description, sources, and the library that
/// the C compiler of this machine makes of them.
///
/// # Errors
/// [`Error::Request`] for scenes that are no FMU, without a C compiler, where it refuses the sources, and on a platform
/// without a name here; [`Error::Io`].
pub(crate) fn archive(model: &Model, scene: &BuiltScene) -> Result<(String, Vec<u8>), Error> {
    let initial = scene::start(model, scene).map_err(|e| Error::unusable(&model.name, e.to_string()))?;
    let (c, fmu) = scene
        .emit_fmu(&Writing::default(), initial)
        .map_err(|e| Error::unusable(format!("scene {} of {}:", scene.name(), model.name), e.to_string()))?;
    Ok((format!("{}.fmu", c.prefix), zipped(&c, &fmu)?))
}

/// The archive of description, sources and library.
fn zipped(c: &CModule, fmu: &Fmu) -> Result<Vec<u8>, Error> {
    let sources = [
        (format!("{}.h", c.prefix), &c.header),
        (format!("{}.c", c.prefix), &c.source),
        (format!("{}_fmu.c", c.prefix), &fmu.source),
    ];
    let (platform, extension) = platform()?;
    let name = format!("hamel-fmu-{}-{}", c.prefix, std::process::id());
    let temporary = Temporary::at(std::env::temp_dir().join(name));
    let folder = temporary.path();
    std::fs::create_dir_all(folder).map_err(|e| Error::io(folder.display().to_string(), e))?;
    for (name, text) in &sources {
        let path = folder.join(name);
        std::fs::write(&path, text).map_err(|e| Error::io(path.display().to_string(), e))?;
    }
    let library = format!("{}.{extension}", c.prefix);
    let binary = compile(folder, &c.prefix, &library)?;

    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    let mut add = |name: String, bytes: &[u8], options: SimpleFileOptions| {
        let written = zip.start_file(&name, options).map_err(std::io::Error::other);
        written.and_then(|()| zip.write_all(bytes)).map_err(|e| Error::io(format!("{name} in the FMU"), e))
    };
    add("modelDescription.xml".to_owned(), fmu.description.as_bytes(), options)?;
    add("sources/buildDescription.xml".to_owned(), fmu.build_description.as_bytes(), options)?;
    for (name, text) in &sources {
        add(format!("sources/{name}"), text.as_bytes(), options)?;
    }
    add(format!("binaries/{platform}/{library}"), &binary, options.unix_permissions(0o755))?;
    let written = zip.finish().map_err(|e| Error::io("the FMU", std::io::Error::other(e)))?;
    Ok(written.into_inner())
}

/// The name of this platform in an FMU, and the extension of shared libraries.
fn platform() -> Result<(String, &'static str), Error> {
    let architecture = match std::env::consts::ARCH {
        known @ ("x86_64" | "aarch64") => known,
        other => {
            let reason = format!(
                "is not made on {other}: use an x86_64 or aarch64 machine, or the files of --language c"
            );
            return Err(Error::unusable("an FMU", reason));
        }
    };
    let (system, extension) = match std::env::consts::OS {
        "linux" => ("linux", "so"),
        "macos" => ("darwin", "dylib"),
        other => {
            let reason = format!("is not made on {other}: use Linux or macOS, or the files of --language c");
            return Err(Error::unusable("an FMU", reason));
        }
    };
    Ok((format!("{architecture}-{system}"), extension))
}

/// The C compilers to try: the one that `CC` names, else those of usual names.
fn compilers() -> Vec<String> {
    match std::env::var("CC") {
        Ok(own) if !own.trim().is_empty() => vec![own],
        _ => ["cc", "gcc", "clang"].map(str::to_owned).to_vec(),
    }
}

/// Compiles the sources to a shared library and reads it.
fn compile(folder: &Path, prefix: &str, library: &str) -> Result<Vec<u8>, Error> {
    let tried = compilers();
    let answers = |name: &&String| {
        let ran = Command::new(name).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
        ran.is_ok_and(|status| status.success())
    };
    let Some(compiler) = tried.iter().find(answers) else {
        let reason = format!(
            "is compiled, and there is no C compiler ({}): install gcc or clang, or let CC name one",
            tried.join(", ")
        );
        return Err(Error::unusable("an FMU", reason));
    };
    let mut command = Command::new(compiler);
    command
        .current_dir(folder)
        .args(["-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared", "-fvisibility=hidden"])
        .args([format!("{prefix}.c"), format!("{prefix}_fmu.c")])
        .args(["-o", library, "-lm"])
        .stdin(Stdio::null());
    let output = command.output().map_err(|e| Error::io(format!("starting {compiler}"), e))?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr);
        let reason = format!("could not be compiled by {compiler}: {}", said.trim());
        return Err(Error::unusable(format!("the C of {prefix}"), reason));
    }
    let path = folder.join(library);
    std::fs::read(&path).map_err(|e| Error::io(path.display().to_string(), e))
}
