"""The page Design, in a real browser: what is typed is judged and drawn; the answer is the library's."""

from __future__ import annotations

import io
import json
import re
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import expect
from tests.console.accessible import faults, too_wide
from tests.console.browser import needs_browser, picture
from tests.console.contrast import texts
from tests.console.operator import go_to, tab

from tsis.catalog.probes import load_probe, parse_probe
from tsis.virtual.planned_probe import DesignQuestion, analyse_designs, compared_designs

if TYPE_CHECKING:
    from collections.abc import Iterator

    from playwright.sync_api import Browser, Page
    from tests.console.running import RunningConsole

pytestmark = [pytest.mark.system, needs_browser]


@pytest.fixture
def page(console: RunningConsole, browser: Browser) -> Iterator[Page]:
    with tab(browser, console) as opened:
        go_to(opened, "Design")
        opened.get_by_role("img", name="Section of the probe").wait_for()
        yield opened


def _choose(page: Page, probe: str) -> None:
    page.get_by_label("Start from").click()
    page.get_by_role("option", name=probe, exact=True).click()


def _section(page: Page, text: str) -> None:
    page.get_by_role("img", name=text).wait_for()


def _said(page: Page, message: str) -> None:
    """Wait until something is said of the fields; the side view may say it of the whole probe too."""
    page.get_by_role("status").get_by_text(message).first.wait_for()


def test_what_is_typed_is_drawn_and_what_is_wrong_is_said_beside_it(page: Page) -> None:
    _section(page, "2 mm of 140 kPa, 3 mm of 80 kPa, 5 mm of 34 kPa, glass; 4 lamps")
    middle = page.get_by_role("textbox", name="Layer 2, modulus")
    middle.fill("60")
    _section(page, "3 mm of 60 kPa")
    for wrong, reported in (
        ("-3", "modulus must be"),
        ("soft", "modulus must be a number"),
        ("", "modulus must be a number"),
    ):
        middle.fill(wrong)
        _said(page, f"Layer 2: {reported}")
        page.wait_for_function("document.querySelector('[aria-label=\"Layer 2, modulus\"]').ariaInvalid === 'true'")
        _said(page, "Not drawn while a field is invalid.")
        expect(page.get_by_role("status").get_by_text(reported)).to_have_count(1)
    picture(page, "design-wrong")
    assert faults(page) == []
    assert [item for item in texts(page) if item.contrast < item.least] == []
    _section(page, "3 mm of 60 kPa")  # the last that could be drawn
    page.get_by_role("button", name="Predict performance").click()
    page.get_by_role("alert").get_by_text("modulus must be a number").wait_for()
    middle.fill("70")
    _section(page, "3 mm of 70 kPa")

    page.get_by_role("textbox", name="Radius of the dome / mm").fill("11")
    _said(page, "radius of the dome must be 12")
    page.get_by_role("switch", name="Domed").click()
    _section(page, "flat; from")
    page.get_by_role("textbox", name="Height / mm").fill("99")
    _said(page, "height of a lamp must be 0–13")
    page.get_by_role("textbox", name="Height / mm").fill("4")
    page.get_by_role("textbox", name="How many").fill("6")
    _section(page, "6 lamps")


def test_a_drawing_follows_light_and_dark(page: Page) -> None:
    drawn = page.get_by_role("img", name=re.compile("glass; 4 lamps"))
    drawn.wait_for()
    corners = {}
    for scheme in ("light", "dark", "light"):
        page.emulate_media(color_scheme=scheme)
        page.wait_for_function("dark => document.body.classList.contains('body--dark') === dark", arg=scheme == "dark")
        pixels = np.asarray(Image.open(io.BytesIO(drawn.screenshot())).convert("L"))
        corners[scheme] = pixels[2, 2]
        strongest = np.abs(pixels.astype(int) - pixels[2, 2]).max()
        assert strongest > 130, scheme  # lines and text stand out of the ground
    assert corners["light"] > 230
    assert corners["dark"] < 50


@pytest.mark.slow
def test_layers_are_added_moved_and_taken_out(page: Page) -> None:
    page.get_by_role("button", name="Add a layer at the glass").click()
    _section(page, "5 mm of 34 kPa, 2 mm of 50 kPa, glass")
    page.get_by_role("button", name="Move layer 4 to the tissue").click()
    _section(page, "2 mm of 50 kPa, 5 mm of 34 kPa, glass")
    page.get_by_role("button", name="Move layer 1 to the glass").click()
    _section(page, "up 3 mm of 80 kPa, 2 mm of 140 kPa")
    for left in ("up 2 mm of 140 kPa, 2 mm of 50", "up 2 mm of 50 kPa, 5 mm", "up 5 mm of 34 kPa, glass"):
        page.get_by_role("button", name="Take layer 1 out").click()
        _section(page, left)
    expect(page.get_by_role("button", name="Take layer 1 out")).to_be_disabled()


def test_the_answer_is_that_of_the_library_and_is_kept_for_the_tab(page: Page, console: RunningConsole) -> None:
    _choose(page, "tsis-2011")
    page.get_by_label("Forces / N").fill("0,8")  # a comma parts forces
    _said(page, "force must be")
    page.get_by_label("Forces / N").fill("0.8")
    page.get_by_role("status").get_by_text("force must be").first.wait_for(state="hidden")
    for aspect in ("other forces", "more frames of each press"):
        page.get_by_role("checkbox", name=aspect).click()
        page.get_by_role("checkbox", name=aspect, checked=False).wait_for()
    page.get_by_role("button", name="Predict performance").click()
    table = page.get_by_role("table").filter(has_text="as planned")
    table.wait_for()
    page.get_by_role("button", name="Jobs", exact=True).wait_for()
    page.wait_for_function("document.querySelector('.design-answer').getBoundingClientRect().top < 200")

    question = DesignQuestion(probe=load_probe("tsis-2011"), forces_n=(0.8,), compared=("reference",))
    answer = analyse_designs(question, compared_designs(question))
    rows = table.locator("tbody tr").all()
    assert [row.locator("td").first.inner_text() for row in rows] == [one.protocol.name for one in answer.designs]
    shown = float(rows[0].locator("td").nth(2).inner_text())
    assert shown == pytest.approx(answer.best.information.rmse["depth_mm"], abs=0.005)
    assert faults(page) == []
    assert too_wide(page) == []
    assert [item for item in texts(page) if item.contrast < item.least] == []
    picture(page, "design-answer")

    with page.expect_download() as saved:
        page.get_by_role("button", name="Save the result").click()
    document = json.loads(Path(saved.value.path()).read_text())
    assert document["notice"].startswith("Research use only")
    assert [one["name"] for one in document["designs"]] == [one.protocol.name for one in answer.designs]

    page.goto(f"{console.address}/about")
    page.get_by_role("navigation").get_by_role("link", name="Design").click()
    table.wait_for()
    expect(page.get_by_label("Forces / N")).to_have_value("0.8")


@pytest.mark.slow
def test_a_saved_probe_is_the_one_that_was_typed(page: Page) -> None:
    page.get_by_role("textbox", name="Layer 3, thickness").fill("6.5")
    _section(page, "6.5 mm of 34 kPa")
    with page.expect_download() as saved:
        page.get_by_role("button", name="Save the probe").click()
    assert saved.value.suggested_filename == "tsis-domed-changed.toml"
    ((name, entry),) = tomllib.loads(Path(saved.value.path()).read_text()).items()
    before = load_probe("tsis-domed")
    layers = (*before.layers[:2], replace(before.layers[2], thickness_mm=6.5))
    assert parse_probe(name, entry) == replace(before, layers=layers, name="tsis-domed (changed)")


@pytest.mark.slow
def test_a_search_that_is_ended_leaves_what_was_compared(page: Page) -> None:
    _choose(page, "tsis-2011")
    for aspect in ("other forces", "more frames of each press", "with and without a reference"):
        page.get_by_role("checkbox", name=aspect).click()
    page.get_by_role("switch", name="Search for better").click()
    page.get_by_label("Stacks to try").fill("25")
    page.get_by_role("button", name="Predict performance").click()
    page.get_by_text("1 of 25 solved").wait_for()
    page.get_by_role("button", name="Jobs: ").click()
    page.get_by_role("button", name="Cancel performance of tsis-2011, 1 N").click()  # in the list of jobs
    page.get_by_text("The search was cancelled; these designs were compared before it.").first.wait_for()
    table = page.get_by_role("table").filter(has_text="as planned")
    table.wait_for()
    expect(table.locator("tbody tr")).to_have_count(1)
