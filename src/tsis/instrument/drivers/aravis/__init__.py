"""GigE Vision and USB3 Vision cameras through the system library Aravis, bound with ctypes."""

from tsis.instrument.drivers.aravis._camera import AravisCamera
from tsis.instrument.drivers.aravis._library import Aravis, load
from tsis.instrument.drivers.aravis._search import find_cameras_here, missing_requirement

__all__ = ["Aravis", "AravisCamera", "find_cameras_here", "load", "missing_requirement"]
