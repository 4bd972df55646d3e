"""``tsis examine``: folders and frames, forces by the light, the uncertainty budget, and what is refused."""

from __future__ import annotations

import io
import json
import math
import shutil
from dataclasses import fields, replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import pytest
from rich.console import Console
from tests.cli.disc_frames import entries
from tests.cli.kept_demo import FORCES, FRAMES, KNOWN, told
from tests.present.pdf_readers import sheet_count, sheets
from tests.records.sample import sample_estimate

import tsis
from tsis.calibration.camera_reference import CameraReference
from tsis.calibration.file import ProbeCalibration, calibration_bytes, read_calibration, write_calibration
from tsis.calibration.force_line import ForceLine
from tsis.calibration.frames import load_frames
from tsis.calibration.measured import MeasuredValue
from tsis.calibration.scale import PixelScale
from tsis.cli.options import reference_forces
from tsis.errors import FileInputError, InputError
from tsis.model.calibration import Calibration, LightMap
from tsis.model.estimate import Estimate
from tsis.present.page import Column, Table
from tsis.present.terminal import rich_table

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.conftest import RunTsis

    from tsis.model.image import TactileImage
    from tsis.model.probe import Probe


LONG_AGO = datetime(2020, 1, 1, tzinfo=UTC)


@pytest.mark.usefixtures("disc_frames")
@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["press.png"], "an estimate needs the calibration of the probe: give it as --calibration"),
        (["press.png", "--force-n", "1"], "tsis contacts measures the contact without one"),
        (["."], "an estimate needs the calibration"),
        (["press.png", "--probe", "tsis2011"], "no probe is called 'tsis2011'; did you mean 'tsis-2011'?"),
        (["press.png", "--calibration", "absent.json"], "'absent.json' does not exist"),
        (["absent"], "'absent' does not exist; check the name and the folder"),
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


@pytest.mark.usefixtures("disc_frames")
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


@pytest.mark.usefixtures("disc_frames")
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


@pytest.mark.usefixtures("disc_frames")
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


@pytest.mark.usefixtures("disc_frames")
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


@pytest.mark.usefixtures("disc_frames")
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


REFERENCES = ("--reference-press", "demo/reference-0.5N.png", "--reference-press", "demo/reference-1N.png")


@pytest.mark.parametrize("asked", [("demo",), (*FRAMES, *REFERENCES, *KNOWN, *FORCES, "--prior", "phantom-2011")])
def test_the_folder_or_the_frames_of_a_demo_give_its_estimate(
    run: RunTsis, kept: Path, tmp_path: Path, asked: tuple[str, ...]
) -> None:
    first = json.loads((kept / "demo" / "result.json").read_text())["estimate"]
    again = told(run, "examine", *asked, "--out", tmp_path / "made")["estimate"]
    assert again["presence"] == first["presence"]
    for name, found in again["parameters"].items():
        assert found["mean"] == first["parameters"][name]["mean"]
        assert found["interval_90"] == first["parameters"][name]["interval_90"]
    assert [frame["force_n"] for frame in again["provenance"]["images"]] == [0.5, 1.0]
    for kind in ("images", "reference"):
        was, is_now = (
            [[frame[entry] for entry in ("name", "sha256", "force_n")] for frame in made["provenance"][kind]]
            for made in (first, again)
        )
        assert was == is_now
    assert again["provenance"]["probe"]["name"] == "tsis-domed"


def test_an_option_replaces_what_the_folder_tells(run: RunTsis, tmp_path: Path) -> None:
    changed = told(run, "examine", "demo", "--force-n", "0.52", "--force-n", "1", "--out", tmp_path / "made")[
        "estimate"
    ]
    assert [frame["force_n"] for frame in changed["provenance"]["images"]] == [0.52, 1.0]
    other = told(run, "examine", "demo", "--prior", "breast-ex-vivo", "--out", tmp_path / "made")["estimate"]
    assert other["prior"].startswith("breast-ex-vivo")


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
    again = told(run, "examine", folder, "--strain", "small", "--out", tmp_path / "made")["estimate"]
    for name, found in again["parameters"].items():
        assert found["mean"] == first["parameters"][name]["mean"]
    for changed, said in (
        (["../target.png,1,target,,,"], "must name files of its own"),
        ([rows[1], rows[2].replace(",target,", ",,")], "role must be target, plain or untouched in each row"),
    ):
        (folder / "presses.csv").write_text("\n".join([rows[0], *changed]))
        refused = run("examine", folder)
        assert refused.code == 2
        assert said in " ".join(refused.err.split())


def test_frames_of_an_export_are_those_that_were_written(run: RunTsis, kept: Path, tmp_path: Path) -> None:
    store = ("--store", tmp_path / "store")
    assert run("records", "import", kept / "demo", *store).code == 0
    levels = cv2.imread(str(kept / "demo" / "target-1N.png"), cv2.IMREAD_UNCHANGED)
    assert levels is not None
    cv2.imwrite(str(tmp_path / "ball.png"), levels[::-1])
    ball = ("--target", "1", "--role", "ball", "--force-n", "1", "--probe", "tsis-domed", "--scale-mm", "0.0336,0.0392")
    added = run("records", "import", tmp_path / "ball.png", *ball, *store)
    assert added.code == 0, added.err
    assert run("records", "export", "1", "--format", "csv", "--out", tmp_path / "out", *store).code == 0
    (folder,) = (path.parent for path in (tmp_path / "out").rglob("presses.csv"))
    shutil.copy(kept / "demo" / "calibration.json", folder)
    found = load_frames(folder)
    assert [len(part) for part in (found.images, found.reference)] == [2, 2], "the press of a ball is none of tissue"
    first, second = (folder / "frames" / f"{number:05d}-target.png" for number in (1, 2))
    held = first.read_bytes()
    first.write_bytes(second.read_bytes())
    with pytest.raises(FileInputError, match="its content is another"):
        load_frames(folder)
    first.write_bytes(held)
    table = (folder / "presses.csv").read_text()
    (folder / "presses.csv").write_text(table.replace(",383.5,245.5,", ",380,240,"))
    assert {frame.axis_px for frame in load_frames(folder).images} == {(380.0, 240.0)}
    (folder / "presses.csv").write_text(table.replace(",492,768,", ",480,640,"))
    with pytest.raises(FileInputError, match=r"columns \(px\) must be those of the frame"):
        load_frames(folder)


BUDGET = ("examine", *FRAMES, *KNOWN, *FORCES, *REFERENCES, "--budget")


@pytest.mark.slow
def test_the_budget_of_the_demo(run: RunTsis, kept: Path, tmp_path: Path) -> None:
    document = told(run, *BUDGET, "--pdf", "--out", tmp_path / "made")
    budget, estimate = document["budget"], document["estimate"]
    assert budget["withheld"] == {"young_kpa": "not identified"}
    assert set(budget["parameters"]) == {"diameter_mm", "depth_mm"}
    for name, quantity in budget["parameters"].items():
        assert quantity["value"] == estimate["parameters"][name]["mean"]
        assert quantity["sampled_sd"] == estimate["parameters"][name]["sd"]
        assert quantity["combined"] == pytest.approx(
            math.hypot(*(part["contribution"] for part in quantity["components"]))
        )
        assert quantity["expanded"] == pytest.approx(1.96 * quantity["combined"], rel=1e-3)
        assert quantity["departure"] == pytest.approx(quantity["sampled_sd"] / quantity["combined"] - 1)
        assert abs(quantity["departure"]) < 0.5
    documented = budget["parameters"]["diameter_mm"]  # in docs/explanation/intervals.md
    assert documented["combined"] == pytest.approx(0.111, abs=0.005)
    assert documented["departure"] == pytest.approx(0.15, abs=0.05)
    largest = max(documented["components"], key=lambda part: part["contribution"])
    assert (largest["source"], round(largest["fraction"], 1)) == ("prior of the modulus", 0.6)
    assert [force["image"] for force in budget["forces"]] == [
        *("target-0.5N.png", "target-1N.png", "reference-0.5N.png", "reference-1N.png")
    ]
    response = tsis.load_calibration(kept / "demo" / "calibration.json").response
    assert [force["combined"] for force in budget["forces"]] == pytest.approx(
        [response.force_sd * force["value"] for force in budget["forces"]]
    )
    page = (tmp_path / "made" / "index.html").read_text(encoding="utf-8")
    for shown in ("Uncertainty budget: depth", "force of each frame", "sd of the samples", "target-0.5N.png"):
        assert shown in page
    assert sheet_count((tmp_path / "made" / "report.pdf").read_bytes()) > 2
    plain = told(run, *(part for part in BUDGET if part != "--budget"), "--out", tmp_path / "without")
    assert "budget" not in plain
    assert plain["estimate"]["parameters"] == estimate["parameters"]


@pytest.mark.parametrize("columns", [80, 120])
def test_a_terminal_shows_whole_numbers(columns: int) -> None:
    rows = (
        ("heterogeneity of the tissue", "B, rectangular", "0.00179 mm2", "9.97e+03", "0.00019", "100.0%"),
        ("sd of the samples", "", "", "", "10.9", "+13%"),
    )
    first = ("source", "type, distribution", "standard uncertainty")
    headings = (*first, "sensitivity / kPa per unit", "contribution / kPa", "variance")
    table = rich_table(Table(title="Budget", columns=headings, values=rows))
    shown = Console(file=io.StringIO(), width=columns)
    shown.print(table)
    assert isinstance(shown.file, io.StringIO)
    lines = shown.file.getvalue().splitlines()
    assert max(map(len, lines)) <= columns
    words = " ".join(lines).split()
    for cell in (*headings, *(cell for row in rows for cell in row)):
        assert set(cell.split()) <= set(words)


@pytest.mark.parametrize("columns", [60, 80])
def test_a_terminal_without_room_breaks_names_and_never_numbers(columns: int) -> None:
    rows = (("a_long_name_of_a_curve_0.csv", "20.2", "19.7", "20.7", "68.9", "young_kpa_not_identified"),) * 2
    numbers = (Column(label="modulus", unit="kPa"), *(Column(label=each) for each in ("from", "to", "depth")))
    table = rich_table(Table(title="Moduli", columns=("curve", *numbers, "flags"), values=rows))
    shown = Console(file=io.StringIO(), width=columns)
    shown.print(table)
    assert isinstance(shown.file, io.StringIO)
    lines = shown.file.getvalue().splitlines()
    assert max(map(len, lines)) <= columns
    assert set(rows[0][1:5]) <= set(" ".join(lines).split())
    start = next(line.index("flags") for line in lines if "flags" in line)
    assert rows[0][-1] * 2 in "".join(line[start:].strip() for line in lines)


def test_withheld_numbers_stay_withheld(run: RunTsis, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from tsis.inclusion import budget
    from tsis.inclusion.estimation import analyse

    def untrusted(*args: Any, **options: Any) -> Any:
        found = analyse(*args, **options)
        estimate = Estimate(untrusted=found.estimate.untrusted, trusted=False, flags=("model_does_not_fit",))
        return replace(found, estimate=estimate)

    monkeypatch.setattr(budget, "analyse", untrusted)
    finished = run(*BUDGET, "--out", str(tmp_path / "made"))
    assert finished.code == 3
    assert "The uncertainty budget of the depth is withheld: not to be trusted." in " ".join(finished.out.split())
    assert "Uncertainty budget: depth" not in finished.out
    assert "sd of the samples" not in (tmp_path / "made" / "index.html").read_text(encoding="utf-8")


@pytest.mark.system  # poppler
def test_the_budget_is_in_the_pdf(run: RunTsis, tmp_path: Path) -> None:
    told(run, *BUDGET, "--pdf", "--out", tmp_path / "made")
    printed = " ".join(sheets((tmp_path / "made" / "report.pdf").read_bytes(), tmp_path))
    for shown in ("Uncertainty budget: depth", "force of each frame", "sd of the samples", "target-0.5N.png"):
        assert shown in printed


ROWS, COLUMNS, DARK = 120, 160, 8
GREY_PER_N, DISC_GREY = 2e5, 90


def _sure(value: float, unit: str = "", *, sd: float = 0.0) -> MeasuredValue:
    return MeasuredValue(value=value, sd=sd, unit=unit)


def _with_force_line(**changes: Any) -> ProbeCalibration:
    flat = np.ones((ROWS, COLUMNS))
    parts: dict[str, Any] = {
        "scale": PixelScale(
            mm_per_pixel_x=_sure(0.1, "mm/px"),
            mm_per_pixel_y=_sure(0.1, "mm/px"),
            shape=(ROWS, COLUMNS),
            at_px=(79.5, 59.5),
            method="dots",
            count=30,
        ),
        "reference": CameraReference(
            dark_grey=DARK * flat,
            untouched_grey=0 * flat,
            relative_light=flat,
            usable=flat > 0,
            full_scale=255.0,
            mm_per_pixel=(0.1, 0.1),
            dark_frames=8,
            untouched_frames=8,
            flat_frames=0,
            read_noise_grey=_sure(0.5, "grey"),
            shot_noise_grey=_sure(0.02, "grey"),
            stray_grey=_sure(0.0, "grey"),
        ),
        "force_line": ForceLine(
            intercept_grey=_sure(0.0, "grey"),
            slope_grey_per_n=_sure(GREY_PER_N, "grey/N", sd=0.015 * GREY_PER_N),
            unit_covariance=(0.0, 0.0, 0.75 * (0.03 * GREY_PER_N) ** 2),  # a new tip beside the mean of three: 3 %
            units=3,
            residual_grey=_sure(10.0, "grey"),
            residual_share=_sure(0.0),
            least_n=0.05,
            most_n=2.0,
            pixels=ROWS * COLUMNS,
            full_scale=255.0,
            tips_mm=(2.0, 10.0, 14.0),
        ),
        "response": Calibration(gain_grey_per_kpa=60.0, saturation_kpa=20.0),
    }
    return ProbeCalibration(name="bench", **{**parts, **changes})


def _frame(path: Path, radius_px: float) -> float:
    """Write a bright disc, and return the force that its light means."""
    y, x = np.mgrid[:ROWS, :COLUMNS]
    disc = np.hypot(x - 80, y - 60) < radius_px
    cv2.imwrite(str(path), np.where(disc, DARK + DISC_GREY, DARK).astype(np.uint8))
    return float(disc.sum() * DISC_GREY / GREY_PER_N)


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[tuple[list[TactileImage], Calibration]]:
    """What the estimate is asked."""
    seen: list[tuple[list[TactileImage], Calibration]] = []

    def stop(frames: list[TactileImage], *, calibration: Calibration, **_others: object) -> None:
        seen.append((frames, calibration))
        raise InputError("stopped here")

    monkeypatch.setattr("tsis.inclusion.estimate", stop)
    return seen


def test_forces_come_from_the_light_and_their_doubt_reaches_the_estimate(
    run_tsis: RunTsis, tmp_path: Path, asked: list[tuple[list[TactileImage], Calibration]]
) -> None:
    forces = [_frame(tmp_path / "a.png", 20.0), _frame(tmp_path / "b.png", 30.0)]
    write_calibration(_with_force_line(), tmp_path / "calibration.json")
    finished = run_tsis("examine", "a.png", "b.png", "--calibration", "calibration.json")
    assert finished.err == "Error: stopped here\n"
    ((frames, calibration),) = asked
    assert [frame.force_n for frame in frames] == pytest.approx(forces, rel=1e-6)
    assert calibration.force_sd == pytest.approx(0.03, rel=0.1)
    assert frames[0].mm_per_pixel == (0.1, 0.1)
    assert frames[0].grey.min() == 0.0  # less the dark frame
    assert calibration.name.startswith("bench (")


def test_what_is_kept_is_given_to_the_estimate_again_bit_for_bit(
    run_tsis: RunTsis, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Reference, scale and force line take the same way from the store as from the files."""
    asked: list[dict[str, Any]] = []

    def estimate(frames: list[TactileImage], **given: Any) -> Estimate:
        asked.append({"frames": frames, **given})
        return sample_estimate()

    monkeypatch.setattr("tsis.inclusion.estimate", estimate)
    for name, radius_px in (("a.png", 20.0), ("b.png", 30.0), ("plain.png", 26.0)):
        _frame(tmp_path / name, radius_px)
    noise = np.random.default_rng(1)
    reference = replace(
        _with_force_line().need(CameraReference, "this"),
        untouched_grey=noise.random((ROWS, COLUMNS)),
        dark_grey=noise.random((ROWS, COLUMNS)),
    )
    write_calibration(_with_force_line(reference=reference), tmp_path / "calibration.json")
    keep = ("--save", "--store", "records")
    kept = run_tsis(
        "examine", "a.png", "b.png", "--reference-press", "plain.png", "--calibration", "calibration.json", *keep
    )
    assert kept.code == 0, kept.err
    finished = run_tsis("records", "recompute", "1", "--store", "records", "--json")
    assert finished.code == 0, finished.err
    first, again = asked
    for kind in ("frames", "reference"):
        for one, other in zip(first[kind], again[kind], strict=True):
            np.testing.assert_array_equal(one.grey, other.grey)
            assert (one.force_n, one.mm_per_pixel, one.axis_px) == (other.force_n, other.mm_per_pixel, other.axis_px)
    for name in ("calibration", "probe", "prior"):
        assert first[name] == again[name]
    assert first["calibration"].force_sd > 0.01  # with the doubt of the line
    assert json.loads(finished.out)["estimates"][0]["same"] is True


CODES_WITHOUT_A_LINE = {"part 'reference'": 3}  # of messages that are no wrong input


@pytest.mark.parametrize(
    ("without", "said"),
    [
        ({"force_line": None}, "needs --force-n, which"),
        ({"reference": None}, "a force without --force-n needs the part 'reference'"),
    ],
)
def test_what_is_missing_for_a_force_is_named(
    run_tsis: RunTsis, tmp_path: Path, without: dict[str, None], said: str
) -> None:
    _frame(tmp_path / "a.png", 20.0)
    write_calibration(_with_force_line(**without), tmp_path / "calibration.json")
    finished = run_tsis("examine", "a.png", "--calibration", "calibration.json")
    assert finished.code == next((code for text, code in CODES_WITHOUT_A_LINE.items() if text in said), 2)
    assert said in finished.err


def test_a_force_beyond_the_line_and_a_second_scale_are_refused(run_tsis: RunTsis, tmp_path: Path) -> None:
    _frame(tmp_path / "a.png", 2.0)
    write_calibration(_with_force_line(), tmp_path / "calibration.json")
    too_light = run_tsis("examine", "a.png", "--calibration", "calibration.json")
    assert too_light.code == 2
    assert "0.05" in too_light.err
    twice = run_tsis("examine", "a.png", "--calibration", "calibration.json", "--scale-mm", "0.1")
    assert "--scale-mm is not used with this calibration" in twice.err
