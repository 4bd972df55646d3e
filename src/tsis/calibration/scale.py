"""Pixel scale: mm on the face per pixel along each axis.

Presses of one ball at known travels show how fast its cap widens. The map from depth to grey level is a free
polynomial, and sectors about the ball, left out in turn, give the uncertainty.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy
import skimage

from tsis.calibration.measured import MeasuredValue
from tsis.errors import CalibrationError, ImageMismatchError, InputError
from tsis.imaging import find_contact
from tsis.imaging.corrections import SCALE_TOLERANCE, require_image, signal
from tsis.imaging.patch import segment, smoothed
from tsis.model.image import LARGEST_PIXEL_MM, SMALLEST_PIXEL_MM, TactileImage
from tsis.model.require import (
    freeze_arrays,
    require_array,
    require_integer,
    require_number,
    require_one_of,
    require_pair,
    require_type,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


METHODS = ("dots", "ball")
FIELD_MM = (5.0, 150.0)  # of the longer side of the picture: from fingertip to palm
UNIT = "mm/px"
RESPONSE_ORDER = 4  # of the polynomial of grey level against depth
INNER = 0.75  # fraction of the radius of steepest fall: beyond the contact's edge the face is the gel's
SECTORS = 12  # of the face about the ball, left out in turn for the uncertainty
MOST_PIXELS = 3000  # of a press; more are averaged in blocks
LEAST_LIGHT = 0.1  # of the reference's median; lower light is not divided by
LEAST_PIXELS = 200
LEAST_TRAVEL = 0.02  # difference of the travels over the ball's radius


@dataclass(frozen=True, slots=True, kw_only=True)
class PixelScale:
    """The size of a pixel on the face, along each axis of the image.

    Raises `InputError` when a value lies outside its range.

    Parameters
    ----------
    mm_per_pixel_x, mm_per_pixel_y
        Length on the face of one step to the next column and of one to the next row, mm/px, each with its standard
        uncertainty.
    shape
        Size (rows, columns) of the frames.
    at_px
        Image position (x, y) of the measurement; a lens with distortion has another scale elsewhere.
    method
        ``"dots"`` or ``"ball"``.
    count
        Number of dots, or of presses of the ball.
    residual_px
        Root mean square distance of the dots from the fit, pixels; 0 for a ball, whose residuals are grey levels.
    rotation_deg
        Angle in degrees from the image's x axis, towards its y axis, to the nearest axis of the dot board, in
        [-45, 45]; 0 for a ball.
    skew_deg
        Departure of the image's two axes from a right angle on the face, degrees; 0 for a ball, which assumes one.

    Examples
    --------
    >>> size = MeasuredValue(value=0.05, sd=0.0001, unit="mm/px")
    >>> scale = PixelScale(
    ...     mm_per_pixel_x=size, mm_per_pixel_y=size, shape=(480, 640), at_px=(319.5, 239.5), method="dots", count=63
    ... )
    >>> scale.mm_per_pixel
    (0.05, 0.05)
    """

    mm_per_pixel_x: MeasuredValue
    mm_per_pixel_y: MeasuredValue
    shape: tuple[int, int]
    at_px: tuple[float, float]
    method: str
    count: int
    residual_px: float = 0.0
    rotation_deg: float = 0.0
    skew_deg: float = 0.0

    def __post_init__(self) -> None:
        for name in ("mm_per_pixel_x", "mm_per_pixel_y"):
            size = getattr(self, name)
            require_type(name, size, MeasuredValue)
            require_number(name, size.value, SMALLEST_PIXEL_MM, LARGEST_PIXEL_MM, hint="millimetres per pixel")
            if size.unit != UNIT:
                raise InputError(f"{name} must be in {UNIT}; got {size.unit!r}")
        if not isinstance(self.shape, (tuple, list)) or len(self.shape) != 2:
            raise InputError(f"shape must hold rows and columns; got {self.shape!r}")
        rows, columns = (require_integer("shape", side, 1, 65536) for side in self.shape)
        object.__setattr__(self, "shape", (rows, columns))
        object.__setattr__(self, "at_px", require_pair("at_px", self.at_px))
        require_one_of("method of a scale", self.method, METHODS)
        object.__setattr__(self, "count", require_integer("count", self.count, 1, 10**6))
        require_number("residual_px", self.residual_px, 0.0, 1e4, hint="pixels")
        require_number("rotation_deg", self.rotation_deg, -45.0, 45.0, hint="degrees")
        require_number("skew_deg", self.skew_deg, -90.0, 90.0, hint="degrees")

    @property
    def mm_per_pixel(self) -> tuple[float, float]:
        """Size (x, y) of a pixel on the face, mm, for `TactileImage`."""
        return self.mm_per_pixel_x.value, self.mm_per_pixel_y.value

    def on(self, image: TactileImage) -> TactileImage:
        """The frame with this scale.

        Raises `ImageMismatchError` when the frame differs in size from those of the measurement, or has another scale.
        """
        require_type("image", image, TactileImage)
        if image.grey.shape != self.shape:
            raise ImageMismatchError(
                f"image must have the shape {self.shape} that the scale was measured on; got {image.grey.shape} "
                "(measure the scale in the camera mode that you use)"
            )
        theirs = image.mm_per_pixel
        if theirs is not None and not np.allclose(theirs, self.mm_per_pixel, rtol=SCALE_TOLERANCE, atol=0.0):
            ours = " x ".join(f"{size:.4g}" for size in self.mm_per_pixel)
            raise ImageMismatchError(
                f"image must have the calibration's scale of {ours} mm per pixel; got "
                f"{' x '.join(f'{size:.4g}' for size in theirs)} (give the calibration of the probe that took it)"
            )
        return replace(image, mm_per_pixel=self.mm_per_pixel)


def check_field(mm_per_pixel: Sequence[float], shape: tuple[int, ...], length: str, value_mm: float) -> None:
    """Refuse a scale that is impossible for a tactile probe, mostly because of a length in another unit."""
    field = max(mm_per_pixel[0] * shape[1], mm_per_pixel[1] * shape[0])
    if not FIELD_MM[0] <= field <= FIELD_MM[1]:
        raise CalibrationError(
            f"{length} must be in millimetres: with {value_mm:g} mm the picture would be {field:.3g} mm wide, and a "
            f"probe's is {FIELD_MM[0]:g} to {FIELD_MM[1]:g} mm (is it in another unit, or another board's?)"
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _BallPress:
    """Pixels of a press inside the ball's contact: positions relative to a first centre, grey change, sector."""

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    grey: NDArray[np.float64]
    sector: NDArray[np.int64]
    centre_px: tuple[float, float]
    radius_px: float
    darker: bool


def _read_ball_press(image: TactileImage, reference: TactileImage | None) -> _BallPress:
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
    return _BallPress(
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


def _without_sector(press: _BallPress, sector: int | None) -> _BallPress:
    """The press without one sector about the ball; None removes no sector."""
    mask = slice(None) if sector is None else press.sector != sector
    return replace(press, x=press.x[mask], y=press.y[mask], grey=press.grey[mask], sector=press.sector[mask])


def _pixel_aspect_ratio(press: _BallPress) -> float:
    """Height over width of a pixel at which the signal is constant along circles about its centre."""
    size = press.radius_px

    def residuals(shape: NDArray[np.float64]) -> NDArray[np.float64]:
        squares = ((press.x - shape[1]) ** 2 + (np.exp(shape[0]) * (press.y - shape[2])) ** 2) / size**2
        return _polynomial_residuals(squares, press.grey)

    fit = scipy.optimize.least_squares(residuals, np.zeros(3), x_scale=(0.01, 1.0, 1.0))
    return float(np.exp(fit.x[0]))


def _polynomial_residuals(depth: NDArray[np.float64], grey: NDArray[np.float64]) -> NDArray[np.float64]:
    """Grey levels minus the best polynomial of a depth."""
    middle, half = (depth.max() + depth.min()) / 2, np.ptp(depth) / 2
    basis = np.polynomial.chebyshev.chebvander((depth - middle) / half, RESPONSE_ORDER)
    return np.asarray(grey - basis @ np.linalg.lstsq(basis, grey, rcond=None)[0])


def _jackknife(values: NDArray[np.float64], whole: float, *, unit: str) -> MeasuredValue:
    """The value of all data with the _jackknife spread of ``values``, each without one part of the data."""
    count = len(values)
    variance = (count - 1) / count * float(((values - values.mean()) ** 2).sum())
    return MeasuredValue(value=float(whole), sd=variance**0.5, degrees_of_freedom=count - 1, unit=unit)


def _first_shape(
    presses: list[_BallPress], travel: NDArray[np.float64], radius: float, ratio: float
) -> NDArray[np.float64]:
    """Starting values: log sizes x and y, and the shift (x, y) of each centre."""
    # At the level of the shallowest press's middle the deepest press has the radius at which the ball is higher by the
    # travel.
    shallow, deep = presses[int(np.argmin(travel))], presses[int(np.argmax(travel))]
    squares = shallow.x**2 + (ratio * shallow.y) ** 2
    level = float(np.median(shallow.grey[squares <= np.quantile(squares, 0.02)]))
    wide = deep.x**2 + (ratio * deep.y) ** 2
    near = np.argsort(np.abs(deep.grey - level))[: max(10, len(wide) // 50)]
    rise = float(np.ptp(travel))
    size = np.sqrt((2 * radius * rise - rise**2) / max(float(np.median(wide[near])), 1.0))
    return np.concatenate([np.log([size, size * ratio]), np.zeros(2 * len(presses))])


def _fit_shape(
    presses: list[_BallPress], travel: NDArray[np.float64], radius: float, *, first: NDArray[np.float64]
) -> Any:
    """Fit log sizes and shifts by least squares: SciPy's result, its ``x`` laid out as in `_first_shape`."""
    grey = np.concatenate([press.grey for press in presses])

    def residuals(shape: NDArray[np.float64]) -> NDArray[np.float64]:
        return _polynomial_residuals(_depths(presses, travel, radius, shape), grey)

    return scipy.optimize.least_squares(
        residuals, first, x_scale=np.concatenate([[0.01, 0.01], np.ones(len(first) - 2)])
    )


def _depths(
    presses: list[_BallPress], travel: NDArray[np.float64], radius: float, shape: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Depth of each pixel of all presses, up to a constant."""
    size_x, size_y = np.exp(shape[:2])
    shifts = shape[2:].reshape(-1, 2)
    parts = []
    for press, reading, shift in zip(presses, travel, shifts, strict=True):
        squares = (size_x * (press.x - shift[0])) ** 2 + (size_y * (press.y - shift[1])) ** 2
        # Beyond the ball's equator, where only the search can go, the depth decreases steadily.
        parts.append(
            reading - radius + np.sqrt(np.maximum(radius**2 - squares, 0.0)) - np.maximum(squares / radius**2 - 1, 0.0)
        )
    return np.concatenate(parts)


def _shape_slopes(
    presses: list[_BallPress], travel: NDArray[np.float64], radius: float, shape: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Change of the log sizes per 1 mm of each reading and of the radius, shape (presses + 1, 2)."""
    step = 0.01 * float(np.ptp(travel))
    rows = []
    for k in range(len(travel)):
        shifted = travel.copy()
        shifted[k] += step
        rows.append((_fit_shape(presses, shifted, radius, first=shape).x[:2] - shape[:2]) / step)
    rows.append((_fit_shape(presses, travel, radius + step, first=shape).x[:2] - shape[:2]) / step)
    return np.array(rows)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BallDiagnostics:
    """Diagnostics of a scale from a ball.

    Attributes
    ----------
    centres_px
        Centre (x, y) of each press, shape (presses, 2), pixels.
    radii_px
        Radius of the region used in each press along the image's x axis, shape (presses,), pixels.
    axis_ratio
        Height over width of a pixel, from the roundness of the ball.
    residual_grey
        Root mean square residual of the fit, grey levels.
    darker
        True when the ball makes the probe darker.
    """

    centres_px: NDArray[np.float64]
    radii_px: NDArray[np.float64]
    axis_ratio: MeasuredValue
    residual_grey: float
    darker: bool

    def __post_init__(self) -> None:
        freeze_arrays(self, "centres_px", "radii_px", dtype=float)


def axis_ratio_from_ball(image: TactileImage, reference: TactileImage | None = None) -> MeasuredValue:
    """Height over width of a pixel from one press of a ball of any radius, whose contact is round.

    Raises `CalibrationError` when the image shows no ball, or a cropped or too small one.

    Parameters
    ----------
    image
        The probe with the ball pressed on it, or its change when there is no reference.
    reference
        The untouched probe in the same light.

    Returns
    -------
    MeasuredValue
        ``mm_per_pixel_y / mm_per_pixel_x``, with the _jackknife uncertainty over sectors.

    Examples
    --------
    >>> from tsis.imaging.sensor import Sensor
    >>> from tsis.virtual.calibration_bench import ball_frame, untouched_frame
    >>> rng, sensor = np.random.default_rng(1), Sensor(mm_per_pixel=(0.0336, 0.0392))
    >>> ratio = axis_ratio_from_ball(ball_frame(sensor, rng=rng), untouched_frame(sensor, rng=rng))
    >>> abs(ratio.value - 0.0392 / 0.0336) < 0.01
    True
    """
    press = _read_ball_press(image, reference)
    ratios = [_pixel_aspect_ratio(_without_sector(press, sector)) for sector in (None, *range(SECTORS))]
    return _jackknife(np.array(ratios[1:]), ratios[0], unit="")


def scale_from_ball(
    images: Sequence[TactileImage],
    reference: TactileImage | None = None,
    *,
    ball_radius_mm: float,
    travel_mm: Sequence[float],
    ball_radius_sd_mm: float = 0.0,
    travel_sd_mm: float = 0.005,
) -> tuple[PixelScale, BallDiagnostics]:
    """Measure the size of a pixel along each image axis with a ball at two or more depths.

    The probe's grey level must follow the depth of its face (a translucent gel on a stiff back). Where it follows
    pressure, as on a waveguide, use `scale_from_dots`.

    Raises `CalibrationError` when an image shows no ball, when presses are too few or their depths too similar, or when
    the scale is impossible for a tactile probe; `ImageMismatchError` when images or the reference differ in size or
    full scale; `InputError` when an argument is outside its range.

    Parameters
    ----------
    images
        Two or more presses of one ball, none cropped.
    reference
        The untouched probe in the same light; None when the images are changes already.
    ball_radius_mm
        Radius of the ball, in [0.2, 50] mm.
    travel_mm
        Reading of the stage that moves the ball for each press, larger is deeper; only differences count.
    ball_radius_sd_mm
        Standard uncertainty of the radius, in [0, 5] mm.
    travel_sd_mm
        Standard uncertainty of each reading, in [0, 1] mm. It usually dominates the uncertainty of the scale.

    Returns
    -------
    scale : PixelScale
        The pixel sizes with their uncertainties, at the mean position of the presses.
    diagnostics : BallDiagnostics
        Positions of the presses, and the ratio of the axes.

    Examples
    --------
    >>> from tsis.imaging.sensor import Sensor
    >>> from tsis.virtual.calibration_bench import ball_frame, untouched_frame
    >>> rng, sensor = np.random.default_rng(1), Sensor(mm_per_pixel=(0.0336, 0.0392))
    >>> frames = [ball_frame(sensor, rng=rng, ball_radius_mm=4.0, depth_mm=depth) for depth in (0.7, 1.0, 1.3)]
    >>> untouched = untouched_frame(sensor, rng=rng)
    >>> scale, _ = scale_from_ball(frames, untouched, ball_radius_mm=4.0, travel_mm=(0.0, 0.3, 0.6))
    >>> low, high = scale.mm_per_pixel_x.interval(0.95)
    >>> low < 0.0336 < high
    True
    """
    radius = require_number("ball_radius_mm", ball_radius_mm, 0.2, 50.0, hint="millimetres")
    require_number("ball_radius_sd_mm", ball_radius_sd_mm, 0.0, 5.0, hint="millimetres")
    require_number("travel_sd_mm", travel_sd_mm, 0.0, 1.0, hint="millimetres")
    travel = _checked_travel(images, travel_mm, radius)
    presses = [_read_ball_press(image, reference) for image in images]
    if len({image.grey.shape for image in images}) > 1:
        raise ImageMismatchError("images must have one shape; record all presses in one mode of the camera")
    if len({press.darker for press in presses}) > 1:
        raise CalibrationError(
            "the ball must change the light in one direction; it makes some presses darker, some brighter"
        )
    start = np.array([_pixel_aspect_ratio(press) for press in presses])
    fit = _fit_shape(presses, travel, radius, first=_first_shape(presses, travel, radius, float(np.median(start))))
    parts = [
        _fit_shape([_without_sector(press, sector) for press in presses], travel, radius, first=fit.x).x
        for sector in range(SECTORS)
    ]
    x, y = _sizes(
        fit.x, np.array(parts), _shape_slopes(presses, travel, radius, fit.x), ball_radius_sd_mm, travel_sd_mm
    )
    check_field((x.value, y.value), images[0].grey.shape, "ball_radius_mm and travel_mm", radius)
    centres = np.array([press.centre_px for press in presses]) + fit.x[2:].reshape(-1, 2)
    ratios = np.exp(np.array(parts)[:, 1] - np.array(parts)[:, 0])
    scale = PixelScale(
        mm_per_pixel_x=x,
        mm_per_pixel_y=y,
        shape=(images[0].grey.shape[0], images[0].grey.shape[1]),
        at_px=(float(centres[:, 0].mean()), float(centres[:, 1].mean())),
        method="ball",
        count=len(presses),
    )
    diagnostics = BallDiagnostics(
        centres_px=centres,
        radii_px=np.array([press.radius_px for press in presses]),
        axis_ratio=_jackknife(ratios, float(np.exp(fit.x[1] - fit.x[0])), unit=""),
        residual_grey=float(np.sqrt(np.mean(fit.fun**2))),
        darker=presses[0].darker,
    )
    return scale, diagnostics


def _checked_travel(images: Sequence[TactileImage], travel_mm: Sequence[float], radius: float) -> NDArray[np.float64]:
    travel: NDArray[np.float64] = require_array("travel_mm", travel_mm, ndim=1)
    if len(images) != len(travel):
        raise InputError(f"travel_mm must hold one reading for each of the {len(images)} images; got {len(travel)}")
    if len(images) < 2:
        raise CalibrationError(
            "a scale from a ball needs two presses or more whose depths differ by a known travel; got one, which gives "
            "only the ratio of the axes (press deeper and read the stage, or use a dot board)"
        )
    if np.ptp(travel) < LEAST_TRAVEL * radius or np.ptp(travel) > radius:
        raise CalibrationError(
            f"travel_mm must differ by {LEAST_TRAVEL * radius:.2g} to {radius:g} mm between the presses of this ball; "
            f"it differs by {np.ptp(travel):.3g} mm (is it in another unit?)"
        )
    return travel


def _sizes(
    shape: NDArray[np.float64],
    parts: NDArray[np.float64],
    slopes: NDArray[np.float64],
    radius_sd_mm: float,
    travel_sd_mm: float,
) -> tuple[MeasuredValue, MeasuredValue]:
    sizes = []
    for axis in (0, 1):
        size = float(np.exp(shape[axis]))
        frames = _jackknife(np.exp(parts[:, axis]), size, unit=UNIT)
        inputs = size**2 * (np.sum((slopes[:-1, axis] * travel_sd_mm) ** 2) + (slopes[-1, axis] * radius_sd_mm) ** 2)
        total = frames.sd**2 + float(inputs)
        freedom = frames.degrees_of_freedom * (total / frames.sd**2) ** 2 if frames.sd > 0 else np.inf
        sizes.append(MeasuredValue(value=size, sd=total**0.5, degrees_of_freedom=float(freedom), unit=UNIT))
    return sizes[0], sizes[1]
