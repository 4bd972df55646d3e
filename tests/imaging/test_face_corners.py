"""Corners of a lit face, against faces that scikit-image warps into a frame."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy
import skimage

from tsis.errors import InputError
from tsis.imaging.face_corners import find_face_corners

CORNERS = ((120.0, 70.0), (530.0, 95.0), (575.0, 420.0), (70.0, 390.0))


def seen_face(corners: Any, seed: int) -> Any:
    """A face of uneven light and colour in a dark frame of 640 x 480 pixels, blurred and noisy."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:300, :400] / 300.0
    face = np.stack([90 + 60 * x, 110 + 50 * y, 100 + 40 * (1 - x)], axis=-1)
    upright = np.array([(0, 0), (399, 0), (399, 299), (0, 299)], float)
    warp = skimage.transform.ProjectiveTransform.from_estimate(np.array(corners), upright)  # type: ignore[no-untyped-call]
    frame = skimage.transform.warp(  # type: ignore[no-untyped-call]
        face, warp, output_shape=(480, 640), cval=8.0, preserve_range=True
    )
    frame = scipy.ndimage.gaussian_filter(frame, (1.5, 1.5, 0.0)) + rng.normal(0.0, 3.0, frame.shape)
    return np.clip(frame, 0, 255).astype(np.uint8)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_corners_of_a_warped_face_are_found(seed: int) -> None:
    rng = np.random.default_rng([99, seed])
    corners = np.array(CORNERS) + rng.uniform(-40.0, 40.0, (4, 2))
    found = find_face_corners(seen_face(corners, seed))
    assert np.abs(np.array(found) - corners).max() < 2.5


def test_a_grey_frame_has_its_corners_too() -> None:
    found = find_face_corners(seen_face(CORNERS, 4).mean(axis=2))
    assert np.abs(np.array(found) - CORNERS).max() < 2.5


@pytest.mark.parametrize(
    ("frame", "said"),
    [
        (np.full((100, 120), 50.0), "one level"),
        (np.pad(np.full((10, 10), 200.0), 100), "must cover"),
        (200.0 * (np.hypot(*(np.mgrid[:200, :200] - 100.0)) < 70), "one quadrilateral"),
        (np.zeros(5), "shape"),
    ],
)
def test_what_is_no_face_is_refused_in_one_sentence(frame: Any, said: str) -> None:
    with pytest.raises(InputError, match=said):
        find_face_corners(frame)
