from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest
from tests.hardness.stand_ins import by_table

from tsis.virtual.direct_contact import DirectContactRig

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.conftest import RunTsis

IMAGES = ("demo/press-0.7N.png", "demo/press-1.2N.png")
KNOWN = ("--calibration", "demo/calibration.json", "--scale-mm", "0.0336,0.0392")


@pytest.fixture
def quick_rig(monkeypatch: pytest.MonkeyPatch) -> None:
    """Presses by the table of contact radii: the mechanics have tests of their own."""

    class Quick(DirectContactRig):
        def __init__(self, *arguments: object, **options: object) -> None:
            super().__init__(*arguments, solve=by_table, **options)  # type: ignore[arg-type]

    monkeypatch.setattr("tsis.virtual.direct_contact.DirectContactRig", Quick)


@pytest.mark.usefixtures("quick_rig")
def test_the_demo_writes_what_it_prints_and_its_frames_give_the_same(run_tsis: RunTsis, tmp_path: Path) -> None:
    finished = run_tsis("hardness", "--demo", "--json", "--out", "demo")
    assert finished.code == 0, finished.err
    printed = json.loads(finished.out)
    assert printed["notice"].startswith("Research use only")
    found = printed["estimate"]["parameters"]["young_kpa"]
    assert found["truth"] == 103.0
    assert abs(found["mean"] - 103.0) < 3.5 * found["sd"]
    assert printed["shore_converted"]["shore_00"] == pytest.approx(29, abs=5)
    page = (tmp_path / "demo" / "index.html").read_text()
    assert "Research use only" in page
    assert "Shore 00 (converted)" in page
    radius = printed["estimate"]["provenance"]["radius"]
    again = run_tsis(
        *("hardness", *IMAGES, *KNOWN, "--force-n", "0.7", "--force-n", "1.2", "--json"),
        *("--radius-mm", str(radius["radius_mm"]), "--radius-sd-mm", str(radius["sd_mm"])),
    )
    assert again.code == 0, again.err
    assert json.loads(again.out)["estimate"]["parameters"]["young_kpa"]["mean"] == pytest.approx(found["mean"])


@pytest.mark.usefixtures("quick_rig")
def test_people_read_a_table(run_tsis: RunTsis) -> None:
    finished = run_tsis("hardness", "--virtual", "cl2003x", "--seed", "3")
    assert finished.code == 0, finished.err
    for words in ("Young's modulus", "90 % interval", "true modulus", "Research use only", "converted, not measured"):
        assert words in finished.out


@pytest.mark.usefixtures("quick_rig")
def test_a_rigid_ball_is_taken_as_reference(run_tsis: RunTsis) -> None:
    assert run_tsis("hardness", "--demo", "--seed", "2", "--out", "demo").code == 0
    refused = run_tsis(
        *("hardness", *IMAGES, *KNOWN, "--force-n", "0.7", "--force-n", "1.2", "--radius-mm", "3", "--ball", IMAGES[0]),
    )
    assert refused.code == 2
    assert "--ball-force-n must be given once for each --ball" in refused.err
    refused = run_tsis(
        *("hardness", IMAGES[1], *KNOWN, "--force-n", "1.2", "--radius-mm", "3"),
        *("--ball", IMAGES[0], "--ball-force-n", "0.7"),
    )
    assert refused.code == 2
    assert "reference_radius_mm" in refused.err


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ((), "--demo"),
        (("a.png",), "--calibration"),
        (("a.png", "--demo"), "simulate the presses"),
        (("--virtual", "cl2004x"), "did you mean 'cl2003x'"),
        (("--demo", "--force-n", "-1"), "forces_n must lie in"),
        (("--demo", "--probe", "tsis-2012"), "no probe is called"),
    ],
)
def test_wrong_words_end_in_one_sentence(run_tsis: RunTsis, words: tuple[str, ...], sentence: str) -> None:
    finished = run_tsis("hardness", *words)
    assert finished.code == 2
    assert sentence in finished.err
    assert "Traceback" not in finished.err
