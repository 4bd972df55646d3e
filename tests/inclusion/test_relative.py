"""Relative size, depth and hardness of bumps of light whose numbers have a closed form."""

from __future__ import annotations

import math
import statistics
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tsis.errors import ImageMismatchError, InputError, NotCalibratedError, UnknownNameError
from tsis.inclusion.relative import RelativeReading, Repeats, ratios, relative_depth, relative_hardness, relative_size
from tsis.inclusion.shape import object_shape
from tsis.model.calibration import Calibration, LightMap
from tsis.model.image import TactileImage

if TYPE_CHECKING:
    from collections.abc import Callable

SHAPE = (160, 200)
SCALE = (0.05, 0.07)
K = 5.0
UNTOUCHED, PLAIN = "untouched probe", "plain tissue"
CALIBRATION = Calibration(gain_grey_per_kpa=50.0, saturation_kpa=20.0)


def hill(
    peak: float, width_mm: float = 1.2, centre_mm: tuple[float, float] = (0.0, 0.0), base: float = 8.0, **fields: Any
) -> TactileImage:
    """Gaussian bump of light on an even background."""
    x = (np.arange(SHAPE[1]) - (SHAPE[1] - 1) / 2) * SCALE[0] - centre_mm[0]
    y = (np.arange(SHAPE[0]) - (SHAPE[0] - 1) / 2) * SCALE[1] - centre_mm[1]
    bump = np.exp(-(x[None, :] ** 2 + y[:, None] ** 2) / (2 * width_mm**2))
    return TactileImage(grey=base + peak * bump, mm_per_pixel=SCALE, **fields)


FLAT = hill(0.0)


@given(peak=st.floats(12.0, 200.0), width=st.floats(0.6, 1.3), k=st.floats(3.0, 10.0))
@settings(max_examples=30)
def test_size_is_where_the_light_falls_below_the_threshold(peak: float, width: float, k: float) -> None:
    reading = relative_size(hill(peak, width), FLAT, against=UNTOUCHED, threshold_grey=k)
    assert reading.flags == ()
    # A blur of one pixel widens the bump and lowers it by the same factor.
    broad = np.prod([np.sqrt(1 + (side / width) ** 2) for side in SCALE])
    radius = width * np.sqrt(broad * 2 * np.log(peak / broad / k))
    assert reading.value == pytest.approx(2 * radius, rel=0.01, abs=0.03)
    assert reading.parts["area_mm2"] == pytest.approx(np.pi * radius**2, rel=0.02, abs=0.05)


def test_size_grows_with_the_light_of_one_and_the_same_object() -> None:
    sizes = [relative_size(hill(peak), FLAT, against=UNTOUCHED).value for peak in (10.0, 20.0, 40.0, 80.0)]
    assert all(np.diff(np.array(sizes, dtype=float)) > 0)


@given(peak=st.floats(12.0, 200.0), x=st.floats(-1.0, 1.0), y=st.floats(-1.0, 1.0))
@settings(max_examples=20)
def test_depth_is_the_grey_level_at_the_centroid(peak: float, x: float, y: float) -> None:
    reading = relative_depth(hill(peak, centre_mm=(x, y)), FLAT, against=UNTOUCHED)
    assert reading.unit == "grey levels"
    assert reading.value == pytest.approx(peak, rel=0.01)
    found = (reading.parts["centroid_x_px"] - 99.5) * SCALE[0], (reading.parts["centroid_y_px"] - 79.5) * SCALE[1]
    assert found == pytest.approx((x, y), abs=0.01)


@given(first=st.floats(15.0, 60.0), factor=st.floats(1.5, 3.0))
@settings(max_examples=20)
def test_hardness_is_stress_over_growth(first: float, factor: float) -> None:
    weak, strong = hill(first), hill(factor * first)
    reading = relative_hardness(weak, strong, reference=FLAT, against=UNTOUCHED, calibration=CALIBRATION)
    growth = np.sqrt(np.log(factor * first / K) / np.log(first / K)) - 1
    stress = (factor * first - K) / np.log(factor * first / K) / CALIBRATION.gain_grey_per_kpa
    assert reading.parts["growth"] == pytest.approx(growth, rel=0.05)
    assert reading.parts["stress_kpa"] == pytest.approx(stress, rel=0.02)
    assert reading.value == pytest.approx(stress / growth, rel=0.06)
    assert reading.unit == "kPa"


def test_each_force_may_have_a_reference_of_its_own() -> None:
    kinds = {"against": PLAIN, "calibration": CALIBRATION}
    alone = relative_hardness(hill(20.0), hill(40.0), reference=FLAT, **kinds)  # type: ignore[arg-type]
    brighter = [replace(hill(40.0), grey=hill(40.0).grey + 30.0), replace(FLAT, grey=FLAT.grey + 30.0)]
    beside = relative_hardness(hill(20.0), brighter[0], reference=FLAT, second_reference=brighter[1], **kinds)  # type: ignore[arg-type]
    assert beside.value == pytest.approx(alone.value)


@pytest.mark.parametrize("read", [relative_size, relative_depth])
def test_levels_that_both_frames_share_do_not_count(read: Callable[..., RelativeReading]) -> None:
    ramp = np.linspace(0.0, 60.0, SHAPE[1])
    lifted = [replace(frame, grey=frame.grey + ramp) for frame in (hill(60.0), FLAT)]
    plain = read(hill(60.0), FLAT, against=PLAIN)
    assert read(*lifted, against=PLAIN).value == pytest.approx(plain.value)


def test_the_threshold_follows_the_bit_depth() -> None:
    deep = [replace(frame, grey=frame.grey * 4095 / 255, full_scale=4095.0) for frame in (hill(60.0), FLAT)]
    assert relative_size(*deep, against=UNTOUCHED).value == pytest.approx(
        relative_size(hill(60.0), FLAT, against=UNTOUCHED).value, rel=1e-3
    )


@pytest.mark.parametrize("seed", range(4))
def test_noise_of_the_camera_is_not_counted(seed: int) -> None:
    rng = np.random.default_rng(seed)
    noisy = [
        replace(frame, grey=np.rint(frame.grey + rng.normal(0.0, 1.2, SHAPE)), name=frame.name)
        for frame in (hill(60.0), FLAT, FLAT)
    ]
    clean = relative_size(hill(60.0), FLAT, against=UNTOUCHED).value
    assert relative_size(noisy[0], noisy[1], against=UNTOUCHED).value == pytest.approx(clean, rel=0.03)
    alone = relative_size(noisy[2], noisy[1], against=UNTOUCHED)
    assert (alone.value, alone.flags) == (0.0, ("no_contact",))
    counted = np.count_nonzero(noisy[2].grey - noisy[1].grey > K) * np.prod(SCALE)
    assert 2 * np.sqrt(counted / np.pi) > 0.2, "counted pixel by pixel, the noise has a size"


def test_several_references_are_averaged() -> None:
    frames = [replace(FLAT, grey=FLAT.grey + step) for step in (-3.0, 1.0, 2.0)]
    assert relative_size(hill(60.0), frames, against=UNTOUCHED).value == pytest.approx(
        relative_size(hill(60.0), FLAT, against=UNTOUCHED).value
    )


def uneven(frame: TactileImage) -> tuple[TactileImage, Calibration]:
    """The same frame under light that doubles from left to right, and a calibration that knows it."""
    x = np.linspace(-6.0, 6.0, 3)
    relative = np.tile(1.0 + x / 18.0, (3, 1))
    none = np.zeros_like(relative)
    light = LightMap(x_mm=x, y_mm=x, relative=relative, flux_x=none, flux_y=none, growth_per_mm=none, error=0.0)
    columns = (np.arange(SHAPE[1]) - (SHAPE[1] - 1) / 2) * SCALE[0]
    lit = replace(frame, grey=8.0 + (frame.grey - 8.0) * (1.0 + columns / 18.0) / relative.max())
    return lit, replace(CALIBRATION, background_grey=8.0, light=light)


@pytest.mark.parametrize("x", [-2.0, 0.0, 2.0])
def test_known_light_is_divided_out(x: float) -> None:
    """Frames are those of even light as bright as the best lit place, so readings are too."""
    frame = hill(60.0, 0.8, (x, 0.3))
    lit, calibration = uneven(frame)
    for read in (relative_size, relative_depth):
        even, known = read(frame, FLAT, against=PLAIN), read(lit, FLAT, against=PLAIN, calibration=calibration)
        assert known.value == pytest.approx(even.value, rel=1e-3)
        assert "The light is that of the calibration" in str(known)
        assert "The light is uniform over the face" in str(even)
    shape = object_shape(lit, FLAT, against=PLAIN, calibration=calibration)
    assert shape.area_mm2 == pytest.approx(object_shape(frame, FLAT, against=PLAIN).area_mm2, rel=1e-3)
    weak, _ = uneven(hill(25.0, 0.8, (x, 0.3)))
    kinds: dict[str, Any] = {"reference": FLAT, "against": PLAIN}
    stress = relative_hardness(weak, lit, calibration=calibration, **kinds).parts["stress_kpa"]
    gain = CALIBRATION.gain_grey_per_kpa * 4 / 3
    alike = relative_hardness(
        hill(25.0, 0.8, (x, 0.3)), frame, calibration=replace(CALIBRATION, gain_grey_per_kpa=gain), **kinds
    )
    assert stress == pytest.approx(alike.parts["stress_kpa"], rel=1e-3)


def test_a_clipped_centroid_has_no_level() -> None:
    clipped = hill(400.0)
    seen = relative_depth(replace(clipped, grey=np.minimum(clipped.grey, 255.0)), FLAT, against=UNTOUCHED)
    assert (seen.value, seen.flags) == (None, ("saturated",))


def test_what_is_wrong_is_flagged() -> None:
    def flags(image: TactileImage, **more: Any) -> tuple[str, ...]:
        return relative_depth(image, FLAT, against=UNTOUCHED, **more).flags

    assert flags(hill(60.0)) == ()
    assert flags(FLAT) == ("no_contact",)
    assert flags(hill(60.0, centre_mm=(4.5, 0.0))) == ("cropped",)
    clipped = hill(400.0)
    assert flags(replace(clipped, grey=np.minimum(clipped.grey, 255.0))) == ("saturated",)
    rough = np.random.default_rng(0).normal(0.0, 6.0, SHAPE)
    assert "noisy" in flags(replace(hill(60.0), grey=hill(60.0).grey + rough))
    assert relative_depth(FLAT, FLAT, against=UNTOUCHED).value is None


def test_hardness_without_growth_or_contact_is_no_number() -> None:
    kinds = {"reference": FLAT, "against": UNTOUCHED, "calibration": CALIBRATION}
    shrunk = relative_hardness(hill(60.0), hill(50.0), **kinds)  # type: ignore[arg-type]
    assert (shrunk.value, shrunk.flags) == (None, ("no_growth",))
    unseen = relative_hardness(hill(2.0), hill(60.0), **kinds)  # type: ignore[arg-type]
    assert (unseen.value, unseen.flags) == (None, ("no_contact",))


SMALL = TactileImage(grey=np.zeros((8, 8)), mm_per_pixel=SCALE)


@pytest.mark.parametrize(
    ("image", "reference", "against", "error", "said"),
    [
        (hill(60.0), FLAT, "plain", UnknownNameError, "did you mean 'plain tissue'"),
        (hill(60.0), [], PLAIN, InputError, "at least one frame"),
        (hill(60.0).grey, FLAT, PLAIN, InputError, "image must be a TactileImage; got ndarray"),
        (hill(60.0), FLAT.grey[0], PLAIN, InputError, "reference must hold TactileImage values"),
        (hill(60.0), SMALL, PLAIN, ImageMismatchError, "shape (160, 200); got (8, 8)"),
        (hill(60.0), replace(FLAT, mm_per_pixel=(0.05, 0.05)), PLAIN, ImageMismatchError, "mm_per_pixel"),
        (hill(60.0), replace(FLAT, full_scale=4095.0), PLAIN, ImageMismatchError, "full_scale 255"),
        (hill(60.0), replace(FLAT, axis_px=(3.0, 4.0)), PLAIN, ImageMismatchError, "axis_px"),
        (replace(hill(60.0), mm_per_pixel=None), FLAT, PLAIN, InputError, "mm_per_pixel is not known"),
        (hill(60.0), hill(0.0, force_n=1.0), UNTOUCHED, InputError, "got one pressed with 1 N"),
        (hill(60.0), hill(0.0, force_n=0.0), PLAIN, InputError, "got force_n 0"),
        (hill(60.0, force_n=1.0), hill(0.0, force_n=0.5), PLAIN, InputError, "1 N within 5 %; got 0.5 N"),
        (hill(0.0, base=255.0), FLAT, UNTOUCHED, InputError, "got 100 % (shorten the exposure)"),
        (hill(0.0, base=60.0), FLAT, UNTOUCHED, InputError, "got one with all pixels above it"),
    ],
)
def test_frames_that_say_nothing_are_refused(
    image: Any, reference: Any, against: str, error: type[Exception], said: str
) -> None:
    for read in (relative_size, relative_depth):
        with pytest.raises(error) as caught:
            read(image, reference, against=against)
        assert said in str(caught.value)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("threshold", [0.0, -1.0, 256.0, float("nan"), True, "5"])
def test_a_threshold_lies_above_zero(threshold: Any) -> None:
    with pytest.raises(InputError, match="threshold_grey must"):
        relative_size(hill(60.0), FLAT, against=UNTOUCHED, threshold_grey=threshold)


def test_two_presses_for_hardness_are_checked() -> None:
    weak, strong = hill(20.0, force_n=0.5), hill(40.0, force_n=1.0)

    def refusal(first: TactileImage, second: TactileImage, calibration: Any = CALIBRATION) -> str:
        with pytest.raises((InputError, NotCalibratedError)) as caught:
            relative_hardness(first, second, reference=FLAT, against=UNTOUCHED, calibration=calibration)
        return str(caught.value)

    assert "swap them" in refusal(strong, weak)
    assert "the same frame twice" in refusal(weak, weak)
    assert "calibration must be a Calibration" in refusal(weak, strong, None)
    assert "second must have the image's shape" in refusal(weak, SMALL)


def test_a_printed_reading_names_everything_it_rests_on() -> None:
    image = hill(60.0, centre_mm=(4.5, 0.0))
    readings = [
        relative_size(image, FLAT, against=PLAIN),
        relative_depth(image, FLAT, against=PLAIN),
        relative_hardness(hill(20.0), image, reference=FLAT, calibration=CALIBRATION, against=PLAIN),
    ]
    assert len({reading.assumptions for reading in readings}) == 3
    for reading in readings:
        text = str(reading)
        assert f"{reading.value:.4g} {reading.unit} (against plain tissue)" in text
        assert all(sentence in text for sentence in (*reading.assumptions, *reading.notes))
        assert "Research use only" in text
    assert "no value" in str(relative_depth(FLAT, FLAT, against=PLAIN))


def reading(value: float | None, quantity: str = "relative size", against: str = PLAIN) -> RelativeReading:
    flags = ("no_contact",) if not value else ()
    return RelativeReading(quantity=quantity, value=value, unit="mm", against=against, assumptions=(), flags=flags)


@given(st.lists(st.floats(1.0, 100.0), min_size=2, max_size=20))
def test_repeats_have_the_mean_and_deviation_of_their_values(values: list[float]) -> None:
    repeats = Repeats(label="target", readings=tuple(reading(value) for value in values))
    assert repeats.mean == pytest.approx(statistics.mean(values))
    assert repeats.sd == pytest.approx(statistics.stdev(values), abs=1e-9)
    assert repeats.observed == len(values)
    twice = Repeats(label="twice", readings=tuple(reading(2 * value) for value in values))
    assert ratios([repeats, twice]) == pytest.approx((1.0, 2.0))


def test_repeats_without_a_value() -> None:
    assert math.isnan(Repeats(label="once", readings=(reading(3.0), reading(None))).sd)
    unseen = Repeats(label="unseen", readings=(reading(None), reading(None)))
    assert unseen.observed == 0
    assert np.isnan([unseen.mean, unseen.sd, *ratios([unseen])]).all()
    assert np.isnan(ratios([Repeats(label="zero", readings=(reading(0.0),))])).all()
    some = Repeats(label="some", readings=(reading(None), reading(4.0)))
    assert (some.observed, some.mean) == (1, 4.0)


def test_readings_of_different_kinds_are_not_mixed() -> None:
    for other in (reading(1.0, against=UNTOUCHED), reading(1.0, quantity="relative depth"), 1.0):
        with pytest.raises(InputError, match="readings of 'mixed' must"):
            Repeats(label="mixed", readings=(reading(1.0), other))  # type: ignore[arg-type]
    with pytest.raises(InputError, match="at least one"):
        Repeats(label="none", readings=())
    kinds = [Repeats(label=kind, readings=(reading(1.0, against=kind),)) for kind in (UNTOUCHED, PLAIN)]
    with pytest.raises(InputError, match="one kind; got relative size against plain tissue and relative size"):
        ratios(kinds)
    with pytest.raises(InputError, match="got none"):
        ratios([])
