"""Flags of inclusion and hardness: each is declared in one place, raised from there, and printed so in its page."""

from __future__ import annotations

import ast
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

import tsis
from tsis.hardness import flags as hardness_flags
from tsis.hardness.curve_flags import INDENTATION_FLAGS
from tsis.hardness.flags import HARDNESS_FLAGS
from tsis.inclusion import flags as inclusion_flags
from tsis.inclusion.flags import INCLUSION_FLAGS
from tsis.model.flag import Flag

if TYPE_CHECKING:
    from collections.abc import Mapping
    from types import ModuleType

SOURCE, DOCS = Path(tsis.__file__).parent, Path(__file__).parents[2] / "docs"
COMPARISONS = {"relative.py", "shape.py", "mobility.py"}  # their flags are the notes of `tsis.inclusion.relative`
KINDS = {
    "inclusion": (inclusion_flags, INCLUSION_FLAGS, "explanation/what-a-press-can-tell.md"),
    "hardness": (hardness_flags, HARDNESS_FLAGS, "how-to/measure-hardness.md"),
}


def constants(module: ModuleType) -> list[Flag]:
    """Every flag that the module defines, with those in its dictionaries."""
    values = [value for name, value in vars(module).items() if name.isupper() and not name.endswith("_FLAGS")]
    inside = [one for value in values if isinstance(value, dict) for one in value.values()]
    return [value for value in values + inside if isinstance(value, Flag)]


@pytest.mark.parametrize("kind", KINDS)
def test_every_flag_is_listed(kind: str) -> None:
    """Flags of one name may differ in their sentences alone."""
    module, listed, _ = KINDS[kind]
    for flag in constants(module):
        assert replace(flag, says="") == replace(listed[flag.name], says="")
        assert flag.says.endswith((".", "{advice}"))
    assert {flag.name for flag in constants(module)} == set(listed)


@pytest.mark.parametrize("kind", KINDS)
def test_estimators_raise_what_is_declared(kind: str) -> None:
    """No module writes the name of a flag: it raises the flag itself."""
    _, listed, _ = KINDS[kind]
    for file in (SOURCE / kind).rglob("*.py"):
        if file.name not in COMPARISONS and not file.name.endswith("flags.py"):
            tree = ast.parse(file.read_text(encoding="utf-8"))
            written = {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant)}
            assert not written & {*listed, *INDENTATION_FLAGS}, file


def printed(flags: Mapping[str, Flag]) -> list[str]:
    """The rows of the table of flags in the documents."""
    return [
        f"| `{flag.name}` | {flag.means} | {flag.raised} | {flag.cure} | {'**no**' if flag.withholds else 'yes'} |"
        for flag in flags.values()
    ]


@pytest.mark.parametrize("kind", KINDS)
def test_the_pages_print_every_flag_as_it_is_declared(kind: str) -> None:
    _, listed, page = KINDS[kind]
    text = (DOCS / page).read_text(encoding="utf-8")
    assert [line for line in text.splitlines() if line.startswith("| `")] == printed(listed)
