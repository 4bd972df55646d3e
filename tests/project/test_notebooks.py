"""The notebooks are valid, without outputs, linked, and each ends in a number that it asserts."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest
from release.notebooks import NOTEBOOKS, code_of, read_notebook

from tsis.__about__ import RESEARCH_USE_ONLY

ROOT = Path(__file__).parents[2]
EACH = pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)


def test_there_are_three() -> None:
    assert {path.stem for path in NOTEBOOKS} == {"design-a-probe", "first-estimate", "frames-to-report"}


@EACH
def test_a_notebook_is_small_valid_and_without_outputs(path: Path) -> None:
    assert path.stat().st_size < 12_000
    document = read_notebook(path)
    assert (document["nbformat"], document["nbformat_minor"]) == (4, 5)
    assert set(document["metadata"]) == {"kernelspec", "language_info"}
    names = [cell["id"] for cell in document["cells"]]
    assert len(set(names)) == len(names)
    assert all(re.fullmatch(r"[A-Za-z0-9_-]{1,64}", name) for name in names)
    for cell in document["cells"]:
        assert cell["metadata"] == {}
        if cell["cell_type"] == "code":
            assert (cell["outputs"], cell["execution_count"]) == ([], None)
        else:
            assert set(cell) == {"cell_type", "id", "metadata", "source"}
    assert document["cells"][0]["source"][0].startswith("# ")
    assert RESEARCH_USE_ONLY in "".join(document["cells"][0]["source"])


@EACH
def test_its_last_cell_asserts_a_number(path: Path) -> None:
    tree = ast.parse("".join(read_notebook(path)["cells"][-1]["source"]))
    asserted = [node for statement in tree.body if isinstance(statement, ast.Assert) for node in ast.walk(statement)]
    assert any(isinstance(node, ast.Compare) for node in asserted)
    assert any(isinstance(node, ast.Constant) and isinstance(node.value, (int, float)) for node in asserted)


@EACH
def test_the_index_links_it(path: Path) -> None:
    assert f"(notebooks/{path.name})" in (ROOT / "docs" / "index.md").read_text(encoding="utf-8")


@pytest.mark.system
@EACH
def test_it_runs_and_its_number_holds(path: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-W", "error", "-c", code_of(path)]
    finished = subprocess.run(command, cwd=tmp_path, check=False, capture_output=True, text=True)
    assert finished.returncode == 0, finished.stderr[-1000:]
    assert finished.stdout
