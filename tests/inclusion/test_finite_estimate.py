"""Estimates at finite strain from presses that were solved at finite strain, on meshes of their own."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np
import pytest

import tsis
from tsis.errors import InputError
from tsis.inclusion import InclusionPrior, estimate
from tsis.inclusion.frames import require_valid_forces
from tsis.mechanics.surrogate.correction_building import build_finite_correction
from tsis.mechanics.surrogate.full_contact import build_full_contact_surrogate
from tsis.model.calibration import LightMap
from tsis.model.phantom import Phantom
from tsis.model.press import PressField
from tsis.virtual.probe import VirtualProbe

if TYPE_CHECKING:
    from typing import Any

    from tsis.model.image import TactileImage

pytestmark = pytest.mark.usefixtures("domed")

DOMED = tsis.load_probe("tsis-domed")
TRUTH = {"diameter_mm": 10.0, "depth_mm": 6.0, "young_kpa": 60.0}
TISSUE = Phantom(young_kpa=5.2, thickness_mm=31.0, poisson=0.49)
LUMP = tsis.Inclusion(diameter_mm=10.0, depth_mm=6.0, young_kpa=60.0)
TARGET = replace(TISSUE, inclusion=LUMP)
FORCES = (0.5, 1.0)
STORED = Path(__file__).parent / "data" / "finite_presses.npz"
Frames = tuple[list["TactileImage"], list["TactileImage"]]


def fields() -> list[PressField]:
    """`press_finite` of the four presses below, in their order; the slow test solves them again."""
    with np.load(STORED) as stored:
        rows = {name: np.asarray(stored[name], dtype=float) for name in stored.files}
    return [
        PressField(
            radius_mm=np.linspace(0.0, DOMED.radius_mm, len(pressure)),
            face_displacement_mm=displacement,
            pressure_kpa=pressure,
            approach_mm=float(approach),
            force_n=float(force),
        )
        for pressure, displacement, approach, force in zip(
            rows["pressure_kpa"], rows["face_displacement_mm"], rows["approach_mm"], rows["force_n"], strict=True
        )
    ]


def virtual_probe() -> VirtualProbe:
    return VirtualProbe(DOMED, rng=np.random.default_rng(11), light=LightMap.uniform(), strain="finite")


def pressed(virtual: VirtualProbe) -> Frames:
    targets, references = ([virtual.press(slab, force_n=force) for force in FORCES] for slab in (TARGET, TISSUE))
    return targets, references


@pytest.fixture
def frames(monkeypatch: pytest.MonkeyPatch) -> Frames:
    left = fields()

    def press(_slab: Phantom, *, force_n: float) -> PressField:
        field = left.pop(0)
        assert field.force_n == pytest.approx(force_n, rel=1e-9)
        return field

    monkeypatch.setattr("tsis.virtual.probe._series", lambda *_: SimpleNamespace(press=press))
    result = pressed(virtual_probe())
    assert not left
    return result


def test_truth_lies_inside_at_finite_strain_and_not_at_small(frames: Frames) -> None:
    targets, references = frames
    given: dict[str, Any] = {"probe": DOMED, "calibration": virtual_probe().calibration, "reference": references}
    result = estimate(targets, **given)
    assert result.trusted, result.flags
    for name, (low, high) in result.interval(0.9).items():
        assert low <= TRUTH[name] <= high, name
    assert result.provenance["strain"] == "finite"
    assert result.provenance["finite_strain_table"] == build_finite_correction(DOMED).key
    linear = estimate(targets, strain="small", **given)
    assert not linear.trusted
    low, high = linear.untrusted.interval(0.9)["depth_mm"]
    assert not low <= TRUTH["depth_mm"] <= high
    assert linear.provenance["finite_strain_table"] is None


def test_forces_beyond_the_table_are_refused(frames: Frames) -> None:
    targets, references = frames
    given: dict[str, Any] = {"probe": DOMED, "calibration": virtual_probe().calibration, "reference": references}
    strong = [tsis.TactileImage(grey=f.grey, mm_per_pixel=f.mm_per_pixel, force_n=1.6) for f in targets]
    with pytest.raises(InputError, match="the end of the probe's table of finite strain, on tissue of 5 kPa"):
        estimate(strong, **given)
    with pytest.raises(InputError, match=r"no strain is called .large."):
        estimate(targets, strain="large", **given)


def test_a_force_is_refused_before_a_table_is_built(monkeypatch: pytest.MonkeyPatch) -> None:
    """A table of another prior takes minutes, which nobody waits for to hear that the force was wrong."""

    def build(*_: Any, **__: Any) -> None:
        raise AssertionError("the table was built")

    monkeypatch.setattr("tsis.inclusion.reading.build_finite_correction", build)
    virtual, other = virtual_probe(), replace(InclusionPrior(), offset_sd_mm=0.7)
    for force, progress in ((0.1, None), (5.0, lambda _done, _total: None)):
        frame = replace(virtual.no_contact(), force_n=force, settings={})
        with pytest.raises(InputError, match="or state the modulus of this tissue in the prior"):
            estimate(frame, probe=DOMED, calibration=virtual.calibration, prior=other, progress=progress)


def test_the_range_of_forces_is_that_of_the_table() -> None:
    correction, prior = build_finite_correction(DOMED), InclusionPrior()
    _, most = correction.forces_n(prior.tissue_young_kpa, prior.thickness_mm)
    surrogate = build_full_contact_surrogate(DOMED, prior.box())
    frame = virtual_probe().no_contact()
    require_valid_forces([replace(frame, force_n=0.999 * most)], surrogate, probe=DOMED, prior=prior, strain="finite")
    with pytest.raises(InputError, match="the end of the probe's table"):
        require_valid_forces(
            [replace(frame, force_n=1.001 * most)], surrogate, probe=DOMED, prior=prior, strain="finite"
        )


def test_largest_force_follows_the_tissue() -> None:
    correction, prior = build_finite_correction(DOMED), InclusionPrior()
    soft, nominal = (correction.forces_n(young, prior.thickness_mm)[1] for young in (4.0, 5.0))
    assert nominal > 1.2
    assert soft == pytest.approx(0.8 * nominal, rel=0.05)


@pytest.mark.slow
def test_the_stored_presses_are_solved(monkeypatch: pytest.MonkeyPatch) -> None:
    left = fields()
    from tsis.virtual.probe import _series

    def compared(slab: Phantom, *, force_n: float) -> PressField:
        field, stored = series.press(slab, force_n=force_n), left.pop(0)
        np.testing.assert_allclose(field.pressure_kpa, stored.pressure_kpa, atol=1e-4 * stored.pressure_kpa.mean())
        np.testing.assert_allclose(field.face_displacement_mm, stored.face_displacement_mm, atol=1e-5)
        return field

    virtual = virtual_probe()
    series = _series(DOMED.unlit(), virtual._resolution)
    monkeypatch.setattr("tsis.virtual.probe._series", lambda *_: SimpleNamespace(press=compared))
    pressed(virtual)
    assert not left


def test_frames_that_state_small_strain_are_estimated_at_small_strain() -> None:
    virtual = VirtualProbe(tsis.load_probe("tsis-2011"), rng=np.random.default_rng(5), strain="small")
    frame = virtual.press(tsis.load_phantom("size-8"), force_n=1.0)
    unstated = replace(frame, settings={})
    cases: tuple[tuple[TactileImage, str | None], ...] = ((frame, None), (unstated, None), (frame, "finite"))
    found = [
        estimate(image, probe=virtual.probe, calibration=virtual.calibration, strain=strain).provenance["strain"]
        for image, strain in cases
    ]
    assert found == ["small", "finite", "finite"]
