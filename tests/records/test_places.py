"""A scan of frames goes into a store, out as a bundle and into another store, and is the same scan."""

from __future__ import annotations

import csv
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tests.records.test_sources import grey, image

from tsis.errors import FileInputError, InputError, RecordsError
from tsis.records.importing import import_batches
from tsis.records.places import recorded_scan
from tsis.records.sources import ImportOptions, find_import_batches
from tsis.records.store import open_store
from tsis.records.target import write_bundle

if TYPE_CHECKING:
    from pathlib import Path

PLACES = {0: (-10.0, 2.5, "press"), 1: (0.0, 2.5, "press"), 2: (10.0, 2.5, "reference")}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    made = tmp_path / "three places"
    made.mkdir()
    with (made / "poses.csv").open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["file", "x_mm", "y_mm", "place_sd_mm", "angle_deg", "force_n", "kind", "probe"])
        for number, (x, y, kind) in PLACES.items():
            rows.writerow([image(made, number).name, x, y, 0.5, 30 * number, 1.0 + number, kind, "tsis-2011"])
        rows.writerow([image(made, 3).name, "", "", "", "", "", "press", "tsis-2011"])
    return made


def test_places_survive_import_export_and_import(tmp_path: Path, folder: Path) -> None:
    with open_store(tmp_path / "first") as store:
        (entered,) = import_batches(store, find_import_batches([folder], ImportOptions(mm_per_pixel=(0.1, 0.1))))
        write_bundle(store.record(entered.target), tmp_path / "bundle")
    with open_store(tmp_path / "second") as store:
        (entered,) = import_batches(store, find_import_batches([tmp_path / "bundle"], ImportOptions()))
        stored = recorded_scan(store.record(entered.target))
    assert stored.probe == "tsis-2011"
    presses = sorted(stored.scan.presses, key=lambda press: press.place_mm)
    for number, press in enumerate(presses):
        x, y, kind = PLACES[number]
        assert press.place_mm == (x, y)
        assert press.place_sd_mm == 0.5
        assert press.angle_deg == 30.0 * number
        assert press.measured_force_n == 1.0 + number
        assert press.reference == (kind == "reference")
        assert press.frame is not None
        np.testing.assert_array_equal(press.frame.grey, grey(number))


@pytest.mark.parametrize(("option", "said"), [("--role", {"role": "plain"}), ("--force-n", {"force_n": (1.0,)})])
def test_a_scan_says_role_and_force_itself(folder: Path, option: str, said: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=f"{option} must not be given for .*three places', a scan, which says it"):
        find_import_batches([folder], ImportOptions(**said))


def test_a_press_without_place_is_named(tmp_path: Path, folder: Path) -> None:
    (batch,) = find_import_batches([folder], ImportOptions())
    assert len(batch.presses) == len(PLACES)
    assert batch.notes == ("press-3.png has no place and is left out.",)


def test_what_is_no_frame_and_who_has_no_place_is_refused(tmp_path: Path, folder: Path) -> None:
    single = image(tmp_path, 4)
    with open_store(tmp_path / "store") as store:
        (entered,) = import_batches(store, find_import_batches([single], ImportOptions()))
        with pytest.raises(RecordsError, match="presses with a place"):
            recorded_scan(store.record(entered.target))
    (folder / "press.csv").write_text("ring,pressure_kpa\n1,2\n")
    with (folder / "poses.csv").open("a") as file:
        file.write("press.csv,1,1,,,,press,tsis-2011\n")
    with pytest.raises(FileInputError, match="must be a frame to be stored"):
        find_import_batches([folder], ImportOptions())
