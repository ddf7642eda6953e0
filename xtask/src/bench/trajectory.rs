//! Trajectories of the reference files, as arguments of the measuring program.
//!
//! Does not know: what is measured along them.

use hamel_run::Error;
use hamel_run::repository::Repository;
use serde_json::Value;

use super::program::failed;

/// A trajectory; numbers by name are `<name>=<value>` joined by commas.
pub(super) struct Trajectory {
    /// Time to reach from zero.
    pub(super) t_final: String,
    /// Parameters.
    pub(super) params: String,
    /// State at time zero.
    pub(super) initial: String,
    /// State at the end.
    pub(super) last: String,
}

impl Trajectory {
    /// The first trajectory of a model's reference file.
    ///
    /// # Errors
    /// As those of [`Trajectory::of`].
    pub(super) fn first(repository: &Repository, model: &str) -> Result<Trajectory, Error> {
        let first = Trajectory::of(repository, model)?.into_iter().next();
        first.ok_or_else(|| failed(format!("tests/reference/{model}.json has no trajectory")))
    }

    /// All trajectories of a model's reference file, in order.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Failed`] for a file that is none.
    pub(super) fn of(repository: &Repository, model: &str) -> Result<Vec<Trajectory>, Error> {
        let path = repository.root().join(format!("tests/reference/{model}.json"));
        let text = std::fs::read_to_string(&path).map_err(|e| Error::io(repository.shown(&path), e))?;
        let of = |reason: String| failed(format!("tests/reference/{model}.json: {reason}"));
        let file: Value = serde_json::from_str(&text).map_err(|e| of(e.to_string()))?;
        let text = |value: &Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
        let all = file["trajectories"].as_array().ok_or_else(|| of("there are no trajectories".into()))?;
        let read = |(k, trajectory): (usize, &Value)| {
            let numbers = |name: &str| {
                let object = trajectory[name]
                    .as_object()
                    .ok_or_else(|| of(format!("trajectory {} has no {name}", k + 1)))?;
                let pairs = object.iter().map(|(name, value)| format!("{name}={}", text(value)));
                Ok::<_, Error>(pairs.collect::<Vec<_>>().join(","))
            };
            Ok(Trajectory {
                t_final: text(&trajectory["t_final"]),
                params: numbers("params")?,
                initial: numbers("initial")?,
                last: numbers("final")?,
            })
        };
        all.iter().enumerate().map(read).collect()
    }
}
