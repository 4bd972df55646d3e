from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import pytest

from tsis.cli import main

if TYPE_CHECKING:
    from pathlib import Path


@dataclass(frozen=True)
class Finished:
    code: int
    out: str
    err: str


class RunTsis(Protocol):
    """Runs the program in this process, in an empty folder."""

    def __call__(self, *arguments: str | Path) -> Finished: ...


@pytest.fixture
def run_tsis(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> RunTsis:
    monkeypatch.chdir(tmp_path)

    def run(*arguments: str | Path) -> Finished:
        monkeypatch.setattr(sys, "argv", ["tsis", *map(str, arguments)])
        with pytest.raises(SystemExit) as stop:
            main()
        captured = capsys.readouterr()
        code = stop.value.code
        return Finished(code=code if isinstance(code, int) else 0, out=captured.out, err=captured.err)

    return run


@pytest.fixture(scope="session")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with ``demo``, whose frames and estimate went into the store ``records``."""
    folder = tmp_path_factory.mktemp("round")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setattr(
            sys, "argv", ["tsis", "demo", "--keep", "--store", "records", "--phantom", "size-8", "--out", "demo"]
        )
        with pytest.raises(SystemExit) as stop:
            main()
    assert not stop.value.code
    return folder


@pytest.fixture
def run(run_tsis: RunTsis, kept: Path, monkeypatch: pytest.MonkeyPatch) -> RunTsis:
    """Runs the program in that folder."""
    monkeypatch.chdir(kept)
    return run_tsis
