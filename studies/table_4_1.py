"""Table 4.1: the specification of the probe beside that of the human fingertip, measured on the virtual bench.

The source gives the pitch of the camera's pixels as the spatial resolution, 9.8 µm, and the camera's frame rate as the
temporal one; it does not say how the smallest force was found, and its table gives 2.0e-3 N for the probe and 2.5e-2 N
for the fingertip where its text has 2.5e-3 N and 2.0e-2 N. Here a virtual loading machine is calibrated as a bench is:
an edge of contact tells what is resolved, untouched frames what force stands out, loops what is remembered.

Found: an edge rises from 10 to 90 % within 0.13 mm, thirteen times the printed pitch and about what the fingertip
resolves; it is the blur of the machine's lens, an assumption. The smallest force is some millinewtons, as printed. The
frame rate is set and not found, so it is no number here.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from studies.shown import Shown

import tsis
from tsis.calibration.camera_reference import CameraReference, make_reference
from tsis.calibration.force_line import TIPS_MM, Loading, fit_force_line, loading_forces, read_loading_frame
from tsis.calibration.specification import edge_width, specification_sheet
from tsis.present.figures import hysteresis_loops
from tsis.virtual.loading_machine import FLAT_LEVELS, VirtualLoadingMachine

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from tsis.calibration.measured import MeasuredValue
    from tsis.calibration.specification import Specification
    from tsis.imaging.sensor import Sensor

PROBE = tsis.load_probe("tsis-direct")
RUNS = 2  # loadings of each tip: what is repeated needs a repeat
FRAMES, FLAT_FRAMES = 8, 6
PRINTED_PITCH_MM = 9.8e-3
PRINTED_N, PRINTED_IN_TEXT_N = 2.0e-3, 2.5e-3
FINGERTIP_MM, FINGERTIP_N, FINGERTIP_IN_TEXT_N = 0.1, 2.5e-2, 2.0e-2
BLUE, WARM, GREY = "#0072b2", "#d55e00", "0.4"


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """What was measured.

    Attributes
    ----------
    edge_mm
        Width of an edge of contact from 10 to 90 %.
    sheet
        The whole sheet; None without loadings.
    loadings
        Two runs of every tip, up and down.
    """

    edge_mm: MeasuredValue
    sheet: Specification | None = None
    loadings: tuple[Loading, ...] = ()

    def value(self, quantity: str) -> MeasuredValue | None:
        """A line of the sheet, None where it was not measured."""
        return None if self.sheet is None else self.sheet[quantity].measured


def run(rng: np.random.Generator, *, sensor: Sensor | None = None) -> Result:
    """Calibrate a machine: references, an edge, and two loadings of three tips."""
    machine = VirtualLoadingMachine(PROBE, rng=rng, sensor=sensor)
    reference = references(machine)
    edge_mm = edge_width(reference.corrected(machine.edge()))
    loadings = tuple(loaded(machine, reference, tip, number) for number in range(1, RUNS + 1) for tip in TIPS_MM)
    line, found = fit_force_line(loadings, reference=reference)
    sheet = specification_sheet(probe=PROBE.name, line=line, diagnostics=found, edge_mm=edge_mm)
    return Result(edge_mm=edge_mm, sheet=sheet, loadings=loadings)


def short(rng: np.random.Generator) -> Result:
    """The edge alone."""
    machine = VirtualLoadingMachine(PROBE, rng=rng)
    return Result(edge_mm=edge_width(references(machine).corrected(machine.edge())))


def references(machine: VirtualLoadingMachine) -> CameraReference:
    """Lamps off, untouched, and even contact at three levels of light."""
    dark = [machine.dark() for _ in range(FRAMES)]
    untouched = [machine.no_contact() for _ in range(FRAMES)]
    flats = [[machine.flat(level) for _ in range(FLAT_FRAMES)] for level in FLAT_LEVELS]
    return make_reference(dark, untouched, flats, patch_px=machine.patch_px)


def loaded(machine: VirtualLoadingMachine, reference: CameraReference, tip_mm: float, number: int) -> Loading:
    """One tip from nothing to 2 N and back."""
    readings = [
        read_loading_frame(image, reference, force_n=shown_n, touched=force_n > 0)
        for force_n in loading_forces()
        for image, shown_n in [machine.press(tip_mm, force_n)]
    ]
    return Loading.from_frames(tip_mm, readings, run=number)


def values(result: Result) -> dict[str, float]:
    """Numbers of the table; without loadings only the edge's."""
    out = {"width of an edge of contact, 10 to 90 %": 1000 * result.edge_mm.value}
    for quantity, factor in (("smallest detectable force", 1000.0), ("hysteresis", 100.0), ("repeatability", 100.0)):
        found = result.value(quantity)
        if found is not None:
            out[quantity] = factor * abs(found.value)
    return out


def draw(result: Result, figure: Figure) -> None:
    """Fingertip, printed probe and measured probe, and the loops."""
    space, force, loops = figure.subplots(1, 3)
    edge = ("this probe", result.edge_mm, 1.0)
    _beside(space, [("fingertip", FINGERTIP_MM, GREY), ("printed", PRINTED_PITCH_MM, WARM)], edge)
    space.set(xlabel="spatial resolution / mm", xlim=(5e-3, 0.5))
    given = [
        ("fingertip, table", FINGERTIP_N, GREY),
        ("fingertip, text", FINGERTIP_IN_TEXT_N, GREY),
        ("printed, table", PRINTED_N, WARM),
        ("printed, text", PRINTED_IN_TEXT_N, WARM),
    ]
    found = result.value("smallest detectable force")
    _beside(force, given, None if found is None else ("this probe", found, 1000.0))
    force.set(xlabel="smallest force / mN", xlim=(0.5, 100.0))
    hysteresis_loops(result.loadings, loops)
    loops.set(ylim=(-1.4, 1.0), xlim=(0.0, 2.1))
    if loops.get_legend() is not None:
        loops.legend(loc="lower left", frameon=False)


def _beside(axis: Axes, given: list[tuple[str, float, str]], found: tuple[str, MeasuredValue, float] | None) -> None:
    """One row a source, hollow where it is not ours, on a logarithmic axis in the unit of ``found``."""
    factor = 1000.0 if found is None else found[2]
    for row, (_, value, colour) in enumerate(given):
        axis.plot(factor * value, -row, "o", color=colour, markerfacecolor="none", markersize=8)
    names = [name for name, *_ in given]
    if found is not None:
        name, measured, _ = found
        low, high = measured.interval()
        ends = [[factor * (measured.value - low)], [factor * (high - measured.value)]]
        axis.errorbar(factor * measured.value, -len(names), xerr=ends, fmt="s", color=BLUE, capsize=3)
        names.append(name)
    axis.set_yticks([-float(row) for row in range(len(names))], names)
    axis.set_xscale("log")
    axis.set_ylim(0.5 - len(names), 0.5)
    axis.grid(visible=True, axis="x", alpha=0.3)


SHOWN = (Shown(name="table-4-1", run=run, values=values, draw=draw, short=short),)


def main() -> None:
    """Print the sheet."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    result = run(np.random.default_rng(parser.parse_args().seed))
    print(f"{'':27} {'measured':>24} {'printed':>12} {'fingertip':>12}")
    for row in () if result.sheet is None else result.sheet.rows:
        found = row.measured
        cell = "not measured" if found is None else f"{found.value:.4g} ± {found.sd:.2g} {row.unit}".rstrip()
        print(f"{row.quantity:27} {cell:>24} {row.printed or '-':>12} {row.fingertip or '-':>12}")
    print("Research use only")


if __name__ == "__main__":
    main()
