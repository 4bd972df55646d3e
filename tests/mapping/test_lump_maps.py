"""The map on presses that the model itself makes; solved scans judge it in `benchmarks.mapping`."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest
import scipy

import tsis
from tsis.errors import InputError, NotCalibratedError, UntrustedError
from tsis.imaging.sensor import Sensor
from tsis.inclusion.frames import OUTER_FRACTION
from tsis.inclusion.posterior.rings import ring_means
from tsis.mapping import LumpMap, MapPrior, Scan, ScanPress, estimate_map
from tsis.mapping.answers import clusters
from tsis.mapping.estimation import BLOCK, block_areas
from tsis.mapping.observation import observe
from tsis.mapping.places import with_place_errors
from tsis.mapping.posterior import BlockLikelihood, Region, Sampler, greedy_fit
from tsis.mapping.scan import Indenter
from tsis.mapping.stiffness import observe_stiffness, read_touches, stiffness_kernel, suited_prior
from tsis.mapping.uneven_field import bessel
from tsis.mechanics.finite_strain.neo_hookean_press import PressSeries
from tsis.mechanics.lump_kernel import lump_kernel
from tsis.mechanics.tissue_field import FieldMesh, TissueFieldResponse, field_features
from tsis.model.calibration import LightMap
from tsis.virtual.probe import VirtualProbe, nominal_calibration

if TYPE_CHECKING:
    from pathlib import Path

    from tsis.mapping.signals import Floats
    from tsis.mechanics.lump_kernel import LumpKernel

PROBE = tsis.load_probe("tsis-2011")
RINGS, SECTORS = 8, 12
PLACES = [(x, y) for y in (-10.0, 0.0, 10.0) for x in (-10.0, 0.0, 10.0)]
LUMP = (3.0, -2.0, 9.0, 9.0, 8.0)  # x, y, depth of the centre, diameter, contrast


@cache
def kernel() -> LumpKernel:
    """The kernel of the flat probe, read once."""
    return lump_kernel(PROBE)


def pressures(place: tuple[float, float], angle_deg: float, lumps: list[tuple[float, ...]]) -> Floats:
    """Sector means by the kernel itself, harmonic by harmonic, in the probe's frame."""
    rows = ring_means(kernel().radius_mm, np.linspace(0.0, OUTER_FRACTION * PROBE.radius_mm, RINGS + 1))
    bare = observe_bare(RINGS)
    means = np.repeat(bare[:, None], SECTORS, axis=1)
    middle = 2 * np.pi * (np.arange(SECTORS) + 0.5) / SECTORS
    for x, y, centre, diameter, contrast in lumps:
        dx, dy = x - place[0], y - place[1]
        change = kernel().response(
            distance_mm=float(np.hypot(dx, dy)), centre_mm=centre, diameter_mm=diameter, contrast=contrast
        )
        turn = middle - np.arctan2(dy, dx) + np.radians(angle_deg)
        for order, profile in enumerate(change):
            means += np.outer(rows @ profile, np.cos(order * turn) * np.sinc(order / SECTORS))
    return means


@cache
def observe_bare(rings: int) -> Floats:
    slab = TissueFieldResponse(PROBE, young_kpa=5.0, thickness_mm=30.0, poisson=0.49, mesh=FieldMesh(points=25))
    rows = ring_means(slab.radius_mm, np.linspace(0.0, OUTER_FRACTION * PROBE.radius_mm, rings + 1))
    return np.asarray(rows @ slab.press()[0][0])


def scan_of(lumps: list[tuple[float, ...]], *, seed: int = 1, turned: float = 0.0, noise: float = 0.004) -> Scan:
    """A scan whose world and probe are turned together by an angle in degrees."""
    rng = np.random.default_rng(seed)
    cosine, sine = np.cos(np.radians(turned)), np.sin(np.radians(turned))
    presses = []
    for x, y in PLACES:
        values = pressures((x, y), 0.0, lumps) + rng.normal(0.0, noise, (RINGS, SECTORS))
        place = (cosine * x - sine * y, sine * x + cosine * y)
        presses.append(ScanPress(place_mm=place, angle_deg=turned, force_n=1.0, pressure_kpa=values, noise_kpa=noise))
    return Scan(presses=tuple(presses))


@pytest.fixture(scope="module")
def found() -> LumpMap:
    return estimate_map(scan_of([LUMP]), probe=PROBE, steps=3000, voxel_mm=3.0)


def evidence(scan: Scan, lumps: Floats) -> float:
    likelihood = BlockLikelihood(observe(scan, PROBE, None, MapPrior()), MapPrior())
    weights = likelihood.log_weights(likelihood.observation.values - likelihood.signal(lumps))
    return float(np.logaddexp.reduce(weights.ravel()))


def as_row(lump: tuple[float, ...]) -> Floats:
    return np.array([[*lump[:3], np.log(lump[3]), np.log(lump[4])]])


def test_a_lump_is_found_at_its_place_and_depth(found: LumpMap) -> None:
    assert found.trusted
    assert len(found.lumps) == 1
    inside = found.lumps[0].estimate.interval(0.99)
    for name, value in zip(("x_mm", "y_mm", "centre_depth_mm", "diameter_mm", "contrast"), LUMP, strict=True):
        assert inside[name][0] - 0.1 <= value <= inside[name][1] + 0.1, name
    assert found.lumps[0].probability > 0.95


def test_a_lump_that_is_too_uncertain_to_be_listed_is_told_with_its_place(
    found: LumpMap, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tsis.mapping.estimation.PRESENT", 1.1)
    doubted = estimate_map(scan_of([LUMP]), probe=PROBE, steps=3000, voxel_mm=3.0)
    assert not doubted.lumps
    assert set(doubted.flags) - set(found.flags) == {"lump_possible"}
    told = next(note for note in doubted.notes if note.startswith("A lump is possible"))
    assert "x 3 mm, y -2 mm" in told
    assert "press near it again" in told
    np.testing.assert_array_equal(doubted.probability, found.probability)


def test_probabilities_of_numbers_voxels_and_areas_fit_each_other(found: LumpMap) -> None:
    assert found.count_probability.sum() == pytest.approx(1.0)
    assert found.probability.min() >= 0
    assert found.probability.max() <= 1
    numbers = found.numbers
    z = int(np.abs(numbers.depth_mm - LUMP[2]).argmin())
    y, x = int(np.abs(numbers.y_mm - LUMP[1]).argmin()), int(np.abs(numbers.x_mm - LUMP[0]).argmin())
    assert found.probability[z, y, x] > 0.9
    assert found.area_probability[y, x] > 0.9
    assert numbers.modulus_kpa[z, y, x] > 2 * numbers.modulus_kpa[z, 0, 0]
    assert np.isfinite(numbers.modulus_sd_kpa).all()


def test_unevenness_is_known_no_better_than_its_steps(found: LumpMap) -> None:
    for name, most in (("sd", MapPrior().heterogeneity_sd), ("length_mm", 18.0)):
        low, high = found.unevenness.interval(0.9)[name]
        assert 1.15 * low < high <= most


def test_deep_lumps_must_be_larger_to_be_seen(found: LumpMap) -> None:
    numbers = found.numbers
    middle = found.blind_diameter_mm[:, len(numbers.y_mm) // 2, len(numbers.x_mm) // 2]
    shown = middle[(numbers.depth_mm > 3) & np.isfinite(middle)]
    assert (np.diff(shown) >= -1e-9).all()
    assert shown[0] < 8


def test_the_order_of_presses_does_not_matter() -> None:
    scan = scan_of([LUMP])
    mixed = Scan(presses=scan.presses[::-1])
    assert evidence(mixed, as_row(LUMP)) == pytest.approx(evidence(scan, as_row(LUMP)), abs=1e-5)


def test_turning_world_and_probe_does_not_matter() -> None:
    angle = np.radians(37.0)
    x, y = LUMP[0] * np.cos(angle) - LUMP[1] * np.sin(angle), LUMP[0] * np.sin(angle) + LUMP[1] * np.cos(angle)
    turned = evidence(scan_of([LUMP], turned=37.0), as_row((x, y, *LUMP[2:])))
    assert turned == pytest.approx(evidence(scan_of([LUMP]), as_row(LUMP)), abs=1e-4)


def test_the_field_of_a_press_has_the_covariance_of_the_round_model() -> None:
    """Harmonic 0 of one press against features of the round model, which know nothing of places."""
    observation = observe(scan_of([]), PROBE, None, MapPrior())
    length = 5.0
    found = observation.field.covariance(length, np.zeros((1, 2)), np.zeros(1), np.ones(1), np.zeros(1))
    slab = TissueFieldResponse(PROBE, young_kpa=5.0, thickness_mm=30.0, poisson=0.49, mesh=FieldMesh(points=25))
    rows = ring_means(slab.radius_mm, np.linspace(0.0, OUTER_FRACTION * PROBE.radius_mm, RINGS + 1))
    start = 0
    for order in range(3):
        response = slab.response(order)
        basis = observation.table.shapes.basis[order]
        reduced = basis.T @ rows @ response.pressure_kpa[0]
        across, along = field_features(order, length, response.radius_mm, response.depth_mm)
        features = np.concatenate([(reduced * wave) @ along.T for wave in across], axis=1)
        block = found[start : start + basis.shape[1], start : start + basis.shape[1]]
        assert np.abs(block - features @ features.T).max() < 0.03 * np.abs(block).max()
        start += basis.shape[1] * (1 if order == 0 else 2)


@pytest.mark.parametrize("sd", [0.0, 0.2])
def test_uneven_tissue_without_lump_has_none(sd: float) -> None:
    prior = MapPrior()
    scan = scan_of([], seed=3)
    observation = observe(scan, PROBE, None, prior)
    field = observation.field.covariance(
        6.0, observation.places_mm, observation.angle, observation.force_n, observation.place_sd_mm
    )
    root = np.linalg.cholesky(sd**2 * field + observation.noise)
    false = []
    for seed in range(3):
        values = (root @ np.random.default_rng(seed).normal(size=len(root))).reshape(observation.values.shape)
        likelihood = BlockLikelihood(replace(observation, values=values), prior)
        region = Region.of(observation, prior, expected=1.0)
        fit, candidates, gain = greedy_fit(likelihood, region)
        samples = Sampler(likelihood, region, fit, candidates, gain, np.random.default_rng(seed)).run(1500)
        false.append(sum(cluster.probability > 0.5 for cluster in clusters(samples.lumps)))
    assert sum(false) == 0


@pytest.mark.parametrize("moves", [pytest.param("all", marks=pytest.mark.slow), "no birth and death"])
def test_without_data_the_sampler_draws_from_the_prior(moves: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Numbers, depths and distances of pairs against lumps drawn by rejection: the moves balance one another."""
    prior = MapPrior(diameter_mm=(3.0, 16.0), depth_mm=(0.5, 20.0))
    observation = observe(scan_of([], seed=3), PROBE, None, prior)
    likelihood = BlockLikelihood(replace(observation, own=observation.own * 1e8), prior, length_mm=6.0)
    region = Region.of(observation, prior, expected=2.0)
    fit, candidates, gain = greedy_fit(likelihood, region)
    sampler, least = Sampler(likelihood, region, fit, candidates, gain, np.random.default_rng(5)), 0
    if moves != "all":
        sampler.lumps, least = np.array([[0.0, 0.0, 10.0, np.log(8.0), np.log(5.0)]]), 1
        for name in ("_birth", "_death"):
            monkeypatch.setattr(Sampler, name, Sampler._split if name == "_birth" else Sampler._merge)
    found = sampler.run(30000, every=15).learnt
    rng = np.random.default_rng(6)
    drawn: list[Floats] = []
    while len(drawn) < 4000:
        lumps = np.array([region.drawn(rng) for _ in range(rng.poisson(2.0))]).reshape(-1, 5)
        if len(lumps) >= least and all(region.allows(lumps, number) for number in range(len(lumps))):
            drawn.append(lumps)
    for of in (len, lambda lumps: float(lumps[:, 2].sum()), lambda lumps: float(lumps[:, 3].sum()), near_pairs):
        first, second = (np.array([of(lumps) for lumps in states], dtype=float) for states in (found, drawn))
        parts = first.reshape(20, -1).mean(axis=1)  # the states of a chain depend on one another
        error = np.hypot(parts.std(ddof=1) / np.sqrt(20), second.std() / np.sqrt(len(second)))
        assert abs(first.mean() - second.mean()) < 4 * error
        assert error < 0.15 * second.std()


def near_pairs(lumps: Floats) -> int:
    apart = np.linalg.norm(lumps[:, None, :3] - lumps[None, :, :3], axis=2)
    return int((apart[np.triu_indices(len(lumps), 1)] < 12.0).sum())


@pytest.mark.slow
def test_the_sampler_is_calibrated_on_worlds_of_its_own_prior() -> None:
    """Simulation-based calibration (Talts and others 2018): ranks of the truth among samples are uniform."""
    prior = MapPrior(diameter_mm=(6.0, 12.0), depth_mm=(3.0, 10.0), contrast=(3.0, 20.0))
    observation = observe(scan_of([], seed=3), PROBE, None, prior)
    base = BlockLikelihood(observation, prior)
    region = Region.of(observation, prior, expected=1.0)
    field = observation.field.covariance(
        6.0, observation.places_mm, observation.angle, observation.force_n, observation.place_sd_mm
    )
    root = np.linalg.cholesky(0.08**2 * field + observation.noise)
    inside: list[Floats] = []
    rng = np.random.default_rng(8)
    while len(inside) < 40:
        lump = region.drawn(rng)
        if not region.allows(lump[None], 0) or np.abs(lump[:2]).max() > 12:
            continue
        signal = base.signal(lump[None])
        values = signal + (root @ rng.normal(size=len(root))).reshape(signal.shape)
        likelihood = BlockLikelihood(replace(observation, values=values), prior)
        fit, candidates, gain = greedy_fit(likelihood, region)
        samples = Sampler(likelihood, region, fit, candidates, gain, rng).run(6000)
        near = [one for one in clusters(samples.lumps) if np.linalg.norm(np.median(one.samples, 0)[:3] - lump[:3]) < 5]
        if near:
            low, high = np.quantile(near[0].samples, [0.05, 0.95], axis=0)
            inside.append((lump >= low) & (lump <= high))
    share = np.mean(inside, axis=0)
    assert (share > 0.76).all()  # 0.9 less three standard errors of forty
    assert share.mean() > 0.84


def test_a_lump_is_known_no_better_along_the_skin_than_the_mean_of_the_places_errors() -> None:
    """However strong its signal: nine presses, each beside its place by a drawn error, are moved with it."""
    error_mm = 2.0
    rng = np.random.default_rng(11)
    presses = scan_of([(1.0, 2.0, 8.0, 10.0, 8.0)], seed=11, noise=0.001).presses
    moved = tuple(
        replace(one, place_mm=tuple(np.add(one.place_mm, rng.normal(0.0, error_mm, 2))), place_sd_mm=error_mm)
        for one in presses
    )
    lump = (
        estimate_map(Scan(presses=moved), probe=PROBE, steps=3000, voxel_mm=3.0).untrusted.lumps[0].estimate.untrusted
    )
    for name, truth in (("x_mm", 1.0), ("y_mm", 2.0)):
        sd = float(lump.samples[name].std())
        assert sd > 0.95 * error_mm / np.sqrt(len(presses))
        assert abs(lump.mean[name] - truth) < 3 * sd


def test_a_press_beside_its_stated_place_is_put_back_and_the_lump_stays() -> None:
    presses = list(scan_of([LUMP]).presses)
    beside = PLACES.index((0.0, 0.0))
    presses[beside] = replace(presses[beside], place_mm=(-1.5, 1.0), place_sd_mm=1.5)
    found = estimate_map(Scan(presses=tuple(presses)), probe=PROBE, steps=1200, voxel_mm=5.0)
    assert found.place_shift_mm[beside] == pytest.approx((1.5, -1.0), abs=0.25)
    assert np.abs(np.delete(found.place_shift_mm, beside, axis=0)).max() < 0.2
    assert found.count_probability[1] > 0.9
    mean = found.lumps[0].estimate.mean
    assert (mean["x_mm"], mean["y_mm"]) == pytest.approx(LUMP[:2], abs=0.3)


@pytest.mark.parametrize("sd", [0.2, 0.8])
def test_the_noise_of_a_place_s_error_is_that_of_presses_beside_their_places(sd: float) -> None:
    """Mean and covariance of the lump's signal at drawn places, against the second order of its derivatives."""
    observation = observe(scan_of([LUMP]), PROBE, None, MapPrior())
    observation = replace(observation, place_sd_mm=np.full(len(PLACES), sd))
    likelihood = BlockLikelihood(observation, MapPrior(), length_mm=6.0)
    seen, _ = with_place_errors(observation, likelihood, as_row(LUMP))
    rng, table = np.random.default_rng(11), observation.table
    drawn = np.array(
        [
            table.signals(
                as_row(LUMP),
                observation.places_mm + rng.normal(0, sd, (len(PLACES), 2)),
                observation.angle,
                observation.force_n,
            )
            for _ in range(4000)
        ]
    )
    there = table.signals(as_row(LUMP), observation.places_mm, observation.angle, observation.force_n)
    for press in range(len(PLACES)):
        expected = np.cov(drawn[:, press].T)
        found = seen.own[press] - observation.own[press]
        assert np.linalg.norm(found - expected) < 0.12 * np.linalg.norm(expected)
        moved = there[press] - drawn[:, press].mean(axis=0)
        error = np.sqrt(np.trace(expected) / len(drawn))
        assert (
            np.linalg.norm(seen.values[press] - observation.values[press] - moved)
            < 0.2 * np.linalg.norm(moved) + 4 * error
        )


def test_numbers_at_other_places_are_what_the_covariance_predicts() -> None:
    observation = observe(scan_of([]), PROBE, None, MapPrior())
    weights = np.random.default_rng(3).normal(size=observation.values.shape)
    places, angle, force = observation.places_mm, observation.angle, observation.force_n
    exact = np.zeros(len(places))
    same, moved = observation.field.predicted(5.0, [places, places + 1.5], places, angle, force, exact, weights)
    both = observation.field.covariance(
        5.0,
        np.concatenate([places + 1.5, places]),
        np.tile(angle, 2),
        np.tile(force, 2),
        np.zeros(2 * len(places)),
    )
    count = weights.size
    assert same.ravel() == pytest.approx(both[count:, count:] @ weights.ravel(), abs=2e-3 * np.abs(same).max())
    assert moved.ravel() == pytest.approx(both[:count, count:] @ weights.ravel(), abs=2e-3 * np.abs(moved).max())


def test_bessel_functions_of_the_table_are_scipy_s() -> None:
    x = np.random.default_rng(4).uniform(0.0, 173.0, (5, 400))
    expected = scipy.special.jv(np.arange(13)[:, None, None], x)
    assert np.abs(bessel(12, x) - expected).max() < 1e-9


def test_states_give_a_cluster_one_lump_each() -> None:
    rng = np.random.default_rng(1)
    first, second = np.array([0.0, 0.0, 9.0, 2.0, 2.0]), np.array([12.0, 0.0, 9.0, 2.0, 2.0])
    states = tuple(
        np.array([first + rng.normal(0, 0.2, 5), *([second + rng.normal(0, 0.2, 5)] if number % 4 else [])])
        for number in range(100)
    )
    found = clusters(states)
    assert [round(one.probability, 2) for one in found] == [1.0, 0.75]
    assert found[0].samples[:, 0].mean() == pytest.approx(0.0, abs=0.1)


def test_an_interrupted_estimate_continues_with_the_same_answer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scan, file = scan_of([LUMP]), tmp_path / "resume.npz"
    first = estimate_map(scan, probe=PROBE, steps=600, voxel_mm=5.0, resume=file)
    monkeypatch.setattr("tsis.mapping.estimation.BlockLikelihood", None)  # a finished block costs nothing
    again = estimate_map(scan, probe=PROBE, steps=600, voxel_mm=5.0, resume=file)
    for name in ("probability", "modulus_kpa", "blind_diameter_mm"):
        assert np.array_equal(getattr(first.numbers, name), getattr(again.numbers, name)), name
    assert np.array_equal(first.place_shift_mm, again.place_shift_mm)
    assert again.next_places == first.next_places
    kept = dict(np.load(file))
    for change in ({"force_sd": 0.5}, {"noise_kpa": 0.02}, {"reference": True}, {"place_sd_mm": 0.3}, {"force_n": 0.9}):
        other = replace(scan, presses=(replace(scan.presses[0], **change), *scan.presses[1:]))
        with pytest.raises(InputError, match="is of others"):
            estimate_map(other, probe=PROBE, steps=600, voxel_mm=5.0, resume=file)
    with pytest.raises(InputError, match="is of others"):
        estimate_map(scan, probe=PROBE, steps=700, voxel_mm=5.0, resume=file)
    wrong = {"key": np.frombuffer(b"\xff\xfe", np.uint8), "even0": np.ones(3), "lumps0": kept["lumps0"] * np.nan}
    for name, values in wrong.items():
        np.savez(file, **{**kept, name: values})
        with pytest.raises(InputError, match=r"resume must name a file .*: name another file"):
            estimate_map(scan, probe=PROBE, steps=600, voxel_mm=5.0, resume=file)
    np.savez(file, **{name: values for name, values in kept.items() if name != "gains0"})
    with pytest.raises(InputError, match=r"resume\.npz is damaged: name another file"):
        estimate_map(scan, probe=PROBE, steps=600, voxel_mm=5.0, resume=file)


def test_what_no_press_can_tell_draws_none(found: LumpMap) -> None:
    """The lump is known as well as the kernel allows: no press would halve what is left."""
    best = found.next_places[0]
    assert 0.0 < best.gain_nats < np.log(2)


def test_a_wrong_scale_is_withheld() -> None:
    scan = scan_of([LUMP])
    rng = np.random.default_rng(2)
    broken = tuple(
        replace(press, pressure_kpa=rng.permutation(np.asarray(press.pressure_kpa).ravel()).reshape(RINGS, SECTORS) + 3)
        for press in scan.presses
    )
    result = estimate_map(Scan(presses=broken), probe=PROBE, steps=500, voxel_mm=5.0)
    assert "map_does_not_fit" in result.flags
    with pytest.raises(UntrustedError):
        _ = result.lumps
    assert result.untrusted.probability.shape


def test_presses_without_contact_and_repeats_are_left_out_by_name() -> None:
    scan = scan_of([])
    idle = replace(scan.presses[0], force_n=0.0, name="idle")
    again = replace(scan.presses[1], name="again", place_sd_mm=0.5)
    missed = replace(scan.presses[2], name="missed", pressure_kpa=np.full((RINGS, SECTORS), 0.002))
    unread = replace(missed, name="unread", force_n=None)
    presses = (idle, scan.presses[1], missed, unread, *scan.presses[3:], again)
    observation = observe(Scan(presses=presses), PROBE, None, MapPrior())
    assert len(observation.values) == 7
    assert [text.split()[0] for text in observation.left_out] == ["idle", "again", "missed", "unread"]


def test_a_stiff_ball_or_punch_without_image_finds_a_lump() -> None:
    """Forces by the punch's own kernel, whose sum over the tissue is tested in mechanics."""
    indenter = Indenter(shape="punch", radius_mm=4.0)
    kernel, even = stiffness_kernel(indenter, (2.0,), (5.0, 30.0, 0.49))
    rng, presses = np.random.default_rng(4), []
    for x in np.arange(-16.0, 17.0, 4.0):
        for y in np.arange(-16.0, 17.0, 4.0):
            change = kernel.response(
                distance_mm=float(np.hypot(x - 2, y - 1)), centre_mm=8.0, diameter_mm=9.0, contrast=10.0
            )[0, 0]
            force = even[0] * np.exp(change + rng.normal(0, 0.005))
            curve = np.column_stack([np.linspace(0.0, 2.0, 9), np.linspace(0.0, force, 9)])
            presses.append(ScanPress(place_mm=(float(x), float(y)), travel_force=curve))
    result = estimate_map(Scan(presses=tuple(presses), indenter=indenter), steps=1500, voxel_mm=4.0)
    assert len(result.lumps) == 1
    mean = result.lumps[0].estimate.mean
    assert np.hypot(mean["x_mm"] - 2, mean["y_mm"] - 1) < 1.0


def ball_press(radius: float, young: float, start: float, rng: np.random.Generator) -> Floats:
    """A press on a thick body by Hertz's law: stiffer with depth by some 10 %, with a zero error and noise."""
    travel = np.linspace(0.0, 2.4, 41)
    depth = np.maximum(travel - start, 0.0)
    force = 4e-3 / 3 * young / (1 - 0.49**2) * np.sqrt(radius) * depth**1.5 * (1 + rng.normal(0, 0.1) * depth / 2.4)
    return np.column_stack([travel, force + rng.normal(0, 0.004) + rng.normal(0, 0.001, 41)])


def test_the_contact_of_a_press_is_found_within_its_interval_and_the_modulus_of_the_tissue() -> None:
    rng, indenter = np.random.default_rng(20261129), Indenter(shape="ball", radius_mm=3.0)
    starts = rng.uniform(-0.2, 0.9, 100)
    curves = [ball_press(3.0, 12.0 * np.exp(rng.normal(0, 0.2)), start, rng) for start in starts]
    presses = [ScanPress(place_mm=(float(n), 0.0), travel_force=curve) for n, curve in enumerate(curves)]
    scan = Scan(presses=tuple(presses), indenter=indenter)
    touches = read_touches(scan, MapPrior(thickness_mm=30.0)).touches
    errors = np.array([-touch.depth_mm[0] for touch in touches]) - starts
    held = np.abs(errors) < 1.645 * np.array([touch.contact_sd_mm for touch in touches])
    assert 0.78 < held.mean() < 0.98
    assert errors.std() < 0.1
    assert suited_prior(scan, thickness_mm=30.0).tissue_young_kpa == pytest.approx(12.0, rel=0.1)


def test_a_press_that_hardly_enters_is_left_out_by_name_and_repeats_tell_the_sd_from_press_to_press() -> None:
    rng, indenter = np.random.default_rng(8), Indenter(shape="ball", radius_mm=3.0)
    curves = [ball_press(3.0, 12.0 * np.exp(rng.normal(0, 0.18)), 0.3, rng) for _ in range(40)]
    curves.append(ball_press(3.0, 12.0, 2.15, rng))
    curves = [np.add(curve, [100.0, 0.0]) for curve in curves]  # a robot's own travel
    presses = [ScanPress(place_mm=(float(n % 10), 0.0), travel_force=curve) for n, curve in enumerate(curves)]
    observation = observe_stiffness(Scan(presses=tuple(presses), indenter=indenter), MapPrior(thickness_mm=30.0))
    assert len(observation.values) == 40
    assert [text.split()[1] for text in observation.left_out] == ["41"]
    assert float(np.sqrt(observation.white.mean() / 3)) == pytest.approx(0.18, rel=0.35)  # numbers are sums of three


def test_units_and_contacts_of_an_indenter_are_named_before_anything_is_estimated() -> None:
    rng, indenter = np.random.default_rng(9), Indenter(shape="ball", radius_mm=3.0)
    curves = [ball_press(3.0, 12.0, 0.3, rng) for _ in range(12)]

    def scan(changed: list[Floats]) -> Scan:
        presses = [ScanPress(place_mm=(5.0 * n, 0.0), travel_force=curve) for n, curve in enumerate(changed)]
        return Scan(presses=tuple(presses), indenter=indenter)

    with pytest.raises(InputError, match=r"the median press amounts to .*e\+03 kPa: check the units \(mm, N\)"):
        suited_prior(scan([curve * [1.0, 400.0] for curve in curves]))
    with pytest.raises(InputError, match=r"must hold presses with contact.* has no contact\. And 9 more"):
        suited_prior(scan([curve * [1.0, 1e-4] for curve in curves]))
    noise = np.column_stack([curves[0][:, 0], rng.normal(0.0, 0.05, 41)])
    touches = read_touches(scan([noise, *curves[1:]]), MapPrior())
    assert touches.index == tuple(range(1, 12))
    assert touches.left_out[0].endswith("tare the force, begin above the skin.")


@pytest.mark.parametrize("thickness_mm", [8.0, 15.0, 40.0])
def test_the_prior_of_thin_tissue_has_lumps_that_lie_in_it(thickness_mm: float) -> None:
    prior = suited_prior(scan_of([]), thickness_mm=thickness_mm)
    assert prior.thickness_mm == thickness_mm
    assert prior.depth_mm == (2.5, min(20.0, thickness_mm))
    with pytest.raises(InputError, match=r"thickness_mm must lie in \[5, 200\]"):
        suited_prior(scan_of([]), thickness_mm=4.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"place_mm": (np.nan, 0.0)}, "place_mm"),
        ({"place_sd_mm": -1.0}, "place_sd_mm"),
        ({"pressure_kpa": np.ones((2, 3))}, "pressure_kpa"),
        ({"pressure_kpa": np.full((8, 12), np.inf)}, "finite"),
        ({"force_n": 1000.0}, "force_n"),
        ({"noise_kpa": -1.0}, "noise_kpa"),
        ({"pressure_kpa": None}, "exactly one"),
        ({"travel_force": np.array([[1.0, 1.0], [0.5, 2.0]]), "pressure_kpa": None}, "ascend"),
    ],
)
def test_a_bad_press_is_refused_in_one_sentence(change: dict[str, object], message: str) -> None:
    given = {"place_mm": (0.0, 0.0), "pressure_kpa": np.ones((8, 12)), "force_n": 1.0, **change}
    with pytest.raises(InputError, match=message):
        ScanPress(**given)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("pressure", "force", "place", "message"),
    [
        (1e3, 1.0, 1.0, "check the units"),  # Pa
        (-1.0, 1.0, 1.0, "check the units"),
        (1.0, 0.102, 1.0, "check the units"),  # kilograms
        (1e3, None, 1.0, r"the median press amount to 1\.\d+e\+03 N: check the unit \(kPa\)"),
        (1.0, 1.0, 1e-3, "give x_mm and y_mm in millimetres"),  # metres
        (1.0, 1.0, 0.1, "give x_mm and y_mm in millimetres"),  # centimetres
        (1.0, 1.0, 50.0, "spread over"),
        (0.0, 1.0, 1.0, "check the units"),
    ],
)
def test_slips_of_units_are_named_before_anything_is_estimated(
    pressure: float, force: float | None, place: float, message: str
) -> None:
    presses = [
        replace(
            press,
            pressure_kpa=pressure * np.asarray(press.pressure_kpa),
            force_n=force,
            place_mm=(place * press.place_mm[0], place * press.place_mm[1]),
        )
        for press in scan_of([LUMP]).presses
    ]
    with pytest.raises(InputError, match=message):
        estimate_map(Scan(presses=tuple(presses)), probe=PROBE, steps=500)


def test_what_could_not_be_kept_or_held_is_refused_before_anything_is_estimated(tmp_path: Path) -> None:
    scan = scan_of([])
    far = Scan(presses=(scan.presses[0], replace(scan.presses[1], place_mm=(120.0, 120.0))))
    with pytest.raises(InputError, match="voxel_mm must give at most"):
        estimate_map(far, probe=PROBE, voxel_mm=0.5)
    (tmp_path / "junk").write_bytes(b"junk")
    for resume, message in (
        (tmp_path / "gone" / "kept", "there is no"),
        (tmp_path / "junk", "junk: it must be a whole"),
    ):
        with pytest.raises(InputError, match=message):
            estimate_map(scan, probe=PROBE, resume=resume)


def test_an_error_names_the_first_of_many_presses() -> None:
    presses = [replace(press, force_n=0.0, name=f"p{number}") for number, press in enumerate(scan_of([]).presses)]
    with pytest.raises(InputError, match=r"p2 has no contact.*And 6 more"):
        estimate_map(Scan(presses=tuple(presses)), probe=PROBE)


def test_bad_scans_are_refused_in_one_sentence() -> None:
    press = ScanPress(place_mm=(0.0, 0.0), pressure_kpa=np.ones((8, 12)), force_n=1.0)
    other = replace(press, place_mm=(10.0, 0.0))
    curve = ScanPress(place_mm=(5.0, 0.0), travel_force=np.array([[0.0, 0.0], [1.0, 1.0]]))
    for presses, message in (((press,), "at least two"), ((press, press), "all at one"), ((press, curve), "the same")):
        with pytest.raises(InputError, match=message):
            Scan(presses=presses)
    with pytest.raises(InputError, match="indenter"):
        Scan(presses=(curve, replace(curve, place_mm=(9.0, 0.0))))
    scan = Scan(presses=(press, other))
    with pytest.raises(InputError, match="probe"):
        estimate_map(scan)
    with pytest.raises(InputError, match="no strain is called"):
        estimate_map(scan, probe=PROBE, strain="large")
    with pytest.raises(InputError, match=r"one shape, \(rings, sectors\), in all presses; got \(8,\) in flat and "):
        estimate_map(Scan(presses=(press, replace(other, pressure_kpa=np.ones(8), name="flat"))), probe=PROBE)
    frames = Scan(
        presses=tuple(
            ScanPress(place_mm=(x, 0.0), frame=tsis.TactileImage(grey=np.ones((8, 8)), mm_per_pixel=(3.0, 3.0)))
            for x in (0.0, 5.0)
        )
    )
    with pytest.raises(NotCalibratedError):
        estimate_map(frames, probe=PROBE)
    with pytest.raises(InputError, match="contrast"):
        MapPrior(contrast=(1.2, 5.0))


@pytest.mark.parametrize(
    ("force_n", "strain", "told"), [(0.7, "small", True), (0.79, "finite", False), (0.15, "small", False)]
)
def test_presses_too_deep_for_small_strain_are_told(force_n: float, strain: str, told: bool) -> None:
    even = np.repeat(force_n * observe_bare(RINGS)[:, None], SECTORS, axis=1)
    presses = tuple(
        ScanPress(place_mm=(x, 0.0), force_n=force_n, pressure_kpa=even, noise_kpa=0.004) for x in (-10.0, 0.0, 10.0)
    )
    result = estimate_map(Scan(presses=presses), probe=PROBE, strain=strain, steps=500, voxel_mm=5.0)
    assert ("presses_deep" in result.flags) is told
    assert any(note.startswith("At 0.7 N on tissue of 5 kPa") for note in result.notes) is told
    assert any("up to 0.79 N a map at strain 'finite'" in note for note in result.notes) is told


def test_a_press_at_finite_strain_on_even_tissue_leaves_nothing_to_explain() -> None:
    field = PressSeries(PROBE).press(tsis.Phantom(young_kpa=5.0, thickness_mm=30.0), force_n=0.7)
    edges = np.linspace(0.0, OUTER_FRACTION * PROBE.radius_mm, RINGS + 1)
    means = np.repeat((ring_means(field.radius_mm, edges) @ field.pressure_kpa)[:, None], SECTORS, axis=1)
    known, unknown = (
        Scan(
            presses=tuple(
                ScanPress(place_mm=(x, 0.0), pressure_kpa=means, noise_kpa=0.004, force_n=force) for x in (0.0, 10.0)
            )
        )
        for force in (0.7, None)
    )
    left = {
        strain: np.linalg.norm(observe(known, PROBE, None, MapPrior(), strain=strain).values)
        for strain in ("small", "finite")
    }
    of_mean = 1 / (np.sqrt(2 * RINGS) * float(means.mean()))
    assert left["finite"] * of_mean < 0.004  # a ring; continued presses and the table err by 2 to 3 parts in 1000
    assert left["small"] * of_mean > 0.015
    read = {
        strain: observe(unknown, PROBE, None, MapPrior(), strain=strain).force_n[0] for strain in ("small", "finite")
    }
    assert read["finite"] == pytest.approx(0.7, rel=4e-3)  # the same error, of all rings alike
    assert read["small"] > 0.71


@pytest.mark.parametrize(
    ("prior", "sentence"),
    [
        (MapPrior(), "force_n must lie between 0 and 0.81 N for strain 'finite'"),
        (MapPrior(thickness_mm=100.0), "prior must lie within"),
        (MapPrior(poisson=0.45), "poisson 0.49"),
    ],
)
def test_what_the_table_of_finite_strain_does_not_hold_is_refused(prior: MapPrior, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        estimate_map(scan_of([LUMP]), probe=PROBE, prior=prior, strain="finite")


def test_travel_and_force_are_of_small_strain() -> None:
    curve = ScanPress(place_mm=(0.0, 0.0), travel_force=np.array([[0.0, 0.0], [1.0, 1.0]]))
    scan = Scan(presses=(curve, replace(curve, place_mm=(9.0, 0.0))), indenter=Indenter(shape="ball", radius_mm=1.6))
    with pytest.raises(InputError, match="strain must be 'small' for pairs of travel and force"):
        estimate_map(scan, strain="finite")


def test_frames_of_the_virtual_probe_show_a_lump_under_one_place() -> None:
    """Frames of exact presses: over the lump, and on plain tissue at places out of its reach."""
    light, sensor = LightMap.uniform(), Sensor()
    lump = tsis.Inclusion(diameter_mm=10.0, depth_mm=5.0, young_kpa=50.0)
    phantom = tsis.Phantom(young_kpa=5.0, thickness_mm=30.0, inclusion=lump)
    probe = VirtualProbe(PROBE, rng=np.random.default_rng(5), sensor=sensor, light=light, strain="small")
    presses = [ScanPress(place_mm=(0.0, 0.0), frame=probe.press(phantom, force_n=1.0))]
    presses += [
        ScanPress(place_mm=place, frame=probe.press(phantom.without_inclusion(), force_n=1.0))
        for place in ((40.0, 0.0), (-40.0, 0.0), (0.0, 40.0))
    ]
    result = estimate_map(
        Scan(presses=tuple(presses)),
        probe=PROBE,
        calibration=nominal_calibration(sensor, light),
        steps=1500,
        voxel_mm=5.0,
    )
    assert [one.name for one in result.lumps] == ["lump 1"]
    inside = result.lumps[0].estimate.interval(0.98)
    for name, value in {"x_mm": 0.0, "y_mm": 0.0, "centre_depth_mm": 10.0, "diameter_mm": 10.0}.items():
        assert inside[name][0] <= value <= inside[name][1], name


def test_a_scan_of_many_presses_is_sampled_in_blocks() -> None:
    places = np.array([(x, y) for x in np.arange(0.0, 200.0, 10.0) for y in np.arange(0.0, 200.0, 10.0)])
    areas = block_areas(places)
    counts = [int(((places >= low) & (places < high)).all(axis=1).sum()) for low, high in areas]
    assert sum(counts) == len(places)
    assert max(counts) <= BLOCK


def test_a_press_more_updates_the_map(found: LumpMap) -> None:
    scan = scan_of([LUMP])
    before = estimate_map(replace(scan, presses=scan.presses[:-1]), probe=PROBE, steps=3000, voxel_mm=3.0)
    after = estimate_map(scan, probe=PROBE, steps=1000, voxel_mm=3.0, start=before)
    assert after.provenance["started_from_earlier_map"] is True
    assert len(after.places_mm) == len(scan.presses)
    (lump,), (whole,) = after.lumps, found.lumps
    for name in ("x_mm", "y_mm", "centre_depth_mm"):
        low, high = whole.estimate.interval(0.99)[name]
        assert low <= np.median(lump.estimate.samples[name]) <= high, name


def test_a_lump_of_the_start_that_the_presses_deny_is_dropped(found: LumpMap) -> None:
    assert estimate_map(scan_of([]), probe=PROBE, steps=3000, voxel_mm=3.0, start=found).lumps == ()


def test_the_likelihood_of_one_length_is_a_part_of_the_whole() -> None:
    observation = observe(scan_of([LUMP]), PROBE, None, MapPrior())
    whole = BlockLikelihood(observation, MapPrior())
    part = BlockLikelihood(observation, MapPrior(), length_mm=8.0)
    mixed = [
        [one.log_weights(observation.values)[number] for number, kind in enumerate(one.kinds) if kind.length_mm > 8]
        for one in (whole, part)
    ]
    for row in mixed[1]:
        assert min(np.abs(row - other).max() for other in mixed[0]) < 1e-6


def test_shared_errors_of_the_kernel_are_not_averaged_away() -> None:
    """A signal that errs by one factor in all presses costs little, one that errs by press costs much more."""
    observation = observe(scan_of([LUMP]), PROBE, None, MapPrior())
    likelihood = BlockLikelihood(observation, MapPrior())
    signal = likelihood.signal(as_row(LUMP))
    likelihood.with_signal_error(as_row(LUMP))
    sign = np.random.default_rng(5).choice([-1.0, 1.0], len(PLACES))
    costs = [
        float(likelihood.log_weights(0.05 * factor[:, None] * signal).max()) for factor in (np.ones(len(sign)), sign)
    ]
    assert costs[0] > costs[1] + 5


def test_a_start_that_is_no_map_is_refused() -> None:
    with pytest.raises(InputError, match="start"):
        estimate_map(scan_of([]), probe=PROBE, start=scan_of([]))  # type: ignore[arg-type]
