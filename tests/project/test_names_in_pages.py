"""The pages that lead into the code name only what exists: dotted names, files, targets of make, layers."""

from __future__ import annotations

import importlib
import re
import tomllib
from pathlib import Path
from typing import Any

import pytest
from release.module_list import with_list

from tsis.__about__ import RESEARCH_USE_ONLY

ROOT = Path(__file__).parents[2]
PAGES = ("README.md", "CONTRIBUTING.md", "docs/architecture.md", "docs/glossary.md")
DOTTED = re.compile(r"(?<![\w/.-])tsis(?:\.\w+)+")
CODE = re.compile(r"`([^`\n]+)`")
LINK = re.compile(r"\[`([^`\n]+)`\]\(([^)\s]+)\)")
FILE = re.compile(r"[\w.][\w./-]*(?:/[\w.-]*|\.(?:py|toml|yaml|md|cff|txt))")
PATTERNS = ("_name", "__init__", "mine.toml", "prior.toml")  # what a reader's own files or any module are called
MADE = ("docs/_build/html", "build/sbom.cdx.json", "build/release")  # by commands, and so in no clone


def text_of(page: str) -> str:
    return (ROOT / page).read_text(encoding="utf-8")


def missing_name(dotted: str) -> str:
    """Why a dotted name does not exist; empty when it does."""
    parts = dotted.split(".")
    found: Any = importlib.import_module(parts[0])
    for at, part in enumerate(parts[1:], start=1):
        if not hasattr(found, part) and part not in getattr(found, "__annotations__", {}):
            try:
                found = importlib.import_module(".".join(parts[: at + 1]))
            except ModuleNotFoundError:
                return f"{'.'.join(parts[:at])} has no {part}"
        else:
            found = getattr(found, part, None)
    return ""


def paths(text: str) -> set[str]:
    """Files and folders that a page names in code, without those that are links."""
    named = {code for code in CODE.findall(LINK.sub("", text)) if FILE.fullmatch(code)}
    return {code for code in named if "NAME" not in code and not code.startswith(PATTERNS)}


@pytest.mark.parametrize("page", PAGES)
def test_every_dotted_name_exists(page: str) -> None:
    names = set(DOTTED.findall(text_of(page)))
    assert [fault for fault in map(missing_name, sorted(names)) if fault] == []


def test_the_glossary_names_the_code_of_every_term() -> None:
    rows = [line for line in text_of("docs/glossary.md").splitlines() if line.startswith("| ")]
    terms = [row for row in rows if not row.startswith(("| term", "| ---"))]
    assert len(terms) > 50
    assert [row for row in terms if not DOTTED.search(row)] == []


@pytest.mark.parametrize("page", PAGES)
def test_every_file_exists(page: str) -> None:
    made = {"tsis-demo", "result.json", "index.html", *MADE}
    assert [
        path for path in sorted(paths(text_of(page).partition("<!-- modules")[0]) - made) if not (ROOT / path).exists()
    ] == []


@pytest.mark.parametrize("page", PAGES)
def test_a_link_leads_to_the_file_that_it_shows(page: str) -> None:
    for shown, to in LINK.findall(text_of(page)):
        target = ((ROOT / page).parent / to).resolve()
        assert target.is_file(), to
        if "/" in shown and "." in shown:
            assert target.as_posix().endswith(f"/{shown}"), f"{shown} leads to {to}"


@pytest.mark.parametrize("page", PAGES)
def test_every_target_of_make_exists(page: str) -> None:
    targets = set(re.findall(r"^([a-z-]+):", text_of("Makefile"), re.MULTILINE))
    assert set(re.findall(r"(?:`|\$ )make ([a-z-]+)", text_of(page))) <= targets


def test_contributing_names_every_tier() -> None:
    tiers = set(re.findall(r"^(test[a-z-]*|benchmark):", text_of("Makefile"), re.MULTILINE))
    assert tiers == set(re.findall(r"^\| `make (test[a-z-]*|benchmark)`", text_of("CONTRIBUTING.md"), re.MULTILINE))


def test_the_drawing_shows_the_layers_that_are_enforced() -> None:
    contracts = tomllib.loads(text_of("pyproject.toml"))["tool"]["importlinter"]["contracts"]
    drawing = text_of("docs/architecture.md").partition("```text\n")[2].partition("```")[0]
    drawn = [re.split(r" {2,}", line)[0] for line in drawing.splitlines()]
    assert drawn == contracts[0]["layers"]


def test_the_list_of_modules_is_that_of_the_code() -> None:
    page = text_of("docs/architecture.md")
    assert with_list(page) == page, "make it anew with python -m release.module_list"


def test_the_readme_says_what_it_must() -> None:
    text = text_of("README.md")
    assert RESEARCH_USE_ONLY in text
    assert "never been tried on a physical probe" in text


@pytest.mark.parametrize(
    ("name", "fault"),
    [
        ("tsis.model.probe.Probe", ""),
        ("tsis.model.estimate.Estimate.interval", ""),
        ("tsis.model.press.PressField.approach_mm", ""),
        ("tsis.model.Probes", "tsis.model has no Probes"),
        ("tsis.models", "tsis has no models"),
        ("tsis.model.estimate.Estimate.spread", "tsis.model.estimate.Estimate has no spread"),
    ],
)
def test_what_does_not_exist_is_found(name: str, fault: str) -> None:
    assert missing_name(name) == fault


def test_paths_are_found_in_code_alone() -> None:
    text = "see `src/tsis/errors.py`, `conftest.py`, `tests/`, `press`, src/b.py, [`a/b.py`](a/b.py), `--prior x.toml`"
    assert paths(text) == {"src/tsis/errors.py", "conftest.py", "tests/"}
