"""From saved frames to an answer: the five lines of the README, and what the reader of a folder refuses."""

from __future__ import annotations

import ast
import json
import shutil
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from PIL import Image
from release.notebooks import five_lines
from tests.cli.kept_demo import KNOWN, told

import tsis
from tsis.calibration.frames import UsableCalibration
from tsis.errors import CalibrationError, FileInputError, ImageMismatchError, InputError
from tsis.instrument.camera import Frame
from tsis.instrument.snapshot import save_snapshot
from tsis.model.calibration import Calibration
from tsis.model.estimate import Estimate

if TYPE_CHECKING:
    from collections.abc import Callable

    from tests.cli.conftest import RunTsis

WHEN = datetime(2026, 11, 20, 9, 30, 15, tzinfo=UTC)


@pytest.fixture
def demo(kept: Path, tmp_path: Path) -> Path:
    """A copy of a folder of ``tsis demo``."""
    return Path(shutil.copytree(kept / "demo", tmp_path / "tsis-demo"))


def changed(folder: Path, change: Callable[[dict[str, Any]], object]) -> None:
    file = folder / "result.json"
    document = json.loads(file.read_text())
    change(document)
    file.write_text(json.dumps(document))


def one_sentence(error: BaseException) -> bool:
    text = str(error)
    return "\n" not in text and len(text) < 500


def snapshot(
    folder: Path, *, level: int, target: int = 1, second: int = 0, camera: str = "rig", **about: Any
) -> tuple[Path, Frame]:
    """A snapshot as ``tsis acquire`` saves it; its sidecar."""
    pixels = np.full((40, 50), level, np.uint8)
    pixels[10:20, 10:30] += 20
    frame = Frame(pixels=pixels, sequence=second, name=camera, settings={"gain": 2.0})
    saved = save_snapshot(
        frame,
        folder,
        target=target,
        when=WHEN.replace(second=second),
        colour=lambda frame: np.stack([frame.pixels.astype(np.uint8)] * 3, axis=-1),
        about={"camera": camera, **about},
    )
    return saved.sidecar, frame


def test_the_five_lines_of_the_readme_give_the_answer_of_the_demo(run_tsis: RunTsis, tmp_path: Path) -> None:
    code = five_lines()
    assert len(ast.parse(code).body) == 5
    demo = tmp_path / "tsis-demo"
    told(run_tsis, "demo", "--strain", "small")
    names: dict[str, Any] = {}
    exec(compile(code, "README.md", "exec"), names)
    (result,) = (value for value in names.values() if isinstance(value, Estimate))
    saved = json.loads((demo / "result.json").read_text())["estimate"]
    for name, value in saved["parameters"].items():
        if result.identified(name):
            assert result.mean[name] == pytest.approx(value["mean"], rel=1e-9)
        assert list(result.interval(0.9)[name]) == pytest.approx(value["interval_90"], rel=1e-9)
    assert list(result.flags) == saved["flags"]
    with Image.open(tmp_path / "posterior.png") as picture:
        assert picture.width > 600


def test_the_frames_of_the_demo_are_those_of_its_files(demo: Path) -> None:
    frames = tsis.load_frames(demo)
    assert [image.name for image in frames.images] == ["target-0.5N.png", "target-1N.png"]
    assert [image.force_n for image in frames.images] == [0.5, 1.0]
    assert [image.name for image in frames.reference] == ["reference-0.5N.png", "reference-1N.png"]
    assert [image.name for image in frames.untouched] == ["untouched.png"]
    assert frames.probe == tsis.load_probe("tsis-domed")
    assert frames.calibration is None
    for image in (*frames.images, *frames.reference):
        np.testing.assert_array_equal(image.grey, np.asarray(Image.open(demo / image.name)))
        assert image.scale() == pytest.approx(tuple(map(float, KNOWN[3].split(","))), rel=0.01)
    usable = tsis.load_calibration(demo / "calibration.json")
    read = tsis.load_frames(demo, calibration=usable)
    assert read.calibration == usable.response
    assert read.images == frames.images


def test_the_path_of_a_probe_that_no_catalog_has(demo: Path) -> None:
    changed(demo, lambda document: document["estimate"]["provenance"]["probe"].update(name="mine", radius_mm=11.0))
    assert tsis.load_frames(demo).probe == replace(tsis.load_probe("tsis-domed"), name="mine", radius_mm=11.0)


def test_a_frame_that_was_changed_or_lost_is_named(demo: Path) -> None:
    Image.fromarray(np.zeros((40, 50), np.uint8)).save(demo / "target-1N.png")
    with pytest.raises(FileInputError, match=r"target-1N\.png' must be the frame that was estimated") as error:
        tsis.load_frames(demo)
    assert one_sentence(error.value)
    (demo / "target-1N.png").unlink()
    with pytest.raises(FileInputError, match=r"target-1N\.png' does not exist") as error:
        tsis.load_frames(demo)
    assert one_sentence(error.value)


@pytest.mark.parametrize("name", ["../target-1N.png", "/etc/passwd", "a\\b.png", "", "..", "a\x1b[2Jb.png", "x" * 300])
def test_a_hostile_name_leads_nowhere(demo: Path, name: str) -> None:
    changed(demo, lambda document: document["estimate"]["provenance"]["images"][0].update(name=name))
    with pytest.raises(FileInputError, match="must name files of its own") as error:
        tsis.load_frames(demo)
    assert one_sentence(error.value)
    assert str(error.value).isprintable()


def test_links_are_refused(demo: Path, tmp_path: Path) -> None:
    other = tmp_path / "elsewhere.png"
    (demo / "target-1N.png").rename(other)
    (demo / "target-1N.png").symlink_to(other)
    with pytest.raises(FileInputError, match="it is a link that leads elsewhere"):
        tsis.load_frames(demo)


@pytest.mark.parametrize(
    "change",
    [
        lambda document: document["estimate"].pop("provenance"),
        lambda document: document["estimate"]["provenance"].update(images=[]) or document.update(command=[]),
        lambda document: document["estimate"]["provenance"].update(probe=3),
        lambda document: document["estimate"]["provenance"]["probe"].update(radius_mm="wide"),
        lambda document: document["estimate"]["provenance"]["probe"]["layers"][0].update(colour="red"),
        lambda document: document["estimate"]["provenance"]["images"][0].update(force_n="strong"),
        lambda document: document["estimate"]["provenance"]["images"][0].update(mm_per_pixel=[0.1]),
        lambda document: document["estimate"]["provenance"].update(images={"a": 1}),
        lambda document: document["estimate"]["provenance"].update(images=[{}] * 1001, reference=[]),
        lambda document: document.update(command="examine"),
    ],
)
def test_a_damaged_result_is_one_sentence(demo: Path, change: Callable[[dict[str, Any]], object]) -> None:
    changed(demo, change)
    with pytest.raises(FileInputError, match=r"result\.json' must be") as error:
        tsis.load_frames(demo)
    assert one_sentence(error.value)


@pytest.mark.parametrize("path", ["missing", "file", "nul\0byte", "x" * 5000])
def test_what_is_no_folder_of_frames(tmp_path: Path, path: str) -> None:
    (tmp_path / "file").write_bytes(b"1")
    with pytest.raises(FileInputError, match="must be a folder of frames; it is none"):
        tsis.load_frames(str(tmp_path / path))
    with pytest.raises(InputError, match="path must be the name"):
        tsis.load_frames(3)  # type: ignore[arg-type]


def test_a_folder_without_frames(tmp_path: Path) -> None:
    (tmp_path / "notes.json").write_text('{"format": "other"}')
    with pytest.raises(FileInputError, match="it holds none of these"):
        tsis.load_frames(tmp_path)


def test_snapshots_with_their_sidecars(tmp_path: Path) -> None:
    _, first = snapshot(tmp_path, level=30, probe="tsis-2011", role="target", force={"force_n": 0.52})
    _, second = snapshot(tmp_path, level=20, second=1, probe="tsis-2011", role="plain", force={"force_n": -0.01})
    _, third = snapshot(tmp_path, level=10, second=2, probe="tsis-2011", role="untouched")
    for folder in (tmp_path, tmp_path / "Target1"):
        frames = tsis.load_frames(folder, mm_per_pixel=(0.05, 0.06))
        assert [len(group) for group in (frames.images, frames.reference, frames.untouched)] == [1, 1, 1]
        pairs = zip((frames.images[0], frames.reference[0], frames.untouched[0]), (first, second, third), strict=True)
        for (image, frame), force in zip(pairs, (0.52, 0.0, 0.0), strict=True):
            np.testing.assert_array_equal(image.grey, frame.pixels)
            assert image.force_n == force
            assert image.scale() == (0.05, 0.06)
            assert image.settings == {"gain": 2.0, "probe": "tsis-2011", "camera": "rig"}
        assert frames.probe == tsis.load_probe("tsis-2011")


def test_a_role_and_a_probe_that_no_sidecar_names_are_given(tmp_path: Path) -> None:
    snapshot(tmp_path, level=30)
    with pytest.raises(InputError, match="names no probe"):
        tsis.load_frames(tmp_path)
    mine = replace(tsis.load_probe("tsis-2011"), name="mine")
    assert len(tsis.load_frames(tmp_path, probe=mine, role="plain").reference) == 1
    with pytest.raises(InputError, match="no role is called 'tumour'"):
        tsis.load_frames(tmp_path, probe=mine, role="tumour")


def test_acquire_writes_what_the_reader_needs(run_tsis: RunTsis, tmp_path: Path) -> None:
    run_tsis("acquire", "--target", "3", "--phantom", "plain", "--role", "plain", "--force-n", "0.5")
    run_tsis("acquire", "--target", "3", "--force-n", "0.5")
    frames = tsis.load_frames(tmp_path, target=3)
    assert (len(frames.images), len(frames.reference)) == (1, 1)
    assert frames.probe == tsis.load_probe("tsis-2011")
    assert frames.images[0].grey.max() > frames.reference[0].grey.min()
    with pytest.raises(InputError, match="target must be a number in the sidecars"):
        tsis.load_frames(tmp_path, target=4)


def test_a_frame_without_a_sidecar_is_refused(tmp_path: Path) -> None:
    sidecar, _ = snapshot(tmp_path, level=30, probe="tsis-2011")
    snapshot(tmp_path, level=20, second=1, probe="tsis-2011")
    sidecar.unlink()
    with pytest.raises(FileInputError, match="must have a sidecar") as error:
        tsis.load_frames(tmp_path)
    assert one_sentence(error.value)
    assert sidecar.stem in str(error.value)


def test_a_folder_of_pictures_alone_is_refused(tmp_path: Path) -> None:
    Image.fromarray(np.zeros((40, 50), np.uint8)).save(tmp_path / "press.png")
    with pytest.raises(FileInputError, match=r"press\.png' must have a sidecar"):
        tsis.load_frames(tmp_path)


def test_a_raw_frame_that_differs_from_its_sidecar_is_refused(tmp_path: Path) -> None:
    sidecar, _ = snapshot(tmp_path, level=30, probe="tsis-2011")
    raw = sidecar.with_name(f"{sidecar.stem}-raw.bmp")
    raw.write_bytes(raw.read_bytes()[:-1] + b"\x07")
    with pytest.raises(FileInputError, match="does not match its sidecar"):
        tsis.load_frames(tmp_path)


@pytest.mark.parametrize(
    ("first", "second", "says"),
    [
        ({"probe": "tsis-2011"}, {"probe": "tsis-domed"}, "one probe; got tsis-2011, tsis-domed"),
        ({"probe": "tsis-2011"}, {"probe": "tsis-2011", "target": 2}, "one target; got 1, 2"),
    ],
)
def test_mixed_frames_are_refused(tmp_path: Path, first: Any, second: Any, says: str) -> None:
    snapshot(tmp_path, level=30, **first)
    snapshot(tmp_path, level=20, second=1, **second)
    with pytest.raises(ImageMismatchError, match=says) as error:
        tsis.load_frames(tmp_path)
    assert one_sentence(error.value)


def usable(**fields: Any) -> UsableCalibration:
    response = Calibration(gain_grey_per_kpa=1.0, saturation_kpa=80.0)
    return UsableCalibration(
        calibration=tsis.calibration.file.ProbeCalibration(name="rig", response=response, **fields), identity="0" * 64
    )


def test_a_calibration_of_another_probe_camera_or_setting_is_refused(tmp_path: Path) -> None:
    snapshot(tmp_path, level=30, probe="tsis-2011", camera="one", force={"force_n": 0.5})
    assert tsis.load_frames(tmp_path, calibration=usable(probe="tsis-2011", camera="one")).calibration is not None
    with pytest.raises(ImageMismatchError, match="one probe; got tsis-2011, tsis-domed"):
        tsis.load_frames(tmp_path, calibration=usable(probe="tsis-domed"))
    with pytest.raises(CalibrationError, match="must be of the camera in use, 'one'"):
        tsis.load_frames(tmp_path, calibration=usable(probe="tsis-2011", camera="two"))
    with pytest.raises(CalibrationError, match="holds at gain = 3; the camera is at 2"):
        tsis.load_frames(tmp_path, calibration=usable(probe="tsis-2011", settings={"gain": 3.0}))
    with pytest.raises(CalibrationError, match="must not be expired"):
        tsis.load_frames(
            tmp_path,
            calibration=usable(made=datetime(2020, 1, 1, tzinfo=UTC), expires=datetime(2020, 2, 1, tzinfo=UTC)),
        )
    snapshot(tmp_path, level=20, second=1, probe="tsis-2011", camera="two", force={"force_n": 0.5})
    with pytest.raises(ImageMismatchError, match="one camera; got one, two"):
        tsis.load_frames(tmp_path, calibration=usable(probe="tsis-2011"))


def test_the_given_probe_must_be_that_of_the_files(demo: Path) -> None:
    with pytest.raises(ImageMismatchError, match="one probe; got tsis-2011, tsis-domed"):
        tsis.load_frames(demo, probe=tsis.load_probe("tsis-2011"))
    with pytest.raises(ImageMismatchError, match="has other layers or lamps"):
        tsis.load_frames(demo, probe=replace(tsis.load_probe("tsis-domed"), radius_mm=11.0))


@pytest.mark.parametrize(
    "change",
    [
        {"version": 2},
        {"sha256": {}},
        {"sha256": None},
        {"role": "ball"},
        {"role": 3},
        {"target": 0},
        {"full_scale": "white"},
        {"full_scale": -1},
        {"settings": 3},
        {"force": {"force_n": "strong"}},
        {"force": {}},
        {"probe": ["tsis-2011"]},
        {"camera": None},
    ],
)
def test_a_damaged_sidecar_is_one_sentence(tmp_path: Path, change: dict[str, Any]) -> None:
    sidecar, _ = snapshot(tmp_path, level=30, probe="tsis-2011")
    sidecar.write_text(json.dumps(json.loads(sidecar.read_text()) | change))
    with pytest.raises(FileInputError, match=r"\.json' must be as tsis acquire wrote it") as error:
        tsis.load_frames(tmp_path)
    assert one_sentence(error.value)


def test_an_untrusted_estimate_shows_no_number_in_its_plot() -> None:
    draws = np.full(100, 4.321) + np.linspace(0, 0.01, 100)
    estimate = Estimate(samples={"diameter_mm": draws}, prior_sd={"diameter_mm": 4.0}, trusted=False, flags=("misfit",))
    figure = tsis.present.figures.posterior(estimate)
    (ax,) = figure.axes
    assert [text.get_text() for text in ax.texts] == ["not to be trusted\nmisfit"]
    assert ax.get_xticklabels() == []
    assert not ax.patches
