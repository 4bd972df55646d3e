import numpy as np
import pytest

from tsis.model.estimate import INTERVAL_LEVEL, NO_UNIT, UNITS, Estimate, label_of, unit_of


@pytest.mark.parametrize(
    ("name", "words", "unit"),
    [
        ("young_kpa", "Young's modulus", "kPa"),
        ("long_axis_mm", "long axis", "mm"),
        ("angle_deg", "angle", "deg"),
        ("force_n", "force", "N"),
        ("presence", "presence", NO_UNIT),
        ("_mm_left", " mm left", NO_UNIT),
    ],
)
def test_the_ending_says_the_unit_and_the_rest_the_words(name: str, words: str, unit: str) -> None:
    assert (label_of(name), unit_of(name)) == (words, unit)


def test_no_ending_hides_another() -> None:
    assert not [(one, other) for one in UNITS for other in UNITS if one != other and one.endswith(other)]


def test_the_interval_that_is_told_is_the_one_that_an_estimate_gives_unasked() -> None:
    estimate = Estimate(samples={"depth_mm": np.array([0.0, 5.0, 10.0, 20.0])}, prior_sd={"depth_mm": 2.0})
    assert estimate.interval() == estimate.interval(INTERVAL_LEVEL) != estimate.interval(0.8)
