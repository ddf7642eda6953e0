"""Packages of others that some methods need, imported when these are called.

Deliberately does not know: what they are for.
"""

from __future__ import annotations

import importlib
from typing import Any

from ._errors import PackageError

__all__ = ["needed"]


def needed(module: str, package: str) -> Any:
    """A module of a package that may be missing.

    Raises :class:`PackageError` where it is.
    """
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        # A package that lacks one of its own says so itself.
        if error.name is None or error.name.partition(".")[0] != module.partition(".")[0]:
            raise
        raise PackageError(f"{package} is not installed: pip install {package}") from error
