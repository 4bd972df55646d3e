"""Real GigE Vision cameras on the loopback interface, each a process of its own."""

from __future__ import annotations

import shutil
import socket
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from tests.waiting import HANGS_S

from tsis.instrument.drivers.aravis import missing_requirement

if TYPE_CHECKING:
    from collections.abc import Iterator

LOOPBACK, CONTROL_PORT = "127.0.0.1", 3956  # of GigE Vision, so one camera an interface
SEARCH = bytes.fromhex("42 01 00 02 00 00 00 01")  # GigE Vision's discovery command
PROGRAM = "arv-fake-gv-camera-0.8"
FOREIGN_CLIENT = "arv-camera-test-0.8"
_pause = threading.Event()


def standing_clock() -> float:
    """By this clock no camera is ever silent: on a busy machine a camera's process can be, for seconds."""
    return 0.0


@contextmanager
def loopback_camera_port() -> Iterator[None]:
    """Wait until no other run of these tests has a camera on the loopback interface; skip where none can be had."""
    fcntl = pytest.importorskip("fcntl", reason="cameras on the loopback interface are kept apart by locks of Unix")
    reason = missing_requirement() or (
        None if shutil.which(PROGRAM) else f"{PROGRAM} is absent; apt install aravis-tools"
    )
    if reason:
        pytest.skip(reason)
    with Path(tempfile.gettempdir(), "tsis-loopback-camera.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not _free():
            pytest.skip(f"another program serves a camera on {LOOPBACK}")
        yield


@contextmanager
def fake_camera(serial: str, *options: str) -> Iterator[subprocess.Popen[str]]:
    """The fake camera of Aravis."""
    with _served([PROGRAM, "-i", LOOPBACK, "-s", serial, *options]) as process:
        yield process


@contextmanager
def served_probe(serial: str, *options: str) -> Iterator[subprocess.Popen[str]]:
    """The virtual probe, served as a user would."""
    program = "from tsis.cli import main; main()"
    with _served([sys.executable, "-c", program, "serve", "--serial", serial, *options]) as process:
        yield process


@contextmanager
def _served(command: list[str]) -> Iterator[subprocess.Popen[str]]:
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        until = time.monotonic() + HANGS_S
        while not _answers():
            if process.poll() is not None or time.monotonic() > until:
                said = process.communicate()[0] if process.poll() is not None else "nothing"
                pytest.fail(f"{command[0]} did not begin to listen; it said: {said}")
            _pause.wait(0.01)
        yield process
    finally:
        process.kill()
        process.wait()
        if process.stdout is not None:
            process.stdout.close()


def _answers() -> bool:
    """Whether a camera answers a search; binding its port to find out could take it away from the camera."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asking:
        asking.settimeout(0.2)
        try:
            asking.connect((LOOPBACK, CONTROL_PORT))
            asking.send(SEARCH)
            return len(asking.recv(1024)) > 0
        except OSError:
            return False


def _free() -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind((LOOPBACK, CONTROL_PORT))
        except OSError:
            return False
        return True
