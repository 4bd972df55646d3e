"""From no hardware to a saved report, in a real browser."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from tests.console.browser import needs_browser, picture
from tests.console.first_report import FORCES, ROLES, first_report
from tests.console.operator import tab
from tests.console.running import running_console
from tests.present.pdf_readers import poppler

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.records.store import open_store

if TYPE_CHECKING:
    from pathlib import Path

    from playwright.sync_api import Browser

SURE = 4.0  # standard deviations, which chance passes in one run of ten thousand
pytestmark = [pytest.mark.system, needs_browser]


def test_no_hardware_to_a_saved_report(tmp_path: Path, browser: Browser) -> None:
    with running_console(tmp_path) as console:
        with tab(browser, console) as page:
            saved = first_report(page, tmp_path)
            picture(page, "first-report")
        store = console.store
    assert saved.read_bytes().startswith(b"%PDF-")
    text = " ".join(poppler("pdftotext", saved, "-").split())
    for label in ("Diameter d", "Depth h", "Modulus E", "truth 10 mm", RESEARCH_USE_ONLY):
        assert label in text
    with open_store(store) as remaining:
        target_record = remaining.record(remaining.target(1))
    assert len(target_record.presses) == len(ROLES) * len(FORCES)
    (stored,) = target_record.estimates
    error = stored.estimate.mean["diameter_mm"] - target_record.target.truth["diameter_mm"]
    assert abs(error) < SURE * stored.estimate.sd["diameter_mm"]
