"""Flags of inclusion and hardness: each is declared in one place and raised from there. A page prints every flag."""

from __future__ import annotations

import ast
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from release.reference_pages import FLAGS, with_flags

import tsis
from tsis.calibration.guard.limits import GUARD_FLAGS
from tsis.hardness import flags as hardness_flags
from tsis.hardness.curve_flags import INDENTATION_FLAGS
from tsis.hardness.flags import HARDNESS_FLAGS
from tsis.inclusion import flags as inclusion_flags
from tsis.inclusion.flags import INCLUSION_FLAGS
from tsis.model.flag import Flag

if TYPE_CHECKING:
    from types import ModuleType

SOURCE, ROOT = Path(tsis.__file__).parent, Path(__file__).parents[2]
COMPARISONS = {"relative.py", "shape.py", "mobility.py"}  # their flags are the notes of `tsis.inclusion.relative`
KINDS = {
    "inclusion": (inclusion_flags, INCLUSION_FLAGS),
    "hardness": (hardness_flags, HARDNESS_FLAGS),
}


def constants(module: ModuleType) -> list[Flag]:
    """Every flag that the module defines, with those in its dictionaries."""
    values = [value for name, value in vars(module).items() if name.isupper() and not name.endswith("_FLAGS")]
    inside = [one for value in values if isinstance(value, dict) for one in value.values()]
    return [value for value in values + inside if isinstance(value, Flag)]


@pytest.mark.parametrize("kind", KINDS)
def test_every_flag_is_listed(kind: str) -> None:
    """Flags of one name may differ in their sentences alone."""
    module, listed = KINDS[kind]
    for flag in constants(module):
        assert replace(flag, says="") == replace(listed[flag.name], says="")
        assert flag.says.endswith((".", "{advice}"))
    assert {flag.name for flag in constants(module)} == set(listed)


@pytest.mark.parametrize("kind", KINDS)
def test_estimators_raise_what_is_declared(kind: str) -> None:
    """No module writes the name of a flag: it raises the flag itself."""
    _, listed = KINDS[kind]
    for file in (SOURCE / kind).rglob("*.py"):
        if file.name not in COMPARISONS and not file.name.endswith("flags.py"):
            tree = ast.parse(file.read_text(encoding="utf-8"))
            written = {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant)}
            assert not written & {*listed, *INDENTATION_FLAGS}, file


def test_the_page_prints_every_flag_as_it_is_declared() -> None:
    page = with_flags((ROOT / "docs" / "reference" / "flags.md").read_text(encoding="utf-8"))
    assert "(flags of" not in page
    for flags in (*FLAGS.values(), GUARD_FLAGS):
        for flag in flags.values():
            (row,) = [line for line in page.splitlines() if line.startswith(f"| `{flag.name}` | {flag.means} |")]
            assert flag.raised in row
            assert flag.cure in row
            assert flag in GUARD_FLAGS.values() or row.endswith("| **no** |") == flag.withholds
