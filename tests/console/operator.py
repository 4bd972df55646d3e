"""Whoever sits before a page of the console: opens it, holds the camera, and gives it back."""

from __future__ import annotations

import re
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any

import httpx
from playwright.sync_api import Error as BrowserError
from playwright.sync_api import TimeoutError as Late
from tests.console.browser import picture
from tests.waiting import HANGS_S

from tsis.console.pages import GROUPS, PAGES

if TYPE_CHECKING:
    from collections.abc import Iterator

    from playwright.sync_api import Browser, Page
    from tests.console.running import RunningConsole

INSTRUMENT, TABLET = (1280, 800), (1024, 768)
API = "/api/v1"
BY_ITSELF_MS, TRIES = 8_000, 5
TAKE, RELEASE, OVER = "Take the camera", "Release the camera", "Take over"


# NiceGUI 3.18 disposes of a chart that is not drawn yet when its page is left at once; nothing else comes of it.
EARLY_CHART = r"reading 'dispose'\)[\s\S]*echart\.js"


@contextmanager
def tab(
    browser: Browser,
    console: RunningConsole,
    address: str = "/",
    *,
    size: tuple[int, int] = INSTRUMENT,
    expected: str = "$^",
    **how: Any,
) -> Iterator[Page]:
    """A page in a browser of its own; what it complained of fails the test, but for what is ``expected``."""
    context = browser.new_context(viewport={"width": size[0], "height": size[1]}, **how)
    page = context.new_page()
    faults: list[str] = []
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.on("console", lambda message: faults.append(message.text) if message.type == "error" else None)
    try:
        page.goto(f"{console.address}{address}{'&' if '?' in address else '?'}token={console.token}")
        yield page
        assert [item for item in faults if not re.search(f"{expected}|{EARLY_CHART}", item)] == []
    except BaseException as error:
        with suppress(BrowserError):  # which may be what failed
            picture(page, "as-a-test-failed")
            error.add_note(f"the page said:\n{page.inner_text('body')}\nand complained of {faults}")
        raise
    finally:
        context.close()


@contextmanager
def operating(browser: Browser, console: RunningConsole, address: str = "/", **how: Any) -> Iterator[Page]:
    """A page that holds the camera, and gives it back at the end."""
    with tab(browser, console, address, **how) as page:
        hold(page)
        yield page
        page.get_by_role("button", name=RELEASE).click()
        page.get_by_role("button", name=TAKE).wait_for()


def hold(page: Page) -> None:
    """Take the camera, whoever had it; a page takes by itself what nobody holds."""
    take, release = page.get_by_role("button", name=TAKE), page.get_by_role("button", name=RELEASE)
    with suppress(Late):
        release.wait_for(timeout=BY_ITSELF_MS)
        return
    with suppress(Late):  # the page takes it by itself just now, and its button is gone
        take.click(timeout=BY_ITSELF_MS)
    over = page.get_by_role("button", name=OVER)
    over.or_(release).first.wait_for()
    if over.is_visible():
        over.click()
    release.wait_for()


def run(page: Page) -> None:
    """Start the camera, where it does not run, and wait for frames."""
    button = page.get_by_role("button", name=re.compile("^(Start|Stop)"), disabled=False).first
    button.wait_for()
    if "Start" in button.inner_text():
        button.click()
    page.get_by_text("frames/s shown").wait_for()
    page.get_by_text(re.compile(r"^\d+ frames/s, ")).wait_for()


def choose_target(page: Page, number: str) -> None:
    """Type a number into the field of the target."""
    field = page.get_by_label("Target", exact=True)
    field.fill(number)
    field.press("Enter")


def follow(page: Page, name: str, address: str) -> None:
    """Click a link, and wait until its page is there."""
    page.get_by_role("link", name=name, exact=True).click()
    page.wait_for_url(address)


def go_to(page: Page, title: str) -> None:
    """Open a page by the link of its group, and its own.

    A page that was out of touch with the console, on a busy machine, loads anew and loses a click: it is clicked again.
    """
    heading = page.get_by_role("heading", level=1, name=title, exact=True)
    for _ in range(TRIES):
        _click_link(page, title)
        with suppress(Late):
            heading.wait_for(timeout=BY_ITSELF_MS)
            break
    heading.wait_for()
    page.locator("main .panel").first.wait_for()


def _click_link(page: Page, title: str) -> None:
    group, address = next(
        (group, address) for group, pages in GROUPS.items() for address in pages if PAGES[address][0] == title
    )
    page.get_by_role("navigation", name="Groups of pages").get_by_role("link", name=group, exact=True).click()
    if address != GROUPS[group][0]:
        page.get_by_role("navigation", name=f"Pages of {group}").get_by_role("link", name=title, exact=True).click()


def press_with(page: Page, force: str) -> None:
    """Have the virtual probe press so hard, and wait until the frames show it."""
    field = page.get_by_label("Force", exact=True)
    field.fill(force)
    field.press("Enter")
    page.get_by_text(re.compile(rf"^{float(force):.2f} N$")).wait_for()


def requested(console: RunningConsole, path: str) -> Any:
    """What a script reads of the console: another path to the same instrument."""
    return httpx.get(console.address + API + path, headers=console.key, timeout=HANGS_S).raise_for_status().json()
