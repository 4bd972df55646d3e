"""Estimates from virtual presses: truth inside, against brute force, flags, and every refusal."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import tsis
from tsis.errors import ImageMismatchError, InputError, NotCalibratedError
from tsis.imaging.sensor import Sensor
from tsis.inclusion import InclusionPrior, reading
from tsis.inclusion.estimation import check_calibration
from tsis.inclusion.frames import repeats_chance, ring_edges, ring_profiles
from tsis.inclusion.posterior.exploration import explore_inclusion
from tsis.inclusion.reading import press_tables, read_frames
from tsis.mechanics.surrogate.full_contact import build_full_contact_surrogate
from tsis.mechanics.surrogate.polynomial import Degrees
from tsis.model.calibration import LightMap
from tsis.model.probe import Layer, Probe
from tsis.virtual.probe import VirtualProbe, nominal_calibration

if TYPE_CHECKING:
    from collections.abc import Callable

    from tsis.mechanics.surrogate.full_contact import FullContactSurrogate
    from tsis.model.estimate import Estimate
    from tsis.model.image import TactileImage
    from tsis.model.phantom import Phantom


pytestmark = pytest.mark.usefixtures("flat", "domed")

PROBE = tsis.load_probe("tsis-2011")
PLAIN = tsis.load_phantom("plain")
ANSWER = nominal_calibration(Sensor())
EVEN = LightMap.uniform()
PRIOR = InclusionPrior()
EVEN_TISSUE = InclusionPrior(heterogeneity_sd=0.0)  # one hypothesis on the tissue: quick, where it is not the idea
estimate = partial(tsis.inclusion.estimate, strain="small")  # as the virtual presses
PARAMETERS = ("diameter_mm", "depth_mm", "young_kpa")


def presses(
    phantom: Phantom, *, seed: int = 2, force_n: float = 1.0, probe: Probe = PROBE
) -> tuple[TactileImage, TactileImage]:
    """A press on the phantom and one on plain tissue, of the same virtual probe."""
    virtual = VirtualProbe(probe, rng=np.random.default_rng(seed), light=EVEN, strain="small")
    return virtual.press(phantom, force_n=force_n), virtual.press(PLAIN, force_n=force_n)


@pytest.fixture(scope="module")
def lump() -> tuple[TactileImage, TactileImage]:
    return presses(tsis.load_phantom("hardness-100"))


@pytest.fixture(scope="module")
def found(lump: tuple[TactileImage, TactileImage], flat: FullContactSurrogate) -> Estimate:
    assert flat.key, "built once before anything is estimated"
    return estimate(lump[0], probe=PROBE, calibration=ANSWER, reference=lump[1])


@pytest.mark.parametrize(
    "name",
    [
        *(pytest.param(name, marks=pytest.mark.slow) for name in ("size-2", "size-14", "hardness-40")),
        *("size-8", "depth-4", "depth-8", "hardness-100"),
    ],
)
def test_phantoms_of_the_catalog_are_recovered(name: str) -> None:
    phantom = tsis.load_phantom(name)
    image, reference = presses(phantom)
    result = estimate(image, probe=PROBE, calibration=ANSWER, reference=reference)
    for parameter in PARAMETERS:
        truth = getattr(phantom.inclusion, parameter)
        posterior = result.untrusted  # one press does not identify the modulus
        assert abs(posterior.mean[parameter] - truth) < 3 * posterior.sd[parameter]
        assert PRIOR.low[PARAMETERS.index(parameter)] <= result.samples[parameter].min()
        assert PRIOR.high[PARAMETERS.index(parameter)] >= result.samples[parameter].max()
    assert result.narrowing["diameter_mm"] < 0.2
    assert "model_does_not_fit" not in result.flags


@pytest.mark.parametrize("name", ["size-8", pytest.param("hardness-40", marks=pytest.mark.slow)])
def test_so_they_are_under_the_uneven_light_of_lamps(name: str) -> None:
    """The camera sees what rays make of the dent; the estimate knows the light to first order in the slope."""
    phantom = tsis.load_phantom(name)
    virtual = VirtualProbe(PROBE, rng=np.random.default_rng(3), strain="small")
    image, reference = virtual.press(phantom, force_n=1.0), virtual.press(PLAIN, force_n=1.0)
    result = estimate(image, probe=PROBE, calibration=virtual.calibration, reference=reference)
    for parameter in ("diameter_mm", "depth_mm"):
        assert abs(result.mean[parameter] - getattr(phantom.inclusion, parameter)) < 3 * result.sd[parameter]
        assert result.narrowing[parameter] < 0.2
    assert "model_does_not_fit" not in result.flags
    assert virtual.calibration.light is not None
    assert result.provenance["calibration"]["light"] == virtual.calibration.light.sha256
    blind = estimate(image, probe=PROBE, calibration=replace(virtual.calibration, light=None), reference=reference)
    assert "model_does_not_fit" in blind.flags, "who does not know the light must not be believed"


def test_light_that_was_not_measured_on_dents_is_flagged_and_costs_width(
    lump: tuple[TactileImage, TactileImage], found: Estimate
) -> None:
    """The presses give the gain: a response that is wrong by a factor of three changes nothing."""
    unmeasured = replace(ANSWER, light=None)
    wide, thrice = (
        estimate(lump[0], probe=PROBE, calibration=known, reference=lump[1])
        for known in (unmeasured, replace(unmeasured, gain_grey_per_kpa=3 * ANSWER.gain_grey_per_kpa))
    )
    assert "light_not_measured" in wide.flags
    assert "light_not_measured" not in found.flags
    assert "model_does_not_fit" not in wide.flags
    assert wide.flags == thrice.flags
    for parameter, truth in (("diameter_mm", 10.0), ("depth_mm", 5.0)):
        assert wide.untrusted.sd[parameter] > found.untrusted.sd[parameter]
        assert abs(wide.untrusted.mean[parameter] - truth) < 3 * wide.untrusted.sd[parameter]
        assert wide.untrusted.mean[parameter] == pytest.approx(thrice.untrusted.mean[parameter], rel=0.02)


@pytest.mark.parametrize(
    "prior", [pytest.param(PRIOR, marks=pytest.mark.slow, id="uneven"), pytest.param(EVEN_TISSUE, id="even")]
)
@pytest.mark.parametrize(
    ("name", "with_reference"),
    [
        ("size-2", True),
        ("hardness-100", False),
        ("plain", True),
        *[
            pytest.param(*case, marks=pytest.mark.slow)
            for case in (
                ("size-2", False),
                ("hardness-100", True),
                ("depth-12", True),
                ("depth-12", False),
                ("plain", False),
            )
        ],
    ],
)
def test_the_grid_against_brute_force(name: str, prior: InclusionPrior, *, with_reference: bool) -> None:
    """The same likelihood on one dense grid of inclusions; also at the prior's edge and for next to no signal."""
    image, reference = presses(tsis.load_phantom(name))
    tables = press_tables(PROBE, prior, "small")
    likelihood = read_frames(
        [image], [reference] if with_reference else [], tables, probe=PROBE, calibration=ANSWER, prior=prior
    ).likelihood
    found = explore_inclusion(likelihood, prior)
    samples, nuisance = found.samples, likelihood.within(found.fit.nuisance[0])
    reach = np.array([samples.min(axis=0), samples.max(axis=0)])
    margin = 0.1 * (reach[1] - reach[0])
    low, high = np.maximum(reach[0] - margin, PRIOR.low), np.minimum(reach[1] + margin, PRIOR.high)
    axes = [a + (b - a) * (np.arange(n) + 0.5) / n for a, b, n in zip(low, high, (60, 60, 12), strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    parts = np.array_split(points, 20)
    log_weight = np.concatenate([likelihood(part, nuisance, about=found.middle).log_evidence for part in parts])
    weight = np.exp(log_weight - log_weight.max())
    weight /= weight.sum()
    mean = weight @ points
    sd = np.sqrt(weight @ (points - mean) ** 2)
    assert (np.abs(samples.mean(axis=0) - mean) < 0.1 * sd).all()
    np.testing.assert_allclose(samples.std(axis=0), sd, rtol=0.1)


@pytest.mark.slow
def test_the_order_of_images_does_not_matter(lump: tuple[TactileImage, TactileImage]) -> None:
    other = presses(tsis.load_phantom("hardness-100"), seed=9)
    first, second = (
        estimate(images, probe=PROBE, calibration=ANSWER, reference=references, prior=EVEN_TISSUE).untrusted
        for images, references in (
            ([lump[0], other[0]], [lump[1], other[1]]),
            ([other[0], lump[0]], [other[1], lump[1]]),
        )
    )
    for name in PARAMETERS:
        assert first.mean[name] == pytest.approx(second.mean[name], abs=0.01 * first.sd[name])
        assert first.sd[name] == pytest.approx(second.sd[name], rel=0.01)


def test_the_same_frames_give_the_same_samples(lump: tuple[TactileImage, TactileImage], found: Estimate) -> None:
    again = estimate([lump[0]], probe=PROBE, calibration=ANSWER, reference=[lump[1]])
    for name in PARAMETERS:
        np.testing.assert_array_equal(again.samples[name], found.samples[name])


def test_a_reference_narrows_and_its_absence_is_said(lump: tuple[TactileImage, TactileImage], found: Estimate) -> None:
    alone = estimate(lump[0], probe=PROBE, calibration=ANSWER)
    assert "no_reference" in alone.flags
    assert "no_reference" not in found.flags
    assert found.sd["diameter_mm"] < 0.85 * alone.sd["diameter_mm"]


def test_more_presses_narrow() -> None:
    """Further presses of the same probe repeat its pattern, but not the errors of force and of repeatability.

    How much depends on where on the curved posterior the first press happens to lie, hence the mean of three probes.
    """
    ratios = []
    for seed in (2, 3, 4):
        virtual = VirtualProbe(PROBE, rng=np.random.default_rng(seed), light=EVEN, strain="small")
        images = [virtual.press(tsis.load_phantom("hardness-100"), force_n=1.0) for _ in range(3)]
        references = [virtual.press(PLAIN, force_n=1.0) for _ in range(3)]
        one, three = (
            estimate(images[:count], probe=PROBE, calibration=ANSWER, reference=references[:count], prior=EVEN_TISSUE)
            for count in (1, 3)
        )
        ratios.append([three.sd[name] / one.sd[name] for name in ("diameter_mm", "depth_mm")])
    assert (np.mean(ratios, axis=0) < 0.9).all()


def test_a_prior_of_ones_own_is_respected(
    lump: tuple[TactileImage, TactileImage], monkeypatch: pytest.MonkeyPatch
) -> None:
    few = Degrees(diameter=3, depth=2, contrast=1, tissue=1, thickness=1, baseline=2)  # enough for so small a box
    monkeypatch.setattr(reading, "build_full_contact_surrogate", partial(build_full_contact_surrogate, degrees=few))
    narrow = InclusionPrior(diameter_mm=(8.0, 12.0), depth_mm=(4.0, 7.0), young_kpa=(90.0, 110.0), heterogeneity_sd=0.0)
    result = estimate(lump[0], probe=PROBE, calibration=ANSWER, reference=lump[1], prior=narrow)
    for name, low, high in zip(PARAMETERS, narrow.low, narrow.high, strict=True):
        assert low <= result.samples[name].min() <= result.samples[name].max() <= high
    assert dict(result.prior_sd) == narrow.sd


def test_progress_counts_the_slabs_of_a_new_surrogate(
    lump: tuple[TactileImage, TactileImage], monkeypatch: pytest.MonkeyPatch
) -> None:
    steps: list[tuple[int, int]] = []
    few = Degrees(diameter=2, depth=2, contrast=1, tissue=1, thickness=1, baseline=2)
    built = partial(build_full_contact_surrogate, degrees=few, cached=False)
    monkeypatch.setattr(reading, "build_full_contact_surrogate", built)
    with pytest.raises(NotCalibratedError, match="calibration must be that of the probe"):
        estimate(
            lump[0],
            probe=PROBE,
            calibration=replace(ANSWER, probe="tsis-domed"),
            progress=lambda *step: steps.append(step),
        )
    assert steps == [], "refused before anything is solved"
    estimate(lump[0], probe=PROBE, calibration=ANSWER, progress=lambda *step: steps.append(step))
    done, total = zip(*steps, strict=True)
    assert len(set(total)) == 1
    assert list(done) == sorted(done)
    assert done[-1] == total[0]


def test_a_modulus_that_the_press_cannot_tell_is_said(found: Estimate) -> None:
    assert "young_kpa_not_identified" in found.flags
    assert any("modulus is not identifiable" in note for note in found.notes)
    assert "diameter_mm_not_identified" not in found.flags
    assert len(found.flags) == len(found.notes)


def test_an_inclusion_off_the_axis_is_said(lump: tuple[TactileImage, TactileImage]) -> None:
    shifted = replace(lump[0], grey=np.roll(lump[0].grey, 120, axis=1))  # 4 mm, more than the limit by several sd
    result = estimate(shifted, probe=PROBE, calibration=ANSWER, reference=lump[1])
    assert "off_axis" in result.flags
    centred = estimate(lump[0], probe=PROBE, calibration=ANSWER, reference=lump[1])
    assert "off_axis" not in centred.flags


def test_clipped_rings_are_left_out_and_said(found: Estimate) -> None:
    bright = replace(nominal_calibration(Sensor()), gain_grey_per_kpa=125.0)
    virtual = VirtualProbe(PROBE, rng=np.random.default_rng(2), light=EVEN, calibration=bright, strain="small")
    phantom = tsis.load_phantom("hardness-100")
    image, reference = virtual.press(phantom, force_n=1.0), virtual.press(PLAIN, force_n=1.0)
    assert (image.grey >= 255).any()
    result = estimate(image, probe=PROBE, calibration=bright, reference=reference)
    assert "rings_left_out" in result.flags
    assert "rings_left_out" not in found.flags
    assert phantom.inclusion is not None
    assert abs(result.mean["diameter_mm"] - phantom.inclusion.diameter_mm) < 4 * result.sd["diameter_mm"]


def test_an_image_of_another_probe_is_noticed() -> None:
    soft = Probe(radius_mm=9.0, layers=(Layer(thickness_mm=10.0, young_kpa=10.0),), name="other")
    named = presses(tsis.load_phantom("hardness-100"), probe=soft, force_n=0.6)
    with pytest.raises(ImageMismatchError, match="was taken with 'other'"):
        estimate(named[0], probe=PROBE, calibration=ANSWER, reference=named[1])
    image, reference = (replace(frame, settings={}) for frame in named)
    result = estimate(image, probe=PROBE, calibration=ANSWER, reference=reference)
    assert "model_does_not_fit" in result.flags


def test_provenance_says_what_went_in(lump: tuple[TactileImage, TactileImage], found: Estimate) -> None:
    record = found.provenance
    assert [entry["name"] for entry in record["images"]] == ["hardness-100"]
    assert [entry["name"] for entry in record["reference"]] == ["plain"]
    assert record["probe"]["name"] == "tsis-2011"
    assert record["calibration"]["gain_grey_per_kpa"] == ANSWER.gain_grey_per_kpa
    changed = lump[0].grey.copy()
    changed[0, 0] += 1
    other = estimate(replace(lump[0], grey=changed), probe=PROBE, calibration=ANSWER, reference=lump[1])
    assert other.provenance["images"][0]["sha256"] != record["images"][0]["sha256"]


@pytest.mark.parametrize(
    ("images", "error", "phrase"),
    [
        (lambda _: [], InputError, "images must hold at least one TactileImage; got none"),
        (lambda _: None, InputError, "images must hold at least one TactileImage; got none"),
        (lambda _: 5.0, InputError, "images must hold TactileImage values; got float"),
        (lambda image: image.grey, InputError, "images must hold TactileImage values; got ndarray"),
        (lambda image: replace(image, force_n=None), InputError, "force_n must be known and positive for 'hard"),
        (lambda image: replace(image, force_n=0.0), InputError, "force_n must be known and positive"),
        (lambda image: replace(image, mm_per_pixel=None), InputError, "mm_per_pixel is not known"),
        (
            lambda image: [image, replace(image, mm_per_pixel=(0.05, 0.05))],
            ImageMismatchError,
            "all images must share mm_per_pixel",
        ),
        (lambda image: [image, replace(image, full_scale=4095.0)], ImageMismatchError, "full_scale 255"),
        (
            lambda image: replace(image, grey=np.full(image.grey.shape, 255.0)),
            InputError,
            "without clipping; got one with no usable ring",
        ),
    ],
)
def test_images_that_are_refused(
    lump: tuple[TactileImage, TactileImage], images: Callable[[TactileImage], Any], error: type[Exception], phrase: str
) -> None:
    with pytest.raises(error, match=phrase) as refused:
        estimate(images(lump[0]), probe=PROBE, calibration=ANSWER, reference=lump[1])
    assert "\n" not in str(refused.value)


def test_a_face_outside_the_picture_is_refused(lump: tuple[TactileImage, TactileImage]) -> None:
    image, reference = (replace(frame, axis_px=(1e5, 0.0)) for frame in lump)
    with pytest.raises(InputError, match="inner half of the probe's face must lie in every"):
        estimate(image, probe=PROBE, calibration=ANSWER, reference=reference)


def test_a_reference_that_is_refused(lump: tuple[TactileImage, TactileImage]) -> None:
    with pytest.raises(InputError, match="reference must hold TactileImage values; got str"):
        estimate(lump[0], probe=PROBE, calibration=ANSWER, reference="plain.png")  # type: ignore[arg-type]
    with pytest.raises(ImageMismatchError, match="'plain' has"):
        estimate(lump[0], probe=PROBE, calibration=ANSWER, reference=replace(lump[1], full_scale=4095.0))


@pytest.mark.parametrize("calibration", [None, 60.0, {"gain_grey_per_kpa": 60.0}])
def test_without_a_calibration_nothing_is_estimated(lump: tuple[TactileImage, TactileImage], calibration: Any) -> None:
    with pytest.raises(NotCalibratedError, match=r"calibration must be a Calibration, .*; got") as refused:
        estimate(lump[0], probe=PROBE, calibration=calibration)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("inclusion", "flag"),
    [
        (tsis.Inclusion(diameter_mm=7.0, depth_mm=15.0, young_kpa=100.0), "depth_mm_at_prior_end"),
        (None, "diameter_mm_at_prior_end"),
    ],
)
def test_what_the_prior_cuts_off_is_said(inclusion: tsis.Inclusion | None, flag: str, found: Estimate) -> None:
    image, reference = presses(replace(PLAIN, inclusion=inclusion))
    result = estimate(image, probe=PROBE, calibration=ANSWER, reference=reference)
    assert flag in result.flags
    assert flag not in found.flags


def test_a_frame_given_twice_is_refused(lump: tuple[TactileImage, TactileImage]) -> None:
    with pytest.raises(InputError, match="is given twice, which tells nothing new"):
        estimate([lump[0], lump[0]], probe=PROBE, calibration=ANSWER, reference=lump[1])


def test_frames_of_different_axes_are_refused(lump: tuple[TactileImage, TactileImage]) -> None:
    with pytest.raises(ImageMismatchError, match=r"must share the shape .* and axis_px"):
        estimate(replace(lump[0], axis_px=(404.0, 245.5)), probe=PROBE, calibration=ANSWER, reference=lump[1])


def test_the_error_of_the_press_model_counts_as_noise(lump: tuple[TactileImage, TactileImage]) -> None:
    frames, edges, even = list(lump), ring_edges(PROBE), np.ones(20)
    exact, coarse = (ring_profiles(frames, ANSWER, edges, light=even, model_error=error) for error in (0.0, 0.01))
    np.testing.assert_allclose(coarse.variance - exact.variance, (0.01 * exact.grey) ** 2, rtol=1e-9)


def test_repeats_count_as_their_mean() -> None:
    """Presses whose forces differ by a millionth are not averaged: the likelihood of all of them is the reference."""
    virtual = VirtualProbe(PROBE, rng=np.random.default_rng(11), light=EVEN, strain="small")
    frames = [
        [virtual.press(phantom, force_n=1.0) for _ in range(3)] for phantom in (tsis.load_phantom("size-8"), PLAIN)
    ]
    apart = [[replace(frame, force_n=1 + 1e-6 * number) for number, frame in enumerate(site)] for site in frames]
    mean, every, once = (
        estimate(targets, probe=PROBE, calibration=ANSWER, reference=references, prior=EVEN_TISSUE).untrusted
        for targets, references in (frames, apart, [site[:1] for site in frames])
    )
    for name in PARAMETERS:
        assert mean.mean[name] == pytest.approx(every.mean[name], abs=0.2 * every.sd[name])
        assert mean.sd[name] == pytest.approx(every.sd[name], rel=0.05)
    assert mean.sd["diameter_mm"] < once.sd["diameter_mm"]


@pytest.mark.parametrize("others", ["plain", "size-8"])
def test_repeats_of_different_places_are_withheld(others: str) -> None:
    """Their mean is that of a soft lump, which lies nowhere."""
    virtual = VirtualProbe(PROBE, rng=np.random.default_rng(12), light=EVEN, strain="small")
    phantoms = [tsis.load_phantom(name) for name in ("hardness-100", others)]
    frames = [virtual.press(each, force_n=1.0) for each in phantoms for _ in range(2)]
    result = estimate(frames, probe=PROBE, calibration=ANSWER, prior=EVEN_TISSUE)
    assert not result.trusted
    assert {"presses_disagree", "model_does_not_fit"} & set(result.flags)


def test_true_repeats_scatter_as_often_as_the_errors_say() -> None:
    """Never below the least chance: what no error of the calibration explains is allowed for besides."""
    edges, chances = ring_edges(PROBE), []
    for seed in range(6):
        virtual = VirtualProbe(PROBE, rng=np.random.default_rng(seed), light=EVEN, strain="small")
        frames = [virtual.press(tsis.load_phantom("size-8"), force_n=force) for force in (0.5, 0.5, 1.0, 1.0, 1.0)]
        chances.append(repeats_chance(frames, ANSWER, edges))
        assert repeats_chance(frames[1:3], ANSWER, edges) == 1.0, "none of them repeats another"
        half = [*frames[:-1], replace(frames[-1], grey=0.8 * frames[-1].grey)]
        assert repeats_chance(half, ANSWER, edges) < 1e-4, "one whose light fell by a fifth"
    assert min(chances) > 0.01


def light_to(reach_mm: float) -> LightMap:
    side = np.linspace(-reach_mm, reach_mm, 9)
    none = np.zeros((9, 9))
    level = np.broadcast_to(1 + 0.01 * side, (9, 9))
    return LightMap(x_mm=side, y_mm=side, relative=level, flux_x=none, flux_y=none, growth_per_mm=none, error=0.0)


def test_another_probes_calibration_is_refused_by_name() -> None:
    with pytest.raises(NotCalibratedError, match=r"'tsis-2011'; got one of 'tsis-domed': calibrate"):
        check_calibration(replace(ANSWER, probe="tsis-domed"), PROBE)


@pytest.mark.parametrize(("of", "probe"), [("", "tsis-2011"), ("tsis-2011", "tsis-2011"), ("other", "")])
def test_the_same_or_an_unknown_name_passes(of: str, probe: str) -> None:
    check_calibration(replace(ANSWER, probe=of), replace(PROBE, name=probe))


def test_a_map_of_light_must_reach_the_rim() -> None:
    check_calibration(replace(ANSWER, light=light_to(12.0)), PROBE)
    with pytest.raises(NotCalibratedError, match=r"12 mm; got a map that ends at 10 mm"):
        check_calibration(replace(ANSWER, light=light_to(10.0)), PROBE)


def test_even_light_is_even_beyond_its_map() -> None:
    check_calibration(replace(ANSWER, light=LightMap.uniform()), PROBE)
