from __future__ import annotations

from typing import Any

import pytest

from tsis.errors import FileInputError
from tsis.files.result_schemas import RESULT_SCHEMAS, require_known_schema


@pytest.mark.parametrize("name", RESULT_SCHEMAS)
def test_every_result_of_this_version_is_known(name: str) -> None:
    require_known_schema({"schema": {"name": name, "version": RESULT_SCHEMAS[name]}}, "result.json")


@pytest.mark.parametrize(
    ("document", "said"),
    [
        ({}, "it names none"),
        ({"schema": None}, "it names none"),
        ({"schema": "tsis-demo"}, "it names none"),
        ({"schema": {}}, "got 'None', version None"),
        ({"schema": {"name": "tsis-demo"}}, "got 'tsis-demo', version None"),
        ({"schema": {"name": "tsis-demo", "version": True}}, "version True"),
        ({"schema": {"name": "tsis-demo", "version": 0}}, "version 0"),
        ({"schema": {"name": "tsis-demos", "version": 1}}, "got 'tsis-demos', version 1"),
        ({"schema": {"name": "tsis-demo", "version": 2}}, "up to version 1; got version 2: update tsis"),
    ],
)
def test_a_document_of_no_known_schema_is_refused(document: dict[str, Any], said: str) -> None:
    with pytest.raises(FileInputError, match=said) as refusal:
        require_known_schema(document, "result.json")
    assert str(refusal.value).startswith("result.json must ")
