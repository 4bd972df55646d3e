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
