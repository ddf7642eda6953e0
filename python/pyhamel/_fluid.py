"""Fluids that are moved as products of matrices.

Deliberately does not know: how a fluid is moved.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from . import _hamel

__all__ = ["Fluid", "FluidMotion"]

Array = NDArray[np.float64]


class FluidMotion(NamedTuple):
    """A motion of a fluid at its samples."""

    #: Times, (samples,).
    t: Array
    #: The modes that the model gives, (samples, modes).
    y: Array
    #: Energy, (samples,).
    energy: Array
    #: Casimirs, and outputs of a fluid that friction or forces move, by name, each (samples,).
    casimirs: dict[str, Array]
    #: All coefficients of the vorticity, (samples, n**2 - 1), in the order of :meth:`Fluid.waves`; None unless asked for.
    fields: Array | None
    #: All coefficients of each field that the flow carries, by name, each as ``fields``; None unless asked for.
    carried: dict[str, Array] | None


class Fluid:
    """A fluid on a torus or a sphere in su(N), moved as products of matrices; ``docs/book/fluids.md`` says what it may have.

    ``model`` is a path that ends in ``.hamel``, or the text of a model.

    >>> import pyhamel
    >>> flow = pyhamel.Fluid('''model flow {
    ...     param nu = 0.01 where nu >= 0;
    ...     algebra fluid = zeitlin(31);
    ...     momentum omega in fluid as *;
    ...     action right;
    ...     hamiltonian = -dot(omega, laplacian(fluid)^-1*omega);
    ...     force dh_domega = nu*laplacian(fluid)*omega;
    ...     output C2 = trace_power(fluid, omega, 2);
    ...     initial re_1_0 = 0.5;
    ...     initial im_1_2 = 0.3;
    ... }''')
    >>> motion = flow.simulate(1.0, step=0.05, samples=11)
    >>> motion.y.shape, bool(motion.casimirs["C2"][-1] < motion.casimirs["C2"][0])
    ((11, 2), True)

    Raises :class:`ModelError` with every problem of the text and its place, :class:`InputError` for a model with equations,
    which :func:`load` takes, :class:`FileError`.
    """

    def __init__(self, model: str | os.PathLike[str]):
        name = os.fspath(model)
        text = None
        if isinstance(model, str) and ("{" in model or "\n" in model):
            name, text = "<text>", model
        self._native = _hamel.Fluid.load(name, text)

    @property
    def name(self) -> str:
        """Name of the model."""
        return self._native.name

    @property
    def n(self) -> int:
        """Size of the matrices."""
        return self._native.n

    @property
    def surface(self) -> str:
        """``"torus"`` or ``"sphere"``."""
        return self._native.surface

    @property
    def modes(self) -> dict[str, float]:
        """The modes that the model gives, with their values at time zero; all others begin with zero."""
        return dict(self._native.modes)

    @property
    def carried(self) -> list[str]:
        """Names of the fields that the flow carries."""
        return self._native.carried

    @property
    def params(self) -> dict[str, float]:
        """Parameters with their values."""
        return {name: value for name, value, _ in self._native.params}

    def waves(self) -> list[tuple[int, int, bool]]:
        """All coefficients of a function in the order of :attr:`FluidMotion.fields`.

        ``(m1, m2)`` of the half set on the torus, real part before imaginary part (True); degree and order on the sphere,
        cosine before sine (True).
        """
        return self._native.waves()

    def simulate(
        self,
        t_final: float,
        y0: Mapping[str, float] | None = None,
        *,
        step: float,
        params: Mapping[str, float] | None = None,
        samples: int = 201,
        fields: bool = False,
    ) -> FluidMotion:
        """Moves the fluid from time zero to ``t_final`` by steps of one size, at most ``step``.

        ``y0`` are modes with other values than the model's, ``params`` parameters; ``fields`` has all coefficients of the
        vorticity and of carried fields at the samples.

        Raises :class:`InputError` for unknown names and parameters that the model refuses, :class:`IntegrationError` where
        the step is too long for its iteration.
        """
        native = self._native
        found = native.simulate((t_final, step, samples), dict(y0 or {}), dict(params or {}), fields)
        casimirs = dict(zip(native.casimirs, found["casimirs"].T))
        return FluidMotion(
            found["t"], found["y"], found["energy"], casimirs, found.get("fields"), found.get("carried")
        )

    def __repr__(self) -> str:
        return f"<Fluid {self.name}: {self.surface}, N = {self.n}>"
