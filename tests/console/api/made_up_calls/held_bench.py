"""Brings the console under test back to where calls go deep: control held, the virtual probe running, jobs few."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import httpx

if TYPE_CHECKING:
    import random

CONTROL = "TSIS-Control"
USUAL = {"spec": "virtual", "probe": "tsis-domed", "phantom": "hardness-100", "diameter_mm": None, "depth_mm": None}
PATIENCE_S = 600.0
TRIALS, SERVICE_UNAVAILABLE = 5, 503


class HeldBench:
    """A console as one script holds it.

    Parameters
    ----------
    address, key
        Where it listens, and the header that lets in.
    """

    def __init__(self, address: str, key: dict[str, str]) -> None:
        self._client = httpx.Client(base_url=f"{address}/api/v1", headers=key, timeout=PATIENCE_S)
        self.identity = ""
        self.presses: list[str] = []
        self.targets: list[int] = [1]

    def close(self) -> None:
        """Let go of the connection."""
        self._client.close()

    @property
    def act(self) -> dict[str, str]:
        """The header of acts."""
        return {CONTROL: self.identity}

    def take(self) -> None:
        """Hold the camera for as long as may be."""
        asked = {"name": "made up", "over": True, "held_s": 3600.0}
        self.identity = self._client.post("/control", json=asked, headers=self.act if self.identity else {}).json()[
            "identity"
        ]

    def release(self) -> None:
        """Give the camera back."""
        self._client.delete("/control", headers=self.act)

    def run(self) -> None:
        """The virtual probe runs on its phantom, nothing waits."""
        self.take()
        self.end_work()
        camera = self._state()["camera"]
        changed = any(camera["choice"][name] != value for name, value in USUAL.items())
        if changed or not camera["running"]:
            self._client.put("/camera", json={}, headers=self.act).raise_for_status()
            self._start()

    def _start(self) -> None:
        """Start the camera; a machine with much to do may be too slow for its first frame."""
        answer = self._client.post("/camera/start", headers=self.act)
        for _ in range(TRIALS):
            if answer.status_code != SERVICE_UNAVAILABLE:
                break
            answer = self._client.post("/camera/start", headers=self.act)
        if answer.is_error:
            raise RuntimeError(f"the virtual probe must start; got {answer.status_code}: {answer.text}")

    def know(self, number: int) -> None:
        """Keep a press and an estimate of a target, and remember what there is to name.

        A target of its own for each round: a report of hundreds of presses takes its time.
        """
        self.run()
        for name, body in (("target", {"number": number}), ("press", {"role": "target", "force_n": 1.0})):
            self._client.put(f"/{name}", json=body, headers=self.act).raise_for_status()
        self._client.post("/snapshot", headers=self.act).raise_for_status()
        self._client.post(f"/targets/{number}/estimate", json={"kind": "inclusion"}).raise_for_status()
        found = self._client.get(f"/targets/{number}/presses").json()
        self.targets = [number]
        self.presses = [press["id"] for press in found["presses"]]

    def end_work(self) -> None:
        """Ask every job to end, a sequence too."""
        self._client.delete("/sequence", headers=self.act)
        for job in self._jobs():
            if job["status"] == "running":
                self._client.delete(f"/jobs/{job['identity']}", headers=self.act)

    def end_sequence(self) -> None:
        """End the sequence under way, and wait until its frames are on the disk."""
        self._client.delete("/sequence", headers=self.act)
        until = time.monotonic() + PATIENCE_S
        while time.monotonic() < until:
            sequence = self._state()["sequence"]
            if sequence is None or sequence["status"] != "running":
                return
            time.sleep(0.02)

    def sound(self, label: str, body: Any, rng: random.Random) -> Any:
        """The body of a call that only what is there makes sound, which nothing made up hits upon; else the same."""
        if label == "PATCH /v1/camera/settings":
            found = self._client.get("/camera/settings").json()["settings"]
            return (
                {"values": {each["name"]: rng.uniform(each["low"], each["high"]) for each in found}} if found else body
            )
        if label == "PUT /v1/calibration":
            answer = self._client.get("/calibration/file")
            return answer.json() if answer.is_success else body
        if label == "PATCH /v1/targets/{number}" and isinstance(body, dict):
            return {**body, "version": self._client.get(f"/targets/{self.targets[0]}").json()["target"]["version"]}
        return body

    def known(self) -> dict[str, Any]:
        """What addresses may name, by the names of their parts."""
        jobs = [job["identity"] for job in self._jobs()]
        return {"number": self.targets, "press": self.presses, "job": jobs}

    def _jobs(self) -> list[dict[str, Any]]:
        found: list[dict[str, Any]] = self._client.get("/jobs").json()["jobs"]
        return found

    def _state(self) -> dict[str, Any]:
        found: dict[str, Any] = self._client.get("/state").json()
        return found
