"""Maps of lumps in a store: the same when read back, exported, imported and made again; damage is told."""

from __future__ import annotations

import csv
import hashlib
import json
import os
import shutil
import sqlite3
from contextlib import closing
from dataclasses import asdict, replace
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tests.present.rough_pictures import rough_pictures
from tests.present.test_lump_map import map_of
from tests.records.sample import sample_calibration
from tests.records.stored_tray import (
    OPTIONS,
    PIXELS,
    PROBE,
    kept,
    pressed,
    require_equal,
    tray_calibration,
    write_tray,
)

from tsis.calibration.file import calibration_sha256
from tsis.calibration.frames import UsableCalibration
from tsis.catalog.probes import load_probe
from tsis.errors import FileInputError, InputError, RecordsError, UntrustedError
from tsis.mapping import estimate_map
from tsis.mapping.prior import MapPrior
from tsis.mapping.scan_folder import calibrated, read_scan
from tsis.present.html import html_bytes
from tsis.present.target import target_page
from tsis.records.export import csv_files
from tsis.records.importing import save_map
from tsis.records.places import placed_presses, recorded_calibration, recorded_scan
from tsis.records.reader import DELETED
from tsis.records.recomputation import recompute
from tsis.records.sources import ImportOptions, scanned
from tsis.records.store import UNDO_DAYS, open_store, verify_store
from tsis.records.target import read_bundle, sealed_bytes, write_bundle

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from tests.records.conftest import Place

    from tsis.records.store import Store


@pytest.fixture(scope="module", autouse=True)
def _rough_pictures() -> Iterator[None]:
    with rough_pictures():
        yield


@pytest.mark.parametrize("trusted", [True, False])
def test_a_kept_map_is_read_back_as_it_was(place: Place, *, trusted: bool) -> None:
    flags: dict[str, Any] = {
        "flags": ("not_covered",),
        "notes": ("Half of it could hide a lump.",),
        "left_out": ("b.png has no place.",),
    }
    found = replace(map_of(3), trusted=trusted, provenance={"seed": 3}, **flags)
    assert np.isinf(found.untrusted.blind_diameter_mm).any()
    with place.open() as store:
        target, stored = kept(store, found)
        require_equal(stored.estimate, found)
    with place.open(create=False) as store:
        record = store.record(target)
        (read,) = record.maps
        assert record.map is read
        assert [press.id for press in record.presses] == list(read.presses)
        assert (read.options, read.made, read.calibration) == (OPTIONS, stored.made, stored.calibration)
        require_equal(read.estimate, found)
        assert verify_store(store).sound
        (summary,) = store.targets()
        assert (summary.presses, summary.estimates) == (3, 1)
    if not trusted:
        with pytest.raises(UntrustedError):
            assert read.estimate.lumps


def test_a_map_of_presses_that_are_not_stored_is_refused(store: Store) -> None:
    target, presses = pressed(store)
    other = store.add_target()
    given: dict[str, Any] = {"probe": "tsis-2011", "calibration": sample_calibration()}
    with pytest.raises(RecordsError, match="press must be stored before another record names it"):
        store.add_map(other, map_of(1), presses=presses, **given)
    assert store.record(target).maps == store.record(other).maps == ()


@pytest.mark.parametrize("name", ["target", "target.zip"])
def test_a_bundle_carries_a_map_into_another_store_bit_for_bit(tmp_path: Path, name: str) -> None:
    with open_store(tmp_path / "first") as store:
        target, first = kept(store, map_of(4))
        second = store.add_map(
            target,
            map_of(5),
            presses=store.presses(target),
            probe=PROBE,
            calibration=sample_calibration(),
            supersedes=first,
        )
        write_bundle(store.record(target), tmp_path / name)
        files = {path.name: path.read_bytes() for path in (tmp_path / "first" / "files").rglob("*.json")}
    with open_store(tmp_path / "second") as store:
        taken = store.import_target(read_bundle(tmp_path / name))
        assert (taken.presses, taken.estimates, taken.present) == (3, 2, 0)
        again = store.import_target(read_bundle(tmp_path / name))
        assert (again.presses, again.estimates, again.present, again.differing) == (0, 0, 5, 0)
        maps = store.record(taken.target).maps
        assert verify_store(store).sound
        assert files == {path.name: path.read_bytes() for path in (tmp_path / "second" / "files").rglob("*.json")}
    assert [(item.id, item.supersedes) for item in maps] == [(first.id, None), (second.id, first.id)]
    for item, seed in zip(maps, (4, 5), strict=True):
        require_equal(item.estimate, map_of(seed))


def test_a_bundle_without_map_has_no_file_of_maps(tmp_path: Path) -> None:
    with open_store(tmp_path / "store") as store:
        target, _ = pressed(store)
        write_bundle(store.record(target), tmp_path / "target")
    assert not (tmp_path / "target" / "maps.json").exists()
    assert read_bundle(tmp_path / "target").maps == ()


@pytest.mark.parametrize("name", ["maps.json", "maps/00000.json"])
def test_a_changed_missing_or_strange_file_of_a_map_in_a_bundle_is_named(tmp_path: Path, name: str) -> None:
    with open_store(tmp_path / "store") as store:
        target, _ = kept(store, map_of(6))
        write_bundle(store.record(target), tmp_path / "target")
    path = tmp_path / "target" / name
    whole = path.read_bytes()
    for content in (whole[:-5] + bytes([whole[-5] ^ 1]) + whole[-4:], whole[:-1], b"{}", b""):
        path.write_bytes(content)
        with pytest.raises(FileInputError, match=path.name):
            read_bundle(tmp_path / "target")
    path.unlink()
    with pytest.raises(FileInputError, match=path.name):
        read_bundle(tmp_path / "target")


def rewritten(folder: Path, change: Callable[[dict[str, Any]], None]) -> None:
    """A bundle whose map a hostile sender wrote anew, with hashes that fit."""
    path, manifest = folder / "maps" / "00000.json", folder / "manifest.json"
    document = json.loads(path.read_bytes())
    change(document)
    path.write_text(json.dumps(document))
    listed = json.loads(manifest.read_bytes())
    content = path.read_bytes()
    listed["files"]["maps/00000.json"] = {"sha256": hashlib.sha256(content).hexdigest(), "bytes": len(content)}
    del listed["sha256"]
    manifest.write_bytes(sealed_bytes(listed))


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("untrusted", "x_mm"), []),
        (("untrusted", "x_mm"), [0.0, "infinity"]),
        (("untrusted", "probability"), [[[0.5]]]),
        (("untrusted", "area_probability"), [[0.5]]),
        (("untrusted", "blind_diameter_mm"), [[[3.0]]]),
        (("untrusted", "modulus_kpa", "shape"), [10**7, 10**7, 10**7]),
        (("untrusted", "modulus_kpa", "zlib"), "eJwDAAAAAAE="),
        (("untrusted", "lumps", 0, "estimate", "untrusted", "samples"), {}),
        (("untrusted", "lumps", 0, "probability"), 2.0),
        (("untrusted", "lumps", 0, "estimate", "trusted"), False),
        (("untrusted", "unevenness"), None),
        (("untrusted", "unevenness", "untrusted"), {"samples": {"a": [1.0]}, "prior_sd": {"a": 1.0}}),
        (("places_mm",), [[1.0, 2.0, 3.0]]),
        (("place_shift_mm",), [[0.0, 0.0]]),
        (("trusted",), "yes"),
        (("provenance",), [1]),
        (("more",), 1),
    ],
)
def test_a_hostile_map_is_refused_in_one_sentence(tmp_path: Path, path: tuple[str | int, ...], value: object) -> None:
    with open_store(tmp_path / "store") as store:
        target, _ = kept(store, map_of(6))
        write_bundle(store.record(target), tmp_path / "target")

    def change(document: Any) -> None:
        for step in path[:-1]:
            document = document[step]
        document[path[-1]] = value

    rewritten(tmp_path / "target", change)
    with pytest.raises(FileInputError) as refused:
        read_bundle(tmp_path / "target")
    assert "maps/00000.json" in str(refused.value)
    assert "\n" not in str(refused.value)


def damage_file(folder: Path) -> None:
    largest = max((folder / "files").rglob("*.json"), key=lambda path: path.stat().st_size)
    content = bytearray(largest.read_bytes())
    content[len(content) // 2] ^= 1
    largest.write_bytes(content)


def remove_file(folder: Path) -> None:
    max((folder / "files").rglob("*.json"), key=lambda path: path.stat().st_size).unlink()


def sql(statement: str) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        with closing(sqlite3.connect(folder / "records.sqlite3")) as connection, connection:
            connection.execute(statement)

    return change


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (damage_file, "must be as it was stored"),
        (remove_file, "must be there, and is missing"),
        (sql("UPDATE maps SET options = 'none'"), "options must hold what this program wrote"),
        (sql("UPDATE maps SET options = '{\"prior\": 3}'"), "must be a mapping of names to values"),
        (sql("UPDATE maps SET made = 'yesterday'"), "must be a date and time"),
        (sql("UPDATE maps SET file = (SELECT file FROM calibrations)"), "must hold all of its values"),
        (sql("UPDATE maps SET file = '../../etc/passwd'"), "must be named by a SHA-256"),
    ],
)
def test_a_damaged_map_is_told_in_one_sentence_and_nothing_else_is_lost(
    tmp_path: Path, change: Callable[[Path], None], sentence: str
) -> None:
    with open_store(tmp_path / "store") as store:
        target, _ = kept(store, map_of(7))
    change(tmp_path / "store")
    with open_store(tmp_path / "store") as store:
        record = store.record(target)
        (message,) = record.damaged
        assert sentence in message
        assert "\n" not in message
        assert (len(record.presses), record.maps) == (3, ())
        assert f"Left out: {message}." in target_page(record).notes
        assert verify_store(store).faults
        with pytest.raises(RecordsError) as refused:
            recompute(store, target)
        assert str(refused.value) == message


def test_the_map_of_an_erased_target_goes_and_one_that_another_target_has_stays(tmp_path: Path) -> None:
    with open_store(tmp_path / "store") as store:
        gone, stays = kept(store, map_of(8), name="gone")[0], kept(store, map_of(8), name="stays")[0]
        alone, _ = kept(store, map_of(9), name="alone")
        old = (datetime.now(UTC) - timedelta(days=1)).timestamp()
        for path in (tmp_path / "store" / "files").rglob("*.json"):
            os.utime(path, (old, old))
        for target in (gone, alone):
            store.set_state(target, DELETED)
        assert store.erase_expired(now=datetime.now(UTC) + timedelta(days=UNDO_DAYS + 1)) == 2
        require_equal(store.record(stays).maps[0].estimate, map_of(8))
        assert verify_store(store).sound
        assert len(list((tmp_path / "store" / "files").rglob("*.json"))) == 2  # that map, and the calibration


def test_the_page_of_a_target_shows_its_lumps(tmp_path: Path) -> None:
    with open_store(tmp_path / "store") as store:
        target, _ = kept(store, replace(map_of(10), flags=("not_covered",), notes=("A lump could hide there.",)))
        page = target_page(store.record(target))
    text = html_bytes(page).decode()
    for part in ("Lumps, 90 % intervals", "lump 1", "Where to press next", "not_covered", "A lump could hide there."):
        assert part in text
    assert "Research use only" in text
    assert "Mapped " in text
    assert {"Plan view", "Sections", "Blind zone"} <= {picture.title for picture in page.pictures}
    (history,) = [table for table in page.tables if table.title.startswith("All estimates")]
    (row,) = history.rows
    assert row[2] == "map"
    assert row[4].startswith("lump 1: ")


def test_tables_have_a_row_for_each_lump_and_parameter(tmp_path: Path) -> None:
    with open_store(tmp_path / "store") as store:
        target, first = kept(store, map_of(10))
        given: dict[str, Any] = {"probe": PROBE, "calibration": sample_calibration(), "supersedes": first}
        withheld = replace(map_of(9), trusted=False, flags=("map_does_not_fit",), notes=("It does not fit.",))
        store.add_map(target, withheld, presses=store.presses(target), **given)
        files = csv_files(store.record(target))
    assert b"maps.csv" in files["README.txt"]
    rows = list(csv.DictReader(files["maps.csv"].decode("utf-8-sig").splitlines()))
    (lump,) = map_of(10).lumps
    assert [row["parameter"] for row in rows] == [*lump.estimate.names, ""]
    for row in rows[:-1]:
        low, high = lump.estimate.interval(0.9)[row["parameter"]]
        assert float(row["90% interval from (in unit)"]) == low
        assert float(row["90% interval to (in unit)"]) == high
        assert (row["lump"], row["trusted"], row["in force"]) == ("lump 1", "yes", "no")
    assert (rows[-1]["trusted"], rows[-1]["in force"], rows[-1]["flags"]) == ("no", "yes", "map_does_not_fit")


def test_the_page_shows_no_number_of_a_map_that_is_withheld(tmp_path: Path) -> None:
    with open_store(tmp_path / "store") as store:
        target, _ = kept(
            store, replace(map_of(10), trusted=False, flags=("map_does_not_fit",), notes=("It does not fit.",))
        )
        page = target_page(store.record(target))
    assert [table for table in page.tables if table.title.startswith("Lumps")] == []
    assert [card.value for card in page.cards] == ["withheld"]
    assert "not to be trusted" in html_bytes(page).decode()


def test_the_page_of_a_subject_holds_no_name_of_a_map(tmp_path: Path) -> None:
    found = replace(
        map_of(11),
        flags=("presses_left_out", "Jane"),
        notes=("1 of 4 presses was left out: Jane 3.png has no place.", "Jane."),
        left_out=("Jane 3.png has no place.",),
        provenance={"scan": "Jane", "tsis": "0.1.0"},
    )
    lump = found.untrusted.lumps[0]
    lump = replace(
        lump, name="Jane", estimate=replace(lump.estimate, notes=("Jane",), prior="Jane", provenance={"by": "Jane"})
    )
    found = replace(found, untrusted=replace(found.untrusted, lumps=(lump,)))
    with open_store(tmp_path / "store", kind="subject") as store:
        target, _ = kept(store, found, name="Jane")
        target = store.edit_target(target, name="S-7")
        page = target_page(store.record(target))
    text = html_bytes(page).decode()
    assert "lump 1" in text
    assert "Jane" not in text


@pytest.fixture(scope="module")
def mapped(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store with the scan of a tray and its map, as the command keeps it."""
    folder, store = write_tray(tmp_path_factory.mktemp("scans") / "tray"), tmp_path_factory.mktemp("stores") / "store"
    known = tray_calibration()
    usable = UsableCalibration(calibration=known, identity=calibration_sha256(known))
    scan, response = calibrated(read_scan(folder, mm_per_pixel=PIXELS).scan, usable)
    settings: dict[str, Any] = {"voxel_mm": 5.0, "seed": 1, "steps": 1000}
    found = estimate_map(scan, probe=load_probe(PROBE), calibration=response, prior=MapPrior(), **settings)
    options = ImportOptions(mm_per_pixel=PIXELS, probe=PROBE, calibration=known)
    with open_store(store) as opened:
        saved = save_map(
            opened,
            None,
            found=found,
            scan=scanned(folder, options, lambda: None),
            probe=PROBE,
            calibration=known,
            options={"prior": asdict(MapPrior()), "left_out": scan.left_out} | settings,
        )
        (stored,) = opened.record(opened.target(1)).maps
        assert saved["map"] == stored.id
        require_equal(replace(stored.estimate, provenance={}), replace(found, provenance={}))
        assert stored.estimate.left_out == ("absent.png has no place.",)
    return store


@pytest.fixture
def scans(mapped: Path, tmp_path: Path) -> Iterator[Store]:
    """A copy of that store."""
    with open_store(shutil.copytree(mapped, tmp_path / "copy"), create=False) as opened:
        yield opened


def test_a_map_made_again_is_the_same_bit_for_bit_and_not_stored(scans: Store) -> None:
    (again,) = recompute(scans, scans.target(1))
    assert again.message == "Nothing changed: bit for bit the same."
    assert {shift.moved for shift in again.shifts} <= {0.0, None}
    assert "lump 1, x_mm" in {shift.name for shift in again.shifts}
    assert (again.stored, again.causes, again.notes) == (False, (), ())
    assert len(scans.record(scans.target(1)).maps) == 1


def test_a_force_that_was_corrected_moves_the_map_and_is_named(scans: Store) -> None:
    target = scans.target(1)
    press = next(press for press in scans.presses(target) if press.name == "press-0.png")
    scans.edit_press(press, force_n=1.05)
    (dry,) = recompute(scans, target, dry_run=True)
    assert not dry.same
    assert not dry.stored
    (again,) = recompute(scans, target)
    assert again.causes == ("the inputs changed: force_n of press-0.png: 1 -> 1.05",)
    assert again.message == f"The result changed: {again.causes[0]}."
    assert any(shift.moved for shift in again.shifts)
    first, second = scans.record(target).maps
    assert (second.id, second.supersedes) == (again.after.id, first.id)
    assert verify_store(scans).sound


def test_a_map_is_made_again_at_the_strain_that_it_was_made_with(scans: Store) -> None:
    target = scans.target(1)
    record = scans.record(target)
    usable = recorded_calibration(record)
    assert usable is not None
    kept_as: dict[str, Any] = {"presses": placed_presses(record), "probe": PROBE, "calibration": usable.calibration}
    scans.add_map(target, map_of(1), options={"strain": "finite"}, **kept_as)
    with pytest.raises(InputError, match=r"force_n must lie between 0 and .* for strain 'finite'"):  # 1 N is beyond it
        recompute(scans, target)


def test_the_scan_of_a_kept_map_is_mapped_again_though_its_map_has_another_calibration(scans: Store) -> None:
    target = scans.target(1)
    record = scans.record(target)
    usable = recorded_calibration(record)
    assert usable is not None
    other = replace(usable.calibration, name="another")
    scans.add_map(target, map_of(1), presses=placed_presses(record), probe=PROBE, calibration=other)
    record = scans.record(target)
    assert len(record.calibrations) == 2
    assert recorded_calibration(record) == usable
    assert recorded_scan(record).probe == PROBE
