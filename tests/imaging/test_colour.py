from __future__ import annotations

import numpy as np
import pytest
from matplotlib import colormaps

from tsis.errors import ImageMismatchError, InputError, UnknownNameError
from tsis.imaging.colour import change_magnitude, colour_map
from tsis.model.image import TactileImage


def test_change_magnitude_is_the_distance_between_colours() -> None:
    rng = np.random.default_rng(47)
    frame, reference = rng.integers(0, 256, (2, 9, 11, 3)).astype(np.uint8)
    expected = np.linalg.norm(frame.astype(float) - reference.astype(float), axis=2)
    np.testing.assert_allclose(change_magnitude(frame, reference), expected, rtol=1e-12)


def test_equal_lamps_make_gains_immaterial() -> None:
    y, x = np.mgrid[:60, :60]
    inside = np.hypot(x - 30, y - 30) < 15
    slopes = np.stack([(x - 30) * inside, (y - 30) * inside, (x + y - 60) * inside], axis=2).astype(float)
    nothing = np.zeros_like(slopes)
    even = change_magnitude(6.0 * slopes, nothing, equalise_lamps=True)
    uneven = change_magnitude(6.0 * slopes * np.array([1.3, 0.8, 1.0]), nothing, equalise_lamps=True)
    correlation = np.corrcoef(even[inside], uneven[inside])[0, 1]
    assert correlation > 0.999
    plain = change_magnitude(6.0 * slopes * np.array([1.3, 0.8, 1.0]), nothing)
    assert np.corrcoef(even[inside], plain[inside])[0, 1] < correlation


def test_colour_frames_that_do_not_belong_together_are_refused() -> None:
    with pytest.raises(ImageMismatchError, match="reference_rgb must have the frame's shape"):
        change_magnitude(np.ones((4, 4, 3)), np.ones((4, 5, 3)))
    with pytest.raises(InputError, match="frame_rgb must have 3 axes"):
        change_magnitude(np.ones((4, 4)), np.ones((4, 4)))
    with pytest.raises(InputError, match="reference_rgb must be finite"):
        change_magnitude(np.ones((1, 1, 3)), np.full((1, 1, 3), np.nan))


@pytest.mark.parametrize("name", ["cividis", "inferno", "viridis"])
def test_colours_are_those_of_the_published_map(name: str) -> None:
    image = TactileImage(grey=np.arange(256.0).reshape(16, 16))
    published = (colormaps[name](np.arange(256))[:, :3] * 255.0).reshape(16, 16, 3)
    assert np.abs(colour_map(image, name=name).astype(float) - published).max() <= 4.0


def test_levels_beyond_the_ends_get_the_ends_colours() -> None:
    image = TactileImage(grey=np.array([[-5.0, 10.0, 20.0, 90.0]]))
    colours = colour_map(image, low=10.0, high=20.0)
    assert colours.dtype == np.uint8
    assert colours[0, 0].tolist() == colours[0, 1].tolist()
    assert colours[0, 2].tolist() == colours[0, 3].tolist()
    assert colours[0, 0].tolist() != colours[0, 3].tolist()


def test_bad_maps_are_named() -> None:
    image = TactileImage(grey=np.ones((1, 1)))
    with pytest.raises(UnknownNameError, match="did you mean 'viridis'"):
        colour_map(image, name="virids")
    with pytest.raises(InputError, match="high must exceed low = 5; got 5"):
        colour_map(image, low=5.0, high=5.0)
    with pytest.raises(InputError, match="image must be a TactileImage"):
        colour_map(np.ones((2, 2)))  # type: ignore[arg-type]
