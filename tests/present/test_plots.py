from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure
from studies.panels import grey_sums

from tsis.imaging import features
from tsis.imaging.gel_contact import GelContact
from tsis.imaging.profile import radial_profile
from tsis.imaging.surface import height_surface
from tsis.model.estimate import Estimate
from tsis.model.image import TactileImage
from tsis.present.figures import gel_contact, marginal, relief, ring_profile, tactile_image, trade_off


@pytest.fixture
def bump() -> TactileImage:
    y, x = np.mgrid[:100, :160]
    return TactileImage(grey=80.0 * np.exp(-((x - 60) ** 2 + (y - 40) ** 2) / 400.0), mm_per_pixel=(0.1, 0.05))


@pytest.fixture
def estimate() -> Estimate:
    samples = np.random.default_rng(2).normal(8.0, 1.0, 2000)
    return Estimate(
        samples={"diameter_mm": samples, "depth_mm": samples / 2},
        prior_sd=dict.fromkeys(("diameter_mm", "depth_mm"), 4.0),
    )


def test_a_tactile_image_is_drawn_in_millimetres(bump: TactileImage) -> None:
    ax = Figure().subplots()
    assert tactile_image(bump, ax, features=features(bump)) is ax
    (shown,) = ax.images
    np.testing.assert_array_equal(shown.get_array(), bump.grey)
    assert ax.get_xlim() == pytest.approx((0, 16.0))
    assert ax.get_ylim() == pytest.approx((5.0, 0))
    bar = next(line for line in ax.lines if line.get_linewidth() == 3)
    assert np.ptp(np.asarray(bar.get_xdata())) == pytest.approx(2.0)
    assert any(text.get_text() == "2 mm" for text in ax.texts)
    centroid = ax.lines[-1]
    assert (centroid.get_xdata()[0], centroid.get_ydata()[0]) == pytest.approx((6.0, 2.0), abs=0.05)  # type: ignore[index]


def test_without_a_scale_axes_are_in_pixels(bump: TactileImage) -> None:
    ax = tactile_image(TactileImage(grey=bump.grey), Figure().subplots())
    assert ax.get_xlabel() == "x / px"
    assert not ax.texts


def test_the_relief_has_the_signal_as_height(bump: TactileImage) -> None:
    ax = Figure().add_subplot(projection="3d")
    assert relief(height_surface(bump), ax) is ax
    low, high = ax.get_zlim()
    assert low < 1.0
    assert high == pytest.approx(80.0, rel=0.1)


def test_a_profile_leaves_empty_rings_out(bump: TactileImage) -> None:
    profile = radial_profile(bump, edges_mm=[0.0, 1.0, 2.0, 50.0, 60.0])
    ax = ring_profile(profile, Figure().subplots())
    (line,) = ax.lines
    np.testing.assert_allclose(np.asarray(line.get_ydata()), profile.mean_grey[:3])


def test_a_marginal_is_a_density_with_its_interval(estimate: Estimate) -> None:
    ax = marginal(estimate, "diameter_mm", Figure().subplots(), prior_range=(1.0, 15.0), truth=8.5)
    (outline,) = (patch for patch in ax.patches if patch.get_label() == "posterior")
    x, y = outline.get_xy().T  # type: ignore[attr-defined]
    assert abs(np.trapezoid(y, x)) == pytest.approx(1.0)
    low, high = estimate.interval(0.9)["diameter_mm"]
    (span,) = (patch for patch in ax.patches if patch.get_label() == "90 % interval")
    assert span.get_x() == pytest.approx(low)  # type: ignore[attr-defined]
    assert span.get_width() == pytest.approx(high - low)  # type: ignore[attr-defined]
    assert any(line.get_label() == "truth" for line in ax.lines)


def test_a_trade_off_counts_every_sample(estimate: Estimate) -> None:
    ax = trade_off(estimate, ("diameter_mm", "depth_mm"), Figure().subplots(), truth=(8.0, 4.0))
    (mesh,) = ax.collections
    counts = mesh.get_array()
    assert counts is not None
    assert counts.sum() == 2000


def test_sums_are_drawn_in_millions_with_their_line() -> None:
    force, sums = np.array([0.5, 1.0, 2.0]), np.array([1e6, 2e6, 4e6]) + 3e5
    ax = grey_sums(force, sums, Figure().subplots(), label="10 mm tip")
    points, line = ax.lines
    np.testing.assert_allclose(np.asarray(points.get_ydata()), sums / 1e6)
    np.testing.assert_allclose(np.asarray(line.get_xdata()), [0.0, 2.0])
    np.testing.assert_allclose(np.asarray(line.get_ydata()), [0.3, 4.3])
    assert points.get_label() == "10 mm tip"
    grey_sums(force, 3 * sums, ax)
    assert ax.get_xlim() == pytest.approx((0.0, 2.1))
    assert ax.get_ylim() == pytest.approx((0.0, 1.05 * 12.9)), "room for all that was drawn"


def test_a_gel_frame_of_12_bits_keeps_its_levels_and_its_long_name_goes_on_below() -> None:
    contact = GelContact(
        name="a-very-long-name-of-a-frame-that-a-camera-gave-it-0001.tiff", centre_px=(30.0, 20.0),
        centre_sd_px=(0.5, 0.5), radius_px=9.0, radius_sd_px=0.4, semi_axes_px=(9.0, 9.0), angle_deg=0.0,
        centre_mm=None, centre_sd_mm=None, radius_mm=None, radius_sd_mm=None, area_mm2=None, area_sd_mm2=None,
        scale_sd=None, explained=0.99, quality=1.0, good=True, reasons=(),
    )  # fmt: skip
    frame = np.tile(np.linspace(0, 4000, 60).astype(np.uint16)[:, None], (40, 1, 3))
    ax = gel_contact(frame, contact, Figure().subplots())
    shown = np.asarray(ax.images[0].get_array())
    assert shown.max() == 255
    assert np.unique(shown).size > 50
    assert max(len(line) for line in ax.get_title().split("\n")) <= 40
