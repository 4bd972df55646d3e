"""Pixel scale from a dot board, with the uncertainty that the residuals do not show: bend, skew, bias of a spot.

The residuals show how well the dots fit the map. Where they fit to a hundredth of a pixel, the errors outside the map
are larger. The bend counts in full: both the mean over a pitch and the size at the position itself are the scale.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.calibration._measured import MeasuredValue
from tsis.calibration.scale._board_map import (
    BEYOND_CHANCE,
    FIRST_ORDER,
    BoardMap,
    chance_of,
    fit_map,
    fit_order,
    without_strays,
)
from tsis.calibration.scale._lattice import index_lattice, rotation_deg, skew_deg, with_square_axes
from tsis.calibration.scale._spots import Spots, find_spots, in_even_light
from tsis.calibration.scale._value import PixelScale, check_field
from tsis.errors import CalibrationError
from tsis.imaging import require_image, subtract_background
from tsis.model.require import freeze_arrays, require_integer, require_number

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.model.image import TactileImage


LEAST_FRACTION = 2e-4  # least relative uncertainty of a picture of spots: light, aberrations, the gel's creep
EVEN = 3**0.5  # bound of an even distribution over its standard deviation
BY_CHANCE = 2.0  # standard deviations that noise explains


def with_model_uncertainty(
    sizes: tuple[MeasuredValue, MeasuredValue], fitted: BoardMap, cell: NDArray[np.float64]
) -> tuple[MeasuredValue, ...]:
    """Pixel sizes (x, y) at a lattice position with the uncertainty of the map added to that of its residuals."""
    bend = _beyond_noise(*fitted.bend(cell))
    # An error between none and half the skew is equally likely (GUM 4.3.7: bound over the root of three).
    askew = _skew_beyond_noise(fitted, cell) / 2 / EVEN
    fractions = np.sqrt(LEAST_FRACTION**2 + bend**2 + askew**2)
    return tuple(_widened(size, float(fraction)) for size, fraction in zip(sizes, fractions, strict=True))


def _beyond_noise(values: NDArray[np.float64], noise: NDArray[np.float64]) -> NDArray[np.float64]:
    """The part of ``values`` that noise does not explain; the residuals' part includes the rest."""
    return np.asarray(np.sqrt(np.maximum(values**2 - (BY_CHANCE * noise) ** 2, 0.0)))


def _skew_beyond_noise(fitted: BoardMap, cell: NDArray[np.float64]) -> float:
    """Sine of the skew that noise does not explain.

    Cameras have square axes, so the skew comes from the board or the tilt. Pitches with a relative difference e,
    rotated by 45 degrees, show a skew of e and an error of e / 2 in both pixel sizes; a board sheared by an angle s
    causes a smaller error in one of them, 1 - cos(s).
    """
    sine = np.sin(np.radians(skew_deg(fitted.face_step(cell))))
    x, y = fitted.pixel_size(cell, pitch=MeasuredValue(value=1.0, sd=0.0))
    return float(_beyond_noise(np.array(sine), np.hypot(x.sd / x.value, y.sd / y.value)))


def _widened(size: MeasuredValue, fraction: float) -> MeasuredValue:
    added = (fraction * size.value) ** 2
    total = size.sd**2 + added
    # Only the residuals' part has few degrees of freedom (Welch and Satterthwaite).
    freedom = size.degrees_of_freedom * (total / size.sd**2) ** 2 if size.sd > 0 else np.inf
    return MeasuredValue(value=size.value, sd=total**0.5, degrees_of_freedom=float(freedom), unit=size.unit)


FEWEST = 16  # dots
LEAST_SIDE = 3  # dots along each side of the lattice: two have no residual
MOST_STRANGERS = 0.5  # fraction of the spots off the lattice
ROUGHEST = 0.06  # root mean square residual over the dots' distance


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DotDiagnostics:
    """Diagnostics of a scale from dots.

    Attributes
    ----------
    centres_px
        Centres (x, y) of the dots used, shape (n, 2), pixels.
    cells
        Their lattice positions, whole pitches, shape (n, 2).
    residuals_px
        Centre minus fitted position, shape (n, 2), pixels.
    strays_px
        Spots outside the lattice, shape (m, 2), pixels.
    bright
        True when the dots are brighter than their surroundings.
    width_px
        Standard deviation of a Gaussian as wide as the dots, pixels.
    order
        Order of the polynomial fitted: 3, or 5 for a wide-angle lens.
    distortion_chance
        Probability of the apparent distortion without any.
    distorted
        True when the distortion is beyond chance.
    largest_change
        Largest relative difference, along either axis, between the pixel size at a dot and the scale: the error of
        the scale elsewhere in the image.
    """

    centres_px: NDArray[np.float64]
    cells: NDArray[np.float64]
    residuals_px: NDArray[np.float64]
    strays_px: NDArray[np.float64]
    bright: bool
    width_px: float
    order: int
    distortion_chance: float
    distorted: bool
    largest_change: float

    def __post_init__(self) -> None:
        freeze_arrays(self, "centres_px", "cells", "residuals_px", "strays_px", dtype=float)


def scale_from_dots(
    image: TactileImage,
    reference: TactileImage | None = None,
    *,
    pitch_mm: float,
    pitch_sd_mm: float = 0.0,
    min_dots: int = FEWEST,
) -> tuple[PixelScale, DotDiagnostics]:
    """Measure the size of a pixel along each image axis on a square board of dots.

    The dots may be darker or brighter than their surroundings and rotated by any angle, and some may be missing. The
    scale is the mean over one pitch to either side of the probe's axis (``image.axis_px``). Perspective and lens
    distortion are fitted too: they widen the interval and do not shift the scale. The interval also includes the bend
    of the pixel size over that pitch, a skew beyond noise, and at least 2e-4 of the size.

    Along the image's axes a board with two pitches looks like a camera with longer pixels: it is refused only where
    the pixels' sides would differ by more than a quarter. Rotated by 45 degrees it shows its pitches as skew. Where
    every second dot is missing as on a chessboard the lattice is again square; this is not detected.

    Parameters
    ----------
    image
        The probe with the board pressed on it; its own scale is not used.
    reference
        The untouched probe in the same light; None when the light is even.
    pitch_mm
        Distance of neighbouring dots, centre to centre, along both axes of the board, in [0.05, 50] mm.
    pitch_sd_mm
        Its standard uncertainty, in [0, 1] mm: of the mean pitch over the board, not the scatter of single dots.
    min_dots
        Fewest dots, 16 or more: fewer cannot separate distortion from scale.

    Returns
    -------
    scale : PixelScale
        The pixel sizes with their uncertainties.
    diagnostics : DotDiagnostics
        The dots, the lattice, the residuals, and the distortion.

    Raises
    ------
    CalibrationError
        When there are no dots, or too few, when they form no square lattice or several, when a pixel would be
        outside 0.8 to 1.25 times as high as wide or the lattice more than 3 degrees askew, or when the scale is
        impossible for a tactile probe.
    ImageMismatchError
        When the reference differs from the image in size, scale or full scale.
    InputError
        When an argument is outside its range.

    Examples
    --------
    >>> from tsis.imaging import Sensor
    >>> from tsis.virtual.calibration_bench import dot_board_frame
    >>> frame = dot_board_frame(Sensor(mm_per_pixel=(0.0336, 0.0392)), rng=np.random.default_rng(1), pitch_mm=2.5)
    >>> scale, diagnostics = scale_from_dots(frame, pitch_mm=2.5)
    >>> [round(size, 4) for size in scale.mm_per_pixel]
    [0.0336, 0.0392]
    """
    require_image("image", image)
    pitch = MeasuredValue(
        value=require_number("pitch_mm", pitch_mm, 0.05, 50.0, hint="millimetres"),
        sd=require_number("pitch_sd_mm", pitch_sd_mm, 0.0, 1.0, hint="millimetres"),
        unit="mm",
    )
    min_dots = require_integer("min_dots", min_dots, FEWEST, 10**6)
    change = image if reference is None else subtract_background(image, reference)
    spots = find_spots(change.grey, least=min_dots)
    cells, centres, strays = _dots(spots, min_dots)
    fitted = fit_map(cells, centres)
    cell = _cell_of_axis(fitted, image.axis())
    fitted = with_square_axes(fitted, cell)
    cell = fitted.cell_at(image.axis())
    _check_rough(fitted)
    x, y = with_model_uncertainty(fitted.pixel_size(cell, pitch=pitch), fitted, cell)
    check_field((x.value, y.value), image.grey.shape, "pitch_mm", pitch_mm)
    residuals = fitted.residuals_px()
    step = fitted.face_step(cell)
    scale = PixelScale(
        mm_per_pixel_x=x,
        mm_per_pixel_y=y,
        shape=(image.grey.shape[0], image.grey.shape[1]),
        at_px=image.axis(),
        method="dots",
        count=len(cells),
        residual_px=_root_mean_square(residuals),
        rotation_deg=rotation_deg(step),
        skew_deg=skew_deg(step),
    )
    chance = chance_of(fit_order(fitted.cells, fitted.positions_px, FIRST_ORDER), fitted)
    sizes = np.array([np.linalg.norm(fitted.face_step(dot), axis=0) for dot in fitted.cells])
    diagnostics = DotDiagnostics(
        centres_px=centres,
        cells=fitted.cells,
        residuals_px=residuals,
        strays_px=strays,
        bright=spots.bright,
        width_px=spots.width_px,
        order=fitted.order,
        distortion_chance=chance,
        distorted=chance < BEYOND_CHANCE,
        largest_change=float(np.abs(sizes / np.linalg.norm(step, axis=0) - 1).max()),
    )
    return scale, diagnostics


def _dots(spots: Spots, least: int) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Lattice coordinates and centres of the dots, and the centres of the other spots."""
    positions = spots.positions_px
    if len(positions) < least:
        raise CalibrationError(
            f"image must show at least {least} dots; {len(positions)} spots stand out (press the dot board flat on the "
            "face, light it evenly, and give the untouched probe as reference)"
        )
    rows = index_lattice(positions)
    if len(rows) < max(least, (1 - MOST_STRANGERS) * len(positions)):
        raise CalibrationError(
            f"image must show at least {least} dots of a square lattice; of {len(positions)} spots {len(rows)} lie on "
            "one (press the dot board flat on the face, and clean the face)"
        )
    cells = rows[:, 1:].astype(float)
    centres = in_even_light(positions[rows[:, 0]], spots.strength[rows[:, 0]], spots.width_px)
    if min(len(np.unique(cells[:, axis])) for axis in (0, 1)) < LEAST_SIDE:
        raise CalibrationError(
            f"the dots must form at least {LEAST_SIDE} rows and {LEAST_SIDE} columns; {len(rows)} dots lie in fewer "
            "(press the whole board on the face)"
        )
    good = without_strays(cells, centres)
    dots = set(rows[good, 0].tolist())
    strays = np.array([position for spot, position in enumerate(positions) if spot not in dots]).reshape(-1, 2)
    return cells[good], centres[good], strays


def _cell_of_axis(fitted: BoardMap, axis_px: tuple[float, float]) -> NDArray[np.float64]:
    cell = fitted.cell_at(axis_px)
    low, high = fitted.cells.min(axis=0) - 1, fitted.cells.max(axis=0) + 1
    if not (np.isfinite(cell).all() and (low <= cell).all() and (cell <= high).all()):
        raise CalibrationError(
            f"the dots must surround the probe's axis at ({axis_px[0]:.0f}, {axis_px[1]:.0f}) px, where the scale is "
            "measured; they lie aside (press the board on the middle of the face)"
        )
    return cell


def _check_rough(fitted: BoardMap) -> None:
    nearest = np.asarray(scipy.spatial.cKDTree(fitted.positions_px).query(fitted.positions_px, k=2)[0])
    rough = _root_mean_square(fitted.residuals_px()) / float(np.median(nearest[:, 1]))
    if rough > ROUGHEST:
        raise CalibrationError(
            f"the dots must lie on a lattice to {ROUGHEST:.0%} of their distance; they miss it by {rough:.0%} (press "
            "the board flat on the face, and clean the face)"
        )


def _root_mean_square(residuals_px: NDArray[np.float64]) -> float:
    return float(np.sqrt((residuals_px**2).sum(axis=1).mean()))
