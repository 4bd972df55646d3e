"""Map in a real browser: a scan is opened, mapped, kept and downloaded."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from playwright.sync_api import expect
from tests.console.browser import needs_browser, picture
from tests.console.contrast import texts
from tests.console.operator import TABLET, operating
from tests.records.stored_tray import PIXELS, PROBE, tray_calibration, write_tray

from tsis.catalog.probes import load_probe
from tsis.mapping.scan_folder import scan_files
from tsis.records.importing import import_batches
from tsis.records.sources import ImportOptions, scanned
from tsis.records.store import open_store
from tsis.virtual.scan import THREE_LUMPS, grid_places, virtual_scan

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page
    from tests.console.running import RunningConsole

pytestmark = [pytest.mark.system, needs_browser]


@pytest.fixture
def scan_folder(tmp_path: Path) -> Path:
    """Nine presses over the first of the three lumps."""
    places = grid_places(3, 10.0) + np.array([-9.0, -6.0])
    made = virtual_scan(load_probe("tsis-2011"), THREE_LUMPS[:1], places, rng=np.random.default_rng(7))
    folder = tmp_path / "nine"
    folder.mkdir()
    for name, content in scan_files(made, probe="tsis-2011").items():
        (folder / name).write_bytes(content)
    return folder


def _opened(page: Page, path: Path | str) -> None:
    page.get_by_label("Folder or table on the console's computer").fill(str(path))
    page.get_by_role("button", name="Open", exact=True).click()


def test_from_files_to_a_map_that_is_kept(console: RunningConsole, browser: Browser, scan_folder: Path) -> None:
    with operating(browser, console, "/map") as page:
        page.get_by_text("No map was made yet.").wait_for()
        picture(page, "map-first")
        page.locator("input[type=file]").set_input_files(sorted(scan_folder.iterdir()))
        page.get_by_text("9 presses (pressures) by tsis-2011").wait_for()
        page.get_by_role("button", name="Map the lumps").click()
        page.get_by_role("heading", name="Lumps, 90 % intervals").wait_for()
        page.get_by_text("Blind zone").first.wait_for()
        picture(page, "map")
        assert [item for item in texts(page) if item.contrast < item.least] == []
        page.set_viewport_size({"width": TABLET[0], "height": TABLET[1]})
        picture(page, "map-tablet")
        with page.expect_download() as download:
            page.get_by_role("button", name="Download result.json of map").first.click()
        found = json.loads(Path(download.value.path()).read_text())
        (lump,) = found["lumps"]
        low, high = lump["estimate"]["parameters"]["x_mm"]["interval_90"]
        assert low - 1 < THREE_LUMPS[0].x_mm < high + 1
        page.reload()  # the scan and the list stay
        page.get_by_text("9 presses (pressures) by tsis-2011").wait_for()
        expect(page.get_by_role("button", name="Download map.vti of map")).not_to_have_count(0)
        page.get_by_role("button", name="Close the scan").click()
        page.get_by_text("No scan is open.").wait_for()
    (folder,) = (console.workspace / "maps").iterdir()
    assert {"result.json", "index.html", "map.vti", "probability.dcm"} <= {file.name for file in folder.iterdir()}


def test_the_map_of_a_stored_scan_is_kept_in_its_target(
    console: RunningConsole, browser: Browser, tmp_path: Path
) -> None:
    options = ImportOptions(mm_per_pixel=PIXELS, probe=PROBE, calibration=tray_calibration())
    with open_store(console.store) as store:
        (entered,) = import_batches(store, [scanned(write_tray(tmp_path / "tray"), options, lambda: None)])
    number = entered.target.number
    with operating(browser, console, "/map") as page:
        page.get_by_label("Or the scan of target").fill("99")
        page.get_by_role("button", name="Open the target").click()
        page.get_by_role("alert").filter(has_text="must be a number that this store").first.wait_for()
        page.get_by_label("Or the scan of target").fill(str(number))
        page.get_by_role("button", name="Open the target").click()
        page.get_by_text("4 presses (frames) by tsis-2011").wait_for()
        page.get_by_role("button", name="Map the lumps").click()
        page.get_by_text(f"Kept as map tray and in target {number}.").wait_for(timeout=240_000)
        page.get_by_role("link", name=f"Target {number}", exact=True).click()
        page.get_by_role("heading", name="Current estimates").wait_for()
        page.get_by_text("Lumps, 90 % intervals").wait_for()
        picture(page, "target-map")
    with open_store(console.store) as store:
        (kept,) = store.record(entered.target).maps
    assert len(kept.estimate.untrusted.lumps) == 1


def test_a_press_at_the_next_place_updates_the_map(console: RunningConsole, browser: Browser) -> None:
    with operating(browser, console, "/map") as page:
        page.get_by_role("button", name="Use a simulated scan").click()
        page.get_by_text("25 presses (pressures) by tsis-2011").wait_for(timeout=120_000)
        page.get_by_role("button", name="Map the lumps").click()
        page.get_by_text("Next place: x").wait_for(timeout=240_000)
        view = page.get_by_role("img", name="Lumps in three dimensions")
        view.locator("canvas").wait_for()
        view.scroll_into_view_if_needed()
        picture(page, "map-guide")
        page.get_by_role("button", name="Press there with the virtual probe").click()
        page.get_by_text("26 presses (pressures) by tsis-2011").wait_for(timeout=60_000)
        page.get_by_text("Updated by 26 presses").wait_for(timeout=60_000)
        page.get_by_role("heading", name="Next place: after 26 presses").wait_for()


def test_what_cannot_be_mapped_is_said_in_a_sentence(
    console: RunningConsole, browser: Browser, tmp_path: Path, scan_folder: Path
) -> None:
    def refused(message: str) -> None:
        page.get_by_role("alert").filter(has_text=message).first.wait_for()

    with operating(browser, console, "/map") as page:
        page.get_by_role("button", name="Map the lumps").click()
        refused("A scan must be chosen first")
        _opened(page, tmp_path / "absent")
        refused("must be a folder with poses.csv")
        (scan_folder / "press-001.csv").unlink()
        _opened(page, scan_folder)
        refused("press-001.csv")
        table = tmp_path / "robot.csv"
        table.write_text(
            "press,x_mm,y_mm,travel_mm,force_n\n"
            + "".join(f"{p},{10 * p},0,{t},{t / 10}\n" for p in (1, 2, 3) for t in (1, 2))
        )
        _opened(page, table)
        refused("indenter")
        page.get_by_label("Modulus of the tissue").fill("-5")
        page.get_by_role("button", name="Map the lumps").click()
        refused("Modulus of the tissue must be")
