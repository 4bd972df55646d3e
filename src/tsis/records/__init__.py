"""Stored targets, presses and estimates: durable, verifiable, exported."""

from typing import TYPE_CHECKING

import lazy_loader

from tsis.errors import require_extra

require_extra("sqlalchemy", feature="the store of records", extra="records")

if not TYPE_CHECKING:  # modules load when they are first used
    __getattr__ = lazy_loader.attach(
        __name__,
        [
            "arrays",
            "audit",
            "blobs",
            "database",
            "deidentification",
            "dicom",
            "export",
            "importing",
            "map_dicom",
            "places",
            "provenance",
            "reader",
            "recomputation",
            "rows",
            "schema",
            "sources",
            "staleness",
            "store",
            "target",
            "transfer",
            "values",
        ],
    )[0]
