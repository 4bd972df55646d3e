"""Cameras and image files: where frames come from. Knows values, no science."""

from tsis.instrument.image_file import read_colour, read_image

__all__ = ["read_colour", "read_image"]
