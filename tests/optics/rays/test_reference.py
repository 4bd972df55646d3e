"""The fast tracer against photons followed one by one, and single rays of both point by point."""

from __future__ import annotations

from dataclasses import astuple, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from tsis.catalog.probes import load_probe
from tsis.model.press import PressField
from tsis.model.probe import FOUR_LEDS, Glass, Led, Probe
from tsis.optics.rays.geometry import hertz_dent, scene
from tsis.optics.rays.reference import WAYS_OUT, Photon, reference_probe, shine, trace_photons
from tsis.optics.rays.tracing import follow_path, trace_rays

if TYPE_CHECKING:
    from tsis.model.press import PressMap

PROBE = replace(load_probe("tsis-2011"), leds=FOUR_LEDS)  # level lamps at half height
CLEAR = replace(PROBE, glass=Glass(refractive_index=1.41))  # one medium, in which chance decides nothing
DENT = hertz_dent(12.0, tip_radius_mm=8.0, depth_mm=1.2, peak_pressure_kpa=25.0, offset_mm=(1.0, 2.0))
UNEVEN = replace(
    PROBE,
    layers=tuple(
        replace(layer, refractive_index=index) for layer, index in zip(PROBE.layers, (1.41, 1.44, 1.39), strict=True)
    ),
    leds=(
        Led(azimuth_deg=20.0, half_angle_deg=45.0, aim_deg=-10.0),
        Led(azimuth_deg=140.0, half_angle_deg=60.0, power=0.5, height_mm=9.5),
    ),
)
CASES: dict[str, tuple[Probe, PressMap | None, dict[str, Any]]] = {
    "flat": (PROBE, None, {}),
    "dented": (UNEVEN, DENT, {}),
    "absorbing": (UNEVEN, DENT, {"absorption_per_mm": 0.02}),
    "domed in water": (replace(UNEVEN, face_curvature_mm=40.0), DENT, {"index_outside": 1.33}),
}


class Scripted:
    """Stands in for chance: goes in, and then is always turned back."""

    def __init__(self) -> None:
        self.asked = 0

    def random(self) -> float:
        self.asked += 1
        return 1.0 if self.asked == 1 else 0.0


def z_scores(case: str, photons: int) -> dict[str, float]:
    """Differences of both tracers over their standard errors."""
    probe, pressed, given = CASES[case]
    slow = trace_photons(probe, pressed, photons=photons, rng=np.random.default_rng(7), **given)
    assert sum(astuple(slow)) == pytest.approx(1.0), "each photon has one end"
    fast = trace_rays(probe, pressed, rays=200_000, **given)
    scores = {}
    for name in WAYS_OUT:
        share = getattr(fast.tally, name)
        spread = np.hypot(np.sqrt(share * (1 - share) / photons), getattr(fast.standard_error, name))
        scores[name] = (getattr(slow, name) - share) / max(spread, 1 / photons)
    return scores


@pytest.mark.parametrize(
    "case", [pytest.param(each, marks=[pytest.mark.slow] * (each in ("flat", "absorbing"))) for each in CASES]
)
def test_shares_agree_within_their_errors(case: str) -> None:
    assert max(map(abs, z_scores(case, 500).values())) < 4


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_shares_agree_within_small_errors(case: str) -> None:
    assert max(map(abs, z_scores(case, 30_000).values())) < 4


@pytest.mark.parametrize(("half_angle_deg", "mean_cosine"), [(60.0, 2 / 3), (45.0, 3 / 4)])
def test_a_lamp_shines_from_its_whole_disc_about_its_axis(half_angle_deg: float, mean_cosine: float) -> None:
    """A disc has the variance d^2 / 16 along each side; under cos^m the mean cosine is (m + 1) / (m + 2), m = 1, 2."""
    led = Led(azimuth_deg=30.0, aim_deg=20.0, height_mm=4.0, diameter_mm=3.0, half_angle_deg=half_angle_deg)
    rng = np.random.default_rng(2)
    photons = [shine(led, PROBE, rng) for _ in range(4000)]
    outward, across = np.array([[np.sqrt(0.75), 0.5, 0.0], [-0.5, np.sqrt(0.75), 0.0]])
    place = np.array([photon.position for photon in photons]) - [0.0, 0.0, 4.0]
    np.testing.assert_allclose(place @ outward, PROBE.radius_mm)
    spot = np.stack([place @ across, place[:, 2]])
    assert np.hypot(*spot).max() <= 1.5
    np.testing.assert_allclose(spot.mean(axis=1), 0.0, atol=5 * 0.75 / np.sqrt(4000))
    np.testing.assert_allclose(spot.var(axis=1), 3.0**2 / 16, rtol=0.1)
    axis = np.append(-np.cos(np.radians(20.0)) * outward[:2], np.sin(np.radians(20.0)))
    cosine = np.array([photon.direction for photon in photons]) @ axis
    assert cosine.mean() == pytest.approx(mean_cosine, abs=5 * cosine.std() / np.sqrt(4000))
    assert cosine.min() > 0


SMOOTH = PressField(
    radius_mm=(RADIUS := np.linspace(0.0, 12.0, 241)),
    face_displacement_mm=0.8 * np.exp(-(RADIUS**2) / 36.0),
    pressure_kpa=np.zeros(241),
    approach_mm=0.8,
    force_n=0.0,
)


@pytest.mark.parametrize(("untouched", "tolerance"), [(None, 1e-9), (SMOOTH, 1e-3)])
def test_single_rays_take_the_same_way(untouched: PressField | None, tolerance: float) -> None:
    """On a dent the two tracers put different splines through the same heights."""
    view = scene(CLEAR, untouched)._replace(weak=0.0)
    rng = np.random.default_rng(5)
    met = 0
    for _ in range(12):
        azimuth, elevation = rng.uniform(-0.5, 0.5), rng.uniform(-0.9, -0.1)
        direction = np.array([-np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), 0.0])
        direction[2] = np.sin(elevation)
        fast = follow_path(view, (12.0, 0.0, 4.0), direction)[:8, :3]
        plain = reference_probe(CLEAR, untouched)
        chance: Any = Scripted()
        followed = _points(plain, Photon(position=np.array([12.0, 0.0, 4.0]), direction=direction), chance)
        same = min(len(fast), len(followed), 5)
        assert same >= 4
        np.testing.assert_allclose(np.array(followed)[:same], fast[:same], atol=tolerance)
        met += int(np.count_nonzero(np.abs(fast[1:same, 2]) < 1.3))
    assert met >= 12, "most rays met the face"


def _points(plain: Any, photon: Photon, chance: Any) -> list[Any]:
    """The first points of a photon that is always turned back, which would never end."""
    points = [photon.position]
    now = plain._enter(photon, chance)
    while isinstance(now, Photon) and len(points) < 8:
        points.append(now.position)
        now = plain._go_on(now, chance)
    return points
