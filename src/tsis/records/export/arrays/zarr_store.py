"""The layout as a folder of Zarr format 3.

Not consolidated: consolidated metadata are no part of that format, and a folder on a disk does not need them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from tsis.model.extra import library
from tsis.records.export.arrays.layout import write_layout
from tsis.records.export.whole import new_folder

if TYPE_CHECKING:
    import os
    from collections.abc import Iterable, Mapping

    from numpy.typing import NDArray

    from tsis.records.dossier import Dossier
    from tsis.records.export.arrays.tree import Attribute

LEVEL = 4  # of gzip


def write_zarr(dossier: Dossier, path: str | os.PathLike[str]) -> None:
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
    zarr = library("zarr", feature="Zarr export", extra="exchange")
    codecs = library("zarr.codecs", feature="Zarr export", extra="exchange")
    with new_folder(path) as draft:
        write_layout(dossier, _ZarrTree(zarr.create_group(str(draft), zarr_format=3), codecs))


class _ZarrTree:
    def __init__(self, root: Any, codecs: Any) -> None:
        self.root = root
        # Gzip is in the specification, which Zstandard is not; a check sum finds what a disk has changed.
        self.codecs = (codecs.GzipCodec(level=LEVEL), codecs.Crc32cCodec())

    def group(self, path: str, attributes: Mapping[str, Attribute]) -> None:
        (self.root.require_group(path) if path else self.root).attrs.update(attributes)

    def array(self, path: str, values: NDArray[Any], attributes: Mapping[str, Attribute]) -> None:
        self._array(path, values.shape, str(values.dtype), values.shape, attributes)[...] = values

    def stack(
        self,
        path: str,
        frames: Iterable[NDArray[Any]],
        shape: tuple[int, int, int],
        dtype: str,
        attributes: Mapping[str, Attribute],
    ) -> None:
        array = self._array(path, shape, dtype, (1, *shape[1:]), attributes)
        for at, frame in enumerate(frames):
            array[at] = frame

    def _array(
        self,
        path: str,
        shape: tuple[int, ...],
        dtype: str,
        chunks: tuple[int, ...],
        attributes: Mapping[str, Attribute],
    ) -> Any:
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
