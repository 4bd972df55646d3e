"""Every threshold of the press guard, and the flags that they raise."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tsis.calibration.guard.reading import MOST
from tsis.errors import InputError
from tsis.model.require import require_number

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tsis.calibration.guard.reading import GuardReading
    from tsis.calibration.settling import Settling


@dataclass(frozen=True, slots=True, kw_only=True)
class GuardLimits:
    """Limits of a usable press.

    Raises `InputError` when a limit lies outside its range or the window of the force is empty.

    Parameters
    ----------
    least_force_n, most_force_n
        Window of the force, N, in (0, 100]. By default the range of the force calibration: its first step of 0.1 N,
        and its end of 2 N.
    tilt
        Relative rise of the brightness from the contact's centre to its edge in one direction, in [0.005, 1]. A flat
        face tilted by an angle presses that much more at one edge: 0.1 is the angle ``0.1 approach / radius``,
        2 degrees at 1 N on 5 kPa with ``tsis-2011``.
    off_centre
        Distance of the contact from the probe's axis over the contact's radius, in [0.005, 1]. Estimates assume that
        the contact lies on the axis; at 0.1 the pattern of the light is off by a tenth of the radius.
    saturated
        Fraction of the contact's pixels at full scale, in [0, 1). Every sum lacks the light that clips; 0.001 passes
        a sensor's stuck pixels only.
    ambient
        Light from outside over the contact's mean light, in [1e-3, 1]: the relative error of the sum of grey levels.
        Three times a calibration's default standard deviation of an unknown constant (0.01).
    flicker
        Amplitude of the light from outside at the mains' frequencies, over the contact's mean light, in [1e-3, 1].
    led_drift
        Relative change of the lamps since the reference, in [1e-4, 1]. Twice a calibration's default standard
        deviation of the gain (0.01).
    cropped
        Level at which the contact's patch meets the frame's border over the contact's peak, in [0.01, 1]. At one half
        the patch at half of the peak, from which sizes are read, leaves the frame.
    frozen
        Number of identical frames in a row, in [1, 1000]. A sensor's noise never repeats; 2 passes a frame that was
        delivered twice.
    contact
        Least peak of a contact above the untouched level, a fraction of full scale, in [1e-4, 1]: 0.01 is two and a
        half levels of 8 bits, more than black levels drift; the frame's own noise may require more.
    dark
        Least peak of a contact that is bright enough to read, a fraction of full scale, in [1e-3, 1]. At 0.05 the
        rounding and read noise of one pixel of an 8-bit camera is one part in twenty of the peak.
    moving
        Relative change of the light still to come, in [1e-4, 0.5]: that of the settling time of a press.
    release
        Part of a limit below which a live view clears a raised flag, in [0.5, 1].
    """

    least_force_n: float = 0.1
    most_force_n: float = 2.0
    tilt: float = 0.1
    off_centre: float = 0.1
    saturated: float = 0.001
    ambient: float = 0.03
    flicker: float = 0.03
    led_drift: float = 0.02
    cropped: float = 0.5
    frozen: float = 2.0
    contact: float = 0.01
    dark: float = 0.05
    moving: float = 0.01
    release: float = 0.8

    def __post_init__(self) -> None:
        for name, (low, high) in RANGES.items():
            require_number(name, getattr(self, name), low, high)
        if self.least_force_n >= self.most_force_n:
            raise InputError(
                f"least_force_n must lie below most_force_n; got {self.least_force_n:g} N and {self.most_force_n:g} N"
            )


RANGES = {
    "least_force_n": (1e-4, 100.0),
    "most_force_n": (1e-4, 100.0),
    "tilt": (5e-3, 1.0),
    "off_centre": (5e-3, 1.0),
    "saturated": (0.0, 0.999),
    "ambient": (1e-3, 1.0),
    "flicker": (1e-3, 1.0),
    "led_drift": (1e-4, 1.0),
    "cropped": (0.01, 1.0),
    "frozen": (1.0, 1000.0),
    "contact": (1e-4, 1.0),
    "dark": (1e-3, 1.0),
    "moving": (1e-4, 0.5),
    "release": (0.5, 1.0),
}


WORST = 1e6  # largest reported excess


@dataclass(frozen=True, slots=True, kw_only=True)
class GuardFlag:
    """A reason not to use a press as it is.

    Attributes
    ----------
    name
        A stable name, one of `GUARD_FLAGS`.
    value, limit
        The value and the limit that it passed, in the unit of `GUARD_FLAGS`.
    advice
        What to do, in one line.
    """

    name: str
    value: float
    limit: float
    advice: str


@dataclass(frozen=True, slots=True, kw_only=True)
class FlagMeaning:
    """What a flag means."""

    means: str
    limit: str  # the field of `GuardLimits` that it is compared with
    unit: str  # of value and limit
    needs: str = ""  # inputs besides the frame


SCALE_FRACTION, CONTACT_FRACTION = "fraction of full scale", "fraction of the contact's light"
FORCE, UNTOUCHED, SERIES = "the gauge's force", "an untouched frame", "a series of frames"
GUARD_FLAGS = {
    name: FlagMeaning(means=means, limit=limit, unit=unit, needs=needs)
    for name, limit, unit, needs, means in (
        ("frozen", "frozen", "identical frames in a row", SERIES, "the camera delivers one picture again and again"),
        ("no-contact", "contact", SCALE_FRACTION, "", "nothing stands out of the frame"),
        ("force-too-small", "least_force_n", "N", FORCE, "pressed too lightly"),
        ("force-too-large", "most_force_n", "N", FORCE, "pressed too hard"),
        ("saturated", "saturated", "fraction of the contact's pixels", "", "the camera clips inside the contact"),
        ("dark-frame", "dark", SCALE_FRACTION, "", "the contact is too dim to read"),
        ("cropped", "cropped", "fraction of the peak", "", "the contact runs out of the frame"),
        (
            "off-centre",
            "off_centre",
            "fraction of the contact's radius",
            "",
            "the contact lies beside the probe's axis",
        ),
        (
            "tilted",
            "tilt",
            "fraction of the brightness, centre to edge",
            "",
            "one side is brighter than in a level press",
        ),
        ("ambient-light", "ambient", CONTACT_FRACTION, UNTOUCHED, "light from outside reaches the camera"),
        ("flicker", "flicker", CONTACT_FRACTION, f"{SERIES} with times", "light from outside swings with the mains"),
        (
            "led-drift",
            "led_drift",
            "fraction of the lamps' light",
            f"{UNTOUCHED} with a reference patch",
            "the lamps are not as bright as in the reference",
        ),
        (
            "moving",
            "moving",
            "fraction of the light still to come",
            f"{SERIES} with times",
            "the press has not settled, or this is not known yet",
        ),
    )
}


@dataclass(frozen=True, slots=True, kw_only=True)
class LimitExcess:
    """A value compared with its limit."""

    flag: GuardFlag
    excess: float  # the value over the limit as a factor; above 1 the flag is raised


def limit_excesses(
    reading: GuardReading,
    limits: GuardLimits,
    *,
    settling: Settling | None = None,
    flicker_grey: float | None = None,
    in_a_row: int = 0,
) -> Iterator[LimitExcess]:
    """Compare every available value with its limit, in the order in which faults are best corrected.

    ``flicker_grey`` is the amplitude at the mains' frequencies, and ``in_a_row`` the number of identical frames up to
    this one; 0 when unknown.
    """
    if in_a_row:
        advice = f"stop and start the camera: {in_a_row} frames in a row are one and the same picture"
        yield _above("frozen", in_a_row, limits.frozen, advice)
    least = max(limits.contact, reading.noise)
    contrast = max(reading.contrast, 0.0)
    touched = contrast >= limits.release * least
    blind = not touched and reading.saturated is not None and reading.saturated > MOST
    if not blind:
        yield _below("no-contact", contrast, least, "press the probe on the tissue, or check lamps and exposure")
    if reading.force_n is not None:
        force, low, high = reading.force_n, limits.least_force_n, limits.most_force_n
        yield _below("force-too-small", force, low, f"press more: {force:.2g} N is below {low:g} N")
        yield _above("force-too-large", force, high, f"press less: {force:.2g} N is above {high:g} N")
    if touched:
        yield from _contact_findings(reading, limits)
    elif blind:
        yield _clipping(reading.saturated or 0.0, limits)
    # Stray light is compared with the contact's light, at least that of the dimmest readable contact.
    light = max(reading.light, limits.dark * reading.full_scale) if touched else limits.dark * reading.full_scale
    if reading.ambient_grey is not None:
        fraction = reading.ambient_grey / light
        yield _above(
            "ambient-light", fraction, limits.ambient, f"keep light out: {fraction:.1%} of the light is not the lamps'"
        )
    if flicker_grey is not None:
        fraction = flicker_grey / light
        yield _above(
            "flicker",
            fraction,
            limits.flicker,
            f"switch lamps in the room off: light swings by {fraction:.1%} with the mains",
        )
    if reading.led_drift is not None:
        drift = reading.led_drift
        advice = f"let the lamps warm up or take a new reference: their light changed by {drift:+.1%}"
        yield _above("led-drift", abs(drift), limits.led_drift, advice)
    if touched and settling is not None:
        yield _above("moving", settling.bound, limits.moving, _hold(settling))


def _contact_findings(reading: GuardReading, limits: GuardLimits) -> Iterator[LimitExcess]:
    if reading.saturated is not None:
        yield _clipping(reading.saturated, limits)
    advice = f"press more or expose longer: the contact's peak is {reading.contrast:.1%} of full scale"
    yield _below("dark-frame", reading.contrast, limits.dark, advice)
    if reading.cropped is not None:
        advice = f"press less or centre the contact: it runs out of the frame at {reading.cropped:.0%} of its peak"
        yield _above("cropped", reading.cropped, limits.cropped, advice)
    if reading.off_centre is not None:
        advice = f"centre the probe: the contact lies {reading.off_centre:.0%} of its radius beside the axis"
        yield _above("off-centre", reading.off_centre, limits.off_centre, advice)
    if reading.tilt is not None:
        size = math.hypot(*reading.tilt)
        advice = (
            f"lower the {_side(*reading.tilt)} of the probe: the other is brighter by {size:.0%} from centre to edge"
        )
        yield _above("tilted", size, limits.tilt, advice)


def _clipping(fraction: float, limits: GuardLimits) -> LimitExcess:
    advice = f"press less or expose shorter: {fraction:.2%} of the contact clips"
    return _above("saturated", fraction, limits.saturated, advice)


def _side(x: float, y: float) -> str:
    """The darker side of the picture, where the probe presses less."""
    if abs(x) >= abs(y):
        return "left side" if x > 0 else "right side"
    return "upper side" if y > 0 else "lower side"


def _hold(settling: Settling) -> str:
    if settling.wait_s is None:
        return "hold still: whether the press has settled is not known yet"
    fraction, wait_s = abs(settling.remaining.value), settling.wait_s
    duration = f"{math.ceil(wait_s)} s" if wait_s <= 120 else f"{math.ceil(wait_s / 60)} min"
    return f"hold still for {duration}: {fraction:.1%} of the light is still to come or go"


def _above(name: str, value: float, limit: float, advice: str) -> LimitExcess:
    excess = min(value / limit, WORST) if limit > 0 else (WORST if value > 0 else 0.0)
    return LimitExcess(flag=GuardFlag(name=name, value=value, limit=limit, advice=advice), excess=excess)


def _below(name: str, value: float, limit: float, advice: str) -> LimitExcess:
    excess = min(limit / value, WORST) if value > 0 else WORST
    return LimitExcess(flag=GuardFlag(name=name, value=value, limit=limit, advice=advice), excess=excess)
