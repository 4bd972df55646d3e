"""Cameras, force gauges and image files: the sources of frames and forces."""

from typing import TYPE_CHECKING

import lazy_loader

from tsis.instrument._camera import LATE_FRAMES, PRESETS, Camera, Frame, Mode, Setting, named_mode, preset
from tsis.instrument._discovery import (
    LIVE_SOURCES,
    SOURCES,
    STORED_SOURCES,
    CameraInfo,
    CameraListing,
    connect,
    find_cameras,
    live_sources,
)
from tsis.instrument._image_files import luma, png_bytes, read_colour, read_image, read_levels, whole_levels
from tsis.instrument._quiet import quiet_decoders
from tsis.instrument._snapshot import FORMATS, RAW_ENDINGS, SIDECAR_FORMAT, SIDECAR_VERSION, Snapshot, save_snapshot

__all__ = [
    "FORMATS",
    "LATE_FRAMES",
    "LIVE_SOURCES",
    "PRESETS",
    "RAW_ENDINGS",
    "SIDECAR_FORMAT",
    "SIDECAR_VERSION",
    "SOURCES",
    "STORED_SOURCES",
    "Camera",
    "CameraInfo",
    "CameraListing",
    "Frame",
    "Mode",
    "Setting",
    "Snapshot",
    "connect",
    "find_cameras",
    "live_sources",
    "luma",
    "named_mode",
    "png_bytes",
    "preset",
    "quiet_decoders",
    "read_colour",
    "read_image",
    "read_levels",
    "save_snapshot",
    "whole_levels",
]

if not TYPE_CHECKING:  # subpackages load when they are first used
    __getattr__ = lazy_loader.attach(__name__, ["acquisition", "drivers", "gauge", "recording"])[0]
