"""Holding a camera through Aravis, and letting go of it without waiting for one that no longer answers."""

from __future__ import annotations

import ctypes
import ipaddress
import threading
from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from tsis.instrument.sources.aravis.search import search
from tsis.model.errors import CameraError

if TYPE_CHECKING:
    from typing import Self

    from tsis.instrument.sources.aravis.library import Aravis
    from tsis.instrument.sources.aravis.stream import Stream

HOLDER_ADDRESS = 0x0A14  # GigE Vision's register of the network address that controls the camera; 0 where not kept


@dataclass(slots=True, kw_only=True, eq=False)
class Connection:
    """Handles of one camera, which belong together and are given back together."""

    aravis: Aravis
    camera: int
    identity: str
    stream: Stream | None = field(default=None)

    @classmethod
    def made(cls, aravis: Aravis, identity: str | None) -> Self:
        """Hold the camera of that identity or address, or the first that answers.

        Raises
        ------
        CameraError
            When none answers, or another program holds it.
        """
        chosen, address = _chosen(aravis, identity)
        try:
            camera = aravis.call("camera_new", address.encode())
        except CameraError as error:
            raise CameraError(f"{chosen} could not be opened: {error}; check its cable and power") from error
        connection = cls(aravis=aravis, camera=camera, identity=chosen)
        holder = connection._holder()
        if holder is not None:
            connection.close(wait_s=0.0)
            raise CameraError(f"{connection.identity} is held by {holder}; close it there, then open the camera again")
        return connection

    def close(self, *, wait_s: float = 0.5) -> None:
        """Give the camera back; one that does not answer is left to a thread after ``wait_s``."""
        leaving = threading.Thread(target=self._release, name=f"leaving {self.identity}", daemon=True)
        leaving.start()
        leaving.join(wait_s)

    def _release(self) -> None:
        if self.stream is not None:
            with suppress(CameraError):  # it is gone, or stops when control ends
                self.aravis.call("camera_stop_acquisition", self.camera)
            self.aravis.unref(self.stream.handle)  # and its buffers
        self.aravis.unref(self.camera)

    def _holder(self) -> str | None:
        """Who else controls the camera; of USB cameras the driver has said so before."""
        if not self.aravis.call("camera_is_gv_device", self.camera):
            return None
        device = self.aravis.call("camera_get_device", self.camera)
        if self.aravis.call("gv_device_is_controller", device):
            return None
        address = ctypes.c_uint32()
        try:
            self.aravis.call("device_read_register", device, HOLDER_ADDRESS, ctypes.byref(address))
        except CameraError:
            address.value = 0
        known = f" at {ipaddress.ip_address(address.value)}" if address.value else ""
        return f"another program{known}"


def _chosen(aravis: Aravis, identity: str | None) -> tuple[str, str]:
    """Identity of the camera that is meant, and what the library opens it by."""
    if identity is not None and _is_address(identity):  # perhaps on a network that a search does not reach
        return identity, identity
    cameras = search(aravis)
    for camera, address in cameras:
        if identity in (None, camera.identity):
            # Aravis may hear a camera of this machine over another network, where its frames would not come.
            return camera.identity, address if _is_loopback(address) else camera.identity
    wanted = "no camera answers" if identity is None else f"no camera called {identity!r} answers"
    names = ", ".join(camera.identity for camera, _ in cameras) or "none"
    raise CameraError(f"{wanted} through Aravis; found: {names}; check its power, cable and network, or name another")


def _is_address(text: str) -> bool:
    try:
        ipaddress.ip_address(text)
    except ValueError:
        return False
    return True


def _is_loopback(address: str) -> bool:
    return _is_address(address) and ipaddress.ip_address(address).is_loopback
