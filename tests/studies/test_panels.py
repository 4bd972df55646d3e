from __future__ import annotations

import numpy as np
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from studies.panels import trial_errors


def test_every_trial_is_a_point_and_every_level_a_line() -> None:
    errors = {"first": np.array([2.0, 3.0, 1.0]), "second": np.array([4.0, 5.0, 6.0])}
    ax = Figure().subplots()
    assert trial_errors(errors, ax, levels={"printed": 2.5, "mean": 3.5}, error_label="RMSE / mm") is ax
    by_name = {str(line.get_label()): line for line in ax.lines}
    for name, values in errors.items():
        np.testing.assert_allclose(np.asarray(by_name[name].get_xdata()), [1, 2, 3])
        np.testing.assert_allclose(np.asarray(by_name[name].get_ydata()), values)
    for name, level in (("printed", 2.5), ("mean", 3.5)):
        np.testing.assert_allclose(np.asarray(by_name[name].get_ydata()), level)
    assert ax.get_ylim()[0] == 0.0
    assert ax.get_ylabel() == "RMSE / mm"


def test_more_methods_and_levels_than_colours_and_dashes_are_all_drawn() -> None:
    ax = trial_errors(
        {f"method {k}": [1.0] for k in range(6)},
        Figure().subplots(),
        levels={f"level {k}": float(k) for k in range(6)},
        error_label="RMSE",
    )
    assert len(ax.lines) == 12
    assert len({to_hex(line.get_color()) for line in ax.lines[:4]}) == 4


def test_errors_beyond_the_top_stay_in_sight_as_triangles() -> None:
    ax = trial_errors({"one": [1.0, 50.0, 2.0]}, Figure().subplots(), levels={}, error_label="RMSE", top=5.0)
    dots, triangles = ax.lines
    np.testing.assert_allclose(np.asarray(dots.get_xdata()), [1, 3])
    np.testing.assert_allclose(np.asarray(triangles.get_xdata()), [2])
    np.testing.assert_allclose(np.asarray(triangles.get_ydata()), [5.0])
    assert triangles.get_marker() == "^"
    assert ax.get_ylim() == (0.0, 5.0)
