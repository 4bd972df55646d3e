"""Values and errors that every room shares, and what touches files and optional libraries for them; no computation."""

from tsis.model.calibration import Calibration
from tsis.model.catalog import (
    list_phantoms,
    list_probes,
    list_spheres,
    load_phantom,
    load_probe,
    load_sphere,
)
from tsis.model.estimate import Estimate
from tsis.model.image import TactileImage
from tsis.model.light import Glass, Led
from tsis.model.light_map import LightMap
from tsis.model.phantom import Inclusion, Phantom
from tsis.model.press import PressField, PressMap
from tsis.model.probe import Layer, Probe
from tsis.model.relaxation import Relaxation
from tsis.model.sphere import SoftSphere

__all__ = [
    "Calibration",
    "Estimate",
    "Glass",
    "Inclusion",
    "Layer",
    "Led",
    "LightMap",
    "Phantom",
    "PressField",
    "PressMap",
    "Probe",
    "Relaxation",
    "SoftSphere",
    "TactileImage",
    "list_phantoms",
    "list_probes",
    "list_spheres",
    "load_phantom",
    "load_probe",
    "load_sphere",
]
