"""Expected light of a press on the sensor.

Three models of the light that leaves a pressed face stand side by side, so that the choice can be tested. Measurements
support ``RoughContact``: light leaves where asperities touch, so it follows the pressure.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.errors import InputError
from tsis.imaging.pixels import gaussian_blur, paint
from tsis.imaging.sensor import Sensor
from tsis.model.calibration import LightMap
from tsis.model.press import PressMap, interpolation_matrix
from tsis.model.require import require_number, require_one_of, require_type
from tsis.optics.angles import ERF_SLOPE, real_contact

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.model.calibration import Calibration
    from tsis.model.press import PressField


WIDEST_BLUR_MM = 10.0
SURVEY = 1024  # pixels across a survey of the whole face


@dataclass(frozen=True, slots=True, kw_only=True)
class RoughContact:
    """Light leaves through the real contact of asperities, which grows with the pressure: ``erf(0.886 p / p_sat)``.

    Examples
    --------
    >>> fraction = RoughContact().light_fraction(np.array([0.0, 1.0, 100.0]), slope=np.zeros(3), saturation_kpa=20.0)
    >>> fraction.round(3).tolist()
    [0.0, 0.05, 1.0]
    """

    def light_fraction(
        self, pressure_kpa: NDArray[np.float64], *, slope: NDArray[np.float64], saturation_kpa: float
    ) -> NDArray[np.float64]:
        """Fraction of the light that leaves, in [0, 1], in the shape of the pressure; ``slope`` has no effect."""
        del slope
        # For the unspecified function in the dissertation's (5.2).
        return real_contact(pressure_kpa, saturation_kpa)


@dataclass(frozen=True, slots=True, kw_only=True)
class SmoothContact:
    """Light leaves where smooth surfaces touch, at any pressure: it follows the area of the contact."""

    def light_fraction(
        self, pressure_kpa: NDArray[np.float64], *, slope: NDArray[np.float64], saturation_kpa: float
    ) -> NDArray[np.float64]:
        """1 where there is pressure, else 0; slope and saturation have no effect."""
        del slope, saturation_kpa
        return np.asarray(pressure_kpa > 0, dtype=float)


@dataclass(frozen=True, slots=True, kw_only=True)
class CurvatureLoss:
    """Light leaves without contact, where the dent tilts the face beyond total reflection.

    Guided light of even radiance fills all directions beyond the critical angle from the undented face's normal. The
    fraction of its power that meets the tilted face within the critical angle leaves; partial reflection is neglected.
    For small slopes that is ``2 / pi * tan(critical) * slope``. The refractive index is that of the layer at the face,
    against air, in [1.01, 4].

    Examples
    --------
    >>> slope = np.array([0.0, 0.01, 0.5])
    >>> CurvatureLoss().light_fraction(np.ones(3), slope=slope, saturation_kpa=20.0).round(3).tolist()
    [0.0, 0.006, 0.337]
    """

    refractive_index: float = 1.41

    def __post_init__(self) -> None:
        require_number("refractive_index", self.refractive_index, 1.01, 4.0)

    def light_fraction(
        self, pressure_kpa: NDArray[np.float64], *, slope: NDArray[np.float64], saturation_kpa: float
    ) -> NDArray[np.float64]:
        """Fraction of the light that leaves, in [0, 1], in the shape of the slope (either sign), at any pressure."""
        del pressure_kpa, saturation_kpa
        sine = 1 / self.refractive_index
        cosine = np.sqrt(1 - sine**2)
        tilt = np.arctan(np.abs(slope))
        # Projected along the tilted normal, the directions that leave fill a disc; an ellipse over it has never been
        # guided. The rest of the disc is integrated along its chords, which are whole beyond `limit`.
        cosine_of_limit = np.minimum(cosine / sine * np.tan(tilt / 2), 1.0)
        limit, sine_of_limit = np.arccos(cosine_of_limit), np.sqrt(1 - cosine_of_limit**2)
        half_chords = limit + sine_of_limit * cosine_of_limit
        cut = sine**2 * (1 - np.cos(tilt)) * half_chords + 2 * sine * cosine * np.sin(tilt) * sine_of_limit
        whole = sine**2 * (np.pi - 2 * half_chords)
        return np.asarray(np.minimum((cut + whole) / (np.pi * cosine**2), 1.0))


ContactModel = RoughContact | SmoothContact | CurvatureLoss
CONTACT_MODELS: dict[str, ContactModel] = {
    "rough": RoughContact(),
    "smooth": SmoothContact(),
    "curvature": CurvatureLoss(),
}


def as_contact_model(model: ContactModel | str) -> ContactModel:
    """The model of that name, or the model itself."""
    if isinstance(model, str):
        return CONTACT_MODELS[require_one_of("contact_model", model, CONTACT_MODELS)]
    if not isinstance(model, ContactModel):
        raise InputError(f"contact_model must be one of {', '.join(CONTACT_MODELS)} or a model; got {model!r:.80}")
    return model


def rough_contact(pressure_kpa: NDArray[np.float64], calibration: Calibration) -> NDArray[np.float64]:
    """Grey level above background of a contact pressure in kPa (any shape) by the rough model, under even light.

    Examples
    --------
    >>> from tsis.model.calibration import Calibration
    >>> calibration = Calibration(gain_grey_per_kpa=50.0, saturation_kpa=20.0)
    >>> [round(float(grey), 1) for grey in rough_contact(np.array([-1.0, 0.1, 1000.0]), calibration)]
    [0.0, 5.0, 1000.0]
    """
    level = calibration.gain_grey_per_kpa * calibration.saturation_kpa
    return level * real_contact(pressure_kpa, calibration.saturation_kpa)


def rough_contact_slope(pressure_kpa: NDArray[np.float64], calibration: Calibration) -> NDArray[np.float64]:
    """Derivative of `rough_contact` by the pressure, grey levels per kPa."""
    exponent = -((ERF_SLOPE * pressure_kpa / calibration.saturation_kpa) ** 2)
    return np.asarray(calibration.gain_grey_per_kpa * np.exp(exponent) * (pressure_kpa >= 0), dtype=float)


def contact_edges(field: PressField) -> list[tuple[float, int]]:
    """Radius in mm of every edge of the contact, each with 1 where the contact lies inside it and -1 outside."""
    radius, pressure = field.radius_mm, field.pressure_kpa
    touched = np.concatenate([pressure > 0, [False]])
    edges = []
    for last in np.flatnonzero(touched[1:] != touched[:-1]).tolist():
        if last == len(radius) - 1:  # contact up to the rim
            edges.append((float(radius[-1]), 1))
        elif touched[last]:
            edges.append((_end(radius, pressure, last, 1), 1))
        else:
            edges.append((_end(radius, pressure, last + 1, -1), -1))
    return edges


def coverage(field: PressField, sensor: Sensor) -> NDArray[np.float64]:
    """Fraction of each pixel in contact, shape (rows, columns); edges are straight inside a pixel."""
    x, y = sensor.axes_mm()
    radius = sensor.radius_mm()
    extent = np.maximum(np.abs(x)[None, :] * sensor.mm_per_pixel[0], np.abs(y)[:, None] * sensor.mm_per_pixel[1])
    width = extent / np.maximum(radius, 1e-12)  # of a pixel along the radius, but for its corners
    width = np.maximum(width, min(sensor.mm_per_pixel) / 2)  # the pixel on the axis has no direction
    covered = np.zeros(radius.shape)
    for edge, side in contact_edges(field):
        covered += side * np.clip((edge - radius) / width + 0.5, 0.0, 1.0)
    return covered


def _end(radius: NDArray[np.float64], pressure: NDArray[np.float64], last: int, step: int) -> float:
    """Radius at which the pressure vanishes beyond the closed node ``last``: it falls with the root of the distance."""
    inner = last - step
    if not 0 <= inner < len(radius) or not pressure[inner] > pressure[last]:
        return float((radius[last] + radius[last + step]) / 2)
    falling = (pressure[inner] ** 2 - pressure[last] ** 2) / (radius[last] - radius[inner])
    end = radius[last] + pressure[last] ** 2 / falling
    return float(min(end, radius[last + step]) if step > 0 else max(end, radius[last + step]))


def render(
    field: PressField | PressMap,
    sensor: Sensor,
    calibration: Calibration,
    *,
    blur_mm: float = 0.05,
    contact_model: ContactModel | str = "rough",
    light: LightMap | None = None,
) -> NDArray[np.float64]:
    """Expected light of a press on the sensor, before noise.

    Raises `InputError` when the blur lies outside its range, the contact model is unknown or the light is no
    `LightMap`.

    Parameters
    ----------
    field
        The press, around the axis or over a grid; dark outside its face.
    sensor
        The camera, with its axis on the probe's axis.
    calibration
        Response of grey level to pressure under light of 1; a full contact gives ``gain * saturation``.
    blur_mm
        Standard deviation of the point spread on the face, mm, in [0, 10].
    contact_model
        Contact model: ``"rough"``, ``"smooth"``, ``"curvature"``, or a value of `tsis.imaging.rendering`.
    light
        Light on the face from inside; even light when None. A map for one press, which includes displacement and slope,
        has neither flux nor growth.

    Returns
    -------
    Grey levels above the background, shape (rows, columns), not clipped.

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
    >>> rough, smooth = (render(press, Sensor(), calibration, contact_model=model) for model in ("rough", "smooth"))
    >>> round(float(rough[246, 384])), round(float(smooth[246, 384]))
    (100, 1000)
    """
    require_number("blur_mm", blur_mm, 0.0, WIDEST_BLUR_MM)
    model, light = as_contact_model(contact_model), light or LightMap.uniform()
    require_type("light", light, LightMap)
    if isinstance(field, PressMap):
        picture = _of_map(field, sensor, calibration, model, light)
    else:
        picture = _of_profile(field, sensor, calibration, model, light)
    picture = _blurred(picture, sensor, blur_mm)
    if sensor.field_angle_deg > 0:
        picture *= sensor.vignetting()
    return picture


def _of_profile(
    field: PressField, sensor: Sensor, calibration: Calibration, model: ContactModel, light: LightMap
) -> NDArray[np.float64]:
    """A round press: profiles of light and slope, rotated around the axis."""
    radius, slope = field.radius_mm, np.gradient(field.face_displacement_mm, field.radius_mm)
    slope[0] = 0.0  # the difference on the axis is one-sided
    fraction = model.light_fraction(field.pressure_kpa, slope=slope, saturation_kpa=calibration.saturation_kpa)
    if isinstance(model, SmoothContact):  # its edge is sharper than the profile; `coverage` resolves it
        fraction = np.ones_like(fraction)
    profiles = (_full_contact(calibration) * fraction, field.face_displacement_mm, slope)
    x, y = sensor.axes_mm()
    maps = (light.relative, light.flux_x, light.flux_y, light.growth_per_mm, light.bend_per_mm2)
    picture = paint(x, y, radius, *profiles, light.x_mm, light.y_mm, *maps)
    if isinstance(model, SmoothContact):
        picture *= coverage(field, sensor)
    return picture


def _of_map(
    field: PressMap, sensor: Sensor, calibration: Calibration, model: ContactModel, light: LightMap
) -> NDArray[np.float64]:
    """A press over a grid, each quantity linear between its nodes; a smooth contact has the edges of the grid."""
    # The displacement is zero outside the face; this step at the rim is no slope of the face.
    inside = scipy.ndimage.binary_erosion(field.face_displacement_mm != 0, border_value=1)
    slope_y, slope_x = inside * np.gradient(field.face_displacement_mm, field.y_mm, field.x_mm)
    steepness = np.hypot(slope_x, slope_y)
    fraction = model.light_fraction(field.pressure_kpa, slope=steepness, saturation_kpa=calibration.saturation_kpa)
    x, y = sensor.axes_mm()
    rows = interpolation_matrix(field.y_mm, y, outside="zero")
    columns = interpolation_matrix(field.x_mm, x, outside="zero").T
    fields = (_full_contact(calibration) * fraction, field.face_displacement_mm, slope_x, slope_y)
    glow, displacement, slope_x, slope_y = (rows @ values @ columns for values in fields)
    return np.asarray(glow * light.at(x, y, displacement_mm=displacement, slope_x=slope_x, slope_y=slope_y))


def _full_contact(calibration: Calibration) -> float:
    """Grey level of full contact."""
    return calibration.gain_grey_per_kpa * calibration.saturation_kpa


def _blurred(picture: NDArray[np.float64], sensor: Sensor, blur_mm: float) -> NDArray[np.float64]:
    if blur_mm == 0:
        return picture
    sigma_x, sigma_y = (blur_mm / size for size in sensor.mm_per_pixel)
    return gaussian_blur(picture, (sigma_y, sigma_x))


def render_reference(
    field: PressField,
    sensor: Sensor,
    calibration: Calibration,
    *,
    blur_mm: float = 0.05,
    contact_model: ContactModel | str = "rough",
    light: LightMap | None = None,
) -> NDArray[np.float64]:
    """Readable reference of `render` for a round press; arguments are not checked."""
    x, y = sensor.axes_mm()
    radius = sensor.radius_mm()
    outwards = np.gradient(field.face_displacement_mm, field.radius_mm)
    outwards[0] = 0.0

    def at_pixels(profile: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.interp(radius, field.radius_mm, profile, right=0.0))

    slope = at_pixels(outwards)
    arriving = (light or LightMap.uniform()).at(
        x,
        y,
        displacement_mm=at_pixels(field.face_displacement_mm),
        slope_x=slope * x[None, :] / np.maximum(radius, 1e-12),
        slope_y=slope * y[:, None] / np.maximum(radius, 1e-12),
    )
    model = as_contact_model(contact_model)
    fraction = model.light_fraction(
        at_pixels(field.pressure_kpa), slope=slope, saturation_kpa=calibration.saturation_kpa
    )
    if isinstance(model, SmoothContact):
        fraction = coverage(field, sensor) * (radius <= field.radius_mm[-1])
    picture = _full_contact(calibration) * arriving * fraction
    size_x, size_y = sensor.mm_per_pixel
    blurred = (
        scipy.ndimage.gaussian_filter(picture, (blur_mm / size_y, blur_mm / size_x), mode="reflect")
        if blur_mm
        else picture
    )
    return np.asarray(blurred * sensor.vignetting())


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

    The arguments and errors are those of `render`.

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
