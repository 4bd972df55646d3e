"""Sequences of frames on disk, lossless, with an index that accounts for every frame."""

from tsis.instrument.recording._record import (
    RECORDING_COLUMNS,
    RECORDING_FORMAT,
    RECORDING_INDEX,
    RECORDING_SUMMARY,
    RECORDING_VERSION,
    VIDEO_NAME,
    FrameFolder,
    FrameSink,
    FurtherColumns,
    LosslessVideo,
    RecordingReport,
    read_recording_index,
    record,
)

__all__ = [
    "RECORDING_COLUMNS",
    "RECORDING_FORMAT",
    "RECORDING_INDEX",
    "RECORDING_SUMMARY",
    "RECORDING_VERSION",
    "VIDEO_NAME",
    "FrameFolder",
    "FrameSink",
    "FurtherColumns",
    "LosslessVideo",
    "RecordingReport",
    "read_recording_index",
    "record",
]
