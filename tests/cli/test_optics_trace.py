from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.conftest import RunTsis


def test_the_tally_adds_up_and_names_its_probe(run_tsis: RunTsis) -> None:
    found = json.loads(run_tsis("optics", "trace", "--rays", "4000", "--json").out)
    assert sum(found["tally"].values()) == pytest.approx(1.0, abs=1e-12)
    assert found["probe"]["name"] == "tsis-2011"
    assert found["tally"]["contact"] == 0.0
    assert found["force_n"] is None
    assert "Research use only" in found["notice"]


def test_people_get_a_table_and_what_the_indices_mean(run_tsis: RunTsis) -> None:
    finished = run_tsis("optics", "trace", "--rays", "4000")
    assert finished.code == 0
    said = " ".join(finished.out.split())
    assert "out through the side wall" in said
    assert "Light up to 83.7 degrees from the horizontal" in said, "asin(sqrt(1.41^2 - 1))"
    assert "Research use only" in said


def test_a_sphere_presses_by_force_or_by_depth(run_tsis: RunTsis, tmp_path: Path) -> None:
    sphere = ("optics", "trace", "--rays", "20000", "--tip-radius-mm", "10", "--json")
    by_force = json.loads(run_tsis(*sphere, "--force-n", "0.2", "--out", "figures").out)
    assert by_force["tally"]["contact"] > 0.001
    names = {path.name for path in (tmp_path / "figures").iterdir()}
    assert names == {"rays.png", "light-arriving.png", "light-lost.png", "light-coupled.png", "result.json"}
    by_depth = json.loads(run_tsis(*sphere, "--depth-mm", str(by_force["depth_mm"])).out)
    assert by_depth["force_n"] == pytest.approx(0.2, rel=1e-3)
    np.testing.assert_allclose(by_depth["coupled"], by_force["coupled"], atol=1e-5)


def test_lamps_can_be_moved(run_tsis: RunTsis) -> None:
    lamps = ("--half-angle-deg", "30", "--height-mm", "11.5", "--aim-deg", "-5")
    found = json.loads(run_tsis("optics", "trace", "--rays", "4000", *lamps, "--json").out)
    assert all(led["height_mm"] == 11.5 and led["aim_deg"] == -5 for led in found["probe"]["leds"])
    assert found["out_of_reach"] > 0.7, "most of it entered the glass"
    assert found["probe"]["name"] == "tsis-2011 (lamps changed)"


@pytest.mark.parametrize(
    ("given", "phrase"),
    [
        (("--force-n", "1"), "--tip-radius-mm must be given"),
        (("--tip-radius-mm", "10", "--force-n", "1", "--depth-mm", "1"), "must be given, not both"),
        (("--tip-radius-mm", "10", "--depth-mm", "11"), "depth_mm must lie in"),
        (("--tip-radius-mm", "10", "--force-n", "40"), "choose a force below"),
        (("--rays", "nan"), "rays must be a whole number"),
        (("--rays", "10"), "rays must lie in"),
        (("--half-angle-deg", "95"), "half_angle_deg must lie in"),
        (("--probe", "tsis-2012"), "did you mean"),
    ],
)
def test_bad_input_is_one_sentence(run_tsis: RunTsis, given: tuple[str, ...], phrase: str) -> None:
    finished = run_tsis("optics", "trace", *given)
    assert finished.code != 0
    assert phrase in " ".join(finished.err.split())
    assert "Traceback" not in finished.err


@pytest.mark.parametrize(
    ("depth", "sentence"),
    [("9", "depth_mm must be at most 2.36 for this sphere"), ("0.002", "depth_mm must be at least")],
)
def test_a_depth_that_no_force_gives_is_refused(run_tsis: RunTsis, depth: str, sentence: str) -> None:
    finished = run_tsis("optics", "trace", "--tip-radius-mm", "10", "--depth-mm", depth, "--rays", "1e3")
    assert finished.code == 2
    assert sentence in finished.err
