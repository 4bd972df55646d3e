"""GigE Vision and USB3 Vision cameras through Aravis, a library of the system that is bound without a compiler."""

from tsis.instrument.drivers.aravis._camera import AravisCamera
from tsis.instrument.drivers.aravis._library import Aravis, load
from tsis.instrument.drivers.aravis._search import find_cameras_here, missing_requirement

__all__ = ["Aravis", "AravisCamera", "find_cameras_here", "load", "missing_requirement"]
