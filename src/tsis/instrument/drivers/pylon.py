"""Basler cameras (GigE, USB and others) through Basler's own library, pypylon.

Its camera emulator needs no camera: set the environment variable ``PYLON_CAMEMU`` to the number of cameras.
"""

from __future__ import annotations

import contextlib
import time
from typing import TYPE_CHECKING, Any

from tsis.instrument.discovery import CameraInfo, missing_message
from tsis.instrument.drivers.genicam import (
    ChoiceNode,
    GenICamCamera,
    Grab,
    NumberNode,
    buffers_of,
    camera_not_found,
    cannot_open,
    maker_library,
    ticks_per_s,
)

if TYPE_CHECKING:
    from collections.abc import Callable


_NO_NUMBER = 2**64 - 1  # pylon's value where a link does not number its frames


class PylonCamera(GenICamCamera):
    """A Basler camera, by its serial number or user-defined name; the first camera when that is empty."""

    def __init__(self, identity: str = "", *, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__("pylon", identity, link=lambda: _opened(identity), clock=clock)


def missing_requirement() -> str | None:
    """What is not installed, with the cure; None when nothing is missing."""
    return missing_message(_pylon)


def find_cameras_here() -> tuple[CameraInfo, ...]:
    """The cameras that answer now."""
    return tuple(
        CameraInfo(
            source="pylon",
            identity=device.GetSerialNumber(),
            maker=device.GetVendorName(),
            model=device.GetModelName(),
            note=_user_name(device),
        )
        for device in _pylon().TlFactory.GetInstance().EnumerateDevices()
    )


class _Nodes:
    """pypylon's node map."""

    def __init__(self, node_map: Any) -> None:
        self._map, self._genicam = node_map, _genicam()

    def read(self, name: str) -> NumberNode | ChoiceNode | None:
        node, kinds = self._map.GetNode(name), self._genicam
        if not kinds.IsReadable(node):
            return None
        kind = node.GetNode().GetPrincipalInterfaceType()
        if kind == kinds.intfIEnumeration:
            return ChoiceNode(value=node.GetValue(), options=tuple(node.GetSettableValues()))
        if kind == kinds.intfIBoolean:
            return NumberNode(value=float(node.GetValue()), low=0.0, high=1.0, step=1.0)
        if kind == kinds.intfIInteger:
            step = float(node.GetInc())
        elif kind == kinds.intfIFloat:
            step = 0.0
        else:
            return None
        return NumberNode(value=node.GetValue(), low=node.GetMin(), high=node.GetMax(), step=step, unit=node.GetUnit())

    def write(self, name: str, value: float | str) -> None:
        node, kinds = self._map.GetNode(name), self._genicam
        kind = node.GetNode().GetPrincipalInterfaceType()
        cast: Any = {kinds.intfIInteger: int, kinds.intfIBoolean: bool}.get(kind, lambda same: same)
        node.SetValue(cast(value))


class _PylonLink:
    """The connection to one camera through pypylon."""

    def __init__(self, camera: Any, identity: str) -> None:
        self._camera, self.identity = camera, identity
        self.nodes = _Nodes(camera.GetNodeMap())
        self.errors: tuple[type[Exception], ...] = (_genicam().GenericException,)
        self._ticks_hz = ticks_per_s(self.nodes)

    @property
    def present(self) -> bool:
        return not self._camera.IsCameraDeviceRemoved()

    def begin(self) -> None:
        self._camera.MaxNumBuffer.SetValue(buffers_of(self.nodes))
        self._camera.StartGrabbing(_pylon().GrabStrategy_OneByOne)

    def grab(self, timeout_s: float) -> Grab | None:
        buffer = self._camera.RetrieveResult(round(1000 * timeout_s), _pylon().TimeoutHandling_Return)
        try:
            if not buffer.IsValid():
                return None
            whole = buffer.GrabSucceeded()
            return Grab(
                pixels=buffer.GetArray() if whole else None,
                number=None if buffer.BlockID == _NO_NUMBER else buffer.BlockID,
                time_s=buffer.TimeStamp / self._ticks_hz if whole and buffer.TimeStamp else None,
            )
        finally:
            buffer.Release()

    def end(self) -> None:
        self._camera.StopGrabbing()

    def close(self) -> None:
        try:
            self._camera.Close()
        finally:
            self._camera.DestroyDevice()


def _opened(identity: str) -> _PylonLink:
    factory, failures = _pylon().TlFactory.GetInstance(), _genicam().GenericException
    devices = factory.EnumerateDevices()
    matching = [
        device for device in devices if not identity or identity in (device.GetSerialNumber(), _user_name(device))
    ]
    if not matching:
        raise camera_not_found("pylon", identity, [device.GetSerialNumber() for device in devices])
    serial = matching[0].GetSerialNumber()
    camera = None
    try:
        camera = _pylon().InstantCamera(factory.CreateDevice(matching[0]))
        camera.Open()
        return _PylonLink(camera, serial)
    except failures as error:
        busy = False
        with contextlib.suppress(failures):
            busy = not factory.IsDeviceAccessible(matching[0])
        with contextlib.suppress(failures):
            if camera is not None:
                camera.DestroyDevice()
        raise cannot_open(f"pylon camera {serial}", error, busy=busy) from error


def _user_name(device: Any) -> str:
    return str(device.GetUserDefinedName()) if device.IsUserDefinedNameAvailable() else ""


def _pylon() -> Any:
    return maker_library("pypylon.pylon", source="pylon")


def _genicam() -> Any:
    return maker_library("pypylon.genicam", source="pylon")
