"""Frames that are read together are refused where they do not belong together, each fault in one sentence."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import tsis
from tsis.errors import ImageMismatchError, InputError, NotCalibratedError, TsisError
from tsis.model.calibration import Calibration
from tsis.model.image import TactileImage, as_images, grey_sha256, require_image_series, require_same_probe

GREY = np.random.default_rng(3).integers(0, 65536, (4, 6)).astype(float)
FIRST = TactileImage(grey=GREY, mm_per_pixel=(0.1, 0.1), full_scale=65535.0, force_n=1.0, name="one.png")
OTHER = replace(FIRST, grey=GREY[::-1], name="two.png")


def test_one_several_or_none_become_a_list() -> None:
    assert as_images("images", None) == []
    assert as_images("images", FIRST) == [FIRST]
    assert as_images("images", (each for each in (FIRST, OTHER))) == [FIRST, OTHER]  # type: ignore[arg-type]


@pytest.mark.parametrize(("given", "what"), [(3, "int"), ([FIRST, GREY], "ndarray"), ("one.png", "str")])
def test_what_is_no_image_is_named(given: Any, what: str) -> None:
    with pytest.raises(InputError, match=f"^reference must hold TactileImage values; got {what}$"):
        as_images("reference", given)


def test_frames_that_belong_together_are_known_by_their_grey_levels() -> None:
    expected = [hashlib.sha256(each.astype("<f4").tobytes()).hexdigest() for each in (GREY, GREY[::-1])]
    assert require_image_series([FIRST, OTHER]) == expected == [grey_sha256(GREY), grey_sha256(GREY[::-1])]


@pytest.mark.parametrize(
    ("changed", "error", "words"),
    [
        ({"force_n": None}, InputError, r"force_n must be known and positive for 'two\.png'; got None"),
        ({"mm_per_pixel": (0.1, 0.2)}, ImageMismatchError, r"share mm_per_pixel \(0\.1, 0\.1\) .* has \(0\.1, 0\.2\)"),
        ({"full_scale": 255.0}, ImageMismatchError, r"full_scale 65535; 'two\.png' has \(0\.1, 0\.1\) and 255"),
        ({"axis_px": (1.0, 1.0)}, ImageMismatchError, r"axis_px \(2\.5, 1\.5\); .* and \(1\.0, 1\.0\)"),
        ({"grey": GREY[:3]}, ImageMismatchError, r"share the shape \(4, 6\) .* has \(3, 6\)"),
        ({"grey": GREY}, InputError, r"'two\.png' is given twice"),
    ],
)
def test_frames_that_do_not_belong_together(changed: dict[str, Any], error: type[TsisError], words: str) -> None:
    with pytest.raises(error, match=words):
        require_image_series([FIRST, replace(OTHER, **changed)])


def test_a_calibration_must_be_there_and_of_this_probe() -> None:
    probe, answer = tsis.load_probe("tsis-2011"), Calibration(gain_grey_per_kpa=10.0, saturation_kpa=20.0)
    for name in ("", "tsis-2011"):
        require_same_probe(probe, replace(answer, probe=name))
    require_same_probe(replace(probe, name=""), replace(answer, probe="another"))
    with pytest.raises(
        NotCalibratedError, match="of the probe 'tsis-2011'; got one of 'another': calibrate this probe"
    ):
        require_same_probe(probe, replace(answer, probe="another"))
    with pytest.raises(NotCalibratedError, match=r"calibration must be a Calibration, .*; got None"):
        require_same_probe(probe, None)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="probe must be a Probe; got 'tsis-2011'"):
        require_same_probe("tsis-2011", answer)  # type: ignore[arg-type]
