"""Presses at finite strain that cannot be solved say why: over a grid of tissues and forces none just stalls."""

from __future__ import annotations

import re

import pytest

import tsis
from tsis.errors import MechanicsError
from tsis.mechanics.finite_strain.neo_hookean_press import PressSeries

CAUSES = re.compile(
    "wraps around the probe's rim|the limit of this model|contact is smaller|compressed to|pressure is not resolved"
)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["tsis-2011", "tsis-domed"])
@pytest.mark.parametrize("young_kpa", [1.0, 2.0, 5.0, 10.0, 20.0, 50.0])
def test_a_press_converges_or_names_what_ends_it(name: str, young_kpa: float) -> None:
    series, tissue = PressSeries(tsis.load_probe(name)), tsis.Phantom(young_kpa=young_kpa, thickness_mm=30.0)
    stalled = []
    for force in (0.1, 0.2, 0.5, 1.0, 2.0):
        try:
            series.press(tissue, force_n=force)
        except MechanicsError as error:
            stalled += [] if CAUSES.search(str(error)) else [f"{force:g} N: {error}"]
    assert not stalled
