"""The calibration in force, given and taken back as its file."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from tests.console.api.script import Script

pytestmark = pytest.mark.system
AS_JSON = {"Content-Type": "application/json"}


def test_a_calibration_comes_back_as_it_was_sent(holder: Script) -> None:
    own = holder.call("GET", "/calibration")["calibration"]
    file = holder.client.get("/calibration/file").content
    assert json.loads(file)["sha256"] == own["sha256"]
    assert holder.call("PUT", "/calibration", content=file, headers=AS_JSON)["calibration"] == own
    assert holder.client.get("/calibration/file").content == file
    assert holder.call("DELETE", "/calibration")["calibration"] == own


def test_a_calibration_that_was_changed_is_refused(holder: Script) -> None:
    document = json.loads(holder.client.get("/calibration/file").content)
    document["calibration"]["name"] = "another"
    kind, message = holder.refused("PUT", "/calibration", 422, json=document)
    assert kind == "CalibrationError"
    assert "changed or damaged" in message
    assert holder.call("GET", "/calibration")["calibration"]["name"] != "another"


@pytest.mark.parametrize(
    ("content", "kind", "status"),
    [
        (b"", "application/json", 422),
        (b"{}", "application/json", 422),
        (b'{"format": NaN}', "application/json", 422),
        (b"[" * 200_000, "application/json", 422),
        (b"\xff\xfe", "application/json", 422),
        (b'{"format": "tsis-calibration", "version": ' + b"9" * 6000 + b"}", "application/json", 422),
        (b"{}", "text/plain", 415),
        (b"{}", "", 415),
    ],
)
def test_what_is_no_calibration_is_refused_in_one_sentence(
    holder: Script, content: bytes, kind: str, status: int
) -> None:
    holder.refused("PUT", "/calibration", status, content=content, headers={"Content-Type": kind} if kind else {})


def test_more_than_32_mib_is_not_taken(holder: Script) -> None:
    answer = holder.client.put("/calibration", content=b" " * (33 * 2**20), headers=AS_JSON)
    assert answer.status_code == 413
    assert "\n" not in answer.text.strip()
