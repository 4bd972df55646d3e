"""The default protocol, a dome under two forces with references: truth inside, and never a confident wrong number."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import pytest

import tsis
from tsis.errors import InputError
from tsis.inclusion import InclusionPrior
from tsis.inclusion.flags import NEARLY_COVERED, UNTRUSTED_FLAGS
from tsis.inclusion.frames import covering_force_n, require_valid_forces, ring_edges
from tsis.inclusion.posterior.exploration import explore_inclusion
from tsis.inclusion.posterior.rings import ring_means
from tsis.inclusion.reading import covered_presses, press_tables, read_frames
from tsis.mechanics import press
from tsis.mechanics.surrogate.full_contact import build_full_contact_surrogate
from tsis.mechanics.surrogate.polynomial import Degrees
from tsis.model.calibration import LightMap
from tsis.virtual.probe import VirtualProbe

if TYPE_CHECKING:
    from tsis.model.estimate import Estimate
    from tsis.model.image import TactileImage
    from tsis.model.phantom import Phantom

pytestmark = pytest.mark.usefixtures("flat", "domed")

DOMED, FLAT = tsis.load_probe("tsis-domed"), tsis.load_probe("tsis-2011")
PLAIN = tsis.load_phantom("plain")
LUMP = replace(PLAIN, inclusion=tsis.Inclusion(diameter_mm=14.0, depth_mm=4.5, young_kpa=45.0), name="large and soft")
PRIOR = InclusionPrior()
estimate = partial(tsis.inclusion.estimate, strain="small")  # as the virtual presses
FORCES = (0.5, 1.0)
FEW = Degrees(diameter=2, depth=2, contrast=2, tissue=2, thickness=2, baseline=2)
Frames = tuple[list["TactileImage"], list["TactileImage"]]


def bench(seed: int = 3, probe: tsis.Probe = DOMED) -> VirtualProbe:
    return VirtualProbe(probe, rng=np.random.default_rng(seed), light=LightMap.uniform(), strain="small")


def pressed(phantom: Phantom, *, seed: int = 3, probe: tsis.Probe = DOMED, site: Phantom = PLAIN) -> Frames:
    virtual = bench(seed, probe)
    return [virtual.press(phantom, force_n=f) for f in FORCES], [virtual.press(site, force_n=f) for f in FORCES]


def found_in(frames: Frames, probe: tsis.Probe = DOMED) -> Estimate:
    targets, references = frames
    return estimate(targets, probe=probe, calibration=bench(probe=probe).calibration, reference=references)


@pytest.fixture(scope="module")
def lump() -> Frames:
    return pressed(LUMP)


@pytest.fixture(scope="module")
def told(lump: Frames) -> Estimate:
    return found_in(lump)


@pytest.mark.parametrize("sphere", [(14.7, 4.2, 97.0), (8.0, 4.2, 90.0)])
def test_a_rim_that_hardly_fails_to_touch_leaves_the_rings_alone(sphere: tuple[float, float, float]) -> None:
    """Beside presses whose contact is searched for: those that cover the face are linear in the force."""
    diameter, depth, young = sphere
    lump = tsis.Inclusion(diameter_mm=diameter, depth_mm=depth, young_kpa=young)
    covers = covering_force_n(covered_presses(DOMED, PRIOR), PRIOR, np.array(sphere))
    least, more, most = (
        press(DOMED, replace(PLAIN, inclusion=lump), force_n=factor * covers) for factor in (NEARLY_COVERED, 1.15, 1.3)
    )
    means = ring_means(least.radius_mm, ring_edges(DOMED))
    covered = means @ (more.pressure_kpa - (most.pressure_kpa - more.pressure_kpa) * (1.15 - NEARLY_COVERED) / 0.15)
    assert least.pressure_kpa[-1] < more.pressure_kpa[-1] / 10  # the rim does not touch
    assert np.abs(means @ least.pressure_kpa - covered).max() < 0.0031 * covered.mean()


def test_two_forces_on_a_dome_tell_the_modulus(told: Estimate) -> None:
    assert LUMP.inclusion is not None
    assert set(told.mean) == set(told.names)
    for name in told.mean:
        assert abs(told.mean[name] - getattr(LUMP.inclusion, name)) < 3 * told.sd[name]
    assert told.narrowing["young_kpa"] < 0.7
    assert "young_kpa_not_identified" not in told.flags


@pytest.mark.slow
def test_two_forces_on_a_flat_face_tell_less_of_the_modulus(told: Estimate) -> None:
    flat = found_in(pressed(LUMP, probe=FLAT), FLAT)
    assert flat.untrusted.sd["young_kpa"] > 1.3 * told.sd["young_kpa"]


def test_what_is_told_is_said_in_one_sentence(told: Estimate) -> None:
    assert told.trusted
    assert told.identifiability.startswith("Diameter ")
    assert told.identifiability.endswith("kPa.")
    assert "uniform" in told.prior
    assert told.presence is not None
    assert told.presence > 0.999
    # The prior ends, which an unbiased estimate does not know of; what is well told it cannot tell better.
    assert told.cramer_rao_sd["depth_mm"] == pytest.approx(told.sd["depth_mm"], rel=0.5)
    alone = estimate(pressed(LUMP, probe=FLAT)[0][1], probe=FLAT, calibration=bench(probe=FLAT).calibration)
    assert "modulus is not identifiable" in alone.identifiability


@pytest.mark.slow
@pytest.mark.parametrize("heterogeneity_sd", [0.0, 0.3])
def test_the_bayes_factor_is_the_integral_of_the_likelihood(heterogeneity_sd: float) -> None:
    """Of a faint inclusion, over the prior, by plain Monte Carlo."""
    faint = replace(PLAIN, inclusion=tsis.Inclusion(diameter_mm=1.5, depth_mm=6.0, young_kpa=80.0))
    targets, references = pressed(faint, seed=5)
    narrow = InclusionPrior(diameter_mm=(1.0, 3.0), heterogeneity_sd=heterogeneity_sd)
    tables = press_tables(DOMED, narrow, "small")
    likelihood = read_frames(
        targets, references, tables, probe=DOMED, calibration=bench().calibration, prior=narrow
    ).likelihood
    found = explore_inclusion(likelihood, narrow)
    nuisance = likelihood.within(found.fit.nuisance[0])
    draws = np.random.default_rng(1).uniform(narrow.low, narrow.high, (6000, 3))
    log_evidence = np.concatenate([likelihood(part, nuisance).log_evidence for part in np.array_split(draws, 20)])
    plain = likelihood(None, likelihood.within(likelihood(None, likelihood.start).nuisance[0])).log_evidence[0]
    expected = np.log(np.mean(np.exp(log_evidence - plain)))
    assert found.log_bayes_factor == pytest.approx(expected, abs=0.3)


def test_plain_tissue_shows_no_inclusion() -> None:
    for seed in (3, 4):
        blank = found_in(pressed(PLAIN, seed=seed))
        assert blank.presence is not None
        assert blank.presence < 0.5
        assert {"no_inclusion", "inclusion_uncertain"} & set(blank.flags)


def test_presses_of_two_inclusions_contradict_each_other(lump: Frames) -> None:
    other = pressed(tsis.load_phantom("depth-12"))
    mixed = found_in(([lump[0][0], other[0][1]], [lump[1][0], other[1][1]]))
    assert not mixed.trusted
    assert {"presses_disagree", "model_does_not_fit"} & set(mixed.flags)


def test_tissue_much_stiffer_than_believed_is_noticed() -> None:
    stiff = replace(LUMP, young_kpa=8.0)
    result = found_in(pressed(stiff, site=replace(PLAIN, young_kpa=8.0)))
    assert UNTRUSTED_FLAGS & set(result.flags)
    assert not result.trusted


@pytest.mark.parametrize(("force_n", "phrase"), [(0.2, "force_n must be from 0.4 N"), (9.0, "up to 2.2 N")])
def test_forces_that_the_model_does_not_hold_for_are_refused(lump: Frames, force_n: float, phrase: str) -> None:
    targets, references = lump
    with pytest.raises(InputError, match=phrase) as refused:
        found_in(([targets[0], replace(targets[1], force_n=force_n)], references))
    assert "\n" not in str(refused.value)


def test_a_frame_without_contact_is_refused(lump: Frames) -> None:
    untouched = replace(bench().no_contact(), force_n=1.0)
    with pytest.raises(InputError, match="images must show a press"):
        found_in(([lump[0][0], untouched], lump[1]))


def test_an_inclusion_beside_the_axis_is_corrected_and_far_from_it_not_believed(lump: Frames) -> None:
    """The pictures of the change are moved, which the flat model takes for a move of the inclusion."""
    targets, references = pressed(LUMP, probe=FLAT)

    def moved(millimetres: float) -> Estimate:
        columns = round(millimetres / targets[0].scale()[0])
        shifted = [
            replace(target, grey=np.clip(reference.grey + np.roll(target.grey - reference.grey, columns, 1), 0, 254))
            for target, reference in zip(targets, references, strict=True)
        ]
        return estimate(shifted, probe=FLAT, calibration=bench(probe=FLAT).calibration, reference=references)

    assert LUMP.inclusion is not None
    near, far = moved(1.0), moved(4.0)
    assert abs(near.mean["depth_mm"] - LUMP.inclusion.depth_mm) < 4 * near.sd["depth_mm"]
    assert "off_axis" not in near.flags
    assert "off_axis" in far.flags
    assert not far.trusted


def test_strips_are_refused(lump: Frames) -> None:
    targets, references = (
        [replace(frame, grey=frame.grey[240:242], axis_px=None) for frame in frames] for frames in lump
    )
    with pytest.raises(InputError, match="check mm_per_pixel"):
        found_in((targets, references))


def test_a_dome_that_no_force_presses_as_a_whole_is_said_to_be_so() -> None:
    steep = replace(DOMED, face_curvature_mm=14.0, name="steep")
    few = build_full_contact_surrogate(steep, PRIOR.box(), degrees=FEW, cached=False)
    with pytest.raises(InputError, match=r"no force is valid for this probe .*: use a flatter dome or stiffer tissue"):
        require_valid_forces([replace(bench().no_contact(), force_n=1.0)], few, probe=steep, prior=PRIOR)


def test_light_that_answers_to_nothing_tells_nothing(lump: Frames) -> None:
    """Contact that saturates at once shows every press alike, whatever lies below: no error, and no trust."""
    flat_out = replace(bench().calibration, saturation_kpa=1e-3, gain_grey_per_kpa=1e5)
    told = estimate(lump[0], probe=DOMED, calibration=flat_out, reference=lump[1])
    assert not told.trusted
