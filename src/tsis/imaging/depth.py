"""Depth of gel sensors in mm, calibrated by presses of a known ball.

Under coloured lamps a colour gives the slope of the face, and the slopes are integrated with free borders; under white
light a grey level gives the depth.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import scipy

from tsis.errors import CalibrationError, InputError, import_extra
from tsis.imaging.colour import largest_channel, require_pattern
from tsis.imaging.gel_change import (
    BLACK,
    GLARE,
    GelLightChange,
    coarse_levels,
    gel_change,
    gel_levels,
    gel_reference,
    light_change,
    marker_pixels,
)
from tsis.imaging.gel_contact import GelContact, find_gel_contact
from tsis.imaging.surface import integrate_gradients
from tsis.mechanics.gel.force import gel_force
from tsis.model.content import ContentValue
from tsis.model.require import freeze_arrays, require_number, require_one_of

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from tsis.model.gel_sensor import GelSensor


SLOPE_METHODS, GREY_METHODS = ("ratio", "polynomial", "table"), ("grey", "relative")  # coloured lamps; white light
GRADIENT_DEGREE = 3  # of the polynomial in the colours
COLOUR_SCALE = 64.0  # levels
PIXELS_AT_ONCE = 4096
RIDGE = 1e-3  # of the mean square of the features
BINS, BIN_LEVELS = 32, 6.0  # of the table, a channel
PATTERN_STEP = 4  # pixels between those that are compared with the reference's pattern
LEVEL_PX, LEVEL_TOUCHED = 80, 0.12  # pixels along the longer side; fraction of the depth that counts as touched
CLIPPED_SD = 3.0  # times the uncertainty where a pixel is clipped
BORDER = 0.06  # of the frame: the strip whose median is the untouched face
DEEPEST_GREY_MM = 10.0
MARKER_FILL = 0.2  # of the markers' pitch: blur of the surroundings that fill a marker
GREY_BLUR = 0.004  # of the columns: under white light a pixel's noise is a depth, as nothing integrates it away
SLOPE_BLUR = 0.004  # of the columns: noise in the colours makes slopes too small where they enter as products
DARKEST = 10.0  # levels of the untouched face, by which a change is divided at most
USED, FLAT = 0.9, 2.2  # of the contact's radius: the ball's slope inside, an almost flat face outside
UNTOUCHED = 3.0  # contact radii from the centre, beyond which a depth is an error
DEEPEST = 0.97  # of the ball's radius
WIDEST = 1.05  # radii of the ball, which no contact exceeds; real presses up to their middle measure 1.007
LIFTED_MM, LIFTED_SD = 0.05, 3.0  # a face that rises by more, in mm and in standard deviations of a depth, is no noise
LIFTED = 1.5  # times the deepest point: good maps rise by 0.6 of it at most, most maps against a press by 2 and more
FEWEST_SLOPE, FEWEST_GREY = 3, 1  # presses
GREY_TERMS = 3  # of the polynomial of depth, without a constant
FORMAT, VERSION = "tsis-depth-calibration", 1
LEAST_SD_MM = 1e-3
LIVE_DRAWS = 20  # of the force's interval, which a live view computes for each frame
OUTLINE_POINTS = 64


def polynomial_features(
    change: NDArray[Any], place: NDArray[Any], degree: int = GRADIENT_DEGREE
) -> NDArray[np.float32]:
    """Monomials of the change of colour, each alone and times x and y of the frame; none is constant.

    Parameters
    ----------
    change
        Levels, shape (n, channels).
    place
        x and y from -1 to 1 over the frame, shape (n, 2).
    degree
        Highest degree in the colours.
    """
    monomials = _monomials(change, degree)
    x, y = np.asarray(place, dtype=np.float32).T
    low = [value for key, value in monomials.items() if len(key) < degree]
    features = [*monomials.values(), *(value * x for value in low), *(value * y for value in low)]
    return np.stack(features, axis=1)


def _monomials(change: NDArray[Any], degree: int) -> dict[tuple[int, ...], NDArray[np.float32]]:
    """Products of up to ``degree`` colours by their channels, shape (n,) each, the lower degrees first."""
    colours = np.asarray(change, dtype=np.float32).T / np.float32(COLOUR_SCALE)
    products: dict[tuple[int, ...], NDArray[np.float32]] = {(channel,): row for channel, row in enumerate(colours)}
    for order in range(2, degree + 1):
        for key in combinations_with_replacement(range(len(colours)), order):
            products[key] = products[key[:-1]] * colours[key[-1]]
    return products


def polynomial_slopes(
    change: NDArray[Any], place: NDArray[Any], weights: NDArray[Any], degree: int = GRADIENT_DEGREE
) -> NDArray[np.float32]:
    """`polynomial_features` times their weights, in blocks that fit into the processor's cache, shape (n, 2)."""
    slope = np.empty((len(change), 2), np.float32)
    for first in range(0, len(change), PIXELS_AT_ONCE):
        block = slice(first, first + PIXELS_AT_ONCE)
        rows = np.stack(list(_monomials(change[block], degree).values()))
        low = (len(weights) - len(rows)) // 2
        of_x, of_y = weights[len(rows) : len(rows) + low], weights[len(rows) + low :]
        x, y = place[block].T
        even, across, down = weights[: len(rows)].T @ rows, of_x.T @ rows[:low], of_y.T @ rows[:low]
        slope[block] = (even + across * x + down * y).T
    return slope


def _fit_polynomial(
    change: NDArray[np.float64], place: NDArray[np.float64], slope: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Weights of the features for both slopes, shape (features, 2)."""
    features = polynomial_features(change, place).astype(np.float64)
    normal = features.T @ features
    normal[np.diag_indices_from(normal)] += RIDGE * np.trace(normal) / len(normal)
    return np.asarray(np.linalg.solve(normal, features.T @ slope))


def _fit_table(change: NDArray[np.float64], slope: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean slope in bins of the change of colour, shape (bins, bins, bins, 2); an empty bin has its nearest's."""
    index = _table_index(change)
    cells = np.ravel_multi_index(index, (BINS,) * 3)
    count = np.bincount(cells, minlength=BINS**3).astype(float)
    table = np.stack(
        [np.bincount(cells, weights=slope[:, axis], minlength=BINS**3) / np.maximum(count, 1.0) for axis in (0, 1)],
        axis=-1,
    ).reshape(BINS, BINS, BINS, 2)
    empty = (count == 0).reshape(BINS, BINS, BINS)
    nearest = scipy.ndimage.distance_transform_edt(empty, return_distances=False, return_indices=True)
    return np.asarray(table[tuple(nearest)])


def _table_index(change: NDArray[Any]) -> tuple[NDArray[np.intp], ...]:
    """Bins of colours in the table, one array a channel."""
    bins = np.clip(np.floor(np.asarray(change) / BIN_LEVELS) + BINS // 2, 0, BINS - 1).astype(np.intp)
    return tuple(bins[..., channel] for channel in range(3))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DepthCalibration(ContentValue):
    """How a sensor's colours or grey levels become depth.

    Attributes
    ----------
    sensor, light
        Name of the sensor, and its light.
    method
        For slopes ``"ratio"``, a polynomial in the change over the untouched light, ``"polynomial"`` in the change, or
        ``"table"``; ``"grey"`` or ``"relative"`` for depth by the change of grey level or by that over the untouched
        brightness. Whichever erred less on presses left out.
    weights
        Of the polynomial, shape (features, 2); the table, shape (bins, bins, bins, 2); or grey levels per mm, mm² and
        mm³, shape (3,).
    ball_mm, presses
        Diameter of the ball, and how many presses were used.
    sd_mm, sd_relative
        Standard deviation of a depth: root mean square distance from the ball's cap of presses that were left out in
        turn, joined with their depth of the untouched face; and the part that grows with the depth.
    errors_mm
        That distance for each press.
    other_sd_mm
        The least one of the methods that were not taken; None where there was no other.
    light_levels
        `coarse_levels` of the untouched sensor at calibration, by which a later change of its light is seen; None in
        files without it.
    """

    sensor: str
    light: Literal["rgb", "white"]
    method: str
    weights: NDArray[np.float64]
    ball_mm: float
    presses: int
    sd_mm: float
    sd_relative: float
    errors_mm: tuple[float, ...] = ()
    other_sd_mm: float | None = None
    light_levels: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        require_one_of("method of a depth calibration", self.method, (*SLOPE_METHODS, *GREY_METHODS))
        require_number("ball_mm", self.ball_mm, 0.2, 200.0)
        freeze_arrays(self, "weights", *(() if self.light_levels is None else ("light_levels",)), dtype=float)
        object.__setattr__(self, "errors_mm", tuple(float(error) for error in self.errors_mm))

    def depth_of_grey(self, change: NDArray[Any]) -> NDArray[np.float64]:
        """Depth of a change of grey level under white light, mm; 0 where the change has the other sign."""
        depths = np.linspace(0.0, DEEPEST_GREY_MM, 4001)
        sign = np.sign(float(self.weights[0])) or 1.0
        levels = sign * depths * np.polynomial.polynomial.polyval(depths, self.weights)
        turn = int(np.argmax(np.diff(levels) <= 0.0)) or depths.size  # beyond the extreme the extreme's depth
        return np.asarray(np.interp(sign * np.asarray(change, dtype=float), levels[: turn + 1], depths[: turn + 1]))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DepthMap(ContentValue):
    """Depth of the face below its untouched shape.

    Attributes
    ----------
    depth_mm, sd_mm
        Depth, positive where pressed, and its standard deviation, shape (rows, columns).
    mm_per_pixel
        Size (x, y) of a pixel, mm.
    name
        The frame's name.
    notes, problems
        What was corrected; and what speaks against the depth. One sentence each.
    """

    depth_mm: NDArray[np.float64]
    sd_mm: NDArray[np.float64]
    mm_per_pixel: tuple[float, float]
    name: str = ""
    notes: tuple[str, ...] = ()
    problems: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        freeze_arrays(self, "depth_mm", "sd_mm", dtype=float)
        if self.depth_mm.ndim != 2 or self.sd_mm.shape != self.depth_mm.shape:
            raise InputError(f"depth_mm and sd_mm must have one shape (rows, columns); got {self.depth_mm.shape}")

    def points(self) -> NDArray[np.float64]:
        """Points (x, y, z) in mm, one a pixel, z = -depth; x and y from the middle of the frame."""
        return np.stack([*np.meshgrid(*self._axes_mm()), -self.depth_mm], axis=-1).reshape(-1, 3)

    def ply_bytes(self) -> bytes:
        """The points as a binary PLY file."""
        points = self.points().astype("<f4")
        axes = "".join(f"property float {axis}\n" for axis in "xyz")
        header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n{axes}end_header\n"
        return header.encode() + points.tobytes()

    def to_xarray(self) -> Any:
        """An ``xarray.Dataset`` with ``depth_mm`` and ``sd_mm`` over ``y`` and ``x`` in mm; needs ``analysis``."""
        xarray = import_extra("xarray", feature="a depth map for xarray", extra="analysis")
        x, y = self._axes_mm()
        layers = {"depth_mm": (("y", "x"), self.depth_mm), "sd_mm": (("y", "x"), self.sd_mm)}
        return xarray.Dataset(layers, coords={"x": x, "y": y}, attrs={"frame": self.name})

    def _axes_mm(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Coordinates (x, y) of the columns and the rows from the middle of the frame."""
        (rows, columns), (width, height) = self.depth_mm.shape, self.mm_per_pixel
        return (np.arange(columns) - (columns - 1) / 2) * width, (np.arange(rows) - (rows - 1) / 2) * height


PRESSED, MOST_CLIPPED_PRESSED = 0.2, 0.02  # of the depth; fraction of such pixels
_CLIPPED = "Clipped pixels lie in the contact, where the depth is wrong: lower the exposure or the lamps."
_LIFTED = (
    "The face rises by {:.2f} mm above the untouched one, more than it sinks: reference and press may be swapped, or "
    "the reference shows a contact."
)
_LARGE_CHANGE = (
    "The light changed since {} more than can be corrected, or the frame does not tell: set lamps and camera as then, "
    "or calibrate again."
)


def _light_note(since: str, light: GelLightChange) -> str:
    gains = ", ".join(f"{gain:.2f}" for gain in light.gain)
    return f"The light changed since {since} (gain {gains}; gamma {light.gamma:.2f}): corrected, and part of the sd."


class DepthMapper:
    """Depth maps of one calibrated sensor and one reference, frame after frame.

    Raises `InputError` when the calibration is of another kind of light, or the scale is not known.

    Parameters
    ----------
    calibration
        Of `calibrate_depth`.
    sensor, reference
        The sensor, whose scale must be known, and a frame of it untouched.
    """

    def __init__(self, calibration: DepthCalibration, sensor: GelSensor, reference: Any) -> None:
        if calibration.light != sensor.light:
            raise InputError(
                f"the depth calibration must be of {sensor.light} light, as {sensor.name} has; got {calibration.light}"
            )
        self.calibration, self.sensor = calibration, sensor
        self.reference = gel_levels(reference, sensor, what="reference").astype(np.float32)
        rows, columns = self.reference.shape[:2]
        scale = sensor.scale_of(columns, rows)
        if scale is None:
            raise InputError(f"mm_per_pixel of {sensor.name} is not known; put it into the sensor's file")
        self.mm_per_pixel = scale
        self.untouched, stored = self.reference, calibration.light_levels
        self.since_calibration = GelLightChange(gain=np.ones(self.reference.shape[2]))
        if stored is not None:
            coarse = coarse_levels(self.reference)
            if coarse.shape == stored.shape:
                self.since_calibration = light_change(coarse, stored, whole=True)
        if self.since_calibration.known:
            self.reference = self.since_calibration.undone(self.reference)
        self.brightness = _relative_brightness(self.reference)
        self.place = _frame_places(rows, columns)
        self.strip = _border_strip(rows, columns)

    def map(self, frame: Any, *, name: str = "") -> DepthMap:
        """The depth map of a frame; errors as `contacts`."""
        return self.map_levels(gel_levels(frame, self.sensor, what=name or "frame"), name=name)

    def map_levels(self, frame_levels: NDArray[np.float64], *, name: str = "") -> DepthMap:
        """The depth map of the levels of a frame, as `gel_levels` makes them."""
        levels = frame_levels.astype(np.float32)
        if levels.shape != self.reference.shape:
            sizes = [f"{part.shape[1]} x {part.shape[0]}" for part in (levels, self.reference)]
            raise InputError(f"reference must have the size of {name or 'frame'}, {sizes[0]} pixels; got {sizes[1]}")
        coarse = np.s_[::PATTERN_STEP, ::PATTERN_STEP]
        require_pattern(levels[coarse], self.reference[coarse], name or "the frame", blur_px=0.5)
        as_stored, light = levels, light_change(levels, self.untouched)
        changes = [("the untouched frame", light), ("calibration", self.since_calibration)]
        for _, step in changes:
            levels = step.undone(levels) if step.known else levels
        change = _colour_change(levels, self.reference, self.calibration.method)
        if self.sensor.marker_pitch_mm is not None:
            change = _filled_markers(change, levels, self.reference, self.sensor)
        # The lamps' drift is the change of the strip along the border, where nothing presses most of the time.
        change -= np.median(change[self.strip], axis=0)
        if self.sensor.light == "white":
            if self.calibration.method == "relative":
                change = change / self.brightness[..., None]
            grey = scipy.ndimage.gaussian_filter(change[..., 0], GREY_BLUR * change.shape[1])
            depth = self.calibration.depth_of_grey(grey)
            # Such a depth is never below 0: what lies above the untouched face is the depth of the opposite change.
            lifted = float(self.calibration.depth_of_grey(-np.array([grey.min(), grey.max()])).max())
        else:
            slope = self._slopes(change)
            depth = integrate_gradients(slope[..., 0], slope[..., 1], self.mm_per_pixel)
            depth = self._levelled(depth - np.median(depth[self.strip]))
            lifted = -float(depth.min())
        relative = np.linalg.norm([self.calibration.sd_relative, *(step.relative_sd for _, step in changes)])
        sd = np.hypot(self.calibration.sd_mm, relative * depth)
        brightest = largest_channel(as_stored)
        clipped = (brightest >= GLARE) | (brightest <= BLACK)
        pressed = depth > PRESSED * depth.max()
        problems = [_LARGE_CHANGE.format(since) for since, step in changes if step.is_large]
        if depth.max() > 3.0 * self.calibration.sd_mm and clipped[pressed].mean() > MOST_CLIPPED_PRESSED:
            problems.append(_CLIPPED)
        if lifted > max(LIFTED * depth.max(), LIFTED_MM, LIFTED_SD * self.calibration.sd_mm):
            problems.append(_LIFTED.format(lifted))
        return DepthMap(
            depth_mm=depth,
            sd_mm=np.where(clipped, CLIPPED_SD * sd, sd),
            mm_per_pixel=self.mm_per_pixel,
            name=name,
            notes=tuple(_light_note(since, step) for since, step in changes if step.known and not step.is_small),
            problems=tuple(problems),
        )

    def _levelled(self, depth: NDArray[np.float64]) -> NDArray[np.float64]:
        """The map less the plane of the untouched face: an even error of the slopes tilts the whole map."""
        step = max(1, round(max(depth.shape) / LEVEL_PX))
        coarse = depth[::step, ::step]
        y, x = np.mgrid[-1 : 1 : coarse.shape[0] * 1j, -1 : 1 : coarse.shape[1] * 1j]
        plane, level = np.stack([np.ones_like(x), x, y], axis=-1), np.zeros(3)
        for _ in range(3):
            left = coarse - plane @ level
            near = np.sqrt(np.count_nonzero(left > 0.3 * left.max()) / np.pi) / 2.0
            touched = scipy.ndimage.binary_dilation(left > LEVEL_TOUCHED * left.max(), iterations=max(2, int(near)))
            if touched.mean() > 0.7:
                return depth
            level = np.linalg.lstsq(plane[~touched], coarse[~touched], rcond=None)[0]
        places = self.place.reshape(*depth.shape, 2)
        return np.asarray(depth - level[0] - places @ level[1:].astype(np.float32))

    def _slopes(self, change: NDArray[np.float32]) -> NDArray[np.float32]:
        flat = change.reshape(-1, change.shape[2])
        if self.calibration.method == "table":
            slope = self.calibration.weights.astype(np.float32)[_table_index(flat)]
        else:
            slope = polynomial_slopes(flat, self.place, self.calibration.weights.astype(np.float32))
        return np.asarray(slope.reshape(*change.shape[:2], 2))


def _colour_change(levels: NDArray[Any], reference: NDArray[Any], method: str) -> NDArray[Any]:
    """Change of the levels against the untouched face, shape (rows, columns, channels)."""
    change = levels - reference
    if method == "ratio":
        # Over the untouched light: lamps that are nearer, a vignette and a pattern of the face scale both, and a drift
        # of the lamps is the same everywhere.
        change = change / np.maximum(reference, DARKEST) * reference.mean(axis=(0, 1))
        blur = SLOPE_BLUR * levels.shape[1]
        change = scipy.ndimage.gaussian_filter(change, (blur, blur, 0.0))
    return np.asarray(change)


def _filled_markers(
    change: NDArray[Any], levels: NDArray[Any], reference: NDArray[Any], sensor: GelSensor
) -> NDArray[np.float32]:
    """The change with that of their surroundings where a marker lies or lay."""
    lies, lay = (marker_pixels(part.astype(np.float64), sensor) for part in (levels, reference))
    marker = scipy.ndimage.binary_dilation(lies | lay, iterations=1)
    side = (sensor.scale_of(marker.shape[1], marker.shape[0]) or (1.0, 1.0))[0]
    blur = MARKER_FILL * (sensor.marker_pitch_mm or 0.0) / side
    weight = scipy.ndimage.gaussian_filter((~marker).astype(np.float32), blur)[..., None]
    around = scipy.ndimage.gaussian_filter(change * ~marker[..., None], (blur, blur, 0.0)) / np.maximum(weight, 1e-3)
    return np.asarray(np.where(marker[..., None], around, change), dtype=np.float32)


def _border_strip(rows: int, columns: int) -> NDArray[np.bool_]:
    """Pixels along the border, where nothing presses most of the time, shape (rows, columns)."""
    strip = np.ones((rows, columns), dtype=bool)
    margin = max(round(BORDER * min(rows, columns)), 1)
    strip[margin:-margin, margin:-margin] = False
    return strip


def _relative_brightness(reference: NDArray[Any]) -> NDArray[Any]:
    """Grey level of the untouched face over its mean, shape (rows, columns)."""
    grey = np.maximum(reference[..., 0], BLACK)
    return np.asarray(grey / grey.mean())


def _frame_places(rows: int, columns: int) -> NDArray[np.float32]:
    """X and y from -1 to 1 over the frame, shape (rows * columns, 2)."""
    y, x = np.mgrid[-1 : 1 : rows * 1j, -1 : 1 : columns * 1j]
    return np.stack([x.ravel(), y.ravel()], axis=1).astype(np.float32)


def cap_error_mm(depth: DepthMap, contact: GelContact, ball_radius_mm: float, *, within: float = 0.8) -> float:
    """Root mean square distance of a map from the cap of a known ball, the press depth the only free number, mm.

    ``within`` is the part of the contact's radius that counts.
    """
    rows, columns = depth.depth_mm.shape
    y, x = np.mgrid[:rows, :columns]
    distance = np.hypot(
        (x - contact.centre_px[0]) * depth.mm_per_pixel[0], (y - contact.centre_px[1]) * depth.mm_per_pixel[1]
    )
    radius = min(contact.radius_px * float(np.sqrt(np.prod(depth.mm_per_pixel))), 0.98 * ball_radius_mm)
    inside = distance < within * radius
    cap = np.sqrt(ball_radius_mm**2 - distance[inside] ** 2)
    return float(np.std(depth.depth_mm[inside] - cap))


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

    Only good contacts count, and a frame that is given several times counts once. Each press is left out in turn to
    measure the error; the method that errs less is taken.

    Raises `CalibrationError` when too few contacts are good, or one is wider than the ball; `InputError` as `contacts`,
    or when the scale is not known.

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
    """
    require_number("ball_mm", ball_mm, 0.2, 200.0, hint="the ball's diameter in millimetres")
    radius = ball_mm / 2.0
    untouched = gel_levels(reference, sensor, what="reference")
    scale = sensor.scale_of(untouched.shape[1], untouched.shape[0])
    if scale is None:
        raise InputError(f"mm_per_pixel of {sensor.name} is not known; put it into the sensor's file")
    presses: list[_Press] = []
    reasons: list[str] = []
    taken: set[bytes] = set()
    for number, frame in enumerate(frames):
        levels = gel_levels(frame, sensor, what=f"frame {number + 1}")
        digest = hashlib.sha256(levels.tobytes()).digest()
        if digest in taken:  # left out in turn, it would be calibrated with itself
            reasons.append("a frame is given twice")
            continue
        taken.add(digest)
        change = gel_change(levels, untouched, sensor, what=f"frame {number + 1}")
        contact = find_gel_contact(change, sensor, name=f"frame {number + 1}")
        reasons += contact.reasons
        if contact.good:
            touched_mm = contact.radius_px * float(np.sqrt(np.prod(scale)))
            if touched_mm > WIDEST * radius:
                raise CalibrationError(
                    f"frame {number + 1} must show a contact that the ball can make, at most {radius:g} mm in radius; "
                    f"it shows {touched_mm:.2f} mm (check the diameter of the ball, {ball_mm:g} mm, and mm_per_pixel)"
                )
            presses.append(_press(frame, levels, contact, change.usable, untouched, sensor, radius))
        if progress is not None:
            progress(number + 1, len(frames))
    fewest = FEWEST_SLOPE if sensor.light == "rgb" else FEWEST_GREY
    if len(presses) < fewest:
        raise CalibrationError(
            f"a depth calibration needs {fewest} good presses of the ball; got {len(presses)} of {len(frames)}"
            + (f" ({', '.join(sorted(set(reasons)))}): run tsis contacts to see why" if reasons else "")
        )
    methods = SLOPE_METHODS if sensor.light == "rgb" else GREY_METHODS
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
        light_levels=coarse_levels(untouched).round(2),
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
    strip = _border_strip(rows, columns)
    pixels = used if sensor.light == "rgb" else inside
    changes = {}
    for method in SLOPE_METHODS if sensor.light == "rgb" else ("grey",):
        change = _colour_change(levels, untouched, method)
        # As in a map: the median of the whole frame is not 0 where a deep press pulls the face down far around it.
        changes[method] = (change - np.median(change[strip], axis=0))[pixels]
    height = np.sqrt(np.maximum(ball**2 - distance**2, (0.1 * ball) ** 2))
    slope = np.where(inside[..., None], -np.stack([x_mm, y_mm], axis=-1) / height[..., None], 0.0)
    place = _frame_places(rows, columns).reshape(rows, columns, 2)
    return _Press(
        frame=frame,
        contact=contact,
        change=changes,
        inside=inside[used],
        place=place[used].astype(float),
        slope=slope[used],
        shape_mm=(ball - height)[inside],
        brightness=_relative_brightness(untouched)[inside],
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
        weights = _fit_table(change, slope) if method == "table" else _fit_polynomial(change, place, slope)
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
    """Distance from the cap and depth of the untouched face of each press, calibrated without it where it can be."""
    parts = min(len(presses), 8)  # so many presses or groups are left out in turn
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
    values |= {"weights": calibration.weights.round(6).tolist(), "errors_mm": list(calibration.errors_mm)}
    values["light_levels"] = None if calibration.light_levels is None else calibration.light_levels.tolist()
    return json.dumps({"format": FORMAT, "version": VERSION, **values}).encode()


def parse_depth_calibration(document: Any) -> DepthCalibration:
    """The calibration of such a file; `InputError` when it is none."""
    if not isinstance(document, dict) or document.get("format") != FORMAT or document.get("version") != VERSION:
        raise InputError("it must be a depth calibration, which tsis depth calibrate writes; got another file")
    values = {key: value for key, value in document.items() if key not in ("format", "version")}
    try:
        if values.get("light_levels") is not None:
            values["light_levels"] = np.asarray(values["light_levels"], dtype=float)
        return DepthCalibration(**values | {"weights": np.asarray(values.get("weights"), dtype=float)})
    except TypeError as error:
        raise InputError(f"a depth calibration must hold its values and no others; got: {error}") from error


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

    Errors as `contacts`, `DepthMapper.map` and `tsis.mechanics.gel.force.gel_force`.
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
        problems=(*depth.problems, *force.problems),
    )


def _outline(contact: GelContact) -> tuple[tuple[float, float], ...]:
    turn, along = np.radians(contact.angle_deg), 2 * np.pi * np.arange(OUTLINE_POINTS) / OUTLINE_POINTS
    long, short = contact.semi_axes_px[0] * np.cos(along), contact.semi_axes_px[1] * np.sin(along)
    x = contact.centre_px[0] + long * np.cos(turn) - short * np.sin(turn)
    y = contact.centre_px[1] + long * np.sin(turn) + short * np.cos(turn)
    return tuple((round(float(across), 2), round(float(down), 2)) for across, down in zip(x, y, strict=True))
