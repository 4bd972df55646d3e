"""C-STORE against archives that refuse, fail, break off or are silent."""

from __future__ import annotations

import shutil
import socket
import ssl
import subprocess
from contextlib import contextmanager
from functools import cache
from typing import TYPE_CHECKING, Any

import pytest
from pynetdicom import AE, evt
from pynetdicom.sop_class import (  # type: ignore[attr-defined]
    ComprehensiveSRStorage,
    MultiFrameGrayscaleByteSecondaryCaptureImageStorage,
)
from tests.records.dicom.variants import framed, noise
from tests.records.sample import sample_record

from tsis.errors import InputError, RecordsError
from tsis.records.dicom import c_store, dicom_files

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from tsis.records.dicom import DicomFile

pytestmark = pytest.mark.system

EVERY = (MultiFrameGrayscaleByteSecondaryCaptureImageStorage, ComprehensiveSRStorage)
HOST = "127.0.0.1"


@cache
def files() -> tuple[DicomFile, ...]:
    """Files of the sample, made by the worker that needs them."""
    return dicom_files(sample_record())


@contextmanager
def archive(
    answer: Callable[[Any], int], *, takes: tuple[Any, ...] = EVERY, name: str = "", tls: ssl.SSLContext | None = None
) -> Iterator[int]:
    """An archive that answers each instance with a status; its port."""
    entity = AE(ae_title="ARCHIVE")
    for kind in takes:
        entity.add_supported_context(kind)
    entity.require_called_aet = bool(name)
    if name:
        entity.require_calling_aet = [name]
    server: Any = entity.start_server((HOST, 0), block=False, ssl_context=tls, evt_handlers=[(evt.EVT_C_STORE, answer)])
    try:
        yield server.server_address[1]
    finally:
        server.shutdown()


def test_what_was_taken_is_told() -> None:
    got: list[Any] = []

    def keep(event: Any) -> int:
        got.append(event.dataset)
        return 0

    with archive(keep) as port:
        sent = c_store(files(), host="localhost", port=port, called_ae="ARCHIVE")
    assert sent == tuple(file.sop_instance_uid for file in files())
    assert got == [file.dataset() for file in files()]


def test_an_instance_that_the_archive_changes_counts_as_taken() -> None:
    with archive(lambda _: 0xB000) as port:
        assert len(c_store(files(), host=HOST, port=port, called_ae="ARCHIVE")) == 3


def test_each_failed_instance_is_named_with_its_reason() -> None:
    def full(event: Any) -> int:
        return 0xA700 if event.request.AffectedSOPInstanceUID == files()[1].sop_instance_uid else 0

    with archive(full) as port, pytest.raises(RecordsError) as caught:
        c_store(files(), host=HOST, port=port, called_ae="ARCHIVE")
    said = str(caught.value)
    assert f"1 of 3 failed: {files()[1].name}: the archive answered 0xA700 (Failure Refused: Out of Resources)" in said
    assert files()[0].name not in said


def test_a_kind_that_the_archive_does_not_take_is_named() -> None:
    got: list[str] = []

    def keep(event: Any) -> int:
        got.append(event.request.AffectedSOPInstanceUID)
        return 0

    with archive(keep, takes=EVERY[:1]) as port, pytest.raises(RecordsError) as caught:
        c_store(files(), host=HOST, port=port, called_ae="ARCHIVE")
    assert "1 of 3 failed" in str(caught.value)
    assert "does not take Comprehensive SR Storage" in str(caught.value)
    assert got == [file.sop_instance_uid for file in files()[:2]]  # what it takes, it got


def test_an_archive_that_takes_no_kind_is_told() -> None:
    single = dicom_files(framed([noise(3, 3)]))
    with (
        archive(lambda _: 0, takes=EVERY) as port,
        pytest.raises(RecordsError, match="takes none of the kinds of instances: Secondary Capture Image Storage"),
    ):
        c_store(single, host=HOST, port=port, called_ae="ARCHIVE")


def test_an_archive_that_does_not_know_us_is_told() -> None:
    with archive(lambda _: 0, name="OTHER") as port:
        with pytest.raises(RecordsError, match="refused the association: calling ae title not recogni"):
            c_store(files(), host=HOST, port=port, called_ae="ARCHIVE")
        assert c_store(files(), host=HOST, port=port, called_ae="ARCHIVE", calling_ae="OTHER")


def test_an_archive_that_breaks_off_is_told() -> None:
    def abort(event: Any) -> int:
        event.assoc.abort()
        return 0

    with archive(abort) as port, pytest.raises(RecordsError) as caught:
        c_store(files(), host=HOST, port=port, called_ae="ARCHIVE", timeout_s=0.5)
    assert "3 of 3 failed" in str(caught.value)
    assert "broke off" in str(caught.value)


def test_a_silent_archive_is_told() -> None:
    with socket.create_server((HOST, 0)) as silent:
        port = silent.getsockname()[1]
        with pytest.raises(RecordsError, match=r"must answer the request for an association within 0\.3 s"):
            c_store(files(), host=HOST, port=port, called_ae="ARCHIVE", timeout_s=0.3)


def test_an_encrypted_association_is_for_a_certificate_that_is_trusted(tmp_path: Path) -> None:
    program = shutil.which("openssl") or pytest.skip("openssl is absent, which makes the certificate")
    key, certificate = tmp_path / "key", tmp_path / "certificate"
    kind = ["-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2"]
    of = ["-subj", "/CN=localhost", "-addext", "subjectAltName=DNS:localhost"]
    made = [program, "req", *kind, *of, "-keyout", str(key), "-out", str(certificate)]
    subprocess.run(made, check=True, capture_output=True)
    server = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    server.load_cert_chain(certificate, key)
    trusting = ssl.create_default_context(cafile=str(certificate))
    with archive(lambda _: 0, tls=server) as port:
        assert len(c_store(files(), host="localhost", port=port, called_ae="ARCHIVE", tls=trusting)) == 3
        for tls, host in ((ssl.create_default_context(), "localhost"), (trusting, HOST)):
            with pytest.raises(RecordsError, match="must have a certificate that can be trusted"):
                c_store(files(), host=host, port=port, called_ae="ARCHIVE", tls=tls)
        with pytest.raises(RecordsError, match="was silent or wants TLS"):
            c_store(files(), host="localhost", port=port, called_ae="ARCHIVE", timeout_s=2.0)


def test_an_unknown_host_is_told() -> None:
    with pytest.raises(RecordsError, match="host must be a name or address that is known"):
        c_store(files(), host="no-such-host.invalid", port=104, called_ae="ARCHIVE")
    with pytest.raises(RecordsError, match="host must be a name or address that is known"):
        c_store(files(), host="x" * 70 + ".example", port=104, called_ae="ARCHIVE")


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"called_ae": ""}, "called_ae must have 1 to 16"),
        ({"called_ae": "A" * 17}, "called_ae must have 1 to 16"),
        ({"calling_ae": "Ä"}, "calling_ae must have 1 to 16"),
        ({"port": 0}, "port"),
        ({"port": 70_000}, "port"),
        ({"timeout_s": 0.0}, "timeout_s"),
        ({"files": ()}, "files must hold at least one"),
    ],
)
def test_what_cannot_be_is_refused_before_any_connection(wrong: dict[str, Any], said: str) -> None:
    given: dict[str, Any] = {"files": files(), "host": HOST, "port": 104, "called_ae": "ARCHIVE", **wrong}
    with pytest.raises(InputError, match=said):
        c_store(**given)
