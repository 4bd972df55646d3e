"""Each prior that has a source, on presses drawn from it: errors beside what the best estimator would err by.

    python -m benchmarks.priors --prior breast-ex-vivo --cases 100 --seed 41
    python -m benchmarks.priors --prior breast-ex-vivo --cases 60 --seed 41 --world uneven

Inclusion, tissue and all nuisances are drawn from the prior as it ships, and pressed by `benchmarks.simulated_presses`
or `benchmarks.worlds` on a mesh that is finer and of another order than the estimator's. World ``uneven`` draws a field
of modulus in each case, of up to 20 % and 2 to 13 mm.

The Bayes bound of a parameter is the least root mean square error that any estimator can have: the root of the mean
posterior variance under the law that the cases were drawn from. It is computed from the same frames by a second
estimate that knows how uneven the world is; the default estimate does not. Its intervals' coverage stands beside it,
for a bound of posteriors that do not hold is none. Finished cases are kept, as in `benchmarks.coverage`.
"""

from __future__ import annotations

import sys
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from benchmarks.coverage import code, counted
from benchmarks.harness import Bench, Choice, Goal, append_line, read_lines
from benchmarks.judgement import Judgement, compared
from benchmarks.press_bank import PressBank
from benchmarks.simulated_presses import DEFAULT, PROTOCOLS
from benchmarks.worlds import RANDOM_SD, WORLDS, World

from tsis.catalog.priors import inclusion_prior_toml, list_inclusion_priors, parse_prior
from tsis.cli.progress import progress_bar
from tsis.errors import TsisError
from tsis.files.cache import cache_folder, content_key
from tsis.inclusion import InclusionPrior, estimate
from tsis.inclusion.prior import PARAMETERS

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

PRIOR_WORLDS = {"uneven": WORLDS["prior"]} | WORLDS
LARGEST_ERROR, LARGEST_RATIO = 3.0, 1.15  # % of the median of d and h; RMSE of E over the bound
AIMS = {"median": 8.0, "mean": 12.0}  # relative error of E, %, of careful presses


def named_prior(name: str) -> InclusionPrior:
    """A shipped prior, as it is."""
    return replace(parse_prior(inclusion_prior_toml(name), InclusionPrior), name=name)


def knowing(prior: InclusionPrior, world: World) -> InclusionPrior:
    """The prior of one who knows how uneven the tissue of a world may be."""
    return replace(prior, heterogeneity_sd=RANDOM_SD[1] if world.sd is None else world.sd)


def judge(bank: PressBank, index: int) -> dict[str, Any]:
    """One case: pressed, estimated under the prior and by one who knows the world, beside its truth."""
    try:
        case = bank.case(index)
        found, informed = (
            estimate(
                case.frames,
                probe=bank.protocol.probe,
                calibration=case.calibration,
                reference=case.references,
                prior=prior,
                strain=bank.strain,
            )
            for prior in (bank.prior, knowing(bank.prior, bank.world))
        )
    except TsisError as error:
        return {"index": index, "refused": str(error)}
    truth = case.phantom.inclusion
    assert truth is not None  # no blanks are drawn here
    best = compared(informed, truth)
    return {
        "index": index,
        **compared(found, truth),
        "identified": [found.identified(name) for name in PARAMETERS],
        "best_sd": best["sd"],
        "best_rank": best["rank"],
    }


def run(
    bank: PressBank, cases: int, *, out: Path | None, workers: int, progress: Callable[[int, int], None] | None = None
) -> list[dict[str, Any]]:
    """Lines of the first ``cases`` in order: those that ``out`` holds, and the rest."""
    found = read_lines(out, "index")
    missing = [index for index in range(cases) if index not in found]
    with ProcessPoolExecutor(max_workers=workers) as pool:
        for future in as_completed([pool.submit(judge, bank, index) for index in missing]):
            line = future.result()
            append_line(out, line)
            found[line["index"]] = line
            if progress is not None:
                progress(sum(index in found for index in range(cases)), cases)
    return [found[index] for index in range(cases)]


@dataclass(frozen=True, slots=True, kw_only=True)
class PriorTable:
    """What the cases of one prior tell, by parameter in the order of `PARAMETERS`; relative errors in %.

    Attributes
    ----------
    relative
        Of the mean, whatever is trusted or identified; shape (cases, 3).
    named
        Whether a parameter is identified, so that its mean is printed; shape (cases, 3).
    rmse, bound, blind
        Root mean square error, the Bayes bound, and the error of always naming the prior's mean, in mm, mm and kPa.
    trusted
        Share of the cases.
    coverage, best_coverage
        Share of the 90 % intervals that hold the truth, of the estimate and of the one that the bound rests on.
    """

    relative: NDArray[np.float64]
    named: NDArray[np.bool]
    rmse: NDArray[np.float64]
    bound: NDArray[np.float64]
    blind: NDArray[np.float64]
    trusted: float
    coverage: NDArray[np.float64]
    best_coverage: NDArray[np.float64]

    @classmethod
    def of(cls, lines: list[dict[str, Any]], prior: InclusionPrior) -> PriorTable:
        """From the lines of `judge` that hold an estimate."""
        kept = [line for line in lines if "refused" not in line]
        judged = Judgement.of(kept)
        best = {name: np.array([line[f"best_{name}"] for line in kept], dtype=float) for name in ("sd", "rank")}
        return cls(
            relative=100 * np.abs(judged.mean / judged.truth - 1),
            named=np.array([line["identified"] for line in kept], dtype=bool),
            rmse=np.sqrt(((judged.mean - judged.truth) ** 2).mean(axis=0)),
            bound=np.sqrt((best["sd"] ** 2).mean(axis=0)),
            blind=np.sqrt((((prior.low + prior.high) / 2 - judged.truth) ** 2).mean(axis=0)),
            trusted=1 - judged.distrusted / len(kept),
            coverage=judged.coverage(0.9),
            best_coverage=np.asarray((np.abs(2 * best["rank"] - 1) <= 0.9).mean(axis=0)),
        )

    def named_relative(self, statistic: Callable[..., Any]) -> list[float]:
        """A statistic of the relative errors of the means that are not withheld as unidentified, by parameter."""
        columns = zip(self.relative.T, self.named.T, strict=True)
        return [float(statistic(errors[named])) if named.any() else float("nan") for errors, named in columns]

    def numbers(self) -> dict[str, list[float]]:
        """Rows by name, a number a parameter."""
        return {
            "median relative error, %": np.median(self.relative, axis=0).tolist(),
            "mean relative error, %": self.relative.mean(axis=0).tolist(),
            "median where identified, %": self.named_relative(np.median),
            "mean where identified, %": self.named_relative(np.mean),
            "identified, %": (100 * self.named.mean(axis=0)).tolist(),
            "RMSE": self.rmse.tolist(),
            "Bayes bound": self.bound.tolist(),
            "RMSE / bound": (self.rmse / self.bound).tolist(),
            "standard error of RMSE / bound": (self.rmse / self.bound / np.sqrt(2 * len(self.relative))).tolist(),
            "RMSE of the prior's mean": self.blind.tolist(),
            "90 % interval holds, %": (100 * self.coverage).tolist(),
            "the bound's 90 % interval holds, %": (100 * self.best_coverage).tolist(),
        }

    def wanted(self) -> list[Goal]:
        """What is asked of the priors."""
        middle = np.median(self.relative, axis=0)
        ratio = float(self.rmse[2] / self.bound[2])
        return [
            Goal(name="median error of d, %", value=float(middle[0]), most=LARGEST_ERROR),
            Goal(name="median error of h, %", value=float(middle[1]), most=LARGEST_ERROR),
            Goal(name="RMSE of E over the Bayes bound", value=ratio, most=LARGEST_RATIO, form="{:.2f}"),
            Goal(name="median error of E, %", value=float(middle[2]), most=AIMS["median"]),
            Goal(name="mean error of E, %", value=float(self.relative[:, 2].mean()), most=AIMS["mean"]),
        ]


def kept_at(folder: Path, bank: PressBank) -> Path:
    """File of the finished cases, named by all that decides them."""
    decided_by = bank.content() | {"prior": asdict(bank.prior), "code": code()}
    return folder / f"{bank.prior.name}-{bank.name}-{content_key(decided_by)}.jsonl"


def main() -> int:
    """Print the table; the exit code is 1 where a number that is asked for is missed."""
    bench = Bench(
        __doc__,
        prior=Choice(list_inclusion_priors(), "breast-ex-vivo"),
        cases=100,
        seed=1,
        world=Choice(PRIOR_WORLDS, "as-model"),
        protocol=Choice(PROTOCOLS, DEFAULT),
        frames=Path,
        kept=cache_folder() / "priors",
        workers=1,
    )
    bank = PressBank(
        protocol=PROTOCOLS[bench.protocol],
        prior=named_prior(bench.prior),
        seed=bench.seed,
        world=PRIOR_WORLDS[bench.world],
        folder=bench.frames,
    )
    with progress_bar(f"{bench.prior}, {bench.world}") as progress:
        out = kept_at(bench.kept, bank)
        lines = run(bank, bench.cases, out=out, workers=bench.workers, progress=progress)
    if all("refused" in line for line in lines):
        print(f"no estimate at all: {counted(Judgement.of(lines).refused)}", file=sys.stderr)
        return 1
    table = PriorTable.of(lines, bank.prior)
    title = f"{bench.prior}, world {bench.world}, {bench.protocol}, {len(lines)} cases, seed {bench.seed}"
    rows = [[name, *(f"{value:.3g}" for value in values)] for name, values in table.numbers().items()]
    bench.table(title, ("", "d", "h", "E"), rows)
    print(f"trusted: {table.trusted:.0%}; refused: {counted(Judgement.of(lines).refused)}")
    return bench.end(table.wanted())


if __name__ == "__main__":
    sys.exit(main())
