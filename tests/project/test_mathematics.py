"""Formulas become pictures in the colour of the text, with the same bytes each time, and nothing is loaded."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

import pytest
from release.mathematics import svg

ROOT = Path(__file__).parents[2]
CODE = re.compile(r"^ *```.*?^ *```$|`[^`\n]*`", re.MULTILINE | re.DOTALL)
FORMULA = re.compile(r"\$\$(.+?)\$\$|(?<![\\$])\$([^$\n]+(?:\n[^$\n]+)?)\$", re.DOTALL)


def prose() -> list[str]:
    """The pages without their code."""
    pages = [path for path in (ROOT / "docs").rglob("*.md") if "_build" not in path.parts]
    return [CODE.sub("", path.read_text(encoding="utf-8")) for path in pages]


def formulas() -> set[str]:
    return {block or inline for page in prose() for block, inline in FORMULA.findall(page)}


def test_a_formula_is_one_element_in_the_colour_of_the_text() -> None:
    drawn = svg(r"a^2 = \tfrac{5}{2} \langle r^2 \rangle")
    assert ElementTree.fromstring(drawn).tag.endswith("svg")
    assert "currentColor" in drawn
    assert not re.search(r"#[0-9a-f]{6}|<style|<metadata|id=\"(figure|text|patch)", drawn)


def test_the_same_formula_has_the_same_bytes() -> None:
    first = svg("E/(1-\\nu^2)")
    svg.cache_clear()
    assert svg("E/(1-\\nu^2)") == first


def test_a_formula_that_matplotlib_does_not_know_is_an_error() -> None:
    with pytest.raises(ValueError, match="nosuchsymbol"):
        svg(r"\nosuchsymbol")


@pytest.mark.slow
def test_every_formula_of_the_pages_is_drawn() -> None:
    found = formulas()
    assert found
    assert not any("$" in FORMULA.sub("", page).replace("\\$", "") for page in prose())  # none is overlooked
    assert all(svg(formula).startswith("<svg") for formula in found)
