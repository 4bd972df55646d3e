"""``tsis compare``: the readings are those of Python, and refused where frames do not suffice."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest

import tsis
from tsis.calibration.file import ProbeCalibration, calibration_bytes, read_calibration
from tsis.inclusion.relative import relative_depth, relative_hardness, relative_size
from tsis.inclusion.shape import object_shape
from tsis.instrument.image_files import png_bytes, read_image
from tsis.model.calibration import LightMap
from tsis.model.image import TactileImage
from tsis.virtual.probe import VirtualProbe

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.conftest import RunTsis


SCALE = (0.0336, 0.0392)
SCALE_TEXT = "0.0336,0.0392"


@pytest.fixture(scope="module")
def pressed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Presses at two forces on an inclusion and on plain tissue, the untouched probe, and the calibration."""
    folder = tmp_path_factory.mktemp("pressed")
    probe = VirtualProbe(
        tsis.load_probe("tsis-2011"), rng=np.random.default_rng(4217), light=LightMap.uniform(), strain="small"
    )
    phantom = tsis.load_phantom("size-8")
    for force in (0.5, 1.0):
        (folder / f"t{force}.png").write_bytes(png_bytes(probe.press(phantom, force_n=force)))
        (folder / f"p{force}.png").write_bytes(png_bytes(probe.press(phantom.without_inclusion(), force_n=force)))
    (folder / "untouched.png").write_bytes(png_bytes(probe.no_contact()))
    known = ProbeCalibration(name="virtual", probe="tsis-2011", response=probe.calibration)
    (folder / "calibration.json").write_bytes(calibration_bytes(known))
    return folder


def image(folder: Path, name: str, force_n: float | None) -> TactileImage:
    return read_image(folder / name, mm_per_pixel=SCALE, force_n=force_n)


def test_relative_readings_and_shape_are_those_of_python(run_tsis: RunTsis, pressed: Path, tmp_path: Path) -> None:
    finished = run_tsis(
        *("compare", pressed / "t1.0.png", "--reference-press", pressed / "p1.0.png", "--force-n", "1"),
        *("--scale-mm", SCALE_TEXT, "--json"),
    )
    assert finished.code == 0, finished.err
    document = json.loads(finished.out)
    press, plain = image(pressed, "t1.0.png", 1.0), image(pressed, "p1.0.png", 1.0)
    size, depth = document["relative"]["readings"]
    assert (size["presses"], size["unit"], document["relative"]["against"]) == ("t1.0.png", "mm", "plain tissue")
    assert size["value"] == relative_size(press, plain, against="plain tissue").value
    assert depth["value"] == relative_depth(press, plain, against="plain tissue").value
    assert "needs a calibration" in document["relative"]["missing"][0]
    (shape,) = document["shape"]["presses"]
    expected = object_shape(press, plain, against="plain tissue")
    assert shape["semi_axes_mm"] == list(expected.semi_axes_mm or ())
    assert len(shape["contour_mm"]) == len(expected.contour_mm)
    page = (tmp_path / "tsis-compare" / "index.html").read_text()
    assert "Relative readings against plain tissue" in page
    assert "Shape in t1.0.png" in page
    assert "Research use only" in page


def test_a_reference_that_looks_pressed_is_told_first(run_tsis: RunTsis, pressed: Path) -> None:
    both, scale = (pressed / "untouched.png", pressed / "t1.0.png"), ("--scale-mm", SCALE_TEXT)
    swapped = run_tsis("compare", both[0], "--reference", both[1], *scale)
    assert "untouched.png: The reference looks pressed, and this frame not" in " ".join(swapped.out.split())
    (shape,) = json.loads(run_tsis("compare", both[0], "--reference", both[1], *scale, "--json").out)["shape"][
        "presses"
    ]
    assert shape["notes"][0].startswith("The reference looks pressed")
    for frame in both:
        assert "looks pressed" not in run_tsis("compare", frame, "--reference", both[0], *scale).out


def test_the_shape_of_a_drawn_ellipse_is_found(run_tsis: RunTsis, tmp_path: Path) -> None:
    y, x = np.mgrid[:120, :160]
    turned = np.radians(30.0)
    along = (x - 80) * np.cos(turned) + (y - 60) * np.sin(turned)
    across = (y - 60) * np.cos(turned) - (x - 80) * np.sin(turned)
    ellipse = 20.0 + 60.0 * ((along / 40) ** 2 + (across / 20) ** 2 < 1)
    for name, grey in (("press.png", ellipse), ("dark.png", np.full((120, 160), 20.0))):
        (tmp_path / name).write_bytes(png_bytes(TactileImage(grey=grey)))
    finished = run_tsis("compare", "press.png", "--reference", "dark.png", "--scale-mm", "0.1", "--json")
    assert finished.code == 0, finished.err
    document = json.loads(finished.out)
    (shape,) = document["shape"]["presses"]
    assert shape["semi_axes_mm"] == pytest.approx([4.0, 2.0], rel=0.02)
    assert shape["angle_deg"] == pytest.approx(30.0, abs=1.0)
    assert shape["area_mm2"] == pytest.approx(np.pi * 8.0, rel=0.02)
    size = document["relative"]["readings"][0]
    assert size["value"] == pytest.approx(2 * np.sqrt(8.0), rel=0.05)
    printed = run_tsis("compare", "press.png", "--reference", "dark.png", "--scale-mm", "0.1").out
    assert "Shape in press.png" in printed
    assert "Research use only" in printed


def test_relative_hardness_needs_a_calibration_and_two_forces(run_tsis: RunTsis, pressed: Path) -> None:
    options = ("--calibration", pressed / "calibration.json", "--scale-mm", SCALE_TEXT, "--json")
    forces = ("--force-n", "0.5", "--force-n", "1")
    files = [pressed / name for name in ("t0.5.png", "t1.0.png")]
    known = stored_calibration(pressed)
    untouched = image(pressed, "untouched.png", 0.0)
    weak, strong = image(pressed, "t0.5.png", 0.5), image(pressed, "t1.0.png", 1.0)
    bare = run_tsis("compare", *files, *forces, *options, "--reference", pressed / "untouched.png")
    assert bare.code == 0, bare.err
    reading = json.loads(bare.out)["relative"]["readings"][-1]
    expected = relative_hardness(weak, strong, reference=untouched, against="untouched probe", calibration=known)
    assert (reading["quantity"], reading["value"]) == ("relative hardness", expected.value)
    plain = ("--reference-press", pressed / "p0.5.png", "--reference-press", pressed / "p1.0.png")
    on_plain = run_tsis("compare", *files, *forces, *options, *plain)
    assert on_plain.code == 0, on_plain.err
    reading = json.loads(on_plain.out)["relative"]["readings"][-1]
    expected = relative_hardness(
        weak,
        strong,
        reference=image(pressed, "p0.5.png", 0.5),
        second_reference=image(pressed, "p1.0.png", 1.0),
        against="plain tissue",
        calibration=known,
    )
    assert reading["presses"] == "t0.5.png, t1.0.png"
    assert reading["value"] == expected.value
    one = run_tsis("compare", files[1], "--force-n", "1", *options, "--reference-press", pressed / "p1.0.png")
    assert "two presses on one target" in json.loads(one.out)["relative"]["missing"][0]


def stored_calibration(folder: Path) -> tsis.Calibration:
    response = read_calibration(folder / "calibration.json").response
    assert response is not None
    return response


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ([], "give the untouched probe as --reference, or reference presses"),
        (["--reference", "untouched.png"], "needs --scale-mm"),
        (
            ["--reference", "untouched.png", "--reference-press", "p1.0.png", "--scale-mm", "0.05"],
            "give --reference or --reference-press",
        ),
        (
            [
                *("--reference-press", "p0.5.png", "--scale-mm", "0.05"),
                *("--force-n", "1", "--reference-force-n", "0.5"),
            ],
            "with a reference press at its force 1 N within 5 %; got 0.5 N",
        ),
        (["--reference-force-n", "1"], "--reference-force-n needs --reference-press"),
    ],
)
def test_frames_that_do_not_suffice_are_named(
    run_tsis: RunTsis, pressed: Path, options: list[str], message: str
) -> None:
    given = [pressed / word if word.endswith(".png") else word for word in options]
    finished = run_tsis("compare", pressed / "t1.0.png", *given)
    assert finished.code == 2
    assert message in finished.err
    assert finished.err.count("\n") == 1


def test_a_folder_of_the_demo_is_compared_without_an_option(run: RunTsis, tmp_path: Path) -> None:
    finished = run("compare", "demo", "--out", tmp_path / "made", "--json")
    assert finished.code == 0, finished.err
    document = json.loads(finished.out)
    assert document["relative"]["against"] == "plain tissue"
    assert document["relative"]["readings"][-1]["quantity"] == "relative hardness"
    assert [shape["press"] for shape in document["shape"]["presses"]] == ["target-0.5N.png", "target-1N.png"]
