"""Contacts of gel sensors against rendered presses (a bonded layer, unknown lamps), real frames, and bad input."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import scipy
from benchmarks.textured_contacts import drawn_press

from tsis.catalog.sensors import load_sensor
from tsis.errors import ImageMismatchError, InputError
from tsis.imaging.gel_contact import (
    ContactFit,
    GelContact,
    GelLayer,
    blurred_profile,
    contacts,
    fit_contact,
    joined_fits,
    layer_hill,
)
from tsis.instrument.image_files import read_levels
from tsis.virtual.gel_frames import RenderedPress, ball_press, random_gel_light, random_gel_press, render_gel

if TYPE_CHECKING:
    from pathlib import Path


def press(name: str, seed: int) -> RenderedPress:
    sensor = load_sensor(name)
    if sensor.resampled:  # fewer pixels, the same face
        columns, rows = sensor.image_px
        scale = sensor.scale_of(columns // 2, rows // 2)
        sensor = replace(sensor, image_px=(columns // 2, rows // 2), mm_per_pixel=scale)
    return random_gel_press(sensor, np.random.default_rng([4711, seed]))


MINI = press("gelsight-mini", 0)


@pytest.mark.parametrize(("a", "expected"), [(0.05, 1.0), (0.5, np.log(3.0))])
def test_the_rendered_ball_is_that_of_the_half_space_on_a_thick_gel(a: float, expected: float) -> None:
    """Hertz's depth a²/R for a shallow press, Sneddon's a/2 log((R + a)/(R - a)) for a deep one."""
    depth = ball_press(1.0, a, thickness_mm=200.0, poisson=0.4).depth_mm
    assert depth == pytest.approx(expected * a**2 if a < 0.1 else expected * a / 2, rel=0.02)


def test_a_thin_gel_bulges_around_the_ball() -> None:
    assert ball_press(4.0, 1.5, thickness_mm=1.0, poisson=0.499).face_mm.min() < -0.01


@pytest.mark.parametrize(("ratio", "poisson"), [(0.2, 0.45), (0.6, 0.49), (1.5, 0.475)])
def test_the_hill_of_white_light_is_the_rendered_balls(ratio: float, poisson: float) -> None:
    """A shallow ball on a layer by another sum over wave numbers; inside, a paraboloid."""
    made = ball_press(30.0, 1.0, thickness_mm=1.0 / ratio, poisson=poisson)
    places = np.linspace(0.0, 3.0, 31)
    expected = np.interp(places, made.radius_mm, made.face_mm) / made.depth_mm
    assert np.interp(places, np.linspace(0.0, 6.0, 301), layer_hill(ratio, poisson)) == pytest.approx(
        expected, abs=0.02
    )


def test_a_second_minimum_of_the_same_evidence_makes_the_radius_uncertain() -> None:
    fit = ContactFit(
        centre=(0.0, 0.0), semi_axes=(20.0, 20.0), angle_deg=0.0, centre_sd=(0.1, 0.1), radius_sd=0.1,
        explained=0.9, amplitude=10.0, patch_variance=4.0,
    )  # fmt: skip
    half = replace(fit, semi_axes=(10.0, 10.0))
    assert joined_fits([fit, half], [100.0, 100.0]).radius_sd == pytest.approx(np.hypot(0.1, 10 / np.sqrt(2)))
    assert joined_fits([fit, half], [100.0, 200.0]).radius_sd == pytest.approx(0.1, rel=1e-3)


@pytest.mark.parametrize("start", [0.7, 1.5])
def test_a_white_light_fit_finds_its_radius_from_afar(start: float) -> None:
    sensor = load_sensor("9dtact")
    made = random_gel_press(sensor, np.random.default_rng([4711, 9]), ball_radius_mm=4.0, thickness_mm=4.0)
    levels = (made.frame.astype(float) - made.reference).mean(axis=2)[::2, ::2, None]
    gel = GelLayer(thickness_px=(35.0, 45.0), poisson=sensor.poisson.limits)
    centre = (made.centre_px[0] / 2, made.centre_px[1] / 2)
    fit = fit_contact(
        levels, np.ones(levels.shape[:2]), centre, start * made.radius_px / 2, gel=gel, starts=(0.6, 0.8, 1.0, 1.25)
    )
    assert fit is not None
    assert 2 * fit.radius == pytest.approx(made.radius_px, rel=0.05)


@pytest.mark.parametrize("name", ["gelsight-mini", "gelsight-taxim", "9dtact"])
@pytest.mark.parametrize("seed", [1, 2])
def test_a_rendered_ball_has_its_centre_and_radius(name: str, seed: int) -> None:
    made = press(name, seed)
    (contact,) = contacts([made.frame], sensor=made.sensor, reference=made.reference)
    assert contact.good, contact.reasons
    assert contact.radius_px == pytest.approx(made.radius_px, rel=0.08)
    assert abs(contact.radius_px - made.radius_px) < 3.0 * contact.radius_sd_px
    assert np.hypot(*np.subtract(contact.centre_px, made.centre_px)) < 0.05 * made.radius_px
    rows, columns = made.frame.shape[:2]
    scale = made.sensor.scale_of(columns, rows)
    assert scale is not None
    found = asdict(contact)
    assert found["area_mm2"] == pytest.approx(np.pi * made.radius_px**2 * scale[0] * scale[1], rel=0.17)
    assert found["area_sd_mm2"] / found["area_mm2"] == pytest.approx(2 * found["radius_sd_mm"] / found["radius_mm"])


def test_sixteen_bits_are_the_same_frame() -> None:
    deep = (MINI.frame.astype(np.uint16) * 257, MINI.reference.astype(np.uint16) * 257)
    shallow = contacts([MINI.frame], sensor=MINI.sensor, reference=MINI.reference)
    assert contacts([deep[0]], sensor=MINI.sensor, reference=deep[1]) == shallow


def test_an_untouched_frame_has_no_contact() -> None:
    noise = np.random.default_rng(3).normal(0.0, 2.0, MINI.reference.shape)
    again = np.clip(MINI.reference + noise, 0, 255).astype(np.uint8)
    (contact,) = contacts([again], sensor=MINI.sensor, reference=MINI.reference)
    assert not contact.good
    assert "no contact" in contact.reasons


def test_a_contact_that_is_cut_by_the_border_is_refused() -> None:
    x = round(MINI.centre_px[0])
    frame, reference = (np.roll(part, -x, axis=1) for part in (MINI.frame, MINI.reference))
    (cut,) = contacts([frame], sensor=MINI.sensor, reference=reference)
    assert not cut.good


def test_a_contact_that_moved_since_the_frame_before_is_refused_with_the_quality_of_a_refused_one() -> None:
    change = np.roll(MINI.frame.astype(int) - MINI.reference, round(0.3 * MINI.radius_px), axis=1)
    moved = np.clip(MINI.reference + change, 0, 255).astype(np.uint8)
    alone = contacts([moved], sensor=MINI.sensor, reference=MINI.reference)
    assert alone[0].good
    held, after = contacts([MINI.frame, moved], sensor=MINI.sensor, reference=MINI.reference, sequence=True)
    assert held.good
    assert (after.good, after.reasons) == (False, ("moving",))
    assert after.quality < 0.5 < alone[0].quality


def test_presses_at_one_place_are_not_good_against_their_own_median() -> None:
    """The median of frames holds the dent that most of them show, unless the presses lie at different places."""
    rows, columns = MINI.reference.shape[:2]
    change = MINI.frame.astype(int) - MINI.reference
    x, y = (round(part) for part in MINI.centre_px)

    def frame(place: tuple[int, int], share: float) -> Any:
        moved = np.roll(share * change, (place[1] - y, place[0] - x), axis=(0, 1))
        return np.clip(MINI.reference + moved, 0, 255).astype(np.uint8)

    shares = np.linspace(0.6, 1.4, 9)
    middle = columns // 2, rows // 2
    alike = contacts([frame(middle, share) for share in shares], sensor=MINI.sensor)
    assert not any(contact.good for contact in alike)
    assert all(set(contact.reasons) & {"no reference", "no contact"} for contact in alike)
    places = [(round(columns * (0.2 + 0.3 * (n % 3))), round(rows * (0.2 + 0.3 * (n // 3)))) for n in range(9)]
    apart = contacts([frame(place, 1.0) for place in places], sensor=MINI.sensor)
    assert not any("no reference" in contact.reasons for contact in apart)


def test_a_straight_edge_through_the_frame_is_no_good_contact() -> None:
    """An ellipse explains it, and leaves the frame."""
    rows, columns = MINI.depth_mm.shape
    y, x = np.mgrid[:rows, :columns]
    edge = 0.5 / (1.0 + np.exp((x - columns / 2 + 0.3 * (y - rows / 2)) / 3.0))
    rng = np.random.default_rng(2)
    light = random_gel_light((rows, columns), rng, size_px=12.0)
    frames = [render_gel(depth, MINI.sensor, light, rng) for depth in (0.0 * edge, edge)]
    (contact,) = contacts(frames[1:], sensor=MINI.sensor, reference=frames[0])
    assert not contact.good


@pytest.mark.slow
def test_two_contacts_a_cut_one_and_a_moved_one_are_refused() -> None:
    made = press("gelsight-mini", 5)
    two = np.minimum(np.maximum(made.frame, 0), 255).copy()
    radius = int(1.4 * made.radius_px)
    x, y = (round(part) for part in made.centre_px)
    far = (x + 80) % 160 if 20 < (x + 80) % 160 < 140 else 80
    part = made.frame[max(y - radius, 0) : y + radius, max(x - radius, 0) : x + radius]
    left = min(max(far - radius, 0), two.shape[1] - part.shape[1])
    two[max(y - radius, 0) : max(y - radius, 0) + part.shape[0], left : left + part.shape[1]] = part
    found = contacts([made.frame, two], sensor=made.sensor, reference=made.reference, sequence=True)
    assert found[0].good
    assert not found[1].good
    rolled = [np.roll(frame, -x, axis=1) for frame in (made.frame, made.reference)]
    (cut,) = contacts(rolled[:1], sensor=made.sensor, reference=rolled[1])
    assert not cut.good


@pytest.mark.parametrize(
    ("frame", "reference", "said"),
    [
        (
            MINI.frame[..., 0],
            MINI.reference,
            "frame 1 must be in colour, because gelsight-mini has coloured lamps; got grey",
        ),
        (np.full_like(MINI.frame, 255), MINI.reference, "frame 1 must not be saturated; got 100% white pixels"),
        (MINI.frame[:60], MINI.reference, "must have the aspect ratio of 160 x 120"),
        (np.zeros_like(MINI.frame), MINI.reference, "frame 1 must be lit; got a black frame"),
        (
            MINI.frame,
            MINI.reference[::2, ::2],
            "reference must have the size of frame 1, 160 x 120 pixels; got 80 x 60",
        ),
        (MINI.frame, MINI.reference // 4, "reference must be an untouched frame of the sensor that took frame 1"),
        (MINI.frame, None, "a reference must be given for fewer than 8 frames; got 1"),
        (MINI.frame.astype(float) * 9, MINI.reference, "must have levels from 0 to 255, or 16 bits"),
        (np.zeros((3, 3, 2)), MINI.reference, r"must have the shape \(rows, columns\)"),
    ],
)
def test_bad_frames_are_refused_in_one_sentence(frame: Any, reference: Any, said: str) -> None:
    with pytest.raises((InputError, ImageMismatchError), match=said) as error:
        contacts([frame], sensor=MINI.sensor, reference=reference)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", ["gelsight-mini", "9dtact"])
@pytest.mark.parametrize("seed", [3, 4, 5])
def test_the_reference_of_another_sensor_as_bright_is_refused(name: str, seed: int) -> None:
    made, other = press(name, seed), press(name, seed + 20)
    levels = other.reference.astype(float)
    levels *= made.reference.mean(axis=(0, 1)) / levels.mean(axis=(0, 1))  # brightness and colour are those of the own
    assert levels.mean() == pytest.approx(made.reference.mean(), rel=1e-6)
    with pytest.raises(ImageMismatchError, match="reference must be an untouched frame of the sensor that took frame"):
        contacts([made.frame], sensor=made.sensor, reference=np.minimum(levels, 255.0))
    (own,) = contacts([made.frame], sensor=made.sensor, reference=made.reference)
    assert "no contact" not in own.reasons


@pytest.mark.parametrize("every", [32, pytest.param(8, marks=pytest.mark.slow)])
def test_real_presses_near_their_labels(shared_data: Path, every: int) -> None:
    """The labels lie some 2 px to one side of what every method finds; no good contact is far off."""
    with np.load(shared_data / "real" / "taxim_ball" / "dataPack_small.npz", allow_pickle=False) as data:
        untouched, presses, labels = data["f0"], data["imgs"][::every], data["touch_center"][::every]
    found = contacts(list(presses), sensor=load_sensor("gelsight-taxim"), reference=untouched)
    good = np.array([contact.good for contact in found])
    shift = np.array([contact.centre_px for contact in found]) - labels
    assert good.mean() >= 0.85
    assert np.hypot(*shift[good].T).max() < 6.0


@pytest.mark.parametrize("sensor", ["sensor_1", "sensor_2"])
def test_real_white_light_presses_are_good(shared_data: Path, sensor: str) -> None:
    folder = shared_data / "real" / "9dtact" / sensor
    frames = [read_levels(folder / f"depth_calibration_rectify_crop_{kind}.png") for kind in ("sample", "ref")]
    (contact,) = contacts(frames[:1], sensor=load_sensor("9dtact"), reference=frames[1])
    assert contact.good
    assert contact.radius_mm is not None
    assert 2.4 < contact.radius_mm < 4.0  # below the ball's own radius


@pytest.mark.parametrize(("kind", "number"), [("soft textured ball", 0), ("foam", 1), ("imprint", 4), ("soft edge", 1)])
def test_textured_and_soft_edged_objects_have_their_radius(kind: str, number: int) -> None:
    """Contacts of rough bodies by another solver (benchmarks/textured_contacts.py), under lamps nobody knows."""
    name = ("gelsight-mini", "gelsight-wedge")[number % 2]
    made = drawn_press(kind, name, np.random.default_rng([4712, number]))
    (contact,) = contacts([made.frame], sensor=made.sensor, reference=made.reference)
    assert contact.good, contact.reasons
    assert contact.radius_px == pytest.approx(made.radius_px, rel=0.07)
    assert np.hypot(*np.subtract(contact.centre_px, made.centre_px)) < 0.1 * made.radius_px


def soft_edge(name: str, number: int) -> tuple[GelContact, float]:
    made = drawn_press("soft edge", name, np.random.default_rng([8804, 5, number]))
    (contact,) = contacts([made.frame], sensor=made.sensor, reference=made.reference)
    return contact, made.radius_px


@pytest.mark.parametrize(("name", "number"), [("gelsight-wedge", 7), ("gelsight-mini", 15)])
def test_the_radius_of_a_soft_edge_is_uncertain(name: str, number: int) -> None:
    """By what a sharp edge would leave uncertain, these erred by five standard deviations."""
    contact, radius_px = soft_edge(name, number)
    assert contact.good
    assert abs(contact.radius_px - radius_px) < 2.0 * contact.radius_sd_px
    assert contact.radius_sd_px < 0.05 * contact.radius_px


def test_a_contact_that_two_radii_explain_is_no_good_one() -> None:
    """Half the radius, with a texture, explained this change as well as the whole."""
    contact, _ = soft_edge("9dtact", 26)
    assert not contact.good
    assert contact.reasons == ("uncertain",)


@pytest.mark.parametrize(("sd", "order"), [(0.06, 1), (0.2, 1), (0.1, 0)])
def test_a_blurred_profile_is_that_of_the_blurred_plane(sd: float, order: int) -> None:
    """Blur of the whole plane by SciPy, of a hill (order 0) and of a field along the radius (order 1)."""
    side = np.arange(-240, 241) / 80.0
    x, y = np.meshgrid(side, side)
    places = np.concatenate([np.arange(0.0, 0.7, 0.05), np.arange(0.7, 1.4, 0.02), np.arange(1.4, 3.0, 0.05)])

    def profile(radius: Any) -> Any:
        return np.minimum(radius, 1.0) * np.exp(-np.maximum(radius - 1.0, 0.0)) if order else np.exp(-(radius**2))

    radius = np.hypot(x, y)
    plane = profile(radius) * (x / np.maximum(radius, 1e-9) if order else 1.0)
    whole = scipy.ndimage.gaussian_filter(plane, sd * 80.0)[240, 240:400]
    found = blurred_profile(np.pad(profile(places), (0, 3)), sd, order=order)[: places.size]
    assert np.interp(side[240:400], places, found) == pytest.approx(whole, abs=0.01)
