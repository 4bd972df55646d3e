"""Presses that wait to be kept are bounded, however many loadings are under way."""

from __future__ import annotations

import numpy as np
import pytest

from tsis.calibration.session import CalibrationFrame
from tsis.console.services.calibrating import MOST_TYPED, TypedLoadings
from tsis.errors import CalibrationError, InputError
from tsis.model.image import TactileImage


def shot(force_n: float) -> CalibrationFrame:
    return CalibrationFrame(image=TactileImage(grey=np.full((4, 8), 7.0)), force_n=force_n)


def test_a_loading_has_so_many_presses_and_no_more() -> None:
    typed = TypedLoadings()
    for number in range(1, MOST_TYPED + 1):
        assert typed.add("one", shot(0.01 * number)) == number
    with pytest.raises(InputError, match=rf"presses of a loading must lie in \[1, {MOST_TYPED}\]"):
        typed.add("one", shot(0.5))
    assert typed.add("another", shot(0.5)) == 1
    assert typed.forces_n("one") == pytest.approx([0.01 * number for number in range(1, MOST_TYPED + 1)])


def test_the_frames_of_all_loadings_take_so_much_memory_and_no_more() -> None:
    one = shot(0.5)
    typed = TypedLoadings(most_bytes=3 * one.image.grey.nbytes)
    for step in ("one", "two", "three"):
        typed.add(step, one)
    with pytest.raises(CalibrationError, match=r"may take at most .* MiB; this one would take more \(keep"):
        typed.add("one", one)
    assert typed.forces_n("one") == (0.5,)
    typed.forget("two")
    assert typed.add("one", one) == 2


def test_nothing_is_left_of_what_was_forgotten() -> None:
    typed = TypedLoadings()
    typed.add("one", shot(0.5))
    owned = typed.is_empty
    typed.forget_last("one")
    typed.forget_last("one")
    typed.forget("two")
    assert (owned, typed.is_empty) == (False, True)
    assert typed.shots("one") == ()
