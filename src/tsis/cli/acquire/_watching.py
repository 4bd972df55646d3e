"""The press guard, live: flags of the press in the newest frame."""

from __future__ import annotations

import signal
import time
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rich.console import Console
from rich.live import Live
from rich.markup import escape

import tsis
from tsis.cli._groups import ended_by
from tsis.cli._output import print_watched
from tsis.present.terminal import print_notice

if TYPE_CHECKING:
    from collections.abc import Callable

    from tsis.calibration.frames import UsableCalibration
    from tsis.calibration.guard.limits import GuardFlag
    from tsis.calibration.guard.watch import PressWatch, WatchState
    from tsis.instrument.acquisition import Acquisition, ReceivedFrame
    from tsis.instrument.force_log import ForceLog


WAIT_S = 0.2
FORCE_HOLDS_S = 1.0  # an older reading is not used


@dataclass(frozen=True, slots=True, kw_only=True)
class _Observation:
    """Flags and force of one frame."""

    flags: tuple[GuardFlag, ...]
    force_n: float | None
    state: WatchState


def watch_presses(
    acquisition: Acquisition,
    *,
    seconds: float | None,
    calibration: UsableCalibration | None,
    log: ForceLog | None,
    as_json: bool,
) -> None:
    """Print flags as they appear and disappear, until Ctrl-C or the given seconds have passed."""
    console = Console(stderr=as_json, highlight=False)
    frames: Counter[str] = Counter()
    watch: PressWatch | None = None
    state, position, begun_s = tsis.calibration.guard.watch.WatchState(), 0, time.monotonic()
    troubles = _Troubles(console)
    with ended_by(signal.SIGINT) as ended, Live(console=console, transient=True, auto_refresh=False) as live:
        while not ended.is_set() and not (seconds is not None and time.monotonic() - begun_s >= seconds):
            arrivals, position = _newest(acquisition, position)
            troubles.report("camera", str(acquisition.failure or "") if acquisition.lost or acquisition.ended else "")
            troubles.report("gauge", "" if log is None else log.state().error)
            if not arrivals and acquisition.ring.closed:
                break
            for received in arrivals:
                watch = watch or tsis.calibration.guard.watch.press_watch(received.frame, calibration)
                observed = _observe(watch, state, received, log)
                _report(console.print, state.raised, observed.flags)
                state = observed.state
                frames.update(["frames", *(flag.name for flag in observed.flags)])
                live.update(_line(acquisition, observed), refresh=console.is_terminal)
    if as_json:
        print_watched(frames)
        return
    print_notice(console)


def _newest(acquisition: Acquisition, index: int) -> tuple[tuple[ReceivedFrame, ...], int]:
    """The newest frame of a camera, or every stored frame; and the next index."""
    acquisition.ring.wait(index, WAIT_S)
    arrivals, index, _ = acquisition.ring.read(index)
    return arrivals if acquisition.ring.patient else arrivals[-1:], index


class _Troubles:
    """Trouble of an instrument, printed once when it begins and once when it ends."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._reported: dict[str, str] = {}

    def report(self, what: str, trouble: str) -> None:
        if bool(trouble) != bool(self._reported.get(what)):
            self._reported[what] = trouble
            self._console.print(f"! {what}: {trouble or 'is back'}", markup=False, soft_wrap=True)


def _observe(watch: PressWatch, state: WatchState, received: ReceivedFrame, log: ForceLog | None) -> _Observation:
    # The newest reading: the reading at the frame's time would have to wait for the next one.
    readings = () if log is None else log.readings(since_s=received.arrived_s - FORCE_HOLDS_S)
    force = max(0.0, readings[-1].force_n) if readings else None
    flags, after = watch.step(state, received.frame, force)
    return _Observation(flags=flags, force_n=force, state=after)


def _report(say: Callable[..., None], before: frozenset[str], flags: tuple[GuardFlag, ...]) -> None:
    for flag in flags:
        if flag.name not in before:
            say(f"+ {flag.name}: {flag.advice}", markup=False, soft_wrap=True)
    for name in sorted(before - {flag.name for flag in flags}):
        say(f"- {name}", markup=False)


def _line(acquisition: Acquisition, observation: _Observation) -> str:
    account = acquisition.account()
    force = "" if observation.force_n is None else f", {observation.force_n:.2f} N"
    still = "" if observation.state.settling is None else f", {observation.state.settling.text}"
    names = ", ".join(flag.name for flag in observation.flags) or "no flags"
    return escape(f"{account.frames_per_s:.1f} frames/s, {account.missed} lost{force}{still}: {names}")
