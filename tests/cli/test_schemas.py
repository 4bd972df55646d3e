"""Every JSON document of a command names its schema and the version of it."""

from __future__ import annotations

import ast
import json
import shutil
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from jsonschema import Draft202012Validator
from tests.cli.published import faults, published

import tsis
from tsis.cli.output import print_json
from tsis.errors import FileInputError
from tsis.files.result_schemas import RESULT_SCHEMAS
from tsis.present.document import envelope

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


def test_the_published_schema_describes_every_result() -> None:
    described = published()["$defs"]
    assert {name: described[name]["properties"]["schema"]["properties"] for name in RESULT_SCHEMAS} == {
        name: {"name": {"const": name}, "version": {"const": version}} for name, version in RESULT_SCHEMAS.items()
    }
    Draft202012Validator.check_schema(published())


def test_a_result_of_a_newer_version_is_refused(kept: Path, run_tsis: RunTsis, tmp_path: Path) -> None:
    shutil.copytree(kept / "demo", tmp_path / "demo")
    result = tmp_path / "demo" / "result.json"
    newer = json.loads(result.read_text()) | {"schema": {"name": "tsis-demo", "version": 2}}
    result.write_text(json.dumps(newer))
    finished = run_tsis("records", "import", "demo", "--store", "new")
    assert finished.code == 2
    assert "result.json' must be of tsis-demo up to version 1; got version 2: update tsis to read it" in " ".join(
        finished.err.split()
    )
    assert not any((tmp_path / "new").rglob("*.png"))
    with pytest.raises(FileInputError, match="up to version 1; got version 2: update tsis to read it"):
        tsis.load_frames(tmp_path / "demo")


def test_a_name_that_nobody_described_is_a_fault() -> None:
    document = envelope("logins", logins=[])
    assert faults(document) == []
    assert faults(document | {"more": 1})
    assert faults({name: value for name, value in document.items() if name != "logins"})


def test_commands_print_json_through_one_call() -> None:
    assert list(calls("json.dumps", SOURCE / "cli")) == []
    assert {path.name for path, _ in calls("json_bytes", SOURCE / "cli")} == {"output.py"}


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
