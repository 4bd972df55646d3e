"""The mesh of a probe with a rounded rim, against the geometry of its flat, its quarter circle and its side."""

from __future__ import annotations

import numpy as np
import pytest

import tsis
from tsis.mechanics.finite_strain.neo_hookean import OWN, ElasticBody, number_unknowns
from tsis.mechanics.finite_strain.patches import NARROW, FiniteResolution, mesh_probe, mesh_slab, rounded, slab_lines

PROBE = tsis.load_probe("tsis-2011")


@pytest.mark.parametrize("fillet", [0.2, 0.5])
def test_places_on_the_outline_are_lengths_along_it(fillet: float) -> None:
    shape = rounded(PROBE, fillet)
    assert shape.fillet_mm == fillet
    flat, rim = PROBE.radius_mm - fillet, np.pi / 2 * fillet
    turn = np.array([0.0, 0.0, np.pi / 6, np.pi / 4, np.pi / 2, np.pi / 2])
    places = np.array([flat / 2, flat, flat + rim / 3, shape.middle_mm, flat + rim, flat + rim + 1.0])
    level = np.array([flat / 2, flat, flat, flat, flat, flat])
    side = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    expected = np.column_stack([level + fillet * np.sin(turn), -fillet * (1 - np.cos(turn)) - side])
    np.testing.assert_allclose(shape.flat_points(places), expected, atol=1e-12)
    radii = np.linspace(0.0, PROBE.radius_mm, 301)
    np.testing.assert_allclose(shape.radius_at(shape.arc_at(radii)), radii, atol=1e-12)
    np.testing.assert_allclose(shape.arc_at(radii[[0, 150, 300]]), [0.0, PROBE.radius_mm / 2, flat + rim])


def test_the_mesh_fills_the_probe() -> None:
    """The volume is that of a cylinder with a quarter circle at its rim; glass, side and face lie where they must."""
    shape = rounded(PROBE, 0.5)
    fillet = shape.fillet_mm
    lines = np.append(np.linspace(0.0, PROBE.radius_mm - fillet, 9), shape.middle_mm) / shape.middle_mm
    meshed = mesh_probe(shape, lines, FiniteResolution())
    nodes = meshed.solid.nodes
    body = ElasticBody(meshed.solid, number_unknowns(meshed.solid, np.full((len(nodes), 2), OWN), 0))
    radius, height, flat = PROBE.radius_mm, PROBE.thickness_mm, PROBE.radius_mm - fillet
    rim = flat**2 * fillet + flat * np.pi * fillet**2 / 2 + 2 * fillet**3 / 3
    assert body.volume.sum() == pytest.approx(np.pi * (radius**2 * (height - fillet) + rim), rel=1e-6)
    assert body.volume.min() > 0
    np.testing.assert_allclose(nodes[meshed.glass, 1], -height)
    assert np.ptp(nodes[meshed.glass, 0]) == pytest.approx(radius)
    np.testing.assert_allclose(nodes[meshed.side, 0], radius)
    assert nodes[meshed.side, 1].max() < -fillet + 1e-9
    np.testing.assert_allclose(nodes[meshed.face], shape.points(meshed.arc_mm), atol=1e-12)
    assert (np.diff(meshed.arc_mm) > 0).all()


@pytest.mark.parametrize(("wider", "layers"), [(1.0, 4), (1.001, 8)])
def test_a_block_that_takes_in_the_rim_has_twice_the_layers(wider: float, layers: int) -> None:
    sphere = tsis.Inclusion(diameter_mm=wider * NARROW * PROBE.radius_mm, depth_mm=5.0, young_kpa=50.0)
    phantom = tsis.Phantom(young_kpa=5.0, thickness_mm=30.0, inclusion=sphere)
    lines = slab_lines(phantom, PROBE, FiniteResolution())
    assert lines.layers == layers
    around = mesh_slab(phantom, PROBE, FiniteResolution()).solid.patches[0]
    assert around.shape[1] == layers * FiniteResolution().order + 1
