"""The help: every page and every field has its texts, and terms mean what the glossary says."""

from __future__ import annotations

import ast
import re
import tomllib
from functools import cache
from pathlib import Path

import tsis
from tsis.console.pages import PAGES

CONSOLE = Path(tsis.__file__).parent / "console"
GLOSSARY = Path(__file__).parents[3] / "docs" / "glossary.md"
HELP = tomllib.loads((CONSOLE / "pages" / "help.toml").read_text(encoding="utf-8"))


@cache
def trees() -> dict[str, ast.Module]:
    """The pages' code by file."""
    return {
        file.relative_to(CONSOLE / "pages").as_posix(): ast.parse(file.read_text(encoding="utf-8"))
        for file in sorted((CONSOLE / "pages").rglob("*.py"))
    }


def called(node: ast.AST) -> str:
    """The last part of the name of what is called."""
    function = getattr(node, "func", None)
    return getattr(function, "attr", getattr(function, "id", ""))


def test_every_page_has_a_help_and_its_terms_are_the_glossary_s() -> None:
    listed = [address for address in PAGES if "{" not in address]
    assert [address for address in listed if not HELP.get(address, {}).get("text")] == []
    meanings = dict(re.findall(r"^\| ([^|]+?) \| ([^|]+?) \|", GLOSSARY.read_text(encoding="utf-8"), re.MULTILINE))
    for address in listed:
        for term in HELP[address]["terms"]:
            plain = re.sub(r" \$[^$]*\$|(,? ?\(\d+\.\d+\))+|`", "", meanings[term])
            assert HELP["terms"][term] == plain


def test_every_field_is_explained_with_its_label() -> None:
    """What a field's code calls it has a sentence; labels that are made while the program runs are a browser's test."""
    kinds = {"unit_field", "select_field", "text_field", "text_area", "NumberField", "typed_field"}
    missing = []
    for file, tree in trees().items():
        for node in ast.walk(tree):
            if not isinstance(node, ast.Call) or called(node) not in kinds:
                continue
            named = [item.value for item in node.keywords if item.arg == "label"]
            texts = named or node.args[1 if called(node) == "NumberField" else 0 : 2][:1]
            labels = [str(item.value) for item in texts if isinstance(item, ast.Constant) and item.value]
            missing += [f"{file}: {label}" for label in labels if label not in HELP["fields"]]
    assert missing == []
