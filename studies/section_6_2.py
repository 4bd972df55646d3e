"""Figures 6.5, 6.11 and 6.15: relative size, depth and hardness of inclusions in three phantoms, 15 presses each.

The source prints no forces; 1 N is taken here, and 0.5 and 1 N where it compares two presses. It prints means and
standard deviations of some of its bars, and ratios of all means, from which the others follow. Corrected here: its
depths 4, 8 and 12 mm are 1 : 2 : 3, not 1 : 1.5 : 3; its "mm" of depth are grey levels times the size of a pixel, and
are turned back; and its field of 768 x 492 pixels of 6.79 um is 5.2 x 3.3 mm wide, in which a disc of the 8.77 mm that
it reports has no room. Each reading is made twice: against the untouched probe, as the source does, and against presses
of equal force on plain tissue, the mean of as many. Means are those of the presses that showed anything.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

import tsis
from tsis.cli.progress import progress_bar
from tsis.inclusion.relative import RelativeReading, Repeats, ratios, relative_depth, relative_hardness, relative_size
from tsis.virtual.probe import VirtualProbe

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from tsis.model.calibration import Calibration
    from tsis.model.image import TactileImage

PRESSES = 15
WEAK_N, STRONG_N = 0.5, 1.0
AGAINST = ("untouched probe", "plain tissue")
SOURCE_PIXEL_MM = 6.79e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """One bar chart of the source: true values, and what is printed of its bars, None where it is not."""

    number: str
    phantoms: tuple[str, ...]
    truth: tuple[float, ...]
    truth_unit: str
    printed_ratio: tuple[float, ...]
    printed: tuple[float | None, ...]
    printed_sd: tuple[float | None, ...]
    unit: str

    @property
    def true_ratio(self) -> tuple[float, ...]:
        """Ratios of the true values to the first."""
        return tuple(value / self.truth[0] for value in self.truth)

    @property
    def printed_mean(self) -> tuple[float, ...]:
        """Means of the bars; those that the source does not print follow from its ratios."""
        first = self.printed[0] or 0.0
        pairs = zip(self.printed, self.printed_ratio, strict=True)
        return tuple(first * ratio if mean is None else mean for mean, ratio in pairs)


FIGURES = {
    "size": Figure(
        number="6.5",
        phantoms=("size-2", "size-8", "size-14"),
        truth=(2.0, 8.0, 14.0),
        truth_unit="mm",
        printed_ratio=(1.0, 3.86, 5.26),
        printed=(1.67, None, 8.77),
        printed_sd=(0.48, None, 1.24),
        unit="mm",
    ),
    "depth": Figure(
        number="6.11",
        phantoms=("depth-4", "depth-8", "depth-12"),
        truth=(4.0, 8.0, 12.0),
        truth_unit="mm",
        printed_ratio=(1.0, 0.74, 0.57),
        printed=(0.59 / SOURCE_PIXEL_MM, None, 0.34 / SOURCE_PIXEL_MM),
        printed_sd=(0.03 / SOURCE_PIXEL_MM, None, 0.08 / SOURCE_PIXEL_MM),
        unit="grey levels",
    ),
    "hardness": Figure(
        number="6.15",
        phantoms=("hardness-40", "hardness-70", "hardness-100"),
        truth=(40.0, 70.0, 100.0),
        truth_unit="kPa",
        printed_ratio=(1.0, 1.81, 3.05),
        printed=(82.59, 149.93, 252.25),
        printed_sd=(None, 29.83, 35.87),
        unit="kPa",
    ),
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Result:
    """What the presses showed.

    Attributes
    ----------
    probe
        What pressed.
    readings
        Of each figure against each kind of reference, one `Repeats` a phantom.
    frames
        The first strong press of each phantom, figures 6.4, 6.10 and 6.14; under ``"plain"`` the mean of all on plain
        tissue.
    """

    probe: str
    readings: Mapping[str, Mapping[str, tuple[Repeats, ...]]]
    frames: Mapping[str, TactileImage]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Site:
    """Presses of one target, and what they are compared with."""

    weak: list[TactileImage]
    strong: list[TactileImage]
    weak_reference: list[TactileImage]
    strong_reference: list[TactileImage]

    def readings(self, name: str, against: str, calibration: Calibration) -> list[RelativeReading]:
        """What one figure reads off each press, or off each pair of them."""
        if name == "hardness":
            return [
                relative_hardness(
                    weak,
                    strong,
                    reference=self.weak_reference,
                    second_reference=self.strong_reference,
                    against=against,
                    calibration=calibration,
                )
                for weak, strong in zip(self.weak, self.strong, strict=True)
            ]
        read = {"size": relative_size, "depth": relative_depth}[name]
        return [read(image, self.strong_reference, against=against, calibration=calibration) for image in self.strong]


def without_errors(virtual: VirtualProbe, rng: np.random.Generator) -> VirtualProbe:
    """The same probe with a steady hand and a camera without noise; it still rounds to whole grey levels."""
    steady = replace(
        virtual.calibration,
        gain_sd=0.0,
        force_sd=0.0,
        offset_sd=0.0,
        pattern_sd=0.0,
        repeatability_sd=0.0,
        shading_sd=0.0,
        read_noise_grey=0.0,
        shot_noise_grey=0.0,
    )
    quiet = replace(virtual.sensor, read_noise_grey=0.0, shot_noise_grey=0.0)
    return VirtualProbe(virtual.probe, rng=rng, sensor=quiet, calibration=steady, strain="small")


def run(
    rng: np.random.Generator,
    *,
    presses: int = PRESSES,
    probe: str = "tsis-2011",
    ideal: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> Result:
    """Press every phantom; each press misses its force and has stray light, pattern and noise of its own.

    ``ideal`` leaves all of that out, so that one press is as good as many; ``progress`` is called with (phantoms
    pressed, in all).
    """
    virtual = VirtualProbe(tsis.load_probe(probe), rng=rng, strain="small")
    virtual = without_errors(virtual, rng) if ideal else virtual

    def pressed(phantom: str, force_n: float) -> list[TactileImage]:
        target = tsis.load_phantom(phantom)
        return [virtual.press(target, force_n=force_n) for _ in range(presses)]

    untouched = [virtual.no_contact() for _ in range(presses)]
    references = {
        "untouched probe": (untouched, untouched),
        "plain tissue": (pressed("plain", WEAK_N), pressed("plain", STRONG_N)),
    }
    found: dict[str, dict[str, list[Repeats]]] = {name: {kind: [] for kind in AGAINST} for name in FIGURES}
    targets = [
        (name, phantom, f"{truth:g} {figure.truth_unit}")
        for name, figure in FIGURES.items()
        for phantom, truth in zip(figure.phantoms, figure.truth, strict=True)
    ]
    plain = references["plain tissue"][1]
    frames = {"plain": replace(plain[0], grey=np.mean([frame.grey for frame in plain], axis=0))}
    for done, (name, phantom, label) in enumerate(targets, start=1):
        weak = pressed(phantom, WEAK_N) if name == "hardness" else []
        strong = pressed(phantom, STRONG_N)
        frames[phantom] = strong[0]
        for kind, (weak_reference, strong_reference) in references.items():
            site = Site(weak=weak, strong=strong, weak_reference=weak_reference, strong_reference=strong_reference)
            readings = site.readings(name, kind, virtual.calibration)
            found[name][kind].append(Repeats(label=label, readings=tuple(readings)))
        if progress is not None:
            progress(done, len(targets))
    return Result(
        probe=probe,
        readings={name: {kind: tuple(rows) for kind, rows in kinds.items()} for name, kinds in found.items()},
        frames=frames,
    )


def cell(value: float | None, width: int) -> str:
    """A number of a table, or a dash where there is none."""
    return f"{'-':>{width}}" if value is None or np.isnan(value) else f"{value:{width}.2f}"


def lines(result: Result) -> list[str]:
    """The readings beside the printed ones."""
    out = [f"probe {result.probe}"]
    for name, figure in FIGURES.items():
        for kind, targets in result.readings[name].items():
            out.append(f"figure {figure.number}, relative {name} in {figure.unit}, against {kind}")
            out.append(
                f"{'true':>9} {'mean':>9} {'sd':>8} {'ratio':>6} {'seen':>6}   printed: mean, sd, ratio; true ratio"
            )
            rows = zip(
                figure.truth,
                targets,
                ratios(targets),
                figure.printed_mean,
                figure.printed_sd,
                figure.printed_ratio,
                figure.true_ratio,
                strict=True,
            )
            for truth, target, ratio, mean, sd, printed, true in rows:
                relative = ratio if targets[0].observed == len(targets[0].readings) else None
                here = f"{cell(target.mean, 9)} {cell(target.sd, 8)} {cell(relative, 6)}"
                seen = f"{target.observed:3d}/{len(target.readings):2d}"
                there = f"{cell(mean, 8)} {cell(sd, 6)} {cell(printed, 6)} {cell(true, 6)}"
                out.append(f"{truth:5g} {figure.truth_unit:3} {here} {seen}   {there}")
            flags = sorted({flag for target in targets for reading in target.readings for flag in reading.flags})
            out.append(f"  flags: {', '.join(flags) or 'none'}")
            out += [f"  assumed: {sentence}" for sentence in targets[0].readings[0].assumptions]
    return [*out, "Research use only"]


def main() -> None:
    """Print the readings."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--probe", default="tsis-2011", help="tsis-2011 (flat, the source's) or tsis-domed")
    parser.add_argument("--presses", type=int, default=PRESSES, help="presses of each target")
    parser.add_argument("--ideal", action="store_true", help="one press of each target, without any error")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    presses = 1 if arguments.ideal else arguments.presses
    rng = np.random.default_rng(arguments.seed)
    with progress_bar("pressing phantoms") as progress:
        result = run(rng, presses=presses, probe=arguments.probe, ideal=arguments.ideal, progress=progress)
    print("\n".join(lines(result)))


if __name__ == "__main__":
    main()
