"""Phantoms that others have stated, pressed here: our errors beside those that they print.

    python -m benchmarks.successors --repeats 3 --seed 51

The eight spheres are those of table II of V. Egorov and A. Sarvazyan, "Mechanical imaging of the breast", IEEE Trans.
Med. Imaging 27 (2008) 1275-1287: 5 to 18 mm and 10 to 156 kPa, at 10 mm in 35 mm of 5 kPa. They scanned silicone with
an array of pressure sensors; here `benchmarks.simulated_presses` presses the same spheres with a virtual probe of this
package, on a finer mesh of another order than the estimator's, the inclusion on the axis and each repeat by another
probe. Their "depth" is read as that of the top: with the centre at 10 mm the spheres of 18 mm would lie 1 mm deep. So
the table compares two instruments on one list of spheres, and a simulation with an experiment, and no more.

The prior is one box around all eight, `PRIOR`, wider than the list on each side; no other was tried. Beside our error
of E, of means withheld or not, stands the standard deviation of its posterior. Finished cases are kept.
"""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from typing import Any

import numpy as np
from benchmarks.coverage import code
from benchmarks.harness import Bench, Choice, append_line, read_lines
from benchmarks.judgement import compared
from benchmarks.simulated_presses import DEFAULT, PROTOCOLS, Protocol, examine

from tsis.cli.progress import progress_bar
from tsis.errors import TsisError
from tsis.files.cache import cache_folder, content_key
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
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(number, repeat)))
    phantom, case = sphere(number), f"{number}-{repeat}"
    assert phantom.inclusion is not None  # all eight have one
    try:
        pressed = examine(protocol, phantom, rng)
        found = estimate(
            pressed.frames,
            probe=protocol.probe,
            calibration=pressed.calibration,
            reference=pressed.references,
            prior=PRIOR,
            strain=protocol.strain,
        )
    except TsisError as error:
        return {"case": case, "refused": str(error)}
    named = [found.identified(name) for name in PARAMETERS]
    return {"case": case, "number": number, **compared(found, phantom.inclusion), "identified": named}


def relative_errors(values: Any, truth: Any) -> Any:
    """Absolute relative errors in %."""
    return 100 * np.abs(np.asarray(values, dtype=float) / np.asarray(truth, dtype=float) - 1)


def sphere_rows(lines: list[dict[str, Any]]) -> list[list[str]]:
    """A row a sphere: truth, their error of d and E, ours of d, h, E, the sd of E, how often E is identified."""
    rows = []
    for number, (truth, theirs) in enumerate(zip(SPHERES, EVALUATED, strict=True)):
        ours = [line for line in lines if line.get("number") == number]
        printed = [f"{error:.{DIGITS}g}" for error in relative_errors(theirs, truth)]
        name = f"{truth[0]} mm, {truth[1]} kPa"
        if not ours:
            rows.append([name, *printed, "", "", "", "", "refused", ""])
            continue
        errors = relative_errors([line["mean"] for line in ours], [line["truth"] for line in ours]).mean(axis=0)
        spread = 100 * np.sqrt(np.mean([(line["sd"][2] / line["truth"][2]) ** 2 for line in ours]))
        named, trusted = (
            sum(flags) for flags in ([line["identified"][2] for line in ours], [line["trusted"] for line in ours])
        )
        cells = [f"{value:.{DIGITS}g}" for value in (*errors, spread)]
        rows.append([name, *printed, *cells, f"{named} of {len(ours)}", f"{trusted} of {len(ours)}"])
    return rows


def totals(lines: list[dict[str, Any]]) -> list[list[str]]:
    """Mean and median over all cases, theirs over their eight."""
    kept = [line for line in lines if "refused" not in line]
    theirs = relative_errors(EVALUATED, SPHERES)
    ours = relative_errors([line["mean"] for line in kept], [line["truth"] for line in kept])
    named = np.array([line["identified"][2] for line in kept], dtype=bool)
    rows = []
    for name, statistic in (("mean", np.mean), ("median", np.median)):
        cells = [f"{value:.{DIGITS}g}" for value in (*statistic(theirs, axis=0), *statistic(ours, axis=0))]
        where = f"{statistic(ours[named, 2]):.{DIGITS}g} where identified" if named.any() else ""
        rows.append([name, *cells, "", where, ""])
    return rows


def main() -> int:
    """Print the table."""
    bench = Bench(__doc__, protocol=Choice(PROTOCOLS, DEFAULT), repeats=3, seed=1, kept=cache_folder() / "successors")
    protocol = PROTOCOLS[bench.protocol]
    decided_by = {"protocol": asdict(protocol), "seed": bench.seed, "prior": asdict(PRIOR), "code": code()}
    out = bench.kept / f"spheres-{protocol.name}-{content_key(json.loads(json.dumps(decided_by)))}.jsonl"
    cases = [(number, repeat) for repeat in range(bench.repeats) for number in range(len(SPHERES))]
    found = read_lines(out, "case")
    with progress_bar("eight spheres") as progress:
        for done, (number, repeat) in enumerate(cases, 1):
            if f"{number}-{repeat}" not in found:
                line = judge(protocol, bench.seed, number, repeat)
                append_line(out, line)
                found[line["case"]] = line
            progress(done, len(cases))
    lines = [found[f"{number}-{repeat}"] for number, repeat in cases]
    title = f"eight spheres, relative errors in %, {protocol.name}, {bench.repeats} repeats, seed {bench.seed}"
    heads = ("sphere", "theirs: d", "E", "ours: d", "h", "E", "posterior sd of E", "E identified", "trusted")
    bench.table(title, heads, sphere_rows(lines) + totals(lines))
    for line in lines:
        if "refused" in line:
            print(f"{line['case']}: {line['refused']}")
    return bench.end()


if __name__ == "__main__":
    sys.exit(main())
