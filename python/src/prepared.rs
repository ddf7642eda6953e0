//! A scene with values of its parameters, at one state or at eight side by side.
//!
//! Deliberately does not know: where a scene comes from, where states are.

use std::sync::{Arc, OnceLock};

use hamel_run::dynamics::{Dynamics, Factory as _, LaneDynamics, PreparedLanes, PreparedScene};
use hamel_run::error::Error;
use hamel_run::evaluate::prepare;
use hamel_run::interpreted::Built;
use hamel_runtime::F64x8;
use self_cell::self_cell;

/// What borrows from a scene.
pub(crate) struct Evaluated<'a> {
    one: PreparedScene<'a>,
    /// Values of the parameters on every lane.
    values: Vec<F64x8>,
    /// The scene with these, when first asked for.
    eight: OnceLock<Option<PreparedLanes<'a, F64x8>>>,
}

self_cell!(
    /// A scene and what borrows from it: the scene with values of its parameters.
    pub(crate) struct Prepared {
        owner: Arc<Built>,
        #[not_covariant]
        dependent: Evaluated,
    }
);

impl Prepared {
    /// The scene with these values.
    ///
    /// # Errors
    /// [`Error::Params`] where the scene does not allow them.
    pub(crate) fn with_values(built: Arc<Built>, values: &[f64]) -> Result<Prepared, Error> {
        Prepared::try_new(built, |built| {
            let one = prepare(&**built, values)?;
            let values = values.iter().copied().map(F64x8::splat).collect();
            Ok(Evaluated { one, values, eight: OnceLock::new() })
        })
    }

    /// At one state.
    pub(crate) fn one(&self) -> &dyn Dynamics {
        self.with_dependent(|_, evaluated| -> &dyn Dynamics { &*evaluated.one })
    }

    /// At eight states, of which each has the bits of one. `None` where these cannot be side by side.
    pub(crate) fn eight(&self) -> Option<&dyn LaneDynamics<F64x8>> {
        self.with_dependent(|built, Evaluated { values, eight, .. }| {
            eight.get_or_init(|| built.prepare_eight_lanes(values).ok()).as_deref()
        })
    }
}
