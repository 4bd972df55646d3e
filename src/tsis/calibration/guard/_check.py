"""Guard flags of one frame; `tsis.calibration.guard.PressWatch` checks a live stream."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tsis.calibration.guard._flags import GuardLimits, limit_excesses
from tsis.calibration.guard._reading import prepare_reference, read_guard_frame
from tsis.calibration.guard._reference import FrameShape, GuardReference
from tsis.calibration.guard._watch import PressWatch
from tsis.catalog.probes import list_probes, load_probe
from tsis.imaging import require_image
from tsis.model.image import TactileImage
from tsis.model.require import require_number, require_type

if TYPE_CHECKING:
    from tsis.calibration._apply import UsableCalibration
    from tsis.calibration.guard._flags import GuardFlag
    from tsis.calibration.settling import Settling
    from tsis.instrument import Frame


def check_press(
    image: TactileImage,
    *,
    reference: GuardReference | TactileImage | None = None,
    force_n: float | None = None,
    settling: Settling | None = None,
    limits: GuardLimits | None = None,
) -> tuple[GuardFlag, ...]:
    """Flags of a press that should not be used as it is.

    Parameters
    ----------
    image
        The raw camera frame.
    reference
        What the frame is compared with; a frame alone is that of the untouched probe. A flag whose input is missing
        is not checked: see `tsis.calibration.guard.GUARD_FLAGS`.
    force_n
        Force of the gauge, N, in [0, 1000]; that of the image when None.
    settling
        Settling of the series that ends in this frame, by `tsis.calibration.settling.assess_settling`; None leaves
        ``moving`` unchecked.
    limits
        The thresholds; those of `GuardLimits` when None.

    Returns
    -------
    tuple of GuardFlag
        Raised flags, in the order in which they are best corrected; empty for a usable press.

    Raises
    ------
    InputError
        When an argument has the wrong type or is out of range.
    ImageMismatchError
        When the reference is of another size, scale or full scale.

    Examples
    --------
    >>> import numpy as np
    >>> y, x = np.mgrid[-60:60, -80:80]
    >>> press = TactileImage(grey=8.0 + 120.0 * np.exp(-(x**2 + y**2) / 600.0), force_n=2.3)
    >>> untouched = TactileImage(grey=np.full((120, 160), 8.0))
    >>> for flag in check_press(press, reference=untouched):
    ...     print(f"{flag.name}: {flag.advice}")
    force-too-large: press less: 2.3 N is above 2 N
    """
    require_image("image", image)
    if isinstance(reference, TactileImage) or reference is None:
        reference = GuardReference(untouched=reference)
    require_type("reference", reference, GuardReference)
    limits = GuardLimits() if limits is None else limits
    require_type("limits", limits, GuardLimits)
    force = image.force_n if force_n is None else require_number("force_n", force_n, 0.0, 1000.0, hint="newtons")
    reading = read_guard_frame(image.grey, prepare_reference(reference, FrameShape.of(image)), force_n=force)
    return tuple(finding.flag for finding in limit_excesses(reading, limits, settling=settling) if finding.excess > 1.0)


def guard_reference(calibration: UsableCalibration | None) -> GuardReference:
    """The untouched probe of a calibration; an empty reference without one."""
    if calibration is None or calibration.calibration.reference is None:
        return GuardReference()
    reference, probe = calibration.calibration.reference, calibration.calibration.probe
    return GuardReference(
        untouched=TactileImage(
            grey=reference.dark_grey + reference.untouched_grey,
            mm_per_pixel=_scale(calibration),
            full_scale=reference.full_scale,
        ),
        patch=reference.patch,
        face_radius_mm=load_probe(probe).radius_mm if probe in list_probes() else None,
        dark_grey=float(reference.dark_grey.mean()),
    )


def press_watch(frame: Frame, calibration: UsableCalibration | None) -> PressWatch:
    """A guard for the stream of this frame."""
    shape = FrameShape.of(frame.tactile_image(mm_per_pixel=_scale(calibration)))
    return PressWatch(shape, reference=guard_reference(calibration))


def with_calibrated_scale(image: TactileImage, calibration: UsableCalibration | None) -> TactileImage:
    """A frame with the calibration's scale, if any; `ImageMismatchError` when its size differs."""
    scale = None if calibration is None else calibration.calibration.scale
    return image if scale is None else scale.on(image)


def _scale(calibration: UsableCalibration | None) -> tuple[float, float] | None:
    scale = None if calibration is None else calibration.calibration.scale
    return None if scale is None else scale.mm_per_pixel
