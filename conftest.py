"""Every test run starts with an empty cache of its own, shared by the run's workers and removed at its end."""

from __future__ import annotations

import gc
import os
import shutil
import tempfile
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pytest

CACHE = "TSIS_CACHE_DIR"
collect_ignore = ["src/tsis/records/migrations/env.py"]  # which Alembic alone can run


def pytest_configure(config: pytest.Config) -> None:
    """Make the cache before the workers start."""
    if not hasattr(config, "workerinput"):  # workers inherit the controller's environment
        os.environ[CACHE] = tempfile.mkdtemp(prefix="tsis-test-cache-")


def pytest_collection_finish() -> None:
    """Leave what was loaded for the tests alone from now on: looking through it stops a worker for half a second."""
    gc.collect()
    gc.freeze()


def pytest_unconfigure(config: pytest.Config) -> None:
    """Remove the cache when the last worker is gone."""
    if not hasattr(config, "workerinput"):
        shutil.rmtree(os.environ.pop(CACHE), ignore_errors=True)
