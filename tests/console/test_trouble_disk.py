"""A disk that fills under the page: a small file system of its own, in which the console keeps everything."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from playwright.sync_api import expect
from tests.console.browser import needs_browser, picture
from tests.console.operator import hold, requested, run, tab
from tests.console.running import running_console

if TYPE_CHECKING:
    from playwright.sync_api import Browser

pytestmark = [pytest.mark.system, pytest.mark.slow, needs_browser]
SIZE, SPARE = "24m", 150_000  # bytes, fewer than a frame has
MOUNTED = 'mount -t tmpfs -o size=$0 tmpfs "$1" && shift && exec "$@"'


def _may_mount() -> bool:
    """Whether this user may mount a file system where nobody else sees it."""
    if not shutil.which("unshare"):
        return False
    command = ["unshare", "-m", "sh", "-c", "mount -t tmpfs -o size=64k tmpfs /mnt"]
    return subprocess.run(command, capture_output=True, check=False).returncode == 0


def _fill(disk: Path) -> Path:
    """Leave less room than a frame needs."""
    room = os.statvfs(disk)
    ballast = disk / "ballast"
    with ballast.open("wb") as file:
        file.write(bytes(room.f_bavail * room.f_frsize - SPARE))
    return ballast


@pytest.mark.skipif(not _may_mount(), reason="only root may mount a small file system")
def test_a_full_disk_is_one_sentence_and_nothing_is_lost(tmp_path: Path, browser: Browser) -> None:
    under = ["unshare", "-m", "sh", "-c", MOUNTED, SIZE, str(tmp_path)]
    with running_console(tmp_path, under=under) as console, tab(browser, console) as page:
        disk = Path(f"/proc/{console.process.pid}/root{tmp_path}")  # as the console sees it
        hold(page)
        run(page)
        page.get_by_role("button", name="Snapshot").click()
        page.get_by_text("1 press", exact=True).wait_for()
        remaining = {file: file.read_bytes() for file in disk.glob("workspace/Target1/*")}
        assert remaining
        ballast = _fill(disk)
        page.get_by_role("button", name="Snapshot").click()
        alert = page.get_by_role("alert").filter(has_text="No space left on device")
        alert.wait_for()
        assert "Traceback" not in alert.inner_text()
        picture(page, "trouble-disk-full")
        before = requested(console, "/state")["camera"]["received"]
        expect(page.get_by_text("frames/s shown")).not_to_have_text("0 frames/s shown")
        ballast.unlink()
        page.get_by_role("button", name="Snapshot").click()
        page.get_by_text("2 presses").wait_for()
        assert requested(console, "/state")["camera"]["received"] > before
        assert {file: file.read_bytes() for file in remaining} == remaining
        assert not [file for file in disk.rglob("*") if file.is_file() and file.stat().st_size == 0]
        presses = requested(console, "/targets/1/presses")["presses"]
        assert len({press["frame"] for press in presses}) == 2
