"""Sources of frames that follow the camera protocol; the virtual probe's lies in its own room."""

from tsis.instrument.drivers._files import ImageFiles
from tsis.instrument.drivers._opencv import OpenCVDevice
from tsis.instrument.drivers._video import VideoFile

__all__ = ["ImageFiles", "OpenCVDevice", "VideoFile"]
