"""Fits of a model to measured values.

Deliberately does not know: how unknowns are searched, what a unit is.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _hamel
from ._errors import InputError

if TYPE_CHECKING:
    from ._model import Model
    from ._results import Motion

__all__ = ["ChiSquare", "Fit", "Start"]

Array = NDArray[np.float64]
#: An interval of an unknown, open where an end is none.
Interval = tuple[Union[float, None], Union[float, None]]


class ChiSquare(NamedTuple):
    """A sum of squares in units of the standard deviations of errors."""

    #: For each degree of freedom: about one where model and errors are right.
    per_freedom: float
    #: The probability that independent normal errors alone leave at least as much.
    probability: float


class Start(NamedTuple):
    """A point from which the search started."""

    #: Values of the unknowns.
    values: dict[str, float]
    #: The sum of squares of the minimum that was found from there; none where none was.
    sum_of_squares: float | None


class Fit:
    """Unknowns with the least squares of residuals, their covariances, and the residuals.

    A fit pickles, and shows itself in a notebook.
    """

    def __init__(self, model: Model, native: _hamel.Fit, options: dict[str, Any]):
        self._native = native
        self._asked = (model, options)
        found = json.loads(native.json())
        #: The answer as ``hamel fit --json`` prints it.
        self.json: dict[str, Any] = found
        #: The model with the fitted parameters.
        self.model = model.with_params(**found["params"])
        #: The initial state of the fitted motion, ``(n,)``.
        self.y0: Array = np.array([found["initial"][name] for name in model.state])
        estimates = found["estimates"]
        #: Values of the unknowns by name.
        self.values: dict[str, float] = {name: one["value"] for name, one in estimates.items()}
        #: Their standard errors, to first order; none of a value that is held at an end of its bounds.
        self.errors: dict[str, float | None] = {name: one["error"] for name, one in estimates.items()}
        correlation = found["correlation"]
        #: Correlations of the unknowns, ``(k, k)``.
        self.correlation: Array = np.array([[correlation[i][j] for j in estimates] for i in estimates])
        deviations = np.array([error or 0.0 for error in self.errors.values()])
        #: Covariances of the unknowns, ``(J^T J)^-1``, times the mean square of residuals where ``sigma`` was not given,
        #: ``(k, k)``; zero for values at an end of their bounds.
        self.covariance: Array = self.correlation * np.outer(deviations, deviations)
        #: The sum of squares of residuals, in units of ``sigma`` where it was given, and of priors.
        self.sum_of_squares: float = found["sum_of_squares"]
        #: Values and priors beyond as many as determine the unknowns.
        self.degrees_of_freedom: int = found["degrees_of_freedom"]
        chi_square = found["chi_square"]
        #: The sum of squares against ``sigma``; none where it was not given.
        self.chi_square: ChiSquare | None = chi_square and ChiSquare(**chi_square)
        #: The part of the spread of the data, each column about its mean, that the motion explains: at most 1.
        self.explained: float = found["explained"]
        #: Whether errors of measurements of the size ``sigma``, where it was given, may leave these residuals.
        self.fits: bool = found["fits"]
        #: What the residuals say, in words.
        self.verdict: str = native.verdict
        #: Names of the compared columns.
        self.columns: tuple[str, ...] = tuple(native.columns)
        #: Root of the mean square of the residuals of each column.
        self.rms: dict[str, float] = {name: one["rms"] for name, one in found["columns"].items()}
        #: Times of the rows with values, from the start of the motion on, in the unit of the model, ``(N,)``.
        self.t: Array = native.t
        #: Values of each column in the unit of the model, ``(N,)``; NaN where the data have none.
        self.data: dict[str, Array] = dict(zip(self.columns, native.values.T))
        #: The fitted motion less the values, ``(N,)``; NaN where the data have none.
        self.residuals: dict[str, Array] = dict(zip(self.columns, native.residuals.T))
        #: Where the search started, ``restarts`` included.
        self.starts: list[Start] = [Start(one["from"], one["sum_of_squares"]) for one in found["starts"]]
        #: Number of motions that were integrated.
        self.evaluations: int = found["evaluations"]
        #: Columns that were in another unit than the model's, in words.
        self.converted: tuple[str, ...] = tuple(native.converted)

    def __getitem__(self, name: str) -> float:
        """The value of an unknown by its name."""
        return self.values[name]

    @cached_property
    def motion(self) -> Motion:
        """The fitted motion to the last time of the data, with the method and the tolerances of the fit.

        201 samples at equal distances; ``fit.model.simulate(t, fit.y0)`` has others.
        """
        return self.model.simulate(float(self.t[-1]), self.y0, **self._asked[1])

    def svg(self) -> str:
        """The figure that ``hamel fit -o fit.svg`` writes: values and fitted motion, a panel for each column."""
        return self._native.svg()

    def _repr_html_(self) -> str:
        from ._html import of_fit

        return of_fit(self)

    def __repr__(self) -> str:
        values = ", ".join(f"{name} = {told(self.values[name], error)}" for name, error in self.errors.items())
        found = f"explains {100 * self.explained:.4f} % of the spread of the data"
        if self.chi_square is not None:
            found = f"chi-square {self.chi_square.per_freedom:.3g} per degree of freedom, {found}"
        return f"<pyhamel.Fit of {self.model.name}: {values}; {found}{'' if self.fits else ', does not fit'}>"

    def __reduce__(self) -> tuple[Any, ...]:
        model, options = self._asked
        return _restored, (model, self._native.kept(), options)


def _restored(model: Model, kept: str, options: dict[str, Any]) -> Fit:
    return Fit(model, _hamel.Fit.restored(model._native, kept), options)


def told(value: float, error: float | None) -> str:
    """A value with the digits that its standard error leaves."""
    if error is None:
        return f"{value:.6g} (at its bound)"
    if not 0 < error < abs(value):
        return f"{value:.6g} +- {error:.2g}"
    digits = math.floor(math.log10(abs(value))) - math.floor(math.log10(error)) + 2
    return f"{value:#.{min(digits, 17)}g} +- {error:#.2g}"


def fitted(
    model: Model,
    data: Any,
    start: Sequence[tuple[str, float]],
    wanted: dict[str, Any],
    options: dict[str, Any],
    progress: Callable[[int, float | None], object] | None,
) -> Fit:
    """The fit of a model, from the values of its parameters and a start."""
    path, columns_of_data = _table(data)
    names = wanted["columns"] or ()
    if isinstance(names, str):
        names = [names]
    columns = list(names.items()) if isinstance(names, Mapping) else [(name, name) for name in names]
    restarts, segments = int(wanted["restarts"]), int(wanted["segments"])
    if restarts < 0:
        raise InputError(f"restarts is {restarts}, but has to be 0 or more")
    if not 1 <= segments <= 1000:
        raise InputError(f"segments is {segments}, but has to be from 1 to 1000")
    asked = {
        "path": path,
        "columns_of_data": columns_of_data,
        "unknowns": list(wanted["unknowns"]),
        "columns": columns,
        "time": wanted["time"],
        "t0": _finite(wanted["t0"], "t0"),
        "sigma": [(name, _finite(x, f"sigma of {name}")) for name, x in (wanted["sigma"] or {}).items()],
        "bounds": [(name, _interval(name, given)) for name, given in (wanted["bounds"] or {}).items()],
        "prior": [(name, _normal(name, given)) for name, given in (wanted["prior"] or {}).items()],
        "restarts": restarts,
        "segments": segments,
        "y0": list(start),
    }
    steps = {name: value for name, value in options.items() if name != "noise" and value is not None}
    return Fit(model, _hamel.fit(model._native, asked, options, progress), {"method": "dop853", **steps})


def _finite(x: Any, what: str) -> float:
    try:
        value = float(x)
    except (TypeError, ValueError):
        raise InputError(f"{what} is {x!r}, which is no number") from None
    if not math.isfinite(value):
        raise InputError(f"{what} is {value}, which is not finite")
    return value


def _pair(what: str, name: str, given: Any, example: str) -> tuple[Any, Any]:
    try:
        first, second = given
    except (TypeError, ValueError):
        raise InputError(f"{what} of {name} is {given!r}: give {example}") from None
    return first, second


def _interval(name: str, given: Any) -> tuple[float, float]:
    ends = _pair("bounds", name, given, "the two ends of an interval, such as (0.1, 1.0) or (0.0, None)")
    open_ends = (-math.inf, math.inf)
    # An infinite end is an open one.
    least, most = (
        end if x is None or x == end else _finite(x, f"bounds of {name}") for x, end in zip(ends, open_ends)
    )
    return least, most


def _normal(name: str, given: Any) -> tuple[float, float]:
    mean, deviation = _pair("prior", name, given, "a value and its standard deviation, such as (0.4, 0.05)")
    return _finite(mean, f"prior of {name}"), _finite(deviation, f"prior of {name}")


#: A column: its name with numbers, or with the first of its words.
_Column = tuple[str, list[float], Union[str, None]]


def _table(data: Any) -> tuple[str | None, list[_Column]]:
    """The path of a file, or columns."""
    if isinstance(data, (str, os.PathLike)):
        return os.fspath(data), []
    # A data set of xarray has its coordinates as an index.
    if hasattr(data, "to_dataframe"):
        data = data.to_dataframe()
    if isinstance(data, Mapping):
        columns = [(str(name), column) for name, column in data.items()]
    elif hasattr(data, "columns") and hasattr(data, "__getitem__"):
        columns = [(str(name), data[name]) for name in data.columns]
        index = getattr(data, "index", None)
        name = getattr(index, "name", None)
        if name is not None and str(name) not in [own for own, _ in columns]:
            columns.insert(0, (str(name), index))
    elif isinstance(data, np.ndarray) and data.dtype.names is not None:
        columns = [(name, data[name]) for name in data.dtype.names]
    else:
        raise InputError(
            f"data is a {type(data).__name__}: give the path of a table, a dictionary of arrays by name, or a DataFrame"
        )
    return None, [_column(name, column) for name, column in columns]


#: Entries that stand for a value that is missing, as in files.
_MISSING = {"", "na", "n/a", "#n/a", "nan", "null", "none", "-", "--", "?", "<na>", "nat"}


def _column(name: str, column: ArrayLike) -> _Column:
    if isinstance(column, np.ma.MaskedArray):
        # An entry that is masked is none.
        column = column.tolist()
    array = np.asarray(column)
    if array.ndim != 1:
        raise InputError(f"data has {name} of shape {array.shape}: give one axis, a name for each component")
    if array.dtype.kind in "Mm":
        raise InputError(f"data has {name} as {array.dtype}: give numbers, such as seconds since the first row")
    if array.dtype.kind in "biuf":
        return name, array.astype(np.float64).tolist(), None
    numbers: list[float] = []
    words: list[tuple[int, str]] = []
    for row, entry in enumerate(array.tolist()):
        text = str(entry).strip()
        try:
            numbers.append(math.nan if text.lower() in _MISSING else float(entry))
        except (TypeError, ValueError):
            numbers.append(math.nan)
            words.append((row, text))
    if words and not np.isfinite(numbers).any():
        return name, [], words[0][1]
    if words:
        row, text = words[0]
        raise InputError(f"row {row} of data {text!r} is not a finite number")
    return name, numbers, None
