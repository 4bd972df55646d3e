"""Tables 6.1 and 6.2 and figure 6.22: a network that reads size, depth and modulus off three numbers of a press.

The route is the source's: 134 random inclusions are simulated, lines through nine known ones bring what the camera
reads to what the simulation says, each of the nine through lines fitted to the other eight, and 100 networks of ten
sigmoid and three linear units estimate. Two things differ. The three numbers are read off the change against plain
tissue inside 8 mm, because as printed they say nearly nothing: at a fixed force the total of a flat face is the force
and its area is the face. And the nine samples that stop a training are left over from the 134; the source's are the
nine inclusions that it tests on.

Found here: size and depth come out much as the source's own list has them, and so does the modulus: no method, printed
or ours, does clearly better than the mean of the other eight, for which no press is needed. Scaled conjugate gradients
err as much when they are given the simulation's own outputs, so their training is the limit, as section 7.2 suspects.
Levenberg-Marquardt then errs far less; but through the source's lines, from what the camera sees to displacement, its
estimates are the worst, since it trusts numbers that the lines get wrong. Simulating the pressure, which is what the
camera sees, mends part of that.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

import tsis
from tsis.cli.progress import progress_bar
from tsis.inclusion.network import (
    change_reading,
    fit_mapping,
    frame_outputs,
    leave_one_out_mapping,
    printed_frame_outputs,
    printed_reading,
    simulated_outputs,
)
from tsis.inclusion.network_training import estimate_by_networks
from tsis.inclusion.prior import PARAMETERS
from tsis.mechanics.surrogate.building import build_surrogate
from tsis.mechanics.surrogate.polynomial import Box
from tsis.virtual.probe import VirtualProbe

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from tsis.model.calibration import LightMap
    from tsis.model.image import TactileImage


PRINTED_RMSE = np.array([1.25, 2.09, 28.65])  # table 6.1
# Table 6.2: estimates of diameter (mm), depth (mm) and modulus (kPa), and their relative errors (%) as printed.
PRINTED = np.array(
    [
        [4.31, 8.2, 77.12],
        [7.38, 7.41, 78.31],
        [9.73, 6.55, 80.35],
        [7.34, 7.17, 82.1],
        [5.52, 8.5, 77.06],
        [5.56, 7.75, 79.92],
        [10.09, 5.88, 89.31],
        [10.07, 5.85, 98.12],
        [10.64, 6.42, 82.97],
    ]
)
PRINTED_ERROR = np.array(
    [
        [115.5, 64.0, 35.73],
        [7.75, 48.2, 34.74],
        [25.15, 31.0, 33.04],
        [4.86, 79.25, 17.89],
        [20.57, 6.25, 22.94],
        [29.43, 35.41, 20.08],
        [0.9, 17.6, 123.28],
        [0.75, 17.0, 40.17],
        [6.41, 28.34, 17.03],
    ]
)
ROUNDING = 0.02  # of a printed error, in per cent


def rmse(estimates: NDArray[np.float64], truth: NDArray[np.float64]) -> NDArray[np.float64]:
    """Root mean square error over the nine inclusions, (6.15), of each parameter."""
    return np.asarray(np.sqrt(np.mean((estimates - truth) ** 2, axis=-2)))


def relative_error(estimates: NDArray[np.float64], truth: NDArray[np.float64]) -> NDArray[np.float64]:
    """Relative error of each estimate, %."""
    return np.asarray(100.0 * np.abs(estimates - truth) / truth)


def without_itself(truth: NDArray[np.float64]) -> NDArray[np.float64]:
    """For each inclusion the mean of the others: what can be said without any press."""
    return np.asarray((truth.sum(axis=0) - truth) / (len(truth) - 1))


FORCE_N = 1.0
SAMPLES, TRIALS, REPEATS = 134, 100, 6
BOX = Box(diameter_mm=(0.1, 15.0))  # the source begins at 0 mm, which is no inclusion
BOX_MIDDLE = np.array([BOX.diameter_mm, BOX.depth_mm, BOX.young_kpa]).mean(axis=1)
UNITS = ("mm", "mm", "kPa")
METHODS = {"scg": "scaled conjugate gradients", "lm": "Levenberg-Marquardt"}
SIMULATED = {"face_displacement_mm": "displacement", "pressure_kpa": "pressure"}
ROUTES = tuple((field, method) for field in SIMULATED for method in METHODS)  # the source's first


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Readings:
    """How much the three outputs say, read in one way.

    Attributes
    ----------
    simulated_variation
        Standard deviation over the random inclusions as a share of the mean, shape (3,).
    told_apart
        Standard deviation over frames of the nine inclusions over that of repeated presses of one, shape (3,); NaN
        where nothing varies.
    """

    simulated_variation: NDArray[np.float64]
    told_apart: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Result:
    """What the route found.

    Attributes
    ----------
    truth
        The nine inclusions of table 6.2, shape (9, 3).
    inclusions, outputs
        The random inclusions, shape (134, 3), and what is simulated of them by field, shape (134, 3), figure 6.18.
    measured, known
        Outputs of the nine off frames, shape (9, 3), and simulated ones by field, shape (9, 3), figure 6.19.
    estimates
        By (simulated field, method): shape (trials, 9, 3).
    without_frames
        The same from the outputs that the simulation gives the nine: no camera, no lines.
    r_squared
        Of the lines from frames to each simulated field, shape (3,).
    readings
        Of the outputs ``"as printed"`` and as ``"change"``.
    """

    truth: NDArray[np.float64]
    inclusions: NDArray[np.float64]
    outputs: dict[str, NDArray[np.float64]]
    measured: NDArray[np.float64]
    known: dict[str, NDArray[np.float64]]
    estimates: dict[tuple[str, str], NDArray[np.float64]]
    without_frames: dict[tuple[str, str], NDArray[np.float64]]
    r_squared: dict[str, NDArray[np.float64]]
    readings: dict[str, Readings]


def run(
    rng: np.random.Generator,
    *,
    trials: int = TRIALS,
    routes: Sequence[tuple[str, str]] = ROUTES,
    light: LightMap | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Result:
    """Press the nine phantoms, simulate, map, train, estimate; ``progress`` is called with (networks, in all).

    Networks are trained for each of ``routes``: (simulated field, method). The probe is lit by its own lamps, or by
    ``light``.
    """
    probe = tsis.load_probe("tsis-2011")
    surrogate = build_surrogate(probe, BOX, force_n=FORCE_N)
    ranges = np.array([BOX.diameter_mm, BOX.depth_mm, BOX.young_kpa])
    inclusions = rng.uniform(ranges[:, 0], ranges[:, 1], (SAMPLES, len(PARAMETERS)))
    virtual = VirtualProbe(probe, rng=rng, light=light, strain="small")
    phantoms = [tsis.load_phantom(f"calibration-{number}") for number in range(1, 10)]
    truth = np.array([[getattr(phantom.inclusion, name) for name in PARAMETERS] for phantom in phantoms])
    frames = [virtual.press(phantom, force_n=FORCE_N) for phantom in phantoms]
    repeats = [virtual.press(phantoms[1], force_n=FORCE_N) for _ in range(REPEATS)]
    plain = virtual.press(tsis.load_phantom("plain"), force_n=FORCE_N)
    reading = change_reading()
    outputs = {field: simulated_outputs(surrogate, inclusions, reading, field=field) for field in SIMULATED}
    known = {field: simulated_outputs(surrogate, truth, reading, field=field) for field in SIMULATED}

    def printed(shown: list[TactileImage]) -> NDArray[np.float64]:
        return printed_frame_outputs(shown, threshold_grey=float(plain.grey.mean()) / 2)

    def change(shown: list[TactileImage]) -> NDArray[np.float64]:
        return frame_outputs(shown, plain, reading, calibration=virtual.calibration)

    measured = change(frames)
    as_printed = simulated_outputs(surrogate, inclusions, printed_reading(probe))
    readings = {
        "as printed": _readings(as_printed, printed(frames), printed(repeats)),
        "change": _readings(outputs["face_displacement_mm"], measured, change(repeats)),
    }
    estimates, without_frames = {}, {}
    for number, (field, method) in enumerate(routes):
        found = estimate_by_networks(
            outputs[field],
            inclusions,
            np.concatenate([leave_one_out_mapping(measured, known[field]), known[field]]),
            rng=rng,
            trials=trials,
            method=method,
            progress=None if progress is None else _later(progress, number * trials, len(routes) * trials),
        )
        estimates[field, method], without_frames[field, method] = np.split(found, 2, axis=1)
    return Result(
        truth=truth,
        inclusions=inclusions,
        outputs=outputs,
        measured=measured,
        known=known,
        estimates=estimates,
        without_frames=without_frames,
        r_squared={field: fit_mapping(measured, known[field]).r_squared for field in SIMULATED},
        readings=readings,
    )


def _readings(simulated: NDArray[np.float64], frames: NDArray[np.float64], repeats: NDArray[np.float64]) -> Readings:
    error = repeats.std(axis=0, ddof=1)
    apart = np.divide(frames.std(axis=0, ddof=1), error, out=np.full(error.shape, np.nan), where=error > 0)
    return Readings(simulated_variation=simulated.std(axis=0) / np.abs(simulated.mean(axis=0)), told_apart=apart)


def _later(progress: Callable[[int, int], None], done: int, total: int) -> Callable[[int, int], None]:
    """Progress of one part as progress of the whole."""
    return lambda trained, _: progress(done + trained, total)


def name_of(route: tuple[str, str]) -> str:
    """A route in words."""
    field, method = route
    return f"{METHODS[method]} on {SIMULATED[field]}"


def table_6_1(result: Result) -> dict[str, NDArray[np.float64]]:
    """Root mean square errors: printed, corrected, without any press, and ours."""
    rows = {
        "table 6.1, printed": PRINTED_RMSE,
        "table 6.1 from table 6.2's list": rmse(PRINTED, result.truth),
        "middle of the ranges": rmse(BOX_MIDDLE, result.truth),
        "mean of the other eight": rmse(without_itself(result.truth), result.truth),
    }
    for route, estimates in result.estimates.items():
        rows[f"{name_of(route)}, one trial"] = rmse(estimates, result.truth).mean(axis=0)
        rows[f"{name_of(route)}, mean of trials"] = rmse(estimates.mean(axis=0), result.truth)
        rows[f"{name_of(route)}, without frames"] = rmse(result.without_frames[route].mean(axis=0), result.truth)
    return rows


def table_6_2(result: Result) -> list[str]:
    """Estimates and relative errors of the nine: printed, the printed ones computed again, and ours, as text."""
    truth, (route, estimates) = result.truth, next(iter(result.estimates.items()))
    ours = estimates.mean(axis=0)
    again, found = relative_error(PRINTED, truth), relative_error(ours, truth)
    lines = [f"{'':>9} {'true':>6} {'printed':>8} {'error':>7} {'again':>7}  {'ours':>7} {'error':>7}"]
    for column, name in enumerate(("d mm", "h mm", "E kPa")):
        for row in range(len(truth)):
            at = row, column
            mark = "*" if abs(again[at] - PRINTED_ERROR[at]) > ROUNDING else " "
            printed = f"{truth[at]:6.0f} {PRINTED[at]:8.2f} {PRINTED_ERROR[at]:7.2f} {again[at]:7.2f}{mark}"
            lines.append(f"{row + 1:3d} {name:<5} {printed} {ours[at]:7.2f} {found[at]:7.2f}")
        means = (errors[:, column].mean() for errors in (PRINTED_ERROR, again, found))
        lines.append("mean {:<5} {:21.2f} {:7.2f} {:16.2f}".format(name, *means))
    return [
        f"ours: {name_of(route)}, mean of {len(estimates)} trials; * a printed error that is not that of its estimate",
        *lines,
    ]


def correlations(result: Result) -> dict[str, float]:
    """Of estimated with true moduli over the nine inclusions."""
    every = {"table 6.2": PRINTED, **{name_of(key): one.mean(axis=0) for key, one in result.estimates.items()}}
    return {name: float(np.corrcoef(one[:, 2], result.truth[:, 2])[0, 1]) for name, one in every.items()}


def what_outputs_tell(result: Result) -> dict[str, NDArray[np.float64]]:
    """How far greatest, total and area vary, and how well lines map them."""
    rows = {}
    for name, output in result.readings.items():
        rows[f"{name}: variation in simulations, %"] = 100 * output.simulated_variation
        rows[f"{name}: spread of the nine over that of repeats"] = output.told_apart
    for field, share in result.r_squared.items():
        rows[f"R² of lines from frames to simulated {SIMULATED[field]}"] = share
    return rows


def _rows(table: dict[str, NDArray[np.float64]]) -> list[str]:
    return [f"{name:<58}" + " ".join(f"{value:7.2f}" for value in row) for name, row in table.items()]


def report(result: Result) -> str:
    """Both tables, and how much the outputs say, as text."""
    output = (f"{name:<58}{value:7.2f}" for name, value in correlations(result).items())
    return "\n".join(
        [
            f"table 6.1: root mean square error{'d mm':>32} {'h mm':>7} {'E kPa':>7}",
            *_rows(table_6_1(result)),
            "\ntable 6.2: estimates and relative errors in %",
            *table_6_2(result),
            "\ncorrelation of estimated with true modulus",
            *output,
            f"\nwhat the outputs tell{'greatest':>44} {'total':>7} {'area':>7}",
            *_rows(what_outputs_tell(result)),
            "Research use only",
        ]
    )


def spread(results: list[Result]) -> str:
    """Least, middle and greatest errors of table 6.1 over several benches, as text."""
    tables = [table_6_1(result) for result in results]
    lines = [f"table 6.1 over {len(results)} benches: least, median, greatest"]
    for name in tables[0]:
        ends = np.quantile([table[name] for table in tables], [0.0, 0.5, 1.0], axis=0)
        cells = ("{:6.2f} {:6.2f} {:6.2f}".format(*column) for column in ends.T)
        lines.append(f"{name:<58}" + "   ".join(cells))
    return "\n".join([*lines, "Research use only"])


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--trials", type=int, default=TRIALS)
    parser.add_argument("--benches", type=int, default=1, help="probes, frames and simulations of seeds from --seed on")
    arguments = parser.parse_args()
    results = []
    for seed in range(arguments.seed, arguments.seed + arguments.benches):
        with progress_bar(f"training, seed {seed}") as progress:
            results.append(run(np.random.default_rng(seed), trials=arguments.trials, progress=progress))
    print(report(results[0]) if len(results) == 1 else spread(results))


if __name__ == "__main__":
    main()
