from __future__ import annotations

from dataclasses import FrozenInstanceError
from typing import Any

import numpy as np
import pytest

from tsis.errors import InputError
from tsis.model.image import TactileImage

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
