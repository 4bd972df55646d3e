"""Export of a target record as a tree of arrays with units, in HDF5 or Zarr with the same layout."""

from tsis.records.export.arrays._formats import write_hdf5, write_zarr

__all__ = ["write_hdf5", "write_zarr"]
