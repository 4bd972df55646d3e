from __future__ import annotations

import numpy as np
import pytest

from tsis.calibration.measured import MeasuredValue
from tsis.calibration.scale import PixelScale
from tsis.errors import ImageMismatchError, InputError
from tsis.model.image import TactileImage

FIELDS = {
    "mm_per_pixel_x": MeasuredValue(value=0.0336, sd=1e-4, degrees_of_freedom=9, unit="mm/px"),
    "mm_per_pixel_y": MeasuredValue(value=0.0392, sd=1e-4, unit="mm/px"),
    "shape": (492, 768),
    "at_px": (383.5, 245.5),
    "method": "dots",
    "count": 63,
}


def scale(**other: object) -> PixelScale:
    return PixelScale(**(FIELDS | other))  # type: ignore[arg-type]


def test_a_frame_gets_both_axes() -> None:
    frame = TactileImage(grey=np.ones((492, 768)), name="press")
    scaled = scale().on(frame)
    assert scaled.mm_per_pixel == scale().mm_per_pixel == (0.0336, 0.0392)
    assert scaled.name == "press"


def test_a_frame_of_another_mode_is_refused() -> None:
    with pytest.raises(ImageMismatchError, match=r"\(492, 768\).*\(246, 384\).*camera mode"):
        scale().on(TactileImage(grey=np.ones((246, 384))))
    with pytest.raises(InputError, match="TactileImage"):
        scale().on(np.ones((492, 768)))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "wrong",
    [
        {"mm_per_pixel_x": 0.0336},
        {"mm_per_pixel_x": MeasuredValue(value=0.0336, sd=0.0, unit="mm")},
        {"mm_per_pixel_y": MeasuredValue(value=-1.0, sd=0.0, unit="mm/px")},
        {"shape": 5},
        {"shape": (0, 768)},
        {"at_px": (np.nan, 1.0)},
        {"method": "guess"},
        {"count": 0},
        {"residual_px": -1.0},
        {"rotation_deg": 90.0},
        {"skew_deg": np.inf},
    ],
    ids=lambda wrong: next(iter(wrong)),
)
def test_values_out_of_range(wrong: dict[str, object]) -> None:
    with pytest.raises(InputError, match=next(iter(wrong)).split("_")[0]):
        scale(**wrong)
