//! What cargo does with a crate that generates its model: when it builds, when it does not, what it says.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A crate like this one in a directory of its own; it shares the target directory, and so the compiled generator.
struct Package {
    root: PathBuf,
    name: String,
}

impl Package {
    fn new(name: &str) -> Package {
        let here = Path::new(env!("CARGO_MANIFEST_DIR"));
        let root = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
        let _ = std::fs::remove_dir_all(&root);
        for folder in ["src", "models"] {
            std::fs::create_dir_all(root.join(folder)).unwrap();
        }
        for file in ["build.rs", "Cargo.lock"] {
            std::fs::copy(here.join(file), root.join(file)).unwrap();
        }
        for model in std::fs::read_dir(here.join("models")).unwrap() {
            let model = model.unwrap();
            std::fs::copy(model.path(), root.join("models").join(model.file_name())).unwrap();
        }
        let repository = here.ancestors().nth(2).unwrap().display();
        let manifest = format!(
            "[package]\nname = \"{name}\"\nedition = \"2021\"\n[workspace]\n\
             [dependencies]\nhamel-runtime = {{ path = \"{repository}/runtime\" }}\n\
             [build-dependencies]\nhamel-codegen = {{ path = \"{repository}/codegen\" }}\n"
        );
        std::fs::write(root.join("Cargo.toml"), manifest).unwrap();
        let library = "#![forbid(unsafe_code)]\n#![deny(warnings)]\nmod model { \
                       hamel_runtime::include_model!(\"suslov_gyrostat\"); }\n\
                       pub fn title() -> &'static str { model::INFO.params[6].doc }\n";
        std::fs::write(root.join("src/lib.rs"), library).unwrap();
        Package { root, name: name.to_owned() }
    }

    fn build(&self) -> Output {
        let target = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().unwrap();
        Command::new(env!("CARGO"))
            .args(["build", "--offline", "--message-format=json"])
            .current_dir(&self.root)
            .env("CARGO_TARGET_DIR", target)
            .output()
            .unwrap()
    }

    /// Builds, and says whether the library was there already.
    fn is_fresh(&self) -> bool {
        let output = self.build();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let messages = String::from_utf8(output.stdout).unwrap();
        let artifacts = messages.lines().map(|line| serde_json::from_str::<serde_json::Value>(line).unwrap());
        let library = artifacts
            .filter(|m| m["reason"] == "compiler-artifact" && m["target"]["name"] == self.name)
            .find(|m| m["target"]["kind"][0] == "lib");
        library.unwrap()["fresh"].as_bool().unwrap()
    }

    fn edit(&self, from: &str, to: &str) {
        let path = self.root.join("models/suslov_gyrostat.hamel");
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.contains(from));
        std::fs::write(path, text.replace(from, to)).unwrap();
    }

    fn files(&self) -> BTreeSet<PathBuf> {
        let mut files = BTreeSet::new();
        let mut open = vec![self.root.clone()];
        while let Some(folder) = open.pop() {
            for entry in std::fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() {
                    open.push(path);
                } else {
                    files.insert(path);
                }
            }
        }
        files
    }
}

#[test]
fn cargo_builds_again_when_the_model_changes_and_only_then() {
    let package = Package::new("hamel_rebuild");
    let before = package.files();
    assert!(!package.is_fresh());
    assert_eq!(package.files(), before, "everything goes to OUT_DIR");
    assert!(package.is_fresh());
    // A file of the package that is no model.
    std::fs::write(package.root.join("notes.txt"), "").unwrap();
    assert!(package.is_fresh());
    package.edit("about its axis", "about E3");
    assert!(!package.is_fresh());
    assert!(package.is_fresh());
}

#[test]
fn a_wrong_model_fails_the_build_with_its_place_and_a_hint() {
    let package = Package::new("hamel_wrong");
    package.edit("I*Omega)", "I*Omgea)");
    package.edit("Omega3 = 0", "Omega4 = 0");
    let output = package.build();
    assert!(!output.status.success());
    let message = String::from_utf8(output.stderr).unwrap();
    for part in [
        "Error: hamel generated nothing",
        "models/suslov_gyrostat.hamel:17:",
        "did you mean `Omega`?",
        "models/suslov_gyrostat.hamel:20:",
        "^^^^^",
    ] {
        assert!(message.contains(part), "{part} in {message}");
    }
    assert!(!message.contains("panicked"), "{message}");
}

/// A model that is right, of which each case below changes a part.
const PENDULUM: &str = "/// Pendulum
model suslov_gyrostat {
    /// Mass [kg].
    param m = 1 where m > 0;
    /// Length [m].
    param l = 1 where l > 0;
    /// Acceleration of gravity [m/s^2].
    param g = 9.81;
    /// Angle [rad].
    coordinate theta in angle;
    lagrangian = m*l^2*theta_dot^2/2 + m*g*l*cos(theta);
    scene small { want rhs; }
}
";

/// A change, and what cargo shows of it: the place, the text with a mark under it, what to change.
const MISTAKES: [(&str, &str, [&str; 4]); 9] = [
    (
        "param g = 9.81;",
        "param g = 9.81",
        ["expected `;`", ":8:19", "    param g = 9.81\n", "every item ends with `;`"],
    ),
    ("cos(theta)", "cos(thta)", ["unknown name `thta`", ":11:50", "^^^^", "did you mean `theta`?"]),
    ("m*g*l*cos", "m*g*cos", ["[kg m/s^2 (N)]", ":11:18", "^^^^", "correct a unit in a doc comment"]),
    (
        "coordinate theta in angle;",
        "coordinate theta in angle; coordinate x in real;",
        ["no inertia along x_dot", ":11:18", "^^^^", "needs kinetic energy in every direction"],
    ),
    (
        "param g = 9.81;",
        "param m = 9.81;",
        ["`m` is declared twice", ":8:11", "first as a parameter", "rename one"],
    ),
    (
        "lagrangian",
        "constraint theta_dot = 1; constraint theta_dot = 2; lagrangian",
        ["contradicts the others", ":11:42", "^^^^", "no velocity satisfies all of them"],
    ),
    ("want rhs;", "want jacobain;", ["is not an output", ":12:24", "^^^^^^^^", "did you mean `jacobian`?"]),
    ("9.81", "9.8.1", ["found `.`", ":8:18", "    param g = 9.8.1;", "a number has one point"]),
    ("9.81", "1/0", ["division by zero", ":8:17", "^", "the divisor vanishes identically"]),
];

/// What cargo shows of a build, without its own marks at the beginning of a line.
fn shown(package: &Package) -> String {
    let output = Command::new(env!("CARGO"))
        .args(["build", "--offline"])
        .current_dir(&package.root)
        .env("CARGO_TARGET_DIR", Path::new(env!("CARGO_TARGET_TMPDIR")).parent().unwrap())
        .output()
        .unwrap();
    String::from_utf8(output.stderr).unwrap()
}

#[test]
fn every_mistake_is_shown_with_its_place_and_its_cure() {
    let package = Package::new("hamel_mistakes");
    let build = |scenes: &str, file: &str| {
        format!(
            "fn main() -> Result<(), hamel_codegen::config::Problems> {{\n    hamel_codegen::Config::new(){scenes}\
             .emit_warnings(true).compile(&[\"models/{file}.hamel\"])\n}}\n"
        )
    };
    let script = package.root.join("build.rs");
    std::fs::write(&script, build("", "suslov_gyrostat")).unwrap();
    let model = package.root.join("models/suslov_gyrostat.hamel");
    let is_clean = |message: &str| {
        for noise in ["panicked", "RUST_BACKTRACE", "thread 'main'", "Os {", "\u{1b}["] {
            assert!(!message.contains(noise), "{noise} in {message}");
        }
    };
    for (from, to, parts) in MISTAKES {
        assert!(PENDULUM.contains(from));
        std::fs::write(&model, PENDULUM.replacen(from, to, 1)).unwrap();
        let message = shown(&package);
        for part in parts {
            assert!(message.contains(part), "{to}: {part} in {message}");
        }
        assert!(message.contains("models/suslov_gyrostat.hamel:"), "{message}");
        is_clean(&message);
    }
    // Mistakes of the script itself.
    std::fs::write(&model, PENDULUM).unwrap();
    for (scenes, file, parts) in [
        (
            "",
            "suslov",
            [
                "models/suslov.hamel cannot be read",
                "models has kite.hamel, loop.hamel, suslov_gyrostat.hamel",
            ],
        ),
        (
            ".scenes(\"suslov_gyrostat\", [\"smal\"])",
            "suslov_gyrostat",
            ["has no scene smal", "scenes: default, small"],
        ),
    ] {
        std::fs::write(&script, build(scenes, file)).unwrap();
        let message = shown(&package);
        for part in parts {
            assert!(message.contains(part), "{part} in {message}");
        }
        is_clean(&message);
    }
}
