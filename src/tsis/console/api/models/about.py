"""The program, and the calibration in force."""

from __future__ import annotations

from datetime import datetime
from typing import Any, Literal

from pydantic import Field

from tsis.console.api.models.common import Answer, Told


class StoreTold(Told):
    """Where records are kept."""

    folder: str
    kind: str
    identity: str


class AboutAnswer(Answer):
    """The program and where it keeps things."""

    command: Literal["about"] = "about"
    environment: dict[str, Any] = Field(description="versions of program, language and libraries, SHA-256 of the code")
    store: StoreTold
    workspace: str = Field(description="folder of snapshots and sequences")


class CalibrationTold(Told):
    """A calibration by its name and identity."""

    name: str
    probe: str
    sha256: str = Field(description="its identity, by which results cite it")
    made: datetime | None
    expires: datetime | None = Field(description="null for one that is simulated")


class CalibrationAnswer(Answer):
    """The calibration in force; null without one."""

    command: Literal["calibration"] = "calibration"
    calibration: CalibrationTold | None
