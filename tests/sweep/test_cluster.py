"""The same bytes from a Dask cluster whose worker is killed, all on the loopback interface."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from tests.sweep.loopback_cluster import LoopbackCluster
from tests.sweep.stand_ins import MARKER, content, quick, small_plan

from tsis.errors import SweepError
from tsis.sweep.run import run_sweep

if TYPE_CHECKING:
    from collections.abc import Iterator

pytestmark = pytest.mark.system
ROOT = Path(__file__).parents[2]
# In a process of its own: threads of Dask's client outlive it.
SWEEP = """
import sys
from tests.sweep import stand_ins
from tsis.errors import TsisError
from tsis.sweep.run import run_sweep
try:
    done = run_sweep(stand_ins.small_plan(), sys.argv[1], scheduler=sys.argv[2], press=getattr(stand_ins, sys.argv[3]))
except TsisError as error:
    sys.exit(f"{type(error).__name__}: {error}")
print(done.computed, done.lost)
"""


@pytest.fixture
def cluster(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[LoopbackCluster]:
    (tmp_path / "died").mkdir()
    monkeypatch.setenv("PYTHONPATH", str(ROOT), prepend=os.pathsep)  # workers find the stand-ins
    monkeypatch.setenv(MARKER, str(tmp_path / "died"))
    with LoopbackCluster(tmp_path / "cluster", workers=2) as started:
        yield started


def sweep(folder: Path, address: str, press: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", SWEEP, str(folder), address, press]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


def listening(pid: int) -> set[str]:
    """Addresses, in the kernel's hexadecimal, on which a process listens."""
    inodes = {str(path.readlink()) for path in Path(f"/proc/{pid}/fd").iterdir() if path.is_symlink()}
    lines = [
        line.split()
        for table in ("tcp", "tcp6")
        for line in Path(f"/proc/{pid}/net/{table}").read_text().splitlines()[1:]
    ]
    return {line[1].split(":")[0] for line in lines if line[3] == "0A" and f"socket:[{line[9]}]" in inodes}


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="reads /proc")
def test_a_cluster_gives_the_same_bytes_and_loses_no_batch_of_a_killed_worker(
    cluster: LoopbackCluster, tmp_path: Path
) -> None:
    for name in ("one", "two"):
        (tmp_path / "died" / name).touch()  # so that only one worker dies of its first press
    finished = sweep(tmp_path / "data", cluster.address, "deadly_once")
    assert finished.returncode == 0, finished.stderr
    assert len(list((tmp_path / "died").iterdir())) == 3
    assert listening(cluster.scheduler.pid) == {"0100007F"}, "nothing listens beyond the loopback interface"
    run_sweep(small_plan(), tmp_path / "peaceful", workers=1, press=quick)
    assert content(tmp_path / "data") == content(tmp_path / "peaceful")


def test_a_scheduler_that_does_not_answer_is_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tsis.sweep.workers.CONNECT_S", 0.5)
    with pytest.raises(SweepError, match=r"a Dask scheduler must answer at tcp://127\.0\.0\.1:9; got OSError"):
        run_sweep(small_plan(), tmp_path / "data", scheduler="tcp://127.0.0.1:9", press=quick)


def test_another_program_at_the_address_is_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tsis.sweep.workers.CONNECT_S", 0.5)
    with socket.create_server(("127.0.0.1", 0)) as other:

        def answer() -> None:
            with suppress(OSError):
                while True:
                    connection, _ = other.accept()
                    connection.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n")
                    connection.close()

        threading.Thread(target=answer, daemon=True).start()
        address = f"tcp://127.0.0.1:{other.getsockname()[1]}"
        with pytest.raises(SweepError, match=f"a Dask scheduler must answer at {address}; got "):
            run_sweep(small_plan(), tmp_path / "data", scheduler=address, press=quick)
        other.shutdown(socket.SHUT_RDWR)
