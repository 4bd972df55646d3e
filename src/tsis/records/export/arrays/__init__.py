"""A target as one tree of arrays with their units, as HDF5 or as Zarr: the same layout in both."""

from tsis.records.export.arrays.hdf5 import write_hdf5
from tsis.records.export.arrays.zarr_store import write_zarr

__all__ = ["write_hdf5", "write_zarr"]
