"""Scans that a tab opens, and maps below a workspace."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tests.present.test_lump_map import map_of as made_up_map
from tests.records.sample import WHEN, levels
from tests.records.stored_tray import PROBE, pressed, require_equal
from tests.waiting import HANGS_S

from tsis.console.services import maps as module
from tsis.console.services.jobs import DONE, Jobs
from tsis.console.services.maps import RESULT, MapQuestion, MapRepository, OpenedScan, map_of
from tsis.console.statuses import AbsentError
from tsis.errors import InputError, RecordsError
from tsis.mapping.prior import MapPrior
from tsis.model.image import TactileImage
from tsis.records.reader import DELETED
from tsis.records.store import open_store

if TYPE_CHECKING:
    from pathlib import Path

    from tsis.mapping.lump_map import LumpMap
    from tsis.records.store import Store

TABLE = "press,x_mm,y_mm,travel_mm,force_n\n"


def test_a_map_is_kept_under_a_name_of_its_own(tmp_path: Path) -> None:
    maps = MapRepository(tmp_path)
    assert maps.names() == ()
    files = {RESULT: b"{}", "map.vti": b"volume"}
    kept = [maps.keep(name, files) for name in ("left side", "left side", "../x", "…")]
    assert kept == ["left-side", "left-side-2", "x", "scan"]
    assert set(maps.names()) == set(kept)
    assert maps.files("left-side") == ["map.vti", "result.json"]
    assert maps.content("left-side", "map.vti") == b"volume"
    assert {path.parent for path in tmp_path.rglob("*.vti")} == {tmp_path / "maps" / name for name in kept}


@pytest.mark.parametrize("name", ["..", ".", "", "a/b", "absent", "left-side\n", "x" * 81])
def test_other_names_are_no_maps(tmp_path: Path, name: str) -> None:
    (tmp_path / RESULT).write_bytes(b"{}")  # beside the folder of maps
    maps = MapRepository(tmp_path)
    maps.keep("left-side", {RESULT: b"{}"})
    with pytest.raises(AbsentError, match="map must be one of this console's"):
        maps.files(name)


@pytest.mark.parametrize("file", ["..", "../../result.json", "absent.vti", ""])
def test_other_files_are_not_of_a_map(tmp_path: Path, file: str) -> None:
    maps = MapRepository(tmp_path)
    maps.keep("one", {RESULT: b"{}"})
    with pytest.raises(AbsentError, match="file must be one of map 'one'"):
        maps.content("one", file)


def test_a_workspace_that_is_a_file_is_said(tmp_path: Path) -> None:
    (tmp_path / "maps").write_text("no folder")
    with pytest.raises(RecordsError, match="folder of maps must be"):
        MapRepository(tmp_path).names()
    with pytest.raises(RecordsError, match="folder of maps must be"):
        MapRepository(tmp_path).keep("one", {RESULT: b"{}"})


def test_a_map_is_not_done_before_it_is_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "calibrated", lambda scan, _: (scan, None))
    monkeypatch.setattr(module, "estimate_map", lambda *_, progress, **__: progress(78, 78))
    monkeypatch.setattr(module, "guide_page", lambda *_, **__: None)
    stored: Any = SimpleNamespace(scan=SimpleNamespace(presses=()))
    start: Any = object()
    question = MapQuestion(stored=stored, probe="", calibration=None, prior=MapPrior(), start=start)
    jobs = Jobs()
    shown: list[float] = []

    def draw(_: object) -> tuple[str, ...]:
        shown.extend(state.fraction for state in jobs.states())
        return ()

    job = jobs.begin("map", map_of(question, MapRepository(tmp_path), draw))
    assert job.wait(HANGS_S)
    assert job.state().status == DONE
    assert all(0.9 < fraction < 1.0 for fraction in shown)
    assert len(shown) == 1


def mapped_target(store: Store, opened: OpenedScan, workspace: Path, *, start: Any = None) -> str:
    """Map the opened scan of a target, and give what the job says."""
    scan = opened.of_target()
    assert scan is not None
    question = MapQuestion(
        stored=scan.stored,
        probe=PROBE,
        calibration=scan.calibration,
        prior=MapPrior(),
        start=start,
        of_target=scan,
    )
    job = Jobs().begin("map", map_of(question, MapRepository(workspace), lambda _: ()))
    assert job.wait(HANGS_S)
    return job.state().sentence


@pytest.fixture
def answered(monkeypatch: pytest.MonkeyPatch) -> LumpMap:
    """The map that every estimate finds."""
    found = made_up_map(3)
    monkeypatch.setattr(module, "calibrated", lambda scan, _: (scan, None))
    monkeypatch.setattr(module, "estimate_map", lambda *_, **__: found)
    return found


def test_the_map_of_a_target_is_kept_there_but_not_that_of_an_update(tmp_path: Path, answered: LumpMap) -> None:
    with open_store(tmp_path / "store") as store:
        target, presses = pressed(store)
        opened = OpenedScan()
        opened.open_target(store, target.number)
        assert opened.read(None, None).scan.places_mm.tolist() == [[0.0, 0.0], [9.0, 0.0], [18.0, 0.0]]
        assert mapped_target(store, opened, tmp_path) == f"Kept as map tray and in target {target.number}."
        mapped_target(store, opened, tmp_path, start=answered)
        (kept,) = store.record(target).maps
        require_equal(replace(kept.estimate, provenance={}), answered)
        assert list(kept.presses) == [press.id for press in presses]
        assert {"prior", "seed", "steps", "voxel_mm"} <= set(kept.options)
        (folder,) = (tmp_path / "maps").iterdir()
        assert (folder / RESULT).is_file()
        version = opened.version()
        store.add_press(target, TactileImage(grey=levels(7), name="one more"), taken=WHEN)
        assert opened.version() != version
        opened.clear()
        assert not opened.chosen


def test_a_target_without_places_or_that_is_absent_is_refused(tmp_path: Path) -> None:
    with open_store(tmp_path / "store") as store:
        store.add_target()
        opened = OpenedScan()
        with pytest.raises(InputError, match="target must be a number that this store"):
            opened.open_target(store, 2)
        opened.open_target(store, 1)
        with pytest.raises(RecordsError, match="must have presses with a place"):
            opened.read(None, None)


def test_the_map_of_a_subject_names_no_file(tmp_path: Path, answered: LumpMap) -> None:
    with open_store(tmp_path / "store", kind="subject") as store:
        target, _ = pressed(store, "S-1")
        opened = OpenedScan()
        opened.open_target(store, target.number)
        assert [press.name for press in opened.read(None, None).scan.presses] == ["press 1", "press 2", "press 3"]
        mapped_target(store, opened, tmp_path)
        (folder,) = (tmp_path / "maps").iterdir()
        assert not [file for file in folder.iterdir() if b"of S-1 0.png" in file.read_bytes()]


def test_a_map_that_its_target_cannot_keep_stays_and_is_named(tmp_path: Path, answered: LumpMap) -> None:
    with open_store(tmp_path / "store") as store:
        target, _ = pressed(store)
        opened = OpenedScan()
        opened.open_target(store, target.number)
        scan = opened.of_target()
        assert scan is not None
        store.set_state(target, DELETED)
        said = mapped_target(store, opened, tmp_path)
        assert said.startswith("the map is kept as map tray, but not in target 1: target 1 must not be deleted")
        assert store.record(target).maps == ()
        assert MapRepository(tmp_path).names() == ["tray"]


def test_uploaded_files_become_one_scan() -> None:
    opened = OpenedScan()
    with pytest.raises(InputError, match="a scan must be chosen first"):
        opened.read(None, None)
    table = opened.uploads / "robot.csv"
    table.write_text(TABLE)
    opened.uploaded(table)
    assert opened.source == table
    poses = opened.uploads / "poses.csv"
    poses.write_text("file,x_mm,y_mm\n")
    opened.uploaded(poses)
    assert opened.source == opened.uploads
    opened.clear()
    with pytest.raises(InputError, match="a scan must be chosen first"):
        opened.read(None, None)
    assert list(opened.uploads.iterdir()) == []
    for name in ("first.csv", "second.csv"):  # another table takes the place of the one before
        (opened.uploads / name).write_text(TABLE)
        opened.uploaded(opened.uploads / name)
    assert opened.source == opened.uploads / "second.csv"


def test_a_simulated_scan_is_read_as_a_user_s() -> None:
    opened = OpenedScan()
    for seed in (3, 4):  # the second replaces the first
        opened.simulate(seed)
    stored = opened.read(None, None)
    assert opened.simulated
    assert stored.probe == "tsis-2011"
    assert len(stored.scan.presses) == 25


def test_a_press_of_the_virtual_probe_adds_to_the_scan_and_changes_no_other() -> None:
    opened = OpenedScan()
    opened.simulate(5)
    before, version = opened.read(None, None).scan, opened.version()
    opened.press_at((3.5, -7.0))
    after = opened.read(None, None).scan
    assert opened.version() != version
    assert after.presses[-1].place_mm == (3.5, -7.0)
    assert len(after.presses) == len(before.presses) + 1
    for was, now in zip(before.presses, after.presses, strict=False):
        assert was.place_mm == now.place_mm
        np.testing.assert_array_equal(np.asarray(was.pressure_kpa), np.asarray(now.pressure_kpa))


def test_the_virtual_probe_presses_no_scan_of_a_user(tmp_path: Path) -> None:
    opened = OpenedScan()
    opened.open(tmp_path)
    assert opened.version() == 0  # no table of places yet
    with pytest.raises(InputError, match="simulated scan must be open"):
        opened.press_at((0.0, 0.0))
