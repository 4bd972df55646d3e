"""Position of an inclusion relative to the probe's axis."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.polynomial import chebyshev

from tsis.errors import InputError
from tsis.imaging.corrections import require_same_frame
from tsis.inclusion.flags import NO_REFERENCE, OFF_AXIS, OFF_AXIS_MM
from tsis.inclusion.frames import DARKEST, OUTER_FRACTION, RINGS
from tsis.inclusion.posterior.rings import FARTHEST
from tsis.model.calibration import Calibration
from tsis.model.require import require_number, require_type

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.inclusion.prior import Floats
    from tsis.model.flag import Finding
    from tsis.model.image import TactileImage


CELL_MM = 0.25  # pixels are averaged over cells of this size; changes are much wider
DEGREE = 8  # of the round change, in the squared distance from its centre
REFERENCE_SD = 0.05  # relative difference of the two presses without inclusion: force, tissue, travel of the glass
STEPS = 12
# Apparent over true offset: the stiff rim attenuates that of deep inclusions.
APPARENT_FRACTION, APPARENT_SD = 0.93, 0.1
CLOSE = 0.1  # of the sd; a shift this small ends the search
FEWEST_CELLS = 200
DISTINCT = 3.0  # least ratio of the change's slopes to those of noise


@dataclass(frozen=True, slots=True, kw_only=True)
class InclusionPosition:
    """Position of an inclusion.

    Attributes
    ----------
    x_mm, y_mm
        From the probe's axis, y along the rows of the image; 0 where there is no change.
    sd_mm
        Standard deviation of either coordinate; infinite where no change exceeds the noise.
    noise_mm
        The part of ``sd_mm`` by noise; the rest is the uncertainty of the apparent fraction of the offset.
    """

    x_mm: float
    y_mm: float
    sd_mm: float
    noise_mm: float

    @property
    def distance_mm(self) -> float:
        """Distance from the axis."""
        return float(np.hypot(self.x_mm, self.y_mm))


def inclusion_position(
    target: TactileImage,
    reference: TactileImage,
    calibration: Calibration,
    *,
    radius_mm: float,
    uneven: Floats | None = None,
) -> InclusionPosition:
    """Locate an inclusion by the centre of symmetry of the change that it causes.

    At uniform light the change over the inner 0.8 of the face is fitted by a round function about a centre, a multiple
    of the reference about the axis, and a shift of the centre; Gauss-Newton steps reduce the shift to zero. The
    apparent offset is 0.88 to 0.98 of the true one, less for deeper inclusions (``benchmarks/off_axis.py``);
    `APPARENT_FRACTION` corrects the average, `APPARENT_SD` is the remaining error. The additional shift by lamps that
    shine along the tilted face is not corrected.

    Weights follow from pixel noise, pattern and repeatability, assumed as large in the first harmonic around a ring as
    in its mean.

    Parameters
    ----------
    target, reference
        Raw frames of one force, scale and axis.
    calibration
        Light, background and noise.
    radius_mm
        Radius of the probe's face, in [0.5, 500].
    uneven
        First harmonics of the change by uneven tissue in evenly wide rings of the inner 0.8, each with a standard
        normal factor, shape (rings, k); they add to the standard deviation.

    Returns
    -------
    InclusionPosition
        The centre, at most `FARTHEST` of the face's radius from the axis. Its sd is larger where the change is not
        round.

    Raises
    ------
    InputError
        When the scale is unknown or too little of the face is visible without clipping.
    ImageMismatchError
        When the frames differ in size, scale or axis.
    """
    require_number("radius_mm", radius_mm, 0.5, 500.0, hint="millimetres")
    require_type("calibration", calibration, Calibration)
    require_same_frame(target, reference, "reference")
    cells = _cells(target, reference, calibration, radius_mm, np.zeros((1, 0)) if uneven is None else uneven)
    centre, limit = np.zeros(2), APPARENT_FRACTION * FARTHEST * radius_mm
    for _ in range(STEPS):
        shift, sd = _step(cells, centre)
        if not np.isfinite(sd):
            return InclusionPosition(x_mm=0.0, y_mm=0.0, sd_mm=np.inf, noise_mm=np.inf)
        centre = centre + shift
        centre *= limit / max(limit, float(np.hypot(*centre)))
        if np.hypot(*shift) < CLOSE * sd:
            break
    x, y = centre / APPARENT_FRACTION
    total_sd = float(np.hypot(sd, APPARENT_SD * np.hypot(*centre)))
    return InclusionPosition(
        x_mm=float(x), y_mm=float(y), sd_mm=total_sd / APPARENT_FRACTION, noise_mm=sd / APPARENT_FRACTION
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Cells:
    """Means over cells of the picture, shape (n,): position, change, reference press and variance of the change.

    ``uneven`` (n, k) are first harmonics of the change by uneven tissue, each with a standard normal factor.
    """

    x_mm: Floats
    y_mm: Floats
    change: Floats
    reference: Floats
    variance: Floats
    uneven: Floats


def _cells(
    target: TactileImage, reference: TactileImage, calibration: Calibration, radius_mm: float, uneven: Floats
) -> _Cells:
    """The cells inside the rings of the estimate without clipped pixels; ``uneven`` has evenly wide rings there."""
    (sx, sy), (ax, ay) = target.scale(), target.axis()
    size = max(1, round(CELL_MM / sy)), max(1, round(CELL_MM / sx))
    rows, columns = target.grey.shape
    if rows < size[0] or columns < size[1]:
        raise _too_little(0)
    x = (_means(np.arange(columns)[None, :], (1, size[1]))[0] - ax) * sx
    y = (_means(np.arange(rows)[:, None], (size[0], 1))[:, 0] - ay) * sy
    pressed, baseline = (_means(frame.grey, size) - calibration.background_grey for frame in (target, reference))
    brightest = _brightest(target, reference, size)
    light = np.ones_like(baseline) if calibration.light is None else calibration.light.at(x, y)
    inside = (np.hypot(x, y[:, None]) < OUTER_FRACTION * radius_mm) & (brightest < target.full_scale)
    inside &= light > DARKEST * light.max()
    if inside.sum() < FEWEST_CELLS:
        raise _too_little(int(inside.sum()))
    span, down = (grid[inside] for grid in np.meshgrid(x, y))
    pressed, baseline, light = pressed[inside], baseline[inside], light[inside]
    photons = np.maximum(pressed + baseline, 0.0)
    pixel = 2 * calibration.read_noise_grey**2 + calibration.shot_noise_grey * photons + 2 / 12
    ring = calibration.repeatability_sd**2 * (pressed**2 + baseline**2)
    ring += calibration.pattern_sd**2 * (pressed - baseline) ** 2
    # The error of a ring's mean is that of a cell over the root of their number.
    width, area = OUTER_FRACTION * radius_mm / RINGS, size[0] * sy * size[1] * sx
    cells_a_ring = np.maximum(2 * np.pi * np.hypot(span, down) * width / area, 1.0)
    variance = (pixel / (size[0] * size[1]) + cells_a_ring * ring) / light**2
    # The smooth reference avoids a correlation of its noise with that of the change.
    basis = chebyshev.chebvander(_unit(span**2 + down**2), DEGREE) / np.sqrt(variance)[:, None]
    smooth = np.linalg.lstsq(basis, baseline / light / np.sqrt(variance), rcond=None)[0]
    return _Cells(
        x_mm=span,
        y_mm=down,
        change=(pressed - baseline) / light,
        reference=basis @ smooth * np.sqrt(variance),
        variance=variance,
        uneven=_of_rings(uneven, np.hypot(span, down) / (OUTER_FRACTION * radius_mm)),
    )


def _of_rings(values: Floats, fraction: Floats) -> Floats:
    """Values (rings, k) at fractions of the outer radius, linear between the middles of the rings."""
    middle = (np.arange(len(values)) + 0.5) / max(len(values), 1)
    return np.array([np.interp(fraction, middle, column) for column in values.T]).reshape(-1, len(fraction)).T


def _too_little(cells: int) -> InputError:
    return InputError(
        f"target and reference must show the face without clipping in at least {FEWEST_CELLS} cells of {CELL_MM} mm; "
        f"got {cells} (check mm_per_pixel, axis_px and the exposure)"
    )


def _brightest(target: TactileImage, reference: TactileImage, size: tuple[int, int]) -> Floats:
    """Largest grey level of either frame in each cell; computed per cell only if a pixel clips."""
    most = max(float(target.grey.max()), float(reference.grey.max()))
    if most < target.full_scale:
        return np.full([length // of for length, of in zip(target.grey.shape, size, strict=True)], most)
    return _means(np.maximum(target.grey, reference.grey), size, np.maximum)


def _unit(squared: Floats) -> Floats:
    """Squared distances, [0, largest] mapped to [-1, 1]."""
    return np.asarray(2 * squared / squared.max() - 1)


def _means(values: NDArray[Any], size: tuple[int, int], over: np.ufunc = np.add) -> Floats:
    """Means, or another reduction, over whole cells of ``size`` (rows, columns)."""
    rows, columns = (length // of * of for length, of in zip(values.shape, size, strict=True))
    for axis, (length, of) in enumerate(zip((rows, columns), size, strict=True)):
        # One axis after the other: both at once is several times slower.
        values = over.reduceat(values, np.arange(0, length, of), axis=axis)
    return np.asarray(values / (size[0] * size[1]) if over is np.add else values, dtype=float)


def _step(cells: _Cells, centre: Floats) -> tuple[Floats, float]:
    """Gauss-Newton shift of the centre (2,), and the standard deviation of either coordinate."""
    x, y = cells.x_mm - centre[0], cells.y_mm - centre[1]
    squared = x * x + y * y
    unit, by_unit = _unit(squared), 2 / squared.max()
    basis = chebyshev.chebvander(unit, DEGREE)
    coarse = np.column_stack([basis, cells.reference])
    weight = 1 / cells.variance
    precision = np.zeros(coarse.shape[1])
    precision[-1] = REFERENCE_SD**-2
    spread = np.linalg.inv(coarse.T @ (weight[:, None] * coarse) + np.diag(precision))
    fitted = spread @ (coarse.T @ (weight * cells.change))
    # Derivative with respect to the squared distance; that with respect to x is 2 x times it.
    steep = chebyshev.chebvander(unit, DEGREE - 1) @ chebyshev.chebder(np.eye(DEGREE + 1)) * by_unit
    by_squared = steep @ fitted[:-1]
    shifted = np.column_stack([-2 * x * by_squared, -2 * y * by_squared])
    residual = cells.change - coarse @ fitted
    # The part of a shift that the round function can fit has no information.
    free = shifted - coarse @ (spread @ (coarse.T @ (weight[:, None] * shifted)))
    fisher = free.T @ (weight[:, None] * free)
    noise = 2 * np.einsum("n,nk,kl,nl->", weight * squared, steep, spread[:-1, :-1], steep, optimize=True)
    information = np.trace(fisher) / 2 - noise
    if information < DISTINCT * noise:
        return np.zeros(2), np.inf
    to_shift = np.linalg.solve(fisher, free.T * weight)
    shift = to_shift @ residual
    left = residual - free @ shift
    misfit = float(weight @ left**2) / (len(left) - DEGREE - 4)
    beside = np.hypot(cells.x_mm, cells.y_mm)
    across = (to_shift[0] * cells.x_mm / beside) @ cells.uneven, (to_shift[1] * cells.y_mm / beside) @ cells.uneven
    by_tissue = float((across[0] @ across[0] + across[1] @ across[1]) / 2)
    return shift, float(np.sqrt(max(misfit, 1.0) / information + by_tissue))


def position_findings(inclusion: InclusionPosition | None) -> list[Finding]:
    """Findings for a missing reference press or an inclusion off the axis."""
    if inclusion is None:
        return [NO_REFERENCE.finding()]
    if np.isfinite(inclusion.sd_mm) and inclusion.distance_mm - 2 * inclusion.noise_mm > OFF_AXIS_MM:
        return [OFF_AXIS.finding(distance_mm=inclusion.distance_mm)]
    return []
