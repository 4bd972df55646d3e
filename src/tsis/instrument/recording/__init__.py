"""Sequences of frames on disk, lossless, with an index that accounts for every frame."""

from tsis.instrument.recording.frame_sink import FrameFolder, FrameSink, LosslessVideo
from tsis.instrument.recording.record import FurtherColumns, RecordingReport, record

__all__ = ["FrameFolder", "FrameSink", "FurtherColumns", "LosslessVideo", "RecordingReport", "record"]
