"""Figures 6.4, 6.5, 6.10, 6.11, 6.14 and 6.15: pictures and readings of three phantoms, from `studies.section_6_2`.

Each quantity is found with all errors of 15 presses, as the source's bars, and once without any.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from studies.panels import repeated_readings
from studies.section_6_2 import FIGURES, Result
from studies.section_6_2 import run as press_phantoms
from studies.shown import Shown

from tsis.imaging import features
from tsis.inclusion.relative import ratios

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from tsis.model.image import TactileImage

UNTOUCHED, PLAIN = "untouched probe", "plain tissue"
LEAST_GREY = 3.0  # change of a pixel that is more than noise
COARSE_PX = 8  # pixels of a frame to one of its picture: 0.3 mm, where what is seen is 7 mm wide and more
WIDTHS = {"size": (1, 2), "depth": (0, 1), "hardness": (0, 1, 2)}  # the others hardly leave the noise
NAMES = {"size": ("figure-6-4", "figure-6-5"), "depth": ("figure-6-10", "figure-6-11"),
         "hardness": ("figure-6-14", "figure-6-15")}  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Presses:
    """What was found with all errors, None where that was left out, and without any."""

    repeated: Result | None
    steady: Result

    @property
    def frames(self) -> Result:
        """Where sample pictures are taken from."""
        return self.repeated or self.steady


def run(rng: np.random.Generator) -> Presses:
    """Fifteen presses with all errors, and one without."""
    return Presses(repeated=press_phantoms(rng), steady=press_phantoms(rng, presses=1, ideal=True))


def short(rng: np.random.Generator) -> Presses:
    """One press without errors."""
    return Presses(repeated=None, steady=press_phantoms(rng, presses=1, ideal=True))


def labels(name: str) -> list[str]:
    """True values with their unit."""
    figure = FIGURES[name]
    return [f"{truth:g} {figure.truth_unit}" for truth in figure.truth]


def picture_values(presses: Presses, *, name: str) -> dict[str, float]:
    """Mean, greatest change and width of each tactile picture."""
    frames = presses.frames.frames
    found: dict[str, float] = {}
    for place, (phantom, label) in enumerate(zip(FIGURES[name].phantoms, labels(name), strict=True)):
        seen = features(frames[phantom], frames["plain"], least_grey=LEAST_GREY)
        found[f"mean of the picture, {label}"] = float(frames[phantom].grey.mean())
        if seen.contact or place in WIDTHS[name]:
            found[f"greatest change against plain tissue, {label}"] = seen.peak
        if place in WIDTHS[name]:
            found[f"width of the change, {label}"] = seen.equivalent_diameter_mm or 0.0
    return found


def size_values(presses: Presses) -> dict[str, float]:
    """Numbers of figure 6.5."""
    _, middle, large = (target.mean for target in presses.steady.readings["size"][PLAIN])
    found = {"8 mm inclusion, without errors": middle, "14 mm inclusion, without errors": large}
    if presses.repeated is not None:
        kinds = presses.repeated.readings["size"]
        _, to_middle, to_large = ratios(kinds[PLAIN])
        small, middle_target, large_target = kinds[PLAIN]
        found |= {
            "mean size of the 2 mm inclusion": small.mean,
            "mean size of the 8 mm inclusion": middle_target.mean,
            "mean size of the 14 mm inclusion": large_target.mean,
            "standard deviation, 2 mm": small.sd,
            "standard deviation, 14 mm": large_target.sd,
            "ratio of 8 to 2 mm": to_middle,
            "ratio of 14 to 2 mm": to_large,
            "2 mm inclusion, against the untouched probe": kinds[UNTOUCHED][0].mean,
            "14 mm inclusion, against the untouched probe": kinds[UNTOUCHED][2].mean,
        }
    return found


def depth_values(presses: Presses) -> dict[str, float]:
    """Numbers of figure 6.11."""
    found = {}
    for kind in (UNTOUCHED, PLAIN):
        _, middle, deep = ratios(presses.steady.readings["depth"][kind])
        found[f"ratio of 8 to 4 mm, against {kind}, without errors"] = middle
        found[f"ratio of 12 to 4 mm, against {kind}, without errors"] = deep
    if presses.repeated is not None:
        targets = presses.repeated.readings["depth"][UNTOUCHED]
        _, middle, deep = ratios(targets)
        found |= {
            "mean grey level at the centroid, 4 mm": targets[0].mean,
            "mean grey level at the centroid, 12 mm": targets[2].mean,
            "standard deviation, 4 mm": targets[0].sd,
            "standard deviation, 12 mm": targets[2].sd,
            "ratio of 8 to 4 mm": middle,
            "ratio of 12 to 4 mm": deep,
        }
    return found


def hardness_values(presses: Presses) -> dict[str, float]:
    """Numbers of figure 6.15."""
    _, middle, hard = ratios(presses.steady.readings["hardness"][PLAIN])
    found = {"ratio of 70 to 40 kPa, without errors": middle, "ratio of 100 to 40 kPa, without errors": hard}
    if presses.repeated is not None:
        targets = presses.repeated.readings["hardness"][PLAIN]
        _, middle, hard = ratios(targets)
        found |= {
            "mean reading, 40 kPa": targets[0].mean,
            "mean reading, 70 kPa": targets[1].mean,
            "mean reading, 100 kPa": targets[2].mean,
            "standard deviation, 70 kPa": targets[1].sd,
            "standard deviation, 100 kPa": targets[2].sd,
            "ratio of 70 to 40 kPa": middle,
            "ratio of 100 to 40 kPa": hard,
        }
    return found


def coarse(image: TactileImage, factor: int = COARSE_PX) -> NDArray[np.float64]:
    """Means over squares of pixels."""
    rows, columns = (length // factor for length in image.grey.shape)
    grey = image.grey[: rows * factor, : columns * factor]
    return np.asarray(grey.reshape(rows, factor, columns, factor).mean(axis=(1, 3)))


def draw_pictures(presses: Presses, figure: Figure, *, name: str) -> None:
    """Sample frames, and below them what the inclusion changed against plain tissue."""
    frames = presses.frames.frames
    shown = [frames[phantom] for phantom in FIGURES[name].phantoms]
    plain = coarse(frames["plain"])
    rows = {
        "grey level": [coarse(frame) for frame in shown],
        "change of\ngrey level": [coarse(frame) - plain for frame in shown],
    }
    axes = figure.subplots(2, 3, sharex=True, sharey=True)
    for line, (label, pictures) in zip(axes, rows.items(), strict=True):
        most = max(float(picture.max()) for picture in pictures)
        for axis, picture, frame in zip(line, pictures, shown, strict=True):
            drawn = axis.imshow(
                picture, cmap="viridis", vmin=0.0, vmax=most, extent=_extent(frame), interpolation="nearest"
            )
        figure.colorbar(drawn, ax=line, label=label, pad=0.01)
        line[0].set_ylabel("y / mm")
    for axis, label in zip(axes[0], labels(name), strict=True):
        axis.set_title(label, fontsize=10)
    for axis in axes[1]:
        axis.set_xlabel("x / mm")


def _extent(frame: TactileImage) -> tuple[float, float, float, float]:
    (rows, columns), (x, y), (wide, high) = frame.grey.shape, frame.axis(), frame.scale()
    return (-x * wide, (columns - x) * wide, (rows - y) * high, -y * high)


def draw_readings(presses: Presses, figure: Figure, *, name: str) -> None:
    """Bars of the readings against both references; of the hardness, their ratios beside them."""
    kinds, printed = presses.frames.readings[name], FIGURES[name]
    axes = figure.subplots(1, 2)
    against = {"size": (PLAIN, UNTOUCHED), "depth": (UNTOUCHED, PLAIN), "hardness": (PLAIN,)}[name]
    for axis, kind in zip(axes, against, strict=False):
        repeated_readings(kinds[kind], axis, printed_mean=printed.printed_mean, printed_sd=printed.printed_sd)
        axis.set_title(f"against {'the ' if kind == UNTOUCHED else ''}{kind}", fontsize=10)
        axis.set(xlabel="true")
    if name == "size":
        axes[1].set_ylim(top=31.0)  # room for the legend
    if name == "hardness":  # the printed values and those here lie an order of magnitude and more apart
        axes[0].set_yscale("log")
        axes[0].set_ylim(0.5, 600.0)
        draw_ratios(presses, axes[1], name=name)
    for axis in axes:
        axis.legend(fontsize=8, loc="upper right" if name == "depth" else "upper left")


def draw_ratios(presses: Presses, axis: Axes, *, name: str) -> None:
    """Readings over that of the first inclusion."""
    figure = FIGURES[name]
    axis.plot(figure.truth, figure.true_ratio, "-", color="0.4", label="true")
    axis.plot(figure.truth, figure.printed_ratio, "s", mfc="none", color="#d55e00", label="printed")
    axis.plot(figure.truth, ratios(presses.frames.readings[name][PLAIN]), "o", color="#0072b2", label="virtual presses")
    steady = ratios(presses.steady.readings[name][PLAIN])
    axis.plot(figure.truth, steady, "^--", color="#009e73", label="without any error")
    axis.set(xlabel=f"true / {figure.truth_unit}", ylabel="over the first inclusion's", ylim=(0.0, 3.4))
    axis.set_title("ratios, against plain tissue", fontsize=10)
    axis.grid(visible=True, axis="y", alpha=0.3)


READ = {"size": size_values, "depth": depth_values, "hardness": hardness_values}
SHOWN = tuple(
    shown
    for name, (picture, bars) in NAMES.items()
    for shown in (
        Shown(
            name=picture,
            run=run,
            short=short,
            values=partial(picture_values, name=name),
            draw=partial(draw_pictures, name=name),
        ),
        Shown(name=bars, run=run, short=short, values=READ[name], draw=partial(draw_readings, name=name)),
    )
)
