"""The modulus of the tissue from one light press, and examinations with the forces that follow from it.

    python -m benchmarks.tissue --seed 7 --presses 8 --examinations 12

Light presses are solved at finite strain by the virtual probe, with its errors of gain, force, stiffness and pattern
and tissue of another thickness than the reading believes; the reading is small strain. The tables of the estimate are
compared with solved presses. Examinations draw the inclusion, the tissue and every error from the default prior on that
tissue, as `tsis demo --seeds` does.
"""

from __future__ import annotations

import sys

import numpy as np
from benchmarks.harness import Bench
from benchmarks.solved_data import solved_data
from rich.progress import track

import tsis
from tsis.errors import MechanicsError
from tsis.inclusion import InclusionPrior
from tsis.inclusion.posterior.rings import ring_correction, ring_means, ring_responses
from tsis.inclusion.prior import PARAMETERS
from tsis.inclusion.tissue import prior_on_tissue, protocol_forces, tissue_modulus
from tsis.mechanics.finite_strain.neo_hookean_press import PressSeries
from tsis.mechanics.surrogate.correction_building import build_finite_correction
from tsis.mechanics.surrogate.full_contact import build_full_contact_surrogate
from tsis.model.calibration import LIGHT_REACH, LIGHT_RINGS
from tsis.model.phantom import Inclusion, Phantom
from tsis.virtual.examinations import RepeatedExamination, coverage_counts
from tsis.virtual.probe import VirtualProbe, exposure_for

LIGHT_N, THICKNESS_SD = 0.2, 0.1
TISSUES_KPA = (1.5, 5.0, 15.0, 30.0)
CONTRAST = 16.0  # of the sphere that tells the tables' error


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


def table_rows(young_kpa: float) -> list[list[str]]:
    """How far the estimate's tables lie from solved presses with the protocol's forces, and the error that they state.

    Over the rings of an estimate: the pressure without inclusion, over its mean, and the signal, over its peak.
    """
    probe, box = tsis.load_probe("tsis-domed"), prior_on_tissue(InclusionPrior(), young_kpa).box()
    edges = np.linspace(0.0, LIGHT_REACH * probe.radius_mm, LIGHT_RINGS + 1)
    surrogate, table = build_full_contact_surrogate(probe, box), build_finite_correction(probe, box)
    stated = float(np.hypot(surrogate.error, table.error_in(box)))
    rings = ring_responses(surrogate, edges, np.ones(len(edges) - 1))
    correction = ring_correction(table, edges, np.ones(len(edges) - 1))
    diameter, depth = 9.0, 6.0
    sphere = np.array([[diameter, depth, CONTRAST * young_kpa]])
    inclusion = Inclusion(diameter_mm=diameter, depth_mm=depth, young_kpa=CONTRAST * young_kpa, poisson=0.49)
    with_it = Phantom(young_kpa=young_kpa, thickness_mm=30.0, poisson=0.49, inclusion=inclusion)
    series, rows = PressSeries(probe.unlit()), []
    for force in protocol_forces(probe, tissue_young_kpa=young_kpa):
        without, pressed = (
            ring_means(surrogate.radius_mm, edges) @ np.interp(surrogate.radius_mm, field.radius_mm, field.pressure_kpa)
            for field in (series.press(slab, force_n=force) for slab in (with_it.without_inclusion(), with_it))
        )
        state = np.array([[young_kpa, 30.0, force]])
        plain, small = (rings.under(force, rings.on(young_kpa, 30.0, each)) for each in (None, sphere))
        signal = small - plain
        signal = signal + correction.change(sphere[:, 0], sphere[:, 1], np.array([CONTRAST]), state, signal[None])[0]
        plain = plain + correction.without_inclusion(state)
        error = (plain[0, : rings.count] - without) / without.mean()
        of_signal = (signal[0, : rings.count] - (pressed - without)) / np.abs(pressed - without).max()
        numbers = (error[0], error[-1], np.abs(of_signal).max(), stated)
        rows.append([f"{young_kpa:g}", f"{force:g}", *(f"{100 * number:.2f} %" for number in numbers)])
    return rows


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


def main() -> int:
    """Print the tables."""
    bench = Bench(__doc__, seed=7, presses=8, examinations=12, kpa=[*TISSUES_KPA])
    rows = [
        light_row(name, kpa, seed=bench.seed, count=bench.presses)
        for name in ("tsis-domed", "tsis-2011")
        for kpa in bench.kpa
    ]
    heads = ("probe", "tissue, kPa", "presses", "read over true", "90 % interval, high over low", "held")
    bench.table(f"light presses of {LIGHT_N:g} N, seed {bench.seed}", heads, rows)
    rows = [row for kpa in bench.kpa for row in table_rows(kpa)]
    heads = ("tissue, kPa", "force, N", "pressure, centre", "pressure, outermost ring", "signal", "stated")
    bench.table("tables under the dome less solved presses", heads, rows)
    rows = [examination_row(kpa, seed=bench.seed, count=bench.examinations) for kpa in bench.kpa]
    heads = ("tissue, kPa", "forces, N", "exposure", "answered", "trusted", "d / h / E held, 90 %")
    bench.table(f"examinations under the dome, seed {bench.seed}", heads, rows)
    return bench.end()


if __name__ == "__main__":
    sys.exit(main())
