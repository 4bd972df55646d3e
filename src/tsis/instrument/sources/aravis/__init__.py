"""GigE Vision and USB3 Vision cameras through Aravis, a library of the system that is bound without a compiler."""

from tsis.instrument.sources.aravis.camera import AravisCamera
from tsis.instrument.sources.aravis.search import find_cameras_here, missing_requirement

__all__ = ["AravisCamera", "find_cameras_here", "missing_requirement"]
