"""Frames as Secondary Capture instances, with the pixels as the camera gave them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.records.deidentified import from_camera
from tsis.records.dicom.cover import dicom_line
from tsis.records.dicom.libraries import pydicom
from tsis.records.dicom.modules import Series, describe
from tsis.records.dicom.series import decimal, increments_ms
from tsis.records.values import ROLE_WORDS

if TYPE_CHECKING:
    from pydicom.dataset import Dataset

    from tsis.records.dicom.cover import ExportIdentity
    from tsis.records.dicom.series import Stack

FRAME_TIME_VECTOR = 0x00181065
LONGEST_TEXT = 10_000  # of the value representation LT


def capture(stack: Stack, cover: ExportIdentity) -> Dataset:
    """A Secondary Capture instance of a stack; it has no UID of its own yet.

    One frame becomes a Secondary Capture Image, more a Multi-frame Grayscale Byte (8 bit) or Word (16 bit) one.
    """
    dataset: Dataset = pydicom().Dataset()
    dataset.SOPClassUID = _sop_class(stack)
    probe = dicom_line(stack.probe)
    series = Series(
        number=stack.series,
        what=f"{stack.role}, {stack.probe}",
        description=f"{'Frames' if stack.role == 'untouched' else 'Presses'} {ROLE_WORDS[stack.role]}"
        + (f", probe {probe}" if probe else ""),
        modality="OT",
        started=stack.started,
    )
    describe(dataset, cover, series)
    _image(dataset, stack, cover)
    _pixels(dataset, stack)
    _display(dataset, stack)
    if len(stack.presses) > 1:
        _frames(dataset, stack)
    return dataset


def _sop_class(stack: Stack) -> Any:
    uid = pydicom("uid")
    if len(stack.presses) == 1:
        return uid.SecondaryCaptureImageStorage
    if stack.levels.dtype == np.uint8:
        return uid.MultiFrameGrayscaleByteSecondaryCaptureImageStorage
    return uid.MultiFrameGrayscaleWordSecondaryCaptureImageStorage


def _image(dataset: Dataset, stack: Stack, cover: ExportIdentity) -> None:
    dataset.InstanceNumber = stack.number
    dataset.ImageType = ["ORIGINAL", "SECONDARY"]
    dataset.ConversionType = "DI"
    dataset.Laterality = ""  # of a series that may be of a paired part; nobody told us of which side
    dataset.PatientOrientation = ""
    dataset.LossyImageCompression = "00"
    dataset.ImageComments = RESEARCH_USE_ONLY
    dataset.ContentDate, dataset.ContentTime = cover.moment(stack.presses[0].taken) or ("", "")
    if moment := cover.moment(stack.presses[0].taken):
        dataset.AcquisitionDate, dataset.AcquisitionTime = moment
        dataset.AcquisitionDateTime = "".join(moment)
        names = ", ".join(dicom_line(press.name) or "unnamed" for press in stack.presses)
        dataset.ImageComments = dicom_line(f"{RESEARCH_USE_ONLY} Frames: {names}", LONGEST_TEXT)


def _pixels(dataset: Dataset, stack: Stack) -> None:
    _, rows, columns = stack.levels.shape
    byte = stack.levels.dtype == np.uint8
    highest = max(int(stack.levels.max()), int(stack.presses[0].full_scale))
    dataset.SamplesPerPixel, dataset.PhotometricInterpretation = 1, "MONOCHROME2"
    dataset.Rows, dataset.Columns = rows, columns
    dataset.BitsAllocated = 8 if byte else 16
    dataset.BitsStored = 8 if byte else min(16, max(9, highest.bit_length()))
    dataset.HighBit = dataset.BitsStored - 1
    dataset.PixelRepresentation = 0
    raw = stack.levels.astype("u1" if byte else "<u2").tobytes()
    dataset.add_new("PixelData", "OB" if byte else "OW", raw + b"\0" * (len(raw) % 2))
    if scale := stack.presses[0].mm_per_pixel:
        x, y = scale
        dataset.PixelSpacing = [decimal(y), decimal(x)]  # distance of rows first, as DICOM has it


def _display(dataset: Dataset, stack: Stack) -> None:
    """Show everything from black to where the camera clips."""
    full = stack.presses[0].full_scale
    dataset.WindowCenter, dataset.WindowWidth = decimal((full + 1) / 2), decimal(full + 1)
    dataset.PresentationLUTShape = "IDENTITY"


def _frames(dataset: Dataset, stack: Stack) -> None:
    dataset.NumberOfFrames = len(stack.presses)
    dataset.FrameIncrementPointer = FRAME_TIME_VECTOR
    dataset.FrameTimeVector = increments_ms(stack.presses)
    # Must be told of many frames, and nobody looked at any: a file may have writing in it, a camera writes none.
    dataset.BurnedInAnnotation = "NO" if all(from_camera(press) for press in stack.presses) else "YES"
    dataset.RescaleIntercept, dataset.RescaleSlope, dataset.RescaleType = "0", "1", "US"
