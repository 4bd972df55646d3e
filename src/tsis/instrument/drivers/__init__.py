"""Camera drivers behind the camera protocol; `tsis.virtual` contains the driver of the virtual probe."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from tsis.instrument.drivers import aravis as aravis
    from tsis.instrument.drivers import files as files
    from tsis.instrument.drivers import frame_numbers as frame_numbers
    from tsis.instrument.drivers import genicam as genicam
    from tsis.instrument.drivers import harvesters as harvesters
    from tsis.instrument.drivers import opencv as opencv
    from tsis.instrument.drivers import pylon as pylon

if not TYPE_CHECKING:  # modules load when they are first used
    __getattr__, __dir__, _ = lazy_loader.attach(
        __name__, submodules=["aravis", "files", "frame_numbers", "genicam", "harvesters", "opencv", "pylon"]
    )
