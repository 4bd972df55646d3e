"""The camera through calls: chosen, adjusted, looked through."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

if TYPE_CHECKING:
    from tests.console.api.script import Script

pytestmark = pytest.mark.system


def test_the_frame_is_sent_lossless_and_as_a_picture(holder: Script) -> None:
    sent = holder.call("GET", "/frame.png")
    exact = np.asarray(Image.open(io.BytesIO(sent.content)))
    state = holder.call("GET", "/state")["camera"]
    assert exact.shape == (state["rows"], state["columns"]) == (492, 768)
    assert float(sent.headers["TSIS-Full-Scale"]) == state["full_scale"]
    assert int(sent.headers["TSIS-Frame"]) >= 0
    pictures = [holder.call("GET", "/frame.jpg", params={"quality": item}) for item in (20, 95)]
    assert len(pictures[0].content) < len(pictures[1].content)
    for picture in pictures:
        near = np.asarray(Image.open(io.BytesIO(picture.content)), dtype=float)
        assert np.abs(near - exact).mean() < 3.0  # noise of another frame, and of JPEG


def test_a_longer_exposure_makes_the_next_frame_brighter(holder: Script) -> None:
    def brightness(exposure_ms: float) -> float:
        holder.call("PATCH", "/camera/settings", json={"values": {"exposure_ms": exposure_ms}})
        sent = holder.call("GET", "/frame.png")
        return float(np.asarray(Image.open(io.BytesIO(sent.content)), dtype=float).mean())

    dark, bright = brightness(2.0), brightness(20.0)
    assert bright > dark + 1.0
    holder.call("POST", "/camera/preset", json={"name": "default"})


def test_settings_are_changed_together_or_not_at_all(holder: Script) -> None:
    before = holder.call("GET", "/camera/settings")["settings"]
    kind, message = holder.refused("PATCH", "/camera/settings", 422, json={"values": {"gain": 3, "exposure_ms": 1e6}})
    assert kind == "InputError"
    assert "exposure_ms must lie in" in message
    kind, message = holder.refused("PATCH", "/camera/settings", 422, json={"values": {"gain": 3, "exposre_ms": 1}})
    assert kind == "UnknownNameError"
    assert "did you mean 'exposure_ms'" in message
    assert holder.call("GET", "/camera/settings")["settings"] == before
    after = holder.call("PATCH", "/camera/settings", json={"values": {"gain": 3}})["settings"]
    assert {item["name"]: item["value"] for item in after}["gain"] == 3.0
    lowest = holder.call("POST", "/camera/preset", json={"name": "minimal"})["settings"]
    assert {item["name"]: item["value"] for item in lowest}["gain"] == 0.0
    holder.call("POST", "/camera/preset", json={"name": "default"})


def test_a_stopped_camera_gives_no_frame(holder: Script) -> None:
    assert not holder.call("POST", "/camera/stop")["camera"]["running"]
    for method, address in (("GET", "/frame.png"), ("POST", "/snapshot")):
        kind, message = holder.refused(method, address, 503)
        assert kind == "CameraError"
        assert "start it" in message
    while holder.call("GET", "/sight")["sight"] is not None:
        pass  # the watcher looks a few times a second
    assert holder.call("POST", "/camera/start")["camera"]["running"]


def test_another_camera_is_chosen_by_name(holder: Script) -> None:
    choice = {"phantom": "hardness-70", "diameter_mm": 12.5, "seed": 9.0}
    state = holder.call("PUT", "/camera", json=choice)
    assert state["camera"]["choice"]["diameter_mm"] == 12.5
    assert state["camera"]["choice"]["seed"] == 9
    assert not state["camera"]["running"]
    largest = float(2**53 - 1)  # as a program writes it whose numbers are all such
    assert holder.call("PUT", "/camera", json={"seed": largest})["camera"]["choice"]["seed"] == 2**53 - 1
    assert "seed" in holder.refused("PUT", "/camera", 422, json={"seed": 2 * largest})[1]
    assert "12" in holder.refused("PUT", "/camera", 422, json={"probe": "tsis-12"})[1]
    assert holder.refused("PUT", "/camera", 422, json={"spec": "aravs:1"})[0] == "UnknownNameError"
    assert holder.refused("PUT", "/camera", 422, json={"phantom": "steel-ball"})[0] == "UnknownNameError"
    holder.call("PUT", "/camera", json={"spec": "opencv:99"})
    kind, _ = holder.refused("POST", "/camera/start", 503)
    assert kind == "CameraError"
    holder.call("PUT", "/camera", json={})
    holder.call("POST", "/camera/start")


def test_a_search_is_a_job_whose_findings_stay(script: Script) -> None:
    reported = script.done(script.call("POST", "/cameras/search", 202))
    assert reported["job"]["status"] == "done"
    listed = script.call("GET", "/cameras")
    assert listed["searched"]
    assert reported["result"] == {"kind": "cameras", "found": listed["found"], "missing": listed["missing"]}
    for camera in listed["found"]:
        assert camera["spec"].startswith(camera["source"])
    assert script.refused("GET", "/jobs/" + "0" * 32, 404)[0] == "UnknownNameError"
