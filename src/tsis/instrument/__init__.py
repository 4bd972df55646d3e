"""Cameras and image files: where frames come from. Knows values, no science."""

from tsis.instrument.camera import Camera, Frame, Mode, Setting
from tsis.instrument.image_file import read_colour, read_image
from tsis.instrument.sources import ImageFiles, OpenCVDevice, VideoFile

__all__ = [
    "Camera",
    "Frame",
    "ImageFiles",
    "Mode",
    "OpenCVDevice",
    "Setting",
    "VideoFile",
    "read_colour",
    "read_image",
]
