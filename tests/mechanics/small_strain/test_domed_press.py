"""Contact that ends on the face or opens inside: against Hertz, layers, energy, the other algorithm, another code.

How that code's values were made is in benchmarks/domed_second_code.py. Its own two meshes differ by 0.15 % of the
largest value in the plain displacement (at the rim), 0.02 % in what inclusions change about it, 0.02 % in pressures,
and by 0.3 and 0.9 % in pressures where the contact ends on the face.
"""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from benchmarks.domed_second_code import FORCES_N, SMALL_STRAIN, SPHERES, deviations, kernel
from hypothesis import given
from hypothesis import strategies as st
from tests.mechanics.closed_forms import bonded_layer_ratio, hertz, punch_stiffness

import tsis
from tsis.mechanics import press
from tsis.mechanics.mesh import block_radius_mm
from tsis.mechanics.small_strain import unilateral as disc_contact
from tsis.mechanics.small_strain.linear_press import PressKernel, half_space_compliance
from tsis.mechanics.small_strain.slab import Resolution, Slab, face_of
from tsis.model.phantom import Inclusion, Phantom
from tsis.model.probe import Layer, Probe

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from tsis.mechanics.small_strain.unilateral import PartialContact


DOMED = tsis.load_probe("tsis-domed")
PLAIN = Phantom(young_kpa=5.0, thickness_mm=30.0)
SPHERE = Inclusion(diameter_mm=10.0, depth_mm=5.0, young_kpa=100.0)
LUMP = replace(PLAIN, inclusion=SPHERE)
RIGID = (Layer(thickness_mm=4.0, young_kpa=1e6),)
MESHES = (
    Resolution(),
    Resolution(order=6, edge=0.006, growth=1.9, largest=0.17, below_cells=4, ray_layers=6),
    Resolution(order=5, edge=0.004, growth=1.8, largest=0.12, below_cells=4, ray_layers=7),
)


@pytest.mark.parametrize("poisson", [0.3, 0.49])
@pytest.mark.parametrize("force_mn", [0.5, 2.0, 8.0])
def test_a_rigid_dome_on_a_thick_slab_is_hertz(poisson: float, force_mn: float) -> None:
    ball = Probe(radius_mm=3.0, layers=RIGID, face_curvature_mm=10.0)
    field = press(ball, Phantom(young_kpa=5.0, thickness_mm=500.0, poisson=poisson), force_n=force_mn / 1000)
    modulus = 5.0 / (1 - poisson**2)
    depth = (9 * force_mn**2 / (16 * modulus**2 * 10.0)) ** (1 / 3)
    exact = hertz(radius_mm=10.0, indentation_mm=depth, young_kpa=5.0, poisson=poisson)
    assert field.approach_mm == pytest.approx(depth, rel=0.01)
    inner = field.radius_mm < 0.9 * exact.contact_radius_mm
    np.testing.assert_allclose(field.pressure_kpa[inner], exact.pressure_kpa(field.radius_mm[inner]), rtol=0.01)
    assert not field.pressure_kpa[field.radius_mm > 1.05 * exact.contact_radius_mm].any()


@pytest.mark.parametrize(("poisson", "force", "peak"), [(0.3, 8.1907, 0.7822), (0.49, 9.8086, 0.9367)])
def test_hertz_by_numbers(poisson: float, force: float, peak: float) -> None:
    ball = Probe(radius_mm=3.0, layers=RIGID, face_curvature_mm=10.0)
    field = press(ball, Phantom(young_kpa=5.0, thickness_mm=500.0, poisson=poisson), force_n=force / 1000)
    assert field.approach_mm == pytest.approx(0.5, rel=0.01)
    assert field.pressure_kpa[0] == pytest.approx(peak, rel=0.01)


@pytest.mark.parametrize("chi", [0.1, 0.2, 0.3])
def test_a_rigid_dome_on_a_bonded_layer(chi: float) -> None:
    """Dimitriadis and others (2002), bonded, incompressible: an approximate series in chi = sqrt(R delta) / H."""
    curvature, depth, thickness = 60.0, 0.05, np.sqrt(60.0 * 0.05) / chi
    series = 1 + 1.133 * chi + 1.283 * chi**2 + 0.769 * chi**3 + 0.0975 * chi**4
    force = 16 / 9 * 5.0 * np.sqrt(curvature) * depth**1.5 * series
    ball = Probe(radius_mm=4.0, layers=RIGID, face_curvature_mm=curvature)
    field = press(ball, Phantom(young_kpa=5.0, thickness_mm=thickness, poisson=0.495), force_n=force / 1000)
    assert field.approach_mm == pytest.approx(depth, rel=0.02)


def test_the_half_space_answers_as_copson_found() -> None:
    """Of p = sqrt(1 - s**2) the displacement is pi / 4 (2 - s**2), of 1 / sqrt(1 - s**2) it is pi, at a = 1."""
    answer = disc_contact.half_space_response()
    s, w = np.polynomial.legendre.leggauss(200)
    s, w = (s + 1) / 2, w / 2
    hertz, displaced = np.sqrt(1 - s**2), np.pi / 4 * (2 - s**2)
    assert answer[0, 0] == pytest.approx(2 * np.pi * (w * s * hertz * displaced).sum(), rel=1e-5)
    assert answer[-1, 0] == pytest.approx(2 * np.pi * np.pi / 3, rel=1e-9)
    np.testing.assert_allclose(answer[:-1], answer[:-1].T, atol=1e-12)


@pytest.mark.parametrize("radius_mm", [6.1, 14.0, 37.0])
@pytest.mark.parametrize("poisson", [0.31, 0.49])
def test_a_uniform_pressure_dents_the_half_space_as_boussinesq_found(radius_mm: float, poisson: float) -> None:
    """2 p a / E* on the axis, 4 / pi of that at the edge; faces of one shape share a table on the disk."""
    face = face_of(radius_mm, Resolution())
    dent = half_space_compliance(face, poisson, Resolution()) @ face.mass() @ np.ones(len(face.radius_mm))
    assert dent[0] == pytest.approx(2 * radius_mm, rel=1e-4)
    assert dent[-1] == pytest.approx(4 / np.pi * radius_mm, rel=2e-3)


@pytest.mark.parametrize(("poisson", "plain", "files"), [(0.317, True, 1), (0.3171828, True, 0), (0.317, False, 0)])
def test_only_half_spaces_that_are_met_again_are_cached(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, poisson: float, plain: bool, files: int
) -> None:
    monkeypatch.setenv("TSIS_CACHE_DIR", str(tmp_path))
    coarse = Resolution(order=2, edge=0.1)
    solved = [half_space_compliance(face_of(radius, coarse), poisson, coarse, plain=plain) for radius in (5.0, 8.0)]
    np.testing.assert_allclose(5.0 * solved[0], 8.0 * solved[1], rtol=1e-9)
    assert len([file for file in tmp_path.rglob("*") if file.is_file()]) == files


def kernel_of(probe: Probe, resolution: Resolution | None = None) -> PressKernel:
    return PressKernel(probe, thickness_mm=30.0, poisson=0.49, resolution=resolution)


def touch_of(kernel: PressKernel, force_mn: float) -> tuple[PartialContact, NDArray[np.float64]]:
    """Contact on plain tissue of 5 kPa, and the compliance of both bodies."""
    both = kernel.probe_compliance + kernel._slab.compliance / 5.0
    return kernel.contact.touch(both, force_mn, kernel.split(both, 5.0)), both


@pytest.mark.parametrize("force_mn", [30.0, 200.0, 800.0])
def test_opening_node_by_node_finds_the_same_contact(force_mn: float) -> None:
    kernel = kernel_of(DOMED, Resolution(largest=0.08))
    touch, both = touch_of(kernel, force_mn)
    other = kernel.contact._opening(both, force_mn)
    assert other.approach_mm == pytest.approx(touch.approach_mm, rel=3e-3)
    inner = kernel.radius_mm < 0.8 * touch.radius_mm
    np.testing.assert_allclose(other.pressure_kpa[inner], touch.pressure_kpa[inner], rtol=0.03)


@pytest.mark.parametrize("force_mn", [20.0, 100.0, 250.0, 600.0, 1000.0])
def test_the_work_of_the_force_is_the_strain_energy(force_mn: float) -> None:
    """dU = F d(approach) everywhere on the path, by differences of the fourth order."""
    kernel, shares = kernel_of_domed(), np.array([-2e-3, -1e-3, 1e-3, 2e-3])
    energy, approach = np.transpose([energy_and_approach(kernel, force_mn * (1 + share)) for share in shares])
    difference = np.array([1.0, -8.0, 8.0, -1.0])
    assert difference @ energy / (difference @ approach) == pytest.approx(force_mn, rel=1e-8)


def energy_and_approach(kernel: PressKernel, force_mn: float) -> tuple[float, float]:
    """Half the work of the contact's pressure on what it displaces, on the disc and, with the rim touching, beyond."""
    touch, both = touch_of(kernel, force_mn)
    split = kernel.split(both, 5.0)
    whole = disc_contact.on_disc(split, kernel.contact._whole_disc, 12.0)
    carried = float(whole.force.sum())
    if force_mn <= carried:
        disc = disc_contact.under_force(split, kernel.face, DOMED.sag_mm, force_mn, largest=whole)
        return work(split, disc), touch.approach_mm
    closed = kernel.contact._closed(both, force_mn - carried)
    return work(split, whole) + (0.5 * (force_mn - carried) + carried) * closed.approach_mm, touch.approach_mm


def work(split: disc_contact.Elastic, disc: disc_contact.DiscContact) -> float:
    exact = split.half_space * disc.radius_mm**3 * disc_contact.half_space_response()[:-1]
    return float(0.5 * (disc.force @ split.smooth @ disc.force + disc.terms @ exact @ disc.terms))


def test_the_contact_grows_to_the_rim() -> None:
    kernel = kernel_of_domed()
    radii = [touch_of(kernel, force)[0].radius_mm for force in (20.0, 100.0, 250.0, 600.0)]
    assert 0 < radii[0] < radii[1] < radii[2] < radii[3] == 12.0


@given(force=st.floats(0.002, 1.5))
def test_the_answer_moves_smoothly_with_the_force(force: float) -> None:
    """No jump where the contact's edge passes a node: three forces close together lie on a line."""
    kernel = kernel_of_domed()
    near = [kernel.press(5.0, 1000 * force * (1 + share)) for share in (-1e-4, 0.0, 1e-4)]
    for name in ("pressure_kpa", "face_displacement_mm"):
        low, middle, high = (getattr(one, name)[:100] for one in near)
        bend = np.abs(low - 2 * middle + high).max()
        assert bend < 0.02 * np.abs(high - low).max() + 1e-12


@cache
def kernel_of_domed() -> PressKernel:
    return kernel_of(DOMED)


@pytest.mark.parametrize("force", [0.1, 0.5, 1.0])
def test_a_finer_mesh_changes_nothing(force: float) -> None:
    fields = [
        [press(DOMED, phantom, force_n=force, resolution=mesh) for phantom in (PLAIN, LUMP)] for mesh in MESHES[:2]
    ]
    inner = fields[0][0].radius_mm < (10.0 if force > 0.4 else 5.0)  # 0.1 N touches as far as r = 7.6 mm
    for here, finer in zip(*fields, strict=True):
        assert here.approach_mm == pytest.approx(finer.approach_mm, rel=1e-4)
        np.testing.assert_allclose(
            here.pressure_kpa[inner], finer.pressure_kpa[inner], atol=2e-3 * finer.pressure_kpa[0]
        )
    signals = [bare.face_displacement_mm - lump.face_displacement_mm for bare, lump in fields]
    np.testing.assert_allclose(signals[0][inner], signals[1][inner], atol=2e-3 * np.abs(signals[1]).max())


@pytest.mark.slow
@pytest.mark.parametrize(("diameter", "depth", "young"), [(10.0, 5.0, 100.0), (13.0, 5.0, 40.0)])
@pytest.mark.parametrize("force", [0.5, 1.0])
def test_sensitivities_do_not_depend_on_the_mesh(diameter: float, depth: float, young: float, force: float) -> None:
    """What diameter, depth and modulus change about the pressure, on three meshes: a mesh must not make information."""
    names, values = ("diameter_mm", "depth_mm", "young_kpa"), np.array([diameter, depth, young])
    found = []
    for mesh in MESHES:
        slopes = []
        for index in range(3):
            ends = []
            for sign in (1.0, -1.0):
                point = values.copy()
                point[index] *= 1 + 0.01 * sign
                phantom = replace(PLAIN, inclusion=Inclusion(**dict(zip(names, point.tolist(), strict=True))))
                ends.append(press(DOMED, phantom, force_n=force, resolution=mesh).pressure_kpa[:193])  # r <= 9.6 mm
            slopes.append((ends[0] - ends[1]) / 0.02)
        found.append(np.array(slopes))
    for other in found[:2]:
        for here, finest in zip(other, found[2], strict=True):
            assert np.abs(here - finest).max() < 0.02 * np.abs(finest).max()


def test_a_flat_face_opens_over_a_shallow_hole() -> None:
    """Something very soft under the face cannot push: the contact opens there, and nowhere does it pull."""
    hole = replace(PLAIN, inclusion=Inclusion(diameter_mm=8.0, depth_mm=0.3, young_kpa=0.1))
    flat = Probe(radius_mm=12.0, layers=(Layer(thickness_mm=5.0, young_kpa=3000.0),))
    kernel = PressKernel(flat, thickness_mm=30.0, poisson=0.49, block_mm=9.6, central_mm=0.6)
    change = kernel.slab(diameter_mm=8.0, depth_mm=0.3, poisson=0.49).change(0.02)
    both = kernel.probe_compliance + (kernel._slab.compliance + change) / 5.0
    closed = kernel.contact._closed(both, 500.0)
    opened = kernel.contact.touch(both, 500.0)
    assert (closed.pressure_kpa[kernel.radius_mm < 11.0].min() < 0) == np.isnan(opened.radius_mm)
    field = press(flat, hole, force_n=0.5)
    assert field.pressure_kpa[field.radius_mm < 11.0].min() >= -1e-3
    total = 2 * np.pi * np.trapezoid(field.pressure_kpa * field.radius_mm, field.radius_mm)
    assert total == pytest.approx(500.0, rel=5e-3)


def test_a_nearly_flat_dome_presses_like_a_flat_face() -> None:
    almost = replace(DOMED, face_curvature_mm=1e6)
    flat = replace(DOMED, face_curvature_mm=None)
    here, there = (press(probe, LUMP, force_n=1.0) for probe in (almost, flat))
    assert here.approach_mm == pytest.approx(there.approach_mm, rel=1e-4)
    np.testing.assert_allclose(here.pressure_kpa[:220], there.pressure_kpa[:220], rtol=1e-3)


def test_housed_sides_make_a_stiffer_probe() -> None:
    free = tsis.load_probe("tsis-2011")
    loose, held = (press(probe, PLAIN, force_n=1.0) for probe in (free, replace(free, sides="bonded")))
    assert abs(held.face_displacement_mm[-1]) < 1e-12
    assert (held.face_displacement_mm[:160] < loose.face_displacement_mm[:160]).all()
    assert held.approach_mm < loose.approach_mm
    total = 2 * np.pi * np.trapezoid(held.pressure_kpa * held.radius_mm, held.radius_mm)
    assert total == pytest.approx(1000.0, rel=1e-2)


def test_a_spheroid_of_equal_axes_is_a_sphere() -> None:
    flat = tsis.load_probe("tsis-2011")
    same = replace(PLAIN, inclusion=replace(SPHERE, diameter_mm=1.0, semi_axes_mm=(5.0, 5.0, 5.0)))
    here, there = (press(flat, phantom, force_n=1.0) for phantom in (same, LUMP))
    np.testing.assert_allclose(here.face_displacement_mm, there.face_displacement_mm, rtol=1e-12)


def test_a_lens_of_one_volume_shows_more_than_a_cigar() -> None:
    """At one depth of the centre, what lies flat under the face hardens more of it."""
    flat = tsis.load_probe("tsis-2011")
    change = []
    for half_width, half_height in ((6.0, 3.0), (4.0, 6.75)):
        shape = Inclusion(
            diameter_mm=9.0,
            depth_mm=10.0 - half_height,
            young_kpa=100.0,
            semi_axes_mm=(half_width, half_width, half_height),
        )
        with_it = press(flat, replace(PLAIN, inclusion=shape), force_n=1.0)
        finer = press(flat, replace(PLAIN, inclusion=shape), force_n=1.0, resolution=MESHES[1])
        plain = press(flat, PLAIN, force_n=1.0)
        change.append(with_it.face_displacement_mm[0] - plain.face_displacement_mm[0])
        bare = press(flat, PLAIN, force_n=1.0, resolution=MESHES[1])
        assert finer.face_displacement_mm[0] - bare.face_displacement_mm[0] == pytest.approx(change[-1], rel=3e-3)
    assert change[0] != pytest.approx(change[1], rel=0.01)


@pytest.mark.parametrize(
    ("radius", "diameter", "depth"), [(12.0, 0.3, 5.0), (12.0, 14.0, 0.3), (12.0, 2.0, 0.3), (100.0, 10.0, 5.0)]
)
def test_the_mesh_follows_small_and_shallow_inclusions_and_large_faces(
    radius: float, diameter: float, depth: float
) -> None:
    probe = Probe(radius_mm=radius, layers=tsis.load_probe("tsis-2011").layers)
    phantom = replace(PLAIN, inclusion=Inclusion(diameter_mm=diameter, depth_mm=depth, young_kpa=100.0))
    signals = []
    for mesh in MESHES[:2]:
        with_it, plain = (press(probe, one, force_n=0.5, resolution=mesh) for one in (phantom, PLAIN))
        signals.append((with_it.face_displacement_mm - plain.face_displacement_mm)[with_it.radius_mm < 9.0])
    np.testing.assert_allclose(signals[0], signals[1], atol=0.01 * np.abs(signals[1]).max())


@pytest.mark.parametrize("poisson", [0.49, 0.495])
def test_nearly_incompressible_layers_do_not_lock(poisson: float) -> None:
    """A bonded layer twice as wide as thick, where locking is worst, against the exact stiffness."""
    resolution = Resolution()
    slab = Slab(thickness_mm=6.0, poisson=poisson, face=face_of(12.0, resolution), block_mm=9.6, resolution=resolution)
    punch = punch_stiffness(radius_mm=12.0, young_kpa=1.0, poisson=poisson)
    ratio = np.linalg.inv(slab.compliance).sum() / punch
    assert ratio == pytest.approx(bonded_layer_ratio(2.0, poisson=poisson), rel=1e-3)


def test_the_block_keeps_its_size_where_the_slab_is_thin() -> None:
    assert block_radius_mm(DOMED, 30.0) == 0.8 * 12.0
    assert block_radius_mm(DOMED, 5.0) == 5.0
    assert block_radius_mm(DOMED, 30.0, 20.0) == 13.0


STORED_CASES: list[dict[str, Any]] = json.loads(SMALL_STRAIN.read_text(encoding="utf-8"))["small_strain"]["cases"]


def test_every_case_is_stored() -> None:
    found = [(case["diameter_mm"], case["depth_mm"], case["young_kpa"], case["force_n"]) for case in STORED_CASES]
    assert found == [(*sphere, force) for sphere in SPHERES for force in FORCES_N]


@pytest.mark.parametrize("case", STORED_CASES)
def test_another_code_finds_the_same(case: dict[str, Any]) -> None:
    apart = deviations(kernel(case), case)
    assert max(apart["plain_approach_mm"], apart["approach_mm"]) < 5e-4
    assert max(apart["plain_w_mm"], apart["plain_p_kpa"], apart["dw_mm"]) < 5e-3
    assert apart["dp_kpa"] < (0.01 if case["force_n"] < 0.5 else 5e-3)
