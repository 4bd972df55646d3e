"""Figure 5.21: 1,000 corners of a picture, warped, among 1,000 to 3,000 outliers.

The source takes 1,000 corners from a picture of straw, warps them at random, adds outliers, and prints errors of TPRL
and of coherent point drift in mm of an unknown scale; only their ratio can be compared. Neither the picture nor the
warp is published: here the corners of scikit-image's picture of grass are bent a little.

Found: corners that keep apart have alike surroundings everywhere, and among as many outliers as points or more no
method here comes near the pairs. Both say so: their answers are withheld as unreliable.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from benchmarks.matching.distort import Distortion, distort
from benchmarks.matching.trials import matching_error
from skimage import data
from skimage.feature import corner_peaks, corner_shi_tomasi
from studies.shown import Shown

from tsis.matching import register

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure
    from numpy.typing import NDArray

METHODS = {"tprl": "TPRL", "cpd": "CPD"}
CORNERS = 1000
RATIOS = (1.0, 2.0, 3.0)  # outliers over corners
BENDING = 0.02


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Result:
    """Errors of both methods.

    Attributes
    ----------
    corners
        Where they are, unit box, shape (n, 2).
    start
        Error before any matching, by outliers over corners.
    error
        After it, by method and the same.
    reliable
        How many answers the methods themselves call reliable.
    """

    corners: NDArray[np.float64]
    start: dict[float, float]
    error: dict[str, dict[float, float]]
    reliable: int


def corners() -> NDArray[np.float64]:
    """The strongest corners of the picture that keep apart, in the unit box, shape (`CORNERS`, 2)."""
    picture = data.grass()  # type: ignore[no-untyped-call]
    strength = corner_shi_tomasi(picture, sigma=1.5)  # type: ignore[no-untyped-call]
    found = corner_peaks(  # type: ignore[no-untyped-call]
        strength, min_distance=5, num_peaks=CORNERS, threshold_rel=0.0, exclude_border=8
    )
    return np.asarray(found[:, ::-1] / max(picture.shape) * 0.75 + 0.125)


def run(rng: np.random.Generator | None = None, *, ratios: Sequence[float] = RATIOS) -> Result:
    """Warp the corners, add outliers, match by both methods."""
    rng = rng or np.random.default_rng(1)
    points = corners()
    start: dict[float, float] = {}
    error: dict[str, dict[float, float]] = {name: {} for name in METHODS}
    reliable, seed = 0, int(rng.integers(2**31))
    for ratio in ratios:  # one warp, among ever more outliers
        trial = distort(points, Distortion(bending=BENDING, outlier_ratio=ratio), rng=np.random.default_rng(seed))
        start[ratio] = matching_error(trial, trial.source)
        for name in METHODS:
            found = register(trial.source, trial.target, method=name, rng=rng)
            error[name][ratio] = matching_error(trial, found.untrusted.moved)
            reliable += found.reliable
    return Result(corners=points, start=start, error=error, reliable=reliable)


def values(result: Result) -> dict[str, float]:
    """Ratios of errors, and what they are ratios of."""
    found = {"answers called reliable": float(result.reliable)} if len(result.start) == len(RATIOS) else {}
    for ratio, start in result.start.items():
        tprl, drift = (result.error[name][ratio] for name in METHODS)
        size = f"1000 x {CORNERS + int(ratio * CORNERS)}"
        found[f"error of TPRL over that of CPD, {size}"] = tprl / drift
        found[f"error of TPRL over that before matching, {size}"] = tprl / start
    return found


def draw(result: Result, figure: Figure) -> None:
    """The corners, and errors over the outliers."""
    where, over = figure.subplots(1, 2)
    where.plot(*result.corners.T, ".", color="0.3", markersize=2)
    where.set(aspect="equal", xlabel="x", ylabel="y", title=f"{len(result.corners)} corners")
    for (name, label), style in zip(METHODS.items(), ("v-", "o--"), strict=True):
        over.plot([CORNERS * ratio for ratio in result.start], list(result.error[name].values()), style, label=label)
    over.plot(
        [CORNERS * ratio for ratio in result.start], list(result.start.values()), ":", color="0.4", label="before"
    )
    over.set(xlabel="outliers", ylabel="root-mean-square error, unit box", ylim=(0.0, None))
    over.legend()


SHOWN = (Shown(name="figure-5-21", run=run, values=values, draw=draw, short=partial(run, ratios=RATIOS[:1])),)


def main() -> None:
    """Print the errors."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.parse_args()
    for name, found in values(run()).items():
        print(f"{name}: {found:.3f}")
    print("Research use only")


if __name__ == "__main__":
    main()
