"""The page Select camera: the virtual probe and what it presses, a search, and the calibration in force."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from playwright.sync_api import expect
from tests.console.browser import needs_browser, picture
from tests.console.contrast import texts
from tests.console.operator import operating, press_with, requested, run

from tsis.calibration.file import ProbeCalibration, write_calibration
from tsis.catalog.phantoms import load_phantom
from tsis.catalog.probes import load_probe
from tsis.virtual.probe import VirtualProbe

if TYPE_CHECKING:
    from pathlib import Path

    from playwright.sync_api import Browser, Page
    from tests.console.running import RunningConsole

pytestmark = [pytest.mark.system, pytest.mark.slow, needs_browser]


@pytest.fixture(scope="module")
def calibration(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """That of the virtual probe under a name of its own."""
    probe = load_probe("tsis-domed")
    response = VirtualProbe(probe, rng=np.random.default_rng(0), strain="small").calibration
    calibration_with = ProbeCalibration(
        name="of a Monday", probe=probe.name, response=replace(response, name="of a Monday")
    )
    file = tmp_path_factory.mktemp("calibration") / "monday.json"
    write_calibration(calibration_with, file)
    return file


def _choose(page: Page, label: str, name: str) -> None:
    page.get_by_label(label, exact=True).click()
    page.get_by_role("option", name=name).first.click()


def test_another_phantom_with_another_inclusion(console: RunningConsole, browser: Browser) -> None:
    with operating(browser, console, "/camera") as page:
        _choose(page, "Pressed object", "size-8")
        page.get_by_label("Depth").fill("6")
        page.get_by_label("Seed").fill("11")
        page.get_by_role("button", name="Apply").click()
        page.get_by_text("virtual probe on size-8").first.wait_for()
        page.get_by_text("runs at").wait_for()
        picture(page, "camera-virtual")
        choice = requested(console, "/state")["camera"]["choice"]
        assert (choice["phantom"], choice["depth_mm"], choice["seed"]) == ("size-8", 6.0, 11)
        page.get_by_role("navigation").get_by_role("link", name="Examine").click()
        page.get_by_role("button", name="Snapshot").click()
        page.get_by_text("Saved for target 1").wait_for()
        truth = requested(console, "/targets/1")["target"]["truth"]
        lump = load_phantom("size-8").inclusion
        assert lump is not None
        assert truth == {"diameter_mm": lump.diameter_mm, "depth_mm": 6.0, "young_kpa": lump.young_kpa}


def test_a_sphere_is_for_hardness(console: RunningConsole, browser: Browser) -> None:
    with operating(browser, console, "/camera") as page:
        _choose(page, "Pressed object", "cl2003x")
        expect(page.get_by_label("Depth")).not_to_be_visible()
        page.get_by_role("button", name="Apply").click()
        page.get_by_text("virtual probe on cl2003x").wait_for()  # its mechanics are solved with the seed of before
        page.get_by_text("runs at").wait_for()
        assert requested(console, "/state")["roles"] == ["target", "ball", "untouched"]
        page.get_by_role("navigation").get_by_role("link", name="Examine").click()
        page.get_by_role("button", name="on a known ball").wait_for()
        page.get_by_role("link", name="Hardness of this object").wait_for()


@pytest.mark.parametrize(
    ("label", "typed", "message"),
    [
        ("Depth", "deep", "Depth must be a number, as 2 or 0.5 (you entered 'deep')."),
        ("Depth", "500", "Depth must be 0.2–200 mm from the skin to the inclusion's top (you entered 500)."),
        ("Diameter", "-1", "Diameter must be 0.1–100 mm (you entered −1)."),
        ("Modulus", "1e999", "Modulus must be 0.1–1e+06 kPa (what you entered is too large)."),
        ("Seed", "4.5", "Seed must be a whole number (you entered 4.5)."),
        ("Seed", "", "Seed must be a number, as 2 or 0.5 (nothing was entered)."),
    ],
)
def test_values_that_no_phantom_has(
    console: RunningConsole, browser: Browser, label: str, typed: str, message: str
) -> None:
    before = requested(console, "/state")["camera"]["choice"]
    with operating(browser, console, "/camera") as page:
        _choose(page, "Pressed object", "size-14")
        page.get_by_label(label).fill(typed)
        page.get_by_role("button", name="Apply").click()
        field = page.locator(".q-field", has=page.get_by_label(label))
        field.get_by_role("alert").get_by_text(message).wait_for()
        expect(page.get_by_label(label)).to_be_focused()  # to be corrected
        expect(page.get_by_label(label)).to_have_value(typed)
        assert page.locator(".q-notification").count() == 0
        page.get_by_label(label).fill("1")
        field.get_by_role("alert").wait_for(state="hidden")
    assert requested(console, "/state")["camera"]["choice"] == before


def test_a_search_says_what_answered_and_what_is_missing(console: RunningConsole, browser: Browser) -> None:
    with operating(browser, console, "/camera") as page:
        page.get_by_role("button", name="Search").click()
        page.get_by_text("answered.").wait_for()
        page.get_by_text("sources could not be searched").click()
        page.get_by_text("the camera source genicam needs").wait_for()
        picture(page, "camera-search")


def test_a_calibration_is_put_in_force_and_taken_back(
    console: RunningConsole, browser: Browser, calibration: Path
) -> None:
    with operating(browser, console, "/camera") as page:
        _choose(page, "Pressed object", "hardness-100")  # the probe may still be held on a sphere by the test before
        page.get_by_role("button", name="Apply").click()
        page.get_by_text("virtual probe on hardness-100").wait_for()
        page.locator("input[type=file]").set_input_files(calibration)
        page.get_by_text("The calibration of a Monday is active.").wait_for()
        assert requested(console, "/state")["calibration"] == "of a Monday"
        page.get_by_role("button", name="Use the virtual probe's own").click()
        page.get_by_text("of a Monday", exact=True).wait_for(state="detached")
        assert requested(console, "/state")["calibration"] != "of a Monday"


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_every_text_stands_out_that_of_the_calibration_file_too(
    console: RunningConsole, browser: Browser, scheme: str
) -> None:
    with operating(browser, console, "/camera", color_scheme=scheme) as page:
        page.get_by_text("Calibration file").wait_for()
        shown = texts(page)
        assert "Calibration file" in {item.text for item in shown}
        assert [item for item in shown if item.contrast < item.least] == []


@pytest.mark.parametrize("damage", ["changed", "cut", "empty", "other", "zip"])
def test_a_calibration_that_is_none_is_one_sentence(
    console: RunningConsole, browser: Browser, calibration: Path, tmp_path: Path, damage: str
) -> None:
    content = calibration.read_bytes()
    created = {
        "changed": content.replace(b"of a Monday", b"of a Sunday", 1),
        "cut": content[: len(content) // 2],
        "empty": b"",
        "other": b'{"format": "something else"}',
        "zip": b"PK\x03\x04" + b"\0" * 100,
    }[damage]
    file = tmp_path / "hostile.json"
    file.write_bytes(created)
    before = requested(console, "/state")["calibration"]
    with operating(browser, console, "/camera") as page:
        page.locator("input[type=file]").set_input_files(file)
        alert = page.get_by_role("alert").filter(has_text="hostile.json")
        alert.wait_for()
        assert "Traceback" not in alert.inner_text()
    assert requested(console, "/state")["calibration"] == before


def test_examine_goes_on_after_another_choice(console: RunningConsole, browser: Browser) -> None:
    with operating(browser, console, "/camera") as page:
        _choose(page, "Pressed object", "hardness-100")
        page.get_by_role("button", name="Apply").click()
        page.get_by_text("virtual probe on hardness-100").first.wait_for()
        page.get_by_role("navigation").get_by_role("link", name="Examine").click()
        run(page)
        press_with(page, "0.6")
