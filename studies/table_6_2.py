"""Table 6.2: the nine inclusions by the source's networks, and by the posterior, on the same nine.

The networks are those of `studies.section_6_3`. The posterior is `tsis.inclusion.estimate`, from one press of 1 N and
one beside it, which is what the networks are given too, and by the domed probe's two forces; each time in another
tissue and by another virtual probe, as `benchmarks.nine_inclusions` has it with more repeats. The posterior allows for
uneven tissue, which these are not: the same frames are estimated once more by one that is told so, as the networks are
by what they learn from. Four of the printed errors are not those of the estimates beside them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from benchmarks.nine_inclusions import INCLUSIONS, NineInclusions, inclusion, posterior_mean
from benchmarks.simulated_presses import PROTOCOLS
from studies.section_6_3 import PRINTED, ROUTES, relative_error
from studies.section_6_3 import run as train_networks
from studies.shown import Shown

from tsis.inclusion.prior import PARAMETERS, InclusionPrior

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.figure import Figure
    from numpy.typing import NDArray

REPEATS = 3
POSTERIORS = {"flat": "posterior, flat probe", "domed": "posterior, domed probe"}
EVEN, TOLD_EVEN = InclusionPrior(heterogeneity_sd=0.0), "posterior told that the tissue is even, flat probe"
MARKS = {"flat": ("^", "#009e73"), "domed": ("D", "#cc79a7")}
NAMES = ("size", "depth", "modulus")
UNITS = ("mm", "mm", "kPa")
SLIPS = {"size of row 5": (4, 0), "size of row 6": (5, 0), "depth of row 9": (8, 1)}  # and 0.05 of size in row 8


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Estimates:
    """Of the nine inclusions.

    Attributes
    ----------
    truth
        Size, depth and modulus, shape (9, 3).
    networks
        Mean over trials, shape (9, 3); None where none were trained.
    posteriors
        By protocol.
    told_even
        Of the flat probe's frames, by a prior of even tissue; None where they were not estimated again.
    """

    truth: NDArray[np.float64]
    networks: NDArray[np.float64] | None
    posteriors: Mapping[str, NineInclusions]
    told_even: NineInclusions | None = None


def run(rng: np.random.Generator) -> Estimates:
    """Networks, and both probes' posteriors."""
    networks = train_networks(rng, routes=ROUTES[:1]).estimates[ROUTES[0]].mean(axis=0)
    seed = int(rng.integers(2**31))
    return Estimates(
        truth=_truth(),
        networks=networks,
        posteriors={name: examined(name, seed, REPEATS) for name in POSTERIORS},
        told_even=examined("flat", seed, REPEATS, EVEN),
    )


def short(rng: np.random.Generator) -> Estimates:
    """The flat probe's posterior alone, once."""
    seed = int(rng.integers(2**31))
    return Estimates(truth=_truth(), networks=None, posteriors={"flat": examined("flat", seed, 1)})


def examined(protocol: str, seed: int, repeats: int, prior: InclusionPrior | None = None) -> NineInclusions:
    """Posterior means of repeated examinations of the nine."""
    means = [
        [posterior_mean(PROTOCOLS[protocol], seed, number, repeat, prior) for repeat in range(repeats)]
        for number in range(INCLUSIONS)
    ]
    return NineInclusions(truth=_truth(), means=np.array(means))


def _truth() -> NDArray[np.float64]:
    return np.array([[getattr(inclusion(number), name) for name in PARAMETERS] for number in range(INCLUSIONS)])


def values(result: Estimates) -> dict[str, float]:
    """Mean relative errors, and printed errors computed again from the printed estimates, in per cent."""
    found: dict[str, float] = {}
    means = {} if result.networks is None else {"networks": relative_error(result.networks, result.truth).mean(axis=0)}
    means |= {POSTERIORS[name]: nine.mean_error for name, nine in result.posteriors.items()}
    if result.told_even is not None:
        means[TOLD_EVEN] = result.told_even.mean_error
    for method, errors in means.items():
        for name, error in zip(NAMES, errors, strict=True):
            found[f"mean error of {name}, {method}"] = float(error)
    again = relative_error(PRINTED, result.truth)
    return found | {f"printed estimate's error, {name}": float(again[place]) for name, place in SLIPS.items()}


def draw(result: Estimates, figure: Figure) -> None:
    """Estimates of each inclusion beside its truth; the posterior's means over repeats."""
    axes = figure.subplots(1, 3)
    number = np.arange(1, INCLUSIONS + 1)
    for column, (axis, name, unit) in enumerate(zip(axes, NAMES, UNITS, strict=True)):
        axis.plot(number, result.truth[:, column], "_", color="black", markersize=16, mew=2, label="true")
        axis.plot(number - 0.25, PRINTED[:, column], "s", mfc="none", color="#d55e00", label="printed")
        if result.networks is not None:
            axis.plot(
                number - 0.08, result.networks[:, column], "o", color="#0072b2", markersize=4, label="networks here"
            )
        for shift, (protocol, nine) in zip((0.08, 0.25), result.posteriors.items(), strict=False):
            mark, colour = MARKS[protocol]
            ours, spread = nine.means[:, :, column].mean(axis=1), nine.means[:, :, column].std(axis=1)
            axis.errorbar(
                number + shift, ours, spread, fmt=mark, color=colour, markersize=4, lw=1, label=POSTERIORS[protocol]
            )
        axis.set(xlabel="inclusion", ylabel=f"{name} / {unit}", xticks=number)
        axis.set_ylim(bottom=0.0)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=5, fontsize=8)


SHOWN = (Shown(name="table-6-2", run=run, short=short, values=values, draw=draw),)
