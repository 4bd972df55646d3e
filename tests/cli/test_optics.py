"""``tsis optics``: modes, propagation under dents, and traced rays."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from tsis.optics import guided_modes
from tsis.optics.propagation import Dent, propagate, thin_guide

if TYPE_CHECKING:
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
        (("--preset", "realistic", "--index", "1.4", "--thickness-um", "9"), "--preset must be left out with --index"),
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


COMMAND = ("optics", "propagate")


def test_json_holds_what_python_finds(run_tsis: RunTsis) -> None:
    printed = json.loads(run_tsis(*COMMAND, "--dent-um", "0,3", "--modes", "5", "--json").out)
    assert [one["depth_um"] for one in printed["dents"]] == [0.0, 3.0]
    expected = propagate(thin_guide("dissertation"), Dent(depth_um=3.0), modes=5)
    np.testing.assert_allclose(printed["n_eff"], expected.n_eff)
    np.testing.assert_allclose(printed["dents"][1]["modes"]["guided"], expected.powers.guided)
    assert printed["dents"][1]["mean"]["top"] == pytest.approx(expected.powers.top.mean())


def test_both_methods_and_both_guides_answer(run_tsis: RunTsis) -> None:
    common = ("--dent-um", "2", "--modes", "3", "--step-um", "0.09", "--json")
    guided = {
        (method, preset): json.loads(run_tsis(*COMMAND, *common, "--method", method, "--preset", preset).out)["dents"][
            0
        ]["mean"]["guided"]
        for method in ("bpm", "fdfd")
        for preset in ("dissertation", "realistic")
    }
    for preset in ("dissertation", "realistic"):
        assert guided["bpm", preset] == pytest.approx(guided["fdfd", preset], abs=0.015)
    assert guided["fdfd", "realistic"] > guided["fdfd", "dissertation"] + 0.01, "the plate holds two of its modes"


def test_people_get_a_table_notes_and_pictures(run_tsis: RunTsis) -> None:
    finished = run_tsis(*COMMAND, "--dent-um", "0,6", "--modes", "21", "--out", "pressed")
    text = " ".join(finished.out.split())
    assert finished.code == 0
    assert "100.00" in text
    assert "near cut-off, so less exact: mode 16, 17, 18, 19, 20" in text
    assert "Research use only" in text
    names = {path.name for path in Path("pressed").iterdir()}
    assert names == {"guide-0-um.png", "guide-6-um.png", "light-out-of-the-top.png", "result.json"}


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (("--dent-um", "0,9"), "depth_um must be at most 8.55"),
        (("--dent-um", "2;4"), "--dent-um must be numbers with commas between"),
        (("--wavelength-um", "550"), "that looks like nanometres; give 0.55"),
        (("--method", "fdfd", "--step-um", "0.02"), "must fit in 2 GiB"),
        (("--preset", "realistc"), "did you mean 'realistic'"),
        (("--modes", "40"), "modes must lie in [1, 21]"),
        (("--tip-radius-um", "0"), "tip_radius_um must lie in"),
    ],
)
def test_wrong_input_is_one_sentence(run_tsis: RunTsis, options: tuple[str, ...], sentence: str) -> None:
    finished = run_tsis(*COMMAND, *options)
    assert finished.code == 2
    assert sentence in " ".join(finished.err.split())
    assert "Traceback" not in finished.err


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
def test_a_wrong_trace_is_one_sentence(run_tsis: RunTsis, given: tuple[str, ...], phrase: str) -> None:
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
