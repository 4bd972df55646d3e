"""A loader of files, with whole files that it takes and what it promises of them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from tests.hostile.bytes_changed import damaged

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable, Mapping
    from pathlib import Path

    import numpy as np

FORGED = 0.4  # share of the files whose checksums are made right again, where the format has any


@dataclass(frozen=True, slots=True, kw_only=True)
class Loader:
    """What reads one kind of file.

    Parameters
    ----------
    name
        What tables call it.
    file
        Name of the file that is changed, inside a folder of its own.
    originals
        Whole files of the kind.
    load
        Reads the file, and returns what tells one value from another.
    integrity
        Whether the file carries a checksum or hash that the loader promises to check.
    text
        Whether the file is text.
    forge
        Changes a file and makes its checksums right again; None where the kind has none that could be.
    around
        Other files of the folder, by name.
    settle
        Called with the folder after a forged file was written, e.g. to make a manifest agree.
    share
        How many files it gets compared with the others; slow decoders get fewer.
    """

    name: str
    file: str
    originals: tuple[bytes, ...]
    load: Callable[[Path], Hashable]
    integrity: bool = False
    text: bool = False
    forge: Callable[[bytes, np.random.Generator], bytes] | None = None
    around: Mapping[str, bytes] = field(default_factory=dict)
    settle: Callable[[Path], None] | None = None
    share: float = 1.0

    def mutated(self, rng: np.random.Generator) -> tuple[int, bytes, bool]:
        """Which original, its bytes after damage, and whether its checksums were made right again."""
        which, other = (int(rng.integers(len(self.originals))) for _ in range(2))
        original = self.originals[which]
        if self.forge is not None and rng.random() < FORGED:
            return which, self.forge(original, rng), True
        return which, damaged(original, self.originals[other], rng, text=self.text), False

    def laid(self, folder: Path) -> Path:
        """The folder with the files around, and the path of the file that is changed."""
        for name, content in self.around.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(content)
        path = folder / self.file
        path.parent.mkdir(parents=True, exist_ok=True)
        return path
