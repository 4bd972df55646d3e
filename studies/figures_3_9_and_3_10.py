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
from typing import TYPE_CHECKING

import numpy as np
from studies.shown import Shown

import tsis
from tsis.mechanics.closed_forms import effective_modulus_kpa
from tsis.mechanics.small_strain.rigid_ball import indent
from tsis.model.probe import Layer, Probe

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

SPHERE_MM = 10.0
SEEN_MM = 0.05  # a deformation that a camera sees
STYLES = {"three layers": "o-", "single layer": "s--"}
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
    modulus = effective_modulus_kpa(layered.layers)
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


def draw_depth(result: Result, figure: Figure) -> None:
    """Figure 3.9."""
    axis = figure.subplots()
    for name, style in STYLES.items():
        axis.plot(result.force_n, result.depth_mm[name], style, label=name)
    axis.set(xlabel="force / N", ylabel="maximum deformation / mm")
    axis.legend(loc="upper left")


def draw_area(result: Result, figure: Figure) -> None:
    """Figure 3.10."""
    axis = figure.subplots()
    for name, style in STYLES.items():
        axis.plot(result.force_n, result.seen_area_mm2[name], style, label=f"{name}, deeper than {1000 * SEEN_MM:g} µm")
        axis.plot(result.force_n, result.contact_area_mm2[name], style, alpha=0.4, label=f"{name}, in contact")
    axis.set(xlabel="force / N", ylabel="deformation area / mm²", ylim=(0.0, 680.0))  # room for the legend
    axis.legend(loc="upper left")


def depth_values(result: Result) -> dict[str, float]:
    """Numbers of figure 3.9."""
    layered, single = (result.depth_mm[name] for name in STYLES)
    return {
        "deformation of the layered probe over the single layer's at 0.05 N": layered[0] / single[0],
        "deformation of the layered probe over the single layer's at 1 N": layered[-1] / single[-1],
        "deformation of the layered probe at 1 N": layered[-1],
    }


def area_values(result: Result) -> dict[str, float]:
    """Numbers of figure 3.10."""
    layered, single = (result.contact_area_mm2[name] for name in STYLES)
    return {
        "exponent of the contact area over the force, three layers": result.growth(
            result.contact_area_mm2, "three layers"
        ),
        "exponent of the contact area over the force, single layer": result.growth(
            result.contact_area_mm2, "single layer"
        ),
        "contact area of the layered probe over the single layer's at 1 N": layered[-1] / single[-1],
    }


SHOWN = (
    Shown(name="figure-3-9", run=run, values=depth_values, draw=draw_depth),
    Shown(name="figure-3-10", run=run, values=area_values, draw=draw_area),
)


def main() -> None:
    """Print the curves, and draw them where asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.parse_args()
    result = run()
    print(f"{'force N':>8} {'depth mm':>17} {'contact mm2':>17} {'> 50 um mm2':>17}   three layers, single")
    for index, force in enumerate(result.force_n):
        curves = (result.depth_mm, result.contact_area_mm2, result.seen_area_mm2)
        cells = (f"{curve['three layers'][index]:8.3f} {curve['single layer'][index]:8.3f}" for curve in curves)
        print(f"{force:8.2f} " + " ".join(cells))
    print("Research use only")


if __name__ == "__main__":
    main()
