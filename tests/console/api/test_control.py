"""One script holds the camera, others watch."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from tests.console.api.script import Script

pytestmark = pytest.mark.system
COMMANDS: tuple[tuple[str, str, dict[str, object] | None], ...] = (
    ("PUT", "/camera", {}),
    ("POST", "/camera/start", None),
    ("POST", "/camera/stop", None),
    ("PATCH", "/camera/settings", {"values": {"gain": 1.0}}),
    ("POST", "/camera/preset", {"name": "default"}),
    ("PUT", "/target", {"number": 2}),
    ("PUT", "/press", {"force_n": 0.5}),
    ("POST", "/snapshot", None),
    ("POST", "/sequence", {"frames": 1}),
    ("DELETE", "/sequence", None),
    ("PUT", "/calibration", {}),
    ("DELETE", "/calibration", None),
)


@pytest.mark.parametrize(("method", "address", "body"), COMMANDS)
def test_an_act_needs_the_header_and_the_camera(
    holder: Script, method: str, address: str, body: dict[str, object] | None
) -> None:
    before = holder.call("GET", "/state")
    identity = holder.client.headers.pop("TSIS-Control")
    more = {} if body is None else {"json": body}
    kind, message = holder.refused(method, address, 428, **more)
    assert kind == "ControlError"
    assert "TSIS-Control" in message
    kind, message = holder.refused(method, address, 409, headers={"TSIS-Control": "somebody else"}, **more)
    assert kind == "ControlError"
    assert "controlled by script" in message
    after = holder.call("GET", "/state")
    holder.client.headers["TSIS-Control"] = identity
    for name in ("target", "force_n", "calibration_identity", "sequence"):
        assert after[name] == before[name]
    assert after["camera"]["running"]


def test_who_takes_over_is_the_only_one_to_act(holder: Script, script: Script) -> None:
    assert "controlled by script" in script.refused("POST", "/control", 409, json={"name": "second"})[1]
    script.take("second")
    assert "second" in holder.refused("PUT", "/target", 409, json={"number": 7})[1]
    script.call("PUT", "/target", json={"number": 8})
    assert holder.call("GET", "/state")["holder"] == {"name": "second", "yours": False}
    assert script.call("GET", "/state")["holder"] == {"name": "second", "yours": True}
    holder.call("DELETE", "/control", 204)
    assert script.call("GET", "/state")["holder"]["yours"], "who does not hold it cannot give it back"
    script.call("DELETE", "/control", 204)
    assert script.call("GET", "/state")["holder"] is None


def test_nobody_is_told_the_identity_of_the_holder(holder: Script, script: Script) -> None:
    identity = holder.client.headers["TSIS-Control"]
    for address in ("/state", "/jobs", "/about"):
        assert identity not in script.client.get(address).text


def test_who_holds_the_camera_keeps_the_identity(holder: Script) -> None:
    identity = holder.client.headers["TSIS-Control"]
    again = holder.call("POST", "/control", json={"name": "renamed", "held_s": 3600})
    assert again["identity"] == identity
    assert holder.call("GET", "/state")["holder"] == {"name": "renamed", "yours": True}


@pytest.mark.parametrize("name", ["", "two\nlines", "\x07", "A" * 81, " "])
def test_a_name_is_one_line(script: Script, name: str) -> None:
    script.refused("POST", "/control", 422, json={"name": name, "over": True})
