"""A real PostgreSQL on the loopback interface with a data folder of its own, ended by its own process."""

from __future__ import annotations

import os
import secrets
import shutil
import signal
import socket
import subprocess
import tempfile
import threading
import time
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import psycopg
from tests.waiting import HANGS_S

if TYPE_CHECKING:
    from collections.abc import Iterator

LOOPBACK, USER = "127.0.0.1", "tsis"
ACCOUNT = "postgres"  # under which the server runs where the tests run as root, whom it refuses
_pause = threading.Event()


def programs() -> Path | None:
    """Folder of the newest server that is installed; None without one."""
    found = sorted(Path("/usr/lib/postgresql").glob("*/bin/postgres"), key=lambda each: float(each.parts[4]))
    path = shutil.which("postgres")
    return found[-1].parent if found else Path(path).parent if path else None


def missing() -> str:
    """Why there can be no server; empty where there can."""
    return "" if programs() else "PostgreSQL is absent; apt install postgresql"


@dataclass(slots=True)
class Server:
    """A server that can be killed and started again."""

    folder: Path
    port: int
    password: str
    settings: dict[str, str] = field(default_factory=dict)
    process: subprocess.Popen[bytes] | None = None

    def url(self, database: str = "postgres", *, password: str | None = None) -> str:
        return (
            f"postgresql://{USER}:{self.password if password is None else password}@{LOOPBACK}:{self.port}/{database}"
        )

    def connect(self, database: str = "postgres") -> psycopg.Connection[Any]:
        return psycopg.connect(self.url(database), autocommit=True, connect_timeout=5)

    def new_database(self, options: str = "") -> str:
        """URL of an empty database."""
        name = f"tsis_{secrets.token_hex(6)}"
        with self.connect() as connection:
            connection.execute(f"CREATE DATABASE {name} {options}")
        return self.url(name)

    def start(self) -> None:
        """Begin to serve; return when connections are taken."""
        found = programs()
        assert found is not None
        settings = {
            "listen_addresses": LOOPBACK,
            "port": str(self.port),
            "unix_socket_directories": "",
            **self.settings,
        }
        command = [str(found / "postgres"), "-D", str(self.folder / "data")]
        for name, value in settings.items():
            command += ["-c", f"{name}={value}"]
        until = time.monotonic() + HANGS_S
        while True:
            if self.process is None or self.process.poll() is not None:  # again: children of a killed one still end
                with (self.folder / "log").open("ab") as log:
                    self.process = subprocess.Popen(command, stdout=log, stderr=log, cwd=self.folder, **_account())
            try:
                self.connect().close()
            except psycopg.OperationalError as error:
                if time.monotonic() > until:
                    said = (self.folder / "log").read_text(errors="replace")
                    raise RuntimeError(f"PostgreSQL did not begin to serve; it said: {said[-2000:]}") from error
                _pause.wait(0.05)
            else:
                return

    def kill(self) -> None:
        """End the postmaster as a loss of power would end it, without a last word; its children follow."""
        assert self.process is not None
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()

    def stop(self) -> None:
        """End it at once, in order."""
        if self.process is not None and self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)  # fast: connections are ended
            self.process.wait(HANGS_S)

    def abandon(self) -> None:
        """End it and its children without tidying up."""
        if self.process is not None and self.process.poll() is None:
            self.process.send_signal(signal.SIGQUIT)
            self.process.wait(HANGS_S)


@contextmanager
def server(**settings: str) -> Iterator[Server]:
    """PostgreSQL with ``settings`` of its configuration, until the block ends."""
    found = programs()
    assert found is not None
    folder = Path(tempfile.mkdtemp(prefix="tsis-postgres-"))  # not below pytest's folders, which nobody else may enter
    if os.getuid() == 0:
        shutil.chown(folder, ACCOUNT)
    one = Server(folder, _free_port(), secrets.token_hex(12), settings)
    try:
        (folder / "password").write_text(one.password)
        (folder / "password").chmod(0o644)
        subprocess.run(
            [
                str(found / "initdb"),
                *("-D", str(folder / "data"), "-U", USER, "--pwfile", str(folder / "password")),
                *("--auth=scram-sha-256", "--encoding=UTF8", "--locale=C", "--no-sync"),
            ],
            check=True,
            capture_output=True,
            cwd=folder,
            **_account(),
        )
        one.start()
        yield one
    finally:
        one.abandon()
        shutil.rmtree(folder, ignore_errors=True)


def _account() -> dict[str, Any]:
    return {"user": ACCOUNT, "group": ACCOUNT, "extra_groups": []} if os.getuid() == 0 else {}


def _free_port() -> int:
    with socket.socket() as one:
        one.bind((LOOPBACK, 0))
        port: int = one.getsockname()[1]
        return port
