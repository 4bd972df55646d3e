"""Camera drivers behind the camera protocol; `tsis.virtual` contains the driver of the virtual probe."""

from tsis.instrument.drivers._files import ImageFiles
from tsis.instrument.drivers._opencv import OpenCVDevice
from tsis.instrument.drivers._video import VideoFile

__all__ = ["ImageFiles", "OpenCVDevice", "VideoFile"]
