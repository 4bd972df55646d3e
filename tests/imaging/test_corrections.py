from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tsis.errors import ImageMismatchError, InputError
from tsis.imaging.corrections import flatten, match_light, signal, subtract_background, subtract_dark
from tsis.model.image import TactileImage

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

SHAPE = (20, 30)


def uneven_light() -> NDArray[np.float64]:
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    return np.asarray(1.0 + 0.3 * np.cos(x / 9.0) * np.sin(1.0 + y / 7.0), dtype=np.float64)


def test_dark_and_flat_recover_the_scene_under_uneven_light() -> None:
    rng = np.random.default_rng(3)
    scene, light, dark = rng.uniform(20.0, 90.0, SHAPE), uneven_light(), rng.uniform(2.0, 9.0, SHAPE)
    frame = TactileImage(grey=scene * light + dark)
    flat = TactileImage(grey=80.0 * light)
    corrected = flatten(subtract_dark(frame, TactileImage(grey=dark)), flat).grey
    np.testing.assert_allclose(corrected / scene, light.mean(), rtol=1e-12)


def test_the_signal_is_positive_where_pressed_for_both_kinds_of_probe() -> None:
    reference = TactileImage(grey=np.full(SHAPE, 100.0))
    touch = np.zeros(SHAPE)
    touch[5:9, 6:12] = 40.0
    np.testing.assert_array_equal(signal(replace(reference, grey=100.0 + touch), reference).grey, touch)
    np.testing.assert_array_equal(signal(replace(reference, grey=100.0 - touch), reference, invert=True).grey, touch)


def test_noise_below_the_reference_is_kept() -> None:
    rng = np.random.default_rng(5)
    frames = [TactileImage(grey=50.0 + rng.normal(0.0, 2.0, (200, 200))) for _ in range(2)]
    change = signal(*frames).grey
    assert change.min() < -5.0
    assert abs(change.mean()) < 5.0 * 2.0 * np.sqrt(2.0) / 200.0


@given(ratio=st.floats(0.5, 2.0), touched=st.floats(0.0, 0.45))
def test_drift_of_the_lamps_is_told_from_a_touch(ratio: float, touched: float) -> None:
    reference = TactileImage(grey=60.0 * uneven_light())
    grey = ratio * reference.grey
    rows = int(touched * SHAPE[0])
    grey[:rows] += 100.0
    matched = match_light(reference, replace(reference, grey=grey)).grey
    np.testing.assert_allclose(matched, ratio * reference.grey, rtol=1e-12)


MISMATCHES: list[tuple[dict[str, Any], str]] = [
    ({"grey": np.ones((20, 31))}, r"reference must have the image's shape \(20, 30\); got \(20, 31\)"),
    ({"full_scale": 4095.0}, r"reference must have the image's full_scale 255; got 4095"),
    ({"mm_per_pixel": (0.1, 0.3)}, r"reference must have the image's mm_per_pixel \(0.1, 0.2\); got \(0.1, 0.3\)"),
]


@pytest.mark.parametrize(("change", "sentence"), MISMATCHES)
@pytest.mark.parametrize("call", [subtract_background, signal, lambda image, other: match_light(other, image)])
def test_frames_that_do_not_belong_together_are_refused(
    call: Callable[[TactileImage, TactileImage], TactileImage], change: dict[str, Any], sentence: str
) -> None:
    image = TactileImage(grey=np.ones(SHAPE), mm_per_pixel=(0.1, 0.2))
    with pytest.raises(ImageMismatchError, match=sentence):
        call(image, replace(image, **change))


def test_a_reference_of_unknown_scale_is_accepted() -> None:
    image = TactileImage(grey=np.ones(SHAPE), mm_per_pixel=(0.1, 0.2))
    assert signal(image, TactileImage(grey=np.zeros(SHAPE))).mm_per_pixel == (0.1, 0.2)


def test_bad_input_is_named() -> None:
    image = TactileImage(grey=np.ones(SHAPE))
    dark = replace(image, grey=np.zeros(SHAPE))
    with pytest.raises(InputError, match="invert needs a reference"):
        signal(image, invert=True)
    with pytest.raises(InputError, match="image must be a TactileImage; got ndarray"):
        signal(np.ones(SHAPE))  # type: ignore[arg-type]
    with pytest.raises(InputError, match="flat must be lit everywhere; got 600 dark pixels out of 600"):
        flatten(image, dark)
    with pytest.raises(InputError, match="reference must be lit"):
        match_light(dark, image)
    with pytest.raises(InputError, match="grey must be finite; got 1 NaN"):
        TactileImage(grey=np.array([[1.0, np.nan]]))
    with pytest.raises(InputError, match="grey must not be empty"):
        TactileImage(grey=np.empty((0, 4)))
