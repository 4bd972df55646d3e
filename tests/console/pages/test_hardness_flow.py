"""What is said to be done next in a measurement of hardness, from what the store holds."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from tsis.calibration.file import ProbeCalibration
from tsis.console.pages.hardness import SavedPresses, missing_text, next_free, next_step_text, saved_presses
from tsis.console.services.choice import CameraChoice
from tsis.model.image import TactileImage
from tsis.records.store import open_store

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from tsis.records.store import Store

NOON = datetime(2026, 11, 22, 12, tzinfo=UTC)
USABLE = ProbeCalibration(name="of the test", probe="tsis-direct")


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    with open_store(tmp_path / "records", kind="phantom") as created:
        yield created


def pressed(store: Store, number: int, forces: dict[str, tuple[float, ...]]) -> None:
    """A target with presses of these forces by role, in this order."""
    target = store.add_target(number=number, name="ball")
    minute = 0
    for role, item in forces.items():
        for force in item:
            minute += 1
            store.add_press(
                target,
                TactileImage(grey=np.full((6, 8), float(minute)), mm_per_pixel=(0.1, 0.1), force_n=force),
                role=role,
                taken=NOON + timedelta(minutes=minute),
                probe="tsis-direct",
                calibration=USABLE,
                flags=(),
            )


def state(
    choice: CameraChoice, *, running: bool = True, lost: bool = False, calibration: str = "c", busy: str = ""
) -> Any:
    camera = SimpleNamespace(choice=choice, running=running, lost=lost)
    return SimpleNamespace(camera=camera, calibration=calibration, calibration_identity=calibration, busy=busy)


def test_of_each_force_the_newest_press_counts(store: Store) -> None:
    pressed(store, 4, {"target": (0.7, 1.2, 0.7), "ball": (1.0,), "untouched": (0.0,)})
    result = saved_presses(store, 4)
    assert [press.force_n for press in result.on_object] == [1.2, 0.7]
    assert result.on_object[1].taken == NOON + timedelta(minutes=3)
    assert [press.force_n for press in result.presses if press.role == "ball"] == [1.0]
    assert result.estimate is None
    assert not result.is_current


def test_the_next_step_follows_from_what_is_kept(store: Store) -> None:
    pressed(store, 1, {"target": (0.7,)})
    pressed(store, 2, {"target": (0.7, 1.2)})
    pressed(store, 3, {"target": (0.7, 0.7)})
    assert next_step_text(SavedPresses(number=9), ("lay it there.",), estimating=False) == "Next: lay it there."
    assert next_step_text(SavedPresses(number=9), (), estimating=False).startswith("Next: press the object")
    assert next_step_text(saved_presses(store, 1), (), estimating=False).startswith(
        "Next: press it again at another force"
    )
    assert next_step_text(saved_presses(store, 3), (), estimating=False).startswith(
        "Next: press it again at another force"
    )
    assert next_step_text(saved_presses(store, 2), (), estimating=False).startswith("Next: estimate")
    assert next_step_text(saved_presses(store, 2), ("lay it there.",), estimating=False).startswith("Next: estimate")
    assert next_step_text(saved_presses(store, 2), (), estimating=True) == "The estimate is running."


def test_a_new_object_gets_a_number_of_its_own(store: Store) -> None:
    assert next_free(store, 7) == 7
    pressed(store, 7, {"target": (0.7,)})
    pressed(store, 12, {"target": (0.7,)})
    assert next_free(store, 8) == 8
    assert next_free(store, 7) == 13


def test_what_stands_in_the_way_is_named() -> None:
    virtual, sphere = CameraChoice(), CameraChoice(probe="tsis-direct", phantom="cl2000x")
    real = CameraChoice(spec="aravis:x")
    lay = ("place an object under the virtual probe.",)
    assert missing_text(state(virtual), scaled=False, responds=True) == lay
    assert missing_text(state(sphere, running=False), scaled=False, responds=True) == lay
    assert missing_text(state(sphere), scaled=False, responds=True) == ()
    assert missing_text(state(real), scaled=True, responds=True) == ()
    (stopped,) = missing_text(state(real, running=False), scaled=True, responds=True)
    assert stopped == "start the camera, on the page Examine; it is stopped."
    (starts,) = missing_text(state(real, running=False, busy="starting the camera"), scaled=True, responds=True)
    assert starts == "wait; the console is starting the camera."
    (away,) = missing_text(state(real, lost=True), scaled=True, responds=True)
    assert away == "wait until the camera is back; it is away."
    (none,) = missing_text(state(real, calibration=""), scaled=False, responds=False)
    assert none == "activate a calibration, on the page Camera; there is none (the page Calibrate makes one)."
    (deaf,) = missing_text(state(real), scaled=True, responds=False)
    assert deaf == "choose another calibration; 'c' lacks the response to pressure."
    (blind,) = missing_text(state(real), scaled=False, responds=True)
    assert blind == "choose another calibration; 'c' lacks the size of a pixel."
