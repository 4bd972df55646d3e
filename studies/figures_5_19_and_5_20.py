"""Figures 5.19 and 5.20: landmarks of the toy hotel matched between frames 10 to 100 apart, some of them hidden.

The source shows 11 of the 101 frames, chooses 100 points in each by hand, and matches all pairs of them. It prints by
how much the mean error grows from 10 to 100 frames of separation, in mm of an unknown scale; only ratios of these can
be compared. Its points were not published, nor are the images here: the 30 landmarks of the public sequence are matched
instead, between the same 11 frames. What stands for the images is how the landmarks move.

Found: over 100 frames the landmarks move by 60 pixels, of which an affine map leaves 40. TPRL matches every pair
exactly while nothing is hidden; the other methods' errors grow with the separation, in another order than printed. With
landmarks hidden TPRL errs too, more than its printed curve, and less than coherent point drift.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from benchmarks.matching.methods import BenchmarkMethod
from benchmarks.matching.runs import run_trials
from benchmarks.matching.trials import HIDDEN_FRACTIONS, SEPARATIONS, SEQUENCE_FILE, hotel_trials
from studies.figures_5_14_to_5_18 import DATA, METHODS
from studies.shown import Shown

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure
    from numpy.typing import NDArray

STYLES = dict(zip(METHODS, ("v-", "s-", "*-", "D-", "o-"), strict=True))  # the source's marks
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#000000")
FRAMES, BETWEEN = 101, 10


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Motion:
    """How the landmarks move.

    Attributes
    ----------
    places
        Of the landmarks in the first frame and each later one, px, shape (frames, landmarks, 2).
    """

    places: NDArray[np.float64]

    def rms(self, separation: int) -> float:
        """Root-mean-square distance that landmarks move between two frames, px."""
        first, second = self.places[:-separation], self.places[separation:]
        return float(np.sqrt(((second - first) ** 2).sum(axis=2).mean()))

    def left(self, separation: int) -> float:
        """What an affine map of the first frame's landmarks leaves of it, px."""
        squares = []
        for first, second in zip(self.places[:-separation], self.places[separation:], strict=True):
            terms = np.column_stack([first, np.ones(len(first))])
            away = second - terms @ np.linalg.lstsq(terms, second, rcond=None)[0]
            squares.append((away**2).sum(axis=1).mean())
        return float(np.sqrt(np.mean(squares)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Matches:
    """Errors of all pairs of frames.

    Attributes
    ----------
    errors
        By share hidden, method and separation, px, shape (pairs,).
    """

    errors: dict[float, dict[str, dict[int, NDArray[np.float64]]]]

    def growth(self, hidden: float, method: str) -> float:
        """By how much the mean error grows from the smallest to the largest separation, px."""
        means = {separation: each.mean() for separation, each in self.errors[hidden][method].items()}
        return float(means[max(means)] - means[min(means)])

    def mean(self, hidden: float, method: str) -> float:
        """Mean error over the separations, px."""
        return float(np.mean([each.mean() for each in self.errors[hidden][method].values()]))


def follow(rng: np.random.Generator | None = None) -> Motion:
    """Landmarks of all frames; nothing is random, ``rng`` is what every study takes."""
    del rng
    pairs = [next(hotel_trials(DATA, separation=separation, count=1)) for separation in range(1, FRAMES)]
    return Motion(places=np.stack([pairs[0].source, *(pair.target[pair.truth] for pair in pairs)]))


def run(
    rng: np.random.Generator | None = None,
    *,
    hidden: Sequence[float] = HIDDEN_FRACTIONS,
    separations: Sequence[int] = SEPARATIONS,
) -> Matches:
    """Match the source's frames by every method; ``rng`` hides landmarks, shuffles, and is what methods draw from."""
    seed = int((rng or np.random.default_rng(1)).integers(2**31))
    methods = {name: BenchmarkMethod(name=name) for name in METHODS}
    errors: dict[float, dict[str, dict[int, NDArray[np.float64]]]] = {}
    for share in hidden:
        errors[share] = {name: {} for name in methods}
        for separation in separations:
            count = 1 + (FRAMES - 1 - separation) // BETWEEN  # starts at the frames 0, 10, 20 ...
            trials = hotel_trials(DATA, separation=separation, hidden=share, count=count, seed=seed)
            rows = run_trials(trials, methods, seed=seed)
            for name in methods:
                errors[share][name][separation] = np.array([row.error for row in rows if row.method == name])
    return Matches(errors=errors)


def motion_values(result: Motion) -> dict[str, float]:
    """Numbers of figure 5.19."""
    return {
        "frames": float(result.places.shape[0]),
        "landmarks a frame": float(result.places.shape[1]),
        "motion over 10 frames": result.rms(10),
        "motion over 100 frames": result.rms(100),
        "left by an affine map, 100 frames": result.left(100),
    }


def match_values(result: Matches) -> dict[str, float]:
    """Numbers of figure 5.20, of those shares that were hidden."""
    clear, most = min(HIDDEN_FRACTIONS), max(HIDDEN_FRACTIONS)
    drift = result.growth(clear, "cpd")
    found = {
        f"growth of the mean error, {METHODS[name]} over CPD, none hidden": result.growth(clear, name) / drift
        for name in METHODS
        if name != "cpd"
    }
    found["growth of the mean error, CPD, none hidden"] = drift
    if most in result.errors:
        for share in (clear, most):
            for name in ("tprl", "cpd"):
                found[f"mean error over the separations, {METHODS[name]}, {share:g} hidden"] = result.mean(share, name)
        ratio = result.mean(most, "tprl") / result.mean(most, "rpm-lns")
        found[f"mean error over the separations, TPRL over RPM-LNS, {most:g} hidden"] = ratio
    return found


def draw_motion(result: Motion, figure: Figure) -> None:
    """Tracks of the landmarks, and how far they move over the separation."""
    tracks, over = figure.subplots(1, 2)
    for track in (result.places - result.places[0]).transpose(1, 2, 0):
        tracks.plot(*track, color="0.5", linewidth=0.8)
        tracks.plot(*track[:, -1], "o", color=COLOURS[0], markersize=3)
    tracks.set(xlabel="x since the first frame / px", ylabel="y since the first frame / px", title="30 landmarks")
    over.plot(SEPARATIONS, [result.rms(each) for each in SEPARATIONS], "o-", color=COLOURS[0], label="motion")
    left = [result.left(each) for each in SEPARATIONS]
    over.plot(SEPARATIONS, left, "s--", color=COLOURS[1], label="left by the best affine map")
    over.set(xlabel="frames between", ylabel="root-mean-square / px")
    over.legend(loc="upper left")


def draw_matches(result: Matches, figure: Figure) -> None:
    """Mean errors and their standard deviations over the separation, a panel a share hidden."""
    axes = figure.subplots(1, len(result.errors), sharey=True, squeeze=False)[0]
    for axis, (share, methods) in zip(axes, result.errors.items(), strict=True):
        for colour, (name, found) in zip(COLOURS, methods.items(), strict=True):
            axis.errorbar(
                list(found),
                [each.mean() for each in found.values()],
                [each.std() for each in found.values()],
                fmt=STYLES[name],
                color=colour,
                markersize=4,
                linewidth=1.2,
                elinewidth=0.6,
                label=METHODS[name],
            )
        axis.set(title=f"{share:g} hidden", xlabel="frames between")
        axis.grid(visible=True, alpha=0.3)
    axes[0].set_ylabel("mean RMS error / px")
    axes[0].set_ylim(bottom=0.0)  # once all have drawn: they share it
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=5)


SHOWN = (
    Shown(name="figure-5-19", run=follow, values=motion_values, draw=draw_motion, needs=DATA / SEQUENCE_FILE),
    Shown(
        name="figure-5-20",
        run=run,
        values=match_values,
        draw=draw_matches,
        short=partial(run, hidden=[0.0], separations=[SEPARATIONS[0], SEPARATIONS[-1]]),
        needs=DATA / SEQUENCE_FILE,
    ),
)


def main() -> None:
    """Print the errors."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.parse_args()
    for share, methods in run().errors.items():
        print(f"{share:g} hidden: mean RMS error in px over 10, 20 ... 100 frames")
        for name, found in methods.items():
            print(f"  {METHODS[name]:<8}" + "".join(f" {each.mean():6.2f}" for each in found.values()))
    print("Research use only")


if __name__ == "__main__":
    main()
