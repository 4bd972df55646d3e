"""What was measured in contacts with one body, as logarithms of forces and dents with their models."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.hardness._layer_model import (
    CYLINDER_MODEL_SD,
    DENT_MODEL_SD,
    FORCE_MODEL_SD,
    curves_at_depth,
    curves_at_radius,
)

if TYPE_CHECKING:
    from collections.abc import Iterator
    from typing import Literal

    from numpy.typing import NDArray

    from tsis.hardness._contact_readings import TouchReading
    from tsis.hardness._exploration import RadiusPrior

    Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TouchedBody:
    """Readings on one body."""

    readings: tuple[TouchReading, ...]
    shape: Literal["sphere", "cylinder"]
    radius: RadiusPrior
    length_mm: float = 1.0  # of a cylinder, over which its force acts
    rigid: bool = False


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MeasuredTerm:
    """One measured logarithm, and its model over `SOFTNESS`."""

    press: int
    observed: float
    curve: Floats
    slope: Floats  # with the logarithm of the contact radius or dent that was read
    sd: float
    reading_sd: float
    is_force: bool


def measured_terms(body: TouchedBody, radius: float, thickness: float, poisson: float) -> Iterator[MeasuredTerm]:
    """The measured logarithms, for a radius and a thickness in mm and Poisson's ratio of the gel."""
    length = np.log(body.length_mm) if body.shape == "cylinder" else 0.0
    for index, reading in enumerate(body.readings):
        x = (reading.radius_mm or 0.0) / radius
        model = CYLINDER_MODEL_SD * x**2 if body.shape == "cylinder" else 0.0
        if reading.radius_mm is not None:
            curves = curves_at_radius(reading.radius_mm, body.shape, radius, thickness, poisson)
            assert reading.radius_sd_mm is not None
            own_radius = reading.radius_sd_mm / reading.radius_mm
            if reading.force_n is not None and reading.force_sd_n is not None:
                yield MeasuredTerm(
                    press=index,
                    observed=float(np.log(reading.force_n)) - length,
                    curve=curves.log_force,
                    slope=curves.force_slope,
                    sd=float(np.hypot(reading.force_sd_n / reading.force_n, np.hypot(FORCE_MODEL_SD, model))),
                    reading_sd=own_radius,
                    is_force=True,
                )
            if reading.depth_mm is not None and reading.depth_sd_mm is not None:
                yield MeasuredTerm(
                    press=index,
                    observed=float(np.log(reading.depth_mm)),
                    curve=curves.log_dent,
                    slope=curves.dent_slope,
                    sd=float(np.hypot(reading.depth_sd_mm / reading.depth_mm, np.hypot(DENT_MODEL_SD, model))),
                    reading_sd=own_radius,
                    is_force=False,
                )
        elif reading.force_n is not None and reading.depth_mm is not None:
            assert reading.depth_sd_mm is not None
            assert reading.force_sd_n is not None
            log_force, slope = curves_at_depth(reading.depth_mm, body.shape, radius, thickness, poisson)
            yield MeasuredTerm(
                press=index,
                observed=float(np.log(reading.force_n)) - length,
                curve=log_force,
                slope=slope,
                sd=float(np.hypot(reading.force_sd_n / reading.force_n, FORCE_MODEL_SD)),
                reading_sd=float(np.hypot(reading.depth_sd_mm / reading.depth_mm, DENT_MODEL_SD)),
                is_force=True,
            )


def limit_nodes(limits: tuple[float, float], count: int, *, logarithmic: bool = False) -> list[tuple[float, float]]:
    """Values between limits and their weights, which add up to one."""
    low, high = (np.log(limits) if logarithmic else np.asarray(limits)).tolist()
    if low == high:
        return [(limits[0], 1.0)]
    place, weight = np.polynomial.legendre.leggauss(count)
    values = low + (high - low) * (place + 1) / 2
    return list(zip((np.exp(values) if logarithmic else values).tolist(), (weight / 2).tolist(), strict=True))
