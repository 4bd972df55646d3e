"""What computed a result: this program's code and the libraries that can change its digits."""

from __future__ import annotations

import hashlib
import platform
from functools import cache
from importlib import metadata, resources
from typing import TYPE_CHECKING, Any

from tsis.__about__ import __version__

if TYPE_CHECKING:
    from collections.abc import Iterator
    from importlib.resources.abc import Traversable

LIBRARIES = ("numpy", "scipy", "numba", "scikit-image", "opencv-python-headless")


def environment() -> dict[str, Any]:
    """Versions of program, language and libraries, and the SHA-256 of the program's code."""
    return {
        "tsis": __version__,
        "code_sha256": code_sha256(),
        "python": platform.python_version(),
        "machine": platform.machine(),
        "libraries": {name: metadata.version(name) for name in LIBRARIES},
    }


@cache
def code_sha256() -> str:
    """SHA-256 over every file of this package that can change a result: two equal ones computed by equal code."""
    found = hashlib.sha256()
    for name, file in sorted(_files(resources.files("tsis"), "")):
        content = file.read_bytes()
        found.update(f"{name}\0{len(content)}\0".encode() + content)
    return found.hexdigest()


def _files(folder: Traversable, place: str) -> Iterator[tuple[str, Traversable]]:
    for each in folder.iterdir():
        name = f"{place}/{each.name}"
        if each.is_dir():
            yield from _files(each, name)
        elif each.name.endswith((".py", ".toml", ".npz")):
            yield name, each
