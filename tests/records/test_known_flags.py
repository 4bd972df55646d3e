"""The lists of flags name every flag that the estimators' sources raise and their pages explain."""

from __future__ import annotations

import ast
import re
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

import tsis
from tsis.hardness.flags import HARDNESS_FLAGS as HARDNESS
from tsis.inclusion.flags import INCLUSION_FLAGS as INCLUSION
from tsis.inclusion.flags import NAMES, UNTRUSTED_FLAGS

if TYPE_CHECKING:
    from collections.abc import Mapping

    from tsis.model.flag import Flag

SOURCE, DOCS = Path(tsis.__file__).parent, Path(__file__).parents[2] / "docs"
RAISING = {
    "inclusion": ("flags", "estimation", "checks/images", "checks/position", "checks/roundness"),
    "hardness": ("flags", "gel"),
}
LISTED = {"inclusion": INCLUSION, "hardness": HARDNESS}
PAGES = {"inclusion": "explanation/what-a-press-can-tell.md", "hardness": "how-to/measure-hardness.md"}


def raised(kind: str) -> set[str]:
    """First parts of all pairs of a flag and a sentence."""
    found = set()
    for name in RAISING[kind]:
        tree = ast.parse((SOURCE / kind / f"{name}.py").read_text(encoding="utf-8"))
        yielded = {node.value for node in ast.walk(tree) if isinstance(node, ast.Yield)}
        for node in ast.walk(tree):
            if isinstance(node, ast.Tuple) and len(node.elts) == 2:
                flag, sentence = (ast.unparse(each) for each in node.elts)
                ends = sentence.rstrip("'\"").endswith((".", ").", "sentence"))
                if re.fullmatch(r"f?'[a-z_{}]+'", flag) and (ends or node in yielded):
                    found |= {flag.removeprefix("f").strip("'").replace("{name}", each) for each in NAMES}
    return found


@pytest.mark.parametrize("kind", RAISING)
def test_every_flag_is_listed(kind: str) -> None:
    found = raised(kind)
    assert len(found) > 7
    assert found <= set(LISTED[kind])
    assert kind == "hardness" or set(LISTED[kind]) >= UNTRUSTED_FLAGS


def printed(flags: Mapping[str, Flag]) -> list[str]:
    """The rows of the table of flags in the documents."""
    return [
        f"| `{flag.name}` | {flag.means} | {flag.raised} | {flag.cure} | {'**no**' if flag.withholds else 'yes'} |"
        for flag in flags.values()
    ]


@pytest.mark.parametrize("kind", RAISING)
def test_the_pages_print_every_flag_as_it_is_declared(kind: str) -> None:
    page = (DOCS / PAGES[kind]).read_text(encoding="utf-8")
    assert [line for line in page.splitlines() if line.startswith("| `")] == printed(LISTED[kind])
