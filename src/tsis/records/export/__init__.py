"""A target in open forms: tables, HDF5, Zarr, FHIR, and a bundle that another store takes in."""

from tsis.records.export.arrays import write_hdf5, write_zarr
from tsis.records.export.bundle import read_bundle, write_bundle
from tsis.records.export.csv_files import csv_files, write_csv
from tsis.records.export.fhir import fhir_observations

__all__ = ["csv_files", "fhir_observations", "read_bundle", "write_bundle", "write_csv", "write_hdf5", "write_zarr"]
