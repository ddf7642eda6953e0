//! Options that several commands share.
//!
//! Does not know: what a command does with them.

use std::collections::BTreeMap;

use clap::Args;

use crate::error::Problem;
pub(crate) use crate::run::asked::assignments;
use crate::run::asked::{self, Words};
use crate::run::choice::{Choice, Via};
use crate::run::forms::Forms;
use crate::run::info::Info;
use crate::run::method::MethodName;

/// Which scene of which model, and who evaluates it.
#[derive(Clone, Debug, Args)]
pub struct SceneOptions {
    /// Name of a model, or a path that ends in .hamel
    pub model: String,
    /// Name of the scene
    #[arg(long, default_value = "default")]
    pub scene: String,
    /// Who evaluates: machine code made in memory, the module that rustc compiled (models of hamel's repository, inside
    /// it), or the interpreter; values have the same bits [default: jit]
    #[arg(long, value_enum)]
    pub via: Option<Via>,
}

impl SceneOptions {
    /// The scene and who evaluates it.
    pub fn choice(&self) -> Choice {
        Choice { scene: self.scene.clone(), via: self.via }
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
    /// Integration method
    #[arg(long, value_enum, default_value_t)]
    pub method: MethodName,
    /// Relative tolerance [default: 1e-10]
    #[arg(long, value_parser = finite)]
    pub rtol: Option<f64>,
    /// Absolute tolerance [default: 1e-12]: errors below it do not count, so take less, or 0, for motions of less than
    /// atol/rtol
    #[arg(long, value_parser = finite)]
    pub atol: Option<f64>,
    /// Fixed step size instead of tolerances
    #[arg(long, value_name = "H", value_parser = finite)]
    pub step: Option<f64>,
    /// Largest number of steps, rejected ones included [default: 50000000, with fixed steps 1000000000]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub max_steps: Option<u64>,
}

impl MotionOptions {
    /// Parameters and components of the initial state that were given, by name; of a state in one of its forms.
    pub(crate) fn given(
        &self,
        info: &Info,
        forms: &Forms,
        problems: &mut Vec<Problem>,
    ) -> [BTreeMap<String, f64>; 2] {
        asked::given([&self.set, &self.initial], &Words::OPTIONS, info, forms, problems)
    }
}

pub(crate) fn assignment(text: &str) -> Result<(String, f64), String> {
    let Some((name, value)) = text.split_once('=') else {
        return Err("write it as name=value, such as m=1.5".into());
    };
    Ok((name.trim().to_owned(), finite(value)?))
}

pub(crate) fn finite(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(x) if x.is_finite() => Ok(x),
        _ => Err(format!("{text:?} is not a finite number")),
    }
}

/// A time above zero.
pub(crate) fn duration(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(t) if t.is_finite() && t > 0.0 => Ok(t),
        _ => Err("give a time above zero".into()),
    }
}
