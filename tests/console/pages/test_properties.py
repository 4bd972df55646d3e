"""No text that comes from outside is put into the small language of properties, where a quotation mark adds others."""

from __future__ import annotations

import ast
from pathlib import Path

import tsis.console

FILES = sorted(Path(tsis.console.__file__).parent.rglob("*.py"))


def put_together(source: str) -> list[str]:
    """Arguments of ``props`` that are neither written out nor made of constants."""
    calls = [
        node
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "props"
    ]
    given = [value for call in calls for value in (*call.args, *(keyword.value for keyword in call.keywords))]
    return [ast.unparse(value) for value in given if not _constant(value)]


def _constant(value: ast.expr) -> bool:
    if isinstance(value, ast.IfExp):
        return _constant(value.body) and _constant(value.orelse)
    if isinstance(value, ast.JoinedStr):
        return all(_constant(part.value) for part in value.values if isinstance(part, ast.FormattedValue))
    if isinstance(value, ast.Call):  # of a constant, as list(SHEETS)
        return bool(value.args) and all(_constant(item) for item in value.args)
    return isinstance(value, ast.Constant) or (isinstance(value, ast.Name) and value.id.isupper())


def test_a_quotation_mark_of_a_device_would_be_found() -> None:
    assert put_together("""use.props(f'aria-label="Use {camera.identity}"')""") == [
        """f'aria-label="Use {camera.identity}"'"""
    ]
    assert put_together("""use.props(f'id="{MAIN}"').props("dense", remove="loading" if done else "")""") == []


def test_properties_are_written_out() -> None:
    result = {str(file): put_together(file.read_text()) for file in FILES}
    assert len(result) > 15
    assert {file: arguments for file, arguments in result.items() if arguments} == {}
