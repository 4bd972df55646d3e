"""Constraints that bind the best design: ends of the ranges of forces and moduli, and broken limits."""

from __future__ import annotations

import numpy as np
import pytest

import tsis
from tsis.inclusion import InclusionPrior
from tsis.inclusion.design.alternatives import Design
from tsis.inclusion.design.information import ProtocolInformation
from tsis.inclusion.design.limits import DesignLimits
from tsis.inclusion.design.protocol import protocol_of
from tsis.inclusion.design.search import _binding, _Forces

FORCES = _Forces(low_n=0.1, high_n=10.0, low_by="contact", high_by="saturation")
SILENT = ProtocolInformation(
    inclusions=np.array([[8.0, 8.0, 80.0]]), matrix=np.zeros((1, 3, 3)), prior=InclusionPrior()
)


def design(*forces_n: float, strain: float = 0.1) -> Design:
    limits = DesignLimits(
        strain=strain,
        least_force_n=min(forces_n),
        covering_force_n=0.0,
        whole_fraction=1.0,
        brightest_grey=100.0,
        full_scale=255.0,
        read_mm=20.0,
        view_mm=24.0,
    )
    return Design(protocol=protocol_of(tsis.load_probe("tsis-2011"), forces_n), information=SILENT, limits=limits)


@pytest.mark.parametrize(
    ("forces_n", "octaves", "names"),
    [
        ((1.0,), (0.0, 0.0), ()),
        ((0.9, 1.2), (1.9, -1.9), ()),
        ((1.0, 9.9), (0.0, 0.0), ("saturation",)),
        ((0.101, 1.0), (0.0, 0.0), ("contact",)),
        ((0.12, 8.0), (0.0, 0.0), ()),
        ((0.1, 10.0), (-1.99, 1.99), ("saturation", "contact", "softest", "gradient")),
        ((1.0,), (1.99, -1.99), ("stiffest", "gradient")),
    ],
)
def test_a_variable_within_a_fiftieth_of_its_range_binds(
    forces_n: tuple[float, ...], octaves: tuple[float, float], names: tuple[str, ...]
) -> None:
    """Forces are compared by their logarithms: a fiftieth of two decades is a tenth of a force."""
    assert _binding(design(*forces_n), np.array(octaves), FORCES) == names


def test_limits_that_are_broken_come_last() -> None:
    assert _binding(design(9.9, strain=0.4), np.array([-2.0, 0.0]), FORCES) == ("saturation", "softest", "strain")


def test_fractions_of_the_range_are_fractions_of_its_logarithm() -> None:
    assert FORCES.at(np.array([1.0, 0.5, -0.2])) == pytest.approx((0.1, 1.0, 10.0))
