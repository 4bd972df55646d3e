from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest

from tsis.catalog.phantoms import list_phantoms
from tsis.catalog.probes import list_probes

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.conftest import RunTsis


def test_at_small_strain_the_press_is_linear_in_the_force(run_tsis: RunTsis) -> None:
    light, strong = (
        json.loads(run_tsis("simulate", "--strain", "small", "--force-n", force, "--json").out)
        for force in ("0.5", "1")
    )
    np.testing.assert_allclose(2 * np.array(light["pressure_kpa"]), strong["pressure_kpa"], rtol=1e-12)
    assert strong["change_by_inclusion_mm"][0] > 0


def test_the_catalog_is_listed(run_tsis: RunTsis) -> None:
    listed = json.loads(run_tsis("simulate", "--list", "--json").out)
    assert set(listed["phantoms"]) == set(list_phantoms())
    assert set(listed["probes"]) == set(list_probes())
    for name in list_phantoms():
        assert name in run_tsis("simulate", "--list").out


def test_people_get_a_table(run_tsis: RunTsis) -> None:
    finished = run_tsis("simulate", "--phantom", "depth-8", "--strain", "small")
    assert finished.code == 0
    assert "pressure" in finished.out
    assert "Research use only" in finished.out


def test_a_dome_and_either_strain_are_pressed(run_tsis: RunTsis) -> None:
    domed = json.loads(
        run_tsis("simulate", "--probe", "tsis-domed", "--force-n", "0.1", "--strain", "small", "--json").out
    )
    assert domed["pressure_kpa"][-1] == 0.0, "it touches in the middle only"
    small, finite = (
        json.loads(run_tsis("simulate", "--phantom", "plain", "--force-n", "0.1", *strain, "--json").out)
        for strain in (("--strain", "small"), ())
    )
    assert finite["strain"] == "finite"
    np.testing.assert_allclose(finite["approach_mm"], small["approach_mm"], rtol=0.06)  # its rim is rounded
    assert finite["approach_mm"] != small["approach_mm"]


def test_a_force_beyond_the_model_is_one_sentence(run_tsis: RunTsis) -> None:
    finished = run_tsis("simulate", "--force-n", "9", "--strain", "small")
    assert finished.code != 0
    assert "choose a force of at most" in " ".join(finished.err.split())
    assert "Traceback" not in finished.err


@pytest.mark.slow
def test_a_virtual_gel_sensor_writes_frames_forces_and_its_truth_apart(run_tsis: RunTsis, tmp_path: Path) -> None:
    options = ("--ball-mm", "8", "--ball-kpa", "120", "--force-n", "0.4", "--presses", "1", "--seed", "5")
    finished = run_tsis("simulate", "--sensor", "gelsight-mini", *options, "--calibration-presses", "0", "--json")
    assert finished.code == 0, finished.err
    (frame,) = json.loads(finished.out)["frames"]
    folder = tmp_path / "virtual-gel"
    assert sorted(path.name for path in folder.iterdir()) == [
        "press-1.json", "press-1.png", "result.json", "truth", "untouched.png",
    ]  # fmt: skip
    (truth,) = json.loads((folder / "truth" / "truth.json").read_text())["contacts"]
    assert truth["force_n"] == 0.4
    assert abs(frame["force_n"] / 0.4 - 1.0) < 0.05, "the gauge errs"
    depth = np.load(folder / "truth" / "press-1-depth.npy")
    assert depth.shape == (240, 320)
    found = run_tsis(
        "contacts", "virtual-gel/press-1.png", "--sensor", "gelsight-mini", "--reference", "virtual-gel/untouched.png",
        "--csv", "c.csv",
    )  # fmt: skip
    assert found.code == 0, found.err
    header, row = (tmp_path / "c.csv").read_text().splitlines()
    values = dict(zip(header.split(","), row.split(","), strict=True))
    assert float(values["force_n"]) == frame["force_n"]
    assert abs(float(values["radius_px"]) / truth["radius_px"] - 1.0) < 0.08


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--sensor", "digit"), "a virtual gel sensor must be flat; digit is curved"),
        (("--sensor", "gelsight-mino"), "did you mean 'gelsight-mini'"),
        (("--sensor", "gelsight-mini", "--ball-kpa", "-1"), "--ball-kpa must lie in"),
        (("--sensor", "gelsight-mini", "--presses", "0"), "--presses must"),
    ],
)
def test_a_gel_that_cannot_be_simulated_is_one_sentence(
    run_tsis: RunTsis, arguments: tuple[str, ...], said: str
) -> None:
    finished = run_tsis("simulate", *arguments)
    assert finished.code == 2
    assert said in " ".join(finished.err.split())
    assert finished.err.count("\n") == 1


SCAN, LUMP = ("--scan", "s"), ("--scan", "s", "--places", "2", "--spacing-mm", "20")  # which ends 10 mm from the middle


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        *(((*SCAN, option, value), f"{option} must be given for a press on a phantom only; --scan does not use it")
          for option, value in (("--phantom", "size-8"), ("--diameter-mm", "8"), ("--depth-mm", "5"),
                                ("--young-kpa", "40"), ("--strain", "small"))),
        *(((option, value), f"{option} must be given for a scan (--scan) only; a press on a phantom does not use it")
          for option, value in (("--lump", "0,0,5,9,40"), ("--places", "3"), ("--spacing-mm", "5"),
                                ("--place-sd-mm", "1"))),
        *(((option, value), f"{option} must be given for a gel sensor (--sensor) only; a press on a phantom does not")
          for option, value in (("--out", "o"), ("--ball-mm", "5"), ("--ball-kpa", "9"), ("--presses", "2"),
                                ("--calibration-presses", "2"), ("--drag", "0.1"))),
        (("--seed", "1"), "--seed must be given for a scan (--scan) or a gel sensor (--sensor) only"),
        *((("--sensor", "gelsight-mini", option, value), f"{option} must be given for ")
          for option, value in (("--phantom", "size-8"), ("--strain", "small"), ("--probe", "tsis-2011"),
                                ("--places", "3"))),
        ((*SCAN, "--sensor", "gelsight-mini"), "--sensor must be given for a gel sensor (--sensor) only"),
        (("--list", "--probe", "tsis-2011"), "--probe must be given for"),
        ((*LUMP, "--lump", "25,0,5,9,40"), "--lump 1 must lie at most 14.5 mm"),
        ((*LUMP, "--lump", "0,0,5,9,40", "--lump", "20,-20,5,4,40"), "--lump 2 must lie at most 12 mm"),
        ((*LUMP, "--lump", "0,0,5,9,40", "--lump", "5,0,5,9,40"), "--lump 1 and --lump 2 must not overlap"),
    ],
)  # fmt: skip
def test_options_of_another_mode_and_lumps_out_of_place_are_refused(
    run_tsis: RunTsis, tmp_path: Path, arguments: tuple[str, ...], said: str
) -> None:
    finished = run_tsis("simulate", *arguments)
    assert finished.code == 2
    assert said in " ".join(finished.err.split())
    assert finished.err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
