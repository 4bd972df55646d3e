"""The code of the notebooks and of the README's five lines, as scripts that a fresh environment runs."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
NOTEBOOKS = tuple(sorted((ROOT / "docs" / "notebooks").glob("*.ipynb")))


def read_notebook(path: Path) -> dict[str, Any]:
    """The document of a notebook."""
    document: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return document


def code_of(path: Path) -> str:
    """The code of all cells of a notebook, without the commands of IPython."""
    cells = ("".join(cell["source"]) for cell in read_notebook(path)["cells"] if cell["cell_type"] == "code")
    return "\n\n".join(re.sub(r"(?m)^%.*\n", "", cell) for cell in cells) + "\n"


def five_lines() -> str:
    """The five lines of the README that lead from saved frames to an answer."""
    page = (ROOT / "README.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(import tsis\n.*?)```", page, re.DOTALL)
    return str(code)
