"""What a long benchmark has finished, a line of JSON each, so that it goes on where it was interrupted."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pathlib import Path


def read_lines(path: Path | None, key: str) -> dict[Any, dict[str, Any]]:
    """Whole lines of an earlier run by their ``key``; the one that it was writing when it was cut off is left out."""
    found = {}
    for text in path.read_text().splitlines() if path is not None and path.exists() else ():
        try:
            line = json.loads(text)
        except json.JSONDecodeError:
            continue
        found[line[key]] = line
    return found


def append_line(path: Path | None, line: dict[str, Any]) -> None:
    """Append a line, where lines are kept."""
    if path is None:
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a") as file:
        file.write(f"\n{json.dumps(line)}")  # the break comes first: half a line stays a line of its own
