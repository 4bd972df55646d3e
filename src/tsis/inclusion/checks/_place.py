"""Where an inclusion lies beside the probe's axis, from a press on it and one on plain tissue."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.polynomial import chebyshev

from tsis.errors import InputError
from tsis.imaging import require_same_frame
from tsis.inclusion._frames import DARKEST, OUTER_FRACTION, RINGS
from tsis.inclusion.posterior import FARTHEST
from tsis.model import Calibration, require_number, require_type

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.model import TactileImage


CELL_MM = 0.25  # pixels are averaged over cells of this size; changes are much wider
DEGREE = 8  # of the round change, in the squared distance from its centre
REFERENCE_SD = 0.05  # share of the plain press that the two frames may differ by: force, tissue, travel of the glass
STEPS = 12
SEEN, SEEN_SD = 0.93, 0.1  # share of its true offset at which a change is seen: the stiff rim holds on to deep ones
CLOSE = 0.1  # of the sd; a shift this small ends the search
FEWEST_CELLS = 200
DISTINCT = 3.0  # a change is there when its slopes exceed this many times those that noise makes


@dataclass(frozen=True, slots=True, kw_only=True)
class InclusionPosition:
    """Where an inclusion lies.

    Attributes
    ----------
    x_mm, y_mm
        From the probe's axis, y along the rows of the image; 0 where nothing can be placed.
    sd_mm
        Standard deviation of either coordinate; infinite where no change stands out of the noise.
    noise_mm
        The part of ``sd_mm`` that noise makes; the rest is how well it is known at which share of its offset an
        inclusion is seen.
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
    target: TactileImage, reference: TactileImage, calibration: Calibration, *, radius_mm: float
) -> InclusionPosition:
    """Find the place of an inclusion from the point around which the change that it makes is round.

    At even light the change is fitted by a round function of the distance from a centre, a share of the reference that
    stays about the axis, and the slope of that function times its shift, over the inner 0.8 of the face; the centre
    moves by the shift until that is zero. Lit evenly, it is seen at 0.88 to 0.98 of its true offset, the deeper the
    nearer to the axis (``benchmarks/off_axis.py``): `SEEN` puts that right on average, and `SEEN_SD` says how badly.
    Lamps that shine along the face move it further, because dents tilt the face; that is not put right.

    Pixels weigh by their noise and by the calibration's pattern and repeatability, which are taken to be as strong in
    the first harmonic around a ring as in its mean.

    Parameters
    ----------
    target, reference
        Frames as the camera delivered them, of one force, scale and axis.
    calibration
        Light, background and noise.
    radius_mm
        Radius of the probe's face, in [0.5, 500].

    Returns
    -------
    Place
        The centre, at most `FARTHEST` of the face's radius from the axis. Its sd is widened where the change is not
        round.

    Raises
    ------
    InputError
        When the scale is unknown or too little of the face is seen without clipping.
    ImageMismatchError
        When the frames do not belong together.
    """
    require_number("radius_mm", radius_mm, 0.5, 500.0, hint="millimetres")
    require_type("calibration", calibration, Calibration)
    require_same_frame(target, reference, "reference")
    cells = _cells(target, reference, calibration, radius_mm)
    centre, limit = np.zeros(2), SEEN * FARTHEST * radius_mm
    for _ in range(STEPS):
        shift, sd = _step(cells, centre)
        if not np.isfinite(sd):
            return InclusionPosition(x_mm=0.0, y_mm=0.0, sd_mm=np.inf, noise_mm=np.inf)
        centre = centre + shift
        centre *= limit / max(limit, float(np.hypot(*centre)))
        if np.hypot(*shift) < CLOSE * sd:
            break
    x, y = centre / SEEN
    both = np.hypot(sd, SEEN_SD * np.hypot(*centre))
    return InclusionPosition(x_mm=float(x), y_mm=float(y), sd_mm=float(both / SEEN), noise_mm=sd / SEEN)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Cells:
    """Means over cells of the picture, each of shape (n,): place, change, plain press and variance of the change."""

    x_mm: NDArray[np.float64]
    y_mm: NDArray[np.float64]
    change: NDArray[np.float64]
    reference: NDArray[np.float64]
    variance: NDArray[np.float64]


def _cells(target: TactileImage, reference: TactileImage, calibration: Calibration, radius_mm: float) -> _Cells:
    """The cells inside the rings of the estimate in which no pixel is clipped."""
    (sx, sy), (ax, ay) = target.scale(), target.axis()
    size = max(1, round(CELL_MM / sy)), max(1, round(CELL_MM / sx))
    rows, columns = target.grey.shape
    if rows < size[0] or columns < size[1]:
        raise _too_little(0)
    x = (_means(np.arange(columns)[None, :], (1, size[1]))[0] - ax) * sx
    y = (_means(np.arange(rows)[:, None], (size[0], 1))[:, 0] - ay) * sy
    pressed, plain = (_means(frame.grey, size) - calibration.background_grey for frame in (target, reference))
    brightest = _brightest(target, reference, size)
    light = np.ones_like(plain) if calibration.light is None else calibration.light.at(x, y)
    inside = (np.hypot(x, y[:, None]) < OUTER_FRACTION * radius_mm) & (brightest < target.full_scale)
    inside &= light > DARKEST * light.max()
    if inside.sum() < FEWEST_CELLS:
        raise _too_little(int(inside.sum()))
    span, down = (grid[inside] for grid in np.meshgrid(x, y))
    pressed, plain, light = pressed[inside], plain[inside], light[inside]
    pixel = 2 * calibration.read_noise_grey**2 + calibration.shot_noise_grey * np.maximum(pressed + plain, 0.0) + 2 / 12
    ring = (
        calibration.repeatability_sd**2 * (pressed**2 + plain**2) + calibration.pattern_sd**2 * (pressed - plain) ** 2
    )
    # What a ring's mean errs by is what its cells err by together, over the root of their number.
    width, area = OUTER_FRACTION * radius_mm / RINGS, size[0] * sy * size[1] * sx
    cells_a_ring = np.maximum(2 * np.pi * np.hypot(span, down) * width / area, 1.0)
    variance = (pixel / (size[0] * size[1]) + cells_a_ring * ring) / light**2
    # Its own noise, which is also in the change, would make a share of the plain press out of nothing.
    basis = chebyshev.chebvander(_unit(span**2 + down**2), DEGREE) / np.sqrt(variance)[:, None]
    smooth = np.linalg.lstsq(basis, plain / light / np.sqrt(variance), rcond=None)[0]
    return _Cells(
        x_mm=span,
        y_mm=down,
        change=(pressed - plain) / light,
        reference=basis @ smooth * np.sqrt(variance),
        variance=variance,
    )


def _too_little(cells: int) -> InputError:
    return InputError(
        f"target and reference must show the face without clipping in at least {FEWEST_CELLS} cells of {CELL_MM} mm; "
        f"got {cells} (check mm_per_pixel, axis_px and the exposure)"
    )


def _brightest(target: TactileImage, reference: TactileImage, size: tuple[int, int]) -> NDArray[np.float64]:
    """Largest grey level of either frame in each cell; looked for cell by cell only where something clips."""
    most = max(float(target.grey.max()), float(reference.grey.max()))
    if most < target.full_scale:
        return np.full([length // of for length, of in zip(target.grey.shape, size, strict=True)], most)
    return _means(np.maximum(target.grey, reference.grey), size, np.maximum)


def _unit(squared: NDArray[np.float64]) -> NDArray[np.float64]:
    """Squared distances, [0, largest] mapped to [-1, 1]."""
    return np.asarray(2 * squared / squared.max() - 1)


def _means(values: NDArray[Any], size: tuple[int, int], over: np.ufunc = np.add) -> NDArray[np.float64]:
    """Means, or what else is taken, over whole cells of ``size`` (rows, columns)."""
    rows, columns = (length // of * of for length, of in zip(values.shape, size, strict=True))
    for axis, (length, of) in enumerate(zip((rows, columns), size, strict=True)):
        # One axis after the other: both at once is several times slower.
        values = over.reduceat(values, np.arange(0, length, of), axis=axis)
    return np.asarray(values / (size[0] * size[1]) if over is np.add else values, dtype=float)


def _step(cells: _Cells, centre: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Shift of the centre (2,) that the change asks for, and the standard deviation of either coordinate."""
    x, y = cells.x_mm - centre[0], cells.y_mm - centre[1]
    squared = x * x + y * y
    unit, by_unit = _unit(squared), 2 / squared.max()
    basis = chebyshev.chebvander(unit, DEGREE)
    coarse = np.column_stack([basis, cells.reference])
    weight = 1 / cells.variance
    given = np.zeros(coarse.shape[1])
    given[-1] = REFERENCE_SD**-2
    spread = np.linalg.inv(coarse.T @ (weight[:, None] * coarse) + np.diag(given))
    fitted = spread @ (coarse.T @ (weight * cells.change))
    # Derivative by the squared distance; that by x is 2 x times it.
    steep = chebyshev.chebvander(unit, DEGREE - 1) @ chebyshev.chebder(np.eye(DEGREE + 1)) * by_unit
    by_squared = steep @ fitted[:-1]
    shifted = np.column_stack([-2 * x * by_squared, -2 * y * by_squared])
    residual = cells.change - coarse @ fitted
    # What the round part can follow of a shift tells nothing about it.
    free = shifted - coarse @ (spread @ (coarse.T @ (weight[:, None] * shifted)))
    reported = free.T @ (weight[:, None] * free)
    noise = 2 * np.einsum("n,nk,kl,nl->", weight * squared, steep, spread[:-1, :-1], steep, optimize=True)
    information = np.trace(reported) / 2 - noise
    if information < DISTINCT * noise:
        return np.zeros(2), np.inf
    shift = np.linalg.solve(reported, free.T @ (weight * residual))
    left = residual - free @ shift
    misfit = float(weight @ left**2) / (len(left) - DEGREE - 4)
    return shift, float(np.sqrt(max(misfit, 1.0) / information))
