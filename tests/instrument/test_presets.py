from __future__ import annotations

import pytest

from tsis.errors import UnknownNameError
from tsis.instrument.camera import Setting, preset

SETTINGS = (
    Setting(name="exposure_ms", value=20.0, low=0.1, high=33.0, unit="ms"),
    Setting(name="gain", value=6.0, low=0.0, high=24.0, unit="dB"),
    Setting(name="brightness", value=3.0),  # a driver that tells no range
    Setting(name="force_n", value=1.0, low=0.0, high=5.0, unit="newtons"),
)


def test_minimal_takes_the_lowest_light_that_the_driver_tells() -> None:
    assert preset("minimal", SETTINGS) == {"exposure_ms": 0.1, "gain": 0.0}


def test_default_takes_the_camera_back_to_how_it_came() -> None:
    assert preset("default", SETTINGS) == {"exposure_ms": 20.0, "gain": 6.0, "brightness": 3.0}


def test_other_presets_are_not_known() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'minimal'"):
        preset("minimum", SETTINGS)
