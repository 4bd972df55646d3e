"""Hardness in a real browser: an object under the virtual probe, two presses, the modulus with its doubt."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pytest
from playwright.sync_api import expect
from tests.console.browser import needs_browser, picture
from tests.console.contrast import texts
from tests.console.operator import TABLET, operating, requested

from tsis.catalog.phantoms import load_sphere
from tsis.records.store import open_store

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page
    from tests.console.running import RunningConsole

pytestmark = [pytest.mark.system, needs_browser]
SPHERE = "cl2000x"


def refused(page: Page, label: str, value: str, button: str, message: str) -> None:
    """Type something wrong, and have it refused in one sentence; what was there comes back."""
    field = page.get_by_label(label, exact=True)
    before = field.input_value()
    field.fill(value)
    page.get_by_role("button", name=button, exact=True).click()
    page.get_by_role("alert").filter(has_text=message).first.wait_for()
    field.fill(before)


def test_it_says_what_to_begin_with(console: RunningConsole, browser: Browser) -> None:
    with operating(browser, console, "/hardness") as page:
        page.get_by_text("Next: place an object under the virtual probe.").wait_for()
        expect(page.get_by_role("button", name="Estimate", exact=True)).to_be_disabled()
        expect(page.get_by_role("button", name="Snapshot")).to_be_hidden()
        expect(page.locator("main .panel .q-btn--unelevated:not(.q-btn-group *):visible")).to_have_text(
            re.compile("Place it under the probe$")
        )
        picture(page, "hardness-first")
        page.emulate_media(color_scheme="dark")
        page.set_viewport_size({"width": TABLET[0], "height": TABLET[1]})
        picture(page, "hardness-first-tablet-dark")
        assert [item for item in texts(page) if item.contrast < item.least] == []


@pytest.mark.slow
def test_from_an_object_to_its_modulus(console: RunningConsole, browser: Browser) -> None:
    with operating(browser, console, "/hardness") as page:
        page.get_by_role("button", name="Place it under the probe").click()
        page.get_by_text("Next: press the object, and save the press.").wait_for()
        page.get_by_role("button", name="Snapshot").click()
        page.get_by_text("Next: press it again at another force").wait_for()
        page.get_by_role("button", name="Profile").click()  # the tools of every live image
        page.get_by_label(re.compile("^grey level along the line")).wait_for()
        page.get_by_role("button", name="Profile").click()
        page.get_by_role("button", name="Take the presses").click()
        page.get_by_text("Next: estimate").wait_for()
        for wrong, message in (
            ("0", "Radius of the object must be 1–50 mm (you entered 0)."),
            ("-1", "Radius of the object must be 1–50 mm (you entered −1)."),
            ("1000", "Radius of the object must be 1–50 mm (you entered 1000)."),
            ("nan", "radius of the object must be a number"),
            ("three", "Radius of the object must be a number, as 2 or 0.5 (you entered 'three')."),
            ("20", "Radius of the object must be at most 7.2, 0.6 of the face's radius (you entered 20)"),
        ):
            refused(page, "Radius of the object", wrong, "Estimate", message)
        refused(page, "Its standard uncertainty", "2", "Estimate", "Its standard uncertainty must be 0–")
        assert requested(console, "/state")["jobs"] == []
        picture(page, "hardness-pressed")
        page.get_by_role("button", name="Estimate", exact=True).click()
        page.get_by_text("Done. Press again").wait_for()
        page.get_by_role("link", name="Report and export of target 1").wait_for()
        page.get_by_role("cell", name="Shore 00 (converted)").wait_for()
        for text in ("Posterior density of the modulus", "Contact radius over force"):
            page.get_by_role("img", name=text).wait_for()
        picture(page, "hardness-done")
        page.locator(".hardness-result").scroll_into_view_if_needed()
        picture(page, "hardness-result")
        page.emulate_media(color_scheme="dark")
        page.set_viewport_size({"width": TABLET[0], "height": TABLET[1]})
        picture(page, "hardness-result-tablet-dark")
        with open_store(console.store, kind="phantom") as store:
            target_record = store.record(store.target(1))
        (stored,) = target_record.estimates
        assert stored.kind == "hardness"
        assert [press.force_n for press in target_record.presses] == [0.7, 0.7, 1.2]
        assert set(stored.presses) == {press.id for press in target_record.presses[1:]}
        assert stored.options["radius_sd_mm"] == 0.03
        low, high = stored.estimate.interval(0.9)["young_kpa"]
        assert low < load_sphere(SPHERE).young_kpa < high
        shown = page.locator(".hardness-result .number").inner_text()
        assert float(re.sub(r"[^0-9.]", "", shown)) == pytest.approx(stored.estimate.mean["young_kpa"], rel=5e-3)
        page.reload()
        page.get_by_text("Done. Press again").wait_for()
        page.get_by_role("link", name="Report and export of target 1").click()
        page.wait_for_url("**/records/1")
