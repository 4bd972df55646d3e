"""A camera's features and its stream, without any library: they refuse what a real camera refuses."""

from __future__ import annotations

import sys
import threading
import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.waiting import HANGS_S

from tsis.errors import CameraError, InputError, UnknownNameError
from tsis.instrument.camera import Camera, Frame, Mode, Setting
from tsis.instrument.drivers.genicam import (
    ChoiceNode,
    GenICamCamera,
    Grab,
    NumberNode,
    adjust,
    apply_mode,
    camera_not_found,
    cannot_open,
    first_number,
    maker_library,
    modes,
    number_node,
    reason,
    run_free,
    set_choice,
    settings,
)

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path


class DriverError(Exception):
    """What the stand-in's driver raises."""


class FakeNodes:
    """A sensor of 1024 x 768 pixels; sizes in steps of 16 and 2, exposure in microseconds, a GigE camera's ways."""

    def __init__(self, **changes: Any) -> None:
        self.values: dict[str, Any] = {
            "PixelFormat": "RGB8",
            "Width": 512,
            "Height": 384,
            "OffsetX": 100,
            "OffsetY": 0,
            "ExposureTime": 20_000.0,
            "ExposureAuto": "Continuous",
            "Gain": 3.0,
            "BlackLevelRaw": 10,
            "AcquisitionFrameRateEnable": False,
            "AcquisitionFrameRate": 30.0,
            "AcquisitionMode": "SingleFrame",
            "TriggerSelector": "FrameStart",
        } | changes
        self.trigger = {"AcquisitionStart": "Off", "FrameStart": "On", "LineStart": "On"}
        self.options = {
            "PixelFormat": ("RGB8", "Mono12", "Mono8", "Mono12Packed"),
            "ExposureAuto": ("Off", "Once", "Continuous"),
            "AcquisitionMode": ("SingleFrame", "Continuous"),
            "TriggerSelector": tuple(self.trigger),
            "TriggerMode": ("Off", "On"),
        }
        self.writes: list[str] = []

    def read(self, name: str) -> NumberNode | ChoiceNode | None:
        if name in ("WidthMax", "HeightMax"):
            return NumberNode(value={"WidthMax": 1024, "HeightMax": 768}[name])
        if name == "TriggerMode":
            return ChoiceNode(value=self.trigger[self.values["TriggerSelector"]], options=self.options[name])
        if name not in self.values:
            return None
        value = self.values[name]
        if isinstance(value, str):
            return ChoiceNode(value=value, options=self.options[name])
        low, high, step, unit = self._range(name)
        return NumberNode(value=float(value), low=low, high=high, step=step, unit=unit)

    def write(self, name: str, value: float | str) -> None:
        self.writes.append(name)
        if name == "ExposureTime" and self.values.get("ExposureAuto", "Off") != "Off":
            raise DriverError("Node is not writable. : AccessException (file 'x.h', line 7)")
        if name == "AcquisitionFrameRate" and not self.values["AcquisitionFrameRateEnable"]:
            raise DriverError("Node is not writable.")
        if isinstance(value, str):
            if value not in self.options[name]:
                raise DriverError(f"{value} is none of {name}")
        else:
            low, high, step, _ = self._range(name)
            if not low <= value <= high or (step and (value - low) % step):
                raise DriverError(f"Value {value} must lie in {low}..{high} by {step}.")
        if name == "TriggerMode":
            self.trigger[self.values["TriggerSelector"]] = str(value)
        else:
            self.values[name] = value

    def _range(self, name: str) -> tuple[float, float, float, str]:
        return {
            "Width": (16.0, 1024.0 - self.values["OffsetX"], 16.0, ""),
            "Height": (2.0, 768.0 - self.values["OffsetY"], 2.0, ""),
            "OffsetX": (0.0, 1024.0 - self.values.get("Width", 0), 4.0, ""),
            "OffsetY": (0.0, 768.0 - self.values.get("Height", 0), 2.0, ""),
            "ExposureTime": (10.0, 1e6, 0.0, "us"),
            "Gain": (0.0, 24.0, 0.0, "dB"),
            "BlackLevelRaw": (0.0, 63.0, 3.0, ""),
            "AcquisitionFrameRateEnable": (0.0, 1.0, 1.0, ""),
            "AcquisitionFrameRate": (1.0, 60.0, 0.0, "Hz"),
        }[name]


class Clock:
    """Seconds that pass when somebody waits."""

    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


class FakeLink:
    """Plays ``script``: what `grab` returns, an error to raise, or a call to make; silence when it ends."""

    errors: tuple[type[Exception], ...] = (DriverError,)

    def __init__(self, script: Iterable[Any] = (), *, clock: Clock | None = None, identity: str = "K1") -> None:
        self.identity, self.present, self.nodes = identity, True, FakeNodes()
        self.script, self.clock = list(script), clock or Clock()
        self.calls: list[str] = []

    def begin(self) -> None:
        self.calls.append("begin")

    def grab(self, timeout_s: float) -> Grab | None:
        step = self.script.pop(0) if self.script else None
        if step is None:
            self.clock.now_s += timeout_s
        if isinstance(step, Exception):
            raise step
        if callable(step):
            step()
            return None
        return step

    def end(self) -> None:
        self.calls.append("end")

    def close(self) -> None:
        self.calls.append("close")


def whole(number: int | None, time_s: float | None = None) -> Grab:
    """A buffer whose pixels tell its number."""
    return Grab(pixels=np.full((4, 6), (number or 0) % 251, np.uint8), number=number, time_s=time_s)


def torn(number: int | None = None) -> Grab:
    """A buffer that came incomplete."""
    return Grab(pixels=None, number=number)


def links(*made: FakeLink) -> Callable[[], FakeLink]:
    """Gives these links, one an opening."""
    left = list(made)
    return lambda: left.pop(0)


@given(
    low=st.integers(-1000, 1000), steps=st.integers(0, 200), step=st.integers(1, 9), wanted=st.floats(-5000.0, 5000.0)
)
def test_the_nearest_value_is_one_that_the_camera_takes_and_no_other_is_nearer(
    low: int, steps: int, step: int, wanted: float
) -> None:
    taken = low + step * np.arange(steps + 1)
    given_range = NumberNode(
        value=low, low=low, high=taken[-1] + (step - 1), step=step
    )  # the end may lie between steps
    nearest = given_range.nearest(wanted)
    assert nearest in taken
    assert abs(nearest - wanted) == pytest.approx(np.abs(taken - wanted).min())


def test_a_number_without_steps_is_only_kept_in_its_range() -> None:
    assert NumberNode(value=0.0, low=0.5, high=2.0).nearest(1.2345) == 1.2345
    assert NumberNode(value=0.0, low=0.5, high=2.0).nearest(7.0) == 2.0
    assert NumberNode(value=0.0, step=3.0).nearest(-1e9) == -1e9  # no range told
    assert NumberNode(value=0.0, low=0.0, step=3.0).nearest(100.0) == 99.0


def test_older_names_are_read_where_the_newer_ones_are_absent() -> None:
    nodes = FakeNodes()
    assert first_number(nodes, ("BlackLevel", "BlackLevelRaw")) == (
        "BlackLevelRaw",
        number_node(nodes, "BlackLevelRaw"),
    )
    assert first_number(nodes, ("Nothing", "PixelFormat")) is None


def test_only_words_that_the_camera_offers_and_does_not_hold_are_written() -> None:
    nodes = FakeNodes()
    set_choice(nodes, "ExposureAuto", "Off")
    set_choice(nodes, "ExposureAuto", "Off")
    set_choice(nodes, "ExposureAuto", "Sometimes")
    set_choice(nodes, "GainAuto", "Off")
    assert nodes.writes == ["ExposureAuto"]


NOW = Mode(width_px=512, height_px=384, frames_per_s=30.0, pixel_format="Mono8")


def test_grey_formats_at_the_present_and_at_the_full_size() -> None:
    assert modes(FakeNodes()) == (
        NOW,
        replace(NOW, full_scale=4095.0, pixel_format="Mono12"),
        replace(NOW, width_px=1024, height_px=768, frames_per_s=None),
        replace(NOW, width_px=1024, height_px=768, frames_per_s=None, full_scale=4095.0, pixel_format="Mono12"),
    )


def test_the_present_format_comes_first_and_the_full_size_once() -> None:
    nodes = FakeNodes(PixelFormat="Mono12", OffsetX=0, Width=1024, Height=768)
    assert [mode.label for mode in modes(nodes)] == ["Mono12-1024x768@30", "Mono8-1024x768@30"]


def test_a_mode_that_was_listed_changes_what_it_must_and_nothing_else() -> None:
    nodes = FakeNodes()
    apply_mode(nodes, modes(nodes)[1])
    assert nodes.writes == ["PixelFormat"]
    assert nodes.values["PixelFormat"] == "Mono12"


def test_the_full_size_makes_room_first() -> None:
    nodes = FakeNodes()
    apply_mode(nodes, modes(nodes)[2])
    assert [nodes.values[name] for name in ("Width", "Height", "OffsetX", "OffsetY")] == [1024, 768, 0, 0]


def test_a_size_of_ones_own_becomes_a_region_in_the_middle() -> None:
    nodes = FakeNodes()
    apply_mode(nodes, Mode(width_px=768, height_px=492, pixel_format="Mono8", frames_per_s=50.0))
    assert [nodes.values[name] for name in ("Width", "Height", "OffsetX", "OffsetY")] == [768, 492, 128, 138]
    assert nodes.values["AcquisitionFrameRate"] == 50.0


@pytest.mark.parametrize(
    ("mode", "sentence"),
    [
        (replace(NOW, pixel_format="Mono12Packed"), "no mode Mono12Packed-512x384@30 of full scale 255"),
        (replace(NOW, full_scale=4095.0), r"it offers Mono8 \(full scale 255\), Mono12 \(full scale 4095\)"),
        (Mode(width_px=512, height_px=384), "no mode 512x384 of full scale 255"),
        (replace(NOW, width_px=770), "no mode Mono8-770x384@30; its Width goes from 16 to 1024 by 16"),
        (replace(NOW, height_px=900), "its Height goes from 2 to 768 by 2"),
    ],
)
def test_modes_that_the_camera_has_not_are_named_with_those_it_has(mode: Mode, sentence: str) -> None:
    with pytest.raises(CameraError, match=sentence):
        apply_mode(FakeNodes(), mode)


def test_a_rate_out_of_range_is_named() -> None:
    with pytest.raises(InputError, match=r"frames_per_s must lie in \[1, 60\]; got 500"):
        apply_mode(FakeNodes(), replace(NOW, frames_per_s=500.0))


def test_a_camera_of_colours_only_or_without_a_size_is_refused() -> None:
    nodes = FakeNodes()
    nodes.options["PixelFormat"] = ("RGB8", "BayerRG8")
    with pytest.raises(CameraError, match=r"must offer a grey pixel format .*; it offers RGB8, BayerRG8"):
        modes(nodes)
    nodes = FakeNodes()
    del nodes.values["Height"]
    with pytest.raises(CameraError, match="does not report the size"):
        modes(nodes)


def test_settings_have_our_names_and_units_and_the_cameras_ranges() -> None:
    assert settings(FakeNodes()) == (
        Setting(name="exposure_ms", value=20.0, low=0.01, high=1000.0, unit="ms"),
        Setting(name="gain", value=3.0, low=0.0, high=24.0, unit="dB"),
        Setting(name="brightness", value=10.0, low=0.0, high=63.0),
        Setting(name="frames_per_s", value=30.0, low=1.0, high=60.0, unit="1/s"),
    )


def test_what_the_camera_would_do_by_itself_is_switched_off_before_its_value_is_set() -> None:
    nodes = FakeNodes()
    adjust(nodes, "exposure_ms", 12.5)
    assert nodes.values["ExposureTime"] == 12_500.0
    assert nodes.writes == ["ExposureAuto", "ExposureTime"]
    adjust(nodes, "frames_per_s", 25.0)
    assert nodes.values["AcquisitionFrameRateEnable"] == 1
    assert nodes.values["AcquisitionFrameRate"] == 25.0


def test_a_setting_that_goes_in_steps_takes_the_nearest() -> None:
    nodes = FakeNodes()
    adjust(nodes, "brightness", 7.4)
    assert nodes.values["BlackLevelRaw"] == 6.0


def test_what_the_camera_has_not_or_cannot_is_said_in_one_sentence() -> None:
    nodes = FakeNodes()
    with pytest.raises(UnknownNameError, match="no setting is called 'gian'; did you mean 'gain'"):
        adjust(nodes, "gian", 1.0)
    with pytest.raises(InputError, match=r"exposure_ms must lie in \[0\.01, 1000\]; got 2000 \(ms\)"):
        adjust(nodes, "exposure_ms", 2000.0)
    with pytest.raises(InputError, match="got nan"):
        adjust(nodes, "gain", float("nan"))
    nodes.values.clear()
    with pytest.raises(CameraError, match="no setting called 'gain'; it has none at all"):
        adjust(nodes, "gain", 1.0)


def test_running_free_means_no_trigger_and_nothing_automatic() -> None:
    nodes = FakeNodes()
    run_free(nodes)
    assert set(nodes.trigger.values()) == {"Off"}
    assert nodes.values["TriggerSelector"] == "FrameStart"  # as it was
    assert (nodes.values["AcquisitionMode"], nodes.values["ExposureAuto"]) == ("Continuous", "Off")


Run = Callable[[FakeLink], GenICamCamera]


@pytest.fixture
def made() -> Iterator[list[GenICamCamera]]:
    """Cameras that are let go of after the test."""
    cameras: list[GenICamCamera] = []
    yield cameras
    for camera in cameras:
        camera.stop()


@pytest.fixture
def running(made: list[GenICamCamera]) -> Run:
    """Starts a camera behind a link."""

    def start(link: FakeLink) -> GenICamCamera:
        camera = GenICamCamera("bench", "", link=links(link), clock=link.clock)
        made.append(camera)
        camera.open()
        camera.start()
        return camera

    return start


def read_until_lost(camera: Camera) -> tuple[list[Frame], str]:
    frames: list[Frame] = []
    try:
        frames.extend(iter_into(camera, frames))
    except CameraError as error:
        return frames, str(error)
    return frames, ""


def iter_into(camera: Camera, frames: list[Frame]) -> list[Frame]:
    for frame in camera.frames():
        frames.append(frame)  # noqa: PERF402 - those before an error are kept
    return []


def test_it_follows_the_protocol_and_is_named_after_the_camera_that_was_found(running: Run) -> None:
    camera = running(FakeLink())
    assert isinstance(camera, Camera)
    assert camera.name == "bench camera K1"


def test_lost_and_torn_frames_leave_gaps_and_are_never_delivered(running: Run) -> None:
    link = FakeLink([torn(7), whole(8), torn(9), whole(10), torn(), whole(14)])
    camera = running(link)
    frames, _ = read_until_lost(camera)
    assert [frame.sequence for frame in frames] == [1, 3, 7]
    assert [int(frame.pixels[0, 0]) for frame in frames] == [8, 10, 14]
    assert frames[0].name == "bench camera K1#1"


def test_times_are_the_cameras_own_and_the_clocks_where_it_has_none(running: Run) -> None:
    camera = running(FakeLink([whole(0, 50.25), whole(1, 50.5), whole(2, 51.0)]))
    frames, _ = read_until_lost(camera)
    assert [frame.time_s for frame in frames] == [0.0, 0.25, 0.75]
    camera.stop()
    camera = running(FakeLink([whole(0), None, None, whole(1)]))
    frames, _ = read_until_lost(camera)
    assert [frame.time_s for frame in frames] == pytest.approx([0.0, 0.2])


def test_silence_of_one_second_is_a_loss(running: Run) -> None:
    clock = Clock()
    camera = running(FakeLink([whole(0), whole(1)], clock=clock))
    begun_s = clock.now_s
    frames, sentence = read_until_lost(camera)
    assert len(frames) == 2
    assert camera.lost
    assert clock.now_s - begun_s == pytest.approx(1.0, abs=0.11)
    assert sentence.startswith("bench camera K1 was lost: no frame came for 1.")
    assert sentence.endswith(" s; check its cable and power, and open it again")


def test_torn_frames_are_a_sign_of_life_and_so_is_a_reader_who_takes_his_time(running: Run) -> None:
    clock = Clock()
    script = [whole(0)] + 9 * [None] + [torn(1)] + 9 * [None] + [whole(2), whole(3)]
    camera = running(FakeLink(script, clock=clock))
    seen = []
    for frame in camera.frames():
        seen.append(frame.sequence)
        clock.now_s += 30.0
        if len(seen) == 3:
            break
    assert seen == [0, 2, 3]
    assert not camera.lost


def test_a_slow_camera_is_waited_for(running: Run) -> None:
    clock = Clock()
    link = FakeLink([whole(0)] + 45 * [None] + [whole(1)], clock=clock)
    camera = running(link)
    camera.adjust("exposure_ms", 1000.0)
    camera.adjust("frames_per_s", 1.0)
    frames = camera.frames()
    next(frames)
    with pytest.raises(CameraError, match=r"no frame came for 3\.\d s"):
        next(frames)


def test_a_machine_that_stops_in_a_wait_does_not_lose_its_camera(running: Run) -> None:
    clock = Clock()

    def stop() -> None:
        clock.now_s += 60.0

    frames = running(FakeLink([whole(0), None, stop, None, whole(1)], clock=clock)).frames()
    assert [next(frames).sequence, next(frames).sequence] == [0, 1]


@pytest.mark.parametrize("script", [[whole(0), DriverError("Device has been removed. : X (file 'a')")], [whole(0)]])
def test_a_removed_camera_is_lost_at_once(script: list[Any], running: Run) -> None:
    clock = Clock()
    link = FakeLink(script, clock=clock)
    camera = running(link)
    frames = camera.frames()
    first = next(frames)
    link.present = len(script) == 2
    with pytest.raises(CameraError, match=r"was lost: (it was removed|reading it failed: Device has been removed);"):
        next(frames)
    assert camera.lost
    assert clock.now_s == 100.0
    assert int(first.pixels.sum()) == 0  # what was read stays


def test_a_lost_camera_is_opened_anew_with_a_new_handle(made: list[GenICamCamera]) -> None:
    clock = Clock()
    first, second = FakeLink([whole(5)], clock=clock), FakeLink([whole(900), whole(902)], clock=clock)
    camera = GenICamCamera("bench", "K1", link=links(first, second), clock=clock)
    made.append(camera)
    camera.open()
    camera.start()
    read_until_lost(camera)
    camera.open()
    assert not camera.lost
    assert first.calls == ["begin", "end", "close"]
    camera.start()
    frames, _ = read_until_lost(camera)
    assert [frame.sequence for frame in frames] == [0, 2]
    camera.stop()
    camera.stop()
    assert second.calls == ["begin", "end", "close"]


def test_settings_travel_with_the_frames(running: Run) -> None:
    link = FakeLink([whole(0), whole(1)])
    camera = running(link)
    frames = camera.frames()
    assert next(frames).settings == {"exposure_ms": 20.0, "gain": 3.0, "brightness": 10.0, "frames_per_s": 30.0}
    camera.adjust("gain", 6)
    assert next(frames).settings["gain"] == 6.0
    assert {setting.name: setting.value for setting in camera.settings()}["gain"] == 6.0


def test_frames_carry_the_range_of_their_mode(made: list[GenICamCamera]) -> None:
    link = FakeLink([whole(0)])
    camera = GenICamCamera("bench", "", link=links(link), clock=link.clock)
    made.append(camera)
    camera.open()
    camera.start(camera.modes()[1])
    assert next(camera.frames()).full_scale == 4095.0


def test_stopping_releases_a_reader_of_another_thread(running: Run) -> None:
    waiting, stopped = threading.Event(), threading.Event()

    def hold() -> None:
        waiting.set()
        assert stopped.wait(HANGS_S)

    link = FakeLink([whole(0), hold, DriverError("the device was closed")])
    camera = running(link)
    ends: list[str] = []
    reader = threading.Thread(target=lambda: ends.append(read_until_lost(camera)[1]))
    reader.start()
    assert waiting.wait(HANGS_S)
    stopper = threading.Thread(target=camera.stop)
    stopper.start()
    stopped.set()
    stopper.join(HANGS_S)
    reader.join(HANGS_S)
    assert ends == [""]
    assert not camera.lost
    assert link.calls == ["begin", "end", "close"]


def test_a_camera_that_this_program_holds_is_busy_until_it_is_let_go(running: Run, made: list[GenICamCamera]) -> None:
    camera = running(FakeLink())
    second = FakeLink()
    other = GenICamCamera("bench", "K1", link=links(second, FakeLink()))
    made.append(other)
    with pytest.raises(CameraError, match=r"bench camera K1 is busy: this program holds it already"):
        other.open()
    assert second.calls == ["close"]
    camera.stop()
    other.open()
    other.stop()


def test_the_order_of_calls_is_checked_and_drivers_speak_in_sentences(made: list[GenICamCamera]) -> None:
    link = FakeLink()
    camera = GenICamCamera("bench", "K1", link=links(link))
    made.append(camera)
    for call in (camera.modes, camera.settings, camera.start):
        with pytest.raises(CameraError, match=r"bench camera K1 must be opened first; call open\(\)"):
            call()
    camera.open()
    with pytest.raises(CameraError, match=r"call start\(\)"):
        next(camera.frames())
    link.nodes.options["ExposureAuto"] = ("Once", "Continuous")  # cannot be switched off
    with pytest.raises(CameraError, match=r"^bench camera K1 does not take exposure_ms = 5: Node is not writable$"):
        camera.adjust("exposure_ms", 5)
    camera.start()
    with pytest.raises(CameraError, match="is running already"):
        camera.start()


def test_what_a_library_does_to_the_warnings_is_undone(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "tsis_loud_library.py").write_text(
        "import warnings\nwarnings.warn('made with an old tool', DeprecationWarning)\nwarnings.simplefilter('once')\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    before = list(warnings.filters)
    maker_library("tsis_loud_library", source="pylon")
    assert list(warnings.filters) == before
    monkeypatch.delitem(sys.modules, "tsis_loud_library")


def test_sentences_of_drivers_are_cut_to_what_they_say() -> None:
    assert reason(RuntimeError("Not writable. : AccessException thrown (file 'F.h', line 3)")) == "Not writable"
    assert reason(RuntimeError("two\n lines\x1b[2J")) == "two lines?[2J"
    assert reason(RuntimeError("")) == "RuntimeError"
    assert len(reason(RuntimeError("x" * 5000))) == 160
    assert isinstance(cannot_open("camera", RuntimeError("no"), busy=False), CameraError)
    assert "close that first" in str(cannot_open("camera", RuntimeError("no"), busy=True))
    assert str(camera_not_found("pylon", "7", ["8", "9"])) == "no pylon camera is called '7'; found: 8, 9"
    assert str(camera_not_found("pylon", "", [])) == "no pylon camera was found; check its cable and power"
