"""Cameras, force gauges and image files: where frames and forces come from. Knows values, no science."""

from tsis.instrument.camera import Camera, Frame, Mode, Setting, named_mode
from tsis.instrument.discovery import CameraListing, connect, find_cameras
from tsis.instrument.file_bytes import printable_path, read_bytes
from tsis.instrument.found import CameraInfo
from tsis.instrument.image_file import read_colour, read_image
from tsis.instrument.png import png_bytes
from tsis.instrument.sources import ImageFiles, OpenCVDevice, VideoFile

__all__ = [
    "Camera",
    "CameraInfo",
    "CameraListing",
    "Frame",
    "ImageFiles",
    "Mode",
    "OpenCVDevice",
    "Setting",
    "VideoFile",
    "connect",
    "find_cameras",
    "named_mode",
    "png_bytes",
    "printable_path",
    "read_bytes",
    "read_colour",
    "read_image",
]
