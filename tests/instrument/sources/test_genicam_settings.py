from __future__ import annotations

import pytest
from tests.instrument.sources.genicam_stand_ins import FakeNodes

from tsis.errors import CameraError, InputError, UnknownNameError
from tsis.instrument.camera import Setting, silence_timeout_s
from tsis.instrument.drivers.genicam import adjust, run_free, settings


def test_settings_have_our_names_and_units_and_the_cameras_ranges() -> None:
    assert settings(FakeNodes()) == (
        Setting(name="exposure_ms", value=20.0, low=0.01, high=1000.0, unit="ms"),
        Setting(name="gain", value=3.0, low=0.0, high=24.0, unit="dB"),
        Setting(name="brightness", value=10.0, low=0.0, high=63.0),
        Setting(name="frames_per_s", value=30.0, low=1.0, high=60.0, unit="1/s"),
    )


def test_what_the_camera_would_do_by_itself_is_switched_off_before_its_value_is_set() -> None:
    nodes = FakeNodes()
    adjust(nodes, "exposure_ms", 12.5)
    assert nodes.values["ExposureTime"] == 12_500.0
    assert nodes.writes == ["ExposureAuto", "ExposureTime"]
    adjust(nodes, "frames_per_s", 25.0)
    assert nodes.values["AcquisitionFrameRateEnable"] == 1
    assert nodes.values["AcquisitionFrameRate"] == 25.0


def test_a_setting_that_goes_in_steps_takes_the_nearest() -> None:
    nodes = FakeNodes()
    adjust(nodes, "brightness", 7.4)
    assert nodes.values["BlackLevelRaw"] == 6.0


def test_what_the_camera_has_not_or_cannot_is_said_in_one_sentence() -> None:
    nodes = FakeNodes()
    with pytest.raises(UnknownNameError, match="no setting is called 'gian'; did you mean 'gain'"):
        adjust(nodes, "gian", 1.0)
    with pytest.raises(InputError, match=r"exposure_ms must lie in \[0\.01, 1000\]; got 2000 \(ms\)"):
        adjust(nodes, "exposure_ms", 2000.0)
    with pytest.raises(InputError, match="got nan"):
        adjust(nodes, "gain", float("nan"))
    nodes.values.clear()
    with pytest.raises(CameraError, match="no setting called 'gain'; it has none at all"):
        adjust(nodes, "gain", 1.0)


def test_running_free_means_no_trigger_and_nothing_automatic() -> None:
    nodes = FakeNodes()
    run_free(nodes)
    assert set(nodes.trigger.values()) == {"Off"}
    assert nodes.values["TriggerSelector"] == "FrameStart"  # as it was
    assert (nodes.values["AcquisitionMode"], nodes.values["ExposureAuto"]) == ("Continuous", "Off")


def test_a_slow_camera_is_given_the_time_of_two_frames() -> None:
    assert silence_timeout_s({}) == 1.0
    assert silence_timeout_s({"frames_per_s": 0.25}) == 12.0
    assert silence_timeout_s({"frames_per_s": 30.0, "exposure_ms": 3000.0}) == 9.0
