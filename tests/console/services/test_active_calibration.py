"""A calibration is in force only where it fits the camera as it runs."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tests.console.services.lit_camera import COLUMNS, ROWS
from tests.console.services.instruments import ANN, LIT, lit_bench
from tests.records.sample import sample_calibration
from tests.waiting import until

from tsis.calibration import MeasuredValue, UsableCalibration
from tsis.calibration.file import calibration_sha256, write_calibration
from tsis.calibration.scale import PixelScale
from tsis.errors import CalibrationError, FileInputError

if TYPE_CHECKING:
    from pathlib import Path

    from tests.console.services.lit_camera import World

    from tsis.console.services import Instrument

NOW = datetime.now(UTC)


def scale(shape: tuple[int, int]) -> PixelScale:
    size = [MeasuredValue(value=value, sd=1e-3, unit="mm/px") for value in (0.3, 0.4)]
    return PixelScale(
        mm_per_pixel_x=size[0], mm_per_pixel_y=size[1], shape=shape, at_px=(20.0, 20.0), method="dots", count=63
    )


def known(**changes: Any) -> UsableCalibration:
    made = replace(sample_calibration(), camera=LIT, settings={"gain": 2.0}, **changes)
    return UsableCalibration(calibration=made, identity=calibration_sha256(made))


def test_presses_are_taken_under_it_with_its_scale_and_probe(bench: Instrument) -> None:
    fits = known(scale=scale((ROWS, COLUMNS)))
    bench.use_calibration(fits, by=ANN)  # before the camera tells what it is
    bench.start(by=ANN)
    state = bench.state()
    assert (state.calibration, state.calibration_identity, state.trouble) == ("bench", fits.identity, ())
    assert state.camera.mm_per_pixel == pytest.approx((0.3, 0.4))
    kept = bench.snapshot(by=ANN)
    assert (kept.press.calibration, kept.press.probe) == (fits.identity, "tsis-2011")
    assert kept.press.mm_per_pixel == pytest.approx((0.3, 0.4))
    assert calibration_sha256(bench.store.calibration(fits.identity)) == fits.identity


def test_another_setting_puts_it_out_of_force_until_it_is_set_back(bench: Instrument) -> None:
    bench.start(by=ANN)
    bench.use_calibration(known(), by=ANN)
    bench.adjust("gain", 5.0, by=ANN)
    assert bench.calibration is None
    state = bench.state()
    assert (state.calibration, state.calibration_identity) == ("", "")
    assert state.trouble == (
        "The calibration is not in force, and presses are kept without one: calibration 'bench' holds at gain = 2; the "
        "camera is at 5 (set it back, or calibrate at this setting).",
    )
    assert bench.snapshot(by=ANN).press.calibration is None
    bench.preset("default", by=ANN)
    assert bench.state().trouble == ()
    assert bench.snapshot(by=ANN).press.calibration == known().identity


def test_a_setting_that_was_changed_elsewhere_this_moment_is_noticed_by_the_snapshot(
    bench: Instrument, world: World
) -> None:
    bench.start(by=ANN)
    bench.use_calibration(known(), by=ANN)
    world.cameras[0].gain = 9.0
    assert bench.snapshot(by=ANN).press.calibration is None


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"camera": "aravis:other"}, "must be of the camera in use, 'aravis:lit'; it is of 'aravis:other'"),
        ({"settings": {"gain": 3.0}}, "holds at gain = 3; the camera is at 2"),
        ({"scale": scale((492, 768))}, "is of frames of 768 x 492 pixels; the camera's have 64 x 48"),
        ({"made": NOW - timedelta(days=9), "expires": NOW - timedelta(days=1)}, "must not be expired"),
        ({"made": NOW + timedelta(days=1), "expires": NOW + timedelta(days=9)}, "must not come from the future"),
    ],
)
def test_one_that_does_not_fit_is_refused_and_the_one_before_stays(
    bench: Instrument, changes: dict[str, Any], words: str
) -> None:
    bench.use_calibration(known(), by=ANN)
    bench.start(by=ANN)
    until(lambda: bench.state().camera.rows > 0)
    other = UsableCalibration(calibration=replace(known().calibration, **changes), identity="0" * 64)
    with pytest.raises(CalibrationError, match=words):
        bench.use_calibration(other, by=ANN)
    assert bench.state().calibration_identity == known().identity


@pytest.mark.parametrize("changes", [{"camera": "aravis:other"}, {"scale": scale((492, 768))}])
def test_one_that_was_given_before_the_start_and_does_not_fit_is_told_and_nothing_is_kept_under_it(
    bench: Instrument, changes: dict[str, Any]
) -> None:
    other = replace(known().calibration, **changes)
    bench.use_calibration(UsableCalibration(calibration=other, identity=calibration_sha256(other)), by=ANN)
    bench.start(by=ANN)
    until(lambda: bench.state().camera.rows > 0)
    assert "The calibration is not in force" in bench.state().trouble[0]
    assert bench.snapshot(by=ANN).press.calibration is None
    until(lambda: bench.frame_analysis is not None)  # the live view goes on
    assert np.sum(bench.frame_analysis.histogram if bench.frame_analysis else 0) == ROWS * COLUMNS


def test_of_a_file_at_the_start(tmp_path: Path) -> None:
    good, old = tmp_path / "good.json", tmp_path / "old.json"
    write_calibration(known().calibration, good)
    write_calibration(replace(known().calibration, made=NOW - timedelta(days=9), expires=NOW - timedelta(days=1)), old)
    with lit_bench(tmp_path, calibration=good) as bench:
        bench.start(by=ANN)
        assert bench.state().calibration_identity == known().identity
    with pytest.raises(CalibrationError, match="must not be expired"):
        lit_bench(tmp_path, calibration=old)
    with pytest.raises(FileInputError):
        lit_bench(tmp_path, calibration=tmp_path / "none.json")


def test_the_parts_of_one_judgement_belong_together_though_the_camera_is_set_anew_meanwhile(
    bench: Instrument, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Somebody turns a knob at the camera: each look at its settings finds another gain."""
    fits = known(scale=scale((ROWS, COLUMNS)))
    bench.start(by=ANN)
    bench.use_calibration(fits, by=ANN)
    usual, other = (
        bench.camera_controller.settings(),
        tuple(replace(each, value=9.0) for each in bench.camera_controller.settings()),
    )
    looks = cycle((usual, other, other))
    monkeypatch.setattr(bench.camera_controller, "settings", lambda: next(looks))
    found = []
    for _ in range(6):
        press = bench.snapshot(by=ANN).press
        found.append((press.calibration is None, press.mm_per_pixel is None, press.probe == "tsis-domed"))
        state = bench.state()
        found.append((state.calibration == "", state.camera.mm_per_pixel is None, bool(state.trouble)))
    assert set(found) == {(False, False, False), (True, True, True)}
