"""What each nuisance of an inclusion estimate costs in width, and what leaving it out costs in coverage.

    python -m benchmarks.ablation --world prior --cases 24 --seed 86001

The same frames are estimated by the full model, and by models that each take one nuisance as known. Printed are the
mean standard deviations over the full model's, and how many 90 % intervals held. Frames are those of
`benchmarks.coverage`; tables are the full model's.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from benchmarks.harness import Bench, Choice
from benchmarks.press_bank import PressBank
from benchmarks.simulated_presses import DEFAULT, PROTOCOLS
from benchmarks.worlds import WORLDS

from tsis.cli.progress import progress_bar
from tsis.compiled import one_blas_thread
from tsis.errors import TsisError
from tsis.inclusion import InclusionPrior
from tsis.inclusion.posterior.exploration import explore_inclusion
from tsis.inclusion.prior import PARAMETERS
from tsis.inclusion.reading import press_tables, read_frames

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from tsis.inclusion.reading import PressTables

KNOWN = 1e-4  # standard deviation of what is taken as known


@dataclass(frozen=True, slots=True, kw_only=True)
class Model:
    """A model that differs from the full one: fields of calibration and prior, and whether tissue may be uneven."""

    name: str
    calibration: Mapping[str, float]
    prior: Mapping[str, float]

    @property
    def even(self) -> bool:
        """Whether tissue is taken to be even."""
        return self.prior.get("heterogeneity_sd") == 0.0


def _known(name: str, *, calibration: tuple[str, ...] = (), prior: tuple[str, ...] = (), sd: float = KNOWN) -> Model:
    return Model(name=name, calibration=dict.fromkeys(calibration, sd), prior=dict.fromkeys(prior, sd))


MODELS = (
    _known("the full model"),
    _known("gain", calibration=("gain_sd",)),
    _known("forces", calibration=("force_sd",)),
    _known("offsets", calibration=("offset_sd",)),
    _known("light on a dent", calibration=("shading_sd",)),
    _known("patterns", calibration=("pattern_sd", "repeatability_sd")),
    _known("layers of the probe", calibration=("probe_young_sd",)),
    _known("reference site's modulus", calibration=("site_sd",)),
    _known("modulus of the tissue", prior=("tissue_young_sd",)),
    _known("thickness of the slab", prior=("thickness_sd",)),
    _known("Poisson's ratio", prior=("poisson_sd",)),
    _known("place (on the axis)", prior=("offset_sd_mm",)),
    _known("uneven tissue and layers (even)", prior=("heterogeneity_sd",), sd=0.0),
)


def spread(bank: PressBank, index: int, tables: PressTables) -> list[tuple[NDArray[np.float64], NDArray[np.bool_]]]:
    """Standard deviation, and whether the 90 % interval holds, of each parameter under each of `MODELS`."""
    case, found = bank.case(index), []
    truth = [getattr(case.phantom.inclusion, name) for name in PARAMETERS]
    for model in MODELS:
        prior = replace(bank.prior, **dict[str, Any](model.prior))
        with one_blas_thread():
            reading = read_frames(
                list(case.frames),
                list(case.references),
                replace(tables, field=None) if model.even else tables,
                probe=bank.protocol.probe,
                calibration=replace(case.calibration, **dict[str, Any](model.calibration)),
                prior=prior,
            )
            samples = explore_inclusion(reading.likelihood, prior).samples
        low, high = np.quantile(samples, [0.05, 0.95], axis=0)
        found.append((samples.std(axis=0), (low <= truth) & (truth <= high)))
    return found


def main() -> int:
    """Print the table."""
    bench = Bench(__doc__, world=Choice(WORLDS, "prior"), cases=24, seed=86001)
    prior, protocol, world = InclusionPrior(), PROTOCOLS[DEFAULT], WORLDS[bench.world]
    bank = PressBank(protocol=protocol, prior=prior, seed=bench.seed, world=world)
    tables = press_tables(protocol.probe, prior, bank.strain)
    found = []
    with progress_bar("estimating") as progress:
        for index in range(bench.cases):
            try:
                found.append(spread(bank, index, tables))
            except TsisError as error:
                print(f"case {index}: {error}")
            progress(index + 1, bench.cases)
    sd = np.array([[one[0] for one in case] for case in found]).mean(axis=0)
    held = np.array([[one[1] for one in case] for case in found]).sum(axis=0)
    rows = [
        [model.name, " / ".join(f"{value:.2f}" for value in width), " / ".join(str(count) for count in counts)]
        for model, width, counts in zip(MODELS, sd / sd[0], held, strict=True)
    ]
    width = ", ".join(f"{name} {value:.3g}" for name, value in zip(PARAMETERS, sd[0], strict=True))
    bench.table(
        f"world {bench.world}, seed {bench.seed}; mean sd of the full model: {width}",
        ("known", "mean sd over the full model's, d / h / E", f"90 % holds, of {len(found)}"),
        rows,
    )
    return bench.end()


if __name__ == "__main__":
    sys.exit(main())
