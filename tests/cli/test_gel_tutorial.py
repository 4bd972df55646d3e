"""The commands of the tutorial of gel sensors, in its order, and the numbers at the end of its parts."""

from __future__ import annotations

import json
import re
import shlex
import shutil
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from tests.cli.conftest import RunTsis

PAGE = Path(__file__).parents[2] / "docs" / "tutorial" / "my-gelsight.md"


def page_commands(*, real: bool = False) -> list[list[str]]:
    """The commands on the virtual sensor's frames, or those on real ones."""
    lines = PAGE.read_text(encoding="utf-8").split("## The same on real frames")[real].splitlines()
    return [shlex.split(line.removeprefix("$ tsis ")) for line in lines if line.startswith("$ tsis ")]


def expanded(words: list[str], folder: Path) -> list[str]:
    """The words with patterns of files replaced by the files, as a shell does it."""
    result: list[str] = []
    for word in words:
        found = sorted(str(path.relative_to(folder)) for path in folder.glob(word)) if "*" in word else [word]
        result += found
    return result


def test_the_page_goes_from_frames_to_a_modulus() -> None:
    names = [words[0] for words in page_commands()]
    assert names == ["simulate", "sensor", "sensor", "contacts", "contacts", "depth", "depth", "force", "hardness"]


@pytest.mark.slow
def test_the_commands_of_the_page_end_in_its_modulus(run_tsis: RunTsis, tmp_path: Path) -> None:
    *before, last = page_commands()
    for words in before:
        finished = run_tsis(*expanded(words, tmp_path))
        assert finished.code == 0, finished.err or finished.out
        if words[0] == "force":
            result = json.loads(run_tsis(*expanded(words, tmp_path), "--json").out)
            assert result["force_n"] == pytest.approx(0.3, rel=0.1)
    finished = run_tsis(*last, "--json")
    assert finished.code == 0, finished.err
    found = json.loads(finished.out)["estimate"]["parameters"]["young_kpa"]
    low, high = found["interval_90"]
    truth = json.loads((tmp_path / "my-frames" / "truth" / "truth.json").read_text())["ball_kpa"]
    assert low < truth < high
    assert found["mean"] == pytest.approx(104, rel=0.05)


@pytest.mark.slow
def test_the_commands_on_real_frames_give_the_numbers_of_the_page(
    run_tsis: RunTsis, tmp_path: Path, shared_data: Path
) -> None:
    for name, kind in (("untouched", "ref"), ("ball", "sample")):
        source = shared_data / "real" / "9dtact" / "sensor_1" / f"depth_calibration_rectify_crop_{kind}.png"
        shutil.copy(source, tmp_path / f"{name}.png")
    commands = page_commands(real=True)
    assert [words[0] for words in commands] == ["contacts", "depth", "depth"]
    printed = []
    for words in commands:
        finished = run_tsis(*words)
        assert finished.code == 0, finished.err or finished.out
        printed.append(finished.out)
    page = " ".join(PAGE.read_text(encoding="utf-8").split())
    (radius,) = re.findall(r"contact is (\S+ ± \S+) mm", page)
    (distance,) = re.findall(r"lies (\S+) mm from the ball", page)
    assert radius in printed[0]
    assert distance in printed[1]
