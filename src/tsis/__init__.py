"""Open software for optical tactile imaging. Research use only.

A soft transparent probe is pressed on tissue. Light escapes where it is pressed, and a camera records it.
From the image tsis estimates the size, depth and stiffness of an inclusion under the surface, with intervals.

The packages (``tsis.mechanics``, ``tsis.imaging``, ...) load when they are first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import lazy_loader

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
    from tsis import calibration as calibration
    from tsis import console as console
    from tsis import detection as detection
    from tsis import hardness as hardness
    from tsis import imaging as imaging
    from tsis import inclusion as inclusion
    from tsis import instrument as instrument
    from tsis import matching as matching
    from tsis import mechanics as mechanics
    from tsis import optics as optics
    from tsis import plots as plots
    from tsis import records as records
    from tsis import report as report
    from tsis import study as study
    from tsis import sweep as sweep
    from tsis import virtual as virtual

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

if not TYPE_CHECKING:
    _packages = ["calibration", "console", "detection", "hardness", "imaging", "inclusion", "instrument", "matching"]
    _packages += ["mechanics", "optics", "plots", "records", "report", "study", "sweep", "virtual"]
    __getattr__, _lazy, _ = lazy_loader.attach(__name__, _packages)

    def __dir__() -> list[str]:
        return sorted({*__all__, *_lazy(), "catalog", "errors", "files", "model"})
