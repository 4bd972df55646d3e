"""The shell around the pages, in a real browser."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING

import pytest
from playwright.sync_api import expect
from tests.console.browser import needs_browser, picture
from tests.console.operator import RELEASE, TAKE, go_to, hold, tab
from tests.console.running import running_console

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from playwright.sync_api import Browser, Page
    from tests.console.running import RunningConsole

pytestmark = [pytest.mark.system, needs_browser]


@pytest.fixture
def opened(console: RunningConsole, browser: Browser) -> Iterator[Callable[..., Page]]:
    """Opens the console in another browser each time."""
    with ExitStack() as tabs:
        yield lambda **how: tabs.enter_context(tab(browser, console, **how))


def test_the_printed_address_opens_the_live_image(opened: Callable[..., Page]) -> None:
    page = opened()
    hold(page)
    page.get_by_role("button", name="Start").first.click()
    page.get_by_text("frames/s shown").wait_for()
    picture(page, "examine-first")
    assert "token" not in page.url


def test_one_sees_where_one_is(opened: Callable[..., Page]) -> None:
    page = opened()
    group, here = (page.get_by_role("navigation", name=name) for name in ("Groups of pages", "Pages of"))
    current = '[aria-current="page"]'
    expect(group.locator(current)).to_have_text("Measure")
    expect(here.locator(current)).to_have_text("Examine")
    go_to(page, "About")
    expect(group.locator(current)).to_have_text("Tools")
    expect(here.locator(current)).to_have_text("About")
    page.wait_for_function("document.title === 'About · tsis console'")
    page.wait_for_url("**/about")
    for name in ("Camera", "Examine"):  # the first page of the group lies between
        page.go_back()
        page.get_by_role("heading", level=1, name=name).wait_for()
    page.wait_for_function("document.title === 'Examine · tsis console'")
    assert page.evaluate("document.documentElement.lang") == "en-GB"


def test_the_first_key_skips_to_the_page(opened: Callable[..., Page]) -> None:
    page = opened()
    page.get_by_role("heading", level=1, name="Examine").wait_for()
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.innerText") == "Skip to the page"
    page.keyboard.press("Enter")
    page.wait_for_function("document.activeElement.id === 'page'")


def test_no_page_is_said_in_a_sentence(console: RunningConsole, opened: Callable[..., Page]) -> None:
    page = opened(expected="404")
    page.goto(f"{console.address}/nowhere")
    page.get_by_text("There is no page at this address.").wait_for()
    picture(page, "no-such-page")
    page.get_by_role("link", name="To the live image").click()
    page.get_by_role("heading", level=1, name="Examine").wait_for()


def test_colours_are_remembered_in_the_browser(opened: Callable[..., Page]) -> None:
    page = opened()
    ground = "getComputedStyle(document.body).backgroundColor"
    button = page.get_by_role("button", name="Colours:")
    button.wait_for()
    light = page.evaluate(ground)
    button.click()
    page.get_by_role("button", name="Colours: light. Change to dark").click()
    page.get_by_role("button", name="Colours: dark").wait_for()
    dark = page.evaluate(ground)
    assert dark != light
    page.reload()
    page.get_by_role("button", name="Colours: dark").wait_for()
    assert page.evaluate(ground) == dark
    page.emulate_media(color_scheme="dark")
    page.get_by_role("button", name="Colours: dark. Change to as the system").click()
    page.get_by_role("button", name="Colours: as the system").wait_for()
    assert page.evaluate(ground) == dark
    page.emulate_media(color_scheme="light")
    page.wait_for_function(f"{ground} === '{light}'")


@pytest.mark.slow
def test_the_camera_is_taken_over_after_asking_and_the_other_is_told(opened: Callable[..., Page]) -> None:
    one = opened()
    hold(one)
    other = opened()
    other.get_by_text("controls the camera; you are watching.").wait_for()
    other.get_by_role("button", name=TAKE).click()
    other.get_by_role("alertdialog").get_by_text("can then only watch").wait_for()
    other.wait_for_function("document.getAnimations().every((each) => each.playState !== 'running')")
    picture(other, "take-over")
    other.get_by_role("button", name="Cancel").click()
    other.get_by_role("alertdialog").wait_for(state="hidden")
    expect(one.get_by_role("button", name=RELEASE)).to_be_visible()
    other.get_by_role("button", name=TAKE).click()
    other.get_by_role("button", name="Take over").click()
    other.get_by_role("button", name=RELEASE).wait_for()
    reported = one.get_by_text("took over the camera; you are watching now.")
    reported.wait_for()
    picture(one, "taken-over")
    name = reported.inner_text().partition(" took")[0]

    other.reload()  # who loads his page anew stays who he is
    other.get_by_role("button", name=RELEASE).wait_for()
    expect(one.get_by_role("status").get_by_text(f"{name} controls the camera; you are watching.")).to_be_visible()


@pytest.mark.slow
def test_what_is_given_back_goes_to_another_and_not_to_oneself(opened: Callable[..., Page]) -> None:
    one = opened()
    hold(one)
    one.get_by_role("button", name=RELEASE).click()
    one.get_by_role("button", name=TAKE).wait_for()
    other = opened()
    other.get_by_role("button", name=RELEASE).wait_for()  # a page that opens takes what nobody holds
    one.get_by_text("controls the camera; you are watching.").wait_for()


@pytest.mark.slow
def test_a_lost_console_is_said_in_our_words(browser: Browser, tmp_path: Path) -> None:
    context = browser.new_context(viewport={"width": 1280, "height": 800})
    page = context.new_page()
    with running_console(tmp_path) as console:
        page.goto(console.entrance)
        page.get_by_role("button", name=RELEASE).wait_for()
    page.get_by_text("The connection to the console is lost.").wait_for()
    expect(page.get_by_text("Saved data are safe")).to_be_visible()
    picture(page, "lost")
    context.close()
