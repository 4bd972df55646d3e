from __future__ import annotations

import subprocess
import sys
import threading
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import pytest

from tsis.errors import InputError, UnknownNameError
from tsis.instrument import discovery
from tsis.instrument.camera import Camera
from tsis.instrument.discovery import LIVE_SOURCES, CameraInfo, connect, find_cameras
from tsis.instrument.drivers import opencv as opencv_search
from tsis.instrument.drivers.files import ImageFiles, VideoFile
from tsis.instrument.drivers.opencv import OpenCVDevice

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

ONE = CameraInfo(source="pylon", identity="7", maker="Basler")


def source(found: Callable[[], Any], missing: str | None = None) -> Any:
    return SimpleNamespace(find_cameras_here=found, missing_requirement=lambda: missing)


def test_each_source_answers_or_is_named_with_the_reason() -> None:
    never = threading.Event()

    def broken() -> None:
        raise RuntimeError("the driver\nbroke")

    modules = {
        "aravis": source(tuple, "aravis needs libaravis"),
        "genicam": source(broken),
        "pylon": source(lambda: [ONE]),
        "opencv": source(never.wait),
    }
    findings = find_cameras(module=modules.__getitem__, timeout_s=0.2)
    never.set()
    assert findings.cameras == (ONE,)
    assert findings.missing == {
        "aravis": "aravis needs libaravis",
        "genicam": "the camera source genicam failed: the driver broke",
        "opencv": "the camera source opencv did not answer within 0.2 s",
    }


def test_only_the_sources_asked_for_are_asked() -> None:
    asked: list[str] = []

    def module(name: str) -> Any:
        asked.append(name)
        return source(tuple)

    assert find_cameras(["pylon", "aravis"], module=module).cameras == ()
    assert asked == ["pylon", "aravis"]
    with pytest.raises(UnknownNameError, match="no camera source is called 'files'"):
        find_cameras(["files"])
    with pytest.raises(InputError, match="timeout_s must lie in"):
        find_cameras(timeout_s=0.0)


@pytest.mark.parametrize(
    ("spec", "kind"),
    [
        ("files:a/b", ImageFiles),
        ("video:C:\\clips\\a.avi", VideoFile),
        ("opencv:2", OpenCVDevice),
        ("opencv:", OpenCVDevice),
    ],
)
def test_a_spec_becomes_the_camera_it_names(spec: str, kind: type) -> None:
    assert isinstance(connect(spec), kind)


@pytest.mark.parametrize("name", [name for name in LIVE_SOURCES if name not in ("opencv", "aravis")])
@pytest.mark.parametrize("identity", ["", ":", ":17", ":a:b"])
def test_a_camera_is_named_without_its_library(name: str, identity: str) -> None:
    camera = connect(name + identity)
    assert isinstance(camera, Camera)
    assert camera.name == f"{name} camera {identity[1:]}".rstrip()
    assert not camera.lost


@pytest.mark.parametrize("source", LIVE_SOURCES)
def test_every_source_has_its_search(source: str) -> None:
    module = discovery._searching_module(source)
    assert callable(module.find_cameras_here)
    assert callable(module.missing_requirement)


def test_specs_that_name_nothing_are_refused_with_the_nearest() -> None:
    with pytest.raises(UnknownNameError, match="no camera source is called 'pilon'; did you mean 'pylon'"):
        connect("pilon:1")
    with pytest.raises(InputError, match=r"go by their number, as in opencv:0; got 'opencv:-1'"):
        connect("opencv:-1")
    with pytest.raises(InputError, match="files: must be followed by a path"):
        connect("files:")
    with pytest.raises(InputError, match="spec must be a str"):
        connect(0)  # type: ignore[arg-type]


@pytest.mark.system
def test_no_library_of_a_camera_maker_is_imported_before_its_source_is_asked() -> None:
    code = (
        "import sys, tsis.instrument, tsis.instrument.discovery as d; d.connect('pylon:'); d.connect('genicam:');"
        "d.connect('files:x');"
        "print([m for m in sys.modules if m.partition('.')[0] in ('pypylon', 'harvesters', 'genicam')])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("[]\n", "")


def test_linux_lists_the_cameras_that_opencv_could_open(tmp_path: Path) -> None:
    for device, index, name in (("video10", "0", "Probe\x1b[2J"), ("video2", "0", "Webcam"), ("video3", "1", "Webcam")):
        (tmp_path / device).mkdir()
        (tmp_path / device / "index").write_text(index + "\n")
        (tmp_path / device / "name").write_text(name + "\n")
    (tmp_path / "video4").mkdir()  # tells nothing of itself
    (tmp_path / "videodev").mkdir()
    assert opencv_search.find_cameras_here(devices=tmp_path, platform="linux") == (
        CameraInfo(source="opencv", identity="2", model="Webcam", note="/dev/video2"),
        CameraInfo(source="opencv", identity="4", note="/dev/video4"),
        CameraInfo(source="opencv", identity="10", model="Probe?[2J", note="/dev/video10"),
    )
    assert opencv_search.find_cameras_here(devices=tmp_path / "absent", platform="linux") == ()
    assert opencv_search.missing_requirement() is None


def test_elsewhere_the_first_indices_are_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    released: list[int] = []

    def capture(index: int) -> Any:
        return SimpleNamespace(isOpened=lambda: index in (0, 2, 9), release=lambda: released.append(index))

    monkeypatch.setattr("cv2.VideoCapture", capture)
    found = opencv_search.find_cameras_here(platform="darwin")
    assert [camera.spec for camera in found] == ["opencv:0", "opencv:2"]
    assert released == [0, 1, 2, 3]
