"""From no hardware to a saved report, as somebody does it who opens the console for the first time."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tests.console.operator import hold, press_with, run

if TYPE_CHECKING:
    from pathlib import Path

    from playwright.sync_api import Page

FORCES = ("0.5", "1")
ROLES = ("on the target", "reference (no inclusion)")


def first_report(page: Page, folder: Path) -> Path:
    """Press the virtual probe, estimate, and save the report of target 1; where the PDF was saved."""
    hold(page)
    run(page)
    for role in ROLES:
        page.get_by_role("button", name=role).click()
        for force in FORCES:
            press_with(page, force)
            page.get_by_role("button", name="Snapshot").click()
            page.get_by_text(f"Saved for target 1: {role}, {force} N").wait_for()
    page.get_by_role("button", name="Estimate").click()
    page.get_by_text("Diameter d", exact=True).wait_for()
    with page.expect_download() as download:
        page.get_by_role("button", name="Report", exact=True).click()
    saved = folder / "report.pdf"
    download.value.save_as(saved)
    return saved
