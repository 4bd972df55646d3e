"""Camera, control, calibration, presses and records through calls, held against the store and files."""

from __future__ import annotations

import io
import json
import shutil
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from PIL import Image
from tests.present.test_lump_map import map_of
from tests.records.stored_tray import kept

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.records.store import open_store

if TYPE_CHECKING:
    from tests.console.api.script import Script
    from tests.console.running import RunningConsole


@pytest.mark.system
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


@pytest.mark.system
def test_a_longer_exposure_makes_the_next_frame_brighter(holder: Script) -> None:
    def brightness(exposure_ms: float) -> float:
        holder.call("PATCH", "/camera/settings", json={"values": {"exposure_ms": exposure_ms}})
        sent = holder.call("GET", "/frame.png")
        return float(np.asarray(Image.open(io.BytesIO(sent.content)), dtype=float).mean())

    dark, bright = brightness(2.0), brightness(20.0)
    assert bright > dark + 1.0
    holder.call("POST", "/camera/preset", json={"name": "default"})


@pytest.mark.system
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


@pytest.mark.system
def test_a_stopped_camera_gives_no_frame(holder: Script) -> None:
    assert not holder.call("POST", "/camera/stop")["camera"]["running"]
    for method, address in (("GET", "/frame.png"), ("POST", "/snapshot")):
        kind, message = holder.refused(method, address, 503)
        assert kind == "CameraError"
        assert "start it" in message
    while holder.call("GET", "/sight")["sight"] is not None:
        pass  # the watcher looks a few times a second
    assert holder.call("POST", "/camera/start")["camera"]["running"]


@pytest.mark.system
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


@pytest.mark.system
def test_a_search_is_a_job_whose_findings_stay(script: Script) -> None:
    reported = script.done(script.call("POST", "/cameras/search", 202))
    assert reported["job"]["status"] == "done"
    listed = script.call("GET", "/cameras")
    assert listed["searched"]
    assert reported["result"] == {"kind": "cameras", "found": listed["found"], "missing": listed["missing"]}
    for camera in listed["found"]:
        assert camera["spec"].startswith(camera["source"])
    assert script.refused("GET", "/jobs/" + "0" * 32, 404)[0] == "UnknownNameError"


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


@pytest.mark.system
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


@pytest.mark.system
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


@pytest.mark.system
def test_nobody_is_told_the_identity_of_the_holder(holder: Script, script: Script) -> None:
    identity = holder.client.headers["TSIS-Control"]
    for address in ("/state", "/jobs", "/about"):
        assert identity not in script.client.get(address).text


@pytest.mark.system
def test_who_holds_the_camera_keeps_the_identity(holder: Script) -> None:
    identity = holder.client.headers["TSIS-Control"]
    again = holder.call("POST", "/control", json={"name": "renamed", "held_s": 3600})
    assert again["identity"] == identity
    assert holder.call("GET", "/state")["holder"] == {"name": "renamed", "yours": True}


@pytest.mark.system
@pytest.mark.parametrize("name", ["", "two\nlines", "\x07", "A" * 81, " "])
def test_a_name_is_one_line(script: Script, name: str) -> None:
    script.refused("POST", "/control", 422, json={"name": name, "over": True})


AS_JSON = {"Content-Type": "application/json"}


@pytest.mark.system
def test_a_calibration_comes_back_as_it_was_sent(holder: Script) -> None:
    own = holder.call("GET", "/calibration")["calibration"]
    file = holder.client.get("/calibration/file").content
    assert json.loads(file)["sha256"] == own["sha256"]
    assert holder.call("PUT", "/calibration", content=file, headers=AS_JSON)["calibration"] == own
    assert holder.client.get("/calibration/file").content == file
    assert holder.call("DELETE", "/calibration")["calibration"] == own


@pytest.mark.system
def test_a_calibration_that_was_changed_is_refused(holder: Script) -> None:
    document = json.loads(holder.client.get("/calibration/file").content)
    document["calibration"]["name"] = "another"
    kind, message = holder.refused("PUT", "/calibration", 422, json=document)
    assert kind == "CalibrationError"
    assert "changed or damaged" in message
    assert holder.call("GET", "/calibration")["calibration"]["name"] != "another"


@pytest.mark.system
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


@pytest.mark.system
def test_more_than_32_mib_is_not_taken(holder: Script) -> None:
    answer = holder.client.put("/calibration", content=b" " * (33 * 2**20), headers=AS_JSON)
    assert answer.status_code == 413
    assert "\n" not in answer.text.strip()


@pytest.mark.system
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


@pytest.mark.system
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


@pytest.mark.system
def test_a_sequence_holds_as_many_frames_as_were_asked_for(holder: Script) -> None:
    begun = holder.call("POST", "/sequence", 202, json={"frames": 5})
    reported = holder.done(begun)
    assert reported["job"]["status"] == "done", reported["job"]["sentence"]
    assert reported["result"]["report"]["kept"] == 5
    assert len(list(Path(reported["result"]["folder"]).glob("*.png"))) == 5
    assert holder.call("GET", "/state")["sequence"] == reported["job"]


@pytest.mark.system
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


@pytest.mark.system
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


NUMBER = 41


@pytest.fixture
def estimated(holder: Script) -> Any:
    """A target with a press on it, one on plain tissue, and an estimate; made once."""
    if holder.client.get(f"/targets/{NUMBER}").status_code == 404:
        holder.call("POST", "/camera/preset", json={"name": "default"})
        assert holder.call("GET", "/calibration")["calibration"] is not None
        holder.call("PUT", "/target", json={"number": NUMBER})
        for role in ("target", "plain"):
            holder.call("PUT", "/press", json={"role": role, "force_n": 1.0})
            holder.call("POST", "/snapshot", 201)
        reported = holder.done(holder.call("POST", f"/targets/{NUMBER}/estimate", 202, json={"kind": "inclusion"}))
        assert reported["job"]["status"] == "done", reported["job"]["sentence"]
        assert reported["result"]["estimate"] == holder.call("GET", f"/targets/{NUMBER}/estimates")["estimates"][0]
    return holder.call("GET", f"/targets/{NUMBER}/estimates")


@pytest.mark.system
def test_an_estimate_tells_what_is_stored(estimated: Any, console: RunningConsole) -> None:
    with open_store(console.store, kind="phantom") as store:
        stored = store.estimates(store.target(NUMBER))[0].estimate
    reported = estimated["estimates"][0]
    assert set(reported["parameters"]) == {"diameter_mm", "depth_mm", "young_kpa"}
    for name, parameter in reported["parameters"].items():
        mean = pytest.approx(stored.mean[name], rel=1e-12) if stored.identified(name) else None
        assert parameter["mean"] == mean
        assert tuple(parameter["interval_90"]) == pytest.approx(stored.interval(0.9)[name], rel=1e-12)
        assert parameter["truth"] is not None
    assert reported["identifiability"] == stored.identifiability
    assert reported["trusted"] == stored.trusted
    assert estimated["in_force"] == [reported["id"]]


@pytest.mark.system
def test_a_map_tells_its_lumps(console: RunningConsole, script: Script) -> None:
    with open_store(console.store, kind="phantom") as store:
        target, stored = kept(store, map_of(2))
    answer = script.client.get(f"/targets/{target.number}/estimates").json()
    (told,) = answer["maps"]
    assert (answer["in_force"], answer["estimates"]) == ([stored.id], [])
    (lump,) = stored.estimate.lumps
    low, high = told["lumps"][0]["estimate"]["parameters"]["x_mm"]["interval_90"]
    assert (low, high) == pytest.approx(lump.estimate.interval(0.9)["x_mm"], rel=1e-12)
    assert told["next_places"] == [{"x_mm": 8.0, "y_mm": 4.0, "gain_nats": 0.3}]


@pytest.mark.system
def test_presses_are_told_page_by_page(estimated: Any, holder: Script) -> None:
    assert estimated["target"] == NUMBER
    pages = [holder.call("GET", f"/targets/{NUMBER}/presses", params={"limit": 1, "offset": at}) for at in range(3)]
    assert [page["total"] for page in pages] == [2, 2, 2]
    assert [press["role"] for page in pages for press in page["presses"]] == ["target", "plain"]
    for bad in ({"limit": 0}, {"limit": 1001}, {"offset": -1}, {"offset": "NaN"}, {"limits": 1}):
        holder.refused("GET", f"/targets/{NUMBER}/presses", 422, params=bad)
    listed = holder.call("GET", "/targets")
    assert NUMBER in [item["target"]["number"] for item in listed["targets"]]
    assert listed["total"] == len(listed["targets"])
    assert holder.call("GET", "/targets", params={"offset": 10**12})["targets"] == []


@pytest.mark.system
def test_an_edit_of_what_somebody_else_has_changed_is_refused(estimated: Any, holder: Script) -> None:
    target = holder.call("GET", f"/targets/{NUMBER}")["target"]
    address, version = f"/targets/{NUMBER}", target["version"]
    edited = holder.call("PATCH", address, json={"version": version, "note": "left, at 3 o'clock"})["target"]
    assert (edited["version"], edited["note"], edited["name"]) == (version + 1, "left, at 3 o'clock", target["name"])
    kind, message = holder.refused("PATCH", address, 409, json={"version": version, "note": "mine"})
    assert kind == "StaleRecordError"
    assert "read it again" in message
    assert holder.call("GET", address)["target"] == edited
    now = {"version": version + 1}
    refused: tuple[Any, ...] = (
        {},
        {"name": "a\x07"},
        {"name": "a\nb"},
        {"truth": {"diameter_mm": -1.0}},
        {"name": "a", "version": 0},
    )
    for bad in refused:
        holder.refused("PATCH", address, 422, json=now | bad)
    assert estimated["damaged"] == []


@pytest.mark.system
def test_an_estimate_is_made_again_the_same(estimated: Any, holder: Script) -> None:
    reported = holder.done(holder.call("POST", f"/targets/{NUMBER}/recompute", 202, json={"dry_run": True}))
    created = reported["result"]["recomputations"]
    assert [item["before"] for item in created] == estimated["in_force"]
    assert created[0]["same"]
    assert created[0]["stored_as"] is None
    shifts = {shift["name"]: shift["moved"] for shift in created[0]["shifts"]}
    means = {name: item["mean"] for name, item in estimated["estimates"][0]["parameters"].items()}
    assert shifts == {name: None if mean is None else 0.0 for name, mean in means.items()}


@pytest.mark.system
def test_the_prior_that_was_asked_for_is_the_one_that_is_kept(estimated: Any, holder: Script) -> None:
    assert len(estimated["estimates"]) >= 1
    requested = {"kind": "inclusion", "prior": {"presence": 0.9}}
    reported = holder.done(holder.call("POST", f"/targets/{NUMBER}/estimate", 202, json=requested))
    prior = reported["result"]["estimate"]["options"]["prior"]
    assert prior["presence"] == 0.9
    assert prior["thickness_mm"] == 30.0, "the rest is kept as it was by default"
    for bad in (
        {"kind": "tumour"},
        {"kind": "hardness", "prior": {"presence": 0.5}},
        {"kind": "inclusion", "prior": {"depth_mm": [9.0, 8.0]}},
        {"kind": "inclusion", "presses": []},
        {},
    ):
        holder.refused("POST", f"/targets/{NUMBER}/estimate", 422, json=bad)


@pytest.mark.system
def test_presses_of_another_target_fail_the_job_with_a_sentence(estimated: Any, holder: Script) -> None:
    assert estimated["target"] == NUMBER
    requested = {"kind": "inclusion", "presses": ["0" * 32]}
    job = holder.done(holder.call("POST", f"/targets/{NUMBER}/estimate", 202, json=requested))
    assert job["job"]["status"] == "failed"
    assert f"those of target {NUMBER}" in job["job"]["sentence"]
    assert job["result"] is None


@pytest.mark.system
def test_the_report_is_a_page_and_a_paper(estimated: Any, holder: Script) -> None:
    assert estimated["target"] == NUMBER
    page = holder.call("GET", f"/targets/{NUMBER}/report.html")
    assert page.headers["content-type"].startswith("text/html")
    assert f"Target {NUMBER}" in page.text
    assert RESEARCH_USE_ONLY in page.text
    paper = holder.call("GET", f"/targets/{NUMBER}/report.pdf")
    assert paper.headers["content-type"] == "application/pdf"
    assert paper.content.startswith(b"%PDF-")
    if shutil.which("pdftotext"):
        text = subprocess.run(["pdftotext", "-", "-"], input=paper.content, capture_output=True, check=True).stdout
        assert f"Target {NUMBER}".encode() in text


@pytest.mark.system
@pytest.mark.parametrize(
    "address", ["", "/presses", "/estimates", "/report.html", "/report.pdf", f"/presses/{'0' * 32}/frame.png"]
)
def test_what_is_not_there_is_said(script: Script, address: str) -> None:
    kind, message = script.refused("GET", f"/targets/98765{address}", 404)
    assert kind == "UnknownNameError"
    assert "98765" in message


@pytest.mark.system
def test_a_damaged_frame_is_said_and_nothing_else_is_lost(holder: Script, console: RunningConsole) -> None:
    holder.call("PUT", "/target", json={"number": 51})
    remaining = holder.call("POST", "/snapshot", 201)["press"]
    (blob,) = console.store.rglob(f"*{remaining['frame'][2:]}*")
    content = bytearray(blob.read_bytes())
    content[len(content) // 2] ^= 0xFF
    blob.chmod(0o644)
    blob.write_bytes(content)
    kind, _ = holder.refused("GET", f"/targets/51/presses/{remaining['id']}/frame.png", 503)
    assert kind == "RecordsError"
    assert holder.call("GET", "/targets/51/presses")["presses"] == [remaining]


@pytest.mark.system
def test_every_answer_says_what_it_may_be_used_for(script: Script) -> None:
    for address in ("/state", "/about", "/jobs", "/targets", "/cameras", "/calibration", "/sight", "/camera/settings"):
        answer = script.client.get(address)
        document = answer.json()
        assert document["notice"] == RESEARCH_USE_ONLY
        assert document["schema"] == {"name": f"tsis-http-{document['command']}", "version": 1}
        assert answer.headers["TSIS-Notice"] == RESEARCH_USE_ONLY
        assert answer.headers["Cache-Control"] == "no-store"
