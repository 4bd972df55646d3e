"""``tsis examine`` without a gauge: the force line of the calibration reads the force off the frames."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import pytest
from tests.records.sample import sample_estimate

from tsis.calibration.camera_reference import CameraReference
from tsis.calibration.file import ProbeCalibration, write_calibration
from tsis.calibration.force_line import ForceLine
from tsis.calibration.measured import MeasuredValue
from tsis.calibration.scale import PixelScale
from tsis.errors import InputError
from tsis.model.calibration import Calibration

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.conftest import RunTsis

    from tsis.model.estimate import Estimate
    from tsis.model.image import TactileImage

ROWS, COLUMNS, DARK = 120, 160, 8
GREY_PER_N, DISC_GREY = 2e5, 90


def _sure(value: float, unit: str = "", *, sd: float = 0.0) -> MeasuredValue:
    return MeasuredValue(value=value, sd=sd, unit=unit)


def _known(**changes: Any) -> ProbeCalibration:
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
    write_calibration(_known(), tmp_path / "calibration.json")
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
        _known().need(CameraReference, "this"),
        untouched_grey=noise.random((ROWS, COLUMNS)),
        dark_grey=noise.random((ROWS, COLUMNS)),
    )
    write_calibration(_known(reference=reference), tmp_path / "calibration.json")
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


OTHER_CODES = {"part 'reference'": 3}  # of messages that are no wrong input


@pytest.mark.parametrize(
    ("without", "said"),
    [
        ({"force_line": None}, "needs --scale-mm and --force-n"),
        ({"reference": None}, "a force without --force-n needs the part 'reference'"),
    ],
)
def test_what_is_missing_for_a_force_is_named(
    run_tsis: RunTsis, tmp_path: Path, without: dict[str, None], said: str
) -> None:
    _frame(tmp_path / "a.png", 20.0)
    write_calibration(_known(**without), tmp_path / "calibration.json")
    finished = run_tsis("examine", "a.png", "--calibration", "calibration.json")
    assert finished.code == next((code for text, code in OTHER_CODES.items() if text in said), 2)
    assert said in finished.err


def test_a_force_beyond_the_line_and_a_second_scale_are_refused(run_tsis: RunTsis, tmp_path: Path) -> None:
    _frame(tmp_path / "a.png", 2.0)
    write_calibration(_known(), tmp_path / "calibration.json")
    too_light = run_tsis("examine", "a.png", "--calibration", "calibration.json")
    assert too_light.code == 2
    assert "0.05" in too_light.err
    twice = run_tsis("examine", "a.png", "--calibration", "calibration.json", "--scale-mm", "0.1")
    assert "--scale-mm is not used with this calibration" in twice.err
