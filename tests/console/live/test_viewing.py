"""What is done with a frame: zoomed by wheel, keys, buttons and fingers, measured, and brightened; against NumPy."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from playwright.sync_api import expect
from tests.console.browser import needs_browser, picture
from tests.console.live.elements_page import MM_PER_PIXEL, ROWS, still_levels

from tsis.console.live.histogram import autoscale
from tsis.imaging.regions import line_profile, region_statistics
from tsis.model.image import TactileImage

if TYPE_CHECKING:
    from collections.abc import Iterator

    from playwright.sync_api import Browser, CDPSession, Locator, Page

pytestmark = [pytest.mark.system, needs_browser]
SINGLE = "getElement(document.querySelector('.single figure.live'))"
IMAGE = TactileImage(grey=still_levels(), mm_per_pixel=MM_PER_PIXEL)


# The frame is as high on the screen as its panel: the view has followed the panel's last change of size.
FILLED = f"""() => {{
    const map = {SINGLE}.leaflet, height = (y) => map.latLngToContainerPoint([y, 0]).y;
    return Math.abs(Math.abs(height({ROWS}) - height(0)) - map.getContainer().clientHeight) < 2;
}}"""


@pytest.fixture
def single(page: Page) -> Locator:
    """A new panel of the single frame."""
    page.evaluate("() => document.querySelector('.single figure.live')?.setAttribute('data-old', '')")
    page.get_by_role("button", name="single frame").click()
    page.locator(".single figure.live:not([data-old])").wait_for()
    page.wait_for_function(f"() => {SINGLE}?.layer && {SINGLE}.zoom === 1")
    page.mouse.move(2, 2)
    part = page.locator(".single")
    _centre(part)
    page.wait_for_function(FILLED)
    return part


def _centre(part: Locator) -> None:
    """Bring the frame between header and footer."""
    part.locator(".live-stage").evaluate("(stage) => stage.scrollIntoView({ block: 'center' })")


def _box(stage: Locator) -> dict[str, float]:
    box = stage.bounding_box()
    assert box is not None
    return {"x": box["x"], "y": box["y"], "width": box["width"], "height": box["height"]}


def _place(single: Locator, x: float, y: float) -> tuple[float, float]:
    """Where a place of the whole frame, in pixels from the centre of the first, is on the screen."""
    box = _box(single.locator(".live-map"))
    scale = box["height"] / ROWS
    return box["x"] + (x + 0.5) * scale, box["y"] + (y + 0.5) * scale


def _choose(single: Locator, tool: str) -> None:
    """Measure by a tool: the view has it when the ends of what is measured are drawn."""
    single.get_by_role("button", name=tool).click()
    single.get_by_role("button", name="Point 2 of what is measured").wait_for()


def _drag(page: Page, single: Locator, start: tuple[float, float], end: tuple[float, float]) -> None:
    page.mouse.move(*_place(single, *start))
    page.mouse.down()
    page.mouse.move(*_place(single, *((a + b) / 2 for a, b in zip(start, end, strict=True))))
    page.mouse.move(*_place(single, *end))
    page.mouse.up()


def _facts(single: Locator) -> dict[str, str]:
    terms, values = (single.locator(f".facts {tag}").all_inner_texts() for tag in ("dt", "dd"))
    return dict(zip(terms, values, strict=True))


def _points(page: Page) -> list[tuple[float, float]]:
    shown: Any = page.evaluate(f"() => {SINGLE}.points.map((place) => [place.lng - 0.5, place.lat - 0.5])")
    return [(x, y) for x, y in shown]


def test_the_wheel_alone_scrolls_the_page_and_with_control_it_zooms(page: Page, single: Locator) -> None:
    page.mouse.move(*_place(single, 100, 60))
    before = page.evaluate("scrollY")
    page.mouse.wheel(0, -60)
    page.wait_for_function("(before) => scrollY < before", arg=before)
    assert page.evaluate(f"() => {SINGLE}.zoom") == 1
    _centre(single)
    page.mouse.move(*_place(single, 100, 60))
    page.keyboard.down("Control")
    page.mouse.wheel(0, -200)
    page.wait_for_function(f"() => {SINGLE}.zoom > 1.2")
    page.keyboard.up("Control")


def test_buttons_and_keys_zoom_move_and_show_the_whole(page: Page, single: Locator) -> None:
    single.get_by_role("button", name="Zoom in").click()
    single.get_by_role("button", name="Zoom in").click()
    page.wait_for_function(f"() => Math.abs({SINGLE}.zoom - 2) < 0.01")
    map_ = single.locator(".live-map")
    map_.focus()
    map_.press("+")
    page.wait_for_function(f"() => {SINGLE}.zoom > 2.5")
    middle = page.evaluate(f"() => {SINGLE}.leaflet.getCenter().lng")
    map_.press("ArrowRight")
    page.wait_for_function(f"(before) => {SINGLE}.leaflet.getCenter().lng > before", arg=middle)
    map_.press("-")
    page.wait_for_function(f"() => {SINGLE}.zoom < 2.5")
    map_.press("0")
    page.wait_for_function(f"() => {SINGLE}.zoom === 1")
    single.get_by_role("button", name="Zoom in").click()
    single.get_by_role("button", name="Show the whole frame").click()
    page.wait_for_function(f"() => {SINGLE}.zoom === 1")


def test_scale_bar_and_read_out_stay_in_view_and_follow_the_zoom(page: Page, single: Locator) -> None:
    def bar_mm() -> tuple[float, float]:
        bar = single.locator(".leaflet-control-scale-line")
        return float(bar.inner_text().removesuffix(" mm")), _box(bar)["width"]

    stage = _box(single.locator(".live-stage"))
    for zoom in (1, 4):
        page.evaluate(f"(level) => {SINGLE}.leaflet.setZoom({SINGLE}.least + level)", np.log2(zoom))
        page.wait_for_function(f"(zoom) => Math.abs({SINGLE}.zoom - zoom) < 0.01", arg=zoom)
        mm, width = bar_mm()
        on_screen = stage["height"] / (ROWS * MM_PER_PIXEL[1]) * zoom  # screen pixels a millimetre
        assert width == pytest.approx(mm * on_screen, rel=0.05)
        bar = _box(single.locator(".leaflet-control-scale-line"))
        assert bar["x"] + bar["width"] <= stage["x"] + stage["width"]
        assert bar["y"] + bar["height"] <= stage["y"] + stage["height"]
        page.mouse.move(stage["x"] + stage["width"] / 2, stage["y"] + stage["height"] / 2)
        expect(single.locator(".live-read")).to_contain_text("mm from the centre")


def test_a_profile_is_that_of_the_drawn_line(page: Page, single: Locator) -> None:
    _choose(single, "Profile")
    _drag(page, single, (30, 20), (150, 90))
    expect(single.locator(".facts")).to_contain_text("mm")
    start, end = _points(page)
    assert (*start, *end) == pytest.approx((30, 20, 150, 90), abs=1)
    profile = line_profile(IMAGE, start, end)
    expected = f"{profile.grey.min():.1f} to {profile.grey.max():.1f}"
    expect(single.locator(".facts")).to_contain_text(expected)
    assert _facts(single) == {"distance": f"{profile.distance[-1]:.2f} mm", "grey level": expected}
    single.get_by_role("img", name=f"grey level along the line: {expected}").wait_for()
    picture(page, "viewer-profile")


@pytest.mark.parametrize("kind", ["Rectangle", "Ellipse"])
def test_statistics_are_those_of_the_drawn_region(page: Page, single: Locator, kind: str) -> None:
    _choose(single, kind)
    _drag(page, single, (60.2, 30.3), (120.4, 75.1))
    start, end = _points(page)
    found = region_statistics(IMAGE, kind.lower(), start, end)
    expect(single.locator(".facts")).to_contain_text(f"{found.count:,}")
    facts = _facts(single)
    assert facts["mean ± sd"] == f"{found.mean:.1f} ± {found.sd:.1f} grey levels"
    assert facts["area"] == f"{found.area:.4g} mm²"
    handle = single.get_by_role("button", name="Point 2 of what is measured")
    handle.press("ArrowRight")
    handle.press("Shift+ArrowDown")
    moved = _points(page)[1]
    assert moved == pytest.approx((end[0] + 1, end[1] + 10))
    wider = region_statistics(IMAGE, kind.lower(), start, moved)
    expect(single.locator(".facts")).to_contain_text(f"{wider.count:,}")
    single.get_by_role("button", name=kind).click()  # and it is left again
    expect(single.locator(".facts dt")).to_have_count(0)


def test_a_distance_is_in_millimetres(page: Page, single: Locator) -> None:
    _choose(single, "Distance")
    _drag(page, single, (20, 20), (50, 60))
    (x, y), (end_x, end_y) = _points(page)
    expect(single.locator(".facts")).to_contain_text(f"{np.hypot(end_x - x, end_y - y) * 0.1:.2f} mm")


def test_on_live_frames_the_statistics_follow_the_frames(running: Page) -> None:
    part = running.locator(".live-part")
    part.get_by_role("button", name="Ellipse").click()
    part.locator(".facts dd").first.wait_for()
    expect(part.locator(".facts")).not_to_have_text(part.locator(".facts").inner_text())  # noise of the next frame
    part.get_by_role("button", name="Ellipse").click()


def test_black_white_and_gamma_are_moved_on_the_histogram(page: Page, single: Locator) -> None:
    ends = f"() => {SINGLE}.ends"
    low, high = autoscale(np.histogram(IMAGE.grey, 256, (0, 256))[0].tolist())
    page.wait_for_function(
        f"([low, high]) => Math.abs({SINGLE}.ends[0] - low) < 3 && Math.abs({SINGLE}.ends[1] - high) < 3",
        arg=[low, high],
    )
    single.get_by_role("button", name="Reset").click()
    page.wait_for_function(f"() => {SINGLE}.ends[0] === 0 && {SINGLE}.ends[1] === 255")
    single.locator(".histogram-range").evaluate("(each) => each.scrollIntoView({ block: 'center' })")
    slider = _box(single.locator(".histogram-range .q-slider"))
    chart = _box(single.locator(".histogram-chart"))
    assert slider["x"] == pytest.approx(chart["x"] + 12, abs=1.5)
    assert slider["width"] == pytest.approx(chart["width"] - 24, abs=3)
    middle = slider["y"] + slider["height"] / 2
    for at, share, to in ((0, 0.0, 0.2), (1, 1.0, 0.6)):
        page.mouse.move(slider["x"] + share * slider["width"], middle)
        page.mouse.down()
        page.mouse.move(slider["x"] + to * slider["width"], middle, steps=4)
        page.mouse.up()
        page.wait_for_function(f"([at, level]) => Math.abs({SINGLE}.ends[at] - level) <= 2", arg=[at, 255 * to])
    gamma = single.get_by_role("slider", name="Gamma").locator("[tabindex='0']")
    gamma.focus()
    for reached in (1.05, 1.1, 1.15, 1.2):
        gamma.press("ArrowRight")
        page.wait_for_function(f"(gamma) => Math.abs({SINGLE}.ends[2] - gamma) < 1e-6", arg=reached)
    black, white, exponent = page.evaluate(ends)
    single.get_by_text(f"black {black:.0f}, white {white:.0f}, gamma {exponent:.2f}").wait_for()
    ticks = [float(text) for text in single.locator(".live-legend span").all_inner_texts()]
    assert ticks == pytest.approx(np.linspace(black, white, 5), abs=0.51)
    single.get_by_role("button", name="Auto").click()
    page.wait_for_function(f"([low]) => Math.abs({SINGLE}.ends[0] - low) < 3", arg=[low])


def test_charts_are_vectors_in_the_colours_of_the_theme(page: Page, single: Locator) -> None:
    path = single.locator(".histogram-chart svg path[fill='var(--accent)']").first
    path.wait_for(state="attached")
    colours = set()
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme)
        page.wait_for_function(
            "(dark) => document.documentElement.classList.contains('dark') === dark", arg=scheme == "dark"
        )
        colours.add(path.evaluate("(each) => getComputedStyle(each).fill"))
    page.emulate_media(color_scheme="light")
    assert len(colours) == 2
    box = _box(single.locator(".histogram-chart"))
    page.mouse.move(box["x"] + box["width"] / 3, box["y"] + 30)
    single.get_by_text(re.compile("logarithm of pixels")).wait_for()


@pytest.fixture
def finger(address: str, browser: Browser) -> Iterator[Page]:
    """The page on a telephone."""
    with browser.new_context(viewport={"width": 390, "height": 844}, has_touch=True, is_mobile=True) as context:
        opened = context.new_page()
        opened.goto(address)
        opened.get_by_role("button", name="single frame").click()
        opened.wait_for_function(f"() => document.querySelector('.single figure.live') && {SINGLE}.layer")
        _centre(opened.locator(".single"))
        yield opened


def _touch(session: CDPSession, kind: str, *places: tuple[float, float]) -> None:
    points = [{"x": x, "y": y, "id": at} for at, (x, y) in enumerate(places)]
    session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})


def test_two_fingers_zoom_one_moves_and_a_tap_reads(finger: Page) -> None:
    single = finger.locator(".single")
    hand = finger.context.new_cdp_session(finger)
    box = _box(single.locator(".live-map"))
    single.locator(".live-map").tap(position={"x": box["width"] / 2, "y": box["height"] / 2})
    x, y = _place(single, 100, 60)
    expect(single.locator(".live-read")).to_contain_text(re.compile(r"x (99|100|101), y (59|60|61)"))
    _touch(hand, "touchStart", (x - 20, y), (x + 20, y))
    for spread in (30, 45, 60, 80):
        _touch(hand, "touchMove", (x - spread, y), (x + spread, y))
        finger.wait_for_timeout(50)
    _touch(hand, "touchEnd")
    finger.wait_for_function(f"() => {SINGLE}.zoom > 2.5")
    middle = finger.evaluate(f"() => {SINGLE}.leaflet.getCenter().lng")
    _touch(hand, "touchStart", (x, y))
    for step in (15, 30, 45, 60):
        _touch(hand, "touchMove", (x - step, y))
        finger.wait_for_timeout(30)
    _touch(hand, "touchEnd")
    finger.wait_for_function(f"(before) => {SINGLE}.leaflet.getCenter().lng > before + 3", arg=middle)
    picture(finger, "viewer-390-pinched")


def test_a_finger_scrolls_over_a_whole_frame_and_draws_what_is_measured(finger: Page) -> None:
    single = finger.locator(".single")
    actions = "() => getComputedStyle(document.querySelector('.single .live-map')).touchAction"
    assert finger.evaluate(actions) == "pan-x pan-y"
    single.get_by_role("button", name="Rectangle").click()
    finger.wait_for_function(f"() => ({actions})() === 'none'")
    _centre(single)
    start, end = _place(single, 40, 30), _place(single, 90, 80)
    hand = finger.context.new_cdp_session(finger)
    _touch(hand, "touchStart", start)
    for share in (0.3, 0.6, 1.0):
        _touch(hand, "touchMove", tuple(a + share * (b - a) for a, b in zip(start, end, strict=True)))  # type: ignore[arg-type]
    _touch(hand, "touchEnd")
    first, second = _points(finger)
    assert (*first, *second) == pytest.approx((40, 30, 90, 80), abs=1)
    expect(single.locator(".facts")).to_contain_text(f"{region_statistics(IMAGE, 'rectangle', first, second).count:,}")
