"""Contacts in frames of gel sensors: errors on real and on rendered frames.

    python -m benchmarks.gel_contacts --seed 2026 --rendered 60 --data ../shared/data/real

Real: 49 presses of a GelSight (Taxim) against hand-labelled centres, in two halves, the even ones of which the method
was developed on; the ball presses of two 9DTact sensors. Rendered: balls of 2 to 10 mm diameter on three sensors, under
lamps, blur, noise, gel thickness and Poisson's ratio that the method does not know
(`tsis.virtual.gel_frames.random_gel_press`).
Finite strain (`--finite N`): N gels a sensor, each pressed by a rigid and a soft ball (`VirtualGelSensor`), whose truth
is the Hertzian radius of the pressure's second moment. The last columns compare presses of the rigid ball with the edge
of the contact: under a ball, which is steeper than Hertz's paraboloid, it lies inside that radius.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from benchmarks.harness import Bench
from rich.console import Console
from rich.table import Table

from tsis.catalog.sensors import load_sensor
from tsis.imaging.gel_contact import contacts
from tsis.instrument.image_files import read_levels
from tsis.model.phantom import SoftSphere
from tsis.virtual.gel_frames import random_gel_press
from tsis.virtual.gel_sensor import VirtualGelSensor

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.virtual.gel_frames import RenderedPress

SENSORS = ("gelsight-mini", "gelsight-taxim", "9dtact")
FINITE_SENSORS = ("gelsight-mini", "gelsight-wedge", "9dtact")
WIDTH_90 = 1.645
RIGID = 9  # presses of a rigid ball on each gel at finite strain


def taxim(path: Path) -> Table:
    """Centre errors of the labelled presses."""
    with np.load(path, allow_pickle=False) as data:
        untouched, presses, labels = data["f0"], data["imgs"], data["touch_center"]
    found = contacts(list(presses), sensor=load_sensor("gelsight-taxim"), reference=untouched)
    table = Table(
        "Taxim", "frames", "good", "median / px", "90 % / px", "largest / px", "median less the mean shift / px"
    )
    for name, part in (("even (developed on)", slice(0, None, 2)), ("odd", slice(1, None, 2)), ("all", slice(None))):
        good = np.array([contact.good for contact in found[part]])
        shift = np.array([contact.centre_px for contact in found[part]]) - labels[part]
        error = np.hypot(*shift[good].T)
        aside = np.hypot(*(shift[good] - np.median(shift[good], axis=0)).T)
        table.add_row(
            name, str(len(good)), f"{good.mean():.0%}", f"{np.median(error):.2f}", f"{np.quantile(error, 0.9):.2f}",
            f"{error.max():.2f}", f"{np.median(aside):.2f}",
        )  # fmt: skip
    return table


def nine_d_tact(folder: Path) -> Table:
    """The two ball presses of 9DTact."""
    table = Table(
        "9DTact, ball of 4.0 mm radius", "good", "centre / px", "radius / mm", "sd / mm", "radius by makers / mm"
    )
    for sensor in ("sensor_1", "sensor_2"):
        frames = [
            read_levels(folder / sensor / f"depth_calibration_rectify_crop_{kind}.png") for kind in ("sample", "ref")
        ]
        (contact,) = contacts(frames[:1], sensor=load_sensor("9dtact"), reference=frames[1])
        levels = np.load(folder / sensor / "depth_calibration_Pixel_to_Depth.npy")
        change = (frames[1].astype(float) - frames[0]).mean(axis=2)
        deepest = float(np.interp(np.quantile(change, 0.9995), np.arange(levels.size), levels))
        by_makers = float(np.sqrt(2 * 4.0 * deepest - deepest**2))
        table.add_row(
            sensor, str(contact.good), f"{contact.centre_px[0]:.1f}, {contact.centre_px[1]:.1f}",
            f"{contact.radius_mm:.3f}", f"{contact.radius_sd_mm:.3f}", f"{by_makers:.3f}",
        )  # fmt: skip
    return table


def rendered(count: int, seed: int) -> Table:
    """Radius errors of rendered presses; intervals are of the radius in pixels, as the rendering's scale is exact."""
    rng = np.random.default_rng(seed)
    table = Table(
        "rendered",
        "presses",
        "good",
        "median radius error",
        "95 %",
        "bias",
        "90 % intervals hold",
        "median centre error / radius",
    )
    every = []
    for name in SENSORS:
        rows = []
        for _ in range(count):
            press = random_gel_press(load_sensor(name), rng)
            (contact,) = contacts([press.frame], sensor=press.sensor, reference=press.reference)
            error = contact.radius_px / press.radius_px - 1.0
            z = (contact.radius_px - press.radius_px) / contact.radius_sd_px
            centre = np.hypot(*np.subtract(contact.centre_px, press.centre_px)) / press.radius_px
            rows.append((contact.good, error, z, centre))
        every += rows
        table.add_row(name, *_row(rows))
    table.add_row("all", *_row(every))
    return table


def hertzian_over_edge(depth: float) -> float:
    """Hertzian radius of the pressure's second moment over the contact's edge under a rigid ball on a thick gel.

    ``depth`` is the edge over the ball's radius. The pressure is a sum of those of flat punches of radius t, with the
    weight ``t g'(t)``, ``g(t) = t/2 log((R + t)/(R - t))`` (Sneddon 1965), whose mean square radius is ``2/3 t²``.
    """
    t = depth * np.sqrt((np.arange(200) + 0.5) / 200)  # equal steps of t²
    slope = np.log((1 + t) / (1 - t)) / 2 + t / (1 - t**2)
    return float(np.sqrt(5 / 3 * (slope * t**2).sum() / slope.sum()) / depth)


def edge_px(press: RenderedPress) -> float:
    """Radius of the edge of a rigid ball's press whose Hertzian radius is known, pixels."""
    assert press.sensor.mm_per_pixel is not None
    side = float(np.sqrt(np.prod(press.sensor.mm_per_pixel)))
    edges = np.linspace(0.02, 0.95, 100)
    radii = edges * [hertzian_over_edge(float(edge)) for edge in edges]
    return float(np.interp(press.radius_px * side / press.ball_radius_mm, radii, edges)) * press.ball_radius_mm / side


def finite(gels: int, seed: int, sensors: Sequence[str]) -> Table:
    """Radius errors of presses at finite strain, by another code and other lamps than the estimate's."""
    table = Table(
        "finite strain", "presses", "good", "median radius error", "95 %", "bias", "90 % intervals hold",
        "median centre error / radius", "rigid: bias to the edge", "hold it",
    )  # fmt: skip
    every = []
    for number, name in enumerate(FINITE_SENSORS):
        if name not in sensors:
            continue
        rows = []
        for gel in range(gels):
            rng = np.random.default_rng([seed, number, gel])
            virtual = VirtualGelSensor(load_sensor(name), rng=rng)
            ball = SoftSphere(radius_mm=float(rng.uniform(4, 6)), young_kpa=float(rng.uniform(50, 200)))
            forces = [float(rng.uniform(0.5, 1.2)) * share for share in (0.3, 0.6, 0.9)]
            made = [
                *virtual.calibration_presses(RIGID, ball_radius_mm=3.0),
                *virtual.presses(ball, forces_n=sorted(forces)),
            ]
            found = contacts([press.frame for press in made], sensor=virtual.sensor, reference=virtual.reference)
            for index, (contact, press) in enumerate(zip(found, made, strict=True)):
                edge = edge_px(press) if index < RIGID else np.nan
                row = (
                    contact.good,
                    contact.radius_px / press.radius_px - 1.0,
                    (contact.radius_px - press.radius_px) / contact.radius_sd_px,
                    np.hypot(*np.subtract(contact.centre_px, press.centre_px)) / press.radius_px,
                    contact.radius_px / edge - 1.0,
                    (contact.radius_px - edge) / contact.radius_sd_px,
                )
                rows.append(row)
        every += rows
        table.add_row(name, *_row(rows))
    table.add_row("all", *_row(every))
    return table


def _row(rows: Sequence[tuple[float, ...]]) -> list[str]:
    values = np.array([row[1:] for row in rows if row[0]])
    error, z, centre = np.abs(values[:, 0]), values[:, 1], values[:, 2]
    edge = []
    if values.shape[1] > 3:
        rigid = values[~np.isnan(values[:, 3])]
        edge = [f"{np.median(rigid[:, 3]):+.2%}", f"{np.mean(np.abs(rigid[:, 4]) < WIDTH_90):.1%}"]
    return [
        str(len(rows)), f"{len(values) / len(rows):.0%}", f"{np.median(error):.2%}", f"{np.quantile(error, 0.95):.2%}",
        f"{np.median(values[:, 0]):+.2%}", f"{np.mean(np.abs(z) < WIDTH_90):.1%}", f"{np.median(centre):.3f}",
        *edge,
    ]  # fmt: skip


def main() -> int:
    """Print the tables."""
    bench = Bench(
        __doc__,
        data=Path(__file__).parents[1] / ".." / "shared" / "data" / "real",
        seed=2026,
        rendered=60,
        finite=0,
        sensors=[*FINITE_SENSORS],
    )
    console = Console(width=140)
    if bench.data.is_dir():
        console.print(taxim(bench.data / "taxim_ball" / "dataPack_small.npz"))
        console.print(nine_d_tact(bench.data / "9dtact"))
    else:
        print(f"{bench.data} does not exist: real frames are left out", file=sys.stderr)
    if bench.rendered:
        console.print(rendered(bench.rendered, bench.seed))
    if bench.finite:
        console.print(finite(bench.finite, bench.seed, bench.sensors))
    return bench.end()


if __name__ == "__main__":
    sys.exit(main())
