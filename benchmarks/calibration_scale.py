"""Do the intervals of the scale hold? Boards and balls pressed virtually, and real frames of two sensors.

    python -m benchmarks.calibration_scale --runs 500

Each run draws a camera, its distortion, the board's angle, place, gaps and scatter, none of which the estimator knows.
The truth is the drawn lens itself: the way on the face between the places in the image one pitch to either side of the
frame's middle. With ``--ball`` a ball is pressed to three depths; with ``--real FOLDER`` the dot boards and balls of
two translucent-gel sensors (9DTact) are set beside what their makers published.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from benchmarks.harness import Bench
from scipy.optimize import root

from tsis.calibration.dot_board import scale_from_dots
from tsis.calibration.scale import axis_ratio_from_ball, scale_from_ball
from tsis.errors import CalibrationError
from tsis.imaging.sensor import Sensor
from tsis.instrument.image_files import read_image
from tsis.virtual.calibration_bench import ball_frame, dot_board_frame, untouched_frame

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.calibration.scale import PixelScale

LEVEL = 0.95
LENS = 0.03  # largest relative change of a length at the frame's corner
PITCH_MM, PITCH_SD_MM = 2.5, 0.0005
BALL_RADIUS_MM, BALL_RADIUS_SD_MM, TRAVEL_SD_MM = 4.0, 0.005, 0.005


def drawn_sensor(rng: np.random.Generator) -> Sensor:
    """A camera with pixels of any usual size and shape."""
    width = rng.uniform(0.028, 0.042)
    return Sensor(
        columns=640,
        rows=480,
        mm_per_pixel=(width, width * rng.uniform(0.85, 1.2)),
        read_noise_grey=rng.uniform(0.5, 2.0),
        shot_noise_grey=rng.uniform(0.01, 0.05),
    )


def true_scale(sensor: Sensor, distortion: float, angle_deg: float) -> NDArray[np.float64]:
    """Size (x, y) of a pixel about the frame's middle: the mean over one pitch to either side along the board."""
    x, y = sensor.axes_mm()
    corner = float(x[-1] ** 2 + y[-1] ** 2)
    turn = np.radians(angle_deg)
    way = PITCH_MM * np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])

    def seen_px(face: NDArray[np.float64]) -> NDArray[np.float64]:
        def miss(at: NDArray[np.float64]) -> NDArray[np.float64]:
            return at * (1 + distortion * (at @ at) / corner) - face

        return np.asarray(root(miss, face, tol=1e-13).x / sensor.mm_per_pixel)

    step = np.stack([(seen_px(face) - seen_px(-face)) / 2 for face in way.T], axis=1)
    return np.asarray(np.linalg.norm(way @ np.linalg.inv(step), axis=0))


def dot_run(rng: np.random.Generator, lens: float) -> tuple[PixelScale, NDArray[np.float64]]:
    """One board, seen through a lens that distorts by up to ``lens`` at the corner, and the true scale."""
    sensor = drawn_sensor(rng)
    angle, distortion = rng.uniform(-45.0, 45.0), rng.uniform(-lens, lens)
    pitch = PITCH_MM + PITCH_SD_MM * rng.standard_normal()
    frame = dot_board_frame(
        sensor,
        rng=rng,
        pitch_mm=pitch,
        dot_diameter_mm=rng.uniform(0.6, 1.1),
        angle_deg=angle,
        offset_mm=(rng.uniform(-1.2, 1.2), rng.uniform(-1.2, 1.2)),
        scatter_mm=rng.uniform(0.003, 0.02),
        missing=rng.uniform(0.0, 0.1),
        strays=int(rng.integers(0, 4)),
        distortion=distortion,
        contrast=rng.uniform(0.15, 0.4),
        bright=bool(rng.integers(2)),
        blur_px=rng.uniform(1.0, 4.0),
    )
    reference = untouched_frame(sensor, rng=rng) if rng.integers(2) else None
    scale, _ = scale_from_dots(frame, reference, pitch_mm=PITCH_MM, pitch_sd_mm=PITCH_SD_MM)
    return scale, true_scale(sensor, distortion, angle)


def ball_run(rng: np.random.Generator) -> tuple[PixelScale, NDArray[np.float64]]:
    """One ball at three depths, and the true scale."""
    sensor = drawn_sensor(rng)
    radius = BALL_RADIUS_MM + BALL_RADIUS_SD_MM * rng.standard_normal()
    travel = np.array([0.0, 0.4, 0.8])
    depths = rng.uniform(0.5, 0.8) + travel + TRAVEL_SD_MM * rng.standard_normal(3)
    middle = rng.uniform(-0.5, 0.5, 2)
    frames = [
        ball_frame(
            sensor,
            rng=rng,
            ball_radius_mm=radius,
            depth_mm=float(depth),
            offset_mm=(
                float(middle[0] + 0.05 * rng.standard_normal()),
                float(middle[1] + 0.05 * rng.standard_normal()),
            ),
            conforming=rng.uniform(0.8, 0.95),
            blur_px=rng.uniform(1.0, 3.0),
        )
        for depth in depths
    ]
    scale, _ = scale_from_ball(
        frames,
        untouched_frame(sensor, rng=rng),
        ball_radius_mm=BALL_RADIUS_MM,
        ball_radius_sd_mm=BALL_RADIUS_SD_MM,
        travel_mm=travel.tolist(),
        travel_sd_mm=TRAVEL_SD_MM,
    )
    return scale, np.array(sensor.mm_per_pixel)


def covered(runs: int, seed: int, *, ball: bool, lens: float = LENS) -> dict[str, object]:
    """How often the intervals hold the truth, and how far the scale is from it."""
    held, errors, widths, seconds, refused = [], [], [], 0.0, 0
    for child in np.random.default_rng(seed).spawn(runs):
        start = time.perf_counter()
        try:
            scale, truth = ball_run(child) if ball else dot_run(child, lens)
        except CalibrationError as refusal:
            print(f"refused: {refusal}", file=sys.stderr)
            refused += 1
            continue
        seconds += time.perf_counter() - start
        sizes = (scale.mm_per_pixel_x, scale.mm_per_pixel_y)
        ends = [size.interval(LEVEL) for size in sizes]
        held.append([low <= true <= high for (low, high), true in zip(ends, truth, strict=True)])
        errors.append([size.value / true - 1 for size, true in zip(sizes, truth, strict=True)])
        widths.append([size.sd / size.value for size in sizes])
    share = 100 * np.mean(held, axis=0)
    off = 100 * np.array(errors)
    return {
        "runs": runs,
        "refused": refused,
        "held x / %": round(float(share[0]), 1),
        "held y / %": round(float(share[1]), 1),
        "mean error x / %": round(float(off[:, 0].mean()), 4),
        "mean error y / %": round(float(off[:, 1].mean()), 4),
        "mean size of error / %": round(float(np.abs(off).mean()), 4),
        "mean standard uncertainty / %": round(float(100 * np.mean(widths)), 4),
        "seconds a run, frames included": round(seconds / max(len(held), 1), 2),
    }


def real_sensor(folder: Path) -> dict[str, str]:
    """Dot board and ball of one sensor, beside the one number that its makers published for both axes."""
    published = float(np.load(folder / "camera_calibration_position_scale.npy", allow_pickle=False)[2])
    board, untouched = (read_image(folder / f"camera_calibration_{name}.png") for name in ("sample", "ref"))
    scale, found = scale_from_dots(board, untouched, pitch_mm=PITCH_MM)
    rows = {"published / (mm/px)": f"{published:.5f}"}
    for axis, size in zip("xy", (scale.mm_per_pixel_x, scale.mm_per_pixel_y), strict=True):
        rows[f"dots, {axis} / (mm/px)"] = f"{size.value:.5f} +- {size.sd:.5f}"
        rows[f"dots, {axis}, off the published / %"] = f"{100 * (size.value / published - 1):+.2f}"
    rows |= {
        "dots used, strays": f"{scale.count}, {len(found.strays_px)}",
        "order, residual / px": f"{found.order}, {scale.residual_px:.2f}",
        "largest change of scale over the board": f"{found.largest_change:.0%}",
    }
    for title, name in (("rectified", "depth_calibration_rectify_crop"), ("raw", "depth_calibration")):
        ball, bare = (read_image(folder / f"{name}_{kind}.png") for kind in ("sample", "ref"))
        ratio = axis_ratio_from_ball(ball, bare)
        rows[f"ball, {title}: height over width of a pixel"] = f"{ratio.value:.4f} +- {ratio.sd:.4f}"
    rows["dots: height over width of a pixel"] = f"{scale.mm_per_pixel[1] / scale.mm_per_pixel[0]:.4f}"
    return rows


def main() -> int:
    """Print the tables; the exit code is 2 where the folder of real frames is absent."""
    bench = Bench(__doc__, runs=500, seed=1, lens=LENS, ball=False, real=Path)
    if bench.real is not None:
        if not bench.real.is_dir():
            print(f"{bench.real} must be the folder of real frames; it does not exist", file=sys.stderr)
            return 2
        sensors = {name: real_sensor(bench.real / name) for name in ("sensor_1", "sensor_2")}
        rows = [[what, *(numbers[what] for numbers in sensors.values())] for what in sensors["sensor_1"]]
        bench.table("Real frames", ["", *sensors], rows)
        return bench.end()
    numbers = covered(bench.runs, bench.seed, ball=bench.ball, lens=bench.lens)
    title = f"Scale from {'a ball at three depths' if bench.ball else 'a dot board'}, intervals of {LEVEL:.0%}"
    bench.table(title, ["", "found"], [[what, str(value)] for what, value in numbers.items()])
    return bench.end()


if __name__ == "__main__":
    sys.exit(main())
