"""Search for cameras through Aravis."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

from tsis.errors import MissingExtraError
from tsis.instrument._discovery import CameraInfo
from tsis.instrument.drivers.aravis._library import load

if TYPE_CHECKING:
    from collections.abc import Callable

    from tsis.instrument.drivers.aravis._library import Aravis


SOURCE = "aravis"
_the_list = threading.Lock()  # the library has one list, whose entries are read one by one


def missing_requirement(library: Callable[[], Aravis] = load) -> str | None:
    """What is not installed, with the cure; None when cameras can be searched."""
    try:
        library()
    except MissingExtraError as error:
        return str(error)
    return None


def find_cameras_here(library: Callable[[], Aravis] = load) -> tuple[CameraInfo, ...]:
    """Cameras that answer now, by name; the search takes about a second.

    Raises `MissingExtraError` when Aravis is not installed.
    """
    return tuple(camera for camera, _ in search(library()))


def search(aravis: Aravis) -> list[tuple[CameraInfo, str]]:
    """Cameras that answer now, each with its address."""
    with _the_list:
        aravis.call("update_device_list")
        indices = range(aravis.call("get_n_devices"))
        cameras = [(_described(aravis, index), aravis.text("get_device_address", index)) for index in indices]
    return sorted(cameras, key=lambda camera: camera[0].identity)


def _described(aravis: Aravis, index: int) -> CameraInfo:
    protocol, address = (aravis.text(f"get_device_{what}", index) for what in ("protocol", "address"))
    return CameraInfo(
        source=SOURCE,
        identity=aravis.text("get_device_id", index),
        maker=aravis.text("get_device_vendor", index),
        model=aravis.text("get_device_model", index),
        note=f"{protocol} at {address}" if address else protocol,
    )
