"""Figures 3.9 and 3.10: a probe of three layers against one of a single layer with the effective modulus.

The source presses an indenter on both by finite elements and plots the maximum deformation and the deformation area
against the force. It prints neither the indenter nor numbers; a rigid sphere of 10 mm is taken here, and the catalog's
moduli. The source reads from its curves that the maximum deformations hardly differ, and that the area of the layered
probe varies more with the force. Found here: the layered probe deforms a tenth to a third less, most at small forces,
where its stiff skin alone carries the sphere; its contact is smaller by 33 to 47 % and grows a little faster, as
F**0.73 against F**0.65. The area that is deeper than a fixed depth crosses over: at first it is larger under layers,
then smaller. So what the source says of the area holds for the relative growth of the contact, and not in general.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import tsis
from tsis import Layer, Probe
from tsis.mechanics import closed_form, indent

if TYPE_CHECKING:
    from numpy.typing import NDArray

SPHERE_MM = 10.0
SEEN_MM = 0.05  # a deformation that a camera sees
FORCES_N = np.array([0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Result:
    """Both curves of both probes, each of shape (forces,)."""

    force_n: NDArray[np.float64]
    depth_mm: dict[str, NDArray[np.float64]]
    contact_area_mm2: dict[str, NDArray[np.float64]]
    seen_area_mm2: dict[str, NDArray[np.float64]]

    def growth(self, curve: dict[str, NDArray[np.float64]], name: str) -> float:
        """Relative growth of a curve with the force: its mean logarithmic slope."""
        return float(np.polyfit(np.log(self.force_n), np.log(curve[name]), 1)[0])


def run(rng: np.random.Generator | None = None) -> Result:
    """Press both probes; nothing is random, ``rng`` is what every study takes."""
    del rng
    layered = tsis.load_probe("tsis-2011")
    modulus = closed_form.effective_modulus_kpa(layered.layers)
    single = Probe(radius_mm=layered.radius_mm, layers=(Layer(thickness_mm=layered.thickness_mm, young_kpa=modulus),))
    pressed = {
        name: [indent(probe, sphere_radius_mm=SPHERE_MM, force_n=float(force)) for force in FORCES_N]
        for name, probe in (("three layers", layered), ("single layer", single))
    }
    return Result(
        force_n=FORCES_N,
        depth_mm={name: np.array([one.depth_mm for one in found]) for name, found in pressed.items()},
        contact_area_mm2={name: np.array([one.contact_area_mm2 for one in found]) for name, found in pressed.items()},
        seen_area_mm2={
            name: np.array([one.area_deeper_than_mm2(SEEN_MM) for one in found]) for name, found in pressed.items()
        },
    )


def draw(result: Result, path: Path) -> None:
    """Both figures side by side."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 3.8), layout="constrained")
    left, right = figure.subplots(1, 2)
    for name, style in (("three layers", "o-"), ("single layer", "s--")):
        left.plot(result.force_n, result.depth_mm[name], style, label=name)
        right.plot(
            result.force_n, result.seen_area_mm2[name], style, label=f"{name}, deeper than {1000 * SEEN_MM:g} µm"
        )
        right.plot(result.force_n, result.contact_area_mm2[name], style, alpha=0.4, label=f"{name}, in contact")
    left.set(title="Figure 3.9", xlabel="force / N", ylabel="maximum deformation / mm")
    right.set(title="Figure 3.10", xlabel="force / N", ylabel="deformation area / mm²")
    right.set_ylim(0.0, 680.0)  # room for the legend
    for axis in (left, right):
        axis.legend(loc="upper left")
    figure.supxlabel("Research use only", fontsize=8)
    figure.savefig(path)


def main() -> None:
    """Print the curves, and draw them where asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--figure", type=Path, help="picture to write, e.g. layers.png")
    arguments = parser.parse_args()
    result = run()
    print(f"{'force N':>8} {'depth mm':>17} {'contact mm2':>17} {'> 50 um mm2':>17}   three layers, single")
    for index, force in enumerate(result.force_n):
        curves = (result.depth_mm, result.contact_area_mm2, result.seen_area_mm2)
        cells = (f"{curve['three layers'][index]:8.3f} {curve['single layer'][index]:8.3f}" for curve in curves)
        print(f"{force:8.2f} " + " ".join(cells))
    print("Research use only")
    if arguments.figure is not None:
        draw(result, arguments.figure)


if __name__ == "__main__":
    main()
