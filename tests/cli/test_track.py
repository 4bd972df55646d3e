"""``tsis track``: known paths and known relaxations are found, and sequences that do not suffice are refused."""

from __future__ import annotations

import csv
import json
from typing import TYPE_CHECKING

import numpy as np
import pytest

from tsis.calibration.settling import assess_settling
from tsis.inclusion.mobility import mobility
from tsis.instrument.image_files import png_bytes, read_image
from tsis.instrument.recording import RECORDING_COLUMNS
from tsis.model.image import TactileImage

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray
    from tests.cli.conftest import RunTsis

STEP_S, TAU_S, SCALE_MM = 0.5, 3.0, 0.1
ROUND = np.linspace(0.0, 2 * np.pi, 60)
OPTIONS = ("--reference", "dark.png", "--scale-mm", "0.1")


def light(x_mm: float, y_mm: float, peak: float) -> NDArray[np.float64]:
    y, x = np.mgrid[:60, :80] * SCALE_MM
    return np.asarray(10.0 + peak * np.exp(-((x - 3.95 - x_mm) ** 2 + (y - 2.95 - y_mm) ** 2) / 1.2))


@pytest.fixture
def sequence(tmp_path: Path) -> list[str]:
    """A bump of light that goes around a circle of 1 mm while the press relaxes to 70 % with one time constant."""
    noise = np.random.default_rng(608)
    names = []
    for number, angle in enumerate(ROUND):
        peak = 100.0 * (0.7 + 0.3 * np.exp(-number * STEP_S / TAU_S))
        grey = light(np.cos(angle), np.sin(angle), peak) + 0.5 * noise.standard_normal((60, 80))
        names.append(f"frame-{number:03}.png")
        (tmp_path / names[-1]).write_bytes(png_bytes(TactileImage(grey=np.rint(grey))))
    (tmp_path / "dark.png").write_bytes(png_bytes(TactileImage(grey=np.full((60, 80), 10.0))))
    return names


def test_a_known_path_and_relaxation_are_found(run_tsis: RunTsis, sequence: list[str], tmp_path: Path) -> None:
    finished = run_tsis("track", *sequence, *OPTIONS, "--interval-s", "0.5", "--json")
    assert finished.code == 0, finished.err
    document = json.loads(finished.out)
    moved = document["mobility"]
    assert moved["excursion_mm"] == pytest.approx(2.0, abs=0.05)
    circle = np.transpose([np.cos(ROUND), np.sin(ROUND)])
    np.testing.assert_allclose(moved["position_mm"], circle, atol=0.05)
    expected = mobility(
        [read_image(tmp_path / name, mm_per_pixel=(SCALE_MM, SCALE_MM)) for name in sequence],
        read_image(tmp_path / "dark.png", mm_per_pixel=(SCALE_MM, SCALE_MM)),
        against="untouched probe",
    )
    assert (moved["path_mm"], moved["noise_mm"]) == (expected.path_mm, expected.noise_mm)
    settling = document["settling"]
    again = assess_settling(document["time_s"], document["total_grey"])
    assert (settling["verdict"], settling["bound"], settling["wait_s"]) == (again.verdict, again.bound, again.wait_s)
    assert document["total_grey"][-1] / document["total_grey"][0] == pytest.approx(0.7, abs=0.01)
    page = (tmp_path / "tsis-track" / "index.html").read_text()
    assert "Path of the light" in page
    assert "Research use only" in page


def test_a_press_is_settling_first_and_settled_later(run_tsis: RunTsis, sequence: list[str]) -> None:
    """Of a relaxation with one time constant the part still to come is known."""
    early = run_tsis("track", *sequence[:20], *OPTIONS, "--interval-s", "0.5", "--longest-s", "10", "--json")
    settling = json.loads(early.out)["settling"]
    end = 19 * STEP_S
    true = -0.3 * np.exp(-end / TAU_S) / (0.7 + 0.3 * np.exp(-end / TAU_S))
    assert settling["verdict"] == "settling"
    assert settling["remaining"]["value"] == pytest.approx(true, abs=3 * settling["remaining"]["sd"])
    late = run_tsis("track", *sequence, *OPTIONS, "--interval-s", "0.5", "--longest-s", "10", "--json")
    assert json.loads(late.out)["settling"]["verdict"] == "settled"


def test_a_recorded_folder_has_its_own_times(run_tsis: RunTsis, sequence: list[str], tmp_path: Path) -> None:
    with (tmp_path / "frames.csv").open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(RECORDING_COLUMNS)
        rows.writerows((number, name, 0, number, "", 7.0 + STEP_S * number) for number, name in enumerate(sequence))
    recorded = run_tsis("track", ".", *OPTIONS, "--json", "--out", "recorded")
    assert recorded.code == 0, recorded.err
    named = run_tsis("track", *sequence, *OPTIONS, "--interval-s", "0.5", "--json", "--out", "named")
    one, other = json.loads(recorded.out), json.loads(named.out)
    assert one["mobility"] == other["mobility"]
    assert one["settling"]["verdict"] == other["settling"]["verdict"]
    assert one["time_s"][0] == 7.0
    assert "contains the times of its frames" in run_tsis("track", ".", *OPTIONS, "--interval-s", "1").err


def test_without_times_settling_is_not_judged(run_tsis: RunTsis, sequence: list[str]) -> None:
    finished = run_tsis("track", *sequence[:3], *OPTIONS)
    assert finished.code == 0, finished.err
    message = " ".join(finished.out.split())
    assert "Settling is not judged: it needs the times of the frames." in message
    assert "Research use only" in message


@pytest.mark.usefixtures("sequence")
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["frame-000.png", *OPTIONS], "images must hold at least two frames"),
        (["frame-000.png", "frame-001.png", "--scale-mm", "0.1"], "give the untouched probe as --reference"),
        (["frame-000.png", "frame-001.png", "--reference", "dark.png"], "a movement needs --scale-mm"),
        (["frame-000.png", "frame-001.png", *OPTIONS, "--interval-s", "0"], "--interval-s must lie in"),
        (["frame-000.png", "frame-001.png", *OPTIONS, "--interval-s", "1", "--tolerance", "2"], "tolerance must lie"),
        (["frame-000.png", "frame-001.png", *OPTIONS, "--interval-s", "1", "--longest-s", "0"], "longest_s must lie"),
        (["frame-000.png", "frame-001.png", *OPTIONS, "--tolerance", "0.1"], "--tolerance must be given with times"),
        (["frame-000.png", "frame-001.png", *OPTIONS, "--longest-s", "9"], "--longest-s must be given with times"),
        (["frame-000.png", "none.png", *OPTIONS], "none.png"),
        ([".", *OPTIONS], "frames.csv"),
    ],
)
def test_a_sequence_that_does_not_suffice_is_refused(
    run_tsis: RunTsis, arguments: list[str], message: str, tmp_path: Path
) -> None:
    finished = run_tsis("track", *arguments)
    assert finished.code == 2
    assert message in finished.err
    assert finished.err.count("\n") == 1
    assert not (tmp_path / "tsis-track").exists()


@pytest.mark.parametrize(
    "text",
    ["", "a,b\n1,2\n", *(f"kept_in,arrived_s\n{row}" for row in ("", "../x.png,1.0\n", "x.png,nan\n", "x.png\n"))],
)
def test_an_index_that_is_none_is_refused(run_tsis: RunTsis, tmp_path: Path, text: str) -> None:
    (tmp_path / "frames.csv").write_text(text)
    finished = run_tsis("track", ".", *OPTIONS)
    assert finished.code == 2
    assert "frames.csv" in finished.err
    assert finished.err.count("\n") == 1
