"""``tsis force``."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.conftest import RunTsis


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    y, x = np.mgrid[:60, :80] - np.array([29.5, 39.5])[:, None, None]
    np.save(tmp_path / "depth.npy", np.clip(0.3 - (x**2 + y**2) / 600, 0.0, None))
    np.save(tmp_path / "flat.npy", np.zeros((60, 80)))
    np.save(tmp_path / "colour.npy", np.zeros((60, 80, 3)))
    (tmp_path / "text.npy").write_text("no array")
    return tmp_path


def test_a_known_weight_scales_the_force(run_tsis: RunTsis, folder: Path) -> None:
    finished = run_tsis("force", "depth.npy", "--weight", "depth.npy=0.5", "--json", "--out", "pressed")
    assert finished.code == 0, finished.err
    document = json.loads(finished.out)
    assert document["force_n"] == pytest.approx(0.5)
    assert document["interval_n"][0] < 0.5 < document["interval_n"][1]
    folder_name = document["folder"]
    pressure = np.load(folder / folder_name / "pressure_kpa.npy")
    assert pressure.sum() * 0.2528**2 / 1000 == pytest.approx(0.5, rel=1e-3)
    assert (folder / folder_name / "pressure.png").exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((), "give one depth map as an NPY file, or --demo"),
        (("none.npy",), "'none.npy' does not exist"),
        (("text.npy",), "text.npy must be an NPY file"),
        (("colour.npy",), "must hold numbers in rows and columns; got (60, 80, 3)"),
        (("flat.npy",), "no pixel is pressed in by more than 0.03 mm"),
        (("depth.npy", "--markers", "press.png"), "--markers needs a frame of the untouched sensor"),
        (("depth.npy", "--weight", "depth.npy"), "as press.npy=0.5; got 'depth.npy'"),
    ],
)
def test_wrong_input_ends_in_one_sentence(
    run_tsis: RunTsis, folder: Path, arguments: tuple[str, ...], said: str
) -> None:
    finished = run_tsis("force", *arguments)
    assert finished.code == 2
    assert said in " ".join(finished.err.split())
    assert finished.err.count("\n") == 1
    assert folder.exists()
