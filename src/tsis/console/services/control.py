"""The control lock: one operator commands the camera."""

from __future__ import annotations

import threading
import time
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tsis.console.services.jobs import RUNNING
from tsis.errors import ControlError, InputError
from tsis.model.require import require_number, require_type

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from tsis.console.services.jobs import Job


LOCK_S = 10.0  # timeout of an owner without a sign of life
SHORTEST_LOCK_S, LONGEST_LOCK_S = 1.0, 3600.0
LONGEST_OWNER_NAME = 60


@dataclass(frozen=True, slots=True, kw_only=True)
class Owner:
    """The owner of the camera's control: a browser tab or a script by its identity, and the name that others see."""

    identity: str
    name: str


class ControlLock:
    """Gives the camera to one owner at a time; safe for several threads. ``clock`` gives monotonic seconds.

    Examples
    --------
    >>> control = ControlLock()
    >>> control.take("tab 1", "Ann")
    >>> control.require("tab 2")
    Traceback (most recent call last):
    tsis.errors.ControlError: the camera is controlled by Ann; watch, or take it over
    """

    def __init__(self, *, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock, self._lock = clock, threading.Lock()
        self._owner: Owner | None = None
        self._heard_s, self._lock_s = 0.0, LOCK_S
        self._taken_from = self._acting = ""

    def owner(self) -> Owner | None:
        """The owner; None without one."""
        with self._lock:
            return self._present()

    def take(self, identity: str, name: str, *, over: bool = False, held_s: float = LOCK_S) -> None:
        """Take the camera; ``over`` takes it from another owner, else that is a `ControlError`.

        The lock ends after ``held_s`` seconds, in [1, 3600], without a sign of life of the owner. Raises `InputError`
        when the name cannot be shown, or the time lies outside its range.
        """
        require_type("identity", identity, str)
        require_type("name", name, str)
        if not name.strip() or not name.isprintable() or len(name) > LONGEST_OWNER_NAME:
            raise InputError(f"name must be 1 to {LONGEST_OWNER_NAME} characters that can be shown; got {name!r:.80}")
        require_number("held_s", held_s, SHORTEST_LOCK_S, LONGEST_LOCK_S, hint="seconds")
        with self._lock:
            stored = self._present()
            other = stored is not None and stored.identity != identity
            if stored is not None and other and not over:
                raise self._require_owner(stored, identity)
            self._taken_from = stored.identity if stored is not None and other else self._taken_from
            self._owner, self._lock_s = Owner(identity=identity, name=name), held_s
            self._heard_s = self._clock()

    def heard_of(self, identity: str) -> None:
        """Record a sign of life of the owner; nothing for anybody else."""
        with self._lock:
            stored = self._present()
            if stored is not None and stored.identity == identity:
                self._heard_s = self._clock()

    def release(self, identity: str) -> None:
        """Release the camera; nothing for anybody but the owner."""
        with self._lock:
            if self._owner is not None and self._owner.identity == identity:
                self._owner = None

    def require(self, identity: str) -> None:
        """Raise `ControlError` for anybody but the owner."""
        with self._lock:
            stored = self._present()
            if stored is None:
                raise ControlError("nobody controls the camera; take it first")
            if stored.identity != identity:
                raise self._require_owner(stored, identity)
            self._heard_s = self._clock()

    @contextmanager
    def acting(self, identity: str) -> Iterator[None]:
        """Keep the lock during a long command; errors as `require`."""
        self.require(identity)
        self._acting = identity
        try:
            yield
        finally:
            with self._lock:
                self._acting = ""
                if self._owner is not None and self._owner.identity == identity:
                    self._heard_s = self._clock()

    def _present(self) -> Owner | None:
        """The owner; a running command is a sign of life."""
        silent = self._clock() - self._heard_s > self._lock_s
        if silent and self._owner is not None and self._owner.identity != self._acting:
            self._owner = None
        return self._owner

    def _require_owner(self, owner: Owner, identity: str) -> ControlError:
        if identity == self._taken_from:
            return ControlError(f"{owner.name} has taken the camera over; watch, or take it back")
        return ControlError(f"the camera is controlled by {owner.name}; watch, or take it over")


COMMAND_TIMEOUT_S = 2.0  # for which a command waits for the one before
LONG_S = 10.0  # after which the duration of a command is shown, as of mechanics that are solved for the first time
SEQUENCE_S = 5.0  # timeout of a cancelled sequence


class Commands:
    """Runs one command at a time; a long command is named to those who wait up to ``timeout_s``.

    ``sequence`` is the job of the running sequence or of the last one; None before the first.

    Examples
    --------
    >>> from tsis.console.services.control import ControlLock
    >>> control = ControlLock()
    >>> control.take("tab 1", "Ann")
    >>> commands = Commands(control)
    >>> with commands.run("tab 1", "moving the probe"):
    ...     commands.busy
    'moving the probe'
    """

    def __init__(
        self,
        control: ControlLock,
        *,
        timeout_s: float = COMMAND_TIMEOUT_S,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._control, self._timeout_s, self._clock = control, timeout_s, clock
        self._lock = threading.Lock()
        self._doing: tuple[str, float] | None = None  # what, and since when
        self._closed = False
        self.sequence: Job | None = None

    @property
    def busy(self) -> str:
        """The running command, as ``"moving the probe (12 s so far)"``; empty without one."""
        now = self._doing
        if now is None:
            return ""
        doing, since_s = now
        lasted_s = self._clock() - since_s
        return doing if lasted_s < LONG_S else f"{doing} ({lasted_s:.0f} s so far)"

    @contextmanager
    def run(self, by: str, doing: str, *, instead: str = "") -> Iterator[None]:
        """Run a command of the owner inside, alone.

        ``doing`` names the command to others; ``instead`` says what a running sequence forbids, as "another camera can
        be chosen", and is empty where it forbids nothing. Raises `ControlError` when somebody else has the camera,
        another command runs, a sequence forbids it, or the instrument is closed.
        """
        self._control.require(by)
        if not self._lock.acquire(timeout=self._timeout_s):
            raise ControlError(
                f"the instrument is busy {self.busy or 'with another command'}; try again when that is done"
            )
        try:
            self._require_open()
            with self._control.acting(by):  # another client may have taken the camera over meanwhile
                if instead:
                    self.require_no_sequence(instead)
                self._doing = doing, self._clock()
                yield
        finally:
            self._doing = None
            self._lock.release()

    def require_no_sequence(self, instead: str) -> None:
        """Raise `ControlError` while a sequence runs."""
        if self.sequence is not None and self.sequence.state().status == RUNNING:
            raise ControlError(f"a sequence is being recorded; {instead} when it is over (or end it)")

    def close(self) -> None:
        """Refuse further commands; a running one continues, and a sequence is ended completely."""
        self._closed = True
        if self.sequence is not None:
            self.sequence.end()
            self.sequence.wait(SEQUENCE_S)

    def _require_open(self) -> None:
        if self._closed:
            raise ControlError("the console is shutting down and takes no commands (start it again)")
