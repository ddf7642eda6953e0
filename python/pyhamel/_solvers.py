"""A model as a function of CasADi or JAX, and its Jacobian as an operator of SciPy, with exact derivatives.

Deliberately does not know: what these do with it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from ._packages import needed

if TYPE_CHECKING:
    from ._model import Array, Model


def _by_time(model: Model, y: Array, t: float) -> Array:
    """``df/dt`` at fixed state, ``(n,)``."""
    return model.jvp(y, np.zeros_like(y), t, dt=1.0)


def of_scipy(model: Model, y: Array, t: float) -> Any:
    """A ``LinearOperator`` with products of the Jacobian at a state and of its transpose."""
    n, y = len(model.state), y.copy()
    return needed("scipy.sparse.linalg", "scipy").LinearOperator(
        (n, n),
        matvec=lambda v: model.jvp(y, np.ravel(v), t),
        rmatvec=lambda w: model.vjp(y, np.ravel(w), t),
        matmat=lambda v: model.jvp(y, np.asarray(v).T, t).T,
        rmatmat=lambda w: model.vjp(y, np.asarray(w).T, t).T,
        dtype=np.float64,
    )


def of_casadi(model: Model, name: str) -> Any:
    """A ``casadi.Callback`` from ``(t, y)`` to the rates, with its Jacobian by both."""
    needed("casadi", "casadi")
    import casadi

    n = len(model.state)
    dense = casadi.Sparsity.dense

    class Jacobian(casadi.Callback):
        def __init__(self, called: str, inputs: Any, outputs: Any, options: Any):
            casadi.Callback.__init__(self)
            self._names = (inputs, outputs)
            self.construct(called, options)

        def get_n_in(self) -> int:
            return 3

        def get_n_out(self) -> int:
            return 2

        def get_name_in(self, k: int) -> Any:
            return self._names[0][k]

        def get_name_out(self, k: int) -> Any:
            return self._names[1][k]

        def get_sparsity_in(self, k: int) -> Any:
            return [dense(1, 1), dense(n, 1), dense(n, 1)][k]

        def get_sparsity_out(self, k: int) -> Any:
            return [dense(n, 1), dense(n, n)][k]

        def eval(self, arguments: Any) -> Any:
            t, y = float(arguments[0]), np.asarray(arguments[1]).reshape(n)
            return [_by_time(model, y, t), model.jacobian(y, t)]

    class Rates(casadi.Callback):
        def __init__(self) -> None:
            casadi.Callback.__init__(self)
            # CasADi does not keep what it is given.
            self._jacobians: list[Any] = []
            self.construct(name, {})

        def get_n_in(self) -> int:
            return 2

        def get_n_out(self) -> int:
            return 1

        def get_name_in(self, k: int) -> str:
            return ["t", "y"][k]

        def get_name_out(self, k: int) -> str:
            return "rates"

        def get_sparsity_in(self, k: int) -> Any:
            return [dense(1, 1), dense(n, 1)][k]

        def get_sparsity_out(self, k: int) -> Any:
            return dense(n, 1)

        def eval(self, arguments: Any) -> Any:
            return [model.rhs(np.asarray(arguments[1]).reshape(n), float(arguments[0]))]

        def has_jacobian(self) -> bool:
            return True

        def get_jacobian(self, called: str, inputs: Any, outputs: Any, options: Any) -> Any:
            self._jacobians.append(Jacobian(called, inputs, outputs, options))
            return self._jacobians[-1]

    return Rates()


def of_jax(model: Model) -> Callable[..., Any]:
    """A function ``f(t, y, args=None)`` of JAX, whose derivatives forward and backward are exact."""
    jax, jnp = needed("jax", "jax"), needed("jax.numpy", "jax")
    n = len(model.state)

    def each(of: Callable[[Array, float], Array], tail: tuple[int, ...], t: Any, y: Any) -> Any:
        """Values at states and times with the same axes in front, or with one time for all."""
        times, states = np.asarray(t, dtype=np.float64), np.asarray(y, dtype=np.float64)
        if times.size == 1:
            return of(states, float(times.reshape(()))).astype(y.dtype)
        times = np.broadcast_to(times, states.shape[:-1])
        out = np.empty((*states.shape[:-1], *tail))
        for at in np.ndindex(times.shape):
            out[at] = of(states[at], float(times[at]))
        return out.astype(y.dtype)

    def called(of: Callable[[Array, float], Array], tail: tuple[int, ...], t: Any, y: Any) -> Any:
        shape = jax.ShapeDtypeStruct((*y.shape[:-1], *tail), y.dtype)
        return jax.pure_callback(
            lambda t, y: each(of, tail, t, np.asarray(y)), shape, t, y, vmap_method="expand_dims"
        )

    @jax.custom_jvp
    def rates(t: Any, y: Any) -> Any:
        return called(model.rhs, (n,), t, y)

    @rates.defjvp
    def along(primals: Any, tangents: Any) -> Any:
        (t, y), (dt, dy) = primals, tangents
        jacobian = called(model.jacobian, (n, n), t, y)
        by_time = called(lambda y, t: model.jvp(y, np.zeros_like(y), t, dt=1.0), (n,), t, y)
        # Matrix products, which JAX can transpose.
        return rates(t, y), jnp.einsum("...ij,...j->...i", jacobian, dy) + by_time * dt

    def f(t: Any, y: Any, args: Any = None) -> Any:
        y = jnp.asarray(y)
        return rates(jnp.asarray(t, dtype=y.dtype), y)

    return f
