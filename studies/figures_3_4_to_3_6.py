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
from typing import TYPE_CHECKING

import numpy as np
from studies.shown import Shown

from tsis.optics.propagation import Dent, Propagation, propagate, thin_guide
from tsis.present.figures import guide_index, guide_light, light_out_of_the_top

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure
    from numpy.typing import NDArray

CLAIM = "the total amount of scattered light is proportional to the waveguide deformation depth"
DEPTHS_UM = (0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
FEW_UM = (0.0, 2.0, 5.0)
PRESSED_UM = 5.0  # that of figure 3.5
DRAWN_UM = (0.0, 2.0, 4.0, 6.0)  # those of figure 3.6
SHADES = ("#000000", "#0072b2", "#56b4e9", "#d55e00")  # told apart without red-green vision
STEP_UM = 0.08  # powers differ by less than 0.003 from those of half the step


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Result:
    """Powers at each depth.

    Attributes
    ----------
    depth_um
        Depths of the dent, ascending, shape (depths,).
    solved
        The light at each of them.
    guided, top, bottom
        Shares of the launched power, means over the modes, shape (depths,).
    top_of_mode
        Share out of the top of each mode, shape (depths, modes).
    """

    depth_um: NDArray[np.float64]
    solved: tuple[Propagation, ...]
    guided: NDArray[np.float64]
    top: NDArray[np.float64]
    bottom: NDArray[np.float64]
    top_of_mode: NDArray[np.float64]

    def at(self, depth_um: float) -> Propagation:
        """The light under a dent that was solved."""
        return next(one for one in self.solved if one.dent.depth_um == depth_um)

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


def run(rng: np.random.Generator | None = None, *, depths_um: Sequence[float] = DEPTHS_UM) -> Result:
    """Solve for every depth; nothing is random, ``rng`` is what every study takes."""
    del rng
    guide = thin_guide("dissertation")
    found = [propagate(guide, Dent(depth_um=depth), method="fdfd", step_um=STEP_UM) for depth in depths_um]
    return Result(
        depth_um=np.array(depths_um),
        solved=tuple(found),
        guided=np.array([one.powers.guided.mean() for one in found]),
        top=np.array([one.powers.top.mean() for one in found]),
        bottom=np.array([one.powers.bottom.mean() for one in found]),
        top_of_mode=np.array([one.powers.top for one in found]),
    )


def behind_the_dent_um(light: Propagation) -> float:
    """Mean distance from the dent's middle at which light goes through the line over the guide, µm; it flies on."""
    share = light.top_per_um[1:-1].mean(axis=1)
    return float((share * light.z_um[1:-1]).sum() / share.sum())


def draw_guide(light: Propagation, figure: Figure) -> None:
    """Figures 3.4 and 3.5: the layers, and the light in them."""
    above, below = figure.subplots(2, 1, sharex=True)
    guide_index(light, above).set(title=f"dent of {light.dent.depth_um:g} µm", xlabel="")
    guide_light(light, below)


def draw_leaving(result: Result, figure: Figure) -> None:
    """Figure 3.6: the light out of the top, along the guide and in all."""
    along, totals = figure.subplots(1, 2)
    along.set_prop_cycle(color=SHADES)
    light_out_of_the_top([one for one in result.solved if one.dent.depth_um in DRAWN_UM], along)
    top, depth = 100 * result.top, result.depth_um
    totals.plot(depth, 100 * result.top_of_mode, color="0.8", linewidth=0.8)
    totals.plot(depth, top, "o-", color="#0072b2", label="out of the top, mean (modes grey)")
    totals.plot(depth, top + 100 * result.bottom, "s-", color="#d55e00", label="out of either side, mean")
    line = depth * (depth @ top) / (depth @ depth)
    totals.plot(depth, line, "k--", linewidth=1, label="proportional, as the source says")
    totals.set(
        xlabel="depth of the dent / µm", ylabel="light that leaves / %", ylim=(-1.0, 48.0)
    )  # room for the legend
    totals.legend(loc="upper left")


def flat_values(result: Result) -> dict[str, float]:
    """Numbers of figure 3.4."""
    flat = result.at(0.0)
    return {
        "modes that are launched": float(len(flat.n_eff)),
        "light still guided behind a flat face": 100 * float(flat.powers.guided.mean()),
        "light out of the top of a flat guide": abs(round(100 * float(flat.powers.top.mean()), 6)),
    }


def pressed_values(result: Result) -> dict[str, float]:
    """Numbers of figure 3.5."""
    light = result.at(PRESSED_UM)
    return {
        "light still guided behind the dent": 100 * float(light.powers.guided.mean()),
        "light out of the top": 100 * float(light.powers.top.mean()),
        "light out of the far side": 100 * float(light.powers.bottom.mean()),
        "where light crosses the line over the guide, mean, behind the dent's middle": behind_the_dent_um(light),
    }


def leaving_values(result: Result) -> dict[str, float]:
    """Numbers of figure 3.6; exponents only where all depths were solved."""
    out = {
        f"light out of the top, dent of {depth:g} µm": abs(round(100 * float(share), 6))  # no minus before nothing
        for depth, share in zip(result.depth_um, result.top, strict=True)
        if depth in DRAWN_UM
    }
    if len(result.depth_um) == len(DEPTHS_UM):
        out["exponent of the light out of the top over the depth, 2 to 6 µm"] = result.growth(result.top)
        both = result.top + result.bottom
        out["exponent of the light out of either side over the depth, 2 to 6 µm"] = result.growth(both)
        out["light out of the top, farthest off proportion"] = 100 * result.off_proportion(result.top)
    return out


def short(rng: np.random.Generator) -> Result:
    """Three of the depths."""
    return run(rng, depths_um=FEW_UM)


SHOWN = (
    Shown(
        name="figure-3-4",
        run=run,
        values=flat_values,
        draw=lambda result, figure: draw_guide(result.at(0.0), figure),
        short=short,
    ),
    Shown(
        name="figure-3-5",
        run=run,
        values=pressed_values,
        draw=lambda result, figure: draw_guide(result.at(PRESSED_UM), figure),
        short=short,
    ),
    Shown(name="figure-3-6", run=run, values=leaving_values, draw=draw_leaving, short=short),
)


def main() -> None:
    """Print the powers beside the claim."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.parse_args()
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


if __name__ == "__main__":
    main()
