"""The exchange bundle: a target as a folder or zip file that another store takes in, every byte of it hashed."""

from tsis.records.export.bundle._layout import DOCUMENTS
from tsis.records.export.bundle._reading import read_bundle
from tsis.records.export.bundle._writing import write_bundle

__all__ = ["DOCUMENTS", "read_bundle", "write_bundle"]
