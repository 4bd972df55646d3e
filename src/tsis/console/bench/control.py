"""Who holds the camera: one operator acts, everybody else watches."""

from __future__ import annotations

import threading
import time
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tsis.model.check import require_number, require_type
from tsis.model.errors import ControlError, InputError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

HELD_S = 10.0  # a holder who was not heard of for so long has gone
SHORTEST_HELD_S, LONGEST_HELD_S = 1.0, 3600.0
LONGEST_NAME = 60


@dataclass(frozen=True, slots=True, kw_only=True)
class Holder:
    """Who holds the camera.

    Attributes
    ----------
    identity
        Of the tab of a browser, or of a script.
    name
        What other people see.
    """

    identity: str
    name: str


class Control:
    """Gives the camera to one at a time; safe for several threads.

    Parameters
    ----------
    clock
        Seconds, monotonic.

    Examples
    --------
    >>> control = Control()
    >>> control.take("tab 1", "Ann")
    >>> control.require("tab 2")
    Traceback (most recent call last):
    tsis.model.errors.ControlError: the camera is held by Ann; watch, or take it over
    """

    def __init__(self, *, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock, self._lock = clock, threading.Lock()
        self._holder: Holder | None = None
        self._heard_s, self._held_s = 0.0, HELD_S
        self._taken_from = self._acting = ""

    def holder(self) -> Holder | None:
        """Who holds the camera now; None when nobody does."""
        with self._lock:
            return self._present()

    def take(self, identity: str, name: str, *, over: bool = False, held_s: float = HELD_S) -> None:
        """Hold the camera from now on; ``over`` takes it from whoever holds it.

        It is held until nothing was heard of the holder for ``held_s`` seconds, in [1, 3600].

        Raises
        ------
        ControlError
            When somebody else holds it.
        InputError
            When the name cannot be shown, or the time lies outside its range.
        """
        require_type("identity", identity, str)
        require_type("name", name, str)
        if not name.strip() or not name.isprintable() or len(name) > LONGEST_NAME:
            raise InputError(f"name must be 1 to {LONGEST_NAME} characters that can be shown; got {name!r:.80}")
        require_number("held_s", held_s, SHORTEST_HELD_S, LONGEST_HELD_S, hint="seconds")
        with self._lock:
            held = self._present()
            other = held is not None and held.identity != identity
            if held is not None and other and not over:
                raise self._held_by(held, identity)
            self._taken_from = held.identity if held is not None and other else self._taken_from
            self._holder, self._held_s = Holder(identity=identity, name=name), held_s
            self._heard_s = self._clock()

    def heard_of(self, identity: str) -> None:
        """Say that the holder is still there; of anybody else it changes nothing."""
        with self._lock:
            held = self._present()
            if held is not None and held.identity == identity:
                self._heard_s = self._clock()

    def release(self, identity: str) -> None:
        """Give the camera back; of anybody but the holder it changes nothing."""
        with self._lock:
            if self._holder is not None and self._holder.identity == identity:
                self._holder = None

    def require(self, identity: str) -> None:
        """Refuse an act of who does not hold the camera, with `ControlError`."""
        with self._lock:
            held = self._present()
            if held is None:
                raise ControlError("nobody holds the camera; take it first")
            if held.identity != identity:
                raise self._held_by(held, identity)
            self._heard_s = self._clock()

    @contextmanager
    def acting(self, identity: str) -> Iterator[None]:
        """Do inside what may last longer than a holder may be silent; refusals as `require`."""
        self.require(identity)
        self._acting = identity
        try:
            yield
        finally:
            with self._lock:
                self._acting = ""
                if self._holder is not None and self._holder.identity == identity:
                    self._heard_s = self._clock()

    def _present(self) -> Holder | None:
        """Whoever acts is there, however long nothing else was heard."""
        silent = self._clock() - self._heard_s > self._held_s
        if silent and self._holder is not None and self._holder.identity != self._acting:
            self._holder = None
        return self._holder

    def _held_by(self, holder: Holder, identity: str) -> ControlError:
        if identity == self._taken_from:
            return ControlError(f"{holder.name} has taken the camera over; watch, or take it back")
        return ControlError(f"the camera is held by {holder.name}; watch, or take it over")
