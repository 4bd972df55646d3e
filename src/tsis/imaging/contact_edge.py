"""Where a round contact begins and ends, and how much of each pixel it covers."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.imaging.sensor import Sensor
    from tsis.model import PressField


def contact_edges(field: PressField) -> list[tuple[float, int]]:
    """Radius in mm of every edge of the contact, each with 1 where the contact lies inside it and -1 outside."""
    radius, pressure = field.radius_mm, field.pressure_kpa
    touched = np.concatenate([pressure > 0, [False]])
    edges = []
    for last in np.flatnonzero(touched[1:] != touched[:-1]).tolist():
        if last == len(radius) - 1:  # the contact reaches the rim
            edges.append((float(radius[-1]), 1))
        elif touched[last]:
            edges.append((_end(radius, pressure, last, 1), 1))
        else:
            edges.append((_end(radius, pressure, last + 1, -1), -1))
    return edges


def coverage(field: PressField, sensor: Sensor) -> NDArray[np.float64]:
    """Share of each pixel that is in contact, shape (rows, columns); an edge is taken as straight inside a pixel."""
    x, y = sensor.axes_mm()
    radius = sensor.radius_mm()
    reach = np.maximum(np.abs(x)[None, :] * sensor.mm_per_pixel[0], np.abs(y)[:, None] * sensor.mm_per_pixel[1])
    width = reach / np.maximum(radius, 1e-12)  # of a pixel along the radius, but for its corners
    width = np.maximum(width, min(sensor.mm_per_pixel) / 2)  # the pixel on the axis has no direction
    covered = np.zeros(radius.shape)
    for edge, side in contact_edges(field):
        covered += side * np.clip((edge - radius) / width + 0.5, 0.0, 1.0)
    return covered


def _end(radius: NDArray[np.float64], pressure: NDArray[np.float64], last: int, step: int) -> float:
    """Where the pressure ends beyond the touched node ``last``: it falls with the root of the distance, as Hertz's."""
    inner = last - step
    if not 0 <= inner < len(radius) or not pressure[inner] > pressure[last]:
        return float((radius[last] + radius[last + step]) / 2)
    falling = (pressure[inner] ** 2 - pressure[last] ** 2) / (radius[last] - radius[inner])
    end = radius[last] + pressure[last] ** 2 / falling
    return float(min(end, radius[last + step]) if step > 0 else max(end, radius[last + step]))
