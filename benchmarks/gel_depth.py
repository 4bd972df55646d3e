"""Depth of gel sensors: real and rendered presses that were not used in the calibration, and the speed.

    python -m benchmarks.gel_depth --seed 2026 --data ../shared/data/real

Real: presses of a 4.00 mm ball on the GelSight of Taxim (stated, unchecked), calibrated on every fourth press. The odd
ones are measured against the ball's cap, the press depth the only free number, inside .8 of the contact; two further
rows leave out what an error of the contact's centre, and of the curvature, makes. Rendered: a ball of 6 mm, calibrated
on nine presses; five others are measured against the true face, inside the contact.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np
from benchmarks.harness import Bench
from rich.console import Console
from rich.table import Table

from tsis.catalog.sensors import load_sensor
from tsis.imaging.depth import DepthMap, DepthMapper, calibrate_depth, cap_error_mm
from tsis.imaging.gel_contact import GelContact, contacts
from tsis.virtual.gel_frames import rendered_series


def real(path: Path, table: Table) -> None:
    """The presses of Taxim."""
    with np.load(path, allow_pickle=False) as data:
        untouched, presses = data["f0"], list(data["imgs"])
    sensor = load_sensor("gelsight-taxim")
    calibration = calibrate_depth(presses[::4], sensor=sensor, reference=untouched, ball_mm=4.0)
    mapper = DepthMapper(calibration, sensor, untouched)
    found = contacts(presses[1::2], sensor=sensor, reference=untouched)
    good = [(mapper.map(frame), contact) for frame, contact in zip(presses[1::2], found, strict=True) if contact.good]
    errors = [cap_error_mm(depth, contact, 2.0) for depth, contact in good]
    table.add_row("Taxim, real", calibration.method, str(len(errors)), *_numbers(errors))
    parts = np.array([explained(depth, contact) for depth, contact in good])
    for label, column in (("  the ball's place free too", 0), ("  its curvature free too", 1)):
        table.add_row(label, "", str(len(parts)), *_numbers(list(parts[:, column])))


def explained(depth: DepthMap, contact: GelContact, ball_radius_mm: float = 2.0) -> tuple[float, float]:
    """What is left of `cap_error_mm` without the plane that an error of the centre makes, and without its curvature.

    A cap whose centre lies d aside differs from the true one by the plane of slope d over the ball's radius.
    """
    rows, columns = depth.depth_mm.shape
    y, x = np.mgrid[:rows, :columns]
    scale = depth.mm_per_pixel
    x, y = (x - contact.centre_px[0]) * scale[0], (y - contact.centre_px[1]) * scale[1]
    squared = x**2 + y**2
    inside = np.sqrt(squared) < 0.8 * min(contact.radius_px * float(np.sqrt(np.prod(scale))), 0.98 * ball_radius_mm)
    off = (depth.depth_mm - np.sqrt(np.maximum(ball_radius_mm**2 - squared, 0.0)))[inside]
    columns_of = [np.ones(off.size), x[inside], y[inside], squared[inside]]
    left = [np.linalg.lstsq(np.stack(columns_of[:count], axis=1), off, rcond=None)[0] for count in (3, 4)]
    first, second = (float(np.std(off - np.stack(columns_of[: len(c)], axis=1) @ c)) for c in left)
    return first, second


def rendered(name: str, seed: int, table: Table) -> None:
    """Presses of one ball on one rendered sensor, and the CPU time of a map."""
    sensor = load_sensor(name)
    made = rendered_series(sensor, 14, ball_radius_mm=3.0, seed=seed)
    calibration = calibrate_depth(
        [press.frame for press in made[:9]], sensor=sensor, reference=made[0].reference, ball_mm=6.0
    )
    mapper = DepthMapper(calibration, sensor, made[0].reference)
    errors = []
    for press in made[9:]:
        depth = mapper.map(press.frame).depth_mm
        y, x = np.mgrid[: depth.shape[0], : depth.shape[1]]
        inside = np.hypot(x - press.centre_px[0], y - press.centre_px[1]) < press.radius_px
        errors.append(float(np.sqrt(np.mean(np.square((depth - press.depth_mm)[inside])))))
    start = time.process_time()
    for press in made[9:]:
        mapper.map(press.frame)
    spent = (time.process_time() - start) / len(made[9:])
    columns, rows = sensor.image_px
    label = f"{name}, rendered, {columns} x {rows}: {1000 * spent:.0f} ms of CPU a frame"
    table.add_row(label, calibration.method, str(len(errors)), *_numbers(errors))


def _numbers(errors: list[float]) -> tuple[str, ...]:
    return (
        f"{float(np.sqrt(np.mean(np.square(errors)))):.4f}",
        f"{float(np.median(errors)):.4f}",
        f"{max(errors):.4f}",
    )


def main() -> int:
    """Print the table."""
    bench = Bench(__doc__, data=Path(__file__).parents[1] / ".." / "shared" / "data" / "real", seed=2026)
    table = Table("depth", "method", "presses", "RMS / mm", "median / mm", "largest / mm")
    file = bench.data / "taxim_ball" / "dataPack_small.npz"
    if file.exists():
        real(file, table)
    else:
        print(f"{file} does not exist: real frames are left out", file=sys.stderr)
    for name in ("gelsight-mini", "9dtact"):
        rendered(name, bench.seed, table)
    Console(width=140).print(table)
    return bench.end()


if __name__ == "__main__":
    sys.exit(main())
