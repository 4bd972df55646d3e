"""Libraries of camera makers, imported so that they leave this program's warnings as they were."""

from __future__ import annotations

import contextlib
import sys
from typing import Any

from tsis.instrument.quiet import quiet_decoders
from tsis.model.extra import import_extra


def maker_library(name: str, *, source: str) -> Any:
    """Import a library when its source is first used.

    Those made with SWIG warn about themselves, and Harvesters changes the filters of all warnings; neither is for our
    users to see.

    Raises
    ------
    MissingExtraError
        When it is not installed.
    """
    imported = name in sys.modules
    with contextlib.nullcontext() if imported else quiet_decoders():  # silences warnings, and puts the filters back
        return import_extra(name, feature=f"the camera source {source}", extra=f"camera-{source}")
