"""Cameras of any maker through the GenICam standard."""

from tsis.instrument.drivers.genicam._camera import GenICamCamera
from tsis.instrument.drivers.genicam._link import (
    Grab,
    buffer_count,
    buffers_of,
    camera_not_found,
    cannot_open,
    maker_library,
    reason,
    ticks_per_s,
)
from tsis.instrument.drivers.genicam._settings import ChoiceNode, NumberNode, first_number

__all__ = [
    "ChoiceNode",
    "GenICamCamera",
    "Grab",
    "NumberNode",
    "buffer_count",
    "buffers_of",
    "camera_not_found",
    "cannot_open",
    "first_number",
    "maker_library",
    "reason",
    "ticks_per_s",
]
