from __future__ import annotations

import numpy as np
import pytest
from matplotlib.container import ErrorbarContainer
from matplotlib.figure import Figure
from studies.panels import repeated_readings

from tsis.inclusion.relative import RelativeReading, Repeats


def repeats(label: str, *values: float | None) -> Repeats:
    readings = [
        RelativeReading(quantity="relative size", value=value, unit="mm", against="plain tissue", assumptions=())
        for value in values
    ]
    return Repeats(label=label, readings=tuple(readings))


TARGETS = [repeats("2 mm", 1.0, 3.0), repeats("8 mm", 5.0, 7.0, 9.0)]


def bars(container: ErrorbarContainer) -> tuple[list[float], list[float]]:
    """Heights of the points, and half lengths of their bars."""
    data_line, _, (lines,) = container.lines
    ends = [segment[:, 1] for segment in lines.get_segments() if segment.ndim == 2]
    return np.asarray(data_line.get_ydata()).tolist(), [float(high - low) / 2 for low, high in ends]


def test_bars_are_means_and_deviations() -> None:
    ax = Figure().subplots()
    assert repeated_readings(TARGETS, ax) is ax
    (here,) = ax.containers
    assert isinstance(here, ErrorbarContainer)
    heights, halves = bars(here)
    assert heights == [2.0, 7.0]
    assert halves == pytest.approx([2**0.5, 2.0])
    assert ax.get_ylabel() == "relative size / mm"
    assert [tick.get_text() for tick in ax.get_xticklabels()] == ["2 mm", "8 mm"]


def test_printed_values_stand_beside() -> None:
    ax = repeated_readings(TARGETS, Figure().subplots(), printed_mean=(1.67, 6.45), printed_sd=(0.48, None))
    here, printed = ax.containers
    assert isinstance(printed, ErrorbarContainer)
    heights, halves = bars(printed)
    assert heights == [1.67, 6.45]
    assert halves == pytest.approx([0.48, 0.0])
    assert (printed.get_label(), here.get_label()) == ("printed", "virtual presses")


def test_a_target_that_nothing_was_read_of_has_no_point() -> None:
    ax = repeated_readings([repeats("unseen", None), *TARGETS], Figure().subplots())
    (here,) = ax.containers
    assert isinstance(here, ErrorbarContainer)
    assert bars(here)[0][1:] == [2.0, 7.0]
    assert bars(here)[0][0] != bars(here)[0][0]
