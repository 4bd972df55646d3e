"""What the three phantoms' readings must obey, whatever the light and the seed."""

from __future__ import annotations

import numpy as np
import pytest
from studies.section_6_2 import FIGURES, Result, lines, run

from tsis.inclusion.relative import ratios

UNTOUCHED, PLAIN = "untouched probe", "plain tissue"

pytestmark = pytest.mark.slow  # the gallery's tests see the same numbers in every run


@pytest.fixture(scope="module")
def result() -> Result:
    return run(np.random.default_rng(7), presses=2)


def means(result: Result, name: str, against: str) -> list[float]:
    return [target.mean for target in result.readings[name][against]]


@pytest.fixture(scope="module")
def ideal() -> Result:
    return run(np.random.default_rng(0), presses=1, ideal=True)


def test_against_the_untouched_probe_the_size_is_that_of_the_face(result: Result, ideal: Result) -> None:
    """Without errors: the gain and stiffness of each phantom's own probe would move the edge of the light."""
    sizes = means(ideal, "size", UNTOUCHED)
    assert max(sizes) < 1.03 * min(sizes), "the face touches all over, whatever lies below"
    assert all("cropped" in each.flags for target in result.readings["size"][UNTOUCHED] for each in target.readings)


def test_against_plain_tissue_the_size_grows_with_the_inclusion(ideal: Result) -> None:
    """Without errors: with them, noise at the dim rim can be taken for the 2 mm inclusion, and is flagged."""
    small, middle, large = ideal.readings["size"][PLAIN]
    assert middle.observed == large.observed == 1
    assert 8.0 < middle.mean < large.mean, "the light of what lies 5 mm deep is wider than it"
    assert small.mean < middle.mean / 2
    assert large.mean / middle.mean < 14.0 / 8.0, "and less so the larger it is"


@pytest.mark.parametrize("against", [UNTOUCHED, PLAIN])
def test_the_grey_level_falls_with_depth(result: Result, against: str) -> None:
    shallow, middle, deep = (target.values for target in result.readings["depth"][against])
    assert shallow.min() > middle.max()
    assert deep.size == 0 or middle.min() > deep.max()


def test_the_printed_fall_with_depth_is_that_against_the_untouched_probe(result: Result) -> None:
    _, middle, deep = ratios(result.readings["depth"][UNTOUCHED])
    assert middle == pytest.approx(FIGURES["depth"].printed_ratio[1], abs=0.1)
    assert deep == pytest.approx(FIGURES["depth"].printed_ratio[2], abs=0.2)
    assert ratios(result.readings["depth"][PLAIN])[1] < middle / 1.5, "the tissue's own light hides most of the fall"


def test_a_reading_of_noise_is_flagged(result: Result) -> None:
    small = result.readings["size"][PLAIN][0]
    assert all("noisy" in each.flags or "no_contact" in each.flags for each in small.readings)


def test_hardness_without_errors_rises_far_less_than_the_modulus(ideal: Result) -> None:
    """The printed 1 : 1.81 : 3.05, and the true 1 : 1.75 : 2.5, are beyond what a linear body shows."""
    _, middle, hard = ratios(ideal.readings["hardness"][PLAIN])
    assert 1.1 < middle < 1.4
    assert middle < hard < 1.75


def test_neither_width_nor_stress_follow_the_modulus(result: Result) -> None:
    """Between 40 and 100 kPa an inclusion in tissue of 5 kPa disturbs the pressure by a fifth more, not 2.5 times."""
    for part, most in (("first_size_mm", 1.2), ("stress_kpa", 1.5)):
        soft, _, hard = (
            np.mean([each.parts[part] for each in target.readings]) for target in result.readings["hardness"][PLAIN]
        )
        assert 1.0 < hard / soft < most


def test_what_the_source_prints_and_how_it_errs() -> None:
    """Relative errors of the printed ratios: 3.5, 24.9, 3.43 and 22.0 %; of the depths against the true 1 : 2 : 3."""
    errors = {
        name: [abs(p - t) / t for p, t in zip(figure.printed_ratio, figure.true_ratio, strict=True)][1:]
        for name, figure in FIGURES.items()
    }
    assert errors["size"] == pytest.approx([0.035, 0.249], abs=0.001)
    assert errors["hardness"] == pytest.approx([0.0343, 0.22], abs=0.001)
    assert errors["depth"] == pytest.approx([0.63, 0.81], abs=0.001)
    for figure in FIGURES.values():
        first, *others = figure.printed_mean
        assert [mean / first for mean in others] == pytest.approx(figure.printed_ratio[1:], rel=0.02)


def test_the_table(result: Result) -> None:
    text = "\n".join(lines(result))
    for said in ("figure 6.5", "figure 6.11", "figure 6.15", "8.77", "149.93", "assumed: ", "Research use only"):
        assert said in text
