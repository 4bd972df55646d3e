"""The exchange bundle: a target record as a folder or zip file for another store, with hashes of all files."""

from tsis.records.export.bundle._layout import DOCUMENTS
from tsis.records.export.bundle._reading import read_bundle
from tsis.records.export.bundle._writing import write_bundle

__all__ = ["DOCUMENTS", "read_bundle", "write_bundle"]
