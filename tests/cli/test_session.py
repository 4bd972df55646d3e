"""``tsis session``: guesses are shown, confirmed and written."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np

from tsis.files.images import encode_picture

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.conftest import RunTsis


def test_a_folder_becomes_a_session_after_a_yes(run_tsis: RunTsis, tmp_path: Path) -> None:
    for name in ("a.png", "untouched.png"):
        (tmp_path / name).write_bytes(encode_picture(np.full((20, 30), 80, np.uint8)))
    (tmp_path / "forces.csv").write_text("file;force / mN\na.png;250,5\n")
    asked = run_tsis("session", ".", "--scale-mm", "0.05")
    assert asked.code == 2
    assert "give --yes" in asked.err
    assert "0.2505" in asked.out
    assert not (tmp_path / "presses.csv").exists()
    written = run_tsis("session", ".", "--scale-mm", "0.05", "--yes", "--json")
    assert written.code == 0, written.err
    assert [frame["force_n"] for frame in json.loads(written.out)["frames"]] == [0.2505, 0.0]
    assert "a.png" in (tmp_path / "presses.csv").read_text()
