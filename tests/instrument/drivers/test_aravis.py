"""What of the Aravis source needs no camera: the missing library, losses, the order of calls, modes and settings."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass, field
from itertools import count
from typing import Any, NoReturn, cast

import pytest

from tsis.errors import CameraError, InputError, MissingExtraError
from tsis.instrument.camera import Mode, Setting, silence_timeout_s
from tsis.instrument.drivers import aravis as features
from tsis.instrument.drivers.aravis import Aravis, AravisCamera, Watch, find_cameras_here, load, missing_requirement


def _absent() -> NoReturn:
    raise MissingExtraError("cameras through Aravis need its library")


def test_a_missing_library_is_one_sentence_everywhere() -> None:
    assert missing_requirement(_absent) == "cameras through Aravis need its library"
    with pytest.raises(MissingExtraError, match="need its library"):
        AravisCamera("some camera", library=_absent).open()
    with pytest.raises(MissingExtraError, match="need its library"):
        find_cameras_here(_absent)


@pytest.mark.parametrize(
    ("platform", "cure"), [("linux", "apt install libaravis-0.8-0"), ("darwin", "brew install"), ("win32", "MSYS2")]
)
def test_the_sentence_tells_how_to_install_it(monkeypatch: pytest.MonkeyPatch, platform: str, cure: str) -> None:
    def no_library(name: str) -> NoReturn:
        raise OSError(name)

    monkeypatch.setattr("sys.platform", platform)
    monkeypatch.setattr("ctypes.CDLL", no_library)
    sentence = missing_requirement(load.__wrapped__)
    assert sentence is not None
    assert "which is not installed" in sentence
    assert cure in sentence
    assert "\n" not in sentence


def test_a_library_without_the_calls_is_too_old() -> None:
    with pytest.raises(MissingExtraError, match=r"a newer Aravis 0\.8, this one has no arv_update_device_list"):
        Aravis(ctypes.CDLL(None))


def test_a_camera_is_lost_after_a_second_of_silence_or_three_frame_times() -> None:
    for rate, limit in ((0.0, 1.0), (30.0, 1.0), (0.5, 6.0)):
        silent_s = silence_timeout_s({"frames_per_s": rate})
        ticks = count()
        watch = Watch(lambda ticks=ticks: 0.25 * next(ticks))  # type: ignore[misc]
        silent = [watch.reason(heard=False, silent_s=silent_s) for _ in range(int(4 * limit))]
        assert silent[:-1] == [None] * (len(silent) - 1)
        assert silent[-1] == f"nothing came for {limit:g} s"


def test_a_machine_that_stops_in_a_wait_does_not_lose_its_camera() -> None:
    looks = iter([0.0, 0.05, 0.1, 60.0, 60.05])
    watch = Watch(lambda: next(looks))
    assert [watch.reason(heard=False) for _ in range(3)] == [None] * 3


def test_parts_of_frames_keep_a_camera_for_ten_seconds() -> None:
    ticks = count()
    watch = Watch(lambda: 0.5 * next(ticks))
    reasons = [watch.reason(heard=True) for _ in range(20)]
    assert reasons[:19] == [None] * 19
    assert reasons[19] == "in 10 s came parts of 20 frames and no whole one"


def test_the_order_of_calls_is_checked() -> None:
    camera = AravisCamera("nobody", library=_absent)
    for call in (camera.modes, camera.settings, camera.start, lambda: camera.adjust("gain", 1.0)):
        with pytest.raises(CameraError, match=r"nobody must be opened first; call open\(\)"):
            call()
    with pytest.raises(CameraError, match=r"call start\(\)"):
        next(camera.frames())
    camera.stop()
    assert not camera.lost
    assert AravisCamera("").name == "the first camera of Aravis"


def test_an_identity_is_text() -> None:
    with pytest.raises(InputError, match="identity must be a str; got 5"):
        AravisCamera(5)  # type: ignore[arg-type]


@dataclass
class StandIn:
    """Answers like the library for one camera, whose values lie in ``values`` under Aravis' names."""

    formats: tuple[str, ...] = ("Mono12Packed", "Mono8", "Mono12", "BayerRG8")
    sensor: tuple[int, int] | None = (1280, 1024)
    region: tuple[int, ...] = (256, 266, 768, 492)
    decibels: bool = True
    automatic: set[str] = field(default_factory=lambda: {"exposure", "gain"})
    ranges: dict[str, tuple[float, float]] = field(
        default_factory=lambda: {"exposure_time": (21.0, 1e6), "gain": (0.0, 24.0), "frame_rate": (1.0, 60.0)}
    )
    values: dict[str, Any] = field(
        default_factory=lambda: {"exposure_time": 5000.0, "gain": 3.0, "frame_rate": 30.0, "pixel_format": "Mono12"}
    )
    done: list[tuple[Any, ...]] = field(default_factory=list)
    freed: int = 0

    def call(self, name: str, _camera: int = 0, *arguments: Any) -> Any:
        what = name.removeprefix("camera_")
        if what == "get_region":
            for place, value in zip(arguments, self.region, strict=True):
                place._obj.value = value
            return None
        if what == "dup_available_pixel_formats_as_strings":
            arguments[0]._obj.value = len(self.formats)
            self.names = (ctypes.c_char_p * len(self.formats))(*(name.encode() for name in self.formats))
            return ctypes.addressof(self.names)
        if what.startswith("is_"):
            quantity = what.removeprefix("is_").removesuffix("_available")
            return quantity.removesuffix("_auto") in self.automatic if "_auto" in quantity else quantity in self.ranges
        if what.startswith("get_"):
            return self.values.get(what.removeprefix("get_"), 1)
        self.done.append((what, *arguments))
        return 1

    def text(self, name: str, _handle: int) -> str:
        return "dB" if name == "gc_float_get_unit" else str(self.values["pixel_format"])

    def pair(self, name: str, _camera: int, _kind: Any) -> tuple[Any, Any]:
        if name == "camera_get_sensor_size":
            if self.sensor is None:
                raise CameraError("not found")
            return self.sensor
        return self.ranges[name.removeprefix("camera_get_").removesuffix("_bounds")]

    def is_a(self, _handle: int, kind: str) -> bool:
        return self.decibels and kind == "gc_float"

    def free(self, _memory: int) -> None:
        self.freed += 1


def _library(stand_in: StandIn) -> Aravis:
    return cast("Aravis", stand_in)


def test_modes_are_grey_formats_that_take_whole_bytes_the_present_one_first() -> None:
    camera = StandIn()
    modes = features.modes(_library(camera), 1)
    assert [(mode.label, mode.full_scale) for mode in modes] == [
        ("Mono12-768x492@30", 4095.0),
        ("Mono12-1280x1024@30", 4095.0),
        ("Mono8-768x492@30", 255.0),
        ("Mono8-1280x1024@30", 255.0),
    ]
    assert camera.freed == 1


def test_a_camera_that_tells_neither_sensor_nor_rate_has_its_present_size() -> None:
    camera = StandIn(sensor=None, ranges={}, formats=("Mono10",))
    assert features.modes(_library(camera), 1) == (
        Mode(width_px=768, height_px=492, full_scale=1023.0, pixel_format="Mono10"),
    )


def test_a_camera_without_grey_is_refused() -> None:
    with pytest.raises(CameraError, match="must offer one of Mono8, Mono10, Mono12, Mono14, Mono16"):
        features.modes(_library(StandIn(formats=("BayerRG8", "RGB8"))), 1)


def test_settings_come_in_milliseconds_and_in_the_unit_that_the_camera_tells() -> None:
    assert features.settings(_library(StandIn()), 1) == (
        Setting(name="exposure_ms", value=5.0, low=0.021, high=1000.0, unit="ms"),
        Setting(name="gain", value=3.0, low=0.0, high=24.0, unit="dB"),
        Setting(name="frames_per_s", value=30.0, low=1.0, high=60.0, unit="1/s"),
    )
    assert features.settings(_library(StandIn(decibels=False)), 1)[1].unit == ""


def test_a_setting_is_taken_over_from_the_camera_before_it_is_set() -> None:
    camera = StandIn()
    features.adjust(_library(camera), 1, "exposure_ms", 7.5)
    features.adjust(_library(camera), 1, "frames_per_s", 20.0)
    assert camera.done == [
        ("set_exposure_time_auto", features.AUTO_OFF),
        ("set_exposure_time", 7500.0),
        ("set_frame_rate", 20.0),
    ]


def test_choosing_a_mode_sets_format_size_and_rate_and_ends_automatic_control() -> None:
    camera = StandIn()
    whole = Mode(width_px=1280, height_px=1024, full_scale=255.0, frames_per_s=15.0, pixel_format="Mono8")
    features.choose(_library(camera), 1, whole)
    assert camera.done == [
        ("set_pixel_format_from_string", b"Mono8"),
        ("set_region", 0, 0, 1280, 1024),
        ("set_frame_rate", 15.0),
        ("set_acquisition_mode", features.CONTINUOUS),
        ("set_exposure_time_auto", features.AUTO_OFF),
        ("set_gain_auto", features.AUTO_OFF),
    ]
    camera.done.clear()
    features.choose(_library(camera), 1, Mode(width_px=768, height_px=492, pixel_format="Mono8"))
    assert ("set_region", 0, 0, 768, 492) not in camera.done  # the present part of the sensor stays where it is
