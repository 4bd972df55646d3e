"""The order of work on Examine: what is done, what is next, and the filled button."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

import pytest
from tests.console.pages.simulated import at_console

from tsis.console.pages.examine import SavedTarget, next_step, work_steps

if TYPE_CHECKING:
    from tests.console.pages.simulated import Operator

    from tsis.console.services.instrument import Instrument

WHEN = datetime(2026, 3, 1, tzinfo=UTC)


def state(*, running: bool = True, calibration: str = "bench", sphere: bool = False) -> Any:
    camera = SimpleNamespace(running=running, lost=False, choice=SimpleNamespace(is_sphere=sphere))
    roles = ("target", "ball" if sphere else "plain", "untouched")
    return SimpleNamespace(camera=camera, target=3, role="target", roles=roles, calibration=calibration)


def saved(*roles: str, estimated: timedelta | None = None) -> SavedTarget:
    presses = tuple(SimpleNamespace(taken=WHEN) for _ in roles)
    estimates = () if estimated is None else (SimpleNamespace(made=WHEN + estimated),)
    return SavedTarget(
        number=3,
        target=cast("Any", SimpleNamespace()) if roles else None,
        count=len(roles),
        presses=cast("Any", presses),
        estimates=cast("Any", estimates),
        roles=frozenset(roles),
    )


@pytest.mark.parametrize(
    ("present", "stored", "requested"),
    [
        (state(running=False), saved(), "camera"),
        (state(calibration=""), saved(), "calibration"),
        (state(), saved(), "reference"),
        (state(), saved("target"), "reference"),
        (state(), saved("plain"), "presses"),
        (state(sphere=True), saved("plain"), "reference"),
        (state(sphere=True), saved("ball"), "presses"),
        (state(), saved("plain", "target"), "estimate"),
        (state(), saved("plain", "target", estimated=timedelta(seconds=-1)), "estimate"),  # a press came after it
        (state(), saved("plain", "target", estimated=timedelta(seconds=1)), "report"),
    ],
)
def test_the_next_step_is_the_first_that_is_not_done(present: Any, stored: SavedTarget, requested: str) -> None:
    steps = work_steps(present, stored)
    step = next_step(steps)
    assert step.name == requested
    assert step.cure
    names = [item.name for item in steps]
    assert names == ["camera", "calibration", "target", "reference", "presses", "estimate", "report"]


@pytest.mark.slow
def test_a_first_start_says_what_this_is_and_leads_on(lit: Instrument) -> None:
    async def script(operator: Operator) -> None:
        await operator.sees("What this is", "Try the virtual probe", "Connect a camera", "Open my images")
        await operator.sees("Next: Start the camera.")
        await operator.clicks("Start")
        await operator.misses("Try the virtual probe")
        await operator.sees("Next: Calibrate the probe")

    at_console(lit, script)


@pytest.mark.slow
def test_help_has_the_page_s_keys_fields_and_terms(lit: Instrument) -> None:
    async def script(operator: Operator) -> None:
        await operator.clicks("Help")
        await operator.sees("Help: Examine", "save a snapshot", "Number of the target that snapshots go to", "Terms")
        await operator.clicks("Close")
        await operator.misses("Help: Examine")

    at_console(lit, script)
