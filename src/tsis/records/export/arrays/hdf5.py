"""The layout as an HDF5 file."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from tsis.model.errors import FileInputError
from tsis.model.extra import import_extra
from tsis.records.export.arrays.layout import write_layout
from tsis.records.export.arrays.spilling import SpillingFile
from tsis.records.export.arrays.tree import GZIP_LEVEL
from tsis.records.export.whole import export_file

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping

    from tsis.records.dossier import TargetRecord
    from tsis.records.export.arrays.tree import Attribute, Shape


def write_hdf5(dossier: TargetRecord, path: str | os.PathLike[str]) -> None:
    """Write a dossier as one new HDF5 file, frame by frame; it appears whole or not at all.

    Raises
    ------
    MissingExtraError
        When h5py is not installed.
    FileInputError
        When there is such a file, or it cannot be written.
    RecordsError
        When a frame is not what its press says.
    """
    h5py = import_extra("h5py", feature="HDF5 export", extra="exchange")
    with export_file(path) as draft, SpillingFile(draft) as out:
        try:
            with h5py.File(out, "w", track_order=True) as file:
                write_layout(dossier, _Hdf5Tree(file, out))
        except RuntimeError as error:  # as HDF5 says what it cannot hold
            raise FileInputError(f"the file of HDF5 must be one that can be written; got: {error}") from error


class _Hdf5Tree:
    def __init__(self, file: Any, out: SpillingFile) -> None:
        self.file, self.out = file, out

    def group(self, path: str, attributes: Mapping[str, Attribute]) -> None:
        self.file.require_group(path or "/").attrs.update(attributes)

    def create(self, path: str, shape: Shape, dtype: str, chunks: Shape, attributes: Mapping[str, Attribute]) -> Any:
        filters = {"compression": "gzip", "compression_opts": GZIP_LEVEL, "shuffle": True, "fletcher32": True}
        found = self.file.create_dataset(path, shape=shape, dtype=dtype, chunks=chunks, **filters)
        found.attrs.update(attributes)
        return _Asking(found, self.out)


class _Asking:
    """A dataset that asks after each part whether the disk took it."""

    def __init__(self, dataset: Any, out: SpillingFile) -> None:
        self.dataset, self.out = dataset, out

    def __setitem__(self, at: Any, values: Any) -> None:
        self.dataset[at] = values
        self.out.require_written()
