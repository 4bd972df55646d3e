from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import linregress, norm
from tests.calibration.bench import bench_reference

import tsis
from tsis.calibration.camera_reference import (
    MOST_BAD,
    CameraReference,
    PhotonTransfer,
    _bad,
    _line,
    _Point,
    _points,
    make_reference,
    photon_transfer,
)
from tsis.calibration.force_line import patch_mask, read_loading_frame, total_grey
from tsis.calibration.guard.reading import FrameShape, GuardReference, prepare_reference
from tsis.errors import CalibrationError, ImageMismatchError, InputError
from tsis.imaging.sensor import Sensor
from tsis.model.image import TactileImage
from tsis.virtual.loading_machine import FLAT_LEVELS, VirtualLoadingMachine

if TYPE_CHECKING:
    from numpy.typing import NDArray


SENSOR = Sensor(columns=256, rows=216)


def machine(seed: int = 1, *, patch: bool = True) -> VirtualLoadingMachine:
    return VirtualLoadingMachine(
        tsis.load_probe("tsis-direct"), rng=np.random.default_rng(seed), sensor=SENSOR, patch=patch
    )


def of(bench: VirtualLoadingMachine, *, flats: bool = True) -> CameraReference:
    dark, untouched = ([take() for _ in range(8)] for take in (bench.dark, bench.no_contact))
    levels = [[bench.flat(level) for _ in range(6)] for level in FLAT_LEVELS] if flats else []
    return make_reference(dark, untouched, levels, patch_px=bench.patch_px)


@pytest.fixture(scope="module")
def bench() -> VirtualLoadingMachine:
    return machine()


@pytest.fixture(scope="module")
def reference(bench: VirtualLoadingMachine) -> CameraReference:
    return of(bench)


def test_no_contact_reads_zero(bench: VirtualLoadingMachine, reference: CameraReference) -> None:
    frame = bench.no_contact()
    corrected = reference.corrected(frame).grey[reference.usable]
    noise = np.sqrt(0.5**2 + 1 / 12 + 0.017 * 3.0) * np.sqrt(1 + 1 / 8 + 1 / 8)
    # the lamps' correction, of 0.04 % of 3 grey levels, is common to all pixels
    assert abs(corrected.mean()) < 4 * noise / np.sqrt(corrected.size) + 3 * 3.0 * reference.lamp_sd
    assert corrected.std() == pytest.approx(noise, rel=0.1)
    assert total_grey(frame, reference) == 0.0


def test_what_lies_beside_the_contact_reads_zero(bench: VirtualLoadingMachine, reference: CameraReference) -> None:
    corrected = reference.corrected(bench.press(2.0, 1.0)[0])
    beside = reference.usable & ~patch_mask(corrected)
    assert abs(corrected.grey[beside].mean()) < 0.02


def test_the_light_becomes_even() -> None:
    bench = machine(3)  # whose light varies by 4 %
    reference = of(bench)
    shading = bench.truth.relative_light[reference.usable]
    frame = bench.flat(0.5)
    raw, even = (grey[reference.usable] for grey in (frame.grey, reference.corrected(frame).grey))
    # slope of the relative grey level over the light's own pattern: 1 without correction, 0 with it
    assert np.polyfit(shading, raw / raw.mean(), 1)[0] > 0.9
    assert abs(np.polyfit(shading, even / even.mean(), 1)[0]) < 0.01


def test_the_reference_patch_takes_the_lamps_away(bench: VirtualLoadingMachine, reference: CameraReference) -> None:
    frame = bench.press(10.0, 1.0)[0]
    dimmer = replace(frame, grey=reference.dark_grey + 0.93 * (frame.grey - reference.dark_grey))
    assert reference.lamp_ratio(dimmer) == pytest.approx(0.93 * reference.lamp_ratio(frame), rel=1e-9)
    assert total_grey(dimmer, reference) == pytest.approx(total_grey(frame, reference), rel=1e-3)


CORNER, DEPTH = (4, 4, 20, 16), 4095.0


def of_twelve_bits(patch_grey: float, *, glow: float = 0.0) -> CameraReference:
    """A camera of 4095 levels whose patch has that light, and whose dark frame is brighter there by ``glow``."""
    rng = np.random.default_rng(8)
    dark = np.full((60, 80), 64.0)
    lamps = np.full(dark.shape, 20.0)
    dark[4:16, 4:20] += glow
    lamps[4:16, 4:20] = patch_grey

    def taken(light: float | np.ndarray) -> TactileImage:
        noisy = dark + light + np.sqrt(2.0 + 0.2 * np.asarray(light)) * rng.standard_normal(dark.shape)
        return TactileImage(grey=np.rint(noisy), full_scale=DEPTH)

    none = np.zeros_like(dark)
    flat = lamps + np.where(lamps == patch_grey, 0.0, 1500.0)
    frames = ([taken(light) for _ in range(4)] for light in (none, lamps, flat))
    still, untouched, even = frames
    return make_reference(still, untouched, [even], patch_px=CORNER)


def guards(known: CameraReference) -> GuardReference:
    """What the press guard is given of a reference."""
    return GuardReference(
        untouched=TactileImage(grey=known.dark_grey + known.untouched_grey, full_scale=known.full_scale),
        patch=known.patch,
        dark_grey=float(known.dark_grey.mean()),
    )


def test_a_patch_must_be_lit_by_a_share_of_the_scale_and_not_by_a_number_of_levels() -> None:
    with pytest.raises(InputError, match=r"at least 2% of full scale .* it is (49|50)"):
        of_twelve_bits(50.0)
    known = of_twelve_bits(100.0)
    assert known.patch_grey is not None
    assert known.patch_grey.value == pytest.approx(100.0, abs=1.0)
    assert known.patch_px == CORNER


@given(patch_grey=st.floats(70.0, 100.0), glow=st.floats(-20.0, 20.0))
@settings(max_examples=40)
def test_the_press_guard_takes_every_patch_that_the_reference_took(patch_grey: float, glow: float) -> None:
    try:
        known = of_twelve_bits(patch_grey, glow=glow)
    except InputError:
        # above its own dark level, or above the frame's mean, of which the glow is a twenty-fifth
        assert min(patch_grey, patch_grey + 0.96 * glow) < 0.02 * DEPTH + 1.0
        return
    guard = guards(known)
    assert guard.untouched is not None
    found = prepare_reference(guard, FrameShape.of(guard.untouched))
    assert found.patch_before is not None


@pytest.mark.parametrize(
    ("patch_px", "message"),
    [((4, 4, 7, 7), "at least 16 pixels"), ((300, 4, 340, 30), "inside the frame"), ((9, 9, 3, 3), "last_")],
)
def test_patches_that_no_lamp_can_be_read_from_are_refused(
    bench: VirtualLoadingMachine, patch_px: tuple[int, int, int, int], message: str
) -> None:
    dark, untouched, flat = ([take() for _ in range(4)] for take in (bench.dark, bench.no_contact, bench.flat))
    with pytest.raises(InputError, match=message):
        make_reference(dark, untouched, [flat], patch_px=patch_px)


def test_hot_and_dead_pixels_are_found_and_mended(bench: VirtualLoadingMachine, reference: CameraReference) -> None:
    bad, box = bench.camera.bad_pixels, np.zeros((SENSOR.rows, SENSOR.columns), dtype=bool)
    assert bad.sum() == 16
    assert bench.patch_px is not None
    left, top, right, bottom = bench.patch_px
    box[top:bottom, left:right] = True
    assert np.array_equal(~reference.usable & ~box, bad & ~box)
    corrected = reference.corrected(bench.no_contact()).grey
    assert np.abs(corrected[bad & ~box]).max() < 3.0  # a hot pixel is 40 brighter


def test_noise_is_that_of_the_camera(reference: CameraReference) -> None:
    low, high = reference.read_noise_grey.interval(0.999)
    assert low < SENSOR.read_noise_grey < high
    low, high = reference.shot_noise_grey.interval(0.999)
    assert low < SENSOR.shot_noise_grey < high


def test_a_saturated_frame_is_refused(bench: VirtualLoadingMachine, reference: CameraReference) -> None:
    frame = bench.no_contact()
    grey = np.array(frame.grey)
    grey[80:120, 80:120] = 255.0
    with pytest.raises(InputError, match="clip"):
        reference.corrected(replace(frame, grey=grey))


def test_frames_of_another_camera_mode_are_refused(reference: CameraReference) -> None:
    with pytest.raises(ImageMismatchError, match="shape"):
        reference.corrected(TactileImage(grey=np.zeros((10, 10))))
    with pytest.raises(ImageMismatchError, match="full scale"):
        reference.corrected(TactileImage(grey=np.zeros((216, 256)), full_scale=4095.0))


def test_lamps_that_are_off_are_refused(bench: VirtualLoadingMachine, reference: CameraReference) -> None:
    with pytest.raises(InputError, match="lamps"):
        reference.corrected(bench.dark())
    without = machine(patch=False)
    known = of(without)
    with pytest.raises(InputError, match="lamps"):
        known.corrected(without.dark())


def test_dark_and_untouched_the_wrong_way_round_are_refused() -> None:
    bench = machine(patch=False)
    dark, untouched, flat = ([take() for _ in range(4)] for take in (bench.dark, bench.no_contact, bench.flat))
    with pytest.raises(CalibrationError, match="swapped"):
        make_reference(untouched, dark, [flat])


def test_too_few_frames_are_refused(bench: VirtualLoadingMachine) -> None:
    with pytest.raises(CalibrationError, match="at least 4 frames; got 1"):
        make_reference([bench.dark()], [bench.no_contact()] * 4)


def test_frames_of_two_sizes_are_refused(bench: VirtualLoadingMachine) -> None:
    with pytest.raises(ImageMismatchError, match="one size"):
        make_reference([bench.dark()] * 4, [TactileImage(grey=np.zeros((9, 9)))] * 4)


def test_without_a_scale_a_press_cannot_be_read(bench: VirtualLoadingMachine, reference: CameraReference) -> None:
    frame = replace(bench.press(2.0, 1.0)[0], mm_per_pixel=None)
    with pytest.raises(InputError, match="mm_per_pixel"):
        read_loading_frame(frame, replace(reference, mm_per_pixel=None), force_n=1.0, touched=True)


@pytest.mark.parametrize("tip_mm", [2.0, 14.0])
def test_threshold_and_canny_find_the_same_light(
    bench: VirtualLoadingMachine, reference: CameraReference, tip_mm: float
) -> None:
    frame = bench.press(tip_mm, 1.5)[0]
    cut, edges = (total_grey(frame, reference, method=name) for name in ("threshold", "canny"))
    assert edges == pytest.approx(cut, rel=0.005)
    read = read_loading_frame(frame, reference, force_n=1.5, touched=True)
    assert read.total_grey == pytest.approx(cut, rel=1e-12)
    assert cut == pytest.approx(read.field_grey, rel=0.005)


def test_as_many_hot_pixels_as_the_limit_are_left_out() -> None:
    dark = np.zeros((2, 100, 100))
    hot = np.zeros((100, 100), bool)
    hot[5::10, 3::5] = True  # 200 of 10,000, apart from each other
    dark[:, hot] = 50.0
    assert hot.mean() == MOST_BAD
    np.testing.assert_array_equal(_bad(dark, []), hot)
    dark[:, 50, 50] = 50.0
    with pytest.raises(CalibrationError, match="at most 2% of pixels may be hot or dead"):
        _bad(dark, [])


def test_an_untouched_probe_that_is_nearly_dark_is_told_from_another_by_a_share_of_the_full_scale() -> None:
    """No light at the calibration: blocks of 5 x 5 pixels may differ by 0.4 % of 255 grey levels and not by more."""
    dark = bench_reference()
    known = replace(dark, untouched_grey=np.zeros_like(dark.dark_grey), patch_px=None)
    for level, alike in ((0.9, True), (1.2, False)):
        frame = TactileImage(grey=dark.dark_grey + level, mm_per_pixel=known.mm_per_pixel)
        with nullcontext() if alike else pytest.raises(ImageMismatchError, match=r"within 1\.02 grey levels"):
            known.require_untouched(frame)


@pytest.mark.parametrize("lamps", [0.85, 1.2])
def test_an_untouched_probe_is_known_by_the_pattern_of_its_light_whatever_its_lamps(lamps: float) -> None:
    """Another pattern across that of the probe, with a tenth of its root mean square, is the limit."""
    dark, (row, column) = bench_reference(), np.indices((30, 40))
    signs = np.where((row // 15 + column // 20) % 2, 1.0, -1.0)  # in quarters, which blocks do not mix
    light = 40.0 + 10.0 * np.where(column < 20, 1.0, -1.0)
    assert abs((light * signs).sum()) < 1e-9, "no brightness of the lamps explains the other pattern"
    known = replace(dark, untouched_grey=light, patch_px=None)
    for share, alike in ((0.095, True), (0.105, False)):
        seen = lamps * (light + share * np.sqrt((light**2).mean()) * signs)
        frame = TactileImage(grey=dark.dark_grey + seen, mm_per_pixel=known.mm_per_pixel)
        with nullcontext() if alike else pytest.raises(ImageMismatchError, match="of another probe, or touched"):
            known.require_untouched(frame)


def test_lamps_that_are_nearly_off_are_told_how_bright_they_are() -> None:
    known = replace(bench_reference(), untouched_grey=np.full((30, 40), 50.0), patch_px=None)
    frame = TactileImage(grey=known.dark_grey + 10.0, mm_per_pixel=known.mm_per_pixel)
    with pytest.raises(InputError, match=r"they are at 0\.20 of it"):
        known.lamp_ratio(frame)


SIZE = (120, 160)
EVERY = np.ones(SIZE, dtype=bool)
READ, SHOT = 0.5, 0.02


def frames(
    rng: np.random.Generator,
    light: float,
    *,
    read: float = READ,
    offset: float = 8.0,
    count: int = 6,
    flicker: float = 0.0,
) -> NDArray[np.float64]:
    """Whole electrons and normal read noise, rounded: no code is shared with the camera of the package."""
    lamps = 1 + flicker * rng.standard_normal(count)
    shaded = light * np.linspace(0.9, 1.1, SIZE[1])
    electrons = rng.poisson(np.broadcast_to(lamps[:, None, None] * shaded / SHOT, (count, *SIZE)))
    return np.rint(offset + SHOT * electrons + read * rng.standard_normal((count, *SIZE)))


def transfer(
    rng: np.random.Generator, *, read: float = READ, offset: float = 8.0, flicker: float = 0.0
) -> PhotonTransfer:
    levels = [frames(rng, light, read=read, offset=offset, flicker=flicker) for light in (40.0, 100.0, 160.0)]
    return photon_transfer(frames(rng, 0.0, read=read, offset=offset), levels, usable=EVERY, full_scale=255.0)


@pytest.mark.parametrize("read", [0.4, 0.5, 1.5])
@pytest.mark.parametrize("offset", [8.0, 8.3, 8.5])
def test_both_noises_are_found_through_rounding(read: float, offset: float) -> None:
    found = transfer(np.random.default_rng(1), read=read, offset=offset)
    assert abs(found.read_noise_grey.value - read) < 4 * found.read_noise_grey.sd
    assert abs(found.shot_noise_grey.value - SHOT) < 4 * found.shot_noise_grey.sd
    assert found.read_noise_grey.sd < 0.01 * read


def test_rounding_at_a_whole_level_would_mislead_who_takes_a_twelfth() -> None:
    """What the harmonic is for: exact probabilities of a rounded normal of mean 8 give less than s**2 + 1/12."""
    levels = np.arange(30)
    share = norm.cdf((levels + 0.5 - 8) / READ) - norm.cdf((levels - 0.5 - 8) / READ)
    variance = share @ (levels - 8.0) ** 2
    naive = float(np.sqrt(variance - 1 / 12))
    found = transfer(np.random.default_rng(2)).read_noise_grey
    assert abs(naive - READ) > 5 * found.sd
    assert abs(found.value - READ) < 4 * found.sd


def test_lamps_that_flicker_are_no_noise() -> None:
    found = transfer(np.random.default_rng(3), flicker=0.01)
    assert abs(found.shot_noise_grey.value - SHOT) < 4 * found.shot_noise_grey.sd


def test_intervals_hold_the_truth() -> None:
    held = 0
    for seed in range(40):
        found = transfer(np.random.default_rng(100 + seed))
        low, high = found.read_noise_grey.interval()
        held += low <= READ <= high
    assert held >= 33  # 95 % of 40 is 38; fewer than 33 has a chance of 1 in 1,000


def test_the_error_of_a_variance_is_its_scatter() -> None:
    """The error that one set of frames states is the scatter of the variances of many sets."""
    rng, base = np.random.default_rng(8), np.full(500, 8.2)
    sets = [np.rint(base + 1.5 * rng.standard_normal((6, 500))) for _ in range(400)]
    (points,) = zip(*(_points(values, base, is_dark=True) for values in sets), strict=True)
    variance = np.array([point.variance for point in points])
    assert variance.mean() == pytest.approx(1.5**2, rel=0.01)
    assert variance.std() == pytest.approx(np.mean([point.error for point in points]), rel=0.15)


def test_scatter_beyond_the_stated_errors_widens_the_intervals() -> None:
    """A hundred times the scatter that is stated: errors are those of a regression that knows none of them."""
    light = np.linspace(0.0, 150.0, 12)
    off = np.where(np.arange(12) % 2, 1.0, -1.0) * np.linspace(0.5, 1.0, 12)
    wide, narrow = (
        _line([_Point(x, 4 + 0.05 * x + size * y, 0.01) for x, y in zip(light, off, strict=True)])
        for size in (1.0, 0.0)
    )
    regression = linregress(light, 4 + 0.05 * light + off)
    assert wide.shot_noise_grey.value == pytest.approx(regression.slope)
    assert wide.shot_noise_grey.sd == pytest.approx(regression.stderr)
    assert wide.read_noise_grey.value == pytest.approx(np.sqrt(regression.intercept))
    assert wide.read_noise_grey.sd == pytest.approx(regression.intercept_stderr / (2 * np.sqrt(regression.intercept)))
    assert narrow.shot_noise_grey.sd == pytest.approx(0.01 / np.sqrt(12 * light.var()))


def test_clipped_frames_are_refused() -> None:
    rng = np.random.default_rng(4)
    dark = np.maximum(frames(rng, 0.0, offset=0.2), 0.0)
    with pytest.raises(CalibrationError, match="clip"):
        photon_transfer(dark, [frames(rng, 100.0)], usable=EVERY, full_scale=255.0)


def test_levels_at_the_full_scale_count_as_clipped() -> None:
    rng = np.random.default_rng(4)
    bright = np.minimum(frames(rng, 100.0), 108.0)
    with pytest.raises(CalibrationError, match="clip"):
        photon_transfer(frames(rng, 0.0), [bright], usable=EVERY, full_scale=108.0)


def test_dark_levels_alone_are_refused() -> None:
    rng = np.random.default_rng(5)
    with pytest.raises(CalibrationError, match="flat-field"):
        photon_transfer(frames(rng, 0.0), [frames(rng, 2.0)], usable=EVERY, full_scale=255.0)


def test_noise_below_rounding_is_refused() -> None:
    rng = np.random.default_rng(6)
    with pytest.raises(CalibrationError, match="rounding"):
        transfer(rng, read=0.05, offset=8.3)
