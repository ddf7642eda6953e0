"""The linear system of a model near a point.

Deliberately does not know: how it is found.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ._errors import InputError
from ._packages import needed

if TYPE_CHECKING:
    from ._model import Model

__all__ = ["Linearization"]

Array = NDArray[np.float64]


class Linearization:
    """The linear system near a state ``y0`` with inputs ``u0``, which :meth:`Model.linearize` finds.

    ``y' = f + A (y - y0) + B (u - u0)`` and ``h = h0 + C (y - y0) + D (u - u0)``, where ``h`` are the outputs.
    """

    def __init__(self, model: Model, found: dict[str, Any]):
        #: The model with the inputs of the linear system.
        self.model = model
        #: Names of the state's components: rows of ``A`` and ``B``, columns of ``A`` and ``C``.
        self.state: tuple[str, ...] = tuple(found["state"])
        #: Names of the inputs: columns of ``B`` and ``D``.
        self.inputs: tuple[str, ...] = tuple(found["inputs"])
        #: Names of the outputs: rows of ``C`` and ``D``.
        self.outputs: tuple[str, ...] = tuple(found["outputs"])
        #: The state, ``(n,)``.
        self.y: Array = np.array([found["at"][name] for name in self.state], dtype=np.float64)
        #: The inputs, ``(m,)``.
        self.u: Array = np.array([found["hold"][name] for name in self.inputs], dtype=np.float64)
        #: The rates ``f`` there, ``(n,)``; zero at an equilibrium.
        self.rates: Array = np.array([found["rates"][name] for name in self.state], dtype=np.float64)
        #: What the state has that nobody gave; none where all of it was given.
        self.start: str | None = found.get("start")
        n, m, k = len(self.state), len(self.inputs), len(self.outputs)
        #: Derivatives ``df_i/dy_j`` of the rates by the state, ``(n, n)``.
        self.A: Array = _matrix(found["A"], n, n)
        #: Derivatives ``df_i/du_j`` of the rates by the inputs, ``(n, m)``.
        self.B: Array = _matrix(found["B"], n, m)
        #: Derivatives ``dh_i/dy_j`` of the outputs by the state, ``(k, n)``.
        self.C: Array = _matrix(found["C"], k, n)
        #: Derivatives ``dh_i/du_j`` of the outputs by the inputs, ``(k, m)``.
        self.D: Array = _matrix(found["D"], k, m)
        #: Eigenvalues of ``A``, ``(n,)``, the largest real part first. Symmetries and invariants give eigenvalues zero;
        #: :meth:`Model.trim` has those of the reduced space.
        self.eigenvalues: NDArray[np.complex128] = np.array(
            [complex(*z) for z in found["eigenvalues"]], dtype=np.complex128
        )

    def to_control(self) -> Any:
        """The system as a ``StateSpace`` of python-control, with the names of state, inputs and outputs.

        Its signals are the differences from the point. Needs control.

        Raises :class:`InputError` without inputs.
        """
        if not self.inputs:
            raise InputError(f"scene {self.model.scene} of {self.model.name} takes no inputs, which a StateSpace has")
        control = needed("control", "control")
        return control.StateSpace(
            self.A, self.B, self.C, self.D,
            states=list(self.state), inputs=list(self.inputs), outputs=list(self.outputs),
            name=self.model.name, remove_useless_states=False,
        )  # fmt: skip

    def _observing(self, names: Sequence[str]) -> None:
        """Takes outputs and components of the state as the outputs."""
        if isinstance(names, str):
            raise InputError(f"outputs is the text {names!r}: give a list of names")
        rows = {name: (np.eye(len(self.state))[k], np.zeros(len(self.inputs))) for k, name in enumerate(self.state)}
        rows.update({name: (self.C[k], self.D[k]) for k, name in enumerate(self.outputs)})
        for name in names:
            if name not in rows:
                listed = ", ".join(rows)
                raise InputError(f"outputs has no output `{name}`\n  outputs and components of the state: {listed}")
        n, m = len(self.state), len(self.inputs)
        self.C = np.array([rows[name][0] for name in names], dtype=np.float64).reshape(-1, n)
        self.D = np.array([rows[name][1] for name in names], dtype=np.float64).reshape(-1, m)
        self.outputs = tuple(names)

    def _repr_html_(self) -> str:
        from ._html import of_linearization

        return of_linearization(self)

    def __repr__(self) -> str:
        sizes = f"{len(self.state)} states, {len(self.inputs)} inputs, {len(self.outputs)} outputs"
        largest = max(self.eigenvalues.real, default=0.0)
        return f"<pyhamel.Linearization of {self.model.name}: {sizes}, largest real part {largest:.6g}>"


def linearization(model: Model, answer: str, outputs: Sequence[str] | None) -> Linearization:
    """The system of an answer, with these outputs in the place of the model's."""
    found = Linearization(model, json.loads(answer))
    if outputs is not None:
        found._observing(outputs)
    return found


def _matrix(rows: list[list[float]], n: int, m: int) -> Array:
    # A matrix without columns has no rows in JSON where nothing was asked for.
    return np.array(rows, dtype=np.float64).reshape(n, m)
