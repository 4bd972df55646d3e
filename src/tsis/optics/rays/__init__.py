"""Rays from the lamps through the probe: a fast tracer, and a readable reference."""

from tsis.optics.rays._face import (
    evenly_pressed_face,
    evenly_raised_face,
    face_grid,
    hertz_dent,
    on_face,
    slopes,
    tip_press,
)
from tsis.optics.rays._kernel import ARRIVING, COUPLED, FLUX_X, FLUX_Y
from tsis.optics.rays._reference import WAYS_OUT, trace_photons
from tsis.optics.rays._scene import APERTURE, scene
from tsis.optics.rays._trace import Batches, Tally, TracedLight, trace_batches, trace_paths, trace_rays

__all__ = [
    "APERTURE",
    "ARRIVING",
    "COUPLED",
    "FLUX_X",
    "FLUX_Y",
    "WAYS_OUT",
    "Batches",
    "Tally",
    "TracedLight",
    "evenly_pressed_face",
    "evenly_raised_face",
    "face_grid",
    "hertz_dent",
    "on_face",
    "scene",
    "slopes",
    "tip_press",
    "trace_batches",
    "trace_paths",
    "trace_photons",
    "trace_rays",
]
