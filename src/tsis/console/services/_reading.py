"""Force readings at a frame, problems of the instrument, and what it was set to when the program was killed."""

from __future__ import annotations

import json
import time
from contextlib import suppress
from typing import TYPE_CHECKING

from tsis.console.services._subject import CameraChoice, PressForce
from tsis.errors import InputError
from tsis.files.json_values import from_json_value, to_json_value
from tsis.files.reading import printable_path
from tsis.virtual.camera import FORCE_SETTING

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from tsis.console.services._jobs import JobState
    from tsis.console.services._state import CameraState
    from tsis.instrument.acquisition import ReceivedFrame
    from tsis.instrument.gauge import ForceLog
    from tsis.records.store import Store


HOLDS_S = 1.0  # a reading older than this tells nothing of the press now
GAUGE_WAIT_S = 1.0
STORE_CHECK_EVERY_S = 1.0  # the state is read more often


def force_at(frame: ReceivedFrame, log: ForceLog | None, typed_n: float | None) -> PressForce | None:
    """The force at a frame of the live view: the newest reading, without waiting for the next one."""
    if log is not None:
        readings = log.readings(since_s=frame.arrived_s - HOLDS_S)
        return PressForce(value_n=max(0.0, readings[-1].force_n), source="gauge") if readings else None
    if frame.frame.settings.get("source") == "virtual" and FORCE_SETTING in frame.frame.settings:
        return PressForce(value_n=float(frame.frame.settings[FORCE_SETTING]), source="virtual")
    return None if typed_n is None else PressForce(value_n=typed_n, source="typed")


def gauge_force(log: ForceLog, frame: ReceivedFrame, *, wait_s: float = GAUGE_WAIT_S) -> PressForce:
    """The gauge's force at a saved frame, once the reading after it has come; `GaugeError` when none comes."""
    log.wait_until(frame.arrived_s, timeout_s=wait_s)
    return PressForce(value_n=max(0.0, log.at(frame.arrived_s).force_n), source="gauge")


class StoreCheck:
    """Checks at intervals whether the store is still where it was opened; ``clock`` gives seconds."""

    def __init__(self, store: Store, *, clock: Callable[[], float] = time.monotonic) -> None:
        self._store, self._clock = store, clock
        self._last = (clock(), False)

    def trouble(self) -> str:
        """Where it is gone from; empty while it is there."""
        now, (last_seen_s, gone) = self._clock(), self._last
        if now - last_seen_s >= STORE_CHECK_EVERY_S:
            gone = self._store.database.replaced()
            self._last = now, gone
        return printable_path(self._store.folder) if gone else ""


def trouble_messages(
    camera: CameraState,
    log: ForceLog | None,
    unfit: str,
    watching: str,
    *,
    store_gone: str = "",
    notices: Sequence[str] = (),
) -> tuple[str, ...]:
    """Messages of problems, the most urgent first.

    ``unfit`` says why the calibration is inactive, ``watching`` why frames cannot be analysed, and ``store_gone`` where
    the store was; each is empty without that problem. ``log`` is the gauge in use, if any. ``notices`` come last.
    """
    results = []
    if store_gone:
        results.append(
            f"The store in {store_gone} was moved or replaced since it was opened, and nothing can be kept: "
            "put it back, or start anew."
        )
    if camera.lost:
        why = f": {camera.failure}" if camera.failure else ""
        results.append(f"The camera is away{why}. Reconnecting; saved data are safe.")
    gauge = None if log is None else log.state()
    if gauge is not None and not gauge.running:
        results.append(f"The gauge is away: {gauge.error or 'its readings stopped'}.")
    if unfit:
        results.append(f"The calibration is inactive, and presses are saved without one: {unfit}.")
    if watching:
        results.append(f"The press cannot be judged: {watching}.")
    return (*results, *filter(None, notices))


class InstrumentMemory:
    """Keeps camera and target in a file while the program runs, so that a start after a kill finds them again."""

    def __init__(self, file: Path) -> None:
        self._file = file

    def begin(self, choice: CameraChoice) -> tuple[CameraChoice, int] | None:
        """Camera and target of a run of the same ``choice`` at the start that did not end in order; None without."""
        try:
            last = json.loads(self._file.read_text(encoding="utf-8"))
            started, chosen = (from_json_value(CameraChoice, last[name], "camera") for name in ("start", "choice"))
            target = int(last["target"])
        except (OSError, ValueError, KeyError, TypeError, InputError):  # ended in order, or never begun
            return None
        return (chosen, target) if started == choice else None

    def keep(self, start: CameraChoice, choice: CameraChoice, target: int) -> None:
        """Keep the present ones; a disk that refuses them stops nothing."""
        content = {"start": to_json_value(start), "choice": to_json_value(choice), "target": target}
        with suppress(OSError):
            self._file.parent.mkdir(parents=True, exist_ok=True)
            self._file.write_text(json.dumps(content), encoding="utf-8")

    def ended(self) -> None:
        """Forget them: the program ends in order."""
        with suppress(OSError):
            self._file.unlink()


def interruption_message(jobs: tuple[JobState, ...], restored: tuple[CameraChoice, int] | None) -> str:
    """What a program that was killed left behind; empty without that."""
    cut = ", ".join(state.title for state in jobs)
    parts = [f"Interrupted (saved data are safe): {cut}." if cut else ""]
    if restored is not None:
        choice, target = restored
        object_ = f" on {choice.phantom}" if choice.is_virtual else ""
        parts.append(f"Restored: camera {choice.spec}{object_}, target {target}; start the camera to continue.")
    text = " ".join(part for part in parts if part)
    return f"The console was not shut down properly. {text}" if text else ""
