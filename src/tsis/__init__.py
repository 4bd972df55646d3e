"""Open software for optical tactile imaging. Research use only.

A soft transparent probe is pressed on tissue, light escapes where it is pressed, a camera sees it; from the image
tsis estimates how big, how deep and how stiff an inclusion under the surface is, and how sure that is.

The rooms (``tsis.mechanics``, ``tsis.imaging``, ...) load when they are first named.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from tsis.__about__ import __version__
from tsis.model import (
    Calibration,
    Estimate,
    Glass,
    Inclusion,
    Layer,
    Led,
    Phantom,
    PressField,
    PressMap,
    Probe,
    TactileImage,
    load_phantom,
    load_probe,
)

if TYPE_CHECKING:
    from types import ModuleType

__all__ = [
    "Calibration",
    "Estimate",
    "Glass",
    "Inclusion",
    "Layer",
    "Led",
    "Phantom",
    "PressField",
    "PressMap",
    "Probe",
    "TactileImage",
    "__version__",
    "load_phantom",
    "load_probe",
]

_ROOMS = frozenset(
    {
        "calibration",
        "console",
        "detection",
        "hardness",
        "imaging",
        "inclusion",
        "instrument",
        "matching",
        "mechanics",
        "optics",
        "plots",
        "records",
        "report",
        "study",
        "virtual",
    }
)


def __getattr__(name: str) -> ModuleType:
    if name in _ROOMS:
        return import_module(f"tsis.{name}")
    raise AttributeError(f"module 'tsis' has no attribute {name!r}")
