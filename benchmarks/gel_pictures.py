"""Pictures of gel contacts and depth maps beside the truth, to be looked at.

    python -m benchmarks.gel_pictures --seed 3201 --data ../shared/data/real --out gel-pictures

``good.png`` and ``refused.png`` show ten frames each with the outlines of ``tsis contacts``, ``depth.png`` the map of a
ball and of a press like a coin (a disc with a raised rim) beside the truth and their difference. Rendered frames have
lamps, blur, noise and gel that the method does not know; a dotted line is their true contact. With ``--data`` half of
the good frames are real ones of Taxim and 9DTact.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from scipy.ndimage import gaussian_filter

import tsis.present.figures
from tsis.catalog import load_sensor
from tsis.imaging import contacts
from tsis.imaging.depth import DepthMapper, calibrate_depth
from tsis.instrument import read_colour
from tsis.mechanics.gel import GelGrid, pressure_from_depth
from tsis.virtual.gel_frames import random_gel_light, random_gel_press, render_gel, rendered_series

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.imaging import GelContact
    from tsis.model import GelSensor
    from tsis.virtual.gel_frames import GelLight, RenderedPress

SHOWN = 10
COIN_MM, RIM_MM, RIM_HEIGHT_MM, COIN_DEPTH_MM = 3.0, 0.6, 0.15, 0.35


@dataclass(frozen=True, kw_only=True)
class Shown:
    """A frame with its contact, and the true circle where it is known."""

    frame: NDArray[Any]
    contact: GelContact
    circle: tuple[float, float, float] | None = None


def taken(
    name: str, frame: NDArray[Any], sensor: GelSensor, reference: NDArray[Any], circle: Any = None, before: Any = None
) -> Shown:
    """A frame and its contact; ``before`` is the frame before it in a sequence."""
    frames = [frame] if before is None else [before, frame]
    result = contacts(frames, sensor=sensor, reference=reference, names=[name] * len(frames), sequence=len(frames) > 1)
    return Shown(frame=frame, contact=result[-1], circle=circle)


def good(rng: np.random.Generator, data: Path) -> list[Shown]:
    """Ordinary presses, in part real."""
    shown = []
    if data.is_dir():
        with np.load(data / "taxim_ball" / "dataPack_small.npz", allow_pickle=False) as pack:
            untouched, presses = pack["f0"], pack["imgs"]
        shown += [
            taken(f"Taxim {number}", presses[number], load_sensor("gelsight-taxim"), untouched)
            for number in sorted(rng.choice(len(presses), 3, replace=False))
        ]
        for folder in sorted((data / "9dtact").glob("sensor_*"))[:2]:
            pair = [read_colour(folder / f"depth_calibration_rectify_crop_{kind}.png") for kind in ("sample", "ref")]
            shown.append(taken(f"9DTact {folder.name}", pair[0], load_sensor("9dtact"), pair[1]))
    names = ("gelsight-mini", "gelsight-wedge", "9dtact")
    while len(shown) < SHOWN:
        name = names[len(shown) % len(names)]
        made = random_gel_press(load_sensor(name), rng)
        shown.append(taken(name, made.frame, made.sensor, made.reference, circle_of(made)))
    return shown


def circle_of(made: RenderedPress) -> tuple[float, float, float]:
    """The true contact."""
    return (*made.centre_px, made.radius_px)


def refused(rng: np.random.Generator) -> list[Shown]:
    """Presses with one fault each: what a user does wrong, or the sensor cannot show."""
    sensor = load_sensor("gelsight-mini")
    columns, rows = sensor.image_px
    light = random_gel_light((rows, columns), rng, size_px=25.0)

    def press(ball_mm: float = 3.0) -> RenderedPress:
        return random_gel_press(sensor, rng, ball_radius_mm=ball_mm, light=light, thickness_mm=4.0)

    def frame_of(depth: NDArray[np.float64], of: GelSensor = sensor) -> NDArray[np.uint8]:
        return render_gel(depth, of, light, rng)

    first, second = press(), press()
    untouched = first.reference
    x, y = (round(part) for part in first.centre_px)
    two = np.roll(first.depth_mm, (rows // 2, columns // 2), axis=(0, 1)) + first.depth_mm
    glare = first.frame.copy()
    spot = np.hypot(*(np.mgrid[:rows, :columns] - np.array([y, x])[:, None, None])) < 0.8 * first.radius_px
    glare[spot] = 255
    right, down = np.mgrid[:rows, :columns][::-1]
    edge = 0.5 / (1.0 + np.exp((right - columns / 2 + 0.3 * (down - rows / 2)) / 6.0))
    faint = 0.004 * np.exp(-(np.hypot(right - 160, down - 120) ** 2) / (2.0 * 15.0**2))
    letter = np.zeros((rows, columns))
    letter[60:180, 110:130] = letter[160:180, 110:210] = 0.4
    ring = 0.4 * np.exp(-(((np.hypot(right - 160, down - 120) - 45.0) / 6.0) ** 2))
    aside = np.roll(first.depth_mm, -x, axis=1)
    aside[:, columns // 2 :] = 0.0
    return [
        taken("untouched", frame_of(0.0 * faint), sensor, untouched),
        taken("two balls", frame_of(two), sensor, untouched),
        taken("half outside", frame_of(aside), sensor, untouched),
        taken("glare", glare, sensor, untouched),
        taken("moved", second.frame, sensor, untouched, circle_of(second), before=first.frame),
        taken("straight edge", frame_of(edge), sensor, untouched),
        taken("very faint", frame_of(faint), sensor, untouched),
        taken("a letter L", frame_of(gaussian_filter(letter, 2.0)), sensor, untouched),
        taken("a ring", frame_of(ring), sensor, untouched),
        taken("ridges", frame_of(0.03 + 0.03 * np.sin(right / 8.0)), sensor, untouched),
    ]


def coin_depth(sensor: GelSensor, centre_px: tuple[float, float]) -> NDArray[np.float64]:
    """The gel's face under a rigid coin with a raised rim, by the Green's function of its layer."""
    columns, rows = sensor.image_px
    scale = sensor.scale_of(columns, rows) or (1.0, 1.0)
    y, x = np.mgrid[:rows, :columns]
    radius = np.hypot((x - centre_px[0]) * scale[0], (y - centre_px[1]) * scale[1])
    raised = RIM_HEIGHT_MM * (radius > COIN_MM - RIM_MM)
    coin = np.where(radius <= COIN_MM, COIN_DEPTH_MM + gaussian_filter(raised, 1.5), 0.0)
    grid = GelGrid((rows, columns), scale, sensor.young_kpa.best, sensor.poisson.best, sensor.thickness_mm.best)
    return grid.depth_mm(pressure_from_depth(coin, grid, contact=radius <= COIN_MM).pressure_kpa)


def depth_rows(name: str, seed: int) -> list[tuple[str, NDArray[np.float64], NDArray[np.float64], tuple[float, float]]]:
    """Title, true depth, mapped depth and scale of a ball and of a coin."""
    sensor, rng = load_sensor(name), np.random.default_rng([seed, 1])
    made = rendered_series(sensor, 11, ball_radius_mm=3.0, seed=seed)
    light = _light_of(sensor, seed)
    calibration = calibrate_depth(
        [press.frame for press in made[:9]], sensor=sensor, reference=made[0].reference, ball_mm=6.0
    )
    mapper = DepthMapper(calibration, sensor, made[0].reference)
    ball = max(made[9:], key=lambda press: press.radius_px)
    columns, rows = sensor.image_px
    coin = coin_depth(sensor, (columns / 2, rows / 2))
    return [
        (f"{name}: ball of 6 mm", ball.depth_mm, mapper.map(ball.frame).depth_mm, mapper.mm_per_pixel),
        (f"{name}: coin", coin, mapper.map(render_gel(coin, sensor, light, rng)).depth_mm, mapper.mm_per_pixel),
    ]


def _light_of(sensor: GelSensor, seed: int) -> GelLight:
    """The lamps of `rendered_series` of that seed, which draws them first."""
    columns, rows = sensor.image_px
    return random_gel_light((rows, columns), np.random.default_rng(seed), size_px=0.08 * columns)


def draw_frames(shown: list[Shown], title: str) -> Figure:
    """Frames with found outlines and true ones."""
    figure = Figure(figsize=(15, 6.5), layout="constrained")
    for ax, one in zip(figure.subplots(2, 5).ravel(), shown, strict=True):
        tsis.present.figures.gel_contact(one.frame, one.contact, ax)
        if one.circle is not None:
            ax.add_patch(Circle(one.circle[:2], one.circle[2], fill=False, color="white", linestyle=":"))
    figure.suptitle(f"{title}. Research use only")
    return figure


def draw_depths(rows: list[Any]) -> Figure:
    """Truth, map and difference, one row a press."""
    figure = Figure(figsize=(13, 3.1 * len(rows)), layout="constrained")
    for axes, (title, truth, mapped, scale) in zip(figure.subplots(len(rows), 3), rows, strict=True):
        for ax, values, label in zip(
            axes, (truth, mapped, mapped - truth), ("truth", "map", "map less truth"), strict=True
        ):
            tsis.present.figures.gel_depth(values, ax, mm_per_pixel=scale, label=f"{label} / mm")
            ax.set_title(title, fontsize=9)
    figure.suptitle("Depth. Research use only")
    return figure


def main() -> None:
    """Write the pictures and print what they show."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=3201)
    parser.add_argument("--data", type=Path, default=Path(__file__).parents[1] / ".." / "shared" / "data" / "real")
    parser.add_argument("--out", type=Path, default=Path("gel-pictures"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    for name, shown in (
        ("good", good(np.random.default_rng(options.seed), options.data)),
        ("refused", refused(np.random.default_rng([options.seed, 2]))),
    ):
        draw_frames(shown, f"Contacts that should be {name}").savefig(options.out / f"{name}.png", dpi=80)
        for one in shown:
            verdict = "good" if one.contact.good else ", ".join(one.contact.reasons)
            print(f"{name:8} {one.contact.name:16} quality {one.contact.quality:.2f}  {verdict}", flush=True)
    maps = [row for sensor in ("gelsight-mini", "9dtact") for row in depth_rows(sensor, options.seed)]
    draw_depths(maps).savefig(options.out / "depth.png", dpi=80)
    for title, truth, mapped, _ in maps:
        inside = truth > 0.5 * truth.max()
        rms = float(np.sqrt(np.mean(np.square((mapped - truth)[inside]))))
        print(f"depth    {title:28} deepest {truth.max():.3f} mm, RMS where deeper than half of it {rms:.4f} mm")


if __name__ == "__main__":
    main()
