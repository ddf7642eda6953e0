"""What comes out: outputs of states, a motion, many motions.

Deliberately does not know: how anything is integrated or drawn.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from . import _hamel
from ._packages import needed

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.axes import Axes

    from ._model import Model

__all__ = [
    "Certificate",
    "Ensemble",
    "Event",
    "Explanation",
    "Formulation",
    "Formulations",
    "Motion",
    "Outputs",
    "Reduced",
]

Array = NDArray[np.float64]


class Reduced(NamedTuple):
    """A model that was reduced by its symmetries."""

    #: The reduced model in the model language.
    text: str
    #: Symmetries, with what they keep, and fields that were left out: a line each.
    report: tuple[str, ...]
    #: The dimension of the group.
    dim: int
    #: Variables of the reduced model as functions of the model, by which it is proved to be the quotient; a variable that is
    #: not listed is the one of the same name. None where the map was not found, or where Lagrangians differ by a rate.
    map: dict[str, str] | None


class Formulation(NamedTuple):
    """A way of writing a scene's equations that is proved to be the same motion, with what its rates cost."""

    #: What it is.
    title: str
    #: Whether it is the one that the scene has.
    is_own: bool
    #: Additions, multiplications, fused pairs and signs 1, divisions 5, roots 6, elementary functions 20.
    cost: int
    #: Cycles of the longest chain of operations, each on the result of the one before.
    chain: int
    #: Numbers that are computed once per set of parameters.
    prepared: int
    #: Bound of the rounding error of a rate, in units of what rounding the inputs does to it.
    error: float


class Formulations(NamedTuple):
    """The formulations of a scene; as text, the table of ``hamel explain --formulations``."""

    #: The cheapest first.
    found: tuple[Formulation, ...]
    #: Titles of others, with the reason for which each was left out.
    left_out: dict[str, str]
    #: The table.
    text: str

    def __str__(self) -> str:
        return self.text


class Certificate(NamedTuple):
    """Functions of a scene that were held to their definitions; as text, what ``hamel explain --certify`` prints."""

    #: Number of points.
    points: int
    #: The largest residual of each function, beside the terms of its row.
    held: dict[str, float]
    #: Functions that were not held, with reasons.
    open: dict[str, str]
    #: The table.
    text: str

    def __str__(self) -> str:
        return self.text


class Explanation(str):
    """What is known about a scene, as ``hamel explain`` prints it in some style; a notebook shows it typeset."""

    #: ``text``, ``latex`` or ``mathml``.
    style: str
    #: The parts by title, such as ``Equations of motion``; the first one has no title.
    sections: dict[str, str]
    _model: Model

    def __new__(cls, text: str, style: str, sections: dict[str, str], model: Model) -> Explanation:
        made = super().__new__(cls, text)
        made.style, made.sections, made._model = style, sections, model
        return made

    def __getnewargs__(self) -> tuple[Any, ...]:
        return str(self), self.style, self.sections, self._model

    def _repr_mimebundle_(self, include: Any = None, exclude: Any = None) -> dict[str, str]:
        bundle = {"text/plain": str(self)}
        if self.style != "latex":
            bundle["text/html"] = str(self if self.style == "mathml" else self._model.explain("mathml"))
        return bundle


class Outputs(Mapping[str, Array]):
    """Arrays ``(.., k)`` by the names of groups of outputs, parts of one array."""

    def __init__(self, groups: Sequence[tuple[str, Sequence[str], str]], values: Array):
        self._components = {name: tuple(components) for name, components, _ in groups}
        self._meanings = {name: doc for name, _, doc in groups}
        self._parts: dict[str, Array] = {}
        start = 0
        for name, components, _ in groups:
            end = start + len(components)
            self._parts[name] = values[..., start:end]
            start = end
        #: All of them, one group after the other.
        self.array = values

    def __getitem__(self, name: str) -> Array:
        return self._parts[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._parts)

    def __len__(self) -> int:
        return len(self._parts)

    def components(self, name: str) -> tuple[str, ...]:
        """Names of the components of a group."""
        return self._components[name]

    def meaning(self, name: str) -> str:
        """What a group is, with its unit."""
        return self._meanings[name]

    def __repr__(self) -> str:
        return f"Outputs({', '.join(f'{name}: {part.shape}' for name, part in self.items())})"


class Event(NamedTuple):
    """An event on the way."""

    #: Its name.
    name: str
    #: Its time.
    t: float
    #: The state there, before the event has changed it.
    y: Array


class Motion:
    """A motion: samples, events, and how it was integrated. It pickles, and shows itself as a figure in a notebook."""

    def __init__(self, model: Model, native: _hamel.Motion):
        self._native = native
        #: The model with the parameters of the motion.
        self.model = model
        #: Times of the samples, ``(k,)``: those that were reached.
        self.t: Array = native.t
        #: States of the samples, ``(k, n)``.
        self.y: Array = native.y
        #: Energies of the samples, ``(k,)``; none where the scene has no energy.
        self.energy: Array | None = native.energy
        #: Outputs of the samples, ``(k, ..)``.
        self.outputs = Outputs(_kept(model, native), native.outputs)
        #: Events in the order of time.
        self.events: list[Event] = [Event(*event) for event in native.events]
        #: The event that has ended the motion.
        self.ended_by: str | None = native.ended_by
        #: Singular positions that the motion has passed: times, and how many equations depend on the others there.
        self.singular_positions: list[tuple[float, int]] = native.singular_positions
        #: Time and state at the end.
        self.t_end, self.y_end = native.end
        #: Method, steps, evaluations, drift of the energy, residual of the constraint, seconds.
        self.stats: dict[str, Any] = native.stats
        n = len(model.state)
        along = native.along.reshape(len(self.t), len(native.along_end), n)
        #: Derivatives of the samples' states by each parameter or initial value that was asked for, ``(k, n)``.
        self.sensitivity: dict[str, Array] = {name: along[:, k] for k, (name, _) in enumerate(native.along_end)}
        #: Derivatives of the final state, ``(n,)``.
        self.sensitivity_end: dict[str, Array] = dict(native.along_end)

    @property
    def y0(self) -> Array:
        """The initial state, ``(n,)``."""
        return self._native.start[1]

    def __getitem__(self, name: str) -> Array:
        """A component of the state by its name, ``(k,)``."""
        return self.y[:, self.model.state.index(name)]

    def svg(self) -> str:
        """The figure that ``hamel simulate -o motion.svg`` writes."""
        return self._native.svg()

    def moving(self, samples: int = 601) -> str | None:
        """A page that plays the motion, the figure of ``hamel report``; none where the model says nothing to draw."""
        return self._native.moving(samples)

    def to_xarray(self) -> xarray.Dataset:
        """The samples as a data set: states, energy and outputs by name along ``t``. Needs xarray."""
        columns = {name: ("t", values) for name, values in self._columns().items()}
        found: xarray.Dataset = needed("xarray", "xarray").Dataset(columns, coords={"t": self.t}, attrs=self._about())
        return found

    def to_pandas(self) -> pandas.DataFrame:
        """The samples as a table: states, energy and outputs by name, with ``t`` as the index. Needs pandas."""
        package = needed("pandas", "pandas")
        found: pandas.DataFrame = package.DataFrame(self._columns(), index=package.Index(self.t, name="t"))
        found.attrs = self._about()
        return found

    def plot(self, *names: str, ax: Axes | None = None) -> Axes:
        """Draws columns over the time: components of the state, all unless others are named, ``energy``, and outputs.

        Names are those of :meth:`to_pandas` or of groups of outputs. On the axes ``ax`` of matplotlib, or on new ones,
        which are returned; units are at the axes or behind the names, and dotted lines are at events. Needs matplotlib.

        Raises :class:`InputError` for other names.
        """
        from ._plots import of_motion

        found: Axes = of_motion(self, names, ax)
        return found

    def _columns(self) -> dict[str, Array]:
        columns = {name: self.y[:, k] for k, name in enumerate(self.model.state)}
        if self.energy is not None:
            columns["energy"] = self.energy
        for group, values in self.outputs.items():
            for k, component in enumerate(self.outputs.components(group)):
                columns[f"{group}.{component}"] = values[:, k]
        for by, values in self.sensitivity.items():
            columns.update({f"d_{name}_d_{by}": values[:, k] for k, name in enumerate(self.model.state)})
        return columns

    def _about(self) -> dict[str, Any]:
        plain = {name: value for name, value in self.stats.items() if value is not None}
        return {"model": self.model.name, "scene": self.model.scene, **dict(self.model.params), **plain}

    def _repr_html_(self) -> str:
        from ._html import of_motion

        return of_motion(self)

    def __repr__(self) -> str:
        end = f", ended by {self.ended_by}" if self.ended_by else ""
        return (
            f"<pyhamel.Motion of {self.model.name} to t = {self.t_end!r}{end}: {len(self.t)} samples, "
            f"{self.stats['method']}, {self.stats['steps']} steps>"
        )

    def __reduce__(self) -> tuple[Any, ...]:
        return _restored, (self.model, self._native.kept())


def _kept(model: Model, native: _hamel.Motion) -> Sequence[tuple[str, Sequence[str], str]]:
    """The groups of outputs that samples have: all or none."""
    return model._groups if native.outputs.shape[1] else []


def _restored(model: Model, kept: str) -> Motion:
    return Motion(model, _hamel.Motion.restored(model._native, kept))


class Ensemble:
    """Many motions of one scene, side by side.

    What a trajectory has not reached is not a number in :attr:`y` and :attr:`energy`; :attr:`errors` says why.
    """

    def __init__(self, model: Model, found: dict[str, Any]):
        #: The model.
        self.model = model
        #: Times of the samples, ``(k,)``.
        self.t: Array = found["t"]
        #: States of the samples, ``(N, k, n)``.
        self.y: Array = found["y"]
        #: Energies of the samples, ``(N, k)``.
        self.energy: Array = found["energy"]
        #: Times reached, ``(N,)``.
        self.t_end: Array = found["t_end"]
        #: States there, ``(N, n)``.
        self.y_end: Array = found["y_end"]
        #: Initial states, ``(N, n)``.
        self.y0: Array = found["y0"]
        #: Parameters, ``(N, p)``, in the order of ``model.params``.
        self.params: Array = found["params"]
        #: Accepted steps of each, with those of the trajectories beside it, ``(N,)``.
        self.steps: NDArray[np.uint64] = found["steps"]
        #: Why a trajectory has stopped before the end; none where it has not.
        self.errors: list[str | None] = found["errors"]

    def __len__(self) -> int:
        return len(self.errors)

    def __getitem__(self, name: str) -> Array:
        """A component of the state by its name, ``(N, k)``."""
        return self.y[:, :, self.model.state.index(name)]

    @property
    def ok(self) -> NDArray[np.bool_]:
        """Which trajectories have reached the end, ``(N,)``."""
        return np.array([error is None for error in self.errors], dtype=bool)

    def to_xarray(self) -> xarray.Dataset:
        """States, energy and parameters by name, along ``trajectory`` and ``t``. Needs xarray."""
        columns: dict[str, Any] = {
            name: (("trajectory", "t"), self.y[:, :, k]) for k, name in enumerate(self.model.state)
        }
        columns["energy"] = (("trajectory", "t"), self.energy)
        columns.update({name: ("trajectory", self.params[:, k]) for k, name in enumerate(self.model.params)})
        columns["steps"] = ("trajectory", self.steps)
        columns["error"] = ("trajectory", np.array([error or "" for error in self.errors]))
        found: xarray.Dataset = needed("xarray", "xarray").Dataset(columns, coords={"t": self.t}, attrs=self._about())
        return found

    def to_pandas(self) -> pandas.DataFrame:
        """States, energy and parameters by name, a row for each ``trajectory`` and each ``t``. Needs pandas."""
        package = needed("pandas", "pandas")
        n_samples = len(self.t)
        columns = {name: self[name].reshape(-1) for name in self.model.state}
        columns["energy"] = self.energy.reshape(-1)
        columns.update({name: np.repeat(self.params[:, k], n_samples) for k, name in enumerate(self.model.params)})
        index = package.MultiIndex.from_product([range(len(self)), self.t], names=["trajectory", "t"])
        found: pandas.DataFrame = package.DataFrame(columns, index=index)
        found.attrs = self._about()
        return found

    def _about(self) -> dict[str, Any]:
        return {"model": self.model.name, "scene": self.model.scene}

    def __repr__(self) -> str:
        stopped = len(self) - int(self.ok.sum())
        return f"<pyhamel.Ensemble of {self.model.name}: {len(self)} trajectories, {stopped} stopped>"
