//! `generate` in a repository of its own.

use std::path::{Path, PathBuf};

use hamel::commands::{Command, Program, new};
use hamel_run::Error;
use hamel_run::session::Session;

use super::{Summary, generate};

struct Repository {
    root: PathBuf,
    repository: hamel_run::repository::Repository,
    session: Session,
}

impl Repository {
    fn new(name: &str) -> Repository {
        let root = std::env::temp_dir().join(format!("hamel-generate-{name}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&root);
        std::fs::create_dir_all(root.join("models/specs")).unwrap();
        let repository = hamel_run::repository::Repository::at(&root);
        Repository { session: Session::of_repository(repository.clone()), repository, root }
    }

    fn generate(&self, names: &[&str], check: bool) -> Result<Summary, Error> {
        let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
        generate(&self.repository, &self.session, &names, check)
    }

    fn new_model(&self, name: &str) -> Result<String, Error> {
        let program = Program { name: "cargo xtask", completed: "xtask", arguments: clap::Command::default };
        Command::New(new::Arguments { model: name.into() }).run(&self.session, &program)
    }

    fn spec(&self, name: &str, text: &str) {
        std::fs::write(self.root.join(format!("models/specs/{name}.hamel")), text).unwrap();
    }

    fn generated(&self, name: &str) -> PathBuf {
        self.root.join("models/src/generated").join(name)
    }

    fn files(&self) -> Vec<String> {
        let Ok(listing) = std::fs::read_dir(self.generated("")) else { return Vec::new() };
        let mut names: Vec<String> = listing.map(|f| f.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }
}

impl Drop for Repository {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.root);
    }
}

const ONE: &str = "/// One\nmodel one { coordinate x in real; lagrangian = 1/2*x_dot^2 - 2*x^2; scene quiet { want rhs; } }";
const TWO: &str = "/// Two\nmodel two { coordinate x in real; lagrangian = 1/2*x_dot^2 - x^2; }";

fn text(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap()
}

#[test]
fn all_or_named_models_are_generated_and_the_index_covers_all() {
    let repository = Repository::new("all");
    repository.spec("one", ONE);
    repository.spec("two", TWO);
    let done = repository.generate(&[], false).unwrap();
    assert_eq!((done.n_models, done.removed.len()), (2, 0));
    let files = repository.files();
    for name in ["mod.rs", "one.rs", "one_quiet.rs", "two.rs"] {
        assert!(files.iter().any(|f| f == name), "{files:?}");
    }
    let again = repository.generate(&[], false).unwrap();
    assert!(again.written.is_empty());
    repository.generate(&[], true).unwrap();

    // One model changes, and only its files.
    let index = text(&repository.generated("mod.rs"));
    repository.spec("one", &ONE.replace("2*x^2", "3*x^2"));
    match repository.generate(&[], true) {
        Err(error @ Error::Stale { .. }) => {
            let message = error.to_string();
            assert_eq!(error.exit_code(), 1);
            assert!(message.contains("models/src/generated/one.rs is out of date"), "{message}");
            assert!(message.contains("run: cargo xtask generate"), "{message}");
            assert!(!message.contains("two.rs"), "{message}");
        }
        other => panic!("{other:?}"),
    }
    let done = repository.generate(&["one"], false).unwrap();
    assert_eq!(done.n_models, 1);
    let is_of_one = |f: &PathBuf| f.file_name().unwrap().to_str().unwrap().starts_with("one");
    assert!(done.written.iter().all(is_of_one), "{done:?}");
    assert_eq!(text(&repository.generated("mod.rs")), index);
    repository.generate(&[], true).unwrap();

    // A model and its files go; what somebody wrote stays.
    std::fs::remove_file(repository.root.join("models/specs/two.hamel")).unwrap();
    std::fs::write(repository.generated("own.rs"), "// mine\n").unwrap();
    let done = repository.generate(&["one"], false).unwrap();
    assert!(done.removed.iter().any(|f| f.ends_with("two.rs")), "{done:?}");
    let files = repository.files();
    assert!(files.iter().any(|f| f == "own.rs") && !files.iter().any(|f| f == "two.rs"), "{files:?}");
    assert!(!text(&repository.generated("mod.rs")).contains("two"));
}

#[test]
fn nothing_is_written_when_a_model_fails_and_all_problems_are_told() {
    let repository = Repository::new("fails");
    repository.spec("good", &TWO.replace("two", "good"));
    repository.spec("one", &ONE.replace("x^2;", "y^2;"));
    repository.spec("two", &TWO.replace("x^2;", "z^2;"));
    let error = repository.generate(&[], false).unwrap_err();
    assert_eq!(error.exit_code(), 2);
    let message = error.to_string();
    assert!(
        message.contains("models/specs/one.hamel:2:") && message.contains("models/specs/two.hamel:2:"),
        "{message}"
    );
    assert_eq!(repository.files(), Vec::<String>::new());
}

#[test]
fn names_are_checked() {
    let repository = Repository::new("names");
    repository.spec("one", ONE);
    let error = repository.generate(&["oen", "xyzw"], false).unwrap_err();
    let message = error.to_string();
    assert!(
        message.contains("no model `oen`; did you mean `one`?") && message.contains("`xyzw`"),
        "{message}"
    );
    repository.spec("other", TWO);
    let error = repository.generate(&[], false).unwrap_err();
    assert!(matches!(&error, Error::Misnamed { model, .. } if model == "two"), "{error}");
}

#[test]
fn a_new_model_is_generated_with_the_others() {
    let repository = Repository::new("new");
    repository.spec("one", ONE);
    repository.new_model("sled").unwrap();
    assert!(matches!(repository.new_model("sled"), Err(Error::Exists { .. })));
    repository.generate(&["sled"], false).unwrap();
    let files = repository.files();
    for name in ["one.rs", "sled.rs", "sled_frictionless.rs", "sled_minimal.rs", "sled_reconstruction.rs"] {
        assert!(files.iter().any(|f| f == name), "{files:?}");
    }
}

#[test]
fn no_model_of_the_repository_has_a_warning() {
    let around = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let session = Session::of_repository(hamel_run::repository::Repository::around(around).unwrap());
    let mut models = Vec::new();
    for file in session.all().unwrap() {
        models.push(file.into_model().unwrap_or_else(|e| panic!("{e}")));
    }
    assert!(models.len() > 20, "only {} models", models.len());
    // What `new` writes has none either.
    let starter = include_str!("../../../cli/src/commands/starter.hamel").replace("NAME", "starter");
    models.push(session.parse("starter.hamel", &starter).unwrap_or_else(|e| panic!("{e}")));
    for model in models {
        assert!(model.warnings.is_empty(), "{}", model.warnings);
    }
}
