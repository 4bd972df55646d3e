"""What more presses of one examination tell: intervals by the forces and repeats, under the estimate's model.

    python -m benchmarks.careful

The information of each protocol at inclusions spread over the default prior, with all nuisances, a superficial layer
that is hardly one, and tissue of three degrees of unevenness. Printed is the expected standard deviation of diameter,
depth and modulus over that of the usual protocol, the geometric mean over the inclusions, and the operator's time.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import numpy as np
from benchmarks.harness import Bench
from rich.progress import track

import tsis
from tsis.inclusion import InclusionPrior
from tsis.inclusion.design.information import even_inclusions, protocol_information
from tsis.inclusion.design.protocol import protocol_of
from tsis.inclusion.tissue import operator_time_s, protocol_forces
from tsis.virtual.probe import VirtualProbe

if TYPE_CHECKING:
    from numpy.typing import NDArray

USUAL = protocol_forces(tsis.load_probe("tsis-domed"), tissue_young_kpa=5.0)
CAREFUL = protocol_forces(tsis.load_probe("tsis-domed"), tissue_young_kpa=5.0, careful=True)
PROTOCOLS = {
    "usual": USUAL,
    "one force between": tuple(np.geomspace(USUAL[0], USUAL[1], 3).tolist()),
    "each twice": 2 * USUAL,
    "eight forces": tuple(np.geomspace(USUAL[0], USUAL[1], 8).tolist()),
    "careful": CAREFUL,
}
UNEVEN = ((0.0, 5.0), (0.04, 5.0), (0.1, 5.0))  # standard deviation and correlation length in mm


def expected_sd(
    forces_n: tuple[float, ...], sd: float, length_mm: float, inclusions: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Expected standard deviations (n, 3) at inclusions, in tissue of one unevenness."""
    probe, prior = tsis.load_probe("tsis-domed"), InclusionPrior()
    calibration = VirtualProbe(probe, rng=np.random.default_rng(0), strain="small").calibration
    information = protocol_information(
        protocol_of(probe, forces_n),
        prior=prior,
        calibration=calibration,
        inclusions=inclusions,
        unevenness=(sd, length_mm),
    ).matrix
    precision = np.diag(1 / np.array(list(prior.sd.values())) ** 2)
    return np.sqrt(np.diagonal(np.linalg.inv(information + precision), axis1=1, axis2=2))


def main() -> int:
    """Print the table."""
    bench = Bench(__doc__, inclusions=12)
    inclusions = even_inclusions(InclusionPrior(), bench.inclusions)
    usual = [expected_sd(USUAL, sd, length, inclusions) for sd, length in UNEVEN]
    rows = []
    for name, forces in track(PROTOCOLS.items(), transient=True):
        ratios = [
            np.exp(np.log(expected_sd(forces, *uneven, inclusions) / before).mean(axis=0))
            for uneven, before in zip(UNEVEN, usual, strict=True)
        ]
        cells = [" / ".join(f"{value:.2f}" for value in ratio) for ratio in ratios]
        rows.append([name, str(len(forces)), f"{operator_time_s(len(forces)) / 60:.0f} min", *cells])
    heads = ("protocol", "presses a site", "time", *(f"uneven by {100 * sd:g} %" for sd, _ in UNEVEN))
    bench.table("expected widths of d / h / E over the usual protocol's", heads, rows)
    return bench.end()


if __name__ == "__main__":
    sys.exit(main())
