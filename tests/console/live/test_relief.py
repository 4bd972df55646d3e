"""The live relief in a real browser, against NumPy."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.console.browser import needs_browser, picture
from tests.console.live.elements_page import SURFACE

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from playwright.sync_api import Page

pytestmark = [pytest.mark.system, needs_browser]

WIDTH, HEIGHT = 400, 280  # of the reliefs
BYTES = "(text) => Uint8Array.from(text, (letter) => letter.charCodeAt(0))"  # numbers one by one would take seconds
TEXT = "(bytes) => Array.from(bytes, (each) => String.fromCharCode(each)).join('')"


def as_text(levels: NDArray[np.uint8]) -> str:
    return levels.tobytes().decode("latin-1")


def hill(rows: int = 492, columns: int = 768) -> NDArray[np.uint8]:
    x, y = np.meshgrid(np.arange(columns) / columns, np.arange(rows) / rows)
    return np.asarray(20 + 180 * np.exp(-(((x - 0.3) / 0.15) ** 2) - ((y - 0.6) / 0.2) ** 2), dtype=np.uint8)


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
