"""Figures 6.18, 6.19 and 6.22 and table 6.1: simulations, lines and errors of networks, from `studies.section_6_3`.

Of the 134 simulated inclusions the source reads that the outputs grow with size and modulus and fall with depth; here
each is correlated by rank while the other two are held. Its lines are drawn through normalised data, three of which
fall together at (1, 1) in each graph: so the phantoms for size, depth and hardness must have been scaled by the
greatest of their three inclusions each, as is done here. Estimates are made without that, see `studies.section_6_3`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import rankdata
from studies.panels import trial_errors
from studies.section_6_3 import METHODS, PRINTED, PRINTED_RMSE, ROUTES, Result, rmse, run, without_itself
from studies.shown import Shown

from tsis.inclusion.network import LinearMapping, fit_mapping

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

SHORT_TRIALS = 15
SOURCE, MARQUARDT = ROUTES[:2]
FIELD = SOURCE[0]
OUTPUTS = ("greatest", "total", "area")
AXES = ("greatest change", "total change", "changed area")
INCLUSION = ("size", "depth", "modulus")
UNITS = ("mm", "mm", "kPa")
PHANTOMS = {"size": slice(0, 3), "depth": slice(3, 6), "hardness": slice(6, 9)}
MARKS = {"size": ("o", "#0072b2"), "depth": ("s", "#d55e00"), "hardness": ("^", "#009e73")}


def short(rng: np.random.Generator) -> Result:
    """Fewer trials."""
    return run(rng, trials=SHORT_TRIALS)


def held_correlation(values: NDArray[np.float64], inclusions: NDArray[np.float64], of: int) -> float:
    """Rank correlation of values with one parameter of inclusions while the others are held."""
    ranks = np.asarray(rankdata(np.column_stack([values, inclusions]), axis=0))
    left = np.linalg.inv(np.corrcoef(ranks.T))  # what is left of each when the others are held
    return float(-left[0, of + 1] / np.sqrt(left[0, 0] * left[of + 1, of + 1]))


def simulation_values(result: Result) -> dict[str, float]:
    """Numbers of figure 6.18."""
    found = {
        f"rank correlation of {output} with {parameter}": held_correlation(
            result.outputs[FIELD][:, column], result.inclusions, of
        )
        for column, output in enumerate(OUTPUTS)
        for of, parameter in enumerate(INCLUSION)
    }
    varied = 100.0 * result.readings["as printed"].simulated_variation
    return found | {
        "variation of greatest deformation over the whole face": float(varied[0]),
        "variation of total deformation over the whole face": float(varied[1]),
    }


def draw_simulations(result: Result, figure: Figure) -> None:
    """Figure 6.18: size and depth along the axes, the output as colour, the modulus as the size of the mark."""
    axes = figure.subplots(1, 3, sharey=True)
    size, depth, modulus = result.inclusions.T
    for axis, title, output in zip(axes, AXES, result.outputs[FIELD].T, strict=True):
        scaled = 255.0 * (output - output.min()) / np.ptp(output)
        marks = axis.scatter(size, depth, s=(modulus - 20.0) * 0.5, c=scaled, cmap="viridis", lw=0.0)
        axis.set(xlabel="size / mm", title=title)
    axes[0].set_ylabel("depth / mm")
    axes[0].invert_yaxis()  # deeper is lower
    figure.colorbar(marks, ax=axes, label="output, rescaled to 0 to 255", pad=0.01)
    sizes = [axes[0].scatter([], [], s=(kpa - 20.0) * 0.5, c="0.5", lw=0.0) for kpa in (40, 80, 120)]
    figure.legend(sizes, ["40 kPa", "80 kPa", "120 kPa"], loc="outside upper center", ncols=3, title="modulus")


def normalised(outputs: NDArray[np.float64]) -> NDArray[np.float64]:
    """Outputs of the nine, each phantom's over the greatest of its three."""
    return np.concatenate([outputs[rows] / outputs[rows].max(axis=0) for rows in PHANTOMS.values()])


def line_through(result: Result, field: str) -> tuple[NDArray[np.float64], NDArray[np.float64], LinearMapping]:
    """Normalised outputs of the frames and of the simulation, and the lines through them."""
    measured, known = normalised(result.measured), normalised(result.known[field])
    return measured, known, fit_mapping(measured, known)


def line_values(result: Result) -> dict[str, float]:
    """Numbers of figure 6.19."""
    measured, known, lines = line_through(result, FIELD)
    together = np.isclose(measured, 1.0) & np.isclose(known, 1.0)
    pressure = line_through(result, "pressure_kpa")[2]
    return (
        {"points of a graph that fall together at (1, 1), least": float(together.sum(axis=0).min())}
        | {f"slope of the line of {name}": float(slope) for name, slope in zip(OUTPUTS, lines.slope, strict=True)}
        | {f"R² of the line of {name}": float(share) for name, share in zip(OUTPUTS, lines.r_squared, strict=True)}
        | {
            f"R² of the line of {name}, simulated pressure": float(share)
            for name, share in zip(OUTPUTS, pressure.r_squared, strict=True)
        }
    )


def draw_lines(result: Result, figure: Figure) -> None:
    """Figure 6.19: one graph for each output."""
    measured, known, lines = line_through(result, FIELD)
    ends = np.array([0.0, 1.05])
    axes = figure.subplots(1, 3, sharex=True, sharey=True)
    for column, (axis, title) in enumerate(zip(axes, AXES, strict=True)):
        for name, rows in PHANTOMS.items():
            mark, colour = MARKS[name]
            axis.plot(measured[rows, column], known[rows, column], mark, color=colour, mfc="none", label=name)
        axis.plot(ends, lines.intercept[column] + lines.slope[column] * ends, "-", color="0.3", label="line")
        axis.set(title=f"{title}, R² = {lines.r_squared[column]:.2f}", xlabel="off the frame, normalised")
        axis.title.set_fontsize(10)
        axis.grid(visible=True, alpha=0.3)
    axes[0].set_ylabel("simulated, normalised")
    axes[0].legend(fontsize=8, loc="upper left", title="phantom", title_fontsize=8)


def trial_values(result: Result) -> dict[str, float]:
    """Numbers of figure 6.22."""
    blind = rmse(without_itself(result.truth), result.truth)
    found: dict[str, float] = {}
    for route in (SOURCE, MARQUARDT):
        medians = np.median(rmse(result.estimates[route], result.truth), axis=0)
        for name, median in zip(INCLUSION, medians, strict=True):
            found[f"median error of {name}, {METHODS[route[1]]}"] = float(median)
    errors = rmse(result.estimates[SOURCE], result.truth)
    for name, column in zip(INCLUSION, errors.T, strict=True):
        found[f"standard deviation over trials, {name}, {METHODS[SOURCE[1]]}"] = float(column.std(ddof=1))
    better = errors < blind
    for name, column in zip(INCLUSION, better.T, strict=True):
        found[f"trials better than the mean of the other eight, {name}"] = 100.0 * float(column.mean())
    return found


def draw_trials(result: Result, figure: Figure) -> None:
    """Figure 6.22 beside the levels of table 6.1 and of the mean of the other eight."""
    levels = {
        "table 6.1, printed": PRINTED_RMSE,
        "from table 6.2's list": rmse(PRINTED, result.truth),
        "mean of the other eight": rmse(without_itself(result.truth), result.truth),
    }
    axes = figure.subplots(1, 3)
    for column, (axis, name, unit) in enumerate(zip(axes, INCLUSION, UNITS, strict=True)):
        trial_errors(
            {METHODS[key]: rmse(result.estimates[field, key], result.truth)[:, column] for field, key in ROUTES[:2]},
            axis,
            levels={label: float(level[column]) for label, level in levels.items()},
            error_label=f"RMSE of {name} / {unit}",
            top=2.0 * max(float(level[column]) for level in levels.values()),
        )
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=3, fontsize=9)


def table_values(result: Result) -> dict[str, float]:
    """Numbers of table 6.1."""
    rows = {
        "networks here": result.estimates[SOURCE].mean(axis=0),
        "estimates that table 6.2 lists": PRINTED,
        "mean of the other eight": without_itself(result.truth),
        "Levenberg-Marquardt here": result.estimates[MARQUARDT].mean(axis=0),
    }
    return {
        f"RMSE of {name}, {row}": float(error)
        for row, estimates in rows.items()
        for name, error in zip(INCLUSION, rmse(estimates, result.truth), strict=True)
    }


SHOWN = (
    Shown(name="figure-6-18", run=run, short=short, values=simulation_values, draw=draw_simulations),
    Shown(name="figure-6-19", run=run, short=short, values=line_values, draw=draw_lines),
    Shown(name="figure-6-22", run=run, short=short, values=trial_values, draw=draw_trials),
    Shown(name="table-6-1", run=run, short=short, values=table_values),
)
