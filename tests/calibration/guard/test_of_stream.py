"""What a calibration lets the guard compare with, and what the guard then tells of a camera's frames."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tests.calibration.file.bench import bench, bench_reference

from tsis.calibration.frames import UsableCalibration
from tsis.calibration.guard.watch import WatchState, guard_reference, press_watch, with_calibrated_scale
from tsis.catalog.probes import load_probe
from tsis.errors import ImageMismatchError
from tsis.instrument.camera import Frame
from tsis.model.image import TactileImage

PROBE = load_probe("tsis-2011")


def known(**changes: Any) -> UsableCalibration:
    return UsableCalibration(calibration=bench(**changes), identity="0" * 64)


def test_the_untouched_probe_is_that_of_the_calibration() -> None:
    reference, measured = guard_reference(known()), bench_reference()
    assert reference.untouched is not None
    np.testing.assert_allclose(reference.untouched.grey, measured.dark_grey + measured.untouched_grey, rtol=1e-12)
    assert reference.untouched.mm_per_pixel == (0.0336, 0.0392)
    assert reference.dark_grey == pytest.approx(8.0, abs=0.05)
    assert reference.face_radius_mm == PROBE.radius_mm


def test_what_was_not_measured_is_not_compared() -> None:
    for calibration in (None, known(reference=None)):
        reference = guard_reference(calibration)
        assert (reference.untouched, reference.face_radius_mm, reference.dark_grey) == (None, None, None)
    foreign = guard_reference(known(probe="of my own", response=None))
    assert foreign.untouched is not None
    assert foreign.face_radius_mm is None
    unscaled = guard_reference(known(scale=None)).untouched
    assert unscaled is not None
    assert unscaled.mm_per_pixel is None


def test_a_frame_gets_the_scale_of_its_camera_alone() -> None:
    image = TactileImage(grey=np.full((30, 40), 9.0))
    assert with_calibrated_scale(image, known()).mm_per_pixel == (0.0336, 0.0392)
    assert with_calibrated_scale(image, None) is image
    assert with_calibrated_scale(image, known(scale=None)) is image
    with pytest.raises(ImageMismatchError, match=r"\(30, 40\) that the scale was measured on"):
        with_calibrated_scale(TactileImage(grey=np.full((40, 30), 9.0)), known())


def test_only_with_a_calibration_does_the_watch_tell_light_that_was_not_there() -> None:
    measured = bench_reference()
    untouched = np.rint(measured.dark_grey + measured.untouched_grey).astype(np.uint8)

    def told(added: int, calibration: UsableCalibration | None) -> set[str]:
        frame = Frame(pixels=(untouched + added).astype(np.uint8), sequence=0, time_s=0.0, full_scale=255.0)
        flags, _ = press_watch(frame, calibration).step(WatchState(), frame)
        return {flag.name for flag in flags}

    assert told(0, known()) == {"no-contact"}
    assert told(100, known()) == {"no-contact", "ambient-light"}
    assert "ambient-light" not in told(100, None)
