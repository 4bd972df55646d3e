"""A snapshot that was just taken gets into a store as an import of its files would bring it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from tests.records.importing.snapshot_folder import save
from tests.records.sample import sample_calibration

from tsis.calibration.file import calibration_sha256, write_calibration
from tsis.calibration.frames import load_calibration
from tsis.errors import FileInputError
from tsis.records.importing import import_batches, save_snapshot_to_store
from tsis.records.sources import ImportOptions, find_import_batches
from tsis.records.store import open_store

if TYPE_CHECKING:
    from pathlib import Path


def test_it_is_kept_as_an_import_brings_it(tmp_path: Path) -> None:
    saved = save(tmp_path / "camera", 1)
    with open_store(tmp_path / "here") as here, open_store(tmp_path / "imported") as imported:
        said = save_snapshot_to_store(here, saved.sidecar, role="plain", probe="tsis-domed", calibration=None)
        (entered,) = import_batches(
            imported, find_import_batches([tmp_path / "camera"], ImportOptions(role="plain", probe="tsis-domed"))
        )
        (press,), (other,) = here.presses(here.target(3)), imported.presses(entered.target)
        assert (said["target"], said["press"]) == (3, press.id)
        assert said["store"] == str((tmp_path / "here").resolve())
        for name in ("role", "probe", "frame", "taken", "force_n", "flags", "calibration", "settings"):
            assert getattr(press, name) == getattr(other, name), name


def test_the_calibration_tells_the_probe_and_is_kept_with_it(tmp_path: Path) -> None:
    known = sample_calibration()
    write_calibration(known, tmp_path / "calibration.json")
    with_it = load_calibration(tmp_path / "calibration.json")
    saved = save(tmp_path / "camera", 1, calibration=with_it.citation())
    with open_store(tmp_path / "records") as store:
        said = save_snapshot_to_store(store, saved.sidecar, role="target", probe="tsis-domed", calibration=with_it)
        (press,) = store.presses(store.target(3))
        assert press.probe == known.probe == "tsis-2011"
        assert calibration_sha256(store.calibration(press.calibration or "")) == with_it.identity
        assert said["notes"] == []


def test_a_sidecar_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with open_store(tmp_path / "records") as store:
        with pytest.raises(FileInputError, match=r"absent\.json"):
            save_snapshot_to_store(store, tmp_path / "absent.json", role="target", probe="", calibration=None)
        assert store.targets() == ()
