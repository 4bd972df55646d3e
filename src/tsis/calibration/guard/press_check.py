"""Is this press usable? Named flags on one frame; `tsis.calibration.guard.watch` does so live."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tsis.calibration.guard.blocks import FrameShape
from tsis.calibration.guard.flags import findings
from tsis.calibration.guard.limits import GuardLimits
from tsis.calibration.guard.reading import prepared, read_guard_frame
from tsis.calibration.guard.reference import GuardReference
from tsis.imaging.correct import require_image
from tsis.model import TactileImage
from tsis.model.check import require_number, require_type

if TYPE_CHECKING:
    from tsis.calibration.guard.flags import GuardFlag
    from tsis.calibration.settling.verdict import Settling


def check_press(
    image: TactileImage,
    *,
    reference: GuardReference | TactileImage | None = None,
    force_n: float | None = None,
    settling: Settling | None = None,
    limits: GuardLimits | None = None,
) -> tuple[GuardFlag, ...]:
    """Say what speaks against using a press as it is.

    Parameters
    ----------
    image
        The frame as the camera delivered it.
    reference
        What it is compared with; a frame alone is that of the untouched probe. What a flag needs and nobody gave is
        not checked: see `tsis.calibration.guard.flags.FLAGS`.
    force_n
        Force of the gauge, N, in [0, 1000]; that of the image when None.
    settling
        Of the series that the frame ends, by `tsis.calibration.settling.judge_settling`; None leaves ``moving``
        unchecked.
    limits
        The thresholds; those of `GuardLimits` when None.

    Returns
    -------
    tuple of GuardFlag
        Those raised, in the order in which they are best cured; empty for a press that nothing speaks against.

    Raises
    ------
    InputError
        When an argument is of the wrong kind or out of range.
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
    reading = read_guard_frame(image.grey, prepared(reference, FrameShape.of(image)), force_n=force)
    return tuple(one.flag for one in findings(reading, limits, settling=settling) if one.excess > 1.0)
