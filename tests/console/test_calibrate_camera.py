"""Calibrate before a real GigE Vision camera: frames at a click, forces typed one after the other, the camera lost."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from playwright.sync_api import expect
from tests.console.browser import needs_browser, picture
from tests.console.operator import operating, run
from tests.console.running import running_console
from tests.system.aravis_peer import LOOPBACK, fake_camera, loopback_camera_port

from tsis.calibration.session import SessionFolder

if TYPE_CHECKING:
    from pathlib import Path

    from playwright.sync_api import Browser

pytestmark = [pytest.mark.system, pytest.mark.slow, needs_browser]


def test_forces_are_typed_and_a_lost_camera_costs_one_step(tmp_path: Path, browser: Browser) -> None:
    with (
        loopback_camera_port(),
        fake_camera("GUIDED") as camera,
        running_console(tmp_path, "--camera", f"aravis:{LOOPBACK}") as console,
        operating(browser, console) as page,
    ):
        run(page)
        page.get_by_role("link", name="Calibrate").click()
        page.get_by_label("Name", exact=True).fill("real")
        page.get_by_label("Lamps seen past the probe").fill("9, 9, 3, 3")
        page.get_by_role("button", name="Begin", exact=True).click()
        page.get_by_role("alert").filter(has_text="lamps seen past the probe must be left < right").wait_for()
        page.get_by_label("Lamps seen past the probe").fill("")
        page.get_by_role("button", name="Begin", exact=True).click()
        page.get_by_role("button", name="Take 16 frames").click()
        page.get_by_text("Step 2 of 11: untouched").wait_for()
        page.get_by_role("button", name="Step tip-2mm-1:").click()
        field = page.get_by_label("Force that the gauge shows")
        for force, message in (("0", "1 frames"), ("0,5", "2 frames"), ("7", "3 frames")):
            field.fill(force)
            field.press("Enter")
            page.get_by_text(message, exact=True).wait_for()
            expect(field).to_have_value("")
        field.fill("soft")
        page.get_by_role("button", name="Take a frame").click()
        page.get_by_role("alert").filter(has_text="Force must be a number, as 2 or 0.5 (you").wait_for()
        page.get_by_role("button", name="Remove the last").click()
        page.get_by_text("2 frames", exact=True).wait_for()
        picture(page, "calibrate-typed-forces")
        page.reload()
        page.get_by_role("button", name="Step tip-2mm-1: 2 forces, not saved").click()
        page.get_by_text("2 frames", exact=True).wait_for()
        page.get_by_role("button", name="Back at 0 N: save the loading").click()
        page.get_by_role("button", name="Step tip-2mm-1: 2 frames").wait_for()
        camera.kill()
        page.get_by_text("Reconnecting; saved data are safe.").wait_for()
        page.get_by_role("button", name="Step untouched: open").click()
        page.get_by_role("button", name="Take 16 frames").click()
        page.get_by_role("alert").filter(has_text="is away (wait until it is back)").first.wait_for()
        picture(page, "calibrate-camera-lost")
    session = SessionFolder(tmp_path / "workspace" / "calibrations" / "real")
    done = {step.name: session.count(step) for step in session.plan() if session.done(step)}
    assert done == {"dark": 16, "tip-2mm-1": 2}
    (loading,) = (step for step in session.plan() if step.name == "tip-2mm-1")
    assert [shot.force_n for shot in session.shots(loading)] == [0.0, 0.5]
    assert session.setup().camera
    assert session.setup().began is not None
