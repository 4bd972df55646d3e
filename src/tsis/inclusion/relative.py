"""Relative estimates of section 6.2: size (6.2), depth (6.9) and hardness (6.10), for comparing presses only.

Each reads the change of light by a press against a reference, after checks that the frames are comparable, and states
its assumptions and flags. Depth is read at the centroid of the light, (6.7) and (6.8).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.errors import ImageMismatchError, InputError, NotCalibratedError
from tsis.imaging.corrections import require_image, require_same_frame, subtract_background
from tsis.imaging.patch import NOISE_FACTOR, SMOOTH_PX, pixel_noise, smoothed
from tsis.inclusion.frames import binary_features, correct_light
from tsis.model.calibration import Calibration
from tsis.model.content import ContentValue
from tsis.model.image import as_images
from tsis.model.require import require_number, require_one_of, require_type

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from tsis.inclusion.prior import Booleans, Floats
    from tsis.model.image import TactileImage

    Frames = TactileImage | Sequence[TactileImage]


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
    brighter = binary_features(change.image, least)
    lit = brighter.contact and brighter.equivalent_diameter_px >= LEAST_WIDTH_PX
    mask = brighter.patch.mask & lit
    defects = {
        "no_contact": not lit,
        "cropped": lit and brighter.cropped,
        "saturated": bool(change.clipped[mask].any()),
        "noisy": change.is_drowned(least),
    }
    light = np.where(mask, np.maximum(change.image.grey, 0.0), 0.0)
    row, column = scipy.ndimage.center_of_mass(light) if lit else (0.0, 0.0)
    return LitPart(
        mask=mask,
        area_mm2=(brighter.area_mm2 or 0.0) * lit,
        diameter_mm=(brighter.equivalent_diameter_mm or 0.0) * lit,
        centroid_px=(float(column), float(row)) if lit else None,
        total_grey=float(light.sum()),
        threshold_grey=float(least),
        flags=tuple(flag for flag, is_so in defects.items() if is_so),
    )


NOTES = {
    "no_contact": "No pixel exceeds the threshold: there is nothing to measure.",
    "cropped": "The lit part touches the border of the picture: it may continue outside and be measured incompletely.",
    "saturated": "The camera clipped inside the lit part: grey levels there are too low.",
    "noisy": "Noise alone exceeds the threshold somewhere: single lit pixels mean nothing.",
    "no_growth": "The lit part does not grow from the first press to the second: there is no strain to divide by.",
    "corners_lit": "The picture's corners are lit: the initial threshold assumes that they are background.",
    "repeated_frames": "A frame equals the frame before it, as from a frozen camera: it adds no movement.",
    "contact_lost": "Some frames have no contact: steps to and from them are missing, and the path is too short.",
    "no_movement": "The positions differ by no more than noise: no movement was measured.",
}
COMPARED_WITH = {
    UNTOUCHED: "Tissue without inclusion stays below the threshold; in full contact the face itself is measured.",
    REFERENCE_TISSUE: "The reference press had the same force, on tissue of the same stiffness and thickness.",
}
SPHERE_ASSUMPTION = "There is one inclusion, and it is a sphere."
EVEN_LIGHT = "The light is uniform over the face, and the compared presses had equal light and force."
LIGHT_ASSUMPTION = "The light is that of the calibration, and the compared presses had equal force."


def comparison_assumptions(against: str, calibration: Calibration | None, *others: str) -> tuple[str, ...]:
    """Assumptions of a comparison of presses on spheres."""
    return (SPHERE_ASSUMPTION, COMPARED_WITH[against], equal_light_assumption(calibration), *others)


def equal_light_assumption(calibration: Calibration | None) -> str:
    """Assumption on the light."""
    return EVEN_LIGHT if calibration is None or calibration.light is None else LIGHT_ASSUMPTION


def notes_of(flags: tuple[str, ...]) -> tuple[str, ...]:
    """The sentence of each flag."""
    return tuple(NOTES[flag] for flag in flags)


@dataclass(frozen=True, slots=True, kw_only=True)
class RelativeReading(ContentValue):
    """A number that is valid only for comparing presses; ``print`` shows it with its assumptions and flags.

    Attributes
    ----------
    quantity
        Name of the quantity, e.g. ``"relative size"``.
    value
        The number; None without contact.
    unit
        Its unit.
    against
        Content of the reference: ``"untouched probe"`` or ``"plain tissue"``.
    assumptions
        Assumptions of a comparison of two such numbers, a message each.
    parts
        Intermediate results, by name with unit.
    flags
        Short names of the defects of this press.

    Examples
    --------
    >>> print(RelativeReading(quantity="relative size", value=6.25, unit="mm", against="plain tissue",
    ...                       assumptions=("There is one inclusion.",), flags=("cropped",)))
    relative size: 6.25 mm (against plain tissue)
      assumed: There is one inclusion.
      cropped: The lit part touches the border of the picture: it may continue outside and be measured incompletely.
    Research use only. Not reviewed or approved by any regulator. Not for patient care.
    """

    quantity: str
    value: float | None
    unit: str
    against: str
    assumptions: tuple[str, ...]
    parts: Mapping[str, float] = field(default_factory=dict)
    flags: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "parts", MappingProxyType(dict(self.parts)))

    @property
    def notes(self) -> tuple[str, ...]:
        """The sentence of each flag."""
        return notes_of(self.flags)

    def __str__(self) -> str:
        value = "no value" if self.value is None else f"{self.value:.4g} {self.unit}"
        lines = [f"{self.quantity}: {value} (against {self.against})"]
        lines += [f"  assumed: {assumption}" for assumption in self.assumptions]
        lines += [f"  {flag}: {note}" for flag, note in zip(self.flags, self.notes, strict=True)]
        return "\n".join([*lines, RESEARCH_USE_ONLY])


@dataclass(frozen=True, slots=True, kw_only=True)
class Repeats:
    """Readings of the same quantity from repeated presses of one target.

    Parameters
    ----------
    label
        Name of the target.
    readings
        At least one, all of one quantity against one kind of reference.

    Raises
    ------
    InputError
        When there is no reading, or readings are of different kinds.

    Examples
    --------
    >>> readings = [RelativeReading(quantity="relative size", value=value, unit="mm", against="plain tissue",
    ...                             assumptions=()) for value in (6.0, 7.0, 8.0)]
    >>> repeats = Repeats(label="8 mm", readings=readings)
    >>> repeats.mean, repeats.sd, repeats.observed
    (7.0, 1.0, 3)
    """

    label: str
    readings: tuple[RelativeReading, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "readings", tuple(self.readings))
        if not self.readings:
            raise InputError(f"readings of {self.label!r} must hold at least one RelativeReading; got none")
        for reading in self.readings:
            if not isinstance(reading, RelativeReading):
                raise InputError(f"readings of {self.label!r} must be RelativeReading values; got {reading!r:.80}")
            if _kind(reading) != _kind(self.readings[0]):
                raise InputError(
                    f"readings of {self.label!r} must all be of {_named(self.readings[0])}; "
                    f"got {_named(reading)} among them"
                )

    @property
    def values(self) -> Floats:
        """The values, shape (readings with a value,)."""
        return np.array([reading.value for reading in self.readings if reading.value is not None])

    @property
    def observed(self) -> int:
        """Number of readings with a value."""
        return sum("no_contact" not in reading.flags for reading in self.readings)

    @property
    def mean(self) -> float:
        """Mean value; NaN without values."""
        return float(self.values.mean()) if self.values.size else float("nan")

    @property
    def sd(self) -> float:
        """Standard deviation from press to press; NaN below two values."""
        return float(self.values.std(ddof=1)) if self.values.size > 1 else float("nan")


def ratios(targets: Sequence[Repeats]) -> tuple[float, ...]:
    """Mean of each target over that of the first; NaN without values, or where the first is zero.

    Raises
    ------
    InputError
        When the targets' readings are not of one kind.

    Examples
    --------
    >>> def repeats(value):
    ...     return Repeats(label="", readings=[RelativeReading(quantity="relative size", value=value, unit="mm",
    ...                                                        against="plain tissue", assumptions=())])
    >>> ratios([repeats(2.0), repeats(8.0)])
    (1.0, 4.0)
    """
    kinds = {_named(target.readings[0]) for target in targets}
    if len(kinds) != 1:
        raise InputError(f"targets must hold readings of one kind; got {' and '.join(sorted(kinds)) or 'none'}")
    first = targets[0].mean
    return tuple(target.mean / first if first else float("nan") for target in targets)


def _kind(reading: RelativeReading) -> tuple[str, str, str]:
    return reading.quantity, reading.unit, reading.against


def _named(reading: RelativeReading) -> str:
    return f"{reading.quantity} against {reading.against}"


def relative_depth(
    image: TactileImage,
    reference: TactileImage | Sequence[TactileImage],
    *,
    against: str,
    calibration: Calibration | None = None,
    threshold_grey: float | None = None,
) -> RelativeReading:
    """Grey level at the centroid of the light, ``I(Xc, Yc)`` (6.9): it FALLS with depth and is not a length.

    The source multiplies it by the size of a pixel and calls the product millimetres; its "0.59 mm" is 87 grey levels.

    Parameters
    ----------
    image, reference, against, calibration, threshold_grey
        As for `relative_size`; the threshold bounds the part of the centroid.

    Returns
    -------
    RelativeReading
        In grey levels; None with the flag ``no_contact`` when nothing is lit, or with ``saturated`` when the camera
        clipped at the centroid.

    Raises
    ------
    InputError, ImageMismatchError
        As `relative_size`.

    Examples
    --------
    >>> from tsis.model.image import TactileImage
    >>> y, x = np.mgrid[:120, :160]
    >>> hill = 60.0 * np.exp(-((x - 80) ** 2 + (y - 60) ** 2) / 800.0)
    >>> dark = TactileImage(grey=np.zeros((120, 160)), mm_per_pixel=(0.1, 0.1))
    >>> reading = relative_depth(TactileImage(grey=hill, mm_per_pixel=(0.1, 0.1)), dark, against="untouched probe")
    >>> round(reading.value), reading.unit
    (60, 'grey levels')
    """
    change = change_of_light(image, reference, against=against, calibration=calibration)
    lit = lit_part(change, threshold_grey)
    level, parts = None, {}
    if lit.centroid_px is not None:
        x, y = lit.centroid_px
        if not change.clipped[round(y), round(x)]:
            level = float(scipy.ndimage.map_coordinates(change.image.grey, np.array([[y], [x]]), order=1)[0])
        parts = {"centroid_x_px": x, "centroid_y_px": y}
    return RelativeReading(
        quantity="relative depth",
        value=level,
        unit="grey levels",
        against=against,
        assumptions=comparison_assumptions(
            against,
            calibration,
            "The compared inclusions are equally large and equally stiff: a grey level that falls with depth is no "
            "depth.",
        ),
        parts=parts,
        flags=lit.flags,
    )


def relative_size(
    image: TactileImage,
    reference: TactileImage | Sequence[TactileImage],
    *,
    against: str,
    calibration: Calibration | None = None,
    threshold_grey: float | None = None,
) -> RelativeReading:
    """Diameter in mm of the disc with the area of the lit part, ``2 sqrt(A / pi)`` (6.2).

    It is the width of the light above the threshold, not of the inclusion: it grows with the force and falls with the
    depth. Pixels are counted after a blur of one pixel, in the largest connected part.

    Parameters
    ----------
    image
        Raw frame of the pressed probe, with ``mm_per_pixel``.
    reference
        One or more frames, whose mean is subtracted.
    against
        Content of the reference: ``"untouched probe"`` as in the source, where all light of the press counts, or
        ``"plain tissue"``, a reference press of equal force, where only the inclusion's light counts.
    calibration
        Its light map corrects non-uniform light; grey levels are then those of the brightest light.
    threshold_grey
        Level k above which a pixel counts as lit, above 0; the source's 5 of 255 levels when None.

    Returns
    -------
    RelativeReading
        In mm; 0 with the flag ``no_contact`` when nothing is lit.

    Raises
    ------
    InputError
        When a scale is unknown, the frame is mostly clipped or has no unlit pixel, or a reference's force contradicts
        ``against``.
    ImageMismatchError
        When the reference's size, scale, full scale or axis differ from the image's.

    Examples
    --------
    >>> import numpy as np
    >>> from tsis.model.image import TactileImage
    >>> y, x = np.mgrid[:120, :160]
    >>> disc = np.where((x - 80) ** 2 + (y - 60) ** 2 < 900, 60.0, 10.0)
    >>> dark = TactileImage(grey=np.full((120, 160), 10.0), mm_per_pixel=(0.1, 0.1))
    >>> pressed = TactileImage(grey=disc, mm_per_pixel=(0.1, 0.1))
    >>> reading = relative_size(pressed, dark, against="untouched probe", threshold_grey=25.0)
    >>> round(reading.value, 1), reading.unit
    (6.0, 'mm')
    """
    lit = lit_part(change_of_light(image, reference, against=against, calibration=calibration), threshold_grey)
    return RelativeReading(
        quantity="relative size",
        value=lit.diameter_mm,
        unit="mm",
        against=against,
        assumptions=comparison_assumptions(
            against,
            calibration,
            "The compared inclusions are equally deep and equally stiff: the lit part is no outline of the inclusion.",
        ),
        parts={"area_mm2": lit.area_mm2},
        flags=lit.flags,
    )


def relative_hardness(
    first: TactileImage,
    second: TactileImage,
    *,
    reference: Frames,
    second_reference: Frames | None = None,
    against: str,
    calibration: Calibration,
    threshold_grey: float | None = None,
) -> RelativeReading:
    """Force per lit area over ``T = |d1 - d2| / d1`` (6.10), from two presses of one target, the second one harder.

    d1 and d2 are the `relative_size` of each press. Force, the sum of grey levels over the calibration's gain as in the
    source, and area are those of the second press. T is not a strain: the lit part widens because more of the same bump
    exceeds the threshold, for any stiffness.

    Parameters
    ----------
    first, second
        Raw presses of one target, the second harder.
    reference
        Reference of both; see `relative_size`.
    second_reference
        Reference of the second; ``reference`` when None. Reference presses must have the force of their press.
    against
        Content of the references: ``"untouched probe"`` or ``"plain tissue"``.
    calibration
        Its gain converts grey levels to pressure; its light map, if any, corrects the light.
    threshold_grey
        As for `relative_size`.

    Returns
    -------
    RelativeReading
        In kPa; None when nothing is lit or the lit part does not grow.

    Raises
    ------
    InputError
        As `relative_size`, and when both presses are the same frame or their known forces do not rise.
    NotCalibratedError
        When the calibration is missing.
    ImageMismatchError
        As `relative_size`, and when the presses differ in size, scale or full scale.

    Examples
    --------
    >>> from tsis.model.image import TactileImage
    >>> y, x = np.mgrid[:120, :160]
    >>> hill = np.exp(-((x - 80) ** 2 + (y - 60) ** 2) / 800.0)
    >>> dark, weak, strong = (TactileImage(grey=level * hill, mm_per_pixel=(0.1, 0.1)) for level in (0, 40, 80))
    >>> gain = Calibration(gain_grey_per_kpa=60.0, saturation_kpa=20.0)
    >>> found = relative_hardness(weak, strong, reference=dark, against="untouched probe", calibration=gain)
    >>> round(found.value, 1), round(found.parts["growth"], 3)
    (2.9, 0.155)
    """
    if not isinstance(calibration, Calibration):
        raise NotCalibratedError(
            f"calibration must be a Calibration, whose gain converts grey levels to pressure; got {calibration!r:.80}"
        )
    _check_rising(first, second)
    second_reference = reference if second_reference is None else second_reference
    weak = lit_part(change_of_light(first, reference, against=against, calibration=calibration), threshold_grey)
    harder = change_of_light(second, second_reference, against=against, calibration=calibration)
    strong = lit_part(harder, threshold_grey)
    flags = tuple(dict.fromkeys(weak.flags + strong.flags))
    value, parts = None, {"first_size_mm": weak.diameter_mm, "second_size_mm": strong.diameter_mm}
    if "no_contact" not in flags:
        growth = (strong.diameter_mm - weak.diameter_mm) / weak.diameter_mm
        pixel_mm2 = float(np.prod(second.scale()))
        gain = calibration.gain_grey_per_kpa * brightest(calibration)
        stress = strong.total_grey * pixel_mm2 / gain / strong.area_mm2
        parts |= {"growth": growth, "stress_kpa": stress}
        value = stress / growth if growth > 0 else None
        flags += () if growth > 0 else ("no_growth",)
    return RelativeReading(
        quantity="relative hardness",
        value=value,
        unit="kPa",
        against=against,
        assumptions=comparison_assumptions(
            against,
            calibration,
            "The compared inclusions are equally large and equally deep, and were pressed with the same two forces.",
            "Grey level is in proportion to pressure.",
            "The growth of the lit part replaces a strain, which it is not.",
        ),
        parts=parts,
        flags=flags,
    )


def _check_rising(first: TactileImage, second: TactileImage) -> None:
    """Refuse presses that are the same frame, of different cameras, or in the wrong order."""
    require_same_frame(first, second, "second")
    if np.array_equal(first.grey, second.grey):
        raise InputError("first and second must be two presses; got the same frame twice")
    if first.force_n is not None and second.force_n is not None and second.force_n <= first.force_n:
        raise InputError(
            f"second must be pressed harder than first, {first.force_n:g} N; got {second.force_n:g} N (swap them)"
        )
