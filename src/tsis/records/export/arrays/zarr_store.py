"""The layout as a folder of Zarr format 3.

Not consolidated: consolidated metadata are no part of that format, and a folder on a disk does not need them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from tsis.model.extra import import_extra
from tsis.records.export.arrays.layout import write_layout
from tsis.records.export.arrays.tree import GZIP_LEVEL
from tsis.records.export.whole import export_folder

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping

    from tsis.records.dossier import TargetRecord
    from tsis.records.export.arrays.tree import Attribute, Shape


def write_zarr(dossier: TargetRecord, path: str | os.PathLike[str]) -> None:
    """Write a dossier as one new folder of Zarr format 3, frame by frame; it appears whole or not at all.

    Raises
    ------
    MissingExtraError
        When zarr is not installed.
    FileInputError
        When there is such a folder, or it cannot be written.
    RecordsError
        When a frame is not what its press says.
    """
    zarr = import_extra("zarr", feature="Zarr export", extra="exchange")
    codecs = import_extra("zarr.codecs", feature="Zarr export", extra="exchange")
    with export_folder(path) as draft:
        write_layout(dossier, _ZarrTree(zarr.create_group(str(draft), zarr_format=3), codecs))


class _ZarrTree:
    def __init__(self, root: Any, codecs: Any) -> None:
        self.root = root
        # Gzip is in the specification, which Zstandard is not; a check sum finds what a disk has changed.
        self.codecs = (codecs.GzipCodec(level=GZIP_LEVEL), codecs.Crc32cCodec())

    def group(self, path: str, attributes: Mapping[str, Attribute]) -> None:
        (self.root.require_group(path) if path else self.root).attrs.update(attributes)

    def create(self, path: str, shape: Shape, dtype: str, chunks: Shape, attributes: Mapping[str, Attribute]) -> Any:
        return self.root.create_array(
            path,
            shape=shape,
            dtype=dtype,
            chunks=chunks,
            compressors=self.codecs,
            fill_value=0,
            attributes=dict(attributes),
            config={"write_empty_chunks": True},  # a lost chunk would else read as black
        )
