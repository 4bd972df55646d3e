"""The structure of the code: interfaces of packages, cycles, public names. docs/architecture.md draws it."""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import TYPE_CHECKING

import grimp
import pytest

import tsis

if TYPE_CHECKING:
    from collections.abc import Iterator

ROOT = Path(__file__).parents[2]
SOURCE = Path(tsis.__file__).parent
TWICE = {"estimate"}  # of an inclusion, and of a hardness


def module_of(path: Path) -> str:
    base = ROOT / "src" if path.is_relative_to(ROOT / "src") else ROOT
    return ".".join(path.relative_to(base).with_suffix("").parts).removesuffix(".__init__")


def tree_of(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def statements(node: ast.AST) -> Iterator[ast.AST]:
    """All statements of a file: a tenth of its nodes."""
    for part in ("body", "orelse", "handlers", "finalbody", "cases"):
        found = getattr(node, part, ())
        for statement in found if isinstance(found, list) else ():
            yield statement
            yield from statements(statement)


def imports(path: Path) -> Iterator[tuple[int, str]]:
    """Line and dotted name of everything of tsis that a file imports, names from modules included."""
    for node in statements(tree_of(path)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "tsis":
            yield from ((node.lineno, f"{node.module}.{alias.name}") for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names if alias.name.split(".")[0] == "tsis")


def private_owner(dotted: str) -> str | None:
    """The package or module whose private part a dotted name is; None when it names nothing private."""
    parts = dotted.split(".")
    for at, part in enumerate(parts):
        if part.startswith("_") and not part.startswith("__"):
            return ".".join(parts[:at])
    return None


@cache
def interfaces() -> dict[str, dict[str, str]]:
    """What every package offers: by its names the module that each is imported from."""
    found = {}
    for path in sorted(SOURCE.rglob("__init__.py")):
        tree = tree_of(path)
        offered = [
            ast.literal_eval(node.value)
            for node in tree.body
            if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__"
        ]
        if offered:
            homes = {
                alias.asname or alias.name: node.module or ""
                for node in ast.walk(tree)
                if isinstance(node, ast.ImportFrom)
                for alias in node.names
            }
            found[module_of(path)] = {name: homes.get(name, module_of(path)) for name in offered[0]}
    return found


def home(package: str, name: str) -> str:
    """The module that defines a name which a package offers, however many packages pass it on."""
    module = interfaces()[package][name]
    return home(module, name) if module != package and name in interfaces().get(module, {}) else module


@pytest.mark.parametrize("folder", ["src/tsis", "studies", "benchmarks"])
def test_nothing_imports_private_parts_of_another_package(folder: str) -> None:
    deep = []
    for path in sorted((ROOT / folder).rglob("*.py")):
        importer = module_of(path)
        for line, dotted in imports(path):
            owner = private_owner(dotted)
            if owner is not None and importer != owner and not importer.startswith(f"{owner}."):
                deep.append(f"{path.relative_to(ROOT)}:{line} imports {dotted}")
    assert deep == []


def test_no_import_cycle_even_of_types() -> None:
    graph = grimp.build_graph("tsis", exclude_type_checking_imports=False, cache_dir=None)
    assert len(graph.modules) > 100
    needs = {module: graph.find_modules_directly_imported_by(module) for module in graph.modules}
    try:
        TopologicalSorter(needs).prepare()
    except CycleError as error:
        pytest.fail(f"these import each other: {error.args[1]}")


def test_every_public_name_means_one_thing() -> None:
    homes: dict[str, set[str]] = defaultdict(set)
    for package, names in interfaces().items():
        for name in names:
            assert not name.startswith("_") or name == "__version__", f"{package} offers the private {name}"
            homes[name].add(home(package, name))
    assert len(homes) > 500
    assert {name: found for name, found in homes.items() if len(found) > 1 and name not in TWICE} == {}


def test_no_public_name_hides_a_subpackage() -> None:
    hidden = [
        f"{package}.{name}"
        for package, names in interfaces().items()
        for name in names
        if f"{package}.{name}" in interfaces()
    ]
    assert hidden == []


def test_no_two_public_classes_share_a_name() -> None:
    homes: dict[str, list[str]] = defaultdict(list)
    for path in sorted(SOURCE.rglob("*.py")):
        for name in re.findall(r"^class ([A-Za-z]\w*)", path.read_text(encoding="utf-8"), re.MULTILINE):
            homes[name].append(module_of(path))
    assert {name: found for name, found in homes.items() if len(found) > 1} == {}


def test_parts_of_large_libraries_load_when_they_are_first_used() -> None:
    """`scipy.optimize.brentq`, not `from scipy.optimize import brentq`: a start would wait half a second for it."""
    eager = re.compile(r"^(from (scipy|skimage|numba)|import ((scipy|skimage)\.|numba))", re.MULTILINE)
    found = [module_of(path) for path in SOURCE.rglob("*.py") if eager.search(path.read_text(encoding="utf-8"))]
    assert found == []
