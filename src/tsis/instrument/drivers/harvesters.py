"""The connection to a camera through Harvesters: GenTL producers (``.cti`` files), node map and buffers."""

from __future__ import annotations

import contextlib
import logging
import os
import signal
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.errors import CameraError
from tsis.files.reading import printable_name
from tsis.instrument.discovery import CameraInfo, missing_message
from tsis.instrument.drivers.frame_numbers import FULL_SCALE
from tsis.instrument.drivers.genicam import (
    ChoiceNode,
    GenICamCamera,
    Grab,
    NumberNode,
    buffers_of,
    camera_not_found,
    cannot_open,
    maker_library,
    reason,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterator, Sequence

    from numpy.typing import NDArray


PATH_VARIABLE = "GENICAM_GENTL64_PATH"


def producer_files() -> tuple[Path, ...]:
    """The producers in the environment variable of the GenTL standard, in its order."""
    folders = [Path(folder) for folder in os.environ.get(PATH_VARIABLE, "").split(os.pathsep) if folder]
    files = [file for folder in folders for file in (sorted(folder.glob("*.cti")) if folder.is_dir() else [folder])]
    return tuple(dict.fromkeys(file for file in files if file.suffix == ".cti" and file.is_file()))


class Producers:
    """The producers of this process, each opened once and closed with its last use."""

    def __init__(self) -> None:
        self._open: dict[Path, tuple[Any, int]] = {}
        self._changing = threading.Lock()

    def take(self, file: Path) -> Any:
        """The harvester of that producer; its first user updates its list of cameras."""
        with self._changing:
            harvester, users = self._open.get(file, (None, 0))
            if harvester is None:
                harvester = _harvester(file)
            self._open[file] = harvester, users + 1
            return harvester

    def give_back(self, file: Path) -> None:
        """End one use of it."""
        with self._changing:
            harvester, users = self._open.pop(file)
            if users > 1:
                self._open[file] = harvester, users - 1
            else:
                harvester.reset()


PRODUCERS = Producers()


@contextlib.contextmanager
def interrupts_preserved() -> Iterator[None]:
    """Preserve this program's handler of Ctrl-C: Harvesters replaces it when it opens a camera."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.getsignal(signal.SIGINT)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def harvesters() -> Any:
    """The library."""
    return maker_library("harvesters.core", source="genicam")


def failures() -> tuple[type[Exception], ...]:
    """Exceptions of a camera or a producer that does not answer."""
    gentl, genapi = (maker_library(name, source="genicam") for name in ("genicam.gentl", "genicam.genapi"))
    return gentl.GenericException, genapi.GenericException


def busy_failures() -> tuple[type[Exception], ...]:
    """Exceptions of a camera that another program uses."""
    gentl = maker_library("genicam.gentl", source="genicam")
    return gentl.ResourceInUseException, gentl.AccessDeniedException


def _harvester(file: Path) -> Any:
    core = harvesters()
    # its warnings go to the log, not to the terminal; each becomes an error or does not matter
    log = logging.getLogger("tsis.harvesters")
    if not log.handlers:
        log.addHandler(logging.NullHandler())
    harvester = core.Harvester(config=core.ParameterSet({core.ParameterKey.LOGGER: log}))
    try:
        harvester.add_file(str(file), check_validity=True)
    except OSError as error:
        raise CameraError(f"the GenTL producer {printable_name(file)!r} cannot be loaded: {reason(error)}") from error
    harvester.update()
    return harvester


# A call into Harvesters holds Python's interpreter lock, so calls are short and other threads run between them.
_LOOK_S, _PAUSE_S = 0.001, 0.002


class HarvestersNodes:
    """Harvesters' node map."""

    def __init__(self, node_map: Any) -> None:
        self._map = node_map
        _, self._failure = failures()

    def read(self, name: str) -> NumberNode | ChoiceNode | None:
        """The value of that name; None when it is absent or not readable now."""
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
        """Write the value in the camera's number type."""
        node = getattr(self._map, name)
        node.value = value if isinstance(value, str) else type(node.value)(value)


class HarvestersLink:
    """The connection to one camera through Harvesters."""

    def __init__(self, acquirer: Any, identity: str, file: Path) -> None:
        self._acquirer, self.identity, self._file = acquirer, identity, file
        self.nodes = HarvestersNodes(acquirer.remote_device.node_map)
        self.errors = failures()
        self.present = True  # GenTL reports no removal without events; silence does
        self._torn = torn = threading.Event()
        core = harvesters()
        # Harvesters queues an incomplete buffer again without notice, but for this callback, which does not refer to
        # the link, so that both can be released.
        callback = type("IncompleteBuffers", (core.Callback,), {"emit": lambda *_: torn.set()})()
        acquirer.add_callback(core.ImageAcquirer.Events.INCOMPLETE_BUFFER, callback)

    def begin(self) -> None:
        """Allocate buffers and start the camera."""
        self._acquirer.num_buffers = max(buffers_of(self.nodes), self._acquirer.min_num_buffers)
        self._acquirer.start()

    def grab(self, timeout_s: float) -> Grab | None:
        """The next buffer, released after its pixels are copied; None when none arrived in time."""
        end_s = time.monotonic() + timeout_s
        while True:
            buffer = self._acquirer.try_fetch(timeout=_LOOK_S)
            if buffer is not None:
                try:
                    ticks = buffer.timestamp  # 0 where the producer gives no time
                    time_s = ticks / buffer.timestamp_frequency if ticks else None
                    return Grab(pixels=_grey(buffer), number=_number(buffer), time_s=time_s)
                finally:
                    buffer.queue()
            if self._torn.is_set():
                self._torn.clear()
                return Grab(pixels=None)
            if time.monotonic() >= end_s:
                return None
            time.sleep(_PAUSE_S)

    def end(self) -> None:
        """Stop the camera."""
        self._acquirer.stop()

    def close(self) -> None:
        """Release the camera, and its producer after its last use."""
        chunks = getattr(self._acquirer, "_chunk_adapter", None)
        with contextlib.ExitStack() as afterwards:
            afterwards.callback(PRODUCERS.give_back, self._file)
            last_act = getattr(chunks, "_finalizer", None)
            if last_act is not None:  # otherwise the node map, half a megabyte, stays until the program ends
                afterwards.callback(last_act)
            self._acquirer.__exit__(None, None, None)  # as destroy(), without a finalizer at the end


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
    except failures():
        return None


class HarvestersCamera(GenICamCamera):
    """A camera behind a GenTL producer, by its GenTL id, serial number or user-defined name; the first one when empty.

    The producers are those of ``GENICAM_GENTL64_PATH`` when None.
    """

    def __init__(
        self,
        identity: str = "",
        *,
        producers: Sequence[Path] | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__("genicam", identity, link=lambda: _opened(identity, _chosen(producers)), clock=clock)


def missing_requirement() -> str | None:
    """What is not installed or not set, with the cure; None when nothing is missing."""
    if (message := missing_message(harvesters)) is not None or producer_files():
        return message
    return (
        "the camera source genicam needs a GenTL producer (a .cti file of the camera maker's software) and found none; "
        f"install that software, or set {PATH_VARIABLE} to the folder of the file"
    )


def find_cameras_here(producers: Sequence[Path] | None = None) -> tuple[CameraInfo, ...]:
    """The cameras that the producers list now; `CameraError` when there is none and a producer cannot be loaded."""
    return tuple(
        CameraInfo(
            source="genicam",
            identity=device.id_,
            maker=_device_text(device, "vendor"),
            model=_device_text(device, "model"),
            note=file.name,
        )
        for device, file in _listed(_chosen(producers))
    )


def _chosen(producers: Sequence[Path] | None) -> Sequence[Path]:
    return producer_files() if producers is None else producers


def _device_text(device: Any, what: str) -> str:
    """A producer's text about a camera; empty where it has none."""
    absent: tuple[type[Exception], ...] = (AttributeError, *failures())
    try:
        return str(getattr(device, what) or "")
    except absent:
        return ""


def _listed(producers: Sequence[Path]) -> Generator[tuple[Any, Path]]:
    """Each device of each producer, with the producer in use meanwhile; producers that fail to load are skipped."""
    count, broken = 0, None
    for file in producers:
        try:
            harvester = PRODUCERS.take(file)
        except CameraError as error:
            broken = error
            continue
        try:
            for device in tuple(harvester.device_info_list):
                count += 1
                yield device, file
        finally:
            PRODUCERS.give_back(file)
    if broken is not None and not count:
        raise broken


def _opened(identity: str, producers: Sequence[Path]) -> HarvestersLink:
    if not producers:
        raise CameraError(missing_requirement() or "the camera source genicam was given no GenTL producer")
    others: list[str] = []
    with contextlib.closing(_listed(producers)) as listed:
        for device, file in listed:
            names = device.id_, _device_text(device, "serial_number"), _device_text(device, "user_defined_name")
            if not identity or identity in names:
                return _link(device, file)
            others.append(device.id_)
    raise camera_not_found("genicam", identity, others)


def _link(device: Any, file: Path) -> HarvestersLink:
    identity = device.id_
    harvester = PRODUCERS.take(file)
    core = harvesters()
    chunks_off = core.ParameterSet({core.ParameterKey.ENABLE_AUTO_CHUNK_DATA_UPDATE: False})
    try:
        with interrupts_preserved():
            return HarvestersLink(harvester.create(device, config=chunks_off), identity, file)
    except Exception as error:  # of any kind: Harvesters parses a file that the camera sends
        PRODUCERS.give_back(file)
        busy = isinstance(error, busy_failures())
        raise cannot_open(f"genicam camera {identity}", error, busy=busy) from error
