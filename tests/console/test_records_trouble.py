"""Stores that are empty, of subjects, damaged, or only to be read: the rest is shown, and what is wrong is said."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from contextlib import contextmanager
from typing import TYPE_CHECKING

import pytest
from playwright.sync_api import expect
from tests.console.accessible import faults
from tests.console.browser import needs_browser, picture
from tests.console.contrast import texts
from tests.console.filled_store import ESTIMATED, fill, still
from tests.console.operator import tab
from tests.console.running import running_console
from tests.records.sample import sample_record

from tsis.records.store import open_store

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from playwright.sync_api import Browser

pytestmark = [pytest.mark.system, pytest.mark.slow, needs_browser]
needs_mounts = pytest.mark.skipif(
    shutil.which("mount") is None or os.geteuid() != 0, reason="needs mount, and root to use it"
)
REFUSED = "503"  # of a file that cannot be had, which the browser writes down


def damage(file: Path) -> None:
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(bytes(content))


def test_an_empty_store_says_how_to_begin(browser: Browser, tmp_path: Path) -> None:
    with running_console(tmp_path) as console, tab(browser, console, "/records") as page:
        page.get_by_text("Nothing is saved yet.").wait_for()
        assert faults(page) == []
        picture(page, "records-empty")
        with open_store(console.store) as store:
            store.import_target(sample_record())
        page.get_by_role("link", name="size-10").wait_for()
        with open_store(console.store) as store:
            for number in range(100, 160):
                store.add_target(number=number, name=f"target {number}")
        page.get_by_text("1-50 of 61").wait_for()
        page.get_by_role("button", name="Next page").click()
        page.get_by_text("51-61 of 61").wait_for()
        expect(page.locator(".targets tbody tr")).to_have_count(11)
        assert page.locator(".targets tbody tr").first.inner_text().startswith("149\t")
        picture(page, "records-second-sheet")
        page.get_by_role("combobox", name="Show").click()
        page.get_by_role("option", name="not estimated").click()
        page.get_by_text("1-50 of 60").wait_for()


def test_what_is_damaged_is_said_and_hides_nothing_else(browser: Browser, tmp_path: Path) -> None:
    fill(tmp_path / "records")
    with open_store(tmp_path / "records") as store:
        target = store.target(ESTIMATED)
        target_record = store.record(target)
        damage(store.blobs.path(target_record.presses[0].frame, "png"))
    with running_console(tmp_path) as console:
        with tab(browser, console, f"/records/{ESTIMATED}", expected=REFUSED) as page:
            page.get_by_text("This frame cannot be shown").wait_for()
            page.locator(".card", has_text="Diameter").wait_for()
            expect(page.locator(".press")).to_have_count(4)
            picture(page, "records-damaged")
            page.get_by_role("button", name=re.compile("^Open the press on the target, 0.7 N")).click()
            page.get_by_text("must be as it was stored; its content does not match its name").wait_for()
            page.get_by_role("dialog").get_by_role("button", name="Close").click()
            page.get_by_role("dialog").wait_for(state="hidden")
            page.get_by_role("checkbox", name=re.compile("on the target, 0.7 N")).click()
            page.get_by_role("checkbox", name=re.compile("on the target, 1 N")).click()
            page.get_by_role("button", name="Compare presses (2 chosen)").click()
            page.locator(".q-notification").get_by_text("must be as it was stored").wait_for()
            still(page)
            assert [item for item in texts(page) if item.contrast < item.least] == []
            page.reload()
            page.get_by_role("button", name="Export").click()
            page.get_by_role("dialog").get_by_role("button", name="Export").click()
            page.locator(".q-notification").get_by_text("must be as it was stored").wait_for()
            page.get_by_role("dialog").get_by_role("button", name="Cancel").click()
            page.get_by_role("button", name="Repeat the estimates").click()
            page.get_by_role("dialog").get_by_role("button", name="Repeat").click()
            page.get_by_role("alert").get_by_text("must be as it was stored").last.wait_for()
        with tab(browser, console, "/records") as page:
            page.get_by_role("button", name="Verify the store").click()
            page.get_by_text("NOT as it was stored: 1 fault:").wait_for()
            picture(page, "records-not-as-stored")


def test_of_a_subject_the_pseudonym_alone_is_shown(browser: Browser, tmp_path: Path) -> None:
    with open_store(tmp_path / "records", kind="subject") as store:
        store.import_target(sample_record(kind="subject"))
        target = store.edit_target(store.target(3), note="Jane Doe, room 7")
        store.edit_press(store.press(target, "press-0"), note="Jane's left", flags=("Jane Doe",))
    with (
        running_console(tmp_path, "--kind", "subject") as console,
        tab(browser, console, "/records/3") as page,
    ):
        page.get_by_text("Subject, target 3: size-10").wait_for()
        page.get_by_text("a flag unknown to tsis").wait_for()
        page.get_by_text("the page shows only the pseudonym").wait_for()
        assert "Jane" not in page.content()
        picture(page, "records-subject")
        page.get_by_role("button", name="Edit").click()
        page.get_by_text("A pseudonym, never a name.").wait_for()
        expect(page.get_by_role("dialog").get_by_label("Note")).to_have_value("Jane Doe, room 7")
        assert page.get_by_label(re.compile("^True values")).is_hidden()


@contextmanager
def only_to_be_read(folder: Path) -> Iterator[None]:
    """A folder mounted over itself so that nothing can be written there."""
    subprocess.run(["mount", "--bind", folder, folder], check=True)
    try:
        subprocess.run(["mount", "-o", "remount,ro,bind", folder], check=True)
        yield
    finally:
        subprocess.run(["umount", folder], check=True)


@needs_mounts
def test_a_store_that_can_only_be_read_is_shown_and_refuses_changes(browser: Browser, tmp_path: Path) -> None:
    fill(tmp_path / "records")
    with only_to_be_read(tmp_path / "records"), running_console(tmp_path) as console:
        with tab(browser, console, f"/records/{ESTIMATED}") as page:
            page.get_by_text("Target 3: size-10").wait_for()
            page.get_by_role("button", name="Edit").click()
            page.get_by_role("dialog").get_by_label("Name").fill("another")
            page.get_by_role("dialog").get_by_role("button", name="Save", exact=True).click()
            page.get_by_text("to be added to").wait_for()
            expect(page.get_by_role("dialog").get_by_label("Name")).to_have_value("another")
        with open_store(console.store) as store:
            assert store.target(ESTIMATED).name == "size-10"
