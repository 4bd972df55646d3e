"""Camera drivers behind the camera protocol; the driver of the virtual probe lies in `tsis.virtual`."""

from tsis.instrument.drivers._files import ImageFiles
from tsis.instrument.drivers._opencv import OpenCVDevice
from tsis.instrument.drivers._video import VideoFile

__all__ = ["ImageFiles", "OpenCVDevice", "VideoFile"]
