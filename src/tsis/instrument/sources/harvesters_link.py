"""A hold on one camera through Harvesters: its node map, and its buffers as they come."""

from __future__ import annotations

import contextlib
import threading
import time
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.instrument.sources import genicam_producers
from tsis.instrument.sources.genicam_link import Grab, buffer_count
from tsis.instrument.sources.genicam_nodes import ChoiceNode, NumberNode, first_number
from tsis.instrument.sources.genicam_producers import PRODUCERS
from tsis.instrument.sources.grey_formats import FULL_SCALE

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

# A look inside Harvesters holds Python's interpreter lock, so looks are short and other threads run between them.
_LOOK_S, _PAUSE_S = 0.001, 0.002


class HarvestersNodes:
    """Harvesters' node map."""

    def __init__(self, node_map: Any) -> None:
        self._map = node_map
        _, self._failure = genicam_producers.failures()

    def read(self, name: str) -> NumberNode | ChoiceNode | None:
        """What the camera holds under that name; None when it is absent or cannot be read now."""
        try:
            node = getattr(self._map, name)
            value = node.value
            if hasattr(node, "symbolics"):
                return ChoiceNode(value=value, options=tuple(node.symbolics))
            if isinstance(value, bool):
                return NumberNode(value=float(value), low=0.0, high=1.0, step=1.0)
            if not isinstance(value, (int, float)):
                return None
            step = float(node.inc) if isinstance(value, int) else 0.0
            return NumberNode(value=value, low=node.min, high=node.max, step=step, unit=node.unit)
        except (AttributeError, self._failure):  # absent, or not readable in the present state
            return None

    def write(self, name: str, value: float | str) -> None:
        """Change it, in the kind of number that the camera holds."""
        node = getattr(self._map, name)
        node.value = value if isinstance(value, str) else type(node.value)(value)


class HarvestersLink:
    """A hold on one camera through Harvesters."""

    def __init__(self, acquirer: Any, identity: str, file: Path) -> None:
        self._acquirer, self.identity, self._file = acquirer, identity, file
        self.nodes = HarvestersNodes(acquirer.remote_device.node_map)
        self.errors = genicam_producers.failures()
        self.present = True  # GenTL tells no removal without events; silence does
        self._torn = threading.Event()
        events = genicam_producers.harvesters().ImageAcquirer.Events
        acquirer.add_callback(events.INCOMPLETE_BUFFER, _incomplete_buffers(self._torn))

    def begin(self) -> None:
        """Announce buffers and let the camera send."""
        payload = first_number(self.nodes, ["PayloadSize"])
        self._acquirer.num_buffers = max(
            buffer_count(0.0 if payload is None else payload[1].value), self._acquirer.min_num_buffers
        )
        self._acquirer.start()

    def grab(self, timeout_s: float) -> Grab | None:
        """The next buffer, given back once its pixels are copied; None when none came within the time."""
        end_s = time.monotonic() + timeout_s
        while True:
            buffer = self._acquirer.try_fetch(timeout=_LOOK_S)
            if buffer is not None:
                try:
                    return Grab(pixels=_grey(buffer), number=_number(buffer), time_s=_stamp_s(buffer))
                finally:
                    buffer.queue()
            if self._torn.is_set():
                self._torn.clear()
                return Grab(pixels=None)
            if time.monotonic() >= end_s:
                return None
            time.sleep(_PAUSE_S)

    def end(self) -> None:
        """Let the camera send no more."""
        self._acquirer.stop()

    def close(self) -> None:
        """Let go of the camera, and of its producer when nobody else uses that."""
        chunks = getattr(self._acquirer, "_chunk_adapter", None)
        with contextlib.ExitStack() as afterwards:
            afterwards.callback(PRODUCERS.give_back, self._file)
            last_act = getattr(chunks, "_finalizer", None)
            if last_act is not None:  # left alone, it would keep the node map, half a megabyte, until the program ends
                afterwards.callback(last_act)
            self._acquirer.__exit__(None, None, None)  # as destroy(), but leaves nothing to be done at the end


def _incomplete_buffers(seen: threading.Event) -> Any:
    """Sets ``seen`` for each buffer that comes incomplete, which Harvesters queues again without a word."""
    core = genicam_producers.harvesters()
    return type("IncompleteBuffers", (core.Callback,), {"emit": lambda *_: seen.set()})()


def _grey(buffer: Any) -> NDArray[Any] | None:
    """The grey part of a buffer, copied; None when it has none."""
    for part in buffer.payload.components:
        if part is not None and part.data_format in FULL_SCALE:
            rows = np.asarray(part.data).reshape(part.height, -1)  # a row may end in padding
            return rows[:, : part.width].copy()
    return None


def _number(buffer: Any) -> int | None:
    try:
        return int(buffer.module.frame_id)
    except genicam_producers.failures():
        return None


def _stamp_s(buffer: Any) -> float | None:
    """The camera's own time; Harvesters answers 0 where the producer tells none."""
    ticks = buffer.timestamp
    return ticks / buffer.timestamp_frequency if ticks else None
