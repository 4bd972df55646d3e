"""The pixels of a frame inside a ball's contact, and their roundness."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy
import skimage

from tsis.calibration._measured import MeasuredValue
from tsis.errors import CalibrationError
from tsis.imaging import find_contact, require_image, segment, signal, smoothed

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.model.image import TactileImage


RESPONSE_ORDER = 4  # of the polynomial of grey level against depth
INNER = 0.75  # fraction of the radius of steepest fall: beyond the contact's edge the face is the gel's
SECTORS = 12  # of the face about the ball, left out in turn for the uncertainty
MOST_PIXELS = 3000  # of a press; more are averaged in blocks
LEAST_LIGHT = 0.1  # of the reference's median; lower light is not divided by
LEAST_PIXELS = 200


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BallPress:
    """Pixels of a press inside the ball's contact: positions relative to a first centre, grey change, sector."""

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    grey: NDArray[np.float64]
    sector: NDArray[np.int64]
    centre_px: tuple[float, float]
    radius_px: float
    darker: bool


def read_ball_press(image: TactileImage, reference: TactileImage | None) -> BallPress:
    """The pixels inside the ball's contact, which may be darker or brighter."""
    require_image("image", image)
    change = replace(signal(image, reference), mm_per_pixel=None)
    darkened = replace(change, grey=0.0 - change.grey)
    darker = float(smoothed(darkened.grey).max()) > float(smoothed(change.grey).max())
    change = _in_even_light(darkened, reference) if darker else change
    patch = segment(change)
    contact = None if patch.cropped else find_contact(change, patch=patch)
    if contact is None:
        raise CalibrationError(
            "image must show one ball, pressed inside the picture; no whole round patch stands out (press the ball in "
            "the middle of the face, and give the untouched probe as reference)"
        )
    rows, columns = np.nonzero(patch.mask)
    # About a pixel's height over width: the patch's own extents stretch the circle to the ellipse of the image.
    wide, high = columns.std(), rows.std()
    span, down = np.sqrt(wide / high), np.sqrt(high / wide)
    # Means of blocks preserve the light of all pixels; the ball hardly bends inside a block.
    block = max(1, int(np.sqrt(np.pi / MOST_PIXELS) * INNER * contact.radius_px))
    whole = change.grey[: change.grey.shape[0] // block * block, : change.grey.shape[1] // block * block]
    grey = skimage.measure.block_reduce(whole, block, np.mean)  # type: ignore[no-untyped-call]
    y, x = (np.mgrid[: grey.shape[0], : grey.shape[1]] + 0.5) * block - 0.5
    x, y = x - contact.centre_px[0], y - contact.centre_px[1]
    inside = np.hypot(x / span, y / down) < INNER * contact.radius_px
    if np.count_nonzero(inside) < LEAST_PIXELS:
        raise CalibrationError(
            f"the ball's contact must cover {LEAST_PIXELS} pixels or more; it covers {np.count_nonzero(inside)} (press "
            "deeper, or use a larger ball)"
        )
    x, y, grey = x[inside], y[inside], grey[inside]
    sector = np.floor((np.arctan2(y, x) + np.pi) / (2 * np.pi) * SECTORS).astype(int) % SECTORS
    return BallPress(
        x=x,
        y=y,
        grey=grey,
        sector=sector,
        centre_px=contact.centre_px,
        radius_px=float(INNER * contact.radius_px * span),
        darker=darker,
    )


def _in_even_light(darkened: TactileImage, reference: TactileImage | None) -> TactileImage:
    """The darkening in even light: a depth removes a fraction of the light, so uneven light causes uneven loss."""
    if reference is None:
        return darkened
    light = smoothed(reference.grey)
    middle = float(np.median(light))
    return replace(darkened, grey=darkened.grey * middle / np.maximum(light, LEAST_LIGHT * middle))


def without_sector(press: BallPress, sector: int | None) -> BallPress:
    """The press without one sector about the ball; None removes no sector."""
    mask = slice(None) if sector is None else press.sector != sector
    return replace(press, x=press.x[mask], y=press.y[mask], grey=press.grey[mask], sector=press.sector[mask])


def pixel_aspect_ratio(press: BallPress) -> float:
    """Height over width of a pixel at which the signal is constant along circles about its centre."""
    size = press.radius_px

    def residuals(shape: NDArray[np.float64]) -> NDArray[np.float64]:
        squares = ((press.x - shape[1]) ** 2 + (np.exp(shape[0]) * (press.y - shape[2])) ** 2) / size**2
        return polynomial_residuals(squares, press.grey)

    fit = scipy.optimize.least_squares(residuals, np.zeros(3), x_scale=(0.01, 1.0, 1.0))
    return float(np.exp(fit.x[0]))


def polynomial_residuals(depth: NDArray[np.float64], grey: NDArray[np.float64]) -> NDArray[np.float64]:
    """Grey levels minus the best polynomial of a depth."""
    middle, half = (depth.max() + depth.min()) / 2, np.ptp(depth) / 2
    basis = np.polynomial.chebyshev.chebvander((depth - middle) / half, RESPONSE_ORDER)
    return np.asarray(grey - basis @ np.linalg.lstsq(basis, grey, rcond=None)[0])


def jackknife(values: NDArray[np.float64], whole: float, *, unit: str) -> MeasuredValue:
    """The value of all data with the jackknife spread of ``values``, each without one part of the data."""
    count = len(values)
    variance = (count - 1) / count * float(((values - values.mean()) ** 2).sum())
    return MeasuredValue(value=float(whole), sd=variance**0.5, degrees_of_freedom=count - 1, unit=unit)
