from __future__ import annotations

import json
import shutil
from dataclasses import fields, replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import pytest

from tsis.calibration.file import ProbeCalibration, calibration_bytes, read_calibration
from tsis.cli.options import reference_forces
from tsis.errors import InputError
from tsis.model.calibration import Calibration, LightMap

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.conftest import Finished, RunTsis

    from tsis.model.probe import Probe

LONG_AGO = datetime(2020, 1, 1, tzinfo=UTC)
DISC_PX, CENTRE = 30.0, (140.0, 90.0)


@pytest.fixture
def frames(tmp_path: Path) -> None:
    """A dark disc of 30 px radius on an evenly lit probe, and the probe untouched."""
    y, x = np.mgrid[:200, :300]
    disc = np.where(np.hypot(x - CENTRE[0], y - CENTRE[1]) < DISC_PX, 120, 200).astype(np.uint8)
    cv2.imwrite(str(tmp_path / "press.png"), disc)
    cv2.imwrite(str(tmp_path / "untouched.png"), np.full((200, 300), 200, np.uint8))
    cv2.imwrite(str(tmp_path / "small.png"), np.full((20, 30), 200, np.uint8))
    cv2.imwrite(str(tmp_path / "deep.png"), np.full((200, 300), 200, np.uint16))
    (tmp_path / "cut.png").write_bytes((tmp_path / "press.png").read_bytes()[:-30])
    (tmp_path / "empty.png").write_bytes(b"")
    (tmp_path / "notes.png").write_text("no picture")


def entries(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


@pytest.mark.usefixtures("frames")
@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["press.png"], "an estimate needs the calibration of the probe: give it as --calibration"),
        (["press.png", "--force-n", "1"], "tsis contacts measures the contact without one"),
        (["."], "an estimate needs the calibration"),
        (["press.png", "--probe", "tsis2011"], "no probe is called 'tsis2011'; did you mean 'tsis-2011'?"),
        (["press.png", "--calibration", "absent.json"], "'absent.json' does not exist"),
        (["press.png", "untouched.png", "--invert"], "No such option: --invert"),
    ],
)
def test_wrong_input_is_one_sentence_and_writes_nothing(
    run_tsis: RunTsis, tmp_path: Path, arguments: list[str], sentence: str
) -> None:
    before = entries(tmp_path)
    finished = run_tsis("examine", *arguments)
    assert finished.code == 2
    assert finished.out == ""
    assert sentence in finished.err
    assert finished.err.startswith("Error: ")
    assert finished.err.count("\n") == 1
    assert entries(tmp_path) == before


def _known(**response: Any) -> bytes:
    values = {"gain_grey_per_kpa": 60.0, "saturation_kpa": 20.0, **response}
    return calibration_bytes(ProbeCalibration(name="bench", response=Calibration(**values)))


OTHER_CODES = {"hash": 3, "needs the part": 3, "expired": 3}  # of messages that are no wrong input


@pytest.mark.usefixtures("frames")
@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"{", "must be a readable JSON file"),
        (b"[]", "must hold a JSON object; got list"),
        (b"{}", "must be a file of tsis-calibration"),
        (_known().replace(b"60.0", b"61.0"), "its content does not match its hash, so it was changed"),
        (calibration_bytes(ProbeCalibration(name="bench")), "an estimate needs the part 'response'"),
        (
            calibration_bytes(
                ProbeCalibration(
                    name="old", made=datetime(2020, 1, 1, tzinfo=UTC), expires=datetime(2021, 1, 1, tzinfo=UTC)
                )
            ),
            "calibration 'old' must not be expired; it was good until 2021-01-01",
        ),
    ],
)
def test_a_wrong_calibration_is_one_sentence(run_tsis: RunTsis, tmp_path: Path, content: bytes, sentence: str) -> None:
    (tmp_path / "calibration.json").write_bytes(content)
    finished = run_tsis(
        *("examine", "press.png", "--calibration", "calibration.json", "--scale-mm", "0.05", "--force-n", "1")
    )
    assert finished.code == next((code for text, code in OTHER_CODES.items() if text in sentence), 2)
    assert sentence in finished.err
    assert finished.err.count("\n") == 1


@pytest.mark.usefixtures("frames")
def test_an_estimate_needs_scale_and_force(run_tsis: RunTsis, tmp_path: Path) -> None:
    (tmp_path / "calibration.json").write_bytes(_known())
    finished = run_tsis("examine", "press.png", "--calibration", "calibration.json")
    assert finished.code == 2
    assert "needs --scale-mm and --force-n" in finished.err


MISCOUNTED = [
    (["--force-n", "1", "--force-n", "2", "--force-n", "3"], "--force-n must be given once, or once for each of 2"),
    (
        ["--force-n", "1", "--force-n", "2", *("--reference-press", "untouched.png") * 3],
        "--reference-force-n must give the force of each --reference-press when they outnumber the images; got 3 for 2",
    ),
    (
        ["--force-n", "1", *("--reference-press", "untouched.png") * 3, *("--reference-force-n", "1") * 2],
        "--reference-force-n must be given once, or once for each of 3 reference presses; got it 2 times",
    ),
]


@pytest.mark.usefixtures("frames")
@pytest.mark.parametrize(("arguments", "sentence"), MISCOUNTED)
def test_forces_that_match_no_frame_are_one_sentence(
    run_tsis: RunTsis, tmp_path: Path, arguments: list[str], sentence: str
) -> None:
    (tmp_path / "calibration.json").write_bytes(_known())
    finished = run_tsis(
        *("examine", "press.png", "untouched.png", "--calibration", "calibration.json", "--scale-mm", "0.05"),
        *arguments,
    )
    assert finished.code == 2
    assert sentence in finished.err
    assert finished.err.count("\n") == 1


@pytest.mark.parametrize(
    ("given", "images", "presses", "expected"),
    [
        ([], [0.5, 1.0], 2, [0.5, 1.0]),
        ([], [0.5, 1.0], 1, [0.5]),
        ([], [1.0], 3, [1.0, 1.0, 1.0]),
        ([], [2.0, 2.0], 3, [2.0, 2.0, 2.0]),
        ([1.5], [0.5, 1.0], 3, [1.5, 1.5, 1.5]),
        ([3.0, 4.0], [1.0], 2, [3.0, 4.0]),
        ([], [1.0], 0, []),
    ],
)
def test_a_plain_press_has_its_own_force_or_that_of_the_image_in_its_place(
    given: list[float], images: list[float], presses: int, expected: list[float]
) -> None:
    assert reference_forces(given, images, presses) == expected


@pytest.mark.usefixtures("frames")
@pytest.mark.parametrize(
    ("named", "arguments", "chosen"),
    [
        ("tsis-domed", [], "tsis-domed"),
        ("", [], "tsis-2011"),
        ("", ["--probe", "tsis-domed"], "tsis-domed"),
    ],
)
def test_the_calibration_names_the_probe(
    run_tsis: RunTsis, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, named: str, arguments: list[str], chosen: str
) -> None:
    asked = []

    def stop(_frames: object, *, probe: Probe, calibration: Calibration, **_others: object) -> None:
        asked.append((probe.name, calibration.probe))
        raise InputError("stopped here")

    monkeypatch.setattr("tsis.inclusion.estimate", stop)
    (tmp_path / "calibration.json").write_bytes(_known(probe=named, probe_young_sd=0.1))
    options = ("--calibration", "calibration.json", "--force-n", "1", "--scale-mm", "0.05")
    assert run_tsis("examine", "press.png", *options, *arguments).code == 2
    assert asked == [(chosen, named)]


@pytest.mark.usefixtures("frames")
def test_a_calibration_of_another_probe_is_refused(
    run_tsis: RunTsis, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def built(*_: object, **__: object) -> None:
        raise AssertionError("the surrogate is built before the calibration is looked at")

    monkeypatch.setattr("tsis.inclusion.reading.build_full_contact_surrogate", built)
    (tmp_path / "calibration.json").write_bytes(_known(probe="tsis-domed"))
    options = ("--calibration", "calibration.json", "--force-n", "1", "--scale-mm", "0.05", "--probe", "tsis-2011")
    finished = run_tsis("examine", "press.png", *options)
    assert finished.code == 3
    assert "calibration must be that of the probe 'tsis-2011'; got one of 'tsis-domed'" in finished.err


def test_a_calibration_file_keeps_every_value(tmp_path: Path) -> None:
    numbers = {each.name: 0.06 + 0.01 * place for place, each in enumerate(fields(Calibration)) if each.type == "float"}
    assert len(numbers) > 10
    named = Calibration(**numbers, light=LightMap.uniform(), name="bench", probe="tsis-domed")
    path = tmp_path / "calibration.json"
    path.write_bytes(calibration_bytes(ProbeCalibration(name="bench", response=named)))
    again = read_calibration(path).response
    assert again is not None
    assert again.light is not None
    assert again.light.sha256 == LightMap.uniform().sha256
    assert replace(again, light=None) == replace(named, light=None)


def told(finished: Finished) -> Any:
    assert finished.code == 0, finished.err
    return json.loads(finished.out)["estimate"]


def test_a_folder_of_the_demo_gives_the_estimate_of_the_demo(run: RunTsis, kept: Path, tmp_path: Path) -> None:
    first = json.loads((kept / "demo" / "result.json").read_text())["estimate"]
    again = told(run("examine", "demo", "--out", tmp_path / "made", "--json"))
    assert again["presence"] == first["presence"]
    for name, found in again["parameters"].items():
        assert found["mean"] == first["parameters"][name]["mean"]
        assert found["interval_90"] == first["parameters"][name]["interval_90"]
    assert [frame["force_n"] for frame in again["provenance"]["images"]] == [0.5, 1.0]


def test_an_option_replaces_what_the_folder_tells(run: RunTsis, tmp_path: Path) -> None:
    changed = told(run("examine", "demo", "--force-n", "0.52", "--force-n", "1", "--out", tmp_path / "made", "--json"))
    assert [frame["force_n"] for frame in changed["provenance"]["images"]] == [0.52, 1.0]
    wide = told(run("examine", "demo", "--prior", "wide", "--out", tmp_path / "made", "--json"))
    assert wide["prior"].startswith("wide")


def test_a_table_of_presses_tells_forces_kinds_and_scale(run: RunTsis, kept: Path, tmp_path: Path) -> None:
    folder = tmp_path / "session"
    (folder / "frames").mkdir(parents=True)
    rows = ["frame file,force (N),role,pixel size x (mm),pixel size y (mm),probe"]
    for name in ("target-0.5N", "target-1N", "reference-0.5N", "reference-1N"):
        shutil.copy(kept / "demo" / f"{name}.png", folder / "frames")
        role, force = "plain" if name.startswith("reference") else "target", name.split("-")[1].removesuffix("N")
        rows.append(f"frames/{name}.png,{force},{role},0.0336,0.0392,tsis-domed")
    (folder / "presses.csv").write_text("\n".join(rows))
    shutil.copy(kept / "demo" / "calibration.json", folder)
    first = json.loads((kept / "demo" / "result.json").read_text())["estimate"]
    again = told(run("examine", folder, "--strain", "small", "--out", tmp_path / "made", "--json"))
    for name, found in again["parameters"].items():
        assert found["mean"] == first["parameters"][name]["mean"]
    (folder / "presses.csv").write_text(rows[0] + "\n../target.png,1,target,,,\n")
    refused = run("examine", folder)
    assert refused.code == 2
    assert "must name files of its own" in refused.err
