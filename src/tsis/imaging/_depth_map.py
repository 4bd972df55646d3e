"""Depth maps: slopes of colours, integrated with free borders, or depth of grey levels, in mm with an uncertainty."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations_with_replacement
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import scipy

from tsis.errors import InputError, import_extra
from tsis.imaging._colour import largest_channel, require_pattern
from tsis.imaging._gel_change import BLACK, GLARE, gel_levels, marker_pixels
from tsis.imaging._height_surface import integrate_gradients
from tsis.model.content import ContentValue
from tsis.model.require import freeze_arrays, require_number, require_one_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.imaging._gel_contacts import GelContact
    from tsis.model.gel_sensor import GelSensor


DEPTH_METHODS = ("ratio", "polynomial", "table", "grey", "relative")
GRADIENT_DEGREE = 3  # of the polynomial in the colours
COLOUR_SCALE = 64.0  # levels
PIXELS_AT_ONCE = 4096
RIDGE = 1e-3  # of the mean square of the features
BINS, BIN_LEVELS = 32, 6.0  # of the table, a channel


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


def fit_polynomial(
    change: NDArray[np.float64], place: NDArray[np.float64], slope: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Weights of the features for both slopes, shape (features, 2)."""
    features = polynomial_features(change, place).astype(np.float64)
    normal = features.T @ features
    normal[np.diag_indices_from(normal)] += RIDGE * np.trace(normal) / len(normal)
    return np.asarray(np.linalg.solve(normal, features.T @ slope))


def fit_table(change: NDArray[np.float64], slope: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean slope in bins of the change of colour, shape (bins, bins, bins, 2); an empty bin has its nearest's."""
    index = table_index(change)
    cells = np.ravel_multi_index(index, (BINS,) * 3)
    count = np.bincount(cells, minlength=BINS**3).astype(float)
    table = np.stack(
        [np.bincount(cells, weights=slope[:, axis], minlength=BINS**3) / np.maximum(count, 1.0) for axis in (0, 1)],
        axis=-1,
    ).reshape(BINS, BINS, BINS, 2)
    empty = (count == 0).reshape(BINS, BINS, BINS)
    nearest = scipy.ndimage.distance_transform_edt(empty, return_distances=False, return_indices=True)
    return np.asarray(table[tuple(nearest)])


def table_index(change: NDArray[Any]) -> tuple[NDArray[np.intp], ...]:
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

    def __post_init__(self) -> None:
        require_one_of("method of a depth calibration", self.method, DEPTH_METHODS)
        require_number("ball_mm", self.ball_mm, 0.2, 200.0)
        freeze_arrays(self, "weights", dtype=float)
        object.__setattr__(self, "errors_mm", tuple(float(error) for error in self.errors_mm))

    def depth_of_grey(self, change: NDArray[Any]) -> NDArray[np.float64]:
        """Depth of a change of grey level under white light, mm; 0 where the change has the other sign."""
        depths = np.linspace(0.0, DEEPEST_GREY_MM, 4001)
        sign = np.sign(float(self.weights[0])) or 1.0
        levels = sign * depths * np.polynomial.polynomial.polyval(depths, self.weights)
        turn = int(np.argmax(np.diff(levels) <= 0.0)) or depths.size  # beyond the extreme the extreme's depth
        return np.asarray(np.interp(sign * np.asarray(change, dtype=float), levels[: turn + 1], depths[: turn + 1]))


PATTERN_STEP = 4  # pixels between those that are compared with the reference's pattern
LEVEL_PX, LEVEL_TOUCHED = 80, 0.12  # pixels along the longer side; fraction of the depth that counts as touched
CLIPPED_SD = 3.0  # times the uncertainty where a pixel is clipped
BORDER = 0.06  # of the frame: the strip whose median is the untouched face
DEEPEST_GREY_MM = 10.0
MARKER_FILL = 0.2  # of the markers' pitch: blur of the surroundings that fill a marker
GREY_BLUR = 0.004  # of the columns: under white light a pixel's noise is a depth, as nothing integrates it away
SLOPE_BLUR = 0.004  # of the columns: noise in the colours makes slopes too small where they enter as products
DARKEST = 10.0  # levels of the untouched face, by which a change is divided at most


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
    """

    depth_mm: NDArray[np.float64]
    sd_mm: NDArray[np.float64]
    mm_per_pixel: tuple[float, float]
    name: str = ""

    def __post_init__(self) -> None:
        freeze_arrays(self, "depth_mm", "sd_mm", dtype=float)
        if self.depth_mm.ndim != 2 or self.sd_mm.shape != self.depth_mm.shape:
            raise InputError(f"depth_mm and sd_mm must have one shape (rows, columns); got {self.depth_mm.shape}")

    def points(self) -> NDArray[np.float64]:
        """Points (x, y, z) in mm, one a pixel, z = -depth; x and y from the middle of the frame."""
        rows, columns = self.depth_mm.shape
        y, x = np.mgrid[:rows, :columns].astype(float)
        x, y = (x - (columns - 1) / 2) * self.mm_per_pixel[0], (y - (rows - 1) / 2) * self.mm_per_pixel[1]
        return np.stack([x, y, -self.depth_mm], axis=-1).reshape(-1, 3)

    def ply_bytes(self) -> bytes:
        """The points as a binary PLY file."""
        points = self.points().astype("<f4")
        axes = "".join(f"property float {axis}\n" for axis in "xyz")
        header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n{axes}end_header\n"
        return header.encode() + points.tobytes()

    def to_xarray(self) -> Any:
        """An ``xarray.Dataset`` with ``depth_mm`` and ``sd_mm`` over ``y`` and ``x`` in mm; needs ``analysis``."""
        xarray = import_extra("xarray", feature="a depth map for xarray", extra="analysis")
        rows, columns = self.depth_mm.shape
        x = (np.arange(columns) - (columns - 1) / 2) * self.mm_per_pixel[0]
        y = (np.arange(rows) - (rows - 1) / 2) * self.mm_per_pixel[1]
        layers = {"depth_mm": (("y", "x"), self.depth_mm), "sd_mm": (("y", "x"), self.sd_mm)}
        return xarray.Dataset(layers, coords={"x": x, "y": y}, attrs={"frame": self.name})


class DepthMapper:
    """Depth maps of one calibrated sensor and one reference, frame after frame.

    Parameters
    ----------
    calibration
        Of `calibrate_depth`.
    sensor
        The sensor; its scale must be known.
    reference
        A frame of the untouched sensor.

    Raises
    ------
    InputError
        When the calibration is of another kind of light, or the scale is not known.
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
        self.brightness = relative_brightness(self.reference)
        self.place = frame_places(rows, columns)
        self.strip = border_strip(rows, columns)

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
        change = colour_change(levels, self.reference, self.calibration.method)
        if self.sensor.marker_pitch_mm is not None:
            change = filled_markers(change, levels, self.reference, self.sensor)
        # The lamps' drift is the change of the strip along the border, where nothing presses most of the time.
        change -= np.median(change[self.strip], axis=0)
        if self.sensor.light == "white":
            if self.calibration.method == "relative":
                change = change / self.brightness[..., None]
            grey = scipy.ndimage.gaussian_filter(change[..., 0], GREY_BLUR * change.shape[1])
            depth = self.calibration.depth_of_grey(grey)
        else:
            slope = self._slopes(change)
            depth = integrate_gradients(slope[..., 0], slope[..., 1], self.mm_per_pixel)
            depth = self._levelled(depth - np.median(depth[self.strip]))
        sd = np.hypot(self.calibration.sd_mm, self.calibration.sd_relative * depth)
        brightest = largest_channel(levels)
        clipped = (brightest >= GLARE) | (brightest <= BLACK)
        return DepthMap(
            depth_mm=depth, sd_mm=np.where(clipped, CLIPPED_SD * sd, sd), mm_per_pixel=self.mm_per_pixel, name=name
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
            slope = self.calibration.weights.astype(np.float32)[table_index(flat)]
        else:
            slope = polynomial_slopes(flat, self.place, self.calibration.weights.astype(np.float32))
        return np.asarray(slope.reshape(*change.shape[:2], 2))


def colour_change(levels: NDArray[Any], reference: NDArray[Any], method: str) -> NDArray[Any]:
    """Change of the levels against the untouched face, shape (rows, columns, channels).

    For ``"ratio"`` it is divided by the untouched light at each pixel, on the scale of its mean: lamps that are nearer,
    a vignette and a pattern of the face scale both, and a drift of the lamps is the same everywhere. It is smoothed.
    """
    change = levels - reference
    if method == "ratio":
        change = change / np.maximum(reference, DARKEST) * reference.mean(axis=(0, 1))
        blur = SLOPE_BLUR * levels.shape[1]
        change = scipy.ndimage.gaussian_filter(change, (blur, blur, 0.0))
    return np.asarray(change)


def filled_markers(
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


def border_strip(rows: int, columns: int) -> NDArray[np.bool_]:
    """Pixels along the border, where nothing presses most of the time, shape (rows, columns)."""
    strip = np.ones((rows, columns), dtype=bool)
    margin = max(round(BORDER * min(rows, columns)), 1)
    strip[margin:-margin, margin:-margin] = False
    return strip


def relative_brightness(reference: NDArray[Any]) -> NDArray[Any]:
    """Grey level of the untouched face over its mean, shape (rows, columns)."""
    grey = np.maximum(reference[..., 0], BLACK)
    return np.asarray(grey / grey.mean())


def frame_places(rows: int, columns: int) -> NDArray[np.float32]:
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
