"""Modes of a section of the grid against the exact modes of the slab."""

from __future__ import annotations

import numpy as np
import pytest

from tsis.optics import guided_modes
from tsis.optics.propagation import (
    Axis,
    Dent,
    SectionModes,
    axis,
    permittivity,
    propagate,
    section_modes,
    thin_guide,
    times,
)

K0 = 2 * np.pi / 0.55


def flat_section(name: str, step: float) -> tuple[Axis, SectionModes]:
    across = axis(-2.0, 12.0, step_um=step, absorber_um=2.0)
    squared = K0**2 * permittivity(thin_guide(name), Dent(), across.nodes_um, np.array([0.0, 1.0]))
    return across, section_modes(across, squared[0], faded_um=2.0)


@pytest.mark.parametrize(("name", "bound"), [("dissertation", 1e-4), ("realistic", 1e-3)])
def test_indices_converge_to_those_of_the_slab(name: str, bound: float) -> None:
    """At second order, though no interface but the outer ones need lie on a node."""
    guide = thin_guide(name)
    exact = guided_modes(guide.index, guide.thickness_um, wavelength_um=0.55).n_eff
    errors = []
    for step in (0.09, 0.045):
        _, found = flat_section(name, step)
        assert found.guided == len(exact)
        errors.append(np.abs(found.effective_index(0.55) - exact)[:12].max())
    assert errors[1] < bound
    assert errors[0] / errors[1] > 3.0


def test_profiles_are_those_of_the_slab() -> None:
    guide = thin_guide("dissertation")
    across, found = flat_section("dissertation", 0.05)
    exact = guided_modes(guide.index, guide.thickness_um, wavelength_um=0.55)
    inner = across.inner
    for mode in (0, 4, 11):
        shape = exact.profile(mode, across.nodes_um[inner])
        likeness = (
            found.profile[inner, mode] @ shape / np.linalg.norm(found.profile[inner, mode]) / np.linalg.norm(shape)
        )
        assert abs(likeness) > 0.9999


def test_guided_modes_are_orthonormal_and_all_modes_make_up_any_field() -> None:
    across, found = flat_section("dissertation", 0.1)
    guided = found.profile[:, : found.guided]
    np.testing.assert_allclose(guided.T @ times(found.mass, guided), np.eye(found.guided), atol=1e-9)
    field = np.exp(-((across.nodes_um - 4.0) ** 2) + 3j * across.nodes_um)[:, np.newaxis]
    np.testing.assert_allclose(found.profile @ found.amplitudes(field), field, atol=1e-6)


def test_all_but_guided_modes_fade() -> None:
    _, found = flat_section("dissertation", 0.1)
    onward = np.abs(found.onward(0.1))
    assert onward[: found.guided].min() > 1 - 1e-6
    assert onward[found.guided :].max() < 1 - 1e-5


def test_modes_near_cut_off_are_named() -> None:
    """They reach the absorber, 3.6 wavelengths from the guide, with more than exp(-8)."""
    result = propagate(thin_guide("dissertation"), modes=21)
    exact = guided_modes(result.guide.index, result.guide.thickness_um, wavelength_um=0.55).n_eff
    reach = np.exp(-K0 * np.sqrt(exact**2 - 1) * 3.6 * 0.55)
    np.testing.assert_array_equal(result.clear, reach < np.exp(-8))
    assert np.count_nonzero(result.clear) == 16
