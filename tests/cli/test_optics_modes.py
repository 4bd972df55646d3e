from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest

from tsis.optics import guided_modes

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.conftest import RunTsis


def words(text: str) -> str:
    return " ".join(text.split())


def test_angles_of_the_printed_probe(run_tsis: RunTsis) -> None:
    found = json.loads(run_tsis("optics", "angles", "--probe", "tsis-2011-printed-indices", "--json").out)
    np.testing.assert_allclose(found["layers"]["acceptance_deg"], [36.01, 34.60, 33.19, 31.75], atol=0.005)
    assert not any(found["layers"]["unlimited"])
    people = run_tsis("optics", "angles", "--probe", "tsis-2011-printed-indices", "--half-angle-deg", "40").out
    assert "36.01" in people
    assert "beyond its acceptance of 33.19" in words(people)
    assert "Research use only" in people


def test_real_indices_take_everything_in_and_say_so(run_tsis: RunTsis) -> None:
    finished = run_tsis("optics", "angles")
    assert finished.code == 0
    assert "every ray that enters there from air stays" in words(finished.out)
    assert "hardly limits the choice of a lamp" in words(finished.out)
    assert "44% of the angles" in words(finished.out)
    assert "nan" not in finished.out.lower()


def test_a_lamp_before_the_glass_never_senses(run_tsis: RunTsis) -> None:
    narrow = ("optics", "angles", "--height-mm", "11.5", "--half-angle-deg", "15", "--aim-deg")
    assert "never reaches the face: change its aim" in words(run_tsis(*narrow, "0").out)
    assert "aim or place it" not in words(run_tsis(*narrow, "40").out)
    found = json.loads(run_tsis(*narrow, "0", "--json").out)
    assert found["leds"][0]["layer"] == 3
    assert found["probe"]["name"] == "tsis-2011 (lamps changed)"


@pytest.mark.parametrize(("polarization", "preset"), [("TE", "realistic"), ("TM", "dissertation")])
def test_modes_of_a_preset(run_tsis: RunTsis, tmp_path: Path, polarization: str, preset: str) -> None:
    finished = run_tsis(
        "optics", "modes", "--preset", preset, "--polarization", polarization, "--out", tmp_path / "f", "--json"
    )
    found = json.loads(finished.out)
    again = guided_modes(found["index"], found["thickness_um"], wavelength_um=0.55, polarization=polarization)  # type: ignore[arg-type]
    assert found["n_eff"] == again.n_eff.tolist()
    assert found["count"] == len(again)
    assert found["never_sensing"] == again.above(found["index"][0])
    assert sorted(path.name for path in (tmp_path / "f").iterdir()) == ["modes.png", "result.json"]


def test_modes_of_a_stack_of_ones_own(run_tsis: RunTsis) -> None:
    finished = run_tsis("optics", "modes", "--index", "1.41,1.515", "--thickness-um", "90,10")
    assert finished.code == 0
    assert "50 of them shown" in words(finished.out)
    assert "do not sense the pressed face" in words(finished.out)
    assert "Research use only" in finished.out


def test_below_cut_off_it_says_what_would_guide(run_tsis: RunTsis) -> None:
    finished = run_tsis("optics", "modes", "--index", "1.5", "--thickness-um", "0.02", "--index-below", "1.4")
    assert finished.code == 0
    assert "8.682 times as thick" in words(finished.out)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--wavelength-um", "550"), "nanometres"),
        (("--index", "1.4"), "given together"),
        (("--index", "1.4;1.5", "--thickness-um", "1,1"), "numbers with commas"),
        (("--index", "1.4", "--thickness-um", "0"), "thickness_um"),
        (("--index", "1.2", "--thickness-um", "1", "--index-below", "1.4"), "exceed the surroundings' 1.4"),
        (("--preset", "disertation"), "did you mean 'dissertation'"),
    ],
)
def test_bad_input_is_one_sentence(run_tsis: RunTsis, arguments: tuple[str, ...], message: str) -> None:
    finished = run_tsis("optics", "modes", *arguments)
    assert finished.code != 0
    assert message in words(finished.err)
    assert "Traceback" not in finished.err


def test_modes_behind_a_layer_of_low_index_are_not_said_to_reach_the_face(run_tsis: RunTsis) -> None:
    parted = " ".join(run_tsis("optics", "modes", "--index", "1.41,1.2,1.40", "--thickness-um", "10,10,10").out.split())
    modes = guided_modes([1.41, 1.2, 1.40], [10.0, 10.0, 10.0], wavelength_um=0.55)
    between = int(((modes.n_eff > 1.2) & (modes.n_eff < 1.40)).sum())
    assert f"{between} of {len(modes)} modes decay in a layer between" in parted
    assert "Every mode reaches" not in parted
