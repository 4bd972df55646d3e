"""A calibration is in force only where it fits the camera as it runs."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tests.console.services.instruments import ANN, LIT, lit_instrument
from tests.console.services.lit_camera import COLUMNS, ROWS
from tests.records.sample import sample_calibration
from tests.waiting import until

from tsis.calibration.file import calibration_sha256, write_calibration
from tsis.calibration.frames import UsableCalibration
from tsis.calibration.measured import MeasuredValue
from tsis.calibration.scale import PixelScale
from tsis.console.services.choice import CameraChoice
from tsis.errors import CalibrationError, FileInputError

if TYPE_CHECKING:
    from pathlib import Path

    from tests.console.services.lit_camera import World

    from tsis.console.services.instrument import Instrument

NOW = datetime.now(UTC)


def scale(shape: tuple[int, int]) -> PixelScale:
    size = [MeasuredValue(value=value, sd=1e-3, unit="mm/px") for value in (0.3, 0.4)]
    return PixelScale(
        mm_per_pixel_x=size[0], mm_per_pixel_y=size[1], shape=shape, at_px=(20.0, 20.0), method="dots", count=63
    )


def calibration_with(**changes: Any) -> UsableCalibration:
    created = replace(sample_calibration(), camera=LIT, settings={"gain": 2.0}, **changes)
    return UsableCalibration(calibration=created, identity=calibration_sha256(created))


def test_presses_are_taken_under_it_with_its_scale_and_probe(instrument: Instrument) -> None:
    fits = calibration_with(scale=scale((ROWS, COLUMNS)))
    instrument.use_calibration(fits, by=ANN)  # before the camera tells what it is
    instrument.start(by=ANN)
    state = instrument.state()
    assert (state.calibration, state.calibration_identity, state.trouble) == ("bench", fits.identity, ())
    assert state.camera.mm_per_pixel == pytest.approx((0.3, 0.4))
    remaining = instrument.snapshot(by=ANN)
    assert (remaining.press.calibration, remaining.press.probe) == (fits.identity, "tsis-2011")
    assert remaining.press.mm_per_pixel == pytest.approx((0.3, 0.4))
    assert calibration_sha256(instrument.store.calibration(fits.identity)) == fits.identity


def test_another_setting_puts_it_out_of_force_until_it_is_set_back(instrument: Instrument) -> None:
    instrument.start(by=ANN)
    instrument.use_calibration(calibration_with(), by=ANN)
    instrument.adjust("gain", 5.0, by=ANN)
    assert instrument.calibration is None
    state = instrument.state()
    assert (state.calibration, state.calibration_identity) == ("", "")
    assert state.trouble == (
        "The calibration is inactive, and presses are saved without one: calibration 'bench' holds at gain = 2; the "
        "camera is at 5 (set it back, or calibrate at this setting).",
    )
    assert instrument.snapshot(by=ANN).press.calibration is None
    instrument.preset("default", by=ANN)
    assert instrument.state().trouble == ()
    assert instrument.snapshot(by=ANN).press.calibration == calibration_with().identity


def test_a_setting_that_was_changed_elsewhere_this_moment_is_noticed_by_the_snapshot(
    instrument: Instrument, world: World
) -> None:
    instrument.start(by=ANN)
    instrument.use_calibration(calibration_with(), by=ANN)
    world.cameras[0].gain = 9.0
    assert instrument.snapshot(by=ANN).press.calibration is None


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"camera": "aravis:other"}, "must be of the camera in use, 'aravis:lit'; it is of 'aravis:other'"),
        ({"settings": {"gain": 3.0}}, "holds at gain = 3; the camera is at 2"),
        ({"scale": scale((492, 768))}, "is of frames of 768 x 492 pixels; the camera's have 64 x 48"),
        ({"made": NOW - timedelta(days=9), "expires": NOW - timedelta(days=1)}, "must not be expired"),
        ({"made": NOW + timedelta(days=1), "expires": NOW + timedelta(days=9)}, "must not come from the future"),
    ],
)
def test_one_that_does_not_fit_is_refused_and_the_one_before_stays(
    instrument: Instrument, changes: dict[str, Any], text: str
) -> None:
    instrument.use_calibration(calibration_with(), by=ANN)
    instrument.start(by=ANN)
    until(lambda: instrument.state().camera.rows > 0)
    other = UsableCalibration(calibration=replace(calibration_with().calibration, **changes), identity="0" * 64)
    with pytest.raises(CalibrationError, match=text):
        instrument.use_calibration(other, by=ANN)
    assert instrument.state().calibration_identity == calibration_with().identity


@pytest.mark.parametrize("changes", [{"camera": "aravis:other"}, {"scale": scale((492, 768))}])
def test_one_that_was_given_before_the_start_and_does_not_fit_is_told_and_nothing_is_kept_under_it(
    instrument: Instrument, changes: dict[str, Any]
) -> None:
    other = replace(calibration_with().calibration, **changes)
    instrument.use_calibration(UsableCalibration(calibration=other, identity=calibration_sha256(other)), by=ANN)
    instrument.start(by=ANN)
    until(lambda: instrument.state().camera.rows > 0)
    assert "The calibration is inactive" in instrument.state().trouble[0]
    assert instrument.snapshot(by=ANN).press.calibration is None
    until(lambda: instrument.frame_analysis is not None)  # the live view goes on
    assert np.sum(instrument.frame_analysis.histogram if instrument.frame_analysis else 0) == ROWS * COLUMNS


def test_of_a_file_at_the_start(tmp_path: Path) -> None:
    good, old = tmp_path / "good.json", tmp_path / "old.json"
    write_calibration(calibration_with().calibration, good)
    write_calibration(
        replace(calibration_with().calibration, made=NOW - timedelta(days=9), expires=NOW - timedelta(days=1)), old
    )
    with lit_instrument(tmp_path, calibration=good) as instrument:
        instrument.start(by=ANN)
        assert instrument.state().calibration_identity == calibration_with().identity
    with pytest.raises(CalibrationError, match="must not be expired"):
        lit_instrument(tmp_path, calibration=old)
    with pytest.raises(FileInputError):
        lit_instrument(tmp_path, calibration=tmp_path / "none.json")


def test_the_parts_of_one_judgement_belong_together_though_the_camera_is_set_anew_meanwhile(
    instrument: Instrument, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Somebody turns a knob at the camera: each look at its settings finds another gain."""
    fits = calibration_with(scale=scale((ROWS, COLUMNS)))
    instrument.start(by=ANN)
    instrument.use_calibration(fits, by=ANN)
    usual, other = (
        instrument.camera_controller.settings(),
        tuple(replace(item, value=9.0) for item in instrument.camera_controller.settings()),
    )
    checks = cycle((usual, other, other))
    monkeypatch.setattr(instrument.camera_controller, "settings", lambda: next(checks))
    result = []
    for _ in range(6):
        press = instrument.snapshot(by=ANN).press
        result.append((press.calibration is None, press.mm_per_pixel is None, press.probe == "tsis-domed"))
        state = instrument.state()
        result.append((state.calibration == "", state.camera.mm_per_pixel is None, bool(state.trouble)))
    assert set(result) == {(False, False, False), (True, True, True)}


def test_the_next_run_activates_it_again_for_its_camera(tmp_path: Path) -> None:
    fits = calibration_with()
    with lit_instrument(tmp_path) as first:
        first.use_calibration(fits, by=ANN)
    with lit_instrument(tmp_path) as again:
        assert again.state().trouble == ("Calibration 'bench' of the last session is active again.",)
        again.start(by=ANN)
        state = again.state()
        assert (state.calibration_identity, state.trouble) == (fits.identity, ())
        assert again.snapshot(by=ANN).press.calibration == fits.identity
        again.choose(CameraChoice(), by=ANN)
        again.use_calibration(None, by=ANN)
        again.choose(CameraChoice(spec=LIT), by=ANN)
        assert again.state().calibration_identity == fits.identity
    with lit_instrument(tmp_path, camera="virtual") as other:
        assert other.state().trouble == ()
    with lit_instrument(tmp_path) as last:
        last.use_calibration(None, by=ANN)
    with lit_instrument(tmp_path) as without:
        assert (without.state().calibration, without.state().trouble) == ("", ())


@pytest.mark.parametrize("damage", [b"", b"{}"])
def test_a_calibration_that_cannot_be_read_again_says_so(tmp_path: Path, damage: bytes) -> None:
    with lit_instrument(tmp_path) as first:
        first.use_calibration(calibration_with(), by=ANN)
    (file,) = (tmp_path / "workspace" / "active-calibrations").iterdir()
    file.write_bytes(damage)
    with lit_instrument(tmp_path) as again:
        (message,) = again.state().trouble
        assert message.startswith("The calibration of the last session was not activated: ")
        assert again.calibration is None


def test_one_that_was_given_at_the_start_comes_first(tmp_path: Path) -> None:
    with lit_instrument(tmp_path) as first:
        first.use_calibration(calibration_with(), by=ANN)
    other = calibration_with(name="other")
    write_calibration(other.calibration, tmp_path / "other.json")
    with lit_instrument(tmp_path, calibration=tmp_path / "other.json") as again:
        assert (again.state().calibration_identity, again.state().trouble) == (other.identity, ())
