"""Ten mix-ups of frames, calibrations and tables of two probes: each is refused in one sentence, none is used."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from PIL import Image
from tests.calibration.bench import bench_reference, bench_scale
from tests.cli.test_saved_frames import snapshot

import tsis
from tsis.calibration.file import ProbeCalibration, calibration_bytes
from tsis.calibration.frames import UsableCalibration
from tsis.errors import CalibrationError, FileInputError, ImageMismatchError, NotCalibratedError, TsisError
from tsis.files.cache import cache_folder, read_cached_arrays, write_cached_arrays
from tsis.inclusion.network import TrainedNetworks
from tsis.model.calibration import Calibration, LightMap
from tsis.model.image import TactileImage

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.conftest import RunTsis

FLAT, DOMED = tsis.load_probe("tsis-2011"), tsis.load_probe("tsis-domed")
RESPONSE = Calibration(gain_grey_per_kpa=60.0, saturation_kpa=20.0, probe=FLAT.name)
SHAPE = (30, 40)
OPTIONS = ("--calibration", "calibration.json", "--force-n", "1")


def frame(seed: int = 0, **changes: Any) -> TactileImage:
    grey = np.random.default_rng(seed).normal(60.0, 1.0, SHAPE)
    return replace(TactileImage(grey=grey, mm_per_pixel=(0.6, 0.8), force_n=1.0, name=f"press-{seed}"), **changes)


def refused(
    error: type[TsisError],
    says: str,
    images: list[TactileImage],
    *,
    calibration: Calibration = RESPONSE,
    reference: list[TactileImage] | None = None,
) -> None:
    with pytest.raises(error, match=says) as caught:
        tsis.inclusion.estimate(images, probe=FLAT, calibration=calibration, reference=reference)
    assert "\n" not in str(caught.value)


def usable(**parts: Any) -> UsableCalibration:
    whole = ProbeCalibration(name="rig", probe=FLAT.name, response=RESPONSE, **parts)
    return UsableCalibration(calibration=whole, identity="0" * 64)


@pytest.fixture(autouse=True)
def no_surrogate(monkeypatch: pytest.MonkeyPatch) -> None:
    def built(*_: object, **__: object) -> None:
        raise AssertionError("the frames must be refused before the surrogate is built")

    monkeypatch.setattr("tsis.inclusion.estimation._tables", built)
    monkeypatch.setattr("tsis.inclusion.reading.build_full_contact_surrogate", built)


def test_1_a_calibration_of_another_probe() -> None:
    refused(
        NotCalibratedError,
        "calibration must be that of the probe 'tsis-2011'; got one of 'tsis-domed': calibrate",
        [frame()],
        calibration=replace(RESPONSE, probe=DOMED.name),
    )


def test_2_a_press_of_another_probe() -> None:
    other = frame(1, settings={"probe": DOMED.name})
    refused(ImageMismatchError, "of the probe 'tsis-2011'; 'press-1' was taken with 'tsis-domed'", [frame(), other])
    with pytest.raises(CalibrationError, match="must be of the probe in use, 'tsis-domed'; it is of 'tsis-2011'"):
        usable().pressed([other])


def test_3_a_reference_press_of_another_probe() -> None:
    other = frame(1, settings={"probe": DOMED.name})
    refused(ImageMismatchError, "'press-1' was taken with 'tsis-domed': give the probe", [frame()], reference=[other])


@pytest.mark.parametrize(
    ("about", "known", "says"),
    [
        ({"probe": "tsis-domed"}, {"probe": "tsis-2011"}, "must be of the probe in use, 'tsis-domed'"),
        ({"camera": "second"}, {"camera": "first"}, "must be of the camera in use, 'second'"),
        ({}, {"settings": {"gain": 3.0}}, "at gain = 3; the camera is at 2"),
    ],
)
def test_4_a_file_whose_sidecar_names_another_probe_camera_or_setting(
    run_tsis: RunTsis, tmp_path: Path, about: dict[str, Any], known: dict[str, Any], says: str
) -> None:
    sidecar, _ = snapshot(tmp_path, level=30, **about)
    raw = sidecar.with_name(f"{sidecar.stem}-raw.bmp")
    parts = {"name": "rig", "response": replace(RESPONSE, probe=""), **known}
    (tmp_path / "calibration.json").write_bytes(calibration_bytes(ProbeCalibration(**parts)))
    finished = run_tsis("examine", str(raw), *OPTIONS, "--scale-mm", "0.5")
    assert finished.code == 3
    assert says in " ".join(finished.err.split())
    assert "Traceback" not in finished.err
    if not about:
        sidecar.write_text("{")  # of another program: nothing is compared
        read = tsis.calibration.frames.read_press_image(raw)
        assert "camera" not in read.settings


def test_5_a_frame_of_another_scale() -> None:
    ours = bench_scale().mm_per_pixel
    (ready,), _ = usable(scale=bench_scale()).pressed([frame(mm_per_pixel=None)])
    assert ready.mm_per_pixel == ours
    with pytest.raises(ImageMismatchError, match=r"scale of 0.0336 x 0.0392 mm per pixel; got 0.05 x 0.05 \(give"):
        usable(scale=bench_scale()).pressed([frame(mm_per_pixel=(0.05, 0.05))])
    refused(ImageMismatchError, "must share mm_per_pixel", [frame(), frame(1, mm_per_pixel=(0.05, 0.05))])


def test_6_a_frame_of_another_size_or_depth() -> None:
    larger = frame(grey=np.full((60, 80), 60.0), axis_px=None, mm_per_pixel=None)
    for parts, says in (({"scale": bench_scale()}, "shape"), ({"reference": bench_reference()}, "reference's shape")):
        with pytest.raises(ImageMismatchError, match=says):
            usable(**parts).pressed([larger])
    deep = frame(full_scale=4095.0, mm_per_pixel=None)
    with pytest.raises(ImageMismatchError, match=r"full scale 255; got .* and 4095"):
        usable(reference=bench_reference()).pressed([deep])


def test_7_colour_files_among_grey_ones_and_the_coloured_picture(run_tsis: RunTsis, tmp_path: Path) -> None:
    grey, colour = frame(settings={"kind": "grey"}), frame(1, settings={"kind": "colour"})
    refused(ImageMismatchError, "must be grey files; 'press-1' is a colour one, of another camera", [grey, colour])
    sidecar, _ = snapshot(tmp_path, level=30)
    (tmp_path / "calibration.json").write_bytes(calibration_bytes(usable().calibration))
    finished = run_tsis("examine", str(sidecar.with_suffix(".bmp")), *OPTIONS, "--scale-mm", "0.5")
    assert finished.code == 2
    assert f"must be the raw frame, {sidecar.stem}-raw.bmp; it is its coloured picture" in " ".join(
        finished.err.split()
    )
    raw = sidecar.with_name(f"{sidecar.stem}-raw.bmp")
    Image.fromarray(np.full((40, 50), 9, np.uint8)).save(raw)  # overwritten by a frame of another probe
    with pytest.raises(FileInputError, match="content does not match its sidecar"):
        tsis.calibration.frames.read_press_image(raw)


@pytest.mark.parametrize(("reach_mm", "says"), [(9.0, "of a smaller probe"), (16.0, "of a larger probe")])
def test_8_a_map_of_the_light_on_another_face(reach_mm: float, says: str) -> None:
    side = np.linspace(-reach_mm, reach_mm, 9)
    none = np.zeros((9, 9))
    level = np.broadcast_to(1 + 0.01 * side, (9, 9))
    light = LightMap(x_mm=side, y_mm=side, relative=level, flux_x=none, flux_y=none, growth_per_mm=none, error=0.0)
    refused(NotCalibratedError, says, [frame()], calibration=replace(RESPONSE, probe="", light=light))


def lit(centre: float, *, lamps: float = 1.0, seed: int = 5) -> np.ndarray:
    """Light of an untouched probe: a bright part about a column, noise, and a dark level of 8."""
    x = np.arange(SHAPE[1])
    light = 40 * np.exp(-(((x - centre) / 12) ** 2)) * np.ones(SHAPE)
    return 8 + lamps * light + np.random.default_rng(seed).normal(0.0, 1.0, SHAPE)


def test_9_an_untouched_frame_with_the_light_of_another_probe(tmp_path: Path) -> None:
    own = replace(bench_reference(), dark_grey=np.full(SHAPE, 8.0), untouched_grey=lit(10.0) - 8, mm_per_pixel=None)
    known = usable(reference=own)
    same = frame(grey=lit(10.0, lamps=0.9, seed=6), force_n=0.0)
    known.require_untouched([same])
    other = frame(grey=lit(28.0), force_n=0.0)
    with pytest.raises(
        ImageMismatchError, match=r"must show the light .* it differs by .* \(of another probe"
    ) as error:
        known.require_untouched([other])
    assert "\n" not in str(error.value)
    usable(reference=None).require_untouched([other])  # nothing to compare with
    dark = replace(own, untouched_grey=np.zeros(SHAPE))
    dark.require_untouched(frame(grey=lit(10.0, lamps=0.0), force_n=0.0))
    with pytest.raises(ImageMismatchError, match="must show the light"):
        dark.require_untouched(same)


def test_10_a_table_or_networks_of_another_probe() -> None:
    write_cached_arrays("covered", "own", {"pressure": [1.0]})
    write_cached_arrays("covered", "other", {"pressure": [2.0]})
    folder = cache_folder() / "covered"
    (folder / "own").write_bytes((folder / "other").read_bytes())  # renamed to this probe's
    assert read_cached_arrays("covered", "own") is None
    assert read_cached_arrays("covered", "other") is not None
    trained = TrainedNetworks(probe=FLAT.name, force_n=1.0, reach_mm=8.0, prior={}, networks=())
    with pytest.raises(ImageMismatchError, match="'press-1' was taken with 'tsis-domed'"):
        trained.outputs([frame(), frame(1, settings={"probe": DOMED.name})], frame(2), probe=FLAT, calibration=RESPONSE)


def test_the_probe_of_a_sidecar_stays_with_its_frame(tmp_path: Path) -> None:
    """Frames of two folders are refused together, long after they were read."""
    for name in (FLAT.name, DOMED.name):
        snapshot(tmp_path / name, level=30, probe=name, force={"force_n": 0.5})
    flat, domed = (
        tsis.load_frames(tmp_path / name, mm_per_pixel=(0.5, 0.5)).images[0] for name in (FLAT.name, DOMED.name)
    )
    domed = replace(domed, grey=domed.grey + 1)
    refused(ImageMismatchError, "was taken with 'tsis-domed'", [flat, domed])
    assert json.dumps(dict(flat.settings))
