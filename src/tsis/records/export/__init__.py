"""A target in open forms: tables, netCDF, Zarr, and a bundle that another store takes in."""

from tsis.records.export._csv import csv_files, write_csv
from tsis.records.export._whole import export_file, export_folder

__all__ = ["csv_files", "export_file", "export_folder", "write_csv"]
