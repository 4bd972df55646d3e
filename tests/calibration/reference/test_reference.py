from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import tsis
from tsis.calibration.force.reading import patch_mask, read_press, total_grey
from tsis.calibration.reference.making import Reference, make_reference
from tsis.imaging.sensor import Sensor
from tsis.model import TactileImage
from tsis.model.errors import CalibrationError, ImageMismatchError, InputError
from tsis.virtual.loading_machine import FLAT_LEVELS, VirtualLoadingMachine

SENSOR = Sensor(columns=256, rows=216)


def machine(seed: int = 1, *, patch: bool = True) -> VirtualLoadingMachine:
    return VirtualLoadingMachine(
        tsis.load_probe("tsis-direct"), rng=np.random.default_rng(seed), sensor=SENSOR, patch=patch
    )


def of(bench: VirtualLoadingMachine, *, flats: bool = True) -> Reference:
    dark, untouched = ([take() for _ in range(8)] for take in (bench.dark, bench.no_contact))
    levels = [[bench.flat(level) for _ in range(6)] for level in FLAT_LEVELS] if flats else []
    return make_reference(dark, untouched, levels, patch_px=bench.patch_px)


@pytest.fixture(scope="module")
def bench() -> VirtualLoadingMachine:
    return machine()


@pytest.fixture(scope="module")
def reference(bench: VirtualLoadingMachine) -> Reference:
    return of(bench)


def test_no_contact_reads_zero(bench: VirtualLoadingMachine, reference: Reference) -> None:
    frame = bench.no_contact()
    corrected = reference.corrected(frame).grey[reference.usable]
    noise = np.sqrt(0.5**2 + 1 / 12 + 0.017 * 3.0) * np.sqrt(1 + 1 / 8 + 1 / 8)
    # the lamps' correction, of 0.04 % of 3 grey levels, is common to all pixels
    assert abs(corrected.mean()) < 4 * noise / np.sqrt(corrected.size) + 3 * 3.0 * reference.lamp_sd
    assert corrected.std() == pytest.approx(noise, rel=0.1)
    assert total_grey(frame, reference) == 0.0


def test_what_lies_beside_the_contact_reads_zero(bench: VirtualLoadingMachine, reference: Reference) -> None:
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


def test_the_reference_patch_takes_the_lamps_away(bench: VirtualLoadingMachine, reference: Reference) -> None:
    frame = bench.press(10.0, 1.0)[0]
    dimmer = replace(frame, grey=reference.dark_grey + 0.93 * (frame.grey - reference.dark_grey))
    assert reference.lamp_ratio(dimmer) == pytest.approx(0.93 * reference.lamp_ratio(frame), rel=1e-9)
    assert total_grey(dimmer, reference) == pytest.approx(total_grey(frame, reference), rel=1e-3)


def test_hot_and_dead_pixels_are_found_and_mended(bench: VirtualLoadingMachine, reference: Reference) -> None:
    bad = np.zeros(SENSOR.rows * SENSOR.columns, dtype=bool)
    bad[bench._bad.ravel()] = True
    box = np.zeros((SENSOR.rows, SENSOR.columns), dtype=bool)
    assert bench.patch_px is not None
    left, top, right, bottom = bench.patch_px
    box[top:bottom, left:right] = True
    assert np.array_equal(~reference.usable & ~box, bad.reshape(box.shape) & ~box)
    corrected = reference.corrected(bench.no_contact()).grey
    assert np.abs(corrected[bad.reshape(box.shape) & ~box]).max() < 3.0  # a hot pixel is 40 brighter


def test_noise_is_that_of_the_camera(reference: Reference) -> None:
    low, high = reference.read_noise_grey.interval(0.999)
    assert low < SENSOR.read_noise_grey < high
    low, high = reference.shot_noise_grey.interval(0.999)
    assert low < SENSOR.shot_noise_grey < high


def test_a_saturated_frame_is_refused(bench: VirtualLoadingMachine, reference: Reference) -> None:
    frame = bench.no_contact()
    grey = np.array(frame.grey)
    grey[80:120, 80:120] = 255.0
    with pytest.raises(InputError, match="clip"):
        reference.corrected(replace(frame, grey=grey))


def test_frames_of_another_camera_mode_are_refused(reference: Reference) -> None:
    with pytest.raises(ImageMismatchError, match="shape"):
        reference.corrected(TactileImage(grey=np.zeros((10, 10))))
    with pytest.raises(ImageMismatchError, match="full scale"):
        reference.corrected(TactileImage(grey=np.zeros((216, 256)), full_scale=4095.0))


def test_lamps_that_are_off_are_refused(bench: VirtualLoadingMachine, reference: Reference) -> None:
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


def test_without_a_scale_a_press_cannot_be_read(bench: VirtualLoadingMachine, reference: Reference) -> None:
    frame = replace(bench.press(2.0, 1.0)[0], mm_per_pixel=None)
    with pytest.raises(InputError, match="mm_per_pixel"):
        read_press(frame, replace(reference, mm_per_pixel=None), force_n=1.0, touched=True)


@pytest.mark.parametrize("tip_mm", [2.0, 14.0])
def test_threshold_and_canny_find_the_same_light(
    bench: VirtualLoadingMachine, reference: Reference, tip_mm: float
) -> None:
    frame = bench.press(tip_mm, 1.5)[0]
    cut, edges = (total_grey(frame, reference, method=name) for name in ("threshold", "canny"))
    assert edges == pytest.approx(cut, rel=0.005)
    read = read_press(frame, reference, force_n=1.5, touched=True)
    assert read.total_grey == pytest.approx(cut, rel=1e-12)
    assert cut == pytest.approx(read.field_grey, rel=0.005)
