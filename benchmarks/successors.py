"""Phantoms that others have stated, pressed here: our errors beside those that they print.

    python -m benchmarks.successors --repeats 3 --seed 51

The eight spheres are those of table II of V. Egorov and A. Sarvazyan, "Mechanical imaging of the breast", IEEE Trans.
Med. Imaging 27 (2008) 1275-1287: 5 to 18 mm and 10 to 156 kPa, at 10 mm in 35 mm of 5 kPa. They scanned silicone with
an array of pressure sensors; here `benchmarks.simulated_presses` presses the same spheres with a virtual probe of this
package, on a finer mesh of another order than the estimator's, the inclusion on the axis and each repeat by another
probe. Their "depth" is read as that of the top: with the centre at 10 mm the spheres of 18 mm would lie 1 mm deep. So
the table compares two instruments on one list of spheres, and a simulation with an experiment, and no more.

The prior is one box around all eight, `PRIOR`, wider than the list on each side; no other was tried. Beside our error
of E, of means withheld or not, stands the standard deviation of its posterior.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from benchmarks.harness import Bench, Choice
from benchmarks.judgement import compared
from benchmarks.simulated_presses import DEFAULT, PROTOCOLS, Protocol, examine

from tsis.cli.progress import progress_bar
from tsis.inclusion import InclusionPrior, estimate
from tsis.inclusion.prior import PARAMETERS
from tsis.model.phantom import Inclusion, Phantom

DEPTH_MM, THICKNESS_MM, TISSUE_KPA = 10.0, 35.0, 5.0
SPHERES = ((5, 20), (5, 80), (10, 10), (10, 40), (14, 40), (14, 156), (18, 20), (18, 80))  # mm and kPa
EVALUATED = (  # what table II prints of them
    (5.0, 20.0),
    (5.3, 80.0),
    (7.7, 10.0),
    (9.0, 42.0),
    (14.6, 41.0),
    (13.1, 128.0),
    (17.0, 20.0),
    (17.2, 78.0),
)
PRIOR = InclusionPrior(
    diameter_mm=(3.0, 20.0),
    depth_mm=(4.0, 13.0),
    young_kpa=(7.5, 200.0),
    tissue_young_kpa=TISSUE_KPA,
    thickness_mm=THICKNESS_MM,
    thickness_sd=0.05,
    name="eight-spheres",
)
DIGITS = 3


def sphere(number: int) -> Phantom:
    """Sphere ``number`` of the eight, from 0, in its slab."""
    diameter, young = SPHERES[number]
    inclusion = Inclusion(diameter_mm=float(diameter), depth_mm=DEPTH_MM, young_kpa=float(young), poisson=PRIOR.poisson)
    return Phantom(young_kpa=TISSUE_KPA, thickness_mm=THICKNESS_MM, poisson=PRIOR.poisson, inclusion=inclusion)


def judge(protocol: Protocol, seed: int, number: int, repeat: int) -> dict[str, Any]:
    """One repeat of one sphere: pressed, estimated, beside its truth."""
    rng, phantom = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(number, repeat))), sphere(number)
    assert phantom.inclusion is not None  # all eight have one
    pressed = examine(protocol, phantom, rng)
    found = estimate(
        pressed.frames,
        probe=protocol.probe,
        calibration=pressed.calibration,
        reference=pressed.references,
        prior=PRIOR,
        strain=protocol.strain,
    )
    named = [found.identified(name) for name in PARAMETERS]
    return {"number": number, **compared(found, phantom.inclusion), "identified": named}


def relative_errors(values: Any, truth: Any) -> Any:
    """Absolute relative errors in %."""
    return 100 * np.abs(np.asarray(values, dtype=float) / np.asarray(truth, dtype=float) - 1)


def rows_of(lines: list[dict[str, Any]]) -> list[list[str]]:
    """A row a sphere, then mean and median: their errors of d and E, ours of d, h and E, and the sd of E."""
    theirs, every = relative_errors(EVALUATED, SPHERES), _errors(lines)
    rows = []
    for number, (diameter, young) in enumerate(SPHERES):
        ours = [line for line in lines if line["number"] == number]
        spread = 100 * np.sqrt(np.mean([(line["sd"][2] / line["truth"][2]) ** 2 for line in ours]))
        name = f"{diameter} mm, {young} kPa"
        rows.append([name, *_cells(theirs[number]), *_cells(_errors(ours).mean(axis=0)), *_cells([spread])])
    for name, statistic in (("mean", np.mean), ("median", np.median)):
        rows.append([name, *_cells(statistic(theirs, axis=0)), *_cells(statistic(every, axis=0)), ""])
    return rows


def _errors(lines: list[dict[str, Any]]) -> Any:
    return relative_errors([line["mean"] for line in lines], [line["truth"] for line in lines])


def _cells(values: Any) -> list[str]:
    return [f"{value:.{DIGITS}g}" for value in values]


def main() -> int:
    """Print the table."""
    bench = Bench(__doc__, protocol=Choice(PROTOCOLS, DEFAULT), repeats=3, seed=1)
    protocol = PROTOCOLS[bench.protocol]
    cases = [(number, repeat) for repeat in range(bench.repeats) for number in range(len(SPHERES))]
    lines = []
    with progress_bar("eight spheres") as progress:
        for number, repeat in cases:
            lines.append(judge(protocol, bench.seed, number, repeat))
            progress(len(lines), len(cases))
    title = f"eight spheres, relative errors in %, {protocol.name}, {bench.repeats} repeats, seed {bench.seed}"
    bench.table(title, ("sphere", "theirs: d", "E", "ours: d", "h", "E", "posterior sd of E"), rows_of(lines))
    trusted = sum(line["trusted"] for line in lines)
    named = sum(line["identified"][2] for line in lines)
    print(f"of {len(lines)} trusted {trusted}, E identified {named}")
    return bench.end()


if __name__ == "__main__":
    sys.exit(main())
