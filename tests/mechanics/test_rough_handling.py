"""Values that the classes accept and that a model cannot take: one sentence each, and small bodies that it can."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import tsis
from tsis.errors import InputError, MechanicsError
from tsis.mechanics import press
from tsis.mechanics.finite_strain.soft_sphere import squeeze_sphere
from tsis.mechanics.small_strain.relaxation import relaxing_press, settling_time_s
from tsis.mechanics.small_strain.rigid_ball import indent
from tsis.mechanics.surrogate.building import build_surrogate
from tsis.mechanics.surrogate.polynomial import Degrees
from tsis.model.phantom import Phantom, Relaxation
from tsis.model.probe import Layer, Probe

if TYPE_CHECKING:
    from collections.abc import Callable

FLAT, DOMED = tsis.load_probe("tsis-2011"), tsis.load_probe("tsis-domed")
SOFT = Phantom(young_kpa=5.0, thickness_mm=30.0)
FADING = Relaxation(shares=(0.3,), times_s=(2.0,))
HARD = Probe(radius_mm=100.0, layers=(Layer(thickness_mm=0.01, young_kpa=1e6, poisson=0.0),))
THIN = Probe(radius_mm=12.0, layers=(Layer(thickness_mm=0.5, young_kpa=20.0, poisson=0.3),))


@pytest.mark.parametrize(
    "radius", [1.0, pytest.param(1.6, marks=pytest.mark.slow), pytest.param(2.0, marks=pytest.mark.slow)]
)
def test_small_faces_have_a_finite_strain_too(radius: float) -> None:
    small = Probe(radius_mm=radius, layers=(Layer(thickness_mm=2.0, young_kpa=50.0),))
    force = 0.002 * radius**2
    finite, linear = (press(small, SOFT, force_n=force, strain=strain) for strain in ("finite", "small"))
    assert finite.approach_mm == pytest.approx(linear.approach_mm, rel=0.2)


def test_no_force_moves_nothing_at_either_strain() -> None:
    for strain in ("small", "finite"):
        field = press(FLAT, SOFT, force_n=0.0, strain=strain)
        assert field.approach_mm == 0.0
        assert not field.pressure_kpa.any()


@pytest.mark.parametrize(
    ("call", "phrase"),
    [
        (
            lambda: press(FLAT, SOFT, force_n=1e-6, strain="finite"),
            "force_n must be at least .*: use strain=.small",
        ),
        (lambda: press(DOMED, SOFT, force_n=1e-9), "force_n must be large enough for the mesh to resolve the contact"),
        (lambda: indent(HARD, sphere_radius_mm=1000.0, force_n=0.1), "choose a larger force"),
        (lambda: indent(THIN, sphere_radius_mm=20.0, force_n=20.0), "would sink .* into 0.5 mm of probe"),
        (lambda: squeeze_sphere(FLAT, sphere_radius_mm=3.0, young_kpa=20.0, force_n=1e-6), "force_n must be at least"),
        (lambda: relaxing_press(FLAT, SOFT, FADING, approach_mm=100.0, time_s=[1.0]), "choose a smaller approach_mm"),
        (lambda: build_surrogate(FLAT, force_n=50.0, cached=False), "choose a smaller force_n"),
    ],
)
def test_what_no_model_describes(call: Callable[[], Any], phrase: str) -> None:
    with pytest.raises(MechanicsError, match=phrase):
        call()


@pytest.mark.slow
@pytest.mark.parametrize("curvature", [None, 1.0])
def test_far_beyond_the_model_a_force_that_is_not_is_found_too(curvature: float | None) -> None:
    tiny = Probe(radius_mm=1.0, layers=(Layer(thickness_mm=200.0, young_kpa=0.1),), face_curvature_mm=curvature)
    mush = Phantom(young_kpa=0.05, thickness_mm=500.0)
    with pytest.raises(MechanicsError, match=r"choose a force of at most \S+ N") as refused:
        press(tiny, mush, force_n=50.0)
    press(tiny, mush, force_n=float(str(refused.value).split("at most ")[1].split(" N")[0]))


@pytest.mark.parametrize(
    ("call", "phrase"),
    [
        (lambda: build_surrogate(None), "probe must be a Probe; got None"),  # type: ignore[arg-type]
        (lambda: Degrees(diameter=0), r"diameter must lie in \[1, 100\]; got 0"),
        (
            lambda: settling_time_s(FLAT, SOFT, None, approach_mm=1.0),  # type: ignore[arg-type]
            "relaxation must be a Relaxation",
        ),
        (lambda: settling_time_s(FLAT, SOFT, FADING, approach_mm=1.0, ramp_s=1e-320), "ramp_s must lie in"),
    ],
)
def test_what_is_no_input(call: Callable[[], Any], phrase: str) -> None:
    with pytest.raises(InputError, match=phrase):
        call()


@pytest.mark.parametrize(
    ("tissue", "ramp_s", "tolerance"),
    [
        (Relaxation(shares=(0.3,), times_s=(2e5,)), 0.0, 0.01),
        (Relaxation(shares=(0.3,), times_s=(9e4,)), 1e6, 0.01),
        (Relaxation(shares=(0.99,), times_s=(1.0,)), 0.0, 1e-6),
        (Relaxation(shares=(0.2, 0.3), times_s=(1e-4, 1e6)), 0.0, 0.01),
    ],
)
def test_slow_tissue_settles_too(tissue: Relaxation, ramp_s: float, tolerance: float) -> None:
    """At the time found the force is off its last value by the tolerance; the last value is an elastic press's."""
    found = settling_time_s(FLAT, SOFT, tissue, approach_mm=2.0, tolerance=tolerance, ramp_s=ramp_s)
    settled = 2.0 / press(FLAT, SOFT, force_n=0.1).approach_mm * 0.1
    at = relaxing_press(FLAT, SOFT, tissue, approach_mm=2.0, time_s=[min(found, 1e7)], ramp_s=ramp_s).force_n[0]
    assert found > ramp_s
    assert at / settled == pytest.approx(1 + tolerance, rel=1e-6)


def test_numbers_of_any_kind_make_a_surrogate() -> None:
    one = Degrees(diameter=1, depth=1, contrast=1, tissue=1, thickness=1, baseline=1)
    probe = Probe(radius_mm=np.int64(12), layers=FLAT.layers)  # type: ignore[arg-type]
    force: Any = np.float32(1.0)
    assert build_surrogate(probe, degrees=one, force_n=force, cached=False).force_n == 1.0
