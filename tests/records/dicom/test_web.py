"""STOW-RS against services that refuse, redirect, answer nonsense or are silent."""

from __future__ import annotations

import json
import socket
import threading
from contextlib import contextmanager
from functools import cache
from http.server import BaseHTTPRequestHandler, HTTPServer
from typing import TYPE_CHECKING, Any

import pytest
from tests.records.sample import sample_record

from tsis.errors import InputError, RecordsError
from tsis.records.dicom import dicom_files, stow_rs

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from tsis.records.dicom import DicomFile

HOST, JSON = "127.0.0.1", "application/dicom+json"


@cache
def files() -> tuple[DicomFile, ...]:
    """Files of the sample, made by the worker that needs them."""
    return dicom_files(sample_record())


@contextmanager
def service(*answers: tuple[int, Mapping[str, str], bytes]) -> Iterator[tuple[str, list[Any]]]:
    """A service that gives these answers in turn, the last one again and again; its address and what it was sent."""
    left, got = list(answers), []

    class Answer(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            if self.headers.get("Transfer-Encoding") == "chunked":
                body = b""
                while size := int(self.rfile.readline(), 16):
                    body += self.rfile.read(size)
                    self.rfile.readline()
                self.rfile.readline()
            else:
                body = self.rfile.read(int(self.headers["Content-Length"]))
            got.append((self.path, dict(self.headers), body))
            status, headers, content = left.pop(0) if len(left) > 1 else left[0]
            self.send_response(status)
            for name, value in {"Content-Length": str(len(content)), **headers}.items():
                self.send_header(name, value)
            self.end_headers()
            self.wfile.write(content)

        def log_message(self, *_: Any) -> None:
            pass

    with HTTPServer((HOST, 0), Answer) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        try:
            yield f"http://{HOST}:{server.server_address[1]}", got
        finally:
            server.shutdown()
            thread.join()


def stored(uid: str) -> tuple[int, dict[str, str], bytes]:
    item = {"00081155": {"vr": "UI", "Value": [uid]}}
    return 200, {"Content-Type": JSON}, json.dumps({"00081199": {"vr": "SQ", "Value": [item]}}).encode()


@pytest.mark.system
def test_each_instance_goes_whole_in_a_request_of_its_own() -> None:
    with service(*(stored(file.sop_instance_uid) for file in files())) as (url, got):
        assert stow_rs(files(), url=f"{url}/web/", token="secret") == tuple(file.sop_instance_uid for file in files())
    assert [path for path, _, _ in got] == ["/web/studies"] * 3
    assert all(headers["Authorization"] == "Bearer secret" for _, headers, _ in got)
    assert all(file.content in body for file, (_, _, body) in zip(files(), got, strict=True))


@pytest.mark.system
@pytest.mark.parametrize(
    ("status", "said"),
    [
        (400, "answered 400"),
        (401, "answered 401.*give a token"),
        (403, "does not let this token store"),
        (404, "check the address"),
        (413, "no requests of this size"),
        (500, "answered 500"),
        (503, "answered 503"),
    ],
)
def test_a_refusal_is_told_with_its_status_and_a_cure(status: int, said: str) -> None:
    with service(stored(files()[0].sop_instance_uid), (status, {}, b"")) as (url, got):
        with pytest.raises(RecordsError, match=said) as caught:
            stow_rs(files(), url=url)
        assert files()[1].name in str(caught.value)
    assert len(got) == 2  # asked once, not again and again


@pytest.mark.system
def test_an_instance_that_failed_is_told_with_its_reason() -> None:
    failed = {
        "00081155": {"vr": "UI", "Value": [files()[0].sop_instance_uid]},
        "00081197": {"vr": "US", "Value": [0xA700]},
    }
    content = json.dumps({"00081198": {"vr": "SQ", "Value": [failed]}}).encode()
    with (
        service((200, {"Content-Type": JSON}, content)) as (url, _),
        pytest.raises(RecordsError, match=f"{files()[0].name} was not stored: failure reason 0xA700"),
    ):
        stow_rs(files(), url=url)


@pytest.mark.system
@pytest.mark.parametrize(
    ("kind", "content"),
    [
        ("text/html", b"<p>Welcome</p>"),
        (JSON, b"<p>Welcome</p>"),
        (JSON, b"{}"),
        (JSON, b"[1]"),
        ("application/dicom+xml", b"<"),
    ],
)
def test_a_page_that_says_nothing_of_storing_is_no_success(kind: str, content: bytes) -> None:
    with (
        service((200, {"Content-Type": kind}, content)) as (url, _),
        pytest.raises(RecordsError, match=r"must (answer|take)"),
    ):
        stow_rs(files(), url=url)


@pytest.mark.system
def test_a_service_that_sends_elsewhere_is_not_followed() -> None:
    with (
        service(stored(files()[0].sop_instance_uid)) as (other, got),
        service((307, {"Location": f"{other}/elsewhere"}, b"")) as (url, _),
    ):
        with pytest.raises(RecordsError, match="which was not followed"):
            stow_rs(files(), url=url, token="secret")
        assert got == []


@pytest.mark.system
def test_a_silent_service_is_told() -> None:
    with socket.create_server((HOST, 0)) as silent:
        url = f"http://{HOST}:{silent.getsockname()[1]}"
        with pytest.raises(RecordsError, match=r"must answer within 0\.3 s"):
            stow_rs(files(), url=url, timeout_s=0.3)


def test_an_unknown_host_is_told() -> None:
    with pytest.raises(RecordsError, match="must be reachable"):
        stow_rs(files(), url="https://no-such-host.invalid/dicom-web", timeout_s=5.0)


@pytest.mark.parametrize(
    "url", ["http://archive.example/dicom-web", "http://10.0.0.5:8042", "http://localhost.example"]
)
def test_plain_http_to_another_machine_is_refused(url: str) -> None:
    with pytest.raises(InputError, match="must start with https where it leaves this machine"):
        stow_rs(files(), url=url)


@pytest.mark.parametrize(
    "url",
    [
        "",
        "archive.example",
        "ftp://archive.example",
        "https://",
        "https://a:b@archive.example",
        "http://[::1",
        "https://x/?a=b",
    ],
)
def test_what_is_no_address_is_refused(url: str) -> None:
    with pytest.raises(InputError, match="url must be the http or https address"):
        stow_rs(files(), url=url)


def test_a_token_that_cannot_be_sent_is_not_repeated() -> None:
    with pytest.raises(InputError, match="token must be printable ASCII") as caught:
        stow_rs(files(), url="https://archive.example", token="sécret\r\n")
    assert "cret" not in str(caught.value)


def test_nothing_to_send_is_refused() -> None:
    with pytest.raises(InputError, match="at least one instance"):
        stow_rs((), url="https://archive.example")
