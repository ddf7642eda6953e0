"""Inputs as users give them, as columns of numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._errors import InputError

Array = NDArray[np.float64]

Arrays = Sequence[tuple[str, Sequence[int], Sequence[str | None]]]
"""Vectors and matrices of inputs: name, shape, and the input at each entry, row by row, none where it is zero."""


def by_component(arrays: Arrays, given: Mapping[str, Any]) -> tuple[dict[str, Any], set[str]]:
    """Vectors and matrices, with an axis of times in front or not, as their components; expressions as they are.

    Functions of time are called at the times ``t``, once and for all; the names of what they gave come second.
    """
    known = {name: (tuple(shape), entries) for name, shape, entries in arrays}
    found: dict[str, Any] = {}
    sampled: set[str] = set()
    for name, value in given.items():
        is_function = callable(value)
        if is_function:
            value = _sampled(name, value, given.get("t"))
        own = {name: value}
        if name in known and not isinstance(value, str):
            own = _components(name, *known[name], value)
        found.update(own)
        sampled.update(own if is_function else ())
    return found, sampled


def _components(name: str, shape: tuple[int, ...], entries: Sequence[str | None], value: Any) -> dict[str, Any]:
    array = np.asarray(value, dtype=np.float64)
    n = len(shape)
    if array.ndim not in (n, n + 1) or array.shape[array.ndim - n :] != shape:
        listed = ", ".join(str(length) for length in shape)
        comma = "," if n == 1 else ""
        raise InputError(
            f"inputs {name} has shape {array.shape}, but has to have ({listed}{comma}), or that behind an axis of "
            "times or trajectories"
        )
    flat = array.reshape(*array.shape[: array.ndim - n], len(entries))
    found: dict[str, Any] = {}
    for k, component in enumerate(entries):
        expected = np.zeros(()) if component is None else found.setdefault(component, flat[..., k])
        if not np.array_equal(flat[..., k], np.broadcast_to(expected, flat.shape[:-1])):
            kind = "diagonal" if None in entries else "symmetric"
            at = tuple(int(i) for i in np.unravel_index(k, shape))
            raise InputError(f"inputs {name} is a {kind} matrix, but its entry {at} is not of one")
    return found


def _sampled(name: str, function: Any, times: Any) -> Array:
    """The values of a function of time at the times of a table."""
    if times is None:
        raise InputError(
            f"inputs {name} is a function of time: give the times at which it is called as an array `t`, "
            "or an expression such as \"sin(t)\""
        )
    times = np.asarray(times, dtype=np.float64).ravel().tolist()
    return np.array([np.asarray(function(t), dtype=np.float64) for t in times])
