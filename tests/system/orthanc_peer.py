"""A real archive on the loopback interface: Orthanc with its own folders, ended by its own process."""

from __future__ import annotations

import json
import os
import shutil
import socket
import subprocess
import threading
import time
import urllib.request
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from tests.waiting import HANGS_S

if TYPE_CHECKING:
    from collections.abc import Iterator

LOOPBACK, AE = "127.0.0.1", "TSISTEST"
PLUGIN = Path("/usr/share/orthanc/plugins/libOrthancDicomWeb.so")
READY = "Orthanc has started"
PLACES = os.pathsep.join(["/usr/bin", "/usr/sbin", "/usr/local/bin", "/usr/local/sbin"])
_pause = threading.Event()


@dataclass(frozen=True, slots=True)
class Archive:
    """Where a running Orthanc listens."""

    dicom_port: int
    http_port: int
    storage: Path

    @property
    def rest(self) -> str:
        return f"http://{LOOPBACK}:{self.http_port}"

    @property
    def web(self) -> str:
        return f"{self.rest}/dicom-web"

    def instances(self) -> list[str]:
        """Identities by which Orthanc's own interface knows what it holds."""
        found: list[str] = json.loads(self._get("/instances"))
        return found

    def file(self, identity: str) -> bytes:
        """An instance as Orthanc's own interface gives it."""
        return self._get(f"/instances/{identity}/file")

    def _get(self, path: str) -> bytes:
        direct = urllib.request.build_opener(urllib.request.ProxyHandler({}))
        with direct.open(self.rest + path, timeout=HANGS_S) as answer:
            content: bytes = answer.read()
            return content


def missing() -> str:
    """Why there can be no archive; empty where there can."""
    if installed("Orthanc") is None:
        return "Orthanc is absent; apt install orthanc"
    return "" if PLUGIN.exists() else "Orthanc's DICOMweb is absent; apt install orthanc-dicomweb"


def installed(name: str) -> str | None:
    """A program of the system; those of pynetdicom's wheel bear the same names as dcmtk's."""
    return shutil.which(name, path=PLACES)


def free_port() -> int:
    """A port that nobody listens on."""
    with socket.socket() as one:
        one.bind((LOOPBACK, 0))
        port: int = one.getsockname()[1]
        return port


@contextmanager
def orthanc(folder: Path, **settings: object) -> Iterator[Archive]:
    """Orthanc, until the block ends."""
    archive = Archive(free_port(), free_port(), folder / "storage")
    configuration = {
        "Name": "tsis test",
        "StorageDirectory": str(archive.storage),
        "IndexDirectory": str(archive.storage),
        "TemporaryDirectory": str(folder),
        "RemoteAccessAllowed": False,
        "AuthenticationEnabled": False,
        "HttpPort": archive.http_port,
        "DicomPort": archive.dicom_port,
        "DicomAet": AE,
        "DicomCheckCalledAet": True,
        "DicomAlwaysAllowStore": True,
        "DicomAlwaysAllowGet": True,
        "Plugins": [str(PLUGIN)],
        "DicomWeb": {"Enable": True, "Root": "/dicom-web/"},
        **settings,
    }
    file = folder / "orthanc.json"
    file.write_text(json.dumps(configuration))
    program = installed("Orthanc")
    assert program is not None
    with listening([program, str(file)], folder / "orthanc.log", archive.http_port, said=READY):
        yield archive


@contextmanager
def listening(command: list[str], log: Path, port: int, *, said: str = "") -> Iterator[None]:
    """A server that listens on a port and has said that it is ready, until the block ends."""
    with log.open("wb") as file:
        process = subprocess.Popen(command, stdout=file, stderr=subprocess.STDOUT, cwd=log.parent)
    try:
        until = time.monotonic() + HANGS_S
        while not (_answers(port) and said in log.read_text(errors="replace")):
            if process.poll() is not None or time.monotonic() > until:
                raise RuntimeError(f"{command[0]} did not begin to listen; it said: {log.read_text(errors='replace')}")
            _pause.wait(0.02)
        yield
    finally:
        process.terminate()
        try:
            process.wait(HANGS_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _answers(port: int) -> bool:
    with socket.socket() as one:
        one.settimeout(1.0)
        return one.connect_ex((LOOPBACK, port)) == 0
