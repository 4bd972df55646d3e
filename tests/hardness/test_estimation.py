"""The estimate of a modulus: what comes out, what is flagged and what is refused."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tests.hardness.stand_ins import by_table, hertzian_field, wrong_by

import tsis
from tsis.catalog.phantoms import load_sphere
from tsis.errors import ImageMismatchError, InputError, NotCalibratedError
from tsis.hardness import estimate
from tsis.hardness.posterior import HardnessPrior
from tsis.hardness.table import build_contact_table
from tsis.mechanics.finite_strain.soft_sphere import SphereResolution
from tsis.model.phantom import SoftSphere
from tsis.virtual.direct_contact import DirectContactRig

if TYPE_CHECKING:
    from collections.abc import Callable

    from tsis.model.estimate import Estimate
    from tsis.model.image import TactileImage

PROBE = tsis.load_probe("tsis-direct")
SPHERE = load_sphere("cl2000x")
BALL = SoftSphere(radius_mm=3.0, young_kpa=3e5, poisson=0.3, name="ball")
FORCES = (0.7, 1.2)


def rig_of(seed: int = 1, **options: Any) -> DirectContactRig:
    given: dict[str, Any] = {"solve": by_table}
    return DirectContactRig(PROBE, rng=np.random.default_rng(seed), **given | options)


RIG = rig_of()


@cache
def frames() -> tuple[TactileImage, ...]:
    return RIG.press_path(SPHERE, forces_n=FORCES)


def found(images: Any = None, **options: Any) -> Estimate:
    known: dict[str, Any] = {"probe": PROBE, "calibration": RIG.calibration}
    return estimate(frames() if images is None else images, **known | options)


@cache
def usual() -> Estimate:
    """The estimate of these frames without further choices, computed once."""
    return found()


def test_the_rigs_frames_need_two_keywords() -> None:
    answer = usual()
    low, high = answer.interval(0.9)["young_kpa"]
    assert low < 103.0 < high
    assert answer.trusted
    assert answer.flags == ()
    assert answer.narrowing["young_kpa"] < 0.1
    assert answer.provenance["notice"].startswith("Research use only")


def test_a_solved_press_gives_its_modulus() -> None:
    coarse = SphereResolution(order=3, cells=4, rings=2, face_cells=4)
    rig = DirectContactRig(PROBE, rng=np.random.default_rng(3), resolution=coarse)
    sphere = SoftSphere(radius_mm=3.2, young_kpa=240.0, poisson=0.465)
    answer = estimate(rig.press_path(sphere, forces_n=FORCES), probe=PROBE, calibration=rig.calibration)
    assert answer.trusted
    assert answer.mean["young_kpa"] == pytest.approx(240.0, abs=3 * answer.sd["young_kpa"])
    assert answer.sd["young_kpa"] < 0.06 * 240.0


def test_the_same_frames_give_the_same_samples() -> None:
    np.testing.assert_array_equal(found().samples["young_kpa"], usual().samples["young_kpa"])


def test_the_order_of_the_frames_does_not_matter() -> None:
    assert found(frames()[::-1]).mean["young_kpa"] == pytest.approx(usual().mean["young_kpa"], rel=1e-6)


def test_small_contacts_on_a_stiff_probe_follow_hertz() -> None:
    layers = tuple(replace(layer, young_kpa=500 * layer.young_kpa) for layer in PROBE.layers)
    stiff = replace(PROBE, layers=layers, name="")
    images: list[TactileImage] = []
    for force in (0.05, 0.1):
        contact = (3 * 1e3 * force * 3.0 * (1 - 0.4725**2) / (4 * 200.0)) ** (1 / 3)

        def solve(probe: Any, sphere: Any, *, forces_n: Any, resolution: Any, contact: float = contact) -> Any:
            del sphere, resolution
            return [hertzian_field(probe, contact, one) for one in forces_n]

        rig = DirectContactRig(stiff, rng=np.random.default_rng(1), solve=solve, radius_sd_mm=0.0)
        images += rig.press_path(replace(SPHERE, young_kpa=200.0), forces_n=[force])
    answer = estimate(images, probe=stiff, calibration=rig.calibration)
    assert answer.mean["young_kpa"] == pytest.approx(200.0, rel=0.06)


def test_a_rigid_ball_narrows_the_modulus_on_a_soft_probe() -> None:
    soft = tsis.load_probe("tsis-2011")
    rig = DirectContactRig(soft, rng=np.random.default_rng(2), solve=by_table)
    images = rig.press_path(replace(SPHERE, young_kpa=300.0), forces_n=FORCES)
    balls = rig.solved_by(by_table, radius_sd_mm=0.003).press_path(BALL, forces_n=FORCES)
    alone = estimate(images, probe=soft, calibration=rig.calibration)
    pinned = estimate(images, probe=soft, calibration=rig.calibration, reference=balls)
    assert pinned.sd["young_kpa"] < 0.8 * alone.sd["young_kpa"]


@pytest.mark.slow
def test_intervals_hold_where_the_table_errs_as_it_says() -> None:
    rng, table, inside = np.random.default_rng(5), build_contact_table(PROBE), 0
    for case in range(120):
        common, own = rng.standard_normal(), rng.standard_normal(2)
        young = float(np.exp(rng.uniform(np.log(45.0), np.log(500.0))))
        error = table.error_at(*table.coordinates(young, 0.475, 3.1, 1.0))
        off = error * (np.sqrt(0.5) * common + np.sqrt(0.5) * own)
        rig = rig_of(100 + case, solve=wrong_by(off.tolist()))
        sphere = SoftSphere(radius_mm=3.1, young_kpa=young, poisson=float(rng.uniform(0.45, 0.495)))
        answer = estimate(rig.press_path(sphere, forces_n=FORCES), probe=PROBE, calibration=rig.calibration)
        low, high = answer.untrusted.interval(0.9)["young_kpa"]
        inside += low < young < high
    assert 98 <= inside <= 117  # 90 % of 120 within three standard deviations


def test_one_force_is_flagged() -> None:
    assert "one_force" in found(frames()[:1]).flags
    twice = rig_of(4).press_path(SPHERE, forces_n=[0.7, 0.7])
    assert "one_force" in found(twice).flags


def bare(images: Any) -> list[TactileImage]:
    return [replace(image, settings={}) for image in images]


def test_an_unknown_radius_is_flagged_and_tells_little() -> None:
    answer = found(bare(frames()))
    assert "radius_unknown" in answer.flags
    assert answer.sd["young_kpa"] > 4 * usual().sd["young_kpa"]
    low, high = answer.interval(0.9)["young_kpa"]
    assert low < 103.0 < high


def test_the_argument_goes_before_what_the_frames_say() -> None:
    assert found(radius_mm=3.3).mean["young_kpa"] > found(radius_mm=3.0).mean["young_kpa"]
    assert found(radius_sd_mm=0.25).sd["young_kpa"] > 2 * usual().sd["young_kpa"]


def test_a_radius_known_too_poorly_is_refused() -> None:
    with pytest.raises(InputError, match=r"radius_sd_mm must lie in .* a tenth of the radius"):
        found(radius_mm=4.0, radius_sd_mm=1.9)


def test_contacts_that_do_not_grow_as_a_spheres_do_not_fit() -> None:
    answer = found(rig_of(2, solve=wrong_by([-0.05, 0.05])).press_path(SPHERE, forces_n=FORCES))
    assert "model_does_not_fit" in answer.flags
    assert not answer.trusted


def test_light_that_contradicts_the_gauge_does_not_fit() -> None:
    answer = found([replace(image, force_n=1.3 * (image.force_n or 0.0)) for image in frames()])
    assert "model_does_not_fit" in answer.flags


def test_a_clipped_contact_is_not_trusted() -> None:
    answer = found([replace(image, grey=np.minimum(image.grey, 40.0), full_scale=40.0) for image in frames()])
    assert "saturated" in answer.flags
    assert not answer.trusted


def test_a_flattened_sphere_is_outside_the_table() -> None:
    soft = rig_of(6).press_path(replace(SPHERE, young_kpa=20.0), forces_n=FORCES)
    answer = found(soft)
    assert "outside_table" in answer.flags
    assert not answer.trusted


def test_a_prior_that_cuts_off_is_said() -> None:
    answer = found(prior=HardnessPrior(young_kpa=(150.0, 900.0)))
    assert "young_kpa_cut_off" in answer.flags


def test_an_oval_contact_is_no_sphere() -> None:
    wide = [replace(image, mm_per_pixel=(0.0336, 0.046)) for image in frames()]
    assert "not_round" in found(wide).flags


@pytest.mark.parametrize(
    ("images", "options", "error", "words"),
    [
        (list, {}, InputError, "at least one TactileImage"),
        (lambda: [3], {}, InputError, "images must hold TactileImage values; got int"),
        (lambda: [replace(frames()[0], force_n=None)], {}, InputError, "force_n must be known"),
        (lambda: [replace(frames()[0], mm_per_pixel=None)], {}, InputError, "mm_per_pixel is not known"),
        (lambda: [frames()[0], frames()[0]], {}, InputError, "given twice"),
        (lambda: [frames()[0], replace(frames()[1], mm_per_pixel=(0.03, 0.03))], {}, ImageMismatchError, "must share"),
        (frames, {"probe": tsis.load_probe("tsis-domed")}, NotCalibratedError, "must be that of the probe"),
        (frames, {"calibration": None}, NotCalibratedError, "must be a Calibration"),
        (frames, {"radius_mm": 8.0}, InputError, "smaller than the probe"),
        (frames, {"radius_mm": float("nan")}, InputError, "radius_mm must lie in"),
        (frames, {"radius_sd_mm": -1.0}, InputError, "radius_sd_mm must lie in"),
        (frames, {"blur_mm": 2.0}, InputError, "blur_mm must lie in"),
    ],
)
def test_wrong_input_is_refused(
    images: Callable[[], Any], options: dict[str, Any], error: type[Exception], words: str
) -> None:
    with pytest.raises(error, match=words):
        found(images(), **options)


def test_frames_of_object_and_ball_are_not_the_same() -> None:
    with pytest.raises(InputError, match="given twice"):
        found(reference=bare(frames()))


def test_a_ball_of_unknown_radius_is_refused() -> None:
    balls = bare(rig_of(8).press_path(BALL, forces_n=FORCES))
    with pytest.raises(InputError, match="reference_radius_mm"):
        found(reference=balls)


def test_frames_of_another_probe_are_refused() -> None:
    other = replace(frames()[0], settings={"probe": "tsis-2011"})
    with pytest.raises(ImageMismatchError, match="was taken with 'tsis-2011'"):
        found([other])


def test_two_objects_are_refused() -> None:
    other = replace(frames()[0], settings={**frames()[0].settings, "radius_mm": 2.0})
    with pytest.raises(ImageMismatchError, match="of one object"):
        found([other, frames()[1]])


def test_a_prior_must_ascend() -> None:
    with pytest.raises(InputError, match="range that ascends"):
        HardnessPrior(young_kpa=(100.0, 100.0))
