"""States that a loop moves on step by step, as controllers, filters and learning do.

Deliberately does not know: how a step is taken.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _hamel
from ._errors import InputError
from ._inputs import by_component

if TYPE_CHECKING:
    from ._model import Model

__all__ = ["Stepper"]

Array = NDArray[np.float64]
#: Values of all inputs in order, or of some by name.
Inputs = Union[ArrayLike, Mapping[str, ArrayLike], None]


class Stepper:
    """Moves states on by the time ``dt``, again and again, in storage that stays; :meth:`Model.stepper` makes it.

    States are arrays ``(n,)`` or ``(N, n)``; of several, eight are moved side by side with common steps, which keep the
    tolerances of each, and large arrays are shared out to threads. Results do not depend on how many there are.
    """

    def __init__(self, model: Model, dt: float, options: dict[str, Any]):
        #: The model, whose inputs are held while a state is moved.
        self.model = model
        #: The time of a step.
        self.dt = float(dt)
        #: Names of the inputs, in the order of the columns of ``u``.
        self.inputs: tuple[str, ...] = tuple(model._native.taken_inputs)
        self._native = _hamel.Stepper.of(model._native, self.dt, options)
        self._n = len(model.state)

    def step(
        self, y: ArrayLike, u: Inputs = None, *, t: float = 0.0, out: Array | None = None, threads: bool | None = None
    ) -> Array:
        """The states at ``t + dt`` of motions through the states ``y`` at ``t``, in the shape of ``y``.

        ``u`` are values that the inputs are held at meanwhile, ``(m,)`` for all states or ``(N, m)``, or some of them by
        name, the others as the model holds them; without ``u`` they are what the model has. ``out`` is an array to write
        to, contiguous rows of ``float64``, which may be ``y`` itself; nothing else is allocated then.

        Raises :class:`InputError` for other shapes, :class:`IntegrationError` for the first state that cannot be moved:
        it is the same in ``out`` as in ``y``, and all others have been moved.
        """
        if out is None:
            out = np.array(y, dtype=np.float64, order="C")
        elif out is not y:
            self._check(out)
            out[...] = y
        self._check(out)
        states = out if out.ndim == 2 else out.reshape(1, -1)
        held = None if u is None else self._held(u, states.shape[0])
        self._native.step(states, held, t, threads)
        return out

    def _check(self, y: Array) -> None:
        n = self._n
        if not isinstance(y, np.ndarray) or y.ndim not in (1, 2) or y.shape[-1] != n:
            shape = getattr(y, "shape", None)
            raise InputError(f"y is of shape {shape}, but has to be ({n},) or (N, {n}): {', '.join(self.model.state)}")
        if y.dtype != np.float64 or not (y.flags.c_contiguous and y.flags.aligned and y.flags.writeable):
            raise InputError("out has to be a writeable array of float64 in contiguous rows")

    def _held(self, u: Inputs, n_rows: int) -> Array:
        m = len(self.inputs)
        if not m:
            raise InputError(f"scene {self.model.scene} of {self.model.name} takes no inputs: leave u out")
        if isinstance(u, Mapping):
            u = self._by_name(u, n_rows)
        held = np.ascontiguousarray(u, dtype=np.float64)
        if held.shape != (n_rows, m):
            if held.shape != (m,) and held.shape != (1, m):
                raise InputError(
                    f"u is of shape {held.shape}, but has to be ({m},) or ({n_rows}, {m}): {', '.join(self.inputs)}"
                )
            held = np.ascontiguousarray(np.broadcast_to(held, (n_rows, m)))
        if not np.isfinite(held).all():
            raise InputError("u has to be finite")
        return held

    def _by_name(self, given: Mapping[str, ArrayLike], n_rows: int) -> Array:
        columns = by_component(self.model._native.input_arrays, given)[0]
        values = np.empty((n_rows, len(self.inputs)))
        for k, name in enumerate(self.inputs):
            value = columns.pop(name, self.model.inputs[name])
            if value is None:
                raise InputError(f"u lacks {name}, which a table drives: give its value as well")
            values[:, k] = value
        if columns:
            listed = ", ".join(self.inputs)
            raise InputError(f"scene {self.model.scene} of {self.model.name} has no input `{next(iter(columns))}`\n  inputs: {listed}")
        return values

    def __repr__(self) -> str:
        return f"<pyhamel.Stepper of {self.model.name}: dt = {self.dt!r}>"
