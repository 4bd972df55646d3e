"""Values go through pickle, copy and cloudpickle, stay equal and read-only, and give the same numbers."""

from __future__ import annotations

import copy
import pickle
from dataclasses import fields, replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

import cloudpickle
import numpy as np
import pytest

import tsis
from tsis.calibration.camera_reference import CameraReference
from tsis.calibration.file import ProbeCalibration, calibration_sha256
from tsis.calibration.frames import UsableCalibration
from tsis.calibration.measured import MeasuredValue
from tsis.imaging import features
from tsis.inclusion.network_training import train_network
from tsis.inclusion.relative import RelativeReading
from tsis.instrument.camera import Frame
from tsis.model.calibration import Calibration, LightMap
from tsis.model.estimate import Estimate
from tsis.model.image import TactileImage
from tsis.model.phantom import Relaxation
from tsis.model.press import PressField
from tsis.records.values import StoredPress, Target
from tsis.study.classifier import TargetEvidence, TrainingSet
from tsis.study.plan import DeviceReading

if TYPE_CHECKING:
    from collections.abc import Callable

MADE = datetime(2026, 11, 20, tzinfo=UTC)


def disc() -> TactileImage:
    y, x = np.mgrid[:60, :80]
    grey = np.where((x - 30) ** 2 + (y - 25) ** 2 < 100, 80.0, 0.0)
    return TactileImage(
        grey=grey, mm_per_pixel=(0.1, 0.2), force_n=0.5, name="disc", settings={"gain": 2.0, "box": [1, 2]}
    )


def estimate() -> Estimate:
    draws = np.random.default_rng(1).normal(10.0, 1.0, size=(2, 500))
    return Estimate(
        samples={"diameter_mm": draws[0], "depth_mm": draws[1]},
        prior_sd={"diameter_mm": 4.0, "depth_mm": 2.0},
        presence=0.9,
        flags=("depth_mm_not_identified",),
        provenance={"probe": {"layers": [{"young_kpa": 1.0}]}, "images": ({"force_n": 1.0},)},
    )


def calibration() -> ProbeCalibration:
    level, noise = np.full((6, 8), 20.0), MeasuredValue(value=1.0, sd=0.1, unit="grey")
    return ProbeCalibration(
        name="rig",
        probe="tsis-2011",
        settings={"gain": 2.0},
        made=MADE,
        expires=MADE.replace(year=2027),
        reference=CameraReference(
            dark_grey=0.1 * level,
            untouched_grey=level,
            relative_light=level / 20.0,
            usable=level > 0,
            full_scale=255.0,
            mm_per_pixel=None,
            dark_frames=1,
            untouched_frames=1,
            flat_frames=1,
            read_noise_grey=noise,
            shot_noise_grey=noise,
            stray_grey=noise,
        ),
        response=Calibration(gain_grey_per_kpa=1.0, saturation_kpa=80.0, light=LightMap.uniform()),
    )


def trained() -> Any:
    x = np.linspace(-1.0, 1.0, 40)[:, None]
    return train_network(x, x**2, rng=np.random.default_rng(0), iterations=5)[0]


VALUES: dict[str, Callable[[], Any]] = {
    "image": disc,
    "estimate": estimate,
    "response": lambda: Calibration(gain_grey_per_kpa=1.0, saturation_kpa=80.0, light=LightMap.uniform()),
    "light": LightMap.uniform,
    "calibration": calibration,
    "usable calibration": lambda: UsableCalibration(
        calibration=calibration(), identity=calibration_sha256(calibration())
    ),
    "probe": lambda: tsis.load_probe("tsis-domed"),
    "phantom": lambda: tsis.load_phantom("hardness-100"),
    "press": lambda: PressField(
        radius_mm=np.arange(2.0),
        face_displacement_mm=np.array([0.1, 0.0]),
        pressure_kpa=np.array([1.0, 2.0]),
        approach_mm=0.2,
        force_n=1.0,
    ),
    "relaxation": lambda: Relaxation(shares=(0.3,), times_s=(2.0,)),
    "frame": lambda: Frame(pixels=np.zeros((2, 3), np.uint8), sequence=1, settings={"gain": 1.0}),
    "relative reading": lambda: RelativeReading(
        quantity="relative size", value=1.0, unit="mm", against="plain tissue", assumptions=(), parts={"a": 1.0}
    ),
    "device reading": lambda: DeviceReading(
        code="A1", device="tsis", operator="1", repeat=1, score=0.5, values={"diameter_mm": 4.0}
    ),
    "stored press": lambda: StoredPress(
        role="target", taken=MADE, frame="0" * 64, rows=2, columns=3, full_scale=255.0, axis_px=(1.0, 0.5)
    ),
    "target": lambda: Target(number=1, kind="phantom", made=MADE, truth={"diameter_mm": 3.0}),
    "evidence": lambda: TargetEvidence(samples=np.array([[10.0, 5.0, 80.0]]), log_ratio=3.0),
    "training": lambda: TrainingSet(features=np.array([[10.0, 5.0, 80.0, 1.0]]), labels=np.array([2])),
    "network": trained,
}
NO_HASH = (RelativeReading, DeviceReading, StoredPress, Target)  # whose mappings Python does not hash
WAYS: dict[str, Callable[[Any], Any]] = {
    "pickle 2": lambda value: pickle.loads(pickle.dumps(value, protocol=2)),
    "pickle 5": lambda value: pickle.loads(pickle.dumps(value, protocol=5)),
    "cloudpickle": lambda value: pickle.loads(cloudpickle.dumps(value)),
    "copy": copy.copy,
    "deep copy": copy.deepcopy,
}


def arrays(value: Any) -> list[np.ndarray[Any, Any]]:
    """Every array of a value."""
    if isinstance(value, np.ndarray):
        return [value]
    if hasattr(value, "__dataclass_fields__"):
        return [array for item in fields(value) for array in arrays(getattr(value, item.name))]
    if isinstance(value, (list, tuple)):
        return [array for item in value for array in arrays(item)]
    return [array for item in value.values() for array in arrays(item)] if hasattr(value, "values") else []


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", VALUES)
def test_a_round_trip_gives_an_equal_value(name: str, way: str) -> None:
    value = VALUES[name]()
    again = WAYS[way](value)
    assert type(again) is type(value)
    assert again == value
    if type(value) not in NO_HASH:
        assert hash(again) == hash(value)
    for first, second in zip(arrays(value), arrays(again), strict=True):
        assert first.dtype == second.dtype
        np.testing.assert_array_equal(first, second)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", ["image", "estimate", "light", "press", "frame"])
def test_arrays_and_mappings_stay_read_only(name: str, way: str) -> None:
    again = WAYS[way](VALUES[name]())
    assert arrays(again)
    assert not any(array.flags.writeable for array in arrays(again))
    if name == "image":
        with pytest.raises(TypeError):
            again.settings["gain"] = 3.0


@pytest.mark.parametrize("way", WAYS)
def test_the_numbers_are_the_same(way: str) -> None:
    image, result, press = disc(), estimate(), calibration()
    assert features(WAYS[way](image)).centroid_mm == features(image).centroid_mm
    assert WAYS[way](result).mean["diameter_mm"] == np.mean(result.samples["diameter_mm"])
    assert WAYS[way](result).interval(0.9) == result.interval(0.9)
    assert calibration_sha256(WAYS[way](press)) == calibration_sha256(press)


def test_values_that_differ_are_not_equal() -> None:
    image, result = disc(), estimate()
    grey = np.array(image.grey)
    grey[3, 4] += 1.0
    assert image == disc()
    assert image != replace(image, grey=grey)
    assert image != replace(image, force_n=0.6)
    assert image != replace(image, settings={**image.settings, "gain": 3.0})
    assert image != replace(image, settings={"gain": 2.0})
    assert image != image.grey.tolist()
    assert result == estimate()
    assert result != replace(result, trusted=False)
    assert result != replace(result, provenance={})
    assert len({image, disc(), replace(image, force_n=0.6)}) == 2


def test_no_number_differs_from_itself() -> None:
    first, second = (Frame(pixels=np.ones((2, 2)), sequence=0, settings={"t": np.array([np.nan])}) for _ in range(2))
    assert first == second
    assert first != Frame(pixels=np.ones((2, 2)), sequence=0, settings={"t": np.array([0.0])})
    assert first != Frame(pixels=np.ones((2, 2), np.uint8), sequence=0, settings={"t": np.array([np.nan])})
