"""Where a console may listen, with what."""

from __future__ import annotations

import socket
import ssl
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest
from tests.console.auth.conftest import OPENSSL

import tsis.console
from tsis.console import Certificate, ConsoleSettings, serve_console
from tsis.console.auth import FOLDER, Logins, saved_token
from tsis.console.serving import is_loopback, listen, public_host, resolve_host
from tsis.errors import FileInputError, InputError

if TYPE_CHECKING:
    from pathlib import Path

PASSWORD = "correct horse battery"
ELSEWHERE = "192.0.2.1"  # an address that no machine has


def refused(terms: ConsoleSettings) -> str:
    """The sentence with which these are refused, before anything is opened."""
    with pytest.raises(InputError) as caught:
        serve_console(terms, ready=lambda _: pytest.fail("it listens"))
    return str(caught.value)


@pytest.mark.system
def test_a_network_is_refused_without_a_certificate_and_a_login(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, certificate: tuple[Path, Path]
) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path))
    tls = Certificate(chain=certificate[0], key=certificate[1])
    expected = "unless a certificate and a login are there"
    for host in ("0.0.0.0", "::", ELSEWHERE):
        assert expected in refused(ConsoleSettings(host=host))
        assert expected in refused(ConsoleSettings(host=host, certificate=tls))
    Logins(tmp_path).add("anna", PASSWORD)
    assert expected in refused(ConsoleSettings(host=ELSEWHERE))
    # With both it gets as far as the socket, and this machine has no such address.
    assert "must be free" in refused(ConsoleSettings(host=ELSEWHERE, certificate=tls))


@pytest.mark.parametrize("name", ["", "lab.example:80", "http://lab.example", "a b", "lab.example/x", "*"])
def test_names_of_a_console_are_plain(name: str) -> None:
    with pytest.raises(InputError, match="name of a host must be"):
        ConsoleSettings(names=(name,))


@pytest.mark.parametrize("port", [-1, 65536, 1.5, True])
def test_ports_are_ports(port: float) -> None:
    with pytest.raises(InputError, match="port must"):
        ConsoleSettings(port=port)  # type: ignore[arg-type]


def test_only_loopback_is_loopback() -> None:
    assert all(is_loopback(item) for item in ("127.0.0.1", "127.8.9.1", "::1"))
    assert not any(is_loopback(item) for item in ("0.0.0.0", "::", "192.0.2.1", "fe80::1%eth0", "10.0.0.1"))
    assert is_loopback(resolve_host("localhost"))
    with pytest.raises(InputError, match="must be an address of this machine"):
        resolve_host("no such name")


@pytest.mark.system
def test_the_second_to_want_a_port_is_told_at_once() -> None:
    with listen("127.0.0.1", 0) as first:
        port = first.getsockname()[1]
        with pytest.raises(InputError, match=rf"port {port} of 127\.0\.0\.1 must be free; got: .+--port"):
            listen("127.0.0.1", port)
        socket.create_connection(
            ("127.0.0.1", port)
        ).close()  # who comes while it is prepared waits, and is not refused


@pytest.mark.system
def test_a_console_that_cannot_listen_leaves_the_key_as_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path))
    key = saved_token()
    with listen("127.0.0.1", 0) as first:
        assert "must be free" in refused(ConsoleSettings(port=first.getsockname()[1], new_token=True))
    assert saved_token() == key


@pytest.mark.system
def test_what_begins_late_loads_late() -> None:
    requested = "import sys; from tsis.console import Logins; print(Logins.__name__, *sys.modules)"
    reported = subprocess.run(
        [sys.executable, "-c", requested], capture_output=True, text=True, check=True
    ).stdout.split()
    assert reported[0] == "Logins"
    assert not {"nicegui", "fastapi", "uvicorn", "tsis.console.services", "tsis.records"} & set(reported)
    assert {getattr(tsis.console, name).__name__ for name in tsis.console.__all__} == set(tsis.console.__all__)
    assert set(tsis.console.__all__) <= set(dir(tsis.console))
    with pytest.raises(AttributeError, match="no attribute 'Bensh'"):
        tsis.console.Bensh  # noqa: B018


def test_the_address_that_is_shown() -> None:
    assert public_host("0.0.0.0", ("lab.example", "other")) == "lab.example"
    assert public_host("0.0.0.0", ()) == "127.0.0.1"
    assert public_host("2001:db8::1", ()) == "[2001:db8::1]"


def test_a_certificate_speaks_nothing_old(certificate: tuple[Path, Path]) -> None:
    assert Certificate(chain=certificate[0], key=certificate[1]).context().minimum_version == ssl.TLSVersion.TLSv1_2


@pytest.mark.system
def test_certificates_that_will_not_do_are_one_sentence(certificate: tuple[Path, Path], tmp_path: Path) -> None:
    assert OPENSSL is not None
    chain, key = certificate
    (tmp_path / "text").write_text("no certificate")
    locked, other = tmp_path / "locked", tmp_path / "other"
    subprocess.run(
        [OPENSSL, "pkey", "-in", str(key), "-aes256", "-passout", "pass:hush", "-out", str(locked)], check=True
    )
    subprocess.run(
        [OPENSSL, "genpkey", "-algorithm", "EC", "-pkeyopt", "ec_paramgen_curve:P-256", "-out", str(other)],
        check=True, capture_output=True,
    )  # fmt: skip
    wrong = {
        (tmp_path / "none", key): "certificate must be a file",
        (chain, tmp_path / "none"): "key must be a file",
        (chain, tmp_path): "key must be a file",
        (tmp_path / "text", key): "must hold a certificate and its key",
        (chain, tmp_path / "text"): "must hold a certificate and its key",
        (chain, other): "must hold a certificate and its key",
        (chain, locked): "must not be locked by a password",
    }
    for (item, its), message in wrong.items():
        with pytest.raises(FileInputError, match=message):
            Certificate(chain=item, key=its).context()
