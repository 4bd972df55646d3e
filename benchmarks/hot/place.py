"""What contests need of the machine that they run on."""

from __future__ import annotations

import os
from dataclasses import dataclass
from importlib import import_module, metadata
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Where a run takes place.

    Attributes
    ----------
    folder
        For files; on the disk that is measured.
    peer_python
        Python of the environment of the programs that run by themselves.
    """

    folder: Path
    peer_python: str

    @property
    def cores(self) -> int:
        """Number of processors that may be used."""
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def version(package: str) -> str | None:
    """The version that is installed; None where it is not."""
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def missing(package: str, module: str | None = None) -> str:
    """Why a package cannot be used here; empty when it can."""
    try:
        import_module(module or package)
    except ModuleNotFoundError as error:
        return f"{error.name} is not installed"
    except Exception as error:  # libraries that want other libraries fail in any way
        return f"{package} cannot be loaded: {error!s:.80}"
    return ""
