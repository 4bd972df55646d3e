"""The structure of the code: interfaces of packages, cycles, public names. docs/architecture.md draws it."""

from __future__ import annotations

import ast
import re
from collections import defaultdict
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


def offered(init: Path) -> set[str]:
    """Names that a package imports from its modules to offer them, at once or when they are first used."""
    return {
        alias.asname or alias.name
        for node in ast.walk(tree_of(init))
        if isinstance(node, ast.ImportFrom) and node.module != module_of(init) and node.level == 0
        for alias in node.names
        if (node.module or "").split(".")[0] == "tsis"
    }


def modules_of(init: Path) -> set[str]:
    """Modules and packages directly in a package."""
    inside = {path.stem for path in init.parent.glob("*.py")} | {
        path.parent.name for path in init.parent.glob("*/*.py")
    }
    return inside - {"__init__"}


def private_attributes(path: Path) -> Iterator[tuple[int, str]]:
    """Line and dotted name of every private attribute that a file takes from something that it imports of tsis."""
    tree = tree_of(path)
    imported = {
        alias.asname or alias.name.split(".")[0]: f"{node.module}.{alias.name}"
        if isinstance(node, ast.ImportFrom)
        else alias.name
        if alias.asname
        else alias.name.split(".")[0]
        for node in ast.walk(tree)
        if isinstance(node, ast.Import | ast.ImportFrom)
        for alias in node.names
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and node.attr.startswith("_"):
            first, _, rest = ast.unparse(node).partition(".")
            if imported.get(first, "").split(".")[0] == "tsis" and re.fullmatch(r"[\w.]+", rest):
                yield node.lineno, f"{imported[first]}.{rest}"


@pytest.mark.parametrize("folder", ["src/tsis", "studies", "benchmarks"])
def test_nothing_uses_private_parts_of_another_package(folder: str) -> None:
    deep = []
    for path in sorted((ROOT / folder).rglob("*.py")):
        importer = module_of(path)
        for line, dotted in (*imports(path), *private_attributes(path)):
            owner = private_owner(dotted)
            if owner is not None and importer != owner and not importer.startswith(f"{owner}."):
                deep.append(f"{path.relative_to(ROOT)}:{line} uses {dotted}")
    assert deep == []


def test_a_private_attribute_is_seen(tmp_path: Path) -> None:
    source = tmp_path / "a.py"
    source.write_text("import tsis\nfrom tsis.files import atomic\ntsis.model._x\natomic._y\natomic.__name__\nother._w")
    assert [private_owner(dotted) for _, dotted in private_attributes(source)] == [
        "tsis.model",
        "tsis.files.atomic",
        None,
    ]


def test_no_import_cycle_even_of_types() -> None:
    graph = grimp.build_graph("tsis", exclude_type_checking_imports=False, cache_dir=None)
    assert len(graph.modules) > 100
    needs = {module: graph.find_modules_directly_imported_by(module) for module in graph.modules}
    try:
        TopologicalSorter(needs).prepare()
    except CycleError as error:
        pytest.fail(f"these import each other: {error.args[1]}")


def test_no_module_bears_the_name_of_a_callable_of_its_package() -> None:
    """Imported, `mechanics/press.py` would hide `tsis.mechanics.press`."""
    packages = sorted(SOURCE.rglob("__init__.py"))
    assert len(packages) > 15
    hidden = [f"{module_of(init)}.{name}" for init in packages for name in sorted(offered(init) & modules_of(init))]
    assert hidden == []
    lazy = {module_of(init): offered(init) for init in packages}
    assert "load_probe" in lazy["tsis"]  # what is offered is found


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


def test_modules_that_are_named_through_a_package_load_by_their_name() -> None:
    """``tsis.present.labels`` works in a fresh process only where the package's list of lazy modules has it."""
    missing = []
    for path in SOURCE.rglob("*.py"):
        loaded = {dotted for _, dotted in imports(path)}
        for node in ast.walk(tree_of(path)):
            if not isinstance(node, ast.Attribute) or not isinstance(node.value, ast.Attribute):
                continue
            package = node.value
            if not isinstance(package.value, ast.Name) or package.value.id != "tsis":
                continue
            init = SOURCE / package.attr / "__init__.py"
            if not init.exists() or not (init.parent / f"{node.attr}.py").exists():
                continue
            listed = {each.value for each in ast.walk(tree_of(init)) if isinstance(each, ast.Constant)}
            if node.attr not in listed and f"tsis.{package.attr}.{node.attr}" not in loaded:
                missing.append(f"{path.relative_to(SOURCE)}: tsis.{package.attr}.{node.attr}")
    assert missing == []
