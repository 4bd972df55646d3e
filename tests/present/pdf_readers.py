"""PDF files read by programs that did not write them: poppler's, and a search in the file's own objects."""

from __future__ import annotations

import re
import shutil
import subprocess
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from pathlib import Path


def sheet_count(content: bytes) -> int:
    """Number of page objects in a file."""
    return len(re.findall(rb"/Type /Page\b(?!s)", content))


def poppler(program: str, *arguments: str | Path) -> str:
    """What one of poppler's programs prints."""
    found = shutil.which(program)
    if found is None:
        pytest.skip(f"{program} of poppler-utils is absent")
    done = subprocess.run([found, *map(str, arguments)], capture_output=True, check=True)
    assert done.stderr == b"", "poppler complains about the file"
    return done.stdout.decode()


def sheets(content: bytes, folder: Path) -> list[str]:
    """Text of each sheet, blanks and line ends as one blank, as poppler reads it."""
    path = folder / "read.pdf"
    path.write_bytes(content)
    return [" ".join(sheet.split()) for sheet in poppler("pdftotext", "-layout", path, "-").split("\f")[:-1]]
