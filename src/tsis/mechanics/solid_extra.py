"""NGSolve and Netgen, imported when a press in three dimensions is first asked for."""

from __future__ import annotations

import importlib
from typing import Any

from tsis.model.errors import MissingExtraError


def library(name: str) -> Any:
    """Import ``name``, or say which extra brings it.

    Raises
    ------
    MissingExtraError
        When it is not installed.
    """
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise MissingExtraError(
            "a press in three dimensions (inclusions off the axis, ellipsoids, several at once) needs NGSolve, "
            'which is not installed; install it with: python -m pip install "tsis[fem3d]"'
        ) from error
