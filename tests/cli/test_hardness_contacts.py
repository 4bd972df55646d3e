from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.conftest import RunTsis

ROWS = "force_n,radius_mm\n0.5,3.00\n1.0,3.75\n"
GEL = "[my-gel]\nwidth_mm = 40.0\nheight_mm = 40.0\nthickness_mm = 20.0\nyoung_kpa = [140.0, 160.0]\npoisson = 0.49\n"


@pytest.fixture
def contacts(tmp_path: Path) -> Path:
    (tmp_path / "gel.toml").write_text(GEL)
    (tmp_path / "contacts.csv").write_text(ROWS)
    return tmp_path / "contacts.csv"


@pytest.mark.usefixtures("contacts")
def test_contacts_of_a_file_give_the_modulus_for_people_and_programs(run_tsis: RunTsis) -> None:
    order = ("hardness", "--contacts", "contacts.csv", "--sensor", "gel.toml", "--radius-mm", "5")
    printed = json.loads(run_tsis(*order, "--json").out)
    low, high = printed["estimate"]["parameters"]["young_kpa"]["interval_90"]
    assert low < high < 2.5 * low
    assert printed["provenance"]["sensor"]["name"] == "my-gel"
    shown = run_tsis(*order)
    assert shown.code == 0
    assert f"{low:.3g} to {high:.3g} kPa" in shown.out
    assert "Research use only" in shown.out
    forced = json.loads(run_tsis(*order, "--force-n", "1", "--force-n", "2", "--json").out)
    assert forced["estimate"]["parameters"]["young_kpa"]["interval_90"][0] > 1.5 * low


@pytest.mark.usefixtures("contacts")
def test_a_flat_object_is_withheld_with_its_reason(run_tsis: RunTsis) -> None:
    finished = run_tsis("hardness", "--contacts", "contacts.csv", "--sensor", "gel.toml", "--flat")
    assert finished.code == 0
    assert "contact of a flat object does not change" in " ".join(finished.out.split())
    assert run_tsis("hardness", "--contacts", "contacts.csv", "--sensor", "digit", "--radius-mm", "5").code == 3


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("contacts.csv",), "--contacts needs --sensor"),
        (("absent.csv", "--sensor", "gel.toml"), "absent.csv"),
        (("contacts.csv", "--sensor", "absent.toml"), "make one with tsis sensor new"),
        (("contacts.csv", "--sensor", "gel.toml", "--flat", "--cylinder-mm", "3"), "an object has one shape"),
        (("contacts.csv", "--sensor", "gel.toml", "--demo"), "--contacts must stand alone"),
        (("contacts.csv", "--sensor", "gel.toml", "--radius-mm", "900"), "radius_mm of the object must lie in"),
    ],
)
@pytest.mark.usefixtures("contacts")
def test_wrong_orders_are_one_sentence(run_tsis: RunTsis, arguments: tuple[str, ...], message: str) -> None:
    finished = run_tsis("hardness", "--contacts", *arguments)
    assert finished.code == 2
    assert message in " ".join(finished.err.split())
    assert finished.err.count("\n") == 1
