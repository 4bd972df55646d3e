"""How a console ends: in order, at once, with pages open, by Ctrl-C and by being terminated."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import httpx
import pytest
from tests.console.auth.plain_requests import upgraded
from tests.console.browser import needs_browser
from tests.console.running import running_console
from tests.waiting import HANGS_S

from tsis.console.serving import listen

if TYPE_CHECKING:
    from playwright.sync_api import Browser

pytestmark = [pytest.mark.system, pytest.mark.slow]


@needs_browser
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_it_ends_with_pages_open_and_says_nothing_of_it(
    tmp_path: Path, browser: Browser, number: signal.Signals
) -> None:
    with running_console(tmp_path) as console:
        pages = [browser.new_context().new_page() for _ in range(2)]
        for page in pages:
            page.goto(console.entrance)
            page.get_by_role("navigation", name="Pages").wait_for()
        pages[0].get_by_role("button", name="Release the camera").wait_for()
        pages[0].get_by_role("button", name=re.compile("^Start")).first.click()
        pages[0].get_by_text(re.compile(r"^\d+ frames/s, ")).wait_for()
        console.process.send_signal(number)
        assert console.process.wait(HANGS_S) == 0
        assert (tmp_path / "console.log").read_text() == ""
        assert not (tmp_path / "user" / "console.log").exists()
    for page in pages:
        page.context.close()


def test_a_page_stays_open_when_the_console_is_started_anew(tmp_path: Path) -> None:
    with running_console(tmp_path) as console:
        port = httpx.URL(console.address).port
        with httpx.Client(base_url=console.address, timeout=HANGS_S) as user:
            user.get(f"/?token={console.token}")
            cookies = dict(user.cookies)
        first = console.token
    headers = {"Cookie": "; ".join(f"{name}={value}" for name, value in cookies.items())}
    with running_console(tmp_path, "--port", str(port)) as console:
        assert console.token == first
        assert httpx.get(console.address + "/records", headers=headers, timeout=HANGS_S).status_code == 200
        assert upgraded(console.address, "/live", headers) == 101
    with running_console(tmp_path, "--port", str(port), "--new-token") as console:
        assert console.token != first
        assert httpx.get(console.address + "/records", headers=headers, timeout=HANGS_S).status_code == 401
        assert httpx.get(f"{console.address}/?token={first}", timeout=HANGS_S).status_code == 401


def test_a_port_that_is_taken_is_one_sentence(tmp_path: Path) -> None:
    with listen("127.0.0.1", 0) as other:
        port = other.getsockname()[1]
        second = subprocess.run(
            [str(Path(sys.executable).with_name("tsis")), "console", "--no-browser", "--port", str(port)],
            capture_output=True,
            text=True,
            cwd=tmp_path,
            env={**os.environ, "TSIS_CONSOLE_DIR": str(tmp_path / "user")},
            check=False,
        )
    assert second.returncode == 2
    assert second.stderr.startswith(f"Error: port {port} of 127.0.0.1 must be free; got: ")
    assert second.stderr.count("\n") == 1
    assert not (tmp_path / "tsis-console").exists()


def test_what_is_printed_for_programs_is_one_document(tmp_path: Path) -> None:
    with running_console(tmp_path) as console:
        assert console.address.startswith("http://127.0.0.1:")
        assert len(console.token) == 43
        console.process.send_signal(signal.SIGINT)
        rest, _ = console.process.communicate()
    assert rest == ""
