"""A calibration of a bench, and its parts: quick, and the same every time."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np

from tsis.calibration.camera_reference import CameraReference
from tsis.calibration.file import ProbeCalibration
from tsis.calibration.force_line import ForceLine
from tsis.calibration.measured import MeasuredValue
from tsis.calibration.scale import PixelScale
from tsis.calibration.specification import Specification, SpecificationRow
from tsis.model.calibration import Calibration, LightMap

MADE = datetime(2026, 11, 22, 10, 0, tzinfo=UTC)
LATER = MADE + timedelta(days=180)


def measured(value: float, unit: str = "") -> MeasuredValue:
    return MeasuredValue(value=value, sd=0.01 * abs(value), unit=unit)


def bench_scale(x: float = 0.0336, y: float = 0.0392) -> PixelScale:
    return PixelScale(
        mm_per_pixel_x=MeasuredValue(value=x, sd=1e-5, degrees_of_freedom=40.5, unit="mm/px"),
        mm_per_pixel_y=MeasuredValue(value=y, sd=1e-5, degrees_of_freedom=40.5, unit="mm/px"),
        shape=(30, 40),
        at_px=(19.5, 14.5),
        method="dots",
        count=63,
    )


def bench_reference(**changes: Any) -> CameraReference:
    rng = np.random.default_rng(3)
    usable = np.ones((30, 40), dtype=bool)
    usable[2, 3] = False
    values: dict[str, Any] = {
        "dark_grey": rng.normal(8.0, 0.1, (30, 40)),
        "untouched_grey": rng.normal(2.0, 0.1, (30, 40)),
        "relative_light": np.ones((30, 40)),
        "usable": usable,
        "full_scale": 255.0,
        "mm_per_pixel": (0.0336, 0.0392),
        "dark_frames": 16,
        "untouched_frames": 16,
        "flat_frames": 0,
        "read_noise_grey": measured(0.5, "grey"),
        "shot_noise_grey": measured(0.017, "grey"),
        "stray_grey": measured(2.0, "grey"),
    }
    return CameraReference(**{**values, **changes})


def even_reference(shape: tuple[int, int], *, dark: float, untouched: float, **changes: Any) -> CameraReference:
    """The reference of an even light, without noise in its maps."""
    one = np.ones(shape)
    maps = {"dark_grey": dark * one, "untouched_grey": untouched * one, "relative_light": one, "usable": one > 0}
    return bench_reference(**maps, **changes)


def bench_line(**changes: Any) -> ForceLine:
    values: dict[str, Any] = {
        "intercept_grey": measured(900.0, "grey"),
        "slope_grey_per_n": measured(1e5, "grey/N"),
        "unit_covariance": (0.0, 0.0, 0.0),
        "units": 3,
        "residual_grey": measured(100.0, "grey"),
        "residual_share": measured(0.01),
        "least_n": 0.1,
        "most_n": 2.0,
        "pixels": 1200,
        "full_scale": 255.0,
        "tips_mm": (2.0, 10.0, 14.0),
    }
    return ForceLine(**{**values, **changes})


def sheet(unit: str = "N", *, probe: str = "tsis-2011", note: str = "") -> Specification:
    force = measured(0.01, "N")
    row = SpecificationRow(quantity="force", unit=unit, measured=force, fingertip="", printed="", note=note)
    return Specification(probe=probe, rows=(row,))


def bench(**changes: Any) -> ProbeCalibration:
    light = LightMap.uniform()
    parts: dict[str, Any] = {
        "name": "bench",
        "probe": "tsis-2011",
        "camera": "Aravis-TSIS01",
        "settings": {"exposure_ms": 20.0, "gain": 0.0},
        "made": MADE,
        "expires": LATER,
        "scale": bench_scale(),
        "reference": bench_reference(),
        "response": Calibration(gain_grey_per_kpa=60, saturation_kpa=20.0, light=light, probe="tsis-2011"),
    }
    return ProbeCalibration(**{**parts, **changes})
