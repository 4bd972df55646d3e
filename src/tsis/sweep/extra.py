"""Libraries of the extra ``cluster``, imported when they are needed."""

from __future__ import annotations

import importlib
from typing import Any

from tsis.model.errors import MissingExtraError


def library(name: str, feature: str) -> Any:
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
            f"{feature} needs {name.partition('.')[0]}, which is not installed; "
            'install it with: python -m pip install "tsis[cluster]"'
        ) from error
