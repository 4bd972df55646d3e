"""How this program is cited, and on what terms it may be used."""

from __future__ import annotations

from importlib import metadata

from tsis.__about__ import __version__

TITLE = "tsis: open software for optical tactile imaging"
AUTHORS = "the TSIS founders"
THESIS = (
    'J.-H. Lee, "Tactile Sensation Imaging System and Algorithms for Tumor Detection", Ph.D. dissertation, '
    "Temple University, 2011"
)
LICENCE = "BSD-3-Clause"


def citation() -> tuple[str, ...]:
    """What to cite: the program, and the dissertation whose system it describes."""
    return (f"{AUTHORS}, {TITLE}, version {__version__}.", f"{THESIS}.")


def licence() -> str:
    """The licence's whole text; its name alone where the installation came without the file."""
    return metadata.distribution("tsis").read_text("licenses/LICENSE") or LICENCE
