"""Whatever dies, is damaged or interrupted: the data set has the bytes of one that was left in peace."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.sweep.stand_ins import MARKER, content, deadly, deadly_once, faulty, quick, refusing, small_plan

from tsis.errors import FileInputError, InputError, MissingExtraError, SweepError, UnknownNameError
from tsis.sweep.data_set import begun, head, read_data_set, verify_data_set
from tsis.sweep.run import run_sweep

if TYPE_CHECKING:
    from collections.abc import Callable


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("undisturbed") / "data"
    done = run_sweep(small_plan(), folder, workers=1, press=quick)
    assert (done.presses, done.shards, done.computed, done.kept, done.lost) == (60, 6, 6, 0, 0)
    return folder


def stop_after(files: int) -> Callable[[int, int], None]:
    def progress(done: int, _: int) -> None:
        if done >= files:
            raise KeyboardInterrupt

    return progress


@pytest.mark.system
def test_interrupted_and_resumed_with_other_workers(undisturbed: Path, tmp_path: Path) -> None:
    folder = tmp_path / "data"
    with pytest.raises(KeyboardInterrupt):
        run_sweep(small_plan(), folder, workers=2, press=quick, progress=stop_after(2))
    assert not json.loads((folder / "manifest.json").read_text())["complete"]
    with pytest.raises(FileInputError, match="must hold a complete data set; tsis sweep run with its plan finishes it"):
        verify_data_set(folder)
    done = run_sweep(small_plan(), folder, workers=1, press=quick)
    assert done.kept >= 2
    assert done.kept + done.computed == 6
    assert content(folder) == content(undisturbed)


@pytest.mark.system
def test_killed_workers_lose_nothing(undisturbed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "died").mkdir()
    monkeypatch.setenv(MARKER, str(tmp_path / "died"))
    done = run_sweep(small_plan(), tmp_path / "data", workers=2, press=deadly_once)
    assert done.lost >= 3
    assert content(tmp_path / "data") == content(undisturbed)


@pytest.mark.system
def test_damaged_cut_foreign_and_missing_files_are_computed_again(undisturbed: Path, tmp_path: Path) -> None:
    folder = tmp_path / "data"
    folder.mkdir()
    files = content(undisturbed)
    damaged = bytearray(files["part-000000.parquet"])
    damaged[99] ^= 1
    changed = {
        **files,
        "part-000000.parquet": bytes(damaged),
        "part-000001.parquet": files["part-000001.parquet"][:-7],
        "part-000002.parquet": files["part-000003.parquet"],
        "part-000004.parquet": b"",
        ".part-000009.parquet-0.unfinished": b"left by a killed worker",
    }
    del changed["part-000005.parquet"]
    for name, data in changed.items():
        (folder / name).write_bytes(data)
    with pytest.raises(FileInputError, match=r"got 6 wrong files: part-000000.parquet \(damaged\)"):
        verify_data_set(folder)
    with pytest.raises(FileInputError, match="its SHA-256 differs"):
        read_data_set(folder)
    done = run_sweep(small_plan(), folder, workers=1, press=quick)
    assert done.repaired == tuple(f"part-00000{k}.parquet" for k in (0, 1, 2, 4))
    assert (done.computed, done.kept) == (5, 1)
    assert content(folder) == files
    verify_data_set(folder)


@pytest.mark.system
def test_a_lost_manifest_is_written_again(undisturbed: Path, tmp_path: Path) -> None:
    folder = tmp_path / "data"
    folder.mkdir()
    for name, data in content(undisturbed).items():
        if name != "manifest.json":
            (folder / name).write_bytes(data)
    assert run_sweep(small_plan(), folder, workers=1, press=quick).kept == 6
    assert content(folder) == content(undisturbed)


def test_another_plan_is_refused_and_changes_nothing(undisturbed: Path) -> None:
    before = content(undisturbed)
    with pytest.raises(FileInputError, match="got one of another plan, which differs in forces_n, seed"):
        run_sweep(small_plan(seed=5, forces_n=(2.0,)), undisturbed, workers=1, press=quick)
    assert content(undisturbed) == before


def test_other_versions_of_the_libraries_are_refused(undisturbed: Path, tmp_path: Path) -> None:
    start = head(small_plan())
    with begun(tmp_path / "data", {**start, "libraries": {**start["libraries"], "numpy": "1.0"}}):
        pass
    with pytest.raises(FileInputError, match=r"was begun with numpy 1\.0 and not"):
        run_sweep(small_plan(), tmp_path / "data", workers=1, press=quick)


def test_a_folder_of_something_else_is_refused(undisturbed: Path, tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(FileInputError, match=r"must be new, empty, or a folder that this plan began; got 'notes.txt'"):
        run_sweep(small_plan(), tmp_path, workers=1, press=quick)
    other = tmp_path / "other"
    other.mkdir()
    (other / "part-000000.parquet").write_bytes(content(undisturbed)["part-000000.parquet"])
    with pytest.raises(FileInputError, match=r"got 'part-000000\.parquet'"):
        run_sweep(small_plan(seed=5), other, workers=1, press=quick)
    with pytest.raises(FileInputError, match="must be a folder that can be written"):
        run_sweep(small_plan(), tmp_path / "notes.txt", workers=1, press=quick)
    with pytest.raises(FileInputError, match="folder must be the name of a folder"):
        run_sweep(small_plan(), "no\0name", workers=1, press=quick)


@pytest.mark.skipif(sys.platform == "win32", reason="no such locks")
def test_two_sweeps_do_not_share_a_folder(tmp_path: Path) -> None:
    with begun(tmp_path / "data", head(small_plan())), pytest.raises(FileInputError, match="must not be in use"):
        run_sweep(small_plan(), tmp_path / "data", workers=1, press=quick)


@pytest.mark.system
def test_a_batch_that_kills_every_worker_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tsis.sweep.run.MOST_LOST", 1)
    with pytest.raises(
        SweepError, match=r"3 batches in a row lost their worker, the last one that of part-00000\d\.par"
    ):
        run_sweep(small_plan(), tmp_path / "data", workers=1, press=deadly)


@pytest.mark.system
def test_a_fault_stops_the_sweep_and_is_told(tmp_path: Path) -> None:
    with pytest.raises(SweepError, match=r"part-00000\d\.parquet could not be computed: TypeError: of all things"):
        run_sweep(small_plan(), tmp_path / "data", workers=1, press=faulty)


@pytest.mark.system
def test_a_folder_that_disappears_is_told(tmp_path: Path) -> None:
    folder = tmp_path / "data"

    def remove(done: int, _: int) -> None:
        if done == 1:
            (folder / "manifest.json").unlink()

    with pytest.raises(SweepError, match="must be seen by every worker"):
        run_sweep(small_plan(count=600), folder, workers=1, press=quick, progress=remove)


@pytest.mark.system
def test_refused_presses_are_rows_that_are_counted(tmp_path: Path) -> None:
    done = run_sweep(small_plan(), tmp_path / "data", workers=1, press=refusing)
    found = read_data_set(tmp_path / "data")
    assert 0 < done.refused < 60
    np.testing.assert_array_equal(found["error"] != "", found["young_kpa"] > 150)
    np.testing.assert_array_equal(np.isnan(found["approach_mm"]), found["young_kpa"] > 150)
    assert verify_data_set(tmp_path / "data")["refused"] == done.refused


def test_arrays_come_back(undisturbed: Path) -> None:
    found = read_data_set(undisturbed)
    assert found["pressure_kpa"].shape == (60, 3)
    assert found["radius_mm"].tolist() == [0.0, 3.0, 12.0]
    assert found["sample"].tolist() == list(range(60))
    assert (found["error"] == "").all()
    some = read_data_set(undisturbed, ["depth_mm"])
    assert set(some) == {"radius_mm", "depth_mm"}
    np.testing.assert_array_equal(some["depth_mm"], found["depth_mm"])
    with pytest.raises(UnknownNameError, match="did you mean 'depth_mm'"):
        read_data_set(undisturbed, ["dept_mm"])


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ('"format": "tsis-sweep"', '"format": "other"', "must be of tsis-sweep, version 1"),
        ('"part-000000.parquet"', '"../part-000000.parquet"', "its hashes do not agree|manifest of a sweep"),
        ('"seed": 4', '"seed": 5', "its hashes do not agree"),
        ('"seed": 4', '"seed": -4', "seed must be a whole number"),
        ("{", "", "must be a readable JSON file"),
        ('"shards": [', '"shards": [3, ', "must be the manifest of a sweep"),
    ],
)
def test_a_changed_manifest_is_refused(undisturbed: Path, tmp_path: Path, old: str, new: str, sentence: str) -> None:
    for name, data in content(undisturbed).items():
        (tmp_path / name).write_bytes(data)
    text = (tmp_path / "manifest.json").read_text()
    assert old in text
    (tmp_path / "manifest.json").write_text(text.replace(old, new, 1))
    for look in (verify_data_set, read_data_set):
        with pytest.raises(FileInputError, match=sentence):
            look(tmp_path)


def test_nothing_in_a_data_set_tells_where_or_when_it_was_made(undisturbed: Path) -> None:
    everything = b"".join(content(undisturbed).values())
    for word in (str(undisturbed).encode(), os.uname().nodename.encode(), str(os.getpid()).encode() + b"-"):
        assert word not in everything


@pytest.mark.parametrize(("workers", "scheduler"), [(0, None), (5000, None), (1, "127.0.0.1:8786"), (1, "tcp://a b:1")])
def test_wrong_workers_are_refused(tmp_path: Path, workers: int, scheduler: str | None) -> None:
    with pytest.raises(InputError, match=r"workers must lie in|scheduler must be an address"):
        run_sweep(small_plan(), tmp_path / "data", workers=workers, scheduler=scheduler, press=quick)
    assert list(tmp_path.iterdir()) == []


def test_a_missing_library_is_named_with_its_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(MissingExtraError, match=r'needs pyarrow.*pip install "tsis\[cluster\]"'):
        run_sweep(small_plan(), tmp_path / "data", press=quick)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.system
def test_a_killed_sweep_is_resumed_with_real_presses(tmp_path: Path) -> None:
    code = (
        "import sys; from pathlib import Path; from tests.sweep.stand_ins import small_plan; "
        "from tsis.sweep.run import run_sweep; told = lambda done, _: print(done, flush=True); "
        "run_sweep(small_plan(count=40, batch=2), Path(sys.argv[1]), workers=2, progress=told)"
    )
    disturbed, peaceful = tmp_path / "disturbed", tmp_path / "peaceful"
    command = [sys.executable, "-c", code, str(disturbed)]
    sweep = subprocess.Popen(command, cwd=Path(__file__).parents[2], stdout=subprocess.PIPE, text=True)
    assert sweep.stdout is not None
    while sweep.stdout.readline() == "0\n":  # until the first file is there
        pass
    sweep.send_signal(signal.SIGKILL)
    sweep.communicate()
    assert not json.loads((disturbed / "manifest.json").read_text())["complete"]
    done = run_sweep(small_plan(count=40, batch=2), disturbed, workers=1)
    assert done.kept >= 1
    run_sweep(small_plan(count=40, batch=2), peaceful, workers=2)
    assert content(disturbed) == content(peaceful)
    assert read_data_set(peaceful)["pressure_kpa"].min() > 0


@pytest.mark.system
def test_a_script_without_its_guard_is_told_of_it(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(
        "from tests.sweep.stand_ins import quick, small_plan\n"
        "from tsis.sweep.run import run_sweep\n"
        f"run_sweep(small_plan(), {str(tmp_path / 'data')!r}, workers=1, press=quick)\n"
    )
    path = os.pathsep.join(filter(None, [str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH")]))
    finished = subprocess.run(
        [sys.executable, str(script)],
        env=os.environ | {"PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    assert finished.returncode == 1
    assert 'a script must call run_sweep under if __name__ == "__main__"' in finished.stderr.splitlines()[-1]


@pytest.mark.slow
def test_the_finite_strain_model_is_swept(tmp_path: Path) -> None:
    plan = small_plan(strain="finite", count=2, batch=1)
    done = run_sweep(plan, tmp_path / "data", workers=2)
    assert (done.presses, done.refused) == (2, 0)
    small = run_sweep(small_plan(count=2, batch=1), tmp_path / "small", workers=2)
    assert small.refused == 0
    finite_mm, small_mm = (read_data_set(tmp_path / name)["approach_mm"] for name in ("data", "small"))
    np.testing.assert_allclose(finite_mm, small_mm, rtol=0.3)
    assert (finite_mm != small_mm).all()
