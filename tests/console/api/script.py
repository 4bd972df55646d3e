"""A script that talks to a running console."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import httpx
from tests.waiting import HANGS_S

if TYPE_CHECKING:
    from tests.console.running import RunningConsole


class Script:
    """Calls of one script, with the header of acts once it holds the camera."""

    def __init__(self, console: RunningConsole) -> None:
        self.client = httpx.Client(base_url=f"{console.address}/api/v1", headers=console.key, timeout=HANGS_S)

    def take(self, name: str = "script", **more: Any) -> str:
        """Hold the camera, over whoever holds it unless told else."""
        answer = self.client.post("/control", json={"name": name, "over": True, "held_s": 600.0, **more})
        assert answer.status_code == 200, answer.text
        identity: str = answer.json()["identity"]
        self.client.headers["TSIS-Control"] = identity
        return identity

    def call(self, method: str, address: str, status: int = 200, **more: Any) -> Any:
        """What a call answers, with the status that is expected."""
        answer = self.client.request(method, address, **more)
        assert answer.status_code == status, answer.text
        return answer.json() if answer.headers.get("content-type") == "application/json" else answer

    def refused(self, method: str, address: str, status: int, **more: Any) -> tuple[str, str]:
        """The kind and the sentence of a refusal."""
        reported = self.call(method, address, status, **more)
        assert set(reported) == {"error", "kind"}
        assert reported["error"].strip()
        assert "\n" not in reported["error"]
        return reported["kind"], reported["error"]

    def done(self, begun: Any) -> Any:
        """The answer of a job once it is over."""
        identity = begun["job"]["identity"]
        while True:
            reported = self.call("GET", f"/jobs/{identity}")
            if reported["job"]["status"] != "running":
                return reported

    def ready(self) -> None:
        """Hold the camera, and have the virtual probe run on its phantom."""
        self.take()
        state = self.call("GET", "/state")
        if not state["camera"]["running"]:
            self.call("PUT", "/camera", json={})
            self.call("POST", "/camera/start")
        self.call("PUT", "/press", json={"role": "target", "force_n": 1.0})

    def close(self) -> None:
        """Let go of the connections."""
        self.client.close()
