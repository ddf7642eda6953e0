//! The module `pyhamel._hamel`: what the Python package does that is not Python.
//!
//! Everything goes through the library of the command `hamel`, so that a method of Python and a command have the same
//! answer and the same message.
//!
//! Deliberately does not know: mechanics, how a scene is evaluated or integrated, how the package looks in Python.

mod arrays;
mod ensemble;
mod errors;
mod fit;
mod fluid;
mod functions;
mod interrupts;
mod linear;
mod motion;
mod pool;
mod prepared;
mod robot;
mod rows;
mod scene;
// The models that the program comes with are those of the package.
#[path = "../../cli/src/shipped.rs"]
mod shipped;
mod stepper;
mod written;

use pyo3::prelude::*;

/// Scenes of models on arrays of numpy.
#[pymodule]
mod _hamel {
    #[pymodule_export]
    use crate::fit::{Fit, fit};
    #[pymodule_export]
    use crate::fluid::Fluid;
    #[pymodule_export]
    use crate::linear::linearize;
    #[pymodule_export]
    use crate::motion::{Motion, default_samples, ensemble, simulate, write_ensemble};
    #[pymodule_export]
    use crate::robot::import_robot;
    #[pymodule_export]
    use crate::scene::Scene;
    #[pymodule_export]
    use crate::stepper::Stepper;
    #[pymodule_export]
    use crate::written::{all_units, certify, explain, formulations, generate, report, write_fmu};

    use pyo3::prelude::*;

    /// Names of the models that the package comes with.
    #[pyfunction]
    fn shipped() -> Vec<&'static str> {
        crate::shipped::SHIPPED.iter().map(|(name, _)| *name).collect()
    }

    /// Names of the methods of integration.
    #[pyfunction]
    fn methods() -> Vec<&'static str> {
        hamel_run::method::MethodName::all().map(hamel_run::method::MethodName::name).collect()
    }

    /// The version of the package.
    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
