from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tsis.errors import InputError, UnknownNameError
from tsis.imaging import features, find_contact
from tsis.imaging.contact import Contact, find_colour_contact
from tsis.imaging.corrections import match_light, signal
from tsis.imaging.patch import segment
from tsis.instrument.image_files import read_image
from tsis.model.image import TactileImage

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray
    from tests.imaging.conftest import DrawEllipse


LAMPS_DEG = (90.0, 210.0, 330.0)


def lit_ball(
    centre: tuple[float, float], radius: float, gains: tuple[float, ...], shape: tuple[int, int] = (100, 130)
) -> NDArray[np.float64]:
    """Change of colour that lamps of unequal brightness make on a pressed ball: proportional to its slope."""
    y, x = np.mgrid[: shape[0], : shape[1]]
    dx, dy = x - centre[0], y - centre[1]
    inside = np.clip(radius + 0.5 - np.hypot(dx, dy), 0.0, 1.0) / radius
    slopes = [np.cos(np.radians(lamp)) * dx + np.sin(np.radians(lamp)) * dy for lamp in LAMPS_DEG]
    return np.stack([gain * slope * inside for gain, slope in zip(gains, slopes, strict=True)], axis=2)


@pytest.mark.parametrize("scale", [(0.05, 0.05), (0.04, 0.07)])
@pytest.mark.parametrize("method", ["symmetry", "edge"])
def test_a_disc_has_its_centre_and_radius(draw_ellipse: DrawEllipse, scale: tuple[float, float], method: str) -> None:
    image = draw_ellipse(centre_mm=(0.313, -0.171), semi_axes_mm=(1.7, 1.7), mm_per_pixel=scale)
    contact = find_contact(image, method=method)
    assert contact is not None
    assert contact.centre_px == pytest.approx((79.5 + 0.313 / scale[0], 59.5 - 0.171 / scale[1]), abs=0.1)
    assert contact.radius_mm == pytest.approx(1.7, rel=0.01)
    assert contact.radius_px == pytest.approx(1.7 / np.sqrt(scale[0] * scale[1]), rel=0.01)


@settings(max_examples=20)
@given(x=st.floats(45.0, 75.0), y=st.floats(40.0, 60.0), gain=st.floats(0.3, 2.0))
def test_a_ball_is_found_wherever_it_is_and_however_bright(x: float, y: float, gain: float) -> None:
    rows, columns = np.mgrid[:100, :120]
    ball = np.maximum(0.0, 1.0 - ((columns - x) ** 2 + (rows - y) ** 2) / 25.0**2)
    contact = find_contact(TactileImage(grey=100.0 * gain * ball))
    assert contact is not None
    assert contact.centre_px == pytest.approx((x, y), abs=0.03)


@pytest.mark.parametrize("power", [0.5, 1.0])
@pytest.mark.parametrize("noise", [0.0, 2.0])
def test_the_radius_of_a_hill_that_rises_from_its_edge(power: float, noise: float) -> None:
    """Hertz's pressure (one half) and a ball's depth (one): the blur must not draw the edge inwards."""
    rng = np.random.default_rng(61)
    y, x = np.mgrid[:492, :768]
    squared = ((x - 380.0) * 0.03) ** 2 + ((y - 240.0) * 0.035) ** 2
    hill = 150.0 * np.maximum(0.0, 1.0 - squared / 36.0) ** power
    image = TactileImage(grey=hill + rng.normal(0.0, noise, hill.shape), mm_per_pixel=(0.03, 0.035))
    contact = find_contact(image)
    assert contact is not None
    assert contact.radius_mm == pytest.approx(6.0, rel=0.04)
    assert contact.centre_px == pytest.approx((380.0, 240.0), abs=0.1)


def test_a_halo_deeper_on_one_side_does_not_move_the_centre() -> None:
    rng = np.random.default_rng(31)
    y, x = np.mgrid[:160, :160]
    distance = np.hypot(x - 82.3, y - 77.4)
    ball = np.maximum(0.0, np.sqrt(np.maximum(0.0, 80.0**2 - distance**2)) - np.sqrt(80.0**2 - 40.0**2)) * 4.0
    halo = np.where(
        distance > 40.0, -20.0 * np.exp(-(distance - 40.0) / 8.0) * (1.0 + 0.6 * (x - 82.3) / distance), 0.0
    )
    contact = find_contact(TactileImage(grey=ball + halo + rng.normal(0.0, 1.0, ball.shape)))
    assert contact is not None
    assert contact.centre_px == pytest.approx((82.3, 77.4), abs=0.15)


@pytest.mark.parametrize("gains", [(90.0, 90.0, 90.0), (150.0, 60.0, 90.0), (50.0, 90.0, 160.0)])
def test_lamps_of_unequal_brightness_do_not_move_a_colour_contact(gains: tuple[float, float, float]) -> None:
    rng = np.random.default_rng(37)
    centre, radius = (61.4, 52.7), 17.0
    change = lit_ball(centre, radius, gains)
    untouched = np.full(change.shape, 120.0)
    contact = find_colour_contact(untouched + change + rng.normal(0.0, 2.0, change.shape), untouched)
    assert contact is not None
    assert contact.centre_px == pytest.approx(centre, abs=0.25)
    assert contact.radius_px == pytest.approx(radius, abs=0.6)


def test_the_edge_beats_the_centroid_where_one_side_is_brighter() -> None:
    y, x = np.mgrid[:100, :130]
    distance = np.hypot(x - 60.0, y - 50.0)
    ring = np.where(distance < 18.0, distance / 18.0, 0.0) * (120.0 + 100.0 * (x - 60.0) / np.maximum(distance, 1.0))
    image = TactileImage(grey=ring)
    contact, centroid = find_contact(image, method="edge"), features(image).centroid_px
    assert contact is not None
    assert centroid is not None
    assert np.hypot(contact.centre_px[0] - 60.0, contact.centre_px[1] - 50.0) < 0.5
    assert np.hypot(centroid[0] - 60.0, centroid[1] - 50.0) > 3.0


def test_a_contact_partly_outside_the_image_keeps_its_centre(draw_ellipse: DrawEllipse) -> None:
    image = draw_ellipse(centre_mm=(3.0, 0.0), semi_axes_mm=(1.5, 1.5))
    contact, centroid = find_contact(image, method="edge"), features(image).centroid_px
    assert contact is not None
    assert centroid is not None
    assert contact.centre_px[0] == pytest.approx(79.5 + 60.0, abs=0.3)
    assert centroid[0] < 79.5 + 58.0


@pytest.mark.parametrize("method", ["symmetry", "edge"])
def test_no_contact_is_none(method: str) -> None:
    noise = np.random.default_rng(41).normal(0.0, 3.0, (90, 120))
    assert find_contact(TactileImage(grey=noise), method=method) is None
    assert find_contact(TactileImage(grey=np.zeros((20, 20))), method=method) is None
    assert find_colour_contact(np.zeros((20, 20, 3)), np.zeros((20, 20, 3))) is None


def test_bad_input_is_named(draw_ellipse: DrawEllipse) -> None:
    image = draw_ellipse()
    other = replace(image, grey=image.grey[:50])
    with pytest.raises(InputError, match=r"patch must have the image's shape \(50, 160\); got \(120, 160\)"):
        find_contact(other, patch=segment(image))
    with pytest.raises(UnknownNameError, match="did you mean 'edge'"):
        find_contact(image, method="edges")
    with pytest.raises(InputError, match="image must be a TactileImage; got ndarray"):
        find_contact(image.grey)  # type: ignore[arg-type]


BALL_RADIUS_MM = 4.0
SENSORS = ["sensor_1", "sensor_2"]


def frame(folder: Path, name: str) -> TactileImage:
    """A stored frame with the scale that its sensor's dot board gave."""
    scale = float(np.load(folder / "camera_calibration_position_scale.npy")[2])
    return read_image(folder / f"{name}.png", mm_per_pixel=(scale, scale))


def ball_press(folder: Path) -> tuple[TactileImage, Contact]:
    """The change that the ball made, and the contact found in it."""
    names = ("depth_calibration_rectify_crop_sample", "depth_calibration_rectify_crop_ref")
    change = signal(*(frame(folder, name) for name in names), invert=True)
    contact = find_contact(change)
    assert contact is not None
    return change, contact


def distance_mm(image: TactileImage, centre: tuple[float, float]) -> NDArray[np.float64]:
    y, x = np.mgrid[: image.grey.shape[0], : image.grey.shape[1]]
    return np.asarray(image.scale()[0] * np.hypot(x - centre[0], y - centre[1]), dtype=np.float64)


@pytest.mark.parametrize("sensor", SENSORS)
def test_grey_change_follows_the_depth_of_a_ball(shared_data: Path, sensor: str) -> None:
    change, contact = ball_press(shared_data / "real" / "9dtact" / sensor)
    assert contact.radius_mm is not None
    distance = distance_mm(change, contact.centre_px)
    inside = distance < contact.radius_mm
    depth = np.sqrt(BALL_RADIUS_MM**2 - distance[inside] ** 2)
    assert np.corrcoef(change.grey[inside], depth)[0, 1] > 0.995


@pytest.mark.parametrize("sensor", SENSORS)
def test_the_contact_radius_is_that_of_the_ball_at_its_depth(shared_data: Path, sensor: str) -> None:
    folder = shared_data / "real" / "9dtact" / sensor
    change, contact = ball_press(folder)
    assert contact.radius_mm is not None
    # The sensor's makers give depth for whole levels of grey change, from a circle that they found in another way. The
    # face still slopes outside the ball's contact, so the steepest fall lies outside too: by 5.2 and 4.4 per cent.
    levels = np.load(folder / "depth_calibration_Pixel_to_Depth.npy")
    deepest = float(np.interp(features(change).peak, np.arange(levels.size), levels))
    by_makers = np.sqrt(2 * BALL_RADIUS_MM * deepest - deepest**2)
    assert 1.0 < contact.radius_mm / by_makers < 1.06
    # Without them: where the ball's own depth, fitted to the middle of the contact alone, reaches the untouched level.
    distance = distance_mm(change, contact.centre_px)
    middle = distance < 0.7 * contact.radius_mm
    height = np.sqrt(BALL_RADIUS_MM**2 - distance[middle] ** 2) - BALL_RADIUS_MM
    grey_per_mm, top = np.polyfit(height, change.grey[middle], 1)
    depth = top / grey_per_mm
    by_middle = np.sqrt(2 * BALL_RADIUS_MM * depth - depth**2)
    assert by_middle == pytest.approx(by_makers, rel=0.04)


@pytest.mark.parametrize("sensor", SENSORS)
def test_two_untouched_frames_show_no_contact(shared_data: Path, sensor: str) -> None:
    folder = shared_data / "real" / "9dtact" / sensor
    first, second = frame(folder, "depth_calibration_ref"), frame(folder, "camera_calibration_ref")
    for image, reference in ((first, second), (second, first)):
        matched = match_light(reference, image)
        drift = np.abs(np.median(signal(image, reference).grey))
        assert np.abs(np.median(signal(image, matched).grey)) < 0.3 * drift
        assert not features(image, matched).contact


def test_centres_of_the_colour_presses(shared_data: Path) -> None:
    """The labels lie some 1.6 px to one side of what every method finds; 1.4 px are left when that is taken away."""
    with np.load(shared_data / "real" / "taxim_ball" / "dataPack_small.npz", allow_pickle=False) as data:
        untouched, presses, labels = data["f0"], data["imgs"], data["touch_center"]
    contacts = [find_colour_contact(press, untouched) for press in presses]
    centres = np.array([contact.centre_px for contact in contacts if contact is not None])
    assert centres.shape == (49, 2)
    shift = centres - labels
    assert np.median(np.hypot(*shift.T)) < 2.0
    assert np.hypot(*shift.T).max() < 5.0
    assert np.median(np.hypot(*(shift - np.median(shift, axis=0)).T)) < 1.5


def test_the_untouched_colour_frame_is_no_contact(shared_data: Path) -> None:
    with np.load(shared_data / "real" / "taxim_ball" / "dataPack_small.npz", allow_pickle=False) as data:
        untouched = data["f0"].astype(np.float64)
    noise = np.random.default_rng(59).normal(0.0, 1.0, untouched.shape)
    assert find_colour_contact(untouched + noise, untouched) is None
