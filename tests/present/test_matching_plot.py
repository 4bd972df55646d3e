from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from tsis.present.figures import point_sets


@pytest.mark.parametrize("dimension", [2, 3])
def test_each_match_is_a_line_from_the_source_point_to_its_target(dimension: int) -> None:
    rng = np.random.default_rng(1)
    source, target = rng.normal(size=(6, dimension)), rng.normal(size=(4, dimension))
    ax = Figure().add_subplot(projection="3d" if dimension == 3 else None)
    assert point_sets(source, target, ax, matches=[2, -1, 0, -1, -1, 3]) is ax
    (line,) = ax.lines
    ends = np.array(line.get_data_3d() if dimension == 3 else line.get_data())  # type: ignore[attr-defined]
    assert ends.shape == (dimension, 9)
    np.testing.assert_allclose(ends[:, :2], np.stack([source[0], target[2]], axis=1))
    np.testing.assert_allclose(ends[:, 6:8], np.stack([source[5], target[3]], axis=1))
    assert np.isnan(ends[:, 2::3]).all()
    legend = ax.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == ["source (6)", "target (4)"]


def test_without_matches_there_are_no_lines() -> None:
    ax = point_sets(np.zeros((3, 2)), np.ones((3, 2)), Figure().subplots(), source_label="moved source")
    assert not ax.lines


def test_of_many_points_a_part_is_drawn_and_all_are_counted() -> None:
    many = np.random.default_rng(2).normal(size=(12_000, 2))
    ax = point_sets(many, many[:100], Figure().subplots(), matches=np.full(12_000, 99))
    first, second = ax.collections
    assert (len(np.asarray(first.get_offsets())), len(np.asarray(second.get_offsets()))) == (4000, 100)
    assert len(np.asarray(ax.lines[0].get_xdata())) == 3 * 4000
    legend = ax.get_legend()
    assert legend is not None
    assert legend.get_texts()[0].get_text() == "source (12000)"
