"""Contacts of a film with the forces of a gauge, and their delay."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.errors import GaugeError, InputError
from tsis.instrument.force_log import find_latency
from tsis.instrument.gauge import force_at

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.imaging.gel_contact import GelContact
    from tsis.instrument.gauge import ForceReading


MOST_CONTACTS = 12  # of a film: neighbours in time tell the same
LONGEST_LAG_S = (0.5, 0.2)  # delays that are sought, as far as the film is long enough
GAUGE_SD = 0.01  # of a force, relative: the calibration of the gauge
HERTZ_SD = 0.25  # of the time between frames: what Hertz's law and the first good frame may shift the delay
LEAST_FORCE_N = 0.01
PRESSED = 0.05  # of the largest force: below it the zero of the gauge is most of a force


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FilmedPress:
    """Contacts of a film with their forces, as `tsis.hardness.estimate_from_contacts` takes them.

    Attributes
    ----------
    contacts
        Mappings with radius, force, their standard deviations and the time of the frame.
    lag_s, lag_sd_s
        Delay of the gauge against the frames, and its standard deviation; None where the film does not tell it.
    notes
        A sentence on the delay.
    """

    contacts: tuple[dict[str, Any], ...]
    lag_s: float | None
    lag_sd_s: float | None
    notes: tuple[str, ...]


def filmed_press(
    found: Sequence[GelContact], times_s: Sequence[float], readings: Sequence[ForceReading]
) -> FilmedPress:
    """Match the contacts of a film with the readings of a gauge.

    Parameters
    ----------
    found
        The contact of each frame, good or not.
    times_s
        Time of each frame in s, ascending, on the clock of the readings up to a delay.
    readings
        Of the gauge, ascending in time.

    Raises
    ------
    InputError
        When times and contacts differ in number, no contact is good, no reading lies near a good contact, or the gauge
        shows no press there.
    """
    if len(found) != len(times_s):
        raise InputError(f"times_s must have one time for each of the {len(found)} frames; got {len(times_s)}")
    if not any(contact.good for contact in found):
        reasons = sorted({reason for contact in found for reason in contact.reasons})
        raise InputError(f"the frames must show a good contact; all {len(found)} are not: {', '.join(reasons)}")
    delay = _delay(found, times_s, readings)
    latency = 0.0 if delay is None else delay[0]
    rows, seen = [], list[float]()
    for contact, time in zip(found, times_s, strict=True):
        if not contact.good or contact.radius_mm is None:
            continue
        try:
            force = force_at(readings, time, latency_s=latency)
        except GaugeError:
            continue
        seen.append(force.force_n)
        force_sd = float(np.hypot(force.error_n / 2.0, GAUGE_SD * force.force_n))
        if force.force_n > max(LEAST_FORCE_N, force_sd):
            rows.append(
                {
                    "name": contact.name,
                    "time_s": time,
                    "radius_mm": contact.radius_mm,
                    "radius_sd_mm": contact.radius_sd_mm,
                    "scale_sd": contact.scale_sd,
                    "force_n": force.force_n,
                    "force_sd_n": force_sd,
                }
            )
    if not seen:
        raise InputError("the gauge must have readings while the contacts are seen; got none: check the film's start")
    largest = max(reading.force_n for reading in readings)
    if not rows or max(seen) < PRESSED * largest:
        raise InputError(
            f"the gauge must read the press while contacts are seen; it reads at most {max(seen):.2g} N then, and "
            f"{largest:.3g} N at another time: check the time of the film's first frame (--video-start-s)"
        )
    said = "The film does not tell the delay between gauge and camera: the prior of the lag holds."
    if delay is not None:
        said = f"The gauge lags {1e3 * delay[0]:+.0f} ms behind the film (sd {1e3 * delay[1]:.0f} ms): undone."
    lag, sd = (None, None) if delay is None else delay
    return FilmedPress(contacts=tuple(_thinned(rows)), lag_s=lag, lag_sd_s=sd, notes=(said,))


def _delay(
    found: Sequence[GelContact], times_s: Sequence[float], readings: Sequence[ForceReading]
) -> tuple[float, float] | None:
    """Delay of the gauge in s and its standard deviation, by the rates of force and of the cube of the radius.

    By Hertz the cube follows the force, so that also one rise, whose rate changes, tells the delay. A frame with a
    contact that is not good tells nothing, one without a contact tells that there is none.
    """
    told = [
        (time, contact.radius_px**3 if contact.good else 0.0)
        for contact, time in zip(found, times_s, strict=True)
        if contact.good or "no contact" in contact.reasons
    ]
    times, cubes = zip(*told, strict=True)
    for longest in LONGEST_LAG_S:
        try:
            latency = find_latency(times, cubes, readings, longest_s=longest)
        except (GaugeError, InputError):
            continue
        low, high = latency.interval(0.9)
        frame = float(np.median(np.diff(times_s)))
        return latency.latency_s, float(np.hypot((high - low) / 3.29, HERTZ_SD * frame))
    return None


def _thinned(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Contacts of the rise to the largest force, at even steps of the force."""
    forces = np.array([row["force_n"] for row in rows])
    rise = rows[: int(forces.argmax()) + 1]
    forces = forces[: len(rise)]
    steps = np.linspace(max(PRESSED * forces[-1], forces.min()), forces[-1], MOST_CONTACTS)
    chosen = sorted({int(np.abs(forces - step).argmin()) for step in steps})
    return [rise[index] for index in chosen]
