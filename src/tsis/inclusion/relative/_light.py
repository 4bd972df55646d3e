"""Change of light by a press against a reference, and checks that the frames are comparable."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.errors import ImageMismatchError, InputError
from tsis.imaging import (
    NOISE_FACTOR,
    SMOOTH_PX,
    pixel_noise,
    require_image,
    require_same_frame,
    smoothed,
    subtract_background,
)
from tsis.inclusion._frames import binary_features, correct_light
from tsis.model.calibration import Calibration
from tsis.model.image import as_images
from tsis.model.require import require_number, require_one_of, require_type

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.inclusion._prior import Booleans, Floats
    from tsis.model.image import TactileImage


UNTOUCHED, REFERENCE_TISSUE = "untouched probe", "plain tissue"
SAME_FORCE = 0.05  # relative; the light follows the force, so a larger difference would look like an inclusion
MOST_CLIPPED = 0.5  # fraction of a frame beyond which it is refused


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LightChange:
    """Change of light by a press.

    Attributes
    ----------
    image
        Change of grey level after a blur of one pixel.
    raised
        Factor of each pixel to the brightest light, shape (rows, columns).
    clipped
        True where the camera clipped in the press or in a reference, shape (rows, columns).
    noise_grey
        Standard deviation of the blurred change's pixel noise.
    against
        Content of the reference: ``"untouched probe"`` or ``"plain tissue"``.
    """

    image: TactileImage
    raised: Floats
    clipped: Booleans
    noise_grey: float
    against: str

    def is_drowned(self, threshold_grey: float) -> bool:
        """Whether noise alone exceeds a threshold somewhere in the frame."""
        return NOISE_FACTOR * self.noise_grey > threshold_grey


def brightest(calibration: Calibration | None) -> float:
    """Brightest light of the face, over that of the calibration's gain."""
    return 1.0 if calibration is None or calibration.light is None else float(calibration.light.relative.max())


def change_of_light(
    image: TactileImage,
    reference: TactileImage | Sequence[TactileImage],
    *,
    against: str,
    calibration: Calibration | None = None,
) -> LightChange:
    """Subtract a reference, or the mean of several, and blur by one pixel, since the source assumes no noise.

    With a calibration's light map, grey levels become those of the brightest light.

    Raises
    ------
    InputError
        When a scale is unknown, the frame is mostly clipped, or a reference's force contradicts ``against``.
    ImageMismatchError
        When a reference's size, scale, full scale or axis differ from the image's.
    UnknownNameError
        When ``against`` is neither of its two values.
    """
    require_one_of("kind of reference", against, (UNTOUCHED, REFERENCE_TISSUE))
    require_image("image", image)
    image.scale()
    if calibration is not None:
        require_type("calibration", calibration, Calibration)
    references = as_images("reference", reference)
    if not references:
        raise InputError("reference must hold at least one frame of the untouched probe or of plain tissue; got none")
    for frame in references:
        require_same_frame(image, frame, "reference")
        _check_axis(image, frame)
        _check_force(image, frame, against)
    clipped = np.any([frame.grey >= frame.full_scale for frame in (image, *references)], axis=0)
    if clipped.mean() > MOST_CLIPPED:
        raise InputError(
            f"at most half of a frame's pixels may be clipped; got {100 * clipped.mean():.0f} % (shorten the exposure)"
        )
    mean = replace(references[0], grey=np.mean([frame.grey for frame in references], axis=0))
    raised = _raised(image, calibration)
    change = subtract_background(image, mean)
    change = replace(change, grey=change.grey * raised)
    # A Gaussian of standard deviation s reduces white noise by the factor 1 / (2 s sqrt(pi)).
    noise = pixel_noise(change.grey) / (2.0 * SMOOTH_PX * np.sqrt(np.pi))
    return LightChange(
        image=replace(change, grey=smoothed(change.grey)),
        raised=raised,
        clipped=clipped,
        noise_grey=noise,
        against=against,
    )


def _raised(image: TactileImage, calibration: Calibration | None) -> Floats:
    """Factor of each pixel to the brightest light; ones without a light map."""
    if calibration is None or calibration.light is None:
        return np.ones(image.grey.shape)
    lit = replace(image, grey=np.full(image.grey.shape, calibration.background_grey + 1.0))
    return correct_light(lit, calibration).grey * brightest(calibration)


def _check_axis(image: TactileImage, reference: TactileImage) -> None:
    """Refuse a reference with another axis."""
    if image.axis() != reference.axis():
        raise ImageMismatchError(
            f"reference must have the image's axis_px {image.axis()}; got {reference.axis()} (do not move the camera)"
        )


def _check_force(image: TactileImage, reference: TactileImage, against: str) -> None:
    """Refuse a reference whose force contradicts ``against``."""
    force = reference.force_n
    if force is None:
        return
    if against == UNTOUCHED and force > 0:
        raise InputError(
            f"reference must be untouched, force_n 0, against the {UNTOUCHED}; got one pressed with {force:g} N "
            f'(for a reference press set against="{REFERENCE_TISSUE}")'
        )
    if against == REFERENCE_TISSUE and force == 0:
        raise InputError(f'reference must be a reference press; got force_n 0 (set against="{UNTOUCHED}")')
    if (
        against == REFERENCE_TISSUE
        and image.force_n is not None
        and abs(force - image.force_n) > SAME_FORCE * image.force_n
    ):
        raise InputError(
            f"reference must be pressed as hard as the image, {image.force_n:g} N within {100 * SAME_FORCE:g} %; "
            f"got {force:g} N"
        )


def matching_references(
    image: TactileImage, references: Sequence[TactileImage], *, against: str
) -> tuple[TactileImage, ...]:
    """References for an image: all of the untouched probe, else the reference presses of equal force.

    Forces are equal within 5 %, or where one of the two is unknown.

    Raises
    ------
    InputError
        When there is none.
    UnknownNameError
        When ``against`` is neither of its two values.
    """
    require_one_of("kind of reference", against, (UNTOUCHED, REFERENCE_TISSUE))
    force = image.force_n
    fitting = tuple(
        frame
        for frame in references
        if against == UNTOUCHED
        or force is None
        or frame.force_n is None
        or abs(frame.force_n - force) <= SAME_FORCE * force
    )
    if not fitting:
        forces = " and ".join(f"{frame.force_n:g} N" for frame in references) or "none"
        raise InputError(
            f"{image.name or 'an image'} must be compared with the untouched probe, or with a reference press at "
            f"its force {'' if force is None else f'{force:g} N '}within {100 * SAME_FORCE:g} %; got {forces}"
        )
    return fitting


SOURCE_THRESHOLD = 5.0 / 255.0  # of full scale: the source's k = 5 of 8 bits
LEAST_WIDTH_PX = 5.0  # the blur makes a disc of about half this width of one noisy pixel


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LitPart:
    """The largest connected part of a change above a threshold; other parts are noise.

    Attributes
    ----------
    mask
        True inside, shape (rows, columns); False everywhere when nothing is lit.
    area_mm2, diameter_mm
        Its area (6.1), and the diameter of the disc of that area (6.2).
    centroid_px
        Mean position (x, y) of its light, weighted by grey level, (6.7) and (6.8); None when nothing is lit.
    total_grey
        Sum of its grey levels.
    threshold_grey
        The threshold.
    flags
        Its defects.
    """

    mask: Booleans
    area_mm2: float
    diameter_mm: float
    centroid_px: tuple[float, float] | None
    total_grey: float
    threshold_grey: float
    flags: tuple[str, ...]


def lit_part(change: LightChange, threshold_grey: float | None) -> LitPart:
    """Count the pixels brighter than ``threshold_grey``, 5 of 255 levels when None."""
    full_scale = change.image.full_scale
    least = SOURCE_THRESHOLD * full_scale if threshold_grey is None else threshold_grey
    require_number("threshold_grey", least, 1e-6 * full_scale, full_scale, hint="above zero")
    result = binary_features(change.image, least)
    lit = result.contact and result.equivalent_diameter_px >= LEAST_WIDTH_PX
    mask = result.patch.mask & lit
    wrong = {
        "no_contact": not lit,
        "cropped": lit and result.cropped,
        "saturated": bool(change.clipped[mask].any()),
        "noisy": change.is_drowned(least),
    }
    light = np.where(mask, np.maximum(change.image.grey, 0.0), 0.0)
    row, column = scipy.ndimage.center_of_mass(light) if lit else (0.0, 0.0)
    return LitPart(
        mask=mask,
        area_mm2=(result.area_mm2 or 0.0) * lit,
        diameter_mm=(result.equivalent_diameter_mm or 0.0) * lit,
        centroid_px=(float(column), float(row)) if lit else None,
        total_grey=float(light.sum()),
        threshold_grey=float(least),
        flags=tuple(flag for flag, is_so in wrong.items() if is_so),
    )
