"""Losses of a frame: light and force beyond the field of view, and light above full scale."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from tsis.imaging._render import render
from tsis.imaging._sensor import Sensor
from tsis.model.press import PressMap
from tsis.model.require import require_type

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.imaging._contact_models import ContactModel
    from tsis.model.calibration import Calibration, LightMap
    from tsis.model.press import PressField


SURVEY = 1024  # pixels across a survey of the whole face


@dataclass(frozen=True, slots=True, kw_only=True)
class LostLight:
    """Fractions, each in [0, 1], of a press that its frame does not show.

    Attributes
    ----------
    force_outside
        Fraction of the force beyond the field of view.
    light_outside
        Fraction of the light that leaves the face beyond the field of view; 0 without light.
    pixels_clipped
        Fraction of the frame's pixels that are expected above full scale.
    light_clipped
        Fraction of the light on the frame that is above full scale.
    """

    force_outside: float
    light_outside: float
    pixels_clipped: float
    light_clipped: float


def find_lost_light(
    field: PressField | PressMap,
    sensor: Sensor,
    calibration: Calibration,
    *,
    blur_mm: float = 0.05,
    contact_model: ContactModel | str = "rough",
    light: LightMap | None = None,
) -> LostLight:
    """Compute the parts of a press that the field of view crops and full scale clips.

    The arguments are those of `tsis.imaging.render`. Raises `InputError` when the blur lies outside its range or the
    contact model is unknown.

    Examples
    --------
    >>> from tsis.model.calibration import Calibration
    >>> from tsis.model.press import PressField
    >>> radius = np.linspace(0.0, 12.0, 25)
    >>> flat, even = np.zeros(25), np.full(25, 2.0)
    >>> press = PressField(
    ...     radius_mm=radius, face_displacement_mm=flat, pressure_kpa=even, approach_mm=1.0, force_n=0.9
    ... )
    >>> calibration = Calibration(gain_grey_per_kpa=50.0, saturation_kpa=20.0)
    >>> lost = find_lost_light(press, Sensor(rows=246), calibration)  # the middle 9.6 mm of a face of 24 mm
    >>> round(lost.light_outside, 2), lost.pixels_clipped
    (0.5, 0.0)
    """
    require_type("sensor", sensor, Sensor)
    picture = render(field, sensor, calibration, blur_mm=blur_mm, contact_model=contact_model, light=light)
    over = np.maximum(picture + sensor.background_grey - sensor.full_scale, 0.0)
    survey = _survey(field, sensor)
    inside = _overlap(survey, sensor)
    everywhere = render(field, survey, calibration, blur_mm=0.0, contact_model=contact_model, light=light)
    even = replace(calibration, gain_grey_per_kpa=1.0, saturation_kpa=1e6)  # light equal to the pressure
    return LostLight(
        force_outside=_outside(render(field, survey, even, blur_mm=0.0), inside),
        light_outside=_outside(everywhere, inside),
        pixels_clipped=float((over > 0).mean()),
        light_clipped=float(over.sum() / max(picture.sum(), np.finfo(float).tiny)),
    )


def _survey(field: PressField | PressMap, sensor: Sensor) -> Sensor:
    """A sensor without lens that covers the whole face and the whole field of view."""
    frame = (sensor.columns * sensor.mm_per_pixel[0], sensor.rows * sensor.mm_per_pixel[1])
    extent = np.abs([field.x_mm, field.y_mm]).max() if isinstance(field, PressMap) else field.radius_mm[-1]
    x, y = (float(max(size, 2.02 * extent)) / SURVEY for size in frame)
    return Sensor(columns=SURVEY, rows=SURVEY, mm_per_pixel=(x, y))


def _overlap(survey: Sensor, sensor: Sensor) -> NDArray[np.float64]:
    """Fraction of each of the survey's pixels in the field of view."""
    sizes = zip((sensor.columns, sensor.rows), sensor.mm_per_pixel, survey.mm_per_pixel, strict=True)
    half = [(count * size / 2, pixel) for count, size, pixel in sizes]
    x, y = (
        np.clip((edge - np.abs(centres)) / pixel + 0.5, 0.0, 1.0)
        for centres, (edge, pixel) in zip(survey.axes_mm(), half, strict=True)
    )
    return np.asarray(y[:, None] * x[None, :])


def _outside(light: NDArray[np.float64], inside: NDArray[np.float64]) -> float:
    total = light.sum()
    return float((light * (1 - inside)).sum() / total) if total > 0 else 0.0
