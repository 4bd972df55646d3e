from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from tsis.optics.propagation import Dent, propagate, thin_guide

if TYPE_CHECKING:
    from tests.cli.conftest import RunTsis

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
