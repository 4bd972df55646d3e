"""Allied Vision cameras through the maker's own library, vmbpy.

The library needs transport layers (``.cti`` files), which the maker's program Vimba X installs.
"""

from __future__ import annotations

import contextlib
import queue
import time
from typing import TYPE_CHECKING, Any

from tsis.errors import CameraError, MissingExtraError
from tsis.instrument._discovery import CameraInfo
from tsis.instrument.drivers.genicam import (
    ChoiceNode,
    GenICamCamera,
    Grab,
    NumberNode,
    buffers_of,
    camera_not_found,
    cannot_open,
    maker_library,
    reason,
    ticks_per_s,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator


class VimbaCamera(GenICamCamera):
    """An Allied Vision camera, by its id in Vimba, serial number or IP address; the first camera when that is empty."""

    def __init__(self, identity: str = "", *, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__("vimba", identity, link=lambda: _opened(identity), clock=clock)


def missing_requirement() -> str | None:
    """What is not installed, with the cure; None when nothing is missing."""
    try:
        with _system():
            return None
    except (MissingExtraError, CameraError) as error:
        return str(error)


def find_cameras_here() -> tuple[CameraInfo, ...]:
    """The cameras that answer now."""
    with _system() as system:
        return tuple(
            CameraInfo(
                source="vimba",
                identity=camera.get_id(),
                model=camera.get_model(),
                note=f"serial number {camera.get_serial()}",
            )
            for camera in system.get_all_cameras()
        )


class _Nodes:
    """vmbpy's features."""

    def __init__(self, camera: Any) -> None:
        self._camera, self._vmbpy = camera, _vmbpy()

    def read(self, name: str) -> NumberNode | ChoiceNode | None:
        try:
            feature = self._camera.get_feature_by_name(name)
            if not feature.is_readable():
                return None
            return self._node(feature)
        except _failures():
            return None

    def write(self, name: str, value: float | str) -> None:
        feature = self._camera.get_feature_by_name(name)
        kinds = self._vmbpy
        cast: Any = {kinds.IntFeature: int, kinds.BoolFeature: bool}.get(type(feature), lambda same: same)
        feature.set(cast(value))

    def _node(self, feature: Any) -> NumberNode | ChoiceNode | None:
        kinds = self._vmbpy
        if isinstance(feature, kinds.EnumFeature):
            options = tuple(str(entry) for entry in feature.get_available_entries())
            return ChoiceNode(value=str(feature.get()), options=options)
        if isinstance(feature, kinds.BoolFeature):
            return NumberNode(value=float(feature.get()), low=0.0, high=1.0, step=1.0)
        if not isinstance(feature, (kinds.IntFeature, kinds.FloatFeature)):
            return None
        low, high = feature.get_range()
        # the library's increment of a fractional number is the display's, not the camera's
        step = float(feature.get_increment()) if isinstance(feature, kinds.IntFeature) else 0.0
        return NumberNode(value=feature.get(), low=low, high=high, step=step, unit=feature.get_unit())


class _VimbaLink:
    """The connection to one camera through vmbpy, whose own thread delivers the frames."""

    def __init__(self, camera: Any) -> None:
        self._camera, self.identity = camera, camera.get_id()
        self.resources = contextlib.ExitStack()  # closes the camera, then the library's system
        self.nodes, self.errors, self.present = _Nodes(camera), _failures(), True
        self._ticks_hz = ticks_per_s(self.nodes)
        self._arrived: queue.Queue[Grab] = queue.Queue()

    def begin(self) -> None:
        buffers = buffers_of(self.nodes)
        self._arrived = queue.Queue(maxsize=buffers)
        self._camera.start_streaming(handler=self._receive, buffer_count=buffers)

    def grab(self, timeout_s: float) -> Grab | None:
        try:
            return self._arrived.get(timeout=timeout_s)
        except queue.Empty:
            return None

    def end(self) -> None:
        self._camera.stop_streaming()

    def close(self) -> None:
        self.resources.close()

    def _receive(self, camera: Any, stream: object, frame: Any) -> None:
        """Copy a frame and return its buffer; when the reader is late, its number leaves a gap."""
        try:
            whole = frame.get_status() == _vmbpy().FrameStatus.Complete
            stamp = frame.get_timestamp()
            grab = Grab(
                pixels=frame.as_numpy_ndarray()[:, :, 0].copy() if whole else None,
                number=frame.get_id(),
                time_s=stamp / self._ticks_hz if stamp else None,
            )
            with contextlib.suppress(queue.Full):
                self._arrived.put_nowait(grab)
        finally:
            with contextlib.suppress(*_failures()):  # while streaming ends, no buffer is taken back
                camera.queue_frame(frame)


def _opened(identity: str) -> _VimbaLink:
    with contextlib.ExitStack() as resources:
        camera = _find_device(resources.enter_context(_system()), identity)
        try:
            resources.enter_context(camera)
            link = _VimbaLink(camera)
        except _failures() as error:
            busy = "in use" in str(error) or "invalid Mode" in str(error)
            raise cannot_open(f"vimba camera {camera.get_id()}", error, busy=busy) from error
        link.resources = resources.pop_all()
        return link


def _find_device(system: Any, identity: str) -> Any:
    cameras = system.get_all_cameras()
    for camera in cameras:
        if not identity or identity in (camera.get_id(), camera.get_serial()):
            return camera
    with contextlib.suppress(*_failures()):
        if identity:
            return system.get_camera_by_id(identity)  # an address outside the search
    raise camera_not_found("vimba", identity, [camera.get_id() for camera in cameras])


@contextlib.contextmanager
def _system() -> Iterator[Any]:
    """The library's system, started with its first use and ended with its last."""
    vmbpy = _vmbpy()
    with contextlib.ExitStack() as resources:
        try:
            system = resources.enter_context(vmbpy.VmbSystem.get_instance())
        except vmbpy.VmbTransportLayerError as error:
            raise CameraError(
                "the camera source vimba needs the transport layers of Vimba X and found none; "
                "install Vimba X, or set GENICAM_GENTL64_PATH to the folder of its .cti files"
            ) from error
        except _failures() as error:
            raise CameraError(f"the camera source vimba does not start: {reason(error)}") from error
        yield system


def _vmbpy() -> Any:
    return maker_library("vmbpy", source="vimba")


def _failures() -> tuple[type[Exception], ...]:
    vmbpy = _vmbpy()
    return (
        vmbpy.VmbSystemError,
        vmbpy.VmbTransportLayerError,
        vmbpy.VmbInterfaceError,
        vmbpy.VmbCameraError,
        vmbpy.VmbFeatureError,
        vmbpy.VmbFrameError,
        vmbpy.VmbTimeout,
    )
