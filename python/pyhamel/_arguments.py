"""Arguments of methods as the library takes them, or an error with the name of the argument."""

from __future__ import annotations

import operator
from collections.abc import Iterable
from typing import Any

from ._errors import InputError

#: The largest whole numbers of the library.
U32 = 2**32 - 1
U64 = 2**64 - 1


def whole(name: str, value: Any, least: int = 0, most: int = U64) -> int:
    """A whole number within bounds.

    >>> whole("threads", 3)
    3
    >>> whole("threads", -1)
    Traceback (most recent call last):
    pyhamel._errors.InputError: threads is -1, but has to be a whole number, 0 or more
    """
    try:
        found = operator.index(value)
    except TypeError:
        found = None
    if found is None or not least <= found <= most:
        bounds = f"{least} or more" if most == U64 else f"from {least} to {most}"
        raise InputError(f"{name} is {value!r}, but has to be a whole number, {bounds}")
    return found


def number(name: str, value: Any) -> float:
    """A real number; a text is none.

    >>> number("step", "0.1")
    Traceback (most recent call last):
    pyhamel._errors.InputError: step is '0.1', but has to be a number
    """
    try:
        if not isinstance(value, (str, bytes)):
            return float(value)
    except (TypeError, ValueError):
        pass
    raise InputError(f"{name} is {value!r}, but has to be a number")


def names(name: str, value: Iterable[str]) -> list[str]:
    """Texts one by one; a text alone would be taken for its letters.

    >>> names("events", "Omega1 rising")
    Traceback (most recent call last):
    pyhamel._errors.InputError: events is the text 'Omega1 rising': give a list of texts
    """
    if isinstance(value, (str, bytes)):
        raise InputError(f"{name} is the text {value!r}: give a list of texts")
    found = list(value)
    for one in found:
        if not isinstance(one, str):
            raise InputError(f"{name} has {one!r}, which is no text")
    return found
