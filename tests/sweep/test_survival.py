"""Workers of a sweep killed every two seconds, then its whole cluster again and again: the bytes are the same.

Three data sets of one plan: undisturbed on this machine; on this machine with one worker killed every two seconds; on a
Dask cluster whose scheduler, workers and driver are all killed at once, started again and resumed. Linux only: worker
processes are found in /proc.
"""

from __future__ import annotations

import hashlib
import subprocess
import sys
import time
from pathlib import Path

import pytest
from tests.endurance import scaled
from tests.sweep.loopback_cluster import LoopbackCluster

from tsis.sweep.data_set import verify_data_set
from tsis.sweep.plan import EXAMPLE

KILL_EVERY_S = 2.0
PATIENCE_S = 1800.0
TSIS = (sys.executable, "-c", "from tsis.cli import main; main()", "sweep", "run")


def write_plan(path: Path, presses: int, *, plain: bool) -> None:
    """One slab with deep inclusions, or without any, whose presses are ten times quicker."""
    text = EXAMPLE.replace("count = 1024", f"count = {presses}").replace("batch = 64", "batch = 25")
    text = text.replace("depth_mm = [6.0, 16.0]", "depth_mm = [14.0, 24.0]")
    if plain:
        inclusion = ("diameter_mm", "depth_mm", "young_kpa", "logarithmic")
        text = "".join(line for line in text.splitlines(keepends=True) if not line.startswith(inclusion))
        text = text.replace("tissue_young_kpa = 5.0", "tissue_young_kpa = [3.0, 10.0]")
    path.write_text(text)


def start(plan: Path, folder: Path, *arguments: str) -> subprocess.Popen[str]:
    """Start a sweep as a process of its own."""
    command = [*TSIS, str(plan), "--out", str(folder), *arguments]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)


def finish(sweep: subprocess.Popen[str]) -> str:
    """Wait for a sweep; what it printed."""
    out, _ = sweep.communicate()
    if sweep.returncode:
        raise RuntimeError(f"the sweep ended with {sweep.returncode}")
    return out


def hash_of(folder: Path) -> str:
    """SHA-256 of all names and bytes."""
    digest = hashlib.sha256()
    for path in sorted(folder.iterdir()):
        digest.update(path.name.encode() + b"\0" + hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


def files(folder: Path) -> int:
    """Number of files that are done."""
    return len(list(folder.glob("part-*.parquet")))


def children(process: subprocess.Popen[str]) -> list[int]:
    """Process numbers of the worker processes; Python's own tracker of semaphores is none."""
    found: list[int] = []
    for task in Path(f"/proc/{process.pid}/task").iterdir():
        found += map(int, (task / "children").read_text().split())
    return sorted(child for child in found if b"spawn_main" in Path(f"/proc/{child}/cmdline").read_bytes())


def with_worker_deaths(plan: Path, folder: Path, workers: int) -> tuple[int, str]:
    """Run a sweep and kill one of its workers every two seconds; number of kills, and what it printed."""
    sweep = start(plan, folder, "--workers", str(workers))
    kills = 0
    while sweep.poll() is None:
        time.sleep(KILL_EVERY_S)
        try:
            alive = children(sweep)
        except OSError:  # the sweep has just ended
            break
        if alive:
            subprocess.run(["kill", "-KILL", str(alive[kills % len(alive)])], check=False)
            kills += 1
    return kills, finish(sweep)


def with_cluster_deaths(plan: Path, folder: Path, workers: int, kills: int, shards: int) -> None:
    """Run a sweep on a cluster, kill everything whenever a share of the files is done, and resume."""
    logs = folder.with_name("cluster")
    for kill in range(kills):
        with LoopbackCluster(logs, workers) as cluster:
            sweep = start(plan, folder, "--scheduler", cluster.address)
            expected, until = shards * (kill + 1) // (kills + 1), time.monotonic() + PATIENCE_S
            while files(folder) < expected:
                if sweep.poll() is not None or time.monotonic() > until:
                    raise RuntimeError("the sweep stopped by itself")
                time.sleep(0.05)
            sweep.kill()
            cluster.kill()
            sweep.communicate()
    with LoopbackCluster(logs, workers) as cluster:
        finish(start(plan, folder, "--scheduler", cluster.address))


@pytest.mark.slow
@pytest.mark.system
@pytest.mark.skipif(sys.platform != "linux", reason="worker processes are found in /proc")
def test_killed_workers_and_clusters_change_no_byte(tmp_path: Path) -> None:
    plan, presses = tmp_path / "plan.toml", scaled(2000)
    write_plan(plan, presses, plain=True)
    finish(start(plan, tmp_path / "undisturbed", "--workers", "2"))
    kills, _ = with_worker_deaths(plan, tmp_path / "workers", 2)
    with_cluster_deaths(plan, tmp_path / "clusters", 2, 4, files(tmp_path / "undisturbed"))
    hashes = {hash_of(tmp_path / name) for name in ("undisturbed", "workers", "clusters")}
    assert kills > 0
    assert len(hashes) == 1
    assert verify_data_set(tmp_path / "clusters")["presses"] == presses
