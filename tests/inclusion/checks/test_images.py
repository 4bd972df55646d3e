"""Pictures that must not end in a number: refused, or flagged with the reason."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import tsis
from tsis.errors import InputError
from tsis.inclusion.checks.images import image_findings, require_forces_as_lit
from tsis.model.image import TactileImage
from tsis.virtual.probe import VirtualProbe

PROBE = tsis.load_probe("tsis-2011")
PLAIN = tsis.load_phantom("plain")


@pytest.fixture(scope="module")
def virtual() -> VirtualProbe:
    return VirtualProbe(PROBE, rng=np.random.default_rng(1), strain="small")


@pytest.fixture(scope="module")
def pair(virtual: VirtualProbe) -> tuple[TactileImage, TactileImage]:
    return virtual.press(tsis.load_phantom("size-8"), force_n=1.0), virtual.press(PLAIN, force_n=1.0)


def findings(virtual: VirtualProbe, target: TactileImage, *references: TactileImage) -> dict[str, str]:
    return dict(image_findings([target], references, probe=PROBE, calibration=virtual.calibration))


def cut(frame: TactileImage, *, rows: slice) -> TactileImage:
    x, y = frame.axis()
    return replace(frame, grey=frame.grey[rows], axis_px=(x, y - (rows.start or 0)))


def test_a_good_pair_says_nothing(virtual: VirtualProbe, pair: tuple[TactileImage, TactileImage]) -> None:
    assert findings(virtual, *pair) == {}
    assert findings(virtual, pair[0]) == {}


def test_an_untouched_probe_is_refused_with_frame_level_and_cure(virtual: VirtualProbe) -> None:
    untouched = replace(virtual.no_contact(), force_n=1.0)
    with pytest.raises(InputError, match=r"'no contact' shows -?0\.0\d* grey levels above the background of 8.*press"):
        findings(virtual, untouched)


def test_so_it_is_as_the_reference(virtual: VirtualProbe, pair: tuple[TactileImage, TactileImage]) -> None:
    with pytest.raises(InputError, match="'no contact'"):
        findings(virtual, pair[0], replace(virtual.no_contact(), force_n=1.0))


@pytest.mark.parametrize("grey", [0.0, 8.0, 9.0])
def test_a_black_frame_is_refused(virtual: VirtualProbe, pair: tuple[TactileImage, TactileImage], grey: float) -> None:
    with pytest.raises(InputError, match="lights at least 4 of 12 rings"):
        findings(virtual, replace(pair[0], grey=np.full_like(pair[0].grey, grey)))


@pytest.mark.parametrize("noise", [0.0, 1.5])
def test_an_even_frame_is_refused(virtual: VirtualProbe, pair: tuple[TactileImage, TactileImage], noise: float) -> None:
    grey = 90 + noise * np.random.default_rng(2).standard_normal(pair[0].grey.shape)
    with pytest.raises(InputError, match=r"uniform over the face, 90 grey levels"):
        findings(virtual, replace(pair[0], grey=grey))


def test_a_press_too_light_to_see_is_refused_and_one_that_is_seen_is_not(virtual: VirtualProbe) -> None:
    with pytest.raises(InputError, match="'plain' shows"):
        findings(virtual, virtual.press(PLAIN, force_n=0.01))
    assert findings(virtual, virtual.press(PLAIN, force_n=0.2)) == {}


def test_a_spot_is_no_press(virtual: VirtualProbe, pair: tuple[TactileImage, TactileImage]) -> None:
    grey = np.full_like(pair[0].grey, 8.0)
    grey[220:270, 360:410] = 100.0
    with pytest.raises(InputError, match="lights at least 4 of 12 rings"):
        findings(virtual, replace(pair[0], grey=grey))


def test_a_frame_far_darker_than_its_force_is_refused(
    virtual: VirtualProbe, pair: tuple[TactileImage, TactileImage]
) -> None:
    with pytest.raises(InputError, match=r"where 1 N should give about 34: check contact"):
        findings(virtual, replace(pair[0], grey=8 + 0.15 * (pair[0].grey - 8)))


def test_a_frame_whose_force_is_not_known_is_not_judged_by_it(
    virtual: VirtualProbe, pair: tuple[TactileImage, TactileImage]
) -> None:
    dark = replace(pair[0], grey=8 + 0.15 * (pair[0].grey - 8), force_n=None)
    assert findings(virtual, dark) == {}


@pytest.mark.parametrize("probe", ["tsis-2011", "tsis-domed"])
@pytest.mark.parametrize("force_n", [0.25, 2.0])
def test_presses_of_any_strength_are_as_bright_as_their_force(probe: str, force_n: float) -> None:
    pressing = tsis.load_probe(probe)
    virtual = VirtualProbe(pressing, rng=np.random.default_rng(3), strain="small")
    frame = virtual.press(PLAIN, force_n=force_n)
    found = image_findings([frame], [], probe=pressing, calibration=virtual.calibration)
    assert {flag for flag, _ in found} <= {"saturated", "roundness_not_checked"}


def test_clipped_pixels_are_counted_inside_the_disc_alone(
    virtual: VirtualProbe, pair: tuple[TactileImage, TactileImage]
) -> None:
    assert findings(virtual, replace(pair[0], full_scale=pair[0].grey.max() + 1)) == {}
    level = float(np.quantile(pair[0].grey, 0.99))
    clipped = replace(pair[0], grey=np.minimum(pair[0].grey, level), full_scale=level)
    radius = virtual.sensor.radius_mm()
    inside = radius < 0.8 * PROBE.radius_mm
    share = (clipped.grey >= level)[inside].mean()
    sentence = findings(virtual, clipped)["saturated"]
    assert f"{100 * share:.2g} % of the profile's pixels" in sentence
    corner = np.where(radius > 11.5, 255.0, pair[0].grey)
    assert "saturated" not in findings(virtual, replace(pair[0], grey=corner))


def test_the_worst_of_several_frames_is_named(virtual: VirtualProbe, pair: tuple[TactileImage, TactileImage]) -> None:
    target, plain = pair
    hot = plain.grey.copy()
    hot[240:250, 380:390] = 255.0
    found = findings(virtual, target, replace(plain, grey=hot, name="the hot one"))
    assert "'the hot one'" in found["saturated"]


@pytest.mark.parametrize(("top", "kept"), [(60, {"cropped"}), (160, {"cropped", "roundness_not_checked"})])
def test_a_face_that_leaves_the_picture_is_flagged_with_its_share(
    virtual: VirtualProbe, pair: tuple[TactileImage, TactileImage], top: int, kept: set[str]
) -> None:
    reach = 0.8 * PROBE.radius_mm
    distance = (245.5 - top + 0.5) * virtual.sensor.mm_per_pixel[1]
    missing = (np.arccos(distance / reach) - distance / reach * np.sqrt(1 - (distance / reach) ** 2)) / np.pi
    found = findings(virtual, *(cut(frame, rows=slice(top, None)) for frame in pair))
    assert set(found) == kept
    stated = float(found["cropped"].split(" %")[0])
    assert stated == pytest.approx(100 * missing, abs=0.1, rel=0.06)


@given(top=st.integers(255, 400))
def test_less_than_half_of_the_inner_face_is_refused(top: int) -> None:
    frame = TactileImage(grey=np.zeros((492, 768)), mm_per_pixel=(0.0336, 0.0392), force_n=1.0)
    known = VirtualProbe(PROBE, rng=np.random.default_rng(1), strain="small").calibration
    with pytest.raises(InputError, match=r"half of each ring of the inner face; it shows \d+ %") as refused:
        image_findings([cut(frame, rows=slice(top, None))], [], probe=PROBE, calibration=known)
    assert int(str(refused.value).split("it shows ")[1].split(" %")[0]) <= 50


def test_several_targets_take_the_reference_of_the_nearest_force(virtual: VirtualProbe) -> None:
    lump = tsis.load_phantom("size-8")
    targets = [virtual.press(lump, force_n=force) for force in (0.5, 1.0)]
    references = [virtual.press(PLAIN, force_n=force) for force in (1.0, 0.5)]
    assert image_findings(targets, references, probe=PROBE, calibration=virtual.calibration) == []
    # An uneven reference makes uneven only the change that it is subtracted for.
    radius = virtual.sensor.radius_mm()
    x, y = virtual.sensor.axes_mm()
    saddle = 4.0 * (x**2 - y[:, None] ** 2) / np.maximum(radius, 5.0) ** 2
    for uneven in (0, 1):
        worse = list(references)
        worse[uneven] = replace(worse[uneven], grey=worse[uneven].grey + saddle)
        for target in targets:
            found = image_findings([target], worse, probe=PROBE, calibration=virtual.calibration)
            nearest = worse[uneven].force_n == target.force_n
            assert ("not_one_round_inclusion" in dict(found)) is nearest


@pytest.mark.parametrize("probe", ["tsis-2011", "tsis-domed"])
@pytest.mark.parametrize("phantom", ["plain", "size-8", "depth-4"])
def test_forces_that_belong_to_other_images_are_refused(probe: str, phantom: str) -> None:
    rig = VirtualProbe(tsis.load_probe(probe), rng=np.random.default_rng(3), strain="small")
    light, firm = (rig.press(tsis.load_phantom(phantom), force_n=force) for force in (0.5, 1.0))

    def checked(*frames: TactileImage) -> None:
        require_forces_as_lit(frames, probe=rig.probe, calibration=rig.calibration)

    checked(light, firm)
    for frames in (
        (light, replace(firm, force_n=0.5)),
        (replace(light, force_n=1.0), firm),
        (replace(light, force_n=1.0), replace(firm, force_n=0.5)),
    ):
        with pytest.raises(InputError, match="check which force belongs to which image"):
            checked(*frames)
