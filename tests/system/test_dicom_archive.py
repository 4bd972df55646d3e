"""Frames and reports through a real archive and back, pixel for pixel, by routes that share no code."""

from __future__ import annotations

import re
import subprocess
from dataclasses import replace
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np
import pydicom
import pytest
from tests.records.dicom.variants import framed, noise
from tests.records.sample import sample_record
from tests.system.orthanc_peer import AE, LOOPBACK, Archive, free_port, installed, listening, missing, orthanc

from tsis.errors import RecordsError
from tsis.records.dicom import c_store, dicom_files, stow_rs

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

    from tsis.records import TargetRecord
    from tsis.records.dicom import DicomFile

pytestmark = [pytest.mark.system, pytest.mark.skipif(bool(missing()), reason=missing() or "Orthanc is here")]


def of_its_own(dossier: TargetRecord, identity: str) -> TargetRecord:
    """With a target that no other dossier has, so that each is a study."""
    return replace(dossier, target=replace(dossier.target, id=identity))


KINDS = {
    "8 bit": sample_record(),
    "12 bit": sample_record(full_scale=4095.0, kind="subject"),
    "16 bit, odd": framed([noise(5, 7, bits=16, seed=seed) for seed in range(3)], full_scale=65535.0),
    "8 bit, odd, one frame": framed([noise(5, 7)], mm_per_pixel=(0.1, 0.2)),
}
DOSSIERS = {kind: of_its_own(dossier, kind) for kind, dossier in KINDS.items()}


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Archive]:
    with orthanc(tmp_path_factory.mktemp("orthanc")) as running:
        yield running


def read(content: bytes) -> Any:
    return pydicom.dcmread(BytesIO(content))


def check_same(dossier: TargetRecord, files: Iterable[DicomFile], back: Iterable[Any]) -> None:
    """What came back is what was sent, and its frames are those that the camera gave."""
    found = {str(each.SOPInstanceUID): each for each in back}
    levels: list[Any] = []
    for file in files:
        sent, came = file.dataset(), found[file.sop_instance_uid]
        assert came == sent  # pydicom compares every element
        if "PixelData" in came:
            levels += list(np.reshape(came.pixel_array, (-1, came.Rows, came.Columns)))
    expected = [dossier.levels(press) for press in dossier.presses]
    assert len(levels) == len(expected)
    for one, other in zip(levels, expected, strict=True):
        assert one.dtype == other.dtype
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("kind", DOSSIERS)
def test_c_store_then_orthancs_own_interface(archive: Archive, kind: str) -> None:
    files = dicom_files(DOSSIERS[kind])
    sent = c_store(files, host=LOOPBACK, port=archive.dicom_port, called_ae=AE)
    assert sent == tuple(file.sop_instance_uid for file in files)
    back = [read(archive.file(identity)) for identity in archive.instances()]
    check_same(DOSSIERS[kind], files, back)


@pytest.mark.parametrize("kind", DOSSIERS)
def test_stow_rs_then_qido_rs_and_wado_rs(archive: Archive, kind: str) -> None:
    from dicomweb_client.api import DICOMwebClient

    files = dicom_files(DOSSIERS[kind], identified=True)
    assert stow_rs(files, url=archive.web) == tuple(file.sop_instance_uid for file in files)
    client = DICOMwebClient(archive.web)
    study = files[0].dataset().StudyInstanceUID
    listed = client.search_for_instances(study_instance_uid=study)
    assert {each["00080018"]["Value"][0] for each in listed} == {file.sop_instance_uid for file in files}
    check_same(DOSSIERS[kind], files, client.retrieve_study(study))


@pytest.mark.parametrize("kind", DOSSIERS)
def test_c_store_then_c_get_by_dcmtk(archive: Archive, kind: str, tmp_path: Path) -> None:
    getscu = installed("getscu") or pytest.skip("getscu is absent; apt install dcmtk")
    files = dicom_files(DOSSIERS[kind])
    c_store(files, host=LOOPBACK, port=archive.dicom_port, called_ae=AE)
    study = files[0].dataset().StudyInstanceUID
    where = ["-aec", AE, LOOPBACK, str(archive.dicom_port)]
    keys = ["-S", "-k", "0008,0052=STUDY", "-k", f"0020,000D={study}"]
    subprocess.run([getscu, "+B", "-od", str(tmp_path), *keys, *where], check=True, capture_output=True)
    check_same(DOSSIERS[kind], files, [pydicom.dcmread(path) for path in tmp_path.iterdir()])


@pytest.mark.parametrize("kind", DOSSIERS)
def test_c_store_to_dcmtk(kind: str, tmp_path: Path) -> None:
    storescp = installed("storescp") or pytest.skip("storescp is absent; apt install dcmtk")
    port, folder = free_port(), tmp_path / "received"
    folder.mkdir()
    files = dicom_files(DOSSIERS[kind])
    with listening([storescp, "-aet", "DCMTK", "+B", "-od", str(folder), str(port)], tmp_path / "log", port):
        c_store(files, host=LOOPBACK, port=port, called_ae="DCMTK")
    check_same(DOSSIERS[kind], files, [pydicom.dcmread(path) for path in folder.iterdir()])


def test_sending_again_stores_nothing_twice(archive: Archive) -> None:
    dossier = framed([noise(4, 6, seed=9)], role="ball")
    c_store(dicom_files(dossier), host=LOOPBACK, port=archive.dicom_port, called_ae=AE)
    held = set(archive.instances())
    c_store(dicom_files(dossier), host=LOOPBACK, port=archive.dicom_port, called_ae=AE)
    stow_rs(dicom_files(dossier), url=archive.web)
    assert set(archive.instances()) == held


def test_another_called_name_is_refused(archive: Archive) -> None:
    for _ in range(3):  # on a busy machine the connection can be found closed before the refusal is read
        with pytest.raises(RecordsError) as refused:
            c_store(dicom_files(DOSSIERS["8 bit"]), host=LOOPBACK, port=archive.dicom_port, called_ae="WRONG")
        if "broke off" not in str(refused.value):
            break
    assert re.search("WRONG at .* refused the association: called ae title not recogni", str(refused.value))


def test_a_closed_port_is_told() -> None:
    files = dicom_files(DOSSIERS["8 bit"])
    with pytest.raises(RecordsError, match="must accept a connection: Connection refused"):
        c_store(files, host=LOOPBACK, port=free_port(), called_ae=AE, timeout_s=5.0)
    with pytest.raises(RecordsError, match=r"must be reachable.*refused"):
        stow_rs(files, url=f"http://{LOOPBACK}:{free_port()}/dicom-web", timeout_s=5.0)


def test_a_wrong_path_is_told(archive: Archive) -> None:
    with pytest.raises(RecordsError, match=r"answered 404 .*check the address"):
        stow_rs(dicom_files(DOSSIERS["8 bit"]), url=f"{archive.rest}/nowhere")


def test_a_server_that_is_no_archive_is_told(archive: Archive) -> None:
    """The port of its web pages speaks no DICOM, and the port of DICOM speaks no HTTP."""
    files = dicom_files(DOSSIERS["8 bit"])
    with pytest.raises(RecordsError, match=r"must answer the request for an association"):
        c_store(files, host=LOOPBACK, port=archive.http_port, called_ae=AE, timeout_s=5.0)
    with pytest.raises(RecordsError, match=r"must (be reachable|answer)"):
        stow_rs(files, url=f"http://{LOOPBACK}:{archive.dicom_port}/dicom-web", timeout_s=5.0)


def test_an_archive_that_wants_a_password(tmp_path: Path) -> None:
    with orthanc(tmp_path, AuthenticationEnabled=True, RegisteredUsers={"someone": "something"}) as locked:
        with pytest.raises(RecordsError, match=r"answered 401 .*give a token"):
            stow_rs(dicom_files(DOSSIERS["8 bit"]), url=locked.web)
        with pytest.raises(RecordsError, match="answered 401"):
            stow_rs(dicom_files(DOSSIERS["8 bit"]), url=locked.web, token="no token of theirs")
        known = {"Authorization": "Basic c29tZW9uZTpzb21ldGhpbmc="}
        assert stow_rs(dicom_files(DOSSIERS["8 bit"]), url=locked.web, headers=known)
