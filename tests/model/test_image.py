"""Images refuse what is none, and frames that are read together what does not belong together, in one sentence."""

from __future__ import annotations

import hashlib
from dataclasses import FrozenInstanceError, replace
from typing import Any

import numpy as np
import pytest

import tsis
from tsis.errors import ImageMismatchError, InputError, NotCalibratedError, TsisError
from tsis.model.calibration import Calibration
from tsis.model.image import TactileImage, as_images, grey_sha256, require_image_series, require_same_probe

GREY = np.arange(12.0).reshape(3, 4)


def test_an_image_is_a_read_only_copy_with_its_axis_in_the_middle() -> None:
    source, settings = GREY.copy(), {"gain": 1.0}
    image = TactileImage(grey=source, settings=settings)
    source[:], settings["gain"] = 0.0, 2.0
    np.testing.assert_array_equal(image.grey, GREY)
    assert image.settings == {"gain": 1.0}
    assert image.axis_px == (1.5, 1.0)
    with pytest.raises(ValueError, match="read-only"):
        image.grey[0, 0] = 1.0
    with pytest.raises(FrozenInstanceError):
        image.force_n = 1.0  # type: ignore[misc]


@pytest.mark.parametrize(
    ("changes", "phrase"),
    [
        ({"grey": np.zeros(3)}, "grey must have 2 axes"),
        ({"grey": np.zeros((0, 3))}, "grey must not be empty"),
        ({"grey": np.array([[np.nan, 1.0]])}, "grey must be finite; got 1 NaN"),
        ({"mm_per_pixel": (0.0, 0.1)}, "mm_per_pixel must lie in"),
        ({"mm_per_pixel": (0.1, -0.1)}, "mm_per_pixel must lie in"),
        ({"full_scale": 0.0}, "full_scale must lie in"),
        ({"force_n": -0.1}, "force_n must lie in"),
        ({"force_n": float("nan")}, "force_n must lie in"),
        ({"axis_px": (1.0, float("inf"))}, "axis_px must be finite"),
        ({"axis_px": 5}, "axis_px must have 1 axes"),
        ({"axis_px": ("a", "b")}, "axis_px must be an array of numbers"),
        ({"mm_per_pixel": (0.1, 0.1, 0.1)}, "mm_per_pixel must hold two numbers"),
        ({"settings": None}, "settings must be a mapping"),
        ({"grey": [[1e300]]}, "grey must lie within"),
        ({"grey": [[1j]]}, "grey must be an array of numbers"),
        ({"axis_px": (1.0, 2.0, 3.0)}, "axis_px must hold two numbers"),
    ],
)
def test_what_an_image_refuses(changes: dict[str, Any], phrase: str) -> None:
    with pytest.raises(InputError, match=phrase):
        TactileImage(**{"grey": GREY, **changes})


def test_an_unknown_scale_is_an_error_only_when_it_is_needed() -> None:
    assert TactileImage(grey=GREY, mm_per_pixel=(0.1, 0.2)).scale() == (0.1, 0.2)
    with pytest.raises(InputError, match="mm_per_pixel is not known for this image; give the size"):
        TactileImage(grey=GREY).scale()


DEEP_GREY = np.random.default_rng(3).integers(0, 65536, (4, 6)).astype(float)
FIRST = TactileImage(grey=DEEP_GREY, mm_per_pixel=(0.1, 0.1), full_scale=65535.0, force_n=1.0, name="one.png")
OTHER = replace(FIRST, grey=DEEP_GREY[::-1], name="two.png")


def test_one_several_or_none_become_a_list() -> None:
    assert as_images("images", None) == []
    assert as_images("images", FIRST) == [FIRST]
    assert as_images("images", (each for each in (FIRST, OTHER))) == [FIRST, OTHER]  # type: ignore[arg-type]


@pytest.mark.parametrize(("given", "what"), [(3, "int"), ([FIRST, DEEP_GREY], "ndarray"), ("one.png", "str")])
def test_what_is_no_image_is_named(given: Any, what: str) -> None:
    with pytest.raises(InputError, match=f"^reference must hold TactileImage values; got {what}$"):
        as_images("reference", given)


def test_frames_that_belong_together_are_known_by_their_grey_levels() -> None:
    expected = [hashlib.sha256(each.astype("<f4").tobytes()).hexdigest() for each in (DEEP_GREY, DEEP_GREY[::-1])]
    assert require_image_series([FIRST, OTHER]) == expected == [grey_sha256(DEEP_GREY), grey_sha256(DEEP_GREY[::-1])]


@pytest.mark.parametrize(
    ("changed", "error", "words"),
    [
        ({"force_n": None}, InputError, r"force_n must be known and positive for 'two\.png'; got None"),
        ({"mm_per_pixel": (0.1, 0.2)}, ImageMismatchError, r"share mm_per_pixel \(0\.1, 0\.1\) .* has \(0\.1, 0\.2\)"),
        ({"full_scale": 255.0}, ImageMismatchError, r"full_scale 65535; 'two\.png' has \(0\.1, 0\.1\) and 255"),
        ({"axis_px": (1.0, 1.0)}, ImageMismatchError, r"axis_px \(2\.5, 1\.5\); .* and \(1\.0, 1\.0\)"),
        ({"grey": DEEP_GREY[:3]}, ImageMismatchError, r"share the shape \(4, 6\) .* has \(3, 6\)"),
        ({"grey": DEEP_GREY}, InputError, r"'two\.png' is given twice"),
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
