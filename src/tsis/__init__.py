"""Open software for optical tactile imaging. Research use only.

A soft transparent probe is pressed on tissue. Light escapes where it is pressed, and a camera records it.
From the image tsis estimates the size, depth and stiffness of an inclusion under the surface, with intervals.

The packages (``tsis.mechanics``, ``tsis.imaging``, ...) load when they are first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from tsis.__about__ import __version__
from tsis.catalog import load_phantom, load_probe
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

_PACKAGES = frozenset(
    {
        "calibration",
        "catalog",
        "console",
        "detection",
        "errors",
        "files",
        "hardness",
        "imaging",
        "inclusion",
        "instrument",
        "matching",
        "mechanics",
        "model",
        "optics",
        "plots",
        "records",
        "report",
        "study",
        "sweep",
        "virtual",
    }
)


def __dir__() -> list[str]:
    return sorted({*globals(), *_PACKAGES})


def __getattr__(name: str) -> ModuleType:
    if name in _PACKAGES:
        return import_module(f"tsis.{name}")
    raise AttributeError(f"module 'tsis' has no attribute {name!r}")
