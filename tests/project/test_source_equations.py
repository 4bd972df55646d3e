"""Every equation of the dissertation that is computed here is named where it is: searching "5.13" finds its code."""

from __future__ import annotations

import ast
import io
import re
import tokenize
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

import tsis

if TYPE_CHECKING:
    from collections.abc import Iterator

SOURCE = Path(tsis.__file__).parent
NUMBER = re.compile(r"\((?P<chapter>[2-6])\.(?P<equation>\d+)\)")


def run(chapter: int, first: int, last: int) -> list[str]:
    return [f"({chapter}.{number})" for number in range(first, last + 1)]


EQUATIONS = {  # what each group is about, and its equations
    "sensitivity and specificity": run(2, 2, 3),
    "wave equation, fields and phases of the slab": run(3, 9, 27) + run(3, 29, 59),
    "Snell's law and acceptance": [*run(3, 60, 64), "(3.67)"],
    "effective modulus": ["(3.78)"],
    "modulus, pressure, force and stress": run(5, 1, 5),
    "point matching": run(5, 6, 13),
    "thin-plate spline": run(5, 14, 16),
    "strain and hardness": run(5, 17, 18),
    "relative size": run(6, 1, 2),
    "centroid, relative depth and hardness": run(6, 7, 10),
    "shape": run(6, 11, 13),
    "mobility": ["(6.14)"],
    "error of an estimate": ["(6.15)"],
}


def explanations(path: Path) -> Iterator[str]:
    """Docstrings and comments."""
    source = path.read_text(encoding="utf-8")
    if not NUMBER.search(source):
        return
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            yield token.string
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
            yield ast.get_docstring(node) or ""


@cache
def named() -> dict[str, set[str]]:
    """By the equations that docstrings and comments name, the files that name them."""
    found: dict[str, set[str]] = {}
    for path in sorted(SOURCE.rglob("*.py")):
        for text in explanations(path):
            for match in NUMBER.finditer(text):
                found.setdefault(match[0], set()).add(path.relative_to(SOURCE).as_posix())
    return found


@pytest.mark.parametrize("about", EQUATIONS)
def test_every_equation_is_named_where_it_is_computed(about: str) -> None:
    assert [equation for equation in EQUATIONS[about] if equation not in named()] == []


@pytest.mark.parametrize(
    ("equation", "file"),
    [
        ("(3.46)", "optics/slab.py"),
        ("(3.67)", "optics/angles.py"),
        ("(3.78)", "mechanics/closed_forms.py"),
        ("(5.4)", "calibration/force_line.py"),
        ("(5.13)", "matching/relaxation.py"),
        ("(5.17)", "hardness/strain_map.py"),
        ("(6.9)", "inclusion/relative.py"),
        ("(6.14)", "inclusion/mobility.py"),
    ],
)
def test_the_number_leads_to_the_file_that_computes_it(equation: str, file: str) -> None:
    assert file in named()[equation]
