"""DICOM files with deterministic UIDs, and lazy imports of the libraries."""

from __future__ import annotations

import hashlib
import uuid
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tsis.errors import RecordsError, import_extra
from tsis.files import add_files

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pydicom.dataset import Dataset


def pydicom(part: str = "") -> Any:
    """Pydicom or a module of it."""
    return import_extra(f"pydicom.{part}" if part else "pydicom", feature="DICOM", extra="dicom")


def highdicom(part: str = "") -> Any:
    """Highdicom or a module of it."""
    return import_extra(f"highdicom.{part}" if part else "highdicom", feature="a DICOM report", extra="dicom")


IMPLEMENTATION = "2.25." + str(uuid.uuid5(uuid.NAMESPACE_DNS, "tsis.implementation").int)


@dataclass(frozen=True, slots=True, kw_only=True)
class DicomFile:
    """An instance as a file, explicit VR little endian, named ``tsis-<pseudonym>-<series>-<what>-<number>.dcm``."""

    name: str
    content: bytes
    sop_class_uid: str
    sop_instance_uid: str

    def dataset(self) -> Dataset:
        """The instance as pydicom reads it."""
        dataset: Dataset = pydicom().dcmread(BytesIO(self.content))
        return dataset


def deterministic_uid(*parts: str | bytes) -> str:
    """A UID below 2.25 (PS3.5 B.2) from a UUID of version 5 of the parts."""
    result = hashlib.sha256(b"tsis dicom")
    for part in parts:
        raw = part.encode() if isinstance(part, str) else part
        result.update(len(raw).to_bytes(8, "big") + raw)
    return f"2.25.{uuid.UUID(bytes=result.digest()[:16], version=5).int}"


def sealed(dataset: Dataset, name: str) -> DicomFile:
    """Set the UID of an instance from its content, and write it.

    Equal content gives equal bytes and UIDs, and a UID never identifies two contents.
    """
    dataset.SOPInstanceUID = deterministic_uid("unsealed")
    dataset.SOPInstanceUID = deterministic_uid("instance", _bytes(dataset))
    return DicomFile(
        name=name,
        content=_bytes(dataset),
        sop_class_uid=str(dataset.SOPClassUID),
        sop_instance_uid=str(dataset.SOPInstanceUID),
    )


def _bytes(dataset: Dataset) -> bytes:
    meta = pydicom("dataset").FileMetaDataset()
    meta.MediaStorageSOPClassUID = dataset.SOPClassUID
    meta.MediaStorageSOPInstanceUID = dataset.SOPInstanceUID
    meta.TransferSyntaxUID = pydicom("uid").ExplicitVRLittleEndian
    meta.ImplementationClassUID = IMPLEMENTATION
    meta.ImplementationVersionName = "TSIS"
    dataset.file_meta = meta
    with BytesIO() as file:
        pydicom().dcmwrite(file, dataset, enforce_file_format=True)
        return file.getvalue()


def write_files(files: Iterable[DicomFile], folder: Path) -> tuple[Path, ...]:
    """Write all files or none, except those that exist with the same content.

    `RecordsError` when a file cannot be written, or exists with other content.
    """
    folder = Path(folder)
    planned = {file.name: file.content for file in files}
    try:
        there = {name for name in planned if (folder / name).exists()}
        for name in sorted(there):
            if (folder / name).read_bytes() != planned[name]:
                raise RecordsError(
                    f"{folder / name} is there with another content, which an export does not replace; name an empty "
                    "folder"
                )
        add_files(folder, {name: content for name, content in planned.items() if name not in there})
    except OSError as error:
        raise RecordsError(f"the DICOM files cannot be written to {folder}: {error.strerror or error}") from error
    return tuple(folder / name for name in planned)
