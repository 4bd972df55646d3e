"""Figures 3.4 to 3.6: light in a thin guide, flat and pressed by a round tip, and what leaves through the pressed face.

The source launches light into a guide of four layers, presses it with a tip of radius 10 and plots the light above it
for depths of 0, 2, 4 and 6 "mm"; it takes the guide as thin for the sake of computing, so all these are µm here. It
prints no number and reads from figure 3.6 that "the total amount of scattered light is proportional to the waveguide
deformation depth". Here twelve modes are launched with equal power, Helmholtz's equation is solved, and the power out
of either side is counted. Found: the light out of the top is nought without a dent and grows with every depth, from 2
to 6 µm as depth**1.23, up to a fifth off proportion. All the light that leaves, of which the larger part goes out of
the far side, saturates: it grows as depth**0.73. Single modes need not follow: two of the twelve send less out of the
top under some deeper dent.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tsis.optics import Dent, Propagation, propagate, thin_guide
from tsis.plots import guide_index, guide_light, light_out_of_the_top

if TYPE_CHECKING:
    from numpy.typing import NDArray

CLAIM = "the total amount of scattered light is proportional to the waveguide deformation depth"
DEPTHS_UM = np.arange(0.0, 7.0)
DRAWN_UM = (0.0, 2.0, 4.0, 6.0)  # those of figure 3.6
STEP_UM = 0.08  # powers differ by less than 0.003 from those of half the step


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Result:
    """Powers at each depth: of the mean of the modes, shape (depths,), and of each mode, shape (depths, modes)."""

    depth_um: NDArray[np.float64]
    drawn: tuple[Propagation, ...]
    guided: NDArray[np.float64]
    top: NDArray[np.float64]
    bottom: NDArray[np.float64]
    top_of_mode: NDArray[np.float64]

    def off_proportion(self, light: NDArray[np.float64]) -> float:
        """Largest miss of the best line through the origin, over what it says, at depths from 2 µm on."""
        seen = self.depth_um >= 2.0
        depth, found = self.depth_um[seen], light[seen]
        line = depth * (depth @ found) / (depth @ depth)
        return float(np.abs(found / line - 1).max())

    def growth(self, light: NDArray[np.float64]) -> float:
        """Exponent with which ``light`` grows with the depth from 2 µm on: 1 in proportion."""
        seen = self.depth_um >= 2.0
        return float(np.polyfit(np.log(self.depth_um[seen]), np.log(light[seen]), 1)[0])

    @property
    def falling_modes(self) -> int:
        """How many of the modes send less out of the top at some larger depth."""
        return int((np.diff(self.top_of_mode, axis=0) < 0).any(axis=0).sum())


def run(rng: np.random.Generator | None = None) -> Result:
    """Solve for every depth; nothing is random, ``rng`` is what every study takes."""
    del rng
    guide = thin_guide("dissertation")
    found = [propagate(guide, Dent(depth_um=float(d)), method="fdfd", step_um=STEP_UM) for d in DEPTHS_UM]
    return Result(
        depth_um=DEPTHS_UM,
        drawn=tuple(one for one in found if one.dent.depth_um in DRAWN_UM),
        guided=np.array([one.powers.guided.mean() for one in found]),
        top=np.array([one.powers.top.mean() for one in found]),
        bottom=np.array([one.powers.bottom.mean() for one in found]),
        top_of_mode=np.array([one.powers.top for one in found]),
    )


def draw(result: Result, path: Path) -> None:
    """Figures 3.4 and 3.5 above, figure 3.6 and the totals below."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 9.0), layout="constrained")
    axes = figure.subplots(3, 2)
    for column, (name, shown) in enumerate((("Figure 3.4", result.drawn[0]), ("Figure 3.5", result.drawn[2]))):
        guide_index(shown, axes[0, column]).set_title(f"{name}a: dent of {shown.dent.depth_um:g} µm")
        guide_light(shown, axes[1, column]).set_title(f"{name}b")
    light_out_of_the_top(result.drawn, axes[2, 0]).set_title("Figure 3.6")
    totals = axes[2, 1]
    totals.plot(result.depth_um, 100 * result.top_of_mode, color="0.8", linewidth=0.8)
    totals.plot(result.depth_um, 100 * result.top, "o-", label="out of the top, mean (modes grey)")
    totals.plot(result.depth_um, 100 * (result.top + result.bottom), "s--", label="out of either side, mean")
    totals.set(title="Is it proportional?", xlabel="depth of the dent / µm", ylabel="light that leaves / %")
    totals.set_ylim(-1.0, 42.0)  # room for the legend
    totals.legend(loc="upper left")
    figure.supxlabel("Research use only", fontsize=8)
    figure.savefig(path)


def main() -> None:
    """Print the powers beside the claim, and draw them where asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--figure", type=Path, help="picture to write, e.g. pressed-guide.png")
    arguments = parser.parse_args()
    result = run()
    print(f"{'dent um':>8} {'guided %':>9} {'top %':>7} {'bottom %':>9}")
    for depth, *shares in zip(result.depth_um, result.guided, result.top, result.bottom, strict=True):
        guided, top, bottom = (100 * abs(share) for share in shares)  # no minus before nothing
        print(f"{depth:8.0f} {guided:9.2f} {top:7.2f} {bottom:9.2f}")
    print(f'printed: "{CLAIM}"')
    for name, light in (("top", result.top), ("either side", result.top + result.bottom)):
        print(
            f"out of {name}, 2 to 6 um: grows as depth**{result.growth(light):.2f}, "
            f"off proportion by up to {result.off_proportion(light):.0%}"
        )
    print(f"{result.falling_modes} of {result.top_of_mode.shape[1]} modes send less out of the top at a larger depth")
    print("Research use only")
    if arguments.figure is not None:
        draw(result, arguments.figure)


if __name__ == "__main__":
    main()
