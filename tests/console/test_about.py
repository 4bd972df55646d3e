"""The page About: what it says is so."""

from __future__ import annotations

import json
import platform
import re
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
import yaml
from playwright.sync_api import expect
from tests.console.browser import needs_browser, picture
from tests.console.operator import tab

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.console.pages.about import CITATION, LICENCE, licence

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page
    from tests.console.running import RunningConsole

ROOT = Path(__file__).parents[2]


def test_it_is_cited_as_the_citation_file_says() -> None:
    reported: dict[str, Any] = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    program, thesis = CITATION
    (reference,) = reported["references"]
    for part in (reported["title"], reported["version"], reported["authors"][0]["name"]):
        assert part in program
    for part in (reference["title"], reference["institution"]["name"], str(reference["year"]), "Lee"):
        assert part in thesis
    assert reported["license"] == LICENCE
    assert licence() == (ROOT / "LICENSE").read_text(encoding="utf-8")


@pytest.mark.system
@needs_browser
def test_the_page_says_what_is_so(console: RunningConsole, browser: Browser) -> None:
    with tab(browser, console, "/about") as page:
        _says_what_is_so(page, console)


def _says_what_is_so(page: Page, console: RunningConsole) -> None:
    def fact(term: str) -> str:
        named = page.locator("dt").filter(has_text=re.compile(f"^{term}$"))
        return named.first.locator("xpath=following-sibling::dd[1]").inner_text()

    page.get_by_text(str(console.store)).wait_for()
    expect(page.get_by_text(RESEARCH_USE_ONLY)).to_have_count(2)
    assert fact("Snapshots and sequences") == str(console.workspace)
    assert fact("numpy") == metadata.version("numpy")
    assert fact("Python").startswith(platform.python_version())
    assert fact("Seed of the errors") == "4"
    assert (fact("Targets"), fact("Presses")) == ("0", "0")
    page.get_by_role("button", name="Read the licence").click()
    page.get_by_text("Redistribution and use in source and binary forms").wait_for()
    picture(page, "about")
    address = page.get_by_role("link", name="API description (OpenAPI)").get_attribute("href")
    described = page.context.request.get(f"{console.address}{address}")
    assert described.ok
    assert json.loads(described.text())["openapi"].startswith("3.")
