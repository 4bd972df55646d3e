"""The exchange bundle: a target as a folder or zip file that another store takes in, every byte of it hashed."""

from tsis.records.export.bundle.reading import read_bundle
from tsis.records.export.bundle.writing import write_bundle

__all__ = ["read_bundle", "write_bundle"]
