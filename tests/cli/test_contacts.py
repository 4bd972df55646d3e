"""``tsis contacts`` and ``tsis sensor frames``."""

from __future__ import annotations

import csv
import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.conftest import RunTsis


@pytest.fixture
def gel_frames(run_tsis: RunTsis, tmp_path: Path) -> list[dict[str, Any]]:
    finished = run_tsis("sensor", "frames", "gelsight-mini", "--presses", "2", "--seed", "3", "--json")
    assert finished.code == 0, finished.err
    truth: list[dict[str, Any]] = json.loads(finished.out)["truth"]
    return truth


def test_contacts_of_rendered_frames(run_tsis: RunTsis, gel_frames: list[dict[str, Any]], tmp_path: Path) -> None:
    common = ("--sensor", "gelsight-mini", "--reference", "gel-frames/untouched.png")
    files = ("--csv", "c.csv", "--html", "c.html", "--figure", "c.png")
    frames = ("gel-frames/press-1.png", "gel-frames/press-2.png")
    finished = run_tsis("contacts", *frames, *common, *files, "--json")
    assert finished.code == 0, finished.err
    found = json.loads(finished.out)["contacts"]
    for contact, truth in zip(found, gel_frames, strict=True):
        assert np.hypot(*np.subtract(contact["centre_px"], truth["centre_px"])) < 1.0
        assert contact["radius_px"] == pytest.approx(truth["radius_px"], rel=0.06)
    with (tmp_path / "c.csv").open(newline="") as file:
        assert [row["name"] for row in csv.DictReader(file)] == ["press-1.png", "press-2.png"]
    assert b"Research use only" in (tmp_path / "c.html").read_bytes()
    assert (tmp_path / "c.png").read_bytes().startswith(b"\x89PNG")
    empty = run_tsis("contacts", "gel-frames/untouched.png", *common)
    assert empty.code == 3
    assert "no contact" in empty.out


def test_a_sensor_without_a_file_says_which_and_how(run_tsis: RunTsis) -> None:
    finished = run_tsis("contacts", "press.png")
    assert finished.code == 2
    assert "give --sensor gelsight-mini" in finished.err
    assert "tsis sensor new makes" in finished.err
