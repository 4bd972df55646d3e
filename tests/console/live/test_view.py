"""Live image, histogram, relief and their texts, in a real browser against NumPy."""

from __future__ import annotations

import re
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tests.console.browser import needs_browser, picture
from tests.console.live.elements_page import ENDS, LIVE, SURFACE

from tsis.console.live.hub import GREY, MAPS, packed_colours
from tsis.console.live.view import analysis_text, histogram_text, notice
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
    message = histogram_text(state(analysis_of(levels)))
    result = re.fullmatch(r"half of the pixels below (\d+)% of full scale, ([\d.]+)% at it", message)
    assert result is not None
    assert float(result[1]) == pytest.approx(100 * np.median(levels) / 256, abs=100 / 64 + 0.5)
    assert float(result[2]) == pytest.approx(100 * (levels == 255).mean(), abs=0.05)


def test_a_contact_is_said_with_its_place() -> None:
    contact = ContactView(centroid_px=(384.4, 245.6), outline_px=())
    assert analysis_text(state(analysis_of(np.zeros(4), contact))) == "contact around column 384, row 246"
    assert analysis_text(state(ANALYSIS)) == "nothing is pressed"


@pytest.mark.parametrize("text", [analysis_text, histogram_text])
def test_without_frames_that_is_said(text: Any) -> None:
    assert text(state(None)) == text(state(ANALYSIS, running=False)) == "no frames"


def test_a_picture_that_may_be_old_says_so() -> None:
    assert notice(state(ANALYSIS)) == ""
    assert notice(state(ANALYSIS, running=False)) == "the camera is stopped"
    assert "last frame" in notice(state(ANALYSIS, lost=True))


def test_a_camera_that_is_being_started_is_not_called_stopped() -> None:
    assert notice(state(None, running=False, busy="starting the camera")) == "starting the camera …"
    assert notice(state(None, running=False)) == "the camera is stopped"


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


@pytest.mark.system
@needs_browser
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


@pytest.mark.system
@needs_browser
def test_new_words_do_not_make_the_colours_anew(still: Page, request: pytest.FixtureRequest) -> None:
    still.get_by_role("button", name="ends whole").click()
    still.wait_for_function(f"() => {LIVE}.ends[1] === 255")
    still.evaluate(f"() => {{ window.tables = [{LIVE}.table, {SURFACE}.table]; }}")
    assert still.locator("canvas[aria-label$='no frames']").count() == 1
    request.getfixturevalue("running")
    still.locator("canvas[aria-label$='no frames']").wait_for(state="detached")
    assert still.evaluate(f"() => tables[0] === {LIVE}.table && tables[1] === {SURFACE}.table")


@pytest.mark.system
@needs_browser
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


@pytest.mark.system
@needs_browser
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
    ) == 3  # fmt: skip


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


def reported(counts: NDArray[Any], **more: Any) -> dict[str, Any]:
    """As much of what a frame shows as the histogram uses."""
    return {"histogram": counts.tolist(), "clipped_share": 0.0125, "warnings": [], "contact": None, **more}


@pytest.mark.system
@needs_browser
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


@pytest.mark.system
@needs_browser
def test_what_is_wrong_with_the_exposure_is_said(still: Page) -> None:
    sentence = "3.0% of the pixels are at full scale: shorten the exposure or lower the gain"
    still.evaluate(f"(sight) => {HISTOGRAM}.see(sight)", reported(np.ones(64), warnings=[sentence]))
    still.get_by_role("status").filter(has_text=f"Exposure: {sentence}").wait_for()
    still.evaluate(f"() => {HISTOGRAM}.see(null)")
    still.get_by_text(sentence).wait_for(state="detached")


@pytest.mark.system
@needs_browser
def test_the_histogram_says_what_it_shows(running: Page) -> None:
    running.get_by_role(
        "img", name=re.compile(r"grey levels of the newest frame: half of the pixels below \d+%")
    ).wait_for()
    running.get_by_text("full scale 255").wait_for()


@pytest.mark.system
@needs_browser
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


WIDTH, HEIGHT = 400, 280  # of the reliefs
BYTES = "(text) => Uint8Array.from(text, (letter) => letter.charCodeAt(0))"  # numbers one by one would take seconds
TEXT = "(bytes) => Array.from(bytes, (each) => String.fromCharCode(each)).join('')"


def as_text(levels: NDArray[np.uint8]) -> str:
    return levels.tobytes().decode("latin-1")


def hill(rows: int = 492, columns: int = 768) -> NDArray[np.uint8]:
    x, y = np.meshgrid(np.arange(columns) / columns, np.arange(rows) / rows)
    return np.asarray(20 + 180 * np.exp(-(((x - 0.3) / 0.15) ** 2) - ((y - 0.6) / 0.2) ** 2), dtype=np.uint8)


@pytest.mark.system
@needs_browser
@pytest.mark.parametrize("shape", [(492, 768), (480, 640), (100, 64), (40, 50), (7, 500)])
def test_the_mesh_holds_means_of_blocks(page: Page, shape: tuple[int, int]) -> None:
    levels = hill(*shape)
    mesh = page.evaluate(
        f"""async ([rows, columns, levels]) => {{
          const {{ blockMeans }} = await import("tsis-live");
          const mesh = blockMeans({{ rows, columns, pixels: ({BYTES})(levels) }}, 64);
          return {{ ...mesh, levels: Array.from(mesh.levels) }};
        }}""",
        [*shape, as_text(levels)],
    )
    side = max(1, shape[1] // 64)
    rows, columns = shape[0] // side, shape[1] // side
    expected = levels[: rows * side, : columns * side].reshape(rows, side, columns, side).mean(axis=(1, 3))
    assert (mesh["rows"], mesh["columns"]) == (rows, columns)
    assert np.array(mesh["levels"]).reshape(rows, columns) == pytest.approx(expected, abs=1e-3)


def painted(page: Page, levels: NDArray[np.uint8], azimuth: float, elevation: float) -> NDArray[np.int_]:
    """Level that each pixel of a relief shows, -1 outside it; its colours are its levels, its shades are left out."""
    rows, columns = levels.shape
    shown, covered = page.evaluate(
        f"""async ([rows, columns, levels, azimuth, elevation]) => {{
          const {{ Relief, blockMeans }} = await import("tsis-live");
          const mesh = blockMeans({{ rows, columns, pixels: ({BYTES})(levels) }}, 64);
          const relief = new Relief({WIDTH}, {HEIGHT});
          const table = Uint32Array.from({{ length: 256 }}, (_, level) => 0xff000000 + level);
          relief.shadeTable(table);
          relief.shaded = relief.shaded.map((_, at) => table[at & 255]);
          relief.paint(mesh, {{ table, azimuth, elevation, aspect: rows / columns, top: 200 }});
          return [(packed) => packed & 255, (packed) => (packed ? 1 : 0)].map((part) =>
            ({TEXT})(Uint8Array.from(relief.packed, part)));
        }}""",
        [rows, columns, as_text(levels), azimuth, elevation],
    )
    levels_shown, inside = (np.frombuffer(item.encode("latin-1"), np.uint8).astype(int) for item in (shown, covered))
    return np.where(inside == 1, levels_shown, -1).reshape(HEIGHT, WIDTH)


@pytest.mark.system
@needs_browser
def test_seen_from_above_the_relief_is_the_picture(page: Page) -> None:
    levels = hill()
    observed = painted(page, levels, 0.0, np.pi / 2)
    inside = observed >= 0
    rows, columns = np.flatnonzero(inside.any(axis=1)), np.flatnonzero(inside.any(axis=0))
    top, left = rows[0], columns[0]
    height, width = rows[-1] - top + 1, columns[-1] - left + 1
    assert inside[top : top + height, left : left + width].all()  # no gap between triangles
    assert width / height == pytest.approx(63 / 40 * (768 / 64) / (492 / 41), rel=0.02)
    y, x = np.mgrid[:height, :width]
    picked = levels[
        (6 + (y + 0.5) / height * (492 - 12)).astype(int), (6 + (x + 0.5) / width * (768 - 12)).astype(int)
    ].astype(float)
    assert np.abs(observed[top : top + height, left : left + width] - picked).max() < 6


@pytest.mark.system
@needs_browser
@pytest.mark.parametrize("azimuth", [0.3, 2.0, 3.5, 5.5])
def test_what_stands_before_hides_what_lies_behind(page: Page, azimuth: float) -> None:
    levels = np.full((41, 64), 10, dtype=np.uint8)
    levels[18:23, 28:36] = 210
    observed = painted(page, levels, azimuth, 0.4)
    # Drawn far to near, no pixel of the floor behind shines through: the block's column of pixels is whole.
    middle = round(np.nonzero(observed > 150)[1].mean())
    line = np.flatnonzero(observed[:, middle] > 150)
    assert len(line) >= 8
    assert np.array_equal(line, np.arange(line[0], line[-1] + 1))
    assert (observed[:, middle][observed[:, middle] >= 0]).max() == 210
    assert abs(middle - WIDTH / 2) < 25  # it stands in the middle, however it is turned


@pytest.mark.system
@needs_browser
def test_keys_and_hand_turn_the_relief_and_choose_nothing_else(running: Page) -> None:
    canvas = running.locator("figure.surface canvas")
    running.wait_for_function(f"() => {SURFACE}.measured().length > 2")
    running.evaluate("() => { window.heard = []; document.addEventListener('keydown', (e) => heard.push(e.key)); }")
    canvas.focus()
    turned = f"() => [{SURFACE}.turned.azimuth, {SURFACE}.turned.elevation]"
    before = running.evaluate(turned)
    for key in ("ArrowLeft", "ArrowUp", "ArrowUp"):
        canvas.press(key)
    after = running.evaluate(turned)
    assert after[0] - before[0] == pytest.approx(np.pi / 18)
    assert after[1] - before[1] == pytest.approx(np.pi / 9)
    box = canvas.bounding_box()
    assert box is not None
    running.mouse.move(box["x"] + 100, box["y"] + 100)
    running.mouse.down()
    running.mouse.move(box["x"] + 60, box["y"] + 130)
    running.mouse.up()
    dragged = running.evaluate(turned)
    assert dragged[0] - after[0] == pytest.approx(0.4)
    assert dragged[1] - after[1] == pytest.approx(0.3)
    picture(running, "live-elements")
    canvas.press("x")
    assert running.evaluate("() => heard") == ["x"]
    running.get_by_role("button", name="Turn back").click()
    assert running.evaluate(turned) == before
    running.get_by_role("img", name=re.compile("relief of the live image: contact around column")).wait_for()
