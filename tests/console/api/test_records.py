"""Stored targets through calls, held against the store that other programs open."""

from __future__ import annotations

import shutil
import subprocess
from typing import TYPE_CHECKING, Any

import pytest

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.records.store import open_store

if TYPE_CHECKING:
    from tests.console.api.script import Script
    from tests.console.running import RunningConsole

pytestmark = pytest.mark.system
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


def test_an_estimate_is_made_again_the_same(estimated: Any, holder: Script) -> None:
    reported = holder.done(holder.call("POST", f"/targets/{NUMBER}/recompute", 202, json={"dry_run": True}))
    created = reported["result"]["recomputations"]
    assert [item["before"] for item in created] == estimated["in_force"]
    assert created[0]["same"]
    assert created[0]["stored_as"] is None
    shifts = {shift["name"]: shift["moved"] for shift in created[0]["shifts"]}
    means = {name: item["mean"] for name, item in estimated["estimates"][0]["parameters"].items()}
    assert shifts == {name: None if mean is None else 0.0 for name, mean in means.items()}


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


def test_presses_of_another_target_fail_the_job_with_a_sentence(estimated: Any, holder: Script) -> None:
    assert estimated["target"] == NUMBER
    requested = {"kind": "inclusion", "presses": ["0" * 32]}
    job = holder.done(holder.call("POST", f"/targets/{NUMBER}/estimate", 202, json=requested))
    assert job["job"]["status"] == "failed"
    assert f"those of target {NUMBER}" in job["job"]["sentence"]
    assert job["result"] is None


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


@pytest.mark.parametrize(
    "address", ["", "/presses", "/estimates", "/report.html", "/report.pdf", f"/presses/{'0' * 32}/frame.png"]
)
def test_what_is_not_there_is_said(script: Script, address: str) -> None:
    kind, message = script.refused("GET", f"/targets/98765{address}", 404)
    assert kind == "UnknownNameError"
    assert "98765" in message


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


def test_every_answer_says_what_it_may_be_used_for(script: Script) -> None:
    for address in ("/state", "/about", "/jobs", "/targets", "/cameras", "/calibration", "/sight", "/camera/settings"):
        answer = script.client.get(address)
        document = answer.json()
        assert document["notice"] == RESEARCH_USE_ONLY
        assert document["schema"] == {"name": f"tsis-http-{document['command']}", "version": 1}
        assert answer.headers["TSIS-Notice"] == RESEARCH_USE_ONLY
        assert answer.headers["Cache-Control"] == "no-store"
