from __future__ import annotations

import json
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

    from tests.cli.conftest import RunTsis

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
def test_a_disc_is_measured(run_tsis: RunTsis, tmp_path: Path) -> None:
    finished = run_tsis(
        *("examine", "press.png", "--reference", "untouched.png", "--invert", "--scale-mm", "0.05,0.04", "--json")
    )
    assert finished.code == 0, finished.err
    document = json.loads(finished.out)
    (image,) = document["images"]
    found = image["features"]
    assert found["centroid_px"] == pytest.approx(CENTRE, abs=0.05)
    assert found["area_mm2"] == pytest.approx(np.pi * DISC_PX**2 * 0.05 * 0.04, rel=0.01)
    assert found["semi_axes_mm"] == pytest.approx([DISC_PX * 0.05, DISC_PX * 0.04], rel=0.02)
    assert found["peak"] == pytest.approx(80.0, rel=0.01)
    assert {entry["estimate"] for entry in document["refused"]} == {
        "inclusion: diameter, depth, modulus",
        "force",
        "hardness of a touched object",
    }
    page = (tmp_path / "tsis-examine" / "index.html").read_text()
    assert "Not estimated, and why" in page
    assert "Research use only" in page


@pytest.mark.usefixtures("frames")
def test_without_a_scale_lengths_stay_in_pixels(run_tsis: RunTsis) -> None:
    finished = run_tsis("examine", "press.png", "--reference", "untouched.png", "--invert", "--json")
    found = json.loads(finished.out)["images"][0]["features"]
    assert found["area_px"] == pytest.approx(np.pi * DISC_PX**2, rel=0.01)
    assert found["area_mm2"] is None
    assert found["equivalent_diameter_mm"] is None


@pytest.mark.usefixtures("frames")
def test_the_wrong_sign_finds_no_contact_and_says_so(run_tsis: RunTsis) -> None:
    finished = run_tsis("examine", "untouched.png", "--reference", "untouched.png")
    assert finished.code == 0
    assert "no contact stands out of the noise" in " ".join(finished.out.split())


@pytest.mark.parametrize("name", ["[bold]frame[red].png", "a\x1b[2J\nb.png", "\udcff.png", "<b>.png"])
def test_names_of_files_stay_text(run_tsis: RunTsis, tmp_path: Path, name: str) -> None:
    cv2.imwrite(str(tmp_path / "plain.png"), np.full((30, 40), 7, np.uint8))
    (tmp_path / "plain.png").rename(tmp_path / name)
    finished = run_tsis("examine", name)
    assert finished.code == 0, finished.err
    assert "\x1b" not in finished.out
    if "[" in name and "\x1b" not in name:
        assert name in finished.out


@pytest.mark.parametrize("shape", [(1, 60), (60, 1), (1, 1)])
def test_a_thin_image_is_no_crash(run_tsis: RunTsis, tmp_path: Path, shape: tuple[int, int]) -> None:
    cv2.imwrite(str(tmp_path / "thin.png"), np.full(shape, 9, np.uint8))
    assert run_tsis("examine", "thin.png", "--scale-mm", "0.05").code == 0


def test_a_white_frame_is_said_to_be_clipped(run_tsis: RunTsis, tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "white.png"), np.full((50, 60), 255, np.uint8))
    assert "100.0 % of the picture is clipped by the camera" in " ".join(run_tsis("examine", "white.png").out.split())


@pytest.mark.usefixtures("frames")
def test_several_images_have_a_table_each(run_tsis: RunTsis) -> None:
    finished = run_tsis("examine", "press.png", "untouched.png", "--reference", "untouched.png", "--invert", "--json")
    first, second = json.loads(finished.out)["images"]
    assert (first["name"], second["name"]) == ("press.png", "untouched.png")
    assert (first["features"]["contact"], second["features"]["contact"]) == (True, False)


@pytest.mark.usefixtures("frames")
@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["absent.png"], "absent.png"),
        (["cut.png"], "must be a complete image file"),
        (["empty.png"], "empty.png"),
        (["notes.png"], "notes.png"),
        (["."], "must be"),
        (["press.png", "--reference", "small.png"], "reference must have the image's shape (200, 300); got (20, 30)"),
        (["press.png", "--reference", "deep.png"], "reference must have the image's full_scale 255; got 65535"),
        (["press.png", "--scale-mm", "-0.05"], "mm_per_pixel must lie in [0.0001, 10]; got -0.05"),
        (["press.png", "--scale-mm", "50"], "mm_per_pixel must lie in [0.0001, 10]; got 50"),
        (["press.png", "--scale-mm", "wide"], "--scale-mm must be one number or x,y"),
        (["press.png", "--scale-mm", "nan"], "mm_per_pixel must be finite"),
        (["press.png", "--invert"], "invert needs a reference"),
        (["press.png", "--reference-press", "untouched.png"], "--reference-press needs --calibration"),
        (["press.png", "--probe", "tsis2011"], "no probe is called 'tsis2011'; did you mean 'tsis-2011'?"),
        (["press.png", "--calibration", "absent.json", "--invert"], "are not used with --calibration"),
        (["press.png", "--out", "."], "must name a new folder"),
        (["press.png", "--out", "x" * 300], "must be a folder that can be made"),
        (["press.png", "--calibration", "absent.json"], "'absent.json' does not exist"),
        (["press.png", "--force-n", "1"], "--force-n needs --calibration"),
        (["press.png", "--match-light"], "--match-light needs --reference"),
        (["press.png", "--reference-force-n", "1"], "--reference-press needs --calibration"),
        (
            ["press.png", "--calibration", "absent.json", "--reference-force-n", "1"],
            "--reference-force-n needs --reference-press, the presses whose force it tells",
        ),
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
