"""Open software for optical tactile imaging. Research use only.

A soft transparent probe is pressed on tissue. Light escapes where it is pressed, and a camera records it.
From the image tsis estimates the size, depth and stiffness of an inclusion under the surface, with intervals.

Packages (``tsis.mechanics``, ...) and classes load when they are first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import lazy_loader

from tsis.__about__ import __version__

if TYPE_CHECKING:
    from tsis import calibration as calibration
    from tsis import catalog as catalog
    from tsis import files as files
    from tsis import hardness as hardness
    from tsis import imaging as imaging
    from tsis import inclusion as inclusion
    from tsis import instrument as instrument
    from tsis import mapping as mapping
    from tsis import matching as matching
    from tsis import mechanics as mechanics
    from tsis import model as model
    from tsis import optics as optics
    from tsis import plugins as plugins
    from tsis import present as present
    from tsis import processes as processes
    from tsis import records as records
    from tsis import study as study
    from tsis import sweep as sweep
    from tsis import virtual as virtual
    from tsis.calibration import load_calibration, load_frames
    from tsis.catalog.phantoms import load_phantom
    from tsis.catalog.probes import load_probe
    from tsis.model.calibration import Calibration
    from tsis.model.estimate import Estimate
    from tsis.model.image import TactileImage
    from tsis.model.phantom import Inclusion, Phantom
    from tsis.model.press import PressField, PressMap
    from tsis.model.probe import Glass, Layer, Led, Probe

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
    "load_calibration",
    "load_frames",
    "load_phantom",
    "load_probe",
]

if not TYPE_CHECKING:  # packages and classes load when they are first used
    __getattr__, __dir__, _ = lazy_loader.attach(
        __name__,
        submodules=[
            *("calibration", "catalog", "console", "errors", "files", "hardness", "imaging", "inclusion"),
            *("instrument", "mapping", "matching", "mechanics", "model", "optics", "plugins", "present", "processes"),
            *("records", "study", "sweep", "virtual"),
        ],
        submod_attrs={
            "calibration": ["load_calibration", "load_frames"],
            "catalog": ["load_phantom", "load_probe"],
            "model.calibration": ["Calibration"],
            "model.estimate": ["Estimate"],
            "model.image": ["TactileImage"],
            "model.phantom": ["Inclusion", "Phantom"],
            "model.press": ["PressField", "PressMap"],
            "model.probe": ["Glass", "Layer", "Led", "Probe"],
        },
    )
