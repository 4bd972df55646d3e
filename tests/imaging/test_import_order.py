from __future__ import annotations

import subprocess
import sys

import pytest

import tsis.imaging

ORDERS = (
    "import tsis.imaging.features",
    "from tsis.imaging.features import Features",
    "from tsis.imaging import features",
    "import tsis.imaging.surface, tsis.imaging.features",
    "import tsis.imaging, importlib; importlib.import_module('tsis.imaging.features')",
    "import importlib; importlib.import_module('tsis.imaging.features')",
)


@pytest.mark.parametrize("first", ORDERS)
def test_features_and_surface_are_calls_whatever_was_imported_first(first: str) -> None:
    code = f"{first}\nimport tsis.imaging as room\nprint(type(room.features).__name__, type(room.surface).__name__)"
    printed = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout
    assert printed.split() == ["function", "function"]


def test_collecting_the_tests_leaves_the_calls_in_place() -> None:
    assert callable(tsis.imaging.features)
    assert callable(tsis.imaging.surface)
