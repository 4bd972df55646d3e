"""Calibrate in a real browser: the virtual rig step by step, a server that goes away, terms that are none."""

from __future__ import annotations

import hashlib
import json
import re
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from benchmarks.calibration_force import PROBE, SENSOR
from playwright.sync_api import expect
from tests.console.browser import needs_browser, picture
from tests.console.contrast import texts
from tests.console.operator import TABLET, hold, operating, requested, run, tab
from tests.console.running import running_console

from tsis.calibration.file import calibration_sha256, read_calibration
from tsis.calibration.session import SessionFolder, SessionSetup
from tsis.cli import main
from tsis.virtual.calibration_bench import VirtualBench

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page
    from tests.console.running import RunningConsole

pytestmark = [pytest.mark.system, needs_browser]
STEPS = 13  # three tips and two pads
LIVE = "virtual probe on hardness-100"  # the camera of a console that is begun without options


def files(folder: Path) -> dict[str, str]:
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in folder.rglob("*")
        if path.is_file()
    }


def begin(page: Page, name: str, **terms: str) -> None:
    """Begin a session from the page of sessions."""
    for label, value in {"Name": name, **terms}.items():
        page.get_by_label(label, exact=True).fill(value)
    page.get_by_role("button", name="Begin", exact=True).click()


def step(page: Page, name: str) -> None:
    page.get_by_role("button", name=re.compile(f"^Step {name}:")).click()


def all_taken(folder: Path, name: str, camera: str) -> SessionFolder:
    """A session with every step done, of a small camera."""
    virtual = VirtualBench(PROBE, rng=np.random.default_rng(8), sensor=SENSOR, pitch_mm=1.5)
    session = SessionFolder(folder / "calibrations" / name)
    terms = SessionSetup(
        name=f"<b>{name}</b>",
        probe=PROBE.name,
        camera=camera,
        began=datetime.now(UTC).replace(microsecond=0),
        pitch_mm=1.5,
        patch_px=virtual.patch_px,
        tips_mm=(10.0, 14.0),
    )
    session.begin(terms)
    for item in session.plan():
        session.save(item, virtual.shots(item))
    return session


@pytest.mark.slow
def test_terms_that_are_none_are_one_sentence_and_begin_nothing(console: RunningConsole, browser: Browser) -> None:
    wrong = (
        ("Name", " ", "name must be given"),
        ("Pitch of the dot board", "-1", "Pitch of the dot board must be 0.05–50 mm (you entered −1)."),
        (
            "Pitch of the dot board",
            "wide",
            "Pitch of the dot board must be a number, as 2 or 0.5 (you",
        ),
        ("Its standard uncertainty", "nan", "Its standard uncertainty must be a number"),
        ("Radii of the tips", "2, 2", "radii of the tips must hold each tip once"),
        ("Radii of the tips", "2, 1e9", "Radii of the tips must be 0.1–1000 mm"),
        ("Radii of the tips", "14", "a calibration needs at least 2 loadings"),
        ("Radii of the tips", "", "got 0 tip and 1 loading"),
        ("Loadings of each tip", "1.5", "loadings of each tip must be a whole number"),
        ("Relative uncertainty of the gauge", "3", "Relative uncertainty of the gauge must be 0–0.5"),
        ("Seed of the virtual rig", "-4", "Seed must be 0–"),
    )
    with operating(browser, console, "/calibrate") as page:
        for label, value, message in wrong:
            field = page.get_by_label(label, exact=True)
            before = field.input_value()
            field.fill(value)
            page.get_by_role("button", name="Begin", exact=True).click()
            text = page.get_by_role("alert").filter(has_text=message)
            text.first.wait_for()
            field.fill(before)
        page.get_by_text("None yet.").wait_for()
    assert not (console.workspace / "calibrations").exists()


@pytest.mark.slow
def test_a_session_is_begun_interrupted_by_the_server_and_goes_on(tmp_path: Path, browser: Browser) -> None:
    with running_console(tmp_path) as console, operating(browser, console, "/calibrate") as page:
        begin(page, "May <i>left</i>")
        page.get_by_text(f"Step 1 of {STEPS}: dark").wait_for()
        page.get_by_text("Switch the lamps off, or cover the lens.").wait_for()
        page.get_by_role("button", name="Take 16 frames").click()
        page.get_by_text(f"Step 2 of {STEPS}: untouched").wait_for()
        picture(page, "calibrate-second-step")
        step(page, "flat-2")
        page.get_by_role("button", name="Skip this step").click()
        page.get_by_role("button", name="Step flat-2: left out").wait_for()
        step(page, "dark")
        page.get_by_text("Done: 16 frames are saved.").wait_for()
        page.get_by_role("img", name="Frame of step dark").wait_for()
        page.get_by_role("button", name="Repeat this step").click()
        page.get_by_role("button", name="Cancel").click()
        page.get_by_role("button", name="Repeat this step").click()
        page.get_by_role("button", name="Remove and repeat").click()
        page.get_by_role("button", name="Step dark: open").wait_for()
        page.get_by_role("button", name="Take 16 frames").click()
        page.get_by_role("button", name="Step dark: 16 frames").wait_for()
        expect(page.get_by_role("button", name="Make the calibration")).to_be_disabled()
        folder = console.workspace / "calibrations" / "May-i-left-i"
        before = files(folder)
        assert {name.split("/")[0] for name in before} == {"session.json", "dark"}
    with running_console(tmp_path) as console, operating(browser, console, "/calibrate", color_scheme="dark") as page:
        page.get_by_text(f"1 of {STEPS} steps").wait_for()
        picture(page, "calibrate-sessions-dark")
        page.get_by_role("link", name="May <i>left</i>").click()
        page.get_by_role("button", name="Step dark: 16 frames").wait_for()
        page.get_by_role("button", name="Do all open steps").click()
        page.get_by_text("Every step is done or skipped.").wait_for()
        step(page, "board")
        page.get_by_role("img", name="Frame of step board").wait_for()
        page.set_viewport_size({"width": TABLET[0], "height": TABLET[1]})
        picture(page, "calibrate-steps-tablet-dark")
        assert [item for item in texts(page) if item.contrast < item.least] == []
        after = files(folder)
        assert {name: after[name] for name in before} == before
        assert SessionFolder(folder).missing() == ()
        expect(page.get_by_role("button", name="Make the calibration")).to_be_enabled()


@pytest.mark.slow
def test_what_is_made_here_is_what_the_terminal_makes_and_can_be_put_in_force(
    tmp_path: Path, browser: Browser, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    session = all_taken(tmp_path / "workspace", "here", LIVE)
    with running_console(tmp_path, "--probe", PROBE.name) as console, operating(browser, console) as page:
        run(page)
        page.goto(f"{console.address}/calibrate/here")
        days = page.get_by_label("Good for")
        days.fill("0")
        page.get_by_role("button", name="Make the calibration").click()
        page.get_by_role("alert").filter(has_text="Days must be 1–3650 (you entered 0).").wait_for()
        days.fill("30")
        page.get_by_role("button", name="Make the calibration").click()
        page.get_by_role("button", name="Activate").wait_for()
        for words in ("Sums of grey levels", "Departures from the line", "Frame of the board"):
            page.get_by_role("img", name=words).wait_for()
        page.get_by_role("cell", name="force line, slope").wait_for()
        page.get_by_text("<b>here</b>").first.wait_for()  # a name is no markup
        picture(page, "calibrate-made")
        with page.expect_download() as arriving:
            page.get_by_role("button", name="Download the file").click()
        created = Path(arriving.value.path()).read_bytes()
        page.get_by_role("button", name="Activate").click()
        page.get_by_role("alert").filter(
            has_text="is of frames of 256 x 216 pixels; the camera's have 768 x 492"
        ).wait_for()
        page.get_by_role("link", name="Examine").click()
        page.get_by_role("button", name="Stop", exact=True).click()
        page.get_by_role("button", name="Start").wait_for()
        page.get_by_role("link", name="Calibrate").click()
        page.get_by_role("link", name="<b>here</b>").click()
        page.get_by_role("button", name="Activate").click()
        page.get_by_text("It is active.").wait_for()
        active = requested(console, "/state")
        page.locator(".calibrate-figures").scroll_into_view_if_needed()
        picture(page, "calibrate-residuals")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["tsis", "calibrate", "make", str(session.path), "--days", "30", "--json"])
    with pytest.raises(SystemExit):
        main()
    reported = json.loads(capsys.readouterr().out)
    assert created == (session.path / "calibration.json").read_bytes()
    assert created == (tmp_path / "tsis-calibration" / "calibration.json").read_bytes()
    assert calibration_sha256(read_calibration(session.path / "calibration.json")) == reported["sha256"]
    assert active["calibration_identity"] == reported["sha256"]
    with running_console(tmp_path) as console, operating(browser, console, "/calibrate/here") as page:
        page.get_by_text("It was computed before.").wait_for()
        page.get_by_text(f"cited as {reported['sha256'][:12]}").wait_for()
        page.get_by_role("button", name=re.compile("^Step flat-1:")).click()
        page.get_by_role("button", name="Repeat this step").click()
        page.get_by_role("button", name="Remove and repeat").click()
        page.get_by_role("button", name="Activate").wait_for(state="hidden")
        assert (session.path / f"calibration-{reported['sha256'][:12]}.json").read_bytes() == created


def test_damaged_and_unknown_sessions_are_a_sentence(console: RunningConsole, browser: Browser) -> None:
    damaged = console.workspace / "calibrations" / "damaged"
    damaged.mkdir(parents=True)
    (damaged / "session.json").write_text("{")
    with operating(browser, console, "/calibrate") as page:
        page.get_by_text("must be a readable JSON file").wait_for()
        for name in ("nowhere", "damaged"):
            page.goto(f"{console.address}/calibrate/{name}")
            page.get_by_role("link", name="All sessions").wait_for()
        page.get_by_text("must be a readable JSON file").wait_for()


@pytest.mark.slow
def test_who_watches_sees_the_steps_and_cannot_take_them(console: RunningConsole, browser: Browser) -> None:
    with tab(browser, console, "/calibrate") as first, tab(browser, console, "/calibrate") as second:
        hold(first)
        second.get_by_text("controls the camera; you are watching.").wait_for()
        expect(second.get_by_role("button", name="Begin", exact=True)).to_be_disabled()
        begin(first, "watched")
        first.get_by_text(f"Step 1 of {STEPS}: dark").wait_for()
        second.get_by_role("link", name="watched").click()
        second.get_by_text(f"Step 1 of {STEPS}: dark").wait_for()
        expect(second.get_by_role("button", name="Take 16 frames")).to_be_disabled()
        first.get_by_role("button", name="Take 16 frames").click()
        second.get_by_text(f"Step 2 of {STEPS}: untouched").wait_for()
        second.get_by_role("button", name="Step dark: 16 frames").wait_for()
