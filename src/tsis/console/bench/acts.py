"""What is done with the bench: one act at a time, by who holds the camera."""

from __future__ import annotations

import threading
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING

from tsis.console.bench.jobs import RUNNING
from tsis.model.errors import ControlError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from tsis.console.bench.control import Control
    from tsis.console.bench.jobs import Job

PATIENCE_S = 2.0  # for which an act waits for the one before
LONG_S = 10.0  # after which is told how long an act has lasted, as while mechanics are solved for the first time
SEQUENCE_S = 5.0  # for which a sequence that was asked to end is waited for


class Acts:
    """Lets one act at a time pass; an act that lasts is named to those who come meanwhile.

    Parameters
    ----------
    control
        Says who holds the camera.
    patience_s
        How long an act waits for the one before, s.
    clock
        Tells the time, s.

    Attributes
    ----------
    sequence
        The job of the sequence under way or of the last one; None before the first.

    Examples
    --------
    >>> from tsis.console.bench.control import Control
    >>> control = Control()
    >>> control.take("tab 1", "Ann")
    >>> acts = Acts(control)
    >>> with acts.act("tab 1", "moving the probe"):
    ...     acts.busy
    'moving the probe'
    """

    def __init__(
        self, control: Control, *, patience_s: float = PATIENCE_S, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._control, self._patience_s, self._clock = control, patience_s, clock
        self._one = threading.Lock()
        self._doing: tuple[str, float] | None = None  # what, and since when
        self._closed = False
        self.sequence: Job | None = None

    @property
    def busy(self) -> str:
        """What is being done now, as ``"moving the probe (12 s so far)"``; empty when nothing is."""
        now = self._doing
        if now is None:
            return ""
        doing, since_s = now
        lasted_s = self._clock() - since_s
        return doing if lasted_s < LONG_S else f"{doing} ({lasted_s:.0f} s so far)"

    @contextmanager
    def act(self, by: str, doing: str, *, instead: str = "") -> Iterator[None]:
        """Do something inside, as who holds the camera, and as nobody else does anything.

        Parameters
        ----------
        by
            Identity of who acts.
        doing
            What is done, as others read it after "the bench is busy".
        instead
            What a sequence under way forbids, as "another camera can be chosen"; empty where it forbids nothing.

        Raises
        ------
        ControlError
            When somebody else holds the camera, another act lasts, a sequence forbids it, or the bench was closed.
        """
        self._control.require(by)
        if not self._one.acquire(timeout=self._patience_s):
            raise ControlError(f"the bench is busy {self.busy or 'with something else'}; try again when that is over")
        try:
            self._require_open()
            with self._control.acting(by):  # or somebody has taken the camera over while this act waited
                if instead:
                    self.require_no_sequence(instead)
                self._doing = doing, self._clock()
                yield
        finally:
            self._doing = None
            self._one.release()

    def require_no_sequence(self, instead: str) -> None:
        """Refuse, with `ControlError`, what would spoil a sequence under way."""
        if self.sequence is not None and self.sequence.state().status == RUNNING:
            raise ControlError(f"a sequence is being recorded; {instead} when it is over (or end it)")

    def close(self) -> None:
        """Let no further act pass; one that is under way goes on, and a sequence is ended as a whole one."""
        self._closed = True
        if self.sequence is not None:
            self.sequence.end()
            self.sequence.wait(SEQUENCE_S)

    def _require_open(self) -> None:
        if self._closed:
            raise ControlError("the console is being ended; nothing can be done any more (start it again)")
