"""A scene of a model, to be evaluated and integrated.

Deliberately does not know: how anything is derived or integrated, what results look like.
"""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any, Union, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _equilibria, _hamel
from ._arguments import U32, names, number, whole
from ._equilibria import Equilibrium, Family
from ._errors import FileError, InputError, ModelWarning
from ._fit import Fit, Interval, fitted
from ._inputs import by_component
from ._linear import Linearization, linearization
from ._results import Certificate, Ensemble, Explanation, Formulation, Formulations, Motion, Outputs, Reduced
from ._stepper import Inputs, Stepper

__all__ = ["Model", "Params", "import_robot", "load", "methods", "models"]

Array = NDArray[np.float64]
#: A state, complete and in order, or components by name.
State = Union[ArrayLike, Mapping[str, float], None]


def models() -> list[str]:
    """Names of the models that come with the package."""
    return _hamel.shipped()


def methods() -> list[str]:
    """Names of the methods of integration; ``docs/book/integrators.md`` compares them."""
    return _hamel.methods()


def load(
    model: str | os.PathLike[str],
    scene: str = "default",
    params: Mapping[str, float] | None = None,
    *,
    sizes: Mapping[str, int] | None = None,
    budget: int = 1,
    cache: bool = True,
) -> Model:
    """Derives and compiles a scene of a model.

    ``model`` is a path that ends in ``.hamel``, the name of a model that comes with the package (:func:`models`), or the
    text of a model. ``params`` are values that differ from the model's own, ``sizes`` another member of the family that
    a file with sizes is, ``budget`` what the derivation may take as a
    multiple of the default limits. What was derived is kept in the user's cache, unless ``cache`` is false.

    Raises :class:`ModelError` with every problem of the text and its place, :class:`InputError` for unknown names,
    :class:`FileError`. Warns of what probably does not mean what was meant, as :class:`ModelWarning`.
    """
    name = os.fspath(model)
    text = None
    if isinstance(model, str) and ("{" in model or "\n" in model):
        name, text = "<text>", model
    return _loaded(name, text, scene, params or {}, budget, cache, sizes=sizes or {}, warn=True)


def import_robot(
    path: str | os.PathLike[str],
    *,
    floating: bool = False,
    limits: str = "interval",
    lock: Sequence[str] = (),
    frames: Sequence[str] = (),
    bodies: bool = False,
) -> str:
    """The text of the model of a robot, for :func:`load`, from its description in URDF, MJCF or SDF.

    ``floating`` has the root move freely, which is at rest otherwise. ``limits`` says what becomes of the limits of
    joints: ``"interval"``, a motion that leaves them ends; ``"spring"``, smooth springs behind them; ``"none"``.
    ``lock`` names joints that are fixed where their coordinates are zero, ``frames`` links whose frames the model names;
    with ``bodies`` the model has a body for each link with mass, for ``center_of_mass``, ``centroidal_momentum`` and so on.
    ``docs/book/robots.md`` says what is taken.

    Raises :class:`ModelError` with every problem of the file and its place, :class:`InputError` for other limits,
    :class:`FileError`. Warns of contents that the model lacks, each kind once, as :class:`ModelWarning`.
    """
    text, notes = _hamel.import_robot(
        os.fspath(path), floating, limits, names("lock", lock), names("frames", frames), bodies
    )
    if notes:
        warnings.warn(notes, ModelWarning, stacklevel=2)
    return text


def _loaded(
    name: str,
    text: str | None,
    scene: str,
    params: Mapping[str, float],
    budget: int,
    cache: bool,
    *,
    sizes: Mapping[str, int] | None = None,
    warn: bool = False,
) -> Model:
    native = _hamel.Scene.load(
        name, text, scene, whole("budget", budget, least=1), _hamel.__file__ if cache else None, list((sizes or {}).items())
    )
    if warn and native.warnings:
        warnings.warn(native.warnings, ModelWarning, stacklevel=3)
    made = Model(native, cache)
    return made.with_params(**params) if params else made


def _restored(
    name: str,
    text: str,
    scene: str,
    values: list[float],
    budget: int,
    cache: bool,
    applied: tuple[tuple[Any, ...], ...] = (),
) -> Model:
    native = _hamel.Scene.load(name, text, scene, budget, _hamel.__file__ if cache else None)
    for each in applied:
        native = native.with_inputs(*each)
    made = Model(native.with_values(values), cache)
    made._applied = applied
    return made


class Params(Mapping[str, float]):
    """Values of the parameters of a scene by name, in its order; :meth:`Model.with_params` changes them."""

    def __init__(self, entries: Sequence[tuple[str, float, str]], values: Sequence[float]):
        self._values = {name: value for (name, _, _), value in zip(entries, values)}
        self._meanings = {name: doc for name, _, doc in entries}

    def __getitem__(self, name: str) -> float:
        return self._values[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def meaning(self, name: str) -> str:
        """What a parameter is, with its unit."""
        return self._meanings[name]

    def __repr__(self) -> str:
        return f"Params({', '.join(f'{name}={value!r}' for name, value in self.items())})"


class Model:
    """A scene of a model with values of its parameters.

    States are arrays whose last axis has the components in the order of :attr:`state`; axes in front are states side by
    side. Arrays of ``float64`` are read where they are, in whatever order and with whatever strides; those with more
    than two axes are copied where numpy cannot regard the axes in front as one. Everything else is converted first, which
    copies it. Large arrays are shared out to as many threads as there are cores, unless ``threads`` says true or
    false; results do not depend on it. No call holds the interpreter of Python while it computes.

    Models are not changed by anything, and may be shared by threads. They pickle as their text and parameters.
    """

    def __init__(self, native: _hamel.Scene, cache: bool = True):
        self._native = native
        self._cache = cache
        self._n = len(native.state)
        self._groups = native.outputs
        self._width = sum(len(components) for _, components, _ in self._groups)
        self._params = Params(native.params, native.values)
        self._state = tuple(native.state)
        # What was asked of the native scene besides its text, to ask it again.
        self._applied: tuple[tuple[Any, ...], ...] = ()
        # The last stepper, with what it was asked for.
        self._stepping: tuple[Any, Stepper] | None = None

    # What there is.

    @property
    def name(self) -> str:
        """Name of the model."""
        return self._native.name

    @property
    def scene(self) -> str:
        """Name of the scene: a choice of parameters, coordinates and outputs."""
        return self._native.scene

    @property
    def scenes(self) -> tuple[str, ...]:
        """Names of all scenes of the model."""
        return tuple(self._native.scenes)

    @property
    def title(self) -> str:
        """First line of the model's documentation."""
        return self._native.title

    @property
    def text(self) -> str:
        """The text of the model."""
        return self._native.text

    @property
    def state(self) -> tuple[str, ...]:
        """Names of the state's components in order."""
        return self._state

    @property
    def params(self) -> Params:
        """Values of the parameters."""
        return self._params

    @property
    def output_names(self) -> dict[str, tuple[str, ...]]:
        """Components of each group of outputs."""
        return {name: tuple(components) for name, components, _ in self._groups}

    @property
    def units(self) -> dict[str, str]:
        """Units of ``t``, parameters, inputs, the state, ``energy`` and outputs; empty where unknown, and for numbers."""
        return dict(_hamel.units(self._native))

    @property
    def conserves_energy(self) -> bool:
        """Whether there is an energy that is proved to be constant along the motion."""
        return self._native.conserves_energy

    def with_params(self, **params: float) -> Model:
        """The same scene with other values of parameters; nothing is derived again.

        Raises :class:`InputError` for names that it does not have, and for values that the model does not allow.
        """
        known = list(self._params)
        for name in params:
            if name not in self._params:
                listed = ", ".join(known)
                raise InputError(f"scene {self.scene} of {self.name} has no parameter `{name}`\n  parameters: {listed}")
        values = {**self._params, **params}
        made = Model(self._native.with_values([float(values[name]) for name in known]), self._cache)
        made._applied = self._applied
        return made

    @property
    def inputs(self) -> dict[str, float | None]:
        """Inputs with the values that they are held at; ``None`` for those that a table drives.

        A scene that takes none has those of its model, which it holds.
        """
        return {name: held for name, held, _ in self._native.inputs}

    def with_inputs(
        self,
        inputs: Mapping[str, Any] | None = None,
        /,
        *,
        interpolation: str | None = None,
        **more: Any,
    ) -> Model:
        """The same model with inputs driven; the default scene gives way to ``controlled``, which takes them.

        An input is a number (held), an expression of the model's language in ``t``, coordinates, velocities and
        parameters (``"0.2*sin(t)"``), or an array ``(N,)`` of values at the times of the array ``t``, ``(N,)``, or a
        function of one time, which is called at these times, once and for all. One that is a vector or a matrix is an
        array of its shape ``(m,)`` or ``(m, k)``, with the times in front where it changes, ``(N, m)``. Between the times
        are straight lines (``interpolation="linear"``), cubics (``"cubic"``; what is told where all columns are
        functions), or the value at the time before (``"hold"``). An expression becomes a part of the text, and has no
        error.

        Raises :class:`InputError` for names that are no inputs, and for what is none of these.
        """
        given, sampled = by_component(self._native.input_arrays, {**(inputs or {}), **more})
        drives = [(name, value) for name, value in given.items() if isinstance(value, str)]
        held: list[tuple[str, float]] = []
        columns: dict[str, Array] = {}
        for name, value in given.items():
            if isinstance(value, str):
                continue
            array = np.asarray(value, dtype=np.float64)
            if array.ndim > 1 or not np.all(np.isfinite(array)):
                raise InputError(f"inputs {name} has to be a finite number or an array of finite numbers with one axis")
            if array.ndim:
                columns[name] = array
            else:
                held.append((name, float(array)))
        if columns and len({len(column) for column in columns.values()}) > 1:
            listed = ", ".join(f"{name} ({len(column)},)" for name, column in columns.items())
            raise InputError(f"inputs have arrays of several lengths: {listed}")
        if interpolation is None:
            interpolation = "cubic" if sampled and sampled.issuperset(columns.keys() - {"t"}) else "linear"
        native = self._native
        applied = self._applied
        if drives:
            native = native.driven(drives, _hamel.__file__ if self._cache else None)
            for each in applied:
                native = native.with_inputs(*each)
        if held or columns:
            rows = np.stack(list(columns.values()), axis=-1).tolist() if columns else []
            asked = (held, list(columns), rows, interpolation)
            native = native.with_inputs(*asked)
            applied = (*applied, asked)
        made = Model(native, self._cache)
        made._applied = applied
        return made

    def with_scene(self, scene: str) -> Model:
        """Another scene of the same model, with the values of the parameters that both have and the same inputs.

        Raises :class:`InputError` where inputs are held or driven that the scene does not take.
        """
        other = _loaded(self._native.file, self.text, scene, {}, self._native.budget, self._cache)
        native = other._native
        for each in self._applied:
            native = native.with_inputs(*each)
        other = Model(native, self._cache)
        other._applied = self._applied
        shared = {name: value for name, value in self._params.items() if name in other._params}
        return other.with_params(**shared)

    # Values at states.

    def rhs(
        self,
        y: ArrayLike,
        t: float = 0.0,
        *,
        u: Mapping[str, float] | None = None,
        out: Array | None = None,
        threads: bool | None = None,
    ) -> Array:
        """Rates ``dy/dt = f(t, y)``, in the shape of ``y``, ``(.., n)``.

        ``u`` are inputs by name, for all states the same, as :meth:`with_inputs` takes them.
        ``out`` is an array of this shape to write to; it may not overlap ``y``. States are evaluated eight at a time in
        the registers of a core; each has the bits of a call on its own. Columns are faster than rows: an array in the
        order of Fortran has the numbers of a component side by side, and so has the result.

        Raises :class:`InputError` where something has no finite value, with the states and the reasons.
        """
        if u:
            return self.with_inputs(u).rhs(y, t, out=out, threads=threads)
        y = self._states(y)
        result = np.empty_like(y) if out is None else self._checked_out(out, y.shape)
        if y.ndim == 1:
            self._native.rhs_of_one(y, t, result)
            return result
        if y.ndim == 2:
            self._native.rhs(y, t, result, threads)
            return result
        return self._on_rows(self._native.rhs, y, t, result, y.shape[-1:], threads)

    def __call__(self, t: float, y: ArrayLike, *args: Any) -> Array:
        """The right-hand side as solvers call it, ``f(t, y)``: :func:`scipy.integrate.solve_ivp` takes a model."""
        return self.rhs(y, t)

    def jac(self, t: float, y: ArrayLike, *args: Any) -> Array:
        """The Jacobian as solvers call it, ``jac(t, y)``."""
        return self.jacobian(y, t)

    def casadi(self, name: str = "rates") -> Any:
        """The right-hand side as a function of CasADi from ``(t, y)`` to the rates, with exact Jacobians.

        A ``casadi.Callback``: keep it as long as what is made of it. Needs casadi.
        """
        from ._solvers import of_casadi

        return of_casadi(self, name)

    def jax(self) -> Any:
        """The right-hand side as a function ``f(t, y, args=None)`` of JAX, as ``diffrax.ODETerm`` takes it.

        Derivatives forward and backward are exact, ``vmap`` and ``jit`` work; numbers have the type of ``y``, which is
        ``float32`` unless JAX is told otherwise. Needs jax.
        """
        from ._solvers import of_jax

        return of_jax(self)

    def jacobian(self, y: ArrayLike, t: float = 0.0, *, threads: bool | None = None) -> Array:
        """Derivatives ``df_i/dy_j`` of the rates, ``(.., n, n)``; exact, by dual numbers."""
        y = self._states(y)
        shape = (*y.shape, self._n)
        return self._on_rows(self._native.jacobian, y, t, np.empty(shape), shape[-2:], threads)

    def jvp(
        self,
        y: ArrayLike,
        dy: ArrayLike,
        t: float = 0.0,
        *,
        dt: float = 0.0,
        dparams: Mapping[str, float] | None = None,
    ) -> Array:
        """Derivative of the rates along ``dy`` of the state, ``dt`` and ``dparams`` of the parameters, ``(.., n)``.

        ``sum_j df_i/dy_j dy_j + df_i/dt dt + sum_k df_i/dp_k dparams_k``, exact, by dual numbers.
        """
        y, dy = np.broadcast_arrays(self._states(y), self._states(dy, "dy"))
        along = dict.fromkeys(self._params, 0.0)
        for name, value in (dparams or {}).items():
            if name not in along:
                raise InputError(f"dparams has no parameter `{name}`\n  parameters: {', '.join(along)}")
            along[name] = float(value)
        pairs = np.concatenate([y, dy], axis=-1).reshape(-1, 2 * self._n)
        out = np.empty((len(pairs), self._n))
        self._native.jvp(pairs, list(along.values()), t, dt, out)
        return out.reshape(y.shape)

    def vjp(self, y: ArrayLike, w: ArrayLike, t: float = 0.0, *, threads: bool | None = None) -> Array:
        """Products ``sum_i w_i df_i/dy_j`` of the transposed Jacobian with ``w``, ``(.., n)``.

        Exact, by one backward pass, which is derived when it is first asked for. Raises :class:`InputError` where the
        scene has none, and where something has no finite value.
        """
        y, w = np.broadcast_arrays(self._states(y), self._states(w, "w"))
        pairs = np.concatenate([y, w], axis=-1).reshape(-1, 2 * self._n)
        out = np.empty((len(pairs), self._n))
        self._native.vjp(pairs, t, out, threads)
        return out.reshape(y.shape)

    def jacobian_operator(self, y: ArrayLike, t: float = 0.0) -> Any:
        """The Jacobian at a state, ``(n,)``, as a ``scipy.sparse.linalg.LinearOperator`` without a matrix.

        Its products are those of :meth:`jvp`, those of its adjoint :meth:`vjp`. Needs scipy.
        """
        from ._solvers import of_scipy

        state = self._states(y)
        if state.ndim != 1:
            raise InputError(f"y is of shape {state.shape}, but an operator is that of one state")
        return of_scipy(self, state, t)

    @property
    def velocities(self) -> tuple[str, ...]:
        """Velocities of the state that have rates of their own: components of accelerations, rows of the mass matrix."""
        return tuple(self._native.velocities)

    def inverse_dynamics(
        self, y: ArrayLike, a: ArrayLike, t: float = 0.0, *, threads: bool | None = None
    ) -> Array:
        """Forces ``tau = A a - f`` that have to act beside the model's for :attr:`velocities` to have the rates ``a``.

        ``(.., m)``, of states ``(.., n)`` and accelerations ``(.., m)`` whose axes in front are broadcast; along the
        virtual displacements of the velocities, in their units. By the recursion of Newton and Euler where bodies are
        linked (Luh, Walker, Paul 1980).

        Raises :class:`InputError` unless the scene says ``want inverse_dynamics;``, and where something has no finite
        value.
        """
        self._wanted("inverse_dynamics")
        y, a = self._states(y), np.asarray(a, dtype=np.float64)
        names = self.velocities
        if a.ndim == 0 or a.shape[-1] != len(names):
            raise InputError(f"a is of shape {a.shape}, but its last axis has to have {len(names)} components: {', '.join(names)}")
        try:
            shape = np.broadcast_shapes(y.shape[:-1], a.shape[:-1])
        except ValueError:
            raise InputError(f"y of shape {y.shape} and a of shape {a.shape} do not fit each other") from None
        pairs = np.concatenate([np.broadcast_to(x, (*shape, x.shape[-1])) for x in (y, a)], axis=-1)
        out = np.empty((*shape, len(names)))
        self._native.inverse_dynamics(
            pairs.reshape(-1, pairs.shape[-1]), t, out.reshape(-1, len(names)), threads
        )
        return out

    def mass_matrix(self, y: ArrayLike, t: float = 0.0, *, threads: bool | None = None) -> Array:
        """The mass matrix ``A`` of ``A udot = f``, ``(.., m, m)``, in the order of :attr:`velocities`.

        Raises :class:`InputError` unless the scene says ``want mass_matrix;``, and where something has no finite value.
        """
        m = len(self.velocities)
        return self._matrix("mass_matrix", y, t, (m, m), threads)

    def bias(self, y: ArrayLike, t: float = 0.0, *, threads: bool | None = None) -> Array:
        """The forces of :meth:`inverse_dynamics` at zero accelerations, ``(.., m)``; of scenes that ``want bias;``."""
        self._wanted("bias")
        return self.outputs(y, t, threads=threads)["bias"]

    def gravity(self, y: ArrayLike, t: float = 0.0, *, threads: bool | None = None) -> Array:
        """The forces that hold the system at rest where it is, ``(.., m)``; of scenes that ``want gravity;``."""
        self._wanted("gravity")
        return self.outputs(y, t, threads=threads)["gravity"]

    @property
    def reduces(self) -> tuple[str, ...]:
        """Files of the models that this one says to be the quotient of."""
        return tuple(self._native.total()[0])

    @property
    def total_state(self) -> tuple[str, ...]:
        """Components of the state of the model that this one is the quotient of; of scenes that ``want quotient;``."""
        return tuple(self._total()[0])

    @property
    def total_params(self) -> dict[str, float]:
        """Its parameters, with their defaults."""
        return dict(self._total()[1])

    def quotient(
        self,
        y: ArrayLike,
        params: Mapping[str, float] | None = None,
        t: float = 0.0,
        *,
        threads: bool | None = None,
    ) -> Array:
        """States of this scene, ``(.., n)``, by states ``y`` of the total system, ``(.., N)``: the map ``phi`` of ``reduces``.

        ``y`` has the components of :attr:`total_state`; ``params`` are parameters of the total system beside the defaults
        of :attr:`total_params`. The map takes motions to motions, of this scene with :meth:`quotient_params` as its
        parameters (Cortes, de Leon, Marrero, Martinez 2009, theorem 4.6).

        Raises :class:`InputError` unless the scene says ``want quotient;``, for names and shapes that do not fit, and
        where a state has no finite image.
        """
        rows, shape = self._of_total(y, params)
        out = np.empty((rows.shape[0], self._n))
        self._native.quotient(False, rows, t, out, threads)
        return out.reshape(*shape, self._n)

    def quotient_params(
        self, params: Mapping[str, float] | None = None, y: ArrayLike | None = None, t: float = 0.0
    ) -> dict[str, float]:
        """The parameters of this scene by those of the total system, for :meth:`with_params`.

        ``params`` are parameters of the total system beside the defaults of :attr:`total_params`. ``y`` is its state,
        ``(N,)``, which parameters that are momenta of the state need (``routh``).

        Raises :class:`InputError` as :meth:`quotient`.
        """
        self._wanted("quotient")
        if not self._params:
            return {}
        rows, shape = self._of_total(np.zeros(len(self.total_state)) if y is None else y, params)
        if shape:
            raise InputError(f"y has {len(shape) + 1} axes, but parameters are those of one state")
        out = np.empty((1, len(self._params)))
        self._native.quotient(True, rows, t, out, False)
        return dict(zip(self._params, out[0].tolist(), strict=True))

    @property
    def frames(self) -> tuple[str, ...]:
        """Names of the frames of the model."""
        return tuple(self._native.frames)

    def frame_poses(self, y: ArrayLike, t: float = 0.0, *, threads: bool | None = None) -> Array:
        """Poses of :attr:`frames` in space, ``(.., k, 4, 4)``: rotation from the frame's axes to those of space, and place.

        Raises :class:`InputError` unless the scene says ``want frame_poses;``.
        """
        numbers = self._of_frames("frame_poses", y, t, 12, threads)
        poses = np.zeros((*numbers.shape[:-1], 4, 4))
        poses[..., :3, :3] = numbers[..., 3:].reshape(*numbers.shape[:-1], 3, 3)
        poses[..., :3, 3] = numbers[..., :3]
        poses[..., 3, 3] = 1.0
        return poses

    def frame_twists(self, y: ArrayLike, t: float = 0.0, *, threads: bool | None = None) -> Array:
        """Twists of :attr:`frames` in their own axes, ``(.., k, 6)``: angular velocity ``w``, ``hat(w) = R^T R'``, then ``R^T p'``.

        Raises :class:`InputError` unless the scene says ``want frame_twists;``.
        """
        return self._of_frames("frame_twists", y, t, 6, threads)

    def frame_jacobians(self, y: ArrayLike, t: float = 0.0, *, threads: bool | None = None) -> Array:
        """Derivatives of the twists by :attr:`velocities`, ``(.., k, 6, m)``.

        Raises :class:`InputError` unless the scene says ``want frame_jacobians;``.
        """
        shape = (len(self.frames), 6, len(self.velocities))
        return self._matrix("frame_jacobians", y, t, shape, threads)

    def frame_drifts(self, y: ArrayLike, t: float = 0.0, *, threads: bool | None = None) -> Array:
        """Rates of the twists at zero accelerations, ``(.., k, 6)``, the rates of the Jacobians times the velocities.

        Raises :class:`InputError` unless the scene says ``want frame_drifts;``.
        """
        return self._of_frames("frame_drifts", y, t, 6, threads)

    def operational_space(self, y: ArrayLike, t: float = 0.0, *, threads: bool | None = None) -> Array:
        """Inverses of the inertias at :attr:`frames`, ``J A^-1 J^T``, ``(.., k, 6, 6)``: what a moment and a force on a frame,
        in its own axes, add to the rate of its twist.

        They have a value at every state. The inertia that a task of the rows ``r`` meets is
        ``numpy.linalg.inv(L[r][:, r])``, which exists where the task can be moved freely: not for all six rows of an arm
        of fewer than six joints, nor at singular positions. Raises :class:`InputError` unless the scene says
        ``want operational_space;``. Khatib 1987, equations 11 and 51.
        """
        return self._matrix("operational_space", y, t, (len(self.frames), 6, 6), threads)

    def center_of_mass(self, y: ArrayLike, t: float = 0.0, *, threads: bool | None = None) -> Array:
        """Place and velocity of the mass centre of all bodies in space, ``(.., 2, 3)``.

        Raises :class:`InputError` unless the scene says ``want center_of_mass;``.
        """
        self._wanted("center_of_mass")
        numbers = self.outputs(y, t, threads=threads)["center_of_mass"]
        return numbers.reshape(*numbers.shape[:-1], 2, 3)

    def center_of_mass_jacobian(self, y: ArrayLike, t: float = 0.0, *, threads: bool | None = None) -> Array:
        """Derivatives of the velocity of the mass centre by :attr:`velocities`, ``(.., 3, m)``.

        Raises :class:`InputError` unless the scene says ``want center_of_mass_jacobian;``.
        """
        return self._matrix("center_of_mass_jacobian", y, t, (3, len(self.velocities)), threads)

    def centroidal_momentum(self, y: ArrayLike, t: float = 0.0, *, threads: bool | None = None) -> Array:
        """Momentum of all bodies in the axes of space, ``(.., 6)``: the angular one about the mass centre, then the linear one.

        Raises :class:`InputError` unless the scene says ``want centroidal_momentum;``. Orin, Goswami, Lee 2013.
        """
        self._wanted("centroidal_momentum")
        return self.outputs(y, t, threads=threads)["centroidal_momentum"]

    def centroidal_momentum_matrix(self, y: ArrayLike, t: float = 0.0, *, threads: bool | None = None) -> Array:
        """Derivatives of :meth:`centroidal_momentum` by :attr:`velocities`, ``(.., 6, m)``.

        Raises :class:`InputError` unless the scene says ``want centroidal_momentum_matrix;``.
        """
        return self._matrix("centroidal_momentum_matrix", y, t, (6, len(self.velocities)), threads)

    def energy(self, y: ArrayLike, t: float = 0.0, *, threads: bool | None = None) -> Array:
        """The energy of states, ``(..)``; raises :class:`InputError` where the scene has none."""
        if not self._native.has_energy:
            raise InputError(f"scene {self.scene} of {self.name} has no energy: take another scene")
        y = self._states(y)
        return self._on_rows(self._native.energy, y, t, np.empty(y.shape[:-1]), (1,), threads)

    def outputs(self, y: ArrayLike, t: float = 0.0, *, threads: bool | None = None) -> Outputs:
        """The outputs of states: an array ``(.., k)`` for each group of ``k`` components, by its name."""
        y = self._states(y)
        out = np.empty((*y.shape[:-1], self._width))
        if self._width:
            self._on_rows(self._native.outputs_of, y, t, out, (self._width,), threads)
        return Outputs(self._groups, out)

    def check(self, y: ArrayLike, t: float = 0.0) -> None:
        """Raises :class:`InputError` where the equations cannot be evaluated, with the states and the reasons.

        Stricter than :meth:`rhs`: a divisor of which rounding errors have left nothing is found, too.
        """
        self._native.check(self._states(y).reshape(-1, self._n), t)

    # Motions.

    def simulate(
        self,
        t: float | ArrayLike,
        y0: State = None,
        params: Mapping[str, float] | None = None,
        *,
        method: str | None = None,
        rtol: float | None = None,
        atol: float | None = None,
        step: float | None = None,
        max_step: float | None = None,
        samples: int | None = None,
        events: Sequence[str] = (),
        sensitivity: Sequence[str] = (),
        inputs: Mapping[str, Any] | None = None,
        interpolation: str | None = None,
        knots: int = 1001,
        outputs: bool = True,
        max_steps: int | None = None,
        max_events: int | None = None,
        noise_seed: int = 0,
        noise_path: int = 0,
        noise_step: float | None = None,
    ) -> Motion:
        """The motion from an initial state at ``t = 0``.

        ``t`` is the final time, with ``samples`` samples at equal distances (201), or a span ``(0, T)``, or an array of
        more than two times, of which the first is zero; a motion backward has negative times. ``y0`` is a complete state, or
        components by name: those that are left out are the model's own, or chosen such that the constraints hold.
        ``params`` differ from the model's. ``rtol`` and ``atol`` are 1e-10 and 1e-12 unless given; ``step`` is for
        methods with fixed steps, ``max_step`` bounds those of the others. Events of the model happen; ``events`` are
        further functions of the state to watch, in the language of models, such as ``"Omega1 rising"``, named
        ``section1``, ``section2``, .. in the result. ``sensitivity`` names parameters and components of the initial
        state to differentiate by. ``inputs`` are as :meth:`with_inputs` takes them; functions of time without an array ``t`` are called at ``knots`` times at equal
        distances from the beginning to the end, with cubics between them. An interrupt of the keyboard ends the motion.
        ``method`` is ``"auto"`` unless it is given, and ``"midpoint"`` in a scene with noise, which takes a ``step``: the
        increments are those of the path ``noise_path`` of the seed ``noise_seed``, on the grid ``noise_step`` or, without
        one, the step.

        Raises :class:`IntegrationError` with the state reached, :class:`InputError`.
        """
        if params or inputs:
            if inputs and "t" not in inputs and any(callable(value) for value in inputs.values()):
                t_end = _times(t, 1)[0]
                at = np.linspace(min(t_end, 0.0), max(t_end, 0.0), max(int(knots), 2))
                inputs = {"t": at, **inputs}
            driven = self.with_inputs(inputs, interpolation=interpolation) if inputs else self
            return driven.with_params(**(params or {})).simulate(
                t, y0, method=method, rtol=rtol, atol=atol, step=step, max_step=max_step,
                samples=samples, events=events, sensitivity=sensitivity, outputs=outputs, max_steps=max_steps,
                max_events=max_events, noise_seed=noise_seed, noise_path=noise_path, noise_step=noise_step,
            )  # fmt: skip
        options = _options(method, rtol, atol, step, max_step, max_steps, (noise_seed, noise_path, noise_step))
        if samples is None:
            samples = 201 if step is None else _hamel.default_samples(self._native, _times(t, 1)[0], options["step"])
        t_final, times = _times(t, samples)
        native = _hamel.simulate(
            self._native, self._by_name(y0), t_final, times, options, names("events", events),
            names("sensitivity", sensitivity), None if max_events is None else whole("max_events", max_events), outputs,
        )  # fmt: skip
        for text in native.warnings:
            warnings.warn(text, RuntimeWarning, stacklevel=2)
        return Motion(self, native)

    def stepper(
        self,
        dt: float,
        *,
        method: str | None = None,
        rtol: float | None = None,
        atol: float | None = None,
        step: float | None = None,
        max_step: float | None = None,
        max_steps: int | None = None,
    ) -> Stepper:
        """What moves states on by ``dt`` again and again, without allocation: for loops that read states and set inputs.

        Methods with tolerances try ``dt`` as one step; those with fixed steps take it as one, unless ``step`` is given.
        The default scene gives way to ``controlled`` where the model has inputs, as in :meth:`with_inputs`.

        Raises :class:`InputError` for a method or steps that do not suit the scene, and for scenes with events that
        change the state.
        """
        return Stepper(self._with_inputs_taken(), dt, _options(method, rtol, atol, step, max_step, max_steps))

    def step(self, y: ArrayLike, u: Inputs = None, dt: float = 0.01, *, t: float = 0.0, **options: Any) -> Array:
        """The states a time ``dt`` after ``y``, with inputs held at ``u``, as :meth:`Stepper.step` says.

        The last :meth:`stepper` is kept for the next call with the same ``dt`` and ``options``.
        """
        asked = (dt, tuple(sorted(options.items())))
        if self._stepping is None or self._stepping[0] != asked:
            self._stepping = (asked, self.stepper(dt, **options))
        return self._stepping[1].step(y, u, t=t)

    @overload
    def ensemble(
        self,
        t: float,
        y0: Mapping[str, ArrayLike] | ArrayLike | None = None,
        params: Mapping[str, ArrayLike] | None = None,
        *,
        method: str | None = None,
        rtol: float | None = None,
        atol: float | None = None,
        step: float | None = None,
        max_step: float | None = None,
        samples: int = 1,
        max_steps: int | None = None,
        lanes: int = 8,
        threads: int | None = None,
        inputs: Mapping[str, ArrayLike] | None = None,
        noise_seed: int = 0,
        noise_path: int = 0,
        noise_step: float | None = None,
        paths: int | None = None,
        out: None = None,
        part: tuple[int, int] | None = None,
        resume: bool = False,
        statistics: Sequence[str] = (),
        quantiles: Sequence[float] = (0.05, 0.25, 0.5, 0.75, 0.95),
        bins: int = 50,
    ) -> Ensemble: ...

    @overload
    def ensemble(
        self,
        t: float,
        y0: Mapping[str, ArrayLike] | ArrayLike | None = None,
        params: Mapping[str, ArrayLike] | None = None,
        *,
        method: str | None = None,
        rtol: float | None = None,
        atol: float | None = None,
        step: float | None = None,
        max_step: float | None = None,
        samples: int = 1,
        max_steps: int | None = None,
        lanes: int = 8,
        threads: int | None = None,
        inputs: Mapping[str, ArrayLike] | None = None,
        noise_seed: int = 0,
        noise_path: int = 0,
        noise_step: float | None = None,
        paths: int | None = None,
        out: str | os.PathLike[str],
        part: tuple[int, int] | None = None,
        resume: bool = False,
        statistics: Sequence[str] = (),
        quantiles: Sequence[float] = (0.05, 0.25, 0.5, 0.75, 0.95),
        bins: int = 50,
    ) -> str: ...

    def ensemble(
        self,
        t: float,
        y0: Mapping[str, ArrayLike] | ArrayLike | None = None,
        params: Mapping[str, ArrayLike] | None = None,
        *,
        method: str | None = None,
        rtol: float | None = None,
        atol: float | None = None,
        step: float | None = None,
        max_step: float | None = None,
        samples: int = 1,
        max_steps: int | None = None,
        lanes: int = 8,
        threads: int | None = None,
        inputs: Mapping[str, ArrayLike] | None = None,
        noise_seed: int = 0,
        noise_path: int = 0,
        noise_step: float | None = None,
        paths: int | None = None,
        out: str | os.PathLike[str] | None = None,
        part: tuple[int, int] | None = None,
        resume: bool = False,
        statistics: Sequence[str] = (),
        quantiles: Sequence[float] = (0.05, 0.25, 0.5, 0.75, 0.95),
        bins: int = 50,
    ) -> Ensemble | str:
        """Many motions to the time ``t``, on all cores, eight side by side in the registers of each.

        ``y0`` is an array ``(N, n)`` of complete states, or components by name; ``params`` parameters by name. Each of
        them is a number for all trajectories, or ``N`` numbers. Results depend on neither ``threads`` nor the machine.
        A trajectory that stops says why in :attr:`Ensemble.errors`, and the others go on. ``inputs`` are held at a number
        for all trajectories, or at one for each; the scene has to take them. In a scene with noise each trajectory has
        a path of its own, from number ``noise_path`` on, and ``paths`` is the number of trajectories where nothing else
        says it; :meth:`simulate` has the rest.

        With ``out`` trajectories are written while they are integrated, and what became of them is returned as text: to
        a store (``.zarr``), CSV or NPZ, or ``statistics`` of them (``"mean"``, ``"variance"``, ``"quantiles"``,
        ``"histogram"``) to these or a figure (``.svg``). A store is interrupted, gone on with (``resume``) and shared as
        that of ``hamel ensemble``: ``part=(3, 16)`` integrates the third of sixteen shares, in a process of its own,
        such as a worker of Dask, and the bytes are those of one process.

        Raises :class:`InputError` for what is wrong with all of them.
        """
        columns: dict[str, Array] = {}
        if y0 is None:
            y0 = {}
        if isinstance(y0, Mapping):
            columns.update({name: np.asarray(value, dtype=np.float64) for name, value in y0.items()})
        else:
            states = self._states(y0, "y0")
            columns.update({name: states[..., k] for k, name in enumerate(self._state)})
        for name, value in (params or {}).items():
            if name in columns:
                raise InputError(f"params gives {name}, which y0 gives as well: leave one of them out")
            columns[name] = np.asarray(value, dtype=np.float64)
        known = self._native.inputs
        for name, value in by_component(self._native.input_arrays, inputs or {})[0].items():
            if all(name != own for own, _, _ in known):
                listed = ", ".join(own for own, _, _ in known) or "none"
                raise InputError(f"scene {self.scene} of {self.name} has no input `{name}`\n  inputs: {listed}")
            columns[name] = np.asarray(value, dtype=np.float64)
        shapes = {name: column.shape for name, column in columns.items() if column.ndim}
        if any(len(shape) > 1 for shape in shapes.values()) or len(set(shapes.values())) > 1:
            listed = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
            raise InputError(f"y0 and params have other shapes than (N,) or a number: {listed}")
        n_rows = next(iter(shapes.values()))[0] if shapes else paths or 1
        if paths is not None and paths != n_rows:
            raise InputError(f"paths is {paths}, but y0 and params have {n_rows} rows: leave it out")
        values = np.empty((n_rows, len(columns)))
        for k, column in enumerate(columns.values()):
            values[:, k] = column
        options = _options(method, rtol, atol, step, max_step, max_steps, (noise_seed, noise_path, noise_step))
        samples = whole("samples", samples)
        threads = None if threads is None else whole("threads", threads)
        if out is not None:
            return _hamel.write_ensemble(
                self._native, list(columns), values, float(t), samples, options, int(lanes), threads,
                os.fspath(out), resume, part, names("statistics", statistics), [float(q) for q in quantiles], int(bins),
            )  # fmt: skip
        if part is not None or resume or statistics:
            raise InputError("part, resume and statistics are of what is written: give out, such as \"runs.zarr\"")
        found = _hamel.ensemble(
            self._native, list(columns), values, float(t), samples, options, int(lanes), threads
        )
        return Ensemble(self, found)

    def fit(
        self,
        data: Any,
        unknowns: str | Sequence[str] | Mapping[str, float],
        *,
        params: Mapping[str, float] | None = None,
        y0: State = None,
        columns: str | Sequence[str] | Mapping[str, str] | None = None,
        time: str = "t",
        t0: float = 0.0,
        sigma: Mapping[str, float] | None = None,
        bounds: Mapping[str, Interval] | None = None,
        prior: Mapping[str, tuple[float, float]] | None = None,
        restarts: int = 0,
        segments: int = 1,
        inputs: Mapping[str, Any] | None = None,
        interpolation: str | None = None,
        method: str | None = None,
        rtol: float | None = None,
        atol: float | None = None,
        step: float | None = None,
        max_step: float | None = None,
        max_steps: int | None = None,
        progress: Callable[[int, float | None], object] | None = None,
    ) -> Fit:
        """Parameters and initial values whose motion is nearest to measured values, as ``hamel fit`` finds them.

        The minimum over the unknowns ``p``, within ``bounds``, of

            sum_c sum_k ((g_c(t_k, y(t_k; p); p) - d_ck) / sigma_c)^2 + sum_j ((p_j - m_j) / s_j)^2

        with the values ``d_ck`` of the columns ``c`` at the times ``t_k``, and with the ``prior`` ``m_j +- s_j``; by the method
        of Levenberg and Marquardt with derivatives by dual numbers, over a tenth of the time, a third, and all of it.

        ``data`` is the path of a table, a dictionary of arrays ``(N,)`` by name, or a DataFrame, whose index may be the
        time. Columns are components of :attr:`state`, ``energy`` and outputs (``casimirs.C1``); ``columns`` chooses some,
        as a dictionary each with the header that it has. An entry that is NaN, or none, is a value that is missing. A
        unit behind a header, ``x [mm]``, is converted to that of the model. ``time`` is the header of the times, ``t0``
        the one at which the motion starts, in the unit of the data.

        ``unknowns`` names parameters and components of the initial state, or has the values from which the search starts;
        the others start at ``params``, ``y0`` and the model's own. ``sigma`` are standard deviations of the errors of all
        columns, ``bounds`` intervals ``(least, most)``, open where an end is ``None``, and ``prior`` values with standard
        deviations, all in the units of the model. ``restarts`` is the number of further points to start from, ``segments``
        the number of pieces that start on their own at first (multiple shooting, Bock 1983). ``inputs`` are as
        :meth:`with_inputs` takes them; ``method`` and steps as in :meth:`simulate`, ``"dop853"`` unless it is given.
        ``progress`` is called with the number of motions and the sum of squares of the last, none where it has no end. An
        interrupt of the keyboard ends the fit.

        Raises :class:`FitError` with the best values where there is no minimum, where it explains the data badly, and where
        the data do not determine the unknowns; :class:`InputError` with every problem of names and of the table;
        :class:`FileError`.
        """
        model = self.with_inputs(inputs, interpolation=interpolation) if inputs else self
        if isinstance(unknowns, str):
            unknowns = [unknowns]
        starting = dict(unknowns) if isinstance(unknowns, Mapping) else {}
        given = dict(model._by_name(y0))
        set_at = dict(params or {})
        for name, value in starting.items():
            into = set_at if name in model._params else given
            # A whole state has a place for each component.
            if name in into and (into is set_at or y0 is None or isinstance(y0, Mapping)):
                raise InputError(f"unknowns start {name}, which {'params' if into is set_at else 'y0'} gives as well: leave one of them out")
            into[name] = float(value)
        wanted = {
            "unknowns": unknowns, "columns": columns, "time": time, "t0": t0, "sigma": sigma, "bounds": bounds,
            "prior": prior, "restarts": restarts, "segments": segments,
        }  # fmt: skip
        options = _options(method, rtol, atol, step, max_step, max_steps)
        model = model.with_params(**set_at) if set_at else model
        return fitted(model, data, list(given.items()), wanted, options, progress)

    # Near a point.

    def linearize(
        self,
        y: State = None,
        t: float = 0.0,
        *,
        inputs: Mapping[str, Any] | None = None,
        outputs: Sequence[str] | None = None,
    ) -> Linearization:
        """The linear system ``A``, ``B``, ``C``, ``D`` near a state at a time, as ``hamel linearize`` finds it; exact.

        ``y`` is a state as :meth:`simulate` takes it. ``inputs`` are as :meth:`with_inputs` takes them: those that are
        numbers are inputs of the linear system at these values, and an expression closes a loop. The default scene gives
        way to ``controlled`` where the model has inputs. ``outputs`` names outputs of the model and components of the
        state; all outputs of the model unless it is given.

        Raises :class:`InputError` for other names, and where something has no finite value.
        """
        if not math.isfinite(t):
            raise InputError(f"t is {t}, but has to be finite")
        model = self.with_inputs(inputs) if inputs else self._with_inputs_taken()
        return linearization(model, _hamel.linearize(model._native, model._by_name(y), t), outputs)

    def trim(
        self,
        guess: State = None,
        *,
        keep: Sequence[str] | Mapping[str, float] = (),
        free: Sequence[str] = (),
        at_rest: bool = False,
        t: float | None = None,
    ) -> Equilibrium:
        """A relative equilibrium near a guess, with its stability on the reduced space.

        The guess is an initial state as :meth:`simulate` takes it. ``keep`` names components of the state, invariants
        and outputs that stay as they are at the guess, or gives them values; ``free`` names inputs and parameters that
        are solved for. ``at_rest`` leaves out states that drift along a symmetry; ``t`` is the time that equations with
        time in them are frozen at.

        Raises :class:`InputError` where no equilibrium is near the guess.
        """
        answer = self._native.trim(self._by_name(guess), _kept_values(keep), list(free), at_rest, (t, None))
        return _equilibria.equilibrium(self, answer)

    def orbit(
        self,
        period: float,
        guess: State = None,
        *,
        keep: Sequence[str] | Mapping[str, float] = (),
        at_rest: bool = False,
    ) -> Equilibrium:
        """The relative periodic orbit near a guess of about this period, events included, with Floquet's multipliers.

        The motion comes back up to drifts along symmetries, unless ``at_rest``, and full turns of angles. In systems
        with an energy orbits come in families: ``keep=["energy"]`` takes the one with the energy of the guess.
        """
        if not period > 0:
            raise InputError(f"a period of {period}: give a time above zero")
        answer = self._native.trim(
            self._by_name(guess), _kept_values(keep), [], at_rest, (None, float(period))
        )
        return _equilibria.equilibrium(self, answer)

    def family(
        self,
        name: str,
        start: float,
        stop: float,
        guess: State = None,
        *,
        points: int = 50,
        keep: Sequence[str] | Mapping[str, float] = (),
        free: Sequence[str] = (),
        at_rest: bool = False,
        t: float | None = None,
        period: float | None = None,
    ) -> Family:
        """Relative equilibria along ``name``, a parameter, input, component, invariant or output, by pseudo-arclength.

        With ``period``, relative periodic orbits that begin with one of about this period, as in :meth:`orbit`. Folds,
        and the places where stability changes, are in :attr:`Family.changes`. The rest is as in :meth:`trim`.
        """
        if period is not None and (not period > 0 or free or t is not None):
            raise InputError(f"a family of orbits of period {period}: give a time above zero, and neither free nor t")
        if points < 2 or not np.isfinite([start, stop]).all() or start == stop:
            raise InputError(f"a family of {points} points from {start} to {stop}: give two values and at least 2 points")
        along = (name, float(start), float(stop), points)
        answer = self._native.trim(self._by_name(guess), _kept_values(keep), list(free), at_rest, (t, period), along)
        return _equilibria.family(self, name, answer)

    # For people.

    def explain(self, style: str = "text") -> Explanation:
        """Everything about the scene, as ``hamel explain`` prints it: algebra, equations, what was found, operations.

        A text in the ``style`` ``"text"`` (Unicode), ``"latex"`` (a fragment that needs ``amsmath``) or ``"mathml"``
        (HTML); :attr:`Explanation.sections` has the parts by title, such as ``Equations of motion``. A notebook shows it
        typeset.

        Raises :class:`InputError` for other styles.
        """
        text, sections = _hamel.explain(self._native, style)
        return Explanation(text, style, dict(sections), self)

    def certify(self, points: int = 64) -> Certificate:
        """Holds every function of the scene to its definition at random points, as ``hamel explain --certify``.

        Raises :class:`ModelError` where a function disagrees.
        """
        if points < 1:
            raise InputError(f"points is {points}, but has to be 1 or more")
        return Certificate(*_hamel.certify(self._native, points))

    def formulations(self) -> Formulations:
        """Ways of writing the scene's equations, each proved to be the same motion, with what they cost.

        As ``hamel explain --formulations``; a scene takes one by ``formulation`` in its text.
        """
        rows, left_out, text = _hamel.formulations(self._native)
        return Formulations(tuple(Formulation(*row) for row in rows), dict(left_out), text)

    def generate(
        self,
        language: str = "rust",
        folder: str | os.PathLike[str] | None = None,
        *,
        precision: str = "double",
    ) -> dict[str, str]:
        """The files of the scene in a language by name, as ``hamel generate --language`` writes them.

        Languages are ``rust``, ``c``, ``cpp``, ``casadi``, ``casadi-expr``, ``jax``, ``sympy``, ``julia``, ``matlab`` and
        ``wasm``; ``precision`` is ``double``, or ``float`` for C and C++. With ``folder`` the files are written there, in
        the place of files of the same names. Parameters and inputs have the values of the text.

        :meth:`fmu` writes FMUs.

        Raises :class:`InputError` for other languages and for scenes that a language does not take; :class:`FileError`.
        """
        files = _hamel.generate(self._native, language, precision)
        if folder is not None:
            try:
                for name, text in files.items():
                    with open(os.path.join(os.fspath(folder), name), "w", encoding="utf-8", newline="\n") as file:
                        file.write(text)
            except OSError as error:
                raise FileError(f"{error.filename}: {error.strerror}") from error
        return files

    def fmu(self, path: str | os.PathLike[str]) -> None:
        """Writes the scene as an FMU of FMI 3.0, as ``hamel generate --language fmu`` does, in the place of a file there.

        It has model exchange and co-simulation, and begins at the initial state; parameters, inputs and start values are
        those of the text, which the simulator changes. ``path`` ends in ``.fmu``. A C compiler is needed, the one that
        the environment variable ``CC`` names, or ``cc``, ``gcc`` or ``clang``.

        Raises :class:`InputError` for other names, for scenes that are no FMU, and without a C compiler;
        :class:`FileError`.
        """
        _hamel.write_fmu(self._native, os.fspath(path))

    def reduce(self) -> Reduced:
        """The model reduced by the symmetries that are found, as ``hamel reduce`` writes it.

        The model is unreduced: coordinates and ``configuration`` items. ``pyhamel.load(model.reduce().text)`` is the reduced
        model. What cannot be reduced is a :class:`ModelError`, which tells the symmetries. Source: Marsden and Ratiu 1999,
        chapters 9 and 13.
        """
        text, report, dim, map = self._native.reduce()
        return Reduced(text, tuple(report), dim, map)

    def report(self) -> str:
        """The page that ``hamel report --no-run`` writes, as text."""
        return _hamel.report(self._native)

    def _repr_latex_(self) -> str:
        return self._equations("latex")

    def _repr_html_(self) -> str:
        from ._html import of_model

        return of_model(self, self._equations("mathml"))

    def _equations(self, style: str) -> str:
        return self.explain(style).sections.get("Equations of motion", "")

    def __repr__(self) -> str:
        scene = "" if self.scene == "default" else f", scene {self.scene}"
        return f"<pyhamel.Model {self.name}{scene}: {', '.join(self._state)}>"

    def __reduce__(self) -> tuple[Any, ...]:
        native = self._native
        return _restored, (native.file, native.text, native.scene, native.values, native.budget, self._cache, self._applied)

    # Within the package.

    def _with_inputs_taken(self) -> Model:
        """The model itself, or where its default scene holds inputs the scene that takes them."""
        controls = self._native.controls
        held = {name: value for name, value in self.inputs.items() if value is not None and name in controls}
        return self.with_inputs(held) if held and not self._native.taken_inputs and self.scene == "default" else self

    def _wanted(self, function: str) -> None:
        if not self._native.has(function):
            raise InputError(
                f"scene {self.scene} of {self.name} has no {function}: take a scene that says `want {function};`"
            )

    def _total(self) -> tuple[list[str], list[tuple[str, float]]]:
        self._wanted("quotient")
        _, total = self._native.total()
        if total is None:
            raise InputError(f"the text of the model that {self.name} is the quotient of is not known")
        return total

    def _of_total(self, y: ArrayLike, params: Mapping[str, float] | None) -> tuple[Array, tuple[int, ...]]:
        state, defaults = self._total()
        values = dict(defaults)
        for name, value in (params or {}).items():
            if name not in values:
                listed = ", ".join(values)
                raise InputError(f"the total system of {self.name} has no parameter `{name}`\n  parameters: {listed}")
            values[name] = float(value)
        states = np.asarray(y, dtype=np.float64)
        if states.ndim == 0 or states.shape[-1] != len(state):
            raise InputError(
                f"y is of shape {states.shape}, but its last axis has to have {len(state)} components: {', '.join(state)}"
            )
        shape = states.shape[:-1]
        given = np.broadcast_to(np.array(list(values.values())), (*shape, len(values)))
        rows = np.concatenate([states, given], axis=-1)
        return rows.reshape(-1, rows.shape[-1]), shape

    def _matrix(
        self, name: str, y: ArrayLike, t: float, tail: tuple[int, ...], threads: bool | None
    ) -> Array:
        self._wanted(name)
        y = self._states(y)
        return self._on_rows(partial(self._native.matrix, name), y, t, np.empty((*y.shape[:-1], *tail)), tail, threads)

    def _of_frames(self, name: str, y: ArrayLike, t: float, n: int, threads: bool | None) -> Array:
        self._wanted(name)
        numbers = self.outputs(y, t, threads=threads)[name]
        return numbers.reshape(*numbers.shape[:-1], len(self.frames), n)

    def _states(self, y: ArrayLike, what: str = "y") -> Array:
        states = np.asarray(y, dtype=np.float64)
        if states.ndim == 0 or states.shape[-1] != self._n:
            shape = "a number" if states.ndim == 0 else f"of shape {states.shape}"
            raise InputError(f"{what} is {shape}, but its last axis has to have {self._n} components: {', '.join(self._state)}")
        return states if states.flags.aligned else states.copy()

    def _checked_out(self, out: Array, shape: tuple[int, ...]) -> Array:
        if not isinstance(out, np.ndarray) or out.dtype != np.float64 or out.shape != shape:
            raise InputError(f"out has to be an array of float64 of shape {shape}")
        if not (out.flags.aligned and out.flags.writeable and (out.ndim != 1 or out.flags.c_contiguous)):
            raise InputError("out has to be aligned and writeable, and contiguous where it has one axis")
        return out

    def _on_rows(
        self, of: Any, y: Array, t: float, out: Array, tail: tuple[int, ...], threads: bool | None
    ) -> Array:
        """Calls a function of the native scene with states and results as arrays of two axes."""
        width = int(np.prod(tail))
        rows = out.reshape(-1, width)
        if np.shares_memory(rows, out):
            of(y.reshape(-1, self._n), t, rows, threads)
        else:
            of(y.reshape(-1, self._n), t, rows, threads)
            out[...] = rows.reshape(out.shape)
        return out

    def _by_name(self, y0: State) -> list[tuple[str, float]]:
        if y0 is None:
            return []
        if isinstance(y0, Mapping):
            return [(name, float(value)) for name, value in y0.items()]
        state = self._states(y0, "y0")
        if state.ndim != 1:
            raise InputError(f"y0 is of shape {state.shape}, but a motion has one initial state: see ensemble")
        return list(zip(self._state, state.tolist()))


def _options(
    method: str | None,
    rtol: float | None,
    atol: float | None,
    step: float | None,
    max_step: float | None,
    max_steps: int | None,
    noise: tuple[int, int, float | None] = (0, 0, None),
) -> dict[str, Any]:
    if method is not None and not isinstance(method, str):
        raise InputError(f"method is {method!r}, but has to be the name of one")
    sizes = {"rtol": rtol, "atol": atol, "step": step, "max_step": max_step}
    seed, path, noise_step = noise
    return {
        **{name: None if size is None else number(name, size) for name, size in sizes.items()},
        "method": method,
        "max_steps": None if max_steps is None else whole("max_steps", max_steps),
        "noise": (
            whole("noise_seed", seed),
            whole("noise_path", path, most=U32),
            None if noise_step is None else number("noise_step", noise_step),
        ),
    }


def _kept_values(keep: Sequence[str] | Mapping[str, float]) -> list[tuple[str, float | None]]:
    """Names with the values that they are kept at; none for those of the guess."""
    if isinstance(keep, str):
        raise InputError(f"keep is the text {keep!r}: give a list of names, or values by name")
    if isinstance(keep, Mapping):
        return [(name, float(value)) for name, value in keep.items()]
    return [(name, None) for name in keep]


def _times(t: float | ArrayLike, samples: int) -> tuple[float, list[float]]:
    """The final time, and the times of samples."""
    if isinstance(t, (int, float)) and samples in (0, 2):
        if not math.isfinite(t):
            raise InputError("t has to be finite")
        return float(t), [0.0, float(t)][:samples]
    given = np.asarray(t, dtype=np.float64)
    if not np.all(np.isfinite(given)):
        raise InputError("t has to be finite")
    if given.ndim > 1 or given.size == 0:
        raise InputError("t is a final time, a span (0, T), or an array of times")
    if given.ndim == 1:
        if given[0] != 0.0:
            raise InputError(f"t starts at {given[0]}, but motions start at 0: shift the time of what depends on it")
        if given.size > 2:
            steps = np.diff(given)
            if not (np.all(steps > 0) or np.all(steps < 0)):
                raise InputError("t has to grow, or to fall, from each time to the next")
            return float(given[-1]), given.tolist()
    t_final = float(given.flat[-1])
    if samples < 0:
        raise InputError(f"samples is {samples}, but has to be 0 or more")
    if samples == 1:
        return t_final, [t_final]
    return t_final, np.linspace(0.0, t_final, samples).tolist()
