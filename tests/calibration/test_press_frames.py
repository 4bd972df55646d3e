"""Limits of folders of frames."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from tsis.calibration import frames, load_frames
from tsis.errors import TsisError

if TYPE_CHECKING:
    from pathlib import Path


@pytest.mark.parametrize(("most", "refusal"), [(3, "it holds neither"), (2, "at most 2 sidecars; it holds 3")])
def test_a_folder_may_hold_as_many_sidecars_as_the_limit(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, most: int, refusal: str
) -> None:
    monkeypatch.setattr(frames, "MOST_FRAMES", most)
    for number in range(3):
        (tmp_path / f"{number}.json").write_text("{}", encoding="utf-8")
    with pytest.raises(TsisError, match=refusal):
        load_frames(tmp_path)
