"""Errors of the nine inclusions, and the printed errors that are not those of their estimates."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from benchmarks.nine_inclusions import NineInclusions
from matplotlib.figure import Figure
from studies.section_6_3 import PRINTED, PRINTED_ERROR
from studies.table_6_2 import SLIPS, Estimates, draw, values

import tsis

if TYPE_CHECKING:
    from numpy.typing import NDArray


def truth() -> NDArray[np.float64]:
    phantoms = (tsis.load_phantom(f"calibration-{number}").inclusion for number in range(1, 10))
    return np.array([(one.diameter_mm, one.depth_mm, one.young_kpa) for one in phantoms if one is not None])


def estimates() -> Estimates:
    """Networks that say what is printed, a posterior that is right, and ones that err by a tenth and a twentieth."""
    right = np.repeat(truth()[:, None], 2, axis=1)
    by_a_tenth = right * np.array([0.9, 1.1])[:, None]
    posteriors = {
        name: NineInclusions(truth=truth(), means=means) for name, means in (("flat", by_a_tenth), ("domed", right))
    }
    by_a_twentieth = NineInclusions(truth=truth(), means=1.05 * right)
    return Estimates(truth=truth(), networks=PRINTED, posteriors=posteriors, told_even=by_a_twentieth)


def test_mean_errors_are_those_of_single_estimates() -> None:
    found = values(estimates())
    for name, printed in zip(("size", "depth", "modulus"), (22.55, 36.35, 38.32), strict=True):
        assert found[f"mean error of {name}, networks"] == pytest.approx(printed, abs=0.01)
        assert found[f"mean error of {name}, posterior, flat probe"] == pytest.approx(10.0)
        assert found[f"mean error of {name}, posterior, domed probe"] == 0.0
        assert found[f"mean error of {name}, posterior told that the tissue is even, flat probe"] == pytest.approx(5.0)


def test_slips_are_printed_errors_of_other_estimates() -> None:
    found = values(estimates())
    again = [found[f"printed estimate's error, {name}"] for name in SLIPS]
    assert again == pytest.approx([21.14, 20.57, 28.4], abs=0.005)
    assert [PRINTED_ERROR[place] for place in SLIPS.values()] == [20.57, 29.43, 28.34]


def test_every_method_is_drawn_beside_the_truth() -> None:
    figure = Figure()
    draw(estimates(), figure)
    (legend,) = figure.legends
    assert len(legend.get_texts()) == 5
    np.testing.assert_array_equal(figure.axes[2].lines[0].get_ydata(), truth()[:, 2])
