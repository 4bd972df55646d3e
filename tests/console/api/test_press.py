"""What is pressed, and what is kept of it, held against the store and the files that others read."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

from tsis.records.store import open_store

if TYPE_CHECKING:
    from tests.console.api.script import Script
    from tests.console.running import RunningConsole

pytestmark = pytest.mark.system


def test_a_snapshot_is_in_the_store_and_on_the_disk_as_it_was_answered(holder: Script, console: RunningConsole) -> None:
    holder.call("PUT", "/target", json={"number": 31})
    holder.call("PUT", "/press", json={"role": "plain", "force_n": 0.8})
    remaining = holder.call("POST", "/snapshot", 201, json={"map_name": "cividis"})
    press = remaining["press"]
    assert (remaining["target"], press["role"], press["force_n"]) == (31, "plain", 0.8)
    sent = holder.call("GET", f"/targets/31/presses/{press['id']}/frame.png")
    levels = np.asarray(Image.open(io.BytesIO(sent.content)))
    with open_store(console.store, kind="phantom") as store:
        target = store.target(31)
        stored = store.press(target, press["id"])
        assert np.array_equal(store.levels(stored.frame), levels)
        assert (stored.role, stored.force_n, stored.frame) == ("plain", 0.8, press["frame"])
    assert np.array_equal(np.asarray(Image.open(remaining["files"]["raw"])), levels)
    assert json.loads(Path(remaining["files"]["sidecar"]).read_text())["role"] == "plain"
    assert Path(remaining["files"]["colour"]).is_relative_to(console.workspace)


def test_the_press_is_held_as_told(holder: Script) -> None:
    state = holder.call("PUT", "/press", json={"role": "untouched"})
    assert (state["role"], state["force_n"]) == ("untouched", 0.0)  # lifted
    assert holder.call("PUT", "/press", json={"force_n": 0.4})["role"] == "untouched"
    for body in ({"role": "ball"}, {"force_n": 5.5}, {"force_n": -1}, {}, {"force": 1}, {"role": 3}):
        holder.refused("PUT", "/press", 422, json=body)
    assert "whose force is always known" in holder.refused("PUT", "/press", 422, json={"force_n": None})[1]
    state = holder.call("GET", "/state")
    assert (state["role"], state["force_n"]) == ("untouched", 0.0)
    state = holder.call("PUT", "/press", json={"role": "target"})
    assert (state["role"], state["force_n"]) == ("target", 0.4)


def test_a_sequence_holds_as_many_frames_as_were_asked_for(holder: Script) -> None:
    begun = holder.call("POST", "/sequence", 202, json={"frames": 5})
    reported = holder.done(begun)
    assert reported["job"]["status"] == "done", reported["job"]["sentence"]
    assert reported["result"]["report"]["kept"] == 5
    assert len(list(Path(reported["result"]["folder"]).glob("*.png"))) == 5
    assert holder.call("GET", "/state")["sequence"] == reported["job"]


def test_a_sequence_is_ended_by_who_holds_the_camera(holder: Script) -> None:
    begun = holder.call("POST", "/sequence", 202, json={"seconds": 3600})
    address = f"/jobs/{begun['job']['identity']}"
    assert "sequence" in holder.refused("POST", "/sequence", 409, json={"frames": 1})[1]
    assert "sequence" in holder.refused("POST", "/camera/stop", 409)[1]
    identity = holder.client.headers.pop("TSIS-Control")
    assert holder.refused("DELETE", address, 428)[0] == "ControlError"
    assert holder.refused("DELETE", address, 409, headers={"TSIS-Control": "x"})[0] == "ControlError"
    assert holder.call("GET", address)["job"]["status"] == "running"
    holder.client.headers["TSIS-Control"] = identity
    holder.call("DELETE", address)
    reported = holder.done(begun)
    assert reported["job"]["status"] in ("done", "ended", "failed")
    assert holder.call("DELETE", "/sequence")["sequence"]["status"] == reported["job"]["status"]


def test_the_sight_tells_what_the_state_tells(holder: Script) -> None:
    holder.call("PUT", "/press", json={"role": "target", "force_n": 1.0})
    analysis = None
    while analysis is None or analysis["contact"] is None:
        analysis = holder.call("GET", "/sight")["sight"]
    state = holder.call("GET", "/state")
    assert sum(analysis["histogram"]) == state["camera"]["rows"] * state["camera"]["columns"]
    assert analysis["force"] == {"value_n": 1.0, "source": "virtual"}
    x, y = analysis["contact"]["centroid_px"]
    assert 0.3 * 768 < x < 0.7 * 768
    assert 0.3 * 492 < y < 0.7 * 492
