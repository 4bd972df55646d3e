"""Hardness: the next step follows from what is stored, and the modulus shown is the stored one."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from nicegui import ui
from tests.console.pages.open_page import RecordingViewer, on_a_page, texts
from tests.console.pages.simulated import at_console
from tests.console.services.instruments import ANN, lit_instrument
from tests.records.pressed_object import pressed, stored_object

from tsis.calibration.file import ProbeCalibration, write_calibration
from tsis.calibration.frames import parse_usable_calibration
from tsis.console.pages.hardness import (
    HardnessPage,
    SavedPresses,
    missing_text,
    next_free,
    next_step_text,
    saved_presses,
)
from tsis.console.services.choice import CameraChoice
from tsis.errors import RecordsError
from tsis.model.image import TactileImage
from tsis.records.store import open_store

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from tests.console.pages.simulated import Operator

    from tsis.console.services.instrument import Instrument
    from tsis.records.store import Store


def test_without_camera_or_calibration_it_says_what_to_do_first(lit: Instrument, tmp_path: Path) -> None:
    file = tmp_path / "bench.json"
    write_calibration(pressed()[1], file)

    async def script(operator: Operator) -> None:
        await operator.sees("Next: start the camera; it is stopped.", "The camera is stopped.")
        assert not operator.enabled("Estimate")
        lit.start(by=lit.control.owner().identity)  # type: ignore[union-attr]
        await operator.sees("Next: activate a calibration, on the page Camera; there is none")
        lit.use_calibration(
            parse_usable_calibration(file.read_bytes(), file.name),
            by=lit.control.owner().identity,  # type: ignore[union-attr]
        )
        await operator.misses("there is none")
        await operator.sees("None yet; 2 at different forces are best.")

    at_console(lit, script, "/hardness")


def test_a_stored_hardness_is_shown_and_estimated_again_with_the_typed_radius(lit: Instrument) -> None:
    lit.control.take(ANN, "Ann")
    lit.set_target(stored_object(lit.store).number, by=ANN)
    lit.control.release(ANN)

    async def script(operator: Operator) -> None:
        await operator.sees("Done. Press again at another force to test it", "Object, 0.7 N", "Object, 1.2 N")
        (before,) = (await operator.requested("/targets/1/estimates"))["estimates"]
        await operator.sees("Hardness of target 1, cl2000x", f"{before['parameters']['young_kpa']['mean']:.0f} kPa")
        await operator.until(lambda: operator.field("Radius of the object") == "3.000", "the radius is not there")
        for radius, sd, message in (
            ("round", "0.02", "Radius of the object must be a number, as 2 or 0.5 (you entered 'round')."),
            ("", "0.02", "Radius of the object must be given with its standard deviation (nothing was entered)."),
            ("300", "0.02", "Radius of the object must be 1–50 mm (you entered 300)."),
            ("3", "1", "Its standard uncertainty must be 0–0.3 mm, up to a tenth of the radius (you entered 1)."),
            ("3", "wide", "Its standard uncertainty must be a number, as 2 or 0.5 (you entered 'wide')."),
        ):
            await operator.types("Radius of the object", radius)
            await operator.types("Its standard uncertainty", sd)
            await operator.clicks("Estimate", ui.button)
            await operator.beside(message.partition(" must")[0], message)
        await operator.types("Radius of the object", "3.2")
        await operator.types("Its standard uncertainty", "0.02")
        await operator.clicks("Estimate", ui.button)
        while len(found := (await operator.requested("/targets/1/estimates"))["estimates"]) == 1:
            await operator.pause()
        after = found[-1]
        assert after["options"] == {"radius_mm": 3.2, "radius_sd_mm": 0.02}
        assert after["parameters"]["young_kpa"]["mean"] != before["parameters"]["young_kpa"]["mean"]
        await operator.sees(f"{after['parameters']['young_kpa']['mean']:.0f} kPa")

    at_console(lit, script, "/hardness")


def test_another_object_gets_a_number_of_its_own(lit: Instrument) -> None:
    stored_object(lit.store)

    async def script(operator: Operator) -> None:
        await operator.sees("target 1", "Object, 0.7 N")
        await operator.clicks("Another object")
        await operator.sees("target 2")
        await operator.misses("Object, 0.7 N")
        assert (await operator.requested("/state"))["target"] == 2

    at_console(lit, script, "/hardness")


def test_the_virtual_probe_has_no_object_until_one_lies_under_it(lit: Instrument) -> None:
    lit.control.take(ANN, "Ann")
    lit.choose(CameraChoice(), by=ANN)
    lit.control.release(ANN)

    async def script(operator: Operator) -> None:
        await operator.sees("Next: place an object under the virtual probe.", "Virtual sphere")
        assert not operator.enabled("Estimate")
        assert operator.named("Snapshot") == []

    at_console(lit, script, "/hardness")


NOON = datetime(2026, 11, 22, 12, tzinfo=UTC)
USABLE = ProbeCalibration(name="of the test", probe="tsis-direct")


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    with open_store(tmp_path / "records", kind="phantom") as created:
        yield created


def pressed_ball(store: Store, number: int, forces: dict[str, tuple[float, ...]]) -> None:
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
    choice: CameraChoice,
    *,
    running: bool = True,
    lost: bool = False,
    calibration: str = "c",
    busy: str = "",
    role: str = "target",
) -> Any:
    camera = SimpleNamespace(choice=choice, running=running, lost=lost)
    identity = {"calibration": calibration, "calibration_identity": calibration}
    return SimpleNamespace(camera=camera, **identity, busy=busy, role=role)


def test_of_each_force_the_newest_press_counts(store: Store) -> None:
    pressed_ball(store, 4, {"target": (0.7, 1.2, 0.7), "ball": (1.0,), "untouched": (0.0,)})
    result = saved_presses(store, 4)
    assert [press.force_n for press in result.on_object] == [1.2, 0.7]
    assert result.on_object[1].taken == NOON + timedelta(minutes=3)
    assert [press.force_n for press in result.presses if press.role == "ball"] == [1.0]
    assert result.estimate is None
    assert not result.is_current


def test_the_next_step_follows_from_what_is_kept(store: Store) -> None:
    pressed_ball(store, 1, {"target": (0.7,)})
    pressed_ball(store, 2, {"target": (0.7, 1.2)})
    pressed_ball(store, 3, {"target": (0.7, 0.7)})
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
    pressed_ball(store, 7, {"target": (0.7,)})
    pressed_ball(store, 12, {"target": (0.7,)})
    assert next_free(store, 8) == 8
    assert next_free(store, 7) == 13


def test_what_stands_in_the_way_is_named() -> None:
    virtual, sphere = CameraChoice(), CameraChoice(probe="tsis-direct", phantom="cl2000x")
    real = CameraChoice(spec="aravis:x")
    lay = ("place an object under the virtual probe.",)
    assert missing_text(state(virtual), scaled=False, responds=True) == lay
    assert missing_text(state(sphere, running=False), scaled=False, responds=True) == lay
    assert missing_text(state(sphere), scaled=False, responds=True) == ()
    (inactive,) = missing_text(state(sphere, calibration=""), scaled=False, responds=False)
    assert inactive.startswith("activate a calibration")  # before the first press, as the banner says
    assert missing_text(state(real), scaled=True, responds=True) == ()
    (stopped,) = missing_text(state(real, running=False), scaled=True, responds=True)
    assert stopped == "start the camera; it is stopped."
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
    (other,) = missing_text(state(real, role="plain"), scaled=True, responds=True)
    assert other == "choose what is pressed, the target or a ball; now it is “reference (no inclusion)”."
    assert missing_text(state(real, role="ball"), scaled=True, responds=True) == ()


START = "Next: start the camera; it is stopped."


def test_a_target_that_was_not_read_is_said_to_be_read(tmp_path: Path) -> None:
    with lit_instrument(tmp_path) as instrument:

        async def changed(viewer: RecordingViewer) -> None:
            page = HardnessPage(instrument, viewer)
            page._show(instrument.state())
            assert "Target 1 is being read." in texts(viewer)
            await page._refresh()
            assert START in texts(viewer)
            instrument.set_target(7, by=ANN)
            page._show(instrument.state())
            assert "Target 7 is being read." in texts(viewer)
            assert START not in texts(viewer)
            await page._refresh()
            assert START in texts(viewer)

        on_a_page(instrument, changed)


def test_why_the_store_was_not_read_stays_until_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken() -> int:
        raise RecordsError("the store must be there; it is not")

    with lit_instrument(tmp_path) as instrument:

        async def troubled(viewer: RecordingViewer) -> None:
            page = HardnessPage(instrument, viewer)
            page._show(instrument.state())
            with monkeypatch.context() as patched:
                patched.setattr(instrument.store, "entries", broken)
                await page._refresh()
                page._show(instrument.state())  # which comes much more often
                assert "the store must be there; it is not" in texts(viewer)
            await page._refresh()
            assert "the store must be there; it is not" not in texts(viewer)
            assert START in texts(viewer)

        on_a_page(instrument, troubled)
