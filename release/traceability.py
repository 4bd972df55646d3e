"""Requirements of the program, the tests that hold them, and the page that shows them.

`docs/requirements.yaml` is a list of mappings: `id` (R-001), `requirement` and `hazard` (a sentence each), `tests`
(as pytest calls them, `file::name`, without parameters) and, where something is left open, `limits` (headings of the
known limits).
"""

from __future__ import annotations

import ast
import re
from collections import Counter
from functools import cache
from typing import TYPE_CHECKING, Any

import yaml

if TYPE_CHECKING:
    from pathlib import Path

LIST = "docs/requirements.yaml"
LIMITS = "docs/explanation/known-limits.md"
NEEDED = {"id", "requirement", "hazard", "tests"}


def read(root: Path) -> list[dict[str, Any]]:
    """The list of this repository, parsed and not yet checked."""
    entries: list[dict[str, Any]] = yaml.safe_load((root / LIST).read_text(encoding="utf-8"))
    return entries


def faults(entries: Any, root: Path) -> list[str]:
    """What is wrong with a list of requirements, one sentence each; empty when nothing is."""
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        return [f"{LIST} must be a list of mappings"]
    headings = limits(root)
    counted = Counter(str(entry.get("id")) for entry in entries)
    found = [f"{name} must be the id of one requirement; it is that of {n}" for name, n in counted.items() if n > 1]
    for place, entry in enumerate(entries, 1):
        name = str(entry.get("id", f"entry {place}"))
        found += [f"{name}: {fault}" for fault in _faults_of_one(entry, root, headings)]
    return found


def limits(root: Path) -> dict[str, str]:
    """The headings of the known limits by the names that links give them."""
    text = (root / LIMITS).read_text(encoding="utf-8")
    return {re.sub(r"[^\w-]+", "-", title.lower()): title for title in re.findall(r"^## (.+?)\s*$", text, re.MULTILINE)}


def limits_of(entry: dict[str, Any]) -> list[str]:
    """The limits that a requirement points at; one may be written without a list."""
    named = entry.get("limits", [])
    return [named] if isinstance(named, str) else list(named)


def page(entries: list[dict[str, Any]], root: Path) -> str:
    """The requirements in Markdown, for docs/reference."""
    headings = limits(root)
    return "\n".join(_shown(entry, headings) for entry in entries)


def _faults_of_one(entry: dict[str, Any], root: Path, headings: dict[str, str]) -> list[str]:
    absent, unknown = sorted(NEEDED - set(entry)), sorted(set(entry) - NEEDED - {"limits"})
    if absent or unknown:
        return [f"fields must be {sorted(NEEDED)} and may be ['limits']; {absent} are absent, {unknown} are unknown"]
    found = []
    if not re.fullmatch(r"R-\d{3}", str(entry["id"])):
        found.append(f"id must be R- and three digits; got {entry['id']!r}")
    for field in ("requirement", "hazard"):
        text = entry[field]
        if not isinstance(text, str) or not re.fullmatch(r"\S.*\S\.", text.strip()):
            found.append(f"{field} must be a sentence that ends with a full stop; got {text!r}")
    found += [
        f"limits must name a heading of {LIMITS}; got {name!r}" for name in limits_of(entry) if name not in headings
    ]
    return found + _faults_of_tests(entry["tests"], root)


def _faults_of_tests(tests: Any, root: Path) -> list[str]:
    if not isinstance(tests, list) or not tests:
        return ["tests must name at least one test"]
    found = [
        f"{test} must be named once; it is named {n} times" for test, n in Counter(map(str, tests)).items() if n > 1
    ]
    for test in tests:
        file, _, name = str(test).partition("::")
        if name not in _tests_in(root / file):
            found.append(f"tests must be file::name of a test in this repository; got {test!r}")
    return found


@cache
def _tests_in(path: Path) -> frozenset[str]:
    """Names of the tests in a file, those of classes as Class::name; none when it is no file of tests."""
    if not (path.name.startswith("test_") and path.suffix == ".py" and path.is_file()):
        return frozenset()
    names = []
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.ClassDef):
            names += [f"{node.name}::{inner.name}" for inner in node.body if isinstance(inner, ast.FunctionDef)]
        elif isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            names.append(node.name)
    return frozenset(name for name in names if name.split("::")[-1].startswith("test_"))


def _shown(entry: dict[str, Any], headings: dict[str, str]) -> str:
    lines = [f"**{entry['id']}** {entry['requirement'].strip()}", "", f"- If it fails: {entry['hazard'].strip()}"]
    lines += ["- Tests:", *(f"  - `{test}`" for test in entry["tests"])]
    links = [f"[{headings[name]}](../explanation/known-limits.md#{name})" for name in limits_of(entry)]
    if links:
        lines.append("- Known limits: " + ", ".join(links))
    return "\n".join([*lines, ""])
