"""``tsis network``: networks go through their file unchanged, and tell the sizes of virtual presses."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import TYPE_CHECKING

import numpy as np
import pytest

import tsis
from tsis.calibration.file import ProbeCalibration, calibration_bytes, read_calibration
from tsis.inclusion import InclusionPrior
from tsis.inclusion.network import read_networks, train_networks, write_networks
from tsis.instrument.image_files import png_bytes, read_image
from tsis.model.calibration import LightMap
from tsis.virtual.probe import VirtualProbe

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.conftest import RunTsis

SCALE = (0.0336, 0.0392)
NAMES = ("calibration-1", "calibration-2", "calibration-3")  # 2, 8 and 13 mm wide at one depth and modulus


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Networks of a seed, and presses of a virtual probe on three inclusions and on plain tissue at 1 N."""
    folder = tmp_path_factory.mktemp("bench")
    probe = tsis.load_probe("tsis-2011")
    virtual = VirtualProbe(probe, rng=np.random.default_rng(90417), light=LightMap.uniform(), strain="small")
    for name in (*NAMES, "plain"):
        (folder / f"{name}.png").write_bytes(png_bytes(virtual.press(tsis.load_phantom(name), force_n=1.0)))
    known = ProbeCalibration(name="virtual", probe="tsis-2011", response=virtual.calibration)
    (folder / "calibration.json").write_bytes(calibration_bytes(known))
    write_networks(train_networks(probe, rng=np.random.default_rng(5), networks=10), folder / "networks.json")
    return folder


def applied(bench: Path) -> tuple[str | Path, ...]:
    frames: list[Path] = [bench / f"{name}.png" for name in NAMES]
    start: tuple[str | Path, ...] = (
        "network",
        "apply",
        bench / "networks.json",
        *frames,
        "--reference-press",
        bench / "plain.png",
    )
    return (*start, "--calibration", bench / "calibration.json", "--scale-mm", "0.0336,0.0392")


def test_the_command_trains_as_the_call_does(run_tsis: RunTsis, bench: Path, tmp_path: Path) -> None:
    finished = run_tsis("network", "train", "mine.json", "--seed", "5", "--networks", "10", "--json")
    assert finished.code == 0, finished.err
    assert (tmp_path / "mine.json").read_bytes() == (bench / "networks.json").read_bytes()
    document = json.loads(finished.out)
    assert (document["command"], document["networks"], document["probe"]) == ("network train", 10, "tsis-2011")
    trained = read_networks(tmp_path / "mine.json")
    assert trained.prior == asdict(InclusionPrior())
    again = run_tsis("network", "train", "mine.json")
    assert again.code == 2
    assert "must be a new name" in again.err


def test_frames_are_estimated_as_in_python_and_sizes_are_found(run_tsis: RunTsis, bench: Path, tmp_path: Path) -> None:
    finished = run_tsis(*applied(bench), "--force-n", "1", "--json", "--out", "reported")
    assert finished.code == 0, finished.err
    document = json.loads(finished.out)
    frames = [read_image(bench / f"{name}.png", mm_per_pixel=SCALE, force_n=1.0) for name in (*NAMES, "plain")]
    trained = read_networks(bench / "networks.json")
    response = read_calibration(bench / "calibration.json").response
    assert response is not None
    outputs = trained.outputs(frames[:-1], frames[-1], probe=tsis.load_probe("tsis-2011"), calibration=response)
    expected = trained(outputs).mean(axis=0)
    reported = [[each["mean"] for each in press["parameters"].values()] for press in document["presses"]]
    np.testing.assert_allclose(reported, expected)
    truth = [2.0, 8.0, 13.0]
    errors = np.abs(expected[:, 0] - truth)
    assert errors.max() < 3.5, "the source's own list errs by 1.5 mm in the mean square"
    assert (np.diff(expected[:, 0]) > 2.0).all(), "wider ones are reported to be wider"
    assert (tmp_path / "reported" / "result.json").exists()
    printed = run_tsis(*applied(bench), "--force-n", "1").out
    assert "no uncertainty of the estimate" in " ".join(printed.split())
    assert "Research use only" in printed


OTHER_CODES = {"calibration must be": 3}  # of messages that are no wrong input


def test_what_does_not_fit_the_networks_is_refused(run_tsis: RunTsis, bench: Path) -> None:
    for options, message in (
        (("--force-n", "0.8"), "force_n must be that of the training, 1 N within 5 %; got 0.8 N"),
        ((), "networks need --scale-mm and --force-n"),
        (("--force-n", "1", "--probe", "tsis-domed"), "calibration must be that of the probe 'tsis-domed'"),
    ):
        finished = run_tsis(*applied(bench), *options)
        assert finished.code == next((code for text, code in OTHER_CODES.items() if text in message), 2)
        assert message in finished.err
        assert finished.err.count("\n") == 1


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda text: text[: len(text) // 2], "networks.json"),
        (lambda text: text.replace('"force_n":1.0', '"force_n":2.0'), "does not match its hash"),
        (lambda text: text.replace('"weights":[', '"weights":[0.5,', 1), "does not match its hash"),
        (lambda _: '{"format": "tsis classifier", "version": 1}', "must be a 'tsis networks' file of version 1"),
        (lambda _: "\x00\x01", "networks.json"),
        (lambda _: "[1, 2]", "networks.json"),
    ],
)
def test_a_damaged_or_foreign_file_is_refused_in_one_sentence(
    run_tsis: RunTsis, bench: Path, tmp_path: Path, damage: object, message: str
) -> None:
    assert callable(damage)
    (tmp_path / "networks.json").write_text(damage((bench / "networks.json").read_text()))
    arguments = ["networks.json" if word == bench / "networks.json" else word for word in applied(bench)]
    finished = run_tsis(*arguments, "--force-n", "1")
    assert finished.code == 2
    assert message in finished.err
    assert finished.err.count("\n") == 1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--samples", "3"], "samples must"),
        (["--networks", "0"], "networks must"),
        (["--method", "sgd"], "no training method is called 'sgd'"),
        (["--hidden", "0"], "hidden"),
        (["--probe", "tsis-2012"], "tsis-2011"),
        (["--force-n", "-1"], "force_n must"),
    ],
)
def test_a_training_that_cannot_be_is_refused(
    run_tsis: RunTsis, tmp_path: Path, options: list[str], message: str
) -> None:
    finished = run_tsis("network", "train", "mine.json", *options)
    assert finished.code == 2
    assert message in finished.err
    assert not list(tmp_path.iterdir())
