"""Live image and histogram in a real browser, against NumPy and the room of images."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tests.console.browser import needs_browser
from tests.console.live.elements_page import ENDS, LIVE, SURFACE

from tsis.console.live.hub import GREY, MAPS, packed_colours
from tsis.imaging.colour import colour_map
from tsis.model.image import TactileImage

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from playwright.sync_api import Page

pytestmark = [pytest.mark.system, needs_browser]

HISTOGRAM = "getElement(document.querySelector('figure.histogram'))"
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


@pytest.mark.parametrize("ends", [name for name in ENDS if name != "auto"])
@pytest.mark.parametrize("name", MAPS)
def test_each_level_has_the_colour_of_the_room_of_images(still: Page, name: str, ends: str) -> None:
    low, high = (float(end) for end in ENDS[ends])
    still.get_by_role("button", name=f"map {name}").click()
    still.get_by_role("button", name=f"ends {ends}").click()
    still.wait_for_function(
        f"([colour, low, high]) => {LIVE}.colours[77] === colour && {LIVE}.ends[0] === low && {LIVE}.ends[1] === high",
        arg=[packed_colours(name)[77], low, high],
    )
    levels = np.arange(256, dtype=np.uint8).reshape(SIXTEEN, SIXTEEN)
    shown = drawn_levels(still, levels)
    if name == GREY:
        expected = np.rint(np.clip((levels - low) / (high - low), 0, 1) * 255)[..., None].repeat(3, axis=2)
    else:
        expected = colour_map(TactileImage(grey=levels.astype(float)), name=name, low=low, high=high)
    assert np.array_equal(shown[..., :3], expected)
    assert (shown[..., 3] == 255).all()


def test_new_words_do_not_make_the_colours_anew(still: Page, request: pytest.FixtureRequest) -> None:
    still.get_by_role("button", name="ends whole").click()
    still.wait_for_function(f"() => {LIVE}.ends[1] === 255")
    still.evaluate(f"() => {{ window.tables = [{LIVE}.table, {SURFACE}.table]; }}")
    assert still.locator("canvas[aria-label$='no frames']").count() == 1
    request.getfixturevalue("running")
    still.locator("canvas[aria-label$='no frames']").wait_for(state="detached")
    assert still.evaluate(f"() => tables[0] === {LIVE}.table && tables[1] === {SURFACE}.table")


@pytest.mark.parametrize(("centre", "spread"), [(40, 6), (120, 25), (230, 12), (8, 0.5)])
def test_automatic_ends_hold_nearly_all_pixels(still: Page, centre: float, spread: float) -> None:
    levels = np.random.default_rng(6).normal(centre, spread, 100_000).round().clip(0, 255)
    counts = np.histogram(levels, bins=64, range=(0.0, 256.0))[0]
    low, high = still.evaluate("async (counts) => (await import('tsis-live')).endsOf('auto', counts)", counts.tolist())
    below, above = np.quantile(levels, [0.01, 0.999])
    assert 0 <= low < high <= 255
    assert high - low >= 24
    assert low - 4 <= below
    assert above <= high + 4
    assert high - low <= max(24, above - below + 8)


def test_automatic_ends_follow_what_is_seen(still: Page) -> None:
    still.get_by_role("button", name="ends auto").click()
    still.wait_for_function(f"() => {LIVE}.ends === 'auto'")
    counts = np.zeros(64, dtype=int)
    counts[10:20] = 100
    still.evaluate(f"(histogram) => {LIVE}.see({{ histogram, contact: null }})", counts.tolist())
    shown = drawn_levels(still, np.array([[20, 36, 60, 84, 200]], dtype=np.uint8))[0, :, :3].astype(int)
    assert np.array_equal(shown[0], shown[1])  # both at or below the lower end
    assert not np.array_equal(shown[1], shown[2])
    assert np.array_equal(shown[3], shown[4])
    still.get_by_text(re.compile(r"grey \d+")).first.wait_for()
    still.get_by_role("button", name="ends whole").click()
    still.wait_for_function(f"() => {LIVE}.ends !== 'auto'")


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


def test_elements_of_a_page_share_one_connection(running: Page) -> None:
    assert running.evaluate(
        f"""async () => {{
          const {{ streamOf }} = await import("tsis-live");
          const stream = streamOf("/live");
          return {LIVE}.stream === stream && stream.showing.size;
        }}"""
    ) == 3  # fmt: skip


def test_the_age_and_rate_of_frames_can_be_asked_for(running: Page) -> None:
    running.wait_for_function(f"() => {LIVE}.measured().length >= 20")
    drawn = running.evaluate(f"() => {LIVE}.measured()")
    times, ages = np.array(drawn).T
    assert (np.diff(times) > 0).all()
    assert (ages > -5).all()


def test_a_lost_connection_comes_back(running: Page) -> None:
    running.evaluate(f"() => {LIVE}.stream.socket.close()")
    running.get_by_text("the connection is lost; trying again").wait_for()
    running.get_by_text("the connection is lost; trying again").wait_for(state="detached")
    observed = running.evaluate(f"() => {LIVE}.stream.frame.number")
    running.wait_for_function(f"(seen) => {LIVE}.stream.frame.number > seen", arg=observed)


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


def reported(counts: NDArray[Any], **more: Any) -> dict[str, Any]:
    """As much of what a frame shows as the histogram uses."""
    return {"histogram": counts.tolist(), "clipped_share": 0.0125, "warnings": [], "contact": None, **more}


@pytest.mark.parametrize("logarithmic", [False, True])
def test_bars_are_as_high_as_the_numbers_of_pixels(still: Page, logarithmic: bool) -> None:
    counts = np.random.default_rng(7).integers(0, 5000, 64)
    counts[5], counts[6] = 0, 1
    still.get_by_role("checkbox", name="logarithmic").set_checked(logarithmic)
    still.evaluate(f"(sight) => {HISTOGRAM}.see(sight)", reported(counts))
    still.get_by_text("1.25 % of the pixels at full scale").wait_for()
    path = still.locator(".histogram-bars").get_attribute("d") or ""
    heights = -np.array([float(item) for item in re.findall(r"v(-?[\d.e-]+)h", path)])
    height = np.log10(1 + counts) if logarithmic else counts.astype(float)
    assert heights / heights.max() == pytest.approx(height / height.max(), abs=1e-6)
    lefts = [float(item) for item in re.findall(r"M([\d.]+) ", path)]
    assert lefts == pytest.approx(np.arange(64) * 4.0)


def test_what_is_wrong_with_the_exposure_is_said(still: Page) -> None:
    sentence = "3.0% of the pixels are at full scale: shorten the exposure or lower the gain"
    still.evaluate(f"(sight) => {HISTOGRAM}.see(sight)", reported(np.ones(64), warnings=[sentence]))
    still.get_by_role("status").filter(has_text=f"Exposure: {sentence}").wait_for()
    still.evaluate(f"() => {HISTOGRAM}.see(null)")
    still.get_by_text(sentence).wait_for(state="detached")


def test_the_histogram_says_what_it_shows(running: Page) -> None:
    running.get_by_role(
        "img", name=re.compile(r"grey levels of the newest frame: half of the pixels below \d+%")
    ).wait_for()
    running.get_by_text("full scale 255").wait_for()


def test_what_lies_under_the_pointer_is_read_also_when_it_is_zoomed(still: Page) -> None:
    """Each pixel has a grey level of its own place, so that the read-out names both or is wrong."""
    rows, columns = 40, 60
    levels = (np.arange(rows)[:, None] * 3 + np.arange(columns)[None, :] * 2).astype(np.uint8)
    drawn_levels(still, levels)
    stage = still.locator(".live-stage")
    box = stage.bounding_box()
    assert box is not None
    reading = still.locator(".live-read")
    scale = min(box["width"] / columns, box["height"] / rows)

    def read(x: float, y: float) -> tuple[int, int, int]:
        still.mouse.move(x, y)
        reading.get_by_text("grey").wait_for()
        found = re.match(r"x (\d+), y (\d+).* grey (\d+) of 255", reading.inner_text())
        assert found is not None, reading.inner_text()
        column, row, grey = (int(part) for part in found.groups())
        return column, row, grey

    left = box["x"] + (box["width"] - columns * scale) / 2
    top = box["y"] + (box["height"] - rows * scale) / 2
    for column, row in ((0, 0), (30, 20), (59, 39)):
        place = left + (column + 0.5) * scale, top + (row + 0.5) * scale
        assert read(*place) == (column, row, int(levels[row, column]))
    place = left + 30.5 * scale, top + 20.5 * scale
    still.mouse.move(*place)
    for _ in range(6):  # the pixel under the pointer stays there
        still.mouse.wheel(0, -100)
    still.get_by_text("3.8 x").wait_for()  # 1.25 to the sixth
    assert read(*place) == (30, 20, int(levels[20, 30]))
    assert read(place[0] + scale, place[1])[0] == 30  # a pixel is 3.8 times as wide now
    stage.dblclick()
    assert read(place[0] + scale, place[1])[0] == 31


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
