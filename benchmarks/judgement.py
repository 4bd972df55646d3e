"""Estimates beside truths: how often intervals hold, how far means err, and whether they err as much as they say."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.stats import binomtest, kstest

from tsis.inclusion.prior import PARAMETERS

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from numpy.typing import NDArray

    from tsis.inclusion import InclusionPrior
    from tsis.model.estimate import Estimate
    from tsis.model.phantom import Inclusion

LEVELS = (0.5, 0.9)
CONFIDENCE = 0.95  # of the intervals around a measured coverage
CLAIM = (0.88, 0.92)  # between which the coverage of 90 % intervals has to lie


def compared(result: Estimate, truth: Inclusion) -> dict[str, Any]:
    """One estimate beside its truth, as a line of JSON can hold it.

    ``rank`` is the share of the samples below the truth: an equal-tailed interval of level L holds the truth when the
    rank lies within L / 2 of one half, and over many cases the ranks of honest samples are uniform.
    """
    true = {name: float(getattr(truth, name)) for name in PARAMETERS}
    below = {name: float(np.mean(result.untrusted.samples[name] < value)) for name, value in true.items()}
    ties = {name: float(np.mean(result.untrusted.samples[name] == value)) for name, value in true.items()}
    return {
        "truth": [true[name] for name in PARAMETERS],
        "mean": [result.untrusted.mean[name] for name in PARAMETERS],
        "sd": [result.untrusted.sd[name] for name in PARAMETERS],
        "rank": [below[name] + ties[name] / 2 for name in PARAMETERS],
        "trusted": result.trusted,
        "flags": list(result.flags),
    }


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Judgement:
    """Many estimates beside their truths.

    Attributes
    ----------
    truth, mean, sd, rank
        Shape (cases, 3) each; see `compared`.
    distrusted
        How many estimates say of themselves that they must not be trusted; they count like the others.
    flags
        How many estimates carry each flag.
    refused
        How many cases were refused for each reason.
    """

    truth: NDArray[np.float64]
    mean: NDArray[np.float64]
    sd: NDArray[np.float64]
    rank: NDArray[np.float64]
    distrusted: int
    flags: Mapping[str, int]
    refused: Mapping[str, int]

    @classmethod
    def of(cls, lines: Iterable[Mapping[str, Any]]) -> Judgement:
        """From lines as `compared` makes them, and lines that hold only why a case was ``refused``."""
        every = list(lines)
        kept = [line for line in every if "refused" not in line]
        columns = {
            name: np.array([line[name] for line in kept], dtype=float).reshape(-1, len(PARAMETERS))
            for name in ("truth", "mean", "sd", "rank")
        }
        return cls(
            **columns,
            distrusted=sum(not line["trusted"] for line in kept),
            flags=dict(sorted(Counter(flag for line in kept for flag in line["flags"]).items())),
            refused=dict(sorted(Counter(line["refused"] for line in every if "refused" in line).items())),
        )

    def holds(self, level: float) -> NDArray[np.bool]:
        """Whether the equal-tailed interval of ``level`` holds the truth, shape (cases, 3)."""
        return np.asarray(np.abs(2 * self.rank - 1) <= level)

    def coverage(self, level: float) -> NDArray[np.float64]:
        """Share of the cases whose interval of ``level`` holds the truth, by parameter."""
        return np.asarray(self.holds(level).mean(axis=0))

    def coverage_bounds(self, level: float) -> NDArray[np.float64]:
        """Wilson's 95 % interval of each coverage, shape (3, 2)."""
        held = self.holds(level)
        found = (binomtest(int(one.sum()), len(one)).proportion_ci(CONFIDENCE, method="wilson") for one in held.T)
        return np.array([(one.low, one.high) for one in found])

    def summary(self, prior: InclusionPrior) -> dict[str, dict[str, Any]]:
        """The table's numbers, by parameter.

        ``rmse_over_prior_mean`` is the root of the mean square error over that of always naming the prior's mean, below
        1 when a press tells anything; ``rmse_over_sd`` the same over the root of the mean posterior variance, 1 for
        honest samples; ``uniform_ranks`` the chance (Kolmogorov, Smirnov) of ranks this uneven from honest samples.
        """
        rmse = np.sqrt(((self.mean - self.truth) ** 2).mean(axis=0))
        relative = 100 * np.abs(self.mean / self.truth - 1)
        blind = np.sqrt((((prior.low + prior.high) / 2 - self.truth) ** 2).mean(axis=0))
        sd = np.sqrt((self.sd**2).mean(axis=0))
        rows: dict[str, dict[str, Any]] = {}
        for i, name in enumerate(PARAMETERS):
            rows[name] = {}
            for level in LEVELS:
                rows[name][f"coverage_{100 * level:.0f}"] = float(self.coverage(level)[i])
                rows[name][f"coverage_{100 * level:.0f}_within"] = self.coverage_bounds(level)[i].tolist()
            rows[name] |= {
                "median_error_percent": float(np.median(relative[:, i])),
                "mean_error_percent": float(relative[:, i].mean()),
                "rmse": float(rmse[i]),
                "prior_mean_rmse": float(blind[i]),
                "rmse_over_prior_mean": float(rmse[i] / blind[i]),
                "mean_sd": float(sd[i]),
                "rmse_over_sd": float(rmse[i] / sd[i]),
                "median_narrowing": float(np.median(self.sd[:, i])) / prior.sd[name],
                "uniform_ranks": float(kstest(self.rank[:, i], "uniform").pvalue),
            }
        return rows

    def keeps_the_claim(self) -> bool:
        """False when a coverage of 90 % intervals lies outside the claim by more than chance explains."""
        low, high = self.coverage_bounds(0.9).T
        return bool(((high >= CLAIM[0]) & (low <= CLAIM[1])).all())


def rows_of(summary: Mapping[str, Mapping[str, Any]]) -> list[list[str]]:
    """The summary for people, a line a number and a column a parameter; intervals stand beside their coverage."""
    columns = list(summary.values())
    names = [name for name in columns[0] if not name.endswith("_within")]
    return [[name.replace("_", " "), *(_cell(column, name) for column in columns)] for name in names]


def _cell(column: Mapping[str, Any], name: str) -> str:
    within = column.get(f"{name}_within")
    if within is None:
        return f"{column[name]:.3g}"
    return "{:.1%} ({:.1f}-{:.1f})".format(column[name], *(100 * bound for bound in within))
