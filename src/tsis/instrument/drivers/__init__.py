"""Camera drivers behind the camera protocol; `tsis.virtual` contains the driver of the virtual probe."""

from tsis.instrument.drivers._files import IMAGE_ENDINGS, VIDEO_ENDINGS, ImageFiles, VideoFile
from tsis.instrument.drivers._opencv import OpenCVDevice

__all__ = ["IMAGE_ENDINGS", "VIDEO_ENDINGS", "ImageFiles", "OpenCVDevice", "VideoFile"]
