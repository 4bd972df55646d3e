"""Files by their addresses: pictures, reports and exports, made in a process of their own, and what fails."""

from __future__ import annotations

import hashlib
import io
import os
import shutil
import tempfile
import zipfile
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import quote

import cv2
import matplotlib as mpl
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from tests.console.files_client import FilesOf
from tests.console.filled_store import fill
from tests.present.pdf_readers import sheets
from tests.present.rough_pictures import rough_pictures
from tests.records.sample import levels, sample_record

from tsis.console import files as exporting
from tsis.console.files import Reports, thumbnail_png, write_export
from tsis.errors import InputError, MissingExtraError, RecordsError
from tsis.files.images import encode_picture
from tsis.present.html import html_bytes
from tsis.present.records import ENDINGS, PAGE_FORMS, StoreAddress, page_bytes, report_of_stored_target
from tsis.present.target import target_page
from tsis.records.store import open_store
from tsis.records.target import read_bundle

if TYPE_CHECKING:
    from collections.abc import Iterator

    import httpx

    from tsis.records.store import Store


NUMBER = 3  # of the sample's target
PRESS = "press-1"


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Store]:
    with open_store(tmp_path_factory.mktemp("files") / "store") as opened:
        opened.import_target(sample_record())
        yield opened


@pytest.fixture(scope="module")
def client(store: Store) -> FilesOf:
    return FilesOf(store)


@pytest.fixture
def exports(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where folders of exports are made while a test runs."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


def picture(answer: httpx.Response) -> np.ndarray:
    assert answer.status_code == 200, answer.text
    assert answer.headers["content-type"] == "image/png"
    return np.asarray(Image.open(io.BytesIO(answer.content)))


def test_a_small_picture_is_the_mean_of_the_pixels_under_it(client: FilesOf) -> None:
    frame = levels(1, height=0.5).astype(float)
    shown = picture(client.get(f"/files/press/{NUMBER}/{PRESS}.png?size=75&map=grey"))
    means = frame.reshape(48, 2, 75, 2).mean(axis=(1, 3))
    np.testing.assert_allclose(shown, means, atol=0.51)


@pytest.mark.parametrize("name", ["viridis", "inferno", "cividis"])
def test_colours_are_those_of_the_map_that_was_asked_for(client: FilesOf, name: str) -> None:
    grey = picture(client.get(f"/files/press/{NUMBER}/{PRESS}.png?size=150&map=grey"))
    shown = picture(client.get(f"/files/press/{NUMBER}/{PRESS}.png?size=150&map={name}"))
    expected = np.rint(255 * mpl.colormaps[name](grey)[..., :3])
    assert np.abs(shown.astype(float) - expected).max() <= 4  # tables of both libraries are rounded


@given(
    rows=st.integers(1, 40),
    columns=st.integers(1, 40),
    size=st.integers(16, 64),
    full_scale=st.sampled_from([255.0, 1023.0, 65535.0]),
)
def test_a_picture_keeps_the_shape_of_its_frame(rows: int, columns: int, size: int, full_scale: float) -> None:
    frame = np.full((rows, columns), int(full_scale) // 2, dtype=np.uint16)
    shown = Image.open(io.BytesIO(thumbnail_png(frame, full_scale=full_scale, size=size, name="grey")))
    assert max(shown.size) == min(size, max(rows, columns))
    if max(rows, columns) <= size:
        assert shown.size == (columns, rows)
    assert set(np.unique(np.asarray(shown))) <= {127, 128}


def test_a_browser_asks_each_time_and_gets_a_frame_once(client: FilesOf, store: Store) -> None:
    address = f"/files/press/{NUMBER}/{PRESS}.png"
    first = client.get(address)
    assert first.headers["cache-control"] == "private, no-cache"  # after a logout it shows nothing that it kept
    assert store.press(store.target(NUMBER), PRESS).frame in first.headers["etag"]
    again = client.get(address, headers={"If-None-Match": first.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")
    other = client.get(f"{address}?size=32", headers={"If-None-Match": first.headers["etag"]})
    assert other.status_code == 200


def test_the_report_is_the_one_that_the_library_writes(client: FilesOf, store: Store, exports: Path) -> None:
    with rough_pictures():
        answer = client.get(f"/files/report/{NUMBER}.html")
        library = html_bytes(target_page(store.record(store.target(NUMBER))))
    assert answer.headers["content-type"] == "text/html; charset=utf-8"
    assert answer.headers["content-disposition"] == 'inline; filename="target-3.html"'
    assert answer.content == library
    assert not list(exports.iterdir())


@pytest.mark.system
def test_the_report_on_paper_opens_in_another_program(client: FilesOf, tmp_path: Path) -> None:
    answer = client.get(f"/files/report/{NUMBER}.pdf")
    assert answer.headers["content-disposition"] == 'attachment; filename="target-3.pdf"'
    assert "Target 3: size-10" in sheets(answer.content, tmp_path)[0]


@pytest.mark.parametrize("form", [form for form in ENDINGS if form not in PAGE_FORMS])
def test_every_form_comes_as_one_file_and_nothing_stays_behind(client: FilesOf, exports: Path, form: str) -> None:
    answer = client.get(f"/files/export/{NUMBER}/{form}")
    assert answer.status_code == 200, answer.text
    assert answer.headers["content-disposition"].startswith('attachment; filename="target-3')
    assert answer.headers["cache-control"] == "private, no-store"
    assert not list(exports.iterdir())


def test_a_folder_comes_packed_with_all_that_is_in_it(client: FilesOf) -> None:
    packed = zipfile.ZipFile(io.BytesIO(client.get(f"/files/export/{NUMBER}/csv").content))
    names = [name for name in packed.namelist() if not name.endswith("/")]
    assert "target-3-csv/presses.csv" in names
    assert sum(name.endswith(".png") for name in names) == 4
    assert all(name.startswith("target-3-csv/") for name in names)


def test_a_bundle_can_be_read_again(client: FilesOf, tmp_path: Path) -> None:
    path = tmp_path / "bundle.zip"
    path.write_bytes(client.get(f"/files/export/{NUMBER}/bundle").content)
    assert read_bundle(path).target == sample_record().target


def test_names_are_told_only_where_they_were_asked_for(client: FilesOf) -> None:
    masked, identified = (
        zipfile.ZipFile(io.BytesIO(client.get(f"/files/export/{NUMBER}/dicom{query}").content))
        for query in ("", "?identified=true")
    )
    assert not any(b"size-10" in masked.read(name) for name in masked.namelist())
    assert any(b"size-10" in identified.read(name) for name in identified.namelist())


@pytest.mark.parametrize(
    ("address", "status", "message"),
    [
        ("press/3/nobody.png", 404, "press must be one of target 3; got 'nobody'"),
        ("press/7/press-1.png", 404, "got 7"),
        ("press/3/press-1.png?map=jet", 422, "colour map"),
        ("report/7.html", 404, "got 7"),
        ("report/3.doc", 404, "form of report"),
        ("report/3.csv", 404, "form of report"),
        ("report/-3.html", 404, "got '-3'"),
        ("report/3e0.html", 404, "got '3e0'"),
        ("report/٣.html", 404, "must be a number"),
        (f"report/{'9' * 5000}.pdf", 404, "must be a number"),
        ("export/3/exe", 404, "form of export"),
        ("export/3/csv?identified=true", 422, "masks nothing"),
        ("export/0/csv", 404, "target must"),
    ],
)
def test_what_cannot_be_had_is_told_in_one_sentence(client: FilesOf, address: str, status: int, message: str) -> None:
    answer = client.get(f"/files/{address}")
    assert answer.status_code == status
    assert answer.headers["content-type"] == "text/plain; charset=utf-8"
    assert message in answer.text
    assert "\n" not in answer.text


@pytest.mark.parametrize("size", ["15", "1025", "x", "nan", "1e2", ""])
def test_a_size_that_is_none_is_refused(client: FilesOf, size: str) -> None:
    assert client.get(f"/files/press/{NUMBER}/{PRESS}.png?size={size}").status_code == 422


@given(st.text(max_size=40), st.text(max_size=40))
def test_no_name_leads_to_a_file_or_to_a_fault(client: FilesOf, target: str, press: str) -> None:
    for address in (f"press/{quote(target, safe='')}/{quote(press, safe='')}.png", f"report/{quote(target)}.html"):
        answer = client.get(f"/files/{address}")
        assert answer.status_code in (404, 307) or target.strip() == "3"


@pytest.mark.parametrize(
    "address",
    [
        "press/../../../../etc/passwd",
        "press/3/..%2f..%2f..%2fetc%2fpasswd.png",
        "report/..%2f3.html",
        "export/3/..%2fcsv",
    ],
)
def test_paths_lead_nowhere(client: FilesOf, address: str) -> None:
    answer = client.get(f"/files/{address}")
    assert answer.status_code == 404
    assert "root:" not in answer.text


def test_a_damaged_frame_has_no_picture_and_stops_no_other(tmp_path: Path) -> None:
    with open_store(tmp_path / "store") as store:
        store.import_target(sample_record())
        press = store.press(store.target(NUMBER), PRESS)
        file = store.blobs.path(press.frame, "png")
        content = bytearray(file.read_bytes())
        content[len(content) // 2] ^= 1
        file.write_bytes(bytes(content))
        client = FilesOf(store)
        damaged = client.get(f"/files/press/{NUMBER}/{PRESS}.png")
        assert (damaged.status_code, damaged.headers["content-type"]) == (503, "text/plain; charset=utf-8")
        assert "must be as it was stored" in damaged.text
        assert damaged.headers["cache-control"] == "private, no-store"
        assert client.get(f"/files/press/{NUMBER}/press-0.png").status_code == 200
        report = client.get(f"/files/report/{NUMBER}.html")
        assert report.status_code == 200
        assert "cannot be shown" in report.text
        assert client.get(f"/files/export/{NUMBER}/csv").status_code == 503


def test_a_missing_library_is_named(client: FilesOf, monkeypatch: pytest.MonkeyPatch) -> None:
    def without(*_: object, **__: object) -> str:
        raise MissingExtraError("writing netCDF needs h5netcdf; install tsis[analysis]")

    monkeypatch.setattr(exporting, "write_form", without)
    answer = client.get(f"/files/export/{NUMBER}/netcdf")
    assert (answer.status_code, answer.text) == (501, "writing netCDF needs h5netcdf; install tsis[analysis]")


def test_a_full_disk_is_told_and_leaves_nothing(
    client: FilesOf, exports: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object, **__: object) -> str:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(shutil, "make_archive", full)
    answer = client.get(f"/files/export/{NUMBER}/csv")
    assert (answer.status_code, "No space left on device" in answer.text) == (507, True)
    assert not list(exports.iterdir())


def test_the_same_address_gives_the_same_picture(client: FilesOf) -> None:
    sums = {hashlib.sha256(client.get(f"/files/press/{NUMBER}/{PRESS}.png").content).hexdigest() for _ in range(3)}
    assert len(sums) == 1


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
    for number, pixels in enumerate((dark, light)):
        (folder / f"frame-{number:06d}.png").write_bytes(encode_picture(pixels))
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


@pytest.fixture(scope="module")
def three(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Store]:
    folder = tmp_path_factory.mktemp("three")
    fill(folder)
    with open_store(folder) as opened:
        yield opened


def test_several_targets_are_exported_as_one_zip_file(three: Store) -> None:
    answer = FilesOf(three).get("/files/exports/csv?targets=3,5,3")
    assert answer.status_code == 200
    assert 'filename="targets.zip"' in answer.headers["content-disposition"]
    with zipfile.ZipFile(io.BytesIO(answer.content)) as packed:
        names = {name for name in packed.namelist() if not name.endswith("/")}
        assert names == {"targets/target-3-csv.zip", "targets/target-5-csv.zip"}
        alone = zipfile.ZipFile(io.BytesIO(FilesOf(three).get("/files/export/5/csv").content))
        inside = zipfile.ZipFile(io.BytesIO(packed.read("targets/target-5-csv.zip")))
        assert {item.filename: item.CRC for item in inside.infolist()} == {
            item.filename: item.CRC for item in alone.infolist()
        }


@pytest.mark.parametrize(
    ("address", "message"),
    [
        ("csv?targets=", "target must be a number"),
        ("csv?targets=3,77", "target must be a number"),
        ("csv?targets=3;5", "target must be a number"),
        ("nothing?targets=3", "form of export"),
        ("csv?targets=3,5&identified=true", "masks nothing"),
    ],
)
def test_exports_of_what_is_not_there_are_refused(three: Store, address: str, message: str) -> None:
    before = set(Path(tempfile.gettempdir()).glob("tsis-export-*"))
    answer = FilesOf(three).get(f"/files/exports/{address}")
    assert answer.status_code >= 400
    assert message in answer.text
    assert set(Path(tempfile.gettempdir()).glob("tsis-export-*")) <= before


def test_more_targets_than_one_export_holds_are_refused(three: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(exporting, "MOST_AT_ONCE", 2)
    answer = FilesOf(three).get("/files/exports/csv?targets=3,4,5")
    assert "targets must be 1 to 2 at once; got 3 or more" in answer.text
