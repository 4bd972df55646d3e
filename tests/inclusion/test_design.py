"""What designs are said to tell, against the likelihood itself, repeats one by one, and an estimate's posterior."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.figure import Figure
from scipy.stats import multivariate_normal

import tsis
from tsis.errors import InputError, NotCalibratedError, UnknownNameError
from tsis.imaging.sensor import Sensor
from tsis.inclusion import InclusionPrior
from tsis.inclusion.design import alternatives
from tsis.inclusion.design import information as made_ready
from tsis.inclusion.design.alternatives import (
    ASPECTS,
    Design,
    calibration_for,
    compare_designs,
    design_alternatives,
    rank_designs,
    with_moduli,
)
from tsis.inclusion.design.information import (
    PlannedView,
    ProtocolInformation,
    dissertation_inclusions,
    even_inclusions,
    information_of,
    planned_view,
    protocol_information,
    view_of,
)
from tsis.inclusion.design.limits import DesignLimits, greatest_covering_force_n, limits_of
from tsis.inclusion.design.protocol import PlannedPress, Protocol, default_protocols, protocol_of
from tsis.inclusion.design.search import _binding, _Forces, at_forces, optimise_design
from tsis.inclusion.frames import largest_force_n
from tsis.inclusion.posterior.exploration import explore_inclusion
from tsis.mechanics import press
from tsis.mechanics.small_strain.linear_press import STRAIN_LIMIT, nominal_strain
from tsis.mechanics.surrogate.full_contact import FULL_CONTACT_DEGREES
from tsis.model.calibration import LightMap
from tsis.present.figures import design_errors
from tsis.virtual.probe import nominal_calibration

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.mechanics.surrogate.full_contact import FullContactSurrogate
    from tsis.model.calibration import Calibration


FLAT, DOMED = tsis.load_probe("tsis-2011"), tsis.load_probe("tsis-domed")
PRIOR, SENSOR = InclusionPrior(), Sensor()
ANSWER = nominal_calibration(SENSOR)
ALONE, REFERRED, TWO_FORCES = default_protocols()
SOFT, STIFF = np.array([10.0, 5.0, 40.0]), np.array([10.0, 5.0, 100.0])


@pytest.fixture(scope="module")
def views(flat: FullContactSurrogate, domed: FullContactSurrogate) -> dict[str, PlannedView]:
    return {
        protocol.name: ready(protocol, flat if protocol.probe is ALONE.probe else domed)
        for protocol in default_protocols()
    }


def ready(protocol: Protocol, surrogate: FullContactSurrogate, calibration: Calibration = ANSWER) -> PlannedView:
    return view_of(protocol, surrogate, prior=PRIOR, calibration=calibration, sensor=SENSOR)


def test_information_is_the_curvature_of_the_likelihood(views: dict[str, PlannedView]) -> None:
    """Of the dense normal density of the frames, whose covariance is put together entry by entry."""
    view, at = views[TWO_FORCES.name], np.array([9.0, 6.0, 70.0])
    known, count = view.model.calibration, view.count
    grey, slopes = view.model.profiles(at[None], view.start)
    mean, slope = grey[0].ravel(), slopes[0].reshape(-1, len(view.start))
    frames, rings = grey[0].shape
    alike, noise = view.model.correlation, np.zeros((mean.size, mean.size))
    assert alike is not None
    for i, j in np.ndindex(mean.size, mean.size):
        both = alike[i % rings, j % rings] * mean[i] * mean[j]
        noise[i, j] = known.pattern_sd**2 * both
        if i // rings == j // rings:
            noise[i, j] += known.repeatability_sd**2 * both
        if i == j:
            pixel = known.read_noise_grey**2 + known.shot_noise_grey * mean[i] + 1 / 12
            noise[i, i] += pixel / count[i % rings] + (made_ready.MODEL_ERROR * mean[i]) ** 2
    sd = view.model.nuisance_sd(grey[0].mean(axis=1))
    covariance = noise + slope @ np.diag(sd**2) @ slope.T
    step = np.array([0.02, 0.01, 0.5])

    def log_density(inclusion: NDArray[np.float64]) -> float:
        return float(multivariate_normal(mean, covariance).logpdf(view.model.grey(inclusion[None], view.start).ravel()))

    found = view.information(at)
    for i, j in np.ndindex(3, 3):
        e, f = step * np.eye(3)[i], step * np.eye(3)[j]
        corners = [log_density(at + a * e + b * f) for a, b in ((1, 1), (1, -1), (-1, 1), (-1, -1))]
        curvature = -(corners[0] - corners[1] - corners[2] + corners[3]) / (4 * step[i] * step[j])
        assert found[i, j] == pytest.approx(curvature, abs=float(0.01 * np.sqrt(found[i, i] * found[j, j])))
    assert frames == 4


@pytest.mark.parametrize("frames", [2, 5])
def test_the_mean_of_repeats_says_what_the_repeats_say(
    domed: FullContactSurrogate, monkeypatch: pytest.MonkeyPatch, frames: int
) -> None:
    monkeypatch.setattr(made_ready, "MODEL_ERROR", 0.0)  # which no repeat averages away
    at_once = ready(replace(TWO_FORCES, frames_each=frames), domed)
    one_by_one = ready(replace(TWO_FORCES, presses=TWO_FORCES.presses * frames), domed)
    for inclusion in (SOFT, STIFF):
        found, expected = at_once.information(inclusion), one_by_one.information(inclusion)
        scale = np.sqrt(np.outer(expected.diagonal(), expected.diagonal()))
        np.testing.assert_allclose(found / scale, expected / scale, atol=1e-6)
        assert (found.diagonal() > 1.1 * ready(TWO_FORCES, domed).information(inclusion).diagonal()).all()


def least_gain(more: NDArray[np.float64], less: NDArray[np.float64]) -> float:
    """Smallest eigenvalue of what is gained, over the largest of what there is: not negative where nothing is lost."""
    scale = np.sqrt(np.outer(more.diagonal(), more.diagonal()))
    return float(np.linalg.eigvalsh((more - less) / scale).min())


@pytest.mark.slow
@settings(max_examples=25)
@given(
    unit=st.tuples(*3 * [st.floats(0.01, 0.99)]),
    force=st.floats(0.2, 1.0),
    frames=st.integers(1, 20),
    error=st.sampled_from(["gain_sd", "force_sd", "offset_sd", "pattern_sd", "repeatability_sd", "site_sd"]),
    factor=st.floats(1.05, 5.0),
)
def test_more_presses_and_less_noise_never_tell_less(
    domed: FullContactSurrogate, unit: tuple[float, ...], force: float, frames: int, error: str, factor: float
) -> None:
    at = PRIOR.low + np.array(unit) * (PRIOR.high - PRIOR.low)
    planned = protocol_of(DOMED, (force,), with_reference=False)
    start = ready(planned, domed).information(at)
    (one,) = planned.presses
    richer = {
        "repeated": replace(planned, frames_each=frames + 1),
        "referred": replace(planned, presses=(replace(one, with_reference=True),)),
        "second force": replace(planned, presses=(one, replace(one, force_n=0.5 * force))),
    }
    for name, other in richer.items():
        assert least_gain(ready(other, domed).information(at), start) > -1e-6, name
    noisier = replace(ANSWER, **{error: factor * getattr(ANSWER, error)})
    assert least_gain(start, ready(planned, domed, noisier).information(at)) > -1e-6


def test_two_forces_tell_the_modulus_under_a_dome_alone(
    flat: FullContactSurrogate, domed: FullContactSurrogate
) -> None:
    """A flat press at another force is a repeat; a dome loads the tissue in another way."""

    def least_sd(protocol: Protocol) -> float:
        surrogate = flat if protocol.probe == FLAT else domed
        return float(information_of(ready(protocol, surrogate), SOFT[None]).cramer_rao_sd[0, 2])

    def repeated(probe: tsis.Probe) -> float:
        return min(least_sd(replace(protocol_of(probe, (force,)), frames_each=2)) for force in (0.5, 1.0))

    assert least_sd(protocol_of(FLAT, (0.5, 1.0))) == pytest.approx(repeated(FLAT), rel=0.05)
    assert least_sd(TWO_FORCES) < 0.4 * repeated(DOMED)
    assert least_sd(TWO_FORCES) < 0.8 * least_sd(protocol_of(FLAT, (0.5, 1.0)))


@pytest.mark.parametrize("at", [(10.0, 5.0, 60.0), (10.0, 5.0, 40.5), (13.0, 4.5, 50.0), (14.0, 8.0, 70.0)])
def test_expected_errors_are_those_of_a_posterior(views: dict[str, PlannedView], at: tuple[float, ...]) -> None:
    """Of noiseless frames, that an estimate explores without taking anything as normal."""
    view, inclusion = views[TWO_FORCES.name], np.array(at)
    expected = information_of(view, inclusion[None]).expected_sd[0]
    found = explore_inclusion(view.likelihood(inclusion), PRIOR)
    np.testing.assert_allclose(found.samples.std(axis=0), expected, rtol=0.25)


def told_by(matrix: NDArray[np.float64], at: NDArray[np.float64]) -> ProtocolInformation:
    return ProtocolInformation(inclusions=np.tile(at, (len(matrix), 1)), matrix=matrix, prior=PRIOR)


def test_expected_errors_of_sharp_presses_are_those_of_a_normal_posterior() -> None:
    rng, at = np.random.default_rng(1), np.array([8.0, 8.0, 80.0])
    root = rng.standard_normal((5, 3, 3)) / [0.5, 0.5, 1.0] + np.diag([3.0, 3.0, 5.0])
    matrix = np.swapaxes(root, 1, 2) @ root
    result = told_by(matrix, at)
    before = np.diag(np.array([PRIOR.sd["diameter_mm"], PRIOR.sd["depth_mm"], np.inf]) ** -2)
    by_hand = np.array([np.sqrt(np.diag(np.linalg.inv(one + before))) for one in matrix])
    assert by_hand[:, 2].max() < 3.0, "the range of the modulus must not matter"
    np.testing.assert_allclose(result.expected_sd, by_hand, rtol=0.02)
    bound = [np.sqrt(np.diag(np.linalg.inv(one))) for one in matrix]
    np.testing.assert_allclose(result.cramer_rao_sd, bound, rtol=1e-6)
    np.testing.assert_allclose(list(result.rmse.values()), np.sqrt((result.expected_sd**2).mean(axis=0)))
    assert result.log_sd == pytest.approx(np.log(result.expected_sd / list(PRIOR.sd.values())).sum() / 5)
    assert result.identified_fraction == 1.0


def test_what_no_press_tells_keeps_its_prior() -> None:
    result = told_by(np.array([np.zeros((3, 3)), np.diag([1 / 9.0, 0.0, 4.0])]), np.array([8.0, 8.0, 80.0]))
    np.testing.assert_allclose(result.expected_sd[0], list(PRIOR.sd.values()), rtol=2e-3)
    assert result.expected_sd[1, 0] == pytest.approx(1 / np.sqrt(1 / 9.0 + PRIOR.sd["diameter_mm"] ** -2))
    assert result.expected_sd[1, 1] == pytest.approx(PRIOR.sd["depth_mm"])
    assert result.expected_sd[1, 2] == pytest.approx(0.5, rel=0.01)
    assert np.isinf(result.cramer_rao_sd).all()
    assert result.identified_fraction == 0.5


def test_inclusions_are_spread_evenly() -> None:
    found = (even_inclusions(PRIOR) - PRIOR.low) / (PRIOR.high - PRIOR.low)
    assert found.shape == (64, 3)
    for column in found.T:
        np.testing.assert_allclose(np.sort(column), (np.arange(64) + 0.5) / 64, atol=1e-9)
    assert np.abs(np.corrcoef(found.T) - np.eye(3)).max() < 0.05
    assert ((dissertation_inclusions() >= PRIOR.low) & (dissertation_inclusions() <= PRIOR.high)).all()
    assert len(np.unique(dissertation_inclusions(), axis=0)) == 9


def test_limits_are_those_of_a_press(views: dict[str, PlannedView]) -> None:
    """Against presses on another mesh."""
    view = views[TWO_FORCES.name]
    found = limits_of(view, even_inclusions(PRIOR))
    plain = tsis.Phantom(young_kpa=5.0, thickness_mm=30.0)
    field = press(DOMED, plain, force_n=1.0)
    assert found.strain == pytest.approx(nominal_strain(field.approach_mm, DOMED, 30.0), rel=0.01)
    assert press(DOMED, plain, force_n=1.03 * found.covering_force_n).pressure_kpa[-2] > 0
    assert press(DOMED, plain, force_n=0.97 * found.covering_force_n).pressure_kpa[-2] == 0
    assert (found.read_mm, found.view_mm) == pytest.approx((19.2, 492 * 0.0392))
    assert not found.broken
    assert 0.5 < found.whole_fraction < 1.0
    most = largest_force_n(view.surrogate, probe=view.protocol.probe, prior=view.model.prior)
    strongest = limits_of(at_forces(view, (0.2, 1.01 * most)), even_inclusions(PRIOR))
    assert set(strongest.broken) == {"strain", "contact", "saturation"}
    assert strongest.strain == pytest.approx(STRAIN_LIMIT, rel=0.02)
    narrow = replace(view, sensor=replace(SENSOR, rows=480))
    assert set(limits_of(narrow, SOFT[None]).broken) == {"view"}
    assert greatest_covering_force_n(view, np.array([STIFF])) > found.covering_force_n


def test_clipped_rings_tell_nothing(views: dict[str, PlannedView]) -> None:
    view = views[ALONE.name]
    clipped = replace(view, sensor=replace(SENSOR, full_scale=float(view.grey(SOFT[None]).min()) - 1.0))
    assert not clipped.information(SOFT).any()


@pytest.mark.parametrize("aspect", ASPECTS)
def test_alternatives_change_one_thing(aspect: str) -> None:
    found = design_alternatives(TWO_FORCES, aspect)  # type: ignore[arg-type]
    assert len({one.name for one in found}) == len(found) > 0

    def parts(one: Protocol) -> dict[str, object]:
        return {
            "softness": tuple(layer.young_kpa for layer in one.probe.layers),
            "dome": one.probe.face_curvature_mm,
            "forces": one.forces_n,
            "frames": one.frames_each,
            "reference": one.has_reference,
        }

    expected = "softness" if aspect == "layers" else aspect
    for other in found:
        before, after = parts(TWO_FORCES), parts(other)
        assert {name for name in before if before[name] != after[name]} == {expected}


def test_layers_of_one_modulus_give_way_as_the_graded_ones() -> None:
    even = design_alternatives(REFERRED, "layers")[0].probe
    assert sum(one.thickness_mm / one.young_kpa for one in even.layers) == pytest.approx(
        sum(one.thickness_mm / one.young_kpa for one in FLAT.layers)
    )


def test_a_stiffer_skin_saturates_later() -> None:
    stiffer = with_moduli(FLAT, [3 * layer.young_kpa for layer in FLAT.layers])
    found = calibration_for(stiffer, of=FLAT, calibration=replace(ANSWER, probe="tsis-2011"))
    assert found.saturation_kpa == 3 * ANSWER.saturation_kpa
    assert found.gain_grey_per_kpa == ANSWER.gain_grey_per_kpa


@pytest.mark.usefixtures("domed")
@pytest.mark.parametrize("before", [None, 0.5])
def test_traced_light_keeps_the_grey_level_of_the_brightest_place(
    monkeypatch: pytest.MonkeyPatch, before: float | None
) -> None:
    traced = replace(LightMap.uniform(), relative=np.full((2, 2), 4.0))
    monkeypatch.setattr(alternatives, "irradiance", lambda _: SimpleNamespace(near_undented=lambda: traced))
    known = None if before is None else replace(LightMap.uniform(), relative=np.full((2, 2), before))
    found = calibration_for(FLAT, of=FLAT, calibration=replace(ANSWER, light=known), traced=True)
    assert found.light is traced
    assert found.gain_grey_per_kpa * 4.0 == pytest.approx(ANSWER.gain_grey_per_kpa * (before or 1.0))


def test_the_best_come_first_and_broken_ones_last() -> None:
    calls: list[tuple[int, int]] = []
    planned = [TWO_FORCES, *design_alternatives(TWO_FORCES, "forces"), *design_alternatives(TWO_FORCES, "frames")]
    found = compare_designs(
        planned,
        of=DOMED,
        prior=PRIOR,
        calibration=ANSWER,
        degrees=FULL_CONTACT_DEGREES,  # those of the fixture, which is on disk
        progress=lambda done, total: calls.append((done, total)),
    )
    assert [one.protocol for one in found] == planned
    assert calls[-1] == (len(planned), len(planned))
    order = rank_designs(found, "depth_mm")
    broken = [bool(one.limits.broken) for one in order]
    assert broken == sorted(broken)
    assert any(broken)
    errors = [one.information.rmse["depth_mm"] for one in order if not one.limits.broken]
    assert errors == sorted(errors)
    assert order[0].protocol.frames_each == 16


def test_few_degrees_tell_what_many_tell(flat: FullContactSurrogate) -> None:
    some = even_inclusions(PRIOR, 16)
    coarse = protocol_information(REFERRED, prior=PRIOR, calibration=ANSWER, inclusions=some).rmse
    fine = information_of(ready(REFERRED, flat), some).rmse
    assert list(coarse.values()) == pytest.approx(list(fine.values()), rel=0.05)


@pytest.mark.parametrize("offset_sd_mm", [0.3, 2.0])
def test_a_plan_knows_the_place_of_an_inclusion_as_its_frames_will(
    domed: FullContactSurrogate, offset_sd_mm: float
) -> None:
    """The spread is that of the squared distance from the axis, drawn here; frames locate an inclusion to 0.5 mm."""
    prior = replace(PRIOR, offset_sd_mm=offset_sd_mm)
    view = view_of(TWO_FORCES, domed, prior=prior, calibration=ANSWER, sensor=SENSOR)
    places = np.random.default_rng(1).normal(scale=min(offset_sd_mm, 0.5), size=(100_000, 2))
    assert view.model.spread_sd == pytest.approx((places**2).sum(axis=1).std(), rel=0.03)


def test_a_search_of_one_stack_changes_the_force_alone() -> None:
    found = optimise_design(
        protocol_of(FLAT, (0.3,)), prior=PRIOR, calibration=ANSWER, evaluations=1, degrees=FULL_CONTACT_DEGREES
    )
    assert (found.stiffening, found.gradient, found.evaluations) == (1.0, 1.0, 1)
    assert found.best.protocol.probe.layers == FLAT.layers
    assert found.best.information.log_sd < found.planned.information.log_sd
    assert not found.best.limits.broken


@pytest.mark.slow
def test_the_search_betters_the_plan_within_the_limits() -> None:
    planned = protocol_of(FLAT, (0.3,))
    calls: list[tuple[int, int]] = []
    found = optimise_design(
        planned,
        prior=PRIOR,
        calibration=ANSWER,
        evaluations=4,
        progress=lambda done, total: calls.append((done, total)),
    )
    assert found.best.information.log_sd < found.planned.information.log_sd - 0.01
    assert not found.best.limits.broken
    assert found.evaluations == 4
    assert calls[-1] == (4, 4)
    young = np.array([layer.young_kpa for layer in found.best.protocol.probe.layers])
    grown = young / [layer.young_kpa for layer in FLAT.layers]
    # Layers of 2, 3 and 5 mm: their middles lie at 0.1, 0.35 and 0.75 of the stack.
    np.testing.assert_allclose(grown, found.stiffening * found.gradient ** np.array([0.4, 0.15, -0.25]))


def test_wrong_input_is_refused_in_one_sentence() -> None:
    with pytest.raises(InputError, match=r"^force_n must lie in \[0.001, 50\]; got -1 \(newtons\)$"):
        PlannedPress(force_n=-1.0)
    with pytest.raises(InputError, match=r"^with_reference must be a bool; got 1$"):
        PlannedPress(force_n=1.0, with_reference=1)  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"^presses must be a tuple of at least one PlannedPress; got \(\)$"):
        Protocol(probe=FLAT, presses=())
    with pytest.raises(InputError, match=r"^frames_each must lie in \[1, 1000\]; got 0$"):
        replace(ALONE, frames_each=0)
    with pytest.raises(InputError, match="inclusions must hold diameter, depth and modulus within the prior's ranges"):
        protocol_information(ALONE, prior=PRIOR, calibration=ANSWER, inclusions=np.array([[20.0, 5.0, 50.0]]))
    with pytest.raises(NotCalibratedError, match=r"calibration must be a Calibration, .*; got None"):
        protocol_information(ALONE, prior=PRIOR, calibration=None)  # type: ignore[arg-type]
    with pytest.raises(NotCalibratedError, match="calibration must be that of the probe 'tsis-2011'"):
        planned_view(ALONE, prior=PRIOR, calibration=replace(ANSWER, probe="tsis-domed"))
    with pytest.raises(UnknownNameError, match="no aspect is called 'colour'"):
        design_alternatives(ALONE, "colour")  # type: ignore[arg-type]
    with pytest.raises(UnknownNameError, match="no criterion is called 'speed'"):
        optimise_design(ALONE, prior=PRIOR, calibration=ANSWER, criterion="speed")
    with pytest.raises(InputError, match=r"evaluations must lie in \[1, 25\]; got 26"):
        optimise_design(ALONE, prior=PRIOR, calibration=ANSWER, evaluations=26)


@pytest.mark.usefixtures("domed")
def test_designs_are_drawn_where_their_errors_are() -> None:
    found = compare_designs(
        [TWO_FORCES, *design_alternatives(TWO_FORCES, "forces")],
        of=DOMED,
        prior=PRIOR,
        calibration=ANSWER,
        degrees=FULL_CONTACT_DEGREES,
    )
    ax = Figure().subplots()
    assert design_errors(found, ("depth_mm", "young_kpa"), ax) is ax
    assert len(ax.lines) == len(ax.texts) == len(found)
    for line, text, design in zip(ax.lines, ax.texts, found, strict=True):
        errors = design.information.rmse
        x, y = (np.asarray(part, dtype=float) for part in line.get_data())
        np.testing.assert_allclose([*x, *y], [errors["depth_mm"], errors["young_kpa"]])
        assert line.get_marker() == ("x" if design.limits.broken else "o")
        assert line.get_label() == f"{text.get_text()}  {design.protocol.name}"
    assert ax.get_ylabel() == "expected error of modulus E / kPa"


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
