from __future__ import annotations

import json
import shutil
import sys
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import pytest
from tests.cli.disc_frames import write_disc_frames
from tests.cli.published import faults
from tests.present.rough_pictures import rough_pictures
from tests.records.pressed_object import stored_object
from tests.records.sample import WHEN, levels

from tsis.cli import main
from tsis.console.worker import WorkerProcess
from tsis.model.image import TactileImage
from tsis.records.store import open_store

if TYPE_CHECKING:
    from collections.abc import Iterator


@dataclass(frozen=True)
class Finished:
    code: int
    out: str
    err: str


class RunTsis(Protocol):
    """Runs the program in this process, in an empty folder."""

    def __call__(self, *arguments: str | Path) -> Finished: ...


@pytest.fixture
def idle_solver(monkeypatch: pytest.MonkeyPatch) -> WorkerProcess:
    """What a console gets as its solving process, which never begins: quick tests start no processes."""
    result = WorkerProcess()
    monkeypatch.setattr(result, "begin", lambda: None)
    monkeypatch.setattr("tsis.console.worker.solving_process", lambda: result)
    return result


@pytest.fixture
def run_tsis(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> RunTsis:
    monkeypatch.chdir(tmp_path)

    def run(*arguments: str | Path) -> Finished:
        monkeypatch.setattr(sys, "argv", ["tsis", *map(str, arguments)])
        with pytest.raises(SystemExit) as stop:
            main()
        captured = capsys.readouterr()
        code = stop.value.code
        if captured.out.startswith('{\n  "schema"'):
            assert faults(json.loads(captured.out)) == []
        return Finished(code=code if isinstance(code, int) else 0, out=captured.out, err=captured.err)

    return run


@pytest.fixture(scope="session")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with ``demo``, whose frames and estimate went into the store ``records``."""
    folder = tmp_path_factory.mktemp("round")
    with pytest.MonkeyPatch.context() as patch, rough_pictures():
        patch.chdir(folder)
        options = ["--seed", "4", "--strain", "small", "--phantom", "size-8", "--out", "demo"]
        patch.setattr(sys, "argv", ["tsis", "demo", "--save", "--store", "records", *options])
        with pytest.raises(SystemExit) as stop:
            main()
    assert not stop.value.code
    return folder


@pytest.fixture
def run(run_tsis: RunTsis, kept: Path, monkeypatch: pytest.MonkeyPatch) -> RunTsis:
    """Runs the program in that folder."""
    monkeypatch.chdir(kept)
    return run_tsis


@pytest.fixture(scope="session")
def filled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store with an object whose hardness was estimated (1), and presses without an estimate (2)."""
    folder = tmp_path_factory.mktemp("filled") / "records"
    with open_store(folder) as store:
        stored_object(store)
        plain = store.add_target(name="[bold]plain[/bold]", note="left")
        for second in range(5):
            image = TactileImage(grey=levels(second), force_n=0.5, name=f"p{second}.png")
            store.add_press(plain, image, taken=WHEN + timedelta(seconds=second), role="plain", flags=("moving",))
    return folder


@pytest.fixture
def records(filled: Path, tmp_path: Path) -> Path:
    """A copy of it."""
    return Path(shutil.copytree(filled, tmp_path / "records"))


@pytest.fixture(scope="module", autouse=True)
def _rough_pictures() -> Iterator[None]:
    """Draw one picture of each title in a file and render none: tests of reports look at those."""
    with rough_pictures():
        yield


@pytest.fixture
def disc_frames(tmp_path: Path) -> None:
    write_disc_frames(tmp_path)
