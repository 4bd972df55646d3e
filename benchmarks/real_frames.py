"""What is read off real frames, beside what is known of them.

    python benchmarks/real_frames.py --data ../shared/data/real

Two translucent-gel sensors (9DTact) pressed by a ball of 4.0 mm radius: grey change against the ball's depth inside the
contact, and contact radii found in three ways. A GelSight (Taxim) pressed 49 times: distance of the found centres from
hand-labelled ones.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from tsis.imaging import features, find_colour_contact, find_contact, radial_profile, signal
from tsis.instrument import read_image

BALL_RADIUS_MM = 4.0
MM_PER_PIXEL = {"sensor_1": 0.0510, "sensor_2": 0.0500}
MIDDLE = 0.7  # share of the contact's radius in which the ball's own shape is fitted


def ball_press(folder: Path) -> dict[str, float]:
    """Numbers of one sensor's ball press."""
    scale = (MM_PER_PIXEL[folder.name],) * 2
    pressed, untouched = (
        read_image(folder / f"depth_calibration_rectify_crop_{name}.png", mm_per_pixel=scale)
        for name in ("sample", "ref")
    )
    change = signal(pressed, untouched, invert=True)
    contact = find_contact(change, patch=features(pressed, untouched, invert=True).patch)
    if contact is None or contact.radius_mm is None:
        raise SystemExit(f"no contact found in {folder}")
    y, x = np.mgrid[: change.grey.shape[0], : change.grey.shape[1]]
    distance = scale[0] * np.hypot(x - contact.centre_px[0], y - contact.centre_px[1])
    inside, middle = distance < contact.radius_mm, distance < MIDDLE * contact.radius_mm
    height = np.sqrt(np.maximum(BALL_RADIUS_MM**2 - distance**2, 0.0)) - BALL_RADIUS_MM
    grey_per_mm, top = np.polyfit(height[middle], change.grey[middle], 1)
    depth = top / grey_per_mm
    rings = radial_profile(change, edges_mm=np.arange(0.0, 6.0, 0.1), centre_px=contact.centre_px)
    return {
        "correlation of grey change and depth": float(np.corrcoef(change.grey[inside], height[inside])[0, 1]),
        "radius of the steepest edge / mm": contact.radius_mm,
        "radius where the change is zero / mm": float(rings.radius_mm[np.argmax(rings.mean_grey < 0)]),
        "radius from the ball's geometry / mm": float(np.sqrt(2 * BALL_RADIUS_MM * depth - depth**2)),
    }


def centre_errors(path: Path) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Distances in px of the found centres from the labelled ones."""
    with np.load(path, allow_pickle=False) as data:
        untouched, presses, labels = data["f0"], data["imgs"], data["touch_center"]
    found = [find_colour_contact(press, untouched) for press in presses]
    centres = np.array([(np.nan, np.nan) if contact is None else contact.centre_px for contact in found])
    return np.asarray(np.hypot(*(centres - labels).T))


def main() -> int:
    """Print the tables; the exit code is 2 where the frames are absent."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=Path(__file__).parents[2] / "shared" / "data" / "real")
    data = parser.parse_args().data
    if not data.is_dir():
        print(f"{data} must be the folder of real frames; it does not exist", file=sys.stderr)
        return 2
    console = Console()
    columns = {sensor: ball_press(data / "9dtact" / sensor) for sensor in MM_PER_PIXEL}
    table = Table("9DTact, ball of 4.0 mm radius", *columns)
    for quantity in next(iter(columns.values())):
        table.add_row(quantity, *(f"{numbers[quantity]:.4f}" for numbers in columns.values()))
    console.print(table)
    errors = centre_errors(data / "taxim_ball" / "dataPack_small.npz")
    table = Table("Taxim, 49 presses", "px")
    for name, value in (("median", np.median(errors)), ("90 %", np.quantile(errors, 0.9)), ("largest", errors.max())):
        table.add_row(f"{name} error of the centre", f"{value:.2f}")
    console.print(table)
    return 0


if __name__ == "__main__":
    sys.exit(main())
