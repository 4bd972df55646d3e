"""The description of the calls, and value classes as JSON."""

from __future__ import annotations

import json
import math
import os
import re
import shutil
import subprocess
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any
from unittest.mock import MagicMock

import httpx
import pytest
from tests.console.api.made_up_calls.calls import made_up
from tests.endurance import scaled
from tests.waiting import HANGS_S

from release import reference_pages
from tsis.console.api.application import api_app
from tsis.console.api.models import CamerasResponse, PressesResponse, SettingsResponse, TargetResponse
from tsis.instrument.camera import Setting
from tsis.instrument.discovery import CameraInfo
from tsis.records.values import StoredPress, Target

if TYPE_CHECKING:
    from tests.console.running import RunningConsole


DOCUMENT = Path(__file__).parents[3] / "docs" / "reference" / "http.md"
CASES = 200


@pytest.fixture
def description(console: RunningConsole) -> Any:
    return httpx.get(f"{console.address}/api/openapi.json", headers=console.key, timeout=HANGS_S).json()


@pytest.mark.system
def test_every_call_is_in_the_document_and_the_other_way_round(description: Any) -> None:
    described = {f"{method.upper()} {path}" for path, calls in description["paths"].items() for method in calls}
    assert "(all calls)" in DOCUMENT.read_text(encoding="utf-8")  # where the table is put
    reported = set(re.findall(r"^\| `([A-Z]+ /v1\S*)` \|", reference_pages.calls(), flags=re.MULTILINE))
    assert reported == described


@pytest.mark.system
def test_every_status_is_in_the_document(description: Any) -> None:
    reported = DOCUMENT.read_text(encoding="utf-8").partition("## What may go wrong")[2]
    for path in description["paths"].values():
        for call in path.values():
            for status in call["responses"]:
                assert int(status) < 300 or re.search(rf"\b{status}\b", reported), status


@pytest.mark.system
def test_generated_clients_find_names_words_and_places(description: Any) -> None:
    calls = [call for path in description["paths"].values() for call in path.values()]
    names = [call["operationId"] for call in calls]
    assert len(set(names)) == len(names) > 30
    assert all(re.fullmatch(r"[a-z]+(_[a-z]+)+", name) for name in names)
    assert all(call["description"] and call["tags"] for call in calls)
    assert description["servers"][0]["url"] == "/api"
    assert description["components"]["securitySchemes"]["HTTPBearer"]["scheme"] == "bearer"


@pytest.mark.system
def test_acts_and_no_other_calls_demand_the_header(description: Any) -> None:
    for path in description["paths"].values():
        for call in path.values():
            header = [item for item in call.get("parameters", []) if item["name"] == "TSIS-Control"]
            assert [item["required"] for item in header] != [True] or "428" in call["responses"]
            assert "428" not in call["responses"] or len(header) == 1


def schemas_named_in(described: Any) -> set[str]:
    return set(re.findall(r'"#/components/schemas/(\w+)"', json.dumps(described)))


@pytest.mark.system
def test_every_body_forbids_what_it_does_not_know(description: Any) -> None:
    schemas = description["components"]["schemas"]
    bodies = [call.get("requestBody") for path in description["paths"].values() for call in path.values()]
    names: set[str] = set()
    result = schemas_named_in(bodies)
    while result - names:
        names |= result
        result = schemas_named_in([schemas[name] for name in result])
    assert len(names) > 10
    assert {name for name in names if schemas[name].get("additionalProperties") is not False} == set()


@pytest.mark.system
def test_calls_made_up_from_the_description_are_answered_as_it_says(console: RunningConsole) -> None:
    tally = made_up(console.address, console.key, cases=CASES, each=2, seed=5)
    assert dict(tally.faults) == {}
    assert tally.cases >= CASES
    result = {status for _, status in tally.statuses}
    assert {200, 201, 202, 404, 409, 422, 428} <= result, "the cases go deep"


@pytest.mark.system
@pytest.mark.slow
def test_thousands_of_made_up_calls_are_answered_as_the_description_says(console: RunningConsole) -> None:
    tally = made_up(console.address, console.key, cases=scaled(1500), each=8, seed=4)
    assert dict(tally.faults) == {}


@pytest.mark.system
def test_the_session_in_python_runs_as_it_is_written(
    console: RunningConsole, capsys: pytest.CaptureFixture[str]
) -> None:
    (text,) = re.findall(r"```python\n(.*?)```", DOCUMENT.read_text(encoding="utf-8"), flags=re.DOTALL)
    text = text.replace('"name": "example"', '"name": "example", "over": True')  # other tests may hold the camera
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ADDRESS", console.address)
        patch.setenv("TOKEN", console.token)
        reported: dict[str, Any] = {}
        exec(compile(text, str(DOCUMENT), "exec"), reported)  # as it is written
    assert reported["report"].startswith(b"%PDF-")
    assert reported["estimate"]["parameters"]["diameter_mm"]["truth"] == 10.0
    assert "diameter_mm" in capsys.readouterr().out
    reported["console"].close()


@pytest.mark.system
@pytest.mark.skipif(shutil.which("curl") is None, reason="curl is not installed")
def test_the_session_in_a_shell_runs_as_it_is_written(console: RunningConsole, tmp_path: Path) -> None:
    (text,) = re.findall(r"```sh\n(.*?)```", DOCUMENT.read_text(encoding="utf-8"), flags=re.DOTALL)
    text = text.replace('{"name": "shell"}', '{"name": "shell", "over": true}')
    environment = {**os.environ, "ADDRESS": console.address, "TOKEN": console.token}
    done = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", text], cwd=tmp_path, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert (tmp_path / "frame.png").read_bytes().startswith(b"\x89PNG")


WHEN = datetime(2026, 11, 22, tzinfo=UTC)


@pytest.fixture(scope="module")
def schemas() -> Any:
    return api_app(MagicMock(), MagicMock()).openapi()["components"]["schemas"]


def test_a_value_is_described_by_its_docstring(schemas: Any) -> None:
    target = schemas["Target"]
    assert target["description"] == "A site that was pressed: a phantom, an object, a site on a subject."
    assert target["properties"]["version"] == {
        "type": "integer",
        "title": "Version",
        "description": "Number of edits plus 1.",
    }
    assert target["required"] == ["number", "kind", "name", "note", "truth", "made", "id", "version"]
    undescribed = [
        (name, field)
        for name in ("CameraChoice", "CameraState", "FrameAnalysis", "GuardFlag", "JobState", "RecordingReport")
        for field, schema in schemas[name]["properties"].items()
        if not schema.get("description")
    ]
    assert undescribed == []


def test_an_infinite_number_is_null(schemas: Any) -> None:
    assert {"type": "null"} in schemas["Setting"]["properties"]["high"]["anyOf"]
    sent = SettingsResponse(settings=(Setting(name="gain", value=2.0, low=-math.inf, high=math.inf),))
    assert json.loads(sent.model_dump_json())["settings"] == [
        {"name": "gain", "value": 2.0, "low": None, "high": None, "unit": ""}
    ]


def test_fields_are_left_out_and_properties_added(schemas: Any) -> None:
    press = StoredPress(
        role="target",
        taken=WHEN,
        frame="0" * 64,
        rows=2,
        columns=3,
        full_scale=255.0,
        axis_px=(1.0, 0.5),
        settings={"gain": math.inf, "roi": (0, 8)},
        target="secret",
    )
    (sent,) = json.loads(PressesResponse(target=1, total=1, offset=0, presses=[press]).model_dump_json())["presses"]
    assert "target" not in sent
    assert "target" not in schemas["StoredPress"]["properties"]
    assert sent["settings"] == {"gain": {"$number": "infinity"}, "roi": [0, 8]}
    assert sent["taken"] == "2026-11-22T00:00:00Z"
    camera = CameraInfo(source="aravis", identity="Fake_1")
    (result,) = json.loads(CamerasResponse(searched=True, found=(camera,), missing={}).model_dump_json())["found"]
    assert result["spec"] == "aravis:Fake_1"
    assert set(result) == set(schemas["CameraInfo"]["properties"])


def test_a_mapping_that_cannot_be_changed_is_an_object() -> None:
    target = Target(number=3, kind="phantom", made=WHEN, truth={"diameter_mm": 10.0})
    sent = json.loads(TargetResponse(target=target, presses=0).model_dump_json())
    assert sent["target"]["truth"] == {"diameter_mm": 10.0}


def test_every_response_names_its_schema(schemas: Any) -> None:
    responses = [name for name in schemas if name.endswith("Response")]
    assert len(responses) > 10
    assert all("schema" in schemas[name]["required"] for name in responses)
    sent = json.loads(PressesResponse(target=1, total=0, offset=0, presses=[]).model_dump_json(by_alias=True))
    assert sent["schema"] == {"name": "tsis-http-presses", "version": 1}
