"""The modulus of the tissue from one light press, and examinations with the forces that follow from it.

    python -m benchmarks.tissue --seed 7 --presses 8 --examinations 12

Light presses are solved at finite strain by the virtual probe, with its errors of gain, force, stiffness and pattern
and tissue of another thickness than the reading believes; the reading is small strain. Examinations draw the inclusion,
the tissue and every error from the default prior on that tissue, as `tsis demo --seeds` does.
"""

from __future__ import annotations

import argparse

import numpy as np
from benchmarks.solved_data import solved_data
from benchmarks.tables import show
from rich.progress import track

import tsis
from tsis.errors import MechanicsError
from tsis.inclusion import PARAMETERS, InclusionPrior, prior_on_tissue, protocol_forces, tissue_modulus
from tsis.model import Phantom
from tsis.virtual import RepeatedExamination, VirtualProbe, coverage_counts, exposure_for

LIGHT_N, THICKNESS_SD = 0.2, 0.1
TISSUES_KPA = (1.5, 5.0, 15.0, 30.0)


def light_row(name: str, young_kpa: float, *, seed: int, count: int) -> list[str]:
    """Mean ratio of the modulus over the truth, its scatter, the mean width and how often the intervals held."""
    probe, ratios, widths, inside = tsis.load_probe(name), [], [], 0
    for number in track(range(count), f"{name}, {young_kpa:g} kPa", transient=True):
        rng = np.random.default_rng([seed, number])
        thickness = 30.0 * float(np.exp(THICKNESS_SD * rng.standard_normal()))
        virtual = VirtualProbe(probe, rng=rng)
        try:
            with solved_data():
                image = virtual.press(Phantom(young_kpa=young_kpa, thickness_mm=thickness), force_n=LIGHT_N)
        except MechanicsError:
            continue  # so light a press on so stiff tissue touches less than a cell of the mesh
        result = tissue_modulus(image, probe=probe, calibration=virtual.calibration)
        low, high = result.interval_kpa
        ratios.append(result.young_kpa / young_kpa)
        widths.append(high / low)
        inside += low <= young_kpa <= high
    if not ratios:
        return [name, f"{young_kpa:g}", "0", "", "", ""]
    spread = f"{np.mean(ratios):.3f} ± {np.std(ratios):.3f}"
    return [name, f"{young_kpa:g}", str(len(ratios)), spread, f"{np.mean(widths):.2f}", f"{inside} of {len(ratios)}"]


def examination_row(young_kpa: float, *, seed: int, count: int) -> list[str]:
    """How often the 90 % intervals of examinations under the dome held."""
    probe, prior = tsis.load_probe("tsis-domed"), prior_on_tissue(InclusionPrior(), young_kpa)
    forces = protocol_forces(probe, tissue_young_kpa=young_kpa)
    repeated = RepeatedExamination(probe=probe, prior=prior, forces_n=forces)
    first = 1000 * seed + round(10 * young_kpa)
    counts = coverage_counts([repeated.once(first + number) for number in track(range(count), transient=True)])
    held = [str(counts["held"]["0.9"][name]) for name in PARAMETERS]
    used = " and ".join(f"{force:g}" for force in forces)
    exposure = f"{exposure_for(max(forces)):.2f}"
    return [f"{young_kpa:g}", used, exposure, str(counts["answered"]), str(counts["trusted"]), " / ".join(held)]


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--presses", type=int, default=8, help="light presses a tissue")
    parser.add_argument("--examinations", type=int, default=12, help="examinations a tissue")
    parser.add_argument("--kpa", type=float, nargs="+", default=TISSUES_KPA, help="moduli of the tissues")
    parser.add_argument("--markdown", action="store_true", help="print the tables as Markdown")
    options = parser.parse_args()
    rows = [
        light_row(name, kpa, seed=options.seed, count=options.presses)
        for name in ("tsis-domed", "tsis-2011")
        for kpa in options.kpa
    ]
    heads = ("probe", "tissue, kPa", "presses", "read over true", "90 % interval, high over low", "held")
    show(f"light presses of {LIGHT_N:g} N, seed {options.seed}", heads, rows, markdown=options.markdown)
    rows = [examination_row(kpa, seed=options.seed, count=options.examinations) for kpa in options.kpa]
    heads = ("tissue, kPa", "forces, N", "exposure", "answered", "trusted", "d / h / E held, 90 %")
    show(f"examinations under the dome, seed {options.seed}", heads, rows, markdown=options.markdown)


if __name__ == "__main__":
    main()
