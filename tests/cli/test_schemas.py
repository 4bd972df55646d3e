"""Every JSON document of a command names its schema and the version of it."""

from __future__ import annotations

import ast
import json
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

import tsis
from tsis.cli._output import print_json
from tsis.report import RESULT_SCHEMAS, envelope

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tests.cli.conftest import RunTsis

SOURCE = Path(tsis.__file__).parent


def calls(name: str, folder: Path = SOURCE) -> Iterator[tuple[Path, ast.Call]]:
    for path in sorted(folder.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and f".{ast.unparse(node.func)}".endswith(f".{name}"):
                yield path, node


def schema_of(call: ast.Call) -> str:
    return "-".join(["tsis", *(str(ast.literal_eval(each)).replace(" ", "-") for each in call.args)])


def test_each_schema_belongs_to_one_document() -> None:
    assert sorted(schema_of(call) for _, call in calls("envelope")) == sorted(RESULT_SCHEMAS)


def test_commands_print_json_through_one_call() -> None:
    assert list(calls("json.dumps", SOURCE / "cli")) == []
    assert {path.name for path, _ in calls("json_bytes", SOURCE / "cli")} == {"_output.py"}


def test_a_document_without_a_schema_is_not_printed() -> None:
    with pytest.raises(KeyError):
        print_json({"command": "demo"})
    with pytest.raises(KeyError):
        envelope("unheard of")


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        (("simulate", "--list"), "tsis-simulate-list"),
        (("optics", "angles"), "tsis-optics-angles"),
        (("optics", "modes"), "tsis-optics-modes"),
        (("study", "plan", "--width-mm", "90", "--height-mm", "60", "--overlap", "0.5"), "tsis-study-plan"),
        (("study", "new", "study", "--present", "2", "--blank", "2"), "tsis-study-new"),
    ],
)
def test_a_printed_document_begins_with_its_schema(run_tsis: RunTsis, arguments: tuple[str, ...], name: str) -> None:
    finished = run_tsis(*arguments, "--json")
    assert finished.code == 0, finished.err
    document = json.loads(finished.out)
    assert next(iter(document.items())) == ("schema", {"name": name, "version": RESULT_SCHEMAS[name]})
