from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.stats import linregress, norm

from tsis.calibration.camera_reference import PhotonTransfer, _line, _Point, _points, photon_transfer
from tsis.errors import CalibrationError

if TYPE_CHECKING:
    from numpy.typing import NDArray

SIZE = (120, 160)
EVERY = np.ones(SIZE, dtype=bool)
READ, SHOT = 0.5, 0.02


def frames(
    rng: np.random.Generator,
    light: float,
    *,
    read: float = READ,
    offset: float = 8.0,
    count: int = 6,
    flicker: float = 0.0,
) -> NDArray[np.float64]:
    """Whole electrons and normal read noise, rounded: no code is shared with the camera of the package."""
    lamps = 1 + flicker * rng.standard_normal(count)
    shaded = light * np.linspace(0.9, 1.1, SIZE[1])
    electrons = rng.poisson(np.broadcast_to(lamps[:, None, None] * shaded / SHOT, (count, *SIZE)))
    return np.rint(offset + SHOT * electrons + read * rng.standard_normal((count, *SIZE)))


def transfer(
    rng: np.random.Generator, *, read: float = READ, offset: float = 8.0, flicker: float = 0.0
) -> PhotonTransfer:
    levels = [frames(rng, light, read=read, offset=offset, flicker=flicker) for light in (40.0, 100.0, 160.0)]
    return photon_transfer(frames(rng, 0.0, read=read, offset=offset), levels, usable=EVERY, full_scale=255.0)


@pytest.mark.parametrize("read", [0.4, 0.5, 1.5])
@pytest.mark.parametrize("offset", [8.0, 8.3, 8.5])
def test_both_noises_are_found_through_rounding(read: float, offset: float) -> None:
    found = transfer(np.random.default_rng(1), read=read, offset=offset)
    assert abs(found.read_noise_grey.value - read) < 4 * found.read_noise_grey.sd
    assert abs(found.shot_noise_grey.value - SHOT) < 4 * found.shot_noise_grey.sd
    assert found.read_noise_grey.sd < 0.01 * read


def test_rounding_at_a_whole_level_would_mislead_who_takes_a_twelfth() -> None:
    """What the harmonic is for: exact probabilities of a rounded normal of mean 8 give less than s**2 + 1/12."""
    levels = np.arange(30)
    share = norm.cdf((levels + 0.5 - 8) / READ) - norm.cdf((levels - 0.5 - 8) / READ)
    variance = share @ (levels - 8.0) ** 2
    naive = float(np.sqrt(variance - 1 / 12))
    found = transfer(np.random.default_rng(2)).read_noise_grey
    assert abs(naive - READ) > 5 * found.sd
    assert abs(found.value - READ) < 4 * found.sd


def test_lamps_that_flicker_are_no_noise() -> None:
    found = transfer(np.random.default_rng(3), flicker=0.01)
    assert abs(found.shot_noise_grey.value - SHOT) < 4 * found.shot_noise_grey.sd


def test_intervals_hold_the_truth() -> None:
    held = 0
    for seed in range(40):
        found = transfer(np.random.default_rng(100 + seed))
        low, high = found.read_noise_grey.interval()
        held += low <= READ <= high
    assert held >= 33  # 95 % of 40 is 38; fewer than 33 has a chance of 1 in 1,000


def test_the_error_of_a_variance_is_its_scatter() -> None:
    """The error that one set of frames states is the scatter of the variances of many sets."""
    rng, base = np.random.default_rng(8), np.full(500, 8.2)
    sets = [np.rint(base + 1.5 * rng.standard_normal((6, 500))) for _ in range(400)]
    (points,) = zip(*(_points(values, base, is_dark=True) for values in sets), strict=True)
    variance = np.array([point.variance for point in points])
    assert variance.mean() == pytest.approx(1.5**2, rel=0.01)
    assert variance.std() == pytest.approx(np.mean([point.error for point in points]), rel=0.15)


def test_scatter_beyond_the_stated_errors_widens_the_intervals() -> None:
    """A hundred times the scatter that is stated: errors are those of a regression that knows none of them."""
    light = np.linspace(0.0, 150.0, 12)
    off = np.where(np.arange(12) % 2, 1.0, -1.0) * np.linspace(0.5, 1.0, 12)
    wide, narrow = (
        _line([_Point(x, 4 + 0.05 * x + size * y, 0.01) for x, y in zip(light, off, strict=True)])
        for size in (1.0, 0.0)
    )
    regression = linregress(light, 4 + 0.05 * light + off)
    assert wide.shot_noise_grey.value == pytest.approx(regression.slope)
    assert wide.shot_noise_grey.sd == pytest.approx(regression.stderr)
    assert wide.read_noise_grey.value == pytest.approx(np.sqrt(regression.intercept))
    assert wide.read_noise_grey.sd == pytest.approx(regression.intercept_stderr / (2 * np.sqrt(regression.intercept)))
    assert narrow.shot_noise_grey.sd == pytest.approx(0.01 / np.sqrt(12 * light.var()))


def test_clipped_frames_are_refused() -> None:
    rng = np.random.default_rng(4)
    dark = np.maximum(frames(rng, 0.0, offset=0.2), 0.0)
    with pytest.raises(CalibrationError, match="clip"):
        photon_transfer(dark, [frames(rng, 100.0)], usable=EVERY, full_scale=255.0)


def test_levels_at_the_full_scale_count_as_clipped() -> None:
    rng = np.random.default_rng(4)
    bright = np.minimum(frames(rng, 100.0), 108.0)
    with pytest.raises(CalibrationError, match="clip"):
        photon_transfer(frames(rng, 0.0), [bright], usable=EVERY, full_scale=108.0)


def test_dark_levels_alone_are_refused() -> None:
    rng = np.random.default_rng(5)
    with pytest.raises(CalibrationError, match="flat-field"):
        photon_transfer(frames(rng, 0.0), [frames(rng, 2.0)], usable=EVERY, full_scale=255.0)


def test_noise_below_rounding_is_refused() -> None:
    rng = np.random.default_rng(6)
    with pytest.raises(CalibrationError, match="rounding"):
        transfer(rng, read=0.05, offset=8.3)
