"""Scale from a board of dots: drawn boards, hostile ones, real ones; spots in noise."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter
from scipy.stats import norm

from tsis.calibration.dot_board import (
    BORDER,
    STEP,
    DotDiagnostics,
    _noise_gain,
    _peaks,
    _sub_pixel,
    find_spots,
    scale_from_dots,
)
from tsis.errors import CalibrationError, ImageMismatchError, InputError
from tsis.imaging.sensor import Sensor
from tsis.instrument.image_files import read_image
from tsis.model.image import TactileImage
from tsis.virtual.calibration_bench import dot_board_frame, untouched_frame

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

    from tsis.calibration.scale import PixelScale


SENSOR = Sensor(columns=640, rows=480, mm_per_pixel=(0.034, 0.042))
PITCH_MM = 2.5


@cache
def board(seed: int = 1, sensor: Sensor = SENSOR, **drawn: float | tuple[float, float]) -> TactileImage:
    return dot_board_frame(sensor, rng=np.random.default_rng(seed), pitch_mm=PITCH_MM, **drawn)  # type: ignore[arg-type]


def near_truth(scale: PixelScale, truth: tuple[float, float], *, sds: float = 4.5) -> bool:
    sizes = (scale.mm_per_pixel_x, scale.mm_per_pixel_y)
    # 2e-4: the truth is that of the middle, the scale that of a pitch about it.
    return all(abs(size.value - true) < sds * size.sd + 2e-4 * true for size, true in zip(sizes, truth, strict=True))


@pytest.mark.parametrize("angle_deg", [0.0, 31.7, -30.0])
def test_turned_boards_give_both_axes_and_the_angle(angle_deg: float) -> None:
    scale, found = scale_from_dots(board(angle_deg=angle_deg), pitch_mm=PITCH_MM)
    assert near_truth(scale, SENSOR.mm_per_pixel)
    assert max(scale.mm_per_pixel_x.sd / 0.034, scale.mm_per_pixel_y.sd / 0.042) < 3e-3
    assert abs((scale.rotation_deg - angle_deg + 45.0) % 90.0 - 45.0) < 0.2
    assert abs(scale.skew_deg) < 0.5
    assert scale.method == "dots"
    assert scale.count == len(found.centres_px) == len(found.cells)


@settings(max_examples=4)
@given(
    width=st.floats(0.03, 0.045),
    share=st.floats(0.82, 1.22),
    angle_deg=st.floats(-45.0, 45.0),
    seed=st.integers(0, 10_000),
)
def test_any_camera_and_any_angle(width: float, share: float, angle_deg: float, seed: int) -> None:
    sensor = Sensor(columns=640, rows=480, mm_per_pixel=(width, width * share))
    scale, _ = scale_from_dots(board(seed, sensor, angle_deg=angle_deg), pitch_mm=PITCH_MM)
    assert near_truth(scale, sensor.mm_per_pixel, sds=6.0)


@pytest.mark.parametrize("bright", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_gaps_and_strays_do_not_matter(bright: bool) -> None:
    for seed in range(2):
        frame = board(seed, angle_deg=-20.0 + 33.0 * seed, missing=0.2, strays=6, bright=bright)
        scale, found = scale_from_dots(frame, pitch_mm=PITCH_MM)
        assert near_truth(scale, SENSOR.mm_per_pixel)
        assert found.bright == bright
        assert len(found.strays_px) > 0


def test_one_dot_far_off_its_place_is_a_stray() -> None:
    frame = board(scatter_mm=0.002)
    _, before = scale_from_dots(frame, pitch_mm=PITCH_MM)
    grey = frame.grey.copy()
    x, y = np.rint(before.centres_px[np.argmin(np.abs(before.cells).sum(axis=1))]).astype(int)
    grey[y - 25 : y + 26, x - 25 : x + 26] = np.roll(grey[y - 25 : y + 26, x - 25 : x + 26], 6, axis=1)
    scale, after = scale_from_dots(TactileImage(grey=grey), pitch_mm=PITCH_MM)
    assert len(after.strays_px) == 1 + len(before.strays_px)
    np.testing.assert_allclose(after.strays_px[-1], (x + 6, y), atol=1.5)
    assert near_truth(scale, SENSOR.mm_per_pixel)


def test_distortion_is_seen_and_does_not_shift_the_scale() -> None:
    _, straight = scale_from_dots(board(distortion=0.0), pitch_mm=PITCH_MM)
    assert not straight.distorted
    scale, bent = scale_from_dots(board(distortion=-0.03), pitch_mm=PITCH_MM)
    assert bent.distorted
    assert bent.largest_change > 2 * straight.largest_change
    assert near_truth(scale, SENSOR.mm_per_pixel)


def test_the_pitch_brings_its_own_uncertainty() -> None:
    frame = board()
    known, _ = scale_from_dots(frame, pitch_mm=PITCH_MM)
    unsure, _ = scale_from_dots(frame, pitch_mm=PITCH_MM, pitch_sd_mm=0.05)
    for sharp, wide in ((known.mm_per_pixel_x, unsure.mm_per_pixel_x), (known.mm_per_pixel_y, unsure.mm_per_pixel_y)):
        assert wide.value == sharp.value
        assert wide.sd == pytest.approx(np.hypot(sharp.sd, 0.02 * sharp.value))
        assert wide.degrees_of_freedom > 1000 > sharp.degrees_of_freedom


def test_a_reference_takes_away_a_mark_on_the_face() -> None:
    mark = np.zeros((480, 640))
    mark[200:280, 250:420] = 60.0
    frame, untouched = (
        TactileImage(grey=image.grey + mark)
        for image in (board(contrast=0.1), untouched_frame(SENSOR, rng=np.random.default_rng(2)))
    )
    scale, found = scale_from_dots(frame, untouched, pitch_mm=PITCH_MM)
    assert near_truth(scale, SENSOR.mm_per_pixel)
    assert len(found.strays_px) == 0


def test_few_rows_do_not_shift_the_scale() -> None:
    low = Sensor(columns=640, rows=280, mm_per_pixel=(0.034, 0.028))
    scale, found = scale_from_dots(board(sensor=low, distortion=0.03, scatter_mm=0.003), pitch_mm=PITCH_MM)
    assert np.ptp(found.cells, axis=0).tolist() == [6.0, 2.0]
    # The truth at one pitch from the middle, where the ways on the face are longer by the square of the distance.
    bent = 0.03 * PITCH_MM**2 / ((320 * 0.034) ** 2 + (140 * 0.028) ** 2)
    assert near_truth(scale, (0.034 * (1 + bent), 0.028 * (1 + bent)))


def without_dots() -> TactileImage:
    return untouched_frame(SENSOR, rng=np.random.default_rng(3))


def scattered() -> TactileImage:
    y, x = np.mgrid[:480, :640]
    places = np.random.default_rng(4).uniform(40, 440, (40, 2))
    grey = 100.0 + sum(60 * np.exp(-((x - px) ** 2 + (y - py) ** 2) / 50) for px, py in places)
    return TactileImage(grey=np.asarray(grey))


def askew() -> TactileImage:
    y, x = np.mgrid[:480, :640]
    places = [(60 * i + 18 * j, 60 * j) for i in range(-3, 14) for j in range(1, 8)]
    grey = 100.0 + sum(60 * np.exp(-((x - px) ** 2 + (y - py) ** 2) / 50) for px, py in places)
    return TactileImage(grey=np.asarray(grey))


LATTICE_PIXEL = (0.0336, 0.0392)


def lattice_at(
    one: tuple[float, float],
    other: tuple[float, float],
    *,
    seen: Callable[..., tuple[NDArray[np.float64], NDArray[np.float64]]] = lambda x, y: (x, y),
) -> TactileImage:
    """Clean round dots on the lattice of two steps on the face, mm, through what the camera does to its places."""
    rows, columns = np.mgrid[:492, :768]
    x, y = seen((columns - 383.5) * LATTICE_PIXEL[0], (rows - 245.5) * LATTICE_PIXEL[1])
    grey = np.random.default_rng(5).normal(20.0, 1.0, x.shape)
    for i in range(-9, 10):
        for j in range(-9, 10):
            across, down = 0.3 + i * one[0] + j * other[0], 0.2 + i * one[1] + j * other[1]
            if abs(across) < 12.3 and abs(down) < 9.1:
                near = (abs(x - across) < 2.0) & (abs(y - down) < 2.0)  # 7 standard deviations
                grey[near] += 100 * np.exp(-((x[near] - across) ** 2 + (y[near] - down) ** 2) / (2 * 0.27**2))
    return TactileImage(grey=np.clip(np.round(grey), 0, 255))


@pytest.mark.parametrize(
    ("draw", "said"),
    [
        (without_dots, "at least 16 dots"),
        (lambda: TactileImage(grey=np.zeros((48, 64))), "at least 16 dots"),
        (lambda: TactileImage(grey=np.zeros((3, 4))), "at least 16 dots"),
        (lambda: TactileImage(grey=np.full((480, 640), 255.0)), "at least 16 dots"),
        (scattered, "lattice"),
        (askew, "askew"),
        (lambda: lattice_at((2.5, 0.0), (0.35, 2.5)), "8.0 degrees askew"),
        (lambda: lattice_at((2.5, 0.0), (1.25, 2.165)), "one pitch apart.*not a hexagonal one"),
        (lambda: lattice_at((2.5, 0.0), (0.0, 5.0)), "one pitch apart, with no row missing"),
        (lambda: lattice_at((5.0, 0.0), (0.0, 2.5)), "one pitch apart, with no row missing"),
    ],
    ids=[
        "untouched",
        "black",
        "tiny",
        "white",
        "scattered",
        "askew",
        "sheared",
        "hexagonal",
        "rows missing",
        "columns missing",
    ],
)
def test_what_is_no_board_is_refused(draw: Callable[[], TactileImage], said: str) -> None:
    with pytest.raises(CalibrationError, match=said):
        scale_from_dots(draw(), pitch_mm=PITCH_MM)


@pytest.mark.parametrize("ratio", [0.77, 1.3])
def test_pixels_of_no_camera_are_refused(ratio: float) -> None:
    sensor = Sensor(columns=640, rows=480, mm_per_pixel=(0.034, 0.034 * ratio))
    with pytest.raises(CalibrationError, match=f"{ratio:.2f} times as high as wide.*0.8 to 1.25"):
        scale_from_dots(board(sensor=sensor), pitch_mm=PITCH_MM)


def perspective(x: NDArray[np.float64], y: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    away = 1 + 0.02 * x + 0.01 * y
    return x / away, y / away


def barrel(x: NDArray[np.float64], y: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    longer = 1 + 1e-3 * (x**2 + y**2)
    return x * longer, y * longer


@pytest.mark.parametrize(
    "draw",
    [
        pytest.param(lambda: lattice_at((2.5, 0.0), (0.0, 2.5)), marks=pytest.mark.slow),
        pytest.param(lambda: lattice_at((2.5, 0.0), (0.13, 2.5)), marks=pytest.mark.slow),
        lambda: lattice_at((2.5, 0.0), (0.0, 2.5), seen=perspective),
        lambda: lattice_at((2.5, 0.0), (0.0, 2.5), seen=barrel),
    ],
    ids=["square", "sheared", "tilted", "wide lens"],
)
def test_clean_dots_are_not_surer_than_what_the_map_leaves_out(draw: Callable[[], TactileImage]) -> None:
    """The truth is the pixel at the axis itself, which the map, bent over a pitch to either side, does not give."""
    scale, _ = scale_from_dots(draw(), pitch_mm=PITCH_MM)
    for size, true in zip((scale.mm_per_pixel_x, scale.mm_per_pixel_y), LATTICE_PIXEL, strict=True):
        low, high = size.interval(0.95)
        assert low < true < high
        assert size.sd >= 2e-4 * size.value
        assert size.sd < 0.02 * size.value
        # Hardly any of it is scatter, of which few dots tell little: the interval is that of a normal distribution.
        assert high - low == pytest.approx(2 * norm.ppf(0.975) * size.sd, rel=2e-3)


@pytest.mark.slow
def test_unlike_pitches_show_as_skew_where_the_board_is_turned() -> None:
    """Along the axes nothing tells them from longer pixels."""
    way = 0.5**0.5
    turned = [(2.5 * way, 2.5 * way), (-2.6 * way, 2.6 * way)]
    scale, _ = scale_from_dots(lattice_at(*turned), pitch_mm=PITCH_MM)
    wide = scale.mm_per_pixel_x
    assert abs(scale.skew_deg) == pytest.approx(np.degrees(np.arcsin((2.6**2 - 2.5**2) / (2.6**2 + 2.5**2))), abs=0.05)
    assert wide.interval(0.95)[0] < LATTICE_PIXEL[0] < wide.interval(0.95)[1]
    unlike = [(2.5 * way, 2.5 * way), (-2.9 * way, 2.9 * way)]
    with pytest.raises(CalibrationError, match="askew"):
        scale_from_dots(lattice_at(*unlike), pitch_mm=PITCH_MM)


@pytest.mark.parametrize("pitch_mm", [0.25, 25.0])
def test_a_pitch_in_another_unit_is_refused(pitch_mm: float) -> None:
    with pytest.raises(CalibrationError, match="another unit"):
        scale_from_dots(board(), pitch_mm=pitch_mm)


def test_a_board_beside_the_axis_is_refused() -> None:
    frame = board()
    grey = np.array(without_dots().grey)
    grey[:, :200] = frame.grey[:, :200]
    with pytest.raises(CalibrationError, match="surround the probe's axis"):
        scale_from_dots(TactileImage(grey=grey), without_dots(), pitch_mm=PITCH_MM)


def test_more_dots_asked_for_than_there_are() -> None:
    with pytest.raises(CalibrationError, match="at least 500 dots"):
        scale_from_dots(board(), pitch_mm=PITCH_MM, min_dots=500)


@pytest.mark.parametrize(
    "given_wrong",
    [{"pitch_mm": np.nan}, {"pitch_mm": -1.0}, {"pitch_sd_mm": -1.0}, {"min_dots": 9}, {"pitch_mm": "2.5"}],
)
def test_arguments_out_of_range(given_wrong: dict[str, object]) -> None:
    with pytest.raises(InputError, match=next(iter(given_wrong))):
        scale_from_dots(board(), **({"pitch_mm": PITCH_MM} | given_wrong))  # type: ignore[arg-type]
    with pytest.raises(InputError, match="TactileImage"):
        scale_from_dots(np.zeros((4, 4)), pitch_mm=PITCH_MM)  # type: ignore[arg-type]
    with pytest.raises(ImageMismatchError, match="reference"):
        scale_from_dots(board(), TactileImage(grey=np.zeros((4, 4))), pitch_mm=PITCH_MM)


def published(folder: Path) -> float:
    return float(np.load(folder / "camera_calibration_position_scale.npy", allow_pickle=False)[2])


def real_board(folder: Path) -> tuple[PixelScale, DotDiagnostics]:
    frames = (read_image(folder / f"camera_calibration_{name}.png") for name in ("sample", "ref"))
    return scale_from_dots(*frames, pitch_mm=2.5)


@pytest.mark.parametrize("sensor", ["sensor_1", "sensor_2"])
def test_real_boards_within_one_per_cent_of_the_published_scale(shared_data: Path, sensor: str) -> None:
    """The makers give one number for both axes: the mean distance of the middle dot's four neighbours."""
    folder = shared_data / "real" / "9dtact" / sensor
    scale, found = real_board(folder)
    np.testing.assert_allclose(scale.mm_per_pixel, published(folder), rtol=0.01)
    assert scale.count >= 62  # of 7 x 9
    assert np.ptp(found.cells, axis=0).tolist() == [8.0, 6.0]
    assert found.distorted
    assert found.largest_change > 0.2  # the lens is a wide one


def test_real_spots_are_where_a_plain_centroid_finds_them(shared_data: Path) -> None:
    folder = shared_data / "real" / "9dtact" / "sensor_1"
    _, found = real_board(folder)
    sample, bare = (read_image(folder / f"camera_calibration_{name}.png").grey for name in ("sample", "ref"))
    dark: NDArray[np.float64] = np.maximum(bare - sample - 8.0, 0.0)  # above the smear between the dots
    y, x = np.mgrid[-15:16, -15:16]
    for px, py in found.centres_px:
        column, row = round(float(px)), round(float(py))
        around = dark[row - 15 : row + 16, column - 15 : column + 16]
        centroid = column + (x * around).sum() / around.sum(), row + (y * around).sum() / around.sum()
        assert np.hypot(centroid[0] - px, centroid[1] - py) < 3.0


@pytest.mark.parametrize("blur", [1.7, 2.6, 4.0])
def test_the_noise_of_two_blurs_is_that_of_drawn_noise(blur: float) -> None:
    noise = np.random.default_rng(5).standard_normal((600, 600))
    difference = gaussian_filter(noise, blur) - gaussian_filter(noise, STEP * blur)
    assert _noise_gain(blur) == pytest.approx(difference.std(), rel=0.03)


@pytest.mark.parametrize("sign", [1.0, -1.0], ids=["bright", "dark"])
def test_all_spots_and_no_noise_are_found(sign: float) -> None:
    y, x = np.mgrid[:160, :200]
    places = np.array([(30.3 + 35 * i, 40.6 + 40 * j) for i in range(5) for j in range(3)])
    spots = sum(np.exp(-((x - a) ** 2 + (y - b) ** 2) / (2 * 4.0**2)) for a, b in places)
    grey = 100 + sign * 20 * spots + 2.0 * np.random.default_rng(6).standard_normal(x.shape)
    found = find_spots(grey, least=4)
    assert found.bright == (sign > 0)
    assert found.width_px == pytest.approx(4.0, rel=0.1)
    assert len(found.positions_px) == len(places)
    apart = np.linalg.norm(found.positions_px[:, None] - places[None], axis=2)
    assert apart.min(axis=1).max() < 0.6
    assert len(set(apart.argmin(axis=1).tolist())) == len(places)


@pytest.mark.parametrize("sigma", [2.0, 4.0, 7.0])
def test_spots_that_are_symmetric_about_a_pixel_lie_on_it(sigma: float) -> None:
    y, x = np.mgrid[:140, :160]
    grey = 50 * np.exp(-((x - 80) ** 2 + (y - 70) ** 2) / (2 * sigma**2))
    found = find_spots(grey, least=1)
    np.testing.assert_allclose(found.positions_px, [[80.0, 70.0]], atol=1e-6)


def test_a_top_further_than_a_pixel_away_is_left_where_it_was_seen() -> None:
    y, x = np.mgrid[:21, :21]
    for top, expected in ((10.6, 10.6), (12.3, 10.0)):
        paraboloid = -((x - top) ** 2) - 0.5 * (y - 10.0) ** 2
        found = _sub_pixel(paraboloid, np.array([10]), np.array([10]), 2)
        np.testing.assert_allclose(found, [[expected, 10.0]], atol=1e-9)


@pytest.mark.parametrize("blur", [1.5, 2.0])
def test_maxima_at_the_border_are_left_out(blur: float) -> None:
    """Where a spot has less than its border and a pixel on any side, its blur lacks a part."""
    first = int(np.ceil(BORDER * blur)) + 1
    size = 6 * first
    for at, count in ((first - 1, 0), (first, 1), (size - 1 - first, 1), (size - first, 0)):
        response = np.zeros((size, size))
        response[3 * first, at] = 1.0
        assert len(_peaks(response, blur, 0.5)[0]) == count
        assert len(_peaks(response.T, blur, 0.5)[0]) == count
