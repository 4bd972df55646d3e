"""A console with TLS and a login."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import dataclass
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from pathlib import Path

    from tests.console.running import RunningConsole

    from tsis.console.auth import Logins

PASSWORD = "correct horse battery"
OPENSSL = shutil.which("openssl")


@dataclass(frozen=True, slots=True, kw_only=True)
class TlsConsole:
    """A console with a certificate of its own and the login ``anna``."""

    console: RunningConsole
    certificate: Path
    logins: Logins


def made_certificate(folder: Path) -> tuple[Path, Path]:
    """A certificate for this machine and its key, by the program openssl."""
    if OPENSSL is None:
        pytest.skip("openssl is not installed: apt-get install openssl")
    certificate, key = folder / "certificate.pem", folder / "key.pem"
    subprocess.run(
        [OPENSSL, "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-days", "2",
         "-subj", "/CN=localhost", "-addext", "subjectAltName=DNS:localhost,DNS:lab.example,IP:127.0.0.1",
         "-keyout", str(key), "-out", str(certificate)],
        check=True, capture_output=True,
    )  # fmt: skip
    return certificate, key
