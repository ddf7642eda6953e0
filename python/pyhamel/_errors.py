"""Errors of the package, with the text that the command ``hamel`` prints.

Deliberately does not know: where an error comes from.
"""

from __future__ import annotations

from typing import NamedTuple

__all__ = [
    "Diagnostic",
    "Error",
    "FileError",
    "FitError",
    "InputError",
    "IntegrationError",
    "ModelError",
    "ModelWarning",
    "PackageError",
]


class Diagnostic(NamedTuple):
    """One problem of a model: where it is and what to change."""

    #: The file, or what stands for it; none for a model without text.
    file: str | None
    #: Line, counted from one.
    line: int | None
    #: Column in characters, counted from one.
    column: int | None
    #: ``"error"`` or ``"warning"``.
    severity: str
    #: What is wrong.
    message: str
    #: What to change.
    help: str | None


class Error(Exception):
    """Everything that hamel refuses or cannot do."""


class InputError(Error, ValueError):
    """An unknown name, a value that is not allowed, a state at which the equations have no value."""


class FileError(Error, OSError):
    """A file that cannot be read or written."""


class PackageError(Error, ImportError):
    """A package of others that is not installed; the text says how to install it."""


class ModelError(Error, ValueError):
    """A model with problems, all of them at once.

    The text of the exception shows each with its place, as the command does; :attr:`diagnostics` has them as data.
    """

    def __init__(self, text: str, problems: list[tuple[str | None, int | None, int | None, str, str, str | None]]):
        super().__init__(text, problems)
        #: The problems in the order of the text.
        self.diagnostics: list[Diagnostic] = [Diagnostic(*problem) for problem in problems]

    def __str__(self) -> str:
        return str(self.args[0])


class IntegrationError(Error, RuntimeError):
    """A motion that could not go on."""

    def __init__(self, text: str, t: float, state: dict[str, float]):
        super().__init__(text, t, state)
        #: The time reached.
        self.t = t
        #: The state there, by name.
        self.state = state

    def __str__(self) -> str:
        return str(self.args[0])


class FitError(Error, RuntimeError):
    """A fit without an answer: no minimum, one that explains the data badly, or unknowns that the data do not determine."""

    def __init__(self, text: str, reached: dict[str, float]):
        super().__init__(text, reached)
        #: The best values of the unknowns, by name.
        self.reached = reached

    def __str__(self) -> str:
        return str(self.args[0])


class ModelWarning(UserWarning):
    """Something in a model that means something, but probably not all that was meant."""
