"""Examine: the order of work, and that what is done there is what scripts read of the instrument."""

from __future__ import annotations

import json
import threading
from datetime import UTC, datetime, timedelta
from functools import partial
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pytest
from nicegui import ui
from tests.console.filled_store import ESTIMATED
from tests.console.pages.simulated import at_console
from tests.console.services.instruments import ANN, BOB, gauge
from tests.records.sample import sample_record
from tests.waiting import HANGS_S

from tsis.console.live.view import LiveView
from tsis.console.pages.examine import SavedTarget, next_step, work_steps
from tsis.files.frame_names import target_folder

if TYPE_CHECKING:
    from tests.console.pages.simulated import Operator
    from tests.console.services.lit_camera import World

    from tsis.console.services.instrument import Instrument


async def started(operator: Operator) -> None:
    await operator.clicks("Start")
    await operator.sees("aravis:lit: ")


def test_start_and_stop_are_one_button(lit: Instrument) -> None:
    async def script(operator: Operator) -> None:
        await operator.sees("camera stopped", "The camera is stopped.", "live image of the probe: no frames")
        await started(operator)
        await operator.sees("frames/s, 0 dropped, 64 x 48 pixels", "contact around column 32, row 24")
        assert (await operator.requested("/state"))["camera"]["running"] is True
        await operator.clicks("Stop")
        await operator.sees("camera stopped", "Start")
        await operator.misses("frames/s")
        assert (await operator.requested("/state"))["camera"]["running"] is False

    at_console(lit, script)


@pytest.mark.parametrize("page", ["/", "/hardness"])
def test_a_camera_that_is_being_started_is_not_called_stopped(lit: Instrument, world: World, page: str) -> None:
    world.opening = threading.Event()

    async def script(operator: Operator) -> None:
        assert world.opening is not None
        await operator.clicks("Start")
        await operator.sees("starting the camera …")
        if page != "/":
            await operator.open(page)
        await operator.sees("Starting the camera …")
        await operator.misses("stopped")
        world.opening.set()
        await operator.sees("frames/s, 0 dropped")
        await operator.misses("tarting the camera")

    at_console(lit, script)


def test_a_snapshot_is_a_press_of_the_target_with_the_typed_force(lit: Instrument) -> None:
    async def script(operator: Operator) -> None:
        await operator.sees("No presses of this target yet.")
        await started(operator)
        await operator.types("Target", "20")
        await operator.types("Force", "0.8")
        await operator.sees("0.80 N", "(typed)", "Target 20")
        await operator.chooses("Pressed on", "on the target")
        await operator.clicks("Snapshot")
        await operator.hears("Saved for target 20: on the target, 0.8 N")
        await operator.sees("1 press", "0.8 N")
        await operator.chooses("Pressed on", "reference (no inclusion)")
        await operator.types("Force", "")
        await operator.sees("no force gauge")
        operator.presses_key("snapshot")
        await operator.hears("Saved for target 20: reference (no inclusion), no force gauge")
        await operator.sees("2 presses")
        saved = (await operator.requested("/targets/20/presses"))["presses"]
        assert [(press["role"], press["force_n"]) for press in saved] == [("target", 0.8), ("plain", None)]

    at_console(lit, script)
    assert len(list((lit.terms.workspace / target_folder(20)).glob("*.json"))) == 2


def test_keys_and_buttons_go_from_target_to_target(lit: Instrument) -> None:
    async def shown(operator: Operator, number: str) -> None:
        await operator.until(lambda: operator.field("Target") == number, f"the target is not {number}")
        assert (await operator.requested("/state"))["target"] == int(number)

    async def script(operator: Operator) -> None:
        operator.presses_key("step", 1)
        await shown(operator, "2")
        await operator.clicks("Next target")
        await shown(operator, "3")
        operator.presses_key("step", -1)
        await shown(operator, "2")
        await operator.clicks("Previous target")
        await shown(operator, "1")

    at_console(lit, script)


def test_wrong_numbers_are_refused_and_the_old_ones_stay(lit: Instrument) -> None:
    async def refused(operator: Operator, field: str, typed: str, message: str) -> None:
        before = operator.field(field)
        await operator.types(field, typed)
        await operator.sees(message)
        assert operator.field(field) == typed  # what was typed can be corrected
        assert not operator.messages  # nothing lies over the page
        operator.presses_escape(field)
        await operator.until(lambda: operator.field(field) == before, f"{field} shows {operator.field(field)!r}")
        await operator.misses(message)

    async def script(operator: Operator) -> None:
        await started(operator)
        await operator.types("Force", "1.5")
        await operator.sees("1.50 N")
        for typed, message in {
            "abc": "Target must be a number, as 2 or 0.5 (you entered 'abc').",
            "": "Target must be a number, as 2 or 0.5 (nothing was entered).",
            "0": "Target must be 1–99999, number of the target (you entered 0).",
            "2.5": "Target must be a whole number (you entered 2.5)",
            "1e999": "Target must be a whole number (what you entered is too large)",
            "<img src=x>": "Target must be a number, as 2 or 0.5 (you entered '<img src=x>').",
        }.items():
            await refused(operator, "Target", typed, message)
        await refused(operator, "Force", "-1", "Force must be 0–")
        await refused(operator, "Force", "hard", "Force must be a number, as 2 or 0.5 (you entered 'hard').")
        state = await operator.requested("/state")
        assert (state["target"], state["force_n"]) == (1, 1.5)
        await operator.types("Force", "")  # which says that it is not known
        await operator.sees("no force gauge")
        assert (await operator.requested("/state"))["force_n"] is None

    at_console(lit, script)


def test_a_force_of_a_gauge_is_shown_in_place_of_a_typed_one(lit: Instrument) -> None:
    lit.control.take(ANN, "Ann")
    lit.use_gauge(gauge(0.8), by=ANN)
    lit.start(by=ANN)

    async def script(operator: Operator) -> None:
        await operator.sees("0.80 N", "from the gauge")

    at_console(lit, script)


def test_settings_change_the_camera_within_its_range(lit: Instrument, world: World) -> None:
    async def script(operator: Operator) -> None:
        await operator.clicks("Settings", ui.tab)
        await operator.sees("Start the camera to adjust it.")
        await started(operator)
        await operator.sees("0 to 24 dB")
        await operator.types("Gain", "7.5")
        await operator.until(lambda: world.cameras[-1].adjusted[-1:] == [7.5], "the camera's gain is another")
        await operator.types("Gain", "25")
        await operator.sees("Gain must be 0–24 dB (you entered 25).")
        assert operator.field("Gain") == "25"  # to be corrected
        await operator.clicks("Minimal")
        await operator.until(lambda: operator.field("Gain") == "0", "the preset is not shown")
        await operator.misses("Gain must be 0–24 dB (you entered 25).")
        assert (await operator.requested("/camera/settings"))["settings"][0]["value"] == 0.0
        await operator.clicks("Default")
        await operator.until(lambda: operator.field("Gain") == "2", "the preset is not shown")
        assert world.cameras[-1].adjusted == [7.5, 0.0, 2.0]

    at_console(lit, script)


def test_a_sequence_is_recorded_whole_and_wrong_lengths_begin_none(lit: Instrument) -> None:
    async def script(operator: Operator) -> None:
        await operator.clicks("Sequence", ui.tab)
        await operator.sees("Every frame is saved unchanged")
        await operator.clicks("Record")
        await operator.hears("the camera must run to record a sequence; it is stopped (start it)")
        await started(operator)
        for typed, unit, message in (
            ("soon", "seconds", "Seconds must be a number, as 2 or 0.5 (you entered 'soon')."),
            ("0", "seconds", "Seconds must be 0.1–3600 s"),
            ("2.5", "frames", "Frames must be a whole number (you entered 2.5)."),
            ("0", "frames", "Frames must be 1–"),
        ):
            await operator.types("Length", typed)
            await operator.chooses("Unit of the length", unit)
            await operator.clicks("Record")
            await operator.beside("Length", message)
        await operator.types("Length", "5")
        await operator.clicks("Record")
        await operator.sees("Sequence of target 1: 5 frames in ")
        (job,) = (await operator.requested("/jobs"))["jobs"]
        report = (await operator.requested(f"/jobs/{job['identity']}"))["result"]["report"]
        assert (report["kept"], report["ended_by"]) == (5, "")
        await operator.clicks("Snapshot")
        await operator.hears("Saved for target 1")
        await operator.open("/records/1")
        await operator.clicks("Play sequence")
        await operator.sees("sequence of target 1", "Frame 2 of 5")  # by itself

    at_console(lit, script)
    folder = lit.terms.workspace / target_folder(1) / "sequence"
    assert len(list(folder.glob("*.png"))) == 5
    assert json.loads((folder / "recording.json").read_text())["target"] == 1


def test_a_camera_that_goes_away_is_said_in_every_place(lit: Instrument, world: World) -> None:
    async def script(operator: Operator) -> None:
        await started(operator)
        world.plugged = False
        await operator.sees("camera away", "no force gauge")
        assert "No flags." not in operator.texts
        assert (await operator.requested("/state"))["camera"]["lost"] is True
        world.plugged = True
        await operator.sees("interrupted once", "contact around column 32, row 24")

    at_console(lit, script)


def test_of_two_operators_one_commands_and_the_other_watches(lit: Instrument) -> None:
    async def script(operator: Operator) -> None:
        other = await operator.other()
        await other.sees("browser 1 controls the camera; you are watching.", "You are watching. Take the camera")
        await operator.until(lambda: operator.enabled("Start"), "who holds the camera can not start it")
        assert not other.enabled("Start")
        assert not other.enabled("Snapshot")
        await started(operator)
        other.presses_key("snapshot")
        await other.hears("the camera is controlled by browser 1; watch, or take it over")
        await other.clicks("Take the camera")
        await other.sees("browser 1 is using the camera.")
        await other.clicks("Take over")
        await operator.sees("browser 2 controls the camera; you are watching.")
        await operator.hears("browser 2 took over the camera; you are watching now.")
        await other.clicks("Stop")
        await operator.sees("camera stopped")
        await other.clicks("Release the camera")
        await other.sees("Take the camera")

    at_console(lit, script)


def test_an_estimate_without_a_calibration_is_refused_and_a_stored_one_shown(lit: Instrument) -> None:
    stored = lit.store.import_target(sample_record()).target.number
    assert stored == ESTIMATED

    async def script(operator: Operator) -> None:
        await operator.clicks("Estimate", ui.button)
        await operator.hears("Target 1 must have a press on the target to be estimated")
        await operator.types("Target", str(stored))
        await operator.sees(f"Target {stored}")
        (current,) = (await operator.requested(f"/targets/{stored}/estimates"))["estimates"]
        mean = current["parameters"]["diameter_mm"]["mean"]
        await operator.sees("Diameter", f"{mean:.3g} mm")

    at_console(lit, script)


def test_the_relief_follows_the_live_image(lit: Instrument) -> None:
    async def script(operator: Operator) -> None:
        await started(operator)
        assert not any("relief" in text for text in operator.texts)
        await operator.clicks("3-D")
        await operator.sees("relief of the live image: contact around column 32, row 24")
        await operator.clicks("3-D")
        await operator.misses("relief")

    at_console(lit, script)


def test_jobs_are_listed_and_only_the_owner_ends_them(lit: Instrument) -> None:
    lit.control.take(BOB, "Bob", held_s=600.0)

    async def script(operator: Operator) -> None:
        lit.begin_sequence(seconds=600.0, by=BOB)
        await operator.sees("Jobs: ")
        await operator.clicks(operator.named("Jobs: ")[0])
        await operator.clicks("Cancel sequence of target 1")
        await operator.hears("Only the user who controls the camera may cancel jobs: take the camera first.")
        lit.control.release(BOB)
        await operator.clicks("Take the camera")
        await operator.sees("Release the camera")
        await operator.clicks("Cancel sequence of target 1")
        await operator.sees("done", " frames in ")

    lit.start(by=BOB)
    at_console(lit, script)


def _is_set(view: LiveView, prop: str) -> bool:
    return bool(view.props.get(prop))


def test_the_image_is_frozen_ranged_and_marked_while_the_camera_goes_on(lit: Instrument) -> None:
    async def script(operator: Operator) -> None:
        await started(operator)
        await operator.sees("of the pixels at full scale")  # a frame was counted
        (view,) = (element for element in operator._shown() if isinstance(element, LiveView))
        for name, prop in (("Freeze", "frozen"), ("Clipping", "marks")):
            assert view.props[prop] is False
            await operator.clicks(name)
            await operator.until(partial(_is_set, view, prop), f"{name} does nothing")
        (ends,) = (element for element in operator._shown() if isinstance(element, ui.range))
        for low, high, taken in ((40, 200, [40, 200, 1]), (255, 255, [254, 255, 1]), (7, 7, [7, 8, 1])):
            ends.value = {"min": low, "max": high}
            assert json.loads(view.props["range"]) == taken

        def ends_of_range() -> list[int]:
            return list(json.loads(view.props["range"])[:2])

        await operator.clicks("Auto")
        await operator.until(lambda: np.diff(ends_of_range())[0] >= 24, "Auto leaves the range")
        await operator.clicks("Reset")
        await operator.until(lambda: ends_of_range() == [0, 255], "Reset leaves the range")
        assert (await operator.requested("/state"))["camera"]["running"]

    at_console(lit, script)


def test_the_page_of_jobs_has_those_of_earlier_runs(lit: Instrument) -> None:
    job = lit.jobs.begin("estimate of target 7", lambda job: job.say("d = 8 mm"))
    assert job.wait(HANGS_S)

    async def script(operator: Operator) -> None:
        await operator.sees("Nothing is running.", "Jobs of this session and of earlier ones")
        await operator.until(lambda: [row[1:3] for row in operator.rows] == [("estimate of target 7", "done")], "none")
        assert operator.rows[0][4] == "d = 8 mm"

    at_console(lit, script, "/jobs")


WHEN = datetime(2026, 3, 1, tzinfo=UTC)


def state(*, running: bool = True, calibration: str = "bench", sphere: bool = False) -> Any:
    camera = SimpleNamespace(running=running, lost=False, choice=SimpleNamespace(is_sphere=sphere))
    roles = ("target", "ball" if sphere else "plain", "untouched")
    return SimpleNamespace(camera=camera, target=3, role="target", roles=roles, calibration=calibration)


def saved(*roles: str, estimated: timedelta | None = None) -> SavedTarget:
    presses = tuple(SimpleNamespace(taken=WHEN) for _ in roles)
    estimates = () if estimated is None else (SimpleNamespace(made=WHEN + estimated),)
    return SavedTarget(
        number=3,
        target=cast("Any", SimpleNamespace()) if roles else None,
        count=len(roles),
        presses=cast("Any", presses),
        estimates=cast("Any", estimates),
        roles=frozenset(roles),
    )


@pytest.mark.parametrize(
    ("present", "stored", "requested"),
    [
        (state(running=False), saved(), "camera"),
        (state(calibration=""), saved(), "calibration"),
        (state(), saved(), "reference"),
        (state(), saved("target"), "reference"),
        (state(), saved("plain"), "presses"),
        (state(sphere=True), saved("plain"), "presses"),
        (state(sphere=True), saved("ball"), "presses"),
        (state(sphere=True), saved("target"), "estimate"),
        (state(), saved("plain", "target"), "estimate"),
        (state(), saved("plain", "target", estimated=timedelta(seconds=-1)), "estimate"),  # a press came after it
        (state(), saved("plain", "target", estimated=timedelta(seconds=1)), "report"),
    ],
)
def test_the_next_step_is_the_first_that_is_not_done(present: Any, stored: SavedTarget, requested: str) -> None:
    steps = work_steps(present, stored)
    step = next_step(steps)
    assert step.name == requested
    assert step.cure
    names = ["camera", "calibration", "target", "reference", "presses", "estimate", "report"]
    assert [item.name for item in steps] == [
        name for name in names if name != "reference" or not present.camera.choice.is_sphere
    ]


@pytest.mark.slow
def test_a_first_start_says_what_this_is_and_leads_on(lit: Instrument) -> None:
    async def script(operator: Operator) -> None:
        await operator.sees("What this is", "Try the virtual probe", "Connect a camera", "Open my images")
        await operator.sees("Next: Start the camera.")
        await operator.clicks("Start")
        await operator.misses("Try the virtual probe")
        await operator.sees("Next: Calibrate the probe")

    at_console(lit, script)


@pytest.mark.slow
def test_help_has_the_page_s_keys_fields_and_terms(lit: Instrument) -> None:
    async def script(operator: Operator) -> None:
        await operator.clicks("Help")
        await operator.sees("Help: Examine", "save a snapshot", "Number of the target that snapshots go to", "Terms")
        await operator.clicks("Close")
        await operator.misses("Help: Examine")

    at_console(lit, script)
