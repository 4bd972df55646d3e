from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np

from tsis.catalog import list_phantoms, list_probes

if TYPE_CHECKING:
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
