"""Compiled ray tracing against the same rays in the interpreter."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.interpreted import assert_interpreted_alike

from tsis.catalog.probes import load_probe
from tsis.model.probe import Glass
from tsis.optics.rays.geometry import evenly_pressed_face, evenly_raised_face, hertz_dent, scene
from tsis.optics.rays.kernel import CONTACT, MAPS, MEETINGS, TALLIES, Record, follow, lamps, trace_batch

if TYPE_CHECKING:
    from tsis.model.press import PressField, PressMap
    from tsis.optics.rays.geometry import Scene
    from tsis.optics.rays.kernel import Lamps, Vector

PROBE = load_probe("tsis-2011")
DENT = hertz_dent(12.0, tip_radius_mm=6.0, depth_mm=1.2, peak_pressure_kpa=5.0, offset_mm=(1.0, -2.0))
SLOPES = np.array([[0.1, 0.0], [-0.3, 0.2]])


def _empty_record(slopes: np.ndarray) -> Record:
    totals, maps, tilted = np.zeros(TALLIES), np.zeros((MAPS, 6, 6)), np.zeros((len(slopes), 6, 6))
    return Record(totals=totals, maps=maps, slopes=slopes, tilted=tilted, path=np.zeros((30, 4)))


def _traced(view: Scene, lit: Lamps, rays: int, slopes: np.ndarray) -> Record:
    """Record of some rays of each lamp; the path is that of the last ray."""
    record = _empty_record(slopes)
    trace_batch(view, lit, 3, 1, rays, record)
    return record


def _followed(view: Scene, start: Vector, direction: Vector) -> tuple[int, Record]:
    """Points of one ray's path, and its record."""
    record = _empty_record(SLOPES)
    return follow(view, start, direction, 1.0, np.uint64(7), record), record


@pytest.mark.parametrize(
    ("glass", "pressed", "absorption", "slopes"),
    [
        (1.41, None, 0.0, SLOPES[:0]),
        (1.515, None, 0.01, SLOPES),
        (1.515, evenly_pressed_face(12.0, 4.0), 0.0, SLOPES),
        (1.515, DENT, 0.002, SLOPES),
        (1.515, evenly_raised_face(12.0, 1.0), 0.0, SLOPES),
    ],
    ids=["untouched", "absorbing", "contact", "dent", "raised"],
)
def test_rays_equal_those_of_the_interpreter(
    glass: float, pressed: PressField | PressMap | None, absorption: float, slopes: np.ndarray
) -> None:
    probe = replace(PROBE, glass=Glass(thickness_mm=3.0, refractive_index=glass))
    view = scene(probe, pressed, saturation_kpa=10.0, absorption_per_mm=absorption)
    totals = assert_interpreted_alike(_traced, view, lamps(probe), 24, slopes).totals
    assert totals[MEETINGS] > 150
    assert (totals[CONTACT] > 0) == (pressed is not None and bool(np.any(pressed.pressure_kpa > 0)))


@pytest.mark.parametrize(
    ("start", "elevation_deg"),
    [((12.0, 0.0, 5.0), 180.0), ((12.0, 0.0, 20.0), 0.0), ((12.0, 0.0, 11.5), -10.0), ((13.0, 1.0, 4.0), 30.0)],
    ids=["outward", "above", "in the glass", "in the layers"],
)
@pytest.mark.parametrize("most_meetings", [4, 40])
def test_a_path_equals_that_of_the_interpreter(start: Vector, elevation_deg: float, most_meetings: int) -> None:
    probe = replace(PROBE, glass=Glass(thickness_mm=3.0, refractive_index=1.515))
    view = scene(probe, DENT, aperture=0.8)._replace(weak=0.0, most_meetings=most_meetings)
    elevation = np.radians(elevation_deg)
    direction = (-float(np.cos(elevation)), 0.0, float(np.sin(elevation)))
    points, _ = assert_interpreted_alike(_followed, view, start, direction)
    assert (points > 1) == (start[2] < 20 and elevation_deg < 90)
