"""The flags of the press guard: each is declared once, with its meaning, cure, and limit with range and origin."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tsis.calibration.guard.reading import MOST
from tsis.errors import InputError
from tsis.model.flag import Flag, declared
from tsis.model.require import require_number

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tsis.calibration.guard.reading import GuardReading
    from tsis.calibration.settling import Settling


@dataclass(frozen=True, slots=True, kw_only=True)
class PressFlag(Flag):
    """A doubt about a press, and the limit beyond which it is raised.

    Attributes
    ----------
    limit
        Field of `GuardLimits`.
    default, within
        The limit, and its range; ``raised`` says where it comes from.
    unit
        Unit of value and limit.
    needs
        Inputs besides the frame.
    """

    limit: str
    default: float
    within: tuple[float, float]
    unit: str
    needs: str = ""


SCALE_FRACTION, CONTACT_FRACTION = "fraction of full scale", "fraction of the contact's light"
FORCE, UNTOUCHED, SERIES = "the gauge's force", "an untouched frame", "a series of frames"
GUARD_FLAGS = declared(
    PressFlag(
        name="frozen",
        means="the camera delivers one picture again and again",
        cure="stop and start the camera",
        says="{value} frames in a row are one and the same picture",
        limit="frozen",
        default=2.0,
        within=(1.0, 1000.0),
        raised="a sensor's noise never repeats; 2 passes a frame that was delivered twice",
        unit="identical frames in a row",
        needs=SERIES,
    ),
    PressFlag(
        name="no-contact",
        means="nothing stands out of the frame",
        cure="press the probe on the tissue, or check lamps and exposure",
        says="",
        limit="contact",
        default=0.01,
        within=(1e-4, 1.0),
        raised="two and a half levels of 8 bits, more than black levels drift; the frame's own noise may require more",
        unit=SCALE_FRACTION,
    ),
    PressFlag(
        name="force-too-small",
        means="pressed too lightly",
        cure="press more",
        says="{value:.2g} N is below {limit:g} N",
        limit="least_force_n",
        default=0.1,
        within=(1e-4, 100.0),
        raised="the first step of the force calibration",
        unit="N",
        needs=FORCE,
    ),
    PressFlag(
        name="force-too-large",
        means="pressed too hard",
        cure="press less",
        says="{value:.2g} N is above {limit:g} N",
        limit="most_force_n",
        default=2.0,
        within=(1e-4, 100.0),
        raised="the end of the force calibration",
        unit="N",
        needs=FORCE,
    ),
    PressFlag(
        name="saturated",
        means="the camera clips inside the contact",
        cure="press less or expose shorter",
        says="{value:.2%} of the contact clips",
        limit="saturated",
        default=0.001,
        within=(0.0, 0.999),
        raised="every sum lacks the light that clips; 0.001 passes a sensor's stuck pixels only",
        unit="fraction of the contact's pixels",
    ),
    PressFlag(
        name="dark-frame",
        means="the contact is too dim to read",
        cure="press more or expose longer",
        says="the contact's peak is {value:.1%} of full scale",
        limit="dark",
        default=0.05,
        within=(1e-3, 1.0),
        raised="there rounding and read noise of one pixel of an 8-bit camera are one part in twenty of the peak",
        unit=SCALE_FRACTION,
    ),
    PressFlag(
        name="cropped",
        means="the contact runs out of the frame",
        cure="press less or centre the contact",
        says="it runs out of the frame at {value:.0%} of its peak",
        limit="cropped",
        default=0.5,
        within=(0.01, 1.0),
        raised="there the patch at half of the peak, from which sizes are read, leaves the frame",
        unit="fraction of the peak",
    ),
    PressFlag(
        name="off-centre",
        means="the contact lies beside the probe's axis",
        cure="centre the probe",
        says="the contact lies {value:.0%} of its radius beside the axis",
        limit="off_centre",
        default=0.1,
        within=(5e-3, 1.0),
        raised="estimates assume a contact on the axis; at 0.1 the light's pattern is off by a tenth of the radius",
        unit="fraction of the contact's radius",
    ),
    PressFlag(
        name="tilted",
        means="one side is brighter than in a level press",
        cure="lower the {side} of the probe",
        says="the other is brighter by {value:.0%} from centre to edge",
        limit="tilt",
        default=0.1,
        within=(5e-3, 1.0),
        raised="a flat face tilted by an angle presses that much more at one edge: 0.1 is the angle "
        "0.1 approach / radius, 2 degrees at 1 N on 5 kPa with tsis-2011",
        unit="fraction of the brightness, centre to edge",
    ),
    PressFlag(
        name="ambient-light",
        means="light from outside reaches the camera",
        cure="keep light out",
        says="{value:.1%} of the light is not the lamps'",
        limit="ambient",
        default=0.03,
        within=(1e-3, 1.0),
        raised="the relative error of the sum of grey levels: three times a calibration's default standard deviation "
        "of an unknown constant (0.01)",
        unit=CONTACT_FRACTION,
        needs=UNTOUCHED,
    ),
    PressFlag(
        name="flicker",
        means="light from outside swings with the mains",
        cure="switch lamps in the room off",
        says="light swings by {value:.1%} with the mains",
        limit="flicker",
        default=0.03,
        within=(1e-3, 1.0),
        raised="amplitude at the mains' frequencies, as much as steady light from outside",
        unit=CONTACT_FRACTION,
        needs=f"{SERIES} with times",
    ),
    PressFlag(
        name="led-drift",
        means="the lamps are not as bright as in the reference",
        cure="let the lamps warm up or take a new reference",
        says="their light changed by {drift:+.1%}",
        limit="led_drift",
        default=0.02,
        within=(1e-4, 1.0),
        raised="twice a calibration's default standard deviation of the gain (0.01)",
        unit="fraction of the lamps' light",
        needs=f"{UNTOUCHED} with a reference patch",
    ),
    PressFlag(
        name="moving",
        means="the press has not settled, or this is not known yet",
        cure="hold still{duration}",
        says="{reason}",
        limit="moving",
        default=0.01,
        within=(1e-4, 0.5),
        raised="that of the settling time of a press",
        unit="fraction of the light still to come",
        needs=f"{SERIES} with times",
    ),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class GuardLimits:
    """Limits of a usable press, one a flag; `GUARD_FLAGS` says what each is, its range, and where it comes from.

    ``release``, in [0.5, 1], is the part of a limit below which a live view clears a raised flag. Raises `InputError`
    when a limit lies outside its range or the window of the force is empty.
    """

    least_force_n: float = GUARD_FLAGS["force-too-small"].default
    most_force_n: float = GUARD_FLAGS["force-too-large"].default
    tilt: float = GUARD_FLAGS["tilted"].default
    off_centre: float = GUARD_FLAGS["off-centre"].default
    saturated: float = GUARD_FLAGS["saturated"].default
    ambient: float = GUARD_FLAGS["ambient-light"].default
    flicker: float = GUARD_FLAGS["flicker"].default
    led_drift: float = GUARD_FLAGS["led-drift"].default
    cropped: float = GUARD_FLAGS["cropped"].default
    frozen: float = GUARD_FLAGS["frozen"].default
    contact: float = GUARD_FLAGS["no-contact"].default
    dark: float = GUARD_FLAGS["dark-frame"].default
    moving: float = GUARD_FLAGS["moving"].default
    release: float = 0.8

    def __post_init__(self) -> None:
        for flag in GUARD_FLAGS.values():
            require_number(flag.limit, getattr(self, flag.limit), *flag.within)
        require_number("release", self.release, 0.5, 1.0)
        if self.least_force_n >= self.most_force_n:
            raise InputError(
                f"least_force_n must lie below most_force_n; got {self.least_force_n:g} N and {self.most_force_n:g} N"
            )


WORST = 1e6  # largest excess


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


def limit_excesses(
    reading: GuardReading,
    limits: GuardLimits,
    *,
    settling: Settling | None = None,
    flicker_grey: float | None = None,
    in_a_row: int = 0,
) -> Iterator[tuple[GuardFlag, float]]:
    """Compare every available value with its limit, in the order in which faults are best corrected.

    Yields each flag with its excess, the value over the limit as a factor: above 1 the flag is raised.
    ``flicker_grey`` is the amplitude at the mains' frequencies, and ``in_a_row`` the number of identical frames up to
    this one; 0 when unknown.
    """
    if in_a_row:
        yield _above("frozen", in_a_row, limits.frozen)
    least = max(limits.contact, reading.noise)
    contrast = max(reading.contrast, 0.0)
    touched = contrast >= limits.release * least
    blind = not touched and reading.saturated is not None and reading.saturated > MOST
    if not blind:
        yield _below("no-contact", contrast, least)
    if reading.force_n is not None:
        yield _below("force-too-small", reading.force_n, limits.least_force_n)
        yield _above("force-too-large", reading.force_n, limits.most_force_n)
    if (touched or blind) and reading.saturated is not None:
        yield _above("saturated", reading.saturated, limits.saturated)
    if touched:
        yield from _contact_excesses(reading, limits)
    # Stray light is compared with the contact's light, at least that of the dimmest readable contact.
    light = max(reading.light, limits.dark * reading.full_scale) if touched else limits.dark * reading.full_scale
    if reading.ambient_grey is not None:
        yield _above("ambient-light", reading.ambient_grey / light, limits.ambient)
    if flicker_grey is not None:
        yield _above("flicker", flicker_grey / light, limits.flicker)
    if reading.led_drift is not None:
        yield _above("led-drift", abs(reading.led_drift), limits.led_drift, drift=reading.led_drift)
    if touched and settling is not None:
        yield _above("moving", settling.bound, limits.moving, **_hold(settling))


def _contact_excesses(reading: GuardReading, limits: GuardLimits) -> Iterator[tuple[GuardFlag, float]]:
    yield _below("dark-frame", reading.contrast, limits.dark)
    if reading.cropped is not None:
        yield _above("cropped", reading.cropped, limits.cropped)
    if reading.off_centre is not None:
        yield _above("off-centre", reading.off_centre, limits.off_centre)
    if reading.tilt is not None:
        yield _above("tilted", math.hypot(*reading.tilt), limits.tilt, side=_darker_side(*reading.tilt))


def _darker_side(x: float, y: float) -> str:
    """The side of the picture where the probe presses less."""
    if abs(x) >= abs(y):
        return "left side" if x > 0 else "right side"
    return "upper side" if y > 0 else "lower side"


def _hold(settling: Settling) -> dict[str, str]:
    """How long to hold still, and why."""
    if settling.wait_s is None:
        return {"duration": "", "reason": "whether the press has settled is not known yet"}
    fraction, wait_s = abs(settling.remaining.value), settling.wait_s
    duration = f"{math.ceil(wait_s)} s" if wait_s <= 120 else f"{math.ceil(wait_s / 60)} min"
    return {"duration": f" for {duration}", "reason": f"{fraction:.1%} of the light is still to come or go"}


def _above(name: str, value: float, limit: float, **words: float | str) -> tuple[GuardFlag, float]:
    excess = min(value / limit, WORST) if limit > 0 else (WORST if value > 0 else 0.0)
    return _flag(name, value, limit, **words), excess


def _below(name: str, value: float, limit: float) -> tuple[GuardFlag, float]:
    return _flag(name, value, limit), min(limit / value, WORST) if value > 0 else WORST


def _flag(name: str, value: float, limit: float, **words: float | str) -> GuardFlag:
    texts = (text for text in (GUARD_FLAGS[name].cure, GUARD_FLAGS[name].says) if text)
    return GuardFlag(
        name=name, value=value, limit=limit, advice=": ".join(texts).format(value=value, limit=limit, **words)
    )
