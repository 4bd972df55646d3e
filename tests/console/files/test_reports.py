"""Reports from a process of their own, held against those that are made here."""

from __future__ import annotations

import io
import os
import shutil
import zipfile
from contextlib import closing
from dataclasses import replace
from typing import TYPE_CHECKING

import cv2
import numpy as np
import pytest
from tests.console.files_client import FilesOf
from tests.present.rough_pictures import rough_pictures
from tests.records.sample import sample_record

from tsis.console.files import Reports, write_export
from tsis.errors import InputError, RecordsError
from tsis.files.images import encode_picture
from tsis.present.records import PAGE_FORMS, StoreAddress, page_bytes, report_of_stored_target
from tsis.records.store import open_store

if TYPE_CHECKING:
    from pathlib import Path

NUMBER = 3


@pytest.mark.slow
def test_a_report_is_made_elsewhere_and_is_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with open_store(tmp_path / "records") as store, closing(Reports(store)) as reports:
        store.import_target(sample_record())
        target = store.target(NUMBER)
        here = {form: page_bytes(form, store.record(target)) for form in PAGE_FORMS}
        monkeypatch.setattr("tsis.present.target.target_page", lambda *_: pytest.fail("it is made in this process"))
        for form, content in here.items():
            file = write_export(store, target, form, reports=reports)
            assert file.read_bytes() == content
            shutil.rmtree(file.parent)
        assert reports._worker.call(os.getpid) != os.getpid()
        with pytest.raises(InputError, match="got 9"):
            reports.content(replace(target, number=9), "html")
        target = store.edit_target(target, name="what was just written")
        assert b"what was just written" in reports.content(target, "html")


def test_another_store_in_its_place_is_not_taken_for_it(tmp_path: Path) -> None:
    with open_store(tmp_path) as store:
        store.import_target(sample_record())
        position = StoreAddress(folder=tmp_path, kind=store.kind, database=None, identity=store.identity)
    with rough_pictures():
        report = report_of_stored_target(position, NUMBER, "html")
    assert report.startswith(b"<!DOCTYPE html>")
    with pytest.raises(RecordsError, match="the store must be 000"):
        report_of_stored_target(replace(position, identity="0" * 32), NUMBER, "html")
    with pytest.raises(RecordsError, match="there is none"):
        report_of_stored_target(replace(position, folder=tmp_path / "elsewhere"), NUMBER, "html")


def test_a_frame_of_a_sequence_is_shown_and_nothing_else(tmp_path: Path) -> None:
    folder = tmp_path / f"Target{NUMBER}" / "sequence"
    folder.mkdir(parents=True)
    dark, light = (np.full((48, 64), level, np.uint8) for level in (10, 240))
    for number, levels in enumerate((dark, light)):
        (folder / f"frame-{number:06d}.png").write_bytes(encode_picture(levels))
    with open_store(tmp_path / "records") as store:
        store.import_target(sample_record())
        files = FilesOf(store, workspace=tmp_path)
        shown = [files.get(f"/files/sequence/{NUMBER}/sequence/{number}.png?size=64") for number in (0, 1)]
        assert [item.status_code for item in shown] == [200, 200]
        pictures = [cv2.imdecode(np.frombuffer(item.content, np.uint8), cv2.IMREAD_COLOR) for item in shown]
        assert pictures[0] is not None
        assert pictures[1] is not None
        assert pictures[0].shape == pictures[1].shape == (48, 64, 3)
        assert pictures[0].mean() < 100 < pictures[1].mean()  # viridis grows from violet to yellow
        for wrong in ("sequence/2", "sequence/-1", "other/0", "%2e%2e/0"):
            assert files.get(f"/files/sequence/{NUMBER}/{wrong}.png").status_code == 404
        assert FilesOf(store).get(f"/files/sequence/{NUMBER}/sequence/0.png").status_code == 404


def test_a_recorded_sequence_is_downloaded_and_nothing_else_of_its_folder(tmp_path: Path) -> None:
    workspace = tmp_path / "workspace"
    folder = workspace / f"Target{NUMBER}" / "sequence-2"
    folder.mkdir(parents=True)
    (folder / "frame-000001.raw").write_bytes(b"frame")
    (folder.parent / "other").mkdir()
    with open_store(tmp_path / "records") as store:
        store.import_target(sample_record())
        files = FilesOf(store, workspace=workspace)
        sent = files.get(f"/files/sequence/{NUMBER}/sequence-2.zip")
        assert sent.status_code == 200
        assert sent.headers["content-disposition"] == f'attachment; filename="target-{NUMBER}-sequence-2.zip"'
        with zipfile.ZipFile(io.BytesIO(sent.content)) as archive:
            assert archive.read("sequence-2/frame-000001.raw") == b"frame"
        for name in ("other", "sequence-3", "..", "%2e%2e", "sequence-2%2f..%2fother"):
            assert files.get(f"/files/sequence/{NUMBER}/{name}.zip").status_code == 404
        assert files.get("/files/sequence/99/sequence-2.zip").status_code == 404
        assert FilesOf(store).get(f"/files/sequence/{NUMBER}/sequence-2.zip").status_code == 404
