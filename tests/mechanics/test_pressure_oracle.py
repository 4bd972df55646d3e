"""Contact pressure against an independent code.

The reference is NGSolve 6.2: fifth-order triangles, 18,360 unknowns, graded towards the edge of the contact, the
frictionless tie by a penalty of 1e5 kPa/mm; tissue cut off at 120 mm. Ring means of the pressure in kPa at 1 N.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from tsis.catalog.probes import load_probe
from tsis.mechanics import press
from tsis.model.phantom import Inclusion, Phantom

RING_EDGES_MM = np.linspace(0.0, 9.6, 21)
WITH_SPHERE = """2.0974 2.08187 2.05186 2.00913 1.95641 1.89664 1.83308 1.76892 1.70712 1.65023
                 1.6003 1.5591 1.52777 1.50743 1.49906 1.50364 1.52283 1.55892 1.61582 1.70016"""
PLAIN = """1.32045 1.32136 1.32321 1.32603 1.3299 1.33494 1.34125 1.34903 1.35854 1.37005
           1.38393 1.40079 1.42119 1.44606 1.47659 1.51425 1.5614 1.62115 1.69837 1.80082"""


@pytest.mark.parametrize(("with_sphere", "reference"), [(True, WITH_SPHERE), (False, PLAIN)])
def test_ring_means_of_the_pressure(*, with_sphere: bool, reference: str) -> None:
    sphere = Inclusion(diameter_mm=10.0, depth_mm=5.0, young_kpa=100.0)
    phantom = Phantom(young_kpa=5.0, thickness_mm=30.0, inclusion=sphere if with_sphere else None)
    field = press(load_probe("tsis-2011"), phantom, force_n=1.0)
    means = []
    for low, high in itertools.pairwise(RING_EDGES_MM):
        radius = np.linspace(low, high, 41)
        pressure = np.interp(radius, field.radius_mm, field.pressure_kpa)
        means.append(np.trapezoid(pressure * radius, radius) / np.trapezoid(radius, radius))
    np.testing.assert_allclose(means, np.array(reference.split(), dtype=float), rtol=1e-3)
