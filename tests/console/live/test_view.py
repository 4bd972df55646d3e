"""Live image, histogram, relief and their texts, in a real browser against NumPy."""

from __future__ import annotations

import re
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from playwright.sync_api import expect
from tests.console.browser import needs_browser, picture
from tests.console.live.elements_page import ENDS, LIVE, SURFACE

from tsis.console.live.histogram import DisplayRange, autoscale
from tsis.console.live.hub import GREY, MAPS, packed_colours
from tsis.console.live.view import analysis_text, notice
from tsis.console.services.frames import ContactView, FrameAnalysis
from tsis.imaging.colour import colour_map
from tsis.model.image import TactileImage

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from playwright.sync_api import Page


ANALYSIS = FrameAnalysis(
    number=1, flags=(), force=None, still="", contact=None, histogram=(4, 0), clipped_share=0.0, warnings=()
)


def state(analysis: FrameAnalysis | None, *, running: bool = True, lost: bool = False, busy: str = "") -> Any:
    return SimpleNamespace(busy=busy, frame_analysis=analysis, camera=SimpleNamespace(running=running, lost=lost))


def analysis_of(levels: np.ndarray, contact: ContactView | None = None) -> FrameAnalysis:
    counts = np.histogram(levels, bins=64, range=(0.0, 256.0))[0]
    return FrameAnalysis(
        number=1,
        flags=(),
        force=None,
        still="",
        contact=contact,
        histogram=tuple(counts.tolist()),
        clipped_share=float((levels == 255).mean()),
        warnings=(),
    )


@pytest.mark.parametrize("centre", [3, 60, 128, 250])
def test_half_of_the_pixels_lie_below_the_level_that_is_said(centre: int) -> None:
    levels = np.random.default_rng(1).normal(centre, 20, 5001).round().clip(0, 255)
    message = DisplayRange.text(np.histogram(levels, bins=256, range=(0.0, 256.0))[0])
    result = re.fullmatch(r"half of the pixels below (\d+)% of full scale", message)
    assert result is not None
    assert float(result[1]) == pytest.approx(100 * np.median(levels) / 256, abs=1)
    assert DisplayRange.text(np.zeros(256)) == "no frame"


@pytest.mark.parametrize("bins", [64, 256])
@pytest.mark.parametrize(("centre", "spread"), [(40, 6), (120, 25), (230, 12), (8, 0.5)])
def test_automatic_ends_hold_nearly_all_pixels(centre: float, spread: float, bins: int) -> None:
    levels = np.random.default_rng(6).normal(centre, spread, 100_000).round().clip(0, 255)
    low, high = autoscale(np.histogram(levels, bins=bins, range=(0.0, 256.0))[0].tolist())
    below, above = np.quantile(levels, [0.01, 0.999])
    assert 0 <= low < high <= 255
    assert high - low >= 24
    assert low - 4 <= below
    assert above <= high + 4
    assert high - low <= max(24, above - below + 8)


def test_a_contact_is_said_with_its_place() -> None:
    contact = ContactView(centroid_px=(384.4, 245.6), outline_px=())
    assert analysis_text(state(analysis_of(np.zeros(4), contact))) == "contact around column 384, row 246"
    assert analysis_text(state(ANALYSIS)) == "nothing is pressed"


def test_without_frames_that_is_said() -> None:
    assert analysis_text(state(None)) == analysis_text(state(ANALYSIS, running=False)) == "no frames"


def test_a_picture_that_may_be_old_says_so() -> None:
    assert notice(state(ANALYSIS)) == ""
    assert notice(state(ANALYSIS, running=False)) == "the camera is stopped"
    assert "last frame" in notice(state(ANALYSIS, lost=True))


def test_a_camera_that_is_being_started_is_not_called_stopped() -> None:
    assert notice(state(None, running=False, busy="starting the camera")) == "starting the camera …"
    assert notice(state(None, running=False)) == "the camera is stopped"


SIXTEEN = 16


def drawn_levels(page: Page, levels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Colours that the live image gives to a picture of these levels, shape (rows, columns, 4)."""
    rows, columns = levels.shape
    flat = page.evaluate(
        f"""([rows, columns, levels]) => {{
          {LIVE}.draw({{ rows, columns, pixels: Uint8Array.from(levels) }});
          const canvas = document.querySelector(".live-image");
          return Array.from(canvas.getContext("2d").getImageData(0, 0, columns, rows).data);
        }}""",
        [rows, columns, levels.ravel().tolist()],
    )
    return np.array(flat, dtype=np.uint8).reshape(rows, columns, 4)


@pytest.mark.system
@needs_browser
@pytest.mark.parametrize("ends", ENDS)
@pytest.mark.parametrize("name", MAPS)
def test_each_level_has_the_colour_of_the_room_of_images(still: Page, name: str, ends: str) -> None:
    (low, high), gamma = ENDS[ends]
    still.get_by_role("button", name=f"map {name}").click()
    still.get_by_role("button", name=f"ends {ends}").click()
    still.wait_for_function(
        f"([colour, low, high]) => {LIVE}.colours[77] === colour && {LIVE}.ends[0] === low && {LIVE}.ends[1] === high",
        arg=[packed_colours(name)[77], low, high],
    )  # what follows is the colour of a level as the room of images gives it, after gamma
    levels = np.arange(256, dtype=np.uint8).reshape(SIXTEEN, SIXTEEN)
    shown = drawn_levels(still, levels)
    if name == GREY:
        expected = np.rint(np.clip((levels - low) / (high - low), 0, 1) ** gamma * 255)[..., None].repeat(3, axis=2)
    else:
        share = np.clip((levels - low) / (high - low), 0, 1) ** gamma
        expected = colour_map(TactileImage(grey=share * 255), name=name)
    assert np.array_equal(shown[..., :3], expected)
    assert (shown[..., 3] == 255).all()


@pytest.mark.system
@needs_browser
def test_new_words_do_not_make_the_colours_anew(still: Page, request: pytest.FixtureRequest) -> None:
    still.get_by_role("button", name="ends whole").click()
    still.wait_for_function(f"() => {LIVE}.ends[1] === 255")
    still.evaluate(f"() => {{ window.table = {LIVE}.table; }}")
    still.locator("canvas[aria-label$='no frames']").wait_for(state="attached")
    request.getfixturevalue("running")
    still.locator("canvas[aria-label$='no frames']").wait_for(state="detached")
    assert still.evaluate(f"() => table === {LIVE}.table")


@pytest.mark.system
@needs_browser
def test_a_picture_over_the_network_is_the_frame_but_for_its_quality(running: Page) -> None:
    differences = running.evaluate(
        """async () => {
          const { streamOf } = await import("tsis-live");
          const kept = new Map(), differences = [];
          const leave = [], done = new Promise((resolve) => {
            const compare = (address, other_address) => (frame) => {
              const other = kept.get(`${other_address} ${frame.number}`);
              kept.set(`${address} ${frame.number}`, frame);
              if (!other) return;
              let sum = 0;
              for (let at = 0; at < frame.pixels.length; at++) sum += Math.abs(frame.pixels[at] - other.pixels[at]);
              if (differences.push(sum / frame.pixels.length) === 5) resolve();
            };
            const [lossy, exact] = ["/live?jpeg=85", "/live?jpeg=0"];
            for (const [address, other] of [[lossy, exact], [exact, lossy]])  // each may bring a frame twice
              leave.push(streamOf(address).join({ frame: compare(address, other) }));
          });
          await done;
          leave.forEach((each) => each());
          return differences;
        }"""
    )
    assert max(differences) < 1.0
    assert min(differences) > 0.0  # it was a picture


@pytest.mark.system
@needs_browser
def test_elements_of_a_page_share_one_connection(running: Page) -> None:
    assert running.evaluate(
        f"""async () => {{
          const {{ streamOf }} = await import("tsis-live");
          const stream = streamOf("/live");
          return {LIVE}.stream === stream && stream.showing.size;
        }}"""
    ) == 2  # fmt: skip


@pytest.mark.system
@needs_browser
def test_the_age_and_rate_of_frames_can_be_asked_for(running: Page) -> None:
    running.wait_for_function(f"() => {LIVE}.measured().length >= 20")
    drawn = running.evaluate(f"() => {LIVE}.measured()")
    times, ages = np.array(drawn).T
    assert (np.diff(times) > 0).all()
    assert (ages > -5).all()


@pytest.mark.system
@needs_browser
def test_a_lost_connection_comes_back(running: Page) -> None:
    running.evaluate(f"() => {LIVE}.stream.socket.close()")
    running.get_by_text("the connection is lost; trying again").wait_for()
    running.get_by_text("the connection is lost; trying again").wait_for(state="detached")
    observed = running.evaluate(f"() => {LIVE}.stream.frame.number")
    running.wait_for_function(f"(seen) => {LIVE}.stream.frame.number > seen", arg=observed)


@pytest.mark.system
@needs_browser
def test_a_page_that_nobody_sees_asks_for_no_frames(running: Page) -> None:
    hide = """(hidden) => {
      Object.defineProperty(document, "hidden", { value: hidden, configurable: true });
      document.dispatchEvent(new Event("visibilitychange"));
    }"""
    running.evaluate(hide, True)
    assert running.evaluate(f"() => {LIVE}.stream.socket") is None
    observed = running.evaluate(f"() => {LIVE}.stream.frame.number")
    running.evaluate(hide, False)
    running.wait_for_function(f"(seen) => {LIVE}.stream.frame.number > seen", arg=observed)


@pytest.mark.system
@needs_browser
def test_a_damaged_frame_is_passed_over(page: Page) -> None:
    shown = page.evaluate(
        f"""async () => {{
          const stream = {LIVE}.stream, told = [], ask = console.error;
          console.error = (words) => told.push(words);
          const socket = {{ readyState: WebSocket.OPEN, send: (word) => told.push(word) }};
          const short = new Uint8Array(40);
          short.set([84, 83, 70, 49, 0, 0, 0, 0, 1, 0, 0, 0, 9, 0, 9, 0]);
          await stream.receive(new ArrayBuffer(3), socket);
          await stream.receive(short.buffer, socket);
          console.error = ask;
          return told;
        }}"""
    )
    assert shown == [
        "a frame could not be shown: this is no frame",
        "ok",
        "a frame could not be shown: this is no whole frame",
        "ok",
    ]


@pytest.mark.system
@needs_browser
@pytest.mark.parametrize("rows", [8, 16, 40, 400])
def test_a_frame_of_another_shape_is_shown_whole(still: Page, rows: int) -> None:
    for shape in ((rows, 60), (120, 200), (12, 20), (rows, 60)):  # larger and smaller ones before it
        drawn_levels(still, np.zeros(shape, dtype=np.uint8))
        still.wait_for_function(
            f"""() => {{
              const [frame, place] = [".live-image", ".live-map"].map(
                (name) => document.querySelector(name).getBoundingClientRect());
              const close = (one, other) => Math.abs(one - other) < 2;
              return {LIVE}.zoom === 1 && frame.width < place.width + 2 && frame.height < place.height + 2
                && (close(frame.width, place.width) || close(frame.height, place.height));
            }}"""
        )


@pytest.mark.system
@needs_browser
def test_what_lies_under_the_pointer_is_read_also_when_it_is_zoomed(still: Page) -> None:
    """Each pixel has a grey level of its own place, so that the read-out names both or is wrong."""
    rows, columns = 40, 60
    levels = (np.arange(rows)[:, None] * 3 + np.arange(columns)[None, :] * 2).astype(np.uint8)
    drawn_levels(still, levels)
    still.locator(".live-map").first.hover()  # once it has the frame's shape
    still.locator(".live-image").first.evaluate("image => image.scrollIntoView({ block: 'center' })")
    box = still.locator(".live-image").first.bounding_box()
    assert box is not None
    reading = still.locator(".live-read").first
    scale = min(box["width"] / columns, box["height"] / rows)

    def reads(place: tuple[float, float], column: int, row: int) -> None:
        still.mouse.move(*place)
        expect(reading).to_have_text(re.compile(rf"x {column}, y {row}\b.* grey {levels[row, column]}\b"))

    left = box["x"] + (box["width"] - columns * scale) / 2
    top = box["y"] + (box["height"] - rows * scale) / 2
    for column, row in ((0, 39), (30, 20), (59, 0)):  # beside buttons and scale bar
        place = left + (column + 0.5) * scale, top + (row + 0.5) * scale
        reads(place, column, row)
    place = left + 30.5 * scale, top + 20.5 * scale
    still.mouse.move(*place)
    still.keyboard.down("Control")
    for _ in range(3):  # the pixel under the pointer stays there
        still.mouse.wheel(0, -100)
        still.wait_for_timeout(100)
    still.keyboard.up("Control")
    still.wait_for_function(f"() => {LIVE}.zoom > 2")
    zoom = still.evaluate(f"() => {LIVE}.zoom")
    still.get_by_text(f"{zoom:.1f} x").wait_for()
    reads(place, 30, 20)
    beyond = place[0] + 1.6 * scale  # of a pixel that is more than twice as wide now
    reads((beyond, place[1]), 30 + round(1.6 / zoom), 20)
    still.get_by_role("button", name="Show the whole frame").first.click()
    reads((beyond, place[1]), 32, 20)


@pytest.mark.system
@needs_browser
def test_saturated_and_black_pixels_are_marked_and_counted(still: Page) -> None:
    levels = np.full((10, 10), 100, dtype=np.uint8)
    levels[0, :3], levels[1, 0] = 255, 0
    still.get_by_role("button", name="mark limits").click()
    still.wait_for_function(f"() => {LIVE}.marks")
    shown = drawn_levels(still, levels)
    still.get_by_text("red: saturated, 3.00 %; blue: black, 1.00 %").wait_for()
    still.get_by_role("button", name="mark nothing").click()
    still.wait_for_function(f"() => !{LIVE}.marks")
    red, blue = (255, 0, 0), (0, 0, 255)
    assert [tuple(pixel) for pixel in shown[0, :3, :3].tolist()] == [red] * 3
    assert tuple(shown[1, 0, :3].tolist()) == blue
    assert tuple(shown[5, 5, :3].tolist()) not in (red, blue)


@pytest.mark.system
@needs_browser
def test_keys_turn_the_relief_and_choose_nothing_else(running: Page) -> None:
    relief = running.locator(".surface-image")
    running.wait_for_function(f"() => {SURFACE}.measured().length > 2")
    running.evaluate("() => { window.heard = []; document.addEventListener('keydown', (e) => heard.push(e.key)); }")
    turned = f"() => [{SURFACE}.turned().alpha, {SURFACE}.turned().beta]"
    before = running.evaluate(turned)
    relief.focus()
    for key in ("ArrowRight", "ArrowUp", "ArrowUp"):
        relief.press(key)
    after = running.evaluate(turned)
    assert after[0] - before[0] == pytest.approx(20, abs=1)
    assert after[1] - before[1] == pytest.approx(10, abs=1)
    picture(running, "live-elements")
    relief.press("x")
    assert running.evaluate("() => heard") == ["x"]
    running.get_by_role("button", name="Turn back").click()
    assert running.evaluate(turned) == pytest.approx(before, abs=1)
    running.get_by_role("img", name=re.compile("relief of the live image: contact around column")).wait_for()


@pytest.mark.system
@needs_browser
def test_the_relief_has_the_means_of_blocks(still: Page) -> None:
    levels = np.random.default_rng(4).integers(0, 255, (120, 200)).astype(np.uint8)
    drawn = still.evaluate(
        f"""([rows, columns, levels]) => {{
          {SURFACE}.frame = {{ rows, columns, pixels: Uint8Array.from(levels), fullScale: 255 }};
          {SURFACE}.draw();
          return {SURFACE}.chart.getOption().series[0].data.map((place) => place[2]);
        }}""",
        [*levels.shape, levels.ravel().tolist()],
    )
    expected = levels[:120, :198].reshape(40, 3, 66, 3).mean(axis=(1, 3))
    assert np.array(drawn).reshape(40, 66) == pytest.approx(expected, abs=1e-3)
