"""Rows across a contact, readings of known moduli, and strains over the depth of a grey level."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from studies.panels import modulus_readings

from tsis.present.figures import contact_rows


def test_every_force_has_its_row_and_some_are_named() -> None:
    force = np.arange(1, 21) / 10
    row_mm = np.linspace(-2.0, 2.0, 50)
    rows = force[:, None] * np.exp(-(row_mm**2))
    ax = contact_rows(row_mm, rows, force, Figure().subplots())
    assert len(ax.lines) == 20
    np.testing.assert_allclose(np.asarray(ax.lines[-1].get_ydata()), rows[-1])
    named = [text.get_text() for text in ax.get_legend().get_texts()]  # type: ignore[union-attr]
    assert len(named) == 5
    assert (named[0], named[-1]) == ("0.1 N", "2 N")


def test_one_row_is_named() -> None:
    ax = contact_rows(np.arange(3.0), np.ones((1, 3)), np.array([0.8]), Figure().subplots())
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["0.8 N"]  # type: ignore[union-attr]


def test_objects_share_an_axes_that_shows_all_of_them() -> None:
    ax = Figure().subplots()
    modulus_readings(np.array([100.0, 110.0]), ax, truth_kpa=103.0, label="stiff")
    assert modulus_readings(np.array([300.0, 60.0, 65.0]), ax, truth_kpa=62.0, label="soft", series=1) is ax
    readings, line, others, _ = ax.lines
    np.testing.assert_allclose(np.asarray(readings.get_ydata()), [100.0, 110.0])
    np.testing.assert_allclose(np.asarray(others.get_xdata()), [1, 2, 3])
    assert list(np.asarray(line.get_ydata())) == [103.0, 103.0]
    assert readings.get_color() != others.get_color()
    np.testing.assert_allclose(ax.get_ylim(), [0.0, 330.0])


def test_a_truth_above_all_readings_is_in_sight() -> None:
    ax = modulus_readings(np.array([10.0]), Figure().subplots(), truth_kpa=103.0, label="stiff")
    assert ax.get_ylim()[1] > 103.0
