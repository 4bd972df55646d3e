"""What a clean fit of the dots cannot know of the scale: bent pixels, a board that is not square, a spot's own bias.

The residuals tell how well the dots fit the map. Where they fit to a hundredth of a pixel, what the map leaves out is
larger. The bend counts in full: the mean over a pitch and the size at the place itself are both called the scale.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

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
from tsis.model import freeze_arrays, require_integer, require_number

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.model import TactileImage


LEAST_FRACTION = 2e-4  # relative; no picture of spots goes below it: light, aberrations, the gel's creep
EVEN = 3**0.5  # bound of an even distribution over its standard deviation
BY_CHANCE = 2.0  # standard deviations that noise explains


def with_model_uncertainty(
    sizes: tuple[MeasuredValue, MeasuredValue], fitted: BoardMap, cell: NDArray[np.float64]
) -> tuple[MeasuredValue, ...]:
    """Pixel sizes (x, y) with the uncertainty of what the map of the dots leaves out added to that of its residuals.

    Parameters
    ----------
    sizes
        As the residuals alone give them, pitch included.
    fitted
        The map from board to image.
    cell
        Place on the lattice, shape (2,), in pitches.
    """
    bend = _beyond_noise(*fitted.bend(cell))
    # Between no error and half the skew anything is as likely (GUM 4.3.7: bound over the root of three).
    askew = _skew_beyond_noise(fitted, cell) / 2 / EVEN
    fractions = np.sqrt(LEAST_FRACTION**2 + bend**2 + askew**2)
    return tuple(_widened(size, float(fraction)) for size, fraction in zip(sizes, fractions, strict=True))


def _beyond_noise(values: NDArray[np.float64], noise: NDArray[np.float64]) -> NDArray[np.float64]:
    """Size of what was found less what noise explains, which the residuals' part has counted already."""
    return np.asarray(np.sqrt(np.maximum(values**2 - (BY_CHANCE * noise) ** 2, 0.0)))


def _skew_beyond_noise(fitted: BoardMap, cell: NDArray[np.float64]) -> float:
    """Sine of the skew that noise does not explain.

    Cameras' axes are square, so it is the board's or the tilt's. Pitches that differ by a share e, turned by 45
    degrees, show a skew of e and make both pixel sizes wrong by e / 2; a board sheared by an angle s makes one wrong
    by 1 - cos(s), which is less.
    """
    sine = np.sin(np.radians(skew_deg(fitted.face_step(cell))))
    x, y = fitted.pixel_size(cell, pitch=MeasuredValue(value=1.0, sd=0.0))
    return float(_beyond_noise(np.array(sine), np.hypot(x.sd / x.value, y.sd / y.value)))


def _widened(size: MeasuredValue, fraction: float) -> MeasuredValue:
    given = (fraction * size.value) ** 2
    total = size.sd**2 + given
    # Only the residuals' part rests on few degrees of freedom (Welch and Satterthwaite).
    freedom = size.degrees_of_freedom * (total / size.sd**2) ** 2 if size.sd > 0 else np.inf
    return MeasuredValue(value=size.value, sd=total**0.5, degrees_of_freedom=float(freedom), unit=size.unit)


FEWEST = 16  # dots
LEAST_SIDE = 3  # dots along each side of the lattice: two have no residual
MOST_STRANGERS = 0.5  # share of the spots off the lattice
ROUGHEST = 0.06  # root mean square residual over the dots' distance


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DotDiagnostics:
    """What was found on the way to a scale from dots.

    Attributes
    ----------
    centres_px
        Centres (x, y) of the dots used, shape (n, 2), pixels.
    cells
        Their places on the lattice, whole pitches, shape (n, 2).
    residuals_px
        Centre less fitted place, shape (n, 2), pixels.
    strays_px
        Spots that are no dots of the lattice, shape (m, 2), pixels.
    bright
        True when the dots are brighter than what surrounds them.
    width_px
        Standard deviation of a Gaussian as wide as the dots, pixels.
    order
        Order of the polynomial fitted: 3, or 5 for a wide-angle lens.
    distortion_chance
        Chance that what looks like distortion is none.
    distorted
        True when the distortion is beyond chance.
    largest_change
        Largest relative difference between the pixel size at a dot and that of the scale, of either axis: how far the
        one scale may err elsewhere in the image.
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

    The dots may be darker or brighter than what surrounds them, turned by any angle, and some may be missing. The scale
    is that at the probe's axis (``image.axis_px``), as the mean over one pitch to either side. Perspective and lens
    distortion are fitted along, so that they widen the interval and do not shift the scale. The interval also allows
    for how much the pixel size bends over that pitch, for a skew beyond noise, and for 2e-4 of the size in any case.

    Along the image's axes a board with two pitches looks like one whose camera has longer pixels: it is refused only
    where the pixels' sides would differ by more than a quarter. A board turned by 45 degrees shows unlike pitches as
    skew. Where every second dot is missing as on a chessboard the lattice is again square, and nothing shows it.

    Parameters
    ----------
    image
        The probe with the board pressed on it; a scale it already has is not used.
    reference
        The untouched probe in the same light; None when the light is even.
    pitch_mm
        Distance of neighbouring dots, centre to centre, along both axes of the board, in [0.05, 50] mm.
    pitch_sd_mm
        Its standard uncertainty, in [0, 1] mm: of the mean pitch over the board, not the scatter of single dots.
    min_dots
        Fewest dots to measure on, 16 or more: fewer do not tell distortion from scale.

    Returns
    -------
    scale : Scale
        The pixel sizes with their uncertainties.
    diagnostics : DotDiagnostics
        The dots, the lattice, the residuals, and the distortion.

    Raises
    ------
    CalibrationError
        When there are no dots, or too few, when they form no square lattice or more than one, when a pixel would be
        outside 0.8 to 1.25 times as high as wide or the lattice more than 3 degrees askew, or when the scale would be
        no tactile probe's.
    ImageMismatchError
        When the reference is no companion of the image.
    InputError
        When an argument is outside its range.

    Examples
    --------
    >>> from tsis.imaging import Sensor
    >>> from tsis.virtual import dot_board_frame
    >>> frame = dot_board_frame(Sensor(mm_per_pixel=(0.0336, 0.0392)), rng=np.random.default_rng(1), pitch_mm=2.5)
    >>> scale, found = scale_from_dots(frame, pitch_mm=2.5)
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
    chance = chance_of(fit_order(fitted.cells, fitted.places_px, FIRST_ORDER), fitted)
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
        largest_change=_largest_change(fitted, step),
    )
    return scale, diagnostics


def _dots(spots: Spots, least: int) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Lattice coordinates and centres of the dots, and the centres of the spots that are none."""
    positions = spots.positions_px
    if len(positions) < least:
        raise CalibrationError(
            f"image must show at least {least} dots; {len(positions)} spots stand out (press the dot board flat on the "
            "face, light it evenly, and give the untouched probe as reference)"
        )
    rows = index_lattice(positions)
    if len(rows) < max(least, (1 - MOST_STRANGERS) * len(positions)):
        raise CalibrationError(
            f"image must show at least {least} dots of a square lattice; of {len(positions)} spots "
            f"{len(rows)} lie on one "
            "(press the dot board flat on the face, and clean the face)"
        )
    cells = rows[:, 1:].astype(float)
    centres = in_even_light(positions[rows[:, 0]], spots.strength[rows[:, 0]], spots.width_px)
    if min(len(np.unique(cells[:, axis])) for axis in (0, 1)) < LEAST_SIDE:
        raise CalibrationError(
            f"the dots must form at least {LEAST_SIDE} rows and {LEAST_SIDE} columns; {len(rows)} dots lie in fewer "
            "(press the whole board on the face)"
        )
    save = without_strays(cells, centres)
    dots = set(rows[save, 0].tolist())
    strays = np.array([position for spot, position in enumerate(positions) if spot not in dots]).reshape(-1, 2)
    return cells[save], centres[save], strays


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
    nearest = np.asarray(cKDTree(fitted.places_px).query(fitted.places_px, k=2)[0])
    rough = _root_mean_square(fitted.residuals_px()) / float(np.median(nearest[:, 1]))
    if rough > ROUGHEST:
        raise CalibrationError(
            f"the dots must lie on a lattice to {ROUGHEST:.0%} of their distance; they miss it by {rough:.0%} (press "
            "the board flat on the face, and clean the face)"
        )


def _root_mean_square(residuals_px: NDArray[np.float64]) -> float:
    return float(np.sqrt((residuals_px**2).sum(axis=1).mean()))


def _largest_change(fitted: BoardMap, step: NDArray[np.float64]) -> float:
    here = np.linalg.norm(step, axis=0)
    sizes = np.array([np.linalg.norm(fitted.face_step(cell), axis=0) for cell in fitted.cells])
    return float(np.abs(sizes / here - 1).max())
