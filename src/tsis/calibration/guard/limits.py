"""Every threshold of the press guard, in one place."""

from __future__ import annotations

from dataclasses import dataclass

from tsis.model.check import require_number
from tsis.model.errors import InputError


@dataclass(frozen=True, slots=True, kw_only=True)
class GuardLimits:
    """Up to where a press counts as usable.

    Parameters
    ----------
    least_force_n, most_force_n
        Window of the force, N, in (0, 100]. By default the range over which forces are calibrated: its first step of
        0.1 N, and its end of 2 N.
    tilt
        How much brighter the contact may grow from its centre to its edge in one direction, a share of the brightness,
        in [0.005, 1]. A flat face tilted by an angle presses that much more at one edge: 0.1 is the angle
        ``0.1 approach / radius``, 2 degrees at 1 N on 5 kPa with ``tsis-2011``.
    off_centre
        Distance of the contact from the probe's axis over the contact's radius, in [0.005, 1]. Estimates take the
        contact around the axis; at 0.1 the light's own pattern is read a tenth of the radius beside its place.
    saturated
        Share of the contact's pixels at full scale, in [0, 1). The light that clips is lost to every sum; 0.001 lets a
        sensor's stuck pixels pass and no more.
    ambient
        Light from outside over the contact's mean light, in [1e-3, 1]: by as much the sum of grey levels errs. Three
        times the deviation of an unknown constant that a calibration reckons with unless told otherwise (0.01).
    flicker
        Amplitude of the light from outside that swings with the mains, over the contact's mean light, in [1e-3, 1]:
        the same share, frame by frame.
    led_drift
        Change of the lamps since the reference, a share, in [1e-4, 1]. Twice the deviation of the gain that a
        calibration reckons with unless told otherwise (0.01).
    cropped
        Level at which the contact's patch reaches the frame's border over the contact's peak, in [0.01, 1]. At one half
        the patch at half of the peak, which sizes are read from, runs out of the frame.
    frozen
        How many frames in a row may be alike bit by bit, in [1, 1000]. A sensor's noise never repeats; 2 lets a frame
        that was delivered twice pass.
    contact
        Least peak of a contact above what is untouched, a share of full scale, in [1e-4, 1]: 0.01 is two and a half
        levels of 8 bits, above what black levels wander by; the frame's own noise may ask for more.
    dark
        Least peak of a contact that is bright enough to be read, a share of full scale, in [1e-3, 1]. At 0.05 the
        rounding and read noise of one pixel of an 8-bit camera is one part in twenty of the peak.
    moving
        Change of the light still to come, a share, in [1e-4, 0.5]: that of the settling time of a press.
    release
        Part of a limit to which a value must come back before a raised flag is taken down in a live view, in [0.5, 1].

    Raises
    ------
    InputError
        When a limit lies outside its range or the window of the force is empty.
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
