//! What every command works with: the models that a name can mean, and the budget of their derivation.
//!
//! Does not know: commands, how a scene is evaluated.

use std::borrow::Cow;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use hamel_codegen::files::compose_file;
use hamel_codegen::quotient::{self, Step};
use hamel_codegen::spec::{self, MatrixFluid, Origin};

use crate::cache::Cache;
use crate::error::Error;
use crate::model::{self, Checked, Model};
use crate::repository::Repository;

/// Names and texts of models that are part of a program.
pub type Shipped = &'static [(&'static str, &'static str)];

/// The models there are, and how they are derived.
#[derive(Clone, Debug)]
pub struct Session {
    models: Models,
    budget: u64,
    /// Sizes that models take in the place of their own.
    sizes: Vec<(String, i64)>,
    cache: Cache,
    /// Whether nothing that was derived before is taken.
    is_anew: bool,
}

/// The models that have a name.
#[derive(Clone, Debug)]
enum Models {
    Repository(Repository),
    Shipped(Shipped),
}

impl Session {
    /// With the models of hamel's repository, which may be compiled.
    pub fn of_repository(repository: Repository) -> Session {
        Session::of(Models::Repository(repository))
    }

    /// With models that are part of the program.
    pub fn of_shipped(shipped: Shipped) -> Session {
        Session::of(Models::Shipped(shipped))
    }

    fn of(models: Models) -> Session {
        Session { models, budget: 1, sizes: Vec::new(), cache: Cache::none(), is_anew: false }
    }

    /// With so many times the default budget for every model.
    #[must_use]
    pub fn with_budget(self, budget: u64) -> Session {
        Session { budget, ..self }
    }

    /// With other sizes of every model than those of its text.
    #[must_use]
    pub fn with_sizes(self, sizes: Vec<(String, i64)>) -> Session {
        Session { sizes, ..self }
    }

    /// Sizes that models take in the place of their own.
    pub fn sizes(&self) -> &[(String, i64)] {
        &self.sizes
    }

    /// With a cache of what is derived from models.
    #[must_use]
    pub fn with_cache(self, cache: Cache) -> Session {
        Session { cache, ..self }
    }

    /// Which takes nothing that was derived before, and keeps nothing.
    #[must_use]
    pub fn anew(self) -> Session {
        Session { cache: Cache::none(), is_anew: true, ..self }
    }

    /// Whether a program may tell by heart what follows from the text of a model alone: not where everything is to be
    /// derived anew, or where sizes are other ones than in the text.
    pub fn may_know_by_heart(&self) -> bool {
        !self.is_anew && self.sizes.is_empty()
    }

    /// The repository whose models these are.
    pub fn repository(&self) -> Option<&Repository> {
        match &self.models {
            Models::Repository(repository) => Some(repository),
            Models::Shipped(_) => None,
        }
    }

    /// A path as shown to people.
    pub fn shown(&self, path: &Path) -> String {
        self.repository().map_or_else(|| path.display().to_string(), |r| r.shown(path))
    }

    /// Reads and checks the text of a model; `file` is shown in messages.
    ///
    /// # Errors
    /// [`Error::Models`] with every problem of the text.
    pub fn parse(&self, file: &str, text: &str) -> Result<Model, Error> {
        model::parse(file, text, self.budget)
    }

    /// As [`Session::parse`], with the texts of other models that scenes need: of files beside the one that `file` is,
    /// and otherwise of the models that are part of the program.
    ///
    /// # Errors
    /// As [`Session::parse`]; a model that cannot be read.
    pub fn parse_with_totals(&self, file: &str, text: &str) -> Result<Model, Error> {
        let path = Path::new(file);
        let text = self.composed(file, text.to_owned(), path.is_file().then_some(path))?;
        let model = self.parse(file, &text)?;
        let model = match path.is_file() {
            true => quotient::read_totals_of_file(model, path),
            false => quotient::read_totals(model, &mut |_, file| self.shipped(file)),
        };
        Ok(model?)
    }

    /// A text with the texts of its parts: of files beside its own, or of the models that are part of the program.
    fn composed(&self, shown: &str, text: String, path: Option<&Path>) -> Result<String, Error> {
        if let Some(path) = path {
            return Ok(compose_file(shown, path, text)?);
        }
        let origin = Origin { file: shown.to_owned(), text };
        Ok(spec::compose(origin, &mut |_, file| self.shipped(file))?.text)
    }

    /// All models that have a name, sorted.
    ///
    /// # Errors
    /// [`Error::Io`] when the repository's directory cannot be read.
    pub fn all(&self) -> Result<Vec<ModelFile<'_>>, Error> {
        let mut all: Vec<ModelFile<'_>> = match &self.models {
            Models::Repository(repository) => {
                let shelf = repository.shelf()?.into_iter();
                let file = |(name, path)| ModelFile::new(self, name, Source::File(path), None);
                self.compiled()?.into_iter().chain(shelf.map(file)).collect()
            }
            Models::Shipped(shipped) => {
                let file = |(name, text): &(&str, &'static str)| {
                    ModelFile::new(self, (*name).to_owned(), Source::Shipped(text), None)
                };
                shipped.iter().map(file).collect()
            }
        };
        all.sort_by(|a, b| a.name.cmp(&b.name));
        Ok(all)
    }

    /// The models that are compiled by rustc as part of the repository, sorted; none outside it.
    ///
    /// # Errors
    /// [`Error::Io`] when the repository's directory cannot be read.
    pub fn compiled(&self) -> Result<Vec<ModelFile<'_>>, Error> {
        let Some(repository) = self.repository() else { return Ok(Vec::new()) };
        let file = |(name, path)| ModelFile::new(self, name, Source::File(path), Some(repository));
        Ok(repository.specs()?.into_iter().map(file).collect())
    }

    /// The compiled models of arguments; all of them when there are none.
    ///
    /// # Errors
    /// [`Error::UnknownModel`] with the compiled models, also for one that is not compiled.
    pub fn find_compiled(&self, arguments: &[String]) -> Result<Vec<ModelFile<'_>>, Error> {
        let mut all = self.compiled()?;
        if arguments.is_empty() {
            return Ok(all);
        }
        let mut found = Vec::new();
        for argument in arguments {
            match all.iter().position(|file| file.name() == argument) {
                Some(at) => found.push(all.swap_remove(at)),
                None => {
                    let known = self.compiled()?.into_iter().map(|file| file.name).collect();
                    return Err(Error::UnknownModel { name: argument.clone(), known });
                }
            }
        }
        Ok(found)
    }

    /// The models of arguments; all when there are none.
    ///
    /// # Errors
    /// As [`Session::find`].
    pub fn find_all(&self, arguments: &[String]) -> Result<Vec<ModelFile<'_>>, Error> {
        if arguments.is_empty() {
            return self.all();
        }
        arguments.iter().map(|argument| self.find(argument)).collect()
    }

    /// The text of a file that a model names which is part of the program: another one of these.
    fn shipped(&self, file: &str) -> Result<Origin, String> {
        let Models::Shipped(shipped) = &self.models else { return Err("there is no such file".to_owned()) };
        let name = Path::new(file).file_stem().and_then(|name| name.to_str()).unwrap_or_default();
        let text = shipped.iter().find(|(own, _)| *own == name).map(|(_, text)| (*text).to_owned());
        let text = text.ok_or_else(|| format!("no model of the name `{name}` is part of the program"))?;
        Ok(Origin { file: format!("{name}.hamel"), text })
    }

    /// The model of an argument: a model's name, or a path that ends in `.hamel`.
    ///
    /// # Errors
    /// [`Error::UnknownModel`] with the models there are; [`Error::Io`] for a path that is no file.
    pub fn find(&self, argument: &str) -> Result<ModelFile<'_>, Error> {
        if argument.ends_with(".hamel") {
            let path = PathBuf::from(argument);
            let real = path.canonicalize().map_err(|e| Error::io(argument, e))?;
            let is_in = |r: &&Repository| {
                r.specs_folder().canonicalize().is_ok_and(|folder| real.parent() == Some(folder.as_path()))
            };
            let name = path.file_stem().and_then(|s| s.to_str()).unwrap_or_default().to_owned();
            let repository = self.repository().filter(is_in);
            return Ok(ModelFile::new(self, name, Source::File(path), repository));
        }
        let mut all = self.all()?;
        match all.iter().position(|file| file.name() == argument) {
            Some(at) => Ok(all.swap_remove(at)),
            None => Err(Error::UnknownModel {
                name: argument.to_owned(),
                known: all.into_iter().map(|file| file.name).collect(),
            }),
        }
    }
}

/// A model file, which is read when the model is first asked for.
#[derive(Debug)]
pub struct ModelFile<'s> {
    session: &'s Session,
    name: String,
    source: Source,
    repository: Option<&'s Repository>,
    /// Inputs by name, and the expressions that drive them.
    driven: Vec<(String, String)>,
    /// Sizes in the place of those of the text.
    sizes: Vec<(String, i64)>,
    model: OnceLock<Arc<Checked>>,
}

/// Where the text of a model is.
#[derive(Debug)]
enum Source {
    File(PathBuf),
    Shipped(&'static str),
}

impl<'s> ModelFile<'s> {
    fn new(
        session: &'s Session,
        name: String,
        source: Source,
        repository: Option<&'s Repository>,
    ) -> ModelFile<'s> {
        let (driven, sizes) = (Vec::new(), session.sizes.clone());
        ModelFile { session, name, source, repository, driven, sizes, model: OnceLock::new() }
    }

    /// Name of the file without its ending, which is that of the model for models that have a name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The file as shown to people.
    pub fn shown(&self) -> String {
        match &self.source {
            Source::File(path) => self.session.shown(path),
            Source::Shipped(_) => format!("{}.hamel", self.name),
        }
    }

    /// Its path, unless the program has it within itself.
    pub fn path(&self) -> Option<&Path> {
        match &self.source {
            Source::File(path) => Some(path),
            Source::Shipped(_) => None,
        }
    }

    /// The repository whose file it is, so that the model may have been generated and compiled.
    pub fn repository(&self) -> Option<&'s Repository> {
        self.repository.filter(|_| !self.is_driven() && self.sizes.is_empty())
    }

    /// The same model with inputs driven by expressions of its language; what was compiled of it has other inputs.
    #[must_use]
    pub fn driven(mut self, inputs: &[(String, String)]) -> ModelFile<'s> {
        self.driven.extend_from_slice(inputs);
        self.model = OnceLock::new();
        self
    }

    /// Another member of the family that the file is: with sizes in the place of those of its text.
    #[must_use]
    pub fn sized(mut self, sizes: &[(String, i64)]) -> ModelFile<'s> {
        if sizes.is_empty() {
            return self;
        }
        for (name, value) in sizes {
            self.sizes.retain(|(own, _)| own != name);
            self.sizes.push((name.clone(), *value));
        }
        self.model = OnceLock::new();
        self
    }

    /// Whether inputs are driven by expressions.
    pub fn is_driven(&self) -> bool {
        !self.driven.is_empty()
    }

    /// The model; warnings about it go to standard error the first time.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Models`] with every problem of the text, [`Error::Misnamed`].
    pub fn model(&self) -> Result<&Arc<Checked>, Error> {
        if let Some(model) = self.model.get() {
            return Ok(model);
        }
        let model = self.checked()?;
        model::show_warnings(&model.warnings);
        Ok(model)
    }

    /// The model; warnings about it are left to the caller, and told to nobody afterwards.
    ///
    /// # Errors
    /// As [`ModelFile::model`].
    pub fn checked(&self) -> Result<&Arc<Checked>, Error> {
        if let Some(model) = self.model.get() {
            return Ok(model);
        }
        let (shown, text) = (self.shown(), self.text()?);
        let model = self.with_totals(self.session.parse(&shown, &text)?)?;
        if self.repository.is_some() && model.name != self.name {
            return Err(Error::Misnamed { file: shown, model: model.name });
        }
        let model = if self.is_driven() {
            closed(&shown, &text, &model, (&self.driven, "--input"))?.1
        } else {
            model
        };
        let checked = Arc::new(Checked::new(model, self.session.cache.clone()));
        Ok(self.model.get_or_init(|| checked))
    }

    /// The model with the texts of the models that it is the quotient of, where a scene wants the map.
    fn with_totals(&self, model: Model) -> Result<Model, Error> {
        let model = match &self.source {
            Source::File(path) => quotient::read_totals_of_file(model, path),
            Source::Shipped(_) => quotient::read_totals(model, &mut |_, file| self.session.shipped(file)),
        };
        Ok(model?)
    }

    /// What the model says of others that it is the quotient of, proved.
    ///
    /// # Errors
    /// [`Error::Models`] with what does not hold, at its place; as [`ModelFile::model`].
    pub fn quotients(&self) -> Result<Vec<Step>, Error> {
        let model = self.checked()?;
        let steps = match &self.source {
            Source::File(path) => quotient::hold_file(model, path),
            Source::Shipped(_) => quotient::hold(model, &mut |_, file| self.session.shipped(file)),
        };
        steps.map_err(|problems| Error::Models { problems })
    }

    /// The text of the file, with the texts of its parts and the sizes that are asked for.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Models`] for a size that the text does not have.
    pub fn text(&self) -> Result<Cow<'static, str>, Error> {
        let text = match &self.source {
            Source::File(path) => {
                let text = std::fs::read_to_string(path).map_err(|e| Error::io(self.shown(), e))?;
                Cow::Owned(self.session.composed(&self.shown(), text, Some(path))?)
            }
            Source::Shipped(text) => Cow::Borrowed(*text),
        };
        if self.sizes.is_empty() {
            return Ok(text);
        }
        Ok(Cow::Owned(spec::with_sizes(&self.shown(), &text, &self.sizes)?))
    }

    /// The fluid of a file whose model is moved as products of matrices; none for a model with equations, which is then
    /// checked by nobody.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Models`] with every problem of the text.
    pub fn fluid(&self) -> Result<Option<MatrixFluid>, Error> {
        if self.model.get().is_some() {
            return Ok(None);
        }
        Ok(spec::matrix_fluid(&self.shown(), &self.text()?)?)
    }

    /// The model, owned.
    ///
    /// # Errors
    /// As [`ModelFile::model`].
    pub fn into_model(self) -> Result<Model, Error> {
        let model = Arc::clone(self.model()?);
        drop(self);
        Ok(Arc::try_unwrap(model).map_or_else(|shared| (**shared).clone(), Checked::into_model))
    }
}

/// The text and the model of a text with inputs driven by expressions; `asked` is how the user asks for it.
///
/// # Errors
/// [`Error::Request`] with what is wrong with the first of the expressions.
pub fn closed(
    shown: &str,
    text: &str,
    model: &Model,
    (driven, asked): (&[(String, String)], &str),
) -> Result<(String, Model), Error> {
    let mut items = String::new();
    for (name, value) in driven {
        let path = format!("{asked} {name}");
        if !model::is_one_expression(value) || !model::is_one_expression(name) {
            return Err(Error::unusable(path, format!("is {value:?}: give one expression")));
        }
        if model.inputs.is_empty() {
            return Err(Error::unusable(path, format!("is not possible: {} declares no input", model.name)));
        }
        let _ = write!(items, "\ndrive {name} = {value};");
        // Each by itself first, so that what is wrong is told with its name.
        let alone = spec::with_items(text, &format!("\ndrive {name} = {value};"));
        if let Err(problems) = spec::parse_within(model.graph.budget(), shown, &alone) {
            return Err(Error::unusable(path, model::first_message(&problems)));
        }
    }
    let problem = |problems: spec::Diagnostics| Error::unusable(asked, model::first_message(&problems));
    let closed = spec::with_items(text, &items);
    let driven = spec::parse_within(model.graph.budget(), shown, &closed).map_err(problem)?;
    Ok((closed, quotient::with_totals_of(driven, model)))
}
