"""The person at the bench: asked for each step, and told what happens."""

from __future__ import annotations

import os
import queue
import sys
import threading
from typing import TYPE_CHECKING

from tsis.model.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rich.console import Console

    from tsis.calibration.session import CalibrationFrame, CalibrationStep, LiveBench


class Operator:
    """Takes a step's frames when the person says that all is ready.

    Parameters
    ----------
    bench
        Camera, and gauge where there is one.
    console
        Where to ask; answers come from standard input.
    has_gauge
        Whether forces are read by a gauge; else the person types them.
    """

    def __init__(self, bench: LiveBench, console: Console, *, has_gauge: bool) -> None:
        self._bench, self._console, self._has_gauge = bench, console, has_gauge

    def take(self, step: CalibrationStep) -> Iterator[CalibrationFrame] | None:
        """The step's frames; None when the person leaves it out."""
        hint = "Enter when ready" + (", s to leave it out: " if step.optional else ": ")
        answer = self._answer(f"   {hint}").strip().lower()
        if step.optional and answer == "s":
            return None
        if not step.is_loading:
            return self._bench.still(step.frames)
        return self._by_gauge() if self._has_gauge else self._by_hand()

    def _by_gauge(self) -> Iterator[CalibrationFrame]:
        """A frame every half second with its force, until Enter."""
        answers: queue.SimpleQueue[InputError | None] = queue.SimpleQueue()

        def wait() -> None:
            try:
                self._answer("   load now, slowly; Enter when it is back at 0: ")
            except InputError as error:
                answers.put(error)
            else:
                answers.put(None)

        def over() -> bool:
            if answers.empty():
                return False
            if (error := answers.get()) is not None:
                raise error
            return True

        threading.Thread(target=wait, name="waiting for Enter", daemon=True).start()
        return self._bench.loading(over)

    def _by_hand(self) -> Iterator[CalibrationFrame]:
        """A frame for each force that the person types."""
        while True:
            text = self._answer(
                "   force in N that the gauge shows (begin with 0, untouched; Enter alone ends): "
            ).strip()
            if not text:
                return
            try:
                yield self._bench.one(float(text.replace(",", ".")))
            except ValueError as error:
                self._console.print(
                    f"   {error if isinstance(error, InputError) else 'that is no number'}", markup=False
                )

    def _answer(self, question: str) -> str:
        self._console.print(question, end="", markup=False, soft_wrap=True)
        line = _line()
        if not line:
            raise InputError("the guide needs answers on standard input, which has ended; run it in a terminal")
        return line


def _line() -> str:
    """The next line of standard input; empty when there are no more.

    Read past Python's buffer: while a thread waits in it for Enter, the program could not end after an error.
    """
    if sys.stdin is None:  # closed by who started the program
        return ""
    try:
        source = sys.stdin.fileno()
    except OSError:  # no file, but text that stands in for one
        return sys.stdin.readline()
    line = bytearray()
    while not line.endswith(b"\n") and (byte := os.read(source, 1)):
        line += byte
    return line.decode(errors="replace")
