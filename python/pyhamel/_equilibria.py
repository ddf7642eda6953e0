"""Relative equilibria, families of them, and relative periodic orbits.

Deliberately does not know: how they are found.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ._model import Model

__all__ = ["Change", "Equilibrium", "Family"]


class Equilibrium:
    """A relative equilibrium: a state whose rates are drifts along symmetries, or a state of a relative periodic orbit."""

    def __init__(self, model: Model, symmetries: Sequence[str], found: Mapping[str, Any]):
        #: The model with the parameters and inputs of the equilibrium.
        self.model = model.with_params(**found["params"])
        if found["inputs"]:
            self.model = self.model.with_inputs(**found["inputs"])
        #: The state, ``(n,)``.
        self.y: NDArray[np.float64] = np.array([found["state"][name] for name in model.state])
        #: Values of the inputs.
        self.inputs: dict[str, float] = dict(found["inputs"])
        #: Drifts by the symmetries that they go along, such as ``x d/dy - y d/dx``.
        self.drifts: dict[str, float] = dict(zip(symmetries, found["drifts"]))
        #: The largest rate that is no drift.
        self.residual: float = found["residual"]
        #: ``stable``, ``asymptotically stable``, ``spectrally stable``, ``unstable``, or ``rigid``.
        self.verdict: str = found["verdict"]
        #: Eigenvalues on the reduced space that are not zero, the largest real part first.
        self.eigenvalues: NDArray[np.complex128] = np.array([complex(*z) for z in found["eigenvalues"]])
        #: The period of an orbit; none of an equilibrium.
        self.period: float | None = found.get("period")
        #: Floquet's multipliers of an orbit on the reduced space, the largest first; the eigenvalues are exponents.
        self.multipliers: NDArray[np.complex128] = np.array([complex(*z) for z in found.get("multipliers", ())])
        #: Numbers of eigenvalues zero that were taken out, by ``invariants``, ``symmetries`` and ``neutral`` directions.
        self.taken_out: dict[str, int] = dict(found["taken_out"])
        #: Numbers of positive, negative and zero eigenvalues of the second variation of the energy; none without it.
        self.energy: dict[str, int] | None = found.get("energy")
        #: The value of what a family goes along.
        self.along: float | None = found.get("along")

    def __getitem__(self, name: str) -> float:
        """A component of the state by its name."""
        return float(self.y[self.model.state.index(name)])

    def __repr__(self) -> str:
        state = ", ".join(f"{name}={x:.6g}" for name, x in zip(self.model.state, self.y))
        kind = "Equilibrium" if self.period is None else f"orbit of period {self.period:.9g}"
        return f"<pyhamel.{kind} of {self.model.name}: {self.verdict}, {state}>"


class Change(NamedTuple):
    """What happens along a family: ``fold``, ``divergence`` or ``flutter``."""

    kind: str
    at: Equilibrium


class Family(Sequence[Equilibrium]):
    """Equilibria or orbits along a parameter, an input, a component of the state, an invariant or an output."""

    def __init__(
        self,
        name: str,
        state: Sequence[str],
        equilibria: Sequence[Equilibrium],
        changes: Sequence[Change],
        end: str,
    ):
        self._equilibria = list(equilibria)
        #: What the family goes along.
        self.name = name
        #: Names of the state's components.
        self.state: tuple[str, ...] = tuple(state)
        #: What happens on the way.
        self.changes: list[Change] = list(changes)
        #: ``reached``, ``returned``, ``stuck`` or ``long``.
        self.end = end
        #: Values of what the family goes along, ``(k,)``.
        self.along: NDArray[np.float64] = np.array([e.along for e in equilibria])
        #: States, ``(k, n)``.
        self.y: NDArray[np.float64] = np.array([e.y for e in equilibria])
        #: The largest real part of an eigenvalue, ``(k,)``.
        self.growth: NDArray[np.float64] = np.array([max(e.eigenvalues.real, default=0.0) for e in equilibria])

    def __getitem__(self, index: Any) -> Any:
        return self._equilibria[index]

    def __len__(self) -> int:
        return len(self._equilibria)

    def __iter__(self) -> Iterator[Equilibrium]:
        return iter(self._equilibria)

    def plot(self, *names: str, ax: Axes | None = None) -> Axes:
        """Draws components of the state, ``period`` or ``growth`` (alone unless others are named) along the family.

        On the axes ``ax`` of matplotlib, or on new ones, which are returned. Lines are broken where equilibria are
        unstable, and changes are marked. Needs matplotlib.

        Raises :class:`InputError` for other names.
        """
        from ._plots import of_family

        found: Axes = of_family(self, names, ax)
        return found

    def __repr__(self) -> str:
        changes = ", ".join(f"{change.kind} at {change.at.along:.6g}" for change in self.changes)
        kind = "equilibria" if not self._equilibria or self._equilibria[0].period is None else "orbits"
        return f"<pyhamel.Family of {len(self)} {kind}{': ' if changes else ''}{changes}>"


def equilibrium(model: Model, answer: str) -> Equilibrium:
    """The first of an answer."""
    found = json.loads(answer)
    return Equilibrium(model, found["symmetries"], found["equilibria"][0])


def family(model: Model, name: str, answer: str) -> Family:
    """All of an answer, along ``name``."""
    found = json.loads(answer)

    def one(of: Mapping[str, Any]) -> Equilibrium:
        return Equilibrium(model, found["symmetries"], of)

    changes = [Change(change["change"], one(change["at"])) for change in found["changes"]]
    return Family(name, model.state, [one(of) for of in found["equilibria"]], changes, found["end"])
