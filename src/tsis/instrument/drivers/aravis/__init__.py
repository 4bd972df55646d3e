"""GigE Vision and USB3 Vision cameras through the system library Aravis, bound with ctypes."""

from tsis.instrument.drivers.aravis._camera import AravisCamera
from tsis.instrument.drivers.aravis._connection import find_cameras_here, missing_requirement
from tsis.instrument.drivers.aravis._library import Aravis, load

__all__ = ["Aravis", "AravisCamera", "find_cameras_here", "load", "missing_requirement"]
