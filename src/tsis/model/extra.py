"""Libraries that an extra of the package brings, imported when a feature first needs them."""

from __future__ import annotations

import importlib
from typing import Any

from tsis.model.errors import MissingExtraError

# What people call a package where its import name says something else; Netgen comes with NGSolve.
KNOWN_AS = {"ngsolve": "NGSolve", "netgen": "NGSolve"}


def import_extra(name: str, *, feature: str, extra: str) -> Any:
    """Import ``name``, or say what needs it and which extra brings it.

    Parameters
    ----------
    name
        Of the module.
    feature
        What needs it, as the subject of a sentence.
    extra
        The extra of this package that brings it.

    Raises
    ------
    MissingExtraError
        When it is not installed.
    """
    try:
        return importlib.import_module(name)
    except ImportError as error:
        package = name.partition(".")[0]
        raise MissingExtraError(
            f"{feature} needs {KNOWN_AS.get(package, package)}, which is not installed; "
            f'install it with: python -m pip install "tsis[{extra}]"'
        ) from error
