"""The optional libraries, imported when a feature first needs them."""

from __future__ import annotations

from typing import Any

from tsis.model.extra import import_extra


def pydicom(part: str = "") -> Any:
    """pydicom, or a module of it."""
    return import_extra(f"pydicom.{part}" if part else "pydicom", feature="DICOM", extra="dicom")


def highdicom(part: str = "") -> Any:
    """highdicom, or a module of it."""
    return import_extra(f"highdicom.{part}" if part else "highdicom", feature="a DICOM report", extra="dicom")
