"""A target as one tree of arrays with their units, as HDF5 or as Zarr: the same layout in both."""

from tsis.records.export.arrays._formats import write_hdf5, write_zarr

__all__ = ["write_hdf5", "write_zarr"]
