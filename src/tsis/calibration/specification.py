"""The specification sheet of a probe, as measured."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.calibration.force_line import HYSTERESIS_POINT, mean_value
from tsis.calibration.measured import MeasuredValue
from tsis.errors import CalibrationError, InputError
from tsis.imaging.corrections import require_image
from tsis.imaging.patch import pixel_noise
from tsis.model.require import require_array, require_number, require_one_of, require_type

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from tsis.calibration.force_line import ForceLine, ForceLineDiagnostics
    from tsis.model.image import TactileImage


SHAPES = ("straight", "circle")
PARTS = 8  # of the edge, each measured separately
EDGE_RANGE_MM = 1.0  # from the edge to both sides
NEAR_MM = 0.1  # of a point from the line or circle that it belongs to
LINE_STARTS, CIRCLE_STARTS = 48, 18  # points whose pairs and triples give lines and circles to begin with
LEAST_PIXELS = 60  # in a part
LEAST_CONTRAST = 8.0  # of the step, in standard deviations of a pixel's noise
TEN_TO_NINETY = 2.563103  # in standard deviations of a normal blur
FEWEST = 3  # times of frames


def edge_width(image: TactileImage, *, shape: str = "straight", extent_mm: float = EDGE_RANGE_MM) -> MeasuredValue:
    """Width in mm from 10 to 90 % across a sharp edge of even contact: straight (a block) or circular (a flat punch).

    A line or a circle is fitted to the points where the light crosses half of the step, as far as they lie on one. In
    each of eight parts of the edge an error function is fitted to the light over the distance from that line or circle;
    the scatter of the parts is the uncertainty. Raises `CalibrationError` when no edge stands out, or too little of it;
    `InputError` when the scale is not known.

    Parameters
    ----------
    image
        A corrected frame of the contact, its scale known; dark beside the contact.
    shape
        ``"straight"`` or ``"circle"``.
    extent_mm
        Distance to both sides of the edge, mm, in [0.05, 20]; the contact must be even that far.

    Examples
    --------
    >>> from tsis import TactileImage
    >>> x = np.arange(200) * 0.03 - 3.0
    >>> step = 100.0 * (0.5 + 0.5 * scipy.special.erf(np.tile(x, (160, 1)) / (0.06 * np.sqrt(2))))
    >>> width = edge_width(TactileImage(grey=step, mm_per_pixel=(0.03, 0.03)))
    >>> round(width.value, 3)
    0.154
    """
    require_image("image", image)
    require_one_of("edge", shape, SHAPES)
    require_number("extent_mm", extent_mm, 0.05, 20.0, hint="millimetres")
    rows, columns = np.indices(image.grey.shape)
    positions = np.stack([columns.ravel() * image.scale()[0], rows.ravel() * image.scale()[1]], axis=1)
    low, high = (float(level) for level in np.percentile(image.grey, [2, 98]))
    distance, along = (_from_line if shape == "straight" else _from_circle)(positions, _crossing(image, low, high))
    flat = image.grey.ravel()
    widths = []
    for part in range(PARTS):
        here = (along == part) & (np.abs(distance) <= extent_mm)
        if _shows_step(distance[here], flat[here], high - low):
            widths.append(_width(distance[here], flat[here], high - low))
    if len(widths) < PARTS // 2:
        raise CalibrationError(
            f"image must show at least half of the edge with {LEAST_PIXELS} pixels in each eighth; it shows "
            f"{len(widths)} of {PARTS} (move the edge into the field of view)"
        )
    return mean_value(np.array(widths), unit="mm")


def _crossing(image: TactileImage, low: float, high: float) -> NDArray[np.float64]:
    """Points (x, y) in mm where the light crosses half of the step between two levels, shape (n, 2)."""
    noise = pixel_noise(image.grey)
    if high - low < LEAST_CONTRAST * max(noise, 0.1):
        raise CalibrationError(
            f"image must show an edge; its step of {high - low:.1f} grey levels does not stand out of noise of "
            f"{noise:.1f} (press the block harder)"
        )
    above = scipy.ndimage.gaussian_filter(image.grey, 1.5, mode="mirror") > (low + high) / 2
    above = scipy.ndimage.grey_closing(
        scipy.ndimage.grey_opening(above, (7, 7), mode="nearest"), (7, 7), mode="nearest"
    )
    points = _longest_border(above)
    if not len(points):
        raise CalibrationError("image must show an edge of contact; it shows no bright part")
    height, width = image.grey.shape
    inside = (points > 1).all(axis=1) & (points[:, 0] < width - 2) & (points[:, 1] < height - 2)
    if int(inside.sum()) < PARTS:
        raise CalibrationError("image must show an edge of contact; the frame is lit or dark all over")
    return np.asarray(points[inside] * np.array(image.scale()), dtype=float)


def _longest_border(bright: NDArray[np.bool]) -> NDArray[np.intp]:
    """Pixels (x, y) of the longest outer border of a connected part."""
    parts, _ = scipy.ndimage.label(scipy.ndimage.binary_fill_holes(bright), np.ones((3, 3)))
    border = np.where(scipy.ndimage.binary_erosion(parts > 0), 0, parts)
    lengths = np.bincount(border.ravel())
    lengths[0] = 0
    return np.argwhere((border == np.argmax(lengths)) & (border > 0))[:, ::-1]


def _from_line(
    positions: NDArray[np.float64], edge: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Distance from the straight line through most of the edge, and the nearest eighth of it; -1 beyond its ends."""
    some = _spread(edge, LINE_STARTS)
    first, second = np.triu_indices(len(some), 1)
    along = some[second] - some[first]
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    near = _most_shared(edge, across @ edge.T - (across * some[first]).sum(axis=1, keepdims=True))
    for _ in range(5):  # drops points off the line, as at the end of the block
        direction = np.linalg.svd(near - near.mean(axis=0), full_matrices=False)[2]
        middle = near.mean(axis=0)
        offset = np.abs((edge - middle) @ direction[1])
        near = edge[offset <= NEAR_MM]
    ends = (near - middle) @ direction[0]
    fraction = ((positions - middle) @ direction[0] - ends.min()) / max(float(np.ptp(ends)), 1e-9)
    part = np.where((fraction >= 0) & (fraction <= 1), np.minimum((fraction * PARTS).astype(int), PARTS - 1), -1)
    return (positions - middle) @ direction[1], np.asarray(part, dtype=np.intp)


def _from_circle(
    positions: NDArray[np.float64], edge: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Distance from the circle through most of the edge, and the nearest eighth of it."""
    some = _spread(edge, CIRCLE_STARTS)
    triples = some[np.array(list(combinations(range(len(some)), 3)))]
    designs = np.concatenate([2 * triples, np.ones_like(triples[..., :1])], axis=2)
    sound = np.abs(np.linalg.det(designs)) > 1e-6  # three points of a line have no circle
    if not sound.any():
        raise CalibrationError("image must show a circular edge; this one is straight (choose the straight shape)")
    circles = np.linalg.solve(designs[sound], (triples[sound] ** 2).sum(axis=2)[..., None])[..., 0]
    near = _most_shared(edge, _off_circle(edge, circles))
    for _ in range(5):
        design = np.column_stack([2 * near, np.ones(len(near))])
        circle = np.linalg.lstsq(design, (near**2).sum(axis=1), rcond=None)[0]
        near = edge[np.abs(_off_circle(edge, circle[None])[0]) <= NEAR_MM]
    away = positions - circle[:2]
    angle = np.arctan2(away[:, 1], away[:, 0]) / (2 * np.pi) + 0.5
    return _off_circle(positions, circle[None])[0], np.minimum((angle * PARTS).astype(int), PARTS - 1)


def _off_circle(points: NDArray[np.float64], circles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance of points (x, y) outwards from circles (x, y, radius² - x² - y²), shape (circles, points)."""
    radius = np.sqrt(np.maximum(circles[:, 2] + (circles[:, :2] ** 2).sum(axis=1), 0.0))
    return np.asarray(np.linalg.norm(points - circles[:, None, :2], axis=2) - radius[:, None])


def _spread(edge: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """At most ``count`` points, evenly from all."""
    return np.asarray(edge[np.linspace(0, len(edge) - 1, min(count, len(edge))).astype(int)])


def _most_shared(edge: NDArray[np.float64], off: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points near the candidate that passes most of them; ``off`` has the shape (candidates, points)."""
    # A fit to all points would be drawn aside by another border, as that of pixels that the correction leaves out.
    near = np.abs(off) <= NEAR_MM
    return np.asarray(edge[near[int(near.sum(axis=1).argmax())]])


def _shows_step(distance: NDArray[np.float64], grey: NDArray[np.float64], step: float) -> bool:
    """Whether a part has pixels enough, and most of the step of the whole between its sides."""
    sides = grey[distance > 0], grey[distance <= 0]
    if min(map(len, sides)) < LEAST_PIXELS // 4 or len(grey) < LEAST_PIXELS:
        return False
    return abs(float(np.median(sides[0]) - np.median(sides[1]))) > step / 2


def _width(distance: NDArray[np.float64], grey: NDArray[np.float64], step: float) -> float:
    """Width in mm of one part of the edge."""
    sign = 1.0 if np.median(grey[distance > 0]) > np.median(grey[distance <= 0]) else -1.0

    def misfit(values: NDArray[np.float64]) -> NDArray[np.float64]:
        low, height, position, blur = values
        rise = 0.5 + 0.5 * scipy.special.erf((sign * distance - position) / (np.sqrt(2) * max(abs(blur), 1e-9)))
        return np.asarray(low + height * rise - grey)

    start = float(np.percentile(grey, 5)), step, 0.0, 0.05
    scale = step, step, 0.05, 0.05
    # The loss lets pixels off the step, which the correction left out, weigh little.
    fit = scipy.optimize.least_squares(misfit, start, x_scale=scale, loss="soft_l1", f_scale=step / 10, max_nfev=4000)
    if not fit.success:
        raise CalibrationError("the edge must rise like a blurred step; it does not (clean the edge)")
    return TEN_TO_NINETY * abs(float(fit.x[3]))


def frame_rate(time_s: ArrayLike) -> MeasuredValue:
    """Frames a second of a stream: intervals over the time between the first and the last frame.

    Raises `InputError` when there are too few times, or they do not ascend.

    Parameters
    ----------
    time_s
        Times of the frames on one clock, ascending, shape (n,), n >= 3. Lost frames count as long intervals.

    Returns
    -------
    MeasuredValue
        The rate in 1/s; its standard deviation is that of the mean interval.

    Examples
    --------
    >>> round(frame_rate([0.0, 0.03, 0.07, 0.10]).value, 6)
    30.0
    """
    time = require_array("time_s", time_s, ndim=1)
    if len(time) < FEWEST or (np.diff(time) <= 0).any():
        raise InputError(f"time_s must hold at least {FEWEST} ascending times; got {len(time)} values")
    steps = np.diff(time)
    mean = float(steps.mean())
    error = float(steps.std(ddof=1)) / float(np.sqrt(len(steps)))
    return MeasuredValue(value=1 / mean, sd=error / mean**2, degrees_of_freedom=len(steps) - 1.0, unit="1/s")


SENSITIVITY_NOTE = (
    "5 % false alarms and 5 % misses of one frame; "
    "the source's text gives the probe 2.5e-3 N and the fingertip 2.0e-2 N, its table 4.1 gives 2.0e-3 N and 2.5e-2 N"
)
EDGE_NOTE = "10 to 90 % of an edge of contact; the printed 9.8 um is the pitch of the sensor's pixels"
RATE_NOTE = "frames a second; what can be followed without aliasing is half of it"
LOOP_NOTE = f"loading less unloading over the range, at {HYSTERESIS_POINT:g} of the largest force"
REPEAT_NOTE = "standard deviation of repeated loadings of one tip over the range"
COMPARED = (  # quantity, unit, and the source's values for the fingertip and for its probe
    ("spatial resolution", "mm", "0.1 mm", "9.8 um", EDGE_NOTE),
    ("frame rate", "1/s", "0 to 100 Hz", "0 to 30 Hz", RATE_NOTE),
    ("smallest detectable force", "N", "2.5e-2 N", "2.0e-3 N", SENSITIVITY_NOTE),
    ("largest force", "N", "", "2 N", "without clipped pixels, as far as it was pressed"),
    ("hysteresis", "", "High", "Low", LOOP_NOTE),
    ("repeatability", "", "", "good", REPEAT_NOTE),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class SpecificationRow:
    """One row of the sheet.

    Attributes
    ----------
    quantity, unit
        Measured quantity and its unit; the unit is empty for a fraction.
    measured
        The value with its uncertainty; None when it was not measured.
    fingertip
        The source's value for the human fingertip, as text in its own unit.
    printed
        The source's value for its probe.
    note
        Note for the comparison.
    """

    quantity: str
    unit: str
    measured: MeasuredValue | None
    fingertip: str
    printed: str
    note: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Specification:
    """A probe's specification sheet: its name, and the rows."""

    probe: str
    rows: tuple[SpecificationRow, ...]

    def __getitem__(self, quantity: str) -> SpecificationRow:
        """The row of a quantity; `UnknownNameError` when there is none."""
        by_name = {row.quantity: row for row in self.rows}
        return by_name[require_one_of("quantity", quantity, by_name)]


def specification_sheet(
    *,
    probe: str,
    line: ForceLine,
    diagnostics: ForceLineDiagnostics,
    edge_mm: MeasuredValue | None = None,
    frames_per_s: MeasuredValue | None = None,
) -> Specification:
    """Fill the sheet with measured values; the others stay empty and are never copied from the source.

    Raises `InputError` when ``probe``, the name, is not a text.

    Parameters
    ----------
    line, diagnostics
        The force line of this probe, by `fit_force_line`.
    edge_mm
        Width in mm in which an edge of contact rises from 10 to 90 %, by `edge_width`.
    frames_per_s
        Rate of arrival of the frames, by `frame_rate`.
    """
    require_type("probe", probe, str)
    measured = {
        "spatial resolution": edge_mm,
        "frame rate": frames_per_s,
        "smallest detectable force": diagnostics.detectable_n,
        "largest force": line.with_uncertainty(line.most_n),
        "hysteresis": diagnostics.hysteresis,
        "repeatability": diagnostics.repeatability,
    }
    rows = tuple(
        SpecificationRow(
            quantity=name, unit=unit, measured=measured[name], fingertip=fingertip, printed=printed, note=note
        )
        for name, unit, fingertip, printed, note in COMPARED
    )
    return Specification(probe=probe, rows=rows)
