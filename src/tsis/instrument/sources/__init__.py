"""Sources of frames that follow the camera protocol; the virtual probe's lies in its own room."""

from tsis.instrument.sources.files import ImageFiles
from tsis.instrument.sources.opencv_device import OpenCVDevice
from tsis.instrument.sources.video import VideoFile

__all__ = ["ImageFiles", "OpenCVDevice", "VideoFile"]
