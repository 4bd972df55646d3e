"""Contacts of a film meet the gauge's forces: on a sphere whose contacts follow Hertz's law."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tsis.errors import InputError
from tsis.hardness.film import MOST_CONTACTS, filmed_press
from tsis.imaging.gel_contact import GelContact
from tsis.instrument.gauge import ForceReading

CUBE_PER_N = 2.5  # mm³/N: 3 R / 4 E* of the sphere on the gel
MM_PER_PX = 0.05
TIMES_S = np.arange(0.0, 8.0, 1 / 25)


def course(time_s: float) -> float:
    """Force in N: three presses of unequal length and height."""
    tops = ((1.2, 0.7, 0.4), (3.3, 1.1, 0.9), (6.1, 0.5, 0.6))  # middle, width, height
    return float(sum(height * max(0.0, 1 - ((time_s - at) / wide) ** 2) for at, wide, height in tops))


def contact(force_n: float, *, good: bool = True) -> GelContact:
    """What the camera sees at a force."""
    radius = float(np.cbrt(CUBE_PER_N * force_n))
    return GelContact(
        name=f"{force_n:.4f}",
        centre_px=(160.0, 120.0),
        centre_sd_px=(0.1, 0.1),
        radius_px=radius / MM_PER_PX,
        radius_sd_px=0.2,
        semi_axes_px=(radius / MM_PER_PX, radius / MM_PER_PX),
        angle_deg=0.0,
        centre_mm=None,
        centre_sd_mm=None,
        radius_mm=radius,
        radius_sd_mm=0.01,
        area_mm2=None,
        area_sd_mm2=None,
        scale_sd=0.02,
        explained=1.0,
        quality=1.0 if good else 0.1,
        good=good,
        reasons=() if good else ("no contact",),
    )


def film(*, bad: bool = False) -> list[GelContact]:
    return [contact(course(time), good=course(time) > 0.02 and not bad) for time in TIMES_S]


def gauge(lag_s: float) -> list[ForceReading]:
    times = np.arange(0.01, 8.5, 0.04)
    return [ForceReading(time_s=float(time), force_n=course(time - lag_s), resolution_n=1e-3) for time in times]


@pytest.mark.parametrize("lag_s", [0.12, -0.08])
def test_each_contact_has_the_force_that_pressed_it_though_the_gauge_lags(lag_s: float) -> None:
    found = filmed_press(film(), TIMES_S.tolist(), gauge(lag_s))
    assert found.lag_s is not None
    assert found.lag_sd_s is not None
    assert abs(found.lag_s - lag_s) < 2 * found.lag_sd_s < 0.05
    for one in found.contacts:
        assert one["force_n"] == pytest.approx(course(one["time_s"]), abs=0.03)
        assert one["radius_mm"] ** 3 == pytest.approx(CUBE_PER_N * one["force_n"], rel=0.15)
    assert f"{1e3 * found.lag_s:+.0f} ms" in found.notes[0]


@pytest.mark.parametrize("moving", [(84,), (75, 76, 90), (22, 80, 160)])
def test_frames_whose_contact_is_not_good_do_not_change_the_delay(moving: tuple[int, ...]) -> None:
    frames = film()
    for number in moving:
        frames[number] = replace(frames[number], good=False, reasons=("moving",))
    found, whole = (filmed_press(each, TIMES_S.tolist(), gauge(0.12)) for each in (frames, film()))
    assert found.lag_s == pytest.approx(whole.lag_s, abs=0.003)
    assert found.lag_s == pytest.approx(0.12, abs=0.02)


def test_contacts_of_the_rise_to_the_largest_force_are_taken_at_even_steps() -> None:
    found = filmed_press(film(), TIMES_S.tolist(), gauge(0.0))
    times, forces = ([one[name] for one in found.contacts] for name in ("time_s", "force_n"))
    assert 6 < len(found.contacts) <= MOST_CONTACTS
    assert max(forces) == pytest.approx(0.9, abs=0.02)
    assert times[-1] == pytest.approx(3.3, abs=0.1)
    steps = np.diff(sorted(forces))
    assert steps.max() < 3 * 0.9 / MOST_CONTACTS


def test_a_reading_errs_by_the_gauges_calibration_at_least() -> None:
    found = filmed_press(film(), TIMES_S.tolist(), gauge(0.0))
    assert all(0.01 * one["force_n"] <= one["force_sd_n"] < 0.05 for one in found.contacts)


def test_a_steady_press_tells_no_delay_and_says_so() -> None:
    steady = [contact(0.5)] * len(TIMES_S)
    readings = [ForceReading(time_s=0.04 * number, force_n=0.5) for number in range(220)]
    found = filmed_press(steady, TIMES_S.tolist(), readings)
    assert (found.lag_s, found.lag_sd_s) == (None, None)
    assert "does not tell the delay" in found.notes[0]
    assert {one["force_n"] for one in found.contacts} == {0.5}


def test_a_film_without_contacts_times_or_readings_is_refused_in_one_sentence() -> None:
    with pytest.raises(InputError, match=r"must show a good contact; all 200 are not: no contact"):
        filmed_press(film(bad=True), TIMES_S.tolist(), gauge(0.0))
    with pytest.raises(InputError, match="one time for each of the 200 frames; got 199"):
        filmed_press(film(), TIMES_S[1:].tolist(), gauge(0.0))
    late = [ForceReading(time_s=one.time_s + 60.0, force_n=one.force_n) for one in gauge(0.0)]
    with pytest.raises(InputError, match="must have readings while the contacts are seen"):
        filmed_press(film(), TIMES_S.tolist(), late)
    beside = [ForceReading(time_s=float(time), force_n=course(time - 20.0)) for time in np.arange(0.0, 29.0, 0.04)]
    with pytest.raises(InputError, match=r"reads at most 0 N then, and 0\.9 N at another time: .*--video-start-s"):
        filmed_press(film(), TIMES_S.tolist(), beside)
