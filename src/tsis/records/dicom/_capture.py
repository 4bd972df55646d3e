"""Secondary Capture instances of the frames."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.errors import RecordsError
from tsis.records._deidentify import from_camera
from tsis.records._values import ROLE_NAMES, ROLES
from tsis.records.dicom._files import pydicom
from tsis.records.dicom._identity import dicom_line
from tsis.records.dicom._modules import Series, describe

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator
    from datetime import datetime

    from numpy.typing import NDArray
    from pydicom.dataset import Dataset

    from tsis.records._target_record import TargetRecord
    from tsis.records._values import StoredPress
    from tsis.records.dicom._identity import ExportIdentity


MOST_BYTES = 2**28  # of pixels in an instance, accepted by archives and far below DICOM's limit of 4 GiB
OTHER_PROBE = 10  # between the numbers of series of one role and different probes: 1, 11, 21, ...


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stack:
    """Presses of one role, probe, size, depth and scale, in the order of their times."""

    role: str
    probe: str  # empty where unknown
    series: int  # number of the series of this role and probe
    started: datetime  # time of the first press of the series
    number: int  # of the instance in its series, from 1
    presses: tuple[StoredPress, ...]  # one for each frame
    levels: NDArray[Any]  # shape (frames, rows, columns), uint8 or uint16

    def contains(self, presses: Collection[str]) -> bool:
        """Whether it has a frame of these presses, by identity."""
        return any(press.id in presses for press in self.presses)


def stacks(record: TargetRecord) -> Iterator[Stack]:
    """Stacks of equal frames by role and probe; `RecordsError` when a frame does not match its press."""
    for index, role in enumerate(ROLES, start=1):
        pressed = sorted((press for press in record.presses if press.role == role), key=lambda item: item.taken)
        for other, probe in enumerate(dict.fromkeys(press.probe for press in pressed)):
            presses = [press for press in pressed if press.probe == probe]
            yield from _series(record, presses, index + other * OTHER_PROBE)


def _series(record: TargetRecord, presses: list[StoredPress], number: int) -> Iterator[Stack]:
    kinds: dict[tuple[Any, ...], list[tuple[StoredPress, NDArray[Any]]]] = {}
    for press in presses:
        levels = record.levels(press)
        kinds.setdefault((levels.shape, levels.dtype, press.mm_per_pixel, press.full_scale), []).append((press, levels))
    instances = itertools.count(1)
    for frames in kinds.values():
        most = max(1, MOST_BYTES // frames[0][1].nbytes)
        for first in range(0, len(frames), most):
            some = frames[first : first + most]
            yield Stack(
                role=presses[0].role,
                probe=presses[0].probe,
                series=number,
                started=presses[0].taken,
                number=next(instances),
                presses=tuple(press for press, _ in some),
                levels=np.stack([levels for _, levels in some]),
            )


def increments_ms(presses: tuple[StoredPress, ...]) -> list[str]:
    """Intervals between frames in milliseconds as decimal strings, the first 0."""
    times = [press.taken for press in presses]
    gaps = [0.0, *((late - early).total_seconds() * 1e3 for early, late in itertools.pairwise(times))]
    return [decimal(gap) for gap in gaps]


def decimal(value: float) -> str:
    """A number as a DICOM decimal string, at most 16 characters, with as many digits as fit."""
    if not math.isfinite(value):
        raise RecordsError(f"a number of a DICOM file must be finite; got {value}")
    for digits in range(17, 0, -1):
        text = f"{value:.{digits}g}"
        if len(text) <= 16:
            return text
    raise AssertionError(value)  # one digit with sign and exponent has at most 7 characters


FRAME_TIME_VECTOR = 0x00181065
LONGEST_TEXT = 10_000  # of the value representation LT


def capture(stack: Stack, cover: ExportIdentity) -> Dataset:
    """A Secondary Capture instance of a stack, still without a UID.

    One frame becomes a Secondary Capture Image, more a Multi-frame Grayscale Byte (8 bit) or Word (16 bit) one.
    """
    dataset: Dataset = pydicom().Dataset()
    dataset.SOPClassUID = _sop_class(stack)
    probe = dicom_line(stack.probe)
    series = Series(
        number=stack.series,
        what=f"{stack.role}, {stack.probe}",
        description=f"{'Frames' if stack.role == 'untouched' else 'Presses'} {ROLE_NAMES[stack.role]}"
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
    dataset.Laterality = ""  # required for a part that may be paired; unknown
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
        dataset.PixelSpacing = [decimal(y), decimal(x)]  # distance of rows first


def _display(dataset: Dataset, stack: Stack) -> None:
    """Set the display window from black to full scale."""
    full = stack.presses[0].full_scale
    dataset.WindowCenter, dataset.WindowWidth = decimal((full + 1) / 2), decimal(full + 1)
    dataset.PresentationLUTShape = "IDENTITY"


def _frames(dataset: Dataset, stack: Stack) -> None:
    dataset.NumberOfFrames = len(stack.presses)
    dataset.FrameIncrementPointer = FRAME_TIME_VECTOR
    dataset.FrameTimeVector = increments_ms(stack.presses)
    # Required for multiple frames: an image file may contain text, a camera frame does not.
    dataset.BurnedInAnnotation = "NO" if all(from_camera(press) for press in stack.presses) else "YES"
    dataset.RescaleIntercept, dataset.RescaleSlope, dataset.RescaleType = "0", "1", "US"
