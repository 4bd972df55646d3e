"""What the checks of the pictures say about ordinary presses, about presses that are not round, and how long they take.

    python benchmarks/image_checks.py --presses 50 --seed 1

Each ordinary press draws a phantom from a list and a virtual probe with its own gain, stiffness, pattern, traced light
and stray light; its reference is pressed by the same probe. Virtual patterns are round: so each pair is looked at once
more with patterns of the calibrated size that vary around the axis as much as along the radius.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections import Counter
from dataclasses import dataclass, replace
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

import tsis
from tsis.errors import MissingExtraError
from tsis.inclusion.checks import RINGS, SECTORS, image_findings, roundness, sector_means, tilt_evidence
from tsis.virtual.probe import VirtualProbe

if TYPE_CHECKING:
    from numpy.typing import NDArray

PHANTOMS = ("plain", "size-2", "size-8", "size-14", "depth-4", "depth-8", "hardness-40", "hardness-100")
PROBES, FORCES_N = ("tsis-2011", "tsis-domed"), (0.5, 1.0)
LUMP = tsis.Inclusion(diameter_mm=6.0, depth_mm=5.0, young_kpa=100.0)
SLAB = tsis.Phantom(young_kpa=5.0, thickness_mm=30.0)


def pair_of_lumps(apart_mm: float) -> tsis.Phantom:
    one, other = (replace(LUMP, offset_mm=(side * apart_mm / 2, 0.0)) for side in (1, -1))
    return replace(SLAB, inclusion=one, more_inclusions=(other,))


UNUSUAL = {
    "two of 6 mm, 8 mm apart": pair_of_lumps(8.0),
    "two of 6 mm, 10 mm apart": pair_of_lumps(10.0),
    "ellipsoid 16 x 8 x 8 mm": replace(SLAB, inclusion=replace(LUMP, semi_axes_mm=(8.0, 4.0, 4.0))),
    "ellipsoid 8 x 4 x 4 mm": replace(SLAB, inclusion=replace(LUMP, semi_axes_mm=(4.0, 2.0, 2.0))),
    "one of 8 mm, 1 mm off the axis": replace(SLAB, inclusion=replace(LUMP, diameter_mm=8.0, offset_mm=(1.0, 0.0))),
    "one of 14 mm, 1 mm off the axis": replace(SLAB, inclusion=replace(LUMP, diameter_mm=14.0, offset_mm=(0.7, 0.7))),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Ordinary:
    """Frames looked at, flags and least chances of the second and the first harmonic, and milliseconds a frame."""

    frames: int
    flags: dict[str, int]
    least_round: float
    least_square: float
    milliseconds: float


def patterned(
    frame: tsis.TactileImage, fixed: NDArray[np.float64], virtual: VirtualProbe, rng: np.random.Generator
) -> tsis.TactileImage:
    """The frame with a fixed pattern and one of its own, both drawn ring by ring and sector by sector."""
    known = virtual.calibration
    place = sector_means(frame, probe=virtual.probe, calibration=known).grid.sector
    cells = np.append(fixed * grain(known.repeatability_sd, rng), 1.0)
    above = frame.grey - known.background_grey
    return replace(frame, grey=known.background_grey + above * cells[place].reshape(frame.grey.shape))


def grain(sd: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """Factors of the sectors whose mean over a ring errs by ``sd``."""
    return np.asarray(1 + sd * np.sqrt(SECTORS) * rng.standard_normal(RINGS * SECTORS))


def ordinary(probe: str, force_n: float, presses: int, seed: int) -> dict[str, Ordinary]:
    """Presses of one probe at one force, as they are and with patterns that are not round."""
    pressing = tsis.load_probe(probe)
    found: dict[str, list[tuple[tuple[str, ...], float, float, float]]] = {"round": [], "not round": []}
    for child in track(
        np.random.SeedSequence(seed).spawn(presses), description=f"{probe}, {force_n:g} N", console=Console(stderr=True)
    ):
        rng = np.random.default_rng(child)
        virtual = VirtualProbe(pressing, rng=rng, strain="small")
        name = PHANTOMS[int(rng.integers(len(PHANTOMS)))]
        shown = [virtual.press(tsis.load_phantom(one), force_n=force_n) for one in (name, "plain")]
        fixed = grain(virtual.calibration.pattern_sd, rng)
        uneven = [patterned(frame, fixed, virtual, rng) for frame in shown]
        for kind, frames in (("round", shown), ("not round", uneven)):
            found[kind].append(looked_at(frames, virtual))
    return {
        kind: Ordinary(
            frames=2 * presses,
            flags=dict(Counter(flag for flags, *_ in rows for flag in flags)),
            least_round=min(row[1] for row in rows),
            least_square=min(row[2] for row in rows),
            milliseconds=1e3 * float(np.median([row[3] for row in rows])),
        )
        for kind, rows in found.items()
    }


def looked_at(frames: list[tsis.TactileImage], virtual: VirtualProbe) -> tuple[tuple[str, ...], float, float, float]:
    """Flags of a target and its reference, chances of second and first harmonic, seconds a frame."""
    known = virtual.calibration
    start = perf_counter()
    flags = tuple(flag for flag, _ in image_findings(frames[:1], frames[1:], probe=virtual.probe, calibration=known))
    seconds = (perf_counter() - start) / len(frames)
    target, plain = (sector_means(frame, probe=virtual.probe, calibration=known) for frame in frames)
    second, first = roundness(target, plain, known), tilt_evidence(plain, known)
    return flags, 1.0 if second is None else second.chance, 1.0 if first is None else first.chance, seconds


def unusual(phantom: tsis.Phantom, presses: int, seed: int) -> tuple[int, int, float]:
    """How many of so many presses are flagged with a reference and without, and the least size over its noise."""
    probe = tsis.load_probe("tsis-2011")
    known = VirtualProbe(probe, rng=np.random.default_rng(0), strain="small").calibration
    known = replace(known, probe_young_sd=0.0)  # three dimensions are solved once
    counts, least = [0, 0], np.inf
    for child in np.random.SeedSequence(seed).spawn(presses):
        virtual = VirtualProbe(probe, rng=np.random.default_rng(child), calibration=known, strain="small")
        target, plain = (virtual.press(one, force_n=1.0) for one in (phantom, phantom.without_inclusion()))
        for column, references in enumerate(([plain], [])):
            flags = dict(image_findings([target], references, probe=probe, calibration=known))
            counts[column] += "not_one_round_inclusion" in flags
        shown = [sector_means(frame, probe=probe, calibration=known) for frame in (target, plain)]
        second = roundness(shown[0], shown[1], known)
        least = least if second is None else min(least, second.over_noise)
    return counts[0], counts[1], float(least)


def main() -> int:
    """Print the tables; the exit code says whether no ordinary press was flagged."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--presses", type=int, default=50, help="of each probe at each force")
    parser.add_argument(
        "--unusual", type=int, default=10, help="presses of each phantom in three dimensions; 0 for none"
    )
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    console, silent = Console(width=150), True
    table = Table(title=f"ordinary presses, {os.cpu_count()} cores")
    for heading in (
        "probe",
        "N",
        "patterns",
        "frames",
        "flags",
        "least chance round",
        "least chance square",
        "ms a frame",
    ):
        table.add_column(heading)
    for probe in PROBES:
        for force in FORCES_N:
            for kind, row in ordinary(probe, force, options.presses, options.seed).items():
                silent &= not row.flags
                numbers = (f"{row.least_round:.2g}", f"{row.least_square:.2g}", f"{row.milliseconds:.2g}")
                table.add_row(probe, f"{force:g}", kind, str(row.frames), str(row.flags or "none"), *numbers)
    console.print(table)
    if options.unusual:
        table = Table(title=f"{options.unusual} presses each in three dimensions, flat probe, 1 N")
        for heading in ("phantom", "flagged with a reference", "without", "least size over noise"):
            table.add_column(heading)
        try:
            for name, phantom in UNUSUAL.items():
                with_one, without, least = unusual(phantom, options.unusual, options.seed)
                table.add_row(name, str(with_one), str(without), f"{least:.1f}")
        except MissingExtraError as missing:
            console.print(f"not pressed: {missing}")
        console.print(table)
    return 0 if silent else 1


if __name__ == "__main__":
    sys.exit(main())
