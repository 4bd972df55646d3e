"""Value classes as JSON: what the description says of them, and what is sent."""

from __future__ import annotations

import json
import math
from datetime import UTC, datetime
from typing import Any
from unittest.mock import MagicMock

import pytest

from tsis.console.api.application import api_app
from tsis.console.api.models import CamerasResponse, PressesResponse, SettingsResponse, TargetResponse
from tsis.instrument.camera import Setting
from tsis.instrument.discovery import CameraInfo
from tsis.records.values import StoredPress, Target

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
