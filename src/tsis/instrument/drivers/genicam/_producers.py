"""GenTL producers: the drivers (``.cti`` files) through which Harvesters uses cameras of any maker.

A producer serves one caller per process, so the cameras and searches of this process share it and release it together.
"""

from __future__ import annotations

import contextlib
import logging
import os
import signal
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tsis.errors import CameraError
from tsis.files import printable_name
from tsis.instrument.drivers.genicam._link import maker_library, reason

if TYPE_CHECKING:
    from collections.abc import Iterator


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
