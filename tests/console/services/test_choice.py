"""What can be chosen, and what is refused with its cure."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from tsis.console.services.choice import CameraChoice, InstrumentSettings, VirtualSubject
from tsis.errors import InputError, UnknownNameError


@pytest.mark.parametrize("spec", ["files:frames", "files:", "video:press.mkv"])
def test_stored_frames_are_no_camera_and_the_cure_is_named(spec: str) -> None:
    for choose in (lambda: CameraChoice(spec=spec), lambda: InstrumentSettings(camera=spec)):
        with pytest.raises(InputError, match=r"stored \(estimate from stored frames with tsis examine, or enter them"):
            choose()


@pytest.mark.parametrize(
    ("given", "error", "text"),
    [
        ({"spec": "aravs:1"}, UnknownNameError, "did you mean 'aravis'"),
        ({"spec": ""}, UnknownNameError, "camera source"),
        ({"spec": 3}, InputError, "spec must be a str"),
        ({"spec": "virtual:2"}, InputError, "called virtual and nothing more"),
        ({"spec": "aravis:" + "x" * 300}, InputError, "at most 200 characters"),
        ({"spec": "aravis:a\x00b"}, InputError, "that can be shown"),
        ({"spec": "opencv:front"}, InputError, "go by their number, as in opencv:0; got 'opencv:front'"),
        ({"spec": "opencv:-1"}, InputError, "go by their number"),
        ({"spec": "opencv:\u0663"}, InputError, "go by their number"),
        ({"spec": "opencv:" + "9" * 30}, InputError, "go by their number"),
        ({"mode": "Mono8-1x1@1"}, UnknownNameError, "no mode is called 'Mono8-1x1@1'"),
        ({"mode": ""}, UnknownNameError, "no mode is called ''"),
        ({"mode": 3}, InputError, "mode must be a str"),
        ({"probe": "tsis"}, UnknownNameError, "no probe is called"),
        ({"phantom": "nothing"}, UnknownNameError, "no phantom is called"),
        ({"diameter_mm": -1.0}, InputError, "diameter_mm must"),
        ({"depth_mm": float("nan")}, InputError, "depth_mm must"),
        ({"young_kpa": "soft"}, InputError, "young_kpa must"),
        ({"diameter_mm": 60.0}, InputError, "mm"),
        ({"phantom": "cl2000x", "depth_mm": 3.0}, InputError, "cl2000x is a sphere"),
        ({"seed": -1}, InputError, "seed must lie in"),
        ({"seed": 1.5}, InputError, "seed must be a whole number"),
    ],
)
def test_what_cannot_be_chosen_is_refused_before_anything_starts(
    given: dict[str, Any], error: type[Exception], text: str
) -> None:
    with pytest.raises(error, match=text):
        CameraChoice(**given)


def test_what_can_be_pressed_follows_from_the_choice() -> None:
    assert CameraChoice().roles == ("target", "plain", "untouched")
    assert CameraChoice(phantom="cl2000x", probe="tsis-direct").roles == ("target", "ball", "untouched")
    assert CameraChoice(spec="aravis:").roles == ("target", "plain", "untouched", "ball")
    assert (CameraChoice().touch_n, CameraChoice(phantom="cl2003x").touch_n) == (1.0, 0.7)
    assert CameraChoice(spec="opencv:0").touch_n is None


@pytest.mark.parametrize("choice", [CameraChoice(), CameraChoice(phantom="cl2000x", probe="tsis-direct")])
def test_the_mode_of_the_virtual_probe_is_the_one_that_it_has(choice: CameraChoice) -> None:
    (mode,) = VirtualSubject(choice).connect().modes()
    assert replace(choice, mode=mode.label).mode == mode.label


def test_a_real_camera_may_be_chosen_in_a_mode_that_only_it_knows() -> None:
    assert CameraChoice(spec="opencv:", mode="Mono16-64x48@100").mode == "Mono16-64x48@100"


def test_a_console_may_begin_with_a_sphere() -> None:
    terms = InstrumentSettings(phantom="cl2003x", probe="tsis-direct", seed=9)
    assert terms.choice == CameraChoice(phantom="cl2003x", probe="tsis-direct", seed=9)
    with pytest.raises(UnknownNameError, match="kind of store"):
        InstrumentSettings(kind="patient")
