"""Mechanics with symmetry: reduced equations of motion, derived exactly, on arrays of numpy.

>>> import pyhamel
>>> top = pyhamel.load("heavy_top")
>>> top.state
('Omega1', 'Omega2', 'Omega3', 'Gamma1', 'Gamma2', 'Gamma3')
>>> motion = top.simulate(2.0, {"Omega3": 20.0}, params={"m": 2.0})
>>> float(motion.t[-1]), motion.y.shape
(2.0, (201, 6))

A model is a text (see docs/model-language.md), a file of it, or the name of one of the
models that come with the package, :func:`models`. Its equations are derived when it is loaded, compiled to machine code
in memory, and kept in the user's cache.
"""

from ._equilibria import Change, Equilibrium, Family
from ._errors import (
    Diagnostic,
    Error,
    FileError,
    FitError,
    InputError,
    IntegrationError,
    ModelError,
    ModelWarning,
    PackageError,
)
from ._fit import ChiSquare, Fit, Start
from ._fluid import Fluid, FluidMotion
from ._hamel import __version__
from ._linear import Linearization
from ._model import Model, Params, import_robot, load, methods, models
from ._results import Certificate, Ensemble, Event, Explanation, Formulation, Formulations, Motion, Outputs, Reduced
from ._stepper import Stepper

__all__ = [
    "Certificate",
    "Change",
    "ChiSquare",
    "Diagnostic",
    "Ensemble",
    "Equilibrium",
    "Error",
    "Event",
    "Explanation",
    "Family",
    "FileError",
    "Fit",
    "FitError",
    "Fluid",
    "FluidMotion",
    "Formulation",
    "Formulations",
    "InputError",
    "IntegrationError",
    "Linearization",
    "Model",
    "ModelError",
    "ModelWarning",
    "Motion",
    "Outputs",
    "PackageError",
    "Params",
    "Reduced",
    "Start",
    "Stepper",
    "__version__",
    "import_robot",
    "load",
    "methods",
    "models",
]
