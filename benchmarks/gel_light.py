"""Depth of gel sensors after the light has changed since the calibration, on rendered presses.

    python -m benchmarks.gel_light --seed 51001 --seeds 3 --calibration-presses 8

Lamps, white balance and gamma of a camera change the frame alone, or frame and untouched frame. Each seed is one
sensor, calibrated on some presses of a ball of 6 mm in the first light, and two further presses. The error is that of
the depth inside the true contact; a map with a problem, and a frame that is refused, count as flagged.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from benchmarks.harness import Bench, Goal

from tsis.catalog.sensors import load_sensor
from tsis.errors import ImageMismatchError
from tsis.imaging.depth import DepthMapper, calibrate_depth
from tsis.virtual.gel_frames import RenderedPress, rendered_series

if TYPE_CHECKING:
    from numpy.typing import NDArray

SENSORS = ("gelsight-mini", "9dtact")
MOST_RMS_MM = 0.03
JUDGED = 2  # presses of each seed


@dataclass(frozen=True, slots=True, kw_only=True)
class Light:
    """A change of the light: gains of the channels, and the exponent of the levels."""

    name: str
    gain: tuple[float, float, float] = (1.0, 1.0, 1.0)
    gamma: float = 1.0

    def seen(self, frame: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """The frame as the camera stores it in this light."""
        lit = np.clip(frame * np.array(self.gain), 0.0, 255.0) / 255.0
        stored: NDArray[np.uint8] = np.rint(255.0 * lit**self.gamma).astype(np.uint8)
        return stored


LIGHTS = (
    Light(name="as calibrated"),
    Light(name="lamps 0.7", gain=(0.7, 0.7, 0.7)),
    Light(name="lamps 1.3", gain=(1.3, 1.3, 1.3)),
    Light(name="white balance 0.8, 1, 1.2", gain=(0.8, 1.0, 1.2)),
    Light(name="gamma 0.8", gamma=0.8),
    Light(name="gamma 1.2", gamma=1.2),
    Light(name="all at once", gain=(0.72, 0.8, 0.88), gamma=1.1),
)


def rms_mm(mapper: DepthMapper, press: RenderedPress, frame: NDArray[np.uint8]) -> tuple[float, bool]:
    """Error inside the contact, mm, and whether the map is flagged; a refused frame is flagged, its error is zero."""
    try:
        found = mapper.map(frame)
    except ImageMismatchError:
        return 0.0, True
    y, x = np.mgrid[: press.depth_mm.shape[0], : press.depth_mm.shape[1]]
    inside = np.hypot(x - press.centre_px[0], y - press.centre_px[1]) < press.radius_px
    error = (found.depth_mm - press.depth_mm)[inside]
    return float(np.sqrt(np.mean(error**2))), bool(found.problems)


def main() -> int:
    """Print a row for each sensor, seed and light, and the goals."""
    bench = Bench(__doc__, seed=51001, seeds=3, calibration_presses=8)
    rows, worst, silent, count = [], 0.0, 0, 0
    for name in SENSORS:
        sensor = load_sensor(name)
        for seed in range(bench.seed, bench.seed + bench.seeds):
            made = rendered_series(sensor, bench.calibration_presses + JUDGED, ball_radius_mm=3.0, seed=seed)
            first, judged = made[: bench.calibration_presses], made[bench.calibration_presses :]
            calibration = calibrate_depth(
                [press.frame for press in first], sensor=sensor, reference=made[0].reference, ball_mm=6.0
            )
            for light in LIGHTS:
                for both in (False, True):
                    found = [
                        rms_mm(
                            DepthMapper(calibration, sensor, light.seen(press.reference) if both else press.reference),
                            press,
                            light.seen(press.frame),
                        )
                        for press in judged
                    ]
                    unseen = [error for error, flagged in found if not flagged]
                    worst = max([worst, *unseen])
                    silent += sum(error > MOST_RMS_MM for error in unseen)
                    count += len(found)
                    rows.append(
                        (
                            name,
                            str(seed),
                            light.name,
                            "frame and untouched" if both else "frame",
                            f"{max(error for error, _ in found):.3f}",
                            str(sum(flagged for _, flagged in found)),
                        )
                    )
    heads = ("sensor", "seed", "light", "changed", "largest RMS, mm", "flagged of 2")
    bench.table("Depth in another light", heads, rows)
    return bench.end(
        [
            Goal(name="largest RMS without a flag, mm", value=worst, most=MOST_RMS_MM, form="{:.3f}"),
            Goal(name=f"maps beyond it without a flag, of {count}", value=float(silent), most=0.0, form="{:.0f}"),
        ]
    )


if __name__ == "__main__":
    sys.exit(main())
