from __future__ import annotations

from pathlib import Path

import pytest

SHARED = Path(__file__).resolve().parents[2] / "shared" / "data"


@pytest.fixture
def shared_data() -> Path:
    """Folder of real frames and reference values, kept beside the repository and not in it."""
    if not SHARED.is_dir():
        pytest.skip("the folder shared/data beside the repository, with the real frames, is absent")
    return SHARED
