"""Cameras, force gauges and image files: the sources of frames and forces."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from tsis.instrument import acquisition as acquisition
    from tsis.instrument import camera as camera
    from tsis.instrument import discovery as discovery
    from tsis.instrument import drivers as drivers
    from tsis.instrument import force_log as force_log
    from tsis.instrument import gauge as gauge
    from tsis.instrument import image_files as image_files
    from tsis.instrument import recording as recording
    from tsis.instrument import serial_gauge as serial_gauge
    from tsis.instrument import snapshot as snapshot
    from tsis.instrument import video as video

if not TYPE_CHECKING:  # modules load when they are first used
    __getattr__, __dir__, _ = lazy_loader.attach(
        __name__,
        submodules=[
            "acquisition",
            "camera",
            "discovery",
            "drivers",
            "force_log",
            "gauge",
            "image_files",
            "recording",
            "serial_gauge",
            "snapshot",
            "video",
        ],
    )
