from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.instrument.sources.genicam_stand_ins import FakeNodes

from tsis.instrument.drivers.genicam import NumberNode, first_number, number_node, set_choice


@given(
    low=st.integers(-1000, 1000), steps=st.integers(0, 200), step=st.integers(1, 9), wanted=st.floats(-5000.0, 5000.0)
)
def test_the_nearest_value_is_one_that_the_camera_takes_and_no_other_is_nearer(
    low: int, steps: int, step: int, wanted: float
) -> None:
    taken = low + step * np.arange(steps + 1)
    given_range = NumberNode(
        value=low, low=low, high=taken[-1] + (step - 1), step=step
    )  # the end may lie between steps
    nearest = given_range.nearest(wanted)
    assert nearest in taken
    assert abs(nearest - wanted) == pytest.approx(np.abs(taken - wanted).min())


def test_a_number_without_steps_is_only_kept_in_its_range() -> None:
    assert NumberNode(value=0.0, low=0.5, high=2.0).nearest(1.2345) == 1.2345
    assert NumberNode(value=0.0, low=0.5, high=2.0).nearest(7.0) == 2.0
    assert NumberNode(value=0.0, step=3.0).nearest(-1e9) == -1e9  # no range told
    assert NumberNode(value=0.0, low=0.0, step=3.0).nearest(100.0) == 99.0


def test_older_names_are_read_where_the_newer_ones_are_absent() -> None:
    nodes = FakeNodes()
    assert first_number(nodes, ("BlackLevel", "BlackLevelRaw")) == (
        "BlackLevelRaw",
        number_node(nodes, "BlackLevelRaw"),
    )
    assert first_number(nodes, ("Nothing", "PixelFormat")) is None


def test_only_words_that_the_camera_offers_and_does_not_hold_are_written() -> None:
    nodes = FakeNodes()
    set_choice(nodes, "ExposureAuto", "Off")
    set_choice(nodes, "ExposureAuto", "Off")
    set_choice(nodes, "ExposureAuto", "Sometimes")
    set_choice(nodes, "GainAuto", "Off")
    assert nodes.writes == ["ExposureAuto"]
