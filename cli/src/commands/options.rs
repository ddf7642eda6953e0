//! Options that several commands share.
//!
//! Does not know: what a command does with them.

use std::path::Path;
use std::sync::Arc;

use clap::Args;

pub(crate) use hamel_run::asked::assignments;
use hamel_run::choice::{Choice, Via};
use hamel_run::error::Error;
use hamel_run::info::Info;
use hamel_run::inputs::{Between, InputTable};
use hamel_run::method::{MethodName, Steps};
pub(crate) use hamel_run::model::number as finite;
use hamel_run::model::{CONTROLLED_SCENE, Checked, DEFAULT_SCENE, STOCHASTIC_SCENE, units};
use hamel_run::noise::Noise;
use hamel_run::request::table::Table;
use hamel_run::session::{ModelFile, Session};

/// Which scene of which model, and who evaluates it.
#[derive(Clone, Debug, Args)]
pub struct SceneOptions {
    /// Name of a model, or a path that ends in .hamel
    pub model: String,
    /// Name of the scene
    #[arg(long, default_value = "default")]
    pub scene: String,
    /// Who evaluates: machine code made in memory, or the interpreter; values have the same bits [default: jit]
    #[arg(long, value_enum)]
    pub via: Option<Via>,
    /// What drives the inputs.
    #[command(flatten)]
    pub inputs: InputOptions,
}

/// What drives the inputs of a model.
#[derive(Clone, Debug, Default, Args)]
pub struct InputOptions {
    /// An input by an expression of the model's language in `t`, coordinates, velocities and parameters, or inputs by a
    /// table, a .csv with the columns `t` and names of inputs; the others are held; may be repeated
    #[arg(long = "input", value_name = "NAME=EXPRESSION|FILE.csv")]
    pub input: Vec<String>,
    /// What is between the rows of a table of inputs
    #[arg(long, value_enum, default_value_t, requires = "input")]
    pub interpolation: Between,
}

impl InputOptions {
    /// A model with the inputs that expressions drive.
    ///
    /// # Errors
    /// [`Error::Request`] for what is neither an expression with a name nor a table.
    pub fn drive<'s>(&self, file: ModelFile<'s>) -> Result<ModelFile<'s>, Error> {
        let mut driven = Vec::new();
        for input in self.input.iter().filter(|input| !is_table(input)) {
            let Some((name, value)) = input.split_once('=') else {
                let reason = format!("is {input:?}: write name=expression, or the name of a .csv");
                return Err(Error::unusable("--input", reason));
            };
            driven.push((name.trim().to_owned(), value.trim().to_owned()));
        }
        Ok(if driven.is_empty() { file } else { file.driven(&driven) })
    }

    /// The table, if one is given, in the units of a model.
    ///
    /// # Errors
    /// [`Error::Request`] for a second one, and for what is no table; [`Error::Io`].
    pub fn table(&self, model: &Checked) -> Result<Option<Arc<InputTable>>, Error> {
        let mut tables = self.input.iter().filter(|input| is_table(input));
        let Some(path) = tables.next() else { return Ok(None) };
        if tables.next().is_some() {
            return Err(Error::unusable("--input", "has two tables: put their columns into one"));
        }
        let (names, rows) = Table::read(Path::new(path))?.full(|name| units::of_column(model, name))?;
        Ok(Some(Arc::new(InputTable::new(path, &names, &rows, self.interpolation)?)))
    }
}

/// Whether inputs are given by a table.
pub(crate) fn is_table(input: &str) -> bool {
    !input.contains('=') && Path::new(input).extension().is_some_and(|ending| ending == "csv")
}

impl SceneOptions {
    /// The scene and who evaluates it. Where expressions drive every input, the scene that takes inputs is the default
    /// one.
    ///
    /// # Errors
    /// As [`InputOptions::table`], and problems of the model.
    pub fn choice_of(&self, file: &ModelFile<'_>) -> Result<Choice, Error> {
        let table = self.inputs.table(file.model()?)?;
        let choice = Choice { scene: self.scene.clone(), via: self.via, table };
        let takes_inputs = choice.scene == CONTROLLED_SCENE && file.is_driven();
        if takes_inputs && !file.model()?.scene_names().contains(&choice.scene) {
            return Ok(Choice { scene: DEFAULT_SCENE.to_owned(), ..choice });
        }
        Ok(choice)
    }

    /// The file of the model, whose inputs are driven as the options say.
    ///
    /// # Errors
    /// Unknown models, and as [`InputOptions::drive`].
    pub fn find<'s>(&self, session: &'s Session) -> Result<ModelFile<'s>, Error> {
        self.inputs.drive(session.find(&self.model)?)
    }
}

/// Which path of noises.
#[derive(Clone, Debug, Default, Args)]
pub struct NoiseOptions {
    /// Seed of the noises of a scene that has some [default: 0]
    #[arg(long, value_name = "N")]
    pub noise_seed: Option<u64>,
    /// Number of the path of noises; in an ensemble, that of the first trajectory [default: 0]
    #[arg(long, value_name = "N")]
    pub noise_path: Option<u32>,
    /// Grid on which increments of noises are drawn, a whole part of the step or a multiple: with the same grid all
    /// steps have the same path [default: the step]
    #[arg(long, value_name = "H", allow_negative_numbers = true, value_parser = duration)]
    pub noise_step: Option<f64>,
}

impl NoiseOptions {
    /// The scene with noise in the place of the default one, where a path is chosen.
    pub fn chooses(&self, choice: &mut Choice, model: &Checked) {
        let is_given = self.noise_seed.is_some() || self.noise_path.is_some() || self.noise_step.is_some();
        if is_given && choice.scene == DEFAULT_SCENE && !model.noises.is_empty() {
            choice.scene = STOCHASTIC_SCENE.to_owned();
        }
    }

    /// The path.
    ///
    /// # Errors
    /// [`Error::Request`] where the scene has no noise.
    pub fn path(&self, info: &Info) -> Result<Noise, Error> {
        let (seed, path) = (self.noise_seed.unwrap_or_default(), self.noise_path.unwrap_or_default());
        let noise = Noise { seed, path, step: self.noise_step };
        noise.suits(info).map_err(|reason| Error::unusable("--noise-seed", reason))?;
        Ok(noise)
    }
}

/// To where.
#[derive(Clone, Debug, Default, Args)]
pub struct EndOptions {
    /// Time to integrate to, from 0; negative for backward
    #[arg(long, value_name = "T", default_value_t = 10.0, allow_negative_numbers = true, value_parser = finite)]
    pub t_final: f64,
}

/// From where, and how.
#[derive(Clone, Debug, Default, Args)]
pub struct MotionOptions {
    /// Parameters that differ from the model's defaults
    #[arg(long, value_name = "NAME=VALUE", num_args = 1.., value_parser = assignment)]
    pub set: Vec<(String, f64)>,
    /// Components of the initial state; the others keep their default
    #[arg(long, value_name = "NAME=VALUE", num_args = 1.., value_parser = assignment)]
    pub initial: Vec<(String, f64)>,
    /// Integration method [default: dop853, of ensembles auto; midpoint where the scene has noise]
    #[arg(long, value_enum)]
    pub method: Option<MethodName>,
    /// Relative tolerance [default: 1e-10]
    #[arg(long, allow_negative_numbers = true, value_parser = finite)]
    pub rtol: Option<f64>,
    /// Absolute tolerance [default: 1e-12]: errors below it do not count, so take less, or 0, for motions of less than
    /// atol/rtol
    #[arg(long, allow_negative_numbers = true, value_parser = finite)]
    pub atol: Option<f64>,
    /// Fixed step size instead of tolerances
    #[arg(long, value_name = "H", allow_negative_numbers = true, value_parser = finite)]
    pub step: Option<f64>,
    /// Largest step where tolerances choose steps
    #[arg(long, value_name = "H", allow_negative_numbers = true, value_parser = finite)]
    pub max_step: Option<f64>,
    /// Largest number of steps, rejected ones included [default: 50000000, with fixed steps 1000000000]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub max_steps: Option<u64>,
}

impl MotionOptions {
    /// How steps are chosen.
    ///
    /// # Errors
    /// [`Error::Request`] for options that contradict each other.
    pub(crate) fn steps(&self) -> Result<Steps, Error> {
        let steps = Steps::new(self.method.unwrap_or_default(), self.rtol, self.atol, self.step)
            .map_err(|reason| Error::unusable("--step", reason))?;
        steps.within(self.max_step).map_err(|reason| Error::unusable("--max-step", reason))
    }
}

pub(crate) fn assignment(text: &str) -> Result<(String, f64), String> {
    let Some((name, value)) = text.split_once('=') else {
        return Err("write it as name=value, such as m=1.5".into());
    };
    Ok((name.trim().to_owned(), finite(value)?))
}

/// A time above zero.
pub(crate) fn duration(text: &str) -> Result<f64, String> {
    finite(text).ok().filter(|t| *t > 0.0).ok_or_else(|| "give a time above zero".into())
}

#[cfg(test)]
mod tests {
    use clap::ValueEnum as _;

    use super::MethodName;

    #[test]
    fn a_method_has_its_name_as_an_argument() {
        assert_eq!(MethodName::all().count(), MethodName::value_variants().len());
        for method in MethodName::value_variants() {
            let value = method.to_possible_value();
            assert_eq!(value.as_ref().map(|value| value.get_name()), Some(method.name()));
        }
    }
}
