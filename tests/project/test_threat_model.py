"""Each line of the threat model names a test that exists, and the page links to what is left open."""

from __future__ import annotations

import ast
import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "explanation" / "threat-model.md"
NAMED = re.compile(r"`(tests/[\w/]+\.py)::(\w+)`")


def rows(text: str) -> list[str]:
    """Lines of the tables whose last column is a test."""
    found, inside = [], False
    for line in text.splitlines():
        inside = line.startswith("|") and (inside or line.endswith("| test |"))
        if inside and not line.startswith(("| threat", "| ---")):
            found.append(line)
    return found


def test_every_line_names_a_test_that_exists() -> None:
    lines = rows(PAGE.read_text(encoding="utf-8"))
    assert len(lines) > 35
    for line in lines:
        named = NAMED.findall(line)
        assert named, line
        for path, name in named:
            tree = ast.parse((ROOT / path).read_text(encoding="utf-8"))
            assert name in {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}, (
                f"{path}::{name}"
            )


def test_every_part_says_what_does_not_hold() -> None:
    parts = PAGE.read_text(encoding="utf-8").split("\n## ")[1:]
    with_tables = [part for part in parts if "| test |" in part]
    assert len(with_tables) == 5
    assert all("Not held:" in part for part in with_tables)
