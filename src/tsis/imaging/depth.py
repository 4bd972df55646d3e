"""Depth of gel sensors, calibrated by presses of a known ball: the slope of a colour, or the depth of a grey level."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from tsis.errors import CalibrationError, InputError
from tsis.imaging._depth_map import (
    DEPTH_METHODS,
    GRADIENT_DEGREE,
    DepthCalibration,
    DepthMap,
    DepthMapper,
    border_strip,
    cap_error_mm,
    colour_change,
    fit_polynomial,
    fit_table,
    frame_places,
    polynomial_features,
    polynomial_slopes,
    relative_brightness,
)
from tsis.imaging._gel_change import gel_change, gel_levels, gel_reference
from tsis.imaging._gel_contacts import GelContact, find_gel_contact
from tsis.imaging._height_surface import integrate_gradients
from tsis.mechanics.gel import gel_force
from tsis.model.require import require_number

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from tsis.model.gel_sensor import GelSensor


__all__ = [
    "DEPTH_METHODS",
    "GRADIENT_DEGREE",
    "DepthCalibration",
    "DepthMap",
    "DepthMapper",
    "GelReading",
    "calibrate_depth",
    "cap_error_mm",
    "depth_calibration_json",
    "gel_reading",
    "integrate_gradients",
    "parse_depth_calibration",
    "polynomial_features",
    "polynomial_slopes",
]
SLOPE_METHODS = ("ratio", "polynomial", "table")
USED, FLAT = 0.9, 2.2  # of the contact's radius: the ball's slope inside, an almost flat face outside
UNTOUCHED = 3.0  # contact radii from the centre, beyond which a depth is an error
DEEPEST = 0.97  # of the ball's radius
FEWEST_SLOPE, FEWEST_GREY = 3, 1  # presses
GREY_TERMS = 3  # of the polynomial of depth, without a constant
FORMAT, VERSION = "tsis-depth-calibration", 1
LEAST_SD_MM = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Press:
    frame: Any
    contact: GelContact
    change: dict[str, NDArray[np.float64]]  # by method
    inside: NDArray[np.bool_]
    place: NDArray[np.float64]
    slope: NDArray[np.float64]
    shape_mm: NDArray[np.float64]
    brightness: NDArray[np.float64]


def calibrate_depth(
    frames: Sequence[Any],
    *,
    sensor: GelSensor,
    reference: Any,
    ball_mm: float,
    progress: Callable[[int, int], None] | None = None,
) -> DepthCalibration:
    """Calibrate depth from presses of a ball of known diameter.

    Only good contacts count. Each press is left out in turn to measure the error; the method that errs less is taken.

    Parameters
    ----------
    frames
        Presses at different places, at least three good ones under coloured lamps, one under white light.
    sensor, reference
        The sensor, with its scale, and a frame of it untouched.
    ball_mm
        Diameter of the ball, mm.
    progress
        Called with the number of finished presses and of all.

    Raises
    ------
    CalibrationError
        When too few contacts are good.
    InputError
        As `contacts`, or when the scale is not known.
    """
    require_number("ball_mm", ball_mm, 0.2, 200.0, hint="the ball's diameter in millimetres")
    radius = ball_mm / 2.0
    untouched = gel_levels(reference, sensor, what="reference")
    if sensor.scale_of(untouched.shape[1], untouched.shape[0]) is None:
        raise InputError(f"mm_per_pixel of {sensor.name} is not known; put it into the sensor's file")
    presses: list[_Press] = []
    reasons: list[str] = []
    for number, frame in enumerate(frames):
        levels = gel_levels(frame, sensor, what=f"frame {number + 1}")
        change = gel_change(levels, untouched, sensor, what=f"frame {number + 1}")
        contact = find_gel_contact(change, sensor, name=f"frame {number + 1}")
        reasons += contact.reasons
        if contact.good:
            presses.append(_press(frame, levels, contact, change.usable, untouched, sensor, radius))
        if progress is not None:
            progress(number + 1, len(frames))
    fewest = FEWEST_SLOPE if sensor.light == "rgb" else FEWEST_GREY
    if len(presses) < fewest:
        raise CalibrationError(
            f"a depth calibration needs {fewest} good presses of the ball; got {len(presses)} of {len(frames)}"
            + (f" ({', '.join(sorted(set(reasons)))}): run tsis contacts to see why" if reasons else "")
        )
    methods = SLOPE_METHODS if sensor.light == "rgb" else ("grey", "relative")
    tried = {method: _left_out(presses, method, sensor, reference, ball_mm) for method in methods}
    rms = {method: float(np.sqrt(np.mean(np.square(errors[:, 0])))) for method, errors in tried.items()}
    best = min(rms, key=lambda method: rms[method])
    others = [value for method, value in rms.items() if method != best]
    deepest = float(np.median([press.shape_mm.max() for press in presses]))
    cap, zero = tried[best].T
    return replace(
        _fitted(presses, best, sensor, ball_mm),
        sd_mm=max(float(np.hypot(rms[best], np.sqrt(np.mean(np.square(zero))))), LEAST_SD_MM),
        sd_relative=float(np.std(cap)) / max(deepest, 1e-6) if len(presses) > 1 else 0.1,
        errors_mm=tuple(float(error) for error in cap),
        other_sd_mm=min(others, default=None),
    )


def _press(
    frame: Any,
    levels: NDArray[np.float64],
    contact: GelContact,
    usable: NDArray[np.bool_],
    untouched: NDArray[np.float64],
    sensor: GelSensor,
    ball: float,
) -> _Press:
    """Pixels of the ball's cap and of the flat face, with their slopes."""
    rows, columns = usable.shape
    sx, sy = sensor.scale_of(columns, rows) or (1.0, 1.0)
    y, x = np.mgrid[:rows, :columns]
    x_mm, y_mm = (x - contact.centre_px[0]) * sx, (y - contact.centre_px[1]) * sy
    distance = np.hypot(x_mm, y_mm)
    touched = min(contact.radius_px * float(np.sqrt(sx * sy)), DEEPEST * ball)
    inside, flat = (distance < USED * touched) & usable, (distance > FLAT * touched) & usable
    rng = np.random.default_rng(0)  # as many flat pixels as touched ones
    flat &= rng.random(flat.shape) < inside.sum() / max(flat.sum(), 1)
    used = inside | flat
    strip = border_strip(rows, columns)
    pixels = used if sensor.light == "rgb" else inside
    changes = {}
    for method in SLOPE_METHODS if sensor.light == "rgb" else ("grey",):
        change = colour_change(levels, untouched, method)
        # As in a map: the median of the whole frame is not 0 where a deep press pulls the face down far around it.
        changes[method] = (change - np.median(change[strip], axis=0))[pixels]
    height = np.sqrt(np.maximum(ball**2 - distance**2, (0.1 * ball) ** 2))
    slope = np.where(inside[..., None], -np.stack([x_mm, y_mm], axis=-1) / height[..., None], 0.0)
    place = frame_places(rows, columns).reshape(rows, columns, 2)
    return _Press(
        frame=frame,
        contact=contact,
        change=changes,
        inside=inside[used],
        place=place[used].astype(float),
        slope=slope[used],
        shape_mm=(ball - height)[inside],
        brightness=relative_brightness(untouched)[inside],
    )


def _fitted(presses: Sequence[_Press], method: str, sensor: GelSensor, ball_mm: float) -> DepthCalibration:
    if sensor.light == "white":
        weights = _fit_grey(presses, sensor, relative=method == "relative")
    else:
        # The table needs the flat face; a polynomial without a constant does not, and noise would bend it there.
        used = [np.ones_like(press.inside) if method == "table" else press.inside for press in presses]
        change = np.concatenate([press.change[method][part] for press, part in zip(presses, used, strict=True)])
        place, slope = (
            np.concatenate([getattr(press, name)[part] for press, part in zip(presses, used, strict=True)])
            for name in ("place", "slope")
        )
        weights = fit_table(change, slope) if method == "table" else fit_polynomial(change, place, slope)
    return DepthCalibration(
        sensor=sensor.name, light=sensor.light, method=method, weights=weights, ball_mm=ball_mm,
        presses=len(presses), sd_mm=LEAST_SD_MM, sd_relative=0.0,
    )  # fmt: skip


def _fit_grey(presses: Sequence[_Press], sensor: GelSensor, *, relative: bool) -> NDArray[np.float64]:
    """Grey levels per mm, mm² and mm³ of depth; the press depth of each press is free."""
    sign = -1.0 if sensor.pressed == "darker" else 1.0
    changes = [sign * press.change["grey"][:, 0] / (press.brightness if relative else 1.0) for press in presses]
    deepest = [float(press.shape_mm.max()) / USED**2 * 1.3 for press in presses]
    start = [max(float(np.quantile(change, 0.95)) for change in changes) / max(deepest), 0.0, 0.0, *deepest]

    def residual(values: NDArray[np.float64]) -> NDArray[np.float64]:
        parts = []
        for press, change, depth in zip(presses, changes, values[GREY_TERMS:], strict=True):
            below = depth - press.shape_mm
            parts.append(change - below * np.polynomial.polynomial.polyval(below, values[:GREY_TERMS]))
        return np.concatenate(parts)

    solution = scipy.optimize.least_squares(
        residual, start, x_scale=np.maximum(np.abs(start), 1.0), loss="soft_l1", f_scale=3.0
    )
    return np.asarray(sign * solution.x[:GREY_TERMS])


def _left_out(
    presses: Sequence[_Press], method: str, sensor: GelSensor, reference: Any, ball_mm: float
) -> NDArray[np.float64]:
    """Errors of each press, calibrated without it where there are others enough, at most 8 in turn; shape (presses, 2).

    The distance from the ball's cap, and the depth of the untouched face, which should be 0.
    """
    parts = min(len(presses), 8)
    errors = np.zeros((len(presses), 2))
    for part in range(parts):
        rest = [press for number, press in enumerate(presses) if number % parts != part] or list(presses)
        mapper = DepthMapper(_fitted(rest, method, sensor, ball_mm), sensor, reference)
        for number in range(part, len(presses), parts):
            press = presses[number]
            depth = mapper.map(press.frame)
            errors[number] = cap_error_mm(depth, press.contact, ball_mm / 2.0), _zero_error_mm(depth, press.contact)
    return errors


def _zero_error_mm(depth: DepthMap, contact: GelContact) -> float:
    """Root mean square depth where the face is untouched; 0 where nothing of it is in the frame."""
    y, x = np.mgrid[: depth.depth_mm.shape[0], : depth.depth_mm.shape[1]]
    far = np.hypot(x - contact.centre_px[0], y - contact.centre_px[1]) > UNTOUCHED * contact.radius_px
    return float(np.sqrt(np.mean(np.square(depth.depth_mm[far])))) if far.any() else 0.0


def depth_calibration_json(calibration: DepthCalibration) -> bytes:
    """The calibration as a JSON file."""
    values = {name: getattr(calibration, name) for name in calibration.__slots__}
    document = values | {"weights": calibration.weights.round(6).tolist(), "errors_mm": list(calibration.errors_mm)}
    return json.dumps({"format": FORMAT, "version": VERSION, **document}).encode()


def parse_depth_calibration(document: Any) -> DepthCalibration:
    """The calibration of such a file; `InputError` when it is none."""
    if not isinstance(document, dict) or document.get("format") != FORMAT or document.get("version") != VERSION:
        raise InputError("it must be a depth calibration, which tsis depth calibrate writes; got another file")
    values = {key: value for key, value in document.items() if key not in ("format", "version")}
    try:
        return DepthCalibration(**values | {"weights": np.asarray(values.get("weights"), dtype=float)})
    except TypeError as error:
        raise InputError(f"a depth calibration must hold its values and no others; got: {error}") from error


LIVE_DRAWS = 20  # of the force's interval, which a live view computes for each frame
OUTLINE_POINTS = 64


@dataclass(frozen=True, slots=True, kw_only=True)
class GelReading:
    """What a live view of a gel sensor shows of one frame.

    Attributes
    ----------
    good, quality, reasons
        Whether the contact can be used, its quality from 0 to 1, and names of what is wrong.
    centre_px, radius_px, outline_px
        Centre (x, y), radius and points (x, y) of the contact's outline in pixels; None, None and empty without one.
    radius_mm, radius_sd_mm
        Radius and its standard deviation; None without a contact, or where the scale is not known.
    deepest_mm, force_n, force_interval_n
        Deepest point of the face, and the normal force in newtons with its 90 % interval; None without a depth
        calibration, or where the contact is not good.
    problems
        What speaks against the force, one message each.
    """

    good: bool
    quality: float
    reasons: tuple[str, ...]
    centre_px: tuple[float, float] | None = None
    radius_px: float | None = None
    outline_px: tuple[tuple[float, float], ...] = ()
    radius_mm: float | None = None
    radius_sd_mm: float | None = None
    deepest_mm: float | None = None
    force_n: float | None = None
    force_interval_n: tuple[float, float] | None = None
    problems: tuple[str, ...] = ()


def gel_reading(frame: Any, *, sensor: GelSensor, reference: Any, mapper: DepthMapper | None = None) -> GelReading:
    """Contact of one frame, and with the mapper of a depth calibration depth and force of a good contact.

    Errors as `contacts`, `DepthMapper.map` and `tsis.mechanics.gel.gel_force`.
    """
    levels, untouched = gel_levels(frame, sensor), gel_reference([frame], sensor, reference)
    contact = find_gel_contact(gel_change(levels, untouched, sensor), sensor)
    reading = GelReading(good=contact.good, quality=contact.quality, reasons=contact.reasons)
    if not np.isfinite(contact.radius_px):
        return reading
    reading = replace(
        reading,
        centre_px=contact.centre_px,
        radius_px=contact.radius_px,
        outline_px=_outline(contact),
        radius_mm=contact.radius_mm,
        radius_sd_mm=contact.radius_sd_mm,
    )
    if mapper is None or not contact.good:
        return reading
    depth = mapper.map_levels(levels)
    force = gel_force(depth.depth_mm, sensor=sensor, sd_mm=depth.sd_mm, draws=LIVE_DRAWS)
    return replace(
        reading,
        deepest_mm=force.deepest_mm,
        force_n=force.force_n,
        force_interval_n=force.interval_n(),
        problems=force.problems,
    )


def _outline(contact: GelContact) -> tuple[tuple[float, float], ...]:
    turn, along = np.radians(contact.angle_deg), 2 * np.pi * np.arange(OUTLINE_POINTS) / OUTLINE_POINTS
    long, short = contact.semi_axes_px[0] * np.cos(along), contact.semi_axes_px[1] * np.sin(along)
    x = contact.centre_px[0] + long * np.cos(turn) - short * np.sin(turn)
    y = contact.centre_px[1] + long * np.sin(turn) + short * np.cos(turn)
    return tuple((round(float(across), 2), round(float(down), 2)) for across, down in zip(x, y, strict=True))
