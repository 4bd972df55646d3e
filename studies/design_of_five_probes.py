"""What five protocols would tell about inclusions, beside what an earlier computation with a simpler model said.

    python -m studies.design_of_five_probes [--figure five.png]

The three default protocols, and the domed one's presses with faces of 80 and 30 mm curvature. Expected errors are means
over the prior's ranges, and over the nine inclusions of table 6.2; a second row says what they would be if the tissue
were just as stiff at the reference's site as at the target's.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tsis.cli.progress import progress_bar
from tsis.imaging.sensor import Sensor
from tsis.inclusion import InclusionPrior
from tsis.inclusion.design.alternatives import Design, compare_designs
from tsis.inclusion.design.information import ProtocolInformation, dissertation_inclusions, protocol_information
from tsis.inclusion.design.protocol import default_protocols
from tsis.inclusion.prior import PARAMETERS
from tsis.mechanics.surrogate.full_contact import FULL_CONTACT_DEGREES
from tsis.virtual.probe import nominal_calibration

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from tsis.inclusion.design.protocol import Protocol

# Expected root mean square errors over the ranges of diameter (mm), depth (mm) and modulus (kPa).
EARLIER = {
    "flat, no reference": np.array([0.65, 0.77, 23.3]),
    "flat, with a reference": np.array([0.33, 0.55, 23.1]),
    "domed, two forces": np.array([0.25, 0.43, 21.8]),
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Result:
    """What each protocol would tell.

    Attributes
    ----------
    designs
        Judged over the prior's ranges.
    nine
        Information on the nine inclusions of table 6.2, in the same order.
    alike
        Designs in the same order if the tissue were as stiff at the reference's site as at the target's.
    exact_rmse
        Errors over the ranges of the domed protocol with the press solved as an estimate has it, shape (3,).
    """

    designs: tuple[Design, ...]
    nine: tuple[ProtocolInformation, ...]
    alike: tuple[Design, ...]
    exact_rmse: NDArray[np.float64]

    def rmse(self, name: str) -> NDArray[np.float64]:
        """Expected errors over the ranges of the protocol of that name, shape (3,)."""
        (found,) = (one for one in self.designs if one.protocol.name == name)
        return np.array(list(found.information.rmse.values()))


def five_protocols() -> tuple[Protocol, ...]:
    """The default protocols and two more."""
    *flat, domed = default_protocols()
    return (*flat, domed, *(_with_dome(domed, curvature) for curvature in (80.0, 30.0)))


def _with_dome(planned: Protocol, curvature_mm: float) -> Protocol:
    name = f"dome of {curvature_mm:g} mm, two forces"
    return replace(planned, probe=replace(planned.probe, face_curvature_mm=curvature_mm, name=name), name=name)


def run(rng: np.random.Generator | None = None, *, progress: Callable[[int, int], None] | None = None) -> Result:
    """Judge the five; nothing is drawn, so that ``rng`` changes nothing."""
    del rng
    protocols, prior = five_protocols(), InclusionPrior()
    calibration = nominal_calibration(Sensor())
    both = partial(compare_designs, protocols, of=protocols[0].probe, prior=prior)
    designs = both(calibration=calibration, progress=progress)

    def told(protocol: Protocol) -> ProtocolInformation:
        return protocol_information(
            protocol, prior=prior, calibration=calibration, inclusions=dissertation_inclusions()
        )

    exact = protocol_information(protocols[2], prior=prior, calibration=calibration, degrees=FULL_CONTACT_DEGREES).rmse
    return Result(
        designs=designs,
        nine=tuple(told(protocol) for protocol in protocols),
        alike=both(calibration=replace(calibration, site_sd=0.0)),
        exact_rmse=np.array([exact[name] for name in PARAMETERS]),
    )


def report(result: Result) -> str:
    """The table, as text."""
    heading = f"{'':<28}{'d mm':>7}{'h mm':>7}{'E kPa':>7}  {'E known':>7}  {'nine: d':>8}{'h':>7}{'E':>7}   breaks"
    lines = ["expected errors over the prior's ranges, and over the nine inclusions of table 6.2", heading]
    for design, nine, alike in zip(result.designs, result.nine, result.alike, strict=True):
        name, output = design.protocol.name, design.information
        ours = "".join(f"{value:7.2f}" for value in output.rmse.values())
        on_nine = "{:8.2f}{:7.2f}{:7.2f}".format(*nine.rmse.values())
        lines.append(
            f"{name:<28}{ours}  {output.identified_fraction:7.0%}  {on_nine}   {', '.join(design.limits.broken)}"
        )
        lines.append("{:<28}{:7.2f}{:7.2f}{:7.2f}".format("  sites alike", *alike.information.rmse.values()))
        if name in EARLIER:
            lines.append("{:<28}{:7.2f}{:7.2f}{:7.2f}".format("  earlier *", *EARLIER[name]))
    coarse = result.rmse("domed, two forces")
    off = "{:.1f}, {:.1f} and {:.1f} %".format(*100 * np.abs(coarse / result.exact_rmse - 1))
    return "\n".join(
        [
            *lines,
            "* an earlier computation with a simpler model",
            f"With the press solved as an estimate has it, the errors of 'domed, two forces' differ by {off}.",
            "Research use only",
        ]
    )


def draw(result: Result, path: Path) -> None:
    """Expected errors against each other."""
    from matplotlib.figure import Figure

    from tsis.present.figures import design_errors

    figure = Figure(figsize=(11.0, 4.0), layout="constrained")
    left, right = figure.subplots(1, 2)
    design_errors(result.designs, ("diameter_mm", "depth_mm"), left)
    design_errors(result.designs, ("depth_mm", "young_kpa"), right)
    figure.legend(*left.get_legend_handles_labels(), loc="outside right upper", fontsize=8, markerscale=0.8)
    figure.supxlabel("Research use only", fontsize=8)
    figure.savefig(path, dpi=150)


def main() -> None:
    """Print the table, and draw the figure where asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--figure", type=Path, help="picture to write, e.g. five.png")
    arguments = parser.parse_args()
    with progress_bar("solving presses (kept for next time)") as progress:
        result = run(progress=progress)
    print(report(result))
    if arguments.figure is not None:
        draw(result, arguments.figure)


if __name__ == "__main__":
    main()
