"""What of the Aravis source needs no camera: the missing library, counting, waiting, and the order of calls."""

from __future__ import annotations

import ctypes
from itertools import count
from typing import NoReturn

import pytest

from tsis.errors import CameraError, InputError, MissingExtraError
from tsis.instrument.camera import silence_timeout_s
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
