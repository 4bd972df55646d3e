from __future__ import annotations

import subprocess
import sys

import pytest

pytestmark = pytest.mark.system

ORDERS = (
    "import tsis.imaging",
    "import tsis.imaging._features, tsis.imaging._height_surface",
    "from tsis.imaging._features import Features",
    "import tsis; tsis.imaging",
    "import importlib; importlib.import_module('tsis.imaging._features')",
    # What a test runner does that collects one file by its path.
    "import importlib, tsis.imaging as r; "
    "[importlib.reload(importlib.import_module(f'tsis.imaging.{n}')) for n in ('contact_features', 'height_surface')]",
)


@pytest.mark.parametrize("first", ORDERS)
def test_features_and_surface_are_calls_whatever_was_imported_first(first: str) -> None:
    code = f"{first}\nimport tsis.imaging as room\nprint(type(room.features).__name__, type(room.surface).__name__)"
    printed = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout
    assert printed.split() == ["function", "function"]


def test_no_file_of_the_room_bears_the_name_of_a_call() -> None:
    code = (
        "import pkgutil, tsis.imaging as room\n"
        "files = {m.name for m in pkgutil.iter_modules(room.__path__)}\n"
        "print(sorted(files & set(room.__all__)))"
    )
    printed = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout
    assert printed.strip() == "[]"
